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
    """What is kept of members that were counted, numbered from zero.

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
    def of(
        cls,
        grids: Mapping[str, CountGrid],
        counted: Mapping[str, Array],
        members: int,
        failed: Mapping[int, str],
        statistics: Mapping[str, Any],
        rows: Mapping[str, NDArray[Any]] | None = None,
    ) -> Counted:
        """Return what is kept of members: counts of what those that reached the end did (rows, members), and what is kept of every one."""
        return cls(members, {n: Tally.of_values(grid, counted[n]) for n, grid in grids.items()}, rows or {}, failed, statistics)

    @staticmethod
    def grids(pilot: Mapping[str, Array]) -> dict[str, CountGrid]:
        """Return the grids for what the first members did (rows, members); none where none reached the end."""
        return {n: CountGrid.for_pilot(x[:, :PILOT]) for n, x in pilot.items() if x.size}

    @classmethod
    def gathered(cls, parts: Iterable[tuple[int, Counted]], members: int) -> Counted:
        """Return members in parts, each with the place of its first, in whatever order they come."""
        tallies: dict[str, Tally] = {}
        rows: dict[str, NDArray[Any]] = {}
        failed: dict[int, str] = {}
        statistics = []
        for first, part in parts:
            for n, tally in part.tallies.items():
                tallies[n] = tallies[n].joined(tally) if n in tallies else tally
            for n, own in part.rows.items():
                rows.setdefault(n, np.full((*own.shape[:-1], members), np.nan, dtype=own.dtype))[..., first : first + part.members] = own
            failed |= {first + m: why for m, why in part.failed.items()}
            statistics.append(part.statistics)
            del part  # megabytes, while the next is made
        return cls(members, tallies, rows, dict(sorted(failed.items())), added(statistics))

    def arrays(self) -> dict[str, Any]:
        """Return it as arrays for a file; grids come from the pilot, which is run again."""
        kept = {f"{part}_{k}": getattr(t, part) for k, t in enumerate(self.tallies.values()) for part in TALLIED}
        rows = {f"rows_{k}": x for k, x in enumerate(self.rows.values())}
        about = [self.members, {str(m): why for m, why in self.failed.items()}, dict(self.statistics), list(self.rows)]
        return {**kept, **rows, "about": np.array(json.dumps(about))}

    @classmethod
    def read(cls, arrays: Mapping[str, Any] | None, grids: Mapping[str, CountGrid]) -> Counted | None:
        """Return what arrays of a file hold; None where they do not."""
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
    """Return the statistics of several parts together: sums of numbers, and each text once."""
    out: dict[str, Any] = {}
    for name in dict.fromkeys(n for p in parts for n in p):
        found = [p[name] for p in parts if name in p]
        out[name] = " and ".join(sorted({*found})) if isinstance(found[0], str) else sum(found)
    return out
