"""Tables of what was planned and done in a qualification report: tests, sensors, boundaries, power, phases, predictions, parameters."""

from __future__ import annotations

import fnmatch
import math
from collections.abc import Mapping

import numpy as np

from thermid.qualify.programme import Qualification
from thermid.qualify.trial import Trial, sensors_of
from thermid.reporting.blocks.cells import DASH, Cell, Head, Line, Table, number, plain, pretty, signed, significant
from thermid.reporting.blocks.sections import Block, as_block, folded
from thermid.reporting.qualification.cells import celsius, hours, mark, verdict


def tests(q: Qualification) -> Table:
    """Return the tests: kind, state, course, criteria, limits and correlation."""
    columns = [
        Head("test"),
        Head("limits"),
        Head("correlation"),
        Head("nearest to a limit"),
        Head("at", True),
    ]
    columns += [Head("room, K", True), Head("state"), Head("lasts", True), Head("course", wrapped=True)]
    rows: list[Line] = []
    for t in q.trials:
        course = Cell(t.foresight.scenario.title)
        if t.course is not None:
            course = Cell(t.course.profile.title, t.course.trust, "" if t.course.decides else "warn")
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
                course,
            ]
        )
    return Table.of(columns, rows)


def _no_log(t: Trial) -> Cell:
    if t.test.state == "waived":
        return Cell("waived", t.test.note, "warn")
    return Cell("not decided: no log", "", "warn") if t.test.criteria else Cell("analysis", "", "soft")


def sensors(q: Qualification) -> Table:
    """Return the sensors: node, place, reason, accuracy, certificate."""
    columns = [
        Head("sensor"),
        Head("model node"),
        Head("place"),
        Head("why there", wrapped=True),
        Head("accuracy"),
    ]
    columns += [Head("noise"), Head("certificate", wrapped=True)]
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


def boundaries(q: Qualification) -> Table:
    """Return the lowest and highest temperature of every boundary, as planned and as logged, and what is not known exactly of it."""
    columns = [
        Head("test"),
        Head("boundary"),
        Head("planned, °C", True),
        Head("logged, °C", True),
        Head("column"),
        Head("stated ±"),
    ]
    rows: list[Line] = []
    for t in q.trials:
        run, driven = t.foresight.solution, {v: k for k, v in t.test.log.boundaries.items()} if t.test.log is not None else {}
        known = t.as_logged
        for k, name in enumerate(t.foresight.scenario.boundaries):
            trace, column = run[name], driven.get(name, "")
            logged = " .. ".join(f"{v:.1f}" for v in known[column]) if column in known else ("not logged" if t.test.log else DASH)
            head = Cell(t.test.name, "", "main") if k == 0 else Cell("", "", "same")
            planned = f"{trace.lowest:.1f} .. {trace.highest:.1f}"
            seen = Cell(logged, "", "warn" if logged == "not logged" else "")
            rows.append([head, name, planned, seen, column or DASH, stated_text(t.test.spread.get(name, DASH))])
    return Table.of(columns, rows, "Lowest to highest over the test.")


def stated_text(spread: str | Mapping[str, str | float]) -> str:
    """Return a stated spread as it is written."""
    return spread if isinstance(spread, str) else ", ".join(f"{k} {v}" for k, v in spread.items())


