"""By how much one clock is late on another, where both logs show the same step of a power or a temperature.

In: courses of two logs, each on its own clock. Out: the offset with its standard error, and what it was found from. A course of one log
explains one of the other: as it is, where both are temperatures or both powers; where one is a power and the other a temperature, by a sum
of first-order responses with time constants from seconds to the length of the log, as every network of resistances and capacitances has.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from thermid.measure._record.channel import FloatArray

POINTS, OFFSETS = 1500, 300
"""Most readings that two courses are compared at, and offsets that are tried at first. [-]"""
RESPONSES = (8, 5, 12)
"""First-order responses that stand for the way from a power to a thermometer; what they disagree by is an error of the offset. [-]"""
SHARED = 0.5
"""Part of the shorter log that must overlap the other one. [-]"""
EXPLAINED = 0.9
"""Part of the squares that the other course must explain; two courses that wander explain half of each other by chance. [-]"""
VAGUE = 0.1
"""Error of an offset, in lengths of the shorter log, from which there is no step that both show. [-]"""
FINER = 3
"""How often offsets are tried again, eight times as close about the best."""


MAX_POINTS = 20000
"""Points of a response, at most."""
Made = tuple[FloatArray, FloatArray]
"""Times (points,) of the second log, and what explains the first one there (points, columns)."""


@dataclass(frozen=True, eq=False)
class LogCourse:
    """One column over its own clock.

    Parameters
    ----------
    name : str
    power : bool                Whether it is a power, which holds until the next reading; else a temperature.
    times : array (samples,)    From the first sample of its log. [s]
    values : array (samples,)   [W or K]
    heated : bool               Whether a power may heat it: not the surroundings.
    """

    name: str
    power: bool
    times: FloatArray
    values: FloatArray
    heated: bool = True

    @property
    def moves(self) -> bool:
        """Whether it is a course at all."""
        return self.values.size >= 8 and float(np.ptp(self.values)) > 0.0

    def responses(self, fine: float, count: int) -> tuple[FloatArray, FloatArray]:
        """Return times (points,) and first-order responses (points, responses) to a power that held its first value before. [s, W]"""
        from scipy.signal import lfilter

        times = np.arange(0.0, self.times[-1] + fine, fine)
        held = self.values[np.clip(np.searchsorted(self.times, times, side="right") - 1, 0, self.times.size - 1)] - self.values[0]
        out = []
        for constant in np.geomspace(4.0 * fine, times[-1], count):
            decay = float(np.exp(-fine / constant))
            out.append(lfilter([0.0, 1.0 - decay], [1.0, -decay], held))  # the value of an interval acts at its end
        return times, np.column_stack(out)


@dataclass(frozen=True)
class CommonStep:
    """An offset that courses of two logs show.

    Parameters
    ----------
    offset : float      By how much the second clock's zero is late on the first one. [s]
    error : float       Its standard error; a mass between a power and a thermometer delays a step beyond it. [s]
    first, second : str Columns that it was found from.
    explained : float   Part of the squares that the second explains. [-]
    """

    offset: float
    error: float
    first: str
    second: str
    explained: float


def common_step(first: Sequence[LogCourse], second: Sequence[LogCourse]) -> CommonStep | None:
    """Return the offset that two logs show with the least error; None where no course of one explains a course of the other.

    An error above a tenth of the shorter log is no step either. Temperatures of two places follow a step at different times: what the
    pairs of places disagree by is an error of an offset that two of them show.
    """
    offsets, places = [], []
    for a, b in ((a, b) for a in first for b in second if a.moves and b.moves):
        if (one := _compared(a, b)) is not None:
            offsets.append(one)
            places += [one] if a.heated and b.heated and not a.power and not b.power else []
    length = min((c.times[-1] for c in (*first, *second) if c.moves), default=0.0)
    if places:
        spread = float(np.std([f.offset for f in places]))
        offsets = [replace(f, error=float(np.hypot(f.error, spread))) if f in places else f for f in offsets]
    best = min(offsets, key=lambda f: f.error, default=None)
    return best if best is not None and best.error <= VAGUE * length else None


def _compared(a: LogCourse, b: LogCourse) -> CommonStep | None:
    """Return the offset between two courses, the second one's clock late on that of the first."""
    if not (a.heated and b.heated) and (a.power != b.power or a.heated != b.heated):
        return None  # no power and no heated part acts on the surroundings
    forward = a.power <= b.power  # what explains is the power, or the second of a kind
    effect, cause, sign = (a, b, 1.0) if forward else (b, a, -1.0)
    shorter = SHARED * min(a.times[-1], b.times[-1])
    low, high = shorter - cause.times[-1], effect.times[-1] - shorter
    step = max(float(np.median(np.diff(a.times))), float(np.median(np.diff(b.times))))
    offsets, spacing = np.linspace(low, high, OFFSETS + 1), (high - low) / OFFSETS
    ways = _ways(effect, cause)
    first = _lowest(effect, ways[0], offsets)
    if not 1.0 - _part_unexplained(effect, ways[0], first) >= EXPLAINED:
        return None
    refined = [_refined_offset(effect, responses, first, spacing, step) for responses in ways]
    error = max(_error(effect, responses, offset, step) for responses, offset in zip(ways, refined, strict=True))
    return CommonStep(
        sign * float(np.median(refined)),
        float(np.hypot(error, np.std(refined))),
        a.name,
        b.name,
        1.0 - _part_unexplained(effect, ways[0], refined[0]),
    )


