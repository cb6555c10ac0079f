"""Mutants of constants: which numbers of the rooms that decide can move by a tenth before a test fails.

``python scripts/mutants.py`` draws 31 constants, adds the nine of redesign.md section 9 and prints a table; ``--list`` prints all.

A constant is a number in the source of fit, prediction, explain, judge and qualify: of a module-level name, of a default, or a literal in
a function. Not counted are

- 0 and -1, in functions 1, and 2 as an exponent;
- indices, axes and shapes: what stands in a subscript, or as a whole number in the call of a function that takes shapes (`SHAPES`);
- formatting: what stands in an f-string, but for what is written in full (``!r``) and so read again, or is handed to `round`, `short`,
  `digits`;
- 273.15, which a unit test of physics pins, and in functions the slack of rounding and guards against division by zero: numbers of a
  size up to 1e-6 or from 1e30, of which a tenth changes no answer.

Each is moved up by 10 %, a whole number by at least one. The draw orders them by a hash of the seed and of what they are (room, function,
value), not of where they stand: code that moves does not change it. A mutant lives in a private copy of the tree. First the tests of its
room run, with `--whole` every other test for what survived.
"""

from __future__ import annotations

import argparse
import ast
import hashlib
import re
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "src" / "thermid"
sys.path.insert(0, str(ROOT / "tests"))

from private_tree import PrivateTree

ROOMS = ("fit", "prediction", "explain", "judge", "qualify")
DRAWN = 31
SHAPES = {"swapaxes", "reshape", "zeros", "ones", "full", "combinations", "moveaxis", "round", "short", "digits", "maxsize", "lru_cache"}

Place = tuple[int, int, int]
"""Line, column and end column of a literal."""


@dataclass(frozen=True)
class Constant:
    """A number in the source.

    Parameters
    ----------
    room, file : str    The file from the package's folder.
    owner : str         The function that holds it, or the module-level name.
    value : float
    nth : int           Of equal numbers of one owner.
    place : tuple
    """

    room: str
    file: str
    owner: str
    value: float
    nth: int
    place: Place

    def rank(self, seed: int) -> str:
        """Its place in the draw."""
        return hashlib.sha256(f"{seed}:{self.room}:{self.owner}:{self.value!r}:{self.nth}".encode()).hexdigest()

    @property
    def moved(self) -> str:
        """The number, moved by a tenth."""
        if isinstance(self.value, int):
            return str(self.value + max(1, round(0.1 * self.value)))
        return repr(float(f"{1.1 * self.value:.12g}"))

    def applied(self, text: str) -> str:
        """The source with the number moved."""
        line, begin, end = self.place
        lines = text.split("\n")
        row = lines[line - 1].encode()
        lines[line - 1] = (row[:begin] + self.moved.encode() + row[end:]).decode()
        return "\n".join(lines)


def collect(package: Path = PACKAGE) -> list[Constant]:
    """Every constant of the rooms."""
    out = []
    for room in ROOMS:
        for path in sorted((package / room).rglob("*.py")):
            count: dict[tuple[str, float], int] = {}
            for owner, node in _literals(ast.parse(path.read_text(encoding="utf-8"))):
                key = (owner, node.value)  # type: ignore[assignment]
                place = (node.lineno, node.col_offset, int(node.end_col_offset or 0))
                out.append(Constant(room, str(path.relative_to(package)), owner, node.value, count.get(key, 0), place))  # type: ignore[arg-type]
                count[key] = count.get(key, 0) + 1
    return out


def _literals(tree: ast.Module) -> Iterator[tuple[str, ast.Constant]]:
    """Owner and node of the literals that count."""

    def walk(node: ast.AST, owner: str, inside: bool) -> Iterator[tuple[str, ast.Constant]]:
        for name, value in ast.iter_fields(node):
            for child in value if isinstance(value, list) else [value]:
                if not isinstance(child, ast.AST) or _skipped(node, name, child):
                    continue
                if isinstance(child, ast.Constant) and type(child.value) in (int, float):
                    one = child.value == 1 and (inside or isinstance(node, ast.UnaryOp))
                    if child.value not in (0, 273.15) and not one and not (inside and not 1e-6 < abs(child.value) < 1e30):
                        yield owner, child
                elif isinstance(child, ast.FunctionDef | ast.ClassDef):
                    yield from walk(child, f"{owner}.{child.name}".strip("."), inside or isinstance(child, ast.FunctionDef))
                elif isinstance(child, ast.Assign | ast.AnnAssign) and not inside:
                    target = child.targets[0] if isinstance(child, ast.Assign) else child.target
                    yield from walk(child, f"{owner}.{ast.unparse(target)}".strip("."), inside)
                else:
                    yield from walk(child, owner, inside)

    yield from walk(tree, "", False)


def _skipped(node: ast.AST, field: str, child: ast.AST) -> bool:
    """Whether a child is an index, a shape, formatting or a square."""
    whole = isinstance(child, ast.Constant) and isinstance(child.value, int)
    match node:
        case ast.Subscript():
            return field == "slice"
        case ast.FormattedValue():
            return node.conversion != ord("r")
        case ast.Raise():
            return True
        case ast.keyword():
            return node.arg in ("axis", "ndmin", "maxsize")
        case ast.BinOp(op=ast.Pow()):
            return field == "right" and isinstance(child, ast.Constant) and child.value == 2
        case ast.Call(func=ast.Name(id=name) | ast.Attribute(attr=name)):
            return whole and name in SHAPES
    return False


