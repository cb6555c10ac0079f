"""Temperatures at the beginning of a record: given, or the first readings of its sensors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.errors import RecordError
from thermid.measure import Record
from thermid.network.network import Network
from thermid.simulation.scenario import Scenario

__all__ = ["first_reading", "starts_of"]

Array = NDArray[np.float64]

MEASURED = "measured"
"""`start = "measured"`: observed nodes start at their own readings, all others at the mean of these."""


def first_reading(record: Record, name: str, window: float = 0.0) -> float:
    """Return the median of a channel's valid samples within `window` of its first one. [SI]

    Raises
    ------
    RecordError   When it has no valid sample.
    """
    channel = record.channel(name)
    times = record.times[channel.valid]
    if times.size == 0:
        raise RecordError(f"channel '{name}' has no valid sample.", record.name)
    return float(np.median(channel.values[channel.valid][times <= times[0] + window]))


def starts_of(
    record: Record, base: Scenario, network: Network, first: Mapping[str, float], window: float
) -> tuple[Any, dict[str, Any], dict[str, str], tuple[str, ...]]:
    """Return start, initial temperatures, nodes that start at a channel's first reading, and nodes that start at their own."""
    initial: dict[str, Any] = {}
    readings: dict[str, str] = {}

    def lay(node: str, value: Any) -> None:
        if isinstance(value, str) and value in record.channels:
            readings[node] = value
            initial[node] = first_reading(record, value, window)
        else:
            initial[node] = value

    for raw, value in base.initial.items():
        lay(network.find(raw), value)
    if isinstance(base.start, str) and base.start in record.channels:
        for node in network.nodes:
            if node not in initial and _massive(network, node):
                lay(node, base.start)
        return first_reading(record, base.start, window), initial, readings, ()
    if base.start not in ("", MEASURED):
        return base.start, initial, readings, ()
    loose = tuple(n for n in first if n not in initial and _massive(network, n))
    initial |= {n: first[n] for n in loose}
    mean = float(np.mean(list(first.values())))
    return (mean if base.start == MEASURED or len(network.boundaries) != 1 else ""), initial, readings, loose


def _massive(network: Network, node: str) -> bool:
    return any(n.path == node and n.fields for n in network.flat.nodes)
