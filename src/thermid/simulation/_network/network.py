"""`Network`: a model compiled to rows with numbers, names kept; its massless nodes eliminated; its parts without a path to a boundary.

Compiling is pure; the same network serves many values. Elimination is star to mesh, exact for linear conductors, with derivatives: a node
without capacitance that is joined by linear, constant conductors only is replaced by conductors ``g_i g_j / sum g`` between its
neighbours; its temperature is their mean weighted by ``g_i / sum g``. Kirchhoff's star-mesh rule (Rosen, 1924). Other massless nodes
are solved with the states by the kernel.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, reduce
from operator import add
from typing import Any, Final

import numpy as np

from thermid.base.errors import CodedText, DeckError, errors_at, refuse_first
from thermid.base.units import Memo, Number, value_of
from thermid.model.tree import COMPLEMENT, Curve, Flat, FlatConductor, FlatLoad, FlatNode, HeatStore, Law, Model, exposed_area, streams_of
from thermid.simulation._network.controls import PHASE, ControlRow, control_names, control_row, phase_row, state_of
from thermid.simulation._network.irradiation import absorbers
from thermid.simulation._network.medium import TRACE, Media, check_gas_laws, conductors_with_trace
from thermid.simulation._network.rows import ConductorRow, LoadRow, reached
from thermid.simulation._network.streams import Streams


@dataclass(frozen=True, eq=False)
class Numbers:
    """Capacitances and rows of a network at one set of parameter values; numbers are floats, or carry derivatives.

    Parameters
    ----------
    capacitances : dict             Node path -> capacitance [J/K]; None for a massless node.
    conductors, loads : tuple       Rows of the law table.
    values : dict                   Parameter path -> value. [SI]
    controls : tuple                Controls that something names.
    """

    capacitances: Mapping[str, Number | None]
    conductors: tuple[ConductorRow, ...]
    loads: tuple[LoadRow, ...]
    values: Mapping[str, Any]
    controls: tuple[ControlRow, ...] = ()


@dataclass(frozen=True, eq=False)
class _Reached:
    """Parameters, nodes, conductors and loads that must be evaluated anew when some parameters change."""

    paths: tuple[str, ...]
    nodes: tuple[FlatNode, ...]
    conductors: tuple[FlatConductor, ...]
    loads: tuple[FlatLoad, ...]


@dataclass(frozen=True, eq=False)
class Varied:
    """What depends on some parameters, evaluated at one set of their values; the rest of the network is left as it was.

    Parameters
    ----------
    parts : dict            Parameters and rows by element, of the whole network.
    capacitances : dict     Node path -> capacitance [J/K], of the nodes that depend on them.
    rows : tuple            Conductors and loads that depend on them, and all controls, in order.
    """

    parts: Mapping[str, Any]
    capacitances: Mapping[str, Number | None]
    rows: tuple[ConductorRow | LoadRow | ControlRow, ...]


@dataclass(frozen=True, eq=False)
class Network:
    """A compiled model.

    Parameters
    ----------
    title : str                 The model's.
    flat : Flat                 The tree laid flat.
    nodes : tuple of str        Nodes whose temperature is unknown, in order; the kernel's order.
    boundaries : tuple of str   Nodes whose temperature is given: the model's needs, then prescribed nodes.
    media : Media               What each gas does at the scenario's pressure.
    stores : dict               Node -> how it stores heat, where that changes with temperature.
    traced : frozenset          Conductors through gas that keep a trace of it, see `traced`.
    memo : Memo                 Rows at the model's own values, and what depends on which parameters.
    """

    title: str
    flat: Flat
    nodes: tuple[str, ...]
    boundaries: tuple[str, ...]
    media: Media
    prescribed: tuple[str, ...] = ()
    stores: Mapping[str, HeatStore] = field(default_factory=dict)
    traced: frozenset[str] = frozenset()
    memo: Memo = field(init=False, default_factory=Memo, compare=False, repr=False)

    def find(self, name: str, where: str = "") -> str:
        """Return the canonical path of a node or boundary; aliases are accepted."""
        return self.flat.names.find(name, where)

    @property
    def streams(self) -> Streams:
        """The streams of gas, at the model's own values."""
        return self.memo.value("streams", self._streams)

    def _streams(self) -> Streams:
        """Return the streams of gas at the model's own values; an empty set where no conductor is a flow."""
        if not streams_of(self.flat.conductors):
            return Streams((), {}, {}, {}, frozenset(), self.media)
        return Streams.of_network(self.flat, self.flat.parameters.evaluate({}), self.media)

    def numbers(self, overrides: Mapping[str, Number] | None = None) -> Numbers:
        """Return the rows at the model's own values, or with some replaced.

        Parameters
        ----------
        overrides : dict    Parameter path -> float or `Dual`. [SI]

        Raises
        ------
        DeckError   When a capacitance or conductance is negative, joints take more area than a surface has, or streams do not close
                    their masses.
        """
        return self.numbers_of(self.parts(overrides))

    def parts(self, overrides: Mapping[str, Number] | None = None) -> Mapping[str, Any]:
        """Return parameters and rows by element, as `numbers` has them; `varied` starts from these."""
        replaced = dict(overrides or {})
        if not replaced:
            return self._static()
        return self._at(replaced, self.memo.value(("reached", tuple(replaced)), lambda: self._reached(tuple(replaced))), self._static())

    def varied(self, base_parts: Mapping[str, Any], overrides: Mapping[str, Number], names: tuple[str, ...]) -> Varied:
        """Return everything that depends on some parameters, evaluated at other values of these.

        Parameters
        ----------
        base_parts : dict   From `parts`, at all other values.
        overrides : dict    Parameter path -> number, of all that are replaced: those of `base_parts` and the changed ones. [SI]
        names : tuple       Paths of the changed ones.
        """
        changed = self.memo.value(("reached", names), lambda: self._reached(names))
        parts = self._at(overrides, changed, base_parts)
        capacitances = {n.path: parts["capacitances"][n.path] for n in changed.nodes if n.path not in self.boundaries}
        conductors = [row for c in changed.conductors for row in parts["conductors"][c.path]]
        loads = [row for load in changed.loads for row in parts["loads"][load.path]]
        controls = [control_row(self.flat.controls[name], parts["values"]) for name in self.controls]
        return Varied(parts, capacitances, (*conductors, *loads, *controls))

    def places(self, base_parts: Mapping[str, Any], names: tuple[str, ...]) -> tuple[int, ...]:
        """Return the places of the rows of `varied` among all conductors, loads and controls of `numbers`, in that order."""
        changed = self.memo.value(("reached", names), lambda: self._reached(names))
        conductors, loads = {c.path for c in changed.conductors}, {load.path for load in changed.loads}
        moved = [path in conductors for path, rows in base_parts["conductors"].items() for _ in rows]
        moved += [path in loads for path, rows in base_parts["loads"].items() for _ in rows]
        return tuple(k for k, is_varied in enumerate([*moved, *(True for _ in self.controls)]) if is_varied)

    def _static(self) -> Mapping[str, Any]:
        """Return parameters and rows at the model's own values."""
        flat = self.flat
        return self.memo.value("static", lambda: self._at({}, _Reached(flat.parameters.order, flat.nodes, flat.conductors, flat.loads), {}))

    def _at(self, overrides: Mapping[str, Number], changed: _Reached, base_parts: Mapping[str, Any]) -> dict[str, Any]:
        """Return `base_parts` with changed parameters, nodes, conductors and loads evaluated anew; refuse values that physics forbids."""
        values = self.flat.parameters.evaluate(overrides, changed.paths, base_parts.get("values"))
        for _, where, message in self.flat.impossible(values, changed.paths):
            raise DeckError(message, where, code="value.outside-range")
        capacitances, conductors, loads = (dict(base_parts.get(k, {})) for k in ("capacitances", "conductors", "loads"))
        if any(c.kind == "flow" for c in changed.conductors):
            for where, message in self.flat.unbalanced_streams(values):
                raise DeckError(message, where)
        for node in changed.nodes:
            capacitance: Number | None = node.capacitance(values)
            if capacitance is not None and not (value_of(capacitance) > 0 and np.isfinite(value_of(capacitance))):
                raise DeckError(
                    "a node's capacitance must be above zero and finite. For a massless node leave mass and capacitance out.",
                    node.where,
                    code="model.capacitance-not-positive",
                )
            capacitances[node.path] = capacitance
        for c in changed.conductors:
            conductors[c.path] = self._rows(c, values)
        for load in changed.loads:
            loads[load.path] = _load_rows(load, values)
        return {"values": values, "capacitances": capacitances, "conductors": conductors, "loads": loads}

    def _reached(self, names: tuple[str, ...]) -> _Reached:
        """Return the parameters, nodes, conductors and loads that depend on parameters of some names."""
        flat = self.flat
        changed = flat.parameters.downstream(names)
        touched = set(changed)
        return _Reached(
            changed,
            tuple(n for n in flat.nodes if touched & set(n.fields.values())),
            tuple(c for c in flat.conductors if touched & {*c.fields.values(), *(t.path for t in c.takes), c.emissivity}),
            tuple(load for load in flat.loads if touched & {*load.fields.values(), *(t.path for t in load.takes)}),
        )

    def numbers_of(self, parts: Mapping[str, Any]) -> Numbers:
        """Return the rows of `parts`."""
        capacitances = {n: c for n, c in parts["capacitances"].items() if n not in self.boundaries}
        conductors = tuple(row for rows in parts["conductors"].values() for row in rows)
        loads = tuple(row for rows in parts["loads"].values() for row in rows)
        controls = tuple(control_row(self.flat.controls[name], parts["values"]) for name in self.controls)
        phases = tuple(phase_row(state_of(n, PHASE), held_in(n), s.melt) for n, s in self.stores.items() if s.melt is not None)
        return Numbers(capacitances, conductors, loads, parts["values"], (*controls, *phases))

    def with_powers_alone(self, loads: Collection[str]) -> Network:
        """Return the network with some loads as their powers alone, with no law over temperature, cycle or control; itself if they are."""
        alone = tuple(load.power_alone if load.path in loads else load for load in self.flat.loads)
        return self if alone == self.flat.loads else replace(self, flat=replace(self.flat, loads=alone))

    @property
    def switches(self) -> bool:
        """Whether a temperature switches anything: a thermostat, a machine of modes, or a melt that cools below its melting point."""
        thermostats = any(field.startswith("thermostat.") for load in self.flat.loads for field in load.fields)
        machines = any(self.flat.controls[name].control.kind in ("thermostat", "modes") for name in self.controls)
        return thermostats or machines or any(store.melt is not None for store in self.stores.values())

    @cached_property
    def controls(self) -> tuple[str, ...]:
        """The controls that an element names, in the order of the deck."""
        if not self.flat.controls:
            return ()
        by = [*(c.controls for c in self.flat.conductors), *(load.controls for load in self.flat.loads)]
        named = {name for names in by for name in control_names(names)}
        return tuple(name for name in self.flat.controls if name in named)

    def _rows(self, c: FlatConductor, values: Mapping[str, Any]) -> tuple[ConductorRow, ...]:
        """Return the kernel rows of a conductor at values of parameters: its laws in the state of its gas, with its controls."""
        fields = {name: values[path] for name, path in c.fields.items()}
        if c.takes:
            fields["area"] = exposed_area(c.path, fields["area"], c.takes, values, c.where)
        with errors_at(c.where):
            laws = c.laws(fields)
            if not c.reversible and any(value_of(law.coefficients[0]) < 0 for law in laws):
                raise DeckError(
                    f"'{c.path}' has a negative conductance; heat would flow from cold to hot. Check signs and areas.",
                    code="model.negative-conductance",
                )
            if c.factor != 1.0:
                laws = tuple(law.scaled(c.factor) for law in laws)
            if c.kind == "flow" and c.path in self.streams:
                return _both_ways(c, replace(self.streams.row(c, laws[0]), controls=c.controls))
            laws = tuple(piece for law in laws for piece in law.pieces())
        emissivity = values[c.emissivity] if c.emissivity else None
        rows = tuple(row for law in laws for row in self.media.rows(c, law, fields, emissivity))
        if c.controls or c.reversible:
            rows = tuple(one_way for row in rows for one_way in _both_ways(c, replace(row, controls=c.controls)))
        return (*rows, ConductorRow(c.path, c.ends, Law("linear", (TRACE,)))) if c.path in self.traced else rows


