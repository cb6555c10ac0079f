"""JSON Schemas in the folder of a project, and the first line by which an editor finds that of a file."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Final

from thermid.base.errors import ThermidError
from thermid.base.extensions import by_grammar, file_kinds, json_schema
from thermid.base.files import COPY, FileKind, may_write, parse_toml, read_text, write_bytes, write_text

SCHEMA: Final = FileKind("JSON Schema", endings=(".json",))
FOLDER: Final = "schema"
"""Folder of the schemas, in that of the project."""


def headed(text: str, kind: str, depth: int = 0) -> str:
    """Return the text of a file with its first line, `#:schema PATH`, as editors with a TOML language server read it.

    Parameters
    ----------
    text : str      The file.
    kind : str      Its kind, of `file_kinds`.
    depth : int     How many folders it lies below that of the project.
    """
    return f"#:schema {'../' * depth or './'}{_place(kind).as_posix()}\n{text}"


def may_write_schemas(folder: Path, kinds: Iterable[str]) -> None:
    """Ask whether the schemas may be written, where their folder is there.

    Raises
    ------
    OutputError   When a file is there that thermid did not write.
    """
    for kind in kinds if (folder / FOLDER).is_dir() else ():
        may_write(folder / _place(kind), SCHEMA.titled(kind))


def write_schemas(folder: Path, kinds: Iterable[str]) -> list[Path]:
    """Write the schemas of kinds of files and return their paths.

    Raises
    ------
    OutputError   When a file is there that thermid did not write.
    """
    (folder / FOLDER).mkdir(exist_ok=True)
    return [write_text(folder / _place(k), json.dumps(json_schema(k), indent=2), SCHEMA.titled(k)) for k in sorted(set(kinds))]


def head_copies(folder: Path, files: Sequence[Path]) -> list[Path]:
    """Give copied TOML files their first line, write the schemas, and return these.

    Files below a lock stay as they are: it holds their checksums.

    Parameters
    ----------
    folder : Path       Of the project.
    files : sequence    Its files.
    """
    locked = {file.parent for file in files if file.name.endswith(".lock.json")}
    texts = {f: read_text(f) for f in files if f.suffix == ".toml" and locked.isdisjoint(f.parents)}
    kind_of_file = {file: kind for file, text in texts.items() if (kind := kind_of(text))}
    for file, kind in kind_of_file.items():
        file.unlink()
        write_bytes(file, headed(texts[file], kind, len(file.relative_to(folder).parents) - 1).encode(), COPY)
    return write_schemas(folder, kind_of_file.values()) if kind_of_file else []


def kind_of(text: str) -> str:
    """Return the kind of a TOML file: the one whose grammar it follows; empty where none does, or several do."""
    try:
        content = parse_toml(text)
    except tomllib.TOMLDecodeError:
        return ""
    kinds = [kind for kind in file_kinds() if _follows(kind, content)]
    return kinds[0] if len(kinds) == 1 else ""


def _follows(kind: str, content: object) -> bool:
    try:
        by_grammar(kind, content, lambda key: key)
    except ThermidError:
        return False
    return True


def _place(kind: str) -> Path:
    return Path(FOLDER, f"{kind}.schema.json")
