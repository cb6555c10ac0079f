"""`Counted`: what is kept of members whose traces are dropped, in parts that join in any order and go to a file and back."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.base.linear_algebra import Array
from thermid.simulation._many.tally import PILOT, CountGrid, Tally

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
