"""Intervals by fitting everything else anew, and the map over two parameters."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import NameNotFoundError
from unit.fit.bench import AREA, HTC, MASS, box, log

BARE = {"surfaces/skin/effective_htc": "6 [W/(m^2 K)]"}


@pytest.fixture(scope="module")
def known() -> td.Calibration:
    data = log(box(), {HTC: "5 [W/(m^2 K)]"}, {"T": "case"}, samples=101, noise=0.1, accuracy=0.3)
    return td.calibrate(box(), data, [HTC, MASS])


@pytest.fixture(scope="module")
def loose() -> td.Calibration:
    """A quarter of an hour says little of the loss."""
    data = log(box(), {HTC: "5 [W/(m^2 K)]"}, {"T": "case"}, samples=41, noise=0.1, hours=0.25)
    return td.calibrate(box(BARE), data, [HTC, MASS])


def test_where_the_fit_is_nearly_linear_the_interval_is_the_standard_error(known: td.Calibration) -> None:
    found = td.inference.profile(known, HTC)
    value = known[HTC]
    assert found.limited == (True, True)
    for end, sign in ((found.low, -1), (found.high, 1)):
        assert np.log(end / value.value) == pytest.approx(sign * 1.96 * value.error / value.value, rel=0.03)
    assert f"{HTC} = 5.0" in str(found)
    assert all(part in str(found) for part in ("95 %", "4.8"))


def test_at_its_ends_the_sum_of_squares_has_grown_by_the_quantile(known: td.Calibration) -> None:
    found = td.inference.profile(known, HTC, level=0.68)
    assert found.threshold == pytest.approx(0.9889, abs=1e-3)
    assert found.threshold == pytest.approx(float(np.interp(found.high, found.values, found.rise)), rel=0.03)
    free = [u.name for u in known.problem.unknowns if u.name != HTC]  # type: ignore[union-attr]
    held = td.calibrate(known.model.with_values({HTC: f"{found.high!r} [W/(m^2 K)]"}), known.experiments[0].record, [MASS])
    assert set(held.fitted) == set(free)
    cost = lambda fit: fit.chi_square + (fit["sensor T"].value / 0.3) ** 2  # noqa: E731
    assert cost(held) - cost(known) == pytest.approx(found.threshold, rel=0.03)


def test_no_limit_on_one_side(loose: td.Calibration) -> None:
    found = td.inference.profile(loose, HTC)
    assert found.limited == (False, True)
    assert "no lower limit down to" in str(found)
    assert "95 %" in str(found)
    # the standard error alone would allow a coefficient below zero
    assert loose[HTC].value - 1.96 * loose[HTC].error < 0
    truth = 5.0
    assert found.low < truth < found.high


def test_no_limit_up_to_a_bound() -> None:
    data = log(box(), {HTC: "5 [W/(m^2 K)]"}, {"T": "case"}, samples=41, noise=0.1, hours=0.3)
    fit = td.calibrate(box({"surfaces/skin/effective_htc": {"value": "6 [W/(m^2 K)]", "min": 0.001, "max": 8}}), data, [HTC, MASS])
    found = td.inference.profile(fit, HTC)
    assert found.limited[1] is False
    assert found.high == pytest.approx(8.0)
    assert "no upper limit up to the bound 8" in str(found)


def test_a_name_that_was_not_free(known: td.Calibration) -> None:
    with raises_code("name.unknown", NameNotFoundError, match=r"'skin\.area'"):
        td.inference.profile(known, AREA)


class TestPictures:
    def test_are_written(self, loose: td.Calibration, tmp_path: Path) -> None:
        made = td.reporting.picture(td.inference.profile(loose, HTC), tmp_path / "p.png")
        assert made.read_bytes()[:4] == b"\x89PNG"
        assert made.stat().st_size > 10_000

    def test_of_something_else(self, tmp_path: Path) -> None:
        with raises_code("value.wrong-kind"):
            td.reporting.picture("x", tmp_path / "x.png")  # type: ignore[arg-type]


def test_what_is_no_probability_is_refused(known: td.Calibration, tmp_path: Path) -> None:
    with raises_code("value.outside-range", match=r"95.*0.*1.*0\.95\."):
        td.inference.profile(known, HTC, level=95)
    with raises_code("output.wrong-ending", match=r"x\.bmp.*'\.bmp'.*BMP"):
        td.reporting.picture(td.inference.criticise(known), tmp_path / "x.bmp")
