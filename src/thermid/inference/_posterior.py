"""Posterior samples: what the data say of a fit's unknowns without the assumption of a quadratic valley."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.base.errors import IdentificationError, NameNotFoundError, SolverError, optional, refuse_unknown
from thermid.base.linear_algebra import covariance
from thermid.base.results import Result, Row
from thermid.base.units import HALF_WIDTH_95, Array
from thermid.fit.calibration import Calibration, Compressed, Problem, box_of
from thermid.simulation.runs import KeptTasks, Workers, in_tasks, shares_of

MIN_LENGTH = 50
"""A chain is long enough when it holds this many of its autocorrelation times (Foreman-Mackey and others, PASP 125 (2013) 306)."""


EXTENSION = 16
"""Times the steps asked for to which chains that are not long enough are run on."""
INDEPENDENT_STEP_SHARE = 0.7
"""Share of the steps whose proposals are drawn by the covariance of the fit; any share gives the same law, the others serve curved valleys.

[-]
"""
TAIL_DEGREES_OF_FREEDOM = 6
"""Degrees of freedom of these."""


@dataclass(frozen=True, eq=False)
class Posterior(Result):
    """Values that the data and the priors allow, as often as they allow them.

    Parameters
    ----------
    stage : str                     Of the fit.
    draws : dict                    Parameter -> value of every draw (draws,), as `ensemble` takes them. [SI]
    independent : float             How many independent draws they are worth.
    acceptance : float              Share of the steps that were taken; 0.2 to 0.5 is usual. [-]
    evaluations : int               How often the records were simulated.
    fitted : dict                   Parameter -> (value, standard error) of the fit. [SI]
    warnings : tuple of str         What a reader must know.
    """

    stage: str
    draws: Mapping[str, Array]
    independent: float
    acceptance: float
    evaluations: int
    fitted: Mapping[str, tuple[float, float]]
    warnings: tuple[str, ...] = ()

    def interval(self, path: str, share: float = 0.95) -> tuple[float, float]:
        """Return the interval that holds a share of the draws, quantiles (1 - share) / 2 and (1 + share) / 2. [SI]

        Raises
        ------
        NameNotFoundError   With the nearest name.
        ScenarioError       When the share does not lie between 0 and 1.
        """
        refuse_unknown([path], self.draws, self.stage, "'{}' was not sampled.", NameNotFoundError)
        inside = float(shares_of(share, self.stage))
        low, high = np.quantile(self.draws[path], [(1.0 - inside) / 2.0, (1.0 + inside) / 2.0])
        return float(low), float(high)

    def __str__(self) -> str:
        """Return median and 95 % interval of each parameter, beside the fit's."""
        size = len(next(iter(self.draws.values())))
        lines = [f"{self.stage}: {size} draws, effective sample size {self.independent:.0f}; {self.evaluations} evaluations [SI]"]
        width = max(map(len, self.draws))
        for path, values in self.draws.items():
            low, high = self.interval(path)
            value, error = self.fitted[path]
            lines.append(
                f"  {path:<{width}}  median {np.median(values):.5g}   95 % {low:.5g} .. {high:.5g}   (fit {value:.5g}, "
                f"{value - HALF_WIDTH_95 * error:.5g} .. {value + HALF_WIDTH_95 * error:.5g})"
            )
        return "\n".join([*lines, *(f"  warning: {w}" for w in self.warnings)])

    def _as_rows(self) -> list[Row]:
        """Return every parameter with mean, standard deviation and 95 % interval. [SI]"""
        return [
            {"path": p, "mean": float(d.mean()), "error": float(d.std()), "low": self.interval(p)[0], "high": self.interval(p)[1]}
            for p, d in self.draws.items()
        ]


