"""Values: units at the place where they were written, bounds, circles, precedence, layers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from by_code import raises_code
from thermid.base.errors import DeckError, ExpressionError, NameNotFoundError, UnitError
from thermid.base.units import Dual
from thermid.model._parts.parameter import Parameter
from thermid.model._tree.flat import Flat
from thermid.model._tree.model import Model
from thermid.model._tree.tree import ParameterSet
from thermid.simulation.runs import compile_network

Build = Callable[..., Model]


def value(model: Model, path: str) -> float:
    return float(Flat.of_model(model).parameters.evaluate({})[path])


# units -------------------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "code", "match"),
    [
        ({"parameters/area": "0.05 [m]"}, "unit.wrong-dimension", r"parameters\.area.*'\[m\]'.*\[m\^2\]"),
        ({"nodes/case/mass": "1 [s]"}, "unit.wrong-dimension", r"nodes\.case\.mass.*'\[s\]'.*\[kg\]"),
        (
            {"surfaces/skin/htc": "5 [W/K]"},
            "unit.wrong-dimension",
            r"surfaces\.skin\.htc.*'\[W/K\]'.*\[W/\(m\^2 K\)\]",
        ),
        ({"surfaces/skin/emissivity": "0.3 [m]"}, "unit.wrong-dimension", r"surfaces\.skin\.emissivity.*'\[m\]'.*\[1\]"),
        ({"loads/heat/power": "power*area"}, "unit.wrong-dimension", r"loads\.heat\.power"),
        ({"loads/heat/power": "10 [degC]"}, "unit.wrong-dimension", r"loads\.heat\.power.*'\[degC\]'.*\[W\]"),
        (
            {"loads/heat": {"into": "case", "power": "1 [W]", "thermostat": {"on_below": "5 [W]", "off_above": "6 [degC]"}}},
            "unit.wrong-dimension",
            r"loads\.heat\.thermostat\.on_below.*'\[W\]'.*\[degC\].*\[K\]",
        ),
        (
            {"parameters/rate": "10 [degC/min]"},
            "unit.scale-in-product",
            r"parameters\.rate.*'\[degC/min\]'",
        ),
        (
            {"parameters/area": "0.05 [m^2] + 1 [m^2]"},
            "expression.unit-misplaced",
            r"parameters\.area.*'0\.05 \[m\^2\] \+ 1 \[m\^2\]'.*0\.5",
        ),
        ({"parameters/area": "power + 0.05"}, "expression.mixed-dimensions", r"parameters\.area.*'power \+ 0\.05'.*'power \+ 0\.05'"),
        ({"parameters/area": "-0.05 [m^2]"}, "value.outside-range", r"parameters\.area.*'skin\.area'.*-0\.05.*2"),
    ],
)
def test_wrong_dimension_where_it_was_written(part: Build, changes: dict[str, Any], code: str, match: str) -> None:
    with raises_code(code, match=match):
        compile_network(part(changes))


def test_wrong_dimension_in_set_is_shown_there(pair: Build) -> None:
    with raises_code("unit.wrong-dimension", UnitError, match=r"set\.a\.area.*'\[m\]'.*\[m\^2\]"):
        Flat.of_model(pair({"set": {"a.area": "1 [m]"}}))


def test_wrong_dimension_laid_over_is_shown_with_its_origin(part: Build) -> None:
    with raises_code("unit.wrong-dimension", UnitError, match=r"'\[m\]'"):
        Flat.of_model(part().with_values({"area": "1 [m]"}, origin="stage one"))


def test_temperature_in_a_slot_of_differences(part: Build) -> None:
    """No field of a deck is a difference; a sine of a signal is."""
    from thermid.model._laws.signal import signal

    with raises_code("unit.scale-for-difference", UnitError, match=r"'\[degC\]'.*\[K\]"):
        signal({"mean": "24 [degC]", "amplitude": "3 [degC]", "period": "24 [h]"}, "temperature")
    with raises_code("unit.scale-for-difference", UnitError):
        part(
            {
                "conductors": {
                    "c": {
                        "kind": "table",
                        "between": ["case", "air"],
                        "table": {"over": "difference", "points": [["1 [degC]", "1 [W/K]"], ["2 [K]", "1 [W/K]"]]},
                    }
                }
            }
        )


def test_millimetres_and_metres_are_the_same_values(part: Build) -> None:
    one = part({"parameters/area": "500 [cm^2]", "nodes/case/mass": "1500 [g]"})
    assert Flat.of_model(one).parameters.evaluate({}) == Flat.of_model(part()).parameters.evaluate({})


# bounds ------------------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("given", "code", "match"),
    [
        ({"value": "3 [W]", "min": 5, "max": 2}, "value.outside-range", " 5 .* 2[. ]"),
        ({"value": "3 [W]", "min": "5 [m]"}, "unit.wrong-dimension", r"'5 \[m\]'"),
        ({"value": "3 [W]", "max": "p"}, "value.wrong-kind", "'p'"),
        ({"value": "3 [W]", "max": float("nan")}, "value.wrong-kind", "nan"),
        ({"value": "3 [W]", "source": "guess"}, "name.unknown", "'guess' .* published, datasheet, derived, assumed, measured"),
        ({"value": "3 [W]", "mni": 2}, "value.wrong-kind", "value, min, max, source, note, basis .* spread.* mni"),
        ({"min": 2}, "value.wrong-kind", "value, min, max, .*: .*value[.]"),
        (True, "value.wrong-kind", r"True .*'2\.5 \[W\]'"),
        (float("nan"), "value.wrong-kind", r"nan .*'2\.5 \[W\]'"),
        (None, "value.wrong-kind", r"None .*'2\.5 \[W\]'"),
    ],
)
def test_bad_parameter(given: Any, code: str, match: str) -> None:
    with raises_code(code, match=match) as caught:
        Parameter.read(given, "here")
    assert caught.value.where == "here"


def test_bounds_are_in_the_values_own_unit() -> None:
    given = Parameter.read({"value": "20 [degC]", "min": -10, "max": "323.15 [K]"})
    assert (given.minimum, given.maximum) == (263.15, 323.15)
    assert Parameter.read({"value": "1 [kW]", "max": float("inf")}).maximum == float("inf")


def test_numbers_of_numpy_are_numbers() -> None:
    assert Parameter.read(np.float64(0.3)).expression.literal.value == 0.3  # type: ignore[union-attr]
    assert Parameter.read(np.int64(3)).expression.literal.value == 3.0  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("power", "match"),
    [
        (
            {"value": "0.5 [W]", "min": 1.0},
            r"parameters\.power.*0\.5.*1.*\[W\]",
        ),
        ({"value": "9000 [mW]", "max": 8000}, r"parameters\.power.*9000.*8000.*\[mW\]"),
        ({"value": "area*100*a", "max": 2.0}, r"parameters\.power.*5.*2.*\[1\]"),
    ],
)
def test_value_outside_its_bounds(part: Build, power: dict[str, Any], match: str) -> None:
    with raises_code("value.outside-range", DeckError, match=match):
        Flat.of_model(part({"parameters/power": power, "parameters/a": "1 [W/m^2]"}))


def test_bounds_hold_for_values_from_above(part: Build, pair: Build) -> None:
    with raises_code("value.outside-range", DeckError, match="9.*8"):
        Flat.of_model(part().with_values({"power": "9 [W]"}))
    with raises_code("value.outside-range", DeckError, match=r"set\.a\.power.*9000.*8000"):
        Flat.of_model(pair({"set": {"a.power": "9000 [mW]"}}))
    wider = pair({"set": {"a.power": {"value": "9 [W]", "max": 10}}})
    assert value(wider, "a.power") == 9.0


# expressions -------------------------------------------------------------------------------------------------------------------------


def test_circle_is_printed(part: Build) -> None:
    with raises_code("model.self-reference", ExpressionError, match=r"parameters\.area.*'area'"):
        Flat.of_model(part({"parameters/area": "2*exposed", "parameters/exposed": "total", "parameters/total": "area/3"}))


def test_circle_of_one(part: Build) -> None:
    with raises_code("model.self-reference", ExpressionError, match="'area'"):
        Flat.of_model(part({"parameters/area": "area"}))


def test_circle_through_set(pair: Build) -> None:
    with raises_code("model.self-reference", ExpressionError, match=r"'a\.area'.*a\.area.*b\.area.*a\.area"):
        Flat.of_model(pair({"set": {"a.area": "b.area", "b.area": "a.area"}}))


def test_no_finite_value(part: Build) -> None:
    with raises_code("expression.no-finite-value", ExpressionError, match=r"parameters\.area.*'1/zero'"):
        Flat.of_model(part({"parameters/area": "1/zero", "parameters/zero": "0 [1/m^2]"}))
    with raises_code("expression.no-finite-value", ExpressionError, match=r"'x\*\*0\.5'"):
        Flat.of_model(part({"parameters/r": "x**0.5", "parameters/x": "0 - 2"}))


def test_names_resolve_where_they_are_written(pair: Build) -> None:
    """`area` in a part's deck is the part's own; in [set] a path starts at the setting deck."""
    model = pair({"parameters": {"area": "1 [m^2]"}, "set": {"a.area": "area/10"}})
    assert value(model, "a.skin.area") == 0.1
    assert value(model, "b.skin.area") == 0.05


# precedence --------------------------------------------------------------------------------------------------------------------------


def test_precedence_step_by_step(part: Build, pair: Build) -> None:
    """A part's deck < values over the part < the user's [set] < values over the user; the rest is listed as shadowed."""
    box = part()
    assert value(box, "power") == 4.0
    fitted = box.with_values({"power": "5 [W]"}, origin="stage Box")
    assert value(fitted, "power") == 5.0
    above = pair({"submodels/a/use": fitted})
    assert value(above, "a.power") == 5.0
    setting = pair({"submodels/a/use": fitted, "set": {"a.power": "6 [W]"}})
    assert value(setting, "a.power") == 6.0
    last = setting.with_values({"a.power": "7 [W]"}, origin="command line").with_values({"first.power": "7.5 [W]"}, origin="again")
    assert value(last, "a.power") == 7.5
    assert value(last, "a.heat.power") == 7.5
    entry = ParameterSet(last).table["a.power"]
    assert entry.origin == "again"
    assert entry.shadowed == (("Box", "4 [W]"), ("stage Box", "5 [W]"), ("[set] of Pair", "6 [W]"), ("command line", "7 [W]"))
    assert (entry.parameter.minimum, entry.parameter.maximum) == (1.0, 8.0)
    assert value(last, "b.power") == 4.0


def test_outermost_deck_wins(pair: Build) -> None:
    from thermid.model._deck.modelfile import model_from_dict

    inner = pair({"set": {"a.power": "6 [W]"}})
    outer = model_from_dict(
        {
            "title": "Whole",
            "needs": ["room"],
            "submodels": {"p": {"use": inner, "bind": {"room": "room"}}},
            "set": {"p.first.power": "2 [W]"},
        }
    )
    assert value(outer, "p.a.power") == 2.0


def test_values_over_a_model_change_nothing_else(part: Build) -> None:
    box = part()
    warm = box.with_values({"power": "5 [W]"})
    assert value(box, "power") == 4.0
    assert box.layers == ()
    assert box.with_values({}) is box
    assert warm.with_values({"area": "0.06 [m^2]"}).layers[0] == warm.layers[0]


def test_value_laid_over_may_be_derived(part: Build) -> None:
    assert value(part().with_values({"skin.area": "area/2"}), "skin.area") == 0.025


def test_fitted_values_come_in(part: Build) -> None:
    class Fitted:
        def as_parameter(self) -> Any:
            return Parameter.read({"value": "5.5 [W]", "source": "measured"})

    warm = part().with_values({"power": Fitted()})
    found = ParameterSet(warm).table["power"].parameter
    assert (found.text, found.source, found.maximum) == ("5.5 [W]", "measured", 8.0)


def test_unknown_value(part: Build) -> None:
    with raises_code("name.unknown", NameNotFoundError, match="'powr'.*'power'"):
        part().with_values({"powr": "1 [W]"})


# the parameter set -------------------------------------------------------------------------------------------------------------------


def test_overrides_and_what_lies_downstream(part: Build) -> None:
    values = ParameterSet(part({"parameters/half": "area/2", "surfaces/skin/area": "half"}))
    assert set(values.downstream(["area"])) == {"area", "half", "skin.area"}
    everything = values.evaluate({})
    some = values.evaluate({"area": 1.0}, values.downstream(["area"]), everything)
    assert some["skin.area"] == 0.5
    assert some["power"] == 4.0
    dual = values.evaluate({"area": Dual(1.0, np.array([1.0]))})["skin.area"]
    assert (dual.value, dual.gradient[0]) == (0.5, 0.5)


def test_what_may_be_freed(part: Build) -> None:
    model = part({"parameters/half": "area/2", "surfaces/skin/area": "half"})
    values = ParameterSet(model)
    assert values.freeable("heat.power", model.canonical) == "power"
    with raises_code("model.refused", DeckError, match=r"'skin\.area'"):
        values.freeable("skin.area", model.canonical)
    with raises_code("name.unknown", NameNotFoundError, match="'aera'.*'area'"):
        values.freeable("aera", model.canonical)


def test_interfaces_are_own_literals_and_settings(pair: Build) -> None:
    model = pair({"set": {"a.skin.htc": "4 [W/(m^2 K)]", "b.area": "a.area"}, "parameters": {"k": "1", "derived": "2*k"}})
    assert model.interfaces() == ("k", "stack.area", "stack.contact_conductance", "a.skin.htc")
