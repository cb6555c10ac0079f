"""Logs and processes under attack: size, pipes, bombs, links that are exchanged, closed pipes, signals, folders that cannot be written.

``python -m torture.logs SECONDS SEED`` in the folder tests prints one JSON object: how many of each, what was wrong, what was measured.
"""

from __future__ import annotations

import ctypes
import gzip
import json
import os
import random
import resource
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

from unit.app.cli.test_outputs import contents, laboratory
from unit.test_caps import book, hdf5, matlab, sheet

ROWS = 10_000_000
MEMORY = 1 << 30
"""Memory that a bomb may take beside what a process has. [bytes]"""
LARGE = 8 << 30
"""Memory that ten million rows may take. [bytes]"""
PR_CAPBSET_DROP, CAP_DAC_OVERRIDE, CAP_DAC_READ_SEARCH = 24, 1, 2
"""Of Linux: to give up a right; to write and to read what others may not."""


class Attack:
    """What was tried, what was wrong, what was measured."""

    def __init__(self, folder: Path, seed: int, seconds: float) -> None:
        self.folder, self.dice, self.seconds = folder, random.Random(seed), seconds
        self.counts: Counter[str] = Counter()
        self.found: list[str] = []
        self.measured: dict[str, str] = {}

    def run(self, *words: str, memory: int = 0, rights: bool = True, **more: Any) -> subprocess.CompletedProcess[bytes]:
        """Run a command in a process of its own; without `rights`, root may write where anybody else may."""

        def limited() -> None:
            if memory:
                resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
            if not rights and os.geteuid() == 0:
                for right in CAP_DAC_OVERRIDE, CAP_DAC_READ_SEARCH:
                    ctypes.CDLL(None).prctl(PR_CAPBSET_DROP, right, 0, 0, 0)

        given: dict[str, Any] = {"capture_output": True, "cwd": self.folder, "check": False, "timeout": 600} | more
        return subprocess.run([sys.executable, "-m", "thermid", *words], preexec_fn=limited, **given)

    def judge(self, what: str, made: subprocess.CompletedProcess[bytes], codes: tuple[int, ...], said: str = "") -> None:
        """Count an attack, and note it where it did not end as it should."""
        self.counts[what] += 1
        text = (made.stderr or b"").decode(errors="replace")
        if made.returncode not in codes or "Traceback" in text or said not in text:
            self.found.append(f"{what}: exit code {made.returncode}: {text[-200:].strip()}")


def _rows(a: Attack) -> None:
    """Ten million rows, looked at."""
    path = a.folder / "large.csv"
    with path.open("w", encoding="ascii") as file:
        file.write("time_s,T1 [degC]\n")
        for k in range(0, ROWS, 100_000):
            file.write("".join(f"{j},{20 + (j % 977) / 100:.2f}\n" for j in range(k, k + 100_000)))
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    a.judge("a log of ten million rows", a.run("look", "large.csv", memory=LARGE), (0,))
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    a.measured["ten million rows"] = f"{after.ru_utime - before.ru_utime:.0f} s of processor time, {after.ru_maxrss / 1e6:.1f} GB"
    path.unlink()


def _bombs(a: Attack) -> None:
    """Files of kilobytes that say they hold gigabytes."""
    with gzip.open(a.folder / "zeros.csv.gz", "wb", compresslevel=1) as file:
        for _ in range(300):
            file.write(b"1,2\n" * 250_000)
    os.environ["THERMID_CAPS"] = "unpacked=1e6"
    for make in (hdf5, matlab, lambda f: book(f, empty=300_000)):
        a.judge("files that unpack to more than the cap", a.run("look", make(a.folder).name, memory=2 * MEMORY), (2,), "cap 'unpacked'")
    del os.environ["THERMID_CAPS"]
    for name in ("zeros.csv.gz", book(a.folder, "XFD1048576").name, sheet(a.folder, 1_048_570, 16_000).name):
        a.judge("files that unpack to more than the cap", a.run("look", name, memory=2 * MEMORY), (2,), "cap 'unpacked'")


def _pipes(a: Attack) -> None:
    """A pipe that is silent, one that is full, a device without an end; output that nobody reads."""
    os.mkfifo(a.folder / "pipe")
    a.judge("silent pipes and endless devices", a.run("look", "pipe"), (2,), "nothing came out of it")
    a.judge("silent pipes and endless devices", a.run("look", "/dev/zero"), (2,), "cap 'unpacked'")
    thread = threading.Thread(target=lambda: (a.folder / "pipe").write_bytes((a.folder / "logs/pair_one.csv").read_bytes()))
    thread.start()
    a.judge("full pipes", a.run("look", "pipe"), (0,))
    thread.join()
    for words in (
        ("look", "logs/pair_one.csv"),
        ("check", "campaign.toml"),
        ("simulate", "box.toml", "--scenario", "warm.toml", "--json"),
        ("steady", "box.toml", "--scenario", "warm.toml"),
        ("schema", "deck"),
    ):
        inner, outer = os.pipe()
        os.close(inner)
        made = a.run(*words, stdout=outer, stderr=subprocess.PIPE, capture_output=False)
        os.close(outer)
        a.judge("closed pipes", made, (0, 1, 2, 120, 141, -13))


