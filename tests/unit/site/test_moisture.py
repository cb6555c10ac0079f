"""Condensation along a run, against a mass balance integrated by another program, and balances that must close."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import thermid as td
from by_code import raises_code
from thermid.physics.air import (
    dew_point,
    latent_heat,
    mass_transfer_coefficient,
    saturation_pressure,
    vapour_density,
    vapour_pressure,
)

BOX = td.model_from_dict(
    {
        "title": "box",
        "needs": ["air"],
        "offers": ["case", "skin"],
        "nodes": {"case": {"capacitance": "700 [J/K]"}},
        "surfaces": {"skin": {"of": "case", "to": "air", "area": "0.08 [m^2]", "htc": "5 [W/(m^2 K)]"}},
    }
)
TRANSFER = td.Scenario("transfer", boundaries={"air": "30 [degC]"}, start="-10 [degC]", duration="3 [h]")


def balanced() -> tuple[float, float, float]:
    """Minutes below the dew point, greatest film and end temperature of the box by a balance of heat and of water."""
    vapour = float(vapour_density(vapour_pressure(303.15, 0.6), 303.15))
    dew = float(dew_point(vapour_pressure(303.15, 0.6)))

    def change(_: float, state: np.ndarray) -> list[float]:
        kelvin, film = state
        speed = float(mass_transfer_coefficient(5.0, 0.5 * (kelvin + 303.15)))
        gain = speed * (vapour - float(vapour_density(saturation_pressure(kelvin, "surface"), kelvin)))
        gain = 0.0 if film <= 0.0 and gain < 0.0 else gain
        return [(0.4 * (303.15 - kelvin) + 0.08 * gain * float(latent_heat(kelvin))) / 700.0, gain]

    warm: Any = lambda t, y: y[0] - dew  # noqa: E731
    found = solve_ivp(change, (0.0, 10800.0), [263.15, 0.0], max_step=20.0, rtol=1e-8, atol=1e-9, events=warm)
    return float(found.t_events[0][0]) / 60.0, float(found.y[1].max()), float(found.y[0][-1])


def test_a_cold_box_in_humid_air() -> None:
    """From -10 degC into 30 degC and 60 %: minutes below the dew point to 0.5 %, the film to 2 %, the end to 0.05 K."""
    minutes, film, end = balanced()
    found = td.site.moisture(BOX, TRANSFER, {"air": 0.6}, every=30.0)
    assert found["skin"].condensing / 60 == pytest.approx(minutes, rel=5e-3)
    assert found["skin"].film.max() == pytest.approx(film, rel=0.02)
    assert found.solution["case"].kelvin[-1] == pytest.approx(end, abs=0.05)
    assert found["skin"].wet > found["skin"].condensing
    assert re.search(r"21\.39 degC; .* 26\.\d min, wet ", str(found))


def film_at(pressure: float) -> float:
    """Greatest film on a cold mass so heavy that latent heat does not warm it. [kg/m^2]"""
    heavy = BOX.with_values({"case.capacitance": "1e7 [J/K]"})
    thin = TRANSFER.with_(start="5 [degC]", environment={"air": td.simulation.Environment(pressure=f"{pressure} [Pa]")})
    found = td.site.moisture(heavy, thin, {"air": 0.6})
    share = found.solution.heat_flow("skin")[-1] / (0.08 * (found.solution["case"].kelvin[-1] - 303.15)) / 5.0  # of its coefficient
    return float(found["skin"].film[-1] / share)


def test_vapour_reaches_a_surface_faster_in_thin_air() -> None:
    """h_m = h / (rho c_p) Le^(-2/3), where the density falls with pressure and the Lewis number does not: as 1/p at one h."""
    assert film_at(60e3) / film_at(101325.0) == pytest.approx(101325.0 / 60e3, rel=1e-4)


def test_latent_heat_is_that_of_the_film() -> None:
    """The polygon of latent heat holds the water that settles and dries, in steps of 2 min as in steps of 5 s."""
    cold = TRANSFER.with_(start="5 [degC]")
    for every in (120.0, 5.0):
        skin = td.site.moisture(BOX, cold, {"air": 0.6}, every=every)["skin"]
        assert skin.film[-1] == 0.0
        assert skin.film.max() > 0.01
        assert abs(skin.heat) < 0.02 * 0.08 * skin.film.max() * 2.48e6  # the heat of evaporation falls by 1 % in 10 K


def test_another_gas_than_air_is_refused() -> None:
    helium = TRANSFER.with_(environment={"air": td.simulation.Environment(gas="He")})
    skin = {"of": "case", "to": "air", "area": "0.08 [m^2]", "htc": {"length": "0.2 [m]"}}
    box = td.model_from_dict({"title": "b", "needs": ["air"], "nodes": {"case": {"capacitance": "700 [J/K]"}}, "surfaces": {"skin": skin}})
    with raises_code("model.element-not-supported", match="'air'"):
        td.site.moisture(box, helium, {"air": 0.6})


def test_vapour_that_is_not_dilute_is_said() -> None:
    """At 15 kPa a sixth of the gas is vapour: the analogy leaves the stream out that it makes."""
    thin = TRANSFER.with_(start="5 [degC]", environment={"air": td.simulation.Environment(pressure="15 [kPa]")})
    found = td.site.moisture(BOX.with_values({"case.capacitance": "1e7 [J/K]"}), thin, {"air": 0.6})
    assert re.search(r"1\d % .*'air', .* \d %", str(found).splitlines()[1])


def test_latent_heat_matters() -> None:
    """Without it the box would stay below the dew point for tau ln(40 / 8.61) = 44.8 minutes, with it for 26."""
    assert td.site.moisture(BOX, TRANSFER, {"air": 0.6})["skin"].condensing < 0.65 * 60 * 44.8
    dry = td.simulate(BOX, TRANSFER, every=60.0)
    above = dry["case"].kelvin > float(dew_point(vapour_pressure(303.15, 0.6)))
    assert dry.times[above.argmax()] / 60 == pytest.approx(44.8, abs=1.0)


def test_nothing_settles_on_a_warm_box() -> None:
    """A box above the dew point stays dry, and its temperatures are those of the run without moisture, bit for bit."""
    warm = TRANSFER.with_(start="25 [degC]")
    found = td.site.moisture(BOX, warm, {"air": 0.5})
    assert found["skin"].film.max() == found["skin"].wet == found["skin"].condensing == 0.0
    assert found["skin"].latent.max() == 0.0
    assert (found["skin"].margin > 0.0).all()
    assert found.solution["case"].kelvin == pytest.approx(td.simulate(BOX, warm, every=60.0)["case"].kelvin, abs=1e-9)


def test_air_that_becomes_humid() -> None:
    """Humidity as a signal: the dew point passes the box's temperature when the formula says so."""
    rising = {"times": ["0 [h]", "1 [h]"], "values": ["0.2", "1.0"]}
    settled = TRANSFER.with_(start="20 [degC]", duration="1 [h]", boundaries={"air": "20 [degC]"})
    box = BOX.with_values({"skin.htc": "1e-9 [W/(m^2 K)]"})
    found = td.site.moisture(box, settled, {"air": rising})
    assert found["skin"].margin[-1] == pytest.approx(0.0, abs=1e-3)
    assert found["skin"].margin[0] == pytest.approx(293.15 - float(dew_point(vapour_pressure(293.15, 0.2))), abs=1e-6)


