"""Commands that build and run a model: check, simulate, diagram, schema; and the coefficient of a settled test."""

from __future__ import annotations

import json
import warnings
from pathlib import Path
from typing import Annotated

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
    moments,
    pairs,
    say,
    scenario_of,
    with_unit,
    writable,
)
from thermid.base.errors import DeckError, ScenarioError, SolverError, ThermidError, ThermidWarning, refuse_unknown
from thermid.base.expression import Kelvin
from thermid.base.extensions import file_kinds, json_schema
from thermid.base.files import DRAWING, NETCDF, TABLE, check_ending, write_text
from thermid.base.toml_files import read_toml
from thermid.campaign.stages import check_campaign
from thermid.campaign.verdicts import Limits, compare_models, size, worst_case
from thermid.fit.calibration import InputTable
from thermid.model.deck import load_model
from thermid.model.elements import literal
from thermid.physics.constants import ICE_POINT
from thermid.physics.htc import compare_htc
from thermid.reporting.diagrams import network_map
from thermid.reporting.objects import comparison_object, solution_object
from thermid.simulation import runs as transient
from thermid.simulation.runs import margin_lines, margins, output_times, steady
from thermid.simulation.scenario_files import load_scenario
from thermid.simulation.solver import Options
from thermid.values.store import model_standing

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
    campaign = "stages" in read_toml(deck)[0]
    inputs: dict[str, InputTable] = {}
    if campaign:
        findings, inputs = check_campaign(deck, data)
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
    standing = model_standing(model).accept(accept or ())
    conditions = scenario_of(scenario, boundary, load, start, duration, vacuum, as_printed)
    times = moments(at, conditions.seconds)
    grid = np.union1d(output_times(conditions, every and with_unit(every, "s"), None), times)
    writable((csv, TABLE), (netcdf, NETCDF))
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
    answer(standing, as_json, solution_object(solution, final, times), "\n".join(lines))


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
    limits = {pattern: _ends(text, pattern) for pattern, text in pairs(limit, "--limit").items()}
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


def compare_versions(
    old: Annotated[Path, typer.Argument(help="The deck before.")],
    new: Annotated[Path, typer.Argument(help="The deck after.")],
    scenario: Annotated[
        list[Path], typer.Option("--scenario", help="A scenario whose steady states are compared; may be repeated. 20 degC without one.")
    ] = [],  # noqa: B006
    as_json: Json = False,
) -> None:
    """Compare two versions of a deck, the largest effect first.

    Parts, connections, values and totals.

    Each difference states what it alone does to a steady temperature; units, order and arithmetic of the files play no part.
    """
    changes = compare_models(load_model(old), load_model(new), [load_scenario(file) for file in scenario])
    say(as_json, changes.to_dict(), str(changes))


def size_value(
    deck: Deck,
    value: Annotated[str, typer.Argument(help="The value: an area, conductance, power, duty, emissivity or flow, such as panel.area.")],
    scenario: Annotated[list[Path], typer.Option("--scenario", help="A scenario in which limits must hold; may be repeated.")],
    limit: Annotated[list[str], typer.Option("--limit", help="NODE=LOW..HIGH or NODE=HIGH, such as 'unit=-20..50'; may be repeated.")],
    between: Annotated[
        str | None, typer.Option("--between", help="Range, '0.01 [m^2]..0.5 [m^2]'; min and max of the deck without it.")
    ] = None,
    margin: Annotated[float, typer.Option("--margin", help="What must be left to each limit. [K]")] = 0.0,
    spread: Annotated[list[str], typer.Option("--spread", help="NAME=SPREAD of what is not known exactly; may be repeated.")] = [],  # noqa: B006
    param: Parameters = [],  # noqa: B006
    values: ValuesPath = None,
    keep_values: KeepValues = False,
    accept: Accept = None,
    as_json: Json = False,
) -> None:
    """Find the window of a design value in which limits hold.

    Each end names the limit that binds there; --spread gives it an error and the value that holds in 95 %. Without any such value the least
    violation is stated.
    """
    model, standing = judged_model(deck, values, keep_values, param, accept)
    ends = between.split("..") if between is not None else None
    window = (ends[0], ends[-1]) if ends is not None else None
    scenarios = [load_scenario(file) for file in scenario]
    sizing = size(model, value, _limits(limit), scenarios, between=window, margin=margin, spread=pairs(spread, "--spread"))
    answer(standing, as_json, sizing.to_dict(), sizing)


def worst(
    deck: Deck,
    scenario: Annotated[Path, typer.Option("--scenario", help="What is done to the hardware beside the ranges.")],
    limit: Annotated[list[str], typer.Option("--limit", help="NODE=LOW..HIGH or NODE=HIGH, such as 'unit=-20..50'; may be repeated.")],
    ranges: Annotated[
        list[str],
        typer.Option("--range", help="NAME=LOW..HIGH of a boundary, load or value: chips='2 [W]..9 [W]'; may be repeated."),
    ],
    param: Parameters = [],  # noqa: B006
    values: ValuesPath = None,
    keep_values: KeepValues = False,
    accept: Accept = None,
    as_json: Json = False,
) -> None:
    """Find the worst hot and cold case within ranges.

    Powers and boundaries of a passive network stand at their ends; up to four other values are searched, and the share of their ranges that
    may be worse is stated.
    """
    model, standing = judged_model(deck, values, keep_values, param, accept)
    box = {name: (text.split("..")[0].strip(), text.split("..")[-1].strip()) for name, text in pairs(ranges, "--range").items()}
    cases = worst_case(model, _limits(limit), load_scenario(scenario), box)
    answer(standing, as_json, cases.to_dict(), cases)


