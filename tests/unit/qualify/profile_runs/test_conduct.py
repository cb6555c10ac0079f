"""Profiles run on models: dwells that wait for the unit, heat that closes, vacuum, humidity, refusals."""

from __future__ import annotations

import math
import re
from types import SimpleNamespace

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import ScenarioError, SolverError
from thermid.qualify._profile_runs import conduct
from thermid.qualify._profile_runs.profile_run import verdict_remarks

PREDICTED = ("-5 [degC]", "45 [degC]")


def box(capacity=500.0, foot=0.5, **more):
    """A unit on a base plate in a chamber."""
    deck = {
        "title": "box",
        "needs": ["air"],
        "nodes": {"plate": {"capacitance": "300 [J/K]"}, "core": {"capacitance": f"{capacity} [J/K]"}},
        "conductors": {"foot": {"kind": "conduction", "between": ["plate", "core"], "conductance": f"{foot} [W/K]"}},
        "surfaces": {"skin": {"of": "plate", "to": "air", "area": "0.1 [m^2]", "htc": "8 [W/(m^2 K)]", "emissivity": 0.8}},
        "loads": {"chips": {"into": "core", "power": "5 [W]"}},
    }
    return td.model_from_dict({**deck, **more})


def cycle(count=1, **changes):
    return td.qualify.profile_of("SMC-S-016", "unit thermal cycle", predicted=PREDICTED, cycles=count, **changes)


@pytest.fixture(scope="module")
def run():
    return td.qualify.run_profile(box(), cycle())


def test_a_dwell_begins_when_the_slowest_node_is_below_the_rate(run):
    waits = [p for p in run if p.kind == "wait"]
    assert len(waits) == 3
    for p in waits:
        assert p.slowest in ("core", "plate")
        assert abs(p.rate) == pytest.approx(3.0 / 3600.0, rel=1e-3)
        trace = run[p.slowest]
        seen = float(trace.at(p.end) - trace.at(p.end - 60.0)) / 60.0
        assert seen == pytest.approx(p.rate, rel=0.02)  # the trace is stored every minute and joined by straight lines


def test_what_the_rule_leaves_is_rate_times_time_constant(run):
    slow = float(run.solution.time_constants[0])
    (p,) = [p for p in run if p.kind == "wait" and p.cycle == 1 and p.name == "to cold"]
    assert abs(p.unfinished) == pytest.approx(slow * 3.0 / 3600.0, rel=0.1)


def test_heat_closes_over_the_whole_and_stretches_join(run):
    balance = run.solution.heat_balance()
    assert balance.relative < 1e-9
    again = td.simulate(box(), run.scenario, times=run.solution.times)
    assert np.abs(again.temperatures - run.solution.temperatures).max() < 1e-12
    ends = [p.end for p in run]
    assert ends[-1] == pytest.approx(run.scenario.seconds)
    assert [p.start for p in run][1:] == pytest.approx(ends[:-1])


def test_the_state_goes_from_phase_to_phase_as_it_is():
    """The temperatures at the end of the last stretch, reached leg by leg, are those of the whole run in one."""
    from thermid.qualify._profile_runs import conduct

    kept = []
    own = conduct._as_profile_run

    def caught(course, *rest):
        kept.append(course.state)
        return own(course, *rest)

    conduct._as_profile_run = caught
    try:
        run = td.qualify.run_profile(box(), cycle(2))
    finally:
        conduct._as_profile_run = own
    last = run.solution.temperatures[-1]
    names = run.solution.nodes
    assert kept[0] == pytest.approx([last[names.index("plate")], last[names.index("core")]], abs=5e-6)


def test_a_heavier_unit_takes_longer(run):
    heavy = td.qualify.run_profile(box(capacity=1500.0), cycle())
    assert heavy.waited > 1.5 * run.waited
    assert heavy.duration > run.duration


def test_levels_hold_at_the_base_plate_when_it_is_named():
    run = td.qualify.run_profile(box(), cycle(), base="plate")
    hot = next(p for p in run if p.name == "to hot" and p.kind == "wait")
    assert hot.base == pytest.approx(71.0 + 273.15, abs=3.0)
    settled = td.steady(box(), td.Scenario("hot", boundaries={"air": f"{hot.chamber} [K]"}))
    assert settled["plate"] == pytest.approx(71.0 + 273.15, abs=2e-3)
    assert any(re.search(r"'plate' .* \d.* K/min; .* K ", r) for r in run.remarks)


def test_a_slow_chamber_stretches_the_ways(run):
    slow = td.qualify.run_profile(box(), cycle(), chamber_ramp="0.5 [K/min]")
    way = next(p for p in slow if p.kind == "way")
    assert way.duration == pytest.approx(48.0 / 0.5 * 60.0)
    assert any(" 0.5 K/min" in r for r in set(slow.remarks) - set(run.remarks))


