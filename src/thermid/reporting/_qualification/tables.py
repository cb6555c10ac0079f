"""Tables of a qualification report: what was planned and done, and what is judged; with the cells that they share."""

from __future__ import annotations

import fnmatch
import math
from collections.abc import Mapping

import numpy as np

from thermid.base.results import MARKS
from thermid.base.units import HALF_WIDTH_95, HOUR, ICE_POINT
from thermid.campaign.stages import Correlation, Overlay
from thermid.qualify.plans import Qualification, Trial, sensors_of
from thermid.reporting._blocks.content import (
    DASH,
    Cell,
    Head,
    Line,
    PageBlock,
    Table,
    folded,
    group_cell,
    number,
    plain,
    pretty,
    rounded,
    signed,
    significant,
    verdict_cell,
)
from thermid.reporting._pages.tables import bounds_text


def tests(q: Qualification) -> Table:
    """Return the tests: kind, state, course, criteria, limits and correlation."""
    rows: list[Line] = []
    for t in q.trials:
        course = Cell(t.foresight.scenario.title)
        if t.course is not None:
            course = Cell(t.course.profile.title, t.course.profile.trust, "" if t.course.profile.decides else "warn")
        worst, why = q.smallest(t.test.name), "; ".join(t.open)
        where = [Cell(DASH), Cell(DASH), Cell(DASH)]
        if worst is not None:
            distance = Cell(f"{worst.left:.1f}", worst.counted.removeprefix(", ") or "bare", "bad" if worst.left < 0 else "main")
            where = [Cell(worst.point), Cell(hours(worst.time)), distance]
        judged = verdict_cell(t.correlated, why)
        if t.correlation is None:
            judged = Cell("not decided: no log", "", "warn") if t.test.criteria else Cell("analysis", "", "soft")
            judged = Cell("waived", t.test.note, "warn") if t.test.state == "waived" else judged
        length = hours(float(t.foresight.solution.times[-1]))
        rows.append(
            [
                Cell(t.test.name, t.test.purpose, "main"),
                verdict_cell(t.within, why),
                judged,
                *where,
                t.test.state,
                length,
                course,
            ]
        )
    return Table.of_rows(
        [
            Head("test"),
            Head("limits"),
            Head("correlation"),
            Head("smallest margin"),
            Head("at", True),
            Head("of the margin, K", True, "left, less the uncertainty of the model and the margins of the policy"),
            Head("state"),
            Head("lasts", True),
            Head("course", wrapped=True),
        ],
        rows,
        "Limits: of the temperatures as they are. The margin is what is left of them less the uncertainty and the margins of the policy.",
        title="Tests",
    )


def sensors(q: Qualification) -> Table:
    """Return the sensors: node, place, reason, accuracy, certificate."""
    return Table.of_rows(
        [
            Head("sensor"),
            Head("model node"),
            Head("place"),
            Head("why there", wrapped=True),
            Head("accuracy"),
            Head("noise"),
            Head("certificate", wrapped=True),
        ],
        [
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
        ],
        "Accuracy: standard deviation of the constant error.",
    )


def boundaries(q: Qualification) -> Table:
    """Return the lowest and highest temperature of every boundary, as planned and as logged, and what is not known exactly of it."""
    rows: list[Line] = []
    for t in q.trials:
        run, driven = t.foresight.solution, {v: k for k, v in t.test.log.boundaries.items()} if t.test.log is not None else {}
        for k, name in enumerate(t.foresight.scenario.boundaries):
            trace, column = run[name], driven.get(name, "")
            logged = (
                " .. ".join(f"{v:.1f}" for v in t.as_logged[column]) if column in t.as_logged else ("not logged" if t.test.log else DASH)
            )
            planned = f"{trace.lowest:.1f} .. {trace.highest:.1f}"
            logged_cell = Cell(logged, "", "warn" if logged == "not logged" else "")
            spread = stated_text(t.test.spread.get(name, DASH))
            rows.append([group_cell(t.test.name, k), name, planned, logged_cell, column or DASH, spread])
    return Table.of_rows(
        [
            Head("test"),
            Head("boundary"),
            Head("planned, °C", True),
            Head("logged, °C", True),
            Head("column"),
            Head("stated ±"),
        ],
        rows,
        "Lowest to highest over the test.",
    )


def stated_text(spread: str | Mapping[str, str | float]) -> str:
    """Return a stated spread as it is written."""
    return spread if isinstance(spread, str) else ", ".join(f"{k} {v}" for k, v in spread.items())


