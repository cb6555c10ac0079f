"""`Source`: a named cause of uncertainty with its probability distribution; `read_spread`: what a written spread means."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np

from thermid.errors import ScenarioError, nearest
from thermid.expression import parse
from thermid.linear_algebra import Array
from thermid.model.laws.signal import literal
from thermid.units import TEMPERATURE

Kind = Literal["data", "instrument", "stated", "structural", "misfit", "variant"]
KNOWN: tuple[Kind, ...] = ("data", "instrument", "stated")
"""Kinds that a covariance of fitted values holds; structural ones enter budgets besides."""
LEAST = 1e-3
"""Probability within a deck's bounds below which a spread does not fit them. [-]"""
LARGEST_SHIFT = 100.0
"""Kelvin from which a temperature written in K is no shift but a slip: 293 K for 20 degC. [K]"""
FORMS: Mapping[str, frozenset[str]] = {
    "sd": frozenset({"sd", "mean"}),
    "log_sd": frozenset({"log_sd", "mean"}),
    "low": frozenset({"low", "high"}),
}
"""The key that names the form of a spread, and the keys of that form."""


class Distribution(Protocol):
    """Probability distribution of one number, by its quantiles."""

    @property
    def mean(self) -> float:
        """Its mean."""

    @property
    def variance(self) -> float:
        """Its variance."""

    def at(self, share: Array) -> Array:
        """Return the values below which shares (members,) of all lie."""


@dataclass(frozen=True)
class Normal:
    """Normal distribution; the standard one by default."""

    mean: float = 0.0
    sd: float = 1.0

    @property
    def variance(self) -> float:
        """Its variance."""
        return self.sd**2

    def at(self, share: Array) -> Array:
        """Return the quantiles (members,) of shares (members,)."""
        from scipy.special import ndtri

        return np.asarray(self.mean + self.sd * ndtri(share))

    def below(self, value: float) -> float:
        """Return the probability of less than a value. [-]"""
        from scipy.special import ndtr

        return float(ndtr((value - self.mean) / self.sd)) if self.sd > 0.0 else float(value > self.mean)

    def moments(self, low: float, high: float) -> tuple[float, float]:
        """Return mean and mean square between two ends, weighted by the law and not divided by its share there."""
        a, b = (low - self.mean) / self.sd, (high - self.mean) / self.sd
        share = self.below(high) - self.below(low)
        # integrals of z and z^2 with the normal density: -density and share - z density, between the ends
        first = _density(a) - _density(b)
        second = share + _times_density(a) - _times_density(b)
        return self.mean * share + self.sd * first, self.mean**2 * share + 2.0 * self.mean * self.sd * first + self.sd**2 * second


@dataclass(frozen=True)
class LogNormal:
    """Log-normal distribution."""

    median: float
    log_sd: float

    @property
    def mean(self) -> float:
        """Its mean."""
        return float(self.median * np.exp(0.5 * self.log_sd**2))

    @property
    def variance(self) -> float:
        """Its variance."""
        return float(self.mean**2 * np.expm1(self.log_sd**2))

    def at(self, share: Array) -> Array:
        """Return the quantiles (members,) of shares (members,)."""
        from scipy.special import ndtri

        return np.asarray(self.median * np.exp(self.log_sd * ndtri(share)))

    def below(self, value: float) -> float:
        """Return the probability of less than a value. [-]"""
        return 0.0 if value <= 0.0 else Normal(0.0, self.log_sd).below(float(np.log(value / self.median)))

    def moments(self, low: float, high: float) -> tuple[float, float]:
        """Return mean and mean square between two ends, weighted by the law and not divided by its share there."""
        ends = [-np.inf if x <= 0.0 else float(np.log(x / self.median)) for x in (low, high)]
        out = []
        for k in (1, 2):
            # exp(k z) times a normal density is that density about k log_sd^2, times exp(k^2 log_sd^2 / 2)
            below, above = (Normal(k * self.log_sd**2, self.log_sd).below(x) for x in ends)
            out.append(float(self.median**k * np.exp(0.5 * (k * self.log_sd) ** 2) * (above - below)))
        return out[0], out[1]


@dataclass(frozen=True)
class Uniform:
    """Uniform distribution between two ends."""

    low: float
    high: float

    @property
    def mean(self) -> float:
        """Its mean."""
        return 0.5 * (self.low + self.high)

    @property
    def variance(self) -> float:
        """Its variance."""
        return (self.high - self.low) ** 2 / 12.0

    def at(self, share: Array) -> Array:
        """Return the quantiles (members,) of shares (members,)."""
        return np.asarray(self.low + (self.high - self.low) * share)


