"""Tables of a stage and of a campaign - what was fitted, sensors, verdicts, areas, origins - and what decides, for the top of a page."""

from __future__ import annotations

import math
import platform
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version

import numpy as np

from thermid.base.units import HALF_WIDTH_95, ICE_POINT, counted, from_si, si_unit, unit
from thermid.campaign.stages import Campaign, CampaignPrediction, Check, Verdict, metric
from thermid.fit.calibration import MOVED, Calibration
from thermid.measure.records import Record
from thermid.model.tree import Flat, Model, ParameterSet, ledger
from thermid.reporting._blocks.content import (
    DASH,
    SAME_AS_ABOVE,
    Cell,
    Head,
    Line,
    Table,
    capitalised,
    duration,
    group_cell,
    number,
    plain,
    pretty,
    rounded,
    signed,
    significant,
    verdict_cell,
)
from thermid.values.store import INPUT, FittedValue

Names = tuple[tuple[str, str], ...]
HTC_NAMES = ("effective_htc", "htc", "htc.coefficient")
HIGH_CORRELATION = 0.95
"""Correlation from which two parameters are hardly separable."""


def parameters(calibration: Calibration) -> Table:
    """Return what was fitted: before, after, random and total error, bounds, shift in standard errors, source and state."""
    table = calibration.given_model.parameter_table()
    rows: list[Line] = []
    for path, v in calibration.values.parameters.items():
        entry, random, best = table[path], v.shown(v.error_random), calibration.estimates[path]
        digits_of = random if best is v else v.shown(best.error)
        fitted = DASH if best is v else f"{significant(v.in_unit, v.shown(v.error))} ± {rounded(v.shown(v.error))}"
        source = entry.origin if entry.origin.startswith("stage ") else entry.parameter.source or "not stated"
        shift = (best.value - v.start) / best.error if best.error > 0 and math.isfinite(best.error) else math.nan
        rows.append(
            [
                Cell(path, entry.parameter.note),
                plain(v.converted(v.start)),
                Cell(significant(best.in_unit, digits_of), repr(best.in_unit), "main"),
                fitted,
                rounded(random),
                rounded(v.shown(best.error)),
                rounded(100 * best.relative),
                pretty(v.unit),
                bounds_text(v),
                f"{shift:+.1f}" if math.isfinite(shift) else DASH,
                Cell(source, entry.parameter.basis),
                _state(v),
            ]
        )
    return Table.of_rows(
        [
            Head("parameter"),
            Head("before", True),
            Head("after", True, "to quote; where the fit does not explain the readings, as expected if elements depart from their laws"),
            Head("fitted ± total", True, "what draws the curves, where that differs from the value to quote"),
            Head("± random", True, "standard error from the noise of the samples alone"),
            Head("± total", True, "standard error with the constant errors of sensors and powers"),
            Head("total, %", True),
            Head("unit"),
            Head("bounds", True),
            Head("shift / ±", True, "after less before, over the total standard error"),
            Head("source before"),
            Head("state"),
        ],
        rows,
    )


def bounds_text(v: FittedValue) -> str:
    """Return the bounds of a value in its unit as text; a dash where it has none."""
    low, high = (plain(v.converted(b)) if math.isfinite(b) else "" for b in v.bounds)
    return f"{low} .. {high}" if low and high else f"from {low}" if low else f"to {high}" if high else DASH


def at_bound(v: FittedValue) -> str:
    """Return at which bound a value ended, 'lower' or 'upper'; empty for inside."""
    for bound, side in zip(v.bounds, ("lower", "upper"), strict=True):
        if math.isfinite(bound) and abs(v.value - bound) <= max(1e-4 * abs(bound), 0.02 * v.error):
            return side
    return ""


def _state(v: FittedValue) -> Cell:
    """Return whether a value is free inside its bounds or ended at one."""
    if not math.isfinite(v.error):
        return Cell("not determined", "", "bad")
    if at_bound(v):
        return Cell(f"at its {at_bound(v)} bound", "its error is cut there", "bad")
    shared = f", shared by {1 + len(v.also)} instances" if v.also else ""
    return Cell(f"free, with prior{shared}" if v.prior else f"free{shared}", ", ".join(v.also))


