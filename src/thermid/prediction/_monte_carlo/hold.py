"""Hold time: how long limits are kept, with which probability, and what decides it; and the file that asks for it."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from thermid.base.errors import ScenarioError
from thermid.base.files import Places, by_grammar, read_toml, resolve_inside
from thermid.base.results import PlottedTrace, Result, Shown
from thermid.base.units import ICE_POINT, Array
from thermid.fit.error_model import BandCause
from thermid.model.tree import UNJUDGED, Model, Standing, load_model
from thermid.prediction._budget import OFF, SILENT, UNFITTED
from thermid.prediction._known import known_of
from thermid.prediction._monte_carlo.chunks import Job, Limit, MemberRuns, Progress, RunCost
from thermid.prediction._monte_carlo.uncertain import SIDES, UncertainRuns, limits_of, members_of_plan, plan_runs
from thermid.prediction._reduction.macro import macro_model
from thermid.simulation.runs import JobFolder, Scenario, Workers, load_scenario
from thermid.values.store import Filed, FittedValues, LeftOut

SAMPLING_PROBABILITY = 0.95
"""Two-sided probability of the intervals that say what the number of members leaves open. [-]"""
NO_MISFIT = "the residuals of the fit are no larger than their noise"
MIN_NAMED_SHARE = 0.05
"""Share below which a driver is not named in a sentence. [-]"""


MIN_MEMBERS_PER_INPUT = 30
"""Members per input below which shares are not distinguishable from chance. [-]"""

UNORDERED = ("scenario", "start_time", "scenario and start_time")
"""Inputs that are one of several things, none of which is more than another."""


@dataclass(frozen=True)
class Driver:
    """How much one input, or one fit, has to do with a result.

    Parameters
    ----------
    name : str          The input; ``scenario`` and ``start_time`` are which of them was drawn.
    share : float       Of the variance of the result's rank; those of all inputs add up to what a line through the ranks explains. [-]
    direction : float   Rank correlation: positive where more of it makes the result larger; zero for ``scenario``, which has no order. [-]
    """

    name: str
    share: float
    direction: float


def drivers_of(draws: Mapping[str, Array], result: Array) -> tuple[Driver, ...]:
    """Return the drivers of a result (members,), the largest first; empty where there are too few members or nothing varies.

    An input of `draws` (members,) has the share b_k r_k, its standardised coefficient in a regression of ranks times its rank correlation
    with the result (Pratt 1987; Thomas, Hughes and Zumbo, Social Indicators Research 45, 1998): also for correlated inputs these add up to
    R squared. Of more inputs than a fifth of the members, those with the largest correlations are in the regression.
    """
    # inputs that share a value count once
    named: dict[bytes, tuple[str, Array]] = {}
    for name, values in draws.items():
        named.setdefault(values.tobytes(), (name, values))
    inputs = [(n, v) for n, v in named.values() if np.ptp(v) > 0.0]
    if not inputs or np.ptp(result) == 0.0 or result.size < MIN_MEMBERS_PER_INPUT:
        return ()
    target = _standard(_ranks(result))
    columns = np.empty((target.size, len(inputs)))
    for k, (name, values) in enumerate(inputs):
        if name in UNORDERED:  # what an input without order can say: the mean of the result over the members of its group
            _, group = np.unique(values, return_inverse=True)
            values = (np.bincount(group, target) / np.bincount(group))[group]
        columns[:, k] = _standard(values if name in UNORDERED else _ranks(values))
    single = columns.T @ target / target.size
    first = np.argsort(-np.abs(single))[: result.size // 5]
    weights, *_ = np.linalg.lstsq(columns[:, first], target, rcond=None)
    rows = [(inputs[k][0], float(w), float(single[k])) for k, w in zip(first, weights, strict=True)]
    drivers = [Driver(name, w * r, 0.0 if name in UNORDERED else r) for name, w, r in rows]
    return tuple(sorted(drivers, key=lambda d: -d.share))


def _ranks(values: Array) -> Array:
    """Return the ranks from 1 (members,) of values (members,); equal values have the mean of theirs. [-]"""
    _, index, counts = np.unique(values, return_inverse=True, return_counts=True)
    ends = np.cumsum(counts)
    return np.asarray((ends - 0.5 * (counts - 1))[index], dtype=float)


def _standard(values: Array) -> Array:
    """Return values (members,) less their mean, over their standard deviation [-]; zeros where all are equal."""
    spread = values.std()
    return np.asarray((values - values.mean()) / spread) if spread > 0 else np.zeros(values.shape)


def hold_time(crossings: Array, confidence: float) -> tuple[float, tuple[float, float]]:
    """Return the time before which the share `confidence` of members (members,) keeps the limit, and its 95 % interval. [s]

    With p = 1 - confidence it is the crossing of rank floor(p n); the interval is between two ranks, by the binomial distribution.
    """
    from scipy.special import bdtr

    ordered, n, p = np.sort(crossings), crossings.size, 1.0 - confidence
    rank = max(math.floor(p * n + 1e-9), 1)
    below = bdtr(np.arange(n + 1, dtype=float), n, p)  # chance that at most so many members are before the true quantile
    low, high = (int(np.searchsorted(below, 0.5 * (1.0 + side * SAMPLING_PROBABILITY))) for side in (-1.0, 1.0))
    return float(ordered[rank - 1]), (float(ordered[max(low, 1) - 1]), float(ordered[min(high + 1, n) - 1]))


def proportion(hits: int, members: int) -> tuple[float, float]:
    """Return the interval of a probability of which so many hits were seen (Clopper and Pearson). [-]"""
    from scipy.special import betaincinv

    tail = (1.0 - SAMPLING_PROBABILITY) / 2.0
    low = float(betaincinv(hits, members - hits + 1, tail)) if hits else 0.0
    high = float(betaincinv(hits + 1, members - hits, 1.0 - tail)) if hits < members else 1.0
    return low, high


def clock(seconds: float) -> str:
    """Return a time in hours and minutes, or below an hour in minutes and seconds, rounded down.

    >>> clock(11459.0), clock(562.8)
    ('3 h 10 min', '9 min 22 s')
    """
    if math.isinf(seconds):
        return "longer than the scenario"
    minutes, rest = divmod(int(seconds), 60)
    return f"{minutes // 60} h {minutes % 60} min" if minutes >= 60 else f"{minutes} min {rest} s"


@dataclass(frozen=True, eq=False)
class HoldPoint:
    """How long one limit is kept.

    Parameters
    ----------
    node, name : str            Path of the node; as the caller calls it.
    limit : float               [degC]
    side : str                  highest or lowest.
    crossings : array (members,)    When the limit is passed first; infinite where never. [s]
    exceedance : array (times,) Probability that it has been passed by then. [-]
    hold : float                Time until which the limit is kept with the probability asked for; infinite where beyond the scenario. [s]
    between : (float, float)    95 % interval of that time by the number of members alone. [s]
    never : float               Share of members that never pass it within the scenario. [-]
    never_between : (float, float)  The same for that share. [-]
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

    @property
    def drivers_text(self) -> str:
        """Return what drives a limit, in words."""
        return ", ".join(f"{d.name} ({100 * d.share:.0f} %)" for d in self.drivers[:5] if d.share >= MIN_NAMED_SHARE)


