"""Transients of large networks: the kernel's stabilised explicit or implicit steps, and what is stored of them.

Then ordinary models with many nodes: when they are run as large networks, and how their rows become flat arrays.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Final, TypeAlias

import numpy as np

from thermid import _kernel
from thermid.base.errors import SolverError
from thermid.base.linear_algebra import Array, Ints
from thermid.simulation._network.rows import same_both_ways
from thermid.simulation._solver.extremes import Turnings
from thermid.simulation._solver.large_steady import settle_large
from thermid.simulation._solver.problem import (
    MARGIN_TO_TABLE_END,
    MAY_HAVE_LEFT,
    UNSOLVED,
    Answer,
    KernelProblem,
    Options,
    by_column,
    limits,
    runs_away,
    unsolved,
)
from thermid.simulation._solver.sparse import NONE, LoadGroup, RowGroup, SparseNetwork, link_arrays
from thermid.simulation._solver.wiring import Assembled, PlacedConductor

METHODS: Final[Mapping[str, int]] = {
    "auto": _kernel.LARGE_AUTO,
    "large": _kernel.LARGE_AUTO,
    "RKC2": _kernel.LARGE_RKC2,
    "TR-BDF2": _kernel.LARGE_TRBDF2,
}
"""Methods of large networks by the name that `Options.method` gives them."""
NAMES: Final = {_kernel.LARGE_AUTO: "", _kernel.LARGE_RKC2: "RKC2", _kernel.LARGE_TRBDF2: "TR-BDF2 + CG"}
KINDS: Final = {"mean": 0, "highest": 1, "lowest": 2}
Gone: TypeAlias = tuple[tuple[str, ...], tuple[Ints, Ints, Array] | None]
"""Eliminated nodes, and each as a sum of temperatures of nodes and boundaries, in the kernel's form: begins, places, weights."""


@dataclass(frozen=True, eq=False)
class Watched:
    """One thing that is stored at every output time.

    Parameters
    ----------
    kind : str                  mean, highest or lowest.
    nodes : array (nodes,)      Over which nodes; empty for all. Beyond their number: the level of one that stores heat by a table; beyond
                                twice their number: a boundary.
    weights : array (nodes,)    Of a mean; equal ones where empty. [-]
    """

    kind: str
    nodes: Ints
    weights: Array


@dataclass(frozen=True, eq=False)
class LargeAnswer:
    """What the kernel answered for a large network.

    Parameters
    ----------
    watched : array (times, watched)        [K]
    fields : array (field times, nodes)     [K]
    initial, final : array (nodes,)         [K]
    levels : array (nodes,)                 At the end; temperatures where a node's specific heat is constant. [K]
    load_energy, boundary_energy            Per load and boundary. [J]
    statistics : dict
    turnings : tuple or None                Of each watched, turning points between the times; None where not followed.
    """

    watched: Array
    fields: Array
    initial: Array
    final: Array
    levels: Array
    load_energy: Array
    boundary_energy: Array
    statistics: Mapping[str, Any]
    turnings: tuple[Turnings, ...] | None = None


