"""The course of a run as its elements see it, and where each of them was: what departures and constant coefficients stand on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from thermid.base.units import Array, value_of
from thermid.fit._error_model.sizes import DEPARTURE_SAMPLES
from thermid.model.tree import Drawn, FlatConductor, Law, in_run
from thermid.simulation.runs import Engine, Network, Options, Traces, Wiring

FREE_AIR, STREAM = "free air", "fan"
"""What may carry the heat of a surface."""


@dataclass(frozen=True)
class OperatingPoint:
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


def constant_coefficients(network: Network) -> dict[str, FlatConductor]:
    """Return path -> conductor, of those whose constant coefficient stands for convection, or convection and radiation."""
    return {c.path: c for c in network.flat.conductors if c.kind == "effective" or (c.kind == "convection" and "htc" in c.fields)}


def coefficient_path(c: FlatConductor) -> str:
    """Return the path of a conductor's coefficient."""
    return c.fields["effective_htc" if c.kind == "effective" else "htc"]


@dataclass(frozen=True, eq=False)
class ElementCourse:
    """A run as its elements see it.

    Parameters
    ----------
    times : array (times,)      [s]
    kelvin : dict               Node or boundary -> temperature (times,). [K]
    flows : dict                Conductor -> heat from its first end to its second (times,). [W]
    follows : dict              Boundary -> conductor -> what one more kelvin of it adds to that heat (times,). [W/K]
    stores : dict               Node -> heat that it takes up beside its powers (times,), and its capacitance [J/K]. [W]
    powers : dict               Load -> the node, and its power.
    radiated : dict             Conductor -> what of its heat is radiation (times,). [W]
    values : dict               Parameter -> its value. [SI]
    settled : bool              Whether the last of the times stands for where the run settles.
    """

    times: Array
    kelvin: Mapping[str, Array]
    flows: Mapping[str, Array]
    follows: Mapping[str, Mapping[str, Array]]
    stores: Mapping[str, tuple[Array, float]]
    powers: Mapping[str, tuple[str, Any]]
    radiated: Mapping[str, Array]
    values: Mapping[str, Any]
    settled: bool = False


def course_of(wiring: Wiring, engine: Engine, x: Array | None, options: Options, rest: Mapping[str, float] | None = None) -> ElementCourse:
    """Return the course of a run at some values `x` (free,) of its free names, SI; at the deck's where None.

    At `DEPARTURE_SAMPLES` equally spaced times: temperatures and heat flows, what a flow changes by per kelvin of a boundary [W/K] by a
    difference of 1 mK, and d(C T - energy brought)/dt of every node that stores heat, which holds where powers jump. [W]

    Parameters
    ----------
    rest : dict     Node and boundary -> temperature where it settles with the inputs of the end; the course then ends there. [K]
    """
    end = wiring.scenario.seconds
    times = np.linspace(0.0, end, DEPARTURE_SAMPLES)
    a = engine.started(wiring.assemble(x, False))
    answer = engine.integrate(a, times, a.reduced.nodes, end, options)
    traces = Traces(wiring, a, times, a.reduced.nodes, answer.temperatures, answer.sensitivities)
    run = {n: traces.temperature(n) for n in (*wiring.network.nodes, *wiring.network.boundaries)}
    temperatures = run if rest is None else {n: np.append(t, rest[n]) for n, t in run.items()}
    more = np.minimum(np.arange(times.size + (rest is not None)), times.size - 1)  # the last sample once more
    modes = dict(zip(engine.control_names, answer.states(times)[more].T, strict=True))
    every = {**temperatures, **{n: traces.temperature(n)[more] for n in a.reduced.controllers}}
    held = times[more]
    shares = wiring.shares(a.numbers, every.__getitem__, held, modes.__getitem__)
    flows = wiring.conductor_flows(a.numbers, temperatures, held, shares)
    follows = {}
    for b in wiring.network.boundaries:
        beside = wiring.conductor_flows(a.numbers, {**temperatures, b: temperatures[b] + 1e-3}, held, shares)
        follows[b] = {p: (beside[p] - flows[p]) / 1e-3 for p in flows if (beside[p] != flows[p]).any()}
    sizes = {n: float(value_of(c)) for n, c in a.numbers.capacitances.items() if c is not None and n in temperatures}
    free = {} if x is None else dict(zip(wiring.free, x.tolist(), strict=True))
    driven = {*wiring.scenario.loads, *wiring.scenario.gains}
    powers = {
        load.path: (load.node, wiring.power(load.path, a.numbers, free))
        for load in wiring.network.flat.loads
        if load.path in driven or ("power" in load.fields and not load.follows_temperature)
    }
    brought: dict[str, Array] = {}
    for node, power in powers.values():
        brought[node] = brought.get(node, 0.0) + integral(in_run(power, end), times)
    through = {n: np.gradient(c * run[n] - brought.get(n, 0.0), times) for n, c in sizes.items()}
    if rest is not None:
        through = {n: np.append(x, np.gradient(-brought.get(n, np.zeros(times.size)), times)[-1]) for n, x in through.items()}
    stores = {n: (through[n], c) for n, c in sizes.items()}
    shining = replace(a.numbers, conductors=tuple(row for row in a.numbers.conductors if row.form == "radiation"))
    radiated = wiring.conductor_flows(shining, temperatures, held, shares)
    whole = times if rest is None else np.array([*times[:-1], end - BEFORE_REST, end])
    return ElementCourse(whole, temperatures, flows, follows, stores, powers, radiated, a.numbers.values, rest is not None)


def integral(signal: Drawn, times: Array) -> Array:
    """Return the integral of a signal from the first of some times to each of them (times,); a jump counts where it is. [SI s]"""
    knots = np.union1d(times, np.clip(signal.knots(times[0], times[-1]), times[0], times[-1]))
    values = signal.at(knots)
    return np.asarray(np.interp(times, knots, np.append(0.0, np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(knots)))))


BEFORE_REST = 1e-3
"""How long before the end a course that ends where it settles leaves its run: with the inputs of the end it rests. [s]"""


def laws_of(network: Network, c: FlatConductor) -> tuple[Law, ...]:
    """Return the laws of a conductor at the values of its deck."""
    values = network.numbers().values
    return c.laws({name: values[path] for name, path in c.fields.items()})


def point_of(courses: Sequence[ElementCourse], c: FlatConductor) -> OperatingPoint | None:
    """Return where an element was over runs: geometric mean of |T_a - T_b| [K] and mean of (T_a + T_b) / 2 [K]; None without heat.

    Both are weighted by its |heat flow| at every time.
    """
    runs = [r for r in courses if c.path in r.flows]
    if not runs:
        return None
    heat = np.concatenate([np.abs(r.flows[c.path]) for r in runs])
    a, b = (np.concatenate([r.kelvin[end] for r in runs]) for end in c.ends)
    if not heat.sum() > 0.0:
        return None
    apart = np.maximum(np.abs(a - b), 1e-9)
    return OperatingPoint(float(np.exp(heat @ np.log(apart) / heat.sum())), float(heat @ (0.5 * (a + b)) / heat.sum()))