def _both_ways(c: FlatConductor, row: ConductorRow) -> tuple[ConductorRow, ...]:
    """Return a reversible stream as two one-way rows, m max(sign, 0) there and back, one of which is zero; any other row as it is."""
    if not c.reversible:
        return (row,)
    flow: Any = value_of(row.law.coefficients[0])
    above: Any = 1.0 * (flow > 0.0)  # by what it is multiplied for its part above zero, and less for that below
    ahead, back = row.law.scaled(above), row.law.scaled(above - 1.0)
    return replace(row, law=ahead), replace(row, ends=row.ends[::-1], law=back, turned=True)


def _load_rows(load: FlatLoad, values: Mapping[str, Any]) -> tuple[LoadRow, ...]:
    """Return the rows of a load, its law first, then those of a command's curvature and of a sine; all have its control."""
    f = {name: values[path] for name, path in load.fields.items()}
    if load.flux is not None:
        return (_absorbed(load, f, values),)
    form, rest = "signal", ()  # type: str, tuple[Number, ...]
    first: Number = f.get("power", f.get("scale", 1.0))
    if load.curve is not None:
        form = "table"
    elif "exponential_coefficient" in f:
        form, rest = "exponential", (f["exponential_coefficient"], f["reference_temperature"])
    elif "temperature_coefficient" in f or "quadratic_coefficient" in f:
        form = "polynomial"
        rest = (f.get("temperature_coefficient", 0.0), f.get("quadratic_coefficient", 0.0), f["reference_temperature"])
    control, settings = _control(load, f)

    def row(law: str, coefficients: tuple[Number, ...], curve: Curve | None, signal: str) -> LoadRow:
        """Return the row of the load under a law, with the settings of its control."""
        return LoadRow(
            *(load.path, law, load.node, load.sensor, (*coefficients, *settings)), curve, f"{signal} {load.path}", control, load.controls
        )

    rows = [row(form, (first, *rest), load.curve, "load")]
    if "command_curve" in f:
        rows.append(row(form, (first * f["command_curve"], *rest), load.curve, "curve"))
    if "sine.amplitude" in f:
        rows.append(row("signal", (f["sine.amplitude"],), None, "sine"))
    return tuple(rows)


