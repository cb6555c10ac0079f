"""Streams that name their fluid: density by pressure and temperature, vacuum that stops a gas, and the mass balance of each gas node."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import code_of
from thermid.interop._wired import Writer, wired as wire
from thermid.model._tree.rules import findings
from thermid.physics.gas import GASES

R_AIR = GASES["air"].constant
CP = 1004.9 * np.exp(np.log(293.15 / 300.0) * (0.0183 + 0.0424 * np.log(293.15 / 300.0)))
"""Specific heat of air at 20 degC by the fit of its page. [J/(kg K)]"""
THIRTY = 30e-3 / 60.0
"""30 l/min. [m^3/s]"""


def stream(a: str, b: str, flow: str = "30 [l/min]", **more: Any) -> dict[str, Any]:
    name = "mass_flow" if "g/s" in flow else "volume_flow"
    return {"kind": "flow", "between": [a, b], name: flow, **({"fluid": "air"} | more)}


def bay(**conductors: Any) -> td.Model:
    """A bay whose air takes 10 W, with streams."""
    return td.model_from_dict(
        {
            "title": "bay",
            "needs": ["inlet", "outlet"],
            "nodes": {"gas": {"capacitance": "5 [J/K]"}},
            "conductors": conductors | {"wall": {"kind": "conduction", "between": ["gas", "outlet"], "conductance": "0.1 [W/K]"}},
            "loads": {"heat": {"into": "gas", "power": "10 [W]"}},
        }
    )


def run(**changes: Any) -> td.Scenario:
    return td.Scenario("run", boundaries={"inlet": "20 [degC]", "outlet": "20 [degC]"}, start="20 [degC]", duration="20 [min]").with_(
        **changes
    )


def carried(model: td.Model, scenario: td.Scenario, path: str = "fan") -> float:
    """Heat per kelvin that a stream carries at the end. [W/K]"""
    found = td.simulate(model, scenario)
    a, b = next(c.ends for c in found._run.network.flat.conductors if c.path == path)
    return float(found.heat_flow(path)[-1] / (found[a].kelvin[-1] - found[b].kelvin[-1]))


def at(pressure: float, **more: Any) -> dict[str, Any]:
    return {"environment": {"*": td.simulation.Environment(pressure=f"{pressure} [Pa]")}, **more}


def test_no_stream_of_gas_flows_in_vacuum() -> None:
    """30 l/min of air carried 7.1 W at 0 Pa; now nothing, and the first lines say so."""
    for flow in ("30 [l/min]", "0.6 [g/s]"):
        found = td.simulate(bay(fan=stream("inlet", "gas", flow)), run().vacuum())
        assert found.heat_flow("fan")[-1] == 0.0
        assert found["gas"].kelvin[-1] == pytest.approx(293.15 + 10.0 / 0.1 * (1.0 - np.exp(-1200.0 * 0.1 / 5.0)), rel=1e-6)
        assert any(code_of(w) == "run.heat-stops-without-gas" and "gas in 'inlet' and 'gas'" in w for w in found.warnings)
        assert td.simulate(bay(fan=stream("inlet", "gas", flow)), run()).warnings == ()


def test_air_that_goes_back_to_the_room_it_came_from_comes_from_a_boundary() -> None:
    """Every fan box in one room was said to have the density at 20 degC, and had that of its room."""
    found = td.simulate(bay(fan=stream("inlet", "gas"), back=stream("gas", "inlet")), run())
    assert found.warnings == ()


@pytest.mark.parametrize("pressure", [101325.0, 60e3, 1e3])
@pytest.mark.parametrize("celsius", [-20.0, 20.0, 60.0])
def test_a_volume_flow_has_the_density_of_its_source(pressure: float, celsius: float) -> None:
    scenario = run(**at(pressure, boundaries={"inlet": f"{celsius} [degC]"}))
    wanted = THIRTY * pressure / (R_AIR * (celsius + 273.15)) * CP
    assert carried(bay(fan=stream("inlet", "gas")), scenario) == pytest.approx(wanted, rel=1e-9)


@pytest.mark.parametrize("pressure", [101325.0, 60e3])
def test_a_mass_flow_is_fixed(pressure: float) -> None:
    assert carried(bay(fan=stream("inlet", "gas", "0.6 [g/s]")), run(**at(pressure))) == pytest.approx(0.6e-3 * CP, rel=1e-9)
    own = stream("inlet", "gas", "0.6 [g/s]", specific_heat="1010 [J/(kg K)]")
    assert carried(bay(fan=own), run(**at(pressure))) == pytest.approx(0.606, rel=1e-9)


def test_a_liquid_flows_in_vacuum() -> None:
    loop = stream("inlet", "gas", "1 [g/s]", fluid="liquid", specific_heat="4180 [J/(kg K)]")
    assert carried(bay(fan=loop), run().vacuum()) == pytest.approx(4.18, rel=1e-9)
    pump = stream("inlet", "gas", "1 [l/min]", fluid="liquid", density="998 [kg/m^3]", specific_heat="4180 [J/(kg K)]")
    assert carried(bay(fan=pump), run().vacuum()) == pytest.approx(998e-3 / 60 * 4180, rel=1e-9)
    assert td.simulate(bay(fan=loop), run().vacuum()).warnings == ()


@pytest.mark.parametrize("name", ["He", "CO2", "N2"])
def test_another_gas(name: str) -> None:
    gas = GASES[name]
    conductance = carried(bay(fan=stream("inlet", "gas", fluid=name)), run(environment={"*": td.simulation.Environment(gas=name)}))
    cp = gas.ratio(293.15) * gas.constant / (gas.ratio(293.15) - 1.0)
    assert conductance == pytest.approx(THIRTY * 101325.0 / (gas.constant * 293.15) * cp, rel=1e-9)


def test_a_pressure_that_falls_in_time() -> None:
    """Density follows the pressure of an ascent: each instant is that of a run at its pressure."""
    fall = {"times": ["0 [min]", "10 [min]"], "values": ["101325 [Pa]", "0 [Pa]"], "after": "hold"}
    found = td.simulate(bay(fan=stream("inlet", "gas")), run(environment={"*": td.simulation.Environment(pressure=fall)}), every="30 [s]")
    share = np.clip(1.0 - found.times / 600.0, 0.0, None)
    across = 293.15 - found["gas"].kelvin
    wanted = THIRTY * 101325.0 * share / (R_AIR * 293.15) * CP * across
    assert found.heat_flow("fan") == pytest.approx(wanted, abs=1e-4 * np.abs(wanted).max())
    assert found.heat_balance().relative < 1e-9
    assert any("'fan' is air and stops" in w and "from 600 s" in w for w in found.warnings)


def test_a_mass_flow_stops_when_the_gas_is_gone() -> None:
    fall = {"times": ["0 [min]", "10 [min]"], "values": ["101325 [Pa]", "0 [Pa]"], "after": "hold"}
    model = bay(fan=stream("inlet", "gas", "0.6 [g/s]"))
    found = td.simulate(model, run(environment={"*": td.simulation.Environment(pressure=fall)}), every="30 [s]")
    conductance = found.heat_flow("fan")[1:] / (293.15 - found["gas"].kelvin[1:])
    assert conductance[found.times[1:] < 590] == pytest.approx(0.6e-3 * CP, rel=1e-9)
    assert conductance[found.times[1:] > 600] == pytest.approx(0.0, abs=1e-12)


def test_an_inlet_that_warms_in_time() -> None:
    warm = {"times": ["0 [min]", "20 [min]"], "values": ["0 [degC]", "60 [degC]"]}
    found = td.simulate(bay(fan=stream("inlet", "gas")), run(boundaries={"inlet": warm}), every="60 [s]")
    wanted = THIRTY * 101325.0 / (R_AIR * found["inlet"].kelvin) * CP * (found["inlet"].kelvin - found["gas"].kelvin)
    assert found.heat_flow("fan") == pytest.approx(wanted, abs=1e-4 * np.abs(wanted).max())
    assert found.heat_balance().relative < 1e-9


def test_a_fan_that_is_scheduled_while_the_pressure_falls() -> None:
    """A schedule of the flow and the density multiply; the fan that is switched off at 5 min is off at 5 min."""
    fall = {"times": ["0 [min]", "20 [min]"], "values": ["101325 [Pa]", "50 [kPa]"]}
    off = {"times": ["0 [min]", "5 [min]"], "values": ["30 [l/min]", "0 [l/min]"], "hold": True}
    scenario = run(environment={"*": td.simulation.Environment(pressure=fall)}, schedule={"fan.volume_flow": off})
    found = td.simulate(bay(fan=stream("inlet", "gas")), scenario, every="10 [s]")
    density = (101325.0 + (50e3 - 101325.0) * found.times / 1200.0) / (R_AIR * 293.15)
    on = found.times < 299.0
    wanted = THIRTY * density * CP * (293.15 - found["gas"].kelvin)
    assert found.heat_flow("fan")[on] == pytest.approx(wanted[on], abs=1e-3 * np.abs(wanted[on]).max())
    assert (found.heat_flow("fan")[found.times > 300.0] == 0.0).all()


# the mass balance of each gas node -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("fluid", ["air", "liquid"])
def test_thirty_in_and_sixty_on_is_refused(fluid: str) -> None:
    more = {} if fluid == "air" else {"density": "998 [kg/m^3]", "specific_heat": "4180 [J/(kg K)]"}
    streams = {"fan": stream("inlet", "gas", fluid=fluid, **more), "out": stream("gas", "outlet", "60 [l/min]", fluid=fluid, **more)}
    with raises_code("model.streams-unbalanced", td.ThermidError, match="'gas'.*30.*'fan'.*60.*'out'"):
        td.simulation.compile_network(bay(**streams))
    found = [f for f in findings(bay(**streams)) if f.severity == "error"]
    assert len(found) == 1
    assert code_of(found[0].message) == "model.streams-unbalanced"
    assert "30 l/min" in found[0].message


def test_a_stream_of_no_fluid_into_a_gas_node_is_balanced_too() -> None:
    """Convection says that the node is gas; what the stream is need not be said for its mass to be missed."""
    plain = {"fluid": "", "density": "1.2 [kg/m^3]", "specific_heat": "1006 [J/(kg K)]"}
    deck = {
        "title": "bay",
        "needs": ["inlet", "outlet"],
        "nodes": {"gas": {"capacitance": "5 [J/K]"}, "box": {"capacitance": "100 [J/K]"}},
        "surfaces": {"skin": {"of": "box", "to": "gas", "area": "0.1 [m^2]", "htc": "5 [W/(m^2 K)]", "emissivity": 0.0}},
        "conductors": {"fan": stream("inlet", "gas", **plain), "out": stream("gas", "outlet", "60 [l/min]", **plain)},
    }
    with raises_code("model.streams-unbalanced", match="'gas'"):
        td.simulation.compile_network(td.model_from_dict(deck))


def test_a_stream_from_a_node_that_none_enters_is_refused() -> None:
    """Such a stream cools nothing: it takes from its first end a temperature, and no heat."""
    with raises_code("model.streams-unbalanced", td.ThermidError, match="'gas'.*30.*'out'"):
        td.simulation.compile_network(bay(out=stream("gas", "outlet")))


def test_what_enters_may_leave_unwritten() -> None:
    """The last stream of a line ends in a node, and leaves it at that node's temperature: the law of a stream says so."""
    td.simulation.compile_network(bay(fan=stream("inlet", "gas")))


