"""What the architecture tests look at: every module of the package as a syntax tree, and every import in it, by statement and by text."""

from __future__ import annotations

import ast
import re
from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

ROOT = Path(__file__).parents[2]
SOURCE = ROOT / "src"
TESTS = ROOT / "tests"

FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)
_DOTTED = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*")


@dataclass(frozen=True)
class Import:
    """One imported module; `names` are those taken from it (empty for `import x`)."""

    target: str
    names: tuple[str, ...]
    line: int
    lazy: bool
    typing: bool


@dataclass(frozen=True)
class Module:
    """A module of the package, by its dotted name; with its stub, of which the imports are for the type checker."""

    name: str
    text: str
    package: bool = False
    stub: str = ""

    @cached_property
    def tree(self) -> ast.Module:
        return ast.parse(self.text)

    @cached_property
    def nodes(self) -> tuple[ast.AST, ...]:
        """Every node of the tree, in the order of `ast.walk`."""
        return tuple(ast.walk(self.tree))

    @property
    def room(self) -> str:
        """First name below `thermid`; empty for the package's own `__init__`."""
        return room_of(self.name)

    @property
    def path(self) -> Path:
        """Where the file of a module of the package lies."""
        return SOURCE / Path(*self.name.split("."), *(["__init__.py"] if self.package else [])).with_suffix(".py")

    @cached_property
    def gives_names(self) -> bool:
        """Whether the module does nothing but give names of the inside of its room."""
        body = [node for node in self.tree.body if not (isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant))]
        given = (isinstance(n, ast.ImportFrom) and all(alias.asname == alias.name for alias in n.names) for n in body)
        return bool(body) and not self.package and all(given)

    def imports(self, stub: bool = True) -> tuple[Import, ...]:
        """Every import by a statement or a call, wherever it stands: at the top, inside a function, for the type checker only."""
        return (*self._own_imports, *self.stub_imports) if stub else self._own_imports

    @cached_property
    def _own_imports(self) -> tuple[Import, ...]:
        return tuple(self._imports(self.nodes))

    @cached_property
    def stub_imports(self) -> tuple[Import, ...]:
        """The imports of its stub, which name what it offers."""
        return tuple(replace(found, typing=True) for found in self._imports(tuple(ast.walk(ast.parse(self.stub)))))

    def imports_by_text(self, known: Collection[str]) -> tuple[Import, ...]:
        """Modules of `known` that texts of the module name, alone or with one name in them: whoever has the text can import them.

        A text is a constant (``"thermid.model._deck.schema.Deck"``), a tuple of constants with dots between them
        (``("thermid.site", "surroundings", "surrounded")``), or a dotted constant after the beginning that a formatted text of the same
        module gives it (``"fit.swap"`` beside ``f"thermid.app.cli.{module}"``).
        """
        imports = []
        for text, line in self._texts:
            module, _, name = text.rpartition(".")
            if text in known:
                imports.append(Import(text, (), line, lazy=True, typing=False))
            elif module != "thermid" and module in known:
                imports.append(Import(module, (name,), line, lazy=True, typing=False))
        return tuple(imports)

    @cached_property
    def _texts(self) -> tuple[tuple[str, int], ...]:
        """Texts that begin as names of the package do, with their lines."""
        texts = set()
        beginnings = set()
        for node in (n for n in self.nodes if isinstance(n, ast.Constant | ast.Tuple | ast.JoinedStr)):
            match node:
                case ast.Constant(value=str(text)) if _DOTTED.fullmatch(text):
                    texts.add((text, node.lineno))
                case ast.Tuple(elts=[ast.Constant(value=str(first)), *_]) if first.startswith("thermid."):
                    texts.add((".".join(str(e.value) for e in node.elts if isinstance(e, ast.Constant)), node.lineno))
                case ast.JoinedStr(values=[ast.Constant(value=str(first)), *_]) if re.fullmatch(r"thermid\.(\w+\.)+", first):
                    beginnings.add(first)
        texts |= {(first + text, line) for text, line in texts for first in beginnings if "." in text}
        return tuple(sorted((text, line) for text, line in texts if text.startswith("thermid.")))

    def _imports(self, nodes: Collection[ast.AST]) -> Iterator[Import]:
        inside = [(n.lineno, n.end_lineno or 0) for n in nodes if isinstance(n, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda)]
        checked = [n.body for n in nodes if isinstance(n, ast.If) and "TYPE_CHECKING" in ast.dump(n.test)]
        for_types = [(body[0].lineno, body[-1].end_lineno or 0) for body in checked]
        for node in nodes:
            if not isinstance(node, ast.Import | ast.ImportFrom | ast.Call):
                continue
            lazy, typing = (any(a <= node.lineno <= b for a, b in spans) for spans in (inside, for_types))
            if isinstance(node, ast.Import):
                yield from (Import(alias.name, (), node.lineno, lazy, typing) for alias in node.names)
            elif isinstance(node, ast.ImportFrom):
                yield Import(self.absolute(node), tuple(alias.name for alias in node.names), node.lineno, lazy, typing)
            elif text := _imported_by_text(node):
                yield Import(text, (), node.lineno, lazy, typing)

    def absolute(self, node: ast.ImportFrom) -> str:
        """The module that a statement imports from, by its full name."""
        if not node.level:
            return node.module or ""
        parts = self.name.split(".")
        base = parts[: len(parts) - node.level + self.package]
        return ".".join([*base, *([node.module] if node.module else [])])


def room_of(name: str) -> str:
    """First name below `thermid` in a dotted name."""
    return name.split(".")[1] if "." in name else ""


def is_inner(name: str) -> bool:
    """Whether a module is inside its room: a part of its name below the room begins with an underscore (`thermid._kernel` has no room)."""
    return any(part.startswith("_") for part in name.split(".")[2:])


def is_below_init(name: str) -> bool:
    """Whether a module is inside its room as long as no name says so: anything below the room's `__init__`."""
    return name.count(".") > 1


def _imported_by_text(call: ast.Call) -> str:
    name = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
    if name in {"import_module", "__import__"} and call.args and isinstance(call.args[0], ast.Constant):
        return str(call.args[0].value)
    return ""


def within(imported: Import, known: Collection[str]) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Modules of the package that one import reaches, each with the names taken from it; a submodule taken by name counts as itself."""
    if imported.target.partition(".")[0] != "thermid":
        return
    plain = tuple(name for name in imported.names if f"{imported.target}.{name}" not in known)
    for name in imported.names:
        if name not in plain:
            yield f"{imported.target}.{name}", ()
    if plain or not imported.names:
        yield imported.target, plain


def read_modules() -> dict[str, Module]:
    """Every Python module below src/thermid by its dotted name."""
    found = {}
    for path in sorted((SOURCE / "thermid").rglob("*.py")):
        parts = path.relative_to(SOURCE).with_suffix("").parts
        package = parts[-1] == "__init__"
        name = ".".join(parts[:-1] if package else parts)
        stub = path.with_suffix(".pyi")
        found[name] = Module(name, path.read_text(encoding="utf-8"), package, stub.read_text(encoding="utf-8") if stub.exists() else "")
    return found


def read_tests() -> dict[str, str]:
    """The text of every Python file of the tests, by its path below their folder."""
    return {path.relative_to(TESTS).as_posix(): path.read_text(encoding="utf-8") for path in sorted(TESTS.rglob("*.py"))}
