"""Scores of bands, one row for each sensor of each run, and what rows say together: shares, widths, scores, bootstraps, pairs.

Inside is counted per reading, averaged per run, then per set. The interval score is the width and 40 times what lies outside (Gneiting
and Raftery, J. Am. Stat. Assoc. 102 (2007) 359, eq. 43, at 95 %).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

Array = np.ndarray
LEVEL, REPEATS = 0.95, 1000
QUANTILES = np.concatenate([np.linspace(0.0, 0.9, 19), np.linspace(0.91, 1.0, 10)])
"""Shares at which the factors are kept that would hold so many of a run's readings."""
LEAST = 1e-9
"""Half-width that stands for zero. [K]"""


@dataclass(frozen=True)
class Row:
    """One sensor of one run under one rule.

    Parameters
    ----------
    rule, set, stratum : str
    unit : str              What a bootstrap draws: a bench, or a run.
    run, sensor : str
    inside : float          Share of its readings. [-]
    square : float          Mean square of readings less centre. [K^2]
    half, score : float     Mean half-width and interval score. [K]
    factors : tuple         Factors on the band that would hold `QUANTILES` of the readings. [-]
    refused : bool          Whether the question was declined; the figures are then those of the reachable range.
    beyond : bool           Whether the band leaves the reachable range.
    variance : float        Of what is judged over the run. [K^2]
    """

    rule: str
    set: str
    stratum: str
    unit: str
    run: str
    sensor: str
    inside: float
    square: float
    half: float
    score: float
    factors: tuple[float, ...]
    refused: bool = False
    beyond: bool = False
    variance: float = 0.0

    @property
    def key(self) -> tuple[str, str, str, str]:
        """What is paired with the same row of another rule or file."""
        return (self.set, self.unit, self.run, self.sensor)

    def to_dict(self) -> dict[str, Any]:
        """Return it as JSON holds it."""
        out = asdict(self)
        rounded = {k: round(v, 6) for k, v in out.items() if isinstance(v, float)}
        return out | rounded | {"factors": [round(f, 4) for f in self.factors]}

    @classmethod
    def from_dict(cls, raw: Mapping[str, Any]) -> Row:
        """Return it again."""
        return cls(**{**raw, "factors": tuple(raw["factors"])})


def interval_score(off: Array, half: Array, level: float = LEVEL) -> Array:
    """Return the interval score of each reading, `off` from the middle of a band of half-width `half`. [K]"""
    return np.asarray(2.0 * half + 2.0 / (1.0 - level) * np.maximum(np.abs(off) - half, 0.0))


def scored(off: Array, half: Array, aside: Array | float = 0.0, **names: Any) -> Row:
    """Return the row of a sensor: readings less centre (readings,), half-widths, and how far the middle lies above the centre. [K]

    Raises
    ------
    ValueError  When a band is not finite or negative.
    """
    half = np.broadcast_to(half, off.shape)
    if not (np.isfinite(off).all() and np.isfinite(half).all() and (half >= 0.0).all()):
        raise ValueError(f"a band of {names} is not finite or negative")
    apart = np.abs(off - aside)
    needed = apart / np.maximum(half, LEAST)
    return Row(
        inside=float(np.mean(apart <= half)),
        square=float(np.mean(off**2)),
        half=float(half.mean()),
        score=float(interval_score(apart, half).mean()),
        factors=tuple(np.quantile(needed, QUANTILES).tolist()),
        **names,
    )


def constant_of_hindsight(offs: Sequence[tuple[Array, Row]], rule: str) -> list[Row]:
    """Return the rows of the one half-width that holds 95 % of all readings of a sensor, each run weighing the same.

    Parameters
    ----------
    offs : sequence     Readings less centre of one set, stratum and sensor [K], and the row of each.
    rule : str          What the new rows are called.
    """
    every = np.concatenate([np.abs(off) for off, _ in offs])
    weights = np.concatenate([np.full(off.size, 1.0 / off.size) for off, _ in offs])
    order = np.argsort(every)
    held = np.cumsum(weights[order]) / weights.sum()
    half = float(every[order][np.searchsorted(held, LEVEL - 1e-12)])
    kept = ("set", "stratum", "unit", "run", "sensor", "refused", "variance")
    return [scored(off, np.full(off.shape, half), rule=rule, **{k: getattr(r, k) for k in kept}) for off, r in offs]


