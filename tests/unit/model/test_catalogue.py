"""Materials and standard parts by name in decks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import DeckError
from thermid.model.tree import save_model, standard_parts
from thermid.physics.materials import Material

NODE = {"mass": "0.5 [kg]", "material": "aluminium 6061-T6"}
PATH = {"kind": "conduction", "between": ["a", "b"], "material": "copper", "area": "1 [cm^2]", "thickness": "5 [mm]"}
ROOM = td.Scenario("room", boundaries={"air": "20 [degC]"})


def deck(**more: Any) -> dict[str, Any]:
    return {"title": "x", "nodes": {"a": NODE, "b": {"capacitance": "1 [J/K]"}}, "conductors": {"path": PATH}} | more


def test_a_material_gives_specific_heat_and_conductivity_with_their_ranges() -> None:
    model = td.model_from_dict(deck())
    heat, way = model.at("a.specific_heat"), model.at("path.conductivity")
    assert heat.expression.literal.value == 896.0
    assert way.expression.literal.value == 401.0
    assert (heat.minimum, heat.maximum) == pytest.approx((896.0 * 0.96, 896.0 * 1.04))
    assert heat.basis == Material.named("aluminium 6061-T6").basis


def test_a_material_that_changes_with_temperature_is_a_table() -> None:
    """Silicon conducts 148 W/(m K) at 300 K and 98.9 at 400 K: straight lines between the points of the source."""
    parts = deck(conductors={"path": PATH | {"material": "silicon"}}, needs=["air"])
    parts["conductors"]["out"] = {"kind": "conduction", "between": ["b", "air"], "resistance": "1 [K/W]"}
    parts["loads"] = {"heat": {"into": "a", "power": "100 [W]"}}
    hot = td.steady(td.model_from_dict(parts), ROOM.with_(boundaries={"air": "126.85 [degC]"}))
    drop = hot["a"] - hot["b"]
    mean = 98.9  # beyond its last point the table is held
    assert drop == pytest.approx(100.0 * 5e-3 / (mean * 1e-4), rel=1e-6)


def test_a_value_beside_a_material_is_the_one_that_counts() -> None:
    model = td.model_from_dict(deck(nodes={"a": NODE | {"specific_heat": "850 [J/(kg K)]"}, "b": {"capacitance": "1 [J/K]"}}))
    assert model.at("a.specific_heat").text == "850 [J/(kg K)]"


def test_materials_that_are_not_there_or_do_not_apply_are_refused() -> None:
    with raises_code("name.unknown", DeckError, match=r"nodes.a.material.*'aluminium 6061-T6'"):
        td.model_from_dict(deck(nodes={"a": NODE | {"material": "aluminum 6061-T4"}}))
    with raises_code("value.without-effect", DeckError):
        td.model_from_dict(
            deck(conductors={"ray": {"kind": "radiation", "between": ["a", "b"], "emissivity": 1, "area": "1 [m^2]", "material": "copper"}})
        )


def test_a_saved_deck_says_the_same(tmp_path: Path) -> None:
    model = td.model_from_dict(deck())
    save_model(model, tmp_path / "x.toml")
    assert td.load_model(tmp_path / "x.toml") == model


FREE = {"heat.power", "joint.count", "pins.count", "centre.mass", "spread.area", "spread.thickness", "fins.emissivity"}
"""Values of standard parts without a basis: what its user sets, a count, and what a comment of the deck derives."""


def test_every_value_of_a_standard_part_has_a_basis_and_a_range() -> None:
    for file in standard_parts().values():
        part = td.load_model(file)
        assert not [f for f in part.check() if f.severity in ("error", "warning")], file
        for path, _, given in part.own_parameters():
            if path in FREE | {"envelope.htc", "centre_faces.htc", "rim_faces.htc"}:
                continue
            assert given.basis.startswith(("catalogue: ", "finish ")), path
            assert given.minimum <= given.expression.literal.value <= given.maximum, path
            assert given.minimum < given.maximum, path


def test_there_are_twenty_parts() -> None:
    assert len(standard_parts()) >= 20


def test_a_standard_part_in_a_deck_heats_as_its_resistances_say() -> None:
    """2 W through 1.6 and 0.5 K/W to the sink; its own film beside them takes less than a tenth of a watt."""
    parts = {"q1": {"use": "std:TO-220", "bind": {"sink": "a", "air": "air"}, "values": {"heat.power": "2 [W]"}}}
    model = td.model_from_dict(
        deck(
            needs=["air"],
            submodels=parts,
            conductors={"path": PATH, "out": {"kind": "conduction", "between": ["b", "air"], "resistance": "3 [K/W]"}},
        )
    )
    hot = td.steady(model, ROOM)
    assert hot["q1.junction"] - hot["a"] == pytest.approx(2.0 * 2.1, rel=0.05)


def test_a_standard_part_that_is_not_there_is_refused() -> None:
    with raises_code("name.unknown", DeckError, match=r"submodels\.q1\.use.*'std:TO-221'"):
        td.model_from_dict(deck(submodels={"q1": {"use": "std:TO-221"}}))
