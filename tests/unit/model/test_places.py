"""View factors of faces in space: against closed forms, against plain Monte Carlo where one hides another, and what a deck may say."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import DeckError
from thermid.physics.view_factors import SHAPES, PlacedFace, facing_discs, facing_plates, placed_factors


def rectangle(corner: Any, first: Any, second: Any) -> PlacedFace:
    return PlacedFace("rectangle", corner, first, second)


def box(l: float, w: float, h: float) -> list[PlacedFace]:  # noqa: E741
    return [
        rectangle((0, 0, 0), (l, 0, 0), (0, w, 0)),
        rectangle((0, 0, h), (0, w, 0), (l, 0, 0)),
        rectangle((0, 0, 0), (0, w, 0), (0, 0, h)),
        rectangle((l, 0, 0), (0, 0, h), (0, w, 0)),
        rectangle((0, 0, 0), (0, 0, h), (l, 0, 0)),
        rectangle((0, w, 0), (l, 0, 0), (0, 0, h)),
    ]


@pytest.mark.parametrize("size", [(0.4, 0.3, 0.2), (1.0, 1.0, 1.0), (0.5, 0.1, 0.3)])
def test_the_inside_of_a_box_is_that_of_the_closed_form(size: tuple[float, float, float]) -> None:
    truth = SHAPES["box"].factors(dict(zip(("length", "width", "height"), size, strict=True)))[1]
    areas, found, error = placed_factors(tuple(box(*size)), tuple("abcdef"))
    assert np.abs(found - truth).max() < 0.002
    big = truth > 0.05
    assert (np.abs(found - truth) / np.where(big, truth, 1.0))[big].max() < 0.005
    assert found.sum(axis=1) == pytest.approx(np.ones(6), abs=1e-9)
    assert areas[:, None] * found == pytest.approx((areas[:, None] * found).T, rel=1e-9)
    assert error < 0.003


def test_discs_plates_and_cylinders_are_those_of_closed_forms() -> None:
    discs = [PlacedFace("disc", (0, 0, 0), (0, 0, 1), radius=0.3), PlacedFace("disc", (0, 0, 0.5), (0, 0, -1), radius=0.2)]
    assert placed_factors(tuple(discs), ("a", "b"))[1][0, 1] == pytest.approx(facing_discs(0.3, 0.2, 0.5), rel=0.005)
    plates = [rectangle((0, 0, 0), (0.3, 0, 0), (0, 0.2, 0)), rectangle((0, 0, 0.1), (0, 0.2, 0), (0.3, 0, 0))]
    assert placed_factors(tuple(plates), ("a", "b"))[1][0, 1] == pytest.approx(facing_plates(0.3, 0.2, 0.1), rel=0.005)
    nested = [
        PlacedFace("cylinder", (0, 0, 0), (0, 0, 1), radius=0.2),
        PlacedFace("cylinder", (0, 0, 0), (0, 0, 1), radius=0.5, inside=True),
    ]
    truth = SHAPES["cylinder in cylinder"].factors({"inner_radius": 0.2, "outer_radius": 0.5, "length": 1.0})[1][:2, :2]
    assert placed_factors(tuple(nested), ("a", "b"))[1] == pytest.approx(truth, rel=0.005, abs=1e-9)


SHIELDED = [
    rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0)),
    rectangle((0.2, 0.2, 0.4), (0, 0.6, 0), (0.6, 0, 0)),
    rectangle((0.2, 0.2, 0.4), (0.6, 0, 0), (0, 0.6, 0)),
    rectangle((0, 0, 1), (0, 1, 0), (1, 0, 0)),
]


def monte_carlo(rays: int, seed: int) -> float:
    """View factor between two unit squares one apart, with a square of 0.6 between at a height of 0.4, by random pairs of points."""
    rng = np.random.default_rng(seed)
    a, b = rng.random((rays, 2)), rng.random((rays, 2))
    far = np.sum((a - b) ** 2, axis=1) + 1.0
    through = a + 0.4 * (b - a)
    hidden = (np.abs(through - 0.5) < 0.3).all(axis=1)
    return float(np.mean(np.where(hidden, 0.0, 1.0 / (np.pi * far**2))))


def test_a_shield_between_two_plates_hides_what_monte_carlo_says() -> None:
    _, found, _ = placed_factors(tuple(SHIELDED), ("low", "back", "front", "high"))
    truth = np.mean([monte_carlo(1_000_000, seed) for seed in range(6)])
    assert found[0, 3] == pytest.approx(truth, rel=0.005)
    assert found[0, 3] < 0.6 * facing_plates(1.0, 1.0, 1.0)
    assert found[1, 2] == found[0, 2] == 0.0


def test_a_post_hides_walls_from_one_another() -> None:
    """A cylinder in an open square duct: reciprocity holds, and random pairs of points agree."""
    walls = box(1.0, 1.0, 1.0)[2:]
    post = PlacedFace("cylinder", (0.5, 0.5, 0.0), (0, 0, 1.0), radius=0.3)
    areas, found, error = placed_factors((*walls, post), ("left", "right", "front", "behind", "post"))
    rng = np.random.default_rng(1)
    n = 2_000_000
    a, b = rng.random((n, 2)), rng.random((n, 2))  # left wall x = 0, right wall x = 1: y, z
    d = np.column_stack((np.ones(n), b - a))
    flat = d[:, :2]
    start = np.column_stack((np.full(n, -0.5), a[:, 0] - 0.5))
    nearest = np.clip(-np.sum(start * flat, axis=1) / np.sum(flat**2, axis=1), 0.0, 1.0)
    hidden = np.sum((start + nearest[:, None] * flat) ** 2, axis=1) < 0.09
    truth = float(np.mean(np.where(hidden, 0.0, 1.0 / (np.pi * np.sum(d**2, axis=1) ** 2))))
    assert found[0, 1] == pytest.approx(truth, rel=0.005)
    assert (found.sum(axis=1) < 1.0).all()
    assert error < 0.004
    assert areas[:, None] * found == pytest.approx((areas[:, None] * found).T, rel=1e-9)


PLACES = {
    "low": {"corner": [0, 0, 0], "sides": [["20 [cm]", 0, 0], [0, "20 [cm]", 0]]},
    "high": {"corner": [0, 0, "2 [cm]"], "sides": [[0, "20 [cm]", 0], ["20 [cm]", 0, 0]]},
}


def plates(enclosure: dict[str, Any]) -> td.Model:
    nodes = {"base": {"capacitance": "50 [J/K]"}, "cover": {"capacitance": "20 [J/K]"}}
    face = {"to": "sky", "area": "400 [cm^2]", "emissivity": 0.3}
    surfaces = {"inner": face | {"of": "base"}, "under": face | {"of": "cover"}}
    loads = {"heater": {"into": "base", "power": "1 [W]"}}
    deck = {"title": "cavity", "needs": ["sky"], "nodes": nodes, "surfaces": surfaces, "loads": loads}
    return td.model_from_dict(deck | {"enclosures": {"between": {"rest": "sky"} | enclosure}})


SPACE = td.Scenario("space", boundaries={"sky": "0 [degC]"})


def test_places_of_a_deck_are_the_shape() -> None:
    shape = {"shape": "facing plates", "dimensions": {"length": "20 [cm]", "width": "20 [cm]", "distance": "2 [cm]"}}
    known = td.steady(plates(shape | {"faces": {"first": "inner", "second": "under"}}), SPACE)
    found = td.steady(plates({"places": PLACES, "faces": {"low": "inner", "high": "under"}}), SPACE)
    for node in ("base", "cover"):
        assert found[node] == pytest.approx(known[node], abs=0.05)
    assert found.heat is not None
    assert found.heat.worst() < 1e-9


@pytest.mark.parametrize(
    ("places", "code", "match"),
    [
        ({"low": PLACES["low"]}, "model.law-refused", r"enclosures\.between\.places.*'high'"),
        (PLACES | {"high": PLACES["high"] | {"radius": "1 [m]"}}, "value.incomplete", r"enclosures\.between\.places\.high"),
        (
            PLACES | {"high": {"corner": [0, 0, "1 [m]"], "sides": [["1 [m]", 0, 0], ["2 [m]", 0, 0]]}},
            "value.outside-range",
            r"enclosures\.between\.places\.high",
        ),
        (PLACES | {"high": {"corner": [0, 0, "2 [cm]"], "sides": [["20 [cm]", 0, 0], [0, "20 [cm]", 0]]}}, "model.view-factors", "'high'"),
        (
            PLACES | {"high": {"corner": [0, 0, "2 [K]"], "sides": [[0, 1, 0], [1, 0, 0]]}},
            "unit.wrong-dimension",
            r"enclosures\.between\.places\.high",
        ),
    ],
)
def test_places_that_cannot_be(places: dict[str, Any], code: str, match: str) -> None:
    with raises_code(code, match=match):
        plates({"places": places, "faces": {"low": "inner", "high": "under"}})


def test_one_way_of_saying_is_enough() -> None:
    with raises_code("value.incomplete", DeckError, match=r"enclosures\.between.*view_factors.*exchange_factors"):
        plates({"places": PLACES, "view_factors": [[0, 1], [1, 0]], "faces": {"low": "inner", "high": "under"}})
