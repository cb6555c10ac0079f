"""TOML files of every kind: where they lie, what they hold, and on which line each key stands."""

from __future__ import annotations

import contextlib
import json
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from thermid.base.errors import DeckError, cap, nearest, raising
from thermid.base.extensions import by_grammar, grammar_of, words_of_kind
from thermid.base.files import parse_toml, read_text

MARKER = "thermid.toml"
_HEADER = re.compile(r"^\s*\[\[?\s*([^\]]+?)\s*\]\]?\s*(#.*)?$")
_KEY = re.compile(r"""^\s*((?:"[^"]*"|'[^']*'|[A-Za-z0-9_-]+)(?:\s*\.\s*(?:"[^"]*"|'[^']*'|[A-Za-z0-9_-]+))*)\s*=""")


def _plain(raw: str) -> str:
    """Return a key path without quotation marks and blanks around its dots."""
    return ".".join(part.strip().strip("\"'") for part in re.findall(r"\"[^\"]*\"|'[^']*'|[A-Za-z0-9_-]+", raw))


def line_numbers(text: str) -> dict[str, int]:
    """Return key path -> line (from 1) of every header and key that stands on a line of its own.

    Entries of arrays of tables are numbered: ``stages.0.free``.
    """
    out: dict[str, int] = {}
    prefix, counts = "", {}  # type: tuple[str, dict[str, int]]
    for number, line in enumerate(text.splitlines(), start=1):
        header = _HEADER.match(line)
        if header:
            prefix = _plain(header[1])
            if line.lstrip().startswith("[["):
                counts[prefix] = counts.get(prefix, -1) + 1
                prefix = f"{prefix}.{counts[prefix]}"
            out.setdefault(prefix, number)
            continue
        key = _KEY.match(line)
        if key:
            path = _plain(key[1])
            out.setdefault(f"{prefix}.{path}" if prefix else path, number)
    return out


@dataclass(frozen=True)
class Places:
    """File, line and key path of each key, for messages.

    Parameters
    ----------
    file : str      Name of the file, or what stands for it.
    lines : dict    Key path -> line (from 1), or the place itself where another file holds the key.
    """

    file: str
    lines: Mapping[str, int | str] = field(default_factory=dict)

    def __call__(self, key: str = "") -> str:
        """Return the place of a key: with the line of the nearest key above where its own is not known."""
        steps = key.split(".")
        line = next((self.lines[k] for n in range(len(steps), 0, -1) if (k := ".".join(steps[:n])) in self.lines), None)
        place = line if isinstance(line, str) else f"{self.file}:{line}" if line else self.file
        return f"{place}, {key}" if key else place


def read_json(path: Path, kind: str) -> Any:
    """Return the content of a JSON file as its grammar has it; such files are carried on, so that they are no inputs of a command.

    Parameters
    ----------
    path : Path         The file.
    kind : str          As in `by_grammar`.

    Raises
    ------
    ThermidError    When it is not valid JSON, or does not follow the grammar.
    OSError         When it cannot be opened.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        grammar, text = grammar_of(kind), f"this is not valid JSON: {error}."
        raise grammar.fault(f"{grammar.lead}\n  {path}: {text}" if grammar.lead else text, str(path), code="file.not-valid") from None
    return by_grammar(kind, content, Places(str(path)))


def kind_of_text(data: bytes) -> str:
    """Return what a text is called that is a TOML or JSON file of a known kind; nothing where it is none."""
    for read in (tomllib.loads, json.loads):
        with contextlib.suppress(ValueError, RecursionError):
            content = read(data.decode("utf-8"))
            return words_of_kind(content) if isinstance(content, dict) else ""
    return ""


def project_root(start: Path) -> Path:
    """Return the nearest folder upward that holds ``thermid.toml``, or the start folder itself."""
    start = start.resolve()
    return next((folder for folder in (start, *start.parents) if (folder / MARKER).is_file()), start)


def resolve_inside(folder: Path, name: str, where: str, roots: tuple[Path, ...] = ()) -> Path:
    """Return the path of a file named in a deck; it must lie in the project or in one of `roots`.

    Raises
    ------
    DeckError   When it leaves them, symbolic links resolved.
    """
    root = project_root(folder)
    if "\0" in name:
        raise DeckError(f"{name!r} is not a file name.", where, code="file.not-found")
    path = (folder / name).resolve()
    if not any(path.is_relative_to(r) for r in (root, *(r.resolve() for r in roots))):
        raise DeckError(
            f"'{name}' lies outside the project ({MARKER} marks its root). Copy the file into the project, "
            f"or put an empty {MARKER} into the folder that holds both: it is then the root.",
            where,
            code="file.outside-project",
        )
    return path


def read_toml(path: Path) -> tuple[dict[str, Any], dict[str, int]]:
    """Return the content of a TOML file and the line of each key.

    Raises
    ------
    DeckError   When the file is missing, too large, not text, or no TOML.
    """
    if not path.is_file():
        if path.is_dir():
            raise DeckError(f"there is no file '{path}': it is a folder.", code="file.not-found")
        if path.exists():
            raise DeckError("this is a pipe or a device. Give the path of a file.", path.name, code="file.not-a-file")
        if not path.parent.is_dir():
            raise DeckError(f"there is no file '{path.name}', and no folder '{path.parent}'.", code="file.not-found")
        near = nearest(path.stem, {p.stem for p in path.parent.glob(f"*{path.suffix}")})
        near = near.replace("'?", f"{path.suffix}'?")
        raise DeckError(
            f"there is no file '{path.name}' in {f'{path.parent.name}/' if path.parent.name else 'this folder'}.{near}",
            code="file.not-found",
        )
    if path.stat().st_size > cap("text"):
        raise DeckError(
            f"the file has {path.stat().st_size / 1e6:.1f} MB; a deck is a text file of a few kilobytes. "
            f"Move tables of data into a log.{raising('text')}",
            path.name,
            code="cap.exceeded",
        )
    try:
        text = read_text(path, "utf-8-sig")
        return parse_toml(text), line_numbers(text)
    except UnicodeDecodeError:
        raise DeckError("the file is not UTF-8 text.", path.name, code="file.not-text") from None
    except tomllib.TOMLDecodeError as error:
        raise DeckError(
            f"this is not valid TOML: {error}. Put texts, and numbers with units, in quotes; begin comments with #.",
            path.name,
            code="file.not-valid",
        ) from None
