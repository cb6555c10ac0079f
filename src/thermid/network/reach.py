"""Which parts of a network have a path to a boundary, and how fast the others warm."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from thermid.dual import value_of
from thermid.network.network import Network, Numbers


@dataclass(frozen=True)
class Unreached:
    """Nodes that are joined to one another but to no boundary.

    Parameters
    ----------
    nodes : tuple of str    Their paths.
    rate : float            Mean rate at which they warm: total power over total capacitance. [K/s]
    """

    nodes: tuple[str, ...]
    rate: float

    def message(self) -> str:
        """Return the finding in words."""
        named = ", ".join(f"'{n}'" for n in self.nodes)
        many = len(self.nodes) > 1
        if abs(self.rate) < 1e-12:
            return f"{named} {'have' if many else 'has'} no path to a boundary: the heat that is there stays there"
        word = ("warm" if self.rate > 0 else "cool") + ("" if many else "s")
        return f"{named} {'have' if many else 'has'} no path to a boundary: {word} at {abs(self.rate) * 3600:.6g} K/h without limit"


def unreached(network: Network, numbers: Numbers, powers: Mapping[str, float]) -> tuple[Unreached, ...]:
    """Return the groups of nodes without a path to a boundary.

    Parameters
    ----------
    powers : dict   Load -> mean power. [W]
    """
    names = [*network.nodes, *network.boundaries]
    joined: dict[str, set[str]] = {n: set() for n in names}
    for row in numbers.conductors:
        if value_of(row.coefficients[0]) != 0.0:
            a, b = row.ends
            joined[a].add(b)
            if row.form != "flow":  # a stream carries the temperature of its first end alone
                joined[b].add(a)
    left = set(network.nodes) - _spread(network.boundaries, joined)
    joined = {n: {m for m in left if m in joined[n] or n in joined[m]} for n in left}
    out = []
    while left:
        first = next(n for n in network.nodes if n in left)
        group = _spread((first,), joined) & left
        left -= group
        members = tuple(n for n in network.nodes if n in group)
        heat = sum(powers.get(load.path, 0.0) for load in network.flat.loads if load.node in members)
        capacity = sum(value_of(c) for n in members if (c := numbers.capacitances.get(n)) is not None)
        if capacity > 0:
            out.append(Unreached(members, heat / capacity))
    return tuple(out)


def _spread(start: Iterable[str], joined: Mapping[str, set[str]]) -> set[str]:
    """Return every node that can be reached from `start`."""
    seen, edge = set(start), list(start)
    while edge:
        fresh = joined[edge.pop()] - seen
        seen |= fresh
        edge += fresh
    return seen
