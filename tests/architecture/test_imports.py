"""Imports point one way, room by room, and never in a circle; heavy libraries wait until they are needed."""

from __future__ import annotations

import ast
import graphlib
import json
import re
import subprocess
import sys
from collections.abc import Iterable

import pytest

import thermid

from .source import ROOT, Module, room_of, within

FOUNDATION = {
    "arguments",
    "errors",
    "extensions",
    "files",
    "toml_files",
    "grammar",
    "memo",
    "_units_table",
    "units",
    "expression",
    "dual",
    "linear_algebra",
    "renamed",
    "results",
}

MODEL = {"model", "model.laws", "model.parts", "model.tree", "model.deck", "model.blocks"}
SIMULATION = {"simulation", "simulation.scenarios", "simulation.solver"}
MEASURE = {"measure", "measure.amounts", "measure.record", "measure.readers"}
# Optional parts: none of the other rooms imports them, nor loads them by text; what they add stands behind an extension point.
OPTIONAL = {"site"}

# Package: the packages it may import; of a room with packages inside, each has its own line. `thermid/__init__.py` offers the public names
# of all of them and stands outside.
ARROWS: dict[str, set[str]] = {
    "bench": set(),
    "errors": set(),
    "arguments": {"errors"},
    "extensions": {"errors"},
    "files": {"errors"},
    "toml_files": {"errors", "extensions", "files"},
    "grammar": {"errors"},
    "memo": set(),
    "renamed": set(),
    "results": {"errors", "extensions"},
    "_units_table": set(),
    "dual": set(),
    "linear_algebra": set(),
    "units": {"errors", "_units_table"},
    "expression": {"errors", "units", "dual"},
    "physics": FOUNDATION,
    "model": set(),
    "model.laws": FOUNDATION,
    "model.parts": FOUNDATION | {"physics", "model.laws"},
    "model.tree": FOUNDATION | {"physics", "model.laws", "model.parts"},
    "model.deck": FOUNDATION | {"physics", "model.laws", "model.parts", "model.tree"},
    "model.blocks": FOUNDATION | {"model.laws", "model.tree", "model.deck"},
    "network": FOUNDATION | MODEL | {"physics", "_kernel"},
    "measure.amounts": FOUNDATION,
    "measure.record": FOUNDATION | {"measure.amounts"},
    "measure.readers": FOUNDATION | {"measure.amounts", "measure.record"},
    "measure": FOUNDATION | MEASURE - {"measure"},
    "knowledge": FOUNDATION | MODEL | MEASURE | {"physics"},
    "simulation.scenarios": FOUNDATION | MODEL | {"physics", "network", "measure"},
    "simulation.solver": FOUNDATION | MODEL | {"physics", "network", "knowledge", "simulation.scenarios", "_kernel"},
    "simulation": FOUNDATION | MODEL | SIMULATION | {"physics", "network", "knowledge", "_kernel"},
}
LOW = FOUNDATION | MODEL | SIMULATION | MEASURE | {"physics", "network", "knowledge"}
FIT = {"fit", "fit.problem", "fit.minimisation", "fit.search", "fit.uncertainty", "fit.second_clocks"}
REPORTING = {"reporting.blocks", "reporting.pictures", "reporting.diagrams", "reporting.pages", "reporting.qualification"}
ABOVE_FIT = {"estimation", "power", "explain", "judge", "prediction", "design", "inference"}
TESTED = {"sourced", "profiles", "profile_runs", "steadiness", "reduction", "monte_carlo"}
ARROWS |= {
    "sourced": LOW,
    "profiles": LOW | {"sourced"},
    "profile_runs": LOW | {"profiles"},
    "steadiness": LOW | {"profile_runs"},
    "watch": LOW | FIT | {"estimation", "steadiness"},
    "reduction": LOW,
    "fit.problem": LOW,
    "fit.minimisation": LOW | {"fit.problem"},
    "fit.uncertainty": LOW | {"fit.problem", "fit.minimisation"},
    "fit.search": LOW | {"fit.problem", "fit.minimisation", "fit.uncertainty"},
    "fit.second_clocks": LOW | {"fit.problem", "fit.minimisation", "fit.uncertainty"},
    "fit": LOW | FIT - {"fit"},
    "power": LOW | FIT,
    "estimation": LOW | FIT,
    "explain": LOW | FIT | {"power"},
    "judge": LOW | FIT | {"sourced", "prediction"},
    "prediction": LOW | FIT | {"explain"},
    "design": LOW | FIT | {"prediction"},
    "inference": LOW | FIT | {"design"},
    "campaign": LOW | FIT | {"judge", "inference", "explain", "power"},
    "start": LOW | FIT | {"explain", "campaign"},
    "monte_carlo": LOW | FIT | {"prediction", "campaign", "reduction"},
    "qualify": LOW | FIT | {"judge", "explain", "prediction", "campaign"} | TESTED,
    "reporting": set(),
    "reporting.blocks": LOW | {"sourced"},
    "reporting.pictures": LOW | FIT | {"explain", "inference", "profile_runs", "monte_carlo", "reporting.blocks"},
    "reporting.diagrams": LOW,
    "reporting.pages": LOW
    | FIT
    | {"sourced", "campaign", "explain", "judge", "inference", "reporting.blocks", "reporting.pictures", "reporting.diagrams"},
    "reporting.qualification": LOW | {"sourced", "judge", "qualify", "reporting.blocks", "reporting.pictures", "reporting.pages"},
    "site": FOUNDATION | MODEL | SIMULATION | MEASURE | {"physics", "network", "sourced"},
    "acquire": FOUNDATION | MEASURE,
    "interop": FOUNDATION | MODEL | SIMULATION | {"physics", "network"},
    "interop.fmu": LOW | FIT | {"interop", "_kernel"},
}
TOP = {"cli", "studio", "__main__"}
ARROWS |= {room: {*ARROWS, *TOP, ""} - {"_kernel"} for room in TOP}