def integrate(
    network: SparseNetwork,
    initial: Array,
    end: float,
    times: Array,
    watched: Sequence[Watched],
    field_times: Array,
    options: Options,
    where: str,
    name: Any,
    extremes: bool = False,
    outside: Callable[[float, Array], str] | None = None,
) -> LargeAnswer:
    """Return temperatures of a large network from zero to `end` [s]; with `extremes` turning points of what is watched too.

    Parameters
    ----------
    initial : array (nodes,)    Massless nodes are solved for; levels of nodes that store heat by a table. [K]
    where : str                 Title of the model and the scenario, for messages.
    name : callable             Place of a node -> its name, for messages.
    outside : callable          Time [s] and temperatures (nodes,) [K] -> which tables end there, empty where none does; None where none
                                is refused outside its points.

    Raises
    ------
    SolverError   When the run ends before its time.
    """
    sizes = [w.nodes.size for w in watched]
    weights = [w.weights if w.weights.size == w.nodes.size else np.full(w.nodes.size, 1.0 / max(w.nodes.size, 1)) for w in watched]
    raw = network.problem.integrate(
        np.ascontiguousarray(initial),
        0.0,
        float(end),
        np.ascontiguousarray(times, dtype=float),
        np.array([KINDS[w.kind] for w in watched], dtype=np.int32),
        np.concatenate(([0], np.cumsum(sizes))).astype(np.int32),
        np.concatenate([np.zeros(0, dtype=np.int32), *(w.nodes for w in watched)]),
        np.concatenate([np.zeros(0), *weights]),
        np.ascontiguousarray(field_times, dtype=float),
        method=METHODS[options.method],
        tolerance=options.of_large_step,
        turnings=extremes,
        **limits(options, network.inputs, end),
    )
    if raw.status != _kernel.OK:
        message = _message(raw, options, end, name, any(not g.fixed for g in network.loads))
        if outside is not None and raw.status in UNSOLVED:
            beyond = outside(raw.time, raw.final_temperatures)
            message = f"at {raw.time:.6g} s of {end:.6g} s {beyond}" if beyond else message + MAY_HAVE_LEFT
        raise SolverError(message, where)
    statistics = {
        "method": NAMES[raw.method],
        "reason": "",
        "steps": raw.steps,
        "rejected": raw.rejected,
        "evaluations": raw.evaluations,
        "iterations": raw.iterations,
        "longest_step": raw.longest,
        "largest_rate": raw.rate,
        "switchings": [],
    }
    energies = (raw.load_energy, raw.boundary_energy)
    turnings = by_column(raw.turnings, len(watched)) if extremes else None
    return LargeAnswer(raw.traces, raw.fields, initial, raw.final_temperatures, raw.final_states, *energies, statistics, turnings)


def _message(raw: Any, options: Options, end: float, name: Any, follows: bool) -> str:
    """Return what ran out, when, where and what to change; `follows` as in `runs_away`."""
    node = f" at '{name(raw.node)}'" if raw.node >= 0 else ""
    when = f"at {raw.time:.6g} s of {end:.6g} s{node}"
    instead = " RKC2 needs short steps if one node is fast. Leave the method out." if options.method == "RKC2" else ""
    words = {
        _kernel.MAX_STEPS: f"{options.max_steps} steps were not enough, {when}. Allow more max_steps, or a larger error." + instead,
        _kernel.STEP_UNDERFLOW: f"the step became too small {when}. Look for a discontinuous law there, or allow a larger error.",
        _kernel.NON_FINITE: unsolved(when, follows),
        _kernel.RUN_AWAY: runs_away(when, follows),
        _kernel.SINGULAR_NODE: f"a massless node has no conductance to anything {when}, so its temperature is undefined. RKC2 does "
        "not support massless nodes; TR-BDF2 does.",
        _kernel.BAD_INPUT: f"a temperature left the range 0 K to 1e6 K {when}. Check the inputs at that time.",
    }
    return words.get(raw.status, f"the run stopped {when}.")


def refusal(problem: KernelProblem) -> str:
    """Return why a model cannot be run as a large network; empty when it can."""
    s = problem.wiring.structure
    follows, n = s.coefficient_input, len(problem.nodes)
    if s.factors:
        return f"the control '{s.factors[0].row.name}' follows a temperature"
    for row, a, _, places in s.conductors:
        form, curve, name = row.form, row.curve, row.name
        if form == "flow":
            return f"'{name}' carries heat one way"
        if any(follows[p] >= 0 for p in places[1:]):
            return f"the {'exponent' if form == 'power' else 'pressure'} of '{name}' changes in time"
        if (form == "hinge of difference" or (curve is not None and curve.over == "difference")) and a >= n:
            return f"'{name}' is a table over a difference that begins at a boundary"
        if a >= n and curve is None and not same_both_ways(form):
            return f"'{name}' depends on its direction ({form}) and begins at a boundary"
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
    for tag, (row, node, places, j, _) in enumerate(s.loads):
        law = np.zeros((4, 1))
        law[: len(places), 0] = c[places]
        control, settings = "", np.zeros((3, 1))
        if j >= 0:
            control, _, steps, _ = s.controls[j]
            settings[: len(steps), 0] = [np.nan if p == places[0] else c[p] for p in steps]
        target = np.array([place[node]], dtype=np.int32)
        loads.append(LoadGroup(row.form, tag, target, law, follows[places[0]], row.curve, control, settings))
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


def _places(problem: KernelProblem, a: Assembled) -> Ints:
    """Return the place in the large network of every node; that of the heat that a node holds is the node's own."""
    stored = a.reduced.stored
    rows = {n: k for k, n in enumerate(n for n in problem.nodes if n not in stored)}
    return np.array([rows[stored[n][0] if n in stored else n] for n in problem.nodes], dtype=np.int32)


