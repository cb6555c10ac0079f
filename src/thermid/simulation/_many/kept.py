"""What finished tasks leave in a folder, so that an interrupt, a kill or another day costs only what was under way."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass
from importlib import import_module
from inspect import ismodule
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from thermid.base.files import FileKinds, sweep
from thermid.base.units import Memo


def digest(thing: Any) -> str:
    """Return a hash of numbers, texts, arrays, tables, objects and functions, however nested: 16 hexadecimal digits."""
    return hashlib.sha256(json.dumps(_plain(thing, {}), sort_keys=True).encode()).hexdigest()[:16]


def _plain(thing: Any, numbered: dict[int, tuple[Any, int]]) -> Any:
    """Return a thing as JSON holds it: arrays by their hash, objects by their parts, functions by their names.

    A local function counts by its place and by what it refers to. `numbered` has the objects on the way, each once: they may refer to one
    another.
    """
    if isinstance(thing, np.ndarray):
        return [str(thing.dtype), list(thing.shape), hashlib.sha256(np.ascontiguousarray(thing).tobytes()).hexdigest()]
    if isinstance(thing, float | np.generic):
        return float(thing).hex() if isinstance(thing, float) else thing.item()
    if isinstance(thing, str | int | None):
        return thing
    if isinstance(thing, bytes):  # of an instant, as it is copied
        return ["bytes", thing.hex()]
    if id(thing) in numbered:
        return ["seen", numbered[id(thing)][1]]
    numbered[id(thing)] = thing, len(numbered)  # with the thing itself, so that no other takes its number
    if isinstance(thing, Mapping) and not isinstance(thing, Memo):
        return {str(k): _plain(v, numbered) for k, v in thing.items()}
    if isinstance(thing, set | frozenset):
        return ["set", *sorted(digest(v) for v in thing)]
    if isinstance(thing, tuple | list):
        return [_plain(v, numbered) for v in thing]
    if callable(thing) and hasattr(thing, "__qualname__"):
        cells = [c.cell_contents for c in getattr(thing, "__closure__", None) or ()]
        owner = getattr(thing, "__self__", None)  # of a built-in function its module
        return [thing.__module__, thing.__qualname__, *(_plain(x, numbered) for x in (cells, None if ismodule(owner) else owner))]
    if is_dataclass(thing):
        return [type(thing).__name__, *(_plain(getattr(thing, f.name), numbered) for f in fields(thing))]
    whole = "__reduce__" in vars(type(thing)) or not hasattr(thing, "__dict__")
    return _plain(thing.__reduce__() if whole else (type(thing), vars(thing)), numbered)


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
        """Return name -> array that a finished task saved, of any shape; None where its file is missing or cannot be read."""
        try:
            with (self.place / f"{name}.npz").open("rb") as file, np.load(file) as data:
                return dict(data)
        except (OSError, ValueError, KeyError, EOFError, BadZipFile):
            return None

    def save(self, name: str, arrays: Mapping[str, Any]) -> None:
        """Save arrays by name under the name of a task; the file appears when it is whole."""
        with FileKinds.RESULTS_FILE.replacing(self.place / f"{name}.npz") as half:
            np.savez(half, **arrays)


def taken_apart(thing: Any, arrays: dict[str, Any]) -> Any:
    """Return a result as JSON holds it; its arrays go into `arrays`."""
    if isinstance(thing, np.ndarray):
        arrays[name := f"array_{len(arrays)}"] = thing
        return {"array": name}
    if is_dataclass(thing):
        parts = {f.name: taken_apart(getattr(thing, f.name), arrays) for f in fields(thing) if f.init}
        return {"class": [type(thing).__module__, type(thing).__qualname__], "parts": parts}
    if isinstance(thing, Mapping):
        return {"table": [[taken_apart(x, arrays) for x in item] for item in thing.items()]}
    if isinstance(thing, tuple):
        return {"tuple": [taken_apart(x, arrays) for x in thing]}
    if isinstance(thing, list):
        return [taken_apart(x, arrays) for x in thing]
    return thing.item() if isinstance(thing, np.generic) else thing


def restored(thing: Any, arrays: Mapping[str, Any]) -> Any:
    """Return the result of which `taken_apart` made something; objects are dataclasses of this package alone."""
    if isinstance(thing, list):
        return [restored(x, arrays) for x in thing]
    if not isinstance(thing, dict):
        return thing
    if "array" in thing:
        return arrays[thing["array"]]
    if "table" in thing:
        return dict(tuple(restored(item, arrays)) for item in thing["table"])
    if "tuple" in thing:
        return tuple(restored(thing["tuple"], arrays))
    module, name = thing["class"]
    result_class = getattr(import_module(module), name) if module.startswith("thermid.") else None
    if not (isinstance(result_class, type) and is_dataclass(result_class)):
        raise ValueError(f"{module}.{name} is no result.")
    return result_class(**{n: restored(x, arrays) for n, x in thing["parts"].items()})
