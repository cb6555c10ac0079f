"""What the logs of one unit say of its values, as a quadratic at its conditional mode; a task of a worker.

The mode of a unit is its fit with the population as prior (Lindstrom and Bates, Biometrics 46 (1990) 673). There its residuals are made
linear, values of single records and constant errors of sensors are integrated out, and noise counts as in the errors of any fit: what
wanders widens the score J'r from B to M, and the quadratic is that of Godambe's information, ``B M^-1 B`` with the score ``B M^-1 g``.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from thermid.base.errors import IdentificationError
from thermid.base.linear_algebra import Array, symmetric_inverse
from thermid.fit.calibration import minimise
from thermid.fit.problem import Problem, Request, Sums, Unknown, build_problem
from thermid.fit.uncertainty import autocorrelation

WIDE = 1.0
"""Standard deviation of the first prior, in typical changes of a value: before there is a population."""


@dataclass(frozen=True, eq=False)
class Unit:
    """One unit of a fleet: what is looked for in its logs.

    Parameters
    ----------
    name : str
    problem : Problem   Its residuals, without priors of the values of the fleet.
    values : tuple      Positions of these among the unknowns.
    loss : (str, float) As in a request.
    remarks : tuple of str
    """

    name: str
    problem: Problem
    values: tuple[int, ...]
    loss: tuple[str, float]
    remarks: tuple[str, ...] = ()

    @classmethod
    def of(cls, name: str, request: Request) -> Unit:
        """Return it.

        Raises
        ------
        IdentificationError   When nothing is free, or a second clock is.
        """
        problem = build_problem(request)
        values = tuple(k for k, u in enumerate(problem.unknowns) if u.kind == "parameter")
        if not values:
            raise IdentificationError("no parameter is free. Name those that differ between units in `free`.", name)
        if problem.clocked:
            raise IdentificationError("a record has a second clock that is looked for. Give its offset and rate.", name)
        known = [problem.unknowns[k].name for k in values if problem.unknowns[k].prior is not None]
        said = [f"priors of {', '.join(known)} were left out: the fleet gives them"] if known else []
        if problem.coupled:
            said.append("priors from stages below were left out: the fleet gives them")
        unknowns = tuple(replace(u, prior=None) if u.kind == "parameter" else u for u in problem.unknowns)
        return cls(name, replace(problem, unknowns=unknowns, coupled=()), values, (request.loss, request.loss_scale), tuple(said))

    @property
    def unknowns(self) -> list[Unknown]:
        """The values of the fleet."""
        return [self.problem.unknowns[k] for k in self.values]

    @property
    def seconds(self) -> float:
        """How long its logs are. [s]"""
        return sum(float(np.ptp(e.times)) for e in self.problem.experiments)

    @property
    def unstated(self) -> set[str]:
        """Sensors whose noise is not stated."""
        return {o.sensor for o in self.problem.observations() if o.noise is None}


@dataclass(frozen=True, eq=False)
class Said:
    """What a unit says at its mode.

    Parameters
    ----------
    at : array (unknowns,)                      The mode, in the fitted form.
    information : array (values, values)        H.
    score : array (values,)                     Derivative of its log-likelihood there.
    chi_square, freedom : float                 Of its readings, in units of their noise.
    white : bool                                Whether nothing wanders.
    sums : tuple                                Record, sensor, sums of residuals.
    converged : bool
    """

    at: Array
    information: Array
    score: Array
    chi_square: float
    freedom: float
    white: bool
    sums: tuple[tuple[str, str, Sums], ...]
    converged: bool


def read_unit(unit: Unit, start: Array | None, mean: Array, root: Array, noise: dict[str, float], level: float) -> Said:
    """Return what a unit says at its conditional mode.

    Parameters
    ----------
    start : array (unknowns,)           Where to begin, in the fitted form.
    mean, root : array                  Of the population (values,), and a root R of its information, ``R'R = Omega^-1``.
    noise : dict                        Sensor -> noise where none is stated. [K]
    level : float                       Variance of readings that do not wander, in squares of their noise, over the fleet.
    """
    at = np.array(unit.values, dtype=np.int64)
    bare = replace(unit.problem, noise={**unit.problem.noise, **noise})
    problem = replace(bare, coupled=((at, mean, root),))
    loss, knee = unit.loss
    found = minimise(problem, loss, knee, start)
    here = bare.compressed(found.fitted, loss, knee)
    spread = autocorrelation(problem, found, loss, knee)
    white = not spread.score_excess.any()
    factor = level if white else spread.variance_factor
    information, score = here.slopes.T @ here.slopes / factor, -here.slopes.T @ here.rows / factor
    whole = information + found.priors.T @ found.priors
    taken = float(np.trace(symmetric_inverse(whole) @ information))
    if not white:
        kept = information @ symmetric_inverse(information + spread.score_excess / factor**2)
        information, score = kept @ information, kept @ score
    rows, slopes = bare.prior_rows(found.fitted)
    information, score = information + slopes.T @ slopes, score - slopes.T @ rows
    others = np.setdiff1d(np.arange(len(score)), at)
    across = information[np.ix_(at, others)] @ symmetric_inverse(information[np.ix_(others, others)])
    own = information[np.ix_(at, at)] - across @ information[np.ix_(others, at)]
    freedom = problem.effective_samples - taken
    return Said(
        found.fitted,
        _upright(own),
        score[at] - across @ score[others],
        here.chi_square,
        freedom,
        white,
        here.sums,
        found.converged,
    )


def _upright(matrix: Array) -> Array:
    """Return a symmetric matrix without negative directions."""
    sizes, vectors = np.linalg.eigh(0.5 * (matrix + matrix.T))
    return np.asarray((vectors * np.maximum(sizes, 0.0)) @ vectors.T)
