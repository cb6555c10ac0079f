"""Every number by which a cause is named or passed over, beside the sizes of causes (`causes`): value, unit, source, what it does.

The one table of what may be wrong or missing: its prior size with unit and source, what hardware can have, how seldom it is, its words.

Whatever names a cause (`criticise`, `improve`, `init`, mistakes, `diagnose`, hidden defects, `watch`) takes rows of this table, and weighs
them by one score (`weighing`): how likely the readings are with it, its values integrated over these priors.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

# ---- candidates

DEFAULT_COLD_TEMPERATURE: Final = 293.15
"""Temperature at which a power is taken to be the logged one where its node has no reading. [K]"""
SLOWEST_SAMPLES: Final = 10.0
"""Samples that a power takes to settle, at least. [-]"""
MAX_TIP_SHARE: Final = 0.1
"""A node of this part of its neighbour's heat capacity is the sensor of it. [-]"""
START_SHARE: Final = 0.05
"""Part of what a part loses already that a new way of its heat begins with. [-]"""
MAX_PLACES: Final = 6
"""Places of a network at which changes are looked for that need runs of their own: those with the largest residuals."""
SLOWEST_MASS: Final = 10.0
"""Time constant of a new mass, in lengths of the longest record, beyond which readings know nothing of it. [-]"""
SETTLING_PACES: Final = (0.01, 0.03, 0.1, 0.3, 1.0)
"""Time constants of a power that settles, in lengths of the record after it came on. [-]"""
PACES: Final = (0.03, 0.2, 1.0, 5.0)
"""Time constants at which a new mass is tried, in parts of that of the part beside it. [-]"""

# ---- criticism

VERY_STRONG = 10.0
"""Twice the logarithm of a Bayes factor that proves a cause: Kass and Raftery, J. Am. Stat. Assoc. 90 (1995) 773-795, DOI
10.1080/01621459.1995.10476572. [-]"""
MAX_CHANCE_DEVIATIONS: Final = 3.0
"""Standard errors that chance explains: beyond, residuals go with temperature, power or time, or are larger than the stated noise. [-]"""
MAX_REFITTED_ELEMENTS: Final = 5
"""Elements that are refitted: those that one evaluation promises most of."""
MIN_RECORDS_COMPARED: Final = 6
"""Records from which a value of single records is compared with an input."""

# ---- defects

MAX_NOISE_CHI_SQUARE: Final = 1.5
"""Chi-square per degree of freedom above which residuals ask for an explanation, and below which they have one. [-]"""
MIN_DEFECT_WEIGHT: Final = 0.02
"""Weight beside the best below which a defect is left out. [-]"""
MIN_PROMISED_FALL: Final = 0.25
"""Part of chi-square that a linearised step with a defect takes off, below which it is not worth its refits. [-]"""
FAR_STEPS, FAR_PART = 8.0, 0.05
"""How far a clock may be off: in samples, and in lengths of the record, whichever is more. [-]"""
MAX_REFIT_STEPS: Final = 20_000
"""Steps of one run after which a refit is given up."""
MAX_DEFECT_FACTOR: Final = 100.0
"""Factor from where they begin within which the values of a defect are looked for. [-]"""
MAX_REFIT_EVALUATIONS: Final = 60
"""Evaluations after which a refit is given up."""
MAX_START_DEVIATIONS: Final = 4.0
"""Standard deviations of noise and accuracy within which first readings and surroundings are one temperature. [-]"""
MAX_REFIT_UNKNOWNS, MAX_REFIT_SAMPLES, MAX_REFIT_NODES, MAX_REFIT_RECORDS = 16, 20_000, 20, 4
"""What a fit may hold for some ten refits of it to be worth their time."""

# ---- clocks of joined logs

WRONG_HOURS = (0.0, -1.0, 1.0, -2.0, 2.0)
"""By how many hours a clock of another time zone, or of summer time, is off."""
MAX_CLOCK_ERROR, MAX_CLOCK_SHARE = 300.0, 0.25
"""How far a clock that was not set by the other may be off [s], and the part of the log that this is at most. [-]"""

# ---- diagnosis

DIAGNOSED_STRETCHES: Final = 24
"""Stretches of time into which every log is thinned."""
DIAGNOSED_ROUNDS, MAX_DIAGNOSED_FAULTS = 4, 6
"""Steps in which the size of a fault is found beside the equations, and how many of the likeliest faults are looked at so."""
LEFT_BY_EVERY_MODEL: Final = 0.1
"""Standard deviation of what every model leaves, autocorrelated over a fifth of a log. [K]"""
MIN_EXPLAINED_SHARE: Final = 0.7
"""Part of the weighted squares that a fault must take away to be called the explanation."""

# ---- heats

PULSES: Final = 20
"""Stretches of a record in which heat is tried; windows are made of whole ones first."""
MAX_HEATED_NODES: Final = 30
"""Nodes that store heat in which unlogged heat is looked for: each has `PULSES` derivatives of every node's temperature."""
MAX_TRIED_LOADS: Final = 3
"""Most nodes and loads at which a course of an unlogged power is tried."""
MAX_WINDOW_SEARCHES: Final = 3
"""How often a window is looked for again, from where the last one led."""
START_UP_TIMES, START_UP_PRECISION = 8, 0.02
"""Times that a start-up is first tried with at every load, and how well that of the best is found, in logarithms. [-]"""
TELLING_DIFFERENCE: Final = 0.2
"""Difference below which a measured temperature says nothing of the heat that leaves by it. [K]"""

