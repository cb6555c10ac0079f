"""The kernel called with names: arrays in, an answer or an error in words out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from thermid import _kernel
from thermid.dual import value_of
from thermid.errors import ScenarioError, SolverError
from thermid.network.rows import CONTROLS
from thermid.simulation.solver.beyond import NEAR, refused_tables, refuses
from thermid.simulation.solver.extremes import Turnings, by_column
from thermid.simulation.solver.kernel_form import break_times, ending, ints, kernel_input, row_form
from thermid.simulation.solver.modal import Modal
from thermid.simulation.solver.squares import LOSSES, Squares, Weighing
from thermid.simulation.solver.traces import Traces
from thermid.simulation.solver.wiring import Assembled, Wiring

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Options:
    """Tolerances and limits of the integrator.

    Parameters
    ----------
    tolerance : float           Local error that a step may make. [K]
    relative : float            The same, relative to the range of temperatures seen. [-]
    input_tolerance : float     Error that what is left of a sampled input within a step may cause. [K]
    max_step : float            [s]
    max_steps : int             Steps after which the run is given up.
    method : str                ``modal`` (exact, for linear networks), ``integrator``, ``large``, or ``auto``: whichever costs less.
    large_tolerance : float     Local error that a step of the methods of large networks may make; they are of second order. None: 3e-3, and
                                3e-5 where a table is read. [K]
    extremes : bool             Whether runs follow every node between the stored samples, so that its highest and lowest temperatures and
                                their instants are those of the course; else they are those of the samples.
    """

    tolerance: float = 2e-7
    relative: float = 2e-8
    input_tolerance: float = 1e-4
    max_step: float = float("inf")
    max_steps: int = 1_000_000
    method: str = "auto"
    large_tolerance: float | None = None
    extremes: bool = field(default=True, repr=False)  # no part of the key of a fit, which it does not change


@dataclass(frozen=True, eq=False)
class Answer:
    """What the kernel answered.

    Parameters
    ----------
    temperatures : array (times, nodes)             Of the nodes asked for. [K]
    sensitivities : array (times, nodes, free)      Empty when not asked for.
    initial, final : array (nodes,)                 Of all nodes of the reduced network. [K]
    load_energy, boundary_energy, flow_energy       Per load row, boundary and one-way row. [J]
    end : float                                     [s]
    statistics : dict
    on : array (controls,)                          Which thermostats are on at the end.
    switched : tuple of (float, int, int)           Time [s], control and new state of every switching, in order.
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
    switched: tuple[tuple[float, int, int], ...] = ()
    turnings: Mapping[str, Turnings] | None = None

    def states(self, times: Array) -> NDArray[np.int32]:
        """Return which thermostats are on (times, controls), from the instants at which they switched."""
        out = np.tile(self.on, (times.size, 1)).astype(np.int32)
        for time, row, state in reversed(self.switched):
            out[times < time, row] = 1 - state
        return out


UNSOLVED: Final = (_kernel.NEWTON_FAILED, _kernel.NON_FINITE, _kernel.STEP_UNDERFLOW, _kernel.RUN_AWAY)
"""How a run ends that reaches where a table has no values."""
MAY_HAVE_LEFT: Final = ' A table that is refused outside its points may have been left; add points to it, or choose outside = "hold".'