def _control(load: FlatLoad, f: Mapping[str, Number]) -> tuple[str, tuple[Number, ...]]:
    """Return the control of a load, 'thermostat', 'proportional' or empty, and its settings in the kernel's order.

    Raises
    ------
    DeckError   When a thermostat has no hysteresis.
    """
    if "thermostat.on_below" in f:
        low, high = f["thermostat.on_below"], f["thermostat.off_above"]
        refuse_first(
            load.where,
            (
                value_of(low) == value_of(high),
                "the thermostat switches on and off at the same temperature and would switch endlessly. Set off_above some kelvin higher.",
                "value.outside-range",
            ),
            (
                value_of(low) > value_of(high),
                "the thermostat switches on above the temperature where it switches off. Exchange on_below and off_above.",
                "value.outside-range",
            ),
        )
        return "thermostat", (low, high)
    if "proportional.band" in f:
        return "proportional", (1.0, f["proportional.setpoint"], f["proportional.band"])
    if "proportional.gain" in f:  # gain times what is missing, up to the law's first coefficient
        return "proportional", (f["proportional.gain"], f["proportional.setpoint"])
    return "", ()


def _absorbed(load: FlatLoad, fields: Mapping[str, Any], values: Mapping[str, Any]) -> LoadRow:
    """Return the row of what a surface absorbs: its exposed area, times its absorptance or emissivity, per flux."""
    if load.recipe is not None:
        first = load.recipe(values)
    else:
        first = exposed_area(load.path.rpartition(".")[0], fields["area"], load.takes, values, load.where)
        for name in (name for name in ("absorptance", "emissivity") if name in fields):
            first = fields[name] * first
    return LoadRow(load.path, "signal", load.node, load.sensor, (first,), None, f"load {load.path}", "", load.controls)


