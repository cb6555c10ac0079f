"""By how much one clock is late on another, where both logs show the same step of a power or a temperature.

In: courses of two logs, each on its own clock. Out: the offset with its standard error, and what it was found from. A course of one log
explains one of the other: as it is, where both are temperatures or both powers; where one is a power and the other a temperature, by a sum
of first-order responses with time constants from seconds to the length of the log, as every network of resistances and capacitances has,
beside the decays of what was stored before both logs run. Powers of one log act together: each has responses of its own. Logs may share a
part of their time only, so offsets of the whole range compete: by the information N log(squares without the other course / squares left)
of the N readings that both would share.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from thermid.base.units import DEVIATION_OF_MEDIAN
from thermid.measure._readers.questions import SWITCH
from thermid.measure._record.channel import FloatArray

MAX_COMPARED_READINGS, TRIED_OFFSETS = 400, 300
"""Most readings that two courses are compared at, and offsets that are tried at first. [-]"""
RESPONSES = (8, 5, 12)
"""First-order responses that stand for the way from a power to a thermometer; what they disagree by is an error of the offset. [-]"""
DECAYS = 4
"""Decays of what was stored before a power was logged. [-]"""
SHARED = 0.15
"""Part of the shorter log that must overlap the other one. [-]"""
MIN_EXPLAINED_SHARE = {True: 0.985, False: 0.9}
"""Part of the squares that the other course must explain, a power or one of the same kind; responses fit nine tenths by chance. [-]"""
RIVAL, DISTINCT = {True: 0.65, False: 0.85}, 0.05
"""Part of the best offset's information from which another one, off by that part of the shorter log, leaves it open. [-]"""
MAX_OFFSET_ERROR = 0.1
"""Error of an offset, in lengths of the shorter log, from which there is no step that both show. [-]"""
TWO_PLACES = 1.2
"""Scatter about each other from which two temperatures are of two places, in that from reading to reading. [-]"""
QUARTER = 0.25
"""Part of its range that a temperature changes by in the time that one place may lag another by. [-]"""
BEGUN = 0.03
"""Part of a rise that stands for its beginning. [-]"""
LEAST_ACTING = 0.1
"""Part of the largest rise by a power from which another one acts on a thermometer too. [-]"""
SHARES_HELD = 1e-4
"""Weight that holds shares of responses near nothing: they would cancel in millions else, and stand for nothing that a network does. [-]"""
MIN_INDEPENDENT = 4.0
"""Fewest residuals that count as independent. [-]"""
MAX_LEFT_OUT = 6
"""Stretches of readings that are left out one by one."""
FINER = 3
"""How often offsets are tried again, eight times as close about the best."""

CLOCKS_APART = 300.0
"""By how much clocks that nobody set by each other may differ beside their zones. [s]"""

MAX_POINTS = 20000
"""Points of a response, at most."""


@dataclass(frozen=True, eq=False)
class Explanation:
    """A course of one log in the form in which it may explain one of the other log.

    Parameters
    ----------
    times : array (points,)              Of its own log. [s]
    columns : array (points, columns)    The course as it is, or first-order responses to it.
    constants : array (columns,) or (0,) Time constants of the responses, of one power after the other. [s]
    sizes : array (columns,) or (0,)     Range of the power of each response. [W]
    """

    times: FloatArray
    columns: FloatArray
    constants: FloatArray
    sizes: FloatArray

    def rise(self, length: float) -> FloatArray:
        """Return 1 - exp(-t / constant) of each column at t = 0.1, 0.3 and 1 times `length` (instants, columns); 1 without responses.

        It is that of a step of the power's whole range, so that the sum over columns is of all powers switched on together. [W]
        """
        if not self.constants.size:
            return np.ones((1, 1))
        return np.asarray(self.sizes * (1.0 - np.exp(-length * np.array([0.1, 0.3, 1.0])[:, None] / self.constants)))

    def begun(self, shares: FloatArray, length: float) -> float:
        """Return the first of 200 instants up to `length` at which a power's response reaches `BEGUN` of its largest; zero without any. [s]

        The response is sum_k P shares_k (1 - exp(-t / constant_k)), P the power's range [W]; of several powers the one that begins first
        counts, those below `LEAST_ACTING` of the largest do not.

        Parameters
        ----------
        shares : array (terms,)     Of a fit, those of the responses last. [K/W]
        """
        if not self.constants.size:
            return 0.0
        times = np.geomspace(1e-4, 1.0, 200) * length
        of_each = self.sizes * shares[-self.constants.size :] * (1.0 - np.exp(-times[:, None] / self.constants))
        rises = of_each.reshape(times.size, -1, np.unique(self.constants).size).sum(axis=2)
        acting = rises.max(axis=0) >= LEAST_ACTING * rises.max()
        return float(times[int(np.argmax((rises >= BEGUN * rises.max(axis=0))[:, acting].any(axis=1)))])


