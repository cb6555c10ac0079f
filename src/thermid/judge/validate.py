"""`validate`: a calibrated model against a record that no fit has seen, with stated criteria, and a verdict."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from thermid.arguments import takes_objects
from thermid.errors import IdentificationError, nearest
from thermid.fit.calibrate import fit
from thermid.fit.calibration import Calibration
from thermid.fit.problem.request import LocalSpec, Reading, Request
from thermid.fit.problem.residuals import Block
from thermid.fit.problem.sensor_parts import as_found
from thermid.fit.problem.statistics import SensorStatistics
from thermid.judge.looks import RecordedLook
from thermid.measure import Record
from thermid.model.laws.signal import literal
from thermid.model.parts.standing import UNJUDGED, Standing
from thermid.simulation.scenarios.scenario import Scenario
from thermid.units import counted

LIMITS = ("rmse", "max_error", "mean_error")


@dataclass(frozen=True)
class Criteria:
    """What a model must meet at every sensor; a text with unit each.

    Parameters
    ----------
    rmse : str          Largest root mean square of measured less predicted. [K]
    max_error : str     Largest single error. [K]
    mean_error : str    Largest mean error, by size. [K]
    sensors : dict      Sensor -> table of the same, in place of the above.
    """

    rmse: str = ""
    max_error: str = ""
    mean_error: str = ""
    sensors: Mapping[str, Mapping[str, str]] | None = None

    @classmethod
    @takes_objects
    def read(cls, table: Mapping[str, Any], where: str) -> Criteria:
        """Return criteria from a table of a campaign."""
        _known(table, cls.__dataclass_fields__, where)
        for sensor, own in table.get("sensors", {}).items():
            if not isinstance(own, Mapping):
                raise IdentificationError("the criteria of a sensor are a table such as { rmse = '1 [K]' }.", f"{where}.sensors.{sensor}")
            _known(own, LIMITS, f"{where}.sensors.{sensor}")
        return cls(**table)

    def limits(self, sensor: str) -> dict[str, float]:
        """Return criterion -> limit for a sensor. [K]

        Raises
        ------
        IdentificationError   When nothing is asked of it.
        """
        own = {k: getattr(self, k) for k in LIMITS} | dict((self.sensors or {}).get(sensor, {}))
        limits = {k: literal(v, "K", f"criteria.{k}") for k, v in own.items() if v}
        if not limits:
            raise IdentificationError(
                f"no criterion is given for '{sensor}'. A verdict needs at least one limit: rmse, max_error or mean_error."
            )
        if any(not math.isfinite(v) or v <= 0 for v in limits.values()):
            raise IdentificationError("a limit must be above zero.", "criteria")
        return limits


def _known(given: Mapping[str, Any], known: Iterable[str], where: str) -> None:
    for key in given:
        if key not in known:
            raise IdentificationError(f"there is no criterion '{key}'.{nearest(key, known)}", where)


@dataclass(frozen=True)
class Check:
    """One criterion at one sensor."""

    sensor: str
    criterion: str
    found: float
    limit: float

    @property
    def passed(self) -> bool:
        """Whether what was found is within the limit."""
        return self.found <= self.limit


@dataclass(frozen=True, eq=False)
class Verdict:
    """Whether a model is good enough for its intended use, on data that no fit has seen.

    Parameters
    ----------
    model : str                     The stage whose values were used.
    record : str                    The record.
    checks : tuple of Check
    statistics : dict               Sensor -> SensorStatistics.
    fitted_locally : tuple of str   What was fitted to this very record; the verdict is then conditional on it.
    prediction : Calibration        Measured and predicted readings; None where it was not judged.
    title : str                     What it is about.
    failed_before : tuple of RecordedLook   Failed verdicts on this record by other values, of which the results folder knows.
    standing : Standing             Of the values that were judged, before the verdict.
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

    @property
    def passed(self) -> bool | None:
        """Whether every criterion is met; None where the values were not judged, because they are not credible."""
        return all(c.passed for c in self.checks) if self.prediction is not None else None

    @property
    def blocks(self) -> Sequence[Block]:
        """Measured and predicted readings; none where it was not judged."""
        return self.prediction.blocks if self.prediction is not None else ()

    @property
    def unseen(self) -> bool:
        """Whether nobody can have learnt from this record: no failed verdict on it came before a new fit."""
        return not self.failed_before

    @property
    def conditional(self) -> bool:
        """Whether anything was fitted to the record that it judges."""
        return bool(self.fitted_locally)

    def __str__(self) -> str:
        """Return the verdict as text, criterion by criterion."""
        about = f" ({self.title})" if self.title else ""
        if self.passed is None:
            return f"{self.model} on {self.record}{about}: NOT JUDGED; the record stays unopened. {self.standing.line(self.model)}"
        word = "PASSED" if self.passed else "FAILED"
        condition = f", conditional on {', '.join(self.fitted_locally)} fitted to this record" if self.conditional else ""
        lines = [f"{self.model} on {self.record}{about}: {word}{condition}"]
        if self.failed_before:
            first = self.failed_before[0]
            lines.append(
                f"  no longer unseen: {counted(len(self.failed_before), 'failed verdict')} on it since "
                f"{first.date}, and a new fit since; what passes now may have been made to. Judge on another record."
            )
        for c in self.checks:
            lines.append(
                f"  {c.sensor}: {c.criterion.replace('_', ' ')} {c.found:.3g} K, limit {c.limit:.3g} K: {'met' if c.passed else 'NOT met'}"
            )
        return "\n".join(lines)


