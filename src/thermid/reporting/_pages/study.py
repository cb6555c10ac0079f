"""Pages of a study: `study_report`, its four steps, its parts and what was found; `structures_report`, structures side by side."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from statistics import median

from thermid.base.arguments import takes_objects
from thermid.base.errors import ThermidError, look_up
from thermid.base.units import counted, from_si
from thermid.campaign.stages import Campaign
from thermid.campaign.studies import Study
from thermid.campaign.verdicts import metric
from thermid.model.elements import Parameter
from thermid.model.tree import Model
from thermid.physics.constants import ICE_POINT
from thermid.reporting._blocks.content import (
    DASH,
    Cell,
    Facts,
    Figures,
    Head,
    Heading,
    Line,
    Notes,
    PageBlock,
    Plot,
    Section,
    Table,
    Words,
    folded,
    number,
    plain,
    pretty,
    signed,
    significant,
)
from thermid.reporting._blocks.extras import Sheets, check_page, write_page
from thermid.reporting._pages import tables
from thermid.reporting._pages.front import VERDICTS_TABLE, front
from thermid.reporting._pages.tables import glance
from thermid.reporting._pictures import figures
from thermid.reporting._pictures.figures import Dots


@takes_objects
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
    """Write a study as one HTML page, or as a PDF where its name ends in .pdf, and return its path.

    The page loads nothing and runs no script but its own. Long tables are files of comma-separated values too, in a folder beside the page.

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
    sheets = Sheets.beside(to, audience=audience)
    records, of = tables.made_records(campaign)
    text = f"{len(records)} of {of} records are synthetic, so results from them are not evidence about real hardware." if records else ""
    banners = [(watermark.upper() or "SYNTHETIC DATA", " ".join(t for t in (study.note, text) if t))] if watermark or records else []
    added = [s for s in sections if audience in s.audiences]
    whole = [Section.of_blocks("steps", "The four steps", steps(study)), _parts_section(study), *added, _record_section(study, campaign)]
    shown = sheets.shortened(whole)
    if audience == "summary":
        shown = [Section.of_blocks("verdicts", "Verdicts", [_verdicts(campaign, ranked=True)] if campaign.verdicts else [])]
    outcomes = [v.passed for v in campaign.verdicts]
    return write_page(
        "study.html.jinja",
        to,
        title=study.title,
        opening=_opening(study, audience),
        watermark=watermark,
        headline="",
        banners=banners,
        failed=outcomes.count(False),
        undecided=outcomes.count(None),
        judged=len(outcomes),
        summary="on hold-out records" if campaign.verdicts else "no hold-out record",
        front=front(campaign),
        outcome=outcome,
        sections=shown,
        seen=glance(campaign, {}),
        sheets=sheets,
    )


def _opening(study: Study, audience: str) -> list[str]:
    """Return what the study is about; nothing of it on two sheets."""
    words = (study.subject, f"Intended use: {study.use}.", f"After: {study.document}." if study.document else "")
    return [] if audience == "summary" else [t for t in words if t]


