"""The values of a model that a fault would change."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Final

from thermid.inference.diagnosis import WATCHED
from thermid.simulation.network import Network


@dataclass(frozen=True)
class SuspectValue:
    """A value that a fault would change.

    Parameters
    ----------
    kind : str              joint, air, heat path, power or ambient.
    whose : str             Path of the conductor, load or boundary.
    path : str              Path of the value; ``scale.LOAD`` for a power.
    lower, higher : str     What a lower and a higher value mean, in words.
    """

    kind: str
    whose: str
    path: str
    lower: str
    higher: str


PATHS: Final = {
    "htc": "air",
    "effective_htc": "air",
    "htc.coefficient": "free air",
    "contact_conductance": "joint",
    "conductance": "joint",
    "resistance": "joint",
    "conductivity": "heat path",
}
"""Field of a conductor -> what it is in the table of causes."""


def _suspect(kind: str, whose: str, path: str, falls: bool = False) -> SuspectValue:
    """Return a value with its words of the table of causes; if `falls`, as for a resistance, lower and higher change places."""
    cause = WATCHED[kind]
    words = (cause.higher, cause.lower) if falls else (cause.lower, cause.higher)
    return SuspectValue("air" if kind == "free air" else kind, whose, path, *words)


def unlogged_ambients(network: Network, logged: Collection[str]) -> tuple[SuspectValue, ...]:
    """Return the temperatures of boundaries without a column in the log; the value of each is a difference to the stated one. [K]"""
    return tuple(_suspect("ambient", b, b) for b in network.boundaries if b not in logged)


def suspect_values(network: Network) -> tuple[SuspectValue, ...]:
    """Return every value of conductors and loads that a fault would change, each once."""
    out: dict[str, SuspectValue] = {}
    parameters = network.flat.parameters
    for c in network.flat.conductors:
        name = next((n for n in PATHS if n in c.fields), "")
        if name:
            path = parameters.literal_behind(c.fields[name])
            out.setdefault(path, _suspect(PATHS[name], c.path, path, name == "resistance"))
    for load in network.flat.loads:
        if load.node in network.nodes:
            out.setdefault(f"scale.{load.path}", _suspect("power", load.path, f"scale.{load.path}"))
    return tuple(out.values())
