"""Files that appear when they are whole: who interrupts a long export finds the file of before, or none."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

__all__ = ["whole"]


@contextmanager
def whole(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield where to write; what is there takes the name `path` at the end, and goes when writing ends early.

    Raises
    ------
    OSError   When nothing can be written there; it names `path`.
    """
    target = Path(path)
    if target.is_symlink():
        target = target.resolve()
    if (target.exists() and not target.is_file()) or not target.parent.is_dir():  # a pipe, a device, or what is refused
        yield target
        return
    half = target.with_name(f".{os.getpid()}.half.{target.name}")  # with its ending, which may ask for compression
    try:
        yield half
        half.replace(target)
    except OSError as error:
        if error.filename is not None and Path(os.fsdecode(error.filename)) == half:
            error.filename = str(target)
        raise
    finally:
        half.unlink(missing_ok=True)
