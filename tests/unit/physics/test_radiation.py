"""Radiation: row B1, E9, limits, and the scalar cases of the field."""

from __future__ import annotations

import pytest
from scipy.optimize import brentq

from oracles.decay import radiative_steady
from thermid.base.units import STEFAN_BOLTZMANN
from thermid.physics.conduction import slab_conductance
from thermid.physics.radiation import (
    concentric_exchange_factor,
    linearised_htc,
    parallel_exchange_factor,
    radiation_coefficient,
    radiation_conductance,
    space_resistance,
    surface_resistance,
    surroundings_exchange_factor,
)

SURFACE, WALLS = 309.088, 297.15


@pytest.mark.parametrize(("emissivity", "htc"), [(0.05, 0.3159727), (0.1, 0.6319454), (0.3, 1.8958363), (0.85, 5.3715362)])
def test_linearised_coefficient(emissivity: float, htc: float) -> None:
    assert linearised_htc(emissivity, SURFACE, WALLS) == pytest.approx(htc, abs=1e-7)


def test_conductance_is_the_fourth_power_law() -> None:
    coefficient = radiation_coefficient(surroundings_exchange_factor(0.3), 2.0)
    heat = radiation_conductance(coefficient, SURFACE, WALLS) * (SURFACE - WALLS)
    assert heat == pytest.approx(0.3 * STEFAN_BOLTZMANN * 2.0 * (SURFACE**4 - WALLS**4), rel=1e-13)
    assert radiation_conductance(coefficient, WALLS, WALLS) == pytest.approx(4 * coefficient * WALLS**3, rel=1e-14)


@pytest.mark.parametrize("emissivity", [0.1, 0.85])
def test_surface_resistance_alone_overstates_the_heat(emissivity: float) -> None:
    """E9: alone it gives Q/(1 - e); with the space behind it, the printed law."""
    powers = STEFAN_BOLTZMANN * (SURFACE**4 - WALLS**4)
    heat = radiation_conductance(radiation_coefficient(emissivity, 0.7), SURFACE, WALLS) * (SURFACE - WALLS)
    assert powers / surface_resistance(emissivity, 0.7) / heat == pytest.approx(1 / (1 - emissivity), rel=1e-12)
    assert powers / (surface_resistance(emissivity, 0.7) + space_resistance(0.7)) == pytest.approx(heat, rel=1e-12)


def test_limits_of_the_concentric_factor() -> None:
    assert concentric_exchange_factor(0.3, 0.6, 0.0) == pytest.approx(surroundings_exchange_factor(0.3), rel=1e-14)
    assert concentric_exchange_factor(0.3, 0.6, 1.0) == pytest.approx(parallel_exchange_factor(0.3, 0.6), rel=1e-14)
    assert parallel_exchange_factor(1.0, 0.6) == pytest.approx(0.6, rel=1e-14)


def test_concentric_factor_is_two_surfaces_and_a_space() -> None:
    chain = surface_resistance(0.3, 1.0) + space_resistance(1.0) + surface_resistance(0.6, 2.5)
    assert concentric_exchange_factor(0.3, 0.6, 1 / 2.5) == pytest.approx(1 / chain, rel=1e-14)


@pytest.mark.parametrize(
    ("conductivity", "sigma", "temperature"),
    [(55.6, 5.67e-8, 927.008), (55.563, 5.67e-8, 926.971), (55.6, STEFAN_BOLTZMANN, 927.004)],
)
def test_nafems_t2(conductivity: float, sigma: float, temperature: float) -> None:
    """A bar of 0.1 m, 1000 K at one end, radiating with 0.98 to 300 K at the other; the benchmark (sigma 5.67e-8) prints 927.0 K."""
    bar = slab_conductance(conductivity, 1.0, 0.1)
    end = radiation_coefficient(0.98, 1.0) * sigma / STEFAN_BOLTZMANN
    found = brentq(lambda t: bar * (1000 - t) - radiation_conductance(end, t, 300.0) * (t - 300), 300.0, 1000.0, xtol=1e-10)
    assert found == pytest.approx(temperature, abs=1e-3)
    assert f"{found:.1f}" == "927.0"
    assert radiative_steady(bar * (1000 - found), end, 300.0) == pytest.approx(found, abs=1e-8)


def test_modelingtoolkit_pair() -> None:
    coefficient = radiation_coefficient(1.0, 0.04)
    assert radiation_conductance(coefficient, 1000.0, 10.0) * 990.0 == pytest.approx(2268.1, abs=0.06)