def factor(rows: Sequence[Row]) -> float:
    """Return the factor on every band that would hold 95 % of the readings, each run weighing the same. [-]"""
    low, high = 0.0, max(r.factors[-1] for r in rows)
    for _ in range(60):
        middle = 0.5 * (low + high)
        share = np.mean([np.interp(middle, r.factors, QUANTILES) if middle < r.factors[-1] else 1.0 for r in rows])
        low, high = (middle, high) if share < LEVEL else (low, middle)
    return high


FIGURES = ("inside", "square", "half", "score")


@dataclass(frozen=True, eq=False)
class Summary:
    """What the rows of one sensor of a set say together.

    Parameters
    ----------
    runs : int                  How many runs.
    inside, most, few : float   Mean share inside; shares of runs with at least 90 % and below 50 % of their readings inside. [-]
    rms : float                 Of the centre, pooled over runs. [K]
    half, score : float         Mean half-width, mean interval score. [K]
    factor : float              As of `factor`. [-]
    refused, beyond : float     Shares of runs. [-]
    inside_limits, score_limits : tuple     95 % limits by a bootstrap over units.
    """

    runs: int
    inside: float
    most: float
    few: float
    rms: float
    half: float
    score: float
    factor: float
    refused: float
    beyond: float
    inside_limits: tuple[float, float]
    score_limits: tuple[float, float]


def by_unit(rows: Iterable[Row], figure: str) -> tuple[Array, Array]:
    """Return sums and counts (units,) of a figure over the rows of each unit."""
    sums: dict[str, list[float]] = {}
    for r in rows:
        sums.setdefault(r.unit, []).append(float(getattr(r, figure)))
    return np.array([sum(v) for v in sums.values()]), np.array([float(len(v)) for v in sums.values()])


def limits(rows: Sequence[Row], figure: str, seed: int = 0) -> tuple[float, float]:
    """Return 95 % limits of the mean of a figure by a bootstrap over units; infinite for one unit."""
    sums, counts = by_unit(rows, figure)
    if sums.size < 2:
        return -np.inf, np.inf
    drawn = np.random.default_rng(seed).integers(0, sums.size, (REPEATS, sums.size))
    means = sums[drawn].sum(axis=1) / counts[drawn].sum(axis=1)
    low, high = np.quantile(means, [0.025, 0.975])
    return float(low), float(high)


def summary(rows: Sequence[Row]) -> Summary:
    """Return what rows say together; each run weighs the same."""
    shares = np.array([r.inside for r in rows])
    return Summary(
        len(rows),
        float(shares.mean()),
        float(np.mean(shares >= 0.9)),
        float(np.mean(shares < 0.5)),
        float(np.sqrt(np.mean([r.square for r in rows]))),
        float(np.mean([r.half for r in rows])),
        float(np.mean([r.score for r in rows])),
        factor(rows),
        float(np.mean([r.refused for r in rows])),
        float(np.mean([r.beyond for r in rows])),
        limits(rows, "inside"),
        limits(rows, "score"),
    )


@dataclass(frozen=True)
class Paired:
    """Mean differences of two rules over the same rows, later less earlier, with 95 % limits by a bootstrap over units.

    Parameters
    ----------
    rows : int
    change : dict       Figure -> (difference, low, high).
    """

    rows: int
    change: Mapping[str, tuple[float, float, float]]


def paired(before: Sequence[Row], after: Sequence[Row]) -> Paired | None:
    """Return the differences of rows with the same key; None where there are none."""
    known = {r.key: r for r in before}
    both = [(known[r.key], r) for r in after if r.key in known]
    if not both:
        return None
    change = {}
    for figure in FIGURES:
        moved = [replace(b, **{figure: getattr(b, figure) - getattr(a, figure)}) for a, b in both]
        change[figure] = (float(np.mean([getattr(m, figure) for m in moved])), *limits(moved, figure))
    return Paired(len(both), change)


def over_sets(rows: Sequence[Row], seed: int = 0) -> tuple[float, float, float]:
    """Return the mean over sets of the mean share inside, with 95 % limits by a bootstrap over sets and then over their units."""
    sets: dict[str, list[Row]] = {}
    for r in rows:
        sets.setdefault(r.set, []).append(r)
    sums = [by_unit(several, "inside") for several in sets.values()]
    rng, drawn = np.random.default_rng(seed), []
    for _ in range(REPEATS):
        means = []
        for k in rng.integers(0, len(sums), len(sums)):
            own = rng.integers(0, sums[k][0].size, sums[k][0].size)
            means.append(sums[k][0][own].sum() / sums[k][1][own].sum())
        drawn.append(np.mean(means))
    low, high = np.quantile(drawn, [0.025, 0.975])
    return float(np.mean([s.sum() / c.sum() for s, c in sums])), float(low), float(high)
