"""Which steady state of a block: an instant that is named, means, levels, and the state that comes back; beside its model."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code

CELLS = (6, 4, 2)
NODES = [f"c{i}_{j}_{k}" for i in range(6) for j in range(4) for k in range(2)]
AIR = {"mean": "20 [degC]", "amplitude": "10 [K]", "period": "1 [h]"}
PULSE = {"times": ["0 [min]", "12 [min]", "60 [min]"], "values": [1, 0, 1], "hold": True, "after": "repeat"}


def plate(emissivity: float = 0.8) -> td.Block:
    """A plate with a chip, in air on both sides, its edge on a base."""
    size = ("120 [mm]", "80 [mm]", "4 [mm]")
    block = td.Block(size, CELLS, conductivity="20 [W/(m K)]", density="2700 [kg/m^3]", specific_heat="900 [J/(kg K)]", title="plate")
    block = block.heated("chip", "12 [W]", cells=np.s_[1:3, 1:3, :])
    film = {"coefficient": "1.5 [W/(m^2 K)]", "exponent": 0.25}
    return block.exchanging("-z +z", "air", htc=film, emissivity=emissivity).held("+x", "base", contact="50 [W/(m^2 K)]")


def course(names: list[str], **more: Any) -> td.Scenario:
    """An hour of air and of pulses, for heaters by name."""
    given = {"boundaries": {"air": AIR, "base": "15 [degC]"}, "commands": dict.fromkeys(names, PULSE), "duration": "1 [h]"}
    return td.Scenario(**(given | more))


def model() -> tuple[td.Model, list[str]]:
    """The same plate as a model of nodes, and its loads."""
    whole = plate().model()
    return whole, list(whole.loads)


def test_the_inputs_of_the_start_were_held_without_a_word() -> None:
    """60 K above the mean for a heater that is on for a fifth of the time: steady and a steady start name the instant."""
    found = td.steady(plate(), course(["chip"]))
    assert any(re.search(r" 0 s, .*air, chip ", w) for w in found.warnings)
    late = td.steady(plate(), course(["chip"]), "30 [min]")
    assert any("1800 s" in w for w in late.warnings)
    assert found["hottest"].final > late["hottest"].final + 10.0
    run = td.simulate(plate(), course(["chip"], start="steady"))
    assert any(" 0 s, " in w for w in run.warnings)
    assert td.steady(plate(), td.Scenario(boundaries={"air": "20 [degC]", "base": "15 [degC]"})).warnings == ()


@pytest.mark.parametrize("start", ["steady", "steady, 30 [min]", "steady, mean", "periodic"])
def test_every_start_is_that_of_the_model(start: str) -> None:
    whole, loads = model()
    options = td.Options(error=2e-4)
    block = td.simulate(plate(), course(["chip"], start=start), fields=(0.0, 3600.0), options=options)
    nodes = td.simulate(whole, course(loads, start=start), times=np.array([0.0, 3600.0]))
    assert np.abs(block.fields.reshape(2, -1) - np.column_stack([nodes[n].kelvin for n in NODES])).max() < 2e-3
    if start == "periodic":
        assert np.abs(block.fields[1] - block.fields[0]).max() < 1e-3
        assert block.statistics["start"]["periods"] < 10
        assert block.heat_balance().relative < 1e-9
    else:
        assert block.warnings


def test_means_levels_and_the_period_are_those_of_the_model() -> None:
    whole, loads = model()
    mean = td.steady(plate(), course(["chip"]), "mean")
    assert any("3600 s of air" in w for w in mean.warnings)
    own = td.steady(whole, course(loads), "mean")
    assert np.abs(mean.final_field.ravel() - [own[n] for n in NODES]).max() < 1e-3
    period = td.steady(plate(), course(["chip"]), "periodic")
    high = td.steady(whole, course(loads), "periodic").highest
    assert period["hottest"].highest == pytest.approx(max(high[n] for n in NODES) - 273.15, abs=0.02)
    assert (period.times[0], period.times[-1]) == (0.0, 3600.0)
    still = {"boundaries": {"air": "20 [degC]", "base": "15 [degC]"}}
    levels = td.simulation.steady_levels(plate(), course(["chip"], **still))
    expected = td.simulation.steady_levels(whole, course(loads, **still))
    assert len(levels) == len(expected) == 2
    for one, other in zip(levels, expected, strict=True):
        assert np.abs(one.final_field.ravel() - [other[n] for n in NODES]).max() < 1e-3


def test_a_plate_that_takes_hours_comes_back_after_minutes() -> None:
    """A time constant of twenty periods, and cells that follow within seconds."""
    size = ("120 [mm]", "80 [mm]", "40 [mm]")
    heavy = td.Block(size, (6, 4, 8), conductivity="20 [W/(m K)]", density="2700 [kg/m^3]", specific_heat="900 [J/(kg K)]", title="heavy")
    heavy = heavy.heated("chip", "60 [W]", cells=np.s_[1:3, 1:3, 7:]).exchanging("all", "air", htc="15 [W/(m^2 K)]", emissivity=0.8)
    short = PULSE | {"times": ["0 [min]", "1 [min]", "5 [min]"]}
    given = {"boundaries": {"air": "20 [degC]"}, "commands": {"chip": short}, "duration": "5 [min]"}
    run = td.simulate(heavy, td.Scenario(start="periodic", **given), fields=(0.0, 300.0), options=td.Options(error=2e-4))
    assert np.abs(run.fields[1] - run.fields[0]).max() < 1e-3
    balance = run.heat_balance()
    assert balance.loads == pytest.approx(60.0 * 60.0, rel=1e-6)
    assert balance.boundaries == pytest.approx(balance.loads, rel=1e-3)


def test_the_periodic_state_of_constant_inputs_is_the_steady_one() -> None:
    still = {"boundaries": {"air": "20 [degC]", "base": "15 [degC]"}, "commands": {}}
    runs = [td.simulate(plate(), course(["chip"], **still, start=start), fields=(0.0,)) for start in ("periodic", "steady")]
    assert runs[0].fields[0] == pytest.approx(runs[1].fields[0], abs=1e-9)


WRONG = {
    "longer than the run": ({"duration": "30 [min]", "start": "periodic"}, "value.outside-range", "3600 s, .* 1800 s"),
    "after the end": ({"start": "steady, 2 [h]"}, "value.outside-range", "7200 s, .* 3600 s"),
    "no period": (
        {
            "boundaries": {"air": {"times": ["0 [h]", "1 [h]"], "values": ["20 [degC]", "30 [degC]"]}, "base": "15 [degC]"},
            "start": "periodic",
        },
        "run.no-periodic-state",
        "air, chip .*'repeat'",
    ),
    "initial": ({"start": "periodic", "initial": {"cell[0,0,0]": "30 [degC]"}}, "value.excludes-another", "'initial'"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_does_not_come_back_is_refused(case: str) -> None:
    more, code, match = WRONG[case]
    with raises_code(code, match=match):
        td.simulate(plate(), course(["chip"], **more))


def test_a_block_without_a_boundary_has_none() -> None:
    alone = td.Block(("10 [mm]",) * 3, (2, 2, 2), "20 [W/(m K)]", "2700 [kg/m^3]", "900 [J/(kg K)]").heated(
        "chip", "1 [W]", cells=np.s_[:, :, :]
    )
    for start in ("periodic", "steady, mean"):
        with raises_code("run.no-steady-state", td.ThermidError):
            td.simulate(alone, td.Scenario(commands={"chip": PULSE}, start=start, duration="1 [h]"))
