"""Blocks: what they hold, what they refuse, and what they are as models."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code


def block(cells: tuple[int, int, int] = (4, 3, 2), **changes: Any) -> td.Block:
    given = {"conductivity": "10 [W/(m K)]", "density": "2000 [kg/m^3]", "specific_heat": "500 [J/(kg K)]"} | changes
    return td.Block(("80 [mm]", "30 [mm]", "10 [mm]"), cells, **given)


def test_capacities_add_up_to_the_whole() -> None:
    assert block().capacities().sum() == pytest.approx(2000 * 500 * 0.08 * 0.03 * 0.01)


def test_links_in_a_row_are_a_bar_without_its_half_cells_at_the_ends() -> None:
    x, y, z = block((4, 1, 1)).links
    assert np.sum(1.0 / x[:-1]) == pytest.approx(0.06 / (10 * 0.03 * 0.01))
    assert x[-1] == 0.0
    assert not y.any()
    assert not z.any()


def test_unequal_conductivities_combine_to_their_harmonic_mean() -> None:
    k = np.ones((2, 1, 1))
    k[1] = 3.0
    x, _, _ = block((2, 1, 1), conductivity=k).links
    area, half = 0.03 * 0.01, 0.02
    assert x[0] == pytest.approx(area / (half / 1.0 + half / 3.0))


def test_factors_scale_links() -> None:
    factors = (np.full((3, 3, 2), 2.0), np.full((4, 2, 2), 1.0), np.full((4, 3, 1), 0.5))
    plain, scaled = block().links, block(link_factors=factors).links
    for a, b, factor in zip(plain, scaled, (2.0, 1.0, 0.5), strict=True):
        np.testing.assert_allclose(b, factor * a)


def test_every_face_once_is_the_whole_surface() -> None:
    _, area, _ = block().exchange_cells(block().exchanging("all", "air", htc="1 [W/(m^2 K)]").exchanges[0])
    assert area.sum() == pytest.approx(2 * (0.08 * 0.03 + 0.08 * 0.01 + 0.03 * 0.01))


def test_a_held_face_lies_behind_half_a_cell_and_its_contact() -> None:
    held = block((4, 1, 1)).held("-x", "base", contact="100 [W/(m^2 K)]")
    places, area, conductance = held.exchange_cells(held.exchanges[0])
    assert places.tolist() == [0]
    assert conductance[0] == pytest.approx(area[0] / (0.01 / 10 + 1 / 100))


def test_a_box_takes_the_cells_whose_centres_lie_inside() -> None:
    box = (("0 [mm]", "40 [mm]"), ("0 [mm]", "30 [mm]"), ("5 [mm]", "10 [mm]"))
    names = {block().name(int(k)) for k in block().heated("h", "1 [W]", box=box).heater_cells("h")}
    assert names == {f"cell[{i},{j},1]" for i in range(2) for j in range(3)}


def test_cells_have_names_and_places() -> None:
    assert block().place("cell[3,2,1]") == 4 * 3 * 2 - 1
    assert all(block().place(block().name(k)) == k for k in range(24))
    with raises_code("name.unknown", match=r"\[3,2,1\]"):
        block().place("cell[4,0,0]")


def test_a_block_is_not_changed_by_its_methods() -> None:
    plain = block()
    plain.heated("h", "1 [W]", cells=np.s_[:1, :1, :1]).exchanging("+x", "air", htc="1 [W/(m^2 K)]")
    assert not plain.heaters
    assert not plain.exchanges


@pytest.mark.parametrize(
    ("make", "code", "match"),
    [
        (lambda: block((0, 1, 1)), "value.outside-range", ""),
        (lambda: block(conductivity="0 [W/(m K)]"), "value.outside-range", r"'0 \[W/\(m K\)\]'"),
        (lambda: block(conductivity="10 [W/K]"), "unit.wrong-dimension", r"'\[W/K\]'.*\[W/\(m K\)\]"),
        (lambda: block(density=np.ones((2, 2, 2))), "value.shape", ""),
        (lambda: block(link_factors=(np.ones(1), np.ones(1), np.ones(1))), "value.shape", "link_factors"),
        (lambda: block().heated("h", "1 [W]"), "value.excludes-another", ""),
        (lambda: block().heated("a b", "1 [W]", cells=np.s_[:, :, :]), "name.taken", ""),
        (lambda: block().heated("h", "1 [W]", cells=np.s_[9:, :, :]), "value.contradicts", ""),
        (lambda: block().exchanging("top", "air", htc="1 [W/(m^2 K)]"), "value.wrong-kind", ""),
        (lambda: block().exchanging("+x", "air"), "value.incomplete", ""),
        (lambda: block().exchanging("+x", "air", emissivity=1.5), "value.incomplete", ""),
        (
            lambda: block().heated("h", {"times": ["0 [s]", "1 [s]"], "values": ["0 [W]", "1 [W]"]}, cells=np.s_[:, :, :]).model(),
            "model.element-not-supported",
            "'h'",
        ),
        (lambda: block((100, 100, 3)).model(), "cap.exceeded", "30000"),
    ],
)
def test_what_is_no_block_is_refused(make: Any, code: str, match: str) -> None:
    with raises_code(code, match=match):
        make()


def test_a_plate_can_be_a_part_of_another_model() -> None:
    plate = block((4, 3, 1)).heated("h", "2 [W]", cells=np.s_[:1, :1, :]).model(offers=("+x", "cell[0,0,0]"))
    assert set(plate.offers) == {"c0_0_0", "c3_0_0", "c3_1_0", "c3_2_0"}
    whole = td.model_from_dict(
        {
            "title": "whole",
            "needs": ["base"],
            "submodels": {"plate": {"use": plate}},
            "conductors": {"foot": {"kind": "conduction", "between": ["plate.c3_1_0", "base"], "conductance": "0.5 [W/K]"}},
        }
    )
    settled = td.steady(whole, td.Scenario(boundaries={"base": "20 [degC]"}))
    assert settled["plate.c3_1_0"] == pytest.approx(293.15 + 2 / 0.5)
    assert settled["plate.c0_0_0"] > settled["plate.c3_1_0"]


def test_one_value_for_all_cells_is_one_parameter_of_the_model() -> None:
    model = block().heated("h", "2 [W]", cells=np.s_[:2, :1, :1]).exchanging("+z", "air", htc="5 [W/(m^2 K)]").model()
    assert {"conductivity", "density", "specific_heat", "htc0", "h_power"} <= set(model.parameters)
    air = td.Scenario(boundaries={"air": "20 [degC]"})
    rise = [
        np.mean([t for n, t in td.steady(m, air).items() if n != "air"]) - 293.15 for m in (model, model.with_values({"h_power": "4 [W]"}))
    ]
    assert rise[1] == pytest.approx(2 * rise[0])
