"""Metrics of what a model misses, criteria on them, and their checks: at each sensor or over all, for verdicts, correlations and plans."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from thermid.base.arguments import takes_objects
from thermid.base.errors import IdentificationError, ScenarioError, nearest, refuse_unknown
from thermid.base.extensions import by_grammar
from thermid.base.linear_algebra import Array
from thermid.base.sourced import check_mark
from thermid.base.toml_files import Places
from thermid.base.units import ICE_POINT
from thermid.model.tree import literal

FINAL = 0.05
"""Share of a record, at its end, over which the final error is the mean, so that noise does not decide it. [-]"""


@dataclass(frozen=True, eq=False)
class Residuals:
    """Measured less predicted readings of one sensor, or of several that are pooled.

    Parameters
    ----------
    times : array (samples,)    [s]
    kelvin : array (samples,)   [K]
    weights : array (samples,)  Of each in a mean; their sum is one. [-]
    """

    times: Array
    kelvin: Array
    weights: Array

    @classmethod
    def equally_weighted(cls, times: Array, kelvin: Array) -> Residuals:
        """Residuals of equal weight."""
        return cls(times, kelvin, np.full(kelvin.size, 1.0 / kelvin.size))


def rmse(r: Residuals) -> float:
    """Root mean square."""
    return float(np.sqrt(r.weights @ r.kelvin**2))


def mean(r: Residuals) -> float:
    """Mean, with its sign."""
    return float(r.weights @ r.kelvin)


def largest(r: Residuals) -> float:
    """Largest residual by size, with its sign."""
    return float(r.kelvin[np.abs(r.kelvin).argmax()])


def spread(r: Residuals) -> float:
    """Standard deviation about the mean."""
    return float(np.sqrt(r.weights @ (r.kelvin - mean(r)) ** 2))


def p95(r: Residuals) -> float:
    """95th percentile of the sizes."""
    return float(np.quantile(np.abs(r.kelvin), 0.95))


def final(r: Residuals) -> float:
    """Mean over the last twentieth of the record, with its sign."""
    end = r.times >= r.times[-1] - FINAL * (r.times[-1] - r.times[0])
    return float(np.mean(r.kelvin[end]))


@dataclass(frozen=True)
class Metric:
    """One row: how a metric is computed and what it is called.

    Parameters
    ----------
    of : callable           Residuals -> size, with a sign where it has one. [K]
    title : str             What people call it.
    aliases : tuple of str  Further keys that files may write.
    pooled : bool           Whether a correlation takes it, by its own key, over all sensors of a case together; an alias is of each sensor.
    signed : bool           Whether it has a sign, which tables show; a limit is compared with the size.
    digits : int            In tables: decimals of a metric with a sign, else significant digits.
    """

    of: Callable[[Residuals], float]
    title: str
    aliases: tuple[str, ...] = ()
    pooled: bool = False
    signed: bool = False
    digits: int = 2

    @property
    def of_single_readings(self) -> bool:
        """Whether its limit holds for every single residual."""
        return self.of is largest

    @property
    def short(self) -> str:
        """Its title without the word error, for headings that name the unit."""
        return self.title.removesuffix(" error")


METRICS: Final[dict[str, Metric]] = {
    "rmse": Metric(rmse, "RMSE"),
    "mean": Metric(mean, "mean error", ("mean_error",), pooled=True, signed=True),
    "largest": Metric(largest, "largest error", ("max_error",), signed=True),
    "spread": Metric(spread, "spread", pooled=True),
    "p95": Metric(p95, "95th percentile"),
    "final": Metric(final, "final error", ("final_error",), signed=True, digits=3),
}
"""Key -> metric."""


def metric_keys() -> tuple[str, ...]:
    """Every key that a file may write, aliases too."""
    return tuple(key for name, metric in METRICS.items() for key in (name, *metric.aliases))


def metric(key: str, where: str = "", word: str = "metric") -> Metric:
    """The row of a key.

    Raises
    ------
    ScenarioError   With the nearest key.
    """
    for name, row in METRICS.items():
        if key == name or key in row.aliases:
            return row
    raise ScenarioError(f"unknown {word} '{key}'.{nearest(key, metric_keys())}", where, code="name.unknown")


KINDS = ("steady", "transient")
METRIC_OF_EACH = {"steady": "mean", "transient": "largest"}
"""Kind of case -> the metric that ``each`` limits: the mean of a settled stretch, or every single reading."""
PLAIN = ("share", "kinds", "mark", "source")


@dataclass(frozen=True, init=False)
class Criteria:
    """Limits that a model must meet.

    Parameters
    ----------
    name : str              Of the set.
    limits : dict           Metric -> limit: a key of `METRICS`, an alias, or ``each``; a text with unit, or a number in kelvin. Each may be
                            an argument of its own too. [K]
    sensors : dict          Sensor -> limits of its own, in place of the above; of a verdict only.
    share : float           Part of the sensors of a correlation that must meet a limit at each sensor; 1 for all of them. [-]
    kinds : tuple of str    What a correlation applies them to: steady, transient or both. A verdict is about every reading.
    mark : str              How sure the limits are, a key of `MARKS`.
    source : str            Document and clause.
    where : str             Its place in a file, for messages.

    Raises
    ------
    ScenarioError   When a metric, kind or mark is none, a limit is not above zero, or a named set has none.

    >>> Criteria(rmse="0.5 [K]", max_error="2 [K]").limits
    {'rmse': 0.5, 'max_error': 2.0}
    """

    name: str
    limits: Mapping[str, float]
    sensors: Mapping[str, Mapping[str, float]]
    share: float
    kinds: tuple[str, ...]
    mark: str
    source: str

    @takes_objects
    def __init__(
        self,
        name: str = "",
        limits: Mapping[str, str | float] | None = None,
        *,
        sensors: Mapping[str, Mapping[str, str | float]] | None = None,
        share: float = 1.0,
        kinds: Sequence[str] = ("steady",),
        mark: str = "project",
        source: str = "",
        where: str = "",
        **more: str | float,
    ) -> None:
        place = where or (f"criteria '{name}'" if name else "criteria")
        if limits is not None and not isinstance(limits, Mapping):
            raise ScenarioError(
                f"give limits as a table, not {limits!r}: Criteria(rmse='0.5 [K]', max_error='2 [K]').", place, code="value.wrong-kind"
            )
        common = _kelvin({**(limits or {}), **more}, place)
        sensor_limits = {sensor: _kelvin(table, f"{place}.sensors.{sensor}") for sensor, table in (sensors or {}).items()}
        check_mark(str(mark), place)
        if name and not common:
            raise ScenarioError(
                f"a set of criteria needs at least one limit above zero: {', '.join(known_criteria())}.", place, code="value.incomplete"
            )
        if not isinstance(share, int | float) or not 0 < share <= 1:
            raise ScenarioError(
                f"the share of sensors that must meet a limit must be above 0, up to 1; given: {share}.", place, code="value.outside-range"
            )
        refuse_unknown(kinds or ("",), KINDS, place, "criteria apply to steady or transient cases, not to '{}'.", ScenarioError)
        fields = {
            "name": name,
            "limits": common,
            "sensors": sensor_limits,
            "share": share,
            "kinds": tuple(kinds),
            "mark": mark,
            "source": source,
        }
        for key, value in fields.items():
            object.__setattr__(self, key, value)

    @classmethod
    @takes_objects
    def read(cls, table: Mapping[str, Any], where: str, name: str = "") -> Criteria:
        """Criteria from a table of a plan, which gives them a name, or of a verdict of a campaign, which has `sensors`."""
        keys = (*known_criteria(), *(PLAIN if name else ("sensors",)))
        refuse_unknown(table, keys, where, "unknown criterion '{}'.", ScenarioError)
        table = by_grammar("thermid.campaign._judge.schema.CriteriaTable", table, Places(where)).written
        fields = {k: table[k] for k in PLAIN if k in table}
        limits = _parsed({k: v for k, v in table.items() if k not in (*PLAIN, "sensors")}, where)
        sensor_limits = {s: _parsed(t, f"{where}.sensors.{s}") for s, t in table.get("sensors", {}).items()}
        return cls(name, sensors=sensor_limits, where=where, **fields, **limits)


def known_criteria() -> tuple[str, ...]:
    """Keys of the limits: every metric, its aliases, and ``each``."""
    return (*metric_keys(), "each")


def heading(key: str) -> str:
    """Heading of a column of the limits of one metric."""
    return "every sensor" if key == "each" else metric(key).short


def _parsed(table: Any, where: str) -> Any:
    """Texts of a file in kelvin, where a plain number is refused; what is no table as it is."""
    return {k: literal(v, "K", f"{where}.{k}") for k, v in table.items() if v != ""} if isinstance(table, Mapping) else table


def _kelvin(limits: Mapping[str, str | float], where: str) -> dict[str, float]:
    """Limits in kelvin by known metrics; an empty text is none."""
    if not isinstance(limits, Mapping):
        raise ScenarioError("give the criteria of a sensor as a table such as { rmse = '1 [K]' }.", where, code="value.wrong-kind")
    out: dict[str, float] = {}
    for key, limit in limits.items():
        if key != "each":
            metric(key, where, "criterion")
        if isinstance(limit, str) and not limit:
            continue
        out[key] = float(limit) if isinstance(limit, int | float) else literal(limit, "K", f"{where}.{key}")
        if not math.isfinite(out[key]) or out[key] <= 0:
            raise ScenarioError("a limit must be above zero.", where, code="value.outside-range")
    return out


CriteriaSet = Criteria
"""Earlier public name."""

ECSS_SOURCE = "practice for balance tests by a public technical note: 2 K, 3 K, below 5 K"
GOAL = "MIL-HDBK-340 (1985), 8.7.3: goal of +-3 C, else explain or change the model"
APPLIED = "the goal of 8.7.3, applied to every reading; the handbook's own clause is about balance tests"
CRITERIA = {
    c.name: c
    for c in (
        Criteria("ECSS", mean=2.0, spread=3.0, each=5.0, mark="secondary", source=ECSS_SOURCE),
        Criteria("MIL-HDBK-340", each=3.0, mark="read", source=GOAL),
        Criteria("MIL-HDBK-340, transient", each=3.0, kinds=("transient",), mark="project", source=APPLIED),
    )
}
"""Named sets; a project may give its own."""


@dataclass(frozen=True, eq=False)
class Deviation:
    """Residuals of one sensor in one case.

    Parameters
    ----------
    case, sensor : str
    kind : str              'steady', a settled stretch; 'transient', every reading.
    residuals : Residuals   Measured less simulated. [K]
    measured : float        Mean of the readings. [K]
    simulated : float       Mean of the simulation. [K]
    accuracy : float        Of the sensor. [K]
    weight : float          In the means over sensors. [-]
    excluded : str          Why it does not count; empty where it does.
    """

    case: str
    sensor: str
    kind: str
    residuals: Residuals
    measured: float
    simulated: float
    accuracy: float = 0.0
    weight: float = 1.0
    excluded: str = ""

    @property
    def samples(self) -> int:
        """How many readings."""
        return self.residuals.kelvin.size

    def __getitem__(self, key: str) -> float:
        """A metric of it. [K]"""
        return metric(METRIC_OF_EACH[self.kind] if key == "each" else key).of(self.residuals)

    def __str__(self) -> str:
        """Return it as a line."""
        out = f"; left out: {self.excluded}" if self.excluded else ""
        return (
            f"{self.case}, {self.sensor}, {self.kind}: measured {self.measured - ICE_POINT:.2f}, simulated "
            f"{self.simulated - ICE_POINT:.2f} degC, mean {self['mean']:+.2f}, spread {self['spread']:.2f}, "
            f"largest {self['largest']:+.2f} K{out}"
        )


@dataclass(frozen=True)
class Check:
    """One criterion, judged.

    Parameters
    ----------
    criteria, kind, case : str  The set; steady or transient; the case.
    criterion : str             Key of the metric, as the criteria name it.
    found, limit : float        [K]
    sensor : str                Where it is found: the sensor that lies furthest out; empty over all sensors together.
    outside : tuple of str      Sensors beyond the limit.
    counted : int               Sensors that counted.
    met : bool                  Whether it is met.
    mark : str                  Of its limit.
    """

    criteria: str
    kind: str
    case: str
    criterion: str
    found: float
    limit: float
    sensor: str
    outside: tuple[str, ...]
    counted: int
    met: bool
    mark: str = "project"

    @property
    def passed(self) -> bool | None:
        """Whether it is met; None where its limit is from memory and decides nothing."""
        return None if self.mark == "memory" else self.met

    @property
    def used(self) -> float:
        """How much of the limit is used, 1 where it is reached. [-]"""
        return self.found / self.limit

    @property
    def title(self) -> str:
        """Name of the criterion at one sensor, as in a heading."""
        return "deviation" if self.criterion == "each" else metric(self.criterion).title

    @property
    def over_sensors(self) -> str:
        """Name of the criterion where it judges the sensors of a case together, as in a heading."""
        if self.criterion == "each":
            return heading("each")
        row = metric(self.criterion)
        return f"{row.title} of every sensor" if self.sensor else f"{row.short} over sensors"

    @property
    def words(self) -> str:
        """The criterion as verdicts name it, with what is found."""
        return f"{self.criterion.replace('_', ' ')} {self.found:.3g} K, limit {self.limit:.3g} K"

    def __str__(self) -> str:
        """Return the check as a line."""
        word = "not decided, because the limit is quoted from memory" if self.passed is None else "met" if self.met else "NOT met"
        place = f" at {self.sensor}" if self.sensor else ""
        more = f", {len(self.outside)} of {self.counted} beyond" if self.outside else ""
        what = {"each": "largest sensor"}.get(self.criterion, f"largest {self.title}" if self.sensor else self.over_sensors)
        return f"{self.case}, {self.kind}: {what} {self.found:.2f} K{place}, limit {self.limit:g} K [{self.mark}]{more}: {word}"


def judge_sensors(criteria: Criteria, deviations: Sequence[Deviation]) -> Iterator[Check]:
    """Yield every criterion at every sensor, by the sensor's own limits where it has some."""
    for d in deviations:
        limits = {**criteria.limits, **criteria.sensors.get(d.sensor, {})}
        if not limits:
            raise IdentificationError(
                f"'{d.sensor}' has no criterion. Give it at least one limit: rmse, max_error or mean_error.", code="value.incomplete"
            )
        for key, limit in limits.items():
            yield _at_sensors(criteria, d.kind, d.case, key, limit, [d])