# ---- mistakes

MAX_PER_CENT: Final = 101.0
"""Largest number that a duty cycle in per cent reaches, with what rounding adds."""
CLOCK_SHIFTS: Final = (0.005, 0.01, *np.geomspace(0.02, 0.2, 10).tolist())
"""Shifts of a clock that are tried, as parts of a record."""
USUAL_AMBIENT: Final = (14.0, 34.0)
"""Readings at the start of a log that a room may have. [degC]"""
MIN_NAMED_GAIN: Final = 9.0
"""Least gain in the logarithm of the posterior's height from which a mistake is named; chance and the search among many are in it. [-]"""
MOST_RECORDS_SEARCHED: Final = 4
"""Records that are looked at: the worst ones, where there are more."""
FULLY_FITTED_HYPOTHESES: Final = 6
"""How many of the best hypotheses are fitted to the end, once all were fitted roughly."""

# ---- plausibility

CORRELATION: Final = 1.5
"""A correlation for a body in still air is taken as good to a factor: neighbours, orientation and draughts."""
MAX_SLOW_FAN_HTC: Final = 25.0
"""Most that slow fans bring over equipment. [W/(m^2 K)]"""
EMISSIVITY: Final = (0.02, 0.98)
"""Emissivities of surfaces, polished metal to paint (Incropera, 6th ed., A.11). [-]"""
BARE_CONTACT: Final = (100.0, 5e4)
"""Contact of metal on metal: dry and hand-tight 100 to 1000, machined under 0.1 to 10 MPa 2000 to 50 000. [W/(m^2 K)]"""
SPECIFIC_HEAT: Final = (385.0, 1500.0)
"""Specific heats of what equipment is made of, copper to plastics. [J/(kg K)]"""
UNDETERMINED: Final = 0.5
"""Relative error from which a 95 % interval reaches zero: no range can reject the value, and a defect with it is not shown. [-]"""

# ---- structures

TIE: Final = 3.0
"""Logarithm of a Bayes factor below which two causes, or structures, cannot be separated: 20 to 1 (Kass and Raftery 1995). [-]"""
EVALUATIONS_OF_A_REFIT: Final = 20
"""What a refit is expected to take, by which processes are begun or not. [-]"""
REFITS_OF_A_ROUND: Final = 4
"""Refits of single changes in each round; pairs of the three with the best scores are refitted too."""
PROMISED_STEP: Final = 1.5
"""Standard deviation that a promise allows each logarithm, so that one step is not believed farther than it can be. [-]"""
FREE_STEP: Final = 20.0
"""The same for a value that begins small and whose effect is proportional to it, over `PROMISED_STEP`. [-]"""
IDLE_SHARE: Final = 1e-3
"""Part of where they begin at which small elements lie over one model together and do not act. [-]"""
MAX_LAID_TOGETHER: Final = 40
"""Small elements of one run. [-]"""
MAX_SEPARATING_READINGS: Final = 400
"""Most readings of a test that may separate two structures. [-]"""
CHALLENGES: Final = 3
"""Structures of one mass more that are refitted at the end."""
ABOUT_START: Final = 5.0
"""Standard deviation of a start about its first reading, in noises; 1 K at least. [-]"""
ANY_VALUE: Final = 5.0
"""Standard deviation of the logarithm of a parameter of which nothing is known. [-]"""
WIDE_ERRORS: Final = 8.0
"""So many standard errors are wider than the bounds of a value that the readings hardly determine; a full fit refuses it at two."""
EVALUATIONS: Final = 8000
"""Most evaluations of a search: runs of every record with derivatives. A count, so that a busy machine finds what an idle one finds. [-]"""
SEARCH_DONE_STEP: Final = 0.03
"""A search of one structure ends at this part of a standard error. [-]"""

# ---- balance

BALANCE_STEP: Final = 1e-3
"""Relative change over which the balance is differentiated by a value of a fit."""

# ---- weighing

MAX_SEEN_STRETCHES: Final = 240
"""Stretches of time in which a trace of more readings is looked at, two readings in each at least: a lag or a delay shows in the first of
them after a step. [-]"""
NOISE_DONE_STEP, NOISE_DONE_GAIN, MOST_STEPS_IN_NOISE = 0.2, 1e-5, 20
"""A descent in one noise ends at this part of a standard error, at a step that gains this part of the cost, or after so many runs. [-]"""
CHOSEN: Final = 3.0
"""What a number that was chosen before a fit costs, such as the time of a course: the logarithm of how many were tried. [-]"""


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
        "a boundary that has no log",
        "colder than stated: log it, or give its temperature",
        "warmer than stated: log it, or give its temperature",
    ),
}
"""Kind of a value that a running test looks at -> what lower and higher mean."""
DECK_VALUE: Final = "deck's value"
"""Kind of a mistake: a value of the deck that a fit holds, and that is another."""
