"""`Store`: everything known of the values of one model, at every depth: value, origin, and response to named sources of error.

A source is a named cause of uncertainty with its probability distribution.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any, Literal, Protocol

import numpy as np

from thermid.base.errors import DeckError, NameNotFoundError, nearest, quoted
from thermid.base.linear_algebra import symmetric_inverse
from thermid.base.results import Row, Shown
from thermid.base.units import Array, Expression, counted
from thermid.model.tree import (
    SET,
    UNJUDGED,
    Dropped,
    Entry,
    Flat,
    Identity,
    Model,
    Parameter,
    Standing,
    Tree,
    inside,
    local_identities,
    outside,
)

Kind = Literal["data", "instrument", "stated", "structural", "misfit", "variant"]
MAX_NAMED_VALUES = 8
"""Up to so many values that a remark is about are named one by one, more of them by their parts."""
EXPECTED, AS_FITTED = ": expected if elements depart", ": as fitted"
"""Parts of the names of sources of fitted values alone: how far they are expected from where their fit found them, which is no chance, and
what the fit leaves open beyond the model of error. They count in errors; a fit above has the values as priors where they are expected."""
SURROUNDINGS = 0.15
"""Relative standard deviation of a coefficient from one place to another: the size of a departure of surfaces that public test sets taught
(`thermid.fit._error_model.sizes`)."""
INPUT = "input"
"""Kind of a value: the constant error of a logged boundary [K], or of a logged power as a share of the reading; reading minus truth."""


class Distribution(Protocol):
    """Probability distribution of one number, by its quantiles."""

    @property
    def mean(self) -> float:
        """Its mean."""

    @property
    def variance(self) -> float:
        """Its variance."""

    def at(self, share: Array) -> Array:
        """Return the quantiles (members,): the values below which shares (members,) of all lie."""


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
        """Return the integrals of x p(x) and x^2 p(x) from low to high, with the density p: not divided by the share that lies there."""
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
        return np.asarray(self.median * np.exp(Normal(0.0, self.log_sd).at(share)))

    def below(self, value: float) -> float:
        """Return the probability of less than a value. [-]"""
        return 0.0 if value <= 0.0 else Normal(0.0, self.log_sd).below(float(np.log(value / self.median)))

    def moments(self, low: float, high: float) -> tuple[float, float]:
        """Return the integrals of x p(x) and x^2 p(x) from low to high, with the density p: not divided by the share that lies there."""
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
    """Discrete uniform distribution of the numbers 0 to count - 1."""

    count: int

    @property
    def mean(self) -> float:
        """Its mean."""
        return 0.5 * (self.count - 1)

    @property
    def variance(self) -> float:
        """Its variance, of whole numbers from 0 to n - 1 that are equally probable: (n^2 - 1) / 12. [-]"""
        return (self.count**2 - 1) / 12.0

    def at(self, share: Array) -> Array:
        """Return the numbers (members,) of shares (members,)."""
        return np.minimum(np.floor(share * self.count), self.count - 1.0)


@dataclass(frozen=True)
class Cut:
    """Truncated distribution: a law between two ends, the bounds of a deck, divided by its probability there."""

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
        """Probabilities of the untruncated law below both ends. [-]"""
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
    """Distribution of x + by, where x has the distribution `law`."""

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


MIDPOINTS = (np.arange(2000) + 0.5) / 2000
"""Shares over which moments of a logarithm are taken."""


@dataclass(frozen=True)
class Logarithm:
    """Distribution of ln(x / over), where x > 0 has the distribution `law`; its moments are taken over 2000 quantiles."""

    law: Distribution
    over: float

    @property
    def mean(self) -> float:
        """Its mean."""
        return float(self.at(MIDPOINTS).mean())

    @property
    def variance(self) -> float:
        """Its variance."""
        return float(self.at(MIDPOINTS).var())

    def at(self, share: Array) -> Array:
        """Return the quantiles (members,) of shares (members,)."""
        return np.asarray(np.log(self.law.at(share) / self.over))


def _density(z: float) -> float:
    """Return the standard normal density exp(-z^2 / 2) / sqrt(2 pi)."""
    return float(np.exp(-0.5 * z * z) / np.sqrt(2.0 * np.pi))


def _times_density(z: float) -> float:
    """Return z times the standard normal density; zero at infinite z."""
    return z * _density(z) if np.isfinite(z) else 0.0


DISTRIBUTIONS = {kind.__name__: kind for kind in (Normal, LogNormal, Uniform, Choice, Cut, Shifted, Logarithm)}
"""Name of a distribution in a values file -> its class."""


def uniforms(seed: int, name: str, first: int, members: int) -> Array:
    """Return uniform random numbers (k + 1/2) 2^-53 (members,) of the members `first`, `first` + 1, ... for a seed and a name. [-]

    k are 53 bits of a generator that counts (Philox: Salmon et al., Parallel random numbers: as easy as 1, 2, 3, SC11, 2011), one stream
    per name, one count per member. A draw depends on the seed, the name and the member's index alone: not on how many members there are,
    what else is drawn, or which process draws it.
    """
    key = int.from_bytes(hashlib.sha256(f"{seed} {name}".encode()).digest()[:16], "big")
    raw = np.random.Philox(key=key, counter=first).random_raw(4 * members)[::4]
    out: Array = ((raw >> np.uint64(11)).astype(float) + 0.5) * 2.0**-53
    return out


def deviated(value: Array | float, deviation: Array, ends: tuple[float, float]) -> Array:
    """Return value plus deviation (members,), bent so that it never passes the `ends` (low, high) that physics allows.

    Towards an end at a distance d a deviation x counts as ``d tanh(x / d)``: a logistic curve, as of a logit, and x itself where it is
    small or the end is at infinity. [SI]
    """
    distance = np.maximum(np.where(deviation > 0.0, ends[1] - value, value - ends[0]), 0.0)
    near = np.isfinite(distance) & (distance > 0.0)
    part = np.divide(deviation, distance, out=np.zeros_like(distance), where=near)
    return np.asarray(value + np.where(np.isfinite(distance), np.where(near, distance, 0.0) * np.tanh(part), deviation))


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


@dataclass(frozen=True)
class ValueOrigin:
    """Who gave a value.

    Parameters
    ----------
    kind : str          deck, hand (tuned by hand), fit, split, or twin (taken from another instance).
    stage : str         The stage.
    records : tuple     The records that it was fitted to.
    key : str           Hash of everything that the result of the stage depends on.
    date : str          When.
    """

    kind: Literal["deck", "hand", "fit", "split", "twin"]
    stage: str = ""
    records: tuple[str, ...] = ()
    key: str = ""
    date: str = ""

    def __str__(self) -> str:
        """The stage in words, or the kind where it has none."""
        return f"stage '{self.stage}'" if self.stage else self.kind


@dataclass(frozen=True)
class State:
    """The current state of one value.

    Parameters
    ----------
    path : str              The first place where the value stands in the store's model; of an instrument its name.
    value : float           [SI]
    log : bool              Whether its error is that of its logarithm.
    unit : str              For people.
    bounds : (float, float) [SI]
    origin : ValueOrigin         Who gave it.
    kind : str              parameter, or as in `FittedValue`: sensor, instrument, input (all three of instruments), level.
    paths : tuple of str    Every place where it stands.
    hidden : tuple of str   Those where a [set] hides it.
    at : str                The submodel over whose deck it is laid; empty for the model itself.
    deck : str              Text of the deck's value that it stands for; empty where unknown.
    history : tuple         Who gave the values that this one replaced, the first one first.
    standing : Standing     How far it may be trusted.
    start : float           Where its fit started. [SI]
    random : float          Scatter that the noise of the readings alone would give in a repeat. [SI]
    prior : (float, float)  Mean and standard deviation, fitted form, of what was stated of it before any data; None for nothing.
    known : bool            Whether its error is known; otherwise it is unlimited, and its row is zero.
    of_logs : bool          Whether it is of the logs of its stage and not of its deck: the power of a course that no log gives.
    """

    path: str
    value: float
    log: bool
    unit: str
    bounds: tuple[float, float]
    origin: ValueOrigin
    kind: str = "parameter"
    paths: tuple[str, ...] = ()
    hidden: tuple[str, ...] = ()
    at: str = ""
    deck: str = ""
    history: tuple[ValueOrigin, ...] = ()
    standing: Standing = UNJUDGED
    start: float = 0.0
    random: float = 0.0
    prior: tuple[float, float] | None = None
    known: bool = True
    of_logs: bool = False

    @property
    def acts(self) -> tuple[str, ...]:
        """The paths where it acts: its places without those where a [set] hides it."""
        return tuple(p for p in self.paths if p not in self.hidden)

    @property
    def fitted(self) -> float:
        """The fitted form of the value: its logarithm where `log`."""
        return float(np.log(self.value)) if self.log else self.value

    def as_parameter(self) -> Parameter:
        """Return the value as a parameter that can be laid over a model; its float is kept exactly."""
        return Parameter.exact(self.value, self.unit, str(self.origin))

    def under(self, part: str) -> State:
        """Return the state with all paths prefixed by ``part.``: as a model has it that uses this one as `part`; instruments stay as is."""
        if self.kind != "parameter":
            return self
        ahead = f"{part}."
        paths, hidden = (tuple(ahead + p for p in several) for several in (self.paths, self.hidden))
        return replace(self, path=ahead + self.path, at=ahead + self.at if self.at else part, paths=paths, hidden=hidden)

    def is_same(self, other: State) -> bool:
        """Whether both are one state: given by the same stage, with the same value."""
        return (self.origin, self.value, self.kind) == (other.origin, other.value, other.kind)

    def replaces(self, other: State) -> bool:
        """Whether its history names the origin of the other state: it was fitted with that one known."""
        return other.origin in self.history


@dataclass(frozen=True, eq=False)
class Store(Shown):
    """Everything known of the values of one model.

    The error of a value is a row of `root`: its response to named sources, each of unit variance. So the covariance of any values is that
    of their rows, also between values of different stages, and a source that two values share counts once.

    Parameters
    ----------
    states : dict               Path or name of an instrument -> State.
    sources : tuple of Source   The columns of `root`.
    root : array (states, sources)   Responses in the fitted form (of the logarithm where `log`).
    seen : dict                 Checksum -> who used the record.
    provenance : dict           Stage -> version, date, records, conditions and misfit of its fit.
    cuts : tuple of str         Instances and values that share with no other.
    dropped : tuple             States that no longer apply.
    left_out : tuple            What is uncertain and not in `root`.
    """

    states: Mapping[str, State] = field(default_factory=dict)
    sources: tuple[Source, ...] = ()
    root: Array = field(default_factory=lambda: np.zeros((0, 0)))
    seen: Mapping[str, str] = field(default_factory=dict)
    provenance: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    cuts: tuple[str, ...] = ()
    dropped: tuple[Dropped, ...] = ()
    left_out: tuple[LeftOut, ...] = ()

    def __eq__(self, other: object) -> bool:
        """Whether another store knows the same, to the last bit."""
        if not isinstance(other, Store):
            return NotImplemented
        plain = (f.name for f in fields(self) if f.name not in ("root", "left_out"))
        same = repr(self.left_out) == repr(other.left_out)  # it may hold numbers that are none
        return same and np.array_equal(self.root, other.root) and all(getattr(self, n) == getattr(other, n) for n in plain)

    __hash__ = None  # type: ignore[assignment]

    def _summary(self) -> str:
        """Return how many values the store holds."""
        return f"{counted(len(self.states), 'value')} of fits and files"

    def _as_rows(self) -> list[Row]:
        """Return a row of path, value and unit for every state."""
        return [{"path": p, "value": s.value, "unit": s.unit} for p, s in self.states.items()]

    def __getitem__(self, path: str) -> State:
        """Return the state of a value.

        Raises
        ------
        NameNotFoundError   With the nearest path.
        """
        state = self.states.get(path) or next((s for s in self.states.values() if path in s.paths), None)
        if state is None:
            raise NameNotFoundError(f"no fit or file gives '{path}'.{nearest(path, self.states)}")
        return state

    @property
    def parameters(self) -> dict[str, State]:
        """Path -> state, of those that are parameters of the model."""
        return {p: s for p, s in self.states.items() if s.kind == "parameter"}

    def rows(self, paths: Iterable[str]) -> Array:
        """Return the rows of `root` (paths, sources) of some values."""
        order = {p: k for k, p in enumerate(self.states)}
        return self.root[[order[self[p].path] for p in paths]]

    def covariance(self, paths: Iterable[str]) -> Array:
        """Return the covariance R R' (paths, paths) of some values in the fitted form, with R their rows."""
        rows = self.rows(paths)
        return np.asarray(rows @ rows.T)

    def error(self, path: str) -> float:
        """Return the standard error of a value: the length of its row, times the value where it is fitted by its logarithm. [SI]

        Infinite where the error is not known.
        """
        state = self[path]
        if not state.known:
            return float("inf")
        return float(np.linalg.norm(self.rows([path]))) * (state.value if state.log else 1.0)

    def only(self, keep: Callable[[State], bool]) -> Store:
        """Return the store with the states for which `keep` holds alone; the others are marginalised (their rows are left out)."""
        states = {name: s for name, s in self.states.items() if keep(s)}
        gone = {n for s in self.states.values() if s.path not in states for n in (s.path, *s.paths)}
        provenances = {
            stage: _provenance_renamed(provenance, lambda n: None if n in gone else n) if gone else provenance
            for stage, provenance in self.provenance.items()
        }
        return replace(self, states=states, root=self.root[[name in states for name in self.states]], provenance=provenances).trimmed()

    def in_decks(self, model: Model) -> tuple[Store, tuple[str, ...]]:
        """Return the store without values that belong to logs and have no parameter in the model, and a remark for each of these."""
        if not any(s.of_logs for s in self.states.values()):
            return self, ()
        table = model.parameter_table()
        gone = {p: s for p, s in self.parameters.items() if s.of_logs and p not in table}
        words = "is a power in the logs of {} and not of its deck, so it does not act here."
        return self.only(lambda s: s.path not in gone), tuple(f"'{p}' {words.format(s.origin)}" for p, s in gone.items())

    def drop(self, *places: str) -> Store:
        """Return the store without the values at some paths or inside some parts; twins keep what they shared, instruments stay."""
        remaining = self.only(lambda s: s.kind != "parameter" or bool(outside(s.paths, places)))
        states = {}
        for p, s in remaining.states.items():
            paths = outside(s.paths, places)
            states[p] = s if paths == s.paths else replace(s, path=paths[0], paths=paths, hidden=outside(s.hidden, places))
        names = {p: s.path for p, s in states.items() if p != s.path}
        provenance = {s: _provenance_renamed(of_stage, lambda n: names.get(n, n)) for s, of_stage in remaining.provenance.items()}
        return replace(remaining, states={s.path: s for s in states.values()}, provenance=provenance)

    def parted(self, apart: Collection[str]) -> Store:
        """Return the store with each state that acts both inside and outside of the paths `apart` divided into one for each side.

        Both halves keep the value and the row, so they stay fully correlated.
        """
        states, rows = {}, []
        for s, row in zip(self.states.values(), self.root, strict=True):
            halves = [tuple(p for p in s.paths if (p in apart) is side) for side in (True, False)]
            both = len({p in apart for p in s.acts}) == len(halves)
            for one in [replace(s, path=h[0], paths=h) for h in halves] if both else [s]:
                states[one.path] = one
                rows.append(row)
        return replace(self, states=states, root=np.array(rows).reshape(len(rows), len(self.sources)))

    def at(self, part: str) -> Store:
        """Return the store of the states inside a part, with paths relative to that part; instruments stay."""
        inner = self.only(lambda s: s.kind != "parameter" or any(inside(p, part) for p in s.paths))
        cut = len(part) + 1

        def moved(s: State) -> State:
            """Return a state under the paths that it has within the part."""
            paths = tuple(p[cut:] for p in s.paths if inside(p, part))
            hidden = tuple(p[cut:] for p in s.hidden if inside(p, part))
            at = s.at[cut:] if inside(s.at, part) else ""
            return replace(s, path=paths[0], paths=paths, hidden=hidden, at=at) if s.kind == "parameter" else s

        states = [moved(s) for s in inner.states.values()]
        return replace(inner, states={s.path: s for s in states})

    def laid_over(self, model: Model) -> Model:
        """Return the model with the value of every state laid over the deck of the submodel that its stage was about; a [set] above wins.

        At a twin outside of that submodel it is laid over the deck that writes the value there.

        Raises
        ------
        NameNotFoundError   When the model has no such value.
        """
        layers: dict[tuple[str, str], dict[str, State]] = {}
        places = _twins_places(model, self.parameters.values())
        for s in self.parameters.values():
            for path in s.paths:
                layers.setdefault((places.get(path, s.at), str(s.origin)), {})[path] = s
        for (at, origin), values in sorted(layers.items(), key=lambda item: -depth(item[0][0])):
            ahead = len(at) + 1 if at else 0
            inner = {p[ahead:]: s for p, s in values.items()}
            part = model.submodel(at) if at else model
            table = part.parameter_table()
            missing = next((p for p in inner if part.canonical(p) not in table), None)
            if missing is not None:
                raise NameNotFoundError(f"{origin} gives '{missing}', which '{part.title}' does not have.{nearest(missing, table)}")
            model = model.with_values(inner, origin, at=at)
        return model

    def matching(self, model: Model) -> Store:
        """Return the store without states whose deck value has changed since they were fitted; `dropped` lists these with the reason."""
        tables: dict[str, Mapping[str, Entry]] = {}
        gone: dict[str, Dropped] = {}
        for name, s in self.parameters.items():
            table = tables.setdefault(s.at, (model.submodel(s.at) if s.at else model).parameter_table())
            ahead = len(s.at) + 1 if s.at else 0
            now = table[path].deck_text if s.deck and (path := s.path[ahead:]) in table else s.deck
            if not any(_alike(text, now) for text in (s.deck, s.as_parameter().text)):  # a saved fit has the fitted value itself
                gone[name] = Dropped(
                    name, s.as_parameter().text, str(s.origin), f"the deck has {now}, but had {s.deck} when this value was fitted"
                )
        return replace(self.only(lambda s: s.path not in gone), dropped=(*self.dropped, *gone.values())) if gone else self

    def acting_in(self, model: Model) -> tuple[Store, tuple[str, ...]]:
        """Return the store with the paths marked as hidden where a [set] overrides a state, and a remark for each.

        `model` is the model with the states already laid over it.
        """
        table = model.parameter_table()
        states, remarks = dict(self.states), []
        for name, s in self.parameters.items():
            hidden = tuple(p for p in s.paths if table[p].origin != str(s.origin))
            remarks += [
                f"'{p}' is {table[p].parameter.text} by {table[p].origin}, which overrides the result of {s.origin}." for p in hidden
            ]
            states[name] = replace(s, hidden=hidden)
        return replace(self, states=states), tuple(remarks)

    def judged(self, now: Mapping[str, Standing]) -> Store:
        """Return the store with new standings of its values, by the text of their origin: ``stage 'name'`` -> `Standing`."""
        return replace(self, states={p: replace(s, standing=now.get(str(s.origin), s.standing)) for p, s in self.states.items()})

    def trimmed(self) -> Store:
        """Return the store without sources to which no value responds: without columns of zeros in `root`."""
        used = [bool(column.any()) for column in self.root.T]
        return replace(self, sources=tuple(s for s, u in zip(self.sources, used, strict=True) if u), root=self.root[:, used])


