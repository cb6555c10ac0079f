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
from thermid.base.units import Array, Ints
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
    ending,
    ints,
    limits,
)
from thermid.simulation._solver.sparse import NONE, LoadGroup, RowGroup, SparseNetwork, link_arrays
from thermid.simulation._solver.wiring import Assembled

METHODS: Final[Mapping[str, int]] = {
    "auto": _kernel.LARGE_AUTO,
    "large": _kernel.LARGE_AUTO,
    "RKC2": _kernel.LARGE_RKC2,
    "TR-BDF2": _kernel.LARGE_TRBDF2,
}
"""Methods of large networks by the name that `Options.method` gives them."""
NAMES: Final = {_kernel.LARGE_AUTO: "", _kernel.LARGE_RKC2: "RKC2", _kernel.LARGE_TRBDF2: "TR-BDF2 + CG"}
KINDS: Final = {"mean": 0, "highest": 1, "lowest": 2}
COUNTED_AT: Final = 3e-3
"""Error at which steps were counted. [K]"""
RATES_APART: Final = 14.0
"""Ratio of the largest rate to the mean one beyond which the kernel takes TR-BDF2. [-]"""
USUAL_CHANGE: Final = 60.0
"""Temperatures further apart at the start, boundaries included, ask for shorter steps of second order. [K]"""
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
    outside : callable          Time [s], temperatures (nodes,) [K] -> which tables end there; None where all may go beyond their points.

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
        tolerance=options.of_large_step * _part_of_step(network, initial),
        turnings=extremes,
        **limits(options, network.inputs, end),
    )
    if raw.status != _kernel.OK:
        raise SolverError(_message(raw, options, end, name, network, outside), where, code="run.did-not-finish")
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


def _part_of_step(network: SparseNetwork, initial: Array) -> float:
    """Return the factor min(1, sqrt(60 K / change)) on the error of a step, with the range `change` of initial temperatures. [-]

    Steps of second order are as long as the cube root of ``tolerance / change`` lets them, so the more there is to settle the more of them
    add up within a time constant: the error of a run is ``tolerance**(2/3) change**(1/3)``.
    """
    held = [network.boundary(k, np.zeros(1)) for k in range(len(network.boundaries))]
    change = float(np.ptp(np.concatenate((initial[network.capacities > 0.0], *held))))
    return float(min(1.0, (USUAL_CHANGE / max(change, 1e-300)) ** 0.5))


def _message(
    raw: Any, options: Options, end: float, name: Any, network: SparseNetwork, outside: Callable[[float, Array], str] | None
) -> str:
    """Return why a run of a large network ended early, in words: what ran out, when, where and what to change.

    `raw` is the kernel's answer, `name` gives the name of a node, `outside` is as in `integrate`.
    """
    may_have_left = outside is not None and raw.status in UNSOLVED
    if outside is not None and may_have_left and (beyond := outside(raw.time, raw.final_temperatures)):
        return f"at {raw.time:.6g} s of {end:.6g} s {beyond}"
    hints = {
        _kernel.MAX_STEPS: " RKC2 needs short steps if one node is fast. Leave the method out." if options.method == "RKC2" else "",
        _kernel.SINGULAR_NODE: " RKC2 does not support massless nodes; TR-BDF2 does.",
    }
    status = _kernel.NEWTON_FAILED if raw.status == _kernel.NON_FINITE else raw.status  # what a step that is not solved leaves here
    words = ending(
        status, raw.time, name(raw.node) if raw.node >= 0 else "", options.max_steps, end, any(not g.fixed for g in network.loads)
    )
    return words + hints.get(raw.status, "") + (MAY_HAVE_LEFT if may_have_left else "")


def refusal(problem: KernelProblem) -> str:
    """Return in words why a model cannot be run by the methods of large networks; empty where it can."""
    s = problem.wiring.structure
    follows, n = s.coefficient_input, len(problem.nodes)
    if s.edges:
        return "the instants of jumps are free"
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


