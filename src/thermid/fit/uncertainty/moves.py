"""Values of stages below against the logs of the level above: what a test of them found, one by one and part by part."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from thermid.fit.uncertainty.shifts import ALPHA
from thermid.measure.amounts import digits, short
from thermid.units import counted, unit

MOVED, NOT_REJECTED, UNDECIDED = "moved", "not rejected", "this log cannot decide"
FINE = 0.1
"""A value is called not rejected only where a shift by this part of it would be found."""
STATED = 3.0
"""And only where it lies within so many of the errors that were stated of it."""
NONSENSE = 10.0
"""Shift, in parts of the value, above which what the logs alone say is not worth printing."""


@dataclass(frozen=True)
class Move:
    """One value of a stage below against what the logs of this level say alone.

    Parameters
    ----------
    path : str              Its path in the model of the level above.
    part : str              The part that it belongs to; empty for the model itself.
    stage : str             The stage that found it below.
    below, alone : float    As that stage found it, and by the logs of this level without its prior (of a joint fit: there). [SI]
    here : float            As this level uses it: fitted, or `below` where it is fixed. [SI]
    unit : str              For people.
    deviations : float      The shift over its standard error, of the fitted form; NaN where the logs say nothing of it. [-]
    chance : float          Of a shift of this size when nothing moved, corrected for the number of values tested. [-]
    detectable : float      Shift that the test finds with 90 % power; infinite where the logs say nothing of it. [SI]
    below_error : float     Standard error that it had there. [SI]
    below_random : float    The random part of it, which sets the digits that are printed. [SI]
    """

    path: str
    part: str
    stage: str
    below: float
    alone: float
    here: float
    unit: str
    deviations: float
    chance: float
    detectable: float
    below_error: float = math.nan
    below_random: float = math.nan

    @property
    def verdict(self) -> str:
        """Moved, not rejected, or this log cannot decide."""
        if self.chance < ALPHA and self.told:
            return MOVED
        near = abs(self.alone - self.below) <= STATED * self.below_error
        return NOT_REJECTED if near and self.detectable_share <= FINE else UNDECIDED

    @property
    def detectable_share(self) -> float:
        """The detectable shift in parts of the value as it stands in its unit; infinite where that is zero. [-]"""
        size = abs(self._in_unit(self.below)) * float(unit(self.unit).factor)
        return self.detectable / size if size > 0 else math.inf

    @property
    def printed(self) -> str:
        """The value below with the digits that its own stage prints."""
        return digits(self._in_unit(self.below), self.below_random / float(unit(self.unit).factor))

    @property
    def power(self) -> str:
        """Which shift would be found with 90 % power, in words."""
        share = self.detectable_share
        if share <= NONSENSE:
            return f"a shift of {short(100 * share, 2)} % would be found with 90 % power"
        if self.detectable_share == math.inf and math.isfinite(self.detectable):
            amount = self.detectable / float(unit(self.unit).factor)
            return f"a shift of {short(amount, 2)} {'K' if unit(self.unit).offset else self.unit} would be found with 90 % power"
        return "it says nothing of this value"

    def _in_unit(self, value: float) -> float:
        of = unit(self.unit)
        return (value - float(of.offset)) / float(of.factor)

    def __str__(self) -> str:
        """Return one line."""
        if not self.told:
            return f"{self.path}  {self.printed} {self.unit}: {self.verdict}; {self.power}"
        low, high = self._in_unit(self.below), self._in_unit(self.alone)
        change = 100 * (high / low - 1) if low else 0.0
        share = (f" ({change:+.0f} %)" if abs(change) >= 10 else f" ({change:+.2g} %)") if low else ""
        far = f"{abs(self.deviations):.1f} standard errors"
        return f"{self.path}  {self.printed} -> {high:.4g} {self.unit}{share}: {self.verdict}, {far}; {self.power}"

    @property
    def told(self) -> bool:
        """Whether the logs say anything of it that is worth a number."""
        return math.isfinite(self.deviations) and self.detectable_share <= NONSENSE


@dataclass(frozen=True)
class Group:
    """Several parameters together: a part, or all that was inherited.

    Parameters
    ----------
    name : str              What they are.
    paths : tuple of str    Their paths.
    chi_square : float      Squared distance, in standard errors, all correlations included. [-]
    directions : int        How many of their combinations this level says anything of.
    chance : float          Of such a distance when nothing moved, corrected for the number of parts. [-]
    fine : bool             Whether none of its values is rejected by a test that would find a shift of a tenth.
    """

    name: str
    paths: tuple[str, ...]
    chi_square: float
    directions: int
    chance: float
    fine: bool = False

    @property
    def verdict(self) -> str:
        """Moved, not rejected, or this log cannot decide."""
        return MOVED if self.chance < ALPHA else NOT_REJECTED if self.fine else UNDECIDED

    def __str__(self) -> str:
        """Return one line."""
        if not self.directions:
            return f"{self.name}: {self.verdict}"
        many = counted(self.directions, "direction")
        return f"{self.name}: {self.verdict}, chi-square {short(self.chi_square, 3)} in {many} (chance {short(self.chance)})"


@dataclass(frozen=True)
class Moves:
    """All that was inherited from stages below, tested against the logs of this level, value by value and part by part.

    Parameters
    ----------
    values : tuple of Move
    groups : tuple of Group
    by : str                    What the values are compared with, for people.
    """

    values: tuple[Move, ...] = ()
    groups: tuple[Group, ...] = ()
    by: str = "the logs of this stage alone"

    def __bool__(self) -> bool:
        """Whether anything was inherited."""
        return bool(self.values)

    def __getitem__(self, path: str) -> Move:
        """Return the move of a parameter."""
        return next(m for m in self.values if m.path == path)

    @property
    def moved(self) -> tuple[str, ...]:
        """Names of the parameters and groups that moved."""
        return tuple(m.path for m in self.values if m.verdict == MOVED) + tuple(g.name for g in self.groups if g.verdict == MOVED)

    def lines(self) -> Iterator[str]:
        """Yield it as text, a line each."""
        if self:
            yield f"  values of the stages below -> by {self.by}:"
            yield from (f"    {line}" for line in (*self.values, *self.groups))

    def warnings(self) -> list[str]:
        """Return a remark where values moved, or all of them together."""
        far = [f"{m.path} ({m.deviations:+.1f} standard errors)" for m in self.values if m.verdict == MOVED]
        far = far or [f"{_listed(g.paths)} together (chance {short(g.chance)})" for g in self.groups[-1:] if g.verdict == MOVED]
        if not far:
            return []
        return [
            f"moved from what the stage below found: {_listed(far)}. The parts do not behave in the assembly as they did alone, or the "
            "stage below missed something."
        ]


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names) if len(names) <= 4 else f"{names[0]} ... {names[-1]} ({len(names)} values)"
