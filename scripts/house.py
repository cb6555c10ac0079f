"""Figures of the house: ``python scripts/house.py`` prints the table, ``--shrink`` takes off the list of offenders what no longer offends.

Circles, imports inside functions, slices, doubled class names and crowded packages are counted as the guards of tests/architecture count
them. Files executed are those of which a second, warm call runs a function. Statements are those of the syntax tree without docstrings.
``--since 6c92aaf`` compares them with those of the commit at which the guards began: all, without the files of abilities that came later
(`LATER`), and those whose line stood there already, wherever it has moved.
"""

from __future__ import annotations

import argparse
import ast
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import FrameType

import thermid as td

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "tests"))

from architecture.house import GUARDS, LIST, as_toml, files_by_package, listed, shrunk
from architecture.source import Module, read_modules

OUTSIDE = ("acquire", "studio", "interop", "site")
"""Beginnings of the modules that are no part of the core: bench, studio, site and moisture, interop."""

LATER = {
    "decks of SINDA and ESATAN": ("interop/decks/",),
    "functional mock-up units": ("interop/fmu/",),
    "Modelica and C99": ("interop/modelica.py", "interop/c99.py"),
    "filters, smoothers and process noise": ("estimation/",),
    "watching a test": ("watch/", "cli/watch.py"),
    "proposals, improvement, examples and templates": ("start/", "cli/start.py"),
    "mistakes, and search for structures": tuple(f"explain/{n}.py" for n in ("mistakes", "heats", "rough_fit", "structures")),
    "differences between kinds of run": ("fit/regimes.py", "fit/regime_runs.py"),
    "bands of a logged run": ("prediction/records.py",),
    "courses of a power": ("power/courses.py",),
    "loggers' formats": tuple(f"measure/readers/{n}.py" for n in ("binary", "matlab_objects", "formats", "guess")),
    "streams": ("network/streams.py",),
    "controls": ("network/controls.py", "model/parts/controls.py"),
    "arrays, two-resistor parts and tables of elements": ("model/tree/arrays.py", "model/deck/assemblies.py", "model/deck/rows.py"),
    "extremes between stored times": ("simulation/solver/extremes.py",),
    "plots, tables and rich output of every result": ("results/",),
    "maps of heat": ("reporting/diagrams/map.py", "reporting/diagrams/heat.py", "simulation/heat_map.py"),
    "schemas for editors": ("grammar.py",),
    "old names with a warning": ("renamed.py",),
    "first sheets, numbers of figures, colours and summaries in a terminal": (
        *("reporting/blocks/numbering.py", "reporting/pages/front.py"),
        *("cli/summary.py", "cli/screen.py"),
    ),
}
"""Abilities that the first commit of the guards, 6c92aaf, did not have -> their files, where these hold nothing else."""

DECK = {
    "title": "plate",
    "needs": ["air"],
    "nodes": {"plate": {"capacitance": "100 [J/K]"}},
    "conductors": {"film": {"kind": "convection", "between": ["plate", "air"], "htc": "8 [W/(m^2 K)]", "area": "0.05 [m^2]"}},
    "loads": {"heater": {"into": "plate", "power": "5 [W]"}},
}


def lines_of(tree: ast.Module) -> list[int]:
    """The first lines of the statements of a module; docstrings, those of its constants too, are none."""
    every = (node for node in ast.walk(tree) if isinstance(node, ast.stmt))
    return [
        n.lineno for n in every if not (isinstance(n, ast.Expr) and isinstance(n.value, ast.Constant) and isinstance(n.value.value, str))
    ]


def statements(module: Module) -> int:
    """How many statements a module holds."""
    return len(lines_of(module.tree))


def since(commit: str) -> dict[str, str]:
    """What is measured -> how much, of the statements of the last commit beside those of an earlier one."""

    def git(*words: str) -> str:
        return subprocess.run(["git", "-C", str(ROOT), *words], check=True, capture_output=True, text=True).stdout

    def lines(at: str) -> dict[str, list[int]]:
        files = [n for n in git("ls-tree", "-r", "--name-only", at, package).splitlines() if n.endswith(".py")]
        return {n.removeprefix(package): lines_of(ast.parse(git("show", f"{at}:{n}"))) for n in files}

    package = "src/thermid/"
    then, now = sum(map(len, lines(commit).values())), lines("HEAD")
    every = sum(map(len, now.values()))
    later = sum(len(numbers) for name, numbers in now.items() if name.startswith(tuple(f for files in LATER.values() for f in files)))
    stood = 0
    for name, numbers in now.items():
        # a line that is older than the commit is marked with ^
        lives = git("blame", "-s", "-l", "-w", "-M", "-C", f"{commit}..HEAD", "--", package + name).split("\n")
        stood += sum(lives[k - 1].startswith("^") for k in numbers)
    return {
        f"statements at {commit}": str(then),
        "today": str(every),
        "today, without the files of later abilities": f"{every - later} ({(every - later) / then - 1:+.0%})",
        f"today, on lines that stood at {commit}": f"{stood} ({stood / every:.0%})",
    }


