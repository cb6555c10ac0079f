"""`Tally`: what many members say of a temperature at many times, without keeping any: counts on a grid, and moments in whole numbers.

All that is kept are integers, so tallies that are joined in any order are the same to the last bit. `Counted` holds those of all names
beside what is kept of every member, in parts that join in any order and go to a file and back.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any
from zlib import compress, decompress

import numpy as np
from numpy.typing import NDArray

from thermid.base.units import Array, Indices

PILOT = 1000
"""Members from which grids are chosen, at most."""
BINS_IN_SPREAD = 100.0
"""Bins in a standard deviation of the pilot, at least, where memory allows; otherwise in its range."""
FINEST_BIN = -9
"""Exponent of the finest bin: 2^-9 K is the least power of two above 1 mK."""
BEYOND_PILOT = 0.25
"""By how much of its range the pilot's grid reaches beyond it on each side. [-]"""
MOST_BINS = 1 << 22
"""Bins of a table beyond which they are made wider, as long as the pilot's range has `BINS_IN_SPREAD` of them."""
MOMENT_BITS = 14
"""Moments count in 2^-14 K."""
LEAST_REACH = 512
"""Bins on which the counts beyond a grid rest, at least."""
HALF_BITS = 18
"""Bits of the lower half of a distance."""
ROW_BIT, LEVEL_BIT = 39, 33
"""Bits of a key at which row and level begin."""


@dataclass(frozen=True, eq=False)
class CountGrid:
    """Where the counts of each row stand: bins of 2^exponent, chosen from a pilot alone.

    Parameters
    ----------
    exponents : array (rows,)   Of the width of a bin. [K]
    first, bins : array (rows,) Index of the lowest bin, how many there are; both even.
    centre : array (rows,)      The pilot's mean. [K]
    """

    exponents: Indices
    first: Indices
    bins: Indices
    centre: Array

    @classmethod
    def for_pilot(cls, pilot: Array) -> CountGrid:
        """Return the grid for the values of a pilot (rows, members) [K].

        Bins are the largest power of two within a hundredth of the pilot's standard deviation, wider where all bins together would be too
        many, and reach a quarter of its range beyond it on each side.
        """
        low, high = pilot.min(axis=1), pilot.max(axis=1)
        exponents = _exponent(pilot.std(axis=1) / BINS_IN_SPREAD)
        coarsest = np.maximum(exponents, _exponent((high - low) / BINS_IN_SPREAD))
        while True:
            width, beyond = np.ldexp(1.0, exponents), BEYOND_PILOT * (high - low)
            first = 2 * np.floor((low - beyond) / (2.0 * width)).astype(np.int64)
            bins = 2 * np.floor((high + beyond) / (2.0 * width)).astype(np.int64) + 2 - first
            if bins.sum() <= MOST_BINS or (exponents >= coarsest).all():
                return cls(exponents, first, bins, pilot.mean(axis=1))
            exponents = np.minimum(exponents + 1, coarsest)


def _exponent(width: Array) -> Indices:
    """Return the largest n (rows,) with 2^n <= width [K], at least `FINEST_BIN`."""
    return np.asarray(np.maximum(np.frexp(np.maximum(width, 2.0**FINEST_BIN))[1] - 1, FINEST_BIN), dtype=np.int64)


