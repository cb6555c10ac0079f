"""The one table of what may be wrong or missing: its prior size with unit and source, what hardware can have, how seldom it is, its words.

Whatever names a cause (`criticise`, `improve`, `init`, mistakes, `diagnose`, hidden defects, `watch`) takes rows of this table, and weighs
them by one score (`weighing`): how likely the readings are with it, its values integrated over these priors.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True)
class CauseSize:
    """Prior of a value that a cause adds or frees.

    Parameters
    ----------
    middle : float          Where its logarithm is centred, in `unit`; zero for a value that is normal about nothing.
    spread : float          Standard deviation: of the logarithm [-], or of the value where the middle is zero. [`unit`]
    unit : str              Its unit; 'of ...' where it is a part of what the deck has.
    source : str
    low, high : float       What hardware can have; a value outside is shown and not proposed. [`unit`]
    """

    middle: float
    spread: float
    unit: str
    source: str
    low: float = 0.0
    high: float = math.inf

    def at(self, unit: float = 1.0) -> SizedValue:
        """Return the prior of a value in SI units; `unit` is the size of one `self.unit` in them. [SI]"""
        return SizedValue(self.middle * unit, self.spread * (1.0 if self.middle else unit))

    def allows(self, size: float) -> bool:
        """Whether hardware can have a size [`unit`]: from `low` to `high`, both included."""
        return self.low <= size <= self.high


@dataclass(frozen=True)
class SizedValue:
    """The prior of one value: log-normal about `middle`, or normal about nothing where that is zero. [SI]"""

    middle: float
    spread: float

    def row(self, value: float, log: bool) -> tuple[float, float]:
        """Return the residual of the prior and its derivative with respect to the fitted form (ln value where `log`).

        With the spread s: ``ln(value / middle) / s`` where it is fitted by its logarithm and has a middle, else
        ``(value - middle) / (s middle)``, and ``value / s`` about zero.
        """
        if self.middle and log:
            return math.log(value / self.middle) / self.spread, 1.0 / self.spread
        width = self.spread * (self.middle or 1.0)
        return (value - self.middle) / width, (value if log else 1.0) / width


SIZES: Final = {
    "lag": CauseSize(17.0, 1.8, "s", "a bare thermocouple to a probe in a pocket; the middle 95 %", 0.5, 600.0),
    "mass": CauseSize(0.6, 1.7, "of the part's own", "the middle 95 % of what is possible", 0.02, 20.0),
    "pace": CauseSize(0.4, 1.3, "of the part's own", "the slower ones are ambients, the faster ones parts of the part"),
    "large mass": CauseSize(2.0, 2.3, "of the part's own", "a board, a wall, a jacket; the middle 95 %", 0.02, 200.0),
    "path": CauseSize(1.0, 1.5, "of what the part loses", "a factor of twenty either way, 95 %"),
    "contact": CauseSize(0.0, 0.5, "of the weaker end's conductances", "a link that were larger would be on the drawing"),
    "convection": CauseSize(
        0.0, 2.0, "W/(m^2 K^1.25)", "1.3 to 1.4 (1/L)^(1/4) for 2 cm to 1 m (McAdams, Heat Transmission, 3rd ed., 7)", 0.2, 6.0
    ),
    "emissivity": CauseSize(0.0, 0.5, "-", "half of all surfaces (Incropera, 6th ed., A.11)", 0.01, 1.0),
    "law": CauseSize(0.0, 0.5, "of what the part loses", "free air and radiation lose about as much each"),
    "growth": CauseSize(0.0, 0.004, "1/K", "copper", 0.0, 0.02),
    "settling": CauseSize(0.0, 0.2, "of the step", "heaters and converters that warm up", 0.0, 0.5),
    "course": CauseSize(0.0, 1.0, "of the power", "motors and pumps that start"),
    "clock": CauseSize(0.0, 60.0, "s", "clocks that were set by hand, and computers that were not synchronised"),
    "unlogged": CauseSize(0.0, 3.0, "of the largest power", "a heater beside the logged one"),
    "boundary": CauseSize(0.0, 5.0, "K", "a chamber or a reference junction that is not where its display says"),
    "power": CauseSize(0.0, 0.4, "of the power", "a meter, an efficiency or a duty that was taken for another"),
    "capacitance": CauseSize(0.0, 0.4, "of the value", "a mass that was not weighed"),
    "sensor": CauseSize(0.0, 5.0, "K", "a wrong kind of sensor, a bad contact of its leads"),
    "loose": CauseSize(0.0, 0.3, "of its reading", "a sensor that leans to its surroundings"),
    "fan": CauseSize(0.0, 2.0, "of the heat that air carries", "a fan that runs, a door or a cover that opens"),
    "surface": CauseSize(0.0, 0.3, "of the same", "how much stronger moving air takes heat from one surface than from another"),
    "gain": CauseSize(1.0, 1.5, "of where its search begins", "a factor of twenty either way, 95 %"),
    "setpoint": CauseSize(0.0, 20.0, "K", "about where its search begins"),
}
"""Priors of sizes, by what is added or freed."""


@dataclass(frozen=True)
class Cause:
    """One kind of cause, in words.

    Parameters
    ----------
    words : str             What it is.
    lower, higher : str     What a value below, or above the stated one means to a user.
    """

    words: str
    lower: str = ""
    higher: str = ""


_AIR: Final = ("less air flow: check the fan", "more air flow: check the fan and lids")
_JOINT: Final = ("conducts worse: check for a loose joint", "conducts better: check for an unintended contact")
GROUPS: Final = {
    "boundary or reference": Cause("the temperature of chamber or ambient, or an error common to all sensors: reference junction, logger"),
    "power": Cause("the dissipated power, or its measurement", "heats less than logged or stated", "heats more than logged or stated"),
    "link": Cause("a heat path that is missing, stronger or weaker than modelled"),
    "capacitance": Cause("a mass or a specific heat"),
    "sensor": Cause("one sensor: wrong, or detached"),
}
"""Group of values that a fault changes -> what it stands for."""
WATCHED: Final = {
    "air": Cause("a coefficient of a surface", *_AIR),
    "free air": Cause("a law of natural convection", "less air flow", "more air flow"),
    "joint": Cause("a contact or a conductance", *_JOINT),
    "heat path": Cause("a conductivity", "conducts worse", "conducts better"),
    "power": GROUPS["power"],
    "ambient": Cause(
        "a boundary that nobody logs",
        "colder than stated: log it, or give its temperature",
        "warmer than stated: log it, or give its temperature",
    ),
}
"""Kind of a value that a running test looks at -> what lower and higher mean."""
DECK_VALUE: Final = "deck's value"
"""Kind of a mistake: a value of the deck that a fit holds, and that is another."""
