"""A proportional heater's power has a knee at either end of its band; steps find them: docs/design/kernel.md."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import thermid as td

C, G, AIR, START, FULL = 380.0, 0.55, 339.0, 271.5, 4.5
TIMES = np.linspace(0.0, 3600.0, 25)
VALUES = {"n.capacitance": C, "skin.conductance": G, "heater.proportional.gain": 0.3}


def _model() -> td.Model:
    heater = {"into": "n", "power": f"{FULL} [W]", "proportional": {"gain": "0.3 [W/K]", "setpoint": "310 [K]"}}
    skin = {"kind": "conduction", "between": ["air", "n"], "conductance": f"{G} [W/K]"}
    nodes = {"n": {"capacitance": f"{C} [J/K]"}}
    return td.model_from_dict(
        {"title": "knee", "needs": ["air"], "nodes": nodes, "conductors": {"skin": skin}, "loads": {"heater": heater}}
    )


def _exact(c: float = C, g: float = G, gain: float = 0.3, setpoint: float = 310.0) -> np.ndarray:
    """Three exponentials, joined where the heater leaves full power and where it goes out."""
    settled = [AIR + FULL / g, (g * AIR + gain * setpoint) / (g + gain), AIR]
    rates, out, t, start = [g / c, (g + gain) / c, g / c], np.empty_like(TIMES), 0.0, START
    for end, rate, level in zip(settled, rates, [setpoint - FULL / gain, setpoint, np.inf], strict=True):
        stretch = t <= TIMES
        out[stretch] = end + (start - end) * np.exp(-rate * (TIMES[stretch] - t))
        if np.isfinite(level):
            t, start = t + np.log((start - end) / (level - end)) / rate, level
    return out


def _ready(free: tuple[str, ...], options: td.Options) -> Any:
    return td.prepare(
        _model(),
        td.Scenario("warm", boundaries={"air": f"{AIR} [K]"}, start=f"{START} [K]", duration=3600.0),
        free,
        times=TIMES,
        options=options,
    )


@pytest.mark.parametrize("tolerance", [2e-7, 1e-10])
def test_a_knee_costs_no_accuracy(tolerance: float) -> None:
    options = td.Options(error=4.0 * tolerance)
    found = _ready((), options).run()
    np.testing.assert_allclose(found["n"].kelvin, _exact(), rtol=0, atol=10.0 * tolerance)
    assert found.statistics["steps"] < (100 if tolerance > 1e-8 else 600)


@pytest.mark.parametrize("tolerance", [2e-7, 1e-10])
def test_nor_members_of_ensembles_any(tolerance: float) -> None:
    share = 1.0 + 0.1 * np.arange(-4.0, 5.0)
    draws = {"n.capacitance": C * share, "skin.conductance": np.full(9, G), "heater.proportional.gain": 0.3 / share}
    found = _ready(tuple(draws), td.Options(error=4.0 * tolerance)).ensemble(draws)
    assert found.statistics["one_by_one"] == 0
    for k in range(9):
        expected = _exact(C * share[k], G, 0.3 / share[k])
        np.testing.assert_allclose(found.trace(k, "n").kelvin, expected, rtol=0, atol=10.0 * tolerance)


def test_sensitivities_pass_it_too() -> None:
    found = _ready(tuple(VALUES), td.Options(error=4e-6)).run(VALUES, sensitivities=True)
    for k, (name, value) in enumerate(VALUES.items()):
        up, down = ([v * (1.0 + sign * 1e-5 * (j == k)) for j, v in enumerate(VALUES.values())] for sign in (1, -1))
        per_log = (_exact(*up) - _exact(*down)) / 2e-5
        np.testing.assert_allclose(
            value * found.sensitivity("n", name), per_log, rtol=0, atol=2e-4
        )  # of 22 K; 0.025 before knees were found


def test_a_knee_just_before_a_step_must_end_is_passed() -> None:
    """A step up to just before the knee was lengthened to where the run had to stop, refused again, and so on for a million times."""
    leaves_full_power = np.log((START - AIR - FULL / G) / (295.0 - AIR - FULL / G)) * C / G
    for beyond in np.geomspace(0.003, 0.03, 9):
        seconds = leaves_full_power + beyond
        scenario = td.Scenario("short", boundaries={"air": f"{AIR} [K]"}, start=f"{START} [K]", duration=seconds)
        run = td.simulate(_model(), scenario, times=[0.0, seconds], options=td.Options(error=1e-6, max_steps=2000))
        assert run["n"].kelvin[-1] == pytest.approx(_exact()[0] + 295.0 - START, abs=0.08 * beyond + 1e-4)