def _links(a: Attack) -> None:
    """An output that is a link, which leads to one input and then to another while the command runs."""
    before, link, going = contents(a.folder), a.folder / "link.csv", True

    def exchange() -> None:
        k = 0
        while going:
            k += 1
            half = a.folder / f"half{k % 2}"
            half.symlink_to(("logs/pair_one.csv", "logs/box_bench.csv", "made.csv")[k % 3])
            os.replace(half, link)

    thread = threading.Thread(target=exchange)
    thread.start()
    try:
        for _ in range(max(4, round(a.seconds / 8.0))):
            a.judge("links that are exchanged", a.run("simulate", "box.toml", "--scenario", "warm.toml", "--csv", "link.csv"), (0, 1, 2))
    finally:
        going = False
        thread.join()
    after = contents(a.folder)
    a.found += [f"links that are exchanged: {n} was changed" for n in before if after.get(n) != before[n]]
    for name in ("link.csv", "half0", "half1", "made.csv"):
        (a.folder / name).unlink(missing_ok=True)


def _closed_folders(a: Attack) -> None:
    """Folders in which nothing may be written."""
    os.chmod(a.folder, 0o555)
    before = contents(a.folder)
    for words in (
        ("simulate", "box.toml", "--scenario", "warm.toml", "--csv", "x.csv"),
        ("diagram", "box.toml", "--to", "x.svg"),
        ("calibrate", "campaign.toml", "--to", "closed"),
        ("hold", "hold.toml", "--to", "closed"),
        ("init", "logs/pair_one.csv", "--to", "closed"),
    ):
        a.judge("folders that cannot be written", a.run(*words, rights=False), (2,), "ermission denied")
    if contents(a.folder) != before:
        a.found.append("folders that cannot be written: something was changed")
    os.chmod(a.folder, 0o755)


def _signals(a: Attack) -> None:
    """SIGTERM at a random moment; then the same command again, whole."""
    jobs: dict[str, tuple[str, ...]] = {
        "qualify": ("qualify", "plan.toml", "--to", "q.html"),
        "hold": ("hold", "hold.toml", "--to", "r", "--figure", "r.png"),
        "watch": ("watch", "logs/pair_one.csv"),
    }
    for name, words in jobs.items():
        for _ in range(max(2, round(a.seconds / 12.0))):
            before = contents(a.folder)
            process = subprocess.Popen(
                [sys.executable, "-m", "thermid", *words], cwd=a.folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
            )
            time.sleep(a.dice.uniform(0.1, 4.0))
            process.terminate()
            try:
                _, said = process.communicate(timeout=60)
            except subprocess.TimeoutExpired:
                process.kill()
                process.communicate()
                a.found.append(f"SIGTERM of {name}: it goes on")
                continue
            left = contents(a.folder)
            a.counts[f"SIGTERM at a random moment of {name}"] += 1
            if b"Traceback" in said or process.returncode not in (-signal.SIGTERM, 0, 1, 2, 4, 130, 143):
                a.found.append(f"SIGTERM of {name}: exit code {process.returncode}: {said[-200:].decode(errors='replace')}")
            a.found += [f"SIGTERM of {name}: {n} was changed" for n in before if before[n] != left.get(n) and n != "trial.log"]
            a.found += [
                f"SIGTERM of {name}: {n} is half" for n in left if n.endswith(("q.html", "r.png")) and b"written by thermid" not in left[n]
            ]
        if name == "log":
            a.judge("logs read after SIGTERM", a.run("look", "trial.log"), (0,))
        elif name != "watch":
            again = a.run(*words)
            strays = [n for n in contents(a.folder) if ".half." in n]
            if again.returncode not in (0, 1, 4) or strays:
                a.found.append(f"after SIGTERM of {name}: exit code {again.returncode}, strays {strays}: {again.stderr[-200:]!r}")


PARTS: tuple[Callable[[Attack], None], ...] = (_rows, _bombs, _pipes, _links, _closed_folders, _signals)


def campaign(seconds: float, seed: int) -> dict[str, Any]:
    """Run every attack; the large log only where there is time for it."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "bench"
        folder.mkdir()
        os.chmod(place, 0o755)
        a = Attack(folder, seed, seconds)
        laboratory(folder)
        for part in PARTS:
            if part is not _rows or seconds >= 60.0:
                part(a)
    return {"counts": a.counts, "findings": a.found, "measured": a.measured}


if __name__ == "__main__":
    sys.stdout.write(json.dumps(campaign(float(sys.argv[1]), int(sys.argv[2])), indent=1) + "\n")
