"""B4: an ensemble of 10 000 members of B2 in the noisy room, outputs every 60 s, log-parameters normal with a standard deviation of 0.2.

Peers run fewer members; what counts is members a second of processor time. Errors are those of the first members.
"""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable
from typing import Any

import network
import numpy as np
import peers
from contest import timed
from numpy.typing import NDArray
from plain import FREE, Task
from reference import march

import thermid as td

Array = NDArray[Any]
MEMBERS, SEED, SD, CHECKED = 10_000, 5, 0.2, 24
TARGET = 3000.0
"""Members a second on one core."""
LIMIT = 3e-4


def run(options: Namespace) -> list[dict[str, Any]]:
    """Return members a second of `thermid` and of the peers."""
    members = 1000 if options.quick else MEMBERS
    task = Task("B4", "run", True, True, 60.0, LIMIT)
    logs = SD * np.random.default_rng(SEED).standard_normal((members, FREE))
    right = march(logs[:CHECKED], task)
    present, missing = peers.present(options.peers)
    rows = [_measured("thermid", "default options, one thread", _own(logs), logs, right, min(options.rounds, 3))]
    for module in present:
        for name, setting, count, solve in getattr(module, "members", lambda _: ())(task):
            rows.append(_measured(name, f"{setting}, {count} members", solve, logs[:count], right, 2))
    rows[0]["target_seconds"] = members / TARGET
    for row in rows:
        row["ratio"] = rows[0]["members_per_second"] / row["members_per_second"]
        row["columns"] = {"members/s": f"{row['members_per_second']:.4g}"}
    missing |= {m.NAME: "no way to run members but one by one, as its run in B2 does" for m in present if not hasattr(m, "members")}
    return [{"work": f"B4, {members} members, ratio of members a second", "results": rows, "missing": missing, "remarks": []}]


def _own(logs: Array) -> Callable[[Array], list[Array]]:
    simulator = td.prepare(network.model(True), network.scenario(True), network.FREE_NONLINEAR, every=60.0)

    def solve(wanted: Array) -> list[Array]:
        draws = {name: simulator.nominal[name] * np.exp(wanted[:, k]) for k, name in enumerate(simulator.free)}
        found = simulator.ensemble(draws, nodes=network.NODES)
        return [found.temperatures(name) for name in network.NODES]

    return solve


def _measured(
    name: str, setting: str, solve: Callable[[Array], Array | list[Array]], logs: Array, right: Array, runs: int
) -> dict[str, Any]:
    """Return the row of one contestant, whose temperatures are (times, members, nodes), or (times, members) of each node."""
    first = timed(lambda: solve(logs))[0]  # compiled before the clock runs
    times = [timed(lambda: solve(logs)) for _ in range(runs)]
    checked = min(len(logs), right.shape[1])
    found = times[0][2]
    seen = found[:, :checked] if isinstance(found, np.ndarray) else np.stack([t[:, :checked] for t in found], axis=-1)
    error = float(np.abs(seen - right[:, :checked]).max())
    cpu = min(t[1] for t in times)
    return {
        "name": name,
        "setting": setting,
        "members": len(logs),
        "seconds": min(t[0] for t in times),
        "cpu_seconds": cpu,
        "first_seconds": first,
        "runs": runs,
        "members_per_second": len(logs) / cpu,
        "max_error_K": error,
        "right": error <= LIMIT,
    }
