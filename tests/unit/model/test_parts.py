"""Replacing a part, flight models, findings, and the schema for editors."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from by_code import raises_code
from thermid.base.errors import DeckError, NameNotFoundError
from thermid.model._deck.modelfile import load_model, model_from_dict
from thermid.model._tree.flat import Flat
from thermid.model._tree.model import Model
from thermid.model._tree.rules import RULES, findings
from thermid.model._tree.tree import used_offers

Build = Callable[..., Model]
ROOT = Path(__file__).parents[3]


def codes(model: Model, severity: str) -> list[str]:
    return [f.code for f in model.check() if f.severity == severity]


def said(model: Model, severity: str = "") -> list[str]:
    return [str(f) for f in model.check() if not severity or f.severity == severity]


# replace -----------------------------------------------------------------------------------------------------------------------------


def test_replaced_by_itself_is_the_identity(pair: Build) -> None:
    model = pair()
    again = model.replace("a", model.submodels["a"].model)
    assert again == model
    assert again.identity() == model.identity()
    told = pair({"set": {"a.power": "6 [W]"}})
    assert told.replace("a", told.submodel("a")).at("a.power").text == "4 [W]", "the row was the old part's"
    assert told.replace("a", told.submodel("a"), keep=["first.power"]) == told
    assert told.with_part("a", told.submodel("a")) == told


def test_untouched_parts_stay_the_same_object(part: Build, pair: Build) -> None:
    model = pair()
    new = model.replace("first", part({"parameters/area": "0.06 [m^2]"}, title="Larger"))
    assert new.submodels["b"] is model.submodels["b"]
    assert new.submodels["b"].model.identity() == model.submodels["b"].model.identity()
    assert new.submodels["a"].definition != model.submodels["a"].definition
    assert model.submodel("a").title == "Box"
    assert new.submodel("a").title == "Larger"


def test_replacement_without_a_used_port(part: Build, pair: Build) -> None:
    assert used_offers(pair(), "a") == {"skin", "case"}
    assert used_offers(pair(), "b") == {"skin"}
    bare = part({"offers": ["case"]})
    with raises_code("model.refused", DeckError, match="'a'"):
        pair().replace("a", bare)


def test_replacement_with_an_unbound_need(part: Build, pair: Build) -> None:
    with raises_code("model.refused", DeckError):
        pair().replace("b", part({"needs": ["air", "walls"]}))


def test_replacement_may_need_less(part: Build, pair: Build) -> None:
    closed = part({"needs": [], "surfaces/skin/to": "case2", "nodes/case2": {"capacitance": "1 [J/K]"}})
    assert dict(pair().replace("b", closed).submodels["b"].bind) == {}


def test_replacement_may_offer_under_an_alias(part: Build, pair: Build) -> None:
    assert pair().replace("b", part({"offers": ["hull"], "aliases": {"hull": "skin"}})).submodel("b").offers == ("hull",)


def test_replace_deep_inside(part: Build, pair: Build) -> None:
    whole = model_from_dict({"title": "Whole", "needs": ["room"], "submodels": {"p": {"use": pair(), "bind": {"room": "room"}}}})
    new = whole.replace("p.first", part(title="New"))
    assert new.submodel("p.a").title == "New"
    assert new.submodels["p"].definition == whole.submodels["p"].definition, "the pair's own values are still those of its deck"
    assert new.submodel("p").submodels["a"].definition == new.submodel("p.a").identity()
    with raises_code("name.unknown", NameNotFoundError, match="'c'"):
        whole.replace("p.c", part())
    with raises_code("name.unknown", NameNotFoundError, match="'q'"):
        whole.replace("q", part())


def test_instances_of_one_definition_share_its_identity(pair: Build) -> None:
    model = pair({"submodels/b/use": pair().submodel("a")})
    assert model.submodels["a"].definition == model.submodels["b"].definition


# flight models -----------------------------------------------------------------------------------------------------------------------


def bench(part: Build, **lead: Any) -> Model:
    return part(
        {
            "nodes/probe": {"capacitance": "1 [J/K]", "test_only": True},
            "conductors/lead": {"kind": "conduction", "between": ["case", "probe"], "conductance": "0.1 [W/K]", "test_only": True} | lead,
            "offers": ["case", "skin", "probe"],
            "aliases": {"T1": "probe", "hull": "case"},
        }
    )


def test_flight_model_drops_what_belongs_to_the_test(part: Build, pair: Build) -> None:
    model = pair(
        {"submodels/a/use": bench(part), "set": {"a.lead.conductance": "0.2 [W/K]", "a.power": "5 [W]"}, "aliases": {"T": "a.probe"}}
    )
    model = model.with_values({"a.lead.conductance": "0.3 [W/K]", "a.power": "6 [W]"}, origin="stage")
    assert "a.probe" in Flat.of_model(model).names.nodes
    flight = model.without_test_only()
    flat = Flat.of_model(flight)
    assert "a.probe" not in flat.names.nodes
    assert [c.path for c in flat.conductors if "lead" in c.path] == []
    assert list(flight.settings) == ["a.power"]
    assert list(flight.layers[0].values) == ["a.power"]
    assert flight.aliases == {}
    assert flight.submodel("a").offers == ("case", "skin")
    assert dict(flight.submodel("a").aliases) == {"hull": "case"}
    assert Flat.of_model(flight).parameters.evaluate({})["a.power"] == 6.0
    assert flight.without_test_only() == flight


def test_what_hangs_on_the_test_must_be_marked_too(part: Build) -> None:
    model = bench(part, test_only=False)
    with raises_code("name.unknown", NameNotFoundError, match=r"'probe'.*\[.probe.\]"):
        Flat.of_model(model.without_test_only())
    assert "model.test-only-needed" in codes(model, "warning")


# findings ----------------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "severity", "where", "code", "facts"),
    [
        ({"loads/heat/into": "csae"}, "error", "Box, loads.heat", "name.unknown", "'csae'.*'case'"),
        (
            {"surfaces/skin/htc": "0 [W/(m^2 K)]"},
            "warning",
            "Box, nodes.case",
            "model.no-path-to-boundary",
            "10.6667 K/h",
        ),
        (
            {"surfaces/skin/htc": "0 [W/(m^2 K)]"},
            "warning",
            "Box, loads.heat",
            "model.heat-cannot-leave",
            "'heat'.*'case'",
        ),
        (
            {"surfaces/skin/htc": "0 [W/(m^2 K)]", "loads/heat/periodic": {"period": "1 [h]", "duty": 0.5}},
            "warning",
            "Box, nodes.case",
            "model.no-path-to-boundary",
            "5.33333 K/h",
        ),
        (
            {"surfaces/skin/htc": "0 [W/(m^2 K)]", "loads/heat/power": "-0.75*power"},
            "warning",
            "Box, nodes.case",
            "model.no-path-to-boundary",
            "cools at 8 K/h",
        ),
        (
            {
                "nodes/p": {"capacitance": "1 [J/K]"},
                "nodes/q": {"capacitance": "1 [J/K]"},
                "conductors/c": {"kind": "conduction", "between": ["p", "q"], "conductance": "1 [W/K]"},
            },
            "warning",
            "Box, nodes.p",
            "model.no-path-to-boundary",
            "'p' and 'q'",
        ),
        (
            {"nodes/lost": {"capacitance": "1 [J/K]"}},
            "warning",
            "Box, nodes.lost",
            "model.unconnected",
            "'lost'",
        ),
        ({"needs": ["air", "walls"]}, "warning", "Box, needs", "model.unconnected", "'walls'"),
        (
            {"nodes/star": {}},
            "error",
            "Box, nodes.star",
            "model.massless-undefined",
            "'star'",
        ),
        (
            {"nodes/s": {}, "nodes/t": {}, "conductors/c": {"kind": "conduction", "between": ["s", "t"], "conductance": "1 [W/K]"}},
            "error",
            "Box, nodes.s",
            "model.massless-undefined",
            "'s' and 't'",
        ),
        (
            {"loads/waste": {"into": "air", "power": "1 [W]"}},
            "warning",
            "Box, loads.waste",
            "model.load-without-effect",
            "'waste'.*'air'",
        ),
        ({"parameters/spare": "1"}, "warning", "Box, parameters.spare", "model.unused", "'spare'"),
        ({"surfaces/skin/emissivity": 1.2}, "error", "Box, surfaces.skin.emissivity", "value.outside-range", "1.2"),
        (
            {"conductors/c": {"kind": "radiation", "between": ["case", "air"], "emissivity": -0.1, "area": "1 [cm^2]"}},
            "error",
            "Box, conductors.c.emissivity",
            "value.outside-range",
            "-0.1",
        ),
        (
            {"conductors/c": {"kind": "radiation", "between": ["case", "air"], "exchange_factor": 34, "area": "1 [cm^2]"}},
            "error",
            "Box, conductors.c.exchange_factor",
            "value.outside-range",
            "34",
        ),
        (
            {"surfaces/skin/htc": {"coefficient": "1.4 [W/(m^2 K)]", "exponent": 1.25}},
            "warning",
            "Box, surfaces.skin.htc.exponent",
            "model.value-unusual",
            "1.25",
        ),
        (
            {"conductors/c": {"kind": "conduction", "between": ["case", "air"], "resistance": "0 [K/W]"}},
            "error",
            "Box, conductors.c.resistance",
            "value.outside-range",
            "'c.resistance' is 0 K/W",
        ),
        (
            {"conductors/c": {"kind": "conduction", "between": ["case", "air"], "conductance": "-1 [W/K]"}},
            "error",
            "Box, conductors.c.conductance",
            "value.outside-range",
            "'c.conductance' is -1 W/K",
        ),
        (
            {"nodes/case/mass": "0 [kg]"},
            "error",
            "Box, nodes.case.mass",
            "value.outside-range",
            "'case.mass' is 0 kg",
        ),
        (
            {"nodes/case/test_only": False, "loads/heat/test_only": True},
            "note",
            "Box",
            "model.test-only",
            "'heat'",
        ),
        (
            {"surfaces/skin/htc": None, "surfaces/skin/effective_htc": "5 [W/(m^2 K)]"},
            "note",
            "Box, surfaces.skin",
            "model.radiation-not-split",
            "'skin'",
        ),
        (
            {"parameters/power": {"value": "4 [W]", "source": "measured"}},
            "note",
            "Box",
            "model.values-without-source",
            "4 of 5.*'area', 'case.mass', 'case.specific_heat' and 'skin.htc'",
        ),
    ],
)
def test_finding(part: Build, changes: dict[str, Any], severity: str, where: str, code: str, facts: str) -> None:
    found = [f.message for f in part(changes).check() if (f.severity, f.where, f.code) == (severity, where, code)]
    assert any(re.search(facts, message) for message in found)


def test_a_sound_model_has_no_findings(part: Build) -> None:
    assert findings(part({"surfaces/skin/emissivity": 0.8, "surfaces/skin/carried_by": "free air"})) == ()


@pytest.mark.parametrize(
    ("changes", "asked"),
    [
        ({}, True),
        ({"surfaces/skin/carried_by": "fan"}, False),
        ({"surfaces/skin/htc": None, "surfaces/skin/effective_htc": "5 [W/(m^2 K)]"}, True),
        ({"surfaces/skin/htc": {"coefficient": "1.3 [W/(m^2 K)]", "exponent": 0.25}}, False),
        ({"surfaces/skin/htc": "0.001 [W/(m^2 K)]", "surfaces/skin/emissivity": 0.9}, False),
    ],
)
def test_what_carries_most_of_the_heat_is_asked_for(part: Build, changes: dict[str, Any], asked: bool) -> None:
    found = [f for f in findings(part(changes)) if f.code == "model.carrier-unstated"]
    assert bool(found) is asked
    assert all(f.severity == "note" and "'skin'" in f.message for f in found)


def test_shadowed_values_are_listed(pair: Build) -> None:
    model = pair({"set": {"a.power": "6 [W]"}}).with_values({"a.power": "7 [W]"}, origin="stage Pair")
    (found,) = [f for f in model.check() if f.code == "model.value-overridden"]
    assert (found.severity, found.where) == ("note", "stage Pair, a.power")
    assert re.search(r"7 \[W\].*stage Pair.*6 \[W\].*\[set\] of Pair.*4 \[W\] of Box", found.message)


def test_a_parameter_whose_user_is_shadowed_is_not_unused(pair: Build) -> None:
    """The part's own deck uses it; that a parent sets the user aside is a note, not a fault of the part."""
    assert said(pair({"set": {"a.heat.power": "6 [W]"}}), "warning") == []


