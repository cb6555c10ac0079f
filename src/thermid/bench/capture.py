"""Lines of any board on a serial port, written down with the host's time in a form that the readers of logs know."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path

from thermid.base.errors import RecordError
from thermid.base.files import scratch
from thermid.bench._wire import parse_line
from thermid.bench.port import Port, check_port


class PortCapture:
    """A serial port whose lines are appended to a file, each behind the host's time.

    Parameters
    ----------
    device : Path   The port.
    path : Path     The file, which must not exist.

    Raises
    ------
    RecordError   When the port cannot be opened, or the file exists.
    """

    def __init__(self, device: Path, path: Path) -> None:
        if path.exists():
            raise RecordError(
                "this file exists already. Give another name for the lines of the port.", str(path), code="output.over-another-file"
            )
        check_port(str(device))
        self.path = path
        self._device, self._port = str(device), Port(str(device))

    def listen(self, seconds: float) -> None:
        """Append the lines that come within some seconds.

        Raises
        ------
        RecordError   When the port was disconnected, or its board speaks the protocol of ``thermid log``.
        """
        until = time.monotonic() + seconds
        with self.path.open("a", encoding="utf-8") as file:
            while (remaining := until - time.monotonic()) > 0.0:
                try:
                    text = self._port.read_line(remaining).decode("utf-8", "replace").strip()
                except OSError as error:
                    raise RecordError(
                        f"the port was disconnected ({error}). Connect the board and start again.", self._device, code="bench.no-board"
                    ) from None
                if _of_bench(text):
                    raise RecordError(
                        "the board sends the protocol of 'thermid log'. Start 'thermid log' on this port, and watch its file.",
                        self._device,
                        code="bench.protocol",
                    )
                if text:
                    file.write(f"{datetime.now().isoformat(' ', 'milliseconds')} -> {text}\n")

    def close(self) -> None:
        """Close the port."""
        self._port.close()


def _of_bench(text: str) -> bool:
    """Whether a line is of the protocol of the bench."""
    try:
        parse_line(text)
    except RecordError:
        return False
    return True


@contextmanager
def listening(device: Path, path: Path | None) -> Iterator[PortCapture]:
    """Open the capture of a port as a context; without a path its file is removed at the end.

    Raises
    ------
    RecordError   As `PortCapture`.
    """
    with scratch() as folder:
        capture = PortCapture(device, folder / f"{device.name}.txt" if path is None else path)
        try:
            yield capture
        finally:
            capture.close()
