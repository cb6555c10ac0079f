"""What a model means: its dictionary and hash, which paths are one value because one deck writes it, and what separates them."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from thermid.base.errors import NameNotFoundError, refuse_unknown
from thermid.base.units import from_si, in_si, unit
from thermid.model._laws.curves import INTERPOLATIONS, OUTSIDE, Curve
from thermid.model._laws.stores import SLOPES, TABULATED
from thermid.model._parts.controls import Control
from thermid.model._parts.elements import CONTROLS, KINDS, Conductor, MadeIn, Node, finish_emissivity, gap_scatter
from thermid.model._parts.enclosures import enclosure_to
from thermid.model._parts.parameter import UNJUDGED, Parameter, parameter
from thermid.model._tree.tree import Layer, M, Tree

APART = "set for this instance"
"""Why a value is not that of its twins."""

Ties = tuple[tuple[str, ...], ...]
"""Groups of paths that have one value."""

Key = tuple[str, str, tuple[tuple[str, str], ...]]
"""Deck, path there, and what was laid over the parts that hold it."""


@dataclass(frozen=True)
class Identity:
    """One value: the deck that writes it, and every place of a model where it acts.

    Parameters
    ----------
    owner : str         Hash of the deck that writes the value; values laid over a model are no part of it.
    local : str         Its path inside that deck.
    paths : tuple       Where it acts in this model; the first one names it.
    why : str           What ties its paths, or what keeps a single one apart.
    """

    owner: str
    local: str
    paths: tuple[str, ...]
    why: str


def identity_of(model: Tree) -> str:
    """Return a hash of what a model means: not of its file, comments, layout or the order of its tables."""
    return str(model.memo.value("identity", lambda: _hash(to_dict(model))))


def definition_of(model: Tree) -> str:
    """Return the hash of a model's deck and the decks that it uses: nothing that was laid over them or cut."""
    return str(model.memo.value("definition", lambda: _hash(to_dict(model, bare=True))))


def _hash(tables: Mapping[str, Any]) -> str:
    """Return 16 hex digits of the SHA-256 of tables, whatever the order of their keys."""
    return hashlib.sha256(json.dumps(tables, sort_keys=True).encode()).hexdigest()[:16]


def instances(model: Tree, prefix: str = "") -> Iterator[tuple[str, str]]:
    """Yield prefix and definition of every submodel, at every depth."""
    for name, part in model.submodels.items():
        yield f"{prefix}{name}.", part.definition
        yield from instances(part.model, f"{prefix}{name}.")


def inside(path: str, place: str) -> bool:
    """Return whether `path` is `place` itself or begins with it and a dot."""
    return path == place or path.startswith(f"{place}.")


def outside(paths: Iterable[str], places: Collection[str]) -> tuple[str, ...]:
    """Return the paths that lie in none of `places`."""
    return tuple(p for p in paths if not any(inside(p, place) for place in places))


def local_identities(model: Tree, owner: str = "") -> Mapping[str, Identity]:
    """Return path -> `Identity` of every value, with a name for the uppermost deck in place of its hash, which takes a while to find."""
    out: Mapping[str, Identity] = model.memo.value(("identities", owner), lambda: _local_identities(model, owner))
    return out


def _local_identities(model: Tree, owner: str) -> dict[str, Identity]:
    """Return what `local_identities` remembers."""
    rows = _rows(model, owner)
    classes = _classes(rows)
    states = Counter(key[:2] for key in classes)
    of = dict(instances(model))
    copies = Counter(of.values())
    out: dict[str, Identity] = {}
    for (who, local, is_separated), paths in classes.items():
        row = rows[paths[0]]
        if is_separated and states[who, local] > 1:  # a stage below separated this instance from its twins
            one = Identity(owner, paths[0], tuple(paths), APART)
        else:
            twin = any(copies[of[p]] > 1 for p in _prefixes(paths[0]) if p in of)
            one = Identity(who, local, tuple(paths), _why(row, len(paths), twin))
        out |= dict.fromkeys(paths, one)
    return {path: out[path] for path in rows}


