"""Many members in one call: the same as one by one, whatever the threads and the instruction set, and failures kept apart."""

from __future__ import annotations

import subprocess
import sys
import textwrap
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid import _kernel
from thermid.base.errors import NameNotFoundError, ScenarioError, UnitError
from thermid.model.tree import TableSignal
from thermid.simulation._ensemble import assemble_members
from thermid.values.store import FittedValue, FittedValues

TIGHT = td.Options(error=8e-9)
DECK: dict[str, Any] = {
    "title": "unit",
    "needs": ["room"],
    "nodes": {"board": {"capacitance": "300 [J/K]"}, "case": {"capacitance": "900 [J/K]"}, "seam": {}},
    "parameters": {"area": "0.08 [m^2]"},
    "surfaces": {
        "skin": {
            "of": "case",
            "to": "room",
            "area": "area",
            "htc": {"coefficient": "1.6 [W/(m^2 K)]", "exponent": 0.3},
            "emissivity": {"value": 0.8, "max": 1.0},
        }
    },
    "conductors": {
        "left": {"kind": "conduction", "between": ["board", "seam"], "conductance": "2 [W/K]"},
        "right": {"kind": "conduction", "between": ["seam", "case"], "conductance": "3 [W/K]"},
    },
    "loads": {
        "chip": {"into": "board", "power": "6 [W]", "exponential_coefficient": "0.01 [1/K]", "reference_temperature": "300 [K]"},
        "fan": {"into": "case", "power": "1 [W]"},
    },
    "aliases": {"pcb": "board"},
}
MODEL = td.model_from_dict(DECK)
_GRID = np.arange(0.0, 5401.0)
_NOISE = np.random.default_rng(3).standard_normal(_GRID.size)
ROOM = td.Scenario(
    "room",
    boundaries={"room": TableSignal(_GRID, np.round((295.0 + np.sin(_GRID / 900.0) + 0.05 * _NOISE) * 16) / 16)},
    start="295 [K]",
    duration="1.5 [h]",
)
SPREADS: dict[str, Any] = {
    "left.conductance": {"log_sd": 0.3},
    "skin.htc.coefficient": "15 [%]",
    "skin.htc.exponent": {"low": 0.2, "high": 0.35},
    "board.capacitance": {"sd": "30 [J/K]"},
    "room": {"sd": "0.5 [K]"},
    "initial.board": {"low": "20 [degC]", "high": "30 [degC]"},
    "scale.chip": {"sd": 0.1},
}
DRAWS = td.simulation.draw(MODEL, ROOM, SPREADS, 21, seed=5)


def member(k: int, draws: Any = None) -> dict[str, float]:
    return {name: float(v[k]) for name, v in (draws or DRAWS).items()}


def far(one: td.simulation.Ensemble, other: td.simulation.Ensemble) -> float:
    return max(float(np.abs(one.temperatures(n) - other.temperatures(n)).max()) for n in one.nodes)


def test_members_are_the_runs_of_a_simulator() -> None:
    found = td.ensemble(MODEL, ROOM, DRAWS, every=60.0, options=TIGHT)
    single = td.prepare(MODEL, ROOM, tuple(DRAWS), every=60.0, options=TIGHT)
    assert found.statistics["one_by_one"] == 0
    assert found.nodes == ("board", "case", "seam", "room")
    for k in range(found.members):
        expected = single.run(single.with_units(member(k)))
        for node in found.nodes:
            assert np.abs(found.trace(k, node).kelvin - expected[node].kelvin).max() < 1e-6


def test_by_default_a_noisy_room_is_followed_to_3e_4_kelvin() -> None:
    found = td.ensemble(MODEL, ROOM, DRAWS, every=30.0)
    tight = td.ensemble(MODEL, ROOM, DRAWS, every=30.0, options=td.Options(error=8e-9, max_step=1.0))
    assert 1e-9 < far(found, tight) < 3e-4


def test_threads_and_chunks_change_no_bit() -> None:
    one, three = (td.ensemble(MODEL, ROOM, DRAWS, every=60.0, threads=n) for n in (1, 3))
    assert far(one, three) == 0.0
    assert far(one, td.ensemble(MODEL, ROOM, DRAWS, every=60.0)) == 0.0


@pytest.mark.parametrize("simd", _kernel.instruction_sets())
def test_instruction_sets_agree(simd: str) -> None:
    plain, wide = (td.ensemble(MODEL, ROOM, DRAWS, every=60.0, simd=s) for s in ("baseline", simd))
    assert wide.statistics["simd"] == simd
    assert far(plain, wide) < 1e-5


