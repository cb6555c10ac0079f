"""What a results folder keeps: the ends of finished stages, and logs as they were read, each under the hash of all that it depends on."""

from __future__ import annotations

import hashlib
import json
import sys
import zipfile
from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, fields
from functools import cache, partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from thermid.base.errors import ThermidError
from thermid.base.files import FileKinds, read_bytes
from thermid.base.units import Kelvin
from thermid.fit.calibration import KeptFit
from thermid.fit.error_model import Keeping
from thermid.measure.records import TEMPERATURES, Channel, Origin, Record, SensorPart

_ARRAYS = ("values", "valid", "masks")
_ABOUT = "about"


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


@dataclass(frozen=True)
class KeptStage:
    """What a results folder keeps of one stage.

    Parameters
    ----------
    folder : Path or None   The folder; None keeps nothing.
    stage : str             The stage.
    """

    folder: Path | None
    stage: str

    def _file(self, what: str) -> Path:
        """Return the file that keeps the fit or the errors of the stage."""
        return (self.folder or Path()) / f"{file_name(self.stage)}.{what}.json"

    def recall(self, key: str) -> KeptFit | None:
        """Return what is kept of the finished fit, or None when nothing is kept or anything has changed since."""
        if self.folder is None:
            return None
        try:
            stored = json.loads(self._file("fit").read_text(encoding="utf-8"))
            fitted = {str(k): float(v) for k, v in stored["fitted"].items()}
            same = (stored["key"], stored["code"]) == (key, code_digest()) and np.isfinite(list(fitted.values())).all()
            return KeptFit(fitted, int(stored["evaluations"]), str(stored["search"]), tuple(map(str, stored["remarks"]))) if same else None
        except (OSError, ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError):
            return None  # no file, or a damaged one, which is as good as none: the stage runs again

    @property
    def has_fit(self) -> bool:
        """Whether the end of a fit is kept, whatever it depended on."""
        return self.folder is not None and self._file("fit").is_file()

    def changed_since(self, ingredients: Mapping[str, str]) -> tuple[str, ...]:
        """Return which ingredients of its result are not those of the end that is kept; none where nothing is kept."""
        if not self.has_fit:
            return ()
        try:
            stored = json.loads(self._file("fit").read_text(encoding="utf-8"))
            before = {str(k): str(v) for k, v in stored.get("ingredients", {}).items()}
            names = [n for n in {**before, **ingredients} if before.get(n) != ingredients.get(n)]
            return (*names, *(["code"] if stored["code"] != code_digest() else []))
        except (ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError):
            return ("the cached file is damaged",)

    def remember(self, key: str, end: KeptFit | None, ingredients: Mapping[str, str] | None = None) -> None:
        """Keep the end of its fit, with what that took and the hashes of what it depends on."""
        if self.folder is None or end is None:
            return
        self.folder.mkdir(parents=True, exist_ok=True)
        content = {"key": key, "code": code_digest(), "ingredients": dict(ingredients or {}), **asdict(end)}
        FileKinds.RESULTS_FILE.save_text(self._file("fit"), json.dumps(content, indent=1))

    def errors(self, key: str) -> Keeping | None:
        """Return what keeps its model of error, for a fit; None where no results folder is."""
        return None if self.folder is None else partial(_errors_kept, self._file("errors"), key)


def kept_stages(folder: Path | None, stages: Collection[str], fresh: bool) -> dict[str, KeptStage]:
    """Return stage -> what a results folder keeps of it; `fresh` removes ends and models of error first, looks at hold-out records stay."""
    for path in [folder / f"{file_name(stage)}.{kind}.json" for stage in stages for kind in ("fit", "errors")] if folder and fresh else []:
        path.unlink(missing_ok=True)
    return {stage: KeptStage(folder, stage) for stage in stages}


