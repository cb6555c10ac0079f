"""The tree laid flat: every node, conductor and load with canonical names, still in terms of parameters; its gas nodes and its streams."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np

from thermid.base.errors import CodedText, DeckError, NameNotFoundError, errors_at, quoted, refuse_unknown
from thermid.base.units import Number, require, require_unit, value_of
from thermid.model._laws.signal import Signal
from thermid.model._laws.stores import Curve, HeatStore, potential, store
from thermid.model._parts.controls import COMPLEMENT, Control, ModeChange, named_control, of_difference, slot_of
from thermid.model._parts.elements import CARRIED_BY, KINDS, LOAD_SLOTS, NODE_SLOTS, Facing, HeatLoad, Joint, Law, MadeIn, Surface, Take
from thermid.model._parts.enclosures import Enclosed, Face, FaceExchange, pairs
from thermid.model._parts.ranges import RANGES, Range, outside, range_of
from thermid.model._tree.tree import Names, ParameterSet, Tree
from thermid.physics.gas import GASES

BALANCED: Final = 1e-3
"""Share of a node's flow that may be missing: flows are written with three digits or more. [-]"""
WALLS = ("walls", "air and walls")
"""What a node stands for that radiation can reach."""


@dataclass(frozen=True)
class FlatNode:
    """A node: field -> parameter path; empty fields for an arithmetic node; how it stores heat where that changes with temperature."""

    path: str
    fields: Mapping[str, str]
    reference_point: bool = False
    where: str = ""
    store: HeatStore | None = None
    stands_for: str = ""

    def capacitance(self, values: Mapping[str, Any]) -> Any:
        """Return m c, or C where that is given, at values (path -> value, SI); None for a massless node. [J/K]"""
        if not self.fields:
            return None
        if "capacitance" in self.fields:
            return values[self.fields["capacitance"]]
        mass = values[self.fields["mass"]]
        return mass * (self.store.reference if self.store is not None else values[self.fields["specific_heat"]])


@dataclass(frozen=True)
class FlatConductor:
    """A conductor: field -> parameter path, the area that joints take from it, and a factor on its conductance.

    `recipe` stands in for that of its kind where a pair's law needs more than its own fields. `sees` is what an effective coefficient
    leaves its radiation to without gas, by a conductor of its own, where that is not the gas node.
    """

    path: str
    kind: str
    ends: tuple[str, str]
    fields: Mapping[str, str]
    curve: Curve | None = None
    takes: tuple[Take, ...] = ()
    factor: float = 1.0
    gas: str = ""
    emissivity: str = ""
    sees: str = ""
    where: str = ""
    recipe: Callable[[Mapping[str, Any]], Law | tuple[Law, ...]] | None = None
    words: Mapping[str, str] = field(default_factory=dict)
    controls: tuple[str, ...] = ()
    reversible: bool = False

    def laws(self, fields: Mapping[str, Any]) -> tuple[Law, ...]:
        """Return the rows that it is at the values of its fields (float or Dual, SI).

        Raises
        ------
        DeckError   When values do not go together, or a coefficient is not finite.
        """
        try:
            built = (self.recipe or KINDS[self.kind].recipe)(fields)
        except ArithmeticError as error:
            raise DeckError(
                f"'{self.path}' has no finite conductance: {error}. Check the sizes of its values.",
                self.where,
                code="expression.no-finite-value",
            ) from None
        laws = built if isinstance(built, tuple) else (built,)
        if not all(is_finite(number) for law in laws for number in law.coefficients):
            raise DeckError(
                f"'{self.path}' has no finite conductance. Check the sizes of its values.", self.where, code="expression.no-finite-value"
            )
        return laws

    @property
    def carried_by_solid(self) -> bool:
        """Return whether a solid carries the heat behind its constant coefficient, whatever becomes of the gas."""
        return self.words.get(CARRIED_BY) in ("cold plate", "leads")

    @property
    def fluid(self) -> str:
        """Return the fluid of a stream: a gas, liquid, or empty where it names none."""
        return self.words.get("fluid", "")

    @property
    def by_volume(self) -> bool:
        """Return whether a stream is written as a flow of volume."""
        return "volume_flow" in self.fields

    def flow(self, values: Mapping[str, Any]) -> Any:
        """Return the flow of a stream: mass_flow or volume_flow * density [kg/s]; volume_flow [m^3/s] where no density is written."""
        flow = value_of(values[self.fields["volume_flow" if self.by_volume else "mass_flow"]])
        return flow * value_of(values[self.fields["density"]]) if "density" in self.fields else flow


