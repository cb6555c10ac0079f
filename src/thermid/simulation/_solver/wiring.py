"""A network and a scenario wired to the kernel: flat arrays once, numbers with derivatives at every set of values."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from thermid.base.errors import ScenarioError, errors_at, nearest, refuse_first, refuse_unknown
from thermid.base.units import TEMPERATURE, Array, Dual, Memo, Number, gradient_of, require, value_of, values_of
from thermid.model.tree import (
    COMPLEMENT,
    Constant,
    Drawn,
    HeatStore,
    Mixed,
    Signal,
    Sine,
    TableSignal,
    common_cycle,
    in_run,
    literal,
    multiplied,
    signal,
    together,
)
from thermid.simulation._network.controls import ControlRow
from thermid.simulation._network.network import Network, Numbers, Reduced, Varied, eliminable, reduce_network, with_controllers, with_stores
from thermid.simulation._network.rows import CONTROLS, ConductorRow, LoadRow, conductance, heat
from thermid.simulation._network.streams import signal_of
from thermid.simulation._scenarios.scenario import PERIODIC, STEADY, Scenario, Start, above_zero

Csr = tuple[NDArray[np.int32], NDArray[np.int32], Array]
Row = TypeVar("Row", ConductorRow, LoadRow, ControlRow)

MARK = "scheduled"
"""Stands in a row's signal while massless nodes are chosen for elimination: its conductance changes in time."""


def normalised(network: Network, scenario: Scenario) -> Scenario:
    """Return the scenario with canonical names, and a temperature for every boundary.

    Raises
    ------
    NameNotFoundError   When it names a node or load that does not exist.
    ScenarioError       When a boundary has no temperature.
    """
    flat, where = network.flat, scenario.title
    paths = dict.fromkeys(load.path for load in flat.loads)

    def load(name: str) -> str:
        """Return the path of a load; refuse what is none."""
        path = flat.names.model.canonical(name)
        if path not in paths:
            refuse_unknown([path], paths, where, f"no load '{name}'.", ScenarioError)
        return path

    def gain(name: str, need: str) -> str:
        """Return the path of a parameter of the needed unit; refuse another."""
        path = flat.names.model.canonical(name)
        refuse_unknown([path], flat.parameters.table, where, f"no parameter '{name}'.", ScenarioError)
        with errors_at(f"{where}, gains, '{name}' (a number where 'loads' gives a power, a power where 'commands' gives a duty)"):
            require(flat.parameters.dimension(path), need, flat.parameters.table[path].parameter.unit)
        return path

    boundaries = {network.find(k, where): v for table in (scenario.boundaries, scenario.prescribed) for k, v in table.items()}
    for name in boundaries:
        if name not in network.boundaries:
            raise ScenarioError(
                f"'{name}' is a node with a heat balance, not a boundary. To prescribe its temperature put it under 'prescribed'.",
                where,
                code="value.wrong-kind",
            )
    for name in network.boundaries:
        if name not in boundaries:
            raise ScenarioError(
                f"boundary '{name}' of {network.title} has no temperature. Give it one in the scenario's boundaries.",
                where,
                code="run.input-missing",
            )
    loads = {load(k): v for k, v in scenario.loads.items()}
    commands = {load(k): v for k, v in scenario.commands.items()}
    both = sorted(set(loads) & set(commands))
    if both:
        raise ScenarioError(f"load '{both[0]}' has both a power and a command. Give one of them.", where, code="value.excludes-another")
    gains = {load(k): gain(v, "1" if load(k) in loads else "W") for k, v in scenario.gains.items()}  # a share of a power, or a power
    initial = {network.find(k, where): v for k, v in scenario.initial.items()}
    scenario.check_spans()
    return replace(scenario, boundaries=boundaries, loads=loads, commands=commands, gains=gains, initial=initial, prescribed={})


@dataclass(frozen=True)
class Curvature:
    """Input of the curvature of a load's law over its command s: s (s - 1), zero when the load is off and at full power."""

    def __call__(self, command: Array) -> Array:
        """Return s (s - 1) of a command (times,). [-]"""
        return command * (command - 1.0)


def load_inputs(network: Network, scenario: Scenario, numbers: Numbers) -> dict[str, Signal]:
    """Return input name -> signal for every load row; a load without signal is on at full power.

    A power given by the scenario stands in place of the deck's own.
    """
    rows, out = {row.signal for row in numbers.loads}, dict[str, Signal]()
    for load in network.flat.loads:
        command: Signal = scenario.commands.get(load.path, Constant(1.0))
        if load.flux is not None:
            command = multiplied(command, load.flux(scenario.boundaries))
        if "periodic.period" in load.fields:
            command = multiplied(command, _square(load.fields, numbers.values))
        if load.cycle is not None:
            command = multiplied(command, load.cycle)
        watts = scenario.loads.get(load.path)
        if watts is not None:
            if load.curve is not None:
                raise ScenarioError(
                    f"the power of '{load.path}' is a table of temperature, so the scenario cannot replace it by a power. Give a "
                    "command instead.",
                    scenario.title,
                    code="model.element-not-supported",
                )
            command = watts
        out[f"load {load.path}"] = command
        if f"curve {load.path}" in rows:
            out[f"curve {load.path}"] = Constant(0.0) if watts is not None else Mixed(Curvature(), (command,))
        if "sine.amplitude" in load.fields:
            period = value_of(numbers.values[load.fields["sine.period"]])
            wave: Signal = Constant(0.0) if watts is not None else Sine(0.0, 1.0, period)
            square = _square(load.fields, numbers.values) if "periodic.period" in load.fields else Constant(1.0)
            out[f"sine {load.path}"] = multiplied(wave, square, load.cycle or Constant(1.0))
    return out


def _square(fields: Mapping[str, str], values: Mapping[str, Any]) -> Signal:
    """Return the on-off signal of a periodic load, 1 for the first `duty` of every period and 0 for the rest. [-]"""
    return pulses(*(value_of(values[fields[f"periodic.{k}"]]) for k in ("period", "duty")))


class Jump(NamedTuple):
    """A jump of a held input: table of the scenario, path and row; a unit of what is free moves it by `later` seconds."""

    table: str
    path: str
    row: int
    later: float


