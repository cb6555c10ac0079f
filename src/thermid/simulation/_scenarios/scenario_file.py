"""`load_scenario`: scenario files, TOML in, `Scenario` out."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from thermid.base.arguments import takes_objects
from thermid.base.errors import ThermidError, errors_at
from thermid.base.extensions import by_grammar, extension
from thermid.base.toml_files import Places, read_toml
from thermid.base.units import TEMPERATURE
from thermid.model.elements import literal, signal
from thermid.simulation._network.environment import Environment
from thermid.simulation._network.irradiation import Irradiation
from thermid.simulation._scenarios.columns import LogColumns
from thermid.simulation._scenarios.scenario import SLOTS, Scenario

SURROUNDINGS = ("site", "weather", "sun", "wind", "ascent", "orbit")
"""Tables of a scenario file that stand for boundaries, gases and radiation."""


@takes_objects
def load_scenario(path: str | os.PathLike[str]) -> Scenario:
    """Return the scenario of a TOML file.

    A signal may be a column of a log: ``{ file = "room.csv", column = "T_AMB", unit = "degC", time = "time_s" }``, whose times count from
    the first sample of the log. Tables
    `site`, `weather`, `sun` and `wind` make a time on the pad, as `pad_scenario` does, `ascent` an ascent, as
    `ascent_scenario` does, and `orbit` a time in orbit, by `orbit_fluxes`.

    Raises
    ------
    ScenarioError   When it does not follow the grammar, or a value is no signal.
    """
    target = Path(path)
    data, lines = read_toml(target)
    data = by_grammar("thermid.simulation._scenarios.schema.ScenarioFile", data, Places(target.name, lines)).written
    fields: dict[str, Any] = {"title": target.stem, **data}
    columns, gases = LogColumns.of_scenario(data, target.parent, target.name), data.get("environment", {})
    for name, slot in SLOTS.items():
        if name in fields:
            held = name == "commands"
            fields[name] = {k: columns.signal(v, slot, f"{target.name}, {name}.{k}", held) for k, v in fields[name].items()}
    fields["environment"] = {gas: _environment(t, columns, f"{target.name}, environment.{gas}") for gas, t in gases.items()}
    fields["irradiation"] = {
        surface: _irradiation(t, columns, f"{target.name}, irradiation.{surface}") for surface, t in data.get("irradiation", {}).items()
    }
    try:
        if set(SURROUNDINGS) & set(data):
            surrounded: Scenario = extension("surroundings", "surroundings of a scenario file", target.name)(fields, columns, target.name)
            return surrounded
        return Scenario(**fields)
    except ThermidError as error:
        key = error.where.removeprefix(f"{fields['title']}, ")
        if key != error.where:  # the scenario names itself; its reader looks for the line
            raise type(error)(error.message, f"{target.name}:{lines.get(key, 1)}, {key}") from None
        raise error.located(target.name) from None


def _environment(table: Mapping[str, Any], columns: LogColumns, where: str) -> Environment:
    """Return the environment that a table of a scenario file describes; pressure and wind may be columns of logs."""
    fields = dict(table)
    for name, unit in (("humidity", "1"), ("gravity", "m/s^2"), ("time_constant", "s")):
        fields |= {name: literal(table[name], unit, where)} if name in table else {}
    for name, unit in (("pressure", "Pa"), ("wind", "m/s")):
        fields |= {name: signal(columns.signal(table[name], unit, where), unit, where)} if name in table else {}
    with errors_at(where):
        return Environment(**fields)


def _irradiation(table: Mapping[str, Any], columns: LogColumns, where: str) -> Irradiation:
    """Return the irradiation that a table of a scenario file describes; its signals may be columns of logs."""
    fields = {
        name: value if name == "sky_view" else columns.signal(value, TEMPERATURE if name == "sky" else "W/m^2", where)
        for name, value in table.items()
    }
    with errors_at(where):
        return Irradiation(**fields)
