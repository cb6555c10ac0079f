"""Steps and noise of a channel as its samples show them."""

from __future__ import annotations

import numpy as np
import pytest

from thermid.measure._record.channel import Channel, unrounded
from thermid.measure._record.record import Record

TIMES = np.arange(0.0, 3600.0, 10.0)
SLOW = 300.0 + 8.0 * (1.0 - np.exp(-TIMES / 900.0))


@pytest.mark.parametrize("step", [0.0625, 0.1, 1.0])
def test_a_step_is_found(step: float) -> None:
    assert Channel.from_array("T", 273.15 + step * np.round((SLOW - 273.15) / step), unit="K").step == pytest.approx(step)


def test_a_step_that_is_none() -> None:
    rng = np.random.default_rng(3)
    assert Channel.from_array("T", SLOW + 0.05 * rng.standard_normal(SLOW.size), unit="K").step == 0.0
    uneven = np.array([300.0, 301.37, 302.1, 306.66])[rng.integers(0, 4, 400)]
    assert Channel.from_array("T", uneven, unit="K").step == 0.0


def test_a_reading_that_never_changes_has_the_step_of_its_last_digit() -> None:
    assert Channel.from_array("T", np.full(60, 38.0), unit="degC").step == pytest.approx(1.0)
    assert Channel.from_array("T", np.full(60, 38.25), unit="degC").step == pytest.approx(0.01)
    assert Channel.from_array("P", np.full(60, 4.0), quantity="power").step == 0.0


def test_the_mean_of_a_log_in_whole_degrees_is_not_exact() -> None:
    channel = Channel.from_array("T", np.full(TIMES.size, 38.0), unit="degC", role="node", target="case")
    point = Record.from_arrays("coarse", TIMES, {"T": channel}).steady("10 [min]", "end")
    assert point["T"].error == pytest.approx(1.0 / 12**0.5, rel=0.05)


@pytest.mark.parametrize("signal", ["slow", "jumps", "fast"])
def test_noise_is_told_from_the_signal(signal: str) -> None:
    rng = np.random.default_rng(5)
    true = {"slow": SLOW, "jumps": SLOW + 4.0 * (TIMES % 900.0 > 450.0), "fast": 300.0 + np.sin(TIMES / 40.0)}[signal]
    assert Channel.from_array("T", true + 0.05 * rng.standard_normal(true.size), unit="K").white_noise == pytest.approx(0.05, rel=0.3)
    assert Channel.from_array("T", true, unit="K").white_noise < 0.002


@pytest.mark.parametrize("noise", [0.03, 0.05, 0.08, 0.15])
def test_noise_behind_steps_is_not_a_number_of_steps(noise: float) -> None:
    """The median of differences that are whole steps was 22 % low for noise of 0.05 K in steps of 1/16 K."""
    rng, step = np.random.default_rng(8), 0.0625
    logs = [np.round((SLOW + rng.uniform() + noise * rng.standard_normal(SLOW.size)) / step) * step for _ in range(40)]
    seen = np.mean([Channel.from_array("T", each, unit="K").white_noise for each in logs])
    assert seen == pytest.approx(np.hypot(noise, step / 12**0.5), rel=0.06)


def test_a_switched_power_has_no_noise() -> None:
    assert Channel.from_array("P", 5.0 * (np.arange(400) % 2), quantity="power").white_noise == 0.0
    rng = np.random.default_rng(1)
    noisy = Channel.from_array("P", 5.0 + 0.2 * rng.standard_normal(400), quantity="power")
    assert noisy.white_noise == pytest.approx(0.2, rel=0.25)


def test_a_slow_signal_behind_its_steps() -> None:
    assert np.abs(unrounded(TIMES, 0.5 * np.round(SLOW / 0.5)) - SLOW)[5:250].max() < 0.26
    assert unrounded(TIMES, np.full(TIMES.size, 3.0)).tolist() == [3.0] * TIMES.size


def test_a_mean_of_a_few_correlation_times_has_the_error_of_repeats() -> None:
    """An hour of readings whose noise is correlated over five minutes: without its doubt about that, errors were a third too small."""
    times, keep = np.arange(0.0, 3600.0, 30.0), np.exp(-30.0 / 300.0)
    scores = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        slow = np.zeros(times.size)
        slow[0] = 0.1 * rng.standard_normal()
        for k in range(1, times.size):
            slow[k] = keep * slow[k - 1] + 0.1 * np.sqrt(1.0 - keep**2) * rng.standard_normal()
        values = 300.0 + slow + 0.05 * rng.standard_normal(times.size)
        record = Record.from_arrays("r", times, {"T": Channel.from_array("T", values, unit="K", role="node", target="case")})
        point = record.steady("start", "end", limit="5 [K/h]", tau="0.1 [s]")
        scores.append((point["T"].value - 300.0) / point["T"].error)
    assert 0.5 < np.mean(np.square(scores)) < 1.5
    assert np.mean(np.abs(scores) < 1.96) > 0.9
