"""The minimisation, its covariance and what is said of it."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import IdentificationError, RecordError, SolverError
from thermid.campaign.stages import compare
from thermid.fit._calibrate import calibrate, fit, refuse_after, requested, summarise
from thermid.fit._minimisation import Fit, KeptFit, covariances, minimise
from thermid.fit._problem.gather import build_problem
from thermid.fit._problem.request import Request
from thermid.fit._uncertainty.information import responses
from thermid.fit._uncertainty.noise import autocorrelation
from thermid.measure.records import Record
from thermid.simulation.runs import Options, Scenario
from unit.fit.bench import AREA, HTC, MASS, box, log, metered, pair

pytestmark = pytest.mark.usefixtures("errors_in_turn")

BARE = {"surfaces/skin/effective_htc": "6 [W/(m^2 K)]", "nodes/case/mass": "1.5 [kg]"}
"""Without bounds, so that no bound refuses before the reason under test does."""


def spoiled(record: Record, share: float = 0.02, by: float = 5.0) -> Record:
    """Return a record in which a share of the readings of T is wrong."""
    values = np.array(record["T"].values)
    rng = np.random.default_rng(11)
    values[rng.choice(values.size, round(share * values.size), replace=False)] += by
    return record.with_channels(replace(record["T"], values=values))


def test_the_truth_comes_back_within_its_errors_and_the_model_stays_as_it_was() -> None:
    model = box()
    before = model.identity()
    found = calibrate(model, log(model, {HTC: "5 [W/(m^2 K)]", MASS: "1.7 [kg]"}, {"T": "case"}, seed=2), [HTC, MASS])
    for path, truth in ((HTC, 5.0), (MASS, 1.7)):
        assert abs(found[path].value - truth) < 3.5 * found[path].error
        assert found[path].error == pytest.approx(found[path].error_random)
    assert found.warnings == ()
    assert found.reduced_chi_square == pytest.approx(1.0, abs=0.25)
    assert model.identity() == before
    assert found.given_model is model
    assert found.model.at(HTC).expression.literal.value == found[HTC].value


def test_covariance_is_that_of_the_linear_problem() -> None:
    # the power is linear where its minimum is zero: (X'X)^-1 of the response to 1 W and of the decay of the start
    model = box({"parameters/power/min": 0})
    data = log(model, {}, {"T": "case"}, noise=0.05, swing=0.0)
    data = data.with_channels(replace(data["T"], noise=0.06))
    found = calibrate(model, data, ["power"])
    g, c = 6.0 * 0.05, 1.5 * 900.0
    decay = np.exp(-data.times * g / c)
    x = np.column_stack([(1 - decay) / g, decay]) / 0.06
    assert found["power"].error == pytest.approx(math.sqrt(np.linalg.inv(x.T @ x)[0, 0]), rel=1e-4)


def test_a_direction_without_readings_has_no_finite_error() -> None:
    data = log(box(), {}, {"T": "case"}).trim(0.0, 60.0)
    problem = build_problem(Request(box(), (data,), (HTC, MASS)))
    at = np.array([u.to_fitted(u.start) for u in problem.unknowns])
    total, _, _ = covariances(Fit.ended(problem, at))
    assert problem.samples < len(problem.unknowns)
    assert np.isinf(total[0, 0])


def test_errors_grow_with_residuals_that_are_larger_than_the_noise() -> None:
    model = box()
    data = log(model, {}, {"T": "case"}, noise=0.05)
    fine = calibrate(model, data, [HTC])
    told = calibrate(model, data.with_channels(replace(data["T"], noise=0.01)), [HTC])
    assert told[HTC].error_random == pytest.approx(fine[HTC].error, rel=0.1)
    assert told[HTC].error < 1.5 * fine[HTC].error  # what wanders may be departures, as unlikely as they are
    assert any(re.search(r"\b[45]\.\d+ ", w) for w in told.warnings)
    assert told.reduced_chi_square == pytest.approx(25, rel=0.2)


def test_noise_that_nothing_states_is_estimated() -> None:
    model = box()
    stated = calibrate(model, log(model, {}, {"T": "case"}, noise=0.05), [HTC, MASS])
    found = calibrate(model, log(model, {}, {"T": "case"}, noise=0.05, stated=False), [HTC, MASS])
    assert found[HTC].error == pytest.approx(stated[HTC].error, rel=0.1)
    assert found[HTC].value == pytest.approx(stated[HTC].value, abs=0.1 * stated[HTC].error)
    assert found.reduced_chi_square == pytest.approx(301 / 298, rel=1e-9)


def test_sensors_without_stated_noise_are_weighed_by_their_own() -> None:
    stack = pair(second=box({"parameters/power/value": "1 [W]"}))
    data = log(stack, {}, {"A": "a.case", "B": "b.case"}, boundary="room", noise=0.02, stated=False)
    rough = np.array(data["B"].values) + 0.5 * np.random.default_rng(5).standard_normal(301)
    found = calibrate(stack, data.with_channels(replace(data["B"], values=rough)), ["stack.contact_conductance"])
    sigmas = {b.sensor: b.noise for b in found.blocks}
    assert sigmas["A"] == pytest.approx(0.02, rel=0.15)
    assert sigmas["B"] == pytest.approx(0.5, rel=0.15)


class TestRobust:
    @pytest.mark.parametrize("loss", ["soft_l1", "huber", "cauchy"])
    @pytest.mark.parametrize("stated", [True, False])
    def test_outliers(self, loss: str, stated: bool) -> None:
        model = box()
        clean = calibrate(model, log(model, {}, {"T": "case"}), [HTC, MASS])
        data = spoiled(log(model, {}, {"T": "case"}, stated=stated))
        plain, robust = (calibrate(model, data, [HTC, MASS], loss=name) for name in ("linear", loss))
        shift = abs(plain[HTC].value - clean[HTC].value)
        assert shift > 5 * clean[HTC].error, "the outliers matter"
        assert abs(robust[HTC].value - clean[HTC].value) < (0.15 if stated else 0.25) * shift
        assert abs(robust[HTC].value - 6.0) < 4 * robust[HTC].error
        assert robust.blocks[0].noise == pytest.approx(0.05, rel=0.15)

    @pytest.mark.parametrize("loss", ["soft_l1", "huber", "cauchy"])
    def test_priors_stay_quadratic(self, loss: str) -> None:
        # a prior 50 standard deviations from the data pulls just as hard under every loss, where the data bend nowhere
        model = box()
        data = log(model, {}, {"T": "case"}, noise=1e-9, samples=31)
        data = data.with_channels(replace(data["T"], noise=50.0))  # residuals far below the knee
        priors = {HTC: ("12 [W/(m^2 K)]", "0.12 [W/(m^2 K)]")}
        values = [calibrate(model, data, [HTC], priors=priors, loss=name)[HTC].value for name in ("linear", loss)]
        assert values[1] == pytest.approx(values[0], rel=2e-3)
        assert values[0] > 11

    @pytest.mark.parametrize("loss", ["linear", "soft_l1", "huber", "cauchy"])
    def test_the_end_is_a_minimum_of_the_stated_cost(self, loss: str) -> None:
        data = spoiled(log(box(), {}, {"T": "case"}, samples=101))
        problem = build_problem(Request(box(), (data,), (HTC, MASS)))
        knee = 1.5
        found = minimise(problem, loss, knee)

        def cost(x: np.ndarray) -> float:
            z = (problem.residuals(x) / knee) ** 2
            rho = {
                "linear": z,
                "soft_l1": 2 * (np.sqrt(1 + z) - 1),
                "huber": np.where(z <= 1, z, 2 * np.sqrt(np.maximum(z, 1)) - 1),
                "cauchy": np.log1p(z),
            }[loss]
            return 0.5 * knee**2 * float(rho.sum()) + 0.5 * float(np.sum(problem.prior_rows(x)[0] ** 2))

        here = cost(found.fitted)
        if loss == "linear":
            assert found.cost == pytest.approx(here, rel=1e-12)
        for k in range(found.fitted.size):
            for side in (-1, 1):
                step = np.zeros(found.fitted.size)
                step[k] = side * 1e-2
                assert cost(found.fitted + step) > here

    @pytest.mark.parametrize("knee", [1.0, 2.5])
    def test_rows_beyond_the_knee_weigh_less(self, knee: float) -> None:
        data = spoiled(log(box(), {}, {"T": "case"}, samples=101))
        problem = build_problem(Request(box(), (data,), (HTC, MASS)))
        at = minimise(problem, "huber", knee).fitted
        robust = Fit.ended(problem, at, "huber", knee)
        size = np.abs(problem.residuals(at))
        assert (size > knee).sum() > 1
        weight = np.where(size > knee, np.sqrt(knee / np.maximum(size, knee)), 1.0)
        full = weight[:, None] * problem.jacobian(at)
        np.testing.assert_allclose(robust.jacobian.T @ robust.jacobian, full.T @ full, rtol=1e-10)
        assert robust.chi_square == pytest.approx(np.sum((weight * problem.residuals(at)) ** 2), rel=1e-10)

    def test_an_unknown_loss(self) -> None:
        with raises_code("name.unknown", IdentificationError, match="'lin'.*soft_l1"):
            calibrate(box(), log(box(), {}, {"T": "case"}, samples=11), [HTC], loss="lin")


class TestRefusals:
    def refused(self, free: list[str], record: Record | None = None, **more: object) -> str:
        model = box(BARE)
        data = record if record is not None else log(model, {}, {"T": "case"})
        with pytest.raises(IdentificationError) as caught:
            calibrate(model, data, free, **more)  # type: ignore[arg-type]
        assert caught.value.exit_code == 4
        assert str(caught.value).startswith("Box: ")
        return caught.value.message

    def test_product(self) -> None:
        message = self.refused([HTC, AREA])
        assert message.startswith(f"'{HTC}' and '{AREA}' ")
        value, error = re.search(rf"{re.escape(HTC)}\*{re.escape(AREA)} = (\S+) \+- (\S+) W/K", message).groups()
        assert float(value) == pytest.approx(0.3, abs=4 * float(error))

    def test_product_by_the_order_of_the_names(self) -> None:
        assert f"{AREA}*{HTC} = 0.3 +- " in self.refused([AREA, HTC])

    def test_ratio(self) -> None:
        # at rest only the power over the conductance shows
        model = box(BARE)
        data = log(model, {}, {"T": "case"}, start="steady", swing=0.0)
        message = self.refused(["power", HTC], data, scenario=Scenario("s", start="steady"))
        assert message.startswith("'power' and '")

    def test_power_mass_and_area_scale_together(self) -> None:
        message = self.refused(["power", AREA, MASS])
        assert f"'power', '{AREA}', '{MASS}' " in message
        assert "*" not in message  # neither a product nor a sum of two

    def test_a_prior_of_the_power_cures_it(self) -> None:
        model = box(BARE)
        data = log(model, {}, {"T": "case"})
        found = calibrate(model, data, ["power", AREA, MASS], priors={"power": ("4 [W]", "0.2 [W]")})
        for path in (AREA, MASS):
            assert found[path].error / found[path].value == pytest.approx(0.05, rel=0.05)

    def test_no_effect(self) -> None:
        data = metered(log(box(BARE), {}, {"T": "case"}), "heat", 4.0)
        assert re.search(r"'power'\. Fix it", self.refused(["power"], data))

    def test_no_start_of_a_node_that_keeps_nothing_of_it(self) -> None:
        # the part inside follows within a second, so that a minute later its start acts as a little more of the start of the case does
        film = {"kind": "conduction", "between": ["case", "inside"], "conductance": "3 [W/K]"}
        model = box({"nodes/inside": {"capacitance": "4 [J/K]"}, "conductors": {"film": film}})
        data = log(model, {}, {"T": "case", "T_IN": "inside"})
        data = data.with_channels(*(replace(data.channels[n], valid=data.times >= 60.0) for n in ("T", "T_IN")))
        found = calibrate(model, data, [HTC, MASS])
        assert found[HTC].value == pytest.approx(6.0, abs=3.0 * found[HTC].error)

    def test_fewer_readings_than_unknowns(self) -> None:
        data = log(box(BARE), {}, {"T": "case"}).trim(0.0, 60.0)
        message = self.refused([HTC, MASS], data)
        assert f"'{HTC}' and '{MASS}' " in message
        assert f"*{HTC} + {MASS}" in message

    def test_an_error_wider_than_the_bounds(self) -> None:
        model = box()
        data = log(model, {}, {"T": "case"}, hours=0.02, samples=7, noise=0.2)
        with raises_code("fit.not-determined", IdentificationError, match=r"'skin\.effective_htc'.*W/\(m\^2.*1.*20"):
            calibrate(model, data, [HTC])

    def test_an_instrument_behind_a_wide_error_is_named(self) -> None:
        model = box({"surfaces/skin/effective_htc": {"value": "6 [W/(m^2 K)]", "min": 5.7, "max": 6.3}})
        data = log(model, {}, {"T": "case"}, hours=6.0, noise=0.05)
        off = data.with_channels(replace(data["T"], accuracy=2.0))
        with raises_code("fit.not-determined", IdentificationError, match=r"'T' \(.*`start`.*\)"):
            calibrate(model, off, [HTC, MASS])
        with raises_code("fit.not-determined", IdentificationError, match="'METER'"):
            calibrate(model, metered(data, "heat", 4.0, accuracy=0.8), [HTC, MASS])

    @pytest.mark.parametrize(("error", "refused"), [(1.51, True), (1.49, False)])
    def test_wider_is_one_standard_error_either_side_against_the_width(self, error: float, refused: bool) -> None:
        # ln(20/1) = 2.996
        request = Request(box(), (log(box(), {}, {"T": "case"}, samples=11),), (HTC,))
        problem = build_problem(request)
        found = Fit.ended(problem, np.array([u.to_fitted(u.start) for u in problem.unknowns]))
        total = np.diag([error**2, 1.0])
        if refused:
            with raises_code("fit.not-determined", IdentificationError):
                refuse_after(request, problem, found, total)
        else:
            refuse_after(request, problem, found, total)

    def test_a_value_that_the_log_pushes_to_its_bound_is_not_refused(self) -> None:
        # the log says that a path is not there: near nothing, its logarithm is hardly known
        problem = build_problem(request := Request(box(), (log(box(), {}, {"T": "case"}, samples=11),), (HTC,)))
        starts = [u.to_fitted(u.low if u.name == HTC else u.start) for u in problem.unknowns]
        refuse_after(request, problem, Fit.ended(problem, np.array(starts)), np.diag([1.6**2, 1.0]))

    def test_two_records_of_one_name_and_none(self) -> None:
        data = log(box(), {}, {"T": "case"}, samples=11)
        with raises_code("name.taken", RecordError, match="'bench'"):
            calibrate(box(), [data, data], [HTC])
        with raises_code("record.nothing-there", RecordError):
            calibrate(box(), [], [HTC])

    def test_a_model_that_cannot_be_run_is_no_matter_of_the_data(self) -> None:
        data = log(box(), {}, {"T": "case"}, samples=11)
        with pytest.raises(SolverError, match="max_steps") as caught:
            fit(Request(box(), (data,), (HTC,), options=Options(max_steps=1)))
        assert caught.value.exit_code == 3


class TestWarnings:
    def test_none_for_a_right_model(self) -> None:
        # white residuals look coloured in one trace of twenty; these seeds were not chosen, so a few may be remarked
        remarked = sum(bool(calibrate(box(), log(box(), {}, {"T": "case"}, seed=s, samples=101), [HTC]).warnings) for s in range(40))
        assert remarked <= 6  # binomial(40, 0.05): more than 6 in 1 of 300

    def test_many_white_traces_are_not_called_coloured(self) -> None:
        data = [log(box(), {}, {"T": "case"}, name=f"r{s}", seed=s, samples=101) for s in range(40)]
        assert not any(re.search(r"\b\d+ of 40 ", w) for w in calibrate(box(), data, [HTC]).warnings)

    def test_at_a_bound(self) -> None:
        found = calibrate(box(), log(box({"surfaces/skin/effective_htc/max": 40}), {HTC: "25 [W/(m^2 K)]"}, {"T": "case"}), [HTC])
        assert any(f"'{HTC}'" in w and " 20 W/(m^2 K)" in w for w in found.warnings)

    def test_a_prior_that_the_data_contradict(self) -> None:
        found = calibrate(box(), log(box(), {}, {"T": "case"}), [HTC], priors={HTC: ("9 [W/(m^2 K)]", "0.3 [W/(m^2 K)]")})
        assert any(f"'{HTC}'" in w for w in found.warnings)

    def test_coloured_residuals(self) -> None:
        # a second mass that the model does not have
        stack = pair(second=box({"nodes/case/mass/value": "3 [kg]", "parameters/power/value": "1 [W]"}))
        data = log(stack, {}, {"T": "a.case"}, boundary="room", noise=0.02)
        data = data.with_channels(replace(data["T"], target="case"), replace(data["ROOM"], target="air"))
        found = calibrate(box(), data, [HTC, MASS])
        assert not found.sensors["T"].white
        assert found.warnings

    def test_a_fit_that_did_not_converge_says_so(self) -> None:
        data = log(box(), {}, {"T": "case"}, samples=31)
        problem = build_problem(Request(box(), (data,), (HTC,)))
        at = np.array([u.to_fitted(u.start) for u in problem.unknowns])
        stopped = Fit.ended(problem, at, message="nothing left", converged=False)
        request = Request(box(), (data,), (HTC,))
        _, random, weights = covariances(stopped)
        errors = responses(request, problem, stopped, 1.0, random, weights)
        told = summarise(request, problem, stopped, errors, random, autocorrelation(problem, stopped), KeptFit({HTC: float(at[0])}, 1))
        assert any("nothing left" in w for w in told.warnings)
        assert not told.converged


class TestSeveralRecords:
    def test_shared_and_local(self) -> None:
        model = box()
        data = [
            log(model, {HTC: "5 [W/(m^2 K)]"}, {"T": "case"}, name=n, seed=s, start=f"{t} [degC]")
            for n, s, t in (("a", 1, 20), ("b", 2, 40))
        ]
        found = calibrate(model, data, [HTC])
        starts = {i.record: i for i in found.local}
        for name, truth in (("a", 293.15), ("b", 313.15)):
            assert starts[name].value == pytest.approx(truth, abs=4 * starts[name].error)
        assert set(found.statistics) == {"a", "b"}
        assert found.sensors["T"].samples == 602
        assert found[HTC].error < calibrate(model, data[0], [HTC])[HTC].error

    def test_the_order_of_records_does_not_matter(self) -> None:
        model = box()
        data = [log(model, {}, {"T": "case"}, name=n, seed=s, samples=61, accuracy=0.5) for s, n in enumerate("abc")]
        one, two = (calibrate(model, d, [HTC, MASS]) for d in (data, data[::-1]))
        assert one[HTC].value == pytest.approx(two[HTC].value, rel=1e-7)
        assert one[HTC].error == pytest.approx(two[HTC].error, rel=1e-6)

    def test_a_scenario_per_record(self) -> None:
        model = box()
        data = [log(model, {}, {"T": "case"}, name=n, seed=s, swing=0.0).select("T") for s, n in enumerate("ab")]
        right = {"a": Scenario("a", boundaries={"air": "24 [degC]"}), "*": Scenario("b", boundaries={"air": "24 [degC]"})}
        assert calibrate(model, data, [HTC], scenario=right).sensors["T"].rmse < 0.06


class TestCompare:
    def test_changes_nothing(self) -> None:
        model = box()
        data = log(model, {}, {"T": "case"}, bias={"T": 0.7}, accuracy=0.5)
        data = metered(data, "heat", 4.0 * 1.05, accuracy=0.2)
        data = data.with_channels(replace(data["ROOM"], accuracy=0.5))
        found = compare(model, data)
        assert dict(found.values) == {}
        assert found.local == ()
        assert found.fitted == {}
        assert found.sensors["T"].bias == 0.0
        assert found.evaluations <= 1
        assert found.given_model is model

    def test_says_how_far_the_model_is(self) -> None:
        model = box()
        data = log(model, {}, {"T": "case"}, noise=None, bias={"T": 0.7}, swing=0.0)
        found = compare(model, data, scenario=Scenario("s", start="24 [degC]"))
        assert found.sensors["T"].mean == pytest.approx(0.7, abs=1e-3)
        assert found.sensors["T"].rmse == pytest.approx(0.7, abs=1e-3)


def test_the_text_tells_values_errors_sensors_and_correlations() -> None:
    data = log(box(), {}, {"T": "case"}, accuracy=0.5)
    text = str(calibrate(box(), data, [HTC, MASS], name="bench fit"))
    lines = text.splitlines()
    assert re.match(r"bench fit: 2 .* 301 .* 1 ", lines[0])
    assert any(
        x.split()[0] == HTC and "random +- " in x and "total +- " in x and "(constant errors, priors)" in x and "bounds 1 .. 20" in x
        for x in lines
    )
    assert any("T: RMSE 0.0" in x and "residuals white:" in x and "bias " in x for x in lines)
    assert any(x.startswith("  correlations: ") for x in lines)
    assert "reduced chi-square" in text


def test_a_noisy_room_does_not_make_a_search_grope() -> None:
    """With steps chosen anew at every evaluation the cost jumps, and this search takes more than twice as many."""
    model, data = box(), log(box(), {HTC: "7 [W/(m^2 K)]", MASS: "1.2 [kg]"}, {"T": "case"}, samples=3601, noise=0.02)
    rough = np.array(data["ROOM"].values) + 0.05 * np.random.default_rng(3).standard_normal(3601)
    found = calibrate(model, data.with_channels(replace(data["ROOM"], values=rough)), [HTC, MASS])
    assert found.converged
    assert found.evaluations <= 9


def test_progress_counts_evaluations() -> None:
    seen: list[tuple[int, float]] = []
    found = fit(requested(box(), (log(box(), {}, {"T": "case"}, samples=31),), [HTC]), lambda n, rms: seen.append((n, rms)))
    assert [n for n, _ in seen] == list(range(1, len(seen) + 1))
    assert seen[-1][0] == found.evaluations
    assert seen[-1][1] == pytest.approx(1.0, abs=0.4)


def chain(count: int) -> td.Model:
    """Nodes in a row from a heater to the air, a conductance between each two."""
    nodes = {f"n{k}": {"capacitance": "20 [J/K]"} for k in range(count)}
    ends = [*nodes, "air"]
    paths = {
        f"c{k}": {"kind": "conduction", "between": ends[k : k + 2], "conductance": {"value": "1.3 [W/K]", "min": 0.01, "max": 100}}
        for k in range(count)
    }
    loads = {"heater": {"into": "n0", "power": "5 [W]"}}
    return td.model_from_dict({"title": "chain", "needs": ["air"], "nodes": nodes, "conductors": paths, "loads": loads})


def test_fifty_values_of_a_row_are_refused_by_name_and_not_by_steps() -> None:
    """What the last conductance has done after a second is some 1e-60 K; its share of that would take a million steps."""
    room = td.Scenario("room", boundaries={"air": "20 [degC]"}, start="20 [degC]", duration="2 [h]")
    free = [f"c{k}.conductance" for k in range(50)]
    run = td.simulate(chain(50).with_values(dict.fromkeys(free, "1 [W/K]")), room, every="1 [min]")
    reading = run["n0"].kelvin + np.random.default_rng(1).normal(0.0, 0.05, run.times.size)
    channels = {"T": td.Channel.from_array("T", reading, unit="K", role="node", target="n0", noise=0.05)}
    channels["air"] = td.Channel.from_array("air", run["air"].kelvin, unit="K")
    with pytest.raises(IdentificationError, match=r"'c0\.conductance', 'c1\.conductance'.*'c49\.conductance'"):
        td.calibrate(chain(50), td.Record.from_arrays("log", run.times, channels), free=free)


def test_derivatives_that_grow_as_high_powers_of_time_are_those_of_differences() -> None:
    room = td.Scenario("room", boundaries={"air": "20 [degC]"}, start="20 [degC]", duration="20 [min]")
    tight = Options(error=8e-10)
    model, name, at = chain(25), "c20.conductance", np.linspace(0.0, 1200.0, 7)
    run = td.prepare(model, room, [f"c{k}.conductance" for k in range(25)], times=at, options=tight).run(sensitivities=True)
    ahead, back = (td.simulate(model.with_values({name: f"{1.3 + d} [W/K]"}), room, times=at, options=tight) for d in (1e-3, -1e-3))
    differences = (ahead["n19"].kelvin - back["n19"].kelvin) / 2e-3
    assert np.abs(differences[-1]) > 1e-3
    np.testing.assert_allclose(run.sensitivity("n19", name), differences, rtol=1e-5, atol=1e-8)
    assert run.statistics["steps"] < 5000


def test_what_a_set_point_is_expected_to_be_is_on_its_own_scale() -> None:
    """40 degC are not 313 of a degree Celsius."""
    path = "heat.proportional.setpoint"
    heater = {"into": "case", "power": "20 [W]", "proportional": {"gain": "2 [W/K]", "setpoint": "40 [degC]"}}
    model = box({"loads/heat": heater})
    found = calibrate(model, log(model, {}, {"T": "case"}, seed=3), [path])
    value = found[path]
    wider = replace(found.values, items_={**found.values, path: replace(value, error=2.0 * value.error)})
    told = str(replace(found, values=wider, expected={path: (313.15 + 1.25, 0.5)}))
    assert "41.25 degC        +- 0.5   (the curves have " in told
