"""The file of a log: appended to, line by line, each on disk before the next is read."""

from __future__ import annotations

import errno
import os
import re
import tempfile
from pathlib import Path

from thermid.acquire.benchlog import log_line
from thermid.acquire.wire import MAGIC
from thermid.errors import OutputError, RecordError
from thermid.files import COPY, write_bytes
from thermid.measure.readers.formats import is_bench_log

_SESSION = re.compile(rb'^# session \{"number": (\d{1,6})', re.MULTILINE)
_WALL = re.compile(rb'^# session \{"number": (\d{1,6}), "wall": "([^"]*)"', re.MULTILINE)
_TRIP = re.compile(rb"^# mark (\d{1,6}) (\d{1,9}\.\d{6}) (overtemp|blind|cleared) (.*) [0-9A-F]{4}$", re.MULTILINE)
_MOST_WAITING = 64 << 20


class Store:
    """A log that is written to.

    Parameters
    ----------
    path : str or Path   The file; it is made, or continued.
    sync : bool          Whether each line is forced onto the disk itself, so that it outlives a power cut.

    Raises
    ------
    RecordError   When it cannot be written, is another kind of file, or another logger writes to it.
    """

    def __init__(self, path: str | Path, *, sync: bool = True) -> None:
        self.path = Path(path)
        self._sync = sync
        self._waiting = bytearray()
        self.full = False
        self.dropped = 0
        self.rest: Path | None = None
        """Where the end of the log is, when its own disk was full to the last."""
        self.trip = ""
        """When and why the log so far says that heaters were cut off, and nobody has allowed them again."""
        self._file = self._opened()
        try:
            self.session, self.was_cut = self._look()
        except BaseException:
            os.close(self._file)
            raise
        self._flush_entry()

    def _opened(self) -> int:
        """Return the file, open."""
        if not self.path.absolute().parent.is_dir():
            raise RecordError(f"there is no folder '{self.path.parent}'. Make it first.", str(self.path))
        # an empty file is taken for a new log; thermid.toml, which marks the root of a project, may be empty too, under any name
        linked = self.path.exists() and self.path.stat().st_size == 0 and self.path.stat().st_nlink > 1
        if self.path.resolve().suffix == ".toml" or linked:
            why = "it has another name too, so it is no new log" if linked else "a log is no TOML file"
            raise RecordError(f"{why}. Give another name, such as bench.csv; nothing was written.", str(self.path))
        try:
            return os.open(self.path, os.O_RDWR | os.O_APPEND | os.O_CREAT, 0o644)
        except OSError as error:
            raise RecordError(f"it cannot be written: {error.strerror}. Give another place.", str(self.path)) from None

    def _look(self) -> tuple[int, bool]:
        """Return the number of this start, and whether the last line of the one before was cut."""
        if os.name == "posix":
            import fcntl

            try:
                fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                raise RecordError("another logger writes to it. Stop that one, or give another file.", self.path.name) from None
        data = self.path.read_bytes()
        if not data:
            self._put(f"{MAGIC}\n".encode())
            return 1, False
        if not is_bench_log(data) and not f"{MAGIC}\n".encode().startswith(data):
            raise RecordError("it is not empty and no log of the bench. Give another file; nothing was written.", self.path.name)
        self.trip = _trip(data)
        cut = not data.endswith(b"\n")
        if cut:
            self._put(b"\n" if is_bench_log(data) else f"\n{MAGIC}\n".encode())
        return max((int(each) for each in _SESSION.findall(data)), default=0) + 1, cut

    def _flush_entry(self) -> None:
        """Force the folder's entry onto the disk, so that a new file outlives a power cut."""
        if self._sync and os.name == "posix":
            folder = os.open(self.path.absolute().parent, os.O_RDONLY)
            try:
                os.fsync(folder)
            finally:
                os.close(folder)

    def write(self, body: str) -> None:
        """Append one line and its CRC; what a full disk does not take waits in memory, up to 64 MB."""
        self._put(log_line(body).encode())

    def _put(self, data: bytes) -> None:
        """Append bytes."""
        if len(self._waiting) + len(data) > _MOST_WAITING:
            self.dropped += 1
            return
        self._waiting += data
        self.retry()

    def retry(self) -> None:
        """Write what waits."""
        wrote = False
        while self._waiting:
            try:
                done = os.write(self._file, self._waiting)
            except OSError as error:
                if error.errno not in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO):
                    raise
                self.full = True
                return
            del self._waiting[:done]
            wrote = True
        self.full = False
        if wrote and self._sync:
            getattr(os, "fdatasync", os.fsync)(self._file)

    @property
    def waiting(self) -> int:
        """Bytes that a full disk did not take."""
        return len(self._waiting)

    def close(self) -> None:
        """Write what waits and give the file back; what a full disk still does not take goes to another place, see `rest`."""
        self.retry()
        os.close(self._file)
        for folder in (Path(tempfile.gettempdir()), Path.home()) if self._waiting else ():
            place = folder / f"{self.path.name}.{os.getpid()}.rest"
            try:
                write_bytes(place, bytes(self._waiting), COPY)
            except (OSError, OutputError):
                continue
            self.rest = place
            return


def _trip(data: bytes) -> str:
    """Return when and why heaters were cut off last, empty where they were not or were allowed again since."""
    marks = _TRIP.findall(data)
    if not marks or marks[-1][2] == b"cleared":
        return ""
    session, elapsed, word, text = (each.decode("latin-1") for each in marks[-1])
    walls = {number.decode(): wall.decode("latin-1") for number, wall in _WALL.findall(data)}
    of = text.removeprefix("the board says so").removeprefix(" of ")
    why = f"over-temperature{' of ' + of if of else ''}" if word == "overtemp" else "no sensor could be read"
    return f"{why}, {float(elapsed):.0f} s after the start {session} of this log ({walls.get(session, 'at an unknown time')})"
