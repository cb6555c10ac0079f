"""Enclosures in decks: what they exchange, what is checked, and what is said of a fault."""

from __future__ import annotations

from typing import Any
from unittest.mock import patch

import numpy as np
import pytest

import thermid as td
from thermid.model._parts import enclosures
from thermid.model._tree.identity import to_dict

SIGMA = 5.670374419e-8
ROOM = td.Scenario("room", boundaries={"wall": "20 [degC]"})


def deck(**enclosure: Any) -> dict[str, Any]:
    """Two plates that face one another; the second one is tied to the wall."""
    given = {"faces": {"first": "a_skin", "second": "b_skin"}, "view_factors": [[0.0, 1.0], [1.0, 0.0]]} | enclosure
    return {
        "title": "plates",
        "needs": ["wall"],
        "nodes": {n: {"capacitance": "100 [J/K]"} for n in ("a", "b")},
        "surfaces": {f"{n}_skin": {"of": n, "to": "wall", "area": "0.02 [m^2]", "emissivity": "0.3"} for n in ("a", "b")},
        "conductors": {"tie": {"kind": "conduction", "between": ["b", "wall"], "conductance": "1 [W/K]"}},
        "loads": {"heater": {"into": "a", "power": "1 [W]"}},
        "enclosures": {"gap": {k: v for k, v in given.items() if v is not None}},
    }


def test_two_plates_by_hand() -> None:
    """One watt crosses from plate to plate, by 0.176 of black radiation, and nothing else leaves the first one."""
    model = td.model_from_dict(deck())
    assert not [f for f in model.check() if f.severity == "error"]
    found = td.steady(model, ROOM)
    assert found["b"] == pytest.approx(294.15, abs=1e-6)
    assert 0.3 / 1.7 * 0.02 * SIGMA * (found["a"] ** 4 - found["b"] ** 4) == pytest.approx(1.0, rel=1e-7)


def test_what_a_shape_leaves_goes_to_the_rest() -> None:
    """Plates that see the wall past one another: heat balances to round-off, and the first one is cooler than without an opening."""
    shape = {"shape": "facing plates", "dimensions": {"length": "20 [cm]", "width": "0.1 [m]", "distance": "5 [cm]"}}
    model = td.model_from_dict(deck(view_factors=None, rest="wall", **shape))
    solution = td.simulate(model, ROOM.with_(duration="2 [h]", start="20 [degC]"))
    assert abs(solution.heat_balance().relative) < 1e-6
    assert td.steady(model, ROOM)["a"] < td.steady(td.model_from_dict(deck()), ROOM)["a"] - 5.0


def test_imported_exchange_factors_are_the_same_plates() -> None:
    """Script-F from another program, in place of view factors."""
    own = td.steady(td.model_from_dict(deck()), ROOM)
    share = 0.3 / 1.7
    other = td.steady(td.model_from_dict(deck(view_factors=None, exchange_factors=[[0.0, share], [share, 0.0]])), ROOM)
    assert other["a"] == pytest.approx(own["a"], abs=1e-6)


def test_round_trip_and_identity() -> None:
    """Deck to model to deck keeps the meaning."""
    shape = {"shape": "facing plates", "dimensions": {"length": "20 [cm]", "width": "0.1 [m]", "distance": "5 [cm]"}}
    for given in (deck(), deck(view_factors=None, rest="wall", **shape)):
        model = td.model_from_dict(given)
        again = td.model_from_dict(to_dict(model))
        assert again == model
        assert again.identity() == model.identity()


def test_sensitivity_to_an_emissivity() -> None:
    """Against central differences of whole runs."""
    model, scenario = td.model_from_dict(deck()), ROOM.with_(duration="1 [h]", start="20 [degC]")
    path, step = "a_skin.emissivity", 1e-4
    exact = td.Options(error=4e-9)
    run = td.prepare(model, scenario, [path], every=600.0, options=exact).run(sensitivities=True)
    ends = [td.simulate(model.with_values({path: f"{0.3 + s}"}), scenario, options=exact)["a"].final for s in (-step, step)]
    assert run.sensitivity("a", path)[-1] == pytest.approx((ends[1] - ends[0]) / (2 * step), rel=1e-5)


def test_the_matrix_of_a_member_is_made_once_for_all_pairs() -> None:
    """Not once more for every two faces: a room of three has three pairs and its pairs with the wall."""
    box = deck(view_factors=[[0.0, 0.3, 0.3], [0.3, 0.0, 0.3], [0.3, 0.3, 0.0]], faces={f: f"{f}_skin" for f in "abc"}, rest="wall")
    box["nodes"]["c"], box["surfaces"]["c_skin"] = box["nodes"]["a"], {**box["surfaces"]["a_skin"], "of": "c"}
    with patch.object(enclosures, "exchange_areas_of", wraps=enclosures.exchange_areas_of) as made:
        values = {"a_skin.emissivity": np.linspace(0.2, 0.9, 8)}
        td.ensemble(td.model_from_dict(box), ROOM.with_(duration="1 [h]", start="20 [degC]"), values)
    assert made.call_count <= 8 + 2


