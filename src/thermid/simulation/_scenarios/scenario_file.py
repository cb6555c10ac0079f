"""`load_scenario`: scenario files, TOML in, `Scenario` out; their signals may be columns of logs."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from thermid.base.errors import ScenarioError, ThermidError, errors_at, extension
from thermid.base.files import Places, by_grammar, read_toml, resolve_inside
from thermid.base.units import TEMPERATURE
from thermid.model.tree import Signal, TableSignal, literal, signal
from thermid.simulation._network.environment import Environment
from thermid.simulation._network.irradiation import Irradiation
from thermid.simulation._scenarios.scenario import SLOTS, Scenario

SURROUNDINGS = ("site", "weather", "sun", "wind", "ascent", "orbit")
"""Tables of a scenario file that stand for boundaries, gases and radiation."""


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
    try:
        return scenario_from_table(fields, target.parent, target.name)
    except ThermidError as error:
        key = error.where.removeprefix(f"{fields['title']}, ")
        if key != error.where:  # the scenario names itself; its reader looks for the line
            raise type(error)(error.message, f"{target.name}:{lines.get(key, 1)}, {key}") from None
        raise error.located(target.name) from None


def scenario_from_table(table: Mapping[str, Any], folder: Path, where: str) -> Scenario:
    """Return the scenario of a table that follows the grammar of a scenario file, with its title; logs are found from a folder.

    Raises
    ------
    ThermidError   When a value is no signal, a column is missing, or a state does not exist.
    """
    fields = dict(table)
    columns = LogColumns.of_scenario(table, folder, where)
    for name, slot in SLOTS.items():
        if name in fields:
            held = name == "commands"
            fields[name] = {k: columns.signal(v, slot, f"{where}, {name}.{k}", held) for k, v in fields[name].items()}
    fields["environment"] = environments_of(table.get("environment", {}), columns, f"{where}, environment")
    fields["irradiation"] = {
        surface: _irradiation(t, columns, f"{where}, irradiation.{surface}") for surface, t in table.get("irradiation", {}).items()
    }
    if set(SURROUNDINGS) & set(table):
        surrounded: Scenario = extension("surroundings", "surroundings of a scenario file", where)(fields, columns, where)
        return surrounded
    return Scenario(**fields)


def environments_of(tables: Mapping[str, Mapping[str, Any]], columns: LogColumns, where: str) -> dict[str, Environment]:
    """Return gas node -> its state, of tables as a scenario file has them.

    Raises
    ------
    ThermidError   When a state does not exist, or a column is missing.
    """
    return {gas: _environment(table, columns, f"{where}.{gas}") for gas, table in tables.items()}


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


@dataclass(frozen=True)
class LogColumns:
    """Reader of the columns of logs that a scenario file names, with the rules for their time zero.

    Parameters
    ----------
    folder : Path   Of the scenario file.
    zeros : dict    File -> time in it that is the scenario's zero, where that is not its first sample: lift-off in a trajectory. [s]
    cut : Path      A weather file that enters at another time than its first.
    """

    folder: Path
    zeros: Mapping[Path, float] = field(default_factory=dict)
    cut: Path | None = None

    @classmethod
    def of_scenario(cls, data: Mapping[str, Any], folder: Path, where: str) -> LogColumns:
        """Return the reader for the tables of a scenario file, `data` as read from it, in a folder."""
        ascent, weather = data.get("ascent", {}), data.get("weather", {})
        zeros = {resolve_inside(folder, ascent["file"], f"{where}, ascent"): 0.0} if "file" in ascent else {}
        cut = resolve_inside(folder, weather["file"], f"{where}, weather.file") if "file" in weather and "begin" in weather else None
        return cls(folder, zeros, cut)

    def signal(self, value: Any, slot: str, where: str, held: bool = False) -> Signal | Any:
        """Return a column of a log as a signal, or the value as it is.

        Times count from the first sample of the log. The unit is the one given, else that of the header, else degC, W, % of a command, or
        the SI unit of the slot; a slot that only the model knows (empty) needs one of the first two. Holes are bridged as in a record.

        Raises
        ------
        ScenarioError   When the column is missing, or its unit or time zero is not known.
        """
        if not (isinstance(value, Mapping) and "file" in value):
            return value
        from thermid.measure.readers import read_plain, read_record  # a tenth of a first result, which names no log

        file, name, time = resolve_inside(self.folder, value["file"], where), value["column"], value.get("time")
        if file == self.cut:
            raise ScenarioError(
                f"the weather of '{file.name}' begins at another time than its first line, but the times of its columns count from "
                "that line. Leave begin out, or give the column in a separate log.",
                where,
                code="record.time-unclear",
            )
        role = {TEMPERATURE: "boundary", "W": "load", "1": "command"}.get(slot, "")
        text = value.get("unit") or ("" if role else dict(read_plain(file, time).heads).get(name) or slot)
        if not (role or text):
            raise ScenarioError(
                f"give the unit of '{name}': unit = '...', or a header such as '{name} [W/(m^2 K)]'.", where, code="record.unit-unclear"
            )
        with errors_at(where, ", "):
            record = read_record(file, {name: ({role: "x"} if role else {}) | ({"unit": text} if text else {})}, time=time)
        times, values, _ = record.table(name)
        span = record.times[record.channel(name).valid]
        inside = (times >= span[0]) & (times <= span[-1])  # a blank end is no value that holds
        times, values = times[inside], values[inside]
        zero = self.zeros.get(file, float(record.times[0]))
        held = bool(value.get("hold", held)) and value.get("samples") != "average"
        rows = TableSignal(times - zero, values, held, record.channel(name).unit, (record.origin.sha256, zero))
        with errors_at(where):
            return rows.with_details(value, where)
