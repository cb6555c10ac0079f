"""Where everything of a map stands: cards on a grid, nodes with one neighbour docked in its card, lines that pass under no card.

The studio, the reports and `thermid diagram` all draw these places.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from thermid.base.units import Array, Bools

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
EXCHANGES: Final = 600
"""Exchanges of two cards, at most."""
STARTS: Final = tuple((rows, vectors) for rows in (0, -1, 1) for vectors in ((1, 2), (2, 1)))
"""Rows more or less than the aspect asks for, and eigenvectors across and down, that are tried; the picture with fewest tangles stays."""
Way = tuple[tuple[int, int], ...]
"""Card and corner of each bend, from the one end to the other; an end is a card with the corner -1, its middle."""
CLEARANCE: Final = 4.0
"""Distance of a line from a card that it passes. [px]"""
AT_CORNER: Final = 6.0
"""How far outside a corner the first line bends; each further one bends `CLEARANCE` further out. [px]"""
TIMES_AT_CORNER: Final = 4
"""How many lines bend at a corner without lying on one another."""
COST: Final = {"crossing": 60.0, "bend": 8.0}
"""Length that a line may be longer by to save a crossing, or a bend. [px]"""
TINY: Final = 1e-9
"""A length that counts as none. [px]"""


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

    Pairs of a hub weigh a fifth, and have no lines. A card is as wide as its widest row, 14 px more for each depth, and has margins of 16
    px across and 12 px down. [px]

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
    ends = [(index[a], index[b]) for a, b in between]
    cards, size = _placed_cards([rows[n] for n in names], weight, sizes, ends, foot)
    points = [tuple((float(x), float(y)) for x, y in line) for line in lines(*_corners(cards), ends)]
    return MapPlaces(tuple(cards), hubs, docks, dict(zip(between, points, strict=True)), *size)


def _corners(cards: Sequence[Card]) -> tuple[Array, Array]:
    """Return left upper and right lower corners. (cards, 2) [px]"""
    boxes = np.array([(c.x, c.y, c.x + c.width, c.y + c.height) for c in cards]).reshape(-1, 4)
    return boxes[:, :2], boxes[:, 2:]


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
    ends = [(index[a], index[b]) for a, b in pairs]
    for i, j in ends:
        weight[i, j] = weight[j, i] = 1.0
    cards, _ = _placed_cards([((n, 0),) for n in nodes], weight, [size] * len(nodes), ends, 0.0)
    return {card.nodes[0]: card.middle for card in cards}


def _up(length: float) -> float:
    """Return a length rounded up to the grid of places. [px]"""
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
    """Return node -> the only neighbour that it hangs on, so that both share a card."""
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
    """Return the node that a node is docked in at last; itself where it is in none."""
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
        """Yield a node and all that hang on it, each with its depth."""
        yield node, deep
        for n in inside[node]:
            yield from below(n, deep + 1)

    return {n: tuple(below(n, 0)) for n in nodes if n not in docks}


def _placed_cards(
    rows: Sequence[tuple[tuple[str, int], ...]],
    weight: Array,
    sizes: Sequence[tuple[float, float]],
    ends: Sequence[tuple[int, int]],
    foot: float,
) -> tuple[list[Card], tuple[float, float]]:
    """Return the cards at their places, of several tries those whose lines are least tangled, and width and height of the page. [px]

    Eigenvectors of the graph's Laplacian (Hall, Management Science 17 (1970) 219) order the cards across and down a grid, whose aspect is
    nearest to `ASPECT` by its logarithm. A weight of 1/1000 between all holds parts together that nothing joins.

    Parameters
    ----------
    rows : sequence         Of each card, (node, depth) from top to bottom.
    weight : array (cards, cards)   How strongly two cards are drawn together. [-]
    sizes : sequence        Width and height of each card. [px]
    ends : sequence         Cards that a line joins.
    foot : float            Height of what stands below. [px]
    """
    count = len(sizes)
    mean = (sum(w for w, _ in sizes) / max(count, 1) + GUTTER[0], sum(h for _, h in sizes) / max(count, 1) + GUTTER[1])
    best = min(range(1, count + 1), key=lambda r: abs(math.log(-(-count // r) * mean[0] / (r * mean[1] * ASPECT))), default=1)
    tries = [(best + more, vectors) for more, vectors in STARTS if 1 <= best + more <= count and count > max(vectors)]
    laplacian = np.diag(weight.sum(axis=1) + 1e-3) - weight + 1e-3 / max(count, 1)
    vectors_ = np.linalg.eigh(laplacian)[1]  # in columns, the constant one first
    largest = vectors_[np.argmax(np.abs(vectors_), axis=0), np.arange(count)]
    flat = np.round(vectors_ * np.sign(largest), 9)  # rounding errors of the library decide nothing
    pages = [_on_page(rows, sizes, grid(weight, lines_, mean, flat[:, vectors]), foot) for lines_, vectors in tries or [(best, (0, 0))]]
    pairs = np.array(ends, dtype=int).reshape(-1, 2)
    return min(pages, key=lambda m: tangles(*_corners(m[0]), pairs))


def _on_page(
    rows: Sequence[tuple[tuple[str, int], ...]],
    sizes: Sequence[tuple[float, float]],
    places_: tuple[int, int, Sequence[tuple[int, int]]],
    foot: float,
) -> tuple[list[Card], tuple[float, float]]:
    """Return cards on a grid, as wide and high as what stands in it, and the size of the page."""
    columns, lines_, spots = places_
    wide = [max((s[0] for s, (c, _) in zip(sizes, spots, strict=True) if c == k), default=0.0) for k in range(columns)]
    high = [max((s[1] for s, (_, r) in zip(sizes, spots, strict=True) if r == k), default=0.0) for k in range(lines_)]
    left = [_up(GUTTER[0] + sum(wide[:k]) + GUTTER[0] * k) for k in range(columns + 1)]
    top = [_up(GUTTER[1] + sum(high[:k]) + GUTTER[1] * k) for k in range(lines_ + 1)]
    size = left[-1], top[-1] + _up(foot)
    width = _up(max(size[0], WIDEST[0] * size[1], NARROWEST))
    page = width, _up(max(size[1], width / WIDEST[1]))
    aside, ahead = (PLACE_STEP * math.floor(0.5 * (p - s) / PLACE_STEP) for p, s in zip(page, size, strict=True))
    cards = []
    for rows_of_card, (w, h), (c, r) in zip(rows, sizes, spots, strict=True):
        x, y = (PLACE_STEP * math.floor(v / PLACE_STEP) for v in (left[c] + 0.5 * (wide[c] - w), top[r] + 0.5 * (high[r] - h)))
        cards.append(Card(rows_of_card, aside + x, ahead + y, w, h))
    return cards, page


def grid(weight: Array, rows: int, cell: tuple[float, float], order: Array) -> tuple[int, int, list[tuple[int, int]]]:
    """Return columns and rows of a grid that holds all cards, and the column and row of each, neighbours near one another.

    First by eigenvectors of the graph's Laplacian, which the caller gives, then by exchanges that shorten the lines.

    Parameters
    ----------
    weight : array (cards, cards)   How strongly each two belong together; symmetric.
    rows : int                      Of the grid.
    cell : (width, height)          Distance of neighbouring places. [px]
    order : array (cards, 2)        What orders the cards across and down.

    References
    ----------
    Hall, An r-dimensional quadratic placement algorithm, Management Science 17 (1970) 219.
    """
    count = len(weight)
    columns = -(-max(count, 1) // rows)
    spots = [(c, r) for r in range(rows) for c in range(columns)]
    if count < 3:
        return columns, rows, spots[:count]
    across = np.argsort(order[:, 0], kind="stable")
    place = np.full(len(spots), -1)
    for k in range(columns):  # columns from left to right by the one vector, within each by the other
        share = across[k * rows : (k + 1) * rows]
        for row, card in enumerate(share[np.argsort(order[share, 1], kind="stable")]):
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


def passes(low: Array, high: Array, start: Array, end: Array) -> Bools:
    """Return whether each line passes over each box.

    Parameters
    ----------
    low, high : array (boxes, 2)    Corners. [px]
    start, end : array (lines, 2)   [px]
    """
    way = end - start
    way = np.where(np.abs(way) < TINY, TINY, way)[:, None]
    one, two = (low[None] - start[:, None]) / way, (high[None] - start[:, None]) / way
    first, last = np.minimum(one, two).max(axis=2), np.maximum(one, two).min(axis=2)
    over: Bools = (first < last) & (last > 0.0) & (first < 1.0)
    return over


def crossed(one: Array, two: Array) -> Bools:
    """Return whether each straight piece (x, y, x, y) of the one crosses each of the other; a common end is no crossing."""

    def sides(a: Array, b: Array) -> Bools:
        """Whether the ends of each segment of `a` lie on either side of each segment of `b` (a, b)."""
        way = a[:, None, 2:] - a[:, None, :2]
        turns = [way[..., 0] * (b[None, :, k + 1] - a[:, None, 1]) - way[..., 1] * (b[None, :, k] - a[:, None, 0]) for k in (0, 2)]
        return turns[0] * turns[1] < 0.0

    return sides(one, two) & sides(two, one).T


def tangles(low: Array, high: Array, ends: Array) -> int:
    """Return how often straight lines between the middles of cards cross one another or pass over a card.

    Parameters
    ----------
    low, high : array (cards, 2)    Corners. [px]
    ends : array (lines, 2)         Numbers of the cards that each joins.
    """
    if not len(ends):
        return 0
    start, end = (0.5 * (low + high)[ends[:, k]] for k in (0, 1))
    over = passes(low, high, start, end)
    over[np.arange(len(ends))[:, None], ends] = False
    pieces = np.hstack([start, end])
    return int(crossed(pieces, pieces).sum() // 2 + over.sum())


def lines(low: Array, high: Array, ends: Sequence[tuple[int, int]]) -> list[Array]:
    """Return the points of each line. (points, 2) [px]

    Parameters
    ----------
    low, high : array (cards, 2)    Corners. [px]
    ends : sequence                 Numbers of the cards that each line joins.
    """
    router = _Router(low, high)
    choices = [router.choices(a, b) for a, b in ends]
    order = sorted(range(len(ends)), key=lambda k: (len(choices[k][0].points), choices[k][0].cost))
    taken = {k: choices[k][0] for k in order if len(choices[k]) == 1}
    for _ in range(2):  # the first lines know of few others yet
        for k in order:
            if len(choices[k]) > 1:
                taken[k] = min(choices[k], key=_Price([c for n, c in taken.items() if n != k]))
    return [taken[k].points for k in range(len(ends))]


@dataclass(frozen=True, eq=False)
class _Choice:
    """One way that a line may take: its points and straight pieces [px], where it bends, and its length with its bends. [px]"""

    points: Array
    pieces: Array
    bends: frozenset[tuple[int, int, int]]
    cost: float


class _Price:
    """What a line costs beside others: its length, bends, crossings and bends that another has too. [px]"""

    def __init__(self, others: Sequence[_Choice]) -> None:
        self.pieces = np.concatenate([c.pieces for c in others]) if others else np.zeros((0, 4))
        self.bends = [b for c in others for b in c.bends]

    def __call__(self, choice: _Choice) -> float:
        """Return the cost of a way among the others: its own, and what it crosses or bends with."""
        shared = sum(b in choice.bends for b in self.bends)
        return choice.cost + COST["crossing"] * (int(crossed(choice.pieces, self.pieces).sum()) + shared)


@dataclass(eq=False)
class _Router:
    """Ways between cards."""

    low: Array
    high: Array
    ways: dict[tuple[int, int, frozenset[tuple[int, int]]], Way] = field(default_factory=dict)

    def choices(self, a: int, b: int) -> list[_Choice]:
        """Return the shortest way between two cards and those that avoid one of its bends, further from and nearer to the corners."""
        shortest = self.way(a, b, frozenset())
        ways = dict.fromkeys([shortest, *(self.way(a, b, frozenset([bend])) for bend in shortest[1:-1])])
        tried = (self.choice(way, times) for way in ways for times in range(TIMES_AT_CORNER if len(way) > 2 else 1))
        return [choice for choice in tried if choice is not None]

    def choice(self, way: Way, times: int) -> _Choice | None:
        """Return a way that bends so many lines outside the corners, or nothing where it would pass over a card."""
        points = np.array([self.point(card, corner, times) for card, corner in way])
        (a, _), (b, _) = way[0], way[-1]
        if times and self.over(points, a, b).any():
            return None
        points[[0, -1]] = self.edge(a, points[1]), self.edge(b, points[-2])
        length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
        pieces = np.hstack([points[:-1], points[1:]])
        return _Choice(points, pieces, frozenset((*bend, times) for bend in way[1:-1]), length + COST["bend"] * len(points))

    def point(self, card: int, corner: int, times: int = 0) -> Array:
        """Return a place outside a corner, or the middle of a card. [px]"""
        low, high = self.low[card], self.high[card]
        if corner < 0:
            return np.array(0.5 * (low + high))
        aside = AT_CORNER + CLEARANCE * times
        right, below = corner in (1, 2), corner in (2, 3)
        return np.array(np.where([right, below], high + aside, low - aside))

    def edge(self, card: int, towards: Array) -> Array:
        """Return where a line from the middle of a card to a point leaves it. [px]"""
        middle, half = self.point(card, -1), 0.5 * (self.high[card] - self.low[card])
        way = towards - middle
        return np.array(middle + way * min(1.0, float((half / np.maximum(np.abs(way), TINY)).min())))

    def over(self, points: Array, a: int, b: int) -> Bools:
        """Return which cards each piece of a line between two cards passes over or near. (pieces, cards)"""
        over = passes(self.low - CLEARANCE, self.high + CLEARANCE, points[:-1], points[1:])
        over[0, a] = over[-1, b] = False
        return over

    def way(self, a: int, b: int, without: frozenset[tuple[int, int]]) -> Way:
        """Return the shortest way between two cards that bends at corners of cards only, some of these left out.

        Only cards that the way so far passes over are looked at, until it passes over none.
        """
        from scipy.sparse import csr_array
        from scipy.sparse.csgraph import dijkstra

        obstacles: list[int] = []
        while True:
            places = [(a, -1), (b, -1), *((c, k) for c in obstacles for k in range(4) if (c, k) not in without)]
            points = np.array([self.point(*place) for place in places])
            i, j = np.triu_indices(len(places), 1)
            over = passes(self.low[obstacles] - CLEARANCE, self.high[obstacles] + CLEARANCE, points[i], points[j])
            for at, card in enumerate(obstacles):
                over[:, at] &= ~((card == a) & (i == 0) | (card == b) & ((i == 1) | (j == 1)))
            free = ~over.any(axis=1)
            length = np.linalg.norm(points[i[free]] - points[j[free]], axis=1) + COST["bend"]
            joined = csr_array((length, (i[free], j[free])), shape=(len(places), len(places)))
            before = dijkstra(joined, directed=False, indices=[0], return_predecessors=True)[1][0]
            if before[1] < 0:  # the bend that is left out was the only one
                return self.way(a, b, frozenset())
            path = [1]
            while path[-1]:
                path.append(int(before[path[-1]]))
            path.reverse()
            passed_over = [int(c) for c in np.flatnonzero(self.over(points[path], a, b).any(axis=0)) if c not in obstacles]
            if not passed_over:
                return tuple(places[k] for k in path)
            obstacles += passed_over
