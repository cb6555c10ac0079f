"""A serial port, read line by line: no byte beyond the line feed is taken before the line is on disk."""

from __future__ import annotations

import errno
import os
import select
import time
from pathlib import Path
from typing import Protocol

from thermid.base.errors import RecordError, optional

MAX_GARBAGE_BYTES = 400
"""Bytes without a line feed that are taken for one piece of garbage."""

_MAKERS = {0x2341: "Arduino", 0x2A03: "Arduino", 0x1A86: "CH340", 0x0403: "FTDI", 0x10C4: "CP210x"}


class LinePort(Protocol):
    """A port that a logger reads lines from: a serial port, or a simulated board."""

    def read_line(self, timeout: float) -> bytes:
        """Return the next line with its line feed; empty where none ends within `timeout` seconds."""

    def write(self, text: str) -> None:
        """Send one line."""

    @property
    def begun(self) -> bytes:
        """Bytes of a line that has not ended."""

    def close(self) -> None:
        """Close the port."""


def find_port() -> str:
    """Return the name of the only port whose USB maker is that of a board.

    Raises
    ------
    RecordError   When none or several are.
    """
    list_ports = optional("serial.tools.list_ports", "a serial port")
    boards = [port for port in list_ports.comports() if port.vid in _MAKERS]
    if not boards:
        others = ", ".join(port.device for port in list_ports.comports()) or "none"
        raise RecordError(
            f"no board found (ports: {others}). Plug it in, or give --port, such as --port /dev/ttyUSB0.",
            "serial port",
            code="bench.no-board",
        )
    if len(boards) > 1:
        names = ", ".join(f"{port.device} ({_MAKERS[port.vid]})" for port in boards)
        raise RecordError(f"several boards: {names}. Give one with --port.", "serial port", code="bench.no-board")
    return str(boards[0].device)


def check_port(name: str) -> None:
    """Open a port once and close it.

    Raises
    ------
    RecordError   When it cannot be opened, with what to do.
    """
    try:
        Port(name).close()
    except OSError as error:
        number, reason = error.errno, str(error)
        if number == errno.ENOENT:
            text = "the port does not exist. Connect the board, or leave --port out."
        elif number == errno.EACCES:
            text = "you have no permission to open it. On Linux, join its group (`sudo usermod -aG dialout $USER`) and log in again."
        elif number == errno.EBUSY or "exclusively" in reason:
            text = "another program uses it. Close that one first, such as the monitor of the Arduino IDE."
        else:
            text = f"it is not a serial port ({reason})."
        raise RecordError(text, name, code="bench.no-board") from None


class Port:
    """An open serial port.

    Parameters
    ----------
    name : str   Device, such as /dev/ttyUSB0 or COM3.

    Raises
    ------
    OSError   When it cannot be opened.
    """

    def __init__(self, name: str) -> None:
        serial = optional("serial", "a serial port")
        # a name that is a link may lead elsewhere after a cable was pulled, so it is followed at each opening
        device = os.path.realpath(name) if Path(name).is_symlink() else name
        self._serial = serial.Serial(device, 115200, timeout=0.2, write_timeout=1.0, exclusive=True if os.name == "posix" else None)
        self._fd = self._serial.fileno() if os.name == "posix" else -1
        self._begun = bytearray()

    def read_line(self, timeout: float) -> bytes:
        """Return the next line with its line feed; empty where none ends within `timeout` seconds. Its beginning is kept for the next call.

        Raises
        ------
        OSError   When the port was disconnected.
        """
        until = time.monotonic() + timeout
        while True:
            byte = self._byte(until)
            if not byte:
                return b""
            self._begun += byte
            if byte == b"\n" or len(self._begun) >= MAX_GARBAGE_BYTES:
                line = bytes(self._begun)
                self._begun.clear()
                return line

    def _byte(self, until: float) -> bytes:
        """Return one byte; empty where none comes before `until` on the monotonic clock. [s]"""
        if self._fd < 0:
            return bytes(self._serial.read(1)) if time.monotonic() < until else b""
        while True:
            try:
                byte = os.read(self._fd, 1)
            except BlockingIOError:
                remaining = until - time.monotonic()
                if remaining <= 0 or not select.select([self._fd], [], [], remaining)[0]:
                    return b""
                continue
            if not byte:
                # a serial line whose device was unplugged reads empty at once
                remaining = until - time.monotonic()
                if remaining > 0 and select.select([self._fd], [], [], remaining)[0] and not (byte := os.read(self._fd, 1)):
                    raise OSError("the port was disconnected")
            return byte

    def write(self, text: str) -> None:
        """Send one line.

        Raises
        ------
        OSError   When the port was disconnected or takes nothing.
        """
        self._serial.write(text.encode() + b"\n")

    @property
    def begun(self) -> bytes:
        """Bytes of a line that has not ended."""
        return bytes(self._begun)

    def close(self) -> None:
        """Close the port."""
        try:
            self._serial.close()
        except OSError:
            pass  # it is gone already
