"""What finished tasks leave in a folder, so that an interrupt, a kill or another day costs only what was under way."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, is_dataclass
from functools import partial
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from thermid.base.files import RESULTS_FILE, replacing, sweep
from thermid.base.memo import Memo

if TYPE_CHECKING:
    from thermid.simulation._many.tasks import Workers

ABOUT = "about"
"""Entry of a kept result that says how its arrays belong together."""


def digest(thing: Any) -> str:
    """Return a hash of numbers, texts, arrays, tables, objects and functions, however nested: 16 hexadecimal digits."""
    return hashlib.sha256(json.dumps(_plain(thing, {}), sort_keys=True).encode()).hexdigest()[:16]


def _plain(thing: Any, seen: dict[int, tuple[Any, int]]) -> Any:
    """Return a thing as JSON holds it: arrays by their hash, objects and partial functions by their parts, functions by their names.

    A local function counts by its place and by what it holds. `seen` has the objects on the way, each once: they may refer to one another.
    """
    if isinstance(thing, np.ndarray):
        return [str(thing.dtype), list(thing.shape), hashlib.sha256(np.ascontiguousarray(thing).tobytes()).hexdigest()]
    if isinstance(thing, str | int | None):
        return thing
    if isinstance(thing, float | np.generic):
        return float(thing).hex() if isinstance(thing, float) else thing.item()
    if id(thing) in seen:
        return ["seen", seen[id(thing)][1]]
    seen[id(thing)] = thing, len(seen)  # it is held, so that no other takes its number
    if isinstance(thing, Memo):
        return "memo"
    if isinstance(thing, Mapping):
        return {str(k): _plain(v, seen) for k, v in thing.items()}
    if isinstance(thing, tuple | list):
        return [_plain(v, seen) for v in thing]
    if isinstance(thing, set | frozenset):
        return ["set", *sorted(json.dumps(_plain(v, seen), sort_keys=True) for v in thing)]
    if isinstance(thing, partial):
        return ["partial", *(_plain(x, seen) for x in (thing.func, thing.args, thing.keywords))]
    if callable(thing) and hasattr(thing, "__qualname__"):
        held = [c.cell_contents for c in getattr(thing, "__closure__", None) or ()]
        held += [x for x in (getattr(thing, "__self__", None), getattr(thing, "__defaults__", None)) if x is not None]
        return [thing.__module__ or "", thing.__qualname__, *_plain(held, seen)]
    if is_dataclass(thing):
        return [type(thing).__name__, *(_plain(getattr(thing, f.name), seen) for f in fields(thing))]
    if type(thing).__reduce__ is not object.__reduce__:
        return _plain(thing.__reduce__(), seen)
    return [type(thing).__name__, _plain(vars(thing), seen)]


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


@dataclass(frozen=True)
class KeptTasks:
    """Workers whose finished tasks stay in a folder: the `executor` of any loop, which then goes on where an earlier one ended.

    A task is known by what it computes, from which values, and by the version of thermid. Results are kept as arrays and JSON; nothing in
    the folder is run.

    Parameters
    ----------
    folder : path               It may serve any number of loops.
    workers : see `Workers`     Who does the tasks that the folder does not have.
    """

    folder: str | os.PathLike[str]
    workers: Workers = None

    def key(self, function: Callable[..., Any], arguments: tuple[Any, ...]) -> str:
        """Return the name of a task."""
        return digest((version("thermid"), function, arguments))

    def load(self, key: str) -> tuple[Any] | None:
        """Return what a finished task returned, alone in a tuple; None where it is not there."""
        arrays = JobFolder(Path(self.folder)).load(key)
        return (_restored(json.loads(str(arrays[ABOUT])), arrays),) if arrays is not None and ABOUT in arrays else None

    def save(self, key: str, result: Any) -> None:
        """Keep what a task returned: numbers, texts, arrays, and dataclasses, tuples, lists and tables of them."""
        arrays: dict[str, Any] = {}
        about = json.dumps(_taken_apart(result, arrays))
        Path(self.folder).mkdir(parents=True, exist_ok=True)
        JobFolder(Path(self.folder)).save(key, {**arrays, ABOUT: np.array(about)})


def _taken_apart(thing: Any, arrays: dict[str, Any]) -> Any:
    """Return a result as JSON holds it; its arrays go into `arrays`."""
    if isinstance(thing, np.ndarray):
        arrays[name := f"array_{len(arrays)}"] = thing
        return {"array": name}
    if is_dataclass(thing):
        parts = {f.name: _taken_apart(getattr(thing, f.name), arrays) for f in fields(thing) if f.init}
        return {"class": [type(thing).__module__, type(thing).__qualname__], "parts": parts}
    if isinstance(thing, Mapping):
        return {"table": [[_taken_apart(x, arrays) for x in item] for item in thing.items()]}
    if isinstance(thing, tuple):
        return {"tuple": [_taken_apart(x, arrays) for x in thing]}
    if isinstance(thing, list):
        return [_taken_apart(x, arrays) for x in thing]
    return thing.item() if isinstance(thing, np.generic) else thing


def _restored(thing: Any, arrays: Mapping[str, Any]) -> Any:
    """Return the result of which `_taken_apart` made something; objects are dataclasses of this package alone."""
    if isinstance(thing, list):
        return [_restored(x, arrays) for x in thing]
    if not isinstance(thing, dict):
        return thing
    if "array" in thing:
        return arrays[thing["array"]]
    if "table" in thing:
        return dict(tuple(_restored(item, arrays)) for item in thing["table"])
    if "tuple" in thing:
        return tuple(_restored(thing["tuple"], arrays))
    module, name = thing["class"]
    made = getattr(import_module(module), name) if module.startswith("thermid.") else None
    if not (isinstance(made, type) and is_dataclass(made)):
        raise ValueError(f"{module}.{name} is no result.")
    return made(**{n: _restored(x, arrays) for n, x in thing["parts"].items()})
