"""What an automatic search does beyond one descent: when, at what price, and how the interrupt key ends it."""

from __future__ import annotations

import re
import warnings
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import warns_code
from thermid.fit import _search as search
from thermid.fit._calibrate import fit, requested
from thermid.fit._minimisation import Fit
from thermid.fit._problem.gather import build_problem
from thermid.fit._problem.request import Request
from thermid.fit._search import contradictions, searched

TIMES = np.linspace(0.0, 7200.0, 121)
BENCH = td.Scenario("bench", boundaries={"room": "20 [degC]"}, start="20 [degC]", duration="2 [h]")
LINKS, NOISE = 6, 0.1
FREE = [f"k{i}" for i in range(LINKS)]


def chain(values: dict[str, float] | None = None) -> td.Model:
    """Seven bodies in a row, every second one with a sensor: neighbouring links can stand for one another but for the delay between."""
    deck: dict[str, Any] = {
        "title": "chain",
        "needs": ["room"],
        "parameters": {name: {"value": 1.0, "min": 0.02, "max": 50.0} for name in FREE},
        "nodes": {f"n{i}": {"capacitance": f"{[60, 25, 80, 20, 70, 30, 90][i]} [J/K]"} for i in range(LINKS + 1)},
        "conductors": {
            f"g{i}": {"kind": "conduction", "between": [f"n{i}", f"n{i + 1}"], "conductance": f"k{i}*0.2 [W/K]"} for i in range(LINKS)
        }
        | {f"out{i}": {"kind": "conduction", "between": [f"n{i}", "room"], "conductance": "0.02 [W/K]"} for i in range(LINKS + 1)},
        "loads": {"q": {"into": "n0", "power": "2 [W]"}},
    }
    model = td.model_from_dict(deck)
    return model.with_values(values) if values else model


def log(values: dict[str, float], extra: float = 0.0, noise: float | None = NOISE, seed: int = 3) -> td.Record:
    run = td.simulate(chain(values), BENCH, times=TIMES)
    rng = np.random.default_rng(seed)
    channels = {
        name: td.Channel.from_array(
            name,
            run[name].kelvin + rng.normal(0.0, NOISE, TIMES.size) + extra * (name == "n2") * np.sin(TIMES / 400.0),
            unit="K",
            role="node",
            target=name,
            noise=noise,
        )
        for name in ("n0", "n2", "n4", "n6")
    }
    return td.Record.from_arrays("log", TIMES, channels)


def problem_of(record: td.Record, start: dict[str, float] | None = None) -> Any:
    return build_problem(Request(chain(start), (record,), tuple(FREE), {"*": BENCH}))


TRUTH = {"k0": 0.6, "k1": 2.0, "k2": 0.7, "k3": 1.6, "k4": 1.2, "k5": 0.5}
SWAPPED = {"k0": 2.0, "k1": 0.6, "k2": 1.6, "k3": 0.7, "k4": 0.5, "k5": 1.2}


class Told:
    """A progress that notes what it is told, and presses the interrupt key at some evaluation."""

    def __init__(self, at: int = 0) -> None:
        self.words: list[tuple[str, float]] = []
        self.calls, self.at = 0, at

    def __call__(self, count: int, rms: float) -> None:
        self.calls += 1
        if self.calls == self.at:
            raise KeyboardInterrupt

    def ahead(self, words: str, seconds: float) -> None:
        self.words.append((words, seconds))


class TestContradiction:
    def test_a_valley_beside_the_right_one_contradicts_the_noise_though_it_meets_the_readings(self) -> None:
        problem = problem_of(log(TRUTH))
        right = searched(problem, "local", "linear", 1.0)
        assert contradictions(problem, right) == ""
        assert right.chi_square / problem.freedom == pytest.approx(1.0, abs=0.15)
        shifted = problem_of(log(TRUTH, extra=0.15))
        found = searched(shifted, "local", "linear", 1.0)
        assert found.chi_square / shifted.freedom < 1.5
        assert " in log are not noise" in contradictions(shifted, found)

    def test_noise_alone_seldom_does(self) -> None:
        logs = [problem_of(log(TRUTH, seed=seed), TRUTH) for seed in range(12)]
        assert sum(bool(contradictions(p, searched(p, "local", "linear", 1.0))) for p in logs) <= 1

    def test_nothing_is_said_where_no_noise_is_stated(self) -> None:
        problem = problem_of(log(TRUTH, extra=0.15, noise=None), TRUTH)
        assert contradictions(problem, searched(problem, "local", "linear", 1.0)) == ""


