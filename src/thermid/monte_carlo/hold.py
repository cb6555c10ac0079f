"""`hold`: how long limits are kept, with which probability, and what decides it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.arguments import takes_objects
from thermid.errors import ScenarioError
from thermid.knowledge.sources import LeftOut
from thermid.model.laws.signal import literal
from thermid.model.parts.standing import UNJUDGED, Standing
from thermid.monte_carlo.drivers import Driver, drivers_of
from thermid.monte_carlo.hold_times import clock, first_crossings, hold_time, proportion
from thermid.monte_carlo.uncertain import UncertainRuns
from thermid.physics.constants import ICE_POINT
from thermid.prediction.structural import MISFIT
from thermid.units import TEMPERATURE

Array = NDArray[np.float64]
SIDES = {"highest": 1.0, "lowest": -1.0}
NAMED = 0.05
"""Share below which a driver is not named in a sentence. [-]"""


@dataclass(frozen=True, eq=False)
class HoldPoint:
    """How long one limit is kept.

    Parameters
    ----------
    node, name : str            Path of the node; as the caller calls it.
    limit : float               [degC]
    side : str                  highest or lowest.
    crossings : array (members that reached the end,)   When the limit is passed first; infinite where never. [s]
    exceedance : array (times,) Probability that it has been passed by then. [-]
    hold : float                Time until which the limit is kept with the probability asked for; infinite where beyond the scenario. [s]
    between : (float, float)    95 % interval of that time by the number of members alone. [s]
    never : float               Share of members that never pass it within the scenario. [-]
    never_between : (float, float)
    drivers : tuple of Driver   Of the temperature at that time (of the highest where it is infinite), the largest first.
    """

    node: str
    name: str
    limit: float
    side: str
    crossings: Array
    exceedance: Array
    hold: float
    between: tuple[float, float]
    never: float
    never_between: tuple[float, float]
    drivers: tuple[Driver, ...]

    @property
    def words(self) -> str:
        """The limit in words."""
        return f"{self.name}'s {self.limit:g} degC"


@dataclass(frozen=True, eq=False)
class Hold:
    """How long all limits are kept.

    Parameters
    ----------
    title, scenario : str       Of the model and the scenario.
    confidence : float          Probability with which limits are kept until the hold time. [-]
    times : array (times,)      Of the exceedances. [s]
    members : int               That reached the end.
    points : tuple              One entry per limit, the first to be passed first.
    together : HoldPoint        Whichever limit is passed first, member by member.
    assumed : int               How many values of the model are assumed.
    warnings : tuple of str     What a reader must know.
    discrepancy : float         Standard deviation that members have for what a fit could not follow, the largest; None without. [K]
    standing : Standing         Of the values that it rests on.
    left_out : tuple of LeftOut What the members do not count.
    not_counted : str           What of it a reader must know first.
    causes : tuple of str       Structural errors and others beside the fit that members count.
    """

    title: str
    scenario: str
    confidence: float
    times: Array
    members: int
    points: tuple[HoldPoint, ...]
    together: HoldPoint
    assumed: int
    warnings: tuple[str, ...] = ()
    discrepancy: float | None = None
    standing: Standing = UNJUDGED
    left_out: tuple[LeftOut, ...] = ()
    not_counted: str = ""
    causes: tuple[str, ...] = ()

    def __getitem__(self, name: str) -> HoldPoint:
        """Return the entry of a limit by the name that was given to it, or by its node."""
        found = [p for p in self.points if name in (p.name, p.node)]
        if not found:
            raise ScenarioError(f"no limit was given for '{name}'; limits are {', '.join(p.name for p in self.points)}.", self.title)
        return found[0]

    @property
    def sentence(self) -> str:
        """The answer in one sentence."""
        first, percent = self.points[0], f"{100 * self.confidence:g} %"
        if math.isinf(self.together.hold):
            return f"{self.scenario}: no limit is passed in {clock(self.times[-1])}, {percent}"
        return f"{self.scenario}: {clock(self.together.hold)} until {first.words}, {percent}"

    @property
    def watermark(self) -> str:
        """What must stand on everything that is shown of it; empty where nothing is assumed."""
        return f"demonstration, {self.assumed} assumed parameters" if self.assumed else ""

    def __str__(self) -> str:
        """The sentence, a line for each limit, what drives them, and remarks."""
        lines = [self.sentence + (f" ({self.watermark})" if self.watermark else "")]
        lines += [f"  {self.not_counted}"] if self.not_counted else []
        for p in (*self.points, *([self.together] if len(self.points) > 1 else [])):
            low, high = p.never_between
            never = f"never passed in {100 * p.never:.1f} % ({100 * low:.1f} to {100 * high:.1f})"
            until = f"{clock(p.hold)} ({clock(p.between[0])} to {clock(p.between[1])})" if math.isfinite(p.hold) else "beyond the scenario"
            if p is self.together:
                lines.append(f"  all of them: kept for {until}, {never}")
                continue
            lines.append(f"  {p.name} {'above' if p.side == 'highest' else 'below'} {p.limit:g} degC: kept for {until}, {never}")
            lines += [f"    driven by {named}" for named in [driven_by(p)] if named]
        lines.append(f"  {self.members} members; intervals are what their number leaves open, not what the model does not know")
        return self.standing.over("\n".join([*lines, f"  {self.counted}", *(f"  warning: {w}" for w in self.warnings)]))

    @property
    def counted(self) -> str:
        """Whether the model's discrepancy is in the bands, in words."""
        others = [c for c in self.causes if c != MISFIT and not c.startswith("fit of ")]
        also = f"counted besides: {', '.join(others)}; " if others else ""
        if self.discrepancy is None:
            return f"{also}the model's discrepancy is not counted: no values of a fit say what it could not follow"
        size = f"{self.discrepancy:.2g} K (one standard deviation), what its fit could not follow"
        return f"{also}the model's discrepancy is counted: {size}"

    def to_dict(self) -> dict[str, Any]:
        """Return what a file or a page needs. Times in seconds, temperatures in degrees Celsius; null for beyond the scenario."""

        def of(p: HoldPoint) -> dict[str, Any]:
            return {
                "node": p.node,
                "limit_C": p.limit,
                "side": p.side,
                "hold_s": p.hold,
                "hold_between_s": list(p.between),
                "never": p.never,
                "never_between": list(p.never_between),
                "exceedance": p.exceedance.tolist(),
                "drivers": [{"name": d.name, "share": d.share, "direction": d.direction} for d in p.drivers[:10]],
            }

        return {
            "title": self.title,
            "scenario": self.scenario,
            "standing": self.standing.to_dict(),
            "sentence": self.sentence,
            "watermark": self.watermark,
            "confidence": self.confidence,
            "members": self.members,
            "times_s": self.times.tolist(),
            "points": {p.name: of(p) for p in self.points},
            "together": of(self.together),
            "discrepancy_K": self.discrepancy,
            "left_out": [{"what": x.what, "kelvin": x.kelvin if math.isfinite(x.kelvin) else None} for x in self.left_out],
            "warnings": list(self.warnings),
        }


