"""Inputs that would fill the memory, or are of the wrong kind, are refused in words."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code


def plate(**load: Any) -> td.Model:
    lost = {"kind": "contact", "between": ["body", "air"], "contact_conductance": "1 [W/(m^2 K)]", "area": "1 [m^2]"}
    heat = {"into": "body", "power": "1 [W]", **load}
    deck = {"title": "plate", "needs": ["air"], "nodes": {"body": {"capacitance": "50 [J/K]"}}}
    return td.model_from_dict({**deck, "conductors": {"lost": lost}, "loads": {"heat": heat}})


def test_a_period_that_nobody_can_sample() -> None:
    fast = {"mean": "1 [W/(m^2 K)]", "amplitude": "0.1 [W/(m^2 K)]", "period": "1e-7 [h]"}
    given = td.Scenario("fast", boundaries={"air": "20 [degC]"}, start="25 [degC]", duration="10 [h]")
    with raises_code("cap.exceeded", match=r"0\.00036.*4e\+10.*5e\+06"):
        td.simulate(plate(), given.with_(schedule={"lost.contact_conductance": fast}))
    with raises_code("cap.exceeded", match=r"0\.00036.*3e\+08"):
        td.simulate(plate(periodic={"period": "1e-7 [h]", "duty": 0.5}), given)


def test_an_environment_is_no_dictionary() -> None:
    with raises_code("value.wrong-kind", match=r"environment\.air.*td\.simulation\.Environment"):
        td.Scenario("plate", boundaries={"air": "20 [degC]"}, environment={"air": {"pressure": "1 [atm]"}})  # type: ignore[dict-item]


def test_a_prior_may_be_written_as_in_a_campaign() -> None:
    course = td.Scenario("cooling", boundaries={"air": "20 [degC]"}, start="25 [degC]", duration="10 [min]")
    run = td.simulate(plate(), course, times=np.arange(0.0, 601.0, 20.0))
    channel = td.Channel.from_array("T", run["body"].kelvin, unit="K", role="node", target="body", noise=0.1)
    log = td.Record.from_arrays("log", run.times, {"T": channel})
    name = "lost.contact_conductance"
    tight = {"mean": "1.2 [W/(m^2 K)]", "sd": "0.001 [W/(m^2 K)]"}
    as_dict, as_pair = (td.calibrate(plate(), log, [name], scenario=course, priors={name: p}) for p in (tight, tuple(tight.values())))  # type: ignore[dict-item]
    assert as_dict[name].value == as_pair[name].value == pytest.approx(1.2, abs=0.01)
    with pytest.raises(td.ThermidError, match="sd"):
        td.calibrate(plate(), log, [name], scenario=course, priors={name: {"mean": "1 [W/(m^2 K)]"}})  # type: ignore[dict-item]
