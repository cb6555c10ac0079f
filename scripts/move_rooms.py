"""Move a tree of the layout of commit f02e5b31 into the rooms of rooms.toml: ``python scripts/move_rooms.py [ROOT]``.

It can be run on any open branch of the old layout, and refuses a tree that was moved. It

- moves modules and test folders by the tables `moves` and `tests`;
- rewrites every import: within a room, and in the tests of a room, from the module that
  defines the name; from elsewhere through the door that gives it, or from the module where no door does;
- writes the doors: modules that give the names which other rooms and the public tables take;
- rewrites dotted names and paths in texts, the public tables, and the depth of moved tests.

`ruff check --fix --select I` and `ruff format` lay out the imports afterwards. What remains is printed: modules that are imported whole.
"""

from __future__ import annotations

import ast
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path

HERE = Path(__file__).resolve().parent
TEXTS = {".py", ".pyi", ".md", ".toml", ".yml", ".in", ".txt", ".hpp", ".cpp", ".cff", ".js", ".html", ""}
"""Endings of the files of which texts are rewritten."""
CODE = ("src", "tests", "scripts", "benchmarks", "examples", "docs", "bench", "firmware")


def dotted(path: Path, top: Path) -> str:
    """Dotted name of a module by its file."""
    parts = path.relative_to(top).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