def _alike(one: str, other: str) -> bool:
    """Return whether two written values are the same text, or equal numbers of one dimension to 1e-12."""
    if one == other:
        return True
    a, b = Expression.parse(one).literal, Expression.parse(other).literal
    return a is not None and b is not None and a.unit.dimension == b.unit.dimension and math.isclose(a.value, b.value, rel_tol=1e-12)


def graft(model: Model, below: Sequence[tuple[str, Store]], untied: Sequence[str] = ()) -> tuple[Store, tuple[str, ...]]:
    """Return the stores of parts merged into one store of the whole model, and remarks where two states of one value compete.

    Parameters
    ----------
    model : Model       The whole.
    below : sequence    Part (``.`` for the model itself) and store, in any order.
    untied : sequence   Instances or values that the whole will be cut from their twins at; see `Model.cut`.

    Of two states of one value the one nearer the root of the assembly holds, or the one that was found with the other known. What several
    stages say of one instrument is combined by generalised least squares. A state acts at every twin of its place, whatever their heights;
    a remark names those where it does not. Where twins have one result in several states, the others take that of a twin with which they
    stay one value.

    Raises
    ------
    DeckError           When two stages give one value at the same depth, and neither knew of the other.
    NameNotFoundError   When a part does not have a value that is given for it.
    """
    placed = [
        ("" if part == "." else model.canonical(part), *store.in_decks(model.submodel(part) if part != "." else model))
        for part, store in below
    ]
    for part, store, _ in placed:
        _refuse_misplaced(model, part, store)
    parts = [(part, _among_nodes(model, part, store) if part else store) for part, store, _ in placed]
    sources = tuple({s.name: s for _, store in parts for s in store.sources}.values())
    place = {s.name: k for k, s in enumerate(sources)}
    offered: dict[str, list[tuple[str, State, Array]]] = {}
    for part, store in sorted(parts, key=lambda item: (depth(item[0]), item[0])):
        columns = [place[s.name] for s in store.sources]
        for state, row_of_state in zip(store.states.values(), store.root, strict=True):
            row = np.zeros(len(sources))
            row[columns] = row_of_state
            moved = state.under(part) if part else state
            offered.setdefault(moved.path, []).append((part, moved, row))
    chosen, remarks = {}, list(dict.fromkeys(set_aside for _, _, several in placed for set_aside in several))
    for path, several in offered.items():
        state, row, remark = _chosen(path, several)
        chosen[path] = (state, row)
        remarks += remark
    whole = Store(
        {p: s for p, (s, _) in chosen.items()},
        sources,
        np.array([row for _, row in chosen.values()]).reshape(len(chosen), len(sources)),
        {sha: who for _, store in parts for sha, who in store.seen.items()},
        {stage: _provenance(provenance, part) for part, store in parts for stage, provenance in store.provenance.items()},
        tuple(dict.fromkeys(_under(c, part) for part, store in parts for c in store.cuts)),
        tuple(dict.fromkeys(replace(d, path=_under(d.path, part)) for part, store in parts for d in store.dropped)),
        tuple(dict.fromkeys(x for _, store in parts for x in store.left_out)),
    )
    whole, apart = _at_twins(model, whole, untied)
    return whole.trimmed(), (*remarks, *apart)


