"""A law of the user: a Python function of one temperature or one difference, tabulated so finely that the kernel can take its place."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, Literal

import numpy as np

from thermid.base.errors import DeckError, errors_at, refuse_first, refuse_unknown
from thermid.base.units import Array, Indices, si_value
from thermid.model._laws.options import Source
from thermid.model._laws.stores import Curve, hermite

MIN_POINT_DISTANCE: Final = 1e-3
"""Points stand no closer than this: a kink is rounded over it. [K]"""
MAX_POINTS: Final = 20_000
"""Points of one table, beyond which the function is refused."""
WATCH: Final = 0.1
"""Distance of the points at which the function is looked at before anything is known of it. [K]"""
ERROR_FLOOR_SHARE: Final = 1e-3
"""Share of the largest value below which errors count relative to that share, so that a zero needs no end of points."""
SLOPE_STEP: Final = 1e-5
"""Step of the differences that give slopes. [K]"""


def law(
    function: Callable[[Any], Any],
    *,
    over: Literal["temperature", "difference"] = "temperature",
    between: tuple[str | float, str | float],
    tolerance: float = 1e-7,
    source: Source | Literal[""] = "",
    basis: str = "",
) -> Curve:
    """Return a function as a smooth table with slopes, for the `table` of a conductor or a load.

    Parameters
    ----------
    function : callable         Takes kelvin, an array or one number; returns a conductance [W/K], or for a load a power [W].
    over : str                  What it takes: 'temperature', the mean of a conductor's ends or that of a load's node; or 'difference', the
                                first end's less the second's, of both signs.
    between : (low, high)       Range over which it is asked; constant beyond, and a run that leaves the range states this. [K]
    tolerance : float           Largest relative error between points; where the function is smaller than a thousandth of its largest
                                value, relative to that. A kink is rounded over 1 mK. [-]
    source, basis : str         Kind of source, as of a value of a deck, and what the function rests on.

    Raises
    ------
    DeckError   When the function fails, jumps, is not finite or swings too fast somewhere; the message says where.
    """
    refuse_unknown([over], ("temperature", "difference"), "law", "over = '{}' is neither 'temperature' nor 'difference'.", DeckError)
    low, high = (_end(b, "temperature" if over == "temperature" else "K") for b in between)
    refuse_first(
        "law, {}".format,
        (
            not (low < high and np.isfinite([low, high]).all() and (over == "difference" or low >= 0.0)),
            f"between {low:g} K and {high:g} K the range is empty. Give the lower end first.",
            "between",
            "value.outside-range",
        ),
        (
            not 1e-12 <= tolerance < 1.0,
            f"a tolerance of {tolerance:g} cannot be reached in double precision. Give 1e-12 or more.",
            "tolerance",
            "value.outside-range",
        ),
    )
    checked = _CheckedFunction(function)
    x = np.array([low, 0.0, high] if over == "difference" and low < 0.0 < high else [low, high])
    knots, values, slopes = _refined(checked, x, tolerance)
    return Curve(over, knots, values, slopes, source=source, basis=basis)


def _end(written: Any, slot: str) -> float:
    """Return one end of the range in kelvin; a plain number is a difference in kelvin. [K]"""
    with errors_at("law, between"):
        value = si_value(written, slot)
    return float(written) if value is None else value


class _CheckedFunction:
    """The user's function, called with arrays (points,); every answer is checked for its shape and for numbers that are not finite."""

    def __init__(self, function: Callable[[Any], Any]) -> None:
        self.function = function

    def __call__(self, at: Array) -> Array:
        """Return the values (points,) at `at`, in one call where the function takes arrays."""
        with np.errstate(all="ignore"):
            try:
                values = np.asarray(self.function(at.copy()), dtype=float)
            except (TypeError, ValueError):
                values = np.array([self._one(x) for x in at.tolist()])
            except Exception as error:
                raise DeckError(f"the function fails: {type(error).__name__}: {error}.", "law", code="model.law-refused") from error
        if values.shape not in ((), at.shape):
            raise DeckError(
                f"the function returns {values.shape} for {at.shape} temperatures; it must return one value for each.",
                "law",
                code="value.shape",
            )
        values = np.broadcast_to(values, at.shape)
        bad = ~np.isfinite(values)
        if bad.any():
            raise DeckError(
                f"the function is {values[bad][0]} at {at[bad][0]:.9g} K. Correct the function there, or choose another range.",
                "law",
                code="model.law-refused",
            )
        return values

    def _one(self, x: float) -> float:
        """Return the function at one temperature [K], an error of it as a DeckError that names the temperature."""
        try:
            return float(self.function(x))
        except Exception as error:
            raise DeckError(
                f"the function fails at {x:.9g} K: {type(error).__name__}: {error}.", "law", code="model.law-refused"
            ) from error

    def slopes(self, at: Array, low: float, high: float) -> Array:
        """Return the slopes (points,) at temperatures `at` (points,) [K], in the function's unit per K.

        (f(T + h) - f(T - h)) / (2 h) with h = `SLOPE_STEP`; within h of `low` and `high` [K] the one-sided slope of second order, by f''.
        """
        middle = np.clip(at, low + SLOPE_STEP, high - SLOPE_STEP)
        below, right = middle - SLOPE_STEP, middle + SLOPE_STEP
        before, here, after = self(below), self(middle), self(right)
        slope = (after - before) / (right - below)
        bend = (after - 2.0 * here + before) / SLOPE_STEP**2
        return np.asarray(slope + np.where(at == middle, 0.0, bend * (at - middle)))


