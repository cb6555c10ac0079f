"""The steps of the C header beside a run that holds a tight tolerance: how far fixed steps of a length miss it."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from thermid.errors import SolverError
from thermid.interop.wired import Wired
from thermid.linear_algebra import Array
from thermid.model.laws.signal import Sine, TableSignal
from thermid.simulation.solver.engine import Engine
from thermid.simulation.solver.problem import Options
from thermid.simulation.solver.wiring import Wiring

FEWEST, MOST = 50, 20_000
"""Steps of a run between which a length is looked for."""
TIGHT = 1e-9
STATED = 2.0
"""What is stated is the measured error times this: other readings fall between the measured ones."""
MOMENT = 1e-3
MOST_CUTS = 16
NEAR = 1e-9
"""Switching temperatures are met to this. [K]"""
STAGES = (
    (),
    (1.544,),
    (0.9466785280815826, 0.2557011698983284),
    (3.314825187068521, 2.896124015972201, 0.9986419139977817),
    (1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950),
    (1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950, 1.0),
)
COUPLED = (
    (),
    (-5.6688,),
    (-2.430093356833875, -0.2063599157091915),
    (-0.1073529058151375, -9.594562251023355, -20.47028614809616),
    (7.496443313967647, -10.24680431464352, -33.99990352819905, 11.70890893206160),
    (8.083246795921522, -7.981132988064893, -31.52159432874371, 16.31930543123136, -6.058818238834054),
)
TIMES = (0.0, 0.386, 0.21, 0.63, 1.0, 1.0)
DRIFT = (0.25, -0.1043, 0.1035, -0.03620000000000023, 0.0, 0.0)
GAMMA = 0.25
"""RODAS: E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, 2nd edition, section IV.7; order 4, stiffly accurate."""


def step_grid(breaks: list[float], end: float, step: float) -> Array:
    """Return the times (steps + 1,) at which fixed steps end, cut where an input jumps or bends. [s]"""
    times = [0.0]
    for until in (*breaks, end):
        while times[-1] < until - 1e-9 * step:
            left = until - times[-1]
            times.append(times[-1] + step if left > step * (1.0 + 1e-6) else until)
    return np.array(times)


def nice_steps(end: float) -> Iterator[float]:
    """Yield lengths of steps of 1, 2 and 5 times a power of ten, falling, each at most a fiftieth of the run. [s]"""
    power = math.floor(math.log10(end / FEWEST)) + 1
    while True:
        for digit in (5, 2, 1):
            step = float(f"{digit}e{power}")
            if step <= end / FEWEST:
                if end / step > MOST:
                    return
                yield step
        power -= 1


def chosen_step(w: Wired, tolerance: float) -> tuple[float, float]:
    """Return the longest step whose error is within a tolerance, and that error; the shortest tried where none is. [s], [K]"""
    step = error = math.nan
    for step in nice_steps(w.scenario.seconds):
        error = stated_error(w, step)
        if error <= tolerance:
            break
    return step, error


def stated_error(w: Wired, step: float) -> float:
    """Return the stated error of fixed steps: twice the largest difference of all states with mass to a run at 1e-9, in two digits. [K]

    Raises
    ------
    SolverError   When a step has no answer.
    """
    grid = step_grid(w.breaks(), w.scenario.seconds, step)
    with np.errstate(all="ignore"):
        found = _Stepper(w, grid).temperatures()
    error = STATED * float(np.abs(found - _reference(w, grid)).max())
    if not np.isfinite(error):
        raise SolverError(f"fixed steps of {step:g} s have no finite answer. Give a shorter one: step = ...", w.network.title)
    return _rounded_up(max(error, 1e-6))


def _rounded_up(x: float) -> float:
    """Return a number rounded up to two digits."""
    unit = 10.0 ** (math.floor(math.log10(x)) - 1)
    return float(f"{math.ceil(x / unit - 1e-9) * unit:.6g}")


def _reference(w: Wired, grid: Array) -> Array:
    """Return temperatures (times, nodes with mass) of a run at a tight tolerance. [K]"""
    engine = Engine(Wiring(w.network, w.scenario))
    a = engine.started(engine.wiring.assemble(gradients=False))
    options = Options(tolerance=TIGHT, relative=TIGHT, input_tolerance=1e-7)
    return engine.integrate(a, grid, w.massive, float(grid[-1]), options).temperatures


class _Stepper:
    """Fixed steps over the kernel's heat and Jacobian."""

    def __init__(self, w: Wired, grid: Array) -> None:
        wiring = Wiring(w.network, w.scenario)
        for name, given in wiring.signals.items():
            if isinstance(given, Sine):  # a step joins its inputs by a straight line
                wiring.signals[name] = TableSignal(grid, given.at(grid), after="hold")
        self.engine, self.grid = Engine(wiring), grid
        self.a = self.engine.started(wiring.assemble(gradients=False))
        self.massive = [self.engine.nodes.index(n) for n in w.massive]
        layout = wiring.structure
        capacities = [0.0 if place < 0 else float(self.a.coefficients[place]) for place in layout.capacity]
        self.mass = np.array(capacities)
        self.massless = self.mass == 0.0
        self.controls = [p for p in layout.controls if p.kind == "thermostat"]
        self.places = [k for k, p in enumerate(layout.controls) if p.kind == "thermostat"]
        self.on = np.full(len(layout.controls), 0, dtype=np.int32)
        self.boundaries = {len(self.engine.nodes) + k: b for k, b in enumerate(w.network.boundaries)}

    def temperatures(self) -> Array:
        """Return temperatures (times, nodes with mass). [K]"""
        state = self.a.initial.copy()
        for k, control in zip(self.places, self.controls, strict=True):
            self.on[k] = self._sensor(control, state, 0.0) <= self.a.coefficients[control.places[0]]
        out = [state[self.massive]]
        for begin, end in zip(self.grid[:-1], self.grid[1:], strict=True):
            state = self._advance(state, float(begin), float(end))
            out.append(state[self.massive])
        return np.array(out)

    def _balance(self, state: Array, time: float) -> tuple[Array, Array]:
        heat, jacobian, _ = self.engine.rhs(self.a, state, time, False, self.on)
        return heat, jacobian

    def _settled(self, state: Array, time: float) -> Array:
        """Return temperatures with nodes without mass in balance."""
        if not self.massless.any():
            return state
        for _ in range(40):
            heat, jacobian = self._balance(state, time)
            moved = np.linalg.solve(jacobian[np.ix_(self.massless, self.massless)], heat[self.massless])
            state = state.copy()
            state[self.massless] -= moved
            if np.abs(moved).max() < 1e-10:
                break
        return state

    def _advance(self, state: Array, begin: float, end: float) -> Array:
        inner = 1e-9 * (end - begin)  # a held input has its value of before a jump at the end of a step
        last = end - inner
        state = self._switched(state, begin, 0.0)
        for _ in range(MOST_CUTS + 1):
            after = self._step(state, begin, end, last)
            if not self.controls or self._due(after, last) < 0.0:
                return after
            low, high, at_low, at_high, side = 0.0, 1.0, self._due(state, begin), self._due(after, last), 0
            for _ in range(40):
                if abs(at_high) <= 1e-10 or at_low >= 0.0:
                    break
                middle = high - at_high * (high - low) / (at_high - at_low)
                middle = middle if low < middle < high else 0.5 * (low + high)
                there = begin + middle * (end - begin)
                gap = self._due(self._step(state, begin, there, min(there, last)), there)
                if gap >= 0.0:
                    high, at_high, at_low, side = middle, gap, at_low * (0.5 if side == 1 else 1.0), 1
                else:
                    low, at_low, at_high, side = middle, gap, at_high * (0.5 if side == -1 else 1.0), -1
            there = begin + high * (end - begin)
            state = self._switched(self._step(state, begin, there, min(there, last)), min(there, last), NEAR)
            begin = there
            if end - begin < 1e-12 * self.grid[-1]:
                break
        return state

    def _step(self, state: Array, begin: float, end: float, last: float) -> Array:
        """Return temperatures after one step."""
        h = end - begin
        state = self._settled(state, begin)
        early, late = (self._balance(state, begin + s * h)[0] for s in (0.0, MOMENT))
        drift = (late - early) / (MOMENT * h)
        heat, jacobian = self._balance(state, begin)
        matrix = np.diag(self.mass / (GAMMA * h)) - jacobian
        k: list[Array] = []
        at = state
        for s in range(6):
            if s:
                at = state + sum(a * x for a, x in zip(STAGES[s], k, strict=True))
                heat = self._balance(at, min(begin + TIMES[s] * h, last))[0]
            coupled = sum((c * x for c, x in zip(COUPLED[s], k, strict=True)), np.zeros(state.size))
            k.append(np.asarray(np.linalg.solve(matrix, heat + self.mass * coupled / h + DRIFT[s] * h * drift), dtype=float))
        return np.asarray(at + k[5])

    def _sensor(self, control: object, state: Array, time: float) -> float:
        place = control.sensor  # type: ignore[attr-defined]
        if place < state.size:
            return float(state[place])
        return float(self.engine.wiring.boundary(self.boundaries[place], np.array([time]), self.a.offsets)[0])

    def _gaps(self, state: Array, time: float) -> list[float]:
        out = []
        for k, control in zip(self.places, self.controls, strict=True):
            seen = self._sensor(control, state, time)
            low, high = (float(self.a.coefficients[p]) for p in control.places[:2])
            out.append(seen - high if self.on[k] else low - seen)
        return out

    def _due(self, state: Array, time: float) -> float:
        return max(self._gaps(state, time), default=-1e9)

    def _switched(self, state: Array, time: float, near: float) -> Array:
        """Return temperatures with what is due switched."""
        for _ in range(2 * len(self.controls) + 3):
            state = self._settled(state, time)
            due = next((k for k, gap in zip(self.places, self._gaps(state, time), strict=True) if gap >= -near), None)
            if due is None:
                break
            self.on[due] = 1 - self.on[due]
            near = 0.0
        return state
