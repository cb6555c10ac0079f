"""What a run rests on and nobody said: starts, powers, missing logs, tails. One test for each, named after what was seen."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

import thermid as td
from thermid.measure import Channel
from thermid.model.laws.signal import Table

ZERO = 273.15
NOISE = 0.05
STEP = 20.0


def box(rows: dict[str, float], load: str = "core") -> td.Model:
    """Return a core that is heated, a case around it and a cover; what a row names is a start of its own."""
    at = {"link": 0.6, "cover": 0.3, "htc": 10.0, "core": 200.0, "case": 300.0, "lid": 120.0, "power": 3.2} | rows
    return td.model_from_dict(
        {
            "title": "box",
            "needs": ["air"],
            "nodes": {
                "core": {"capacitance": f"{at['core']!r} [J/K]"},
                "case": {"capacitance": f"{at['case']!r} [J/K]"},
                "lid": {"capacitance": f"{at['lid']!r} [J/K]"},
            },
            "conductors": {
                "link": {"kind": "conduction", "between": ["core", "case"], "conductance": f"{at['link']!r} [W/K]"},
                "hinge": {"kind": "conduction", "between": ["case", "lid"], "conductance": f"{at['cover']!r} [W/K]"},
            },
            "surfaces": {
                "skin": {"of": "case", "to": "air", "area": "0.03 [m^2]", "effective_htc": f"{at['htc']!r} [W/(m^2 K)]"},
                "top": {"of": "lid", "to": "air", "area": "0.02 [m^2]", "effective_htc": "8 [W/(m^2 K)]"},
            },
            "loads": {"heat": {"into": load, "power": f"{at['power']!r} [W]"}},
        }
    )


def temperature(run: Any, node: str, times: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(run[node].at(times), dtype=float) + ZERO


def logged(name: str, times: NDArray[np.float64], case: NDArray[np.float64], power: NDArray[np.float64] | None = None) -> td.Record:
    """Return a log of case and air, and of the power where one is given."""
    channels = {
        "T": Channel.of("T", case, role="node", target="case", noise=NOISE),
        "A": Channel.of("A", np.full(times.size, 20.0 + ZERO), role="boundary", target="air", noise=0.01),
    }
    if power is not None:
        channels["P"] = Channel.of("P", power, role="load", target="heat", quantity="power")
    return td.Record.from_arrays(name, times, channels)


def warm(seed: int) -> tuple[dict[str, float], td.Model, td.Record]:
    """Return the true values, the deck that is fitted, and the log of a test that began while the box was still warm.

    The box has a past: it was heated for 5 min to 2 h with 2 to 8 W and cooled for up to 15 min before the log begins.
    """
    rng = np.random.default_rng(seed)
    spread = {k: float(np.exp(rng.normal(0.0, 0.4))) for k in ("htc", "core")}
    drawn = {"link": float(rng.uniform(0.2, 1.5)), "cover": float(rng.uniform(0.1, 0.6)), "lid": float(rng.uniform(40.0, 200.0))}
    truth = box(drawn | {"htc": 10.0 * spread["htc"], "core": 200.0 * spread["core"]})
    heated, cooled = float(rng.uniform(300.0, 7200.0)), float(rng.uniform(0.0, 900.0))
    on, off = float(rng.uniform(2.0, 8.0)), float(rng.uniform(600.0, 1200.0))
    air = {"air": "20 [degC]"}
    past = Table(np.array([0.0, heated, heated + cooled + 1.0]), np.array([on, 0.0, 0.0]), True)
    before = td.simulate(truth, td.Scenario("past", boundaries=air, start="air", loads={"heat": past}, duration=heated + cooled))
    initial = {n: f"{before[n].final} [degC]" for n in ("core", "case", "lid")}
    times = np.arange(0.0, 3601.0, STEP)
    power = np.where(times < off, 0.0, 4.0)
    now = Table(times, power, True)
    scenario = td.Scenario("now", boundaries=air, start="air", initial=initial, loads={"heat": now}, duration=3600.0)
    case = temperature(td.simulate(truth, scenario), "case", times) + NOISE * rng.standard_normal(times.size)
    true = {"skin.effective_htc": 10.0 * spread["htc"], "core.capacitance": 200.0 * spread["core"]}
    return true, box(drawn), logged(f"warm {seed}", times, case, power)


def held(seed: int) -> list[bool]:
    """Return, of each fitted value, whether its 95 % interval holds the truth."""
    true, deck, record = warm(seed)
    fit = td.calibrate(deck, record, list(true), name="warm")
    return [abs(np.log(fit[p].value / v)) <= 1.959964 * fit[p].error / fit[p].value for p, v in true.items()]
