"""Constants that set the width of an interval or the outcome of a verdict of a fit, each against the figure that it stands for."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy import stats

import thermid as td
from thermid.fit._calibrate import _by_instruments, fit as fitted_by, strange_powers
from thermid.fit._calibration import contradicted, far_from_sheet
from thermid.fit._error_model.courses import OperatingPoint
from thermid.fit._error_model.elements import BEND_OF, JointLaw
from thermid.fit._problem.gather import build_problem
from thermid.fit._problem.request import Request
from thermid.fit._problem.residuals import SensorStatistics, loss_of
from thermid.fit._uncertainty.groups import Group, _combination, _few_terms, percent
from thermid.fit._uncertainty.information import Information
from thermid.fit._uncertainty.moved import Move, Test as Asked, normal_shifts, shifts
from thermid.fit._uncertainty.noise import _likeliest
from thermid.values.store import FittedValue, FittedValues
from unit.fit.bench import HTC, MASS, box, log, room

TIMES = np.linspace(0.0, 18000.0, 301)


@pytest.fixture(scope="module")
def plain() -> td.Calibration:
    """The box in a room of one temperature, its coefficient and mass fitted."""
    data = log(box(), {}, {"T": "case"}, noise=0.02)
    still = replace(data["ROOM"], values=np.full(TIMES.size, 297.15)) if "ROOM" in data.channels else None
    return td.calibrate(box(), data if still is None else data.with_channels(still), [HTC, MASS])


def test_what_was_fixed_counts_by_what_a_fit_at_another_value_finds() -> None:
    """Consider covariance by brute force, of a log whose noise is thrice what was stated: the derivative has nothing to do with noise."""
    below = fitted_by(Request(box(), (log(box(), {}, {"T": "case"}, noise=0.3, seed=1, samples=61),), (HTC,), name="below"))
    data = log(box(), {}, {"T": "case"}, noise=0.3, seed=2, samples=121)
    data = data.with_channels(replace(data["T"], noise=0.1))
    found = fitted_by(Request(below.model, (data,), (MASS,), store=below.store, name="above"))
    size = below[HTC].error
    at = below[HTC].value
    sides = [td.calibrate(box().with_values({HTC: f"{at + s * size} [W/(m^2 K)]"}), data, [MASS])[MASS].value for s in (-1.0, 1.0)]
    by_hand = (sides[1] - sides[0]) / 2.0
    rows = found.store.rows([MASS])[0] * found[MASS].value
    own = [abs(r) for r, s in zip(rows, found.store.sources, strict=True) if "below" in s.words or s.name.startswith("below")]
    noise = td.calibrate(below.model, data, [MASS])[MASS].error
    assert found[MASS].error ** 2 - noise**2 == pytest.approx(by_hand**2, rel=0.05), own


class TestMoves:
    """A value of the level below against the log of the level above: 5 % by Holm, 90 % power, agreement only where a tenth would show."""

    def move(self, **more: Any) -> Move:
        plain: dict[str, Any] = {"path": "x", "part": "", "stage": "box", "below": 2.0, "alone": 2.01, "here": 2.0, "unit": "W"}
        rest = {"deviations": 0.5, "chance": 0.6, "detectable": 0.1, "below_error": 0.1, "below_random": 0.1}
        return Move(**{**plain, **rest, **more})

    def test_one_value_in_twenty_is_called_moved_by_chance(self) -> None:
        assert self.move(chance=0.0485).verdict == "moved"
        assert self.move(chance=0.0515).verdict != "moved"

    def test_a_tenth_must_show(self) -> None:
        assert self.move(detectable=0.195).verdict == "not rejected"
        assert self.move(detectable=0.205).verdict not in ("not rejected", "moved")

    def test_three_of_the_errors_that_were_stated(self) -> None:
        assert self.move(alone=2.29).verdict == "not rejected"
        assert self.move(alone=2.31).verdict not in ("not rejected", "moved")

    def test_ten_times_the_value_says_nothing(self) -> None:
        assert self.move(detectable=19.6).is_determined
        assert not self.move(detectable=20.4).is_determined

    @pytest.mark.parametrize("tests", [1, 4])
    def test_the_detectable_shift_is_found_in_nine_of_ten_cases(self, tests: int) -> None:
        """z(1 - 0.05 / 2 tests) + z(0.9) standard errors."""
        wanted = stats.norm.ppf(1.0 - 0.025 / tests) + stats.norm.ppf(0.9)
        for found in normal_shifts(np.zeros(tests), np.full(tests, 0.2)):
            assert found.detectable / 0.2 == pytest.approx(wanted, rel=1e-6)

    def test_two_sided_chance(self) -> None:
        (found,) = normal_shifts(np.array([0.4]), np.array([0.2]))
        assert found.chance == pytest.approx(2.0 * stats.norm.sf(2.0))

    def test_a_value_that_moved_is_opened_for_the_others(self) -> None:
        """Two values that a log knows by their sum alone: what one does is not found in the other once it has moved."""
        information = np.array([[[400.0, 0.0], [0.0, 400.0]]])
        scores = np.array([[400.0 * 0.2, 0.0]])
        found = shifts(Asked(np.ones(1), information, scores, 1e-3 * np.eye(2)), [0, 1])
        assert [round(s.size, 6) for s in found] == [0.2, 0.0]
        error = math.hypot(0.05, 1e-3)
        assert found[0].error == pytest.approx(error, rel=1e-3)


def value(number: float, **more: Any) -> FittedValue:
    plain: dict[str, Any] = {"path": MASS, "value": number, "error": 0.01, "error_random": 0.01, "log": True, "unit": "kg"}
    return FittedValue(**{**plain, "start": 1.5, "bounds": (0.01, 100.0), **more})


def values(one: FittedValue) -> FittedValues:
    return FittedValues("s", {one.path: one}, np.eye(1))


class TestWhatIsQuestioned:
    def test_ten_deviations_from_what_was_stated_are_not_believed(self) -> None:
        for far, said in ((9.8, False), (10.2, True)):
            one = value(1.5 * math.exp(0.1 * far), prior=(math.log(1.5), 0.1))
            assert bool(contradicted(values(one))) is said

    @pytest.mark.parametrize(("ratio", "asked"), [(4.9, False), (5.1, True), (1 / 4.9, False), (1 / 5.1, True)])
    def test_five_times_the_sheet_or_a_fifth_of_it(self, ratio: float, asked: bool) -> None:
        assert bool(far_from_sheet(box(), values(value(1.5 * ratio)))) is asked

    @pytest.mark.parametrize(("watts", "asked"), [(4.0 * 295, False), (4.0 * 305, True), (4.0 / 295, False), (4.0 / 305, True)])
    def test_powers_in_another_unit(self, watts: float, asked: bool) -> None:
        """Three hundred times: between a slip of 1000 and what a load can differ from its deck by."""

        data = log(box(), {}, {"T": "case"})
        power = td.Channel.from_array("P", np.full(data.times.size, watts), quantity="power", role="load", target="heat")
        problem = build_problem(Request(box(), (data.with_channels(power),), (HTC,)))
        assert bool(strange_powers(problem)) is asked

    def test_a_constant_error_is_worth_a_word_from_a_twentieth_of_the_variance_on(self) -> None:
        fit = td.calibrate(box(), log(box(), {}, {"T": "case"}, accuracy=0.2), [HTC])
        for share, said in ((0.0485, False), (0.0515, True)):
            r = math.sqrt(share)
            covariance = np.array([[1.0, r], [r, 1.0]])
            (found,) = replace(fit, values=replace(fit.values, covariance=covariance)).sensor_shares
            assert bool(found.parameter) is said


class TestAdequacy:
    @pytest.mark.parametrize(("noise", "stated"), [(0.01, True), (0.2, True), (0.01, False)])
    @pytest.mark.parametrize(("size", "state"), [(3.0, "not adequate"), (0.3, "credible")])
    def test_residuals_of_four_usual_departures_are_not_adequate(self, noise: float, stated: bool, size: float, state: str) -> None:
        """A wave of 3 K is more than rooms and elements are known to do; of 0.3 K it widens the error of a value, and holds the truth."""
        data = log(box(), {}, {"T": "case"}, noise=noise)
        slow = size * np.sin(TIMES / 1500.0)
        data = data.with_channels(replace(data["T"], values=data["T"].values + slow, noise=noise if stated else None))
        found = td.calibrate(box(), data, [HTC])
        assert (found.standing.state, found.standing.exit_code) == (state, 5 if state == "not adequate" else 0)
        assert bool(found.standing.because) is (state == "not adequate")
        assert abs(found[HTC].value - 6.0) < 2.0 * found[HTC].error

    def test_white_residuals_of_three_stated_noises_are_said_and_counted(self) -> None:
        data = log(box(), {}, {"T": "case"}, noise=0.05)
        noise = np.random.default_rng(4).standard_normal(TIMES.size)
        wide = data["T"].values + 3.2 * 0.05 * noise / noise.std()
        found, calm = (td.calibrate(box(), r, [HTC]) for r in (data.with_channels(replace(data["T"], values=wide)), data))
        assert found.standing.state == "credible"
        assert any(re.search(r"\b3\.\d+ ", w) for w in found.warnings)
        assert not any(re.search(r"\b3\.\d+ ", w) for w in calm.warnings)
        assert found[HTC].error > 3.0 * calm[HTC].error

    def test_spikes_of_a_wrong_log_are_not_adequate_though_they_do_not_wander(self) -> None:
        data = log(box(), {}, {"T": "case"}, noise=0.05)
        spiked = data["T"].values.copy()
        spiked[::17] += 8.0
        found = td.calibrate(box(), data.with_channels(replace(data["T"], values=spiked)), [HTC])
        assert found.standing.state == "not adequate"

    def test_neighbours_of_white_residuals_correlate_by_chance(self) -> None:
        """2.576 / sqrt(n) in 99 of 100 cases."""
        for lag, white in ((2.5 / 20.0, True), (2.65 / 20.0, False)):
            assert SensorStatistics(0.1, 0.0, 0.3, 400, 0.0, lag, 400.0).white is white

    @pytest.mark.parametrize(("times", "said"), [(1.47, False), (1.54, True)])
    def test_residuals_half_as_large_again_in_their_squares(self, times: float, said: bool) -> None:
        """A mean square of 1.5 of the stated noise: with 300 readings some six deviations of chance."""
        given = td.Scenario("r", boundaries={"air": (TIMES, td.quantity(room(TIMES), unit="K"))}, start="24 [degC]", duration=18000.0)
        wave = np.where(np.arange(301) % 2, 1.0, -1.0) * 0.1 * math.sqrt(times * 300.0 / 301.0)
        made = {
            "T": td.Channel.from_array(
                "T", td.simulate(box(), given, times=TIMES)["case"].kelvin + wave, unit="K", role="node", target="case", noise=0.1
            ),
            "ROOM": td.Channel.from_array("ROOM", room(TIMES), unit="K", role="boundary", target="air"),
        }
        data = td.Record.from_arrays("r", TIMES, made)
        found = td.calibrate(box(), data, [HTC])
        assert any(re.search(r" 1\.2\d* .*`thermid criticise`", w) for w in found.warnings) is said


def test_robust_losses_are_those_of_scipy() -> None:
    """rho(z) of scipy.optimize.least_squares, scaled by the knee: C^2 rho(z / C^2)."""
    squares, knee = np.array([0.01, 0.5, 2.0, 40.0]), 1.3
    z = squares / knee**2
    wanted = {
        "soft_l1": 2.0 * (np.sqrt(1.0 + z) - 1.0),
        "huber": np.where(z <= 1.0, z, 2.0 * np.sqrt(z) - 1.0),
        "cauchy": np.log1p(z),
        "linear": squares / knee**2,
    }
    for loss, rho in wanted.items():
        size, slope = loss_of(squares, loss, knee)
        assert size == pytest.approx(knee**2 * rho)
        more = loss_of(squares * 1.000001, loss, knee)[0]
        assert slope == pytest.approx((more - size) / (squares * 1e-6), rel=1e-4)


def test_a_reading_in_steps_errs_by_a_step_over_the_root_of_twelve() -> None:
    data = log(box(), {}, {"T": "case"})
    data = data.with_channels(replace(data["T"], noise=0.03, resolution=0.25))
    (seen,) = td.calibrate(box(), data, [HTC]).experiments[0].observations
    assert seen.noise == pytest.approx(math.hypot(0.03, 0.25 / math.sqrt(12.0)))


def test_percentages_end_where_factors_are_clearer() -> None:
    assert percent(2.9) == "290 %"
    assert percent(3.1).startswith("a factor of 3.1")


def test_white_residuals_are_called_autocorrelated_in_a_few_cases_of_a_hundred() -> None:
    """Twice the logarithm of the likelihood ratio passes 5 in chi-square(1) / 2 of the cases, 1.3 %; seven times are tried."""
    rng = np.random.default_rng(3)
    times = np.linspace(0.0, 18000.0, 121)
    given = td.Scenario("r", boundaries={"air": "24 [degC]"}, start="24 [degC]", duration=18000.0)
    kelvin = td.simulate(box(), given, times=times)["case"].kelvin
    records = []
    for k in range(150):
        case = td.Channel.from_array("T", kelvin + 0.1 * rng.standard_normal(times.size), unit="K", role="node", target="case", noise=0.1)
        records.append(td.Record.from_arrays(f"r{k}", times, {"T": case}))
    found = td.calibrate(box(), records, [HTC], scenario=given)
    slow = sum(s.wanders for record in found.statistics.values() for s in record.values())
    assert 150 * 0.5 * stats.chi2.sf(5.0, 1) <= slow <= 150 * 7 * 0.5 * stats.chi2.sf(5.0, 1)


def test_five_descents_from_the_best_of_64_points_beside_that_from_the_start() -> None:
    found = td.calibrate(box(), log(box(), {}, {"T": "case"}, samples=61), [HTC, MASS], search="multistart")
    assert re.search(r"\b64 .*\b6 .*\b6 ", found.search)


def test_elsewhere_lies_inside_the_bounds_by_half_of_the_room() -> None:
    """Bounds of 10 % leave less room than the usual shift, a tenth to a third of the value: half of the wider side is taken."""
    model = box({"surfaces/skin/effective_htc": {"value": "6 [W/(m^2 K)]", "min": 5.9, "max": 6.3}})
    problem = build_problem(Request(model, (log(model, {}, {"T": "case"}, samples=61),), (HTC,)))
    info = Information.of_problem(problem, np.array([u.to_fitted(u.start) for u in problem.unknowns]))
    there = info.elsewhere(problem)
    assert there is not None
    (k,) = info.parameters
    assert there.at[k] - info.at[k] == pytest.approx(0.5 * math.log(6.3 / 6.0))


@pytest.mark.parametrize(("form", "value", "error"), [("power law", 2.0 * 8.0**2, 128.0 * 0.3), ("series", 0.75, 0.3), ("sum", 18.0, 0.3)])
def test_the_error_of_a_combination_is_the_root_of_its_variance(form: str, value: float, error: float) -> None:
    """Of a power law that of its logarithm, relative to its value."""
    info: Any = SimpleNamespace(names=["a", "b"], values=np.array([2.0, 8.0]), unknowns=[SimpleNamespace(unit="W")] * 2)
    found = _combination(info, [0, 1], np.array([1.0, 2.0]), form, 0.09)
    assert (found.value, found.error) == pytest.approx((value, error))


def test_a_bend_of_a_joint_adds_heat_as_half_a_square_in_its_logarithm() -> None:
    """By a difference in the size b of ``ln f + b x^2 / 2``, and no further than x = 1."""
    kelvin, flow = {"a": np.array([310.0, 390.0]), "b": np.array([300.0, 300.0])}, np.array([2.0, 9.0])
    course: Any = SimpleNamespace(kelvin=kelvin, flows={"joint": flow})
    law = JointLaw(OperatingPoint(10.0, 295.0), 0.03, None)
    x = np.array([0.3, 1.0])
    conductor: Any = SimpleNamespace(path="joint", ends=("a", "b"))
    assert law.heats(course, conductor)[BEND_OF] == pytest.approx(flow * (np.exp(1e-6 * x**2 / 2.0) - 1.0) / 1e-6, rel=1e-5)


class TestWhoGoesTogether:
    """Two values with relative errors of 1, of which a log says a tenth of that where the other is known."""

    def groups(self, correlation: float, alone: float = 0.1) -> int:
        covariance = np.array([[1.0, correlation], [correlation, 1.0]])
        unknowns = [SimpleNamespace(log=False)] * 2
        info: Any = SimpleNamespace(covariance=lambda: covariance, sizes=np.ones(2), parameters=[0, 1], unknowns=unknowns)
        info.names, info.alone = ["a", "b"], [alone] * 2
        return len(Group.all_practical(info, 0.2))

    @pytest.mark.parametrize(("correlation", "groups"), [(0.78, 0), (0.82, 1), (-0.82, 1)])
    def test_values_whose_errors_have_two_thirds_of_their_variance_in_common(self, correlation: float, groups: int) -> None:
        """A correlation of 0.8: 0.64 of the variance."""
        assert self.groups(correlation) == groups

    @pytest.mark.parametrize(("alone", "groups"), [(0.49, 1), (0.51, 0)])
    def test_and_that_would_be_known_twice_as_well_alone(self, alone: float, groups: int) -> None:
        assert self.groups(0.9, alone) == groups

    @pytest.mark.parametrize(("share", "named"), [(0.097, False), (0.103, True)])
    def test_instruments_are_named_from_a_tenth_of_the_variance_on(self, share: float, named: bool) -> None:
        kinds = (("parameter", "x"), ("sensor", "sensor T1"), ("sensor", "sensor T2"))
        problem: Any = SimpleNamespace(unknowns=[SimpleNamespace(kind=kind, name=name) for kind, name in kinds])
        total = np.eye(3)
        total[0, 1:] = total[1:, 0] = np.sqrt([0.8, share])
        assert ("T2" in _by_instruments(problem, total, 0)) is named


@pytest.mark.parametrize(("unknowns", "judged"), [(25, 300), (26, 1)])
def test_the_search_for_the_fewest_terms_ends_at_three_hundred_bases(unknowns: int, judged: int) -> None:
    """Two combinations of 25 unknowns have 300 bases, of 26 have 325: there elimination names one, or the time would grow as a binomial."""
    asked: list[np.ndarray] = []

    def variance(row: np.ndarray) -> float:
        asked.append(row)
        return float(row @ row)

    _few_terms(np.random.default_rng(5).standard_normal((unknowns, 2)), variance)
    assert len(asked) == 2 * judged


def test_a_wandering_part_of_a_hundredth_of_the_white_one_is_the_least_that_is_tried() -> None:
    """In the direction in which it is strongest; of readings without one that is the likeliest."""
    gain, white, wandering = _likeliest(np.diag([1.0, 4.0]), np.array([1.0, 0.0]), 0.5)
    assert 4.0 * wandering == pytest.approx(0.01 * white)
    assert gain < 0.0
