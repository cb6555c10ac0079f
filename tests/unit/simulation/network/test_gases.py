"""Gas from one atmosphere to vacuum: gaps, correlations, fitted values thinned, volumes that are vented or sealed, in time."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import DeckError, ScenarioError, code_of
from thermid.base.units import ATMOSPHERE, STANDARD_GRAVITY
from thermid.model._tree.identity import to_dict
from thermid.model.tree import Constant, TableSignal
from thermid.physics.correlations import forced_plate_nusselt
from thermid.physics.gas import GASES, gap_htc, knudsen_number
from thermid.physics.plates import body_htc, horizontal_plate_down_htc, horizontal_plate_up_htc, vertical_plate_htc_all
from thermid.simulation._network.environment import FAN_EXPONENT
from thermid.simulation._network.medium import sampled_pressure, vented
from thermid.simulation._solver.engine import Engine
from thermid.simulation._solver.wiring import Wiring

AIR = GASES["air"]
BENCH = td.Scenario("bench", boundaries={"air": "300 [K]"}, start="air", duration="2 [h]")


def at(pressure: Any, **more: Any) -> td.Scenario:
    """The bench at a pressure [Pa]."""
    given = pressure if isinstance(pressure, TableSignal) else Constant(float(pressure))
    return BENCH.with_(environment={"*": td.simulation.Environment(given, **more)})


def box(skin: dict[str, Any] | None = None, links: dict[str, Any] | None = None, power: str = "2 [W]", needs: Any = ("air",)) -> td.Model:
    """A node with a surface of 400 cm^2 or links to its surroundings."""
    surface = {"skin": {"of": "case", "to": "air", "area": "0.04 [m^2]"} | skin} if skin else {}
    return td.model_from_dict(
        {
            "title": "Box",
            "needs": [*needs],
            "nodes": {"case": {"capacitance": "100 [J/K]"}},
            "surfaces": surface,
            "conductors": {n: {"between": ["case", "air"]} | c for n, c in (links or {}).items()},
            "loads": {"heat": {"into": "case", "power": power}},
        }
    )


def plates(gap: str, **more: Any) -> td.Model:
    return box(links={"gap": {"kind": "gas", "area": "0.04 [m^2]", "gap": gap} | more}, power="1e-6 [W]")


def settled(model: td.Model, scenario: td.Scenario) -> float:
    """The coefficient that a settled run shows. [W/(m^2 K)]"""
    rise = td.steady(model, scenario)["case"] - 300.0
    power = td.simulation.compile_network(model).numbers().values["heat.power"]
    return float(power / 0.04 / rise)


# gaps ----------------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("gap", [1e-4, 1e-3, 1e-2])
def test_a_gap_from_one_atmosphere_to_vacuum(gap: float) -> None:
    """Both limits to 1 % where the Knudsen number says that they hold, monotone, half the value at the closed-form pressure."""
    model = plates(f"{gap} [m]", accommodation=0.9)
    pressures = np.geomspace(1e-4, ATMOSPHERE, 28)
    found = np.array([settled(model, at(p)) for p in pressures])
    assert (np.diff(found) > 0).all()
    thin, thick = 0, 0
    for p, h in zip(pressures, found, strict=True):
        knudsen = float(knudsen_number(AIR, 300.0, p, gap))
        if knudsen < 1e-3:
            assert h == pytest.approx(AIR.k(300.0) / gap, rel=0.01)
            thick += 1
        if knudsen > 1e3:
            assert h == pytest.approx(AIR.free_molecular_htc(300.0, p, 0.9), rel=0.01)
            thin += 1
    assert thin + thick >= 2
    assert found[0] == pytest.approx(AIR.free_molecular_htc(300.0, 1e-4, 0.9), rel=0.01)
    assert found[-1] == pytest.approx(AIR.k(300.0) / gap, rel=0.01)
    half = float(AIR.k(300.0) / gap / AIR.free_molecular_htc(300.0, 1.0, 0.9))  # both resistances are equal
    assert settled(model, at(half)) == pytest.approx(0.5 * AIR.k(300.0) / gap, rel=1e-4)


def test_a_gap_holds_its_own_gas_and_that_of_the_scenario() -> None:
    helium = settled(plates("1 [mm]", gas="He", accommodation=0.4), at(100.0))
    assert helium == pytest.approx(gap_htc(GASES["He"], 300.0, 100.0, 1e-3, 0.4), rel=1e-3)
    argon = settled(plates("1 [mm]"), at(ATMOSPHERE, gas="Ar"))
    assert argon == pytest.approx(gap_htc(GASES["Ar"], 300.0, ATMOSPHERE, 1e-3, 0.9), rel=1e-3)


def test_a_gap_follows_the_mean_temperature() -> None:
    """The heat flow at 400 K over 300 K is that of the properties at 350 K."""
    model = td.model_from_dict(
        {
            "title": "Plates",
            "needs": ["a", "b"],
            "nodes": {"by": {"capacitance": "1 [J/K]"}},
            "conductors": {"gap": {"kind": "gas", "between": ["a", "b"], "area": "1 [m^2]", "gap": "1 [mm]"}},
        }
    )
    for p in (ATMOSPHERE, 30.0):
        given = {"*": td.simulation.Environment(Constant(p))}
        run = td.simulate(model, td.Scenario("x", {"a": "400 [K]", "b": "300 [K]"}, environment=given, start="300 [K]", duration=1.0))
        assert run.heat_flow("gap")[-1] == pytest.approx(100.0 * gap_htc(AIR, 350.0, p, 1e-3, 0.9), rel=5e-3)


def test_a_joint_has_contact_gas_and_radiation_apart() -> None:
    contact = {"kind": "contact", "area": "0.04 [m^2]", "contact_conductance": "50 [W/(m^2 K)]", "gap": "0.1 [mm]", "exchange_factor": 0.1}
    model = box(links={"joint": contact})
    gas, radiation = AIR.k(300.0) / 1e-4, 0.1 * 4 * 5.670374419e-8 * 300.0**3
    assert settled(model, at(ATMOSPHERE)) == pytest.approx(50.0 + gas + radiation, rel=5e-3)
    assert settled(model, at(0.0)) == pytest.approx(50.0 + radiation, rel=5e-3)


def test_contact_from_pressure_hardness_and_finish() -> None:
    given = {"contact_pressure": "1 [MPa]", "hardness": "1.1 [GPa]", "roughness": "1 [um]", "slope": 0.1, "conductivity": "180 [W/(m K)]"}
    model = box(links={"joint": {"kind": "contact", "area": "0.04 [m^2]"} | given})
    assert settled(model, BENCH) == pytest.approx(29031.0, rel=1e-4)


@pytest.mark.parametrize(
    ("link", "message"),
    [
        ({"kind": "gas", "area": "1 [m^2]", "gap": "0 [mm]"}, "'c.gap' is 0 m"),
        ({"kind": "gas", "area": "1 [m^2]", "gap": "1 [mm]", "accommodation": 1.2}, "'c.accommodation' is 1.2."),
        ({"kind": "gas", "area": "1 [m^2]", "gap": "1 [mm]", "gas": "neon"}, "unknown gas 'neon'. Known: air, N2"),
        ({"kind": "gas", "area": "1 [m^2]"}, "needs area and gap"),
        ({"kind": "conduction", "conductance": "1 [W/K]", "gas": "air"}, "a conductor of kind 'conduction' has no gas"),
    ],
)
def test_gaps_that_cannot_be(link: dict[str, Any], message: str) -> None:
    with pytest.raises(DeckError, match=message.replace(".", r"\.")):
        td.simulation.compile_network(box(links={"c": link}))


# correlations --------------------------------------------------------------------------------------------------------------------

SIDES = {
    "vertical": lambda hot, cold, air: vertical_plate_htc_all(hot, cold, 0.1, air, STANDARD_GRAVITY),
    "up": lambda hot, cold, air: (horizontal_plate_up_htc if hot > cold else horizontal_plate_down_htc)(
        hot, cold, 0.1, air, STANDARD_GRAVITY
    ),
    "down": lambda hot, cold, air: (horizontal_plate_down_htc if hot > cold else horizontal_plate_up_htc)(
        hot, cold, 0.1, air, STANDARD_GRAVITY
    ),
}


@pytest.mark.parametrize("power", ["2 [W]", "-2 [W]"])
@pytest.mark.parametrize("orientation", SIDES)
def test_a_surface_convects_as_its_correlation_says(orientation: str, power: str) -> None:
    """To half a per cent at the film temperature, warm or cold, whichever way it faces."""
    model = box({"htc": {"length": "0.1 [m]", "orientation": orientation}}, power=power)
    case = td.steady(model, BENCH)["case"]
    expected = SIDES[orientation](case, 300.0, AIR.at((case + 300.0) / 2))
    assert settled(model, BENCH) == pytest.approx(float(expected), rel=5e-3)


def test_a_correlation_at_another_film_temperature_and_gravity() -> None:
    model = box({"htc": {"length": "0.2 [m]"}}, power="6 [W]")
    scenario = at(ATMOSPHERE, gravity=1.62).with_(boundaries={"air": "350 [K]"})
    case = td.steady(model, scenario)["case"]
    expected = vertical_plate_htc_all(case, 350.0, 0.2, AIR.at((case + 350.0) / 2), 1.62)
    assert 6.0 / 0.04 / (case - 350.0) == pytest.approx(float(expected), rel=0.01)


def test_external_convection_goes_with_the_root_of_the_pressure_down_to_conduction() -> None:
    model = box({"htc": {"correlation": "Nu_body", "length": "0.2 [m]"}})
    thin = [settled(model, at(p)) for p in (ATMOSPHERE, 1e4, 1e3, 100.0, 10.0, 0.1)]
    assert thin == sorted(thin, reverse=True)
    case = 300.0 + 2.0 / 0.04 / thin[1]
    assert thin[1] == pytest.approx(float(body_htc(case, 300.0, 0.04, AIR.at((case + 300.0) / 2, 1e4))), rel=0.01)
    case = 300.0 + 2.0 / 0.04 / thin[3]
    assert thin[3] == pytest.approx(float(body_htc(case, 300.0, 0.04, AIR.at((case + 300.0) / 2, 100.0))), rel=0.02)
    assert thin[5] < 0.2 * 3.47 * AIR.k(300.0) / 0.2


def test_a_function_of_the_library_serves_by_its_name() -> None:
    ht = pytest.importorskip("ht")
    model = box({"htc": {"correlation": "Nu_horizontal_cylinder_Churchill_Chu", "length": "0.05 [m]"}})
    case = td.steady(model, BENCH)["case"]
    air = AIR.at((case + 300.0) / 2)
    grashof = STANDARD_GRAVITY * air.expansion * (case - 300.0) * 0.05**3 / air.kinematic_viscosity**2
    expected = ht.Nu_horizontal_cylinder_Churchill_Chu(air.prandtl, grashof) * air.conductivity / 0.05
    assert settled(model, BENCH) == pytest.approx(expected, rel=5e-3)


def test_wind_adds_by_the_third_power() -> None:
    model = box({"htc": {"length": "0.2 [m]"}})
    still, windy = settled(model, BENCH), settled(model, at(ATMOSPHERE, wind=3.0))
    forced = 0.664 * (3.0 * 0.2 / AIR.at(300.0).kinematic_viscosity) ** 0.5 * AIR.at(300.0).prandtl ** (1 / 3) * AIR.k(300.0) / 0.2
    assert windy == pytest.approx((forced**3 + still**3) ** (1 / 3), rel=0.03)


LONG = np.array([0.0, 3600.0, 3601.0, 40 * 3600.0])


@pytest.mark.parametrize("speed", [0.0, 0.2, 1.0, 2.5, 7.0])
def test_wind_in_time_is_that_of_a_constant_one(speed: float) -> None:
    """After a storm of 8 m/s the wind is another; what a run settles at is what a constant wind gives."""
    model = box({"htc": {"length": "5 [cm]"}})
    gust = at(ATMOSPHERE, wind=TableSignal(LONG, np.array([8.0, 8.0, speed, speed]))).with_(duration="30 [h]")
    run = td.simulate(model, gust)
    steady = td.steady(model, at(ATMOSPHERE, wind=speed))["case"]
    assert run["case"].kelvin[-1] - 300.0 == pytest.approx(steady - 300.0, rel=0.02)
    storm = td.steady(model, at(ATMOSPHERE, wind=8.0))["case"]
    assert run["case"].kelvin[10] - 300.0 == pytest.approx(storm - 300.0, rel=1e-6)  # a level of its own
    assert run.heat_balance().relative < 1e-6


def test_wind_thins_with_its_gas() -> None:
    model = box({"htc": {"length": "5 [cm]"}})
    for low in (3e4, 1e3):
        pumped = at(TableSignal(LONG, np.array([ATMOSPHERE, ATMOSPHERE, low, low])), wind=3.0).with_(duration="30 [h]")
        found = td.simulate(model, pumped)["case"].kelvin[-1] - 300.0
        assert found == pytest.approx(td.steady(model, at(low, wind=3.0))["case"] - 300.0, rel=0.02)
    model = box({"htc": {"length": "5 [cm]"}, "emissivity": 0})
    empty = at(TableSignal(LONG, np.array([ATMOSPHERE, ATMOSPHERE, 0.0, 0.0])), wind=3.0).with_(duration="2 [h]")
    assert np.abs(td.simulate(model, empty).heat_flow("skin")[-10:]).max() < 1e-9


def test_wind_that_swings_or_jumps() -> None:
    model = box({"htc": {"length": "5 [cm]"}})
    swing = {"mean": "3 [m/s]", "amplitude": "2 [m/s]", "period": "20 [min]"}
    run = td.simulate(model, at(ATMOSPHERE, wind=swing))
    assert run.heat_balance().relative < 1e-6
    assert np.ptp(run["case"].kelvin[-60:]) > 0.3
    held = td.simulate(model, at(ATMOSPHERE, wind=TableSignal(np.array([0.0, 3600.0]), np.array([3.0, 0.0]), hold=True)))
    assert held["case"].kelvin[149] - 300.0 == pytest.approx(td.steady(model, at(ATMOSPHERE, wind=3.0))["case"] - 300.0, rel=1e-3)
    assert held["case"].kelvin[-1] > held["case"].kelvin[149] + 1.0


def test_wind_on_a_fixed_coefficient_is_remarked() -> None:
    fixed = td.simulate(box({"htc": "5 [W/(m^2 K)]"}), at(ATMOSPHERE, wind=3.0))
    assert any(code_of(w) == "run.wind-without-effect" and "'skin'" in w for w in fixed.warnings)
    assert td.simulate(box({"htc": {"length": "5 [cm]"}}), at(ATMOSPHERE, wind=3.0)).warnings == ()


def test_a_gap_in_which_gas_would_convect_is_remarked() -> None:
    wide = td.simulate(plates("1 [m]"), at(ATMOSPHERE).with_(initial={"case": "310 [K]"}))
    assert any("gap of 'gap', 1000 mm" in w for w in wide.warnings)
    assert td.simulate(plates("1 [m]"), at(1.0).with_(initial={"case": "310 [K]"})).warnings == ()
    assert td.simulate(plates("2 [mm]"), at(ATMOSPHERE).with_(initial={"case": "310 [K]"})).warnings == ()


def test_a_volume_vented_to_nowhere_is_refused() -> None:
    lost = BENCH.with_(environment={"air": td.simulation.Environment(vented="outsde", time_constant=60.0)})
    for run in (td.simulate, td.steady):
        with raises_code("name.unknown", match="'outsde'"):
            run(box({"htc": {"length": "5 [cm]"}}), lost)


@pytest.mark.parametrize(
    ("htc", "code", "match"),
    [
        ({"correlation": "vertical", "length": "0.1 [m]"}, "name.unknown", "'vertical'"),
        ({"correlation": "Nu_vertical_plate_Churchil", "length": "0.1 [m]"}, "name.unknown", "'Nu_vertical_plate_Churchill'"),
        (
            {"correlation": "Nu_horizontal_plate_McAdams", "length": "0.1 [m]"},
            "value.incomplete",
            r"surfaces\.skin.*'Nu_horizontal_plate_McAdams'.*'up'",
        ),
        ({"length": "0 [m]"}, "value.outside-range", r"'skin\.htc\.length'.*0"),
        ({"correlation": "Nu_no_such_plate", "length": "1 [m]"}, "name.unknown", "'Nu_no_such_plate'"),
    ],
)
def test_correlations_that_cannot_be(htc: dict[str, Any], code: str, match: str) -> None:
    with raises_code(code, DeckError, match=match):
        td.simulation.compile_network(box({"htc": htc}))


def test_a_correlation_outside_its_range_is_named_with_its_limits() -> None:
    small = td.simulate(box({"htc": {"length": "5 [mm]", "orientation": "up"}}, power="0.1 [W]"), BENCH)
    assert any(re.search("Nu_horizontal_plate_McAdams .*'skin'.*Rayleigh.* 10000 to 1e", w) for w in small.warnings)
    large = td.simulate(box({"htc": {"correlation": "Nu_vertical_plate_laminar", "length": "2 [m]"}}), BENCH)
    assert any(re.search("Nu_vertical_plate_laminar .*'skin'", w) for w in large.warnings)
    assert td.simulate(box({"htc": {"length": "0.1 [m]"}}), BENCH).warnings == ()


def test_a_gas_outside_the_range_of_its_properties_is_named() -> None:
    cold = BENCH.with_(boundaries={"air": "100 [K]"})
    found = td.simulate(box(links={"gap": {"kind": "gas", "area": "1 [m^2]", "gap": "1 [mm]"}}), cold)
    assert any("'gap'" in w and "law, 200 to 450 K" in w for w in found.warnings)


def test_a_deck_with_correlation_and_gas_is_written_back() -> None:
    model = box(
        {"htc": {"length": "0.2 [m]", "orientation": "up"}}, {"gap": {"kind": "gas", "area": "1 [cm^2]", "gap": "1 [mm]", "gas": "N2"}}
    )
    assert td.model_from_dict(to_dict(model)).identity() == model.identity()
    assert model.surfaces["skin"].words == {"htc.orientation": "up"}


# fitted values at other pressures ------------------------------------------------------------------------------------------------


def test_a_fitted_coefficient_thins_to_conduction() -> None:
    model = box({"htc": "5 [W/(m^2 K)]"})
    assert settled(model, at(0.9 * ATMOSPHERE)) == pytest.approx(5.0)
    floor = 3.19 * AIR.k(300.0) / 0.2
    for p in (5e4, 1e4, 1e3):
        s = (p / ATMOSPHERE) ** 0.5
        assert settled(model, at(p)) == pytest.approx(5.0 * s + floor * (1 - s), rel=0.05)
    assert settled(model, at(0.1)) < 0.2 * floor


def test_an_effective_coefficient_keeps_its_radiation_at_any_pressure() -> None:
    model = box({"effective_htc": "6 [W/(m^2 K)]", "emissivity": 0.3})
    empty, thin = settled(model, at(0.0)), settled(model, at(1.0))
    assert empty < thin < settled(model, at(1e3)) < 6.0
    with raises_code("model.needs-gas-law", ScenarioError):
        settled(box({"effective_htc": "6 [W/(m^2 K)]"}), at(1e3))


def test_free_fall_takes_natural_convection_and_leaves_conduction() -> None:
    model = box({"htc": "5 [W/(m^2 K)]"}, power="0.02 [W]")
    assert settled(model, at(ATMOSPHERE, gravity=0.0)) == pytest.approx(3.19 * AIR.k(300.0) / 0.2, rel=0.01)


def test_a_coefficient_found_in_air_does_not_hold_in_another_gas() -> None:
    with raises_code("model.element-not-supported", ScenarioError):
        settled(box({"htc": "5 [W/(m^2 K)]"}), at(ATMOSPHERE, gas="He"))


def test_a_sealed_volume_keeps_its_gas_in_vacuum() -> None:
    sealed = BENCH.with_(environment={"air": td.simulation.Environment(sealed=True)}).vacuum()
    assert settled(box({"htc": "5 [W/(m^2 K)]"}), sealed) == pytest.approx(5.0)


@pytest.mark.parametrize("skin", [{"htc": "5 [W/(m^2 K)]"}, {"effective_htc": "5 [W/(m^2 K)]", "emissivity": 0.0}])
def test_a_fan_needs_no_gravity_and_thins_as_a_stream_does(skin: dict[str, Any]) -> None:
    model = box(skin | {"carried_by": "fan"}, power="0.02 [W]")
    assert settled(model, at(ATMOSPHERE, gravity=0.0)) == pytest.approx(5.0, rel=1e-6)
    floor = 3.19 * AIR.k(300.0) / 0.2
    for p in (5e4, 1e4):
        s = (p / ATMOSPHERE) ** FAN_EXPONENT
        assert settled(model, at(p)) == pytest.approx(5.0 * s + floor * (1 - s), rel=0.02)


def test_a_coefficient_whose_carrier_is_unstated_is_named_in_thin_air() -> None:
    silent = td.simulate(box({"htc": "5 [W/(m^2 K)]", "emissivity": 0.1}), at(7e4))
    assert [code_of(w) for w in silent.warnings] == ["model.carrier-unstated"]
    assert all(word in silent.warnings[0] for word in ("'skin'", "0.83", "0.79"))
    stated = box({"htc": "5 [W/(m^2 K)]", "emissivity": 0.1, "carried_by": "free air"})
    assert td.simulate(stated, at(7e4)).warnings == td.simulate(box({"htc": "5 [W/(m^2 K)]", "emissivity": 0.1}), at(9e4)).warnings == ()


def test_the_exponent_of_a_fan_is_in_the_middle_of_plates_in_a_stream() -> None:
    """Air at a constant speed has a Reynolds number that goes with its pressure, laminar to 5e5."""
    low, high = (np.log(forced_plate_nusselt(1.01 * r, 0.71) / forced_plate_nusselt(r, 0.71)) / np.log(1.01) for r in (1e4, 1e8))
    assert pytest.approx(0.5 * (low + high), abs=0.02) == FAN_EXPONENT


@pytest.mark.parametrize("carried_by", ["cold plate", "leads"])
@pytest.mark.parametrize("pressure", [1e4, 0.0])
@pytest.mark.parametrize("skin", [{"htc": "5 [W/(m^2 K)]"}, {"effective_htc": "5 [W/(m^2 K)]", "emissivity": 0.8, "sees": "walls"}])
def test_what_a_solid_carries_does_not_ask_for_gas(carried_by: str, pressure: float, skin: dict[str, Any]) -> None:
    model = box(skin | {"carried_by": carried_by}, power="0.02 [W]", needs=["air", "walls"])
    scenario = at(pressure).with_(boundaries={"air": "300 [K]", "walls": "300 [K]"})
    assert settled(model, scenario) == pytest.approx(5.0, rel=1e-6)
    assert [code_of(w) for w in td.simulate(model, scenario).warnings] == []


# in time -------------------------------------------------------------------------------------------------------------------------


def test_a_pressure_that_falls_in_time_meets_the_constant_ones() -> None:
    """Half an hour from one atmosphere to 100 Pa; long before and after, the run is that at a constant pressure."""
    pump = TableSignal(np.array([0.0, 36000.0, 37800.0]), np.array([ATMOSPHERE, ATMOSPHERE, 100.0]), after="hold")
    for skin in (
        {"htc": "5 [W/(m^2 K)]", "emissivity": 0.3},
        {"effective_htc": "6 [W/(m^2 K)]", "emissivity": 0.3},
        {"htc": {"length": "0.2 [m]"}},
        {"effective_htc": "6 [W/(m^2 K)]", "emissivity": 0.3, "carried_by": "fan"},
    ):
        model = box(skin, {"gap": {"kind": "gas", "area": "1 [cm^2]", "gap": "1 [mm]"}})
        run = td.simulate(model, at(pump).with_(duration="100 [h]"))
        assert run["case"].kelvin[-1] == pytest.approx(td.steady(model, at(100.0))["case"], abs=0.02)
        early = td.simulate(model, at(pump).with_(duration="9 [h]"))
        assert early["case"].kelvin[-1] == pytest.approx(td.steady(model, at(ATMOSPHERE))["case"], abs=1e-3)
        assert run.heat_balance().relative < 1e-6


def test_a_vented_volume_follows_with_its_time_constant() -> None:
    """After a jump of the surroundings, exp(-t/tau); behind a ramp, lag tau."""
    jump = vented(Constant(ATMOSPHERE), Constant(0.0), 20.0, "x")
    times = np.array([0.0, 10.0, 20.0, 60.0])
    assert jump.at(times) == pytest.approx(ATMOSPHERE * np.exp(-times / 20.0), rel=2e-3)
    ramp = vented(Constant(1000.0), TableSignal(np.array([0.0, 1000.0]), np.array([1000.0, 0.0])), 20.0, "x")
    assert ramp.at(np.array([500.0]))[0] == pytest.approx(520.0, rel=1e-3)
    with raises_code("value.without-effect", ScenarioError):
        vented(TableSignal(np.array([0.0, 1.0]), np.ones(2)), Constant(0.0), 1.0, "x")


def test_a_volume_is_vented_to_one_that_has_a_pressure() -> None:
    with raises_code("model.needs-gas-law", ScenarioError, match="'air'.*'air'"):
        td.simulate(
            box({"htc": "5 [W/(m^2 K)]"}), BENCH.with_(environment={"air": td.simulation.Environment(vented="air", time_constant=5.0)})
        )


def test_gas_that_leaves_in_time_is_not_written_to_other_programs() -> None:
    pressure = {"times": ["0 [s]", "600 [s]"], "values": ["101325 [Pa]", "10 [Pa]"], "after": "hold"}
    with raises_code("output.not-expressible", DeckError, match="'gap'"):
        td.interop.to_octave(plates("1 [mm]"), BENCH.with_(environment={"*": td.simulation.Environment(pressure=pressure)}))
    assert "gap" in td.interop.to_octave(plates("1 [mm]"), BENCH)


def test_a_vented_volume_loses_its_gas_in_vacuum() -> None:
    inside = {"air": td.simulation.Environment(vented="*", time_constant=30.0), "*": td.simulation.Environment()}
    model = box({"htc": "5 [W/(m^2 K)]", "emissivity": 0.3})
    run = td.simulate(model, BENCH.with_(environment=inside, duration="60 [h]").vacuum())
    assert run["case"].kelvin[-1] == pytest.approx(td.steady(model, at(0.0))["case"], abs=0.05)


def test_the_root_of_a_sampled_pressure_is_straight() -> None:
    table = sampled_pressure(TableSignal(np.array([0.0, 100.0]), np.array([ATMOSPHERE, 0.0])), 100.0)
    times = np.linspace(0.0, 100.0, 5001)
    root = np.interp(times, table.times, np.sqrt(table.values))
    assert np.abs(root - np.sqrt(ATMOSPHERE * (1 - times / 100.0))).max() < 0.01 * np.sqrt(ATMOSPHERE)


# derivatives, members, large networks, balance -----------------------------------------------------------------------------------


def crowded() -> td.Model:
    """Every gas law at once, between nodes and to the surroundings."""
    return td.model_from_dict(
        {
            "title": "Crowded",
            "needs": ["air"],
            "nodes": {"a": {"capacitance": "100 [J/K]"}, "b": {"capacitance": "60 [J/K]"}},
            "surfaces": {
                "up": {"of": "a", "to": "air", "area": "0.03 [m^2]", "htc": {"length": "0.05 [m]", "orientation": "up"}},
                "side": {"of": "b", "to": "air", "area": "0.02 [m^2]", "htc": {"length": "0.1 [m]"}, "emissivity": 0.3},
            },
            "conductors": {"gap": {"kind": "gas", "between": ["a", "b"], "area": "0.01 [m^2]", "gap": "2 [mm]", "accommodation": 0.9}},
            "loads": {"heat": {"into": "a", "power": "3 [W]"}, "cold": {"into": "b", "power": "-0.5 [W]"}},
        }
    )


PUMPED = TableSignal(np.array([0.0, 600.0, 3000.0]), np.array([ATMOSPHERE, ATMOSPHERE, 20.0]), after="hold")
FREE = ["up.area", "up.htc.length", "side.area", "side.htc.length", "gap.area", "gap.gap", "gap.accommodation", "heat.power", "air"]


@pytest.mark.parametrize("pressure", [ATMOSPHERE, 50.0, PUMPED])
def test_slopes_are_those_of_differences(pressure: Any) -> None:
    """Jacobian and parameter derivatives of the right-hand side, warm and cold."""
    wiring = Wiring(td.simulation.compile_network(crowded(), media=at(pressure).media()), at(pressure), FREE)
    engine = Engine(wiring)
    values = wiring.network.numbers().values
    x = np.array([0.0 if n == "air" else values[n] for n in FREE]) + np.array([300.0 if n == "air" else 0.0 for n in FREE])
    for start in ((320.0, 310.0), (285.0, 305.0)):
        now = np.array(start)
        _, jacobian, slopes = engine.rhs(wiring.assemble(x), now, 1500.0, gradients=True)
        for k in range(2):
            move = 1e-3 * np.eye(2)[k]
            above, below = (engine.rhs(wiring.assemble(x), now + s * move, 1500.0)[0] for s in (1, -1))
            np.testing.assert_allclose(jacobian[:, k], (above - below) / 2e-3, rtol=1e-5, atol=1e-9)
        for k in range(len(FREE)):
            step = 1e-5 * abs(x[k])
            above, below = (engine.rhs(wiring.assemble(x + s * step * np.eye(len(FREE))[k]), now, 1500.0)[0] for s in (1, -1))
            np.testing.assert_allclose(
                slopes[:, k], (above - below) / (2 * step), rtol=2e-4, atol=1e-7 * np.abs(slopes[:, k]).max() + 1e-12
            )


def test_sensitivities_of_a_run_are_those_of_differences() -> None:
    names = ("up.area", "side.htc.length", "gap.gap")
    ready = td.prepare(crowded(), at(PUMPED), names, options=td.Options(error=8e-8))
    run = ready.run(sensitivities=True)
    for name in names:
        value = ready.nominal[name]
        above, below = (ready.run({name: value * (1 + s * 1e-4)})["b"].kelvin for s in (1, -1))
        np.testing.assert_allclose(run.sensitivity("b", name), (above - below) / (2e-4 * value), rtol=2e-3, atol=2e-3 / value * 1e-2)


@pytest.mark.parametrize("pressure", [ATMOSPHERE, 50.0, PUMPED])
def test_members_run_as_alone(pressure: Any) -> None:
    draws = {"up.area": np.linspace(0.01, 0.05, 9), "heat.power": np.linspace(1.0, 5.0, 9)}
    tight = td.Options(error=8e-7)
    found = td.ensemble(crowded(), at(pressure), draws, options=tight)
    ready = td.prepare(crowded(), at(pressure), tuple(draws), options=tight)
    for member in (0, 8):
        alone = ready.run({n: v[member] for n, v in draws.items()})
        for node in "ab":
            np.testing.assert_allclose(found.trace(member, node).kelvin, alone[node].kelvin, atol=2e-5)


def test_a_large_network_runs_as_a_small_one() -> None:
    tight = {"error": 8e-7}
    small = td.simulate(crowded(), at(50.0), options=td.Options(**tight))
    large = td.simulate(crowded(), at(50.0), options=td.Options(**tight, method="TR-BDF2"))
    np.testing.assert_allclose(large["a"].kelvin, small["a"].kelvin, atol=0.02)  # what that method promises
    with raises_code("model.element-not-supported", ScenarioError, match="'(gap|up)'"):
        td.simulate(crowded(), at(PUMPED), options=td.Options(method="TR-BDF2"))


def test_energy_closes_with_every_gas_law() -> None:
    for pressure in (ATMOSPHERE, 50.0, PUMPED):
        assert td.simulate(crowded(), at(pressure)).heat_balance().relative < 1e-8


def test_h1_humidity_changes_nothing_with_correlations_either() -> None:
    runs = [td.simulate(crowded(), at(ATMOSPHERE, humidity=h)).temperatures for h in (0.1, 0.9)]
    assert (runs[0] == runs[1]).all()


def test_laws_and_flows_agree() -> None:
    """Heat flows of a solution come from Python's own evaluation; they balance what the kernel stored."""
    model = box({"htc": {"length": "0.2 [m]", "orientation": "down"}}, {"gap": {"kind": "gas", "area": "1 [cm^2]", "gap": "1 [mm]"}})
    run = td.simulate(model, at(200.0).with_(duration="200 [h]"))
    assert sum(run.heat_flow(name)[-1] for name in run.heat_flows) == pytest.approx(2.0, rel=1e-6)


