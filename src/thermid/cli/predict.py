"""``thermid predict``: what the stage of a campaign says of a scenario, with bands and what they come from."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import typer

from thermid.cli.output import SCHEMA, clean
from thermid.cli.pages import Force
from thermid.cli.standing import Accept, leave


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(predict)


def predict(
    campaign: Annotated[Path, typer.Argument(help="A campaign (TOML).")],
    stage: Annotated[str, typer.Option("--stage", help="The stage whose values are used; the last one by default.")] = "",
    scenario: Annotated[Path | None, typer.Option("--scenario", help="A scenario (TOML).")] = None,
    spread: Annotated[
        list[str],
        typer.Option("--spread", help="NAME=SPREAD of what is not known exactly, such as air='1 [K]' or scale.heater='2 [%]'."),
    ] = [],  # noqa: B006
    at: Annotated[list[str], typer.Option("--at", help="A time to report, such as '1 [h]'; may be repeated.")] = [],  # noqa: B006
    draws: Annotated[int, typer.Option("--draws", min=0, help="Members drawn, for spreads so wide that derivatives do not do.")] = 0,
    vacuum: Annotated[bool, typer.Option("--vacuum", help="No gas: convection goes, radiation stays.")] = False,
    csv: Annotated[Path | None, typer.Option("--csv", help="Write temperatures and bands to a CSV file.")] = None,
    force: Force = False,
    data: Annotated[Path | None, typer.Option("--data", help="Folder of logs outside the project; THERMID_DATA does the same.")] = None,
    results: Annotated[Path | None, typer.Option("--results", help="Folder of finished stages; 'results' beside the campaign.")] = None,
    accept: Accept = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output.")] = False,
) -> None:
    """Say what a fitted stage predicts for a scenario, with 95 % bands and what they come from."""
    from thermid.campaign.stages import run_stages
    from thermid.cli.app import _with_unit
    from thermid.errors import ScenarioError
    from thermid.files import TABLE, may_write
    from thermid.model.laws.signal import literal
    from thermid.prediction.predict import predict as run
    from thermid.simulation.scenario_file import load_scenario

    if scenario is None:
        raise ScenarioError("a prediction needs a scenario: --scenario FILE.", "command line")
    given = load_scenario(scenario)
    if csv is not None:
        may_write(csv, TABLE)
    found = run_stages(campaign, data=data, cache=results if results is not None else campaign.parent / "results", accept=accept or ())
    name = stage or list(found)[-1]
    predicted = run(found[name], given.vacuum() if vacuum else given, spread=_spreads(spread), draws=draws)
    times = [literal(_with_unit(t, "s"), "s", "--at") for t in at]
    outside = [t for t in times if not 0 <= t <= given.seconds]
    if outside:
        raise ScenarioError(f"{outside[0]:g} s lies outside the run of {given.seconds:g} s.", "--at")
    if csv is not None:
        predicted.to_csv(csv)
    if as_json:
        content: dict[str, Any] = {"schema": SCHEMA, "status": "ok", "stage": name, **predicted.to_dict(times)}
        typer.echo(json.dumps(clean(content)))
        leave(predicted.standing)
    typer.echo(str(predicted))
    for t in times:
        typer.echo(f"  at {t:g} s: " + ", ".join(f"{n} {b.at(t)}" for n, b in predicted.bands.items()))
    leave(predicted.standing)


def _spreads(given: list[str]) -> dict[str, Any]:
    """Return ``NAME=SPREAD`` options as a dictionary; a spread in braces is read as an inline table."""
    import tomllib

    from thermid.errors import ScenarioError

    out: dict[str, Any] = {}
    for text in given:
        name, equals, value = text.partition("=")
        if not equals or not name.strip() or not value.strip():
            raise ScenarioError(f"'{text}' must be written as NAME=SPREAD, such as air=1 [K].", "--spread")
        try:
            out[name.strip()] = tomllib.loads(f"x = {value}")["x"] if value.lstrip().startswith("{") else value.strip()
        except tomllib.TOMLDecodeError as error:
            raise ScenarioError(f"'{value}' is no table such as {{ low = '-2 [K]', high = '2 [K]' }}: {error}", "--spread") from None
    return out
