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

import numpy as np

from thermid import _kernel
from thermid.base.errors import OutputError, ThermidError, refuse_unknown
from thermid.base.files import FileKind, read_bytes
from thermid.base.units import DIMENSIONLESS, counted, unit, value_of
from thermid.interop._fmu import image as told
from thermid.interop._fmu.archive import DESCRIPTION
from thermid.interop._fmu.description import Described, FmuVariable, build_description, describe, structured
from thermid.interop._fmu.image import MARK, OPERATIONS, image, still
from thermid.interop._wired import Formula, identifiers, named, one_line
from thermid.model.tree import Constant, Model
from thermid.simulation.runs import Assembled, Engine, Numbers, Scenario, Wiring, network_for

VERSIONS: Final = ("2.0", "3.0")
MAX_KERNEL_NODES: Final = 5000
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


MAX_FORMULA_DIFFERENCE = 1e-10
"""How far a formula's number may be from that of the network, as a share of it. [-]"""
MOVES = (1.13, 0.83)
"""What values are multiplied by to see whether the formulas hold away from the model's own values. [-]"""
COMPUTE = {"+": np.add, "-": np.subtract, "*": np.multiply, "/": np.divide, "**": np.power, "min": np.minimum, "max": np.maximum}
ALONE = {"neg": np.negative, "sqrt": np.sqrt, "exp": np.exp, "log": np.log}


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
        counts = ", ".join(counted(len(self.names(c)), c) for c in ("parameter", "input", "output"))
        lines = [f"{self.title}: FMI {self.version}, {counted(len(self.states), 'state')}, {counts}"]
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
        raise OutputError("the file of an FMU ends with .fmu: hosts know it by that.", str(to), code="output.wrong-ending")
    library = _library()
    network = network_for(model, scenario)
    if len(network.nodes) > MAX_KERNEL_NODES:
        raise ThermidError(
            f"an FMU takes at most {MAX_KERNEL_NODES} nodes; this model has {len(network.nodes)}. Reduce it first by `td.qualify.reduce`.",
            model.title,
            code="output.not-expressible",
        )
    table = network.flat.parameters
    scheduled = {table.literal_behind(network.flat.names.model.canonical(raw)) for raw in scenario.schedule}
    wiring = Wiring(network, scenario, tuple(p for p in table.order if table.table[p].parameter.is_literal and p not in scheduled))
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
        DESCRIPTION: describe(what, draft.variables, version).encode(),
        "resources/model.bin": draft.image(token),
        f"binaries/{_folder(version)}/{identifier}{_ENDING}": read_bytes(library),
        "documentation/index.html": _page(model.title, draft.notes).encode(),
        **{f"sources/{name}": data for name, data in sources.items()},
    }
    if version == "3.0":
        files["sources/buildDescription.xml"] = build_description(identifier, compiled).encode()
    packed = _packed(files)
    FMU.save_bytes(to, packed)
    return ExportedFmu(model.title, version, draft.variables, draft.notes, len(packed))


