"""Tables of a qualification report: tests, limits, margins, deviations, gates, parameters, assumptions."""

from __future__ import annotations

import fnmatch
import math

import numpy as np

from thermid.physics.constants import ICE_POINT
from thermid.qualify.correlation import Correlation
from thermid.qualify.marks import MARKS
from thermid.qualify.programme import Qualification
from thermid.qualify.trial import Trial
from thermid.qualify.trying import sensors_of
from thermid.reporting.cells import DASH, Cell, Column, Line, Table, absolute, number, plain, pretty, signed, significant
from thermid.reporting.sections import Block, as_block, folded

__all__ = ["assumed", "changes", "checks", "deviations", "diagnoses", "duties", "excluded", "flows", "foreseen", "gates", "margin_table"]
__all__ += ["outside", "phases", "sensors", "tests", "verdict"]


def verdict(passed: bool | None, why: str = "") -> Cell:
    """Return a verdict as a cell, why it is not decided behind it."""
    if passed is None:
        return Cell("not decided", why, "warn")
    return Cell("✓ met", "", "good") if passed else Cell("✗ not met", "", "bad")


def celsius(kelvin: float, decimals: int = 1) -> str:
    """Return a temperature in degrees Celsius; a dash where there is none."""
    return f"{kelvin - ICE_POINT:.{decimals}f}" if math.isfinite(kelvin) else DASH


def hours(seconds: float) -> str:
    """Return a time in hours, in minutes below two."""
    return f"{seconds / 3600:.2f} h" if seconds >= 7200 else f"{seconds / 60:.1f} min"


def tests(q: Qualification) -> Table:
    """Return the tests: kind, state, course, criteria, limits and correlation."""
    columns = [Column("test"), Column("limits"), Column("correlation"), Column("nearest to a limit"), Column("at", True)]
    columns += [Column("room, K", True), Column("state"), Column("lasts", True), Column("course and its trust", wrapped=True)]
    rows: list[Line] = []
    for t in q.trials:
        course = t.course.profile.title if t.course is not None else t.foresight.scenario.title
        trust = f": {t.course.trust}" if t.course is not None else ""
        worst, why = t.worst, "; ".join(t.open)
        where = [Cell(DASH), Cell(DASH), Cell(DASH)]
        if worst is not None:
            hot = worst.limits[1] - worst.highest <= worst.lowest - worst.limits[0]
            where = [Cell(f"{worst.point}, {worst.state}"), Cell(hours(worst.highest_time if hot else worst.lowest_time))]
            where.append(Cell(f"{worst.room:.1f}", "", "bad" if worst.room < 0 else "main"))
        judged = verdict(t.correlated, why) if t.correlation is not None else _no_log(t)
        length = hours(float(t.foresight.solution.times[-1]))
        rows.append(
            [
                Cell(t.test.name, t.test.purpose, "main"),
                verdict(t.within, why),
                judged,
                *where,
                t.test.state,
                length,
                course + trust,
            ]
        )
    return Table.of(columns, rows)


def _no_log(t: Trial) -> Cell:
    if t.test.state == "waived":
        return Cell("waived", t.test.note, "warn")
    return Cell("not decided: no log", "", "warn") if t.test.criteria else Cell("analysis", "", "soft")


def sensors(q: Qualification) -> Table:
    """Return the sensors: node, place, reason, accuracy, certificate."""
    columns = [Column("sensor"), Column("model node"), Column("place"), Column("why there", wrapped=True), Column("accuracy")]
    columns += [Column("noise"), Column("certificate", wrapped=True)]
    rows: list[Line] = [
        [
            Cell(n, "", "main"),
            s.node,
            s.location or DASH,
            s.reason,
            f"± {s.accuracy}" if s.accuracy else DASH,
            s.noise or DASH,
            s.certificate or DASH,
        ]
        for n, s in q.plan.content.sensors.items()
    ]
    return Table.of(columns, rows, "Accuracy: standard deviation of the constant error.")


