"""Exact derivatives equal finite differences, for everything that a fit can look for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from thermid.base.linear_algebra import inverse_square_root
from thermid.fit._error_model.elements import DepartureHeat, with_heats
from thermid.fit._problem.gather import build_problem
from thermid.fit._problem.request import LocalSpec, Reading, Request
from thermid.fit._problem.residuals import FAILED, Problem, Unknown, loss_of
from thermid.fit._uncertainty.information import Information
from thermid.measure.records import Channel
from thermid.model.tree import Constant, model_from_dict
from thermid.simulation.runs import Engine, Options, Scenario, Wiring, compile_network
from unit.fit.bench import HTC, MASS, box, deck, log, metered, pair

STEP = 3e-5
EXACT = Options(error=8e-9)


def slopes(problem: Problem) -> tuple[np.ndarray, np.ndarray]:
    """The exact and the central-difference Jacobian at the start, columns scaled to a typical change."""
    at = np.array([u.to_fitted(u.start) for u in problem.unknowns])
    # away from the start, where a bias of zero or a factor of one could hide a wrong term
    at = at + 0.03 * np.array([u.scale if u.kind != "local" else 1.0 for u in problem.unknowns])
    columns = []
    for k in range(at.size):
        step = np.zeros(at.size)
        step[k] = STEP
        columns.append((problem.residuals(at + step) - problem.residuals(at - step)) / (2 * STEP))
    return problem.jacobian(at), np.column_stack(columns)


def check(request: Request, names: set[str]) -> None:
    problem = replace(build_problem(request), options=EXACT)
    assert {u.name for u in problem.unknowns} == names
    exact, differences = slopes(problem)
    size = np.abs(differences).max(axis=0)
    assert (size > 0).all(), "every unknown acts"
    assert np.abs(exact - differences).max(axis=0) / size == pytest.approx(0, abs=3e-5)


def test_parameter_bias_and_initial() -> None:
    data = log(box(), {}, {"T": "case"}, accuracy=0.5, samples=41)
    check(Request(box(), (data,), (HTC, MASS, "power")), {HTC, MASS, "power", "sensor T", "bench: initial.case"})


def test_a_linear_parameter() -> None:
    model = box({"parameters/power/min": 0})
    check(Request(model, (log(model, {}, {"T": "case"}, samples=41),), ("power",)), {"power", "bench: initial.case"})


def test_boundary_local_and_initial_local() -> None:
    data = log(box(), {}, {"T": "case"}, samples=41).select("T")
    local = {"air": LocalSpec("24 [degC]", 2.0), "initial.case": LocalSpec("T")}
    check(Request(box(), (data,), (HTC,), local=local), {HTC, "bench: air", "bench: initial.case"})


def test_errors_of_a_logged_room_and_of_a_meter() -> None:
    data = metered(log(box(), {}, {"T": "case"}, samples=41), "heat", 4.0, accuracy=0.04)
    data = data.with_channels(replace(data["ROOM"], accuracy=0.3))
    check(Request(box(), (data,), (HTC,)), {HTC, "bench: initial.case", "ROOM error", "METER error"})


@pytest.mark.parametrize("role", ["load", "command"])
def test_command_and_gain(role: str) -> None:
    model = box({"parameters/alpha": "3 [W]"})
    duty = Channel.from_array("Q", (np.arange(41) % 20 < 10) * 0.8, quantity="command", role=role, target="heat", gain="alpha")
    data = log(model, {}, {"T": "case"}, samples=41).with_channels(duty)
    check(Request(model, (data,), ("alpha", HTC)), {"alpha", HTC, "bench: initial.case"})


def test_a_command_without_gain_scales_the_decks_power() -> None:
    duty = Channel.from_array("Q", (np.arange(41) % 20 < 10) * 0.8, quantity="command", role="command", target="heat")
    data = log(box(), {}, {"T": "case"}, samples=41).with_channels(duty)
    check(Request(box(), (data,), ("power", HTC)), {"power", HTC, "bench: initial.case"})


def test_tied_instances_and_an_eliminated_node() -> None:
    stack = pair()
    data = log(stack, {}, {"A": "a.case", "M": "mid"}, boundary="room", samples=41, start="30 [degC]")
    free = ("a.skin.effective_htc", "a.case.mass", "stack.contact_conductance")
    check(Request(stack, (data,), free, scenarios={"*": Scenario("s", start="room", initial={"b.case": "20 [degC]"})}), set(free))


def test_an_eliminated_node_next_to_a_boundary_with_an_error() -> None:
    stack = pair({"joints/stack/gap": {"area": "30 [cm^2]", "htc": "5 [W/(m^2 K)]", "to": "room"}})
    data = log(stack, {}, {"M": "mid"}, boundary="room", samples=41, start="30 [degC]")
    data = data.with_channels(replace(data["ROOM"], accuracy=0.3))
    request = Request(stack, (data,), ("stack.gap.htc",), scenarios={"*": Scenario("s", start="30 [degC]")})
    check(request, {"stack.gap.htc", "ROOM error"})


def test_a_sensor_whose_first_reading_is_the_start() -> None:
    data = log(box(), {}, {"T": "case"}, accuracy=0.5, samples=41)
    request = Request(box(), (data,), (HTC,), readings={"initial.case": Reading("T")})
    check(request, {HTC, "sensor T"})


def test_an_offset_on_a_reading_of_a_boundary() -> None:
    model = box({"parameters/lift": "0.5 [K]"})
    data = log(model, {}, {"T": "case"}, accuracy=0.5, samples=41, start="30 [degC]").select("T")
    request = Request(model, (data,), (HTC, "lift"), readings={"air": Reading("T", "lift")})
    check(request, {HTC, "lift", "sensor T", "bench: initial.case"})


def test_a_sensor_on_which_everything_stands_has_no_error_that_shows() -> None:
    model = box({"parameters/lift": "0.5 [K]"})
    data = log(model, {}, {"T": "case"}, accuracy=0.5, samples=41, start="30 [degC]").select("T")
    readings = {"air": Reading("T", "lift"), "initial.case": Reading("T")}
    problem = replace(build_problem(Request(model, (data,), (HTC, "lift"), readings=readings)), options=EXACT)
    at = np.array([u.to_fitted(u.start) for u in problem.unknowns])
    column = problem.jacobian(at)[:, [u.name for u in problem.unknowns].index("sensor T")]
    assert column == pytest.approx(0.0, abs=1e-6)


def test_a_steady_start() -> None:
    data = log(box(), {}, {"T": "case"}, samples=41, start="steady")
    check(Request(box(), (data,), (HTC, "power"), scenarios={"*": Scenario("s", start="steady")}), {HTC, "power"})


def test_power_law_and_radiation() -> None:
    changes = {
        "surfaces/skin/effective_htc": None,
        "surfaces/skin/htc": {"coefficient": "2 [W/(m^2 K)]", "exponent": 0.25},
        "surfaces/skin/emissivity": {"value": "0.6", "min": 0.05, "max": 1},
    }
    made = deck(changes)
    del made["surfaces"]["skin"]["effective_htc"]
    model = model_from_dict(made)
    data = log(model, {}, {"T": "case"}, samples=41, start="60 [degC]")
    free = ("skin.htc.coefficient", "skin.emissivity", MASS)
    check(Request(model, (data,), free), {*free, "bench: initial.case"})


def test_several_records_share_and_have_their_own() -> None:
    data = tuple(log(box(), {}, {"T": "case"}, accuracy=0.5, samples=41, name=n, seed=k) for k, n in enumerate("ab"))
    request = Request(box(), data, (HTC,))
    check(request, {HTC, "sensor T", "a: initial.case", "b: initial.case"})
    problem = build_problem(request)
    at = np.array([u.to_fitted(u.start) for u in problem.unknowns])
    jacobian = problem.jacobian(at)
    own = [u.name for u in problem.unknowns].index("a: initial.case")
    assert np.abs(jacobian[:41, own]).max() > 1
    assert not jacobian[41:, own].any()


def test_masked_samples_leave_their_rows_out() -> None:
    stack = pair()
    data = log(stack, {}, {"A": "a.case", "B": "b.case"}, boundary="room", samples=41).mask("A", 0.0, 3600.0)
    problem = build_problem(Request(stack, (data,), ("stack.contact_conductance",)))
    at = np.array([u.to_fitted(u.start) for u in problem.unknowns])
    assert problem.residuals(at).size == problem.samples == problem.jacobian(at).shape[0] == 82 - 9
    blocks = {b.sensor: b for b in problem.blocks(at)}
    assert blocks["A"].times[0] > 3600.0
    np.testing.assert_array_equal(blocks["B"].times, data.times)


def test_a_run_that_fails_stands_as_far_away() -> None:
    data = log(box(), {}, {"T": "case"}, samples=11)
    problem = build_problem(Request(box(), (data,), (HTC,)))
    at = np.array([u.to_fitted(u.start) for u in problem.unknowns])
    poor = replace(problem, options=replace(problem.options, max_steps=1, method="integrator"))
    np.testing.assert_array_equal(poor.residuals(at), FAILED)


@pytest.mark.parametrize("loss", ["linear", "soft_l1", "huber", "cauchy"])
def test_the_weight_of_a_loss_is_its_derivative(loss: str) -> None:
    """By differences, on both sides of the knee; far out a robust loss is below the square."""
    squares, step = np.array([0.01, 1.0, 9.0, 400.0]), 1e-4
    for knee in (1.0, 1.7):
        weight = loss_of(squares, loss, knee)[1]
        slope = (loss_of(squares + step, loss, knee)[0] - loss_of(squares - step, loss, knee)[0]) / (2.0 * step)
        assert slope == pytest.approx(weight, rel=1e-3)
        assert weight[0] == pytest.approx(1.0, abs=0.02)
        assert (loss_of(squares, loss, knee)[0][-1] < 0.5 * squares[-1]) == (loss != "linear")


def test_scattering_readings_hold_less_information_and_a_prior_is_relative_to_its_value() -> None:
    problem = build_problem(Request(box(), (log(box(), {}, {"T": "case"}),), (HTC, MASS)))
    at = np.array([u.to_fitted(u.start) for u in problem.unknowns])
    plain, wide = Information.of_problem(problem, at), Information.of_problem(problem, at, spread=2.0)
    assert wide.data.T @ wide.data == pytest.approx(plain.data.T @ plain.data / 4.0, rel=1e-9)
    one = Unknown("x", "parameter", (), 5.0)
    info = Information((one,), np.array([5.0]), np.zeros((0, 1)), np.zeros((0, 1)), np.zeros((0, 1)))
    assert info.prior_row(0, 0.05)[0, 0] == pytest.approx(1.0 / 0.25)
    assert info.errors(more=info.prior_row(0, 0.05))[0] == pytest.approx(0.05)


def test_an_inherited_value_is_no_reading_beside_inherited_and_own_instruments() -> None:
    """A joint prior of a parameter and a thermometer, and a meter of its own: none of their rows that moves a parameter is of the data."""
    data = metered(log(box(), {}, {"T": "case"}, accuracy=0.5, samples=41), "heat", 3.0, accuracy=0.1)
    problem = build_problem(Request(box(), (data,), (HTC, MASS)))
    names = [u.name for u in problem.unknowns]
    joint = np.array([names.index(HTC), names.index("sensor T")])
    covariance = np.array([[0.04, 0.03], [0.03, 0.09]])
    problem = replace(problem, coupled=((joint, np.zeros(2), inverse_square_root(covariance)),))
    at = np.array([u.to_fitted(u.start) for u in problem.unknowns])
    info, priors = Information.of_problem(problem, at), problem.prior_rows(at)[1]
    assert sum(u.prior is not None and u.kind != "parameter" for u in problem.unknowns) > 1, "one of its own too"
    np.testing.assert_allclose(info.nuisance[:, info.parameters], 0.0, atol=1e-12)
    known = np.concatenate([info.nuisance, info.given])
    np.testing.assert_allclose(known.T @ known, priors.T @ priors, atol=1e-9)
    marginal = (info.nuisance.T @ info.nuisance)[joint[1], joint[1]]
    assert marginal == pytest.approx(1.0 / covariance[1, 1])


def test_readings_and_derivatives_of_one_run_are_those_of_two() -> None:
    data = log(box(), {}, {"T": "case"}, accuracy=0.5, samples=41)
    problem = build_problem(Request(box(), (data,), (HTC, MASS)))
    at = np.array([u.to_fitted(u.start) for u in problem.unknowns])
    blocks, slopes_of_run = problem.blocks_and_slopes(0, at)
    for block, other in zip(blocks, problem.blocks_of(0, at), strict=True):
        np.testing.assert_allclose(block.predicted, other.predicted, atol=1e-9)
    np.testing.assert_array_equal(slopes_of_run, problem.slopes(0, at))


def test_heats_into_several_nodes_have_one_derivative_the_sum_of_theirs() -> None:
    plain, scenario = compile_network(pair()), Scenario("two", boundaries={"room": "20 [degC]"}, start="20 [degC]", duration="1 [h]")
    watts = {"a.case": -2.0, "b.case": 3.0}
    into = {node: Constant(w) for node, w in watts.items()}
    both = DepartureHeat("moved", tuple(into.items()))
    alone = [DepartureHeat(f"moved {node}", ((node, power),)) for node, power in into.items()]
    times = np.linspace(0.0, 3600.0, 7)

    def slopes_of(heats: list[DepartureHeat]) -> np.ndarray:
        wiring = Wiring(*with_heats(plain, scenario, heats), [h.scale for h in heats])
        engine = Engine(wiring)
        start = engine.started(wiring.assemble(np.zeros(len(heats))), True)
        return engine.integrate(start, times, tuple(watts), 3600.0, EXACT, True).sensitivities

    together, each = slopes_of([both]), slopes_of(alone)
    assert np.abs(together).max() > 0.1
    np.testing.assert_allclose(together[:, :, 0], each.sum(axis=2), atol=1e-9)