def duties(q: Qualification) -> list[PageBlock]:
    """Return the duty of every heater with its margin, and the power of every load per test."""
    out: list[PageBlock] = []
    columns = [
        Head("test"),
        Head("heater"),
        Head("full power, W", True),
        Head("duty, %", True),
        Head("at most, %", True),
    ]
    rows: list[Line] = [
        [
            Cell(t.test.name, "", "main"),
            h.load,
            number(h.full),
            f"{100 * h.duty:.0f}",
            f"{100 * h.max_duty:.0f}",
            mark(h.rule.mark),
            verdict_cell(h.passed),
        ]
        for t in q.trials
        for h in t.heaters
    ]
    if rows:
        out.append(Table.of_rows([*columns, Head("mark"), Head("result")], rows, "At most: the duty cycle that leaves the power margin."))
    for t in q.trials:
        times = t.foresight.solution.times
        lines: list[Line] = []
        for load, watts in t.foresight.solution.load_powers.items():
            w = np.broadcast_to(watts, times.shape)
            spread = stated_text(t.test.spread.get(f"scale.{load}", t.test.spread.get(f"{load}.power", DASH)))
            if w.any():
                lines.append([load, number(float(np.trapezoid(w, times) / times[-1])), number(float(w.max())), spread])
        if lines:
            total = sum(float(np.max(w)) for w in t.foresight.solution.load_powers.values())
            out.append(
                folded(
                    f"Power in {t.test.name}",
                    [Table.of_rows([Head("load"), Head("mean, W", True), Head("largest, W", True), Head("stated ±")], lines)],
                    f"{len(lines)} loads, at most {total:.4g} W together",
                )
            )
    return out


def phases(t: Trial) -> Table:
    """Return the phases of a course: what was waited for, the slowest part, what the rule left unfinished."""
    rows: list[Line] = []
    for p in t.course.phases if t.course is not None else ():
        name = f"{p.name}, wait" if p.kind == "wait" else p.name
        rate = signed(HOUR * p.rate, 2) if p.rule else DASH
        remaining = signed(p.unfinished, 2) if p.unfinished is not None else DASH
        span = [hours(p.start), hours(p.duration), str(p.cycle) if p.cycle else DASH]
        rows.append(
            [
                *span,
                name,
                "on" if p.power else "off",
                celsius(p.chamber),
                p.rule or DASH,
                p.slowest or DASH,
                rate,
                p.furthest or DASH,
                remaining,
            ]
        )
    return Table.of_rows(
        [
            Head("at", True),
            Head("for", True),
            Head("cycle", True),
            Head("phase", wrapped=True),
            Head("unit"),
            Head("chamber, °C", True),
            Head("rule"),
            Head("slowest part"),
            Head("rate, K/h", True),
            Head("furthest from steady state"),
            Head("left, K", True),
        ],
        rows,
    )


def half_width(o: Overlay) -> float:
    """Return half of the 95 % interval of a reading: the constant error of its sensor and its noise. [K]"""
    return HALF_WIDTH_95 * math.hypot(o.accuracy, o.noise)


def foreseen(q: Qualification, t: Trial) -> Table:
    """Return the pre-test predictions of a test per sensor, and what was measured where its log has come back."""
    overlays = {o.sensor: o for o in t.correlation.overlays} if t.correlation is not None else {}
    rows: list[Line] = []
    for sensor, (node, _) in sensors_of(q.plan, t.test).items():
        band, o = t.foresight.prediction[node], overlays.get(sensor)
        cells: list[Cell | str] = [Cell(sensor, node, "main")]
        beyond = []
        for word, k in (("lowest", int(band.kelvin.argmin())), ("highest", int(band.kelvin.argmax())), ("last", -1)):
            error = HALF_WIDTH_95 * float(band.error[k])
            cells.append(f"{celsius(float(band.kelvin[k]))} ± {error:.1f}" if error > 0 else f"{celsius(float(band.kelvin[k]))} ± ?")
            if o is None:
                cells.append(DASH)
                continue
            extreme = float({"lowest": o.measured.min(), "highest": o.measured.max(), "last": o.measured[-1]}[word])
            off = abs(extreme - float(band.kelvin[k])) > math.hypot(error, half_width(o))
            beyond += [word] if off else []
            cells.append(Cell(celsius(extreme), f"{extreme - float(band.kelvin[k]):+.2f} K", "warn" if off else ""))
        rows.append([*cells, Cell(", ".join(beyond), "", "warn") if beyond else ("none" if o is not None else DASH)])
    return Table.of_rows(
        [
            Head("sensor"),
            Head("lowest, °C", True),
            Head("measured, °C", True),
            Head("highest, °C", True),
            Head("measured, °C", True),
            Head("last, °C", True),
            Head("measured, °C", True),
            Head("outside 95 %"),
        ],
        rows,
        "± 95 % of the model's values and of the stated errors of the test, ? without any; outside: including the sensor's error.",
    )


