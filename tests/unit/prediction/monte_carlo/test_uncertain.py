"""Runs with everything unknown drawn anew: draws by member, chunks kept and resumed, the same numbers from every executor."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import NameNotFoundError, ScenarioError
from thermid.prediction._budget import Target
from thermid.prediction._known import normal_sources
from thermid.prediction._monte_carlo import chunks as campaign_runs, sobol, uncertain
from thermid.prediction._monte_carlo.hold import drivers_of, hold
from thermid.prediction._monte_carlo.uncertain import begun_at
from thermid.simulation._many import tasks
from thermid.simulation.runs import Counted, KeptTasks
from thermid.values.store import Cut, FittedValue, FittedValues, Shifted, Uniform, uniforms

POWER, G, C, ROOM = 10.0, 0.5, 500.0, 293.15
SPREAD = {"air": "2 [K]", "scale.heater": "5 [%]"}


def plate(**more: object) -> td.Model:
    return td.model_from_dict(
        {
            "title": "plate",
            "needs": ["air"],
            "nodes": {"body": {"capacitance": f"{C} [J/K]", "reference_point": True}},
            "conductors": {
                "loss": {"kind": "conduction", "between": ["body", "air"], "conductance": {"value": f"{G} [W/K]", "min": 0.4, "max": 0.55}}
            },
            "loads": {"heater": {"into": "body", "power": {"value": f"{POWER} [W]", "source": "assumed"}}},
            **more,
        }
    )


SCENARIO = td.Scenario("warm-up", boundaries={"air": "20 [degC]"}, start="air", duration="1 [h]")


def runs(**more: object) -> td.qualify.UncertainRuns:
    return td.qualify.uncertain_runs(plate(), SCENARIO, **{"spread": SPREAD, "n": 60, "seed": 3, **more})


@pytest.fixture(autouse=True)
def few_members_run_together(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(uncertain, "MEMBERS_PER_CHUNK", 16)


def test_a_draw_depends_on_seed_name_and_index_alone() -> None:
    every = uniforms(5, "air", 0, 100)
    assert np.array_equal(uniforms(5, "air", 40, 7), every[40:47])
    assert not np.isin(uniforms(5, "sky", 0, 100), every).any()
    assert not np.isin(uniforms(6, "air", 0, 100), every).any()
    assert 0.0 < every.min() < every.max() < 1.0


def test_more_members_or_another_spread_leave_the_draws_as_they_are() -> None:
    few, many, wider = runs(), runs(n=100), runs(spread={"loss.conductance": "5 [%]", **SPREAD})
    for name in ("air", "scale.heater"):
        assert np.array_equal(few.draws[name], many.draws[name][:60])
        assert np.array_equal(few.draws[name], wider.draws[name])
    assert np.array_equal(few.temperatures[:48], many.temperatures[:48])


def test_every_member_is_the_run_that_it_would_be_alone() -> None:
    found = runs()
    for member in (0, 17, 59):
        shift, factor = (found.draws[n][member] for n in ("air", "scale.heater"))
        alone = td.simulate(
            plate(),
            SCENARIO.with_(boundaries={"air": f"{20 + shift} [degC]"}, loads={"heater": f"{POWER * factor} [W]"}),
            times=found.times,
        )
        assert found.node_temperatures("body")[member] == pytest.approx(alone["body"].kelvin, abs=1e-5)


def test_spreads_have_the_moments_that_were_asked_for() -> None:
    spread = {
        "air": "2 [K]",
        "scale.heater": {"log_sd": 0.2},
        "loss.conductance": "range",
        "initial.body": {"low": "-1 [K]", "high": "3 [K]"},
    }
    draws = runs(spread=spread, n=4000, every="30 [min]").draws
    assert draws["air"].mean() == pytest.approx(0.0, abs=0.1)
    assert draws["air"].std() == pytest.approx(2.0, rel=0.04)
    assert np.log(draws["scale.heater"]).std() == pytest.approx(0.2, rel=0.04)
    assert (draws["loss.conductance"].min(), draws["loss.conductance"].max()) == pytest.approx((0.4, 0.55), abs=1e-3)
    assert (draws["initial.body"].min(), draws["initial.body"].max()) == pytest.approx((-1.0, 3.0), abs=0.01)


def test_normals_stay_within_the_bounds_of_their_deck() -> None:
    draws = runs(spread={"loss.conductance": "20 [%]"}, n=2000, every="30 [min]").draws["loss.conductance"]
    assert 0.4 < draws.min() < 0.405
    assert 0.545 < draws.max() < 0.55


def fitted(path: str = "loss.conductance", prefix: str = "") -> FittedValues:
    def value(name: str, at: float, log: bool, unit: str) -> FittedValue:
        return FittedValue(name, at, 0.1, 0.1, log, unit, at, (0.0, 1e9), "fit")

    covariance = np.array([[0.0025, 0.004], [0.004, 0.01]])
    items = {f"{prefix}{path}": value(f"{prefix}{path}", 0.48, True, "W/K"), "heater.power": value("heater.power", 11.0, False, "W")}
    return FittedValues("bench", items, covariance)


def test_what_a_fit_left_open_is_drawn_with_its_covariance() -> None:
    found = runs(values=fitted(), spread={}, n=4000, every="30 [min]")
    log_g, watts = np.log(found.draws["loss.conductance"]), found.draws["heater.power"]
    assert np.cov(log_g, watts) == pytest.approx(fitted().covariance, rel=0.08)
    assert (np.exp(log_g.mean()), watts.mean()) == pytest.approx((0.48, 11.0), rel=5e-3)


def test_a_calibration_is_drawn_as_its_values_file(tmp_path: Path) -> None:
    times = np.arange(0.0, 3601.0, 60.0)
    truth = td.simulate(plate().with_values({"loss.conductance": "0.47 [W/K]"}), SCENARIO, times=times)["body"].kelvin
    noisy = truth + 0.1 * np.random.default_rng(2).standard_normal(times.size)
    channel = td.Channel.from_array("T", noisy, unit="K", role="node", target="body", noise=0.1)
    fit = td.calibrate(plate(), td.Record.from_arrays("log", times, {"T": channel}), ["loss.conductance"], scenario=SCENARIO)
    fit.save(tmp_path / "fit.values.toml")
    own, filed = (runs(values=v, spread={}) for v in (fit, td.load_values(tmp_path / "fit.values.toml")))
    drawn = own.draws["loss.conductance"]
    # a log is one run, in which a conductance may be 2.7 % another
    assert drawn.mean() == pytest.approx(fit["loss.conductance"].value, abs=2.0 * drawn.std())
    assert fit["loss.conductance"].error < drawn.std() < 0.05 * fit["loss.conductance"].value
    assert np.allclose(own.draws["loss.conductance"], filed.draws["loss.conductance"], rtol=1e-9)


def test_values_of_a_unit_reach_it_on_its_host() -> None:
    host = td.model_from_dict(
        {"title": "host", "needs": ["out"], "submodels": {"unit": {"use": plate(), "bind": {"air": "out"}}}, "aliases": {"U": "unit.body"}}
    )
    scenario = td.Scenario("x", boundaries={"out": "20 [degC]"}, duration="1 [h]")
    found = td.qualify.uncertain_runs(host, scenario, td.design.Knowledge(host, (fitted(),), at="unit"), n=20, nodes=["U"])
    assert set(found.draws) == {"unit.loss.conductance", "unit.heater.power"}
    assert found.draws["unit.heater.power"].mean() == pytest.approx(11.0, abs=0.1)


def test_a_root_of_a_covariance_has_a_column_for_each_direction_that_has_a_variance() -> None:
    some = np.random.default_rng(0).normal(size=(6, 4)) * np.array([1e-6, 1.0, 3.0, 1e4, 1.0, 1.0])[:, None]
    covariance = some @ some.T  # of rank four
    sources, root = normal_sources("bench", covariance, "data")
    assert root.shape == (6, len(sources)) == (6, 4)
    scale = np.sqrt(np.diag(covariance))
    assert root @ root.T / np.outer(scale, scale) == pytest.approx(covariance / np.outer(scale, scale), abs=1e-9)


def test_a_pattern_reaches_every_number_and_what_is_named_wins() -> None:
    two = td.model_from_dict(
        {
            "title": "two",
            "needs": ["air"],
            "submodels": {"a": {"use": plate(), "bind": {"air": "air"}}, "b": {"use": plate(), "bind": {"air": "air"}}},
        }
    )
    job = td.qualify.uncertain_runs(two, SCENARIO, spread={"*.conductance": "range"}, n=2).job
    # both instances share what one deck says
    assert job.budget.targets == (Target("a.loss.conductance", "add", ("b.loss.conductance",)),)
    own = {"*.conductance": "range", "a.loss.conductance": "10 [%]"}
    budget = td.qualify.uncertain_runs(two, SCENARIO, spread=own, n=2).job.budget
    laws = {s.name: type(s.law.law) for s in budget.sources if isinstance(s.law, Shifted)}
    assert laws == {"b.loss.conductance": Uniform, "a.loss.conductance": Cut}
    assert all(t.also == () for t in budget.targets)


def test_weather_and_start_times_are_drawn() -> None:
    day = SCENARIO.with_(boundaries={"air": {"mean": "20 [degC]", "amplitude": "8 [K]", "period": "24 [h]"}})
    cold = day.with_(title="cold", boundaries={"air": "5 [degC]"})
    found = runs(spread={}, n=40)
    assert np.ptp(found.node_temperatures("body")[:, -1]) == 0.0  # nothing was drawn
    found = td.qualify.uncertain_runs(
        plate(), [day, cold], n=400, spread={"start_time": {"low": "0 [h]", "high": "6 [h]", "step": "2 [h]"}}
    )
    (name,) = found.draws
    assert name == "scenario and start_time"
    counts = np.bincount(found.draws[name].astype(int))
    assert counts.size == 8
    assert counts.min() > 25
    for member in (0, 5):
        which = int(found.draws[name][member])
        alone = td.simulate(plate(), begun_at((day, cold)[which // 4], 7200.0 * (which % 4)), times=found.times)
        assert found.node_temperatures("body")[member] == pytest.approx(alone["body"].kelvin, abs=1e-9)


def test_a_start_later_keeps_tables_and_what_is_done() -> None:
    given = SCENARIO.with_(
        boundaries={"air": {"times": ["0 [h]", "1 [h]", "3 [h]"], "values": ["10 [degC]", "20 [degC]", "40 [degC]"]}},
        commands={"heater": {"times": ["0 [h]", "0.5 [h]"], "values": [1, 0], "hold": True}},
    )
    later = begun_at(given, 5400.0)
    at = np.array([0.0, 1800.0, 5400.0])
    assert later.boundaries["air"].at(at) == pytest.approx([298.15, 303.15, 313.15])
    assert later.commands == given.commands


def test_tables_that_end_before_a_run_begun_last_are_refused() -> None:
    short = SCENARIO.with_(boundaries={"air": {"times": ["0 [h]", "1 [h]"], "values": ["10 [degC]", "20 [degC]"]}})
    with raises_code("run.input-missing", ScenarioError, match=r"boundaries\.air.*1800.*1"):
        td.qualify.uncertain_runs(plate(), short, spread={"start_time": {"low": "0 [h]", "high": "1 [h]"}}, n=4)


# chunks ------------------------------------------------------------------------------------------------------------------------------


def test_an_interrupted_run_goes_on_without_repeating(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = runs()
    worked: list[int] = []
    honest = campaign_runs.work

    def counted(job: campaign_runs.Job, first: int, members: int, *more: Any) -> campaign_runs.Chunk:
        if len(worked) == 2:
            raise KeyboardInterrupt
        worked.append(first)
        return honest(job, first, members, *more)

    monkeypatch.setattr(campaign_runs, "work", counted)
    with pytest.raises(KeyboardInterrupt):
        runs(executor=KeptTasks(tmp_path))
    assert worked == [0, 16]
    monkeypatch.setattr(campaign_runs, "work", honest)
    seen: list[tuple[int, int]] = []
    plan = uncertain.plan_runs(plate(), SCENARIO, spread=SPREAD, seed=3)
    again = uncertain.members_of_plan(*plan, 60, KeptTasks(tmp_path), progress=lambda done, members: seen.append((done, members)))
    assert again.reused == 32
    assert seen == [(32, 60), (48, 60), (60, 60)]
    assert np.array_equal(again.temperatures, whole.temperatures)
    assert runs(executor=KeptTasks(tmp_path), n=100).reused == 48  # the last chunk was a part of one


LIMIT = {"body": {"highest": "38 [degC]", "lowest": "18 [degC]"}}


def bits(found: td.qualify.UncertainRuns) -> bytes:
    told = (found.quantile("body", SHARES), found.highest_quantile("body", SHARES), *(p.crossings for p in hold(found, LIMIT).points))
    return b"".join(x.tobytes() for x in told)


SHARES = (0.01, 0.5, 0.95)


@pytest.fixture
def small_sample(monkeypatch: pytest.MonkeyPatch) -> None:
    """No more than the pilot is kept whole."""
    monkeypatch.setattr(campaign_runs, "SAMPLE", 0)


@pytest.mark.usefixtures("small_sample")
def test_members_that_are_counted_say_what_kept_ones_say(monkeypatch: pytest.MonkeyPatch) -> None:
    """Quantiles within half a bin, hold times and probabilities to the last bit, on ten thousand members."""
    monkeypatch.setattr(uncertain, "MEMBERS_PER_CHUNK", 500)
    given: dict[str, object] = {"n": 10_000, "every": "5 [min]", "nodes": LIMIT}
    few = runs(**given)
    monkeypatch.setattr(campaign_runs, "SAMPLE", 1 << 25)
    whole = runs(**given)
    assert (few.whole, whole.whole, len(few)) == (1000, 10_000, 10_000)
    error = few.quantile_error("body", SHARES)
    assert (np.abs(few.quantile("body", SHARES) - whole.quantile("body", SHARES)) <= error * (1.0 + 1e-9)).all()
    assert (2.0 * error <= np.maximum(whole.node_temperatures("body").std(axis=0) / 90.0, 2.0**-9)).all()
    assert not whole.quantile_error("body", SHARES).any()
    assert few.highest_quantile("body", 0.5) == pytest.approx(np.median(whole.highest("body")), abs=error.max())
    a, b = hold(few, LIMIT), hold(whole, LIMIT)
    for x, y in zip((*a.points, a.together), (*b.points, b.together), strict=True):
        assert np.array_equal(x.crossings, y.crossings)
        assert (x.hold, x.never, x.between, x.never_between) == (y.hold, y.never, y.between, y.never_between)
    assert a["body"].drivers[0].share == pytest.approx(b["body"].drivers[0].share, abs=0.05)
    assert "1000" in str(few)
    with raises_code("value.outside-range", ScenarioError):
        few.node_temperatures("body")
    with raises_code("value.incomplete", ScenarioError, match=r"39 degC .*'body'.*'nodes'"):
        hold(few, {"body": "39 [degC]"})


@pytest.mark.usefixtures("small_sample")
def test_counted_members_go_on_after_an_interrupt_and_workers_change_no_bit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(uncertain, "MEMBERS_PER_CHUNK", 100)
    given: dict[str, object] = {"n": 3300, "every": "30 [min]", "nodes": LIMIT}
    alone, begun, honest = bits(runs(**given)), list[int](), campaign_runs.count
    assert bits(runs(**given, executor=ThreadPoolExecutor(3))) == alone

    def interrupted(job: campaign_runs.Job, table: campaign_runs.CountTable, first: int, *more: int) -> Counted:
        begun.append(first)
        if len(begun) == 3:
            raise KeyboardInterrupt
        return honest(job, table, first, *more)

    monkeypatch.setattr(campaign_runs, "count", interrupted)
    with pytest.raises(KeyboardInterrupt):
        runs(**given, executor=KeptTasks(tmp_path))
    seen: list[tuple[int, int]] = []
    plan = uncertain.plan_runs(plate(), SCENARIO, spread=SPREAD, seed=3, every="30 [min]", nodes=LIMIT)
    again = uncertain.members_of_plan(*plan, 3300, KeptTasks(tmp_path), progress=lambda done, members: seen.append((done, members)))
    assert seen[0] == (begun[2], 3300) == (again.reused, 3300)
    assert seen[-1] == (3300, 3300)
    assert bits(again) == alone
    assert begun[2:4] == [begun[2]] * 2
    more = runs(**(given | {"n": 4000}), executor=KeptTasks(tmp_path))
    assert more.reused > 2500  # a longer job begins with the same tasks
    other = runs(**(given | {"nodes": {"body": "30 [degC]"}}), executor=KeptTasks(tmp_path))
    assert other.reused == 1000  # crossings of another limit are not in the counts


@pytest.mark.usefixtures("small_sample")
def test_where_nobody_of_the_first_members_reaches_the_end_no_other_is_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(uncertain, "MEMBERS_PER_CHUNK", 500)
    found = runs(n=1500, every="30 [min]", options=td.Options(max_steps=1, method="integrator"))
    assert len(found) == len(found.failed) == 1000
    assert any(" 500 " in w for w in found.warnings)


@pytest.mark.parametrize("change", [{"seed": 4}, {"spread": {"air": "3 [K]"}}, {"every": "1 [min]"}])
def test_another_question_has_another_folder(change: dict[str, object], tmp_path: Path) -> None:
    runs(executor=KeptTasks(tmp_path))
    assert runs(executor=KeptTasks(tmp_path), **change).reused == 0
    assert len(list(tmp_path.iterdir())) == 2


def test_a_spoiled_chunk_is_run_again(tmp_path: Path) -> None:
    whole = runs(executor=KeptTasks(tmp_path))
    first = min(tmp_path.rglob("*.npz"))
    first.write_bytes(first.read_bytes()[:200])
    again = runs(executor=KeptTasks(tmp_path))
    assert again.reused == 44
    assert np.array_equal(again.temperatures, whole.temperatures)


def test_threads_give_the_same_numbers() -> None:
    assert np.array_equal(runs(executor=ThreadPoolExecutor(2)).temperatures, runs().temperatures)


@pytest.mark.campaign
def test_processes_give_the_same_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tasks, "PROCESSES_PAY", 0.0)
    assert np.array_equal(runs(executor=2).temperatures, runs().temperatures)


def test_members_that_fail_are_left_out_and_told() -> None:
    found = runs(spread={"scale.heater": {"sd": "1"}}, options=td.Options(max_steps=2, method="integrator"))
    assert len(found.failed) > 0
    assert any("did not reach the end" in w for w in found.warnings) or len(found.failed) == 60


def test_what_runs_will_take_is_said_before_they_begin(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Memory within a factor of 2 of what the same runs take; what a folder has costs no time."""
    monkeypatch.setattr(uncertain, "MEMBERS_PER_CHUNK", 200)
    import tracemalloc

    from thermid.prediction._monte_carlo.chunks import RunCost
    from thermid.prediction._monte_carlo.uncertain import plan_runs

    job, _ = plan_runs(plate(), SCENARIO, spread=SPREAD, seed=3)
    said = RunCost.of_members(job, 2000, 0)
    tracemalloc.start()
    runs(n=2000)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert 0.5 < said.size / peak < 2.0
    assert RunCost.of_members(job, 2000, 2000).seconds == 0.0 < said.seconds
    assert "2000" in str(said)


