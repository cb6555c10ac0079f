"""InitFcn scripts of Simulink models: ``name = expression; % comment [unit]`` -> parameters of a deck.

Read is arithmetic on numbers: earlier names, ``pi``, ``Inf``, the functions of expressions in decks, ``+ - * / ^`` and parentheses; fields
of structures (``acc.m`` becomes ``acc_m``) and vectors (``k = [1 2]``, or ``k(1) = 1``, becomes ``k_1`` and ``k_2``); continuation by three
points, several statements on a line, comments, block comments. A name may be set again: its last value is kept. Commands that set no value,
such as ``clc`` and ``disp``, are passed over. So are branches and loops: what they set, and every value that depends on it, is left out and
listed. Everything else is refused, every fault with its line: nothing is run. As in MATLAB, the arithmetic is on plain numbers, and the
comment says what unit the result is in.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import accumulate
from keyword import iskeyword
from pathlib import Path
from typing import Any

from thermid.base.errors import ExpressionError, ThermidError, UnitError, cap, raising, refuse_first
from thermid.base.files import read_text
from thermid.base.results import Shown
from thermid.base.units import DIMENSIONLESS, Dimension, Expression, counted, describe, in_si, unit
from thermid.model.tree import Parameter

_CELSIUS = re.compile(r"(deg\.?\s*|degrees?\s+|°\s*)?(C|celsius)\Z", re.IGNORECASE)
PI = "3.141592653589793"
_WORD = re.compile(r"\s*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)(?![\w.])|(?P<name>[A-Za-z]\w*)|(?P<sign>\.?[*/^]|[-+(),]))")
_SIGNS = "+-*/^(),"
_BRACKET = re.compile(r"\[([^\[\]]*)\]")
_HEAD = re.compile(r"(?P<name>[A-Za-z]\w*)\s*=(?!=)(?P<rest>.*)\Z", re.DOTALL)
_ELEMENT = re.compile(r"\A([A-Za-z]\w*)\((\d+)\)(?=\s*=(?!=))")
"""An element of a vector that is set by itself: ``P(2) = 4.5``."""
_FIELD = re.compile(r"\b([A-Za-z]\w*)\.(?=[A-Za-z])(?!\w+['\"])")
_NO_VALUE = re.compile(
    r"(?:\d+|(?:clear|clearvars|clc|close|global|persistent|format|more|warning|disp|display|f?printf|figure|plot|hold|grid|title|[xy]label|legend|addpath|tic|toc)"
    r"\b[^=]*)\Z"
)
"""Commands of MATLAB that set no value, and a number alone, with which a script of Octave may begin."""
_FUNCTION = re.compile(r"function\s+\w+\s*(\(\s*\))?\Z")
"""The head of a function around a script, which takes and gives nothing."""
_OPENS = re.compile(r"(?:if|for|parfor|while|switch|try)\b")
_CLOSES = re.compile(r"end(?:if|for|parfor|while|switch|_try_catch|function)?\Z")
_SETS = re.compile(r"(?:\[([\w\s,~]*)\]|(?<!\w)([A-Za-z]\w*)(\([^()]*\))?)\s*=(?!=)")
"""What a statement of a branch sets: a list of names, or one name, perhaps with an index."""
_TEXT = re.compile(r"[%#].*|(?<![\w)\]}'.])'(?:[^']|'')*'|\"[^\"]*\"")
"""A comment, or a text in quotes."""
ROLES = {
    "mass": "kg",
    "specific_heat": "J/(kg K)",
    "area": "m^2",
    "effective_htc": "W/(m^2 K)",
    "power": "W",
}
"""What the block needs, by unit. A coefficient of a script was tuned in air, so radiation is in it: `effective_htc`."""


@dataclass(frozen=True)
class InitFcn(Shown):
    """The parameters of an InitFcn script.

    Parameters
    ----------
    parameters : dict           Name -> `Parameter`, in the order of the script.
    numbers : dict              Name -> the plain number that MATLAB would have.
    remarks : tuple of str      What a reader must settle: values without a unit, units that do not agree.
    file : str                  The script's file name, or ``script``.
    """

    parameters: Mapping[str, Parameter]
    numbers: Mapping[str, float]
    remarks: tuple[str, ...]
    file: str = "script"

    def table(self) -> dict[str, Any]:
        """Return the table ``[parameters]`` of a deck: name -> value, or value with note and basis."""
        out: dict[str, Any] = {}
        for name, entry in self.parameters.items():
            more = {k: v for k in ("note", "basis") if (v := getattr(entry, k))}
            out[name] = {"value": entry.text, **more} if more else entry.text
        return out

    def deck(self, title: str) -> dict[str, Any]:
        """Return the parameters as a deck without elements, which are still to be written."""
        return {"title": title, "parameters": self.table()}

    def block(self, title: str) -> dict[str, Any]:
        """Return the deck of one mass that convects and is heated, each value found by its unit; for `model_from_dict`.

        Raises
        ------
        DeckError   When none, or more than one, of the parameters has the unit of a role.
        """
        dimensions: dict[str, Dimension] = {}
        for name, entry in self.parameters.items():
            dimensions[name] = entry.expression.dimension(lambda n: dimensions[n])
        value = {role: _one(role, text, self.parameters, dimensions, self.file) for role, text in ROLES.items()}
        return {
            **self.deck(title),
            "needs": ["air"],
            "offers": ["case", "skin"],
            "nodes": {"case": {"mass": value["mass"], "specific_heat": value["specific_heat"]}},
            "surfaces": {"skin": {"of": "case", "to": "air", "area": value["area"], "effective_htc": value["effective_htc"]}},
            "loads": {"heater": {"into": "case", "power": value["power"]}},
        }

    def __str__(self) -> str:
        """The remarks, then every value with its comment."""
        wide = max((len(n) for n in self.parameters), default=0)
        values = max((len(p.text) for p in self.parameters.values()), default=0)
        lines = [f"{n:{wide}}  {p.text:{values}}  {p.note}".rstrip() for n, p in self.parameters.items()]
        return "\n".join([*(f"remark: {r}" for r in self.remarks), *lines])


@dataclass
class _Reader:
    """What is known after the lines read so far."""

    file: str
    parameters: dict[str, Parameter] = field(default_factory=dict)
    numbers: dict[str, float] = field(default_factory=dict)
    si: dict[str, float] = field(default_factory=dict)
    origins: dict[str, str] = field(default_factory=dict)
    scales: set[str] = field(default_factory=set)
    dimensions: dict[str, Dimension] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)
    failed: set[str] = field(default_factory=set)
    open_names: dict[str, None] = field(default_factory=dict)

    def skip(self, s: Statement) -> None:
        """Leave out what a branch sets: an earlier value of it may not be the last."""
        for name in [n for n in self.numbers if s.name in (n, _vector(n))]:
            del self.parameters[name], self.numbers[name]
        self.open_names[s.name] = None

    def take(self, s: Statement) -> None:
        """Add one statement."""
        where = f"{self.file}:{s.line}"
        if s.name in ("inf", "Inf", "pi"):
            raise ExpressionError(
                f"'{s.name}' is a reserved word of expressions in decks. Rename it in the script.", where, code="name.not-valid"
            )
        first = self.origins.setdefault(s.name, s.origin)
        if first != s.origin:
            raise ExpressionError(f"'{first}' and '{s.origin}' both become '{s.name}'. Rename one of them.", where, code="name.taken")
        try:
            expression = Expression.parse(s.text)
        except ThermidError as error:
            raise ExpressionError(error.message, where, code=error.code) from None
        unknown = [n for n in expression.names if n not in self.numbers]
        if self.open_names.keys() & {*unknown, *map(_vector, unknown)}:
            return self.skip(s)
        if self.failed & {*unknown}:  # its own fault is listed
            self.failed.add(s.name)
            return
        if unknown:
            late = "it is set in a later line" if unknown[0] in s.later else "no earlier line sets it"
            raise ExpressionError(
                f"'{s.name}' needs '{unknown[0]}', and {late}. Use only earlier names, numbers, pi and Inf.",
                where,
                code="import.not-understood",
            )
        try:
            number = float(expression.evaluate(lambda name: self.numbers[name]))
        except ArithmeticError as error:
            raise ExpressionError(f"'{s.written}' has no finite value: {error}.", where, code="expression.no-finite-value") from None
        of, note = self._unit(s)
        text, basis = self._written(s, number, of)
        value = Parameter.read({"value": text, "note": note, "basis": basis}, where)
        if self.parameters.pop(s.name, None) is not None:
            self.remarks.append(f"line {s.line}: '{s.name}' is set again. Its last value is kept; lines above it use the value before")
            self.scales.discard(s.name)
        self.parameters[s.name], self.numbers[s.name] = value, number
        self.open_names.pop(s.name, None)
        self.si[s.name] = float(value.expression.evaluate(lambda name: self.si[name]))
        self.dimensions[s.name] = value.expression.dimension(lambda name: self.dimensions[name])
        literal = value.expression.literal
        if (literal is not None and literal.unit.absolute) or (literal is None and set(value.expression.names) & self.scales):
            self.scales.add(s.name)

    def _unit(self, s: Statement) -> tuple[str | None, str]:
        """Return the unit that the comment names, or None, and the comment with the brackets that are none."""
        faults = list[str]()
        for k in reversed(range(len(s.brackets))):
            others = " ".join(f"[{b}]" for b in (*s.brackets[:k], *s.brackets[k + 1 :]))
            try:
                return _unit_text(s.brackets[k]), f"{s.comment} {others}".strip()
            except UnitError as error:
                faults.append(error.message)
        if faults:
            self.remarks.append(f"line {s.line}: '{s.name}' is taken as a plain number. {' '.join(reversed(faults))}")
        return None, " ".join([s.comment, *(f"[{b}]" for b in s.brackets)]).strip()

    def _written(self, s: Statement, number: float, of: str | None) -> tuple[str, str]:
        """Return the text of the value and, where the script's own expression could not be kept, what it was."""
        names = Expression.parse(s.text).names
        if not names:
            if of is None and not s.brackets:
                self.remarks.append(
                    f"line {s.line}: '{s.name}' has no unit in its comment{s.doubt or _hint(s.comment)}, so its value is taken as a plain "
                    "number. Add the unit"
                )
            return (s.text if of is None else f"{s.text} [{of}]"), ""
        derived = self._derived(s.text)
        final = not {*names} & {s.name, *s.later}  # a deck has the last value of a name
        plain = f"{number!r} [{of}]" if of is not None else repr(number)
        if of is None:
            question = _hint(s.comment)
            if derived is not None and final and not question:
                return s.text, ""
            self.remarks.append(
                f"line {s.line}: '{s.name}' has no unit in its comment{question}, and '{s.written}' gives none, "
                f"so its {number:.10g} is taken as a plain number. Add the unit to the comment"
            )
            return plain, f"{s.written} in the script"
        wanted = unit(of)
        si = in_si(number, wanted)
        same = derived is not None and derived[0] == wanted.dimension and math.isclose(derived[1], si, rel_tol=1e-12)
        if same and final:
            return s.text, ""
        if derived is not None and not same and DIMENSIONLESS not in [self.dimensions[n] for n in names]:
            other = describe(derived[0]) if derived[0] != wanted.dimension else f"{derived[1]:.6g} in SI units, not {si:.6g}"
            self.remarks.append(f"line {s.line}: '{s.name}' is {plain} by its comment; the units of '{s.written}' make it {other}")
        return plain, f"{s.written} in the script"

    def _derived(self, text: str) -> tuple[Dimension, float] | None:
        """Return dimension and SI value of an expression by the units of its names, or None where these do not go together."""
        expression = Expression.parse(text)
        bare = text.strip() in expression.names
        if not bare and set(expression.names) & self.scales:
            return None
        try:
            dimension = expression.dimension(lambda name: self.dimensions[name])
            return dimension, float(expression.evaluate(lambda name: self.si[name]))
        except (ThermidError, ArithmeticError):
            return None


