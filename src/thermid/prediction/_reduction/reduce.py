"""`reduce`: a part with fewer masses, as a deck that stands in its place, and how far it is off.

Nodes that do alike become one. A node that loses its mass follows those that stay as it would in steady state (static condensation: Guyan,
AIAA Journal 3, 1965, 380); capacitances are gathered row by row, so that what is left is again a network of masses and conductors.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from thermid.base.errors import DeckError, ScenarioError
from thermid.base.results import Result
from thermid.base.units import STEFAN_BOLTZMANN, Array, amount, value_of
from thermid.model.tree import KINDS, LOAD_SLOTS, FlatConductor, FlatLoad, Model, model_from_dict
from thermid.simulation.runs import (
    STEADY,
    ConductorRow,
    Network,
    Numbers,
    Scenario,
    Solution,
    Start,
    conductance,
    control_names,
    network_for,
    simulate,
)

COMPARED_SAMPLES = 201
"""Samples of a run by which reductions are compared."""
MIN_LINK_SHARE = 1e-9
"""Conductance beside the largest below which a link that elimination made is rounding. [-]"""
KEPT_FORMS = ("linear", "radiation", "power", "flow")
"""Forms of conductors that a reduced deck can hold as they are."""


@dataclass(frozen=True, eq=False)
class Subnetwork:
    """A part of a network, on its own: its nodes, and the nodes around it that it touches.

    Parameters
    ----------
    nodes, outside : tuple of str   Of the part; beyond it.
    capacitances : array (nodes,)   Zero for a massless node. [J/K]
    rows : tuple of ConductorRow    Its conductors.
    secants : array (rows,)         Of each, heat over difference at the temperatures of a run. [W/K]
    fixed : frozenset               Nodes that one-way flow enters or leaves, which keep their mass.
    shown : frozenset               Nodes that stay as nodes: offered, heated, reference points, and what is asked for.
    points : tuple of int           Positions of the nodes by which reductions are judged.
    shares : dict                   Node with a table of specific heat -> mean, lowest and highest of it in the run, over its reference. [-]
    """

    nodes: tuple[str, ...]
    outside: tuple[str, ...]
    capacitances: Array
    rows: tuple[ConductorRow, ...]
    secants: Array
    fixed: frozenset[str]
    shown: frozenset[str]
    points: tuple[int, ...]
    shares: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)

    def laplacian(self, rows: Sequence[int]) -> Array:
        """Return the conductances (nodes and outside, the same) of some rows, both ways alike. [W/K]"""
        index = {n: k for k, n in enumerate((*self.nodes, *self.outside))}
        out = np.zeros((len(index), len(index)))
        for r in rows:
            a, b = (index[e] for e in self.rows[r].ends)
            if a != b:
                g = self.secants[r]
                out[[a, b], [a, b]] += g
                out[[a, b], [b, a]] -= g
        return out


@dataclass(frozen=True, eq=False)
class Condensed:
    """A part with fewer masses.

    Parameters
    ----------
    masses : dict           Node that keeps a mass -> its capacitance. [J/K]
    massless : tuple        Nodes that stay without one.
    links : dict            Two nodes -> conductance between them. [W/K]
    rows : tuple            Conductors that stay as they are: radiation, natural convection, one-way flow.
    linearised : tuple      Conductors that became a constant conductance.
    inside : dict           Node of the part -> the node that stands for it, among them those that went.
    """

    masses: Mapping[str, float]
    massless: tuple[str, ...]
    links: Mapping[tuple[str, str], float]
    rows: tuple[ConductorRow, ...]
    linearised: tuple[str, ...]
    inside: Mapping[str, str]


def part_of(network: Network, run: Solution, inside: str, shown: frozenset[str], points: Sequence[str]) -> Subnetwork:
    """Return the part of a network whose paths begin with `inside`, with conductances [W/K] and capacitances [J/K] at the mean of a run.

    Parameters
    ----------
    run : Solution              Whose mean temperatures are where conductors are made linear.
    inside : str                Prefix of the paths, with its dot.
    shown : frozenset           Nodes that stay as nodes of their own.
    points : sequence           Nodes whose temperatures judge a reduction.

    Raises
    ------
    DeckError   When controls of the part follow temperatures, a conductor of it changes with its gas or a schedule, a node of it stores
                latent heat, or nothing is outside it.
    """
    numbers = network.numbers()
    nodes = tuple(n for n in network.nodes if n.startswith(inside))
    steered = [c.controls for c in network.flat.conductors if c.controls and c.path.startswith(inside)]
    steered += [load.controls for load in network.flat.loads if load.controls and load.path.startswith(inside)]
    inner_controls = [c for c in network.controls if c.startswith(inside)]
    if steered or inner_controls:
        named = control_names(steered[0])[0] if steered else inner_controls[0]
        raise DeckError(
            f"'{named}' is a control that follows temperatures, which a reduced deck cannot represent. Reduce a part without controls.",
            network.title,
            code="model.element-not-supported",
        )
    rows = tuple(r for r in numbers.conductors if r.name.startswith(inside) and set(r.ends) & set(nodes))
    moving = next((r.name for r in rows if r.signal or r.second), "")
    if moving:
        raise DeckError(
            f"'{moving}' changes with its gas or a schedule. Reduce in a constant state: one pressure, no schedule.",
            network.title,
            code="model.element-not-supported",
        )
    outside = tuple(dict.fromkeys(e for r in rows for e in r.ends if e not in nodes))
    if not outside:
        raise DeckError(
            f"'{inside.rstrip('.') or network.title}' exchanges heat with nothing outside itself. Reduce a part that does, or give it a "
            "path to a boundary.",
            network.title,
            code="model.element-not-supported",
        )
    shares = {n: _relative_specific_heat(network, run, n) for n in nodes if n in network.stores}
    capacitances = np.array([value_of(numbers.capacitances[n] or 0.0) * shares.get(n, (1.0,))[0] for n in nodes])
    fixed = frozenset(e for r in rows if r.form == "flow" for e in r.ends if e in nodes)
    secants = np.array([_secant(r, run) for r in rows])
    judged = tuple(nodes.index(p) for p in points)
    return Subnetwork(nodes, outside, capacitances, rows, secants, fixed, shown | fixed, judged, shares)


def _relative_specific_heat(network: Network, run: Solution, node: str) -> tuple[float, float, float]:
    """Return mean, lowest and highest specific heat of a node with a table, relative to that of its stated capacitance. [-]

    The mean is over temperature, from the lowest to the highest of the run: the heat stored between these over their difference. It
    does not depend on how long the node stays at each.

    Raises
    ------
    DeckError   When the table is one of enthalpy: a mass of constant specific heat melts nothing.
    """
    owner, name = network.flat.names.nodes[node]
    table, heat_store = owner.nodes[name].table, network.stores[node]
    if table is not None and table[0] == "enthalpy":
        raise DeckError(
            f"'{node}' stores heat by a table of enthalpy with latent heat, which a reduced deck cannot represent. Reduce a part "
            "without it: at = ...",
            owner.where(f"nodes.{name}"),
            code="model.element-not-supported",
        )
    course = run[node].kelvin
    low, high = float(course.min()), float(course.max())
    share = heat_store.share(np.linspace(low, high, COMPARED_SAMPLES))
    level = heat_store.level(np.array([low, high]))
    mean = float((level[1] - level[0]) / (high - low)) if high - low > 1e-6 else float(share[0])
    return mean, float(share.min()), float(share.max())


def _secant(row: ConductorRow, run: Solution) -> float:
    """Return the conductance of a row: its own, or the mean over the run weighted by (T_a - T_b)^2. [W/K]"""
    coefficients = [value_of(c) for c in row.coefficients]
    if row.kernel.linear:
        return coefficients[0]
    hot, cold = (run[end].kelvin for end in row.ends)
    weights = (hot - cold) ** 2
    conductances = conductance(row.form, coefficients, row.curve, hot, cold)
    return float(np.average(conductances, weights=weights if weights.any() else None))


@dataclass(frozen=True)
class Partition:
    """Which nodes are one, and which have a mass.

    Parameters
    ----------
    clusters : tuple        Positions of the nodes that are one; together all nodes.
    states : frozenset      Positions of the clusters that keep a mass.
    """

    clusters: tuple[tuple[int, ...], ...]
    states: frozenset[int]

    def dropped(self, k: int) -> Partition:
        """Return it with one mass less."""
        return Partition(self.clusters, self.states - {k})

    def merged(self, a: int, b: int) -> Partition:
        """Return it with two clusters, a before b, made one."""
        clusters = [c for k, c in enumerate(self.clusters) if k != b]
        clusters[a] = (*self.clusters[a], *self.clusters[b])
        return Partition(tuple(clusters), frozenset(k - (k > b) for k in self.states if k != b))


@dataclass(frozen=True, eq=False)
class Drive:
    """What a run did to a part, at equal steps.

    Parameters
    ----------
    step : float                Between samples. [s]
    powers : array (times, nodes)       Heat put in. [W]
    around : array (times, outside)     Temperatures beyond the part. [K]
    start : array (nodes,) or None      Temperatures at the start; None where it starts settled. [K]
    """

    step: float
    powers: Array
    around: Array
    start: Array | None

    @classmethod
    def of_run(cls, part: Subnetwork, network: Network, run: Solution, settled: bool) -> Drive:
        """Return the drive of a run at `COMPARED_SAMPLES` even times: powers [W] into the part, temperatures [K] around it, its start.

        With `settled` there is no start: it begins in balance.
        """
        times = np.linspace(run.times[0], run.times[-1], COMPARED_SAMPLES)
        powers = np.zeros((COMPARED_SAMPLES, len(part.nodes)))
        for load in network.flat.loads:
            if load.node in part.nodes:
                powers[:, part.nodes.index(load.node)] += np.interp(times, run.times, run.load_powers[load.path])
        around = np.column_stack([np.interp(times, run.times, run[n].kelvin) for n in part.outside])
        start = None if settled else np.array([run[n].kelvin[0] for n in part.nodes])
        return cls(float(times[1] - times[0]), powers, around, start)


def chain(part: Subnetwork, keep: frozenset[str], drives: Sequence[Drive]) -> dict[int, Partition]:
    """Return number of masses -> partition: from all masses downward, each time by the step that moves the points least.

    A step makes two masses one or takes the mass of one away. Steps are compared on the linear part alone, driven as in the runs.
    """
    held = {k for k, n in enumerate(part.nodes) if n in keep | part.fixed}
    choice = Partition(tuple((k,) for k in range(len(part.nodes))), frozenset(np.flatnonzero(part.capacitances > 0.0).tolist()))
    exact = [_response(part, choice, d) for d in drives]

    def off(way: Partition) -> float:
        """Return the largest deviation of a partition from the full model over all drives. [K]"""
        return max(float(np.abs(_response(part, way, d) - e).max()) for d, e in zip(drives, exact, strict=True))

    out = {len(choice.states): choice}
    while len(choice.states) > 1:
        bound = {k for k, c in enumerate(choice.clusters) if set(c) & held}
        loose = sorted(choice.states - bound)
        steps = [choice.dropped(k) for k in loose] + [choice.merged(a, b) for a in loose for b in loose if a < b]
        if not steps:
            break
        choice = min(steps, key=off)
        out[len(choice.states)] = choice
    return out


def _projected(part: Subnetwork, choice: Partition) -> tuple[Array, Array, Array, list[int], list[int]]:
    """Return P (nodes, clusters), P'K P of clusters and outside [W/K], P'C of the clusters [J/K], and positions with and without a mass.

    P is 1 where a node belongs to a cluster, K the laplacian of the part, C its capacitances (nodes,).
    """
    nodes, clusters = len(part.nodes), len(choice.clusters)
    contraction = np.zeros((nodes, clusters))
    for k, members in enumerate(choice.clusters):
        contraction[list(members), k] = 1.0
    outside = len(part.outside)
    both = np.block([[contraction, np.zeros((nodes, outside))], [np.zeros((outside, clusters)), np.eye(outside)]])
    whole = both.T @ part.laplacian(range(len(part.rows))) @ both
    states = sorted(choice.states)
    return contraction, whole, contraction.T @ part.capacitances, states, [k for k in range(clusters) if k not in choice.states]


def _response(part: Subnetwork, choice: Partition, drive: Drive) -> Array:
    """Return the temperatures of the points (times, points) [K] of a linear part as the partition lumps it, exact by its modes.

    Powers [W] and temperatures around [K] of `drive` are straight between its samples. It begins at `drive.start` [K], without it in
    balance with the first inputs.
    """
    contraction, whole, capacity, s, m = _projected(part, choice)
    o = list(range(len(choice.clusters), whole.shape[0]))
    inverse = np.linalg.inv(whole[np.ix_(m, m)])
    weights, outer = -inverse @ whole[np.ix_(m, s)], -inverse @ whole[np.ix_(m, o)]
    tight = whole[np.ix_(s, s)] + whole[np.ix_(s, m)] @ weights
    masses = capacity[s] + weights.T @ (capacity[m] * weights.sum(axis=1))
    heat = drive.powers @ contraction
    force = heat[:, s] + heat[:, m] @ weights - drive.around @ (whole[np.ix_(s, o)] + whole[np.ix_(s, m)] @ outer).T
    root = np.sqrt(masses)
    rates, vectors = np.linalg.eigh(tight / root[:, None] / root[None, :])
    rates = np.maximum(rates, 1e-12)
    driven = (force / root) @ vectors
    if drive.start is None:
        begun = driven[0] / rates
    else:
        first = contraction.T @ (part.capacitances * drive.start)
        begun = vectors.T @ (root * np.array([first[k] / capacity[k] for k in s]))
    states = _modal_response(rates * drive.step, driven * drive.step, begun) @ vectors.T / root
    clusters = np.empty((len(states), len(choice.clusters)))
    clusters[:, s], clusters[:, m] = states, states @ weights.T + heat[:, m] @ inverse.T + drive.around @ outer.T
    return np.asarray((clusters @ contraction.T)[:, list(part.points)])


def _modal_response(z: Array, force: Array, begun: Array) -> Array:
    """Return x (times, modes) of dx/dt = f - z x at unit steps, x(0) = `begun` (modes,), f = `force` (times, modes) straight between.

    z (modes,) is rate times step [-], f force times step; x has the unit of f. Below z = 1e-5 the weight of the late force is its series.
    """
    decay = np.exp(-z)
    whole = -np.expm1(-z) / z
    late = np.where(z > 1e-5, (1.0 - whole) / z, 0.5 - z / 6.0)
    push = (whole - late) * force[:-1] + late * force[1:]
    out = np.empty((len(force), z.size))
    out[0] = begun
    for k, p in enumerate(push):
        out[k + 1] = decay * out[k] + p
    return out


def condensed(part: Subnetwork, choice: Partition) -> Condensed:
    """Return a part with one node per cluster and its other nodes eliminated: conductances [W/K] and capacitances [J/K] of what stays.

    Laws of `KEPT_FORMS` between nodes that stay are kept; the rest is straight at its secants [W/K], and nodes between are eliminated by
    the Schur complement. Links below `MIN_LINK_SHARE` of the largest are left out.
    """
    first = {m: c[0] for c in choice.clusters for m in c}
    spoken = {k: part.nodes[c[0]] for k, c in enumerate(choice.clusters)}
    shown = {k for k, c in enumerate(choice.clusters) if k in choice.states or any(part.nodes[m] in part.shown for m in c)}
    inside = {n: part.nodes[first[k]] for k, n in enumerate(part.nodes)}
    stay = {spoken[k] for k in shown} | set(part.outside)
    rows = [(r, tuple(inside.get(e, e) for e in row.ends)) for r, row in enumerate(part.rows)]
    lawful = [(r, ends) for r, ends in rows if part.rows[r].form in KEPT_FORMS[1:] and set(ends) <= stay and ends[0] != ends[1]]
    rest = [r for r, _ in rows if r not in {x for x, _ in lawful}]
    names = [*spoken.values(), *part.outside]
    index = {n: k for k, n in enumerate(names)}
    mesh = np.zeros((len(names), len(names)))
    for r in rest:
        a, b = (index[e] for e in rows[r][1])
        if a != b:
            mesh[[a, b], [a, b]] += part.secants[r]
            mesh[[a, b], [b, a]] -= part.secants[r]
    order = [k for k, n in enumerate(names) if n in stay]
    mesh = _schur(mesh, order)
    ends = [names[k] for k in order]
    floor = MIN_LINK_SHARE * float(np.abs(mesh).max(initial=0.0))
    links = {
        (a, b): float(-mesh[i, j])
        for i, a in enumerate(ends)
        for j, b in enumerate(ends)
        if i < j and -mesh[i, j] > floor and not {a, b} <= set(part.outside)
    }
    _, whole, capacity, s, m = _projected(part, choice)
    masses_kept = capacity[s]
    if m:
        weights = np.linalg.solve(whole[np.ix_(m, m)], -whole[np.ix_(m, s)])
        masses_kept = masses_kept + weights.T @ (capacity[m] * weights.sum(axis=1))
    masses = {spoken[k]: float(c) for k, c in zip(s, masses_kept, strict=True)}
    linearised = tuple(dict.fromkeys(part.rows[r].name for r in rest if part.rows[r].form != "linear"))
    rows_kept = tuple(replace(part.rows[r], ends=(e[0], e[1])) for r, e in lawful)
    return Condensed(masses, tuple(spoken[k] for k in sorted(shown - choice.states)), links, rows_kept, linearised, inside)


def _schur(whole: Array, stay: Sequence[int]) -> Array:
    """Return the Schur complement K_ss - K_sg K_gg^-1 K_gs (stay, stay): conductances between nodes that stay, the others eliminated. [W/K]

    `whole` K (nodes, nodes) is symmetric, with the sum of a node's conductances on its diagonal and -G_ij off it.
    """
    gone = [k for k in range(whole.shape[0]) if k not in set(stay)]
    if not gone:
        return whole[np.ix_(stay, stay)]
    between = whole[np.ix_(gone, stay)]
    return np.asarray(whole[np.ix_(stay, stay)] - between.T @ np.linalg.solve(whole[np.ix_(gone, gone)], between))


SLOTS = KINDS["flow"].slots
FLOW_HEAT = 1000.0
"""Specific heat that a one-way flow of a reduced deck is written with. [J/(kg K)]"""


@dataclass(frozen=True)
class NodeDeviation:
    """How far a reduced model is from the full one at one node in one scenario.

    Parameters
    ----------
    scenario, node : str
    largest, time : float   Reduced less full where it is farthest, and when. [K], [s]
    final : float           At the end. [K]
    """

    scenario: str
    node: str
    largest: float
    time: float
    final: float


@dataclass(frozen=True, eq=False)
class Reduction(Result):
    """A part with fewer masses.

    Parameters
    ----------
    model : Model               The reduced part, a deck of its own; paths of the full one are aliases in it.
    inside : Model              The whole with the reduced part in its place; `model` itself where the whole was reduced.
    masses, nodes : (int, int)  Of the full part, and of the reduced one.
    deviations : tuple          Of every reference point in every scenario that was given.
    remarks : tuple of str      What a reader must know.
    """

    model: Model
    inside: Model
    masses: tuple[int, int]
    nodes: tuple[int, int]
    deviations: tuple[NodeDeviation, ...]
    remarks: tuple[str, ...] = ()

    @property
    def worst(self) -> NodeDeviation:
        """The largest deviation of all."""
        return max(self.deviations, key=lambda d: abs(d.largest))

    def by_node(self) -> dict[str, NodeDeviation]:
        """Return node -> its largest deviation over all scenarios."""
        out: dict[str, NodeDeviation] = {}
        for d in self.deviations:
            if d.node not in out or abs(d.largest) > abs(out[d.node].largest):
                out[d.node] = d
        return out

    def __str__(self) -> str:
        """How many nodes are left, and how far each reference point is off at most."""
        width = max(len(d.node) for d in self.deviations)
        head = f"{self.model.title}: {self.masses[1]} masses of {self.masses[0]}, {self.nodes[1]} nodes of {self.nodes[0]}"
        lines = [f"  {n:<{width}}  {d.largest:+.3f} K at {d.time / 60:.0f} min of {d.scenario}" for n, d in self.by_node().items()]
        return "\n".join([head, *lines, *(f"  remark: {r}" for r in self.remarks)])


def reduce(
    model: Model,
    scenarios: Scenario | Sequence[Scenario],
    *,
    nodes: int | None = None,
    within: str | float | None = None,
    keep: Sequence[str] = (),
    at: str = "",
) -> Reduction:
    """Return a model, or one part of it, with fewer masses, and how far it is off in scenarios.

    Masses that do alike become one, quick ones follow the others; which, is chosen step by step so that reference points move least.
    Reference points, heated and offered nodes stay readable under their paths. Radiation and natural convection between nodes that stay
    keep their laws, other laws become constant at the mean temperatures of the first scenario, in its gas: the reduced deck says in which
    state it was made (`made_in`), and runs in no other.

    Parameters
    ----------
    model : Model               The whole.
    scenarios : Scenario, or several    In which the deviation is found; the first one's mean temperatures linearise what must be linear.
    nodes : int                 How many masses are left.
    within : str or float       In place of `nodes`: as few masses as keep every reference point within this. [K]
    keep : sequence of str      Nodes that keep their own mass.
    at : str                    The submodel to reduce; the whole when empty.

    Raises
    ------
    DeckError       When a load of the part is no plain power, a conductor of it changes with time, or a node of it stores latent heat.
    ScenarioError   When a scenario has another gas than the first, neither or both of `nodes` and `within` are given, or nothing is within.
    """
    cases = [scenarios] if isinstance(scenarios, Scenario) else list(scenarios)
    if not cases or (nodes is None) == (within is None):
        raise ScenarioError("a reduction needs a scenario, and either 'nodes' or 'within'.", model.title, code="value.incomplete")
    ahead = f"{model.canonical(at)}." if at else ""
    moving = next((p for s in cases for p in map(model.canonical, s.schedule) if p.startswith(ahead)), "")
    if moving:
        words = f"'{moving}' follows a schedule, which a reduced deck cannot represent. Reduce the part around it."
        raise DeckError(words, model.title, code="model.element-not-supported")
    runs = [simulate(model, s) for s in cases]
    network = network_for(model, cases[0])
    held = frozenset(network.find(f"{ahead}{k}" if at and not k.startswith(ahead) else k) for k in keep)
    points = [n.path for n in network.flat.nodes if n.reference_point and n.path.startswith(ahead)]
    part_model = model.submodel(at) if at else model
    offered = frozenset(p for o in part_model.offers if (p := ahead + part_model.canonical(o)) in network.nodes)
    stay = held | offered | {load.node for load in network.flat.loads if load.path.startswith(ahead)}
    judged = points or sorted(stay)
    part = part_of(network, runs[0], ahead, stay | frozenset(points), judged)
    drives = [Drive.of_run(part, network, r, Start.from_text(s.start, s.title) == Start(STEADY)) for s, r in zip(cases, runs, strict=True)]
    ways = chain(part, held, drives)
    limit = None if within is None else amount(within, "K", "within")
    for count in sorted(ways) if limit is not None else [min(max(nodes or 0, min(ways)), max(ways))]:
        trial = _tried(model, cases, runs, network, part, ways[count], at, judged)
        if limit is None or abs(trial.worst.largest) <= limit:
            return trial
    raise ScenarioError(
        f"no reduced deck is within {limit:g} K of the full model; with all masses kept the largest error is "
        f"{abs(trial.worst.largest):.2g} K. Allow a larger error.",
        model.title,
        code="value.outside-range",
    )


def _tried(
    model: Model,
    scenarios: Sequence[Scenario],
    runs: Sequence[Solution],
    network: Network,
    part: Subnetwork,
    choice: Partition,
    at: str,
    points: Sequence[str],
) -> Reduction:
    """Return the reduction to so many masses."""
    ahead = f"{model.canonical(at)}." if at else ""
    small = condensed(part, choice)
    part_model = model.submodel(at) if at else model
    reduced = _deck(part_model, ahead, network, small)
    inside = model.replace(at, reduced) if at else reduced
    others = [simulate(inside, s, times=r.times) for s, r in zip(scenarios, runs, strict=True)]
    deviations = tuple(_deviation(s, r, o, p) for s, r, o in zip(scenarios, runs, others, strict=True) for p in points)
    masses = (int((part.capacitances > 0).sum()), len(small.masses))
    held = reduced.made_in.items()
    remarks = [
        f"made with '{gas}' in one state, {state}; its conductances are valid there only, and other states are refused"
        for gas, state in held
    ]
    if small.linearised:
        remarks.append(f"constant instead of their laws: {', '.join(n.removeprefix(ahead) for n in small.linearised)}")
    for n, (mean, low, high) in part.shares.items():
        c = network.stores[n].reference
        remarks.append(
            f"'{n.removeprefix(ahead)}' has a constant {mean * c:.4g} J/(kg K) instead of its table, which ranges from {low * c:.4g} to "
            f"{high * c:.4g} in '{scenarios[0].title}'"
        )
    return Reduction(reduced, inside, masses, (len(part.nodes), len(small.masses) + len(small.massless)), deviations, tuple(remarks))


def _deviation(scenario: Scenario, full: Solution, small: Solution, node: str) -> NodeDeviation:
    """Return how far the reduced run is from the full one at a node."""
    off = small[node].kelvin - full[node].kelvin
    k = int(np.abs(off).argmax())
    return NodeDeviation(scenario.title, node, float(off[k]), float(full.times[k]), float(off[-1]))


def _deck(part_model: Model, ahead: str, network: Network, small: Condensed) -> Model:
    """Return the reduced part as a model: plain names, with the paths of the full part as aliases."""
    basis = f"reduced from {part_model.title}, {part_model.identity()}"
    inner = [*small.masses, *small.massless]
    name = {n: n.removeprefix(ahead).replace(".", "_") for n in inner}
    name |= {network.find(f"{ahead}{need}"): need for need in reversed(part_model.needs)}
    name |= {n: name[by] for n, by in small.inside.items() if by in name}
    points = {small.inside.get(n.path, "") for n in network.flat.nodes if n.reference_point}
    numbers = network.numbers()

    def written(value: float, unit: str) -> dict[str, Any]:
        """Return a number as a deck writes it, with unit, source and basis."""
        return {"value": f"{value!r} [{unit}]", "source": "derived", "basis": basis}

    nodes: dict[str, dict[str, Any]] = {name[n]: {"capacitance": written(c, "J/K")} for n, c in small.masses.items()} | {
        name[n]: {} for n in small.massless
    }
    for n in points & set(inner):
        nodes[name[n]]["reference_point"] = True
    links: list[dict[str, Any]] = [
        {"kind": "conduction", "between": [name[a], name[b]], "conductance": written(g, "W/K")} for (a, b), g in small.links.items()
    ]
    links += [_law_table(row, name, written, network) for row in small.rows]
    inner_loads = [load for load in network.flat.loads if load.path.startswith(ahead)]
    loads = {load.path.removeprefix(ahead).replace(".", "_"): _load_table(load, numbers, name, written) for load in inner_loads}
    taken = {*name.values(), *loads}
    aliases = {load.path.removeprefix(ahead): load.path.removeprefix(ahead).replace(".", "_") for load in inner_loads}
    aliases |= {n.removeprefix(ahead): name[n] for n in small.inside if n in name}
    aliases |= {a: aliases[p] for a, t in part_model.aliases.items() if (p := part_model.canonical(t)) in aliases}
    gases = dict.fromkeys(c.gas for c in network.flat.conductors if c.path.startswith(ahead) and _in_gas(c))
    states = {name.get(gas, "*"): network.media.made_in(gas).written() for gas in gases}
    return model_from_dict(
        {
            "title": f"{part_model.title} reduced to {len(small.masses)}",
            "box": part_model.box,
            "use": part_model.use,
            "needs": list(part_model.needs),
            "offers": [name[n] for n in inner],
            "nodes": nodes,
            "conductors": {f"link_{k}": link for k, link in enumerate(links, 1)},
            "loads": loads,
            "aliases": {a: t for a, t in aliases.items() if a != t and a not in taken},
            "made_in": states,
        }
    )


def _in_gas(c: FlatConductor) -> bool:
    """Return whether a conductor is another one in another state of its gas."""
    if c.kind == "lead":
        return "to" in c.words
    return c.kind in ("convection", "effective", "gas", "flow") or "gap" in c.fields or bool(c.gas and c.kind == "radiation")


def _law_table(row: ConductorRow, name: Mapping[str, str], written: Any, network: Network) -> dict[str, Any]:
    """Return a conductor that keeps its law."""
    first, between = value_of(row.coefficients[0]), [name[e] for e in row.ends]
    if row.form == "flow":
        fluid = next(c.words.get("fluid", "") for c in network.flat.conductors if c.path == row.name)
        field, size = (
            network.streams.written(row.name, first, FLOW_HEAT) if row.name in network.streams else ("mass_flow", first / FLOW_HEAT)
        )
        flow = {field: written(size, SLOTS[field]), "specific_heat": written(FLOW_HEAT, "J/(kg K)")}
        return {"kind": "flow", "between": between, "fluid": fluid, **flow}
    if row.form == "radiation":
        return {"kind": "radiation", "between": between, "emissivity": written(1.0, "1"), "area": written(first / STEFAN_BOLTZMANN, "m^2")}
    htc = {"coefficient": written(1.0, "W/(m^2 K)"), "exponent": written(value_of(row.coefficients[1]), "1")}
    return {"kind": "convection", "between": between, "htc": htc, "area": written(first, "m^2")}


def _load_table(load: FlatLoad, numbers: Numbers, name: Mapping[str, str], written: Any) -> dict[str, Any]:
    """Return the deck's table of a load of the reduced model; one that is no constant power is refused."""
    plain = {"power", "command_curve", "reference_temperature"}
    plain |= {f"{law}_coefficient" for law in ("temperature", "quadratic", "exponential")}
    odd = sorted(set(load.fields) - plain)
    if load.curve is not None or odd or load.sensor not in ("", load.node):
        what = ", ".join(odd) or "a table"
        raise DeckError(
            f"'{load.path}' is not a constant power ({what}). Reduce the part around it, and keep it outside.",
            load.where,
            code="model.element-not-supported",
        )
    units = {field: "K" if LOAD_SLOTS[field] == "temperature" else LOAD_SLOTS[field] for field in load.fields}
    return {"into": name[load.node], **{f: written(value_of(numbers.values[p]), units[f]) for f, p in load.fields.items()}}