def lay_values(model: M, values: Mapping[str, Any], origin: str) -> M:
    """Return a model with values laid over it; see `Model.with_values`."""
    table = model.parameter_table()
    layer: dict[str, Parameter] = {}
    shared: dict[int, list[str]] = {}
    for raw, value in values.items():
        path = model.canonical(raw)
        refuse_unknown([path], table, model.title, f"no parameter '{raw}'.", NameNotFoundError)
        new = value.as_parameter() if hasattr(value, "as_parameter") else parameter(value, path)
        standing = getattr(value, "standing", None) or UNJUDGED
        layer[path] = replace(new.laid_over(table[path].parameter), standing=standing)
        if hasattr(value, "as_parameter"):
            shared.setdefault(id(value), []).append(path)
    if not layer:
        return model
    cuts, ties = _laid_ties(model, layer, list(shared.values()))
    apart = cut(model, cuts)
    return replace(apart, layers=(*apart.layers, Layer(origin, layer, ties)))


def cut(model: M, places: Sequence[str]) -> M:
    """Return a model in which some instances or values share with no other; see `Model.cut`."""
    if not places:
        return model
    allowed = {*(prefix.removesuffix(".") for prefix, _ in instances(model)), *model.parameter_table()}
    cuts, layers = dict.fromkeys(model.cuts), model.layers
    for raw in places:
        place = model.canonical(raw)
        refuse_unknown([place], allowed, model.title, f"cut names '{raw}', which is not a submodel or parameter.", NameNotFoundError)
        cuts[place] = None
        # a group that reaches from inside the place to outside of it becomes two, or one where a half has one path
        parted = [[tuple(p for p in g if inside(p, place) is side) for g in layer.ties for side in (True, False)] for layer in layers]
        layers = tuple(replace(layer, ties=tuple(h for h in ties if len(h) > 1)) for layer, ties in zip(layers, parted, strict=True))
    return replace(model, cuts=tuple(cuts), layers=layers)


def _laid_ties(model: Tree, layer: Mapping[str, Parameter], groups: Sequence[Sequence[str]]) -> tuple[list[str], Ties]:
    """Return what a layer of values cuts, and which of its paths it lays as one value.

    Parameters
    ----------
    model : Tree       What it is laid over.
    layer : dict        Path -> value.
    groups : sequence   Paths of the layer that one fitted value stands for.
    """
    definitions = Counter(definition for _, definition in instances(model))
    if not any(count > 1 for count in definitions.values()):
        return [], ()
    cuts: list[str] = []
    ties: list[tuple[str, ...]] = []
    for paths in _classes({p: replace(r, laid=()) for p, r in _rows(model, "").items()}).values():  # whichever was laid first
        laid_paths = [p for p in paths if p in layer]
        if len(paths) == 1 or not laid_paths:
            continue
        one = len({_number(layer[p]) for p in laid_paths}) == 1
        ties += [shared for group in groups if len(shared := tuple(p for p in laid_paths if p in set(group))) > 1]
        if not (one and len(laid_paths) == len(paths)):
            cuts += laid_paths
    return cuts, tuple(ties)


@dataclass(frozen=True)
class _Row:
    """What is known of a path: the deck that writes it, its path there, the value, and what tied or cut it.

    Parameters
    ----------
    owner, local : str      Deck and path.
    given : Parameter       As that deck writes it, with the bounds that hold.
    file : str              The deck's file or title.
    way : str               'deck', 'set', 'rows' (equal rows of a [set]), 'cut' or 'laid'.
    laid : tuple            Origin and number of each value that was laid over a part that holds it, the innermost first: what a stage
                            found for one of several instances is not the value of the others.
    """

    owner: str
    local: str
    given: Parameter
    file: str
    way: str = "deck"
    laid: tuple[tuple[str, str], ...] = ()

    @property
    def key(self) -> Key:
        """Equal for paths that are one value."""
        return self.owner, self.local, self.laid