def _among_nodes(model: Model, part: str, store: Store) -> Store:
    """Return the store of a part in which coefficients that meet a node outside of it have a source more: alone, they met a boundary.

    Gas in a housing carries less than that of a room, by how much no reading of the part alone says. Values that are one have one source.
    """
    flat = Flat.of_model(model)
    around = {n.path for n in flat.nodes if not inside(n.path, part)}
    fields = [c.fields for c in flat.conductors if c.gas in around and inside(c.path, part)]
    met = {path for f in fields for name, path in f.items() if name.endswith(("htc", "coefficient"))}
    names, sizes = [], []
    for s in store.states.values():
        names.append(f"{s.origin.key[:16]}:{s.path.removeprefix(f'{s.at}.')} among nodes")
        sizes.append(SURROUNDINGS * (1.0 if s.log else s.value) if s.known and met.intersection(s.under(part).paths) else 0.0)
    added = [*dict.fromkeys(names)]
    rows = np.array(sizes)[:, None] * (np.array(names)[:, None] == np.array(added))
    sources = (Source(n, "structural", Normal(), "coefficients of a part that meet a node, and met a boundary") for n in added)
    return replace(store, sources=(*store.sources, *sources), root=np.hstack([store.root, rows])).trimmed()


def _refuse_misplaced(model: Model, part: str, store: Store) -> None:
    """Refuse values of a part that it does not have, naming the model itself where that has them by these names.

    Raises
    ------
    NameNotFoundError   Names the first one, and what to write.
    """
    inner, whole = model.submodel(part) if part else model, model.parameter_table()
    missing = [p for p in store.parameters if inner.canonical(p) not in inner.parameter_table()]
    if not missing:
        return
    gone = [p for p in store.parameters if model.canonical(p) not in whole]
    kept_back = f"without = {json.dumps(gone)}"
    hint = nearest(missing[0], inner.parameter_table()) if part else f" Keep it back: {kept_back}."
    if part and not {*missing} <= {*gone}:
        rest = f", {kept_back}" if gone else ""
        hint = f" The model itself, '{model.title}', has it: write \".\" instead of '{part}'{rest}."
    raise NameNotFoundError(f"{store.states[missing[0]].origin} gives '{missing[0]}', which '{inner.title}' does not have.{hint}")


