"""Search beyond one valley: populations, further starts, evolution."""

from __future__ import annotations

import math
import re
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from importlib import import_module
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base import errors
from thermid.base.errors import IdentificationError, MissingExtraError
from thermid.fit._minimisation import LOSSES
from thermid.fit._problem.gather import build_problem
from thermid.fit._problem.request import Request
from thermid.fit._problem.residuals import Prior, Unknown
from thermid.fit._search import Population, box_of, evolved
from thermid.simulation._many import tasks

pytestmark = pytest.mark.usefixtures("values_alone")

TIMES = np.linspace(0.0, 6000.0, 201)
BENCH = td.Scenario("bench", boundaries={"air": "20 [degC]"}, start="20 [degC]", duration="6000 [s]")
PATHS = ["near.conductance", "far.conductance"]


def case(near: float, far: float, second: bool = True, bounded: bool = True) -> td.Model:
    """A case with one or two hidden masses behind it; which of two lags belongs to which mass makes two valleys."""

    def free(value: float) -> dict[str, Any]:
        return {"value": f"{value!r} [W/K]"} | ({"min": 0.005, "max": 20} if bounded else {})

    deck: dict[str, Any] = {
        "title": "Case with hidden masses" if second else "Case with one hidden mass",
        "needs": ["air"],
        "nodes": {"case": {"capacitance": "100 [J/K]"}, "one": {"capacitance": "400 [J/K]"}},
        "conductors": {
            "out": {"kind": "conduction", "between": ["case", "air"], "conductance": "0.3 [W/K]"},
            "near": {"kind": "conduction", "between": ["case", "one"], "conductance": free(near)},
        },
        "loads": {"heat": {"into": "case", "power": "10 [W]"}},
    }
    if second:
        deck["nodes"]["two"] = {"capacitance": "600 [J/K]"}
        deck["conductors"]["far"] = {"kind": "conduction", "between": ["case", "two"], "conductance": free(far)}
    return td.model_from_dict(deck)


def log(near: float = 0.08, far: float = 1.5, noise: float | None = 0.05) -> td.Record:
    truth = td.simulate(case(near, far, bounded=False), BENCH, times=TIMES)
    readings = truth["case"].kelvin + 0.05 * np.random.default_rng(1).standard_normal(TIMES.size)
    return td.Record.from_arrays(
        "bench", TIMES, {"T": td.Channel.from_array("T", readings, unit="K", role="node", target="case", noise=noise)}
    )


def fitted(how: str, start: tuple[float, float] = (1.5, 0.08), **more: Any) -> td.Calibration:
    return td.calibrate(case(*start), log(**more), PATHS, scenario=BENCH, search=how)


