"""What the logs of a level say of inherited values: the shift, its error, the words, and that nothing is called agreement without power."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from thermid.campaign.stages import run_stages
from thermid.fit._calibrate import STRAINED, fit
from thermid.fit._calibration import Calibration
from thermid.fit._problem.request import Request
from thermid.fit._uncertainty.moved import UNDECIDED, Move, MovedGroup, Moves, moves_from
from thermid.measure.records import Record
from thermid.model.tree import Model
from thermid.values.store import FittedValue, FittedValues, Store
from unit.fit.bench import HTC, MASS, box, log, pair
from unit.fit.project import make_project, write_log

pytestmark = pytest.mark.usefixtures("errors_in_turn")

FREE = ("a.power", "b.power")
LINEAR = {"parameters/power/min": 0}


@pytest.fixture(scope="module")
def stack() -> Model:
    return pair(first=box(LINEAR), second=box({**LINEAR, "parameters/power/value": "2 [W]", "nodes/case/mass/value": "0.8 [kg]"}))


def bench(stack: Model, seed: int, watts: float = 4.4) -> Record:
    """Two sensors on the pair, 61 samples; the noise stated is 0.4 K and is 0.3 K."""
    truth, nodes = {"a.power": f"{watts} [W]", "b.power": "1.8 [W]"}, {"A": "a.case", "B": "b.case"}
    data = log(stack, truth, nodes, boundary="room", noise=0.3, accuracy=0.4, seed=seed, samples=61, hours=3.0, name=f"r{seed}")
    return data.with_channels(*(replace(data[s], noise=0.4) for s in "AB"))


@pytest.fixture(scope="module")
def below(stack: Model, errors_in_turn: str) -> Calibration:
    return fit(Request(stack, (bench(stack, 1),), FREE, name="below"))


def above(stack: Model, below: Calibration, data: Record, fixed: bool = False) -> Calibration:
    """Return the fit of another log, which inherits both powers."""
    if fixed:
        return fit(Request(below.model, (data,), (), store=below.store, name="above"))
    return fit(Request(stack, (data,), FREE, store=below.store, prior=FREE, name="above"))


def test_the_shift_is_that_of_the_log_alone_and_its_error_counts_both(stack: Model, below: Calibration) -> None:
    data = bench(stack, 2)
    found, alone = above(stack, below, data), fit(Request(stack, (data,), FREE))
    for path in FREE:
        move = found.moved[path]
        assert (move.stage, move.part, move.here) == ("below", path[0], found[path].value)
        # both logs have the accuracies of the same sensors, which a difference does not hold
        error = math.hypot(below[path].error_random, alone[path].error_random)
        assert abs(move.alone - alone[path].value) < error
        assert 0.6 < (move.alone - move.below) / move.deviations / error < 1.5
    assert found.moved.moved == ()


def test_from_is_what_the_stage_below_printed(stack: Model, below: Calibration) -> None:
    found = above(stack, below, bench(stack, 2))
    for path in FREE:
        (line,) = (line for line in str(below).splitlines() if line.startswith(f"  {path} "))
        assert found.moved[path].below == below[path].value
        assert f"{path}  {line.split()[1]} -> " in str(found)


def test_fixed_values_are_tested_like_priors(stack: Model, below: Calibration) -> None:
    for seed, watts in ((2, 4.4), (3, 5.0)):
        data = bench(stack, seed, watts)
        prior, fixed = above(stack, below, data), above(stack, below, data, fixed=True)
        for path in FREE:
            assert fixed.moved[path].alone == pytest.approx(prior.moved[path].alone, rel=0.01)
            assert fixed.moved[path].deviations == pytest.approx(prior.moved[path].deviations, rel=0.1, abs=0.1)
            assert fixed.moved[path].verdict == prior.moved[path].verdict
        assert fixed.moved["a.power"].here == below["a.power"].value


def test_a_value_that_moved_and_its_neighbour_that_did_not(stack: Model, below: Calibration) -> None:
    other = above(stack, below, bench(stack, 3, 5.0))
    assert other.moved["a.power"].verdict == "moved"
    assert other.moved["b.power"].verdict != "moved", "once the first is free, nothing is left that the second would explain"
    assert other.moved.moved == ("a.power", "all together")
    (warning,) = (w for w in other.warnings if "a.power (+" in w)
    assert warning.endswith(other.moved["a.power"].remedy), "lags and clocks of its logs may be the cause as well"
    assert re.search(r"\n  .* -> .*:\n    a\.power", str(other))
    assert re_power(other.moved["a.power"])


@pytest.mark.usefixtures("errors_in_full_here")
def test_a_value_far_from_what_a_stage_below_found_is_not_adequate(stack: Model, below: Calibration) -> None:
    """What the logs alone ask for counts: where its prior holds a value is near, and such fits were credible however far they disagreed."""
    near, *far = (above(stack, below, bench(stack, 3, watts), fixed) for watts, fixed in ((4.4, False), (5.0, False), (5.0, True)))
    assert near.own.state == "credible"
    assert abs(far[0]["a.power"].value - below["a.power"].value) < below["a.power"].error
    for one in far:
        assert one.moved["a.power"].deviations > STRAINED
        assert one.own.state == "not adequate"
        assert one.own.because.startswith("a.power, ")


def re_power(move: Move) -> bool:
    return "90 %" in str(move) and "W (+" in str(move)


def deviating(data: Record, seed: int, size: float, time: float, sensors: str) -> Record:
    """Return a log with an autocorrelated error on some sensors: standard deviation [K] and correlation time [s]."""
    rng, made = np.random.default_rng([8, seed]), []
    tie = np.exp(-np.diff(data.times) / time)
    for name in sensors:
        slow = size * rng.standard_normal(data.times.size)
        for k, phi in enumerate(tie, 1):
            slow[k] = phi * slow[k - 1] + math.sqrt(1 - phi**2) * slow[k]
        made.append(replace(data[name], values=data[name].values + slow))
    return data.with_channels(*made)


@pytest.mark.parametrize("how", [pytest.param("fixed", marks=pytest.mark.campaign), "prior"])
def test_through_a_campaign(how: str, tmp_path: Path) -> None:
    project = make_project(tmp_path)
    project.write_text(project.read_text().replace('as = "fixed"', f'as = "{how}"'))
    same = run_stages(project)
    assert [m.path for m in same["pair"].moved.values] == [f"a.{HTC}", f"a.{MASS}"]
    assert same["pair"].moved.moved == ()
    heavy = log(box(), {HTC: "5 [W/(m^2 K)]", MASS: "2.6 [kg]"}, {"T_A": "case"})
    write_log(heavy, tmp_path / "logs" / "box_bench.csv")
    other = run_stages(project)
    assert other["pair"].moved[f"a.{MASS}"].verdict == "moved"
    assert other["pair"].moved[f"a.{MASS}"].alone == pytest.approx(1.7, rel=0.1)
    printed = next(line.split()[1] for line in str(other["box"]).splitlines() if line.startswith(f"  {MASS} "))
    assert f"a.{MASS}  {printed} -> 1." in str(other["pair"])


@pytest.mark.parametrize("fixed", [False, True])
def test_half_as_much_mass_again_is_never_called_agreement(fixed: bool) -> None:
    """A mass of 0.711 kg below and 1.044 kg above was called held once residuals wandered, 0.3 standard deviations."""
    part = box({"nodes/case/mass/value": "0.7 [kg]", "nodes/case/mass/min": 0.2})
    first = fit(Request(part, (log(part, {MASS: "0.7095 [kg]"}, {"T": "case"}, noise=0.15),), (HTC, MASS), name="component"))
    told = []
    for seed, size in ((0, 0.3), (1, 0.6), (1, 2.0), (3, 2.0)):
        hidden = log(part, {MASS: "1.044 [kg]"}, {"T": "case"}, seed=seed + 10, hours=4.0, samples=241)
        data = deviating(hidden, seed, size, 1800.0, "T")
        more = {} if fixed else {"prior": (HTC, MASS)}
        found = fit(Request(first.model, (data,), store=first.store, name="above", **more))  # type: ignore[arg-type]
        told.append(found.moved[MASS].verdict)
        assert found.moved[MASS].below == first[MASS].value
    assert told[0] == "moved"
    assert set(told) <= {"moved", UNDECIDED}


@pytest.mark.parametrize(("pairs", "few"), [(2, 0), pytest.param(12, 2, marks=pytest.mark.campaign)])
def test_autocorrelated_residuals_are_not_taken_for_shifts(stack: Model, pairs: int, few: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Slow errors of 0.5 K move values; a test that took residuals for white has a quarter of them below 5 %."""
    # what the structure may lack is counted after a shift is judged, and takes twenty times as long as the fit
    monkeypatch.setattr("thermid.fit._calibrate.with_structural_errors", lambda fit, errors: fit)
    found = []
    for seed in range(pairs):
        one, two = (deviating(bench(stack, 100 + 2 * seed + k), 2 * seed + k, 0.5, 1200.0, "AB") for k in (0, 1))
        first = fit(Request(stack, (one,), FREE, name="below"))
        found.append(fit(Request(stack, (two,), FREE, store=first.store, prior=FREE)).moved.groups[-1].chance)
    assert np.sum(np.array(found) < 0.05) <= few
    assert 0.15 < np.median(found) < 0.9