def _vector(name: str) -> str:
    """Return the name of the vector that an element's name is made of: P of P_2."""
    return re.sub(r"_\d+\Z", "", name)


def _unit_text(bracket: str) -> str:
    """Return a bracket of a comment as a unit.

    Raises
    ------
    UnitError   Where it is none.
    """
    text = bracket.strip()
    text = "degC" if _CELSIUS.match(text) else "1" if text in ("-", "") else text
    unit(text)
    return text


def _hint(comment: str) -> str:
    """Return the question whether the end of a comment, or what stands in parentheses, is a unit; empty where neither is one."""
    words = comment.rstrip(" .").rpartition(",")[2].split()
    for text in (*(" ".join(words[k:]) for k in range(len(words))), *re.findall(r"\((.*)\)", comment)):
        with suppress(UnitError):  # the longest first: of W/(m^2 K) the end K) alone is none
            unit_text = _unit_text(re.sub(r"^\((.*)\)$", r"\1", text))
            return f" in brackets (is it [{unit_text}]?)"
    return ""


def read_initfcn(source: str | os.PathLike[str]) -> InitFcn:
    """Return the parameters that an InitFcn script sets.

    Parameters
    ----------
    source : path or str    The file, or the text itself where it has a line break or an equals sign.

    Raises
    ------
    ExpressionError   With every line whose statement is not arithmetic over earlier names.
    ThermidError      When the file cannot be read as text.

    Examples
    --------
    >>> script = read_initfcn("Acc_m = 0.054; % Mass [kg].")
    >>> script.parameters["Acc_m"].text, script.parameters["Acc_m"].note
    ('0.054 [kg]', 'Mass')
    """
    text, file = _source(source)
    if len(text) > cap("script"):
        raise ThermidError(
            f"the script has {len(text) / 1e6:.1f} MB; an InitFcn is a text of a few kilobytes. Check the file.{raising('script')}",
            file,
            code="cap.exceeded",
        )
    reader, faults = _Reader(file), list[ThermidError]()
    for statement in statements(text, file, {"pi": PI, "Inf": "inf"}, faults, reader.failed, reader.remarks):
        try:
            (reader.skip if statement.branch else reader.take)(statement)
        except ThermidError as error:
            faults.append(error)
            reader.failed.add(statement.name)
    if faults:
        first, *rest = sorted(faults, key=lambda e: int(e.where.rpartition(":")[2]))
        at, begin = next((n, s) for n, line in enumerate(text.splitlines(), 1) if (s := line.strip()) and s[0] not in "%#")
        foreign = first.where == f"{file}:{at}" and not _HEAD.match(begin)
        # a file of another kind
        if len(faults) > len(reader.parameters) and (foreign or not re.search(r";\s*(%.*)?$", text, re.MULTILINE)):
            raise type(first)(
                f"{first.message} {counted(len(rest), 'more statement')} cannot be read either.", first.where, code=first.code
            )
        raise type(first)("\n  ".join([first.message, *(f"{e.where}: {e.message}" for e in rest)]), first.where, code=first.code)
    if reader.open_names:
        reader.remarks.insert(
            0,
            f"left out, because a branch or a loop sets them or what they depend on: {', '.join(reader.open_names)}. "
            "Write their values outside of it",
        )
    if not reader.parameters:
        raise ExpressionError(
            "the script sets no name outside of branches and loops. It needs lines such as 'Acc_m = 0.054; % Mass [kg].'",
            file,
            code="import.not-understood",
        )
    return InitFcn(reader.parameters, reader.numbers, tuple(reader.remarks), file)


