"""Commands of a running test: watch, settle."""

from __future__ import annotations

import json
import math
import time as clock
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Final

import numpy as np
import typer

from thermid.app.cli.options import (
    Boundaries,
    Data,
    Json,
    Results,
    ScenarioPath,
    ValuesPath,
    Whole,
    fitted_model,
    leave,
    pairs,
    say,
    scenario_of,
    with_unit,
)
from thermid.app.cli.summary import staged
from thermid.app.texts import add_codes
from thermid.base.errors import RecordError, refuse_unknown
from thermid.base.results import clean
from thermid.base.units import TEMPERATURE, amount, duration_text
from thermid.campaign.stages import RunningTest
from thermid.measure.readers import read_record, temperature_columns
from thermid.measure.records import Record, StabilityRule
from thermid.model.tree import UNJUDGED, Standing, literal, load_model
from thermid.qualify.steadiness import Forecast, forecast, stability
from thermid.qualify.watch import BoundColumns, GrowingLog, TemperatureLimit, Watcher, WatchLook, WatchRequest, replayed
from thermid.simulation.runs import Scenario, load_scenario, simulate

READ_KEYS: Final = ("time", "separator", "decimal", "clock")
"""What a log may leave open, with the keys of a record."""
MIN_SILENCE: Final = 60.0
"""Without a new reading before that is told, at least. [s]"""


Channels = Annotated[
    list[str],
    typer.Option(
        "--channel",
        help="Column, or 'COLUMN=NODE [UNIT]', a BOUNDARY or LOAD; of a duty its power at 100 %, 'Q1=heater [12 W]'. By default what has "
        "a name of the deck's.",
    ),
]
LogPath = Annotated[Path, typer.Argument(help="A log that grows: text, or of the bench as 'thermid log' writes it.")]
LikeCampaign = Annotated[
    Path | None, typer.Option("--campaign", help="A campaign: its record has the meaning of the columns, the last stage with it the model.")
]


def watch(
    log: LogPath,
    channel: Channels = [],  # noqa: B006
    reading: Annotated[
        list[str], typer.Option("--read", help="KEY=VALUE of a record's time, separator, decimal or clock, such as clock='%d/%m/%Y %H:%M'.")
    ] = [],  # noqa: B006
    rule: Annotated[str, typer.Option("--rule", help="The plan's own rule of stability, such as '3 C/h' or '1 K over 4 h'.")] = "3 C/h",
    within: Annotated[str, typer.Option("--within", help="Half of the interval of where a channel ends, at most.")] = "1 [K]",
    limit: Annotated[list[str], typer.Option("--limit", help="CHANNEL=TEMPERATURE that must be decided; may be repeated.")] = [],  # noqa: B006
    slowest: Annotated[str | None, typer.Option("--slowest", help="Longest time constant that the unit can have, without a model.")] = None,
    since: Annotated[str, typer.Option("--since", help="When conditions last changed.")] = "start",
    model: Annotated[Path | None, typer.Option("--model", help="Deck of the unit: nodes without sensors, faults with suspects.")] = None,
    values: ValuesPath = None,
    campaign: LikeCampaign = None,
    record: Annotated[str, typer.Option("--record", help="The record of the campaign that the log is like.")] = "",
    scenario: ScenarioPath = None,
    boundary: Boundaries = [],  # noqa: B006
    every: Annotated[str, typer.Option("--every", help="Time between two readings of the log.")] = "60 [s]",
    mode: Annotated[str, typer.Option("--look", help="How to look at the log: growing, once, or replay of one that ended.")] = "growing",
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object per look and line.")] = False,
    data: Data = None,
    results: Results = None,
) -> None:
    """Watch a running test: when to stop, and what went wrong.

    Temperatures that nobody measures are estimated with a model. Exit code 0 at a stop, 1 with an alarm, 4 if no stop is advised.
    """
    step = literal(with_unit(every, "s"), "s", "--every")
    if not step > 0.0:
        raise RecordError(f"the time between two looks must be above zero, not '{every}'.", "--every", code="value.outside-range")
    refuse_unknown([mode], ("growing", "once", "replay"), "--look")
    by_hand = model is not None or values is not None or bool(channel)
    if by_hand if campaign is not None else bool(record):
        words = "give a campaign with --record, or a deck with --model, --values and --channel."
        raise RecordError(words, "command line", code="value.incomplete")
    stated = scenario_of(scenario, boundary, [], None, None) if boundary or scenario is not None else None
    read = pairs(reading, "--read")
    refuse_unknown(read, READ_KEYS, "--read")
    test = (
        None if campaign is None else RunningTest.of_campaign(staged(campaign, data, results, records=[record] if record else []), record)
    )
    if test is None:
        columns = BoundColumns(*_column_bindings(channel), None if model is None else fitted_model(model, values, None), read)
    else:
        columns = BoundColumns({}, {}, {}, test.model, test.options | read, dict(test.table.channels), test.bound, test.remarks)
    standing = UNJUDGED if columns.model is None else columns.model.standing
    request = _request(columns, test, stated, rule, within, limit, slowest, since)
    if log.is_char_device():
        raise RecordError(
            "this is a port. Write its lines to a file, by `thermid log` or another logger, and watch that.",
            str(log),
            code="file.not-a-file",
        )
    if mode == "growing":
        records = _growing(GrowingLog(log, lambda piece: columns.read(piece, log.stem)), step, since)
    else:
        records = replayed(request.read(log), step if mode == "replay" else math.inf)
    look = _looks(records, request, standing, as_json)
    leave(standing, 4 if look is None else 1 if look.alarms else {"stop": 0}.get(look.advice.word, 4))


