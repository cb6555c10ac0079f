"""A house of two masses with noise on its wall, and logs of it drawn by other means than the filter's: scipy and Van Loan's block."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

import thermid as td
from thermid.fit._estimation.estimation import Estimation
from thermid.measure.records import Channel, Record
from thermid.model.tree import Model, TableSignal, model_from_dict
from thermid.simulation.runs import Scenario

Array = NDArray[np.float64]
ICE = 273.15
VALUES = {"Ro": (0.018, "K/W"), "Ri": (0.003, "K/W"), "Cw": (1.2e7, "J/K"), "Ci": (1.5e6, "J/K")}


def house(values: Mapping[str, float] | None = None) -> Model:
    """Return wall and indoor air: Ro from wall to outside, Ri from wall to indoor. [SI]"""
    given = {n: v for n, (v, _) in VALUES.items()} | dict(values or {})
    return model_from_dict(
        {
            "title": "house",
            "needs": ["out"],
            "parameters": {n: f"{float(v)!r} [{VALUES[n][1]}]" for n, v in given.items()},
            "nodes": {"wall": {"capacitance": "Cw"}, "indoor": {"capacitance": "Ci"}},
            "conductors": {
                "outer": {"kind": "conduction", "between": ["wall", "out"], "resistance": "Ro"},
                "inner": {"kind": "conduction", "between": ["wall", "indoor"], "resistance": "Ri"},
            },
            "loads": {"heater": {"into": "indoor", "power": "0 [W]"}},
        }
    )


def van_loan(a: Array, g: Array, seconds: float) -> Array:
    """Return the covariance that noise adds over a step, off one exponential of a block (Van Loan 1978); for slow steps."""
    n = a.shape[0]
    block = np.zeros((2 * n, 2 * n))
    block[:n, :n], block[:n, n:], block[n:, n:] = -a, g @ g.T, a.T
    whole = expm(block * seconds)
    return np.asarray(whole[n:, n:].T @ whole[:n, n:])


def straight(a: Array, seconds: float) -> tuple[Array, Array, Array]:
    """Return what a step makes of the state, of the rate at its begin, and of what the rate rises by."""
    n = a.shape[0]
    block = np.zeros((3 * n, 3 * n))
    block[:n, :n] = a
    block[:n, n : 2 * n] = np.eye(n)
    block[n : 2 * n, 2 * n :] = np.eye(n)
    whole = expm(block * seconds)
    return whole[:n, :n], whole[:n, n : 2 * n], whole[:n, 2 * n :] / seconds


@dataclass(frozen=True)
class Truth:
    """What a synthetic log was drawn from. [SI]"""

    values: Mapping[str, float]
    sigma_w: float
    sigma_v: float


TRUTH = Truth({n: v for n, (v, _) in VALUES.items()}, 1.5e-3, 0.035)


@dataclass(frozen=True)
class Case:
    """A synthetic log with its scenario and truth; `states` (times, 2) are wall and indoor. [K]"""

    truth: Truth
    record: Record
    scenario: Scenario
    states: Array


def drawn(truth: Truth, seed: int, count: int = 240, every: float = 1800.0, noise_known: bool = False) -> Case:
    """Return a log: a heater switched at random, an outside that swings, wall and indoor air measured or only this."""
    r = np.random.default_rng(seed)
    t = every * np.arange(count)
    out = ICE + 15.0 + 5.0 * np.sin(2.0 * np.pi * t / 86400.0) + np.cumsum(r.normal(0.0, 0.15, count))
    power = 700.0 * np.repeat(r.integers(0, 2, count // 6 + 1), 6)[:count].astype(float)
    v = truth.values
    a = np.array(
        [
            [-(1 / v["Ro"] + 1 / v["Ri"]) / v["Cw"], 1 / v["Ri"] / v["Cw"]],
            [1 / v["Ri"] / v["Ci"], -1 / v["Ri"] / v["Ci"]],
        ]
    )
    b = np.array([[1 / v["Ro"] / v["Cw"], 0.0], [0.0, 1 / v["Ci"]]])
    g = np.array([[truth.sigma_w], [0.0]])
    f, p1, p2 = straight(a, every)
    root = np.linalg.cholesky(van_loan(a, g, every) + 1e-18 * np.eye(2))
    u = np.column_stack([out, power])
    states = np.empty((count, 2))
    states[0] = ICE + 25.0 + 0.1 * r.normal(size=2)
    for k in range(count - 1):
        states[k + 1] = f @ states[k] + p1 @ b @ u[k] + p2 @ b @ (u[k + 1] - u[k]) + root @ r.normal(size=2)
    read = states[:, 1] + truth.sigma_v * r.normal(size=count)
    channels: dict[str, Any] = {
        "indoor": Channel.from_array("indoor", read, unit="K", column="indoor", noise=truth.sigma_v if noise_known else None),
        "out": out,
    }
    record = Record.from_arrays("drawn", t, channels, unit="K")
    scenario = Scenario("drawn", loads={"heater": TableSignal(t, power)}, initial={"indoor": "25 [degC]", "wall": "25 [degC]"})
    return Case(truth, record, scenario, states)


def estimate(case: Case, **more: Any) -> Estimation:
    """Return the estimation of a case from values that are off."""
    off = {n: v * f for (n, v), f in zip(case.truth.values.items(), (0.7, 1.4, 1.3, 0.7), strict=True)}
    asked = {"process_noise": {"wall": {"start": "1e-3 [K/s^0.5]"}}, "start_sd": {"wall": "0.1 [K]", "indoor": "0.1 [K]"}} | more
    return td.inference.estimate(house(off), case.record, list(VALUES), scenario=case.scenario, **asked)