def test_an_unknown_instruction_set_is_refused() -> None:
    with raises_code("name.unknown", ScenarioError, match="'abacus'"):
        td.ensemble(MODEL, ROOM, DRAWS, simd="abacus")


def test_numbers_of_all_members_are_those_of_each() -> None:
    many = {**DRAWS, "area": np.linspace(0.05, 0.1, 21), "fan.power": np.linspace(0.0, 2.0, 21)}
    wiring = td.prepare(MODEL, ROOM, tuple(many)).wiring
    together = assemble_members(wiring, many, 21)
    assert not together.refused
    for k in range(21):
        alone = wiring.assemble(np.array(list(member(k, many).values())), False)
        assert np.array_equal(alone.coefficients, together.coefficients[:, k])
        assert np.array_equal(alone.initial, together.initial[:, k])


def test_members_without_a_network_fail_alone() -> None:
    conductance = np.full(12, 2.0)
    conductance[[3, 7]] = -1.0
    found = td.ensemble(MODEL, ROOM, {"left.conductance": conductance}, every=600.0)
    assert list(found.failed) == [3, 7]
    assert "'left.conductance' is -1 W/K" in found.failed[7]
    assert np.isnan(found.temperatures("seam")[:, 7]).all()
    others = td.ensemble(MODEL, ROOM, {"left.conductance": np.full(12, 2.0)}, every=600.0)
    assert np.abs(found.quantile("board", 0.5) - others.quantile("board", 0.5)).max() < 3e-4


@pytest.mark.parametrize("quantiles", [None, (0.5, 0.9)])
def test_a_member_that_runs_away_does_not_spoil_the_others(quantiles: Any) -> None:
    growth = np.full(20, 0.01)
    growth[11] = 0.5
    draws = {"chip.exponential_coefficient": growth, "scale.chip": np.linspace(0.9, 1.1, 20)}
    found = td.ensemble(MODEL, ROOM, draws, every=60.0, quantiles=quantiles)
    assert list(found.failed) == [11]
    assert "'board'" in found.failed[11]
    keep = np.delete(np.arange(20), 11)
    alone = td.ensemble(MODEL, ROOM, {n: v[keep] for n, v in draws.items()}, every=60.0)
    assert (np.abs(found.quantile("board", 0.9) - alone.quantile("board", 0.9)) < 3e-4 + found.quantile_error("board", 0.9)).all()
    assert np.abs(found.highest_quantile("board", 0.9) - alone.highest_quantile("board", 0.9)) < 3e-4 + 0.01 * alone.highest("board").std()
    if quantiles is None:
        assert np.isnan(found.highest("board")[11])


def test_when_all_fail_the_first_one_says_why() -> None:
    found = td.ensemble(MODEL, ROOM, {"left.conductance": np.full(3, -1.0)})
    with raises_code("run.members-failed", ScenarioError):
        found.mean("board")


def test_a_thermostat_is_run_one_by_one() -> None:
    deck = {
        **DECK,
        "loads": {"heater": {"into": "board", "power": "20 [W]", "thermostat": {"on_below": "40 [degC]", "off_above": "42 [degC]"}}},
    }
    model, powers = td.model_from_dict(deck), np.array([15.0, 20.0, 25.0])
    found = td.ensemble(model, ROOM, {"heater.power": powers}, every=60.0, threads=2)
    assert found.statistics["one_by_one"] == 3
    single = td.prepare(model, ROOM, ("heater.power",), every=60.0)
    for k, power in enumerate(powers.tolist()):
        assert np.array_equal(found.trace(k, "board").kelvin, single.run({"heater.power": power})["board"].kelvin)


def test_a_tiny_node_is_left_to_the_integrator() -> None:
    tiny = {"board.capacitance": np.array([300.0, 1e-6, 300.0])}
    found = td.ensemble(MODEL, ROOM, tiny, every=60.0)
    assert found.statistics["one_by_one"] == 1
    single = td.prepare(MODEL, ROOM, tuple(tiny), every=60.0)
    for k, c in enumerate(tiny["board.capacitance"].tolist()):
        assert np.abs(found.trace(k, "board").kelvin - single.run({"board.capacitance": c})["board"].kelvin).max() < 3e-4


def test_a_steady_start_is_each_members_own() -> None:
    warm = ROOM.with_(start="steady")
    draws = {"scale.chip": np.array([0.5, 1.0, 1.5])}
    found = td.ensemble(MODEL, warm, draws, every=600.0, options=TIGHT)
    single = td.prepare(MODEL, warm, tuple(draws), every=600.0, options=TIGHT)
    for k in range(3):
        assert np.abs(found.trace(k, "seam").kelvin - single.run(member(k, draws))["seam"].kelvin).max() < 1e-6


