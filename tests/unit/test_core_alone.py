"""The core without its optional parts: their folders removed, it imports, fits and predicts; with `campaign`, its tests pass."""

from __future__ import annotations

import re
import shutil
import tomllib
from pathlib import Path

import pytest

import thermid as td
from private_tree import ROOT, PrivateTree
from thermid.app.cli.app import COMMANDS

PARTS = ("bench", "app.studio", "interop", "site")
"""The optional parts of the one wheel, which the core never imports."""
EXTRAS = {"bench": {"log"}, "app.studio": {"studio"}, "interop": {"symbolic", "fmu"}, "site": {"site"}}
"""Part -> the extras of pyproject.toml that hold its third-party packages."""
COMMANDS_OF_PARTS = {place.function.partition(".")[0] for place in COMMANDS.values() if place.extra in set.union(*EXTRAS.values())}
"""Modules of the command line that are imported when a command of a part is called, and not before."""
FOLDERS = ("tests/unit", "tests/analytic", "tests/properties", "tests/recovery", "tests/regression", "tests/document")
"""Where tests of the core stand. Pages, examples and the architecture are about the whole product."""

WHOLE = (
    "tests/unit/app/cli/test_exchange.py",
    "tests/unit/results.py",
    "tests/unit/test_results_travel.py",
    "tests/unit/test_extensions.py",
    "tests/unit/app/cli/test_mistakes.py::test_one_sentence[moisture-]",
    "tests/unit/app/cli/test_outputs.py::test_the_same_command_again_needs_no_force",
    "tests/unit/qualify/profile_runs/test_conduct.py::test_humidity_is_followed_and_condensation_named",
    "tests/unit/simulation/test_columns_of_logs.py::test_a_column_beside_a_trajectory_counts_from_lift_off",
    "tests/unit/test_arguments.py::test_every_public_function_that_takes_an_object_is_guarded",
    "tests/document/test_rows.py::test_every_row_has_its_test",
    "tests/document/test_slips.py::test_what_handles_a_slip_is_tested",
)
"""Tests of the whole product that stand among those of the core: they run a command of a part, or walk what all parts offer or test."""

RESULT = """
import pkgutil, sys
from importlib import import_module
import thermid as td

skipped = {"thermid.__main__", *(f"thermid.app.cli.{name}" for name in sys.argv[1].split(","))}
for module in pkgutil.walk_packages(td.__path__, "thermid."):
    if module.name not in skipped:
        import_module(module.name)
deck = {"title": "x", "needs": ["air"], "nodes": {"a": {"capacitance": "900 [J/K]"}}, "loads": {"p": {"into": "a", "power": "5 [W]"}},
        "surfaces": {"s": {"of": "a", "to": "air", "area": "0.05 [m^2]", "htc": {"value": "8 [W/(m^2 K)]", "min": 1}}}}
model = td.model_from_dict(deck)
bench = td.Scenario("bench", boundaries={"air": "20 [degC]"}, start="20 [degC]", duration="1 [h]")
run = td.simulate(model, bench)
channel = td.Channel.from_array("T", run["a"].kelvin, unit="K", role="node", target="a", noise=0.05)
data = td.Record.from_arrays("log", run.times, {"T": channel})
fit = td.calibrate(model.with_values({"s.htc": "5 [W/(m^2 K)]"}), data, ["s.htc"], scenario=bench)
assert abs(fit["s.htc"].value - 8.0) < 0.01
assert abs(td.predict(fit, bench, without=("structural", "misfit"))["a"].final.celsius - run["a"].final) < 0.01
assert not {name for name in sys.modules if name.startswith(%r)}
""" % (tuple(f"thermid.{part}" for part in PARTS),)  # noqa: UP031


def alone(directory: Path, *folders: str) -> PrivateTree:
    """A copy of the tree without the folders of the parts."""
    tree = PrivateTree(directory / "tree", ("src", *folders))
    for part in PARTS:
        folder = tree.package.joinpath(*part.split("."))
        assert folder.is_dir(), f"there is no part '{part}' any more"
        shutil.rmtree(folder)
    return tree


def test_it_imports_fits_and_predicts(tmp_path: Path) -> None:
    done = alone(tmp_path).python("-W", "error", "-c", RESULT, ",".join(COMMANDS_OF_PARTS))
    assert done.returncode == 0, done.stderr


def test_packages_of_parts_are_extras() -> None:
    """What only a part imports is installed with its extra, never with the core."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    always = {re.split(r"[<>=]", name)[0].lower() for name in project["dependencies"]}
    extras = {extra: {re.split(r"[<>=]", n)[0].lower() for n in names} for extra, names in project["optional-dependencies"].items()}
    of_parts = set[str]().union(*(extras[extra] for several in EXTRAS.values() for extra in several))
    assert not of_parts & always
    asked = {part: imported(ROOT.joinpath("src", "thermid", *part.split("."))) for part in PARTS}
    for part, packages in asked.items():
        offered = always.union(extras["report"], *(extras[e] for e in EXTRAS[part]))
        assert {MODULES.get(p, p) for p in packages} <= offered, part


MODULES = {"serial": "pyserial"}
"""Module -> the package that brings it, where the names differ."""


def imported(folder: Path) -> set[str]:
    """Third-party modules that the files of a folder import, anywhere in them."""
    import ast
    import sys

    out: set[str] = set()
    for path in folder.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                out |= {name.name.partition(".")[0] for name in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
                out.add(node.module.partition(".")[0])
    return out - sys.stdlib_module_names - {"thermid"}


def of_a_part(path: Path) -> bool:
    """Whether a file of tests is a part's: it stands in the part's folder, or names the part or one of its public names."""
    tables = (vars(td)["_TOP"], *vars(td)["_NAMESPACES"].values())
    names = [name for table in tables for name, module in table.items() if module.partition(".")[0] in PARTS]
    assert len(names) > 10
    named = re.search(rf"thermid\.(?:{'|'.join(PARTS)})\b|\btd\.(?:\w+\.)?(?:{'|'.join(names)})\b", path.read_text(encoding="utf-8"))
    return path.parent.name in {part.rpartition(".")[2] for part in PARTS} or named is not None or path.name == Path(__file__).name


@pytest.mark.campaign
def test_tests_of_the_core_pass_without_the_parts(tmp_path: Path) -> None:
    tree = alone(tmp_path, "tests", "benchmarks", "examples", "scripts", "docs")
    left_out = [p for p in (tree.root / "tests").rglob("test_*.py") if of_a_part(p)]
    assert len(left_out) < 80
    for path in left_out:
        path.unlink()
    for part in PARTS:
        shutil.rmtree(tree.root.joinpath("tests", "unit", *part.split(".")), ignore_errors=True)
    whole = [f"--deselect={name}" for name in WHOLE if "::" in name] + [f"--ignore={name}" for name in WHOLE if "::" not in name]
    done = tree.pytest(FOLDERS, "-n", "2", "--maxfail", "20", *whole, seconds=3600.0)
    assert done.returncode == 0, "\n".join(done.stdout.splitlines()[-60:])