def _limits(texts: list[str]) -> list[Limits]:
    """Return limits written NODE=LOW..HIGH."""
    ranges = {node: _ends(text, node) for node, text in pairs(texts, "--limit").items()}
    return [Limits(node, node, (Kelvin(low), Kelvin(high))) for node, (low, high) in ranges.items()]


def _ends(text: str, pattern: str) -> tuple[float, float]:
    """Return limits written LOW..HIGH, or HIGH alone. [K]"""
    low, dots, high = text.rpartition("..")
    where = f"--limit {pattern}"
    ends = (
        literal(with_unit(low.strip(), "degC"), "temperature", where) if dots and low.strip() else -np.inf,
        literal(with_unit(high.strip(), "degC"), "temperature", where) if high.strip() else np.inf,
    )
    if not ends[0] < ends[1]:
        raise ScenarioError("the lower limit is not below the upper one.", where)
    return ends


def diagram(
    deck: Deck,
    to: Annotated[Path, typer.Option("--to", help="The SVG file to write.")],
    force: Force = False,
    fold: Annotated[list[str], typer.Option("--fold", help="A submodel drawn as one mass; may be repeated.")] = [],  # noqa: B006
) -> None:
    """Draw a model as SVG: masses, conductors, loads, boundaries.

    A map with every node once; --fold draws a submodel as a single mass.
    """
    check_ending(to, DRAWING)
    write_text(to, network_map(load_model(deck), folded=fold) + "\n", DRAWING)
    typer.echo(f"diagram: {to}")


def schema(kind: Annotated[str, typer.Argument(help="Kind of file, such as deck, scenario, campaign, limits or plan.")] = "deck") -> None:
    """Print the JSON Schema of a file, for editors."""
    refuse_unknown([kind], file_kinds(), "", "there is no schema '{}'.{near} There are {known}.", DeckError)
    typer.echo(json.dumps(json_schema(kind), indent=2))


def htc(
    power: Annotated[str, typer.Option("--power", help="Heat through the surface, W.")],
    area: Annotated[str, typer.Option("--area", help="Area of the surface, m^2.")],
    surface: Annotated[str, typer.Option("--surface", help="Settled temperature of the surface, degC.")],
    ambient: Annotated[str, typer.Option("--ambient", help="Temperature of the ambient, degC.")],
    height: Annotated[str, typer.Option("--height", help="Height of the vertical faces, m.")],
    box: Annotated[tuple[str, str] | None, typer.Option("--box", help="Length and width of a box of that height, m.")] = None,
    air: Annotated[
        tuple[float, float, float] | None, typer.Option("--air", help="Conductivity, kinematic viscosity and Prandtl number, SI.")
    ] = None,
    sensor: Annotated[str, typer.Option("--sensor", help="Standard error of each temperature, K.")] = "0.5",
    drift: Annotated[str, typer.Option("--drift", help="Variation of the room, K.")] = "0",
    emissivity: Annotated[float | None, typer.Option("--emissivity", help="Of the surface.")] = None,
    part: Annotated[list[str], typer.Option("--part", help="NAME=LENGTH,CONDUCTIVITY for a Biot number, m and W/(m K).")] = [],  # noqa: B006
    capacitance: Annotated[str | None, typer.Option("--capacitance", help="Mass times specific heat, J/K.")] = None,
    settled_after: Annotated[str | None, typer.Option("--settled-after", help="When the test looked settled, s or '4 [h]'.")] = None,
    as_json: Json = False,
) -> None:
    """Compare a measured coefficient with that of correlations.

    The test must have settled. The answer says what a difference between the two can mean.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ThermidWarning)  # they stand among the remarks
        comparison = compare_htc(
            with_unit(power, "W"),
            with_unit(area, "m^2"),
            with_unit(surface, "degC"),
            with_unit(ambient, "degC"),
            with_unit(height, "m"),
            box=(with_unit(box[0], "m"), with_unit(box[1], "m")) if box else None,
            air=air,
            sensor=with_unit(sensor, "K"),
            drift=with_unit(drift, "K"),
            emissivity=emissivity,
            parts=_parts(part),
            capacitance=with_unit(capacitance, "J/K") if capacitance else None,
            settled_after=with_unit(settled_after, "s") if settled_after else None,
        )
    say(as_json, comparison_object(comparison), comparison)


def _parts(texts: list[str]) -> dict[str, tuple[str | float, str | float]]:
    """Return ``NAME=LENGTH,CONDUCTIVITY`` options as a dictionary."""
    out: dict[str, tuple[str | float, str | float]] = {}
    for name, text in pairs(texts, "--part").items():
        length, comma, conductivity = text.partition(",")
        if not comma:
            raise ThermidError(f"'{text}' must be LENGTH,CONDUCTIVITY, such as '20 [mm], 0.25'.", f"--part {name}")
        out[name] = (with_unit(length.strip(), "m"), with_unit(conductivity.strip(), "W/(m K)"))
    return out
