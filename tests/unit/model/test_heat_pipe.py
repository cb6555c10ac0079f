"""A conductance that switches at a free temperature: a table of a kind whose points follow values, with derivatives."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import thermid as td
from thermid.model._parts.elements import HINGES, Law
from thermid.simulation.runs import conductance

FREE = ("pipe.start_temperature", "pipe.on_conductance", "pipe.off_conductance", "pipe.transition")
DECK: dict[str, Any] = {
    "title": "pipe",
    "needs": ["sink"],
    "nodes": {"source": {"capacitance": "400 [J/K]"}, "end": {"capacitance": "150 [J/K]"}},
    "conductors": {
        "pipe": {
            "kind": "heat_pipe",
            "between": ["source", "end"],
            "on_conductance": {"value": "5 [W/K]", "min": 1, "max": 20},
            "off_conductance": {"value": "0.2 [W/K]", "min": 0.02, "max": 2},
            "start_temperature": {"value": "30 [degC]", "min": 5, "max": 60},
            "transition": "4 [K]",
        },
        "out": {"kind": "conduction", "between": ["end", "sink"], "conductance": "0.8 [W/K]"},
    },
    "loads": {"heat": {"into": "source", "power": "20 [W]"}},
}
WARM = td.Scenario("warm", boundaries={"sink": "15 [degC]"}, start="15 [degC]", duration="1 [h]")
TIGHT = td.Options(error=8e-9)


def model(**values: str) -> td.Model:
    return td.model_from_dict(DECK).with_values({f"pipe.{k}": v for k, v in values.items()})


def test_a_run_is_that_of_another_integrator() -> None:
    def change(_: float, t: np.ndarray) -> list[float]:
        mean = 0.5 * (t[0] + t[1]) - 273.15
        q = (0.2 + 4.8 * min(max((mean - 28.0) / 4.0, 0.0), 1.0)) * (t[0] - t[1])
        return [(20.0 - q) / 400.0, (q - 0.8 * (t[1] - 288.15)) / 150.0]

    times = np.linspace(0.0, 3600.0, 61)
    truth = solve_ivp(change, (0.0, 3600.0), [288.15, 288.15], t_eval=times, max_step=2.0, rtol=1e-10, atol=1e-10).y
    run = td.simulate(model(), WARM, times=times)
    for k, node in enumerate(("source", "end")):
        assert np.abs(run[node].kelvin - truth[k]).max() < 1e-4  # a kink is rounded over 1 mK
    assert float(run.heat_flows["pipe"][-1]) == pytest.approx(0.8 * (run["end"].final - 15.0), abs=0.05)
    assert run.heat_balance().relative < 1e-9
    assert td.steady(model(), WARM)["source"] == pytest.approx(273.15 + 15.0 + 20.0 / 0.8 + 20.0 / 5.0, abs=1e-6)


def test_members_are_single_runs() -> None:
    """Tables were kept as structure: three members with three temperatures were one and the same."""
    drawn = {
        "pipe.start_temperature": td.celsius([20.0, 30.0, 36.0, 60.0]),
        "pipe.on_conductance": np.array([4.0, 5.0, 6.0, 5.0]),
        "pipe.off_conductance": np.array([0.2, 0.1, 0.3, 0.2]),
        "pipe.transition": np.array([4.0, 2.0, 6.0, 1.0]),
    }
    found = td.ensemble(model(), WARM, drawn, every=300.0, options=td.Options(error=4e-9))
    assert found.statistics["one_by_one"] == 0
    units = {"start_temperature": "K", "transition": "K"}
    for k in range(4):
        given = {p.removeprefix("pipe."): f"{float(v[k])!r} [{units.get(p.removeprefix('pipe.'), 'W/K')}]" for p, v in drawn.items()}
        alone = td.simulate(model(**given), WARM, every=300.0, options=td.Options(error=4e-9))
        for node in ("source", "end"):
            assert found.temperatures(node)[:, k] == pytest.approx(alone[node].kelvin, rel=1e-9)
    assert np.ptp(found.temperatures("source")[-1]) > 5.0


def test_derivatives_are_those_of_differences() -> None:
    ready = td.prepare(model(), WARM, FREE, every=300.0, options=TIGHT)
    run = ready.run(sensitivities=True)
    for name, step in zip(FREE, (0.01, 1e-3, 1e-3, 0.01), strict=True):
        at = ready.nominal[name]
        high, low = (ready.run(ready.with_units({name: at + s * step})) for s in (1.0, -1.0))
        for node in ("source", "end"):
            quotient = (high[node].kelvin - low[node].kelvin) / (2.0 * step)
            assert run.sensitivity(node, name) == pytest.approx(quotient, abs=3e-4 * np.abs(quotient).max()), (node, name)


@pytest.mark.parametrize("seed", [1, 2, pytest.param(3, marks=pytest.mark.campaign), pytest.param(4, marks=pytest.mark.campaign)])
def test_a_fit_finds_the_temperature_and_both_conductances(seed: int) -> None:
    times = np.linspace(0.0, 3600.0, 121)
    run = td.simulate(model(), WARM, times=times)
    rng = np.random.default_rng(seed)
    channels = {
        name: td.Channel.from_array(
            name, run[node].kelvin + 0.05 * rng.standard_normal(times.size), unit="K", role="node", target=node, noise=0.05
        )
        for name, node in (("T1", "source"), ("T2", "end"))
    }
    start = model(start_temperature="33 [degC]", on_conductance="3 [W/K]", off_conductance="0.35 [W/K]")
    fit = td.calibrate(start, td.Record.from_arrays("bench", times, channels), FREE[:3], scenario=WARM)
    for path, truth in zip(FREE[:3], (303.15, 5.0, 0.2), strict=True):
        assert abs(fit[path].value - truth) < 3.0 * fit[path].error, path
        assert fit[path].error < 0.05 * truth


def test_a_table_over_the_difference_and_its_ends() -> None:
    """Of four points, one of them steep: values between and beyond them, as straight lines have them."""
    x, y = np.array([-5.0, 0.0, 1.0, 8.0]), np.array([2.0, 1.0, 4.0, 3.0])
    law = Law("table", (2.0,), points=tuple(zip(x.tolist(), y.tolist(), strict=True)), over="difference")
    apart = np.array([-9.0, -5.0, -2.5, 0.5, 0.75, 4.0, 8.5, 40.0])
    found = sum(conductance(p.form, p.coefficients, None, 300.0 + apart, np.full(apart.size, 300.0)) for p in law.pieces())
    assert found == pytest.approx(2.0 * np.interp(apart, x, y), abs=2e-3)
    assert [p.form for p in law.pieces()][1:] == [HINGES["difference"]] * 4


def test_a_large_network_takes_it() -> None:
    small, large = (td.simulate(model(), WARM, every=600.0, options=td.Options(method=m)) for m in ("integrator", "TR-BDF2"))
    assert np.abs(small["source"].kelvin - large["source"].kelvin).max() < 0.05
