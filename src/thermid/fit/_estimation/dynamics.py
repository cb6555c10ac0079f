"""`Dynamics`: a record bound to a model with noise on it, as states, rates and readings with the kernel's exact derivatives.

States are the nodes with heat capacity, then what each process noise adds. Massless nodes follow: their balance is solved, and their rows
taken out of the Jacobian (Schur's complement). A linear network has one Jacobian, so its steps are exact; any other is linearised anew at
the start of every step (local linearisation: Ozaki, Statistica Sinica 2 (1992) 113; J. N. Nielsen and H. Madsen, 2001, for the filter),
and steps are halved until what the rates bend within them moves no temperature by more than `MAX_CURVATURE_ERROR`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from thermid.base.errors import IdentificationError
from thermid.base.units import Array, Memo, value_of
from thermid.fit._estimation.process import ProcessNoise
from thermid.fit._problem.experiment import UNKNOWN_START_SD, UNSAID_NOISE, Experiment
from thermid.fit._problem.residuals import Bench
from thermid.model.tree import Sine, TableSignal
from thermid.simulation.runs import Assembled, Traces

MAX_CURVATURE_ERROR: Final = 1e-4
"""What a step may miss because rates bend within it. [K]"""
JUMP_SHARE_OF_STEP: Final = 1e-9
"""Part of a step before its end at which inputs are taken that jump there."""
MAX_CACHED_COURSES: Final = 8
"""Courses of inputs that are kept."""
BALANCES: Final = 30
"""Newton steps for the balance of massless nodes."""


class RatesAt(NamedTuple):
    """Rates (states,) [K/s, W/s], their Jacobian (states, states) and temperatures (nodes,) with derivatives (nodes, states)."""

    rates: Array
    jacobian: Array
    temperatures: Array
    slopes: Array


@dataclass(frozen=True, eq=False)
class At:
    """Dynamics at one set of values.

    Parameters
    ----------
    assembled : Assembled       The kernel's numbers.
    capacity : array (massive,) Of the nodes that have one. [J/K]
    sizes, times : array (noises,)  Size of every noise and the time after which it forgets. [SI], [s]
    sigma : array (sensors,)    Standard deviation of one sample. [K]
    bias, scale : array (sensors,)  Constant error [K] and error of the scale of every sensor. [-]
    """

    assembled: Assembled
    capacity: Array
    sizes: Array
    times: Array
    sigma: Array
    bias: Array
    scale: Array


class Dynamics:
    """A record bound to a model, with noise.

    Parameters
    ----------
    bench : Bench                       The record's, with the names that are free in it.
    noises : sequence of ProcessNoise   What drives it beside its inputs.
    start_sd : dict                     Node -> standard deviation of its start; others as the log leaves them. [K]
    """

    def __init__(self, bench: Bench, noises: Sequence[ProcessNoise], start_sd: dict[str, float]) -> None:
        """Wire a bench with its process noise, and note what is stored between steps."""
        self.bench, self.noises, self.start_sd = bench, tuple(noises), dict(start_sd)
        self.experiment: Experiment = bench.experiment
        self.engine, self.wiring = bench.engine, bench.wiring
        self.problem = bench.engine.held
        self.memo = Memo()
        self._refuse()
        first = self.engine.wiring.assemble(gradients=False)
        massive = self.engine.capacities(first) > 0.0
        self.massive, self.massless = np.flatnonzero(massive), np.flatnonzero(~massive)
        self.nodes = self.engine.nodes
        added = [p for p in self.noises if p.has_state]
        self.states = (*(self.nodes[k] for k in self.massive), *(p.state for p in added))
        self.units = (*("degC" for _ in self.massive), *("K" if p.place == "boundary" else "W" for p in added))
        self.size = len(self.states)
        self._added = {p.target: self.massive.size + k for k, p in enumerate(added)}
        # one Jacobian holds for all states and times, and inputs are straight between knots
        self.linear = not any(isinstance(self.wiring.signals[n], Sine) for n in self.wiring.used) and not self.engine.modal.obstacle
        self._heated = {p.target: self._heats(p) for p in added if p.place != "boundary"}
        self._raised = {
            p.target: self.wiring.structure.offset[self.wiring.network.boundaries.index(p.target)] for p in added if p.place == "boundary"
        }
        self._raised_rows = tuple(self._added[target] for target in self._raised)
        self._csr = _units(tuple(self._raised.values()), first.coefficients.size)
        self.grid = self._grid()
        self.lengths = tuple(f"{seconds:.12g}" for seconds in np.diff(self.grid))
        self.due = self._sensors_due()
        self.alike = self._alike()

    def _refuse(self) -> None:
        """Refuse what a filter cannot carry."""
        where = self.engine.title
        switched = [p.name for p in self.wiring.structure.controls if p.kind == "thermostat"]
        if switched:
            raise IdentificationError(
                f"'{switched[0]}' is switched by a thermostat, so process noise would change its switching times. Log its power and "
                "bind it to the load.",
                where,
                code="model.element-not-supported",
            )
        flat = self.wiring.network.flat
        for name in self.wiring.network.controls:
            if flat.controls[name].has_history:
                raise IdentificationError(
                    f"the state of the control '{name}' depends on its history, which a filter does not have. Log the power or the state "
                    "that it sets, and bind it; or use a table or a proportional control.",
                    where,
                    code="model.element-not-supported",
                )
        if self.wiring.network.stores:
            node = next(iter(self.wiring.network.stores))
            raise IdentificationError(
                f"'{node}' stores heat by a table, which is not supported with process noise. Fit without process noise.",
                where,
                code="model.element-not-supported",
            )
        if self.experiment.ticks:
            raise IdentificationError(
                "the offset of a second clock is not known, which is not supported with process noise. Find it by a fit without first.",
                where,
                code="model.element-not-supported",
            )
        if self.engine.is_large:
            raise IdentificationError(
                f"the filter supports models of up to some hundred nodes, not {len(self.engine.nodes)}. Reduce the model.",
                where,
                code="model.element-not-supported",
            )

    def _heats(self, noise: ProcessNoise) -> Array:
        """Return the heat into every node of the reduced network (nodes,) by one watt of a noise. [-]"""
        loads = {load.path: load.node for load in self.wiring.network.flat.loads}
        node = loads.get(noise.target, noise.target) if noise.place == "load" else noise.target
        out = np.zeros(len(self.nodes))
        if node not in self.nodes:
            raise IdentificationError(
                f"'{node}' has no heat capacity, and '{noise.target}' cannot be separated from its neighbours. Give the noise to one "
                "of these.",
                self.engine.title,
                code="model.element-not-supported",
            )
        out[self.nodes.index(node)] = 1.0
        return out

    def _grid(self) -> Array:
        """Return the times (times,) at which steps end: readings, and knots of inputs, less those within 1e-9 of the log of another. [s]"""
        last = float(self.experiment.times[-1])
        knots = [np.zeros(1), self.experiment.times]
        signals = (self.wiring.signals[name] for name in self.wiring.used)
        knots += [signal.corners() for signal in signals if isinstance(signal, TableSignal)]
        grid = np.unique(np.concatenate(knots))
        grid = grid[(grid >= 0.0) & (grid <= last)]
        near = np.diff(grid, prepend=-np.inf) < 1e-9 * max(last, 1.0)
        return np.asarray(grid[~near])

    def _sensors_due(self) -> tuple[tuple[tuple[int, int], ...], ...]:
        """Return, of every time of the grid, the sensors with a reading and its position among theirs."""
        out: list[list[tuple[int, int]]] = [[] for _ in self.grid]
        for k, o in enumerate(self.experiment.observations):
            places = np.searchsorted(self.grid, self.experiment.times[o.index] - 1e-9 * max(float(self.grid[-1]), 1.0))
            for n, place in enumerate(np.minimum(places, self.grid.size - 1)):
                out[int(place)].append((k, n))
        return tuple(tuple(one) for one in out)

    def step_to(self, place: int) -> tuple[str, tuple[int, ...]]:
        """Return length of the step to a time of the grid and the sensors that read then."""
        return self.lengths[place - 1], tuple(k for k, _ in self.due[place])

    def _alike(self) -> tuple[int, ...]:
        """Return, of every time of the grid, the first later one whose step has another length or other sensors (times,)."""
        out = [self.grid.size] * self.grid.size
        for place in range(self.grid.size - 2, 0, -1):
            out[place] = out[place + 1] if self.step_to(place) == self.step_to(place + 1) else place + 1
        return tuple(out)

    def at(self, x: Array, sizes: Array, times: Array, sigma: Array, bias: Array) -> At:
        """Return the dynamics with numbers filled in; nothing is discretised yet.

        Parameters
        ----------
        x : array               Values of the free names, in the order of the bench; errors of the sensors' scales are taken from here.
        sizes, times, sigma, bias    As in `At`: size and correlation time of each noise, noise and constant error of each sensor.
        """
        assembled = self.engine.started(self.wiring.assemble(x, False))
        scale = np.zeros(len(self.experiment.observations))
        for k, place, _ in self.bench.scales():
            scale[k] = x[place]
        return At(assembled, self.engine.capacities(assembled)[self.massive], sizes, times, sigma, bias, scale)

    def noise(self, at: At) -> Array:
        """Return G (states, noises). [K/s^0.5, W/s^0.5]"""
        out = np.zeros((self.size, len(self.noises)))
        for k, p in enumerate(self.noises):
            row = self._added[p.target] if p.has_state else self.states.index(p.target)
            out[row, k] = at.sizes[k] * (np.sqrt(2.0 / at.times[k]) if np.isfinite(at.times[k]) else 1.0)
        return out

    def local(self, at: At, state: Array, time: float) -> RatesAt:
        """Return rates and Jacobian at a `state` x (states,) and a time [s]: node temperatures [K], then states of the process noise [W].

        dT/dt = (heat into a node) / C [K/s]. Massless nodes are where their heat is zero, and follow by -J_mm^-1 J_mk. Autocorrelated
        noise falls as dw/dt = -w / tau; a heat w of its target enters with its share.
        """
        count, coefficients = self.massive.size, self._coefficients_at(state, at)
        outer = np.zeros(len(self.nodes))
        into = np.zeros((len(self.nodes), self.size))
        for target, share in self._heated.items():
            outer += share * state[self._added[target]]
            into[:, self._added[target]] += share
        temperatures = np.empty(len(self.nodes))
        temperatures[self.massive] = state[:count]
        if self.massless.size:
            temperatures[self.massless] = state[:count].mean()
        heat, jacobian, slopes = self._balance_massless(coefficients, temperatures, outer, time)
        if slopes is not None:
            for k, target in enumerate(self._raised):
                into[:, self._added[target]] += slopes[:, k]
        moves = np.zeros((len(self.nodes), self.size))
        moves[self.massive, np.arange(count)] = 1.0
        if self.massless.size:
            massless_block = jacobian[np.ix_(self.massless, self.massless)]
            moves[self.massless] = -np.linalg.solve(
                massless_block, jacobian[np.ix_(self.massless, self.massive)] @ moves[self.massive] + into[self.massless]
            )
        rates, whole = np.zeros(self.size), np.zeros((self.size, self.size))
        rates[:count] = heat[self.massive] / at.capacity
        whole[:count] = (jacobian[self.massive] @ moves + into[self.massive]) / at.capacity[:, None]
        for k, p in enumerate(self.noises):
            if p.has_state and np.isfinite(at.times[k]):
                row = self._added[p.target]
                rates[row], whole[row, row] = -state[row] / at.times[k], -1.0 / at.times[k]
        return RatesAt(rates, whole, temperatures, moves)

    def rates(self, members: Sequence[At], states: Array, time: float) -> tuple[Array, Array]:
        """Return rates (members, states) at a time [s] and their Jacobians (members, states, states), as `local` does for one member.

        States are temperatures [K], with rates [K/s], and those of noises x [W], with rates -x / time [W/s].
        """
        if self.massless.size:
            rates_of_members = [self.local(m, state, time) for m, state in zip(members, states, strict=True)]
            return np.stack([one.rates for one in rates_of_members]), np.stack([one.jacobian for one in rates_of_members])
        count = self.massive.size
        rates, whole = np.zeros(states.shape), np.zeros((*states.shape, self.size))
        for k, (at, state) in enumerate(zip(members, states, strict=True)):
            heat, jacobian, slopes = self.problem.rhs(self._coefficients_at(state, at), state[:count], time, self._csr)
            rates[k, :count], whole[k, :count, :count] = heat, jacobian
            if slopes is not None:
                whole[k, :count, list(self._raised_rows)] = slopes.T
        outer = np.zeros((len(states), count))
        for target, share in self._heated.items():
            outer += share * states[:, self._added[target], None]
            whole[:, :count, self._added[target]] += share
        if self._heated:
            rates[:, :count] += outer
        capacity = np.stack([m.capacity for m in members])
        rates[:, :count] /= capacity
        whole[:, :count] /= capacity[:, :, None]
        for k, p in enumerate(self.noises):
            if p.has_state:
                row = self._added[p.target]
                for m, (at, state) in enumerate(zip(members, states, strict=True)):
                    if np.isfinite(at.times[k]):
                        rates[m, row], whole[m, row, row] = -state[row] / at.times[k], -1.0 / at.times[k]
        return rates, whole

    def _coefficients_at(self, state: Array, at: At) -> Array:
        """Return the coefficients with each boundary that the filter estimates raised by its offset in a state (states,)."""
        coefficients = at.assembled.coefficients
        if self._raised:
            coefficients = coefficients.copy()
            for target, place in self._raised.items():
                coefficients[place] += state[self._added[target]]
        return coefficients

    def course(self, at: At, about: Array, times: Array) -> Array:
        """Return the rates (times, states) [K/s] of a linear network at a state `about` (states,) [K], at many times [s] at once.

        Those at time 0, plus the change of heat by boundaries and loads over C; massless nodes are eliminated: q - J_01 J_11^-1 q_1, of
        the Jacobian J [W/K], 1 the massless ones.
        """
        a, here = at.assembled, self.local(at, about, 0.0)
        by_one_kelvin = _units(self.wiring.structure.offset, a.coefficients.size)
        by_boundary = self.problem.rhs(a.coefficients, here.temperatures, 0.0, by_one_kelvin)[2]  # heat (nodes, boundaries) [W/K]
        heat = self._boundary_moves(times, a) @ by_boundary.T + self._load_heat_change(times, a, here.temperatures)
        inner = heat[:, self.massive]
        if self.massless.size:
            _, jacobian, _ = self.problem.rhs(a.coefficients, here.temperatures, 0.0, None)
            massless_block = jacobian[np.ix_(self.massless, self.massless)]
            inner = inner - heat[:, self.massless] @ np.linalg.solve(massless_block.T, jacobian[np.ix_(self.massive, self.massless)].T)
        out = np.tile(here.rates, (times.size, 1))
        out[:, : self.massive.size] += inner / at.capacity
        return out

    def _boundary_moves(self, times: Array, a: Assembled) -> Array:
        """Return how far boundaries are from where they begin (times, boundaries); the same for all values. [K]"""

        def make() -> Array:
            """Return the distance (times, boundaries) of each boundary from its value at time zero. [K]"""
            first = np.zeros(1)
            names = self.wiring.network.boundaries
            return np.column_stack([self.wiring.boundary(b, times, a.offsets) - self.wiring.boundary(b, first, a.offsets) for b in names])

        return self.memo.value(("boundaries", times.tobytes()), make, MAX_CACHED_COURSES)

    def _load_heat_change(self, times: Array, a: Assembled, temperatures: Array) -> Array:
        """Return the heat of loads into every node less that at time zero (times, nodes), at fixed `temperatures`. [W]"""
        loads = self.wiring.structure.loads
        places = [p for placed in loads for p in placed.places]

        def make() -> Array:
            """Return the heat (times, nodes) of all loads at fixed temperatures, less that at time zero. [W]"""
            row = np.resize(temperatures, len(self.nodes) + len(self.wiring.network.boundaries))
            powers = self.problem.load_powers(a.coefficients, np.tile(row, (times.size + 1, 1)), np.append(times, 0.0), None)
            heat = np.zeros((times.size, len(self.nodes)))
            for k, placed in enumerate(loads):
                if placed.node < len(self.nodes):
                    heat[:, placed.node] += powers[:-1, k] - powers[-1, k]
            return heat

        return self.memo.value(("loads", times.tobytes(), a.coefficients[places].tobytes()), make, MAX_CACHED_COURSES)

    def _balance_massless(self, coefficients: Array, temperatures: Array, outer: Array, time: float) -> tuple[Array, Array, Array | None]:
        """Return heat (nodes,) [W], Jacobian (nodes, nodes) [W/K] and slopes with massless nodes in balance, by Newton's method to 1e-10 K.

        At `time` [s] with the `coefficients` of laws. Their `temperatures` (nodes,) [K] are put in place; `outer` (nodes,) [W] is heat of
        the noises, added to it.
        """
        loose = self.massless
        for _ in range(BALANCES if loose.size else 0):
            heat, jacobian, _ = self.problem.rhs(coefficients, temperatures, time, None)
            move = np.linalg.solve(jacobian[np.ix_(loose, loose)], -(heat + outer)[loose])
            temperatures[loose] += move
            if np.abs(move).max() < 1e-10:
                break
        heat, jacobian, slopes = self.problem.rhs(coefficients, temperatures, time, self._csr)
        return (heat + outer if self._heated else heat), jacobian, slopes

    def readings(self, at: At, local: RatesAt, state: Array, time: float, sensors: Sequence[int]) -> tuple[Array, Array]:
        """Return what sensors read (sensors,) [K] at a state (states,) and `time` [s], and the rows of that (sensors, states).

        T + scale (T - about) + bias, with the scale error of the sensor, about where it has none, and its constant error. [K]
        """
        a = at.assembled
        traces = Traces(self.wiring, a, np.array([time]), self.nodes, local.temperatures[None, :], local.slopes[None, :, :])
        read, rows = np.zeros(len(sensors)), np.zeros((len(sensors), self.size))
        for n, k in enumerate(sensors):
            o = self.experiment.observations[k]
            if o.node in self.nodes:
                place = self.nodes.index(o.node)
                read[n], rows[n] = local.temperatures[place], local.slopes[place]
            else:
                read[n], rows[n] = self._recovered(traces, dict(a.reduced.recover), o.node, state)
            about = o.part.gain_about if o.part is not None else 0.0
            read[n] += at.scale[k] * (read[n] - about) + at.bias[k]
            rows[n] *= 1.0 + at.scale[k]
        return read, rows

    def _recovered(self, traces: Traces, recover: dict[str, object], node: str, state: Array) -> tuple[float, Array]:
        """Return temperature [K] and its derivatives by the state (states,) of a node that was eliminated, or of a boundary.

        An eliminated node is T = sum w_k T_k over the nodes and boundaries of `recover`, its derivatives the same sum. A boundary whose
        error is a state adds that state [K].
        """
        if node in self.nodes:
            place = self.nodes.index(node)
            return float(traces.stored[0, place]), traces.slopes[0, place]
        row = np.zeros(self.size)
        if node in self.wiring.network.boundaries:
            base = float(self.wiring.boundary(node, traces.times, traces.assembled.offsets)[0])
            if node in self._raised:
                row[self._added[node]] = 1.0
                base += state[self._added[node]]
            return base, row
        total, weights = 0.0, recover[node]
        assert isinstance(weights, dict)
        for name, weight in weights.items():
            share = value_of(weight)
            value, part = self._recovered(traces, recover, name, state)
            total, row = total + share * value, row + share * part
        return total, row

    def start(self, at: At) -> tuple[Array, Array]:
        """Return mean (states,) and standard deviations (states,) of the state at the start: temperatures [K], then noises [W or K].

        A noise begins at zero: with its stationary size where it has a time, else with that of a level that stays.
        """
        mean, sd = np.zeros(self.size), np.zeros(self.size)
        count = self.massive.size
        mean[:count] = at.assembled.initial[self.massive]
        for k, name in enumerate(self.states[:count]):
            sd[k] = self._start_sd(name)
        for k, p in enumerate(self.noises):
            if p.has_state:
                row = self._added[p.target]
                sd[row] = at.sizes[k] if np.isfinite(at.times[k]) else self.level_sd(p)
        return mean, sd

    def level_sd(self, noise: ProcessNoise) -> float:
        """Return the standard deviation of where a random walk begins: unknown for a boundary that is not looked for itself. [K], [W]"""
        is_known = noise.place != "boundary" or noise.target in self.bench.free
        return self.start_sd.get(noise.target, 0.0 if is_known else UNKNOWN_START_SD)

    def _start_sd(self, node: str) -> float:
        """Return the standard deviation of a node's start. [K]"""
        e = self.experiment
        if node in self.start_sd:
            return self.start_sd[node]
        if f"initial.{node}" in self.bench.free:
            return 0.0
        if node in e.hidden:
            return e.hidden[node].sd
        if node in e.loose or node in e.readings or node in e.tips:
            return UNKNOWN_START_SD
        stated = (
            node in e.scenario.initial or self.wiring.start is not None or (isinstance(e.scenario.start, str) and e.scenario.start != "")
        )
        return 0.0 if stated else UNSAID_NOISE


def _units(places: Sequence[int], count: int) -> tuple[NDArray[np.int32], NDArray[np.int32], Array, int] | None:
    """Return the derivatives (count, places) of `count` coefficients by those at some places, as CSR: starts, columns, values, width.

    Row `places[k]` has a 1 in column k; all else is 0. None without places.
    """
    if not places:
        return None
    indptr = np.zeros(count + 1, dtype=np.int32)
    for place in places:
        indptr[place + 1 :] += 1
    return indptr, np.argsort(places).astype(np.int32), np.ones(len(places)), len(places)
