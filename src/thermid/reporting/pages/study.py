"""`study_report`: a study as one self-contained page - its four steps, its parts, what its author adds, and what was found."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from urllib.parse import quote
from xml.sax.saxutils import escape

from thermid.arguments import takes_objects
from thermid.campaign.methodology import Study
from thermid.campaign.stages import Campaign
from thermid.judge.metrics import metric
from thermid.model.parts.parameter import Parameter
from thermid.model.tree.model import Model
from thermid.physics.constants import ICE_POINT
from thermid.reporting.blocks.content import (
    DASH,
    Cell,
    Facts,
    Head,
    Heading,
    Line,
    Notes,
    PageBlock,
    Section,
    Table,
    Words,
    folded,
    number,
    plain,
    pretty,
    signed,
)
from thermid.reporting.blocks.extras import write_page
from thermid.reporting.pages import tables
from thermid.reporting.pages.tables import glance, tightest


@takes_objects
def study_report(
    study: Study,
    campaign: Campaign,
    *,
    to: str | os.PathLike[str],
    sections: Sequence[Section] = (),
    outcome: Sequence[PageBlock] = (),
    watermark: str = "",
) -> Path:
    """Write a study as one HTML page and return its path. The page loads nothing and runs no script but its own.

    Parameters
    ----------
    study : Study           What it is about and how it is done.
    campaign : Campaign     What was found.
    to : path               The file to write; its folder is made where it is missing.
    sections : sequence     What its author adds, between the parts and the log.
    outcome : sequence      What stands below the verdicts' summary.
    watermark : str         Words behind everything, and on a banner; for what must not be taken for a result.

    Raises
    ------
    MissingExtraError   When jinja2 is not installed.
    """
    made, of = tables.made_records(campaign)
    text = f"{len(made)} of {of} records were made, not measured: what rests on them says nothing about real hardware." if made else ""
    banners = [(watermark.upper() or "SYNTHETIC DATA", " ".join(t for t in (study.note, text) if t))] if watermark or made else []
    shown = [Section.of("steps", "The four steps", steps(study)), _parts_section(study), *sections, _record_section(study, campaign)]
    failed = [v for v in campaign.verdicts if not v.passed]
    return write_page(
        "study.html.jinja",
        to,
        title=study.title,
        opening=[t for t in (study.subject, f"Intended use: {study.use}.", f"After: {study.document}." if study.document else "") if t],
        watermark=watermark,
        headline="",
        tile=tile(watermark),
        banners=banners,
        failed=len(failed),
        judged=len(campaign.verdicts),
        summary=f"on records that no fit has seen; {tightest(campaign)}" if campaign.verdicts else "no record was held out",
        outcome=outcome,
        sections=shown,
        seen=glance(campaign, {}),
    )


def tile(words: str) -> str:
    """Return a tile of slanted words as the address of an image, readable on light and on dark."""
    width = 40 + 11 * len(words)
    svg = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{width * 3 // 5}"><text x="50%" y="50%" text-anchor="middle" '
        f'transform="rotate(-24 {width // 2} {width * 3 // 10})" font-family="sans-serif" font-size="17" font-weight="600" '
        f'fill="#8a6f5a" fill-opacity=".13">{escape(words)}</text></svg>'
    )
    return f"data:image/svg+xml,{quote(svg)}"


def steps(study: Study) -> list[PageBlock]:
    """Return knowledge and use, box colours, set-ups and procedure as they stand on record."""
    options = study.options
    theory = (("solver", study.solver), ("tolerance", f"{options.tolerance:g} K"), ("relative", f"{options.relative:g} of the range seen"))
    rows: list[Line] = [
        [Cell(str(k), "", "main"), a.name, _state(a.state), ", ".join(a.stages) or a.note or DASH] for k, a in enumerate(study.actions, 1)
    ]
    actions = Table.of([Head("no."), Head("action", wrapped=True), Head("state"), Head("stages", wrapped=True)], rows)
    return [
        Heading("1  Knowledge and intended use"),
        Facts((("physical items", str(len(study.components))), ("model of the whole", study.model.title))),
        *(Words(fact) for fact in study.facts),
        Heading("2  Box colour"),
        Words(study.reason),
        Facts((("the whole", study.part_boxes[""]),)),
        folded("Box colours part by part", [_boxes(study)], f"{len(study.part_boxes)} parts"),
        Heading("3  Theoretical and experimental set-up"),
        Facts(theory),
        *(Words(text) for text in (*study.theory, *study.experiment)),
        _instruments(study),
        Heading("4  Procedure"),
        Notes(study.rules, "Rules"),
        Words(f"Metrics: {', '.join(m.replace('_', ' ') for m in study.metrics)} of measured less simulated."),
        actions,
    ]


def _state(state: str) -> Cell:
    return Cell(f"✓ {state}", "", "good") if state == "done" else Cell(state, "", "soft")


def _boxes(study: Study) -> Table:
    rows: list[Line] = [
        [Cell(path or study.model.title, "", "main"), study.model.submodel(path).title if path else "the whole", box]
        for path, box in study.part_boxes.items()
    ]
    return Table.of([Head("part"), Head("deck"), Head("box colour, with those inside")], rows)


def _instruments(study: Study) -> Table:
    columns = [
        Head("sensor"),
        Head("accuracy, K", True),
        Head("resolution, K", True),
        Head("range, °C", True),
        Head("conversion, s", True),
        Head("certificate", wrapped=True),
        Head("basis", wrapped=True),
    ]
    rows: list[Line] = [
        [
            Cell(name, ", ".join(s.channels), "main"),
            f"± {plain(s.accuracy)}",
            plain(s.resolution) if s.resolution else DASH,
            " .. ".join(plain(t - ICE_POINT, 4) for t in s.range) or DASH,
            plain(s.conversion) if s.conversion else DASH,
            s.certificate or DASH,
            s.basis or DASH,
        ]
        for name, s in study.sensors.items()
    ]
    return Table.of(columns, rows)


def _parts_section(study: Study) -> Section:
    counts = Counter(p.source for _, _, p in _stated(study))
    told = ", ".join(f"{counts[source]} {source}" for source in sorted(counts))
    blocks: list[PageBlock] = [
        parts(study),
        Words(f"Values of the decks by their source: {told}. A value is written once, with its formula or range and the reason."),
        folded("Where every value comes from", [provenance(study)], f"{sum(counts.values())} values"),
        folded("Area ledger of the whole", [tables.areas(study.model)]),
    ]
    return Section.of("parts", "Parts and provenance", blocks)


def parts(study: Study) -> Table:
    """Return the physical items: what each is, where it stands in the model, its box colour and its limits."""
    boxes, colours = study.boxes, study.part_boxes
    rows: list[Line] = []
    for name, c in study.components.items():
        limits = [f"{sign} {plain(t - ICE_POINT, 4)} °C" for sign, t in (("≥", c.lowest), ("≤", c.highest)) if t is not None]
        box = colours.get(c.at) or boxes[c.at]
        rows.append([Cell(name, "", "main"), c.what or DASH, c.at, box, Cell(", ".join(limits) or DASH, c.basis)])
    columns = [
        Head("physical item"),
        Head("what it is", wrapped=True),
        Head("in the model"),
        Head("box"),
        Head("limits"),
    ]
    return Table.of(columns, rows)


def _decks(model: Model) -> dict[str, Model]:
    """Return title -> every deck that a model is made of, parts before what they are part of."""
    out: dict[str, Model] = {}
    for part in model.submodels.values():
        out |= _decks(part.model)
    return out | {model.title: model}


def _stated(study: Study) -> Iterator[tuple[str, str, Parameter]]:
    """Yield deck, name and value of everything that a deck states with a source."""
    for title, deck in _decks(study.model).items():
        named = [(name, p) for name, _, p in deck.own_parameters()]
        yield from ((title, name, p) for name, p in (*named, *deck.settings.items()) if p.source)


def provenance(study: Study) -> Table:
    """Return every value that the decks state: its range, its source, its formula or reason; a deck used several times stands once."""
    look = {"assumed": "warn", "published": "good"}
    rows: list[Line] = []
    for title, name, p in _stated(study):
        literal = p.expression.literal
        of = literal.unit if literal else None
        shown = plain((literal.value - float(of.offset)) / float(of.factor), 6) if literal and of else p.text
        ends = [plain(b / float(of.factor), 4) if b is not None and of else "" for b in (p.minimum, p.maximum)]
        line: Line = [Cell(title, "", "main"), name, Cell(shown, p.text), pretty(of.text) if of else DASH]
        line += [" .. ".join(ends) if any(ends) else DASH, Cell(p.source, "", look.get(p.source, "")), p.basis or p.note or DASH]
        rows.append(line)
    columns = [
        Head("deck"),
        Head("value"),
        Head("is", True),
        Head("unit"),
        Head("range"),
        Head("source"),
    ]
    return Table.of([*columns, Head("formula, or why", wrapped=True)], rows)


def step_log(study: Study, campaign: Campaign) -> Table:
    """Return what every step found: RMSE, largest and final error of each sensor."""
    asked = {key: metric(key) for key in study.metrics}
    rows: list[Line] = []
    for s in study.log(campaign):
        kind = Cell("held out", "no stage has seen it", "good") if s.held_out else Cell("fit", s.action)
        sizes = [(signed if row.signed else number)(s[key], row.digits) for key, row in asked.items()]
        rows.append([Cell(s.stage, s.action, "main"), s.record, kind, s.sensor, *sizes])
    headings = [Head(f"{row.short}, K", True) for row in asked.values()]
    columns = [Head("stage"), Head("record"), Head("kind"), Head("sensor"), *headings]
    return Table.of(columns, rows, "Final: mean over the last twentieth of the record.")


def _record_section(study: Study, campaign: Campaign) -> Section:
    lines = step_log(study, campaign)
    blocks: list[PageBlock] = [
        folded("Log of every step", [lines], f"{len(lines.rows)} lines"),
        folded("Verdicts, criterion by criterion", [tables.verdicts(campaign)]),
        folded("Data", [tables.data(campaign)]),
        folded("Models and fits", [tables.models(campaign)]),
        folded("Versions", [tables.versions()]),
    ]
    return Section.of("record", "On record", blocks)
