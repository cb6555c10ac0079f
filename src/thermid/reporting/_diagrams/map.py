"""The network as a map: every node once, on one page, parts with few nodes as one card; what goes to a boundary or a hub is a badge."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Final

import numpy as np

from thermid.base.linear_algebra import Array
from thermid.model.tree import Flat, FlatConductor, Model, flatten
from thermid.reporting._diagrams.diagram import STYLES, quantity
from thermid.reporting._diagrams.layout import clipped

PAGE: Final = (1600.0, 1000.0)
"""Width and height of a page. [px]"""
FEW: Final = 4
"""A part of so many nodes is one card."""
HUB: Final = 12
"""A node joined to more cards than this is named on them in place of lines."""
LINE, HEAD, FOOT = 20.0, 17.0, 16.0
"""Heights of a node, of a card's name and of its badges. [px]"""
BENDS: Final = (0.0, 45.0, -45.0, 80.0, -80.0)
"""How far a line may leave the straight way to pass a card. [px]"""
SMALLEST: Final = 9.0
"""Letters. [px]"""
DASHES: Final = {"solid": "", "dashed": "6 4", "dotted": "2 3", "flow": "10 3", "mixed": "8 3 2 3"}
CSS: Final = """
.thermid-map{font-family:system-ui,-apple-system,"Segoe UI",Roboto,"Liberation Sans",sans-serif;background:#fff}
.thermid-map text{fill:#1c2430}.thermid-map .card{fill:#eef2f6;stroke:#4a6f96;stroke-width:1.2}
.thermid-map .hub{fill:#dbe7f3;stroke-width:2.2}
.thermid-map .node{fill:#dbe7f3;stroke:none}
.thermid-map .name{font-weight:600}
.thermid-map .soft{fill:#5a6675}
.thermid-map .wire{fill:none;stroke:#5a6675;stroke-width:1.3}
"""


@dataclass(frozen=True)
class Card:
    """A node, or a part with few nodes, at a place of the page.

    Parameters
    ----------
    name : str          The part's or the node's.
    nodes : tuple       Paths of its nodes.
    x, y, width, height : float     Left upper corner and size. [px]
    """

    name: str
    nodes: tuple[str, ...]
    x: float = 0.0
    y: float = 0.0
    width: float = 0.0
    height: float = 0.0

    def row(self, node: str) -> tuple[float, float]:
        """Return the middle of a node's row. [px]"""
        head = HEAD if len(self.nodes) > 1 else 4.0
        return self.x + 0.5 * self.width, self.y + head + LINE * (self.nodes.index(node) + 0.5)


def network_map(model: Model) -> str:
    """Return the map of a model as SVG, 1600 by 1000 pixels; the same model gives the same picture.

    Cards lie on a grid, neighbours near one another: first by the second and third eigenvector of the graph's Laplacian, then by exchanges
    that shorten the lines.

    References
    ----------
    Hall, An r-dimensional quadratic placement algorithm, Management Science 17 (1970) 219.
    """
    flat = flatten(model)
    cards, hubs = placed(model, flat)
    of = {node: card for card in cards for node in card.nodes}
    parts = [f'<svg class="thermid-map" xmlns="http://www.w3.org/2000/svg" role="img" viewBox="0 0 {PAGE[0]:g} {PAGE[1]:g}" ']
    parts[0] += f'width="{PAGE[0]:g}" height="{PAGE[1]:g}"><title>{escape(model.title)}</title><style>{CSS}</style>'
    parts += _wires(flat, of, hubs, within=False)
    parts += [piece for card in cards for piece in _card(flat, card, of, hubs)]
    parts += _wires(flat, of, hubs, within=True)
    parts += _legend(model, flat, hubs)
    return "\n".join([*parts, "</svg>"])


