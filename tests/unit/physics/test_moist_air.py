"""Moist air against tables and CoolProp, and what humidity does to a coefficient of convection."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from thermid.base.units import ATMOSPHERE, ICE_POINT, Array
from thermid.physics.air import (
    Gas,
    air_conductivity,
    air_specific_heat,
    air_viscosity,
    dew_point,
    latent_heat,
    mass_transfer_coefficient,
    saturation_pressure,
    vapour_density,
    vapour_diffusivity,
    vapour_pressure,
)
from thermid.physics.plates import vertical_plate_htc

AIR_MASS, WATER_MASS = 28.96492, 18.015268  # g/mol


def humidity_ratio(temperature: Any, humidity: Any, pressure: Any = ATMOSPHERE) -> Array:
    """Mass of vapour to a mass of dry air [-].

    Parameters
    ----------
    temperature : float or array   Of the air. [K]
    humidity : float or array      Relative, 0 to 1. [-]
    pressure : float or array      Of the moist air. [Pa]

    References
    ----------
    ASHRAE Handbook of Fundamentals 2021, chapter 1, eq. 20.
    """
    vapour = vapour_pressure(temperature, humidity)
    return np.asarray(WATER_MASS / AIR_MASS * vapour / (np.asarray(pressure, dtype=float) - vapour))


def moist_air(temperature: float, humidity: float, pressure: float = ATMOSPHERE) -> Gas:
    """Air of some humidity for the convection correlations: conductivity, kinematic viscosity, Prandtl number.

    Parameters
    ----------
    temperature : float   [K]
    humidity : float      Relative, over liquid water, 0 to 1. [-]
    pressure : float      [Pa]

    References
    ----------
    Mixture rules of Wilke and of Mason and Saxena as in Tsilingiris, Energy Conversion and Management 49 (2008) 1098; vapour's viscosity
    and conductivity there, eqs. 40 and 41, its specific heat eq. 44.
    """
    t = temperature - ICE_POINT
    share = float(vapour_pressure(temperature, humidity)) / pressure
    dry = float(np.asarray(air_viscosity(temperature))), float(np.asarray(air_conductivity(temperature)))
    wet = (80.58131868 + 0.4000549451 * t) * 1e-7, (17.61758242 + 0.05558941059 * t + 1.663336663e-4 * t * t) * 1e-3
    viscosity, conductivity = (_mixed(share, a, b, dry[0] / wet[0]) for a, b in zip(dry, wet, strict=True))
    mass = (1.0 - share) * AIR_MASS + share * WATER_MASS
    density = pressure * mass / (8314.46262 * temperature)
    vapour_heat = 1869.10989 - 0.2578421578 * t + 1.941058941e-2 * t * t
    heat = (float(np.asarray(air_specific_heat(temperature))) * (1.0 - share) * AIR_MASS + vapour_heat * share * WATER_MASS) / mass
    return Gas(conductivity, viscosity / density, viscosity * heat / conductivity)


def _mixed(share: float, air: float, vapour: float, viscosities: float) -> float:
    """Return a transport property of air with a molar share of vapour, by Wilke's rule."""
    ratio = AIR_MASS / WATER_MASS
    first = (1.0 + np.sqrt(viscosities) * (1.0 / ratio) ** 0.25) ** 2 / np.sqrt(8.0 * (1.0 + ratio))
    second = (1.0 + np.sqrt(1.0 / viscosities) * ratio**0.25) ** 2 / np.sqrt(8.0 * (1.0 + 1.0 / ratio))
    return float((1.0 - share) * air / (1.0 - share + share * first) + share * vapour / (share + (1.0 - share) * second))


# Air at 101 325 Pa as CoolProp 8.0.0 has it (HAPropsSI): degC, relative humidity, dew or frost point [K], humidity ratio [-]
COOLPROP = [
    (5.0, 0.50, 269.1165, 0.0027005),
    (24.0, 0.10, 264.7219, 0.0018459),
    (24.0, 0.55, 287.5634, 0.0102898),
    (24.0, 0.90, 295.4083, 0.0170170),
    (29.0, 0.55, 292.2028, 0.0138973),
    (35.0, 0.95, 307.2264, 0.0348192),
    (50.0, 0.95, 322.1212, 0.0819475),
    (60.0, 0.95, 332.0470, 0.1440888),
]