@dataclass(frozen=True, eq=False)
class Hold(Result):
    """How long all limits are kept.

    Parameters
    ----------
    title, scenario : str       Of the model and the scenario.
    confidence : float          Probability with which limits are kept until the hold time. [-]
    times : array (times,)      Of the exceedances. [s]
    members : int               How many there are.
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
        points = [p for p in self.points if name in (p.name, p.node)]
        if not points:
            raise ScenarioError(
                f"no limit was given for '{name}'. Limits: {', '.join(p.name for p in self.points)}.", self.title, code="name.unknown"
            )
        return points[0]

    @property
    def sentence(self) -> str:
        """The answer in one sentence."""
        first, percent = self.points[0], f"{100 * self.confidence:g} %"
        if math.isinf(self.together.hold):
            return f"{self.scenario}: no limit is exceeded in {clock(self.times[-1])}, {percent}"
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
            never = f"never exceeded in {100 * p.never:.1f} % ({100 * low:.1f} to {100 * high:.1f})"
            until = (
                f"{clock(p.hold)} ({clock(p.between[0])} to {clock(p.between[1])})" if math.isfinite(p.hold) else "longer than the scenario"
            )
            if p is self.together:
                lines.append(f"  all of them: met for {until}, {never}")
                continue
            lines.append(f"  {p.name} {'above' if p.side == 'highest' else 'below'} {p.limit:g} degC: met for {until}, {never}")
            lines += [f"    driven by {named}" for named in [p.drivers_text] if named]
        lines.append(f"  {self.members} members; the intervals show the error of their finite number, not that of the model")
        return self.standing.over("\n".join([*lines, f"  {self.counted}", *(f"  warning: {w}" for w in self.warnings)]))

    @property
    def counted(self) -> str:
        """Whether the model's discrepancy is in the bands, in words."""
        others = [c for c in self.causes if c != BandCause.UNEXPLAINED and not c.startswith("fit of ")]
        also = f"counted besides: {', '.join(others)}; " if others else ""
        if self.discrepancy is None:
            why = next((x.what.partition(", because ")[2] for x in self.left_out if x.what in (UNFITTED, SILENT)), "")
            why = why or ("it was switched off" if any(x.what.endswith(OFF) for x in self.left_out) else NO_MISFIT)
            return f"{also}the model's discrepancy is not included, because {why}"
        if self.discrepancy == 0.0:
            return f"counted: {', '.join(others)}"
        size = f"{self.discrepancy:.2g} K (one standard deviation), from the residuals of its fit"
        return f"{also}the model's discrepancy is included: {size}"

    def to_dict(self) -> dict[str, Any]:
        """Return what a file or a page needs. Times in seconds, temperatures in degrees Celsius; null for beyond the scenario."""

        def as_table(p: HoldPoint) -> dict[str, Any]:
            """Return a hold time as JSON holds it."""
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
            "points": {p.name: as_table(p) for p in self.points},
            "together": as_table(self.together),
            "discrepancy_K": self.discrepancy,
            "left_out": [{"what": x.what, "kelvin": x.kelvin if math.isfinite(x.kelvin) else None} for x in self.left_out],
            "warnings": list(self.warnings),
        }

    _axes_titles = ("time [s]", "probability of passing the limit [-]")

    def _as_traces(self) -> Sequence[PlottedTrace]:
        """Return how likely each limit is passed by then."""
        return [PlottedTrace(p.name, self.times, p.exceedance) for p in self.points]

    def _ipython_key_completions_(self) -> list[str]:
        """Return the names of the limits."""
        return [p.name for p in self.points]


