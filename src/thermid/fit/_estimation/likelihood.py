"""The likelihood of logs under a model with process noise: innovations of a Kalman filter, their derivatives, the search for the maximum.

Minus the log-likelihood is the sum of ``e^2 / 2S + log(2 pi S) / 2`` over the innovations e with their variances S, and half the squares of
the priors (Schweppe, IEEE Trans. Inf. Theory 11 (1965) 61). Derivatives are central differences of e and S between members that pass a
log together; the search is Fisher's scoring, by the damped descent
of every fit (information of e and S: Astrom, Automatica 16 (1980) 551).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from thermid.base.errors import SolverError
from thermid.base.linear_algebra import square_root, variance
from thermid.base.units import Array
from thermid.fit._estimation.dynamics import At, Dynamics
from thermid.fit._estimation.passing import Passing
from thermid.fit._estimation.process import ProcessNoise
from thermid.fit._minimisation import LocalCost, descend
from thermid.fit._problem.residuals import Problem, Unknown, prior_rows

DIFFERENCE: Final = 1e-4
"""Half the step of differences, in typical changes of an unknown."""
MAX_FIRST_STEP: Final = 1.5
"""Length of the first step at most, in typical changes of the unknowns."""
TRIVIAL: Final = 1e-4
"""Gain in the log-likelihood that may be left where no step gains any more: a hundredth of a standard error."""
CURVED: Final = 0.1
"""NoisyStep of differences of the gradient, in standard errors."""
READING: Final = "reading noise of "
MIN_SIZE_RATIO, MAX_SIZE_RATIO = 1e-7, 1e4
"""Bounds of a size that is looked for, over where the search begins."""


class LikelihoodScore(NamedTuple):
    """Minus the log-likelihood, its gradient (unknowns,), and the expected information (unknowns, unknowns)."""

    loss: float
    gradient: Array
    information: Array


@dataclass(frozen=True, eq=False)
class Maximum:
    """Where a search ended.

    Parameters
    ----------
    fitted : array (unknowns,)                      In the fitted forms.
    log_likelihood : float                          Of the readings alone, without priors. [-]
    information : array (unknowns, unknowns)        Observed where it is positive, else expected; priors in it.
    observed : bool                                 Which of these it is.
    converged : bool
    steps : int
    """

    fitted: Array
    log_likelihood: float
    information: Array
    observed: bool
    converged: bool
    steps: int

    def errors(self) -> Array:
        """Return the standard errors (unknowns,) in the fitted forms; infinite where the logs say nothing."""
        eye = np.eye(self.fitted.size)
        return np.array([np.sqrt(variance(self.information, row)) for row in eye])


@dataclass(frozen=True, eq=False)
class Likelihood:
    """Logs, a model and noise on it, over unknowns.

    Parameters
    ----------
    problem : Problem       The records bound to the model, with what a fit looks for.
    dynamics : tuple        One per record.
    noises : tuple          What drives the model.
    unknowns : tuple        Those of the problem, then sizes and times of noises, then noises of sensors that nobody stated.
    sigma : dict            Sensor -> standard deviation of a sample that is not looked for. [K]
    """

    problem: Problem
    dynamics: tuple[Dynamics, ...]
    noises: tuple[ProcessNoise, ...]
    unknowns: tuple[Unknown, ...]
    sigma: dict[str, float]

    @property
    def start(self) -> Array:
        """Where the search begins (unknowns,), in the fitted forms."""
        return np.array([u.to_fitted(u.start) for u in self.unknowns])

    def at(self, i: int, fitted: Array) -> At:
        """Return the dynamics of record `i` at values of the unknowns (unknowns,), fitted form."""
        problem_values = fitted[: len(self.problem.unknowns)]
        x, _ = self.problem.inputs(i, problem_values)
        named = {u.name: u.to_value(float(v)) for u, v in zip(self.unknowns, fitted, strict=True)}
        sizes = np.array([named.get(f"noise of {p.target}", p.size) for p in self.noises])
        times = np.array([named.get(f"noise time of {p.target}", p.time) for p in self.noises])
        observations = self.problem.experiments[i].observations
        sigma = np.array([o.sigma({o.sensor: named.get(READING + o.sensor, self.sigma.get(o.sensor, 1.0))}) for o in observations])
        bias = np.array([named.get(f"sensor {o.sensor}", self.problem.fixed_bias.get(o.sensor, 0.0)) for o in observations])
        return self.dynamics[i].at(x, sizes, times, sigma, bias)

    def passing(self, i: int, members: Sequence[Array]) -> Passing:
        """Return a record ready to be passed at several values of the unknowns."""
        return Passing(self.dynamics[i], [self.at(i, m) for m in members])

    def innovations(self, members: Sequence[Array]) -> tuple[Array, Array]:
        """Return innovations of all records (readings, members) [K] and their variances. [K^2]"""
        innovations_of_records = [self.passing(i, members).run().innovations for i in range(len(self.dynamics))]
        return np.concatenate([f.errors for f in innovations_of_records]), np.concatenate([f.variances for f in innovations_of_records])

    def priors(self, fitted: Array) -> tuple[Array, Array]:
        """Return the residuals of priors and their derivatives (residuals, unknowns). [-]"""
        return prior_rows(self.unknowns, self.problem.coupled, fitted)

    def score(self, fitted: Array) -> LikelihoodScore:
        """Return the loss with its gradient and the expected information."""
        return self.scores([fitted])[0]

    def scores(self, points: Sequence[Array]) -> list[LikelihoodScore]:
        """Return the loss, its gradient and the expected information at points (unknowns,), fitted form, from one pass of the logs.

        With innovations e [K] and their variances S [K^2], loss = sum e^2 / S + ln(2 pi S), halved, and half the sum of squares of the
        priors. Derivatives e', S' by central differences of `DIFFERENCE` times each scale; information = sum e'e' / S + S'S' / (2 S^2)
        (Fisher).
        """
        steps = DIFFERENCE * np.array([u.scale for u in self.unknowns])
        count, shifts = len(self.unknowns), np.diag(steps)
        members = [m for p in points for m in (p, *(p + s for s in shifts), *(p - s for s in shifts))]
        errors, variances = self.innovations(members)
        out = []
        for n, fitted in enumerate(points):
            columns_of_point = slice(n * (2 * count + 1), (n + 1) * (2 * count + 1))
            e, s = errors[:, columns_of_point], variances[:, columns_of_point]
            de = (e[:, 1 : 1 + count] - e[:, 1 + count :]) / (2.0 * steps)
            ds = (s[:, 1 : 1 + count] - s[:, 1 + count :]) / (2.0 * steps)
            e, s = e[:, :1], s[:, :1]
            gradient = np.sum(e * de / s + 0.5 * (ds / s) * (1.0 - e**2 / s), axis=0)
            information = (de / s).T @ de + 0.5 * (ds / s).T @ (ds / s)
            rows, slopes = self.priors(fitted)
            # minus the log-likelihood of the innovations, and of the priors
            loss = 0.5 * float(np.sum(e**2 / s + np.log(2.0 * np.pi * s), axis=0)[0]) + 0.5 * float(rows @ rows)
            out.append(LikelihoodScore(loss, gradient + slopes.T @ rows, information + slopes.T @ slopes))
        return out

    def maximise(self, start: Array, *, observed: bool = True) -> Maximum:
        """Return the maximum that a descent from `start` (unknowns,), fitted form, reaches, with its information (unknowns, unknowns).

        Gauss-Newton steps by the expected information, at most `MAX_FIRST_STEP` at first. The information is the observed one, without
        `observed` the expected one.
        """
        low, high = (np.array(b) for b in zip(*(u.fitted_bounds() for u in self.unknowns), strict=True))
        scores: dict[bytes, LikelihoodScore] = {}

        def local(fitted: Array) -> LocalCost:
            """Return the cost at a point with rows and slopes whose squares give its information; infinite where a run fails."""
            try:
                with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
                    score = scores[fitted.tobytes()] = self.score(fitted)
                root = square_root(score.information, drop=True)
            except (np.linalg.LinAlgError, FloatingPointError) as error:
                raise SolverError("the filter breaks off at these values.", "estimate", code="run.did-not-finish") from error
            # rows r and slopes L' with the gradient L r and the information L L'
            return score.loss, np.asarray(np.linalg.lstsq(root, score.gradient, rcond=None)[0], dtype=float), root.T

        end = descend(local, start, (low, high), np.array([u.scale for u in self.unknowns]), relative=1e-12, reach=MAX_FIRST_STEP)
        score = scores[end.x.tobytes()]
        information, positive = self._observed(end.x, score) if observed else (score.information, False)
        rows, _ = self.priors(end.x)
        return Maximum(end.x, 0.5 * float(rows @ rows) - score.loss, information, positive, end.ahead < TRIVIAL, len(scores))

    def _observed(self, fitted: Array, score: LikelihoodScore) -> tuple[Array, bool]:
        """Return the observed information (unknowns, unknowns), fitted form, and True; the expected one and False where it is not positive.

        H_ij = (g_j(x + h_i) - g_j(x - h_i)) / (2 h_i), made symmetric, g the gradient of minus the log likelihood at `fitted` x
        (unknowns,). h_i is `CURVED` standard errors, at most a tenth of each scale.
        """
        errors = Maximum(fitted, 0.0, score.information, False, True, 0).errors()
        scale = np.array([u.scale for u in self.unknowns])
        steps = np.minimum(np.where(np.isfinite(errors), CURVED * errors, 0.1 * scale), 0.1 * scale)
        try:
            shifts = np.diag(steps)
            sides = self.scores([*(fitted + s for s in shifts), *(fitted - s for s in shifts)])
            information = np.array([a.gradient - b.gradient for a, b in zip(sides[: steps.size], sides[steps.size :], strict=True)])
            information = information / (2.0 * steps[:, None])
        except (SolverError, np.linalg.LinAlgError):
            return score.information, False
        information = 0.5 * (information + information.T)
        size = np.sqrt(np.maximum(np.diag(information), 1e-300))
        positive = bool(np.isfinite(information).all()) and float(np.linalg.eigvalsh(information / np.outer(size, size)).min()) > 1e-6
        return (information, True) if positive else (score.information, False)


def likelihood_of(problem: Problem, noises: Sequence[ProcessNoise], start_sd: Mapping[str, float]) -> Likelihood:
    """Return the likelihood of a problem's records with noises on its model.

    Unknown besides those of the problem are sizes and times of process noises that are free, and the noise [K] of sensors that state none.
    `start_sd` is node -> standard deviation of its temperature at the start [K].
    """
    dynamics = tuple(Dynamics(b, noises, dict(start_sd)) for b in problem.benches())
    observation_of_sensor = {o.sensor: o for e in problem.experiments for o in e.observations}
    stated = {s: o.noise for s, o in observation_of_sensor.items() if o.noise is not None}
    unknowns: list[Unknown] = list(problem.unknowns)
    for p in noises:
        if p.free:
            unknowns.append(_size(f"noise of {p.target}", p.size, p.unit))
        if p.free_time:
            unknowns.append(_size(f"noise time of {p.target}", p.time, "s"))
    for sensor, o in observation_of_sensor.items():
        if sensor not in stated:
            steps = np.diff(o.measured)
            guess = max(float(np.median(np.abs(steps))) if steps.size else 0.0, 1e-3)
            unknowns.append(_size(READING + sensor, guess, "K"))
    return Likelihood(problem, dynamics, tuple(noises), tuple(unknowns), stated)


def _size(name: str, start: float, unit: str) -> Unknown:
    """Return the unknown of a noise's size, fitted by its logarithm within `MIN_SIZE_RATIO` .. `MAX_SIZE_RATIO` of its start."""
    return Unknown(name, "noise", (), start, True, MIN_SIZE_RATIO * start, MAX_SIZE_RATIO * start, None, unit)
