"""What departs of a network, and how: every departure is heat that a unit of it puts into nodes along a run.

A conductance G that is off by a small part d is to first order the same as the heat ``q d`` taken from its first end and put into its
second; so is a power, and a mass behind a node. The kernel's derivatives by the size of such loads are the answer of the network.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any

import numpy as np

from thermid.base.units import STEFAN_BOLTZMANN, Array, value_of
from thermid.fit._error_model.courses import (
    FREE_AIR,
    STREAM,
    ElementCourse,
    OperatingPoint,
    coefficient_path,
    constant_coefficients,
    laws_of,
)
from thermid.fit._error_model.sizes import (
    FINISH,
    FLOWLESS,
    FREE_EXPONENT,
    FREE_EXPONENT_SD,
    GROWTH_BEND,
    LACK_ODDS,
    LARGEST_SHARE,
    LEAST_SHARE,
    LEVEL_POINTS,
    LEVELS,
    NODES,
    OTHER_FINISH,
    PATH_SHARE,
    ROOM_KNOTS,
    ROW_OF_ZONES,
)
from thermid.model.tree import CARRIED_BY, Curve, FlatConductor, FlatLoad, Law, TableSignal, in_run
from thermid.simulation.runs import Network, Scenario

EXPONENT_OF, SHARE_OF, TREND_OF, BEND_OF, CONDUCTANCE_OF = "exponent", "radiation", "trend", "bend", "conductance"
"""What of a law is not known: of a surface, of a joint, and of a path that the deck lacks."""
ANOTHER, WITH_PATHS, WITH_ENTRIES = ", another finish", ", with a path", ", through a part"
"""What is added to the name of a way in which a finish is not the deck's, and of one with what the deck lacks: a path to a boundary, or
parts through which heat enters."""
AS_BUILT = "as built"
"""Name of the way in which no element departs from its law."""
SOLIDS = ("conduction", "contact", "bolted", "wedge_lock")
"""Kinds of conductor whose constant conductance may grow with its level."""
SURFACE, JOINT, LAW = "surface", "joint", "law"
"""Classes of conductors: constant coefficients of surfaces; constant conductances; laws that follow temperatures by themselves."""


@dataclass(frozen=True)
class SurfaceLaw:
    """What stands behind a constant coefficient of a surface: ``(G - s Gf) (d/d0)^n + s Gf (T/T0)^3``, a recipe of two rows of the kernel.

    The finish says how much is radiated, and so the share is one of the conductance that was fitted, whatever G becomes.

    Parameters
    ----------
    at : OperatingPoint     d0 and T0, where G is the value.
    exponent : float        n, of free air; zero behind a fan. [-]
    share : float           s, of radiation. [-]
    fitted : float          Gf, as the fit's own structure has it. [W/K]
    linear : callable       Recipe of the constant coefficient.
    """

    at: OperatingPoint
    exponent: float
    share: float
    fitted: float
    linear: Any

    def __call__(self, fields: Mapping[str, Any]) -> tuple[Law, ...]:
        """Return the laws at values of its fields."""
        whole = self.linear(fields).coefficients[0]
        radiated = self.share * self.fitted
        if radiated > LARGEST_SHARE * value_of(whole):
            radiated = LARGEST_SHARE * whole
        convected = (whole - radiated) / self.at.difference**self.exponent
        return Law("power", (convected, self.exponent), "gas"), Law("radiation", (radiated / (4.0 * self.at.level**3),), "radiation")

    def heats(self, course: ElementCourse, c: FlatConductor) -> dict[str, Array]:
        """Return exponent or share -> the heat (times,) that one more of it adds along a run. [W]

        Of the exponent n convection times ln(|dT| / dT_fit), with |dT| at least `FLOWLESS` of dT_fit, the difference of the fit. Of the
        share s of radiation, radiation / s - convection / max(g - s, 1 - `LARGEST_SHARE`), g the coefficient over the fitted one. [-]
        """
        first, second = (course.kelvin[end] for end in c.ends)
        apart = np.maximum(np.abs(first - second), FLOWLESS * self.at.difference) / self.at.difference
        radiated = course.radiated.get(c.path, np.zeros(course.times.size))
        convected = course.flows[c.path] - radiated
        out = {EXPONENT_OF: convected * np.log(apart)}
        if not self.share:
            return out
        whole = float(value_of(self.linear({name: course.values[path] for name, path in c.fields.items()}).coefficients[0])) / self.fitted
        return out | {SHARE_OF: radiated / self.share - convected / max(whole - self.share, 1.0 - LARGEST_SHARE)}

    def moved(self, by: Mapping[str, float]) -> SurfaceLaw:
        """Return the law with `by` added to its exponent and its share of radiation [-], kept to what is possible."""
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
    """A joint or a solid whose conductance grows with its level: ``G f(c (T - T0))``, f(x) = 1 + x where it grows, exp(x) where it falls.

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
        falling = np.exp(np.minimum(x, 0.0))
        return np.where(x < 0.0, falling, 1.0 + x), self.trend * np.where(x < 0.0, falling, 1.0)

    def heats(self, course: ElementCourse, c: FlatConductor) -> dict[str, Array]:
        """Return the heat (times,) that one more of c, and of a bend of ``ln f`` by ``x^2 / 2``, adds along a run. [W K], [W]"""
        apart = np.mean([course.kelvin[end] for end in c.ends], axis=0) - self.at.level
        x = self.trend * apart
        return {
            TREND_OF: course.flows[c.path] * apart / (1.0 + np.maximum(x, 0.0)),
            BEND_OF: course.flows[c.path] * 0.5 * np.minimum(x**2, 1.0),
        }

    def moved(self, by: Mapping[str, float]) -> JointLaw:
        """Return the law with another trend."""
        return replace(self, trend=self.trend + by.get(TREND_OF, 0.0))

    @property
    def shape(self) -> dict[str, float]:
        """What of it is not known, where it is."""
        return {TREND_OF: self.trend}


