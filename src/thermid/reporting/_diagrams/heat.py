"""The network coloured by temperature, small enough for the top of a page: a chip a node, lines as wide as the heat that they carry."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Final

import numpy as np

from thermid.model.tree import Flat, Model, flatten
from thermid.physics.constants import ICE_POINT
from thermid.reporting._diagrams.diagram import quantity, tint
from thermid.reporting._diagrams.layout import clipped, width_of
from thermid.reporting._diagrams.places import grid

SIZE: Final = (620.0, 340.0)
"""Width and height. [px]"""
MAX_CHIPS: Final = 20
"""So many chips at most; beyond it a part is one chip with its hottest node."""
LETTERS: Final = 11.0
"""Size of letters. [px]"""
SIGN: Final = 0.26
"""How much wider a plus or an arrow is than other signs, in letters' size. [-]"""
TALL: Final = 46.0
"""Height of a chip. [px]"""
MOST_APART: Final = 112.0
"""Height of a row of chips at most. [px]"""
SCALE: Final = 34.0
"""Height of the strip with the scale below. [px]"""


@dataclass(frozen=True)
class Chip:
    """One node, or one part: name, nodes, temperature [K], heat put in and given to boundaries [W], and its middle. [px]"""

    name: str
    nodes: tuple[str, ...]
    kelvin: float
    power: float
    lost: float
    x: float
    y: float
    width: float


def heat_map(
    model: Model,
    temperatures: Mapping[str, float],
    flows: Mapping[str, float],
    powers: Mapping[str, float],
    *,
    title: str = "",
    size: tuple[float, float] = SIZE,
) -> str:
    """Return a model as SVG: nodes coloured by temperature, lines as wide as the heat between them.

    Massless nodes between two others are part of the line; the heat to boundaries is written on each node. Beyond `MAX_CHIPS` nodes a part
    of the model is one chip with the temperature of its hottest node.

    Parameters
    ----------
    model : Model           What is drawn.
    temperatures : dict     Path of a node or boundary -> temperature. [K]
    flows : dict            Conductor -> heat flow from its first end to its second. [W]
    powers : dict           Load -> power. [W]
    title : str             What a screen reader says; the model's title by default.
    size : (width, height)  The height at most. [px]
    """
    flat = flatten(model)
    links = _links(flat, flows)
    chips, size = _chips(flat, temperatures, flows, powers, links, size)
    of = {node: chip for chip in chips for node in chip.nodes}
    shown = {c.name: c.kelvin for c in chips}
    label = escape(
        f"{title or model.title}, temperatures of the network: " + ", ".join(f"{c.name} {c.kelvin - ICE_POINT:.1f} °C" for c in chips)
    )
    out = [
        f'<svg class="plot heat" role="img" aria-label="{label}" viewBox="0 0 {size[0]:g} {size[1]:g}" '
        f'style="font-size:{LETTERS:g}px;fill:var(--f-ink,#1a2230)">'
    ]
    out += _lines(links, of, chips)
    out += [piece for chip in chips for piece in _drawn(chip, shown)]
    out += _scale(shown, [b for b in flat.names.boundaries if b in temperatures], temperatures, size)
    return "".join([*out, "</svg>"])


def _links(flat: Flat, flows: Mapping[str, float]) -> dict[tuple[str, str], float]:
    """Return pair of nodes -> heat from the first to the second, massless nodes between two others taken into the line. [W]"""
    inner = {n.path for n in flat.nodes}
    pairs: dict[tuple[str, str], float] = {}
    for c in flat.conductors:
        a, b = c.ends
        if a in inner and b in inner and a != b:
            key, sign = ((a, b), 1.0) if a < b else ((b, a), -1.0)
            pairs[key] = pairs.get(key, 0.0) + sign * float(flows.get(c.path, 0.0))
    loaded = {load.node for load in flat.loads}
    outside = {n for c in flat.conductors for n in c.ends if not set(c.ends) <= inner}
    for node in flat.nodes:
        pairs_of_node = [p for p in pairs if node.path in p]
        if node.fields or len(pairs_of_node) != 2 or node.path in loaded | outside:
            continue
        ends = [(p[0] if p[1] == node.path else p[1]) for p in pairs_of_node]
        heat = [pairs.pop(p) * (1.0 if p[1] == node.path else -1.0) for p in pairs_of_node]  # into the node
        key, sign = ((ends[0], ends[1]), 1.0) if ends[0] < ends[1] else ((ends[1], ends[0]), -1.0)
        if ends[0] != ends[1]:
            pairs[key] = pairs.get(key, 0.0) + sign * 0.5 * (heat[0] - heat[1])
    return pairs


