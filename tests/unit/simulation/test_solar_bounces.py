"""The sun in an enclosure: what a face reflects falls on the others, again and again; none of it is lost."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.physics.enclosure import absorbing_areas

SUN = 800.0
ABSORBED = (0.3, 0.6, 0.9)


def cavity(absorptances: tuple[Any, ...] = ABSORBED, rest: bool = True, yard: bool = False) -> td.Model:
    """Three faces of 1, 2 and 1.5 m^2; with `rest` a window through which light leaves, to a boundary or to the node `yard`."""
    areas, names = (1.0, 2.0, 1.5), ("floor", "wall", "lid")
    # area times factor, both ways; what is left of each face is the window, or its view of itself
    seen = np.array([[0.0, 0.35, 0.25], [0.35, 0.2, 0.6], [0.25, 0.6, 0.1]])
    if not rest:
        seen += np.diag(np.array(areas) - seen.sum(axis=1))
    factors = (seen / np.array(areas)[:, None]).tolist()
    surfaces = {
        n: {"of": f"m_{n}", "to": "air", "area": f"{a} [m^2]", "htc": "5 [W/(m^2 K)]", "emissivity": 0.8}
        | ({"absorptance": s} if s is not None else {})
        for n, a, s in zip(names, areas, absorptances, strict=True)
    }
    box = {"faces": {n: n for n in names}, "view_factors": factors} | ({"rest": "yard"} if rest else {})
    deck = {
        "title": "cavity",
        "needs": ["air"] if yard else ["air", "yard"],
        "nodes": {n: {"capacitance": "2000 [J/K]"} for n in (*(f"m_{n}" for n in names), *(["yard"] if yard else []))},
        "surfaces": surfaces,
        "conductors": {"joint": {"kind": "conduction", "between": ["m_floor", "yard"], "conductance": "1 [W/K]"}},
        "enclosures": {"box": box},
    }
    return td.model_from_dict(deck)


def lit(*faces: str, **more: Any) -> td.Scenario:
    falling = {f: td.simulation.Irradiation(direct=f"{SUN} [W/m^2]") for f in faces}
    return td.Scenario(
        boundaries={"air": "20 [degC]", "yard": "10 [degC]"}, irradiation=falling, start="20 [degC]", duration="1 [h]", **more
    )


def traced(model: td.Model, first: int) -> np.ndarray[Any, Any]:
    """What each face absorbs of the sun on one, bounce after bounce. [W]"""
    box = model.enclosures["box"]
    areas = np.array([1.0, 2.0, 1.5])
    dark = np.array(ABSORBED)
    factors = np.array(box.view_factors)
    falls, taken = np.zeros(3), np.zeros(3)
    falls[first] = SUN * areas[first]
    for _ in range(400):
        taken += dark * falls
        falls = ((1.0 - dark) * falls) @ factors
    return taken


@pytest.mark.parametrize("rest", [True, False])
@pytest.mark.parametrize("first", [0, 1, 2])
def test_what_a_face_reflected_was_lost(rest: bool, first: int) -> None:
    """Of 800 W on a floor that absorbs 0.3, 240 W were counted, and 560 W nowhere."""
    model = cavity(rest=rest)
    names = list(model.enclosures["box"].faces)
    run = td.simulate(model, lit(names[first]))
    want = traced(model, first)
    at = f"{names[first]}.sun"
    found = [float(run.load_powers[at if k == first else f"{at}.{n}"][-1]) for k, n in enumerate(names)]
    assert found == pytest.approx(want, rel=1e-9)
    if not rest:
        assert sum(found) == pytest.approx(SUN * (1.0, 2.0, 1.5)[first], rel=1e-9)
    assert run.heat_balance().relative < 1e-9


def test_light_that_leaves_by_the_rest_heats_its_node() -> None:
    """The yard behind the window, a node: all of the light is somewhere."""
    given = lit("floor", "wall")
    run = td.simulate(cavity(yard=True), td.Scenario("y", boundaries={"air": "20 [degC]"}, irradiation=given.irradiation, duration="1 [h]"))
    powers = {name: float(w[-1]) for name, w in run.load_powers.items()}
    assert sum(powers.values()) == pytest.approx(SUN * 3.0, rel=1e-9)
    assert powers["floor.sun.rest"] == pytest.approx(SUN - traced(cavity(), 0).sum(), rel=1e-9)
    assert run.heat_balance().relative < 1e-9
    out = td.simulate(cavity(), given)
    assert not any(name.endswith(".rest") and w.any() for name, w in out.load_powers.items() if name not in powers)


def test_black_faces_and_faces_without_sun_are_as_before() -> None:
    black = td.simulate(cavity((1.0, 1.0, 1.0)), lit("floor"))
    assert black.load_powers["floor.sun"][-1] == pytest.approx(SUN)
    assert black.load_powers["floor.sun.wall"][-1] == pytest.approx(0.0, abs=1e-12)
    dark = td.simulate(cavity((None, None, None)), lit())
    assert not any("sun" in name for name in dark.load_powers)


def test_derivatives_are_differences() -> None:
    free = ("floor.absorptance", "wall.absorptance", "lid.absorptance", "wall.emissivity")
    simulator = td.prepare(cavity(), lit("floor", "lid"), free, times=np.array([600.0, 3600.0]))
    slopes, nominal = simulator.run(sensitivities=True), simulator.nominal
    for name in free:
        up, down = (simulator.run({name: nominal[name] + step}) for step in (1e-4, -1e-4))
        for node in ("m_floor", "m_wall", "m_lid"):
            want = (up[node].kelvin - down[node].kelvin) / 2e-4
            assert slopes.sensitivity(node, name) == pytest.approx(want, rel=2e-4, abs=2e-4)


def test_members_and_steady_states_have_them() -> None:
    model = cavity()
    draws = np.array([0.2, 0.5])
    many = td.ensemble(model, lit("floor"), {"floor.absorptance": draws})
    for k, share in enumerate(draws):
        one = td.simulate(model.with_values({"floor.absorptance": float(share)}), lit("floor"))
        assert np.abs(many.trace(k, "m_wall").kelvin - one["m_wall"].kelvin).max() < 1e-4
    heat = td.steady(model, lit("floor")).heat
    assert heat is not None
    assert heat.worst() < 1e-9


def test_members_with_other_emissivities_of_faces_crashed() -> None:
    """UFuncTypeError out of an ensemble, whatever fell on the faces."""
    draws = {"wall.emissivity": np.array([0.3, 0.9]), "floor.area": np.array([1.0, 1.0])}
    many = td.ensemble(cavity(), lit(), draws)
    for k, share in enumerate(draws["wall.emissivity"]):
        one = td.simulate(cavity().with_values({"wall.emissivity": float(share)}), lit())
        assert np.abs(many.trace(k, "m_lid").kelvin - one["m_lid"].kelvin).max() < 1e-4


def test_random_cavities_close() -> None:
    """Random symmetric exchanges: the sun that falls in is the sun that is absorbed, whatever the faces."""
    rng = np.random.default_rng(5)
    for _ in range(20):
        seen = rng.uniform(0.1, 1.0, (3, 3))
        seen = seen + seen.T
        areas = seen.sum(axis=1)
        found = np.array(absorbing_areas(seen / areas[:, None], areas.tolist(), rng.uniform(0.05, 1.0, 3).tolist()))
        assert found.sum(axis=0) == pytest.approx(areas, rel=1e-12)


def test_what_has_no_reflection_is_refused() -> None:
    with raises_code("model.view-factors", match="'floor'.*'wall'.*'box'"):
        td.simulate(cavity((0.3, None, 0.9)), lit("floor"))
    with raises_code("value.contradicts"):
        td.simulate(cavity((0.0, 0.0, 0.0), rest=False), lit("floor"))
    with pytest.raises(td.ThermidError, match=r"'lid\.absorptance' is 1\.2"):
        td.simulate(cavity((0.3, 0.6, 1.2)), lit("floor"))
    given = [[0.0, 0.2, 0.1], [0.1, 0.0, 0.3], [0.2 / 3.0, 0.4, 0.0]]
    deck = cavity()
    with raises_code("value.contradicts"):
        td.simulate(imported(deck, given), lit("floor"))


def imported(model: td.Model, factors: list[list[float]]) -> td.Model:
    """The same with exchange factors."""
    box = replace(model.enclosures["box"], view_factors=(), exchange_factors=tuple(map(tuple, factors)), rest="")
    return replace(model, enclosures={"box": box})
