"""The sections of a qualification report, in the order in which a correlation report is read."""

from __future__ import annotations

from collections.abc import Sequence

from thermid.judge.correlation import Correlation
from thermid.judge.criteria import heading
from thermid.model.tree.flat import flatten
from thermid.qualify.programme import Qualification
from thermid.qualify.trial import Trial
from thermid.reporting.blocks.cells import DASH, Cell, Head, Line, Table, number
from thermid.reporting.blocks.sections import Block, Facts, Figures, Heading, Notes, Plot, Section, Words, folded
from thermid.reporting.pages.origins import versions
from thermid.reporting.qualification import judged, tables
from thermid.reporting.qualification.cells import hours, mark
from thermid.reporting.qualification.figures import overlay
from thermid.sourced import VERDICTS

SYNTHETIC = "synthetic"


def sections(q: Qualification) -> list[Section]:
    """Return the sections of a correlation report, in their order."""
    content = q.plan.content
    logged = [t for t in q.trials if t.correlation is not None]
    objectives = [Notes(tuple(content.objectives), "Objectives"), Notes(tuple(content.success), "Success criteria")]
    return [
        Section.of("objectives", "Objectives and success criteria", [*objectives, folded("Criteria, with their sources", [_criteria(q)])]),
        Section.of("configuration", "Article and model configuration", _configuration(q), "Configuration"),
        Section.of("sensors", "Sensors", [tables.sensors(q)]),
        Section.of("tests", "Test cases as run", _as_run(q), "Test cases"),
        Section.of(
            "power",
            "Boundaries, power, heater duty, heat leaks",
            [tables.boundaries(q), *_leaks(q), *tables.duties(q)],
            "Boundaries and power",
        ),
        Section.of("stabilisation", "Stabilisation", _stabilisation(q)),
        Section.of("predicted", "Pre-test predictions and measurements", _foreseen(q), "Predictions and readings"),
        Section.of("heat", "Heat flows and energy balance", _heat(q), "Heat flows"),
        Section.of("parameters", "Parameter changes", [tables.changes(q)] if q.known.values else [Words("Nothing was fitted.")]),
        Section.of("deviations", "Deviations after correlation", _deviations(logged), "Deviations"),
        Section.of("overlays", "Transient overlays", _transients(logged), "Overlays"),
        Section.of("excluded", "Excluded sensors", [judged.excluded(q)] if content.exclusions.reasons else [Words("None.")]),
        Section.of("discrepancies", "Remaining discrepancies", _open(q), "Discrepancies"),
        Section.of(
            "margins",
            "Uncertainty, limits and margins",
            [
                judged.margin_table(q),
                Heading("What the uncertainty holds"),
                judged.counted(q),
                Heading("Predictions of the service cases"),
                judged.service(q),
                folded("Every limit in every test", [judged.checks(q)]),
            ],
            "Margins",
        ),
        Section.of("validity", "Validity envelope", [*_envelope(q), judged.outside(q)]),
        Section.of("assumptions", "What is assumed, by its effect", _assumed(q), "Assumptions"),
        Section.of("delivery", "Model delivery", [_delivery(q), versions(), folded("Files", [_files(q)], "each with its hash")]),
    ]


def _criteria(q: Qualification) -> Table:
    used = dict.fromkeys(n for t in q.plan.tests for n in t.criteria)
    shown = dict.fromkeys(("mean", "spread", "each", "rmse", *(key for name in used for key in q.plan.criteria[name].limits)))
    columns = [Head("set"), *(Head(f"{heading(key)}, K", True) for key in shown)]
    columns += [Head("for"), Head("mark"), Head("source", wrapped=True)]
    rows: list[Line] = []
    for name in used:
        c = q.plan.criteria[name]
        sizes = [number(c.limits[key], 3) if key in c.limits else DASH for key in shown]
        rows.append([Cell(name, "", "main"), *sizes, ", ".join(c.kinds), mark(c.mark), c.source or DASH])
    return Table.of(columns, rows)


