"""An experiment wired to the kernel, with the names that are free in it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from thermid.dual import Dual, Number, gradient_of, value_of
from thermid.fit.problem.experiment import Experiment
from thermid.memo import Memo
from thermid.simulation.solver.engine import Engine, Options
from thermid.simulation.solver.squares import Squares, Weighing
from thermid.simulation.solver.traces import Traces, kept_for
from thermid.simulation.solver.wiring import Wiring

Array = NDArray[np.float64]
KEPT = 32
"""Benches of one experiment that are kept: a search for a second clock asks for many."""


@dataclass(frozen=True, eq=False)
class Bench:
    """An experiment wired to the kernel, with the names that are free in it."""

    experiment: Experiment
    free: tuple[str, ...]
    wiring: Wiring
    engine: Engine
    memo: Memo = field(init=False, default_factory=Memo, compare=False, repr=False)

    @classmethod
    def of(cls, experiment: Experiment, free: Sequence[str], at: tuple[float, float] | None = None) -> Bench:
        """Return the bench of an experiment, made once, with its second clock at an offset [s] and rate other than its own if asked."""

        def made() -> Bench:
            moved = experiment if at is None or experiment.ticks is None else experiment.ticks.moved(experiment, at)
            wiring = Wiring(moved.network, moved.scenario, free)
            return cls(moved, tuple(free), wiring, Engine(wiring))

        return experiment.memo.made((tuple(free), at), made, KEPT)

    def temperatures(
        self, x: Array, gradients: bool, options: Options, times: Array | None = None, *, from_rest: bool = False
    ) -> tuple[Array, Array]:
        """Return observed temperatures (times, sensors) [K] and their derivatives (times, sensors, free), empty when not asked for.

        `times` are the experiment's own where none are given [s]; `from_rest` holds the start while the free names change.
        """
        wanted = self.experiment.times if times is None else times
        assembled = self.engine.started(self.wiring.assemble(x, gradients), gradients)
        if from_rest:
            assembled = replace(assembled, initial_gradient=np.zeros_like(assembled.initial_gradient))
        nodes = tuple(o.node for o in self.experiment.observations)
        kept = kept_for(assembled, nodes)
        duration = max(self.experiment.scenario.seconds, float(self.experiment.times[-1]))
        stepped = replace(options, method="integrator")  # as least squares are, so that traces and statistics agree
        answer = self.engine.integrate(assembled, wanted, kept, duration, stepped, gradients and bool(self.free))
        traces = Traces(self.wiring, assembled, wanted, kept, answer.temperatures, answer.sensitivities)
        columns = np.column_stack([traces.temperature(n) for n in nodes])
        derivatives = np.stack([traces.slope(n) for n in nodes], axis=1) if gradients else np.zeros((0, 0, 0))
        for k, place, about in self.scales():
            if gradients:
                derivatives[:, k, :] *= 1.0 + x[place]
                derivatives[:, k, place] += columns[:, k] - about
            columns[:, k] += x[place] * (columns[:, k] - about)
        return columns, derivatives

    def scales(self) -> list[tuple[int, int, float]]:
        """Return, of every sensor whose scale is looked for, its column, the place of its error in the free names, where it turns [K]."""
        place = {name: n for n, name in enumerate(self.free)}
        seen = enumerate(self.experiment.observations)
        return [(k, place[f"reading.{o.sensor}"], o.part.gain_about) for k, o in seen if o.part and f"reading.{o.sensor}" in place]

    def squares(self, x: Array, gradients: bool, options: Options, weighing: Weighing, mesh: Array | None) -> Squares:
        """Return the least squares of all observations."""
        assembled = self.engine.started(self.wiring.assemble(x, gradients), gradients)
        seen, times = self.experiment.observations, self.experiment.times
        recover = dict(assembled.reduced.recover)
        parts = [_parts(o.node, recover) for o in seen]
        size = len(self.free) if gradients else 0
        scaled = [False] * len(seen)
        for k, place, _ in self.scales():
            one = Dual(1.0 + x[place], np.eye(size)[place]) if gradients else 1.0 + x[place]
            parts[k], scaled[k] = {node: one * weight for node, weight in parts[k].items()}, True
        readings = self.memo.made(
            "readings",
            lambda: self.engine.readings(times, [tuple(p) for p in parts], [o.index for o in seen], [o.measured for o in seen], scaled),
        )
        numbers = [number for p in parts for number in p.values()]
        weights = np.array([value_of(n) for n in numbers]), np.array([gradient_of(n, size) for n in numbers]).reshape(len(numbers), size)
        duration = max(self.experiment.scenario.seconds, float(times[-1]))
        return self.engine.least_squares(assembled, readings, weights, weighing, duration, options, gradients, mesh)


def _parts(node: str, recover: Mapping[str, Mapping[str, Number]]) -> dict[str, Number]:
    """Return what an observed node is the sum of: itself, or the neighbours of a node that was eliminated, with their weights."""
    if node not in recover:
        return {node: 1.0}
    out: dict[str, Number] = {}
    for neighbour, weight in recover[node].items():
        for name, share in _parts(neighbour, recover).items():
            out[name] = out[name] + weight * share if name in out else weight * share
    return out
