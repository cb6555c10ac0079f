"""The balance of vapour along a run: what every gas holds, what settles on surfaces and what dries.

Gases of a known humidity are reservoirs, and a film beside one is an integral in closed form. Volumes with vapour of their own are solved
together, with the films on their walls: between two outputs temperatures are straight lines, so the equations are linear as long as the
same surfaces are wet; when a film is gone or a dry surface passes the dew point, that instant is searched for and the step ends there.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from thermid.base.errors import ScenarioError, refuse_first
from thermid.base.units import ATMOSPHERE, STEFAN_BOLTZMANN, Array, Bools, amount, value_of
from thermid.model.tree import FlatConductor, Signal, exposed_area
from thermid.physics.air import (
    VAPOUR_CONSTANT,
    dew_point,
    latent_heat,
    mass_transfer_coefficient,
    saturation_pressure,
    vapour_density,
    vapour_pressure,
)
from thermid.simulation.runs import VACUUM_LIMIT, Solution
from thermid.site._constants import RADAU_A, RADAU_C

MAX_MISSING_WATER_SHARE: Final = 1e-6
"""Share of the water that may be missing at the end of a run without a remark. [-]"""
DILUTE: Final = 0.1
"""Share of a gas that may be vapour: the analogy of heat and mass transfer leaves out the stream that vapour itself makes. [-]"""
BREATH: Final = 0.1
"""Change of the density of a volume's gas above which the vapour that its breathing carries is missed. [-]"""
MAX_STEP_ERROR: Final = 1e-6
"""Error of a step, of the vapour and of the films. [-]"""
SHORTEST_STEP: Final = 1e-7
"""Shortest step, as a share of the time between two outputs. [-]"""
NOTHING: Final = 1e-12
"""Film over the size of vapour densities that counts as none [m], and the same of a rate [m/s]."""
FILM_PIECES: Final = 8
"""Pieces of an interval over which a film beside a known gas is a polygon in its mean. [-]"""
FOG: Final = 1.02
"""Relative humidity of a volume above which its own gas would form drops. [-]"""


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
        for name, slot in (("volume", "m^3"), ("exchange", "m^3/s"), ("humidity", "1")):
            object.__setattr__(self, name, amount(getattr(self, name), slot, name))
        refuse_first(
            "",
            (
                not float(self.volume) > 0.0 or float(self.exchange) < 0.0,
                "a volume of gas must be above zero, and its exchange zero or more.",
                "value.outside-range",
            ),
            (
                (float(self.exchange) > 0.0) != bool(self.to),
                "exchange and to belong together. Give both for a volume that exchanges gas.",
                "value.incomplete",
            ),
            error=ScenarioError,
        )
        _check_humidity(np.array([self.humidity]), "a volume")


@dataclass(frozen=True)
class WaterBalance:
    """Where the water of a run went. [kg]

    Parameters
    ----------
    vapour : float      Change of the vapour in volumes of their own.
    films : float       Change of the water on surfaces.
    exchanged : float   What gases of known humidity brought by exchange of gas, less what left to them.
    open_air : float    What settled on surfaces from gases of known humidity, less what dried into them.
    settled : float     All that settled, as dew or frost.
    dried : float       All that dried.
    handled : float     Vapour at the start, and all that moved: what the residual is measured by.
    """

    vapour: float
    films: float
    exchanged: float
    open_air: float
    settled: float
    dried: float
    handled: float

    @property
    def residual(self) -> float:
        """What came, less what is there now. [kg]"""
        return self.exchanged + self.open_air - self.vapour - self.films

    @property
    def relative(self) -> float:
        """The residual over all water that was handled. [-]"""
        return abs(self.residual) / self.handled if self.handled > 0.0 else 0.0

    @property
    def closes(self) -> bool:
        """Whether the residual is at most a millionth of the water handled."""
        return self.relative <= MAX_MISSING_WATER_SHARE

    def __str__(self) -> str:
        """Return the balance as one line."""
        return (
            f"water: {_grams(self.settled)} settled, {_grams(self.dried)} dried, {_grams(self.films)} left on surfaces; vapour of the "
            f"volumes {_grams(self.vapour, '+')}, exchanged {_grams(self.exchanged, '+')}; the balance closes to {self.relative:.1e}"
        )


