"""The second opinion on bands: from runs alone, exchangeable with the next, and infinite where they are too few."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from thermid.prediction._conformal import NEEDED, factor_of, second_opinion
from thermid.prediction._records import RecordPrediction, SensorBand


def run(off: np.ndarray, more: np.ndarray | None = None, name: str = "r") -> RecordPrediction:
    """A run whose readings are off by some kelvin, with bands of +- 1.96 K."""
    bands = {}
    for sensor, apart in (("a", off), *([("b", more)] if more is not None else [])):
        times = np.arange(float(apart.size))
        bands[sensor] = SensorBand(sensor, sensor, times, 300.0 + apart, np.full(apart.size, 300.0), {"fit": np.ones(apart.size)})
    return RecordPrediction("t", name, bands)


def test_factor_of_a_run_holds_its_readings() -> None:
    r = np.random.default_rng(2)
    off = 3.0 * r.normal(size=400)
    factor = factor_of(run(off))
    held = np.abs(off) <= factor * 1.959964
    assert held.mean() == pytest.approx(0.95, abs=0.003)
    assert factor == pytest.approx(3.0, rel=0.1)


def test_each_sensor_weighs_the_same() -> None:
    """One reading in ten of a short trace is far off; a long one that is right does not hide it."""
    short, long = np.array([0.1] * 8 + [9.8] * 2), np.full(10_000, 0.1)
    assert factor_of(run(short)) == pytest.approx(5.0, rel=1e-3)
    assert factor_of(run(short, long)) == pytest.approx(5.0, rel=1e-3)  # a tenth of the weight; of all readings it is a thousandth
    assert factor_of(run(long)) == pytest.approx(0.1 / 1.959964)


@pytest.mark.parametrize("count", [1, 5, NEEDED - 1])
def test_too_few_runs_say_nothing(count: int) -> None:
    opinion = second_opinion([run(np.ones(5))] * count)
    assert opinion is not None
    assert math.isinf(opinion.factor)
    assert f"from {count} run" in str(opinion)
    assert "the 95 % band is infinite, since it needs 19 runs" in str(opinion)
    assert json.loads(json.dumps(opinion.to_dict())) == {"runs": count, "needed": 19, "factor": None}


def test_nineteen_runs_name_the_largest_and_without_runs_nothing_is_said() -> None:
    opinion = second_opinion([run(np.full(5, 1.959964 * k)) for k in range(1, 20)])
    assert opinion is not None
    assert opinion.factor == pytest.approx(19.0)
    assert str(opinion).endswith("19 times these 95 % bands")
    assert second_opinion([]) is None


def test_the_next_run_is_held_as_often_as_said() -> None:
    """Of 400 sets of 39 runs the next lies inside in 95 to 97.5 %: exchangeable runs, whatever their distribution."""
    r = np.random.default_rng(5)
    held = []
    for _ in range(400):
        sizes = r.lognormal(0.0, 1.0, 40)
        opinion = second_opinion([run(np.full(3, s)) for s in sizes[:39]])
        assert opinion is not None
        held.append(sizes[39] <= opinion.factor * 1.959964)
    assert 0.915 < np.mean(held) < 0.985