def _ways(effect: LogCourse, cause: LogCourse) -> list[Made]:
    """Return how one course may act on another: several sets of responses where a power acts on a temperature, else as it is."""
    if cause.power == effect.power:
        return [(cause.times, cause.values[:, None])]
    fine = max(float(np.median(np.diff(cause.times))), cause.times[-1] / MAX_POINTS)
    return [cause.responses(fine, count) for count in RESPONSES]


def _lowest(effect: LogCourse, responses: Made, offsets: FloatArray) -> float:
    return float(offsets[int(np.argmin([_part_unexplained(effect, responses, o) for o in offsets]))])


def _refined_offset(effect: LogCourse, responses: Made, best: float, spacing: float, step: float) -> float:
    """Return the offset that leaves least, near one of a spacing. [s]"""
    for _ in range(FINER):
        best = _lowest(effect, responses, best + np.linspace(-4.0, 4.0, 33) * spacing)
        spacing /= 8.0
        if spacing < 0.05 * step:
            break
    return best


def _part_unexplained(effect: LogCourse, responses: Made, offset: float) -> float:
    """Return the part of the squares of one course that the other one, later by an offset, leaves; 1 where it explains nothing."""
    rows, target = _rows(effect, responses, offset)
    if target.size < 4 * rows.shape[1] or float(np.ptp(rows[:, 2])) == 0.0:
        return 1.0
    (without, _), (left, shares) = _solved(rows[:, :1], target), _solved(rows, target)
    if without <= 0.0 or (responses[1].shape[1] == 1 and shares[-1] <= 0.0):  # of one kind: what warms one place does not cool the other
        return 1.0
    return left / without


def _rows(effect: LogCourse, responses: Made, offset: float) -> tuple[FloatArray, FloatArray]:
    """Return the rows of the linear model (readings, unknowns), constant and drift first, and the readings that they explain."""
    at, values = responses
    thin = slice(None, None, max(1, effect.times.size // POINTS))
    times, target = effect.times[thin], effect.values[thin]
    inside = (times >= offset) & (times <= offset + at[-1])
    times, target = times[inside], target[inside]
    moved = [np.interp(times - offset, at, column) for column in values.T]
    return np.column_stack([np.ones(times.size), times / max(effect.times[-1], 1e-9), *moved]), target


def _solved(rows: FloatArray, target: FloatArray) -> tuple[float, FloatArray]:
    """Return the squares that a linear model leaves, and the shares of its columns."""
    scale = np.linalg.norm(rows, axis=0)
    scale[scale == 0.0] = 1.0
    shares = np.linalg.lstsq(rows / scale, target, rcond=None)[0] / scale
    left = target - rows @ shares
    return float(left @ left), shares


def _error(effect: LogCourse, responses: Made, best: float, step: float) -> float:
    """Return the standard error of an offset: where the logarithm of the squares rises by one over the independent points.

    Points of residuals that wander are not independent: as many count as there are changes of sign, at least four. [s]
    """
    rows, target = _rows(effect, responses, best)
    scale = np.linalg.norm(rows, axis=0)
    residuals = target - rows @ (np.linalg.lstsq(rows / scale, target, rcond=None)[0] / scale)
    count = max(int(np.count_nonzero(np.diff(np.sign(residuals)))), 4)
    base = max(_part_unexplained(effect, responses, best), 1e-12)
    for width in _widths(step, float(effect.times[-1])):
        rise = min(_part_unexplained(effect, responses, best - width), _part_unexplained(effect, responses, best + width)) / base
        if np.log(rise) > 1.0 / count:
            return float(max(width, step / 12.0**0.5))
    return float(effect.times[-1])


def _widths(step: float, length: float) -> Iterator[float]:
    """Yield half-widths from a part of a step to the whole length. [s]"""
    width = 0.1 * step
    while width < length:
        yield width
        width *= 1.3
