"""A model in a scenario as a functional mock-up unit, without a compiler."""

from __future__ import annotations

import hashlib
import io
import platform
import sys
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape
from pathlib import Path
from typing import Any, Final

from thermid import _kernel
from thermid.errors import OutputError, ThermidError, refuse_unknown
from thermid.files import FileKind, write_bytes
from thermid.interop.fmu import description as told
from thermid.interop.fmu.description import Described, FmuVariable, build_description, describe, structured
from thermid.interop.fmu.formulas import Formulas, Line, Symbol, formulas_of, free_parameters
from thermid.interop.fmu.image import MARK, image, still
from thermid.interop.wired import identifiers, one_line
from thermid.model.laws.signal import Constant
from thermid.model.tree.model import Model
from thermid.simulation.scenarios.scenario import Scenario
from thermid.simulation.simulator import network_for
from thermid.simulation.solver.engine import Engine
from thermid.simulation.solver.wiring import Wiring
from thermid.units import unit

VERSIONS: Final = ("2.0", "3.0")
LARGEST: Final = 5000
"""Nodes that the kernel's integrator takes."""
_KELVIN, _WATT, _RATE = (unit(text).dimension for text in ("K", "W", "K/s"))
_ENDING: Final = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")


def _wrote(path: Path) -> bool:
    """Whether thermid wrote an FMU."""
    try:
        with zipfile.ZipFile(path) as packed:
            return packed.read("resources/model.bin")[: len(MARK)] == MARK
    except (OSError, KeyError, zipfile.BadZipFile):
        return False


FMU: Final = FileKind("FMU", _wrote)


