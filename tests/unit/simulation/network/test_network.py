"""Compiled networks: units bit for bit, derivatives, gases, prescribed nodes, and hierarchy against the flat model."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import DeckError, NameNotFoundError, ScenarioError
from thermid.base.units import ATMOSPHERE, Dual, gradient_of, value_of
from thermid.model.tree import Constant, Model, Sine, TableSignal, model_from_dict
from thermid.simulation._network.environment import Environment
from thermid.simulation._network.medium import Media
from thermid.simulation._network.network import KEPT_NETWORKS, compile_network
from thermid.simulation._network.rows import ConductorRow

EMPTY = Environment(Constant(0.0))


def box(**skin: Any) -> Model:
    return model_from_dict(
        {
            "title": "Box",
            "needs": ["air"],
            "nodes": {"case": {"mass": "1.5 [kg]", "specific_heat": "900 [J/(kg K)]"}},
            "surfaces": {"skin": {"of": "case", "to": "air", "area": "0.05 [m^2]", **skin}},
            "loads": {"heat": {"into": "case", "power": "4 [W]"}},
        }
    )


def rows(model: Model, *environment: Environment, as_printed: bool = False, gas: str = "*") -> dict[str, ConductorRow]:
    media = Media({gas: environment[0]} if environment else {}, as_printed)
    return {f"{r.name} {r.form} {r.signal}".strip(): r for r in compile_network(model, media=media).numbers().conductors}


# units and derivatives ---------------------------------------------------------------------------------------------------------------


def test_millimetres_or_metres_give_the_same_network_bit_for_bit() -> None:
    """Property 7, for every number of a slab and a box."""

    def slab(thickness: str, area: str, mass: str, htc: str) -> Model:
        return model_from_dict(
            {
                "title": "Slab",
                "needs": ["air"],
                "nodes": {"a": {"mass": mass, "specific_heat": "0.9 [kJ/(kg K)]"}, "b": {"capacitance": "1 [J/K]"}},
                "conductors": {
                    "c": {
                        "kind": "conduction",
                        "between": ["a", "b"],
                        "conductivity": "130 [W/(m K)]",
                        "area": area,
                        "thickness": thickness,
                    }
                },
                "surfaces": {"s": {"of": "b", "to": "air", "area": area, "htc": htc}},
            }
        )

    one = compile_network(slab("4.7 [mm]", "29.2 [cm^2]", "737 [g]", "2.1 [W/(m^2 K)]")).numbers()
    other = compile_network(slab("0.0047 [m]", "0.00292 [m^2]", "0.737 [kg]", "0.0021 [kW/(m^2 K)]")).numbers()
    assert one.capacitances == other.capacitances
    assert [r.coefficients for r in one.conductors] == [r.coefficients for r in other.conductors]


def test_derivatives_against_finite_differences() -> None:
    model = model_from_dict(
        {
            "title": "All",
            "needs": ["air"],
            "parameters": {"side": "0.3 [m]", "k": "20 [W/(m K)]", "share": 0.2, "c": "900 [J/(kg K)]", "p": "4 [W]"},
            "nodes": {"a": {"mass": "1 [kg]", "specific_heat": "c"}, "b": {"capacitance": "50 [J/K]"}},
            "surfaces": {
                "s": {"of": "a", "to": "air", "area": "side**2", "htc": "5 [W/(m^2 K)]", "emissivity": "share"},
                "t": {"of": "b", "to": "air", "area": "(1 - share)*side**2", "effective_htc": "5 [W/(m^2 K)]"},
            },
            "joints": {"j": {"between": ["s", "t"], "area": "share*side**2", "conductivity": "k", "thickness": "side/100"}},
            "conductors": {
                "c1": {
                    "kind": "convection",
                    "between": ["a", "air"],
                    "htc": {"coefficient": "2 [W/(m^2 K)]", "exponent": "share"},
                    "area": "side**2",
                }
            },
            "loads": {"q": {"into": "a", "power": "p*(1 - share)"}},
        }
    )
    network = compile_network(model)
    base = network.numbers()
    paths = ("side", "k", "share", "c", "p", "s.htc")
    point = {p: float(base.values[p]) for p in paths}

    def flatly(values: dict[str, Any]) -> list[Any]:
        found = network.numbers(values)
        return (
            [c for r in found.conductors for c in r.coefficients]
            + list(found.capacitances.values())[:2]
            + [c for r in found.loads for c in r.coefficients]
        )

    dual = flatly({p: Dual(point[p], unit) for p, unit in zip(paths, np.eye(len(paths)), strict=True)})
    for k, path in enumerate(paths):
        h = 1e-5 * point[path]
        up, down = flatly({**point, path: point[path] + h}), flatly({**point, path: point[path] - h})
        for number, high, low in zip(dual, up, down, strict=True):
            scale = max(abs(value_of(number)) / point[path], 1e-12)
            assert gradient_of(number, len(paths))[k] == pytest.approx((high - low) / (2 * h), rel=1e-7, abs=1e-8 * scale)
    assert [value_of(n) for n in dual] == pytest.approx(flatly({}), rel=1e-15)


def test_numbers_at_other_values_leave_the_first_alone() -> None:
    network = compile_network(box(htc="5 [W/(m^2 K)]"))
    first = network.numbers()
    changed = network.numbers({"skin.htc": 7.0})
    assert changed.conductors[0].coefficients[0] == pytest.approx(7 * 0.05)
    assert network.numbers().conductors[0].coefficients == first.conductors[0].coefficients
    assert changed.loads[0] is first.loads[0]


def test_negative_conductance_at_other_values() -> None:
    with raises_code("value.outside-range", DeckError, match=r"surfaces\.skin\.htc.*'skin\.htc'.*-1"):
        compile_network(box(htc="5 [W/(m^2 K)]")).numbers({"skin.htc": -1.0})


# hierarchy ---------------------------------------------------------------------------------------------------------------------------


def test_nested_equals_flat() -> None:
    """Property 4, on the rows: names apart, a tree and its flat twin are the same network."""
    part = model_from_dict(
        {
            "title": "Box",
            "needs": ["air"],
            "offers": ["case"],
            "nodes": {"case": {"capacitance": "100 [J/K]"}},
            "conductors": {"out": {"kind": "conduction", "between": ["case", "air"], "conductance": "0.2 [W/K]"}},
        }
    )
    level = model_from_dict(
        {"title": "L1", "needs": ["room"], "offers": ["p.case"], "submodels": {"p": {"use": part, "bind": {"air": "room"}}}}
    )
    top = model_from_dict(
        {
            "title": "L2",
            "needs": ["hall"],
            "nodes": {"base": {"capacitance": "50 [J/K]"}},
            "submodels": {"x": {"use": level, "bind": {"room": "hall"}}, "y": {"use": level, "bind": {"room": "base"}}},
            "conductors": {"c": {"kind": "conduction", "between": ["x.p.case", "base"], "conductance": "1 [W/K]"}},
        }
    )
    found = compile_network(top)
    assert found.nodes == ("base", "x.p.case", "y.p.case")
    assert found.boundaries == ("hall",)
    assert {(r.name, r.ends, r.coefficients) for r in found.numbers().conductors} == {
        ("c", ("x.p.case", "base"), (1.0,)),
        ("x.p.out", ("x.p.case", "hall"), (0.2,)),
        ("y.p.out", ("y.p.case", "base"), (0.2,)),
    }
    assert found.find("y.p.air") == "base"


def test_prescribed_nodes_become_boundaries() -> None:
    model = box(htc="5 [W/(m^2 K)]")
    other = model_from_dict(
        {
            "title": "W",
            "needs": ["air"],
            "nodes": {"n": {"capacitance": "1 [J/K]"}},
            "submodels": {"b": {"use": model, "bind": {"air": "n"}}},
            "aliases": {"T": "n"},
        }
    )
    network = compile_network(other, prescribed=["T"])
    assert (network.nodes, network.boundaries, network.prescribed) == (("b.case",), ("air", "n"), ("n",))
    assert list(network.numbers().capacitances) == ["b.case"]
    with raises_code("name.unknown", NameNotFoundError, match=r"'b\.csae'.*'b\.case'"):
        compile_network(other, prescribed=["b.csae"])
    with raises_code("model.nothing-to-solve", DeckError):
        compile_network(model, prescribed=["case"])


def test_rows_of_loads() -> None:
    model = model_from_dict(
        {
            "title": "L",
            "needs": ["air"],
            "nodes": {"n": {"capacitance": "1 [J/K]"}},
            "loads": {
                "a": {"into": "n", "power": "2 [W]", "command_curve": 0.1},
                "b": {"into": "n", "power": "2 [W]", "sine": {"amplitude": "0.5 [W]", "period": "1 [h]"}},
                "c": {"into": "n", "power": "2 [W]", "proportional": {"gain": "0.5 [W/K]", "setpoint": "20 [degC]"}},
            },
        }
    )
    found = [(r.name, r.form, r.coefficients, r.signal) for r in compile_network(model).numbers().loads]
    assert found == [
        ("a", "signal", (2.0,), "load a"),
        ("a", "signal", (0.2,), "curve a"),
        ("b", "signal", (2.0,), "load b"),
        ("b", "signal", (0.5,), "sine b"),
        ("c", "signal", (2.0, 0.5, 293.15), "load c"),
    ]


# gases -------------------------------------------------------------------------------------------------------------------------------


def test_air_by_default() -> None:
    assert list(rows(box(htc="5 [W/(m^2 K)]", emissivity=0.3))) == ["skin linear", "skin.radiation radiation"]
    assert list(rows(box(effective_htc="6 [W/(m^2 K)]"))) == ["skin linear"]
    assert list(rows(box(effective_htc="6 [W/(m^2 K)]"), Environment(Constant(0.9 * ATMOSPHERE)))) == ["skin linear"]


def test_vacuum_takes_convection_and_leaves_radiation() -> None:
    found = rows(box(htc="5 [W/(m^2 K)]", emissivity=0.3), EMPTY)
    assert found["skin linear"].coefficients == (0.0,)
    assert found["skin.radiation radiation"].coefficients[0] == pytest.approx(0.3 * 5.670374419e-8 * 0.05, rel=1e-15)


def test_vacuum_leaves_of_an_effective_coefficient_its_radiation() -> None:
    found = rows(box(effective_htc="6 [W/(m^2 K)]", emissivity=0.3), EMPTY)
    assert list(found) == ["skin radiation"]
    assert found["skin radiation"].coefficients[0] == pytest.approx(0.3 * 5.670374419e-8 * 0.05, rel=1e-15)


def test_vacuum_of_an_effective_coefficient_is_refused() -> None:
    """The words of section 7 of the architecture: effective, contains radiation, give its emissivity, or ask for as printed."""
    with raises_code("model.needs-gas-law", ScenarioError, match=r"surfaces\.skin.*'skin'"):
        rows(box(effective_htc="6 [W/(m^2 K)]"), EMPTY)


def test_vacuum_as_printed_sets_the_coefficient_to_exactly_zero() -> None:
    for emissivity in ({}, {"emissivity": 0.3}):
        found = rows(box(effective_htc="6 [W/(m^2 K)]", **emissivity), EMPTY, as_printed=True)
        assert list(found) == ["skin linear"]
        assert found["skin linear"].coefficients == (0.0,)


def test_solids_do_not_feel_the_pressure() -> None:
    model = model_from_dict(
        {
            "title": "S",
            "needs": ["air"],
            "nodes": {"n": {"capacitance": "1 [J/K]"}},
            "conductors": {"c": {"kind": "contact", "between": ["n", "air"], "contact_conductance": "9 [W/(m^2 K)]", "area": "1 [m^2]"}},
        }
    )
    assert rows(model, EMPTY)["c linear"].coefficients == (9.0,)
    assert rows(model, Environment(Constant(1000.0)))["c linear"].coefficients == (9.0,)


@pytest.mark.parametrize("pressure", [2e6, float("nan")])
def test_a_pressure_beyond_dilute_gases_or_none_is_refused(pressure: float) -> None:
    with raises_code("value.outside-range", ScenarioError, match=r"1\.013e\+06"):
        Environment(Constant(pressure))


def test_changing_pressure_switches_rows() -> None:
    pump = Environment(TableSignal(np.array([0.0, 600.0]), np.array([ATMOSPHERE, 1e-3]), hold=True))
    found = rows(box(htc="5 [W/(m^2 K)]", emissivity=0), pump)
    assert list(found) == ["skin linear gas *", "skin.radiation radiation"]
    assert list(rows(box(effective_htc="6 [W/(m^2 K)]", emissivity=0.3), pump, gas="air")) == [
        "skin linear gas air",
        "skin radiation no gas air",
    ]
    assert list(rows(box(effective_htc="6 [W/(m^2 K)]"), pump, as_printed=True)) == ["skin linear gas *"]
    signals = Media({"air": pump}).signals()
    times = np.array([0.0, 599.0, 600.0, 9000.0])
    assert signals["gas air"].at(times).tolist() == [1.0, 1.0, 0.0, 0.0]
    assert signals["no gas air"].at(times).tolist() == [0.0, 0.0, 1.0, 1.0]
    assert Media({"air": EMPTY}).signals() == {}


def test_changing_pressure_of_an_effective_coefficient_is_refused_too() -> None:
    pump = Environment(TableSignal(np.array([0.0, 600.0]), np.array([ATMOSPHERE, 0.0]), hold=True))
    with raises_code("model.needs-gas-law", ScenarioError):
        rows(box(effective_htc="6 [W/(m^2 K)]"), pump)


def test_one_gas_is_not_the_other() -> None:
    model = model_from_dict(
        {
            "title": "Two",
            "needs": ["air", "inner"],
            "nodes": {"n": {"capacitance": "1 [J/K]"}},
            "surfaces": {
                "out": {"of": "n", "to": "air", "area": "1 [m^2]", "htc": "5 [W/(m^2 K)]", "emissivity": 0},
                "in_": {"of": "n", "to": "inner", "area": "1 [m^2]", "htc": "3 [W/(m^2 K)]"},
            },
        }
    )
    found = rows(model, EMPTY, gas="air")
    assert found["out linear"].coefficients == (0.0,)
    assert found["in_ linear"].coefficients == (3.0,)


@pytest.mark.parametrize(
    ("given", "code", "match"),
    [
        ({"humidity": 1.2}, "value.outside-range", r"1\.2.*0.*1"),
        ({"humidity": -0.1}, "value.outside-range", r"-0\.1"),
        ({"humidity": float("nan")}, "value.outside-range", ""),
        ({"pressure": Constant(-1.0)}, "value.outside-range", "0"),
        ({"pressure": TableSignal(np.array([0.0, 1.0]), np.array([1e5, -1.0]))}, "value.outside-range", ""),
        ({"pressure": Sine(1e5, 2e5, 10.0)}, "value.outside-range", ""),
        ({"gravity": -1.0}, "value.outside-range", ""),
        ({"gas": "argon"}, "name.unknown", "'argon'"),
        ({"sealed": True, "vented": "air", "time_constant": 5.0}, "value.excludes-another", ""),
        ({"vented": "air"}, "value.incomplete", ""),
    ],
)
def test_states_that_do_not_exist(given: dict[str, Any], code: str, match: str) -> None:
    with raises_code(code, match=match):
        Environment(**given)


def test_humidity_changes_nothing() -> None:
    """Acceptance sheet, H1: it does not enter the classical equations."""
    dry, wet = (rows(box(htc="5 [W/(m^2 K)]"), Environment(humidity=h)) for h in (0.1, 0.9))
    assert [r.coefficients for r in dry.values()] == [r.coefficients for r in wet.values()]


def test_a_network_is_kept_with_its_model_until_the_duration_or_what_is_driven_is_another() -> None:
    link = {"kind": "conduction", "between": ["a", "b"], "conductivity": "1 [W/(m K)]", "area": "1 [m^2]", "thickness": "1 [m]"}
    model = td.model_from_dict({"title": "two", "nodes": {n: {"capacitance": "1 [J/K]"} for n in "ab"}, "conductors": {"k": link}})
    hour = td.Scenario("hour", start="20 [degC]", duration="1 [h]")
    first = compile_network(model, media=hour.media())
    assert compile_network(model, media=hour.media()) is first
    assert compile_network(model, media=hour.with_(duration=60.0).media()).media.seconds == 60.0
    assert compile_network(model, media=hour.media(), prescribed=["a"]).nodes == ("b",)
    for k in range(2 * KEPT_NETWORKS):
        compile_network(model, media=hour.with_(duration=100.0 + k).media())
    assert compile_network(model, media=hour.media()) is not first, "old ones give way"
