"""``thermid log``: the bench on disk and on the screen."""

from __future__ import annotations

import signal
import time
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from rich.console import Console
    from rich.text import Text

    from thermid.acquire.boardport import BoardPort
    from thermid.acquire.logger import Logger
    from thermid.cli.judge import Judge


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command("log")(log)


def log(
    file: Annotated[Path, typer.Argument(help="The log; it is continued where it exists.")],
    port: Annotated[str | None, typer.Option("--port", help="Serial port; the only board that is found by default.")] = None,
    sensors: Annotated[Path | None, typer.Option("--sensors", help="Sensor map (TOML): ROM to channel.")] = None,
    programme: Annotated[Path | None, typer.Option("--programme", help="Heater programme (TOML).")] = None,
    interval: Annotated[str, typer.Option("--interval", help="Time between samples.")] = "1 [s]",
    bits: Annotated[int, typer.Option("--bits", help="Resolution of the sensors, 9 to 12.")] = 12,
    limit: Annotated[str, typer.Option("--limit", help="Temperature of any sensor at which heaters go off.")] = "100 [degC]",
    silence: Annotated[str, typer.Option("--silence", help="Time without this program after which the board turns heaters off.")] = "2 [s]",
    rule: Annotated[str, typer.Option("--rule", help="Rule of stability, as of `thermid settle`: '3 C/h', '0.5 K/h over 1 h'.")] = "3 C/h",
    duration: Annotated[str | None, typer.Option("--for", help="End after this time of the board, such as '5 [h]'.")] = None,
    identify: Annotated[bool, typer.Option("--identify", help="Find out which sensor is which by warming them; writes --sensors.")] = False,
    ice_point: Annotated[
        bool, typer.Option("--ice-point", help="Sensors stand in ice water: write their certificates to --sensors.")
    ] = False,
    clear_latch: Annotated[
        bool, typer.Option("--clear-latch", help="Allow heaters again that the board has cut off. Look at the hardware first.")
    ] = False,
    simulate: Annotated[bool, typer.Option("--simulate", help="No hardware: three made-up sensors at 60 times their speed.")] = False,
) -> None:
    """Log a bench: every line on disk before the next is read; faults, resets and cable pulls are marks, and it goes on."""
    from thermid.acquire.logger import Logger, Settings
    from thermid.acquire.port import check_port, find_port
    from thermid.acquire.programme import load_programme
    from thermid.acquire.sensormap import load_sensors
    from thermid.errors import RecordError
    from thermid.measure.amounts import amount, positive_seconds
    from thermid.units import TEMPERATURE

    given = Settings(
        positive_seconds(interval, "--interval"),
        bits,
        amount(limit, TEMPERATURE, "--limit") - 273.15,
        positive_seconds(silence, "--silence"),
    )
    if (identify or ice_point) and sensors is None:
        raise RecordError("the map that is to be written must be named: --sensors sensors.toml.", "--identify, --ice-point")
    known = load_sensors(sensors) if sensors is not None and (sensors.exists() or not identify) else {}
    steps = load_programme(programme) if programme is not None else None
    end = positive_seconds(duration, "--for") if duration is not None else None
    with ExitStack() as stack:
        # a question to the user is broken off by Ctrl-C itself; all else ends between two lines
        asked = [] if identify or ice_point else stack.enter_context(_asked_to_end())
        find: Callable[[], str | BoardPort] = find_port
        clock, wall = time.monotonic, time.time
        if simulate:
            from thermid.acquire.demo import simulated

            board = simulated()
            find, clock, wall = lambda: board, board.clock, board.wall
        elif port is not None:
            check_port(port)  # a first look, so that a missing board is an error and not a wait
            find = lambda: port  # noqa: E731
        else:
            check_port(find_port())
        made = Logger(file, find, known, given, steps, clear_latch=clear_latch, clock=clock, wall=wall)
        if made.store.session > 1:
            typer.echo(f"{file} is continued: start {made.store.session} of it.", err=True)
        stack.callback(_closed, made)
        if identify or ice_point:
            _guided(made, sensors, identify)
        else:
            _run(made, end, rule, asked)
    marks = ", ".join(f"{word} {count}" for word, count in made.marks.items() if word not in ("port", "wall", "end"))
    faulty = sum(made.watch.counts.values())
    typer.echo(f"{file}: {made.state.lines} lines, {made.state.missing} missing, {faulty} faulty values. Marks: {marks or 'none'}.")
    if made.store.waiting:
        where = f"are in {made.store.rest}; append them to the log when there is room" if made.store.rest else "are lost"
        raise RecordError(f"the disk is full: the last {made.store.waiting / 1e3:.0f} kB {where}.", str(file))


def _closed(made: Logger) -> None:
    """Close a log to its end, however often somebody asks: heaters are turned off there."""
    with _asked_to_end():
        made.close()


def _run(made: Logger, end: float | None, rule: str, asked: Sequence[int]) -> None:
    """Log until the end of the programme, the given time, or Ctrl-C."""
    from rich.console import Console

    from thermid.cli.judge import Judge

    def ended() -> bool:
        return bool(asked) or made.done or (end is not None and made.state.seconds >= end)

    console = Console()
    with Judge(made, rule) as judge:
        if console.is_terminal and not console.is_dumb_terminal:
            _shown(made, judge, console, ended)
        else:
            _told(made, judge, ended)
    if asked:
        typer.echo("stopped; heaters off")


@contextmanager
def _asked_to_end() -> Iterator[list[int]]:
    """Collect what asks the program to end, so that no line is lost between port and disk; what is ignored stays so (nohup)."""
    asked: list[int] = []
    numbers = [signal.SIGINT, signal.SIGTERM, *([signal.SIGHUP] if hasattr(signal, "SIGHUP") else [])]
    before = {number: signal.getsignal(number) for number in numbers}
    for number, handler in before.items():
        if handler is not signal.SIG_IGN:
            signal.signal(number, lambda number, _: asked.append(number))
    try:
        yield asked
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _shown(made: Logger, judge: Judge, console: Console, ended: Callable[[], bool]) -> None:
    """Log, with the table in the terminal."""
    from rich.live import Live

    from thermid.cli.live import live_table

    def table() -> Text:
        return live_table(made, judge, console.width, console.height - 1)

    with Live(table(), console=console, auto_refresh=False, vertical_overflow="crop") as live:
        last = 0.0
        while not ended():
            made.step()
            if time.monotonic() - last > 0.5:
                last = time.monotonic()
                live.update(table(), refresh=True)
        live.update(table(), refresh=True)


def _told(made: Logger, judge: Judge, ended: Callable[[], bool]) -> None:
    """Log, with a line a minute, and marks on standard error."""
    from thermid.cli.live import plain_line

    shown, told = 0.0, ""
    while not ended():
        made.step()
        if made.last_mark != told:
            told = made.last_mark
            typer.echo(told, err=True)
        if made.elapsed - shown > 60.0 and made.watch.values:
            shown = made.elapsed
            typer.echo(plain_line(made, judge))
    typer.echo(plain_line(made, judge))


def _guided(made: Logger, sensors: Path | None, identify: bool) -> None:
    """Take the user through identify mode or the ice point."""
    from thermid.acquire.guide import ice_point, tell_apart

    assert sensors is not None
    try:
        if identify:
            tell_apart(made, sensors, typer.echo, typer.prompt)
        else:
            ice_point(made, sensors, typer.echo, typer.confirm)
    except (KeyboardInterrupt, typer.Abort):
        typer.echo("stopped; what was written stays")
