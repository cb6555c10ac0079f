"""B8: a fleet of 200 units of one design with six values each, from their logs to the population and all its intervals.

The peer is what one does without a fleet: a fit of every unit by itself, and means and spreads of what comes out. Six units in ten have a
log of four minutes in place of two hours, which alone tells no value. ``python benchmarks/run.py B8 --sizes 50 200``.
"""

from __future__ import annotations

from argparse import Namespace
from typing import Any

import numpy as np
from contest import timed
from machine import versions
from numpy.typing import NDArray

import thermid as td
from thermid.inference._fleet import units as fleets
from thermid.measure.records import Channel, Record

Array = NDArray[Any]
SIZES, QUICK = (50, 200), (20,)
TARGET = {200: 5.0}
"""Units -> time of all intervals. [s]"""
PEER = 10
"""Units that are fitted by themselves; the time of more is reckoned."""
WITHIN = 0.75
"""Part of the intervals of means and spreads, twelve, that must hold the truth: fewer come once in a thousand fleets. [-]"""
DESIGN = {"core": "20 [J/K]", "board": "60 [J/K]", "case": "150 [J/K]", "inside": "0.4 [W/K]", "mount": "0.6 [W/K]", "skin": "0.5 [W/K]"}
FREE = tuple(DESIGN)
SPREADS = np.array([0.05, 0.08, 0.05, 0.15, 0.25, 0.10])
NOISE = 0.05
WEAK = 0.6


def design() -> td.Model:
    """Return the unit: a core on a board in a case, six values in all."""
    ties = {"inside": ["core_node", "board_node"], "mount": ["board_node", "case_node"], "skin": ["case_node", "air"]}
    conductors = {f"{name}_link": {"kind": "conduction", "between": ends, "conductance": name} for name, ends in ties.items()}
    return td.model_from_dict(
        {
            "title": "unit of a fleet",
            "needs": ["air"],
            "parameters": DESIGN,
            "nodes": {f"{n}_node": {"capacitance": n} for n in FREE[:3]},
            "conductors": conductors,
            "loads": {"heat": {"into": "core_node", "power": "5 [W]"}},
        }
    )


def logs(model: td.Model, units: int) -> dict[str, Record]:
    """Return each unit's log."""
    rng, out = np.random.default_rng(8), {}
    moved = SPREADS * rng.standard_normal((units, len(FREE)))
    for k, row in enumerate(moved):
        times = np.arange(0.0, 240.1, 4.0) if rng.random() < WEAK else np.arange(0.0, 7200.1, 60.0)
        middle = {n: text.split() for n, text in DESIGN.items()}
        values = {n: f"{float(middle[n][0]) * float(np.exp(m))!r} {middle[n][1]}" for n, m in zip(FREE, row, strict=True)}
        room = td.Scenario("bench", boundaries={"air": "293 [K]"}, start="293 [K]", duration=float(times[-1]))
        run = td.simulate(model.with_values(values), room, times=times)
        channels = {
            n: Channel.from_array(n, run[n].kelvin + NOISE * rng.standard_normal(times.size), unit="K", role="node", target=n, noise=NOISE)
            for n in ("core_node", "case_node")
        }
        channels["ROOM"] = Channel.from_array("ROOM", np.full(times.size, 293.0), unit="K", role="boundary", target="air")
        out[f"unit {k + 1}"] = Record.from_arrays(f"unit {k + 1}", times, channels)
    return out


def run(options: Namespace) -> list[dict[str, Any]]:
    """Return what fleets of several sizes took, beside fits of every unit by itself."""
    found = []
    for count in options.sizes or (QUICK if options.quick else SIZES):
        rows = at_size(count)
        for row in rows:
            row["ratio"] = row["cpu_seconds"] / rows[0]["cpu_seconds"]
        part = f"{count} units"
        found.append({"work": f"B8, {part}", "part": part, "results": rows, "missing": {}, "versions": versions()})
    return found


def at_size(count: int) -> list[dict[str, Any]]:
    """Return a row for the whole fleet, one for its intervals alone, and one for units fitted by themselves."""
    model = design()
    records = logs(model, count)
    whole: list[tuple[float, float]] = []
    intervals: list[tuple[float, float]] = []
    summed = fleets._summed  # the last of its parts: all intervals of one population

    def watched(*given: Any) -> Any:
        wall, cpu, answer = timed(lambda: summed(*given))
        intervals.append((wall, cpu))
        return answer

    fleets._summed = watched
    try:
        for _ in range(2):
            wall, cpu, population = timed(lambda: fleets.fleet(model, records, FREE))
            whole.append((wall, cpu))
    finally:
        fleets._summed = summed
    truth = [(float(v.split()[0]), float(s)) for v, s in zip(DESIGN.values(), SPREADS, strict=True)]
    held = [
        inside
        for value, (mean, spread) in zip(population.values.values(), truth, strict=True)
        for inside in (value.low <= mean <= value.high, value.spread_low <= spread <= value.spread_high)
    ]
    tried = [name for name, record in records.items() if record.duration > 1000.0]
    alone = timed(lambda: [td.calibrate(model, records[name], FREE) for name in tried[:PEER]])
    times = np.array(alone[:2]) * len(tried) / len(tried[:PEER])
    right = {"right": bool(np.mean(held) >= WITHIN), "columns": {"intervals that hold": f"{sum(held)} of {len(held)}"}}
    target = {"target_seconds": TARGET[count]} if count in TARGET else {}
    return [
        _row("thermid", "from logs to the population", min(whole, key=lambda t: t[1])) | right,
        _row("thermid, all its intervals", "", min(intervals, key=lambda t: t[1])) | target,
        _row("thermid, unit by unit", f"{len(tried)} whole logs, reckoned from {len(tried[:PEER])}", (float(times[0]), float(times[1]))),
    ]


def _row(name: str, setting: str, times: tuple[float, float]) -> dict[str, Any]:
    return {"name": name, "setting": setting, "seconds": times[0], "cpu_seconds": times[1]}
