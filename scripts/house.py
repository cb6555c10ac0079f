"""Figures of the house: ``python scripts/house.py`` prints the table, ``--shrink`` takes off the list of offenders what no longer offends.

Circles, imports inside functions, slices, doubled class names and crowded packages are counted as the guards of tests/architecture count
them. Files executed are those of which a second, warm call runs a function. Statements are those of the syntax tree without docstrings.
"""

from __future__ import annotations

import argparse
import ast
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

DECK = {
    "title": "plate",
    "needs": ["air"],
    "nodes": {"plate": {"capacitance": "100 [J/K]"}},
    "conductors": {"film": {"kind": "convection", "between": ["plate", "air"], "htc": "8 [W/(m^2 K)]", "area": "0.05 [m^2]"}},
    "loads": {"heater": {"into": "plate", "power": "5 [W]"}},
}


def statements(module: Module) -> int:
    """How many statements a module holds; docstrings, those of its constants too, are none."""
    texts = sum(
        isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
        for node in ast.walk(module.tree)
    )
    return sum(isinstance(node, ast.stmt) for node in ast.walk(module.tree)) - texts


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
    plate = td.Channel.of("T", run["plate"].kelvin, role="node", target="plate", noise=0.05)
    record = td.Record.from_arrays("log", run.times, {"T": plate, "air": td.Channel.of("air", run["air"].kelvin)})
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
    if parser.parse_args().shrink:
        modules = read_modules()
        lists = {guard: shrunk(GUARDS[guard](modules), rows) for guard, rows in listed().items()}
        LIST.write_text(as_toml(lists), encoding="utf-8")
        return
    print("| figure | today |\n|---|---|")
    for name, text in figures().items():
        print(f"| {name} | {text} |")


if __name__ == "__main__":
    main()
