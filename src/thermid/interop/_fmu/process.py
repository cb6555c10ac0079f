"""A process of its own for somebody's program: limits hold there, and a crash, a hang or an exit ends the call and not the session.

In: requests as bytes. Out: answers as bytes of at most a stated length; nothing that the other side makes is unpickled. A page of shared
memory has the latest call into the program, so that an error can name it.
"""

from __future__ import annotations

import mmap
import os
import signal
import struct
import subprocess
import sys
import time
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import suppress
from pathlib import Path
from threading import Lock
from typing import Any, BinaryIO, Final

from thermid.base.errors import CAPS_VARIABLE, SolverError, cap

LENGTH: Final = struct.Struct("<Q")
NOTE: Final = struct.Struct("<Qd48s")
"""How many calls there were; the time in the run [s] and the name of the latest."""
TICK: Final = 0.25
"""How often it is looked whether calls go on, and how long the end of a process is waited for. [s]"""


def send(to: BinaryIO, data: bytes) -> None:
    """Write bytes behind their length."""
    to.write(LENGTH.pack(len(data)) + data)
    to.flush()


def receive(of: BinaryIO, most: int) -> bytes:
    """Return bytes behind their length.

    Raises
    ------
    EOFError    When there are fewer.
    ValueError  When there would be more than `most`.
    """
    head = of.read(LENGTH.size)
    size = LENGTH.unpack(head)[0] if len(head) == LENGTH.size else 0
    if size > most:
        raise ValueError(f"{size} bytes")
    data = of.read(size)
    if not size or len(data) < size:
        raise EOFError
    return data


class ConfinedProgram:
    """A program of others in a process of its own, started when it is asked, and anew after it ended.

    Parameters
    ----------
    path : Path     The file that it is of, for messages.
    notes : Path    The file to make for the page of shared memory.
    code : tuple of str     Python that receives requests from standard input and sends answers to standard output, and its arguments.
    """

    def __init__(self, path: Path, notes: Path, code: tuple[str, ...]) -> None:
        self.path, self.code = path, code
        self._lock, self._reader = Lock(), ThreadPoolExecutor(1)
        self._process: subprocess.Popen[bytes] | None = None
        notes.write_bytes(bytes(mmap.PAGESIZE))
        with notes.open("r+b") as page:
            self._notes = mmap.mmap(page.fileno(), mmap.PAGESIZE)

    def ask(self, request: bytes, most: int) -> bytes:
        """Return the answer to a request, of at most so many bytes.

        Raises
        ------
        SolverError     When the process ends or hangs before, or answers with anything else; it names the call.
        """
        with self._lock:
            process = self._process or self._started()
            reply = self._reader.submit(self._exchange, process, request, most)
            try:
                fault = self._fault(process, reply)
            except BaseException:  # the interrupt key too: what it is at is not known then
                self.stop()
                raise
            if not fault:
                return reply.result()
            self.stop()
            raise SolverError(f"the FMU {fault} {self._place()}.", str(self.path), code="fmu.ended")

    def stop(self) -> None:
        """End the process."""
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            process.wait()
            for pipe in (process.stdin, process.stdout):
                with suppress(OSError):
                    pipe and pipe.close()

    def _started(self) -> subprocess.Popen[bytes]:
        """Return a new process; modules are looked for where this one finds them, and not in the folder that it stands in."""
        NOTE.pack_into(self._notes, 0, 0, 0.0, b"")
        more = {"PYTHONPATH": os.pathsep.join(filter(None, sys.path)), "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-c", *self.code],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env={**os.environ, **more},
        )
        return self._process

    @staticmethod
    def _exchange(process: Any, request: bytes, most: int) -> bytes:
        """Send a request to the process and return its answer of at most so many bytes."""
        send(process.stdin, request)
        return receive(process.stdout, most)

    def _fault(self, process: subprocess.Popen[bytes], reply: Future[bytes]) -> str:
        """Wait for an answer; return how there came none, in words."""
        count, since = -1, time.monotonic()
        while not wait([reply], TICK).done:
            latest = NOTE.unpack_from(self._notes)[0]
            if latest != count:
                count, since = latest, time.monotonic()
            elif time.monotonic() - since > cap("call"):
                return f"did not return within {cap('call'):g} s ({CAPS_VARIABLE}=call=NUMBER allows more)"
        error = reply.exception()
        if error is None:
            return ""
        with suppress(subprocess.TimeoutExpired):
            code = process.wait(0.0 if isinstance(error, ValueError) else 4.0 * TICK)
            if code < 0:
                return f"crashed ({signal.Signals(-code).name})"
            return f"ended its process (exit code {code})"
        return "sent bytes that are no answer"

    def _place(self) -> str:
        """Return which call it was, in words; the program may have written over the page."""
        _, at, name = NOTE.unpack_from(self._notes)
        called = "".join(c for c in name.partition(b"\0")[0].decode("ascii", "ignore") if c.isalnum())
        return f"in {called} at t = {at:g} s" if called else "before its library was loaded"
