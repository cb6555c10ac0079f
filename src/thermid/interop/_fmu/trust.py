"""Which FMUs may run: those that the user said so of once, by the SHA-256 of the archive.

It is kept in the user's folder of states. A campaign comes from whoever made the FMU, who would vouch for himself there.
"""

from __future__ import annotations

import hashlib
import os
from pathlib import Path
from typing import Final

from thermid.base.errors import ThermidError
from thermid.base.files import read_bytes, state_folder, trusting

KEPT: Final = "trusted-fmus"
"""The file: a line for each, its SHA-256 and its name."""


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
    kept = state_folder() / KEPT
    known = kept.read_text(encoding="utf-8").splitlines() if kept.is_file() else []
    if any(line.partition(" ")[0] == digest for line in known):
        return
    if not (trust or trusting()):
        raise ThermidError(
            "an FMU is a program, and it would run with your rights. If you trust who made it, repeat the command with --trust, or in "
            "Python fmu_model(path, trust=True): it is then remembered by its SHA-256, and not asked again.",
            str(path),
            code="fmu.not-trusted",
        )
    try:
        kept.parent.mkdir(parents=True, exist_ok=True)
        line = os.open(kept, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600)
        with os.fdopen(line, "w", encoding="utf-8") as file:
            file.write(f"{digest}  {path.name!r}\n")
    except OSError:  # where nothing can be kept it is asked again
        return
