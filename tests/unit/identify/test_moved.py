"""Whether what a level below found had to move above: the test against the closed form, and what it says."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from thermid.identify.calibrate import fit
from thermid.identify.calibration import Calibration
from thermid.identify.moved import moves_from
from thermid.identify.moves import Moves
from thermid.identify.request import Request
from thermid.identify.values import FittedValue, FittedValues
from thermid.measure import Record
from thermid.model.model import Model
from unit.identify.bench import HTC, box, log, pair

FREE = ("a.power", "b.power")
LINEAR = {"parameters/power/min": 0}


@pytest.fixture(scope="module")
def stack() -> Model:
    return pair(first=box(LINEAR), second=box({**LINEAR, "parameters/power/value": "2 [W]", "nodes/case/mass/value": "0.8 [kg]"}))


def bench(stack: Model, seed: int, watts: float = 4.4, noise: float = 0.3, bias: dict[str, float] | None = None) -> Record:
    """Two sensors on the pair, 61 samples; the noise stated is 0.4 K."""
    truth, nodes = {"a.power": f"{watts} [W]", "b.power": "1.8 [W]"}, {"A": "a.case", "B": "b.case"}
    size = 0.4 if bias else noise
    data = log(stack, truth, nodes, boundary="room", noise=size, accuracy=0.4, bias=bias, seed=seed, samples=61, hours=3.0, name=f"r{seed}")
    return data.with_channels(*(replace(data[s], noise=0.4) for s in "AB"))


@pytest.fixture(scope="module")
def below(stack: Model) -> Calibration:
    return fit(Request(stack, (bench(stack, 1),), FREE, name="below"))


@pytest.fixture(scope="module")
def above(stack: Model, below: Calibration) -> Calibration:
    found = fit(Request(stack, (bench(stack, 2),), FREE, store=below.store, prior=FREE, name="above"))
    assert found.reduced_chi_square < 1
    return found


def test_the_shift_is_measured_by_the_difference_of_the_variances(below: Calibration, above: Calibration) -> None:
    for path in FREE:
        move = above.moved[path]
        assert (move.stage, move.part, move.below) == ("below", path[0], pytest.approx(below[path].value, abs=1e-6))
        expected = (above[path].value - below[path].value) / math.sqrt(below[path].error ** 2 - above[path].error ** 2)
        assert move.deviations == pytest.approx(expected, rel=2e-3)
        assert move.chance == pytest.approx(2 * (1 - 0.5 * (1 + math.erf(abs(expected) / math.sqrt(2)))), rel=0.02)


def test_the_group_counts_correlations(below: Calibration, above: Calibration) -> None:
    rows = [0, 1]
    spread = (below.values.covariance - above.values.covariance)[np.ix_(rows, rows)]
    shift = np.array([above[p].value - below[p].value for p in FREE])
    group = above.moved.groups[-1]
    assert (group.name, group.directions, group.paths) == ("all together", 2, FREE)
    assert group.chi_square == pytest.approx(float(shift @ np.linalg.solve(spread, shift)), rel=5e-3)
    assert group.chance == pytest.approx(float(chi2.sf(group.chi_square, 2)))
    assert [g.name for g in above.moved.groups] == ["part 'a'", "part 'b'", "all together"]


def test_same_hardware_holds_other_hardware_had_to_move(stack: Model, below: Calibration, above: Calibration) -> None:
    assert above.moved.had_to_move == ()
    assert not any("had to move" in w for w in above.warnings)
    other = fit(Request(stack, (bench(stack, 3, 4.7),), FREE, store=below.store, prior=FREE, name="above"))
    assert other.moved["a.power"].verdict == "had to move"
    assert other.moved.had_to_move == ("a.power", "part 'a'", "all together")
    assert any("what the stage below handed on for a.power, b.power had to move: chi-square" in w for w in other.warnings)
    assert "  against the stages below:" in str(other)
    assert "W (+" in str(other.moved["a.power"])


def test_chance_is_uniform_when_nothing_moved(stack: Model) -> None:
    """Sixty pairs of tests of one unit: the chance of the group falls below 10, 50 and 90 % about as often."""
    found = []
    for seed in range(60):
        rng = np.random.default_rng([7, seed])
        bias = {s: 0.4 * rng.standard_normal() for s in "AB"}
        one, two = (bench(stack, int(rng.integers(1 << 30)), bias=bias) for _ in range(2))
        first = fit(Request(stack, (one,), FREE, name="below"))
        found.append(fit(Request(stack, (two,), FREE, store=first.store, prior=FREE)).moved.groups[-1].chance)
    shares = [np.mean(np.array(found) < level) for level in (0.1, 0.5, 0.9)]
    for share, level in zip(shares, (0.1, 0.5, 0.9), strict=True):
        assert abs(share - level) < 3 * math.sqrt(level * (1 - level) / 60)


def wandering(data: Record, rng: np.random.Generator, size: float, time: float) -> Record:
    """Return a log with a slow error on every sensor: standard deviation [K] and correlation time [s]."""
    tie = np.exp(-np.diff(data.times) / time)
    made = []
    for name in "AB":
        slow = size * rng.standard_normal(data.times.size)
        for k, phi in enumerate(tie, 1):
            slow[k] = phi * slow[k - 1] + math.sqrt(1 - phi**2) * slow[k]
        made.append(replace(data[name], values=data[name].values + slow))
    return data.with_channels(*made)


def test_chance_is_not_small_where_residuals_wander_and_nothing_moved(stack: Model) -> None:
    """Slow errors of 0.5 K move values; a test that took residuals for white has a quarter of them below 5 %."""
    found = []
    for seed in range(20):
        rng = np.random.default_rng([8, seed])
        one, two = (wandering(bench(stack, int(rng.integers(1 << 30))), rng, 0.5, 1200.0) for _ in range(2))
        first = fit(Request(stack, (one,), FREE, name="below"))
        second = fit(Request(stack, (two,), FREE, store=first.store, prior=FREE))
        found.append(second.moved.groups[-1].chance)
    assert np.sum(np.array(found) < 0.05) <= 3
    assert 0.2 < np.median(found) < 0.8


def test_a_part_on_which_the_level_above_says_nothing(stack: Model) -> None:
    """Its mass does not act where nothing changes with time."""
    part = box()
    below = fit(Request(part, (log(part, {}, {"A": "case"}, samples=61),), (HTC, "case.mass"), name="box"))
    rested = log(part, {}, {"A": "case"}, samples=31, start="24 [degC]", hours=60.0, seed=4).trim(45 * 3600.0)
    above = fit(Request(part, (rested,), store=below.store, prior=(HTC, "case.mass"), name="rest"))
    assert abs(above.moved["case.mass"].deviations) < 3 or math.isnan(above.moved["case.mass"].deviations)
    assert math.isfinite(above.moved[HTC].deviations)


def _values(stage: str, rows: dict[str, tuple[float, float]]) -> FittedValues:
    items = {p: FittedValue(p, v, e, e, False, "W", v, (0.0, 9.0)) for p, (v, e) in rows.items()}
    return FittedValues(stage, items, np.diag([e**2 for _, e in rows.values()]))


def test_against_a_joint_fit() -> None:
    staged, joint = _values("box", {"p": (2.0, 0.5), "q": (3.0, 0.1)}), _values("joint", {"a.p": (2.8, 0.3), "a.q": (3.1, 0.2)})
    moves = moves_from([(staged, {"p": "a.p", "q": "a.q"})], joint, lambda path: path[0])
    assert moves["a.p"].deviations == pytest.approx(0.8 / 0.4)
    assert moves["a.q"].deviations == pytest.approx(1.0)  # the joint fit knows it no better: the stage's own error counts
    assert moves.groups[-1].chi_square == pytest.approx(2.0**2 + 1.0**2)
    assert moves["a.p"].verdict == "may have moved"


def test_nothing_handed_on() -> None:
    assert not Moves()
    assert list(Moves().lines()) == []
