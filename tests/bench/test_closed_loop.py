"""The whole way without hardware: model -> simulated sensors -> compiled firmware -> logger -> fit."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import thermid as td


@pytest.fixture(scope="module")
def example(tools: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location("closed_loop", Path(__file__).parents[2] / "examples" / "bench" / "closed_loop.py")
    assert spec is not None
    assert spec.loader is not None
    made = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(made)
    return made


def test_the_heater_warms_the_model_through_the_firmware(example: ModuleType, tmp_path: Path) -> None:
    path = tmp_path / "bench.log"
    example.run(path, 0.02)
    record = td.read_record(path, {"plate": "plate", "heater1": {"command": "heater"}})
    duties, plate = record["heater1"], record["plate"]
    assert set(np.round(duties.values[duties.valid], 3)) == {0.0, 0.5, 1.0}
    assert plate.values[plate.valid].max() - plate.values[plate.valid][0] > 1.0


@pytest.mark.campaign
def test_three_planted_values_are_found_in_five_hours(example: ModuleType, tmp_path: Path) -> None:
    path = tmp_path / "bench.log"
    took = example.run(path, 5.0)
    found = example.fit(path)
    print(f"five hours in {took:.0f} s\n{found}")
    for name, text in example.PLANTED.items():
        planted, value = float(text.partition(" ")[0]), found[name]
        assert abs(value.in_unit - planted) < 3.0 * value.error, name
        assert value.error < 0.02 * planted
    record = td.read_record(path, {"room": {"boundary": "room"}})
    room = record["room"]
    # the simulator's time is the board's, to the end: no step too few or too many
    assert np.abs(room.values[room.valid] - 294.15 - np.sin(record.times[room.valid] / 2500.0)).max() < 0.3