def posterior(
    fit: Calibration,
    *,
    steps: int = 1000,
    walkers: int = 0,
    seed: int = 1,
    executor: Workers = None,
    progress: Callable[[int, int], None] | None = None,
) -> Posterior:
    """Return draws of a fit's parameters, everything else that it looked for taken along.

    Constant errors and temperatures of single records, in which readings are linear or nearly so, are not sampled: at each step they take
    their best values, and the width that their priors leave is counted (the Laplace form of the integral over them; Tierney and Kadane,
    J. Am. Stat. Assoc. 81 (1986) 82). Noise counts as in the errors of the fit: residuals that wander, readings in steps, noise of logged
    inputs and fixed values with an error widen the draws by stretching the distance to the best values, so that near them the draws scatter
    by the covariance of the fit, while the shape of the valley stays (curvature adjustment: Ribatet, Cooley, Davison, Statistica Sinica 22
    (2012) 813). Needs the package emcee: ``pip install thermid[bayes]``.

    Most proposals are drawn anew by the fit's covariance (independence chain: Tierney, Ann. Stat. 22 (1994) 1701), so that where the valley
    is nearly quadratic a draw owes little to the one before; the others are stretches between walkers, for valleys that are not. Chains run
    on until they are 50 of their autocorrelation times long: intervals of shorter ones are too narrow along a curved ridge.

    Parameters
    ----------
    fit : Calibration
    steps : int         Of every walker at first, up to 16 times as many where these are too few; the first fifth is left out. A step
                        simulates all records once for each walker.
    walkers : int       Two more than twice the parameters, and at least 12, by default.
    seed : int
    executor            Who simulates the records at the proposals of one step, as in `ensemble`: the same draws from all. It pays where one
                        simulation takes a tenth of a second or more. Proposals are too many to be kept in a folder.
    progress : callable Called after each step with how many are done, and how many are thought to be needed.

    Raises
    ------
    IdentificationError   When emcee is missing, nothing was free, the calibration was read from a file, or the chains stay too short; the
                          message names the direction along which they are slow.
    """
    emcee = optional("emcee", "a posterior")
    density = _Density.of_fit(fit).stretched(fit)
    size = len(density.at)
    count = walkers or max(12, 2 * size + 2)
    rng = np.random.default_rng(seed)
    near = _FitProposals(density.rest[density.at], np.asarray(np.linalg.cholesky(density.widths(fit)), dtype=float))
    start = near.middle + rng.standard_normal((count, size)) @ near.root.T
    start = np.clip(start, density.box[:, 0], density.box[:, 1])
    moves = [(emcee.moves.MHMove(near), INDEPENDENT_STEP_SHARE), (emcee.moves.StretchMove(), 1.0 - INDEPENDENT_STEP_SHARE)]
    sampler = emcee.EnsembleSampler(
        count, size, _Several(density, KeptTasks.of_workers(executor).workers, steps * count), moves=moves, vectorize=True
    )
    sampler.random_state = np.random.RandomState(seed).get_state()  # the kind of state that emcee takes
    names = [density.problem.unknowns[k] for k in density.at]
    chain, lag = _long_enough(sampler, start, steps, [u.name for u in names], fit.stage, progress or (lambda done, needed: None))
    draws = {u.name: np.array([u.to_value(x) for x in chain[:, n]]) for n, u in enumerate(names)}
    fitted_values = {u.name: (fit.values[u.name].value, fit.values[u.name].error) for u in names}
    independent, taken = chain.shape[0] / max(lag, 1.0), float(np.mean(sampler.acceptance_fraction))
    return Posterior(fit.stage, draws, independent, taken, density.count, fitted_values, density.remarks())


