"""Files that a plan rests on, each with a hash: decks, limits, scenarios, and what those name in turn - weather, tables, logs."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from thermid.errors import DeckError
from thermid.files import read_bytes
from thermid.model.deck.modelfile import load_model, project_root, read_toml, resolve_inside

if TYPE_CHECKING:
    from thermid.qualify.plan_schema import PlanFile

__all__ = ["basis"]

LONGEST = 255
"""Characters that a file's name can have."""


def basis(target: Path, content: PlanFile, data: Path | None, where: Callable[[str], str]) -> dict[str, str]:
    """Return file -> hash: of a deck of the plan, of what its model means; of every other file, of its bytes.

    A file's name is its way from the plan, or ``data: ...`` in the folder of logs that the plan or the caller names.

    Parameters
    ----------
    target : Path       The plan's file.
    content : PlanFile  What it says.
    data : Path or None A folder of logs outside the project.
    where : callable    Key -> its place in the plan, for messages.

    Raises
    ------
    DeckError   When a file that the plan names is not there.
    """
    folder, source = target.parent, content.model
    decks = [*([source.deck] if source.deck else []), *(h.deck for h in content.hosts.values())]
    out = {name: load_model(resolve_inside(folder, name, where("model"))).identity() for name in decks}
    plain = [source.values, source.campaign, content.limits if isinstance(content.limits, str) else ""]
    plain += [t.scenario for t in content.tests if isinstance(t.scenario, str)]
    logs = data or (resolve_inside(folder, source.data, where("model.data")) if source.data else None)
    for name in (n for n in plain if n):
        file = resolve_inside(folder, name, where("files"))
        if not file.is_file():
            raise DeckError(f"there is no file '{name}'.", target.name)
        for one in _with_named(file, logs, set()):
            out[_name(one, folder, logs)] = hashlib.sha256(read_bytes(one)).hexdigest()
    return out


def _name(file: Path, folder: Path, logs: Path | None) -> str:
    """Return how a file is called: a folder of logs may be somewhere else tomorrow."""
    inside = logs is not None and file.is_relative_to(logs.resolve()) and not folder.resolve().is_relative_to(logs.resolve())
    return (
        f"data: {file.relative_to(logs.resolve()).as_posix()}"
        if logs and inside
        else Path(os.path.relpath(file, folder.resolve())).as_posix()
    )


def _with_named(file: Path, logs: Path | None, seen: set[Path]) -> Iterator[Path]:
    """Yield a file, and every file that it names, at any depth.

    Every text in a TOML file that is the name of a file counts, whatever its key: a key that is new tomorrow is not forgotten then.
    """
    if file in seen:
        return
    seen.add(file)
    yield file
    if file.suffix == ".toml":
        for key, text in _texts(read_toml(file)[0]):
            for found in _found(key, text, file.parent, logs):
                yield from _with_named(found, logs, seen)


def _texts(value: Any, key: str = "") -> Iterator[tuple[str, str]]:
    """Yield every text of a file with the key that it stands under."""
    if isinstance(value, str):
        yield key, value
    elif isinstance(value, dict):
        for name, inner in value.items():
            yield from _texts(inner, name)
    elif isinstance(value, list):
        for inner in value:
            yield from _texts(inner, key)


def _found(key: str, text: str, folder: Path, logs: Path | None) -> list[Path]:
    """Return the files that a text names, in the folder of logs first; none where it names none, or one outside of the project."""
    if not text or len(text) > LONGEST or "\0" in text or "\n" in text:
        return []
    roots = [r.resolve() for r in (project_root(folder), logs) if r is not None]
    for root in (r for r in (logs, folder) if r is not None):
        hits = sorted(root.glob(text)) if key == "files" and not Path(text).is_absolute() else [root / text]
        inside = [f for f in (h.resolve() for h in hits) if f.is_file() and any(f.is_relative_to(r) for r in roots)]
        if inside:
            return inside
    return []
