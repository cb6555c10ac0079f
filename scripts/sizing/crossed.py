"""Whole sets left out: sizes from the others, values from at most two conditions of the set, its other conditions predicted."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from scipy.stats import beta

import thermid as td
from thermid.base.errors import ThermidError
from thermid.fit._error_model import model as _model
from thermid.fit.calibration import Calibration
from thermid.fit.error_model import SIZES

sys.path.insert(0, str(Path(__file__).parents[1]))
from judging import scores as s

from .likelihood import FIRST
from .population import Likelihoods, scales
from .sets import Array, Condition, TestSet

SINGLE = (0.05, 0.1, 0.2, 0.4)
"""Scales of one half-normal for all departures that are tried; the best of them in hindsight is what learned sizes are held against."""
DEPARTURES = ("surface", "joint", "law", "hidden", "run")
"""Sizes that one half-normal may have in common: those in parts of a value."""
OTHERS, BEFORE = "other sets", "first priors"
MEMBERS, TIMES = 64, 60
"""Sets of sizes that are averaged over here, for time's sake, and times of a condition that are looked at."""
LEAST, SEED, REPEATS = 15, 20261124, 2000
"""Sets from which a share is passed or not, and not only reported."""


def priors_without(of: TestSet, found: Likelihoods) -> dict[str, dict[str, float]]:
    """Return rule -> size -> its scale, from every set but one."""
    learned = {g: told.value for g, told in scales({n: x for n, x in found.items() if n != of.name}).items()}
    learned["hidden"] = FIRST["hidden"]  # as shipped: with what the sets ask for, logs that were left out are predicted worse
    learned |= {"law": learned["joint"], "room": learned["room" if of.logged else "unlogged"]}  # law: see `likelihood.NAMED`
    every = {OTHERS: learned, BEFORE: FIRST, **{f"single {h:g}": learned | dict.fromkeys(DEPARTURES, h) for h in SINGLE}}
    return {rule: {g: size for g, size in sizes.items() if g in SIZES} for rule, sizes in every.items()}


def rows_of(of: TestSet, rules: Mapping[str, Mapping[str, float]]) -> list[s.Row]:
    """Return the rows of all conditions of a set that its fit did not see."""
    try:
        found: Calibration | str = of.fitted(of.taught)
    except ThermidError as error:
        found = str(error)
    out = []
    for rule, sizes in rules.items():
        given = {g: replace(SIZES[g], value=size) for g, size in sizes.items()}
        with patch.dict(SIZES, given), patch.object(_model, "SETS", MEMBERS):
            model = found if isinstance(found, str) else td.inference.ErrorModel.of_fit(found)
            print(f"{of.name}, {rule}", file=sys.stderr, flush=True)
            out += [_row(of, c, model, rule) for c in of.conditions if c.name not in of.taught]
    return out


def _row(of: TestSet, c: Condition, model: Any, rule: str) -> s.Row:
    """Return the row of a condition: its sensors one after the other; a refusal has the range of the fitted readings."""
    tags = {"rule": rule, "set": of.name, "stratum": of.name, "unit": of.name, "run": c.name, "sensor": "all"}
    spread = float(np.mean([x.var() for x in c.readings.values()]))
    try:
        if isinstance(model, str):
            raise td.ThermidError(model)
        looked = np.unique(np.linspace(0, c.times.size - 1, TIMES).round().astype(int))
        told = model.band(c.scenario(of.follows(model.fit, c)), list(c.readings), times=c.times[looked], as_logged=True)
    except (ThermidError, np.linalg.LinAlgError) as error:
        print(f"{of.name}, {c.name}, {rule}: {str(error)[:150]}", file=sys.stderr, flush=True)
        return s.scored(*_range(of, c), refused=True, variance=spread, **tags)
    off = np.concatenate([x[looked] - told[n].kelvin for n, x in c.readings.items()])
    return s.scored(off, np.concatenate([told[n].half_width for n in c.readings]), variance=spread, **tags)


