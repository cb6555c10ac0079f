"""Where everything in a report came from: data with checksums, versions, models, and which value hides which."""

from __future__ import annotations

import platform
from collections.abc import Iterator
from datetime import UTC, datetime
from fractions import Fraction
from importlib.metadata import PackageNotFoundError, version

from thermid.campaign.stages import Campaign
from thermid.fit.calibration import Calibration
from thermid.measure import Record
from thermid.model.tree.flat import flatten
from thermid.model.tree.tree import ParameterSet
from thermid.reporting.blocks.cells import DASH, Cell, Head, Line, Table, duration, plain, pretty
from thermid.units import NAMES, Dimension, unit


def _uses(campaign: Campaign) -> Iterator[tuple[str, str, str, bool, Record | None]]:
    """Yield record, checksum, what it was used for, whether it is synthetic, and the record itself where it is kept."""
    fits = [("fit", c) for c in campaign.stages.values()]
    judged = [("held out, verdict on", v.prediction) for v in campaign.verdicts if v.prediction is not None]
    for kind, calibration in [*fits, *judged]:
        kept = {e.record.name: e.record for e in calibration.experiments}
        for name, sha in calibration.records.items():
            record = kept.get(name)
            yield name, sha, f"{kind} {calibration.stage}", record.origin.synthetic if record else calibration.synthetic, record


def made_records(campaign: Campaign) -> tuple[tuple[str, ...], int]:
    """Return the names of the records that were made and not measured, and how many records there are."""
    every = {(name, sha): synthetic for name, sha, _, synthetic, _ in _uses(campaign)}
    return tuple(name for (name, _), synthetic in every.items() if synthetic), len(every)


def data(campaign: Campaign) -> Table:
    """Return every record: what it was used for, file, checksum, whether it was measured, and what was done to its samples."""
    merged: dict[tuple[str, str], tuple[list[str], bool, Record | None]] = {}
    for name, sha, use, synthetic, record in _uses(campaign):
        uses, _, known = merged.setdefault((name, sha), ([], synthetic, record))
        if use not in uses:
            uses.append(use)
        merged[name, sha] = (uses, synthetic, known or record)
    columns = [
        Head("record"),
        Head("used for", wrapped=True),
        Head("kind"),
        Head("file"),
        Head("begins"),
        Head("duration", True),
        Head("samples", True),
        Head("SHA-256 of the samples"),
        Head("prepared by", wrapped=True),
    ]
    rows: list[Line] = []
    for (name, sha), (uses, synthetic, record) in merged.items():
        kind = Cell("SYNTHETIC", "made, not measured", "bad") if synthetic else Cell("measured")
        file, begins, length, samples, steps = DASH, DASH, DASH, DASH, DASH
        if record is not None:
            file, begins = record.origin.file, record.origin.start or DASH
            length, samples = duration(record.duration), str(record.times.size)
            steps = "; ".join(record.steps) or "nothing"
        rows.append([Cell(name, "", "main"), ", ".join(uses), kind, file, begins, length, samples, Cell(sha[:12], sha, "code"), steps])
    return Table.of(columns, rows, "Point at a checksum to see all of it.")


def models(campaign: Campaign) -> Table:
    """Return what each stage rests on: the model's identity and size, the effort, version and date, and the key of its result."""
    columns = [
        Head("stage"),
        Head("model"),
        Head("identity", False, "hash of what the model means, not of how it is written"),
        Head("nodes", True),
        Head("conductors", True),
        Head("evaluations", True),
        Head("thermid"),
        Head("date"),
        Head("result key", False, "hash of everything that the result depends on"),
    ]
    rows: list[Line] = []
    for stage, c in campaign.stages.items():
        flat, made = flatten(c.model), c.values.provenance
        identity, key = str(made.get("model", DASH)), campaign.keys.get(stage, "")
        sizes = [str(len(flat.nodes)), str(len(flat.conductors)), str(c.evaluations)]
        code = Cell(identity[:12], identity, "code")
        made_with = [str(made.get("version", DASH)), str(made.get("date", DASH))]
        rows.append([Cell(stage, "", "main"), c.model.title, code, *sizes, *made_with, Cell(key[:12] or DASH, key, "code")])
    return Table.of(columns, rows)


def versions() -> Table:
    """Return what this page was made with."""
    rows: list[Line] = [[package, _version(package)] for package in ("thermid", "numpy", "scipy")]
    rows += [["Python", platform.python_version()], ["page made", datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")]]
    return Table.of([Head("what"), Head("version")], rows)


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return DASH


def held(calibration: Calibration) -> Table:
    """Return every value of the fitted model: who set it, from what source, and which values it hides."""
    values = ParameterSet(calibration.fitted_model)
    numbers = values.evaluate({})
    columns = [Head("parameter"), Head("value", True), Head("unit"), Head("written as", wrapped=True)]
    columns += [Head("source"), Head("set by"), Head("basis", wrapped=True), Head("hides", wrapped=True)]
    rows: list[Line] = []
    for path, entry in values.table.items():
        literal = entry.parameter.expression.literal
        offset, factor = (float(literal.unit.offset), float(literal.unit.factor)) if literal else (0.0, 1.0)
        shown = plain((float(numbers[path]) - offset) / factor, 6)
        text = literal.unit.text if literal else _unit_text(values.dimension(path))
        hides = "; ".join(f"{value} ({origin})" for origin, value in reversed(entry.shadowed))
        written = entry.parameter.text if not literal else DASH
        look = "main" if path in calibration.values.assignments else ""
        cells = [entry.parameter.source or DASH, entry.origin, entry.parameter.basis or entry.parameter.note or DASH]
        rows.append([Cell(path, "", look), shown, pretty(text), written, *cells, Cell(hides or DASH, "", "" if hides else "soft")])
    return Table.of(columns, rows, "The value that holds for every parameter after the fit; strong where this stage fitted it.")


def inputs(calibration: Calibration) -> Table:
    """Return every boundary, load and start of every record with its source, what is assumed first."""
    columns = [
        Head("source"),
        Head("input"),
        Head("of"),
        Head("record"),
        Head("range", True),
        Head("mean", True),
    ]
    columns += [Head("unit"), Head("what", wrapped=True)]
    rows: list[Line] = []
    for r in calibration.inputs.rows:
        source = Cell(r.source, "nobody gave it", "warn") if r.source == "assumed" else Cell(r.source)
        words = ", ".join(w for w in (r.words, "fitted" if r.fitted and "fitted" not in r.words else "") if w)
        rows.append([source, r.kind, Cell(r.name, "", "main"), r.record, r.range, r.shown(r.mean), pretty(r.unit), words or DASH])
    return Table.of(columns, rows, "What the fit was driven by, and where each of it comes from.")


def _unit_text(dimension: Dimension) -> str:
    """Return the SI unit of a dimension: its usual name, or base units."""
    for text in NAMES:
        if unit(text).dimension == dimension:
            return text
    return " ".join(f"{b}^{e}" if e != Fraction(1) else b for b, e in zip(("m", "kg", "s", "A", "K"), dimension, strict=True) if e) or "1"