class TestValleys:
    def test_one_descent_ends_in_the_valley_that_it_starts_in(self) -> None:
        assert fitted("local").reduced_chi_square > 50

    def test_doubtful_residuals_make_it_look_further(self) -> None:
        found = fitted("auto")
        assert found.reduced_chi_square < 1.2
        assert found["near.conductance"].value == pytest.approx(0.08, rel=0.02)
        assert found["far.conductance"].value == pytest.approx(1.5, rel=0.1)
        assert "9.6 times " in found.search
        assert "104." in found.search
        assert found.search in str(found)
        assert found.evaluations > 64

    @pytest.mark.parametrize("how", ["multistart", "differential evolution"])
    def test_every_search_ends_in_the_better_one(self, how: str) -> None:
        found = fitted(how)
        assert found.chi_square == pytest.approx(fitted("auto").chi_square, abs=0.01)
        assert how in found.search

    @pytest.mark.parametrize("workers", [ThreadPoolExecutor(2), pytest.param(2, marks=pytest.mark.campaign)])
    def test_descents_by_workers_end_at_the_same_values(self, workers: Any, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(tasks, "PROCESSES_PAY", 0.0)
        found = td.calibrate(case(1.5, 0.08), log(), PATHS, scenario=BENCH, search="multistart", executor=workers)
        alone = fitted("multistart")
        assert (found.fitted, found.evaluations, found.search) == (alone.fitted, alone.evaluations, alone.search)

    def test_few_seconds_stay_in_one_process(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(tasks, "_pool", None)
        assert td.calibrate(case(0.5, 1.5), log(), PATHS, scenario=BENCH, search="multistart", executor=2).search

    def test_a_good_fit_is_left_alone(self) -> None:
        near = (0.1, 1.0)
        assert fitted("auto", near).search == ""
        assert fitted("auto", near).evaluations == fitted("local", near).evaluations

    def test_traces_too_short_to_ask_contradict_nothing(self) -> None:
        full = log(near=0.1, far=1.0)
        few = td.Record.from_arrays(
            "few", TIMES[::20], {"T": td.Channel.from_array("T", full["T"].values[::20], unit="K", role="node", target="case", noise=0.05)}
        )
        assert td.calibrate(case(0.1, 1.0), few, PATHS, scenario=BENCH).search == ""

    def test_values_at_a_bound_make_it_look_further(self) -> None:
        found = td.calibrate(case(0.5, 1.5), log(near=0.002, far=0.4, noise=None), PATHS, scenario=BENCH)
        assert re.search(r"'near\.conductance' ", found.search)
        assert found.evaluations > 64

    def test_a_bound_where_all_readings_are_met_takes_one_further_descent(self) -> None:
        found = td.calibrate(case(0.5, 1.5), log(near=0.0048, far=0.4), PATHS, scenario=BENCH)
        assert found["near.conductance"].value == pytest.approx(0.005, rel=1e-3)
        assert found.evaluations < 64

    def test_other_values_that_fit_as_well_are_told(self) -> None:
        # equal masses behind the case: their conductances can be exchanged
        twin = case(0.3, 0.6).with_values({"two.capacitance": "400 [J/K]"})
        readings = td.simulate(twin, BENCH, times=TIMES)["case"].kelvin
        record = td.Record.from_arrays(
            "bench", TIMES, {"T": td.Channel.from_array("T", readings, unit="K", role="node", target="case", noise=0.05)}
        )
        found = td.calibrate(twin, record, PATHS, scenario=BENCH, search="multistart")
        assert any(re.search(r"'\w+\.conductance' .* [\d.]+ ", w) for w in found.warnings)

    def test_an_unknown_search_is_refused(self) -> None:
        with raises_code("name.unknown", IdentificationError, match="'multi-start'.*'multistart'"):
            fitted("multi-start")

    def test_a_missing_package_is_named(self, monkeypatch: pytest.MonkeyPatch) -> None:
        def absent(name: str) -> Any:
            if name == "emcee":
                raise ImportError(name)
            return import_module(name)

        monkeypatch.setattr(errors, "import_module", absent)
        with raises_code("extra.not-installed", MissingExtraError, match="'emcee'"):
            td.inference.posterior(fitted("local"))


class TestPopulation:
    def population(self, loss: str = "linear", knee: float = 1.0) -> Population:
        problem = build_problem(Request(case(0.3, 0.9), (log(),), tuple(PATHS), {"*": BENCH}))
        return Population.of_problem(replace(problem, noise={"T": 0.05}), loss, knee)

    @pytest.mark.parametrize("loss", LOSSES)
    def test_costs_are_those_of_the_fit(self, loss: str) -> None:
        population = self.population(loss, 3.0)
        shares = np.random.default_rng(5).uniform(size=(4, 2))
        for cost, point in zip(population.costs(shares), population.placed(shares), strict=True):
            rows = population.problem.compressed(point, loss, 3.0).rows
            assert cost == pytest.approx(0.5 * float(rows @ rows), rel=2e-3)

    def test_the_unit_cube_is_the_box(self) -> None:
        population = self.population()
        assert population.placed(np.array([[0.0, 1.0]]))[0] == pytest.approx(np.log([0.005, 20.0]))
        assert population.share(np.log([0.005, 20.0])) == pytest.approx([0.0, 1.0])

    def test_evolution_alone_comes_near(self) -> None:
        found = evolved(self.population())
        assert found.cost == pytest.approx(0.5 * fitted("multistart").chi_square, rel=0.01)


@pytest.mark.parametrize(
    ("unknown", "box"),
    [
        (Unknown("a", "parameter", (), 2.0, True, 1.0, 4.0), (0.0, math.log(4.0))),
        (Unknown("a", "parameter", (), 2.0, True), (math.log(0.2), math.log(20.0))),
        (Unknown("a", "parameter", (), 0.0, False), (-0.2, 0.2)),
        (Unknown("a", "parameter", (), 5.0, False, 0.0, 20.0, Prior(6.0, 1.0)), (2.0, 10.0)),
        (Unknown("a", "parameter", (), 1.0, False, 0.0), (0.0, 3.0)),
    ],
)
def test_where_an_unknown_is_looked_for(unknown: Unknown, box: tuple[float, float]) -> None:
    assert box_of(unknown) == pytest.approx(box)