def _source(source: str | os.PathLike[str]) -> tuple[str, str]:
    """Return the text of a script and its name for messages."""
    if isinstance(source, str) and ("\n" in source or "=" in source):
        return source, "script"
    path = Path(source)
    if not path.is_file():
        raise ThermidError(f"there is no file '{path.name}' in {path.parent.name or '.'}/.", code="file.not-found")
    try:
        return read_text(path, "utf-8-sig"), path.name
    except UnicodeDecodeError:
        # scripts of older releases are in the code page of their machine, whose letters stand in comments only
        return read_text(path, "latin-1"), path.name


@dataclass(frozen=True)
class Statement:
    """One assignment.

    Parameters
    ----------
    line : int              Where it begins, from 1.
    name, text : str        The name and the expression as thermid writes them.
    origin, written : str   As the script has them.
    comment : str           Its comment, without what stands in brackets.
    brackets : tuple        What stands in brackets in its comment.
    doubt : str             Why the comment's brackets could not be given to it; empty where that is no question.
    later : tuple of str    Names that are set further down.
    branch : bool           Whether it stands in a branch or a loop, of which nothing is read but the name.
    """

    line: int
    name: str
    origin: str
    written: str
    text: str
    comment: str = ""
    brackets: tuple[str, ...] = ()
    doubt: str = ""
    later: tuple[str, ...] = ()
    branch: bool = False