ZERO_SHARE_OF_SCHEDULE = 1e-13
"""Share of its largest value below which a scheduled value is zero. [-]"""
COURSE_TOLERANCES = (1e-9, 1e-12)
"""How far a coefficient over its reference may lie from its course, relative and absolute. [-]"""


CHECKED_SAMPLES = 64
"""Distinct samples, evenly over the sorted ones, at which every set of values is checked: any two show a sum, and branches are few. [-]"""


class Schedule:
    """Parameters that follow signals over time, sampled at common times; equal samples are evaluated once.

    Parameters
    ----------
    signals : dict      Parameter path -> signal. [SI]
    times : array       Times at which any of them must be sampled. [s]
    hold : bool         Whether all of them hold between samples.
    rows : array (distinct, signals)    Distinct combinations of values. [SI]
    index : array (times,)              Which of them holds at each time.
    """

    def __init__(self, signals: Mapping[str, Signal], duration: float) -> None:
        self.signals = dict(signals)
        drawn = [in_run(s, duration) for s in signals.values()]
        self.times, self.hold = together(drawn, duration)
        columns = np.column_stack([s.at(self.times) for s in drawn])
        if not self.hold:  # a flow that turns has a knot where it is zero
            # times (times,) with the instants at which straight lines between samples (times, signals) pass zero
            before, after = columns[:-1], columns[1:]
            rows, which = np.nonzero(before * after < 0.0)
            share = before[rows, which] / (before[rows, which] - after[rows, which])
            self.times = np.union1d(self.times, self.times[rows] + share * (self.times[rows + 1] - self.times[rows]))
            columns = np.column_stack([s.at(self.times) for s in drawn])
            columns[np.abs(columns) < ZERO_SHARE_OF_SCHEDULE * np.abs(columns).max(axis=0, initial=0.0)] = 0.0
        self.rows, self.index = np.unique(columns, axis=0, return_inverse=True)
        self.index = self.index.ravel()

    def overrides(self, k: int) -> dict[str, float]:
        """Return path -> value of the k-th distinct combination. [SI]"""
        return dict(zip(self.signals, self.rows[k].tolist(), strict=True))


def read_schedule(network: Network, scenario: Scenario) -> Schedule | None:
    """Return the schedule of a scenario with every signal in SI, or None.

    Raises
    ------
    NameNotFoundError   When it names no parameter.
    UnitError           When a signal has another dimension than its parameter.
    """
    if not scenario.schedule:
        return None
    parameters = network.flat.parameters
    signals = {}
    for raw, value in scenario.schedule.items():
        where = f"{scenario.title}, schedule.{raw}"
        path = parameters.freeable(raw, network.flat.names.model.canonical)
        literal = parameters.table[path].parameter.expression.literal
        slot = TEMPERATURE if literal and literal.unit.absolute else literal.unit.text if literal else "1"
        signals[path] = signal(value, slot, where)
    return Schedule(signals, scenario.seconds)


@dataclass(frozen=True, eq=False)
class ScheduledCoefficient:
    """How one coefficient changes with a schedule: as a ratio to its value at a sample of reference.

    Parameters
    ----------
    sample : int                Of reference, at which it does not vanish.
    ratio : array (samples,)    Its value at each distinct sample over that at the reference. [-]
    """

    sample: int
    ratio: Array


