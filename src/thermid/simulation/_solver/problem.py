"""The kernel's problem of one wiring: what it takes in place of names, its right-hand side, temperatures by name, words for its end."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from numbers import Integral, Real
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from thermid import _kernel
from thermid.base.errors import ScenarioError, SolverError, ThermidError, refuse_unknown
from thermid.base.units import Array, Memo, gradient_of, value_of
from thermid.model.tree import Constant, Curve, Drawn, Signal, Sine, TableSignal, Tree, literal, named_control
from thermid.simulation._network.controls import FREE, FactorForm, GuardForm
from thermid.simulation._network.network import Network, Numbers, held_in
from thermid.simulation._network.rows import CONTROLS, LOADS, KernelLaw, curve_arrays, tables_behind
from thermid.simulation._solver.extremes import Turnings
from thermid.simulation._solver.wiring import Assembled, PlacedConductor, PlacedFactors, PlacedLoad, Wiring


def nodes_to_store(wanted: Sequence[str], weights: Mapping[str, Iterable[str]], nodes: Collection[str]) -> tuple[str, ...]:
    """Return those of the kernel's `nodes` from which the wanted ones can be computed: themselves, or the neighbours of eliminated ones.

    `weights`: eliminated node -> the nodes and boundaries that its temperature is a weighted mean of.
    """
    queue, out = list(wanted), {}  # type: tuple[list[str], dict[str, None]]
    while queue:
        node = queue.pop(0)
        if node in weights:
            queue += weights[node]
        elif node in nodes:
            out[node] = None
    return tuple(out)


def kept_for(assembled: Assembled, nodes: Sequence[str]) -> tuple[str, ...]:
    """Return the nodes that the kernel must store so that the temperatures of `nodes` can be computed; see `nodes_to_store`."""
    return nodes_to_store(nodes, dict(assembled.reduced.recover), assembled.reduced.nodes)


@dataclass(frozen=True, eq=False)
class Traces:
    """Temperatures and derivatives of all nodes and boundaries by name, computed from those that the kernel stored.

    Parameters
    ----------
    wiring, assembled               The run's.
    times : array (times,)          [s]
    kept : tuple of str             The nodes that the kernel stored.
    stored : array (times, kept)            [K]
    slopes : array (times, kept, free)      Derivatives with respect to the free names; empty without them. [K per unit]
    """

    wiring: Wiring
    assembled: Assembled
    times: Array
    kept: tuple[str, ...]
    stored: Array
    slopes: Array
    memo: Memo = field(init=False, default_factory=Memo, compare=False, repr=False)

    @cached_property
    def _columns(self) -> dict[str, int]:
        """Stored node -> its column."""
        return {name: k for k, name in enumerate(self.kept)}

    def temperature(self, name: str) -> Array:
        """Return the temperature (times,) of a node or boundary; of a heat store the one that belongs to the heat it holds. [K]"""
        if held_in(name) in self._columns:
            return self.memo.value(name, lambda: self._of_heat(name)[0])
        if name in self._columns:
            return self.stored[:, self._columns[name]]
        return self.memo.value(name, lambda: self._recovered(name))

    def _of_heat(self, name: str) -> tuple[Array, Array]:
        """Return the temperature (times,) that belongs to the heat of a store [K], and its slope over the level (times,) [-].

        Of a melt that supercools, on the branch on which the node itself stands.
        """
        state = held_in(name)
        store, level = self.assembled.reduced.stored[state][1], self.stored[:, self._columns[state]]
        kelvin, slope = store.curve.value_and_slope(level)
        if store.melt is None or name not in self._columns:
            return kelvin, slope
        melt, rise = store.melt.curve.value_and_slope(level)
        temperature = self.stored[:, self._columns[name]]
        liquid = np.abs(melt - temperature) < np.abs(kelvin - temperature)
        return np.where(liquid, melt, kelvin), np.where(liquid, rise, slope)

    def _recovered(self, name: str) -> Array:
        """Return the temperature (times,) of a boundary, or of an eliminated node as the weighted mean of its neighbours. [K]"""
        if name in self.wiring.network.boundaries:
            return self.wiring.boundary(name, self.times, self.assembled.offsets)
        weights = dict(self.assembled.reduced.recover)[name]
        return np.asarray(np.sum([value_of(w) * self.temperature(n) for n, w in weights.items()], axis=0))

    def slope(self, name: str) -> Array:
        """Return the derivatives (times, free) of the temperature of a node or boundary. [K per unit]

        Of a massless node, which is a weighted sum T = sum w_n T_n of others, ``sum (w_n dT_n + T_n dw_n)``.
        """
        size = self.slopes.shape[2]
        if (state := held_in(name)) in self._columns:
            return self._of_heat(name)[1][:, None] * self.slopes[:, self._columns[state], :]
        if name in self._columns:
            return self.slopes[:, self._columns[name], :]
        if name in self.wiring.network.boundaries:
            return np.broadcast_to(gradient_of(self.assembled.offsets[name], size), (self.times.size, size))
        weights = dict(self.assembled.reduced.recover)[name]
        parts = [value_of(w) * self.slope(n) + np.outer(self.temperature(n), gradient_of(w, size)) for n, w in weights.items()]
        return np.asarray(np.sum(parts, axis=0))


STEP_SHARE: Final = 0.25
"""Part of the error of a run that a step of fourth order may make (docs/design/simulation.md). [-]"""
SECOND_ORDER: Final = 2.5
"""A step of second order may make ``(SECOND_ORDER error)**1.5``: its error falls with the cube, that of the run with the square."""


@dataclass(frozen=True)
class Options:
    """How close a run is to the solution of its equations, and its limits.

    Parameters
    ----------
    error : float or str        Error that temperatures may have, by every method: ``"1 [mK]"``, or a number. [K]
    max_step : float            [s]
    max_steps : int             Steps after which the run is given up.
    method : str                ``modal`` (exact, for linear networks), ``integrator``, ``large``, or ``auto``: whichever costs less.
    extremes : bool             Whether runs follow every node between the stored samples, so that its highest and lowest temperatures and
                                their instants are those of the course; else they are those of the samples.
    inputs : float              Error by what is left of sampled inputs within a step; None: `error`. [K]
    """

    error: float = 1e-4
    max_step: float = float("inf")
    max_steps: int = 1_000_000
    method: str = "auto"
    extremes: bool = field(default=True, repr=False)  # no part of the key of a fit, which it does not change
    inputs: float | None = field(default=None, repr=False, kw_only=True)

    def __new__(cls, *_: Any, **options: Any) -> Options:
        """Refuse a name that there is not, with those that there are."""
        refuse_unknown(
            options,
            cls.__dataclass_fields__,
            "Options",
            "no option '{}'. How close a run is says 'error' alone, in kelvin; there are {known}.",
            ScenarioError,
        )
        return super().__new__(cls)

    def __post_init__(self) -> None:
        """Refuse what is no number.

        Raises
        ------
        ScenarioError   Which it is.
        """
        if isinstance(self.error, str):
            object.__setattr__(self, "error", literal(self.error, "K", "Options, error"))
        for name in ("error", "max_step", "max_steps", "inputs"):
            value = getattr(self, name)
            if value is not None and (isinstance(value, bool) or not isinstance(value, Real) or not float(value) >= 0.0):
                raise ScenarioError(f"it takes a number, zero or above, not {value!r}.", f"Options, {name}", code="value.outside-range")
        for name, kind in (("method", str), ("extremes", bool)):
            if not isinstance(value := getattr(self, name), kind):
                raise ScenarioError(
                    f"it takes {'a name' if kind is str else 'true or false'}, not {value!r}.", f"Options, {name}", code="value.wrong-kind"
                )
        if not isinstance(self.max_steps, Integral):
            raise ScenarioError(f"it takes a whole number, not {self.max_steps!r}.", "Options, max_steps", code="value.outside-range")

    @property
    def of_step(self) -> float:
        """Error that a step of fourth order may make, a quarter of `error`. [K]"""
        return STEP_SHARE * self.error

    @property
    def of_large_step(self) -> float:
        """Error that a step of second order, of the methods of large networks, may make: (2.5 error)^1.5. [K]"""
        return float((SECOND_ORDER * self.error) ** 1.5)


@dataclass(frozen=True, eq=False)
class Answer:
    """Answer of the kernel for one run.

    Parameters
    ----------
    temperatures : array (times, nodes)             Of the nodes asked for. [K]
    sensitivities : array (times, nodes, free)      Empty when not asked for.
    initial, final : array (nodes,)                 Of all nodes of the reduced network. [K]
    load_energy, boundary_energy, flow_energy       Per load row, boundary and one-way row. [J]
    end : float                                     [s]
    statistics : dict
    on : array (controls,)                          Which thermostats are on at the end, and the modes of controls.
    switched : tuple of (float, int, int, int)      Time [s], control, its new state and the one before of every switching, in order.
    turnings : dict or None                         Node, eliminated ones too -> turning points between the times; None where not followed.
    """

    temperatures: Array
    sensitivities: Array
    initial: Array
    final: Array
    load_energy: Array
    boundary_energy: Array
    flow_energy: Array
    end: float
    statistics: Mapping[str, Any]
    on: NDArray[np.int32]
    switched: tuple[tuple[float, int, int, int], ...] = ()
    turnings: Mapping[str, Turnings] | None = None

    def states(self, times: Array) -> NDArray[np.int32]:
        """Return the state (times, controls) of each control at times [s]: 1 or 0 of a thermostat, or the number of a mode."""
        out = np.tile(self.on, (times.size, 1)).astype(np.int32)
        for time, row, _, before in reversed(self.switched):
            out[times < time, row] = before
        return out


def by_column(points: tuple[Any, Array, Array], count: int) -> tuple[Turnings, ...]:
    """Return the turning points of each of `count` columns, from those of all, in order of columns and times.

    Parameters
    ----------
    points : columns, times [s] and temperatures [K], each (points,)
    """
    columns, times, kelvin = points
    ends = np.searchsorted(columns, np.arange(count + 1))
    return tuple(Turnings(times[i:j], kelvin[i:j]) for i, j in pairwise(ends))


def signal_turnings(drawn: Drawn, end: float, offset: float) -> Turnings:
    """Return the turning points of a boundary from zero to `end` [s]: knots where its signal turns, and those of a sine.

    Parameters
    ----------
    drawn : Drawn       [K]
    end : float         [s]
    offset : float      A constant beside it. [K]
    """
    times = drawn.turning_times(end)
    return Turnings(times, drawn.at(times) + offset)


LARGE_FROM: Final = 500
"""Nodes from which a model is run as a large network, where its elements allow that."""
MAX_INTEGRATED_NODES: Final = 5000
"""Nodes that the integrator of small models takes, `Problem::LARGEST` of the kernel: its elimination is direct. [-]"""
UNSOLVED: Final = (_kernel.NEWTON_FAILED, _kernel.NON_FINITE, _kernel.STEP_UNDERFLOW, _kernel.RUN_AWAY)
"""How a run ends that reaches where a table has no values."""
MAY_HAVE_LEFT: Final = ' A table with outside = "refuse" may have left its range: add points, or set outside = "hold".'


MAX_BREAKS: Final = 5000
"""Jumps of held inputs up to which the integrator ends a step at each of them, also at each point of straight lines a tenth as many."""


def ends_steps(table: TableSignal) -> bool:
    """Return whether the integrator ends a step at each point of a table: not at those of a dense log."""
    return table.times.size <= (MAX_BREAKS if table.hold else MAX_BREAKS // 10)


def break_times(signals: Iterable[Signal], end: float) -> Array:
    """Return the times [s] in (0, end) at which a held input jumps, sorted; none where one, or all together, have over `MAX_BREAKS`."""
    jumps = [s.times[1:][np.diff(s.values) != 0] for s in signals if isinstance(s, TableSignal) and s.hold]
    jumps = [times[(times > 0) & (times < end)] for times in jumps]
    few = max((times.size for times in jumps), default=0) <= MAX_BREAKS  # a dense log is not sorted at every run
    times = np.unique(np.concatenate([np.zeros(0), *jumps])) if few and jumps else np.zeros(0)
    return times if times.size <= MAX_BREAKS else np.zeros(0)


def ints(values: Any) -> NDArray[np.int32]:
    """Return numbers as a contiguous array of int32, as the kernel takes integers."""
    return np.ascontiguousarray(values, dtype=np.int32)


def row_form(law: KernelLaw, placed: PlacedConductor | PlacedLoad, tables: list[Any], refuse: bool) -> tuple[int, list[int], int]:
    """Return the kernel's kind, coefficient places (4, -1 for none) and first table of a row, -1 for none; its tables join `tables`.

    Without `refuse` tables hold their last value where they would otherwise be refused.
    """
    places, curve = [*placed.places, -1, -1, -1, -1][:4], placed.row.curve
    if curve is None:
        return law.kind, places, -1
    table = len(tables)
    tables += [curve_arrays(curve_table, refuse) for curve_table in tables_behind(placed.row.form, curve)]
    return law.kind, places, table


def limits(options: Options, inputs: Iterable[Signal], end: float) -> dict[str, Any]:
    """Return the limits of a run to `end` [s] as every integrator of the kernel takes them."""
    return {
        "input_atol": options.error if options.inputs is None else options.inputs,
        "max_step": options.max_step,
        "max_steps": options.max_steps,
        "breaks": break_times(inputs, end),
    }


def kernel_input(drawn: Drawn) -> tuple[int, Array, Array]:
    """Return the kernel's form of a signal: its kind, then times [s] and values [SI] of a table, or the numbers of the law.

    Those are a constant's value, or a sine's mean, amplitude, period [s] and phase.
    """
    if isinstance(drawn, Constant):
        return _kernel.CONSTANT, np.array([drawn.value]), np.zeros(0)
    if isinstance(drawn, Sine):
        return _kernel.SINE, np.array([drawn.mean, drawn.amplitude, drawn.period, drawn.phase]), np.zeros(0)
    kind = _kernel.SAMPLED_HOLD if drawn.hold else _kernel.SAMPLED_LINEAR
    return kind, np.ascontiguousarray(drawn.times, dtype=float), np.ascontiguousarray(drawn.values, dtype=float)


def unsettled(follows: bool) -> str:
    """Return why Newton's method found no steady state, in words; `follows` says whether a power follows a temperature at all."""
    if follows:
        return (
            "no steady state was found; a power may grow without limit with temperature. Check the temperature coefficients of the loads."
        )
    return (
        "no steady state was found above 0 K. Look for a negative power larger than the heat that can flow in. A body without heat "
        "that radiates to 0 K alone cools without limit."
    )