# A scenario may take signals from columns of a table: that is all that `simulation` may know of measurements.
ONLY_NAMES = {("simulation.scenarios", "measure"): {"read_record", "read_plain"}}

HEAVY = ("pandas", "scipy", "matplotlib", "xarray", "pydantic", "pint", "plotly", "jinja2", "h5netcdf", "h5py", "sympy", "pvlib", "fmpy")


def package_of(name: str) -> str:
    """Longest beginning of a dotted name, below `thermid`, that has a line in ARROWS; else the room."""
    parts = name.split(".")[1:]
    return next((p for n in range(len(parts), 0, -1) if (p := ".".join(parts[:n])) in ARROWS), room_of(name))


def forbidden_imports(modules: Iterable[Module], known: set[str]) -> list[str]:
    """Every import against the arrows, as a line a person can act on; `known` are the modules that exist."""
    found = []
    for module in modules:
        if module.name == "thermid" or module.name.removeprefix("thermid.") in thermid._NAMESPACES:
            continue  # they offer the public names of all rooms
        here = package_of(module.name)
        if here not in ARROWS:
            found.append(f"{module.name}: the room '{here}' has no line in ARROWS of {__name__}")
            continue
        for imported in module.imports():
            for target, names in within(imported, {*known, "thermid._kernel"}):
                room = package_of(target)
                if room == here:
                    continue
                if room not in ARROWS[here]:
                    found.append(f"{module.name}:{imported.line} imports {target}; '{here}' may not import '{room or 'thermid'}'")
                    continue
                only = ONLY_NAMES.get((here, room))
                if only and not (names and only.issuperset(names)):
                    taken, free = ", ".join(names) or target, ", ".join(only)
                    found.append(f"{module.name}:{imported.line} takes {taken}; of '{room}' only {free} is open to '{here}'")
    return found


