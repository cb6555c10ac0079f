"""Extremes, crossings and limits of a run hold between its stored samples: those of pulses that no sample meets too."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import thermid as td
from oracle import Oracle, flatten, si
from switched import switched
from thermid.base.units import ICE_POINT
from thermid.campaign.stages import Limits, check_limits, check_readings, margins
from thermid.model.tree import TableSignal
from thermid.prediction.members import hold
from thermid.simulation._solution import Trace
from thermid.simulation._solver.extremes import first_above, resolved
from thermid.simulation._solver.problem import signal_turnings

PEAK = 20.0 + 50.0 * (1.0 - np.exp(-1.2))
"""End of a pulse: 50 W for 12 s into 10 J/K with 1 W/K to 20 degC. [degC]"""
LIMIT = Limits("chip", "chip", td.quantity((263.15, 45.0 + ICE_POINT), unit="K"))
METHODS = ("modal", "integrator", "RKC2", "TR-BDF2")
NEAR = {"modal": 1e-5, "integrator": 4e-6, "RKC2": 2e-3, "TR-BDF2": 2e-3}
"""Error that is asked of each. [K]"""
WITHIN = {"modal": 1e-6, "integrator": 1e-5, "RKC2": 0.02, "TR-BDF2": 0.02}
"""Of jumps: a step of a second-order method may leave some of its error there. [K]"""


def pulsed(**more: Any) -> td.Model:
    """A chip with pulses of 12 s every 10 minutes and a time constant of 10 s."""
    load = {"into": "chip", "power": "50 [W]", "periodic": {"period": "10 [min]", "duty": "2 [%]"}}
    deck = {
        "title": "Pulsed",
        "needs": ["air"],
        "nodes": {"chip": {"capacitance": "10 [J/K]", "reference_point": True}},
        "conductors": {"out": {"kind": "conduction", "between": ["chip", "air"], "conductance": "1 [W/K]"}},
        "loads": {"q": load},
    }
    return td.model_from_dict(deck | more)


def day(**more: Any) -> td.Scenario:
    return td.Scenario(**({"title": "a day", "duration": "24 [h]", "boundaries": {"air": "20 [degC]"}, "start": "air"} | more))


@pytest.mark.parametrize("method", METHODS)
def test_the_highest_of_pulses_was_that_of_the_samples(method: str) -> None:
    """30.52 was said where the pulses reach 54.94 degC."""
    trace = td.simulate(pulsed(), day(), options=td.Options(error=NEAR[method], method=method))["chip"]
    near = WITHIN[method]
    assert trace.celsius.max() < 31.0
    assert trace.highest == pytest.approx(PEAK, abs=near)
    assert trace.maximum.time % 600.0 == pytest.approx(12.0, abs=0.05)
    assert trace.maximum.tracked
    assert trace.lowest == pytest.approx(20.0, abs=near)
    assert trace.crossing(td.celsius(45.0)) == pytest.approx(10.0 * np.log(2.0), abs=20.0 * near)
    assert trace.crossing(td.celsius(55.5)) is None


@pytest.mark.parametrize("method", METHODS)
def test_a_temperature_between_samples_was_on_a_straight_line(method: str) -> None:
    """91.7 was said for 24.0 degC: straight lines between stored times."""
    model = pulsed(loads={"q": {"into": "chip", "power": "100 [W]", "periodic": {"period": "1 [h]", "duty": "50 [%]"}}})
    trace = td.simulate(model, day(duration="2 [h]"), every="30 [min]", options=td.Options(error=NEAR[method], method=method))["chip"]
    asked = np.array([[4.0, 1800.0, 1832.0], [3599.0, 3604.0, 5430.0]])
    rise, fall = 1.0 - np.exp(-0.4), np.exp(-3.2)
    want = 20.0 + 100.0 * np.array([[rise, 1.0, fall], [0.0, rise, np.exp(-3.0)]])
    assert np.abs(trace.at(asked) - want).max() < max(WITHIN[method], 1e-5)
    assert float(trace.at("1804 [s]")) == pytest.approx(20.0 + 100.0 * np.exp(-0.4), abs=max(WITHIN[method], 1e-5))


def test_limits_passed_by_pulses_were_kept_with_14_5_kelvin_left() -> None:
    """How often, when first and for how long, from the equation."""
    (check,) = check_limits(td.simulate(pulsed(), day()), [LIMIT])
    beyond = 12.0 - 10.0 * np.log(2.0) + 10.0 * np.log((PEAK - 20.0) / 25.0)
    assert check.passed is False
    assert check.room == pytest.approx(45.0 - PEAK, abs=1e-5)
    (crossing,) = check.crossings
    assert crossing.time == pytest.approx(10.0 * np.log(2.0), abs=1e-4)
    assert crossing.worst - ICE_POINT == pytest.approx(PEAK, abs=1e-5)
    assert crossing.outside == pytest.approx(144 * beyond, rel=1e-4)


def test_a_unit_on_in_pulses_was_never_on_at_a_sample() -> None:
    """Each state has its own extreme: on, the end of a pulse; off, what is left of it."""
    run = td.simulate(pulsed(), day(), every="599 [s]")
    limits = replace(LIMIT, loads=("q",), non_operating=("-10 [degC]", "70 [degC]"))
    on, off = check_limits(run, [limits])
    assert (on.state, on.passed, off.state, off.passed) == ("operating", False, "non-operating", True)
    assert on.highest - ICE_POINT == pytest.approx(PEAK, abs=1e-4)
    assert on.crossings[0].outside == pytest.approx(144 * (12.0 - 10.0 * np.log(2.0)), rel=1e-4)


def test_hold_never_passed_a_limit_in_100_percent_that_pulses_pass_in_all() -> None:
    runs = td.qualify.uncertain_runs(pulsed(), day(), spread={"out.conductance": "2 [%]"}, n=40, nodes=["chip"])
    found = hold(runs, {"chip": "45 [degC]"})
    assert found["chip"].never == 0.0
    assert found["chip"].crossings.max() <= 12.0
    kept = hold(runs, {"chip": "70 [degC]"})
    assert kept["chip"].never == 1.0
    assert runs.highest("chip").mean() == pytest.approx(PEAK, abs=0.2)


def test_members_in_a_file_keep_their_pulses(tmp_path: Path) -> None:
    given: dict[str, Any] = {
        "spread": {"out.conductance": "2 [%]"},
        "n": 16,
        "nodes": ["chip"],
        "executor": td.simulation.KeptTasks(tmp_path),
    }
    first, again = td.qualify.uncertain_runs(pulsed(), day(), **given), td.qualify.uncertain_runs(pulsed(), day(), **given)
    assert again.reused == 16
    assert np.array_equal(first.highest("chip"), again.highest("chip"))
    assert again.highest("chip").min() > 50.0


def test_margins_by_the_samples_missed_the_pulses() -> None:
    seen = td.design.foresee(td.design.Knowledge.of_source(pulsed()), day(), spread={"out.conductance": "2 [%]"})
    hot = next(m for m in margins({"day": seen}, [LIMIT]) if m.side == "hot")
    assert hot.predicted - ICE_POINT == pytest.approx(PEAK, abs=0.01)
    assert hot.room < -9.9
    assert hot.exceedance > 0.99


def test_members_of_an_ensemble_agree_with_runs_of_their_own() -> None:
    """Lanes of every instruction set, and members that the integrator runs, since a thermostat or a massless node is among them."""
    from thermid import _kernel

    values = np.linspace(0.8, 1.2, 11)
    alone = [td.simulate(pulsed().with_values({"out.conductance": f"{x} [W/K]"}), day())["chip"] for x in values]
    for simd in _kernel.instruction_sets():
        many = td.ensemble(pulsed(), day(), {"out.conductance": values}, simd=simd)
        assert np.abs(many.highest("chip") - [t.highest for t in alone]).max() < 1e-4
        assert many.trace(3, "chip").maximum.time % 600.0 == pytest.approx(alone[3].maximum.time % 600.0, abs=1e-3)  # all peaks are equal
    few = td.ensemble(pulsed(), day(), {"out.conductance": values}, quantiles=(0.5,))
    assert few.highest_quantile("chip", 0.5) == pytest.approx(alone[5].highest, abs=few.quantile_error("chip", 0.5).max())
    assert few.lowest_quantile("chip", 0.5) == pytest.approx(20.0, abs=2.0**-10)
    lead = {"down": {"kind": "conduction", "between": ["chip", "mid"], "conductance": "1 [W/K]"}}
    star = pulsed(
        nodes={"chip": {"capacitance": "10 [J/K]"}, "mid": {}}, conductors=lead | {"up": lead["down"] | {"between": ["mid", "air"]}}
    )
    blind = td.ensemble(star, day(), {"initial.chip": td.celsius(np.full(3, 20.0))})
    assert blind.turnings("mid") is None
    assert "between them unknown" in str(blind.trace(0, "mid"))


def test_eliminated_and_massless_nodes_and_boundaries_have_extremes() -> None:
    lead = {"kind": "conduction", "conductance": "2 [W/K]"}
    glow = {"kind": "radiation", "between": ["skin", "air"], "emissivity": 0.5, "area": "20 [cm^2]"}
    conductors = {
        "down": lead | {"between": ["chip", "mid"]},
        "up": lead | {"between": ["mid", "air"]},
        "tie": lead | {"between": ["chip", "skin"]},
        "glow": glow,
    }
    model = pulsed(nodes={"chip": {"capacitance": "10 [J/K]"}, "mid": {}, "skin": {}}, conductors=conductors)
    air = {"times": ["0 [h]", "1 [h]", "1.01 [h]", "24 [h]"], "values": ["20 [degC]", "20 [degC]", "27 [degC]", "15 [degC]"]}
    run = td.simulate(model, day(boundaries={"air": air}))
    fine = td.simulate(model, day(boundaries={"air": air}, duration="2 [h]"), every="1 [s]")
    for name in ("chip", "mid", "skin"):
        trace = run[name]
        assert trace.maximum.kelvin >= fine[name].kelvin.max() - 1e-6
        near = trace.at(trace.maximum.time + np.linspace(-5.0, 5.0, 2001)).max() + ICE_POINT
        assert trace.maximum.kelvin == pytest.approx(near, abs=5e-3)
    assert run["air"].highest == pytest.approx(27.0, abs=1e-9)
    assert run["air"].maximum.time == pytest.approx(3636.0)


def test_readings_and_untracked_runs_say_that_nothing_is_known_between_samples() -> None:
    run = td.simulate(pulsed(), day(), options=td.Options(extremes=False))
    (check,) = check_limits(run, [LIMIT])
    (tracked,) = check_limits(td.simulate(pulsed(), day()), [LIMIT])
    assert ("; " in str(check).partition(":")[0], "; " in str(tracked).partition(":")[0]) == (True, False)
    (read,) = check_readings([("chip", np.array([0.0, 300.0]), np.array([293.15, 300.0]))], [LIMIT], run)
    assert "; " in str(read).partition(":")[0]
    log = Trace("chip", np.array([0.0, 10.0]), np.array([293.15, 303.15]))
    assert not log.maximum.tracked
    assert float(log.at(5.0)) == pytest.approx(25.0)


def test_the_extremes_of_a_signal() -> None:
    wave = td.Scenario(title="w", duration="1 [h]", boundaries={"a": {"mean": "20 [degC]", "amplitude": "5 [K]", "period": "1 [h]"}})
    found = signal_turnings(wave.boundaries["a"], 3600.0, 0.0)
    assert found.times == pytest.approx([900.0, 2700.0])
    assert found.kelvin - ICE_POINT == pytest.approx([25.0, 15.0])


def test_a_crossing_is_found_to_the_dense_output() -> None:
    times = np.array([0.0, 10.0])
    assert first_above(times, np.array([-1.0, 1.0])) == pytest.approx(5.0)
    assert first_above(times, np.array([-1.0, 99.0]), lambda t: t**2 - 1.0) == pytest.approx(1.0, abs=1e-4)
    assert first_above(times, np.array([-1.0, -0.5])) is None
    finer, above = resolved(times, np.array([-1.0, 99.0]), lambda t: t**2 - 1.0)
    assert np.diff(finer)[np.flatnonzero(np.diff(np.sign(above)))[0]] < 1e-3


def noisy(hold: bool) -> tuple[td.Model, td.Scenario]:
    """Two masses and a massless joint in an hour of air logged every second, with noise of 0.2 K and steps of 3 K."""
    lead = {"kind": "conduction", "conductance": "0.5 [W/K]"}
    ends = {"a": ["chip", "mid"], "b": ["mid", "case"], "c": ["case", "air"]}
    conductors = {name: lead | {"between": pair} for name, pair in ends.items()}
    conductors["d"] = lead | {"between": ["mid", "air"], "conductance": "2 [mW/K]"}
    nodes = {"chip": {"capacitance": "20 [J/K]"}, "case": {"capacitance": "60 [J/K]"}, "mid": {}}
    loads = {"q": {"into": "chip", "power": "2 [W]"}}
    model = td.model_from_dict({"title": "n", "needs": ["air"], "nodes": nodes, "conductors": conductors, "loads": loads})
    times = np.arange(3601.0)
    values = 293.15 + 0.2 * np.random.default_rng(3).standard_normal(times.size) + 3.0 * ((times + 3.0) % 1300.0 > 703.0)
    return model, td.Scenario(title="log", duration="1 [h]", boundaries={"air": TableSignal(times, values, hold=hold)}, start="293.15 [K]")


def strayed(trace: Trace, fine: Trace, every: float) -> float:
    """Return by how much the highest or lowest of an interval between samples differs from that of a fine course. [K]"""
    edges = np.arange(0.0, fine.times[-1] + every / 2, every)
    worst, courses = 0.0, (trace.course, (fine.times, fine.kelvin))
    for start, stop in pairwise(edges):
        # from the value after a jump at its start to the one before a jump at its end, and what the sample there has
        parts = ((t, k, np.searchsorted(t, start, "right") - 1, np.searchsorted(t, stop, "right")) for t, k in courses)
        own, want = (k[i:j] for _, k, i, j in parts)
        worst = max(worst, abs(own.max() - want.max()), abs(own.min() - want.min()))
    return worst


@pytest.mark.parametrize("hold", [False, True])
@pytest.mark.parametrize("method", ["modal", "integrator"])
def test_extremes_of_every_interval_under_noise_hold_to_the_millikelvins_left_out(method: str, hold: bool) -> None:
    model, scenario = noisy(hold)
    halves = np.arange(0.0, scenario.seconds + 0.25, 0.5)
    times = np.union1d(halves, halves[1:] - 1e-6)  # before every jump too
    fine = td.simulate(model, scenario, times=times, options=td.Options(method=method, extremes=False))
    for every in (1.0, 20.0, 600.0):
        run = td.simulate(model, scenario, every=every, options=td.Options(method=method))
        for node in ("chip", "case", "mid"):
            assert strayed(run[node], fine[node], every) < 3e-3
    assert strayed(Trace("chip", run.times, run["chip"].kelvin), fine["chip"], 600.0) > 0.3


def test_extremes_of_members_under_noise_hold_to_the_millikelvins_left_out() -> None:
    model, scenario = noisy(False)
    many = td.ensemble(model, scenario, {"c.conductance": np.linspace(0.4, 0.6, 9)}, every=120.0, nodes=["chip", "case"])
    one = td.simulate(model.with_values({"c.conductance": "0.4 [W/K]"}), scenario, every=0.5, options=td.Options(extremes=False))
    for node in ("chip", "case"):
        assert strayed(many.trace(0, node), one[node], 120.0) < 3e-3


def compared(seed: int) -> float:
    """Return how far the extremes of a random switched deck are off, and the course there; a switching off by dt moves it. [K]"""
    deck, course = switched(seed)
    model, scenario = td.model_from_dict(deck), td.Scenario(**course)
    run = td.simulate(model, scenario, options=td.Options(error=4e-7))
    want = Oracle(flatten(deck)[0], course).extremes(si(course["duration"]))
    off = 0.0
    for name, (lowest, low_time, highest, high_time) in want.items():
        trace, dense = run[name], run[name].at(np.array([low_time, high_time])) + ICE_POINT
        off = max(off, abs(trace.minimum.kelvin - lowest), abs(trace.maximum.kelvin - highest))
        if name != "mid":  # massless: at a jump, the instant has two temperatures
            off = max(off, float(np.abs(dense - (lowest, highest)).max()))
    return off


@pytest.mark.parametrize("seed", [0, 4, 8, 12, 19, 78])
def test_extremes_against_an_independent_integrator(seed: int) -> None:
    """Within 5 mK of scipy's at 1e-10, restarted at every switching, its dense output scanned at 1 ms."""
    assert compared(seed) < 5e-3