def ending(status: int, time: float, node: str, max_steps: int, end: float, follows: bool) -> str:
    """Return why a run ended before `end` [s], in words: what ran out, when, where and what to change.

    Parameters
    ----------
    status : int        The kernel's.
    time : float        When it ended. [s]
    node : str          Where; empty for nowhere.
    max_steps : int     Steps that it was allowed.
    follows : bool      Whether a power follows a temperature.
    """
    cause = "a power grows faster with temperature than the heat removed" if follows else "more heat is supplied than removed"
    look = "power that grows too fast with temperature" if follows else "law that jumps there, or for conductances many decades apart"
    when = f"at {time:.6g} s of {end:.6g} s" + (f" at '{node}'" if node else "")
    words = {
        _kernel.MAX_STEPS: f"{max_steps} steps were not enough, {when}. Allow more max_steps, or a larger error.",
        _kernel.STEP_UNDERFLOW: f"the step became too small {when}. Look for a discontinuous law there, or allow a larger error.",
        _kernel.NEWTON_FAILED: f"a step could not be solved {when}. Look for a {look}.",
        _kernel.NON_FINITE: f"a temperature or heat flow is not a number {when}. Look for a parameter that is infinite.",
        _kernel.RUN_AWAY: f"the temperature rises without limit {when}: {cause}. If it falls below 0 K, a negative power is too large.",
        _kernel.SINGULAR_NODE: f"a massless node has no conductance to anything {when}, so its temperature is undefined.",
        _kernel.BAD_INPUT: f"a temperature left the range 0 K to 1e6 K, or a number is not finite, {when}. Check the inputs at that time.",
        _kernel.CHATTER: f"a thermostat switches endlessly {when}. Widen its hysteresis.",
        _kernel.TOO_HOT: f"a massless node would be above 100,000 K {when}: more heat is supplied than its conductors carry. Check its "
        "power and these conductances; a unit may be wrong.",
    }
    return words.get(status, f"the run stopped {when}.")