def test_over_allocated_area_is_an_error(pair: Build) -> None:
    (first, second, *rest) = said(pair({"joints/stack/area": "600 [cm^2]"}), "error")
    assert all(part in first for part in ("Box, surfaces.skin", "'a.skin' has 500 cm^2, but 'stack'", "600 cm^2"))
    assert "'b.skin'" in second
    assert rest == []


def test_flow_warms_only_downstream(part: Build) -> None:
    stream = {"kind": "flow", "mass_flow": "1 [g/s]", "specific_heat": "1000 [J/(kg K)]"}
    closed = {"surfaces/skin/htc": "0 [W/(m^2 K)]"}
    assert said(part(closed | {"conductors/c": stream | {"between": ["air", "case"]}}), "warning") == []
    assert any(
        "warms at 10.6667 K/h" in line for line in said(part(closed | {"conductors/c": stream | {"between": ["case", "air"]}}), "warning")
    )


def test_errors_come_first_and_nothing_twice(part: Build) -> None:
    found = findings(part({"nodes/star": {}, "parameters/spare": "1", "surfaces/skin/emissivity": 2}))
    order = [("error", "warning", "note").index(f.severity) for f in found]
    assert order == sorted(order)
    assert len(set(found)) == len(found) == 3


def test_each_rule_says_what_it_is() -> None:
    assert all(rule.__doc__ for rule in RULES)


