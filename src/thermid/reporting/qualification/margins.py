"""Tables of what a qualification report concludes: margins, predictions of the service cases, extrapolations, assumptions."""

from __future__ import annotations

import math

from thermid.qualify.programme import Qualification
from thermid.reporting.blocks.cells import DASH, Cell, Column, Line, Table, number, pretty, signed
from thermid.reporting.qualification.cells import celsius, given, hours, verdict


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
    columns = [Column("reference point"), Column("side"), Column("± model, K", True), Column("counts", wrapped=True)]
    columns += [Column("and does not count", wrapped=True)]
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


def service(q: Qualification) -> Table:
    """Return what the model as it is now says of every reference point in the cases that margins are taken over, with its 95 % interval."""
    columns = [Column("case"), Column("reference point"), Column("lowest, °C", True), Column("highest, °C", True), Column("last, °C", True)]
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