def duties(q: Qualification) -> list[Block]:
    """Return the duty of every heater with its margin, and the power of every load per test."""
    out: list[Block] = []
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
            number(h.full, 3),
            f"{100 * h.duty:.0f}",
            f"{100 * h.most:.0f}",
            mark(h.rule.mark),
            verdict(h.passed),
        ]
        for t in q.trials
        for h in t.heaters
    ]
    if rows:
        out.append(as_block(Table.of([*columns, Head("mark"), Head("result")], rows, "At most: what leaves the power margin.")))
    for t in q.trials:
        times = t.foresight.solution.times
        lines: list[Line] = []
        for load, watts in t.foresight.solution.load_powers.items():
            w = np.broadcast_to(watts, times.shape)
            said = stated_text(t.test.spread.get(f"scale.{load}", t.test.spread.get(f"{load}.power", DASH)))
            if w.any():
                lines.append([load, number(float(np.trapezoid(w, times) / times[-1]), 3), number(float(w.max()), 3), said])
        if lines:
            heads = [Head("load"), Head("mean, W", True), Head("largest, W", True), Head("stated ±")]
            total = sum(float(np.max(w)) for w in t.foresight.solution.load_powers.values())
            out.append(folded(f"Power in {t.test.name}", [Table.of(heads, lines)], f"{len(lines)} loads, at most {total:.4g} W together"))
    return out


def phases(t: Trial) -> Table:
    """Return the phases of a course: what was waited for, the slowest part, what the rule left unfinished."""
    columns = [
        Head("at", True),
        Head("for", True),
        Head("cycle", True),
        Head("phase", wrapped=True),
        Head("unit"),
        Head("chamber, °C", True),
    ]
    columns += [
        Head("rule"),
        Head("slowest part"),
        Head("rate, K/h", True),
        Head("furthest from rest"),
        Head("left, K", True),
    ]
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
        Head("sensor"),
        Head("lowest, °C", True),
        Head("measured, °C", True),
        Head("highest, °C", True),
        Head("measured, °C", True),
    ]
    columns += [Head("last, °C", True), Head("measured, °C", True), Head("outside 95 %")]
    seen = {o.sensor: o for o in t.correlation.overlays} if t.correlation is not None else {}
    rows: list[Line] = []
    for sensor, (node, _) in sensors_of(q.plan, t.test).items():
        band, o = t.foresight.prediction[node], seen.get(sensor)
        cells: list[Cell | str] = [Cell(sensor, node, "main")]
        beyond = []
        for word, k in (("lowest", int(band.kelvin.argmin())), ("highest", int(band.kelvin.argmax())), ("last", -1)):
            error = 1.96 * float(band.error[k])
            cells.append(f"{celsius(float(band.kelvin[k]))} ± {error:.1f}" if error > 0 else f"{celsius(float(band.kelvin[k]))} ± ?")
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
        columns,
        rows,
        "± 95 % of the model's values and of what is stated of the test, ? where nothing is; outside: with the sensor's own error added.",
    )


def flows(t: Trial) -> Table:
    """Return the largest mean heat flows of a test, test-only paths marked."""
    run = t.foresight.solution
    length = float(run.times[-1])
    means = {c: float(np.trapezoid(w, run.times) / length) for c, w in run.heat_flows.items()}
    ranked = sorted(means.items(), key=lambda item: -abs(item[1]))[:14]
    rows: list[Line] = [[c, signed(w, 3), signed(float(run.heat_flows[c][-1]), 3)] for c, w in ranked]
    return Table.of(
        [Head("path"), Head("mean, W", True), Head("at the end, W", True)],
        rows,
        "Positive from its first end to its second.",
    )


def changes(q: Qualification) -> Table:
    """Return what was fitted: before, after, error, bound, reason."""
    columns = [
        Head("parameter"),
        Head("before", True),
        Head("after", True),
        Head("±", True),
        Head("unit"),
        Head("bounds", True),
    ]
    columns += [Head("why it may be so", wrapped=True)]
    reasons, rows = q.plan.content.model.reasons, []
    for several in q.known.values:
        for path, v in several.parameters.items():
            why = next((text for pattern, text in reasons.items() if fnmatch.fnmatchcase(path, pattern)), "")
            low, high = (plain(v.converted(b), 4) if math.isfinite(b) else "" for b in v.bounds)
            line: Line = [Cell(path, v.origin, "main"), plain(v.converted(v.start), 5), significant(v.in_unit, v.shown(v.error))]
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
