"""Values: which one holds for every path of a tree, who set it and what it shadows."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from thermid.errors import DeckError, ExpressionError, NameNotFoundError, ThermidError, nearest
from thermid.model.laws.curves import Curve
from thermid.model.parts.elements import Conductor
from thermid.model.parts.kinds import KINDS
from thermid.model.parts.parameter import Parameter, check_bounds
from thermid.model.tree.model import Model
from thermid.units import Dimension

SET = "[set] of "


@dataclass(frozen=True)
class Entry:
    """The value that holds for a path.

    Parameters
    ----------
    parameter : Parameter           The winning value.
    scope : str                     Prefix in which its names resolve; empty or ending with a dot.
    origin : str                    Who set it.
    where : str                     File, line and key path, for messages.
    shadowed : tuple of (str, str)  Origin and text of every value it hides, the innermost first.
    """

    parameter: Parameter
    scope: str
    origin: str
    where: str
    shadowed: tuple[tuple[str, str], ...] = ()


def parameter_table(model: Model, prefix: str = "") -> dict[str, Entry]:
    """Return path -> `Entry` for every value of a tree.

    Precedence, weakest first: a part's deck, values laid over the part, the user's [set], values laid over the user.

    Raises
    ------
    NameNotFoundError   When a [set] names no parameter.
    """
    table: dict[str, Entry] = {}
    for name, key, given in model.own_parameters():
        table[prefix + name] = Entry(given, prefix, model.title, model.where(key))
    for name, part in model.submodels.items():
        table |= parameter_table(part.model, f"{prefix}{name}.")
    for raw, given in model.settings.items():
        _lay(table, model, prefix, raw, given, f"{SET}{model.title}", model.where(f"set.{raw}"))
    for layer in model.layers:
        for raw, given in layer.values.items():
            _lay(table, model, prefix, raw, given, layer.origin, f"{layer.origin}, {raw}")
    return table


def own_tables(model: Model, prefix: str = "") -> dict[str, tuple[Curve, str]]:
    """Return path -> table of points and its place in a deck, for every table over a temperature of a tree; no value is laid over these."""
    found = [(f"nodes.{n}.{e.table[0]}", f"{n}.{e.table[0]}", e.table[1]) for n, e in model.nodes.items() if e.table]
    for group, elements in (("conductors", model.conductors), ("loads", model.loads)):
        for n, each in elements.items():
            if each.curve is not None:
                field = (KINDS[each.kind].tabulated if isinstance(each, Conductor) else "") or "table"
                found.append((f"{group}.{n}.{field}", f"{n}.{field}", each.curve))
    out = {prefix + path: (curve, model.where(key)) for key, path, curve in found}
    for name, part in model.submodels.items():
        out |= own_tables(part.model, f"{prefix}{name}.")
    return out


def deck_text(entry: Entry) -> str:
    """Return the text that the decks have of a value: that of the outermost [set], or of the deck of the part; layers are left out."""
    every = [*entry.shadowed, (entry.origin, entry.parameter.text)]
    return next((text for origin, text in reversed(every[1:]) if origin.startswith(SET)), every[0][1])


def _lay(table: dict[str, Entry], model: Model, prefix: str, raw: str, given: Parameter, origin: str, where: str) -> None:
    """Lay one value over the table; bounds and notes stay unless given anew."""
    path = prefix + model.canonical(raw)
    old = table.get(path)
    if old is None:
        known = [p.removeprefix(prefix) for p in table]
        raise NameNotFoundError(f"no parameter '{raw}'.{nearest(raw, known)}", where)
    low = old.parameter.minimum if given.minimum is None else given.minimum
    high = old.parameter.maximum if given.maximum is None else given.maximum
    merged = replace(given, minimum=low, maximum=high, note=given.note or old.parameter.note)
    table[path] = Entry(merged, prefix, origin, where, (*old.shadowed, (old.origin, old.parameter.text)))


class ParameterSet:
    """The values of a tree, by path: which one holds, who set it, what it shadows.

    Parameters
    ----------
    model : Model   The tree.

    Raises
    ------
    ExpressionError   When an expression needs itself.
    ThermidError      When a name is unknown or a value lies outside its bounds.
    """

    def __init__(self, model: Model) -> None:
        self.title = model.title
        self.table: Mapping[str, Entry] = parameter_table(model)
        self._needs: dict[str, tuple[str, ...]] = {path: self._resolved(path, entry) for path, entry in self.table.items()}
        self.order: tuple[str, ...] = self._sorted()
        self._dimensions: dict[str, Dimension] = {}
        values = self.evaluate({})
        for path, entry in self.table.items():
            check_bounds(values[path], entry.parameter, entry.where)

    def _resolved(self, path: str, entry: Entry) -> tuple[str, ...]:
        return tuple(self._lookup(name, entry) for name in entry.parameter.expression.names)

    def _lookup(self, name: str, entry: Entry) -> str:
        full = entry.scope + name
        if full not in self.table:
            local = [p.removeprefix(entry.scope) for p in self.table if p.startswith(entry.scope)]
            raise NameNotFoundError(f"no parameter '{name}'.{nearest(name, local)}", entry.where)
        return full

    def _sorted(self) -> tuple[str, ...]:
        """Return the paths so that each comes after what it needs."""
        done: dict[str, None] = {}
        trail: list[str] = []

        def visit(path: str) -> None:
            if path in done:
                return
            if path in trail:
                loop = [*trail[trail.index(path) :], path]
                raise ExpressionError(f"'{path}' needs itself: {' -> '.join(loop)}.", self.table[path].where)
            trail.append(path)
            for other in self._needs[path]:
                visit(other)
            trail.pop()
            done[path] = None

        for path in self.table:
            visit(path)
        return tuple(done)

    def evaluate(
        self, overrides: Mapping[str, Any], only: Iterable[str] | None = None, known: Mapping[str, Any] | None = None
    ) -> dict[str, Any]:
        """Return path -> value, SI, of all paths or of `only` some, with `overrides` in place of literals.

        Overrides may be floats, `Dual` numbers or arrays over time; `known` holds values already computed.
        """
        values: dict[str, Any] = dict(known or {})
        for path in self.order if only is None else only:
            if path in overrides:
                values[path] = overrides[path]
                continue
            entry = self.table[path]
            scope = entry.scope
            try:
                values[path] = entry.parameter.expression.evaluate(lambda name, scope=scope: values[scope + name])  # type: ignore[misc]
            except ArithmeticError as error:
                raise ExpressionError(f"'{entry.parameter.text}' has no finite value: {error}.", entry.where) from None
        return values

    def downstream(self, changed: Iterable[str]) -> tuple[str, ...]:
        """Return the paths whose value depends on any of `changed`, in order of evaluation, `changed` among them."""
        touched = set(changed)
        out = []
        for path in self.order:
            if path in touched or any(n in touched for n in self._needs[path]):
                touched.add(path)
                out.append(path)
        return tuple(out)

    def dimension(self, path: str) -> Dimension:
        """Return the dimension of a value, by algebra over its names."""
        if path not in self._dimensions:
            entry = self.table[path]
            find: Callable[[str], Dimension] = lambda name: self.dimension(self._lookup(name, entry))  # noqa: E731
            try:
                self._dimensions[path] = entry.parameter.expression.dimension(find)
            except ThermidError as error:
                raise error.located(entry.where) from None
        return self._dimensions[path]

    def literal_behind(self, path: str) -> str:
        """Follow a chain of bare names to the value at its end."""
        seen = {path}
        while True:
            names = self._needs[path]
            entry = self.table[path]
            if entry.parameter.is_literal or len(names) != 1 or entry.parameter.text.strip() != entry.parameter.expression.names[0]:
                return path
            path = names[0]
            if path in seen:
                return path
            seen.add(path)

    def freeable(self, raw: str, canonical: Callable[[str], str]) -> str:
        """Return the path of a parameter that a fit may free.

        Raises
        ------
        NameNotFoundError   With the nearest name.
        DeckError           When the value is derived; the message says what to free instead.
        """
        path = canonical(raw)
        if path not in self.table:
            raise NameNotFoundError(f"no parameter '{raw}'.{nearest(path, self.table)}", self.title)
        path = self.literal_behind(path)
        entry = self.table[path]
        if not entry.parameter.is_literal:
            roots = [p for p in self.order if self.table[p].parameter.is_literal and path in self.downstream([p])]
            raise DeckError(f"'{raw}' is derived: {entry.parameter.text}. Free one of {', '.join(roots)} instead.", entry.where)
        return path
