"""Extremes of a course of temperature: turning points between stored samples, the highest and the lowest, and when."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from thermid.base.units import ICE_POINT, Array

PIECES = 16
"""Into how many an interval is divided in which a course passes a level."""
MAX_DIVISIONS = 4
"""How often."""
MIN_INTERVAL_SHARE = 1e-9
"""Interval that is not divided, relative to its time and a second. [-]"""
MAX_INTERVALS_AT_ONCE = 20_000
"""Intervals that are looked at again at once."""


@dataclass(frozen=True)
class Extreme:
    """The highest or the lowest temperature of a course.

    Parameters
    ----------
    kelvin : float      [K]
    time : float        When it is reached first. [s]
    tracked : bool      Whether the integrator followed the course between samples; otherwise it is the extreme of the samples.
    """

    kelvin: float
    time: float
    tracked: bool

    @property
    def celsius(self) -> float:
        """The temperature. [degC]"""
        return self.kelvin - ICE_POINT


MAX_ROUNDING_DIFFERENCE = 1e-9
"""By which a turning point at the time of a sample differs from it by rounding alone. [K]"""


@dataclass(frozen=True, eq=False)
class Turnings:
    """Turning points of one course: of every interval between two samples the highest and the lowest.

    Parameters
    ----------
    times : array (points,)     In order. [s]
    kelvin : array (points,)    [K]
    """

    times: Array
    kelvin: Array

    def furthest(self, most: int) -> Array:
        """Return the times (2 most,) of the `most` lowest points, then of the `most` highest ones. [s]"""
        order = np.argsort(self.kelvin, kind="stable")
        return np.asarray(self.times[np.concatenate((order[:most], order[-most:]))])

    def beside(self, times: Array, kelvin: Array) -> tuple[Array, Array]:
        """Return samples (times,) [s], [K] merged with the turning points in order of time: times [s] and temperatures [K].

        A sample on a jump has the value after it; the one before it, a turning point at the same time, stands ahead of it.
        """
        if not self.times.size:
            return times, kelvin
        k = np.clip(np.searchsorted(times, self.times), 0, times.size - 1)
        new = (self.times != times[k]) | (np.abs(self.kelvin - kelvin[k]) > MAX_ROUNDING_DIFFERENCE)
        joined = np.concatenate((self.times[new], times)), np.concatenate((self.kelvin[new], kelvin))
        order = np.argsort(joined[0], kind="stable")
        return joined[0][order], joined[1][order]


@dataclass(frozen=True, eq=False)
class MemberTurnings:
    """Turning points of one node in every member of an ensemble, between the stored samples.

    Parameters
    ----------
    members : array (points,)   Member of each point; in order, and in order of time within a member.
    times : array (points,)     [s]
    kelvin : array (points,)    [K]
    """

    members: NDArray[np.int64]
    times: Array
    kelvin: Array

    @classmethod
    def alike(cls, one: Turnings, shifts: Array) -> MemberTurnings:
        """Return the same turning points in members that differ by constants (members,). [K]"""
        count = shifts.size
        members = np.repeat(np.arange(count), one.times.size)
        return cls(members, np.tile(one.times, count), (one.kelvin[None, :] + shifts[:, None]).ravel())

    @classmethod
    def joined(cls, parts: Sequence[tuple[int, MemberTurnings]]) -> MemberTurnings:
        """Return turning points [s, K] of groups of members, each group with the number of its first member; an empty set of no groups."""
        none = MemberTurnings(np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros(0))
        every = list(parts) or [(0, none)]
        return cls(*(np.concatenate(c) for c in zip(*((first + p.members, p.times, p.kelvin) for first, p in every), strict=True)))

    def sorted(self) -> MemberTurnings:
        """Return the points in order of members and, within a member, of times."""
        order = np.lexsort((self.times, self.members))
        return MemberTurnings(self.members[order], self.times[order], self.kelvin[order])

    def of_member(self, member: int) -> Turnings:
        """Return the points of one member."""
        mine = slice(*np.searchsorted(self.members, [member, member + 1]))
        return Turnings(self.times[mine], self.kelvin[mine])

    def shifted(self, times: Array, added: Array) -> MemberTurnings:
        """Return the points with `added` (times or 1, members) [K] on their temperatures, straight between `times` (times,) [s].

        Their instants stay, which is exact where the same is added at all times.
        """
        if added.shape[0] == 1:
            return MemberTurnings(self.members, self.times, self.kelvin + added[0, self.members])
        k = np.clip(np.searchsorted(times, self.times, side="right") - 1, 0, times.size - 2)
        part = (self.times - times[k]) / (times[k + 1] - times[k])
        between = (1.0 - part) * added[k, self.members] + part * added[k + 1, self.members]
        return MemberTurnings(self.members, self.times, self.kelvin + between)

    def without(self, members: Collection[int]) -> MemberTurnings:
        """Return the points of all but some members, numbered as before."""
        rest = ~np.isin(self.members, np.array(list(members), dtype=np.int64))
        return MemberTurnings(self.members[rest], self.times[rest], self.kelvin[rest]) if members else self

    def taken(self, members: NDArray[np.int64], among: int) -> MemberTurnings:
        """Return the points of some `members` (increasing) out of `among`, renumbered 0, 1, ... in that order."""
        place = np.full(among, -1, dtype=np.int64)
        place[members] = np.arange(members.size)
        mine = place[self.members] >= 0
        return MemberTurnings(place[self.members[mine]], self.times[mine], self.kelvin[mine])

    def furthest(self, samples: Array, sign: float) -> Array:
        """Return the highest (sign 1) or lowest (-1) of samples (members, times) and turning points, of each member. [K]"""
        out = sign * np.asarray((sign * samples).max(axis=1))
        (np.maximum if sign > 0 else np.minimum).at(out, self.members, self.kelvin)
        return np.asarray(out)

    def rows(self, samples: Array) -> Array:
        """Return samples (times, members) with the highest and the lowest temperature of each member below: (times + 2, members). [K]"""
        return np.concatenate([samples, [self.furthest(samples.T, sign) for sign in (1.0, -1.0)]])


class Dense(Protocol):
    """The course of one node at any time of a run, by the integrator's own dense output."""

    def kelvin(self, times: Array) -> Array:
        """Return the temperatures (times,) [K] at increasing times (times,) [s]; the run is made again for them."""

    @property
    def switches(self) -> Array:
        """When inputs jump and thermostats switch. [s]"""