def statements(
    text: str, file: str, constants: Mapping[str, str], faults: list[ThermidError], failed: set[str], remarks: list[str]
) -> Iterator[Statement]:
    """Yield the assignments of a script.

    Parameters
    ----------
    text, file : str    The script, and its name for messages.
    constants : dict    Built-in name -> text that stands for it.
    faults : list       Takes an error for each thing that is not an assignment of arithmetic.
    failed : set        Takes the names that such a thing would have set.
    remarks : list      Takes which commands were passed over.

    Raises
    ------
    ExpressionError   When a comment or a statement does not end.
    """
    assignments: list[Statement] = []
    vectors, passed, blocks, wrapped = set[str](), list[str](), list[int](), False
    for number, code, comment in _joined(_without_numbers(text.splitlines()), file):
        parts = _parts(code)
        assignments_of_part: list[list[Statement]] = []
        for part in parts:
            if _FUNCTION.match(part) or (not blocks and wrapped and _CLOSES.match(part)):
                wrapped = True
                continue
            if blocks or _OPENS.match(part):
                for several, one, index in _SETS.findall(_FIELD.sub(r"\1_", part)):
                    names = re.findall(r"\w+", several or one)
                    assignments += [Statement(number, _name(n), n, part, "", branch=True) for n in names]
                    vectors.update(names if index else [])
                blocks += [number] if _OPENS.match(part) else []
                begin = blocks.pop() if _CLOSES.match(part) else 0
                if not blocks:
                    place = f"line {number} is" if begin == number else f"lines {begin} to {number} are"
                    remarks.append(f"{place} a branch or a loop, of which nothing is read")
                continue
            try:
                if _NO_VALUE.match(part) and not (part.startswith("clear") and (assignments or assignments_of_part)):
                    passed.append(re.split(r"\W", part)[0])
                    continue
                assignments_of_part.append(_assignments(part, f"{file}:{number}", number, constants, vectors))
            except ThermidError as error:
                faults.append(error)
                failed.update(m["name"] for m in [_HEAD.match(_FIELD.sub(r"\1_", part))] if m)
        alone = len(parts) == 1 and bool(assignments_of_part)
        assignments += (
            [s for one in assignments_of_part[0] for s in _commented([one], comment)]
            if alone
            else _commented([s for m in assignments_of_part for s in m], comment)
        )
    if blocks:
        faults.append(
            ExpressionError("the branch or loop that begins here has no 'end'.", f"{file}:{blocks[0]}", code="import.not-understood")
        )
    if passed:
        remarks.append(f"passed over, because they set no value: {', '.join(dict.fromkeys(passed))}")
    for k, statement in enumerate(assignments):
        yield replace(statement, later=tuple(s.name for s in assignments[k + 1 :]))


