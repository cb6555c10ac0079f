"""A test that was not made yet, as the record that its sensors would bring."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from thermid.base.errors import IdentificationError, refuse_unknown
from thermid.measure.records import Channel, Record
from thermid.model.tree import Model, literal
from thermid.simulation.runs import Scenario, network_for, output_times, simulate


@dataclass(frozen=True)
class Sensor:
    """A channel of a planned log.

    Parameters
    ----------
    name : str              Its name; an instrument that an earlier log had keeps its constant error.
    target : str            Path of the node, boundary or load that it reads.
    role : str              node, boundary or load.
    noise : float           Standard deviation of one reading. [K or W]
    accuracy : float        Standard deviation of its constant error. [K or W]
    resolution : float      Its step. [K or W]
    """

    name: str
    target: str
    role: str
    noise: float | None = None
    accuracy: float | None = None
    resolution: float | None = None

    @staticmethod
    def of_model(model: Model, scenario: Scenario, stated: Mapping[str, Any]) -> tuple[Sensor, ...]:
        """Return sensors from a table: node, boundary or load -> noise as text, or ``{noise, accuracy, name}``.

        Raises
        ------
        IdentificationError   When a node's sensor has no noise, or a key is unknown.
        """
        network = network_for(model, scenario)
        loads = [load.path for load in network.flat.loads]
        out = []
        for raw, entry in stated.items():
            where = f"sensors.{raw}"
            table = dict(entry) if isinstance(entry, Mapping) else {"noise": entry}
            refuse_unknown(
                sorted(table), ("noise", "accuracy", "name"), where, "give a sensor noise, accuracy and name, not {}.", IdentificationError
            )
            path = model.canonical(raw)
            role = "load" if path in loads else "boundary" if (path := network.find(raw, where)) in network.boundaries else "node"
            noise, accuracy = (
                literal(table[k], "W" if role == "load" else "K", where) if k in table else None for k in ("noise", "accuracy")
            )
            if role == "node" and noise is None:
                raise IdentificationError(
                    "the noise of the sensors is missing. Give it, such as noise = '0.1 [K]': the expected errors depend on it.",
                    where,
                    code="value.incomplete",
                )
            out.append(Sensor(str(table.get("name", raw)), path, role, noise, accuracy))
        return tuple(out)


def planned_record(model: Model, scenario: Scenario, sensors: Sequence[Sensor], every: str | float | None, name: str) -> Record:
    """Return the record of a planned test: the model's own temperatures at its sensors, without noise.

    Parameters
    ----------
    model, scenario : Model, Scenario
    sensors : sequence of Sensor    What is logged.
    every : str, float or None      Interval of the readings [s]; 301 of them when None.
    name : str                      Name of the record.

    Raises
    ------
    IdentificationError   When no sensor reads a node.
    """
    if not any(s.role == "node" for s in sensors):
        raise IdentificationError("a planned test needs at least one sensor on a node.", name, code="value.incomplete")
    times = output_times(scenario, every, None)
    run = simulate(model, scenario, times=times)
    powers = run.load_powers if any(s.role == "load" for s in sensors) else {}
    channels = {}
    for s in sensors:
        values = np.asarray(powers[s.target]) if s.role == "load" else run[s.target].kelvin
        quantity, of = ("power", "W") if s.role == "load" else ("temperature", "K")
        stated_errors = {"noise": s.noise, "accuracy": s.accuracy, "resolution": s.resolution}
        channels[s.name] = Channel.from_array(s.name, values, unit=of, quantity=quantity, role=s.role, target=s.target, **stated_errors)
    return Record.from_arrays(name, times, channels)
