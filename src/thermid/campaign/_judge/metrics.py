"""Metrics of residuals, one row each: verdicts, correlations, plans and studies ask for them by key.

A new metric is a function of `Residuals` and a row of `METRICS`; nothing else names one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from thermid.base.errors import ScenarioError, nearest
from thermid.base.linear_algebra import Array

FINAL = 0.05
"""Share of a record, at its end, over which the final error is the mean, so that noise does not decide it. [-]"""


@dataclass(frozen=True, eq=False)
class Residuals:
    """Measured less predicted readings of one sensor, or of several that are pooled.

    Parameters
    ----------
    times : array (samples,)    [s]
    kelvin : array (samples,)   [K]
    weights : array (samples,)  Of each in a mean; their sum is one. [-]
    """

    times: Array
    kelvin: Array
    weights: Array

    @classmethod
    def equally_weighted(cls, times: Array, kelvin: Array) -> Residuals:
        """Residuals of equal weight."""
        return cls(times, kelvin, np.full(kelvin.size, 1.0 / kelvin.size))


def rmse(r: Residuals) -> float:
    """Root mean square."""
    return float(np.sqrt(r.weights @ r.kelvin**2))


def mean(r: Residuals) -> float:
    """Mean, with its sign."""
    return float(r.weights @ r.kelvin)


def largest(r: Residuals) -> float:
    """Largest residual by size, with its sign."""
    return float(r.kelvin[np.abs(r.kelvin).argmax()])


def spread(r: Residuals) -> float:
    """Standard deviation about the mean."""
    return float(np.sqrt(r.weights @ (r.kelvin - mean(r)) ** 2))


def p95(r: Residuals) -> float:
    """95th percentile of the sizes."""
    return float(np.quantile(np.abs(r.kelvin), 0.95))


def final(r: Residuals) -> float:
    """Mean over the last twentieth of the record, with its sign."""
    end = r.times >= r.times[-1] - FINAL * (r.times[-1] - r.times[0])
    return float(np.mean(r.kelvin[end]))


@dataclass(frozen=True)
class Metric:
    """One row: how a metric is computed and what it is called.

    Parameters
    ----------
    of : callable           Residuals -> size, with a sign where it has one. [K]
    title : str             What people call it.
    aliases : tuple of str  Further keys that files may write.
    pooled : bool           Whether a correlation takes it, by its own key, over all sensors of a case together; an alias is of each sensor.
    signed : bool           Whether it has a sign, which tables show; a limit is compared with the size.
    digits : int            In tables: decimals of a metric with a sign, else significant digits.
    """

    of: Callable[[Residuals], float]
    title: str
    aliases: tuple[str, ...] = ()
    pooled: bool = False
    signed: bool = False
    digits: int = 2

    @property
    def short(self) -> str:
        """Its title without the word error, for headings that name the unit."""
        return self.title.removesuffix(" error")


METRICS: Final[dict[str, Metric]] = {
    "rmse": Metric(rmse, "RMSE"),
    "mean": Metric(mean, "mean error", ("mean_error",), pooled=True, signed=True),
    "largest": Metric(largest, "largest error", ("max_error",), signed=True),
    "spread": Metric(spread, "spread", pooled=True),
    "p95": Metric(p95, "95th percentile"),
    "final": Metric(final, "final error", ("final_error",), signed=True, digits=3),
}
"""Key -> metric."""


def metric_keys() -> tuple[str, ...]:
    """Every key that a file may write, aliases too."""
    return tuple(key for name, metric in METRICS.items() for key in (name, *metric.aliases))


def metric(key: str, where: str = "", word: str = "metric") -> Metric:
    """The row of a key.

    Raises
    ------
    ScenarioError   With the nearest key.
    """
    for name, row in METRICS.items():
        if key == name or key in row.aliases:
            return row
    raise ScenarioError(f"unknown {word} '{key}'.{nearest(key, metric_keys())}", where, code="name.unknown")