def judge(criteria: Criteria, deviations: Sequence[Deviation], where: str) -> Iterator[Check]:
    """Yield every criterion of a set over the sensors of every case.

    Raises
    ------
    IdentificationError   When a criterion has no data, or limits of single sensors are given, which a verdict judges.
    """
    if criteria.sensors:
        raise IdentificationError(
            f"limits of single sensors, such as '{next(iter(criteria.sensors))}', apply in a verdict only. Use td.validate.",
            where,
            code="value.without-effect",
        )
    for kind in criteria.kinds:
        counted = [d for d in deviations if d.kind == kind and not d.excluded]
        if not counted:
            how = "give its steady periods" if kind == "steady" else "give a log"
            raise IdentificationError(
                f"the criteria '{criteria.name}' apply to {kind} cases, but there are no data for them: {how}.",
                where,
                code="verdict.criteria",
            )
        # each case by itself, or too warm in one would compensate too cold in another
        for case in dict.fromkeys(d.case for d in counted):
            sensors = [d for d in counted if d.case == case]
            for key, limit in criteria.limits.items():
                row = METRICS.get(key)
                check = _pooled if row is not None and row.pooled else _at_sensors
                yield check(criteria, kind, case, key, limit, sensors)


def _at_sensors(c: Criteria, kind: str, case: str, key: str, limit: float, sensors: Sequence[Deviation]) -> Check:
    """Judge the size of a metric at each sensor by the limit; met if at least `c.share` of the sensors keep it. The worst one is quoted."""
    sizes = [abs(d[key]) for d in sensors]
    outside = tuple(d.sensor for d, size in zip(sensors, sizes, strict=True) if size > limit)
    met = len(outside) <= (1.0 - c.share) * len(sensors) + 1e-9
    worst = sensors[int(np.argmax(sizes))].sensor
    return Check(c.name, kind, case, key, max(sizes), limit, worst, outside, len(sensors), met, c.mark)


def _pooled(c: Criteria, kind: str, case: str, key: str, limit: float, sensors: Sequence[Deviation]) -> Check:
    """Judge a metric of all sensors together: of their means where settled, of every reading where they move."""
    total = sum(d.weight for d in sensors)
    if kind == "steady":
        parts = [Residuals(np.zeros(1), np.array([d["mean"]]), np.array([d.weight / total])) for d in sensors]
    else:
        parts = [Residuals(d.residuals.times, d.residuals.kelvin, d.residuals.weights * (d.weight / total)) for d in sensors]
    size = abs(METRICS[key].of(Residuals(*(np.concatenate([getattr(p, k) for p in parts]) for k in ("times", "kelvin", "weights")))))
    return Check(c.name, kind, case, key, size, limit, "", (), len(sensors), size <= limit, c.mark)
