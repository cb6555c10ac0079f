"""The one score: how likely the readings are with a cause, over as the model is, with all values integrated over the widths of the table.

In: a problem, where its fit ended, the prior of each value that a cause adds (`causes`). Out: a `CauseScore`. The noise is the fit's own:
white as stated, and a part that wanders as large and as slow as makes the readings likeliest (`fit.uncertainty.evidences`). Where the fit
ended the model is linear in its values (Laplace: MacKay, Information Theory, Inference, and Learning Algorithms, 2003, chapter 28).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from thermid.base.errors import SolverError
from thermid.base.linear_algebra import Array
from thermid.fit.calibration import Binned, Problem, binned, evidences
from thermid.inference._explain.causes import SizedValue
from thermid.inference._explain.thresholds import CONFIRMED_GAIN, MAX_CONFIRMED_STEPS, MAX_SEEN_STRETCHES, WIDTHS


@dataclass(frozen=True, eq=False)
class CauseScore:
    """Evidence of the readings of one problem, over widths of its priors and noises of its readings.

    Parameters
    ----------
    logs : array (widths, noises)   Logarithms of the evidence, but for a constant that all models of the same readings share: a row for
                                    each factor of `WIDTHS` on the priors, a column for each noise of a grid.
    squares : array (noises,)       Mean square of the residuals in units of the stated noise, weighed as each noise weighs them. [-]
    """

    logs: Array
    squares: Array = field(default_factory=lambda: np.zeros(0))

    @property
    def best(self) -> float:
        """The largest logarithm over the noises, averaged over the widths."""
        return float(self.averaged.max())

    @property
    def averaged(self) -> Array:
        """Logarithms of the evidence averaged over the widths (noises,): ln(mean over widths of exp(logs))."""
        return np.asarray(np.logaddexp.reduce(self.logs, axis=0) - np.log(len(WIDTHS)))

    def less(self, amount: float | Array) -> CauseScore:
        """Return the score with `amount`, one number or (widths, noises), taken off the logarithms. [-]"""
        return replace(self, logs=self.logs - amount)


def noise_of(weighings: Iterable[CauseScore]) -> int:
    """Return the column of `logs` by which several models are compared: the likeliest noise of the best of them.

    Noise is a property of instruments and surroundings, so residuals of a worse model do not count as noise.
    """
    return int(max(weighings, key=lambda w: w.best).averaged.argmax())


def weighed_at(
    problem: Problem,
    fitted: Array,
    sizes: Mapping[str, SizedValue],
    loss: str = "linear",
    loss_scale: float = 1.0,
) -> CauseScore:
    """Return the score of a problem where its fit ended; see `_weighed`."""
    return _weighed(problem, fitted, sizes, seen_in_stretches(problem, fitted, loss, loss_scale))[0]


def seen_in_stretches(problem: Problem, fitted: Array, loss: str, loss_scale: float) -> Sequence[Binned]:
    """Return the traces of a problem at some values in stretches of time; see `binned`. `SolverError` when a record cannot be run."""
    return [*binned(problem, fitted, loss, loss_scale, MAX_SEEN_STRETCHES).values()]


def weighed_in_noise(
    problem: Problem,
    fitted: Array,
    sizes: Mapping[str, SizedValue],
    noise: int,
    loss: str = "linear",
    loss_scale: float = 1.0,
) -> tuple[CauseScore, Array]:
    """Return the score of a problem at the values that are likeliest in one noise, the column `noise` of a score, and these (unknowns,).

    White noise, by which fits are made, and noise that wanders have other ends. What the linearisation promises of the way from one to the
    other counts only once runs there confirm it: a step that makes readings less likely is shortened, and what is promised beyond the last
    one, with any width, does not count.

    Raises
    ------
    SolverError   When a record cannot be run where the fit ended.
    """
    low, high = np.array([u.fitted_bounds() for u in problem.unknowns]).reshape(-1, 2).T
    at = fitted
    pieces = seen_in_stretches(problem, at, loss, loss_scale)
    best, move, gains = _weighed(problem, at, sizes, pieces, noise)
    share = 1.0
    for _ in range(MAX_CONFIRMED_STEPS):
        if gains[1, 0] < CONFIRMED_GAIN:
            break
        there = np.clip(at + share * move[0], low, high)
        try:
            readings = seen_in_stretches(problem, there, loss, loss_scale)
            score, further, ahead = _weighed(problem, there, sizes, readings, noise)
            better = (score.logs - ahead)[1, 0] > (best.logs - gains)[1, 0]
        except SolverError:
            better = False
        if better:
            at, pieces, best, move, gains, share = there, readings, score, further, ahead, 1.0
        else:
            share *= 0.3
    whole, _, gains = _weighed(problem, at, sizes, pieces)
    return whole.less(gains), at


def _weighed(
    problem: Problem, fitted: Array, sizes: Mapping[str, SizedValue], pieces: Sequence[Binned], noise: int | None = None
) -> tuple[CauseScore, Array, Array]:
    """Return the logarithms (widths, noises) of the evidence of a problem: all unknowns integrated out, readings linear about `fitted`.

    Parameters
    ----------
    problem : Problem           Its own priors count for unknowns without an entry in `sizes`.
    fitted : array (unknowns,)  Where readings and priors are linearised; in the fitted form.
    sizes : dict                Unknown -> the prior that takes the place of its own.
    pieces : sequence of Binned The readings there.
    noise : int                 The only one of the grid that is asked for; all by default.

    Returns
    -------
    CauseScore
    array (noises, unknowns)    How far each unknown would move in each noise, by the widths of the table.
    array (widths, noises)      What of the logarithms that way promises. [-]
    """
    from scipy.special import log_ndtr

    is_sized = np.array([u.name in sizes for u in problem.unknowns], dtype=bool)
    values, slopes = problem.prior_rows(fitted)
    stated = ~slopes[:, is_sized].any(axis=1) if values.size else np.zeros(0, dtype=bool)
    priors, pulls, spent = [], [], []
    for factor in WIDTHS:
        stated_values, matrix = values[stated], slopes[stated]
        for k in np.flatnonzero(is_sized):
            u = problem.unknowns[k]
            row, slope = sizes[u.name].row(u.to_value(float(fitted[k])), u.log, factor)
            stated_values, matrix = np.append(stated_values, row), np.concatenate([matrix, slope * np.eye(is_sized.size)[[k]]])
        priors.append(matrix.T @ matrix)
        pulls.append(-matrix.T @ stated_values)
        spent.append(0.5 * float(stated_values @ stated_values))
    logs, moves, errors, gains, squares = evidences(pieces, np.array(priors), np.array(pulls), noise)
    one_sided = [k for k in np.flatnonzero(is_sized) if problem.unknowns[k].log and not sizes[problem.unknowns[k].name].middle]
    for k in one_sided:  # of a normal about nothing only the upper half is possible: twice the density, times what lies above
        logs = logs + np.log(2.0) + log_ndtr((1.0 + moves[..., k]) / errors[..., k])
    return CauseScore(logs - np.array(spent)[:, None], squares), moves[1], gains


def shares(weighings: Sequence[CauseScore]) -> Array:
    """Return the probability (causes,) of each of several causes, equally likely beforehand; their sum is 1. [-]

    It is ``exp(logs) / sum of exp(logs)`` over the causes, under the noise of `noise_of`, averaged over the widths.
    """
    noise = noise_of(weighings)
    logs = np.array([w.logs[:, noise] for w in weighings])
    weights = np.exp(logs - logs.max(axis=0))
    return np.asarray((weights / weights.sum(axis=0)).mean(axis=1))
