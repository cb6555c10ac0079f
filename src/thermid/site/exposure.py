"""What falls on a plate outdoors, the share of its view that a planet takes, and the heat of a stream of molecules: closed forms."""

from __future__ import annotations

from typing import Any

import numpy as np

from thermid.base.errors import ScenarioError
from thermid.base.units import Array


def facing_sun(tilt: float, azimuth: float | None, zenith: Any, sun_azimuth: Any) -> Array:
    """Return the cosine of incidence, zero where the sun stands behind; without azimuth its mean over all azimuths [-].

    Parameters
    ----------
    tilt, azimuth : float       Of the outward normal: from up, and from north over east. [deg]
    zenith, sun_azimuth : array Of the sun. [deg]

    References
    ----------
    Duffie and Beckman, Solar Engineering of Thermal Processes, 4th ed., Eq. 1.6.3; the mean over azimuths is its integral.

    Examples
    --------
    A wall that looks at a sun 30 degrees above the horizon, and the skin of an upright cylinder, lit over 1/pi of its area.

    >>> [round(float(facing_sun(90, a, 60.0, 180.0)), 4) for a in (180.0, None)]
    [0.866, 0.2757]
    """
    z, b = np.radians(np.asarray(zenith, dtype=float)), np.radians(tilt)
    up, across = np.cos(z) * np.cos(b), np.sin(z) * np.sin(b)
    if azimuth is not None:
        return np.asarray(np.maximum(up + across * np.cos(np.radians(np.asarray(sun_azimuth, dtype=float) - azimuth)), 0.0))
    half = np.arccos(np.clip(-up / np.maximum(across, 1e-12), -1.0, 1.0))
    return np.asarray(np.maximum((up * half + across * np.sin(half)) / np.pi, 0.0))


def sky_share(tilt: float) -> float:
    """Return the share of a plate's view that is sky, (1 + cos tilt) / 2 [-]."""
    return 0.5 * (1.0 + float(np.cos(np.radians(tilt))))


def ground_share(tilt: float) -> float:
    """Return the share of a plate's view that is ground, (1 - cos tilt) / 2 [-]."""
    return 1.0 - sky_share(tilt)


def on_plane(
    tilt: float, azimuth: float | None, zenith: Any, sun_azimuth: Any, direct_normal: Any, diffuse: Any, total: Any, albedo: float
) -> Array:
    """Return the solar irradiance on a plane under an even sky: beam, sky and what the ground throws back [W/m^2].

    Parameters
    ----------
    tilt, azimuth, zenith, sun_azimuth      As in `facing_sun`. [deg]
    direct_normal, diffuse, total : array   Beam on a plane that follows the sun; diffuse and global on the horizontal. [W/m^2]
    albedo : float                          Of the ground. [-]

    References
    ----------
    Liu and Jordan, Solar Energy 7 (1963) 53; Duffie and Beckman, 4th ed., Eq. 2.15.1. An even sky gives a plane towards the sun some
    per cent less than a real clear one, which is brighter around the sun.
    """
    beam = np.asarray(direct_normal) * facing_sun(tilt, azimuth, zenith, sun_azimuth) * (np.asarray(zenith) < 90.0)
    return np.asarray(beam + np.asarray(diffuse) * sky_share(tilt) + albedo * np.asarray(total) * ground_share(tilt))


def cloudless_sky(dew_point: Any, cloud: Any = 0.0) -> Array:
    """Return the emissivity of the sky over the fourth power of the air's temperature [-].

    Parameters
    ----------
    dew_point : array   Of the air near the ground. [K]
    cloud : array       Share of the sky that is covered, 0 to 1. [-]

    References
    ----------
    Clark and Allen (1978), as in the EnergyPlus Engineering Reference, "Sky Radiation Modeling", with its factor for clouds in tenths.

    Examples
    --------
    >>> round(float(cloudless_sky(283.15)), 3)
    0.815
    """
    tenths = 10.0 * np.asarray(cloud, dtype=float)
    clear = 0.787 + 0.764 * np.log(np.asarray(dew_point, dtype=float) / 273.0)
    return np.asarray(np.minimum(clear * (1.0 + 0.0224 * tenths - 0.0035 * tenths**2 + 0.00028 * tenths**3), 1.0))


def planet_share(altitude: float, tilt: float, radius: float = 6.371e6) -> float:
    """Return the view factor from a small plate to a planet [-].

    Parameters
    ----------
    altitude : float    Above the surface. [m]
    tilt : float        Between the plate's normal and straight down. [deg]
    radius : float      Of the planet. [m]

    Raises
    ------
    ScenarioError   When the altitude is negative, or the tilt outside 0 to 180.

    References
    ----------
    Howell, A Catalog of Radiation Configuration Factors, plane element to sphere: the sphere in full view, or cut by the plate's plane.

    Examples
    --------
    >>> round(planet_share(400e3, 0.0), 4), round(planet_share(400e3, 90.0), 4)
    (0.8853, 0.2886)
    """
    if not (altitude >= 0.0 and 0.0 <= tilt <= 180.0):
        raise ScenarioError(
            f"a plate at {altitude:g} m, {tilt:g} degrees from nadir, is not possible. Give 0 m or more, and 0 to 180.",
            code="value.outside-range",
        )
    h = (radius + altitude) / radius
    angle = np.radians(tilt)
    horizon = np.arcsin(1.0 / h)
    if angle <= 0.5 * np.pi - horizon:
        return float(np.cos(angle) / h**2)
    if angle >= 0.5 * np.pi + horizon:
        return 0.0
    root = np.sqrt(h**2 - 1.0)
    edge = np.sqrt(max(1.0 - (h * np.cos(angle)) ** 2, 0.0))
    # a plate in the ground, h = 1, sees half of the world above or below its own plane
    first = 0.5 - np.arcsin(min(root / (h * np.sin(angle)), 1.0)) / np.pi
    second = np.cos(angle) * np.arccos(np.clip(-root / np.tan(angle), -1.0, 1.0)) - root * edge
    return float(first + second / (np.pi * h**2))


def molecular_heating(density: Any, speed: Any, accommodation: float = 1.0) -> Array:
    """Return the heat that a free stream of molecules brings to an area across it, accommodation * rho v^3 / 2 [W/m^2].

    Parameters
    ----------
    density : array         Of the free stream. [kg/m^3]
    speed : array           Relative to the air. [m/s]
    accommodation : float   Share of its energy that a molecule leaves; 1 is the highest. [-]

    References
    ----------
    Gilmore, Spacecraft Thermal Control Handbook, 2nd ed., section on free-molecular heating.

    Examples
    --------
    >>> round(float(molecular_heating(1e-8, 6000.0)))
    1080
    """
    return np.asarray(0.5 * accommodation * np.asarray(density) * np.asarray(speed) ** 3)


def driving_rain(rain: Any, wind: Any) -> Array:
    """Return the rain that wind drives on an upright wall that faces it, 0.222 v R^0.88 with R in mm/h [m/s].

    Parameters
    ----------
    rain : array    On the horizontal. [m/s]
    wind : array    [m/s]

    References
    ----------
    Lacy's relation, from memory, as are its two numbers; ISO 15927-3 has 2/9 and 8/9.

    Examples
    --------
    >>> round(float(driving_rain(10 / 3.6e6, 5.0)) * 3.6e6, 2)
    8.42
    """
    millimetres = np.asarray(rain, dtype=float) * 3.6e6
    return np.asarray(0.222 * np.asarray(wind, dtype=float) * millimetres**0.88 / 3.6e6)