@dataclass(frozen=True)
class FlatLoad:
    """A heat load: field -> parameter path; one that a surface absorbs has the area that joints take, and its flux by the boundaries.

    `recipe` gives what of a flux is absorbed where reflections between faces count [m^2]. The factor on its power is ``scale.<path>``, or
    ``scale.<scale>`` of all loads that share one.
    """

    path: str
    node: str
    sensor: str
    fields: Mapping[str, str]
    curve: Curve | None = None
    where: str = ""
    takes: tuple[Take, ...] = ()
    flux: Callable[[Mapping[str, Signal]], Signal] | None = None
    controls: tuple[str, ...] = ()
    cycle: Signal | None = None
    recipe: Callable[[Mapping[str, Any]], Any] | None = None
    scale: str = ""

    @property
    def follows_temperature(self) -> bool:
        """Whether its power changes with a temperature other than by being switched."""
        laws = ("proportional.setpoint", "command_curve")
        return bool(self.controls) or self.curve is not None or any(f in laws or f.endswith("_coefficient") for f in self.fields)


@dataclass(frozen=True)
class FlatControl:
    """A control: canonical nodes with their weights, field -> parameter path; of transitions the nodes that they follow."""

    path: str
    control: Control
    follows: tuple[tuple[str, float], ...]
    fields: Mapping[str, str]
    ways: Mapping[str, tuple[tuple[str, float], ...]] = field(default_factory=dict)
    where: str = ""

    @property
    def has_history(self) -> bool:
        """Whether what it gives depends on more than the temperatures of the moment."""
        return self.control.kind in ("thermostat", "modes", "pid") or bool(self.control.sample)

    def transition(self, name: str) -> tuple[ModeChange, tuple[tuple[str, float], ...]]:
        """Return the named transition and the (node, weight) pairs that it follows."""
        return self.control.transitions[name], self.ways[name]


@dataclass(frozen=True)
class FlatSurface:
    """A surface as radiation from outside meets it: field -> parameter path; what it sees, nothing where that is an enclosure's faces.

    `exchange` is htc or effective_htc, whichever it has, or empty; `controls` those of its emissivity.
    """

    node: str
    to: str
    fields: Mapping[str, str]
    takes: tuple[Take, ...] = ()
    facing: Facing | None = None
    sees: str = ""
    where: str = ""
    exchange: str = ""
    controls: tuple[str, ...] = ()
    enclosed: Enclosed | None = None