@dataclass(frozen=True, eq=False)
class ScheduledCoefficients:
    """Which coefficients of a network follow a schedule.

    A coefficient that changes is its value at a sample of reference times a signal. That holds where the scheduled parameters act as
    factors, and it is checked at every set of values and `CHECKED_SAMPLES` samples.

    Parameters
    ----------
    network : Network
    schedule : Schedule
    reference : int     The sample at whose values everything else is taken.
    places : tuple      Of each row that the schedule reaches: its place among conductors, loads and controls.
    names : tuple       Of each such row: its name, and its position among the rows of that name.
    table : dict        (row among these, coefficient) -> ScheduledCoefficient.
    """

    network: Network
    schedule: Schedule
    reference: int
    places: tuple[int, ...]
    names: tuple[tuple[str, int], ...]
    table: Mapping[tuple[int, int], ScheduledCoefficient]

    @classmethod
    def of_schedule(cls, network: Network, schedule: Schedule) -> ScheduledCoefficients:
        """Return the scheduled coefficients of a network at the model's own values.

        Raises
        ------
        ScenarioError   When a capacitance would change.
        """
        base_parts, names = network.parts(), tuple(schedule.signals)
        kept = network.memo.value(("scheduled", names), Memo)  # a log on a clock that moves has the same samples

        def at(k: int) -> Varied:
            """Return the network at the k-th combination."""
            return kept.value(schedule.rows[k].tobytes(), lambda: network.varied(base_parts, schedule.overrides(k), names), 2 * count)

        count = len(schedule.rows)
        sets = [at(k) for k in range(count)]
        places = network.places(base_parts, names)
        for varied in sets:
            _check_masses(varied, sets[0], network.title)
        moved = len(places) - len(network.controls)
        sizes = [sum(np.log1p(abs(value_of(row.coefficients[0]))) for row in varied.rows[:moved]) for varied in sets]
        reference = int(np.argmax(sizes))
        table = {}
        for r, row in enumerate(sets[reference].rows):
            for c in range(len(row.coefficients)):
                values = values_of(varied.rows[r].coefficients[c] for varied in sets)
                sample = reference if values[reference] else int(np.abs(values).argmax())
                if (values != values[sample]).any():
                    table[r, c] = ScheduledCoefficient(sample, values / values[sample])
        whole = network.numbers_of(base_parts)
        rows: list[Any] = [*whole.conductors, *whole.loads, *whole.controls]
        every = [(row.name, position) for row, position in _numbered(rows)]
        return cls(network, schedule, reference, places, tuple(every[k] for k in places), table)

    @property
    def signals(self) -> dict[tuple[str, int, int], Drawn]:
        """(row's name, position among the rows of that name, coefficient) -> signal that multiplies it. [-]"""
        times, index, hold = self.schedule.times, self.schedule.index, self.schedule.hold
        ratios = {(*self.names[r], c): course.ratio[index] for (r, c), course in self.table.items()}
        return {key: TableSignal(times, r, hold) if times.size > 1 else Constant(float(r[0])) for key, r in ratios.items()}

    def numbers(self, free: Mapping[str, Number]) -> Numbers:
        """Return the numbers at the samples of reference, with some parameters replaced; `free` is path -> number. [SI]

        Raises
        ------
        ScenarioError   When a capacitance would change, or a freed parameter and a scheduled one do not act as a product.
        """
        network, schedule, names = self.network, self.schedule, tuple(self.schedule.signals)
        clash = sorted(set(names) & set(free))
        if clash:
            raise ScenarioError(
                f"'{clash[0]}' follows a schedule, so it cannot be fitted. Free a factor that multiplies it.",
                network.title,
                code="model.element-not-supported",
            )
        base_parts = network.parts({**free, **schedule.overrides(self.reference)})

        def at(k: int) -> Varied:
            """Return the network with the schedule's values at its k-th step."""
            return network.varied(base_parts, {**free, **schedule.overrides(k)}, names)

        first = {k: at(k) for k in {self.reference, *(course.sample for course in self.table.values())}}
        base = first[self.reference]
        mine = [list(row.coefficients) for row in base.rows]
        for (r, c), course in self.table.items():
            mine[r][c] = first[course.sample].rows[r].coefficients[c]
        for k in np.unique(np.linspace(0, len(schedule.rows) - 1, CHECKED_SAMPLES, dtype=int)).tolist() if free else ():
            sample = first[k] if k in first else at(k)
            _check_masses(sample, base, network.title)
            self._check(k, sample, mine, free)
        return self._with_coefficients(base, mine)

    def _check(self, k: int, varied: Varied, mine: list[list[Number]], free: Mapping[str, Number]) -> None:
        """Refuse values at which a coefficient of sample k, or its derivatives, is not its reference in `mine` times its ratio."""
        for r, row in enumerate(varied.rows):
            for c, number in enumerate(row.coefficients):
                course, value, base = self.table.get((r, c)), value_of(number), value_of(mine[r][c])
                ratio = 1.0 if course is None else float(course.ratio[k])
                slack = 0.0 if course is None else COURSE_TOLERANCES[1] + COURSE_TOLERANCES[0] * abs(ratio)
                if not np.abs(value - ratio * base) <= slack * np.abs(base):
                    raise ScenarioError(
                        f"in '{row.name}' a parameter that differs between runs and a scheduled one do not act as a product, so the "
                        "runs need different schedules. Run them one by one, with with_values.",
                        self.network.title,
                        code="model.element-not-supported",
                    )
                other = np.zeros(0, dtype=bool) if course is None else _other_slopes(number, ratio, mine[r][c])
                if other.any():
                    path = next(p for p, n in free.items() if gradient_of(n, other.size)[other].any())
                    raise ScenarioError(
                        f"in '{row.name}' the effect of '{path}' is no product of a number and of what a schedule gives, so it cannot be "
                        "computed along a run. Write what follows the schedule as an element of its own: a sum of two conductances as two "
                        "conductors side by side.",
                        self.network.title,
                        code="model.element-not-supported",
                    )

    def _with_coefficients(self, base: Varied, mine: list[list[Number]]) -> Numbers:
        """Return the numbers of a sample in which the rows that the schedule reaches have the coefficients in `mine`."""
        whole = self.network.numbers_of(base.parts)
        rows: list[Any] = [*whole.conductors, *whole.loads, *whole.controls]
        count, rest = len(whole.conductors), len(whole.conductors) + len(whole.loads)
        for r in dict.fromkeys(r for r, _ in self.table):
            place, coefficients = self.places[r], tuple(mine[r])
            row = rows[place]
            rows[place] = (
                replace(row, law=replace(row.law, coefficients=coefficients)) if place < count else replace(row, coefficients=coefficients)
            )
        return replace(whole, conductors=tuple(rows[:count]), loads=tuple(rows[count:rest]), controls=tuple(rows[rest:]))


def _check_masses(varied: Varied, first: Varied, title: str) -> None:
    """Refuse a schedule that changes a capacitance between two samples."""
    for node, capacitance in varied.capacitances.items():
        before = first.capacitances[node]
        if capacitance is not None and before is not None and value_of(capacitance) != value_of(before):
            raise ScenarioError(
                f"the capacitance of '{node}' depends on a schedule; only conductors and loads may. Give it a constant.",
                title,
                code="model.element-not-supported",
            )


def _other_slopes(number: Number, ratio: float, base: Number) -> NDArray[np.bool_]:
    """Return where (parameters,) derivatives of a number are not `ratio` [-] times those of its reference, to 1e-9; none without any."""
    if not isinstance(number, Dual) or not isinstance(base, Dual):
        return np.zeros(0, dtype=bool)
    least = 1e-12 * float(np.abs(base.gradient).max(initial=0.0))
    return ~np.isclose(number.gradient, ratio * base.gradient, rtol=1e-9, atol=least)


class PlacedConductor(NamedTuple):
    """A conductor of the kernel: its row, and the places of its ends among nodes and boundaries and of its coefficients.

    The numbers in the row are those of the values that it was laid out at.
    """

    row: ConductorRow
    a: int
    b: int
    places: list[int]


class PlacedLoad(NamedTuple):
    """A load of the kernel: its row, the places of its node and of its law's coefficients, its control or -1, and what the law follows."""

    row: LoadRow
    node: int
    places: list[int]
    control: int
    follows: int


class PlacedControl(NamedTuple):
    """A control of the kernel: kind, the place of its sensor, those of its coefficients, and the load that it controls."""

    kind: str
    sensor: int
    places: list[int]
    name: str


class PlacedFactors(NamedTuple):
    """A control of the deck in the kernel: its row, and the places of its coefficients."""

    row: ControlRow
    places: list[int]