def test_a_value_of_which_the_log_says_nothing() -> None:
    """A mass does not act where nothing changes with time."""
    part = box()
    below = fit(Request(part, (log(part, {}, {"T": "case"}, samples=61),), (HTC, MASS), name="box"))
    rested = log(part, {}, {"A": "case"}, samples=31, start="24 [degC]", hours=60.0, seed=4).trim(45 * 3600.0)
    for fixed in (False, True):
        asked = {} if fixed else {"prior": (HTC, MASS)}
        found = fit(Request(below.model, (rested,), store=below.store, name="rest", **asked))  # type: ignore[arg-type]
        assert found.moved[MASS].verdict == UNDECIDED
        assert UNDECIDED in str(found.moved[MASS])
        assert math.isfinite(found.moved[HTC].deviations)


def test_a_value_tuned_by_hand_without_an_error(below: Calibration, stack: Model) -> None:
    sure = replace(below.store, root=np.zeros_like(below.store.root)).trimmed()
    found = fit(Request(below.model, (bench(stack, 3, 5.0),), (), store=sure, name="above"))
    assert found.moved["a.power"].verdict == "moved"
    assert found.moved["b.power"].verdict == UNDECIDED, "no shift lies within three errors of a value without an error"


def test_one_value_of_two_instances_is_tested_once() -> None:
    stack = pair()
    data = log(stack, {}, {"A": "a.case", "B": "b.case"}, boundary="room", samples=61)
    below = fit(Request(stack, (data,), ("a.power",), name="below"))
    found = fit(Request(below.model, (replace(data, name="again"),), store=below.store, name="above"))
    assert below["a.power"].also == ("b.power",)
    assert [m.path for m in found.moved.values] == ["a.power"]
    assert found.moved["a.power"].verdict == "not rejected"
    assert found.moved["a.power"].detectable_share <= 0.1