def _at_twins(model: Model, whole: Store, untied: Sequence[str]) -> tuple[Store, list[str]]:
    """Return a store in which a state acts at all twins of its places in the model, and remarks on the twins where it does not.

    A state does not reach the others where twins have different results, where the stage fitted some of the twins in its model alone, or
    where the model is cut at them (`untied`).
    """
    decks = rows_of_decks(model)
    if all(len(decks[p][1]) < 2 for s in whole.parameters.values() for p in s.paths if p in decks):
        return whole, []
    tied_here = local_identities(model.cut(*untied))
    places: dict[tuple[str, str], list[str]] = {}
    for path, one in local_identities(model).items():
        places.setdefault((one.owner, one.local), []).append(path)
    states, remarks = dict(whole.states), _RemarksByPath(decks)
    acting_paths = {p for s in states.values() for p in s.paths}
    for key, here in _by_identity(model, whole).items():
        rest = tuple(p for p in places.get(key, ()) if p not in acting_paths)
        first = next(iter(here.values()))
        if not all(s.is_same(first) for s in here.values()):
            who = " and ".join(dict.fromkeys(f"{s.origin} at {remarks.places([p])}" for p, s in here.items()))
            remarks.add(rest, f"the value of the deck stays at {{}}: its twins have different results, of {who}.")
            tied = [p for p in here if p in places.get(key, ())]
            remarks.add(
                tied if len(tied) > 1 else (), f"{{}} are one value of a deck, but have different results, of {who}. Each keeps its own."
            )
        elif rest and any(not s.at or inside(p, s.at) for p in rest for s in here.values()):
            remarks.add(rest, f"the value of the deck stays at {{}}: {first.origin} fitted that of {remarks.places(here)} alone.")
        else:
            for p in rest:
                path = next((s.path for q, s in here.items() if q in tied_here[p].paths), first.path)
                states[path] = replace(states[path], paths=(*states[path].paths, p))
    remarks.add_hidden(states.values(), model.parameter_table())
    return replace(whole, states=states), remarks.remarks()