class DrivenInput(NamedTuple):
    """An input that follows temperatures: the place of a signal that it multiplies, or -1, and names of controls."""

    base: int
    controls: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class KernelLayout:
    """Places of all coefficients in the kernel's arrays, and the inputs that multiply them; the same for all values.

    Parameters
    ----------
    nodes : tuple of str        Of the reduced network.
    capacity : tuple of int     Place of each node's capacitance; -1 for a massless node.
    gain, offset : tuple        Of each boundary: place of what its input is multiplied by, -1 where it is constant; place of the constant.
    conductors, loads, controls : tuples
    coefficient_input : tuple   Of each coefficient the input that multiplies it; -1 for none. Behind the signals stand what follows.
    factors : tuple             Controls of the deck.
    driven : tuple              Inputs that follow temperatures.
    hidden : int                How many of the loads, the last, are rates of controllers' states.
    edges : tuple               Of each jump that a free name moves: input, time in its table, by how much a unit moves it [s], place.
    """

    nodes: tuple[str, ...]
    capacity: tuple[int, ...]
    gain: tuple[int, ...]
    offset: tuple[int, ...]
    conductors: tuple[PlacedConductor, ...]
    loads: tuple[PlacedLoad, ...]
    controls: tuple[PlacedControl, ...]
    coefficient_input: tuple[int, ...]
    factors: tuple[PlacedFactors, ...] = ()
    driven: tuple[DrivenInput, ...] = ()
    hidden: int = 0
    edges: tuple[tuple[int, float, float, int], ...] = ()


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
    """Collects coefficients in the kernel's order, and for each the input that multiplies it, while a layout is made."""

    inputs: Mapping[str, int]
    values: list[Number] = field(default_factory=list)
    coefficient_input: list[int] = field(default_factory=list)
    driven: dict[DrivenInput, int] = field(default_factory=dict)

    def add(self, number: Number, signal: str = "", controls: tuple[str, ...] = ()) -> int:
        """Add a coefficient that a signal and controls multiply, and return its place."""
        self.values.append(number)
        place = self.inputs[signal] if signal else -1
        if controls:
            place = self.driven.setdefault(DrivenInput(place, controls), len(self.inputs) + len(self.driven))
        self.coefficient_input.append(place)
        return len(self.values) - 1