def flows(t: Trial) -> Table:
    """Return the largest mean heat flows of a test, test-only paths marked."""
    run = t.foresight.solution
    length = float(run.times[-1])
    means = {c: float(np.trapezoid(w, run.times) / length) for c, w in run.heat_flows.items()}
    ranked = sorted(means.items(), key=lambda item: -abs(item[1]))[:14]
    return Table.of_rows(
        [Head("path"), Head("mean, W", True), Head("at the end, W", True)],
        [[c, signed(w, 3), signed(float(run.heat_flows[c][-1]), 3)] for c, w in ranked],
        "Positive from its first end to its second.",
    )


def changes(q: Qualification) -> Table:
    """Return what was fitted: before, after, error, bound, and the reason where the plan gives any."""
    reasons, rows, unreasoned = q.plan.content.model.reasons, [], 0
    for several in q.knowledge.values:
        for path, v in several.parameters.items():
            why = next((text for pattern, text in reasons.items() if fnmatch.fnmatchcase(path, pattern)), "")
            line: Line = [Cell(path, v.origin, "main"), plain(v.converted(v.start)), significant(v.in_unit, v.shown(v.error))]
            rows.append(
                [
                    *line,
                    rounded(v.shown(v.error)),
                    pretty(v.unit),
                    bounds_text(v),
                    Cell(why) if why else Cell(DASH, "no reason given", "warn"),
                ]
            )
            unreasoned += not why
    caption = (
        f"The plan gives no reason for {'any' if unreasoned == len(rows) else unreasoned} of these {len(rows)} changes."
        if unreasoned
        else ""
    )
    return Table.of_rows(
        [
            Head("parameter"),
            Head("before", True),
            Head("after", True),
            Head("±", True),
            Head("unit"),
            Head("bounds", True),
            Head("reason", wrapped=True),
        ],
        rows,
        caption,
    ).without_usual({"reason": DASH})


def deviations(c: Correlation) -> Table:
    """Return mean, spread and largest deviation per sensor and case."""
    return Table.of_rows(
        [
            Head("sensor"),
            Head("case", wrapped=True),
            Head("kind"),
            Head("readings", True),
            Head("measured, °C", True),
            Head("mean, K", True),
            Head("spread, K", True),
            Head("largest, K", True),
            Head("RMSE, K", True),
            Head("± sensor, K", True),
            Head("weight", True),
            Head("left out", wrapped=True),
        ],
        [
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
                    rounded(HALF_WIDTH_95 * d.accuracy) if d.accuracy else DASH,
                    plain(d.weight),
                    Cell(d.excluded or DASH, "", "warn" if d.excluded else ""),
                ),
            ]
            for d in c.deviations
        ],
        "Measured minus simulated; ± sensor: 95 % of its constant error.",
    ).without_usual({"weight": "1", "left out": DASH})


def gates(c: Correlation, failed_only: bool = False) -> Table:
    """Return every gate of every set of criteria, or those that are not met."""
    return Table.of_rows(
        [
            Head("criteria"),
            Head("case", wrapped=True),
            Head("kind"),
            Head("gate"),
            Head("found, K", True),
            Head("limit, K", True),
            Head("mark"),
            Head("worst sensor"),
            Head("outside", True),
            Head("result"),
        ],
        [
            [
                Cell(g.criteria, "", "main"),
                *(g.case, g.kind, g.over_sensors, f"{g.found:.2f}", plain(g.limit), mark(g.mark), g.sensor or DASH),
                *(Cell(f"{len(g.outside)} of {g.counted}", ", ".join(g.outside)), verdict_cell(g.passed)),
            ]
            for g in c.gates
            if not failed_only or g.passed is False
        ],
    )


def diagnoses(t: Trial) -> Table:
    """Return what would explain a test's deviations, the likeliest first."""
    suspects = t.diagnosis.suspects[:6] if t.diagnosis is not None else ()
    return Table.of_rows(
        [
            Head("fault"),
            Head("group"),
            Head("probability, %", True),
            Head("explains, %", True),
            Head("leaves, K", True),
        ],
        [[Cell(s.text, "", "main"), s.group, f"{100 * s.probability:.0f}", f"{100 * s.explained:.0f}", f"{s.left:.2f}"] for s in suspects],
        "Each fault tried alone; explains: share of the weighted sum of squares.",
    )


