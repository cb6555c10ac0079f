"""Leads as fins between two temperatures, and streams that carry heat one way."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import DeckError, ScenarioError
from thermid.base.units import ATMOSPHERE, STEFAN_BOLTZMANN
from thermid.model._tree.identity import to_dict
from thermid.model.tree import Constant, TableSignal
from thermid.physics.conduction import fin_conductances, fin_parameter

ROD = {"diameter": "5 [mm]", "length": "0.3 [m]", "conductivity": "398 [W/(m K)]"}
"""The rods of Incropera, Example 3.9: 100 degC at the foot, air at 25 degC, h 100 W/(m^2 K)."""


def model(lead: dict[str, Any], **more: Any) -> td.Model:
    return td.model_from_dict(
        {
            "title": "Rod",
            "needs": ["foot", "air"],
            "nodes": {"tip": {"capacitance": "5 [J/K]"}},
            "conductors": {"rod": {"kind": "lead", "between": ["foot", "tip"], **ROD, **lead}},
        }
        | more
    )


def bench(**more: Any) -> td.Scenario:
    return td.Scenario("bench", boundaries={"foot": "100 [degC]", "air": "25 [degC]"}, start="air", duration="1 [h]", **more)


def heats(lead: dict[str, Any], scenario: td.Scenario | None = None) -> dict[str, float]:
    run = td.simulate(model(lead), scenario or bench())
    return {name: float(q[-1]) for name, q in run.heat_flows.items()}


# textbook ------------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("conductivity", "printed"), [(398, 8.3), (180, 5.6), (14, 1.6)])
def test_long_rods_of_the_book(conductivity: float, printed: float) -> None:
    """Incropera, 6th ed., Example 3.9: what enters the foot of an endless rod; one whose tip hangs free at 0.3 m is as good as that."""
    lead = {"conductivity": f"{conductivity} [W/(m K)]", "htc": "100 [W/(m^2 K)]", "to": "air"}
    found = heats(lead | {"length": "1 [m]"})
    assert found["rod"] + found["rod.first"] == pytest.approx(printed, abs=0.05)
    assert found["rod"] == pytest.approx(found["rod.second"], abs=1e-9)  # the tip loses what comes through


def test_rod_between_two_temperatures_is_case_c_of_table_3_4() -> None:
    """The heat at both ends of a fin with a given temperature at its tip: theta(x) of Eq. 3.77, differentiated here step by step."""
    section, m = math.pi * 0.005**2 / 4, float(fin_parameter(100.0, math.pi * 0.005, 398.0, math.pi * 0.005**2 / 4))
    through, side = fin_conductances(100.0, math.pi * 0.005, 398.0, section, 0.3)
    foot, tip = 75.0, -20.0

    def theta(x: float) -> float:
        return (tip * math.sinh(m * x) + foot * math.sinh(m * (0.3 - x))) / math.sinh(m * 0.3)

    step = 1e-6
    slope = [
        (-theta(2 * step) + 4 * theta(step) - 3 * foot) / (2 * step),
        (theta(0.3 - 2 * step) - 4 * theta(0.3 - step) + 3 * tip) / (2 * step),
    ]
    assert through * (foot - tip) + side * foot == pytest.approx(-398.0 * section * slope[0], rel=1e-6)
    assert through * (foot - tip) - side * tip == pytest.approx(-398.0 * section * slope[1], rel=1e-6)


def test_halves_of_a_lead_in_series_are_the_whole() -> None:
    halves = {
        name: {"kind": "lead", "between": ends, **ROD, "length": "0.15 [m]", "htc": "12 [W/(m^2 K)]", "to": "air"}
        for name, ends in (("a", ["foot", "middle"]), ("b", ["middle", "tip"]))
    }
    two = model({}, nodes={"tip": {"capacitance": "5 [J/K]"}, "middle": {}}, conductors=halves)
    one = model({"htc": "12 [W/(m^2 K)]", "to": "air"})
    assert td.steady(two, bench())["tip"] == pytest.approx(td.steady(one, bench())["tip"], abs=1e-9)


@pytest.mark.parametrize("square", [1e-12, 0.0199, 0.0201, 3.0, 400.0])
def test_series_and_powers_are_the_hyperbolic_functions(square: float) -> None:
    through, side = fin_conductances(square, 1.0, 1.0, 1.0, 1.0)
    root = math.sqrt(square)
    assert through == pytest.approx(root / math.sinh(root), rel=1e-12)
    assert side == pytest.approx(root * math.tanh(root / 2), rel=1e-12)


def test_a_lead_has_exact_derivatives() -> None:
    lead = model({"htc": "12 [W/(m^2 K)]", "to": "air", "count": 3})
    names = ("rod.htc", "rod.length", "rod.diameter", "rod.conductivity")
    nominal = {n: td.simulation.compile_network(lead).numbers().values[n] for n in names}

    def at(name: str, factor: float) -> td.Model:
        unit = {"rod.htc": "W/(m^2 K)", "rod.length": "m", "rod.diameter": "m", "rod.conductivity": "W/(m K)"}[name]
        return lead.with_values({name: f"{nominal[name] * factor!r} [{unit}]"})

    run = td.prepare(lead, bench(), free=names).run(nominal, sensitivities=True)
    for name in names:
        up, down = (td.simulate(at(name, f), bench())["tip"].kelvin[-1] for f in (1.001, 0.999))
        assert run.sensitivity("tip", name)[-1] == pytest.approx((up - down) / (0.002 * nominal[name]), rel=1e-4)


# the gas goes --------------------------------------------------------------------------------------------------------------------


def test_without_gas_a_lead_conducts_and_radiates_alone() -> None:
    lead = {"htc": "12 [W/(m^2 K)]", "to": "air", "emissivity": 0.8}
    shine = 4 * 0.8 * STEFAN_BOLTZMANN * 293.15**3
    section = math.pi * 0.005**2 / 4
    in_air, without = (
        [float(r.coefficients[0]) for r in td.simulation.compile_network(model(lead), media=s.media()).numbers().conductors]
        for s in (bench(), bench().vacuum())
    )
    assert in_air[:2] == pytest.approx(fin_conductances(12.0 + shine, math.pi * 0.005, 398.0, section, 0.3), rel=1e-12)
    assert without[:2] == pytest.approx(fin_conductances(shine, math.pi * 0.005, 398.0, section, 0.3), rel=1e-12)
    bare = heats({"htc": "12 [W/(m^2 K)]", "to": "air", "emissivity": 0}, bench().vacuum())
    assert bare["rod.first"] == 0.0


def test_pressure_between_and_in_time_ends_at_both() -> None:
    lead = {"htc": "12 [W/(m^2 K)]", "to": "air", "emissivity": 0}
    steps = [
        heats(lead, bench(environment={"*": td.simulation.Environment(Constant(p))}))["rod.first"]
        for p in (ATMOSPHERE, 3e4, 1e3, 10.0, 1e-3)
    ]
    assert np.all(np.diff(steps) < 0)
    assert steps[-1] == pytest.approx(0.0, abs=1e-3 * steps[0])
    for hold in (True, False):
        pump = TableSignal(np.array([0.0, 600.0, 1200.0]), np.array([ATMOSPHERE, ATMOSPHERE, 0.0]), hold=hold, after="hold")
        run = td.simulate(model(lead), bench(environment={"*": td.simulation.Environment(pump)}))
        assert run.heat_flow("rod.first")[-1] == pytest.approx(0.0, abs=1e-9)
        assert run.heat_flow("rod.first")[10] == pytest.approx(heats(lead)["rod.first"], rel=1e-6)
        assert run.heat_balance().relative < 1e-6


def test_an_effective_lead_without_emissivity_refuses_vacuum() -> None:
    lead = {"effective_htc": "12 [W/(m^2 K)]", "to": "air"}
    with raises_code("model.needs-gas-law", ScenarioError, match="'rod'"):
        td.simulate(model(lead), bench().vacuum())
    assert heats(lead, bench().vacuum(as_printed=True))["rod.first"] == 0.0


@pytest.mark.parametrize(
    ("lead", "code", "match"),
    [
        (
            {"htc": "12 [W/(m^2 K)]"},
            "value.incomplete",
            r'conductors\.rod.*"air"',
        ),
        (
            {"htc": "1 [W/(m^2 K)]", "effective_htc": "1 [W/(m^2 K)]", "to": "air"},
            "value.excludes-another",
            r"conductors\.rod.*effective_htc",
        ),
        ({"htc": "1 [W/(m^2 K)]", "to": "aire"}, "name.unknown", "'aire'.*'air'"),
        ({"length": "0 [m]"}, "value.outside-range", r"conductors\.rod\.length.*'rod\.length'.*0"),
        ({"diameter": "0 [m]"}, "value.outside-range", r"'rod\.diameter'.*0"),
        ({"cross_section": "1 [mm^2]"}, "value.incomplete", "cross_section"),
    ],
)
def test_leads_that_cannot_be(lead: dict[str, Any], code: str, match: str) -> None:
    with raises_code(code, (DeckError, td.ThermidError), match=match):
        td.simulate(model(lead), bench())


def test_a_lead_is_written_back_as_a_deck() -> None:
    first = model({"htc": "12 [W/(m^2 K)]", "to": "air", "test_only": True})
    again = td.model_from_dict(to_dict(first))
    assert again.identity() == first.identity()
    assert again.conductors["rod"].words == {"to": "air"}


def test_what_is_for_the_test_only_is_listed_and_dropped() -> None:
    wired = model(
        {"test_only": True, "htc": "12 [W/(m^2 K)]", "to": "air"},
        surfaces={"skin": {"of": "tip", "to": "air", "area": "10 [cm^2]", "htc": "6 [W/(m^2 K)]"}},
        needs=["foot", "air"],
    )
    assert any(f.code == "model.test-only" and "'rod'" in f.message for f in wired.check())
    flown = wired.without_test_only()
    assert flown.conductors == {}
    assert td.steady(flown, bench())["tip"] == pytest.approx(298.15, abs=1e-9)
    assert td.steady(wired, bench())["tip"] > 310.0


# streams -------------------------------------------------------------------------------------------------------------------------


def duct(cells: int, flow: dict[str, Any] | None = None) -> td.Model:
    """Air that flows past a wall, in cells: each gives its part of the wall's heat to the next."""
    names = [f"v{k}" for k in range(cells)]
    stream = {"kind": "flow", **(flow or {"mass_flow": "2 [g/s]", "specific_heat": "1006 [J/(kg K)]"})}
    links = {f"s{k}": {**stream, "between": [a, b]} for k, (a, b) in enumerate(zip(["inlet", *names], names, strict=False))}
    walls = {f"w{k}": {"kind": "conduction", "between": [n, "wall"], "conductance": f"{3.0 / cells!r} [W/K]"} for k, n in enumerate(names)}
    return td.model_from_dict(
        {
            "title": "duct",
            "needs": ["inlet", "wall"],
            "nodes": {n: {"capacitance": f"{6.0 / cells!r} [J/K]"} for n in names},
            "conductors": links | walls,
        }
    )


