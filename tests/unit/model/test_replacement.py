"""A replaced part has the values of its own deck; what belonged to the old one is listed, and its joint starts apart from its twins."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

from by_code import raises_code
from thermid.base.errors import DeckError, NameNotFoundError
from thermid.model._deck.modelfile import model_from_dict
from thermid.model._tree.model import Model, identities
from thermid.values.store import FittedValue

Build = Callable[..., Model]
HTC = "skin.htc"


def unit(part: Model, names: str = "xyz", **more: Any) -> Model:
    """Parts on one plate, whose feet share a conductance through an expression."""
    feet = {
        f"foot_{n}": {"between": [f"{n}.skin", "face"], "area": "5 [cm^2]", "contact_conductance": "2*foot_conductivity/layer"}
        for n in names
    }
    deck = {
        "title": "Unit",
        "needs": ["room"],
        "parameters": {"foot_conductivity": {"value": "0.123 [W/(m K)]", "min": 0.01, "max": 1}, "layer": "1 [mm]", "share": "0.2 [kg]"},
        "nodes": {"plate": {"mass": "2 [kg]", "specific_heat": "900 [J/(kg K)]"}},
        "surfaces": {"face": {"of": "plate", "to": "room", "area": "0.1 [m^2]", "htc": "4 [W/(m^2 K)]"}},
        "submodels": {n: {"use": part, "bind": {"air": "room"}} for n in names},
        "joints": feet,
    }
    return model_from_dict(deck | more)


def fitted(value: float, unit_: str, *paths: str) -> dict[str, FittedValue]:
    one = FittedValue(paths[0], value, 0.01, 0.01, True, unit_, value, (0.1, 10.0), "stage 'gyro'", also=paths[1:])
    return dict.fromkeys(paths, one)


def test_a_deck_of_six_watts_means_six_watts(part: Build) -> None:
    """Two gyros fitted at 2.1 W, a deck of 6 W in place of one of them: the worked example."""
    model = unit(part(), "xz", set={f"z.{HTC}": "3.8 [W/(m^2 K)]"})
    model = model.with_values(fitted(2.1, "W", "x.power", "z.power") | fitted(0.71, "kg", "x.case.mass", "z.case.mass"), "stage 'gyro'")
    swapped, what = model.replaced("z", part({"parameters/power": "6 [W]"}, title="Hot"))
    assert swapped.at("z.power").text == "6 [W]"
    assert swapped.at("x.power").text == "2.1 [W]"
    assert identities(swapped)["x.power"].paths == ("x.power",)
    assert [(d.path, d.text, d.origin) for d in what.dropped] == [
        ("z.power", "2.1 [W]", "stage 'gyro'"),
        ("z.case.mass", "0.71 [kg]", "stage 'gyro'"),
        (f"z.{HTC}", "3.8 [W/(m^2 K)]", "[set] of Unit"),
    ]
    part, again, place = (d.why for d in what.dropped)
    assert part == again != place
    assert [(s.path, s.text, s.log_sd, s.origin, s.twins) for s in what.starts] == [
        (f"z.{HTC}", "3.8 [W/(m^2 K)]", 0.30, "place", ()),
        ("foot_z.contact_conductance", "246 [W/(m^2 K)]", 0.25, "twin", ("foot_x",)),
    ]
    patterns = (
        r"Hot .*",
        r"z\.skin\.htc .* 3\.8 \[W/\(m\^2 K\)\] .* 30 %",
        r"foot_z\.contact_conductance .* foot_x, 246 \[W/\(m\^2 K\)\] .* 25 %",
    )
    assert all(re.fullmatch(pattern, line) for pattern, line in zip(patterns, what.assumes, strict=True)), what.assumes
    start = what.starting(swapped)
    assert start.at(f"z.{HTC}").text == "3.8 [W/(m^2 K)]"
    assert start.at("foot_z.contact_conductance").text == "246 [W/(m^2 K)]"
    assert start.at("foot_x.contact_conductance").text == "2*foot_conductivity/layer"


def test_the_old_deck_again_gives_the_old_model(part: Build) -> None:
    model = unit(part())
    assert model.replace("z", part(title="Other")).replace("z", part()) == model


def test_a_unit_of_the_same_deck_is_apart_from_fitted_twins(part: Build) -> None:
    model = unit(part()).with_values(fitted(2.1, "W", "x.power", "y.power", "z.power"), "stage 'gyro'")
    swapped = model.replace("z", part())
    assert swapped.at("z.power").text == "4 [W]"
    assert identities(swapped)["x.power"].paths == ("x.power", "y.power")
    assert identities(swapped)["z.power"].paths == ("z.power",)
    assert model.replaced("z", part())[1].untied == ("z.power",)
    assert len(identities(swapped)["z.case.mass"].paths) == 3, "nothing was known of the old one's mass but its deck"


def test_values_of_every_level_go(part: Build) -> None:
    """The part's own stage, the stage of the unit, a [set] of the unit and one of the whole."""
    inner = unit(part(), "xz", set={"z.power": "3 [W]"}).with_values(fitted(0.9, "kg", "case.mass"), "stage 'gyro'", at="z")
    inner = inner.with_values({"z.area": "0.06 [m^2]"}, "stage 'unit'")
    whole = model_from_dict(
        {
            "title": "Whole",
            "needs": ["bay"],
            "submodels": {"u": {"use": inner, "bind": {"room": "bay"}}},
            "set": {f"u.z.{HTC}": "7 [W/(m^2 K)]"},
        }
    )
    new = part({"parameters/power": "6 [W]", "nodes/case/mass": "2 [kg]"}, title="Hot")
    swapped, what = whole.replaced("u.z", new)
    alone, now = new.parameter_table(), swapped.parameter_table()
    assert {n: now[f"u.z.{n}"].parameter for n in alone} == {n: e.parameter for n, e in alone.items()}
    assert {d.path for d in what.dropped} == {"u.z.power", "u.z.case.mass", "u.z.area", f"u.z.{HTC}"}
    kept, said = whole.replaced("u.z", new, keep=["u.z.power"])
    assert kept.at("u.z.power").text == "3 [W]"
    assert whole.replace("u.z", new, keep=["u.z.case.mass"]).at("u.z.case.mass").text == "0.9 [kg]"
    assert said.kept == ("u.z.power",)
    with raises_code("name.unknown", NameNotFoundError, match=r"'u\.z\.powr'"):
        whole.replaced("u.z", new, keep=["u.z.powr"])


