"""Logs as they were read and prepared, kept in a results folder: a text log of a day takes longer to read than its fit takes."""

from __future__ import annotations

import hashlib
import json
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from thermid.campaign.cache import code_digest, file_name
from thermid.errors import ThermidError
from thermid.files import OWN, read_bytes, replacing
from thermid.measure import Channel, Record
from thermid.measure.record.channel import Origin
from thermid.measure.record.sensor import SensorPart

_ARRAYS = ("values", "valid", "masks")
_ABOUT = "about"


def _key(path: Path, how: Mapping[str, Any]) -> str:
    """Return the hash of what a record depends on: the bytes and the name of its file, how it is read and prepared, and what reads it."""
    told = json.dumps([path.name, how, code_digest()])
    return hashlib.sha256(hashlib.sha256(read_bytes(path)).digest() + told.encode()).hexdigest()


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
    kept = folder / "logs" / f"{file_name(str(how['name']))}.npz"
    found = _read(kept, key)
    if found is None:
        found = make()
        if found.second is None:  # the record of one log has one clock; another is joined later, and not kept
            _write(kept, key, found)
    return found


def _write(path: Path, key: str, record: Record) -> None:
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
    with replacing(path, OWN) as half:
        np.savez(half, **{_ABOUT: np.array(json.dumps(about)), **arrays})


def _read(path: Path, key: str) -> Record | None:
    """Return a record that is kept under a key; None where there is none, the key is another, or the file is damaged."""
    if not path.is_file():
        return None
    try:
        with path.open("rb") as file, np.load(file) as kept:
            about = json.loads(str(kept[_ABOUT]))
            if about["key"] != key:
                return None
            made = []
            for k, one in enumerate(about["channels"]):
                masks = {reason: kept[f"mask {k} {n}"] for n, reason in enumerate(one["reasons"])}
                part = None if one["part"] is None else SensorPart(**one["part"])
                made.append(Channel(values=kept[f"values {k}"], valid=kept[f"valid {k}"], masks=masks, part=part, **one["plain"]))
            origin = Origin(**{**about["origin"], "columns": tuple(about["origin"]["columns"])})
            return Record(about["name"], kept["times"], {c.name: c for c in made}, origin, tuple(about["steps"]))
    except (OSError, EOFError, ValueError, KeyError, TypeError, zipfile.BadZipFile, ThermidError):
        return None  # a damaged file is as good as none: the log is read again
