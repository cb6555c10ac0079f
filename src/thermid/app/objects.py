"""Results as JSON and the studio hold them: SI units beside those in which a person reads them, null where a thing does not exist."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from thermid.base.units import ICE_POINT
from thermid.campaign.stages import Campaign, RetunePlan, next_command
from thermid.fit.calibration import Calibration, Moves
from thermid.values.store import FittedValue


def answer(v: FittedValue, ranges: Mapping[str, float], estimate: FittedValue | None = None) -> dict[str, Any]:
    """Return a fitted value in its unit as a JSON object: value, error, random error, unit; `ranges` is stated range -> share of variance.

    An estimate that differs from the fit gives `value` and `error`; the fit is then in `fitted` and `fitted_error`.
    """
    out = {"value": v.in_unit, "error": v.shown(v.error), "random": v.shown(v.error_random), "unit": v.unit}
    if estimate is not None and estimate is not v:
        out |= {"value": estimate.in_unit, "error": v.shown(estimate.error), "fitted": v.in_unit, "fitted_error": v.shown(v.error)}
    return out | ({"ranges": dict(ranges)} if ranges else {})


def fit_object(fit: Calibration) -> dict[str, Any]:
    """Return what a fit found for the studio: values in the units of the sliders, and all else that its curves need [SI]."""
    unknowns = fit.problem.unknowns if fit.problem is not None else ()
    return {
        "values": {p: answer(v, fit.range_shares(p)) for p, v in fit.values.parameters.items()},
        "others": {u.name: u.to_value(fit.fitted[u.name]) for u in unknowns if u.kind != "parameter"},
        "sensors": {n: {"rmse": s.rmse, "bias": fit.sensor_bias(n)[0]} for n, s in fit.sensors.items()},
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
    fitted = {p: v for p, v in fit.values.items() if v.kind in ("parameter", "level")}
    return {
        "stage": fit.stage,
        "free": list(fitted),
        "values": {p: fit[p].value for p in fitted},
        "errors": {p: v.error_random for p, v in fitted.items()},
        "errors_total": {p: fit[p].error for p in fitted},
        "fitted": {p: {"value": v.value, "error": v.error} for p, v in fitted.items() if p in fit.expected},
        "units": {p: v.unit for p, v in fitted.items()},
        "shown": {p: answer(v, fit.range_shares(p), fit[p]) for p, v in fitted.items()},
        "sensors": {n: s.to_dict() for n, s in fit.sensors.items()},
        "records": {r: {n: s.to_dict() for n, s in sensors.items()} for r, sensors in fit.statistics.items()},
        "median_rmse_K": {n: fit.median_rmse(n) for n in fit.sensors},
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
        "watts": list(plan.watts),
        "before": dict(plan.before),
        "after": dict(plan.after),
    }
