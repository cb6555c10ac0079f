"""Sun, albedo and infrared of a planet on a plate in orbit, in the simple form: view factors, and eclipse as a signal."""

from __future__ import annotations

from typing import Any

import numpy as np

from thermid.errors import ScenarioError
from thermid.model.laws.signal import Constant, Signal, TableSignal, joined, literal, signal
from thermid.model.parts.facing import degrees
from thermid.network.irradiation import Irradiation
from thermid.site.exposure import SOLAR_CONSTANT, eclipse, planet_share


def orbit_irradiation(
    altitude: str | float,
    *,
    tilt: float | str,
    sun: float | str,
    albedo: float,
    infrared: str | float,
    subsolar: float | str = 0.0,
    lit: Any = 1.0,
    solar: str | float = SOLAR_CONSTANT,
    radius: float = 6.371e6,
) -> Irradiation:
    """Return what falls on a plate in orbit: sun, sunlight that the planet throws back, and the planet's own infrared.

    Parameters
    ----------
    altitude : str, float   Of the orbit. [m]
    tilt : float            Between the plate's normal and straight down. [deg]
    sun : float             Between the plate's normal and the sun. [deg]
    albedo : float          Of the planet; no value is assumed, nor of its infrared. [-]
    infrared : str, float   That leaves the planet. [W/m^2]
    subsolar : float        Between the point below and the point under the sun; the albedo goes with its cosine. [deg]
    lit : Signal            1 in the sun, 0 in eclipse, as `eclipse_signal` makes it; a half stands for a mean over orbits. [-]
    solar : str, float      Of the sun at the planet. [W/m^2]
    radius : float          Of the planet. [m]

    Raises
    ------
    ScenarioError   When an angle, a share or the albedo does not exist.

    References
    ----------
    Gilmore, Spacecraft Thermal Control Handbook, 2nd ed., chapter 2; `planet_share` for the view.
    """
    height = literal(altitude, "m", "orbit, altitude") if isinstance(altitude, str) else float(altitude)
    view = planet_share(height, degrees(tilt, "orbit, tilt"), radius)
    angles = {"sun": degrees(sun, "orbit, sun"), "subsolar": degrees(subsolar, "orbit, subsolar")}
    for name, value in angles.items():
        if not 0.0 <= value <= 180.0:
            raise ScenarioError(f"an angle of {value:g} degrees does not exist; give 0 to 180.", f"orbit, {name}")
    if not 0.0 <= albedo <= 1.0:
        raise ScenarioError(f"an albedo of {albedo:g} does not exist; give 0 to 1.", "orbit")
    light = _lit(lit)
    strength = literal(solar, "W/m^2", "orbit, solar") if isinstance(solar, str) else float(solar)
    glow = literal(infrared, "W/m^2", "orbit, infrared") if isinstance(infrared, str) else float(infrared)
    facing, above = (max(float(np.cos(np.radians(angles[k]))), 0.0) for k in ("sun", "subsolar"))
    return Irradiation(
        direct=light.scaled(strength * facing),
        albedo=light.scaled(strength * albedo * view * above),
        infrared=Constant(glow * view),
    )


def eclipse_signal(altitude: str | float, beta: float | str, duration: str | float, begin: str | float = 0.0) -> Signal:
    """Return the light of a circular orbit about the earth, orbit after orbit: 1 in the sun, 0 in the earth's shadow, a cylinder.

    Parameters
    ----------
    altitude : str, float   [m]
    beta : float            Between the orbit's plane and the sun. [deg]
    duration : str, float   Of the run; the light goes on beyond it. [s]
    begin : str, float      When the first eclipse begins. [s]

    References
    ----------
    Gilmore, Spacecraft Thermal Control Handbook, 2nd ed., chapter 2.

    Examples
    --------
    >>> light = eclipse_signal("400 [km]", 0.0, "3 [h]", "30 [min]")
    >>> [float(v) for v in light.at(np.array([0.0, 2400.0, 4200.0]))]
    [1.0, 0.0, 1.0]
    """
    height, _, first = (
        literal(v, slot, f"orbit, {name}") if isinstance(v, str) else float(v)
        for v, slot, name in ((altitude, "m", "altitude"), (duration, "s", "duration"), (begin, "s", "begin"))
    )
    period, dark = eclipse(height, degrees(beta, "orbit, beta"))
    if dark == 0.0:
        return Constant(1.0)
    orbits = TableSignal(np.array([first, first + dark, first + period]), np.array([0.0, 1.0, 0.0]), hold=True, after="repeat")
    # an eclipse one period earlier would be seen where the first begins late
    return orbits if first <= period - dark else joined(Constant(1.0), first, orbits)


def _lit(given: Any) -> Signal:
    made = Constant(float(given)) if isinstance(given, int | float) else signal(given, "1", "orbit, lit")
    if not (made.bounds[0] >= 0.0 and made.bounds[1] <= 1.0):
        raise ScenarioError("light is 0 in eclipse and 1 in the sun, or between.", "orbit, lit")
    return made