def _without_numbers(lines: list[str]) -> list[str]:
    """Return the lines of a script without their numbers, which a printed listing has in front."""
    numbered = [re.match(r"\s*(\d+)(?:\s|$)", line) for line in lines if line.strip()]
    if [int(m[1]) for m in numbered if m is not None] != list(range(1, len(numbered) + 1)):
        return lines
    return [re.sub(r"\A\s*\d+(?:\s|$)", "", line) for line in lines]


def _parts(code: str) -> list[str]:
    """Return what stands between commas and semicolons that are not in parentheses or brackets."""
    depths = accumulate((sign in "([{") - (sign in ")]}") for sign in code)
    lines = "".join("\n" if sign in ";," and depth <= 0 else sign for sign, depth in zip(code, depths, strict=True))
    return [part.strip() for part in lines.split("\n") if part.strip()]


def _joined(lines: list[str], file: str) -> Iterator[tuple[int, str, str]]:
    """Yield number, code and comment of each line that holds code; continued lines are one, block comments are none."""
    code, comment, start, depth = "", "", 0, 0
    for number, line in enumerate(lines, 1):
        if line.strip() in ("%{", "#{"):
            depth += 1
        elif line.strip() in ("%}", "#}"):
            depth = max(depth - 1, 0)
        elif not depth:
            here, comment_part, goes_on = _cut(line)
            start = start or number
            code, comment = f"{code} {here}", f"{comment} {comment_part}".strip() if code.strip() or here.strip() else ""
            if goes_on or code.count("[") > code.count("]"):
                code += "" if goes_on else ";"  # in brackets the end of a line ends a row
                continue
            if code.strip():
                yield start, code.strip(), comment
            code, comment, start = "", "", 0
    if depth:
        raise ExpressionError("a block comment '%{' is not closed by '%}'.", file, code="import.not-understood")
    if code.strip():
        raise ExpressionError(
            "the script ends within a statement: a '[' is not closed, or nothing follows its last '...'.",
            f"{file}:{start}",
            code="import.not-understood",
        )


