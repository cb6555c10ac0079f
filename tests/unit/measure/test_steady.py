"""Steady points: what the mean of a stretch is worth when it drifts, when its noise is correlated, when the sensor has steps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import NameNotFoundError, RecordError
from thermid.measure._record.channel import Channel
from thermid.measure._record.record import Record
from thermid.measure._record.steadiness import effective_samples

TAU, END = 3600.0, 313.15


def approach(hours: float = 8.0, noise: float = 0.05, seed: int = 1, drift: float = 0.0, samples: int = 481, colour: float = 0.0) -> Record:
    """A part of one time constant on its way to 40 degC, in a room that drifts [K/s]; noise of a first-order colour."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0.0, 3600.0 * hours, samples)
    white = rng.standard_normal(samples)
    for k in range(1, samples):
        white[k] = colour * white[k - 1] + (1 - colour**2) ** 0.5 * white[k]
    case = END - 16.0 * np.exp(-t / TAU) + drift * (t - TAU * (1 - np.exp(-t / TAU)))
    room = 297.15 + drift * t
    return Record.from_arrays(
        "bench",
        t,
        {
            "T": Channel.from_array("T", case + noise * white, unit="K", role="node", target="case", noise=noise, accuracy=0.5),
            "ROOM": Channel.from_array("ROOM", room, unit="K", role="boundary", target="air"),
            "P": Channel.from_array("P", np.full(samples, 4.0), quantity="power", role="load", target="heat"),
        },
    )


def test_stored_heat_is_taken_off() -> None:
    point = approach(noise=0.01).steady("4 [h]", "5 [h]", tau=TAU)
    middle = END - 16.0 * np.exp(-4.5)
    assert point["T"].correction == pytest.approx(END - middle, rel=0.05)
    assert abs(point["T"].value - END) < 2 * point["T"].error
    assert abs(middle - END) > 2 * point["T"].error
    assert point["T"].accuracy == 0.5


def test_a_part_lags_behind_a_room_that_drifts() -> None:
    drift = 0.5 / 3600.0
    point = approach(hours=20, drift=drift, noise=0.01).steady("18 [h]", "20 [h]", tau={"T": "1 [h]"})
    room = point["ROOM"].value
    assert point["ROOM"].correction == 0.0
    assert point["T"].value - room == pytest.approx(END - 297.15, abs=2 * point["T"].error)


def test_without_a_time_constant_the_drift_is_doubt() -> None:
    point = approach(noise=0.01).steady("5 [h]", "6 [h]")
    v = point["T"]
    assert v.correction == 0.0
    assert v.error == pytest.approx(abs(v.rate) * 1800.0, rel=0.02)
    assert len(str(point).splitlines()) > 1


def test_a_window_that_is_not_settled_is_refused_with_its_rate() -> None:
    with raises_code("record.not-steady", RecordError, match=r"\+3\.68.*0\.61.*1"):
        approach().steady("1 [h]", "2 [h]")
    assert approach().steady("1 [h]", "2 [h]", limit="10 [K/h]")["T"].rate * 3600 == pytest.approx(3.6, rel=0.2)


def test_what_is_asked_must_make_sense() -> None:
    with raises_code("value.outside-range", RecordError):
        approach().steady(limit=0.0)
    with raises_code("record.too-short", RecordError, match="3.*8"):
        approach().steady("7 [h]", "7.04 [h]")
    with raises_code("name.unknown", NameNotFoundError, match="'TT'"):
        approach().steady("7 [h]")["TT"]


@pytest.mark.parametrize("colour", [0.0, 0.8])
def test_the_error_of_the_mean_holds_with_correlated_noise(colour: float) -> None:
    """Over 300 logs the mean scatters as its error says; as if each reading were new, it would be three times too sure at 0.8."""
    found = [approach(hours=24, seed=k, colour=colour).steady("16 [h]", "24 [h]", tau=1.0)["T"] for k in range(300)]
    z = np.array([(v.value - END) / v.error for v in found])
    # the standard deviation of 300 has an error of 4 %, that of an estimated error about as much again
    assert z.std() == pytest.approx(1.0, abs=0.15)
    worth = np.median([v.samples / v.independent for v in found])
    assert worth == pytest.approx((1 + colour) / (1 - colour), rel=0.3)


