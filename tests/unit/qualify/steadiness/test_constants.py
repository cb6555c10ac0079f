"""Constants that set the width of a forecast, each against the figure that it stands for: a tenth more or less is seen here."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from thermid.qualify._steadiness.forecast import Approach, _bayesian_regression


def approach(worth: float, variance: float) -> Approach:
    """One exponential that has fallen to half a kelvin, its end known with a variance [K^2]."""
    covariance = np.zeros((1, 2, 2))
    covariance[0, 0, 0] = variance
    return Approach(0.0, 3600.0, np.array([[1800.0]]), np.ones(1), np.array([[300.0, -0.5]]), covariance, 0.0, 0.0, worth, None)


def test_what_is_still_to_come_bends_as_natural_convection_does() -> None:
    """A coefficient that grows with the difference to the power 1/4 changes by 1 - (2/3)^(1/4) while a third of the difference goes."""
    mixture = approach(1e9, 0.0).at(np.inf)
    assert float(mixture.spreads[0]) / 0.5 == pytest.approx(1.0 - (2.0 / 3.0) ** 0.25, rel=0.05)


@pytest.mark.parametrize("worth", [9.0, 15.0, 65.0])
def test_few_readings_do_not_know_their_own_noise(worth: float) -> None:
    """Student's distribution with as many degrees of freedom as medians are left beside five terms, three at least."""
    plain = approach(1e12, 4.0).at(3600.0)
    wide = approach(worth, 4.0).at(3600.0)
    ratio = float(wide.spreads[0]) / float(plain.spreads[0])
    assert ratio == pytest.approx(stats.t(max(worth - 5.0, 3.0)).std(), rel=1e-6)


def test_what_readings_do_not_tell_is_as_wide_as_its_prior() -> None:
    """The end lies within three times the change that was seen, an amplitude within it, a reference's gain within a tenth of 1."""
    x = np.array([[[1.0, -0.5, 2.0, 0.3], [1.0, -0.25, 2.1, 0.1]]])
    means, covariances, _, _ = _bayesian_regression(x, np.zeros(2), 4.0, 1, 1e9)
    assert means[0] == pytest.approx([0.0, 0.0, 1.0, 0.0], abs=1e-9)
    assert np.sqrt(np.diag(covariances[0])) == pytest.approx([12.0, 8.0, 0.1, 0.5])
