"""A box whose powers were logged on a clock of their own: what fits say of the clock and of the values, with the clock open and known."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

import thermid as td
from thermid.model.tree import TableSignal

DECK = {
    "title": "Box on a plate",
    "needs": ["air"],
    "nodes": {
        "box": {"capacitance": {"value": "300 [J/K]", "min": 60, "max": 1500}},
        "board": {"capacitance": {"value": "60 [J/K]", "min": 10, "max": 400}},
    },
    "conductors": {
        "seat": {"kind": "conduction", "between": ["board", "box"], "conductance": {"value": "1.5 [W/K]", "min": 0.3, "max": 8}},
        "out": {"kind": "conduction", "between": ["box", "air"], "conductance": {"value": "0.5 [W/K]", "min": 0.1, "max": 2.5}},
    },
    "loads": {"heat": {"into": "board", "power": "0 [W]"}},
}
MODEL = td.model_from_dict(DECK)
FREE = {"box.capacitance": (200.0, 450.0), "board.capacitance": (40.0, 90.0), "seat.conductance": (0.8, 2.5), "out.conductance": (0.3, 0.8)}
AIR = td.Scenario("air", {"air": "20 [degC]"}, start="20 [degC]")
TIMES = np.arange(0.0, 5401.0, 10.0)
NOISE = 0.05
RANGE = (-60.0, 60.0)
"""Within which the offset of the meter's clock is known. [s]"""


@dataclass(frozen=True)
class Case:
    """The logs of a box, one of powers with a row at every change, and the truth: offset of the meter's clock [s], values by path [SI]."""

    temperatures: td.Record
    powers: td.Record
    exact: td.Record
    offset: float
    values: Mapping[str, float]

    def fit(self, known: bool) -> td.Calibration:
        """Return the fit with the clock open, or with clock and instants known."""
        log = self.temperatures.joined(self.exact, 0.0) if known else self.temperatures.joined(self.powers, RANGE)
        return td.calibrate(MODEL, log, list(FREE), scenario=AIR)

    def with_stated_clock(self, error: float) -> td.Calibration:
        """Return the fit with every instant known, and the clock of the powers stated with an error. [s]"""
        return td.calibrate(MODEL, self.temperatures.joined(self.exact, error), list(FREE), scenario=AIR)


def drawn(seed: int, step: float = 60.0) -> Case:
    """Return a case; the meter samples every `step` [s], and its power changes two to five times, anywhere between samples."""
    rng = np.random.default_rng(seed)
    values = {path: float(rng.uniform(*within)) for path, within in FREE.items()}
    offset = float(rng.uniform(*RANGE))
    changes = np.sort(rng.choice(np.arange(300.0, 4800.0, 450.0), int(rng.integers(2, 6)), replace=False) + rng.uniform(0.0, 300.0))
    levels = np.append(0.0, rng.uniform(4.0, 20.0, changes.size))
    levels[2::2] *= 0.2
    truth = MODEL.with_values({p: f"{v!r} [{'J/K' if 'cap' in p else 'W/K'}]" for p, v in values.items()})
    power = TableSignal(np.concatenate([[-1000.0], changes, [9000.0]]), np.append(levels, levels[-1]), True)
    run = td.simulate(
        truth, td.Scenario("s", {"air": "20 [degC]"}, {"heat": power}, start="20 [degC]", duration=float(TIMES[-1])), times=TIMES
    )
    temperatures = {
        n: td.Channel.from_array(n, run[n].kelvin + NOISE * rng.standard_normal(TIMES.size), unit="K", role="node", target=n, noise=NOISE)
        for n in ("box", "board")
    }
    there = np.arange(-2.0 * step, TIMES[-1] + 2.0 * step + 1.0, step) + rng.uniform(0.0, step)  # on the meter's own clock
    shown = levels[np.searchsorted(changes, there + offset, side="right")]
    fine = np.union1d(TIMES, changes)
    logs = {
        name: td.Record.from_arrays(
            name, times, {"P": td.Channel.from_array("P", watts, quantity="power", role="load", target="heat", prompt=prompt)}
        )
        for name, times, watts, prompt in (
            ("meter", there, shown, None),
            ("exact", fine, levels[np.searchsorted(changes, fine, side="right")], True),
        )
    }
    return Case(td.Record.from_arrays("box", TIMES, temperatures), logs["meter"], logs["exact"], offset, values)