def test_vacuum_rate_of_the_accelerometer() -> None:
    """31.25 K/h (section 2.1 of the acceptance sheet): what `check` says when nothing convects."""
    model = load_model(ROOT / "examples/01_accelerometer/accelerometer.toml")
    assert said(model, "warning") == []
    still = model.with_values({"skin.effective_htc": {"value": "0 [W/(m^2 K)]", "min": 0}})
    assert any("'case'" in line and "31.25 K/h" in line for line in said(still, "warning"))


def test_examples_have_no_errors_or_warnings() -> None:
    for deck in sorted((ROOT / "examples").glob("0[12]_*/*.toml")):
        model = load_model(deck)
        assert said(model, "error") == []
        assert said(model, "warning") == []


# schema ------------------------------------------------------------------------------------------------------------------------------


def test_schema_names_every_table_and_kind() -> None:
    schema = json.loads((ROOT / "docs/schema/deck.schema.json").read_text(encoding="utf-8"))
    assert schema["$schema"].endswith("2020-12/schema")
    assert schema["additionalProperties"] is False
    assert {"nodes", "surfaces", "conductors", "joints", "loads", "submodels", "set", "aliases"} < set(schema["properties"])
    assert "conduction" in schema["$defs"]["ConductorTable"]["properties"]["kind"]["pattern"]


def test_which_surfaces_a_run_in_vacuum_and_one_with_gas_refuse() -> None:
    """One with htc alone exchanges nothing without its gas; one that radiates alone nothing with it; a coefficient for both does either."""
    way = {
        "convects": {"htc": "5 [W/(m^2 K)]"},
        "radiates": {"emissivity": "0.8", "sees": "walls"},
        "either": {"effective_htc": "9 [W/(m^2 K)]"},
    }
    way["both"] = way["convects"] | way["radiates"]
    deck = {
        "title": "Plate",
        "needs": ["air", "walls"],
        "nodes": {"plate": {"capacitance": "100 [J/K]"}},
        "surfaces": {name: {"of": "plate", "to": "air", "area": "0.02 [m^2]", **fields} for name, fields in way.items()},
    }
    flat = Flat.of_model(model_from_dict(deck))
    assert flat.without_emissivity == {"convects": "air"}
    assert flat.without_convection == {"radiates": "air"}