CASE = td.model_from_dict(
    {
        "title": "case with air inside",
        "needs": ["air"],
        "nodes": {"wall": {"capacitance": "200 [J/K]"}, "inside": {"capacitance": "5 [J/K]"}},
        "surfaces": {
            "outer": {"of": "wall", "to": "air", "area": "0.05 [m^2]", "htc": "10 [W/(m^2 K)]"},
            "inner": {"of": "wall", "to": "inside", "area": "0.05 [m^2]", "htc": "5 [W/(m^2 K)]"},
        },
    }
)
COOLING = td.Scenario("cooling", boundaries={"air": "5 [degC]"}, start="30 [degC]", duration="2 [h]")


def test_a_sealed_volume_keeps_its_water() -> None:
    """What leaves the gas lies on the wall, to 1e-6 of it, and the gas ends saturated at the wall."""
    volume = td.site.Volume("2 [l]", humidity=0.7)
    found = td.site.moisture(CASE, COOLING, {}, {"inside": volume})
    gas = vapour_density(saturation_pressure(found.dew_points["inside"], "surface"), found.solution["inside"].kelvin)
    whole = 2e-3 * gas + 0.05 * found["inner"].film
    assert whole == pytest.approx(np.full(whole.size, whole[0]), rel=1e-6)
    assert found["inner"].margin[-1] == pytest.approx(0.0, abs=0.02)
    assert found["inner"].film[-1] > 0.0


