"""The modal solution and the integrator, each the other's oracle; what is exact for modes: superposition, reciprocity, the balance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import strategies as st

import thermid as td
from strategies import DURATION, LINEAR, TIGHTER, Case, Deck, build, cases, decks, even, random_models, signals, spread, temperature, text

TIMES = np.unique(np.concatenate((np.linspace(0.0, DURATION, 37), [0.1, 333.3, 1000.07, DURATION - 1e-3])))
POWERS = ("constant", "periodic", "sine")
MODAL = td.Options(method="modal")
STEPS = replace(TIGHTER, method="integrator")


def _temperatures(deck: Deck, case: Case, options: td.Options) -> np.ndarray:
    return td.simulate(build(deck), case.run(), times=TIMES, options=options).temperatures


def _with_power(deck: Deck, node: str, power: str) -> Deck:
    return {**deck, "loads": {**deck.get("loads", {}), "probe": {"into": node, "power": power}}}


@random_models(60, case=cases(kinds=LINEAR, loads=POWERS))
def test_modes_and_steps_agree(case: Case) -> None:
    one, other = (td.simulate(case.model, case.run(), times=TIMES, options=options) for options in (MODAL, STEPS))
    assert (one.statistics["method"], other.statistics["method"]) == ("modal", "integrator")
    np.testing.assert_allclose(one.temperatures, other.temperatures, rtol=0, atol=1e-6)
    mine, theirs = one.heat_balance(), other.heat_balance()
    assert mine.relative < 1e-11
    scale = abs(mine.loads) + abs(mine.boundaries) + abs(mine.stored) + 1e-3
    # steps control temperatures, not energies: a sine at a massless node is summed to some 1e-6 only
    within = (1e-5 if "sine" in str(case.deck) else 1e-6) * scale
    assert (mine.loads, mine.boundaries, mine.stored) == pytest.approx((theirs.loads, theirs.boundaries, theirs.stored), abs=within)


@st.composite
def awkward(draw: st.DrawFn) -> Case:
    """Equal parts (equal rates), an island without a boundary (rate zero), one tiny capacitance, inputs of every kind."""
    parts = draw(st.integers(2, 5))
    nodes = {
        "hub": {"capacitance": text(draw(spread(50, 500)), "J/K")},
        "tiny": {"capacitance": text(draw(st.sampled_from([1e-9, 1e-4, 0.1])), "J/K")},
    }
    nodes |= {f"p{k}": {"capacitance": "80.0 [J/K]"} for k in range(parts)}
    nodes |= {f"i{k}": {"capacitance": "30.0 [J/K]"} for k in range(2)}
    pairs = [("hub", "tiny", draw(spread(0.1, 10))), ("tiny", "p0", draw(spread(0.1, 10))), ("i0", "i1", 0.5)]
    pairs += [(f"p{k}", end, g) for k in range(parts) for end, g in (("hub", 0.7), ("e0", 0.2))]
    links = {f"c{k}": {"kind": "conduction", "between": [a, b], "conductance": text(g, "W/K")} for k, (a, b, g) in enumerate(pairs)}
    loads = {"q0": {"into": "hub", "power": "3.0 [W]"}, "q1": {"into": "i0", "power": text(draw(even(0.0, 0.2)), "W")}}
    commands = {
        "q0": {"times": ["0.0 [s]", "900.0 [s]", "1500.5 [s]"], "values": [1.0, 0.0, 0.5], "hold": draw(st.booleans()), "after": "hold"}
    }
    deck: Deck = {"title": "Awkward", "needs": ["e0"], "nodes": nodes, "conductors": links, "loads": loads}
    initial = {"p0": draw(temperature()), "i1": draw(temperature())}
    scenario = {
        "boundaries": {"e0": draw(signals())},
        "start": draw(temperature()),
        "duration": DURATION,
        "initial": initial,
        "commands": commands,
    }
    return Case(deck, scenario)


@random_models(40, case=awkward())
def test_modes_and_steps_agree_on_awkward_networks(case: Case) -> None:
    """Also at 0.1 s, when a tiny node has long settled and its neighbours have hardly moved."""
    one, other = (td.simulate(case.model, case.run(), times=TIMES, options=options) for options in (MODAL, STEPS))
    np.testing.assert_allclose(one.temperatures, other.temperatures, rtol=0, atol=2e-6)
    assert one.heat_balance().relative < 1e-11


@random_models(40, case=cases(kinds=LINEAR, loads=POWERS), watts=st.tuples(st.floats(0, 9), st.floats(0, 9)))
def test_loads_add_up(case: Case, watts: tuple[float, float]) -> None:
    node = list(case.deck["nodes"])[-1]
    powers = (0.0, watts[0], watts[1], sum(watts))
    none, one, other, both = (_temperatures(_with_power(case.deck, node, text(w, "W")), case, MODAL) for w in powers)
    np.testing.assert_allclose((one - none) + (other - none), both - none, rtol=0, atol=1e-9 * (1 + np.abs(both - none).max()))


@random_models(40, case=cases(kinds=LINEAR, loads=("constant",), flat=True), pick=st.tuples(st.integers(0, 7), st.integers(0, 7)))
def test_heat_here_read_there_is_heat_there_read_here(case: Case, pick: tuple[int, int]) -> None:
    nodes = list(case.deck["nodes"])
    a, b = (nodes[k % len(nodes)] for k in pick)
    runs = [
        td.simulate(build(_with_power(case.deck, n, text(w, "W"))), case.run(), times=TIMES, options=MODAL)
        for n, w in ((a, 0.0), (a, 5.0), (b, 5.0))
    ]
    there, here = runs[1][b].kelvin - runs[0][b].kelvin, runs[2][a].kelvin - runs[0][a].kelvin
    np.testing.assert_allclose(there, here, rtol=0, atol=1e-9 * (1 + np.abs(here).max()))


@random_models(20, deck=decks(kinds=LINEAR, loads=()))
def test_rest_stays_at_rest(deck: Deck) -> None:
    scenario = td.Scenario("still", boundaries=dict.fromkeys(deck["needs"], "297.3 [K]"), start="297.3 [K]", duration=DURATION)
    found = td.simulate(build(deck), scenario, options=MODAL)
    np.testing.assert_allclose(found.temperatures, 297.3, rtol=0, atol=1e-12)
    assert found.heat_balance().stored == pytest.approx(0.0, abs=1e-9)
