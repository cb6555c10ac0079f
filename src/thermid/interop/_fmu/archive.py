"""What an FMU's archive must be before anything of it is unpacked: it comes from somebody else."""

from __future__ import annotations

import stat
import zipfile
from collections import Counter
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path, PurePosixPath
from typing import Final

from thermid.base.errors import ThermidError, cap, raising

DESCRIPTION: Final = "modelDescription.xml"
BUILD: Final = "sources/buildDescription.xml"
"""FMPy reads it too."""
MOST_FILES: Final = 20_000
"""Files in an archive; FMUs with sources have some hundred."""


def check_archive(path: Path) -> None:
    """Refuse an archive that would unpack beside its folder, to more than the cap `unpacked`, or with declarations in its description.

    Raises
    ------
    ThermidError   Which file of the archive, and why.
    """
    try:
        with zipfile.ZipFile(path) as packed:
            for problem in _problems(packed):
                raise ThermidError(f"its archive is refused: {problem}", str(path), code="value.wrong-kind")
    except (zipfile.BadZipFile, OSError, NotImplementedError, RuntimeError, EOFError, ValueError) as error:
        raise ThermidError(f"it is no FMU that FMPy reads: {error}", str(path), code="value.wrong-kind") from error


def _problems(packed: zipfile.ZipFile) -> Iterator[str]:
    """Yield what is wrong with an archive, the first thing first."""
    files = packed.infolist()
    if len(files) > MOST_FILES:
        yield f"it has {len(files)} files."
    for name, times in Counter(file.filename.casefold() for file in files).items():
        if times > 1:
            yield f"it has {times} files of the name '{name}'."
    for file in files:
        place = PurePosixPath(file.orig_filename)
        if place.is_absolute() or ".." in place.parts or any(mark in file.orig_filename for mark in "\\:\0"):
            yield f"'{file.filename}' would be unpacked outside of its folder."
        if stat.S_ISLNK(file.external_attr >> 16):
            yield f"'{file.filename}' is a link."
        if file.flag_bits & 0x1:
            yield f"'{file.filename}' is encrypted."
    size = sum(file.file_size for file in files)
    if size > cap("unpacked"):
        yield f"it unpacks to {size / 1e6:.0f} MB.{raising('unpacked')}"
    for one, other in pairwise(sorted(files, key=lambda file: file.header_offset)):
        if one.header_offset + one.compress_size > other.header_offset:
            yield f"'{one.filename}' and '{other.filename}' share their bytes."
    if DESCRIPTION not in packed.namelist():
        yield f"it has no {DESCRIPTION}."
        return
    for name in {DESCRIPTION, BUILD} & {file.filename for file in files}:
        text = packed.read(name).replace(b"\0", b"")  # of two bytes a letter too
        for mark in (b"<!DOCTYPE", b"<!ENTITY"):
            if mark in text:
                yield f"{name} has a declaration ({mark[2:].decode()}), which an FMU does not need."
