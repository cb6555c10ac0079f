"""What decides, for the top of a page: what was fitted with its intervals, what is not known, what to do next."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from thermid.campaign.stages import Campaign
from thermid.fit.calibration import BLAME, Calibration
from thermid.fit.uncertainty.moved import MOVED
from thermid.knowledge.values import FittedValue
from thermid.model.tree.tree import ParameterSet
from thermid.physics.constants import ICE_POINT
from thermid.reporting.blocks.content import Cell, Head, Line, Table, number, pretty, significant
from thermid.reporting.pages.tables import STRONG, at_bound

MOST, LINES = 8, 5
"""Fitted values, and remarks of each kind, at the top; the rest stands below."""
VAGUE = 0.25
"""Relative half-width of an interval from which a value counts as hardly known."""
NORMAL = 1.959964
"""95 % of a normal distribution lie within so many standard deviations."""


@dataclass(frozen=True)
class Remark:
    """What is said, and the place on the page where more of it stands with what that place is called; empty for none."""

    text: str
    place: str = ""
    called: str = ""


@dataclass(frozen=True)
class Glance:
    """The top of a page.

    Parameters
    ----------
    fitted : Table      Values with their 95 % intervals, the uppermost stage first.
    unknown : tuple     What is not known, each with its place on the page.
    next : tuple        What to do about it, each with its place on the page.
    """

    fitted: Table
    unknown: tuple[Remark, ...]
    next: tuple[Remark, ...]


def glance(campaign: Campaign, places: Mapping[str, str]) -> Glance:
    """Return what a reader needs before anything else.

    Parameters
    ----------
    campaign : Campaign     What was found.
    places : dict           Stage, or 'verdicts', -> its place on the page.
    """
    unknown, todo = ([Remark(text, places.get(of, ""), of) for text, of in dict.fromkeys(f(campaign))] for f in (_unknown, _todo))
    return Glance(_fitted(campaign), _cut(unknown), _cut(todo))


def tightest(campaign: Campaign) -> str:
    """Return which of the verdicts' checks is nearest to its limit, or furthest beyond, and how much of the limit it takes."""
    checks = [(c.found / c.limit, v.record, c) for v in campaign.verdicts for c in v.checks]
    if not checks:
        return "no criterion was judged"
    used, record, c = max(checks, key=lambda found: found[0])
    where = f"{'nearest to' if used <= 1.0 else 'furthest beyond'} its limit"
    return f"{where}: {c.sensor} in {record}, {c.title} {number(c.found, 2)} of {number(c.limit, 2)} K ({100 * used:.0f} %)"


def interval(v: FittedValue) -> tuple[float, float]:
    """Return the ends of the 95 % interval of a fitted value; of one that was fitted by its logarithm the factor is symmetric. [SI]"""
    if v.log and v.value > 0 and math.isfinite(v.error):
        factor = math.exp(NORMAL * v.error / v.value)
        return v.value / factor, v.value * factor
    return v.value - NORMAL * v.error, v.value + NORMAL * v.error


def _cut(remarks: list[Remark]) -> tuple[Remark, ...]:
    if len(remarks) <= LINES:
        return tuple(remarks)
    return (*remarks[: LINES - 1], Remark(f"And {len(remarks) - LINES + 1} more, each at its stage."))


def _fits(campaign: Campaign) -> list[Calibration]:
    """Return all fits, the uppermost first."""
    return list(reversed(campaign.fits))


def _values(campaign: Campaign) -> Iterator[tuple[Calibration, FittedValue]]:
    """Yield every fitted parameter with its fit, the uppermost stage first."""
    for c in _fits(campaign):
        for v in c.values.parameters.values():
            yield c, v


def _fitted(campaign: Campaign) -> Table:
    columns = [
        Head("value"),
        Head("stage"),
        Head("found", True),
        Head("95 % interval", True),
        Head("unit"),
    ]
    every = list(_values(campaign))
    rows: list[Line] = []
    for c, v in every[:MOST]:
        error = v.shown(v.error)
        ends = Cell("not determined", "", "bad")
        if math.isfinite(error):
            ends = Cell(" .. ".join(significant(v.converted(end), error) for end in interval(v)))
        rows.append([Cell(v.path, v.origin, "main"), c.stage, Cell(significant(v.in_unit, error), "", "main"), ends, pretty(v.unit)])
    more = f"The {MOST} uppermost of {len(every)}; all of them stand at their stages. " if len(every) > MOST else ""
    return Table.of(columns, rows, f"{more}Intervals hold the constant errors of sensors and powers.", "What was fitted")


def _twins(c: Calibration) -> list[tuple[str, str, float]]:
    """Return the pairs of parameters that the data hardly tell apart, with their correlation."""
    return [(a, b, r) for (a, b), r in c.correlations.items() if abs(r) > STRONG and not {a, b} & {f"sensor {s}" for s in c.sensors}]