@dataclass(frozen=True, eq=False)
class Tally:
    """Counts and moments of rows, each a temperature at one time.

    Parameters
    ----------
    grid : CountGrid
    members : int               How many were counted.
    counts : array (bins,)      Of all rows, one behind the other.
    sums : array (4, rows)      Of the distances from the grid's centre in 2^-14 K, and of the products of their halves: high, mixed, low.
    keys, beyond : array        Row, level and bin of what lies outside a grid, where a bin is 2^level times as wide; and how many.
    """

    grid: CountGrid
    members: int
    counts: NDArray[np.uint32]
    sums: NDArray[np.int64]
    keys: Indices
    beyond: Indices

    @classmethod
    def of_values(cls, grid: CountGrid, values: Array) -> Tally:
        """Return the counts and moments of values (rows, members), all finite. [K]

        A bin is floor(T / 2^exponent). Moments are sums of integers x = (T - centre) 2^`MOMENT_BITS` and of x^2, in halves of `HALF_BITS`
        bits, so that sums over members come out the same in any order.
        """
        at = np.floor(values * np.ldexp(1.0, -grid.exponents)[:, None]).astype(np.int64)
        place = at - grid.first[:, None]
        inside = (place >= 0) & (place < grid.bins[:, None])
        starts = np.cumsum(grid.bins) - grid.bins
        counts = np.bincount((place + starts[:, None])[inside], minlength=int(grid.bins.sum())).astype(np.uint32)
        away = np.rint((values - grid.centre[:, None]) * 2.0**MOMENT_BITS).astype(np.int64)
        high, low = away >> HALF_BITS, away & ((1 << HALF_BITS) - 1)  # a square of 1e6 K in such steps has more than 64 bits
        sums = np.stack([x.sum(axis=1) for x in (away, high * high, high * low, low * low)])
        rows, members = np.nonzero(~inside)
        keys, beyond = np.unique(_keys(grid, rows, at[rows, members]), return_counts=True)
        return cls(grid, values.shape[1], counts, sums, keys, beyond)

    def joined(self, other: Tally) -> Tally:
        """Return the tally of the members of both tallies, which have the same grid: counts, sums and values beyond it are added."""
        keys, place = np.unique(np.concatenate([self.keys, other.keys]), return_inverse=True)
        beyond = np.zeros(keys.size, dtype=np.int64)
        np.add.at(beyond, place, np.concatenate([self.beyond, other.beyond]))
        counts, sums = self.counts + other.counts, self.sums + other.sums
        return Tally(self.grid, self.members + other.members, counts, sums, keys, beyond)

    def __reduce__(self) -> tuple[Callable[..., Tally], tuple[Any, ...]]:
        """Return how to make it anew for pickling, with its counts, in as few bytes each as the largest needs, compressed."""
        counts = self.counts.astype(np.min_scalar_type(self.counts.max(initial=0)))
        return _unpacked, (self.grid, self.members, compress(counts.tobytes(), 1), counts.dtype.str, self.sums, self.keys, self.beyond)

    @property
    def mean(self) -> Array:
        """Means (rows,), to 2^-15 K: centre of the grid + sum of the members' offsets from it, in steps of 2^-14 K, / members. [K]"""
        return np.asarray(self.grid.centre + self.sums[0] / self.members * 2.0**-MOMENT_BITS)

    @property
    def sd(self) -> Array:
        """Standard deviations (rows,); zero for one member. [K]"""
        n, out = self.members, np.zeros(self.sums.shape[1])
        for row, (total, high, mixed, low) in enumerate(self.sums.T.tolist() if n > 1 else ()):
            squares = (high << 2 * HALF_BITS) + (mixed << HALF_BITS + 1) + low
            out[row] = ((n * squares - total * total) / (n * (n - 1))) ** 0.5
        return np.asarray(out * 2.0**-MOMENT_BITS)

    def quantiles(self, shares: Sequence[float]) -> tuple[Array, Array]:
        """Return the quantiles (shares, rows), interpolated between the middles of bins, and the half width of their bins as error. [K]"""
        wanted = np.asarray(shares, dtype=float) * (self.members - 1)
        below = np.floor(wanted).astype(np.int64)
        quantiles, error = np.empty((2, wanted.size, self.grid.bins.size))
        for row, (middles, halves, counts) in enumerate(self._rows()):
            upto = np.cumsum(counts)
            a, b = (np.searchsorted(upto, rank, side="right") for rank in (below, np.ceil(wanted).astype(np.int64)))
            quantiles[:, row] = middles[a] + (wanted - below) * (middles[b] - middles[a])
            error[:, row] = np.maximum(halves[a], halves[b])
        return quantiles, error

    def read(self, share: float | Sequence[float] | Array) -> tuple[Array, Array]:
        """Return the quantiles (rows,) of a share, or (shares, rows) of several, and by how much each may be wrong. [K]"""
        quantiles, error = self.quantiles(np.atleast_1d(share).tolist())
        return (quantiles, error) if np.ndim(share) else (quantiles[0], error[0])

    def _rows(self) -> list[tuple[Array, Array, Indices]]:
        """Return for each row the bins that hold members, in order: middles [K], half widths [K] and numbers of members, each (bins,).

        A bin k of level l reaches from k 2^e to (k + 1) 2^e K, with e = l + the exponent of its row; level 0 is the grid, higher levels
        lie beyond it.
        """
        grid, out = self.grid, []
        row, level = self.keys >> ROW_BIT, (self.keys >> LEVEL_BIT) & ((1 << ROW_BIT - LEVEL_BIT) - 1)
        index = (self.keys & ((1 << LEVEL_BIT) - 1)) - (1 << LEVEL_BIT - 1)
        ends, begins = np.cumsum(grid.bins), np.searchsorted(row, np.arange(grid.bins.size + 1))
        for k, end in enumerate(ends.tolist()):
            row_counts, mine = self.counts[end - int(grid.bins[k]) : end], slice(begins[k], begins[k + 1])
            held = np.flatnonzero(row_counts)
            widths = np.ldexp(1.0, np.concatenate([np.zeros(held.size, dtype=np.int64), level[mine]]) + grid.exponents[k])
            middles = (np.concatenate([held + grid.first[k], index[mine]]) + 0.5) * widths
            order = np.argsort(middles, kind="stable")
            counts = np.concatenate([row_counts[held].astype(np.int64), self.beyond[mine]])
            out.append((middles[order], 0.5 * widths[order], counts[order]))
        return out


def _unpacked(grid: CountGrid, members: int, counts: bytes, kind: str, *others: Any) -> Tally:
    """Return a tally from what `__reduce__` packed; `counts` are compressed bytes, of which `kind` says what they are."""
    return Tally(grid, members, np.frombuffer(decompress(counts), dtype=kind).astype(np.uint32), *others)


