"""Elliptic orbits around a planet: where the craft is, when it is in shadow, and what falls on every face of a box in its attitude."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np

from thermid.base.errors import ScenarioError, look_up, refuse_first, refuse_unknown
from thermid.base.units import Array, amount
from thermid.model.tree import Constant, Signal, TableSignal, degrees, multiplied
from thermid.simulation.runs import Irradiation
from thermid.site._constants import PLANET_FIGURES
from thermid.site.exposure import planet_share

SAMPLES_PER_ORBIT: Final = 720
"""Samples of an orbit; straight lines between them are right to 1e-5 of the largest flux."""
CLOSEST: Final = 1e-9
"""Share of an orbit to which the edge of the shadow is found. [-]"""


@dataclass(frozen=True)
class Planet:
    """A planet or moon.

    Parameters
    ----------
    radius : float      [m]
    attraction : float  Its mass times the constant of gravitation. [m^3/s^2]
    solar : float       Of the sun at its mean distance. [W/m^2]
    """

    radius: float
    attraction: float
    solar: float


PLANETS: Final[Mapping[str, Planet]] = {name: Planet(*figures) for name, figures in PLANET_FIGURES.items()}
"""The planets and the moon by name."""

Frame = Callable[[Array, Array], Array]
"""Direction from the planet (times, 3) and sun (3,) -> normal of a face (times, 3), in the frame of the orbit."""


def _up(out: Array, sun: Array) -> Array:
    """Axis away from the planet (times, 3), from the directions outwards and to the sun."""
    return out


def _along(out: Array, sun: Array) -> Array:
    """Axis of flight in a circular orbit (times, 3): outwards turned by 90 degrees in its plane."""
    return np.column_stack((-out[:, 1], out[:, 0], out[:, 2]))


def _fixed(axis: int) -> Frame:
    """Return the frame of an axis of the orbit that does not turn, by its number."""
    return lambda out, sun: np.broadcast_to(np.eye(3)[axis], out.shape)


def _to_sun(out: Array, sun: Array) -> Array:
    """Axis to the sun (times, 3)."""
    return np.broadcast_to(sun, out.shape)


def _beside_sun(out: Array, sun: Array) -> Array:
    """Axis in the plane of the orbit, across the direction to the sun (times, 3)."""
    across = np.cross((0.0, 0.0, 1.0), sun)
    size = float(np.linalg.norm(across))
    return np.broadcast_to(across / size if size > 1e-9 else np.array([0.0, 1.0, 0.0]), out.shape)


def _over_sun(out: Array, sun: Array) -> Array:
    """Axis across both the direction to the sun and `_beside_sun` (times, 3)."""
    return np.cross(_to_sun(out, sun), _beside_sun(out, sun))


def _turned(frame: Frame) -> Frame:
    """Return the opposite axis."""
    return lambda out, sun: -frame(out, sun)


ATTITUDES: Final[Mapping[str, Mapping[str, Frame]]] = {
    "nadir": {
        "nadir": _turned(_up),
        "zenith": _up,
        "ram": _along,
        "wake": _turned(_along),
        "north": _fixed(2),
        "south": _turned(_fixed(2)),
    },
    "sun": {
        "sun": _to_sun,
        "shade": _turned(_to_sun),
        "left": _beside_sun,
        "right": _turned(_beside_sun),
        "north": _over_sun,
        "south": _turned(_over_sun),
    },
    "inertial": {
        "x": _fixed(0),
        "minus_x": _turned(_fixed(0)),
        "y": _fixed(1),
        "minus_y": _turned(_fixed(1)),
        "z": _fixed(2),
        "minus_z": _turned(_fixed(2)),
    },
}
"""Attitude -> face of a box -> its normal. The frame of an orbit: x to where the sun stands over its plane, z to the north of the plane."""


@dataclass(frozen=True, eq=False)
class OrbitFluxes:
    """What falls on the faces of a box along an orbit, over and over.

    Parameters
    ----------
    period : float          [s]
    shadow : tuple          Begin and end of the planet's shadow, within a period; empty without one. [s]
    times : array (times,)  [s]
    solar, albedo, infrared : dict     Face -> flux on its plane (times,), the sun without the shadow. [W/m^2]
    lit : Signal            1 in the sun, 0 in the shadow.
    """

    period: float
    shadow: tuple[tuple[float, float], ...]
    times: Array
    solar: Mapping[str, Array]
    albedo: Mapping[str, Array]
    infrared: Mapping[str, Array]
    lit: Signal

    @property
    def faces(self) -> tuple[str, ...]:
        """The faces, in order."""
        return tuple(self.solar)

    @property
    def eclipse(self) -> float:
        """How long a period is in shadow. [s]"""
        return float(sum(end - begin for begin, end in self.shadow))

    def irradiation(self, surfaces: Mapping[str, str] | None = None) -> dict[str, Irradiation]:
        """Return surface -> what falls on it, for a scenario.

        Parameters
        ----------
        surfaces : dict     Surface of the model -> face; without it the surfaces have the names of the faces.

        Raises
        ------
        ScenarioError   When there is no such face.
        """
        out = {}
        for surface, face in (surfaces or {f: f for f in self.faces}).items():
            shone = look_up(face, self.solar, "no face '{}'.{near} There are {known}.", "orbit", ScenarioError)
            sun = multiplied(self._signal(shone), self.lit)
            out[surface] = Irradiation(direct=sun, albedo=self._signal(self.albedo[face]), infrared=self._signal(self.infrared[face]))
        return out

    def _signal(self, values: Array) -> Signal:
        """Return values over one orbit as a signal that repeats."""
        return TableSignal(self.times, np.append(values[:-1], values[0]), after="repeat")

    def means(self) -> dict[str, tuple[float, float, float]]:
        """Return face -> means of sun, albedo and infrared over the orbit. [W/m^2]"""
        steps = np.diff(self.times)
        light = self.lit.at(self.times[:-1] + 0.5 * steps)  # the edges of the shadow are among the times

        def mean(flux: Array, share: Array | float = 1.0) -> float:
            """Return the mean of a flux, times a share at each step, over the orbit. [W/m^2]"""
            return float(np.sum(0.5 * (flux[1:] + flux[:-1]) * share * steps)) / self.period

        return {f: (mean(self.solar[f], light), mean(self.albedo[f]), mean(self.infrared[f])) for f in self.faces}

    def __str__(self) -> str:
        """One table: period, shadow, and of every face the mean and the largest of each kind."""
        light = self.lit.at(self.times)
        shadow = ", ".join(f"{begin / 60:.1f} to {end / 60:.1f} min" for begin, end in self.shadow) or "none"
        lines = [f"orbit of {self.period / 60:.2f} min, shadow {shadow}; mean and largest flux on each face [W/m^2]"]
        lines.append(f"{'':10s}{'sun':>16s}{'albedo':>16s}{'infrared':>16s}{'mean of all':>13s}")
        for face, mean in self.means().items():
            largest = (self.solar[face] * light, self.albedo[face], self.infrared[face])
            cells = "".join(f"{m:8.1f}{float(w.max()):8.1f}" for m, w in zip(mean, largest, strict=True))
            lines.append(f"{face:10s}{cells}{sum(mean):13.1f}")
        return "\n".join(lines)


def orbit_fluxes(
    perigee: str | float,
    *,
    albedo: float,
    infrared: str | float,
    apogee: str | float | None = None,
    planet: str | Planet = "earth",
    beta: float | str = 0.0,
    argument: float | str = 0.0,
    begin: float | str = 0.0,
    attitude: str = "nadir",
    solar: str | float | None = None,
) -> OrbitFluxes:
    """Return what falls on every face of a box along an elliptic orbit: sun with the planet's shadow, albedo and infrared.

    The shadow is a cylinder. Albedo goes with the cosine of the sun over the point below, by the view of the planet; its infrared is even.
    Faces do not shade one another.

    Parameters
    ----------
    perigee, apogee : str, float    Altitudes; a circle without an apogee. [m]
    albedo : float                  Of the planet; no value is assumed, nor of its infrared. [-]
    infrared : str, float           That leaves the planet. [W/m^2]
    planet : str, Planet            One of `PLANETS`, or its figures.
    beta : float                    Between the orbit's plane and the sun. [deg]
    argument : float                Of the perigee, from where the sun stands over the plane, along the motion. [deg]
    begin : float                   True anomaly at time zero. [deg]
    attitude : str                  nadir (faces nadir, zenith, ram, wake, north, south), sun (sun, shade, left, right, north, south) or
                                    inertial (x, minus_x, ...; x to where the sun stands over the plane, z to the plane's north).
    solar : str, float              Of the sun; that of the planet's mean distance without it. [W/m^2]

    Raises
    ------
    ScenarioError   When there is no such orbit, planet or attitude.

    References
    ----------
    Gilmore, Spacecraft Thermal Control Handbook, 2nd ed., chapter 2; Curtis, Orbital Mechanics for Engineering Students, 3rd ed., chapter 3
    (Kepler's equation); `planet_share` for the view.

    Examples
    --------
    >>> low = orbit_fluxes("400 [km]", albedo=0.3, infrared="237 [W/m^2]")
    >>> round(low.period / 60, 1), round(low.eclipse / 60, 1), round(float(low.infrared["nadir"][0]), 1)
    (92.4, 36.0, 209.8)
    """
    body, low, high, tilt = _checked(planet, attitude, perigee, apogee, albedo, beta)
    turned, first = (float(np.radians(degrees(v, f"orbit, {n}"))) for v, n in ((argument, "argument"), (begin, "begin")))
    path = _Path(body.radius + low, body.radius + high, body.attraction, turned, first)
    strength = body.solar if solar is None else amount(solar, "W/m^2", "orbit, solar")
    return _fluxes(path, body.radius, tilt, attitude, strength, albedo, amount(infrared, "W/m^2", "orbit, infrared"))


def _fluxes(path: _Path, radius: float, tilt: float, attitude: str, strength: float, albedo: float, glow: float) -> OrbitFluxes:
    """Return what falls on the faces along a path: by the sun S max(n.s, 0), by albedo S a F max(r.s, 0), by the planet's infrared E F.

    n, r and s are unit vectors of the face, from the planet to the craft, and to the sun; F is the view of the planet. Shadow comes in as
    its own signal.

    Parameters
    ----------
    radius : float              Of the planet. [m]
    tilt : float                Of the sun to the orbit's plane. [deg]
    strength, glow : float      S of the sun and E that leaves the planet. [W/m^2]
    albedo : float              a of the planet. [-]
    """
    sun = np.array([np.cos(np.radians(tilt)), 0.0, np.sin(np.radians(tilt))])
    shadow = _shadow(path, sun, radius)
    edges = np.array(sorted({t for span in shadow for t in span if 0.0 < t < path.period}))
    times = np.union1d(np.linspace(0.0, path.period, SAMPLES_PER_ORBIT + 1), edges)
    out, far = path.at(times)
    day = np.maximum(out @ sun, 0.0)
    normals = {face: frame(out, sun) for face, frame in ATTITUDES[attitude].items()}
    views = {face: _views(normal, out, far - radius, radius) for face, normal in normals.items()}
    return OrbitFluxes(
        path.period,
        shadow,
        times,
        {face: strength * np.maximum(normal @ sun, 0.0) for face, normal in normals.items()},
        {face: strength * albedo * view * day for face, view in views.items()},
        {face: glow * view for face, view in views.items()},
        _light(shadow, path.period),
    )


def _checked(
    planet: str | Planet, attitude: str, perigee: str | float, apogee: str | float | None, albedo: float, beta: float | str
) -> tuple[Planet, float, float, float]:
    """Return the planet, altitudes of perigee and apogee [m], and the angle between plane and sun [deg]; a circle without an apogee.

    Raises
    ------
    ScenarioError   When planet or attitude is unknown, altitudes are not above zero and rising, or albedo or angle outside their ranges.
    """
    refusal = "unknown planet '{}'.{near} There are {known}."
    body = planet if isinstance(planet, Planet) else look_up(str(planet).lower(), PLANETS, refusal, "orbit", ScenarioError)
    refuse_unknown([attitude], ATTITUDES, "orbit", "unknown attitude '{}'.{near} There are {known}.", ScenarioError)
    low = amount(perigee, "m", "orbit, perigee")
    high = low if apogee is None else amount(apogee, "m", "orbit, apogee")
    refuse_first(
        "orbit",
        (
            not 0.0 < low <= high < float("inf"),
            f"no orbit has a perigee of {low:g} m and an apogee of {high:g} m above the ground.",
            "value.outside-range",
        ),
        (not 0.0 <= albedo <= 1.0, f"the albedo is {albedo:g}. Give 0 to 1.", "value.outside-range"),
        error=ScenarioError,
    )
    tilt = degrees(beta, "orbit, beta")
    if not -90.0 <= tilt <= 90.0:
        raise ScenarioError(
            f"the angle of the sun to a plane is at most 90 degrees, not {tilt:g}.", "orbit, beta", code="value.outside-range"
        )
    return body, low, high, tilt


@dataclass(frozen=True)
class _Path:
    """An ellipse: radii of perigee and apogee [m], attraction [m^3/s^2], argument of the perigee and true anomaly at time zero [rad]."""

    near: float
    far: float
    attraction: float
    argument: float
    begin: float

    @property
    def period(self) -> float:
        """Time of an orbit. [s]"""
        return float(2.0 * np.pi * np.sqrt((0.5 * (self.near + self.far)) ** 3 / self.attraction))

    def at(self, times: Array) -> tuple[Array, Array]:
        """Return the direction from the planet (times, 3) and the distance (times,) [m] at `times` (times,) [s].

        Kepler's equation M = E - e sin E with M = M_0 + 2 pi t / period, by Newton's method; tan(v / 2) = sqrt((1 + e) / (1 - e)) tan(E /
        2), r = a (1 - e cos E), with the eccentricity e, the anomalies E and v, and the semi-major axis a. The orbit lies in the plane z =
        0.
        """
        axis, e = 0.5 * (self.near + self.far), (self.far - self.near) / (self.far + self.near)
        shrink = np.sqrt((1.0 - e) / (1.0 + e))
        first = 2.0 * np.arctan2(shrink * np.sin(0.5 * self.begin), np.cos(0.5 * self.begin))
        mean = first - e * np.sin(first) + 2.0 * np.pi * np.asarray(times) / self.period
        eccentric = mean + e * np.sin(mean)
        for _ in range(60):  # Newton's method; from there it takes a few steps
            step = (eccentric - e * np.sin(eccentric) - mean) / (1.0 - e * np.cos(eccentric))
            eccentric = eccentric - step
            if float(np.abs(step).max()) < 1e-14:
                break
        true = 2.0 * np.arctan2(np.sin(0.5 * eccentric), shrink * np.cos(0.5 * eccentric))
        angle = self.argument + true
        return np.column_stack((np.cos(angle), np.sin(angle), np.zeros_like(angle))), axis * (1.0 - e * np.cos(eccentric))


def _dark(path: _Path, sun: Array, radius: float, times: Array) -> Array:
    """Return R - r, how deep the craft is in the cylinder of shadow (times,): above zero inside. [m]

    r is its distance from the axis through the planet away from the Sun; where the craft is on the Sun's side the value is below zero.
    `sun` (3,) is the unit vector to the Sun, `radius` R that of the planet [m].
    """
    out, far = path.at(times)
    toward = out @ sun
    beside = far * np.sqrt(np.maximum(1.0 - toward**2, 0.0))
    return np.where(toward < 0.0, radius - beside, -np.abs(toward) * far - 1.0)


def _shadow(path: _Path, sun: Array, radius: float) -> tuple[tuple[float, float], ...]:
    """Return begin and end of each stretch of shadow within a period; one that holds time zero is in two parts. [s]

    The zeros of `_dark`: signs at samples of the period, then Brent's method. `sun` (3,) unit vector to the Sun, `radius` of the planet.
    [m]
    """
    from scipy.optimize import brentq

    times = np.linspace(0.0, path.period, 4 * SAMPLES_PER_ORBIT + 1)
    inside = _dark(path, sun, radius, times) > 0.0
    edges = [0.0] if inside[0] else []
    for k in np.flatnonzero(inside[1:] != inside[:-1]).tolist():
        low, high = float(times[k]), float(times[k + 1])
        edges.append(float(brentq(lambda t: _dark(path, sun, radius, np.array([t]))[0], low, high, xtol=CLOSEST * path.period)))
    edges += [path.period] if inside[-1] and len(edges) % 2 else []
    return tuple(zip(edges[::2], edges[1::2], strict=True))


def _light(shadow: tuple[tuple[float, float], ...], period: float) -> Signal:
    """Return 1 in the sun and 0 in the shadow, over and over, from the stretches of shadow (begin, end) in one `period` [s]."""
    if not shadow:
        return Constant(1.0)
    changes: dict[float, float] = {0.0: 1.0}
    for begin, end in shadow:
        changes[begin] = 0.0
        if end < period:
            changes[end] = 1.0
    times = sorted(changes)
    values = [changes[t] for t in times]
    return TableSignal(np.array([*times, period]), np.array([*values, values[0]]), hold=True, after="repeat")


def _views(normal: Array, out: Array, altitude: Array, radius: float) -> Array:
    """Return the view of the planet (times,) from a face. [-]"""
    tilt = np.degrees(np.arccos(np.clip(-np.sum(normal * out, axis=1), -1.0, 1.0)))
    return np.array([_share(round(float(a), 3), round(float(t), 9), radius) for a, t in zip(altitude, tilt, strict=True)])


@lru_cache(maxsize=65536)
def _share(altitude: float, tilt: float, radius: float) -> float:
    """Return the view factor from a surface of some tilt to the planet, not below zero. [-]"""
    return max(planet_share(altitude, tilt, radius), 0.0)  # rounding at the edge of view