def compile_network(model: Model, *, media: Media | None = None, prescribed: Iterable[str] = ()) -> Network:
    """Return a model compiled to a network.

    Parameters
    ----------
    model : Model               The tree.
    media : Media               The state of each gas; where none is given one atmosphere, without asking what surfaces say of it.
    prescribed : iterable       Nodes that are driven by a given temperature instead of their own balance.

    Raises
    ------
    ThermidError   With file and key path of the first thing that does not fit: surfaces that radiate into a gas, or that say nothing of
                   what is left to them in the gas of a run.
    """
    if media is not None and (media.environments or media.irradiation):
        return _compiled(model, media, tuple(prescribed))
    key = tuple(prescribed), media and (media.as_printed, media.seconds)
    network: Network = model.memo.value("networks", Memo).value(key, lambda: _compiled(model, media, key[0]), KEPT_NETWORKS)
    return network


KEPT_NETWORKS: Final = 8
"""Networks that a model keeps, in air as it is or where nobody says in what: a plan asks for as many durations."""


def _compiled(model: Model, media: Media | None, prescribed: tuple[str, ...]) -> Network:
    """Return what `compile_network` does, made anew."""
    flat = Flat.of_model(model)
    if media is not None and media.irradiation:
        flat = replace(flat, loads=(*flat.loads, *absorbers(flat, media.irradiation)))
    driven = tuple(flat.names.find(p) for p in prescribed)
    for gas, environment in media.environments.items() if media is not None else ():
        for name in (gas, environment.vented):
            if name not in ("*", ""):
                flat.names.find(name, "environment" if name == gas else f"environment.{gas}, vented")
    nodes = tuple(n.path for n in flat.nodes if n.path not in driven)
    if not nodes:
        raise DeckError(
            "all temperatures are given, so nothing is left to solve. Remove a boundary or a prescribed node.",
            model.title,
            code="model.nothing-to-solve",
        )
    stores = {n.path: n.store for n in flat.nodes if n.store is not None and n.path in nodes}
    trace = conductors_with_trace(media or Media(), flat)
    network = Network(model.title, flat, nodes, (*flat.names.boundaries, *driven), media or Media(), driven, stores, trace)
    if media is not None:
        check_gas_laws(media, flat)
    for where, message in flat.radiation_into_gas(network.numbers().values):
        raise DeckError(message, where)
    return network


