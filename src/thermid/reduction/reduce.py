"""`reduce`: a part with fewer masses, as a deck that stands in its place, and how far it is off."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from thermid.arguments import takes_objects
from thermid.dual import value_of
from thermid.errors import DeckError, ScenarioError
from thermid.model.deck.modelfile import model_from_dict
from thermid.model.laws.signal import literal
from thermid.model.parts.elements import LOAD_SLOTS
from thermid.model.parts.kinds import KINDS
from thermid.model.tree.flat import FlatConductor, FlatLoad
from thermid.model.tree.identity import made_to
from thermid.model.tree.model import Model
from thermid.network.network import Network, Numbers
from thermid.network.rows import ConductorRow
from thermid.physics.constants import STEFAN_BOLTZMANN
from thermid.reduction.condense import Condensed, Drive, Partition, Subnetwork, chain, condensed, part_of
from thermid.simulation.scenarios.scenario import STEADY, Scenario, Start
from thermid.simulation.simulator import network_for
from thermid.simulation.solution import Solution
from thermid.simulation.transient import simulate

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
class Reduction:
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


@takes_objects
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
    ScenarioError   When a scenario has another gas than the first.
    ScenarioError   When neither or both of `nodes` and `within` are given, or nothing is within.
    """
    given = [scenarios] if isinstance(scenarios, Scenario) else list(scenarios)
    if not given or (nodes is None) == (within is None):
        raise ScenarioError("a reduction needs a scenario, and either 'nodes' or 'within'.", model.title)
    ahead = f"{model.canonical(at)}." if at else ""
    moving = next((p for s in given for p in map(model.canonical, s.schedule) if p.startswith(ahead)), "")
    if moving:
        raise DeckError(f"'{moving}' follows a schedule, which a reduced deck cannot. Reduce the part around it.", model.title)
    runs = [simulate(model, s) for s in given]
    network = network_for(model, given[0])
    held = frozenset(network.find(f"{ahead}{k}" if at and not k.startswith(ahead) else k) for k in keep)
    points = [n.path for n in network.flat.nodes if n.reference_point and n.path.startswith(ahead)]
    offered = _offered(model.submodel(at) if at else model, ahead, network)
    heated = frozenset(load.node for load in network.flat.loads if load.path.startswith(ahead))
    judged = points or sorted(held | heated | offered)
    part = part_of(network, runs[0], ahead, held | frozenset(points) | offered | heated, judged)
    drives = [Drive.of(part, network, r, Start.of(s.start, s.title) == Start(STEADY)) for s, r in zip(given, runs, strict=True)]
    ways = chain(part, held, drives)
    limit = literal(within, "K", "within") if isinstance(within, str) else within
    for count in sorted(ways) if limit is not None else [min(max(nodes or 0, min(ways)), max(ways))]:
        found = _tried(model, given, runs, network, part, ways[count], at, judged)
        if limit is None or abs(found.worst.largest) <= limit:
            return found
    farthest = abs(found.worst.largest)
    raise ScenarioError(f"no reduction keeps within {limit:g} K; with all masses the farthest is {farthest:.2g} K.", model.title)


def _offered(part: Model, ahead: str, network: Network) -> frozenset[str]:
    return frozenset(p for o in part.offers if (p := ahead + part.canonical(o)) in network.nodes)


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
    own = model.submodel(at) if at else model
    reduced = _deck(own, ahead, network, small)
    inside = model.replace(at, reduced) if at else reduced
    others = [simulate(inside, s, times=r.times) for s, r in zip(scenarios, runs, strict=True)]
    deviations = tuple(_deviation(s, r, o, p) for s, r, o in zip(scenarios, runs, others, strict=True) for p in points)
    masses = (int((part.capacitances > 0).sum()), len(small.masses))
    held = reduced.made_in.items()
    remarks = [f"made with '{gas}' in one state, {state}, which its conductances hold; refused in any other" for gas, state in held]
    if small.linearised:
        remarks.append(f"constant in place of their laws: {', '.join(n.removeprefix(ahead) for n in small.linearised)}")
    for n, (mean, low, high) in part.shares.items():
        c = network.stores[n].reference
        remarks.append(
            f"'{n.removeprefix(ahead)}' has a constant {mean * c:.4g} J/(kg K) in place of its table, which goes from {low * c:.4g} to "
            f"{high * c:.4g} in '{scenarios[0].title}'"
        )
    return Reduction(reduced, inside, masses, (len(part.nodes), len(small.masses) + len(small.massless)), deviations, tuple(remarks))