def test_steps_of_a_sensor_stay_where_no_noise_moves_them() -> None:
    from dataclasses import replace

    quiet = approach(hours=24, noise=1e-4)
    stepped = replace(quiet.channel("T"), values=np.round(quiet.channel("T").values * 16) / 16, resolution=1 / 16)
    v = quiet.with_channels(stepped).steady("20 [h]", "24 [h]", tau=TAU)["T"]
    assert v.error == pytest.approx(1 / 16 / 12**0.5, rel=0.1)
    assert abs(v.value - END) < 2 * v.error


def test_as_a_record_of_two_readings_that_weigh_as_one() -> None:
    point = approach().steady("7 [h]", "8 [h]", tau=TAU, name="settled")
    made = point.record
    assert (made.name, made.times.size, made.origin.sha256) == ("settled", 2, approach().origin.sha256)
    assert made.channel("T").noise == pytest.approx(point["T"].error * 2**0.5)
    assert (made.channel("T").accuracy, made.channel("P").values[0]) == (0.5, 4.0)


def test_correlation_of_white_and_of_constant_noise() -> None:
    white = np.random.default_rng(2).standard_normal(4000)
    assert white.size / effective_samples(white) == pytest.approx(1.0, abs=0.15)
    assert effective_samples(np.zeros(10)) == 10.0
    assert effective_samples(np.sin(np.linspace(0, 3, 100))) < 5


def test_a_mean_power_has_the_error_of_its_scatter_alone() -> None:
    """No stored heat is taken off a power, so that its drift adds nothing."""
    rng, record = np.random.default_rng(5), approach()
    noisy = Channel.from_array("P", 4.0 + 0.6 * rng.standard_normal(481), quantity="power", role="load", target="heat")
    record = Record.from_arrays("bench", record.times, {**record.channels, "P": noisy}, unit="K")
    with_tau, without = (record.steady("6 [h]", "8 [h]", tau=tau)["P"] for tau in (TAU, None))
    assert with_tau.error == without.error
    assert with_tau.error == pytest.approx(0.6 / 121**0.5, rel=0.35)


@pytest.mark.parametrize(("noise", "part"), [(0.05, 0.85), (0.15, 0.5), (0.3, 0.0)])
def test_noise_before_rounding_takes_the_error_of_steps_away_as_far_as_it_is_known(noise: float, part: float) -> None:
    """Of a mean that stands at random between two steps of 1 K; stated noise, against the error that the phases give."""
    rng = np.random.default_rng(6)
    t, away, errors = np.arange(0.0, 7201.0, 30.0), [], []
    for level in 300.0 + rng.random(150):
        read = np.round(level + noise * rng.standard_normal(t.size))
        v = Record.from_arrays(
            "r", t, {"T": Channel.from_array("T", read, unit="K", role="node", target="n", noise=noise, resolution=1.0)}
        ).steady()["T"]
        away.append(v.value - level)
        errors.append(v.error)
    size = float(np.sqrt(np.mean(np.square(away))))
    assert size == pytest.approx(part / 12**0.5, abs=0.06)
    assert np.median(errors) == pytest.approx(size, rel=0.35, abs=0.02)


def test_one_row_written_by_hand_is_a_steady_point_once_it_stands_twice(tmp_path: Path) -> None:
    """As the error of a log of one row advises: 12 K by 6 W."""
    deck = {
        "title": "box",
        "needs": ["air"],
        "nodes": {"case": {"capacitance": "300 [J/K]"}},
        "conductors": {
            "out": {"kind": "conduction", "between": ["case", "air"], "conductance": {"value": "1 [W/K]", "min": 0.01, "max": 10}}
        },
        "loads": {"heat": {"into": "case", "power": "1 [W]"}},
    }
    channels = {"T": {"node": "case", "noise": "0.1 [K]"}, "ROOM": {"boundary": "air"}, "P": {"load": "heat"}}
    path = tmp_path / "hand.csv"
    path.write_text("time_s,T [degC],ROOM [degC],P [W]\n0,33,21,6\n")
    with raises_code("record.too-short", RecordError):
        td.read_record(path, channels)
    path.write_text("time_s,T [degC],ROOM [degC],P [W]\n0,33,21,6\n3600,33,21,6\n")
    record, bench = td.read_record(path, channels), td.Scenario("hand", start="steady")
    fit = td.calibrate(td.model_from_dict(deck), record, ["out.conductance"], scenario=bench)
    assert fit["out.conductance"].value == pytest.approx(0.5, rel=1e-6)