def test_a_schedule_holds_for_every_member() -> None:
    moved = ROOM.with_(schedule={"right.conductance": {"times": ["0 [s]", "1800 [s]"], "values": ["3 [W/K]", "1 [W/K]"], "hold": True}})
    draws = {"scale.chip": np.array([0.5, 1.0, 1.5]), "left.conductance": np.array([1.0, 2.0, 3.0])}
    found = td.ensemble(MODEL, moved, draws, every=60.0, options=TIGHT)
    single = td.prepare(MODEL, moved, tuple(draws), every=60.0, options=TIGHT)
    for k in range(3):
        assert np.abs(found.trace(k, "board").kelvin - single.run(member(k, draws))["board"].kelvin).max() < 1e-6


def test_statistics() -> None:
    found = td.ensemble(MODEL, ROOM, DRAWS, every=600.0)
    table = found.temperatures("pcb")
    assert table.shape == (10, 21)
    assert np.array_equal(found.quantile("board", [0.1, 0.9]), np.quantile(table, [0.1, 0.9], axis=1))
    assert found.mean("board") == pytest.approx(table.mean(axis=1))
    assert found.sd("board") == pytest.approx(table.std(axis=1, ddof=1))
    assert found.highest("board") == pytest.approx(table.max(axis=0) - 273.15)
    limit = float(np.median(table[-1])) - 273.15
    assert found.exceedance("board", td.celsius(limit))[-1] == 10 / 21
    assert str(found).startswith("unit, room: 21 members, 0 failed\n  board")


def test_kept_quantiles_are_those_of_the_traces_within_half_a_bin(monkeypatch: pytest.MonkeyPatch) -> None:
    from thermid.simulation import _ensemble as ensemble

    draws = td.simulation.draw(MODEL, ROOM, SPREADS, 84, seed=5)
    whole = td.ensemble(MODEL, ROOM, draws, every=60.0)
    monkeypatch.setattr(ensemble, "TRACE_BYTES_AT_ONCE", 0)  # 64 members together
    few = td.ensemble(MODEL, ROOM, draws, every=60.0, quantiles=(0.05, 0.5), nodes=["seam", "room"])
    assert few.nodes == ("seam", "room")
    for node in few.nodes:
        error = few.quantile_error(node, [0.5, 0.05])
        assert (np.abs(few.quantile(node, [0.5, 0.05]) - whole.quantile(node, [0.5, 0.05])) <= error + 1e-12).all()
        assert (error <= np.maximum(whole.sd(node) / 100.0, 2.0**-10)).all()
        assert few.mean(node) == pytest.approx(whole.mean(node), abs=2.0**-15)
        assert few.sd(node) == pytest.approx(whole.sd(node), rel=1e-5, abs=2.0**-14)
        for few_of, whole_of in ((few.highest_quantile, whole.highest_quantile), (few.lowest_quantile, whole.lowest_quantile)):
            assert few_of(node, 0.3) == pytest.approx(whole_of(node, 0.3), abs=max(0.005 * whole.highest(node).std(), 2.0**-10))
        assert not whole.quantile_error(node, 0.5).any()
    assert few.turnings("seam") is None
    worst = max(few.quantile_error(n, [0.5, 0.05]).max() for n in few.nodes)
    assert f"{1000.0 * worst:.2g} mK" in str(few)
    assert few.quantile("seam", 0.9) == pytest.approx(whole.quantile("seam", 0.9), abs=few.quantile_error("seam", 0.9).max())
    for refused in (few.highest, few.temperatures, lambda node: few.exceedance(node, td.celsius(30.0))):
        with raises_code("value.outside-range", ScenarioError, match="'quantiles'"):
            refused("seam")
    with raises_code("name.unknown", ScenarioError, match="'case'"):
        few.mean("case")


def told(found: td.simulation.Ensemble) -> bytes:
    kept = [
        x
        for n in found.nodes
        for x in (found.quantile(n, [0.05, 0.5]), found.mean(n), found.sd(n), found.highest_quantile(n, 0.5), found.lowest_quantile(n, 0.5))
    ]
    return b"".join(np.asarray(x).tobytes() for x in kept)