def steps(study: Study) -> list[PageBlock]:
    """Return knowledge and use, box colours, set-ups and procedure as recorded."""
    theory = (("solver", study.solver), ("error of a run", f"{study.options.error:g} K"))
    rows: list[Line] = [
        [Cell(str(k), "", "main"), a.name, _state(a.state), ", ".join(a.stages) or a.note or DASH] for k, a in enumerate(study.actions, 1)
    ]
    boxes: list[Line] = [
        [Cell(path or study.model.title, "", "main"), study.model.submodel(path).title if path else "the whole", box]
        for path, box in study.part_boxes.items()
    ]
    box_table = Table.of_rows([Head("part"), Head("deck"), Head("box colour, with those inside")], boxes)
    actions = Table.of_rows([Head("no."), Head("action", wrapped=True), Head("state"), Head("stages", wrapped=True)], rows)
    return [
        Heading("1  Knowledge and intended use"),
        Facts((("physical items", str(len(study.components))), ("model of the whole", study.model.title))),
        *(Words(fact) for fact in study.facts),
        Heading("2  Box colour"),
        Words(study.reason),
        Facts((("the whole", study.part_boxes[""]),)),
        folded("Box colours part by part", [box_table], counted(len(study.part_boxes), "part")),
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
    """Return the cell of the state of a step."""
    return Cell(f"✓ {state}", "", "good") if state == "done" else Cell(state, "", "soft")


def _instruments(study: Study) -> Table:
    """Return the table of the sensors of a study: accuracy, resolution, range, conversion time, certificate."""
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
    return Table.of_rows(columns, rows)


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
    return Table.of_rows(columns, rows)


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
        shown = plain(from_si(literal.value, of), 6) if literal and of else p.text
        ends = [plain(b / float(of.factor), 4) if b is not None and of else "" for b in (p.minimum, p.maximum)]
        line: Line = [Cell(title, "", "main"), name, Cell(shown, p.text), pretty(of.text) if of else DASH]
        ranges = [" .. ".join(ends)] * any(ends) + [f"± {pretty(p.spread)}"] * (p.spread != "" and not p.is_range)
        line += [", ".join(ranges) or DASH, Cell(p.source, "", look.get(p.source, "")), p.basis or p.note or DASH]
        rows.append(line)
    columns = [
        Head("deck"),
        Head("value"),
        Head("is", True),
        Head("unit"),
        Head("range"),
        Head("source"),
    ]
    return Table.of_rows([*columns, Head("formula or reason", wrapped=True)], rows)


def step_log(study: Study, campaign: Campaign) -> Table:
    """Return what every step found: RMSE, largest and final error of each sensor."""
    metrics = {key: metric(key) for key in study.metrics}
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


SAME_ERROR_FACTOR = 1.05
"""Errors on unseen runs within this factor of the lowest say nothing between structures."""
LITTLE = 10.0
"""Difference of the corrected AIC above which a structure has no support (Burnham and Anderson 2002, section 2.6)."""


@dataclass(frozen=True)
class Structure:
    """One candidate, fitted to the same records as the others.

    Parameters
    ----------
    name, what : str        What it is called, and what it is made of.
    free : int              Values that it frees, those of single runs not counted.
    likelihood : float      -2 log likelihood up to a constant. [-]
    aic, corrected : float  Difference of AIC from the best, and the same with the likelihood divided by what the memory of residuals
                            inflates it. [-]
    fitted : dict           Sensor -> median over the fitted runs of the RMSE. [K]
    unseen : dict           Sensor -> run that no fit has seen -> RMSE. [K]
    values : dict           Parameter -> value, error and unit.
    at_bounds : tuple       Parameters that ended at a bound, in words.
    implausible : tuple     What else is unphysical or unknown, in words.
    refused : str           Why it could not be fitted; empty where it was.
    """

    name: str
    what: str
    free: int
    likelihood: float = float("nan")
    aic: float = float("nan")
    corrected: float = float("nan")
    fitted: Mapping[str, float] = field(default_factory=dict)
    unseen: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    values: Mapping[str, tuple[float, float, str]] = field(default_factory=dict)
    at_bounds: tuple[str, ...] = ()
    implausible: tuple[str, ...] = ()
    refused: str = ""

    @property
    def physical(self) -> bool:
        """Whether it was fitted and nothing is held against its values."""
        return not (self.refused or self.at_bounds or self.implausible)

    @property
    def error(self) -> float:
        """Median over unseen runs, mean over sensors. [K]"""
        medians = [median(runs.values()) for runs in self.unseen.values()]
        return sum(medians) / len(medians) if medians else float("inf")


@takes_objects
def structures_report(
    title: str,
    structures: Sequence[Structure],
    *,
    to: str | os.PathLike[str],
    chosen: str = "",
    reasons: Sequence[str] = (),
    notes: Sequence[str] = (),
) -> Path:
    """Write a comparison of structures as one HTML page, or as a PDF where its name ends in .pdf, and return its path.

    The page loads nothing and runs no script but its own.

    Parameters
    ----------
    title : str             What was modelled.
    structures : sequence   The candidates, from the simplest.
    to : path               The file to write; its folder is made where it is missing.
    chosen : str            The one that its author takes; the simplest physical one within 5 % of the lowest error by default.
    reasons : sequence      Why, in the author's words.
    notes : sequence        What a reader must know of data and method.

    Raises
    ------
    ValueError          Without structures, or when the chosen one is not among them.
    MissingExtraError   When jinja2 is not installed.
    NoBrowserError      When a PDF is asked for and no browser is installed that prints it.
    OutputError         When the file may not be written, or its name promises another format.
    """
    if not structures:
        raise ThermidError("no structures are given to compare. Give one at least.", title, code="value.incomplete")
    check_page(to)
    taken = _taken(structures, chosen)
    return write_page(
        "study.html.jinja",
        to,
        title=title,
        opening=list(notes),
        watermark="",
        banners=[],
        headline=f"Taken: {taken.name}" if taken else "None is acceptable",
        failed=0 if taken and taken.physical else 1,
        judged=1,
        summary=taken.what if taken else "every structure was refused, or has implausible values",
        outcome=[Notes((*_findings(structures, taken), *reasons), "Result of the comparison")],
        sections=[
            Section.of_blocks("side-by-side", "Side by side", [_overview(structures, taken), *_dots(structures)]),
            Section.of_blocks("values", "Values and objections", _values(structures)),
            Section.of_blocks("provenance", "Provenance", [tables.versions()]),
        ],
    )


def _taken(structures: Sequence[Structure], chosen: str) -> Structure | None:
    """Return the structure that is taken: the one named, or the simplest of the physical ones whose error is near the least."""
    if chosen:
        return look_up(chosen, {s.name: s for s in structures}, "no structure '{}'; there are {known}.")
    good = [s for s in structures if s.physical]
    best = min((s.error for s in good), default=0.0)
    return min((s for s in good if s.error <= SAME_ERROR_FACTOR * best), key=lambda s: s.free, default=None)


def _findings(structures: Sequence[Structure], taken: Structure | None) -> list[str]:
    """Return what likelihood, unseen runs and physics say, and where they disagree."""
    candidates = [s for s in structures if not s.refused]
    out = []
    if candidates:
        likeliest, nearest = min(candidates, key=lambda s: s.corrected), min(candidates, key=lambda s: s.error)
        wrong = "" if likeliest.physical else f", but implausible: {'; '.join((*likeliest.at_bounds, *likeliest.implausible))}"
        out.append(f"Likeliest on the fitted runs: {likeliest.name}{wrong}.")
        out.append(f"Nearest to the hold-out runs: {nearest.name}, {number(nearest.error, 2)} K.")
        if taken is not None and taken is not nearest:
            away = taken.error / nearest.error - 1.0
            why = "" if nearest.physical else f"; of {nearest.name}: {'; '.join((*nearest.at_bounds, *nearest.implausible))}"
            out.append(f"{taken.name} misses them by {number(taken.error, 2)} K, {100 * away:.0f} % more{why}.")
    refused = [s.name for s in structures if s.refused]
    if refused:
        out.append(f"Refused, because these runs do not determine its parameters: {', '.join(refused)}.")
    return out


def _overview(structures: Sequence[Structure], taken: Structure | None) -> Table:
    """Return the table of structures: free values, information criteria, errors on fitted and hold-out runs."""
    sensors = list(dict.fromkeys(name for s in structures for name in s.unseen))
    columns = [
        Head("structure"),
        Head("what it is", wrapped=True),
        Head("free", True),
        Head(
            "dQAIC",
            True,
            "difference of AIC from the best, with the likelihood corrected for autocorrelated residuals; above 10: no support",
        ),
        Head("dAIC", True, "as if every sample were independent (they are not)"),
        *(Head(f"{s} fitted, K", True, "median RMSE over the fitted runs") for s in sensors),
        *(Head(f"{s} unseen, K", True, "median RMSE over hold-out runs") for s in sensors),
        Head("at bounds", True),
        Head("physical"),
    ]
    lowest = {s: min((median(x.unseen[s].values()) for x in structures if s in x.unseen), default=0.0) for s in sensors}
    rows: list[Line] = []
    for x in structures:
        name = Cell(f"▸ {x.name}" if x is taken else x.name, "", "main")
        if x.refused:
            rows.append([name, x.what, str(x.free), *[DASH] * (2 + 2 * len(sensors)), DASH, Cell("refused", x.refused, "warn")])
            continue
        unseen = [median(x.unseen[s].values()) for s in sensors]
        looks = ["good" if u <= SAME_ERROR_FACTOR * lowest[s] else "" for s, u in zip(sensors, unseen, strict=True)]
        verdict = Cell("✓ yes", "", "good") if x.physical else Cell(f"✗ {len(x.at_bounds) + len(x.implausible)} doubtful", "", "warn")
        rows.append(
            [
                name,
                x.what,
                str(x.free),
                Cell(f"{x.corrected:.0f}", "", "good" if x.corrected < LITTLE else ""),
                f"{x.aic:.0f}",
                *(number(x.fitted[s], 2) for s in sensors),
                *(Cell(number(u, 2), "", look) for u, look in zip(unseen, looks, strict=True)),
                Cell(str(len(x.at_bounds)), "", "warn" if x.at_bounds else ""),
                verdict,
            ]
        )
    caption = "From the simplest down; ▸ is taken. Strong: within 5 % of the lowest error, or with support by the corrected likelihood."
    return Table.of_rows(columns, rows, caption)


def _dots(structures: Sequence[Structure]) -> list[PageBlock]:
    """Return the figure of the errors of every structure on each hold-out run. [K]"""
    lines = [Dots(s.name, {sensor: list(runs.values()) for sensor, runs in s.unseen.items()}, True) for s in structures if s.unseen]
    if not lines:
        return []
    drawn = figures.overview(lines)
    return [Figures((Plot(drawn, "RMSE on each hold-out run [K], one line per structure."),), drawn.legend, True)]


def _values(structures: Sequence[Structure]) -> list[PageBlock]:
    """Return the values of each structure with their standard errors, below what speaks against it."""
    out: list[PageBlock] = []
    for s in structures:
        out.append(Heading(s.name))
        if s.refused:
            out.append(Notes((s.refused,), "Refused"))
            continue
        held = (*s.at_bounds, *s.implausible)
        out.append(Notes(held, "Objections") if held else Words("Every value is within published ranges and inside its bounds."))
        rows: list[Line] = [
            [Cell(p, "", "main"), f"{significant(v, e)} ± {number(e, 2)}", pretty(unit)] for p, (v, e, unit) in s.values.items()
        ]
        table = Table.of_rows([Head("value"), Head("found ± total error", True), Head("unit")], rows)
        out.append(folded("Its values", [table], f"{len(rows)} of them"))
    return out
