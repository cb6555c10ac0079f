"""``thermid moisture``: how far every surface stays from the dew point of its gas, and how long water settles."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from thermid.cli.standing import Accept, KeepValues, leave, with_fitted
from thermid.toml_files import read_toml

if TYPE_CHECKING:
    from thermid.site.moisture import Moisture


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("moisture")(moisture)


def moisture(
    deck: Annotated[Path, typer.Argument(help="A deck (TOML).")],
    scenario: Annotated[Path | None, typer.Option("--scenario", help="A scenario (TOML); humidities of its gases are taken.")] = None,
    humidity: Annotated[list[str], typer.Option("--humidity", help="GAS=RELATIVE HUMIDITY, such as air='60 [%]' or air=0.6.")] = [],  # noqa: B006
    boundary: Annotated[list[str], typer.Option("--boundary", help="BOUNDARY=TEMPERATURE, such as air='24 [degC]'.")] = [],  # noqa: B006
    start: Annotated[str | None, typer.Option("--start", help="A temperature, a boundary, or 'steady'.")] = None,
    duration: Annotated[str | None, typer.Option("--for", help="Duration, such as '5 [h]'.")] = None,
    every: Annotated[str, typer.Option("--every", help="Time between outputs.")] = "1 [min]",
    values: Annotated[Path | None, typer.Option("--values", help="A file of fitted values to lay over the deck.")] = None,
    keep_values: KeepValues = False,
    accept: Accept = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output.")] = False,
) -> None:
    """Say of every surface its margin to the dew point, the minutes of condensation, and when it is dry."""
    from thermid.cli.app import _pairs, _scenario, _with_unit
    from thermid.cli.output import clean
    from thermid.knowledge.store import model_standing
    from thermid.model.deck.modelfile import load_model
    from thermid.model.laws.signal import literal
    from thermid.site.moisture import moisture as run

    model = with_fitted(load_model(deck), values, keep_values)
    standing = model_standing(model).accept(accept or ())
    given = _scenario(model, scenario, boundary, [], start, duration)
    written = read_toml(scenario)[0].get("environment", {}) if scenario is not None else {}
    known: dict[str, Any] = {gas: given.environment[gas].humidity for gas, table in written.items() if gas != "*" and "humidity" in table}
    known |= {gas: literal(_with_unit(text, "1"), "1", "--humidity") for gas, text in _pairs(humidity, "--humidity").items()}
    found = run(model, given, known, every=_with_unit(every, "s"))
    typer.echo(json.dumps(clean({**_object(found), "standing": standing.to_dict()})) if as_json else standing.over(str(found)))
    leave(standing)


def _object(found: Moisture) -> dict[str, Any]:
    """Return the object of ``thermid moisture --json``."""
    from thermid.cli.output import SCHEMA
    from thermid.physics.constants import ICE_POINT

    surfaces = {}
    for name, s in found.surfaces.items():
        k = int(s.margin.argmin())
        dew = float(found.dew_points[s.gas][k])
        surfaces[name] = {
            "gas": s.gas,
            "least_margin_K": float(s.margin[k]) if dew > 0.0 else None,
            "at_s": float(s.times[k]),
            "dew_point_C": dew - ICE_POINT if dew > 0.0 else None,
            "condensing_s": s.condensing,
            "wet_s": s.wet,
            "film_kg_m2": float(s.film.max()),
            "latent_J": s.heat,
        }
    solution, water = found.solution, found.water
    return {
        "schema": SCHEMA,
        "status": "ok",
        "title": solution.title,
        "scenario": solution.scenario,
        "surfaces": surfaces,
        "water": {
            "vapour_kg": water.vapour,
            "films_kg": water.films,
            "exchanged_kg": water.exchanged,
            "open_air_kg": water.open_air,
            "settled_kg": water.settled,
            "dried_kg": water.dried,
            "relative": water.relative,
        },
        "warnings": [*found.warnings, *solution.warnings],
    }
