"""What departs of a network, and how: every departure is heat that a unit of it puts into nodes along a run.

A conductance G that is off by a small part d is to first order the same as the heat ``q d`` taken from its first end and put into its
second; so is a power, and a mass behind a node. The kernel's derivatives by the size of such loads are the answer of the network.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from thermid.base.linear_algebra import Array
from thermid.fit._error_model.courses import (
    FREE_AIR,
    STREAM,
    ElementCourse,
    OperatingPoint,
    constant_coefficients,
    laws_of,
)
from thermid.fit._error_model.sizes import (
    FINISH,
    FLOWLESS,
    FREE_EXPONENT,
    FREE_EXPONENT_SD,
    LARGEST_SHARE,
    LEAST_SHARE,
    LEVEL_POINTS,
    LEVELS,
    ROOM_KNOTS,
)
from thermid.model.elements import CARRIED_BY, Law
from thermid.model.laws import Curve, TableSignal
from thermid.model.tree import FlatConductor, FlatLoad
from thermid.physics.constants import STEFAN_BOLTZMANN
from thermid.simulation.network import Network
from thermid.simulation.scenarios import Scenario

EXPONENT_OF, SHARE_OF, TREND_OF = "exponent", "radiation", "trend"
"""What of a law is not known: of a surface and of a joint."""
SOLIDS = ("conduction", "contact", "bolted", "wedge_lock")
"""Kinds of conductor whose constant conductance may grow with its level."""
SURFACE, JOINT, LAW = "surface", "joint", "law"
"""Classes of conductors: constant coefficients of surfaces; constant conductances; laws that follow temperatures by themselves."""


@dataclass(frozen=True)
class SurfaceLaw:
    """What stands behind a constant coefficient of a surface: ``G ((1 - s) (d/d0)^n + s (T/T0)^3)``, a recipe of two rows of the kernel.

    Parameters
    ----------
    at : OperatingPoint     d0 and T0, where G is the value.
    exponent : float        n, of free air; zero behind a fan. [-]
    share : float           s, of radiation. [-]
    linear : callable       Recipe of the constant coefficient.
    """

    at: OperatingPoint
    exponent: float
    share: float
    linear: Any

    def __call__(self, fields: Mapping[str, Any]) -> tuple[Law, ...]:
        """Return the laws at values of its fields."""
        base = self.linear(fields)
        conductance = base.coefficients[0]
        convected = conductance * ((1.0 - self.share) / self.at.difference**self.exponent)
        radiated = conductance * (self.share / (4.0 * self.at.level**3))
        return Law("power", (convected, self.exponent), "gas"), Law("radiation", (radiated,), "radiation")

    def growth(self, first: Array, second: Array) -> tuple[Array, Array]:
        """Return ``ln(d/d0)`` and what linear radiation is in parts of that at T0 (times,). [-]"""
        apart = np.maximum(np.abs(first - second), FLOWLESS * self.at.difference) / self.at.difference
        return np.log(apart), (first**2 + second**2) * (first + second) / (4.0 * self.at.level**3)

    def heats(self, course: ElementCourse, path: str, ends: tuple[str, str]) -> dict[str, Array]:
        """Return the heat (times,) that one more of n and of s adds along a run. [W]"""
        log, _ = self.growth(*(course.kelvin[end] for end in ends))
        radiated = course.radiated.get(path, np.zeros(course.times.size))
        convected = course.flows[path] - radiated
        out = {EXPONENT_OF: convected * log}
        return out | ({SHARE_OF: radiated / self.share - convected / (1.0 - self.share)} if self.share else {})

    def moved(self, by: Mapping[str, float]) -> SurfaceLaw:
        """Return the law with another exponent and share, kept to what is possible."""
        if not self.share:
            return replace(self, exponent=max(self.exponent + by.get(EXPONENT_OF, 0.0), 0.0))
        share = float(np.clip(self.share + by.get(SHARE_OF, 0.0), LEAST_SHARE, LARGEST_SHARE))
        return replace(self, exponent=max(self.exponent + by.get(EXPONENT_OF, 0.0), 0.0), share=share)

    @property
    def shape(self) -> dict[str, float]:
        """What of it is not known, where it is."""
        return {EXPONENT_OF: self.exponent, SHARE_OF: self.share}


@dataclass(frozen=True)
class JointLaw:
    """A joint or a solid whose conductance grows with its level: ``G f(c (T - T0))``, f(x) = 1 + x, and 1 / (1 - x) below T0.

    Parameters
    ----------
    at : OperatingPoint     T0, where G is the value.
    trend : float           c. [1/K]
    linear : callable       Recipe of the constant conductance.
    """

    at: OperatingPoint
    trend: float
    linear: Any

    def __call__(self, fields: Mapping[str, Any]) -> Law:
        """Return the law at values of its fields; its curve stands on the conductor."""
        base = self.linear(fields)
        return Law("table", base.coefficients, base.medium)

    @property
    def curve(self) -> Curve:
        """Return f over the level of both ends."""
        level = np.linspace(*LEVELS, LEVEL_POINTS)
        return Curve("temperature", level, *self.growth(level))

    def growth(self, level: Array) -> tuple[Array, Array]:
        """Return f and df/dT at levels. [-], [1/K]"""
        x = self.trend * (level - self.at.level)
        below = 1.0 / (1.0 - np.minimum(x, 0.0))
        return np.where(x < 0.0, below, 1.0 + x), self.trend * np.where(x < 0.0, below**2, 1.0)

    def heats(self, course: ElementCourse, path: str, ends: tuple[str, str]) -> dict[str, Array]:
        """Return the heat (times,) that one more of c adds along a run. [W K]"""
        apart = np.mean([course.kelvin[end] for end in ends], axis=0) - self.at.level
        x = self.trend * apart
        return {
            TREND_OF: course.flows[path] * apart * np.where(x < 0.0, 1.0 / (1.0 - np.minimum(x, 0.0)), 1.0 / (1.0 + np.maximum(x, 0.0)))
        }

    def moved(self, by: Mapping[str, float]) -> JointLaw:
        """Return the law with another trend."""
        return replace(self, trend=self.trend + by.get(TREND_OF, 0.0))

    @property
    def shape(self) -> dict[str, float]:
        """What of it is not known, where it is."""
        return {TREND_OF: self.trend}


ElementLaw = SurfaceLaw | JointLaw


@dataclass(frozen=True)
class Way:
    """What carries the heat of the surfaces of a network, as one possibility of a mixture.

    Parameters
    ----------
    name : str      ``free air``, ``fan`` or another word of a deck.
    laws : dict     Conductor -> its law with the means of its prior.
    sizes : dict    (conductor, what) -> group of sizes, and the multiple of it that is the standard deviation about the mean.
    """

    name: str
    laws: Mapping[str, ElementLaw] = field(default_factory=dict)
    sizes: Mapping[tuple[str, str], tuple[str, float]] = field(default_factory=dict)


def ways_of(
    network: Network, at: Mapping[str, OperatingPoint], coefficients: Mapping[str, float], emissivities: Mapping[str, float]
) -> tuple[Way, ...]:
    """Return what may carry the heat of a network's surfaces: one way where the deck says it, free air and a stream where it does not.

    Parameters
    ----------
    at : dict               Conductor -> where it was found.
    coefficients : dict     Conductor -> its coefficient there. [W/(m^2 K)]
    emissivities : dict     Conductor -> the emissivity that the deck gives its surface.
    """
    surfaces = {p: c for p, c in constant_coefficients(network).items() if p in at and c.kind in ("effective", "convection")}
    joints = {c.path: c for c in network.flat.conductors if c.path in at and c.kind in SOLIDS and len(laws_of(network, c)) == 1}
    joints = {p: c for p, c in joints.items() if laws_of(network, c)[0].form == "linear"}
    unsaid = [p for p, c in surfaces.items() if CARRIED_BY not in c.words]
    out = []
    for carrier in (FREE_AIR, STREAM) if unsaid else ("as the deck says",):
        laws: dict[str, ElementLaw] = {p: JointLaw(at[p], 0.0, linear_recipe(c)) for p, c in joints.items()}
        sizes: dict[tuple[str, str], tuple[str, float]] = {(p, TREND_OF): ("trend", 1.0) for p in joints}
        for path, c in surfaces.items():
            carried = c.words.get(CARRIED_BY, carrier)
            if carried not in (FREE_AIR, STREAM):
                continue
            free = carried == FREE_AIR
            share, spread = (0.0, 0.0) if c.kind != "effective" else _radiation(coefficients[path], at[path], emissivities.get(path))
            laws[path] = SurfaceLaw(at[path], FREE_EXPONENT if free else 0.0, share, linear_recipe(c))
            sizes |= {(path, EXPONENT_OF): ("", FREE_EXPONENT_SD)} if free else {}
            sizes |= {(path, SHARE_OF): ("", spread)} if spread else {}
        out.append(Way(carrier, laws, sizes))
    return tuple(out)


def linear_recipe(c: FlatConductor) -> Any:
    """Return the recipe of a conductor, or of its kind."""
    if c.recipe is not None:
        return c.recipe
    plain = replace(c, recipe=None)
    return lambda fields: plain.laws(fields)[0]


def _radiation(coefficient: float, at: OperatingPoint, emissivity: float | None) -> tuple[float, float]:
    """Return mean and standard deviation of the share of radiation: of a stated emissivity, else any up to the blackest is as likely."""
    black = 4.0 * STEFAN_BOLTZMANN * at.level**3 / max(coefficient, 1e-9)
    if emissivity is not None:
        share = min(LARGEST_SHARE, emissivity * black)
        return share, FINISH * share
    most = min(LARGEST_SHARE, LARGEST_SHARE * black)
    return 0.5 * most, most / 12.0**0.5


def with_laws(network: Network, laws: Mapping[str, ElementLaw]) -> Network:
    """Return a network whose elements follow laws in place of constant values."""
    # the radiation that an effective coefficient holds is a part of its law here
    held = {f"{path}.radiation" for path, law in laws.items() if isinstance(law, SurfaceLaw) and law.share}
    conductors = tuple(
        c if (law := laws.get(c.path)) is None else replace(c, recipe=law, curve=law.curve if isinstance(law, JointLaw) else c.curve)
        for c in network.flat.conductors
        if c.path not in held
    )
    return replace(network, flat=replace(network.flat, conductors=conductors))


@dataclass(frozen=True, eq=False)
class DepartureHeat:
    """What a unit of a departure puts into nodes along a run.

    Parameters
    ----------
    name : str          Of the unknown.
    into : tuple        (node, power: a signal [W]).
    """

    name: str
    into: tuple[tuple[str, Any], ...]

    @property
    def loads(self) -> tuple[str, ...]:
        """Names of the loads that stand for it."""
        return tuple(f"{self.name} into {node}" for node, _ in self.into)


def moved_heat(name: str, network: Network, ends: tuple[str, str], times: Array, watts: Array) -> DepartureHeat:
    """Return heat taken from a first end and put into a second."""
    pairs = zip(ends, (-watts, watts), strict=True)
    return DepartureHeat(name, tuple((n, TableSignal(times, w, False)) for n, w in pairs if n not in network.boundaries))


def with_heats(network: Network, scenario: Scenario, heats: Iterable[DepartureHeat]) -> tuple[Network, Scenario]:
    """Return a network and its scenario with loads of zero size; ``scale.<load>`` frees their size."""
    loads, powers = [], {}
    for h in heats:
        for name, (node, watts) in zip(h.loads, h.into, strict=True):
            loads.append(FlatLoad(name, node, node, {}))
            powers[name] = watts
    return replace(network, flat=replace(network.flat, loads=(*network.flat.loads, *loads))), scenario.with_(loads=powers)


def conductors_of(network: Network, course: ElementCourse) -> dict[str, FlatConductor]:
    """Return the conductors that may depart: those through which heat flows both ways, and whose ends are two."""
    return {
        c.path: c
        for c in network.flat.conductors
        if c.kind not in ("flow", "duct", "heat_sink") and c.ends[0] != c.ends[1] and np.any(course.flows.get(c.path, 0.0))
    }


def class_of(c: FlatConductor, network: Network) -> str:
    """Return the class of a conductor."""
    if c.path in constant_coefficients(network):
        return SURFACE
    if isinstance(c.recipe, JointLaw):  # a constant conductance whose trend is looked for
        return JOINT
    return JOINT if all(law.form == "linear" for law in laws_of(network, c)) else LAW


def places(course: ElementCourse, c: FlatConductor, at: OperatingPoint) -> Array:
    """Return where an element is along a run (times, 2): ln of its difference over that where it was found, and level less that there."""
    a, b = (course.kelvin[end] for end in c.ends)
    apart = np.maximum(np.abs(a - b), FLOWLESS * at.difference) / at.difference
    return np.column_stack([np.log(apart), 0.5 * (a + b) - at.level])


def hidden_mass(name: str, course: ElementCourse, node: str, time: float) -> DepartureHeat:
    """Return what a mass of the size of a node's own takes up behind it, with a time constant: ``C (T - T_h) / tau``."""
    kelvin, t = course.kelvin[node], course.times
    capacitance = course.stores[node][1]
    behind, steps = np.empty_like(kelvin), np.exp(-np.diff(t) / time)
    behind[0] = kelvin[0]
    for k, decay in enumerate(steps.tolist()):
        behind[k + 1] = decay * behind[k] + (1.0 - decay) * 0.5 * (kelvin[k] + kelvin[k + 1])
    watts = -capacitance * (kelvin - behind) / time
    watts[-1] *= not course.settled
    return DepartureHeat(name, ((node, TableSignal(t, watts, False)),))