def _grams(mass: float, sign: str = "") -> str:
    """Return a mass as text. [g]"""
    return f"{1e3 * mass:{sign}.3g} g"


@dataclass(frozen=True, eq=False)
class Followed:
    """What vapour does along a run.

    Parameters
    ----------
    dew_points : dict                       Gas -> dew point (times,). [K]
    margin : array (surfaces, times)        Temperature less the dew point. [K]
    film : array (surfaces, times)          [kg/m^2]
    latent : array (surfaces, times)        Heat that settling gives; its polygon holds the water that settled. [W]
    water : WaterBalance
    remarks : tuple of str                  What is assumed or left out.
    """

    dew_points: Mapping[str, Array]
    margin: Array
    film: Array
    latent: Array
    water: WaterBalance
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class _Surfaces:
    """Areas (surfaces,) [m^2]; temperatures [K], speeds at which vapour reaches them [m/s] and its density over them [kg/m^3] in time."""

    area: Array
    skin: Array
    speed: Array
    settled: Array


def _surfaces(solution: Solution, parts: Sequence[FlatConductor]) -> _Surfaces:
    """Return area, temperature, mass transfer coefficient and saturated vapour density of every surface over a run."""
    run = solution._run
    values = {p: value_of(v) for p, v in run.assembled.numbers.values.items()}
    shape = (len(parts), solution.times.size)
    skin = np.array([solution[c.ends[0]].kelvin for c in parts]).reshape(shape)
    area = np.array([value_of(exposed_area(c.path, values[c.fields["area"]], c.takes, values)) for c in parts])
    conductances = run.conductances(solution.times, solution._kelvin)
    speed = np.zeros(shape)
    for k, c in enumerate(parts):
        grey = values[c.emissivity] if c.kind == "effective" and c.emissivity else 0.0
        speed[k] = _speed(conductances[c.path], skin[k], solution[c.gas].kelvin, area[k], grey, _whole(solution, c.gas))
    return _Surfaces(area, skin, speed, vapour_density(saturation_pressure(skin, "surface"), skin))


def _speed(conductance: Array, skin: Array, air: Array, area: float, emissivity: float, pressure: Array) -> Array:
    """Return the mass transfer coefficient (times,) of a surface, zero where there is no gas. [m/s]

    From h = G / A - 4 e sigma T_m^3, at least zero, by the analogy of heat and mass transfer: `conductance` G [W/K], `area` A [m^2],
    `emissivity` e, and T_m the mean of `skin` and `air` [K]; gas is where `pressure` exceeds `VACUUM_LIMIT` [Pa]. All arrays are (times,).
    """
    if area <= 0.0:
        return np.zeros(skin.size)
    mean = 0.5 * (skin + air)
    htc = np.maximum(conductance / area - 4.0 * emissivity * STEFAN_BOLTZMANN * mean**3, 0.0)
    there = pressure > VACUUM_LIMIT
    return np.where(there, mass_transfer_coefficient(htc, mean, np.where(there, pressure, ATMOSPHERE)), 0.0)


