"""Commands of a site: moisture."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from thermid.app.cli.options import (
    Accept,
    Boundaries,
    Deck,
    Duration,
    Json,
    KeepValues,
    Moments,
    Start,
    ValuesPath,
    answer,
    judged_model,
    moments,
    pairs,
    scenario_of,
    with_unit,
)
from thermid.base.units import ICE_POINT
from thermid.model.tree import literal
from thermid.site.moisture import Moisture, moisture as moist_run


def moisture(
    deck: Deck,
    scenario: Annotated[Path | None, typer.Option("--scenario", help="A scenario (TOML); humidities of its gases are taken.")] = None,
    humidity: Annotated[list[str], typer.Option("--humidity", help="GAS=RELATIVE HUMIDITY, such as air='60 [%]' or air=0.6.")] = [],  # noqa: B006
    boundary: Boundaries = [],  # noqa: B006
    start: Start = None,
    duration: Duration = None,
    every: Annotated[str, typer.Option("--every", help="Time between outputs.")] = "1 [min]",
    at: Moments = [],  # noqa: B006
    values: ValuesPath = None,
    keep_values: KeepValues = False,
    accept: Accept = None,
    as_json: Json = False,
) -> None:
    """Print the margin to the dew point of every surface.

    Minutes of condensation, water on the surface, when it is dry again, and temperatures with the heat of condensation are printed too.
    """
    model, standing = judged_model(deck, values, keep_values, accept=accept)
    conditions = scenario_of(scenario, boundary, [], start, duration)
    times = moments(at, conditions.seconds)
    humidities = {gas: literal(with_unit(text, "1"), "1", "--humidity") for gas, text in pairs(humidity, "--humidity").items()}
    run = moist_run(model, conditions, humidities, every=with_unit(every, "s"))
    traces = [run.solution[n] for n in run.solution.nodes]
    rows = [f"  at {t:g} s: " + ", ".join(f"{x.path} {float(x.at(t)):.2f}" for x in traces) + " degC" for t in times]
    answer(standing, as_json, _object(run, times), "\n".join([str(run), *rows]))


def _object(run: Moisture, times: list[float]) -> dict[str, Any]:
    """Return the object of ``thermid moisture --json``."""
    surfaces = {}
    for name, s in run.surfaces.items():
        k = int(s.margin.argmin())
        dew = float(run.dew_points[s.gas][k])
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
    solution, water = run.solution, run.water
    return {
        "title": solution.title,
        "scenario": solution.scenario,
        "nodes": solution.to_dict(None, times)["nodes"],
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
        "warnings": [*run.warnings, *solution.warnings],
    }