def duties(q: Qualification) -> list[Block]:
    """Return the duty of every heater with its margin, and the power of every load per test."""
    out: list[Block] = []
    columns = [Column("test"), Column("heater"), Column("full power, W", True), Column("duty, %", True), Column("at most, %", True)]
    rows: list[Line] = [
        [
            Cell(t.test.name, "", "main"),
            h.load,
            number(h.full, 3),
            f"{100 * h.duty:.0f}",
            f"{100 * h.most:.0f}",
            f"[{h.rule.mark}]",
            verdict(h.passed),
        ]
        for t in q.trials
        for h in t.heaters
    ]
    if rows:
        out.append(as_block(Table.of([*columns, Column("mark"), Column("result")], rows, "At most: what leaves the power margin.")))
    for t in q.trials:
        times = t.foresight.solution.times
        lines: list[Line] = []
        for load, watts in t.foresight.solution.load_powers.items():
            w = np.broadcast_to(watts, times.shape)
            said = t.test.spread.get(f"scale.{load}", t.test.spread.get(f"{load}.power", DASH))
            if w.any():
                lines.append([load, number(float(np.trapezoid(w, times) / times[-1]), 3), number(float(w.max()), 3), said])
        if lines:
            heads = [Column("load"), Column("mean, W", True), Column("largest, W", True), Column("stated ±")]
            total = sum(float(np.max(w)) for w in t.foresight.solution.load_powers.values())
            out.append(folded(f"Power in {t.test.name}", [Table.of(heads, lines)], f"{len(lines)} loads, at most {total:.4g} W together"))
    return out


def phases(t: Trial) -> Table:
    """Return the phases of a course: what was waited for, the slowest part, what the rule left unfinished."""
    columns = [
        Column("at", True),
        Column("for", True),
        Column("cycle", True),
        Column("phase", wrapped=True),
        Column("unit"),
        Column("chamber, °C", True),
    ]
    columns += [Column("rule"), Column("slowest part"), Column("rate, K/h", True), Column("furthest from rest"), Column("left, K", True)]
    rows: list[Line] = []
    for p in t.course.phases if t.course is not None else ():
        name = f"{p.name}, wait" if p.kind == "wait" else p.name
        rate = signed(3600 * p.rate, 2) if p.rule else DASH
        left = signed(p.unfinished, 2) if p.unfinished is not None else DASH
        span = [hours(p.start), hours(p.duration), str(p.cycle) if p.cycle else DASH]
        rows.append(
            [*span, name, "on" if p.power else "off", celsius(p.chamber), p.rule or DASH, p.slowest or DASH, rate, p.furthest or DASH, left]
        )
    return Table.of(columns, rows)


def foreseen(q: Qualification, t: Trial) -> Table:
    """Return the pre-test predictions of a test per sensor, and what was measured where its log has come back."""
    columns = [
        Column("sensor"),
        Column("lowest, °C", True),
        Column("measured", True),
        Column("highest, °C", True),
        Column("measured", True),
    ]
    columns += [Column("last, °C", True), Column("measured", True), Column("outside 95 %")]
    seen = {o.sensor: o for o in t.correlation.overlays} if t.correlation is not None else {}
    rows: list[Line] = []
    for sensor, (node, _) in sensors_of(q.plan, t.test).items():
        band, o = t.foresight.prediction[node], seen.get(sensor)
        cells: list[Cell | str] = [Cell(sensor, node, "main")]
        beyond = []
        for word, k in (("lowest", int(band.kelvin.argmin())), ("highest", int(band.kelvin.argmax())), ("last", -1)):
            error = 1.96 * float(band.error[k])
            cells.append(f"{celsius(float(band.kelvin[k]))} ± {error:.1f}")
            if o is None:
                cells.append(DASH)
                continue
            found = float({"lowest": o.measured.min(), "highest": o.measured.max(), "last": o.measured[-1]}[word])
            wide = math.hypot(error, 1.96 * math.hypot(o.accuracy, o.noise))
            off = abs(found - float(band.kelvin[k])) > wide
            beyond += [word] if off else []
            cells.append(Cell(celsius(found), f"{found - float(band.kelvin[k]):+.2f} K", "warn" if off else ""))
        rows.append([*cells, Cell(", ".join(beyond), "", "warn") if beyond else ("none" if o is not None else DASH)])
    return Table.of(
        columns, rows, "± 95 % of the model's values and of what is stated of the test; outside: with the sensor's own error added."
    )


def flows(t: Trial) -> Table:
    """Return the largest mean heat flows of a test, test-only paths marked."""
    run = t.foresight.solution
    length = float(run.times[-1])
    means = {c: float(np.trapezoid(w, run.times) / length) for c, w in run.heat_flows.items()}
    ranked = sorted(means.items(), key=lambda item: -abs(item[1]))[:14]
    rows: list[Line] = [[c, signed(w, 3), signed(float(run.heat_flows[c][-1]), 3)] for c, w in ranked]
    return Table.of(
        [Column("path"), Column("mean, W", True), Column("at the end, W", True)], rows, "Positive from its first end to its second."
    )


