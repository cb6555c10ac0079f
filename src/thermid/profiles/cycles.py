"""How many cycles of another range are worth those of a standard."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from thermid.errors import ScenarioError, nearest
from thermid.model.laws.signal import literal
from thermid.units import TEMPERATURE


@dataclass(frozen=True)
class Equivalence:
    """``cycles`` over ``range`` are worth cycles (range / dT)^exponent over dT.

    Parameters
    ----------
    cycles : float      Cycles of the standard, those in vacuum among them.
    range : float       From cold to hot. [K]
    exponent : float    Of the law of fatigue.
    clause : str        Where it stands.
    """

    cycles: float
    range: float
    exponent: float
    clause: str

    def exact(self, span: float) -> float:
        """Return the cycles over a range [K], not rounded."""
        return float(self.cycles * (self.range / span) ** self.exponent)


EQUIVALENCE: Final[Mapping[str, Equivalence]] = {
    "qualification": Equivalence(27, 105.0, 1.4, "SMC-S-016, 6.3.8.3"),
    "protoqualification": Equivalence(20, 95.0, 1.4, "SMC-S-016, 6.3.8.3"),
    "acceptance": Equivalence(14, 85.0, 1.4, "SMC-S-016, 6.3.8.3"),
}
"""Level -> the formula of SMC-S-016; read."""


def equivalent_cycles(cold: str | float, hot: str | float, level: str | Equivalence = "qualification") -> int:
    """Return how many cycles between two temperatures are worth those of a level, rounded up.

    Parameters
    ----------
    cold, hot : str or float        The range that is run. [K]
    level : str or Equivalence      qualification, protoqualification, acceptance, or a law of the project's own.

    Raises
    ------
    ScenarioError   When cold does not lie below hot, or there is no such level.

    References
    ----------
    SMC-S-016 (2014), 6.3.8.3: N = 27 (105/dT)^1.4, 20 (95/dT)^1.4, 14 (85/dT)^1.4.
    """
    if isinstance(level, str):
        if level not in EQUIVALENCE:
            raise ScenarioError(f"there is no level '{level}'; there are {', '.join(EQUIVALENCE)}.{nearest(level, EQUIVALENCE)}", "cycles")
        level = EQUIVALENCE[level]
    low, high = (literal(v, TEMPERATURE, "cycles") if isinstance(v, str) else float(v) for v in (cold, hot))
    if low >= high:
        raise ScenarioError(
            f"the cold level, {low - 273.15:g} degC, does not lie below the hot one, {high - 273.15:g} degC. Give cold first, then hot.",
            "cycles",
        )
    return math.ceil(round(level.exact(high - low), 9))