def placed(model: Model, flat: Flat) -> tuple[tuple[Card, ...], frozenset[str]]:
    """Return the cards of a model at their places, and the nodes that are hubs."""
    groups: dict[str, list[str]] = {}
    counts = {name: sum(n.path.startswith(f"{name}.") for n in flat.nodes) for name in model.submodels}
    for node in flat.nodes:
        head = node.path.partition(".")[0]
        groups.setdefault(head if 1 < counts.get(head, 0) <= FEW else node.path, []).append(node.path)
    names, card_of = list(groups), {node: name for name, nodes in groups.items() for node in nodes}
    near: dict[str, set[str]] = {name: set() for name in names}
    ends = [c.ends for c in flat.conductors if all(e in card_of for e in c.ends)]
    for a, b in ends:
        near[card_of[a]].add(card_of[b])
        near[card_of[b]].add(card_of[a])
    hubs = frozenset(node for node in card_of if len({card_of[b] for e in ends if node in e for b in e} - {card_of[node]}) > HUB)
    weight = np.zeros((len(names), len(names)))
    for a, b in ends:
        i, j = names.index(card_of[a]), names.index(card_of[b])
        if i != j:
            weight[i, j] += 0.2 if {a, b} & hubs else 1.0
            weight[j, i] = weight[i, j]
    tallest = max((len(g) for g in groups.values()), default=1)
    columns, rows, places = grid(weight, HEAD + LINE * tallest + FOOT + 14.0, PAGE[1] - 50.0)
    wide, high = PAGE[0] / columns, (PAGE[1] - 50.0) / rows
    out = []
    for name, (column, row) in zip(names, places, strict=True):
        nodes = tuple(groups[name])
        height = (HEAD if len(nodes) > 1 else 4.0) + LINE * len(nodes) + FOOT
        width = min(wide - 26.0, 190.0)
        x, y = column * wide + 0.5 * (wide - width), row * high + 0.5 * (high - height)
        out.append(Card(name, nodes, x, y, width, height))
    return tuple(out), hubs