def levels(campaign: Campaign) -> tuple[Table, Table]:
    """Return heat transfer coefficients by level, and all other parameters that any stage fitted: parts down, stages across.

    A part keeps its line whatever it is called in a larger model: the models' titles tell which part it is.
    """
    lines: list[tuple[Names, dict[str, tuple[float, FittedValue | None]]]] = []
    for stage in reversed(tuple(campaign)):
        calibration = campaign[stage]
        values = ParameterSet(calibration.model).evaluate({})
        fitted = calibration.values.assignments
        for path in values:
            names = tuple(_names(calibration.given_model, path))
            hits = [values_by_stage for keys, values_by_stage in lines if names[0] in keys]
            if not hits:
                lines.append((names, {}))
                hits = [lines[-1][1]]
            for values_by_stage in hits:
                values_by_stage[stage] = (float(values[path]), fitted.get(path))
    lines_by_kind = [
        (any(f".{names[0][1]}".endswith(f".{name}") for name in HTC_NAMES), names, values_by_stage) for names, values_by_stage in lines
    ]
    htc = [_level_row(names, values_by_stage, campaign) for is_htc, names, values_by_stage in lines_by_kind if is_htc]
    rest = [
        _level_row(names, values_by_stage, campaign)
        for is_htc, names, values_by_stage in lines_by_kind
        if not is_htc and any(v for _, v in values_by_stage.values())
    ]
    columns = [
        Head("part"),
        Head("parameter"),
        Head("unit"),
        *(
            Head(f"stage {stage}", True) if s.fair else Head(f"stage {stage} ({s.state})", True, s.line(stage))
            for stage, s in ((stage, campaign[stage].standing) for stage in campaign)
        ),
    ]
    how = "Bold: fitted at that stage, with its total standard error. Plain: fixed there. A dash: not in that model."
    return Table.of_rows(columns, htc, how), Table.of_rows(columns, rest, how)


def _names(model: Model, path: str) -> Iterator[tuple[str, str]]:
    """Yield title and rest of a path, for the model itself and every part that it passes."""
    yield model.title, path
    head, _, rest = path.partition(".")
    if rest and head in model.submodels:
        yield from _names(model.submodels[head].model, rest)


def _level_row(names: Names, values_by_stage: Mapping[str, tuple[float, FittedValue | None]], campaign: Campaign) -> list[Cell]:
    """Return the row of a value by stage: fitted with its standard error, held, or not there."""
    one = next((v for _, v in values_by_stage.values() if v), None)
    text = one.unit if one else "W/(m^2 K)"
    row = [Cell(names[-1][0]), Cell(names[0][1]), Cell(pretty(text))]
    for stage in campaign:
        value, fitted = values_by_stage.get(stage, (math.nan, None))
        shown = from_si(value, text)
        if fitted is None:
            row.append(Cell(number(shown), "held" if stage in values_by_stage else "", "soft"))
        else:
            error = fitted.error / float(unit(text).factor)
            row.append(Cell(f"{significant(shown, error)} ± {rounded(error)}", "fitted", "main"))
    return row


