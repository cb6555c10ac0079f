"""A grossly wrong fit asks whether sensors are exchanged or powers in another unit; a wrong model is not blamed on them."""

from __future__ import annotations

import numpy as np
import pytest

import thermid as td
from thermid.errors import IdentificationError, SolverError
from thermid.model.laws.signal import TableSignal

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
FREE = ["*.capacitance", "*.conductance"]
TIMES = np.linspace(0.0, 18000.0, 181)
SCENARIO = td.Scenario("bench", {"room": "22 [degC]"}, start="22 [degC]")


def log(factor: float = 1.0, exchanged: bool = False) -> td.Record:
    """Return a log of a pair that differs from its deck, its powers times a factor, its sensors exchanged or not."""
    watts = np.where(TIMES < 9000.0, 8.0, 2.0)
    hidden = PAIR.with_values({"amp.capacitance": "900 [J/K]", "amp_psu.conductance": "0.8 [W/K]"})
    run = td.simulate(hidden, SCENARIO.with_(loads={"heat": TableSignal(TIMES, watts, hold=True)}, duration=float(TIMES[-1])), times=TIMES)
    rng = np.random.default_rng(1)
    nodes = ("psu", "amp") if exchanged else ("amp", "psu")
    channels = {
        f"T{k}": td.Channel.of(f"T{k}", run[n].kelvin + 0.05 * rng.standard_normal(TIMES.size), role="node", target=t, noise=0.05)
        for k, (n, t) in enumerate(zip(nodes, ("amp", "psu"), strict=True))
    }
    power = td.Channel.of("P", factor * watts, quantity="power", role="load", target="heat")
    return td.Record.from_arrays("bench", TIMES, channels | {"P": power})


def said(record: td.Record, free: list[str]) -> str:
    """Return what a fit says, or the refusal of one that ends in nonsense."""
    try:
        return str(td.calibrate(PAIR, record, free, scenario=SCENARIO, search="local"))
    except IdentificationError as refusal:
        return refusal.message


@pytest.mark.parametrize(
    ("record", "question"),
    [
        (log(exchanged=True), "are 'T0' and 'T1' exchanged?"),
        (log(1000.0), "was 'P' logged in mW, where W were taken?"),
        (log(0.001), "was 'P' logged in kW, where W were taken?"),
    ],
)
def test_what_would_explain_a_misfit_is_asked(record: td.Record, question: str) -> None:
    asked = said(record, FREE)
    assert f"{question[1:]} The residuals would then fall from " in asked


def test_nothing_is_asked_of_a_good_fit_or_a_wrong_model() -> None:
    good = td.calibrate(PAIR, log(), FREE, scenario=SCENARIO, search="local")
    assert good.reduced_chi_square < 2.0
    assert not [w for w in good.warnings if "would then fall" in w]
    wrong = td.calibrate(PAIR, log(), ["amp.capacitance"], scenario=SCENARIO, search="local")
    assert wrong.reduced_chi_square > 25.0
    assert not [w for w in wrong.warnings if "would then fall" in w]


def test_a_power_that_no_log_gives_is_named() -> None:
    told = said(log().select("T0", "T1"), ["*.conductance"])
    assert "o log gives the power of 'heat': that of the deck was taken, from beginning to end." in told


@pytest.mark.parametrize(("factor", "shown"), [(1000.0, "8000"), (0.001, "0.008")])
def test_a_power_far_from_its_deck_is_asked_for_its_unit(factor: float, shown: str) -> None:
    told = said(log(factor), ["*.conductance"])
    assert f"'P' gives 'heat' {shown} W, the deck has 8 W: is its unit right? A column in mW has unit = \"mW\" in its table" in told


def test_a_power_near_its_deck_is_not_asked_for() -> None:
    for factor in (1.0, 100.0, 0.01):
        assert "is its unit right?" not in said(log(factor), ["*.conductance"])


def test_a_fit_that_breaks_off_asks_for_the_unit_too() -> None:
    with pytest.raises(SolverError, match=r"runs away.*'P' gives 'heat' 8000000 W, the deck has 8 W: is its unit right\?"):
        td.calibrate(PAIR, log(1e6), ["*.conductance"], scenario=td.Scenario("bench", {"room": "22 [degC]"}), search="local")
