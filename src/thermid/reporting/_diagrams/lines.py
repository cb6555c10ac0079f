"""Lines between the cards of a map: the shortest ways past all other cards, of these the ones that cross fewest lines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from thermid.base.linear_algebra import Array, Bools

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
        made = (self.choice(way, times) for way in ways for times in range(TIMES_AT_CORNER if len(way) > 2 else 1))
        return [choice for choice in made if choice is not None]

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
        known: list[int] = []
        while True:
            places = [(a, -1), (b, -1), *((c, k) for c in known for k in range(4) if (c, k) not in without)]
            points = np.array([self.point(*place) for place in places])
            i, j = np.triu_indices(len(places), 1)
            over = passes(self.low[known] - CLEARANCE, self.high[known] + CLEARANCE, points[i], points[j])
            for at, card in enumerate(known):
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
            new = [int(c) for c in np.flatnonzero(self.over(points[path], a, b).any(axis=0)) if c not in known]
            if not new:
                return tuple(places[k] for k in path)
            known += new