def sensors(calibration: Calibration) -> Table:
    """Return how the model meets each sensor, over all records of a stage."""
    accuracy = {o.sensor: o.accuracy for e in calibration.experiments for o in e.observations}
    rows: list[Line] = []
    for name, s in calibration.sensors.items():
        blocks = [b for b in calibration.blocks if b.sensor == name]
        value, error = calibration.sensor_bias(name)
        bias = f"{signed(value, 2)} ± {rounded(error)}" if error is not None else f"{signed(value, 2)} held" if value else DASH
        rows.append(
            [
                Cell(name, "", "main"),
                ", ".join(dict.fromkeys(b.node for b in blocks)),
                str(len(blocks)),
                str(s.samples),
                number(s.rmse),
                number(calibration.median_rmse(name)),
                signed(s.mean, 3),
                signed(s.largest, 3),
                bias,
                plain(accuracy.get(name) or math.nan),
                plain(blocks[0].noise),
                Cell("yes") if s.white else Cell(f"no ({s.lag_one:+.2f})", "", "warn"),
            ]
        )
    shares = "".join(f" {capitalised(str(share))}." for share in (*calibration.sensor_shares, *calibration.instrument_shares))
    return Table.of_rows(
        [
            Head("sensor"),
            Head("node", wrapped=True),
            Head("records", True),
            Head("samples", True),
            Head("RMSE, K", True),
            Head("median RMSE, K", True, "median over the records"),
            Head("mean, K", True, "mean of measured minus simulated"),
            Head("largest, K", True, "the largest residual by size, with its sign"),
            Head("bias, K", True, "constant error of the sensor: reading minus truth, fitted or fixed"),
            Head("stated ±, K", True, "standard deviation of the constant error, as stated for the sensor"),
            Head("noise, K", True, "standard deviation of a sample, the weight of the fit"),
            Head("white", False, "whether neighbouring residuals are uncorrelated; else their correlation"),
        ],
        rows,
        f"Residuals are measured minus simulated, without the sensor's constant error.{shares}",
    )


def instruments(calibration: Calibration) -> Table:
    """Return the constant errors that were found for logged boundaries and powers."""
    words = "Reading minus truth, as of compared sensors: positive for an instrument that reads high; of a power as a share of the reading."
    return Table.of_rows(
        [Head("logged channel"), Head("error", True), Head("± total", True), Head("unit")],
        [
            [
                name.removesuffix(" error"),
                significant(v.in_unit, v.shown(v.error)),
                rounded(v.shown(v.error)),
                "of the reading" if v.unit == "1" else pretty(v.unit),
            ]
            for name, v in calibration.values.items()
            if v.kind == INPUT
        ],
        words,
    )


def records(calibration: Calibration) -> Table:
    """Return the statistics of every record and sensor."""
    numeric = [Head(c, True) for c in ("samples", "RMSE, K", "mean, K", "largest, K", "lag-1")]
    return Table.of_rows(
        [Head("record"), Head("sensor"), *numeric, Head("white")],
        [
            [
                *(record, sensor, str(s.samples), number(s.rmse)),
                *(signed(s.mean, 3), signed(s.largest, 3), signed(s.lag_one, 2), "yes" if s.white else "no"),
            ]
            for record, sensors in calibration.statistics.items()
            for sensor, s in sensors.items()
        ],
    )


def locals_(calibration: Calibration) -> Table:
    """Return what was fitted for one record alone."""
    rows: list[Line] = []
    for i in calibration.local:
        value = i.value - ICE_POINT if i.unit == "degC" else i.value
        rows.append([i.record, i.name, significant(value, i.error), rounded(i.error), pretty(i.unit)])
    return Table.of_rows([Head("record"), Head("value"), Head("found", True), Head("± total", True), Head("unit")], rows)


def correlations(calibration: Calibration, most: int = 30) -> Table:
    """Return the strongest correlations, those marked where two parameters can hardly be separated."""
    ranked = sorted(calibration.correlations.items(), key=lambda item: -abs(item[1]))
    looks = [("hardly separable", "warn") if abs(c) > HIGH_CORRELATION else ("", "") for _, c in ranked]
    more = f"; not shown: {counted(len(ranked) - most, 'weaker one')}" if len(ranked) > most else ""
    caption = f"Those above 0.1{more}; marked above {HIGH_CORRELATION}."
    return Table.of_rows(
        [Head("first"), Head("second"), Head("correlation", True)],
        [[a, b, Cell(f"{c:+.2f}", *look)] for ((a, b), c), look in zip(ranked[:most], looks, strict=False)],
        caption,
    )