@dataclass(frozen=True)
class Flat:
    """A tree laid flat.

    Parameters
    ----------
    names : Names                       Canonical nodes and boundaries.
    parameters : ParameterSet           Every value by path.
    nodes, conductors, loads : tuple    The elements.
    surfaces : dict                     Surface path -> its area's parameter path and what joints take from it.
    faces : dict                        Surface path -> the surface as radiation from outside meets it.
    made_in : tuple                     Title of a reduced part, gas node or ``*``, the state that it was made in, and where that stands.
    controls : dict                     Control path -> the control.
    ranges : dict                       Parameter path -> the values that it may have, and the unit of its slot.
    """

    names: Names
    parameters: ParameterSet
    nodes: tuple[FlatNode, ...]
    conductors: tuple[FlatConductor, ...]
    loads: tuple[FlatLoad, ...]
    surfaces: Mapping[str, tuple[str, tuple[Take, ...]]] = field(default_factory=dict)
    faces: Mapping[str, FlatSurface] = field(default_factory=dict)
    made_in: tuple[tuple[str, str, MadeIn, str], ...] = ()
    controls: Mapping[str, FlatControl] = field(default_factory=dict)
    ranges: Mapping[str, tuple[Range, str]] = field(default_factory=dict)

    def impossible(self, values: Mapping[str, Any], paths: Iterable[str]) -> Iterator[tuple[str, str, str]]:
        """Yield path, place and message of each of some parameters whose value physics forbids.

        Parameters
        ----------
        values : dict       Parameter path -> value, also with derivatives or of members. [SI]
        paths : iterable    Parameters to look at.
        """
        for path in paths:
            if path in self.ranges and not allows(self.ranges[path][0], values[path]):
                written = self.parameters.literal_behind(path)
                yield path, self.parameters.table[written].where, outside(*self.ranges[path], values[path], path)

    @property
    def gas_nodes(self) -> frozenset[str]:
        """Return the inner nodes that are gas: declared as air, or convected to without being a solid.

        Surfaces, gaps of joints and leads name the gas that takes their convection. A node that has a surface of its own is a solid.
        A boundary is none of these: it is the air of a large room and its walls alike.
        """
        around = self.convection_ends
        return frozenset(n.path for n in self.nodes if n.stands_for == "air" or (n.path in around and n.stands_for not in WALLS))

    def radiation_into_gas(self, values: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
        """Yield (place, message) for each gas node that surfaces, leads, conductors or enclosures (by their rest) radiate into.

        What has a factor of 0 radiates nothing.

        Parameters
        ----------
        values : dict   Parameter path -> value. [SI]
        """
        gases = self.gas_nodes
        out: dict[str, dict[str, None]] = {}
        if not gases:
            return
        faces = {path: (face.sees, face.fields.get("emissivity", "")) for path, face in self.faces.items()}
        leads = {_lead(c.path): (c.gas, c.fields["emissivity"]) for c in self.conductors if c.kind == "lead" and "emissivity" in c.fields}
        for path, (node, emissivity) in (faces | leads).items():
            if node in gases and emissivity and values[emissivity] != 0.0:
                out.setdefault(node, {})[path] = None
        for c in self.conductors:
            path = c.path.removesuffix(".radiation")
            if c.kind == "radiation" and path not in self.faces:
                factor = next((values[c.fields[f]] for f in ("emissivity", "exchange_factor") if f in c.fields), 1.0)
                enclosure = path.rpartition(".")[0].rpartition(".")[0] if c.recipe is not None else path
                for node in gases & set(c.ends) if factor != 0.0 else ():
                    out.setdefault(node, {})[enclosure] = None
        for node, paths in out.items():
            radiates, sees = ("radiate", "they see") if len(paths) > 1 else ("radiates", "it sees")
            message = (
                f"{quoted(list(paths))} {radiates} to '{node}', which is gas, and gas does not absorb radiation here. Name the wall that "
                f"{sees}, sees = ...; define an enclosure; bind the need of a part separately, "
                f'bind = {{ need = {{ to = "{node}", sees = "..." }} }}; or, where \'{node}\' is one node for the air and the walls around '
                'it, stands_for = "air and walls" (a solid: stands_for = "walls").'
            )
            yield next(n.where for n in self.nodes if n.path == node), CodedText(message, "model.radiates-into-gas")

    @property
    def without_emissivity(self) -> dict[str, str]:
        """Return surface or lead -> its gas node, of those that have htc but no emissivity: a run in vacuum refuses them."""
        solid = {c.path for c in self.conductors if c.carried_by_solid}
        bare = {path: face.to for path, face in self.faces.items() if face.exchange == "htc" and "emissivity" not in face.fields}
        faces = {path: gas for path, gas in bare.items() if path not in solid}
        leads = {_lead(c.path): c.gas for c in self.conductors if c.kind == "lead" and "htc" in c.fields and "emissivity" not in c.fields}
        return faces | leads

    @property
    def without_convection(self) -> dict[str, str]:
        """Return surface -> its gas node, of those outside enclosures with an emissivity but no htc: a run with gas refuses them."""
        return {p: face.to for p, face in self.faces.items() if not face.exchange and face.sees and "emissivity" in face.fields}

    @property
    def convection_ends(self) -> frozenset[str]:
        """Return the nodes, boundaries among them, that surfaces, gaps and leads convect to, and that have no surface of their own."""
        gases = {face.to for face in self.faces.values() if face.exchange}
        gases |= {c.gas for c in self.conductors if (c.path.endswith(".gap") and c.kind == "convection") or c.kind in ("duct", "heat_sink")}
        gases |= {c.gas for c in self.conductors if c.kind == "lead" and {"htc", "effective_htc"} & set(c.fields)}
        return frozenset(gases) - {face.node for face in self.faces.values()}

    def unbalanced_streams(self, values: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
        """Yield (place, message) for each node whose streams do not balance, where a stream names its fluid or the node is gas.

        What enters a node and is not passed on leaves it unwritten, at its temperature: the last node of a line. A boundary gives and
        takes.

        Parameters
        ----------
        values : dict   Parameter path -> value. [SI]
        """
        inner, gases = {n.path for n in self.nodes}, self.gas_nodes
        joined: dict[str, list[FlatConductor]] = {}
        for c in streams_of(self.conductors):
            for end in c.ends:
                joined.setdefault(end, []).append(c)
        for node in joined:
            for fluid, several in _by_fluid(joined[node]).items() if node in inner else ():
                into = [c for c in several if c.ends[1] == node]
                out = [c for c in several if c.ends[0] == node]
                if out and (fluid or (into and node in gases)):  # of one without fluid that none feeds, `unfed_streams` speaks
                    yield from _met(node, several)
                    yield from _unbalanced(node, into, out, values)

    @property
    def unfed_streams(self) -> dict[str, str]:
        """Return stream -> warning, of each stream that names no fluid and leaves a gas node that no stream enters."""
        streams = streams_of(self.conductors)
        empty = self.gas_nodes - {c.ends[1] for c in streams}
        return {
            c.path: CodedText(
                f"'{c.path}' takes no heat from '{c.ends[0]}', because no stream enters there. Add the inlet stream, and name the "
                "fluid of both",
                "model.stream-unfed",
            )
            for c in streams
            if not c.fluid and c.ends[0] in empty
        }

    @staticmethod
    def of_model(model: Tree) -> Flat:
        """Return the tree laid flat, with every name resolved and every unit checked.

        Raises
        ------
        ThermidError   With file and key path of the first thing that does not fit.
        """
        return model.memo.value("flat", lambda: _laid_flat(model))


def allows(allowed: Range, number: Any) -> bool:
    """Return whether a number lies in a range; one with derivatives by its value, one of members if all of them do."""
    value: Any = value_of(number)
    return bool(allowed.low <= value <= allowed.high) and not (allowed.nonzero and value == 0.0)


def _laid_flat(model: Tree) -> Flat:
    """Return what `Flat.of_model` remembers."""
    names, parameters = Names(model), ParameterSet(model)
    takes = _takes(model, names)
    enclosed, inside = _enclosures(model, names, takes)
    nodes: list[FlatNode] = []
    conductors: list[FlatConductor] = []
    loads: list[FlatLoad] = []
    controls: dict[str, FlatControl] = {}
    surfaces: dict[str, tuple[str, tuple[Take, ...]]] = {}
    faces: dict[str, FlatSurface] = {}
    for owner, prefix in model.walk():
        for name, node in owner.nodes.items():
            fields = {f: f"{prefix}{name}.{f}" for f in node.fields}
            with errors_at(owner.where(f"nodes.{name}")):
                heat = store(*node.table, node.supercooling) if node.table else None
            nodes.append(FlatNode(prefix + name, fields, node.reference_point, owner.where(f"nodes.{name}"), heat, node.stands_for))
        for name, joint in owner.joints.items():
            mid = prefix + (joint.mid or f"{name}.mid")
            nodes.append(FlatNode(mid, {}, False, owner.where(f"joints.{name}")))
            conductors += _joint(owner, prefix, name, joint, mid, names)
        for name, surface in owner.surfaces.items():
            taken = tuple(takes.get(prefix + name, ()))
            surfaces[prefix + name] = (f"{prefix}{name}.area", taken)
            conductors += _surface(owner, prefix, name, surface, taken, names, prefix + name in enclosed)
            face = _face(owner, prefix, name, surface, taken, names, prefix + name in enclosed)
            faces[prefix + name] = replace(face, enclosed=enclosed.get(prefix + name))
        for name, c in owner.conductors.items():
            key = f"conductors.{name}"
            at = names.node_seen if c.kind == "radiation" else names.end
            ends = (at(owner, prefix, c.between[0], key), at(owner, prefix, c.between[1], key))
            fields = {f: f"{prefix}{name}.{f}" for f in c.fields}
            gas = names.end(owner, prefix, c.words["to"], f"{key}.to") if "to" in c.words else ""
            gas = gas or next((e for e in reversed(ends) if e in names.boundaries), ends[1])
            law = potential(c.curve) if c.curve is not None and KINDS[c.kind].tabulated else c.curve
            conductor = FlatConductor(prefix + name, c.kind, ends, fields, law, gas=gas, where=owner.where(key), words=c.words)
            conductor = replace(conductor, controls=_controls(owner, prefix, c.controls, key), reversible=c.reversible)
            conductors += [conductor, *_losses(conductor)]
        for name, load in owner.loads.items():
            loads.append(_load(owner, prefix, name, load, names))
        for name, control in owner.controls.items():
            controls[prefix + name] = _control(owner, prefix, name, control, names)
    made_in = tuple(
        (owner.title, gas if gas == "*" else names.end(owner, prefix, gas, f"made_in.{gas}"), state, owner.where(f"made_in.{gas}"))
        for owner, prefix in model.walk()
        for gas, state in owner.made_in.items()
    )
    flat = Flat(names, parameters, tuple(nodes), (*conductors, *inside), tuple(loads), surfaces, faces, made_in, controls)
    ranges: dict[str, tuple[Range, str]] = {}
    for path, kind, name, slot in _slots(flat, model):
        ranges.setdefault(path, (range_of(kind, name, slot), slot))
    return replace(flat, ranges=ranges)


def _takes(model: Tree, names: Names) -> dict[str, list[Take]]:
    """Return surface path -> what each joint or conductor takes from it."""
    out: dict[str, list[Take]] = {}
    for owner, prefix in model.walk():
        for name, joint in owner.joints.items():
            for end in joint.between:
                path, _, _ = names.surface(owner, prefix, end, f"joints.{name}")
                out.setdefault(path, []).append(Take(prefix + name, f"{prefix}{name}.area", "contact"))
                if joint.gap_to:
                    out[path].append(Take(prefix + name, f"{prefix}{name}.gap.area", "gap"))
        for name, conductor in owner.conductors.items():
            for end in conductor.takes:
                path, _, _ = names.surface(owner, prefix, end, f"conductors.{name}.takes")
                out.setdefault(path, []).append(Take(prefix + name, f"{prefix}{name}.area", "contact"))
    return out


def _enclosures(model: Tree, names: Names, takes: Mapping[str, list[Take]]) -> tuple[dict[str, Enclosed], list[FlatConductor]]:
    """Return surface -> its place in the enclosure that it is a face of, and the radiation between the faces of every enclosure."""
    enclosed: dict[str, Enclosed] = {}
    out = []
    for owner, prefix in model.walk():
        for name, enclosure in owner.enclosures.items():
            key = f"enclosures.{name}"
            faces: list[Face] = []
            for face, raw in enclosure.faces.items():
                path, part, part_prefix = names.surface(owner, prefix, raw, f"{key}.faces.{face}")
                surface = part.surfaces[path.rpartition(".")[2]]
                if path in enclosed or path in [f.path for f in faces]:
                    first = enclosed[path].exchange.path if path in enclosed else prefix + name
                    raise DeckError(
                        f"'{raw}' is a face of '{first}' already, so its radiation would count twice. "
                        "List the surface in one enclosure only.",
                        owner.where(key),
                        code="value.contradicts",
                    )
                node = names.end(part, part_prefix, surface.of, key)
                faces.append(Face(face, path, surface, node, tuple(takes.get(path, ()))))
            rest = names.node_seen(owner, prefix, enclosure.rest, f"{key}.rest") if enclosure.rest else ""
            exchange = FaceExchange(prefix + name, enclosure, faces, bool(rest), owner.where(key))
            enclosed |= {f.path: Enclosed(k, exchange, rest) for k, f in enumerate(faces)}
            for pair in pairs(exchange, rest):
                out.append(FlatConductor(pair.path, "radiation", pair.ends, pair.fields, where=owner.where(key), recipe=pair.recipe))
    return enclosed, out


def _surface(
    owner: Tree, prefix: str, name: str, surface: Surface, takes: tuple[Take, ...], names: Names, enclosed: bool
) -> list[FlatConductor]:
    """Return the conductors that a surface stands for: what convects, and what radiates when that is apart and no enclosure has it."""
    key = f"surfaces.{name}"
    path = prefix + name
    by = {what: _controls(owner, prefix, several, key) for what, several in surface.controls.items()}
    a, b = names.end(owner, prefix, surface.of, key), names.end(owner, prefix, surface.to, key)
    fields = {f: f"{path}.{f}" for f in surface.fields}
    out = []
    emissivity = fields.pop("emissivity", "")
    fields.pop("absorptance", "")
    if surface.is_effective:
        sees = names.node_seen(owner, prefix, surface.sees or surface.to, key)
        held = FlatConductor(path, "effective", (a, b), fields, None, takes, gas=b, emissivity=emissivity, where=owner.where(key))
        held = replace(held, controls=by.get("htc", ()), words=surface.words)
        if not emissivity or sees == b or held.carried_by_solid:
            return [held]
        radiating_without_gas = {"emissivity": emissivity, "area": fields["area"]}
        return [
            replace(held, sees=sees),
            FlatConductor(
                f"{path}.radiation",
                "radiation",
                (a, sees),
                radiating_without_gas,
                None,
                takes,
                gas=b,
                where=owner.where(key),
                recipe=_radiation_without_gas,
                words=surface.words,
            ),
        ]
    if len(fields) > 1:
        conductor = FlatConductor(path, "convection", (a, b), fields, None, takes, gas=b, where=owner.where(key), words=surface.words)
        out.append(replace(conductor, controls=by.get("htc", ())))
    if emissivity and not enclosed:
        to = names.node_seen(owner, prefix, surface.sees or surface.to, key)
        radiating = {"emissivity": emissivity, "area": fields["area"]}
        conductor = FlatConductor(f"{path}.radiation", "radiation", (a, to), radiating, None, takes, where=owner.where(key))
        out.append(replace(conductor, controls=by.get("emissivity", ())))
    if enclosed and by.get("emissivity"):
        raise DeckError(
            "a face of an enclosure needs a constant emissivity, because all exchange factors depend on it. Give a number, or take "
            "the face out of the enclosure.",
            owner.where(key),
            code="model.law-refused",
        )
    return out


def _face(owner: Tree, prefix: str, name: str, surface: Surface, takes: tuple[Take, ...], names: Names, enclosed: bool) -> FlatSurface:
    """Return what sun and sky need of a surface: node, gas, area and optical fields, facing, and what it sees."""
    key = f"surfaces.{name}"
    fields = {f: f"{prefix}{name}.{f}" for f in ("area", "emissivity", "absorptance") if f in surface.fields}
    to = names.end(owner, prefix, surface.to, key)
    sees = "" if enclosed else names.node_seen(owner, prefix, surface.sees or surface.to, key)
    exchange = next((f.partition(".")[0] for f in surface.fields if f.partition(".")[0] in ("htc", "effective_htc")), "")
    by = _controls(owner, prefix, surface.controls.get("emissivity", ()), key)
    return FlatSurface(names.end(owner, prefix, surface.of, key), to, fields, takes, surface.facing, sees, owner.where(key), exchange, by)


def _radiation_without_gas(fields: Mapping[str, Any]) -> Law:
    """Return the radiation row of a surface with an effective coefficient, marked to act only where its gas is gone."""
    law = KINDS["radiation"].recipe(fields)
    assert isinstance(law, Law)
    return replace(law, medium="left")


def _joint(owner: Tree, prefix: str, name: str, joint: Joint, mid: str, names: Names) -> list[FlatConductor]:
    """Return the conductors that a joint stands for: two half-contacts and, with a gap, its loss to the air."""
    key, path = f"joints.{name}", prefix + name
    out = []
    kind = "contact" if "contact_conductance" in joint.fields else "conduction"
    wanted = {f: f"{path}.{f}" for f in joint.fields if not f.startswith("gap.")}
    for which, raw in zip(("first", "second"), joint.between, strict=True):
        _, part, part_prefix = names.surface(owner, prefix, raw, key)
        surface_name = owner.canonical(raw).rpartition(".")[2]
        node = names.end(part, part_prefix, part.surfaces[surface_name].of, key)
        out.append(FlatConductor(f"{path}.{which}", kind, (node, mid), wanted, where=owner.where(key)))
    if joint.gap_to:
        to = names.end(owner, prefix, joint.gap_to, key)
        fields = {"htc": f"{path}.gap.htc", "area": f"{path}.gap.area"}
        out.append(FlatConductor(f"{path}.gap", "convection", (mid, to), fields, factor=2.0, gas=to, where=owner.where(key)))
    return out


def _losses(conductor: FlatConductor) -> list[FlatConductor]:
    """Return what both ends of a lead lose to its surroundings; an end that is these loses nothing."""
    if KINDS[conductor.kind].loss is None:
        return []
    if "to" not in conductor.words:
        if {"htc", "effective_htc", "emissivity"} & set(conductor.fields):
            raise DeckError(
                'the lead loses heat along its length, but no node takes it. Name the node: to = "air".',
                conductor.where,
                code="value.incomplete",
            )
        return []
    if {"htc", "effective_htc"} <= set(conductor.fields):
        raise DeckError(
            "give a lead either htc (convection alone) or effective_htc (convection and radiation together), not both.",
            conductor.where,
            code="value.excludes-another",
        )
    sides = zip(("first", "second"), conductor.ends, strict=True)
    return [
        replace(conductor, path=f"{conductor.path}.{which}", ends=(end, conductor.gas), recipe=KINDS[conductor.kind].loss)
        for which, end in sides
        if end != conductor.gas
    ]


def _load(owner: Tree, prefix: str, name: str, load: HeatLoad, names: Names) -> FlatLoad:
    """Return a load with canonical node, sensor and controls."""
    key = f"loads.{name}"
    node = names.end(owner, prefix, load.into, key)
    sensor = names.end(owner, prefix, load.sensor, key) if load.sensor else node
    fields = {f: f"{prefix}{name}.{f}" for f in load.fields}
    cycle = load.cycle.signal() if load.cycle is not None else None
    by = _controls(owner, prefix, load.controls, key)
    return FlatLoad(prefix + name, node, sensor, fields, load.curve, owner.where(key), controls=by, cycle=cycle)


def _controls(owner: Tree, prefix: str, raw: Sequence[str], key: str) -> tuple[str, ...]:
    """Return the canonical paths of controls by the names that an element gives them, ``1 - path`` where the rest of one is taken.

    Raises
    ------
    NameNotFoundError   When there is no such control, here or in a part.
    """
    out: list[str] = []
    for written in raw:
        name, rest = named_control(written)
        path = owner.canonical(name)
        head, _, tail = path.rpartition(".")
        part = owner.submodel(head) if head else owner
        refuse_unknown(
            [tail],
            part.controls,
            owner.where(f"{key}.control"),
            f"no control '{name}'.{{near}} Declare it under controls.",
            NameNotFoundError,
        )
        if prefix + path in {named_control(c)[0] for c in out}:
            raise DeckError(f"the control '{name}' is named twice. Remove one of them.", owner.where(f"{key}.control"), code="name.taken")
        out.append(f"{COMPLEMENT}{prefix}{path}" if rest else prefix + path)
    return tuple(out)


def _control(owner: Tree, prefix: str, name: str, control: Control, names: Names) -> FlatControl:
    """Return a control with the canonical nodes that it and its transitions follow."""
    key = f"controls.{name}"

    def nodes(follows: Mapping[str, float], at: str) -> tuple[tuple[str, float], ...]:
        """Return paths of nodes with their weights, read from a row at `at`."""
        return tuple((names.end(owner, prefix, node, at), weight) for node, weight in follows.items())

    followed = nodes(control.follows, f"{key}.follows")
    ways = {n: nodes(t.follows, f"{key}.transitions.{n}") or followed for n, t in control.transitions.items()}
    return FlatControl(prefix + name, control, followed, {f: f"{prefix}{name}.{f}" for f in control.fields}, ways, owner.where(key))


def _slots(flat: Flat, model: Tree) -> Iterator[tuple[str, str, str, str]]:
    """Yield path, kind, field and unit of the slot of every element's value, once its dimension is that of the slot.

    Raises
    ------
    ThermidError   When a value has another dimension, at the place where it was written.
    """
    fitting: set[tuple[str, str]] = set()  # units that fit a slot

    def slot(path: str, kind: str, name: str, unit: str) -> tuple[str, str, str, str]:
        """Return a place that a fitting law needs, once its parameter has the unit."""
        _require(fitting, flat.parameters, path, unit)
        return path, kind, name, unit

    for node in flat.nodes:
        for name, path in node.fields.items():
            yield slot(path, "", name, NODE_SLOTS[name])
    for conductor in flat.conductors:
        kind, slots = "reversible" if conductor.reversible else conductor.kind, KINDS[conductor.kind].slots
        for name, path in conductor.fields.items():
            field_name = name if name in slots else name.rpartition(".")[2]  # of the faces of a pair: face.area, face.emissivity
            yield slot(path, kind, field_name, slots.get(field_name, "1"))
        if conductor.emissivity:
            yield slot(conductor.emissivity, "", "emissivity", "1")
    for load in flat.loads:
        for name, path in load.fields.items():
            yield slot(path, "", name, LOAD_SLOTS[name])
    for control in flat.controls.values():
        for name, path in control.fields.items():
            way = control.control.transitions.get(name.split(".")[1]) if name.startswith("transitions.") else None
            follows = way.follows if way is not None and way.follows else control.control.follows
            yield slot(path, "", name, slot_of(name, of_difference(follows)))
    for face in flat.faces.values():
        for name in sorted({"absorptance", "emissivity"} & set(face.fields)):
            yield slot(face.fields[name], "", name, "1")
    for area, takes in flat.surfaces.values():
        for path in (area, *(take.path for take in takes)):
            yield slot(path, "", "area", "m^2")
    for owner, prefix in model.walk():
        for part, submodel in owner.submodels.items():
            for name in submodel.model.parameters:
                if f"{submodel.made}.{name}" in RANGES:
                    yield f"{prefix}{part}.{name}", submodel.made, name, "1"


def _require(fitting: set[tuple[str, str]], parameters: ParameterSet, path: str, slot: str) -> None:
    """Refuse a value whose dimension is not that of its slot; (unit, slot) pairs found to fit are added to `fitting`."""
    entry = parameters.table[parameters.literal_behind(path)]
    literal = entry.parameter.expression.literal
    if literal is None or (literal.unit.text, slot) not in fitting:
        with errors_at(entry.where):
            if literal is not None:
                require_unit(literal.unit, slot)
                fitting.add((literal.unit.text, slot))
            else:
                require(parameters.dimension(path), slot)


def _lead(path: str) -> str:
    """Return the path of a lead from that of the loss at one of its ends."""
    return path.removesuffix(".first").removesuffix(".second")


def streams_of(conductors: Iterable[FlatConductor]) -> tuple[FlatConductor, ...]:
    """Return the conductors of kind `flow` that join two different nodes."""
    return tuple(c for c in conductors if c.kind == "flow" and c.ends[0] != c.ends[1])


def _unbalanced(
    node: str, into: Sequence[FlatConductor], out: Sequence[FlatConductor], values: Mapping[str, Any]
) -> Iterator[tuple[str, str]]:
    """Yield (place, message) where the flows into a node and out of it differ by more than `BALANCED`, for any shares of controls."""
    entering, leaving = (sum((c.flow(values) for c in part), start=0.0) for part in (into, out))
    sums: dict[tuple[str, ...], Any] = {}
    most: Any = 0.0
    for sign, part in ((1.0, into), (-1.0, out)):
        for c in part:
            flow = c.flow(values)
            most = most + (flow * flow) ** 0.5
            for names, weight in _products(c.controls):
                sums[names] = sums.get(names, 0.0) + sign * weight * flow
    if any(gap * gap > (BALANCED * most) * (BALANCED * most) for gap in sums.values()):
        by = sorted({name for names in sums for name in names})
        driven = f", which is not one and the same whatever {quoted(by)} {'give' if len(by) > 1 else 'gives'}" if by else ""
        text = (
            f"'{node}' takes in {_flow_text(into, entering, values)} and passes on {_flow_text(out, leaving, values)}{driven}. "
            "The flows into and out of a node must be equal. Correct them, or add the missing stream from or to a boundary such as "
            "the ambient. Use one parameter for all streams of a line: the balance then holds in fits and schedules too."
        )
        yield out[0].where, CodedText(text, "model.streams-unbalanced")


def _products(controls: Sequence[str]) -> list[tuple[tuple[str, ...], float]]:
    """Return the product of controls expanded to a sum of (names multiplied, factor): x (1 - y) is [(x), 1], [(x, y), -1]."""
    out: list[tuple[tuple[str, ...], float]] = [((), 1.0)]
    for written in controls:
        name, rest = named_control(written)
        taken = [(tuple(sorted((*names, name))), -weight if rest else weight) for names, weight in out]
        out = [*out, *taken] if rest else taken
    return out


def _by_fluid(streams: Sequence[FlatConductor]) -> dict[str, list[FlatConductor]]:
    """Return fluid -> streams of a node: all gas in one, with a stream that names no fluid beside it; a liquid apart."""
    gas = any(c.fluid in GASES for c in streams)
    out: dict[str, list[FlatConductor]] = {}
    for c in streams:
        fluid = c.fluid
        out.setdefault("gas" if fluid in GASES or (gas and not fluid) else fluid, []).append(c)
    return out


def _met(node: str, streams: Sequence[FlatConductor]) -> Iterator[tuple[str, str]]:
    """Yield (place, message) where two gases meet in a node, or flows of volume meet flows of mass."""
    gases = {c.fluid: c for c in streams if c.fluid}
    if len(gases) > 1:
        (one, a), (two, b) = list(gases.items())[:2]
        text = f"{one} ('{a.path}') and {two} ('{b.path}') meet in '{node}'. Mixtures are not modelled. Give both streams the same fluid."
        yield b.where, CodedText(text, "model.streams-differ")
    kinds = {c.by_volume and "density" not in c.fields: c for c in streams}
    if len(kinds) > 1:
        text = (
            f"in '{node}' the volume of '{kinds[True].path}' meets the mass of '{kinds[False].path}', whose balance closes at one pressure "
            "and temperature at most. Write streams that meet all as volume_flow or all as mass_flow."
        )
        yield kinds[False].where, CodedText(text, "model.streams-differ")


def _flow_text(streams: Sequence[FlatConductor], flow: Any, values: Mapping[str, Any]) -> str:
    """Return a flow as text with the names of its streams: g/s, or l/min where all are flows of volume; of members the first one's."""
    if not streams:
        return "nothing"
    volume = all(c.by_volume for c in streams)
    size = sum((value_of(values[c.fields["volume_flow"]]) for c in streams), start=0.0) if volume else flow
    plain = float(np.asarray(getattr(size, "values", size)).ravel()[0])
    text = f"{6e4 * plain:.4g} l/min" if volume else f"{1e3 * plain:.4g} g/s"
    return f"{text} ({', '.join(repr(c.path) for c in streams)})"


def is_finite(number: Number) -> bool:
    """Return whether a number is finite; of numbers of members all must agree."""
    value: Any = value_of(number)
    return bool(value > -math.inf and value < math.inf)
