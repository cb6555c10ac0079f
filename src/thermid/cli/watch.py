"""The command that watches a running test: watch."""

from __future__ import annotations

import json
import re
import time as clock
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import numpy as np
import typer

from thermid.cli.options import Boundaries, ScenarioPath, pairs, with_unit
from thermid.errors import RecordError
from thermid.extensions import extension
from thermid.measure.amounts import amount
from thermid.measure.readers.log_reader import read_record, temperature_columns
from thermid.measure.record.record import Record
from thermid.measure.record.steadiness import rule_of
from thermid.model.deck.modelfile import load_model
from thermid.model.laws.signal import literal
from thermid.model.tree.model import Model
from thermid.reporting.pages.views import clean
from thermid.simulation.scenario_file import load_scenario
from thermid.simulation.scenarios.scenario import Scenario
from thermid.units import TEMPERATURE
from thermid.watch.growing import GrowingLog
from thermid.watch.stopping import Stopping, TemperatureLimit
from thermid.watch.watcher import Watcher, WatchLook

if TYPE_CHECKING:
    from thermid.acquire.capture import PortCapture

PORT: Final = "a serial port that is watched"


def watch(
    log: Annotated[
        Path, typer.Argument(help="A log that grows: text, or of the bench as 'thermid log' writes it; or a serial port that sends lines.")
    ],
    channel: Annotated[list[str], typer.Option("--channel", help="Temperature column, or COLUMN=NODE; all of them by default.")] = [],  # noqa: B006
    rule: Annotated[str, typer.Option("--rule", help="The plan's own rule of stability, such as '3 C/h' or '1 K over 4 h'.")] = "3 C/h",
    required: Annotated[bool, typer.Option("--required", help="The plan asks that its rule holds; no stop is advised before.")] = False,
    within: Annotated[str, typer.Option("--within", help="Half of the interval of where a channel ends, at most.")] = "1 [K]",
    limit: Annotated[list[str], typer.Option("--limit", help="CHANNEL=TEMPERATURE that must be decided; may be repeated.")] = [],  # noqa: B006
    slowest: Annotated[str | None, typer.Option("--slowest", help="Longest time constant that the unit can have, without a model.")] = None,
    since: Annotated[str, typer.Option("--since", help="When conditions last changed.")] = "start",
    model: Annotated[Path | None, typer.Option("--model", help="Deck of the unit: nodes without sensors, faults with suspects.")] = None,
    scenario: ScenarioPath = None,
    boundary: Boundaries = [],  # noqa: B006
    noise: Annotated[str, typer.Option("--noise", help="Noise of one reading.")] = "0.05 [K]",
    every: Annotated[str, typer.Option("--every", help="Time between looks.")] = "60 [s]",
    replay: Annotated[bool, typer.Option("--replay", help="Look at a log that ended as if it grew.")] = False,
    capture: Annotated[Path | None, typer.Option("--capture", help="File that keeps the lines of a serial port.")] = None,
    once: Annotated[bool, typer.Option("--once", help="Look once and leave.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object per look and line.")] = False,
) -> None:
    """Watch a running test: when to stop, and what went wrong.

    Temperatures that nobody measures are estimated with a model. Exit code 0 at a stop, 1 with an alarm, 4 if no stop is advised.
    """
    step = literal(with_unit(every, "s"), "s", "--every")
    if not step > 0.0:
        raise RecordError(f"the time between looks is above zero, not '{every}'.", "--every")
    deck = None if model is None else load_model(model)
    said = load_scenario(scenario) if scenario is not None else Scenario(log.name) if boundary else None
    said = (
        said.with_(boundaries={n: with_unit(t, "degC") for n, t in pairs(boundary, "--boundary").items()})
        if said is not None and boundary
        else said
    )
    if capture is not None and not _is_port(log):
        raise RecordError(f"'{log}' is no serial port, whose lines could be kept. Leave --capture out.", "--capture")
    made = _Made(rule, within, limit, slowest, deck, said, required)
    with ExitStack() as open_:
        line = open_.enter_context(extension(PORT, str(log))(log, capture)) if _is_port(log) else None
        path = log if line is None else line.path

        def read(piece: Path) -> Record:
            return _read(piece, path.stem, channel, noise)

        if replay or once:
            look = _looks(_replayed(read(path).trim(with_unit(since, "s"), "end"), step, once), made, as_json)
        else:
            look = _looks(_growing(GrowingLog(path, read), step, since, line), made, as_json)
    raise SystemExit(4 if look is None else 1 if look.alarms else {"stop": 0}.get(look.advice.word, 4))


