"""What a model means: its dictionary and hash, which paths are one value because one deck writes it, and what separates them.

Replacing a part: what belonged to the old one goes, what belongs to the place starts anew; and what a part touches.
"""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from thermid.base.errors import DeckError, NameNotFoundError, nearest, refuse_unknown
from thermid.base.units import from_si, in_si, unit
from thermid.model._laws.stores import INTERPOLATIONS, OUTSIDE, SLOPES, TABULATED, Curve
from thermid.model._parts.controls import Control
from thermid.model._parts.elements import CONTROLS, KINDS, Conductor, HeatLoad, Joint, Node, Surface, finish_emissivity, gap_scatter
from thermid.model._parts.enclosures import enclosure_to
from thermid.model._parts.parameter import UNJUDGED, Parameter
from thermid.model._tree.tree import Element, Entry, Layer, M, ParameterSet, Submodel, Tree, used_offers

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
    of = dict(model.instances())
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
        new = value.as_parameter() if hasattr(value, "as_parameter") else Parameter.read(value, path)
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
    allowed = {*(prefix.removesuffix(".") for prefix, _ in model.instances()), *model.parameter_table()}
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
    definitions = Counter(definition for _, definition in model.instances())
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
    of = dict(model.instances())
    first: dict[Any, str] = {}
    for raw, value in model.settings.items():
        path = model.canonical(raw)
        if path not in rows:
            continue  # refused by the table of values, with the nearest name
        whole = value.laid_over(rows[path].given)
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
    out["made_in"] = {gas: state.written() for gas, state in model.made_in.items()}
    return {k: v for k, v in out.items() if v not in ({}, [])}


PLACE, SCATTER = 0.30, 0.25
"""Standard deviation of the logarithm: of a coefficient that the old part had at its place, and between joints of parts of one kind."""
INTERFACE = {"contact_conductance": "W/(m^2 K)", "conductance": "W/K", "conductivity": "W/(m K)", "gap.htc": "W/(m^2 K)"}
"""Fields by which joints and conductors differ from one another; areas and thicknesses are as drawn."""
COEFFICIENTS = ("effective_htc", "htc", "htc.coefficient")


@dataclass(frozen=True)
class Dropped:
    """A value of the old part that went with it.

    Parameters
    ----------
    path, text : str    Where it stood, and what it was.
    origin : str        Who set it: a stage, a [set], a caller.
    why : str           'of the old part', or 'of its place' for one from which the new part starts.
    """

    path: str
    text: str
    origin: str
    why: str


@dataclass(frozen=True)
class PlaceStart:
    """A value of the place: where it starts with the new part, and how far it may be from there.

    Parameters
    ----------
    path : str          A coefficient of the new part, or a field of a joint that gets a number of its own.
    text : str          Where it starts.
    log_sd : float      Standard deviation of its logarithm about the start. [-]
    origin : str        'twin': from joints of the same kind; 'place': its value with the old part.
    twins : tuple       What shared it before.
    of_part : bool      Whether it is a coefficient of the part's surfaces, and not of a joint.
    """

    path: str
    text: str
    log_sd: float
    origin: str
    twins: tuple[str, ...] = ()
    of_part: bool = False

    def __str__(self) -> str:
        """Return the start as an assumption in words."""
        whose = f"that of {', '.join(self.twins)}" if self.twins else "its value with the old part"
        return f"{self.path} is {whose}, {short_text(self.text)} within {100 * self.log_sd:.0f} %"


@dataclass(frozen=True)
class Replacement:
    """What became of the values of a place when its part was replaced.

    Parameters
    ----------
    path : str          The place.
    old, new : str      Titles of the parts.
    dropped : tuple     What belonged to the old part.
    kept : tuple        Rows on paths of the part that stay: what the deck above derives from its own values, and what the caller kept.
    starts : tuple      Values of the place, each with the spread that counts until it is fitted again.
    assumes : tuple     What is taken for granted of the new part, in words.
    untied : tuple      Paths of the part that had one value with a twin, and have their own now.
    """

    path: str
    old: str
    new: str
    dropped: tuple[Dropped, ...] = ()
    kept: tuple[str, ...] = ()
    starts: tuple[PlaceStart, ...] = ()
    assumes: tuple[str, ...] = ()
    untied: tuple[str, ...] = ()

    def starting(self, model: M) -> M:
        """Return the model with every value of the place at its start, those of joints apart from their twins."""
        return lay_values(model, {s.path: s.text for s in self.starts}, f"start after {self.new} replaced {self.old}")


