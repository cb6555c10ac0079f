"""Noise of logged boundaries and powers: what it does to the residuals of a fit, and so to the values found."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from thermid.fit.problem.experiment import SCALE, Experiment, InputNoise
from thermid.fit.problem.residuals import Bench, Problem
from thermid.fit.uncertainty.rounding import shared_rounding
from thermid.fit.uncertainty.stretches import Binned
from thermid.linear_algebra import Array, Indices
from thermid.measure.record.scatter import unrounded
from thermid.model.laws.signal import Constant, Signal, TableSignal
from thermid.model.tree.flat import FlatLoad

STRETCHES = 80
"""A logged signal is looked at in so many stretches of time, in which its noise averages out as in independent samples."""


def answers_to_inputs(problem: Problem, fitted: Array, pieces: Mapping[tuple[str, str], Binned]) -> dict[tuple[str, str], Array]:
    """Return (record, sensor) -> what a standard deviation of each independent cause does to its residuals (stretches, causes).

    Noise n_k of sample k of a signal moves the predicted readings by h_k n_k, all of one cause. The h of a stretch of samples is the
    difference of two answers of the readings to a step of the signal, one begun where the stretch begins and one where it ends; the answer
    to a step is taken from the sensitivity to a constant shift of the signal, with the start held: one run for all stretches, exact where
    coefficients do not change. The shift of a power is a further load of zero size. The causes of the sensors of one record are the same.

    Parameters
    ----------
    problem : Problem
    fitted : array (unknowns,)    The end of the fit, in the fitted form.
    pieces : dict                 (record, sensor) -> its derivatives in stretches of time, see `autocorrelation`.

    Raises
    ------
    SolverError   When a record cannot be run.
    """
    out: dict[tuple[str, str], Array] = {}
    for i, experiment in enumerate(problem.experiments):
        noisy = {p: sd for p, sd in experiment.noisy.items() if isinstance(_signal(experiment, p), TableSignal)}
        if not problem.unknowns or not (noisy or (experiment.ticks is not None and experiment.ticks.sampled)):
            continue
        keys = [(experiment.record.name, o.sensor) for o in experiment.observations]
        causes: dict[tuple[str, str], list[Array]] = {key: [] for key in keys}
        for change in _instants(problem, i, fitted):
            for k, (key, o) in enumerate(zip(keys, experiment.observations, strict=True)):
                causes[key].append(change(pieces[key].times)[:, [k]] / o.sigma(problem.noise))
        for path, signal, answers in _answers(problem, i, fitted, list(noisy), [pieces[key].times for key in keys]) if noisy else ():
            begin, end = float(experiment.times[0]), float(experiment.times[-1])
            within = (signal.instants >= begin) & (signal.instants <= end)
            times = signal.instants[within]
            if times.size < 2:
                continue
            edges = np.linspace(begin, end, min(STRETCHES, times.size) + 1)
            place = np.clip(np.searchsorted(edges, times, side="right") - 1, 0, edges.size - 2)
            errors = _errors_of_means(noisy[path], times, np.asarray(signal.levels)[within], place, edges.size - 1)
            for key, o, step in zip(keys, experiment.observations, answers, strict=True):
                after = np.array([step(pieces[key].times - edge) for edge in edges])
                causes[key].append((after[:-1] - after[1:]).T @ errors / o.sigma(problem.noise))
        out |= {key: np.concatenate(several, axis=1) for key, several in causes.items() if several}
    return out


CHANGES = 20
"""The largest changes of a sampled power whose instants are followed; what small ones do is small."""


def _instants(problem: Problem, i: int, fitted: Array) -> Iterator[Callable[[Array], Array]]:
    """Yield, of each large change of a sampled power on a second clock, what a standard deviation of its instant does to the readings.

    Each yielded function takes times (times,) [s] and returns (times, sensors) [K]. A change lies anywhere between two samples: a standard
    deviation is the interval over the root of 12.
    """
    bench = problem.bench(i, fitted)
    experiment, values = bench.experiment, problem.inputs(i, fitted)[0]
    if experiment.ticks is None:
        return
    width = experiment.ticks.clock.step * experiment.ticks.at[1]
    for name, path in experiment.ticks.driven:
        table = getattr(experiment.scenario, name)[path]
        if path not in experiment.ticks.sampled or not isinstance(table, TableSignal):
            continue
        for k in table.largest_changes(CHANGES):

            def answer(times: Array, k: int = k, name: str = name, path: str = path, table: TableSignal = table) -> Array:
                sides = []
                for side in (-0.2, 0.2):
                    changed = {name: {**getattr(experiment.scenario, name), path: table.delayed(k, side * width)}}
                    other = replace(experiment, scenario=experiment.scenario.with_(**changed))
                    sides.append(Bench.of(other, bench.free).temperatures(values, False, problem.options, times)[0])
                return np.asarray((sides[1] - sides[0]) / (0.4 * np.sqrt(12.0)))

            yield answer


def _errors_of_means(noise: InputNoise, times: Array, values: Array, place: Indices, size: int) -> Array:
    """Return a root (stretches, causes) of the covariance of the errors of a signal's means over stretches. [K, W]"""
    count = np.bincount(place, minlength=size)
    full = np.flatnonzero(count)
    white = np.zeros((size, full.size))
    white[full, np.arange(full.size)] = noise.white / np.sqrt(count[full])
    if not noise.step or noise.white >= noise.step:
        return white
    shared, _ = shared_rounding(unrounded(times, values), noise.step, noise.white, place, size)
    return np.concatenate([white, shared / np.maximum(count, 1)[:, None]], axis=1)


def score_of_inputs(pieces: Mapping[tuple[str, str], Binned], inputs: Mapping[tuple[str, str], Array]) -> Array:
    """Return what the noise of logged boundaries and powers adds to the covariance of J'r (unknowns, unknowns).

    A cause that moves the residuals by h moves J'r by J'h, summed over the sensors of its record: covariance ``sum (J'h) (J'h)'``.
    """
    size = next((b.slopes.shape[1] for b in pieces.values()), 0)
    moved: dict[str, Array] = {}
    for (record, sensor), causes in inputs.items():
        b = pieces[record, sensor]
        moved[record] = moved.get(record, 0.0) + (b.count[:, None] * b.slopes).T @ causes
    return sum((m @ m.T for m in moved.values()), np.zeros((size, size)))


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
) -> Iterator[tuple[str, TableSignal, list[_Step]]]:
    """Yield every signal by its path with the answer of each sensor to a step of it."""
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
        assert isinstance(signal, TableSignal)
        place = bench.free.index(name)
        yield path, signal, [_Step(since[late], slopes[late, k, place]) for k in range(slopes.shape[1])]


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