@dataclass(frozen=True)
class Choice:
    """One of several things, all as likely, by its number."""

    count: int

    @property
    def mean(self) -> float:
        """Its mean."""
        return 0.5 * (self.count - 1)

    @property
    def variance(self) -> float:
        """Its variance."""
        return (self.count**2 - 1) / 12.0

    def at(self, share: Array) -> Array:
        """Return the numbers (members,) of shares (members,)."""
        return np.minimum(np.floor(share * self.count), self.count - 1.0)


@dataclass(frozen=True)
class Cut:
    """Truncated distribution: a law without what lies beyond two ends, the bounds of a deck."""

    law: Normal | LogNormal
    low: float
    high: float

    @property
    def share(self) -> float:
        """Probability between the ends. [-]"""
        below, above = self._ends
        return above - below

    @property
    def _ends(self) -> tuple[float, float]:
        return self.law.below(self.low), self.law.below(self.high)

    @property
    def mean(self) -> float:
        """Its mean."""
        return self.law.moments(self.low, self.high)[0] / self.share

    @property
    def variance(self) -> float:
        """Its variance."""
        first, second = (m / self.share for m in self.law.moments(self.low, self.high))
        return max(second - first**2, 0.0)

    def at(self, share: Array) -> Array:
        """Return the quantiles (members,) of shares (members,)."""
        below, above = self._ends
        return np.clip(self.law.at(below + share * (above - below)), self.low, self.high)


@dataclass(frozen=True)
class Shifted:
    """A law moved by a number: of a deviation in place of a value."""

    law: Distribution
    by: float

    @property
    def mean(self) -> float:
        """Its mean."""
        return self.law.mean + self.by

    @property
    def variance(self) -> float:
        """Its variance."""
        return self.law.variance

    def at(self, share: Array) -> Array:
        """Return the quantiles (members,) of shares (members,)."""
        return self.law.at(share) + self.by


def _density(z: float) -> float:
    return float(np.exp(-0.5 * z * z) / np.sqrt(2.0 * np.pi))


def _times_density(z: float) -> float:
    return z * _density(z) if np.isfinite(z) else 0.0


DISTRIBUTIONS = {kind.__name__: kind for kind in (Normal, LogNormal, Uniform, Choice, Cut, Shifted)}
"""Name of a distribution in a values file -> its class."""


def uniforms(seed: int, name: str, first: int, members: int) -> Array:
    """Return numbers (members,) between 0 and 1 of the members from `first` on, of the stream of a name. [-]

    The generator counts (Philox: Salmon et al., Parallel random numbers: as easy as 1, 2, 3, SC11, 2011), one stream per name, one count
    per member. A draw depends on the seed, the name and the member's index alone: not on how many members there are, what else is drawn, or
    which process draws it.
    """
    key = int.from_bytes(hashlib.sha256(f"{seed} {name}".encode()).digest()[:16], "big")
    raw = np.random.Philox(key=key, counter=first).random_raw(4 * members)[::4]
    out: Array = ((raw >> np.uint64(11)).astype(float) + 0.5) * 2.0**-53
    return out


def read_spread(given: Any, slot: str, nominal: float, where: str, *, bounds: tuple[float, float] = (-np.inf, np.inf)) -> Distribution:
    """Probability distribution that a written spread means.

    Parameters
    ----------
    given : str, dict       ``"0.5 [W]"`` or ``{"sd": "0.5 [W]"}``: normal, a standard deviation; ``"10 [%]"``: of the value;
                            ``{"log_sd": 0.2}``: the logarithm normal; ``{"low": ..., "high": ...}``: uniform between, nothing beyond;
                            ``"range"``: uniform between the bounds of the deck. ``mean`` may stand beside ``sd`` and ``log_sd`` (there: the
                            median). Of a temperature K means a shift of what deck or scenario have, degC and degF the temperature itself.
    slot : str              Unit of the value: a unit text, `temperature`, or K for a shift of a temperature that varies in time.
    nominal : float         What the value is otherwise; zero for a shift. [SI]
    where : str             What is spread, for messages.
    bounds : (float, float) Of the deck: they cut normal laws, and a uniform one must lie within them. [SI]

    Raises
    ------
    ScenarioError   When it is none of these forms, or passes the bounds.
    UnitError       When a number has another dimension than the value.
    """
    if given == "range":
        if not np.isfinite(bounds).all():
            raise ScenarioError("its deck gives no min and max to be its range. Give them, or a spread of its own.", where)
        return Uniform(*bounds)
    table: Mapping[str, Any] = {"sd": given} if isinstance(given, str) else given
    form = _form(table, where)
    if form == "low":
        return _uniform(table, slot, nominal, where, bounds)
    mean = _value(table["mean"], slot, nominal, where) if "mean" in table else nominal
    law: Normal | LogNormal
    if form == "log_sd":
        if slot in (TEMPERATURE, "K") or not mean > 0.0:
            raise ScenarioError("only a value above zero that is no temperature has a logarithm to spread. Give sd.", where)
        law = LogNormal(mean, _from_zero(literal(table["log_sd"], "1", where), where))
        size = law.log_sd
    else:
        law = Normal(mean, _from_zero(_deviation(table["sd"], slot, mean, where), where))
        size = law.sd
    return law if size == 0.0 or not np.isfinite(bounds).any() else _cut(law, bounds, where)


