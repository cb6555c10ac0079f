"""Validation: a calibrated model against a record that no fit has seen, by stated criteria; and a comparison that judges nothing.

A results folder remembers the verdicts on held-out records: one that failed before its model was fitted anew is no longer independent.

Metrics of what a model misses, criteria on them, and their checks: at each sensor or over all, for verdicts, correlations and plans.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

import numpy as np

from thermid.base.arguments import takes_objects
from thermid.base.errors import IdentificationError, ScenarioError, nearest, refuse_unknown
from thermid.base.files import FileKinds, Places, by_grammar, read_json
from thermid.base.results import VERDICTS, Figure, PlottedTrace, Result, Row, weigh
from thermid.base.units import ICE_POINT, Array, amount, counted, short, some
from thermid.fit.calibration import FIRST, Calibration, Request, SensorStatistics, SensorTrace, fit
from thermid.measure.records import Record
from thermid.model.tree import UNJUDGED, Model, Standing, literal
from thermid.prediction.bands import RecordPrediction, record_bands, record_request
from thermid.simulation.runs import Scenario

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
    return float(np.mean(r.kelvin[(r.times >= r.times[-1] - FINAL * (r.times[-1] - r.times[0]))]))


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
        Figure.check_mark(str(mark), place)
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
    """Return metric -> limit in kelvin, of known metrics and ``each``; an empty text is none.

    Raises
    ------
    ScenarioError   When they are no table, a metric is unknown, or a limit is not above zero.
    """
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
    """Judge a metric of all sensors together, by their weights [-]: of their means [K] where settled, of every reading where they move."""
    total = sum(d.weight for d in sensors)
    if kind == "steady":
        parts = [Residuals(np.zeros(1), np.array([d["mean"]]), np.array([d.weight / total])) for d in sensors]
    else:
        parts = [Residuals(d.residuals.times, d.residuals.kelvin, d.residuals.weights * (d.weight / total)) for d in sensors]
    size = abs(METRICS[key].of(Residuals(*(np.concatenate([getattr(p, k) for p in parts]) for k in ("times", "kelvin", "weights")))))
    return Check(c.name, kind, case, key, size, limit, "", (), len(sensors), size <= limit, c.mark)


FILE = "looks.json"
ONE_SIGN = 0.7
"""Part of the root mean square of a sensor's deviations that their mean is, from which most of their squares is a constant. [-]"""


@dataclass(frozen=True)
class RecordedLook:
    """One verdict on a record.

    Parameters
    ----------
    record : str    Its name.
    sha256 : str    Checksum of its samples.
    stage : str     The stage whose values were judged.
    key : str       Hash of everything that these values depend on.
    passed : bool   Whether every criterion was met by values that are fair or accepted.
    date : str      The day.
    """

    record: str
    sha256: str
    stage: str
    key: str
    passed: bool
    date: str


def look(folder: Path | None, record: str, sha256: str, stage: str, key: str, passed: bool) -> tuple[RecordedLook, ...]:
    """Return the earlier failed verdicts on a record by other values than these, and note this one.

    The same values judged again are no new look.

    Raises
    ------
    DeckError   When the folder's file of verdicts is damaged: a new one would forget those that failed.
    """
    if folder is None:
        return ()
    looks = _read(folder)
    earlier = tuple(one for one in looks if one.sha256 == sha256 and not one.passed and one.key != key)
    now = RecordedLook(record, sha256, stage, key, passed, datetime.now(UTC).date().isoformat())
    if all((one.sha256, one.key, one.passed) != (sha256, key, passed) for one in looks):
        folder.mkdir(parents=True, exist_ok=True)
        FileKinds.RESULTS_FILE.save_text(folder / FILE, json.dumps([asdict(one) for one in (*looks, now)], indent=1))
    return earlier


def _read(folder: Path | None) -> tuple[RecordedLook, ...]:
    """Return the looks at hold-out records that a results folder keeps; none without a folder."""
    path = folder / FILE if folder is not None else None
    if path is None or not path.is_file():
        return ()
    return tuple(RecordedLook(**dict(one)) for one in read_json(path, "thermid.campaign._judge.schema.LooksFile").root)