def _by_identity(model: Model, whole: Store) -> dict[tuple[str, str], dict[str, State]]:
    """Return (owner, local path) of each value, in the model of the stage that gave it -> path in the whole -> state."""
    identities = _Identities(model)
    out: dict[tuple[str, str], dict[str, State]] = {}
    for s in whole.parameters.values():
        for path in s.paths:
            one = identities.identity(path, s.at if inside(path, s.at) else "")
            if one is not None:
                out.setdefault((one.owner, one.local), {})[path] = s
    return out


def _twins_places(model: Model, states: Iterable[State]) -> dict[str, str]:
    """Return path -> part over whose deck a state is to be laid, for the paths that lie outside the submodel of its stage."""
    decks_of_model = _Identities(model)
    out = {}
    for s in states:
        beyond = [p for p in s.paths if s.at and not inside(p, s.at)]
        one = decks_of_model.identity(next((p for p in s.paths if inside(p, s.at)), s.path), s.at) if beyond else None
        for path in beyond:
            parts = [path[:k] for k, c in enumerate(path) if c == "." and path[:k] in decks_of_model.decks]
            out[path] = next((p for p in parts if one is not None and decks_of_model.decks[p] == one.owner), parts[-1] if parts else "")
    return out


class _Identities:
    """Looks up which value of which deck a path is, seen from any submodel; `decks` has the definition of every part by its path."""

    def __init__(self, model: Model) -> None:
        """Note the parts of a model; identities are worked out when asked for."""
        self.model = model
        self.decks = {prefix.removesuffix("."): definition for prefix, definition in model.instances()}
        self._known: dict[str, Mapping[str, Identity]] = {}

    def identity(self, path: str, at: str) -> Identity | None:
        """Return the identity of a path of the whole, seen from the submodel `at`; None where that has no such value."""
        if at not in self._known:
            self._known[at] = local_identities(self.model.submodel(at) if at else self.model, self.decks.get(at, ""))
        return self._known[at].get(path[len(at) + 1 :] if at else path)


