"""Which parameters of the models of several levels are one value: found by where each part stands, and by who gives the value there."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

from thermid.fit.calibration import Calibration
from thermid.fit.problem.request import Request
from thermid.model.tree.identity import definition_of, instances
from thermid.model.tree.model import Model
from thermid.model.tree.resolve import ParameterSet

if TYPE_CHECKING:
    from thermid.campaign.file import CampaignSource


Key = tuple[str, str]
"""Where the part stands whose deck or [set] gives a value, and the value's path there."""


@dataclass(frozen=True, eq=False)
class Level:
    """One level: a stage, what it asks, and where its model stands in the uppermost one."""

    name: str
    request: Request
    positions: tuple[str, ...] = ()

    @cached_property
    def values(self) -> ParameterSet:
        """The values of its model."""
        return ParameterSet(self.request.model)

    @cached_property
    def _numbers(self) -> dict[str, float]:
        return {p: float(v) for p, v in self.values.evaluate({}).items()}

    def start_of(self, raw: str) -> float:
        """Return the value that a parameter has before any fit of this level. [SI]"""
        return self._numbers[self.values.freeable(raw, self.request.model.canonical)]

    def literals(self) -> Iterator[str]:
        """Yield every path that can be free."""
        return (p for p, entry in self.values.table.items() if entry.parameter.is_literal)

    def keys(self, path: str) -> list[Key]:
        """Return what a path is called by where its value comes from, once for each place of this level in the uppermost model."""
        owner = _owner(self.request.model, path)
        rest = path.removeprefix(owner)
        return [(place + owner, rest) for place in self.positions]


def _owner(model: Model, path: str) -> str:
    """Return the prefix of the part that gives a value: the uppermost whose [set] names it, or the one whose deck has it."""
    if path in {model.canonical(p) for p in model.settings}:
        return ""
    head, _, rest = path.partition(".")
    return f"{head}.{_owner(model.submodels[head].model, rest)}" if rest and head in model.submodels else ""


@dataclass(frozen=True)
class Value:
    """One value: its keys, and its paths in the uppermost model."""

    keys: frozenset[Key]
    above: tuple[str, ...]
    fitted: tuple[str, ...]
    start: float | None

    @property
    def also(self) -> tuple[str, ...]:
        """Paths of the uppermost model beside its name."""
        return self.above[1:]


@dataclass(frozen=True, eq=False)
class Shared:
    """All values of a joint fit by name: the path in the uppermost model, or ``stage: path`` where that has none."""

    classes: Mapping[str, Value]
    levels: Sequence[Level] = field(default=(), repr=False)

    @cached_property
    def _names(self) -> dict[Key, str]:
        return {key: name for name, one in self.classes.items() for key in one.keys}

    def names_in(self, level: Level) -> dict[str, str]:
        """Return path in a level -> name, of every value that acts there."""
        out = {}
        for path in level.literals():
            name = next((self._names[k] for k in level.keys(path) if k in self._names), None)
            if name is not None:
                out[path] = name
        return out

    def paths_in(self, level: Level) -> list[str]:
        """Return the paths of a level that are free, all instances among them."""
        return list(self.names_in(level))

    def name_of(self, level: Level, path: str) -> str:
        """Return the name of a path; the path itself where it is not free."""
        return next((self._names[k] for k in level.keys(path) if k in self._names), path)

    def start_of(self, name: str, default: float) -> float:
        """Return where a value starts. [SI]"""
        start = self.classes[name].start
        return default if start is None else start

    def fitted_before(self, name: str, level: Level) -> bool:
        """Return whether a stage below a level fitted a value."""
        order = [one.name for one in self.levels]
        return any(order.index(stage) < order.index(level.name) for stage in self.classes[name].fitted)

    def without(self, names: Iterable[str]) -> Shared:
        """Return it without some values."""
        gone = set(names)
        return replace(self, classes={n: c for n, c in self.classes.items() if n not in gone}) if gone else self

    def staged(self, done: Mapping[str, Calibration]) -> list[tuple[str, dict[str, str]]]:
        """Return stage and path there -> name, each value at the last stage that fitted it."""
        out: dict[str, dict[str, str]] = {}
        for level in self.levels:
            if level.name in done:
                for path in done[level.name].values.parameters:
                    name = self.name_of(level, path)
                    if name in self.classes and self.classes[name].fitted[-1] == level.name:
                        out.setdefault(level.name, {})[path] = name
        return list(out.items())


