"""Parts that are used: values where a part is used, arrays and chains of one part, and the conductors between neighbours."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any, Final

from thermid.base.errors import DeckError, nearest
from thermid.model._parts.elements import Conductor
from thermid.model._parts.parameter import Parameter
from thermid.model._tree.model import Model
from thermid.model._tree.tree import Submodel

Place = tuple[int, ...]
"""Index of an instance, from 1: (3,) in a row, (2, 3) in rows and columns; empty where there is one."""
INDICES: Final = ("i", "j")
"""What stands for the index in texts of an array: {i}, in rows and columns {i} and {j}."""


@dataclass(frozen=True)
class Use:
    """How a deck uses a part.

    Parameters
    ----------
    bind, sees : dict   Need -> node of the user, and what surfaces see there where that is another one; may hold indices.
    values : dict       Path in the part -> value as written, as a table with `value`, or a list of one for each instance.
    count : tuple       How many: nothing (one part), one number, or rows and columns.
    chain : dict        Need -> what the instance before offers for it.
    """

    bind: Mapping[str, str]
    sees: Mapping[str, str] = field(default_factory=dict)
    values: Mapping[str, Any] = field(default_factory=dict)
    count: tuple[int, ...] = ()
    chain: Mapping[str, str] = field(default_factory=dict)

    def places(self) -> tuple[Place, ...]:
        """Return the index of every instance, in order; one empty index without a count."""
        return tuple(product(*(range(1, side + 1) for side in self.count)))


@dataclass(frozen=True)
class Instances:
    """What a table of [submodels] makes.

    Parameters
    ----------
    submodels : dict    Name -> part.
    settings : dict     Path -> value, as a row of [set] would give it.
    conductors : dict   Name -> conductor between neighbours.
    """

    submodels: Mapping[str, Submodel[Model]]
    settings: Mapping[str, Parameter]
    conductors: Mapping[str, Conductor]


def instance_name(name: str, place: Place) -> str:
    """Return the name of an instance: the array's and its index."""
    return "_".join((name, *map(str, place)))


def made_instances(
    name: str, use: Use, part: Model, definition: str, links: Mapping[str, Conductor], where: Callable[[str], str]
) -> Instances:
    """Return what one table of [submodels] stands for: an instance of `part` at every place, its values, and the links between them.

    Parameters
    ----------
    links : dict        Name -> conductor, whose ends are names inside an instance and inside its next neighbour.
    where : callable    Key below the table -> place.

    Raises
    ------
    DeckError   When a list of values has another length than the array, or a chain is one of rows and columns.
    """
    places = use.places()
    _check_chain(use, part, where)
    submodels: dict[str, Submodel[Model]] = {}
    settings: dict[str, Parameter] = {}
    before = ""
    for k, place in enumerate(places):
        instance = instance_name(name, place)
        bind, sees = ({need: _placed(node, place) for need, node in ends.items()} for ends in (use.bind, use.sees))
        if before:
            bind |= {need: f"{before}.{offered}" for need, offered in use.chain.items()}
            sees = {need: node for need, node in sees.items() if need not in use.chain}
        submodels[instance] = Submodel(part, bind, definition, sees)
        for path, raw in use.values.items():
            settings[f"{instance}.{path}"] = _value(raw, k, place, len(places), where(f"values.{path}"))
        before = instance
    table = part.parameter_table() if use.values else {}
    for path in use.values:
        if part.canonical(path) not in table:
            raise DeckError(f"'{part.title}' has no value '{path}'.{nearest(path, table)}", where(f"values.{path}"), code="name.unknown")
    return Instances(submodels, settings, dict(_linked(name, places, links, where)))


def _check_chain(use: Use, part: Model, where: Callable[[str], str]) -> None:
    """Refuse a chain over rows and columns, or between names that the part neither needs nor offers."""
    if not use.chain:
        return
    if len(use.count) != 1:
        raise DeckError("a chain needs a single count. Connect rows and columns by links.", where("chain"), code="model.law-refused")
    for need, offered in use.chain.items():
        if need not in part.needs:
            raise DeckError(
                f"'{part.title}' needs {', '.join(part.needs) or 'nothing'}, not '{need}'.", where("chain"), code="name.unknown"
            )
        if offered not in part.offers:
            raise DeckError(
                f"'{part.title}' does not offer '{offered}'. It offers {', '.join(part.offers) or 'nothing'}.",
                where("chain"),
                code="name.unknown",
            )


def _placed(text: str, place: Place) -> str:
    """Return a text with {i} and {j} replaced by the indices of a place."""
    for letter, index in zip(INDICES, place, strict=False):
        text = text.replace(f"{{{letter}}}", str(index))
    return text


def _value(raw: Any, k: int, place: Place, count: int, where: str) -> Parameter:
    """Return the value of one instance: the same for all, one of a list, or a text with its index."""
    if isinstance(raw, list):
        if len(raw) != count:
            raise DeckError(f"{len(raw)} values for {count} instances.", where, code="value.shape")
        raw = raw[k]
    table = dict(raw)
    if isinstance(table["value"], str):
        table["value"] = _placed(table["value"], place)
    return Parameter.read(table, where)


def _linked(
    name: str, places: Sequence[Place], links: Mapping[str, Conductor], where: Callable[[str], str]
) -> Iterator[tuple[str, Conductor]]:
    """Yield name and conductor of every link between neighbours, along each axis; later ones read their values from the first."""
    there = set(places)
    if links and len(places) < 2:
        raise DeckError("links need neighbours. Give a count of 2 or more.", where("links"), code="model.law-refused")
    for link, conductor in links.items():
        first = ""
        for place in places:
            for axis in range(len(place)):
                other = tuple(index + (axis == n) for n, index in enumerate(place))
                if other not in there:
                    continue
                here, next_ = instance_name(name, place), instance_name(name, other)
                link_name = f"{name}_{link}_{'_'.join(map(str, place))}_to_{'_'.join(map(str, other))}"
                between = (f"{here}.{conductor.between[0]}", f"{next_}.{conductor.between[1]}")
                fields = {
                    f: Parameter.read(f"{first}.{f}") if first and field_value.is_literal else field_value
                    for f, field_value in conductor.fields.items()
                }
                yield link_name, replace(conductor, between=between, fields=fields)
                first = first or link_name


def merged(into: dict[str, Any], more: Mapping[str, Any], where: str) -> None:
    """Add elements or values `more` to those of the deck, `into`, in place.

    Raises
    ------
    DeckError   When a name or a value is there already.
    """
    for name, element in more.items():
        if name in into:
            raise DeckError(f"'{name}' is generated here and defined in the deck too. Remove one of them.", where, code="name.taken")
        into[name] = element
