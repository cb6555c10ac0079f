"""Rate, settled, forecast: against the closed form of one body that cools."""

from __future__ import annotations

import numpy as np
import pytest

from thermid.acquire.trend import Trend


def cooled(tau: float, until: float, noise: float = 0.0, step: float = 0.0) -> Trend:
    rng = np.random.default_rng(1)
    made = Trend(600.0, 1.0 / 3600.0)
    for t in np.arange(0.0, until, 1.0):
        value = 40.0 - 15.0 * np.exp(-t / tau) + rng.normal(0.0, noise) if noise else 40.0 - 15.0 * np.exp(-t / tau)
        made.add(float(t), float(np.round(value / step) * step if step else value))
    return made


def test_the_rate_is_that_of_the_window() -> None:
    made = Trend(600.0)
    for t in range(2000):
        made.add(float(t), 20.0 + 0.002 * t)
    assert made.rate == pytest.approx(0.002)
    assert not made.settled
    assert made.forecast() is None  # a rate that does not fall goes nowhere


def test_the_forecast_is_that_of_one_body() -> None:
    tau = 1500.0
    end, wait = cooled(tau, 3000.0).forecast() or (0.0, 0.0)
    assert end == pytest.approx(40.0, abs=0.05)
    assert 3000.0 + wait == pytest.approx(tau * np.log(15.0 / tau * 3600.0), abs=30.0)


def test_the_steps_of_a_sensor_hide_no_forecast_far_from_the_end() -> None:
    end, _ = cooled(1500.0, 2500.0, noise=0.03, step=0.0625).forecast() or (0.0, 0.0)
    assert end == pytest.approx(40.0, abs=1.5)


def test_settled_needs_the_whole_window() -> None:
    made = Trend(600.0)
    for t in range(700):
        made.add(float(t), 20.0)
        if t < 500:
            assert not made.settled
    assert made.settled


def test_noise_is_no_forecast() -> None:
    rng = np.random.default_rng(2)
    made = Trend(600.0, 1e-9)
    for t in range(2000):
        made.add(float(t), 20.0 + rng.normal(0.0, 0.1))
    assert made.forecast() is None


def test_the_memory_stays_small() -> None:
    made = Trend(600.0)
    for t in range(20000):
        made.add(t * 0.1, 20.0)
    assert len(made._points) <= 241