def _rows(model: Tree, owner: str) -> dict[str, _Row]:
    """Return path -> row of a tree; each deck above may set, cut or tie what stands below."""
    file = model.file or model.title
    rows = {name: _Row(owner, name, value, file) for name, _, value in model.own_parameters()}
    for name, part in model.submodels.items():
        inner = _rows(part.model, part.definition)
        for layer in part.model.layers:
            for path, value in layer.values.items():
                inner[path] = replace(inner[path], laid=(*inner[path].laid, (layer.origin, "".join(_number(value)))))
        rows |= {f"{name}.{path}": row for path, row in inner.items()}
    _set(rows, model, owner, file)
    for place in model.cuts:
        _cut(rows, place, owner, file)
    for group in (g for layer in model.layers for g in layer.ties):
        if len({rows[p].key for p in group}) > 1:
            rows |= {p: replace(rows[p], owner=owner, local=group[0], file=file, way="laid", laid=()) for p in group}
    return rows


def _set(rows: dict[str, _Row], model: Tree, owner: str, file: str) -> None:
    """Give the rows of a [set] to the deck that has it, equal ones under one name."""
    if not model.settings:
        return
    of = dict(instances(model))
    first: dict[Any, str] = {}
    for raw, value in model.settings.items():
        path = model.canonical(raw)
        if path not in rows:
            continue  # refused by the table of values, with the nearest name
        old = rows[path].given
        whole = value.laid_over(old)
        limits = (*(None if b is None else f"{b:.12g}" for b in (whole.minimum, whole.maximum)), whole.spread)
        part = next((p for p in _prefixes(path) if p in of), "")
        key = (of[part], path.removeprefix(part), _number(whole), *limits) if part else path
        local = first.setdefault(key, path)
        rows[path] = _Row(owner, local, whole, file, "set" if local == path else "rows")
        if local != path:
            rows[local] = replace(rows[local], way="rows")


def _cut(rows: dict[str, _Row], place: str, owner: str, file: str) -> None:
    """Give all that lies in a place to the deck that cuts it; what was one value within the place still is."""
    names: dict[Key, str] = {}
    for path, row in rows.items():
        if inside(path, place):
            local = names.setdefault(row.key, path)
            rows[path] = replace(row, owner=owner, local=local, file=file, way="cut", laid=())


def _prefixes(path: str) -> Iterator[str]:
    """Yield every prefix of a path that ends with a dot, the longest first."""
    steps = path.split(".")
    return (".".join(steps[:n]) + "." for n in range(len(steps) - 1, 0, -1))


def _classes(rows: Mapping[str, _Row]) -> dict[Key, list[str]]:
    """Return key -> paths of the rows that share it: one value each."""
    out: dict[Key, list[str]] = {}
    for path, row in rows.items():
        out.setdefault(row.key, []).append(path)
    return out


def _number(parameter: Parameter) -> tuple[str, str]:
    """Return number and dimension of a literal, whatever unit it was written in; the text of an expression."""
    literal = parameter.expression.literal
    return (parameter.text.strip(), "") if literal is None else (f"{literal.value:.12g}", str(literal.unit.dimension))


def _why(row: _Row, count: int, twin: bool) -> str:
    """Return in words what ties the `count` paths of a row, or keeps one apart from its `twin`."""
    if row.way == "cut":
        return "cut"
    if count == 1:
        return APART if row.way in ("set", "rows") and twin else "deck"
    if row.way == "laid":
        return "one value of a fit"
    return f"equal rows in [set] of {row.file}" if row.way == "rows" else f"{count} instances of {row.file}"


def cuts_of(model: Tree) -> Iterator[str]:
    """Yield every place of a tree that a deck or a caller cut from its twins."""
    yield from (prefix + place for part, prefix in model.walk() for place in part.cuts)