@dataclass(frozen=True, eq=False)
class LogCourse:
    """One column of a log over its own clock.

    Parameters
    ----------
    name : str                  Its name.
    power : bool                Whether it is a power, which holds until the next reading; else a temperature.
    times : array (samples,)    From the first sample of its log. [s]
    values : array (samples,)   [W or K]
    heated : bool               Whether a power may heat it: not the surroundings.
    beside : tuple              Of a power, the others of its log that act together with it.
    """

    name: str
    power: bool
    times: FloatArray
    values: FloatArray
    heated: bool = True
    beside: tuple[LogCourse, ...] = ()

    @property
    def moves(self) -> bool:
        """Whether it has 8 readings or more that are not all equal."""
        return self.values.size >= 8 and float(np.ptp(self.values)) > 0.0

    def responses(self, fine: float, count: int, longest: float) -> Explanation:
        """Return first-order responses (times, constants) to a power less its first value, on a grid of step `fine` [s]. [W]

        y_i = d y_(i-1) + (1 - d) x_(i-1), d = exp(-fine / constant): what `count` lags would show of the power x held between samples.
        Their time constants run from `fine` to `longest` by equal factors. [s]
        """
        from scipy.linalg import solve_banded

        times, constants = np.arange(0.0, self.times[-1] + fine, fine), np.geomspace(fine, longest, count)
        courses = (self, *self.beside)
        held = np.column_stack(
            [c.values[np.clip(np.searchsorted(c.times, times, side="right") - 1, 0, c.times.size - 1)] - c.values[0] for c in courses]
        )
        sizes, out = np.array([float(np.ptp(c.values)) for c in courses]), np.zeros((len(courses), count, times.size))
        for k, decay in enumerate(np.exp(-fine / constants)):  # y_i - decay y_(i-1) = (1 - decay) x_(i-1): an interval acts at its end
            bands = np.vstack([np.ones(times.size), np.full(times.size, -decay)])
            out[:, k, 1:] = solve_banded((1, 0), bands[:, 1:], (1.0 - decay) * held[:-1]).T
        return Explanation(times, out.reshape(-1, times.size).T, np.tile(constants, len(courses)), np.repeat(sizes, count))

    @property
    def switched(self) -> FloatArray:
        """Times at which it, or a power beside it, switches. [s]"""
        every = [c.times[1:][np.abs(np.diff(c.values)) > SWITCH * float(np.ptp(c.values))] for c in (self, *self.beside)]
        return np.unique(np.concatenate(every))


def _together(courses: Sequence[LogCourse]) -> list[LogCourse]:
    """Return courses that move, those of several powers as one: they act together on what a thermometer reads."""
    moving = [c for c in courses if c.moves]
    powers = [c for c in moving if c.power]
    one = [replace(powers[0], name=" + ".join(c.name for c in powers), beside=tuple(powers[1:]))] if powers else []
    return [*one, *(c for c in moving if not c.power)]


@dataclass(frozen=True)
class CommonStep:
    """An offset that courses of two logs show.

    Parameters
    ----------
    offset : float      By how much the second clock's zero is late on the first one. [s]
    error : float       Its standard error; a mass between a power and a thermometer delays a step beyond it. [s]
    first, second : str Columns that it was found from.
    explained : float   Part of the squares that the second explains. [-]
    lags : bool         Whether both are temperatures, and differ by more than noise: of two places, one later than the other.
    candidate : bool    Whether both are temperatures that a power heats, and nothing says that they are of one place: the error then has
                        by how much one may follow the other, even where a shift explains all of it.
    """

    offset: float
    error: float
    first: str
    second: str
    explained: float
    lags: bool = False
    candidate: bool = False