def _half(v: FittedValue) -> float:
    """Return the half-width of a 95 % interval over its value. [-]"""
    low, high = interval(v)
    return (high - low) / 2 / abs(v.value) if v.value and math.isfinite(v.error) else math.inf


def _some(texts: Sequence[str], most: int = 3) -> str:
    """Return the first of some texts, and how many more there are."""
    return ", ".join(texts[:most]) + (f" and {len(texts) - most} more" if len(texts) > most else "")


def _unknown(campaign: Campaign) -> Iterator[tuple[str, str]]:
    """Yield what the data do not tell, each with its stage."""
    if not campaign.verdicts:
        yield "Whether it predicts: no record was held out.", ""
    for v in campaign.verdicts:
        if v.conditional:
            yield f"{v.record} at {v.model}: the verdict holds only for what was fitted to it, {', '.join(v.fitted_locally)}.", "verdicts"
    for c in _fits(campaign):
        for value in c.values.parameters.values():
            if not math.isfinite(value.error):
                yield f"{value.path}: the logs do not determine it.", c.stage
            elif at_bound(value):
                yield f"{value.path} ended at its {at_bound(value)} bound: its error is not meaningful.", c.stage
        known = [(_half(value), value.path) for value in c.values.parameters.values()]
        vague = sorted((pair for pair in known if VAGUE < pair[0] < math.inf), reverse=True)
        if vague:
            yield f"Hardly known (95 %): {_some([f'{path} ± {number(100 * half, 2)} %' for half, path in vague])}.", c.stage
        twins = [f"{a} with {b}" for a, b, _ in _twins(c)]
        if twins:
            yield f"Known together better than each alone: {_some(twins)}.", c.stage
    for c in _fits(campaign)[:1]:
        values = ParameterSet(c.fitted_model).table
        held = [p for p, e in values.items() if e.parameter.source == "assumed" and p not in c.values.assignments]
        if held:
            yield f"{len(held)} values of {c.model.title} are assumed and were not fitted here, such as {held[0]}.", c.stage


def _todo(campaign: Campaign) -> Iterator[tuple[str, str]]:
    """Yield what follows from it, each with its stage."""
    for c in _fits(campaign):
        if c.contradicted:
            yield f"Do not use {c.stage}: {_some(list(c.contradicted.values()))}. {BLAME}", c.stage
        elif not c.standing.usable and (c.standing.state, c.standing.stage) != ("failed", c.stage):  # what its own verdicts say follows
            yield f"Do not use {c.stage}: {c.standing.reason(c.stage)}.", c.stage
    if not campaign.verdicts:
        yield "Hold a record out and judge it: [[verdicts]] in the campaign.", ""
    elif campaign.passed:
        yield _envelope(campaign), ""
    for v in campaign.verdicts:
        missed = [c for c in v.checks if not c.passed]
        if missed:
            worst = max(missed, key=lambda c: c.found / c.limit)
            missing = f"{worst.title} {number(worst.found, 2)} K of {number(worst.limit, 2)} K allowed"
            yield f"Do not use {v.model} yet: {worst.sensor} in {v.record} misses, {missing}. See where its residuals begin.", "verdicts"
    for c in _fits(campaign):
        for m in c.moved.values:
            if m.verdict == MOVED:
                yield f"{m.path} moved from what {m.stage} found: look for what the part meets here and not alone.", c.stage
        for value in c.values.parameters.values():
            if at_bound(value):
                yield f"{value.path}: widen its bounds, or doubt the power, area or place that it stands for.", c.stage
    wanders = [(c.stage, [sensor for sensor, found in c.sensors.items() if not found.white]) for c in _fits(campaign)]
    told = [f"{stage} ({_some(sensors)})" for stage, sensors in wanders if sensors]
    if told:
        yield f"Residuals wander at {_some(told)}: something is missing there; td.criticise says what.", ""
    apart = [c.stage for c in _fits(campaign) if _twins(c) or any(not math.isfinite(v.error) for v in c.values.parameters.values())]
    if apart:
        yield (
            f"{', '.join(reversed(apart))}: td.next_test ranks the tests that would tell values apart.",
            apart[-1] if len(apart) == 1 else "",
        )


def _envelope(campaign: Campaign) -> str:
    """Return where the model was seen to hold."""
    judged = [v.prediction for v in campaign.verdicts if v.prediction is not None]
    read = [o.measured for fit in judged for e in fit.experiments for o in e.observations if o.measured.size]
    if not read:
        return "Use it for what it was judged on."
    low, high = (float(f(np.concatenate(read))) - ICE_POINT for f in (np.min, np.max))
    return f"Use it where it was judged: sensors between {low:.0f} and {high:.0f} °C. Beyond that it extrapolates."