def areas(model: Model) -> Table:
    """Return the area ledger of a model: exposed + contact + gap = total for every surface."""
    numeric = [Head(f"{c}, cm²", True) for c in ("total", "exposed", "contact", "gap")]
    return Table.of_rows(
        [Head("surface"), *numeric, Head("taken by", wrapped=True)],
        [
            [
                line.surface,
                *(number(1e4 * a) for a in (line.total, line.exposed, line.contact, line.gap)),
                ", ".join(f"{joint} {number(1e4 * a)} cm²" for joint, a in line.joints.items()) or DASH,
            ]
            for line in ledger(model)
        ],
        "Exposed area convects and radiates; exposed + contact + gap = total.",
    )


def verdicts(campaign: Campaign, ranked: bool = False) -> Table:
    """Return every criterion of every verdict: found, limit, met or not, and what the verdict is conditional on.

    Parameters
    ----------
    ranked : bool   Whether what takes most of its limit stands first; else in the order of the campaign.
    """
    rows: list[Line] = []
    sizes: list[float] = []
    for v in campaign.verdicts:
        if v.passed is None:
            why = Cell("not judged", v.standing.line(v.model), "warn")
            rows.append([Cell(v.model, v.title, "main"), Cell(v.record, v.title), DASH, DASH, DASH, DASH, DASH, why, Cell("nothing")])
            sizes.append(math.inf)
        for k, c in enumerate(v.checks):
            named = k == 0 or ranked
            first = [Cell(v.model, v.title, "main"), Cell(v.record, v.title)] if named else [SAME_AS_ABOVE, SAME_AS_ABOVE]
            sizes.append(c.used)
            condition = Cell(", ".join(v.deciding), "fitted to this record, and decides", "warn") if v.conditional else Cell("nothing")
            if not v.unseen:
                condition = Cell("no longer independent", "the model failed a verdict on it before it was refitted", "bad")
            cells = [number(c.found), plain(c.limit), _outside(v, c)]
            rows.append([*first, c.sensor, c.title, *cells, verdict_cell(bool(c.passed)), condition])
    order = sorted(range(len(rows)), key=lambda k: -sizes[k]) if ranked else range(len(rows))
    return Table.of_rows(
        [
            Head("model"),
            Head("hold-out record"),
            Head("sensor"),
            Head("criterion"),
            Head("found, K", True),
            Head("limit, K", True),
            Head("outside", True, "samples beyond the limit, of all samples"),
            Head("result"),
            Head("conditional on", wrapped=True),
        ],
        [rows[k] for k in order],
        "What takes most of its limit first." if ranked else "",
    )


def _outside(verdict: Verdict, check: Check) -> str:
    """Return how many samples lie beyond the limit of a single error."""
    if not metric(check.criterion).of_single_readings:
        return DASH
    residuals = [b.residuals for b in verdict.blocks if b.sensor == check.sensor]
    beyond = sum(int(np.count_nonzero(np.abs(r) > check.limit)) for r in residuals)
    return f"{beyond} of {sum(r.size for r in residuals)}"


def _uses(campaign: Campaign) -> Iterator[tuple[str, str, str, bool, Record | None]]:
    """Yield record, checksum, what it was used for, whether it is synthetic, and the record itself where it is kept."""
    fits = [("fit", c) for c in campaign.stages.values()]
    judged = [("hold-out record, verdict on", v.prediction) for v in campaign.verdicts if v.prediction is not None]
    for kind, calibration in [*fits, *judged]:
        logs = {e.record.name: e.record for e in calibration.experiments}
        for name, sha in calibration.records.items():
            record = logs.get(name)
            yield name, sha, f"{kind} {calibration.stage}", record.origin.synthetic if record is not None else calibration.synthetic, record


def made_records(campaign: Campaign) -> tuple[tuple[str, ...], int]:
    """Return the names of the records that were made and not measured, and how many records there are."""
    every = {(name, sha): synthetic for name, sha, _, synthetic, _ in _uses(campaign)}
    return tuple(name for (name, _), synthetic in every.items() if synthetic), len(every)


