"""Every number of the model of error that decides what a user is told, with its unit, its source and what it does.

Sizes of departures are scales of half-normal priors, by class of element. Public test sets taught them (`SIZE_SETS`;
``python scripts/error_sizes.py`` makes them again), except where a size says that it has no set.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from thermid.fit._calibration import BETWEEN_RUNS


@dataclass(frozen=True)
class SizePrior:
    """A number of the model of error.

    Parameters
    ----------
    value : float
    unit, source, effect : str
    sets : int      Public test sets that taught it.
    """

    value: float
    unit: str
    source: str
    effect: str
    sets: int = 0


class SizeTable(dict[str, SizePrior]):
    """Sizes by class of element."""

    def __str__(self) -> str:
        """Return them as text, a line a size, with how many sets taught each."""
        lines = ["Sizes of model error used, and from how many public test sets (docs/statistics.md):"]
        for name, of in self.items():
            taught = f"{of.sets} sets" if of.sets else of.source
            lines.append(f"  {name:<7}  {of.value:>5g} {of.unit:<3}  {taught:<10}  {of.effect}")
        return "\n".join(lines)


LEARNED: Final = "public test sets"
SIZES: Final = SizeTable(
    surface=SizePrior(0.15, "1", LEARNED, "size of the smooth departure of a constant coefficient about its physical mean", 8),
    joint=SizePrior(0.15, "1", LEARNED, "size of the smooth departure of a constant conductance of a joint or a solid", 8),
    law=SizePrior(
        0.16,
        "1",
        "surface and joint, a factor of two about what they share",
        "size of the smooth departure of radiation and of correlations",
    ),
    trend=SizePrior(0.018, "1/K", LEARNED, "growth of a joint with its level", 8),
    hidden=SizePrior(
        0.1,
        "1",
        "prior; the sets ask for 0.83, which predicts others worse",
        "mass behind a node that no deck has, in parts of the node's own",
    ),
    run=SizePrior(BETWEEN_RUNS, "1", LEARNED, "departure of a coefficient, conductance, mass or power from run to run", 9),
    room=SizePrior(0.17, "K", LEARNED, "drift of a room about its logged or stated temperature", 2),
    unlogged=SizePrior(0.72, "K", LEARNED, "drift of a room that no log follows, about the value that stands for it", 7),
    left=SizePrior(0.13, "K", LEARNED, "what no element explains, at a sensor", 9),
)
"""Scales of the half-normal priors of sizes."""
_BOARD = "two heaters with a sensor each, a coefficient each to the room, a joint between"
SIZE_SETS: Final = {
    "tclabsp": f"TiagoPrata/TCLabSP, e8dfcb0; MIT; {_BOARD}",
    "tclab_apmonitor": f"APMonitor/arduino, f36e65a; Apache-2.0; {_BOARD}",
    "tclab_lisbon": f"FNR13/TCLab-Predictive-Control, 87a1c44; none stated; {_BOARD}",
    "tclab_santa_barbara": f"rawlings-group/mlid_2024, 9f1c939; MIT; {_BOARD}",
    "motor": "TasS-RV/Motor-Thermal-Modelling-Tool, e94b107; MIT; winding and stator, a coefficient to the room",
    "cells": "Silencefrog9305/Digital-Twins-for-Battery-Using-CTA-MTL, ec0fe7c; MIT; one mass, a coefficient to a chamber",
    "plate": "rupakrokade/sbhs-manual, 5aad482; none stated; plate, frame and sensor, a coefficient to the room, a fan",
    "boiler": "LukeChannings/gesha, 81fbcaa; none stated; element, boiler and group, a coefficient to the room",
    "house": "locie/pySIP, da70d25; none stated; indoor air and wall in series to the outside",
}
"""Sets behind them, none of which is part of thermid: where below github.com, and commit; licence; structure."""
DEPARTURE_ODDS: Final = len(SIZE_SETS) + 1.0
"""Odds before any reading that some element departs from its law: in all of the sets one does (Laplace's rule of succession). [-]"""

ROOM_TIME: Final = 3600.0
"""Time constant with which a room wanders; prior. [s]"""
LENGTHS: Final = (0.7, 40.0)
"""Lengths over which a departure changes: of ln(difference), a factor of two [-], and of the level [K]; prior. Its features reach so far
beyond the conditions of a fit, and what lies further off is independent."""
LEFT_OVER, COLUMNS = 0.01, 10
"""Part of the variance of a departure that its features may leave, and how many there may be."""
GROWTH_BEND: Final = 1.0 / 3.0**0.5
"""Standard deviation of the bend of a joint's growth, in parts of x^2/2: evenly from 1 + x to its inverse 1 / (1 - x), of which the growth
is the first and exp(x) the middle. [-]"""
FREE_EXPONENT: Final = 4.0 / 15.0
"""Mean exponent of natural convection with the difference: evenly between 1/5 and 1/3 (Incropera and others 2011, 9.6). [-]"""
FREE_EXPONENT_SD: Final = (1.0 / 3.0 - 1.0 / 5.0) / 12.0**0.5
"""Standard deviation of the same. [-]"""
LARGEST_SHARE: Final = 0.95
"""Largest emissivity, and largest share of radiation in a coefficient. [-]"""
LEAST_SHARE: Final = 0.01
"""Least share of radiation where there may be some. [-]"""
FINISH: Final = 0.15
"""What an emissivity of a deck is good to, relative, whose range nobody prints; prior. [-]"""
OTHER_FINISH: Final = 0.2
"""Probability before any reading that finishes are not those of the deck; prior. [-]"""
LACK_ODDS, PATH_SHARE = 0.5, 0.2
"""Odds before any reading that there is what a deck lacks, a path to a boundary or parts through which heat enters, each; and scale of the
part of its node's heat that the path then carries; priors. [-]"""
LATE_SHARE, LATE_TIME = 0.25, 0.3
"""Mean, and standard deviation as of an exponential distribution, of the part of a node's heat that then enters through a part with a time
constant, so that heat hardly comes before its power; and that time over those of `SHARES_OF_RUN`; priors. [-]"""
GRADIENT, ROW_OF_ZONES = 0.3, (0.55, 0.075)
"""Standard deviation of the drop inside a part, in parts of that to its neighbours (a Biot number; lumped parts are below 0.1), and what a
row of three zones has: share of the heat that enters in the drop to its mean, and its lag in parts of R C. [-]"""
FLOWLESS: Final = 1e-3
"""Part of the difference of a fit below which no heat flows, and of the conductance of a path that a step leaves it at least. [-]"""
LEVELS, LEVEL_POINTS = (150.0, 600.0), 181
"""Levels over which the growth of a joint is tabulated [K], and how many; constant beyond."""
SHARES_OF_RUN: Final = (1.0 / 30.0, 1.0 / 10.0)
"""Time constants of hidden masses, in parts of the longest run. [-]"""
LEFT_TIMES: Final = (1.0 / 30.0, 1.0 / 10.0, 1.0 / 3.0)
"""Time constants of what no element explains, in parts of the run; as likely each. [-]"""
LEFT_SIZES: Final = (0.0, 0.3, 1.0, 2.0, 4.0, 8.0)
"""Sizes of the same that are tried, in parts of the scale of their half-normal prior; each stands for all sizes nearer to it. [-]"""
HEATED, EVERY = 0.1, 10
"""Part of the largest heat of an element from which its conditions count where features are laid [-]; of those every tenth is taken."""
DEPARTURE_SAMPLES: Final = 301
"""Samples of a run along which departures are drawn."""
ROOM_KNOTS: Final = 24
"""Hats that hold a wandering room in a run, at most; a room that wanders faster is smoothed."""
FIRST_SETS, SETS = 16, 256
"""Sets of sizes at every size and time of what no element explains, and again at those that count."""
SIZE_ROUNDS: Final = 8
"""Rounds in which sets of sizes are laid, each where the rounds before found them likely."""
FEWEST_SETS, SETS_COST = 8, 1e8
"""Sets of a large model, and what all of them may cost: each the cube of the number of unknowns."""
LIKELY: Final = 0.01
"""Probability from which a size and time of what no element explains counts. [-]"""
NO_SAY: Final = 1e-9
"""Probability beside the likeliest below which larger sizes of what no element explains are not tried. [-]"""
READINGS: Final = 200
"""Readings of a sensor in a run; more are averaged over equal stretches."""
NEWTON_POINTS, ARRIVED, WORTH_A_POINT = 8, 0.2, 0.5
"""Points at most at which Newton's steps in values, exponents and shares are taken; they end where the next step is below so many standard
errors, or where a point made the evidence likelier by less than this in its logarithm, or two points after one another did not: the
logarithm differs by as much from point to point where values are hardly determined."""
UNBOUNDED: Final = 3.0
"""Standard deviation of a logarithm without a prior or bounds. [-]"""
OUTSIDE: Final = 2.0
"""Root mean square of readings over what the model of error allows, from which they contradict it: a log, its noise or a column is wrong,
or departures are so large that their straight lines do not hold. One is expected, with a standard deviation of a few per cent; the network
with its departures ends at most 0.9 from its lines on 51 benches, and 5 to 32 where values were wrong. [-]"""
FAR_SIZE: Final = 4.0
"""Size of a departure in scales of its prior, from which the readings contradict the model: a room that wanders by 0.4 K beside a right
structure asks for 1.7 to 2.6, a power that no log has for 6.4, constant coefficients where the truth convects and radiates for 1.1. [-]"""
COUNTED: Final = 1e-3
"""Probability from which a way or a remainder is kept; so much of the members is left out of their sums, at most. [-]"""
CONDUCTORS, NODES = 24, 16
"""Elements of a model that are followed at most, those through which most heat flows, and nodes, those that store most of it."""
ALL_COLUMNS: Final = 72
"""Features of all departures of a model together, at most: the cost grows with their cube. What lies outside of them is independent from
run to run."""
MIN_LOG_BAYES_FACTOR: Final = 3.0
"""ln of the Bayes factor from which residuals ask for departures of elements, and not for noise that wanders (20 to 1: Kass and Raftery,
J. Am. Stat. Assoc. 90 (1995) 773)."""
KEPT_OF_PRIOR = 0.5
"""Part of what was known before that a value keeps where no reading determines it. [-]"""
