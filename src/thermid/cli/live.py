"""The live table of a log, as wide and as high as the terminal: faults first where not all channels fit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from thermid.measure.amounts import duration_text
from thermid.measure.record.sensor import ICE

if TYPE_CHECKING:
    from rich.text import Text

    from thermid.acquire.logger import Logger
    from thermid.cli.judge import Judge, Outlook

HOUR = 3600.0
_WORST = ("fault", "not stable", "cannot tell", "too early", "", "stable")
_STYLE = {"fault": "bold red", "not stable": "yellow", "cannot tell": "yellow", "stable": "green"}
_NARROW = 72


def live_table(log: Logger, judge: Judge, width: int, height: int) -> Text:
    """Return the table as it stands, in at most `height` lines of at most `width` characters."""
    from rich.text import Text

    head = [*_head(log, width), _rule_line(log, judge)]
    foot = [log.last_mark] if log.last_mark else []
    rows = [_cells(log, judge, source, width < _NARROW) for source in _sources(log)]
    room = max(1, height - len(head) - len(foot) - 2)
    rest = ""
    if len(rows) > room:
        rows.sort(key=lambda row: _WORST.index(row[0]))
        left, rows = rows[room - 1 :], rows[: room - 1]
        kinds = {word: sum(row[0] == word for row in left) for word in _WORST}
        rest = f"... and {len(left)} more: " + ", ".join(f"{count} {word or 'silent'}" for word, count in kinds.items() if count)
    out = Text(no_wrap=True, overflow="crop")
    for line in head:
        out.append(line[:width] + "\n", style="bold red" if "DISK FULL" in line else "")
    title = ("channel", "degC", "K/h", "by the rule", "will end at")
    widths = [max(len(row[1][k]) for row in [("", title), *rows]) for k in range(5)]
    widths[0] = max(8, min(widths[0], width - sum(widths[1:]) - 8))
    out.append(_joined(title, widths)[:width] + "\n", style="bold")
    for word, cells in rows:
        out.append(_joined(cells, widths)[:width] + "\n", style=_STYLE.get(word, ""))
    if rest:
        out.append(rest[:width] + "\n")
    out.append("\n".join(line[:width] for line in foot), style="dim")
    return out


def _head(log: Logger, width: int) -> list[str]:
    """Return what is said of the log, and of heaters and supply."""
    state, bad = log.state, sum(log.watch.counts.values())
    counts = f"{state.lines} lines, {state.missing} missing, {bad} faulty"
    lines = [f"{log.store.path.name}  {duration_text(state.seconds)}  {counts}"]
    if len(lines[0]) > width:
        lines = [f"{_short(log.store.path.name, width)}", f"{duration_text(state.seconds)}  {counts}"]
    if log.store.waiting:
        lines.append(f"DISK FULL: {log.store.waiting / 1e3:.0f} kB wait in memory")
    if others := _others(log):
        lines.append(others)
    return lines


def _others(log: Logger) -> str:
    """Return heaters and supply in one line."""
    names = {"H": "heater", "V": "voltage", "I": "current"}
    out = []
    for source in sorted({*log.watch.values, *log.watch.faults}):
        if len(source) == 16:
            continue
        fault, value = log.watch.faults.get(source), log.watch.values.get(source)
        name = f"{names[source[0]]}{source[1:]}"
        if fault or value is None:
            out.append(f"{name} FAULT {fault}")
        else:
            out.append(f"{name} {value * 100:g} %" if source[0] == "H" else f"{name} {value:.4g} {'V' if source[0] == 'V' else 'A'}")
    return "  ".join(out)


def _rule_line(log: Logger, judge: Judge) -> str:
    """Return the rule, and how long conditions have been as they are."""
    held = duration_text(log.state.seconds - log.state.changed)
    since = f"heaters as they are for {held}" if log.state.changed else f"watched for {held}"
    doubt = "" if judge.rule.mark != "memory" else " (its number is from memory)"
    return f"rule {judge.rule.name}{doubt}; {since}"


def _sources(log: Logger) -> list[str]:
    """Return the sensors: those of the map in its order, then others."""
    seen = {source for source in {*log.watch.values, *log.watch.faults, *log.state.bits} if len(source) == 16}
    return [*log.sensors, *sorted(seen - set(log.sensors))]


def _cells(log: Logger, judge: Judge, source: str, narrow: bool) -> tuple[str, tuple[str, ...]]:
    """Return the state of a channel, and its cells."""
    name, fault, value = log.name_of(source), log.watch.faults.get(source), log.watch.values.get(source)
    if fault:
        return "fault", (name, "FAULT", "", fault, "")
    if value is None:
        return "", (name, "-", "", "", "")
    sensor, found = log.sensors.get(source), judge.of(source)
    offset = sensor.certificate.offset if sensor is not None and sensor.certificate is not None else 0.0
    shown = f"{value - offset:.2f}"
    if found is None:
        return "too early", (name, shown, "", "too early", "")
    rate = "" if found.rate is None or found.error is None else f"{found.rate * HOUR:+.2f}"
    if rate and not narrow:
        rate += f" +- {(found.error or 0.0) * HOUR:.2f}"
    return found.verdict, (name, shown, rate, _when(log, found), _end(found, narrow))


def _when(log: Logger, found: Outlook) -> str:
    """Return the verdict of the rule, and when it will hold."""
    holds = None if found.forecast is None else found.forecast.holds
    left = None if holds is None else holds - log.state.seconds
    if found.verdict != "not stable" or left is None or left <= 0.0:
        return found.verdict
    for limit, size, unit in ((5400.0, HOUR, "h"), (90.0, 60.0, "min"), (0.0, 1.0, "s")):
        if left >= limit:
            return f"in {left / size:.2g} {unit}" if left / size < 10.0 else f"in {left / size:.0f} {unit}"
    return found.verdict


def _end(found: Outlook, narrow: bool) -> str:
    """Return where a channel will end, or that nobody can say yet."""
    if found.forecast is None:
        return ""
    if found.forecast.declined:
        return "open"
    final = found.forecast.final
    return f"{final.value - ICE:.2f}" + ("" if narrow else f" +- {final.error:.2f}")


def _joined(cells: Sequence[str], widths: Sequence[int]) -> str:
    """Return a line: the name to the left, numbers to the right."""
    first = _short(cells[0], widths[0]).ljust(widths[0])
    return "  ".join([first, *(cell.rjust(width) for cell, width in zip(cells[1:], widths[1:], strict=True))])


def _short(name: str, width: int) -> str:
    """Return a name without its middle: names of one kind differ at their ends, ROMs too."""
    if len(name) <= width:
        return name
    tail = (width - 2) // 2
    return f"{name[: width - 2 - tail]}..{name[len(name) - tail :]}"


def plain_line(log: Logger, judge: Judge) -> str:
    """Return the table as one line, for an output that is no terminal."""
    cells = [_cells(log, judge, source, True)[1] for source in _sources(log)]
    said = []
    for name, value, rate, verdict, end in cells:
        text = f"{name} {value} degC" if value not in ("FAULT", "-") else f"{name} {value} {verdict}".rstrip()
        if rate:
            text += f" ({rate} K/h, {verdict}" + (f", will end at {end}" if end not in ("", "open") else "") + ")"
        said.append(text)
    others = _others(log)
    return f"{duration_text(log.state.seconds)}: " + ", ".join([*said, *([others] if others else [])])
