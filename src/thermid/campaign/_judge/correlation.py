"""Readings beside a simulation: deviations of every sensor, settled and moving apart, judged by several sets of criteria at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from thermid.base.errors import IdentificationError, NameNotFoundError, RecordError, look_up, quoted, refuse_unknown
from thermid.base.results import VERDICTS, Result, Row, weigh
from thermid.base.units import ICE_POINT, Array, Bools, amount
from thermid.campaign._judge.verdict import CRITERIA, Check, Criteria, Deviation, Residuals, judge
from thermid.fit.calibration import Calibration
from thermid.measure.records import RULES, Record, gap_from, usual_step
from thermid.model.tree import UNJUDGED, Standing

DRIFT = RULES["1 K/h"]
"""What a stretch that is named steady is held to."""
Window = tuple[float, float]
ENDS = 2.0
"""Usual steps by which readings may begin after a settled stretch does, or end before it. [-]"""


@dataclass(frozen=True, eq=False)
class Overlay:
    """Readings of one sensor and what a simulation says in their place, at the same times.

    Parameters
    ----------
    case, sensor : str          The test, and the channel.
    node : str                  Where it sits in the model; empty where only two logs are compared.
    times : array (times,)      [s]
    measured, simulated : array (times,)    [K]
    accuracy : float            Standard deviation of the sensor's constant error; 0 where nobody stated one. [K]
    noise : float               Standard deviation of one reading. [K]
    """

    case: str
    sensor: str
    node: str
    times: Array
    measured: Array
    simulated: Array
    accuracy: float = 0.0
    noise: float = 0.0

    @property
    def residuals(self) -> Array:
        """Measured less simulated (times,). [K]"""
        return self.measured - self.simulated


def overlays(fit: Calibration, case: str = "") -> tuple[Overlay, ...]:
    """Return the readings of a fit, or of `compare`, beside what its model says."""
    noted = {(e.record.name, o.sensor): o for e in fit.experiments for o in e.observations}
    out = []
    for b in fit.blocks:
        o = noted[b.record, b.sensor]
        errors = (float(o.accuracy or 0.0), float(o.noise or 0.0))
        out.append(Overlay(case or b.record, b.sensor, b.node, b.times, b.measured, b.predicted, *errors))
    return tuple(out)


def paired(measured: Record, simulated: Record, case: str = "") -> tuple[Overlay, ...]:
    """Return the channels that two logs have in common, the second at the times of the first.

    Raises
    ------
    RecordError   When they share no channel, or the simulation has no numbers where there are readings.
    """
    common = [n for n in measured.channels if n in simulated.channels]
    if not common:
        names = ", ".join(simulated.channels)
        raise RecordError(
            f"'{measured.name}' and '{simulated.name}' have no column name in common; the second has {names}. Name the columns of the "
            "simulation like the sensors.",
            "two logs",
            code="record.not-overlapping",
        )
    out = []
    for name in common:
        channel, other = measured[name], simulated[name]
        times, run = measured.times[channel.valid], simulated.times[other.valid]
        _refuse_blank(name, times, simulated.times, other.valid)
        at_readings = np.interp(times, run, other.values[other.valid])
        accuracy, noise = float(channel.accuracy or 0.0), float(channel.noise or 0.0)
        out.append(Overlay(case or measured.name, name, "", times, channel.values[channel.valid], at_readings, accuracy, noise))
    return tuple(out)


def _refuse_blank(name: str, times: Array, rows: Array, valid: Bools) -> None:
    """Refuse readings (times,) at times at which the simulated column (rows,) has no number: nothing can be compared with them.

    Blank rows between two numbers are passed over where these are no further apart than samples of a log without gaps.
    """
    run, places, where = rows[valid], np.flatnonzero(valid), "two logs"
    if not times.size or not run.size:
        raise RecordError(
            f"'{name}' has no {'simulated number' if times.size else 'reading'} at all. Remove the column.",
            where,
            code="record.not-overlapping",
        )
    if times[0] < run[0] - 1e-9 or times[-1] > run[-1] + 1e-9:
        raise RecordError(
            f"the simulated numbers of '{name}' run from {run[0]:g} s to {run[-1]:g} s, its readings from {times[0]:g} s to "
            f"{times[-1]:g} s. Cut the readings or simulate longer.",
            where,
            code="record.not-overlapping",
        )
    gaps = np.flatnonzero((np.diff(places) > 1) & (np.diff(run) >= gap_from(run)))
    for a, b in zip(run[gaps], run[gaps + 1], strict=True):
        if ((times > a + 1e-9) & (times < b - 1e-9)).any():
            raise RecordError(
                f"the simulation has no numbers for '{name}' between {a:g} s and {b:g} s, but the log has readings there. Mask them, "
                "or simulate this time.",
                where,
                code="record.not-overlapping",
            )


@dataclass(frozen=True)
class Exclusions:
    """Sensors that do not count, each with its reason, and how large a part of all may be left out.

    Parameters
    ----------
    reasons : dict      Sensor -> why.
    cap : float         Largest part of all sensors; the project's number, none is assumed. [-]
    """

    reasons: Mapping[str, str] = field(default_factory=dict)
    cap: float = 0.0

    def check(self, sensors: Sequence[str]) -> None:
        """Refuse an exclusion without a reason, of a sensor that is not there, or of too many.

        Raises
        ------
        IdentificationError   Which, and how many may be left out.
        """
        for sensor, reason in self.reasons.items():
            refuse_unknown([sensor], sensors, "exclusions", "'{}' is excluded, but is not a sensor here.", IdentificationError)
            if not reason.strip():
                raise IdentificationError(
                    f"'{sensor}' is excluded without a reason. State what is wrong with it.", "exclusions", code="verdict.criteria"
                )
        if len(self.reasons) > self.cap * len(sensors) + 1e-9:
            raise IdentificationError(
                f"{len(self.reasons)} of {len(sensors)} sensors are excluded, the project allows {100 * self.cap:g} %. "
                "A model that meets its criteria only without these sensors does not meet them. Exclude fewer sensors.",
                "exclusions",
                code="verdict.criteria",
            )


@dataclass(frozen=True, eq=False)
class Correlation(Result):
    """Readings beside a simulation.

    Parameters
    ----------
    title : str
    overlays : tuple of Overlay         Per case and sensor.
    deviations : tuple of Deviation     Per case, sensor and kind.
    gates : tuple of Check              Every criterion of every set.
    exclusions : Exclusions
    windows : dict                      Case -> its settled stretches. [s]
    standing : Standing                 Of the values that the simulation rests on; unjudged where only its log is known.
    """

    title: str
    overlays: tuple[Overlay, ...]
    deviations: tuple[Deviation, ...]
    gates: tuple[Check, ...]
    exclusions: Exclusions
    windows: Mapping[str, Sequence[Window]]
    standing: Standing = UNJUDGED

    @property
    def failed(self) -> tuple[Check, ...]:
        """The gates that are not met."""
        return tuple(g for g in self.gates if g.passed is False)

    def passed(self, criteria: str) -> bool | None:
        """Return whether every gate of a set is met; None where one of them may not decide and none failed.

        Raises
        ------
        NameNotFoundError   When no such set was asked for.
        """
        refuse_unknown([criteria], {g.criteria for g in self.gates}, self.title, "no result for the criteria '{}'.", NameNotFoundError)
        return weigh([g.passed for g in self.gates if g.criteria == criteria])

    @property
    def verdicts(self) -> dict[str, bool | None]:
        """Set of criteria -> whether it is met."""
        return {name: self.passed(name) for name in dict.fromkeys(g.criteria for g in self.gates)}

    @property
    def remarks(self) -> tuple[str, ...]:
        """A remark for every settled stretch in which a sensor drifts faster than `DRIFT`, beyond its scatter; the fastest is named."""
        out = []
        for case, window in ((c, w) for c, stretches in self.windows.items() for w in stretches):
            drifts = {}
            for o in (o for o in self.overlays if o.case == case and o.sensor not in self.exclusions.reasons):
                inside = _inside(o, window)
                if inside.sum() > 2:
                    (rate, last), spread = np.polyfit(o.times[inside] - window[1], o.measured[inside] - ICE_POINT, 1, cov="unscaled")
                    scatter = o.measured[inside] - ICE_POINT - np.polyval((rate, last), o.times[inside] - window[1])
                    if abs(rate) - 2.0 * float(np.std(scatter) * np.sqrt(spread[0, 0])) > DRIFT.rate:
                        drifts[o.sensor] = (float(rate), float(last))
            if drifts:
                sensor, (rate, last) = max(drifts.items(), key=lambda item: abs(item[1][0]))
                ends = f"{last + rate * (window[0] - window[1]):.1f} to {last:.1f} degC, {3600 * rate:+.2g} K/h"
                more = f", and {len(drifts) - 1} more drift" if len(drifts) > 1 else ""
                out.append(
                    f"{case}, {window[0] / 3600:.4g} .. {window[1] / 3600:.4g} h is not steady: '{sensor}' goes from {ends}{more}. "
                    f"Steady is {DRIFT}. Name a stretch at whose end the unit has settled, or judge it as transient."
                )
        return tuple(out)

    def to_dict(self) -> dict[str, Any]:
        """Return verdicts, gates, deviations and remarks as plain numbers and texts."""
        keys = {"criteria": "criteria", "kind": "kind", "case": "case", "name": "criterion", "mark": "mark", "passed": "passed"}
        keys |= {"worst": "sensor", "outside": "outside", "found_K": "found", "limit_K": "limit"}
        gates = [{key: getattr(g, name) for key, name in keys.items()} for g in self.gates]
        sizes = ("mean", "spread", "largest", "rmse")
        sensors = [
            {k: getattr(d, k) for k in ("sensor", "case", "kind", "samples", "excluded")} | {f"{k}_K": d[k] for k in sizes}
            for d in self.deviations
        ]
        judged = {"verdicts": self.verdicts, "gates": gates, "sensors": sensors, "remarks": list(self.remarks)}
        return {"standing": self.standing.to_dict(), **judged}

    def __str__(self) -> str:
        """Return verdicts and the deviations that they rest on as text."""
        lines = [self.title]
        for name, passed in self.verdicts.items():
            lines.append(f"  {name}: {VERDICTS[passed]}")
            lines += [f"    {g}" for g in self.gates if g.criteria == name]
        return self.standing.over("\n".join([*lines, *(f"  remark: {r}" for r in self.remarks), *(f"  {d}" for d in self.deviations)]))

    def _as_rows(self) -> list[Row]:
        """Return every sensor of every case with its deviations. [K]"""
        sizes = ("mean", "spread", "largest", "rmse")
        return [{"sensor": d.sensor, "case": d.case, "kind": d.kind, **{f"{k}_K": d[k] for k in sizes}} for d in self.deviations]


def correlate(
    readings: Sequence[Overlay] | Calibration | tuple[Record, Record],
    criteria: Sequence[str | Criteria] = ("ECSS",),
    *,
    steady: Mapping[str, Sequence[Window]] | None = None,
    weights: Mapping[str, float] | None = None,
    exclusions: Exclusions | None = None,
    title: str = "correlation",
) -> Correlation:
    """Return how far readings lie from a simulation, and the verdict by every named set of criteria.

    Parameters
    ----------
    readings : overlays, Calibration or two of Record   Readings with what is simulated in their place; the result of `compare`; or a
                            measured and a simulated log, whose columns of one name are compared.
    criteria : sequence     Names of `CRITERIA`, or sets of the project.
    steady : dict           Case -> settled stretches, (begin, end) each: numbers in s or texts.
    weights : dict          Sensor -> its weight in the means over sensors; 1 by default. [-]
    exclusions : Exclusions Sensors that do not count.
    title : str             What it is about.

    Raises
    ------
    IdentificationError   When a criterion has no data, or readings for a part of a settled stretch only; when a weight or an exclusion
                          names no sensor, or too many sensors are excluded.
    NameNotFoundError     When there is no such set of criteria.
    """
    standing = UNJUDGED
    if isinstance(readings, Calibration):
        pairs, standing = overlays(readings), readings.model.standing
    elif isinstance(readings, list | tuple) and len(readings) == 2 and isinstance(readings[0], Record) and isinstance(readings[1], Record):
        pairs = paired(readings[0], readings[1])
    else:
        pairs = tuple(o for o in readings if isinstance(o, Overlay)) if isinstance(readings, list | tuple) else ()
    if not pairs:
        raise IdentificationError("the log has no readings to compare with.", title, code="record.nothing-there")
    sensors = list(dict.fromkeys(o.sensor for o in pairs))
    left_out = exclusions or Exclusions()
    left_out.check(sensors)
    for sensor, weight in (weights or {}).items():
        if sensor not in sensors or not amount(weight, "1", f"{title}, weights, {sensor}") > 0:
            raise IdentificationError(
                f"'{sensor}' has weight {weight}. Give a sensor a weight above zero.", title, code="value.outside-range"
            )
    windows = {case: tuple(_window(w, f"{title}, steady, {case}") for w in stretches) for case, stretches in (steady or {}).items()}
    unread = "steady periods are given for '{}', which has no log."
    refuse_unknown(windows, [o.case for o in pairs], title, unread, IdentificationError)
    deviations = []
    for o in pairs:
        weight, reason = (weights or {}).get(o.sensor, 1.0), left_out.reasons.get(o.sensor, "")
        read = [w for w in windows.get(o.case, ()) if not reason or _inside(o, w).any()]
        deviations += [_deviation(o, "steady", w, weight, reason) for w in read]
        deviations.append(_deviation(o, "transient", (float(o.times[0]), float(o.times[-1])), weight, reason))
    sets = [_named(c) for c in criteria]
    gates = [g for c in sets for g in judge(c, deviations, title)]
    return Correlation(title, pairs, tuple(deviations), tuple(gates), left_out, windows, standing)


def _window(written: Any, where: str) -> Window:
    """Return the two ends of a steady period. [s]

    Raises
    ------
    IdentificationError   When it is no pair.
    UnitError             When an end is no time.
    """
    if not isinstance(written, tuple | list) or len(written) != 2:
        text = f"a steady period is a pair such as ('50 [min]', '60 [min]'), not {written!r:.60}."
        raise IdentificationError(text, where, code="value.wrong-kind")
    return amount(written[0], "s", where), amount(written[1], "s", where)


def _named(criteria: str | Criteria) -> Criteria:
    """Return criteria given as such or by the name of a set."""
    if isinstance(criteria, Criteria):
        return criteria
    return look_up(criteria, CRITERIA, f"no criteria '{{}}'; there are {quoted(list(CRITERIA))}.", "criteria")


def _deviation(o: Overlay, kind: str, window: Window, weight: float, reason: str) -> Deviation:
    """Return the deviation, prediction less reading, of a sensor in a window of time [s].

    Raises
    ------
    IdentificationError   When the window holds no reading, or the readings leave a part of a steady window uncovered without a `reason`.
    """
    inside = _inside(o, window)
    if not inside.any():
        raise IdentificationError(
            f"the steady period from {window[0]:g} s to {window[1]:g} s holds no reading of '{o.sensor}' in '{o.case}'. Name another "
            "period, or exclude the sensor and state why.",
            o.case,
            code="record.nothing-there",
        )
    if kind == "steady" and not reason:
        # refuse a settled stretch for whose first or last part a sensor has no readings: what is not read does not agree
        times = o.times[inside]
        slack = ENDS * (usual_step(o.times) if o.times.size > 1 else 0.0) + 1e-9
        if times[0] > window[0] + slack or times[-1] < window[1] - slack:
            raise IdentificationError(
                f"the steady period from {window[0]:g} s to {window[1]:g} s has readings of '{o.sensor}' in '{o.case}' from "
                f"{times[0]:g} s to {times[-1]:g} s only. Name a period that it covers, or exclude the sensor and state why.",
                o.case,
                code="record.nothing-there",
            )
    case = o.case if kind == "transient" else f"{o.case}, {window[0] / 3600:.4g} .. {window[1] / 3600:.4g} h"
    residuals = Residuals.equally_weighted(o.times[inside], o.residuals[inside])
    means = (float(o.measured[inside].mean()), float(o.simulated[inside].mean()))
    return Deviation(case, o.sensor, kind, residuals, *means, o.accuracy, weight, reason)


def _inside(o: Overlay, window: Window) -> Bools:
    """Return which readings lie in a window (readings,), its ends included."""
    return np.asarray((o.times >= window[0] - 1e-9) & (o.times <= window[1] + 1e-9))
