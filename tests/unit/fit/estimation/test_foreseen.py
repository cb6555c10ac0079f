"""Runs that nobody has logged, with the noise in their bands; what innovations say of errors; noises in one line."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import ThermidError
from thermid.fit._estimation.estimation import Estimation
from thermid.fit._estimation.likelihood import likelihood_of
from thermid.fit._estimation.outlook import course
from thermid.fit._estimation.process import read_process
from thermid.fit._problem.gather import build_problem
from thermid.fit._problem.request import Request
from thermid.measure.records import Channel, Record
from thermid.simulation.runs import compile_network

from .house import ICE, TRUTH, VALUES, Array, Case, Truth, drawn, house, straight, van_loan
from .test_filter import rack

DAY = 86400.0


def rates() -> Array:
    v = TRUTH.values
    a = [[-(1 / v["Ro"] + 1 / v["Ri"]) / v["Cw"], 1 / v["Ri"] / v["Cw"]], [1 / v["Ri"] / v["Ci"], -1 / v["Ri"] / v["Ci"]]]
    return np.array(a)


def test_variance_of_a_run_is_that_of_its_noise() -> None:
    """Values known: the state after three days has the covariance of Van Loan's block, its mean is the run's."""
    times = np.array([0.0, 0.25 * DAY, 3.0 * DAY])
    blank = Channel.from_array("indoor", np.full(3, 300.0), unit="K", role="node", target="indoor", noise=1.0)
    asked = td.Scenario("cold", boundaries={"out": "-5 [degC]"}, start="20 [degC]", duration=3.0 * DAY)
    request = Request(house(), (Record.from_arrays("t", times, {"indoor": blank}),), (), {"*": asked}, name="t", fit_start=False)
    problem = build_problem(request)
    noises = read_process({"wall": "1.5e-3 [K/s^0.5]"}, problem.experiments[0].network, "t")
    likelihood = likelihood_of(problem, noises, {"wall": 0.4, "indoor": 0.0})
    mean, variance = course(likelihood, np.zeros(0), np.zeros((0, 0)), times)
    run = td.simulate(house(), asked, times=times)
    step, added = straight(rates(), 600.0)[0], van_loan(rates(), np.array([[1.5e-3], [0.0]]), 600.0)
    due, now = np.diag([0.16, 0.0]), 0.0
    for k, t in enumerate(times):
        while now < t - 1.0:
            due, now = step @ due @ step.T + added, now + 600.0
        assert variance[k] == pytest.approx(np.diag(due), rel=1e-9, abs=1e-12)
        assert mean[k] == pytest.approx([run["wall"].kelvin[k], run["indoor"].kelvin[k]], abs=1e-5)


def test_a_run_is_foreseen_with_its_noise(found: Estimation) -> None:
    """Thirty runs of the truth in other conditions; all share the errors of one fit, so that their share inside scatters about 95 %."""
    asked = td.Scenario("cold", boundaries={"out": "-5 [degC]"}, loads={"heater": "500 [W]"}, start="20 [degC]", duration=2 * DAY)
    times = np.linspace(0.0, 2 * DAY, 25)
    told = found.predict(asked, times, by="process noise")
    assert told.names == ("wall", "indoor")
    r = np.random.default_rng(3)
    move, p1, _ = straight(rates(), times[1])
    root = np.linalg.cholesky(van_loan(rates(), np.array([[TRUTH.sigma_w], [0.0]]), times[1]))
    v = TRUTH.values
    force = np.array([(ICE - 5.0) / v["Ro"] / v["Cw"], 500.0 / v["Ci"]])
    runs = np.full((30, times.size, 2), ICE + 20.0)
    for k in range(1, times.size):
        runs[:, k] = runs[:, k - 1] @ move.T + p1 @ force + r.normal(size=(30, 2)) @ root.T
    assert np.mean(np.abs(runs - told.mean)[:, 1:] < 1.96 * told.sd[1:]) > 0.8
    # runs differ by the noise alone; the band holds the errors of the values too
    assert (told.sd[-1] > 0.7 * runs[:, -1].std(axis=0)).all()


def test_a_run_in_words_and_json(found: Estimation) -> None:
    asked = td.Scenario("cold", boundaries={"out": "-5 [degC]"}, start="20 [degC]", duration=DAY)
    told = found.predict(asked)
    assert str(told).splitlines()[1].startswith("  indoor: highest ")
    assert "degC after" in str(told)
    assert told.times.size == 201
    there = json.loads(json.dumps(told.as_object()))
    assert there["units"] == ["K", "K"]
    assert there["mean"][0] == pytest.approx([ICE + 20.0] * 2)
    assert told.sd[0] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert found.predict(asked, start_sd={"wall": "2 [K]"}).sd[0] == pytest.approx([2.0, 0.0], abs=1e-9)


@pytest.mark.parametrize(
    ("change", "more", "code", "match"),
    [
        ({"start": ""}, {}, "value.incomplete", ""),
        ({"boundaries": {}}, {}, "run.input-missing", ""),
        ({}, {"by": "kalman"}, "name.unknown", "'kalman' is not a way"),
        ({}, {"times": [-1.0, 5.0]}, "value.incomplete", ""),
        ({}, {"start_sd": {"out": "1 [K]"}}, "name.unknown", ""),
    ],
)
def test_runs_that_are_refused(found: Estimation, change: dict[str, Any], more: dict[str, Any], code: str, match: str) -> None:
    given = {"boundaries": {"out": "-5 [degC]"}, "start": "20 [degC]", "duration": DAY} | change
    with raises_code(code, match=match):
        found.predict(td.Scenario("cold", **given), **more)


def one_value(case: Case, noise: dict[str, Any], **start_sd: str) -> Estimation:
    """Return the estimation of the outer resistance alone, all else known."""
    starts = {"wall": "0.1 [K]", "indoor": "0.1 [K]"} | start_sd
    return td.inference.estimate(
        house(case.truth.values), case.record, ["Ro"], process_noise=noise, scenario=case.scenario, start_sd=starts
    )


def test_a_walk_that_is_not_there_takes_no_likelihood() -> None:
    """The level of the outside at the start is unknown in both: without the noise both are one model, and the ratio is nothing."""
    quiet = drawn(Truth(TRUTH.values, 1e-9, 0.035), 3, 120, noise_known=True)
    done = one_value(quiet, {"out": "free"})
    assert -0.01 < done.ratio < 4.0
    (assumed,) = done.assumed
    assert re.search(r"\bout .* 10 K", assumed)
    assert f"  assumed: {assumed}" in str(done)
    assert any("'noise of out'" in w for w in done.warnings)
    assert one_value(quiet, {"out": "1e-3 [K/s^0.5]"}, out="1 [K]").assumed == ()


def test_a_boundary_that_is_looked_for_walks_from_there() -> None:
    """Its level has a prior of its own; a second one of 10 K beside it would undo that."""
    case = drawn(replace(TRUTH, sigma_w=1e-9), 4, 60, noise_known=True)
    bare = case.record.select("indoor")
    scenario = case.scenario.with_(boundaries={"out": "15 [degC]"})
    done = td.inference.estimate(
        house(case.truth.values),
        bare,
        ["Ro"],
        process_noise={"out": "1e-3 [K/s^0.5]"},
        scenario=scenario,
        local={"out": {"start": "15 [degC]", "sd": "0.2 [K]"}},
    )
    assert done.assumed == ()
    dynamics = done.process.likelihood.dynamics[0]
    assert dynamics.level_sd(done.process.likelihood.noises[0]) == 0.0
    added, sd = done.states()["added to out"]
    assert (added[0], sd[0]) == (pytest.approx(0.0, abs=1e-9), pytest.approx(0.0, abs=1e-9))


def test_noise_stated_too_small_widens_errors() -> None:
    """Readings scatter five times as much as stated: the error is that of the noise that is there."""
    case = drawn(replace(TRUTH, sigma_w=1e-9, sigma_v=0.1), 6, 120)
    done, known = (
        one_value(
            replace(
                case,
                record=case.record.with_channels(
                    Channel.from_array("indoor", case.record["indoor"].values, unit="K", column="indoor", noise=n)
                ),
            ),
            {"wall": "1e-6 [K/s^0.5]"},
        )
        for n in (0.02, 0.1)
    )
    assert done.process.widened == pytest.approx(5.0, rel=0.15)
    assert done.process.found["Ro"].error == pytest.approx(known.process.found["Ro"].error, rel=0.15)
    assert any(re.search(r" (4\.\d*|5(\.\d*)?) times ", w) for w in done.warnings)
    assert done.as_object()["estimators"]["process noise"]["errors_widened"] == done.process.widened
    assert known.process.widened == 1.0


def test_residuals_that_wander_widen_errors(found: Estimation) -> None:
    """Output error of a wall that noise drives: its readings are not independent, and its errors say so."""
    assert found.output.widened > 3.0
    assert f"{found.output.widened:.2g}" in str(found)
    truth = [abs(np.log(found.output.found[n].value / v)) for n, v in TRUTH.values.items()]
    said = [found.output.found[n].error / found.output.found[n].value for n in VALUES]
    assert (np.array(truth) < 3.0 * np.array(said)).all()


def test_sensors_of_one_node_that_differ_are_named() -> None:
    case = drawn(TRUTH, 2, 60)
    kelvin = case.record["indoor"].values
    both = {
        n: Channel.from_array(n, kelvin + off, unit="K", column=n, role="node", target="indoor", noise=0.035)
        for n, off in (("a", 0.0), ("b", 2.0))
    }
    record = Record.from_arrays("two", case.record.times, {**both, "out": case.record["out"].values}, unit="K")
    done = one_value(replace(case, record=record), {"wall": "1.5e-3 [K/s^0.5]"})
    assert any("'a' and 'b' on 'indoor'" in w and "2 K" in w for w in done.warnings)


@pytest.mark.parametrize(
    ("text", "size", "time", "free"),
    [
        ("0.4 [W] over 20 [min]", 0.4, 1200.0, (False, False)),
        ("free over 5 [min]", 0.5, 300.0, (True, False)),
        ("0.4 [W] over free", 0.4, 3600.0, (False, True)),
        ("free over free", 0.5, 3600.0, (True, True)),
    ],
)
def test_a_noise_that_forgets_in_one_line(text: str, size: float, time: float, free: tuple[bool, bool]) -> None:
    (one,) = read_process({"lid": text}, compile_network(rack()), "t")
    assert (one.kind, one.size, one.time, (one.free, one.free_time)) == ("gauss-markov", size, time, free)


@pytest.mark.parametrize("text", ["0.4 [K] over 20 [min]", "0.4 [W] over 20 [W]", "over 20 [min]", "0.4 [W] over"])
def test_a_line_that_is_no_noise(text: str) -> None:
    with pytest.raises(ThermidError):
        read_process({"lid": text}, compile_network(rack()), "t")


def test_noise_of_a_logged_boundary_is_said_not_to_count() -> None:
    case = drawn(TRUTH, 2, 60, noise_known=True)
    out = case.record["out"].values
    noisy = case.record.with_channels(Channel.from_array("out", out, unit="K", role="boundary", target="out", noise=0.4))
    held = {"wall": "1.5e-3 [K/s^0.5]"}
    done = one_value(replace(case, record=noisy), held)
    (words,) = done.assumed
    assert re.search(r"'out' \(0\.4 K\) .*`calibrate`", words)
    assert one_value(replace(case, record=noisy), {"out": "1e-3 [K/s^0.5]"}, out="0 [K]").assumed == ()
