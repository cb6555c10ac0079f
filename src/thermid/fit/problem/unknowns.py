"""What a fit looks for: each unknown with its transform, bounds and prior."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from thermid.errors import DeckError
from thermid.linear_algebra import Array
from thermid.model.parts.parameter import Parameter
from thermid.units import Dimension, unit

POSITIVE = tuple(
    unit(u).dimension for u in ("W", "W/K", "W/(m^2 K)", "W/(m K)", "m", "m^2", "kg", "kg/s", "J/K", "J/(kg K)", "K/W", "m^2 K/W")
)
"""Quantities that cannot be negative: they are fitted by their logarithm."""


@dataclass(frozen=True)
class Prior:
    """A normal prior in the fitted form of an unknown (its logarithm where `log`)."""

    mean: float
    sd: float


@dataclass(frozen=True)
class Influence:
    """Where an unknown acts: the value of `name` in the wiring of an experiment is ``offset + factor * unknown``."""

    experiment: int
    name: str
    offset: float = 0.0
    factor: float = 1.0


@dataclass(frozen=True)
class Unknown:
    """One number that a fit looks for.

    Parameters
    ----------
    name : str              As reported: a parameter's path, ``record: room``, ``sensor T1``.
    kind : str              'parameter', 'local', 'sensor' or 'shared'.
    targets : tuple         Where it acts.
    start : float           [SI]
    log : bool              Whether it is fitted by its logarithm.
    low, high : float       Bounds. [SI]
    prior : Prior or None   In the fitted form.
    unit : str              For reports.
    also : tuple of str     Paths of other instances that share the value.
    """

    name: str
    kind: str
    targets: tuple[Influence, ...]
    start: float
    log: bool = False
    low: float = -math.inf
    high: float = math.inf
    prior: Prior | None = None
    unit: str = "1"
    also: tuple[str, ...] = ()

    def to_fitted(self, value: float) -> float:
        """Return the fitted form of a value.

        Raises
        ------
        DeckError   When its logarithm is fitted, and it is not above zero.
        """
        if self.log and not value > 0.0:
            raise DeckError(f"the value must be above zero, not {value:g}: its logarithm is fitted.", self.name)
        return math.log(value) if self.log else value

    def to_value(self, fitted: float) -> float:
        """Return the value of a fitted form. [SI]"""
        return math.exp(min(fitted, 700.0)) if self.log else fitted

    def slope(self, fitted: float) -> float:
        """Return d value / d fitted."""
        return self.to_value(fitted) if self.log else 1.0

    @property
    def scale(self) -> float:
        """A typical change of the fitted form, for the optimiser's steps."""
        if self.log:
            return 1.0
        if self.prior is not None:
            return self.prior.sd
        width = self.high - self.low
        return width / 4 if math.isfinite(width) else abs(self.start) or 0.1

    def fitted_bounds(self) -> tuple[float, float]:
        """Return the bounds in the fitted form."""
        if not self.log:
            return self.low, self.high
        low = math.log(self.low) if self.low > 0 else -math.inf
        return low, math.log(self.high) if math.isfinite(self.high) else math.inf


def starting_point(unknowns: Sequence[Unknown]) -> Array:
    """Return the starts (unknowns,) in the fitted form."""
    return np.array([u.to_fitted(u.start) for u in unknowns])


def parameter_unknown(
    path: str, given: Parameter, dimension: Dimension, value: float, targets: Sequence[Influence], prior: Prior | None
) -> Unknown:
    """Return the unknown that a freed parameter is.

    A value that cannot be negative is fitted by its logarithm, unless its minimum is zero, which a logarithm could not reach.

    Raises
    ------
    DeckError   When the start lies outside its bounds.
    """
    low = -math.inf if given.minimum is None else given.minimum
    high = math.inf if given.maximum is None else given.maximum
    if not low <= value <= high:
        raise DeckError(f"the start {value:g} of '{path}' lies outside its bounds {low:g} .. {high:g}.")
    positive = low > 0 or (dimension in POSITIVE and low != 0.0)
    text = given.unit or "1"
    return Unknown(path, "parameter", tuple(targets), value, positive and value > 0, low, high, prior, text)
