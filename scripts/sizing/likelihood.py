"""One likelihood grid a size from each set, by the evidence of the model of error.

Sizes of a set are drawn by Gibbs steps on a grid of logarithms (Ritter and Tanner, J. Am. Stat. Assoc. 87 (1992) 861), every value of the
grid as likely before; so the mean of the conditional probabilities over the draws is the likelihood of a size, the others being averaged
over by what the same readings say of them. Where a size is far below what the readings can show, its likelihood is level.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any
from unittest.mock import patch

import numpy as np

import thermid as td
from thermid.fit._error_model import model as _model
from thermid.fit._error_model.gaussian import RunRows, Wander, members_of
from thermid.fit._error_model.model import GROUPS, RunsOfFit, deviations, reach
from thermid.fit._error_model.runs import run_rows
from thermid.fit._error_model.sizes import LEFT_TIMES, SIZES

from .sets import Array, TestSet

FIRST = {"surface": 0.05, "joint": 0.03, "law": 0.05, "trend": 0.005, "hidden": 0.1, "run": 0.01, "room": 0.2, "left": 0.1}
FIRST |= {"unlogged": FIRST["room"]}
"""First priors of the sizes, before any set was looked at: where the grids are laid, and the centres of the population's prior."""
GRID = np.geomspace(0.03, 30.0, 11)
"""Sizes that are tried, in parts of the first prior; the least stands for none."""
NAMED = {"law": "joint"}
"""The model counts a joint whose conductance may grow with its level among laws; the decks of the sets have no other laws."""
CHAINS, STEPS, WARMING, SEED = 6, 14, 4, 20261124


class Evidence:
    """Logarithm of the evidence of a set's readings at sizes, where its heat is carried in one way."""

    def __init__(self, runs: RunsOfFit, centre: Array) -> None:
        self.runs, self.centre = runs, centre
        self._rows: dict[tuple[float, float], list[RunRows]] = {}

    def __call__(self, sizes: Array, left: float, time: float) -> Array:
        """Return it (members,) at sizes (members, groups) and at a size [K] and time (of the run) of what no element explains."""
        if (left, time) not in self._rows:
            shared = len(self.runs.values) + len(self.runs.columns)
            pairs = zip(self.runs.traces, self.runs.spans, strict=True)
            self._rows[left, time] = [run_rows(t, [Wander(left, time * span)], shared)[0] for t, span in pairs]
        wide = np.array([reach(self.runs.problem.unknowns[k]) for k in self.runs.values])
        every = np.column_stack([np.broadcast_to(wide, (len(sizes), wide.size)), deviations(self.runs.columns, sizes)])
        own = [np.zeros((len(sizes), 0)), *(deviations(c, sizes) for c in self.runs.own)]
        return members_of([next(iter(self.runs.rows(0.0).values()))[0], *self._rows[left, time]], self.centre, every, own).log_evidence

    @property
    def concerned(self) -> list[str]:
        """Sizes that anything of the set has."""
        told = {c.group for c in self.runs.columns} | {c.group for own in self.runs.own for c in own}
        return [g for g in GROUPS if g in told]


def evidence_of(found: td.Calibration) -> Evidence:
    """Return the evidence where the heat of a fit is carried in the likeliest way, as its model of error has it."""
    seen: dict[str, Evidence] = {}
    plain = _model._averaged

    def watched(runs: RunsOfFit, way: Any, laws: Any, centre: Array) -> Any:
        seen[way.name] = Evidence(runs, centre)
        return plain(runs, way, laws, centre)

    first = {g: replace(size, value=FIRST[g]) for g, size in SIZES.items()}  # whatever ships: runs are straight lines where these put them
    with patch.object(_model, "_averaged", watched), patch.dict(SIZES, first):
        weights = td.inference.ErrorModel.of_fit(found).carriers
    return seen[max(weights, key=lambda name: weights[name])]


def likelihoods(found: TestSet) -> dict[str, list[float]]:
    """Return size -> ln of its likelihood over `GRID` times its first prior, the greatest zero."""
    evidence = evidence_of(found.fitted())
    concerned = evidence.concerned
    rng = np.random.default_rng(SEED)
    start = np.array([FIRST[g] for g in GROUPS])
    sizes = start * GRID[rng.integers(2, 8, (CHAINS, len(GROUPS)))]
    left = [(FIRST["left"] * float(GRID[4]), LEFT_TIMES[1])] * CHAINS
    total = {g: np.zeros(GRID.size) for g in (*concerned, "left")}
    for step in range(STEPS):
        chances = _step(evidence, sizes, left, concerned, rng)
        if step >= WARMING:
            for g, p in chances.items():
                total[g] += p.sum(axis=0)
    logs = {NAMED.get(g, g): np.log(np.maximum(p / p.max(), 1e-12)) for g, p in total.items()}
    return {g: [round(float(x), 3) for x in p] for g, p in logs.items()}


def _step(
    evidence: Evidence, sizes: Array, left: list[tuple[float, float]], concerned: Sequence[str], rng: np.random.Generator
) -> dict[str, Array]:
    """Draw every size once, given the others, in place; return size -> its probabilities (chains, grid) as they were drawn from."""
    out = {}
    for g in concerned:
        k, tried = GROUPS.index(g), np.repeat(sizes[:, None, :], GRID.size, axis=1)
        tried[:, :, k] = FIRST[g] * GRID
        logs = np.array([evidence(of, *left[chain]) for chain, of in enumerate(tried)])
        out[g] = _shares(logs)
        sizes[:, k] = FIRST[g] * GRID[_drawn(out[g], rng)]
    both = [(FIRST["left"] * float(x), t) for t in LEFT_TIMES for x in GRID]
    logs = np.column_stack([evidence(sizes, *each) for each in both])
    chances = _shares(logs)
    left[:] = [both[k] for k in _drawn(chances, rng)]
    out["left"] = chances.reshape(len(sizes), len(LEFT_TIMES), GRID.size).sum(axis=1)
    return out


def _shares(logs: Array) -> Array:
    shares = np.exp(logs - logs.max(axis=1, keepdims=True))
    return np.asarray(shares / shares.sum(axis=1, keepdims=True))


def _drawn(shares: Array, rng: np.random.Generator) -> Array:
    """Return a draw (chains,) from probabilities (chains, values)."""
    return np.asarray((shares.cumsum(axis=1) < rng.random((len(shares), 1))).sum(axis=1).clip(max=shares.shape[1] - 1))
