"""Tables that a run leaves: what is said of it, and which runs are refused."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from thermid.model.laws.curves import Curve
from thermid.network.network import Network, Numbers

Array = NDArray[np.float64]
NEAR: Final = 0.1
"""How close to the end of its table a run stands that cannot go on. [K]"""
GOES_ON: Final = {"hold": "stays constant", "linear": "goes on as a straight line", "refuse": "is refused"}
"""What a table does outside its points."""


def _ranged(network: Network, numbers: Numbers) -> list[tuple[str, Curve, tuple[str, str]]]:
    """Return name, table and the nodes whose mean or difference it is read at, for every table that an author gives and of a gas."""
    found = [(r.name, r.curve, r.ends) for r in numbers.conductors]
    found += [(r.name, r.curve, (r.node, r.node)) for r in numbers.loads]
    found = [(name, curve, ends) for name, curve, ends in found if curve is not None and not curve.film]
    found += [
        (c.path, c.curve.film[1], (e, e)) for c in network.flat.conductors if c.curve is not None and len(c.curve.film) > 1 for e in c.ends
    ]
    found += [(node, store.given, (node, node)) for node, store in network.stores.items()]
    return [(name, curve, ends) for name, curve, ends in found if curve is not None]


def read_nodes(network: Network, numbers: Numbers) -> set[str]:
    """Return the nodes at whose temperatures tables are read."""
    return {end for _, _, ends in _ranged(network, numbers) for end in ends}


def refuses(network: Network, numbers: Numbers) -> bool:
    """Return whether some table is refused outside its points."""
    return any(curve.limits is not None for _, curve, _ in _ranged(network, numbers))


def _seen(curve: Curve, a: Array, b: Array) -> Array:
    """Return what a table is read at, for temperatures of both nodes. [K]"""
    return a - b if curve.over == "difference" else 0.5 * (a + b)


def left_tables(network: Network, numbers: Numbers, at: Callable[[str], Array], times: Array) -> tuple[str, ...]:
    """Return a sentence for each table that was asked for values outside its points at times [s]; `at`: node -> temperatures. [K]"""
    out = []
    for name, curve, (a, b) in _ranged(network, numbers):
        seen = _seen(curve, at(a), at(b))
        beyond = (seen < curve.x[0]) | (seen > curve.x[-1])
        if beyond.any():
            first, low, high = times[beyond.argmax()], float(seen.min()), float(seen.max())
            out.append(
                f"'{name}' left the range of its law, {curve.x[0]:.6g} to {curve.x[-1]:.6g} K, at {first:.6g} s: it saw {low:.6g} to"
                f" {high:.6g} K; beyond its range a law {GOES_ON[curve.outside]}"
            )
    return tuple(out)


def refused_tables(network: Network, numbers: Numbers, temperatures: Mapping[str, float], near: float) -> str:
    """Return which tables that are refused outside their points are left, or left next, at temperatures [K]; empty where none is."""
    out = []
    for name, curve, (a, b) in _ranged(network, numbers):
        if curve.limits is None:
            continue
        low, high = curve.limits
        seen = float(_seen(curve, np.array(temperatures[a]), np.array(temperatures[b])))
        if not low + near <= seen <= high - near:
            out.append(f"'{name}' leaves the range of its table, {low:.6g} to {high:.6g} K")
    if not out:
        return ""
    return f'{" and ".join(dict.fromkeys(out))}, outside which it is refused. Add points, or choose outside = "hold".'
