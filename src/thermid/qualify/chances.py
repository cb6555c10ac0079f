"""What may differ from member to member of a campaign of runs, as functions of numbers between 0 and 1.

The numbers come from a generator that counts (Philox: Salmon et al., Parallel random numbers: as easy as 1, 2, 3, SC11, 2011), one stream
per name, one count per member. A draw therefore depends on the seed, the name and the member's index, and on nothing else: not on how many
members there are, what else is spread, or which process draws it.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.errors import ScenarioError, nearest
from thermid.expression import parse
from thermid.identify.spread import Spread
from thermid.model.signal import literal
from thermid.simulation.simulator import Simulator
from thermid.units import TEMPERATURE

__all__ = ["MISFIT", "Chance", "Inputs", "chance", "is_shift", "root_of", "uniforms"]

Array = NDArray[np.float64]
FORMS = {"sd": {"sd"}, "log_sd": {"log_sd"}, "low": {"low", "high"}}
MISFIT = "misfit"
"""Stream of what a fit could not follow."""
LEAST = 1e-3
"""Probability within a deck's bounds below which a spread does not fit them. [-]"""


def uniforms(seed: int, name: str, first: int, members: int) -> Array:
    """Return numbers (members,) between 0 and 1 of the members from `first` on, of the stream of a name. [-]"""
    key = int.from_bytes(hashlib.sha256(f"{seed} {name}".encode()).digest()[:16], "big")
    raw = np.random.Philox(key=key, counter=first).random_raw(4 * members)[::4]
    out: Array = ((raw >> np.uint64(11)).astype(float) + 0.5) * 2.0**-53
    return out


@dataclass(frozen=True)
class Chance:
    """How one value may lie: normal, log-normal or uniform, cut off at the bounds of its deck.

    Parameters
    ----------
    name : str              As in `ensemble`.
    form : str              normal, lognormal or uniform.
    centre, size : float    Mean (of a lognormal: median) and standard deviation (of a lognormal: of the logarithm). [SI]
    low, high : float       Ends of a uniform, or bounds. [SI]
    also : tuple of str     Other names that share the value.
    """

    name: str
    form: str
    centre: float
    size: float
    low: float = -np.inf
    high: float = np.inf
    also: tuple[str, ...] = ()

    def at(self, shares: Array) -> Array:
        """Return the values (members,) below which shares (members,) of all lie. [SI]"""
        if self.form == "uniform":
            return self.low + (self.high - self.low) * shares
        from scipy.special import ndtr, ndtri

        if self.size == 0.0:
            return np.full(shares.shape, self.centre)
        ends = np.array([self.low, self.high])
        if self.form == "lognormal":
            with np.errstate(divide="ignore"):
                ends = np.log(np.maximum(ends, 0.0) / self.centre)
            below, above = ndtr(ends / self.size)
            out: Array = self.centre * np.exp(self.size * ndtri(below + shares * (above - below)))
        else:
            below, above = ndtr((ends - self.centre) / self.size)
            out = self.centre + self.size * ndtri(below + shares * (above - below))
        if not above - below > LEAST:
            raise ScenarioError("hardly any value lies within the bounds of its deck. Choose a smaller spread, or other bounds.", self.name)
        return out


def chance(ready: Simulator, name: str, given: Any, also: Sequence[str] = ()) -> Chance:
    """Return the chance that a text or a table says.

    Parameters
    ----------
    ready : Simulator   Model and scenario with the name free; it knows values, units and bounds.
    name : str          Canonical.
    given : str, dict   ``"0.5 [W]"`` or ``"10 [%]"`` (standard deviation), ``{"sd": ...}``, ``{"log_sd": 0.2}``,
                        ``{"low": ..., "high": ...}`` (anything between is as likely), or ``"range"``: anything between the deck's
                        bounds. Of a boundary, and of ``initial.<node>``, all are shifts [K].
    also : sequence     Other names that share the value.

    Raises
    ------
    ScenarioError   When it is none of these forms.
    """
    where = f"{ready.title}, spread of '{name}'"
    at, difference = ready.slots(name)
    shifted = is_shift(ready, name)
    bounds = ready.bounds(name)
    if given == "range":
        if not np.isfinite(bounds).all():
            raise ScenarioError("its deck gives no min and max to be its range. Give them, or a spread of its own.", where)
        return Chance(name, "uniform", 0.0, 0.0, *bounds, tuple(also))
    table: Mapping[str, Any] = {"sd": given} if isinstance(given, str) else given
    form = next((f for f in FORMS if isinstance(table, Mapping) and f in table), "")
    if not form or set(table) != FORMS[form]:
        odd = next((k for k in table if k not in {"sd", "log_sd", "low", "high"}), "") if isinstance(table, Mapping) else ""
        raise ScenarioError(f'write {{sd}}, {{log_sd}}, {{low, high}} or "range".{nearest(odd, ("sd", "log_sd", "low", "high"))}', where)
    centre = 0.0 if shifted else ready.nominal[name]
    if form == "low":
        low, high = (literal(table[k], "K" if shifted else at, where) for k in ("low", "high"))
        if not low <= high:
            raise ScenarioError("its low end lies above its high end.", where)
        return Chance(name, "uniform", 0.0, 0.0, low, high, tuple(also))
    if form == "log_sd":
        if not centre > 0.0:
            raise ScenarioError("only a value above zero has a logarithm to spread.", where)
        return Chance(name, "lognormal", centre, _size(literal(table["log_sd"], "1", where), where), *bounds, tuple(also))
    own = parse(table["sd"]).literal if isinstance(table["sd"], str) else None
    if own is not None and own.unit.text == "%":
        if at == TEMPERATURE or difference == "K":
            raise ScenarioError("a temperature is not spread by per cent; give kelvin.", where)
        return Chance(name, "normal", centre, _size(own.value * abs(centre), where), *bounds, tuple(also))
    return Chance(name, "normal", centre, _size(literal(table["sd"], difference, where), where), *bounds, tuple(also))


def is_shift(ready: Simulator, name: str) -> bool:
    """Return whether a spread of a name is a shift of what the scenario gives: that of a boundary or of a temperature at the start."""
    return name.startswith("initial.") or name in ready.wiring.network.boundaries


def _size(sd: float, where: str) -> float:
    if not (sd >= 0.0 and np.isfinite(sd)):
        raise ScenarioError("a standard deviation is a number from zero up.", where)
    return sd


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
            out |= dict.fromkeys((c.name, *c.also), c.at(numbers[row]))
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