def hold(runs: UncertainRuns, limits: Mapping[str, Any], *, confidence: float = 0.95) -> Hold:
    """Return how long limits are kept in the members of a campaign of runs.

    The hold time is that until which the share `confidence` of the members keeps the limit: a one-sided bound. Its own interval comes
    from order statistics (Hahn and Meeker, Statistical Intervals, 1991, chapter 5) and holds whatever the distribution; that of the
    probability of never is Clopper and Pearson's (Biometrika 26, 1934).

    Parameters
    ----------
    runs : UncertainRuns    With these limits where members were counted; drivers are those of the members that were kept whole.
    limits : dict           Reference point -> ``"50 [degC]"``, or ``{"highest": "50 [degC]", "lowest": "-20 [degC]"}``.
    confidence : float      Between a half and one. [-]

    Raises
    ------
    ScenarioError       When a limit is none, so few members cannot tell such a probability, or members failed.
    NameNotFoundError   When a limited node was not kept.
    """
    wanted = limits_of(limits, runs.title)
    check_members(len(runs), confidence, runs.title)
    if runs.failed:
        member, why = next(iter(runs.failed.items()))
        raise ScenarioError(
            f"{len(runs.failed)} of {len(runs)} members failed, so how long they keep the limits is not known and no hold time is given. "
            f"Member {member}: {why} Correct the model, or narrow the spread that leads there.",
            runs.title,
            code="run.members-failed",
        )
    points = [_point(runs, runs.draws_of_whole, name, side, value, confidence) for name, side, value in wanted]
    points.sort(key=lambda p: (p.hold, p.never, -p.exceedance[-1]))
    # whichever limit is passed first, member by member; with the drivers of the first limit
    crossings, first = np.min([p.crossings for p in points], axis=0), points[0]
    together = _hold_point(first.node, "any limit", first.limit, first.side, crossings, runs, confidence, first.drivers)
    budget = runs.job.budget
    limited = {p.node for p in points}
    sizes = [float(np.abs(row).sum()) for t, row in zip(budget.targets, budget.gain, strict=True) if t.form == "node" and t.name in limited]
    causes = tuple(dict.fromkeys(c for c in budget.causes if c not in ("stated", "fit")))
    warnings = (*runs.warnings, *([runs.centre] if runs.centre else []))
    common = (len(runs.assumed), warnings, max(sizes, default=None), runs.standing, runs.left_out, runs.not_counted, causes)
    return Hold(runs.title, runs.scenario, confidence, runs.times, len(runs), tuple(points), together, *common)


def check_members(members: int, confidence: float, title: str) -> None:
    """Refuse a probability that is none, and one that so few members cannot tell.

    Raises
    ------
    ScenarioError   With how many would do.
    """
    if not 0.5 <= confidence < 1.0:
        raise ScenarioError(
            f"the confidence is {confidence:g}. Give 0.95 or another number from 0.5 up to 1.", title, code="value.outside-range"
        )
    if members * (1.0 - confidence) < 1.0:
        enough = math.ceil(20 / (1 - confidence))
        raise ScenarioError(
            f"{members} members are too few for {100 * confidence:g} %. Request {enough} or more.", title, code="value.outside-range"
        )


