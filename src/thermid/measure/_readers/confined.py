"""Functions that run in a process of their own, under a limit of memory and time: for libraries that end the process on a damaged file.

The process starts with the first call, answers one after the other, and ends with the one that started it. In: a function, bytes and plain
options. Out: what the function returns, as JSON has it, or the error that it raises.
"""

from __future__ import annotations

import atexit
import contextlib
import json
import os
import subprocess
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from threading import Lock, Timer
from typing import Any, BinaryIO, Final, cast

from thermid.base import errors
from thermid.base.errors import CAPS_VARIABLE, ThermidError

READING_TIME_LIMIT: Final = 120.0
"""Time after which a call is given up; a log of 200 MB takes some 20 s. [s]"""
PROGRAM: Final = f"from {__name__} import serve; serve()"


class EndedError(Exception):
    """The process ended during a call, or raised an error that is none of thermid; the text says what, where it is known."""


class _Child:
    """The process that runs functions, and a lock; a new one is started after a fork or an end."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._owner = 0

    def ask(self, question: dict[str, Any], data: bytes) -> dict[str, Any]:
        """Return the answer to a question about some bytes; empty where the process ended during it."""
        with self._lock:
            process = self._started()
            assert process.stdin is not None
            assert process.stdout is not None
            late = Timer(READING_TIME_LIMIT, process.kill)
            late.start()
            try:
                process.stdin.write(json.dumps(question | {"size": len(data)}).encode() + b"\n")
                process.stdin.write(data)
                process.stdin.flush()
                line = process.stdout.readline()
                answer = json.loads(line) if line.endswith(b"\n") else {}
            except BrokenPipeError:
                answer = {}
            except BaseException:
                self._end()
                raise
            finally:
                late.cancel()
            if not answer:
                self._end()
            return cast("dict[str, Any]", answer)

    def _started(self) -> subprocess.Popen[bytes]:
        """Return the process, started where there is none."""
        if self._owner != os.getpid():
            atexit.register(self.close)
        if self._process is None or self._owner != os.getpid() or self._process.poll() is not None:
            self._process, self._owner = _start(), os.getpid()
        return self._process

    def _end(self) -> None:
        """End the process."""
        if self._process is not None and self._owner == os.getpid():
            self._process.kill()
            self._process.communicate()
        self._process = None

    def close(self) -> None:
        """End the process that serves questions, if there is one; called when the process that started it exits."""
        with self._lock:
            self._end()


def _start() -> subprocess.Popen[bytes]:
    # a session of its own: the interrupt key is for the process that asks
    """Start the process that serves questions."""
    pipe = subprocess.PIPE
    return subprocess.Popen(
        [sys.executable, "-P", "-c", PROGRAM], stdin=pipe, stdout=pipe, stderr=subprocess.DEVNULL, start_new_session=True
    )


_CHILD: Final = _Child()


def confined(function: Callable[..., Any], data: bytes, memory: float, library: str = "", **options: Any) -> Any:
    """Return the result of a function of some bytes, run in a process of its own.

    Parameters
    ----------
    function : callable     Of a module, called with the bytes and the options; it returns what JSON can hold.
    data : bytes
    memory : float          Memory that it may take beside that of the process with the library. [bytes]
    library : str           Module that the function needs, as it is imported.
    options                 What JSON can hold.

    Raises
    ------
    ThermidError   That of the function.
    EndedError     When the process ends, takes more memory or time, or the function raises another error.
    """
    question = {"module": function.__module__, "function": function.__name__, "options": options, "memory": memory, "library": library}
    answer = _CHILD.ask(question | {"caps": os.environ.get(CAPS_VARIABLE)}, data)
    if not answer:
        raise EndedError("")
    if "error" in answer and not answer["kind"]:
        raise EndedError(answer["error"])
    if "error" in answer:
        kind = cast("type[ThermidError]", getattr(errors, answer["kind"]))
        raise kind(answer["error"], answer["where"], code=answer["code"])
    return answer["made"]


def serve() -> None:
    """Answer questions from the standard input until it ends."""
    questions, answers = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a library prints is no answer
    while question := questions.readline():
        answers.write(json.dumps(_answer(json.loads(question), questions)).encode() + b"\n")
        answers.flush()


def _answer(question: dict[str, Any], source: BinaryIO) -> dict[str, Any]:
    """Return the result of a function of the bytes that follow a question, or its error; empty where memory was short."""
    data = source.read(question["size"])
    os.environ.pop(CAPS_VARIABLE, None)
    os.environ |= {CAPS_VARIABLE: question["caps"]} if question["caps"] else {}
    try:
        function = getattr(import_module(question["module"]), question["function"])
        if question["library"]:
            import_module(question["library"])
        _limit(question["memory"])
        return {"made": function(data, **question["options"])}
    except ThermidError as error:
        return {"kind": type(error).__name__, "error": error.message, "where": error.where, "code": error.code}
    except MemoryError:
        return {}
    except Exception as error:
        return {"kind": "", "error": f"{type(error).__name__}: {str(error)[:200]}"}


def _limit(memory: float) -> None:
    """Limit the memory of the process to what it has and so much more [bytes], where the system states how much that is."""
    with contextlib.suppress(ImportError, OSError, ValueError):
        import resource

        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
        most = pages * resource.getpagesize() + int(memory)
        resource.setrlimit(resource.RLIMIT_AS, (most, resource.getrlimit(resource.RLIMIT_AS)[1]))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
