"""Tables of a stage and of a campaign: parameters, coefficients by level, sensors, verdicts, areas."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from thermid.identify.calibration import Calibration
from thermid.identify.stages import Campaign
from thermid.identify.validate import Check, Verdict
from thermid.identify.values import FittedValue
from thermid.model.areas import ledger
from thermid.model.model import Model
from thermid.model.resolve import parameter_table
from thermid.physics.constants import ICE_POINT
from thermid.reporting.cells import DASH, Cell, Column, Table, absolute, number, pretty, significant

__all__ = ["HTC_NAMES", "areas", "coefficients", "correlations", "locals_", "parameters", "records", "sensors", "verdicts"]

HTC_NAMES = ("effective_htc", "htc", "htc.coefficient")
STRONG = 0.95
"""Correlation from which two parameters are hardly told apart."""


def parameters(calibration: Calibration, stages: tuple[str, ...] = ()) -> Table:
    """Return what was fitted: before, after, random and total error, bounds, shift in standard errors, source and state.

    Parameters
    ----------
    calibration : Calibration   The fit.
    stages : tuple of str       Names of the campaign's stages, so that a value from one of them is told from a caller's.
    """
    columns = [
        Column("parameter"),
        Column("before", True),
        Column("after", True),
        Column("± random", True, "standard error from the noise of the samples alone"),
        Column("± total", True, "standard error with the constant errors of sensors and powers"),
        Column("total, %", True),
        Column("unit"),
        Column("bounds", True),
        Column("shift / ±", True, "after less before, over the total standard error"),
        Column("source before"),
        Column("state"),
    ]
    table = parameter_table(calibration.model)
    rows = []
    for path, v in calibration.values.parameters.items():
        entry = table[path]
        source = f"stage {entry.origin}" if entry.origin in stages else entry.parameter.source or "not stated"
        after, error = v.in_unit, v.shown(v.error)
        share = 100 * v.error / abs(v.value) if v.value else math.inf
        shift = (v.value - v.start) / v.error if v.error > 0 and math.isfinite(v.error) else math.nan
        rows.append(
            [
                Cell(path, entry.parameter.note),
                number(absolute(v, v.start), 5),
                Cell(significant(after, v.shown(v.error_random)), repr(after), "main"),
                number(v.shown(v.error_random), 2),
                number(error, 2),
                number(share, 2),
                pretty(v.unit),
                _bounds(v),
                f"{shift:+.1f}" if math.isfinite(shift) else DASH,
                Cell(source, entry.parameter.basis),
                _state(v),
            ]
        )
    return Table.of(columns, rows)


def _bounds(v: FittedValue) -> str:
    low, high = (number(absolute(v, b), 4) if math.isfinite(b) else "" for b in v.bounds)
    return f"{low} .. {high}" if low and high else f"from {low}" if low else f"to {high}" if high else DASH


def _state(v: FittedValue) -> Cell:
    """Return whether a value is free inside its bounds or ended at one."""
    for bound, side in zip(v.bounds, ("lower", "upper"), strict=True):
        if math.isfinite(bound) and abs(v.value - bound) <= max(1e-4 * abs(bound), 0.02 * v.error):
            return Cell(f"at its {side} bound", "its error is not meaningful", "bad")
    if not math.isfinite(v.error):
        return Cell("not determined", "", "bad")
    return Cell("free")


def coefficients(campaign: Campaign) -> Table:
    """Return every heat transfer coefficient: parts down, stages across; a part keeps its line whatever it is called in a larger model."""
    found = [row for stage in reversed(tuple(campaign)) for row in _coefficients_of(campaign, stage)]
    lines: list[tuple[tuple[tuple[str, str], ...], dict[str, Cell]]] = []
    for stage, names, cell in found:
        hits = [cells for keys, cells in lines if names[0] in keys]
        if not hits:
            lines.append((names, {}))
            hits = [lines[-1][1]]
        for cells in hits:
            cells[stage] = cell
    columns = [Column("part"), Column("coefficient"), *(Column(stage, True) for stage in campaign)]
    rows = [[Cell(keys[-1][0]), Cell(keys[0][1]), *(cells.get(s, Cell(DASH)) for s in campaign)] for keys, cells in lines]
    return Table.of(columns, rows, "In W/(m² K). Strong: fitted at that stage, with its total standard error. Plain: held there. A dash: not in that model.")


def _coefficients_of(campaign: Campaign, stage: str) -> Iterator[tuple[str, tuple[tuple[str, str], ...], Cell]]:
    """Yield stage, the names of a coefficient at every depth, and its cell."""
    calibration = campaign[stage]
    known = parameter_table(calibration.model)
    for field in HTC_NAMES:
        for part, values in campaign.table(field).items():
            path = f"{part}.{field}" if f"{part}.{field}" in known else field
            if stage in values and path in known:
                fitted = calibration.values.parameters.get(path)
                cell = Cell(number(values[stage], 4), "held", "soft")
                if fitted is not None:
                    cell = Cell(f"{significant(fitted.value, fitted.error)} ± {number(fitted.error, 2)}", "fitted", "main")
                yield stage, tuple(_names(calibration.model, path)), cell


def _names(model: Model, path: str) -> Iterator[tuple[str, str]]:
    """Yield title and rest of a path, for the model itself and every part that it passes."""
    yield model.title, path
    head, _, rest = path.partition(".")
    if rest and head in model.submodels:
        yield from _names(model.submodels[head].model, rest)


def sensors(calibration: Calibration) -> Table:
    """Return how the model meets each sensor, over all records of a stage."""
    columns = [
        Column("sensor"),
        Column("node"),
        Column("records", True),
        Column("samples", True),
        Column("RMSE, K", True),
        Column("median RMSE, K", True, "median over the records"),
        Column("mean, K", True, "mean of measured less simulated"),
        Column("largest, K", True, "the largest residual by size, with its sign"),
        Column("bias, K", True, "constant error of the sensor: reading less truth, as found or held"),
        Column("stated ±, K", True, "standard deviation of the constant error, as stated for the sensor"),
        Column("noise, K", True, "standard deviation of a sample, the weight of the fit"),
        Column("lag-1", True, "autocorrelation of neighbouring residuals"),
        Column("white"),
    ]
    accuracy = {o.sensor: o.accuracy for e in calibration.experiments for o in e.observations}
    rows = []
    for name, s in calibration.sensors.items():
        blocks = [b for b in calibration.blocks if b.sensor == name]
        bias = calibration.values.sensors.get(name)
        found = f"{bias.value:+.2f} ± {number(bias.error, 2)}" if bias else f"{s.bias:+.2f} held" if s.bias else DASH
        rows.append(
            [
                Cell(name, "", "main"),
                ", ".join(dict.fromkeys(b.node for b in blocks)),
                str(len(blocks)),
                str(s.samples),
                number(s.rmse, 3),
                number(calibration.median_rmse(name), 3),
                f"{s.mean:+.3f}",
                f"{s.largest:+.3f}",
                found,
                number(accuracy.get(name) or math.nan, 2),
                number(blocks[0].noise, 2),
                f"{s.lag_one:+.2f}",
                Cell("yes" if s.white else "no", "", "" if s.white else "warn"),
            ]
        )
    return Table.of(columns, rows, "Residuals are measured less simulated, the sensor's constant error taken off.")


def records(calibration: Calibration) -> Table:
    """Return the statistics of every record and sensor."""
    columns = [Column("record"), Column("sensor"), *(Column(c, True) for c in ("samples", "RMSE, K", "mean, K", "largest, K", "lag-1")), Column("white")]
    rows = [
        [record, sensor, str(s.samples), number(s.rmse, 3), f"{s.mean:+.3f}", f"{s.largest:+.3f}", f"{s.lag_one:+.2f}", "yes" if s.white else "no"]
        for record, found in calibration.statistics.items()
        for sensor, s in found.items()
    ]
    return Table.of(columns, rows)


def locals_(calibration: Calibration) -> Table:
    """Return what was fitted for one record alone."""
    rows = []
    for i in calibration.local:
        value = i.value - ICE_POINT if i.unit == "degC" else i.value
        rows.append([i.record, i.name, significant(value, i.error), number(i.error, 2), pretty(i.unit)])
    return Table.of([Column("record"), Column("value"), Column("found", True), Column("± total", True), Column("unit")], rows)


def correlations(calibration: Calibration, most: int = 30) -> Table:
    """Return the strongest correlations, those that hardly tell two parameters apart marked."""
    ranked = sorted(calibration.correlations.items(), key=lambda item: -abs(item[1]))
    rows = [[a, b, Cell(f"{c:+.2f}", "hardly told apart" if abs(c) > STRONG else "", "warn" if abs(c) > STRONG else "")] for (a, b), c in ranked[:most]]
    more = f"; {len(ranked) - most} weaker ones are left out" if len(ranked) > most else ""
    return Table.of([Column("first"), Column("second"), Column("correlation", True)], rows, f"Those above 0.1{more}; marked above {STRONG}.")


def areas(model: Model) -> Table:
    """Return the area ledger of a model: exposed + contact + gap = total for every surface."""
    columns = [Column("surface"), *(Column(f"{c}, cm²", True) for c in ("total", "exposed", "contact", "gap")), Column("taken by")]
    rows = [
        [
            line.surface,
            *(number(1e4 * a, 4) for a in (line.total, line.exposed, line.contact, line.gap)),
            ", ".join(f"{joint} {number(1e4 * a, 4)} cm²" for joint, a in line.joints.items()) or DASH,
        ]
        for line in ledger(model)
    ]
    return Table.of(columns, rows, "Exposed area convects and radiates; exposed + contact + gap = total.")


def verdicts(campaign: Campaign) -> Table:
    """Return every criterion of every verdict: found, limit, met or not, and what the verdict is conditional on."""
    columns = [
        Column("model"),
        Column("held-out record"),
        Column("sensor"),
        Column("criterion"),
        Column("found, K", True),
        Column("limit, K", True),
        Column("outside", True, "samples beyond the limit, of all samples"),
        Column("result"),
        Column("conditional on"),
    ]
    rows = []
    for v in campaign.verdicts:
        for k, c in enumerate(v.checks):
            first = [Cell(v.model, v.title, "main"), Cell(v.record, v.title)] if k == 0 else [Cell("", "", "same"), Cell("", "", "same")]
            result = Cell("✓ met", "", "good") if c.passed else Cell("✗ not met", "", "bad")
            condition = Cell(", ".join(v.fitted_locally), "fitted to this very record", "warn") if v.conditional else Cell("nothing")
            rows.append([*first, c.sensor, _criterion(c.criterion), number(c.found, 3), number(c.limit, 3), _outside(v, c), result, condition])
    return Table.of(columns, rows)


def _criterion(name: str) -> str:
    return {"rmse": "RMSE", "max_error": "largest error", "mean_error": "mean error"}.get(name, name)


def _outside(verdict: Verdict, check: Check) -> str:
    """Return how many samples lie beyond the limit of a single error."""
    if check.criterion != "max_error":
        return DASH
    residuals = [b.residuals for b in verdict.prediction.blocks if b.sensor == check.sensor]
    beyond = sum(int(np.count_nonzero(np.abs(r) > check.limit)) for r in residuals)
    return f"{beyond} of {sum(r.size for r in residuals)}"