class Move:
    """The tables, applied to one tree."""

    def __init__(self, root: Path) -> None:
        tables = tomllib.loads((HERE / "rooms.toml").read_text(encoding="utf-8"))
        self.root, self.top = root, root / "src"
        self.moves = {f"thermid.{old}": f"thermid.{new}" for old, new in tables["moves"].items()}
        self.doors = {f"thermid.{door}": [f"thermid.{m}" for m in inner] for door, inner in tables["doors"].items()}
        self.titles = {f"thermid.{door}": text for door, text in tables["door_titles"].items()}
        self.packages = {f"thermid.{name}": text for name, text in tables["packages"].items()}
        self.spaces = {f"thermid.{old}": f"thermid.{new}" for old, new in tables["namespaces"].items()}
        self.tests = {f"tests/unit/{old}": f"tests/unit/{new}" for old, new in tables["tests"].items()}
        self.old = {dotted(p, self.top): p for p in sorted((self.top / "thermid").rglob("*.py"))}
        self.given: dict[str, set[tuple[str, str]]] = {door: set() for door in self.doors}
        self.whole: list[str] = []

    # names

    def new_name(self, name: str) -> str:
        """New name of an old module, package or what stands in one."""
        parts = name.split(".")
        for n in range(len(parts), 1, -1):
            if (head := ".".join(parts[:n])) in self.moves:
                return ".".join([self.moves[head], *parts[n:]])
        return name

    def origin(self, module: str, name: str) -> tuple[str, str]:
        """Old module that defines a name which a package gives, and the name; a module that is taken by name has no name left."""
        if f"{module}.{name}" in self.old:
            return f"{module}.{name}", ""
        if module in self.old and self.old[module].name == "__init__.py":
            if (module, name) in self.given_again:
                return self.origin(*self.given_again[module, name])
            if module in self.public and name in self.public[module]:
                return self.public[module][name], name
        return module, name

    @cached_property
    def given_again(self) -> dict[tuple[str, str], tuple[str, str]]:
        """Old package and a name that it gives -> the old module that it takes it from, and the name there."""
        out = {}
        for package, path in self.old.items():
            for node in ast.parse(path.read_text(encoding="utf-8")).body if path.name == "__init__.py" else ():
                if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("thermid."):
                    out |= {(package, a.asname or a.name): (node.module or "", a.name) for a in node.names}
        return out

    @cached_property
    def public(self) -> dict[str, dict[str, str]]:
        """Old namespace -> public name -> old module that defines it, by the tables of `thermid/__init__.py`."""
        tree = ast.parse(self.old["thermid"].read_text(encoding="utf-8"))
        assigned = [(n.targets[0], n.value) for n in tree.body if isinstance(n, ast.Assign)]
        tables = {t.id: ast.literal_eval(v) for t, v in assigned if isinstance(t, ast.Name) and t.id in ("_TOP", "_NAMESPACES")}
        spaces = {"thermid": tables["_TOP"]} | {f"thermid.{s}": names for s, names in tables["_NAMESPACES"].items()}
        out: dict[str, dict[str, str]] = {}
        for space, names in spaces.items():
            out[space] = {}
            for name, module in names.items():
                parts = f"thermid.{module}"
                if self.old[parts].name == "__init__.py":
                    for node in ast.parse(self.old[parts].read_text(encoding="utf-8")).body:
                        if isinstance(node, ast.ImportFrom) and any((a.asname or a.name) == name for a in node.names):
                            parts = node.module or parts
                out[space][name] = parts
        return out

    def door_of(self, module: str) -> str:
        """Door that gives the names of a new inner module; the module itself where no door does."""
        best = [(len(m), door) for door, inner in self.doors.items() for m in inner if module == m or module.startswith(f"{m}.")]
        return max(best)[1] if best else module

    @staticmethod
    def room(name: str) -> str:
        """Room of a new module."""
        return ".".join(name.split(".")[:2])

    def place(self, path: Path) -> str:
        """New room that a file belongs to, tests of a room included; empty for others."""
        text = path.relative_to(self.root).as_posix()
        if text.startswith("src/"):
            return self.room(self.new_name(dotted(path, self.top)))
        for old, new in sorted(self.tests.items(), key=lambda item: -len(item[0])):
            if text.startswith(f"{old}/"):
                text = text.replace(old, new, 1)
                break
        return f"thermid.{text.split('/')[2]}" if text.startswith("tests/unit/") and text.count("/") > 2 else ""

    # imports

    def imports(self, path: Path, text: str) -> Iterator[tuple[ast.stmt, list[tuple[str, str, str, str]]]]:
        """Import statements of the package in a file: for each alias new module, name (empty for the module), alias, old full name."""
        here = dotted(path, self.top).split(".") if path.is_relative_to(self.top) else []
        package = path.name == "__init__.py"
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.ImportFrom):
                module = node.module or ""
                if node.level and here:
                    base = here[: len(here) - node.level + package]
                    module = ".".join([*base, *([node.module] if node.module else [])])
                elif node.level:
                    continue
                if module != "thermid" and not module.startswith("thermid."):
                    continue
                rows = []
                for alias in node.names:
                    if module == "thermid" and f"thermid.{alias.name}" not in self.old:
                        rows.append((module, alias.name, alias.asname or "", f"{module}.{alias.name}"))  # a public name
                        continue
                    if module == "thermid" and not path.is_relative_to(self.top) and alias.name != "_kernel":
                        if f"thermid.{alias.name}" in self.public or alias.name == "errors":
                            rows.append((module, alias.name, alias.asname or "", f"{module}.{alias.name}"))  # a namespace
                            continue
                    found, name = self.origin(module, alias.name)
                    rows.append((self.new_name(found), name, alias.asname or "", f"{module}.{alias.name}"))
                yield node, rows
            elif isinstance(node, ast.Import) and any(a.name.startswith("thermid.") for a in node.names):
                yield node, [(self.new_name(a.name), "", a.asname or "", a.name) for a in node.names]

    def collect(self) -> None:
        """Fill the doors: what other rooms, and the public tables, take of inner modules."""
        for name, path in self.old.items():
            if name == "thermid" or (path.name == "__init__.py" and path.with_suffix(".pyi").exists()):
                continue
            for _, rows in self.imports(path, path.read_text(encoding="utf-8")):
                for module, taken, _, _ in rows:
                    if taken and module.startswith("thermid.") and self.room(module) != self.place(path):
                        self.give(module, taken)
        for names in self.public.values():
            for name, module in names.items():
                self.give(self.new_name(module), name)

    def give(self, module: str, name: str) -> None:
        """Let the door of a module give a name."""
        if (door := self.door_of(module)) in self.given and door != module:
            self.given[door].add((module, name))

    def statement(self, node: ast.stmt, rows: list[tuple[str, str, str, str]], path: Path) -> str:
        """The statement rewritten, with the same indent for each line."""
        here = self.place(path)
        lines = []
        grouped: dict[str, list[str]] = {}
        for module, name, alias, old in rows:
            as_ = f" as {alias}" if alias else ""
            if isinstance(node, ast.Import):
                lines.append(f"import {module}{as_}")
                continue
            if not name:  # a module
                parent, _, last = module.rpartition(".")
                if not alias and last != old.rpartition(".")[2]:
                    as_ = f" as {old.rpartition('.')[2]}"
                if self.room(module) != here and "._" in module.removeprefix("thermid._kernel") and module != "thermid._kernel":
                    self.whole.append(f"{path.relative_to(self.root)}:{node.lineno} {module}")
                grouped.setdefault(parent, []).append(f"{last}{as_}")
                continue
            target = module
            if self.room(module) != here and (door := self.door_of(module)) != module:
                if (module, name) in self.given.get(door, ()):
                    target = door
            grouped.setdefault(target, []).append(f"{name}{as_}")
        lines += [f"from {module} import {', '.join(names)}" for module, names in grouped.items()]
        return ("\n" + " " * node.col_offset).join(lines)

    def rewritten(self, path: Path, text: str) -> str:
        """Text of a Python file with its imports and the dotted names in its texts rewritten."""
        lines = text.encode().split(b"\n")
        starts = [0]
        for line in lines:
            starts.append(starts[-1] + len(line) + 1)
        data = text.encode()
        pieces, at = [], 0
        for node, rows in sorted(self.imports(path, text), key=lambda item: (item[0].lineno, item[0].col_offset)):
            begin = starts[node.lineno - 1] + node.col_offset
            end = starts[(node.end_lineno or node.lineno) - 1] + (node.end_col_offset or 0)
            new = self.statement(node, rows, path)
            old = data[begin:end].decode()
            comments = re.findall(r"#.*", old)
            pieces += [self.texts(data[at:begin].decode(), path), new + "".join(f"  {c}" for c in comments)]
            at = end
        return "".join([*pieces, self.texts(data[at:].decode(), path)])

    # texts

    @cached_property
    def dotted_names(self) -> re.Pattern[str]:
        """Dotted names of the package."""
        return re.compile(r"\bthermid((?:\.[A-Za-z_]\w*)+)")

    @cached_property
    def slashed(self) -> dict[str, str]:
        """Paths of old modules and packages below `thermid` -> the new ones."""
        pairs = {name: self.new_name(name) for name in self.old}
        return {
            old.removeprefix("thermid.").replace(".", "/"): new.removeprefix("thermid.").replace(".", "/")
            for old, new in pairs.items()
            if new != old
        }

    @cached_property
    def paths(self) -> re.Pattern[str]:
        """Paths of modules, the longest first, after ``src/thermid/`` or alone."""
        names = "|".join(re.escape(old) for old in sorted(self.slashed, key=len, reverse=True))
        return re.compile(rf"(?<![\w./-])(src/thermid/)?({names})(?![\w-])")

    @cached_property
    def test_paths(self) -> re.Pattern[str]:
        """Folders of tests that move, as paths and as names of modules."""
        names = "|".join(old.removeprefix("tests/unit/") for old in sorted(self.tests, key=len, reverse=True))
        return re.compile(rf"(?:tests/unit/(?P<path>{names})(?![\w-]))|(?:(?<=from )unit\.(?P<module>{names})(?=[. ]))")

    def texts(self, text: str, path: Path) -> str:
        """A text with dotted names of modules, and paths, as they are now."""

        def name(found: re.Match[str]) -> str:
            full = found.group(0)
            parts = full.split(".")
            space = ".".join(parts[:2])
            if len(parts) == 3 and full not in self.old and parts[2] in self.public.get(space, {}):
                return f"{self.spaces.get(space, space)}.{parts[2]}"  # a public name
            for n in range(len(parts), 1, -1):
                if (head := ".".join(parts[:n])) in self.old or head in self.moves:
                    return ".".join([self.new_name(head), *parts[n:]])
            return full

        text = self.dotted_names.sub(name, text)
        for old, new in self.spaces.items():
            text = re.sub(rf"\btd\.{old.removeprefix('thermid.')}\b", f"td.{new.removeprefix('thermid.')}", text)
        prose = path.suffix in (".md", ".toml") or path.name == "Makefile"

        def place(found: re.Match[str]) -> str:
            root, old = found.group(1) or "", found.group(2)
            return root + self.slashed[old] if root or (prose and "/" in old) else found.group(0)

        def tests(found: re.Match[str]) -> str:
            new = self.tests[f"tests/unit/{found['path'] or found['module']}"]
            return new if found["path"] else new.removeprefix("tests/").replace("/", ".")

        return self.paths.sub(place, self.test_paths.sub(tests, text))

    # the whole

    def run(self) -> None:
        """Move everything."""
        if (self.top / "thermid" / "base").exists():
            raise SystemExit("this tree has been moved already")
        self.collect()
        files = subprocess.run(["git", "-C", str(self.root), "ls-files"], check=True, capture_output=True, text=True).stdout.splitlines()
        new: dict[Path, str] = {}
        for file in files:
            path = self.root / file
            if (
                path.suffix not in TEXTS
                or file.endswith(".lock")
                or file in ("scripts/rooms.toml", "scripts/move_rooms.py", "CHANGELOG.md")
            ):
                continue
            try:
                text = path.read_text(encoding="utf-8")
            except (UnicodeDecodeError, FileNotFoundError):
                continue
            changed = self.rewritten(path, text) if path.suffix == ".py" and file.split("/")[0] in CODE else self.texts(text, path)
            if (more := self.deeper(file)) and path.suffix == ".py":
                changed = re.sub(
                    r"(__file__\)(?:\.resolve\(\))?\.parents\[)(\d)\]",
                    lambda m, more=more: f"{m.group(1)}{int(m.group(2)) + more}]",
                    changed,
                )
            if changed != text:
                new[path] = changed
        for path, text in new.items():
            path.write_text(text, encoding="utf-8")
        self.shift()
        self.write_doors()
        self.tables()
        print("modules taken whole from another room:", *sorted(self.whole), sep="\n  ")

    def deeper(self, file: str) -> int:
        """By how many folders a file moves further down."""
        if file.startswith("src/thermid/") and file.endswith(".py"):
            name = dotted(self.root / file, self.top)
            return self.new_name(name).count(".") - name.count(".")
        return next((new.count("/") - old.count("/") for old, new in self.tests.items() if file.startswith(f"{old}/")), 0)

    def shift(self) -> None:
        """Move the files."""
        package = self.top / "thermid"
        for stub in package.rglob("__init__.pyi"):
            stub.unlink()
        for gone in ("bench/__init__.py", "design/__init__.py"):  # namespaces that are rows of a table now
            (package / gone).unlink()
        self.git("mv", "src/thermid/results/__init__.py", "src/thermid/results.py")
        moves = {}
        for name, path in self.old.items():
            if not path.exists() and name != "thermid.results":
                continue
            to = self.new_name(name)
            if to != name:
                file = self.top / Path(*to.split("."))
                moves[path if name != "thermid.results" else package / "results.py"] = (
                    file / "__init__.py" if path.name == "__init__.py" and name != "thermid.results" else file.with_suffix(".py")
                )
        for path, to in moves.items():
            to.parent.mkdir(parents=True, exist_ok=True)
            if to.exists():
                raise SystemExit(f"{to} is there already")
            self.git("mv", str(path), str(to))
        for extra in sorted(p for p in package.rglob("*/*") if p.is_file() and p.suffix not in (".py", ".pyi", ".pyc", ".so")):
            folder = ".".join(extra.parent.relative_to(self.top).parts)
            if (to := self.new_name(folder)) != folder:
                target = self.top.joinpath(*to.split("."), extra.name)
                target.parent.mkdir(parents=True, exist_ok=True)
                self.git("mv", str(extra), str(target))
        for old, new in self.tests.items():
            (self.root / new).mkdir(parents=True, exist_ok=True)
            for path in sorted((self.root / old).iterdir()):
                if path.name != "__pycache__" and (self.root / new).name != path.name:
                    self.git("mv", str(path), str(self.root / new / path.name))
        for folder in sorted(package.rglob("*"), reverse=True):
            if folder.name == "__pycache__":
                for p in folder.iterdir():
                    p.unlink()
                folder.rmdir()
            elif folder.is_dir() and not any(folder.iterdir()):
                folder.rmdir()

    def git(self, *words: str) -> None:
        """Run git in the tree."""
        subprocess.run(["git", "-C", str(self.root), *words], check=True)

    def write_doors(self) -> None:
        """Write the doors."""
        for door, rows in self.given.items():
            path = self.top / Path(*door.split(".")).with_suffix(".py")
            names = [name for _, name in rows]
            if twice := {n for n in names if names.count(n) > 1}:
                raise SystemExit(f"{door} gives {twice} twice")
            modules = sorted({module for module, _ in rows})
            lines = [f"from {m} import {', '.join(f'{n} as {n}' for module, n in sorted(rows) if module == m)}" for m in modules]
            path.write_text(f'"""{self.titles[door]}"""\n\n' + "\n".join(lines) + "\n", encoding="utf-8")
        rooms = {f"thermid.{room}": "." for room in ("base", "app")}
        for package, text in (rooms | self.packages).items():
            path = self.top / Path(*package.split(".")) / "__init__.py"
            if not path.exists():
                path.write_text(f'"""{text}"""\n', encoding="utf-8")

    def tables(self) -> None:
        """Rewrite the public tables."""
        path = self.top / "thermid" / "__init__.py"
        text = path.read_text(encoding="utf-8")
        for names in self.public.values():
            for name, module in names.items():
                new = self.door_of(self.new_name(module)).removeprefix("thermid.")
                text = re.sub(rf'("{name}": )"[\w.]+"', rf'\1"{new}"', text)
        path.write_text(text, encoding="utf-8")


