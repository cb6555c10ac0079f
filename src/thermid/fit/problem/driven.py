"""What the channels of a record drive: boundaries, powers and commands as signals, their constant errors taken off or noted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from thermid.errors import RecordError
from thermid.measure import Channel, Record
from thermid.model.laws.signal import Constant, Signal, Table, conducted
from thermid.simulation.scenarios.scenario import Scenario


@dataclass
class Inputs:
    """What the channels of a record drive, on top of what the scenario gives."""

    boundaries: dict[str, Any]
    loads: dict[str, Any]
    commands: dict[str, Any]
    gains: dict[str, str]
    shared: dict[str, tuple[str, float]] = field(default_factory=dict)

    def take(self, channel: Channel, role: str, path: str, signal: Signal, errors: Mapping[str, float] | None) -> None:
        """Lay the signal of a channel over a boundary or load, with its constant error taken off or noted as one to look for."""
        if role == "boundary":
            self.boundaries[path] = signal if errors is None else signal.raised(errors.get(channel.name, 0.0))
            if errors is None and channel.accuracy:
                self.shared[channel.name] = (path, channel.accuracy)
        elif channel.gain or role == "command":
            self.commands[path] = signal
            if channel.gain:
                self.gains[path] = channel.gain
        else:
            self.loads[path] = signal if errors is None else signal.scaled(errors.get(channel.name, 1.0))
            power = power_while_on(signal)
            if errors is None and channel.accuracy and power > 0:
                self.shared[channel.name] = (f"scale.{path}", channel.accuracy / power)


def on_the_clock_of(record: Record, scenario: Scenario) -> Scenario:
    """Return a scenario whose columns of the record's own log count from the record's first sample, though its start was cut off.

    Raises
    ------
    RecordError   When the record's times are no longer those of its log.
    """

    def moved(given: Any) -> Any:
        if not isinstance(given, Table) or given.log is None or given.log[0] != record.origin.sha256:
            return given
        again = next((step for step in record.steps if step.startswith(("shift_start", "steady point"))), "")
        if again:
            raise RecordError(
                f"the scenario has a column of the log '{record.origin.file}', whose times the record no longer has ({again}). Leave that "
                "step out, or give the column in a log of its own.",
                record.name,
            )
        zero = float(record.times[0])
        return given.shifted(zero - given.log[1])

    return scenario.mapped(moved)


def power_while_on(signal: Signal) -> float:
    """Return the mean power weighted by itself, so that pauses do not count; zero for a load that is always off. [W]"""
    values = np.abs(signal.levels)
    total = float(values.sum())
    return float(values @ values) / total if total > 0 else 0.0


def corrected(scenario: Scenario, found: Mapping[str, float]) -> Scenario:
    """Return the scenario of a record with the boundaries, starts and powers that a fit found.

    Parameters
    ----------
    scenario : Scenario     As the log gives it.
    found : dict            Name in the wiring -> value: of a boundary its temperature, or what is added where it varies in time [K], of
                            ``initial.<node>`` a temperature [K], of ``scale.<load>`` a factor on its power. Other names are ignored.
    """
    boundaries = {
        b: Constant(found[b]) if isinstance(s, Constant) else s.raised(found[b]) for b, s in scenario.boundaries.items() if b in found
    }
    loads = {p: s.scaled(found[f"scale.{p}"]) for p, s in scenario.loads.items() if f"scale.{p}" in found}
    initial = {name.removeprefix("initial."): t for name, t in found.items() if name.startswith("initial.")}
    return scenario.with_(boundaries=boundaries, loads=loads, initial=initial)


def signal_of(record: Record, name: str, zero: float, held: bool) -> Signal:
    """Return a channel of a record as a signal of a run, whose time counts from `zero` [s]."""
    table, samples = record.table(name), record.channel(name).samples
    times = np.asarray(table.times) - zero
    if times.size == 1:
        return Constant(float(table.values[0]))
    return conducted(Table(times, np.asarray(table.values), held and samples != "average"), {"samples": samples}, record.name)