def test_two_inlets_and_recirculation_close() -> None:
    """30 from outside and 60 from a loop are 90 through the bay; the mixed temperature is that of the masses."""
    model = td.model_from_dict(
        {
            "title": "loop",
            "needs": ["inlet", "outlet", "ambient"],
            "nodes": {n: {"capacitance": "5 [J/K]"} for n in ("mix", "gas")},
            "conductors": {
                "fan": stream("inlet", "mix", "30 [l/min]"),
                "through": stream("mix", "gas", "90 [l/min]"),
                "back": stream("gas", "mix", "60 [l/min]"),
                "out": stream("gas", "outlet", "30 [l/min]"),
                "leak": {"kind": "conduction", "between": ["gas", "ambient"], "conductance": "1e-9 [W/K]"},
            },
            "loads": {"heat": {"into": "gas", "power": "10 [W]"}},
        }
    )
    scenario = run(boundaries={"inlet": "40 [degC]", "ambient": "20 [degC]"}, **at(60e3))
    one = THIRTY * 60e3 / (R_AIR * 313.15) * CP
    steady = td.steady(model, scenario)
    assert steady["gas"] == pytest.approx(313.15 + 10.0 / one, abs=1e-6)
    assert steady["mix"] == pytest.approx((313.15 + 2.0 * steady["gas"]) / 3.0, abs=1e-6)
    assert td.simulate(model, scenario).heat_balance().relative < 1e-9


