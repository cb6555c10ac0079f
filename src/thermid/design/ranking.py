"""Tests that could be made, ranked by the error that they would leave."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from thermid.fit.uncertainty.grouping import percent
from thermid.measure.amounts import duration_text, short

Array = NDArray[np.float64]
FELT = 0.1
"""Part of the error now below which what else a prediction has is not spoken of."""


@dataclass(frozen=True)
class Option:
    """A test that could be made, and what it would be worth.

    Parameters
    ----------
    name : str              What is done.
    error : float           Standard error of the target after all of it; infinite where it cannot be made. [SI]
    hours : float           Duration after which the goal is met, or, without one, nine tenths of the gain are in; infinite where never.
    longest : float         Its whole duration. [h]
    errors : array (durations, 2)   Duration [h] and error [SI].
    refused : str           Why it cannot be made; empty where it can.
    """

    name: str
    error: float
    hours: float
    longest: float
    errors: Array
    refused: str = ""


@dataclass(frozen=True, eq=False)
class Advice:
    """What to test next.

    Parameters
    ----------
    target : str            What is to be known better.
    value, now : float      Its value and standard error now. [SI]
    unit : str              'K' for a prediction; SI unit of a parameter otherwise.
    goal : float            Error to be reached; nan without one. [SI]
    options : tuple         The best first.
    beside : dict           Of a prediction: cause -> standard error [K] that it has besides and that these figures leave out.
    """

    target: str
    value: float
    now: float
    unit: str
    goal: float
    options: tuple[Option, ...]
    beside: Mapping[str, float] = field(default_factory=dict)

    @property
    def best(self) -> Option:
        """The first option."""
        return self.options[0]

    def _shown(self, error: float) -> str:
        return f"{short(error)} K" if self.unit == "K" else percent(error / abs(self.value) if self.value else np.inf)

    def __str__(self) -> str:
        """Return a table: what to do, what error it leaves, how long it takes."""
        aim = f", wanted +- {self._shown(self.goal)}" if np.isfinite(self.goal) else ""
        lines = [f"Next test for {self.target}: now +- {self._shown(self.now)}{aim}"]
        width = max(len(o.name) for o in self.options)
        for o in self.options:
            if o.refused:
                lines.append(f"  {o.name:<{width}}  cannot be made: {o.refused}")
                continue
            gain = f"{short(self.now / o.error)} times better" if self.now > 1.02 * o.error else "no better"
            took = duration_text(3600 * o.hours) if np.isfinite(o.hours) else ""
            what = "goal after" if np.isfinite(self.goal) else "most of it after"
            long = duration_text(3600 * o.longest)
            when = f"{what} {took} of {long}" if took else f"goal not within {long}"
            lines.append(f"  {o.name:<{width}}  +- {self._shown(o.error):<10} {gain:<20} {when}")
        felt = {cause: error for cause, error in self.beside.items() if error >= FELT * self.now}
        if felt:
            named = ", ".join(f"{cause} +- {short(error)} K" for cause, error in felt.items())
            lines.append(f"  Not in these figures: {named}.")
        return "\n".join(lines)
