"""What runs in the process of an FMU: its runs by requests, under a limit of memory, each call noted.

In: settings as the host pickles them. Out: arrays as bytes, or an error in words.
"""

from __future__ import annotations

import mmap
import os
import pickle
from pathlib import Path
from queue import SimpleQueue
from threading import Thread
from typing import Any, BinaryIO, Final

from thermid.base.errors import ThermidError, cap
from thermid.interop._fmu.host import EVENTS, FOUND, REFUSED
from thermid.interop._fmu.process import NOTE, receive, send
from thermid.interop._fmu.runs import EventsFound, UnpackedFmu

MOST_BYTES: Final = 1 << 40
"""Requests come from the session, which may ask for anything."""
MOST_LETTERS: Final = 400
"""Of an error. What an FMU says of itself is cut there."""


def serve(path: str, folder: str, notes: str) -> None:
    """Answer requests for runs of an FMU until there are no more of them."""
    requests, answers = _pipes()
    waiting: SimpleQueue[bytes] = SimpleQueue()
    Thread(target=_listen, args=(requests, waiting), daemon=True).start()
    file = UnpackedFmu(Path(path), folder)
    _note_calls(file.fmpy, notes)
    _limit(cap("memory"))
    while True:
        send(answers, _answer(file, waiting.get()))


def _pipes() -> tuple[BinaryIO, BinaryIO]:
    """Return where requests come from and answers go to; what an FMU reads or prints has nothing to do with them."""
    pipes = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    nothing = os.open(os.devnull, os.O_RDWR)
    os.dup2(nothing, 0)
    os.dup2(nothing, 1)
    return pipes


def _listen(requests: BinaryIO, waiting: SimpleQueue[bytes]) -> None:
    """Take requests; where the session is gone, end at once, whatever the FMU is at."""
    try:
        while True:
            waiting.put(receive(requests, MOST_BYTES))
    finally:
        os._exit(0)


def _limit(memory: float) -> None:
    """Limit the memory [bytes] of this process, where the system can; write no image of a crash."""
    try:
        import resource
    except ImportError:  # Windows
        return
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_AS, (int(memory), int(memory)))


def _note_calls(fmpy: Any, notes: str) -> None:
    """Write each call of FMPy into the FMU to the page, before it is made."""
    with Path(notes).open("r+b") as file:
        page = mmap.mmap(file.fileno(), mmap.PAGESIZE)
    base, count, at = fmpy.fmi1._FMU, 0, 0.0
    load, call = base.__init__, base._call

    def loaded(fmu: Any, *args: Any, **named: Any) -> None:
        nonlocal at
        at = 0.0
        noted("dlopen")
        load(fmu, *args, **named)

    def called(fmu: Any, name: str, *args: Any) -> Any:
        nonlocal at
        if name.endswith(("DoStep", "SetTime")):
            at = float(getattr(args[1], "value", args[1]))
        noted(name)
        return call(fmu, name, *args)

    def noted(name: str) -> None:
        nonlocal count
        count += 1
        NOTE.pack_into(page, 0, count, at, name.encode())

    base.__init__, base._call = loaded, called


def _answer(file: UnpackedFmu, request: bytes) -> bytes:
    """Return the arrays of a run as bytes, or why there are none."""
    try:
        found, slopes = file.run(*pickle.loads(request))
        return FOUND + found.tobytes() + slopes.tobytes()
    except EventsFound:
        return EVENTS
    except ThermidError as error:
        said = str(error.message)
    except Exception as error:  # whatever FMPy finds
        said = f"the FMU could not be run: {error or type(error).__name__}"
    return REFUSED + said[:MOST_LETTERS].encode("utf-8", "replace")