def _cut(line: str) -> tuple[str, str, bool]:
    """Return code, comment and whether the statement goes on: what follows three points is a comment too."""
    # signs of a text in quotes are none of the statement
    line = _TEXT.sub(lambda m: m[0] if m[0][0] in "%#" else re.sub(r"[][%#;,=()]|\.\.\.", " ", m[0]), line)
    where = [k for k in (line.find("%"), line.find("#")) if k >= 0]
    points = line.find("...")
    if points >= 0 and (not where or points < min(where)):
        return line[:points], line[points + 3 :].lstrip(" .%#").strip(), True
    return (line[: min(where)], line[min(where) :].lstrip("%# ").strip(), False) if where else (line, "", False)


def _assignments(part: str, where: str, number: int, constants: Mapping[str, str], vectors: set[str]) -> list[Statement]:
    """Return one assignment without its comment, or those of a vector's elements, whose name joins `vectors`."""
    flat = _FIELD.sub(r"\1_", part)
    vectors.update(m[1] for m in [_ELEMENT.match(flat)] if m)
    head = _HEAD.match(_ELEMENT.sub(r"\1_\2", flat))
    if head is None:
        raise ExpressionError(
            f"'{_shortened(part)}' is not of the form 'name = expression'. An InitFcn may hold values only. Remove this line.",
            where,
            code="import.not-understood",
        )
    origin, written = part.partition("=")[0].strip(), head["rest"].strip()
    name = _name(head["name"])
    elements = [written]
    if written.startswith("[") and written.endswith("]") and not (";" in written and "," in written):
        inner = written[1:-1].strip()
        elements = _parts(inner) if re.search(r"[,;]", inner) else inner.split()
        vectors.add(name)
    names = [name] if len(elements) == 1 and name not in vectors else [f"{name}_{k}" for k in range(1, len(elements) + 1)]

    def plain(text: str) -> str:
        """Return an expression of MATLAB as a deck has it: elements of vectors by names of their own."""
        taken = re.sub(r"\b([A-Za-z]\w*)\((\d+)\)", lambda m: f"{m[1]}_{m[2]}" if m[1] in vectors else m[0], text)
        return _expression(taken, where, constants)

    return [Statement(number, n, origin, e, plain(e)) for n, e in zip(names, elements, strict=True)]


