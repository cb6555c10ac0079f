"""Property 8: a node whose capacitance tends to zero tends to the massless node, eliminated or solved with the states."""

from __future__ import annotations

import numpy as np

import thermid as td
from strategies import DURATION, EVERY, LINEAR, LOADS, TIGHTER, Case, Deck, build, cases, random_models

TIMES = np.linspace(0.0, DURATION, 37)[1:]


def _with_capacitance(deck: Deck, joules: float | None) -> Deck:
    """Return the deck with its last node massless, or of a tiny capacitance."""
    last = list(deck["nodes"])[-1]
    return {**deck, "nodes": {**deck["nodes"], last: {} if joules is None else {"capacitance": f"{joules!r} [J/K]"}}}


def _steps(case: Case) -> np.ndarray:
    """Return the times at which something jumps; a node with some capacitance needs a moment there."""
    found = []
    for signal in case.scenario["boundaries"].values():
        if isinstance(signal, dict) and signal.get("hold"):
            found += [float(t.split()[0]) for t in signal["times"]]
    return np.array(found)


def _check(case: Case) -> None:
    limit = td.simulate(build(_with_capacitance(case.deck, None)), case.run(), times=TIMES, options=TIGHTER)
    away = np.array([all(not 0 <= t - s < 30 for s in _steps(case)) for t in TIMES])
    differences = []
    for joules in (1e-2, 1e-5):
        near = td.simulate(build(_with_capacitance(case.deck, joules)), case.run(), times=TIMES, options=TIGHTER)
        differences.append(float(np.abs(near.temperatures - limit.temperatures)[away].max()))
    # heat stored in 0.01 J/K at some kelvins per second through a hundredth of a watt per kelvin, and a thousandth of it
    assert differences[0] < 0.05
    assert differences[1] < max(1.5e-3 * differences[0], 1e-7)


@random_models(
    40, case=cases(kinds=LINEAR, loads=("constant", "polynomial", "sine"), nodes=5, flat=True).filter(lambda c: len(c.deck["nodes"]) > 1)
)
def test_linear_limit(case: Case) -> None:
    _check(_quiet_last(case))


@random_models(
    40,
    case=cases(
        kinds=tuple(k for k in EVERY if k != "flow"),
        loads=tuple(k for k in LOADS if k not in ("periodic", "proportional")),
        nodes=5,
        flat=True,
    ).filter(lambda c: len(c.deck["nodes"]) > 1),
)
def test_nonlinear_limit(case: Case) -> None:
    _check(_quiet_last(case))


def _quiet_last(case: Case) -> Case:
    """Return the case without an initial temperature of the last node and without commands: they would be jumps of their own."""
    last = list(case.deck["nodes"])[-1]
    scenario = {k: v for k, v in case.scenario.items() if k != "commands"}
    return Case(case.deck, {**scenario, "initial": {n: v for n, v in scenario["initial"].items() if n != last}})