def _names(paths: Sequence[str]) -> dict[str, str]:
    """Return path -> the shortest of its ends that is its own; the last word goes where the part has no other node."""
    below = Counter(".".join(p.split(".")[:k]) for p in paths for k in range(1, p.count(".") + 1))
    bare = {p: p.rpartition(".")[0] if below[p.rpartition(".")[0]] == 1 else p for p in paths}
    out = {}
    for path, text in bare.items():
        words = text.split(".")
        ends = [".".join(words[-k:]) for k in range(1, len(words) + 1)]
        out[path] = next(
            (e for e in ends if not any(o != path and (t == e or t.endswith(f".{e}")) for o, t in bare.items())),
            text,
        )
    return out


def _chips(
    flat: Flat,
    temperatures: Mapping[str, float],
    flows: Mapping[str, float],
    powers: Mapping[str, float],
    links: Mapping[tuple[str, str], float],
    size: tuple[float, float],
) -> tuple[list[Chip], tuple[float, float]]:
    """Return the chips at their places, and the size that they need. [px]"""
    joined = {n for pair in links for n in pair}
    paths = [n.path for n in flat.nodes if n.fields or n.path in joined]
    names = _names(paths)
    groups: dict[str, list[str]] = {}
    for path in paths:
        groups.setdefault(names[path] if len(paths) <= MAX_CHIPS else path.partition(".")[0], []).append(path)
    keys = list(groups)
    place = {node: k for k, key in enumerate(keys) for node in groups[key]}
    weight = np.zeros((len(keys), len(keys)))
    for a, b in links:
        i, j = place[a], place[b]
        if i != j:
            weight[i, j] = weight[j, i] = weight[i, j] + 1.0
    room = size[1] - SCALE
    lines = max(1, min(round(math.sqrt(0.62 * len(keys))), int(room // (TALL + 14.0))))
    columns, rows, spots = grid(weight, lines, (1.0, 0.8))
    wide, high = size[0] / columns, min(room / rows, MOST_APART)
    into: dict[str, float] = {}
    for load in flat.loads:
        into[load.node] = into.get(load.node, 0.0) + float(powers.get(load.path, 0.0))
    lost: dict[str, float] = {}
    for c in flat.conductors:
        for node, other, sign in ((c.ends[0], c.ends[1], 1.0), (c.ends[1], c.ends[0], -1.0)):
            if node in place and other not in place and other in flat.names.boundaries:
                lost[node] = lost.get(node, 0.0) + sign * float(flows.get(c.path, 0.0))
    out = []
    for key, (column, row) in zip(keys, spots, strict=True):
        nodes = tuple(groups[key])
        hottest = max(temperatures[n] for n in nodes)
        put, gone = (sum(table.get(n, 0.0) for n in nodes) for table in (into, lost))
        out.append(Chip(key, nodes, hottest, put, gone, (column + 0.5) * wide, (row + 0.5) * high, min(wide - 46.0, 150.0)))
    return out, (size[0], rows * high + SCALE)


def _lines(links: Mapping[tuple[str, str], float], of: Mapping[str, Chip], chips: Sequence[Chip]) -> Iterator[str]:
    """Yield a line for every two chips between which heat flows, an arrow at its middle, the heat beside it."""
    sums: dict[tuple[str, str], float] = {}
    by = {c.name: c for c in chips}
    for (a, b), heat in links.items():
        first, second = of[a].name, of[b].name
        if first != second:
            key, sign = ((first, second), 1.0) if first < second else ((second, first), -1.0)
            sums[key] = sums.get(key, 0.0) + sign * heat
    most = max((abs(v) for v in sums.values()), default=0.0) or 1.0
    labels = []
    for (a, b), heat in sums.items():
        start, end = (by[a], by[b]) if heat >= 0 else (by[b], by[a])
        wide = 1.0 + 6.0 * abs(heat) / most
        way = np.array([end.x - start.x, end.y - start.y])
        along = way / float(np.hypot(*way))
        (x1, y1), (x2, y2) = _edge(start, along), _edge(end, -along)
        x, y = 0.5 * (x1 + x2), 0.5 * (y1 + y2)
        tip = f"<title>{escape(start.name)} to {escape(end.name)}: {quantity(abs(heat), 'W')}</title>"
        yield (
            f'<path d="M{start.x:.1f} {start.y:.1f}L{end.x:.1f} {end.y:.1f}" style="fill:none;stroke:var(--f-grid,#c5ced8);'
            f'stroke-width:{wide:.1f};filter:brightness(.86)">{tip}</path>'
        )
        across = np.array([-along[1], along[0]])
        head = [
            np.array([x, y]) + 6.0 * along,
            np.array([x, y]) - 4.0 * along + 5.0 * across,
            np.array([x, y]) - 4.0 * along - 5.0 * across,
        ]
        points = "L".join(f"{p[0]:.1f} {p[1]:.1f}" for p in head)
        yield f'<path d="M{points}z" style="fill:var(--f-soft,#556172)"/>'
        text = quantity(abs(heat), "W", 2)
        level = abs(along[1]) < 0.5
        labels.append(
            f'<text x="{x if level else x + 9:.1f}" y="{y - 9 if level else y + 4:.1f}" text-anchor="{"middle" if level else "start"}" '
            f'style="fill:var(--f-soft,#556172);paint-order:stroke;stroke:var(--paper,#fff);stroke-width:3px">{text}</text>'
        )
    yield from labels


def _edge(chip: Chip, along: np.ndarray) -> tuple[float, float]:
    """Return where a line from the middle of a chip leaves it."""
    far = min(0.5 * chip.width / max(abs(along[0]), 1e-9), 0.5 * TALL / max(abs(along[1]), 1e-9))
    return chip.x + far * float(along[0]), chip.y + far * float(along[1])


def _drawn(chip: Chip, shown: Mapping[str, float]) -> Iterator[str]:
    """Yield a chip: name, temperature, heat in and heat to the boundaries."""
    x_left, top = chip.x - 0.5 * chip.width, chip.y - 0.5 * TALL
    heat = [f"+{quantity(chip.power, 'W', 2)}"] if chip.power else []
    heat += [f"\u2192 {quantity(chip.lost, 'W', 2)}"] if abs(chip.lost) > 5e-4 else []
    lines = (
        (clipped(chip.name, chip.width - 10.0, LETTERS), "font-weight:600"),
        (("to " if len(chip.nodes) > 1 else "") + f"{chip.kelvin - ICE_POINT:.1f} °C", ""),
        (clipped("  ".join(heat), chip.width - 6.0, LETTERS), ""),
    )
    tip = f"<title>{escape(', '.join(chip.nodes))}</title>"
    yield (
        f'<rect class="chip" x="{x_left:.1f}" y="{top:.1f}" width="{chip.width:.1f}" height="{TALL:g}" rx="6" '
        f'style="fill:{tint(chip.kelvin, shown)};stroke:var(--f-soft,#556172)">{tip}</rect>'
    )
    for k, (text, look) in enumerate(lines):
        if text:
            place = f'x="{chip.x:.1f}" y="{top + 13.5 + 13.5 * k:.1f}" text-anchor="middle"'
            if width_of(text, LETTERS) + SIGN * LETTERS * sum(c in "+\u2192" for c in text) > chip.width - 10.0:
                place += f' textLength="{chip.width - 10.0:.0f}" lengthAdjust="spacingAndGlyphs"'
            yield f'<text {place} style="fill:#1a2230;{look}">{escape(text)}</text>'


def _scale(
    shown: Mapping[str, float], boundaries: Sequence[str], temperatures: Mapping[str, float], size: tuple[float, float]
) -> Iterator[str]:
    """Yield the scale of the colours with its ends, and the boundaries."""
    low, high = min(shown.values()), max(shown.values())
    y = size[1] - 16.0
    steps = 24
    for k in range(steps):
        kelvin = low + (high - low) * k / (steps - 1)
        yield f'<rect x="{60 + 5 * k:g}" y="{y - 9:g}" width="5.4" height="11" style="fill:{tint(kelvin, {"a": low, "b": high})}"/>'
    yield f'<text x="54" y="{y:g}" text-anchor="end">{low - ICE_POINT:.1f}</text>'
    yield f'<text x="{66 + 5 * steps:g}" y="{y:g}">{high - ICE_POINT:.1f} °C</text>'
    words = "+ heat put in, \u2192 heat to " + ", ".join(f"{b} at {temperatures[b] - ICE_POINT:.1f} °C" for b in boundaries[:3])
    if boundaries:
        edge = 66 + 5 * steps + width_of(f"{high - ICE_POINT:.1f} °C") + 16
        yield f'<text x="{edge:.0f}" y="{y:g}" style="fill:var(--f-soft,#556172)">{escape(clipped(words, size[0] - edge, LETTERS))}</text>'
