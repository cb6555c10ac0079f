"""What finished tasks leave in a folder, so that an interrupt, a kill or another day costs only what was under way."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass
from functools import partial
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from thermid.base.files import RESULTS_FILE, replacing, sweep


def digest(thing: Any) -> str:
    """Return a hash of numbers, texts, arrays, tables, dataclasses and functions of modules, however nested: 16 hexadecimal digits."""
    return hashlib.sha256(json.dumps(_plain(thing), sort_keys=True).encode()).hexdigest()[:16]


def _plain(thing: Any) -> Any:
    """Return a thing as JSON holds it: arrays by their hash, dataclasses and partial functions by their parts, functions by their names."""
    if isinstance(thing, np.ndarray):
        return [str(thing.dtype), list(thing.shape), hashlib.sha256(np.ascontiguousarray(thing).tobytes()).hexdigest()]
    if is_dataclass(thing):
        return [type(thing).__name__, *(_plain(getattr(thing, f.name)) for f in fields(thing))]
    if isinstance(thing, Mapping):
        return {str(k): _plain(v) for k, v in thing.items()}
    if isinstance(thing, tuple | list):
        return [_plain(v) for v in thing]
    if isinstance(thing, partial):
        return ["partial", _plain(thing.func), _plain(thing.args), _plain(thing.keywords)]
    if callable(thing) and "<" not in getattr(thing, "__qualname__", "<"):  # a local function may hold what its name does not say
        return [thing.__module__ or "", thing.__qualname__]
    return thing.item() if isinstance(thing, np.generic) else float(thing).hex() if isinstance(thing, float) else thing


@dataclass(frozen=True)
class JobFolder:
    """Arrays that tasks of one job left, a file for each task; the folder's name is the hash of all that they depend on.

    Parameters
    ----------
    place : Path
    """

    place: Path

    @classmethod
    def below(cls, folder: str | os.PathLike[str], key: str) -> JobFolder:
        """Return the folder of the job with a key below `folder`; it is created, and half-written files below are removed."""
        place = Path(folder) / key
        place.mkdir(parents=True, exist_ok=True)
        for job_folder in (place, *Path(folder).glob("[0-9a-f]" * 16)):  # a job that was killed may never be asked again
            sweep(job_folder)
        return cls(place)

    def load(self, name: str) -> dict[str, NDArray[Any]] | None:
        """Return the arrays by name that a finished task saved; None where its file is missing or cannot be read."""
        try:
            with (self.place / f"{name}.npz").open("rb") as file, np.load(file) as data:
                return dict(data)
        except (OSError, ValueError, KeyError, EOFError, BadZipFile):
            return None

    def save(self, name: str, arrays: Mapping[str, Any]) -> None:
        """Save arrays by name under the name of a task; the file appears when it is whole."""
        with replacing(self.place / f"{name}.npz", RESULTS_FILE) as half:
            np.savez(half, **arrays)
