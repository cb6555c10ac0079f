"""What of unknowns that act together is known, and in which words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thermid.measure.amounts import short

Array = NDArray[np.float64]
SAME = 1e-3


@dataclass(frozen=True)
class Combination:
    """A combination of parameters that is known although its members are not.

    Parameters
    ----------
    text : str                  As a formula of the paths.
    value, error : float        Its value and standard error. [SI]
    unit : str                  SI unit, where it has a name; empty otherwise.
    meaning : str               What it sets: 'the temperature rise', 'the time constant', 'the rate of warming'; empty otherwise.
    """

    text: str
    value: float
    error: float
    unit: str
    meaning: str = ""

    @property
    def relative(self) -> float:
        """Standard error over value. [-]"""
        return self.error / abs(self.value) if self.value else np.inf

    def __str__(self) -> str:
        """Formula, value and error."""
        unit_text = f" {self.unit}" if self.unit else ""
        meaning = f", which sets {self.meaning}" if self.meaning else ""
        return f"{self.text} = {self.value:.4g}{unit_text} +- {percent(self.relative)}{meaning}"


@dataclass(frozen=True)
class Group:
    """Parameters that cannot be told apart, or hardly.

    Parameters
    ----------
    names : tuple of str                The parameters.
    structural : bool                   Whether no log of this kind can separate them; else it is this log that cannot.
    form : str                          'power law', 'sum', 'series' (sum of reciprocals) or 'mixture'.
    moves : tuple of dict               Name -> relative change; such a change of all together changes no reading (structural), or none by
                                        more than its noise allows, all readings taken together (else).
    known : tuple of Combination        What is known of them.
    """

    names: tuple[str, ...]
    structural: bool
    form: str
    moves: tuple[dict[str, float], ...]
    known: tuple[Combination, ...]

    @property
    def pair(self) -> str:
        """'product' or 'ratio' where two parameters act only so; empty otherwise."""
        if not (self.structural and self.form == "power law" and len(self.names) == 2):
            return ""
        first, second = (self.moves[0][n] for n in self.names)
        return "product" if abs(first + second) < SAME else "ratio" if abs(first - second) < SAME else ""

    @property
    def acting(self) -> str:
        """How they act, in words; empty where that has none."""
        if self.pair:
            return f"they act only as a {self.pair}"
        return {"sum": "they act only as a sum", "series": "they act only as a sum of reciprocals"}.get(self.form, "")

    def __str__(self) -> str:
        """What cannot be told, and what is known instead, in words."""
        who = listed(self.names)
        if self.structural and self.acting:
            told = f"{who} cannot be told apart; {self.acting}"
        elif self.structural and self.form == "mixture":
            moves = " or ".join(_percents({n: 0.1 * w for n, w in m.items()}) for m in self.moves)
            told = f"{who} cannot be told apart: near these values, {moves} together changes no reading"
        elif self.structural:
            told = f"{who} cannot be told apart: {' or '.join(together(m, len(self.names)) for m in self.moves)} changes no reading"
        else:
            told = f"{who} are hardly told apart: {' or '.join(_percents(m) for m in self.moves)} stays within the noise"
        return told + (f". Known: {'; '.join(map(str, self.known))}" if self.known else "")


def listed(names: Sequence[str]) -> str:
    """Return names as words.

    >>> listed(["a", "b", "c"])
    "'a', 'b' and 'c'"
    """
    quoted = [f"'{n}'" for n in names]
    return quoted[0] if len(quoted) == 1 else f"{', '.join(quoted[:-1])} and {quoted[-1]}"


def percent(relative: float) -> str:
    """Return a relative error as a reader takes it in.

    >>> percent(0.00561), percent(0.2), percent(float("inf")), percent(40.0)
    ('0.56 %', '20 %', 'unlimited', 'a factor of 40')
    """
    if not np.isfinite(relative) or relative > 1e4:
        return "unlimited"
    return f"a factor of {short(relative)}" if relative > 3.0 else f"{short(100.0 * relative)} %"


def together(move: dict[str, float], of: int) -> str:
    """Return a change of several parameters, of so many, that changes nothing."""
    if len({round(w, 3) for w in move.values()}) == 1:
        return f"multiplying {'all of them' if len(move) == of else listed(list(move))} by any one factor"
    return f"changing {', '.join(f'{n} by x^{w:.3g}' for n, w in move.items())} together, with any x,"


def _percents(move: dict[str, float]) -> str:
    return " with ".join(f"{n} {100 * w:+.2g} %" for n, w in move.items())
