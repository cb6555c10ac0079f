"""Views of results: the numbers that text, JSON, page and studio print, worked out once.

A view holds numbers in the unit in which a person reads them; JSON holds SI units beside them, temperatures also in Celsius, and null
where a thing does not exist.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from thermid.campaign.stages import Campaign, next_command
from thermid.campaign.studies import RetunePlan
from thermid.fit.calibration import Calibration, Moves
from thermid.physics.constants import ICE_POINT
from thermid.values.fitted import FittedValue


@dataclass(frozen=True)
class ShownValue:
    """A fitted value in its unit.

    Parameters
    ----------
    value, random, error, start : float     With its standard error by the noise alone and in all.
    unit : str
    bounds : tuple                          Infinite where open.
    ranges : dict                           Stated range of a fixed input -> its part of the variance. [-]
    """

    value: float
    random: float
    error: float
    unit: str
    start: float
    bounds: tuple[float, float]
    ranges: Mapping[str, float] = field(default_factory=dict)

    def answer(self) -> dict[str, Any]:
        """Return value and errors as JSON and the studio say them."""
        ranges = {"ranges": dict(self.ranges)} if self.ranges else {}
        return {"value": self.value, "error": self.error, "random": self.random, "unit": self.unit, **ranges}


@dataclass(frozen=True)
class SensorFigures:
    """How a model meets a sensor over all records: residuals are measured less simulated, its constant error taken off. [K]"""

    samples: int
    rmse: float
    median_rmse: float
    mean: float
    largest: float
    bias: float
    bias_error: float | None
    lag_one: float
    white: bool


@dataclass(frozen=True)
class CalibrationView:
    """A stage as every answer prints it."""

    values: Mapping[str, ShownValue]
    sensors: Mapping[str, SensorFigures]


def quantity(v: FittedValue, ranges: Mapping[str, float] | None = None) -> ShownValue:
    """Return a fitted value in its unit, with the part of its variance that each stated range makes."""
    return ShownValue(
        v.in_unit,
        v.shown(v.error_random),
        v.shown(v.error),
        v.unit,
        v.converted(v.start),
        (v.converted(v.bounds[0]), v.converted(v.bounds[1])),
        ranges or {},
    )


def view(fit: Calibration) -> CalibrationView:
    """Return the figures of a stage: what was fitted, and how each sensor is met."""
    sensors = {}
    for name, s in fit.sensors.items():
        fitted = fit.values.sensors.get(name)
        value, error = (s.bias, None) if fitted is None else (fitted.value, fitted.error)
        sensors[name] = SensorFigures(s.samples, s.rmse, fit.median_rmse(name), s.mean, s.largest, value, error, s.lag_one, s.white)
    return CalibrationView(
        {p: quantity(v, fit.range_shares(p)) for p, v in fit.values.items() if v.kind in ("parameter", "level")}, sensors
    )


def fit_object(fit: Calibration) -> dict[str, Any]:
    """Return what a fit found for the studio: values in the units of the sliders, and all else that its curves need [SI]."""
    shown = view(fit)
    unknowns = fit.problem.unknowns if fit.problem is not None else ()
    return {
        "values": {p: shown.values[p].answer() for p in fit.values.parameters},
        "others": {u.name: u.to_value(fit.fitted[u.name]) for u in unknowns if u.kind != "parameter"},
        "sensors": {n: {"rmse": s.rmse, "bias": s.bias} for n, s in shown.sensors.items()},
        "warnings": list(fit.warnings),
        "clocks": fit.clocks,
        "evaluations": fit.evaluations,
        "text": str(fit),
        "standing": fit.standing.to_dict(fit.stage),
    }


def swap_object(plan: RetunePlan) -> dict[str, Any]:
    """Return for the studio what a swap costs, with the predictions before and after it [degC]."""
    sensors = {s: [plan.before[s] - ICE_POINT, plan.after[s] - ICE_POINT] for s in plan.before if s in plan.after}
    return {**retune_object(plan), "standing": plan.standing.to_dict(), "sensors": sensors, "text": str(plan)}


def calibration_object(fit: Calibration) -> dict[str, Any]:
    """Return the object of one stage."""
    shown = view(fit)
    fitted = {p: fit.values[p] for p in shown.values}
    return {
        "stage": fit.stage,
        "free": list(fitted),
        "values": {p: v.value for p, v in fitted.items()},
        "errors": {p: v.error_random for p, v in fitted.items()},
        "errors_total": {p: v.error for p, v in fitted.items()},
        "expected": {p: {"value": x, "error": error} for p, (x, error) in fit.expected.items()},
        "units": {p: v.unit for p, v in fitted.items()},
        "shown": {p: v.answer() for p, v in shown.values.items()},
        "sensors": {n: s.to_dict() for n, s in fit.sensors.items()},
        "records": {r: {n: s.to_dict() for n, s in sensors.items()} for r, sensors in fit.statistics.items()},
        "median_rmse_K": {n: s.median_rmse for n, s in shown.sensors.items()},
        "local": [_local(i) for i in fit.local],
        "moved": _moved(fit.moved),
        "reduced_chi_square": fit.reduced_chi_square,
        "synthetic": fit.synthetic,
        "standing": fit.standing.to_dict(fit.stage),
        "contradicted": dict(fit.contradicted),
        "warnings": list(fit.warnings),
        "inputs": fit.inputs.to_dict(),
    }


def _local(i: Any) -> dict[str, Any]:
    """Return the value of one record as JSON holds it."""
    out = {"record": i.record, "name": i.name, "value": i.value, "error": i.error}
    return out | ({"value_C": i.value - ICE_POINT} if i.unit == "degC" else {})


def _moved(moves: Moves) -> dict[str, Any]:
    """Return as JSON what the logs of a stage say of values of the stages below."""
    values = {
        m.path: {
            "stage": m.stage,
            "part": m.part,
            "below": m.below,
            "alone": m.alone,
            "here": m.here,
            "deviations": m.deviations,
            "chance": m.chance,
            "detectable": m.detectable,
            "verdict": m.verdict,
        }
        for m in moves.values
    }
    groups = [
        {
            "name": g.name,
            "parameters": list(g.paths),
            "chi_square": g.chi_square,
            "directions": g.directions,
            "chance": g.chance,
            "verdict": g.verdict,
        }
        for g in moves.groups
    ]
    return {"values": values, "groups": groups}


def campaign_standing(campaign: Campaign) -> dict[str, Any]:
    """Return the standing of a campaign as JSON holds it."""
    return {**campaign.standing.to_dict(), "because": campaign.standing.reason(link="stage")}


def campaign_object(campaign: Campaign, values: list[str]) -> dict[str, Any]:
    """Return the object of ``thermid calibrate --json``."""
    return {
        "title": campaign.title,
        "standing": campaign_standing(campaign),
        "stages": [{**calibration_object(fit), **_advice(campaign, name)} for name, fit in campaign.stages.items()],
        **({"joint": calibration_object(campaign.joint)} if campaign.joint is not None else {}),
        "verdicts": [v.to_dict() for v in campaign.verdicts],
        "passed": campaign.passed,
        "values_files": values,
    }


def _advice(campaign: Campaign, stage: str) -> dict[str, Any]:
    """Return the mistakes that would explain a stage's misfit, and the next command to try; empty where there is none."""
    mistakes = campaign.mistakes[stage]
    return {"mistakes": mistakes.to_dict(), "next": next_command(campaign.file, campaign.stages[stage], mistakes)}


