"""What a constant error means beside the rise, and rounding beside the noise."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from thermid.fit._calibrate import calibrate
from thermid.measure.records import Record
from unit.fit.bench import HTC, box, log


def test_half_a_kelvin_on_nine_is_five_and_a_half_per_cent() -> None:
    data = log(box({"parameters/power/value": "2.7 [W]"}), {}, {"T": "case"}, noise=0.02, accuracy=0.5, seed=1)
    found = calibrate(box({"parameters/power/value": "2.7 [W]"}), data, [HTC])
    (share,) = found.sensor_shares
    assert share.rise == pytest.approx(np.ptp(data["T"].values))
    assert (share.accuracy, share.parameter) == (0.5, HTC)
    k, j = 0, list(found.values).index("sensor T")
    c = found.values.covariance
    known = c[k, k] - c[k, j] ** 2 / c[j, j]
    assert share.share == pytest.approx(1 - known / c[k, k])
    assert share.share > 0.3
    said = rf" T: 0\.5 K .* {re.escape(f'{100 * 0.5 / share.rise:.2g}')} % .* {re.escape(f'{share.rise:.2g}')} K, .* {re.escape(HTC)}"
    assert re.search(said, str(found))


def test_a_sensor_without_accuracy_is_not_spoken_of() -> None:
    assert calibrate(box(), log(box(), {}, {"T": "case"}), [HTC]).sensor_shares == ()


@pytest.mark.parametrize(
    ("step", "sigma"), [(None, 0.05), (0.0625, np.hypot(0.05, 0.0625 / np.sqrt(12))), (0.5, np.hypot(0.05, 0.5 / np.sqrt(12)))]
)
def test_steps_of_a_sensor_add_to_its_noise(step: float | None, sigma: float) -> None:
    data: Record = log(box(), {}, {"T": "case"}, noise=0.05)
    found = calibrate(box(), data.with_channels(replace(data["T"], resolution=step)), [HTC])
    assert found.blocks[0].noise == pytest.approx(sigma)
