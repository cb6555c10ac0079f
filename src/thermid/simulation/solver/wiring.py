"""A network and a scenario wired to the kernel: flat arrays once, numbers with derivatives at every set of values."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from thermid.dual import Dual, Number, gradient_of, value_of
from thermid.errors import ScenarioError, nearest
from thermid.model.laws.signal import Constant, Drawn, Signal, Table, common_cycle, literal, multiplied
from thermid.model.laws.stores import Store
from thermid.network.eliminate import Reduced, eliminable, reduce_network, with_stores
from thermid.network.network import Network, Numbers
from thermid.network.rows import CONTROLS, ConductorRow, LoadRow, conductance, heat
from thermid.network.streams import signal_of
from thermid.simulation.scenarios.scenario import PERIODIC, STEADY, Scenario, Start
from thermid.simulation.solver.inputs import check_courses, load_inputs, normalised, read_schedule, scheduled
from thermid.units import TEMPERATURE

Array = NDArray[np.float64]
Csr = tuple[NDArray[np.int32], NDArray[np.int32], Array]
Row = TypeVar("Row", ConductorRow, LoadRow)

MARK = "scheduled"
"""Stands in a row's signal while massless nodes are chosen for elimination: its conductance changes in time."""


@dataclass(frozen=True, eq=False)
class Assembled:
    """Numbers of one set of values, ready for the kernel.

    Parameters
    ----------
    coefficients : array (coefficients,)        [SI]
    jacobian : (indptr, indices, data)          Their derivatives with respect to the free names, as CSR; None without free names.
    initial : array (nodes,)                    [K]
    initial_gradient : array (nodes, free)      [K per unit]
    reduced : Reduced                           The network without eliminated nodes.
    numbers : Numbers                           The network's rows.
    offsets : dict                              Boundary -> constant part of its temperature. [K]
    """

    coefficients: Array
    jacobian: Csr | None
    initial: Array
    initial_gradient: Array
    reduced: Reduced
    numbers: Numbers
    offsets: Mapping[str, Number]


@dataclass
class _Builder:
    """Collects coefficients, and for the first assembly the index arrays that name them."""

    inputs: Mapping[str, int]
    values: list[Number] = field(default_factory=list)
    coefficient_input: list[int] = field(default_factory=list)

    def add(self, number: Number, signal: str = "") -> int:
        self.values.append(number)
        self.coefficient_input.append(self.inputs[signal] if signal else -1)
        return len(self.values) - 1


