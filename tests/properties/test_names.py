"""Properties 3 and 4: names and order of what a model is made of mean nothing; neither does its nesting."""

from __future__ import annotations

import random
from typing import Any

import numpy as np
from hypothesis import strategies as st

import thermid as td
from oracle import DECK_TABLES, flatten
from strategies import DURATION, LOADS, SMOOTH, TIGHTER, WITHOUT_KNEES, Case, Deck, build, cases, random_models
from thermid.simulation.runs import Engine, Wiring

SAME = 1e-6  # sums in another order differ by rounding only, which a step may answer within its tolerance, in kelvin


def _renamed(deck: Deck, scenario: dict[str, Any], names: dict[str, str]) -> tuple[Deck, dict[str, Any]]:
    """Return a flat deck and its scenario with nodes and boundaries under other names."""
    swap = lambda given: names.get(given, given)  # noqa: E731
    out: Deck = {**deck, "needs": [swap(n) for n in deck["needs"]], "nodes": {swap(n): v for n, v in deck["nodes"].items()}}
    if "surfaces" in deck:
        out["surfaces"] = {n: {k: swap(v) if k in ("of", "to", "sees") else v for k, v in s.items()} for n, s in deck["surfaces"].items()}
    if "conductors" in deck:
        out["conductors"] = {n: {**c, "between": [swap(e) for e in c["between"]]} for n, c in deck["conductors"].items()}
    if "joints" in deck:
        out["joints"] = {
            n: {**j, **({"gap": {**j["gap"], "to": swap(j["gap"]["to"])}} if "gap" in j else {})} for n, j in deck["joints"].items()
        }
    if "loads" in deck:
        out["loads"] = {n: {**q, "into": swap(q["into"])} for n, q in deck["loads"].items()}
        for q in out["loads"].values():
            if "sensor" in q.get("proportional", {}):
                q["proportional"] = {**q["proportional"], "sensor": swap(q["proportional"]["sensor"])}
    new = {key: {swap(n): v for n, v in scenario[key].items()} if key in ("boundaries", "initial") else scenario[key] for key in scenario}
    return out, new


@random_models(50, case=cases(kinds=WITHOUT_KNEES, loads=SMOOTH), seed=st.integers(0, 10**6))
def test_other_names_and_another_order_change_nothing(case: Case, seed: int) -> None:
    deck, names = flatten(case.deck)
    scenario = {**case.scenario, "initial": {names[n]: v for n, v in case.scenario["initial"].items()}}
    shuffle = random.Random(seed)
    fresh = [f"x{k}" for k in range(len(names))]
    shuffle.shuffle(fresh)
    new = dict(zip([n for n in names.values() if "." not in n and n not in _mids(deck)], fresh, strict=False))
    other, other_scenario = _renamed(deck, scenario, new)
    for table in DECK_TABLES:
        if table in other:
            entries = list(other[table].items())
            shuffle.shuffle(entries)
            other[table] = dict(entries)
    shuffle.shuffle(other["needs"])
    before = td.simulate(build(deck), td.Scenario("before", **scenario), options=TIGHTER)
    after = td.simulate(build(other), td.Scenario("after", **other_scenario), options=TIGHTER)
    worst = max(float(np.abs(before[n].kelvin - after[new.get(n, n)].kelvin).max()) for n in names.values())
    assert worst < SAME


def _mids(deck: Deck) -> set[str]:
    return {j["mid"] for j in deck.get("joints", {}).values() if "mid" in j}


@random_models(60, case=cases(kinds=WITHOUT_KNEES, loads=SMOOTH))
def test_nested_and_flat_models_have_the_same_temperatures(case: Case) -> None:
    deck, names = flatten(case.deck)
    scenario = {**case.scenario, "initial": {names[n]: v for n, v in case.scenario["initial"].items()}}
    nested = td.simulate(case.model, case.run(), options=TIGHTER)
    flat = td.simulate(build(deck), td.Scenario("flat", **scenario), options=TIGHTER)
    assert set(nested.nodes) == set(names)
    worst = max(float(np.abs(nested[path].kelvin - flat[name].kelvin).max()) for path, name in names.items())
    assert worst < SAME


@random_models(60, case=cases(loads=LOADS), at=st.tuples(st.integers(0, 2**31), st.floats(0, DURATION)))
def test_neither_nesting_nor_order_changes_the_equations(case: Case, at: tuple[int, float]) -> None:
    """Net heats and their Jacobian at any temperatures, every law and load included, differ by rounding only."""
    deck, names = flatten(case.deck)
    backwards = {k: dict(reversed(v.items())) if k in DECK_TABLES else v for k, v in deck.items()}
    scenario = {**case.scenario, "initial": {names[n]: v for n, v in case.scenario["initial"].items()}}
    nested = Wiring(td.simulation.compile_network(case.model), case.run())
    engine = Engine(nested)
    temperatures = np.random.default_rng(at[0]).uniform(250, 350, len(engine.nodes))
    heat, jacobian, _ = engine.rhs(nested.assemble(), temperatures, at[1])
    for twin in (deck, backwards):
        wiring = Wiring(td.simulation.compile_network(build(twin)), td.Scenario("flat", **scenario))
        other = Engine(wiring)
        order = [other.nodes.index(names[n]) for n in engine.nodes]
        moved = np.empty_like(temperatures)
        moved[order] = temperatures
        found, slopes, _ = other.rhs(wiring.assemble(), moved, at[1])
        np.testing.assert_allclose(found[order], heat, rtol=0, atol=1e-10 * (1 + np.abs(heat).max()))
        np.testing.assert_allclose(slopes[np.ix_(order, order)], jacobian, rtol=0, atol=1e-12 * (1 + np.abs(jacobian).max()))