def _column_bindings(channel: list[str]) -> tuple[dict[str, str], dict[str, str], dict[str, str]]:
    """Return what columns are bound to, their powers at 100 % and their units, of ``COLUMN=PATH [UNIT]`` or less of it.

    A number stands before the unit of a power at 100 %: ``Q1=heater [12 W]``.
    """
    parts = {n.strip(): rest.partition("[") for n, _, rest in (text.partition("=") for text in channel)}
    brackets = {n: text.strip(" ]").rpartition(" ") for n, (_, bracket, text) in parts.items() if bracket}
    full_scale = {n: f"{number} [{unit}]" for n, (number, _, unit) in brackets.items() if number}
    units = {n: unit for n, (number, _, unit) in brackets.items() if not number}
    return {n: path.strip() or n for n, (path, _, _) in parts.items()}, full_scale, units


def _looks(records: Iterator[Record], request: WatchRequest, standing: Standing, as_json: bool) -> WatchLook | None:
    """Look at every record up to a stop and say what is seen, below what must be known of the values; return the last look."""
    watcher: Watcher | None = None
    look: WatchLook | None = None
    for record in records:
        first = watcher is None
        watcher = watcher or request.watcher(record)
        look = watcher.look(record)
        text = str(look) if first or look.advice.word == "stop" else look.without_inputs()
        content = {"schema": 1, **look.as_object(), "standing": standing.to_dict()}
        typer.echo(json.dumps(clean(add_codes(content))) if as_json else standing.over(text))
        if look.advice.word == "stop":
            break
    return look


def _request(
    columns: BoundColumns,
    test: RunningTest | None,
    stated: Scenario | None,
    rule: str,
    within: str,
    limit: list[str],
    slowest: str | None,
    since: str,
) -> WatchRequest:
    """Return what the log is watched by, of the texts of the options."""
    width, begin = amount(with_unit(within, "K"), "K", "--within"), with_unit(since, "s")
    limits = {n: literal(with_unit(t, "degC"), TEMPERATURE, "--limit") for n, t in pairs(limit, "--limit").items()}
    decided = tuple(TemperatureLimit(n, False, kelvin) for n, kelvin in limits.items())
    longest = None if slowest is None else with_unit(slowest, "s")
    conditions = None if test is None else test.conditions
    return WatchRequest(columns, StabilityRule.named(rule), width, decided, longest, begin, stated, conditions)