@dataclass(frozen=True, eq=False)
class Reduced:
    """A network after star-mesh elimination of massless nodes, with heat stores and controllers as nodes of their own.

    Parameters
    ----------
    nodes : tuple of str            The nodes that are left, in order.
    capacitances : dict             Node -> capacitance, None for a massless node that is left. [J/K]
    conductors : tuple              Rows between the nodes that are left and the boundaries.
    recover : tuple of (str, dict)  Eliminated node -> neighbour -> weight; in the order in which they can be computed.
    stored : dict                   Node that holds the heat of another, whose specific heat changes -> that other, and how it stores heat.
    controllers : dict              State of a controller -> where it begins; the last of the nodes.
    """

    nodes: tuple[str, ...]
    capacitances: Mapping[str, Number | None]
    conductors: tuple[ConductorRow, ...]
    recover: tuple[tuple[str, Mapping[str, Number]], ...]
    stored: Mapping[str, tuple[str, HeatStore]] = field(default_factory=dict)
    controllers: Mapping[str, Number | str] = field(default_factory=dict)

    def states(self, temperatures: Mapping[str, Any]) -> list[Any]:
        """Return the kernel's states in the order of `nodes` from temperatures of all nodes [K]: of a heat store its level."""
        held = {level_name: store.level(temperatures[node]) for level_name, (node, store) in self.stored.items()}
        return [held[n] if n in held else temperatures[n] for n in self.nodes]