def _range(of: TestSet, c: Condition) -> tuple[Array, Array]:
    seen = {n: np.concatenate([of[t].readings[n] for t in of.taught]) for n in c.readings}
    off = [x - 0.5 * (seen[n].min() + seen[n].max()) for n, x in c.readings.items()]
    return np.concatenate(off), np.concatenate([np.full(x.shape, 0.5 * np.ptp(seen[n])) for n, x in c.readings.items()])


def summary(rows: Sequence[s.Row]) -> str:
    """Return the table of rules, sets weighing the same, the score in parts of a set's standard deviation; and what it comes to."""
    rules = list(dict.fromkeys(r.rule for r in rows))
    sets = list(dict.fromkeys(r.set for r in rows))
    mean = {(k, n): _means([r for r in rows if r.rule == k and r.set == n]) for k in rules for n in sets}
    lines = ["| sizes | inside % | half-width / RMS | score / sd | refused |", "|---|---|---|---|---|"]
    for k in rules:
        inside, ratio, score, refused = (float(np.mean([mean[k, n][i] for n in sets])) for i in range(4))
        lines.append(f"| {k} | {100 * inside:.0f} | {ratio:.1f} | {score:.2f} | {100 * refused:.0f} % |")
    best = min((k for k in rules if k.startswith("single")), key=lambda k: float(np.mean([mean[k, n][2] for n in sets])))
    ratios = np.array([mean[OTHERS, n][2] / mean[best, n][2] for n in sets])
    share = np.array([mean[OTHERS, n][0] for n in sets])
    kept = [r.inside >= 0.9 for r in rows if r.rule == OTHERS]
    picks = np.random.default_rng(SEED).integers(0, len(sets), (REPEATS, len(sets)))
    held = np.quantile(share[picks].mean(axis=1), [0.025, 0.975])
    total = {k: np.array([mean[k, n][2] for n in sets]) for k in (OTHERS, best)}
    against = np.quantile(total[OTHERS][picks].sum(axis=1) / total[best][picks].sum(axis=1), [0.025, 0.975])
    low, high = beta.ppf([0.025, 0.975], [sum(kept), sum(kept) + 1], [len(kept) - sum(kept) + 1, len(kept) - sum(kept)])
    lines += [
        "",
        f"Score over that of the best single half-normal ({best}, chosen in hindsight): {total[OTHERS].sum() / total[best].sum():.2f} "
        f"({against[0]:.2f} .. {against[1]:.2f}, bootstrap by set; median over sets {np.median(ratios):.2f}).",
        f"Inside: {100 * share.mean():.0f} % ({100 * held[0]:.0f} .. {100 * held[1]:.0f}, bootstrap by set). Conditions with at least 90 % "
        f"inside: {sum(kept)} of {len(kept)} (exact limits {100 * low:.0f} .. {100 * high:.0f} %).",
        f"{len(sets)} sets: {'judged' if len(sets) >= LEAST else f'reported, not passed, below {LEAST}'}.",
    ]
    return "\n".join(lines)


def figures(rows: Sequence[s.Row], name: str) -> str:
    """Return how many conditions of a set were predicted under sizes of the others, share inside, half-width, RMS and score. [K]"""
    own = [r for r in rows if r.rule == OTHERS and r.set == name]
    if not own:
        return "| | | |"
    rms = float(np.sqrt(np.mean([r.square for r in own])))
    told = [100 * np.mean([r.inside for r in own]), np.mean([r.half for r in own]), rms, np.mean([r.score for r in own])]
    refused = sum(r.refused for r in own)
    return f"{len(own)}{f', {refused} declined' if refused else ''} | {told[0]:.0f} | {told[1]:.2g} / {told[2]:.2g} | {told[3]:.2g}"


def _means(rows: Sequence[s.Row]) -> tuple[float, float, float, float]:
    """Return share inside, half-width over RMS, score over the standard deviation of the readings, share refused."""
    rms = float(np.sqrt(np.mean([r.square for r in rows])))
    spread = float(np.sqrt(np.mean([r.variance for r in rows])))
    means = (float(np.mean([getattr(r, what) for r in rows])) for what in ("inside", "half", "score", "refused"))
    inside, half, score, refused = means
    return inside, half / rms, score / spread, refused
