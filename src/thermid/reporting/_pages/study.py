"""The page of a study: `study_report`, its four steps, its parts and what was found."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from thermid.base.units import ICE_POINT, counted, from_si
from thermid.campaign.stages import Campaign, Study, metric
from thermid.model.tree import Model, Parameter
from thermid.reporting._blocks.content import (
    DASH,
    Cell,
    Facts,
    Head,
    Heading,
    Line,
    Notes,
    PageBlock,
    Section,
    Sheets,
    Table,
    Words,
    check_page,
    folded,
    number,
    plain,
    pretty,
    signed,
    write_page,
)
from thermid.reporting._pages import tables
from thermid.reporting._pages.campaign import VERDICTS_TABLE, front
from thermid.reporting._pages.tables import glance


def study_report(
    study: Study,
    campaign: Campaign,
    *,
    to: str | os.PathLike[str],
    sections: Sequence[Section] = (),
    outcome: Sequence[PageBlock] = (),
    watermark: str = "",
    audience: str = "all",
) -> Path:
    """Write a study as one HTML page, or as a PDF where its name ends in .pdf, and return its path; long tables are CSV files beside it.

    Parameters
    ----------
    study : Study           What it is about and how it is done.
    campaign : Campaign     What was found.
    to : path               The file to write; its folder is made where it is missing.
    sections : sequence     What its author adds, between the parts and the log.
    outcome : sequence      What stands below the verdicts' summary.
    watermark : str         Words at the foot of every sheet, and on a banner; for what must not be taken for a result.
    audience : str          ``summary``: at most two sheets; ``agency``: what a reviewer reads; ``all``: everything.

    Raises
    ------
    MissingExtraError   When jinja2 is not installed.
    NoBrowserError      When a PDF is asked for and no browser is installed that prints it.
    OutputError         When the file may not be written, or its name promises another format.
    ScenarioError       When there is no such audience.
    """
    check_page(to)
    content, sheets = study.content, Sheets.beside(to, audience=audience)
    records, of = tables.made_records(campaign)
    text = f"{len(records)} of {of} records are synthetic, so results from them are not evidence about real hardware." if records else ""
    banners = [(watermark.upper() or "SYNTHETIC DATA", " ".join(t for t in (content.note, text) if t))] if watermark or records else []
    if audience == "summary":
        shown = [Section.of_blocks("verdicts", "Verdicts", [_verdicts(campaign, ranked=True)] if campaign.verdicts else [])]
    else:
        first = [Section.of_blocks("steps", "The four steps", steps(study)), _parts_section(study)]
        shown = sheets.shortened([*first, *sections, _record_section(study, campaign)])
    outcomes = [v.passed for v in campaign.verdicts]
    about = (content.knowledge.subject, f"Intended use: {content.knowledge.use}.", f"After: {content.document}." * bool(content.document))
    return write_page(
        "study.html.jinja",
        to,
        title=study.title,
        opening=[] if audience == "summary" else [t for t in about if t],
        watermark=watermark,
        headline="",
        banners=banners,
        failed=outcomes.count(False),
        undecided=outcomes.count(None),
        unfounded=sum(v.unfounded for v in campaign.verdicts),
        judged=len(outcomes),
        summary="on hold-out records" if campaign.verdicts else "no hold-out record",
        front=front(campaign),
        outcome=outcome,
        sections=shown,
        seen=glance(campaign, {}),
        sheets=sheets,
    )


def steps(study: Study) -> list[PageBlock]:
    """Return knowledge and use, box colours, set-ups and procedure as recorded."""
    theory, experiment = (
        (("solver", study.content.theory.solver), ("error of a run", f"{study.options.error:g} K")),
        study.content.experiment,
    )
    boxes: list[Line] = [
        [Cell(path or study.model.title, "", "main"), study.model.submodel(path).title if path else "the whole", box]
        for path, box in study.model.part_boxes.items()
    ]
    box_table = Table.of_rows([Head("part"), Head("deck"), Head("box colour, with those inside")], boxes)
    actions = Table.of_rows(
        [Head("no."), Head("action", wrapped=True), Head("state"), Head("stages", wrapped=True)],
        [
            [
                Cell(str(k), "", "main"),
                a.name,
                Cell(f"✓ {a.state}", "", "good") if a.state == "done" else Cell(a.state, "", "soft"),
                ", ".join(a.stages) or a.note or DASH,
            ]
            for k, a in enumerate(study.content.actions, 1)
        ],
    )
    return [
        Heading("1  Knowledge and intended use"),
        Facts((("physical items", str(len(study.components))), ("model of the whole", study.model.title))),
        *(Words(fact) for fact in study.content.knowledge.facts),
        Heading("2  Box colour"),
        Words(study.content.box.reason),
        Facts((("the whole", study.model.part_boxes[""]),)),
        folded("Box colours part by part", [box_table], counted(len(study.model.part_boxes), "part")),
        Heading("3  Theoretical and experimental set-up"),
        Facts(theory),
        *(Words(text) for text in (*study.content.theory.notes, *filter(None, (experiment.platform, *experiment.notes)))),
        _instruments(study),
        Heading("4  Procedure"),
        Notes(tuple(study.content.procedure.rules), "Rules"),
        Words(f"Metrics: {', '.join(m.replace('_', ' ') for m in study.content.procedure.metrics)} of measured less simulated."),
        actions,
    ]


def _instruments(study: Study) -> Table:
    """Return the table of the sensors of a study: accuracy, resolution, range, conversion time, certificate."""
    return Table.of_rows(
        [
            Head("sensor"),
            Head("accuracy, K", True),
            Head("resolution, K", True),
            Head("range, °C", True),
            Head("conversion, s", True),
            Head("certificate", wrapped=True),
            Head("basis", wrapped=True),
        ],
        [
            [
                Cell(name, ", ".join(s.channels), "main"),
                f"± {plain(s.accuracy)}",
                plain(s.resolution) if s.resolution else DASH,
                " .. ".join(plain(t - ICE_POINT) for t in s.range) or DASH,
                plain(s.conversion) if s.conversion else DASH,
                s.certificate or DASH,
                s.basis or DASH,
            ]
            for name, s in study.content.sensors.items()
        ],
    )


def _parts_section(study: Study) -> Section:
    """Return the section on the parts: their table, and the source of every value."""
    counts = Counter(p.source for _, _, p in _stated(study))
    sources = ", ".join(f"{counts[source]} {source}" for source in sorted(counts))
    blocks: list[PageBlock] = [
        parts(study),
        Words(f"Values of the decks by their source: {sources}. A value is written once, with its formula or range and the reason."),
        folded("Source of every value", [provenance(study)], counted(sum(counts.values()), "value")),
        folded("Area ledger of the whole", [tables.areas(study.model)]),
    ]
    return Section.of_blocks("parts", "Parts and provenance", blocks)


def parts(study: Study) -> Table:
    """Return the physical items: what each is, where it stands in the model, its box colour and its limits."""
    boxes, colours = study.model.node_boxes, study.model.part_boxes
    rows: list[Line] = []
    for name, c in study.components.items():
        limits = [f"{sign} {plain(t - ICE_POINT)} °C" for sign, t in (("≥", c.lowest), ("≤", c.highest)) if t is not None]
        box = colours.get(c.at) or boxes[c.at]
        rows.append([Cell(name, "", "main"), c.what or DASH, c.at, box, Cell(", ".join(limits) or DASH, c.basis)])
    return Table.of_rows(
        [
            Head("physical item"),
            Head("what it is", wrapped=True),
            Head("in the model"),
            Head("box"),
            Head("limits"),
        ],
        rows,
    )


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
        shown = plain(from_si(literal.value, of)) if literal and of else p.text
        ends = [plain(b / float(of.factor)) if b is not None and of else "" for b in (p.minimum, p.maximum)]
        line: Line = [Cell(title, "", "main"), name, Cell(shown, p.text), pretty(of.text) if of else DASH]
        ranges = [" .. ".join(ends)] * any(ends) + [f"± {pretty(p.spread)}"] * (p.spread != "" and not p.is_range)
        line += [", ".join(ranges) or DASH, Cell(p.source, "", look.get(p.source, "")), p.basis or p.note or DASH]
        rows.append(line)
    return Table.of_rows(
        [
            Head("deck"),
            Head("value"),
            Head("is", True),
            Head("unit"),
            Head("range"),
            Head("source"),
            Head("formula or reason", wrapped=True),
        ],
        rows,
    )


def step_log(study: Study, campaign: Campaign) -> Table:
    """Return what every step found: RMSE, largest and final error of each sensor."""
    metrics = {key: metric(key) for key in study.content.procedure.metrics}
    rows: list[Line] = []
    for s in study.log(campaign):
        kind = Cell("held out", "no stage uses it", "good") if s.held_out else Cell("fit", s.action)
        sizes = [(signed if row.signed else number)(s[key], row.digits) for key, row in metrics.items()]
        rows.append([Cell(s.stage, s.action, "main"), s.record, kind, s.sensor, *sizes])
    headings = [Head(f"{row.short}, K", True) for row in metrics.values()]
    columns = [Head("stage"), Head("record"), Head("kind"), Head("sensor"), *headings]
    return Table.of_rows(columns, rows, "Final: mean over the last twentieth of the record.")


def _record_section(study: Study, campaign: Campaign) -> Section:
    """Return the section on record: log of steps, verdicts, data, fits, versions."""
    lines = step_log(study, campaign)
    blocks: list[PageBlock] = [
        folded("Log of every step", [lines], counted(len(lines.rows), "line")),
        *([_verdicts(campaign)] if campaign.verdicts else []),
        folded("Data", tables.data(campaign)),
        folded("Models and fits", [tables.models(campaign)]),
        folded("Versions", [tables.versions()]),
    ]
    return Section.of_blocks("record", "On record", blocks)


def _verdicts(campaign: Campaign, ranked: bool = False) -> Table:
    """Return the table of verdicts under the title and key that a study gives it."""
    return replace(tables.verdicts(campaign, ranked), title="Verdicts, criterion by criterion", key=VERDICTS_TABLE)