def _looks(records: Iterator[Record], made: _Made, as_json: bool) -> WatchLook | None:
    """Look at every record up to a stop and say what is seen; return the last look."""
    watcher: Watcher | None = None
    look: WatchLook | None = None
    for record in records:
        watcher = watcher or made.watcher(record)
        look = watcher.look(record)
        typer.echo(json.dumps(clean({"schema": 1, **look.as_object()})) if as_json else str(look))
        if look.advice.word == "stop":
            break
    return look


def _replayed(record: Record, step: float, once: bool) -> Iterator[Record]:
    """Yield a log that ended as if it grew, or all of it once. [s]"""
    at, first, end = float(record.times[0]), float(record.times[0]), float(record.times[-1])
    while at < end and not once:
        at = min(at + step, end)
        if at - first >= 10.0 * record.step:
            yield record.trim(first, at)
    if once or end - first < 10.0 * record.step:
        yield record


def _growing(log: GrowingLog, step: float, since: str, line: PortCapture | None) -> Iterator[Record]:
    """Yield a log every time that something came. [s]"""
    seen = -1.0
    while True:
        record = log.record()
        if record is not None and record.times[-1] > seen:
            seen = float(record.times[-1])
            start = literal(with_unit(since, "s"), "s", "--since") if since != "start" else float(record.times[0])
            if np.count_nonzero(record.times >= start) > 1:
                yield record.trim(start, "end")
        if line is None:
            clock.sleep(step)
        else:
            line.listen(step)


def _is_port(path: Path) -> bool:
    """Whether a path is a serial port and no file."""
    return path.is_char_device() or re.fullmatch(r"COM\d+", path.name) is not None


@dataclass(frozen=True)
class _Made:
    """What a watcher is made of, once the first lines of the log say which channels there are."""

    rule: str
    within: str
    limit: list[str]
    slowest: str | None
    deck: Model | None
    said: Scenario | None
    required: bool

    def watcher(self, record: Record) -> Watcher:
        """Return what watches."""
        names = tuple(n for n in record.channels if record.channel(n).role == "node" and record.channel(n).quantity == "temperature")
        limits = tuple(
            TemperatureLimit(n, False, literal(with_unit(t, "degC"), TEMPERATURE, "--limit"))
            for n, t in pairs(self.limit, "--limit").items()
        )
        for m in limits:
            record.channel(m.channel)
        width = amount(with_unit(self.within, "K"), "K", "--within")
        more: dict[str, Any] = {} if self.slowest is None else {"slowest": with_unit(self.slowest, "s")}
        if self.deck is None:
            return Watcher(Stopping(rule_of(self.rule), width, limits, required=self.required, **more), names)
        more |= {"model": self.deck, "scenario": self.said or Scenario(record.name)}
        return Watcher(Stopping(rule_of(self.rule), width, limits, required=self.required, **more), names, self.deck, self.said)


def _read(log: Path, name: str, channel: list[str], noise: str) -> Record:
    """Return a log, or a piece of one, as a record of a given name."""
    sits = {n: node or n for n, _, node in (text.partition("=") for text in channel)}
    names = list(sits) or temperature_columns(log)
    if not names:
        raise RecordError("no column looks like a temperature. Name them with --channel.", log.name)
    return read_record(log, {n: {"node": sits.get(n, n), "noise": with_unit(noise, "K")} for n in names}, name=name)
