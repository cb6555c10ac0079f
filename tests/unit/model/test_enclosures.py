"""Enclosures in decks: what they exchange, what is checked, and what is said of a fault."""

from __future__ import annotations

from typing import Any
from unittest.mock import patch

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
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
    ("change", "code", "match"),
    [
        ({"view_factors": [[0.0, 0.9], [0.9, 0.0]]}, "model.view-factors", r"'first'.*0\.9"),
        (
            {"view_factors": [[0.0, 1.0], [0.8, 0.2]]},
            "model.view-factors",
            r"0\.02.*2.*0\.02.*2.*1.*0\.016.*2",
        ),
        ({"view_factors": [[-0.1, 1.1], [1.1, -0.1]]}, "model.view-factors", r"'first'.*'first'.*-0\.1"),
        ({"view_factors": [[0.0, 1.2], [1.2, 0.0]], "rest": "wall"}, "model.view-factors", r"1\.2"),
        ({"view_factors": [[0.0, 1.0]]}, "value.shape", "2.*2.*2"),
        ({"view_factors": None}, "value.incomplete", "view_factors.*exchange_factors"),
        ({"shape": "box"}, "value.incomplete", "view_factors"),
        ({"dimensions": {"length": "1 [m]"}}, "value.excludes-another", r"enclosures\.gap"),
        ({"faces": {"first": "a_skin", "second": "a_skin"}}, "value.contradicts", "'a_skin'.*'gap'"),
        ({"faces": {"first": "a_skin", "second": "c_skin"}}, "name.unknown", "'c_skin'"),
    ],
)
def test_faults(change: dict[str, Any], code: str, match: str) -> None:
    """What is wrong, where, and what to do."""
    with raises_code(code, match=match):
        td.simulation.compile_network(td.model_from_dict(deck(**change)))


@pytest.mark.parametrize(
    ("shape", "dimensions", "rest", "code", "match"),
    [
        ("box", {"length": "1 [m]"}, "wall", "name.unknown", "'box'.*'first'"),
        ("facing plates", {"length": "1 [m]", "width": "1 [m]"}, "wall", "value.incomplete", "'facing plates'"),
        ("facing plates", {"length": "1 [m]", "width": "1 [m]", "height": "1 [m]"}, "wall", "name.unknown", "'height'"),
        ("facing plates", {"length": "1 [m]", "width": "1 [m]", "distance": "0 [m]"}, "wall", "value.outside-range", "'dimensions'.*0"),
        (
            "facing plates",
            {"length": "1 [m]", "width": "1 [m]", "distance": "1 [m]"},
            None,
            "value.contradicts",
            r"enclosures\.gap.*'facing plates'",
        ),
        (
            "facing plates",
            {"length": "1 [m]", "width": "1 [m]", "distance": "1 [m]"},
            "wall",
            "value.contradicts",
            "200.*2.*'first'",
        ),
    ],
)
def test_faults_of_shapes(shape: str, dimensions: dict[str, str], rest: str | None, code: str, match: str) -> None:
    """Shapes need their own faces and lengths, and surfaces that fill them."""
    with raises_code(code, match=match):
        td.simulation.compile_network(td.model_from_dict(deck(view_factors=None, shape=shape, dimensions=dimensions, rest=rest)))


@pytest.mark.parametrize(
    ("surface", "code", "match"),
    [
        ({"effective_htc": "5 [W/(m^2 K)]"}, "value.contradicts", "effective_htc"),
        ({"emissivity": None, "htc": "5 [W/(m^2 K)]"}, "value.contradicts", r"enclosures\.gap.*'a_skin'.*'gap'"),
        ({"radiates_to": "wall"}, "value.contradicts", "'a_skin'.*'wall'"),
        ({"emissivity": "0"}, "value.outside-range", "'a_skin'.*0.*0.*1"),
        ({"emissivity": "1.2"}, "value.outside-range", r"'a_skin\.emissivity'.*1\.2"),
    ],
)
def test_faults_of_faces(surface: dict[str, str | None], code: str, match: str) -> None:
    """A face radiates in its enclosure and nowhere else."""
    given = deck()
    given["surfaces"]["a_skin"] = {k: v for k, v in (given["surfaces"]["a_skin"] | surface).items() if v is not None}
    with raises_code(code, match=match):
        td.simulation.compile_network(td.model_from_dict(given))