WARM = td.Scenario("warm wall", boundaries={"inlet": "20 [degC]", "wall": "80 [degC]"}, start="inlet", duration="2 [min]")


def test_a_chain_of_volumes_tends_to_the_textbook_outlet() -> None:
    """Effectiveness of a stream beside a wall of one temperature: 1 - exp(-NTU) (Incropera, 6th ed., Eq. 11.35a)."""
    units = 3.0 / (0.002 * 1006.0)
    found = []
    for cells in (1, 4, 16, 64, 256):
        outlet = td.steady(duct(cells), WARM)[f"v{cells - 1}"]
        share = (outlet - 293.15) / 60.0
        assert share == pytest.approx(1.0 - (1.0 + units / cells) ** -cells, abs=1e-10)
        found.append(share - (1.0 - math.exp(-units)))
    assert abs(found[-1]) < 1e-3
    assert found[-2] / found[-1] == pytest.approx(4.0, rel=0.05)  # of first order in the size of a cell


def test_a_stream_closes_the_balance_and_is_not_reciprocal() -> None:
    run = td.simulate(duct(8), WARM)
    assert run.heat_balance().relative < 1e-6
    upstream = td.steady(duct(8).with_values({}), WARM.with_(boundaries={"wall": "20 [degC]"}))
    assert max(abs(t - 293.15) for t in upstream.values()) < 1e-9  # nothing warms what lies upstream


def test_a_stream_is_switched_by_a_schedule() -> None:
    on = TableSignal(np.array([0.0, 60.0, 120.0]), np.array([0.002, 0.0, 0.0]), hold=True)
    run = td.simulate(duct(2), WARM.with_(schedule={"s0.mass_flow": on, "s1.mass_flow": on}, duration="10 [min]"))
    assert run.heat_balance().relative < 1e-6
    assert run["v1"].at(59.0) < 75.0
    assert run["v1"].final == pytest.approx(80.0, abs=1e-3)  # still air takes the wall's temperature
    assert run.heat_flow("s0")[-1] == 0.0


def test_a_volume_flow_is_the_mass_flow_of_its_density() -> None:
    by_volume = duct(3, {"volume_flow": "100 [l/min]", "density": "1.2 [kg/m^3]", "specific_heat": "1006 [J/(kg K)]"})
    assert td.steady(by_volume, WARM)["v2"] == pytest.approx(td.steady(duct(3), WARM)["v2"], abs=1e-10)
