"""Forecasts of running tests: on exponentials whose end is known, on real steps, and where they must decline."""

from __future__ import annotations

import re
from math import comb
from pathlib import Path

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import RecordError, ScenarioError, code_of
from thermid.measure.readers import read_record

HOUR = 3600.0
SHARED = Path(__file__).parents[5] / "shared" / "data" / "tclabsp"


def log(hours=2.0, parts=((10.0, 1200.0), (5.0, 3000.0)), noise=0.05, seed=1, room=None, end=320.0):
    times = np.arange(0.0, hours * HOUR, 10.0)
    values = np.full(times.size, end) + noise * np.random.default_rng(seed).standard_normal(times.size)
    for size, tau in parts:
        values -= size * np.exp(-times / tau)
    channels = {"T": values}
    if room is not None:
        channels["T"] = values + room(times) - 297.0
        channels["AIR"] = room(times)
    return td.Record.from_arrays("warm-up", times, channels, unit="K")


@pytest.mark.campaign
def test_the_end_of_two_exponentials_lies_in_the_interval_as_often_as_stated():
    inside = [f.final.low <= 320.0 <= f.final.high for f in (td.bench.forecast(log(4.0, seed=s), within="5 [K]") for s in range(20))]
    assert sum(inside) >= 17


def test_the_interval_of_the_end_narrows_with_time_and_is_then_given():
    found = [td.bench.forecast(log(h), within="1 [K]") for h in (1.5, 4.0, 8.0)]
    errors = [f.final.error for f in found]
    assert errors[0] > errors[1] > errors[2]
    assert found[0].declined
    assert not found[2].declined
    assert found[2].final.value == pytest.approx(320.0, abs=found[2].final.error)


def test_a_hidden_slow_mass_is_declined_where_one_exponential_would_be_sure():
    """The unit seems to settle at 314.7 K; a mass behind a weak link takes 20 h to bring the rest, to 320 K."""
    hidden = log(3.0, parts=((10.0, 1200.0), (6.0, 20.0 * HOUR)), noise=0.1)
    found = td.bench.forecast(hidden)
    assert code_of(found.declined) == "result.slow-part-possible"
    (row,) = found._as_rows()
    assert row["final_C"] is None, "a declined forecast has no final temperature in a frame, as in JSON"
    assert row["low_C"] < row["high_C"]
    assert found.final.low < 320.0 < found.final.high
    t, y = hidden.times[360:], hidden["T"].values[360:]
    trial = [
        np.linalg.lstsq(np.column_stack([np.ones(t.size), np.exp(-t / tau)]), y, rcond=None) for tau in np.geomspace(300.0, 3600.0, 60)
    ]
    best = min(trial, key=lambda fit: float(fit[1][0]))
    assert best[0][0] < 316.0  # what one exponential says, with an error of a few hundredths


def test_the_longest_time_constant_that_is_known_makes_it_safe():
    without, given = td.bench.forecast(log(2.5)), td.bench.forecast(log(2.5), slowest="1 [h]")
    assert given.final.error < 0.5 * without.final.error
    assert given.final.low <= 320.0 <= given.final.high


def test_a_reference_that_drifts_is_followed():
    air = {"mean": "20 [degC]", "amplitude": "0.8 [K]", "period": "3 [h]"}
    run = td.simulate(box(), td.Scenario("s", boundaries={"air": air}, duration="5 [h]"), every=10.0)
    rng = np.random.default_rng(5)
    readings = {n: run[n].kelvin + 0.05 * rng.standard_normal(run.times.size) for n in ("core", "air")}
    record = td.Record.from_arrays("warm-up", run.times, readings, unit="K")
    alone, led = td.bench.forecast(record, "core"), td.bench.forecast(record, "core", reference="air")
    truth = td.steady(box(), td.Scenario("s", boundaries={"air": f"{led.reference} [K]"}))["core"]
    assert led.final.low <= truth <= led.final.high
    assert led.final.error < 0.5 * alone.final.error


def box():
    deck = {
        "title": "box",
        "needs": ["air"],
        "nodes": {"plate": {"capacitance": "300 [J/K]"}, "core": {"capacitance": "900 [J/K]"}},
        "conductors": {
            "skin": {"kind": "conduction", "between": ["plate", "air"], "conductance": "0.8 [W/K]"},
            "foot": {"kind": "conduction", "between": ["plate", "core"], "conductance": "0.5 [W/K]"},
        },
        "loads": {"chips": {"into": "core", "power": "5 [W]"}},
    }
    return td.model_from_dict(deck)


def test_a_model_gives_the_time_constants():
    scenario = td.Scenario("s", boundaries={"air": "20 [degC]"}, duration="90 [min]")
    run = td.simulate(box(), scenario, every=10.0)
    readings = run["core"].kelvin + 0.05 * np.random.default_rng(4).standard_normal(run.times.size)
    record = td.Record.from_arrays("warm-up", run.times, {"core": readings}, unit="K")
    truth = td.steady(box(), scenario)["core"]
    alone, led = td.bench.forecast(record), td.bench.forecast(record, model=box(), scenario=scenario)
    assert led.by_model
    assert led.final.error < 0.5 * alone.final.error
    assert led.final.low <= truth <= led.final.high
    with raises_code("value.incomplete", ScenarioError):
        td.bench.forecast(record, model=box())


def test_when_a_rule_will_hold_and_what_that_saves():
    found = td.bench.forecast(log(1.2, parts=((15.0, 3000.0),), noise=0.02), within="10 [K]", slowest="1 [h]")
    when = 3000.0 * np.log(15.0 / 3000.0 / (3.0 / HOUR))
    assert found.holds == pytest.approx(when, rel=0.1)
    assert found.saved == pytest.approx(found.holds - found.now)
    assert found.holds_late >= found.holds
    assert "stopping now saves" in str(found)
    assert ": met now" in str(td.bench.forecast(log(6.0)))