MARGIN_TO_TABLE_END: Final = 0.1
"""How close to the end of its table a run stands that cannot go on. [K]"""
GOES_ON: Final = {"hold": "stays constant", "linear": "is extended as a straight line", "refuse": "is refused"}
"""What a table does outside its points."""


def _ranged(network: Network, numbers: Numbers) -> list[tuple[str, Curve, tuple[str, str]]]:
    """Return name, table and the two nodes whose mean or difference it is read at, for every table of an author or of a gas."""
    curves = [(r.name, r.curve, r.ends) for r in numbers.conductors]
    curves += [(r.name, r.curve, (r.node, r.node)) for r in numbers.loads]
    curves = [(name, curve, ends) for name, curve, ends in curves if curve is not None and not curve.film]
    curves += [
        (c.path, c.curve.film[1], (e, e)) for c in network.flat.conductors if c.curve is not None and len(c.curve.film) > 1 for e in c.ends
    ]
    curves += [(node, store.given, (node, node)) for node, store in network.stores.items()]
    for name in network.controls:
        control = network.flat.controls[name]
        (first, weight), *more = control.follows or (("", 0.0),)
        if weight == 1.0 and (not more or (len(more) == 1 and more[0][1] == -1.0)):
            curves.append((name, control.control.curve, (first, more[0][0] if more else first)))
    return [(name, curve, ends) for name, curve, ends in curves if curve is not None]


