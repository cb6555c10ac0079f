"""What makes a house hard to walk through, counted: circles, hidden imports, slices, doubled names, crowded rooms."""

from __future__ import annotations

import ast
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path

import thermid

from .source import Import, Module, within

LIST = Path(__file__).parent / "offenders.toml"
"""What offends today, by guard; it may only shrink (`python scripts/house.py --shrink` takes off it what no longer offends)."""

CROWD = 15
"""Files that a package may hold beside its `__init__`."""

Offenders = dict[str, int]
"""What offends -> how often; 1 where it can only offend or not."""


def imports_between(modules: Mapping[str, Module]) -> dict[str, set[str]]:
    """Module -> the modules of the package that it imports, wherever the import stands."""
    known = {*modules, "thermid._kernel"}
    found = {m.name: {t for i in m.imports() for t, _ in within(i, known) if t in modules} - {m.name} for m in modules.values()}
    for space in {f"thermid.{name}" for name in thermid._NAMESPACES} & set(found):  # they offer public names for the package as a whole
        found.setdefault("thermid", set()).update(found[space])
        found[space] = set()
    return found


def own_lazy_imports(module: Module) -> list[Import]:
    """Imports of this package that stand inside functions."""
    return [i for i in module.imports() if i.lazy and i.target.partition(".")[0] == "thermid"]


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


def short(name: str) -> str:
    """Name of a module or package below `thermid`."""
    return name.removeprefix("thermid.")


def circles(modules: Mapping[str, Module]) -> Offenders:
    """Groups of modules that need one another, imports in functions and for the type checker included."""
    return {" ".join(map(short, group)): 1 for group in components(imports_between(modules))}


def lazy_imports(modules: Mapping[str, Module]) -> Offenders:
    """Module -> how many of its imports of this package stand inside functions."""
    return {short(m.name): n for m in modules.values() if (n := len(own_lazy_imports(m)))}


def slices(modules: Mapping[str, Module]) -> Offenders:
    """Modules with exactly one importer, in the same room: one file would do for both."""
    importers: dict[str, set[str]] = {}
    for name, targets in imports_between(modules).items():
        for target in targets:
            importers.setdefault(target, set()).add(name)
    found = {}
    for target, names in importers.items():
        (first, *others) = names
        if not others and not modules[first].gives_names and modules[first].room == modules[target].room and not modules[target].package:
            found[short(target)] = 1
    return found


def doubled_classes(modules: Mapping[str, Module]) -> Offenders:
    """Names that classes of several modules have -> in how many modules."""
    places: dict[str, set[str]] = {}
    for module in modules.values():
        for node in module.nodes:
            if isinstance(node, ast.ClassDef):
                places.setdefault(node.name, set()).add(module.name)
    return {name: len(where) for name, where in places.items() if len(where) > 1}


def files_by_package(modules: Mapping[str, Module]) -> dict[str, int]:
    """Package -> how many files it holds beside its `__init__`."""
    counts: dict[str, int] = {}
    for module in modules.values():
        if not module.package:
            package = module.name.rpartition(".")[0]
            counts[package] = counts.get(package, 0) + 1
    return counts


def crowded(modules: Mapping[str, Module]) -> Offenders:
    """Packages with more than `CROWD` files -> how many."""
    return {short(package): n for package, n in files_by_package(modules).items() if n > CROWD}


GUARDS = {
    "circles": circles,
    "imports_in_functions": lazy_imports,
    "one_importer": slices,
    "doubled_classes": doubled_classes,
    "crowded_packages": crowded,
}
"""Guard -> what measures it."""


def listed() -> dict[str, Offenders]:
    """What may offend still, by guard."""
    return tomllib.loads(LIST.read_text(encoding="utf-8"))


def against_the_list(today: Offenders, allowed: Offenders) -> list[str]:
    """What is new, and what is listed though it no longer offends, a line each."""
    new = [f"new: {name} ({n}; allowed {allowed.get(name, 0)})" for name, n in today.items() if n > allowed.get(name, 0)]
    gone = [
        f"mended, shrink the list: {name} ({n} listed, {today.get(name, 0)} today)" for name, n in allowed.items() if today.get(name, 0) < n
    ]
    return [*new, *gone]


def shrunk(today: Offenders, allowed: Offenders) -> Offenders:
    """The list without what no longer offends; a circle that lost members stays as what is left of it."""
    kept = {name: min(n, today[name]) for name, n in allowed.items() if name in today}
    parts = {name: 1 for name in today if " " in name and any(set(name.split()) < set(old.split()) for old in allowed)}
    return dict(sorted((kept | parts).items()))


def as_toml(lists: Mapping[str, Offenders]) -> str:
    """The list as its file holds it."""
    head = "# What offends today, by guard of test_house.py; it may only shrink: `python scripts/house.py --shrink`.\n"
    tables = ("\n".join([f"\n[{guard}]", *(f'"{name}" = {n}' for name, n in sorted(rows.items()))]) for guard, rows in lists.items())
    return head + "\n".join(tables) + "\n"