def test_words_and_objects():
    text = str(td.bench.forecast(log(8.0)))
    assert "5 of 100" in text
    assert re.search(r"5 of 100 .* [\d.]+ K/h ", text), "how slow an unseen drift may be"
    assert td.bench.forecast(log(1.5)).as_object()["final_C"] is None


@pytest.mark.parametrize(
    ("arguments", "code", "match"),
    [
        ({"channel": "T2"}, "name.unknown", "'T2'"),
        ({"until": "100 [s]"}, "record.too-short", "40"),
        ({"level": 1.5}, "value.outside-range", r"1\.5"),
        ({"rule": "3 C"}, "value.wrong-kind", "'3 C'.*C/h.*C/h"),
        ({"slowest": "10 [s]"}, "value.outside-range", r"119\.8"),
        ({"slowest": "1e20 [h]"}, "value.outside-range", r"3\.6e\+23.*5\.01e\+19.*119\.8.*1e\+06"),
        ({"slowest": "1e7 [h]"}, "value.outside-range", r"1e\+06"),
        ({"reference": "AIRE"}, "name.unknown", "'AIRE'"),
    ],
)
def test_mistakes_are_named(arguments, code, match):
    with raises_code(code, match=match):
        td.bench.forecast(log(), **arguments)


def test_a_time_constant_far_longer_than_the_readings_is_taken():
    assert td.bench.forecast(log(0.5), slowest="9000 [h]", within="10 [K]").final.error > 0.0


def test_a_reading_in_the_past_and_a_record_of_several():
    with raises_code("value.outside-range", RecordError):
        td.bench.forecast(log(2.0)).reading("1 [h]")
    with raises_code("value.incomplete", RecordError, match="AIR"):
        td.bench.forecast(log(2.0, room=lambda t: 297.0 + 0.0 * t))


def steps(every: int = 1) -> list[Path]:
    """Return the logs of forty steps and two longer warm-ups, or every so many of them."""
    return (sorted((SHARED / "step").glob("*.csv.gz")) + sorted((SHARED / "step0to50").glob("*.csv.gz")))[::every]


LEVELS = (0.5, 0.8, 0.95)


def forecasts(files: list[Path], until: float, at: float) -> tuple[np.ndarray, np.ndarray]:
    """Return what readings are off by (forecasts,), and the intervals about the forecasts (forecasts, levels, 2). [K]"""
    errors, intervals = [], []
    for file in files:
        record = read_record(file, {"T1_C": {"node": "h1"}, "T2_C": {"node": "h2"}}).trim("2 [s]").median("4 [s]")
        for name in ("T1_C", "T2_C"):
            found = record[name]
            last = found.values[found.valid & (record.times <= at)][-1]
            forecast = td.bench.forecast(record, name, until=f"{until:g} [s]")
            seen = [forecast.reading(at, level) for level in LEVELS]
            errors.append(last - seen[0].value)
            intervals.append([(s.low - s.value, s.high - s.value) for s in seen])
    return np.array(errors), np.array(intervals)


def counted(errors: np.ndarray, intervals: np.ndarray, stretched: float = 1.0) -> dict[float, int]:
    """Return how many readings lie in the interval of each level, the intervals made wider or narrower."""
    low, high = np.moveaxis(stretched * intervals, 2, 0)
    within = (low <= errors[:, None]) & (errors[:, None] <= high)
    return dict(zip(LEVELS, within.sum(axis=0).tolist(), strict=True))


def least_chance(inside: dict[float, int], n: int) -> float:
    """Return the smallest probability of a count at least so far to its side, if every interval held as often as stated."""
    chances = []
    for level, k in inside.items():
        low = sum(comb(n, i) * level**i * (1 - level) ** (n - i) for i in range(k + 1))
        high = sum(comb(n, i) * level**i * (1 - level) ** (n - i) for i in range(k, n + 1))
        chances += [low, high]
    return min(chances)


@pytest.mark.skipif(not SHARED.is_dir(), reason="the logs of the Sao Paulo board are not in ../shared/data/tclabsp")
def test_readings_at_1200_s_from_600_s_of_every_ninth_step():
    inside = counted(*forecasts(steps(9), 600.0, 1200.0))
    assert least_chance(inside, 10) > 0.005, inside


@pytest.mark.campaign
@pytest.mark.skipif(not SHARED.is_dir(), reason="the logs of the Sao Paulo board are not in ../shared/data/tclabsp")
@pytest.mark.parametrize(("until", "at", "rms"), [(600.0, 1200.0, 1.1), (400.0, 900.0, 2.2)])
def test_later_readings_of_every_step_lie_in_the_intervals_as_often_as_stated(until, at, rms):
    """Forty steps and two longer warm-ups, both sensors. The counts must be those of the stated levels within what chance allows (1 %).

    On 2026-11-21: 45, 73 and 81 of 84 from 600 s (RMS 0.95 K), 40, 66 and 82 from 400 s, which chose nothing (2.01 K).
    """
    files = steps()
    errors, intervals = forecasts(files, until, at)
    n, inside = errors.size, counted(errors, intervals)
    found = float(np.sqrt(np.mean(errors**2)))
    print({level: f"{k} of {n}" for level, k in inside.items()}, "RMS", found)
    assert n == 2 * len(files) >= 80
    assert least_chance(inside, n) > 0.005, inside
    assert found < rms  # a reading is quantised to 0.49 K, and the room was not logged
    # such a count sees intervals of half or twice the width
    assert least_chance(counted(errors, intervals, 0.5), n) < 0.005
    assert least_chance(counted(errors, intervals, 2.0), n) < 0.005
