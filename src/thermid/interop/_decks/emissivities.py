"""How the radiation conductors of Thermal Desktop follow the emissivities of their surfaces.

A block of them lists ``A e B`` of each pair of nodes [m^2], in a comment behind it the exchange factors ``B``, above them the optical
properties that were used; the areas ``A`` stand in a file beside it (.ar). So each node's emissivity is known, and by it its property.

Symbols: G matrix of the conductors, a row's sum on its diagonal and -G_ij off it [m^2]; e, e' emissivity as computed and changed [-].
Between a surface and its radiosity stands the resistance ``(1/e - 1)/A``, so that a change adds ``r = (1/e' - 1/e)/A`` in series:
``G' = G (I + R G)^-1``. To first order in ``u = e/e' - 1`` that is ``G_ij (1 - sum of m_ijp u_p over the properties p)`` with
``m_ijp = (G D_p G)_ij / G_ij`` and ``1/(A e)`` of the nodes of p on the diagonal of D. As ``G_ij / (1 + sum of m u)`` it is exact for two
surfaces that see each other only. Terms with a negative m, of pairs that see each other by reflection, stay factors ``1 - m u``.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

WAS: Final = re.compile(r"fitted, was ([-+.\deEdD]+)")
"""Mark of a number that was written back: the first says what the exchange factors were computed with."""
POSITIVE: Final = 0.9
"""Share of a conductor that reflections may lose as an emissivity rises to 1, so that it stays positive."""
PROPERTY: Final = re.compile(r"[Cc][ \t]+(\S.*?)[ \t]+([01]?\.\d+|[01]\.?)(?:[ \t]+[01]?\.?\d*)?(?:.*?fitted, was ([-+.\deEdD]+))?.*\n")
"""A row of the list of optical properties: name, emissivity, and what that was before a fit, if it is one."""
_ROW: Final = re.compile(r"\s*-\d+\s*,\s*([\w.]+)\s*,\s*([\w.]+)\s*,\s*([-+.\deEdD]+)")
_AREA: Final = re.compile(r"^\s*([\w.]+)\s+([-+.\deE]+)\s*$", re.MULTILINE)


@dataclass(frozen=True)
class FileEmissivity:
    """An emissivity that a radiation conductor follows: its parameter, the value it was computed with, and what the conductor loses by it.

    The conductor is divided by 1 + lost u, or times 1 - lost u where that is negative, with u = value/parameter - 1. ``now`` is the
    emissivity of the conductor's number in the file: another one once a fit has been written back.
    """

    name: str
    value: float
    lost: float
    now: float

    @property
    def text(self) -> str:
        """Return the term lost u without its sign."""
        return f"{abs(self.lost):.5g}*{self.fall}"

    @property
    def term(self) -> float:
        """Return the term lost u without its sign, of the conductor's number in the file."""
        return float(f"{abs(self.lost):.5g}") * (self.value / self.now - 1.0)

    @property
    def fall(self) -> str:
        """Return the name of u."""
        return self.name.replace("emissivity_", "fall_of_emissivity_", 1)


@dataclass(frozen=True)
class Emissivities:
    """The optical properties of a block: their emissivities, and for each row what it loses by each as it falls.

    Parameters
    ----------
    values : dict       Name of a parameter -> emissivity and the number of its nodes.
    rows : list         For each row the emissivities that it follows; empty for one that is not of the form.
    between : int       Nodes with an emissivity that is none of the block's, counted to the nearest.
    """

    values: Mapping[str, tuple[float, int]]
    rows: Sequence[tuple[FileEmissivity, ...]]
    between: int


def read_emissivities(lines: Sequence[tuple[str, str]], properties: Mapping[str, tuple[float, float]], areas: str) -> Emissivities | None:
    """Return how the conductors of a radiation block depend on the emissivities of its surfaces.

    A conductor G of a node with area A and exchange factor B gives its emissivity, ``G / (A B)``; the nearest emissivity of the block
    tells which property the node has. How much each conductor loses by each property is m_ijp of the module's formula.

    Returns None where a row is no radiation conductor, or properties or areas are missing.

    Parameters
    ----------
    lines : list        The rows, each with the comment behind it: the exchange factors B of its two nodes.
    properties : dict   Name of a parameter -> emissivity with which the conductors were computed, and emissivity now.
    areas : str         Text of the area file (.ar): a node and its area on each line. [m^2]
    """
    area = {node.upper(): float(number) for node, number in _AREA.findall(areas)}
    pairs = [match.groups() if (match := _ROW.match(text)) else None for text, _ in lines]
    if not properties or not area or None in pairs:
        return None
    at: dict[str, int] = {}
    exchange, certain = {}, dict[str, float]()
    computed = [float(was[1] if (was := WAS.search(note)) else pair[2]) for (_, note), pair in zip(lines, pairs, strict=True)]  # type: ignore[index]
    for (_, note), (a, b, _), g in zip(lines, pairs, computed, strict=True):  # type: ignore[misc]
        factors = [float(word) for word in re.split(r"[\s,]+", note.partition("$")[0].strip()) if word]
        for node, factor in zip((a.upper(), b.upper()), factors, strict=False):
            if factor > certain.get(node, 0.0) and node in area:
                certain[node], exchange[node] = factor, g / factor  # A e, by the factor with most digits
        for node in (a, b):
            at.setdefault(node.upper(), len(at))
    names, levels = list(properties), np.array([e for e, _ in properties.values()])
    emissivity = {node: g / area[node] for node, g in exchange.items()}
    of = {node: names[int(np.argmin(np.abs(levels - e)))] for node, e in emissivity.items()}
    G = np.zeros((len(at), len(at)))  # noqa: N806  # the letter of the formula
    ends = [(at[a.upper()], at[b.upper()]) for a, b, _ in pairs]  # type: ignore[misc]
    for (i, j), g in zip(ends, computed, strict=True):
        G[i, j] -= g
        G[j, i] -= g
    np.fill_diagonal(G, -G.sum(axis=1))
    lost = {}
    for name in names:
        inner = [node for node in of if of[node] == name]
        k = [at[node] for node in inner]
        lost[name] = (G[:, k] / np.array([exchange[node] for node in inner])) @ G[k] if k else np.zeros_like(G)
    floor = {name: -POSITIVE / (1.0 - e) if e < 1.0 else -np.inf for name, (e, _) in properties.items()}
    rows = []
    for i, j in ends:
        shares = ((name, max(float(lost[name][i, j] / G[i, j]), floor[name])) for name in names)
        rows.append(tuple(FileEmissivity(name, properties[name][0], m, properties[name][1]) for name, m in shares if m))
    counts = {name: sum(other_name == name for other_name in of.values()) for name in names}
    between = sum(abs(emissivity[node] - properties[of[node]][0]) > 1e-3 for node in of)
    return Emissivities({name: (properties[name][0], n) for name, n in counts.items() if n}, rows, between)
