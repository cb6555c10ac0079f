"""`Slider`: a parameter that may be moved, in its unit and within its bounds."""

from __future__ import annotations

import math
from dataclasses import dataclass

from thermid.model.tree.tree import Entry
from thermid.units import unit


@dataclass(frozen=True)
class Slider:
    """A parameter that may be moved.

    Parameters
    ----------
    path : str              The parameter.
    unit : str              In which values and bounds are written.
    value, low, high        Where it starts and how far it may go. [unit]
    log : bool              Whether the track is logarithmic.
    free : bool             Whether the stage fits it.
    error : float or None   Standard error that the fit found. [unit]
    source, note : str      Where the value comes from.
    also : tuple of str     Other instances that move with it.
    """

    path: str
    unit: str
    value: float
    low: float
    high: float
    log: bool
    free: bool = False
    error: float | None = None
    source: str = ""
    note: str = ""
    also: tuple[str, ...] = ()


def slider_of(path: str, entry: Entry, value: float, error: float | None, free: bool, also: tuple[str, ...]) -> Slider:
    """Return the slider of a parameter: its own bounds, or a factor of five either way where it has none."""
    given = entry.parameter
    of = unit(given.unit or "1")
    low, high = (None if b is None else _plain(b, given.unit) for b in (given.minimum, given.maximum))
    at = _plain(value, given.unit)
    log = at > 0 and not of.absolute and (low is None or low > 0)
    span = abs(at) if not of.absolute else 50.0
    low = low if low is not None else at / 5 if log else at - span
    high = high if high is not None else at * 5 if log else at + span
    shown = None if error is None or not math.isfinite(error) else error / float(of.factor)
    note = "; ".join(t for t in (given.note, given.basis) if t)
    return Slider(path, of.text, at, min(low, at), max(high, at), log, free, shown, given.source or entry.origin, note, also)


def _plain(si: float, text: str) -> float:
    of = unit(text or "1")
    return (si - float(of.offset)) / float(of.factor)
