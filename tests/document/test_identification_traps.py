"""The accelerometer of Fig. 16 and what its logs cannot tell: each trap is refused or explained, with the published figures beside it.

Figures: rise 8.917191 K, time constant 1027.2604 s, 31.25 K/h without any path for the heat, a lag of 51.363 K behind a chamber at 3 K/min,
gains and delays of a sinusoidal room, errors of 0.561 % and 0.073 % from 301 readings of 0.1 K at known power.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.model.tree import Parameter, Sine

DECK = Path(__file__).parents[2] / "examples" / "01_accelerometer" / "accelerometer.toml"
HTC, MASS, TAU, RISE = "skin.effective_htc", "case.mass", 1027.2604, 8.917191
SENSOR = {"case": "0.1 [K]"}
AREA = 0.001406 + 1.08 * 0.002592


@pytest.fixture(scope="module")
def part() -> td.Model:
    """The deck with its derived values as plain numbers, so that they can be freed, and without bounds."""
    return td.load_model(DECK).with_values({"power": "0.225 [W]", "area": f"{AREA!r} [m^2]"})


def bench(**changes: object) -> td.Scenario:
    return td.Scenario("bench", boundaries={"air": "24 [degC]"}, start="24 [degC]", duration="5 [h]").with_(**changes)


def log(part: td.Model, scenario: td.Scenario) -> td.Record:
    """The readings without noise, and what a fit would be told of their noise."""
    run = td.simulate(part, scenario)
    case = td.Channel.from_array("T", run["case"].kelvin, unit="K", role="node", target="case", noise=0.1)
    room = td.Channel.from_array("ROOM", run["air"].kelvin, unit="K", role="boundary", target="air")
    return td.Record.from_arrays("log", run.times, {"T": case, "ROOM": room})


def refused(part: td.Model, scenario: td.Scenario, free: list[str]) -> str:
    given = td.Scenario("bench", loads=scenario.loads, environment=scenario.environment, start="24 [degC]", as_printed=scenario.as_printed)
    with pytest.raises(td.ThermidError) as caught:
        td.calibrate(part, log(part, scenario), free, scenario=given)
    return caught.value.message


class TestPowerMassAndConductance:
    FREE = ("power", MASS, HTC)

    def test_rank_is_two(self, part: td.Model) -> None:
        found = td.identifiability(part, free=self.FREE, scenario=bench(), sensors=SENSOR)
        assert (found.rank, found.stage, found.samples) == (2, "planned", 301)
        (group,) = found.structural
        assert group.names == self.FREE
        known = {c.text: c for c in group.known}
        assert set(known) == {f"power/{HTC}", f"{MASS}/{HTC}"}
        assert known[f"power/{HTC}"].value / AREA == pytest.approx(RISE, rel=1e-6)
        assert known[f"{MASS}/{HTC}"].value * 480.0 / AREA == pytest.approx(TAU, rel=1e-6)
        assert all(np.isinf(found[p].relative) for p in self.FREE)

    def test_in_words(self, part: td.Model) -> None:
        text = str(td.identifiability(part, free=self.FREE, scenario=bench(), sensors=SENSOR))
        assert f"'power', '{MASS}' and '{HTC}' " in text
        assert all(f"{known} = " in text for known in (f"power/{HTC}", f"{MASS}/{HTC}"))
        assert "'power' to 5 %" in text
        assert re.search("0\\.225 W .*'electronics'", text)

    def test_what_they_are_taken_from(self, part: td.Model) -> None:
        run = td.simulate(part, bench(), times=[0.0, 3600.0])
        assert run["case"].celsius[-1] == pytest.approx(32.649116, abs=1e-5)
        assert td.steady(part, bench())["case"] - 297.15 == pytest.approx(RISE, abs=1e-6)

    def test_the_fit_is_refused_and_says_what_is_known(self, part: td.Model) -> None:
        message = refused(part, bench(), list(self.FREE))
        assert message.startswith(f"'power', '{MASS}', '{HTC}' ")
        assert "'power' or " in message
        assert re.search(rf"power/{re.escape(HTC)} .* 0\.073 % \(", message)

    def test_the_cures_leave_what_a_fit_with_them_leaves(self, part: td.Model) -> None:
        found = td.identifiability(part, free=self.FREE, scenario=bench(), sensors=SENSOR)
        cure = next(c for c in found.cures if "'power'" in c.action)
        told = td.identifiability(part, free=self.FREE, scenario=bench(), sensors=SENSOR, priors={"power": ("", "5 [%]")})
        for path in (MASS, HTC):
            assert cure.errors[path] == pytest.approx(told[path].relative, rel=1e-6)
            assert cure.errors[path] == pytest.approx(0.05, rel=0.01)
        assert "'power'" in str(told)

    def test_a_step_of_known_power_is_worth_what_is_promised(self, part: td.Model) -> None:
        found = td.identifiability(part, free=self.FREE, scenario=bench(), sensors=SENSOR)
        cure = next(c for c in found.cures if "0.225 W" in c.action and "'electronics'" in c.action)
        assert max(cure.errors.values()) < 0.005


def test_w5_absolute_power_and_area_are_not_separable(part: td.Model) -> None:
    free = ("power", MASS, "area", HTC)
    found = td.identifiability(part, free=free, scenario=bench(), sensors=SENSOR)
    assert found.rank == 2
    (group,) = found.structural
    assert [c.text for c in group.known] == [f"power/(area*{HTC})", f"{MASS}/(area*{HTC})"]
    assert (group.known[0].unit, group.known[0].value) == ("K", pytest.approx(RISE, rel=1e-6))
    assert len(group.moves) == 2
    # one prior is not enough for two directions, and it is not offered as if it were
    assert all(c.action.count("'") == 4 for c in found.cures)


def test_known_power_and_three_hundred_readings(part: td.Model) -> None:
    found = td.identifiability(part, free=[MASS, HTC], scenario=bench(), sensors=SENSOR)
    assert found[MASS].relative == pytest.approx(0.00561, abs=5e-6)
    assert found[HTC].relative == pytest.approx(0.00073, abs=5e-6)
    assert (found.rank, found.groups, found.cures) == (2, (), ())
    assert found.structural == ()


def test_without_a_path_for_the_heat_only_the_rate_of_warming_shows(part: td.Model) -> None:
    vacuum = bench().vacuum(as_printed=True)
    assert td.simulate(part, vacuum)["case"].rise / 5 == pytest.approx(31.25, rel=1e-6)
    found = td.identifiability(part, free=["power", MASS, HTC], scenario=vacuum, sensors=SENSOR)
    assert found.rank == 1
    assert f"'{HTC}'" in str(found)
    assert f"power/{MASS} = 4.167" in str(found)
    assert refused(part, vacuum, [HTC]).count("'") == 2
    assert f"'{HTC}'. Fix it" in refused(part, vacuum, [HTC])


def test_a_coefficient_of_air_is_not_carried_into_vacuum_as_it_is(part: td.Model) -> None:
    with raises_code("model.needs-gas-law", match="'skin'"):
        td.simulate(part, bench().vacuum())


@pytest.mark.parametrize(("emissivity", "rise"), [("0.3", 26.2736), ("0.85", 10.0550)])
def test_in_vacuum_emissivity_and_area_are_one(part: td.Model, emissivity: str, rise: float) -> None:
    from dataclasses import replace

    pass

    skin = part.surfaces["skin"]
    shiny = replace(part, surfaces={"skin": replace(skin, fields={**skin.fields, "emissivity": Parameter.read(emissivity, "emissivity")})})
    vacuum = bench(duration="40 [h]").vacuum()
    assert td.steady(shiny, vacuum)["case"] - 297.15 == pytest.approx(rise, abs=1e-4)
    found = td.identifiability(shiny, free=["area", "skin.emissivity"], scenario=vacuum, sensors=SENSOR)
    assert [c.text for g in found.structural for c in g.known] == ["area*skin.emissivity"]
    message = refused(shiny, vacuum, ["area", "skin.emissivity"])
    assert message.startswith("'area' and 'skin.emissivity' ")
    assert "area*skin.emissivity = " in message


class TestAChamberAlone:
    """Without power, or with power that nobody metered, a moving chamber tells the time constant and nothing else."""

    def off(self, **changes: object) -> td.Scenario:
        return bench(loads={"electronics": "0 [W]"}, **changes)

    def test_ramp_of_three_kelvin_per_minute(self, part: td.Model) -> None:
        ramp = self.off(boundaries={"air": (np.array([0.0, 18000.0]), td.celsius(24.0 + np.array([0.0, 900.0])))})
        run = td.simulate(part, ramp)
        assert run["air"].kelvin[-1] - run["case"].kelvin[-1] == pytest.approx(51.363, abs=1e-3)
        message = refused(part, ramp, [MASS, HTC])
        assert message.startswith(f"'{MASS}' and '{HTC}' ")
        assert f"{MASS}/{HTC} = 0.009" in message
        found = td.identifiability(part, free=[MASS, HTC], scenario=ramp, sensors=SENSOR)
        assert found.rank == 1
        assert f"{MASS}/{HTC} = 0.009" in str(found)

    @pytest.mark.parametrize(("hours", "gain", "delay"), [(2, 0.744606, 837.495), (24, 0.997221, 1025.36)])
    def test_a_room_that_swings(self, part: td.Model, hours: int, gain: float, delay: float) -> None:
        period = 3600.0 * hours
        swing = self.off(boundaries={"air": Sine(297.15, 5.0, period, 0.0)}, duration=4 * period)
        run = td.simulate(part, swing, every=period / 2000)
        last = run.times >= 3 * period
        wave = np.column_stack([np.sin(2 * np.pi * run.times / period), np.cos(2 * np.pi * run.times / period)])[last]
        a, b = np.linalg.lstsq(wave, run["case"].kelvin[last] - 297.15, rcond=None)[0]
        assert np.hypot(a, b) / 5.0 == pytest.approx(gain, abs=2e-5)
        assert np.arctan2(-b, a) * period / (2 * np.pi) == pytest.approx(delay, abs=0.1)
        message = refused(part, swing, [MASS, HTC])
        assert f"{MASS}/{HTC} = 0.00" in message
        known = td.identifiability(part, free=[MASS, HTC], scenario=swing, sensors=SENSOR, every=period / 100).structural[0].known[0]
        assert known.text == f"{MASS}/{HTC}"

    def test_a_daily_swing_tells_the_time_constant_worse_than_a_quick_one(self, part: td.Model) -> None:
        errors = []
        for hours in (2, 24):
            swing = self.off(boundaries={"air": Sine(297.15, 5.0, 3600.0 * hours, 0.0)}, duration="48 [h]")
            errors.append(td.identifiability(part, free=[MASS], scenario=swing, sensors=SENSOR, every=600.0)[MASS].relative)
        assert errors[1] > 3 * errors[0]


def test_a_sensor_of_half_a_kelvin_knows_a_resistance_to_six_percent(part: td.Model) -> None:
    sensors = {"case": {"noise": "0.1 [K]", "accuracy": "0.5 [K]"}}
    # the start is read by the same sensor: it is no second ruler
    found = td.identifiability(part, free=[HTC, MASS], scenario=bench(start=""), sensors=sensors)
    assert found[HTC].relative == pytest.approx(0.5 / RISE, rel=0.03)
    assert found[HTC].limit == "sensor case"