class _RemarksByPath:
    """Collects remarks on paths: text with ``{}`` in place of the paths -> paths; `decks` as `rows_of_decks` returns it."""

    def __init__(self, decks: Mapping[str, tuple[str, tuple[str, ...]]]) -> None:
        """Begin without a remark."""
        self._decks = decks
        self._paths: dict[str, dict[str, None]] = {}

    def add(self, paths: Iterable[str], words: str) -> None:
        """Add a remark on some paths; a path that has a remark already keeps that one alone."""
        spoken_of = {p for several in self._paths.values() for p in several}
        self._paths.setdefault(words, {}).update(dict.fromkeys(p for p in paths if p not in spoken_of))

    def add_hidden(self, states: Iterable[State], table: Mapping[str, Entry]) -> None:
        """Add a remark for each twin of a state that a [set] or a cut keeps from taking its value; `table` is `parameter_table`."""
        states = [s for s in states if s.kind == "parameter"]
        reading = {p for s in states for p in s.paths}
        for s in states:
            twins = (q for path in s.paths for q in self._decks[path][1] if q not in reading and not (s.at and inside(q, s.at)))
            for p in twins:
                by = table[p].origin
                why = f"{by} gives the value" if by.startswith(SET) else "it is cut from its twins"
                self.add([p], f"the result of {s.origin} for {self.places(s.paths)} does not act at {{}}: {why}.")

    def places(self, paths: Iterable[str]) -> str:
        """Return the parts in which paths stand as quoted text: 'a' and 'b'."""
        return quoted(list(dict.fromkeys(p.removesuffix(self._decks[p][0]).rstrip(".") for p in paths)))

    def remarks(self) -> list[str]:
        """Return the remarks with their paths put in; of more than `MAX_NAMED_VALUES` paths the parts alone."""
        named = {
            words: quoted(list(paths)) if len(paths) <= MAX_NAMED_VALUES else self.places(paths)
            for words, paths in self._paths.items()
            if paths
        }
        return [words.format(paths) for words, paths in named.items()]


