"""Moving windows in time, a zero-phase low-pass, and resampling, over plain arrays. Masked samples never enter a result."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from thermid.base.units import DEVIATION_OF_MEDIAN
from thermid.measure._record.channel import BoolArray, FloatArray, usual_step

_CELLS = 1_000_000


def _gathered(times: FloatArray, values: FloatArray, valid: BoolArray, window: float) -> Iterator[tuple[slice, FloatArray]]:
    """Yield blocks of times, and for each the samples within half a window [s] of it (times, width), NaN where there is none.

    Blocks bound the memory. `values` and `valid` are (times,).
    """
    half = 0.5 * window * (1 + 1e-9) + 1e-12 * float(np.abs(times).max())
    first, last = np.searchsorted(times, times - half, "left"), np.searchsorted(times, times + half, "right")
    samples = np.where(valid, values, np.nan)
    width = int((last - first).max())
    rows = max(1, _CELLS // width)
    for at in range(0, times.size, rows):
        block = slice(at, min(at + rows, times.size))
        index = first[block, None] + np.arange(width)
        inside = index < last[block, None]
        yield block, np.where(inside, samples[np.minimum(index, times.size - 1)], np.nan)


def _middle(rows: FloatArray) -> FloatArray:
    """Return the median (rows,) of each row (rows, width) without its NaN; NaN for a row without samples. [as rows]"""
    ordered = np.sort(rows, axis=1)  # NaN goes last
    count = np.count_nonzero(~np.isnan(ordered), axis=1)
    low = np.take_along_axis(ordered, np.maximum(count - 1, 0)[:, None] // 2, axis=1)[:, 0]
    high = np.take_along_axis(ordered, np.minimum(count // 2, ordered.shape[1] - 1)[:, None], axis=1)[:, 0]
    return np.where(count > 0, 0.5 * (low + high), np.nan)


def moving_median(times: FloatArray, values: FloatArray, valid: BoolArray, window: float) -> FloatArray:
    """Return the median of the valid samples within half a window of each time; at the ends the window is cut, not mirrored.

    Parameters
    ----------
    times : array (samples,)    Increasing, even or not. [s]
    values : array (samples,)   Samples.
    valid : array (samples,)    False where masked.
    window : float              Whole width. [s]
    """
    out = np.empty_like(values)
    for block, rows in _gathered(times, values, valid, window):
        out[block] = _middle(rows)
    return out


def hampel(times: FloatArray, values: FloatArray, valid: BoolArray, window: float) -> tuple[FloatArray, FloatArray]:
    """Return the moving median m and 1.4826 times the median of |values - m| in the window, the robust standard deviation.

    Arguments are those of `moving_median`.

    Notes
    -----
    The factor makes it the standard deviation of normal samples: F. R. Hampel, The influence curve and its role in robust estimation,
    J. Am. Stat. Assoc. 69 (1974) 383-393, DOI 10.1080/01621459.1974.10482962.
    """
    centre, spread = np.empty_like(values), np.empty_like(values)
    for block, rows in _gathered(times, values, valid, window):
        centre[block] = _middle(rows)
        spread[block] = DEVIATION_OF_MEDIAN * _middle(np.abs(rows - centre[block, None]))
    return centre, spread


def low_pass(values: FloatArray, valid: BoolArray, step: float, window: float) -> FloatArray:
    """Return samples of an even grid through a second-order Butterworth low-pass, forward and backward, so that nothing shifts in time.

    The amplitude of a period p falls by 1 / (1 + (window / p)^4).

    Parameters
    ----------
    values : array (samples,)   Samples.
    valid : array (samples,)    False where masked; masked stretches of up to a window are bridged, longer ones split the signal.
    step : float                Step of the grid. [s]
    window : float              Period at which half the amplitude remains; above two steps. [s]
    """
    from scipy.signal import butter, sosfiltfilt

    sections = butter(2, 1.0 / window, fs=1.0 / step, output="sos")
    out = values.copy()
    places = np.flatnonzero(valid)
    for run in np.split(places, np.flatnonzero(np.diff(places) * step > window) + 1):
        grid = np.arange(run[0], run[-1] + 1)
        bridged = np.interp(grid, run, values[run])
        # four windows, reflected about each end, let the start of the filter decay to exp(-17); a short run has less to reflect
        pad = min(grid.size - 1, int(np.ceil(4.0 * window / step)))
        smooth = sosfiltfilt(sections, bridged, padlen=pad)
        out[run] = smooth[run - run[0]]
    return out


def _around(times: FloatArray, valid: BoolArray, grid: FloatArray) -> tuple[FloatArray, np.ndarray, np.ndarray]:
    """Return the times of valid samples (valid,) [s] and, for each of `grid` (grid,) [s], which of them comes last before and first after.

    A sample at a grid time, to 1e-9 of the log, is both; -1 before the first, the number of samples after the last.
    """
    valid_times = times[valid]
    near = 1e-9 * max(float(valid_times[-1] - valid_times[0]), usual_step(grid))
    before = np.searchsorted(valid_times, grid + near, "right") - 1
    after = np.searchsorted(valid_times, grid - near, "left")
    return valid_times, before, after


def interpolate(times: FloatArray, values: FloatArray, valid: BoolArray, grid: FloatArray, max_gap: float) -> tuple[FloatArray, BoolArray]:
    """Return linear interpolation at the times of a grid, NaN where it does not hold, and where it holds: inside the ends, not in a gap.

    Parameters
    ----------
    times, values, valid : array (samples,)     The samples. [s]
    grid : array (grid,)                        Times that are asked for. [s]
    max_gap : float                             Longest interval that is bridged. [s]
    """
    valid_times, before, after = _around(times, valid, grid)
    inside = (before >= 0) & (after < valid_times.size)
    low, high = np.maximum(before, 0), np.minimum(after, valid_times.size - 1)
    good = inside & (valid_times[high] - valid_times[low] <= max_gap * (1 + 1e-9))
    return np.where(good, np.interp(grid, valid_times, values[valid]), np.nan), good


def hold(times: FloatArray, values: FloatArray, valid: BoolArray, grid: FloatArray, max_gap: float) -> tuple[FloatArray, BoolArray]:
    """Return the last valid sample at the times of a grid, NaN where it does not hold, and where it holds (grid,).

    It holds from the first valid sample on, where the valid samples before and after are at most `max_gap` apart; after the last one, for
    `max_gap`. Arguments are those of `interpolate`.
    """
    valid_times, before, after = _around(times, valid, grid)
    low, high = np.maximum(before, 0), np.minimum(after, valid_times.size - 1)
    span = np.where(after < valid_times.size, valid_times[high], grid) - valid_times[low]
    good = (before >= 0) & (span <= max_gap * (1 + 1e-9))
    return np.where(good, values[valid][low], np.nan), good


def mean_until_next(times: FloatArray, values: FloatArray, grid: FloatArray) -> FloatArray:
    """Return the mean of held samples from each time of a grid to the next one; the last one is the sample that holds there.

    Parameters
    ----------
    times, values : array (samples,)    Valid samples, each held until the next. [s]
    grid : array                        Increasing. [s]
    """
    near = 1e-9 * max(float(times[-1] - times[0]), usual_step(grid))
    last = np.maximum(np.searchsorted(times, grid + near, "right") - 1, 0)
    heat = np.concatenate([[0.0], np.cumsum(values[:-1] * np.diff(times))])[last] + values[last] * (grid - times[last])
    changes = times[1:][np.diff(values) != 0.0]
    inside = np.searchsorted(changes, grid[1:] - near, "left") > np.searchsorted(changes, grid[:-1] + near, "right")
    return np.concatenate([np.where(inside, np.diff(heat) / np.diff(grid), values[last[:-1]]), values[last[-1:]]])