class Wiring:
    """A network and a scenario wired together: which input multiplies which coefficient, and the numbers at values of free names.

    Parameters
    ----------
    network : Network
    scenario : Scenario
    free : tuple of str     Parameter paths, boundaries (a constant added to their signal), ``initial.<node>``, ``scale.<load>`` (a
                            factor on its power), names in `jumps`; what acts on readings alone, ``reading.<channel>``, changes
                            nothing here.
    keep : set of str       Massless nodes that are solved for, where others would be eliminated.
    jumps : dict            Free name -> the jumps of inputs that it moves.

    Raises
    ------
    ThermidError   When names do not fit, or a boundary has no temperature.
    """

    def __init__(
        self,
        network: Network,
        scenario: Scenario,
        free: Sequence[str] = (),
        keep: frozenset[str] = frozenset(),
        jumps: Mapping[str, Sequence[Jump]] | None = None,
    ) -> None:
        self.network = network = network.with_powers_alone(scenario.metered)
        self.scenario = normalised(network, scenario)
        self.free = tuple(free)
        self.parameters = tuple(n for n in self.free if n in network.flat.parameters.table)
        self.jumps = {n: moved for n, moved in (jumps or {}).items() if n in self.free}
        self._scales = {load.path: f"scale.{load.scale or load.path}" for load in network.flat.loads}
        self._check_free()
        self.schedule = read_schedule(network, self.scenario)
        base = network.numbers()
        signals: dict[str, Signal] = {f"boundary {b}": s for b, s in self.scenario.boundaries.items()}
        needed = {name for row in base.conductors for name in (row.signal, row.second)}
        gases = {name: signal for name, signal in network.media.signals().items() if name in needed}
        self.streams = {c.path: network.streams.course(c.path, self.scenario.boundaries) for c in network.streams.conductors}
        gases |= {signal_of(path): course for path, course in self.streams.items() if not isinstance(course, Constant)}
        signals |= load_inputs(network, self.scenario, base) | gases
        follow = self.schedule.signals if self.schedule is not None else {}
        cycles = {n: c for n, s in (*signals.items(), *follow.items()) if (c := s.cycle) != 0.0}
        self.changing = tuple(dict.fromkeys(_shown(n) for n in cycles))
        self.cycle = common_cycle([*cycles.values()])
        self.signals: dict[str, Drawn] = {name: in_run(signal, self.scenario.seconds) for name, signal in signals.items()}
        self._follow: dict[tuple[str, int, int], str] = {}
        self.courses = ScheduledCoefficients.of_schedule(network, self.schedule) if self.schedule is not None else None
        for key, course in self.courses.signals.items() if self.courses is not None else ():
            name = f"schedule {' '.join(map(str, key))}"
            self.signals[name] = course
            self._follow[key] = name
        numbers = self.flowing(self._numbers({}), {})
        for row, position in _numbered(numbers.conductors) if self._follow else ():
            for c in range(len(row.coefficients)):
                self._conductor_signal(row, position, c)  # products of a gas and a schedule
        # the kernel needs a node to solve for, even where all of them only follow
        self.gone = eliminable(self._marked(numbers), keep)[: len(network.nodes) - 1]
        self.used: dict[str, int] = {}
        self._structure: KernelLayout | None = None
        self._last: tuple[tuple[bytes, bool], Assembled] | None = None
        self._start: Number | str = ""
        self._initial: dict[str, Number | str] = {}
        self._read_start()

    def _check_free(self) -> None:
        """Refuse a name that is none of those that may be free."""
        network, scales = self.network, {*self._scales.values()}
        names = dict.fromkeys((*network.flat.parameters.table, *network.boundaries, *(f"initial.{n}" for n in network.nodes)))
        acting = [n for n in self.free if not n.startswith("reading.") and n not in scales and n not in self.jumps]
        refuse_unknown(acting, names, network.title, "no parameter '{}' can be free.", ScenarioError)

    def _numbers(self, free: Mapping[str, Number]) -> Numbers:
        """Return the network's numbers with some parameters replaced, by the schedule where there is one."""
        return self.network.numbers(free) if self.courses is None else self.courses.numbers(free)

    def flowing(self, numbers: Numbers, values: Mapping[str, Number]) -> Numbers:
        """Return the numbers with the masses of gas streams at the temperatures of their sources; the network has them at 20 degC."""
        offsets = {b: self._offset(b, values) for b in self.network.boundaries if b in values}
        return replace(numbers, conductors=tuple(self._flowing(r, offsets) if r.name in self.streams else r for r in numbers.conductors))

    def _flowing(self, row: ConductorRow, offsets: Mapping[str, Number]) -> ConductorRow:
        """Return the row of a gas stream with its mass in this scenario, by free `offsets` of boundaries [K] too."""
        streams, course = self.network.streams, self.streams[row.name]
        still = streams.still(row.name)
        within = still.value if isinstance(still, Constant) else 1.0
        now = course.value if isinstance(course, Constant) else 1.0
        factor = streams.shifted(row.name, self.scenario.boundaries, offsets) * (now / within if within else 0.0)
        signal = "" if isinstance(course, Constant) else signal_of(row.name)
        return replace(row, law=row.law.scaled(factor), signal=signal)

    def _marked(self, numbers: Numbers) -> Numbers:
        """Return the numbers with a signal `MARK` on scheduled conductors, so that elimination leaves their nodes alone."""
        scheduled_rows = {name for name, _, _ in self._follow}  # what a control multiplies is known by itself
        rows = tuple(replace(r, signal=r.signal or MARK) if r.name in scheduled_rows else r for r in numbers.conductors)
        return replace(numbers, conductors=rows)

    def _read_start(self) -> None:
        """Set the start of the nodes from the scenario: a temperature, a boundary's, or one that is to be solved for."""
        start = self.scenario.start
        self.start = Start.from_text(start, f"{self.scenario.title}, start")
        if self.start is not None:
            check_start(self.start, self.cycle, self.changing, self.scenario)
        if start == "":
            if len(self.network.boundaries) != 1:
                raise ScenarioError(
                    "the start is missing. Give a temperature, the name of a boundary, or 'steady'.",
                    self.scenario.title,
                    code="run.input-missing",
                )
            start = self.network.boundaries[0]
        self._start = self._temperature(start, "start") if self.start is None else STEADY
        self._initial = {n: self._temperature(v, f"initial.{n}") for n, v in self.scenario.initial.items()}
        if self.start is not None and self._initial and {n.path for n in self.network.flat.nodes if n.fields} <= {*self._initial}:
            raise ScenarioError(
                f"start = '{start}' has no effect, because [initial] gives every node a temperature. Leave one of them out.",
                f"{self.scenario.title}, start",
                code="value.excludes-another",
            )

    def _temperature(self, value: Any, key: str) -> Number | str:
        """Return an initial temperature: a number, or the canonical name of a boundary."""
        where = f"{self.scenario.title}, {key}"
        if isinstance(value, str):
            path = self.network.flat.names.model.canonical(value)
            if path in self.network.boundaries:
                return path
            if path.replace(".", "").replace("_", "").isalnum() and not path[0].isdigit():
                names = [*self.network.boundaries, STEADY, PERIODIC]
                raise ScenarioError(
                    f"'{value}' is neither a temperature nor a boundary.{nearest(value, names)}", where, code="name.unknown"
                )
        return above_zero(literal(value, TEMPERATURE, where), where) if isinstance(value, str) else float(value)

    def assemble(self, x: Array | None = None, gradients: bool = True) -> Assembled:
        """Return the numbers at values x (free,) of the free names [SI], or at the model's own; with derivatives where `gradients`.

        The latest result is kept.
        """
        values = np.zeros(0) if x is None else np.asarray(x, dtype=float)
        key = (values.tobytes(), gradients)
        if self._last is None or self._last[0] != key:
            free: dict[str, Number] = dict(zip(self.free, values.tolist(), strict=True)) if values.size else {}
            if gradients:
                free = {name: Dual(v, row) for name, v, row in zip(free, values.tolist(), np.eye(values.size), strict=True)}
            self._last = (key, self.assembled_at(free, values.size if gradients else 0))
        return self._last[1]

    def assembled_at(self, values: Mapping[str, Number], free: int = 0) -> Assembled:
        """Return the numbers at values of some free names [SI]; `free` is the length of their gradients, zero for none."""
        numbers = self.flowing(self._numbers({p: values[p] for p in self.parameters if p in values}), values)
        reduced = with_stores(reduce_network(self.network, self._marked(numbers), self.gone), self.network.stores)
        reduced = with_controllers(reduced, numbers.controls)
        offsets = {b: self._offset(b, values) for b in self.network.boundaries}
        if self._structure is None:
            self._structure = self._lay_out(numbers, reduced, offsets, values)
        coefficients = self._coefficients(numbers, reduced, offsets, values)
        initial = [
            _level(reduced.stored[n][1], self._initial_of(reduced.stored[n][0], offsets, values))
            if n in reduced.stored
            else self._initial_state(reduced.controllers[n], offsets, values)
            if n in reduced.controllers
            else self._initial_of(n, offsets, values)
            for n in reduced.nodes
        ]
        gradient = np.array([gradient_of(v, free) for v in initial]).reshape(len(initial), free)
        jacobian = _csr(coefficients) if free else None
        return Assembled(values_of(coefficients), jacobian, values_of(initial), gradient, reduced, numbers, offsets)

    def every(self, a: Assembled, values: Mapping[str, Number]) -> list[Number]:
        """Return all coefficients of an assembly in the kernel's order, as numbers of the kind that `values` are, such as formulas."""
        return self._coefficients(a.numbers, a.reduced, a.offsets, values)

    def _offset(self, boundary: str, values: Mapping[str, Number]) -> Number:
        """Return the constant part of a boundary's temperature, with what is free added to it. [K]"""
        if boundary not in values:
            return self._constant(boundary)
        return values[boundary] if isinstance(self.signals[f"boundary {boundary}"], Constant) else values[boundary] + 0.0

    def _coefficients(
        self, numbers: Numbers, reduced: Reduced, offsets: Mapping[str, Number], values: Mapping[str, Number]
    ) -> list[Number]:
        """Return all coefficients in the kernel's order: capacitances, boundaries, conductors, loads, their controls, controls, rates."""
        out: list[Number] = [c for c in reduced.capacitances.values() if c is not None]
        for b, shift in offsets.items():
            out += (shift,) if isinstance(self.signals[f"boundary {b}"], Constant) else (1.0, shift)
        for row in reduced.conductors:
            if row.ends[0] != row.ends[1]:
                out += row.coefficients
        for load in numbers.loads:
            if load.node not in self.network.boundaries:
                powered = load.signal.startswith("load ")
                out += (self._load_factor(load.name, load.of_law[0], numbers, values), *load.of_law[1:]) if powered else load.of_law
        for load in self._controlled(numbers):
            out += load.settings
        for control in numbers.controls:
            out += control.coefficients
        for control in numbers.controls:
            for rate in control.rates:
                out += rate.of_law
        return [*out, *(values.get(n, 0.0) for n in self.jumps)]

    def _lay_out(self, numbers: Numbers, reduced: Reduced, offsets: Mapping[str, Number], values: Mapping[str, Number]) -> KernelLayout:
        """Return the layout of all coefficients, in the order of `_coefficients`."""
        self.used = {name: k for k, name in enumerate(self.signals)}
        make = _Builder(self.used)
        capacity = tuple(-1 if c is None else make.add(c) for c in (reduced.capacitances[n] for n in reduced.nodes))
        gain, offset = [], []
        for b, shift in offsets.items():
            constant = isinstance(self.signals[f"boundary {b}"], Constant)
            gain.append(-1 if constant else make.add(1.0, f"boundary {b}"))
            offset.append(make.add(shift))
        index = {n: k for k, n in enumerate((*reduced.nodes, *self.network.boundaries))}
        conductors = self._conductors(reduced.conductors, make, index)
        loads = self._loads(numbers, make, index, values)
        controls = tuple(self._control(row, make, index, loads) for row in self._controlled(numbers))
        factors = tuple(
            PlacedFactors(row, [make.add(number, self._follow.get((row.name, 0, c), "")) for c, number in enumerate(row.coefficients)])
            for row in numbers.controls
        )
        rates = []  # of controllers' states, as loads
        for row in (row for control in numbers.controls for row in control.rates):
            places = [make.add(number, "", row.controls if c == 0 else ()) for c, number in enumerate(row.of_law)]
            rates.append(PlacedLoad(row, index[row.node], places, -1, index[row.follows or row.node]))
        edges = tuple(
            (*e, place) for n in self.jumps for place in [make.add(values.get(n, 0.0))] for j in self.jumps[n] for e in self._edges(j)
        )
        inputs = (tuple(make.coefficient_input), factors, tuple(make.driven), len(rates), edges)
        return KernelLayout(reduced.nodes, capacity, tuple(gain), tuple(offset), conductors, (*loads, *rates), controls, *inputs)

    def _edges(self, jump: Jump) -> list[tuple[int, float, float]]:
        """Return the places of the inputs that have a jump, its time in their tables, and how much later a unit makes it. [s]"""
        time = float(getattr(self.scenario, jump.table)[jump.path].times[jump.row])
        scheduled, of_load = jump.table == "schedule", (f"load {jump.path}", f"curve {jump.path}")
        mine = {n: self.signals[n] for n in self.used if ("schedule " in n if scheduled else n in of_load)}
        there = [n for n, t in mine.items() if isinstance(t, TableSignal) and t.jumps_at(time)]
        return [(self.used[n], time, jump.later) for n in there]

    def _conductors(self, rows: Sequence[ConductorRow], make: _Builder, index: Mapping[str, int]) -> tuple[PlacedConductor, ...]:
        """Add the coefficients of all conductors between two different nodes, and return where each stands."""
        out = []
        for row, position in _numbered(rows):
            if row.ends[0] == row.ends[1]:
                continue  # two needs of a part may be bound to one node; no heat flows from a node to itself
            places = [
                make.add(number, self._conductor_signal(row, position, c), row.controls if c == 0 else ())
                for c, number in enumerate(row.coefficients)
            ]
            out.append(PlacedConductor(row, index[row.ends[0]], index[row.ends[1]], places))
        return tuple(out)

    def _conductor_signal(self, row: ConductorRow, position: int, c: int) -> str:
        """Return the name of the input that multiplies coefficient c of a conductor's row; empty for none.

        Where a gas or a command and a schedule multiply it, that of their product, which is added to the signals.
        """
        follow = self._follow.get((row.name, position, c), "")
        name = (row.signal if row.signal != MARK else "") if c == 0 else row.second if c == 1 else ""
        if not (follow and name):
            return follow or name
        both = f"{name} {follow}"
        if both not in self.signals:
            self.signals[both] = multiplied(self.signals[name], self.signals[follow]).drawn(self.scenario.seconds)
        return both

    def conductor_flows(
        self,
        numbers: Numbers,
        temperatures: Mapping[str, Array],
        times: Array,
        shares: Mapping[str, Array] | None = None,
        over_difference: bool = False,
    ) -> dict[str, Array]:
        """Return conductor -> heat flow (times,) for temperatures by node [W], or that over the difference of its ends [W/K].

        Rows of one conductor are summed. `shares`: control as an element names it -> its share (times,), as `shares` gives it.
        """
        out: dict[str, Array] = {}
        for row, position in _numbered(numbers.conductors):
            a, b = (temperatures[end] for end in row.ends)
            coefficients = []
            for c, number in enumerate(row.coefficients):
                signal = self._conductor_signal(row, position, c)
                coefficients.append(value_of(number) * (self.signals[signal].at(times) if signal else np.ones(times.shape)))
            for control in row.controls:
                coefficients[0] = coefficients[0] * (shares or {})[control]
            rate = (conductance if over_difference else heat)(row.form, coefficients, row.curve, a, b)
            out[row.name] = out.get(row.name, 0.0) + (-rate if row.turned and not over_difference else rate)
        return out

    def shares(
        self, numbers: Numbers, at: Callable[[str], Array], times: Array, modes: Callable[[str], Array] | None = None
    ) -> dict[str, Array]:
        """Return control as elements name it -> its share (times,). [-]

        Parameters
        ----------
        at : callable       Node, boundary or state of a controller -> temperature (times,). [K]
        modes : callable    Control -> its mode (times,); where nothing is known that in which it begins.
        """
        out = {}
        for row in numbers.controls:
            mode = np.full(times.shape, row.starts) if modes is None or not row.modes else modes(row.name)

            def signal(place: int, name: str = row.name) -> Any:
                """Return what a setting of the control is multiplied by, at the times."""
                return self.control_signal(name, place, times)

            for name, form in ((row.name, row.share), (f"{COMPLEMENT}{row.name}", row.rest)):
                out[name] = row.read(form, at, mode, signal)
        return out

    def control_signal(self, name: str, place: int, times: Array) -> Any:
        """Return the factor (times,) that a schedule puts on the coefficient of a control at a place; 1 where it has no schedule. [-]"""
        follower = self._follow.get((name, 0, place), "")
        return self.signals[follower].at(times) if follower else 1.0

    def _controlled(self, numbers: Numbers) -> list[LoadRow]:
        """Return the first row of each load that has a control."""
        rows: dict[str, LoadRow] = {}
        for row in numbers.loads:
            if row.control and row.node not in self.network.boundaries:
                rows.setdefault(row.name, row)
        return list(rows.values())

    def _control(self, row: LoadRow, make: _Builder, index: Mapping[str, int], loads: Sequence[PlacedLoad]) -> PlacedControl:
        """Add the settings of a load's control, and return where it stands; full power is the load's own first coefficient."""
        places = [make.add(x, self._follow.get((row.name, 0, c), "")) for c, x in enumerate(row.settings, start=len(row.of_law))]
        if len(places) < CONTROLS[row.control].coefficients:
            places.append(next(load.places[0] for load in loads if load.row.name == row.name))
        return PlacedControl(row.control, index[row.sensor], places, row.name)

    def _loads(self, numbers: Numbers, make: _Builder, index: Mapping[str, int], values: Mapping[str, Number]) -> tuple[PlacedLoad, ...]:
        """Add the coefficients of all loads into free nodes, and return where each stands; `index` is node -> its position."""
        out, controls = [], [row.name for row in self._controlled(numbers)]
        for row, position in _numbered(numbers.loads):
            if row.node in self.network.boundaries:
                continue  # heat into a given temperature changes nothing
            places = [
                make.add(number, signal, row.controls if c == 0 else ())
                for c, (number, signal) in enumerate(self._load_coefficients(row, position, numbers, values))
            ]
            control = controls.index(row.name) if row.control else -1
            out.append(PlacedLoad(row, index[row.node], places, control, index[row.node]))
        return tuple(out)

    def _load_coefficients(self, row: LoadRow, position: int, numbers: Numbers, values: Mapping[str, Number]) -> list[tuple[Number, str]]:
        """Return the coefficients of a load's law, each with the name of the input that multiplies it, empty for none."""
        out = []
        for c, coefficient in enumerate(row.of_law):
            follow = self._follow.get((row.name, position, c), "")
            signal, number = row.signal if c == 0 else "", coefficient
            if follow and signal and self.signals[signal] != Constant(1.0):
                raise ScenarioError(
                    f"load '{row.name}' follows both a command and a schedule. Combine them into one.",
                    self.scenario.title,
                    code="value.excludes-another",
                )
            if c == 0 and signal.startswith("load "):
                number = self._load_factor(row.name, coefficient, numbers, values)
            out.append((number, follow or signal))
        return out

    def power(self, load: str, numbers: Numbers, values: Mapping[str, Number] | None = None) -> Signal:
        """Return the power of a load along the run, by its path: as the scenario or the deck gives it, with its gain. [W]

        `values` of free names [SI] have its factor, where that is free.
        """
        watts = next(row.coefficients[0] for row in numbers.loads if row.name == load)
        signal, factor = self.signals[f"load {load}"], float(value_of(self._load_factor(load, watts, numbers, values or {})))
        return signal if factor == 1.0 else signal.scaled(factor)  # a log in watts is not copied

    def _load_factor(self, load: str, watts: Number, numbers: Numbers, values: Mapping[str, Number]) -> Number:
        """Return the factor on a load's input: the deck's power, a gain in its place, or 1 where the input is in watts; times its scale."""
        scale = self._scales[load]
        if load in self.scenario.gains:
            gain: Number = numbers.values[self.scenario.gains[load]]
            return gain * values[scale] if scale in values else gain
        if load in self.scenario.loads:
            return values.get(scale, 1.0)
        return watts * values[scale] if scale in values else watts

    def _initial_of(self, node: str, offsets: Mapping[str, Number], values: Mapping[str, Number]) -> Number:
        """Return the initial temperature of a node; NaN stands for one that is still to be solved for. [K]"""
        if f"initial.{node}" in values:
            return values[f"initial.{node}"]
        value = self._initial.get(node, self._start)
        if value == STEADY:
            return float("nan")
        if isinstance(value, str):
            return offsets[value] + self._signal_start(value)
        return value

    def _initial_state(self, begins: Number | str, offsets: Mapping[str, Number], values: Mapping[str, Number]) -> Number:
        """Return where the state of a controller begins; NaN where the start is still to be solved for. [K]"""
        if self._start == STEADY:
            return float("nan")
        if isinstance(begins, str):
            return offsets[begins] + self._signal_start(begins) if begins in offsets else self._initial_of(begins, offsets, values)
        return begins

    def _signal_start(self, boundary: str) -> float:
        """Return the value of a boundary's signal at time zero, without its constant part. [K]"""
        signal = self.signals[f"boundary {boundary}"]
        return 0.0 if isinstance(signal, Constant) else float(signal.at(np.zeros(1))[0])

    def nominal(self, name: str, start: bool) -> float:
        """Return the constant part of a boundary's temperature, or with `start` the initial temperature of a node, nothing free. [K]"""
        if start:
            return value_of(self._initial_of(name, {b: self._constant(b) for b in self.network.boundaries}, {}))
        return self._constant(name)

    def _constant(self, boundary: str) -> float:
        """Return the temperature of a constant boundary, and zero for one that changes. [K]"""
        signal = self.signals[f"boundary {boundary}"]
        return signal.value if isinstance(signal, Constant) else 0.0

    def stilled(self) -> Wiring:
        """Return the wiring with every input at its mean over the period of all, or over the run where they do not repeat.

        Raises
        ------
        ScenarioError   When they do not repeat and the run has no duration.
        """
        span = mean_span(self.changing, self.cycle, self.scenario)
        assert self.structure  # laid out before it is shared
        out = copy(self)
        out.signals = {name: mean_of(drawn, span) for name, drawn in self.signals.items()}
        return out

    @property
    def structure(self) -> KernelLayout:
        """Which coefficient stands where, the same for all values."""
        if self._structure is None:
            self.assemble(np.zeros(0))
        assert self._structure is not None
        return self._structure

    def boundary(self, name: str, times: Array, offsets: Mapping[str, Number]) -> Array:
        """Return the temperature (times,) of a boundary. [K]"""
        signal = self.signals[f"boundary {name}"]
        varying = np.zeros(times.shape) if isinstance(signal, Constant) else signal.at(times)
        return varying + value_of(offsets[name])


