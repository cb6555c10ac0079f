"""``thermid settle``: is a log stable by a rule, and where will it end."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from thermid.measure.record.record import Record
    from thermid.simulation.solution import Solution
    from thermid.steadiness.foretold import Forecast

Texts = list[str]


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command("settle")(settle)


def settle(
    log: Annotated[Path, typer.Argument(help="A text log, also one that still grows.")],
    channel: Annotated[
        Texts, typer.Option("--channel", help="Temperature column, or COLUMN=NODE; all whose name or unit says so by default.")
    ] = [],  # noqa: B006
    reference: Annotated[str, typer.Option("--reference", help="Column that the temperatures follow, such as the air.")] = "",
    time: Annotated[str | None, typer.Option("--time", help="The time column, where its name does not say.")] = None,
    rule: Annotated[str, typer.Option("--rule", help="Rule of stability: '3 C/h', '0.2 C/h over 5 h', '0.5 K/h over 1 h'.")] = "3 C/h",
    since: Annotated[str, typer.Option("--since", help="When conditions last changed.")] = "start",
    at: Annotated[str, typer.Option("--at", help="Time of the question; the end of the log by default.")] = "end",
    tau: Annotated[str | None, typer.Option("--tau", help="Slowest time constant, for what is left to go.")] = None,
    slowest: Annotated[str | None, typer.Option("--slowest", help="Longest time constant that the unit can have, if known.")] = None,
    within: Annotated[str, typer.Option("--within", help="Half of the forecast's interval, at most.")] = "1 [K]",
    later: Annotated[Texts, typer.Option("--reading", help="A later time whose reading is forecast; may be repeated.")] = [],  # noqa: B006
    model: Annotated[Path | None, typer.Option("--model", help="Deck whose time constants are used; with --scenario.")] = None,
    scenario: Annotated[Path | None, typer.Option("--scenario", help="Conditions of the stretch (TOML).")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output.")] = False,
) -> None:
    """Say whether a log is stable by a rule and where it will end; leave with 1 when it is not stable, 4 when that cannot be told."""
    from thermid.cli.app import _with_unit
    from thermid.cli.output import clean
    from thermid.errors import RecordError
    from thermid.measure.amounts import amount
    from thermid.steadiness.stabilisation import stability

    if not amount(_with_unit(within, "K"), "K", "--within") > 0.0:
        raise RecordError(f"half of an interval is above zero, not '{within}'.", "--within")
    record = _read(log, channel, reference, time)
    names = [n for n in record.channels if n != reference]
    begin, end = _with_unit(since, "s"), _with_unit(at, "s")
    known = None if tau is None else _with_unit(tau, "s")
    found = stability(record, rule, names, since=begin, at=end, tau=known, reference=reference, run=_run(rule, model, scenario))
    told: dict[str, Forecast | str] = {}
    for name in names:
        try:
            told[name] = _forecast(record, name, begin, end, rule, within, reference, slowest, model, scenario)
        except RecordError as error:
            if model is not None or slowest is not None:
                raise
            told[name] = error.message
    times = [_with_unit(t, "s") for t in later]
    if as_json:
        typer.echo(json.dumps(clean(_object(found.as_object(), told, times))))
    else:
        lines = [str(found)]
        for name, f in told.items():
            lines.append(f"{name}: no forecast. {f}" if isinstance(f, str) else str(f))
            lines += [] if isinstance(f, str) else [f"  at {t}: {f.reading(t)}" for t in times]
        typer.echo("\n".join(lines))
    raise SystemExit({"stable": 0, "not stable": 1, "cannot tell": 4}[found.verdict])


def _object(stable: dict[str, Any], told: dict[str, Forecast | str], times: Texts) -> dict[str, Any]:
    """Return what was found as JSON holds it."""
    forecasts: dict[str, Any] = {}
    for name, f in told.items():
        if isinstance(f, str):
            forecasts[name] = {"declined": f}
            continue
        readings = [(t, f.reading(t)) for t in times]
        forecasts[name] = f.as_object() | {
            "readings": [{"at": t, "value_C": e.value - 273.15, "low_C": e.low - 273.15, "high_C": e.high - 273.15} for t, e in readings]
        }
    return {"schema": 1, "status": "ok", **stable, "forecasts": forecasts}


def _run(rule: str, model: Path | None, scenario: Path | None) -> Solution | None:
    """Return the run of a model for a rule on stored heat."""
    from thermid.measure.record.stability import rule_of
    from thermid.model.deck.modelfile import load_model
    from thermid.simulation.scenario_file import load_scenario
    from thermid.simulation.transient import simulate

    if model is None or scenario is None or not rule_of(rule).stored:
        return None
    return simulate(load_model(model), load_scenario(scenario))


def _forecast(
    record: Record,
    name: str,
    since: str,
    until: str,
    rule: str,
    within: str,
    reference: str,
    slowest: str | None,
    model: Path | None,
    scenario: Path | None,
) -> Forecast:
    from thermid.cli.app import _with_unit
    from thermid.model.deck.modelfile import load_model
    from thermid.simulation.scenario_file import load_scenario
    from thermid.steadiness.forecast import forecast

    return forecast(
        record,
        name,
        since=since,
        until=until,
        rule=rule,
        within=_with_unit(within, "K"),
        reference=reference,
        slowest=None if slowest is None else _with_unit(slowest, "s"),
        model=None if model is None else load_model(model),
        scenario=None if scenario is None else load_scenario(scenario),
    )


def _read(log: Path, channel: Texts, reference: str, time: str | None) -> Record:
    """Return the temperatures of a log."""
    from thermid.errors import RecordError
    from thermid.measure.readers.log_reader import read_record, temperature_columns

    sits = {n: node or n for n, _, node in (given.partition("=") for given in channel)}
    names = list(sits) or [n for n in temperature_columns(log) if n != reference]
    if not names:
        raise RecordError("no column looks like a temperature. Name them with --channel.", log.name)
    asked: dict[str, str | dict[str, object]] = {n: {"node": sits.get(n, n)} for n in names}
    if reference:
        asked[reference] = {"boundary": reference}
    return read_record(log, asked, time=time)
