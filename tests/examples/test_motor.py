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
    fit = example.fitted(DATA, ("run 1", "run 3"))
    verdict = example.predicted(DATA, "run 2", fit)
    found = verdict.prediction
    winding = example.joined(DATA, "run 2").channels["WINDING"]
    readings = winding.values[winding.valid]
    assert readings.max() - readings[0] > 100.0
    assert verdict.passed
    assert verdict.fitted_locally == ("clock offset", "clock rate")
    assert found.sensors["WINDING"].rmse < 6.5
    assert found.sensors["STATOR"].rmse < 3.0
    assert abs(found.sensors["WINDING"].largest) < 13.0
    # the controller's rows of this run are about a fifth longer than its author takes them for
    clock = {i.name: i for i in found.local}
    assert 1.15 < clock["clock rate"].value < 1.25
    assert not found.synthetic
    for path in example.FREE:
        assert 2 * fit[path].error_random < fit[path].value
        assert (
            fit[path].error < fit[path].value
        )  # two masses do not make a motor: residuals of 4 K refute the structure, and errors count that
