"""The bench's text log and a unit's binary telemetry, each on its own clock, become one record."""

from __future__ import annotations

import importlib.util
import os
from pathlib import Path

import numpy as np
import pytest

pytestmark = pytest.mark.skipif(os.name != "posix", reason="a board without hardware needs pseudo-terminals")


def test_offset_and_rate_are_found_and_one_record_holds_both(tmp_path: Path) -> None:
    spec = importlib.util.spec_from_file_location("two_clocks", Path(__file__).parents[2] / "examples" / "bench" / "two_clocks.py")
    assert spec is not None
    assert spec.loader is not None
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    text, binary = example.make_logs(tmp_path)
    found = example.one_record(text, binary)
    print(found)
    assert abs(found.offset - example.OFFSET) < 3.0 * found.offset_error
    assert abs(found.rate - example.RATE) < 3.0 * found.rate_error
    assert found.offset_error < 1.5
    assert set(found.record.channels) == {"plate", "cover", "room", "heater1"}
    heater = found.record["heater1"]
    on = found.record.times[heater.valid][np.flatnonzero(heater.values[heater.valid] > 0.5)[0]]
    plate = found.record["plate"]
    warm = (found.record.times > on + 60.0) & plate.valid
    assert plate.values[warm][:5].mean() > plate.values[plate.valid & (found.record.times < on)].mean() + 1.0
    assert max(found.rmse.values()) < 0.25  # the noise of the unit and its steps