# mistakes ----------------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("more", "code", "match"),
    [
        ({"n": 0}, "value.outside-range", ""),
        (
            {"spread": {"air": "2 [K]", "loss.conductance": "range"}, "values": fitted()},
            "value.excludes-another",
            r"'loss\.conductance' has two",
        ),
        ({"spread": {"air": {"sdd": "2 [K]"}}}, "name.unknown", "\\{sd\\}, \\{log_sd\\}, \\{low, high\\} or \\\"range\\\".*'sd'\\?"),
        ({"spread": {"air": "2 [%]"}}, "value.without-effect", ""),
        ({"spread": {"air": {"low": "2 [K]", "high": "1 [K]"}}}, "value.outside-range", ""),
        ({"spread": {"heater.power": "range"}}, "value.incomplete", "'range'"),
        ({"spread": {"*.mass": "range"}}, "name.unknown", r"'\*\.mass'"),
        ({"spread": {"airr": "1 [K]"}}, "name.unknown", r"'air'\?"),
        ({"spread": {"loss.conductance": {"sd": "1e-6 [W/K]"}, "start_time": "1 [h]"}}, "value.wrong-kind", r"\{ low = \"0 \[h\]\""),
        ({"nodes": ["bodi"]}, "name.unknown", r"'bodi'.*'body'\?"),
    ],
)
def test_mistakes_are_named(more: dict[str, object], code: str, match: str) -> None:
    with raises_code(code, td.ThermidError, match=match):
        runs(**more)


