"""Names that do not exist, with the nearest one; names that are none, or stand for two things."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import DeckError, NameNotFoundError
from thermid.model._tree.flat import Flat
from thermid.model._tree.model import Model

Build = Callable[..., Model]


@pytest.mark.parametrize(
    ("changes", "match"),
    [
        (
            {"conductors": {"c": {"kind": "conduction", "between": ["cas", "air"], "conductance": "1 [W/K]"}}},
            r"conductors\.c.*'cas'.*'case'",
        ),
        ({"loads/heat/into": "csae"}, r"loads\.heat.*'csae'.*'case'"),
        ({"surfaces/skin/to": "aire"}, r"surfaces\.skin.*'aire'.*'air'"),
        ({"loads/heat/power": "2*powr"}, r"loads\.heat\.power.*'powr'.*'power'"),
        ({"parameters/area": "2*skin.htc_"}, r"parameters\.area.*'skin\.htc_'.*'skin\.htc'"),
        ({"set": {"skin.hct": "1 [W/(m^2 K)]"}}, r"set\.skin\.hct.*'skin\.hct'.*'skin\.htc'"),
        ({"offers": ["cas"]}, "'cas'.*'case'"),
        ({"aliases": {"Acc": "cse"}}, r"aliases\.Acc.*'Acc'.*'cse'.*'case'"),
        (
            {"joints": {"j": {"between": ["skin", "skn"], "area": "1 [cm^2]", "contact_conductance": "9 [W/(m^2 K)]"}}},
            "'skn'.*'skin'",
        ),
    ],
)
def test_unknown_name_in_a_part(part: Build, changes: dict[str, Any], match: str) -> None:
    with raises_code("name.unknown", NameNotFoundError, match=match):
        Flat.of_model(part(changes))


@pytest.mark.parametrize(
    ("changes", "match"),
    [
        ({"set": {"a.skin.htcc": "1 [W/(m^2 K)]"}}, r"set\.a\.skin\.htcc.*'a\.skin\.htcc'.*'a\.skin\.htc'"),
        ({"submodels/a/bind": {"air": "roum"}}, r"submodels\.a\.bind\.air.*'roum'.*'room'"),
        ({"submodels/a/bind": {"air": "room", "aire": "room"}}, r"submodels\.a\.bind.*'a'.*'aire'.*'air'"),
        (
            {"joints/stack/between": ["a.skn", "b.skin"]},
            r"joints\.stack.*'a'.*'skn'.*'skin'",
        ),
        (
            {"conductors": {"c": {"kind": "conduction", "between": ["a.cas", "room"], "conductance": "1 [W/K]"}}},
            r"conductors\.c.*'a\.cas'.*'a\.case'",
        ),
        (
            {"joints/stack/gap": {"area": "1 [cm^2]", "htc": "4 [W/(m^2 K)]", "to": "rom"}},
            r"joints\.stack.*'rom'.*'room'",
        ),
    ],
)
def test_unknown_name_in_a_pair(pair: Build, changes: dict[str, Any], match: str) -> None:
    with raises_code("name.unknown", NameNotFoundError, match=match):
        Flat.of_model(pair(changes))


def test_need_not_bound(pair: Build) -> None:
    with raises_code("model.refused", DeckError, match=r"submodels\.a.*'air'.*'a'"):
        Flat.of_model(pair({"submodels/a/bind": {}}))


def test_inner_node_that_is_not_offered(part: Build, pair: Build) -> None:
    hidden = part({"nodes/inner": {"capacitance": "1 [J/K]"}})
    with raises_code("name.unknown", NameNotFoundError, match="'a'.*'inner'"):
        Flat.of_model(
            pair(
                {
                    "submodels/a/use": hidden,
                    "conductors": {"c": {"kind": "conduction", "between": ["a.inner", "room"], "conductance": "1 [W/K]"}},
                }
            )
        )


@pytest.mark.parametrize(
    ("changes", "code", "match"),
    [
        ({"nodes/2x": {}}, "name.not-valid", r"nodes\.2x.*'2x'"),
        ({"nodes/b c": {}}, "name.not-valid", "'b c'"),
        ({"parameters/a.b": "1"}, "name.not-valid", r"'a\.b'"),
        ({"parameters/é": "1"}, "name.not-valid", "'é'"),
        ({"needs": ["air", "a b"]}, "name.not-valid", "'a b'"),
        (
            {"parameters/lambda": "1"},
            "name.not-valid",
            r"parameters\.lambda.*'lambda'",
        ),
        ({"parameters/inf": "1"}, "name.not-valid", "'inf'"),
        (
            {"parameters/case": "1"},
            "name.taken",
            r"nodes\.case.*'case'",
        ),
        (
            {"loads/skin": {"into": "case", "power": "1 [W]"}},
            "name.taken",
            r"loads\.skin.*'skin'",
        ),
        (
            {"needs": ["air", "case"]},
            "name.taken",
            "'case'",
        ),
        ({"needs": ["air", "air"]}, "name.taken", "'air'"),
        ({"aliases": {"case": "skin"}}, "name.taken", r"aliases\.case.*'case'"),
        ({"aliases": {"x": "y.case", "y": "x"}}, "model.self-reference", r"aliases\.x.*'x'"),
    ],
)
def test_names_that_are_refused(part: Build, changes: dict[str, Any], code: str, match: str) -> None:
    with raises_code(code, DeckError, match=match):
        part(changes)


@pytest.mark.parametrize("mid", ["room", "stack", "a.case", "a"])
def test_mid_that_is_taken(pair: Build, mid: str) -> None:
    with raises_code("name.not-valid" if "." in mid else "name.taken", DeckError, match=f"'{mid}'"):
        pair({"joints/stack/mid": mid})


def test_two_joints_cannot_share_a_mid(pair: Build) -> None:
    other = {"between": ["a.skin", "b.skin"], "area": "1 [cm^2]", "contact_conductance": "9 [W/(m^2 K)]", "mid": "mid"}
    with raises_code("name.taken", DeckError, match=r"joints\.more\.mid.*'mid'"):
        pair({"joints/more": other})


def test_aliases_reach_any_depth(pair: Build) -> None:
    model = pair({"aliases": {"first": "a", "P_first": "first.case", "again": "P_first"}})
    assert model.canonical("P_first") == "a.case"
    assert model.canonical("again") == "a.case"
    assert model.canonical("first.skin.htc") == "a.skin.htc"
    assert model.canonical("nobody") == "nobody"
    assert Flat.of_model(model).names.find("again") == "a.case"


def test_an_alias_of_one_part_is_a_name_of_the_whole(part: Build, pair: Build) -> None:
    named = part({"aliases": {"hull": "case", "lid": "skin"}})
    whole = pair({"submodels/a/use": named})
    assert (whole.canonical("hull"), whole.canonical("lid.htc")) == ("a.case", "a.skin.htc")
    assert Flat.of_model(whole).names.find("hull") == "a.case"
    twice = pair({"submodels/a/use": named, "submodels/b/use": part({"aliases": {"hull": "case"}}, title="Other")})
    assert twice.canonical("hull") == "hull"
    own = pair({"submodels/a/use": part({"aliases": {"stack": "case", "first": "case"}})})
    assert (own.canonical("stack"), own.canonical("first")) == ("stack", "a")


def test_a_submodel_is_no_node(pair: Build) -> None:
    with raises_code("name.unknown", NameNotFoundError, match=r"'first'.*a\.case"):
        Flat.of_model(pair()).names.find("first")


def test_results_are_read_by_every_alias(part: Build, pair: Build) -> None:
    whole = pair({"submodels/a/use": part({"aliases": {"hull": "case"}})})
    bench = td.Scenario("bench", boundaries={"room": "20 [degC]"}, start="room", duration="1 [h]")
    for time in (0.0, "mean"):
        settled = td.steady(whole, bench, time)
        assert settled["hull"] == settled["first_case"] == settled["a.case"]
    foreseen = td.design.foresee(td.design.Knowledge(whole), bench).prediction
    assert foreseen["hull"].final == foreseen["a.case"].final
    with raises_code("name.unknown", NameNotFoundError, match="'nobody'"):
        td.steady(whole, bench)["nobody"]


def test_alias_of_a_part_seen_from_above(part: Build, pair: Build) -> None:
    named = part({"aliases": {"hull": "case"}})
    assert pair({"submodels/a/use": named}).canonical("first.hull") == "a.case"


def test_find_a_node_for_a_scenario(pair: Build) -> None:
    names = Flat.of_model(pair()).names
    assert names.find("first_case") == "a.case"
    assert names.find("a.air") == "room"
    assert names.find("mid") == "mid"
    with raises_code("name.unknown", NameNotFoundError, match=r"'a\.csae'.*'a\.case'"):
        names.find("a.csae")


def test_at(pair: Build) -> None:
    model = pair()
    assert model.at("first") is model.submodels["a"].model
    assert model.at("a.case") is model.submodels["a"].model.nodes["case"]
    assert model.at("stack.area").text == "20 [cm^2]"
    assert model.at("a.power").maximum == 8.0
    with raises_code("name.unknown", NameNotFoundError, match="'cas'.*'case'"):
        model.at("a.cas")
    with raises_code("name.unknown", NameNotFoundError, match="'c'"):
        model.submodel("c")
    assert model.submodel("first").title == "Box"