def _expression(written: str, where: str, constants: Mapping[str, str]) -> str:
    """Return an expression in thermid's signs.

    Raises
    ------
    ExpressionError   At anything but numbers, names, signs and parentheses, and at two powers in a row.
    """
    words: list[str] = []
    place = 0
    while place < len(written.rstrip()):
        word, last = _WORD.match(written, place), words[-1] if words else "+"
        # "3 4" is no 34, and a row of a matrix is no number
        beside = word is not None and word["sign"] in (None, "(") and (last == ")" or last[-1].isalnum() or last[-1] in "_.")
        if word is None or (beside and not (word["sign"] == "(" and last.isidentifier())):
            rest = written[place:].strip()
            shown = "" if rest == written else f"'{_shortened(written)}': "
            raise ExpressionError(
                f"{shown}'{_shortened(rest, 20)}' cannot be read. Use single numbers, earlier names, pi, Inf, + - * "
                "/ ^, sqrt, exp, log, abs, min, max and parentheses; no texts, ranges, matrices or other calls.",
                where,
                code="import.not-understood",
            )
        words.append(word["number"] or word["name"] or word["sign"].lstrip("."))
        place = word.end()
    if not words:
        raise ExpressionError("the value after the equals sign is missing.", where, code="import.not-understood")
    flat, before = "".join(w if w in _SIGNS else "x" for w in words), ""
    while flat != before:  # innermost parentheses first
        if re.search(r"\^[-+]*x\^", flat):
            raise ExpressionError(
                f"'{_shortened(written)}' has two powers in a row, which MATLAB evaluates from the left and a deck from the right. "
                "Put one of them in parentheses.",
                where,
                code="import.not-understood",
            )
        before, flat = flat, re.sub(r"x?\([^()]*\)", "x", flat)
    # a sum has spaces around its sign, a sign of a number has none
    sums = [w in "+-" and k > 0 and words[k - 1] not in _SIGNS.replace(")", "") for k, w in enumerate(words)]
    texts = (constants.get(w, "**" if w == "^" else _name(w)) for w in words)
    return "".join(f" {t} " if of_sum else t for t, of_sum in zip(texts, sums, strict=True))


def _name(word: str) -> str:
    """Return a word as a deck has it: a name of MATLAB that is a keyword of expressions, such as lambda, gets an underscore."""
    return f"{word}_" if iskeyword(word) else word


def _commented(assignments: list[Statement], comment: str) -> list[Statement]:
    """Give the comment's brackets to the statements of its line: one each, in order."""
    brackets: tuple[str, ...] = tuple(_BRACKET.findall(comment))
    words = re.sub(r"\s+", " ", _BRACKET.sub("", comment)).strip(" .,;")
    if len(assignments) == 1:
        return [replace(assignments[0], comment=words, brackets=brackets)]
    if len(brackets) == len(assignments):
        return [replace(s, comment=words, brackets=(one,)) for s, one in zip(assignments, brackets, strict=True)]
    doubt = f": {len(brackets)} in brackets for {len(assignments)} values of the line" if brackets else ""
    return [replace(s, comment=comment, doubt=doubt) for s in assignments]


def _shortened(text: str, most: int = 60) -> str:
    """Return a text cut to at most so many characters."""
    return text if len(text) <= most else f"{text[:most]}..."


def _one(role: str, text: str, parameters: Mapping[str, Parameter], dimensions: Mapping[str, Dimension], where: str) -> str:
    """Return the one name in the unit of a role; a name that another such name is made of gives way to it."""
    named = [n for n, d in dimensions.items() if d == unit(text).dimension]
    used = {n for name in named for n in parameters[name].expression.names}
    remaining = [n for n in named if n not in used]
    refuse_first(
        where,
        (
            not remaining,
            f"no value of the script has the unit [{text}], so the block has no {role}. Write the unit into the comment of its line, "
            "or import without the block and write the elements into the deck.",
            "import.not-understood",
        ),
        (
            len(remaining) > 1,
            f"{' and '.join(repr(n) for n in remaining)} both have the unit [{text}], so the block's {role} is ambiguous. Import without "
            "the block and "
            "write the elements into the deck.",
            "import.not-understood",
        ),
    )
    return remaining[0]