def test_the_power_of_a_deck_that_the_scenario_gives_is_refused() -> None:
    with raises_code("value.without-effect", match="'heater'.*'scale.heater'"):
        td.qualify.uncertain_runs(plate(), SCENARIO.with_(loads={"heater": "3 [W]"}), spread={"heater.power": "5 [%]"}, n=4)


def test_a_node_that_was_not_kept() -> None:
    with raises_code("name.unknown", NameNotFoundError, match="'air'"):
        runs().node_temperatures("air")


# drivers -----------------------------------------------------------------------------------------------------------------------------


def test_drivers_share_what_a_line_through_the_ranks_explains() -> None:
    rng = np.random.default_rng(1)
    a, b, c = rng.normal(size=(3, 3000))
    first, second, third = drivers_of({"a": a, "b": b, "c": c, "twin": a.copy()}, 3.0 * a - 1.0 * b)
    assert (first.name, second.name, third.name) == ("a", "b", "c")
    assert (first.share, second.share, third.share) == pytest.approx((0.9, 0.1, 0.0), abs=0.03)
    assert first.direction > 0.9 > 0.0 > second.direction
    assert first.share + second.share + third.share == pytest.approx(1.0, abs=0.02)


def test_more_inputs_than_a_fifth_of_the_members_still_have_drivers() -> None:
    """A host with the departures of its parts had 60 inputs for 200 members, and no drivers without a word."""
    rng = np.random.default_rng(1)
    draws = {f"x{k}": rng.normal(size=200) for k in range(60)}
    first, second, *rest = drivers_of(draws, 3.0 * draws["x7"] - 1.5 * draws["x30"] + 0.5 * rng.normal(size=200))
    assert (first.name, second.name) == ("x7", "x30")
    assert (first.share, second.share) == pytest.approx((0.78, 0.2), abs=0.12)  # 200 members: a correlation is known to 0.07
    assert max(d.share for d in rest) < 0.03