class TestSecondDescent:
    def test_it_confirms_where_the_model_lacks_something(self) -> None:
        problem = problem_of(log(TRUTH, extra=0.15))
        alone, found = (searched(problem, how, "linear", 1.0) for how in ("local", "auto"))
        assert found.search.startswith("residuals of 'n")
        assert " in log " in found.search
        assert found.fitted == pytest.approx(alone.fitted, abs=0.0)
        assert found.evaluations > alone.evaluations

    def test_none_follows_a_fit_that_leaves_noise(self) -> None:
        problem, told = problem_of(log(TRUTH)), Told()
        found = searched(problem, "auto", "linear", 1.0, told)
        assert found.search == ""
        assert [re.findall(r"\d+", words)[:1] for words, _ in told.words] == [["12"]]

    def test_the_better_of_two_ends_is_taken(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """The first descent is made to end in another valley: values at which the log contradicts its noise, called converged."""
        problem = problem_of(log(TRUTH))
        descend, ends = search.minimise, []

        def wrong_first(*given: Any, **more: Any) -> Any:
            end = descend(*given, **more)
            if not ends:
                end = Fit.ended(problem, end.fitted + 0.02 * np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0]))
            ends.append(end)
            return end

        monkeypatch.setattr(search, "minimise", wrong_first)
        found = searched(problem, "auto", "linear", 1.0)
        assert len(ends) == 2
        assert re.search("2 searches, 1 ", found.search)
        assert found.chi_square == ends[1].chi_square < ends[0].chi_square