def read_nodes(network: Network, numbers: Numbers) -> set[str]:
    """Return the nodes whose temperatures are arguments of tables."""
    return {end for _, _, ends in _ranged(network, numbers) for end in ends}


def _temperature_read(curve: Curve, a: Array, b: Array) -> Array:
    """Return the argument of a table for temperatures a and b of its nodes: a - b over a difference, else their mean. [K]"""
    return a - b if curve.over == "difference" else 0.5 * (a + b)


def left_tables(network: Network, numbers: Numbers, temperatures: Callable[[str], Array], times: Array) -> tuple[str, ...]:
    """Return a remark for each table read outside its points at times (times,) [s]; `temperatures`: node -> temperature (times,) [K]."""
    out = []
    for name, curve, (a, b) in _ranged(network, numbers):
        argument = _temperature_read(curve, temperatures(a), temperatures(b))
        beyond = (argument < curve.x[0]) | (argument > curve.x[-1])
        if beyond.any():
            first, low, high = times[beyond.argmax()], float(argument.min()), float(argument.max())
            out.append(
                f"'{name}' left the range of its law, {curve.x[0]:.6g} to {curve.x[-1]:.6g} K, at {first:.6g} s: it saw {low:.6g} to"
                f" {high:.6g} K. Beyond its range the law {GOES_ON[curve.outside]}, so the result is an extrapolation there"
            )
    return tuple(out)