def test_too_few_members_have_no_drivers() -> None:
    rng = np.random.default_rng(1)
    assert drivers_of({"a": rng.normal(size=20)}, rng.normal(size=20)) == ()


def test_members_of_a_folder_are_one_lazy_data_set(tmp_path: Path) -> None:
    """Chunk by chunk, and the same bits as those that are held."""
    few = runs(n=8, every="10 [min]")
    whole = runs(n=30, every="10 [min]")
    with few.open_members(30, tmp_path) as lazy:
        assert [*lazy.temperature.chunksizes["member"]] == [16, 14]
        assert np.array_equal(lazy.temperature.values, whole.temperatures)
        assert all(np.array_equal(lazy[name].values, values) for name, values in whole.draws.items())
        lazy.to_netcdf(tmp_path / "members.nc", engine="h5netcdf")
    files = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.npz")}
    few.open_members(30, tmp_path)
    with raises_code("value.outside-range", ScenarioError):
        few.open_members(0, tmp_path)
    assert files == {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.npz")}


def test_sobol_of_a_sum_is_its_variances() -> None:
    """Settled, T = air + P/G: shares of 2 K and of 20 K times 5 % are 4 to 1."""
    job = runs(nodes=["body"], every="30 [min]").job
    found = td.qualify.sobol_of(job, "body", 3600.0, base=256)
    settled = 1.0 - np.exp(-3600.0 * G / C)
    by_hand = np.array([2.0**2, (20.0 * settled * 0.05) ** 2])
    assert [found.total["air"], found.total["scale.heater"]] == pytest.approx(by_hand / by_hand.sum(), abs=0.03)
    assert found.runs == 256 * 4
    assert "air" in str(found).splitlines()[1]


def test_sobol_goes_on_where_it_was_interrupted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    job = replace(runs(nodes=["body"], every="30 [min]").job, chunk=100)
    whole, begun = td.qualify.sobol_of(job, "body", 3600.0, base=64), 0

    def interrupted(*task: Any) -> Any:
        nonlocal begun
        begun += 1
        if begun == 2:
            raise KeyboardInterrupt
        return run(*task)

    run = sobol.run_members_of
    monkeypatch.setattr(sobol, "run_members_of", interrupted)
    with pytest.raises(KeyboardInterrupt):
        td.qualify.sobol_of(job, "body", 3600.0, base=64, executor=KeptTasks(tmp_path))
    again = td.qualify.sobol_of(job, "body", 3600.0, base=64, executor=KeptTasks(tmp_path))
    assert begun == 2 + 2  # of three groups of runs one was there
    assert (again.first, again.total, again.errors) == (whole.first, whole.total, whole.errors)
    td.qualify.sobol_of(job, "body", 1800.0, base=64, executor=KeptTasks(tmp_path))
    assert begun == 4 + 3  # another time is another job


@pytest.mark.parametrize(("more", "match"), [({"base": 100}, "two, not 100"), ({"spread": {"air": "1 [K]"}}, "Sobol's")])
def test_sobol_refuses(more: dict[str, object], match: str) -> None:
    base = {"base": more.pop("base")} if "base" in more else {}
    with raises_code("value.outside-range", ScenarioError, match=match):
        td.qualify.sobol_of(runs(**more).job, "body", **base)


def painted(emissivity: object = 0.93) -> td.Model:
    skin = {"of": "body", "to": "air", "area": "0.05 [m^2]", "htc": "5 [W/(m^2 K)]", "emissivity": emissivity}
    nodes = {"body": {"capacitance": f"{C} [J/K]", "reference_point": True}}
    heater = {"into": "body", "power": f"{POWER} [W]"}
    return td.model_from_dict(
        {"title": "painted", "needs": ["air"], "nodes": nodes, "surfaces": {"skin": skin}, "loads": {"heater": heater}}
    )


@pytest.mark.parametrize("spread", ["10 [%]", {"log_sd": 0.1}, {"sd": "0.3", "mean": "0.9"}, {"low": "0.8", "high": "1"}])
def test_a_stated_spread_of_an_emissivity_stays_between_zero_and_one(spread: object) -> None:
    found = td.qualify.uncertain_runs(painted(), SCENARIO, spread={"skin.emissivity": spread}, n=500, every="30 [min]")
    drawn = found.draws["skin.emissivity"]
    assert not found.failed
    assert 0.0 < drawn.min() < drawn.max() <= 1.0
    assert drawn.std() > 0.02
    alone = td.simulation.draw(painted(), SCENARIO, {"skin.emissivity": spread}, 500, seed=0)["skin.emissivity"]
    assert drawn == pytest.approx(alone, rel=1e-12)


@pytest.mark.parametrize(("log", "size"), [(True, 0.15), (False, 0.15), (False, 1.0)])
def test_what_a_fit_left_open_of_an_emissivity_stays_between_zero_and_one(log: bool, size: float) -> None:
    value = FittedValue("skin.emissivity", 0.93, size, size, log, "1", 0.93, (0.02, 1.0), "fit")
    values = FittedValues("bench", {"skin.emissivity": value}, np.array([[size**2]]))
    found = td.qualify.uncertain_runs(painted(), SCENARIO, values, n=2000, every="30 [min]")
    alone = values.draws(2000, seed=1)["skin.emissivity"]
    for drawn in (found.draws["skin.emissivity"], alone):
        assert 0.0 < drawn.min() < drawn.max() <= 1.0
        assert np.mean(drawn < 0.93) == pytest.approx(0.5, abs=0.03)
        assert drawn[drawn < 0.93].mean() == pytest.approx(0.93 - 0.8 * min(size, 0.5), abs=0.15)
    assert not found.failed


def test_a_fitted_conductance_that_may_be_zero_is_drawn_above_it() -> None:
    loss = {"kind": "conduction", "between": ["body", "air"], "conductance": {"value": "0.1 [W/K]", "min": 0.0}}
    value = FittedValue("loss.conductance", 0.1, 0.2, 0.2, False, "W/K", 0.1, (0.0, 1.0), "fit")
    values = FittedValues("bench", {"loss.conductance": value}, np.array([[0.04]]))
    found = td.qualify.uncertain_runs(plate(conductors={"loss": loss}), SCENARIO, values, n=500, every="30 [min]")
    drawn = found.draws["loss.conductance"]
    assert not found.failed
    assert 0.0 < drawn.min() < 0.01
    assert drawn[drawn > 0.1].mean() == pytest.approx(0.1 + 0.8 * 0.2, rel=0.1)