def mean_of(drawn: Drawn, span: float) -> Drawn:
    """Return an input held at its mean over a span from zero [s]; a table of one row keeps its place among the coefficients."""
    return drawn if isinstance(drawn, Constant) else TableSignal(np.zeros(1), np.array([drawn.mean_over(0.0, span)]))


def mean_span(changing: Sequence[str], cycle: float | None, scenario: Scenario) -> float:
    """Return the time over which the means of inputs are taken: their common period, or the run where they do not repeat. [s]

    Raises
    ------
    ScenarioError   When they do not repeat and the run has no duration.
    """
    span = cycle or scenario.seconds
    if changing and not span:
        raise ScenarioError(
            "the mean needs a period, but the inputs do not repeat. Give a duration.", scenario.title, code="run.no-periodic-state"
        )
    return span


def held_inputs(changing: Sequence[str], time: float) -> str:
    """Return the remark on a steady state under the inputs of one time [s], with the names of those that change; empty without any."""
    if not changing:
        return ""
    return (
        f"steady with the inputs of {time:g} s, although {', '.join(changing)} change{'s' if len(changing) == 1 else ''} in time. For "
        "another state give their mean ('mean'), another time, or the periodic state ('periodic')"
    )


def held_means(changing: Sequence[str], cycle: float | None, scenario: Scenario) -> tuple[str, str]:
    """Return the span of mean inputs in words, and a remark on them that is empty where no input changes."""
    span = f"a period of {cycle:g} s" if cycle else f"{scenario.seconds:g} s"
    remark = (
        f"the means over {span} of {', '.join(changing)} are the inputs; for nonlinear laws the result is not the mean of the temperatures"
    )
    return span, remark if changing else ""


