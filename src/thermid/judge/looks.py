"""How often a held-out record was looked at: one that failed a verdict before its model was fitted anew is no longer unseen."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path

from thermid.errors import DeckError
from thermid.files import OWN, write_text

FILE = "looks.json"


@dataclass(frozen=True)
class RecordedLook:
    """One verdict on a record.

    Parameters
    ----------
    record : str    Its name.
    sha256 : str    Checksum of its samples.
    stage : str     The stage whose values were judged.
    key : str       Hash of everything that these values depend on.
    passed : bool   Whether every criterion was met.
    date : str      The day.
    """

    record: str
    sha256: str
    stage: str
    key: str
    passed: bool
    date: str


def looks_at(folder: Path | None, sha256: str) -> tuple[RecordedLook, ...]:
    """Return the verdicts on a record that a results folder remembers, oldest first.

    Raises
    ------
    DeckError   When its file of verdicts is damaged.
    """
    return tuple(one for one in _read(folder) if one.sha256 == sha256)


def look(folder: Path | None, record: str, sha256: str, stage: str, key: str, passed: bool) -> tuple[RecordedLook, ...]:
    """Return the earlier failed verdicts on a record by other values than these, and note this one.

    The same values judged again are no new look.

    Raises
    ------
    DeckError   When the folder's file of verdicts is damaged: a new one would forget those that failed.
    """
    if folder is None:
        return ()
    known = _read(folder)
    earlier = tuple(one for one in known if one.sha256 == sha256 and not one.passed and one.key != key)
    now = RecordedLook(record, sha256, stage, key, passed, datetime.now(UTC).date().isoformat())
    if all((one.sha256, one.key, one.passed) != (sha256, key, passed) for one in known):
        folder.mkdir(parents=True, exist_ok=True)
        write_text(folder / FILE, json.dumps([asdict(one) for one in (*known, now)], indent=1), OWN)
    return earlier


def _read(folder: Path | None) -> tuple[RecordedLook, ...]:
    path = folder / FILE if folder is not None else None
    if path is None or not path.is_file():
        return ()
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(content, list):
            raise TypeError
        return tuple(RecordedLook(**one) for one in content)
    except (ValueError, TypeError):
        raise DeckError(
            "the file is damaged. It says which records failed a verdict before; without it they would pass for independent ones. "
            "Restore it from the version control or a backup. Remove it only if no record of this folder ever failed.",
            str(path),
        ) from None