@takes_objects
def validate(
    calibration: Calibration,
    record: Record,
    criteria: Criteria,
    *,
    scenario: Scenario | None = None,
    local: Mapping[str, Any] | None = None,
    readings: Mapping[str, Any] | None = None,
    window: float = 0.0,
    title: str = "",
) -> Verdict:
    """Return the verdict on a calibrated model from a record that no stage has used.

    Parameters
    ----------
    calibration : Calibration   The fit; its values and its instruments' constant errors are held.
    record : Record             The held-out log.
    criteria : Criteria         Limits.
    scenario : Scenario         What the log does not say.
    local : dict                Values fitted to this record, as in `calibrate`; they make the verdict conditional.
    readings : dict             Boundary or ``initial.<node>`` -> channel whose first reading stands there, or ``{channel, offset}``.
    window : float              First readings are medians over this time. [s]
    title : str                 What the verdict is about, where several judge one record.

    Raises
    ------
    IdentificationError   When the record was used by a fit, whatever was cut from it since.

    Notes
    -----
    Values that are not credible, or rest on such, are not judged: the verdict says so, and the record is not looked at.
    """
    if not calibration.standing.judgeable:
        return not_judged(calibration, record.name, title)
    user = calibration.seen.get(record.origin.sha256)
    if user is not None:
        raise IdentificationError(f"record '{record.name}' was used by {user}; a validation needs data that no fit has seen.")
    specs = {k: LocalSpec.read(v, f"local.{k}") for k, v in (local or {}).items()}
    request = Request(
        calibration.fitted_model,
        (as_found(record, calibration.values, calibration.bias),),
        scenarios={"*": scenario} if scenario else {},
        local=specs,
        held_bias=calibration.bias,
        held_errors=calibration.instrument_errors,
        window=window,
        name=calibration.stage,
        fit_start=False,
        readings={n: Reading.read(r, f"readings.{n}") for n, r in (readings or {}).items()},
    )
    prediction = fit(request)
    statistics = prediction.statistics[record.name]
    for sensor in criteria.sensors or {}:
        if sensor not in statistics:
            raise IdentificationError(
                f"criteria are given for '{sensor}', which is no sensor of {record.name}.{nearest(sensor, statistics)}"
            )
    checks = []
    for sensor, s in statistics.items():
        found = {"rmse": s.rmse, "max_error": abs(s.largest), "mean_error": abs(s.mean)}
        checks += [Check(sensor, k, found[k], limit) for k, limit in criteria.limits(sensor).items()]
    locally = tuple(dict.fromkeys(i.name for i in prediction.local))
    return Verdict(calibration.stage, record.name, tuple(checks), statistics, locally, prediction, title, standing=calibration.standing)


def not_judged(calibration: Calibration, record: str, title: str = "") -> Verdict:
    """Return that values are not credible, so that the record was not opened for them."""
    return Verdict(calibration.stage, record, (), {}, (), None, title, standing=calibration.standing)