def written(parameter: Parameter) -> Any:
    """Return what a deck writes for a parameter: a text, or a table where more is known."""
    table: dict[str, Any] = {"value": _plain(parameter.text)}
    of = parameter.expression.literal.unit if parameter.expression.literal else unit("1")
    for key, bound in (("min", parameter.minimum), ("max", parameter.maximum)):
        if bound is not None:
            # an SI value in a unit, as the shortest number that converts back to the same float
            plain = from_si(bound, of)
            table[key] = next((short for digits in range(1, 18) if in_si(short := float(f"{plain:.{digits}g}"), of) == bound), plain)
    table |= {k: v for k in ("source", "note", "basis", "spread") if (v := getattr(parameter, k))}
    return table if len(table) > 1 else table["value"]


def _plain(text: str) -> str | float:
    """Return the number that a text without a unit is, or the text."""
    try:
        return float(text) if repr(float(text)) == text else text
    except ValueError:
        return text


def _grouped(fields: Mapping[str, Parameter]) -> dict[str, Any]:
    """Return fields as a deck writes them, ``group.field`` as a table."""
    return _named({}, {name: written(value) for name, value in fields.items()})


def _named(fields: dict[str, Any], words: Mapping[str, Any]) -> dict[str, Any]:
    """Return `fields` with words or values added, ``group.name`` inside the table of its group."""
    for name, word in words.items():
        group, _, inner = name.partition(".")
        if inner:
            fields.setdefault(group, {})[inner] = word
        else:
            fields[name] = word
    return fields


def _curve_to(shape: Curve | None, slot: str) -> dict[str, Any]:
    """Return a curve as the `table` of a deck, values in the unit `slot`; empty without one."""
    return {} if shape is None else {"table": {"over": shape.over} | _points_to(shape, slot)}


def _heat_to(node: Node) -> dict[str, Any]:
    """Return the property over temperature by which a node stores heat."""
    out: dict[str, Any] = {node.table[0]: _points_to(node.table[1], TABULATED[node.table[0]])} if node.table else {}
    if (cools := node.supercooling) is not None:
        out |= {"melts_to": f"{cools.liquidus!r} [K]", "supercooling": f"{cools.degree!r} [K]", "starts": cools.starts}
    return out


def _points_to(shape: Curve, slot: str) -> dict[str, Any]:
    """Return the points of a table as texts, with what is known of its source."""
    columns = [(shape.x, "K"), (shape.y, slot)] + ([(shape.d, SLOPES[slot])] if shape.d is not None else [])
    texts = [[f"{v!r} [{of}]" for v in column.tolist()] for column, of in columns]
    points = {k: v for k, v in (("source", shape.source), ("basis", shape.basis)) if v}
    if shape.interpolation != INTERPOLATIONS[0]:
        points["interpolation"] = shape.interpolation
    if shape.outside != OUTSIDE[0]:
        points["outside"] = shape.outside
    return {"points": [list(point) for point in zip(*texts, strict=True)], **points}


def made_to(state: MadeIn) -> dict[str, str]:
    """Return the table of the state of a gas in which a reduced model was made."""
    numbers = {"pressure": f"{state.pressure!r} [Pa]", "gravity": f"{state.gravity!r} [m/s^2]", "wind": f"{state.wind!r} [m/s]"}
    return numbers | {"gas": state.gas}


def _written_fields(c: Conductor) -> dict[str, Parameter]:
    """Return the fields of a conductor without the scatter that a closed gap has by itself."""
    scatter = gap_scatter(c.words, "") if "tilt" in c.words else None
    return {name: parameter for name, parameter in c.fields.items() if name != "convection_factor" or parameter != scatter}


