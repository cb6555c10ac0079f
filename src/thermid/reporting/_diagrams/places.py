"""Where everything of a map stands: cards on a grid, nodes with one neighbour docked in its card, lines that pass under no card.

The studio, the reports and `thermid diagram` all draw these places.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Final

import numpy as np

from thermid.base.linear_algebra import Array

Point = tuple[float, float]
PLACE_STEP: Final = 8.0
"""MapPlaces and sizes are multiples of this. [px]"""
DOCKED_FROM: Final = 12
"""Up to so many nodes each is a card."""
DEEP: Final = 2
"""How deep nodes are docked in a card."""
CARD_ROWS: Final = 16
"""Nodes of a card."""
HUB: Final = 12
"""A node joined to more cards than this is named on them in place of lines."""
ROW_HEIGHT: Final = 20.0
"""Height of a node in its card. [px]"""
GUTTER: Final = (56.0, 48.0)
"""Free width and height between cards, through which lines may run. [px]"""
ASPECT: Final = 1.6
"""Width over height that is aimed at."""
WIDEST: Final = (0.6, 2.0)
"""Width over height that a page has at least and at most."""
NARROWEST: Final = 480.0
"""Width of a page, at least: title and legend stand on it. [px]"""
BENDS: Final = (0.0, 45.0, -45.0, 80.0, -80.0)
"""How far a line may leave the straight way to pass a card. [px]"""
LINE_CLEARANCE: Final = 4.0
"""Distance of a line from a card that it passes. [px]"""
TINY: Final = 1e-9
"""A length that counts as none. [px]"""
LANES: Final = (0.0, 6.0, -6.0, 12.0, -12.0, 18.0, -18.0)
"""Where lines that share a gutter run, from its middle. [px]"""
EXCHANGES: Final = 600
"""Exchanges of two cards, at most."""


@dataclass(frozen=True)
class Card:
    """A node with those docked in it, at a place of the page.

    Parameters
    ----------
    rows : tuple of (str, int)      Nodes, each with how deep it is docked; the first one is the card's own.
    x, y, width, height : float     Left upper corner and size. [px]
    """

    rows: tuple[tuple[str, int], ...]
    x: float = 0.0
    y: float = 0.0
    width: float = 0.0
    height: float = 0.0

    @property
    def nodes(self) -> tuple[str, ...]:
        """Its nodes from top to bottom."""
        return tuple(node for node, _ in self.rows)

    @property
    def middle(self) -> Point:
        """Its middle. [px]"""
        return self.x + 0.5 * self.width, self.y + 0.5 * self.height

    def row(self, node: str) -> float:
        """Return the middle height of a node's row. [px]"""
        return self.y + 6.0 + ROW_HEIGHT * (self.nodes.index(node) + 0.5)

    def edge(self, towards: Point) -> Point:
        """Return where a line from the middle to a point leaves it. [px]"""
        x, y = self.middle
        dx, dy = towards[0] - x, towards[1] - y
        share = min(0.5 * self.width / max(abs(dx), 1e-9), 0.5 * self.height / max(abs(dy), 1e-9), 1.0)
        return x + share * dx, y + share * dy


@dataclass(frozen=True, eq=False)
class MapPlaces:
    """A page.

    Parameters
    ----------
    cards : tuple of Card
    hubs : frozenset        Nodes that are named on what they join.
    docks : dict            Docked node -> the node that it is docked in.
    lines : dict            Pair of nodes -> points of the line between their cards. [px]
    width, height : float   [px]
    """

    cards: tuple[Card, ...]
    hubs: frozenset[str]
    docks: Mapping[str, str]
    lines: Mapping[tuple[str, str], tuple[Point, ...]]
    width: float
    height: float


def places(nodes: Sequence[str], pairs: Sequence[tuple[str, str]], widths: Mapping[str, float], foot: float) -> MapPlaces:
    """Return the places of a network; the same network has the same places.

    Parameters
    ----------
    nodes : sequence    In the order of the model.
    pairs : sequence    Nodes that are joined, each pair once.
    widths : dict       Node -> width that its row needs. [px]
    foot : float        Height of what stands below the cards. [px]
    """
    docks, hubs = docked(nodes, pairs)
    rows = _rows(nodes, docks)
    names = list(rows)
    index = {node: k for k, name in enumerate(names) for node, _ in rows[name]}
    weight = np.zeros((len(names), len(names)))
    between: list[tuple[str, str]] = []
    for a, b in pairs:
        i, j = index[a], index[b]
        if i != j:
            weight[i, j] = weight[j, i] = weight[i, j] + (0.2 if {a, b} & hubs else 1.0)
            between += [] if {a, b} & hubs else [(a, b)]
    needs = [(max(widths[n] + 14.0 * d for n, d in rows[name]) + 16.0, ROW_HEIGHT * len(rows[name]) + 12.0) for name in names]
    sizes = [(2.0 * _up(0.5 * w), 2.0 * _up(0.5 * h)) for w, h in needs]  # so that the middles of a column lie below one another
    cards, spots, lanes, size = _placed_cards([rows[n] for n in names], weight, sizes, foot)
    router = _Router(cards, spots, lanes)
    lines = {(a, b): router.line(index[a], index[b]) for a, b in between}
    return MapPlaces(tuple(cards), hubs, docks, lines, *size)