def test_workers_change_no_bit(monkeypatch: pytest.MonkeyPatch) -> None:
    from thermid.simulation import _ensemble as ensemble

    monkeypatch.setattr(ensemble, "TRACE_BYTES_AT_ONCE", 0)
    growth = np.random.default_rng(2).normal(0.01, 0.002, 150)
    growth[[3, 70, 149]] = 0.5  # these run away
    draws = {"chip.exponential_coefficient": growth, "scale.fan": np.linspace(0.0, 2.0, 150)}
    kept, whole = set(), set()
    for workers in (None, ThreadPoolExecutor(1), ThreadPoolExecutor(3)):
        few = td.ensemble(MODEL, ROOM, draws, every=300.0, quantiles=(0.05, 0.5), executor=workers)
        many = td.ensemble(MODEL, ROOM, draws, every=300.0, executor=workers)
        assert list(few.failed) == list(many.failed) == [3, 70, 149]
        kept.add(told(few))
        whole.add(told(many))
    assert len(kept) == len(whole) == 1


def test_a_job_goes_on_where_it_was_interrupted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from thermid.simulation import _ensemble as ensemble

    monkeypatch.setattr(ensemble, "TRACE_BYTES_AT_ONCE", 0)
    growth = np.random.default_rng(2).normal(0.01, 0.002, 150)
    growth[[3, 70, 149]] = 0.5  # these run away
    draws, begun, count = {"chip.exponential_coefficient": growth}, list[int](), ensemble._count

    def interrupted(runs: Any, values: Any, grids: Any) -> Any:
        begun.append(1)
        if len(begun) == 3:
            raise KeyboardInterrupt
        return count(runs, values, grids)

    def asked() -> td.simulation.Ensemble:
        return td.ensemble(MODEL, ROOM, draws, every=300.0, quantiles=(0.05, 0.5), executor=td.simulation.KeptTasks(tmp_path))

    monkeypatch.setattr(ensemble, "_count", interrupted)
    with pytest.raises(KeyboardInterrupt):
        asked()
    found = asked()
    assert told(found) == told(asked())
    assert len(begun) == len(list(tmp_path.rglob("*.npz"))) + 1  # the one that was interrupted twice, no other
    assert list(found.failed) == [3, 70, 149]
    assert told(found) == told(td.ensemble(MODEL, ROOM, draws, every=300.0, quantiles=(0.05, 0.5)))
    with raises_code("value.incomplete", ScenarioError, match=r"'quantiles'.*td\.qualify\.uncertain_runs"):
        td.ensemble(MODEL, ROOM, draws, executor=td.simulation.KeptTasks(tmp_path))


def test_draws_have_the_spread_asked_for() -> None:
    many = td.simulation.draw(MODEL, ROOM, SPREADS, 20000, seed=1)
    assert many["skin.htc.coefficient"].mean() == pytest.approx(1.6, rel=5e-3)
    assert many["skin.htc.coefficient"].std() == pytest.approx(0.24, rel=0.02)
    assert np.log(many["left.conductance"] / 2.0).std() == pytest.approx(0.3, rel=0.02)
    assert many["board.capacitance"].std() == pytest.approx(30.0, rel=0.02)
    assert np.std(many["room"]) == pytest.approx(0.5, rel=0.02)
    assert (np.min(many["initial.board"]), np.max(many["initial.board"])) == pytest.approx((293.15, 303.15), abs=0.01)
    assert all(np.array_equal(many[n], v) for n, v in td.simulation.draw(MODEL, ROOM, SPREADS, 20000, seed=1).items())
    assert not np.array_equal(many["room"], td.simulation.draw(MODEL, ROOM, SPREADS, 20000, seed=2)["room"])


def test_draws_stay_within_the_bounds_of_a_deck() -> None:
    found = td.simulation.draw(MODEL, ROOM, {"skin.emissivity": {"sd": 0.3}}, 2000, seed=1)["skin.emissivity"]
    assert 0.95 < found.max() <= 1.0


@pytest.mark.parametrize(
    ("spread", "error", "code", "match"),
    [
        (
            {"skin.htc.coefficient": {"sd": "1 [K]"}},
            UnitError,
            "unit.wrong-dimension",
            r"'skin\.htc\.coefficient'.*'\[K\]'.*\[W/\(m\^2 K\)\]",
        ),
        ({"skin.htc.coefficient": {"width": 1.0}}, ScenarioError, "name.unknown", "'skin\\.htc\\.coefficient'.*log_sd.*\"range\""),
        (
            {"skin.htc.coefficient": {"low": "1 [W/(m^2 K)]"}},
            ScenarioError,
            "name.unknown",
            "'skin\\.htc\\.coefficient'.*log_sd.*\"range\"",
        ),
        (
            {"skin.htc.coefficient": {"low": "2 [W/(m^2 K)]", "high": "1 [W/(m^2 K)]"}},
            ScenarioError,
            "value.outside-range",
            r"'skin\.htc\.coefficient'",
        ),
        ({"skin.htc.coefficient": "-5 [%]"}, ScenarioError, "value.outside-range", r"'skin\.htc\.coefficient'"),
        ({"initial.board": "5 [%]"}, ScenarioError, "value.without-effect", r"'initial\.board'"),
        ({"skin.emissivity": {"low": 2.0, "high": 3.0}}, ScenarioError, "value.outside-range", "'skin\\.emissivity'.*\"range\""),
        ({"skin.colour": "5 [%]"}, NameNotFoundError, "name.unknown", r"'skin\.colour'.*'skin\.area'"),
    ],
)
def test_spreads_that_make_no_sense(spread: dict[str, Any], error: type[Exception], code: str, match: str) -> None:
    with raises_code(code, error, match=match):
        td.simulation.draw(MODEL, ROOM, spread, 10, seed=1)