def follow(solution: Solution, parts: Sequence[FlatConductor], open_air: Mapping[str, Signal], volumes: Mapping[str, Volume]) -> Followed:
    """Return dew points, films, latent heat and water balance along a run, films never below zero.

    Arrays are (gases or parts, times). A dew point [K] is that of the vapour pressure rho R_v T, the margin [K] is skin less dew point,
    latent heat [W] into the surface is the film's rate [kg/(m^2 s)] times area times the heat of vaporisation, positive while it
    condenses. Films are zero at the start. The run stays as it is: latent heat is returned, and moves no temperature. Beside a gas of
    known humidity a film is integrated in closed form (`_film_in_known_gas`); volumes with vapour of their own are solved together with
    the films on their walls (`_System`).

    Parameters
    ----------
    solution : Solution         The run.
    parts : sequence            Surfaces that exchange with these gases.
    open_air : dict             Boundary that is a gas -> relative humidity. [-]
    volumes : dict              Gas node -> its volume.

    Raises
    ------
    ScenarioError   When a relative humidity is not one, two volumes give their exchange two sizes, or a gas is not air.
    """
    times = solution.times
    gas = {g: solution[g].kelvin for g in (*open_air, *volumes)}
    for g, kind in ((g, solution._run.network.media.gas(g)) for g in gas):
        if kind != "air":
            raise ScenarioError(
                f"'{g}' is {kind}, but the diffusion of vapour is known in air only. Leave its humidity out, or run it in air.",
                solution.scenario,
                code="model.element-not-supported",
            )
    surfaces = _surfaces(solution, parts)
    density = {g: vapour_density(_pressure(solution, g, outdoor_humidity), gas[g]) for g, outdoor_humidity in open_air.items()}
    for g, v in volumes.items():
        start = min(float(vapour_pressure(gas[g][0], v.humidity)), float(_whole(solution, g)[0]))
        density[g] = np.full(times.size, float(vapour_density(start, gas[g][0])))
    order = list(density)
    held = np.array([density[g] for g in order]).reshape(len(order), times.size)
    at = np.array([order.index(c.gas) for c in parts], dtype=int)
    film, mean, moved = np.zeros(surfaces.skin.shape), np.zeros((len(parts), times.size - 1)), np.zeros((2, len(parts)))
    outdoors = at < len(open_air)
    film[outdoors], mean[outdoors], moved[:, outdoors] = _film_in_known_gas(times, held[at[outdoors]], surfaces, outdoors)
    exchanged = np.zeros(2)
    if volumes:
        system = _System.of_volumes(solution, order, volumes, surfaces, at, held)
        film[~outdoors], mean[~outdoors], moved[:, ~outdoors], exchanged = system.solve(held)
    dews = {g: dew_point(held[k] * VAPOUR_CONSTANT * gas[g]) for k, g in enumerate(order)}
    margin = surfaces.skin - np.array([dews[c.gas] for c in parts]).reshape(film.shape)
    latent = _rates(times, film, mean) * surfaces.area[:, None] * latent_heat(surfaces.skin)
    water = _balance(order, volumes, held, film, moved, outdoors, exchanged, surfaces.area)
    shown = np.maximum(film, 0.0)
    return Followed(dews, margin, shown, latent, water, (*_left_out(solution, parts, order, held, shown, surfaces, volumes, gas),))


def _rates(times: Array, film: Array, mean: Array) -> Array:
    """Return the rate at which water settles (surfaces, times) whose polygon has the integral of the film, dried-out stretches included.

    With the hat function of an output, mean(hat * d film/dt) = difference of the film's means over the intervals beside it. [kg/(m^2 s)]
    """
    dt = np.diff(times)
    if not dt.size:
        return np.zeros(film.shape)
    beside = np.concatenate((film[:, :1], mean, film[:, -1:]), axis=1)
    return np.asarray(2.0 * np.diff(beside, axis=1) / np.concatenate(([dt[0]], dt[1:] + dt[:-1], [dt[-1]])))