def _refined(checked: _CheckedFunction, x: Array, tolerance: float) -> tuple[Array, Array, Array]:
    """Return points (points,) [K], values and slopes (points,): intervals are halved until the curve meets the function.

    It does at fresh points in each, those at a fifth, a half and four fifths of an interval (0.211 and 0.789 are where two-point Gauss
    quadrature looks) and a grid of `WATCH`. The curve meets the function f where |curve - f| <= tolerance max(|f|, `ERROR_FLOOR_SHARE`
    max|f|).

    Parameters
    ----------
    x : array (points,)     Points to begin with. [K]
    tolerance : float       Relative. [-]

    Raises
    ------
    DeckError   When it jumps, or needs more than `MAX_POINTS`.
    """
    low, high = float(x[0]), float(x[-1])
    watch = np.linspace(low, high, min(int((high - low) / WATCH) + 2, MAX_POINTS))
    watched = checked(watch)
    largest = float(np.abs(watched).max())
    y, d = checked(x), checked.slopes(x, low, high)
    opened = np.ones(x.size - 1, dtype=bool)
    while True:
        width = np.diff(x)
        fresh = (x[:-1, None] + width[:, None] * (0.211, 0.5, 0.789))[opened].ravel()
        real = checked(fresh)
        largest = max(largest, float(np.abs(real).max()))
        old = opened[_interval(x, watch)]
        at, want = np.concatenate((fresh, watch[old])), np.concatenate((real, watched[old]))
        wrong = np.abs(hermite(x, y, d, at)[0] - want) > tolerance * np.maximum(np.abs(want), ERROR_FLOOR_SHARE * largest)
        coarse = np.unique(_interval(x, at[wrong]))
        halve = coarse[width[coarse] > MIN_POINT_DISTANCE]
        _refuse_jumps(checked, x, coarse[width[coarse] <= MIN_POINT_DISTANCE], largest)
        if not halve.size:
            return x, y, d
        if x.size + halve.size > MAX_POINTS:
            raise DeckError(
                f"the function needs more than {MAX_POINTS} points, most of them near {x[np.argmin(width)]:.6g} K."
                " Allow a larger tolerance or a narrower range, or smooth it there.",
                "law",
                code="model.law-refused",
            )
        new = 0.5 * (x[halve] + x[halve + 1])
        opened = np.zeros(x.size - 1, dtype=bool)
        opened[halve] = True
        opened = np.insert(opened, halve + 1, True)
        more = checked(new), checked.slopes(new, low, high)
        x, y, d = (np.insert(a, halve + 1, b) for a, b in ((x, new), (y, more[0]), (d, more[1])))


def _interval(x: Array, at: Array) -> Indices:
    """Return the index k (places,) with x[k] <= at < x[k + 1], clipped to the first and last interval."""
    return np.clip(np.searchsorted(x, at, side="right") - 1, 0, x.size - 2)


def _refuse_jumps(checked: _CheckedFunction, x: Array, sharp: Indices, largest: float) -> None:
    """Refuse a function that jumps in one of the intervals `sharp` between points `x` (points,): the change across it does not shrink.

    Each interval is halved 24 times, towards the half with the larger change. A jump keeps more than half of the change and is above 1e-9
    of the `largest` value, in the unit of the function.

    Raises
    ------
    DeckError   Names the temperature of the jump.
    """
    for k in sharp.tolist():
        ends = np.array([x[k], x[k + 1]])
        values = checked(ends)
        change = abs(values[1] - values[0])
        for _ in range(24):
            middle = np.array([ends.mean()])
            value = checked(middle)
            right = abs(values[1] - value[0]) > abs(value[0] - values[0])
            ends = np.array([middle[0], ends[1]] if right else [ends[0], middle[0]])
            values = np.array([value[0], values[1]] if right else [values[0], value[0]])
        half_change = abs(values[1] - values[0])
        if half_change > 0.5 * change and half_change > 1e-9 * largest:
            raise DeckError(
                f"the function jumps at {ends[0]:.7g} K, from {values[0]:.6g} to {values[1]:.6g}. A law must be continuous. Connect "
                "both sides over a few hundredths of a kelvin, or use a thermostat.",
                "law",
                code="model.law-refused",
            )