def common_step(first: Sequence[LogCourse], second: Sequence[LogCourse]) -> CommonStep | None:
    """Return the offset that two logs show with the least error; else the candidate that explains most; None where there is neither.

    An error above a tenth of the shorter log is no step either. Temperatures of two places follow a step at different times: two of each
    log are needed, and their scatter is added to the error. So is the time by which one place may be later than the other: a shift may
    explain a lag completely.

    Parameters
    ----------
    first, second : sequence of LogCourse   Columns of either log.
    """
    acting = [(a, b) for a in _together(first) for b in _together(second) if a.power != b.power]
    alike = [(a, b) for a in first for b in second if a.power == b.power and a.moves and b.moves]
    offsets = [one for a, b in (*acting, *alike) if (one := _compared(a, b)) is not None]
    length = min((c.times[-1] for c in (*first, *second) if c.moves), default=0.0)
    offsets = _as_pairs_agree(offsets)
    places = [f for f in offsets if f.lags]
    if min(len({f.first for f in places}), len({f.second for f in places})) < 2:  # nothing says how late one place follows the other
        offsets, places = [f for f in offsets if not f.lags], []
    spread = float(np.std([f.offset for f in places])) if places else 0.0
    offsets = [replace(f, error=float(np.hypot(f.error, spread))) if f.lags else f for f in offsets]
    best = min(offsets, key=lambda f: (f.candidate, -f.explained if f.candidate else f.error), default=None)
    return best if best is not None and best.error <= MAX_OFFSET_ERROR * length else None


def _as_pairs_agree(offsets: Sequence[CommonStep]) -> list[CommonStep]:
    """Return offsets; errors of those from a power get the between-pair variance added (DerSimonian and Laird 1986). [s]

    (Q - (n - 1)) / (sum w - sum w^2 / sum w) with w = 1 / error^2 and Q = sum w (offset - mean)^2, at least zero.
    """
    sure = [f for f in offsets if not (f.lags or f.candidate)]
    weights, values = np.array([f.error**-2.0 for f in sure]), np.array([f.offset for f in sure])
    if len(sure) < 2:
        return list(offsets)
    beyond = float(weights @ (values - weights @ values / weights.sum()) ** 2) - (len(sure) - 1)
    between = np.sqrt(max(beyond, 0.0) / (weights.sum() - weights @ weights / weights.sum()))
    return [replace(f, error=float(np.hypot(f.error, between))) if f in sure else f for f in offsets]


def _seen_late(cause: LogCourse) -> float:
    """Return how late a log shows the switches of a power, which holds until the next reading: half the time between readings there. [s]

    A log with a reading at each switch and hardly another one shows them as they are.
    """
    switched = np.searchsorted(cause.times, cause.switched)
    if not cause.power or 2 * switched.size > cause.times.size:
        return 0.0
    return 0.5 * float(np.median(np.diff(cause.times)[switched - 1])) if switched.size else 0.0


def _compared(a: LogCourse, b: LogCourse) -> CommonStep | None:
    """Return the offset between two courses, the second one's clock late on that of the first; None where it is not clear."""
    if not (a.heated and b.heated) and (a.power != b.power or a.heated != b.heated):
        return None  # no power and no heated part acts on the surroundings
    effect, cause, sign = (a, b, 1.0) if a.power <= b.power else (b, a, -1.0)  # what explains is the power, or the second of a kind
    length = min(a.times[-1], b.times[-1])
    low, high = SHARED * length - cause.times[-1], effect.times[-1] - SHARED * length
    step = max(float(np.median(np.diff(a.times))), float(np.median(np.diff(b.times))))
    offsets, spacing = np.linspace(low, high, TRIED_OFFSETS + 1), (high - low) / TRIED_OFFSETS
    ways = _explanations(effect, cause)
    known = np.array([_information(effect, ways[0], offset) for offset in offsets])
    first = float(offsets[int(np.argmax(known))])
    rival = float(np.max(known[np.abs(offsets - first) > DISTINCT * length], initial=0.0))
    refined_offsets = [_refined_offset(effect, responses, first, spacing, step) for responses in ways]
    explained = 1.0 - _part_unexplained(effect, ways[0], refined_offsets[0])
    mixed, at = a.power != b.power, refined_offsets[0]
    inside = np.count_nonzero((cause.switched > -at) & (cause.switched < effect.times[-1] - at))  # any single rise looks like any other
    if (
        (cause.power and inside < min(2, cause.switched.size))
        or explained < MIN_EXPLAINED_SHARE[mixed]
        or rival > RIVAL[mixed] * _information(effect, ways[0], at)
    ):
        return None
    error = max(_error(effect, responses, offset, step) for responses, offset in zip(ways, refined_offsets, strict=True))
    rows, target = _rows(effect, ways[0], refined_offsets[0])
    left, shares = _solved(rows, target)
    noise = float(np.hypot(_scatter(effect), shares[-1] * _scatter(cause)))
    lags = not (a.power or b.power) and left > target.size * (TWO_PLACES * noise) ** 2
    candidate = not (a.power or b.power) and a.heated and a.name.casefold() != b.name.casefold()
    late = max(_quarter_time(a), _quarter_time(b)) if candidate else ways[0].begun(shares, length)
    apart = np.std(refined_offsets) * (len(ways) / max(len(ways) - 1, 1)) ** 0.5
    parted = _disagreement(effect, cause, ways[0], refined_offsets[0], step)
    error = float(np.linalg.norm([max(error, parted), apart, late / 3.0**0.5]))  # later or earlier by any time up to that one
    offset = float(np.median(refined_offsets)) + (0.0 if effect.power else _seen_late(cause))
    return CommonStep(sign * offset, error, a.name, b.name, explained, lags, candidate)