def _film_in_known_gas(times: Array, held: Array, s: _Surfaces, which: Bools) -> tuple[Array, Array, Array]:
    """Return films on the surfaces `which` beside gases of known humidity. [kg/m^2]

    With S(t) the integral of v (c - w) without a limit, the film is S - min(0, lowest S so far). The speed v and the driving density c - w
    are linear between outputs, so S is cubic there; it is evaluated at `FILM_PIECES` points per interval and where c - w changes sign.

    Parameters
    ----------
    times : array (times,)            [s]
    held : array (surfaces, times)    Vapour density c of the gas beside each surface. [kg/m^3]

    Returns
    -------
    film : array (surfaces, times), its means : array (surfaces, times - 1), totals that settled and dried : array (2, surfaces)
    """
    speed, drive, dt = s.speed[which], held - s.settled[which], np.diff(times)
    knots = np.concatenate(([0.0], np.linspace(0.0, 1.0, FILM_PIECES + 1)[1:]))
    first, last = drive[:, :-1], drive[:, 1:]
    turns = (first < 0.0) != (last < 0.0)
    turn = np.where(turns, first / np.where(turns, first - last, 1.0), 0.0)
    share = np.sort(np.concatenate((np.broadcast_to(knots[1:], (*turn.shape, FILM_PIECES)), turn[..., None]), axis=2), axis=2)
    v0, dv = speed[:, :-1, None], np.diff(speed, axis=1)[..., None]
    d0, dd = first[..., None], (last - first)[..., None]
    came = dt[:, None] * share * (v0 * d0 + share * (0.5 * (v0 * dd + dv * d0) + share * dv * dd / 3.0))
    start = np.concatenate((np.zeros((len(came), 1)), np.cumsum(came[..., -1], axis=1)), axis=1)
    unbound = (start[:, :-1, None] + came).reshape(len(came), came[0:1].size if len(came) else 0)
    films = unbound - np.minimum(np.minimum.accumulate(unbound, axis=1), 0.0)
    steps = np.diff(np.concatenate((np.zeros((len(films), 1)), films), axis=1), axis=1)
    inner = films.reshape(came.shape)
    film = np.concatenate((np.zeros((len(films), 1)), inner[..., -1]), axis=1)
    corners = np.concatenate((film[:, :-1, None], inner), axis=2)
    widths = np.diff(np.concatenate((np.zeros((*turn.shape, 1)), share), axis=2), axis=2)
    mean = (0.5 * (corners[..., 1:] + corners[..., :-1]) * widths).sum(axis=2)
    return film, mean, np.array([np.maximum(steps, 0.0).sum(axis=1), np.maximum(-steps, 0.0).sum(axis=1)])


@dataclass(eq=False)
class _Water:
    """Vapour of the volumes (volumes,) [kg/m^3], films (surfaces,) [kg/m^2], and what came from and went to known gases (2,) [kg]."""

    vapour: Array
    film: Array
    through: Array