def import_circle(modules: dict[str, Module]) -> list[str]:
    """One circle of imports that run when a module is loaded, or an empty list."""
    known = set(modules)
    graph: dict[str, set[str]] = {}
    for module in modules.values():
        loaded: set[str] = set()
        for imported in module.imports():
            if imported.lazy or imported.typing:
                continue
            for target, _ in within(imported, known):
                parts = target.split(".")
                loaded |= {".".join(parts[:n]) for n in range(2, len(parts) + 1)}  # loading a.b.c loads a.b first
        ours = module.name.split(".")
        packages = {".".join(ours[:n]) for n in range(1, len(ours))}  # being loaded already, unless named on purpose
        named = {target for i in module.imports() if not (i.lazy or i.typing) for target, _ in within(i, known)}
        graph[module.name] = (loaded - packages | (named & packages)) & known - {module.name}
    try:
        graphlib.TopologicalSorter(graph).prepare()
    except graphlib.CycleError as error:
        return list(error.args[1])
    return []


def test_imports_point_one_way(modules: dict[str, Module]) -> None:
    assert len(modules) > 10
    problems = forbidden_imports(modules.values(), set(modules))
    assert not problems, "\n" + "\n".join(problems)


def places_on_the_map(text: str) -> dict[str, int]:
    """Package -> its place on the map of a text: packages after an arrow or in a later line have a higher one."""
    places: dict[str, int] = {}
    place = 0
    for line in text.partition("\n## Map\n")[2].partition("\n\n**")[0].splitlines():
        room, place = "", place + 1
        for name, colon, arrow, end in re.findall(r"`(\w+)`(?: \([^)]*\))?(:?)|(→)|([;|])", line if line.startswith("|") else ""):
            if colon:
                room = name
            elif name:
                places[f"{room}.{name}" if room else name] = place
            elif arrow:
                place += 1
            elif end and room:
                place += 1
                places[room], room = place, ""  # a room is above its packages
    return places


