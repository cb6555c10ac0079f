"""The exact solution of linear networks by modes: whether a network has one, whether it pays, and the kernel's answer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from thermid import _kernel
from thermid.errors import ScenarioError
from thermid.model.laws.signal import Constant, Sine, Table
from thermid.network.eliminate import held_in
from thermid.simulation.solver.wiring import Assembled, Wiring

Array = NDArray[np.float64]
METHODS = ("auto", "modal", "integrator")
REMEMBERED = 64  # lengths of stretches that the kernel has in mind, at least
MOST = 300  # nodes beyond which modes cost more than any noise asks of steps


class Exact(NamedTuple):
    """What the kernel says of a modal run: status, node and time [s] of a failure, stretches, temperatures [K], heats [J] and turnings."""

    status: int
    node: int
    time: float
    steps: int
    traces: Array
    final: Array
    load_energy: Array
    boundary_energy: Array
    turnings: tuple[Any, Array, Array]


@dataclass(frozen=True)
class Work:
    """What a run has to do, by which its time is estimated.

    Parameters
    ----------
    nodes : int         Nodes of the reduced network.
    stretches : int     From knot to knot of the sampled inputs and from output to output.
    fresh : int         Stretches that need exponentials of their own: those of a length that the kernel has not in mind.
    outputs : int       Output times.
    sampled : int       Sampled inputs.
    waves : int         Sinusoidal inputs.
    stops : int         Knots at which the integrator ends a step.
    steps : float       Steps of the integrator between knots at which it ends one.
    """

    nodes: int
    stretches: int
    fresh: int
    outputs: int
    sampled: int
    waves: int
    stops: int
    steps: float

    @property
    def modal(self) -> float:
        """Time by modes, as measured: docs/decisions/022-modal-solution.md. [s]"""
        n = self.nodes
        march = self.stretches * (15.0 + 0.25 * n * (1 + self.sampled)) + self.fresh * (400.0 + 50.0 * n)
        write = self.outputs * (n * (1.0 + 0.1 * n) + 30.0 * self.waves)
        return 1e-9 * (10e3 + 100.0 * n**2 + 12.0 * n**3 + march + write)

    @property
    def integrator(self) -> float:
        """Time of the integrator where nothing is stiff. [s]"""
        n = self.nodes
        step = 700.0 + 340.0 * n + 0.012 * n**3 + (400.0 if self.sampled else 0.0)
        read = 30.0 * self.stretches if self.sampled else 0.0
        write = self.outputs * (15.0 + 2.0 * n + (25.0 if self.sampled else 0.0))
        return 1e-9 * (40e3 + (self.steps + self.stops) * step + read + write)


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
        self._pace: tuple[float, float] | None = None

    def refusal(self, method: str, times: Array, end: float, gradients: bool) -> str:
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
                f"there is no modal solution: {why}. Leave 'method' at 'auto'.",
                f"{self.wiring.network.title}, {self.wiring.scenario.title}",
            )
        if why or method == "modal":
            return why
        work = self.work(times, end)
        return (
            ""
            if work.modal <= work.integrator
            else f"an estimated {1e3 * work.modal:.2g} ms by modes, {1e3 * work.integrator:.2g} ms by steps"
        )

    def work(self, times: Array, end: float) -> Work:
        """Return what a run to `end` [s] with outputs at times (times,) [s] has to do."""
        signals = [self.wiring.signals[name] for name in self.wiring.used]
        tables = [s for s in signals if isinstance(s, Table)]
        key = (times.size, float(times[:1].sum()), float(times[-1:].sum()), end)
        if key not in self._grids:
            grid = np.unique(np.concatenate((times, [0.0, end], *(s.times for s in tables))))
            gaps = np.diff(grid[(grid >= 0.0) & (grid <= end)])
            gaps = gaps[gaps > 1e-15 * end]
            often = np.sort(np.unique(gaps.astype(np.float32), return_counts=True)[1])[-REMEMBERED:]
            self._grids[key] = gaps.size, gaps.size - int(often.sum()) + often.size
        stops = sum(s.times.size for s in tables if s.times.size <= (5000 if s.hold else 500))
        waves = sum(isinstance(s, Sine) for s in signals)
        if self._pace is None:
            self._pace = self._paces()
        fastest, rough = self._pace
        steps = max(20.0 * np.log1p(fastest * end), rough * end)
        return Work(self.problem.nodes, *self._grids[key], times.size, len(tables), waves, stops, float(steps))

    def _paces(self) -> tuple[float, float]:
        """Return the rate of the fastest node, and how many steps a second the noise of inputs asks of the integrator. [1/s]

        Taken at nominal values, so that the choice of method does not hang on which run came first.
        """
        if self.problem.nodes > MOST:
            return 0.0, 0.0
        a = self.wiring.assemble(gradients=False)
        capacity = np.array([np.inf if c < 0 else a.coefficients[c] for c in self.wiring.structure()["capacity"]])
        _, jacobian, _ = self.problem.rhs(a.coefficients, a.initial, 0.0)
        own = -jacobian / capacity[:, None]
        return float(np.diag(own).max()), max((self._roughness(name, a, capacity, own) for name in self.wiring.used), default=0.0)

    def _roughness(self, name: str, a: Assembled, capacity: Array, own: Array) -> float:
        """Return how many steps a second an input's noise asks of the integrator. [1/s]

        12 (b k^2 r sqrt(d))^(2/5), where a node of rate k is moved by the input at a rate b, r is the size of the noise [K] and d the
        time between samples: fitted to steps counted over noises from 2 mK to 0.5 K, right within 2.5 times
        (docs/decisions/022-modal-solution.md).
        """
        signal, s = self.wiring.signals[name], self.wiring.structure()
        if not isinstance(signal, Table) or signal.times.size <= (5000 if signal.hold else 500):
            return 0.0
        noise = float(np.sqrt(np.mean(np.diff(signal.values, 2) ** 2) / 6.0))  # of independent readings, whatever they follow
        moved = np.zeros(capacity.size)
        if name.startswith("boundary "):
            moved = own.sum(axis=1)  # by all boundaries: which of them is the noisy one hardly matters
        for _, node, places, _, _, _ in s["loads"]:
            if s["coefficient_input"][places[0]] == self.wiring.used[name] and node < capacity.size:
                moved[node] += a.coefficients[places[0]] / capacity[node]
        jolt = np.abs(moved) * np.diag(own) ** 2 * noise * np.sqrt(np.median(np.diff(signal.times)))
        return float(12.0 * jolt.max() ** 0.4)

    def run(
        self, a: Assembled, times: Array, nodes: NDArray[np.int32], end: float, turnings: bool = False, sums: tuple[Any, ...] | None = None
    ) -> Exact:
        """Return temperatures of some nodes at times, from zero to `end` [s]; and turning points of these and of sums, where asked for."""
        wanted = np.ascontiguousarray(times, dtype=float)
        found = _kernel.modal(self.problem, a.coefficients, a.initial, 0.0, float(end), wanted, nodes, turnings, sums)
        return Exact(*found)


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
        if (node := name.removesuffix(held_in(""))) in wiring.network.stores and name == held_in(node):
            return f"'{node}' stores heat by a table"
        if form != "linear":
            return f"the law of '{name}' is not linear"
        if moves(places[0]):
            return f"the conductance of '{name}' changes in time"
    for form, _, _, _, name, control in s["loads"]:
        if form != "signal" or control >= 0:
            return f"the power of '{name}' depends on temperature"
    return ""
