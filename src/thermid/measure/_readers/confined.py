"""Binary logs are read in a process of their own, under a limit of memory: their libraries end the process on some damaged files.

The process starts with the first such file, answers one file after the other, and ends with the one that started it. In: the bytes of a
file and the name of a reader in `binary`. Out: its cells, or the error that refuses it.
"""

from __future__ import annotations

import atexit
import contextlib
import importlib
import json
import os
import subprocess
import sys
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from threading import Lock, Timer
from typing import Any, BinaryIO, Final, cast

from thermid.base import errors
from thermid.base.errors import CAPS_VARIABLE, MissingExtraError, RecordError, ThermidError, cap, raising
from thermid.base.extensions import missing
from thermid.measure._readers.textfile import Cells, Layout

MEMORY: Final = 5.0
"""Memory that reading a file may take, over what it may unpack to. [-]"""
LONGEST: Final = 120.0
"""Time after which reading one file is given up; 200 MB take some 20 s. [s]"""
PROGRAM: Final = "from thermid.measure._readers.confined import serve; serve()"

Reader = Callable[[bytes, str, str | None], Cells]


class _Child:
    """The process that reads, with the process that started it; another one after a fork or an end."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._owner = 0

    def ask(self, question: dict[str, Any], data: bytes) -> dict[str, Any] | None:
        """Return the answer to a question about some bytes; None where the process ended over it."""
        with self._lock:
            process = self._started()
            assert process.stdin is not None
            assert process.stdout is not None
            late = Timer(LONGEST, process.kill)
            late.start()
            try:
                process.stdin.write(json.dumps(question | {"size": len(data)}).encode() + b"\n")
                process.stdin.write(data)
                process.stdin.flush()
                line = process.stdout.readline()
                answer = json.loads(line) if line.endswith(b"\n") else None
            except (BrokenPipeError, ValueError):
                answer = None
            except BaseException:
                self._end()
                raise
            finally:
                late.cancel()
            if answer is None:
                self._end()
            return cast("dict[str, Any] | None", answer)

    def _started(self) -> subprocess.Popen[bytes]:
        """Return the process, started where this one has none."""
        if self._process is None or self._owner != os.getpid() or self._process.poll() is not None:
            if self._owner != os.getpid():
                atexit.register(self.close)
            self._process, self._owner = _start(), os.getpid()
        return self._process

    def _end(self) -> None:
        """End the process, whatever it does."""
        if self._process is not None and self._owner == os.getpid():
            self._process.kill()
            self._process.communicate()
        self._process = None

    def close(self) -> None:
        """End the process at the end of the one that started it."""
        with self._lock:
            self._end()


def _start() -> subprocess.Popen[bytes]:
    # a session of its own: the interrupt key is for the process that asks
    pipe = subprocess.PIPE
    return subprocess.Popen(
        [sys.executable, "-P", "-c", PROGRAM], stdin=pipe, stdout=pipe, stderr=subprocess.DEVNULL, start_new_session=True
    )


_CHILD: Final = _Child()


def in_child(reader: str, module: str = "") -> Reader:
    """Return a reader of `binary` that works in a process of its own.

    Parameters
    ----------
    reader : str    Its name there.
    module : str    Optional module that it needs, as it is imported.
    """

    def read(data: bytes, file: str, separator: str | None) -> Cells:
        if module and (sys.modules.get(module, module) is None or find_spec(module) is None):
            raise MissingExtraError(missing([module], "this kind of file"), file)
        question = {"reader": reader, "file": file, "separator": separator, "caps": os.environ.get(CAPS_VARIABLE)}
        answer = _CHILD.ask(question, data)
        if answer is None:
            raise RecordError(
                f"reading it took more than {_memory() / 1e6:.0f} MB of memory or {LONGEST:.0f} s, or it is damaged: look for a cell that "
                f"stands far out, and save the log again, or as CSV.{raising('unpacked')}",
                file,
            )
        if "error" in answer:
            kind = getattr(errors, answer["kind"], RecordError)
            raise cast("type[ThermidError]", kind)(answer["error"], answer["where"])
        return _cells(answer["cells"])

    return read


def _memory() -> float:
    """Return the memory that reading a file may take beside what the process has. [bytes]"""
    return MEMORY * cap("unpacked")


def _cells(held: dict[str, Any]) -> Cells:
    """Return cells as JSON holds them."""
    held |= {"header": tuple(held["header"]), "columns": [tuple(c) for c in held["columns"]], "notes": tuple(held["notes"])}
    return Cells(**held | {"prompt": frozenset(held["prompt"]), "layout": Layout(**held["layout"])})


def serve() -> None:
    """Answer questions about files, one after the other, until there is no more to read."""
    questions, answers = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a library prints is no answer
    while question := questions.readline():
        answers.write(json.dumps(_answer(json.loads(question), questions)).encode() + b"\n")
        answers.flush()


def _answer(question: dict[str, Any], source: BinaryIO) -> dict[str, Any]:
    """Return the cells of the file that follows a question, or what refuses it."""
    data = source.read(question["size"])
    os.environ.pop(CAPS_VARIABLE, None)
    os.environ |= {CAPS_VARIABLE: question["caps"]} if question["caps"] else {}
    try:
        _limit()
        read: Reader = getattr(importlib.import_module("thermid.measure._readers.binary"), question["reader"])
        cells = read(data, question["file"], question["separator"])
        return {"cells": vars(cells) | {"prompt": sorted(cells.prompt), "layout": vars(cells.layout)}}
    except ThermidError as error:
        return {"kind": type(error).__name__, "error": error.message, "where": error.where}
    except MemoryError:
        os._exit(1)  # as where a library ends the process
    except Exception as error:
        cause = f"{type(error).__name__}: {str(error)[:200]}"
        said = f"the file is damaged, laid out in an unknown way, or takes too much memory ({cause}). Save it again, or as CSV."
        return {"kind": "RecordError", "error": said, "where": question["file"]}


def _limit() -> None:
    """Let the process have so much more memory than it has, and no more; where the system tells how much that is."""
    with contextlib.suppress(ImportError, OSError, ValueError):
        import resource

        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
        most = pages * resource.getpagesize() + int(_memory())
        resource.setrlimit(resource.RLIMIT_AS, (most, resource.getrlimit(resource.RLIMIT_AS)[1]))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