def test_the_map_of_contributing_shows_every_room_and_its_arrows(modules: dict[str, Module]) -> None:
    places = places_on_the_map((ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8"))
    rooms = {room_of(name) for name, module in modules.items() if module.package} - {""}
    assert rooms <= set(places), f"the map lacks {sorted(rooms - set(places))}"
    assert set(places) <= set(ARROWS), f"ARROWS lacks {sorted(set(places) - set(ARROWS))}"
    missing = {key for key in ARROWS if key not in places and key.partition(".")[0] not in places}
    assert missing == {"_units_table", "__main__"}

    def place(package: str) -> int:
        return places.get(package, places.get(package.partition(".")[0], 0))

    wrong = [
        f"{package} may import {other}, which is not left of it or above"
        for package, others in ARROWS.items()
        for other in sorted(others - TOP - {"_kernel", "_units_table", ""})
        if package.partition(".")[0] != other.partition(".")[0] or (other in places and package in places)
        if other != package and package not in {"_units_table", "__main__"} and place(other) >= place(package)
    ]
    assert not wrong, "\n" + "\n".join(wrong)


def stated_rooms(text: str) -> set[str]:
    """Rooms that a package's docstring says it may import, beside "the rooms below a fit" or, below that, "the foundation"."""
    _, mark, line = text.partition("May import:")
    assert mark
    assert ("the rooms below a fit" in line) != ("the foundation" in line)
    return set(re.findall(r"`([a-z_.]+)`", line))


def allowed_rooms(package: str) -> set[str]:
    """The same by the contract; a room stands for the packages in it."""
    rooms = ARROWS[package] - (FOUNDATION if package in LOW | OPTIONAL else LOW)
    return {room for room in rooms if room.rpartition(".")[0] not in rooms}


SAYING = MEASURE - {"measure.amounts"} | FIT | ABOVE_FIT | TESTED | REPORTING | {"campaign", "qualify"} | MODEL | SIMULATION | OPTIONAL
SAYING |= {"network", "knowledge", "watch"}


@pytest.mark.parametrize("package", sorted(SAYING - {"model", "simulation"}))
def test_a_package_says_what_it_may_import(modules: dict[str, Module], package: str) -> None:
    """What it is for in a line, what comes in, what goes out, and the contract, in at most six lines."""
    text = ast.get_docstring(modules[f"thermid.{package}"].tree) or ""
    assert "In: " in text
    assert " Out: " in text
    assert len(text.splitlines()) <= 7
    assert stated_rooms(text) == allowed_rooms(package)


def test_a_docstring_against_the_contract_is_seen() -> None:
    assert stated_rooms("X.\n\nMay import: `fit`, `qualify` and the rooms below a fit.") != allowed_rooms("judge")


def test_no_package_has_the_name_of_a_public_function(modules: dict[str, Module]) -> None:
    """Importing it would replace the function (decision 011)."""
    assert not {m.name.partition(".")[2] for m in modules.values() if m.package} & set(thermid._TOP)


def test_no_module_needs_itself_to_load(modules: dict[str, Module]) -> None:
    assert import_circle(modules) == []


@pytest.mark.parametrize(
    ("name", "text", "word"),
    [
        ("thermid.physics.x", "from thermid.model.tree.model import Model", "may not import 'model.tree'"),
        ("thermid.measure.x", "def f():\n    import thermid.model.parts.kinds", "may not import 'model.parts'"),
        ("thermid.model.x", "from .. import simulation", "may not import 'simulation'"),
        ("thermid.inference.x", "from thermid import _kernel", "may not import '_kernel'"),
        ("thermid.explain.x", "import thermid as td", "may not import 'thermid'"),
        ("thermid.reporting.x", "import importlib\nimportlib.import_module('thermid.cli')", "may not import 'cli'"),
        ("thermid.units", "if TYPE_CHECKING:\n    from thermid.expression import Expression", "may not import 'expression'"),
        ("thermid.simulation.x", "def f():\n    from thermid.site.pad import pad_scenario", "may not import 'site'"),
        ("thermid.profile_runs.x", "import importlib\nimportlib.import_module('thermid.site.moisture')", "may not import 'site'"),
        ("thermid.simulation.scenarios.x", "from thermid.measure import Record", "only "),
        ("thermid.kitchen.x", "", "no line in ARROWS"),
        ("thermid.fit.problem.x", "if TYPE_CHECKING:\n    from thermid.fit.calibration import Calibration", "may not import 'fit'"),
        ("thermid.fit.x", "from thermid.campaign.retune import plan_retune", "may not import 'campaign'"),
        ("thermid.explain.x", "def f():\n    from thermid.campaign import retune", "may not import 'campaign'"),
    ],
)
def test_an_import_against_the_arrows_is_seen(modules: dict[str, Module], name: str, text: str, word: str) -> None:
    problems = forbidden_imports([Module(name, text)], set(modules))
    assert len(problems) == 1
    assert word in problems[0]


def test_a_circle_is_seen() -> None:
    one = Module("thermid.model.one", "from thermid.model.two import two")
    two = Module("thermid.model.two", "from .one import one")
    late = Module("thermid.model.two", "def f():\n    from .one import one")
    typed = Module("thermid.model.two", "if TYPE_CHECKING:\n    from .one import one")
    assert set(import_circle({one.name: one, two.name: two})) == {one.name, two.name}
    assert import_circle({one.name: one, late.name: late}) == []
    assert import_circle({one.name: one, typed.name: typed}) == []


def heavy_after(code: str) -> list[str]:
    """Names of the heavy libraries that a fresh interpreter holds after running `code`."""
    script = f"{code}\nimport sys, json\nprint(json.dumps([name for name in {HEAVY!r} if name in sys.modules]))"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return list(json.loads(done.stdout.splitlines()[-1]))


def test_heavy_libraries_would_be_seen() -> None:
    assert heavy_after("import pydantic") == ["pydantic"]


def test_import_loads_nothing_heavy() -> None:
    assert heavy_after("import thermid") == []


def test_public_names_load_nothing_heavy() -> None:
    """Only calling them does."""
    every = "for space, names in thermid._NAMESPACES.items(): [getattr(getattr(thermid, space), n) for n in names]"
    assert heavy_after(f"import thermid\nfor name in thermid.__all__: getattr(thermid, name)\n{every}") == []


def test_help_loads_nothing_heavy() -> None:
    run = """
import sys
from thermid.cli import main
sys.argv = ['thermid', '--help']
try:
    main()
except SystemExit as end:
    assert not end.code
"""
    assert heavy_after(run) == []
