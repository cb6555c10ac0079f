"""Duty cycles: for what part of a run, and of its last cycle, a thermostat was on, and the power that this brought."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from thermid.base.linear_algebra import Array
from thermid.base.units import counted, duration_text, short


def on_shares(times: Array, states: Array, before: int, end: float) -> tuple[float, float, float]:
    """Return the share of a run for which a thermostat was on [-], that of its last complete cycle [-], and how long this took [s].

    A cycle goes from one switching on to the next; without two of them the last two numbers are NaN.

    Parameters
    ----------
    times, states : array (switchings,)     When it switched, in order [s], and its new states, 1 for on.
    before : int                            Its state at the start.
    end : float                             Of the run. [s]
    """
    edges, on = np.array([0.0, *times, end]), np.array([before, *states])
    starts = edges[1:-1][on[1:] > 0][-2:]
    whole = float(on @ np.diff(edges)) / end
    if starts.size < 2:
        return whole, np.nan, np.nan
    period = float(starts[1] - starts[0])
    return whole, float(on @ np.diff(np.clip(edges, *starts))) / period, period


@dataclass(frozen=True)
class DutyCycle:
    """How a thermostat switched over a run, and the power of the loads that it switches.

    Parameters
    ----------
    share, last_share : float   Time on over time, of the run and of its last complete cycle (NaN where there is none). [-]
    period : float              Of that cycle. [s]
    cycles : int                How often it switched on.
    energy : float              Of the run. [J]
    mean_power, last_power      Mean power over the run, and over the last cycle at the mean power of the time on. [W]
    """

    share: float
    last_share: float
    period: float
    cycles: int
    energy: float
    mean_power: float
    last_power: float

    def __str__(self) -> str:
        """Return both shares and powers in words."""
        last = f"; last cycle, {duration_text(self.period)}: {100 * self.last_share:.1f} %, {short(self.last_power, 3)} W"
        return (
            f"duty cycle {100 * self.share:.1f} %, mean power {short(self.mean_power, 3)} W, energy {short(self.energy / 3600.0, 3)} W h, "
            f"switched on {counted(self.cycles, 'time')}{last if np.isfinite(self.period) else ''}"
        )

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain numbers; None where there is no complete cycle."""
        return {name: None if value != value else value for name, value in asdict(self).items()}