class _Draft:
    """Variables, data and first lines of an FMU."""

    def __init__(self, wiring: Wiring, formulas: OfferedFormulas) -> None:
        self.wiring, self.formulas = wiring, formulas
        self.engine = Engine(wiring)
        self.start = self.engine.started(formulas.assembled)
        self.arrays = still(self.engine.arrays())
        names = list(dict.fromkeys(self.engine.load_names))
        self.powers = {n: [k for k, load_name in enumerate(self.engine.load_names) if load_name == n] for n in names}
        self.variables = tuple(self._variables())
        self.notes = tuple(self._notes())

    def _variables(self) -> list[FmuVariable]:
        """Return every variable of the FMU in the order of its value references: time, parameters, states, rates, temperatures, inputs."""
        out = [FmuVariable("time", told.TIME, 0, "independent", unit("s").dimension)]
        out += [self._symbol(k, s) for k, s in enumerate(self.formulas.symbols)]
        capacity = self.wiring.structure.capacity
        first, states = len(out), [k for k, c in enumerate(capacity) if c >= 0]
        out += [self._state(k) for k in states]
        for place, k in enumerate(states, start=first):
            rate = unit("1/s").dimension if out[place].dimension == DIMENSIONLESS else _RATE
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
                structured("state", node), told.TEMPERATURE_OF, k, "local", DIMENSIONLESS, start, description="state of a control"
            )
        return replace(self._temperature(node, k), start=start)

    def _temperature(self, name: str, k: int, what: str = "") -> FmuVariable:
        """Return a temperature that follows from others."""
        return FmuVariable(structured("T", name), told.TEMPERATURE_OF, k, "output", _KELVIN, description=f"temperature of {what}'{name}'")

    def _symbol(self, k: int, s: Symbol) -> FmuVariable:
        """Return a parameter or an input."""
        parameters = self.wiring.network.flat.parameters
        if s.kind == "parameter":
            parameter, dimension = parameters.table[s.path].parameter, parameters.dimension(s.path)
            bounds = parameter.walls
            return FmuVariable(structured("p", s.path), told.VALUE, k, "parameter", dimension, s.start, bounds, parameter.note)
        if s.kind == "boundary":
            what = f"temperature of boundary '{s.path}'"
            return FmuVariable(structured("T", s.path), told.VALUE, k, "input", _KELVIN, s.start, (0.0, None), what)
        if s.path in self.wiring.scenario.loads:
            return FmuVariable(structured("load", s.path), told.VALUE, k, "input", _WATT, s.start, description=f"power of load '{s.path}'")
        what = f"command of load '{s.path}': its power is that of the model times this"
        return FmuVariable(structured("load", s.path), told.VALUE, k, "input", DIMENSIONLESS, s.start, description=what)

    def _boundaries(self) -> list[FmuVariable]:
        """Return temperatures of boundaries that follow a course, and the heat into every one."""
        boundaries, symbol_names = self.wiring.network.boundaries, {s.name for s in self.formulas.symbols}
        nodes = len(self.engine.nodes)
        courses = [self._temperature(b, nodes + k, "boundary ") for k, b in enumerate(boundaries) if f"boundary {b}" not in symbol_names]
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
        controls = self.wiring.structure.controls
        for k, name in enumerate(self.engine.control_names):
            if k >= len(controls):
                out.append(FmuVariable(structured("mode", name), told.MODE, k, "output", description=f"mode of control '{name}'"))
            elif controls[k].kind == "thermostat":
                what = f"thermostat of '{name}': 1 on, 0 off"
                out.append(FmuVariable(structured("mode", name), told.MODE, k, "output", description=what))
        follow = self.arrays["follow"]
        guards = 2 * sum(c.kind == "thermostat" for c in controls)  # the library watches two of each thermostat, then those of controls
        guards += sum(g[-1] < 0 for g in follow["guards"]) if follow is not None else 0
        what = "event indicator of a control"
        return out + [FmuVariable(f"indicator.g{k + 1}", told.INDICATOR, k, "local", description=what) for k in range(guards)]

    def _notes(self) -> list[str]:
        """Return what is fixed, assumed or not carried."""
        scenario, out = self.wiring.scenario, [f"INCOMPLETE: {what}." for what in self.wiring.network.flat.names.model.missing_parts()]
        moving = [n.partition(" ") for n, course in self.wiring.signals.items() if not isinstance(course, Constant)]
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
        line = StraightLine(self.formulas.coefficients)
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
    library = Path(_kernel.__file__).with_name("_fmu") / f"_kernel_fmu{_ENDING}"
    if not library.is_file():
        raise ThermidError(
            f"this installation has no library for FMUs: {library.name} is missing beside the kernel. Reinstall thermid.",
            code="extra.not-installed",
        )
    return library


def _sources() -> dict[str, bytes]:
    """Return name -> content of the sources of the library."""
    installed = Path(_kernel.__file__).with_name("_sources")
    root = installed if installed.is_dir() else Path(__file__).parents[3] / "kernel"
    rooms: dict[str, tuple[str, ...]] = dict.fromkeys(("algebra", "network", "step", "integrator", "leastsquares", "fmu"), (".cpp", ".hpp"))
    rooms["ensemble"] = ("_lanes.hpp",)
    files = ((room, file) for room, endings in rooms.items() for file in sorted((root / room).glob("*")) if file.name.endswith(endings))
    return {f"{room}/{file.name}": read_bytes(file) for room, file in files}


def _folder(version: str) -> str:
    """Return the folder of libraries for this platform, as the version names it."""
    machine_name = platform.machine()
    machine = {"amd64": "x86_64", "x86_64": "x86_64", "arm64": "aarch64", "aarch64": "aarch64"}.get(machine_name.lower(), machine_name)
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


@dataclass(frozen=True)
class Symbol:
    """A value that a host may set.

    Parameters
    ----------
    name : str      ``parameter``, ``boundary`` or ``load``, a space, and the path.
    start : float   [SI]
    """

    name: str
    start: float

    @property
    def kind(self) -> str:
        """``parameter``, ``boundary`` or ``load``."""
        return self.name.partition(" ")[0]

    @property
    def path(self) -> str:
        """Its path in the model."""
        return self.name.partition(" ")[2]


