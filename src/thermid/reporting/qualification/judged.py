"""Tables of what is judged in a qualification report: deviations, gates, what would explain them, sensors left out, limits."""

from __future__ import annotations

import math

from thermid.judge.correlation import Correlation
from thermid.qualify.programme import Qualification
from thermid.qualify.trial import Trial
from thermid.reporting.blocks.cells import DASH, Cell, Column, Line, Table, number, plain, signed
from thermid.reporting.qualification.cells import celsius, given, hours, mark, verdict


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
                signed(d["mean"], 2),
                f"{d['spread']:.2f}",
                signed(d["largest"], 2),
                f"{d['rmse']:.2f}",
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
    rows: list[Line] = [
        [
            Cell(g.criteria, "", "main"),
            *(g.case, g.kind, g.over_sensors, f"{g.found:.2f}", plain(g.limit, 3), mark(g.mark), g.sensor or DASH),
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
            ends = f"{given(c.limits[0])} .. {given(c.limits[1])}"
            room = Cell(f"{c.room:.1f}" if math.isfinite(c.room) else DASH, "", "bad" if c.room < 0 else "")
            times = [hours(first), hours(beyond)] if c.crossings else [DASH, DASH]
            lowest, highest = (Cell(celsius(v), f"at {hours(at)}") for v, at in ((c.lowest, c.lowest_time), (c.highest, c.highest_time)))
            by = Cell(f"{c.by}, operating limits" if c.stand_in else c.by, c.undecided)
            rows.append([head, c.point, c.state, by, lowest, highest, ends, room, *times, mark(c.mark), verdict(c.passed)])
    less = " Where nobody gave limits for a unit switched off, the operating ones stand for them." if _stands_in(q) else ""
    return Table.of(columns, rows, f"Point at a temperature for its time.{less}")


def _stands_in(q: Qualification) -> bool:
    """Return whether operating limits stand for others anywhere."""
    return any(c.stand_in for t in q.trials for c in t.checks)


def settled(t: Trial) -> Table:
    """Return what the readings of a test say about every settled stretch: drift with its error, by the test's rule, the slowest first."""
    columns = [Column("stretch, h"), Column("sensor"), Column("drift, K/h", True), Column("±, K/h", True), Column("rule"), Column("mark")]
    columns += [Column("left, K", True, "what the readings say that is still to come"), Column("settled")]
    words = {"stable": True, "not stable": False}
    rows: list[Line] = []
    for s in t.settled:
        ranked = sorted(s.channels.values(), key=lambda c: -abs(c.rate))
        for k, c in enumerate(ranked):
            head = Cell(f"{c.start / 3600:.4g} .. {c.end / 3600:.4g}", "", "main" if k == 0 else "same")
            left = signed(s.remaining[c.name].value, 2) if c.name in s.remaining else DASH
            found = words.get(c.verdict or s.verdict) if s.decides else None
            rows.append(
                [head, c.name, signed(3600 * c.rate, 2), f"{2 * 3600 * c.error:.2f}", s.rule.name, mark(s.rule.mark), left, verdict(found)]
            )
    return Table.of(columns, rows, "Readings of the log; ±: two standard errors.")
