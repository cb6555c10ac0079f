"""Commands of design: size, worst, compare, diagram, htc."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from thermid.app.cli.options import (
    Accept,
    Deck,
    Force,
    Json,
    KeepValues,
    Parameters,
    ValuesPath,
    answer,
    judged_model,
    limit_ends,
    pairs,
    say,
    with_unit,
)
from thermid.base.errors import ThermidError, ThermidWarning
from thermid.base.files import FileKinds, check_ending, write_text
from thermid.base.units import Kelvin
from thermid.campaign.verdicts import Limits, compare_models, size, worst_case
from thermid.model.tree import UNJUDGED, load_model
from thermid.physics.htc import compare_htc
from thermid.reporting.diagrams import network_map
from thermid.simulation.runs import load_scenario


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
    sizing = size(model, value, _limits(limit), scenarios, between=window, spread=pairs(spread, "--spread"))
    answer(standing, as_json, sizing.to_dict(), replace(sizing, standing=UNJUDGED))


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
    answer(standing, as_json, cases.to_dict(), replace(cases, standing=UNJUDGED))


def _limits(texts: list[str]) -> list[Limits]:
    """Return limits written NODE=LOW..HIGH."""
    ranges = {node: limit_ends(text, node) for node, text in pairs(texts, "--limit").items()}
    return [Limits(node, node, (Kelvin(low), Kelvin(high))) for node, (low, high) in ranges.items()]


def diagram(
    deck: Deck,
    to: Annotated[Path, typer.Option("--to", help="The SVG file to write.")],
    force: Force = False,
    fold: Annotated[list[str], typer.Option("--fold", help="A submodel drawn as one mass; may be repeated.")] = [],  # noqa: B006
) -> None:
    """Draw a model as SVG: masses, conductors, loads, boundaries.

    A map with every node once; --fold draws a submodel as a single mass.
    """
    check_ending(to, FileKinds.DRAWING)
    write_text(to, network_map(load_model(deck), folded=fold) + "\n", FileKinds.DRAWING)
    typer.echo(f"diagram: {to}")


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
            errors={"sensor": with_unit(sensor, "K"), "drift": with_unit(drift, "K")},
            emissivity=emissivity,
            parts=_parts(part),
            capacitance=with_unit(capacitance, "J/K") if capacitance else None,
            settled_after=with_unit(settled_after, "s") if settled_after else None,
        )
    say(as_json, comparison.to_dict(), comparison)


def _parts(texts: list[str]) -> dict[str, tuple[str | float, str | float]]:
    """Return ``NAME=LENGTH,CONDUCTIVITY`` options as a dictionary."""
    out: dict[str, tuple[str | float, str | float]] = {}
    for name, text in pairs(texts, "--part").items():
        length, comma, conductivity = text.partition(",")
        if not comma:
            raise ThermidError(f"'{text}' must be LENGTH,CONDUCTIVITY, such as '20 [mm], 0.25'.", f"--part {name}", code="value.wrong-kind")
        out[name] = (with_unit(length.strip(), "m"), with_unit(conductivity.strip(), "W/(m K)"))
    return out
