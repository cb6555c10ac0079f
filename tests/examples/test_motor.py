"""The motor of two clocks on real measurements: a run predicted from the other two, and what its clock is found to be."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[2]
DATA = ROOT.parent / "shared" / "data" / "motor_bldc_tass"

pytestmark = [
    pytest.mark.skipif(not DATA.is_dir(), reason="the logs of the motor are not in ../shared/data/motor_bldc_tass"),
    pytest.mark.slow,
]


@pytest.fixture(scope="module")
def example() -> ModuleType:
    spec = importlib.util.spec_from_file_location("motor", ROOT / "examples" / "motor" / "run.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_an_unseen_run_is_met_to_ten_kelvin(example: ModuleType) -> None:
    study = example.fitted(DATA, ("run 1", "run 3"))
    found = example.predicted(DATA, "run 2", study)
    winding = found.record.channels["WINDING"]
    readings = winding.values[winding.valid]
    assert readings.max() - readings[0] > 100.0
    assert found.rmse["WINDING"] < 10.0
    assert found.rmse["STATOR"] < 5.0
    assert abs(found.largest["WINDING"][0]) < 15.0
    # the controller's rows of this run are about a quarter longer than its author takes them for
    assert 1.15 < found.rate < 1.3
    assert not found.record.origin.synthetic
    for path in example.FREE:
        assert 2 * study.fit[path].error < study.fit[path].value