def replaced(model: M, raw: str, new: M, keep: Sequence[str] = ()) -> tuple[M, Replacement]:
    """Return a model with another part at a path, and what became of the values there; see `Model.replaced`."""
    path = model.canonical(raw)
    old = model.submodel(path)
    new_values = new.parameter_table()
    stays = frozenset(model.canonical(k) for k in keep)
    before = model.parameter_table()
    for k in (k for k in keep if model.canonical(k) not in before):
        raise NameNotFoundError(f"'{k}' cannot be kept: the model has no such value.{nearest(model.canonical(k), before)}", model.title)
    after = _at(model, path, new, path, stays, new_values)
    now = after.parameter_table()
    lost = [k for k in keep if (p := model.canonical(k)) in now and now[p].origin != before[p].origin]  # laid over the old part itself
    for k in lost:
        after = lay_values(after, {k: before[model.canonical(k)].parameter}, before[model.canonical(k)].origin)
    now = after.parameter_table()
    own_values = {f"{path}.{p}": e for p, e in old.without_layers().parameter_table().items()}
    # what somebody above the part's own deck gave, or a stage of the part
    as_in_deck = {p: (e.parameter.text, e.origin) for p, e in own_values.items()}
    laid_values = {p: e for p, e in before.items() if inside(p, path) and as_in_deck.get(p) != (e.parameter.text, e.origin)}
    still_laid = tuple(p for p in laid_values if p in now and now[p].origin == laid_values[p].origin)
    gone = {p: e for p, e in laid_values.items() if p not in still_laid}
    values = ParameterSet(model)
    # values that the model around the part had set, and no layer of the part itself
    own_layers = {layer.origin for layer in old.layers}
    above = {p for p, e in gone.items() if e.origin not in own_layers or any(origin.startswith("[set]") for origin, _ in e.shadowed)}
    place = above.intersection(coefficients(model, values, path))
    dropped = tuple(
        Dropped(p, e.parameter.text, e.origin, "of its place" if p in place and p in now else "of the old part") for p, e in gone.items()
    )
    of_surfaces = [PlaceStart(p, before[p].parameter.text, PLACE, "place", of_part=True) for p in sorted(place) if p in now]
    starts = (*of_surfaces, *_joints(model, after, path, values, stays))
    assumes = (f"{new.title} has the values of its deck", *map(str, starts), *(f"{p} is unchanged" for p in still_laid))
    # no twin shares what the old part had of it: the twin keeps its value, the new part has its deck's
    after = cut(after, [p for p in _with_twins(after, path) if p in gone and p in now])
    untied = tuple(p for p in _with_twins(model, path) if p not in _with_twins(after, path))
    return after, Replacement(path, old.title, new.title, dropped, still_laid, starts, assumes, untied)


def short_text(text: str) -> str:
    """Return a value as people read it: fitted numbers have all their digits in a model."""
    number, _, rest = text.partition(" [")
    try:
        return f"{float(number):.4g}" + (f" [{rest}" if rest else "")
    except ValueError:
        return text


def coefficients(model: Tree, values: ParameterSet, part: str) -> set[str]:
    """Return the numbers inside a part that set a coefficient of heat transfer of its surfaces."""
    numbers: set[str] = set()
    for owner, prefix in model.submodel(part).walk(f"{part}."):
        paths = [f"{prefix}{name}.{coefficient}" for name in owner.surfaces for coefficient in COEFFICIENTS]
        numbers |= {values.literal_behind(path) for path in paths if path in values.table}
    return numbers


