"""The balance of vapour along a run: what every gas holds, what settles on surfaces and what dries."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from thermid.dual import value_of
from thermid.errors import ScenarioError
from thermid.model.flat import FlatConductor
from thermid.model.signal import Signal, literal
from thermid.model.takes import exposed_area
from thermid.network.environment import Environment
from thermid.physics.constants import STEFAN_BOLTZMANN
from thermid.physics.moist import (
    VAPOUR_CONSTANT,
    dew_point,
    latent_heat,
    mass_transfer_coefficient,
    saturation_pressure,
    vapour_density,
    vapour_pressure,
)
from thermid.simulation.solution import Solution

__all__ = ["Followed", "Volume", "follow"]

Array = NDArray[np.float64]

STEP: Final = 10.0
"""Longest step of the balance of vapour. [s]"""
CLEAR: Final = 1e-3
"""Temperature difference above which a heat flow gives a coefficient. [K]"""


@dataclass(frozen=True)
class Volume:
    """A volume of gas with vapour of its own.

    Parameters
    ----------
    volume : str or float     Its size. [m^3]
    exchange : str or float   Volume of gas that it exchanges with `to` in a unit of time; zero when it is sealed. [m^3/s]
    to : str                  The gas node that it exchanges with; empty when it is sealed.
    humidity : float          Relative, at the start. [-]
    """

    volume: str | float
    exchange: str | float = 0.0
    to: str = ""
    humidity: float = 0.5

    def __post_init__(self) -> None:
        """Turn texts into numbers."""
        for name, slot in (("volume", "m^3"), ("exchange", "m^3/s")):
            given = getattr(self, name)
            object.__setattr__(self, name, literal(given, slot, name) if isinstance(given, str) else float(given))
        if not float(self.volume) > 0.0 or float(self.exchange) < 0.0:
            raise ScenarioError("a volume of gas is above zero, and what it exchanges is not negative.")
        if (float(self.exchange) > 0.0) != bool(self.to):
            raise ScenarioError("a volume that exchanges gas names with whom: exchange and to come together.")
        _check_humidity(np.array([self.humidity]), "a volume")


@dataclass(frozen=True, eq=False)
class Followed:
    """Dew points by gas (times,) [K]; margins [K], films [kg/m^2] and latent heats [W] of the surfaces (surfaces, times)."""

    dew_points: Mapping[str, Array]
    margin: Array
    film: Array
    latent: Array


@dataclass(frozen=True, eq=False)
class _Surfaces:
    """Areas (surfaces,) [m^2]; temperatures [K], speeds at which vapour reaches them [m/s] and its density over them [kg/m^3] in time."""

    area: Array
    skin: Array
    speed: Array
    settled: Array


def _surfaces(solution: Solution, parts: Sequence[FlatConductor]) -> _Surfaces:
    values = {p: value_of(v) for p, v in solution._run.assembled.numbers.values.items()}
    shape = (len(parts), solution.times.size)
    skin = np.array([solution[c.ends[0]].kelvin for c in parts]).reshape(shape)
    area = np.array([value_of(exposed_area(c.path, values[c.fields["area"]], c.takes, values)) for c in parts])
    speed = np.zeros(shape)
    for k, c in enumerate(parts):
        grey = values[c.emissivity] if c.kind == "effective" and c.emissivity else 0.0
        speed[k] = _speed(solution.heat_flow(c.path), skin[k], solution[c.gas].kelvin, area[k], grey)
    return _Surfaces(area, skin, speed, vapour_density(saturation_pressure(skin, "surface"), skin))


def _speed(flow: Array, skin: Array, air: Array, area: float, emissivity: float) -> Array:
    """Return the mass transfer coefficient (times,) of a surface from the heat that it exchanges. [m/s]"""
    difference = skin - air
    clear = np.abs(difference) > CLEAR
    if area <= 0.0 or not clear.any():
        return np.zeros(skin.size)
    htc = flow / (area * np.where(clear, difference, np.inf))
    htc[~clear] = np.median(htc[clear])
    mean = 0.5 * (skin + air)
    return mass_transfer_coefficient(np.maximum(htc - 4.0 * emissivity * STEFAN_BOLTZMANN * mean**3, 0.0), mean)


def follow(solution: Solution, parts: Sequence[FlatConductor], open_air: Mapping[str, Signal], own: Mapping[str, Volume]) -> Followed:
    """Return what vapour does along a run, step by step: implicit in the vapour of the volumes, films never below nothing.

    Parameters
    ----------
    solution : Solution         The run.
    parts : sequence            Surfaces that exchange with these gases.
    open_air : dict             Boundary that is a gas -> relative humidity. [-]
    own : dict                  Gas node -> its volume.

    Raises
    ------
    ScenarioError   When a relative humidity is not one.
    """
    times = solution.times
    gas = {g: solution[g].kelvin for g in (*open_air, *own)}
    surfaces = _surfaces(solution, parts)
    density = {g: vapour_density(_pressure(solution, g, given), gas[g]) for g, given in open_air.items()}
    for g, v in own.items():
        density[g] = np.full(times.size, float(vapour_density(vapour_pressure(gas[g][0], v.humidity), gas[g][0])))
    order = list(density)
    held = np.array([density[g] for g in order]).reshape(len(order), times.size)
    at = np.array([order.index(c.gas) for c in parts], dtype=int)
    film = np.zeros(surfaces.skin.shape)
    rate = np.maximum(surfaces.speed * (held[at] - surfaces.settled), 0.0)  # of the start; the later columns are laid over
    volumes = [(order.index(g), v, order.index(v.to) if v.to else -1) for g, v in own.items()]
    for i in range(1, times.size):
        if volumes:
            film[:, i], rate[:, i] = _interval(i, times, held, surfaces, film[:, i - 1], at, volumes)
        else:
            film[:, i], rate[:, i] = _open_interval(i, times, held[at], surfaces, film[:, i - 1])
    dews = {g: dew_point(held[k] * VAPOUR_CONSTANT * gas[g]) for k, g in enumerate(order)}
    margin = surfaces.skin - np.array([dews[c.gas] for c in parts]).reshape(film.shape)
    return Followed(dews, margin, film, rate * surfaces.area[:, None] * latent_heat(surfaces.skin))


def _interval(
    i: int, times: Array, held: Array, s: _Surfaces, film: Array, at: NDArray[np.int_], volumes: list[tuple[int, Volume, int]]
) -> tuple[Array, Array]:
    """Return film and rate (surfaces,) at output i, and write the vapour of the volumes into `held`. [kg/m^2], [kg/(m^2 s)]"""
    count = max(1, int(np.ceil((times[i] - times[i - 1]) / STEP)))
    step = (times[i] - times[i - 1]) / count
    inside = {k: float(held[k, i - 1]) for k, _, _ in volumes}
    gain = np.zeros(film.size)
    for n in range(1, count + 1):
        share = n / count
        wall, speed, now = ((1 - share) * x[:, i - 1] + share * x[:, i] for x in (s.settled, s.speed, held))
        for k, before in inside.items():
            now[k] = before
        for k, volume, outer in volumes:
            here = at == k
            fresh = float(volume.exchange), float(now[outer]) if outer >= 0 else 0.0
            now[k] = inside[k] = _density(float(volume.volume), fresh, inside[k], (film, s.area * here, speed, wall), step)
        gain = np.maximum(speed * (now[at] - wall), -film / step)
        film = np.maximum(film + step * gain, 0.0)
    for k, value in inside.items():
        held[k, i] = value
    return film, gain


def _open_interval(i: int, times: Array, held: Array, s: _Surfaces, film: Array) -> tuple[Array, Array]:
    """Return the same where all vapour (surfaces, times) is given: all steps at once. [kg/m^2], [kg/(m^2 s)]

    A film that never falls below nothing is the sum of what came, less the lowest that this sum would have reached below nothing.
    """
    count = max(1, int(np.ceil((times[i] - times[i - 1]) / STEP)))
    step = (times[i] - times[i - 1]) / count
    share = np.arange(1, count + 1) / count
    wall, speed, now = (np.multiply.outer(x[:, i - 1], 1 - share) + np.multiply.outer(x[:, i], share) for x in (s.settled, s.speed, held))
    flow = speed * (now - wall)
    unbound = film[:, None] + np.cumsum(step * flow, axis=1)
    films = unbound - np.minimum(np.minimum.accumulate(unbound, axis=1), 0.0)
    before = films[:, -2] if count > 1 else film
    return films[:, -1], np.maximum(flow[:, -1], -before / step)


def _density(size: float, fresh: tuple[float, float], before: float, walls: tuple[Array, Array, Array, Array], step: float) -> float:
    """Return the vapour density of a volume after a step, with what it exchanges and what settles taken at its end. [kg/m^3]

    Walls that would dry within the step give what they have; which ones take part follows from the answer, hence the repetition.
    """
    film, area, speed, wall = walls
    through, outer = fresh
    after = before
    for _ in range(area.size + 2):
        active = (after > wall) | (film > 0.0)
        drying = active & (film > 0.0) & (speed * (wall - after) * step > film)
        taking = active & ~drying
        pull = float((speed * area)[taking].sum())
        push = float((speed * area * wall)[taking].sum() + (film * area)[drying].sum() / step)
        new = (size * before / step + through * outer + push) / (size / step + through + pull)
        if abs(new - after) < 1e-15:
            break
        after = new
    return after


def _pressure(solution: Solution, gas: str, given: Signal) -> Array:
    """Return the pressure (times,) of the vapour of a gas; never above that of the gas. [Pa]"""
    share = given.at(solution.times)
    _check_humidity(share, f"'{gas}'")
    environments = solution._run.wiring.scenario.environment
    whole: Signal = environments.get(gas, environments.get("*", Environment())).pressure
    return np.asarray(np.minimum(vapour_pressure(solution[gas].kelvin, share), whole.at(solution.times)))


def _check_humidity(values: Array, whose: str) -> None:
    bad = ~((values >= 0.0) & (values <= 1.0))
    if bad.any():
        raise ScenarioError(f"{whose} would have a relative humidity of {values[bad][0]:g}; give 0 to 1, or a text such as '60 [%]'.")