def _errors_kept(path: Path, key: str, make: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """Return a model of error as it is kept; where nothing is kept, anything has changed since or the file is damaged, as made now."""
    try:
        stored = json.loads(path.read_text(encoding="utf-8"))
        errors: dict[str, Any] = stored["errors"]
        if (stored["key"], stored["code"], stored["sha256"]) == (key, code_digest(), _digest(errors)):
            return errors
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        pass
    errors = make()
    content = {"key": key, "code": code_digest(), "sha256": _digest(errors), "errors": errors}
    with suppress(OSError, ThermidError):  # what cannot be kept is made again
        path.parent.mkdir(parents=True, exist_ok=True)
        FileKinds.RESULTS_FILE.save_text(path, json.dumps(content))
    return errors


def _digest(content: Mapping[str, Any]) -> str:
    """Return the hash of what JSON holds."""
    return hashlib.sha256(json.dumps(content).encode()).hexdigest()


def _key(path: Path, how: Mapping[str, Any]) -> str:
    """Return the hash of what a record depends on: the bytes and the name of its file, how it is read and prepared, and what reads it."""
    ingredients = json.dumps([path.name, how, code_digest()])
    return hashlib.sha256(hashlib.sha256(read_bytes(path)).digest() + ingredients.encode()).hexdigest()


def log_kept(folder: Path | None, path: Path, how: Mapping[str, Any], make: Callable[[], Record]) -> Record:
    """Return a record: as a results folder keeps it, or made now and kept there.

    Parameters
    ----------
    folder : Path or None   The results folder; None keeps nothing.
    path : Path             The log.
    how : mapping           All that enters beside the log, in what JSON holds; `name` is the record's.
    make : callable         Returns the record of the log itself.

    Raises
    ------
    ThermidError   From reading; a log that cannot be read is not kept.
    """
    if folder is None or not path.is_file():
        return make()
    try:
        key = _key(path, how)
    except TypeError:  # a date or another thing that only TOML holds: its error, or its record, comes from reading
        return make()
    cache_file = folder / "logs" / f"{file_name(str(how['name']))}.npz"
    record = _read(cache_file, key)
    if record is None:
        record = make()
        if not record.clocks:  # the record of one log has one clock; another is joined later, and not kept
            _write(cache_file, key, record)
    return record


def _write(path: Path, key: str, record: Record) -> None:
    """Write a prepared record with its key as a compressed file, in one step."""
    arrays: dict[str, Any] = {"times": record.times}
    channels = []
    for k, channel in enumerate(record.channels.values()):
        arrays |= {f"values {k}": channel.values, f"valid {k}": channel.valid}
        arrays |= {f"mask {k} {n}": mask for n, mask in enumerate(channel.masks.values())}
        plain = {f.name: getattr(channel, f.name) for f in fields(Channel) if f.name not in (*_ARRAYS, "part")}
        part = None if channel.part is None else {f.name: getattr(channel.part, f.name) for f in fields(SensorPart)}
        channels.append({"plain": plain, "part": part, "reasons": list(channel.masks)})
    origin = {f.name: getattr(record.origin, f.name) for f in fields(Origin)}
    about = {"key": key, "name": record.name, "origin": origin, "steps": list(record.steps), "channels": channels}
    path.parent.parent.mkdir(parents=True, exist_ok=True)  # by itself, so that an error names the folder that was asked for
    path.parent.mkdir(exist_ok=True)
    with FileKinds.RESULTS_FILE.replacing(path) as half:
        np.savez(half, **{_ABOUT: np.array(json.dumps(about)), **arrays})


def _read(path: Path, key: str) -> Record | None:
    """Return a record that is kept under a key; None where there is none, the key is another, or the file is damaged."""
    try:
        with path.open("rb") as file, np.load(file) as arrays:
            about = json.loads(str(arrays[_ABOUT]))
            if about["key"] != key:
                return None
            written = []
            for k, one in enumerate(about["channels"]):
                masks = {reason: arrays[f"mask {k} {n}"] for n, reason in enumerate(one["reasons"])}
                fields: dict[str, Any] = {n: Kelvin(v) if n in TEMPERATURES else v for n, v in (one["part"] or {}).items()}
                part = SensorPart(**fields) if fields else None
                written.append(Channel(values=arrays[f"values {k}"], valid=arrays[f"valid {k}"], masks=masks, part=part, **one["plain"]))
            lists: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in about["origin"].items()}
            origin = Origin(**lists)
            return Record(about["name"], arrays["times"], {c.name: c for c in written}, origin, tuple(about["steps"]))
    except (OSError, EOFError, ValueError, KeyError, TypeError, zipfile.BadZipFile, ThermidError):
        return None  # a damaged file is as good as none: the log is read again