def _configuration(q: Qualification) -> list[Block | Table]:
    given = q.plan.content.configuration
    rows: list[Line] = [[d.what, d.effect or DASH] for d in given.differences]
    flat = flatten(q.known.model)
    size = (("model", q.known.model.title), ("nodes", str(len(flat.nodes))), ("conductors", str(len(flat.conductors))))
    table = Table.of([Head("difference", wrapped=True), Head("effect", wrapped=True)], rows)
    return [
        Facts((("as tested", given.as_tested or DASH), ("as flown", given.as_flown or DASH), *size)),
        table if rows else Words("No differences stated."),
    ]


def _as_run(q: Qualification) -> list[Block | Table]:
    rows: list[Line] = []
    for t in q.trials:
        deviations = "; ".join(t.test.deviations) or ("none stated" if t.correlation is not None else DASH)
        log = Cell("SYNTHETIC", t.log_sha256, "bad") if t.synthetic else Cell(t.log_sha256[:12] or DASH, t.log_sha256, "code")
        where = [t.test.host or "alone", t.test.orientation or DASH, t.test.gravity or DASH]
        rows.append([Cell(t.test.name, "", "main"), t.test.purpose or DASH, t.test.state, t.test.date or DASH, *where, deviations, log])
    columns = [
        Head("test"),
        Head("purpose", wrapped=True),
        Head("state"),
        Head("date"),
        Head("on"),
        Head("orientation"),
        Head("gravity"),
    ]
    return [Table.of([*columns, Head("as-run deviations", wrapped=True), Head("log")], rows)]


def _leaks(q: Qualification) -> list[Block | Table]:
    rows: list[Line] = []
    for t in q.trials:
        given = q.plan.content.hosts[t.test.host].deck if t.test.host else ""
        own = {p: c for p, c in t.known.model.conductors.items() if c.test_only}
        flows = t.foresight.solution.heat_flows
        means = [f"{path}: {float(flows[path].mean()):+.3f} W on average" for path in own if path in flows]
        stated = "; ".join(f"{k} ± {v}" for k, v in t.test.spread.items())
        rows.append([Cell(t.test.name, given, "main"), stated or DASH, "; ".join([*t.test.heat_leaks, *means]) or "none stated"])
    return [
        Table.of(
            [
                Head("test"),
                Head("what is not known exactly", wrapped=True),
                Head("heat leaks of the test", wrapped=True),
            ],
            rows,
        )
    ]


def _stabilisation(q: Qualification) -> list[Block | Table]:
    out: list[Block | Table] = []
    for t in (t for t in q.trials if t.course is not None):
        assert t.course is not None
        waited = f"{hours(t.course.duration)}, of it {hours(t.course.waited)} of waiting for the unit"
        left = max((abs(p.unfinished) for p in t.course.phases if p.rule and p.unfinished is not None), default=0.0)
        out.append(folded(f"{t.test.name}: {waited}", [tables.phases(t)], f"at most {left:.1f} K unfinished when a dwell begins"))
        out += [Notes(t.course.remarks, f"Remarks on {t.test.name}")] if t.course.remarks else []
    for t in (t for t in q.trials if t.settled):
        held = sum(s.stable for s in t.settled)
        out.append(folded(f"{t.test.name}: as measured", [judged.settled(t)], f"{held} of {len(t.settled)} stretches settled by the rule"))
    return out or [Words("No test of this plan waits for its unit, and no settled stretch was logged.")]


def _foreseen(q: Qualification) -> list[Block | Table]:
    return [folded(t.test.name, [tables.foreseen(q, t)], "with readings" if t.correlation is not None else "no log yet") for t in q.trials]


def _heat(q: Qualification) -> list[Block | Table]:
    out: list[Block | Table] = []
    for t in q.trials:
        b = t.foresight.solution.heat_balance()
        told = (
            f"loads {number(b.loads / 1e3, 4)} kJ, to boundaries {number(b.boundaries / 1e3, 4)} kJ, stored {number(b.stored / 1e3, 4)} kJ"
        )
        out.append(folded(t.test.name, [Words(f"{told}; what does not add up: {b.relative:.1e} of it."), tables.flows(t)]))
    return out