def _point(runs: UncertainRuns, draws: Mapping[str, Array], name: str, side: str, kelvin: float, confidence: float) -> HoldPoint:
    """Return how long one limit [K] is kept, and the drivers of the temperature at the hold time by the `draws` of whole members."""
    path = runs.job.model.canonical(name)
    crossings = runs.crossings(Limit(path, SIDES[side], kelvin))
    until = hold_time(crossings, confidence)[0]
    # how far above: at the hold time, or the farthest of the run where that lies beyond it, or is the start
    at = int(np.searchsorted(runs.times, until)) if 0.0 < until < math.inf else None
    measure = SIDES[side] * runs.sampled(name, at, SIDES[side])
    return _hold_point(path, name, kelvin - ICE_POINT, side, crossings, runs, confidence, drivers_of(draws, measure))


def _hold_point(
    path: str,
    name: str,
    limit: float,
    side: str,
    crossings: Array,
    runs: UncertainRuns,
    confidence: float,
    drivers: tuple[Driver, ...],
) -> HoldPoint:
    """Return the entry of a limit [K] from when the members pass it, `crossings` (members,) [s], infinite where one never does.

    The share of members beyond is given at every time of the runs; `confidence` [-] is that of the hold time.
    """
    exceedance = np.searchsorted(np.sort(crossings), runs.times, side="right") / crossings.size
    never = int(np.isinf(crossings).sum())
    until, between = hold_time(crossings, confidence)
    share, share_interval = never / crossings.size, proportion(never, crossings.size)
    return HoldPoint(path, name, limit, side, crossings, exceedance, until, between, share, share_interval, drivers)


@dataclass(frozen=True, eq=False)
class HoldQuestion(Shown):
    """How long a model keeps its limits in a scenario.

    Parameters
    ----------
    model : Model
    scenarios : tuple of Scenario   Several are draws of the weather.
    values : tuple                  What fits found and left open.
    unit : str                      The submodel that is the unit; empty for a model without a host.
    limits, spread : dict           As in `hold` and `uncertain_runs`.
    members, seed : int
    every : str                     Interval of the stored samples; empty for 121 of them.
    confidence : float              [-]
    remarks : tuple of str          What a reader must know first of the values.
    """

    model: Model
    scenarios: tuple[Scenario, ...]
    values: tuple[FittedValues, ...]
    unit: str
    limits: Mapping[str, Any]
    spread: Mapping[str, Any]
    members: int
    seed: int
    every: str
    confidence: float
    remarks: tuple[str, ...] = ()

    def cost(self, *, n: int = 0, folder: str | os.PathLike[str] | None = None) -> RunCost:
        """Return what `run` would take; two small chunks are run for it."""
        job, members = self._plan()[0], n or self.members
        store = JobFolder.below(folder, job.key()) if folder is not None else None
        return RunCost.of_members(job, members, MemberRuns(job, members, job.whole(members), store, None, None).members_in_folder())

    def _plan(self) -> tuple[Job, tuple[str, ...]]:
        """Return the runs that answer the question, and what a reader must know."""
        limits_of(self.limits, self.model.title)
        return plan_runs(
            self.model,
            self.scenarios,
            known_of(self.values, self.model, self.unit),
            spread=self.spread,
            seed=self.seed,
            nodes=self.limits,
            every=self.every or None,
        )

    def run(
        self,
        *,
        n: int = 0,
        executor: Workers = None,
        progress: Progress | None = None,
    ) -> tuple[UncertainRuns, Hold]:
        """Return the runs, and how long the limits are kept in them.

        Arguments are as in `uncertain_runs`; `progress` is called with the members done and all of them.
        """
        members = n or self.members
        check_members(members, self.confidence, self.model.title)
        runs = members_of_plan(*self._plan(), members, executor, progress)
        runs = replace(runs, warnings=(*self.remarks, *runs.warnings))
        return runs, hold(runs, self.limits, confidence=self.confidence)


def load_hold(path: str | os.PathLike[str]) -> HoldQuestion:
    """Return the hold question of a TOML file; files that it names are relative to it and stay inside the project.

    Where it names a `unit`, every value of the host around it must have a source; see `macro_model`.

    Raises
    ------
    DeckError   When it does not follow the grammar.
    """
    target = Path(path)
    data, lines = read_toml(target)
    where = Places(target.name, lines)
    content = by_grammar("thermid.prediction._monte_carlo.schema.HoldFile", data, where)

    def files(key: str, names: str | list[str]) -> list[Path]:
        """Return the files of a key, each inside the project."""
        return [resolve_inside(target.parent, name, where(key)) for name in ([names] if isinstance(names, str) else names)]

    unit = content.unit
    (deck,) = files("model", content.model)
    model = macro_model(deck, at=unit) if unit else load_model(deck)
    values = [Filed.read(f, model, at=unit) for f in files("values", content.values)]
    return HoldQuestion(
        model,
        tuple(load_scenario(f) for f in files("scenario", content.scenario)),
        tuple(x.values for x in values),
        unit,
        content.written["limits"],
        content.spread,
        content.members,
        content.seed,
        content.every,
        content.confidence,
        tuple(line for x in values for line in x.lines),
    )
