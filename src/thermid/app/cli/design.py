"""Commands of design: size, worst, compare, diagram."""

from __future__ import annotations

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
)
from thermid.base.files import FileKinds
from thermid.base.units import Kelvin
from thermid.campaign.stages import Limits, compare_models, size, worst_case
from thermid.model.tree import UNJUDGED, load_model
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
    FileKinds.DRAWING.check_ending(to)
    FileKinds.DRAWING.save_text(to, network_map(load_model(deck), folded=fold) + "\n")
    typer.echo(f"diagram: {to}")