def shared_parameters(source: CampaignSource, levels: list[Level], top: str, done: Mapping[str, Calibration]) -> Shared:
    """Return the values that are free in any level, and set the places of the levels.

    A value of a level is the same as one of the level above where the part stands there unchanged: nothing above it sets the value anew.
    A level stands where the stages above inherit from it, or where its very deck is used.
    """
    places = places_of(source, levels, top)
    levels[:] = [replace(level, positions=places[level.name]) for level in levels]
    groups: dict[Key, set[Key]] = {}

    def unite(keys: Sequence[Key]) -> None:
        whole = set().union(*(groups.get(k, {k}) for k in keys))
        groups.update(dict.fromkeys(whole, whole))

    fitted: dict[Key, list[str]] = {}
    starts: dict[Key, float] = {}
    for level in levels:
        shared = level.request.shared
        for path in _free(level):
            keys = [k for p in shared.get(path, (path,)) for k in level.keys(p)]
            unite(keys)
            for k in keys:
                fitted.setdefault(k, []).append(level.name)
                found = done[level.name].values.assignments.get(path) if level.name in done else None
                if found is not None:
                    starts[k] = found.value
    by_top = {k: p for level in levels if level.name == top for p in level.literals() for k in level.keys(p)}
    classes: dict[str, Value] = {}
    for members in {id(g): g for g in groups.values()}.values():
        above = tuple(p for k, p in by_top.items() if k in members)
        order = [level.name for level in levels if any(level.name in fitted.get(k, ()) for k in members)]
        name = above[0] if above else _own_name(levels, members, order)
        start = next((starts[k] for level in reversed(levels) for k in members if k in starts and level.name in fitted[k][-1:]), None)
        classes[name] = Value(frozenset(members), above, tuple(order), start)
    return Shared(classes, levels)


def _own_name(levels: Sequence[Level], keys: set[Key], fitted: Sequence[str]) -> str:
    """Return the name of a value that the uppermost model does not have: the last stage that fitted it, and its path there."""
    level = next(one for one in levels if one.name == fitted[-1])
    return f"{level.name}: " + next(p for p in level.literals() if keys & set(level.keys(p)))


def _free(level: Level) -> Iterator[str]:
    """Yield the paths that a stage frees, those that it was handed as priors among them."""
    request = level.request
    for raw in (*request.free, *(q for p in request.prior for q in request.store.states[p].acts)):
        yield level.values.freeable(raw, request.model.canonical)


def places_of(source: CampaignSource, levels: Sequence[Level], top: str) -> dict[str, tuple[str, ...]]:
    """Return stage -> prefixes at which its model stands in the uppermost one; a place of its own where it stands nowhere."""
    tables = {s.name: s for s in source.content.stages}
    models = {level.name: level.request.model for level in levels}
    out: dict[str, list[str]] = {top: [""]}
    for above in reversed(list(tables)):
        for part, inherit in tables[above].inherit.items():
            for place in out.get(above, ()):
                canonical = models[above].canonical(part) if above in models else part
                here = place if part == "." else f"{place}{canonical}."
                for below in inherit.stages:
                    if here not in out.setdefault(below, []):
                        out[below].append(here)
    for level in levels:
        if level.name not in out:
            same = [
                prefix for prefix, definition in instances(models[top]) if definition == _bare_identity(source, tables[level.name].model)
            ]
            out[level.name] = same or [f"{level.name}: "]
    return {level.name: tuple(out[level.name]) for level in levels}


def _bare_identity(source: CampaignSource, deck: str) -> str:
    return definition_of(source.model(deck, deck))