@pytest.mark.campaign
def test_extremes_of_200_random_models() -> None:
    """What they cost is measured by benchmarks/extremes.py."""
    off = np.array([compared(seed) for seed in range(200)])
    assert off.max() < 5e-3, np.flatnonzero(off >= 5e-3)


@pytest.mark.parametrize("method", ["integrator", "modal"])
def test_the_value_before_a_jump_at_a_stored_time_was_lost(method: str) -> None:
    """A node without capacitance follows a power that rises by a line and ends at once, on a stored time: its peak is just before."""
    model = td.model_from_dict(
        {
            "title": "jump",
            "needs": ["air"],
            "nodes": {"m": {}, "b": {"capacitance": "1000 [J/K]"}},
            "conductors": {
                "a": {"kind": "conduction", "between": ["m", "air"], "conductance": "1 [W/K]"},
                "c": {"kind": "conduction", "between": ["m", "b"], "conductance": "0.5 [W/K]"},
            },
            "loads": {"q": {"into": "m", "power": "50 [W]"}},
        }
    )
    ramp = {"times": ["0 [s]", "12 [s]", "12.000001 [s]"], "values": [0.0, 1.0, 0.0], "after": "hold"}
    step = {"times": ["0 [s]", "12 [s]"], "values": [1.0, 0.0], "hold": True}
    for command, times in ((step, [0.0, 6.0, 12.0, 18.0]), (step, [0.0, 12.0, 24.0]), (ramp, [0.0, 6.0, 12.000001, 18.0])):
        scenario = td.Scenario("s", boundaries={"air": "20 [degC]"}, commands={"q": command}, start="20 [degC]", duration=times[-1])
        options = td.Options(error=4e-9, method=method)
        fine = td.simulate(model, scenario, times=np.append(np.linspace(0.0, 12.0 - 1e-6, 601), times[-1]), options=options)["m"]
        trace = td.simulate(model, scenario, times=times, options=options)["m"]
        assert trace.highest == pytest.approx(float(fine.celsius.max()), abs=1e-3)
        assert trace.maximum.time == pytest.approx(12.0, abs=1e-3)
