"""Sobol's indices of a temperature: which of the things that are not known makes its variance, also where effects do not add up."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from thermid.base.errors import MissingExtraError, NameNotFoundError, ScenarioError, missing, refuse_unknown
from thermid.base.units import Array
from thermid.prediction._monte_carlo.chunks import Job, run_members_of
from thermid.simulation.runs import Workers, in_tasks


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


def sobol_of(
    job: Job,
    node: str,
    time: float | None = None,
    *,
    base: int = 512,
    executor: Workers = None,
) -> Sobol:
    """Return Sobol's indices of a temperature with respect to everything that a job draws; values that a fit left open count as one group.

    Saltelli's design and estimators (Computer Physics Communications 181, 2010), by SALib.

    Parameters
    ----------
    job : Job       Of `plan_runs`, or of an `UncertainRuns`.
    node : str      One of the nodes that are kept.
    time : float    When; the highest of the run when not given. [s]
    base : int      A power of two; the runs are this times the groups and two.
    executor                As in `uncertain_runs`.

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
    budget = job.budget
    groups = [s.name if s.kind == "stated" and c == "stated" else c for s, c in zip(budget.sources, budget.causes, strict=True)]
    names = list(dict.fromkeys(groups))
    if len(names) < 2:
        raise ScenarioError("Sobol's indices need at least two uncertain inputs.", job.model.title, code="value.outside-range")
    if base < 2 or base & (base - 1):
        raise ScenarioError(f"the base of the design must be a power of two, not {base}.", job.model.title, code="value.outside-range")
    half = 0.5**32  # a normal has no value at 0 or 1
    problem: dict[str, Any] = {
        "num_vars": len(groups),
        "names": [s.name for s in budget.sources],
        "groups": groups,
        "bounds": [[half, 1.0 - half]] * len(groups),
    }
    numbers = np.asarray(design.sample(problem, base, calc_second_order=False, seed=job.seed)).T
    tasks = [(f"run {k} of the design", (job, numbers[:, k : k + job.chunk], path, time)) for k in range(0, numbers.shape[1], job.chunk)]
    temperatures = dict(in_tasks(_temperature_of, tasks, executor))
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
