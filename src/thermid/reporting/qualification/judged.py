"""Tables of what is judged in a qualification report: deviations, gates, what would explain them, sensors left out, limits."""

from __future__ import annotations

import math

from thermid.judge.correlation import Correlation
from thermid.qualify.programme import Qualification
from thermid.qualify.trial import Trial
from thermid.reporting.blocks.cells import DASH, Cell, Head, Line, Table, number, plain, pretty, signed
from thermid.reporting.qualification.cells import celsius, given, hours, mark, verdict


def deviations(c: Correlation) -> Table:
    """Return mean, spread and largest deviation per sensor and case."""
    columns = [
        Head("sensor"),
        Head("case", wrapped=True),
        Head("kind"),
        Head("readings", True),
        Head("measured, °C", True),
    ]
    columns += [
        Head("mean, K", True),
        Head("spread, K", True),
        Head("largest, K", True),
        Head("RMSE, K", True),
        Head("± sensor, K", True),
    ]
    columns += [Head("weight", True), Head("left out", wrapped=True)]
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
        Head("criteria"),
        Head("case", wrapped=True),
        Head("kind"),
        Head("gate"),
        Head("found, K", True),
        Head("limit, K", True),
    ]
    columns += [Head("mark"), Head("worst sensor"), Head("outside", True), Head("result")]
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
    columns = [
        Head("fault"),
        Head("group"),
        Head("probability, %", True),
        Head("explains, %", True),
        Head("leaves, K", True),
    ]
    found = t.diagnosis.suspects[:6] if t.diagnosis is not None else ()
    rows: list[Line] = [
        [Cell(s.text, "", "main"), s.group, f"{100 * s.probability:.0f}", f"{100 * s.explained:.0f}", f"{s.left:.2f}"] for s in found
    ]
    return Table.of(columns, rows, "Each fault tried by itself; explains: part of the weighted squares.")


def excluded(q: Qualification) -> Table:
    """Return the sensors that do not count, and why."""
    rows: list[Line] = [[Cell(s, "", "main"), why] for s, why in q.plan.content.exclusions.reasons.items()]
    cap = f"At most {100 * q.plan.content.exclusions.cap:g} % of the sensors of a test may be left out."
    return Table.of([Head("sensor"), Head("why", wrapped=True)], rows, cap)


def checks(q: Qualification) -> Table:
    """Return every reference point in every test and state against its limits, crossings with their times."""
    columns = [Head("test"), Head("reference point"), Head("state"), Head("by")]
    columns += [Head("lowest, °C", True), Head("highest, °C", True)]
    columns += [
        Head("limits, °C", True),
        Head("room, K", True),
        Head("first passed", True),
        Head("beyond for", True),
        Head("mark"),
    ]
    columns += [Head("result")]
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
    columns = [
        Head("stretch, h"),
        Head("sensor"),
        Head("drift, K/h", True),
        Head("±, K/h", True),
        Head("rule"),
        Head("mark"),
    ]
    columns += [Head("left, K", True, "what the readings say that is still to come"), Head("settled")]
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


def margin_table(q: Qualification) -> Table:
    """Return what is added up from the predicted temperature to the limit, the flat rule beside it, and what the calibration bought."""
    columns = [
        Head("reference point"),
        Head("side"),
        Head("worst case"),
        Head("at", True),
        Head("predicted, °C", True),
    ]
    columns += [
        Head("± model, K", True, "half of the 95 % interval"),
        Head("acceptance, K", True),
        Head("qualification, K", True),
    ]
    columns += [
        Head("limit, °C", True),
        Head("margin, K", True),
        Head("result"),
        Head("flat rule, K", True),
        Head("margin by it, K", True),
    ]
    columns += [Head("calibration bought, K", True, "by how much it narrowed the 95 % interval")]
    rows: list[Line] = []
    for m in q.margins:
        a, b = m.policy.acceptance, m.policy.qualification
        added = [Cell(f"{f.value:g} [{f.mark}]", f.source, "warn" if not f.decides else "") for f in (a, b)]
        head: Line = [Cell(m.point, "", "main"), m.side, m.run, hours(m.time), celsius(m.predicted)]
        shares = "; ".join(f"{c} {100 * s:.0f} %" for c, s in m.shares.items())
        line: Line = [*head, Cell(f"{m.printed:.1f}", shares), *added, Cell(f"{given(m.limit)} [{m.limit_mark}]")]
        line += [Cell(signed(m.margin, 1), "", "bad" if m.margin < 0 else "main"), verdict(m.passed, m.undecided)]
        line += [Cell(f"{m.flat.value:g} [{m.flat.mark}]", m.flat.source), signed(m.flat_left, 1)]
        rows.append([*line, f"{m.bought:.1f}" if math.isfinite(m.bought) else DASH])
    policy = q.margins[0].policy.name if q.margins else DASH
    tested = "correlated by a balance test" if q.plan.content.margins.balance_tested else "no balance test yet"
    return Table.of(columns, rows, f"Policy: {policy}; {tested}. A number marked 'memory' is shown and decides nothing.")