def grid(weight: Array, need: float, room: float) -> tuple[int, int, list[tuple[int, int]]]:
    """Return columns and rows of a grid that holds all cards, and the column and row of each, neighbours near one another.

    Parameters
    ----------
    weight : array (cards, cards)   How strongly each two belong together; symmetric.
    need, room : float              Height of the tallest card with its gap, and of the page. [px]
    """
    count = len(weight)
    rows = max(1, min(round(math.sqrt(count * 0.62)), int(room // need)))
    columns = -(-max(count, 1) // rows)
    spots = [(c, r) for r in range(rows) for c in range(columns)]
    if count < 3:
        return columns, rows, spots[:count]
    laplacian = np.diag(weight.sum(axis=1) + 1e-3) - weight + 1e-3 / count
    _, vectors = np.linalg.eigh(laplacian)
    flat = vectors[:, 1:3] * np.sign(vectors[np.argmax(np.abs(vectors[:, 1:3]), axis=0), (1, 2)])
    across = np.argsort(flat[:, 0], kind="stable")
    order: list[int] = []
    for k in range(columns):  # columns from left to right by the one vector, within each by the other
        share = across[k * rows : (k + 1) * rows]
        order += share[np.argsort(flat[share, 1], kind="stable")].tolist()
    at = np.full(len(spots), -1)
    for place, card in enumerate(order):
        column, row = divmod(place, rows)
        at[row * columns + column] = card
    return columns, rows, _exchanged(weight, at, np.array(spots, dtype=float), spots)


def _exchanged(weight: Array, at: Array, where: Array, spots: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
    """Return the place of each card after exchanges of two places, as long as they shorten the lines."""
    place = np.zeros(len(weight), dtype=int)
    place[at[at >= 0]] = np.flatnonzero(at >= 0)
    metre = np.linalg.norm((where[:, None] - where[None]) * (1.0, 0.8), axis=2)
    for _ in range(30):
        better = False
        for a in range(len(spots)):
            for b in range(a):
                i, j = int(at[a]), int(at[b])
                change = 0.0
                for card, here, there in ((i, a, b), (j, b, a)):
                    if card >= 0:
                        pull = weight[card].copy()
                        pull[[k for k in (i, j) if k >= 0]] = 0.0
                        change += float(pull @ (metre[there, place] - metre[here, place]))
                if change < -1e-9:
                    at[a], at[b], better = j, i, True
                    for card, there in ((i, b), (j, a)):
                        if card >= 0:
                            place[card] = there
        if not better:
            break
    return [spots[k] for k in place.tolist()]


def _wires(flat: Flat, of: Mapping[str, Card], hubs: frozenset[str], within: bool) -> Iterator[str]:
    """Yield one line for every two nodes that are joined, between cards or within one, with the conductors in its tip."""
    cards = tuple(dict.fromkeys(of.values()))
    joined: dict[tuple[str, str], list[FlatConductor]] = {}
    for c in flat.conductors:
        a, b = sorted(c.ends)
        if a in of and b in of and a != b and not {a, b} & hubs:
            joined.setdefault((a, b), []).append(c)
    for (a, b), conductors in joined.items():
        (x1, y1), (x2, y2) = of[a].row(a), of[b].row(b)
        if (of[a] is of[b]) is not within:
            continue
        if within:  # along the right edge of the card
            x1 = x2 = of[a].x + of[a].width - 5.0
        style = STYLES.get(conductors[0].kind, ("solid", ""))[0]
        dash = f' stroke-dasharray="{DASHES[style]}"' if DASHES.get(style) else ""
        tip = "; ".join(f"{c.path} ({c.kind})" for c in conductors)
        bent = "" if within else _bent((x1, y1), (x2, y2), [card for card in cards if card not in (of[a], of[b])])
        yield f'<path class="wire" d="M{x1:.1f} {y1:.1f}{bent or "L"}{x2:.1f} {y2:.1f}"{dash}><title>{escape(tip)}</title></path>'


def _bent(a: tuple[float, float], b: tuple[float, float], others: Sequence[Card]) -> str:
    """Return how a line goes from a to b past the cards between: straight (empty), or by the least bend that meets the fewest."""
    start, end = np.array(a), np.array(b)
    middle, way = 0.5 * (start + end), end - start
    across = np.array([-way[1], way[0]]) / float(np.hypot(*way))
    along = np.linspace(0.0, 1.0, 41)[1:-1, None]
    low = np.array([(c.x, c.y) for c in others]).reshape(-1, 1, 2)
    high = low + np.array([(c.width, c.height) for c in others]).reshape(-1, 1, 2)
    best, met = "", math.inf
    for bend in BENDS:
        control = middle + 2.0 * bend * across
        points = (1 - along) ** 2 * start + 2 * along * (1 - along) * control + along**2 * end
        hits = int(((points > low) & (points < high)).all(axis=2).any(axis=1).sum())
        if hits < met:
            best, met = (f"Q{control[0]:.1f} {control[1]:.1f} " if bend else ""), hits
    return best


def _card(flat: Flat, card: Card, of: Mapping[str, Card], hubs: frozenset[str]) -> Iterator[str]:
    """Yield a card: its name, its nodes with their loads, its badges."""
    hub = " hub" if hubs & set(card.nodes) else ""
    yield f'<rect class="card{hub}" x="{card.x:.1f}" y="{card.y:.1f}" width="{card.width:.1f}" height="{card.height:.1f}" rx="6"/>'
    if len(card.nodes) > 1:
        yield _text(card.x + 8.0, card.y + 13.0, clipped(card.name, card.width - 14.0, 11.0), 11.0, "name")
    values = flat.parameters.evaluate({})
    for node in card.nodes:
        _, y = card.row(node)
        if len(card.nodes) > 1:
            yield f'<rect class="node" x="{card.x + 6:.1f}" y="{y - 8:.1f}" width="{card.width - 18:.1f}" height="16" rx="3"/>'
        watts = sum(float(values[x.fields["power"]]) for x in flat.loads if x.node == node and "power" in x.fields)
        said = f"  {quantity(watts, 'W')}" if watts else ""
        name = node.removeprefix(f"{card.name}.") if len(card.nodes) > 1 else node
        yield _text(card.x + 10.0, y + 4.0, clipped(name + said, card.width - 24.0, 11.0), 11.0, tip=node)
    far = {e for c in flat.conductors for e in c.ends if set(card.nodes) & set(c.ends)} - set(card.nodes)
    badges = sorted(e for e in far if e not in of or e in hubs)
    words = ("to " + ", ".join(badges)) if badges else "named on what it joins" if hub else ""
    if words:
        yield _text(card.x + 8.0, card.y + card.height - 5.0, clipped(words, card.width - 12.0, SMALLEST), SMALLEST, "soft", tip=words)


def _text(x: float, y: float, words: str, size: float, kind: str = "", tip: str = "") -> str:
    hint = f"<title>{escape(tip)}</title>" if tip else ""
    return f'<text x="{x:.1f}" y="{y:.1f}" font-size="{size:g}" class="{kind}">{escape(words)}{hint}</text>'


def _legend(model: Model, flat: Flat, hubs: frozenset[str]) -> Iterator[str]:
    """Yield title, counts and the styles of the lines that are drawn."""
    given = ", ".join(flat.names.boundaries) or "none"
    many = f"; connected to many nodes and named on their cards: {', '.join(sorted(hubs))}" if hubs else ""
    said = f"{model.title}: {len(flat.nodes)} nodes, {len(flat.conductors)} heat paths; given temperatures: {given}{many}"
    yield _text(14.0, PAGE[1] - 28.0, clipped(said, PAGE[0] - 30.0, 13.0), 13.0, "name")
    x = 14.0
    for style, word in dict.fromkeys(STYLES.get(c.kind, ("solid", c.kind)) for c in flat.conductors):
        dash = f' stroke-dasharray="{DASHES[style]}"' if DASHES.get(style) else ""
        yield f'<path class="wire" d="M{x:.1f} {PAGE[1] - 12:.1f}h26"{dash}/>'
        yield _text(x + 32.0, PAGE[1] - 8.0, word, 11.0, "soft")
        x += 52.0 + 6.2 * len(word)
