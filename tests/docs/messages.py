"""The texts that a user meets: messages of the code, and words that none of them may have (docs/nomenclature.md, "Words")."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
WORDS = 7
"""Words that a text needs at least to be a sentence to a reader."""

BANNED = {
    r"\b(told|tells?|telling) (\S+ ){0,4}apart\b": "separate, distinguish",
    r"\bas (it stands|they stand)\b": "unchanged",
    r"\b(says?|saying|said) so\b": "states this",
    r"\b(makes?|made|making) up for\b": "compensates",
    r"\bleaves? with \d": "exit code N",
    r"\bcareful reader\b": "checks",
    r"\bhow surely\b|\bhow well it is known\b|\bcan err\b": "uncertainty",
    r"\bwhatever is measured so\b": "measurements of this kind",
    r"\bno longer unseen\b": "no longer independent",
    r"\bflow uphill\b": "from cold to hot",
}
"""Phrases of no text of the project, comments included -> what to write."""

BOUND = {
    r"\b(cannot|could not|would) tell\b|\btold\b": "does not determine, states",
    r"\bunseen\b|\b[Hh]eld[- ]out\b": "hold-out record",
    r"\basked for\b": "requested",
    r"\bwander(s|ed|ing)?\b": "autocorrelated",
    r"\bhand(s|ed)? on\b": "inherited",
    r"\bsuspects?\b": "possible cause, candidate",
    r"\bnobody\b": "not stated",
    r"\bdoes not exist; give\b": "is 1.2. Give 0 to 1",
    r"\bstands? (under|beside|in|at)\b": "is given under",
    r"\bmend(s|ed)?\b": "correct",
    r"\bruns away\b": "rises without limit",
    r"(?<!there)(?<!There) is no (number|name|unit|value|table|text|probability|deck|file|node|conductor|channel|sensor)\b": "is not a",
    r"\bin place of\b": "instead of",
    r"\bhold(s)? a model to\b": "checks a model against",
    r"\b(say|Say|says) (so|it|where|which|what|how|whose)\b": "give, name, state",
}
"""Phrases of no message, because another word of the page is bound to the meaning -> that word."""


DIALECT = {
    r"\b([Nn]o|[Ss]ome)body('s)?\b": "name who or what; unmeasured, not stated",
    r"\b(cannot|could not|would) tell\b|\btold\b|\btells?\b": "does not determine, states",
    r"\bhand(s|ed|ing)? (on|up)\b": "inherited, passed on",
    r"\bin place of\b": "instead of",
    r"\b[Ww]ho(ever)? (has|had|knows|asks)\b": "if you",
    r"\bhangs? on\b|\brests? on what\b": "depends on",
    r"\bstands? (in|under|at|there|as)\b": "is, is given in",
    r"\bthat no (fit|stage|model) has seen\b|\bunseen\b": "hold-out record",
    r"\bleft over\b|\bwhat (it|a fit) leaves\b": "residual",
    r"\bwander(s|ed|ing)?\b": "autocorrelated",
    r"\bmend(s|ed)?\b": "correct",
    r"\bsuspects?\b": "possible cause, candidate",
    r"\basked for\b": "requested",
    r"\bt(ak(en?|es)|old) ([\w-]+ ){0,5}apart\b": "separate",
    r"\b(say|says|said) (what|how|which|where|why|that|whether|so|it|when|who|more)\b": "state, name, give",
    r"\bheld (against|to)\b|\bhold(s)? (it|them) against\b": "compared with, checked against",
    r"\bsettled stretch": "steady period",
    r"\bin silence\b": "silently, without a message",
    r"\bone's own\b|\bof (yours|theirs)\b": "your own",
    r"\blets? out\b": "loses, heat loss",
    r"\bfurthest off\b|\bby far off\b": "worst",
    r"\b(can|may|to) be had\b": "is available",
    r"\bmust be shown\b": "claim",
}
"""Phrases of no guide, no page of a design and no page of a report -> what to write."""

NOT_GUIDES = {"benchmarks.md", "codes.md", "coverage.md", "mutants.md", "recipes.md", "torture.md"}
"""Pages that programs write, or that are for developers."""


def guides() -> list[Path]:
    """Return the pages that are read: guides, pages of the design, README, templates of reports."""
    pages = [
        p
        for pattern in ("*.md", "howto/*.md", "from/*.md", "design/*.md")
        for p in (ROOT / "docs").glob(pattern)
        if p.name not in NOT_GUIDES
    ]
    pages += [ROOT / "README.md", ROOT / "examples/sisnav/study.md.in", *(ROOT / "examples").glob("*/README.md")]
    return [*sorted(pages), *sorted((ROOT / "src/thermid").rglob("*.jinja"))]


def sentences(text: str) -> Iterator[tuple[int, str]]:
    """Line and text of the prose of a page: without code, targets of links, markup and places of a template, or words."""
    bare = re.sub(
        r"^```.*?^```$|\{[%#].*?[%#]\}|^## Words$.*?(?=^## )", lambda m: "\n" * m[0].count("\n"), text, flags=re.DOTALL | re.MULTILINE
    )
    for number, line in enumerate(bare.splitlines(), 1):
        yield number, re.sub(r"`[^`]*`|\]\([^)]*\)|\{\{.*?\}\}|<[^>]*>", " ", line)


def text_of(node: ast.AST) -> str | None:
    """Text of a literal or of a formatted one, its places as {expression}."""
    match node:
        case ast.Constant(value=str(text)):
            return text
        case ast.JoinedStr(values=parts):
            return "".join(p.value if isinstance(p, ast.Constant) else "{" + ast.unparse(p.value) + "}" for p in parts)
    return None


def messages(path: Path) -> Iterator[tuple[int, str]]:
    """Line and text of every message of a file."""
    nodes = list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
    skipped: set[int] = set()
    for node in nodes:
        match node:
            case ast.Expr(value=ast.Constant() as text):  # docstrings, and those of attributes
                skipped.add(id(text))
            case ast.keyword(arg="help" | "description" | "epilog", value=text):
                skipped.add(id(text))
            case ast.JoinedStr(values=parts):
                skipped.update(id(part) for part in parts)
    for node in nodes:
        text = None if id(node) in skipped else text_of(node)
        if text and text[0] != "^" and len(re.findall(r"[A-Za-z]{2,}", re.sub(r"\{[^}]*\}", " ", text))) >= WORDS and "<" not in text:
            yield node.lineno, text
