"""Readings in steps: errors that neighbours share, against drawn phases; and sensors of one node."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

import thermid as td
from thermid.fit._uncertainty.noise import TraceNoise, binned_trace, covariance_of_means
from thermid.measure.records import blur_of, shared_rounding
from unit.fit.bench import HTC, MASS, box, log, metered

pytestmark = pytest.mark.usefixtures("errors_in_turn")

STEP = 0.5


def paths() -> dict[str, np.ndarray]:
    t = np.arange(240.0)
    return {"rest": np.full(240, 0.1), "approach": 3.0 * (1.0 - np.exp(-t / 60.0)), "sweep": 0.13 * t}


@pytest.mark.parametrize("path", paths())
@pytest.mark.parametrize("blur", [0.0, 0.1])
def test_covariances_are_those_of_drawn_phases(path: str, blur: float) -> None:
    signal, rng = paths()[path], np.random.default_rng(2)
    place = np.arange(240) // 40
    columns, own = shared_rounding(signal, STEP, blur, place, 6)
    sums = []
    for _ in range(4000):
        read = signal + rng.uniform(0.0, STEP) + blur * rng.standard_normal(240)
        sums.append(np.bincount(place, STEP * np.round(read / STEP) - read))
    drawn = np.cov(np.array(sums).T)
    # what is not shared is white: a twelfth of the squared step less what is shared
    whole = columns @ columns.T + 40.0 * (STEP**2 / 12.0 - own) * np.eye(6)
    assert np.sqrt(np.diag(whole)) == pytest.approx(np.sqrt(np.diag(drawn)), rel=0.1, abs=0.02 * 40 * STEP / 12**0.5)
    scale = 40.0**2 * STEP**2 / 12.0
    assert np.abs(whole - drawn).max() < 0.06 * scale


@pytest.mark.parametrize("blur", [0.0, 0.05, 0.2])
def test_the_noise_before_rounding_is_found(blur: float) -> None:
    signal, rng = np.tile(paths()["approach"], 4), np.random.default_rng(1)
    read = STEP * np.round((signal + 0.17 + blur * rng.standard_normal(signal.size)) / STEP)
    assert blur_of(signal, read, STEP) == pytest.approx(blur, abs=0.04)


def coarse(seed: int, step: float, *, stated: bool) -> td.Record:
    data = log(box(), {HTC: "5 [W/(m^2 K)]", MASS: "1.7 [kg]"}, {"T": "case"}, noise=0.02, samples=361, hours=6.0, seed=seed)
    values = 273.15 + step * np.round((data["T"].values - 273.15 + 0.37 * step * seed % step) / step)
    said = {"noise": 0.02, "resolution": step} if stated else {"noise": None}
    return data.with_channels(replace(data["T"], values=values, **said))


@pytest.mark.parametrize("stated", [True, False])
def test_a_plateau_is_one_error(stated: bool) -> None:
    """A box that settles within one step: the coefficient cannot be known better than half a step of the rise, whatever the samples."""
    found = td.calibrate(box(), coarse(1, 1.0, stated=stated), [HTC])
    rise = 4.0 / (0.05 * 5.0)
    assert found[HTC].error / found[HTC].value > 0.3 * (1.0 / 12**0.5) / rise
    fine = td.calibrate(box(), coarse(1, 0.001, stated=stated), [HTC])
    # the mass of the deck is not that of the log, and what the fine log then says of the structure is in its error, not in its scatter
    assert found[HTC].error_random > 5.0 * fine[HTC].error_random


def test_two_sensors_of_one_node_have_errors_of_their_own() -> None:
    data = log(box(), {HTC: "5 [W/(m^2 K)]"}, {"T": "case"}, samples=181, noise=0.05, accuracy=0.3, seed=3)
    rng = np.random.default_rng(5)
    other = replace(data["T"], name="U", values=data["T"].values + 0.4 + 0.1 * rng.standard_normal(181), noise=0.11)
    both = metered(data.with_channels(other), "heat", 4.0, accuracy=0.01)
    one = td.calibrate(box(), metered(data, "heat", 4.0, accuracy=0.01), [HTC, MASS])
    found = td.calibrate(box(), both, [HTC, MASS])
    assert found.bias["U"] - found.bias["T"] == pytest.approx(0.4, abs=0.05)
    # two instruments of one accuracy know the level sqrt 2 better than one
    assert found[HTC].error == pytest.approx(one[HTC].error / np.sqrt(2.0), rel=0.15)
    assert found.sensors["U"].rmse == pytest.approx(0.11, rel=0.2)
    balance = td.inference.energy_balance(found, both, "4 [h]", "end", limit="3 [K/h]")
    assert list(balance.unexplained) == ["case"]
    assert balance.closes


def test_sensors_of_one_node_that_differ_by_more_than_they_may_are_named() -> None:
    data = log(box(), {HTC: "5 [W/(m^2 K)]"}, {"T": "case"}, samples=181, noise=0.05, seed=3)
    both = data.with_channels(replace(data["T"], name="U", values=data["T"].values + 0.4))
    found = td.calibrate(box(), both, [HTC, MASS])
    (words,) = [w for w in found.warnings if "'T' and 'U'" in w]
    assert re.search(r"'T' and 'U' .*'case' .* 0\.4 K .* K\. ", words)


def test_weights_do_not_trust_the_predicted_signal_to_cancel_rounding_errors() -> None:
    """A level beside slow waves, weighed by the covariance at a signal that is wrong by a tenth of a step, against drawn phases."""
    rng, times = np.random.default_rng(2), np.arange(240.0)
    wave = 3.0 * times / 240.0 + 2.0 * np.exp(-((times - 150.0) ** 2) / 800.0)
    x, size = np.column_stack([np.ones(240), np.sin(times / 30.0), np.cos(times / 30.0)]), float(np.hypot(0.02, 1.0 / 12**0.5))
    scores = []
    for _ in range(100):
        phase = rng.random()
        read = np.round(wave + phase + 0.02 * rng.standard_normal(240)) - phase
        predicted = wave + 0.1 * np.sin(times / rng.uniform(20.0, 60.0) + rng.uniform(0.0, 6.0))
        columns, own = shared_rounding(predicted, 1.0, 0.02, np.arange(240), 240)
        z = (read - wave) / size
        piece = binned_trace(z, z, np.arange(240), times, x, 1.0, (columns / size, own / size**2, predicted))
        trace = TraceNoise("r", "s", 240, 1.0, 0.0, 0.0, 240.0)
        inverse = np.linalg.inv(covariance_of_means({("r", "s"): piece}, (trace,), {}))
        covariance = np.linalg.inv(x.T @ inverse @ x)
        scores.append(float((covariance @ (x.T @ (inverse @ piece.mean)))[0] / covariance[0, 0] ** 0.5))
    assert 0.5 < np.sqrt(np.mean(np.square(scores))) < 1.1