HEAT_FOLLOWING_RATE: Final = 1e5
"""Rate at which a node follows the heat that it holds, where its specific heat changes: late by ten microseconds. [1/s]"""


def held_in(node: str) -> str:
    """Return the name ``<node> enthalpy`` of the extra node that holds the heat of a node whose specific heat changes."""
    return f"{node} enthalpy"


def with_stores(reduced: Reduced, stores: Mapping[str, HeatStore]) -> Reduced:
    """Return the network with an extra node of constant capacitance for each heat store.

    Its temperature is the store's level; a stiff conductor ties the node itself, now massless, to the temperature that belongs to it.
    """
    if not stores:
        return reduced
    capacitances, rows, stored = dict(reduced.capacitances), list(reduced.conductors), {}
    for node, store in stores.items():
        held, capacitance = held_in(node), capacitances[node]
        if capacitance is None:
            continue
        capacitances |= {node: None, held: capacitance}
        stored[held] = (node, store)
        tie = ConductorRow(held, (held, node), Law("potential", (HEAT_FOLLOWING_RATE * capacitance,)), store.curve)
        if store.melt is None:
            rows.append(tie)
            continue
        phase = state_of(node, PHASE)
        rows += [replace(tie, controls=(COMPLEMENT + phase,)), replace(tie, curve=store.melt.curve, controls=(phase,))]
    return Reduced(tuple(capacitances), capacitances, tuple(rows), reduced.recover, stored)


def with_controllers(reduced: Reduced, controls: Iterable[ControlRow]) -> Reduced:
    """Return the network with the states of its controllers, of capacitance one, appended to its nodes."""
    states = {state.name: state.begins for row in controls for state in row.states}
    if not states:
        return reduced
    capacitances = {**reduced.capacitances, **dict.fromkeys(states, 1.0)}
    return replace(reduced, nodes=(*reduced.nodes, *states), capacitances=capacitances, controllers=states)


def eliminable(numbers: Numbers, keep: frozenset[str] = frozenset()) -> tuple[str, ...]:
    """Return the massless nodes that star-mesh elimination can remove: without loads, joined by constant linear conductors alone.

    Nodes in `keep` stay.
    """
    loaded = {row.node for row in numbers.loads} | {row.sensor for row in numbers.loads}
    loaded |= {node for row in numbers.controls for node in row.followed}
    crooked = {end for row in numbers.conductors if row.form != "linear" or row.signal or row.controls for end in row.ends}
    return tuple(n for n, c in numbers.capacitances.items() if c is None and n not in loaded and n not in crooked and n not in keep)


