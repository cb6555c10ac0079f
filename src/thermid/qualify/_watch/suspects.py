"""The values of a model that a fault would change."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Final

from thermid.simulation.network import Network


@dataclass(frozen=True)
class SuspectValue:
    """A value that a fault would change: what it is, whose, its path, and what lower and higher mean."""

    kind: str
    whose: str
    path: str
    lower: str
    higher: str


PATHS: Final = {
    "htc": ("air", "less air flow: check the fan", "more air flow: check the fan and lids"),
    "effective_htc": ("air", "less air flow: check the fan", "more air flow: check the fan and lids"),
    "htc.coefficient": ("air", "less air flow", "more air flow"),
    "contact_conductance": ("joint", "conducts worse: check for a loose joint", "conducts better: check for an unintended contact"),
    "conductance": ("joint", "conducts worse: check for a loose joint", "conducts better: check for an unintended contact"),
    "resistance": ("joint", "conducts better: check for an unintended contact", "conducts worse: check for a loose joint"),
    "conductivity": ("heat path", "conducts worse", "conducts better"),
}
"""Field of a conductor -> kind, and what a lower and a higher value mean."""


def ambients_of(network: Network, logged: Collection[str]) -> tuple[SuspectValue, ...]:
    """Return the temperatures of boundaries that nobody logs, which may be other than stated; their values are what is added. [K]"""
    words = ("colder than stated: log it, or give its temperature", "warmer than stated: log it, or give its temperature")
    return tuple(SuspectValue("ambient", b, b, *words) for b in network.boundaries if b not in logged)


def suspects_of(network: Network) -> tuple[SuspectValue, ...]:
    """Return the values that a fault would change, each once: conductors and powers."""
    out: dict[str, SuspectValue] = {}
    parameters = network.flat.parameters
    for c in network.flat.conductors:
        for name, words in PATHS.items():
            if name in c.fields:
                path = parameters.literal_behind(c.fields[name])
                out.setdefault(path, SuspectValue(words[0], c.path, path, words[1], words[2]))
                break
    for load in network.flat.loads:
        if load.node in network.nodes:
            scale = f"scale.{load.path}"
            out.setdefault(
                scale, SuspectValue("power", load.path, scale, "heats less than logged or stated", "heats more than logged or stated")
            )
    return tuple(out.values())
