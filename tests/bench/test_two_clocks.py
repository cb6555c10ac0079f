"""The bench's log and a unit's telemetry, each on its own clock, become one record."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np


def test_offset_and_rate_are_found_and_one_record_holds_both(tmp_path: Path) -> None:
    spec = importlib.util.spec_from_file_location("two_clocks", Path(__file__).parents[2] / "examples" / "bench" / "two_clocks.py")
    assert spec is not None
    assert spec.loader is not None
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    text, table = example.make_logs(tmp_path)
    fit = example.clock_found(text, table)
    print(fit)
    clock = {i.name: i for i in fit.local}
    assert abs(clock["clock offset"].value - example.OFFSET) < 2.0 * clock["clock offset"].error
    assert abs(clock["clock rate"].value - example.RATE) < 2.0 * clock["clock rate"].error
    # 4.8 W into 120 J/K warm the plate by 0.04 K/s, so that one reading of 0.2 K tells 5 s, and some 150 that follow three changes within
    # their time constant 0.4 s; an open rate and sensors that may be off by 1.5 K all along cost a factor of two or three
    assert 0.4 < clock["clock offset"].error < 2.0
    assert 2e-4 < clock["clock rate"].error < 2e-3
    record = fit.experiments[0].record
    assert record["heater1"].prompt  # the board says a change when it happens
    assert set(record.channels) == {"plate", "cover", "room", "heater1"}
    heater = record["heater1"]
    on = record.times[heater.valid][np.flatnonzero(heater.values[heater.valid] > 0.5)[0]]
    plate = record["plate"]
    warm = (record.times > on + 60.0) & plate.valid
    assert plate.values[warm][:5].mean() > plate.values[plate.valid & (record.times < on)].mean() + 1.0
    assert max(s.rmse for s in fit.sensors.values()) < 0.25  # the noise of the unit and its steps