def test_a_step_beyond_the_bounds_or_the_derivatives_is_no_value() -> None:
    """A power of at most 8 W asked to be 30 W was printed as 125.3 W (+3033 %), a mass as 3.5e-5 kg."""
    part = box()
    below = fit(Request(part, (log(part, {}, {"T": "case"}, samples=61),), ("power", MASS), name="box"))
    wide = box({"parameters/power/max": 100, "nodes/case/mass/min": 0.01})
    for truth, path, side in (({"power": "30 [W]"}, "power", "up"), ({MASS: "0.4 [kg]"}, MASS, "down"), ({MASS: "0.05 [kg]"}, MASS, "")):
        data = log(wide, truth, {"T": "case"}, samples=61, seed=7)
        move = fit(Request(below.model, (data,), store=below.store, name="above")).moved[path]
        assert math.isnan(move.alone)
        assert "->" not in str(move)
        if side:
            assert move.verdict == "moved"
            assert f"errors {side}; " in str(move)
            assert f"{UNDECIDED}, " in str(replace(move, chance=0.2))
    near = log(wide, {"power": "6 [W]"}, {"T": "case"}, samples=61, seed=7)
    assert fit(Request(below.model, (near,), store=below.store, name="above")).moved["power"].alone == pytest.approx(6.0, rel=0.1)