@takes_objects
def hold(runs: UncertainRuns, limits: Mapping[str, Any], *, confidence: float = 0.95) -> Hold:
    """Return how long limits are kept in the members of a campaign of runs.

    The hold time is that until which the share `confidence` of the members keeps the limit: a one-sided bound. Its own interval comes
    from order statistics (Hahn and Meeker, Statistical Intervals, 1991, chapter 5) and holds whatever the distribution; that of the
    probability of never is Clopper and Pearson's (Biometrika 26, 1934).

    Parameters
    ----------
    runs : UncertainRuns
    limits : dict           Reference point -> ``"50 [degC]"``, or ``{"highest": "50 [degC]", "lowest": "-20 [degC]"}``.
    confidence : float      Between a half and one. [-]

    Raises
    ------
    ScenarioError       When a limit is none, or so few members cannot tell such a probability.
    NameNotFoundError   When a limited node was not kept.
    """
    wanted = limits_of(limits, runs.title)
    check_members(runs.reached.size, confidence, runs.title)
    draws = {n: v[runs.reached] for n, v in runs.draws.items()}
    points = [_point(runs, draws, name, side, value, confidence) for name, side, value in wanted]
    points.sort(key=lambda p: (p.hold, p.never, -p.exceedance[-1]))
    together = _together(runs, points, confidence)
    budget = runs.job.budget
    limited = {p.node for p in points}
    sizes = [float(np.abs(row).sum()) for t, row in zip(budget.targets, budget.gain, strict=True) if t.form == "node" and t.name in limited]
    causes = tuple(dict.fromkeys(c for c in budget.causes if c not in ("stated", "fit")))
    known = (len(runs.assumed), runs.warnings, max(sizes, default=None), runs.standing, runs.left_out, runs.not_counted, causes)
    return Hold(runs.title, runs.scenario, confidence, runs.times, runs.reached.size, tuple(points), together, *known)


