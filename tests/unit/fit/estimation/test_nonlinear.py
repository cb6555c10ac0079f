"""The extended filter on radiation and natural convection, against an unscented one on equations written out by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import thermid as td
from by_code import raises_code
from thermid.fit._estimation.estimate import likelihood_of
from thermid.fit._estimation.process import read_process
from thermid.fit._problem.gather import build_problem
from thermid.fit._problem.request import Request
from thermid.measure.records import Channel, Record
from thermid.model.tree import model_from_dict
from thermid.simulation.runs import Scenario

from .house import VALUES, Array, Truth, drawn, house, van_loan

ROOM, SIGMA = 293.15, 5.670374419e-8
TRUTH = Truth({n: v for n, (v, _) in VALUES.items()}, 1.5e-3, 0.035)
CAPACITY = np.array([500.0, 800.0])
JOINT, CONVECTS, RADIATES, POWER = 0.4, 0.35, 0.03, 25.0


def heat(t: Array) -> Array:
    """Return the net heat of plate and core. [W]"""
    plate, core = t
    out = CONVECTS * np.sign(plate - ROOM) * np.abs(plate - ROOM) ** 1.25 + SIGMA * RADIATES * (plate**4 - ROOM**4)
    return np.array([JOINT * (core - plate) - out, POWER - JOINT * (core - plate)])


def jacobian(t: Array) -> Array:
    plate = t[0]
    slope = 1.25 * CONVECTS * np.abs(plate - ROOM) ** 0.25 + 4.0 * SIGMA * RADIATES * plate**3
    return np.array([[-JOINT - slope, JOINT], [JOINT, -JOINT]]) / CAPACITY[:, None]


def later(t: Array, seconds: float) -> Array:
    return np.asarray(solve_ivp(lambda _, y: heat(y) / CAPACITY, (0.0, seconds), t, rtol=1e-9, atol=1e-9).y[:, -1])


def model(radiates: float = RADIATES) -> td.Model:
    return model_from_dict(
        {
            "title": "hot plate",
            "needs": ["room"],
            "nodes": {"plate": {"capacitance": "500 [J/K]"}, "core": {"capacitance": "800 [J/K]"}},
            "conductors": {
                "joint": {"kind": "conduction", "between": ["plate", "core"], "conductance": "0.4 [W/K]"},
                "air": {
                    "kind": "convection",
                    "between": ["plate", "room"],
                    "area": "1 [m^2]",
                    "htc": {"coefficient": f"{CONVECTS} [W/(m^2 K)]", "exponent": 0.25},
                },
                "sky": {"kind": "radiation", "between": ["plate", "room"], "area": f"{radiates} [m^2]", "emissivity": 1.0},
            },
            "loads": {"heater": {"into": "core", "power": f"{POWER} [W]"}},
        }
    )


def unscented(times: Array, read: Array, g: Array, noise: float, mean: Array, covariance: Array) -> tuple[Array, Array]:
    """Return filtered means and standard deviations (times, 2) (Julier and Uhlmann, Proc. IEEE 92 (2004) 401)."""
    means, sds = [], []
    n, kappa = 2, 1.0
    weights = np.array([kappa, *[0.5] * (2 * n)]) / (n + kappa)
    for k, y in enumerate(read):
        if k:
            root = np.linalg.cholesky((n + kappa) * covariance)
            points = np.array([later(p, times[k] - times[k - 1]) for p in (mean, *(mean + root.T), *(mean - root.T))])
            added = van_loan(jacobian(mean), g, times[k] - times[k - 1])
            mean = weights @ points
            covariance = (points - mean).T @ (weights[:, None] * (points - mean)) + added
        gain = covariance[:, 0] / (covariance[0, 0] + noise**2)
        mean = mean + gain * (y - mean[0])
        covariance = covariance - np.outer(gain, covariance[0])
        means.append(mean)
        sds.append(np.sqrt(np.diag(covariance)))
    return np.array(means), np.array(sds)


@pytest.fixture(scope="module")
def log() -> tuple[Array, Array, Array]:
    """Return times, readings of the plate and the true core of a synthetic run with noise on the core."""
    r = np.random.default_rng(12)
    times = 60.0 * np.arange(60)
    state, states = np.array([ROOM + 1.0, ROOM + 3.0]), []
    for k in range(times.size):
        states.append(state)
        for _ in range(6 if k + 1 < times.size else 0):
            state = later(state, 10.0) + np.array([0.0, 0.02 * np.sqrt(10.0)]) * r.normal(size=2)
    both = np.array(states)
    return times, both[:, 0] + r.normal(0.0, 0.1, times.size), both[:, 1]


def test_extended_filter_against_unscented(log: tuple[Array, Array, Array]) -> None:
    times, read, core = log
    record = Record.from_arrays("hot", times, {"plate": Channel.from_array("plate", read, unit="K", column="plate", noise=0.1)})
    scenario = Scenario("hot", boundaries={"room": "20 [degC]"}, initial={"plate": "21 [degC]", "core": "23 [degC]"})
    problem = build_problem(Request(model(), (record,), (), {"*": scenario}, name="hot", fit_start=False))
    noises = read_process({"core": "0.02 [K/s^0.5]"}, problem.experiments[0].network, "hot")
    likelihood = likelihood_of(problem, noises, {"plate": 1.0, "core": 3.0})
    dynamics = likelihood.dynamics[0]
    assert not dynamics.linear
    kept = likelihood.passing(0, [likelihood.start]).run(keep=True)
    order = [dynamics.states.index(n) for n in ("plate", "core")]
    mean = np.array([b.mean[0] for b in kept.beliefs])[:, order]
    sd = np.sqrt([b.variance[0] for b in kept.beliefs])[:, order]
    g = np.array([[0.0], [0.02]])
    other, spread = unscented(times, read, g, 0.1, np.array([294.15, 296.15]), np.diag([1.0, 9.0]))
    assert np.abs(mean - other).max() < 0.1 * spread[:, 1].max()
    assert sd == pytest.approx(spread, rel=0.06)
    assert np.abs(mean[5:] - other[5:]).max() < 0.03
    assert np.mean(np.abs(mean[:, 1] - core) < 1.96 * sd[:, 1]) > 0.85


def test_extended_mean_without_noise_is_the_run() -> None:
    """Steps are halved until what rates bend is small: the mean then is what the kernel integrates."""
    times = 300.0 * np.arange(40)
    record = Record.from_arrays(
        "hot", times, {"plate": Channel.from_array("plate", np.full(40, 300.0), unit="K", column="plate", noise=0.1)}
    )
    scenario = Scenario(
        "hot", boundaries={"room": "20 [degC]"}, initial={"plate": "20 [degC]", "core": "20 [degC]"}, duration=float(times[-1])
    )
    problem = build_problem(Request(model(), (record,), (), {"*": scenario}, name="hot", fit_start=False))
    likelihood = likelihood_of(problem, (), {"plate": 0.0, "core": 0.0})
    found = likelihood.passing(0, [likelihood.start]).run().innovations
    run = td.simulate(model(), scenario, times=times)
    assert 300.0 - found.errors[:, 0] == pytest.approx(run["plate"].kelvin, abs=5e-3)


def test_a_linear_network_is_the_same_by_both_ways() -> None:
    """Linearised anew at every step, a linear network gives what its one Jacobian gives."""
    case = drawn(TRUTH, 2, 80)
    problem = build_problem(Request(house(), (case.record,), (), {"*": case.scenario}, name="t", fit_start=False))
    noises = read_process({"wall": "1.5e-3 [K/s^0.5]"}, problem.experiments[0].network, "t")
    found = likelihood_of(problem, noises, {"wall": 0.1, "indoor": 0.1})
    exact = found.score(found.start).loss
    found.dynamics[0].linear = False
    assert found.score(found.start).loss == pytest.approx(exact, rel=1e-9)


def test_rates_of_many_members_are_those_of_each(log: tuple[Array, Array, Array]) -> None:
    """With what noises of every place and kind add, at two states; to the last digit."""
    times, read, _ = log
    record = Record.from_arrays("hot", times, {"plate": Channel.from_array("plate", read, unit="K", column="plate", noise=0.1)})
    scenario = Scenario("hot", boundaries={"room": "20 [degC]"}, initial={"plate": "21 [degC]", "core": "23 [degC]"})
    problem = build_problem(Request(model(), (record,), (), {"*": scenario}, name="hot", fit_start=False))
    several = {
        "room": {"kind": "gauss-markov", "size": "0.5 [K]", "time": "2 [h]"},
        "core": {"kind": "gauss-markov", "size": "0.3 [W]", "time": "1 [h]"},
        "heater": "0.01 [W/s^0.5]",
        "plate": "0.01 [K/s^0.5]",
    }
    noises = read_process(several, problem.experiments[0].network, "hot")
    likelihood = likelihood_of(problem, noises, {"plate": 1.0, "core": 3.0})
    dynamics, passing = likelihood.dynamics[0], likelihood.passing(0, [likelihood.start, likelihood.start])
    states = passing.start().mean + np.random.default_rng(1).normal(0.0, 3.0, (2, dynamics.size))
    rates, jacobians = dynamics.rates(passing.members, states, 30.0)
    each = [dynamics.local(m, state, 30.0) for m, state in zip(passing.members, states, strict=True)]
    assert np.array_equal(rates, [one.rates for one in each])
    assert np.array_equal(jacobians, [one.jacobian for one in each])
    assert (np.abs(jacobians[0]).sum(axis=0) > 0.0).all()  # each state, those of the noises among them, acts on a rate


CONTROLS: dict[str, dict[str, Any]] = {
    "thermostat": {"follows": "case", "thermostat": {"on_below": "28 [degC]", "off_above": "32 [degC]"}},
    "modes": {
        "follows": "case",
        "modes": {"low": 0.2, "full": 1},
        "starts": "low",
        "transitions": {
            "up": {"from": "low", "to": "full", "below": "27 [degC]"},
            "down": {"from": "full", "to": "low", "above": "30 [degC]"},
        },
    },
    "pid": {"follows": "case", "pid": {"setpoint": "32 [degC]", "band": "6 [K]", "integral_time": "4 [min]"}},
    "sampled": {"follows": "case", "proportional": {"setpoint": "32 [degC]", "band": "6 [K]"}, "sample": "1 [min]"},
    "proportional": {"follows": "case", "proportional": {"setpoint": "32 [degC]", "band": "6 [K]"}},
    "table": {"follows": "case", "table": {"points": [["25 [degC]", "1"], ["35 [degC]", "0"]]}},
}


def controlled(kind: str) -> td.Model:
    """Return a chip in a case, its heater under a control, two levels down."""
    unit = {
        "title": "unit",
        "needs": ["air"],
        "nodes": {"chip": {"capacitance": "100 [J/K]"}, "case": {"capacitance": "300 [J/K]"}},
        "conductors": {
            "pad": {"kind": "conduction", "between": ["chip", "case"], "conductance": "1.5 [W/K]"},
            "out": {"kind": "conduction", "between": ["case", "air"], "conductance": "0.5 [W/K]"},
        },
        "loads": {"heater": {"into": "chip", "power": "10 [W]", "control": kind}},
        "controls": {kind: CONTROLS[kind]},
    }
    return model_from_dict({"title": "rig", "needs": ["air"], "submodels": {"u": {"use": model_from_dict(unit), "bind": {"air": "air"}}}})


def controlled_log(rig: td.Model) -> tuple[Record, Scenario]:
    times = 30.0 * np.arange(60)
    scenario = Scenario("run", boundaries={"air": "20 [degC]"}, start="22 [degC]", duration=float(times[-1]))
    kelvin = td.simulate(rig, scenario, times=times)["u.case"].kelvin + 0.05 * np.random.default_rng(1).normal(size=60)
    return Record.from_arrays(
        "run", times, {"c": Channel.from_array("c", kelvin, unit="K", role="node", target="u.case", noise=0.05)}
    ), scenario


@pytest.mark.parametrize("kind", ["thermostat", "modes", "pid", "sampled"])
def test_controls_with_a_history_are_refused(kind: str) -> None:
    """The filter would hold them as they began, without a word: a joint of 1.5 W/K was found at 0.03."""
    rig = controlled(kind)
    record, scenario = controlled_log(rig)
    with raises_code("model.element-not-supported", match=f"'u.{kind}'"):
        td.inference.estimate(rig, record, ["u.pad.conductance"], process_noise={"u.case": "1e-6 [K/s^0.5]"}, scenario=scenario)


@pytest.mark.parametrize("kind", ["proportional", "table"])
def test_controls_without_a_history_are_filtered(kind: str) -> None:
    rig = controlled(kind)
    record, scenario = controlled_log(rig)
    problem = build_problem(Request(rig, (record,), (), {"*": scenario}, name="rig", fit_start=False))
    likelihood = likelihood_of(problem, read_process({"u.case": "1e-7 [K/s^0.5]"}, problem.experiments[0].network, "rig"), {})
    innovations = likelihood.passing(0, [likelihood.start]).run().innovations
    assert np.sqrt(np.mean(innovations.standard**2)) < 1.3
