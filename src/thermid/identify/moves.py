"""How far values from below had to move at the level above, one by one and part by part."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thermid.measure.amounts import short
from thermid.units import counted, unit

__all__ = ["Group", "Move", "Moves"]

Array = NDArray[np.float64]
SURE, LIKELY = 0.003, 0.05
"""Chance below which a value had to move, or may have: about 3 and 2 standard deviations."""


def _word(chance: float) -> str:
    if not math.isfinite(chance):
        return "not tested"
    return "had to move" if chance < SURE else "may have moved" if chance < LIKELY else "held"


@dataclass(frozen=True)
class Move:
    """One parameter against what the stage below found.

    Parameters
    ----------
    path : str              Its path in the model of the level above.
    part : str              The part that it belongs to; empty for the model itself.
    stage : str             Who found it below.
    below, here : float     Its value there and here. [SI]
    unit : str              For people.
    deviations : float      The shift over sqrt(variance below - variance here), of the fitted form; NaN where the level above says
                            nothing of it. [-]
    chance : float          Of a shift of this size when nothing but noise moves it. [-]
    below_error : float     Standard error that it had there. [SI]
    """

    path: str
    part: str
    stage: str
    below: float
    here: float
    unit: str
    deviations: float
    chance: float
    below_error: float = math.nan

    @property
    def verdict(self) -> str:
        """Had to move, may have moved, held, or not tested."""
        return _word(self.chance)

    def __str__(self) -> str:
        """Return one line."""
        of = unit(self.unit)
        low, high = ((v - float(of.offset)) / float(of.factor) for v in (self.below, self.here))
        share = f" ({100 * (high / low - 1):+.2g} %)" if low else ""
        how = f"{abs(self.deviations):.1f} standard deviations" if math.isfinite(self.deviations) else "this level says nothing of it"
        return f"{self.path}  {low:.4g} -> {high:.4g} {self.unit}{share}: {self.verdict}, {how}"


@dataclass(frozen=True)
class Group:
    """Several parameters together: a part, or all that was handed on.

    Parameters
    ----------
    name : str              What they are.
    paths : tuple of str    Their paths.
    chi_square : float      Squared distance, in standard deviations, all correlations taken along. [-]
    directions : int        How many of their combinations this level says anything of.
    chance : float          Of such a distance when nothing but noise moves them. [-]
    """

    name: str
    paths: tuple[str, ...]
    chi_square: float
    directions: int
    chance: float

    @property
    def verdict(self) -> str:
        """Had to move, may have moved, held, or not tested."""
        return _word(self.chance)

    def __str__(self) -> str:
        """Return one line."""
        if not self.directions:
            return f"{self.name}: not tested"
        many = counted(self.directions, "direction")
        return f"{self.name}: {self.verdict}, chi-square {short(self.chi_square, 3)} in {many} (chance {short(self.chance)})"


@dataclass(frozen=True)
class Moves:
    """All that stages below handed on, tested against the data of this level, parameter by parameter and part by part."""

    values: tuple[Move, ...] = ()
    groups: tuple[Group, ...] = ()

    def __bool__(self) -> bool:
        """Whether anything was handed on."""
        return bool(self.values)

    def __getitem__(self, path: str) -> Move:
        """Return the move of a parameter."""
        return next(m for m in self.values if m.path == path)

    @property
    def had_to_move(self) -> tuple[str, ...]:
        """Names of the parameters and groups that had to move."""
        return tuple(m.path for m in self.values if m.verdict == "had to move") + tuple(
            g.name for g in self.groups if g.verdict == "had to move"
        )

    def lines(self) -> Iterator[str]:
        """Yield it as text, a line each."""
        if self:
            yield "  against the stages below:"
            yield from (f"    {line}" for line in (*self.values, *self.groups))

    def warnings(self) -> list[str]:
        """Return a remark where a whole part, or all parts together, had to move."""
        return [
            f"what the stage below handed on for {_listed(g.paths)} had to move: chi-square {short(g.chi_square, 3)} in "
            f"{counted(g.directions, 'direction')}, chance {short(g.chance)}. The parts do not behave in the assembly as they did "
            "alone, or the stage below missed something."
            for g in self.groups[-1:]
            if g.verdict == "had to move"
        ]


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names) if len(names) <= 4 else f"{names[0]} ... {names[-1]} ({len(names)} parameters)"
