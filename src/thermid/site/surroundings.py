"""Tables of a scenario file that make its surroundings: site, weather, sun and wind of the ground, an ascent, or an orbit."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from thermid.base.errors import ScenarioError, errors_at
from thermid.base.files import resolve_inside
from thermid.base.units import TEMPERATURE
from thermid.model.tree import Constant, literal
from thermid.simulation.runs import Environment, LogColumns, Scenario
from thermid.site.ascent import ascent_scenario, read_trajectory
from thermid.site.orbit import Planet, orbit_fluxes
from thermid.site.pad import pad_scenario
from thermid.site.site import Site, read_weather

TABLES = ("site", "weather", "sun", "wind", "ascent", "orbit")


def surrounded(table: Mapping[str, Any], columns: LogColumns, file: str) -> Scenario:
    """Return the scenario of a file that has weather, sun or wind; what else it gives is laid over them.

    Raises
    ------
    ScenarioError   As `pad_scenario`.
    """
    rest = dict(table)
    tables = {name: rest.pop(name, {}) for name in TABLES}
    duration = rest.pop("duration", None)
    if isinstance(duration, str):
        duration = literal(duration, "s", f"{file}, duration")
    for alone, what in (("orbit", "in orbit"), ("ascent", "an ascent")):
        clash = [name for name in TABLES if name != alone and tables[name] and tables[alone]]
        if clash:
            raise ScenarioError(
                f"a scenario is {what} or it is not: it has {clash[0]} and {alone}. Remove one.", file, code="value.excludes-another"
            )
    if tables["orbit"]:
        return _orbit(tables["orbit"], rest, duration, f"{file}, orbit")
    if tables["ascent"]:
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


def _orbit(table: Mapping[str, Any], rest: dict[str, Any], duration: float | None, where: str) -> Scenario:
    """Return a time in orbit: what falls on the faces, no gas where nothing else is said of one, as long as some orbits."""
    orbits = table.get("orbits")
    if orbits is not None and duration is not None:
        raise ScenarioError("the run lasts so many orbits or has a duration; give one of them.", where, code="value.excludes-another")
    with errors_at(where):
        flown, planet = {k: v for k, v in table.items() if k not in ("planet", "faces", "orbits")}, table.get("planet", "earth")
        if isinstance(planet, Mapping):  # its figures instead of a name
            slots = {"radius": "m", "attraction": "m^3/s^2", "solar": "W/m^2"}
            planet = Planet(**{k: literal(v, slots[k], f"{where}.planet.{k}") for k, v in planet.items()})
        fluxes = orbit_fluxes(**flown, planet=planet)
        falling = fluxes.irradiation(_faces(table["faces"], where) if "faces" in table else None)
    twice = sorted(set(falling) & set(rest.get("irradiation", {})))
    if twice:
        raise ScenarioError(
            f"what falls on '{twice[0]}' is given by orbit and by irradiation; give one of them.", where, code="value.excludes-another"
        )
    environment = {"*": Environment(Constant(0.0)), **rest.pop("environment", {})}
    falls = {**falling, **rest.pop("irradiation", {})}
    length = fluxes.period * float(orbits) if orbits is not None else duration or 0.0
    return Scenario(**rest, irradiation=falls, environment=environment, duration=length)


def _faces(faces: Mapping[str, Any], where: str) -> dict[str, str]:
    """Return surface -> face, from face -> surface or several."""
    out: dict[str, str] = {}
    for face, surfaces in faces.items():
        for surface in [surfaces] if isinstance(surfaces, str) else surfaces:
            if surface in out:
                raise ScenarioError(
                    f"'{surface}' looks one way: it is on the faces {out[surface]} and {face}.", f"{where}.faces", code="value.contradicts"
                )
            out[surface] = face
    return out