def _growing(log: GrowingLog, step: float, since: str) -> Iterator[Record]:
    """Yield a log every time that something came. [s]"""
    latest, came, silent = -1.0, clock.monotonic(), False
    while True:
        record = log.record()
        if record is not None and record.times[-1] > latest:
            latest, came, silent = float(record.times[-1]), clock.monotonic(), False
            start = literal(with_unit(since, "s"), "s", "--since") if since != "start" else float(record.times[0])
            if np.count_nonzero(record.times >= start) > 1:
                yield record.trim(start, "end")
        elif record is not None and not silent and clock.monotonic() - came > max(MIN_SILENCE, 10.0 * record.step, 3.0 * step):
            silent = True
            waited = duration_text(round(clock.monotonic() - came))
            typer.echo(f"ALARM logger: no new reading for {waited}. Check the logger; the last one was at {latest:.0f} s.", err=True)
        clock.sleep(step)


def settle(
    log: Annotated[Path, typer.Argument(help="A text log, also one that still grows.")],
    channel: Annotated[
        list[str],
        typer.Option("--channel", help="Temperature column, or COLUMN=NODE; by default every column whose name or unit is a temperature."),
    ] = [],  # noqa: B006
    time: Annotated[str | None, typer.Option("--time", help="The time column, where its name does not say.")] = None,
    rule: Annotated[str, typer.Option("--rule", help="Rule of stability: '3 C/h', '0.2 C/h over 5 h', '0.5 K/h over 1 h'.")] = "3 C/h",
    since: Annotated[str, typer.Option("--since", help="When conditions last changed.")] = "start",
    slowest: Annotated[str | None, typer.Option("--slowest", help="Longest time constant that the unit can have, if known.")] = None,
    within: Annotated[str, typer.Option("--within", help="Half of the forecast's interval, at most.")] = "1 [K]",
    model: Annotated[Path | None, typer.Option("--model", help="Deck whose time constants are used; with --scenario.")] = None,
    scenario: Annotated[Path | None, typer.Option("--scenario", help="Conditions of the stretch (TOML).")] = None,
    verbose: Whole = False,
    as_json: Json = False,
) -> None:
    """Check whether a log is stable and forecast where it ends.

    Exit code 1 if the log is not stable by the rule, 4 if it cannot decide.
    """
    if not amount(with_unit(within, "K"), "K", "--within") > 0.0:
        raise RecordError(f"half of an interval is above zero, not '{within}'.", "--within", code="value.outside-range")
    record = _read(log, channel, time)
    names = list(record.channels)
    begin = with_unit(since, "s")
    deck = None if model is None else load_model(model)
    conditions = None if scenario is None else load_scenario(scenario)
    run = simulate(deck, conditions) if deck is not None and conditions is not None and StabilityRule.named(rule).stored else None
    stable = stability(record, rule, names, since=begin, run=run)
    ends: dict[str, Forecast | str] = {}
    for name in names:
        try:
            ends[name] = forecast(
                record,
                name,
                since=begin,
                rule=rule,
                within=with_unit(within, "K"),
                slowest=None if slowest is None else with_unit(slowest, "s"),
                model=deck,
                scenario=conditions,
            )
        except RecordError as error:
            if model is not None or slowest is not None:
                raise
            ends[name] = error.message
    lines = [str(stable), *(f"{name}: no forecast. {f}" if isinstance(f, str) else str(f) for name, f in ends.items())]
    forecasts = {name: {"declined": f} if isinstance(f, str) else f.as_object() for name, f in ends.items()}
    say(as_json, {**stable.as_object(), "forecasts": forecasts}, "\n".join(lines), verbose)
    raise SystemExit({"stable": 0, "not stable": 1, "cannot tell": 4}[stable.verdict])


def _read(log: Path, channel: list[str], time: str | None) -> Record:
    """Return the temperatures of a log."""
    sits = {n: node or n for n, _, node in (text.partition("=") for text in channel)}
    names = list(sits) or temperature_columns(log, time)
    if not names:
        raise RecordError("no column looks like a temperature. Name them with --channel.", log.name, code="record.nothing-there")
    return read_record(log, {n: {"node": sits.get(n, n)} for n in names}, time=time)
