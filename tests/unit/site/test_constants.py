"""Numbers of the standard atmosphere, of weather files and of steps of vapour, by laws and formats that they must agree with."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from thermid.site._atmosphere import EARTH_RADIUS, UPPER
from thermid.site._constants import EPW
from thermid.site.site import _converted
from thermid.site.vapour import _Interval


def test_the_upper_air_weighs_what_its_pressures_differ_by_and_gets_lighter_with_height() -> None:
    """Between rows densities fall exponentially; above 86 km atoms of light gases take over, from 28.95 to 21.30 g/mol at 200 km."""
    height, temperature, pressure, density = UPPER.T
    z = 1e3 * height
    gravity = 9.80665 * (EARTH_RADIUS / (EARTH_RADIUS + 0.5 * (z[1:] + z[:-1]))) ** 2
    weight = gravity * (density[:-1] - density[1:]) * np.diff(z) / np.log(density[:-1] / density[1:])
    assert pressure[:-1] - pressure[1:] == pytest.approx(weight, rel=0.03)
    molar = 8314.32 * density * temperature / pressure
    assert molar[[0, -1]] == pytest.approx([28.95, 21.30], abs=0.01)
    assert ((np.diff(molar) < 0.0) & (np.diff(molar) > -1.2)).all()


def test_the_codes_of_an_epw_file_for_what_is_missing_are_no_readings() -> None:
    """EnergyPlus, Auxiliary Programs: the code of each field; the largest value that a field can hold stays a reading."""
    pandas = pytest.importorskip("pandas")
    codes = {"temp_air": 99.9, "relative_humidity": 999.0, "atmospheric_pressure": 999999.0, "wind_speed": 999.0, "wind_direction": 999.0}
    codes |= {"dni": 9999.0, "dhi": 9999.0, "ghi": 9999.0, "ghi_infrared": 9999.0, "total_sky_cover": 99.0}
    codes |= {"temp_dew": 99.9, "liquid_precipitation_depth": 999.0}
    read = _converted(pandas.DataFrame({column: [0.99 * code, code] for column, code in codes.items()}), EPW)
    assert len(read) == len(codes)
    assert [np.isnan(values).tolist() for values in read.values()] == [[False, True]] * len(codes)


def test_a_step_of_vapour_is_nine_tenths_of_the_longest_that_its_order_allows() -> None:
    """The error of one step of order 5 grows with the sixth power of its length: one try more is enough, the next is as long."""
    tried = []

    def doubled(state: Any, share: float, width: float, wet: Any) -> tuple[Any, Any, float]:
        tried.append(width)
        return state, state, 100.0 * width**6

    nothing = np.zeros(1)
    course: Any = SimpleNamespace(
        gain=lambda *_: nothing - 1.0, _doubled=doubled, _crossed=lambda *_: nothing > 0, _turned=lambda *_: nothing > 0
    )
    widths = [width for _, _, width, _ in _Interval.steps(course, SimpleNamespace(film=nothing), 1.0)]
    longest = 0.9 * 100.0 ** (-1.0 / 6.0)
    assert widths == pytest.approx([longest, longest, 1.0 - 2.0 * longest])
    assert tried == [1.0, *widths]