@dataclass(frozen=True, eq=False)
class ExportedFmu:
    """What was written.

    Parameters
    ----------
    title, version : str        Of the model; ``2.0`` or ``3.0``.
    variables : tuple           Every `FmuVariable`, by value reference.
    notes : tuple of str        What is fixed in it, assumed or not carried: its first lines.
    size : int                  Bytes of the file.
    """

    title: str
    version: str
    variables: tuple[FmuVariable, ...]
    notes: tuple[str, ...]
    size: int

    def names(self, causality: str) -> tuple[str, ...]:
        """Return the names of all variables of a causality: parameter, input or output."""
        return tuple(v.name for v in self.variables if v.causality == causality)

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the continuous states."""
        return tuple(v.name for v in self.variables if v.state)

    def to_dict(self) -> dict[str, Any]:
        """Return it as the JSON of a command holds it."""
        words = {"parameters": "parameter", "inputs": "input", "outputs": "output"}
        return {
            "fmi": self.version,
            "bytes": self.size,
            "notes": list(self.notes),
            "states": list(self.states),
            **{key: list(self.names(causality)) for key, causality in words.items()},
        }

    def __str__(self) -> str:
        """Its size, and what is fixed or not carried."""
        counts = ", ".join(f"{len(self.names(c))} {c}s" for c in ("parameter", "input", "output"))
        lines = [f"{self.title}: FMI {self.version}, {len(self.states)} states, {counts}"]
        return "\n".join([*lines, *(f"  {note}" for note in self.notes)])


def to_fmu(model: Model, scenario: Scenario, to: str | Path, version: str = "3.0") -> ExportedFmu:
    """Write a model in a scenario as an FMU for model exchange and co-simulation.

    The parameters of the model are parameters of the FMU, by their formulas; constant boundaries and loads are inputs; what changes in time
    in the scenario is part of the FMU. Temperatures, the heat into every boundary and the power of every load are outputs. All in SI.

    Parameters
    ----------
    model, scenario     As in `simulate`; the duration of the scenario is that of courses that repeat.
    to : path           The file, ending with ``.fmu``.
    version : str       ``3.0`` or ``2.0``.

    Raises
    ------
    ThermidError    When the version is none of these, the model is too large, or this installation has no library for FMUs.
    OutputError     When the file cannot be written.
    """
    refuse_unknown([version], VERSIONS, "version", "FMI has no version '{}' here.{near} There are {known}.", ThermidError)
    if Path(to).suffix.lower() != ".fmu":
        raise OutputError("the file of an FMU ends with .fmu: hosts know it by that.", str(to))
    library = _library()
    network = network_for(model, scenario)
    if len(network.nodes) > LARGEST:
        raise ThermidError(
            f"an FMU takes at most {LARGEST} nodes; this model has {len(network.nodes)}. Reduce it first: thermid reduce.", model.title
        )
    wiring = Wiring(network, scenario, free_parameters(network, scenario))
    wiring.gone = ()  # parameters may change what elimination would rest on
    draft = _Draft(wiring, formulas_of(wiring))
    identifier = next(iter(identifiers([model.title or "model"]).values()))
    data = draft.image("")
    token = hashlib.sha256(data + repr(draft.variables).encode()).hexdigest()
    sources = _sources()
    compiled = tuple(name for name in sources if name.endswith(".cpp"))
    text = one_line(" ".join([f"{model.title}, {wiring.scenario.title}, by thermid.", *draft.notes]))
    what = Described(model.title, identifier, token, text, wiring.scenario.seconds, compiled)
    files = {
        "modelDescription.xml": describe(what, draft.variables, version).encode(),
        "resources/model.bin": draft.image(token),
        f"binaries/{_folder(version)}/{identifier}{_ENDING}": library.read_bytes(),
        "documentation/index.html": _page(model.title, draft.notes).encode(),
        **{f"sources/{name}": data for name, data in sources.items()},
    }
    if version == "3.0":
        files["sources/buildDescription.xml"] = build_description(identifier, compiled).encode()
    packed = _packed(files)
    write_bytes(to, packed, FMU)
    return ExportedFmu(model.title, version, draft.variables, draft.notes, len(packed))


class _Draft:
    """Variables, data and first lines of an FMU."""

    def __init__(self, wiring: Wiring, formulas: Formulas) -> None:
        self.wiring, self.formulas = wiring, formulas
        self.engine = Engine(wiring)
        self.start = self.engine.started(formulas.assembled)
        self.arrays = still(self.engine.arrays())
        names = list(dict.fromkeys(self.engine.load_names))
        self.powers = {n: [k for k, own in enumerate(self.engine.load_names) if own == n] for n in names}
        self.variables = tuple(self._variables())
        self.notes = tuple(self._notes())

    def _variables(self) -> list[FmuVariable]:
        out = [FmuVariable("time", told.TIME, 0, "independent", unit("s").dimension)]
        out += [self._symbol(k, s) for k, s in enumerate(self.formulas.symbols)]
        capacity = self.wiring.structure.capacity
        first, states = len(out), [k for k, c in enumerate(capacity) if c >= 0]
        out += [self._state(k) for k in states]
        for place, k in enumerate(states, start=first):
            rate = unit("1/s").dimension if out[place].dimension == told.PLAIN else _RATE
            out.append(FmuVariable(f"der({out[place].name})", told.RATE, k, "local", rate, of=place))
        out += [self._temperature(node, k) for k, node in enumerate(self.engine.nodes) if capacity[k] < 0]
        return out + self._boundaries() + self._loads()

    def _state(self, k: int) -> FmuVariable:
        """Return a continuous state: a temperature, the heat that a node holds, or a state of a control."""
        node, start = self.engine.nodes[k], float(self.start.initial[k])
        stored = self.formulas.assembled.reduced.stored
        if node in stored:
            of = stored[node][0]
            what = f"heat of '{of}', as a temperature"
            return FmuVariable(structured("held", of), told.TEMPERATURE_OF, k, "local", _KELVIN, start, description=what)
        if node not in self.wiring.network.nodes:
            return FmuVariable(
                structured("state", node), told.TEMPERATURE_OF, k, "local", told.PLAIN, start, description="state of a control"
            )
        return replace(self._temperature(node, k), start=start)

    def _temperature(self, name: str, k: int, what: str = "") -> FmuVariable:
        """Return a temperature that follows from others."""
        return FmuVariable(structured("T", name), told.TEMPERATURE_OF, k, "output", _KELVIN, description=f"temperature of {what}'{name}'")

    def _symbol(self, k: int, s: Symbol) -> FmuVariable:
        """Return a parameter or an input."""
        parameters, signals = self.wiring.network.flat.parameters, self.wiring.signals
        if s.kind == "parameter":
            given, dimension = parameters.table[s.path].parameter, parameters.dimension(s.path)
            bounds = given.minimum, given.maximum
            return FmuVariable(structured("p", s.path), told.VALUE, k, "parameter", dimension, s.start, bounds, given.note)
        if s.kind == "boundary":
            what = f"temperature of boundary '{s.path}'"
            return FmuVariable(structured("T", s.path), told.VALUE, k, "input", _KELVIN, s.start, (0.0, None), what)
        if f"watts {s.path}" in signals:
            return FmuVariable(structured("load", s.path), told.VALUE, k, "input", _WATT, s.start, description=f"power of load '{s.path}'")
        what = f"command of load '{s.path}': its power is that of the model times this"
        return FmuVariable(structured("load", s.path), told.VALUE, k, "input", told.PLAIN, s.start, description=what)

    def _boundaries(self) -> list[FmuVariable]:
        """Return temperatures of boundaries that follow a course, and the heat into every one."""
        boundaries, given = self.wiring.network.boundaries, {s.name for s in self.formulas.symbols}
        nodes = len(self.engine.nodes)
        courses = [self._temperature(b, nodes + k, "boundary ") for k, b in enumerate(boundaries) if f"boundary {b}" not in given]
        return courses + [
            FmuVariable(structured("heat", b), told.HEAT, k, "output", _WATT, description=f"heat that flows into boundary '{b}'")
            for k, b in enumerate(boundaries)
        ]

    def _loads(self) -> list[FmuVariable]:
        """Return powers of loads, modes of controls and event indicators."""
        out = [
            FmuVariable(structured("power", load), told.POWER, k, "output", _WATT, description=f"power of load '{load}'")
            for k, load in enumerate(self.powers)
        ]
        own = self.wiring.structure.controls
        for k, name in enumerate(self.engine.control_names):
            if k >= len(own):
                out.append(FmuVariable(structured("mode", name), told.MODE, k, "output", description=f"mode of control '{name}'"))
            elif own[k].kind == "thermostat":
                what = f"thermostat of '{name}': 1 on, 0 off"
                out.append(FmuVariable(structured("mode", name), told.MODE, k, "output", description=what))
        follow = self.arrays["follow"]
        guards = 2 * sum(c.kind == "thermostat" for c in own)  # the library watches two of each thermostat, then those of controls
        guards += sum(g[-1] < 0 for g in follow["guards"]) if follow is not None else 0
        what = "event indicator of a control"
        return out + [FmuVariable(f"indicator.g{k + 1}", told.INDICATOR, k, "local", description=what) for k in range(guards)]

    def _notes(self) -> list[str]:
        """Return what is fixed, assumed or not carried."""
        scenario, out = self.wiring.scenario, []
        moving = [n.partition(" ") for n, given in self.wiring.signals.items() if not isinstance(given, Constant)]
        courses = [path for kind, _, path in moving if kind in ("boundary", "load", "sine")]
        courses += list(self.wiring.schedule.signals) if self.wiring.schedule is not None else []
        if courses:
            until = f", which ends at {scenario.seconds:g} s; the last value holds after that" if scenario.seconds > 0 else ""
            out.append(f"Courses of the scenario{until}: {', '.join(dict.fromkeys(courses))}.")
        if self.wiring.start is not None or scenario.start in ("", *self.wiring.network.boundaries):
            out.append(
                "The start is that of the model's own values, as numbers: set temperatures anew where parameters or inputs change it."
            )
        return out + self._fixed()

    def _fixed(self) -> list[str]:
        """Return which values a host cannot set, and what is not carried at all."""
        wiring, out = self.wiring, []
        offered, refused = {s.name for s in self.formulas.symbols}, self.formulas.refused
        if refused:
            out.append(f"Fixed, because tables or branches follow them: {', '.join(n.partition(' ')[2] for n in refused)}.")
        constant = [b for b in wiring.network.boundaries if isinstance(wiring.signals[f"boundary {b}"], Constant)]
        idle = [b for b in constant if f"boundary {b}" not in offered and f"boundary {b}" not in refused]
        if idle:
            out.append(f"Nothing depends on {', '.join(idle)}: no input.")
        rows = self.start.numbers
        if any(row.curve is not None for row in rows.conductors) or any(row.curve is not None for row in rows.loads):
            out.append("Laws with tables give no word to the host when their range is left.")
        if any(row.form == "flow" for row in rows.conductors):
            out.append("The heat into boundaries does not hold what streams carry from them.")
        return [*out, "Sources, standings and uncertainties of values are not carried."]

    def image(self, token: str) -> bytes:
        """Return the data of the library."""
        line = Line(self.formulas.coefficients)
        order = {s.name: k for k, s in enumerate(self.formulas.symbols)}
        places = {k: order[name] for name, k in line.names.items()}
        naming = 1  # of Program::NAME
        steps = [(op, places[a] if op == naming else a, b) for op, a, b in line.steps]
        nodes = (*self.engine.nodes, *self.wiring.network.boundaries)
        start = [s.start for s in self.formulas.symbols]
        variables = [(v.kind, v.place) for v in self.variables]
        program = (steps, list(line.numbers), line.results)
        return image(token, nodes, self.arrays, program, (start, self.start.initial), variables, list(self.powers.values()))


def _library() -> Path:
    """Return the library that runs models of FMUs on this platform."""
    found = Path(_kernel.__file__).with_name(f"_kernel_fmu{_ENDING}")
    if not found.is_file():
        raise ThermidError(
            f"this installation has no library for FMUs: {found.name} stands beside the kernel in a complete one. Install thermid anew."
        )
    return found


def _sources() -> dict[str, bytes]:
    """Return name -> content of the sources of the library."""
    installed = Path(_kernel.__file__).with_name("_sources")
    root = installed if installed.is_dir() else Path(__file__).parents[3] / "kernel"
    rooms: dict[str, tuple[str, ...]] = dict.fromkeys(("algebra", "network", "integrator", "leastsquares", "fmu"), (".cpp", ".hpp"))
    rooms["ensemble"] = ("_lanes.hpp",)
    out = {}
    for room, endings in rooms.items():
        for file in sorted((root / room).glob("*")):
            if file.name.endswith(endings):
                out[f"{room}/{file.name}"] = file.read_bytes()
    return out


def _folder(version: str) -> str:
    """Return the folder of libraries for this platform, as the version names it."""
    own = platform.machine()
    machine = {"amd64": "x86_64", "x86_64": "x86_64", "arm64": "aarch64", "aarch64": "aarch64"}.get(own.lower(), own)
    if version == "3.0":
        return f"{machine}-{ {'win32': 'windows'}.get(sys.platform, sys.platform) }"
    word = {"win32": "win", "darwin": "darwin"}.get(sys.platform, "linux")
    return f"{word}64" if machine == "x86_64" or word == "darwin" else f"{machine}-{word}"


def _page(title: str, notes: Sequence[str]) -> str:
    """Return the documentation: what names begin with, and the first lines."""
    names = "p: parameters; T: temperatures; load: loads; heat: into boundaries; power: of loads; mode: of controls. All in SI."
    head = f'<!doctype html>\n<html lang="en"><meta charset="utf-8"><title>{escape(title)}</title>\n'
    lines = "".join(f"<li>{escape(note)}</li>\n" for note in notes)
    return f"{head}<h1>{escape(title)}</h1>\n<p>{names}</p>\n<ul>\n{lines}</ul>\n"


def _packed(files: Mapping[str, bytes]) -> bytes:
    """Return a zip file that is the same for the same content."""
    room = io.BytesIO()
    with zipfile.ZipFile(room, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, data in files.items():
            entry = zipfile.ZipInfo(name)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            packed.writestr(entry, data)
    return room.getvalue()