@dataclass(frozen=True, eq=False)
class RowsOfLaw:
    """Conductors of one law that end at one boundary, or between nodes, as they are laid out for all values.

    Parameters
    ----------
    law : (str, int, int, Curve or None)        Form, boundary, input and curve, as in `RowGroup`.
    first, second, coefficients : array (rows,) Nodes, and places of what scales the heat flow.
    exponents : array (rows,)                   Places of the second coefficient; empty where the law has none.
    """

    law: tuple[str, int, int, Any]
    first: Ints
    second: Ints
    coefficients: Ints
    exponents: Ints


@dataclass(frozen=True, eq=False)
class LargeLayout:
    """Where the numbers of a model stand in its large network; the same for all values.

    Parameters
    ----------
    size : int                          Nodes of the large network.
    places : array (nodes,)             Of every node of the model; that of the heat that a node holds is the node's own.
    links : array (links, 3)            Nodes of the constant links between nodes, and places of their conductances.
    rows : tuple of RowsOfLaw
    """

    size: int
    places: Ints
    links: Ints
    rows: tuple[RowsOfLaw, ...]


def sparse_of(problem: KernelProblem, a: Assembled) -> SparseNetwork:
    """Return the numbers of a model as a `SparseNetwork`: capacities [J/K], links [W/K], rows by law and exponent, loads, boundaries; SI.

    Nodes that hold no heat stand with the one that holds theirs.
    """
    s, c = problem.wiring.structure, a.coefficients
    follows = s.coefficient_input
    layout = laid_out(problem, a)
    place = layout.places
    links = link_arrays(layout.links[:, 0], layout.links[:, 1], c[layout.links[:, 2]], layout.size)
    rows = []
    for group in layout.rows:
        form, boundary, follower, curve = group.law
        values, exponents = c[group.coefficients], c[group.exponents]
        for exponent in dict.fromkeys(exponents.tolist()) if exponents.size else (0.0,):
            of = exponents == exponent if exponents.size else slice(None)
            rows.append(RowGroup(form, boundary, group.first[of], group.second[of], values[of], exponent, follower, curve))
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
    capacities, stores = np.zeros(layout.size), {}
    np.add.at(capacities, place, problem.capacities(a))  # that of a node stands with what holds its heat
    for name, (_, store) in a.reduced.stored.items():
        stores[int(place[problem.nodes.index(name)])] = store.curve
    return SparseNetwork(
        capacities, links, rows, loads, problem.load_names, problem.wiring.network.boundaries, gains, offsets, tuple(problem.inputs), stores
    )


def laid_out(problem: KernelProblem, a: Assembled) -> LargeLayout:
    """Return where a model's coefficients stand in its large network, as positions, computed once and kept.

    Links between nodes come first, rows of one law together; heat between two given temperatures is left out.
    """
    if (layout := problem.memo.get("layout")) is not None:
        return layout  # type: ignore[no-any-return]
    s, stored = problem.wiring.structure, a.reduced.stored
    follows = s.coefficient_input
    index = {n: k for k, n in enumerate(n for n in problem.nodes if n not in stored)}
    place, n = ints([index[stored[m][0] if m in stored else m] for m in problem.nodes]), len(index)
    links: list[tuple[int, int, int]] = []
    groups: dict[tuple[Any, ...], list[tuple[int, int, int, int]]] = {}
    curves = {}
    for row, one, other, places in s.conductors:
        first, second = (int(place[k]) if k < place.size else k - place.size + n for k in (one, other))
        if row.name in stored or min(first, second) >= n:
            continue  # heat between two given temperatures changes no unknown
        if first >= n:
            first, second = second, first
        form, curve, follower = row.form, row.curve, follows[places[0]]
        if form == "linear" and second < n and follower < 0:
            links.append((first, second, places[0]))
            continue
        law = form, second - n if second >= n else NONE, follower, id(curve)
        curves[id(curve)] = curve
        groups.setdefault((*law, len(places) > 1), []).append((first, min(second, n), places[0], places[:2][-1]))
    rows = []
    for (form, boundary, follower, curve_id, scaled), members in groups.items():
        first, second, coefficients, exponents = ints(members).T
        of = first, np.where(second < n, second, 0).astype(np.int32), coefficients, exponents if scaled else ints([])
        rows.append(RowsOfLaw((form, boundary, follower, curves[curve_id]), *(np.ascontiguousarray(part) for part in of)))
    return problem.memo.setdefault("layout", LargeLayout(n, place, ints(links).reshape(-1, 3), tuple(rows)))  # type: ignore[no-any-return]


