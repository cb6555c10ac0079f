"""Draw messages of the code and sentences of the guides at random, for a test with readers: `draw_messages.py --seed 7`.

A message is a text of at least seven words outside docstrings and help texts; places that the code fills in are shown as {expression}.
The same seed draws the same texts from the same state of the sources.
"""

from __future__ import annotations

import argparse
import ast
import json
import random
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
WORDS = 7
GUIDES = ("docs/*.md", "docs/howto/*.md", "docs/from/*.md", "docs/studies/*.md")
NOT_GUIDES = {"benchmarks.md", "coverage.md", "mutants.md", "nomenclature.md", "recipes.md", "schema.md"}


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
    tree = ast.parse(path.read_text(encoding="utf-8"))
    skipped: set[int] = set()
    for node in ast.walk(tree):
        match node:
            case ast.Expr(value=ast.Constant() as text):  # docstrings, and those of attributes
                skipped.add(id(text))
            case ast.keyword(arg="help" | "description" | "epilog", value=text):
                skipped.add(id(text))
            case ast.JoinedStr(values=parts):
                skipped.update(id(part) for part in parts)
    for node in ast.walk(tree):
        text = None if id(node) in skipped else text_of(node)
        if text and len(re.findall(r"[A-Za-z]{2,}", re.sub(r"\{[^}]*\}", " ", text))) >= WORDS and "<" not in text:
            yield node.lineno, text


def all_messages() -> list[dict[str, object]]:
    """Every message of the sources, by file and line."""
    files = sorted((ROOT / "src" / "thermid").rglob("*.py"))
    return [{"file": str(p.relative_to(ROOT)), "line": line, "text": text} for p in files for line, text in sorted(messages(p))]


def sentences(path: Path) -> Iterator[str]:
    """Whole sentences of the paragraphs of a page; no headings, tables, lists or code."""
    text = re.sub(r"```.*?```", "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
    for block in re.split(r"\n\s*\n", text):
        if not re.match(r"\s*([#|>!<]|[-*] |\d+\. )", block):
            for sentence in re.split(r"(?<=[.?!])\s+(?=[A-Z`])", " ".join(block.split())):
                if len(sentence.split()) >= WORDS and sentence[-1] in ".?!":
                    yield sentence


def all_sentences() -> list[dict[str, object]]:
    """Every sentence of the guides, by page."""
    pages = sorted({p for pattern in GUIDES for p in ROOT.glob(pattern) if p.name not in NOT_GUIDES})
    return [{"file": str(p.relative_to(ROOT)), "text": s} for p in pages for s in sentences(p)]


def main() -> None:
    """Print what was drawn, as JSON."""
    parser = argparse.ArgumentParser(description="Draw messages of the code and sentences of the guides at random.")
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--messages", type=int, default=40)
    parser.add_argument("--sentences", type=int, default=20)
    arguments = parser.parse_args()
    chance = random.Random(arguments.seed)
    drawn = chance.sample(all_messages(), arguments.messages), chance.sample(all_sentences(), arguments.sentences)
    print(json.dumps({"seed": arguments.seed, "messages": drawn[0], "sentences": drawn[1]}, indent=1))


if __name__ == "__main__":
    main()
