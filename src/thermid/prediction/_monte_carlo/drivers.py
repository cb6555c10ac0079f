"""Which of the things that are not known drives a result: from the members of an ensemble themselves, or by Sobol's indices."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from thermid.base.arguments import takes_objects
from thermid.base.errors import MissingExtraError, NameNotFoundError, ScenarioError, refuse_unknown
from thermid.base.extensions import missing
from thermid.base.linear_algebra import Array
from thermid.prediction._monte_carlo.chunks import Job, run_members_of
from thermid.simulation.runs import KeptTasks, Workers, in_tasks

MIN_MEMBERS_PER_INPUT = 30
"""Members per input below which shares are not distinguishable from chance. [-]"""

UNORDERED = ("scenario", "start_time", "scenario and start_time")
"""Inputs that are one of several things, none of which is more than another."""


@dataclass(frozen=True)
class Driver:
    """How much one input, or one fit, has to do with a result.

    Parameters
    ----------
    name : str          The input; ``scenario`` and ``start_time`` are which of them was drawn.
    share : float       Of the variance of the result's rank; those of all inputs add up to what a line through the ranks explains. [-]
    direction : float   Rank correlation: positive where more of it makes the result larger; zero for ``scenario``, which has no order. [-]
    """

    name: str
    share: float
    direction: float


def drivers_of(draws: Mapping[str, Array], result: Array) -> tuple[Driver, ...]:
    """Return the drivers of a result (members,), the largest first; empty where there are too few members or nothing varies.

    The share of an input is its standardised coefficient in a regression of ranks times its rank correlation with the result (Pratt 1987;
    Thomas, Hughes and Zumbo, Social Indicators Research 45, 1998): also for correlated inputs these add up to R squared.
    """
    # inputs that share a value count once
    named: dict[bytes, tuple[str, Array]] = {}
    for name, values in draws.items():
        named.setdefault(values.tobytes(), (name, values))
    inputs = [(n, v) for n, v in named.values() if np.ptp(v) > 0.0]
    if not inputs or np.ptp(result) == 0.0 or result.size < max(MIN_MEMBERS_PER_INPUT, 5 * len(inputs)):
        return ()
    target = _standard(_ranks(result))
    columns = np.column_stack([_standard(_by_group(v, target) if n in UNORDERED else _ranks(v)) for n, v in inputs])
    weights, *_ = np.linalg.lstsq(columns, target, rcond=None)
    single = columns.T @ target / target.size
    drivers = [Driver(n, float(w * r), 0.0 if n in UNORDERED else float(r)) for (n, _), w, r in zip(inputs, weights, single, strict=True)]
    return tuple(sorted(drivers, key=lambda d: -d.share))


def _ranks(values: Array) -> Array:
    """Return the ranks from 1 (members,); equal values have the mean of theirs."""
    _, index, counts = np.unique(values, return_inverse=True, return_counts=True)
    ends = np.cumsum(counts)
    return np.asarray((ends - 0.5 * (counts - 1))[index], dtype=float)


def _by_group(values: Array, target: Array) -> Array:
    """Return the mean of the result over the members of the same group: what an input without order can say."""
    _, index = np.unique(values, return_inverse=True)
    return np.asarray((np.bincount(index, target) / np.bincount(index))[index])


def _standard(values: Array) -> Array:
    """Return values with mean 0 and standard deviation 1; zeros where all are equal."""
    spread = values.std()
    return np.asarray((values - values.mean()) / spread) if spread > 0 else np.zeros(values.shape)


@dataclass(frozen=True)
class Sobol:
    """Sobol's indices of one temperature.

    Parameters
    ----------
    node : str          Whose temperature.
    time : float        When; NaN for the highest of the run. [s]
    first, total : dict Input or fit -> share of the variance that it makes by itself; with all that it does together with others. [-]
    errors : dict       Input or fit -> half width of the 95 % interval of the total. [-]
    runs : int          How many it took.
    """

    node: str
    time: float
    first: Mapping[str, float]
    total: Mapping[str, float]
    errors: Mapping[str, float]
    runs: int

    def __str__(self) -> str:
        """The indices as a table, the largest first."""
        width = max(map(len, self.total))
        lines = [f"{self.node}: shares of variance, {self.runs} runs"]
        lines += [
            f"  {n:<{width}}  alone {self.first[n]:.2f}   in all {self.total[n]:.2f} +- {self.errors[n]:.2f}"
            for n in sorted(self.total, key=lambda n: -self.total[n])
        ]
        return "\n".join(lines)


@takes_objects
def sobol_of(
    job: Job,
    node: str,
    time: float | None = None,
    *,
    base: int = 512,
    executor: Workers = None,
    folder: str | os.PathLike[str] | None = None,
) -> Sobol:
    """Return Sobol's indices of a temperature with respect to everything that a job draws; values that a fit left open count as one group.

    Saltelli's design and estimators (Computer Physics Communications 181, 2010), by SALib.

    Parameters
    ----------
    job : Job       Of `plan_runs`, or of an `UncertainRuns`.
    node : str      One of the nodes that are kept.
    time : float    When; the highest of the run when not given. [s]
    base : int      A power of two; the runs are this times the groups and two.
    executor, folder        As in `uncertain_runs`.

    Raises
    ------
    NameNotFoundError   When the node is not kept.
    ScenarioError       When fewer than two things are drawn, `base` is no power of two, or members fail.
    """
    try:
        from SALib.analyze import sobol as analysis
        from SALib.sample import sobol as design
    except ImportError as error:
        raise MissingExtraError(missing(["SALib"], "an analysis of the spread")) from error
    path = job.model.canonical(node)
    refuse_unknown([path], job.nodes, job.model.title, f"'{node}' was not stored. Name it in 'nodes'.", NameNotFoundError)
    groups = _groups(job)
    names = list(dict.fromkeys(groups))
    if len(names) < 2:
        raise ScenarioError("Sobol's indices need at least two uncertain inputs.", job.model.title, code="value.outside-range")
    if base < 2 or base & (base - 1):
        raise ScenarioError(f"the base of the design must be a power of two, not {base}.", job.model.title, code="value.outside-range")
    half = 0.5**32  # a normal has no value at 0 or 1
    problem: dict[str, Any] = {
        "num_vars": len(groups),
        "names": [s.name for s in job.budget.sources],
        "groups": list(groups),
        "bounds": [[half, 1.0 - half]] * len(groups),
    }
    numbers = np.asarray(design.sample(problem, base, calc_second_order=False, seed=job.seed)).T
    tasks = [(f"run {k} of the design", (job, numbers[:, k : k + job.chunk], path, time)) for k in range(0, numbers.shape[1], job.chunk)]
    temperatures = dict(in_tasks(_temperature_of, tasks, KeptTasks.of_workers(executor, folder)))
    result = np.concatenate([temperatures[k] for k in range(len(temperatures))])
    indices = analysis.analyze(problem, result, calc_second_order=False, seed=job.seed)
    first, total, errors = ({n: float(x) for n, x in zip(names, indices[k], strict=True)} for k in ("S1", "ST", "ST_conf"))
    return Sobol(path, float("nan") if time is None else time, first, total, errors, numbers.shape[1])


def _temperature_of(job: Job, numbers: Array, node: str, time: float | None) -> Array:
    """Return the temperature (members,) of a node at a time, or its highest where none is given; nothing else of the members is kept. [K]

    Raises
    ------
    ScenarioError   When a member fails.
    """
    part = run_members_of(job, numbers)
    if part.failed:
        raise ScenarioError(f"a run of the design failed: {next(iter(part.failed.values()))}", job.model.title, code="run.members-failed")
    if time is None:
        return part.highest(job.nodes, node)
    return np.array([np.interp(time, job.times, row) for row in part.temperatures[:, job.nodes.index(node)]])


def _groups(job: Job) -> Sequence[str]:
    """Return the group of every stream."""
    budget = job.budget
    return [s.name if s.kind == "stated" and cause == "stated" else cause for s, cause in zip(budget.sources, budget.causes, strict=True)]
