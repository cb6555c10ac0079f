"""Benches of a heated box of two masses whose truth no deck of it has; all benches of a family are run at once.

Core (250 J/K, heated) - contact 0.5 W/K that changes with temperature - shell (300 J/K, 0.06 m^2) - room, by free air and radiation; a
lead from the core to the room; a mass behind the shell in some families. Values are drawn about these. What is logged differs from what
acts: constant offsets of the sensors and of the room, a factor of the power, a room that wanders (Ornstein-Uhlenbeck), noise.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

Array = np.ndarray
SIGMA, AREA, REFERENCE = 5.670374419e-8, 0.06, 303.15
"""Stefan-Boltzmann constant [W/(m^2 K^4)], outside of the shell [m^2], temperature of the stated contact [K]."""
STEP, THIN = 30.0, 4
"""Step of the truth [s], and steps from reading to reading."""
NOISE, OFFSET, FACTOR, ROOM_OFFSET, MEMORY = 0.05, 0.1, 0.01, 0.1, 3600.0
"""Noise and offset of a sensor [K], error of the power meter [-], offset of the logged room [K], time constant of its wander [s]."""
MIDDLES = {"core": 250.0, "shell": 300.0, "contact": 0.5, "natural": 1.5, "lead": 0.03, "emissivity": 0.8}
SPREADS = {"core": 0.3, "shell": 0.3, "contact": 0.3, "natural": 0.2, "lead": 0.2}
"""Middles of the values (J/K, J/K, W/K, W/(m^2 K^1.25), W/K, -), and standard deviations of their logarithms."""
EMISSIVITY_SPREAD = 0.03
NODES = ("core", "shell")


@dataclass(frozen=True)
class Course:
    """What is done in one run.

    Parameters
    ----------
    power : function    Times [s] -> heater power. [W]
    room : float        Middle of the room's temperature. [K]
    seconds : float     How long it lasts. [s]
    vacuum : bool       Whether the gas is gone.
    stratum : str       How far it is from the fitted runs, in words of the judge.
    """

    power: Callable[[Array], Array]
    room: float
    seconds: float
    vacuum: bool = False
    stratum: str = "fitted"


def _steps(*levels: tuple[float, float]) -> Callable[[Array], Array]:
    """Return a power of levels, each (until [s], power [W])."""
    return lambda t: np.select([t < end for end, _ in levels[:-1]], [w for _, w in levels[:-1]], levels[-1][1])


def _pulses(high: float, low: float) -> Callable[[Array], Array]:
    """Return a power that changes every hour."""
    return lambda t: np.where((t // 3600) % 2 == 0, high, low)


COURSES = {
    "a": Course(_steps((7200, 6.0), (np.inf, 0.0)), 295.15, 10800.0),
    "b": Course(_steps((9000, 3.0), (np.inf, 1.0)), 294.15, 10800.0),
    "near": Course(_pulses(5.0, 2.5), 295.15, 14400.0, stratum="power within 1.2, room within 3 K"),
    "1.5x": Course(_pulses(9.0, 4.0), 305.15, 14400.0, stratum="power 1.5, room +10 K"),
    "2x": Course(_pulses(12.0, 8.0), 305.15, 14400.0, stratum="power 2, room +10 K"),
    "vacuum": Course(_pulses(5.0, 2.5), 295.15, 14400.0, vacuum=True, stratum="gas changed"),
}
FITTED = ("a", "b")


@dataclass(frozen=True)
class Family:
    """A truth, and the structure that is fitted to it.

    Parameters
    ----------
    name : str
    structure : str         What is fitted: see `decks`.
    truth : dict            Values that differ from the middles of the plain truth.
    factors : dict          Values whose draws are multiplied.
    drift : float           Standard deviation of the room's wander. [K]
    by_run : float          Standard deviation by which contact and air coefficient differ from run to run. [-]
    meter : dict            Run -> factor on its logged power.
    stated_emissivity : float   What the deck says of it; zero for nothing.
    asked : tuple           Runs that are asked.
    """

    name: str
    structure: str
    truth: Mapping[str, float] = field(default_factory=dict)
    factors: Mapping[str, float] = field(default_factory=dict)
    drift: float = 0.2
    by_run: float = 0.0
    meter: Mapping[str, float] = field(default_factory=dict)
    stated_emissivity: float = 0.0
    asked: tuple[str, ...] = ("near", "1.5x", "2x")

    def with_name(self, name: str, **changes: object) -> Family:
        """Return it with another name and changes."""
        return replace(self, name=name, **changes)  # type: ignore[arg-type]


def _families() -> dict[str, Family]:
    right, mild = Family("right", "right"), Family("mild", "constant")
    strong = {"growth": 0.03, "hidden": 0.15}
    mirror = {"exponent": 1.0, "emissivity": 0.1, "growth": -0.005}
    gas = ("1.5x", "vacuum")
    every = [
        right,
        right.with_name("right, drift 0", drift=0.0),
        right.with_name("right, drift .4", drift=0.4),
        Family("half", "half"),
        mild,
        mild.with_name("mild, drift 0", drift=0.0),
        mild.with_name("mild, 3 % by run", by_run=0.03),
        mild.with_name("strong", truth=strong),
        mild.with_name("mirror", truth=mirror, factors={"natural": 4.5}),
        right.with_name("hidden mass", truth={"hidden": 0.15}),
        mild.with_name("finish", structure="finish", stated_emissivity=0.8, asked=gas),
        mild.with_name("wrong finish", structure="finish", truth={"emissivity": 0.3}, stated_emissivity=0.8, asked=gas),
        mild.with_name("power of b 5 % off", meter={"b": 1.05}),
    ]
    return {f.name: f for f in every}


FAMILIES = _families()


@dataclass(frozen=True, eq=False)
class Logs:
    """One run of every bench of a family.

    Parameters
    ----------
    times : array (times,)              [s]
    power, room : array (times, benches)    As logged. [W], [K]
    truth : array (times, benches, 2)   Core and shell. [K]
    readings : array (readings, benches, 2) Every fourth time. [K]
    """

    times: Array
    power: Array
    room: Array
    truth: Array
    readings: Array


@dataclass(frozen=True, eq=False)
class Benches:
    """All benches of a family: values by name (benches,), and runs by name."""

    family: Family
    seed: int
    values: Mapping[str, Array]
    runs: Mapping[str, Logs]

    @property
    def count(self) -> int:
        """How many there are."""
        return int(next(iter(self.values.values())).size)


def drawn_values(family: Family, count: int, rng: np.random.Generator) -> dict[str, Array]:
    """Return the true values of benches, name -> (benches,)."""
    out = {n: MIDDLES[n] * np.exp(sd * rng.standard_normal(count)) for n, sd in SPREADS.items()}
    out["emissivity"] = np.clip(MIDDLES["emissivity"] + EMISSIVITY_SPREAD * rng.standard_normal(count), 0.6, 0.95)
    constants = {"exponent": 1.25, "growth": 0.01, "hidden": 0.0, "hidden capacitance": 150.0}
    out |= {n: np.full(count, x) for n, x in (constants | dict(family.truth)).items()}
    return {n: x * family.factors.get(n, 1.0) for n, x in out.items()}


def temperatures(v: Mapping[str, Array], power: Array, room: Array, vacuum: bool = False, step: float = STEP) -> Array:
    """Return core and shell (times, members, 2), from the room's first temperature on; classical Runge-Kutta, the room straight. [K]

    Parameters
    ----------
    v : dict                                Values, name -> (members,).
    power, room : array (times, members)    Power held over a step [W]; room [K].
    vacuum : bool                           Without gas.
    step : float                            [s]
    """
    air = 0.0 if vacuum else 1.0
    half, sky = 0.5 * v["growth"], AREA * SIGMA * v["emissivity"]

    def rate(y: Array, heat: Array, around: Array) -> Array:
        core, shell, behind = y
        across = v["contact"] * (1.0 + half * (core + shell - 2.0 * REFERENCE)) * (core - shell)
        taken = v["hidden"] * (shell - behind)
        d = shell - around
        film = air * AREA * v["natural"] * np.sign(d) * np.abs(d) ** v["exponent"]
        lost = film + sky * (shell**4 - around**4)
        return np.stack(
            [
                (heat - across - v["lead"] * (core - around)) / v["core"],
                (across - taken - lost) / v["shell"],
                taken / v["hidden capacitance"],
            ]
        )

    y = np.repeat(room[:1], 3, axis=0)
    out = np.empty((power.shape[0], power.shape[1], 2))
    for i in range(power.shape[0]):
        out[i] = y[:2].T
        if i + 1 < power.shape[0]:
            middle = 0.5 * (room[i] + room[i + 1])
            k1 = rate(y, power[i], room[i])
            k2 = rate(y + 0.5 * step * k1, power[i], middle)
            k3 = rate(y + 0.5 * step * k2, power[i], middle)
            k4 = rate(y + step * k3, power[i], room[i + 1])
            y = y + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return out


def wandered(times: Array, count: int, rng: np.random.Generator) -> Array:
    """Return Ornstein-Uhlenbeck courses of unit variance (times, benches)."""
    keep = np.exp(-np.diff(times, prepend=times[0] - STEP) / MEMORY)
    out = rng.standard_normal((times.size, count))
    for i in range(1, times.size):
        out[i] = keep[i] * out[i - 1] + np.sqrt(1.0 - keep[i] ** 2) * out[i]
    return out


def made(family: Family, count: int, seed: int) -> Benches:
    """Return benches of a family; each run has a generator of its own, so that runs asked later change no other."""
    mark = zlib.crc32(family.name.encode())
    rng = np.random.default_rng([seed, mark])
    values = drawn_values(family, count, rng)
    room_offset, factor = ROOM_OFFSET * rng.standard_normal(count), 1.0 + FACTOR * rng.standard_normal(count)
    offsets = OFFSET * rng.standard_normal((count, 2))
    runs = {}
    for name in (*FITTED, *family.asked):
        course, own = COURSES[name], np.random.default_rng([seed, mark, zlib.crc32(name.encode())])
        times = np.arange(0.0, course.seconds + 1.0, STEP)
        power = np.repeat(course.power(times)[:, None], count, axis=1)
        logged = course.room + 0.3 * np.sin(times[:, None] / 4000.0 + own.uniform(0.0, 6.0, count))
        differ = {n: values[n] * np.exp(family.by_run * own.standard_normal(count)) for n in ("contact", "natural")}
        around = logged + family.drift * wandered(times, count, own)
        truth = temperatures({**values, **differ}, power, around, course.vacuum)
        noise = NOISE * own.standard_normal(truth[::THIN].shape)
        read = factor * family.meter.get(name, 1.0)
        runs[name] = Logs(times, power * read, logged + room_offset, truth, truth[::THIN] + offsets + noise)
    return Benches(family, seed, values, runs)