def test_the_state_of_a_gas_may_be_written_as_text() -> None:
    given = td.simulation.Environment(humidity="60 [%]", gravity="1.62 [m/s^2]", wind="2 [m/s]", vented="out", time_constant="1 [min]")
    assert (given.humidity, given.gravity, given.wind, given.time_constant) == (0.6, 1.62, Constant(2.0), 60.0)
    with raises_code("unit.wrong-dimension", td.ThermidError, match=r"'\[K\]'"):
        td.simulation.Environment(wind="2 [K]")


@pytest.mark.parametrize("surface", [{"htc": 0, "emissivity": 1.5}, {"htc": "5 [W/(m^2 K)]", "emissivity": 90}])
def test_no_surface_radiates_more_than_a_black_one(surface: dict[str, object]) -> None:
    deck = {
        "title": "hot plate",
        "needs": ["air"],
        "nodes": {"plate": {"capacitance": "100 [J/K]"}},
        "surfaces": {"skin": {"of": "plate", "to": "air", "area": "100 [cm^2]", **surface}},
    }
    with pytest.raises(td.ThermidError, match=r"'skin.emissivity' is .* Give 0 to 1"):
        td.steady(td.model_from_dict(deck), td.Scenario(boundaries={"air": "20 [degC]"}))


def test_a_gas_that_is_not_there_is_no_result() -> None:
    """A box with air in it, in air and in vacuum: its air has a temperature in air only."""
    htc = {"htc": "3 [W/(m^2 K)]"}
    box = td.model_from_dict(
        {
            "title": "box",
            "needs": ["room"],
            "nodes": {"inside": {"capacitance": "12 [J/K]"}, "wall": {"capacitance": "900 [J/K]"}, "part": {"capacitance": "90 [J/K]"}},
            "surfaces": {
                "in": {"of": "wall", "to": "inside", "area": "0.4 [m^2]", "emissivity": 0, **htc},
                "out": {"of": "wall", "to": "room", "area": "0.4 [m^2]", "emissivity": 0.8, **htc},
                "skin": {"of": "part", "to": "inside", "sees": "wall", "area": "0.1 [m^2]", "emissivity": 0.8, **htc},
            },
            "loads": {"heat": {"into": "part", "power": "2 [W]"}},
        }
    )
    bench = td.Scenario("bench", boundaries={"room": "20 [degC]"}, start="20 [degC]", duration="1 [h]")
    empty = bench.vacuum()
    assert "inside" in td.simulate(box, bench).nodes
    assert "inside" in td.steady(box, bench)
    run = td.simulate(box, empty)
    assert run.nodes == ("wall", "part", "room")
    assert [code_of(w) for w in run.warnings if "'inside'" in w] == ["run.heat-stops-without-gas"]
    assert run.temperatures.shape[1] == 3
    assert abs(run.heat_balance().relative) < 1e-6
    assert [*td.steady(box, empty)] == ["room", "wall", "part"]
    assert "inside" not in td.predict(td.design.Knowledge(box), empty)
    assert td.ensemble(box, empty, {"room": td.celsius(np.array([20.0, 21.0]))}).nodes == run.nodes