@dataclass(frozen=True, eq=False)
class _System:
    """Volumes that exchange vapour with each other, with known gases and with their walls, as linear equations in time.

    V dc/dt = -E c + e(t) + sum over wet walls of A v(t) (w(t) - c); a film grows by v (c - w). Solved by Radau IIA of order 5, which is
    stiffly accurate and keeps linear invariants, the water, to rounding: Hairer and Wanner, Solving Ordinary Differential Equations II,
    2nd ed., section IV.5.
    """

    times: Array
    size: Array  # (volumes,) [m^3]
    exchange: Array  # (volumes, volumes): Laplacian of the exchange, that with known gases on the diagonal [m^3/s]
    fresh: Array  # (volumes, known): exchange with gases of known humidity [m^3/s]
    known: Array  # (known, times): their vapour [kg/m^3]
    area: Array  # (surfaces,) [m^2]
    at: NDArray[np.int_]  # (surfaces,): volume of each wall
    speed: Array  # (surfaces, times) [m/s]
    wall: Array  # (surfaces, times) [kg/m^3]

    @cached_property
    def faces(self) -> Array:
        """Areas of the walls (surfaces) of each volume (volumes, surfaces). [m^2]"""
        return np.asarray((self.at == np.arange(self.size.size)[:, None]) * self.area)

    @cached_property
    def tripled(self) -> Array:
        """Sizes of the volumes, repeated for each of the 3 Radau stages (3 volumes,). [m^3]"""
        return np.tile(self.size, 3)

    @classmethod
    def of_volumes(
        cls, solution: Solution, order: Sequence[str], volumes: Mapping[str, Volume], s: _Surfaces, at: NDArray[np.int_], held: Array
    ) -> _System:
        """Return the equations of the volumes, which come last in `order`.

        With the flows q [m^3/s] of exchanges, the laplacian (volumes, volumes) has their sums on its diagonal and -q off it; fresh
        (volumes, open gases) has those with open air. `at` (surfaces,) is each surface's gas, `held` (gases, times) the vapour density.
        [kg/m^3]
        """
        start = len(order) - len(volumes)
        laplacian, fresh = np.zeros((len(volumes), len(volumes))), np.zeros((len(volumes), start))
        for (a, b), flow in _exchanges(solution, order, volumes).items():
            laplacian[a, a] += flow
            if b < 0:
                fresh[a, b + start] += flow
            else:
                laplacian[b, b] += flow
                laplacian[[a, b], [b, a]] -= flow
        inside = at >= start
        size = np.array([float(v.volume) for v in volumes.values()])
        return cls(
            solution.times,
            size,
            laplacian,
            fresh,
            held[:start],
            s.area[inside],
            at[inside] - start,
            s.speed[inside],
            s.settled[inside],
        )

    def solve(self, held: Array) -> tuple[Array, Array, Array, Array]:
        """Return films (surfaces, times) [kg/m^2], means in each interval, what settled and dried (2, surfaces), what came and went [kg].

        Writes the vapour of the volumes [kg/m^3] into `held`. Means are by Simpson's rule over each step (begin, middle, end). What
        settled and dried are the rises and the falls of a film over half steps. An interval begins with twice the longest step of the one
        before.
        """
        first = len(held) - self.size.size
        state = _Water(held[first:, 0].copy(), np.zeros(self.area.size), np.zeros(2))
        film, mean = np.zeros((self.area.size, self.times.size)), np.zeros((self.area.size, self.times.size - 1))
        moved, scale, width = np.zeros((2, self.area.size)), float(max(state.vapour.max(), self.known.max(initial=0.0), 1e-9)), 1.0
        for i in range(self.times.size - 1):
            course = _Interval(self, i, scale)
            tried, width = 2.0 * width, 0.0
            for before, after, share, middle in course.steps(state, min(tried, 1.0)):
                width = max(width, share)
                mean[:, i] += share * (before.film + 4.0 * middle.film + after.film) / 6.0
                change = np.array([middle.film - before.film, after.film - middle.film])
                moved += np.maximum(change, 0.0).sum(axis=0), np.maximum(-change, 0.0).sum(axis=0)
                state = after
            held[first:, i + 1], film[:, i + 1] = state.vapour, state.film
        return film, mean, moved, state.through


