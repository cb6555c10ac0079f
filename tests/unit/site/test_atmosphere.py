"""The standard atmosphere against the tables of the standard, and of another library."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from thermid.base.errors import ScenarioError
from thermid.site._atmosphere import standard_atmosphere

TABLE = Path(__file__).parents[4] / "shared" / "data" / "reference_values" / "us_standard_atmosphere_1976_fluids.csv"


@pytest.mark.parametrize(
    ("km", "kelvin", "pascals"),
    [
        (0.0, 288.15, 101325.0),
        (5.0, 255.676, 54048.0),
        (11.0, 216.774, 22700.0),
        (20.0, 216.65, 5529.3),
        (50.0, 270.65, 79.779),
        (80.0, 198.639, 1.0524),
    ],
)
def test_values_of_the_standard(km: float, kelvin: float, pascals: float) -> None:
    """U.S. Standard Atmosphere, 1976, Table I, geometric altitude."""
    air = standard_atmosphere(1e3 * km)
    assert float(air.temperature) == pytest.approx(kelvin, abs=6e-3)
    assert float(air.pressure) == pytest.approx(pascals, rel=1e-4)


def test_the_table_of_another_library() -> None:
    if not TABLE.exists():
        pytest.skip("shared reference values are not here")
    z, t, p, rho = np.loadtxt(TABLE, delimiter=",", skiprows=1, usecols=range(4)).T
    air = standard_atmosphere(z)
    for mine, theirs in ((air.temperature, t), (air.pressure, p), (air.density, rho)):
        assert np.abs(mine / theirs - 1).max() < 1e-7


def test_ambiance_agrees_where_it_is_installed() -> None:
    ambiance = pytest.importorskip("ambiance")
    z = np.linspace(0.0, 80e3, 81)
    assert np.abs(standard_atmosphere(z).pressure / ambiance.Atmosphere(z).pressure - 1).max() < 1e-5


@pytest.mark.parametrize("altitude", [86001.0, 2e5, -6e3, np.nan])
def test_beyond_its_limits_it_is_refused(altitude: float) -> None:
    with pytest.raises(ScenarioError, match="end at 86 km"):
        standard_atmosphere(np.array([0.0, altitude]))
