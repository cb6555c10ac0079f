"""Cells that the tables of a qualification report share: verdicts, marks, temperatures and times."""

from __future__ import annotations

import math

from thermid.physics.constants import ICE_POINT
from thermid.reporting.blocks.cells import DASH, Cell, plain
from thermid.sourced import MARKS


def verdict(passed: bool | None, why: str = "") -> Cell:
    """Return a verdict as a cell, why it is not decided behind it."""
    if passed is None:
        return Cell("not decided", why, "warn")
    return Cell("✓ met", "", "good") if passed else Cell("✗ not met", "", "bad")


def celsius(kelvin: float, decimals: int = 1) -> str:
    """Return a temperature in degrees Celsius; a dash where there is none."""
    return f"{kelvin - ICE_POINT:.{decimals}f}" if math.isfinite(kelvin) else DASH


def given(kelvin: float) -> str:
    """Return a limit in degrees Celsius with the digits that it was given in, so that what is left to it adds up; a dash for none."""
    return plain(kelvin - ICE_POINT) if math.isfinite(kelvin) else DASH


def hours(seconds: float) -> str:
    """Return a time in hours, in minutes below two."""
    return f"{seconds / 3600:.2f} h" if seconds >= 7200 else f"{seconds / 60:.1f} min"


def mark(name: str) -> Cell:
    """Return how sure a number is, what that means behind it; what is from memory stands out."""
    return Cell(name, MARKS[name], "warn" if name == "memory" else "")
