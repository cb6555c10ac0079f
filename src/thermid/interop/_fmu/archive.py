"""What an FMU must be before anything of it is unpacked or run, as it comes from somebody else.

The archive can do no harm, and the user said once that its program may run. That is kept by SHA-256 in the user's folder of states: a
campaign comes from whoever made the FMU, who would vouch for himself there.
"""

from __future__ import annotations

import hashlib
import stat
import sys
import zipfile
from collections import Counter
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path, PurePosixPath
from typing import Final

from thermid.base.errors import ThermidError, cap, raising
from thermid.base.files import FileKinds, command, read_bytes, read_text, state_folder, trusting

DESCRIPTION: Final = "modelDescription.xml"
TRUSTED: Final = "trusted-fmus"
"""The file: a line for each, its SHA-256 and its name."""
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
        raise ThermidError(f"it is no FMU that FMPy reads: {error}", str(path), code="file.another-kind") from error


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
    for name in sorted({DESCRIPTION, BUILD} & {file.filename for file in files}):
        text = packed.read(name).replace(b"\0", b"")  # of two bytes a letter too
        for mark in (b"<!DOCTYPE", b"<!ENTITY"):
            if mark in text:
                yield f"{name} has a declaration ({mark[2:].decode()}), which an FMU does not need."


def digest_of(path: Path) -> str:
    """Return the SHA-256 of a file, in hexadecimal digits."""
    return hashlib.sha256(read_bytes(path)).hexdigest()


def check_trust(path: Path, digest: str, trust: bool) -> None:
    """Refuse an FMU that nobody trusts; remember one that is trusted now.

    Parameters
    ----------
    path : Path     The file.
    digest : str    Its SHA-256.
    trust : bool    Whether it is trusted now, as it is by a command with ``--trust``.

    Raises
    ------
    ThermidError    With how it is said.
    """
    list_file = state_folder() / TRUSTED
    lines = read_text(list_file) if list_file.is_file() else ""
    if f"{digest} " in lines:
        return
    if not (trust or trusting()):
        raise ThermidError(
            "an FMU is a program, and it would run with your rights. If you trust who made it, repeat the command with --trust, or in "
            "Python fmu_model(path, trust=True): it is then remembered by its SHA-256, and not asked again."
            + ("" if sys.platform == "linux" else " The limits of its process were tested on Linux only, not on this system."),
            str(path),
            code="fmu.not-trusted",
        )
    try:
        list_file.parent.mkdir(parents=True, exist_ok=True)
        with command(force=True):
            FileKinds.RESULTS_FILE.save_text(list_file, f"{lines}{digest} {path.name!r}\n")
    except OSError:  # where nothing can be kept it is asked again
        return
