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
from itertools import takewhile
from typing import Final

import numpy as np

FITTED: Final = "fitted, was"
"""Mark of a row that was written back: its exchange factors are those of another emissivity."""
POSITIVE: Final = 0.9
"""Share of a conductor that reflections may lose as an emissivity rises to 1, so that it stays positive."""
_PROPERTY: Final = re.compile(r"(\S.*?)\s+([01]?\.\d+|[01]\.?)\s+[01]?\.?\d*\s*")
_ROW: Final = re.compile(r"\s*-\d+\s*,\s*([\w.]+)\s*,\s*([\w.]+)\s*,\s*([-+.\deEdD]+)")
_AREA: Final = re.compile(r"^\s*([\w.]+)\s+([-+.\deE]+)\s*$", re.MULTILINE)


@dataclass(frozen=True)
class FileEmissivity:
    """An emissivity that a radiation conductor follows: its parameter, its value in the file, and what the conductor loses by it.

    The conductor is divided by 1 + lost u, or times 1 - lost u where that is negative, with u = value/parameter - 1.
    """

    name: str
    value: float
    lost: float

    @property
    def text(self) -> str:
        """Return the term lost u without its sign."""
        return f"{abs(self.lost):.5g}*{self.fall}"

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


def read_emissivities(lines: Sequence[tuple[str, str]], properties: Mapping[str, float], areas: str) -> Emissivities | None:
    """Return how a block of radiation conductors follows emissivities; None when its comments or the areas do not say it.

    Parameters
    ----------
    lines : list        The rows, each with the comment behind it.
    properties : dict   Name of a parameter -> emissivity, of the optical properties of the block.
    areas : str         Text of the file of areas. [m^2]
    """
    area = {node.upper(): float(number) for node, number in _AREA.findall(areas)}
    pairs = [match.groups() if (match := _ROW.match(text)) else None for text, _ in lines]
    if not properties or not area or None in pairs or any(FITTED in note for _, note in lines):
        return None
    at: dict[str, int] = {}
    exchange, certain = {}, dict[str, float]()
    for (_, note), (a, b, number) in zip(lines, pairs, strict=True):  # type: ignore[misc]
        g = float(number)
        factors = [float(word) for word in re.split(r"[\s,]+", note.strip()) if word]
        for node, factor in zip((a.upper(), b.upper()), factors, strict=False):
            if factor > certain.get(node, 0.0) and node in area:
                certain[node], exchange[node] = factor, g / factor  # A e, by the factor with most digits
        for node in (a, b):
            at.setdefault(node.upper(), len(at))
    names, levels = list(properties), np.array(list(properties.values()))
    emissivity = {node: g / area[node] for node, g in exchange.items()}
    of = {node: names[int(np.argmin(np.abs(levels - e)))] for node, e in emissivity.items()}
    G = np.zeros((len(at), len(at)))  # noqa: N806  # the letter of the formula
    ends = [(at[a.upper()], at[b.upper()]) for a, b, _ in pairs]  # type: ignore[misc]
    for (i, j), (_, _, number) in zip(ends, pairs, strict=True):  # type: ignore[misc]
        G[i, j] -= float(number)
        G[j, i] -= float(number)
    np.fill_diagonal(G, -G.sum(axis=1))
    lost = {}
    for name in names:
        inner = [node for node in of if of[node] == name]
        k = [at[node] for node in inner]
        lost[name] = (G[:, k] / np.array([exchange[node] for node in inner])) @ G[k] if k else np.zeros_like(G)
    floor = {name: -POSITIVE / (1.0 - e) if e < 1.0 else -np.inf for name, e in properties.items()}
    rows = []
    for i, j in ends:
        shares = ((name, max(float(lost[name][i, j] / G[i, j]), floor[name])) for name in names)
        rows.append(tuple(FileEmissivity(name, properties[name], m) for name, m in shares if m))
    counts = {name: sum(other_name == name for other_name in of.values()) for name in names}
    between = sum(abs(emissivity[node] - properties[of[node]]) > 1e-3 for node in of)
    return Emissivities({name: (properties[name], n) for name, n in counts.items() if n}, rows, between)


def optical_properties(comments: Sequence[str]) -> dict[str, float]:
    """Return name -> emissivity of the table of optical properties among the comments of a block."""
    begin = next((k for k, words in enumerate(comments) if words.startswith("PROPERTY NAME")), len(comments))
    rows = (_PROPERTY.match(words + " ") for words in comments[begin + 1 :])
    return {row[1]: float(row[2]) for row in takewhile(bool, rows) if row}
