"""Mutants of every kind of file through what reads them: only the library's own errors, none above 5 s of processor time or 1 GB.

``python -m torture.files python|logs|commands|spawned|calls SECONDS SEED [NUMBER]`` in the folder tests prints one JSON object.
"""

from __future__ import annotations

import contextlib
import copy
import gzip
import io
import json
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
import zipfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

from torture.arguments import CALLS, called
from torture.mutants import mutant
from torture.seeds import KINDS, LOGS, make

PROCESSOR = 5.0
"""Processor time in which a mutant is read or refused. [s]"""
MEMORY = 1 << 30
"""Memory that reading a mutant may take beside what the process has. [bytes]"""


class TooLongError(BaseException):
    """A mutant took more processor time than it may."""


def _over(*_: object) -> None:
    raise TooLongError


def _seen(error: BaseException) -> str:
    """Return where an error came from: its class and the last line of thermid."""
    frames = [f for f in traceback.extract_tb(error.__traceback__) if "/thermid/" in f.filename]
    at = f"{Path(frames[-1].filename).name}:{frames[-1].lineno}" if frames else "?"
    return f"{type(error).__name__} at {at}: {str(error)[:100]}"


def judged(call: Callable[[], Any], file: str) -> str:
    """Run what reads a mutant; return nothing where it answers or refuses as it should, else what was wrong."""
    from thermid.base.errors import ThermidError

    signal.setitimer(signal.ITIMER_PROF, PROCESSOR)
    try:
        with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            warnings.simplefilter("ignore")
            call()
    except ThermidError as error:
        text = str(error)
        return "" if text.strip() else f"{type(error).__name__} without a word"
    except OSError as error:
        return "" if error.filename is not None else _seen(error)
    except SystemExit as left:
        return "" if left.code in (None, 0, 1, 2, 3, 4, 5) else f"exit code {left.code}"
    except KeyboardInterrupt:
        raise
    except TypeError as error:  # the words of Python itself for an argument that does not exist
        return "" if re.search("unexpected keyword|must be a mapping|required positional|multiple values", str(error)) else _seen(error)
    except TooLongError as error:
        return _seen(error)
    except BaseException as error:
        return _seen(error)
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
    return ""


def _limit() -> None:
    """Let the process have so much more memory and no more."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
    most = pages * resource.getpagesize() + MEMORY
    resource.setrlimit(resource.RLIMIT_AS, (most, most))


def reads(kind: str, base: Path, seed: str) -> str:
    """Read one mutant of a kind in Python; return what was wrong."""
    of = KINDS[kind]
    file, good = base / of.file, (base / of.file).read_bytes()
    file.write_bytes(_mutant(of.file, seed, good))
    try:
        return judged(lambda: of.read(file), file.name)
    finally:
        file.write_bytes(good)


def commands(kind: str, base: Path, seed: str) -> str:
    """Give one mutant of a kind to one of its commands, in this process; return what was wrong."""
    from thermid.app.cli.app import main

    def run(words: list[str]) -> str:
        before = sys.argv
        sys.argv = ["thermid", *words]
        try:
            return judged(main, words[0])
        finally:
            sys.argv = before

    return _commanded(kind, base, seed, run)


def spawned(kind: str, base: Path, seed: str) -> str:
    """The same in a process of its own."""

    def run(words: list[str]) -> str:
        made = subprocess.run([sys.executable, "-m", "thermid", *words], capture_output=True, text=True, check=False)
        right = made.returncode in (0, 1, 2, 3, 4, 5) and "Traceback" not in made.stderr
        return "" if right else f"exit code {made.returncode}: {made.stderr[-200:]}"

    return _commanded(kind, base, seed, run)


def _commanded(kind: str, base: Path, seed: str, run: Callable[[list[str]], str]) -> str:
    """Run one of the commands of a kind on a mutant; return what was wrong."""
    of = KINDS[kind]
    file, good = base / of.file, (base / of.file).read_bytes()
    file.write_bytes(_mutant(of.file, seed, good))
    words = of.commands[int(seed.rpartition(" ")[2]) // len(KINDS) % len(of.commands)]
    try:
        wrong = run([of.file if w == "{}" else w for w in words])
        return wrong and f"{words[0]}: {wrong}"
    finally:
        file.write_bytes(good)
        shutil.rmtree(base / "results", ignore_errors=True)


def calls(name: str, base: Path, seed: str) -> str:
    """Call a function of the library with a mutant of its argument; return what was wrong."""
    return judged(called(name, base, seed), name)


def _mutant(name: str, seed: str, good: bytes) -> bytes:
    """Return a mutant; of a packed file half the time one of what it packs, of a workbook of one of its parts."""
    number = int(seed.rpartition(" ")[2])
    if name.endswith(".xlsx") and number % 2:
        out = io.BytesIO()
        with zipfile.ZipFile(io.BytesIO(good)) as book, zipfile.ZipFile(out, "w") as made:
            parts = book.namelist()
            for part in parts:
                data = book.read(part)
                made.writestr(part, mutant(seed, data) if part == parts[number // 2 % len(parts)] else data)
        return out.getvalue()
    if name.endswith(".gz") and number % 2:
        return gzip.compress(mutant(seed, gzip.decompress(good)), mtime=0)
    return mutant(seed, good)


def campaign(how: str, seconds: float, first: int, most: int = sys.maxsize) -> dict[str, Any]:
    """Read mutants of all kinds in turn for some seconds; return counts by kind and the findings with the seed of one of each."""
    judge = {"python": reads, "logs": reads, "commands": commands, "spawned": spawned, "calls": calls}[how]
    kinds = [*CALLS] if how == "calls" else [k for k, of in KINDS.items() if how == "python" or of.commands]
    kinds = [*LOGS] if how == "logs" else kinds
    counts: Counter[str] = Counter()
    found: dict[str, list[str]] = {}
    before = Path.cwd()
    signal.signal(signal.SIGPROF, _over)
    with tempfile.TemporaryDirectory() as place:
        base = Path(place)
        make(base)
        os.chdir(base)
        try:
            for of in KINDS.values():  # a good file is read; what it loads is loaded once
                of.read(base / of.file)
            for call, good in CALLS.values() if how == "calls" else ():
                call(copy.deepcopy(good)) if good is not CALLS["environment"][1] else None
            end, number = time.monotonic() + seconds, first
            while time.monotonic() < end and number < first + most:
                kind = kinds[number % len(kinds)]
                seed = f"{kind} {number}"
                wrong = judge(kind, base, seed)
                counts[kind] += 1
                if wrong:
                    found.setdefault(f"{kind}: {wrong}", []).append(seed)
                number += 1
        finally:
            os.chdir(before)
    return {"how": how, "counts": counts, "findings": {k: [len(v), v[0]] for k, v in found.items()}}


if __name__ == "__main__":
    _limit()
    sys.stdout.write(json.dumps(campaign(sys.argv[1], float(sys.argv[2]), int(sys.argv[3]), *map(int, sys.argv[4:])), indent=1) + "\n")
