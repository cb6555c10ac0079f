"""The solution of any network by scipy's Radau method, massless nodes by Newton's method, thermostats as events; or no verdict."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from thermid import _kernel as k
from unit.kernel.reference import THERMOSTAT, Net

PATIENCE = 25_000
"""Evaluations of the right-hand side after which there is no verdict."""
SWITCHINGS = 60


class NoVerdictError(Exception):
    """The oracle does not know."""


class Crooked:
    """A network as scipy sees it."""

    def __init__(self, net: Net) -> None:
        self.net = net
        self.c = net.capacities()
        self.massive, self.massless = np.flatnonzero(self.c > 0), np.flatnonzero(self.c == 0)
        if (self.c < 0).any() or not np.isfinite(self.c).all():
            raise NoVerdictError
        self.guess = np.asarray(net.start, float)[self.massless]
        self.calls = 0
        self.middle = 0.0
        self.on = np.zeros(len(net.loads), int)
        self.thermostats = [i for i, row in enumerate(net.loads) if row[0] == THERMOSTAT]

    def heat(self, t: float, every: np.ndarray) -> np.ndarray:
        self.calls += 1
        if self.calls > PATIENCE:
            raise NoVerdictError
        # held inputs have the value of the piece under way
        values = [self.net.signal(i, self.middle if inp[0] == k.SAMPLED_HOLD else t) for i, inp in enumerate(self.net.inputs)]
        coef = np.array([v * (values[u] if u >= 0 else 1.0) for v, u, _ in self.net.coefs])
        found = _steady_coefficients(self.net, coef).net_heat(t, every, coef, self.on)
        if not np.isfinite(found).all():
            raise NoVerdictError
        return np.asarray(found)

    def everything(self, t: float, massive: np.ndarray) -> np.ndarray:
        """Return the temperatures of all nodes. [K]"""
        every = np.empty(self.c.size)
        every[self.massive] = massive
        m = self.massless
        every[m] = self.guess
        for _ in range(60 if m.size else 0):
            zero = self.heat(t, every)[m]
            jacobian = np.empty((m.size, m.size))
            for j, i in enumerate(m):
                moved = every.copy()
                moved[i] += 1e-4
                jacobian[:, j] = (self.heat(t, moved)[m] - zero) / 1e-4
            if not np.isfinite(jacobian).all() or np.linalg.cond(jacobian) > 1e12:
                raise NoVerdictError
            step = np.linalg.solve(jacobian, -zero)
            step *= min(1.0, 50.0 / max(float(np.abs(step).max()), 1e-300))
            every[m] += step
            if np.abs(step).max() < 1e-9:
                break
        else:
            if m.size:
                raise NoVerdictError
        self.guess = every[m].copy()
        return every

    def rate(self, t: float, massive: np.ndarray) -> np.ndarray:
        return self.heat(t, self.everything(t, massive))[self.massive] / self.c[self.massive]

    def _sensor(self, t: float, massive: np.ndarray, load: int) -> float:
        every = self.net.all_temperatures(self.everything(t, massive), t)
        return float(every[self.net.at(self.net.loads[load][3])])

    def _event(self, load: int) -> Any:
        def crossing(t: float, massive: np.ndarray) -> float:
            return self._sensor(t, massive, load) - limit

        limit = self._limits(load)[int(self.on[load])]
        crossing.terminal, crossing.direction = True, 1.0 if self.on[load] else -1.0  # type: ignore[attr-defined]
        return crossing

    def _limits(self, load: int) -> tuple[float, float]:
        slots = self.net.loads[load][2]
        return self.net.coefs[slots[1]][0], self.net.coefs[slots[2]][0]

    def _settle(self, t: float, massive: np.ndarray) -> int:
        """Switch what is past its threshold already; return how often.

        A sensor without capacitance jumps with its room or with a power, and where it lands beyond the threshold no zero is crossed.
        """
        switched = 0
        while True:
            off = [(load, self._sensor(t, massive, load) - self._limits(load)[int(self.on[load])]) for load in self.thermostats]
            past = [load for load, above in off if (above > 0.0 if self.on[load] else above < 0.0)]
            if not past:
                return switched
            switched += 1
            if switched > SWITCHINGS:
                raise NoVerdictError
            for load in past:
                self.on[load] = 1 - self.on[load]

    def solve(self, times: np.ndarray, rtol: float, atol: float) -> np.ndarray:
        """Return the temperatures (times, nodes). [K]"""
        jumps = {float(t) for _, a, b in self.net.inputs if len(b) for t in a if times[0] < t < times[-1]}
        edges = sorted({float(times[0]), float(times[-1])} | jumps)
        state, out = np.asarray(self.net.start, float)[self.massive], np.empty((times.size, self.c.size))
        self.middle = 0.5 * (edges[0] + edges[min(1, len(edges) - 1)])
        for load in self.thermostats:
            self.on[load] = self._sensor(edges[0], state, load) <= self._limits(load)[0]
        if len(edges) == 1:
            out[:] = self.everything(edges[0], state)
        switched = 0
        for begin, end in pairwise(edges):
            self.middle, here = 0.5 * (begin + end), begin
            while here < end:
                switched += self._settle(here, state)
                events = [self._event(load) for load in self.thermostats]
                with np.errstate(all="ignore"):
                    found = solve_ivp(
                        self.rate, (here, end), state, "Radau", rtol=rtol, atol=atol, events=events or None, dense_output=True
                    )
                if not found.success:
                    raise NoVerdictError
                stop = float(found.t[-1])
                last = stop == end == edges[-1]
                for j in np.flatnonzero((times >= here) & ((times <= stop) if last else (times < stop))):
                    out[j] = self.everything(float(times[j]), found.sol(times[j]))
                here, state = stop, found.y[:, -1]
                if stop < end:
                    switched += 1
                    if switched > SWITCHINGS:
                        raise NoVerdictError
                    for load, hits in zip(self.thermostats, found.t_events, strict=True):
                        if len(hits):
                            self.on[load] = 1 - self.on[load]
        return out


class _Fixed(Net):
    """A network whose coefficients are given as they are now."""

    def effective(self, t: float, coef: Any = None) -> list[float]:
        return list(coef)


def _steady_coefficients(net: Net, coef: np.ndarray) -> Net:
    """Return the network with coefficients that already hold their inputs."""
    return _Fixed(net.capacity, net.start, net.coefs, net.boundaries, net.conductors, net.loads, net.tables, net.inputs, net.parameters)


def solve(net: Net, times: np.ndarray) -> np.ndarray:
    """Return the temperatures (times, nodes), the same to 1e-5 K or relative at two tolerances. [K]

    Raises
    ------
    NoVerdictError   When they differ, or the work is too much.
    """
    try:
        with np.errstate(all="ignore"):
            one, other = (Crooked(net).solve(times, rtol, atol) for rtol, atol in ((1e-7, 1e-6), (1e-9, 1e-8)))
    except (OverflowError, ValueError, ZeroDivisionError, FloatingPointError, np.linalg.LinAlgError):
        raise NoVerdictError from None
    if not np.isfinite(other).all() or (np.abs(one - other) > 1e-4 + 1e-6 * np.abs(other)).any():
        raise NoVerdictError
    return other