def _control_to(control: Control) -> dict[str, Any]:
    """Return the table of a control."""

    def follows(nodes: Mapping[str, float]) -> Any:
        """Return the one node that a row follows, or its nodes with their weights."""
        return next(iter(nodes)) if list(nodes.values()) == [1.0] else dict(nodes)

    fields = dict(control.fields)
    ways: dict[str, dict[str, Any]] = {}
    for name, t in control.transitions.items():
        level = written(fields.pop(f"transitions.{name}.{t.sense}"))
        ways[name] = {"from": t.before, "to": t.after, t.sense: level} | ({"follows": follows(t.follows)} if t.follows else {})
    out = ({"follows": follows(control.follows)} if control.follows else {}) | _grouped(fields) | _curve_to(control.curve, "1")
    out |= {"starts": control.starts} if control.starts else {}
    out |= {"transitions": ways} if ways else {}
    return out | ({"sample": f"{control.sample!r} [s]"} if control.sample else {})


def _controlled(names: Sequence[str], key: str = "control") -> dict[str, Any]:
    """Return key -> one name or a list of names; empty without controls."""
    return {} if not names else {key: names[0] if len(names) == 1 else list(names)}


def elements_to(model: Tree) -> dict[str, dict[str, Any]]:
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
        | ({"facing": {k: angle for k, angle in vars(e.facing).items() if angle is not None}} if e.facing else {})
        | ({"sees": e.sees} if e.sees else {})
        | {k: v for what, names in e.controls.items() for k, v in _controlled(names, f"{what}_control").items()}
        | flag(e)
        for n, e in model.surfaces.items()
    }
    conductors = {
        n: {"kind": e.kind, "between": list(e.between)}
        | _named(_grouped(_written_fields(e)), e.words)
        | (
            {law: _points_to(e.curve, TABULATED[law])}
            if e.curve is not None and (law := KINDS[e.kind].tabulated)
            else _curve_to(e.curve, "W/K")
        )
        | ({"takes": list(e.takes)} if e.takes else {})
        | _controlled(e.controls)
        | ({"reversible": True} if e.reversible else {})
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
        table = {"into": load.into} | _grouped(load.fields) | _curve_to(load.curve, "W") | _controlled(load.controls) | flag(load)
        if load.cycle is not None:
            times = [f"{t!r} [s]" for t in load.cycle.times]
            table["cycle"] = {"times": times, "values": list(load.cycle.values)} | ({"hold": True} if load.cycle.hold else {})
        for control in CONTROLS:
            if control in table and load.sensor:
                table[control]["sensor"] = load.sensor
        loads[n] = table
    controls = {n: _control_to(e) | flag(e) for n, e in model.controls.items()}
    tables = {"nodes": nodes, "surfaces": surfaces, "conductors": conductors, "joints": joints, "enclosures": enclosures, "loads": loads}
    return tables | {"controls": controls}


def to_dict(model: Tree, bare: bool = False) -> dict[str, Any]:
    """Return the dictionary that describes a model; submodels stand as dictionaries under `use`.

    Parameters
    ----------
    bare : bool     Leave out what was laid over the decks or cut.
    """
    out: dict[str, Any] = {"title": model.title, "box": model.box}
    for key, value in (("use", model.use), ("incomplete", model.incomplete), ("needs", list(model.needs)), ("offers", list(model.offers))):
        if value:
            out[key] = value
    out["parameters"] = {n: written(p) for n, p in model.parameters.items()}
    out |= elements_to(model)
    out["submodels"] = {n: {"use": to_dict(s.model, bare), "bind": s.bound()} for n, s in model.submodels.items()}
    out["set"] = {n: written(p) for n, p in model.settings.items()}
    if not bare:
        out["layers"] = [
            {
                "origin": x.origin,
                "values": {n: written(p) for n, p in x.values.items()},
                **({"ties": [list(g) for g in x.ties]} if x.ties else {}),
            }
            for x in model.layers
        ]
        out["cuts"] = list(model.cuts)
    out["aliases"] = dict(model.aliases)
    out["made_in"] = {gas: made_to(state) for gas, state in model.made_in.items()}
    return {k: v for k, v in out.items() if v not in ({}, [])}