@dataclass(frozen=True)
class Edit:
    """A mutant that no number alone describes: a pattern that stands once in the package, and what replaces it."""

    name: str
    pattern: str
    by: str

    def file(self, package: Path = PACKAGE) -> str:
        """The one file that holds it."""
        files = [p for p in sorted(package.rglob("*.py")) if re.search(self.pattern, p.read_text(encoding="utf-8"))]
        if len(files) != 1:
            raise SystemExit(f"'{self.name}' is found in {len(files)} files, not in one: mend its pattern.")
        return str(files[0].relative_to(package))


NINE = (
    Edit("spread over time of a transient", r'if kind == "steady":(\n +parts = \[Residuals\()', r"if kind:\1"),
    Edit("bounds of a log-normal law over its median", r"(ends = \[-np\.inf if x <= 0\.0 else float\(np\.log\(x) / self\.median", r"\1"),
    Edit("BEND of approaches", r"(\nBEND: Final) = 0\.1\n", r"\1 = 0.0\n"),
    Edit("Student factor of approaches", r"np\.sqrt\(free / \(free - 2\.0\)\)", "1.0"),
    Edit("radiation pattern of coefficients", r"(/ \(4\.0 \* \S+\*\*3\)) - 1\.0", r"\1 - 0.9"),
    Edit("ALIKE of coefficients", r"(\nALIKE) = 0\.5\n(\"\"\"Correlation of two surfaces' exponents)", r"\1 = 0.0\n\2"),
    Edit("chance from which a value moved", r"(\nALPHA, POWER) = 0\.05,", r"\1 = 0.5,"),
    Edit("consider covariance over the level", r"(_consider\(.*, \w+) / \w+\)", r"\1)"),
    Edit("likelihood ratio from which residuals wander", r"(\nSURE) = 5\.0\n(\"\"\".* a trace is held)", r"\1 = 12.0\n\2"),
)  # fmt: skip
"""The survivors of redesign.md section 9, by what they are."""


@dataclass(frozen=True)
class Mutant:
    """A file of the package, and its text with one thing changed."""

    name: str
    file: str
    change: str
    text: str


def drawn(seed: int, number: int = DRAWN) -> list[Mutant]:
    """The constants of a draw, moved."""
    out = []
    for c in sorted(collect(), key=lambda c: c.rank(seed))[:number]:
        text = (PACKAGE / c.file).read_text(encoding="utf-8")
        out.append(Mutant(c.owner, c.file, f"{c.value!r} -> {c.moved}", c.applied(text)))
    return out


def nine() -> list[Mutant]:
    """The nine of redesign.md."""
    out = []
    for edit in NINE:
        file = edit.file()
        text = re.sub(edit.pattern, edit.by, (PACKAGE / file).read_text(encoding="utf-8"), count=1)
        out.append(Mutant(edit.name, file, f"{edit.pattern} -> {edit.by}", text))
    return out


def died(tree: PrivateTree, mutant: Mutant, whole: bool) -> str:
    """The test that a mutant died by; empty where it survived."""
    path = tree.package / mutant.file
    before = path.read_text(encoding="utf-8")
    room = Path(mutant.file).parts[0]
    first = f"tests/unit/{room}/test_constants.py"
    runs: list[tuple[list[str], tuple[str, ...]]] = [([first], ())] if (tree.root / first).exists() else []
    runs.append(([f"tests/unit/{room}"], (f"--ignore={first}",)))
    if whole:
        runs.append((["tests"], ("-n", "2", f"--ignore=tests/unit/{room}")))
    path.write_text(mutant.text, encoding="utf-8")
    try:
        for tests, options in runs:
            run = tree.pytest(tests, "-x", "--no-header", "--tb=no", "-rfE", *options, seconds=3600.0)
            if run.returncode not in (0, 5):
                lines = [x for x in run.stdout.splitlines() if x.startswith(("FAILED", "ERROR"))] or [*run.stdout.splitlines(), "?"][-3:]
                return lines[0].split(" - ")[0].removeprefix("FAILED ").removeprefix("ERROR ")
    finally:
        path.write_text(before, encoding="utf-8")
    return ""


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--list", action="store_true", help="print every constant, in the order of the draw")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--number", type=int, default=DRAWN, help="constants drawn")
    parser.add_argument("--skip", type=int, default=0, help="leave out the first of the draw and the nine")
    parser.add_argument("--only", default="", help="a pattern: of these, the mutants whose name or file has it")
    parser.add_argument("--whole", action="store_true", help="let every other test judge what its room lets live")
    given = parser.parse_args()
    if given.list:
        for c in sorted(collect(), key=lambda c: c.rank(given.seed)):
            print(f"{c.file}:{c.place[0]}  {c.owner}  {c.value!r} -> {c.moved}")
        return
    mutants = [*([] if given.skip else nine()), *drawn(given.seed, given.number + given.skip)[given.skip :]]
    mutants = [m for m in mutants if re.search(given.only, f"{m.name} {m.file}")]
    print(
        f"{len(collect())} constants, {len(mutants)} mutants\n\n| constant | file | mutant | died by | s |\n|---|---|---|---|---|",
        flush=True,
    )
    alive = 0
    with tempfile.TemporaryDirectory() as directory:
        tree = PrivateTree(Path(directory) / "tree")
        for m in mutants:
            begin = time.monotonic()
            by = died(tree, m, given.whole)
            alive += not by
            change = m.change.replace("|", "\\|")
            print(f"| {m.name} | {m.file} | `{change}` | {by or '**survived**'} | {time.monotonic() - begin:.0f} |", flush=True)
    print(f"\n{alive} of {len(mutants)} survive.")


if __name__ == "__main__":
    main()