def excluded(q: Qualification) -> Table:
    """Return the sensors that do not count, and why."""
    cap = f"At most {100 * q.plan.content.exclusions.cap:g} % of the sensors of a test may be excluded."
    return Table.of_rows(
        [Head("sensor"), Head("why", wrapped=True)],
        [[Cell(s, "", "main"), why] for s, why in q.plan.content.exclusions.reasons.items()],
        cap,
    )


def checks(q: Qualification) -> Table:
    """Return every reference point in every test and state against its limits, crossings with their times."""
    rows: list[Line] = []
    for t in q.trials:
        for k, c in enumerate(t.checks):
            first = min((x.time for x in c.crossings), default=math.nan)
            beyond = sum(x.outside for x in c.crossings)
            ends = f"{limit_celsius(c.limits[0])} .. {limit_celsius(c.limits[1])}"
            room = Cell(f"{c.room:.1f}" if math.isfinite(c.room) else DASH, "", "bad" if c.room < 0 else "")
            times = [hours(first), hours(beyond)] if c.crossings else [DASH, DASH]
            lowest, highest = (Cell(celsius(v), f"at {hours(at)}") for v, at in ((c.lowest, c.lowest_time), (c.highest, c.highest_time)))
            by = Cell(f"{c.by}, operating limits" if c.stand_in else c.by, c.undecided)
            rows.append(
                [
                    group_cell(t.test.name, k),
                    c.point,
                    c.state,
                    by,
                    lowest,
                    highest,
                    ends,
                    room,
                    *times,
                    mark(c.mark),
                    verdict_cell(c.passed),
                ]
            )
    stands_in = any(c.stand_in for t in q.trials for c in t.checks)
    less = " Without limits for a unit switched off, the operating limits apply." if stands_in else ""
    return Table.of_rows(
        [
            Head("test"),
            Head("reference point"),
            Head("state"),
            Head("by"),
            Head("lowest, °C", True),
            Head("highest, °C", True),
            Head("limits, °C", True),
            Head("left, K", True),
            Head("first passed", True),
            Head("beyond for", True),
            Head("mark"),
            Head("result"),
        ],
        rows,
        f"Hover over a temperature for its time.{less}",
    )


def settled(t: Trial) -> Table:
    """Return what the readings of a test say about every settled stretch: drift with its error, by the test's rule, the slowest first."""
    words = {"stable": True, "not stable": False}
    rows: list[Line] = []
    for s in t.settled:
        ranked = sorted(s.channels.values(), key=lambda c: -abs(c.rate))
        for k, c in enumerate(ranked):
            head = Cell(f"{c.start / 3600:.4g} .. {c.end / 3600:.4g}", "", "main" if k == 0 else "same")
            remaining = signed(s.remaining[c.name].value, 2) if c.name in s.remaining else DASH
            steady = words.get(c.verdict or s.verdict) if s.decides else None
            rows.append(
                [
                    head,
                    c.name,
                    signed(HOUR * c.rate, 2),
                    f"{2 * 3600 * c.error:.2f}",
                    s.rule.name,
                    mark(s.rule.mark),
                    remaining,
                    verdict_cell(steady),
                ]
            )
    return Table.of_rows(
        [
            Head("stretch, h"),
            Head("sensor"),
            Head("drift, K/h", True),
            Head("±, K/h", True),
            Head("rule"),
            Head("mark"),
            Head("left, K", True, "remaining change forecast from the readings"),
            Head("settled"),
        ],
        rows,
        "Readings of the log; ±: two standard errors.",
    )


def margin_table(q: Qualification) -> Table:
    """Return what is added up from the predicted temperature to the limit, and the fixed margin of a standard beside it."""
    rows: list[Line] = []
    for m in q.margins:
        a, b = m.policy.acceptance, m.policy.qualification
        added = [Cell(f"{f.value:g} [{f.mark}]", f.source, "warn" if not f.decides else "") for f in (a, b)]
        head: Line = [Cell(m.point, "", "main"), m.side, m.run, hours(m.time), celsius(m.predicted)]
        shares = "; ".join(f"{c} {100 * s:.0f} %" for c, s in m.shares.items())
        line: Line = [*head, Cell(f"{m.printed:.1f}", shares), *added, Cell(f"{limit_celsius(m.limit)} [{m.limit_mark}]")]
        line += [Cell(signed(m.margin, 1), "", "bad" if m.margin < 0 else "main"), verdict_cell(m.passed, m.undecided)]
        line += [Cell(f"{m.fixed.value:g} [{m.fixed.mark}]", m.fixed.source), signed(m.left_with_fixed, 1)]
        rows.append(line)
    policy = q.margins[0].policy.name if q.margins else DASH
    tested = "correlated by a balance test" if q.plan.content.margins.balance_tested else "no balance test yet"
    return Table.of_rows(
        [
            Head("reference point"),
            Head("side"),
            Head("worst case"),
            Head("at", True),
            Head("predicted, °C", True),
            Head("± model, K", True, "half of the 95 % interval"),
            Head("acceptance, K", True),
            Head("qualification, K", True),
            Head("limit, °C", True),
            Head("margin, K", True),
            Head("result"),
            Head("fixed margin, K", True),
            Head("left with it, K", True),
        ],
        rows,
        f"Policy: {policy}; {tested}. A number marked 'memory' is shown for information and not used for a verdict.",
    )


