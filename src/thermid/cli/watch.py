"""The command that watches a running test: watch."""

from __future__ import annotations

import json
import time as clock
from pathlib import Path
from typing import Annotated, Any

import typer

from thermid.cli.options import Boundaries, ScenarioPath, pairs, with_unit
from thermid.errors import MissingDataError, RecordError
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
from thermid.watch.stopping import Stopping, TemperatureLimit
from thermid.watch.watcher import Watcher, WatchLook


def watch(
    log: Annotated[Path, typer.Argument(help="A log that grows: text, or of the bench as 'thermid log' writes it.")],
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
    watcher: Watcher | None = None
    look: WatchLook | None = None
    at, seen = 0.0, -1.0
    while True:
        record = _read(log, channel, noise, since, growing=not (once or replay))
        if record is not None and watcher is None:
            watcher = _watcher(record, rule, within, limit, slowest, deck, said, required)
            at = float(record.times[0])
        if record is not None and watcher is not None:
            end = float(record.times[-1])
            at = min(at + step, end) if replay else end
            part = record.trim(float(record.times[0]), at) if replay and at - float(record.times[0]) >= 10.0 * record.step else record
            if at > seen and (not replay or part is not record):
                seen, look = at, watcher.look(part)
                typer.echo(json.dumps(clean({"schema": 1, **look.as_object()})) if as_json else str(look))
            if replay and at >= end:
                break
        if once or (look is not None and look.advice.word == "stop"):
            break
        if not replay:
            clock.sleep(step)
    raise SystemExit(4 if look is None else 1 if look.alarms else {"stop": 0}.get(look.advice.word, 4))


def _watcher(
    record: Record,
    rule: str,
    within: str,
    limit: list[str],
    slowest: str | None,
    deck: Model | None,
    said: Scenario | None,
    required: bool,
) -> Watcher:
    """Return what watches, from the first lines of the log on."""
    names = tuple(n for n in record.channels if record.channel(n).role == "node" and record.channel(n).quantity == "temperature")
    limits = tuple(
        TemperatureLimit(n, False, literal(with_unit(t, "degC"), TEMPERATURE, "--limit")) for n, t in pairs(limit, "--limit").items()
    )
    for m in limits:
        record.channel(m.channel)
    width = amount(with_unit(within, "K"), "K", "--within")
    more: dict[str, Any] = {} if slowest is None else {"slowest": with_unit(slowest, "s")}
    if deck is not None:
        more |= {"model": deck, "scenario": said or Scenario(record.name)}
        return Watcher(Stopping(rule_of(rule), width, limits, required=required, **more), names, deck, said)
    return Watcher(Stopping(rule_of(rule), width, limits, required=required, **more), names)


def _read(log: Path, channel: list[str], noise: str, since: str, growing: bool) -> Record | None:
    """Return the log as far as it is written; None where nothing can be read yet."""
    sits = {n: node or n for n, _, node in (text.partition("=") for text in channel)}
    try:
        names = list(sits) or temperature_columns(log)
        if not names:
            raise RecordError("no column looks like a temperature. Name them with --channel.", log.name)
        asked = {n: {"node": sits.get(n, n), "noise": with_unit(noise, "K")} for n in names}
        return read_record(log, asked).trim(with_unit(since, "s"), "end")
    except (RecordError, MissingDataError):
        if not growing:
            raise
        return None  # its first lines are still to come