def _deviations(logged: Sequence[Trial]) -> list[Block | Table]:
    out: list[Block | Table] = []
    for t in logged:
        c = t.correlation
        assert c is not None
        out.append(Heading(t.test.name))
        out.append(Facts(tuple((name, VERDICTS[passed]) for name, passed in c.verdicts.items())))
        if c.failed:
            out.append(judged.gates(c, failed_only=True))
        if t.diagnosis is not None:
            out += [Words(str(t.diagnosis).splitlines()[0][0].upper() + str(t.diagnosis).splitlines()[0][1:] + "."), judged.diagnoses(t)]
        out += [folded("Every sensor", [judged.deviations(c)]), folded("Every gate", [judged.gates(c)], f"{len(c.gates)}")]
    return out or [Words("No log has come back yet.")]


def _transients(logged: Sequence[Trial]) -> list[Block | Table]:
    out: list[Block | Table] = []
    for k, t in enumerate(logged):
        assert t.correlation is not None
        out += [Heading(t.test.name), all_overlays(t.correlation, f"over-{k}", t.synthetic)]
    return out or [Words("No log has come back yet.")]


def _open(q: Qualification) -> list[Block | Table]:
    found = [*q.plan.content.discrepancies]
    found += [
        f"{t.test.name}: {t.diagnosis.best.text} would explain {100 * t.diagnosis.best.explained:.0f} % ({t.diagnosis.group})"
        + ("" if t.diagnosis.single else "; no single fault explains most of it")
        for t in q.trials
        if t.diagnosis is not None and t.diagnosis.best is not None
    ]
    return [Notes(tuple(found), "Open")] if found else [Words("None stated and none found.")]


def _envelope(q: Qualification) -> list[Block | Table]:
    v = q.plan.content.validity
    pairs = [
        ("temperature", v.temperature),
        ("pressure", v.pressure),
        ("power", v.power),
        ("gravity", v.gravity),
        ("orientation", v.orientation),
    ]
    said = tuple((name, " .. ".join(given) if name != "orientation" else ", ".join(given)) for name, given in pairs if given)
    return [Facts(said or (("calibrated", "the plan does not say where"),)), *([Words(f"By: {v.basis}.")] if v.basis else [])]


def _assumed(q: Qualification) -> list[Block | Table]:
    if not q.assumptions:
        return [Words("Nothing is assumed: every value of the decks has another source.")]
    whole = judged.assumed(q)
    few = Table(whole.columns, whole.rows[:12], whole.caption)
    return [few, *([folded("All of them", [whole], f"{len(whole.rows)} values")] if len(whole.rows) > 12 else [])]


def _delivery(q: Qualification) -> Table:
    model = q.known.model
    flat = flatten(model)
    sizes = f"{len(flat.nodes)}, {len(flat.conductors)}, {len(flat.loads)}"
    rows: list[Line] = [["model", model.title], ["identity", Cell(model.identity(), "hash of what the model means", "code")]]
    rows += [["nodes, conductors, loads", sizes], ["plan", Cell(q.lock.sha256[:16], q.lock.sha256, "code")], ["lock", str(q.lock)]]
    for v in q.known.values:
        rows.append([f"values of {v.stage}", f"{len(v.parameters)} fitted, {v.provenance.get('date', DASH)}"])
    rows.append(["runs", ", ".join(t.test.name for t in q.trials)])
    return Table.of([Head("what"), Head("is", wrapped=True)], rows)


def _files(q: Qualification) -> Table:
    """Return the files that the plan rests on and the logs that came back, each with the hash of what was read."""
    rows: list[Line] = [[name, "plan", Cell(sha[:16], sha, "code")] for name, sha in sorted(q.plan.files.items())]
    rows += [
        [t.test.log.file, f"log of {t.test.name}", Cell(t.log_sha256[:16], t.log_sha256, "code")]
        for t in q.trials
        if t.test.log is not None
    ]
    note = (
        "SHA-256, its beginning: of a deck of the plan, of what its model means; of a log, of its samples; of any other file, of its bytes."
    )
    return Table.of([Head("file"), Head("of"), Head("hash")], rows, note)


def all_overlays(c: Correlation, key: str, synthetic: bool) -> Figures:
    """Return the readings of every sensor over what is simulated in their place."""
    drawn = [(o, overlay(o, f"{key}-{k}", f"{o.sensor} in {o.case}")) for k, o in enumerate(c.overlays)]
    tag = SYNTHETIC if synthetic else ""
    return Figures(
        tuple(Plot(d, f"{o.sensor} in {o.case}" + (f", at {o.node}" if o.node else ""), tag) for o, d in drawn), drawn[0][1].legend
    )
