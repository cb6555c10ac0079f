"""`Watch`: whether a file that a deck or campaign rests on has changed on disk."""

from __future__ import annotations

import fnmatch
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from thermid.errors import ThermidError
from thermid.toml_files import project_root, read_toml

Stamp = tuple[int, int, int] | None
GLOB = "*?["


class Watch:
    """The files of one project, each with when it was last written and how large it is.

    Parameters
    ----------
    path : Path             The deck or campaign.
    roots : sequence        Folders of logs outside the project.
    apart : Path            A folder that is not looked into: what the studio itself writes.
    """

    def __init__(self, path: Path, roots: Sequence[Path], apart: Path) -> None:
        self._path, self._roots, self._apart = path, tuple(roots), apart.resolve()
        self._patterns: set[Path] = set()
        self._seen: dict[Path, Stamp] = {}
        self._seen = self._stamps()

    def changed(self) -> frozenset[Path]:
        """Return the files that were written, made or deleted since this was last asked."""
        known = {f: _stamp(f) for f in (*self._seen, *self._beside())}
        found = frozenset(f for f, stamp in known.items() if self._seen.get(f) != stamp)
        if found:
            self._seen = self._stamps()
        return found

    def _beside(self) -> list[Path]:
        """Return what may belong to the file: decks, scenarios, plans and tables of its folder, those inside and the one above; logs."""
        folder, root = self._path.parent, project_root(self._path.parent)
        found = [*folder.glob("*.toml"), *folder.glob("*/*.toml"), *(folder.parent.glob("*.toml") if folder != root else ())]
        found += [f for pattern in self._patterns for f in _matching(pattern)]
        return [f for f in found if not f.resolve().is_relative_to(self._apart)]

    def _stamps(self) -> dict[Path, Stamp]:
        """Return file -> stamp of all that there is to watch; a broken file keeps those watched that it named before."""
        found: dict[Path, Stamp] = {f: _stamp(f) for f in (*self._seen, *self._beside())}
        walked: set[Path] = set()
        waiting, root = [self._path], project_root(self._path.parent)
        while waiting:
            file = waiting.pop()
            walked.add(file)
            found[file] = _stamp(file)
            try:
                content = read_toml(file)[0]
            except ThermidError:
                continue
            for text in _texts(content):
                for named in _named(file.parent, text, self._roots):
                    if any(mark in named.name for mark in GLOB):
                        self._patterns.add(named)
                    elif named.suffix == ".toml" and named not in walked and named.resolve().is_relative_to(root):
                        waiting.append(named)
                    else:
                        found.setdefault(named, _stamp(named))
        return found | {f: _stamp(f) for pattern in self._patterns for f in _matching(pattern)}


def _stamp(file: Path) -> Stamp:
    try:
        found = file.stat()
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size, found.st_ino


def _texts(value: Any) -> Iterator[str]:
    """Yield every text in a file's content."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, Mapping):
        for inner in value.values():
            yield from _texts(inner)
    elif isinstance(value, list):
        for inner in value:
            yield from _texts(inner)


def _named(folder: Path, text: str, roots: Sequence[Path]) -> Iterator[Path]:
    """Yield the files that a text may name: decks also where they are missing, patterns of logs as they stand."""
    if not text or len(text) > 255 or "\0" in text or "\n" in text:
        return
    for root in (folder, *roots):
        target = root / text
        if any(mark in text for mark in GLOB):
            if target.parent.is_dir():
                yield target
        elif target.suffix == ".toml" or (target.suffix and target.is_file()):
            yield target


def _matching(pattern: Path) -> Iterator[Path]:
    """Yield the files of a folder that a pattern matches."""
    try:
        names = os.listdir(pattern.parent)
    except OSError:
        return
    yield from (pattern.parent / n for n in fnmatch.filter(names, pattern.name))