def _values(stage: str, rows: dict[str, tuple[float, float]]) -> FittedValues:
    items = {p: FittedValue(p, v, e, e, False, "W", v, (0.0, 9.0)) for p, (v, e) in rows.items()}
    return FittedValues(stage, items, np.diag([e**2 for _, e in rows.values()]))


def test_against_a_joint_fit() -> None:
    staged = _values("box", {"p": (2.0, 0.5), "q": (3.0, 0.05), "r": (4.0, 0.1)})
    joint = _values("joint", {"a.p": (2.8, 0.3), "a.q": (3.05, 0.2), "b.r": (5.0, 0.05)})
    moves = moves_from([(staged, {"p": "a.p", "q": "a.q", "r": "b.r"})], joint, lambda path: path[0])
    assert moves["a.p"].deviations == pytest.approx(0.8 / 0.4)
    assert moves["a.q"].deviations == pytest.approx(1.0)  # the joint fit knows it no better: the stage's own error counts
    assert [m.verdict for m in moves.values] == [UNDECIDED, "not rejected", "moved"]
    # the first of three tests at 5 % in all: 2.394 standard errors, and 1.282 for 90 % power
    assert moves["a.q"].detectable == pytest.approx((2.394 + 1.2816) * 0.05, rel=1e-3)
    assert [g.name for g in moves.groups] == ["part 'a'", "all together"]
    assert moves.groups[0].chi_square == pytest.approx(2.0**2 + 1.0**2)
    assert any(re.fullmatch("  .* -> .*:", line) for line in moves.lines())


def test_what_moved_is_named_by_values_by_parts_or_all_together() -> None:
    """A part whose values moved together, none alone, was named in the lines of `-v` only, or as all values of the fit."""
    far, near = (Move(p, p[0], "box", 2.0, 2.5, 2.0, "W", 3.0, chance, 0.2, 0.01, 0.01) for p, chance in (("a.p", 0.01), ("b.q", 0.4)))
    parts = tuple(MovedGroup(f"part '{n}'", (f"{n}.q", f"{n}.r"), 17.9, 2, 0.001) for n in "bc")
    every = MovedGroup("all together", ("a.p", "b.q", "b.r", "c.q", "c.r"), 37.6, 5, 0.001)

    def named(values: tuple[Move, ...], groups: tuple[MovedGroup, ...]) -> list[str]:
        (remark,) = Moves(values, groups).warnings()
        return [n for n in ("a.p (", "part 'b'", "part 'c'", "all together") if n in remark]

    assert named((far, near), (*parts, every)) == ["a.p (", "part 'b'", "part 'c'"]
    assert named((near,), (*parts, every)) == ["part 'b'", "part 'c'"]
    assert named((near,), (every,)) == ["all together"]
    assert named((far,), ()) == ["a.p ("]


def test_words_of_agreement_need_power_and_nearness() -> None:
    fine = Move("x", "", "box", 2.0, 2.01, 2.0, "W", 0.5, 0.6, 0.2, 0.01, 0.01)
    assert fine.verdict == "not rejected"
    assert replace(fine, detectable=0.21).verdict == UNDECIDED
    assert replace(fine, alone=2.04).verdict == UNDECIDED
    assert replace(fine, chance=0.049).verdict == "moved"
    assert replace(fine, chance=math.nan).verdict == "not rejected"
    assert re.match(r"x  2\.000 -> 2\.01 W \(\+0\.5 %\): not rejected, 0\.5 .* 10 % .* 90 % ", str(fine))
    zero = replace(fine, below=0.0, alone=0.1)
    assert zero.verdict == UNDECIDED
    assert re.search(r" 0\.2 W .* 90 % ", zero.power)


def test_nothing_inherited(stack: Model) -> None:
    assert not Moves()
    assert list(Moves().lines()) == []
    assert not fit(Request(stack, (bench(stack, 5),), FREE, store=Store())).moved
