"""Coefficients that a model holds constant and nature does not: what each would do if it followed difference or level of temperature.

A conductance G that grows by a small part c of a pattern, ``G (1 + c p(t))``, is to first order the same as the heat ``c q(t) p(t)`` put
into the second end and taken from the first. So every pattern is a pair of heat loads of zero size, and the kernel's derivatives with
respect to their size are the answer of the whole network to it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.dual import value_of
from thermid.model.laws.signal import Table
from thermid.model.tree.flat import FlatConductor, FlatLoad
from thermid.network.network import Network
from thermid.physics.constants import STEFAN_BOLTZMANN
from thermid.simulation.scenarios.scenario import Scenario
from thermid.simulation.solver.engine import Engine, Options
from thermid.simulation.solver.traces import Traces
from thermid.simulation.solver.wiring import Wiring

Array = NDArray[np.float64]
POINTS = 301
SMALL = 1e-3
"""Part of the reference difference below which a coefficient's growth with the difference no longer matters: no heat flows."""
EXPONENT = 1.0 / 3.0
"""Of natural convection with the difference of temperature: 1/4 laminar to 1/3 turbulent (Churchill and Chu 1975); 0 where air is blown."""
BLACKEST = 0.95
FINISH = 0.15
"""What an emissivity of a deck is good to, relative. [-]"""


@dataclass(frozen=True)
class Conditions:
    """Where a coefficient was found.

    Parameters
    ----------
    difference : float      Of temperature between its ends, geometric mean weighted by the heat that flows. [K]
    level : float           Mean temperature of its ends, weighted likewise. [K]
    """

    difference: float
    level: float

    def __str__(self) -> str:
        """Return them in words."""
        return f"{self.difference:.2g} K at {self.level - 273.15:.0f} degC"


@dataclass(frozen=True)
class Pattern:
    """One way in which a coefficient may differ from a constant.

    Parameters
    ----------
    path : str      Of the conductor.
    kind : str      'difference' (grows with a power of the difference of temperature) or 'level' (part of it is radiation).
    mean, sd : float    Of the exponent, or of the radiative share, over what is possible. [-]
    ends : (str, str)
    watts : Table   What a unit of it adds to the heat from the first end to the second. [W]
    """

    path: str
    kind: str
    mean: float
    sd: float
    ends: tuple[str, str]
    watts: Table

    def names(self, boundaries: Sequence[str]) -> list[str]:
        """Return the loads that stand for it, one per end that is no boundary."""
        ends = zip(("from", "to"), self.ends, strict=True)
        return [f"pattern {self.kind} {which} {self.path}" for which, n in ends if n not in boundaries]


def constant_coefficients(network: Network) -> dict[str, FlatConductor]:
    """Return path -> conductor, of those whose constant coefficient stands for convection, or convection and radiation."""
    return {c.path: c for c in network.flat.conductors if c.kind == "effective" or (c.kind == "convection" and "htc" in c.fields)}


def coefficient_path(c: FlatConductor) -> str:
    """Return the path of a conductor's coefficient."""
    return c.fields["effective_htc" if c.kind == "effective" else "htc"]


@dataclass(frozen=True, eq=False)
class Course:
    """The course of a conductor over time: differences and levels of its ends [K], and its heat flow [W]."""

    first: Array
    second: Array
    heat: Array

    @property
    def difference(self) -> Array:
        """Difference of temperature (times,), without sign. [K]"""
        return np.abs(self.first - self.second)

    @property
    def level(self) -> Array:
        """Mean temperature (times,). [K]"""
        return 0.5 * (self.first + self.second)


def courses(wiring: Wiring, engine: Engine, x: Array | None, options: Options) -> tuple[Array, dict[str, Course]]:
    """Return times [s], and path -> course of every constant coefficient that acts in a run at some values of its free names."""
    end = wiring.scenario.seconds
    times = np.linspace(0.0, end, POINTS)
    a = engine.started(wiring.assemble(x, False))
    answer = engine.integrate(a, times, a.reduced.nodes, end, options)
    traces = Traces(wiring, a, times, a.reduced.nodes, answer.temperatures, answer.sensitivities)
    known = {n: traces.temperature(n) for n in (*wiring.network.nodes, *wiring.network.boundaries)}
    flows = wiring.conductor_flows(a.numbers, known, times)
    forms: dict[str, list[str]] = {}
    for row in a.numbers.conductors:
        forms.setdefault(row.name, []).append(row.form if value_of(row.coefficients[0]) else "")
    wanted = constant_coefficients(wiring.network)
    return times, {
        p: Course(known[c.ends[0]], known[c.ends[1]], flows[p])
        for p, c in wanted.items()
        if forms.get(p) == ["linear"] and c.ends[0] != c.ends[1]
    }