def test_a_chain_carries_one_mass() -> None:
    """What leaves a warm cell is as much mass as entered it: the density of a line is that of its source."""
    chain = bay(fan=stream("inlet", "gas"), out=stream("gas", "outlet"))
    scenario = run(boundaries={"inlet": "-20 [degC]", "outlet": "60 [degC]"})
    assert carried(chain, scenario, "out") == pytest.approx(carried(chain, scenario, "fan"), rel=1e-12)


def test_two_sources_of_two_temperatures_close_in_mass() -> None:
    """Where a warm and a cold stream meet, what goes on is the sum of their masses, not of their volumes."""
    model = td.model_from_dict(
        {
            "title": "tee",
            "needs": ["cold", "warm", "outlet"],
            "nodes": {"tee": {"capacitance": "5 [J/K]"}, "next": {"capacitance": "5 [J/K]"}},
            "conductors": {
                "a": stream("cold", "tee", "30 [l/min]"),
                "b": stream("warm", "tee", "10 [l/min]"),
                "on": stream("tee", "next", "40 [l/min]"),
                "k": {"kind": "conduction", "between": ["next", "outlet"], "conductance": "1 [W/K]"},
            },
        }
    )
    scenario = td.Scenario(
        "s", boundaries={"cold": "-30 [degC]", "warm": "90 [degC]", "outlet": "0 [degC]"}, start="0 [degC]", duration="10 [min]"
    )
    a, b, on = (carried(model, scenario, name) for name in ("a", "b", "on"))
    assert on == pytest.approx(a + b, rel=1e-12)
    assert a / b == pytest.approx(3.0 * 363.15 / 243.15, rel=1e-9)