class Engine:
    """The kernel's problem for one wiring; the same for all values of its unknowns."""

    def __init__(self, wiring: Wiring) -> None:
        self.wiring = wiring
        s = wiring.structure()
        self.conductor_names = tuple(r[5] for r in s["conductors"])
        self.load_names = tuple(r[4] for r in s["loads"])
        self.control_names = tuple(r[3] for r in s["controls"])
        self.flow_rows = np.array([k for k, r in enumerate(s["conductors"]) if r[0] == "flow"], dtype=int)
        self.problem = self._laid_out(refuse=True)
        self.refuses = refuses(wiring.network, wiring.assemble(np.zeros(0)).numbers)
        self.held = self._laid_out(refuse=False) if self.refuses else self.problem
        self.nodes: tuple[str, ...] = s["nodes"]
        self.modal = Modal(wiring, self.problem)

    def _laid_out(self, refuse: bool) -> Any:
        """Return the kernel's problem; without `refuse` tables are held where a run would be refused, for searches that pass there."""
        s = self.wiring.structure()
        tables: list[tuple[Array, Array, Array]] = []
        conductors = [row_form(form, places, curve, tables, refuse=refuse) for form, _, _, places, curve, _ in s["conductors"]]
        loads = [row_form(form, places, curve, tables, load=True, refuse=refuse) for form, _, places, curve, _, _ in s["loads"]]
        return _kernel.Problem(
            capacity=ints(s["capacity"]),
            coef_input=ints(s["coefficient_input"]),
            boundary_gain=ints(s["gain"]),
            boundary_offset=ints(s["offset"]),
            conductor_kind=ints([r[0] for r in conductors]),
            conductor_a=ints([r[1] for r in s["conductors"]]),
            conductor_b=ints([r[2] for r in s["conductors"]]),
            conductor_coef=ints([r[1] for r in conductors]).reshape(-1, 4),
            conductor_table=ints([r[2] for r in conductors]),
            load_kind=ints([r[0] for r in loads]),
            load_node=ints([r[1] for r in s["loads"]]),
            load_coef=ints([r[1] for r in loads]).reshape(-1, 4),
            load_sensor=ints([r[1] for r in s["loads"]]),
            load_table=ints([r[2] for r in loads]),
            load_control=ints([r[5] for r in s["loads"]]),
            control_kind=ints([CONTROLS[r[0]].kind for r in s["controls"]]),
            control_sensor=ints([r[1] for r in s["controls"]]),
            control_coef=ints([(*r[2], -1)[:3] for r in s["controls"]]).reshape(-1, 3),
            tables=tables,
            inputs=[kernel_input(self.wiring.signals[name]) for name in self.wiring.used],
        )

    def __reduce__(self) -> tuple[type[Engine], tuple[Wiring]]:
        """Return how to make it in another process: the kernel's problem is laid out anew."""
        return Engine, (self.wiring,)

    def integrate(
        self,
        a: Assembled,
        times: Array,
        nodes: Sequence[str],
        end: float,
        options: Options,
        gradients: bool = False,
        extremes: bool = False,
    ) -> Answer:
        """Return temperatures at times of some nodes, from zero to `end` [s]; with `extremes` their turning points between these too.

        Raises
        ------
        SolverError     When the run ends before its time.
        ScenarioError   When the modal solution is asked for and there is none.
        """
        from thermid.simulation.solver.large_model import integrate_model, takes_over

        if takes_over(self, options, gradients):
            return integrate_model(self, a, times, nodes, end, options, extremes)
        index = self._index()
        why = self.modal.refusal(options.method, times, end, gradients)
        if not why:
            return self._by_modes(a, times, nodes, end, options, extremes)
        size = a.initial_gradient.shape[1]
        more: dict[str, Any] = {}
        if gradients and a.jacobian is not None:
            more = {"dcoef": (*a.jacobian, size), "dT0": np.ascontiguousarray(a.initial_gradient)}
        gone, sums = self._sums(a) if extremes else ((), None)
        found = self.problem.integrate(
            a.coefficients,
            a.initial,
            0.0,
            float(end),
            np.ascontiguousarray(times, dtype=float),
            ints([index[n] for n in nodes]),
            rtol=options.relative,
            atol=options.tolerance,
            input_atol=options.input_tolerance,
            max_step=options.max_step,
            max_steps=options.max_steps,
            breaks=break_times([self.wiring.signals[name] for name in self.wiring.used], end),
            turnings=extremes,
            sums=sums,
            **more,
        )
        if found.status != _kernel.OK:
            raise SolverError(self.message(found, options, end, a), f"{self.wiring.network.title}, {self.wiring.scenario.title}")
        statistics = {
            "method": "integrator",
            "reason": why,
            "steps": found.steps,
            "rejected": found.rejected,
            "switchings": [(float(t), self.control_names[k]) for t, k in zip(found.event_times, found.event_controls, strict=True)],
        }
        flows = found.conductor_energy[self.flow_rows] if self.flow_rows.size else np.zeros(0)
        slopes = found.sensitivities if found.sensitivities is not None else np.zeros((times.size, len(nodes), 0))
        switched = tuple(zip(found.event_times.tolist(), found.event_controls.tolist(), found.event_states.tolist(), strict=True))
        energies = (found.load_energy, found.boundary_energy, flows)
        turnings = dict(zip((*nodes, *gone), by_column(found.turnings, len(nodes) + len(gone)), strict=True)) if extremes else None
        return Answer(found.traces, slopes, a.initial, found.final_temperatures, *energies, end, statistics, found.on, switched, turnings)

    def _by_modes(self, a: Assembled, times: Array, nodes: Sequence[str], end: float, options: Options, extremes: bool) -> Answer:
        index = self._index()
        gone, sums = self._sums(a) if extremes else ((), None)
        found = self.modal.run(a, times, ints([index[n] for n in nodes]), end, extremes, sums)
        if found.status != _kernel.OK:
            raise SolverError(self.message(found, options, end, a), f"{self.wiring.network.title}, {self.wiring.scenario.title}")
        slopes = np.zeros((times.size, len(nodes), 0))
        statistics = {"method": "modal", "reason": "", "steps": found.steps, "rejected": 0, "switchings": []}
        energies = (found.load_energy, found.boundary_energy, np.zeros(0))
        off = np.zeros(len(self.control_names), dtype=np.int32)
        turnings = dict(zip((*nodes, *gone), by_column(found.turnings, len(nodes) + len(gone)), strict=True)) if extremes else None
        return Answer(found.traces, slopes, a.initial, found.final, *energies, end, statistics, off, (), turnings)

    def _sums(self, a: Assembled) -> tuple[tuple[str, ...], tuple[NDArray[np.int32], NDArray[np.int32], Array] | None]:
        """Return the eliminated nodes, and each as a sum of temperatures of nodes and boundaries, in the kernel's form."""
        known = self._index()
        parts: dict[str, dict[int, float]] = {}
        for node, star in a.reduced.recover:
            own: dict[int, float] = {}
            for neighbour, weight in star.items():
                for place, share in (parts[neighbour] if neighbour in parts else {known[neighbour]: 1.0}).items():
                    own[place] = own.get(place, 0.0) + value_of(weight) * share
            parts[node] = own
        if not parts:
            return (), None
        begin = ints(np.cumsum([0, *(len(p) for p in parts.values())]))
        places = ints([k for p in parts.values() for k in p])
        return tuple(parts), (begin, places, np.array([w for p in parts.values() for w in p.values()], dtype=float))

    def members(
        self, coefficients: Array, initial: Array, times: Array, nodes: Sequence[str], end: float, options: Options, simd: str
    ) -> Any:
        """Return the kernel's ensemble: coefficients (coefficients, members) [SI] and initial temperatures (nodes, members) [K] of each.

        Raises
        ------
        ScenarioError   When the machine lacks the instruction set `simd`.
        """
        known = ("auto", *_kernel.instruction_sets())
        if simd not in known:
            raise ScenarioError(f"this machine has no instruction set '{simd}'. Give one of {', '.join(known)}.", "simd")
        return _kernel.Ensemble(
            self.problem,
            np.ascontiguousarray(coefficients),
            np.ascontiguousarray(initial),
            0.0,
            float(end),
            np.ascontiguousarray(times, dtype=float),
            ints([self.nodes.index(n) for n in nodes]),
            rtol=options.relative,
            atol=options.tolerance,
            input_atol=options.input_tolerance,
            max_step=options.max_step,
            max_steps=options.max_steps,
            breaks=break_times([self.wiring.signals[name] for name in self.wiring.used], end),
            turnings=options.extremes,
            simd=simd,
        )

    def _index(self) -> dict[str, int]:
        return {n: k for k, n in enumerate((*self.nodes, *self.wiring.network.boundaries))}

    def readings(
        self,
        times: Array,
        parts: Sequence[Sequence[str]],
        index: Sequence[NDArray[np.int64]],
        values: Sequence[Array],
        scaled: Sequence[bool] = (),
    ) -> Any:
        """Return what channels read, in the kernel's form: `values` [K] at ``times[index]``, of a node or a sum over its `parts`.

        The node of a channel that is `scaled` counts by the weight that every evaluation gives.
        """
        place = self._index()
        nodes = [place[n] for several in parts for n in several]
        flat = np.concatenate([*index, np.zeros(0, dtype=np.int64)])
        ends = ints(np.cumsum([0, *(len(several) for several in parts)])), ints(np.cumsum([0, *(i.size for i in index)]))
        return _kernel.Readings(
            self.problem,
            np.ascontiguousarray(times),
            ints(nodes),
            ends[0],
            ints(flat),
            ends[1],
            np.concatenate(values),
            ints(np.array(scaled, dtype=np.int64)) if any(scaled) else None,
        )

    def least_squares(
        self,
        a: Assembled,
        readings: Any,
        parts: tuple[Array, Array],
        weighing: Weighing,
        end: float,
        options: Options,
        gradients: bool = False,
        mesh: Array | None = None,
    ) -> Squares:
        """Return the least squares of readings, with derivatives or without; no temperature is stored.

        Parameters
        ----------
        a : Assembled           The run's numbers.
        readings                As `readings` made them.
        parts : two arrays      What each node of a channel counts, and the derivatives of that (parts, free).
        weighing : Weighing     What the readings are compared by.
        end : float             The run starts at zero. [s]
        options : Options       Tolerances.
        gradients : bool
        mesh : array            Ends of steps to take, those of an earlier run: sums of squares then differ by what the values differ, and
                                not by how the steps fell. [s]

        Raises
        ------
        SolverError   When the run ends before its time.
        """
        more: dict[str, Any] = {}
        if gradients and a.jacobian is not None:
            more = {"dcoef": (*a.jacobian, a.initial_gradient.shape[1]), "dT0": np.ascontiguousarray(a.initial_gradient)}
        w = weighing
        found = _kernel.least_squares(
            self.problem,
            readings,
            a.coefficients,
            a.initial,
            0.0,
            float(end),
            sigma=w.sigma,
            bias=w.bias,
            bias_column=w.column,
            weight=parts[0],
            slope=parts[1],
            loss=LOSSES[w.loss],
            knee=w.knee,
            rtol=options.relative,
            atol=options.tolerance,
            input_atol=options.input_tolerance,
            max_step=options.max_step,
            max_steps=options.max_steps,
            breaks=break_times([self.wiring.signals[name] for name in self.wiring.used], end),
            mesh=mesh,
            **more,
        )
        if found.status != _kernel.OK:
            raise SolverError(self.message(found, options, end, a), f"{self.wiring.network.title}, {self.wiring.scenario.title}")
        return Squares(found.triangle, found.rotated, found.cost, found.chi_square, found.sums, found.mesh)

    def message(self, found: Any, options: Options, end: float, a: Assembled | None = None) -> str:
        """Return what ran out, when, where and what to change."""
        network = self.wiring.network
        follows = any(load.follows_temperature for load in network.flat.loads)
        if self.refuses and found.status in UNSOLVED:
            final = getattr(found, "final_temperatures", None)
            left = self.left(a, found.time, final, NEAR) if a is not None and final is not None else ""
            if left:
                return f"at {found.time:.6g} s of {end:.6g} s {left}"
            return ending(found, (*self.nodes, *network.boundaries), options.max_steps, end, follows) + MAY_HAVE_LEFT
        return ending(found, (*self.nodes, *network.boundaries), options.max_steps, end, follows)

    def left(self, a: Assembled, time: float, temperatures: Array, near: float = 0.0) -> str:
        """Return which tables that are refused outside their points are left at temperatures (nodes,) [K]; empty where none is."""
        network = self.wiring.network
        if not self.refuses:
            return ""
        traces = Traces(self.wiring, a, np.array([time]), self.nodes, temperatures[None, :], np.zeros((1, temperatures.size, 0)))
        every = {n: float(traces.temperature(n)[0]) for n in (*network.nodes, *network.boundaries)}
        return refused_tables(network, a.numbers, every, near)

    def rhs(self, a: Assembled, temperatures: Array, time: float, gradients: bool = False) -> tuple[Array, Array, Array | None]:
        """Return net heat (nodes,) [W], its Jacobian (nodes, nodes) [W/K] and its derivatives (nodes, free) at temperatures [K]."""
        extra = (*a.jacobian, a.initial_gradient.shape[1]) if gradients and a.jacobian is not None else None
        heat, jacobian, slopes = self.held.rhs(a.coefficients, np.ascontiguousarray(temperatures), float(time), extra)
        return heat, jacobian, slopes

    def started(self, a: Assembled, gradients: bool = False) -> Assembled:
        """Return the assembly with a start that is steady where it was asked for."""
        unknown = np.isnan(a.initial)
        if not unknown.any():
            return a
        if not unknown.all():
            raise ScenarioError("a steady start holds for all nodes; leave 'initial' out.", self.wiring.scenario.title)
        from thermid.simulation.solver.settling import beginning

        found, slopes = beginning(self, a, gradients)
        return replace(a, initial=found, initial_gradient=slopes if gradients else a.initial_gradient)

    @cached_property
    def still(self) -> Engine:
        """The same problem with every input at its mean; it takes the same numbers."""
        return Engine(self.wiring.stilled())

    def capacities(self, a: Assembled) -> Array:
        """Return the capacitance (nodes,) of every node, zero for a massless one. [J/K]"""
        return np.array([0.0 if c is None else value_of(c) for c in (a.reduced.capacitances[n] for n in self.nodes)])

    def time_constants(self, a: Assembled, temperatures: Array, time: float) -> Array:
        """Return the time constants of the network linearised at temperatures (nodes,), longest first. [s]"""
        _, jacobian, _ = self.rhs(a, temperatures, time)
        capacity = self.capacities(a)
        massive, massless = capacity > 0, capacity <= 0
        heat = jacobian[np.ix_(massive, massive)]
        if massless.any():
            heat = heat - jacobian[np.ix_(massive, massless)] @ np.linalg.solve(
                jacobian[np.ix_(massless, massless)], jacobian[np.ix_(massless, massive)]
            )
        root = np.sqrt(capacity[massive])
        rates = np.linalg.eigvals(heat / root[:, None] / root[None, :]).real
        slow = np.abs(rates) < 1e-13 * max(float(np.abs(rates).max(initial=0.0)), 1e-300)
        return np.sort(np.where(slow, np.inf, -1.0 / np.where(slow, -1.0, rates)))[::-1]

    def powers(self, a: Assembled, temperatures: Array, times: Array, on: NDArray[np.int32] | None = None) -> dict[str, Array]:
        """Return load -> power (times,), thermostats on or off as given (times, controls); rows of one load are summed. [W]"""
        table = self.held.load_powers(a.coefficients, temperatures, np.ascontiguousarray(times, dtype=float), on)
        out: dict[str, Array] = {}
        for k, name in enumerate(self.load_names):
            out[name] = out.get(name, 0.0) + table[:, k]
        return out
