"""A sensor laid on a model: where it sits, what it adds, exact derivatives, and names that lead nowhere."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.fit._calibrate import calibrate, without_lags
from thermid.fit._minimisation import covariances, minimise
from thermid.fit._problem.experiment import Seat, attached, sensor_model
from thermid.fit._problem.gather import build_problem
from thermid.fit._problem.request import Request
from thermid.fit._uncertainty.noise import shifts_by_lags
from thermid.measure.records import Record
from thermid.model.tree import model_from_dict
from two_masses import DECK
from unit.fit.bench import HTC, box, log


def worn(**keys: object) -> Record:
    return log(box(), {}, {"T": "case"}, noise=0.05, accuracy=0.2, seed=2).with_sensor("T", **keys)


def test_a_sensor_is_a_model_of_the_bench() -> None:
    part = td.bench.SensorPart(lag=20.0, capacitance=2.0, lead_conductance=0.001, lead_to="air")
    made = sensor_model(part)
    assert made.needs == ("seat", "far")
    assert all(e.test_only for _, _, e in made.elements())
    assert not made.without_test_only().nodes


def test_leads_of_a_sensor_without_heat_capacity_take_heat_from_its_node() -> None:
    """A bead of no heat capacity is tied by next to nothing: leads on it would have it read the room."""
    keys = {"lag": "60 [s]", "lead": {"conductance": "1 [mW/K]", "to": "air"}}
    assert sensor_model(td.bench.SensorPart.read(keys, "T")).conductors["lead"].between == ("seat", "far")  # type: ignore[arg-type]
    heavy = td.bench.SensorPart.read({**keys, "capacitance": "2 [J/K]"}, "T")
    assert heavy is not None
    assert sensor_model(heavy).conductors["lead"].between == ("tip", "far")


def test_it_is_attached_where_its_channel_says_at_any_depth() -> None:
    inner = box()
    outer = td.model_from_dict({"title": "outer", "needs": ["room"], "submodels": {"box": {"use": inner, "bind": {"air": "room"}}}})
    data = worn(lag="20 [s]", lead={"conductance": "1 [mW/K]", "to": "room"})
    moved = data.with_channels(td.Channel.from_array("T", data["T"].values, unit="K", role="node", target="box.case", part=data["T"].part))
    whole, seats = attached(outer, moved)
    assert seats == {"T": Seat("box.case", "sensor_T.tip", "sensor_T.lag")}
    assert set(whole.submodels) == {"box", "sensor_T"}
    assert set(outer.submodels) == {"box"}
    plain = log(box(), {}, {"T": "case"})
    assert attached(inner, plain) == (inner, {})


def test_leads_that_end_nowhere_are_refused() -> None:
    with raises_code("name.unknown", match="'aire'.*'air'"):
        calibrate(box(), worn(lead={"conductance": "1 [mW/K]", "to": "aire"}), [HTC])


def test_derivatives_of_scale_and_lag_are_exact_and_the_compressed_rows_hold_them() -> None:
    found = calibrate(box(), worn(gain_accuracy="1 [%]", lag="40 [s]", lag_accuracy="20 [s]"), [HTC])
    assert found.problem is not None
    problem, x = replace(found.problem, options=td.Options()), np.array(list(found.fitted.values()))
    assert {"scale of T", "lag of T"} <= set(found.fitted)
    slopes = problem.jacobian(x)
    for k in range(x.size):
        h = 1e-3 * problem.unknowns[k].scale
        step = np.eye(x.size)[k] * h
        quotient = (problem.residuals(x + step) - problem.residuals(x - step)) / (2 * h)
        assert quotient == pytest.approx(slopes[:, k], abs=2e-4 * np.abs(slopes[:, k]).max())
    packed = problem.compressed(x)
    assert packed.slopes.T @ packed.slopes == pytest.approx(slopes.T @ slopes, rel=1e-6)
    assert packed.slopes.T @ packed.rows == pytest.approx(slopes.T @ problem.residuals(x), abs=1e-6 * np.abs(slopes).max() * x.size * 100)


def test_what_they_make_uncertain_is_said() -> None:
    found = calibrate(box(), worn(gain_accuracy="2 [%]"), [HTC])
    (share,) = found.instrument_shares
    assert (share.name, share.stated) == ("scale of T", (0.0, 0.02))
    assert re.search(rf" T: 0 \+- 2 % .* {100 * share.found[0]:.3g} \+- {100 * share.found[1]:.2g} %", str(found))


def test_a_forgotten_lag_is_asked_for_by_what_it_would_move() -> None:
    """With 5 s forgotten a heat capacity was 49.7 +- 1.1 for 44 J/K, credible and without a word."""
    model = model_from_dict(DECK)
    times, bench = np.arange(0.0, 3601.0, 30.0), {"boundaries": {"room": "23 [degC]"}, "loads": {"heater": "5 [W]"}}
    run = td.simulate(model, td.Scenario("on", **bench, start="23 [degC]", duration="1 [h]"), times=np.arange(0.0, 3601.0, 1.0))
    rng, fields = np.random.default_rng(5), {"unit": "K", "role": "node", "noise": 0.02}
    late = {n: np.interp(times - 5.0, run.times, run[n].kelvin) + rng.normal(0.0, 0.02, times.size) for n in ("board", "case")}
    data = td.Record.from_arrays("log", times, {n: td.Channel.from_array(n, late[n], target=n, **fields) for n in late})
    free, scenarios = ("board.capacitance", "joint.contact_conductance"), {"*": td.Scenario("on", **bench, start="23 [degC]")}
    known = data.with_sensor("board", lag="5 [s]").with_sensor("case", lag="5 [s]")
    forgotten, stated = (build_problem(Request(model, (d,), free, scenarios)) for d in (data, known))
    wrong, right = (minimise(problem, "linear", 1.0) for problem in (forgotten, stated))
    names, lag, shifts = shifts_by_lags(forgotten, wrong, 5.0)
    assert names == ["board", "case"]
    assert 3.0 < lag < 7.0  # by differences of readings 30 s apart
    at = [k for k, u in enumerate(forgotten.unknowns) if u.kind == "parameter"]
    assert 5.0 * shifts[at] / lag == pytest.approx((wrong.fitted - right.fitted)[at], rel=0.25)
    said = without_lags(forgotten, wrong, covariances(wrong)[2])
    assert [s.startswith("check: 'board' and 'case' ") for s in said] == [True]
    assert without_lags(stated, right, covariances(right)[2]) == []
    prompt = {n: np.interp(times, run.times, run[n].kelvin) + rng.normal(0.0, 0.02, times.size) for n in ("board", "case")}
    at_once = td.Record.from_arrays("log", times, {n: td.Channel.from_array(n, prompt[n], target=n, **fields) for n in prompt})
    problem = build_problem(Request(model, (at_once,), free, scenarios))
    end = minimise(problem, "linear", 1.0)
    # readings that show that nothing lags are not asked about; with 5 s taken for possible whatever they show, all were
    assert shifts_by_lags(problem, end, 5.0)[1] < 1.0
