"""Which of the things that are not known drives a result, from the members of an ensemble themselves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from thermid.base.linear_algebra import Array

MIN_MEMBERS_PER_INPUT = 30
"""Members per input below which shares are not distinguishable from chance. [-]"""

UNORDERED = ("scenario", "start_time", "scenario and start_time")
"""Inputs that are one of several things, none of which is more than another."""


@dataclass(frozen=True)
class Driver:
    """How much one input, or one fit, has to do with a result.

    Parameters
    ----------
    name : str          The input; ``scenario`` and ``start_time`` are which of them was drawn.
    share : float       Of the variance of the result's rank; those of all inputs add up to what a line through the ranks explains. [-]
    direction : float   Rank correlation: positive where more of it makes the result larger; zero for ``scenario``, which has no order. [-]
    """

    name: str
    share: float
    direction: float


def drivers_of(draws: Mapping[str, Array], result: Array) -> tuple[Driver, ...]:
    """Return the drivers of a result (members,), the largest first; empty where there are too few members or nothing varies.

    The share of an input is its standardised coefficient in a regression of ranks times its rank correlation with the result (Pratt 1987;
    Thomas, Hughes and Zumbo, Social Indicators Research 45, 1998): also for correlated inputs these add up to R squared.
    """
    # inputs that share a value count once
    named: dict[bytes, tuple[str, Array]] = {}
    for name, values in draws.items():
        named.setdefault(values.tobytes(), (name, values))
    inputs = [(n, v) for n, v in named.values() if np.ptp(v) > 0.0]
    if not inputs or np.ptp(result) == 0.0 or result.size < max(MIN_MEMBERS_PER_INPUT, 5 * len(inputs)):
        return ()
    target = _standard(_ranks(result))
    columns = np.empty((target.size, len(inputs)))
    for k, (name, values) in enumerate(inputs):
        if name in UNORDERED:  # what an input without order can say: the mean of the result over the members of its group
            _, group = np.unique(values, return_inverse=True)
            values = (np.bincount(group, target) / np.bincount(group))[group]
        columns[:, k] = _standard(values if name in UNORDERED else _ranks(values))
    weights, *_ = np.linalg.lstsq(columns, target, rcond=None)
    single = columns.T @ target / target.size
    drivers = [Driver(n, float(w * r), 0.0 if n in UNORDERED else float(r)) for (n, _), w, r in zip(inputs, weights, single, strict=True)]
    return tuple(sorted(drivers, key=lambda d: -d.share))


def _ranks(values: Array) -> Array:
    """Return the ranks from 1 (members,); equal values have the mean of theirs."""
    _, index, counts = np.unique(values, return_inverse=True, return_counts=True)
    ends = np.cumsum(counts)
    return np.asarray((ends - 0.5 * (counts - 1))[index], dtype=float)


def _standard(values: Array) -> Array:
    """Return values with mean 0 and standard deviation 1; zeros where all are equal."""
    spread = values.std()
    return np.asarray((values - values.mean()) / spread) if spread > 0 else np.zeros(values.shape)
