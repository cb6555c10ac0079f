"""What goes between rooms, counted: arrows, floors, imports of inner files, names used outside.

A room is the first name below `thermid`. Imports count wherever they stand, those for the type checker and those by text too.
`thermid/__init__` and `__main__`, stubs and the compiled kernel stand outside.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache

from .source import Module, is_inner, room_of, within

OUTSIDE = {"thermid", "thermid.__main__"}


@dataclass(frozen=True)
class Arrow:
    """One file that imports another, with the names that it takes from there."""

    source: str
    target: str
    names: frozenset[str]

    @property
    def rooms(self) -> tuple[str, str]:
        """The room that imports, and the one imported from."""
        return room_of(self.source), room_of(self.target)


def arrows_between_files(modules: Mapping[str, Module]) -> list[Arrow]:
    """Pairs of files of which one imports the other, once each."""
    taken: dict[tuple[str, str], set[str]] = {}
    for module in modules.values():
        if module.name in OUTSIDE:
            continue
        for imported in (*module.imports(stub=False), *module.imports_by_text(modules.keys())):
            for target, names in within(imported, modules.keys()):
                if target != module.name and target not in OUTSIDE:
                    taken.setdefault((module.name, target), set()).update(names)
        for target, name in _attributes(module, modules.keys()):
            taken[module.name, target].add(name)
    return [Arrow(source, target, frozenset(names)) for (source, target), names in taken.items()]


def _attributes(module: Module, known: Collection[str]) -> Iterator[tuple[str, str]]:
    """Modules that a module holds under a name, each with an attribute that is asked of it."""
    held = {}
    for node in module.nodes:
        if isinstance(node, ast.ImportFrom):
            target = module.absolute(node)
            held |= {a.asname or a.name: name for a in node.names if (name := f"{target}.{a.name}") in known and name != module.name}
        elif isinstance(node, ast.Import):
            held |= {a.asname: a.name for a in node.names if a.asname and a.name in known and a.name not in OUTSIDE}
    if held:
        for node in module.nodes:
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in held:
                yield held[node.value.id], node.attr


def between_rooms(arrows: list[Arrow]) -> list[Arrow]:
    """Arrows of which the ends are in different rooms."""
    return [a for a in arrows if a.rooms[0] != a.rooms[1]]


def room_graph(modules: Mapping[str, Module], arrows: list[Arrow]) -> dict[str, set[str]]:
    """Room -> the rooms that it imports from."""
    graph: dict[str, set[str]] = {m.room: set() for m in modules.values() if m.name not in OUTSIDE}
    for arrow in between_rooms(arrows):
        source, target = arrow.rooms
        graph[source].add(target)
    return graph


def components(graph: Mapping[str, Iterable[str]]) -> list[list[str]]:
    """Groups of nodes of which each reaches every other (Tarjan 1972), without those of one node."""
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    groups: list[list[str]] = []

    def visit(node: str) -> None:
        index[node] = low[node] = len(index)
        stack.append(node)
        for other in sorted(graph[node]):
            if other not in index:
                visit(other)
                low[node] = min(low[node], low[other])
            elif other in stack:
                low[node] = min(low[node], index[other])
        if low[node] == index[node]:
            cut = stack.index(node)
            groups.append(sorted(stack[cut:]))
            del stack[cut:]

    for node in sorted(graph):
        if node not in index:
            visit(node)
    return sorted(group for group in groups if len(group) > 1)


def floors(graph: Mapping[str, set[str]]) -> int:
    """Rooms in the longest chain of which each imports the next; rooms in a circle are one floor."""
    group = {room: frozenset(circle) for circle in components(graph) for room in circle}

    @cache
    def height(rooms: frozenset[str]) -> int:
        below = {group.get(other, frozenset({other})) for room in rooms for other in graph[room]} - {rooms}
        return 1 + max(map(height, below), default=0)

    return max((height(group.get(room, frozenset({room}))) for room in graph), default=0)


def map_of_rooms(modules: Mapping[str, Module], arrows: list[Arrow]) -> dict[str, int]:
    """Rooms; floors, the rooms of the longest chain of which each imports the next; arrows between rooms; arrows between their files."""
    graph = room_graph(modules, arrows)
    return {
        "rooms": len(graph),
        "floors": floors(graph),
        "arrows between rooms": sum(map(len, graph.values())),
        "arrows between files of different rooms": len(between_rooms(arrows)),
    }


def inner_imports(arrows: list[Arrow], inner: Callable[[str], bool] = is_inner) -> dict[str, int]:
    """Room -> how many pairs of a file of it and an inner file of another room that it imports."""
    counts: dict[str, int] = {}
    for arrow in between_rooms(arrows):
        if inner(arrow.target):
            counts[arrow.rooms[0]] = counts.get(arrow.rooms[0], 0) + 1
    return counts


def names_used_outside(arrows: list[Arrow]) -> dict[str, set[tuple[str, str]]]:
    """Room -> the different names of it that other rooms use, by module; of a module imported whole, the attributes asked of it."""
    names: dict[str, set[tuple[str, str]]] = {}
    for arrow in between_rooms(arrows):
        names.setdefault(arrow.rooms[1], set()).update((arrow.target, name) for name in arrow.names)
    return names
