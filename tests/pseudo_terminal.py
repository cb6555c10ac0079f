"""A `Board` behind a pseudo-terminal: a serial port without anything plugged in. It runs in a thread, at any speed."""

from __future__ import annotations

import os
import select
import threading
import time
from pathlib import Path

from python_board import Board

from thermid.base.errors import RecordError


class Terminal:
    """A board that a logger can open as a port.

    Parameters
    ----------
    board : Board             What answers.
    speed : float             Seconds of the board in one second.
    link : str or Path        A name for the port that stays when the cable is pulled and put back.
    waits : bool              Whether the board waits for a slow reader; a real one does not, and its lines are lost.
    keep : bool               Whether `lines` keeps all that was sent.
    """

    def __init__(self, board: Board, *, speed: float = 1.0, link: str | Path | None = None, waits: bool = False, keep: bool = True) -> None:
        if os.name != "posix":
            raise RecordError("a board without hardware needs pseudo-terminals, which this system does not have.")
        self.board, self.speed, self.waits, self.keep = board, speed, waits, keep
        self.link = Path(link) if link is not None else None
        self.lines: list[str] = []
        self.dropped = 0
        self.lock = threading.RLock()
        self._noise: list[bytes] = []
        self._cut = False
        self._done = threading.Event()
        self._master = self._slave = -1
        self.plug()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> Terminal:
        """Start the board."""
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Stop the board and take the port away."""
        self.stop()

    def stop(self) -> None:
        """Stop the board and take the port away."""
        self._done.set()
        if self._thread.is_alive():
            self._thread.join()
        self.unplug()

    def plug(self) -> None:
        """Make the port."""
        import tty

        with self.lock:
            self._master, self._slave = os.openpty()
            tty.setraw(self._slave)
            os.set_blocking(self._master, False)
            self.port = os.ttyname(self._slave)
            if self.link is not None:
                self.link.unlink(missing_ok=True)
                self.link.symlink_to(self.port)
                self.port = str(self.link)

    def unplug(self) -> None:
        """Take the port away, as when the cable is pulled."""
        with self.lock:
            if self._master >= 0:
                os.close(self._master)
                os.close(self._slave)
                self._master = self._slave = -1
                if self.link is not None:
                    self.link.unlink(missing_ok=True)

    def inject(self, noise: bytes) -> None:
        """Put bytes on the line that the board did not send."""
        with self.lock:
            self._noise.append(noise)

    def cut_next(self) -> None:
        """Lose the second half of the next line."""
        with self.lock:
            self._cut = True

    def unread(self) -> bytes:
        """Return what was sent and nobody has read, after the reader has gone."""
        out = b""
        os.set_blocking(self._slave, False)
        while True:
            try:
                piece = os.read(self._slave, 65536)
            except BlockingIOError:
                return out
            if not piece:  # which of both an empty port does depends on how its last reader had set it
                return out
            out += piece

    def _run(self) -> None:
        """Let the board's time pass, and carry lines to and fro."""
        begun, told, rest = time.monotonic(), 0, b""
        while not self._done.wait(0.0 if self.waits else 0.004):
            with self.lock:
                target = int((time.monotonic() - begun) * 1000.0 * self.speed)
                # steps short enough that the silence of the host is seen when it is
                self.board.advance(min(target - told, 100) if self.waits else target - told)
                told = min(target, told + 100) if self.waits else target
                for line in self.board.take():
                    self._send(line)
                if self._master >= 0:
                    rest = self._listen(rest)
            if self.waits and told == target:
                time.sleep(0.002)

    def _send(self, line: str) -> None:
        """Put one line on the wire."""
        data = line.encode() + b"\n"
        if self._cut:
            data, self._cut = data[: len(data) // 2] + b"\n", False
        data = b"".join([*self._noise, data])
        self._noise.clear()
        if self.keep:
            self.lines.append(line)
        while self._master >= 0:
            try:
                # the kernel takes part of a line when its buffer is nearly full
                data = data[os.write(self._master, data) :]
                if not data:
                    return
            except BlockingIOError:
                if self._done.is_set():
                    break
            if not self.waits:
                break
            select.select([], [self._master], [], 0.1)
        self.dropped += 1

    def _listen(self, rest: bytes) -> bytes:
        """Take in what the host sent; return the beginning of an unfinished line."""
        try:
            rest += os.read(self._master, 4096)
        except (BlockingIOError, OSError):
            return rest
        *whole, rest = rest.split(b"\n")
        for line in whole:
            self.board.hear(line.decode("latin-1"))
        return rest
