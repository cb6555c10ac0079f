"""What an element must and may hold; resistances, thicknesses, capacitances and areas that cannot be."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from by_code import raises_code
from thermid.base.errors import DeckError, code_of
from thermid.model._deck.modelfile import model_from_dict
from thermid.model._laws.stores import curve
from thermid.model._parts.elements import KINDS, Facing
from thermid.model._tree.areas import ledger
from thermid.model._tree.model import Model
from thermid.simulation._network import rows
from thermid.simulation.runs import compile_network
from unit.model.every_kind import CASES

Build = Callable[..., Model]
POWERS = {"points": [["0 [degC]", "1 [W]"], ["50 [degC]", "2 [W]"]]}


def conductor(**fields: Any) -> dict[str, Any]:
    return {"conductors/c": {"kind": "conduction", "between": ["case", "air"], **fields}}


def conductance(model: Model, name: str = "c") -> float:
    return next(float(row.coefficients[0]) for row in compile_network(model).numbers().conductors if row.name == name)


@pytest.mark.parametrize(
    ("changes", "code", "match"),
    [
        (
            conductor(),
            "value.incomplete",
            r"conductors\.c.*'conduction'",
        ),
        (conductor(conductance="1 [W/K]", resistance="1 [K/W]"), "value.incomplete", r"conductors\.c.*'conduction'"),
        (conductor(conductance="1 [W/K]", htc="1 [W/(m^2 K)]"), "value.incomplete", r"conductors\.c.*'conduction'"),
        (conductor(conductance="1 [W/K]", between=["case", "case"]), "model.self-reference", r"conductors\.c"),
        (
            conductor(conductance="1 [W/K]", table={"points": [["0 [degC]", "1 [W/K]"], ["9 [degC]", "1 [W/K]"]]}),
            "value.without-effect",
            "'conduction'",
        ),
        (conductor(kind="table"), "value.without-effect", "'table'"),
        (
            conductor(kind="table", table={"points": [["0 [degC]", "1 [W/K]"]]}),
            "model.law-refused",
            r"conductors\.c",
        ),
        (
            conductor(kind="table", table={"points": [["9 [degC]", "1 [W/K]"], ["0 [degC]", "1 [W/K]"]]}),
            "model.law-refused",
            r"conductors\.c",
        ),
        (
            {"nodes/case": {"mass": "1 [kg]"}},
            "value.incomplete",
            r"nodes\.case.*specific_heat",
        ),
        ({"nodes/case/capacitance": "1 [J/K]"}, "value.incomplete", "specific_heat"),
        ({"surfaces/skin/effective_htc": "5 [W/(m^2 K)]"}, "value.excludes-another", r"surfaces\.skin"),
        ({"surfaces/skin/htc": None}, "value.incomplete", r"surfaces\.skin.*effective_htc"),
        ({"loads/heat/power": None}, "value.incomplete", r"loads\.heat"),
        (
            {"loads/heat/temperature_coefficient": "0.01 [1/K]"},
            "value.incomplete",
            "temperature_coefficient.*reference_temperature.*`power`",
        ),
        ({"loads/heat/scale": 2}, "value.without-effect", r"loads\.heat"),
        (
            {
                "loads/heat": {
                    "into": "case",
                    "power": "1 [W]",
                    "exponential_coefficient": "0.1 [1/K]",
                    "quadratic_coefficient": "0.1 [1/K^2]",
                    "reference_temperature": "300 [K]",
                }
            },
            "value.incomplete",
            "exponential_coefficient",
        ),
        (
            {
                "loads/heat": {
                    "into": "case",
                    "power": "1 [W]",
                    "proportional": {"band": "9 [K]", "setpoint": "1 [degC]"},
                    "thermostat": {"on_below": "1 [degC]", "off_above": "2 [degC]"},
                }
            },
            "value.excludes-another",
            r"loads\.heat",
        ),
        (
            {"loads/heat": {"into": "case", "power": "1 [W]", "proportional": {"setpoint": "1 [degC]"}}},
            "value.incomplete",
            r"\[W/K\].*\[K\]",
        ),
        (
            {"loads/heat": {"into": "case", "table": POWERS, "proportional": {"gain": "1 [W/K]", "setpoint": "1 [degC]"}}},
            "value.incomplete",
            "W/K",
        ),
        (
            {"loads/heat": {"into": "case", "table": POWERS, "temperature_coefficient": "1 [1/K]", "reference_temperature": "1 [degC]"}},
            "value.excludes-another",
            "temperature_coefficient",
        ),
    ],
)
def test_what_an_element_must_hold(part: Build, changes: dict[str, Any], code: str, match: str) -> None:
    with raises_code(code, DeckError, match=match):
        part(changes)


def test_joint_of_one_surface(pair: Build) -> None:
    with raises_code("model.self-reference", DeckError, match=r"joints\.stack"):
        pair({"joints/stack/between": ["a.skin", "a.skin"]})
    with raises_code("value.incomplete", DeckError, match="contact_conductance"):
        pair({"joints/stack/thickness": "1 [mm]"})


@pytest.mark.parametrize(
    ("changes", "match"),
    [
        (
            conductor(resistance="0 [K/W]"),
            r"conductors\.c\.resistance.*'c\.resistance'.*0.*K/W",
        ),
        (
            conductor(conductivity="1 [W/(m K)]", area="1 [m^2]", thickness="0 [mm]"),
            r"conductors\.c\.thickness.*'c\.thickness'.*0",
        ),
        (
            conductor(
                kind="heat_pipe", on_conductance="1 [W/K]", off_conductance="1 [W/K]", start_temperature="1 [degC]", transition="0 [K]"
            ),
            r"conductors\.c\.transition.*'c\.transition'.*0",
        ),
        (
            conductor(
                kind="heat_pipe", on_conductance="-1 [W/K]", off_conductance="1 [W/K]", start_temperature="1 [degC]", transition="1 [K]"
            ),
            r"conductors\.c\.on_conductance.*'c\.on_conductance'.*-1.*W/K",
        ),
        (
            conductor(conductance="-1 [W/K]"),
            r"conductors\.c\.conductance.*'c\.conductance'.*-1.*W/K",
        ),
        (conductor(conductivity="1 [W/(m K)]", area="1 [m^2]", thickness="-1 [mm]"), r"'c\.thickness'.*-0\.001"),
        ({"surfaces/skin/htc": "-5 [W/(m^2 K)]"}, r"surfaces\.skin\.htc.*'skin\.htc'.*-5.*2"),
        (
            {"nodes/case/mass": "0 [kg]"},
            r"nodes\.case\.mass.*'case\.mass'.*0",
        ),
        ({"nodes/case/mass": "-1 [kg]"}, r"'case\.mass'.*-1"),
        ({"nodes/case": {"capacitance": "inf [J/K]"}}, r"'case\.capacitance'.*J/K"),
        (
            {"loads/heat/thermostat": {"on_below": "30 [degC]", "off_above": "20 [degC]"}},
            r"loads\.heat.*on_below.*off_above",
        ),
    ],
)
def test_values_that_cannot_be(part: Build, changes: dict[str, Any], match: str) -> None:
    with raises_code("value.outside-range", DeckError, match=match):
        compile_network(part(changes))


def test_open_paths_are_fine(part: Build) -> None:
    """An infinite resistance and a zero conductance carry no heat, in finite numbers."""
    assert conductance(part(conductor(resistance="inf [K/W]"))) == 0.0
    assert conductance(part(conductor(conductance="0 [W/K]"))) == 0.0
    assert conductance(part(conductor(kind="convection", htc="0 [W/(m^2 K)]", area="1 [m^2]"))) == 0.0
    assert conductance(part({"surfaces/skin/htc": "0 [W/(m^2 K)]"}), "skin") == 0.0


@pytest.mark.parametrize(("fields", "result"), CASES)
def test_leading_coefficient_of_every_kind(part: Build, fields: dict[str, Any], result: float) -> None:
    assert conductance(part(conductor(**fields))) == pytest.approx(result, rel=1e-14)


def test_every_kind_has_a_case() -> None:
    assert {fields["kind"] for fields, _ in CASES} == set(KINDS)


def test_conductance_at_given_temperatures() -> None:
    hot, cold = np.array([309.088]), np.array([297.15])
    shape = curve("temperature", [(290.0, 1.0), (310.0, 2.0)])
    assert rows.conductance("linear", (2.0,), None, hot, cold).tolist() == [2.0]
    assert rows.conductance("power", (2.0, 0.25), None, hot, cold)[0] == pytest.approx(2.0 * 11.938**0.25, rel=1e-6)
    # radiation at 309.088/297.15 K, emissivity 0.3: h = 1.896 W/(m^2 K) (acceptance sheet, B1)
    assert rows.conductance("radiation", (0.3 * 5.670374419e-8,), None, hot, cold)[0] == pytest.approx(1.896, abs=5e-4)
    assert rows.conductance("table", (3.0,), shape, hot, cold)[0] == pytest.approx(3.0 * shape.evaluate(np.array([303.119]))[0], rel=1e-14)
    over = curve("difference", [(0.0, 1.0), (20.0, 2.0)])
    assert rows.conductance("table", (1.0,), over, hot, cold)[0] == pytest.approx(over.evaluate(np.array([11.938]))[0], rel=1e-14)


def test_curves_are_monotone_and_constant_beyond_their_ends() -> None:
    shape = curve("temperature", [(280.0, 1.0), (300.0, 2.0), (301.0, 5.0), (320.0, 5.0)])
    fine = shape.evaluate(np.linspace(270.0, 330.0, 601))
    assert (np.diff(fine) >= -1e-12).all()
    assert (fine[0], fine[-1]) == (1.0, 5.0)
    assert shape.slopes[[0, -1]].tolist() == [0.0, 0.0]
    assert shape.evaluate(shape.x).tolist() == shape.y.tolist()
    assert shape == curve("temperature", [(280.0, 1.0), (300.0, 2.0), (301.0, 5.0), (320.0, 5.0)])
    assert hash(shape) == hash(curve("temperature", [(280.0, 1.0), (300.0, 2.0), (301.0, 5.0), (320.0, 5.0)]))
    assert shape != curve("difference", [(280.0, 1.0), (300.0, 2.0), (301.0, 5.0), (320.0, 5.0)])


# areas -------------------------------------------------------------------------------------------------------------------------------


def test_over_allocated_area_names_both_joints(pair: Build) -> None:
    more = {"between": ["a.skin", "b.skin"], "area": "490 [cm^2]", "contact_conductance": "9 [W/(m^2 K)]"}
    model = pair({"joints/more": more})
    for ask in (ledger, compile_network):
        with pytest.raises(DeckError) as caught:
            ask(model)  # type: ignore[operator]
        said = str(caught.value)
        assert code_of(said) == "value.contradicts"
        assert "'a.skin' has 500 cm^2, but 'stack'" in said
        assert code_of(said) == "value.contradicts"


def test_a_surface_may_be_used_up(pair: Build) -> None:
    model = pair({"joints/stack/area": "500 [cm^2]"})
    line = ledger(model)[0]
    assert (line.surface, line.total, line.exposed, line.contact, line.gap) == ("a.skin", 0.05, 0.0, 0.05, 0.0)
    assert conductance(model, "a.skin") == 0.0


def test_gap_takes_area_from_both_faces(pair: Build) -> None:
    model = pair({"joints/stack/gap": {"area": "100 [cm^2]", "htc": "4 [W/(m^2 K)]", "to": "room"}})
    for line in ledger(model):
        assert line.joints == {"stack": pytest.approx(0.012, rel=1e-15)}
        assert line.exposed == pytest.approx(0.038, rel=1e-14)
    assert conductance(model, "stack.gap") == pytest.approx(4 * 2 * 0.01, rel=1e-15)
    assert conductance(model, "stack.first") == pytest.approx(200 * 0.002, rel=1e-15)


def test_joint_of_two_slabs(pair: Build) -> None:
    model = pair(
        {"joints/stack/contact_conductance": None, "joints/stack/conductivity": "16 [W/(m K)]", "joints/stack/thickness": "4 [mm]"}
    )
    assert conductance(model, "stack.second") == pytest.approx(16 * 0.002 / 0.004, rel=1e-15)


def test_a_conductor_takes_area_from_surfaces() -> None:
    """A contact that is no joint still takes its area from both surfaces, in the ledger and in what is left to convect."""
    deck: dict[str, Any] = {
        "title": "two plates",
        "needs": ["air"],
        "nodes": {"a": {"capacitance": "10 [J/K]"}, "b": {"capacitance": "10 [J/K]"}},
        "surfaces": {
            "s": {"of": "a", "to": "air", "area": "10 [cm^2]", "htc": "5 [W/(m^2 K)]"},
            "t": {"of": "b", "to": "air", "area": "10 [cm^2]", "htc": "5 [W/(m^2 K)]"},
        },
        "conductors": {
            "c": {
                "kind": "contact",
                "between": ["a", "b"],
                "area": "2 [cm^2]",
                "contact_conductance": "100 [W/(m^2 K)]",
                "takes": ["s", "t"],
            }
        },
    }
    lines = {line.surface: line for line in ledger(model_from_dict(deck))}
    assert lines["s"].exposed == pytest.approx(8e-4, rel=1e-12)
    assert lines["t"].contact == pytest.approx(2e-4, rel=1e-12)
    deck["conductors"]["c"]["area"] = "12 [cm^2]"
    with raises_code("value.contradicts", DeckError, match=r"'s'.*10.*cm\^2.*'c'.*12.*cm\^2"):
        ledger(model_from_dict(deck))
    del deck["conductors"]["c"]["area"], deck["conductors"]["c"]["contact_conductance"]
    deck["conductors"]["c"] |= {"kind": "conduction", "conductance": "1 [W/K]"}
    with raises_code("value.incomplete", DeckError, match=r"c\.takes"):
        model_from_dict(deck)


@pytest.mark.parametrize(("tilt", "azimuth"), [(0.0, 360.0), (180.0, -180.0)])
def test_a_surface_looks_up_to_down_and_all_around(tilt: float, azimuth: float) -> None:
    assert Facing(tilt, azimuth) == Facing(tilt, azimuth)
    beyond = 1.0 if tilt else -1.0
    with raises_code("value.outside-range", DeckError):
        Facing(tilt + beyond, azimuth)
    with raises_code("value.outside-range", DeckError):
        Facing(tilt, azimuth - beyond)
