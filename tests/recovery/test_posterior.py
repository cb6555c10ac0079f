"""Posterior samples and evidence against the fit, an integral, and a structure that is wrong."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import thermid as td
from thermid.base.errors import IdentificationError, NameNotFoundError
from thermid.inference._posterior import _Density
from unit.fit.test_search import BENCH, case, log

pytestmark = pytest.mark.recovery


@pytest.fixture(scope="module")
def fit() -> td.Calibration:
    """One parameter, the other as in the truth."""
    return td.calibrate(case(0.1, 1.5), log(), ["near.conductance"], scenario=BENCH)


class TestSamples:
    def test_a_posterior_of_a_quadratic_valley_is_the_fit(self, fit: td.Calibration) -> None:
        pytest.importorskip("emcee")
        found = td.inference.posterior(fit, steps=200)
        low, high = found.interval("near.conductance")
        value = fit["near.conductance"]
        assert (low, high) == pytest.approx((value.value - 1.96 * value.error, value.value + 1.96 * value.error), abs=0.25 * value.error)
        assert found.evaluations > 200 * 12
        assert found.independent > 0.3 * len(found.draws["near.conductance"])
        assert f"{len(found.draws['near.conductance'])} draws, effective sample size " in str(found)
        with pytest.raises(NameNotFoundError, match="was not sampled"):
            found.interval("near.conductanc")

    def test_short_chains_say_so(self, fit: td.Calibration) -> None:
        pytest.importorskip("emcee")
        assert any("are needed. Give more steps." in w for w in td.inference.posterior(fit, steps=40).warnings)

    def test_draws_feed_an_ensemble(self, fit: td.Calibration) -> None:
        pytest.importorskip("emcee")
        draws = {k: v[:16] for k, v in td.inference.posterior(fit, steps=30).draws.items()}
        assert td.ensemble(fit.model, BENCH, draws).members == 16

    def test_evidence_is_the_integral_over_the_box(self, fit: td.Calibration) -> None:
        pytest.importorskip("dynesty")
        found = td.inference.evidence(fit, points=40)
        density = _Density.of(fit)
        (low, high), value = density.box[0], fit["near.conductance"]
        fine = math.log(value.value) + value.error / value.value * np.linspace(-8.0, 8.0, 201)
        logs = np.array([density(np.array([x])) for x in fine])
        exact = logs.max() + math.log(np.trapezoid(np.exp(logs - logs.max()), fine) / (high - low))
        assert found.log == pytest.approx(exact, abs=3.5 * found.error)

    def test_evidence_prefers_the_structure_that_made_the_log(self, fit: td.Calibration) -> None:
        pytest.importorskip("dynesty")
        short = td.calibrate(case(0.3, 1.0, second=False), log(), ["near.conductance"], scenario=BENCH)
        words = td.inference.evidence(fit, points=30).against(td.inference.evidence(short, points=30))
        assert "over 'Case with one hidden mass'" in words
        assert "strong" in words

    def test_refusals(self, fit: td.Calibration) -> None:
        pytest.importorskip("emcee")
        pytest.importorskip("dynesty")
        with pytest.raises(IdentificationError, match="samples need a fit made in this session,"):
            td.inference.posterior(replace(fit, problem=None))
        with pytest.raises(IdentificationError, match="samples need the loss 'linear',"):
            td.inference.posterior(td.calibrate(fit.model, log(), ["near.conductance"], scenario=BENCH, loss="huber"))
        with pytest.raises(IdentificationError, match="noise of every sensor"):
            td.inference.evidence(td.calibrate(fit.model, log(noise=None), ["near.conductance"], scenario=BENCH))
        with pytest.raises(IdentificationError, match="no parameter was free, so there is nothing to sample"):
            td.inference.posterior(td.calibrate(fit.model, log(), [], scenario=BENCH))