def counted(q: Qualification) -> Table:
    """Return what the uncertainty of every margin counts and does not count."""
    columns = [Head("reference point"), Head("side"), Head("± model, K", True), Head("counts", wrapped=True)]
    columns += [Head("and does not count", wrapped=True)]
    rows: list[Line] = []
    for m in q.margins:
        shares = "; ".join(f"{c} {100 * s:.0f} %" for c, s in m.shares.items() if s >= 0.005)
        less = Cell("; ".join(m.not_counted), "", "warn") if m.not_counted else Cell(DASH)
        rows.append([Cell(m.point, "", "main"), m.side, f"{m.printed:.1f}", shares or "nothing", less])
    return Table.of(columns, rows, "Shares of the variance.")


def outside(q: Qualification) -> Table:
    """Return where each test leaves the conditions of the calibration."""
    rows: list[Line] = [
        [
            Cell(t.test.name, "", "main"),
            Cell("EXTRAPOLATION: " + "; ".join(t.outside), "", "warn") if t.outside else Cell("inside", "", "good"),
        ]
        for t in q.trials
    ]
    return Table.of([Head("test"), Head("against the calibration", wrapped=True)], rows)


def assumed(q: Qualification) -> Table:
    """Return the assumed values by what they do in kelvin."""
    columns = [
        Head("value"),
        Head("is"),
        Head("spread, %", True),
        Head("moves by, K", True),
        Head("reference point"),
        Head("test"),
    ]
    columns += [Head("fitted around"), Head("rests on", wrapped=True)]
    rows: list[Line] = []
    for a in q.assumptions:
        spread = Cell(f"{100 * a.spread:.0f}", "its range over the root of 12" if a.ranged else "no range given: a tenth")
        around = Cell("yes: moves less", "the fitted values take up most of a change", "soft") if a.fitted_around else Cell("no")
        rows.append([Cell(a.path, "", "main"), pretty(a.text), spread, number(a.effect, 2), a.point, a.run, around, a.basis or DASH])
    return Table.of(columns, rows, "Effect of one standard deviation on the reference point that it moves most, everything else held.")


def service(q: Qualification) -> Table:
    """Return what the model as it is now says of every reference point in the cases that margins are taken over, with its 95 % interval."""
    columns = [
        Head("case"),
        Head("reference point"),
        Head("lowest, °C", True),
        Head("highest, °C", True),
        Head("last, °C", True),
    ]
    rows: list[Line] = []
    for t in q.service:
        for k, one in enumerate(t.limits):
            band = t.expected.prediction[one.node]
            cells = []
            for at in (int(band.kelvin.argmin()), int(band.kelvin.argmax()), -1):
                shown = f"{celsius(float(band.kelvin[at]))} ± {1.96 * float(band.error[at]):.1f}"
                cells.append(Cell(shown, f"at {hours(float(band.times[at]))}"))
            rows.append([Cell(t.test.name, "", "main") if k == 0 else Cell("", "", "same"), one.point, *cells])
    return Table.of(columns, rows, "The logs of this plan are counted; what the intervals do not hold stands beside the margins.")
