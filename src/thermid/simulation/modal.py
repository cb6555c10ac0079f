"""The exact solution of linear networks by modes: whether a network has one, whether it pays, and the kernel's answer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thermid import _kernel
from thermid.errors import ScenarioError
from thermid.model.signal import Constant, Table
from thermid.simulation.wiring import Assembled, Wiring

__all__ = ["METHODS", "Exact", "Modal", "Work"]

Array = NDArray[np.float64]
METHODS = ("auto", "modal", "integrator")


class Exact(NamedTuple):
    """What the kernel says of a modal run: status, node and time [s] of a failure, stretches, temperatures [K] and heats [J]."""

    status: int
    node: int
    time: float
    steps: int
    traces: Array
    final: Array
    load_energy: Array
    boundary_energy: Array


@dataclass(frozen=True)
class Work:
    """What a run has to do, by which its time is estimated.

    Parameters
    ----------
    nodes : int         Nodes of the reduced network.
    stretches : int     From knot to knot of the sampled inputs and from output to output.
    lengths : int       Stretches of different length; every one needs its own exponentials.
    outputs : int       Output times.
    written : int       Temperatures that are written: times by nodes.
    waves : int         Sinusoidal inputs.
    sampled : int       Sampled inputs.
    """

    nodes: int
    stretches: int
    lengths: int
    outputs: int
    written: int
    waves: int
    sampled: int

    @property
    def modal(self) -> float:
        """Estimated time by modes. [s]"""
        n = self.nodes
        march = self.stretches * (16.0 + 1.0 * n * (1 + self.sampled)) + self.lengths * n * 40.0
        return 1e-9 * (10e3 + 25.0 * n**3 + march + self.written * (0.13 * n + 0.6) + self.outputs * self.waves * 30.0)

    @property
    def integrator(self) -> float:
        """Estimated time of the integrator, at the fewest steps that were seen. [s]"""
        n = self.nodes
        return 1e-9 * (20e3 + 40 * (2e3 + 400.0 * n + 30.0 * n * n) + self.written * 2.5)


class Modal:
    """The modal solution of one wiring; the same for all values of its unknowns.

    Parameters
    ----------
    wiring : Wiring
    problem : Problem       The kernel's.
    """

    def __init__(self, wiring: Wiring, problem: _kernel.Problem) -> None:
        self.wiring = wiring
        self.problem = problem
        self.obstacle = _obstacle(wiring)
        self._grids: dict[tuple[float, ...], tuple[int, int]] = {}

    def refusal(self, method: str, times: Array, written: int, end: float, gradients: bool) -> str:
        """Return why the integrator is to be used, in words; empty when the modes are.

        Raises
        ------
        ScenarioError   When the modes are asked for and the network has none, or there is no such method.
        """
        if method not in METHODS:
            raise ScenarioError(f"there is no method '{method}'. Choose one of {', '.join(METHODS)}.", self.wiring.scenario.title)
        if method == "integrator":
            return "asked for"
        why = self.obstacle or ("derivatives come from the integrator" if gradients else "")
        if method == "modal" and why:
            raise ScenarioError(
                f"there is no modal solution: {why}. Leave 'method' at 'auto'.", f"{self.wiring.network.title}, {self.wiring.scenario.title}"
            )
        if why or method == "modal":
            return why
        work = self.work(times, written, end)
        return "" if work.modal <= work.integrator else f"about {work.modal:.1g} s by modes, {work.integrator:.1g} s by steps"

    def work(self, times: Array, written: int, end: float) -> Work:
        """Return what a run to `end` [s] with outputs at times (times,) [s] has to do."""
        signals = [self.wiring.signals[name] for name in self.wiring.used]
        tables = [s.times for s in signals if isinstance(s, Table)]
        key = (times.size, float(times[0]), float(times[-1]), end) if times.size else (0.0, end)
        if key not in self._grids:
            grid = np.unique(np.concatenate((times, [0.0, end], *tables)))
            gaps = np.diff(grid[(grid >= 0.0) & (grid <= end)])
            gaps = gaps[gaps > 1e-15 * end]
            self._grids[key] = gaps.size, np.unique(np.float32(gaps)).size
        waves = sum(not isinstance(s, Table | Constant) for s in signals)
        return Work(self.problem.nodes, *self._grids[key], times.size, written, waves, len(tables))

    def run(self, a: Assembled, times: Array, nodes: NDArray[np.int32], end: float) -> Exact:
        """Return temperatures of some nodes at times, from zero to `end` [s]."""
        return Exact(*_kernel.modal(self.problem, a.coefficients, a.initial, 0.0, float(end), np.ascontiguousarray(times, dtype=float), nodes))


def _obstacle(wiring: Wiring) -> str:
    """Return what keeps a network from being linear with constant coefficients, in words; empty when nothing does."""
    s = wiring.structure()
    named: Mapping[int, str] = {k: name for name, k in wiring.used.items()}

    def moves(place: int) -> bool:
        k = s["coefficient_input"][place]
        return k >= 0 and not isinstance(wiring.signals[named[k]], Constant)

    for form, _, _, places, _, name in s["conductors"]:
        if form == "flow":
            return f"'{name}' carries heat one way, so the network is not symmetric"
        if form != "linear":
            return f"the law of '{name}' is not linear"
        if moves(places[0]):
            return f"the conductance of '{name}' changes in time"
    for form, _, _, _, _, name in s["loads"]:
        if form != "signal":
            return f"the power of '{name}' depends on temperature"
    return ""