@dataclass(frozen=True)
class PathLaw:
    """A path from a node to a boundary that the deck lacks.

    Parameters
    ----------
    node : str              Where it begins.
    beside : str            A conductor that ends at the boundary: it says where that is in a larger model.
    end : int               Which of its ends that is.
    conductance : float     [W/K]
    """

    node: str
    beside: str
    end: int
    conductance: float

    def heats(self, course: ElementCourse, c: FlatConductor) -> dict[str, Array]:
        """Return the heat (times,) that one more of its conductance carries along a run. [K]"""
        return {CONDUCTANCE_OF: course.kelvin[c.ends[0]] - course.kelvin[c.ends[1]]}

    def moved(self, by: Mapping[str, float]) -> PathLaw:
        """Return the law with another conductance, kept to what is possible."""
        return replace(self, conductance=max(self.conductance + by.get(CONDUCTANCE_OF, 0.0), FLOWLESS * self.conductance))

    @property
    def shape(self) -> dict[str, float]:
        """What of it is not known, where it is."""
        return {CONDUCTANCE_OF: self.conductance}

    def conductor(self, path: str, network: Network) -> FlatConductor | None:
        """Return it as a conductor of a network; None where an end is missing, or the network has a conductor between its ends."""
        other = next((c.ends[self.end] for c in network.flat.conductors if c.path == self.beside), self.node)
        if self.node not in network.nodes or any({*c.ends} == {self.node, other} for c in network.flat.conductors) or other == self.node:
            return None
        return FlatConductor(path, "conduction", (self.node, other), {}, recipe=lambda _: Law("linear", (self.conductance,)))


ElementLaw = SurfaceLaw | JointLaw | PathLaw


@dataclass(frozen=True)
class Way:
    """What carries the heat of the surfaces of a network, as one possibility of a mixture.

    Parameters
    ----------
    name : str      ``free air``, ``fan`` or another word of a deck.
    laws : dict     Conductor -> its law with the means of its prior.
    sizes : dict    (conductor, what) -> group of sizes, and the multiple of it that is the standard deviation about the mean.
    before : float  Its probability before any reading, beside those of the others. [-]
    spots : tuple   Nodes whose sensors sit where their heat enters, or far from there.
    """

    name: str
    laws: Mapping[str, ElementLaw] = field(default_factory=dict)
    sizes: Mapping[tuple[str, str], tuple[str, float]] = field(default_factory=dict)
    before: float = 1.0
    spots: tuple[str, ...] = ()