def test_what_the_deck_above_derives_from_its_own_values_stays(part: Build) -> None:
    """A third of the plate's mass is added to the part by the unit's deck; that is no value of the old part."""
    ballast = {"parameters/ballast": "0 [kg]", "parameters/own": "1.5 [kg]", "nodes/case/mass": "own + ballast"}
    model = unit(part(ballast), set={"z.ballast": "share/2"})
    swapped, what = model.replaced("z", part(ballast, title="Other"))
    assert swapped.at("z.ballast").text == "share/2"
    assert what.kept == ("z.ballast",)
    assert "z.ballast is unchanged" in what.assumes
    gone, said = model.replaced("z", part(title="Plain"))
    assert "z.ballast" not in gone.parameter_table()
    assert [d.path for d in said.dropped] == ["z.ballast"]


def test_a_value_that_the_deck_above_reads(part: Build) -> None:
    model = unit(part(), parameters={"foot_conductivity": "z.power/layer/20", "layer": "1 [mm]"}, joints={})
    assert model.replace("z", part({"parameters/power": "6 [W]"})).at("foot_conductivity").text == "z.power/layer/20"
    with raises_code("model.refused", DeckError, match="'z.power/layer/20'.*'z.power'.*'z'"):
        model.replace("z", part({"parameters/power": None, "loads/heat/power": "6 [W]"}))


def test_a_joint_of_its_own_keeps_its_number(part: Build) -> None:
    """Its conductivity acts on no other joint, so it needs no number of its own: it starts where it was, with a spread."""
    model = unit(part(), "z")
    what = model.replaced("z", part(title="Other"))[1]
    assert [(s.path, s.text, s.origin, s.twins) for s in what.starts] == [("foot_conductivity", "0.123 [W/(m K)]", "place", ())]
    assert model.replaced("z", part(title="Other"), keep=["foot_conductivity"])[1].starts == ()