def refused_tables(network: Network, numbers: Numbers, temperatures: Mapping[str, float], near: float) -> str:
    """Return in words which tables with outside = "refuse" are read outside their limits, or within `near` [K] of them; else empty.

    `temperatures`: node -> temperature. [K]
    """
    out = []
    for name, curve, (a, b) in _ranged(network, numbers):
        if curve.limits is None:
            continue
        low, high = curve.limits
        argument = float(_temperature_read(curve, np.array(temperatures[a]), np.array(temperatures[b])))
        if not low + near <= argument <= high - near:
            out.append(f"'{name}' leaves the range of its table, {low:.6g} to {high:.6g} K")
    if not out:
        return ""
    return f'{" and ".join(dict.fromkeys(out))}, and outside = "refuse" ends the run. Add points, or set outside = "hold".'


def flow_between_masses(jacobian: Array, massive: NDArray[np.bool_]) -> Array:
    """Return the derivatives (masses, masses) of the heat into nodes with mass by their temperatures. [W/K]

    Nodes without mass follow at once, so that J_mm - J_m0 J_00^-1 J_0m is left.
    """
    flow = jacobian[np.ix_(massive, massive)]
    if massive.all():
        return flow
    inner, back = jacobian[np.ix_(~massive, ~massive)], jacobian[np.ix_(~massive, massive)]
    return np.asarray(flow - jacobian[np.ix_(massive, ~massive)] @ np.linalg.solve(inner, back))


def refuse_unseen(model: Tree, what: str, kind: type[ThermidError] = ScenarioError) -> None:
    """Refuse what needs the equations of a model, where another program such as an FMU runs it; `what` names it in the message.

    Raises
    ------
    ScenarioError   When it is, as an FMU; or the error of another kind.
    """
    if model.runner is not None:
        raise kind(f"{what} needs the equations of the model, which an FMU does not show. Use a deck for it.", model.title)


