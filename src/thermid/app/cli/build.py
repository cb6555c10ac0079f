"""Commands that build and run a model: check, simulate, steady, schema."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from thermid.app.cli.options import (
    Accept,
    AsPrinted,
    Boundaries,
    Data,
    Deck,
    Duration,
    Error,
    Force,
    Json,
    KeepValues,
    Loads,
    Moments,
    Parameters,
    ScenarioPath,
    Vacuum,
    ValuesPath,
    Whole,
    answer,
    fitted_model,
    judged_model,
    leave,
    limit_ends,
    moments,
    pairs,
    say,
    scenario_of,
    with_unit,
    writable,
)
from thermid.base.errors import DeckError, SolverError, extension, refuse_unknown
from thermid.base.files import FileKinds, file_kinds, json_schema, read_toml
from thermid.base.units import ICE_POINT
from thermid.model.tree import Standing, literal, load_model
from thermid.simulation import runs as transient
from thermid.simulation.runs import Options, margin_lines, margins, output_times, steady

SHOWN_FINDINGS = 4
"""Findings of a deck that are printed without -v, beside the line that counts them."""


def check(
    deck: Deck,
    data: Data = None,
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Print every finding and input, not the most important.")] = False,
    as_json: Json = False,
) -> None:
    """Check a deck or campaign for errors and questionable values.

    A campaign is checked with its logs. Exit code 2 if it cannot be used.
    """
    campaign = not {"records", "stages", "verdicts"}.isdisjoint(read_toml(deck)[0])  # an unfinished one too
    inputs: dict[str, Any] = {}
    if campaign:
        findings, inputs = extension("check_campaign", "a check of a campaign", deck.name)(deck, data)
    else:
        findings = tuple(load_model(deck).check())
    count = {s: sum(f.severity == s for f in findings) for s in ("error", "warning", "note")}
    first = next((f for f in findings if f.severity == "error"), None)
    shown = findings if campaign or verbose else findings[:SHOWN_FINDINGS]
    lines = [f"{f}{f' [{f.code}]' if verbose and f.code else ''}" for f in shown]
    lines += [f"{stage}: inputs\n{table.indented}" for stage, table in inputs.items()]
    lines.append(f"{deck.name}: " + ", ".join(f"{n} {severity}{'s' * (n != 1)}" for severity, n in count.items()))
    lines += [f"{len(findings) - len(shown)} more: -v"] if len(shown) < len(findings) else []
    content = {
        **({} if first is None else {"status": "error", "code": first.code, "message": first.message, "where": first.where}),
        "findings": [{"severity": f.severity, "code": f.code, "where": f.where, "message": f.message} for f in findings],
        **({"inputs": {stage: table.to_dict() for stage, table in inputs.items()}} if campaign else {}),
    }
    say(as_json, content, "\n".join(lines), verbose)
    raise SystemExit(0 if first is None else 2)


def simulate(
    deck: Deck,
    scenario: ScenarioPath = None,
    boundary: Boundaries = [],  # noqa: B006
    param: Parameters = [],  # noqa: B006
    load: Loads = [],  # noqa: B006
    start: Annotated[
        str | None, typer.Option("--start", help="A temperature, a boundary, 'steady', 'steady, mean', 'steady, 2 [h]' or 'periodic'.")
    ] = None,
    duration: Duration = None,
    at: Moments = [],  # noqa: B006
    every: Annotated[str | None, typer.Option("--every", help="Interval of the stored samples.")] = None,
    error: Error = "0.1 [mK]",
    vacuum: Vacuum = False,
    as_printed: AsPrinted = False,
    as_flown: Annotated[bool, typer.Option("--as-flown", help="Without what is for the test only: sensors, leads, stands.")] = False,
    values: ValuesPath = None,
    keep_values: KeepValues = False,
    csv: Annotated[Path | None, typer.Option("--csv", help="Write the temperatures to a CSV file.")] = None,
    netcdf: Annotated[Path | None, typer.Option("--netcdf", help="Write everything to a netCDF file.")] = None,
    accept: Accept = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Run a model in a scenario and print its temperatures.

    The answer holds final temperatures, time constants and the heat balance; --csv and --netcdf write the whole run.
    """
    model = fitted_model(deck, values, keep_values, param)
    model = model.without_test_only() if as_flown else model
    standing = model.standing.accept(accept or ())
    conditions = scenario_of(scenario, boundary, load, start, duration, vacuum, as_printed)
    times = moments(at, conditions.seconds)
    grid = np.array(sorted({*output_times(conditions, every and with_unit(every, "s"), None), *times}))
    writable((csv, FileKinds.TABLE), (netcdf, FileKinds.NETCDF))
    solution = transient.simulate(model, conditions, times=grid, options=Options(error=literal(with_unit(error, "K"), "K", "--error")))
    try:
        final = steady(model, conditions, conditions.seconds)
    except SolverError:
        final = None
    if csv is not None:
        solution.to_csv(csv)
    if netcdf is not None:
        solution.to_netcdf(netcdf)
    lines = [str(solution)]
    for t in times:
        lines.append(f"  at {t:g} s: " + ", ".join(f"{n} {float(solution[n].at(t)):.3f}" for n in solution.nodes) + " degC")
    lines.append("  time constants: " + ", ".join(f"{c:.6g} s" for c in solution.time_constants))
    balance = solution.heat_balance()
    lines.append(f"  heat: loads {balance.loads:.6g} J, to boundaries {balance.boundaries:.6g} J, stored {balance.stored:.6g} J")
    whole = Standing.worst([standing, *solution.doubts])
    say(as_json, {**solution.to_dict(final, times), "standing": whole.to_dict()}, standing.over("\n".join(lines)))
    leave(whole)


