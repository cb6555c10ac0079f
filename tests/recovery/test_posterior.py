"""Posterior samples against the fit."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import IdentificationError, NameNotFoundError
from thermid.inference._posterior import _Density
from unit.fit.test_search import BENCH, case, log

pytestmark = pytest.mark.recovery


@pytest.fixture(scope="module")
def fit() -> td.Calibration:
    """One parameter, the other as in the truth."""
    return td.calibrate(case(0.1, 1.5), log(), ["near.conductance"], scenario=BENCH)


@pytest.fixture(scope="module")
def short(fit: td.Calibration) -> td.inference.Posterior:
    """Chains that begin with twenty steps and run on."""
    pytest.importorskip("emcee")
    return td.inference.posterior(fit, steps=20)


def on_a_ridge() -> td.Calibration:
    """Two conductances in series, told apart by a small mass between them only."""

    def ridge(first: float, second: float) -> td.Model:
        links = {"inner": (["case", "mid"], first), "outer": (["mid", "air"], second)}
        paths = {
            name: {"kind": "conduction", "between": ends, "conductance": {"value": f"{value} [W/K]", "min": 0.05, "max": 20}}
            for name, (ends, value) in links.items()
        }
        nodes = {"case": {"capacitance": "500 [J/K]"}, "mid": {"capacitance": "60 [J/K]"}}
        loads = {"heat": {"into": "case", "power": "5 [W]"}}
        return td.model_from_dict({"title": "Ridge", "needs": ["air"], "nodes": nodes, "conductors": paths, "loads": loads})

    times = np.linspace(0.0, 7200.0, 61)
    bench = td.Scenario("bench", {"air": "20 [degC]"}, start="20 [degC]", duration="2 [h]")
    seen = td.simulate(ridge(1.0, 0.8), bench, times=times)["case"].kelvin + 0.05 * np.random.default_rng(1).standard_normal(times.size)
    record = td.Record.from_arrays(
        "bench", times, {"T": td.Channel.from_array("T", seen, unit="K", role="node", target="case", noise=0.05)}
    )
    return td.calibrate(ridge(1.1, 0.7), record, ["inner.conductance", "outer.conductance"], scenario=bench)


def exact_interval(density: _Density, wide: float) -> np.ndarray:
    """Quantiles (3,) of the first parameter: its marginal over a fine grid, by a quadratic law across the ridge at each point. [SI]"""
    middle = density.rest[density.at]
    first, logs, second = middle[0] + np.linspace(-wide, wide, 81), [], middle[1]
    for a in first.tolist():
        for step in (3e-3, 1e-3, 1e-3):  # Newton's method on three points
            low, at, high = (density(np.array([a, second + d])) for d in (-step, 0.0, step))
            curvature = (low - 2.0 * at + high) / step**2
            second -= (high - low) / (2.0 * step) / curvature
        logs.append(density(np.array([a, second])) - 0.5 * math.log(-curvature))
    weights = np.exp(np.array(logs) - max(logs))
    share = np.cumsum(weights) - 0.5 * weights
    return np.asarray(np.exp(np.interp([0.025, 0.5, 0.975], share / weights.sum(), first)))


class TestSamples:
    def test_a_posterior_of_a_quadratic_valley_is_the_fit(self, fit: td.Calibration) -> None:
        pytest.importorskip("emcee")
        found = td.inference.posterior(fit, steps=200)
        low, high = found.interval("near.conductance")
        value = fit["near.conductance"]
        assert (low, high) == pytest.approx((value.value - 1.96 * value.error, value.value + 1.96 * value.error), abs=0.25 * value.error)
        assert found.evaluations > 200 * 12
        assert found.independent > 0.3 * len(found.draws["near.conductance"])
        assert f" {len(found.draws['near.conductance'])} draws, " in f" {found}"
        with raises_code("name.unknown", NameNotFoundError):
            found.interval("near.conductanc")

    def test_short_chains_run_on(self, short: td.inference.Posterior) -> None:
        assert short.independent > 50 * 12

    def test_chains_on_a_ridge_that_stay_short_give_no_interval(self) -> None:
        pytest.importorskip("emcee")
        along = r"'(inner|outer)\.conductance' up, '(inner|outer)\.conductance' down"
        with raises_code("fit.chains-too-short", IdentificationError, match=rf" 160 .* \d+ .* {along}"):
            td.inference.posterior(on_a_ridge(), steps=10)

    @pytest.mark.campaign
    def test_the_interval_on_a_ridge_is_the_exact_one(self) -> None:
        """It was half as wide, with a warning behind it."""
        pytest.importorskip("emcee")
        fit = on_a_ridge()
        low, _, high = exact_interval(_Density.of_fit(fit).stretched(fit), 0.35)
        assert td.inference.posterior(fit).interval("inner.conductance") == pytest.approx((low, high), abs=0.15 * (high - low))

    def test_workers_give_the_same_draws(self, fit: td.Calibration, short: td.inference.Posterior) -> None:
        """And of few parameters twelve chains are made, as the page says."""
        with ThreadPoolExecutor(2) as pool:
            found = td.inference.posterior(fit, steps=20, walkers=12, executor=pool)
        assert all(np.array_equal(found.draws[n], short.draws[n]) for n in short.draws)
        assert found.evaluations == short.evaluations

    def test_draws_feed_an_ensemble(self, fit: td.Calibration, short: td.inference.Posterior) -> None:
        assert td.ensemble(fit.model, BENCH, {k: v[:16] for k, v in short.draws.items()}).members == 16

    def test_refusals(self, fit: td.Calibration) -> None:
        pytest.importorskip("emcee")
        with raises_code("fit.needs-session", IdentificationError):
            td.inference.posterior(replace(fit, problem=None))
        with raises_code("fit.not-possible", IdentificationError, match="'linear'"):
            td.inference.posterior(td.calibrate(fit.model, log(), ["near.conductance"], scenario=BENCH, loss="huber"))
        with raises_code("fit.nothing-free", IdentificationError):
            td.inference.posterior(td.calibrate(fit.model, log(), [], scenario=BENCH))