def changes(q: Qualification) -> Table:
    """Return what was fitted: before, after, error, bound, reason."""
    columns = [
        Column("parameter"),
        Column("before", True),
        Column("after", True),
        Column("±", True),
        Column("unit"),
        Column("bounds", True),
    ]
    columns += [Column("why it may be so", wrapped=True)]
    reasons, rows = q.plan.content.model.reasons, []
    for several in q.known.values:
        for path, v in several.parameters.items():
            why = next((text for pattern, text in reasons.items() if fnmatch.fnmatchcase(path, pattern)), "")
            low, high = (plain(absolute(v, b), 4) if math.isfinite(b) else "" for b in v.bounds)
            line: Line = [Cell(path, v.origin, "main"), plain(absolute(v, v.start), 5), significant(v.in_unit, v.shown(v.error))]
            rows.append(
                [
                    *line,
                    number(v.shown(v.error), 2),
                    pretty(v.unit),
                    f"{low} .. {high}",
                    Cell(why) if why else Cell("no reason given", "", "warn"),
                ]
            )
    return Table.of(columns, rows)


def deviations(c: Correlation) -> Table:
    """Return mean, spread and largest deviation per sensor and case."""
    columns = [Column("sensor"), Column("case", wrapped=True), Column("kind"), Column("readings", True), Column("measured, °C", True)]
    columns += [
        Column("mean, K", True),
        Column("spread, K", True),
        Column("largest, K", True),
        Column("RMSE, K", True),
        Column("± sensor, K", True),
    ]
    columns += [Column("weight", True), Column("left out", wrapped=True)]
    rows: list[Line] = [
        [
            Cell(d.sensor, "", "main"),
            *(
                d.case,
                d.kind,
                str(d.samples),
                celsius(d.measured),
                signed(d.mean, 2),
                f"{d.spread:.2f}",
                signed(d.largest, 2),
                f"{d.rmse:.2f}",
            ),
            *(
                number(1.96 * d.accuracy, 2) if d.accuracy else DASH,
                plain(d.weight, 3),
                Cell(d.excluded or DASH, "", "warn" if d.excluded else ""),
            ),
        ]
        for d in c.deviations
    ]
    return Table.of(columns, rows, "Measured less simulated; ± sensor: 95 % of its constant error.")


def gates(c: Correlation, failed_only: bool = False) -> Table:
    """Return every gate of every set of criteria, or those that are not met."""
    columns = [
        Column("criteria"),
        Column("case", wrapped=True),
        Column("kind"),
        Column("gate"),
        Column("found, K", True),
        Column("limit, K", True),
    ]
    columns += [Column("mark"), Column("worst sensor"), Column("outside", True), Column("result")]
    words = {"mean": "mean over sensors", "spread": "spread over sensors", "each": "every sensor", "rmse": "RMSE of every sensor"}
    rows: list[Line] = [
        [
            Cell(g.criteria, "", "main"),
            *(g.case, g.kind, words[g.name], f"{g.found:.2f}", plain(g.limit, 3), Cell(g.mark, MARKS[g.mark]), g.worst or DASH),
            *(Cell(f"{len(g.outside)} of {g.counted}", ", ".join(g.outside)), verdict(g.passed)),
        ]
        for g in c.gates
        if not failed_only or g.passed is False
    ]
    return Table.of(columns, rows)


def diagnoses(t: Trial) -> Table:
    """Return what would explain a test's deviations, the likeliest first."""
    columns = [Column("fault"), Column("group"), Column("probability, %", True), Column("explains, %", True), Column("leaves, K", True)]
    found = t.diagnosis.suspects[:6] if t.diagnosis is not None else ()
    rows: list[Line] = [
        [Cell(s.text, "", "main"), s.group, f"{100 * s.probability:.0f}", f"{100 * s.explained:.0f}", f"{s.left:.2f}"] for s in found
    ]
    return Table.of(columns, rows, "Each fault tried by itself; explains: part of the weighted squares.")


def excluded(q: Qualification) -> Table:
    """Return the sensors that do not count, and why."""
    rows: list[Line] = [[Cell(s, "", "main"), why] for s, why in q.plan.content.exclusions.reasons.items()]
    cap = f"At most {100 * q.plan.content.exclusions.cap:g} % of the sensors of a test may be left out."
    return Table.of([Column("sensor"), Column("why", wrapped=True)], rows, cap)


