"""Ordinary models with many nodes on the integrator of large networks: when, and how their rows become flat arrays."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.linear_algebra import Array
from thermid.simulation.solver.large import Watched, integrate
from thermid.simulation.solver.large_steady import settle_large
from thermid.simulation.solver.problem import NEAR, Answer, KernelProblem, Options
from thermid.simulation.solver.sparse import NONE, LoadGroup, RowGroup, SparseNetwork, link_arrays
from thermid.simulation.solver.wiring import Assembled, PlacedConductor


def refusal(problem: KernelProblem) -> str:
    """Return why a model cannot be run as a large network; empty when it can."""
    s = problem.wiring.structure
    follows, n = s.coefficient_input, len(problem.nodes)
    for row, a, _, places in s.conductors:
        form, curve, name = row.form, row.curve, row.name
        if form == "flow":
            return f"'{name}' carries heat one way"
        if any(follows[p] >= 0 for p in places[1:]):
            return f"the {'exponent' if form == 'power' else 'pressure'} of '{name}' changes in time"
        if (form == "hinge of difference" or (curve is not None and curve.over == "difference")) and a >= n:
            return f"'{name}' is a table over a difference that begins at a boundary"
    heated = {load.control: load.node for load in s.loads}
    first = {load.places[0] for load in s.loads}
    for k, (control, sensor, places, name) in enumerate(s.controls):
        if control == "thermostat":
            return f"'{name}' is a thermostat"
        if sensor != heated[k]:
            return f"'{name}' follows the temperature of another node"
        if any(follows[p] >= 0 for p in places if p not in first):
            return f"a coefficient of '{name}' changes in time"
    for load in s.loads:
        if any(follows[p] >= 0 for p in load.places[1:]):
            return f"a coefficient of '{load.row.name}' changes in time"
    return ""


def sparse_of(problem: KernelProblem, a: Assembled) -> SparseNetwork:
    """Return a model's numbers as flat arrays."""
    s, c = problem.wiring.structure, a.coefficients
    follows = s.coefficient_input
    stored = a.reduced.stored
    place = _places(problem, a)
    first = [n for n in problem.nodes if n not in stored]
    links, rows = _conductors([p for p in s.conductors if p.row.name not in stored], c, follows, place, len(first))
    loads = []
    for tag, (row, node, places, j) in enumerate(s.loads):
        law = np.zeros((4, 1))
        law[: len(places), 0] = c[places]
        control, settings = "", np.zeros((3, 1))
        if j >= 0:
            control, _, own, _ = s.controls[j]
            settings[: len(own), 0] = [np.nan if p == places[0] else c[p] for p in own]
        at = np.array([place[node]], dtype=np.int32)
        loads.append(LoadGroup(row.form, tag, at, law, follows[places[0]], row.curve, control, settings))
    gains = tuple(follows[g] if g >= 0 else NONE for g in s.gain)
    offsets = np.array([c[k] for k in s.offset], dtype=float)
    capacities, stores = np.zeros(len(first)), {}
    index = {n: k for k, n in enumerate(first)}
    np.add.at(capacities, place, problem.capacities(a))  # that of a node stands with what holds its heat
    for name, store in stored.values():
        stores[index[name]] = store.curve
    return SparseNetwork(
        capacities, links, rows, loads, problem.load_names, problem.wiring.network.boundaries, gains, offsets, tuple(problem.inputs), stores
    )


def _places(problem: KernelProblem, a: Assembled) -> NDArray[np.int32]:
    """Return the place in the large network of every node; that of the heat that a node holds is the node's own."""
    stored = a.reduced.stored
    known = {n: k for k, n in enumerate(n for n in problem.nodes if n not in stored)}
    return np.array([known[stored[n][0] if n in stored else n] for n in problem.nodes], dtype=np.int32)


def _levelled(problem: KernelProblem, a: Assembled, temperatures: Array) -> Array:
    """Return what the small integrator solves for, levels too, from the temperatures of a large network. [K]"""
    found = temperatures[_places(problem, a)]
    for k, name in enumerate(problem.nodes):
        if name in a.reduced.stored:
            found[k] = float(a.reduced.stored[name][1].level(found[k]))
    return found