def renames() -> str:
    """Return docs/renames.md: where public names and modules of commit f02e5b31 went."""
    tables = tomllib.loads((HERE / "rooms.toml").read_text(encoding="utf-8"))
    rows = [f"| `td.{old}.NAME` | `td.{new}.NAME` |" for old, new in tables["namespaces"].items()]
    rows += [f"| `{old}` | `{new}` |" for old, new in tables["options"].items()]
    package = HERE.parent / "src" / "thermid"
    there = {new for new in tables["moves"].values() if list(package.glob(f"{new.replace('.', '/')}*"))}
    modules = [f"| `thermid.{old}` | {f'`thermid.{new}`' if new in there else 'gone'} |" for old, new in sorted(tables["moves"].items())]
    head = "| before | now |\n|---|---|\n"
    parts = [
        "# Renames",
        "Names of the public interface, and modules, as they were at commit f02e5b31 and as they are now. Written by `python "
        "scripts/move_rooms.py --page` from `scripts/rooms.toml`. Before version 0.1.0 names change once, without a transition.",
        "## Public names",
        head + "\n".join(rows),
        "## Modules",
        "A row for a package holds for every module in it that has no row of its own. A module whose name begins with an underscore is "
        "inside its room: import its names from `thermid`, or from a door of the room.",
        head + "\n".join(modules),
    ]
    return "\n\n".join(parts) + "\n"


if __name__ == "__main__" and "--page" in sys.argv:
    (HERE.parent / "docs" / "renames.md").write_text(renames(), encoding="utf-8")
elif __name__ == "__main__":
    Move(Path(sys.argv[1] if len(sys.argv) > 1 else HERE.parent).resolve()).run()