def _long_enough(
    sampler: Any, start: Array, steps: int, names: Sequence[str], stage: str, progress: Callable[[int, int], None]
) -> tuple[Array, float]:
    """Return draws (draws, parameters) of chains that are long enough, fitted form, and their longest autocorrelation time in steps.

    Long enough are chains of more than `MIN_LENGTH` of those times after their first fifth, which begins where the fit stands; they are
    continued until they are.

    Parameters
    ----------
    start                       Where the walkers begin.
    steps : int                 How many are made at first.
    progress : callable         Gets how many are made, and how many are needed.

    Raises
    ------
    IdentificationError   When they are not after `EXTENSION` times the steps.
    """
    emcee, begin, needed = optional("emcee", "a posterior"), start, steps
    while True:
        for end in sampler.sample(begin, iterations=needed - sampler.iteration):
            begin = end
            progress(sampler.iteration, needed)
        done = sampler.iteration
        # walkers begin at the covariance of the fit and not at the density itself
        chain = sampler.get_chain(discard=done // 5)
        lags = np.asarray(emcee.autocorr.integrated_time(chain, quiet=True, tol=0), dtype=float)
        length = float(chain.shape[0] / lags.max())
        if length > MIN_LENGTH:
            return np.asarray(chain.reshape(-1, chain.shape[2])), float(lags.max())
        if done >= EXTENSION * steps:
            raise IdentificationError(_too_short(chain, names, done, length), stage, code="fit.chains-too-short")
        # a fifth more than what this autocorrelation time asks for, which short chains show too small; twice as many at most
        needed = min(math.ceil(1.2 * done * MIN_LENGTH / length), 2 * done, EXTENSION * steps)


def _too_short(chain: Array, names: Sequence[str], steps: int, length: float) -> str:
    """Return the refusal of chains that are slow, with the direction along which they are: the longest axis of the draws."""
    axis = np.linalg.eigh(np.atleast_2d(np.corrcoef(chain.reshape(-1, chain.shape[2]).T)))[1][:, -1]
    axis = axis * np.sign(axis[int(np.argmax(np.abs(axis)))])
    along = ", ".join(
        f"'{names[k]}' {'up' if axis[k] > 0 else 'down'}" for k in np.argsort(-np.abs(axis)) if abs(axis[k]) > 0.3 * np.abs(axis).max()
    )
    return (
        f"after {steps} steps the chains are {length:.0f} autocorrelation times long and {MIN_LENGTH} are needed, so no interval is given. "
        f"They move slowly along {along}. Give more steps, a prior of one of these, or a record in which they act differently; "
        "td.inference.profile follows each of them."
    )


@dataclass(frozen=True, eq=False)
class _FitProposals:
    """Proposals by the covariance of a fit, whatever came before: Student's distribution, whose tails are wider than the posterior's.

    Parameters
    ----------
    middle : array (parameters,)                Best values, in the fitted form.
    root : array (parameters, parameters)       A root of the covariance.
    """

    middle: Array
    root: Array

    def log(self, points: Array) -> Array:
        """Return ln of the density at points (points, parameters), fitted form, up to a constant: Student's t about the fit. [-]"""
        square = np.sum(np.linalg.solve(self.root, (points - self.middle).T) ** 2, axis=0)
        return np.asarray(-0.5 * (TAIL_DEGREES_OF_FREEDOM + self.middle.size) * np.log1p(square / TAIL_DEGREES_OF_FREEDOM))

    def __call__(self, points: Array, random: np.random.RandomState) -> tuple[Array, Array]:
        """Return new points (points, parameters) of Student's t about the fit, fitted form, and ln(q(old) / q(new)) (points,). [-]"""
        wide = np.sqrt(TAIL_DEGREES_OF_FREEDOM / random.chisquare(TAIL_DEGREES_OF_FREEDOM, size=(points.shape[0], 1)))
        new = self.middle + (wide * random.standard_normal(points.shape)) @ self.root.T
        return new, self.log(points) - self.log(new)


@dataclass(eq=False)
class _Several:
    """A density at several points at once, by workers.

    Parameters
    ----------
    density : _Density
    executor : see `Workers`
    ahead : int         Points that are to come, to say whether workers pay.
    pace : float        What a point took, the least seen. [s]
    """

    density: _Density
    executor: Workers
    ahead: int
    pace: float = math.inf

    def __call__(self, points: Array) -> Array:
        """Return ln of the density (points,) up to a constant at values (points, parameters), fitted form; the executor shares them. [-]"""
        if self.executor is None or math.isinf(self.pace):
            begun = time.process_time()
            out = np.array([self.density(p) for p in points])
            self.pace = min(self.pace, (time.process_time() - begun) / len(points))
            return out
        pieces = np.array_split(points, min(self.executor, len(points)) if isinstance(self.executor, int) else len(points))
        calls = [(f"proposal {k + 1} of a step", (self.density, piece)) for k, piece in enumerate(pieces)]
        values_by_chunk = dict(in_tasks(_at_points, calls, self.executor, seconds=self.pace * self.ahead))
        self.density.count += sum(self.density.inside(p) for p in points)
        return np.concatenate([values_by_chunk[k] for k in range(len(values_by_chunk))])


def _at_points(density: _Density, points: Array) -> Array:
    """Return a density (points,) at values (points, parameters); a task of a worker."""
    return np.array([replace(density)(p) for p in points])


@dataclass(eq=False)
class _Density:
    """Logarithm of the density of parameters given the data, all other unknowns integrated out, but for a constant.

    Parameters
    ----------
    problem : Problem
    at : array (parameters,)            Positions of the parameters among the unknowns.
    box : array (parameters, 2)         Bounds, in the fitted form; the density is zero outside.
    rest : array (unknowns,)            Best values of all unknowns, in the fitted form.
    level : float                       Factor on the variance of the readings. [-]
    count : int                         Evaluations so far.
    stretch : array or None             Matrix A (parameters, parameters): the density at x is taken at ``best + A (x - best)``.
    """

    problem: Problem
    at: NDArray[np.int64]
    box: Array
    rest: Array
    level: float
    count: int = 0
    stretch: Array | None = None

    @classmethod
    def of_fit(cls, fit: Calibration) -> _Density:
        """Return the density of a fit's parameters without a stretch.

        Raises
        ------
        IdentificationError   When the fit has no records or no free parameter, or its loss is no likelihood.
        """
        problem = fit.problem
        if problem is None or fit.request is None:
            raise IdentificationError(
                "samples need a fit made in this session, because a values file has no records. Repeat the fit.",
                fit.stage,
                code="fit.needs-session",
            )
        if fit.request.loss != "linear":
            raise IdentificationError(
                "samples need the loss 'linear', because a robust loss is not a likelihood. Repeat the fit with it.",
                fit.stage,
                code="fit.not-possible",
            )
        at = np.array([k for k, u in enumerate(problem.unknowns) if u.kind == "parameter"], dtype=np.int64)
        if not at.size:
            raise IdentificationError("no parameter was free, so there is nothing to sample.", fit.stage, code="fit.nothing-free")
        box = np.array([box_of(problem.unknowns[k]) for k in at])
        end = np.array([fit.fitted[u.name] for u in problem.unknowns])
        return cls(problem, at, box, end, max(1.0, fit.reduced_chi_square))

    def stretched(self, fit: Calibration) -> _Density:
        """Return the density whose distance to the best values is stretched so that its width is that of the fit's errors.

        The distance is multiplied by the symmetric A with A S^-1 A = C^-1: S the covariance at the best values by readings, over the factor
        on their variances, and priors; C that of the fit (parameters, parameters), fitted form.
        """
        names = [self.problem.unknowns[k].name for k in self.at]
        wanted = fit.store.covariance(names)
        variance_factor = fit.autocorrelation.variance_factor if fit.autocorrelation is not None else 1.0
        compressed = self.problem.compressed(self.rest)
        rows = np.concatenate([compressed.slopes / math.sqrt(variance_factor), self.problem.prior_rows(self.rest)[1]])
        here = covariance(rows)[np.ix_(self.at, self.at)]
        if not (np.isfinite(here).all() and all(fit.store[n].known for n in names)):
            return replace(self, level=variance_factor)
        # the symmetric A with A here^-1 A = wanted^-1, in units of the errors
        scale = np.sqrt(np.diag(wanted))
        here, wanted = here / np.outer(scale, scale), wanted / np.outer(scale, scale)
        inner, outer = _root(here), _root(np.linalg.inv(here))
        stretch = inner @ _root(outer @ np.linalg.inv(wanted) @ outer) @ inner
        return replace(self, level=variance_factor, stretch=stretch * scale[:, None] / scale[None, :])

    def widths(self, fit: Calibration) -> Array:
        """Return the covariance (parameters, parameters) of proposals, fitted form: that of the fit, without a stretch its variances.

        Where an error is not finite, a quarter of the width of the box stands for it.
        """
        errors = self.errors(fit)
        if self.stretch is None:
            return np.diag(np.where(np.isfinite(errors), errors, np.ptp(self.box, axis=1) / 4.0) ** 2)
        whole = fit.store.covariance([self.problem.unknowns[k].name for k in self.at])
        return np.asarray(whole + 1e-9 * np.diag(np.diag(whole)))

    def remarks(self) -> tuple[str, ...]:
        """Return what a reader must know of the width of the draws."""
        if self.stretch is not None:
            return ()
        return ("the data do not limit the errors of the fit, so the draws include the noise of the readings only.",)

    def errors(self, fit: Calibration) -> Array:
        """Return the standard errors of the parameters, in the fitted form."""
        unknowns = [self.problem.unknowns[k] for k in self.at]
        return np.array([fit.values[u.name].error / u.slope(float(self.rest[k])) for k, u in zip(self.at, unknowns, strict=True)])

    def inside(self, point: Array) -> bool:
        """Return whether a point lies in the box."""
        return bool(((point >= self.box[:, 0]) & (point <= self.box[:, 1])).all())

    def __call__(self, point: Array) -> float:
        """Return ln of the density at `point` (parameters,), fitted form; minus infinity outside the box and where a run fails. [-]"""
        if not self.inside(point):
            return -np.inf
        x = self.rest.copy()
        best = x[self.at]
        x[self.at] = point if self.stretch is None else np.clip(best + self.stretch @ (point - best), self.box[:, 0], self.box[:, 1])
        self.count += 1
        try:
            compressed = self.problem.compressed(x)
        except SolverError:
            return -np.inf
        return self._marginal(x, compressed)

    def _marginal(self, x: Array, compressed: Compressed) -> float:
        """Return ``-|r|^2 / 2 + |J d|^2 / 2 - ln det(J'J) / 2`` [-] at `x` (unknowns,), J and the best step d of the other unknowns alone.

        r are weighted residuals, over the root of the `level` of their variance, and priors; the sum is ln p(x) up to a constant.
        """
        priors, prior_slopes = self.problem.prior_rows(x)
        scale = 1.0 / math.sqrt(self.level)
        rows = np.concatenate([compressed.rows * scale, priors])
        others = np.setdiff1d(np.arange(x.size), self.at)
        slopes = np.concatenate([compressed.slopes * scale, prior_slopes])[:, others]
        # Laplace: the integral of exp(-|r + J d|^2 / 2) over the others is exp(-|r|^2 / 2 + |J d*|^2 / 2) (2 pi)^(m/2) / sqrt(det J'J), d*
        # the least-squares step (Tierney and Kadane, JASA 81 (1986) 82)
        out = -0.5 * float(rows @ rows)
        if others.size:
            step, *_ = np.linalg.lstsq(slopes, -rows, rcond=None)
            out += 0.5 * float(np.sum((slopes @ step) ** 2))
            _, logdet = np.linalg.slogdet(slopes.T @ slopes)
            out -= 0.5 * float(logdet)
        return out


def _root(matrix: Array) -> Array:
    """Return the symmetric root R (n, n), ``R R = M``, of a symmetric matrix M (n, n); negative eigenvalues count as zero."""
    sizes, vectors = np.linalg.eigh(0.5 * (matrix + matrix.T))
    return np.asarray((vectors * np.sqrt(np.maximum(sizes, 0.0))) @ vectors.T)