def _at(model: M, path: str, new: M, full: str, keep: frozenset[str], new_values: Mapping[str, Entry]) -> M:
    """Return a model with the new part, and without rows on paths of the old one, here and at every level below."""
    head, _, rest = path.partition(".")
    old = model.submodels[head]
    if rest:
        deeper = frozenset(k.partition(".")[2] for k in keep if k.partition(".")[0] == head)
        part = old.with_model(_at(old.model, rest, new, full, deeper, new_values))
    else:
        bind = _ports(model, head, new, full)
        sees = {need: node for need, node in old.sees.items() if need in bind}
        part = Submodel(new, bind, old.definition if new == old.model else definition_of(new), sees)
    _check_read(model, path, new_values, full)

    def stays(raw: str, parameter: Parameter) -> bool:
        """Whether a value is kept: of another part, named in `keep`, or a formula that reads what the new part has."""
        p = model.canonical(raw)
        return not inside(p, path) or p in keep or (not parameter.is_literal and p.removeprefix(f"{path}.") in new_values)

    return replace(
        model,
        submodels={**model.submodels, head: part},
        settings={p: v for p, v in model.settings.items() if stays(p, v)},
        layers=tuple(trimmed for layer in model.layers if (trimmed := layer.keeping(stays)).values),
        cuts=tuple(c for c in model.cuts if not inside(c, path)),
    )


def _ports(model: Tree, head: str, new: Tree, path: str) -> dict[str, str]:
    """Return need -> node for the new part, as the old one was bound.

    Raises
    ------
    DeckError   When it needs or offers other ports than are used; the message names them.
    """
    old = model.submodels[head]
    gone = sorted(used_offers(model, head) - {new.canonical(offer) for offer in new.offers})
    unbound = sorted(set(new.needs) - set(old.bind))
    if gone or unbound:
        has, new_has = (", ".join(sorted({*m.needs, *m.offers})) for m in (old.model, new))
        lack = "; ".join(
            [f"it does not offer {g}, which is used here" for g in gone] + [f"its need {u} is bound to nothing" for u in unbound]
        )
        raise DeckError(
            f"'{path}' has ports {has}; its replacement has {new_has}: {lack}. Add the port to the new part, or keep the old part.",
            model.title,
            code="model.refused",
        )
    return {need: node for need, node in old.bind.items() if need in new.needs}


def _check_read(model: Tree, path: str, new_values: Mapping[str, Entry], full: str) -> None:
    """Refuse a part that lacks a value which a deck above reads.

    Raises
    ------
    DeckError   With what to do.
    """
    rows = [(key, value) for _, key, value in model.own_parameters()] + [(f"set.{p}", v) for p, v in model.settings.items()]
    for key, value in rows:
        for name in value.expression.names:
            local = model.canonical(name)
            if inside(local, path) and local.removeprefix(f"{path}.") not in new_values:
                raise DeckError(
                    f"'{value.text}' reads '{name}', which the replacement of '{full}' does not have. Give the new part a parameter of "
                    "that name, or write a number here.",
                    model.where(key),
                    code="model.refused",
                )


def _joints(model: Tree, after: Tree, path: str, values: ParameterSet, keep: frozenset[str]) -> Iterator[PlaceStart]:
    """Yield what the joints at the part start from: a number of their own, where other joints shared it."""
    beside = touching(model, path)
    new_parameters = ParameterSet(after)
    ties = local_identities(model)
    numbers = values.evaluate({})
    done = set(keep)
    for element, fields in beside.elements.items():
        for row in fields:
            kind = row.removeprefix(f"{element}.")
            if kind not in INTERFACE or row not in new_parameters.table or inside(row, path):
                continue
            # the number behind a field if it acts on nothing elsewhere; empty where the field needs a number of its own
            own_roots = [p for p in _roots(values, row) if not any(q in beside.shared for q in values.downstream([p]))]
            root = own_roots[0] if len(own_roots) == 1 else ""
            at = root or row
            if at in done or row in done:
                continue
            done.add(at)
            also = (
                {
                    beside.shared[q]
                    for p in _roots(values, row)
                    for q in values.downstream([p])
                    if q in beside.shared and q == f"{beside.shared[q]}.{kind}"
                }
                if not root
                else {p.removesuffix(f".{kind}") for p in ties[at].paths if p != at}
            )
            literal = values.table[at].parameter.expression.literal
            text = values.table[at].parameter.text if literal is not None else f"{float(numbers[row]):.9g} [{INTERFACE[kind]}]"
            yield PlaceStart(at, text, SCATTER, "twin" if also else "place", tuple(sorted(also)))


