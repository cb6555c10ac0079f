"""A log that grows, read in pieces, and a record of it whose size does not grow with it.

Readings of the last `RECENT` seconds stay as they are. Older ones are averaged over stretches of a five-hundredth of the time since the
beginning, so that rows grow with the logarithm of the time only. Where a power or command changes nothing is averaged.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from thermid.errors import MissingDataError, NameNotFoundError, RecordError
from thermid.files import COPY, scratch, write_bytes
from thermid.linear_algebra import Bools
from thermid.measure.record.channel import Channel
from thermid.measure.record.record import Record

Places = NDArray[np.intp]

RECENT: Final = 4800.0
"""What stays as it was read: twice the window of the filter. [s]"""
FINE: Final = 500.0
"""Rows in which the time since the beginning grows by e."""
CHUNK: Final = 1 << 18
"""Bytes that are read at once."""
ENOUGH: Final = 20
"""Lines that a log is read from, or its refusal is said."""
HEADS: Final = 200
"""Lines at the beginning within which header and first samples stand."""


def thinned(record: Record) -> Record:
    """Return a record with older readings averaged, as the module says; the record itself where none are old."""
    since = record.times - record.times[0]
    late = int(np.searchsorted(since, since[-1] - RECENT))
    step = float(np.median(np.diff(since[late:]))) if since.size - late > 1 else record.step
    place = np.floor(FINE * np.log1p(since / (FINE * step))).astype(int)
    old = place < place[late]
    held = [c for c in record.channels.values() if c.held]
    jumps = np.zeros(since.size, dtype=bool)
    for c in held:
        jumps[1:] |= np.diff(c.values) != 0.0
    changing = np.isin(place, place[jumps])
    group = np.where(old & ~changing, place, -1 - np.arange(since.size))
    first = np.flatnonzero(np.diff(group, prepend=group[0] - 1))
    if first.size == since.size:
        return record
    count = np.diff(first, append=since.size)
    channels = {c.name: _averaged(c, first, count) for c in record.channels.values()}
    return replace(record, times=np.add.reduceat(record.times, first) / count, channels=channels)


def _averaged(channel: Channel, first: Places, count: Places) -> Channel:
    """Return a channel with the means of the valid samples of every stretch."""
    valid: Bools = channel.valid
    many = np.add.reduceat(valid.astype(float), first)
    total = np.add.reduceat(np.where(valid, channel.values, 0.0), first)
    alone = count == 1
    values = np.where(alone, channel.values[first], np.where(many > 0.0, total / np.maximum(many, 1.0), np.nan))
    return replace(channel, values=values, valid=many > 0.0, masks={})


def followed_by(record: Record, later: Record) -> Record:
    """Return a record with the samples of another one that come after it."""
    new = later.times > record.times[-1]
    if not new.any():
        return record
    channels = {}
    for name, c in record.channels.items():
        other = later.channel(name)
        values, valid = np.concatenate([c.values, other.values[new]]), np.concatenate([c.valid, other.valid[new]])
        channels[name] = replace(c, values=values, valid=valid, masks={})
    return replace(record, times=np.concatenate([record.times, later.times[new]]), channels=channels)


class GrowingLog:
    """A log that somebody writes to; only what is new is read, with its first lines before it, which say what the columns are.

    A log that cannot be read in pieces (packed, binary) is read whole at every look.

    Parameters
    ----------
    path : Path         The file.
    read : callable     File -> its record; called with pieces of the log.
    """

    def __init__(self, path: Path, read: Callable[[Path], Record]) -> None:
        self.path, self._read = path, read
        self._forget()

    def _forget(self) -> None:
        self._at, self._head, self.whole = 0, b"", False
        self._kept: Record | None = None

    def record(self) -> Record | None:
        """Return what there is by now; None before two samples.

        Raises
        ------
        NameNotFoundError   When columns that were asked for are none of the log's.
        RecordError         When more than `ENOUGH` lines cannot be read.
        """
        try:
            size = self.path.stat().st_size
        except OSError:
            return None
        if size < self._at:  # written anew
            self._forget()
        while not self.whole and self._more(size):
            pass
        if self.whole:
            try:
                return thinned(self._read(self.path))
            except (MissingDataError, RecordError):
                return None
        return self._kept

    def _more(self, size: int) -> bool:
        """Take the next piece; whether there was one."""
        with self.path.open("rb") as file:
            file.seek(self._at)
            piece = file.read(min(CHUNK, size - self._at))
        piece = piece[: piece.rfind(b"\n") + 1]
        if not self._at and (b"\0" in piece[:4096] or piece[:2] == b"\x1f\x8b"):
            self.whole = True
        if not piece or self.whole:
            return False
        made = self._parsed(self._head + piece)
        if made is None:
            self.whole = bool(self._head)  # what comes later reads otherwise than its beginning: no log of rows
            return False
        if self._kept is None:
            self._head = self._beginning(piece, made)
            self._kept = made
        elif abs(made.times[0] - self._kept.times[0]) > 1e-3 * self._kept.step:
            self.whole = True
            return False
        else:
            self._kept = followed_by(self._kept, made)
        self._kept = thinned(self._kept)
        self._at += len(piece)
        return True

    def _beginning(self, piece: bytes, made: Record) -> bytes:
        """Return the fewest first lines that read as the beginning of the record."""
        lines = piece.splitlines(keepends=True)
        for count in range(2, min(HEADS, len(lines)) + 1):
            head = b"".join(lines[:count])
            first = self._parsed(head)
            if first is not None and first.times.size > 1 and abs(first.times[0] - made.times[0]) < 1e-3 * made.step:
                return head
        return piece

    def _parsed(self, text: bytes) -> Record | None:
        """Return the record of a piece; None where it is too short for one."""
        with scratch() as folder:
            try:
                return self._read(write_bytes(folder / self.path.name, text, COPY))
            except NameNotFoundError:
                raise
            except RecordError:
                if not self._head and text.count(b"\n") > ENOUGH:
                    raise
                return None
