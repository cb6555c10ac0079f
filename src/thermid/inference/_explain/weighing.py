"""The one score: how likely the readings are with a cause, over as the model is, with all values integrated over the priors of the table.

In: a problem, where its fit ended, the prior of each value that a cause adds (`causes`). Out: a `CauseScore`. The noise is the fit's own:
white as stated, and a part that wanders as large and as slow as makes the readings likeliest (`fit.uncertainty.evidences`). Where the fit
ended the model is linear in its values (Laplace: MacKay, Information Theory, Inference, and Learning Algorithms, 2003, chapter 28).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from thermid.base.units import Array
from thermid.fit.calibration import Binned, Problem, descend, evidences, wander_times, white_rows
from thermid.inference._explain.thresholds import MAX_SEEN_STRETCHES, MOST_STEPS_IN_NOISE, NOISE_DONE_GAIN, NOISE_DONE_STEP, SizedValue


@dataclass(frozen=True, eq=False)
class CauseScore:
    """Evidence of the readings of one problem, over noises of its readings.

    Parameters
    ----------
    logs : array (noises,)          Logarithms of the evidence, but for a constant that all models of the same readings share.
    squares : array (noises,)       Mean square of the residuals in units of the stated noise, weighed as each noise weighs them. [-]
    errors : array (noises, unknowns)   Standard error of every unknown in its fitted form.
    wander : array (noises,)        Over what time each noise wanders in the first trace, zero where it hardly does. [s]
    """

    logs: Array
    squares: Array = field(default_factory=lambda: np.zeros(0))
    errors: Array = field(default_factory=lambda: np.zeros((0, 0)))
    wander: Array = field(default_factory=lambda: np.zeros(0))

    @property
    def best(self) -> float:
        """The largest logarithm over the noises."""
        return float(self.logs.max())

    def less(self, amount: float | Array) -> CauseScore:
        """Return the score with `amount`, one number or (noises,), taken off the logarithms. [-]"""
        return replace(self, logs=self.logs - amount)


def noise_of(weighings: Iterable[CauseScore]) -> int:
    """Return the column of `logs` by which several models are compared: the likeliest noise of the best of them.

    Noise is a property of instruments and surroundings, so residuals of a worse model do not count as noise.
    """
    return int(max(weighings, key=lambda w: w.best).logs.argmax())


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
    """Return the traces of a problem at some values in stretches of time. `SolverError` when a record cannot be run."""
    return [*Binned.of_problem(problem, fitted, loss, loss_scale, MAX_SEEN_STRETCHES).values()]


def weighed_in_noise(
    problem: Problem,
    fitted: Array,
    sizes: Mapping[str, SizedValue],
    noise: int,
    loss: str = "linear",
    loss_scale: float = 1.0,
) -> tuple[CauseScore, Array]:
    """Return the score of a problem at the values that are likeliest in one noise, the column `noise` of a score, and these (unknowns,).

    White noise, by which fits are made, and autocorrelated noise have other ends. A descent from `fitted` (fitted form) in that noise
    leads to the other; what the linearisation promises beyond it does not count, for no run confirms it. `loss_scale` is in units of the
    noise.

    Raises
    ------
    SolverError   When a record cannot be run where the fit ended.
    """
    readings_at = {fitted.tobytes(): (begun := seen_in_stretches(problem, fitted, loss, loss_scale))}

    def local(x: Array) -> tuple[float, Array, Array]:
        """Return cost, rows and slopes at some values, made white in the noise; the readings there are kept."""
        if x.tobytes() not in readings_at:
            readings_at[x.tobytes()] = seen_in_stretches(problem, x, loss, loss_scale)
        parts = white_rows(readings_at[x.tobytes()], noise, begun), _prior_rows(problem, x, sizes)
        rows, slopes = (np.concatenate(part) for part in zip(*parts, strict=True))
        return 0.5 * float(rows @ rows), rows, slopes

    low, high = np.array([u.fitted_bounds() for u in problem.unknowns]).reshape(-1, 2).T
    scale = np.array([u.scale for u in problem.unknowns])
    end = descend(local, fitted, (low, high), scale, done=NOISE_DONE_STEP, relative=NOISE_DONE_GAIN, rounds=MOST_STEPS_IN_NOISE)
    whole, _, gains = _weighed(problem, end.x, sizes, readings_at[end.x.tobytes()])
    return whole.less(gains), end.x


def _prior_rows(problem: Problem, fitted: Array, sizes: Mapping[str, SizedValue]) -> tuple[Array, Array]:
    """Return residuals (priors,) [-] and derivatives (priors, unknowns) of priors, those of `sizes` instead of a problem's own."""
    is_sized = np.array([u.name in sizes for u in problem.unknowns], dtype=bool)
    values, slopes = problem.prior_rows(fitted)
    stated = ~slopes[:, is_sized].any(axis=1) if values.size else np.zeros(0, dtype=bool)
    values, slopes = values[stated], slopes[stated]
    for k in np.flatnonzero(is_sized):
        u = problem.unknowns[k]
        row, slope = sizes[u.name].row(u.to_value(float(fitted[k])), u.log)
        values, slopes = np.append(values, row), np.concatenate([slopes, slope * np.eye(is_sized.size)[[k]]])
    return values, slopes


def _weighed(problem: Problem, fitted: Array, sizes: Mapping[str, SizedValue], pieces: Sequence[Binned]) -> tuple[CauseScore, Array, Array]:
    """Return the logarithms (noises,) of the evidence of a problem: all unknowns integrated out, readings linear about `fitted`.

    ``ln Z = ln|P|/2 - ln|A|/2 + b'A^-1 b / 2 - r'W r / 2 - p'p / 2`` and the noise's own terms, as of `evidences`: A = J'W J + P, P the
    information of the priors, b = -(J'W r + P_rows' p). A size whose prior is about nothing counts its upper half alone: ln 2 + ln Phi((1
    + move) / error) more.

    Parameters
    ----------
    problem : Problem           Its own priors count for unknowns without an entry in `sizes`.
    fitted : array (unknowns,)  Where readings and priors are linearised; in the fitted form.
    sizes : dict                Unknown -> the prior that takes the place of its own.
    pieces : sequence of Binned The readings there.

    Returns
    -------
    CauseScore
    array (noises, unknowns)    How far each unknown would move in each noise.
    array (noises,)             What of the logarithms that way promises. [-]
    """
    from scipy.special import log_ndtr

    values, rows = _prior_rows(problem, fitted, sizes)
    *of_prior, squares = evidences(pieces, (rows.T @ rows)[None], (-rows.T @ values)[None])
    logs, moves, errors, gains = (several[0] for several in of_prior)
    for k, u in enumerate(problem.unknowns):
        # of a normal about nothing only the upper half is possible: twice the density, times what lies above
        if u.name in sizes and u.log and not sizes[u.name].middle:
            logs = logs + np.log(2.0) + log_ndtr((1.0 + moves[..., k]) / errors[..., k])
    logs = logs - 0.5 * float(values @ values)
    return CauseScore(logs, squares, errors, wander_times(pieces[0].times)), moves, gains


def shares(weighings: Sequence[CauseScore]) -> Array:
    """Return the probability (causes,) of each of several causes, equally likely beforehand; their sum is 1. [-]

    It is ``exp(logs) / sum of exp(logs)`` over the causes, under the noise of `noise_of`.
    """
    noise = noise_of(weighings)
    logs = np.array([w.logs[noise] for w in weighings])
    weights = np.exp(logs - logs.max())
    return np.asarray(weights / weights.sum())