class TestPrice:
    def test_a_search_says_what_it_will_take_before_it_begins(self) -> None:
        told = Told()
        fit(requested(chain(), (log(TRUTH),), FREE, scenario=BENCH, search="multistart"), told)
        (_, first), (words, whole) = told.words
        assert "up to 5" in words
        assert words  # nobody asked this fit to keep them
        assert 0.0 < first < whole

    def test_plain_python_is_warned_of_a_long_one(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr("thermid.base.errors.LONG_WAIT", 0.0)
        with warns_code("fit.takes-long", match="5.*64"):
            td.calibrate(chain(), log(TRUTH), FREE, scenario=BENCH, search="multistart")

    def test_what_nobody_asked_for_is_limited_and_said(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(search, "UNASKED", 0.0)
        found = td.calibrate(chain(), log(TRUTH, extra=0.6), FREE, scenario=BENCH)
        assert any("= 'multistart'" in w for w in found.warnings)

    def test_what_is_made_unasked_does_not_depend_on_the_clock(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """On a machine on which every look at the clock costs an hour the same descents are made, with the same end."""
        problem = problem_of(log(TRUTH, extra=0.6))
        at_once = searched(problem, "auto", "linear", 1.0)
        assert "searches" in at_once.search
        hours = iter(np.arange(0.0, 3.6e9, 3600.0))
        monkeypatch.setattr(search.time, "perf_counter", lambda: float(next(hours)))
        with warns_code("fit.takes-long"):
            late = searched(problem, "auto", "linear", 1.0)
        assert (late.search, late.evaluations, late.remarks) == (at_once.search, at_once.evaluations, at_once.remarks)
        assert np.array_equal(late.fitted, at_once.fitted)

    def test_what_is_made_unasked_takes_few_evaluations_and_says_what_is_missed_before_it_begins(self) -> None:
        """From this start to ends that miss the readings as far, five whole descents took 379 evaluations with the points."""
        start = dict(zip(FREE, [0.05, 9.0, 0.1, 20.0, 0.1, 9.0], strict=True))
        problem, told = problem_of(log(TRUTH, extra=0.6), start), Told()
        first = searched(problem, "local", "linear", 1.0)
        found = searched(problem, "auto", "linear", 1.0, told)
        assert all(word in told.words[1][0] for word in ("'n2' in log (0.", "thermid criticise"))
        assert found.evaluations <= first.evaluations + search.SCREENED + search.DESCENTS * 2 * search.USUAL
        assert found.chi_square == pytest.approx(searched(problem, "multistart", "linear", 1.0).chi_square, rel=1e-6)

    def test_descents_that_take_a_minute_of_a_processor_are_limited(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """One of this chain takes some 7 nodes, 7 columns, 20 steps and 12 evaluations; what two and a half of them take makes two."""
        problem = problem_of(log(TRUTH, extra=0.6))
        first = searched(problem, "local", "linear", 1.0)
        steps = sum(m.size for m in problem.compressed(first.fitted).meshes)
        monkeypatch.setattr(search, "UNASKED", 2.5 * search.USUAL * steps * 7 * (1 + len(problem.unknowns)))
        found = searched(problem, "auto", "linear", 1.0)
        assert any(" 2 of 5" in w for w in found.remarks)


class TestInterrupt:
    @pytest.mark.parametrize("at", [2, 5])
    def test_a_descent_ends_with_the_best_so_far(self, at: int) -> None:
        problem = problem_of(log(TRUTH))
        found = searched(problem, "auto", "linear", 1.0, Told(at), stoppable=True)
        assert found.stopped
        assert not found.converged
        assert re.search(rf"\b{at} evaluations", found.message)
        whole = searched(problem, "local", "linear", 1.0)
        assert whole.chi_square < found.chi_square <= searched(problem, "auto", "linear", 1.0, Told(1), stoppable=True).chi_square

    def test_the_calibration_is_not_credible_and_says_so(self) -> None:
        found = fit(requested(chain(), (log(TRUTH),), FREE, scenario=BENCH), Told(4), stoppable=True)
        assert found.stopped
        assert found.standing.state == "not credible"
        assert "4 evaluations" in str(found).splitlines()[0]

    def test_a_search_keeps_the_best_of_its_descents(self) -> None:
        problem = problem_of(log(TRUTH))
        whole = searched(problem, "local", "linear", 1.0)
        found = searched(problem, "multistart", "linear", 1.0, Told(whole.evaluations + 3), stoppable=True)
        assert re.search(r"\b1 start\b", found.message)
        assert found.chi_square == whole.chi_square
        assert not found.converged

    def test_evolution_ends_with_its_best_member(self, monkeypatch: pytest.MonkeyPatch) -> None:
        calls, costs = [], search.Population.costs

        def counted(self: Any, shares: Any) -> Any:
            calls.append(shares)
            if len(calls) == 3:
                raise KeyboardInterrupt
            return costs(self, shares)

        monkeypatch.setattr(search.Population, "costs", counted)
        found = searched(problem_of(log(TRUTH)), "differential evolution", "linear", 1.0, stoppable=True)
        assert found.stopped
        assert re.search(r"\d+ members", found.message)

    def test_what_makes_many_fits_is_not_held_up(self) -> None:
        with pytest.raises(KeyboardInterrupt):
            searched(problem_of(log(TRUTH)), "auto", "linear", 1.0, Told(2))

    def test_before_the_first_evaluation_there_is_nothing_to_keep(self, monkeypatch: pytest.MonkeyPatch) -> None:
        problem = problem_of(log(TRUTH))

        def pressed(*_: Any, **__: Any) -> Any:
            raise KeyboardInterrupt

        monkeypatch.setattr(type(problem), "compressed", pressed)
        with warnings.catch_warnings(), pytest.raises(KeyboardInterrupt):
            searched(problem, "auto", "linear", 1.0, stoppable=True)