def _conductors(
    table: Sequence[PlacedConductor], c: Array, follows: Sequence[int], place: NDArray[np.int32], n: int
) -> tuple[Any, list[RowGroup]]:
    """Return the constant links between nodes, and the other conductors in groups."""
    links: list[tuple[int, int, float]] = []
    groups: dict[tuple[Any, ...], list[tuple[int, int, float]]] = {}
    curves = {}
    for row, one, other, places in table:
        form, curve = row.form, row.curve
        a, b = (int(place[k]) if k < place.size else k - place.size + n for k in (one, other))
        if a >= n and b >= n:
            continue  # heat between two given temperatures changes no unknown
        first, second = (b, a) if a >= n else (a, b)
        given = follows[places[0]]
        if form == "linear" and second < n and given < 0:
            links.append((first, second, c[places[0]]))
            continue
        exponent = c[places[1]] if len(places) > 1 else 0.0
        boundary = second - n if second >= n else NONE
        groups.setdefault((form, boundary, given, id(curve), exponent), []).append((first, 0 if boundary >= 0 else second, c[places[0]]))
        curves[id(curve)] = curve
    ends = np.array([link[:2] for link in links], dtype=np.int32).reshape(-1, 2)
    made = link_arrays(ends[:, 0], ends[:, 1], np.array([link[2] for link in links], dtype=float), n)
    rows = []
    for (form, boundary, given, curve_id, exponent), found in groups.items():
        at = np.array([member[:2] for member in found], dtype=np.int32)
        values = np.array([member[2] for member in found], dtype=float)
        rows.append(RowGroup(form, boundary, at[:, 0], at[:, 1], values, float(exponent), given, curves[curve_id]))
    return made, rows


def integrate_model(
    problem: KernelProblem, a: Assembled, times: Array, nodes: Sequence[str], end: float, options: Options, extremes: bool = False
) -> Answer:
    """Return what `Engine.integrate` does, by the integrator of large networks."""
    network = sparse_of(problem, a)
    place, size = _places(problem, a), network.capacities.size
    held = np.array([n in a.reduced.stored for n in problem.nodes], dtype=bool)
    index = {name: int(place[k]) + (size if held[k] else 0) for k, name in enumerate(problem.nodes)}
    watched = [Watched("mean", np.array([index[n]], dtype=np.int32), np.ones(1)) for n in nodes]
    names = [n for n in problem.nodes if n not in a.reduced.stored]
    initial = a.initial[~held]
    initial[place[held]] = a.initial[held]

    def left(time: float, temperatures: Array) -> str:
        return problem.left(a, time, _levelled(problem, a, temperatures), NEAR)

    beyond = left if problem.refuses else None
    found = integrate(network, initial, end, times, watched, np.zeros(0), options, problem.title, names.__getitem__, extremes, beyond)
    slopes = np.zeros((times.size, len(nodes), 0))
    energies = (found.load_energy, found.boundary_energy, np.zeros(0))
    on = np.zeros(len(problem.control_names), dtype=np.int32)
    turnings = dict(zip(nodes, found.turnings, strict=True)) if found.turnings is not None else None
    return Answer(
        found.watched,
        slopes,
        a.initial,
        np.where(held, found.levels[place], found.final[place]),
        *energies,
        end,
        found.statistics,
        on,
        (),
        turnings,
    )


def settle_model(problem: KernelProblem, a: Assembled, time: float) -> Array | None:
    """Return the steady temperatures (nodes,) [K] of a model with many nodes; None where the dense way is to be taken."""
    # powers that never grow with temperature, so that a balance is stable
    steady = all(p.row.form == "signal" for p in problem.wiring.structure.loads)
    if not problem.many or problem.refuses or refusal(problem) or not steady:
        return None
    rest = settle_large(sparse_of(problem, a), time, problem.title)[0]
    return _levelled(problem, a, rest)
