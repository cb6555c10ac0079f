"""What the random noise of logged boundaries and powers does to a fit: the model is driven by it, so it ends in the fitted values too."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from thermid.fit.problem.experiment import SCALE, Experiment
from thermid.fit.problem.residuals import Problem
from thermid.fit.problem.wired import Bench
from thermid.model.laws.signal import Constant, Signal, Table
from thermid.model.tree.flat import FlatLoad

if TYPE_CHECKING:
    from thermid.fit.uncertainty.wander import Binned

Array = NDArray[np.float64]

STRETCHES = 80
"""A logged signal is looked at in so many stretches of time, in which its noise averages out as in independent samples."""


def excess_of_inputs(problem: Problem, fitted: Array, pieces: Mapping[tuple[str, str], Binned]) -> Array:
    """Return what the noise of logged boundaries and powers adds to the covariance of J'r (unknowns, unknowns).

    Noise n_k of sample k of a signal moves the predicted readings by h_k n_k, all of one cause, so that J'r moves by the sum of
    g_k n_k with g_k = J'h_k / sigma: covariance ``sum sd^2 g_k g_k'``. The h of a stretch of samples is the difference of two answers of
    the readings to a step of the signal, one begun where the stretch begins and one where it ends; the answer to a step is taken from the
    sensitivity to a constant shift of the signal, with the start held: one run for all stretches, exact where coefficients do not change.
    The shift of a power is a further load of zero size.

    Parameters
    ----------
    problem : Problem
    fitted : array (unknowns,)    The end of the fit, in the fitted form.
    pieces : dict                 (record, sensor) -> its derivatives in stretches of time, see `wander`.

    Raises
    ------
    SolverError   When a record cannot be run.
    """
    size = len(problem.unknowns)
    out = np.zeros((size, size))
    for i, experiment in enumerate(problem.experiments):
        noisy = {p: sd for p, sd in experiment.noisy.items() if isinstance(_signal(experiment, p), Table)}
        if not noisy or not size:
            continue
        seen = [pieces[experiment.record.name, o.sensor] for o in experiment.observations]
        for path, times, answers in _answers(problem, i, fitted, list(noisy), [b.times for b in seen]):
            begin, end = float(experiment.times[0]), float(experiment.times[-1])
            times = times[(times >= begin) & (times <= end)]
            if times.size < 2:
                continue
            edges = np.linspace(begin, end, min(STRETCHES, times.size) + 1)
            count = np.bincount(np.clip(np.searchsorted(edges, times, side="right") - 1, 0, edges.size - 2), minlength=edges.size - 1)
            moved = np.zeros((edges.size - 1, size))
            for o, b, step in zip(experiment.observations, seen, answers, strict=True):
                after = [step(b.times - edge) for edge in edges]
                for k in range(edges.size - 1):
                    moved[k] += (b.count * (after[k] - after[k + 1]) / o.sigma(problem.noise)) @ b.slopes
            moved = moved[count > 0] / np.sqrt(count[count > 0])[:, None]
            out += noisy[path] ** 2 * moved.T @ moved
    return out


def _signal(experiment: Experiment, path: str) -> Signal | None:
    """Return the signal of a boundary, or of a power by the name of its scale."""
    load = path.removeprefix(SCALE)
    return experiment.scenario.loads.get(load) if load != path else experiment.scenario.boundaries.get(path)


class _Step:
    """The answer of a reading to a step of a boundary by 1 K or of a power by 1 W, at times since the step; zero before it. [K/K, K/W]"""

    def __init__(self, times: Array, answer: Array) -> None:
        self.times, self.answer = np.concatenate([[0.0], times]), np.concatenate([[0.0], answer])

    def __call__(self, since: Array) -> Array:
        return np.where(since > 0.0, np.interp(since, self.times, self.answer), 0.0)


def _answers(
    problem: Problem, i: int, fitted: Array, paths: Sequence[str], centres: Sequence[Array]
) -> Iterator[tuple[str, Array, list[_Step]]]:
    """Yield every signal with the times of its samples [s] and the answer of each sensor to a step of it."""
    given = problem.bench(i, fitted)
    values, _ = problem.inputs(i, fitted)
    experiment, named = _shifted(given.experiment, paths)
    more = [p for p in named if p not in given.free]
    bench = Bench.of(experiment, (*given.free, *more)) if more else given
    x = np.concatenate([values, np.zeros(len(more))])
    times = np.unique(np.concatenate(centres))
    _, slopes = bench.temperatures(x, True, problem.options, times, from_rest=True)
    since = times - float(given.experiment.times[0])
    late = since > 0.0
    for path, name in zip(paths, named, strict=True):
        signal = _signal(given.experiment, path)
        assert isinstance(signal, Table)
        place = bench.free.index(name)
        yield path, signal.instants, [_Step(since[late], slopes[late, k, place]) for k in range(slopes.shape[1])]


def _shifted(experiment: Experiment, paths: Sequence[str]) -> tuple[Experiment, list[str]]:
    """Return an experiment with a load of 1 W beside every logged power among some signals, and what is free to shift each signal."""
    network, scenario = experiment.network, experiment.scenario
    nodes = {load.path: load.node for load in network.flat.loads}
    beside = {p: f"noise {p.removeprefix(SCALE)}" for p in paths if p.startswith(SCALE)}
    if not beside:
        return experiment, list(paths)
    loads = [FlatLoad(name, node := nodes[p.removeprefix(SCALE)], node, {}) for p, name in beside.items()]
    flat = replace(network.flat, loads=(*network.flat.loads, *loads))
    scenario = scenario.with_(loads=dict.fromkeys(beside.values(), Constant(1.0)))
    made = replace(experiment, network=replace(network, flat=flat), scenario=scenario)
    return made, [SCALE + beside[p] if p in beside else p for p in paths]
