"""The live table of a log: value, rate, settled or not, where it is going."""

from __future__ import annotations

from typing import TYPE_CHECKING

from thermid.acquire.logger import Logger
from thermid.measure.amounts import duration_text

if TYPE_CHECKING:
    from rich.table import Table

__all__ = ["live_table", "plain_line"]


def live_table(log: Logger) -> Table:
    """Return the table of the terminal as it stands."""
    from rich.table import Table

    state, bad = log.state, sum(log.watch.counts.values())
    title = f"{log.store.path.name}: {duration_text(state.seconds)}, {state.lines} lines, {state.missing} missing, {bad} faulty values"
    if log.store.waiting:
        title += f", DISK FULL: {log.store.waiting / 1e3:.0f} kB wait"
    table = Table(title=title, caption=log.last_mark[:100], title_justify="left", caption_justify="left")
    for word in ("channel", "value", "rate [K/h]", f"settled (< {log.settings.settled:g} K/h)", "forecast"):
        table.add_column(word, justify="left" if word in ("channel", "forecast") else "right")
    for row in _rows(log):
        table.add_row(*row)
    return table


def _rows(log: Logger) -> list[tuple[str, str, str, str, str]]:
    """Return the cells of the table, sensors first, in the order of the map."""
    known = [*log.sensors, *sorted({*log.watch.values, *log.watch.faults} - set(log.sensors), key=lambda s: (len(s) != 16, s))]
    rows = []
    for source in known:
        fault, value = log.watch.faults.get(source), log.watch.values.get(source)
        trend = log.trends.get(source)
        rate = trend.rate if trend is not None else None
        shown = f"FAULT {fault}" if fault else "-" if value is None else _value(source, value)
        sensor = log.sensors.get(source)
        if value is not None and not fault and sensor is not None and sensor.certificate is not None:
            shown = _value(source, value - sensor.certificate.offset)
        forecast = trend.forecast() if trend is not None else None
        rows.append(
            (
                log.name_of(source) if len(source) == 16 else {"H": "heater ", "V": "voltage ", "I": "current "}[source[0]] + source[1],
                shown,
                "" if rate is None else f"{rate * 3600.0:+.2f}",
                "" if trend is None or rate is None else "yes" if trend.settled else "no",
                "" if forecast is None else f"{forecast[0]:.1f} degC, settled in {duration_text(forecast[1])}",
            )
        )
    return rows


def _value(source: str, value: float) -> str:
    """Return a value with its unit."""
    if len(source) == 16:
        return f"{value:.2f} degC"
    return {"H": f"{value * 100:.1f} %", "V": f"{value:.3f} V", "I": f"{value:.4f} A"}[source[0]]


def plain_line(log: Logger) -> str:
    """Return the table as one line, for an output that is no terminal."""
    cells = ", ".join(f"{name} {value}" + (f" ({rate} K/h)" if rate else "") for name, value, rate, _, _ in _rows(log))
    return f"{duration_text(log.state.seconds)}: {cells}"