def limits_of(limits: Mapping[str, Any], title: str) -> list[tuple[str, str, float]]:
    """Return name, side and temperature [K] of every limit.

    Raises
    ------
    ScenarioError   When there is none, or one is no limit.
    """
    wanted = [(name, side, value) for name, given in limits.items() for side, value in _sides(name, given)]
    if not wanted:
        raise ScenarioError('there is no limit. Give one: { "FOG_x" = "50 [degC]" }.', title)
    return wanted


def check_members(members: int, confidence: float, title: str) -> None:
    """Refuse a probability that is none, and one that so few members cannot tell.

    Raises
    ------
    ScenarioError   With how many would do.
    """
    if not 0.5 <= confidence < 1.0:
        raise ScenarioError(f"a probability of {confidence:g} is no confidence; give 0.95 or another number from 0.5 up to 1.", title)
    if members * (1.0 - confidence) < 1.0:
        enough = math.ceil(20 / (1 - confidence))
        raise ScenarioError(f"{members} members cannot tell {100 * confidence:g} %; ask for {enough} or more.", title)


def _sides(name: str, given: Any) -> list[tuple[str, float]]:
    table = given if isinstance(given, Mapping) else {"highest": given}
    if not table or not set(table) <= set(SIDES):
        raise ScenarioError('a limit is "50 [degC]", or { highest = "50 [degC]", lowest = "-20 [degC]" }.', f"limits, {name}")
    found = [
        (side, literal(value if isinstance(value, str) else f"{value} [degC]", TEMPERATURE, f"limits, {name}"))
        for side, value in table.items()
    ]
    ends = dict(found)
    if len(ends) == 2 and not ends["lowest"] < ends["highest"]:
        raise ScenarioError("its lowest temperature is not below its highest.", f"limits, {name}")
    return found


def _point(runs: UncertainRuns, draws: Mapping[str, Array], name: str, side: str, kelvin: float, confidence: float) -> HoldPoint:
    traces, turnings = SIDES[side] * (runs.of(name) - kelvin), runs.turnings_of(name)
    above = replace(turnings, kelvin=SIDES[side] * (turnings.kelvin - kelvin)) if turnings is not None else None
    crossings = first_crossings(runs.times, traces, above)
    until, between = hold_time(crossings, confidence)
    # how far above: at the hold time, or the farthest of the run where that lies beyond it
    measure = SIDES[side] * runs.furthest(name, SIDES[side]) if math.isinf(until) else traces[:, int(np.searchsorted(runs.times, until))]
    found = drivers_of(draws, measure)
    path = runs.job.model.canonical(name)
    return _filled(path, name, kelvin - ICE_POINT, side, crossings, runs.times, until, between, found)


def _together(runs: UncertainRuns, points: list[HoldPoint], confidence: float) -> HoldPoint:
    crossings = np.min([p.crossings for p in points], axis=0)
    until, between = hold_time(crossings, confidence)
    first = points[0]
    return _filled(first.node, "any limit", first.limit, first.side, crossings, runs.times, until, between, first.drivers)


def _filled(
    path: str,
    name: str,
    limit: float,
    side: str,
    crossings: Array,
    times: Array,
    until: float,
    between: tuple[float, float],
    found: tuple[Driver, ...],
) -> HoldPoint:
    exceedance = np.searchsorted(np.sort(crossings), times, side="right") / crossings.size
    never = int(np.isinf(crossings).sum())
    return HoldPoint(
        path, name, limit, side, crossings, exceedance, until, between, never / crossings.size, proportion(never, crossings.size), found
    )


def driven_by(point: HoldPoint) -> str:
    """Return what drives a limit, in words."""
    return ", ".join(f"{d.name} ({100 * d.share:.0f} %)" for d in point.drivers[:5] if d.share >= NAMED)