def retune_object(plan: RetunePlan) -> dict[str, Any]:
    """Return the plan of a replacement."""
    return {
        "part": plan.part,
        "old": plan.old,
        "new": plan.new,
        "assumes": list(plan.assumes),
        "dropped": [{"path": d.path, "text": d.text, "origin": d.origin, "why": d.why} for d in plan.replacement.dropped],
        "kept": list(plan.replacement.kept),
        "untied": list(plan.replacement.untied),
        "starts": [
            {"path": x.path, "text": x.text, "log_sd": x.log_sd, "origin": x.origin, "twins": list(x.twins)}
            for x in plan.replacement.starts
        ],
        "freed": list(plan.freed),
        "touched": [
            {"stage": t.stage, "path": t.path, "through": list(t.through), "kelvin": t.kelvin, "change": t.change, "held": t.held}
            for t in plan.touched
        ],
        "stages": [
            {
                "name": s.name,
                "of": s.of,
                "action": s.action,
                "why": s.why,
                "free": list(s.free),
                "records": list(s.records),
                "before": s.identity[0],
                "after": s.identity[1],
            }
            for s in plan.stages
        ],
        "tests": list(plan.tests),
        "kept_tests": list(plan.kept_tests),
        "neighbours": {n: {"exposed_before": a, "exposed_after": b, "change": dt} for n, (a, b, dt) in plan.neighbours.items()},
        "watts": list(plan.watts),
        "logged": plan.logged,
        "before": dict(plan.before),
        "as_logged": dict(plan.as_logged),
        "after": dict(plan.after),
    }