def test_volume_and_mass_flows_that_meet_are_refused() -> None:
    """At another pressure or temperature their balance would not close."""
    with raises_code("model.streams-differ", td.ThermidError, match="'gas'"):
        td.simulation.compile_network(bay(fan=stream("inlet", "gas"), out=stream("gas", "outlet", "0.602 [g/s]")))


def test_two_fluids_in_one_node_are_refused() -> None:
    with raises_code("model.streams-differ", td.ThermidError, match="'fan'.*'out'.*'gas'"):
        td.simulation.compile_network(bay(fan=stream("inlet", "gas"), out=stream("gas", "outlet", fluid="He")))


def test_a_liquid_and_a_gas_close_each_for_itself() -> None:
    """An exchanger of one temperature: air passes through it, and a liquid ends in it."""
    loop = stream("inlet", "gas", "1 [g/s]", fluid="liquid", specific_heat="4180 [J/(kg K)]")
    td.simulation.compile_network(bay(fan=stream("inlet", "gas"), out=stream("gas", "outlet"), loop=loop))
    with raises_code("model.streams-unbalanced", td.ThermidError, match="'gas'.*1.*'loop'.*2"):
        td.simulation.compile_network(
            bay(fan=stream("inlet", "gas"), loop=loop, back=loop | {"between": ["gas", "outlet"], "mass_flow": "2 [g/s]"})
        )