def data(campaign: Campaign) -> list[Table]:
    """Return every record: what it was used for, file, checksum, whether it was measured; then what was done to its samples."""
    merged: dict[tuple[str, str], tuple[list[str], bool, Record | None]] = {}
    for name, sha, use, synthetic, record in _uses(campaign):
        uses, _, log = merged.setdefault((name, sha), ([], synthetic, record))
        if use not in uses:
            uses.append(use)
        merged[name, sha] = (uses, synthetic, log or record)
    columns = [
        Head("record"),
        Head("used for", wrapped=True),
        Head("kind"),
        Head("file", wrapped=True),
        Head("begins"),
        Head("duration", True),
        Head("samples", True),
        Head("SHA-256", False, "of the samples"),
    ]
    rows: list[Line] = []
    steps: dict[tuple[str, ...], list[str]] = {}
    for (name, sha), (uses, synthetic, record) in merged.items():
        kind = Cell("SYNTHETIC", "made, not measured", "bad") if synthetic else Cell("measured")
        file, begins, length, samples = DASH, DASH, DASH, DASH
        if record is not None:
            file, begins = record.origin.file, record.origin.start or DASH
            length, samples = duration(record.duration), str(record.times.size)
            steps.setdefault(tuple(record.steps), []).append(name)
        rows.append([Cell(name, "", "main"), ", ".join(uses), kind, file, begins, length, samples, Cell(sha[:12], sha, "code")])
    if all(cells[4] == DASH for cells in rows):
        columns, rows = [*columns[:4], *columns[5:]], [[*cells[:4], *cells[5:]] for cells in rows]
    tables = [Table.of_rows(columns, rows, "Hover over a checksum to see all of it.", "Data")]
    prepared: list[Line] = [[group_cell(_some(names), k), step] for of, names in steps.items() for k, step in enumerate(of)]
    how = "What was done to the samples; a record that is not listed stands as it was read."
    return (
        [*tables, Table.of_rows([Head("record"), Head("prepared by", wrapped=True)], prepared, how, "Preparation of the data")]
        if prepared
        else tables
    )


def models(campaign: Campaign) -> Table:
    """Return what each stage rests on: the model's identity and size, the effort, version and date, and the key of its result."""
    rows: list[Line] = []
    for stage, c in campaign.stages.items():
        flat, provenance = Flat.of_model(c.given_model), c.values.provenance
        identity, key = str(provenance.get("model", DASH)), campaign.keys.get(stage, "")
        sizes = [str(len(flat.nodes)), str(len(flat.conductors)), str(c.evaluations)]
        code = Cell(identity[:12], identity, "code")
        made_with = [str(provenance.get("version", DASH)), str(provenance.get("date", DASH))]
        rows.append([Cell(stage, "", "main"), c.given_model.title, code, *sizes, *made_with, Cell(key[:12] or DASH, key, "code")])
    return Table.of_rows(
        [
            Head("stage"),
            Head("model"),
            Head("identity", False, "hash of the model's content, independent of its formatting"),
            Head("nodes", True),
            Head("conductors", True),
            Head("evaluations", True),
            Head("thermid"),
            Head("date"),
            Head("result key", False, "hash of all inputs of the result"),
        ],
        rows,
    )