def test_vacuum_takes_longer_and_pumps_down_first(run):
    profile = td.qualify.profile_of("SMC-S-016", "unit thermal vacuum", predicted=PREDICTED, cycles=1)
    empty = td.qualify.run_profile(box(), profile)
    assert [p.name for p in empty][:2] == ["pump down", "high vacuum"]
    pressure = empty.scenario.environment["*"].pressure.at(np.array([0.0, 600.0, 1200.0, 20000.0]))
    assert pressure == pytest.approx([101325.0, 20.0, 0.0133, 0.0133], rel=1e-6)
    assert empty.waited > run.waited
    assert empty.solution.heat_balance().relative < 1e-7


def test_a_window_rule_waits_for_its_window():
    profile = td.qualify.profile_of("SMC-S-016", "thermal balance", predicted=PREDICTED)
    run = td.qualify.run_profile(box(), profile)
    waits = [p for p in run if p.kind == "wait"]
    assert [p.power for p in waits] == [True, True, False, True, True]
    for p in waits:
        assert p.duration > 5 * 3600.0
        trace = run[p.slowest]
        assert abs(float(trace.at(p.end) - trace.at(p.end - 5 * 3600.0))) == pytest.approx(1.0, abs=0.01)


def test_a_memory_of_a_thermostat_is_kept():
    heater = {"into": "plate", "power": "20 [W]", "thermostat": {"on_below": "-20 [degC]", "off_above": "-15 [degC]"}}
    loads = {"chips": {"into": "core", "power": "5 [W]"}, "heater": heater}
    profile = cycle().with_(stable="15 C/h over 1 h")
    run = td.qualify.run_profile(box(loads=loads), profile)
    assert run.solution.heat_balance().relative < 1e-7
    assert float(run["plate"].celsius.min()) > -21.0


def test_a_profile_that_never_stabilises_says_which_node_and_why():
    swinging = {"chips": {"into": "core", "power": "40 [W]", "periodic": {"period": "20 [min]", "duty": 0.5}}}
    with raises_code("run.not-stable", SolverError, match="'3 C/h' .*5 h: 'core' .*load 'chips'.* = '30 "):
        td.qualify.run_profile(box(loads=swinging), cycle(longest_wait="5 [h]"))
    with raises_code("run.not-stable", SolverError, match=r"30 min: 'core' .*\+\d.* K/h.* degC.* min; .* min .*longest_wait"):
        td.qualify.run_profile(box(), cycle(longest_wait="30 [min]"))
    lonely = {"skin": {"of": "plate", "to": "air", "area": "1e-9 [m^2]", "htc": "1e-3 [W/(m^2 K)]"}}
    with raises_code("run.not-stable", SolverError, match="10 h: 'core' "):
        td.qualify.run_profile(box(surfaces=lonely), cycle(longest_wait="10 [h]"))


CLOCKED = {"chips": {"into": "core", "power": "10 [W]", "periodic": {"period": "20 [min]", "duty": 0.5}}}
THERMOSTAT = {
    "chips": {"into": "core", "power": "5 [W]"},
    "heater": {"into": "plate", "power": "60 [W]", "thermostat": {"on_below": "-20 [degC]", "off_above": "-15 [degC]"}},
}


@pytest.mark.parametrize(("loads", "average"), [(CLOCKED, "20 [min]"), (THERMOSTAT, "40 [min]")])
def test_a_unit_whose_loads_switch_is_stable_by_its_means(loads, average):
    """The mean over whole swings drifts by less than the rule when a dwell begins; momentary temperatures never are stable."""
    model = box(loads=loads)
    with raises_code("run.not-stable", SolverError, match="5 h: .*load '(chips|heater)'.* = '30 "):
        td.qualify.run_profile(model, cycle(longest_wait="5 [h]"))
    run = td.qualify.run_profile(model, cycle(average=average, stable="3 C/h over 20 min"), every=20.0)
    assert run.solution.heat_balance().relative < 1e-7
    span = 60.0 * float(average.split()[0])
    swings = []
    for p in (p for p in run if p.kind == "wait"):
        trace = run[p.slowest]

        def mean(end, trace=trace):
            return float(np.mean(trace.at(np.linspace(end - span, end, 241))))

        assert abs(mean(p.end) - mean(p.end - 1200.0)) <= 1.0 * 1.1  # 3 C/h over 20 min; stored every 20 s
        swings += [float(np.ptp(run[n].at(np.linspace(p.end - 1200.0, p.end, 241)))) for n in ("plate", "core")]
    assert max(swings) > 1.5


