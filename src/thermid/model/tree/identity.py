"""Identities: which paths of a tree are one value, because one deck writes it, and what separates them."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from thermid.arguments import takes_objects

if TYPE_CHECKING:
    from thermid.model.parts.parameter import Parameter
    from thermid.model.tree.model import Layer, Model

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


def definition_of(model: Model) -> str:
    """Return the hash of a model's deck and the decks that it uses: nothing that was laid over them or cut."""
    from thermid.model.tree.written import to_dict

    return hashlib.sha256(json.dumps(to_dict(model, bare=True), sort_keys=True).encode()).hexdigest()[:16]


def instances(model: Model, prefix: str = "") -> Iterator[tuple[str, str]]:
    """Yield prefix and definition of every submodel, at every depth."""
    for name, part in model.submodels.items():
        yield f"{prefix}{name}.", part.definition
        yield from instances(part.model, f"{prefix}{name}.")


def inside(path: str, place: str) -> bool:
    """Return whether a path is a place or lies in it."""
    return path == place or path.startswith(f"{place}.")


def depth(place: str) -> int:
    """Return how many levels a place lies below the root of its assembly; the root is the empty place."""
    return place.count(".") + 1 if place else 0


@takes_objects
def identities(model: Model) -> Mapping[str, Identity]:
    """Return path -> `Identity` of every value of a tree.

    A value in the deck of a part is one value for all its instances. A row of a [set] belongs to the deck that has it; rows of one [set]
    with equal number, dimension and bounds, on one field of instances of one definition, are one value. A cut separates them.
    """
    return local_identities(model, definition_of(model))


def local_identities(model: Model, owner: str = "") -> Mapping[str, Identity]:
    """Return the same with a name for the uppermost deck in place of its hash, which takes a while to find."""
    rows = _rows(model, owner)
    classes = _classes(rows)
    states = Counter(key[:2] for key in classes)
    of = dict(instances(model))
    copies = Counter(of.values())
    out: dict[str, Identity] = {}
    for (who, local, laid), paths in classes.items():
        row = rows[paths[0]]
        if laid and states[who, local] > 1:  # a stage below told this instance apart from its twins
            one = Identity(owner, paths[0], tuple(paths), APART)
        else:
            twin = any(copies[of[p]] > 1 for p in _prefixes(paths[0]) if p in of)
            one = Identity(who, local, tuple(paths), _why(row, len(paths), twin))
        out |= dict.fromkeys(paths, one)
    return {path: out[path] for path in rows}


def laid_ties(model: Model, layer: Mapping[str, Parameter], groups: Sequence[Sequence[str]]) -> tuple[list[str], Ties]:
    """Return what a layer of values cuts, and which of its paths it lays as one value.

    Parameters
    ----------
    model : Model       What it is laid over.
    layer : dict        Path -> value.
    groups : sequence   Paths of the layer that one fitted value stands for.
    """
    definitions = Counter(definition for _, definition in instances(model))
    if not any(count > 1 for count in definitions.values()):
        return [], ()
    cuts: list[str] = []
    ties: list[tuple[str, ...]] = []
    for paths in _classes(_rows(model, "")).values():
        given = [p for p in paths if p in layer]
        if len(paths) == 1 or not given:
            continue
        one = len({_number(layer[p]) for p in given}) == 1
        ties += [shared for group in groups if len(shared := tuple(p for p in given if p in set(group))) > 1]
        if not (one and len(given) == len(paths)):
            cuts += given
    return cuts, tuple(ties)


def cut_layers(layers: Iterable[Layer], place: str) -> tuple[Layer, ...]:
    """Return layers in which no group reaches from inside a place to outside of it."""
    out = []
    for layer in layers:
        halves = [tuple(p for p in group if inside(p, place) is side) for group in layer.ties for side in (True, False)]
        out.append(replace(layer, ties=tuple(h for h in halves if len(h) > 1)) if layer.ties else layer)
    return tuple(out)


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


def _rows(model: Model, owner: str) -> dict[str, _Row]:
    """Return path -> row of a tree; each deck above may set, cut or tie what stands below."""
    file = model.file or model.title
    rows = {name: _Row(owner, name, given, file) for name, _, given in model.own_parameters()}
    for name, part in model.submodels.items():
        inner = _rows(part.model, part.definition)
        for layer in part.model.layers:
            for path, given in layer.values.items():
                inner[path] = replace(inner[path], laid=(*inner[path].laid, (layer.origin, "".join(_number(given)))))
        rows |= {f"{name}.{path}": row for path, row in inner.items()}
    _set(rows, model, owner, file)
    for place in model.cuts:
        _cut(rows, place, owner, file)
    for group in (g for layer in model.layers for g in layer.ties):
        if len({rows[p].key for p in group}) > 1:
            rows |= {p: replace(rows[p], owner=owner, local=group[0], file=file, way="laid", laid=()) for p in group}
    return rows


def _set(rows: dict[str, _Row], model: Model, owner: str, file: str) -> None:
    """Give the rows of a [set] to the deck that has it, equal ones under one name."""
    if not model.settings:
        return
    of = dict(instances(model))
    first: dict[Any, str] = {}
    for raw, given in model.settings.items():
        path = model.canonical(raw)
        if path not in rows:
            continue  # the table of values says so, with the nearest name
        old = rows[path].given
        bounds = [old_b if b is None else b for b, old_b in ((given.minimum, old.minimum), (given.maximum, old.maximum))]
        whole = replace(given, minimum=bounds[0], maximum=bounds[1])
        part = next((p for p in _prefixes(path) if p in of), "")
        key = (of[part], path.removeprefix(part), _number(whole), *(None if b is None else f"{b:.12g}" for b in bounds)) if part else path
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
    out: dict[Key, list[str]] = {}
    for path, row in rows.items():
        out.setdefault(row.key, []).append(path)
    return out


def _number(given: Parameter) -> tuple[str, str]:
    """Return number and dimension of a literal, whatever unit it was written in; the text of an expression."""
    literal = given.expression.literal
    return (given.text.strip(), "") if literal is None else (f"{literal.value:.12g}", str(literal.unit.dimension))


def _why(row: _Row, count: int, twin: bool) -> str:
    if row.way == "cut":
        return "cut"
    if count == 1:
        return APART if row.way in ("set", "rows") and twin else "deck"
    if row.way == "laid":
        return "one value of a fit"
    return f"equal rows in [set] of {row.file}" if row.way == "rows" else f"{count} instances of {row.file}"


def cuts_of(model: Model, prefix: str = "") -> Iterator[str]:
    """Yield every place of a tree that a deck or a caller cut from its twins."""
    yield from (prefix + place for place in model.cuts)
    for name, part in model.submodels.items():
        yield from cuts_of(part.model, f"{prefix}{name}.")
