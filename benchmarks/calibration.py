"""The calibration of case B2: twenty parameters from twelve noisy sensors, through the public API alone."""

from __future__ import annotations

import math
from dataclasses import dataclass

import network
import numpy as np
from numpy.typing import NDArray

import thermid as td
from thermid.measure.records import Channel

Array = NDArray[np.float64]
NOISE, SEED = 0.05, 7
"""Standard deviation of a reading [K], and the seed of the noise."""
AWAY, PRIOR = 0.35, "50 [%]"
"""How far a start lies from the truth at most, and the standard deviation of each prior, both of the logarithm."""


@dataclass(frozen=True, eq=False)
class Calibration:
    """Everything that one calibration needs, and the truth.

    Parameters
    ----------
    model : Model           B2 at its start.
    record : Record         The room and twelve sensors.
    free : tuple of str     The twenty parameters.
    priors : dict           Path -> (mean, standard deviation), about the start.
    scenario : Scenario     From rest at 24 degC, which is known.
    truth : dict            Path -> value. [SI]
    """

    model: td.Model
    record: td.Record
    free: tuple[str, ...]
    priors: dict[str, tuple[str, str]]
    scenario: td.Scenario
    truth: dict[str, float]

    def run(self) -> td.Calibration:
        """Return the calibration."""
        return td.calibrate(self.model, self.record, self.free, scenario=self.scenario, priors=self.priors)

    def misses(self, found: td.Calibration) -> dict[str, float]:
        """Return path -> logarithm of found over true value, in units of its standard error."""
        return {p: math.log(found[p].value / t) / (found[p].error / found[p].value) for p, t in self.truth.items()}


def truth() -> dict[str, float]:
    """Return path -> value of the twenty parameters. [SI]"""
    coefficients = {f"{n}_skin.htc.coefficient": c for n, c in zip(network.NODES, network.NATURAL, strict=True)}
    return coefficients | {f"link{k}.conductance": g for k, (_, _, g) in enumerate(network.LINKS)}


def problem(seed: int = 1, every: float = 1.0) -> Calibration:
    """Return the calibration with its start drawn from a seed; 216 012 residuals, or fewer where sensors are read less often.

    Parameters
    ----------
    seed : int      Of the start.
    every : float   Interval of the samples. [s]
    """
    right, given = network.model(nonlinear=True), network.scenario(noisy=True)
    run = td.simulate(right, given, every=every)
    rng = np.random.default_rng(SEED)
    channels = {"air": Channel.from_array("air", network.room()[:: round(every)], unit="K", role="boundary", target="air")}
    for name in network.NODES:
        reading = run[name].kelvin + NOISE * rng.standard_normal(run.times.size)
        channels[f"T {name}"] = Channel.from_array(f"T {name}", reading, unit="K", role="node", target=name, noise=NOISE)
    record = td.Record.from_arrays("room", run.times, channels)
    values, free = truth(), network.FREE_NONLINEAR
    away = np.random.default_rng(seed).uniform(-AWAY, AWAY, len(free))
    unit = {p: "W/K" if p.startswith("link") else "W/(m^2 K)" for p in free}
    start = {p: f"{values[p] * math.exp(a)!r} [{unit[p]}]" for p, a in zip(free, away, strict=True)}
    rest = td.Scenario("rest", start=f"{network.T0!r} [K]")
    return Calibration(right.with_values(start), record, free, dict.fromkeys(free, ("", PRIOR)), rest, values)
