"""Columns of logs that a scenario file names, as signals."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from thermid.base.errors import ScenarioError, errors_at
from thermid.base.toml_files import resolve_inside
from thermid.base.units import TEMPERATURE
from thermid.model.elements import Signal, TableSignal, conducted


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
            return conducted(rows, value, where)
