"""What a sensor does besides reading with noise: each effect planted, covered by the stated interval, and harmful if ignored."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from by_code import raises_code
from thermid.base.units import celsius
from thermid.campaign.stages import Criteria, validate
from thermid.fit._minimisation import Fit
from thermid.fit.calibration import Calibration, attached, calibrate, covariances
from thermid.measure._record.channel import with_sensor
from thermid.measure.records import Channel, Record, SensorCertificate, SensorPart
from thermid.model.tree import Model, model_from_dict
from thermid.simulation.runs import Scenario, simulate

pytestmark = [pytest.mark.recovery, pytest.mark.usefixtures("values_alone")]

ICE, NOISE, DRAWS, BLIND = 273.15, 0.05, 20, 10
FREE = ("skin.conductance", "case.capacitance")


def part_model() -> Model:
    """One node of 30 J/K behind 0.05 W/K: a time constant of ten minutes, a rise of 18 K."""
    return model_from_dict(
        {
            "title": "box",
            "needs": ["air"],
            "nodes": {"case": {"capacitance": {"value": "30 [J/K]", "min": 5, "max": 200}}},
            "conductors": {
                "skin": {"kind": "conduction", "between": ["case", "air"], "conductance": {"value": "0.05 [W/K]", "min": 0.001, "max": 1}}
            },
            "loads": {"heater": {"into": "case", "power": "0.9 [W]"}},
        }
    )


BENCH = Scenario("bench", boundaries={"air": "20 [degC]"}, start="20 [degC]", duration="90 [min]")
TIMES = np.linspace(0.0, 5400.0, 121)


def record(values: np.ndarray, part: SensorPart | None, accuracy: float | None = None, name: str = "bench") -> Record:
    """Return a log of one sensor on the case."""
    channel = Channel.from_array("T", values, unit="K", role="node", target="case", noise=NOISE, accuracy=accuracy, part=part)
    return Record.from_arrays(name, TIMES, {"T": channel})


def readings(part: SensorPart, scale: float = 0.0) -> np.ndarray:
    """Return what a sensor without noise would read on the box."""
    model, seats = attached(part_model(), record(np.full(TIMES.size, 300.0), part))
    true = simulate(model, BENCH, times=TIMES)[seats["T"].tip if seats else "case"].kelvin
    return true + scale * (true - part.gain_about)


def fit(values: np.ndarray, part: SensorPart | None, accuracy: float | None = None) -> Calibration:
    return calibrate(part_model(), record(values, part, accuracy), FREE, scenario=BENCH, search="local")


def score(found: Calibration, path: str = "skin.conductance", truth: float = 0.05) -> float:
    """Return by how many standard errors a value is away."""
    return float(np.log(found[path].value / truth) / (found[path].error / found[path].value))


def covered(scores: list[float]) -> bool:
    """Whether 95 % intervals hold the truth as often as so many draws can tell."""
    share = np.mean(np.abs(scores) < 1.96)
    print(f"held {100 * share:.0f} %")
    return bool(
        abs(share - 0.95) <= 3.5 * np.sqrt(0.95 * 0.05 / len(scores)) and np.mean(np.square(scores)) < 1.0 + 3.5 * np.sqrt(2 / len(scores))
    )


def test_gain_error_is_covered_and_would_mislead() -> None:
    rng, known, blind = np.random.default_rng(11), [], []
    for k in range(DRAWS):
        scale = 0.01 * rng.standard_normal()
        seen = readings(SensorPart(gain_about=celsius(0.0)), scale) + NOISE * rng.standard_normal(TIMES.size)
        known.append(score(fit(seen, SensorPart(gain_accuracy=0.01))))
        if k < BLIND:
            blind.append(score(fit(seen, None)))
    assert covered(known)
    assert not covered(blind)


def test_lag_is_recovered_and_would_mislead() -> None:
    rng, known, blind, lags = np.random.default_rng(12), [], [], []
    for k in range(DRAWS):
        lag = 90.0 * np.exp(0.2 * rng.standard_normal())
        seen = readings(SensorPart(lag=lag)) + NOISE * rng.standard_normal(TIMES.size)
        found = fit(seen, SensorPart(lag=90.0, lag_accuracy=18.0))
        lags.append((found["lag of T"].value - lag) / found["lag of T"].error)
        known.append(score(found, "case.capacitance", 30.0))
        if k < BLIND:
            blind.append(fit(seen, None).values["case.capacitance"].value / 30.0)
    assert covered(known)
    assert covered(lags)
    assert np.median(blind) > 1.1  # the lag is taken for heat capacity


def test_added_mass_and_leads_belong_to_the_bench_and_not_to_the_part() -> None:
    sensor = SensorPart(capacitance=3.0, lag=15.0, lead_conductance=0.003, lead_to="air")
    seen = readings(sensor) + NOISE * np.random.default_rng(13).standard_normal(TIMES.size)
    whole, blind = fit(seen, sensor), fit(seen, None)
    for path, truth in (("skin.conductance", 0.05), ("case.capacitance", 30.0)):
        assert abs(whole[path].value - truth) < 3 * whole[path].error
    # without it the node takes the sensor's 10 % of heat capacity for its own, the 6 % of its leads, and what the tip is cooler by
    assert blind["skin.conductance"].value == pytest.approx((0.05 + 0.2 * 0.003 / 0.203) * 0.203 / 0.2, rel=0.002)
    assert blind["case.capacitance"].value > 32.0
    # and a prediction of the part is of the part without its sensor
    assert not whole.model.submodels
    rest = simulate(whole.model, BENCH, times=TIMES)["case"].final
    assert rest == pytest.approx(20.0 + 18.0 * (1 - np.exp(-5400.0 * 0.05 / 30.0)), abs=0.1)


def test_noise_that_is_correlated_is_covered_and_would_mislead() -> None:
    # five minutes of correlation on 90 minutes of log: nine independent samples
    rng, time, known, blind = np.random.default_rng(14), 300.0, [], []
    tie = np.exp(-np.diff(TIMES) / time)
    clean = readings(SensorPart())
    for m in range(DRAWS):
        noise = NOISE * rng.standard_normal(TIMES.size)
        for k, phi in enumerate(tie, 1):
            noise[k] = phi * noise[k - 1] + np.sqrt(1 - phi**2) * noise[k]
        found = fit(clean + noise, SensorPart(correlation_time=time))
        known.append(score(found))
        if m < BLIND:
            # as if every sample told something new; a fit that is told nothing sees its residuals wander, and widens by what it guesses
            other = fit(clean + noise, None)
            assert other.problem is not None
            assert other.autocorrelation is not None
            end = Fit.ended(other.problem, np.array(list(other.fitted.values())))
            _, _, weights = covariances(end, other.autocorrelation.variance_factor)
            blind.append(float(np.log(other["skin.conductance"].value / 0.05) / np.sqrt(weights[0, 0])))
    assert covered(known)
    assert not covered(blind)


def test_certificate_narrows_the_interval_and_moves_the_value() -> None:
    rng, scores, halves = np.random.default_rng(15), [], []
    unknown = BENCH.with_(start="")  # a start that is known would tell the constant error
    for k in range(DRAWS):
        bias, u = 0.5 * rng.standard_normal(), 0.05
        seen = readings(SensorPart()) + bias + NOISE * rng.standard_normal(TIMES.size)
        raw = record(seen, None, accuracy=0.5)
        certificate = SensorCertificate(bias + u * rng.standard_normal(), u, date="2026-05-04")
        channel, _ = with_sensor(raw["T"], None, certificate, "T")
        found = calibrate(part_model(), raw.with_channels(channel), FREE, scenario=unknown, search="local")
        scores.append(score(found))
        if k < BLIND:
            plain = calibrate(part_model(), raw, FREE, scenario=unknown, search="local")
            halves.append(found["skin.conductance"].error / plain["skin.conductance"].error)
    assert covered(scores)
    assert np.median(halves) < 0.2


def test_readings_beyond_the_range_are_not_fitted() -> None:
    seen = readings(SensorPart()) + NOISE * np.random.default_rng(16).standard_normal(TIMES.size)
    stuck = np.minimum(seen, ICE + 36.0)
    raw = record(stuck, None)
    channel, (said,) = with_sensor(raw["T"], SensorPart(low=celsius(-55.0), high=celsius(36.0)), None, "T")
    assert " -55 [degC] to 36 [degC]" in said
    assert channel.flags == {"out of range": int(np.count_nonzero(seen >= ICE + 36.0))}
    found = calibrate(part_model(), raw.with_channels(channel), FREE, scenario=BENCH)
    blind = calibrate(part_model(), raw, FREE, scenario=BENCH, search="local")
    assert abs(score(found)) < 3
    assert abs(blind["skin.conductance"].value / 0.05 - 1) > 0.04


def test_what_was_found_of_a_sensor_holds_in_a_verdict() -> None:
    rng, sensor = np.random.default_rng(17), SensorPart(gain_accuracy=0.02, lag=90.0, lag_accuracy=30.0)
    part = replace(sensor, lag=120.0)
    first = fit(readings(part, 0.03) + NOISE * rng.standard_normal(TIMES.size), sensor)
    other = record(readings(part, 0.03) + NOISE * rng.standard_normal(TIMES.size), sensor, name="other")
    verdict = validate(first, other, Criteria(rmse="0.1 [K]"), scenario=BENCH)
    assert verdict.passed
    assert verdict.statistics["T"].rmse == pytest.approx(NOISE, rel=0.2)


def test_a_sensor_that_drives_a_boundary_is_refused() -> None:
    channel = Channel.from_array("ROOM", np.full(TIMES.size, 293.15), unit="K", role="boundary", target="air", part=SensorPart(lag=20.0))
    data = record(readings(SensorPart()), None).with_channels(channel)
    with raises_code("model.element-not-supported"):
        calibrate(part_model(), data, FREE)