def _chosen(path: str, several: Sequence[tuple[str, State, Array]]) -> tuple[State, Array, list[str]]:
    """Return the state that holds of several (part, state, row) for one path, its row, and remarks on states that were set aside.

    Equal and replaced states are dropped. Of an instrument the others are combined; of a parameter the one nearest to the root holds, and
    two at the same depth raise `DeckError`.
    """
    candidates: list[tuple[str, State, Array]] = []
    for part, state, row in several:
        if any(s.is_same(state) or s.replaces(state) for _, s, _ in candidates):
            continue
        candidates = [k for k in candidates if not state.replaces(k[1])] + [(part, state, row)]
    if candidates[0][1].kind != "parameter":
        return *_combined([s for _, s, _ in candidates], np.array([r for _, _, r in candidates])), []
    nearest_root = [k for k in candidates if depth(k[0]) == depth(candidates[0][0])]
    if len(nearest_root) > 1:
        one, two = nearest_root[0][1].origin, nearest_root[1][1].origin
        raise DeckError(
            f"{one} and {two} both give '{path}' independently of each other. Inherit one of them, or leave the value out of one by "
            f'without = ["{path}"] in a campaign, or by fit.values.only([...]) in Python.',
            code="value.excludes-another",
        )
    _, state, row = candidates[0]
    return (
        state,
        row,
        [
            f"'{path}': the value of {state.origin} is used, not that of {s.origin}, which is deeper in the model."
            for _, s, _ in candidates[1:]
        ],
    )


def _combined(states: Sequence[State], rows: Array) -> tuple[State, Array]:
    """Return the best linear unbiased estimate of one instrument from several stages, and its row (sources,).

    With the rows R of the states, weights w = (R R')^-1 1 / (1' (R R')^-1 1); the estimate is w' x of the fitted forms x, its row w' R.
    """
    if len(states) == 1:
        return states[0], rows[0]
    order = sorted(range(len(states)), key=lambda k: states[k].origin.stage)
    states, rows = [states[k] for k in order], rows[order]
    scores = symmetric_inverse(rows @ rows.T).sum(axis=0)
    shares = scores / scores.sum() if scores.sum() > 0 else np.full(len(states), 1.0 / len(states))
    fitted = float(shares @ [s.fitted for s in states])
    history = tuple(dict.fromkeys(o for s in states for o in (*s.history, s.origin)))
    value = float(np.exp(fitted)) if states[0].log else fitted
    return replace(states[0], value=value, history=history), shares @ rows