def versions() -> Table:
    """Return what this page was made with."""
    rows: list[Line] = [[package, _version(package)] for package in ("thermid", "numpy", "scipy")]
    rows += [["Python", platform.python_version()], ["page made", datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")]]
    return Table.of_rows([Head("what"), Head("version")], rows)


def _version(package: str) -> str:
    """Return the version of a package; a dash where it is not installed."""
    try:
        return version(package)
    except PackageNotFoundError:
        return DASH


def held(calibration: Calibration) -> Table:
    """Return every value of the fitted model: who set it, from what source, and which values it hides."""
    values = ParameterSet(calibration.model)
    numbers = values.evaluate({})
    rows: list[Line] = []
    for path, entry in values.table.items():
        literal = entry.parameter.expression.literal
        shown = plain(from_si(float(numbers[path]), literal.unit if literal else ""))
        text = literal.unit.text if literal else si_unit(values.dimension(path))
        hides = "; ".join(f"{value} ({origin})" for origin, value in reversed(entry.shadowed))
        written = entry.parameter.text if not literal else DASH
        look = "main" if path in calibration.values.assignments else ""
        cells = [entry.parameter.source or DASH, entry.origin, entry.parameter.basis or entry.parameter.note or DASH]
        rows.append([Cell(path, "", look), shown, pretty(text), written, *cells, Cell(hides or DASH, "", "" if hides else "soft")])
    return Table.of_rows(
        [
            Head("parameter"),
            Head("value", True),
            Head("unit"),
            Head("written as", wrapped=True),
            Head("source"),
            Head("set by"),
            Head("basis", wrapped=True),
            Head("hides", wrapped=True),
        ],
        rows,
        "The value of every parameter after the fit; bold if this stage fitted it.",
    )


def inputs(calibration: Calibration) -> Table:
    """Return every boundary, load and start of every record with its source, what is assumed first."""
    rows: list[Line] = []
    for r in calibration.inputs.rows:
        source = Cell(r.source, "not given", "warn") if r.source == "assumed" else Cell(r.source)
        words = ", ".join(w for w in (r.words, "fitted" if r.fitted and "fitted" not in r.words else "") if w)
        rows.append([source, r.kind, Cell(r.name, "", "main"), r.record, r.range, r.shown(r.mean), pretty(r.unit), words or DASH])
    return Table.of_rows(
        [
            Head("source"),
            Head("input"),
            Head("of"),
            Head("record"),
            Head("range", True),
            Head("mean", True),
            Head("unit"),
            Head("what", wrapped=True),
        ],
        rows,
        "Inputs of the fit and their sources.",
    )


LINES = 5
"""Remarks of each kind at the top; the rest stands below."""
MAX_KNOWN_HALF_WIDTH = 0.25
"""Relative half-width of an interval from which a value counts as hardly known."""


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


def glance(campaign: Campaign, places: Mapping[str, str], named: Sequence[CampaignPrediction] = ()) -> Glance:
    """Return what a reader needs before anything else.

    Parameters
    ----------
    campaign : Campaign     What was found.
    places : dict           Stage, 'verdicts' or 'predictions' -> its place on the page.
    named : sequence        The campaign's own predictions.
    """
    columns = (_unknown(campaign), _todo(campaign, named))
    unknown, todo = ([Remark(text, places.get(of, ""), of) for text, of in dict.fromkeys(lines)] for lines in columns)
    return Glance(_fitted(campaign), _cut(unknown), _cut(todo))


def interval(v: FittedValue) -> tuple[float, float]:
    """Return the ends of the 95 % interval of a fitted value; of one that was fitted by its logarithm the factor is symmetric. [SI]"""
    if v.log and v.value > 0 and math.isfinite(v.error):
        factor = math.exp(HALF_WIDTH_95 * v.error / v.value)
        return v.value / factor, v.value * factor
    return v.value - HALF_WIDTH_95 * v.error, v.value + HALF_WIDTH_95 * v.error


def _cut(remarks: list[Remark]) -> tuple[Remark, ...]:
    """Return the first remarks, the last of which counts those that are left out."""
    if len(remarks) <= LINES:
        return tuple(remarks)
    return (*remarks[: LINES - 1], Remark(f"And {len(remarks) - LINES + 1} more, listed with their stages."))


def _fits(campaign: Campaign) -> list[Calibration]:
    """Return all fits, the uppermost first."""
    return list(reversed(campaign.fits))


def _values(campaign: Campaign) -> Iterator[tuple[Calibration, FittedValue]]:
    """Yield the estimate of every fitted parameter with its fit, the uppermost stage first."""
    for c in _fits(campaign):
        for path in c.values.parameters:
            yield c, c.estimates[path]


def _fitted(campaign: Campaign) -> Table:
    """Return the table of the values of the uppermost fit with their 95 % intervals; it counts those of the stages below."""
    rows: list[Line] = []
    every = list(_values(campaign))
    shown = [(c, v) for c, v in every if c is every[0][0]]
    for c, v in shown:
        error = v.shown(v.error)
        ends = Cell("not determined", "", "bad")
        if math.isfinite(error):
            ends = Cell(" .. ".join(significant(v.converted(end), error) for end in interval(v)))
        rows.append([Cell(v.path, v.origin, "main"), c.stage, Cell(significant(v.in_unit, error), "", "main"), ends, pretty(v.unit)])
    if more := len(every) - len(shown):
        rows.append([Cell(f"and {counted(more, 'value')} of stages below: see the parameters by level", "", "soft wrap"), "", "", "", ""])
    return Table.of_rows(
        [
            Head("value"),
            Head("stage"),
            Head("found", True),
            Head("95 % interval", True),
            Head("unit"),
        ],
        rows,
        "Intervals include the constant errors of sensors and powers.",
        "Fitted values",
    )


def _twins(c: Calibration) -> list[tuple[str, str, float]]:
    """Return the pairs of parameters that the data can hardly separate, with their correlation."""
    return [
        (a, b, r) for (a, b), r in c.correlations.items() if abs(r) > HIGH_CORRELATION and not {a, b} & {f"sensor {s}" for s in c.sensors}
    ]


def _some(texts: Sequence[str], most: int = 3) -> str:
    """Return the first of some texts, and how many more there are."""
    return ", ".join(texts[:most]) + (f" and {len(texts) - most} more" if len(texts) > most else "")


def _unknown(campaign: Campaign) -> Iterator[tuple[str, str]]:
    """Yield what the data do not tell, each with its stage."""
    if not campaign.verdicts:
        yield "Its ability to predict: there is no hold-out record.", ""
    for v in campaign.verdicts:
        if v.conditional:
            yield f"{v.record} at {v.model}: values fitted to this record decide its verdict, {', '.join(v.deciding)}.", "verdicts"
    for c in _fits(campaign):
        for value in c.values.parameters.values():
            if not math.isfinite(value.error):
                yield f"{value.path}: the logs do not determine it.", c.stage
            elif at_bound(value):
                yield f"{value.path} ended at its {at_bound(value)} bound, where its standard error is cut.", c.stage
            elif not value.bounds[0] <= (quoted := c[value.path]).value <= value.bounds[1]:
                outside = f"{significant(quoted.in_unit, quoted.shown(quoted.error))} {pretty(value.unit)}, outside its bounds"
                yield f"{value.path} is expected at {outside} ({bounds_text(value)}): these or the structure are wrong.", c.stage
        widths = []  # half of the 95 % interval over the value, as it would be without bounds
        for value in (v for v in map(c.estimates.__getitem__, c.values.parameters) if v.value and math.isfinite(v.error)):
            low, high = interval(replace(value, error=max(value.error, value.uncut)))
            widths.append(((high - low) / 2 / abs(value.value), value.path))
        vague = sorted((pair for pair in widths if MAX_KNOWN_HALF_WIDTH < pair[0] < math.inf), reverse=True)
        if vague:
            yield f"Poorly determined (95 %): {_some([f'{path} ± {rounded(100 * half)} %' for half, path in vague])}.", c.stage
        twins = [f"{a} with {b}" for a, b, _ in _twins(c)]
        if twins:
            yield f"Better determined together than each alone: {_some(twins)}.", c.stage
    for c in _fits(campaign)[:1]:
        values = ParameterSet(c.model).table
        held = [p for p, e in values.items() if e.parameter.source == "assumed" and p not in c.values.assignments]
        if held:
            yield f"{counted(len(held), 'value')} of {c.given_model.title} stayed as the deck assumes, such as {held[0]}.", c.stage


def _todo(campaign: Campaign, named: Sequence[CampaignPrediction]) -> Iterator[tuple[str, str]]:
    """Yield what follows from it, each with its stage."""
    for c in _fits(campaign):
        if c.contradicted:
            yield f"Do not use {c.stage}: {_some(list(c.contradicted.values()))}. {c.blame}", c.stage
        elif not c.standing.usable and (c.standing.state, c.standing.stage) != ("failed", c.stage):  # what its own verdicts say follows
            yield f"Do not use {c.stage}: {c.standing.reason(c.stage)}.", c.stage
    if not campaign.verdicts:
        yield "Keep one record out of all fits and validate on it: [[verdicts]] in the campaign.", ""
    elif campaign.passed:
        yield _envelope(campaign), ""
    for v in campaign.verdicts:
        if v.missed and (worst := v.worst) is not None:
            missing = f"{worst.title} {rounded(worst.found)} K of {rounded(worst.limit)} K allowed"
            yield (
                (
                    f"Do not use {v.model} yet: {worst.sensor} in {v.record} exceeds a criterion, {missing}. Check where its residuals "
                    "begin."
                ),
                "verdicts",
            )
    for p in named:
        if p.within is False:
            yield f"Predicted for {p.head}. {_remedy(p)}", "predictions"
    for c in _fits(campaign):
        for m in c.moved.values:
            if m.verdict == MOVED:
                yield f"{m.path} differs significantly from the result of {m.stage}. {m.remedy}", c.stage
        for value in c.values.parameters.values():
            if at_bound(value):
                yield f"{value.path} ended at a bound. Widen its bounds, or check the power, area or position that it depends on.", c.stage
    misfits = [c for c in _fits(campaign) if not c.own.fair]  # residuals at the level of the noise may wander without lacking anything
    wanders = [(c.stage, [sensor for sensor, fit_of_sensor in c.sensors.items() if not fit_of_sensor.white]) for c in misfits]
    lines = [f"{stage} ({_some(sensors)})" for stage, sensors in wanders if sensors]
    if lines:
        yield f"Residuals are autocorrelated at {_some(lines)}, so the model lacks physics there. Run thermid criticise.", ""
    apart = [c.stage for c in _fits(campaign) if _twins(c) or any(not math.isfinite(v.error) for v in c.values.parameters.values())]
    if apart:
        yield (
            f"some values of {', '.join(reversed(apart))} cannot be separated well. td.design.next_test ranks tests that would do so.",
            apart[-1] if len(apart) == 1 else "",
        )
    for c in _fits(campaign):
        if c.warnings:
            first = re.split(r"(?<=[^.])(?:\. |\.$)", c.warnings[0], maxsplit=1)[0] + "."  # the dots of "a ... b" end no sentence
            count = counted(len(c.warnings), "warning")
            yield f"{count} of {c.stage}{'. The first' if len(c.warnings) > 1 else ''}: {first}", c.stage


def _remedy(p: CampaignPrediction) -> str:
    """Return what to do about a prediction beyond a limit: a narrower band where the run with the best values is inside, else hardware."""
    node, (low, high) = p.margins[0].node, p.margins[0].limits
    band = p.prediction.bands[node]
    if band.simulated.max() > high:
        return f"The run with the best values exceeds it too: lower the power, or improve the heat path from {node}."
    if band.simulated.min() < low:
        return f"The run with the best values falls below it too: heat {node}, or insulate it."
    cause, share = max(band.final.shares.items(), key=lambda item: item[1], default=("", 0.0))
    of = f": {100 * share:.0f} % of its variance comes from {cause} ({p.prediction.causes.get(cause, cause)})" if cause else ""
    return f"The run with the best values stays inside, so narrow the band{of}."


def _envelope(campaign: Campaign) -> str:
    """Return a sentence on where the model was seen to hold: the lowest and highest reading of the sensors in its verdicts. [degC]"""
    judged = [v.prediction for v in campaign.verdicts if v.prediction is not None]
    read = [o.measured for fit in judged for e in fit.experiments for o in e.observations if o.measured.size]
    if not read:
        return "Use it under the conditions of its verdicts."
    low, high = (float(f(np.concatenate(read))) - ICE_POINT for f in (np.min, np.max))
    return f"Use it in the range of its verdicts: sensors between {low:.0f} and {high:.0f} °C. Beyond it the model extrapolates."
