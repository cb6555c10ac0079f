"""Properties 1 and 6 with leads, conductivities and specific heats that change with temperature, and air at low pressure."""

from __future__ import annotations

from typing import Any

import numpy as np

import thermid as td
from strategies import DURATION, LINEAR, SWITCHED, TIGHT, Case, Deck, build, cases, number, random_models
from thermid.model.tree import Constant

TIMES = np.linspace(0.0, DURATION, 13)


def rising(value: Any, unit: str) -> dict[str, Any]:
    """A property that grows by half from 250 to 350 K and has the value given at 290 K or so."""
    return {"points": [[f"{t} [K]", f"{number(value) * s!r} [{unit}]"] for t, s in ((250.0, 0.8), (290.0, 1.0), (350.0, 1.2))]}


def dressed(deck: Deck, leads: bool = True, tables: bool = True) -> Deck:
    """A deck whose bars and masses have properties over temperature, and whose first node has a harness."""
    nodes, conductors = dict(deck["nodes"]), dict(deck.get("conductors", {}))
    if tables:
        nodes = {n: f | {"specific_heat": rising(f["specific_heat"], "J/(kg K)")} if "specific_heat" in f else f for n, f in nodes.items()}
        conductors = {
            n: c | {"conductivity": rising(c["conductivity"], "W/(m K)")} if "conductivity" in c else c for n, c in conductors.items()
        }
        heavy = {"mass": "0.4 [kg]", "specific_heat": rising(800.0, "J/(kg K)")}
        nodes["block"] = heavy
        bar = {"conductivity": rising(20.0, "W/(m K)"), "area": "2e-4 [m^2]", "thickness": "0.02 [m]"}
        conductors["bar"] = {"kind": "conduction", "between": ["block", "n0"], **bar}
    if leads:
        wire = {"conductivity": "390 [W/(m K)]", "diameter": "0.8 [mm]", "length": "0.4 [m]", "count": 6, "htc": "18 [W/(m^2 K)]"}
        conductors["harness"] = {"kind": "lead", "between": ["n0", deck["needs"][0]], "to": deck["needs"][-1], **wire}
    return deck | {"nodes": nodes, "conductors": conductors}


@random_models(25, case=cases(loads=SWITCHED))
def test_balance_with_properties_that_change(case: Case) -> None:
    found = td.simulate(build(dressed(case.deck)), case.run()).heat_balance()
    # of a model at rest no share can be told: what is left is Newton's tolerance, 2e-10 K of the block's 400 J/K
    assert found.relative < 1e-6 or abs(found.residual) < 1e-7


@random_models(15, case=cases(kinds=("conductivity", "conductance", "contact", "convection"), loads=("constant",), flat=True))
def test_balance_in_thin_air(case: Case) -> None:
    deck = dressed({k: v for k, v in case.deck.items() if k not in ("surfaces", "joints", "offers")})
    deck["conductors"]["gap"] = {"kind": "gas", "between": ["n0", deck["needs"][0]], "area": "0.01 [m^2]", "gap": "2 [mm]"}
    thin = case.run().with_(environment={"*": td.simulation.Environment(Constant(3e3))})
    assert td.simulate(build(deck), thin).heat_balance().relative < 1e-6


@random_models(25, case=cases(kinds=(*LINEAR, "flow"), loads=("constant",)))
def test_loads_add_up_with_leads(case: Case) -> None:
    deck = dressed(case.deck, tables=False)
    node = list(deck["nodes"])[-1]

    def run(watts: float) -> np.ndarray:
        loads = {**deck.get("loads", {}), "probe": {"into": node, "power": f"{watts!r} [W]"}}
        return td.simulate(build(deck | {"loads": loads}), case.run(), times=TIMES, options=TIGHT).temperatures

    none, one, other, both = (run(w) for w in (0.0, 2.5, 4.0, 6.5))
    np.testing.assert_allclose((one - none) + (other - none), both - none, rtol=0, atol=1e-5 * (1 + np.abs(both - none).max()))