def test_surfaces_of_parts_are_faces() -> None:
    """A cover of its own deck: its offered surface closes the cavity above, and joints still take area from it."""
    plate = td.model_from_dict(
        {
            "title": "plate",
            "needs": ["air"],
            "offers": ["body", "skin"],
            "nodes": {"body": {"capacitance": "10 [J/K]"}},
            "surfaces": {"skin": {"of": "body", "to": "air", "area": "0.02 [m^2]", "htc": "2 [W/(m^2 K)]", "emissivity": "0.3"}},
        }
    )
    both = td.model_from_dict(
        {
            "title": "pair",
            "needs": ["air"],
            "submodels": {n: {"use": plate, "bind": {"air": "air"}} for n in ("low", "high")},
            "loads": {"heater": {"into": "low.body", "power": "1 [W]"}},
            "enclosures": {"gap": {"faces": {"low": "low.skin", "high": "high.skin"}, "view_factors": [[0, 0.9], [0.9, 0]], "rest": "air"}},
        }
    )
    network = td.simulation.compile_network(both)
    rows = {row.name: value for row in network.numbers().conductors for value in [row.coefficients[0]]}
    assert {"gap.low.high", "gap.low.rest", "gap.high.rest"} <= set(rows)
    assert not any(name.endswith(".radiation") for name in rows)
    # script-F of two grey plates and a black opening: what one sends in all is its emissivity
    assert rows["gap.low.high"] + rows["gap.low.rest"] == pytest.approx(0.3 * 0.02 * SIGMA * (1 - self_share()), rel=1e-9)


def self_share() -> float:
    """Share of what a plate emits that comes back to itself: by the other plate's reflection."""
    factors = np.array([[0.0, 0.9, 0.1], [0.9, 0.0, 0.1], [0.5, 0.5, 0.0]])
    rho = np.diag([0.7, 0.7, 0.0])
    gebhart = np.linalg.solve(np.eye(3) - factors @ rho, factors @ np.diag([0.3, 0.3, 1.0]))
    return float(gebhart[0, 0])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"view_factors": [[0.0, 0.9], [0.9, 0.0]]}, r"view factors of 'first' sum to 0.9, not to one"),
        (
            {"view_factors": [[0.0, 1.0], [0.8, 0.2]]},
            r"violate reciprocity: area times factor is 0.02 m\^2 one way \(0.02 m\^2 times 1\) and 0.016 m\^2",
        ),
        ({"view_factors": [[-0.1, 1.1], [1.1, -0.1]]}, r"the view factor from 'first' to 'first' is -0.1"),
        ({"view_factors": [[0.0, 1.2], [1.2, 0.0]], "rest": "wall"}, r"sum to 1.2, not to one. The sum must not exceed one\."),
        ({"view_factors": [[0.0, 1.0]]}, r"2 faces need 2 rows of 2 view factors"),
        ({"view_factors": None}, r"exactly one of places, shape, view_factors and exchange_factors; given: none"),
        ({"shape": "box"}, r"given: shape and view_factors"),
        ({"dimensions": {"length": "1 [m]"}}, r"dimensions are given, but no"),
        ({"faces": {"first": "a_skin", "second": "a_skin"}}, r"'a_skin' is a face of 'gap' already"),
        ({"faces": {"first": "a_skin", "second": "c_skin"}}, r"no surface 'c_skin'. Did you mean"),
    ],
)
def test_faults(change: dict[str, Any], message: str) -> None:
    """What is wrong, where, and what to do."""
    with pytest.raises(td.ThermidError, match=message):
        td.simulation.compile_network(td.model_from_dict(deck(**change)))


@pytest.mark.parametrize(
    ("shape", "dimensions", "rest", "message"),
    [
        ("box", {"length": "1 [m]"}, "wall", r"'box' has no 'first' among its faces: floor, lid"),
        ("facing plates", {"length": "1 [m]", "width": "1 [m]"}, "wall", r"'facing plates' needs distance"),
        ("facing plates", {"length": "1 [m]", "width": "1 [m]", "height": "1 [m]"}, "wall", r"no 'height' among its dimensions"),
        ("facing plates", {"length": "1 [m]", "width": "1 [m]", "distance": "0 [m]"}, "wall", r"'dimensions' is 0 m"),
        ("facing plates", {"length": "1 [m]", "width": "1 [m]", "distance": "1 [m]"}, None, r"do not close it: their view factors sum to"),
        (
            "facing plates",
            {"length": "1 [m]", "width": "1 [m]", "distance": "1 [m]"},
            "wall",
            r"has 200 cm\^2 free, but the face 'first' has",
        ),
    ],
)
def test_faults_of_shapes(shape: str, dimensions: dict[str, str], rest: str | None, message: str) -> None:
    """Shapes need their own faces and lengths, and surfaces that fill them."""
    with pytest.raises(td.ThermidError, match=message):
        td.simulation.compile_network(td.model_from_dict(deck(view_factors=None, shape=shape, dimensions=dimensions, rest=rest)))


@pytest.mark.parametrize(
    ("surface", "message"),
    [
        ({"effective_htc": "5 [W/(m^2 K)]"}, r"its effective_htc includes radiation already"),
        ({"emissivity": None, "htc": "5 [W/(m^2 K)]"}, r"it has no emissivity"),
        ({"radiates_to": "wall"}, "'a_skin' radiates to 'wall' and in the"),
        ({"emissivity": "0"}, r"the emissivity of 'a_skin' is 0\. In an enclosure it must be above 0, up to 1\."),
        ({"emissivity": "1.2"}, r"'a_skin.emissivity' is 1\.2\."),
    ],
)
def test_faults_of_faces(surface: dict[str, str | None], message: str) -> None:
    """A face radiates in its enclosure and nowhere else."""
    given = deck()
    given["surfaces"]["a_skin"] = {k: v for k, v in (given["surfaces"]["a_skin"] | surface).items() if v is not None}
    with pytest.raises(td.ThermidError, match=message):
        td.simulation.compile_network(td.model_from_dict(given))