@dataclass(frozen=True, eq=False)
class _Interval:
    """The equations between two outputs, where temperatures are straight lines."""

    system: _System
    i: int
    scale: float

    @property
    def span(self) -> float:
        """Time between the outputs. [s]"""
        return float(self.system.times[self.i + 1] - self.system.times[self.i])

    def _at(self, values: Array, share: Array) -> Array:
        """Return values (rows, shares) of a quantity (rows, times), linear between its outputs, at shares 0 to 1 of the interval."""
        return np.asarray(values[:, self.i, None] * (1.0 - share) + values[:, self.i + 1, None] * share)

    def gain(self, state: _Water, share: float) -> Array:
        """Return the mass flux v (c - w) to walls (surfaces,) as if all were wet; `share` is 0 to 1 of the interval. [kg/(m^2 s)]"""
        s, at = self.system, np.array([share])
        return np.asarray(self._at(s.speed, at)[:, 0] * (state.vapour[s.at] - self._at(s.wall, at)[:, 0]))

    def step(self, state: _Water, share: float, width: float, wet: Bools) -> _Water:
        """Return the state after one Radau IIA step of three stages from `share` over `width`, both parts of the interval.

        Volumes: V dc/dt = sum over walls A v (w - c) + fresh c_out - laplacian c, films df/dt = v (c - w), v the speed [m/s] of walls in
        `wet` (none of the others), c and w the vapour density of the gas and at the wall [kg/m^3].
        """
        s, n, h = self.system, self.system.size.size, width * self.span
        at = share + width * RADAU_C
        speed, wall, known_density = self._at(s.speed, at) * wet[:, None], self._at(s.wall, at), self._at(s.known, at)
        rate = np.repeat(s.exchange[:, None, :], 3, axis=1)  # (volume, stage, volume)
        rate[np.arange(n), :, np.arange(n)] += s.faces @ speed
        push, brought = s.faces @ (speed * wall), s.fresh @ known_density
        matrix = (h * RADAU_A[:, None, :, None] * rate).reshape(3 * n, 3 * n)
        matrix[np.diag_indices(3 * n)] += s.tripled
        right = s.tripled * np.tile(state.vapour, 3) + h * (RADAU_A @ (push + brought).T).ravel()
        stages: Array = np.asarray(np.linalg.solve(matrix, right), dtype=np.float64).reshape(3, n).T
        weight = h * RADAU_A[2]
        film = state.film + (speed * (stages[s.at] - wall)) @ weight
        through = np.array([brought.sum(axis=0) @ weight, s.fresh.sum(axis=1) @ stages @ weight])
        return _Water(stages[:, 2], film, state.through + through)

    def steps(self, state: _Water, width: float) -> Iterator[tuple[_Water, _Water, float, _Water]]:
        """Yield the steps of the interval: the state before and after, the share that it takes [-], and the state in its middle.

        The first step tries a share `width`. A step whose error is above 1 is made anew, nine tenths as long as error^(-1/6), its order,
        allows, a fifth at least; the next one grows by at most five. One in which a film appears or is gone ends there.
        """
        share = 0.0
        wet = (state.film > 0.0) | (self.gain(state, 0.0) > 0.0)
        while share < 1.0:
            width = min(width, 1.0 - share)
            if 1.0 - share - width < SHORTEST_STEP:
                width = 1.0 - share
            after, middle, error = self._doubled(state, share, width, wet)
            if error > 1.0 and width > SHORTEST_STEP:
                width = max(width * max(0.2, 0.9 * error ** (-1.0 / 6.0)), SHORTEST_STEP)
                continue
            crossed = self._crossed(after, share + width, wet) | self._crossed(middle, share + 0.5 * width, wet)
            if crossed.any() and width > SHORTEST_STEP:
                width = self._width_to_switch(state, share, width, wet, middle)
                after, middle, error = self._doubled(state, share, width, wet)
            yield state, after, width, middle
            state, share = after, share + width
            wet = np.where(self._turned(state, share, wet), ~wet, wet)
            width *= min(5.0, 0.9 * max(error, 1e-8) ** (-1.0 / 6.0)) if not crossed.any() else 1.0
            width = max(width, SHORTEST_STEP)

    def _doubled(self, state: _Water, share: float, width: float, wet: Bools) -> tuple[_Water, _Water, float]:
        """Return the state after two half steps of `width` / 2, the state between them, and their distance from one whole step. [-]

        The distance is the largest over vapour densities [kg/m^3] and films [kg/m^2], over `MAX_STEP_ERROR` times their size. `share` is
        where the step begins and `width` how long it is, both in parts of the interval.
        """
        whole = self.step(state, share, width, wet)
        middle = self.step(state, share, 0.5 * width, wet)
        after = self.step(middle, share + 0.5 * width, 0.5 * width, wet)
        films = MAX_STEP_ERROR * (self.scale + np.abs(after.film))
        off = [
            np.abs(whole.vapour - after.vapour) / (MAX_STEP_ERROR * (self.scale + np.abs(after.vapour))),
            np.abs(whole.film - after.film) / films,
        ]
        return after, middle, float(np.concatenate(off).max(initial=0.0))

    def _event_functions(self, state: _Water, share: float, wet: Bools) -> Array:
        """Return event functions (surfaces,), positive while `wet` holds: film / scale of a wet wall, -gain / scale of a dry one."""
        return np.where(wet, state.film / self.scale, -self.gain(state, share) / self.scale)

    def _crossed(self, state: _Water, share: float, wet: Bools) -> Bools:
        """Return which event functions are negative (surfaces,): the film is gone, or vapour condenses on a dry wall."""
        return np.asarray(self._event_functions(state, share, wet) < -NOTHING)

    def _turned(self, state: _Water, share: float, wet: Bools) -> Bools:
        """Return which walls (surfaces,) change state here: a wet one without film that dries, or a dry one at the dew point."""
        gain = self.gain(state, share)
        return np.asarray(np.where(wet, (state.film <= NOTHING * self.scale) & (gain < 0.0), gain > -NOTHING * self.scale))

    def _width_to_switch(self, state: _Water, share: float, width: float, wet: Bools, middle: _Water) -> float:
        """Return the width of the step, in parts of the interval, until the first wall dries or passes the dew point; Brent's method.

        The step begins at `share`; `width` is one in which that happens, and `middle` the state after half of it.
        """
        from scipy.optimize import brentq

        high = 0.5 * width if self._crossed(middle, share + 0.5 * width, wet).any() else width

        def lowest(part: float) -> float:
            """Return the lowest event function after a step of width `part`."""
            return float(self._event_functions(self.step(state, share, part, wet), share + part, wet).min())

        if lowest(SHORTEST_STEP) <= 0.0:
            return SHORTEST_STEP
        return max(float(brentq(lowest, SHORTEST_STEP, high, xtol=SHORTEST_STEP, rtol=1e-12)), SHORTEST_STEP)