class Wiring:
    """A network and a scenario, with names to be freed.

    Parameters
    ----------
    network : Network
    scenario : Scenario
    free : tuple of str     Parameter paths, boundaries (a constant added to their signal), ``initial.<node>``, and ``scale.<load>``
                            (a factor on its power); what acts on readings alone, ``reading.<channel>``, changes nothing here.

    Raises
    ------
    ThermidError   When names do not fit, or a boundary has no temperature.
    """

    def __init__(self, network: Network, scenario: Scenario, free: Sequence[str] = ()) -> None:
        self.network = network
        self.scenario = normalised(network, scenario)
        self.free = tuple(free)
        self.parameters = tuple(n for n in self.free if n in network.flat.parameters.table)
        for name in self.free:
            self._check_free(name)
        self.schedule = read_schedule(network, self.scenario)
        base = network.numbers()
        signals: dict[str, Signal] = {f"boundary {b}": s for b, s in self.scenario.boundaries.items()}
        needed = {name for row in base.conductors for name in (row.signal, row.second)}
        gases = {name: given for name, given in network.media.signals().items() if name in needed}
        self.streams = {c.path: network.streams.course(c.path, self.scenario.boundaries) for c in network.streams.conductors}
        gases |= {signal_of(path): course for path, course in self.streams.items() if not isinstance(course, Constant)}
        signals |= load_inputs(network, self.scenario, base) | gases
        follow = self.schedule.signals if self.schedule is not None else {}
        changing = {n: s for n, s in (*signals.items(), *follow.items()) if s.cycle != 0.0}
        self.changing = tuple(dict.fromkeys(_shown(n) for n in changing))
        self.cycle = common_cycle([s.cycle for s in changing.values()])
        self.signals: dict[str, Drawn] = {name: given.drawn(self.scenario.seconds) for name, given in signals.items()}
        self._follow: dict[tuple[str, int, int], str] = {}
        numbers = self.flowing(self._numbers({}), {})
        for (path, _, _), name in self._follow.items():
            if signal_of(path) in gases:
                both = multiplied(self.signals[name], gases[signal_of(path)])
                self.signals[f"{signal_of(path)} {name}"] = both.drawn(self.scenario.seconds)
        # the kernel needs a node to solve for, even where all of them only follow
        self.gone = eliminable(self._marked(numbers))[: len(network.nodes) - 1]
        self.used: dict[str, int] = {}
        self._structure: dict[str, Any] = {}
        self._last: tuple[tuple[bytes, bool], Assembled] | None = None
        self._start: Number | str = ""
        self._initial: dict[str, Number | str] = {}
        self._read_start()

    def _check_free(self, name: str) -> None:
        head, _, node = name.partition(".")
        if name in self.parameters or name in self.network.boundaries or (head == "initial" and node in self.network.nodes):
            return
        if head == "reading" or (head == "scale" and node in {load.path for load in self.network.flat.loads}):
            return
        known = [*self.network.flat.parameters.table, *self.network.boundaries, *(f"initial.{n}" for n in self.network.nodes)]
        raise ScenarioError(f"nothing named '{name}' can be freed.{nearest(name, known)}", self.network.title)

    def _numbers(self, free: Mapping[str, Number]) -> Numbers:
        if self.schedule is None:
            return self.network.numbers(free)
        numbers, follow = scheduled(self.network, self.schedule, free)
        if self._follow:
            check_courses(numbers, follow, {key: self.signals[name] for key, name in self._follow.items()}, self.network.title)
            return numbers
        for key, given in follow.items():
            name = f"schedule {' '.join(map(str, key))}"
            self.signals[name] = given
            self._follow[key] = name
        return numbers

    def flowing(self, numbers: Numbers, given: Mapping[str, Number]) -> Numbers:
        """Return the numbers with streams of gas at the temperatures of their sources; the network has them at 20 degC."""
        offsets = {b: self._offset(b, given) for b in self.network.boundaries if b in given}
        return replace(numbers, conductors=tuple(self._flowing(r, offsets) if r.name in self.streams else r for r in numbers.conductors))

    def _flowing(self, row: ConductorRow, offsets: Mapping[str, Number]) -> ConductorRow:
        """Return the row of a stream with the course of its mass in this scenario."""
        streams, course = self.network.streams, self.streams[row.name]
        still = streams.still(row.name)
        within = still.value if isinstance(still, Constant) else 1.0
        now = course.value if isinstance(course, Constant) else 1.0
        factor = streams.shifted(row.name, self.scenario.boundaries, offsets) * (now / within if within else 0.0)
        signal = "" if isinstance(course, Constant) else signal_of(row.name)
        return replace(row, coefficients=(row.coefficients[0] * factor,), signal=signal)

    def _marked(self, numbers: Numbers) -> Numbers:
        """Mark scheduled conductors as changing in time, so that elimination leaves them alone."""
        scheduled_rows = {name for name, _, _ in self._follow}
        rows = tuple(replace(r, signal=r.signal or MARK) if r.name in scheduled_rows else r for r in numbers.conductors)
        return replace(numbers, conductors=rows)

    def _read_start(self) -> None:
        start = self.scenario.start
        self.start = Start.of(start, f"{self.scenario.title}, start")
        if self.start is not None:
            self._check_start(self.start)
        if start == "":
            if len(self.network.boundaries) != 1:
                raise ScenarioError("there is no start: give a temperature, the name of a boundary, or 'steady'.", self.scenario.title)
            start = self.network.boundaries[0]
        self._start = self._temperature(start, "start") if self.start is None else STEADY
        self._initial = {n: self._temperature(v, f"initial.{n}") for n, v in self.scenario.initial.items()}

    def _check_start(self, start: Start) -> None:
        """Refuse a start that asks for more of the inputs than the run has."""
        where, seconds = f"{self.scenario.title}, start", self.scenario.seconds
        if start.time > seconds > 0.0:
            raise ScenarioError(f"it takes the inputs at {start.time:g} s, after the end of the run at {seconds:g} s.", where)
        if start.kind == STEADY:
            return
        if (self.cycle or 0.0) > seconds * (1.0 + 1e-9):
            raise ScenarioError(f"the inputs repeat after {self.cycle:g} s, and the run lasts {seconds:g} s. Let it last a period.", where)
        if start.kind == PERIODIC and not self.cycle:
            if not self.changing:
                raise ScenarioError("nothing comes back periodically, as no input changes in time. Write start = 'steady'.", where)
            raise ScenarioError(
                f"nothing comes back periodically: {', '.join(self.changing)} do not repeat. A table repeats with after = 'repeat'; "
                "the longest period is at most a thousand of the shortest.",
                where,
            )

    def _temperature(self, value: Any, key: str) -> Number | str:
        """Return an initial temperature: a number, or the canonical name of a boundary."""
        if isinstance(value, str):
            path = self.network.flat.names.model.canonical(value)
            if path in self.network.boundaries:
                return path
            if path.replace(".", "").replace("_", "").isalnum() and not path[0].isdigit():
                known = [*self.network.boundaries, STEADY, PERIODIC]
                raise ScenarioError(f"'{value}' is no temperature and no boundary.{nearest(value, known)}", f"{self.scenario.title}, {key}")
        return literal(value, TEMPERATURE, f"{self.scenario.title}, {key}") if isinstance(value, str) else float(value)

    def assemble(self, x: Array | None = None, gradients: bool = True) -> Assembled:
        """Return the numbers at values of the free names, in their order [SI], with their derivatives unless these are not wanted."""
        values = np.zeros(0) if x is None else np.asarray(x, dtype=float)
        asked = (values.tobytes(), gradients)
        if self._last is None or self._last[0] != asked:
            self._last = (asked, self._assemble(values, gradients))
        return self._last[1]

    def _assemble(self, values: Array, gradients: bool) -> Assembled:
        given: dict[str, Number] = dict(zip(self.free, values.tolist(), strict=True)) if values.size else {}
        if gradients and values.size:
            eye = np.eye(values.size)
            given = {name: Dual(value_of(v), eye[k]) for k, (name, v) in enumerate(given.items())}
        return self.assembled_at(given, values.size if gradients else 0)

    def assembled_at(self, given: Mapping[str, Number], free: int = 0) -> Assembled:
        """Return the numbers at values of some free names; `free` is the length of their gradients, zero for none. [SI]"""
        numbers = self.flowing(self._numbers({p: given[p] for p in self.parameters if p in given}), given)
        reduced = with_stores(reduce_network(self.network, self._marked(numbers), self.gone), self.network.stores)
        return self._build(numbers, reduced, given, free)

    def _build(self, numbers: Numbers, reduced: Reduced, given: Mapping[str, Number], free: int) -> Assembled:
        offsets = {b: self._offset(b, given) for b in self.network.boundaries}
        if not self._structure:
            self._structure = self._lay_out(numbers, reduced, offsets, given)
        coefficients = self._coefficients(numbers, reduced, offsets, given)
        initial = [
            _level(reduced.stored[n][1], self._initial_of(reduced.stored[n][0], offsets, given))
            if n in reduced.stored
            else self._initial_of(n, offsets, given)
            for n in reduced.nodes
        ]
        start = np.array([value_of(v) for v in initial])
        gradient = np.array([gradient_of(v, free) for v in initial]).reshape(len(initial), free)
        jacobian = _csr(coefficients, free) if free else None
        return Assembled(np.array([value_of(v) for v in coefficients]), jacobian, start, gradient, reduced, numbers, offsets)

    def _offset(self, boundary: str, given: Mapping[str, Number]) -> Number:
        """Return the constant part of a boundary's temperature. [K]"""
        if boundary not in given:
            return self._constant(boundary)
        return given[boundary] if isinstance(self.signals[f"boundary {boundary}"], Constant) else given[boundary] + 0.0

    def _coefficients(self, numbers: Numbers, reduced: Reduced, offsets: Mapping[str, Number], given: Mapping[str, Number]) -> list[Number]:
        """Return all coefficients in the order in which the structure names them."""
        out: list[Number] = [c for c in reduced.capacitances.values() if c is not None]
        for b, shift in offsets.items():
            out += (shift,) if isinstance(self.signals[f"boundary {b}"], Constant) else (1.0, shift)
        for row in reduced.conductors:
            if row.ends[0] != row.ends[1]:
                out += row.coefficients
        for load in numbers.loads:
            if load.node not in self.network.boundaries:
                powered = load.signal.startswith("load ")
                out += (self._power(load.name, load.own[0], numbers, given), *load.own[1:]) if powered else load.own
        for load in self._controlled(numbers):
            out += load.settings
        return out

    def _lay_out(self, numbers: Numbers, reduced: Reduced, offsets: Mapping[str, Number], given: Mapping[str, Number]) -> dict[str, Any]:
        """Return the index arrays, the same for all values."""
        self.used = {name: k for k, name in enumerate(self.signals)}
        make = _Builder(self.used)
        structure: dict[str, Any] = {"nodes": reduced.nodes}
        structure["capacity"] = [-1 if c is None else make.add(c) for c in (reduced.capacitances[n] for n in reduced.nodes)]
        structure["gain"], structure["offset"] = [], []
        for b, shift in offsets.items():
            constant = isinstance(self.signals[f"boundary {b}"], Constant)
            structure["gain"].append(-1 if constant else make.add(1.0, f"boundary {b}"))
            structure["offset"].append(make.add(shift))
        index = {n: k for k, n in enumerate((*reduced.nodes, *self.network.boundaries))}
        structure["conductors"] = self._conductors(reduced.conductors, make, index)
        structure["loads"] = self._loads(numbers, make, index, given)
        structure["controls"] = [self._control(row, make, index, structure["loads"]) for row in self._controlled(numbers)]
        structure["coefficient_input"] = make.coefficient_input
        return structure

    def _conductors(self, rows: Sequence[ConductorRow], make: _Builder, index: Mapping[str, int]) -> list[Any]:
        out = []
        for row, position in _numbered(rows):
            if row.ends[0] == row.ends[1]:
                continue  # two needs of a part may be bound to one node; no heat flows from a node to itself
            places = []
            for c, number in enumerate(row.coefficients):
                places.append(make.add(number, self._conductor_signal(row, position, c)))
            out.append((row.form, index[row.ends[0]], index[row.ends[1]], places, row.curve, row.name))
        return out

    def _conductor_signal(self, row: ConductorRow, position: int, c: int) -> str:
        """Return the input that a conductor's coefficient is multiplied by; empty for none."""
        follow = self._follow.get((row.name, position, c), "")
        own = (row.signal if row.signal != MARK else "") if c == 0 else row.second if c == 1 else ""
        if follow and own and row.name in self.streams:
            return f"{own} {follow}"
        if follow and own:
            raise ScenarioError(f"'{row.name}' cannot follow a schedule while the pressure of its gas changes.", self.scenario.title)
        return follow or own

    def conductor_flows(self, numbers: Numbers, temperatures: Mapping[str, Array], times: Array) -> dict[str, Array]:
        """Return conductor -> heat flow (times,) for temperatures by node; rows of one conductor are summed. [W]"""
        return self._summed(numbers, temperatures, times, heat)

    def conductor_conductances(self, numbers: Numbers, temperatures: Mapping[str, Array], times: Array) -> dict[str, Array]:
        """Return conductor -> heat flow over the difference of its ends (times,), rows of one conductor summed. [W/K]"""
        return self._summed(numbers, temperatures, times, conductance)

    def _summed(self, numbers: Numbers, temperatures: Mapping[str, Array], times: Array, law: Callable[..., Array]) -> dict[str, Array]:
        out: dict[str, Array] = {}
        for row, position in _numbered(numbers.conductors):
            a, b = (temperatures[end] for end in row.ends)
            coefficients = []
            for c, number in enumerate(row.coefficients):
                signal = self._conductor_signal(row, position, c)
                coefficients.append(value_of(number) * (self.signals[signal].at(times) if signal else np.ones(times.shape)))
            out[row.name] = out.get(row.name, 0.0) + law(row.form, coefficients, row.curve, a, b)
        return out

    def _controlled(self, numbers: Numbers) -> list[LoadRow]:
        """Return the first row of each load that has a control."""
        rows: dict[str, LoadRow] = {}
        for row in numbers.loads:
            if row.control and row.node not in self.network.boundaries:
                rows.setdefault(row.name, row)
        return list(rows.values())

    def _control(self, row: LoadRow, make: _Builder, index: Mapping[str, int], loads: Sequence[Any]) -> tuple[Any, ...]:
        begin = len(row.own)
        places = [make.add(number, self._follow.get((row.name, 0, begin + c), "")) for c, number in enumerate(row.settings)]
        if len(places) < CONTROLS[row.control].coefficients:
            places.append(next(own[0] for _, _, own, _, name, _ in loads if name == row.name))
        return row.control, index[row.sensor], places, row.name

    def _loads(self, numbers: Numbers, make: _Builder, index: Mapping[str, int], given: Mapping[str, Number]) -> list[Any]:
        out, controls = [], [row.name for row in self._controlled(numbers)]
        for row, position in _numbered(numbers.loads):
            if row.node in self.network.boundaries:
                continue  # heat into a given temperature changes nothing
            places = [make.add(number, signal) for number, signal in self._load_coefficients(row, position, numbers, given)]
            out.append((row.form, index[row.node], places, row.curve, row.name, controls.index(row.name) if row.control else -1))
        return out

    def _load_coefficients(self, row: LoadRow, position: int, numbers: Numbers, given: Mapping[str, Number]) -> list[tuple[Number, str]]:
        """Return the coefficients of a load's law, each with the input that it is multiplied by."""
        out = []
        for c, own in enumerate(row.own):
            follow = self._follow.get((row.name, position, c), "")
            signal, number = row.signal if c == 0 else "", own
            if follow and signal and self.signals[signal] != Constant(1.0):
                raise ScenarioError(f"load '{row.name}' follows both a command and a schedule; put both into one.", self.scenario.title)
            if c == 0 and signal.startswith("load "):
                number = self._power(row.name, own, numbers, given)
            out.append((number, follow or signal))
        return out

    def _power(self, load: str, own: Number, numbers: Numbers, given: Mapping[str, Number]) -> Number:
        """Return what multiplies a load's input: the deck's power, a gain in its place, or 1 where the input is in watts."""
        if load in self.scenario.gains:
            gain: Number = numbers.values[self.scenario.gains[load]]
            return gain * given[f"scale.{load}"] if f"scale.{load}" in given else gain
        if f"watts {load}" in self.signals:
            return given.get(f"scale.{load}", 1.0)
        return own * given[f"scale.{load}"] if f"scale.{load}" in given else own

    def _initial_of(self, node: str, offsets: Mapping[str, Number], given: Mapping[str, Number]) -> Number:
        """Return the initial temperature of a node; NaN stands for one that is still to be solved for. [K]"""
        if f"initial.{node}" in given:
            return given[f"initial.{node}"]
        value = self._initial.get(node, self._start)
        if value == STEADY:
            return float("nan")
        if isinstance(value, str):
            return offsets[value] + self._signal_start(value)
        return value

    def _signal_start(self, boundary: str) -> float:
        signal = self.signals[f"boundary {boundary}"]
        return 0.0 if isinstance(signal, Constant) else float(signal.at(np.zeros(1))[0])

    def nominal(self, name: str, start: bool) -> float:
        """Return the constant part of a boundary's temperature, or the initial temperature of a node, without free names. [K]"""
        if start:
            offsets = {b: self._constant(b) for b in self.network.boundaries}
            return value_of(self._initial_of(name, offsets, {}))
        return self._constant(name)

    def _constant(self, boundary: str) -> float:
        signal = self.signals[f"boundary {boundary}"]
        return signal.value if isinstance(signal, Constant) else 0.0

    def stilled(self) -> Wiring:
        """Return the wiring with every input at its mean over the period of all, or over the run where they do not repeat.

        Raises
        ------
        ScenarioError   When they do not repeat and the run has no duration.
        """
        span = self.cycle or self.scenario.seconds
        if self.changing and not span:
            raise ScenarioError("a mean over what? The inputs do not repeat; give a duration.", self.scenario.title)
        self.structure()
        out = copy(self)
        out.signals = {}
        for name, given in self.signals.items():
            # a table of one row keeps its place among the coefficients
            still = Table(np.zeros(1), np.array([given.mean_over(0.0, span)]))
            out.signals[name] = given if isinstance(given, Constant) else still
        return out

    def structure(self) -> dict[str, Any]:
        """Return the index arrays of the network, fixed for all values."""
        if not self._structure:
            self.assemble(np.zeros(0))
        return self._structure

    def boundary(self, name: str, times: Array, offsets: Mapping[str, Number]) -> Array:
        """Return the temperature (times,) of a boundary. [K]"""
        signal = self.signals[f"boundary {name}"]
        varying = np.zeros(times.shape) if isinstance(signal, Constant) else signal.at(times)
        return varying + value_of(offsets[name])