def _roots(values: ParameterSet, field: str) -> list[str]:
    """Return the numbers behind a field that are conductances or conductivities; lengths and areas are as drawn."""
    conducting = {unit(text).dimension for text in INTERFACE.values()}
    literals = (p for p in values.order if values.table[p].parameter.is_literal and values.dimension(p) in conducting)
    return [p for p in literals if field in values.downstream([p])]


def _with_twins(model: Tree, path: str) -> list[str]:
    """Return the values inside a part that it shares with something outside."""
    identities = local_identities(model)
    return [p for p, one in identities.items() if inside(p, path) and any(not inside(q, path) for q in one.paths)]


@dataclass
class Touching:
    """What a part touches.

    Parameters
    ----------
    elements : dict         Element -> fields of the elements that attach to the part.
    settings : set          Paths inside the part that a model above sets.
    shared : dict           Field -> element, of all elements elsewhere that do not attach to it.
    neighbours : set        Other ends of what attaches to it.
    """

    elements: dict[str, list[str]] = field(default_factory=dict)
    settings: set[str] = field(default_factory=set)
    shared: dict[str, str] = field(default_factory=dict)
    neighbours: set[str] = field(default_factory=set)

    def why(self, values: ParameterSet, path: str) -> tuple[list[str], list[str]]:
        """Return (elements and settings through which the value at `path` acts on the part, elements elsewhere that it acts on)."""
        acts = set(values.downstream([path]))
        touched = [name for name, fields in self.elements.items() if acts & set(fields)]
        touched += sorted(p for p in self.settings if p in acts)
        return touched, sorted({self.shared[p] for p in acts if p in self.shared})


def touching(model: Tree, part: str) -> Touching:
    """Return the elements, settings and neighbours that attach to the submodel at a path, at every level above it."""
    out = Touching()
    _visit(model, "", part, part, out)
    out.neighbours = {n for n in out.neighbours if not inside(n, part)}
    return out


def _visit(model: Tree, prefix: str, rest: str, part: str, out: Touching) -> None:
    """Add to `out` what a model, which holds the part at `rest` below it, attaches to the part, sets in it, or has elsewhere."""
    fields: dict[str, list[str]] = {}
    for name, key, _ in model.own_parameters():
        if not key.startswith("parameters."):
            fields.setdefault(name.partition(".")[0], []).append(prefix + name)
    for _, name, element in model.elements():
        ends = {prefix + model.canonical(e) for e in _ends(element)}
        if any(inside(e, part) for e in ends):
            out.elements[prefix + name] = fields.get(name, [])
            out.neighbours |= ends
        else:
            out.shared |= dict.fromkeys(fields.get(name, []), prefix + name)
    out.settings |= {p for p in (prefix + model.canonical(raw) for raw in model.settings) if inside(p, part)}
    head, _, deeper = rest.partition(".")
    for name, inner in model.submodels.items():
        for other, at in inner.model.walk(f"{prefix}{name}.") if name != head else ():
            values = [value for value, key, _ in other.own_parameters() if not key.startswith("parameters.")]
            out.shared |= {at + value: at + value.partition(".")[0] for value in values}
    if deeper:
        _visit(model.submodels[head].model, f"{prefix}{head}.", deeper, part, out)


def _ends(element: Element) -> Iterable[str]:
    """Return the nodes and surfaces that heat passes to through an element; areas that it only takes are no path."""
    if isinstance(element, Joint | Conductor):
        return element.between
    if isinstance(element, Surface):
        return [e for e in (element.of, element.sees) if e]
    if isinstance(element, HeatLoad):
        return [element.into]
    return ()
