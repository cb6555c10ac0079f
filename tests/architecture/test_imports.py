"""Imports point one way, room by room, and never in a circle; heavy libraries wait until they are needed."""

from __future__ import annotations

import ast
import graphlib
import json
import re
import subprocess
import sys
from collections.abc import Iterable, Mapping

import pytest

import thermid

from .source import ROOT, Module, is_inner, room_of, within

# Room: the rooms that it may import, as the code does; the map of CONTRIBUTING shows the same. `thermid/__init__.py`, which offers public
# names of all rooms, stands outside.
ARROWS: dict[str, set[str]] = {
    "base": set(),
    "physics": {"base"},
    "model": {"base", "physics"},
    "measure": {"base"},
    "values": {"base", "model"},
    "simulation": {"_kernel", "base", "measure", "model", "physics", "values"},
    "fit": {"base", "measure", "model", "physics", "simulation", "values"},
    "inference": {"base", "fit", "measure", "model", "physics", "simulation", "values"},
    "prediction": {"base", "fit", "inference", "measure", "model", "physics", "simulation", "values"},
    "campaign": {"base", "fit", "inference", "measure", "model", "physics", "prediction", "simulation", "values"},
    "qualify": {"base", "campaign", "fit", "inference", "measure", "model", "prediction", "simulation", "values"},
    "reporting": {"base", "campaign", "fit", "inference", "measure", "model", "prediction", "qualify", "simulation", "values"},
    "bench": {"base", "measure"},
    "site": {"base", "measure", "model", "physics", "simulation"},
    "interop": {"_kernel", "base", "model", "simulation"},
}
OPTIONAL = {"bench", "site", "interop"}
"""Rooms that none but `app` imports: what they add is announced by entry points."""
TOP = {"app", "__main__"}
ARROWS |= {room: {*ARROWS, *TOP} for room in TOP}

# Packages and modules inside a room, each of which imports only those before it; "." are all others of the room but its doors.
INSIDE = {
    "model": ("_laws", "_parts", "_tree", "_deck", "_blocks"),
    "measure": (".", "_record", "_readers"),
    "simulation": ("_many", "_network", "_scenarios", "_solver", "."),
    "fit": (
        "_problem",
        "_minimisation",
        "_uncertainty",
        "_inputs",
        "_calibration",
        "_error_model",
        ".",
        "_power",
        "_estimation",
    ),
    "inference": ("_explain", "."),
    "prediction": (".", "_reduction", "_monte_carlo"),
    "campaign": ("_judge", ".", "_start"),
    "qualify": ("_profiles", "_profile_runs", "_steadiness", "_watch", "."),
    "reporting": ("_blocks", "_pictures", "_diagrams", "_pages", "_qualification"),
    "interop": (".", "_decks", "_fmu"),
    "app": (".", "studio", "cli"),
}

# A scenario may take signals from columns of a table: that is all that `simulation` may know of measurements.
ONLY_NAMES = {("simulation", "measure"): {"read_record", "read_plain"}}

HEAVY = ("pandas", "scipy", "matplotlib", "xarray", "pydantic", "pint", "plotly", "jinja2", "h5netcdf", "h5py", "sympy", "pvlib", "fmpy")


def inside_of(name: str) -> str:
    """Package or module of `INSIDE` that a module is or is in; "." where there is none."""
    parts = name.split(".")[2:]
    return parts[0] if parts and parts[0] in INSIDE.get(room_of(name), ()) else "."


def forbidden_imports(modules: Iterable[Module], known: Mapping[str, Module]) -> list[str]:
    """Every import against the arrows, the doors or the order inside a room, as a line a person can act on; `known` are the modules."""
    found = []
    for module in modules:
        if module.name == "thermid" or module.name.removeprefix("thermid.") in thermid._NAMESPACES:
            continue  # they offer the public names of all rooms
        here = module.room
        if here not in ARROWS:
            found.append(f"{module.name}: the room '{here}' has no line in ARROWS of {__name__}")
            continue
        for imported in module.imports():
            for target, names in within(imported, {*known, "thermid._kernel"}):
                room = room_of(target)
                place = f"{module.name}:{imported.line} imports {target}"
                if room != here:
                    if room not in ARROWS[here]:
                        found.append(f"{place}; '{here}' may not import '{room or 'thermid'}'")
                    elif is_inner(target):
                        found.append(f"{place}, which is inside '{room}': take the name from a door of that room")
                    elif (only := ONLY_NAMES.get((here, room))) and not (names and only.issuperset(names)):
                        taken, free = ", ".join(names) or target, ", ".join(only)
                        found.append(f"{module.name}:{imported.line} takes {taken}; of '{room}' only {free} is open to '{here}'")
                elif not module.gives_names:
                    order = INSIDE.get(here, (".",))
                    if target in known and known[target].gives_names:
                        found.append(f"{place}, a door of its own room: take the name from the module that defines it")
                    elif order.index(inside_of(target)) > order.index(inside_of(module.name)):
                        found.append(f"{place}; in '{here}' the order is {', '.join(order)}")
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
    problems = forbidden_imports(modules.values(), modules)
    assert not problems, "\n" + "\n".join(problems)