def _shown(name: str) -> str:
    """Return what an input is called in a sentence."""
    kind, _, rest = name.partition(" ")
    return rest if kind in ("boundary", "load", "curve", "sine", "watts") else f"the gas of {rest}" if rest else name


def _level(store: Store, kelvin: Number) -> Number:
    """Return the level of a store at an initial temperature, derivatives and members carried along. [K]"""
    many = getattr(kelvin, "values", None)
    if many is not None:
        return type(kelvin)(store.level(many))  # type: ignore[call-arg,arg-type]  # members of an ensemble
    plain = value_of(kelvin)
    return float(store.level(plain)) + (float(store.share(plain)) * (kelvin - plain) if isinstance(kelvin, Dual) else 0.0)


def _csr(values: Sequence[Number], free: int) -> Csr:
    """Return the derivatives of coefficients as CSR arrays."""
    indptr, indices, data = [0], [], []  # type: tuple[list[int], list[int], list[float]]
    for number in values:
        if isinstance(number, Dual):
            (where,) = np.nonzero(number.gradient)
            indices += where.tolist()
            data += number.gradient[where].tolist()
        indptr.append(len(indices))
    return np.array(indptr, dtype=np.int32), np.array(indices, dtype=np.int32), np.array(data)


def _numbered(rows: Sequence[Row]) -> Iterator[tuple[Row, int]]:
    """Yield each row with its position among the rows of its name."""
    seen: dict[str, int] = {}
    for row in rows:
        position = seen.get(row.name, 0)
        seen[row.name] = position + 1
        yield row, position