class KernelProblem:
    """The kernel's problem for one wiring; the same for all values of its unknowns."""

    def __init__(self, wiring: Wiring) -> None:
        self.wiring = wiring
        s = wiring.structure
        self.nodes, self.memo = s.nodes, Memo()
        self.load_names = tuple(p.row.name for p in s.loads[: len(s.loads) - s.hidden])
        self.machines = tuple(p.row.name for p in s.factors if p.row.modes)
        self.control_names = (*(p.name for p in s.controls), *self.machines)
        of_deck = [p.row.name for p in s.factors if p.row.modes == ("off", "on")]
        self.thermostats = (*(p.name for p in s.controls if p.kind == "thermostat"), *of_deck)
        self.flow_rows = np.array([k for k, p in enumerate(s.conductors) if p.row.form == "flow"], dtype=int)
        self.problem: Any = _kernel.Problem(**self.arrays())
        # whether some table ends a run outside its points; for searches that pass there it holds its last value
        self.refuses = any(curve.limits is not None for _, curve, _ in _ranged(wiring.network, wiring.assemble(np.zeros(0)).numbers))
        self.held: Any = _kernel.Problem(**self.arrays(refuse=False)) if self.refuses else self.problem

    def arrays(self, refuse: bool = True) -> dict[str, Any]:
        """Return what the kernel's problem is made of, by name: indices as arrays of int32, tables and inputs as lists."""
        s = self.wiring.structure
        tables: list[tuple[Array, Array, Array]] = []
        conductors = [row_form(p.row.kernel, p, tables, refuse) for p in s.conductors]
        loads = [row_form(LOADS[p.row.form], p, tables, refuse) for p in s.loads]
        follow = self._followed(tables) if s.factors else None
        return {
            "capacity": ints(s.capacity),
            "coef_input": ints(s.coefficient_input),
            "boundary_gain": ints(s.gain),
            "boundary_offset": ints(s.offset),
            "conductor_kind": ints([r[0] for r in conductors]),
            "conductor_a": ints([p.a for p in s.conductors]),
            "conductor_b": ints([p.b for p in s.conductors]),
            "conductor_coef": ints([r[1] for r in conductors]).reshape(-1, 4),
            "conductor_table": ints([r[2] for r in conductors]),
            "load_kind": ints([r[0] for r in loads]),
            "load_node": ints([p.node for p in s.loads]),
            "load_coef": ints([r[1] for r in loads]).reshape(-1, 4),
            "load_sensor": ints([p.follows for p in s.loads]),
            "load_table": ints([r[2] for r in loads]),
            "load_control": ints([p.control for p in s.loads]),
            "control_kind": ints([CONTROLS[p.kind].kind for p in s.controls]),
            "control_sensor": ints([p.sensor for p in s.controls]),
            "control_coef": ints([(*p.places, -1)[:3] for p in s.controls]).reshape(-1, 3),
            "tables": tables,
            "inputs": [kernel_input(signal) for signal in self.inputs],
            "follow": follow,
            "edges": list(s.edges),
        }

    def _followed(self, tables: list[tuple[Array, Array, Array]]) -> dict[str, Any]:
        """Return controls in the kernel's form: states, machines of modes, factors, guards, samplers and the inputs that follow them.

        Tables of controls join `tables`.
        """
        s, index, rows = self.wiring.structure, self._index(), {p.row.name: p for p in self.wiring.structure.factors}
        machines = [p for p in s.factors if p.row.modes]
        of = {p.row.name: k for k, p in enumerate(machines)}
        factors: list[tuple[Any, ...]] = []
        place_of_factor: dict[tuple[str, int], int] = {}

        def probe(nodes: Sequence[tuple[str, int]], constant: int, places: Sequence[int]) -> list[int]:
            """Return the places of a constant and of up to three weighted nodes that a form reads; -1 where there is none."""
            three = [(index[node], places[place]) for node, place in nodes] + [(-1, -1)] * (3 - len(nodes))
            return [places[constant] if constant != FREE else -1, *(node for node, _ in three), *(place for _, place in three)]

        def factor(name: str, form: FactorForm) -> int:
            """Return the place of a factor among those of the kernel, its table added where it has one."""
            if (name, id(form)) not in place_of_factor:
                places, table = rows[name].places, -1
                if form.curve is not None:
                    table = len(tables)
                    tables.append(curve_arrays(form.curve))
                low, high = (places[k] if k != FREE else -1 for k in (form.low, form.high))
                read = probe(form.nodes, form.constant, places)
                factors.append((form.kind, read, low, high, table, of.get(name, -1), [places[v] for v in form.values]))
                place_of_factor[name, id(form)] = len(factors) - 1
            return place_of_factor[name, id(form)]

        def named(control: str) -> int:
            """Return the place of the factor of a named control."""
            row = rows[named_control(control)[0]].row
            return factor(row.name, row.factor_of(control))

        def guard(p: PlacedFactors, g: GuardForm) -> tuple[Any, ...]:
            """Return a guard as numbers for the kernel: states before and after, what it reads, level, sign and delay."""
            level, delay = (p.places[k] if k != FREE else -1 for k in (g.level, g.delay))
            return of[p.row.name], g.before, g.after, probe(g.nodes, FREE, p.places), level, g.sign, delay

        guards = [guard(p, g) for p in machines for g in p.row.guards]
        sampled = [(p.row, state) for p in s.factors for state in p.row.states if state.factor is not None]
        samplers = [(row.sample, index[state.name], factor(row.name, state.factor)) for row, state in sampled if state.factor is not None]
        followers = [(load.base, [named(c) for c in load.controls]) for load in s.driven]
        return {
            "states": sum(len(p.row.states) for p in s.factors),
            "machines": [p.row.starts for p in machines],
            "factors": factors,
            "guards": guards,
            "samplers": samplers,
            "followers": followers,
        }

    def __reduce__(self) -> tuple[type[KernelProblem], tuple[Wiring]]:
        """Return how to make it in another process: the kernel's problem is laid out anew."""
        return type(self), (self.wiring,)

    @property
    def title(self) -> str:
        """Titles of the model and the scenario, for messages."""
        return f"{self.wiring.network.title}, {self.wiring.scenario.title}"

    @property
    def follows(self) -> bool:
        """Whether a power follows a temperature other than by being switched."""
        return any(load.follows_temperature for load in self.wiring.network.flat.loads)

    @property
    def is_large(self) -> bool:
        """Whether it has so many nodes that it is run as a large network; the heat of one that stores it by a table counts with it."""
        return len(self.nodes) - sum(held_in(n) in self.nodes for n in self.wiring.network.stores) >= LARGE_FROM

    @property
    def inputs(self) -> list[Drawn]:
        """The signals that multiply coefficients, in the kernel's order."""
        return [self.wiring.signals[name] for name in self.wiring.used]

    def settings(self, options: Options, end: float) -> dict[str, Any]:
        """Return the error of a step and the limits of a run to `end` [s] as the kernel's small integrator takes them.

        Raises
        ------
        SolverError   When there are too many nodes, or a control samples more often than a run may take steps, which end at samples.
        """
        if len(self.nodes) > MAX_INTEGRATED_NODES:
            raise SolverError(
                f"{len(self.nodes)} nodes are more than the {MAX_INTEGRATED_NODES} that a run takes with thermostats, one-way flows, "
                "controls that follow another node, many members, or derivatives, which a fit needs. Merge nodes, or leave these out.",
                self.title,
                code="run.too-many-nodes",
            )
        for row in (placed.row for placed in self.wiring.structure.factors):
            if row.sample and end / row.sample > options.max_steps:
                raise SolverError(
                    f"the control '{row.name}' samples every {row.sample:g} s, {end / row.sample:.3g} times in this run of {end:g} s; "
                    f"a run takes at most {options.max_steps} steps. Give a longer sample time, or allow more max_steps.",
                    self.wiring.network.title,
                    code="run.did-not-finish",
                )
        return {"rtol": 0.0, "atol": options.of_step, **limits(options, self.inputs, end)}

    def gradients(self, a: Assembled, wanted: bool) -> dict[str, Any]:
        """Return the derivatives of coefficients and start as arguments of the kernel; empty where none are wanted."""
        if not wanted or a.jacobian is None:
            return {}
        return {"dcoef": (*a.jacobian, a.initial_gradient.shape[1]), "dT0": np.ascontiguousarray(a.initial_gradient)}

    def _index(self) -> dict[str, int]:
        """Return node or boundary -> its number in the kernel."""
        return {n: k for k, n in enumerate((*self.nodes, *self.wiring.network.boundaries))}

    def message(self, answer: Any, options: Options, end: float, a: Assembled | None = None) -> str:
        """Return why a run ended before `end` [s], in words: what ran out, when, where and what to change.

        With the numbers `a` of the run, a table that the temperatures have left is named instead.
        """
        names = (*self.nodes, *self.wiring.network.boundaries)
        node = names[answer.node] if 0 <= answer.node < len(names) else ""
        text = ending(answer.status, answer.time, node, options.max_steps, end, self.follows)
        if not (self.refuses and answer.status in UNSOLVED):
            return text
        final = getattr(answer, "final_temperatures", None)
        beyond = self.tables_left(a, answer.time, final, MARGIN_TO_TABLE_END) if a is not None and final is not None else ""
        return f"at {answer.time:.6g} s of {end:.6g} s {beyond}" if beyond else text + MAY_HAVE_LEFT

    def tables_left(self, a: Assembled, time: float, temperatures: Array, near: float = 0.0) -> str:
        """Return `refused_tables` at a time [s] and states (nodes,) [K]; empty where no table refuses."""
        network = self.wiring.network
        if not self.refuses:
            return ""
        traces = Traces(self.wiring, a, np.array([time]), self.nodes, temperatures[None, :], np.zeros((1, temperatures.size, 0)))
        every = {n: float(traces.temperature(n)[0]) for n in (*network.nodes, *network.boundaries)}
        return refused_tables(network, a.numbers, every, near)

    def rhs(
        self, a: Assembled, temperatures: Array, time: float, gradients: bool = False, on: NDArray[np.int32] | None = None
    ) -> tuple[Array, Array, Array | None]:
        """Return net heat (nodes,) [W], its Jacobian (nodes, nodes) [W/K] and its derivatives (nodes, free) at temperatures [K].

        `on`: states of thermostats and modes of controls (controls,); -1, or None, for those that temperatures and the start give.
        """
        refuse_unseen(self.wiring.network.flat.names.model, "a heat balance", SolverError)
        extra = (*a.jacobian, a.initial_gradient.shape[1]) if gradients and a.jacobian is not None else None
        heat, jacobian, slopes = self.held.rhs(a.coefficients, np.ascontiguousarray(temperatures), float(time), extra, on)
        return heat, jacobian, slopes

    @cached_property
    def still(self) -> KernelProblem:
        """The same problem with every input at its mean; it takes the same numbers."""
        return KernelProblem(self.wiring.stilled())

    def capacities(self, a: Assembled) -> Array:
        """Return the capacitance (nodes,) of every node, zero for a massless one; states of controllers have one. [J/K]"""
        return np.array([0.0 if c is None else value_of(c) for c in (a.reduced.capacitances[n] for n in self.nodes)])

    def time_constants(self, a: Assembled, temperatures: Array, time: float) -> Array:
        """Return the time constants (masses,) of the network linearised at temperatures (nodes,), longest first. [s]

        They are -1 / the real parts of the eigenvalues of C^-1/2 K C^-1/2, K [W/K] the Jacobian of the heat into nodes with massless ones
        eliminated; infinite where nothing returns. `time` [s] is that of the inputs.
        """
        _, jacobian, _ = self.rhs(a, temperatures, time)
        capacity = self.capacities(a)
        sampled = [state.name for p in self.wiring.structure.factors for state in p.row.states if state.factor is not None]
        capacity[[self.nodes.index(name) for name in sampled]] = 0.0  # as if they sampled without end
        massive = capacity > 0
        root = np.sqrt(capacity[massive])
        rates = np.linalg.eigvals(flow_between_masses(jacobian, massive) / root[:, None] / root[None, :]).real
        slow = np.abs(rates) < 1e-13 * max(float(np.abs(rates).max(initial=0.0)), 1e-300)
        return np.sort(np.where(slow, np.inf, -1.0 / np.where(slow, -1.0, rates)))[::-1]

    def powers(self, a: Assembled, temperatures: Array, times: Array, on: NDArray[np.int32] | None = None) -> dict[str, Array]:
        """Return load -> power (times,), thermostats on or off as given (times, controls); rows of one load are summed. [W]"""
        table = self.held.load_powers(a.coefficients, temperatures, np.ascontiguousarray(times, dtype=float), on)
        out: dict[str, Array] = {}
        for k, name in enumerate(self.load_names):
            out[name] = out.get(name, 0.0) + table[:, k]
        return out
