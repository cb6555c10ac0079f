"""The bench on disk and on the screen: log, with the outlook of its channels and the live table."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from types import TracebackType
from typing import Annotated

import typer
from rich.console import Console
from rich.live import Live
from rich.table import Table

from thermid.base.errors import RecordError, require, spoken
from thermid.base.units import HOUR, ICE_POINT, TEMPERATURE, amount, duration_text, positive_seconds
from thermid.bench.bench_files import load_programme, load_sensors
from thermid.bench.guide import ice_point as guided_ice_point, name_sensors
from thermid.bench.logger import Logger, Settings
from thermid.bench.port import check_port, find_port
from thermid.measure.records import ICE, MIN_JUDGED_WINDOW, Channel, Record, StabilityRule
from thermid.qualify.steadiness import MIN_FORECAST_READINGS, Forecast, forecast

_SHARE = 0.1
"""Share of a processor that it takes: the logger comes first."""
_WORST = ("fault", "not stable", "cannot tell", "too early", "", "stable")
_STYLE = {"fault": "bold red", "not stable": "yellow", "cannot tell": "yellow", "stable": "green"}


def log(
    file: Annotated[Path, typer.Argument(help="The log; it is continued where it exists.")],
    port: Annotated[str | None, typer.Option("--port", help="Serial port; the only board that is found by default.")] = None,
    sensors: Annotated[Path | None, typer.Option("--sensors", help="Sensor map (TOML): ROM to channel.")] = None,
    programme: Annotated[Path | None, typer.Option("--programme", help="Heater programme (TOML).")] = None,
    interval: Annotated[str, typer.Option("--interval", help="Time between samples.")] = "1 [s]",
    limit: Annotated[str, typer.Option("--limit", help="Temperature of any sensor at which heaters go off.")] = "100 [degC]",
    rule: Annotated[str, typer.Option("--rule", help="Rule of stability, as of `thermid settle`: '3 C/h', '0.5 K/h over 1 h'.")] = "3 C/h",
    duration: Annotated[str | None, typer.Option("--for", help="End after this time of the board, such as '5 [h]'.")] = None,
    identify: Annotated[bool, typer.Option("--identify", help="Find out which sensor is which by warming them; writes --sensors.")] = False,
    ice_point: Annotated[
        bool, typer.Option("--ice-point", help="Sensors stand in ice water: write their certificates to --sensors.")
    ] = False,
    clear_latch: Annotated[
        bool, typer.Option("--clear-latch", help="Allow heaters again that the board has cut off. Look at the hardware first.")
    ] = False,
) -> None:
    """Log sensors and heaters of a bench to disk, with faults marked.

    Every line is on disk before the next is read. Faults, resets and cable pulls are marked, and logging goes on.
    """
    require("log", "a serial port")
    settings = Settings(positive_seconds(interval, "--interval"), limit=amount(limit, TEMPERATURE, "--limit") - ICE_POINT)
    if (identify or ice_point) and sensors is None:
        raise RecordError(
            "the map that is to be written must be named: --sensors sensors.toml.", "--identify, --ice-point", code="value.incomplete"
        )
    sensor_map = load_sensors(sensors) if sensors is not None and (sensors.exists() or not identify) else {}
    steps = load_programme(programme) if programme is not None else None
    end = positive_seconds(duration, "--for") if duration is not None else None
    with ExitStack() as stack:
        # a question to the user is broken off by Ctrl-C itself; all else ends between two lines
        stop_signals = [] if identify or ice_point else stack.enter_context(_asked_to_end())
        check_port(port or find_port())  # a missing board is an error and not a wait
        find: Callable[[], str] = find_port if port is None else lambda: port
        logger = Logger(file, find, sensor_map, settings, steps, clear_latch=clear_latch)
        if logger.store.session > 1:
            typer.echo(f"{file} is continued: start {logger.store.session} of it.", err=True)
        stack.callback(_closed, logger)
        if identify or ice_point:
            _guided(logger, sensors, identify)
        else:
            _logged(logger, end, rule, stop_signals)
    marks = ", ".join(f"{word} {count}" for word, count in logger.marks.items() if word not in ("port", "wall", "end"))
    faulty = sum(logger.watch.counts.values())
    typer.echo(f"{file}: {logger.state.lines} lines, {logger.state.missing} missing, {faulty} faulty values. Marks: {marks or 'none'}.")
    if logger.store.waiting:
        where = f"are in {logger.store.rest}; append them to the log when there is room" if logger.store.rest else "are lost"
        raise RecordError(f"the disk is full: the last {logger.store.waiting / 1e3:.0f} kB {where}.", str(file), code="bench.log")


def _closed(logger: Logger) -> None:
    """Close a log to its end, however often somebody asks: heaters are turned off there."""
    with _asked_to_end():
        logger.close()


def _logged(logger: Logger, end: float | None, rule: str, stop_signals: Sequence[int]) -> None:
    """Log until the end of the programme, the given time, or Ctrl-C."""

    def ended() -> bool:
        """Whether the log ends: by a signal, the programme, or the time asked for."""
        return bool(stop_signals) or logger.done or (end is not None and logger.state.seconds >= end)

    console = Console()
    with Judge(logger, rule) as judge:
        if console.is_terminal and not console.is_dumb_terminal:
            _shown(logger, judge, console, ended)
        else:
            _log_in_lines(logger, judge, ended)
    if stop_signals:
        typer.echo("stopped; heaters off")


@contextmanager
def _asked_to_end() -> Iterator[list[int]]:
    """Collect what asks the program to end, so that no line is lost between port and disk; what is ignored stays so (nohup)."""
    signals: list[int] = []
    numbers = [signal.SIGINT, signal.SIGTERM, *([signal.SIGHUP] if hasattr(signal, "SIGHUP") else [])]
    before = {number: signal.getsignal(number) for number in numbers}
    for number, handler in before.items():
        if handler is not signal.SIG_IGN:
            signal.signal(number, lambda number, _: signals.append(number))
    try:
        yield signals
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _shown(logger: Logger, judge: Judge, console: Console, ended: Callable[[], bool]) -> None:
    """Log, with the table in the terminal."""
    with Live(live_table(logger, judge), console=console, auto_refresh=False, vertical_overflow="crop") as live:
        last = 0.0
        while not ended():
            logger.step()
            if time.monotonic() - last > 0.5:
                last = time.monotonic()
                live.update(live_table(logger, judge), refresh=True)
        live.update(live_table(logger, judge), refresh=True)


def _log_in_lines(logger: Logger, judge: Judge, ended: Callable[[], bool]) -> None:
    """Log, with a line a minute, and marks on standard error."""
    shown, last_mark = 0.0, ""
    while not ended():
        logger.step()
        if logger.last_mark != last_mark:
            last_mark = logger.last_mark
            typer.echo(last_mark, err=True)
        if logger.elapsed - shown > 60.0 and logger.watch.values:
            shown = logger.elapsed
            typer.echo(plain_line(logger, judge))
    typer.echo(plain_line(logger, judge))


def _guided(logger: Logger, sensors: Path | None, identify: bool) -> None:
    """Take the user through identify mode or the ice point."""
    assert sensors is not None
    try:
        if identify:
            name_sensors(logger, sensors, typer.echo, typer.prompt)
        else:
            guided_ice_point(logger, sensors, typer.echo, typer.confirm)
    except (KeyboardInterrupt, typer.Abort):
        typer.echo("stopped; what was written stays")


@dataclass(frozen=True)
class Outlook:
    """What is known of one channel.

    Parameters
    ----------
    rate, error : float or None     Its drift and the error of that, None with too few readings. [K/s]
    verdict : str                   ``stable``, ``not stable``, ``cannot tell``, ``too early``.
    forecast : Forecast or None     Where it will end, None where readings are too few.
    """

    rate: float | None
    error: float | None
    verdict: str
    forecast: Forecast | None = None


class Judge:
    """Looks at one channel after the other, in a thread of its own so that no line waits for it.

    Parameters
    ----------
    log : Logger     A running log.
    rule : str       A rule of stability on the rate.

    Raises
    ------
    RecordError   When it is no rule on the rate.
    """

    def __init__(self, log: Logger, rule: str) -> None:
        self.rule: StabilityRule = StabilityRule.named(rule)
        if self.rule.stored:
            raise RecordError(
                f"'{self.rule.name}' is about stored heat, which readings alone do not show. Give a rule on the rate.",
                "--rule",
                code="record.does-not-apply",
            )
        self._log = log
        self._seen: dict[str, tuple[float, Outlook]] = {}
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> Judge:
        """Begin to look."""
        self._thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        """End."""
        self._done.set()
        self._thread.join(5.0)

    def outlook(self, source: str) -> Outlook | None:
        """Return what was found of a sensor under the present conditions, None before the first look."""
        changed, outlook = self._seen.get(source, (-1.0, None))
        return outlook if changed == self._log.state.changed else None

    def _run(self) -> None:
        """Go round: every drift, which is cheap, then one forecast."""
        turn = 0
        while not self._done.is_set():
            begun, sources = time.thread_time(), list(self._log.history)
            for source in sources:
                self._look(source, source == sources[turn % len(sources)])
            turn += 1
            # by processor time: on a busy machine it must not give way twice
            self._done.wait(min(max(0.5, (time.thread_time() - begun) * (1.0 / _SHARE - 1.0)), 5.0))

    def _look(self, source: str, ahead: bool) -> None:
        """Look at a sensor; keep the forecast of the time before, unless a new one is due or conditions have changed."""
        changed, before = self._log.state.changed, self.outlook(source)
        outlook = self.look(source, ahead)
        if not ahead and before is not None:
            outlook = replace(outlook, forecast=before.forecast)
        self._seen[source] = (changed, outlook)

    def look(self, source: str, ahead: bool = True) -> Outlook:
        """Return what the readings of a sensor say now, with a forecast if asked."""
        log, sensor = self._log, self._log.sensors.get(source)
        times, celsius = log.history[source].arrays()
        if times.size < 2:
            return Outlook(None, None, "too early")
        offset = sensor.certificate.offset if sensor is not None and sensor.certificate is not None else 0.0
        step = 2.0 ** (8 - log.state.bits.get(source, log.settings.bits))
        channel = Channel.from_array(source, celsius - offset, unit="degC", column=source, resolution=step)
        record = Record.from_arrays(log.store.path.name, times, {source: channel}, synthetic=False)
        try:
            stability = self.rule.of_channel(record, source)
        except RecordError:  # the rule looks further back than the readings go
            return Outlook(None, None, "too early")
        enough = ahead and times.size >= MIN_FORECAST_READINGS and times[-1] - times[0] >= MIN_JUDGED_WINDOW
        ahead_of_it = forecast(record, source, rule=self.rule) if enough else None
        return Outlook(stability.rate, stability.error, stability.verdict, ahead_of_it)


def live_table(log: Logger, judge: Judge) -> Table:
    """Return the table as it is: channels that need attention first, below what is said of the log, the heaters and the rule."""
    state, bad = log.state, sum(log.watch.counts.values())
    held = duration_text(state.seconds - state.changed)
    since = f"heaters as they are for {held}" if state.changed else f"watched for {held}"
    doubt = "" if judge.rule.mark != "memory" else " (its number is from memory)"
    head = [f"{log.store.path.name}  {duration_text(state.seconds)}  {state.lines} lines, {state.missing} missing, {bad} faulty"]
    head += [f"DISK FULL: {log.store.waiting / 1e3:.0f} kB wait in memory"] if log.store.waiting else []
    head += [f"rule {judge.rule.name}{doubt}; {since}"]
    table = Table(box=None, pad_edge=False, title="\n".join(head), caption=log.last_mark, title_justify="left", caption_justify="left")
    table.title_style = "bold red" if log.store.waiting else ""
    for title in ("channel", "degC", "K/h", "by the rule", "will end at"):
        table.add_column(title, justify="left" if title == "channel" else "right", overflow="fold")
    for word, cells in sorted((_cells(log, judge, source) for source in _sources(log)), key=lambda row: _WORST.index(row[0])):
        table.add_row(*cells, style=_STYLE.get(word, ""))
    return table


def _sources(log: Logger) -> list[str]:
    """Return the sensors, those of the map in its order, then heaters and supply."""
    others = sorted({*log.watch.values, *log.watch.faults, *log.state.bits}, key=lambda source: (len(source) != 16, source))
    return list(dict.fromkeys([*log.sensors, *others]))


def _cells(log: Logger, judge: Judge, source: str) -> tuple[str, tuple[str, ...]]:
    """Return the state of a channel, and its cells: name, value, drift, verdict of the rule or when it will hold, where it will end."""
    kind = "" if len(source) == 16 else source[0]  # a sensor has its ROM
    name = {"H": "heater", "V": "voltage", "I": "current", "": log.name_of(source)}[kind] + source[1:] * bool(kind)
    fault, value = log.watch.faults.get(source), log.watch.values.get(source)
    if fault:
        return "fault", (name, "FAULT", "", fault, "")
    if value is None:
        return "", (name, "-", "", "", "")
    if kind:
        return "", (name, {"H": f"{value * 100:g} %", "V": f"{value:.4g} V", "I": f"{value:.4g} A"}[kind], "", "", "")
    sensor, outlook = log.sensors.get(source), judge.outlook(source)
    offset = sensor.certificate.offset if sensor is not None and sensor.certificate is not None else 0.0
    if outlook is None:
        return "too early", (name, f"{value - offset:.2f}", "", "too early", "")
    rate = "" if outlook.rate is None or outlook.error is None else f"{outlook.rate * HOUR:+.2f} +- {outlook.error * HOUR:.2f}"
    when, end, ahead = outlook.verdict, "", outlook.forecast
    if ahead is not None:
        end = "open" if ahead.declined else f"{ahead.final.value - ICE:.2f} +- {ahead.final.error:.2f}"
        if when == "not stable" and ahead.holds is not None and ahead.holds > log.state.seconds:
            when = f"in {spoken(ahead.holds - log.state.seconds)}"
    return outlook.verdict, (name, f"{value - offset:.2f}", rate, when, end)


def plain_line(log: Logger, judge: Judge) -> str:
    """Return the table as one line, for an output that is no terminal."""
    texts = []
    for name, value, rate, verdict, end in (_cells(log, judge, source)[1] for source in _sources(log)):
        drift = f" ({rate} K/h, {verdict}{f', will end at {end}' if end not in ('', 'open') else ''})" if rate else ""
        unit = f" {verdict}" if value == "FAULT" else "" if value[-1:] in "-%VA" else " degC"
        texts.append(f"{name} {value}{unit}{drift}")
    return f"{duration_text(log.state.seconds)}: {', '.join(texts)}"