def test_a_mean_that_does_not_settle_and_a_rule_that_is_not_asked_of_means():
    with raises_code("run.not-stable", SolverError, match="45 min: .* 20 min.*longest_wait"):
        td.qualify.run_profile(box(loads=CLOCKED), cycle(average="20 [min]", longest_wait="45 [min]"))
    with raises_code("value.without-effect", ScenarioError, match="'stored 5 %'"):
        td.qualify.run_profile(box(loads=CLOCKED), cycle(average="20 [min]", stable="stored 5 %"))


def test_a_level_out_of_reach_is_refused():
    strong = {"heater": {"into": "plate", "power": "5000 [W]"}}
    with raises_code("value.outside-range", ScenarioError, match="'plate' to 71"):
        td.qualify.run_profile(box(loads=strong), cycle(), base="plate")


def test_a_set_point_that_is_not_found_in_twelve_steady_states_is_refused():
    """A secant gains digits by a factor of 1.6 a step: from 300 K off to 1 mK takes seven where radiation bends the way, so twelve do."""
    tried = []

    def steady(names, chamber):
        tried.append(chamber)
        return {"plate": 320.0 + 1.5 + math.sin(chamber)}

    bench = SimpleNamespace(leg=lambda plan, state, since: SimpleNamespace(steady=lambda names: steady(names, state.chamber)))
    course = SimpleNamespace(base="plate", bench=bench, remarks={}, profile=SimpleNamespace(title="cycle"))
    with raises_code("value.outside-range", ScenarioError, match="'plate'"):
        conduct._Course._set_point(course, conduct.ChamberConditions(chamber=300.0, power=True, pressure=None, humidity=None), 320.0)
    assert len(tried) == 12


def test_humidity_is_followed_and_condensation_named():
    steps = [
        {"name": "to hot", "to": "35 [degC]", "humidity": 0.95, "over": "30 [min]", "power": "off"},
        {"name": "hot", "dwell": "30 [min]"},
    ]
    run = td.qualify.run_profile(box(), td.qualify.profile_of("SMC-S-016", "unit humidity").with_(steps=steps))
    assert run.moisture is not None
    assert run.moisture["skin"].condensing > 0.0
    assert any("'skin'" in r for r in run.remarks)
    (short,) = (r for r in verdict_remarks(run) if "'skin'" in r)
    assert re.match(r"[^':]* 'skin': ", short)
    assert "e+" not in short

    class EnoughError(Exception):
        pass

    said = []

    def told(step, count, reached):
        said.append(step)
        if said.count(count) > 2:  # the last step, then each pass of the balance of vapour and heat
            raise EnoughError

    with pytest.raises(EnoughError):
        td.qualify.run_profile(box(), td.qualify.profile_of("SMC-S-016", "unit humidity").with_(steps=steps), progress=told)


@pytest.mark.parametrize(
    ("arguments", "code", "match"),
    [
        ({"chamber": "airs"}, "name.unknown", "'air'"),
        ({"equipment": ["chip"]}, "name.unknown", "'chips'"),
        ({"base": "plat"}, "name.unknown", "'plate'"),
        ({"chamber_ramp": "0 [K/s]"}, "value.outside-range", "chamber_ramp"),
        ({"every": 0.0}, "value.outside-range", ""),
    ],
)
def test_wrong_names_are_refused(arguments, code, match):
    with raises_code(code, match=match):
        td.qualify.run_profile(box(), cycle(), **arguments)


def test_several_boundaries_need_a_chamber():
    two = {"needs": ["air", "wall"], "conductors": {"foot": {"kind": "conduction", "between": ["plate", "core"], "conductance": "1 [W/K]"}}}
    two["conductors"]["strap"] = {"kind": "conduction", "between": ["core", "wall"], "conductance": "0.1 [W/K]"}
    with raises_code("value.incomplete", ScenarioError, match="SMC-S-016"):
        td.qualify.run_profile(box(**two), cycle())
    with raises_code("run.input-missing", ScenarioError, match="'wall'"):
        td.qualify.run_profile(box(**two), cycle(), chamber="air")
    run = td.qualify.run_profile(box(**two), cycle(), chamber="air", scenario=td.Scenario("x", boundaries={"wall": "20 [degC]"}))
    assert math.isfinite(run.duration)


def test_printed_and_as_an_object(run):
    text = str(run)
    assert "to hot, wait" in text
    assert run.profile.trust in text
    found = run.as_object()
    assert found["decides"] is True
    assert len(found["phases"]) == len(run.phases)
    assert found["heat_balance"]["relative"] < 1e-9