def ways_of(
    network: Network, at: Mapping[str, OperatingPoint], values: Mapping[str, Any], paths: Mapping[str, tuple[PathLaw, float]]
) -> tuple[Way, ...]:
    """Return what may carry the heat of a network's surfaces: one way where the deck says it, free air and a stream where it does not.

    Finishes that the deck states, and nobody measured, may be others: then any emissivity is as likely, in a way of their own. Each is
    there as it is, with a path to a boundary that the deck lacks, and with parts that it lacks through which heat enters. The last is that
    no element departs from its law.

    Parameters
    ----------
    at : dict       Conductor -> where it was found.
    values : dict   Parameter -> its value there. [SI]
    paths : dict    Path that the deck lacks -> its law with the mean of its prior, and the standard deviation. [W/K]
    """
    surfaces = {p: c for p, c in constant_coefficients(network).items() if p in at and c.kind in ("effective", "convection")}
    joints = {c.path: c for c in network.flat.conductors if c.path in at and c.kind in SOLIDS and len(laws_of(network, c)) == 1}
    joints = {p: c for p, c in joints.items() if laws_of(network, c)[0].form == "linear"}
    unsaid = [p for p, c in surfaces.items() if CARRIED_BY not in c.words]
    stated = {p: float(value_of(values[c.emissivity])) for p, c in surfaces.items() if c.kind == "effective" and c.emissivity}
    deck = network.flat.parameters
    ranges = {p: deck.stated_ranges.get(deck.literal_behind(surfaces[p].emissivity)) for p in stated}
    relative = {p: r.log_sd(stated[p]) for p, r in ranges.items() if r is not None}
    loose = [p for p in stated if deck.table[deck.literal_behind(surfaces[p].emissivity)].parameter.source != "measured"]
    finishes = [(stated, "", 1.0 - OTHER_FINISH if loose else 1.0)]
    if loose:
        finishes.append(({p: e for p, e in stated.items() if p not in loose}, ANOTHER, OTHER_FINISH))
    out = []
    for carrier, (emissivities, finish, before) in product((FREE_AIR, STREAM) if unsaid else ("as the deck says",), finishes):
        laws: dict[str, ElementLaw] = {p: JointLaw(at[p], 0.0, linear_recipe(c)) for p, c in joints.items()}
        sizes: dict[tuple[str, str], tuple[str, float]] = {(p, TREND_OF): ("trend", 1.0) for p in joints}
        sizes |= {(p, BEND_OF): ("", GROWTH_BEND) for p in joints}
        for path, c in surfaces.items():
            carried = c.words.get(CARRIED_BY, carrier)
            if carried not in (FREE_AIR, STREAM):
                continue
            free = carried == FREE_AIR
            recipe, coefficient = linear_recipe(c), float(value_of(values[coefficient_path(c)]))
            share, spread = 0.0, 0.0
            if c.kind == "effective":
                share, spread = _radiation(coefficient, at[path], emissivities.get(path), relative.get(path, FINISH))
            fitted = float(value_of(recipe({name: values[p] for name, p in c.fields.items()}).coefficients[0]))
            laws[path] = SurfaceLaw(at[path], FREE_EXPONENT if free else 0.0, share, fitted, recipe)
            sizes |= {(path, EXPONENT_OF): ("", FREE_EXPONENT_SD)} if free else {}
            sizes |= {(path, SHARE_OF): ("", spread)} if spread else {}
        out.append(Way(carrier + finish, laws, sizes, before))
        if network.flat.loads:
            out.append(Way(carrier + finish + WITH_ENTRIES, laws, sizes, before * LACK_ODDS))
        if paths:
            laws = {**laws, **{p: law for p, (law, _) in paths.items()}}
            sizes = {**sizes, **{(p, CONDUCTANCE_OF): ("", sd) for p, (_, sd) in paths.items()}}
            out.append(Way(carrier + finish + WITH_PATHS, laws, sizes, before * LACK_ODDS))
    return (*out, Way(AS_BUILT))


