"""Commands that read a log: look, settle."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Annotated, Any

import typer

from thermid.app.cli.options import Force, Json, Whole, say, with_unit
from thermid.base.errors import RecordError
from thermid.base.files import DRAWING, LOG, check_ending, write_text
from thermid.measure.amounts import amount
from thermid.measure.readers import parts_between_restarts, read_record, temperature_columns
from thermid.measure.records import Record
from thermid.measure.steadiness import rule_of
from thermid.model.deck import load_model
from thermid.physics.constants import ICE_POINT
from thermid.qualify.steadiness import Forecast, forecast, stability
from thermid.reporting import pictures as picture
from thermid.simulation.runs import simulate
from thermid.simulation.scenario_files import load_scenario


def look(
    logs: Annotated[list[Path], typer.Argument(help="Logs in any format: text, workbook, LabVIEW, TDMS, MATLAB, HDF5, netCDF.")],
    time: Annotated[str | None, typer.Option("--time", help="The time column, where it cannot be told.")] = None,
    separator: Annotated[str | None, typer.Option("--separator", help="Separator of the columns, where it cannot be told.")] = None,
    decimal: Annotated[str | None, typer.Option("--decimal", help="Decimal sign, where the file has both.")] = None,
    clock: Annotated[str | None, typer.Option("--clock", help="Form of the stamps, such as '%d/%m/%Y %H:%M'.")] = None,
    unit: Annotated[str | None, typer.Option("--time-unit", help="Unit of the times, where they are numbers without one.")] = None,
    to: Annotated[Path | None, typer.Option("--svg", help="Picture to write (SVG), of one log.")] = None,
    cut: Annotated[Path | None, typer.Option("--cut", help="Folder for the parts of one log between restarts of its board.")] = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Show layout, clock, gaps, faults and columns of logs.

    The lines for a campaign are printed too. Exit code 2 if times cannot be read.
    """
    for option, one in (("--svg", to), ("--cut", cut)):
        if one is not None and len(logs) > 1:
            raise RecordError("it is of one log. Give one log.", option)
    if cut is not None:
        logs = _cut(logs[0], cut)
    if to is not None:
        check_ending(to, DRAWING)
    reading = {"separator": separator, "decimal": decimal, "clock": clock, "unit": unit}
    looks = [picture.look(log, time=time, **reading) for log in logs]
    if any(file_look.has(time) for file_look in looks):  # a log without that column has another clock, which may be told
        looks = [file_look if file_look.has(time) else picture.look(file_look.path, **reading) for file_look in looks]
    if to is not None:
        write_text(to, looks[0].svg() + "\n", DRAWING)
    width = shutil.get_terminal_size((110, 24)).columns
    bad = any(file_look.problem for file_look in looks)
    parts = ["\n".join(file_look.lines(width)) for file_look in looks]
    parts += [f"{len(logs)} parts between restarts, each on a clock of its own, written to {cut}"] if cut is not None else []
    parts += ["\n".join(lines)] if cut is None and (lines := picture.clock_lines(looks)) else []
    text = "\n\n".join(parts) + (f"\npicture: {to}" if to is not None else "")
    clocks = {"clocks": picture.clocks_of(looks)} if len(looks) > 1 else {}
    say(as_json, {"status": "error" if bad else "ok", "logs": [file_look.as_object() for file_look in looks], **clocks}, text)
    raise SystemExit(2 if bad else 0)


def _cut(log: Path, folder: Path) -> list[Path]:
    """Write the parts of a log between restarts of its board, each on its own clock; return their paths."""
    parts = parts_between_restarts(log)
    folder.mkdir(parents=True, exist_ok=True)
    paths = [folder / f"{log.stem}_{k}.csv" for k in range(1, len(parts) + 1)]
    for path, text in zip(paths, parts, strict=True):
        write_text(path, text, LOG)
    return paths


