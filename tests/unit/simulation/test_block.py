"""Blocks run: against the small integrator, in order, in heat, and what is stored of them."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.model.tree import TableSignal

from .large_cases import NODES, warm_block, warming_room

METHODS = ("RKC2", "TR-BDF2")
TIMES = np.array([60.0, 600.0, 3600.0])


@pytest.fixture(scope="module")
def exact() -> np.ndarray[Any, Any]:
    """The block as a model by the small integrator (times, cells). [K]"""
    run = td.simulate(warm_block().model(), warming_room(), times=TIMES)
    assert run.statistics["method"] not in METHODS
    return np.column_stack([run[n].kelvin for n in NODES])


@pytest.mark.parametrize("method", METHODS)
def test_a_block_equals_its_model_by_the_small_integrator(exact: np.ndarray[Any, Any], method: str) -> None:
    run = td.simulate(warm_block(), warming_room(), fields=TIMES, options=td.Options(error=2e-4, method=method))
    np.testing.assert_allclose(run.fields.reshape(3, -1), exact, atol=1e-4)


@pytest.mark.parametrize("method", METHODS)
def test_a_block_equals_its_model_by_the_same_method(method: str) -> None:
    options = td.Options(error=2e-4, method=method)
    run = td.simulate(warm_block(), warming_room(), fields=TIMES, options=options)
    model = td.simulate(warm_block().model(), warming_room(), times=TIMES, options=options)
    np.testing.assert_allclose(run.fields.reshape(3, -1), np.column_stack([model[n].kelvin for n in NODES]), atol=2e-5)


@pytest.mark.parametrize("method", METHODS)
def test_the_default_tolerance_keeps_a_few_millikelvin(exact: np.ndarray[Any, Any], method: str) -> None:
    run = td.simulate(warm_block(), warming_room(), fields=TIMES, options=td.Options(method=method))
    assert np.abs(run.fields.reshape(3, -1) - exact).max() < 5e-3


@pytest.mark.parametrize("method", METHODS)
def test_errors_fall_with_the_square_of_the_step(method: str) -> None:
    block = td.Block(("60 [mm]", "50 [mm]", "40 [mm]"), (6, 5, 4), "15 [W/(m K)]", "3900 [kg/m^3]", "1000 [J/(kg K)]")
    block = block.exchanging("all", "air", htc="200 [W/(m^2 K)]")
    air = {"mean": "295 [K]", "amplitude": "5 [K]", "period": "1 [h]"}
    scenario = td.Scenario(boundaries={"air": air}, start="290 [K]", duration="1 [h]")

    def at_end(tolerance: float, step: float = np.inf) -> np.ndarray[Any, Any]:
        return td.simulate(block, scenario, options=td.Options(method=method, error=tolerance, max_step=step)).final_field

    fine = at_end(1e-9)
    coarse, half = (float(np.abs(at_end(1e6, step) - fine).max()) for step in (20.0, 10.0))
    assert 3.6 < coarse / half < 4.4


@pytest.mark.parametrize(("method", "limit"), [("RKC2", 1e-12), ("TR-BDF2", 1e-7)])
def test_heat_is_kept(method: str, limit: float) -> None:
    balance = td.simulate(warm_block(), warming_room(), options=td.Options(method=method)).heat_balance()
    assert balance.loads == pytest.approx(5 * 3600)
    assert abs(balance.relative) < limit
    assert balance.loads - balance.boundaries - balance.stored == pytest.approx(balance.residual, abs=1e-9)


def test_stored_heat_is_that_of_the_field() -> None:
    run = td.simulate(warm_block(), warming_room())
    capacity = warm_block().capacities().reshape(run.final_field.shape)
    assert run.heat_balance().stored == pytest.approx(float((capacity * (run.final_field - 290.0)).sum()))


def test_runs_repeat_bit_for_bit() -> None:
    first, second = (td.simulate(warm_block(), warming_room()).final_field for _ in range(2))
    assert np.array_equal(first, second)


def noisy_room() -> td.Scenario:
    rng = np.random.default_rng(3)
    times = np.arange(3601.0)
    return td.Scenario(
        "noisy", boundaries={"air": TableSignal(times, 295.0 + 2.0 * rng.standard_normal(times.size))}, start="290 [K]", duration=3600.0
    )


def jumping_heat() -> td.Scenario:
    power = TableSignal(np.array([0.0, 900.0, 1000.0, 2500.0]), np.array([0.0, 8.0, 0.0, 3.0]), hold=True)
    return td.Scenario("jumps", boundaries={"air": "295 [K]"}, loads={"heater": power}, start="290 [K]", duration=3600.0)


def one_heated_cell() -> td.Block:
    block = td.Block(("30 [mm]", "30 [mm]", "20 [mm]"), (3, 3, 2), "15 [W/(m K)]", "3900 [kg/m^3]", "1000 [J/(kg K)]")
    return block.exchanging("all", "air", htc="8 [W/(m^2 K)]").heated("heater", "1 [W]", cells=np.s_[1:2, 1:2, :1])


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("scenario", [noisy_room(), jumping_heat()], ids=["noisy", "jumps"])
def test_inputs_that_are_not_smooth(scenario: td.Scenario, method: str) -> None:
    times = np.linspace(0.0, 3600.0, 61)
    renamed = td.Scenario(
        scenario.title,
        boundaries=scenario.boundaries,
        loads={f"{n}_c1_1_0": power for n, power in scenario.loads.items()},
        start=scenario.start,
        duration=scenario.duration,
    )
    model = td.simulate(one_heated_cell().model(), renamed, times=times)
    run = td.simulate(
        one_heated_cell(),
        scenario,
        times=times,
        watch=("cell[1,1,0]", "cell[0,0,1]"),
        options=td.Options(error=2e-4, method=method),
    )
    for cell, node in (("cell[1,1,0]", "c1_1_0"), ("cell[0,0,1]", "c0_0_1")):
        np.testing.assert_allclose(run[cell].kelvin, model[node].kelvin, atol=3e-4)


def test_what_is_watched() -> None:
    run = td.simulate(
        warm_block(),
        warming_room(),
        times=[0.0, 1800.0, 3600.0],
        watch=("mean", "hottest", "coldest", "+x", "heater", "cell[2,2,2]"),
        fields=[1800.0],
    )
    field = run.field(1800.0)
    assert run.nodes == ("mean", "hottest", "coldest", "+x", "heater", "cell[2,2,2]", "air")
    expected = [field.mean(), field.max(), field.min(), field[-1].mean(), field[1:3, 1:3, 1:3].mean(), field[2, 2, 2], 295.0]
    np.testing.assert_allclose(run.temperatures[1], expected, rtol=1e-12)
    np.testing.assert_allclose(run.temperatures[0, :-1], 290.0)
    np.testing.assert_allclose(run["hottest"].kelvin[2], run.final_field.max())
    np.testing.assert_allclose(run.load_powers["heater"], 5.0)


def test_the_end_of_a_run_as_text() -> None:
    lines = str(td.simulate(warm_block(), warming_room())).splitlines()
    assert lines[0] == "block, room: 1 h, ok"
    assert [line.split()[0] for line in lines[1:]] == ["mean", "hottest", "coldest", "heater", "air"]


def test_a_block_that_nothing_holds_says_so() -> None:
    block = td.Block(("10 [mm]",) * 3, (2, 2, 2), "15 [W/(m K)]", "4000 [kg/m^3]", "500 [J/(kg K)]").heated(
        "h", "2 [W]", cells=np.s_[:, :, :]
    )
    run = td.simulate(block, td.Scenario(start="300 [K]", duration="10 [s]"))
    assert run["mean"].rise == pytest.approx(2.0 * 10.0 / 2.0)
    assert len(run.warnings) == 1


def test_commands_and_loads_of_the_scenario_drive_heaters() -> None:
    half = warming_room().with_(commands={"heater": 0.5})
    assert td.simulate(warm_block(), half).heat_balance().loads == pytest.approx(2.5 * 3600)
    assert td.simulate(warm_block(), warming_room().with_(loads={"heater": "7 [W]"})).heat_balance().loads == pytest.approx(7 * 3600)


def test_a_steady_start_stays() -> None:
    still = td.Scenario("still", boundaries={"air": "295 [K]"}, start="steady", duration="1 [h]")
    run = td.simulate(warm_block(), still, fields=[0.0, 3600.0])
    np.testing.assert_allclose(run.fields[1], run.fields[0], atol=2e-4)
    np.testing.assert_allclose(run.fields[0], td.steady(warm_block(), still).final_field)


@pytest.mark.parametrize(
    ("changes", "options", "code", "match"),
    [
        ({"boundaries": {"room": "290 [K]"}}, {}, "name.unknown", "'room'"),
        ({"loads": {"heating": "1 [W]"}}, {}, "name.unknown", "'heating'.*'heater'"),
        ({"schedule": {"x": 1.0}}, {}, "value.without-effect", "'schedule'"),
        ({"start": "steady", "initial": {"cell[0,0,0]": "300 [K]"}}, {}, "value.excludes-another", ""),
        ({}, {"options": td.Options(method="Euler")}, "name.unknown", "'Euler' .* auto, large, RKC2, TR-BDF2"),
        ({}, {"watch": ("centre",)}, "name.unknown", "'centre'"),
        ({}, {"fields": [7200.0]}, "value.outside-range", ""),
        ({}, {"options": td.Options(max_steps=3)}, "run.did-not-finish", "3"),
        ({"start": "1e7 [K]"}, {}, "run.did-not-finish", "0"),
        ({"loads": {"heater": "-1 [MW]"}}, {}, "run.did-not-finish", "0"),
    ],
)
def test_what_a_block_cannot_do_is_said(changes: dict[str, Any], options: dict[str, Any], code: str, match: str) -> None:
    with raises_code(code, td.ThermidError, match=match):
        td.simulate(warm_block(), warming_room().with_(**changes), **options)


def test_what_was_not_stored_is_said() -> None:
    run = td.simulate(warm_block(), warming_room())
    for ask in (lambda: run["cell[0,0,0]"], lambda: run.field(10.0)):
        with raises_code("name.unknown"):
            ask()
    for refused in (lambda: run.heat_flows, lambda: run.heat_flow("x"), lambda: run.time_constants, lambda: run.sensitivity("a", "b")):
        with pytest.raises(td.ThermidError) as caught:
            refused()
        assert caught.value.code in ("model.element-not-supported", "value.without-effect", "name.unknown")


def test_watch_and_fields_belong_to_blocks() -> None:
    with raises_code("value.without-effect"):
        td.simulate(warm_block().model(), warming_room(), fields=[1.0])  # type: ignore[call-overload]


def big_block(cells: int) -> td.Block:
    block = td.Block(("0.2 [m]",) * 3, (cells,) * 3, "15 [W/(m K)]", "3900 [kg/m^3]", "1000 [J/(kg K)]")
    return block.exchanging("all", "air", htc="5 [W/(m^2 K)]", emissivity=0.8).heated("heater", "100 [W]", cells=np.s_[:3, :3, :3])


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no interval timer here")
def test_an_interrupted_run_leaves_the_interpreter_usable() -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, interrupt)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.5)
        with pytest.raises(KeyboardInterrupt):
            td.simulate(big_block(60), warming_room(), options=td.Options(error=4e-7, max_step=0.5))
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    assert td.simulate(warm_block(), warming_room())["mean"].rise > 0


def test_memory_grows_by_few_numbers_a_cell() -> None:
    pytest.importorskip("resource")
    code = (
        "import resource, sys, numpy as np, thermid as td\n"
        "n = int(sys.argv[1])\n"
        "b = td.Block(('0.2 [m]',) * 3, (n, n, n), '15 [W/(m K)]', '3900 [kg/m^3]', '1000 [J/(kg K)]')\n"
        "b = b.exchanging('all', 'air', htc='5 [W/(m^2 K)]')\n"
        "td.simulate(b, td.Scenario(boundaries={'air': '300 [K]'}, start='290 [K]', duration=600.0))\n"
        "print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)\n"
    )

    # Under the sanitizers what is freed stays in a quarantine of up to 256 MB, which would be counted as well.
    env = dict(os.environ) | {"ASAN_OPTIONS": os.environ.get("ASAN_OPTIONS", "") + ":quarantine_size_mb=1"}

    def peak(cells: int) -> float:
        done = subprocess.run([sys.executable, "-c", code, str(cells)], capture_output=True, text=True, check=True, env=env)
        return float(done.stdout) * (1 if sys.platform == "darwin" else 1024)

    assert (peak(47) - peak(5)) / 47**3 < 500  # [bytes]: 1.5 GB at 1e6 would be 1500


def test_a_solution_of_a_block_knows_its_names() -> None:
    """What is watched, and boundaries, are in it; anything else is not."""
    block = td.Block((0.01, 0.01, 0.01), (2, 2, 2), 100.0, 2700.0, 900.0).held("-z", "room")
    solution = td.simulate(block, td.Scenario(boundaries={"room": "300 [K]"}, start="310 [K]", duration=1.0), watch=["mean"])
    assert "mean" in solution
    assert "room" in solution
    assert "lid" not in solution
    assert (solution.shares, solution.modes) == ({}, {})
    with pytest.raises(td.errors.NameNotFoundError):
        solution.slopes("mean")
