"""What makes a house hard to walk through: guards that list what offends by name, and budgets of what may only become less."""

from __future__ import annotations

import ast
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path

from . import decisive, doors, public, size, warm, words
from .source import Import, Module, is_inner, within

LIST = Path(__file__).parent / "offenders.toml"
"""What offends today, by guard; it may only shrink (`python scripts/house.py --shrink` takes off it what no longer offends)."""

BUDGETS = Path(__file__).parent / "budgets.toml"
"""How much there may be at most, by table; `--shrink` lowers it to what there is, a decision alone raises it."""

CROWD = 15
"""Files that a package may hold beside its `__init__`."""

Offenders = dict[str, int]
"""What offends -> how often; 1 where it can only offend or not."""


def imports_between(modules: Mapping[str, Module], by_text: bool) -> dict[str, set[str]]:
    """Module -> the modules of the package that it imports, wherever the import stands; what stubs import, `thermid` itself offers."""
    known = {*modules, "thermid._kernel"}

    def reached(imports: Iterable[Import]) -> set[str]:
        return {target for i in imports for target, _ in within(i, known) if target in modules}

    texts = {name: m.imports_by_text(modules) if by_text else () for name, m in modules.items()}
    between = {name: reached((*m.imports(stub=False), *texts[name])) - {name} for name, m in modules.items()}
    if offered := set().union(*(reached(m.stub_imports) for m in modules.values())):
        between["thermid"] = between.get("thermid", set()) | offered
    return between


def own_lazy_imports(module: Module) -> list[Import]:
    """Imports of this package that stand inside functions."""
    return [i for i in module.imports() if i.lazy and i.target.partition(".")[0] == "thermid"]


def short(name: str) -> str:
    """Name of a module or package below `thermid`."""
    return name.removeprefix("thermid.")


def circles(modules: Mapping[str, Module]) -> Offenders:
    """Groups of modules that need one another, imports in functions, for the type checker and by text included."""
    return {" ".join(map(short, group)): 1 for group in doors.components(imports_between(modules, by_text=True))}


def lazy_imports(modules: Mapping[str, Module]) -> Offenders:
    """Module -> how many of its imports of this package stand inside functions."""
    return {short(m.name): n for m in modules.values() if (n := len(own_lazy_imports(m)))}


def slices(modules: Mapping[str, Module]) -> Offenders:
    """Modules with exactly one importer, in the same room: one file would do for both."""
    importers: dict[str, set[str]] = {}
    for name, targets in imports_between(modules, by_text=False).items():
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


def without_docstring(modules: Mapping[str, Module]) -> Offenders:
    """Functions, methods and classes without an underscore that have no docstring; ruff asks for none in files that begin with one."""
    kinds = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)

    def missing(node: ast.Module | ast.ClassDef, name: str) -> Iterator[str]:
        for child in node.body:
            if isinstance(child, kinds) and not child.name.startswith("_"):
                last = child.body[-1]
                only_a_form = isinstance(last, ast.Expr) and isinstance(last.value, ast.Constant)  # `...`, of an overload or a protocol
                if ast.get_docstring(child) is None and not only_a_form:
                    yield f"{name}.{child.name}"
                if isinstance(child, ast.ClassDef):
                    yield from missing(child, f"{name}.{child.name}")

    return {name: 1 for module in modules.values() for name in missing(module.tree, short(module.name))}


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
    "without_docstring": without_docstring,
    "long_functions": size.long_functions,
    "constants_of_several_numbers": words.constants_of_several_numbers,
}
"""Guard -> what measures it."""


def amounts(modules: Mapping[str, Module], tests: Mapping[str, str], inner: Callable[[str], bool] = is_inner) -> dict[str, dict[str, int]]:
    """What there is of all that may only become less, as the budgets have it: table -> row -> how much."""
    arrows = doors.arrows_between_files(modules)
    return {
        "map": doors.map_of_rooms(modules, arrows),
        "inner_imports": doors.inner_imports(arrows, inner),
        "names_used_outside": {room: len(names) for room, names in doors.names_used_outside(arrows).items()},
        "statements": size.statements(modules),
        "numbers_that_decide": decisive.numbers_that_decide(modules),
        "functions_named_by_dialect": words.dialect_functions(modules),
        "constants_named_by_dialect": words.dialect_constants(modules),
        "functions_with_dialect_variables": words.functions_with_dialect_variables(modules),
        "functions_with_one_use": size.functions_with_one_use(modules, inner),
        "quoted_prose": words.quoted_prose(tests),
        "signatures": public.signatures(modules),
        "warm_calls": warm.walks(),
    }


def over_budget(today: Mapping[str, int], allowed: Mapping[str, int]) -> list[str]:
    """Rows that have more than their budget, a line each."""
    return [f"{name}: {n}, and {allowed.get(name, 0)} allowed" for name, n in today.items() if n > allowed.get(name, 0)]


def lowered(today: Mapping[str, int], allowed: Mapping[str, int]) -> dict[str, int]:
    """A budget without what is no longer used of it."""
    return {name: n for name in allowed if (n := min(allowed[name], today.get(name, 0)))}


def listed(path: Path = LIST) -> dict[str, Offenders]:
    """What may offend still, by guard; or the budgets, by table."""
    return tomllib.loads(path.read_text(encoding="utf-8"))


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


HEADS = {
    LIST: "# What offends today, by guard of test_house.py; it may only shrink: `python scripts/house.py --shrink`.\n",
    BUDGETS: "# What there may be at most, by table of `amounts`; `scripts/house.py --shrink` lowers it, only a decision raises it.\n",
}


def as_toml(head: str, lists: Mapping[str, Mapping[str, int]]) -> str:
    """A list as its file holds it."""
    tables = ("\n".join([f"\n[{guard}]", *(f'"{name}" = {n}' for name, n in sorted(rows.items()))]) for guard, rows in lists.items())
    return head + "\n".join(tables) + "\n"