def settle(
    log: Annotated[Path, typer.Argument(help="A text log, also one that still grows.")],
    channel: Annotated[
        list[str],
        typer.Option("--channel", help="Temperature column, or COLUMN=NODE; by default every column whose name or unit is a temperature."),
    ] = [],  # noqa: B006
    reference: Annotated[str, typer.Option("--reference", help="Column that the temperatures follow, such as the air.")] = "",
    time: Annotated[str | None, typer.Option("--time", help="The time column, where its name does not say.")] = None,
    rule: Annotated[str, typer.Option("--rule", help="Rule of stability: '3 C/h', '0.2 C/h over 5 h', '0.5 K/h over 1 h'.")] = "3 C/h",
    since: Annotated[str, typer.Option("--since", help="When conditions last changed.")] = "start",
    at: Annotated[str, typer.Option("--at", help="Time of the question; the end of the log by default.")] = "end",
    tau: Annotated[str | None, typer.Option("--tau", help="Slowest time constant, for what is left to go.")] = None,
    slowest: Annotated[str | None, typer.Option("--slowest", help="Longest time constant that the unit can have, if known.")] = None,
    within: Annotated[str, typer.Option("--within", help="Half of the forecast's interval, at most.")] = "1 [K]",
    later: Annotated[list[str], typer.Option("--reading", help="A later time whose reading is forecast; may be repeated.")] = [],  # noqa: B006
    model: Annotated[Path | None, typer.Option("--model", help="Deck whose time constants are used; with --scenario.")] = None,
    scenario: Annotated[Path | None, typer.Option("--scenario", help="Conditions of the stretch (TOML).")] = None,
    verbose: Whole = False,
    as_json: Json = False,
) -> None:
    """Check whether a log is stable and forecast where it ends.

    Exit code 1 if the log is not stable by the rule, 4 if it cannot decide.
    """
    if not amount(with_unit(within, "K"), "K", "--within") > 0.0:
        raise RecordError(f"half of an interval is above zero, not '{within}'.", "--within")
    record = _read(log, channel, reference, time)
    names = [n for n in record.channels if n != reference]
    begin, end = with_unit(since, "s"), with_unit(at, "s")
    time_constant = None if tau is None else with_unit(tau, "s")
    deck = None if model is None else load_model(model)
    conditions = None if scenario is None else load_scenario(scenario)
    run = None
    if deck is not None and conditions is not None and rule_of(rule).stored:
        run = simulate(deck, conditions)
    stable = stability(record, rule, names, since=begin, at=end, tau=time_constant, reference=reference, run=run)
    ends: dict[str, Forecast | str] = {}
    for name in names:
        try:
            ends[name] = forecast(
                record,
                name,
                since=begin,
                until=end,
                rule=rule,
                within=with_unit(within, "K"),
                reference=reference,
                slowest=None if slowest is None else with_unit(slowest, "s"),
                model=deck,
                scenario=conditions,
            )
        except RecordError as error:
            if model is not None or slowest is not None:
                raise
            ends[name] = error.message
    times = [with_unit(t, "s") for t in later]
    lines = [str(stable)]
    for name, f in ends.items():
        lines.append(f"{name}: no forecast. {f}" if isinstance(f, str) else str(f))
        lines += [] if isinstance(f, str) else [f"  at {t}: {f.reading(t)}" for t in times]
    say(as_json, {**stable.as_object(), "forecasts": _forecasts(ends, times)}, "\n".join(lines), verbose)
    raise SystemExit({"stable": 0, "not stable": 1, "cannot tell": 4}[stable.verdict])


def _forecasts(ends: dict[str, Forecast | str], times: list[str]) -> dict[str, Any]:
    """Return forecasts by channel as JSON holds them; one that was declined says why."""
    forecasts: dict[str, Any] = {}
    for name, f in ends.items():
        if isinstance(f, str):
            forecasts[name] = {"declined": f}
            continue
        readings = [(t, f.reading(t)) for t in times]
        forecasts[name] = f.as_object() | {
            "readings": [
                {"at": t, "value_C": e.value - ICE_POINT, "low_C": e.low - ICE_POINT, "high_C": e.high - ICE_POINT} for t, e in readings
            ]
        }
    return forecasts


def _read(log: Path, channel: list[str], reference: str, time: str | None) -> Record:
    """Return the temperatures of a log."""
    sits = {n: node or n for n, _, node in (text.partition("=") for text in channel)}
    names = list(sits) or [n for n in temperature_columns(log, time) if n != reference]
    if not names:
        raise RecordError("no column looks like a temperature. Name them with --channel.", log.name)
    bindings: dict[str, str | dict[str, object]] = {n: {"node": sits.get(n, n)} for n in names}
    if reference:
        bindings[reference] = {"boundary": reference}
    return read_record(log, bindings, time=time)