def test_a_vented_volume_follows_the_outside() -> None:
    """Its vapour goes to that of the outside with the time constant of its exchange."""
    dry = COOLING.with_(boundaries={"air": "30 [degC]"}, duration="1 [h]")
    vented = td.site.Volume("2 [l]", exchange="0.001 [l/s]", to="air", humidity=0.2)
    found = td.site.moisture(CASE, dry, {"air": 0.6}, {"inside": vented}, every=10.0)
    inside = saturation_pressure(found.dew_points["inside"])
    full = saturation_pressure(303.15)
    wanted = full * (0.6 - 0.4 * np.exp(-found.solution.times / 2000.0))
    assert inside == pytest.approx(wanted, rel=2e-3)


def test_no_vapour_in_vacuum() -> None:
    """A gas that is gone has no dew point."""
    skin = {"of": "case", "to": "air", "area": "0.08 [m^2]", "htc": "5 [W/(m^2 K)]", "emissivity": 0}
    space = td.model_from_dict(
        {"title": "box", "needs": ["air"], "nodes": {"case": {"capacitance": "700 [J/K]"}}, "surfaces": {"skin": skin}}
    )
    found = td.site.moisture(space, TRANSFER.vacuum().with_(start="20 [degC]"), {"air": 0.9})
    assert found.dew_points["air"] == pytest.approx(0.0)
    assert found["skin"].film.max() == 0.0
    (skin,) = (line for line in str(found).splitlines() if line.startswith("  skin "))
    assert not re.search(r"\d", skin)


@pytest.mark.parametrize(
    ("humidity", "volumes", "code", "match"),
    [
        ({}, {}, "value.incomplete", "'air'"),
        ({"air": 1.2}, {}, "value.outside-range", r"'air'.*1\.2.*0.*1"),
        ({"air": -0.1}, {}, "value.outside-range", r"-0\.1"),
        ({"wall": 0.5}, {}, "name.unknown", "'wall'"),
        ({"airr": 0.5}, {}, "name.unknown", "'airr'.*'air'"),
        ({}, {"inside": {"volume": "2 [l]", "exchange": "1 [l/s]", "to": "air"}}, "run.input-missing", "'air'"),
        ({}, {"inside": {"volume": "2 [l]", "exchange": "1 [l/s]"}}, "value.incomplete", ""),
        ({}, {"inside": {"volume": "0 [l]"}}, "value.outside-range", ""),
        ({}, {"inside": {"volume": "1 [l]", "humidity": 1.5}}, "value.outside-range", r"1\.5.*0.*1"),
    ],
)
def test_faults(humidity: dict[str, Any], volumes: dict[str, dict[str, Any]], code: str, match: str) -> None:
    """What is wrong and what to do."""
    with raises_code(code, match=match):
        td.site.moisture(CASE, COOLING, humidity, {k: td.site.Volume(**v) for k, v in volumes.items()})


def test_an_unknown_surface() -> None:
    """The nearest one is named."""
    with raises_code("name.unknown", match="'skim'.*'skin'"):
        td.site.moisture(BOX, TRANSFER.with_(duration="1 [min]"), {"air": 0.5})["skim"]


def test_the_humidity_of_a_scenario_counts_in_python_as_on_the_command_line() -> None:
    """It had to be given again, though the scenario stated it."""
    brief = TRANSFER.with_(duration="30 [min]")
    given = td.site.moisture(BOX, brief, {"air": 0.6})["skin"].margin
    stated = brief.with_(environment={"air": td.simulation.Environment(humidity=0.6)})
    assert td.site.moisture(BOX, stated)["skin"].margin == pytest.approx(given)
    assert td.site.moisture(BOX, stated, {"air": 0.3})["skin"].margin.min() > given.min() + 5.0