def _deviation(scenario: Scenario, full: Solution, small: Solution, node: str) -> NodeDeviation:
    off = small[node].kelvin - full[node].kelvin
    k = int(np.abs(off).argmax())
    return NodeDeviation(scenario.title, node, float(off[k]), float(full.times[k]), float(off[-1]))


def _deck(own: Model, ahead: str, network: Network, small: Condensed) -> Model:
    """Return the reduced part as a model: plain names, with the paths of the full part as aliases."""
    basis = f"reduced from {own.title}, {own.identity()}"
    inner = [*small.masses, *small.massless]
    name = {n: n.removeprefix(ahead).replace(".", "_") for n in inner}
    name |= {network.find(f"{ahead}{need}"): need for need in reversed(own.needs)}
    name |= {n: name[by] for n, by in small.inside.items() if by in name}
    points = {small.inside.get(n.path, "") for n in network.flat.nodes if n.reference_point}
    numbers = network.numbers()

    def written(value: float, unit: str) -> dict[str, Any]:
        return {"value": f"{value!r} [{unit}]", "source": "derived", "basis": basis}

    nodes: dict[str, dict[str, Any]] = {name[n]: {"capacitance": written(c, "J/K")} for n, c in small.masses.items()} | {
        name[n]: {} for n in small.massless
    }
    for n in points & set(inner):
        nodes[name[n]]["reference_point"] = True
    links: list[dict[str, Any]] = [
        {"kind": "conduction", "between": [name[a], name[b]], "conductance": written(g, "W/K")} for (a, b), g in small.links.items()
    ]
    links += [_law(row, name, written, network) for row in small.rows]
    given = [load for load in network.flat.loads if load.path.startswith(ahead)]
    loads = {load.path.removeprefix(ahead).replace(".", "_"): _load(load, numbers, name, written) for load in given}
    taken = {*name.values(), *loads}
    aliases = {load.path.removeprefix(ahead): load.path.removeprefix(ahead).replace(".", "_") for load in given}
    aliases |= {n.removeprefix(ahead): name[n] for n in small.inside if n in name}
    aliases |= {a: aliases[p] for a, t in own.aliases.items() if (p := own.canonical(t)) in aliases}
    gases = dict.fromkeys(c.gas for c in network.flat.conductors if c.path.startswith(ahead) and _in_gas(c))
    made = {name.get(gas, "*"): made_to(network.media.made_in(gas)) for gas in gases}
    return model_from_dict(
        {
            "title": f"{own.title} reduced to {len(small.masses)}",
            "box": own.box,
            "use": own.use,
            "needs": list(own.needs),
            "offers": [name[n] for n in inner],
            "nodes": nodes,
            "conductors": {f"link_{k}": link for k, link in enumerate(links, 1)},
            "loads": loads,
            "aliases": {a: t for a, t in aliases.items() if a != t and a not in taken},
            "made_in": made,
        }
    )


def _in_gas(c: FlatConductor) -> bool:
    """Return whether a conductor is another one in another state of its gas."""
    if c.kind == "lead":
        return "to" in c.words
    return c.kind in ("convection", "effective", "gas", "flow") or "gap" in c.fields or bool(c.gas and c.kind == "radiation")


def _law(row: ConductorRow, name: Mapping[str, str], written: Any, network: Network) -> dict[str, Any]:
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


def _load(load: FlatLoad, numbers: Numbers, name: Mapping[str, str], written: Any) -> dict[str, Any]:
    plain = {"power", "command_curve", "reference_temperature"}
    plain |= {f"{law}_coefficient" for law in ("temperature", "quadratic", "exponential")}
    odd = sorted(set(load.fields) - plain)
    if load.curve is not None or odd or load.sensor not in ("", load.node):
        what = ", ".join(odd) or "a table"
        raise DeckError(f"'{load.path}' is no plain power ({what}). Reduce the part around it, and keep it outside.", load.where)
    units = {field: "K" if LOAD_SLOTS[field] == "temperature" else LOAD_SLOTS[field] for field in load.fields}
    return {"into": name[load.node], **{f: written(value_of(numbers.values[p]), units[f]) for f, p in load.fields.items()}}