@dataclass(frozen=True, eq=False)
class OfferedFormulas:
    """Coefficients as formulas.

    Parameters
    ----------
    assembled : Assembled       The numbers at the model's own values.
    symbols : tuple of Symbol   What the formulas hold, in order: parameters, boundaries, loads.
    coefficients : tuple        In the kernel's order; what a constant load multiplies holds it. [SI]
    refused : dict              Name of a symbol that is not offered -> why.
    """

    assembled: Assembled
    symbols: tuple[Symbol, ...]
    coefficients: tuple[Formula | float, ...]
    refused: Mapping[str, str]


def formulas_of(wiring: Wiring) -> OfferedFormulas:
    """Return the coefficients of a wiring as formulas.

    A symbol is offered where the formulas give what the network itself gives after it has moved, and tables stay as they are: a table that
    was made from a parameter, or a branch that it decides, has no formula.

    Parameters
    ----------
    wiring : Wiring     Without eliminated nodes, its parameters free.
    """
    assembled = wiring.assemble(gradients=False)
    values = {f"parameter {p}": value_of(assembled.numbers.values[p]) for p in wiring.parameters}
    constant = [b for b in wiring.network.boundaries if isinstance(wiring.signals[f"boundary {b}"], Constant)]
    values |= {f"boundary {b}": value_of(assembled.offsets[b]) for b in constant}
    offered, refused = dict(values), {}
    if not _holds(wiring, assembled, values, offered, tuple(values)):
        offered = {}
        for name in values:
            if _holds(wiring, assembled, values, {**offered, name: values[name]}, (name,)):
                offered[name] = values[name]
            elif _acts(wiring, assembled, values, name):
                refused[name] = "tables or branches follow it"
    coefficients = _coefficient_formulas(wiring, offered)
    used = {path for c in coefficients if isinstance(c, Formula) for path in c.paths()}
    symbols = [Symbol(name, start) for name, start in offered.items() if name in used]
    loads = {n.removeprefix("load "): s.value for n, s in wiring.signals.items() if n.startswith("load ") and isinstance(s, Constant)}
    coefficients = _with_loads(wiring, coefficients, loads)
    used = {path for c in coefficients if isinstance(c, Formula) for path in c.paths()}
    symbols += [Symbol(f"load {path}", start) for path, start in loads.items() if f"load {path}" in used]
    return OfferedFormulas(assembled, tuple(symbols), tuple(coefficients), refused)


def _plain(name: str) -> str:
    """Return what the wiring calls a symbol."""
    return name.partition(" ")[2]


def _coefficient_formulas(wiring: Wiring, offered: Mapping[str, float]) -> list[Formula | float]:
    """Return the coefficients with a formula over every symbol that is offered."""
    symbols: dict[str, Any] = {_plain(n): named(n, v) for n, v in offered.items()}
    return [c if isinstance(c, Formula) else value_of(c) for c in wiring.every(wiring.assembled_at(symbols), symbols)]


def _holds(wiring: Wiring, assembled: Assembled, values: Mapping[str, float], offered: Mapping[str, float], moved: Sequence[str]) -> bool:
    """Return whether formulas over `offered` give the network's own numbers at values that are `moved`, and tables stay."""
    try:
        coefficients = _coefficient_formulas(wiring, offered)
    except (ThermidError, ArithmeticError, TypeError, ValueError):
        return False
    was_checked = False
    for by in MOVES:
        at = {**values, **{n: _moved(wiring, n, values[n], by) for n in moved}}
        network_numbers = _network(wiring, {n: at[n] for n in moved})
        if network_numbers is None:
            continue
        was_checked = True
        ours, theirs = StraightLine(coefficients).values(at), np.array(network_numbers.coefficients)
        if (
            ours.shape != theirs.shape
            or not np.allclose(ours, theirs, rtol=MAX_FORMULA_DIFFERENCE, atol=0.0)
            or not _same_tables(assembled.numbers, network_numbers.numbers)
        ):
            return False
    return was_checked


def _acts(wiring: Wiring, assembled: Assembled, values: Mapping[str, float], name: str) -> bool:
    """Return whether a symbol changes anything at all, or cannot be changed."""
    moved = (_network(wiring, {name: _moved(wiring, name, values[name], by)}) for by in MOVES)
    return any(
        other is None
        or not np.array_equal(other.coefficients, assembled.coefficients)
        or not _same_tables(assembled.numbers, other.numbers)
        for other in moved
    )


