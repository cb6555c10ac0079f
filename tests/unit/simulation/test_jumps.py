"""What an output that lies exactly on the jump of an input shows, the same whoever computes it: docs/design/kernel.md."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import thermid as td
from strategies import TIGHTER

SPAN = 2400.0
TIMES = np.linspace(0.0, SPAN, 9)
JUMP = {"times": ["0.0 [s]", "1200.0 [s]", "2100.0 [s]"], "values": ["258.0 [K]", "258.0 [K]", "255.0 [K]"], "hold": True}
# Its knots are no temperatures of these runs: at a knot a sensitivity has two sides.
TABLE = {"over": "temperature", "points": [["240.0 [K]", "0.04 [W/K]"], ["295.0 [K]", "0.05 [W/K]"], ["340.0 [K]", "0.05 [W/K]"]]}
LINKS = {"linear": {"kind": "conduction", "conductance": "0.04 [W/K]"}, "curved": {"kind": "table", "table": TABLE}}
STEPS = replace(TIGHTER, method="integrator")
ON = int(np.flatnonzero(TIMES == 2100.0)[0])


def _model(link: str, capacitance: float, massless: bool = True) -> td.Model:
    """A fast node on the air that jumps, a slow one behind it, and one without capacitance between the three."""
    ends = {"to_air": ["air", "mid"], "to_fast": ["mid", "fast"], "to_slow": ["mid", "slow"]}
    conductors = {name: {**LINKS[link if name == "to_air" else "linear"], "between": between} for name, between in ends.items()}
    return td.model_from_dict(
        {
            "title": "jump",
            "needs": ["air"],
            "nodes": {
                "fast": {"capacitance": f"{capacitance!r} [J/K]"},
                "mid": {} if massless else {"capacitance": "1e-6 [J/K]"},
                "slow": {"capacitance": "300.0 [J/K]"},
            },
            "surfaces": {"skin": {"of": "fast", "to": "air", "area": "0.09 [m^2]", "htc": "14.7 [W/(m^2 K)]"}},
            "conductors": conductors,
        }
    )


def _scenario(duration: float = SPAN) -> td.Scenario:
    return td.Scenario("jump", boundaries={"air": JUMP}, start="258.0 [K]", initial={"slow": "270.0 [K]"}, duration=duration)


def _sides(model: td.Model, options: td.Options = STEPS) -> tuple[np.ndarray, np.ndarray]:
    """Temperatures (fast, mid, slow) just before the jump and just after, by runs whose outputs lie a millisecond off it."""
    found = td.simulate(model, _scenario(), times=[2100.0 - 1e-3, 2100.0 + 1e-3], options=options)
    before, after = np.column_stack([found[n].kelvin for n in ("fast", "mid", "slow")])
    return before, after


@pytest.mark.parametrize("duration", [SPAN, 2100.0], ids=["within", "at_the_end"])
@pytest.mark.parametrize("capacitance", [20.0, 0.5])
@pytest.mark.parametrize("link", LINKS)
@pytest.mark.parametrize("method", ["integrator", "modal", "TR-BDF2"])
def test_what_has_a_capacitance_has_not_moved_what_has_none_has(method: str, link: str, capacitance: float, duration: float) -> None:
    if method == "modal" and link == "curved":
        pytest.skip("no modes")
    model = _model(link, capacitance)
    options = replace(STEPS, method=method, error=2e-4)
    found = td.simulate(model, _scenario(duration), times=TIMES[: ON + 1], options=options)
    before, after = _sides(model)
    fast, mid, slow = (found[n].kelvin[-1] for n in ("fast", "mid", "slow"))
    # a millisecond moves the fast node by 3 K x 1.4 W/K x 1 ms / C; mid takes a third of that
    within = 3.0 * 1.4e-3 / capacitance + 3e-3
    assert before[1] - after[1] > 0.9  # the jump itself, as mid sees it
    ends = duration < SPAN  # a run that ends on the jump has not seen it
    assert (fast, mid, slow) == pytest.approx((before[0], before[1] if ends else after[1], before[2]), abs=within)
    assert found["air"].kelvin[-1] == (258.0 if ends else 255.0)


def test_a_capacitance_however_small_has_not_moved() -> None:
    """A node of 1e-6 J/K in place of none: far faster than any step, and still where it was. At the start it is where it was put."""
    none, tiny = (
        td.simulate(_model("curved", 20.0, massless), _scenario(), times=TIMES, options=STEPS)["mid"].kelvin for massless in (True, False)
    )
    assert none[ON - 1] == pytest.approx(tiny[ON - 1], abs=1e-6)
    assert tiny[ON] - none[ON] > 0.9
    np.testing.assert_allclose(np.delete(none, (0, ON)), np.delete(tiny, (0, ON)), rtol=0, atol=1e-6)


@pytest.mark.parametrize("capacitance", [20.0, 0.5])
@pytest.mark.parametrize("link", LINKS)
def test_sensitivities_stand_on_the_same_side(link: str, capacitance: float) -> None:
    freed = ("skin.htc", "fast.capacitance", "initial.slow")
    ready = td.prepare(_model(link, capacitance), _scenario(), freed, times=TIMES, options=STEPS)
    values = {"skin.htc": 14.7, "fast.capacitance": capacitance, "initial.slow": 270.0}
    found = ready.run(ready.with_units(values), sensitivities=True)
    for name, value in values.items():
        step = 0.01 if name == "initial.slow" else 1e-3 * value  # smaller ones see the runs' own tolerance, 1e-10 K
        up, down = (ready.run(ready.with_units({**values, name: value + sign * step})) for sign in (1, -1))
        for node in ("fast", "mid", "slow"):
            expected = (up[node].kelvin - down[node].kelvin) / (2.0 * step)
            np.testing.assert_allclose(found.sensitivity(node, name), expected, rtol=0, atol=1e-6 * (1.0 + np.abs(expected).max()))


@pytest.mark.parametrize("link", LINKS)
def test_members_of_ensembles_show_what_single_runs_show(link: str) -> None:
    draws = {"fast.capacitance": np.array([20.0, 15.0, 25.0, 0.01]), "initial.fast": np.full(4, 258.0)}
    ready = td.prepare(_model(link, 20.0), _scenario(), tuple(draws), times=TIMES, options=TIGHTER)
    found = ready.ensemble(ready.with_units(draws))
    for k in range(4):
        single: Any = ready.run(ready.with_units({name: float(v[k]) for name, v in draws.items()}))
        for node in found.nodes:
            np.testing.assert_allclose(found.trace(k, node).kelvin, single[node].kelvin, rtol=0, atol=2e-7)


@pytest.mark.parametrize("capacitance", [1e-4, 3e-3, 8e-3, 0.03, 0.3])
def test_a_fast_node_that_has_not_settled_spoils_no_output_of_its_neighbours(capacitance: float) -> None:
    """After a jump of power a node between heavy ones starts to follow them; within a step of thousands of its time constants."""
    ends = {"a": ("hub", "tiny", 2.93), "b": ("tiny", "plate", 0.1), "c": ("plate", "hub", 0.7), "d": ("plate", "air", 0.2)}
    model = td.model_from_dict(
        {
            "title": "unsettled",
            "needs": ["air"],
            "nodes": {n: {"capacitance": f"{c!r} [J/K]"} for n, c in {"hub": 50.0, "tiny": capacitance, "plate": 80.0}.items()},
            "conductors": {k: {"kind": "conduction", "between": [a, b], "conductance": f"{g} [W/K]"} for k, (a, b, g) in ends.items()},
            "loads": {"heater": {"into": "hub", "power": "3.0 [W]"}},
        }
    )
    command = {"times": ["0.0 [s]", "900.0 [s]", "1500.5 [s]"], "values": [0.5, 1.0, 0.0], "hold": True}
    scenario = td.Scenario("on", boundaries={"air": "255 [K]"}, start="255 [K]", duration=1000.0, commands={"heater": command})
    times = np.linspace(890.0, 1000.0, 500)
    steps, modes = (td.simulate(model, scenario, times=times, options=td.Options(error=4e-6, method=m)) for m in ("integrator", "modal"))
    np.testing.assert_allclose(steps.temperatures, modes.temperatures, rtol=0, atol=5e-6)