def checks(q: Qualification) -> Table:
    """Return every reference point in every test and state against its limits, crossings with their times."""
    columns = [Column("test"), Column("reference point"), Column("state"), Column("by")]
    columns += [Column("lowest, °C", True), Column("highest, °C", True)]
    columns += [
        Column("limits, °C", True),
        Column("room, K", True),
        Column("first passed", True),
        Column("beyond for", True),
        Column("mark"),
    ]
    columns += [Column("result")]
    rows: list[Line] = []
    for t in q.trials:
        for k, c in enumerate(t.checks):
            head = Cell(t.test.name, "", "main") if k == 0 else Cell("", "", "same")
            first = min((x.time for x in c.crossings), default=math.nan)
            beyond = sum(x.outside for x in c.crossings)
            ends = f"{celsius(c.limits[0], 0)} .. {celsius(c.limits[1], 0)}"
            room = Cell(f"{c.room:.1f}" if math.isfinite(c.room) else DASH, "", "bad" if c.room < 0 else "")
            times = [hours(first), hours(beyond)] if c.crossings else [DASH, DASH]
            lowest, highest = (Cell(celsius(v), f"at {hours(at)}") for v, at in ((c.lowest, c.lowest_time), (c.highest, c.highest_time)))
            by = Cell(f"{c.by}, operating limits" if c.stand_in else c.by, c.undecided)
            rows.append([head, c.point, c.state, by, lowest, highest, ends, room, *times, Cell(c.mark, MARKS[c.mark]), verdict(c.passed)])
    less = " Where nobody gave limits for a unit switched off, the operating ones stand for them." if any_stands_in(q) else ""
    return Table.of(columns, rows, f"Point at a temperature for its time.{less}")


def any_stands_in(q: Qualification) -> bool:
    """Return whether operating limits stand for others anywhere."""
    return any(c.stand_in for t in q.trials for c in t.checks)


def margin_table(q: Qualification) -> Table:
    """Return what is added up from the predicted temperature to the limit, the flat rule beside it, and what the calibration bought."""
    columns = [Column("reference point"), Column("side"), Column("worst case"), Column("at", True), Column("predicted, °C", True)]
    columns += [Column("± model, K", True, "half of the 95 % interval"), Column("acceptance, K", True), Column("qualification, K", True)]
    columns += [
        Column("limit, °C", True),
        Column("margin, K", True),
        Column("result"),
        Column("flat rule, K", True),
        Column("margin by it, K", True),
    ]
    columns += [Column("calibration bought, K", True, "by how much it narrowed the 95 % interval")]
    columns += [Column("± model counts", wrapped=True), Column("and does not count", wrapped=True)]
    rows: list[Line] = []
    for m in q.margins:
        a, b = m.policy.acceptance, m.policy.qualification
        added = [Cell(f"{f.value:g} [{f.mark}]", f.source, "warn" if not f.decides else "") for f in (a, b)]
        head: Line = [Cell(m.point, "", "main"), m.side, m.run, hours(m.time), celsius(m.predicted)]
        shares = "; ".join(f"{c} {100 * s:.0f} %" for c, s in m.shares.items())
        line: Line = [*head, Cell(f"{m.uncertainty:.1f}", shares), *added, Cell(f"{celsius(m.limit, 0)} [{m.limit_mark}]")]
        line += [Cell(signed(m.margin, 1), "", "bad" if m.margin < 0 else "main"), verdict(m.passed, m.undecided)]
        line += [Cell(f"{m.flat.value:g} [{m.flat.mark}]", m.flat.source), signed(m.flat_left, 1)]
        less = Cell("; ".join(m.not_counted), "", "warn") if m.not_counted else Cell(DASH)
        rows.append([*line, f"{m.bought:.1f}" if math.isfinite(m.bought) else DASH, shares or "nothing", less])
    policy = q.margins[0].policy.name if q.margins else DASH
    tested = "correlated by a balance test" if q.plan.content.margins.balance_tested else "no balance test yet"
    return Table.of(columns, rows, f"Policy: {policy}; {tested}. A number marked 'memory' is shown and decides nothing.")


def outside(q: Qualification) -> Table:
    """Return where each test leaves the conditions of the calibration."""
    rows: list[Line] = [
        [
            Cell(t.test.name, "", "main"),
            Cell("EXTRAPOLATION: " + "; ".join(t.outside), "", "warn") if t.outside else Cell("inside", "", "good"),
        ]
        for t in q.trials
    ]
    return Table.of([Column("test"), Column("against the calibration", wrapped=True)], rows)


def assumed(q: Qualification) -> Table:
    """Return the assumed values by what they do in kelvin."""
    columns = [
        Column("value"),
        Column("is"),
        Column("spread, %", True),
        Column("moves by, K", True),
        Column("reference point"),
        Column("test"),
    ]
    columns += [Column("fitted around"), Column("rests on", wrapped=True)]
    rows: list[Line] = []
    for a in q.assumptions:
        spread = Cell(f"{100 * a.spread:.0f}", "its range over the root of 12" if a.ranged else "no range given: a tenth")
        around = Cell("yes: moves less", "the fitted values take up most of a change", "soft") if a.fitted_around else Cell("no")
        rows.append([Cell(a.path, "", "main"), pretty(a.text), spread, number(a.effect, 2), a.point, a.run, around, a.basis or DASH])
    return Table.of(columns, rows, "Effect of one standard deviation on the reference point that it moves most, everything else held.")