def executed(call: Callable[[], object]) -> tuple[int, int]:
    """Files of the package, and functions, that a second call runs."""
    package = str(Path(td.__file__).parent)
    seen: set[tuple[str, str, int]] = set()

    def note(frame: FrameType, event: str, argument: object) -> None:
        code = frame.f_code
        if event == "call" and code.co_filename.startswith(package) and code.co_name != "<module>":
            seen.add((code.co_filename, code.co_qualname, code.co_firstlineno))

    call()
    sys.setprofile(note)
    try:
        call()
    finally:
        sys.setprofile(None)
    return len({file for file, _, _ in seen}), len(seen)


def calls() -> dict[str, Callable[[], object]]:
    """The simplest fit, of one coefficient to a log of two columns, and a prediction from it."""
    model = td.model_from_dict(DECK)
    bench = td.Scenario("bench", boundaries={"air": "20 [degC]"}, start="20 [degC]", duration="30 [min]")
    run = td.simulate(model, bench)
    plate = td.Channel.of("T", run["plate"].kelvin, unit="K", role="node", target="plate", noise=0.05)
    record = td.Record.from_arrays("log", run.times, {"T": plate, "air": td.Channel.of("air", run["air"].kelvin, unit="K")})
    start = model.with_values({"film.htc": "5 [W/(m^2 K)]"})
    fit = td.calibrate(start, record, free=["film.htc"])
    hot = td.Scenario("hot", boundaries={"air": "40 [degC]"}, start="40 [degC]", duration="30 [min]")
    return {"calibrate": lambda: td.calibrate(start, record, free=["film.htc"]), "predict": lambda: td.predict(fit, hot)}


def figures() -> dict[str, str]:
    """What is measured -> how much."""
    modules = read_modules()
    rows = {guard: measure(modules) for guard, measure in GUARDS.items()}
    largest = max(files_by_package(modules).items(), key=lambda item: item[1])
    kept = {name: statements(m) for name, m in modules.items()}
    core = sum(n for name, n in kept.items() if not name.removeprefix("thermid.").startswith(OUTSIDE))
    run = {name: executed(call) for name, call in calls().items()}
    files = len([m for m in modules.values() if not m.package])
    return {
        "circles, imports in functions and for the type checker counted": f"{len(rows['circles'])}"
        f" (largest {max((len(group.split()) for group in rows['circles']), default=0)} files)",
        "own imports inside functions": str(sum(rows["imports_in_functions"].values())),
        "files with one importer, in the same room": f"{len(rows['one_importer'])} of {files}",
        "class names with more than one meaning": str(len(rows["doubled_classes"])),
        "files in the largest package": f"{largest[1]} ({largest[0]})",
        "packages with more than 15 files": str(len(rows["crowded_packages"])),
        **{f"files executed by a warm {name} (functions)": f"{n} ({f})" for name, (n, f) in run.items()},
        "statements of Python": str(sum(kept.values())),
        "of those in the core": f"{core} ({core / sum(kept.values()):.0%})",
    }


def main() -> None:
    """Print the table, or shrink the list."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--shrink", action="store_true", help="take off the list of offenders what no longer offends")
    parser.add_argument("--since", default="", metavar="COMMIT", help="compare the statements with those of a commit")
    given = parser.parse_args()
    if given.shrink:
        modules = read_modules()
        lists = {guard: shrunk(GUARDS[guard](modules), rows) for guard, rows in listed().items()}
        LIST.write_text(as_toml(lists), encoding="utf-8")
        return
    print("| figure | today |\n|---|---|")
    for name, text in (since(given.since) if given.since else figures()).items():
        print(f"| {name} | {text} |")


if __name__ == "__main__":
    main()
