"""What the board is told when a logger begins."""

from __future__ import annotations

from dataclasses import dataclass

from thermid.errors import RecordError


@dataclass(frozen=True)
class Settings:
    """What the board is told.

    Parameters
    ----------
    interval : float          Time between cycles. [s]
    bits : int                Resolution of the sensors.
    limit : float             Temperature of any sensor at which the board cuts the heaters off. [degC]
    silence : float           Time without a word from here after which the board cuts the heaters off. [s]
    """

    interval: float = 1.0
    bits: int = 12
    limit: float = 100.0
    silence: float = 2.0

    def __post_init__(self) -> None:
        """Check against what the board takes."""
        for word, value, low, high in (
            ("interval", self.interval, 0.1, 3600.0),
            ("bits", self.bits, 9, 12),
            ("limit", self.limit, -55.0, 125.0),
            ("silence", self.silence, 0.2, 3600.0),
        ):
            if not low <= value <= high:
                raise RecordError(f"{word} = {value:g} lies outside {low:g} to {high:g}.", "settings")

    def commands(self) -> list[str]:
        """Return the commands that a board needs after a reset."""
        return [
            f"limit,{round(self.limit * 16)}",
            f"silence,{round(self.silence * 1000)}",
            f"resolution,{self.bits}",
            f"interval,{round(self.interval * 1000)}",
        ]
