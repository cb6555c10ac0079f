"""MATLAB text as statements: lines joined, comments taken off, ``name = expression`` split into words; what else there is, is refused."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

from thermid.errors import ExpressionError

_WORD = re.compile(r"\s*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)(?![\w.])|(?P<name>[A-Za-z]\w*)|(?P<sign>\.?[*/^]|[-+()]))")
_BRACKET = re.compile(r"\[([^\[\]]*)\]")
_HEAD = re.compile(r"(?P<name>[A-Za-z]\w*)\s*=(?!=)(?P<rest>.*)\Z", re.DOTALL)


@dataclass(frozen=True)
class Statement:
    """One assignment.

    Parameters
    ----------
    line : int              Where it begins, from 1.
    name, written : str     The name, and the expression as the script has it.
    text : str              The expression as thermid writes it.
    comment : str           Its comment, without what stands in brackets.
    brackets : tuple        What stands in brackets in its comment.
    doubt : str             Why the comment's brackets could not be given to it; empty where that is no question.
    later : tuple of str    Names that are set further down.
    """

    line: int
    name: str
    written: str
    text: str
    comment: str = ""
    brackets: tuple[str, ...] = ()
    doubt: str = ""
    later: tuple[str, ...] = ()


def statements(text: str, file: str, constants: Mapping[str, str]) -> Iterator[Statement]:
    """Yield the assignments of a script.

    Parameters
    ----------
    text, file : str    The script, and its name for messages.
    constants : dict    Built-in name -> text that stands for it.

    Raises
    ------
    ExpressionError   With the line, at the first thing that is not an assignment of arithmetic.
    """
    found: list[Statement] = []
    for number, code, comment in _joined(_without_line_numbers(text.splitlines()), file):
        parts = [p.strip() for p in re.split(r"[;,](?![^(]*\))", code) if p.strip()]
        made = [_assignment(part, f"{file}:{number}", number, constants) for part in parts]
        found += _commented(made, comment)
    for k, statement in enumerate(found):
        yield replace(statement, later=tuple(s.name for s in found[k + 1 :]))


def _without_line_numbers(lines: list[str]) -> list[str]:
    """Return lines without the numbers that a printed listing has in front of them."""
    numbered = [re.match(r"\s*(\d+)(?:\s|$)(.*)", line) for line in lines if line.strip()]
    counts = [int(m[1]) for m in numbered if m is not None]
    if len(counts) != len(numbered) or not counts or counts != list(range(1, len(counts) + 1)):
        return lines
    return [re.sub(r"\A\s*\d+(?:\s|$)", "", line) for line in lines]


def _joined(lines: list[str], file: str) -> Iterator[tuple[int, str, str]]:
    """Yield number, code and comment of each line that holds code; continued lines are one, block comments are none."""
    code, comment, start, depth = "", "", 0, 0
    for number, line in enumerate(lines, 1):
        if line.strip() in ("%{", "#{"):
            depth += 1
        elif line.strip() in ("%}", "#}"):
            depth = max(depth - 1, 0)
        elif not depth:
            here, said, goes_on = _cut(line)
            start = start or number
            code, comment = f"{code} {here}", f"{comment} {said}".strip() if code.strip() or here.strip() else ""
            if goes_on:
                continue
            if code.strip():
                yield start, code.strip(), comment
            code, comment, start = "", "", 0
    if depth:
        raise ExpressionError("a block comment '%{' is not closed by '%}'.", file)
    if code.strip():
        raise ExpressionError("the script ends in the middle of a statement: nothing follows its last '...'.", f"{file}:{start}")


def _cut(line: str) -> tuple[str, str, bool]:
    """Return code, comment and whether the statement goes on: what follows three points is a comment too."""
    where = [k for k in (line.find("%"), line.find("#")) if k >= 0]
    points = line.find("...")
    if points >= 0 and (not where or points < min(where)):
        return line[:points], line[points + 3 :].lstrip(" .%#").strip(), True
    return (line[: min(where)], line[min(where) :].lstrip("%# ").strip(), False) if where else (line, "", False)


def _assignment(part: str, where: str, number: int, constants: Mapping[str, str]) -> Statement:
    """Return one assignment without its comment."""
    head = _HEAD.match(part)
    if head is None:
        raise ExpressionError(
            f"'{_short(part)}' is not of the form 'name = expression'. An InitFcn is read as values only; take this line out.", where
        )
    written = head["rest"].strip()
    return Statement(number, head["name"], written, _expression(written, where, constants))


def _expression(written: str, where: str, constants: Mapping[str, str]) -> str:
    """Return an expression in thermid's signs.

    Raises
    ------
    ExpressionError   At anything but numbers, names, signs and parentheses, and at two powers in a row.
    """
    words: list[str] = []
    place = 0
    while place < len(written.rstrip()):
        word = _WORD.match(written, place)
        if word is None:
            rest = written[place:].strip()
            raise ExpressionError(
                f"'{_short(written)}': '{_short(rest, 20)}' is not understood. Read are single numbers, earlier names, pi, Inf, "
                "+ - * / ^ and parentheses; texts, vectors, calls and structures are not.",
                where,
            )
        if word["sign"] == "(" and words and (words[-1].isidentifier()):
            raise ExpressionError(
                f"'{_short(written)}': '{words[-1]}(' calls a function or takes an element; write the number instead.", where
            )
        words.append(word["number"] or word["name"] or word["sign"].lstrip("."))
        place = word.end()
    if not words:
        raise ExpressionError("nothing stands behind the equals sign.", where)
    for k, word_ in enumerate(words):
        if word_ == "^" and _operand_end(words, k + 1) < len(words) and words[_operand_end(words, k + 1)] == "^":
            raise ExpressionError(
                f"'{_short(written)}' has two powers in a row, which MATLAB takes from the left and a deck from the right. "
                "Put one of them in parentheses.",
                where,
            )
    return _spaced([constants.get(w, "**" if w == "^" else w) for w in words])


def _operand_end(words: list[str], start: int) -> int:
    """Return the index behind the operand that begins at `start`."""
    while start < len(words) and words[start] in "+-":
        start += 1
    depth = 0
    for k in range(start, len(words)):
        depth += (words[k] == "(") - (words[k] == ")")
        if depth <= 0:
            return k + 1
    return len(words)


def _spaced(words: list[str]) -> str:
    """Return words as text: spaces around sums, none elsewhere."""
    out = ""
    for k, word in enumerate(words):
        binary = word in "+-" and k > 0 and words[k - 1] not in ("(", "+", "-", "*", "/", "**")
        out += f" {word} " if binary else word
    return out


def _commented(made: list[Statement], comment: str) -> list[Statement]:
    """Give the comment's brackets to the statements of its line: one each, in order."""
    found: tuple[str, ...] = tuple(_BRACKET.findall(comment))
    words = re.sub(r"\s+", " ", _BRACKET.sub("", comment)).strip(" .,;")
    if len(made) == 1:
        return [replace(made[0], comment=words, brackets=found)]
    if len(found) == len(made):
        return [replace(s, comment=words, brackets=(one,)) for s, one in zip(made, found, strict=True)]
    doubt = f": {len(found)} in brackets for {len(made)} values of the line" if found else ""
    return [replace(s, comment=comment, doubt=doubt) for s in made]


def _short(text: str, most: int = 60) -> str:
    return text if len(text) <= most else f"{text[:most]}..."
