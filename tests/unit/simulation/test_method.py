"""Which method a run takes, and what it says about it."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import ScenarioError, SolverError
from thermid.model.tree import TableSignal


def _model(**law: Any) -> td.Model:
    link = {"kind": "conduction", "between": ["case", "air"], "conductance": "0.5 [W/K]"} | law
    return td.model_from_dict(
        {
            "title": "Box",
            "needs": ["air"],
            "nodes": {"case": {"capacitance": "100 [J/K]"}},
            "conductors": {"skin": link},
            "loads": {"heater": {"into": "case", "power": "5 [W]"}},
        }
    )


def _scenario(**more: Any) -> td.Scenario:
    return td.Scenario("bench", **({"boundaries": {"air": "290 [K]"}, "start": "290 [K]", "duration": 1000.0} | more))


RADIATING = {"kind": "radiation", "emissivity": 0.8, "area": "0.1 [m^2]"}


def test_a_linear_network_goes_by_modes() -> None:
    found = td.simulate(_model(), _scenario())
    assert found.statistics["method"] == "modal"
    assert found["case"].kelvin == pytest.approx(290 + 10 * -np.expm1(-found.times / 200), abs=1e-11)


def test_temperatures_are_good_to_a_tenth_of_a_millikelvin_unless_asked_otherwise() -> None:
    """The run that is asked for that error is the one that nobody asked anything; of another error the steps are others."""
    model, scenario = _model(conductance=None, **RADIATING), _scenario()
    usual, asked, wider = (td.simulate(model, scenario, options=o) for o in (None, td.Options("0.1 [mK]"), td.Options("0.12 [mK]")))
    assert np.array_equal(usual["case"].kelvin, asked["case"].kelvin)
    assert not np.array_equal(wider["case"].kelvin, asked["case"].kelvin)


def test_the_integrator_can_be_asked_for() -> None:
    found = td.simulate(_model(), _scenario(), options=td.Options(method="integrator"))
    assert (found.statistics["method"], found.statistics["reason"]) == ("integrator", "asked for")


@pytest.mark.parametrize(
    ("model", "scenario"),
    [
        (_model(conductance=None, **RADIATING), _scenario()),
        (
            _model(),
            _scenario(schedule={"skin.conductance": {"times": ["0 [s]", "500 [s]"], "values": ["0.5 [W/K]", "1 [W/K]"], "hold": True}}),
        ),
    ],
)
def test_what_has_no_modes_is_refused_in_words(model: td.Model, scenario: td.Scenario) -> None:
    found = td.simulate(model, scenario)
    assert found.statistics["method"] == "integrator"
    assert "'skin'" in found.statistics["reason"]
    with pytest.raises(ScenarioError, match=re.escape(str(found.statistics["reason"]))):
        td.simulate(model, scenario, options=td.Options(method="modal"))


def test_other_reasons() -> None:
    simulator = td.prepare(_model(), _scenario(), ["skin.conductance"])
    assert simulator.run().statistics["method"] == "modal"
    assert simulator.run(sensitivities=True).statistics["method"] == "integrator"
    with raises_code("name.unknown", ScenarioError):
        td.simulate(_model(), _scenario(), options=td.Options(method="exact"))


def test_irregular_samples_are_left_to_the_integrator() -> None:
    """Every stretch of another length needs exponentials of its own."""
    rng = np.random.default_rng(5)
    times = np.sort(rng.uniform(0.0, 1000.0, 20000))
    jitter = TableSignal(times, 290 + rng.standard_normal(times.size))
    regular = TableSignal(np.linspace(0.0, 1000.0, 1001), 290 + rng.standard_normal(1001))
    found = [td.simulate(_model(), _scenario(boundaries={"air": table})) for table in (jitter, regular)]
    modes, steps = map(float, re.findall(r"([\d.]+) ms", str(found[0].statistics["reason"])))
    assert modes > steps
    assert found[1].statistics["method"] == "modal"


@pytest.mark.parametrize("noise", [0.005, 0.05, 0.5])
def test_the_steps_that_noise_asks_for_are_foreseen(noise: float) -> None:
    """By counts, not by time: what the choice of method reckons with against what the integrator does."""
    times = np.linspace(0.0, 5000.0, 5001)
    room = TableSignal(times, 290 + noise * np.random.default_rng(3).standard_normal(times.size))
    scenario = _scenario(boundaries={"air": room}, duration=5000.0)
    simulator = td.prepare(_model(conductance="10 [W/K]"), scenario, every=60.0, options=td.Options(method="integrator"))
    work, steps = simulator.engine.modal.work(times[::60], 5000.0), simulator.run().statistics["steps"]
    print(f"{steps} steps; foreseen {work.steps:.0f}")
    assert steps / 4 < work.steps < 3 * steps


@pytest.mark.parametrize("size", [2, 12])
def test_a_noisy_log_goes_by_modes(size: int) -> None:
    """By steps such logs take 3 to 13 times as long (benchmarks/methods.py)."""
    nodes = {f"n{k}": {"capacitance": f"{30 + 20 * k} [J/K]"} for k in range(size)}
    pairs = [(f"n{k}", f"n{k + 1}") for k in range(size - 1)] + [(f"n{k}", "air") for k in range(size)]
    links = {f"c{k}": {"kind": "conduction", "between": list(pair), "conductance": "0.5 [W/K]"} for k, pair in enumerate(pairs)}
    model = td.model_from_dict({"title": "Chain", "needs": ["air"], "nodes": nodes, "conductors": links})
    room = TableSignal(np.linspace(0.0, 3600.0, 3601), 290 + 0.05 * np.random.default_rng(3).standard_normal(3601))
    for times in (np.arange(0.0, 3600.0, 60.0), np.sort(np.random.default_rng(4).uniform(0.0, 3600.0, 200))):
        found = td.simulate(model, _scenario(boundaries={"air": room}, duration=3600.0), times=times)
        assert found.statistics["method"] == "modal", found.statistics["reason"]


def test_a_failure_says_where_and_when() -> None:
    with raises_code("run.did-not-finish", SolverError, match="1000 s"):
        td.simulate(_model(), _scenario(loads={"heater": "-300 [W]"}), times=[1.0, 1000.0])