def knots_of(course: ElementCourse, time: float) -> Array:
    """Return the instants of hats that hold a process with a time constant: two a time constant, at most `ROOM_KNOTS` a run. [s]"""
    end = float(course.times[-1])
    return np.linspace(0.0, end, int(np.clip(np.ceil(2.0 * end / time), 2, ROOM_KNOTS)) + 1)


def room_heats(network: Network, course: ElementCourse, boundary: str, time: float) -> list[DepartureHeat]:
    """Return what a room puts into nodes that departs as an Ornstein-Uhlenbeck process, per independent normal number. [1 K]"""
    knots = knots_of(course, time)
    root = np.linalg.cholesky(np.exp(-np.abs(knots[:, None] - knots) / time) + 1e-12 * np.eye(knots.size))
    shapes = np.array([np.interp(course.times, knots, column) for column in root.T])
    ends = {c.path: c for c in network.flat.conductors}
    gains: dict[str, Array] = {}
    for path, slope in course.follows[boundary].items():
        first, second = ends[path].ends
        one_way = ends[path].kind in ("flow", "duct", "heat_sink")
        if second not in network.boundaries:
            gains[second] = gains.get(second, 0.0) + slope
        if first not in network.boundaries and not one_way:
            gains[first] = gains.get(first, 0.0) - slope
    name = f"{boundary} wanders"

    def heat(k: int, shape: Array) -> DepartureHeat:
        return DepartureHeat(f"{name} {k}", tuple((n, TableSignal(course.times, g * shape, False)) for n, g in gains.items()))

    return [heat(k, shape) for k, shape in enumerate(shapes)]
