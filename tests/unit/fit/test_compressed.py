"""The few rows that a fit works on hold what all residuals and their derivatives hold; their sums give the statistics of the traces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from by_code import raises_code
from thermid.base.errors import SolverError
from thermid.fit._calibrate import calibrate
from thermid.fit._problem.gather import build_problem
from thermid.fit._problem.request import LocalSpec, Reading, Request
from thermid.fit._problem.residuals import Predictions, Problem, Sums, compressed_in_full, pooled
from thermid.fit._uncertainty.information import EXACT
from thermid.measure.records import Record
from thermid.model.tree import model_from_dict
from thermid.simulation.runs import Scenario
from unit.fit.bench import HTC, MASS, box, deck, log, metered, pair


def in_full(problem: Problem, at: np.ndarray) -> np.ndarray:
    """All weighted residuals of the very run that gives the derivatives; without these the integrator iterates a little differently."""
    parts = []
    for i, bench in enumerate(problem.benches()):
        columns, _ = bench.temperatures(problem.inputs(i, at)[0], True, problem.options)
        for k, o in enumerate(bench.experiment.observations):
            parts.append((o.measured - (columns[o.index, k] + problem._bias(o.sensor, at)[0])) / o.sigma(problem.noise))
    return np.concatenate(parts)


def check(request: Request, loss: str = "linear", knee: float = 1.0, tolerance: float = 1e-10) -> Problem:
    """Compare at the start, moved a little so that a constant error of zero or a factor of one hides nothing."""
    problem = build_problem(request)
    at = np.array([u.to_fitted(u.start) for u in problem.unknowns])
    at = at + 0.03 * np.array([u.scale if u.kind != "local" else 1.0 for u in problem.unknowns])
    few, r, j = problem.compressed(at, loss, knee), in_full(problem, at), problem.jacobian(at)
    z = (r / knee) ** 2
    rho, weight = (z, np.ones_like(z)) if loss == "linear" else (2 * (np.sqrt(1 + z) - 1), (1 + z) ** -0.5)
    r, j = np.sqrt(weight) * r, np.sqrt(weight)[:, None] * j
    size = np.linalg.norm(j, axis=0)
    size[size == 0] = 1.0
    assert few.rows.size < max(r.size, 8)
    assert few.slopes.T @ few.slopes / np.outer(size, size) == pytest.approx(j.T @ j / np.outer(size, size), abs=tolerance)
    assert few.slopes.T @ few.rows / size == pytest.approx(j.T @ r / size, abs=tolerance * np.linalg.norm(r))
    assert few.rows @ few.rows == pytest.approx(knee**2 * rho.sum(), rel=tolerance)
    assert few.chi_square == pytest.approx(r @ r, rel=tolerance)
    ends = np.cumsum([o.index.size for o in problem.observations()])[:-1]
    left = np.split(in_full(problem, at), ends)
    for block, o, e, (record, sensor, sums) in zip(problem.blocks(at), problem.observations(), left, few.sums, strict=True):
        assert (block.record, block.sensor) == (record, sensor)
        told, whole = sums.statistics(0.1), Sums.of_residuals(e * o.sigma(problem.noise)).statistics(0.1)
        assert told.samples == whole.samples
        assert (told.rmse, told.mean, told.largest, told.lag_one) == pytest.approx(
            (whole.rmse, whole.mean, whole.largest, whole.lag_one), rel=1e-8, abs=1e-10
        )
    return problem


@pytest.mark.parametrize(("loss", "knee"), [("linear", 1.0), ("soft_l1", 1.0), ("soft_l1", 2.5)])
def test_parameters_and_constant_errors(loss: str, knee: float) -> None:
    data = metered(log(box(), {}, {"T": "case"}, accuracy=0.5, samples=301), "heat", 4.0, accuracy=0.04)
    data = data.with_channels(replace(data["ROOM"], accuracy=0.3))
    check(Request(box(), (data,), (HTC, MASS)), loss, knee)


@pytest.mark.parametrize("loss", ["linear", "soft_l1"])
def test_an_eliminated_node_next_to_a_boundary_with_an_error(loss: str) -> None:
    stack = pair({"joints/stack/gap": {"area": "30 [cm^2]", "htc": "5 [W/(m^2 K)]", "to": "room"}})
    data = log(stack, {}, {"A": "a.case", "M": "mid"}, boundary="room", samples=141, accuracy=0.2).mask("A", 0.0, 3600.0)
    data = data.with_channels(replace(data["ROOM"], accuracy=0.3))
    check(Request(stack, (data,), ("stack.gap.htc", "stack.contact_conductance"), weights={"A": 0.4}), loss)


def test_a_massless_node_that_the_kernel_keeps() -> None:
    made = deck({"nodes/face": {}, "surfaces/skin/of": "face", "surfaces/skin/emissivity": 0.8})
    made["surfaces"]["skin"]["htc"] = {"coefficient": "2 [W/(m^2 K)]", "exponent": 0.25}
    del made["surfaces"]["skin"]["effective_htc"]
    made["conductors"] = {"wall": {"kind": "conduction", "between": ["case", "face"], "conductance": {"value": "2 [W/K]", "min": 0.1}}}
    model = model_from_dict(made)
    data = log(model, {}, {"T": "case", "F": "face"}, samples=141, accuracy=0.2)
    check(Request(model, (data,), ("skin.htc.coefficient", "wall.conductance")))


def test_a_thermostat() -> None:
    made = deck({"loads/heat/thermostat": {"on_below": "26 [degC]", "off_above": "27 [degC]"}, "parameters/power/value": "8 [W]"})
    data = log(model_from_dict(made), {}, {"T": "case"}, samples=301, swing=0.0)
    problem = check(Request(model_from_dict(made), (data,), (HTC, "power")))
    trace = problem.blocks(np.array([u.to_fitted(u.start) for u in problem.unknowns]))[0].predicted
    assert np.count_nonzero(np.diff(np.sign(np.diff(trace)))) > 3, "it switches"


def test_several_records_and_what_each_has_for_itself() -> None:
    data = tuple(log(box(), {}, {"T": "case"}, accuracy=0.5, samples=141, name=n, seed=k).select("T") for k, n in enumerate("ab"))
    check(Request(box(), data, (HTC,), local={"air": LocalSpec("24 [degC]", 2.0)}, readings={"initial.case": Reading("T")}))


def test_a_steady_start() -> None:
    data = log(box(), {}, {"T": "case"}, samples=41, start="steady")
    check(Request(box(), (data,), (HTC, "power"), scenarios={"*": Scenario("s", start="steady")}))


def test_nothing_free() -> None:
    data = log(box(), {}, {"T": "case"}, samples=41)
    problem = build_problem(Request(box(), (data,), fit_start=False))
    few = problem.compressed(np.zeros(0))
    assert few.slopes.shape == (1, 0)
    assert few.rows @ few.rows == pytest.approx(np.sum(problem.residuals(np.zeros(0)) ** 2), rel=1e-12)


def test_a_product_of_two_parameters_is_one_direction_to_rounding() -> None:
    data = log(box(), {}, {"T": "case"}, samples=301)
    problem = replace(build_problem(Request(box(), (data,), (HTC, "skin.area"))), options=EXACT)
    rows = problem.compressed(np.array([u.to_fitted(u.start) for u in problem.unknowns])).slopes
    s = np.linalg.svd(rows / np.linalg.norm(rows, axis=0), compute_uv=False)
    assert s[-1] < 1e-10 * s[0]
    assert s[-2] > 1e-3 * s[0]


def test_as_many_rows_for_any_number_of_samples() -> None:
    data = log(box(), {}, {"T": "case"}, accuracy=0.5, samples=18001)

    def rows(record: Record) -> int:
        problem = build_problem(Request(box(), (record,), (HTC,)))
        return problem.compressed(np.array([u.to_fitted(u.start) for u in problem.unknowns])).rows.size

    # HTC, start and the sensor's error, and one more
    assert rows(data) == rows(data.resample(10.0)) == 4


def test_sums_add_up() -> None:
    rng = np.random.default_rng(1)
    parts = [300.0 + rng.standard_normal(n) for n in (7, 1, 100)]
    together, whole = pooled([Sums.of_residuals(p) for p in parts]), Sums.of_residuals(np.concatenate(parts))
    for name in ("count", "first", "last", "total", "squares", "lagged", "largest"):
        assert getattr(together, name) == pytest.approx(getattr(whole, name), rel=1e-10), name
    centred = np.concatenate(parts) - np.concatenate(parts).mean()
    told = whole.statistics(0.0)
    assert told.lag_one == pytest.approx(centred[1:] @ centred[:-1] / (centred @ centred), rel=1e-9)
    assert told.rmse == pytest.approx(np.sqrt(np.mean(np.concatenate(parts) ** 2)), rel=1e-12)
    assert told.mean == pytest.approx(np.concatenate(parts).mean(), rel=1e-12)


def test_blocks_are_predicted_when_they_are_looked_at() -> None:
    data = [log(box(), {}, {"T": "case"}, samples=61, name=n, seed=k) for k, n in enumerate("ab")]
    found = calibrate(box(), data, [HTC])
    assert isinstance(found.blocks, Predictions)
    told, pool = found.statistics, found.sensors
    looked = replace(found, blocks=tuple(found.blocks))
    assert found.blocks[0] is found.blocks[0]
    for record, sensors in looked.statistics.items():
        assert told[record]["T"].rmse == pytest.approx(sensors["T"].rmse, rel=1e-9)
    assert pool["T"].lag_one == pytest.approx(looked.sensors["T"].lag_one, abs=1e-9)
    assert [b.record for b in found.blocks[:]] == ["a", "b"]


@pytest.mark.parametrize(
    ("unknown", "value", "loss"),
    [("sensor T", -1e300, "linear"), ("sensor T", 1e160, "linear"), ("sensor T", 1e300, "soft_l1")],
)
def test_what_overflows_is_refused_in_a_sentence_and_warns_of_nothing(unknown: str, value: float, loss: str) -> None:
    problem = build_problem(Request(box(), (log(box(), {}, {"T": "case"}, accuracy=0.5, samples=41),), (HTC, MASS)))
    at = np.array([u.to_fitted(u.start) for u in problem.unknowns])
    at[[u.name for u in problem.unknowns].index(unknown)] = value
    with raises_code("run.did-not-finish", SolverError):
        problem.compressed(at, loss)
    with raises_code("run.did-not-finish", SolverError):
        compressed_in_full(problem, 0, at, loss, 1.0)