def _disagreement(effect: LogCourse, cause: LogCourse, responses: Explanation, offset: float, step: float) -> float:
    """Return how far the switches of a power disagree on an offset: its error by leaving out the readings after each in turn. [s]

    The jackknife over m stretches from switch to switch, ((m - 1) / m sum (offset_k - mean)^2)^(1/2): Efron, The Jackknife, the Bootstrap
    and Other Resampling Plans, 1982, 3; neighbours are taken together where there are many.
    """
    edges = cause.switched + offset if cause.power else np.zeros(0)
    edges = edges[(edges > 0.0) & (edges < effect.times[-1])]
    if edges.size < 2:
        return 0.0
    edges = edges[np.unique(np.linspace(0, edges.size - 1, MAX_LEFT_OUT).round().astype(int))]
    stretch = np.searchsorted(edges[1:], effect.times, side="right")
    left_out = [replace(effect, times=effect.times[stretch != k], values=effect.values[stretch != k]) for k in range(edges.size)]
    offsets = [_refined_offset(e, responses, offset, 4.0 * step, step) for e in left_out if e.times.size]
    return float(np.std(offsets) * np.sqrt(len(offsets) - 1.0)) if len(offsets) > 1 else 0.0


def _quarter_time(course: LogCourse) -> float:
    """Return the shortest time s with max |T(t + s) - T(t)| >= `QUARTER` of the range of T: what one place may lag another by. [s]

    It is one of 32 times in geometric steps, from a hundredth of the log's duration to all of it.
    """
    for length in np.geomspace(0.01 * course.times[-1], course.times[-1], 32):
        later = np.interp(course.times + length, course.times, course.values)
        if float(np.max(np.abs(later - course.values))) >= QUARTER * float(np.ptp(course.values)):
            break
    return float(length)


def _scatter(course: LogCourse) -> float:
    """Return the standard deviation of readings from the line between their neighbours, by their median. [the course's unit]"""
    return float(DEVIATION_OF_MEDIAN * np.median(np.abs(np.diff(course.values, 2))) / np.sqrt(6.0))


def _explanations(effect: LogCourse, cause: LogCourse) -> list[Explanation]:
    """Return the forms in which one course may act on another: sets of responses where a power acts on a temperature, else as it is."""
    if cause.power == effect.power:
        return [Explanation(cause.times, cause.values[:, None], np.zeros(0), np.zeros(0))]
    fine = max(float(np.median(np.diff(cause.times))), cause.times[-1] / MAX_POINTS)
    return [cause.responses(fine, count, max(effect.times[-1], cause.times[-1])) for count in RESPONSES]


def _refined_offset(effect: LogCourse, responses: Explanation, best: float, spacing: float, step: float) -> float:
    """Return the offset that leaves least, looked for within four spacings of `best` in finer and finer steps. [s]"""
    for _ in range(FINER):
        tried = best + np.linspace(-4.0, 4.0, 17) * spacing
        best = float(tried[int(np.argmin([_part_unexplained(effect, responses, o) for o in tried]))])
        spacing /= 8.0
        if spacing < 0.05 * step:
            break
    return best


def _part_unexplained(effect: LogCourse, responses: Explanation, offset: float) -> float:
    """Return the sum of squared residuals with the other course, later by an offset [s], over that without it; 1 where it explains none."""
    return _compare_at(effect, responses, offset)[0]


def _information(seen: LogCourse, made: Explanation, offset: float) -> float:
    """Return N log(1 / share unexplained) at an offset [s], with the N readings that both courses share. [-]"""
    left, shared = _compare_at(seen, made, offset)
    return -shared * float(np.log(max(left, 1e-12)))