def resolved(times: Array, above: Array, dense: Callable[[Array], Array] | None, switches: Array | None = None) -> tuple[Array, Array]:
    """Return times [s] and values of a course, refined where it passes zero: such intervals are divided by `PIECES`, up to four times.

    Parameters
    ----------
    times, above : array (points,)  Samples and turning points, in order.
    dense : callable                Increasing times -> the course; None where it cannot be had: the points are returned as they are.
    switches : array                Instants at which the course may bend. [s]
    """
    for _ in range(MAX_DIVISIONS if dense is not None else 0):
        over = above > 0.0
        at = np.flatnonzero((over[1:] != over[:-1]) & (np.diff(times) > MIN_INTERVAL_SHARE * (1.0 + times[1:])))
        if dense is None or not 0 < at.size <= MAX_INTERVALS_AT_ONCE:
            break
        inner = times[at, None] + np.diff(times)[at, None] * np.arange(1, PIECES) / PIECES
        bends = switches if switches is not None else np.zeros(0)
        new = np.setdiff1d(np.concatenate((inner.ravel(), bends[np.isin(np.searchsorted(times, bends) - 1, at)])), times)
        order = np.argsort(np.concatenate((times, new)), kind="stable")
        times, above = np.concatenate((times, new))[order], np.concatenate((above, dense(new)))[order]
    return times, above


def first_above(times: Array, above: Array, dense: Callable[[Array], Array] | None = None, switches: Array | None = None) -> float | None:
    """Return the first time at which a course `above` (times,) is above zero, interpolated linearly; None where never. [s]

    `dense` and `switches` as in `resolved`, which refines the interval in which it passes zero.
    """
    over = np.flatnonzero(above > 0.0)
    if not over.size:
        return None
    k = int(over[0])
    if k == 0:
        return float(times[0])
    times, above = resolved(times[k - 1 : k + 1], above[k - 1 : k + 1], dense, switches)
    k = int(np.flatnonzero(above > 0.0)[0])
    if k == 0:
        return float(times[0])
    low, high = above[k - 1], above[k]
    return float(times[k - 1] - low / (high - low) * (times[k] - times[k - 1]))
