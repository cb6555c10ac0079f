"""A model as a dictionary with the tables of a deck; `build` goes the other way."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from thermid.model.laws.curves import INTERPOLATIONS, OUTSIDE, Curve
from thermid.model.laws.stores import TABULATED
from thermid.model.parts.build import finish_emissivity, slope_unit
from thermid.model.parts.elements import CONTROLS, Conductor, MadeIn, Node
from thermid.model.parts.enclosures import enclosure_to
from thermid.model.parts.facing import facing_to
from thermid.model.parts.kinds import KINDS
from thermid.model.parts.parameter import Parameter
from thermid.model.tree.model import Layer, Model
from thermid.units import unit


def written(given: Parameter) -> Any:
    """Return what a deck writes for a parameter: a text, or a table where more is known."""
    table: dict[str, Any] = {"value": _plain(given.text)}
    of = given.expression.literal.unit if given.expression.literal else unit("1")
    for key, bound in (("min", given.minimum), ("max", given.maximum)):
        if bound is not None:
            table[key] = _in_unit(bound, float(of.factor), float(of.offset))
    table |= {k: v for k, v in (("source", given.source), ("note", given.note), ("basis", given.basis)) if v}
    return table if len(table) > 1 else table["value"]


def _plain(text: str) -> str | float:
    """Return the number that a text without a unit is, or the text."""
    try:
        return float(text) if repr(float(text)) == text else text
    except ValueError:
        return text


def _in_unit(value: float, factor: float, offset: float) -> float:
    """Return an SI value in a unit, as the shortest number that converts back to the same float."""
    plain = (value - offset) / factor
    return next((short for digits in range(1, 18) if (short := float(f"{plain:.{digits}g}")) * factor + offset == value), plain)


def _grouped(fields: Mapping[str, Parameter]) -> dict[str, Any]:
    """Return fields as a deck writes them, ``group.field`` as a table."""
    out: dict[str, Any] = {}
    for name, given in fields.items():
        group, _, inner = name.partition(".")
        if inner:
            out.setdefault(group, {})[inner] = written(given)
        else:
            out[name] = written(given)
    return out


def _named(fields: dict[str, Any], words: Mapping[str, str]) -> dict[str, Any]:
    """Return fields with what is no number beside them."""
    for name, word in words.items():
        group, _, inner = name.partition(".")
        if inner:
            fields.setdefault(group, {})[inner] = word
        else:
            fields[name] = word
    return fields


def _curve_to(shape: Curve | None, slot: str) -> dict[str, Any]:
    return {} if shape is None else {"table": {"over": shape.over} | _points_to(shape, slot)}


def _law_to(c: Conductor) -> dict[str, Any]:
    """Return the table of a conductor: of conductance, or of a property."""
    name = KINDS[c.kind].tabulated
    return {name: _points_to(c.curve, TABULATED[name])} if c.curve is not None and name else _curve_to(c.curve, "W/K")


def _heat_to(node: Node) -> dict[str, Any]:
    """Return the property over temperature by which a node stores heat."""
    return {node.table[0]: _points_to(node.table[1], TABULATED[node.table[0]])} if node.table else {}


def _points_to(shape: Curve, slot: str) -> dict[str, Any]:
    """Return the points of a table as texts, with what is known of its source."""
    columns = [(shape.x, "K"), (shape.y, slot)] + ([(shape.d, slope_unit(slot))] if shape.d is not None else [])
    texts = [[f"{v!r} [{of}]" for v in column.tolist()] for column, of in columns]
    known = {k: v for k, v in (("source", shape.source), ("basis", shape.basis)) if v}
    if shape.interpolation != INTERPOLATIONS[0]:
        known["interpolation"] = shape.interpolation
    if shape.outside != OUTSIDE[0]:
        known["outside"] = shape.outside
    return {"points": [list(point) for point in zip(*texts, strict=True)], **known}


def made_to(state: MadeIn) -> dict[str, str]:
    """Return the table of the state of a gas in which a reduced model was made."""
    numbers = {"pressure": f"{state.pressure!r} [Pa]", "gravity": f"{state.gravity!r} [m/s^2]", "wind": f"{state.wind!r} [m/s]"}
    return numbers | {"gas": state.gas}


def elements_to(model: Model) -> dict[str, dict[str, Any]]:
    """Return the element tables of a deck."""
    flag: Callable[[Any], dict[str, bool]] = lambda e: {"test_only": True} if e.test_only else {}  # noqa: E731
    nodes = {
        n: _grouped(e.fields)
        | _heat_to(e)
        | ({"stands_for": e.stands_for} if e.stands_for else {})
        | ({"reference_point": True} if e.reference_point else {})
        | flag(e)
        for n, e in model.nodes.items()
    }
    surfaces = {
        n: {"of": e.of, "to": e.to}
        | _named(
            _grouped({f: p for f, p in e.fields.items() if f != "emissivity" or not e.finish or p != finish_emissivity(e.finish, "")}),
            e.words,
        )
        | ({"finish": e.finish} if e.finish else {})
        | ({"facing": facing_to(e.facing)} if e.facing else {})
        | ({"sees": e.sees} if e.sees else {})
        | flag(e)
        for n, e in model.surfaces.items()
    }
    conductors = {
        n: {"kind": e.kind, "between": list(e.between)}
        | _named(_grouped(e.fields), e.words)
        | _law_to(e)
        | ({"takes": list(e.takes)} if e.takes else {})
        | flag(e)
        for n, e in model.conductors.items()
    }
    joints = {}
    for n, joint in model.joints.items():
        table = {"between": list(joint.between)} | _grouped(joint.fields) | ({"mid": joint.mid} if joint.mid else {}) | flag(joint)
        if joint.gap_to:
            table["gap"]["to"] = joint.gap_to
        joints[n] = table
    enclosures = {n: enclosure_to(e) | flag(e) for n, e in model.enclosures.items()}
    loads = {}
    for n, load in model.loads.items():
        table = {"into": load.into} | _grouped(load.fields) | _curve_to(load.curve, "W") | flag(load)
        for control in CONTROLS:
            if control in table and load.sensor:
                table[control]["sensor"] = load.sensor
        loads[n] = table
    return {"nodes": nodes, "surfaces": surfaces, "conductors": conductors, "joints": joints, "enclosures": enclosures, "loads": loads}


def to_dict(model: Model, bare: bool = False) -> dict[str, Any]:
    """Return the dictionary that describes a model; submodels stand as dictionaries under `use`.

    Parameters
    ----------
    bare : bool     Leave out what was laid over the decks or cut.
    """
    out: dict[str, Any] = {"title": model.title, "box": model.box}
    for key, value in (("use", model.use), ("needs", list(model.needs)), ("offers", list(model.offers))):
        if value:
            out[key] = value
    out["parameters"] = {n: written(p) for n, p in model.parameters.items()}
    out |= elements_to(model)
    out["submodels"] = {n: {"use": to_dict(s.model, bare), "bind": s.bound()} for n, s in model.submodels.items()}
    out["set"] = {n: written(p) for n, p in model.settings.items()}
    if not bare:
        out["layers"] = [_layer_to(layer) for layer in model.layers]
        out["cuts"] = list(model.cuts)
    out["aliases"] = dict(model.aliases)
    out["made_in"] = {gas: made_to(state) for gas, state in model.made_in.items()}
    return {k: v for k, v in out.items() if v not in ({}, [])}


def _layer_to(layer: Layer) -> dict[str, Any]:
    """Return a layer as a dictionary, with the groups of paths that it lays as one value."""
    out = {"origin": layer.origin, "values": {n: written(p) for n, p in layer.values.items()}}
    return {**out, "ties": [list(group) for group in layer.ties]} if layer.ties else out
