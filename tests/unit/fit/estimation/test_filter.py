"""Filter and smoother against one dense normal distribution of all states and readings, laid out by other means."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.linalg import block_diag

import thermid as td
from thermid.fit._estimation.estimate import likelihood_of
from thermid.fit._estimation.filtering import smoothed
from thermid.fit._estimation.likelihood import Likelihood
from thermid.fit._estimation.process import read_process
from thermid.fit._problem.gather import build_problem
from thermid.fit._problem.request import Request
from thermid.measure.records import Channel, Record
from thermid.model.tree import TableSignal, model_from_dict
from thermid.simulation.runs import Scenario

from .house import TRUTH, Array, drawn, house, straight, van_loan

ICE = 273.15
NOISES: dict[str, Any] = {
    "plate": "2e-3 [K/s^0.5]",
    "heater": {"kind": "gauss-markov", "size": "0.4 [W]", "time": "20 [min]"},
    "room": {"kind": "wiener", "size": "5e-3 [K/s^0.5]"},
    "lid": {"kind": "gauss-markov", "size": "0.2 [W]", "time": "5 [min]"},
}
SD = {"plate": "0.3 [K]", "box": "0.5 [K]", "lid": "2 [K]", "room": "1 [K]"}


def rack() -> td.Model:
    """Return a plate, a box on it, its lid, and a massless bracket to the room."""
    conductors = {
        "foot": {"kind": "conduction", "between": ["plate", "bracket"], "conductance": "0.8 [W/K]"},
        "wall": {"kind": "conduction", "between": ["bracket", "room"], "conductance": "0.5 [W/K]"},
        "seat": {"kind": "conduction", "between": ["box", "plate"], "conductance": "0.6 [W/K]"},
        "rim": {"kind": "conduction", "between": ["box", "lid"], "conductance": "0.2 [W/K]"},
    }
    nodes = {"plate": {"capacitance": "900 [J/K]"}, "box": {"capacitance": "400 [J/K]"}, "lid": {"capacitance": "150 [J/K]"}, "bracket": {}}
    return model_from_dict(
        {
            "title": "rack",
            "needs": ["room"],
            "nodes": nodes,
            "conductors": conductors,
            "loads": {"heater": {"into": "box", "power": "0 [W]"}},
        }
    )


def rack_log() -> tuple[Record, Scenario]:
    """Return a synthetic log with gaps: box and plate measured at uneven times, the room on its own times within."""
    r = np.random.default_rng(4)
    t = np.cumsum(r.uniform(20.0, 90.0, 40))
    t -= t[0]
    box, plate = (ICE + 25.0 + 5.0 * (1.0 - np.exp(-t / 900.0)) + r.normal(0.0, 0.1, t.size) for _ in range(2))
    box[[5, 6, 20]] = np.nan
    plate[[6, 7, 30, 31]] = np.nan
    record = Record.from_arrays(
        "rack",
        t,
        {
            "box": Channel.from_array("box", box, unit="K", column="box", noise=0.1),
            "plate": Channel.from_array("plate", plate, unit="K", column="plate", noise=0.05),
        },
    )
    knots = np.linspace(0.0, t[-1], 9)
    room = TableSignal(knots, ICE + 22.0 + np.sin(knots / 300.0))
    power = TableSignal(np.array([0.0, 333.0, t[-1]]), np.array([4.0, 1.0, 1.0]), hold=True)
    start = {"box": "25 [degC]", "plate": "25 [degC]", "lid": "25 [degC]"}
    return record, Scenario("rack", boundaries={"room": room}, loads={"heater": power}, initial=start)


def likelihood(model: td.Model, record: Record, scenario: Scenario, noises: dict[str, Any], sd: dict[str, float]) -> Likelihood:
    problem = build_problem(Request(model, (record,), (), {"*": scenario}, name="t", fit_start=False))
    return likelihood_of(problem, read_process(noises, problem.experiments[0].network, "t"), sd)


def dense(likelihood_: Likelihood, scenario: Scenario, model: td.Model) -> tuple[float, Array, Array, Array]:
    """Return log-likelihood, times, smoothed means and standard deviations from the joint normal of all states at all times."""
    space = td.simulation.state_space(td.simulation.compile_network(model))
    order = [space.nodes.index(n) for n in ("plate", "box", "lid")]
    base = space.A[np.ix_(order, order)]
    room, capacity = space.B_boundary[order, 0], space.capacitances[order]
    # states: plate, box, lid, heater's, room's, lid's
    a = block_diag(base, -1.0 / 1200.0, 0.0, -1.0 / 300.0)
    a[1, 3], a[:3, 4], a[2, 5] = 1.0 / capacity[1], room, 1.0 / capacity[2]
    g = np.zeros((6, 4))
    g[0, 0], g[3, 1], g[4, 2], g[5, 3] = 2e-3, 0.4 * np.sqrt(2 / 1200.0), 5e-3, 0.2 * np.sqrt(2 / 300.0)
    signal, watts = scenario.boundaries["room"], scenario.loads["heater"]
    experiment = likelihood_.problem.experiments[0]
    times = np.unique(np.concatenate([experiment.times, signal.times, watts.times]))

    def rate(t: float) -> Array:
        return np.concatenate(
            [room * float(signal.at(np.array([t]))[0]) + np.array([0.0, float(watts.at(np.array([t]))[0]) / capacity[1], 0.0]), np.zeros(3)]
        )

    mean = [np.array([ICE + 25.0] * 3 + [0.0] * 3)]
    covariance = [np.diag([0.3, 0.5, 2.0, 0.4, 1.0, 0.2]) ** 2]
    moves = []
    for begin, end in pairwise(times):
        f, p1, p2 = straight(a, end - begin)
        first, last = rate(begin), rate(end - 1e-9 * (end - begin))
        mean.append(f @ mean[-1] + p1 @ first + p2 @ (last - first))
        covariance.append(f @ covariance[-1] @ f.T + van_loan(a, g, end - begin))
        moves.append(f)
    n, size = 6, times.size
    joint = np.zeros((n * size, n * size))
    for i in range(size):
        block = covariance[i]
        joint[n * i : n * i + n, n * i : n * i + n] = block
        for j in range(i + 1, size):
            block = moves[j - 1] @ block
            joint[n * j : n * j + n, n * i : n * i + n] = block
            joint[n * i : n * i + n, n * j : n * j + n] = block.T
    rows, values, noise = [], [], []
    for o, state in zip(experiment.observations, (1, 0), strict=True):
        for k, y in zip(o.index, o.measured, strict=True):
            row = np.zeros(n * size)
            row[n * int(np.searchsorted(times, experiment.times[k] - 1e-9)) + state] = 1.0
            rows.append(row)
            values.append(y)
            noise.append(o.noise)
    h, whole = np.array(rows), np.concatenate(mean)
    s = h @ joint @ h.T + np.diag(np.square(noise))
    off = np.array(values) - h @ whole
    gain = np.linalg.solve(s, h @ joint).T
    loss = 0.5 * (off @ np.linalg.solve(s, off) + np.linalg.slogdet(2.0 * np.pi * s)[1])
    post = joint - gain @ h @ joint
    return -float(loss), times, (whole + gain @ off).reshape(size, n), np.sqrt(np.diag(post)).reshape(size, n)


def test_filter_and_smoother_against_one_dense_normal() -> None:
    record, scenario = rack_log()
    found = likelihood(rack(), record, scenario, NOISES, {"plate": 0.3, "box": 0.5, "lid": 2.0, "room": 1.0})
    log_likelihood, times, mean, sd = dense(found, scenario, rack())
    assert -found.score(found.start).loss == pytest.approx(log_likelihood, rel=1e-9, abs=1e-9)
    kept = found.passing(0, [found.start]).run(keep=True)
    every = smoothed(kept.last, [leg for way in kept.legs for leg in way])
    dynamics = found.dynamics[0]
    assert dynamics.states == ("plate", "box", "lid", "added to heater", "added to room", "unlogged heat into lid")
    assert kept.times == pytest.approx(times, abs=1e-6)
    assert np.array([b.mean[0] for b in every]) == pytest.approx(mean, rel=1e-9, abs=1e-9)
    assert np.sqrt([b.variance[0] for b in every]) == pytest.approx(sd, rel=1e-9, abs=1e-9)
    assert kept.last.mean[0] == pytest.approx(mean[-1], rel=1e-9, abs=1e-9)  # at the end both have all readings


def test_members_do_not_change_one_another() -> None:
    case = drawn(TRUTH, 5, 60)
    found = likelihood(house(), case.record, case.scenario, {"wall": "1.5e-3 [K/s^0.5]"}, {"wall": 0.1, "indoor": 0.1})
    few = found.passing(0, [found.start, found.start]).run(keep=True)
    fast = found.passing(0, [found.start]).run()
    assert fast.innovations.errors[:, 0] == pytest.approx(few.innovations.errors[:, 1], rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("count", [50, 200, 333])
def test_steps_that_are_all_alike_are_taken_at_once(count: int) -> None:
    """The gains settle; what then is taken in blocks is what step by step gives."""
    case = drawn(TRUTH, count, count)
    found = likelihood(house(), case.record, case.scenario, {"wall": "1.5e-3 [K/s^0.5]"}, {"wall": 0.1, "indoor": 0.1})
    slow, fast = found.passing(0, [found.start]).run(keep=True), found.passing(0, [found.start]).run()
    assert fast.innovations.times == pytest.approx(slow.innovations.times)
    assert fast.innovations.errors == pytest.approx(slow.innovations.errors, abs=1e-9)
    assert fast.innovations.variances == pytest.approx(slow.innovations.variances, rel=1e-9)
    assert fast.last.mean == pytest.approx(slow.last.mean, abs=1e-9)


def test_without_noise_the_filter_is_the_run() -> None:
    """No process noise and a start that is known: what is foreseen is what `simulate` says."""
    case = drawn(TRUTH, 9, 100)
    found = likelihood(house(), case.record, case.scenario, {}, {"wall": 0.0, "indoor": 0.0})
    innovations = found.passing(0, [found.start]).run().innovations
    run = td.simulate(
        house(),
        case.scenario.with_(boundaries=found.problem.experiments[0].scenario.boundaries, duration=float(case.record.times[-1])),
        times=case.record.times,
    )
    assert case.record["indoor"].values - innovations.errors[:, 0] == pytest.approx(run["indoor"].kelvin, abs=2e-5)
