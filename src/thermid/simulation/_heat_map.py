"""Where the heat of a steady state goes: by conductor, by node, between groups of nodes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any, Final

import numpy as np

from thermid.base.errors import NameNotFoundError, nearest
from thermid.base.units import ICE_POINT, value_of
from thermid.simulation._network.network import Network

MAX_GROUPS_ON_SCREEN: Final = 9
"""Groups whose matrix fits a screen."""
SHOWN_NEIGHBOURS: Final = 3
"""Neighbours that the line of a node names."""


@dataclass(frozen=True)
class Path:
    """Heat flow of one conductor in a steady state, positive from its first end to its second.

    Parameters
    ----------
    name, kind : str    Of the conductor.
    ends : (str, str)   Nodes.
    heat : float        [W]
    """

    name: str
    kind: str
    ends: tuple[str, str]
    heat: float


@dataclass(frozen=True)
class NodeBalance:
    """Heat balance of one node in a steady state.

    Parameters
    ----------
    node : str          Its path.
    kelvin : float      Its temperature. [K]
    loads : float       Heat of its loads. [W]
    paths : tuple       Neighbour and heat from there, the largest first. [W]
    residual : float    What does not add up; of a boundary, the heat that it takes. [W]
    given : bool        Whether its temperature is given.
    """

    node: str
    kelvin: float
    loads: float
    paths: tuple[tuple[str, float], ...]
    residual: float
    given: bool


@dataclass(frozen=True)
class HeatMap:
    """The heat flows of a steady state.

    Parameters
    ----------
    temperatures : dict     Node -> temperature. [K]
    boundaries : tuple      Nodes whose temperature is given.
    paths : tuple           Every conductor.
    loads : dict            Load -> node and power. [W]
    parts : dict            Group of made parts by the first step of a path, such as ``u1`` -> ``packages``.
    readings : dict         Node of a junction -> the temperature that a reading of its top or board and psi give. [K]
    """

    temperatures: Mapping[str, float]
    boundaries: tuple[str, ...]
    paths: tuple[Path, ...]
    loads: Mapping[str, tuple[str, float]]
    parts: Mapping[str, str]
    readings: Mapping[str, tuple[str, float]]

    @classmethod
    def of_network(
        cls, network: Network, temperatures: Mapping[str, float], flows: Mapping[str, float], powers: Mapping[str, float]
    ) -> HeatMap:
        """Return the map of a network: `temperatures` by node [K], `flows` by conductor and `powers` by load [W]."""
        flat = network.flat
        paths = tuple(Path(c.path, c.kind, c.ends, flows[c.path]) for c in flat.conductors if c.path in flows)
        loads = {x.path: (x.node, powers[x.path]) for x in flat.loads if x.path in powers}
        parts = {name: part.made for name, part in flat.names.model.submodels.items() if part.made}
        values = flat.parameters.evaluate({})
        boards = {c.path: c.ends[1] for c in flat.conductors if c.path.endswith(".JB")}
        readings = {}
        for path, value in values.items():
            head, _, field = path.rpartition(".")
            text = {"psi_JT": f"{head}.case", "psi_JB": boards.get(f"{head}.JB", "")}.get(field, "")
            if text in temperatures and f"{head}.heat" in powers:
                readings[f"{head}.junction"] = (field, temperatures[text] + value_of(value) * powers[f"{head}.heat"])
        return cls(temperatures, network.boundaries, paths, loads, parts, readings)

    def balances(self) -> tuple[NodeBalance, ...]:
        """Return the balance of every node, the hottest first."""
        arriving: dict[str, dict[str, float]] = {n: {} for n in self.temperatures}
        for path in self.paths:
            a, b = path.ends
            arriving[b][a] = arriving[b].get(a, 0.0) + path.heat
            if path.kind != "flow":  # a stream brings heat to its second end and takes none from its first
                arriving[a][b] = arriving[a].get(b, 0.0) - path.heat
        powers = dict.fromkeys(self.temperatures, 0.0)
        for node, power in self.loads.values():
            powers[node] += power
        out = []
        for node, kelvin in sorted(self.temperatures.items(), key=lambda item: -item[1]):
            neighbours = tuple(sorted(arriving[node].items(), key=lambda item: -abs(item[1])))
            residual = powers[node] + sum(heat for _, heat in neighbours)
            out.append(NodeBalance(node, kelvin, powers[node], neighbours, residual, node in self.boundaries))
        return tuple(out)

    def worst(self) -> float:
        """Return the largest residual of the balance of a free node, relative to the largest flow or load. [-]"""
        size = max([abs(p.heat) for p in self.paths] + [abs(w) for _, w in self.loads.values()], default=0.0) or 1.0
        return max((abs(b.residual) for b in self.balances() if not b.given), default=0.0) / size

    def grouped(self, patterns: Mapping[str, str] | None = None) -> dict[str, tuple[str, ...]]:
        """Return group -> nodes.

        Parameters
        ----------
        patterns : dict  Name -> pattern of nodes, ``*`` for any text; patterns are tried in order. A node of none is in the group of the
                        first step of its path: its part (parts of one kind of element together), or itself.

        Raises
        ------
        NameNotFoundError   When a pattern meets no node.
        """
        out: dict[str, list[str]] = {name: [] for name in patterns or {}}
        for node in self.temperatures:
            head = node.partition(".")[0]
            colour = next((name for name, pattern in (patterns or {}).items() if _meets(node, pattern)), None)
            out.setdefault(colour or self.parts.get(head, head), []).append(node)
        for name, pattern in (patterns or {}).items():
            if not out[name]:
                raise NameNotFoundError(f"no node matches '{pattern}'.{nearest(pattern, self.temperatures)}", f"--group {name}")
        return {name: tuple(nodes) for name, nodes in out.items()}

    def between(self, groups: Mapping[str, Sequence[str]]) -> np.ndarray:
        """Return the heat (groups, groups) that goes from the group of a row to that of a column; loads of a group on its diagonal. [W]"""
        index = {node: k for k, nodes in enumerate(groups.values()) for node in nodes}
        out = np.zeros((len(groups), len(groups)))
        for path in self.paths:
            a, b = (index[end] for end in path.ends)
            if a != b:
                out[a, b] += path.heat
                if path.kind != "flow":
                    out[b, a] -= path.heat
        for node, power in self.loads.values():
            out[index[node], index[node]] += power
        return out

    def to_dict(self, groups: Mapping[str, Sequence[str]]) -> dict[str, Any]:
        """Return conductors, loads, balances, groups and readings as ``td.steady(...).to_dict()`` has them; heats in W."""
        return {
            "conductors": {p.name: {"kind": p.kind, "from": p.ends[0], "to": p.ends[1], "W": p.heat} for p in self.paths},
            "loads": {name: {"into": node, "W": power} for name, (node, power) in self.loads.items()},
            "balance": {
                b.node: {"loads_W": b.loads, "from_W": dict(b.paths), ("takes_W" if b.given else "residual_W"): b.residual}
                for b in self.balances()
            },
            "groups": {name: list(nodes) for name, nodes in groups.items()},
            "between_W": self.between(groups).tolist(),
            "worst_residual": self.worst(),
            "readings": {node: {"of": psi, "C": kelvin - ICE_POINT} for node, (psi, kelvin) in self.readings.items()},
        }

    def lines(self, groups: Mapping[str, Sequence[str]]) -> list[str]:
        """Return the map as lines of text: heat between groups, balance of each node, heat of each conductor, junctions."""
        return [*self._matrix(groups), *self._nodes(), *self._conductors(), *self._readings()]

    def _matrix(self, groups: Mapping[str, Sequence[str]]) -> list[str]:
        """Return lines of the heat between groups: a matrix, or for many groups a list with the largest first."""
        heat, names = self.between(groups), list(groups)
        if len(names) <= MAX_GROUPS_ON_SCREEN:
            cells = [names, *([_watts(w) for w in row] for row in heat)]
            width = max(len(text) for row in cells for text in row) + 1
            rows = (f"  {n:<{width}}" + "".join(f"{text:>{width}}" for text in row) for n, row in zip(["", *names], cells, strict=True))
            return ["heat from row to column, loads of a group on the diagonal [W]", *rows]
        pairs = [(heat[i, j], names[i], names[j]) for i in range(len(names)) for j in range(len(names)) if i != j and heat[i, j] > 0.0]
        return [
            f"heat between {len(names)} groups, largest first [W]",
            *(f"  {w:10.4g}  {a} to {b}" for w, a, b in sorted(pairs, reverse=True)),
        ]

    def _nodes(self) -> list[str]:
        """Return a line for each node, hottest first: temperature, loads and heat from its largest neighbours."""
        rows = [f"heat of each node, hottest first [W]; largest residual {self.worst():.1e} of the largest flow"]
        width = max(map(len, self.temperatures))
        for b in self.balances():
            came = ", ".join(f"{heat:+.4g} {node}" for node, heat in b.paths[:SHOWN_NEIGHBOURS])
            more = f", {len(b.paths) - SHOWN_NEIGHBOURS} more" if len(b.paths) > SHOWN_NEIGHBOURS else ""
            inputs = f"takes {b.residual:.4g}" if b.given else f"loads {b.loads:.4g}"
            rows.append(f"  {b.node:<{width}} {b.kelvin - ICE_POINT:9.3f} degC  {inputs:<14} {came}{more}")
        return rows

    def _conductors(self) -> list[str]:
        """Return a line for each conductor, the largest heat first."""
        ordered = sorted(self.paths, key=lambda p: -abs(p.heat))
        width = max((len(p.name) for p in ordered), default=0)
        rows = [f"  {p.heat:10.4g}  {p.name:<{width}} {p.kind}: {p.ends[0]} to {p.ends[1]}" for p in ordered]
        return ["heat of each conductor, largest first [W]", *rows]

    def _readings(self) -> list[str]:
        """Return a line for each package: its junction as a reading of top or board with psi gives it, and as the network has it."""
        if not self.readings:
            return []
        rows = [
            f"  {n}: {k - ICE_POINT:.3f} degC by {psi}, {self.temperatures[n] - ICE_POINT:.3f} here"
            for n, (psi, k) in self.readings.items()
        ]
        return ["junctions by their readings", *rows]


def _meets(node: str, pattern: str) -> bool:
    """Return whether a node matches one of the comma-separated patterns, with ``*`` for any text."""
    return any(fnmatchcase(node, part.strip()) for part in pattern.split(","))


def _watts(heat: float) -> str:
    """Return a heat [W] with four digits, and a dot for zero."""
    return f"{heat:.4g}" if heat else "."


@dataclass(frozen=True)
class NodeMargin:
    """A node against its limits.

    Parameters
    ----------
    node : str                  Its path.
    lowest, highest : float     [K]
    limits : (low, high)        Infinite where there is none. [K]
    margin : float              To the nearer limit, negative beyond it. [K]
    """

    node: str
    lowest: float
    highest: float
    limits: tuple[float, float]
    margin: float


def margins(lowest: Mapping[str, float], highest: Mapping[str, float], limits: Mapping[str, tuple[float, float]]) -> tuple[NodeMargin, ...]:
    """Return nodes with their extremes and margins, the smallest margin first; without limits the hottest first.

    Parameters
    ----------
    lowest, highest : dict  Node -> temperature. [K]
    limits : dict           Pattern of nodes -> (low, high); the first pattern that a node meets holds. [K]

    Raises
    ------
    NameNotFoundError   When a pattern meets no node.
    """
    for pattern in limits:
        if not any(_meets(node, pattern) for node in highest):
            raise NameNotFoundError(f"no node matches '{pattern}'.{nearest(pattern, highest)}", "--limit")
    out = []
    for node, high in highest.items():
        ends = next((ends for pattern, ends in limits.items() if _meets(node, pattern)), (-np.inf, np.inf))
        out.append(NodeMargin(node, lowest[node], high, ends, float(min(lowest[node] - ends[0], ends[1] - high))))
    return tuple(sorted(out, key=lambda m: (m.margin, -m.highest)))


def margin_lines(rows: Sequence[NodeMargin]) -> list[str]:
    """Return margins as text, temperatures in degC and margins in K; one temperature where lowest and highest are the same."""
    width = max((len(m.node) for m in rows), default=0)
    limited = any(np.isfinite(m.margin) for m in rows)
    moving = any(m.highest - m.lowest > 1e-9 for m in rows)
    out = ["temperatures" + (", smallest margin first" if limited else ", hottest first") + " [degC]"]
    for m in rows:
        low = f"{m.lowest - ICE_POINT:9.3f} to" if moving else ""
        ends = " to ".join(f"{e - ICE_POINT:.6g}" if np.isfinite(e) else "-" for e in m.limits)
        margin_text = f"  margin {m.margin:8.3f} K of {ends}" if np.isfinite(m.margin) else ""
        out.append(f"  {m.node:<{width}} {low}{m.highest - ICE_POINT:9.3f}{margin_text}")
    return out
