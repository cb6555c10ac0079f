"""Where departures of elements explain residuals about as well as noise does, errors count them by their probability."""

from __future__ import annotations

import math

import numpy as np
import pytest

from thermid.fit._calibrate import calibrate
from thermid.fit._error_model.kept import ErrorsOfFit
from thermid.fit._error_model.sizes import MIN_LOG_BAYES_FACTOR
from unit.fit.bench import HTC, MASS, box
from unit.fit.test_wander import wandering


def test_errors_are_those_of_the_mixture_about_the_fitted_values() -> None:
    fit = calibrate(box(), wandering(3), [HTC, MASS])
    numbers = ErrorsOfFit(fit).numbers
    assert numbers["gain"] < MIN_LOG_BAYES_FACTOR
    assert not fit.expected
    assert "(the structure)" in str(fit)
    assert any(f" {1.0 / (1.0 + math.exp(-numbers['gain'])):.2g}," in w for w in fit.warnings)
    probability = 1.0 / (1.0 + math.exp(-numbers["gain"]))
    places = [[*numbers["moved"]].index(n) for n in (HTC, MASS)]
    moves = np.array([numbers["moved"][n] for n in (HTC, MASS)])
    by_model = np.array(numbers["covariance"])[np.ix_(places, places)] + np.outer(moves, moves)
    for k, n in enumerate((HTC, MASS)):
        value = fit.values[n]
        noise = (value.error_random / value.value) ** 2
        assert (value.error / value.value) ** 2 == pytest.approx((1.0 - probability) * noise + probability * by_model[k, k], rel=1e-6)