def ending_settled(course: Course, first: float, second: float) -> Course:
    """Return a course that ends where it would settle, at temperatures of its ends [K]."""
    before = course.first[-1] - course.second[-1]
    heat = course.heat[-1] * (first - second) / before if abs(before) > 1e-12 else 0.0
    return Course(*(np.append(x[:-1], y) for x, y in zip((course.first, course.second, course.heat), (first, second, heat), strict=True)))


def conditions_of(found: Sequence[Mapping[str, Course]]) -> dict[str, Conditions]:
    """Return path -> the conditions over several runs, weighted by the heat that flows."""
    out = {}
    for path in dict.fromkeys(p for run in found for p in run):
        parts = [run[path] for run in found if path in run]
        heat, difference, level = (np.concatenate(x) for x in zip(*((np.abs(c.heat), c.difference, c.level) for c in parts), strict=True))
        if heat.sum() > 0:
            seen = heat > 0
            mean = float(np.exp(heat[seen] @ np.log(np.maximum(difference[seen], 1e-9)) / heat[seen].sum()))
            out[path] = Conditions(mean, float(heat @ level / heat.sum()))
    return out


def patterns_of(
    network: Network, times: Array, found: Mapping[str, Course], reference: Mapping[str, Conditions], values: Mapping[str, Any]
) -> list[Pattern]:
    """Return the patterns of every constant coefficient in a run, about the conditions where each was found; values of parameters in SI."""
    radiating = {c.path.removesuffix(".radiation") for c in network.flat.conductors if c.kind == "radiation"}
    out = []
    for path, c in constant_coefficients(network).items():
        if path not in found or path not in reference:
            continue
        course, at = found[path], reference[path]
        share, spread = (0.0, 0.0) if path in radiating else _radiative(c, value_of(values[coefficient_path(c)]), at, values)
        grown = np.log(np.maximum(course.difference, SMALL * at.difference) / at.difference)
        # of a coefficient that is part radiation only the rest grows with the difference
        rest, square = 1.0 - share, (1.0 - share) ** 2 + spread**2
        sd = float(np.sqrt(EXPONENT**2 * square / 3.0 - (EXPONENT * rest / 2.0) ** 2))
        out.append(Pattern(path, "difference", EXPONENT * rest / 2.0, sd, c.ends, Table(times, course.heat * grown, False)))
        if share > 0.0:
            warmer = (course.first**2 + course.second**2) * (course.first + course.second) / (4.0 * at.level**3) - 1.0
            out.append(Pattern(path, "level", share, spread, c.ends, Table(times, course.heat * warmer, False)))
    return out


def _radiative(c: FlatConductor, coefficient: float, at: Conditions, values: Mapping[str, Any]) -> tuple[float, float]:
    """Return mean and standard deviation of the part of a coefficient that is radiation: any emissivity, or the one that the deck gives."""
    black = 4.0 * STEFAN_BOLTZMANN * at.level**3 / max(coefficient, 1e-9)
    if c.emissivity:
        known = min(1.0, value_of(values[c.emissivity]) * black)
        return known, FINISH * known
    most = min(1.0, BLACKEST * black)
    return 0.5 * most, most / float(np.sqrt(12.0))


def with_patterns(network: Network, scenario: Scenario, patterns: Sequence[Pattern]) -> tuple[Network, Scenario]:
    """Return a network and its scenario with a pair of loads for every pattern; ``scale.<load>`` frees their size."""
    loads, powers = [], {}
    for p in patterns:
        for name in p.names(network.boundaries):
            away = " from " in name
            node = p.ends[0] if away else p.ends[1]
            loads.append(FlatLoad(name, node, node, {}))
            powers[name] = replace(p.watts, values=-p.watts.values) if away else p.watts
    flat = replace(network.flat, loads=(*network.flat.loads, *loads))
    return replace(network, flat=flat), scenario.with_(loads=powers)
