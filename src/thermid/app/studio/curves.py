"""Curves as a page shows them: thinned to what a screen can hold, without hiding an extreme."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from thermid.base.errors import DeckError
from thermid.base.linear_algebra import Array
from thermid.reporting.looks import thinned

Window = tuple[float, float] | None
MAX_SENT_POINTS = 1200
"""Points of a curve that are sent to a page: more than a screen has columns for it."""


def _none() -> Array:
    """Return no samples."""
    return np.zeros(0)


@dataclass(frozen=True, eq=False)
class ThinnedCurve:
    """One sensor, or one node where nothing was measured, at the points that a page shows.

    Parameters
    ----------
    name, node : str            The sensor, the node that it observes.
    times : array (points,)     [s]
    simulated : array (points,) [degC]
    seen : array (seen,)        Times of the measured points. [s]
    measured : array (seen,)    Empty where nothing was measured. [degC]
    apart : array (apart,)      Times of what is left; it is thinned by itself, since its extremes lie elsewhere. [s]
    left : array (apart,)       Measured less simulated. [K]
    rmse, bias, largest, count  Of all readings, not only of the points shown. [K]
    sigma : float               Standard deviation that weighs the sensor's residuals. [K]
    """

    name: str
    node: str
    times: Array
    simulated: Array
    seen: Array = field(default_factory=_none)
    measured: Array = field(default_factory=_none)
    apart: Array = field(default_factory=_none)
    left: Array = field(default_factory=_none)
    rmse: float = math.nan
    bias: float = math.nan
    largest: float = math.nan
    count: int = 0
    sigma: float = math.nan

    def as_object(self, measured: bool) -> dict[str, Any]:
        """Return it for a page, without what was measured where that is not asked for."""
        still = ("name", "node", "seen", "measured", "count", "sigma") if measured else ()
        return {k: getattr(self, k) for k in (*still, "times", "simulated", "apart", "left", "rmse", "bias", "largest")}


@dataclass(frozen=True, eq=False)
class RunCurves:
    """All curves of one record or scenario."""

    name: str
    curves: tuple[ThinnedCurve, ...]
    remarks: tuple[str, ...] = ()


def thinned_curve(times: Array, values: Array, window: Window = None, points: int = MAX_SENT_POINTS) -> tuple[Array, Array]:
    """Return at most `points` samples of a curve that keep its lowest and highest values in every interval shown.

    Parameters
    ----------
    times, values : array (samples,)    Values may have gaps (nan), which stay; see `chart.thinned`.
    window : (begin, end)               Only this stretch, with one sample more on either side; all where none is given. [s]
    points : int                        Even; a stretch with fewer samples is returned as it is.
    """
    if window is not None:
        first = max(int(np.searchsorted(times, window[0])) - 1, 0)
        last = int(np.searchsorted(times, window[1], side="right")) + 1
        times, values = times[first:last], values[first:last]
    if times.size <= points:
        return times, values
    chosen = thinned(values, points)
    return times[chosen], values[chosen]


def texts_of(query: Mapping[str, Any], key: str) -> tuple[str, ...]:
    """Return the texts of a list that a page gives.

    Raises
    ------
    DeckError   When it is no list of texts.
    """
    several = query.get(key) or ()
    if not isinstance(several, list | tuple) or not all(isinstance(one, str) for one in several):
        raise DeckError(f"'{key}' is no list of texts.", "studio", code="value.wrong-kind")
    return tuple(several)


def text_of(query: Mapping[str, Any], key: str) -> str:
    """Return a text that a page gives; empty without one.

    Raises
    ------
    DeckError   When it is no text.
    """
    text = query.get(key, "")
    if not isinstance(text, str):
        raise DeckError(f"'{key}' is not a text.", "studio", code="value.wrong-kind")
    return text


def number_of(query: Mapping[str, Any], key: str) -> float:
    """Return a number that a page gives.

    Raises
    ------
    DeckError   When it is no number, or has no end.
    """
    number = query.get(key)
    if not isinstance(number, int | float) or isinstance(number, bool) or not math.isfinite(number):
        raise DeckError(f"'{key}' is not a number.", "studio", code="value.wrong-kind")
    return float(number)


def window_of(query: Mapping[str, Any]) -> Window:
    """Return the stretch that a page shows, or None for all of it. [s]

    Raises
    ------
    DeckError   When it is no pair of times.
    """
    window = query.get("window")
    if window is None:
        return None
    if not isinstance(window, list) or len(window) != 2 or not all(isinstance(v, int | float) for v in window) or not window[0] < window[1]:
        raise DeckError("give a window as two times, the earlier first.", "studio", code="value.wrong-kind")
    return float(window[0]), float(window[1])