def test_a_schedule_of_one_end_is_refused() -> None:
    half = {"times": ["0 [min]", "5 [min]"], "values": ["30 [l/min]", "15 [l/min]"], "hold": True}
    chain = bay(fan=stream("inlet", "gas"), out=stream("gas", "outlet"))
    with raises_code("model.streams-unbalanced", match="'gas'.*15"):
        td.simulate(chain, run(schedule={"fan.volume_flow": half}))
    both = td.simulate(chain, run(schedule={"fan.volume_flow": half, "out.volume_flow": half}))
    assert both.heat_balance().relative < 1e-9


def test_a_fit_frees_a_flow_by_one_parameter() -> None:
    """A free flow on one end alone is refused at the first value off balance; a shared parameter moves all streams of the line."""
    chain = bay(fan=stream("inlet", "gas"), out=stream("gas", "outlet"))
    alone = td.prepare(chain, run(), ["fan.volume_flow"])
    with raises_code("model.streams-unbalanced", match="'gas'.*24"):
        alone.run({"fan.volume_flow": 24e-3 / 60})
    deck = {
        "title": "bay",
        "needs": ["inlet", "outlet"],
        "parameters": {"air": "30 [l/min]"},
        "nodes": {"gas": {"capacitance": "5 [J/K]"}},
        "conductors": {"fan": stream("inlet", "gas", "air"), "out": stream("gas", "outlet", "air")},
        "loads": {"heat": {"into": "gas", "power": "10 [W]"}},
    }
    shared = td.prepare(td.model_from_dict(deck), run(), ["air"])
    step = 1e-3 * THIRTY
    plus, minus = (shared.run({"air": THIRTY + s})["gas"].kelvin[-1] for s in (step, -step))
    slope = shared.run({"air": THIRTY}, sensitivities=True).sensitivity("gas", "air")[-1]
    assert slope == pytest.approx((plus - minus) / (2 * step), rel=1e-4)


def test_an_ensemble_spreads_the_inlet() -> None:
    """Members with their own inlet temperature have their own density, as runs one by one."""
    model = bay(fan=stream("inlet", "gas"))
    draws = [263.15, 293.15, 333.15]
    found = td.prepare(model, run(), ["inlet"]).ensemble({"inlet": td.quantity(draws, unit="K")})
    for k, kelvin in enumerate(draws):
        alone = td.simulate(model, run(boundaries={"inlet": f"{kelvin} [K]"}))
        assert found.temperatures("gas")[-1, k] == pytest.approx(alone["gas"].kelvin[-1], abs=1e-4)


def test_the_slope_with_the_inlet_holds_its_density() -> None:
    model = bay(fan=stream("inlet", "gas"))
    simulator = td.prepare(model, run(), ["inlet"])
    slope = simulator.run({"inlet": "20 [degC]"}, sensitivities=True).sensitivity("gas", "inlet")[-1]
    plus, minus = (simulator.run({"inlet": td.celsius(20.0 + s)})["gas"].kelvin[-1] for s in (0.05, -0.05))
    assert slope == pytest.approx((plus - minus) / 0.1, rel=1e-4)


@pytest.mark.parametrize("inlet", ["40 [degC]", {"times": ["0 [min]", "20 [min]"], "values": ["0 [degC]", "60 [degC]"]}])
def test_an_export_has_the_density_of_the_source(inlet: Any) -> None:
    """What is written to Octave carries what the run carries, in time too; SPICE, which has no signals for it, refuses."""
    model, scenario = bay(fan=stream("inlet", "gas")), run(boundaries={"inlet": inlet}, **at(60e3))
    found = wire(model, scenario, Writer("Octave", gas=True))
    row = next(row for _, row in found.conductors if row.name == "fan")
    shape = found.gas[row.signal].at(np.array([600.0]))[0] if row.signal else 1.0
    assert float(row.coefficients[0]) * shape == pytest.approx(THIRTY * 60e3 / (R_AIR * (303.15 if row.signal else 313.15)) * CP, rel=1e-5)