def card_places(nodes: Sequence[str], pairs: Sequence[tuple[str, str]], size: tuple[float, float]) -> dict[str, Point]:
    """Return the middle of each node's card where each has one, none docked: what an editor begins with. [px]

    Parameters
    ----------
    nodes, pairs : sequence     As in `places`.
    size : (width, height)      Of a card. [px]
    """
    if not nodes:
        return {}
    index = {node: k for k, node in enumerate(nodes)}
    weight = np.zeros((len(nodes), len(nodes)))
    for a, b in pairs:
        weight[index[a], index[b]] = weight[index[b], index[a]] = 1.0
    cards, *_ = _placed_cards([((n, 0),) for n in nodes], weight, [size] * len(nodes), 0.0)
    return {card.nodes[0]: card.middle for card in cards}


def _up(length: float) -> float:
    return PLACE_STEP * math.ceil(length / PLACE_STEP - 1e-9)


def docked(nodes: Sequence[str], pairs: Sequence[tuple[str, str]]) -> tuple[dict[str, str], frozenset[str]]:
    """Return docked node -> the node that it is docked in, and the nodes that are hubs.

    A node docks in its only neighbour, hubs not counted, and takes with it what is docked in itself. The node that is joined to most cards
    is made a hub, as long as it is joined to more than `HUB`.
    """
    near: dict[str, dict[str, None]] = {n: {} for n in nodes}
    for a, b in pairs:
        near[a][b] = near[b][a] = None
    hubs: set[str] = set()
    while True:
        docks = _docks(nodes, near, hubs) if len(nodes) > DOCKED_FROM else {}
        seat = {n: _top(n, docks) for n in nodes}
        joined = {n: {seat[m] for m in near[n]} - {seat[n]} for n in nodes if n not in hubs}
        most = max(joined, key=lambda n: len(joined[n]), default="")
        if not most or len(joined[most]) <= HUB:
            return docks, frozenset(hubs)
        hubs.add(most)


def _docks(nodes: Sequence[str], near: Mapping[str, Mapping[str, None]], hubs: set[str]) -> dict[str, str]:
    docks: dict[str, str] = {}
    height, size = dict.fromkeys(nodes, 0), dict.fromkeys(nodes, 1)
    order = sorted(nodes, key=lambda n: len(near[n]))
    again = True
    while again:
        again = False
        for node in order:
            if node in docks or node in hubs or height[node] >= DEEP:
                continue
            free = [n for n in near[node] if docks.get(n) != node and n not in hubs]
            only = free or list(near[node])
            if len(only) != 1 or only[0] in docks or size[node] + size[only[0]] > CARD_ROWS:
                continue
            docks[node], again = only[0], True
            size[only[0]] += size[node]
            height[only[0]] = max(height[only[0]], height[node] + 1)
    return docks


def _top(node: str, docks: Mapping[str, str]) -> str:
    while node in docks:
        node = docks[node]
    return node


def _rows(nodes: Sequence[str], docks: Mapping[str, str]) -> dict[str, tuple[tuple[str, int], ...]]:
    """Return node of a card -> its rows, what is docked below what it is docked in."""
    inside: dict[str, list[str]] = {n: [] for n in nodes}
    for node in nodes:
        if node in docks:
            inside[docks[node]].append(node)

    def below(node: str, deep: int) -> Iterator[tuple[str, int]]:
        yield node, deep
        for n in inside[node]:
            yield from below(n, deep + 1)

    return {n: tuple(below(n, 0)) for n in nodes if n not in docks}


@dataclass(frozen=True)
class _Lanes:
    """Middles of the gutters before, between and behind the columns and rows. [px]"""

    across: tuple[float, ...]
    down: tuple[float, ...]


