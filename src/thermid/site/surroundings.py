"""Tables of a scenario file that make its surroundings: site, weather, sun and wind of the ground, or an ascent."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from thermid.errors import ScenarioError
from thermid.model.laws.signal import literal
from thermid.simulation.scenarios.columns import LogColumns
from thermid.simulation.scenarios.scenario import Scenario
from thermid.site.ascent import ascent_scenario, read_trajectory
from thermid.site.pad import pad_scenario
from thermid.site.site import Site
from thermid.site.weather import read_weather
from thermid.toml_files import resolve_inside
from thermid.units import TEMPERATURE

TABLES = ("site", "weather", "sun", "wind", "ascent")


def surrounded(given: Mapping[str, Any], columns: LogColumns, file: str) -> Scenario:
    """Return the scenario of a file that has weather, sun or wind; what else it gives is laid over them.

    Raises
    ------
    ScenarioError   As `pad_scenario`.
    """
    rest = dict(given)
    tables = {name: rest.pop(name, {}) for name in TABLES}
    duration = rest.pop("duration", None)
    if isinstance(duration, str):
        duration = literal(duration, "s", f"{file}, duration")
    if tables["ascent"]:
        clash = [name for name in ("site", "weather", "sun", "wind") if tables[name]]
        if clash:
            raise ScenarioError(
                f"a scenario is either on the ground or an ascent, but this one has {clash[0]} and ascent. Remove one.", file
            )
        return _ascent(tables["ascent"], rest, duration, columns, file)
    weather, sun = tables["weather"], tables["sun"]
    read = None
    if "file" in weather:
        options = {k: weather[k] for k in ("columns", "max_gap", "year", "time", "averaged") if k in weather}
        options |= {"begin": weather["starts"]} if "starts" in weather else {}
        read = read_weather(resolve_inside(columns.folder, weather["file"], f"{file}, weather.file"), **options)
    options = {k: weather[k] for k in ("begin", "air", "air_temperature") if k in weather} | {
        k: sun[k] for k in ("sky", "albedo", "turbidity") if k in sun
    }
    options |= {"sun": sun["shines"]} if "shines" in sun else {}
    return pad_scenario(
        (Site(**tables["site"]) if tables["site"] else None), read, duration=duration, wind=tables["wind"] or None, **options, **rest
    )


def _ascent(table: Mapping[str, Any], rest: Mapping[str, Any], duration: float | None, columns: LogColumns, file: str) -> Scenario:
    """Return an ascent."""
    where = f"{file}, ascent"
    path = resolve_inside(columns.folder, table["file"], where) if "file" in table else None
    trajectory = read_trajectory(path, table.get("columns"), time=table.get("time")) if path else None
    options = {k: table[k] for k in ("air", "separation", "flow", "accommodation", "upper") if k in table}
    for name, slot in (("pressure", "Pa"), ("air_temperature", TEMPERATURE)):
        if name in table:
            options[name] = columns.signal(table[name], slot, f"{where}.{name}")
    walls = {k: columns.signal(v, TEMPERATURE, f"{where}.walls.{k}") for k, v in table.get("walls", {}).items()}
    return ascent_scenario(trajectory, duration=duration, walls=walls, **options, **rest)
