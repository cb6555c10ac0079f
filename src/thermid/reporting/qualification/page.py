"""`qualification_report`: a plan worked through as one self-contained page, in the order in which a correlation report is read."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from thermid.arguments import takes_objects
from thermid.judge.correlation import Correlation
from thermid.qualify.programme import Qualification
from thermid.reporting.blocks.cells import DASH, Table
from thermid.reporting.blocks.extras import write_page
from thermid.reporting.blocks.sections import Block, Facts, Figures, LegendEntry, Notes, Plot, Section, Words, as_block
from thermid.reporting.pages.origins import versions
from thermid.reporting.pages.study import tile
from thermid.reporting.qualification import judged, tables
from thermid.reporting.qualification.cells import hours
from thermid.reporting.qualification.figures import course
from thermid.reporting.qualification.sections import all_overlays, sections
from thermid.sourced import VERDICTS, weigh
from thermid.units import counted


@takes_objects
def qualification_report(q: Qualification, *, to: str | os.PathLike[str]) -> Path:
    """Write a qualification as one HTML page and return its path. The page loads nothing and runs no script but its own.

    Parameters
    ----------
    q : Qualification   What `run_plan` found.
    to : path           The file to write; its folder is made where it is missing.

    Raises
    ------
    MissingExtraError   When jinja2 is not installed.
    """
    content, worst = q.plan.content, q.worst
    watermark = q.demonstration.upper()
    found = [t.passed for t in q.trials] + [m.passed for m in q.margins]
    failed, open_ = found.count(False), found.count(None)
    summary = f"{counted(len(q.trials), 'test')}, {counted(len(q.margins), 'margin')}" + (f"; {open_} not decided" if open_ else "")
    summary += f"; {len(q.waived)} waived" if q.waived else ""
    if worst is not None:
        left = f"{worst[3]:.1f} K left" if worst[3] >= 0 else f"{-worst[3]:.1f} K beyond its limit"
        summary += f"; nearest to a limit: {worst[0]} in {worst[1]} at {hours(worst[2])}, {left}"
    document = content.document.model_dump()
    names = {"number": "document", "prepared": "prepared by", "checked": "checked by", "approved": "approved by"}
    facts = Facts(tuple((names.get(k, k), v or DASH) for k, v in document.items()))
    return _write(
        to,
        title=q.plan.title,
        running=running(q),
        opening=[t for t in (f"Intended use: {content.use}." if content.use else "", content.note) if t],
        watermark=watermark,
        banners=[(watermark, "No statement on this page is about real hardware.")] if watermark else [],
        passed=q.passed,
        failed=failed,
        judged=len(found),
        summary=summary,
        outcome=[facts, Words(f"{str(q.lock)[0].upper()}{str(q.lock)[1:]}."), tables.tests(q), *_what_is_open(q), *_courses(q)],
        sections=sections(q),
    )


def running(q: Qualification) -> str:
    """Return the running head of printed pages: document number, issue, date, title."""
    d = q.plan.content.document
    return " · ".join(t for t in (d.number, f"issue {d.issue}" if d.issue else "", d.date, q.plan.title) if t)


@takes_objects
def correlation_report(c: Correlation, *, to: str | os.PathLike[str], synthetic: bool = False) -> Path:
    """Write a correlation as one HTML page - metrics, gates, overlays with the sensors' band - and return its path.

    Parameters
    ----------
    c : Correlation     What `correlate` found.
    to : path           The file to write.
    synthetic : bool    Whether the readings were made and not measured.

    Raises
    ------
    MissingExtraError   When jinja2 is not installed.
    """
    blocks = [
        Section.of("deviations", "Deviations", [judged.deviations(c)]),
        Section.of("gates", "Criteria", [judged.gates(c)]),
        Section.of("overlays", "Measured over simulated", [all_overlays(c, "o", synthetic)]),
        Section.of("made", "Made with", [versions()]),
    ]
    found = list(c.verdicts.values())
    watermark = "SYNTHETIC DATA" if synthetic else ""
    banner = [(watermark, "The readings were made, not measured.")] if synthetic else []
    said = f"{counted(len(c.gates), 'gate')}, {len(c.failed)} not met"
    return _write(
        to,
        title=c.title,
        opening=[],
        watermark=watermark,
        banners=banner,
        passed=weigh(found),
        failed=found.count(False),
        judged=len(found),
        summary=said,
        outcome=[],
        sections=blocks,
    )


def _write(
    to: str | os.PathLike[str], *, watermark: str, outcome: Sequence[Block | Table], passed: bool | None, judged: int, **shown: object
) -> Path:
    """Write a page; one without a failure and with something open says so in its head, in place of a count of what passed."""
    head = {"headline": "? Not decided", "judged": 0} if passed is None else {"headline": "", "judged": judged}
    blocks = [as_block(b) for b in outcome]
    return write_page("study.html.jinja", to, **head, watermark=watermark, tile=tile(watermark), outcome=blocks, **shown)


def _what_is_open(q: Qualification) -> list[Block]:
    """Return what is not decided and why, what was waived, and what must be known of the logs."""
    waived = tuple(f"{n}: held against its limits alone" for n in q.waived)
    remarks = (*_signatures(q), *(f"{t.test.name}: {r}" for t in q.trials for r in t.remarks))
    found = (("Not decided", q.open), ("Waived", waived), ("Remarks", remarks))
    return [Notes(lines, title) for title, lines in found if lines]


def _signatures(q: Qualification) -> list[str]:
    """Return what is amiss with who signed the document."""
    d = q.plan.content.document
    missing = [word for word, name in (("checked", d.checked), ("approved", d.approved)) if not name.strip()]
    out = [f"the document is not {' and not '.join(missing)}"] if missing else []
    if d.prepared.strip() and d.prepared.strip() in (d.checked.strip(), d.approved.strip()):
        out.append(f"{d.prepared.strip()} prepared the document and signed for it again: nobody else has looked at it")
    return out


def _courses(q: Qualification) -> list[Block]:
    """Return the worst part of every test over time."""
    plots: list[Plot] = []
    legend: dict[str, LegendEntry] = {}
    for k, t in enumerate(q.trials):
        drawn, worst = course(t, f"course-{k}"), t.worst
        if drawn is not None and worst is not None:
            met = weigh([c.passed for c in t.checks if c.point == worst.point])
            far = f"{worst.room:.1f} K from its limit" if worst.room >= 0 else f"{-worst.room:.1f} K beyond its limit"
            plots.append(Plot(drawn, f"{t.test.name}: {worst.point}, {worst.state}, {worst.by}, {far}: {VERDICTS[met]}"))
            legend |= {e.label: e for e in drawn.legend if e.label not in legend}
    return [Figures(tuple(plots), tuple(legend.values()))] if plots else []