def seconds_by_steps(problem: KernelProblem, error: float, projected: bool) -> tuple[float, float]:
    """Return the estimated times of a run by the integrator and as a large network, computed once and kept. [s]

    Fits to times of grids and dense radiation with 27 to 1000 nodes and changes of 10 to 400 K (docs/design/simulation.md).

    Parameters
    ----------
    error : float       [K]
    projected : bool    Whether steps go over points of an input, whose noise then asks for more of second order than of fourth.
    """
    if (seconds := problem.memo.get((error, projected))) is not None:
        return seconds  # type: ignore[no-any-return]
    a = problem.wiring.assemble(gradients=False)
    layout, n, products = laid_out(problem, a), len(problem.nodes), problem.problem.products
    links, rows, tighter = len(layout.links), sum(g.first.size for g in layout.rows), COUNTED_AT / max(error, 1e-9)
    steps = 35.0 * tighter**0.15
    step = 90.0 * (n + len(problem.wiring.structure.conductors)) + products * (0.25 if products >= n**3 / 3.0 else 0.9)  # dense, sparse
    capacity, tied = np.zeros(layout.size), np.zeros(layout.size)
    np.add.at(capacity, layout.places, problem.capacities(a))
    np.add.at(tied, layout.links[:, :2], a.coefficients[layout.links[:, 2]][:, None])
    if not capacity.all() or 2.0 * float((tied / capacity).max(initial=0.0)) * capacity.sum() > RATES_APART * tied.sum():
        sweeps, sweep = max(80.0 * tighter**0.28, 400.0 * projected), 150.0 + 2.7 * links + 3.0 * rows  # gradients of TR-BDF2
    else:
        sweeps, sweep = max(19.0 * tighter**0.24, 100.0 * projected), 150.0 + 2.7 * links + 6.5 * rows  # stages of RKC2
    seconds = 1e-9 * steps * step, 1e-9 * (300e3 + 2500.0 * n + steps * sweeps * sweep)
    return problem.memo.setdefault((error, projected), seconds)  # type: ignore[no-any-return]


def _levelled(problem: KernelProblem, a: Assembled, temperatures: Array) -> Array:
    """Return the states (nodes,) of the small integrator, levels of heat stores among them, from temperatures of a large network. [K]"""
    levels = temperatures[laid_out(problem, a).places]
    for k, name in enumerate(problem.nodes):
        if name in a.reduced.stored:
            levels[k] = float(a.reduced.stored[name][1].level(levels[k]))
    return levels


def integrate_model(
    problem: KernelProblem, a: Assembled, times: Array, nodes: Sequence[str], end: float, options: Options, gone: Gone | None = None
) -> Answer:
    """Return what `Engine.integrate` does to `end` [s], by the integrator of large networks.

    Turning points are followed where `gone` is given: the eliminated nodes as sums, as `Engine._sums` returns them.
    """
    network = sparse_of(problem, a)
    place, size = laid_out(problem, a).places, network.capacities.size
    held = np.array([n in a.reduced.stored for n in problem.nodes], dtype=bool)
    index = dict(zip(problem.nodes, (place + size * held).tolist(), strict=True))
    wanted, whole = ints([index[n] for n in nodes]), np.ones(1)
    watched = [Watched("mean", wanted[k : k + 1], whole) for k in range(wanted.size)]
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
        """Return which table a temperature has left, in words; empty where none."""
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
    """Return the steady temperatures (nodes,) [K] of a model with many nodes; None where the dense solution is to be used.

    It needs powers that never grow with temperature, so that a balance is stable.
    """
    steady = all(p.row.form == "signal" for p in problem.wiring.structure.loads)
    if not problem.is_large or problem.refuses or refusal(problem) or not steady:
        return None
    return _levelled(problem, a, settle_large(sparse_of(problem, a), time, problem.title)[0])