def _compare_at(seen: LogCourse, made: Explanation, offset: float) -> tuple[float, int]:
    """Return the sum of squared residuals with the other course over that without it, at an offset [s], and the number of readings."""
    rows, target = _rows(seen, made, offset)
    own = rows.shape[1] - made.columns.shape[1]
    if target.size < 4 * rows.shape[1] or float(np.ptp(rows[:, own])) == 0.0:
        return 1.0, target.size
    (without, _), (left, shares) = _solved(rows[:, :own], target), _solved(rows, target)
    shared = min(seen.times[-1], offset + made.times[-1]) - max(offset, 0.0)
    if without <= 0.0 or np.any(made.rise(shared) @ shares[own:] <= 0.0):
        return 1.0, target.size  # what warms does not cool
    return left / without, target.size


def _rows(effect: LogCourse, responses: Explanation, offset: float) -> tuple[FloatArray, FloatArray]:
    """Return the terms (readings, terms) of the linear model at an offset [s], and the readings that they explain (readings,).

    The terms are 1, the time or decays exp(-t / constant) of earlier heat, and the other course shifted by the offset.
    """
    thin = slice(None, None, max(1, effect.times.size // MAX_COMPARED_READINGS))
    times, target = effect.times[thin], effect.values[thin]
    inside = (times >= offset) & (times <= offset + responses.times[-1])
    times, target = times[inside], target[inside]
    after = np.clip(np.searchsorted(responses.times, times - offset), 1, responses.times.size - 1)
    part = (times - offset - responses.times[after - 1]) / (responses.times[after] - responses.times[after - 1])
    moved = responses.columns[after - 1] + part[:, None] * (responses.columns[after] - responses.columns[after - 1])
    since = times - (times[0] if times.size else 0.0)
    decays = (
        np.unique(responses.constants)[np.linspace(1, np.unique(responses.constants).size - 1, DECAYS).astype(int)]
        if responses.constants.size
        else np.zeros(0)
    )
    own = [np.exp(-since / constant) for constant in decays] or [times / max(effect.times[-1], 1e-9)]
    return np.column_stack([np.ones(times.size), *own, moved]), target


def _solved(rows: FloatArray, target: FloatArray) -> tuple[float, FloatArray]:
    """Return the sum of squares that `_fitted` leaves, and its x (terms,)."""
    residuals, shares = _fitted(rows, target)
    return float(residuals @ residuals), shares


def _fitted(rows: FloatArray, target: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the residuals (readings,) and x (terms,) of least squares, rows x = target: ``|target - rows x|^2 + (w |rows| |x|)^2`` least.

    Parameters
    ----------
    rows : array (readings, terms)      Terms of the linear model, the first one constant, which w = `SHARES_HELD` leaves alone.
    target : array (readings,)          Readings that it explains.
    """
    from scipy.linalg import solve

    about, centred = rows - rows.mean(axis=0), target - target.mean()
    scale = np.linalg.norm(about, axis=0)
    scale[scale <= 1e-12 * np.linalg.norm(rows, axis=0)] = 1.0  # a constant
    about = about / scale
    x = solve(about.T @ about + SHARES_HELD**2 * np.eye(scale.size), about.T @ centred, assume_a="pos", check_finite=False)
    return centred - about @ x, x / scale


def _error(effect: LogCourse, responses: Explanation, best: float, step: float) -> float:
    """Return the standard error of an offset `best` [s]: where ln of the sum of squares rises by 1 / n, n the independent points. [s]

    Points of residuals that are autocorrelated are not independent. Of m points with a correlation r between neighbours m (1 - r) / (1 +
    r) count, at least `MIN_INDEPENDENT`, r from the sign changes acos(r) / pi times a point (Rice), which slow changes of a few points do
    not disturb. At least `step` / sqrt(12), `step` [s] that of the coarser log.
    """
    residuals, _ = _fitted(*_rows(effect, responses, best))
    changes = np.count_nonzero(np.diff(np.sign(residuals)))
    count = max(residuals.size * float(np.tan(0.5 * np.pi * min(changes / residuals.size, 0.5))) ** 2, MIN_INDEPENDENT)
    base = max(_part_unexplained(effect, responses, best), 1e-12)
    for width in np.geomspace(0.1 * step, max(effect.times[-1], step), 32).tolist():
        rise = min(_part_unexplained(effect, responses, best - width), _part_unexplained(effect, responses, best + width)) / base
        if np.log(rise) > 1.0 / count:
            return float(max(width, step / 12.0**0.5))
    return float(effect.times[-1])