def counted(q: Qualification) -> Table:
    """Return a row for each margin: half width by the model [K], shares of its variance from half a per cent on, and what it leaves out."""
    rows: list[Line] = []
    for m in q.margins:
        shares = "; ".join(f"{c} {100 * s:.0f} %" for c, s in m.shares.items() if s >= 0.005)
        less = Cell("; ".join(m.not_counted), "", "warn") if m.not_counted else Cell(DASH)
        rows.append([Cell(m.point, "", "main"), m.side, f"{m.printed:.1f}", shares or "nothing", less])
    return Table.of_rows(
        [
            Head("reference point"),
            Head("side"),
            Head("± model, K", True),
            Head("counts", wrapped=True),
            Head("and does not count", wrapped=True),
        ],
        rows,
        "Shares of the variance.",
    )


def outside(q: Qualification) -> Table:
    """Return where each test leaves the conditions of the calibration."""
    return Table.of_rows(
        [Head("test"), Head("against the calibration", wrapped=True)],
        [
            [
                Cell(t.test.name, "", "main"),
                Cell("EXTRAPOLATION: " + "; ".join(t.outside), "", "warn") if t.outside else Cell("inside", "", "good"),
            ]
            for t in q.trials
        ],
    )


def assumed(q: Qualification) -> Table:
    """Return the assumed values by what they do in kelvin."""
    rows: list[Line] = []
    for a in q.assumptions:
        spread = Cell(f"{100 * a.spread:.0f}", "its range over the root of 12" if a.ranged else "no range given: a tenth")
        around = Cell("yes: moves less", "the fitted values compensate most of a change", "soft") if a.fitted_around else Cell("no")
        rows.append([Cell(a.path, "", "main"), pretty(a.text), spread, rounded(a.effect), a.point, a.run, around, a.basis or DASH])
    return Table.of_rows(
        [
            Head("value"),
            Head("is"),
            Head("spread, %", True),
            Head("moves by, K", True),
            Head("reference point"),
            Head("test"),
            Head("fitted around"),
            Head("rests on", wrapped=True),
        ],
        rows,
        "Effect of one standard deviation on the most sensitive reference point, with all else fixed.",
    )


def service(q: Qualification) -> Table:
    """Return what the model as it is now says of every reference point in the cases that margins are taken over, with its 95 % interval."""
    rows: list[Line] = []
    for t in q.service:
        for k, one in enumerate(t.limits):
            band = t.expected.prediction[one.node]
            cells = []
            for at in (int(band.kelvin.argmin()), int(band.kelvin.argmax()), -1):
                shown = f"{celsius(float(band.kelvin[at]))} ± {HALF_WIDTH_95 * float(band.error[at]):.1f}"
                cells.append(Cell(shown, f"at {hours(float(band.times[at]))}"))
            rows.append([group_cell(t.test.name, k), one.point, *cells])
    return Table.of_rows(
        [
            Head("case"),
            Head("reference point"),
            Head("lowest, °C", True),
            Head("highest, °C", True),
            Head("last, °C", True),
        ],
        rows,
        "The logs of this plan are included; contributions not included in the intervals are listed with the margins.",
    )


def celsius(kelvin: float) -> str:
    """Return a temperature in degrees Celsius; a dash where there is none."""
    return f"{kelvin - ICE_POINT:.1f}" if math.isfinite(kelvin) else DASH


def limit_celsius(kelvin: float) -> str:
    """Return a limit in degrees Celsius with the digits that it was given in, so that what is left to it adds up; a dash for none."""
    return plain(kelvin - ICE_POINT) if math.isfinite(kelvin) else DASH


def hours(seconds: float) -> str:
    """Return a time in hours, in minutes below two."""
    return f"{seconds / 3600:.2f} h" if seconds >= 7200 else f"{seconds / 60:.1f} min"


def mark(name: str) -> Cell:
    """Return how sure a number is, what that means behind it; what is from memory stands out."""
    return Cell(name, MARKS[name], "warn" if name == "memory" else "")
