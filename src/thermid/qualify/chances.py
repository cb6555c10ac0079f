"""What may differ from member to member of a campaign of runs, as functions of numbers between 0 and 1; see `uniforms`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.identify.spread import Spread
from thermid.knowledge.sources import Law, Shifted, uniforms
from thermid.simulation.simulator import Simulator

__all__ = ["MISFIT", "Chance", "Inputs", "chance", "is_shift", "root_of"]

Array = NDArray[np.float64]
MISFIT = "misfit"
"""Stream of what a fit could not follow."""


@dataclass(frozen=True)
class Chance:
    """How one value may lie.

    Parameters
    ----------
    name : str              As in `ensemble`.
    law : Law               Of the value; of its shift where `is_shift`. [SI]
    also : tuple of str     Other names that share the value.
    """

    name: str
    law: Law
    also: tuple[str, ...] = ()


def chance(ready: Simulator, name: str, given: Any, also: Sequence[str] = ()) -> Chance:
    """Return the chance that a written spread means; `name` is canonical, and `also` are other names that share the value."""
    law = ready.law(name, given)
    return Chance(name, Shifted(law, -ready.nominal[name]) if is_shift(ready, name) else law, tuple(also))


def is_shift(ready: Simulator, name: str) -> bool:
    """Return whether a spread of a name is a shift of what the scenario gives: that of a boundary or of a temperature at the start."""
    return name.startswith("initial.") or name in ready.wiring.network.boundaries


def root_of(covariance: Array) -> Array:
    """Return the lower triangular root (names, names) of a covariance, directions without variance left out.

    Written out, since libraries round differently from machine to machine. Cholesky; Golub and Van Loan, Matrix Computations, 4.2.
    """
    rows: list[list[float]] = covariance.tolist()
    out = [[0.0] * len(rows) for _ in rows]
    for j in range(len(rows)):
        left = rows[j][j] - sum(x * x for x in out[j][:j])
        if left <= 1e-12 * rows[j][j]:
            continue
        out[j][j] = left**0.5
        for i in range(j + 1, len(rows)):
            out[i][j] = (rows[i][j] - sum(a * b for a, b in zip(out[i][:j], out[j][:j], strict=True))) / out[j][j]
    return np.array(out).reshape(covariance.shape)


@dataclass(frozen=True, eq=False)
class Inputs:
    """Everything that differs from member to member, and how.

    Parameters
    ----------
    chances : tuple of Chance       Values that are spread by themselves.
    spreads : tuple of Spread       Values that are spread together: what fits left open.
    centres : dict                  Name -> value about which a spread lies. [SI]
    variants : int                  Scenarios, one of which every member has, all as likely.
    chosen : str                    What tells the scenarios apart: ``scenario``, ``start_time`` or both.
    roots : tuple of array          Of each spread, a matrix L (names, names) with ``L L'`` its covariance.
    misfit : dict                   Kept node -> standard deviation of what a fit could not follow; one draw a member for all. [K]
    """

    chances: tuple[Chance, ...]
    spreads: tuple[Spread, ...]
    centres: Mapping[str, float]
    variants: int = 1
    chosen: str = "scenario"
    roots: tuple[Array, ...] = ()
    misfit: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Take the roots once, so that every process and machine has the same ones."""
        object.__setattr__(self, "roots", self.roots or tuple(root_of(s.covariance) for s in self.spreads))

    @property
    def streams(self) -> tuple[str, ...]:
        """Names of the streams of numbers that a member needs."""
        fitted = tuple(n for s in self.spreads for n in s.names)
        return (
            *(c.name for c in self.chances),
            *fitted,
            *((self.chosen,) if self.variants > 1 else ()),
            *((MISFIT,) if self.misfit else ()),
        )

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the values that differ, those that share one among them."""
        fitted = [x for s in self.spreads for n in s.names for x in (n, *s.also.get(n, ()))]
        return (*(x for c in self.chances for x in (c.name, *c.also)), *fitted)

    def numbers(self, seed: int, first: int, members: int) -> Array:
        """Return the numbers (streams, members) between 0 and 1 of some members. [-]"""
        return np.array([uniforms(seed, n, first, members) for n in self.streams]).reshape(len(self.streams), members)

    def values(self, numbers: Array) -> tuple[dict[str, Array], NDArray[np.int64]]:
        """Return name -> value (members,), shifts where `is_shift` [SI], and the scenario of every member (members,)."""
        from scipy.special import ndtri

        out: dict[str, Array] = {}
        row = 0
        for c in self.chances:
            out |= dict.fromkeys((c.name, *c.also), c.law.at(numbers[row]))
            row += 1
        for s, root in zip(self.spreads, self.roots, strict=True):
            normal = ndtri(numbers[row : row + len(s.names)])
            row += len(s.names)
            # sums written out: a matrix product may round differently from machine to machine
            for name, log, weights in zip(s.names, s.log, root, strict=True):
                deviation = np.zeros(numbers.shape[1])
                for weight, z in zip(weights.tolist(), normal, strict=True):
                    deviation = deviation + weight * z
                centre = self.centres[name]
                out |= dict.fromkeys((name, *s.also.get(name, ())), centre * np.exp(deviation) if log else centre + deviation)
        if self.misfit:
            out[MISFIT] = ndtri(numbers[-1])
        if self.variants > 1:
            return out, np.minimum((numbers[row] * self.variants).astype(np.int64), self.variants - 1)
        return out, np.zeros(numbers.shape[1], dtype=np.int64)
