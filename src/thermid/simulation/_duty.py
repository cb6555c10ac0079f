"""Duty cycles: for what part of a run, and of its last cycle, a thermostat was on, and the power that this brought."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from thermid.base.units import Array, counted, duration_text, short


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


@dataclass(frozen=True, eq=False)
class DutyCycle:
    """How a thermostat switched over a run, and the power of the loads that it switches.

    Parameters
    ----------
    share, last_share : float   Time on over time, of the run and of its last complete cycle (NaN where there is none). [-]
    period : float              Of that cycle. [s]
    cycles : int                How often it switched on.
    energy : float              Of the run. [J]
    mean_power, last_power      Mean power over the run, and over the last cycle at the mean power of the time on. [W]
    members : array (n, 2)      Of a prediction: both shares of its members, which switch at different times; no rows of a run. [-]
    """

    share: float
    last_share: float
    period: float
    cycles: int
    energy: float
    mean_power: float
    last_power: float
    members: Array = field(default_factory=lambda: np.zeros((0, 2)), repr=False)

    def of_members(self, members: Array) -> DutyCycle:
        """Return the duty cycle with shares (of the run, of its end) [-] that are means over members (members, 2), NaN left out.

        Energy [J] and powers [W] follow the shares in proportion.
        """
        own, means = (
            np.array([self.share, self.last_share]),
            [np.mean(x[np.isfinite(x)] if np.isfinite(x).any() else np.nan) for x in members.T],
        )
        share, last = np.where(np.isfinite(means), means, own).tolist()
        run_part, last_part = (a / b if b > 0.0 else 1.0 for a, b in ((share, self.share), (last, self.last_share)))
        powers = self.energy * run_part, self.mean_power * run_part, self.last_power * last_part
        return DutyCycle(share, last, self.period, self.cycles, *powers, members)

    def interval(self, level: float = 0.95) -> Array:
        """Return the ends (2, 2) of the band of both shares over the members that have them; NaN where there are none. [-]"""
        columns = [column[np.isfinite(column)] for column in self.members.T]
        ends = (0.5 - level / 2, 0.5 + level / 2)
        return np.array([np.quantile(x, ends) if x.size else (np.nan, np.nan) for x in columns]).T

    def __str__(self) -> str:
        """Return both shares and powers in words."""
        run, last = (f" (95 %: {100 * a:.1f} .. {100 * b:.1f})" if np.isfinite(a) else "" for a, b in self.interval().T)
        words = f"; last cycle, {duration_text(self.period)}: {100 * self.last_share:.1f} %{last}, {short(self.last_power, 3)} W"
        return (
            f"duty cycle {100 * self.share:.1f} %{run}, mean power {short(self.mean_power, 3)} W, energy {short(self.energy / 3600.0, 3)} "
            f"W h, switched on {counted(self.cycles, 'time')}{words if np.isfinite(self.period) else ''}"
        )

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain numbers, with the ends of both bands; None where there is no complete cycle, or no member."""
        (low, last_low), (high, last_high) = self.interval().tolist()
        ends = {"low": low, "high": high, "last_low": last_low, "last_high": last_high}
        numbers = {name: value for name, value in vars(self).items() if name != "members"} | ends
        return {name: value if np.isfinite(value) else None for name, value in numbers.items()}