def test_a_reduced_deck_keeps_the_fluid() -> None:
    """Reduced at 60 kPa, run at 60 kPa: a volume of air stays one, and its density follows its inlet."""
    scenario = run(boundaries={"inlet": "40 [degC]"}, **at(60e3))
    found = td.qualify.reduce(bay(fan=stream("inlet", "gas")), scenario, nodes=1)
    again = td.simulate(found.inside, scenario)
    assert again["gas"].kelvin[-1] == pytest.approx(td.simulate(bay(fan=stream("inlet", "gas")), scenario)["gas"].kelvin[-1], abs=1e-6)
    kept = [c for c in found.model.conductors.values() if c.kind == "flow"]
    assert [c.words for c in kept] == [{"fluid": "air"}]
    assert "volume_flow" in kept[0].fields


# words ---------------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "code", "match"),
    [
        ({"fluid": "aire"}, "name.unknown", "'aire'.*'air'"),
        ({"density": "1.2 [kg/m^3]"}, "value.excludes-another", r"conductors\.fan"),
        ({"fluid": "liquid"}, "value.incomplete", "volume_flow.*specific_heat.*mass_flow.*specific_heat"),
        ({"fluid": ""}, "value.incomplete", "volume_flow"),
    ],
)
def test_faults(changes: dict[str, Any], code: str, match: str) -> None:
    with raises_code(code, match=match):
        bay(fan=stream("inlet", "gas", **changes))


@pytest.mark.parametrize("pressure", [0.0, 60e3])
def test_a_stream_of_no_fluid_is_refused_off_the_ground(pressure: float) -> None:
    """Whether vacuum stops it depends on what it is; on the ground its own numbers stand."""
    model = bay(fan=stream("inlet", "gas", fluid="", density="1.2 [kg/m^3]", specific_heat="1006 [J/(kg K)]"))
    assert td.simulate(model, run()).warnings == ()
    assert carried(model, run()) == pytest.approx(THIRTY * 1.2 * 1006.0, rel=1e-12)
    with raises_code("model.needs-gas-law"):
        td.simulate(model, run(**at(pressure)))


def test_a_loop_without_a_source_says_its_density() -> None:
    model = td.model_from_dict(
        {
            "title": "closed loop",
            "needs": ["wall"],
            "nodes": {n: {"capacitance": "5 [J/K]"} for n in ("a", "b")},
            "conductors": {
                "on": stream("a", "b"),
                "back": stream("b", "a"),
                "k": {"kind": "conduction", "between": ["b", "wall"], "conductance": "1 [W/K]"},
            },
            "loads": {"heat": {"into": "a", "power": "5 [W]"}},
        }
    )
    found = td.simulate(model, td.Scenario("s", boundaries={"wall": "20 [degC]"}, duration="10 [min]"))
    assert any(code_of(w) == "run.density-assumed" and "'on' and 'back'" in w for w in found.warnings)
    assert found.heat_balance().relative < 1e-9


def test_a_gas_that_differs_from_that_of_its_node_is_said() -> None:
    found = td.simulate(bay(fan=stream("inlet", "gas", fluid="N2")), run())
    assert any("'fan' is N2, and the gas of 'inlet' and 'gas' is air" in w for w in found.warnings)


def test_a_saved_deck_keeps_the_fluid(tmp_path: Any) -> None:
    td.save_model(bay(fan=stream("inlet", "gas")), tmp_path / "bay.toml")
    again = td.load_model(tmp_path / "bay.toml")
    assert again.conductors["fan"].words == {"fluid": "air"}
    assert carried(again, run(**at(60e3))) == pytest.approx(THIRTY * 60e3 / (R_AIR * 293.15) * CP, rel=1e-9)
