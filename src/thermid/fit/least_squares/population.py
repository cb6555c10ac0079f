"""The cost of many sets of parameters at once, eight side by side in the kernel, without derivatives."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thermid.fit.problem.residuals import Problem
from thermid.fit.problem.statistics import loss_of
from thermid.fit.problem.unknowns import Unknown
from thermid.simulation.members import run_members

Array = NDArray[np.float64]
DECADE = math.log(10.0)


@dataclass(frozen=True, eq=False)
class Population:
    """The parameters of a problem over a box; all other unknowns (constant errors, temperatures of single records) stay at their start.

    Parameters
    ----------
    problem : Problem
    loss : str                  linear, soft_l1, huber or cauchy.
    knee : float                Residual, in units of the noise, from which the loss bends.
    at : array (parameters,)    Positions of the parameters among the unknowns.
    low, high : array           Corners of the box, in the fitted form.
    """

    problem: Problem
    loss: str
    knee: float
    at: NDArray[np.int64]
    low: Array
    high: Array

    @classmethod
    def of(cls, problem: Problem, loss: str, knee: float) -> Population:
        """Return the population of a problem."""
        at = np.array([k for k, u in enumerate(problem.unknowns) if u.kind == "parameter"], dtype=np.int64)
        corners = np.array([box_of(problem.unknowns[k]) for k in at]).reshape(-1, 2)
        return cls(problem, loss, knee, at, corners[:, 0], corners[:, 1])

    @property
    def start(self) -> Array:
        """The start of all unknowns (unknowns,), in the fitted form."""
        return np.array([u.to_fitted(u.start) for u in self.problem.unknowns])

    def placed(self, shares: Array) -> Array:
        """Return points of the unit cube (members, parameters) as values of all unknowns (members, unknowns), in the fitted form."""
        out = np.tile(self.start, (shares.shape[0], 1))
        out[:, self.at] = self.low + shares * (self.high - self.low)
        return out

    def share(self, fitted: Array) -> Array:
        """Return where values of all unknowns lie in the unit cube (parameters,)."""
        return np.asarray(np.clip((fitted[self.at] - self.low) / (self.high - self.low), 0.0, 1.0))

    def costs(self, shares: Array) -> Array:
        """Return half the weighted sum of squares (members,) at points of the unit cube, priors included; infinite where a run fails."""
        points = self.placed(shares)
        cost = np.array([float(r @ r) for r in (self.problem.prior_rows(p)[0] for p in points)])
        for i, bench in enumerate(self.problem.benches()):
            seen = bench.experiment.observations
            inputs = np.array([self.problem.inputs(i, p)[0] for p in points])
            draws = dict(zip(bench.free, inputs.T, strict=True))
            nodes = list(dict.fromkeys(o.node for o in seen))
            times, options = bench.experiment.times, self.problem.options
            found = run_members(bench.engine, draws, times, options, nodes, None, 1, "auto", ())
            for o in seen:
                bias, _ = self.problem._bias(o.sensor, points[0])
                residuals = (o.measured[:, None] - found.temperatures(o.node)[o.index] - bias) / o.sigma(self.problem.noise)
                cost += loss_of(residuals**2, self.loss, self.knee)[0].sum(axis=0)
        return np.where(np.isfinite(cost), 0.5 * cost, np.inf)


def box_of(unknown: Unknown) -> tuple[float, float]:
    """Return where an unknown is looked for, in its fitted form.

    Its bounds, cut at four standard deviations of its prior; where it has neither, a factor of ten either way of the start of a positive
    quantity, and twice a typical change of any other.
    """
    low, high = unknown.fitted_bounds()
    middle, reach = unknown.to_fitted(unknown.start), DECADE if unknown.log else 2.0 * unknown.scale
    if unknown.prior is not None:
        middle, reach = unknown.prior.mean, 4.0 * unknown.prior.sd
        low, high = max(low, middle - reach), min(high, middle + reach)
    low = low if math.isfinite(low) else min(middle - reach, high - reach)
    return low, high if math.isfinite(high) else max(middle + reach, low + reach)
