"""What commands read: a model with fitted values over its deck, and a scenario of options over that of a file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import typer

from thermid.campaign.hand import Filed, filed
from thermid.cli.options import pairs, with_unit
from thermid.errors import ScenarioError
from thermid.model.deck.modelfile import load_model
from thermid.model.laws.signal import literal
from thermid.model.tree.model import Model
from thermid.simulation.scenario_file import load_scenario
from thermid.simulation.scenarios.scenario import Scenario


def fitted_model(deck: Path, values: Path | None, keep: bool = False, param: Sequence[str] = ()) -> Model:
    """Return a deck's model with a values file and parameters laid over it; what the file lacks and what is left out is told first.

    Parameters
    ----------
    keep : bool     Whether to keep values that the decks give otherwise by now.
    """
    model = load_model(deck)
    if values is not None:
        laid = filed(values, model, keep=keep)
        say_first(laid, values)
        model = laid.model
    return model.with_values(pairs(list(param), "--param"), "command line") if param else model


def say_first(laid: Filed, file: Path) -> None:
    """Tell what a values file lacks, what of it is left out, and what is hidden."""
    for line in (*laid.lacks, *(f"{gone} --keep-values keeps it." for gone in laid.gone), *laid.hidden):
        typer.echo(f"{file.name}: {line}", err=True)


def scenario_of(
    file: Path | None,
    boundary: list[str],
    load: list[str],
    start: str | None,
    duration: str | None,
    vacuum: bool = False,
    as_printed: bool = False,
) -> Scenario:
    """Return the scenario of the options, laid over the one of a file."""
    base = load_scenario(file) if file is not None else Scenario("command line")
    for name, text in pairs(boundary, "--boundary").items():
        if with_unit(text, "degC") != text and 200.0 <= float(text) <= 400.0:
            typer.echo(f"note: {name}={text} is read in degC; in kelvin it is written '{name}={text} [K]'.", err=True)
    changes: dict[str, Any] = {
        "boundaries": {k: with_unit(v, "degC") for k, v in pairs(boundary, "--boundary").items()},
        "loads": {k: with_unit(v, "W") for k, v in pairs(load, "--load").items()},
    }
    if start is not None:
        changes["start"] = with_unit(start, "degC")
    if duration is not None:
        changes["duration"] = with_unit(duration, "s")
    scenario = base.with_(**changes)
    if vacuum and as_printed:
        raise ScenarioError("--vacuum keeps radiation and --as-printed drops it; give one of them.")
    return scenario.vacuum(as_printed=as_printed) if vacuum or as_printed else scenario


def moments(texts: list[str], seconds: float) -> list[float]:
    """Return the times of ``--at`` within a run of that length. [s]"""
    times = [literal(with_unit(t, "s"), "s", "--at") for t in texts]
    outside = [t for t in times if not 0 <= t <= seconds]
    if outside:
        raise ScenarioError(f"{outside[0]:g} s lies outside the run of {seconds:g} s.", "--at")
    return times
