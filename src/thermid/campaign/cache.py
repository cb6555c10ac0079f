"""What a results folder keeps: the ends of finished stages, and logs as they were read, each under the hash of all that it depends on."""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from thermid.files import OWN, write_text

Array = NDArray[np.float64]


@cache
def code_digest() -> str:
    """Return the hash of what computes: this package as it lies on the disk, its kernel, Python, numpy and scipy.

    A version number would not do: it stays as it is while somebody works on the code.
    """
    import scipy

    total = hashlib.sha256(f"{sys.version} {np.__version__} {scipy.__version__}".encode())
    for path in _code():
        total.update(path.name.encode() + b"\0" + hashlib.sha256(path.read_bytes()).digest())
    return total.hexdigest()


def _code() -> list[Path]:
    """Return the files of this package, and its kernel, which may lie elsewhere."""
    package, kernel = (Path(spec.origin) for name in ("thermid", "thermid._kernel") if (spec := find_spec(name)) and spec.origin)
    return [*sorted(package.parent.rglob("*.py")), kernel]


def file_name(stage: str) -> str:
    """Return the name of a stage as part of a file's name."""
    return "".join(c if c.isalnum() or c in "-_" else "_" for c in stage)


def recall(folder: Path | None, stage: str, key: str) -> dict[str, float] | None:
    """Return name -> fitted form of a finished stage, or None when nothing is kept or anything has changed since."""
    path = folder / f"{file_name(stage)}.fit.json" if folder is not None else None
    if path is None or not path.is_file():
        return None
    try:
        kept = json.loads(path.read_text(encoding="utf-8"))
        fitted = {str(k): float(v) for k, v in kept["fitted"].items()}
        return fitted if (kept["key"], kept["code"]) == (key, code_digest()) and np.isfinite(list(fitted.values())).all() else None
    except (ValueError, KeyError, TypeError, AttributeError):
        return None  # a damaged file is as good as none: the stage runs again


def changed_since(folder: Path | None, stage: str, ingredients: Mapping[str, str]) -> tuple[str, ...]:
    """Return which ingredients of a stage's result are not those of the end that is kept; none where nothing is kept."""
    path = folder / f"{file_name(stage)}.fit.json" if folder is not None else None
    if path is None or not path.is_file():
        return ()
    try:
        kept = json.loads(path.read_text(encoding="utf-8"))
        before = {str(k): str(v) for k, v in kept.get("ingredients", {}).items()}
        names = [n for n in {**before, **ingredients} if before.get(n) != ingredients.get(n)]
        return (*names, *(["code"] if kept["code"] != code_digest() else []))
    except (ValueError, KeyError, TypeError, AttributeError):
        return ("the kept file is damaged",)


def remember(
    folder: Path | None, stage: str, key: str, names: Sequence[str], fitted: Array, ingredients: Mapping[str, str] | None = None
) -> None:
    """Keep the end of a stage, with the hashes of what it depends on."""
    if folder is None:
        return
    folder.mkdir(parents=True, exist_ok=True)
    end = dict(zip(names, map(float, fitted), strict=True))
    content = {"key": key, "code": code_digest(), "ingredients": dict(ingredients or {}), "fitted": end}
    write_text(folder / f"{file_name(stage)}.fit.json", json.dumps(content, indent=1), OWN)