def paths_of(network: Network, courses: Sequence[ElementCourse]) -> dict[str, tuple[PathLaw, float]]:
    """Return the paths from a node to a boundary that a deck lacks, each with mean and standard deviation of its conductance. [W/K]

    There is one of them, any as likely, and the part of the heat through its node that it carries is half-normal about none, with
    `PATH_SHARE`. Of a larger model the `NODES` paths are taken that would carry most.
    """
    conductors = network.flat.conductors
    joined = {frozenset(c.ends) for c in conductors}
    ends = {b: (c.path, k) for c in conductors for k, b in enumerate(c.ends) if b in network.boundaries}
    largest: dict[str, tuple[PathLaw, float]] = {}
    for node, (boundary, beside) in product(network.nodes, ends.items()):
        runs = [r for r in courses if node in r.stores and frozenset((node, boundary)) not in joined]
        heat = sum(float(np.abs(r.flows[c.path]).sum()) for r in runs for c in conductors if node in c.ends and c.path in r.flows)
        if heat:
            difference = sum(float(np.abs(r.kelvin[node] - r.kelvin[boundary]).sum()) for r in runs)
            largest[f"{node}.path to {boundary}"] = PathLaw(node, *beside, PATH_SHARE * heat / max(difference, FLOWLESS)), heat
    laws = {p: law for p, (law, _) in sorted(largest.items(), key=lambda item: -item[1][1])[:NODES]}
    part = 1.0 / max(len(laws), 1)
    mean = part * (2.0 / np.pi) ** 0.5  # of a half-normal number that is there with that probability, over its scale
    return {p: (replace(law, conductance=mean * law.conductance), (part - mean**2) ** 0.5 * law.conductance) for p, law in laws.items()}


def linear_recipe(c: FlatConductor) -> Any:
    """Return the recipe of a conductor, or of its kind."""
    if c.recipe is not None:
        return c.recipe
    plain = replace(c, recipe=None)
    return lambda fields: plain.laws(fields)[0]


def _radiation(coefficient: float, at: OperatingPoint, emissivity: float | None, relative: float) -> tuple[float, float]:
    """Return mean and standard deviation of the share of radiation in a coefficient h [W/(m^2 K)]: 4 e sigma T^3 / h. [-]

    That of a stated emissivity e with its `relative` standard deviation; else any up to the blackest is as likely, width / sqrt(12).
    """
    black = 4.0 * STEFAN_BOLTZMANN * at.level**3 / max(coefficient, 1e-9)
    if emissivity is not None:
        share = min(LARGEST_SHARE, emissivity * black)
        return share, relative * share
    most = min(LARGEST_SHARE, LARGEST_SHARE * black)
    return 0.5 * most, most / 12.0**0.5


def with_laws(network: Network, laws: Mapping[str, ElementLaw]) -> Network:
    """Return a network whose elements follow laws in place of constant values."""
    # the radiation that an effective coefficient holds is a part of its law here
    held = {f"{path}.radiation" for path, law in laws.items() if isinstance(law, SurfaceLaw) and law.share}
    conductors = tuple(
        c
        if (law := laws.get(c.path)) is None or isinstance(law, PathLaw)
        else replace(c, recipe=law, curve=law.curve if isinstance(law, JointLaw) else c.curve)
        for c in network.flat.conductors
        if c.path not in held
    )
    lacking = (law.conductor(path, network) for path, law in laws.items() if isinstance(law, PathLaw))
    conductors += tuple(c for c in lacking if c is not None)
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
    def scale(self) -> str:
        """What frees its size in a network of `with_heats`."""
        return f"scale.{self.name}"


def moved_heat(name: str, network: Network, ends: tuple[str, str], times: Array, watts: Array) -> DepartureHeat:
    """Return heat taken from a first end and put into a second."""
    pairs = zip(ends, (-watts, watts), strict=True)
    return DepartureHeat(name, tuple((n, TableSignal(times, w, False)) for n, w in pairs if n not in network.boundaries))


def with_heats(network: Network, scenario: Scenario, heats: Iterable[DepartureHeat]) -> tuple[Network, Scenario]:
    """Return a network and its scenario with loads whose sizes are free."""
    loads, powers = [], {}
    for h in heats:
        for k, (node, watts) in enumerate(h.into):
            loads.append(FlatLoad(f"{h.name}, {k}, into {node}", node, node, {}, scale=h.name))
            powers[loads[-1].path] = watts
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
    """Return where an element is along a run (times, 2): ln(difference / difference where it was found) [-], level less that there [K].

    A difference below `FLOWLESS` of that where it was found counts as that much.
    """
    a, b = (course.kelvin[end] for end in c.ends)
    apart = np.maximum(np.abs(a - b), FLOWLESS * at.difference) / at.difference
    return np.column_stack([np.log(apart), 0.5 * (a + b) - at.level])