def _exchanges(solution: Solution, order: Sequence[str], volumes: Mapping[str, Volume]) -> dict[tuple[int, int], float]:
    """Return (volume, partner) -> exchange [m^3/s]; a known gas is counted from the end, below zero. What both write is one exchange.

    Raises
    ------
    ScenarioError   When two volumes give their exchange two sizes.
    """
    find = solution._run.network.find
    first, out = len(order) - len(volumes), {}  # type: int, dict[tuple[int, int], float]
    for name, v in volumes.items():
        if not v.to:
            continue
        a, b = order.index(name) - first, order.index(find(v.to)) - first
        flow = float(v.exchange)
        if a == b:
            raise ScenarioError(
                f"'{name}' exchanges gas with itself; name another gas node.", solution.scenario, code="model.self-reference"
            )
        if b >= 0 and (b, a) in out:
            if abs(out[b, a] - flow) > 1e-9 * flow:
                raise ScenarioError(
                    f"'{name}' exchanges {flow:g} m^3/s with '{order[b + first]}', which exchanges {out[b, a]:g} m^3/s with '{name}'. "
                    "Both must be equal. Give it once, or the same at both.",
                    solution.scenario,
                    code="value.contradicts",
                )
            continue
        out[a, b] = flow
    return out


def _balance(
    order: Sequence[str],
    volumes: Mapping[str, Volume],
    held: Array,
    film: Array,
    moved: Array,
    outdoors: Bools,
    exchanged: Array,
    area: Array,
) -> WaterBalance:
    """Return where the water went: mass of vapour sum V c, of films sum A f, at the end less at the start; and what came and went. [kg]

    Parameters
    ----------
    held : array (gases, times)         Vapour c of each gas, the volumes last. [kg/m^3]
    film : array (surfaces, times)      f. [kg/m^2]
    moved : array (2, surfaces)         What settled and what dried. [kg/m^2]
    outdoors : array (surfaces,)        Which are in gas of given humidity.
    exchanged : array (2,)              Brought and lost by exchange of volumes. [kg]
    area : array (surfaces,)            A. [m^2]
    """
    size = np.array([float(v.volume) for v in volumes.values()])
    inside = held[len(order) - len(volumes) :]
    start, end = (float(size @ inside[:, k]) for k in (0, -1))
    settled, dried = (float(area @ change) for change in moved)
    open_air = float(area[outdoors] @ (moved[0] - moved[1])[outdoors])
    films = float(area @ film[:, -1])
    brought, lost = exchanged.tolist()
    return WaterBalance(end - start, films, brought - lost, open_air, settled, dried, start + brought + lost + settled + dried)


