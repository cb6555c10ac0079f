"""Plates in sun, before a planet and in a stream of molecules: closed forms against quadrature and against pvlib."""

from __future__ import annotations

import numpy as np
import pytest

from by_code import raises_code
from thermid.base.errors import ScenarioError
from thermid.site.exposure import (
    cloudless_sky,
    driving_rain,
    facing_sun,
    ground_share,
    molecular_heating,
    on_plane,
    planet_share,
    sky_share,
)


@pytest.mark.parametrize("tilt", [0.0, 35.0, 90.0, 140.0, 180.0])
@pytest.mark.parametrize("zenith", [0.0, 20.0, 60.0, 89.0])
def test_mean_over_azimuths_is_the_integral(tilt: float, zenith: float) -> None:
    around = np.arange(0.5, 3600.0) / 10.0
    every = np.array([float(facing_sun(tilt, a, zenith, 0.0)) for a in around])
    assert float(facing_sun(tilt, None, zenith, 77.0)) == pytest.approx(every.mean(), abs=2e-6)


def test_an_even_sky_as_pvlib_has_it() -> None:
    irradiance = pytest.importorskip("pvlib").irradiance
    for tilt, azimuth, zenith, sun in [(0, 0, 30, 120), (90, 270, 50, 250), (40, 180, 70, 100), (120, 10, 20, 350)]:
        theirs = irradiance.get_total_irradiance(tilt, azimuth, zenith, sun, 800.0, 600.0, 120.0, albedo=0.3, model="isotropic")
        mine = float(on_plane(tilt, azimuth, zenith, sun, 800.0, 120.0, 600.0, 0.3))
        assert mine == pytest.approx(float(theirs["poa_global"]), rel=1e-9)


def test_no_beam_from_below_the_horizon() -> None:
    assert float(on_plane(90.0, 90.0, 95.0, 90.0, 800.0, 10.0, 10.0, 0.0)) == pytest.approx(5.0)


def test_sky_and_ground_fill_the_view() -> None:
    assert [sky_share(t) for t in (0.0, 90.0, 180.0)] == pytest.approx([1.0, 0.5, 0.0], abs=1e-15)
    assert sky_share(30.0) + ground_share(30.0) == 1.0


def _by_quadrature(h: float, tilt: float, n: int = 1200) -> float:
    """View factor of a plate to a sphere: cosine over the cone that the sphere fills, by the midpoint rule."""
    horizon = np.arcsin(1.0 / h)
    nadir = (np.arange(n) + 0.5) / n * horizon
    around = (np.arange(n) + 0.5) / n * 2 * np.pi
    a, b = np.meshgrid(nadir, around, indexing="ij")
    normal = np.radians(tilt)
    cosine = np.sin(a) * np.cos(b) * np.sin(normal) + np.cos(a) * np.cos(normal)
    return float((np.maximum(cosine, 0.0) * np.sin(a)).sum() * horizon / n * 2 * np.pi / n / np.pi)


@pytest.mark.parametrize("altitude", [200e3, 800e3, 3.6e7])
@pytest.mark.parametrize("tilt", [0.0, 15.0, 60.0, 90.0, 120.0, 179.0])
def test_view_of_a_planet_is_the_integral_over_its_disc(altitude: float, tilt: float) -> None:
    assert planet_share(altitude, tilt) == pytest.approx(_by_quadrature(1.0 + altitude / 6.371e6, tilt), abs=2e-6)


def test_a_plate_on_the_ground_sees_half_of_its_sphere() -> None:
    assert planet_share(0.0, 0.0) == pytest.approx(1.0)
    assert planet_share(0.0, 90.0) == pytest.approx(0.5)


def test_a_plate_below_the_ground_is_refused() -> None:
    with raises_code("value.outside-range", ScenarioError, match="at -1 m"):
        planet_share(-1.0, 0.0)
    with raises_code("value.outside-range", ScenarioError, match="200"):
        planet_share(4e5, 200.0)


def test_a_clear_sky_as_an_engineering_reference_works_it_out() -> None:
    """EnergyPlus Engineering Reference, Sky Radiation Modeling: 293 K, dew point 283 K, no clouds: 0.815 and 340.6 W/m^2."""
    share = float(cloudless_sky(283.0))
    assert share == pytest.approx(0.815, abs=6e-4)
    assert share * 5.6697e-8 * 293.0**4 == pytest.approx(340.6, abs=0.3)


def test_clouds_count_in_tenths() -> None:
    """Clark and Allen's factor 1 + .0224 n - .0035 n^2 + .00028 n^3 of the n tenths of the sky that are covered."""
    clear, *cloudy = (float(cloudless_sky(273.0, n / 10.0)) for n in (0.0, 1.0, 5.0, 10.0))
    assert clear == 0.787
    assert cloudy == pytest.approx([0.787 * factor for factor in (1.01918, 1.0595, 1.154)], rel=1e-12)


def test_clouds_close_the_sky() -> None:
    clear, half, shut = (float(cloudless_sky(288.15, c)) for c in (0.0, 0.5, 1.0))
    assert clear < half < shut <= 1.0


def test_molecules_and_rain_grow_with_speed() -> None:
    assert float(molecular_heating(2e-8, 5e3)) == pytest.approx(1250.0)
    assert float(molecular_heating(2e-8, 5e3, 0.9)) == pytest.approx(1125.0)
    assert float(driving_rain(10 / 3.6e6, 0.0)) == 0.0