@pytest.mark.parametrize(("celsius", "humidity", "dew", "ratio"), COOLPROP)
def test_dew_point_as_coolprop(celsius: float, humidity: float, dew: float, ratio: float) -> None:
    """To 5 mK; the humidity ratio to 0.8 %, since that air is no ideal gas raises the vapour's pressure by half a per cent."""
    kelvin = celsius + 273.15
    assert float(dew_point(vapour_pressure(kelvin, humidity))) == pytest.approx(dew, abs=5e-3)
    assert float(humidity_ratio(kelvin, humidity)) == pytest.approx(ratio, rel=8e-3)


@pytest.mark.campaign
def test_dew_point_as_the_installed_coolprop() -> None:
    """Over a range, where it is installed: to 0.03 K, by which real moist air differs from ideal gases."""
    properties = pytest.importorskip("CoolProp.HumidAirProp", reason="CoolProp is not installed")
    for celsius in np.linspace(1.0, 70.0, 24):
        for humidity in (0.05, 0.3, 0.6, 0.98):
            wanted = properties.HAPropsSI("Tdp", "T", celsius + 273.15, "P", 101325, "R", humidity)
            assert float(dew_point(vapour_pressure(celsius + 273.15, humidity))) == pytest.approx(wanted, abs=0.03)


def test_magnus_as_in_the_design_notes() -> None:
    """Four dew points by Magnus' formula: 35 degC and 95 %: 34.08; 50, 95: 48.98; 24, 55: 14.41; 29, 55: 19.05."""
    for celsius, humidity, dew in ((35, 0.95, 34.08), (50, 0.95, 48.98), (24, 0.55, 14.41), (29, 0.55, 19.05)):
        assert float(dew_point(vapour_pressure(celsius + 273.15, humidity))) - 273.15 == pytest.approx(dew, abs=0.03)


def test_saturation() -> None:
    """Table of the source: 273.16 K 611.657 Pa, 300 K 3 536.7 Pa, 373.124 K one atmosphere; ice at 260 K 195.80 Pa."""
    assert saturation_pressure(np.array([273.16, 300.0, 373.1243])) == pytest.approx([611.657, 3536.7, 101325.0], rel=1e-4)
    assert float(saturation_pressure(260.0, "ice")) == pytest.approx(195.80, rel=1e-4)
    assert float(saturation_pressure(260.0, "surface")) < float(saturation_pressure(260.0))


def test_small_things() -> None:
    """Tables of Incropera: diffusivity of vapour at 298 K 2.6e-5, latent heat at 290 K 2 461 kJ/kg; no vapour has no dew point."""
    assert float(vapour_diffusivity(298.0)) == pytest.approx(2.6e-5, rel=0.05)
    assert float(latent_heat(290.0)) == pytest.approx(2.461e6, rel=2e-3)
    assert float(vapour_density(3536.7, 300.0)) == pytest.approx(0.02556, rel=2e-3)
    assert float(dew_point(0.0)) == 0.0
    # Lewis number near one: h over rho c_p, and a tenth more
    assert float(mass_transfer_coefficient(5.0, 293.15)) == pytest.approx(5.0 / (1.204 * 1006.0) * 1.1, rel=0.03)


def test_humidity_changes_a_coefficient_by_well_under_one_per_cent() -> None:
    """The vertical plate of the document's example between 10 and 90 %."""
    dry, wet = (float(vertical_plate_htc(309.088, 297.15, 0.02492, moist_air(303.12, humidity))) for humidity in (0.1, 0.9))
    assert 1e-5 < abs(wet / dry - 1.0) < 0.006
    assert moist_air(303.12, 0.0).conductivity == pytest.approx(0.0265, rel=0.01)
