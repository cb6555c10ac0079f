"""Validation: a calibrated model against a record that no fit has seen, by stated criteria; and a comparison that judges nothing.

A results folder remembers the verdicts on held-out records: one that failed before its model was fitted anew is no longer independent.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from thermid.base.errors import IdentificationError, refuse_unknown
from thermid.base.expression import amount
from thermid.base.files import FileKinds, write_text
from thermid.base.results import PlottedTrace, Result, Row
from thermid.base.sourced import VERDICTS, weigh
from thermid.base.toml_files import read_json
from thermid.base.units import counted, short
from thermid.campaign._judge.criteria import Check, Criteria, Deviation, Residuals, judge_sensors
from thermid.fit.calibration import FIRST, Calibration, Request, SensorStatistics, SensorTrace, fit
from thermid.measure.records import Record
from thermid.model.tree import UNJUDGED, Model, Standing
from thermid.prediction.bands import RecordPrediction, record_bands, record_request
from thermid.simulation.runs import Scenario

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
        write_text(folder / FILE, json.dumps([asdict(one) for one in (*looks, now)], indent=1), FileKinds.RESULTS_FILE)
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
        """What its record asks of its owner: exchanged sensors, a power in another unit, a sensor that moved since the fit."""
        missed = {c.sensor for c in self.missed}
        apart = {n: s.mean for n, s in self.statistics.items() if n in missed and abs(s.mean) > ONE_SIGN * s.rmse}
        moved = [
            f"{FIRST}{n} reads {short(abs(mean))} K {'above' if mean > 0.0 else 'below'} the prediction throughout. Does this sensor sit "
            "at another place than in the fitted records?"
            for n, mean in apart.items()
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
    prediction = fit(record_request(calibration, record, scenario, local, readings, amount(window, "s", "window")))
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
    bands, deciding = record_bands(calibration, prediction), _deciding(prediction, criteria, checks)
    standing = calibration.standing
    return Verdict(calibration.stage, record.name, checks, statistics, locally, prediction, title, (), standing, bands, deciding)


def _deciding(prediction: Calibration, criteria: Criteria, checks: Sequence[Check]) -> tuple[str, ...]:
    """Return the values fitted to the record that judges, each of which changes the verdict within two of its standard errors."""
    problem, names_that_decide = prediction.problem, []
    assert problem is not None
    for local in prediction.local:
        for errors in (-2.0, 2.0):
            names = (local.name, f"{local.record}: {local.name}")
            fitted = np.array([prediction.fitted[u.name] + (errors * local.error if u.name in names else 0.0) for u in problem.unknowns])
            others = judge_sensors(criteria, [_deviation(b) for b in problem.blocks(fitted)]) if np.isfinite(fitted).all() else ()
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
