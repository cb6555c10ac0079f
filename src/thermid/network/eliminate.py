"""Elimination of massless nodes: star to mesh, exact for linear conductors, with derivatives.

A node without capacitance that is joined by linear, constant conductors only is replaced by conductors ``g_i g_j / sum g`` between its
neighbours; its temperature is their mean weighted by ``g_i / sum g``. Kirchhoff's star-mesh rule (Rosen, 1924). Other massless nodes
are solved with the states by the kernel.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from thermid.dual import Number, value_of
from thermid.errors import DeckError
from thermid.model.laws.stores import Store
from thermid.network.network import Network, Numbers
from thermid.network.rows import ConductorRow


@dataclass(frozen=True, eq=False)
class Reduced:
    """A network without the massless nodes that could be eliminated.

    Parameters
    ----------
    nodes : tuple of str            The nodes that are left, in order.
    capacitances : dict             Node -> capacitance, None for a massless node that is left. [J/K]
    conductors : tuple              Rows between the nodes that are left and the boundaries.
    recover : tuple of (str, dict)  Eliminated node -> neighbour -> weight; in the order in which they can be computed.
    stored : dict                   Node that holds the heat of another, whose specific heat changes -> that other, and how it stores heat.
    """

    nodes: tuple[str, ...]
    capacitances: Mapping[str, Number | None]
    conductors: tuple[ConductorRow, ...]
    recover: tuple[tuple[str, Mapping[str, Number]], ...]
    stored: Mapping[str, tuple[str, Store]] = field(default_factory=dict)

    def states(self, temperatures: Mapping[str, Any]) -> list[Any]:
        """Return what the kernel solves for, in the order of `nodes`, from temperatures of all nodes. [K]"""
        held = {own: store.level(temperatures[node]) for own, (node, store) in self.stored.items()}
        return [held[n] if n in held else temperatures[n] for n in self.nodes]


QUICK: Final = 1e5
"""Rate at which a node follows the heat that it holds, where its specific heat changes: late by ten microseconds. [1/s]"""


def held_in(node: str) -> str:
    """Return the name of the node that holds the heat of another, whose specific heat changes."""
    return f"{node} enthalpy"


def with_stores(reduced: Reduced, stores: Mapping[str, Store]) -> Reduced:
    """Return a network in which nodes whose specific heat changes hold their heat in a node of constant capacitance beside them."""
    if not stores:
        return reduced
    capacitances, rows, stored = dict(reduced.capacitances), list(reduced.conductors), {}
    for node, store in stores.items():
        own, capacitance = held_in(node), capacitances[node]
        if capacitance is None:
            continue
        capacitances |= {node: None, own: capacitance}
        stored[own] = (node, store)
        rows.append(ConductorRow(own, "potential", (own, node), (QUICK * capacitance,), store.curve))
    return Reduced(tuple(capacitances), capacitances, tuple(rows), reduced.recover, stored)


def eliminable(numbers: Numbers, keep: frozenset[str] = frozenset()) -> tuple[str, ...]:
    """Return the massless nodes that star to mesh can replace."""
    loaded = {row.node for row in numbers.loads} | {row.sensor for row in numbers.loads}
    crooked = {end for row in numbers.conductors if row.form != "linear" or row.signal for end in row.ends}
    return tuple(n for n, c in numbers.capacitances.items() if c is None and n not in loaded and n not in crooked and n not in keep)


def reduce_network(network: Network, numbers: Numbers, gone: tuple[str, ...]) -> Reduced:
    """Return the network without the nodes `gone`.

    Raises
    ------
    DeckError   When a massless node has no conductance to anything, so that its temperature is undefined.
    """
    if not gone:
        return Reduced(network.nodes, numbers.capacitances, numbers.conductors, ())
    kept = [row for row in numbers.conductors if not set(row.ends) & set(gone)]
    mesh: dict[frozenset[str], Number] = {}
    for row in numbers.conductors:
        if set(row.ends) & set(gone) and row.ends[0] != row.ends[1]:  # two needs of a part may be bound to one node
            pair = frozenset(row.ends)
            mesh[pair] = mesh[pair] + row.coefficients[0] if pair in mesh else row.coefficients[0]
    recover: list[tuple[str, Mapping[str, Number]]] = []
    for node in gone:
        star = {next(iter(pair - {node})): g for pair, g in mesh.items() if node in pair}
        total = sum_of(star)
        if not value_of(total) > 0:
            where = next((n.where for n in network.flat.nodes if n.path == node), network.title)
            raise DeckError(f"the massless node '{node}' has no conductance to anything, so its temperature is undefined.", where)
        mesh = {pair: g for pair, g in mesh.items() if node not in pair}
        ends = list(star)
        for i, a in enumerate(ends):
            for b in ends[i + 1 :]:
                pair, g = frozenset((a, b)), star[a] * star[b] / total
                mesh[pair] = mesh[pair] + g if pair in mesh else g
        recover.append((node, {k: g / total for k, g in star.items()}))
    order = {name: k for k, name in enumerate((*network.nodes, *network.boundaries))}
    for pair, g in mesh.items():
        a, b = sorted(pair, key=order.__getitem__)
        if a in network.boundaries:
            continue  # both ends are given: heat between them changes no unknown
        kept.append(ConductorRow(f"mesh {a} {b}", "linear", (a, b), (g,)))
    nodes = tuple(n for n in network.nodes if n not in gone)
    return Reduced(nodes, {n: numbers.capacitances[n] for n in nodes}, tuple(kept), tuple(reversed(recover)))


def sum_of(star: Mapping[str, Number]) -> Number:
    """Return the sum of conductances. [W/K]"""
    total: Number = 0.0
    for g in star.values():
        total = total + g
    return total