def check_start(start: Start, cycle: float | None, changing: Sequence[str], scenario: Scenario) -> None:
    """Refuse a start that asks for more of the inputs than the run has.

    Parameters
    ----------
    start : Start
    cycle : float           After which all inputs repeat; None where they do not, zero where none changes. [s]
    changing : sequence     Inputs that change.
    scenario : Scenario     The run.

    Raises
    ------
    ScenarioError
    """
    seconds, period, open_ = scenario.seconds, cycle or 0.0, start.kind == PERIODIC and cycle is None
    refuse_first(
        f"{scenario.title}, start",
        (
            start.time > seconds > 0.0,
            f"it takes the inputs at {start.time:g} s, after the end of the run at {seconds:g} s.",
            "value.outside-range",
        ),
        (
            start.kind != STEADY and period > seconds * (1.0 + 1e-9),
            f"the inputs have a period of {period:g} s, and the run lasts {seconds:g} s. Extend the run to at least one period.",
            "value.outside-range",
        ),
        (
            open_,
            f"a periodic start needs periodic inputs, but {', '.join(changing)} do not repeat. Give a table after = 'repeat'; the longest "
            "period may be at most 1000 times the shortest.",
            "run.no-periodic-state",
        ),
        error=ScenarioError,
    )


def level_instants(signals: Mapping[str, Signal], length: float, title: str, most: int) -> list[float]:
    """Return one instant for each combination of levels that signals take from zero to `length` [s], in order of time. [s]

    The instants are middles of the stretches between knots of the signals; of equal combinations the first.

    Raises
    ------
    ScenarioError   When one does not stay on levels, or there are more than `most`.
    """
    moving = [name for name, s in signals.items() if not s.held]
    if moving:
        raise ScenarioError(
            f"'{moving[0]}' has no plateaus. Request its mean, a time or the periodic state.", title, code="value.without-effect"
        )
    knots = np.unique(np.concatenate([[0.0, length], *(s.knots(0.0, length) for s in signals.values())]))
    knots = knots[(knots >= 0.0) & (knots <= length)]
    middles = 0.5 * (knots[1:] + knots[:-1])[np.diff(knots) > 1e-5 * length / max(knots.size, 1)] if length else np.zeros(1)
    _, first = np.unique(np.column_stack([s.at(middles) for s in signals.values()]), axis=0, return_index=True)
    if first.size > most:
        raise ScenarioError(
            f"the inputs take {first.size} combinations of values; the limit is {most}. Request the mean or single times.",
            title,
            code="cap.exceeded",
        )
    return [float(middles[k]) for k in np.sort(first)]