def _left_out(
    solution: Solution,
    parts: Sequence[FlatConductor],
    order: Sequence[str],
    held: Array,
    film: Array,
    s: _Surfaces,
    volumes: Mapping[str, Volume],
    gas: Mapping[str, Array],
) -> Iterator[str]:
    """Yield what the balance of vapour leaves out in this run: boiling, vapour that is not dilute, fog, breath.

    Vapour is p_v = c R_v T [Pa] at the film and in the gas; it is named as a share of the gas above `DILUTE`, relative humidity above
    `FOG`, and a change (max - min) / max of the density p / T above `BREATH`. [-]

    Parameters
    ----------
    order : sequence                    Gases in the order of `held`.
    held : array (gases, times)         Vapour c. [kg/m^3]
    film : array (surfaces, times)      [kg/m^2]
    gas : dict                          Gas -> temperature (times,). [K]
    """
    for g in order:
        whole, mine = _whole(solution, g), [k for k, c in enumerate(parts) if c.gas == g]
        empty = whole <= VACUUM_LIMIT
        if mine and empty.any() and (film[mine] > 0.0).any(where=empty):
            yield (
                f"'{g}' has no gas from {solution.times[empty.argmax()]:g} s. Films are kept unchanged there, although they would boil off"
            )
        wet = film[mine] > 0.0
        vapour = np.where(wet, s.settled[mine] * VAPOUR_CONSTANT * s.skin[mine], 0.0).max(axis=0, initial=0.0)
        vapour = np.where(wet.any(axis=0), np.maximum(vapour, held[order.index(g)] * VAPOUR_CONSTANT * gas[g]), 0.0)
        share = float((vapour / np.where(empty, np.inf, whole)).max(initial=0.0))
        if share > DILUTE:
            yield (
                f"vapour is up to {100 * min(share, 1.0):.0f} % of the gas in '{g}', but mass transfer is computed for dilute vapour. "
                f"Real condensation and drying are faster by about {50 * min(share, 1.0):.0f} %" + (", or boils" if share >= 1.0 else "")
            )
        if g in volumes:
            humid = held[order.index(g)] * VAPOUR_CONSTANT * gas[g] / saturation_pressure(gas[g])
            if humid.max() > FOG:
                k = int(humid.argmax())
                yield (
                    f"the gas of '{g}' reaches {100 * humid[k]:.0f} % relative humidity at {solution.times[k]:g} s. Fog is not "
                    "modelled; its water remains vapour"
                )
            breath = float(np.ptp(whole / gas[g]) / (whole / gas[g]).max()) if whole.max() > 0.0 else 0.0
            if volumes[g].to and breath > BREATH:
                yield (
                    f"the gas of '{g}' changes its density by {100 * breath:.0f} %. The vapour carried by this expansion is not "
                    "included, only that of its exchange"
                )


def _whole(solution: Solution, gas: str) -> Array:
    """Return the pressure (times,) of a gas. [Pa]"""
    return np.asarray(solution._run.network.media.pressure(gas).at(solution.times))


def _pressure(solution: Solution, gas: str, humidity: Signal) -> Array:
    """Return the pressure (times,) of the vapour of a gas; never above that of the gas. [Pa]"""
    share = humidity.at(solution.times)
    _check_humidity(share, f"'{gas}'")
    return np.asarray(np.minimum(vapour_pressure(solution[gas].kelvin, share), _whole(solution, gas)))


def _check_humidity(values: Array, whose: str) -> None:
    """Refuse a relative humidity outside 0 to 1."""
    bad = ~((values >= 0.0) & (values <= 1.0))
    if bad.any():
        raise ScenarioError(
            f"{whose} has a relative humidity of {values[bad][0]:g}. Give 0 to 1, or a text such as '60 [%]'.", code="value.outside-range"
        )
