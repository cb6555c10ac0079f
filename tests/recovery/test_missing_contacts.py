"""A conductor that a deck lacks is the first element that `criticise` names: between two parts, or from a part to its surroundings."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import thermid as td
from by_code import of_code
from thermid.model.tree import TableSignal

pytestmark = pytest.mark.usefixtures("values_alone")

SEED = 20261129
TIMES = np.arange(0.0, 10801.0, 60.0)


def lacking(k: int) -> tuple[td.Calibration, tuple[str, str]]:
    """Return the fit of the k-th deck, and the ends of the one conductor that it lacks.

    Three or four masses in a row between a room and a plate, each read, every second one heated. The unit has one conductor more, between
    two that are not neighbours.
    """
    rng = np.random.default_rng([SEED, k])
    parts = [f"m{n}" for n in range(3 + k % 2)]
    row = ["room", *parts, "plate"]
    apart = [(a, b) for n, a in enumerate(row) for b in row[n + 2 :] if (a, b) != ("room", "plate")]
    ties = {f"{a}_{b}": ((a, b), float(rng.uniform(0.2, 1.0))) for a, b in pairwise(row)}
    ends = apart[int(rng.integers(len(apart)))]
    unit = {**ties, "more": (ends, float(rng.uniform(0.1, 0.5)))}
    held = {n: float(rng.uniform(50.0, 300.0)) for n in parts}
    powers = {f"q_{n}": rng.uniform(3.0, 8.0) * ((TIMES > 1200.0 * (1 + i)) & (TIMES < 6000.0)) for i, n in enumerate(parts[::2])}
    around = {"room": 293.15 + 0.3 * np.sin(TIMES / 2000.0), "plate": 298.15 + rng.uniform(5.0, 20.0) * np.sin(TIMES / 3000.0)}

    def deck(conductors: dict[str, tuple[tuple[str, str], float]], off: float) -> td.Model:
        """Return the row with some conductors, its values off by factors of up to exp(off)."""
        said = {n: float(x * np.exp(rng.uniform(-off, off))) for n, x in (*held.items(), *((n, g) for n, (_, g) in conductors.items()))}
        stated = {n: {"min": x / 5.0, "max": x * 5.0} for n, x in said.items()}
        joined = {
            n: {"kind": "conduction", "between": [*pair], "conductance": {"value": f"{said[n]} [W/K]", **stated[n]}}
            for n, (pair, _) in conductors.items()
        }
        nodes = {n: {"capacitance": {"value": f"{said[n]} [J/K]", **stated[n]}} for n in parts}
        loads = {q: {"into": q[2:], "power": "0 [W]"} for q in powers}
        return td.model_from_dict({"title": "row", "needs": [*around], "nodes": nodes, "conductors": joined, "loads": loads})

    scenario = td.Scenario(
        "run",
        boundaries={n: TableSignal(TIMES, t) for n, t in around.items()},
        loads={q: TableSignal(TIMES, p, True) for q, p in powers.items()},
        start="295 [K]",
        duration="3 [h]",
    )
    run = td.simulate(deck(unit, 0.0), scenario, times=TIMES)
    channels = {q: td.Channel.from_array(q, p, quantity="power", role="load", target=q) for q, p in powers.items()}
    for n, kelvin in {**around, **{n: run[n].kelvin + rng.normal(0.0, 0.04, TIMES.size) for n in parts}}.items():
        role = "boundary" if n in around else "node"
        channels[n] = td.Channel.from_array(n, kelvin, unit="K", role=role, target=n, noise=0.04)
    record = td.Record.from_arrays("run", TIMES, channels, synthetic=True)
    free = [*(f"{n}.capacitance" for n in parts), *(f"{n}.conductance" for n in ties)]
    return td.calibrate(deck(ties, 0.3), record, free), ends


def is_first(k: int) -> bool:
    """Whether what is suggested of the k-th deck is the conductor that it lacks."""
    fit, (a, b) = lacking(k)
    best = td.inference.criticise(fit).suggested
    return best is not None and bool(of_code([best.name], "element.contact", f"'({a}' .*'{b}|{b}' .*'{a})'"))


@pytest.mark.parametrize("k", [0, 1])
def test_the_conductor_that_was_left_out_is_suggested(k: int) -> None:
    """Between two parts, and from a part to the surroundings."""
    assert is_first(k)


@pytest.mark.campaign
def test_of_twenty_conductors_at_least_eighteen_are_suggested() -> None:
    assert sum(is_first(k) for k in range(20)) >= 18