@pytest.mark.parametrize(
    ("draws", "code", "match"),
    [
        ({"scale.fan": [1.0, 2.0], "scale.chip": [1.0]}, "value.shape", r"'scale\.fan'.*'scale\.chip'"),
        ({"scale.fan": []}, "value.shape", r"'scale\.fan'"),
        ({"scale.fan": 1.0}, "value.shape", r"'scale\.fan'"),
        ({}, "value.shape", ""),
        ({"initial.board": td.celsius([27.0]), "initial.pcb": td.celsius([27.0])}, "name.taken", ""),
    ],
)
def test_draws_that_do_not_fit(draws: dict[str, Any], code: str, match: str) -> None:
    with raises_code(code, ScenarioError, match=match):
        td.ensemble(MODEL, ROOM, draws)


@pytest.mark.parametrize(("more", "match"), [({"threads": 0}, ""), ({"quantiles": (0.5, 1.5)}, "0.*1")])
def test_settings_that_make_no_sense(more: dict[str, Any], match: str) -> None:
    with raises_code("value.outside-range", ScenarioError, match=match):
        td.ensemble(MODEL, ROOM, {"scale.fan": [1.0]}, **more)


def test_a_fit_draws_with_its_covariance() -> None:
    items = {
        "left.conductance": FittedValue("left.conductance", 2.0, 0.2, 0.2, True, "W/K", 1.0, (0.1, 10.0), also=("right.conductance",)),
        "room": FittedValue("room", 0.5, 0.1, 0.1, False, "K", 0.0, (-1.0, 1.0)),
        "sensor T": FittedValue("sensor T", 0.0, 0.1, 0.1, False, "K", 0.0, (-1.0, 1.0), kind="sensor"),
    }
    covariance = np.array([[0.01, 0.008, 0.0], [0.008, 0.01, 0.0], [0.0, 0.0, 0.01]])
    draws = FittedValues("stage", items, covariance).draws(20000, seed=4)
    assert list(draws) == ["left.conductance", "right.conductance", "room"]
    assert np.array_equal(draws["left.conductance"], draws["right.conductance"])
    found = np.cov(np.log(draws["left.conductance"] / 2.0), draws["room"] - 0.5)
    assert found == pytest.approx(covariance[:2, :2], rel=0.05)
    assert td.ensemble(MODEL, ROOM, {n: v[:4] for n, v in draws.items()}).members == 4


def test_an_interrupt_ends_a_long_ensemble_and_leaves_the_interpreter_usable() -> None:
    program = textwrap.dedent("""
        import _thread, signal, threading, time
        signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored in what a script starts in the background
        import numpy as np, thermid as td
        deck = {"title": "one", "needs": ["room"], "nodes": {"a": {"capacitance": "100 [J/K]"}},
                "surfaces": {"s": {"of": "a", "to": "room", "area": "0.1 [m^2]", "htc": "5 [W/(m^2 K)]"}},
                "loads": {"q": {"into": "a", "power": "1 [W]"}}}
        times = np.arange(0.0, 1e5)
        room = (times, td.celsius(27.0 + np.random.default_rng(0).standard_normal(times.size)))
        scenario = td.Scenario("s", boundaries={"room": room}, start="27 [degC]", duration=1e5)
        model = td.model_from_dict(deck)
        tight = td.Options(error=1e-9)
        threading.Timer(1.0, _thread.interrupt_main).start()
        begun = time.monotonic()
        try:
            td.ensemble(model, scenario, {"scale.q": np.linspace(0.5, 1.5, 20000)}, every="1 [h]", options=tight, threads=2)
        except KeyboardInterrupt:
            print("ended", time.monotonic() - begun < 30.0, td.ensemble(model, scenario, {"scale.q": [1.0]}, every="1 [h]").members)
    """)
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=120, check=False)
    assert done.stdout.split() == ["ended", "True", "1"], done.stderr