def _form(table: Any, where: str) -> str:
    """Return the key that names a spread's form."""
    form = next((f for f in FORMS if isinstance(table, Mapping) and f in table), "")
    if not form or not set(table) <= FORMS[form] or (form == "low" and "high" not in table):
        every = ("sd", "log_sd", "low", "high", "mean")
        odd = next((k for k in table if k not in every), "") if isinstance(table, Mapping) else ""
        raise ScenarioError(f'write {{sd}}, {{log_sd}}, {{low, high}} or "range".{nearest(odd, every)}', where)
    return form


def _uniform(table: Mapping[str, Any], slot: str, nominal: float, where: str, bounds: tuple[float, float]) -> Uniform:
    """Return the law between two written ends."""
    if slot == TEMPERATURE and _absolute(table["low"], where) != _absolute(table["high"], where):
        raise ScenarioError("one end is a temperature and the other a shift in kelvin. Write both in degC, or both in K.", where)
    low, high = (_value(table[k], slot, nominal, where) for k in ("low", "high"))
    if low > high:
        raise ScenarioError("its low end lies above its high end.", where)
    slack = 1e-9 * max(abs(low), abs(high), 1e-300)
    if low < bounds[0] - slack or high > bounds[1] + slack:
        raise ScenarioError(
            f"{table['low']} to {table['high']} passes the bounds of its deck, {bounds[0]:.6g} to {bounds[1]:.6g} in SI units. "
            'Give ends within them, or "range".',
            where,
        )
    return Uniform(max(low, bounds[0]), min(high, bounds[1]))


def _absolute(text: Any, where: str) -> bool:
    """Return whether a written number is a temperature and no difference of two."""
    number = parse(text).literal if isinstance(text, str) else None
    if number is None:
        raise ScenarioError(f"'{text}' must be a number with a unit.", where)
    return number.unit.absolute


def _value(text: Any, slot: str, nominal: float, where: str) -> float:
    """Return a written value; of temperatures kelvin is a shift of what they are otherwise. [SI]"""
    if slot not in (TEMPERATURE, "K"):
        return literal(text, slot, where)
    if _absolute(text, where):
        if slot == "K":
            raise ScenarioError(f"this varies in time or is a difference: give a shift in kelvin, such as 2 [K], not {text}.", where)
        return literal(text, TEMPERATURE, where)
    shift = literal(text, "K", where)
    if slot == TEMPERATURE and abs(shift) > LARGEST_SHIFT:
        raise ScenarioError(f"{text} would be a shift of more than {LARGEST_SHIFT:g} K. Write a temperature in degC.", where)
    return nominal + shift if slot == TEMPERATURE else shift


def _deviation(text: Any, slot: str, mean: float, where: str) -> float:
    """Return a standard deviation: a number in the unit of what it spreads, or a share of the mean. [SI]"""
    own = parse(text).literal if isinstance(text, str) else None
    if own is None or own.unit.text != "%":
        return literal(text, "K" if slot == TEMPERATURE else slot, where)
    if slot in (TEMPERATURE, "K"):
        raise ScenarioError("a temperature is not spread by per cent; give kelvin.", where)
    return own.value * abs(mean)


def _from_zero(sd: float, where: str) -> float:
    if not (sd >= 0.0 and np.isfinite(sd)):
        raise ScenarioError("a standard deviation is a number from zero up.", where)
    return sd


def _cut(law: Normal | LogNormal, bounds: tuple[float, float], where: str) -> Cut:
    out = Cut(law, *bounds)
    if not out.share > LEAST:
        raise ScenarioError("hardly any value lies within the bounds of its deck. Choose a mean inside them, or a smaller spread.", where)
    return out


@dataclass(frozen=True)
class Source:
    """A named cause of uncertainty.

    Parameters
    ----------
    name : str      Unique; that of a fit's noise holds the key of its stage, so that branches above one component share it.
    kind : str      data (noise of one fit), instrument (a constant error), stated, structural, misfit or variant.
    law : Distribution  Standard normal where values respond to it by their standard deviation.
    words : str     What it is, for people.
    """

    name: str
    kind: Kind
    law: Distribution
    words: str = ""


@dataclass(frozen=True)
class LeftOut:
    """Something uncertain that an answer does not count.

    Parameters
    ----------
    what : str      What is left out, for people.
    kelvin : float  The standard deviation that it might add, where that is known; NaN otherwise. [K]
    listed : bool   Whether it stands in the list alone: true of most answers, and so no news in a first line.
    """

    what: str
    kelvin: float = float("nan")
    listed: bool = False
