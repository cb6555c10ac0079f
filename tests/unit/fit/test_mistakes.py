"""A grossly wrong fit asks for the unit of powers; mistakes that would explain a bad fit: `inference/explain/test_mistakes.py`."""

from __future__ import annotations

import re

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import IdentificationError, SolverError
from thermid.model.tree import TableSignal

PAIR = td.model_from_dict(
    {
        "title": "Pair",
        "needs": ["room"],
        "nodes": {n: {"capacitance": {"value": "700 [J/K]", "min": 100, "max": 5000}} for n in ("amp", "psu")},
        "conductors": {
            f"{a}_{b}": {"kind": "conduction", "between": [a, b], "conductance": {"value": "0.4 [W/K]", "min": 0.01, "max": 20}}
            for a, b in (("amp", "room"), ("psu", "room"), ("amp", "psu"))
        },
        "loads": {"heat": {"into": "amp", "power": "8 [W]"}},
    }
)
TIMES = np.linspace(0.0, 18000.0, 181)
SCENARIO = td.Scenario("bench", {"room": "22 [degC]"}, start="22 [degC]")


def log(factor: float = 1.0) -> td.Record:
    """Return a log of a pair that differs from its deck, its powers times a factor."""
    watts = np.where(TIMES < 9000.0, 8.0, 2.0)
    hidden = PAIR.with_values({"amp.capacitance": "900 [J/K]", "amp_psu.conductance": "0.8 [W/K]"})
    run = td.simulate(hidden, SCENARIO.with_(loads={"heat": TableSignal(TIMES, watts, hold=True)}, duration=float(TIMES[-1])), times=TIMES)
    rng = np.random.default_rng(1)
    channels = {
        f"T{k}": td.Channel.from_array(
            f"T{k}", run[n].kelvin + 0.05 * rng.standard_normal(TIMES.size), unit="K", role="node", target=n, noise=0.05
        )
        for k, n in enumerate(("amp", "psu"))
    }
    power = td.Channel.from_array("P", factor * watts, quantity="power", role="load", target="heat")
    return td.Record.from_arrays("bench", TIMES, channels | {"P": power})


def said(record: td.Record, free: list[str]) -> str:
    """Return what a fit says, or the refusal of one that ends in nonsense."""
    try:
        return str(td.calibrate(PAIR, record, free, scenario=SCENARIO, search="local"))
    except IdentificationError as refusal:
        return refusal.message


def test_a_power_that_no_log_gives_is_named() -> None:
    told = said(log().select("T0", "T1"), ["*.conductance"])
    assert "'heat'" in told


ASKED_FOR_ITS_UNIT = r"'P' .*'heat' {shown} W, .* 8 W: .* W .* {unit}\. "


@pytest.mark.parametrize(("factor", "shown", "unit"), [(1000.0, "8000", "mW"), (0.001, "0.008", "kW")])
def test_a_power_far_from_its_deck_is_asked_for_its_unit(factor: float, shown: str, unit: str) -> None:
    told = said(log(factor), ["*.conductance"])
    assert re.search(ASKED_FOR_ITS_UNIT.format(shown=re.escape(shown), unit=unit), told)


def test_a_power_near_its_deck_is_not_asked_for() -> None:
    for factor in (1.0, 100.0, 0.01):
        assert not re.search(ASKED_FOR_ITS_UNIT.format(shown=r"\S+", unit=r"\S+"), said(log(factor), ["*.conductance"]))


def test_a_fit_that_breaks_off_asks_for_the_unit_too() -> None:
    with raises_code("run.did-not-finish", SolverError, match="0 K"):
        td.calibrate(PAIR, log(1e6), ["*.conductance"], scenario=td.Scenario("bench", {"room": "22 [degC]"}), search="local")