def _network(wiring: Wiring, values: Mapping[str, float]) -> Assembled | None:
    """Return the numbers at some values; None where there are none."""
    try:
        return wiring.assembled_at({_plain(n): v for n, v in values.items()})
    except (ThermidError, ArithmeticError, ValueError):
        return None


def _moved(wiring: Wiring, name: str, value: float, by: float) -> float:
    """Return another value of a symbol, within the bounds that its author gives: value times `by`, or 0.1 `by` of a value of zero. [SI]

    Of a boundary value + 20 K (by - 1), as a temperature has no zero to be multiplied from.
    """
    if name.startswith("boundary "):
        return value + 20.0 * (by - 1.0)
    parameter = wiring.network.flat.parameters.table[_plain(name)].parameter
    low, high = (-np.inf if parameter.minimum is None else parameter.minimum), (np.inf if parameter.maximum is None else parameter.maximum)
    return max(min(value * by if value else 0.1 * by, high), low)


def _same_tables(one: Numbers, other: Numbers) -> bool:
    """Return whether the tables of all rows are the same points."""
    curves = [[*(row.curve for row in numbers.conductors), *(row.curve for row in numbers.loads)] for numbers in (one, other)]
    return all(
        a is b or (a is not None and b is not None and np.array_equal(a.x, b.x) and np.array_equal(a.y, b.y))
        for a, b in zip(*curves, strict=True)
    )


def _with_loads(wiring: Wiring, coefficients: Sequence[Formula | float], loads: Mapping[str, float]) -> list[Formula | float]:
    """Return the coefficients, each times the constant signal that multiplies it; loads are symbols."""
    out, names = [], list(wiring.used)
    structure = wiring.structure
    for coefficient, place in zip(coefficients, structure.coefficient_input, strict=True):
        base = structure.driven[place - len(names)].base if place >= len(names) else place
        signal = wiring.signals[names[base]] if base >= 0 else None
        if not isinstance(signal, Constant):
            out.append(coefficient)
            continue
        kind, _, path = names[base].partition(" ")
        symbol: Formula | float = named(f"load {path}", loads[path]) if kind in ("load", "curve") and path in loads else signal.value
        factor = symbol * (symbol - 1.0) if kind == "curve" and isinstance(symbol, Formula) else symbol
        out.append(coefficient * factor)
    return out


class StraightLine:
    """Formulas as one straight line of operations, each written once.

    Parameters
    ----------
    formulas : sequence     Formulas or numbers. [SI]
    """

    def __init__(self, formulas: Sequence[Formula | float]) -> None:
        self.names: dict[str, int] = {}
        self.numbers: dict[float, int] = {}
        self.steps: list[tuple[int, int, int]] = []
        self._known: dict[tuple[int, int, int], int] = {}
        self._made: dict[int, int] = {}
        self._kept = list(formulas)  # identities stay those of these objects
        self.results = [self._place_of(f) for f in self._kept]

    def _place_of(self, formula: Formula | float) -> int:
        """Return the place of a formula among the steps of the program, its parts before it; equal formulas share one."""
        if not isinstance(formula, Formula):
            return self._step(OPERATIONS.index("number"), self.numbers.setdefault(float(formula), len(self.numbers)), 0)
        if id(formula) in self._made:
            return self._made[id(formula)]
        if formula.operator == "name":
            at = self._step(OPERATIONS.index("name"), self.names.setdefault(formula.parts[0], len(self.names)), 0)
        elif formula.operator == "number":
            at = self._place_of(formula.value)
        else:
            parts = [self._place_of(part) for part in formula.parts]
            at = self._step(OPERATIONS.index(formula.operator), parts[0], parts[1] if len(parts) > 1 else 0)
        self._made[id(formula)] = at
        return at

    def _step(self, operation: int, a: int, b: int) -> int:
        """Return the place of an operation on the results of steps `a` and `b`, added where it is new."""
        if (operation, a, b) not in self._known:
            self._known[operation, a, b] = len(self.steps)
            self.steps.append((operation, a, b))
        return self._known[operation, a, b]

    def values(self, at: Mapping[str, float]) -> Any:
        """Return the numbers (formulas,) at values of the names. [SI]"""
        names, numbers, out = list(self.names), list(self.numbers), np.empty(len(self.steps))
        with np.errstate(all="ignore"):
            for k, (operation, a, b) in enumerate(self.steps):
                word = OPERATIONS[operation]
                if word in ("number", "name"):
                    out[k] = numbers[a] if word == "number" else at[names[a]]
                else:
                    out[k] = ALONE[word](out[a]) if word in ALONE else COMPUTE[word](out[a], out[b])
        return out[self.results]