def arrows_of(modules: Mapping[str, Module]) -> dict[str, set[str]]:
    """Room -> the rooms that it imports, drawn from the code."""
    known = {*modules, "thermid._kernel"}
    found: dict[str, set[str]] = {}
    for module in modules.values():
        if module.room in ARROWS and module.room not in TOP:
            stub = module.package and module.name.removeprefix("thermid.") in thermid._NAMESPACES
            targets = {room_of(t) for i in module.imports() if not (stub and i.typing) for t, _ in within(i, known)}
            found.setdefault(module.room, set()).update(targets - {module.room})
    return found


def test_every_arrow_is_used(modules: dict[str, Module]) -> None:
    assert arrows_of(modules) == {room: others for room, others in ARROWS.items() if room not in TOP}


def test_the_map_of_contributing_is_that_of_the_code() -> None:
    """One row a room, in the order of ARROWS, with what it may import."""
    rows = re.findall(r"^\| `(\w+)` \|.*\| ([^|]*) \|$", (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8"), re.MULTILINE)
    shown = {room: set(re.findall(r"`(\w+)`", others)) for room, others in rows}
    assert shown == {room: others for room, others in ARROWS.items() if room not in TOP} | {"app": set()}


@pytest.mark.parametrize("room", sorted({*ARROWS} - {"__main__"}))
def test_a_room_says_what_it_is_for(modules: dict[str, Module], room: str) -> None:
    """What it is for in a line, what comes in, what goes out, and what it may import."""
    text = ast.get_docstring(modules[f"thermid.{room}"].tree) or ""
    assert room == "physics" or ("In: " in text and " Out: " in text)
    _, mark, line = text.partition("May import:")
    assert mark
    assert set(re.findall(r"`([a-z_]+)`", line)) == (set() if room == "app" else ARROWS[room])


def test_no_package_has_the_name_of_a_public_function(modules: dict[str, Module]) -> None:
    """Importing it would replace the function (decision 011)."""
    assert not {m.name.partition(".")[2] for m in modules.values() if m.package} & set(thermid._TOP)


def test_no_module_needs_itself_to_load(modules: dict[str, Module]) -> None:
    assert import_circle(modules) == []


@pytest.mark.parametrize(
    ("name", "text", "word"),
    [
        ("thermid.physics.x", "from thermid.model.tree import Model", "may not import 'model'"),
        ("thermid.measure.x", "def f():\n    import thermid.model.tree", "may not import 'model'"),
        ("thermid.model.x", "from .. import simulation", "may not import 'simulation'"),
        ("thermid.inference.x", "from thermid import _kernel", "may not import '_kernel'"),
        ("thermid.inference.x", "import thermid as td", "may not import 'thermid'"),
        ("thermid.reporting.x", "import importlib\nimportlib.import_module('thermid.app')", "may not import 'app'"),
        ("thermid.base.units", "if TYPE_CHECKING:\n    from thermid.model.tree import Model", "may not import 'model'"),
        ("thermid.simulation.x", "def f():\n    from thermid.site.pad import pad_scenario", "may not import 'site'"),
        ("thermid.qualify.x", "import importlib\nimportlib.import_module('thermid.site.moisture')", "may not import 'site'"),
        ("thermid.simulation._scenarios.x", "from thermid.measure.records import Record", "only "),
        ("thermid.kitchen.x", "", "no line in ARROWS"),
        ("thermid.fit._problem.x", "if TYPE_CHECKING:\n    from thermid.fit._calibration import Calibration", "the order is _problem"),
        ("thermid.fit.x", "from thermid.campaign.studies import plan_retune", "may not import 'campaign'"),
        ("thermid.campaign.x", "from thermid.fit._calibration import Calibration", "inside 'fit'"),
        ("thermid.campaign.x", "from thermid.fit import _calibration", "inside 'fit'"),
        ("thermid.fit.x", "from thermid.fit.calibration import Request", "a door of its own room"),
    ],
)
def test_an_import_against_the_arrows_is_seen(modules: dict[str, Module], name: str, text: str, word: str) -> None:
    problems = forbidden_imports([Module(name, text)], modules)
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
from thermid.app.cli import main
sys.argv = ['thermid', '--help']
try:
    main()
except SystemExit as end:
    assert not end.code
"""
    assert heavy_after(run) == []