def lagged(x: Array, t: Array, time: float) -> Array:
    """Return a course y (times,) that follows another, `x`, with a time constant [s]: y' = (x - y) / time, y = x at first. [as x]

    Between two of the instants `t` (times,) [s] x counts with the mean of both.
    """
    out, steps = np.empty_like(x), np.exp(-np.diff(t) / time)
    out[0] = x[0]
    for k, decay in enumerate(steps.tolist()):
        out[k + 1] = decay * out[k] + (1.0 - decay) * 0.5 * (x[k] + x[k + 1])
    return out


def entering_heat(network: Network, course: ElementCourse, node: str) -> Array:
    """Return the heat of all loads of a node (times,), with what leaves it at the beginning for the first: a run begins in balance. [W]

    The mean of a second before and a second after each time, so that a jump counts half.
    """
    t, loads = course.times, {load.path for load in network.flat.loads if load.node == node}
    signals = (in_run(power, float(t[-1])) for load, (_, power) in course.powers.items() if load in loads)
    entering: Array = sum((0.5 * (s.at(np.maximum(t - 1.0, 0.0)) + s.at(np.minimum(t + 1.0, t[-1]))) for s in signals), np.zeros(t.size))
    entering[0] = -course.stores[node][0][0]
    return entering


def gradient(name: str, network: Network, course: ElementCourse, node: str) -> DepartureHeat:
    """Return what moves a node to the end of its part where its heat q enters, with the resistance R of all that ends at it inside.

    A row of zones in steady flow: the mean of the part is ``R (a q + (1 - a) out)`` below that end, late by ``b R C``, and what leaves at
    the other end is carried by ``R q`` less; a and b are `ROW_OF_ZONES`. Temperatures of a node that moves so are those of its sensor.
    """
    t, (_, capacitance), entering = course.times, course.stores[node], entering_heat(network, course, node)
    slopes: dict[str, float] = {}
    leaving = np.zeros(t.size)
    for c in conductors_of(network, course).values():
        if node in c.ends:
            other, sign = (c.ends[1], 1.0) if c.ends[0] == node else (c.ends[0], -1.0)
            apart, flow = course.kelvin[node] - course.kelvin[other], sign * course.flows[c.path]
            leaving += flow
            slopes[other] = slopes.get(other, 0.0) + float(flow @ apart / max(float(apart @ apart), FLOWLESS))
    whole, (share, lag) = max(sum(slopes.values()), FLOWLESS), ROW_OF_ZONES
    above, below = (lagged(x / whole, t, lag * capacitance / whole) for x in (entering, share * entering + (1.0 - share) * leaving))
    into = {node: whole * above + capacitance * np.gradient(below, t)} | {n: -g * above for n, g in slopes.items()}
    return DepartureHeat(name, tuple((n, TableSignal(t, w, False)) for n, w in into.items() if n not in network.boundaries))


def room_heats(network: Network, course: ElementCourse, boundary: str, time: float, begun: bool = False) -> list[DepartureHeat]:
    """Return what a room puts into nodes that departs as an Ornstein-Uhlenbeck process, per independent normal number. [1 K]

    Its correlation is exp(-|dt| / time), with `time` [s], at two knots each time constant, `ROOM_KNOTS` at most, straight between; numbers
    are those of the rows of its Cholesky root. A node gets that course [K] times the heat per kelvin of the boundary through its
    conductors. [W/K] With `begun` the first of them lacks what the room is off by at the beginning, for as long as the run lasts.
    """
    # instants of hats that hold a process with a time constant: two a time constant, at most `ROOM_KNOTS` a run. [s]
    end = float(course.times[-1])
    knots = np.linspace(0.0, end, int(np.clip(np.ceil(2.0 * end / time), 2, ROOM_KNOTS)) + 1)
    root = np.linalg.cholesky(np.exp(-np.abs(knots[:, None] - knots) / time) + 1e-12 * np.eye(knots.size))
    shapes = np.array([np.interp(course.times, knots, column) for column in root.T])
    shapes[0] -= begun  # the others begin at zero
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
        """Return the k-th departure: a course of heat of one shape (times,) into every node of the gains. [W]"""
        return DepartureHeat(f"{name} {k}", tuple((n, TableSignal(course.times, g * shape, False)) for n, g in gains.items()))

    return [heat(k, shape) for k, shape in enumerate(shapes)]