@dataclass(frozen=True, eq=False)
class Verdict(Result):
    """Whether a model is good enough for its intended use, on data that no fit has seen.

    Parameters
    ----------
    model : str                     The stage whose values were used.
    record : str                    The record.
    checks : tuple of Check
    statistics : dict               Sensor -> SensorStatistics.
    fitted_locally : tuple of str   What was fitted to this very record.
    deciding : tuple of str         Of these, what would change the verdict within two of its standard errors.
    prediction : Calibration        Measured and predicted readings; None where it was not judged.
    title : str                     What it is about.
    failed_before : tuple of RecordedLook   Failed verdicts on this record by other values, of which the results folder knows.
    standing : Standing             Of the values that were judged, before the verdict.
    bands : RecordPrediction or None    The readings beside their bands; None where it was not judged.
    """

    model: str
    record: str
    checks: tuple[Check, ...]
    statistics: Mapping[str, SensorStatistics]
    fitted_locally: tuple[str, ...]
    prediction: Calibration | None
    title: str = ""
    failed_before: tuple[RecordedLook, ...] = ()
    standing: Standing = UNJUDGED
    bands: RecordPrediction | None = None
    deciding: tuple[str, ...] = ()

    @property
    def passed(self) -> bool | None:
        """Whether every criterion is met; None where the values were not judged, because they are not credible."""
        return weigh([c.passed for c in self.checks]) if self.prediction is not None else None

    @property
    def blocks(self) -> Sequence[SensorTrace]:
        """Measured and predicted readings; none where it was not judged."""
        return self.prediction.blocks if self.prediction is not None else ()

    @property
    def unseen(self) -> bool:
        """Whether nobody can have learnt from this record: no failed verdict on it came before a new fit."""
        return not self.failed_before

    @property
    def missed(self) -> tuple[Check, ...]:
        """The criteria that are not met; one that decides nothing is none of them."""
        return tuple(c for c in self.checks if c.passed is False)

    @property
    def worst(self) -> Check | None:
        """The criterion that uses most of its limit, of those that are not met where there are any; None where none was judged."""
        return max(self.missed or self.checks, key=lambda c: c.used, default=None)

    @property
    def unfounded(self) -> bool:
        """Whether it is within its limits by values that are not fair and that nobody accepted: no pass."""
        return self.passed is True and self.standing.exit_code > 0

    @property
    def conditional(self) -> bool:
        """Whether values that were fitted to the record that it judges decide it, within two standard errors of them."""
        return bool(self.deciding)

    @property
    def questions(self) -> tuple[str, ...]:
        """What its record asks of its owner: exchanged sensors, a power in another unit, other conditions, a sensor that moved since."""
        missed = {c.sensor for c in self.missed}
        apart = {n: s.mean for n, s in self.statistics.items() if n in missed and abs(s.mean) > ONE_SIGN * s.rmse}
        together = 1 < len(apart) == len(self.statistics) and len({mean > 0.0 for mean in apart.values()}) == 1
        cause = "do losses, a fan, a power or the surroundings differ from" if together else "does this sensor sit at another place than in"
        groups = [[*apart]] if together else [[n] for n in apart]
        moved = [
            f"{FIRST}{some(g, 'sensors')} read{'s' * (len(g) == 1)} {short(max(abs(apart[n]) for n in g))} K "
            f"{'above' if apart[g[0]] > 0.0 else 'below'} the prediction throughout; {cause} the fitted records?"
            for g in groups
        ]
        return (*(w for w in self.prediction.warnings if w.startswith(FIRST)), *moved) if self.prediction is not None else ()

    @property
    def head(self) -> str:
        """The verdict in words, without its criteria."""
        about = f" ({self.title})" if self.title else ""
        word = "NOT JUDGED" if self.passed is None else "PASSED" if self.passed else "FAILED"
        by = f"by values that are {self.standing.state}" if self.passed and not self.standing.fair else ""
        word = f"NOT PASSED: within its limits, but {by}" if self.unfounded else f"{word} {by}".rstrip()
        other = "fail" if self.passed else "pass"
        names = " or ".join(self.deciding)
        condition = f", but it would {other} with another {names} within two standard errors; fit it to another record" if names else ""
        return f"{self.model} on {self.record}{about}: {word}{condition}"

    def __str__(self) -> str:
        """Return the verdict as text, criterion by criterion."""
        if self.passed is None:
            return f"{self.head}; the record was not read. {self.standing.line(self.model)}"
        lines = [self.head, *(f"  {question}" for question in self.questions)]
        if self.failed_before:
            first = self.failed_before[0]
            lines.append(
                f"  This record is no longer independent: the model failed {counted(len(self.failed_before), 'verdict')} on it since "
                f"{first.date} and was refitted afterwards. Validate on another record."
            )
        for c in self.checks:
            lines.append(f"  {c.sensor}: {c.words}: {VERDICTS[c.passed]}")
        if self.prediction is not None and self.prediction.local:
            lines.append(f"  fitted to this record: {', '.join(f'{i.name} {i.words}' for i in self.prediction.local)}")
            lines += [f"  warning: {w}" for w in self.prediction.warnings if any(f"{i.name}' ended at" in w for i in self.prediction.local)]
        if self.bands is not None:
            lines += [*(f"  {line}" for line in self.bands.lines), *(f"  warning: {words}" for words in self.bands.warnings)]
        return "\n".join(lines)

    _frame_of_rows = True

    def to_dict(self) -> dict[str, Any]:
        """Return the verdict as JSON holds it."""
        plain: dict[str, Any] = {k: getattr(self, k) for k in ("model", "record", "title", "passed", "conditional", "unseen")}
        return plain | {
            "standing": self.standing.to_dict(self.model),
            "fitted_locally": list(self.fitted_locally),
            "sensors": {n: s.to_dict() for n, s in self.statistics.items()},
            "checks": self._as_rows(),
            "bands": self.bands.to_dict() if self.bands is not None else None,
        }

    def _as_rows(self) -> list[Row]:
        """Return the criteria."""
        return [
            {"sensor": c.sensor, "criterion": c.criterion, "found_K": c.found, "limit_K": c.limit, "passed": c.passed} for c in self.checks
        ]

    def _as_traces(self) -> Sequence[PlottedTrace]:
        """Return measured and predicted readings."""
        return self.prediction._as_traces() if self.prediction is not None else ()


