"""`qualification_report`: a plan worked through as one self-contained page, in the order in which a correlation report is read."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from thermid.base.results import VERDICTS, weigh
from thermid.base.units import ICE_POINT, counted
from thermid.campaign.stages import Correlation, Limits, heading, spans
from thermid.model.tree import Flat
from thermid.qualify.plans import Qualification, Trial
from thermid.reporting._blocks.content import (
    DASH,
    Cell,
    Facts,
    Figures,
    Graphic,
    Head,
    Heading,
    LegendEntry,
    Line,
    Notes,
    PageBlock,
    Plot,
    Section,
    Table,
    Words,
    capitalised,
    check_page,
    folded,
    number,
    write_page,
)
from thermid.reporting._pages.campaign import SYNTHETIC
from thermid.reporting._pages.tables import versions
from thermid.reporting._pictures import figures
from thermid.reporting._pictures.chart import Area, Stroke
from thermid.reporting._pictures.figures import compared, curve, curves
from thermid.reporting._qualification import tables
from thermid.reporting._qualification.tables import hours, mark


def qualification_report(q: Qualification, *, to: str | os.PathLike[str]) -> Path:
    """Write a qualification as one HTML page, or as a PDF where its name ends in .pdf, and return its path.

    The page loads nothing and runs no script but its own.

    Parameters
    ----------
    q : Qualification   What `run_plan` found.
    to : path           The file to write; its folder is made where it is missing.

    Raises
    ------
    MissingExtraError   When jinja2 is not installed.
    NoBrowserError      When a PDF is asked for and no browser is installed that prints it.
    OutputError         When the file may not be written, or its name promises another format.
    """
    check_page(to)
    content, worst = q.plan.content, q.worst
    watermark = q.demonstration.upper()
    outcomes = [t.passed for t in q.trials] + [m.passed for m in q.margins]
    failed, open_ = outcomes.count(False), outcomes.count(None)
    summary = f"{counted(len(q.trials), 'test')}, {counted(len(q.margins), 'margin')}" + (f"; {open_} not decided" if open_ else "")
    missed = [t.test.name for t in q.trials if t.passed is False] + [
        f"margin of {m.point}, {m.side}" for m in q.margins if m.passed is False
    ]
    summary = f"{', '.join(missed)}; {summary}" if missed else summary
    summary += f"; {len(q.waived)} waived" if q.waived else ""
    summary += f"; smallest margin: {worst}" if worst is not None else ""
    document = content.document.model_dump()
    names = {"number": "document", "prepared": "prepared by", "checked": "checked by", "approved": "approved by"}
    facts = Facts(tuple((names.get(k, k), v or DASH) for k, v in document.items()))
    waived = tuple(f"{n}: compared with its limits alone" for n in q.waived)
    remarks = tuple(f"{t.test.name}: {r}" for t in q.trials for r in t.remarks)
    notes = [Notes(lines, title) for title, lines in (("Not decided", q.open), ("Waived", waived), ("Remarks", remarks)) if lines]
    return _write(
        to,
        title=q.plan.title,
        running=running(q),
        opening=[t for t in (f"Intended use: {content.use}." if content.use else "", content.note) if t],
        watermark=watermark,
        banners=[(watermark, "The results on this page are not evidence about real hardware.")] if watermark else [],
        passed=q.passed,
        failed=failed,
        judged=len(outcomes),
        summary=summary,
        outcome=[facts, Words(f"{capitalised(str(q.lock))}."), tables.tests(q), *notes, *_courses(q)],
        sections=sections(q),
    )


def running(q: Qualification) -> str:
    """Return the running head of printed pages: document number, issue, date, title."""
    d = q.plan.content.document
    return " · ".join(t for t in (d.number, f"issue {d.issue}" if d.issue else "", d.date, q.plan.title) if t)


def correlation_report(c: Correlation, *, to: str | os.PathLike[str], synthetic: bool = False) -> Path:
    """Write a correlation as one HTML page, or as a PDF where its name ends in .pdf, and return its path: metrics, gates, overlays.

    Parameters
    ----------
    c : Correlation     What `correlate` found.
    to : path           The file to write.
    synthetic : bool    Whether the readings were made and not measured.

    Raises
    ------
    MissingExtraError   When jinja2 is not installed.
    NoBrowserError      When a PDF is asked for and no browser is installed that prints it.
    OutputError         When the file may not be written, or its name promises another format.
    """
    check_page(to)
    blocks = [
        Section.of_blocks("deviations", "Deviations", [tables.deviations(c)]),
        Section.of_blocks("gates", "Criteria", [tables.gates(c)]),
        Section.of_blocks("overlays", "Measured over simulated", [all_overlays(c, "o", synthetic)]),
        Section.of_blocks("made", "Made with", [versions()]),
    ]
    verdicts, missed = list(c.verdicts.values()), [name for name, passed in c.verdicts.items() if passed is False]
    watermark = "SYNTHETIC DATA" if synthetic else ""
    banner = [(watermark, "The readings are synthetic.")] if synthetic else []
    # predicted against measured, and the residuals counted, of all overlays
    measured, simulated = [o.measured for o in c.overlays], [o.simulated for o in c.overlays]
    return _write(
        to,
        title=c.title,
        opening=[],
        watermark=watermark,
        banners=banner,
        passed=weigh(verdicts),
        failed=verdicts.count(False),
        judged=len(verdicts),
        summary="; ".join([*missed, f"{counted(len(c.gates), 'gate')}, {len(c.failed)} not met"]),
        outcome=[Figures(figures.against_measured(measured, simulated, "simulated"))] * bool(c.overlays)
        + [Notes(c.remarks, "Remarks")] * bool(c.remarks),
        sections=blocks,
    )


def _write(
    to: str | os.PathLike[str], *, watermark: str, outcome: Sequence[PageBlock], passed: bool | None, judged: int, **shown: Any
) -> Path:
    """Write a page; without a failure, and with something undecided, its head names that in place of a count of what passed."""
    head: dict[str, Any] = {"headline": "? Not decided", "judged": 0} if passed is None else {"headline": "", "judged": judged}
    return write_page("study.html.jinja", to, **head, watermark=watermark, outcome=outcome, **shown)


def _courses(q: Qualification) -> list[PageBlock]:
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


def sections(q: Qualification) -> list[Section]:
    """Return the sections of a correlation report, in their order."""
    content = q.plan.content
    logged = [(t, t.correlation) for t in q.trials if t.correlation is not None]
    transients: list[PageBlock] = []  # measured and predicted temperatures of each test with a log
    for k, (t, c) in enumerate(logged):
        transients += [Heading(t.test.name), all_overlays(c, f"over-{k}", t.synthetic)]
    predictions = [
        folded(t.test.name, [tables.foreseen(q, t)], "with readings" if t.correlation is not None else "no log yet") for t in q.trials
    ]
    objectives = [Notes(tuple(content.objectives), "Objectives"), Notes(tuple(content.success), "Success criteria")]
    return [
        Section.of_blocks(
            "objectives", "Objectives and success criteria", [*objectives, folded("Criteria, with their sources", [_criteria(q)])]
        ),
        Section.of_blocks("configuration", "Article and model configuration", _configuration(q), "Configuration"),
        Section.of_blocks("sensors", "Sensors", [tables.sensors(q)]),
        Section.of_blocks("tests", "Test cases as run", _as_run(q), "Test cases"),
        Section.of_blocks(
            "power",
            "Boundaries, power, heater duty, heat leaks",
            [tables.boundaries(q), *_leaks(q), *tables.duties(q)],
            "Boundaries and power",
        ),
        Section.of_blocks("stabilisation", "Stabilisation", _stabilisation(q)),
        Section.of_blocks("predicted", "Pre-test predictions and measurements", predictions, "Predictions and readings"),
        Section.of_blocks("heat", "Heat flows and energy balance", _heat(q), "Heat flows"),
        Section.of_blocks("parameters", "Parameter changes", [tables.changes(q)] if q.knowledge.values else [Words("Nothing was fitted.")]),
        Section.of_blocks("deviations", "Deviations after correlation", _deviations(logged), "Deviations"),
        Section.of_blocks("overlays", "Transient overlays", transients or [Words("There is no log yet.")], "Overlays"),
        Section.of_blocks("excluded", "Excluded sensors", [tables.excluded(q)] if content.exclusions.reasons else [Words("None.")]),
        Section.of_blocks("discrepancies", "Remaining discrepancies", _open(q), "Discrepancies"),
        Section.of_blocks(
            "margins",
            "Uncertainty, limits and margins",
            [
                tables.margin_table(q),
                Heading("Contributions to the uncertainty"),
                tables.counted(q),
                Heading("Predictions of the service cases"),
                tables.service(q),
                folded("All limits in all tests", [tables.checks(q)]),
            ],
            "Margins",
        ),
        Section.of_blocks("validity", "Validity envelope", [*_envelope(q), tables.outside(q)]),
        Section.of_blocks("assumptions", "Assumed values by their effect", _assumed(q), "Assumptions"),
        Section.of_blocks("delivery", "Model delivery", [_delivery(q), versions(), folded("Files", [_files(q)], "each with its hash")]),
    ]


def _criteria(q: Qualification) -> Table:
    """Return the table of the sets of criteria that the tests use: their limits [K] and sources."""
    used = dict.fromkeys(n for t in q.plan.tests for n in t.criteria)
    shown = dict.fromkeys(("mean", "spread", "each", "rmse", *(key for name in used for key in q.plan.criteria[name].limits)))
    columns = [Head("set"), *(Head(f"{heading(key)}, K", True) for key in shown), Head("for"), Head("mark"), Head("source", wrapped=True)]
    rows: list[Line] = []
    for name in used:
        c = q.plan.criteria[name]
        sizes = [number(c.limits[key]) if key in c.limits else DASH for key in shown]
        rows.append([Cell(name, "", "main"), *sizes, ", ".join(c.kinds), mark(c.mark), c.source or DASH])
    return Table.of_rows(columns, rows)


def _configuration(q: Qualification) -> list[PageBlock]:
    """Return the blocks on the unit as tested and as flown: differences and size of the model."""
    configuration = q.plan.content.configuration
    rows: list[Line] = [[d.what, d.effect or DASH] for d in configuration.differences]
    flat = Flat.of_model(q.knowledge.model)
    size = (("model", q.knowledge.model.title), ("nodes", str(len(flat.nodes))), ("conductors", str(len(flat.conductors))))
    table = Table.of_rows([Head("difference", wrapped=True), Head("effect", wrapped=True)], rows)
    return [
        Facts((("as tested", configuration.as_tested or DASH), ("as flown", configuration.as_flown or DASH), *size)),
        table if rows else Words("No differences stated."),
    ]


def _as_run(q: Qualification) -> list[PageBlock]:
    """Return the blocks on every test as it was run: host, orientation, gravity, deviations, log."""
    rows: list[Line] = []
    for t in q.trials:
        deviations = "; ".join(t.test.deviations) or ("none stated" if t.correlation is not None else DASH)
        log = Cell("SYNTHETIC", t.log_sha256, "bad") if t.synthetic else Cell(t.log_sha256[:12] or DASH, t.log_sha256, "code")
        where = [t.test.host or "alone", t.test.orientation or DASH, t.test.gravity or DASH]
        rows.append([Cell(t.test.name, "", "main"), t.test.purpose or DASH, t.test.state, t.test.date or DASH, *where, deviations, log])
    return [
        Table.of_rows(
            [
                Head("test"),
                Head("purpose", wrapped=True),
                Head("state"),
                Head("date"),
                Head("on"),
                Head("orientation"),
                Head("gravity"),
                Head("as-run deviations", wrapped=True),
                Head("log"),
            ],
            rows,
        )
    ]


def _leaks(q: Qualification) -> list[PageBlock]:
    """Return the blocks on heat through what is there for the test only. [W]"""
    rows: list[Line] = []
    for t in q.trials:
        deck = q.plan.content.hosts[t.test.host].deck if t.test.host else ""
        test_conductors = {p: c for p, c in t.knowledge.model.conductors.items() if c.test_only}
        flows = t.foresight.solution.heat_flows
        means = [f"{path}: {float(flows[path].mean()):+.3f} W on average" for path in test_conductors if path in flows]
        stated = "; ".join(f"{k} ± {v}" for k, v in t.test.spread.items())
        rows.append([Cell(t.test.name, deck, "main"), stated or DASH, "; ".join([*t.test.heat_leaks, *means]) or "none stated"])
    return [
        Table.of_rows(
            [
                Head("test"),
                Head("uncertain inputs", wrapped=True),
                Head("heat leaks of the test", wrapped=True),
            ],
            rows,
        )
    ]


def _stabilisation(q: Qualification) -> list[PageBlock]:
    """Return for each test with a profile how long it waited, and how far from steady state a dwell begins. [K]"""
    out: list[PageBlock] = []
    for t, course in [(t, t.course) for t in q.trials if t.course is not None]:
        waited = f"{hours(course.duration)}, of it {hours(course.waited)} waiting for the unit"
        unfinished = max((abs(p.unfinished) for p in course.phases if p.rule and p.unfinished is not None), default=0.0)
        out.append(
            folded(f"{t.test.name}: {waited}", [tables.phases(t)], f"at most {unfinished:.1f} K from steady state when a dwell begins")
        )
        out += [Notes(course.remarks, f"Remarks on {t.test.name}")] if course.remarks else []
    for t in (t for t in q.trials if t.settled):
        held = f"{sum(s.stable for s in t.settled)} of {counted(len(t.settled), 'period')} steady by the rule"
        out.append(folded(f"{t.test.name}: as measured", [tables.settled(t)], held))
    return out or [Words("No test of this plan waits for its unit, and no steady period was logged.")]


def _heat(q: Qualification) -> list[PageBlock]:
    """Return the heat balance of each test. [kJ]"""
    out: list[PageBlock] = []
    for t in q.trials:
        b = t.foresight.solution.heat_balance()
        balance = f"loads {number(b.loads / 1e3)} kJ, to boundaries {number(b.boundaries / 1e3)} kJ, stored {number(b.stored / 1e3)} kJ"
        out.append(folded(t.test.name, [Words(f"{balance}; residual: {b.relative:.1e} of it."), tables.flows(t)]))
    return out


def _deviations(logged: Sequence[tuple[Trial, Correlation]]) -> list[PageBlock]:
    """Return for each test with a log its verdicts and deviations, sensor by sensor."""
    out: list[PageBlock] = []
    for t, c in logged:
        out.append(Heading(t.test.name))
        out.append(Facts(tuple((name, VERDICTS[passed]) for name, passed in c.verdicts.items())))
        if c.failed:
            out.append(tables.gates(c, failed_only=True))
        if t.diagnosis is not None:
            out += [Words(f"{capitalised(str(t.diagnosis).splitlines()[0])}."), tables.diagnoses(t)]
        out += [folded("Every sensor", [tables.deviations(c)]), folded("Every gate", [tables.gates(c)], f"{len(c.gates)}")]
    return out or [Words("There is no log yet.")]


def _open(q: Qualification) -> list[PageBlock]:
    """Return the blocks on what is not settled: discrepancies that the plan states, and faults that would explain a failed test."""
    discrepancies = [*q.plan.content.discrepancies]
    discrepancies += [
        f"{t.test.name}: {t.diagnosis.best.text} would explain {100 * t.diagnosis.best.explained:.0f} % ({t.diagnosis.group})"
        + ("" if t.diagnosis.single else "; no single fault explains most of it")
        for t in q.trials
        if t.diagnosis is not None and t.diagnosis.best is not None
    ]
    return [Notes(tuple(discrepancies), "Open")] if discrepancies else [Words("None stated and none found.")]


def _envelope(q: Qualification) -> list[PageBlock]:
    """Return the table of the ranges in which the model holds."""
    v = q.plan.content.validity
    pairs = [
        ("temperature", v.temperature),
        ("pressure", v.pressure),
        ("power", v.power),
        ("gravity", v.gravity),
        ("orientation", v.orientation),
    ]
    rows = tuple((name, " .. ".join(values) if name != "orientation" else ", ".join(values)) for name, values in pairs if values)
    return [Facts(rows or (("calibrated", "the plan does not state where"),)), *([Words(f"By: {v.basis}.")] if v.basis else [])]


def _assumed(q: Qualification) -> list[PageBlock]:
    """Return the assumed values: the first twelve, and all folded."""
    if not q.assumptions:
        return [Words("Nothing is assumed: every value of the decks has another source.")]
    whole = tables.assumed(q)
    few = Table(whole.columns, whole.rows[:12], whole.caption)
    return [few, *([folded("All of them", [whole], f"{len(whole.rows)} values")] if len(whole.rows) > 12 else [])]


def _delivery(q: Qualification) -> Table:
    """Return the table of what is delivered: model, identity, sizes, plan, lock, fitted values."""
    model = q.knowledge.model
    flat = Flat.of_model(model)
    sizes = f"{len(flat.nodes)}, {len(flat.conductors)}, {len(flat.loads)}"
    rows: list[Line] = [["model", model.title], ["identity", Cell(model.identity(), "hash of the model's content", "code")]]
    rows += [["nodes, conductors, loads", sizes], ["plan", Cell(q.lock.sha256[:16], q.lock.sha256, "code")], ["lock", str(q.lock)]]
    for v in q.knowledge.values:
        rows.append([f"values of {v.stage}", f"{len(v.parameters)} fitted, {v.provenance.get('date', DASH)}"])
    rows.append(["runs", ", ".join(t.test.name for t in q.trials)])
    return Table.of_rows([Head("what"), Head("is", wrapped=True)], rows)


def _files(q: Qualification) -> Table:
    """Return the files that the plan rests on and the logs that came back, each with the hash of what was read."""
    rows: list[Line] = [[name, "plan", Cell(sha[:16], sha, "code")] for name, sha in sorted(q.plan.files.items())]
    rows += [
        [t.test.log.file, f"log of {t.test.name}", Cell(t.log_sha256[:16], t.log_sha256, "code")]
        for t in q.trials
        if t.test.log is not None
    ]
    note = "First digits of the SHA-256: for a deck of the plan of its content, for a log of its samples, for any other file of its bytes."
    return Table.of_rows([Head("file"), Head("of"), Head("hash")], rows, note)


def all_overlays(c: Correlation, key: str, synthetic: bool) -> Figures:
    """Return the readings of every sensor over what is simulated in their place."""
    drawn = [
        (
            o,
            compared(o.times, o.measured, o.simulated, f"{key}-{k}", f"{o.sensor} in {o.case}", wide=tables.half_width(o)),
        )
        for k, o in enumerate(c.overlays)
    ]
    tag = SYNTHETIC if synthetic else ""
    return Figures(
        tuple(Plot(d, f"{o.sensor} in {o.case}" + (f", at {o.node}" if o.node else ""), tag) for o, d in drawn), drawn[0][1].legend
    )


LOOKS = {"operating": "bound", "non-operating": "bound off", "start-up": "bound start"}


def course(t: Trial, key: str) -> Graphic | None:
    """Return the worst part of a test over time, and its limits where their state holds; None without a limit.

    The lines are what was held against the limits: the prediction with its 95 % interval, or the readings with what is simulated from the
    inputs of the log.
    """
    worst = t.worst
    if worst is None:
        return None
    read = [o for o in t.correlation.overlays if o.node == worst.node] if t.correlation is not None and worst.by == "measured" else []
    if read:  # beside readings stands what the criteria compared them with, not the chamber that was planned
        interval = None
        lines = [curve("simulated, inputs as logged", "simulated", o.times, o.simulated - ICE_POINT) for o in read]
        lines += [curve("measured", "measured", o.times, o.measured - ICE_POINT) for o in read]
    else:
        band = t.foresight.prediction[worst.node]
        interval = Area("95 % interval", band.times, *band.interval())
        lines = [curve("simulated", "simulated", band.times, band.simulated - ICE_POINT)]
    lines += [line for one in t.limits if one.point == worst.point for line in _limits(t, one)]
    return curves(lines, key, f"{worst.point} in {t.test.name}", band=interval, size=(440, 240))


def _limits(t: Trial, one: Limits) -> Iterator[Stroke]:
    """Yield the limits of a point as lines over the stretches in which their state holds."""
    for s in spans(t.foresight.solution, one, "operating" if t.test.operating else "non-operating"):
        ends = np.array([s.start, s.end])
        for limit in (x for x in s.limits if np.isfinite(x)):
            yield curve(f"limit, {s.state}", LOOKS[s.state], ends, np.full(2, limit - ICE_POINT))