def _levelled(problem: KernelProblem, a: Assembled, temperatures: Array) -> Array:
    """Return what the small integrator solves for, levels too, from the temperatures of a large network. [K]"""
    levels = temperatures[_places(problem, a)]
    for k, name in enumerate(problem.nodes):
        if name in a.reduced.stored:
            levels[k] = float(a.reduced.stored[name][1].level(levels[k]))
    return levels


def _conductors(table: Sequence[PlacedConductor], c: Array, follows: Sequence[int], place: Ints, n: int) -> tuple[Any, list[RowGroup]]:
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
        follower = follows[places[0]]
        if form == "linear" and second < n and follower < 0:
            links.append((first, second, c[places[0]]))
            continue
        exponent = c[places[1]] if len(places) > 1 else 0.0
        boundary = second - n if second >= n else NONE
        groups.setdefault((form, boundary, follower, id(curve), exponent), []).append((first, 0 if boundary >= 0 else second, c[places[0]]))
        curves[id(curve)] = curve
    ends = np.array([link[:2] for link in links], dtype=np.int32).reshape(-1, 2)
    arrays = link_arrays(ends[:, 0], ends[:, 1], np.array([link[2] for link in links], dtype=float), n)
    rows = []
    for (form, boundary, follower, curve_id, exponent), members in groups.items():
        pairs = np.array([member[:2] for member in members], dtype=np.int32)
        values = np.array([member[2] for member in members], dtype=float)
        rows.append(RowGroup(form, boundary, pairs[:, 0], pairs[:, 1], values, float(exponent), follower, curves[curve_id]))
    return arrays, rows


def integrate_model(
    problem: KernelProblem, a: Assembled, times: Array, nodes: Sequence[str], end: float, options: Options, gone: Gone | None = None
) -> Answer:
    """Return what `Engine.integrate` does, by the integrator of large networks; turning points where eliminated nodes are given."""
    network = sparse_of(problem, a)
    place, size = _places(problem, a), network.capacities.size
    held = np.array([n in a.reduced.stored for n in problem.nodes], dtype=bool)
    index = {name: int(place[k]) + (size if held[k] else 0) for k, name in enumerate(problem.nodes)}
    watched = [Watched("mean", np.array([index[n]], dtype=np.int32), np.ones(1)) for n in nodes]
    names = [n for n in problem.nodes if n not in a.reduced.stored]
    lost, sums = gone or ((), None)
    if sums is not None:
        begin, parts, weights = sums
        node = parts < place.size
        parts = np.where(node, place[np.where(node, parts, 0)], parts - place.size + size + size).astype(np.int32)
        watched += [Watched("mean", parts[i:j], weights[i:j]) for i, j in pairwise(begin.tolist())]
    initial = a.initial[~held]
    initial[place[held]] = a.initial[held]

    def tables_left(time: float, temperatures: Array) -> str:
        return problem.tables_left(a, time, _levelled(problem, a, temperatures), MARGIN_TO_TABLE_END)

    beyond = tables_left if problem.refuses else None
    raw = integrate(network, initial, end, times, watched, np.zeros(0), options, problem.title, names.__getitem__, gone is not None, beyond)
    slopes = np.zeros((times.size, len(nodes), 0))
    energies = (raw.load_energy, raw.boundary_energy, np.zeros(0))
    on = np.zeros(len(problem.control_names), dtype=np.int32)
    turnings = dict(zip((*nodes, *lost), raw.turnings, strict=True)) if raw.turnings is not None else None
    return Answer(
        raw.watched[:, : len(nodes)],
        slopes,
        a.initial,
        np.where(held, raw.levels[place], raw.final[place]),
        *energies,
        end,
        raw.statistics,
        on,
        (),
        turnings,
    )


def settle_model(problem: KernelProblem, a: Assembled, time: float) -> Array | None:
    """Return the steady temperatures (nodes,) [K] of a model with many nodes; None where the dense way is to be taken."""
    # powers that never grow with temperature, so that a balance is stable
    steady = all(p.row.form == "signal" for p in problem.wiring.structure.loads)
    if not problem.is_large or problem.refuses or refusal(problem) or not steady:
        return None
    rest = settle_large(sparse_of(problem, a), time, problem.title)[0]
    return _levelled(problem, a, rest)
