"""What is wrong with what the contestants say of a case."""

from __future__ import annotations

import os
import time
from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from fuzz import crooked, exact
from fuzz.contestants import CONTESTANTS, NOT_ASKED, TIGHT, Outcome
from fuzz.networks import Case, draw
from thermid import _kernel as k

SLOW = 20.0 * (10.0 if "libasan" in os.environ.get("LD_PRELOAD", "") else 1.0)
"""CPU time that no case may take, ten times of it under the sanitizers, which slow the kernel by so much (seed 11: 6 s, then 52). [s]"""
TIED, TIED_ERROR = 1e10, 0.1
"""Between steps the outputs of nodes that are tied together by this conductance or more [W/K] may be this far off [K]: temperatures are
rounded to 6e-14 K, and 1e12 W/K make 0.06 W of that, which a slope between steps shows. The ends of the steps are right."""
LARGE = ("large", "explicit", "implicit")
LARGE_ERROR, LARGE_GROWTH = 0.1, 0.01
"""Methods of large networks: some thirty of their local tolerances [K], and where a power grows with temperature a part of the whole range
[-], since an error then grows as the temperature does."""
MAY_REFUSE = ("modal", *LARGE)


@dataclass
class Verdicts:
    """How many cases ended how, by family and contestant, and what was found."""

    counts: Counter[tuple[str, str, str]] = field(default_factory=Counter)
    findings: list[str] = field(default_factory=list)

    def table(self) -> str:
        """Return the counts as lines."""
        return "\n".join(f"{family:13s} {who:10s} {how:14s} {count:6d}" for (family, who, how), count in sorted(self.counts.items()))


def truth(case: Case) -> tuple[str, np.ndarray | None]:
    """Return who knows the answer and the temperatures (times, nodes): exact, crooked, undefined or nobody."""
    t = case.times
    asked = t.size > 0 and np.isfinite(t).all() and (np.diff(t) >= 0).all() and not {"t0", "t_end"} & set(case.options)
    if not asked:
        return "nobody", None
    try:
        if exact.is_linear(case.net):
            return "exact", exact.solve(case.net, t)
        return "crooked", crooked.solve(case.net, t)
    except exact.UndefinedError:
        return "undefined", None
    except (crooked.NoVerdictError, ArithmeticError):
        return "nobody", None


def tolerance(case: Case, who: str, real: np.ndarray) -> np.ndarray:
    """Return how far from the truth each contestant may be (times, nodes). [K]"""
    oracle, span = 1e-4 + 1e-6 * np.abs(real), float(np.ptp(real))
    if who in LARGE:
        return np.asarray(oracle + LARGE_ERROR + (LARGE_GROWTH * span if case.family == "runaway" else 0.0), dtype=float)
    # a run steps some thousand times at the local tolerance; a wild tolerance is the caller's own wish
    given = (TIGHT if who == "tight" else {"atol": 2e-7, "rtol": 2e-8, "input_atol": 1e-4}) | case.options
    local = max(1e4 * (given["atol"] + given["rtol"] * span) + 10 * given["input_atol"], 1e-4)
    if any(row[0] == k.LINEAR and case.net.coefs[row[3][0]][0] >= TIED for row in case.net.conductors):
        oracle = oracle + TIED_ERROR
    return np.asarray(oracle + local, dtype=float)


def judge(seed: int, verdicts: Verdicts) -> None:
    """Let every contestant compute the case of a seed, and note what is wrong."""
    case = draw(seed)
    knows, real = truth(case)
    for who, contestant in CONTESTANTS.items():
        begin = time.process_time()
        found = contestant(case)
        spent = time.process_time() - begin
        if spent > SLOW:
            verdicts.findings.append(f"seed {seed} {case.family} {who}: {spent:.0f} s")
        fault = _fault(case, who, found, knows, real)
        if fault:
            verdicts.findings.append(f"seed {seed} {case.family} {who}: {fault}")
        how = found.status if found.status != "OK" else " ".join(("OK", knows, found.why)).strip()
        verdicts.counts[case.family, who, how] += 1


def _fault(case: Case, who: str, found: Outcome, knows: str, real: np.ndarray | None) -> str:
    """Return what is wrong; empty when nothing is."""
    if found.status == "DIFFERS":
        return found.why
    if found.why == NOT_ASKED:
        return ""
    if found.status != "OK" or found.traces is None:
        if found.status == "refused" and not found.why:
            return "refused without a word"
        strict = case.benign and not case.broken and who not in MAY_REFUSE
        return f"gives up on a benign network: {found.status} {found.why}" if strict else ""
    if not np.isfinite(found.traces).all():
        return "says OK with temperatures that are no numbers"
    if knows == "undefined":
        return "gives a temperature to a massless node that has none"
    if real is None:
        return ""
    every = found.traces.reshape(-1, *real.shape)
    off = np.abs(every - real)
    if (off > tolerance(case, who, real)).any() and not _other_balance(case, who, every, real):
        m, j, i = np.unravel_index(int(np.argmax(off / tolerance(case, who, real))), off.shape)
        return f"{off[m, j, i]:.3g} K off at {case.times[j]:g} s, node {i}: {every[m, j, i]:.9g} for {real[j, i]:.9g} K ({knows})"
    return ""


def _other_balance(case: Case, who: str, every: np.ndarray, real: np.ndarray) -> bool:
    """Whether nodes with capacitance agree, and massless ones rest in a balance of their own.

    Where a conductance falls steeply with temperature, the heat of a massless node has several zeros. Any at which the heat falls as
    the node warms is an answer, and where the heat that goes on to the others is the same, so are their temperatures.
    """
    oracle, allowed = crooked.Crooked(case.net), tolerance(case, who, real)
    rest, heavy = oracle.massless, oracle.massive
    if not rest.size or oracle.thermostats or (np.abs(every - real) > allowed)[..., heavy].any():
        return False
    for m, j in np.argwhere((np.abs(every - real) > allowed).any(axis=2)):
        here, time = every[m, j], float(case.times[j])
        oracle.calls, oracle.middle = 0, time
        heat, jacobian = oracle.heat(time, here)[rest], np.empty((rest.size, rest.size))
        for column, node in enumerate(rest):
            moved = here.copy()
            moved[node] += 1e-4
            jacobian[:, column] = (oracle.heat(time, moved)[rest] - heat) / 1e-4
        away = np.abs(np.linalg.solve(jacobian, heat))
        if (away > allowed[j, rest]).any() or np.linalg.eigvals(jacobian).real.max() >= 0.0:
            return False
    return True
