"""Courses of a power that no log gives, as laws over the time since a record began: start-up transients, and their fit.

In the model a course is a load with a `cycle` of one turn, so that it stands in the deck of what was fitted. Its power is fitted as any
other value; its time is not a value of the network, so it is found on the profile of the fit's cost.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from thermid.base.errors import IdentificationError, ThermidError, refuse_unknown
from thermid.base.units import Array, duration_text, short
from thermid.fit._minimisation import minimise
from thermid.fit._power.history import watts, with_load
from thermid.fit._problem.gather import build_problem
from thermid.fit._problem.request import Request
from thermid.model.tree import Model

ONE_TURN = "100000 [h]"
"""Period of a cycle that does not come again in any run."""
DECAY_POINTS, DECAY_TIME_CONSTANTS = 40, 7.0
"""Points of a decay in its table, and how many time constants they reach."""
SHARP = 1e-3
"""Part of the time before a course begins in which it comes on. [-]"""
TRIED_SWITCH_TIMES, NARROWINGS = 9, 9
"""Times that are tried at first, and how often the bracket about the best one is narrowed."""
Shape = Callable[[float], tuple[Array, Array, bool]]


def _decay(time: float) -> tuple[Array, Array, bool]:
    """Return times (points,) [s], shares (points,) of the power [-], and whether they are held: exp(-t / time), cut to zero at the end.

    Straight between points, which lie closer at the beginning; the end is `DECAY_TIME_CONSTANTS` times `time` [s].
    """
    at = DECAY_TIME_CONSTANTS * np.linspace(0.0, 1.0, DECAY_POINTS) ** 2
    share = np.exp(-at)
    share[-1] = 0.0
    return at * time, share, False


SHAPES: dict[str, Shape] = {
    "step": lambda time: (np.array([0.0, time]), np.array([1.0, 0.0]), True),
    "ramp": lambda time: (np.array([0.0, time]), np.array([1.0, 0.0]), False),
    "decay": _decay,
}
"""Shape -> times [s] and share of the power at them for a length or time constant [s], and whether each share holds until the next."""
WORDS = {
    "step": "{power} W more for the first {time}",
    "ramp": "{power} W more at first, falling to nothing over {time}",
    "decay": "{power} W more at first, decaying with a time constant of {time}",
}


@dataclass(frozen=True)
class PowerCourse:
    """A power beside those of logs and deck, from the beginning of each record on.

    Parameters
    ----------
    name : str          Of its load in the model.
    into : str          The node that it heats.
    shape : str         A key of `SHAPES`.
    time : float        Its length or time constant. [s]
    power : float       At its beginning, where the fit starts. [W]
    error : float       Standard error of the time, from the profile; infinite where that has no minimum within the record. [s]
    begin : float       When it begins, after the record does. [s]
    """

    name: str
    into: str
    shape: str
    time: float
    power: float = 1.0
    error: float = math.inf
    begin: float = 0.0

    def words(self, power: float) -> str:
        """Return it in words, with the power that was found. [W]"""
        return WORDS[self.shape].format(power=short(power, 3), time=duration_text(float(short(self.time, 3))))

    def in_model(self, model: Model) -> Model:
        """Return a model with the load of this course."""
        times, shares, hold = SHAPES[self.shape](self.time)
        if self.begin > 0.0:
            times, shares = np.concatenate([[0.0, (1.0 - SHARP) * self.begin], self.begin + times]), np.concatenate([[0.0, 0.0], shares])
        cycle = {"times": [f"{t!r} [s]" for t in times.tolist()], "values": shares.tolist(), "period": ONE_TURN}
        load = watts(self.into, power=f"{self.power!r} [W]", cycle={**cycle, **({"hold": True} if hold else {})})
        return with_load(model, self.name, load)

    def within(self, request: Request) -> Request:
        """Return a request that looks for this course's power too."""
        power = f"{self.name}.power"
        return replace(request, model=self.in_model(request.model), free=(*request.free, power), of_logs=(*request.of_logs, power))

    @staticmethod
    def recovered(
        request: Request, name: str, into: str, *, shapes: Sequence[str] = tuple(SHAPES), power: float = 1.0, begin: float = 0.0
    ) -> PowerCourse:
        """Return the course that meets the readings of a request best: shape and time on the profile of the fit's cost.

        Parameters
        ----------
        request : Request   The fit without the course.
        name, into : str    Of the load that it becomes, and the node that it heats.
        shapes : sequence   Shapes that are tried.
        power : float       Where its power starts. [W]
        begin : float       When it begins, after each record does. [s]

        Raises
        ------
        IdentificationError   When no course can be run with these records.
        """
        refuse_unknown(shapes, SHAPES, f"course {name}", "unknown shape '{}' of a course. Use one of {known}.", IdentificationError)
        span = min(float(np.ptp(r.times)) for r in request.records)
        step = max(r.step for r in request.records)
        tried = [_profiled(request, PowerCourse(name, into, s, 0.1 * span, power, begin=begin), 3.0 * step, 0.5 * span) for s in shapes]
        cost, course = min(tried, key=lambda attempt: attempt[0])
        if not np.isfinite(cost):
            raise IdentificationError(
                f"no course of a power at '{into}' can be run with these records.",
                request.name or request.model.title,
                code="fit.model-fails",
            )
        return course


def _profiled(request: Request, course: PowerCourse, low: float, high: float) -> tuple[float, PowerCourse]:
    """Return the least cost [-] of a course over its time between two bounds `low` and `high` [s], and the course there with its error. [s]

    Every other unknown is fitted anew at each time. A grid of ln(time) with `TRIED_SWITCH_TIMES` points, then steps to both sides of the
    best that shrink to 0.6 each time. The error is time / sqrt(cost''), cost'' by second differences over 0.1 in ln(time): half a
    chi-square.
    """
    costs: dict[float, float] = {}

    def cost(log_time: float) -> float:
        """Return the cost of the best fit with a course of this length, by the logarithm of its time. [-]"""
        if log_time not in costs:
            try:
                minimum = minimise(
                    build_problem(replace(course, time=math.exp(log_time)).within(request)), request.loss, request.loss_scale
                )
                costs[log_time] = minimum.cost
            except ThermidError:
                costs[log_time] = math.inf
        return costs[log_time]

    grid = np.linspace(math.log(low), math.log(max(high, 2.0 * low)), TRIED_SWITCH_TIMES).tolist()
    best = min(grid, key=cost)
    width = 0.5 * (grid[1] - grid[0])
    for _ in range(NARROWINGS):
        best = min((best, *(max(grid[0], min(grid[-1], best + d)) for d in (-width, width))), key=cost)
        width *= 0.6
    sides = [best - 0.1, best + 0.1]
    # second difference of half the chi-square over ln(time): one over the variance of ln(time)
    bend = (cost(sides[0]) - 2.0 * cost(best) + cost(sides[1])) / 0.01
    error = math.exp(best) / math.sqrt(bend) if bend > 0.0 and np.isfinite(bend) else math.inf
    return cost(best), replace(course, time=math.exp(best), error=error)
