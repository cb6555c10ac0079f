"""Fuzz the kernel and the public API: ``python scripts/fuzz.py --minutes 10 --seed 1``, or ``scripts/sanitize scripts/fuzz.py ...``.

Cases run in a process of their own, so that a crash or a hang is a finding with its seed. The exit code is 1 when there is a finding.
Of a case that takes too long the stack is printed, and of one that the clock ends its processor time as well: a process that waits for its
turn on a busy machine has used next to none, and the case is not at fault. The work of a case is bounded: the oracle gives up after 25 000
evaluations at each of two tolerances, some 15 s.
"""

from __future__ import annotations

import argparse
import faulthandler
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

TESTS = Path(__file__).parent.parent / "tests"
HANG = 120.0
"""Processor time in which a case must end, so that a busy machine finds nothing; ten times that by the clock. [s]"""


def child(first: int) -> None:
    """Judge one seed after the other, and say so before and after each."""
    sys.path.insert(0, str(TESTS))
    faulthandler.register(signal.SIGPROF, chain=True)
    faulthandler.register(signal.SIGUSR1)
    from fuzz.judge import Verdicts, judge

    for seed in range(first, sys.maxsize):
        print(f"seed {seed}", flush=True)
        signal.setitimer(signal.ITIMER_PROF, HANG)  # ends the process: SIGPROF
        verdicts = Verdicts()
        judge(seed, verdicts)
        for found in verdicts.findings:
            print(f"finding {found}", flush=True)


def main() -> int:
    """Run children until the time is over; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=1, help="the first seed")
    parser.add_argument("--child", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.child:
        child(given.seed)
    end, seed, findings, begun = time.monotonic() + 60.0 * given.minutes, given.seed, 0, given.seed
    while time.monotonic() < end:
        seed, lines = batch(seed, end)
        findings += len(lines)
        for line in lines:
            print(line, flush=True)
    print(f"{seed - begun} cases, {findings} findings")
    return 1 if findings else 0


def batch(first: int, end: float) -> tuple[int, list[str]]:
    """Run one child until it dies, hangs or the time is over; return the next seed and what was found."""
    command = [sys.executable, str(Path(__file__)), "--child", "--seed", str(first)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    lines: list[str] = []
    reader = threading.Thread(target=lambda: lines.extend(_noting(process, last)), daemon=True)
    last = [float(first), time.monotonic()]
    reader.start()
    why = ""
    while process.poll() is None and not why:
        time.sleep(0.2)
        if time.monotonic() - last[1] > 10.0 * HANG:
            process.send_signal(signal.SIGUSR1)  # prints the stack
            time.sleep(1.0)
            why = f"not done after {10.0 * HANG:g} s by the clock"
        elif time.monotonic() > end:
            why = "over"
    crashed = process.poll() is not None
    before = os.times()
    process.kill()
    process.wait()
    used = os.times().children_user + os.times().children_system - before.children_user - before.children_system
    reader.join(timeout=5.0)
    if crashed:
        hangs = process.returncode == -signal.SIGPROF
        lines.append(
            f"seed {last[0]:.0f}: " + (f"works for more than {HANG:g} s" if hangs else f"the process died with {process.returncode}")
        )
    elif why != "over":
        lines.append(f"seed {last[0]:.0f}: {why}; {used:.0f} s of processor time since the process began with seed {first}")
    return int(last[0]) + 1, lines


def _noting(process: subprocess.Popen[str], last: list[float]) -> list[str]:
    """Return the findings that a child prints; keep the seed under way and the time in `last`."""
    found = []
    for line in process.stdout or ():
        word, _, rest = line.strip().partition(" ")
        if word == "seed":
            last[:] = [float(rest), time.monotonic()]
        elif word == "finding":
            found.append(rest)
    return found


if __name__ == "__main__":
    sys.exit(main())
