"""Properties 3 and 4: names and order of what a model is made of mean nothing; neither does its nesting."""

from __future__ import annotations

import random
from typing import Any

import numpy as np
from hypothesis import strategies as st

import thermid as td
from oracle import DECK_TABLES, flatten
from strategies import LOADS, TIGHTER, Case, Deck, build, cases, random_models

SAME = 1e-7  # sums in another order differ by rounding only, which a step of the integrator may answer within its tolerance, in kelvin


def _renamed(deck: Deck, scenario: dict[str, Any], names: dict[str, str]) -> tuple[Deck, dict[str, Any]]:
    """Return a flat deck and its scenario with nodes and boundaries under other names."""
    swap = lambda given: names.get(given, given)  # noqa: E731
    out: Deck = {**deck, "needs": [swap(n) for n in deck["needs"]], "nodes": {swap(n): v for n, v in deck["nodes"].items()}}
    if "surfaces" in deck:
        out["surfaces"] = {
            n: {k: swap(v) if k in ("of", "to", "radiates_to") else v for k, v in s.items()} for n, s in deck["surfaces"].items()
        }
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


@random_models(50, case=cases(loads=LOADS), seed=st.integers(0, 10**6))
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


@random_models(60, case=cases(loads=LOADS))
def test_nested_and_flat_models_have_the_same_temperatures(case: Case) -> None:
    deck, names = flatten(case.deck)
    scenario = {**case.scenario, "initial": {names[n]: v for n, v in case.scenario["initial"].items()}}
    nested = td.simulate(case.model, case.run(), options=TIGHTER)
    flat = td.simulate(build(deck), td.Scenario("flat", **scenario), options=TIGHTER)
    assert set(nested.nodes) == set(names)
    worst = max(float(np.abs(nested[path].kelvin - flat[name].kelvin).max()) for path, name in names.items())
    assert worst < SAME