def reduce_network(network: Network, numbers: Numbers, gone: tuple[str, ...]) -> Reduced:
    """Return the network after star-mesh elimination of the nodes `gone`: conductors g_i g_j / sum(g) between neighbours of each.

    Raises
    ------
    DeckError   When a massless node has no conductance to anything, so that its temperature is undefined.
    """
    if not gone:
        return Reduced(network.nodes, numbers.capacitances, numbers.conductors, ())
    rows_kept = [row for row in numbers.conductors if not set(row.ends) & set(gone)]
    mesh: dict[frozenset[str], Number] = {}
    for row in numbers.conductors:
        if set(row.ends) & set(gone) and row.ends[0] != row.ends[1]:  # two needs of a part may be bound to one node
            pair = frozenset(row.ends)
            mesh[pair] = mesh[pair] + row.coefficients[0] if pair in mesh else row.coefficients[0]
    recover: list[tuple[str, Mapping[str, Number]]] = []
    for node in gone:
        star = {next(iter(pair - {node})): g for pair, g in mesh.items() if node in pair}
        total: Number = reduce(add, star.values(), 0.0)
        if not value_of(total) > 0:
            where = next((n.where for n in network.flat.nodes if n.path == node), network.title)
            raise DeckError(
                f"the massless node '{node}' has no conductance to any node, so its temperature is undefined. Connect it.",
                where,
                code="model.massless-undefined",
            )
        mesh = {pair: g for pair, g in mesh.items() if node not in pair}
        ends = list(star)
        for i, a in enumerate(ends):
            for b in ends[i + 1 :]:
                pair, g = frozenset((a, b)), star[a] * star[b] / total
                mesh[pair] = mesh[pair] + g if pair in mesh else g
        recover.append((node, {k: g / total for k, g in star.items()}))
    order = {name: k for k, name in enumerate((*network.nodes, *network.boundaries))}
    for pair, g in mesh.items():
        a, b = sorted(pair, key=order.__getitem__)
        if a in network.boundaries:
            continue  # both ends are given: heat between them changes no unknown
        rows_kept.append(ConductorRow(f"mesh {a} {b}", (a, b), Law("linear", (g,))))
    nodes = tuple(n for n in network.nodes if n not in gone)
    return Reduced(nodes, {n: numbers.capacitances[n] for n in nodes}, tuple(rows_kept), tuple(reversed(recover)))


def _no_path(nodes: tuple[str, ...], rate: float) -> CodedText:
    """Return the finding in words that nodes have no path to a boundary, and how fast they warm or cool: power over capacitance [K/s]."""
    named, many = ", ".join(f"'{n}'" for n in nodes), len(nodes) > 1
    still = f", so {'the heat stays there' if many else 'its temperature stays where it starts'}"
    course = f": {'warm' if rate > 0 else 'cool'}{'' if many else 's'} at {abs(rate) * 3600:.6g} K/h without limit"
    follows = still if abs(rate) < 1e-12 else course
    return CodedText(f"{named} {'have' if many else 'has'} no path to a boundary{follows}", "model.no-path-to-boundary")


def unreached(network: Network, numbers: Numbers, power: Callable[[str], float]) -> dict[tuple[str, ...], CodedText]:
    """Return the groups of nodes that are joined to one another but to no boundary, each with what is said of it.

    Parameters
    ----------
    power : callable    Load -> mean power. [W]
    """
    if network.flat.names.model.runner is not None:  # what joins the nodes of somebody else's program is not known
        return {}
    joined: dict[str, set[str]] = {n: set() for n in (*network.nodes, *network.boundaries)}
    for row in numbers.conductors:
        if value_of(row.coefficients[0]) not in (0.0, TRACE):
            a, b = row.ends
            joined[a].add(b)
            if row.form != "flow":  # a stream carries the temperature of its first end alone
                joined[b].add(a)
    isolated = set(network.nodes) - reached(network.boundaries, joined)
    joined = {n: {m for m in isolated if m in joined[n] or n in joined[m]} for n in isolated}
    out = {}
    while isolated:
        first = next(n for n in network.nodes if n in isolated)
        group = reached((first,), joined) & isolated
        isolated -= group
        members = tuple(n for n in network.nodes if n in group)
        heat = sum(power(load.path) for load in network.flat.loads if load.node in members)
        capacity = sum(value_of(c) for n in members if (c := numbers.capacitances.get(n)) is not None)
        if capacity > 0:
            out[members] = _no_path(members, heat / capacity)
    return out


def without_gas(network: Network, numbers: Numbers) -> tuple[str, ...]:
    """Return the inner nodes that stand for a gas that is not there in the whole run: they have no temperature.

    Nodes into which a load puts power, and those that something but gas joins to others, keep theirs.
    """
    kept = {load.node for load in network.flat.loads}
    kept |= {end for row in numbers.conductors if value_of(row.coefficients[0]) not in (0.0, TRACE) for end in row.ends}
    gases = network.flat.gas_nodes - kept
    return tuple(n for n in network.nodes if n in gases and network.media.empty(n))