def _keys(grid: CountGrid, rows: Indices, at: Indices) -> Indices:
    """Return the keys of bins (values,) that lie outside the grids of their rows.

    Grids grow level by level to twice their reach, their bins as well. The edges of each are edges of bins of the next, so that a wider bin
    never holds what a narrower one could.
    """
    low, high = grid.first[rows], grid.first[rows] + grid.bins[rows]
    reach, keys = np.maximum(grid.bins[rows], LEAST_REACH), np.zeros(rows.size, dtype=np.int64)
    level, open_ = 0, np.arange(rows.size)
    while open_.size:
        level += 1
        edge = np.int64(1) << (level + 1)
        low = (low - (reach << (level - 1))) // edge * edge
        high = -((-high - (reach << (level - 1))) // edge) * edge
        now = (at[open_] >= low) & (at[open_] < high)
        mine = open_[now]
        keys[mine] = (rows[mine] << ROW_BIT) + (np.int64(level) << LEVEL_BIT) + (at[mine] >> level) + (np.int64(1) << LEVEL_BIT - 1)
        low, high, reach, open_ = low[~now], high[~now], reach[~now], open_[~now]
    return keys


TALLIED = ("counts", "sums", "keys", "beyond")


@dataclass(frozen=True, eq=False)
class Counted:
    """Counts of members whose traces are not stored, members numbered from zero.

    Parameters
    ----------
    members : int
    tallies : dict      Name -> counts of those that reached the end; empty where none did before.
    rows : dict         Name -> what is kept of every member (..., members).
    failed : dict       Member -> why it did not reach the end.
    statistics : dict   Name -> number, or text.
    """

    members: int
    tallies: Mapping[str, Tally]
    rows: Mapping[str, NDArray[Any]]
    failed: Mapping[int, str]
    statistics: Mapping[str, Any]

    @classmethod
    def on_grids(
        cls,
        grids: Mapping[str, CountGrid],
        counted: Mapping[str, Array],
        members: int,
        failed: Mapping[int, str],
        statistics: Mapping[str, Any],
        rows: Mapping[str, NDArray[Any]] | None = None,
    ) -> Counted:
        """Return the counts of members on grids: `counted` has the values (rows, members) of those that reached the end, by name."""
        return cls(members, {n: Tally.of_values(grid, counted[n]) for n, grid in grids.items()}, rows or {}, failed, statistics)

    @staticmethod
    def grids(pilot: Mapping[str, Array]) -> dict[str, CountGrid]:
        """Return the grids for the values (rows, members) of the first members by name; none for a name without members at the end."""
        return {n: CountGrid.for_pilot(x[:, :PILOT]) for n, x in pilot.items() if x.size}

    @classmethod
    def gathered(cls, parts: Iterable[tuple[int, Counted]], members: int) -> Counted:
        """Return the sum of parts, each with the number of its first member, in whatever order they come; `members` in all."""
        tallies: dict[str, Tally] = {}
        rows: dict[str, NDArray[Any]] = {}
        failed: dict[int, str] = {}
        statistics = []
        for first, part in parts:
            for n, tally in part.tallies.items():
                tallies[n] = tallies[n].joined(tally) if n in tallies else tally
            for n, row in part.rows.items():
                rows.setdefault(n, np.full((*row.shape[:-1], members), np.nan, dtype=row.dtype))[..., first : first + part.members] = row
            failed |= {first + m: why for m, why in part.failed.items()}
            statistics.append(part.statistics)
            del part  # megabytes, while the next is made
        return cls(members, tallies, rows, dict(sorted(failed.items())), added(statistics))

    def arrays(self) -> dict[str, Any]:
        """Return the counts as arrays by name for a file; grids are not in it, since the pilot that sets them is run again."""
        counts = {f"{part}_{k}": getattr(t, part) for k, t in enumerate(self.tallies.values()) for part in TALLIED}
        rows = {f"rows_{k}": x for k, x in enumerate(self.rows.values())}
        about = [self.members, {str(m): why for m, why in self.failed.items()}, dict(self.statistics), list(self.rows)]
        return {**counts, **rows, "about": np.array(json.dumps(about))}

    @classmethod
    def read(cls, arrays: Mapping[str, Any] | None, grids: Mapping[str, CountGrid]) -> Counted | None:
        """Return the counts that `arrays` of a file hold, on their grids; None where the file is missing or holds something else."""
        try:
            if arrays is None:
                return None
            members, failed, statistics, names = json.loads(str(arrays["about"]))
            good = members - len(failed)
            tallies = {n: Tally(g, good, *(arrays[f"{part}_{k}"] for part in TALLIED)) for k, (n, g) in enumerate(grids.items())}
            rows = {n: arrays[f"rows_{k}"] for k, n in enumerate(names)}
            return cls(members, tallies, rows, {int(m): why for m, why in failed.items()}, statistics)
        except (ValueError, KeyError):
            return None


def added(parts: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the statistics of several parts together: numbers summed, texts that differ joined by 'and'."""
    out: dict[str, Any] = {}
    for name in dict.fromkeys(n for p in parts for n in p):
        values = [p[name] for p in parts if name in p]
        out[name] = " and ".join(sorted({*values})) if isinstance(values[0], str) else sum(values)
    return out