def validate(
    calibration: Calibration,
    record: Record,
    criteria: Criteria,
    *,
    scenario: Scenario | None = None,
    local: Mapping[str, Any] | None = None,
    readings: Mapping[str, Any] | None = None,
    window: str | float = 0.0,
    title: str = "",
) -> Verdict:
    """Return the verdict on a calibrated model from a record that no stage has used.

    Parameters
    ----------
    calibration : Calibration   The fit; its values and its instruments' constant errors are held.
    record : Record             The held-out log.
    criteria : Criteria         Limits.
    scenario : Scenario         What the log does not say.
    local : dict                Values fitted to this record, as in `calibrate`. The verdict is conditional where they decide it.
    readings : dict             Boundary or ``initial.<node>`` -> channel whose first reading stands there, or ``{channel, offset}``.
    window : float              First readings are medians over this time. [s]
    title : str                 What the verdict is about, where several judge one record.

    Raises
    ------
    IdentificationError   When the record was used by a fit, whatever was cut from it since.

    Notes
    -----
    Values that are not credible, or rest on such, are not judged: the verdict names them, and the record is not looked at.
    """
    if not calibration.standing.judgeable:
        return not_judged(calibration, record.name, title)
    user = calibration.used_records.get(record.origin.sha256)
    if user is not None:
        raise IdentificationError(
            f"record '{record.name}' was used by {user}. A validation needs a hold-out record: use one that no fit used.",
            code="campaign.record-used",
        )
    run = fit(record_request(calibration, record, scenario, local, readings, amount(window, "s", "window")))
    bands = record_bands(calibration, run)
    prediction = replace(run, blocks=tuple(replace(b, predicted=bands.bands[b.sensor].predicted) for b in run.blocks))
    statistics = prediction.statistics[record.name]
    refuse_unknown(
        criteria.sensors or {},
        statistics,
        "",
        f"criteria are given for '{{}}', which is not a sensor of {record.name}.",
        IdentificationError,
    )
    checks = tuple(judge_sensors(criteria, [_deviation(b) for b in prediction.blocks]))
    locally = tuple(dict.fromkeys(i.name for i in prediction.local))
    deciding, standing = _deciding(run, prediction.blocks, criteria, checks), calibration.standing
    return Verdict(calibration.stage, record.name, checks, statistics, locally, prediction, title, (), standing, bands, deciding)


def _deciding(run: Calibration, judged: Sequence[SensorTrace], criteria: Criteria, checks: Sequence[Check]) -> tuple[str, ...]:
    """Return the values fitted to the record that judges, each of which changes the verdict within two of its standard errors."""
    problem, names_that_decide = run.problem, []
    assert problem is not None
    moved = [b.predicted - a.predicted for a, b in zip(run.blocks, judged, strict=True)]
    for local in run.local:
        for errors in (-2.0, 2.0):
            names = (local.name, f"{local.record}: {local.name}")
            fitted = np.array([run.fitted[u.name] + (errors * local.error if u.name in names else 0.0) for u in problem.unknowns])
            blocks = zip(problem.blocks(fitted), moved, strict=True) if np.isfinite(fitted).all() else ()
            others = judge_sensors(criteria, [_deviation(replace(b, predicted=b.predicted + by)) for b, by in blocks])
            if weigh([c.passed for c in others]) != weigh([c.passed for c in checks]):
                names_that_decide.append(local.name)
    return tuple(dict.fromkeys(names_that_decide))


def not_judged(calibration: Calibration, record: str, title: str = "") -> Verdict:
    """Return that values are not credible, so that the record was not opened for them."""
    return Verdict(calibration.stage, record, (), {}, (), None, title, standing=calibration.standing)


def _deviation(block: SensorTrace) -> Deviation:
    """Every reading of one sensor of a record, beside what the model says of it."""
    residuals = Residuals.equally_weighted(block.times, block.residuals)
    means = (float(block.measured.mean()), float(block.predicted.mean()))
    return Deviation(block.record, block.sensor, "transient", residuals, *means)


def compare(model: Model, record: Record, *, scenario: Scenario | None = None) -> Calibration:
    """Return measured and predicted readings of a record, with statistics per sensor; no value is changed.

    Parameters
    ----------
    model : Model           What the hardware is.
    record : Record         The log.
    scenario : Scenario     What the log does not say.

    Raises
    ------
    ThermidError   When the record does not fit the model.
    """
    request = Request(model, (record,), scenarios={"*": scenario} if scenario else {}, held_errors={}, fit_start=False)
    return fit(request)