def _shown(name: str) -> str:
    """Return the name of an input for a sentence: ``boundary room`` is room, ``pressure room`` the gas of room."""
    kind, _, rest = name.partition(" ")
    return rest if kind in ("boundary", "load", "curve", "sine") else f"the gas of {rest}" if rest else name


def _level(store: HeatStore, kelvin: Number) -> Number:
    """Return the level of a store at an initial temperature, derivatives and members carried along. [K]"""
    many = getattr(kelvin, "values", None)
    if many is not None:
        return type(kelvin)(store.begins(many)[0])  # type: ignore[call-arg,arg-type]  # members of an ensemble
    plain = value_of(kelvin)
    level, share = map(float, store.begins(plain))
    return level + (share * (kelvin - plain) if isinstance(kelvin, Dual) else 0.0)


def _csr(values: Sequence[Number]) -> Csr:
    """Return the derivatives of coefficients (coefficients, parameters) [SI] as CSR arrays: row starts, columns, values."""
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
    counts: dict[str, int] = {}
    for row in rows:
        position = counts.get(row.name, 0)
        counts[row.name] = position + 1
        yield row, position


def pulses(period: float, duty: float) -> Signal:
    """Return a signal that is 1 for the first `duty` (0 .. 1) of every `period` [s] and 0 for the rest."""
    if duty in (0.0, 1.0):
        return Constant(duty)
    return TableSignal(np.array([0.0, duty * period, period]), np.array([1.0, 0.0, 1.0]), hold=True, after="repeat")