def steady_state(
    deck: Deck,
    scenario: ScenarioPath = None,
    boundary: Boundaries = [],  # noqa: B006
    param: Parameters = [],  # noqa: B006
    load: Loads = [],  # noqa: B006
    when: Annotated[str, typer.Option("--when", help="Inputs of which time: '2 [h]', 'mean', or 'periodic' with its extremes.")] = "0 [s]",
    flows: Annotated[bool, typer.Option("--flows", help="Where the heat goes: between groups, by node, by conductor.")] = False,
    group: Annotated[
        list[str], typer.Option("--group", help="NAME=PATTERN of nodes, such as parts='*.junction,*.case'; may be repeated.")
    ] = [],  # noqa: B006
    limit: Annotated[
        list[str], typer.Option("--limit", help="PATTERN=LOW..HIGH or PATTERN=HIGH, such as '*.junction=-40..105'; may be repeated.")
    ] = [],  # noqa: B006
    vacuum: Vacuum = False,
    values: ValuesPath = None,
    keep_values: KeepValues = False,
    accept: Accept = None,
    verbose: Whole = False,
    as_json: Json = False,
) -> None:
    """Print steady temperatures and their margins, least margin first.

    --flows adds where the heat goes: between groups, by node and by conductor.
    """
    model, standing = judged_model(deck, values, keep_values, param, accept)
    limits = {pattern: limit_ends(text, pattern) for pattern, text in pairs(limit, "--limit").items()}
    conditions = scenario_of(scenario, boundary, load, None, None, vacuum)
    settled = steady(model, conditions, when if when in ("mean", "periodic") else with_unit(when, "s"))
    rows = margins(settled.lowest, settled.highest, limits)
    heat = settled.heat
    groups = heat.grouped(pairs(group, "--group")) if heat is not None else {}
    first, hottest = rows[0], max(rows, key=lambda m: m.highest)
    least = f", least margin {first.margin:.2f} K at {first.node}" if np.isfinite(first.margin) else ""
    head = f"{model.title}, steady, {settled.held}: hottest {hottest.node} {hottest.highest - ICE_POINT:.2f} degC{least}"
    lines = [head, *(f"  warning: {r}" for r in settled.remarks), *margin_lines(rows)]
    lines += heat.lines(groups) if flows and heat is not None else []
    nodes = {
        m.node: {"C": settled[m.node] - ICE_POINT, "lowest_C": m.lowest - ICE_POINT, "highest_C": m.highest - ICE_POINT}
        | ({"margin_K": m.margin} if np.isfinite(m.margin) else {})
        for m in rows
    }
    content = {"held": settled.held, "warnings": list(settled.remarks), "nodes": nodes, "standing": standing.to_dict()}
    content |= {"heat": heat.to_dict(groups)} if flows and heat is not None else {}
    answer(standing, as_json, content, "\n".join(lines), verbose or (None if flows else False))


def schema(kind: Annotated[str, typer.Argument(help="Kind of file, such as deck, scenario, campaign, limits or plan.")] = "deck") -> None:
    """Print the JSON Schema of a file, for editors."""
    refuse_unknown([kind], file_kinds(), "", "there is no schema '{}'.{near} There are {known}.", DeckError)
    typer.echo(json.dumps(json_schema(kind), indent=2))
