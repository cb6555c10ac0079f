"""What belongs to a sensor and not to the model is recognised in one place."""

from __future__ import annotations

import pytest

from thermid.fit._problem.experiment import of_a_sensor


@pytest.mark.parametrize(
    ("path", "own"),
    [
        ("sensor_T1.tip", True),
        ("initial.sensor_T1.tip", True),
        ("unit.sensor_a_b.lead.conductance", True),
        ("case.mass", False),
        ("biosensor_box.mass", False),
        ("reading.sensor", False),
    ],
)
def test_a_path_of_a_sensor(path: str, own: bool) -> None:
    assert of_a_sensor(path) is own
