"""What a log can tell and what it cannot, in words, before and after a fit."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from thermid.identify.residuals import Problem
from thermid.identify.solve import at_least_square
from thermid.simulation.engine import Options

__all__ = ["Blind", "blind_spots"]

Array = NDArray[np.float64]
RANK_TOLERANCE = 1e-6
SHARE = 0.05
EXACT = Options(tolerance=1e-9, relative=1e-10, input_tolerance=1e-3)
"""Tight enough that a direction without information shows as such and not as the integrator's error.

How closely a noisy input is followed does not matter for that, and following it to 1e-7 K can take the integrator millions of steps.
"""


@dataclass(frozen=True, eq=False)
class Blind:
    """A combination of unknowns that the data do not see.

    Parameters
    ----------
    names : tuple of str        The unknowns in it.
    weights : array (names,)    The direction that changes nothing, in the fitted form; largest entry 1.
    kind : str                  'none' (one unknown without effect), 'product', 'ratio' or 'mixture'.
    """

    names: tuple[str, ...]
    weights: Array
    kind: str

    def combination(self) -> str:
        """Return what is known of them, as a formula."""
        return "*".join(self.names) if self.kind == "product" else "/".join(self.names)


def blind_spots(problem: Problem, fitted: Array) -> tuple[Blind, ...]:
    """Return the combinations of unknowns that neither the data nor the priors see, at some values.

    The weighted Jacobian with the rows of the priors, its columns scaled to one length, is split into singular values; a value below
    1e-6 of the largest is a direction without information (Belsley, Kuh and Welsch, Regression Diagnostics, Wiley 1980, chapter 3).
    """
    exact = replace(problem, options=EXACT)
    rows = np.concatenate([exact.compressed(fitted).slopes, problem.prior_rows(fitted)[1]])
    length = np.linalg.norm(rows, axis=0)
    out = []
    largest = float(length.max(initial=0.0))
    for k in np.flatnonzero(length <= 1e-12 * largest):
        out.append(Blind((problem.unknowns[k].name,), np.ones(1), "none"))
    seen = np.flatnonzero(length > 1e-12 * largest)
    if seen.size < 2:
        return tuple(out)
    _, s, v = np.linalg.svd(at_least_square(rows[:, seen] / length[seen]), full_matrices=False)
    null = v[s < RANK_TOLERANCE * s[0]]
    for direction in _simplest(null):
        weights = direction / length[seen]
        weights = weights / np.abs(weights).max() * np.sign(weights[np.abs(weights).argmax()])
        share = np.abs(direction) > SHARE * np.abs(direction).max()
        at, weights = seen[share], weights[share]
        names = tuple(problem.unknowns[k].name for k in at)
        out.append(Blind(names, weights, _kind(weights, [problem.unknowns[k].log for k in at])))
    return tuple(out)


def _simplest(null: Array) -> list[Array]:
    """Return directions that span a null space, each with as few unknowns as elimination finds."""
    left = null.copy()
    out: list[Array] = []
    while left.shape[0]:
        k = int(np.argmax(np.abs(left).max(axis=1)))
        pivot = int(np.argmax(np.abs(left[k])))
        row = left[k] / left[k, pivot]
        left = np.delete(left, k, axis=0)
        left = left - np.outer(left[:, pivot], row)
        out = [o - o[pivot] * row for o in out] + [row]
    return [np.where(np.abs(o) < 1e-6 * np.abs(o).max(), 0.0, o) for o in out]


def _kind(weights: Array, log: list[bool]) -> str:
    if weights.size == 2 and all(log):
        if abs(weights[0] + weights[1]) < 1e-3:
            return "product"
        if abs(weights[0] - weights[1]) < 1e-3:
            return "ratio"
    return "mixture"