def _placed_cards(
    rows: Sequence[tuple[tuple[str, int], ...]], weight: Array, sizes: Sequence[tuple[float, float]], foot: float
) -> tuple[list[Card], list[tuple[int, int]], _Lanes, tuple[float, float]]:
    """Return the cards at their places, their columns and rows, the gutters, and the size of the page."""
    count = len(sizes)
    mean = tuple(sum(s[k] for s in sizes) / max(count, 1) + GUTTER[k] for k in (0, 1))
    best = min(range(1, count + 1), key=lambda r: abs(math.log(-(-count // r) * mean[0] / (r * mean[1] * ASPECT))), default=1)
    columns, lines, spots = grid(weight, best, (mean[0], mean[1]))
    wide = [max((s[0] for s, (c, _) in zip(sizes, spots, strict=True) if c == k), default=0.0) for k in range(columns)]
    high = [max((s[1] for s, (_, r) in zip(sizes, spots, strict=True) if r == k), default=0.0) for k in range(lines)]
    column_starts = [_up(GUTTER[0] + sum(wide[:k]) + GUTTER[0] * k) for k in range(columns + 1)]
    top = [_up(GUTTER[1] + sum(high[:k]) + GUTTER[1] * k) for k in range(lines + 1)]
    size = column_starts[-1], top[-1] + _up(foot)
    width = _up(max(size[0], WIDEST[0] * size[1], NARROWEST))
    page = width, _up(max(size[1], width / WIDEST[1]))
    aside, ahead = (PLACE_STEP * math.floor(0.5 * (p - s) / PLACE_STEP) for p, s in zip(page, size, strict=True))
    cards = []
    for rows_of_card, (w, h), (c, r) in zip(rows, sizes, spots, strict=True):
        x, y = (PLACE_STEP * math.floor(v / PLACE_STEP) for v in (column_starts[c] + 0.5 * (wide[c] - w), top[r] + 0.5 * (high[r] - h)))
        cards.append(Card(rows_of_card, aside + x, ahead + y, w, h))
    lanes = _Lanes(tuple(aside + v - 0.5 * GUTTER[0] for v in column_starts), tuple(ahead + v - 0.5 * GUTTER[1] for v in top))
    return cards, spots, lanes, page


def grid(weight: Array, rows: int, cell: tuple[float, float]) -> tuple[int, int, list[tuple[int, int]]]:
    """Return columns and rows of a grid that holds all cards, and the column and row of each, neighbours near one another.

    First by the second and third eigenvector of the graph's Laplacian, then by exchanges that shorten the lines.

    Parameters
    ----------
    weight : array (cards, cards)   How strongly each two belong together; symmetric.
    rows : int                      Of the grid.
    cell : (width, height)          Distance of neighbouring places. [px]

    References
    ----------
    Hall, An r-dimensional quadratic placement algorithm, Management Science 17 (1970) 219.
    """
    count = len(weight)
    columns = -(-max(count, 1) // rows)
    spots = [(c, r) for r in range(rows) for c in range(columns)]
    if count < 3:
        return columns, rows, spots[:count]
    laplacian = np.diag(weight.sum(axis=1) + 1e-3) - weight + 1e-3 / count
    _, vectors = np.linalg.eigh(laplacian)
    flat = vectors[:, 1:3] * np.sign(vectors[np.argmax(np.abs(vectors[:, 1:3]), axis=0), (1, 2)])
    flat = np.round(flat, 9)  # rounding errors of the library decide nothing
    across = np.argsort(flat[:, 0], kind="stable")
    place = np.full(len(spots), -1)
    for k in range(columns):  # columns from left to right by the one vector, within each by the other
        share = across[k * rows : (k + 1) * rows]
        for row, card in enumerate(share[np.argsort(flat[share, 1], kind="stable")]):
            place[card] = row * columns + k
    free = [k for k in range(len(spots)) if k not in set(place[:count].tolist())]
    place[count:] = free
    return columns, rows, [spots[k] for k in _exchanged(weight, place, np.array(spots, dtype=float) * cell)[:count].tolist()]


def _exchanged(weight: Array, place: Array, where: Array) -> Array:
    """Return the place of each card, and of what stands for an empty place, after exchanges that shorten the lines.

    Parameters
    ----------
    weight : array (cards, cards)
    place : array (places,)         Of each card, and of each empty place.
    where : array (places, 2)       [px]
    """
    size = len(place)
    pull = np.zeros((size, size))
    pull[: len(weight), : len(weight)] = weight
    metre = np.linalg.norm(where[:, None] - where[None], axis=2)
    cost = pull @ metre[place]  # of each card at each place
    order = np.arange(size)
    for _ in range(EXCHANGES):
        here = cost[order, place]
        gain = cost[:, place] - here[:, None]
        gain = gain + gain.T + 2.0 * pull * metre[np.ix_(place, place)]
        a, b = divmod(int(np.argmin(np.round(gain, 6))), size)
        if gain[a, b] > -1e-6:
            break
        shift = metre[place[b]] - metre[place[a]]
        cost += np.outer(pull[:, a] - pull[:, b], shift)
        place[[a, b]] = place[[b, a]]
    return place


@dataclass(eq=False)
class _Router:
    """Lines between cards: straight, bent once, or through the gutters, where no card lies."""

    cards: Sequence[Card]
    spots: Sequence[tuple[int, int]]
    lanes: _Lanes
    used: dict[tuple[str, int], int] = field(default_factory=dict)

    def line(self, a: int, b: int) -> tuple[Point, ...]:
        """Return the points of a line between two cards. [px]"""
        one, two = self.cards[a], self.cards[b]
        (left, *_, right), (top, *_, bottom) = self.lanes.across, self.lanes.down  # the outer gutters
        for bend in BENDS:
            points = _bent(one, two, bend)
            if all(left <= x <= right and top <= y <= bottom for x, y in points) and not self._meets(np.array(points), (a, b)):
                return points
        return self._through(a, b)

    def _meets(self, points: Array, ends: tuple[int, int]) -> bool:
        """Whether a line passes over or near a card that is not one of its ends, or over one of these behind its edge."""
        corners = np.array([(c.x, c.y, c.x + c.width, c.y + c.height) for c in self.cards])
        margin = np.full((len(self.cards), 1), LINE_CLEARANCE)
        margin[list(ends)] = -0.5
        low, high = corners[:, :2] - margin, corners[:, 2:] + margin
        for start, end in pairwise(points):
            # the stretch of the line between two edges, in shares of its length, of both axes together
            way = np.where(np.abs(end - start) < TINY, TINY, end - start)
            shares = np.stack([(low - start) / way, (high - start) / way])
            first, last = shares.min(axis=0).max(axis=1), shares.max(axis=0).min(axis=1)
            if ((first < last) & (last > 0.0) & (first < 1.0)).any():
                return True
        return False

    def _through(self, a: int, b: int) -> tuple[Point, ...]:
        """Return a line through the gutters: out at the top or the bottom, along, where needed down beside the columns, and in."""
        (c1, r1), (c2, r2) = self.spots[a], self.spots[b]
        out = r1 + 1 if r2 > r1 else r1
        into = r2 if r2 > r1 else r2 + 1 if r2 < r1 else r1
        x1, x2 = self._port(a, out > r1), self._port(b, into > r2)
        start = (x1, self.cards[a].y + (self.cards[a].height if out > r1 else 0.0))
        end = (x2, self.cards[b].y + (self.cards[b].height if into > r2 else 0.0))
        y1 = self._lane("down", out)
        if out == into:
            return (start, (x1, y1), (x2, y1), end)
        x, y2 = self._lane("across", c2 if c2 > c1 else c2 + 1), self._lane("down", into)
        return (start, (x1, y1), (x, y1), (x, y2), (x2, y2), end)

    def _port(self, card: int, below: bool) -> float:
        """Return where a line enters or leaves a card at its top or bottom. [px]"""
        k = self.used[f"port {below}", card] = self.used.get((f"port {below}", card), -1) + 1
        room = 0.5 * self.cards[card].width - 10.0
        aside = min(room, 12.0 + 9.0 * (k // 2))  # the middle is for straight lines
        return self.cards[card].middle[0] + (-aside if k % 2 else aside)

    def _lane(self, kind: str, number: int) -> float:
        k = self.used[kind, number] = self.used.get((kind, number), -1) + 1
        return (self.lanes.across if kind == "across" else self.lanes.down)[number] + LANES[k % len(LANES)]


def _bent(one: Card, two: Card, bend: float) -> tuple[Point, ...]:
    """Return a line between two cards that leaves the straight way by so much in its middle. [px]"""
    a, b = np.array(one.middle), np.array(two.middle)
    way = b - a
    across = np.array([-way[1], way[0]]) / float(np.hypot(*way))
    middle = 0.5 * (a + b) + bend * across
    if not bend:
        return (one.edge(two.middle), two.edge(one.middle))
    point = (float(middle[0]), float(middle[1]))
    return (one.edge(point), point, two.edge(point))
