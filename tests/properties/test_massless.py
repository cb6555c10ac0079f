"""Property 8: a node whose capacitance tends to zero tends to the massless node, eliminated or solved with the states."""

from __future__ import annotations

import numpy as np
import pytest

import thermid as td
from strategies import DURATION, LINEAR, LOADS, TIGHTER, WITHOUT_KNEES, Case, Deck, build, cases, random_models

TIMES = np.linspace(0.0, DURATION, 37)[1:]
ENDS = (410.0, 1510.0, DURATION)
FLOOR = 1e-6  # what the iteration of a step leaves over in a very fast node, in kelvin


def _with_capacitance(deck: Deck, joules: float | None) -> Deck:
    """Return the deck with its last node massless, or of a tiny capacitance."""
    last = list(deck["nodes"])[-1]
    return {
        **deck,
        "nodes": {**deck["nodes"], last: {"stands_for": "walls"} | ({} if joules is None else {"capacitance": f"{joules!r} [J/K]"})},
    }


def _steps(case: Case) -> np.ndarray:
    """Return the times at which something jumps; a node with some capacitance needs a moment there."""
    found = []
    for signal in case.scenario["boundaries"].values():
        if isinstance(signal, dict) and signal.get("hold"):
            found += [float(t.split()[0]) for t in signal["times"]]
    return np.array(found)


def _ends(deck: Deck, case: Case) -> np.ndarray:
    """Return the temperatures (ends, nodes) at the ends of three runs, where a step ends as well."""
    model = build(deck)
    return np.array([td.simulate(model, case.run(duration=end), times=[end], options=TIGHTER).temperatures[0] for end in ENDS])


def _check(case: Case) -> None:
    limit = _ends(_with_capacitance(case.deck, None), case)
    away = np.array([all(not 0 <= t - s < 30 for s in _steps(case)) for t in ENDS])
    differences = [float(np.abs(_ends(_with_capacitance(case.deck, joules), case) - limit)[away].max()) for joules in (1e-2, 1e-5)]
    # the lag of 0.01 J/K behind its neighbours, and a thousandth of it
    assert differences[0] < 1.0
    assert differences[1] < 1.5e-3 * differences[0] + FLOOR


@random_models(
    40, case=cases(kinds=LINEAR, loads=("constant", "polynomial"), nodes=5, flat=True).filter(lambda c: len(c.deck["nodes"]) > 1)
)
def test_linear_limit(case: Case) -> None:
    _check(_quiet_last(case))


@random_models(
    40,
    case=cases(
        kinds=tuple(k for k in WITHOUT_KNEES if k != "flow"),
        loads=tuple(k for k in LOADS if k not in ("periodic", "sine", "proportional")),
        nodes=5,
        flat=True,
    ).filter(lambda c: len(c.deck["nodes"]) > 1),
)
def test_nonlinear_limit(case: Case) -> None:
    """Without natural convection, whose conductance vanishes with the difference, so that a lag is not proportional to what is stored."""
    _check(_quiet_last(case))


def _quiet_last(case: Case) -> Case:
    """Return the case without an initial temperature of the last node and without commands: they would be jumps of their own.

    Sines become their means, and only ends of steps are read: how a very fast node follows between them is the last test here.
    """
    last = list(case.deck["nodes"])[-1]
    scenario = {k: v for k, v in case.scenario.items() if k != "commands"}
    still = {n: v["mean"] if isinstance(v, dict) and "mean" in v else v for n, v in scenario["boundaries"].items()}
    return Case(case.deck, {**scenario, "boundaries": still, "initial": {n: v for n, v in scenario["initial"].items() if n != last}})


@pytest.mark.properties
@pytest.mark.parametrize(
    ("joules", "bound"),
    [
        (1e-6, 1e-5),
        (1e-4, 1e-5),
        (1e-3, 1e-5),
        (1e-2, 1e-5),
    ],
)
def test_a_very_fast_node_follows_a_sine_at_the_default_tolerance(joules: float, bound: float) -> None:
    """0.07 W/K and 1e-6 J/K settle in 14 us: it is the mean of its neighbours, as a massless node."""
    links = {"a": ("n", "still", 0.05), "b": ("n", "moving", 0.02)}
    deck = {
        "title": "Foil",
        "needs": ["still", "moving"],
        "nodes": {"n": {"capacitance": f"{joules!r} [J/K]"}},
        "conductors": {k: {"kind": "conduction", "between": [a, b], "conductance": f"{g} [W/K]"} for k, (a, b, g) in links.items()},
    }
    moving = {"mean": "255 [K]", "amplitude": "1 [K]", "period": "900 [s]"}
    scenario = td.Scenario("sine", boundaries={"still": "255 [K]", "moving": moving}, start="255 [K]", duration=DURATION)
    found = td.simulate(td.model_from_dict(deck), scenario, times=TIMES)["n"].kelvin
    w, tau = 2 * np.pi / 900, joules / 0.07
    exact = 255 + 2 / 7 * (np.sin(w * TIMES) - w * tau * np.cos(w * TIMES)) / (1 + (w * tau) ** 2)
    assert np.abs(found - exact).max() < bound