def _under(path: str, part: str) -> str:
    """Return a path of a part as the whole has it, ``part.path``; itself for the empty part."""
    return f"{part}.{path}" if part else path


@dataclass(frozen=True, eq=False)
class LaterTable:
    """A table of a fit's provenance that is computed at first use and kept.

    Parameters
    ----------
    make : callable     Returns the table.
    at : str            What its paths begin with in the model above; see `error_table_of`.
    without : tuple     Parts and values that were replaced, of which it says nothing.
    """

    make: Callable[[], Mapping[str, Any]]
    at: str = ""
    without: tuple[str, ...] = ()

    @classmethod
    def of_table(cls, table: Mapping[str, Any]) -> LaterTable:
        """Return a later table around one that is computed already."""
        return cls(lambda: table, table["at"], tuple(table.get("without", ())))

    @cached_property
    def table(self) -> Mapping[str, Any]:
        """The table, with the prefix of its paths as `at` and what was replaced as `without`."""
        return {**self.make(), "at": self.at, **({"without": list(self.without)} if self.without else {})}

    def __eq__(self, other: object) -> bool:
        """Whether another is the same table, made already or not."""
        return self.table == (other.table if isinstance(other, LaterTable) else other)

    def under(self, ahead: str) -> LaterTable:
        """Return the table for the model above, which has `ahead` before all its paths."""
        return LaterTable(self.original, f"{ahead}{self.at}", self.without)

    def original(self) -> Mapping[str, Any]:
        """Return the table as computed for this place; tables for other places are made from it."""
        return self.table


def error_table_of(provenance: Mapping[str, Any]) -> Mapping[str, Any] | None:
    """Return the table of the error model in the provenance of a stage; None where it has none."""
    return provenance["errors"].table if "errors" in provenance else None


def _provenance(provenance: Mapping[str, Any], part: str) -> Mapping[str, Any]:
    """Return the provenance of a fit with all its paths prefixed by ``part.``, as the model above has them."""
    moved = {n: {_under(p, part): x for p, x in provenance[n].items()} for n in ("conditions", "misfit") if n in provenance}
    structural = {"structural": structural_under(provenance["structural"], f"{part}.")} if part and "structural" in provenance else {}
    errors = {"errors": provenance["errors"].under(f"{part}.")} if part and "errors" in provenance else {}
    return {**provenance, **moved, **structural, **errors}


def _provenance_renamed(provenance: Mapping[str, Any], new: Callable[[str], str | None]) -> Mapping[str, Any]:
    """Return the provenance of a fit whose structural errors have their values under new names; no columns for one without a name."""
    if "structural" not in provenance:
        return provenance
    structural = provenance["structural"]
    names = {k: name for k, old in enumerate(structural["names"]) if (name := new(old)) is not None}
    assumed = {p: [moved[k] for k in names] for p, moved in structural.get("assumed", {}).items()}
    return {**provenance, "structural": {**structural, "names": [*names.values()], "assumed": assumed}}


def structural_under(structural: Mapping[str, Any], ahead: str) -> dict[str, Any]:
    """Return the structural errors of a fit (`Discrepancy.to_dict`) with all paths prefixed, as the model above has them.

    Parameters
    ----------
    structural : dict
    ahead : str     What paths begin with there, such as ``unit.``; names of instruments hold a space and stay.
    """
    placed = {n: {ahead + p: x for p, x in structural[n].items()} for n in ("conditions", "surfaces")}
    names = [n if " " in n else ahead + n for n in structural["names"]]
    by_value = {key: {ahead + p: x for p, x in structural.get(key, {}).items()} for key in ("assumed", "of_assumed", "scheduled")}
    return {**structural, **placed, **by_value, "names": names, "separated": [ahead + p for p in structural["separated"]]}


def depth(place: str) -> int:
    """Return how many levels a place lies below the root of its assembly; the root is the empty place."""
    return place.count(".") + 1 if place else 0


def rows_of_decks(model: Tree) -> Mapping[str, tuple[str, tuple[str, ...]]]:
    """Return path -> (its name in the deck that writes it, all paths that this one row of the deck stands for)."""
    of = dict(model.instances())
    rows: dict[tuple[str, str], list[str]] = {}
    for part, prefix in model.walk():
        for name, _, _ in part.own_parameters():
            rows.setdefault((of.get(prefix, ""), name), []).append(prefix + name)
    return {p: (name, tuple(paths)) for (_, name), paths in rows.items() for p in paths}


def domain(low: float, high: float, dimensionless: bool) -> tuple[float, float]:
    """Return the range that physics allows of a value by the bounds of its deck. [SI]

    0 to 1 for a dimensionless value bounded within 0 and 1 (a share), 0 to infinity where low >= 0, else minus to plus infinity.
    """
    if dimensionless and 0.0 <= low and high <= 1.0:
        return 0.0, 1.0
    return (0.0, np.inf) if low >= 0.0 else (-np.inf, np.inf)
