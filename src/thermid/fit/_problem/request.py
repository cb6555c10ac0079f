"""The request of a fit: model, records, free parameters, priors, what stages below found, and the key of all that its result depends on."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from fnmatch import fnmatchcase
from functools import cached_property
from importlib.metadata import version
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.base.errors import IdentificationError, NameNotFoundError, ThermidError, errors_at, nearest, refuse_unknown
from thermid.base.linear_algebra import RANK_TOLERANCE, inverse_square_root
from thermid.base.units import TEMPERATURE, Array, kelvin
from thermid.fit._problem.experiment import first_reading
from thermid.fit._problem.residuals import Unknown
from thermid.measure.records import Channel, Record
from thermid.model.tree import (
    Constant,
    Model,
    ParameterSet,
    StatedRange,
    Tree,
    definition_of,
    identity_of,
    inside,
    literal,
    local_identities,
)
from thermid.simulation.runs import Options, Scenario
from thermid.values.store import AS_FITTED, EXPECTED, RangedValue, Source, State, Store

FITTING = Options(error=1e-3)
"""A fit needs no more than a fraction of the noise of a sensor: ten times the error of a run."""


@dataclass(frozen=True)
class LocalSpec:
    """A value that each record has for itself.

    Parameters
    ----------
    start : str     A temperature, or the name of a channel whose first reading, less the constant error of its instrument, stands for it.
    sd : float      Standard deviation of its prior about the start; infinite for none. [K]
    """

    start: str
    sd: float = math.inf

    def to_table(self) -> dict[str, str]:
        """Return it as a table of a campaign."""
        return {"start": self.start} | ({"sd": f"{self.sd:.6g} [K]"} if math.isfinite(self.sd) else {})

    @classmethod
    def read(cls, written: Any, where: str) -> LocalSpec:
        """Return it from a temperature, the name of a channel, or a table with `start` and `sd`."""
        table = written if isinstance(written, Mapping) else {"start": written}
        refuse_unknown(table, ("start", "sd"), where, "give a local value start and sd, not {}.", IdentificationError)
        if "start" not in table:
            raise IdentificationError("a local value needs a start.", where, code="value.incomplete")
        sd = literal(table["sd"], "K", where) if "sd" in table else math.inf
        if not sd > 0:
            raise IdentificationError(
                f"the standard deviation {table['sd']} of a local value must be above zero.", where, code="value.outside-range"
            )
        start = table["start"]
        with errors_at(where):
            return cls(start if isinstance(start, str) else f"{kelvin(start)!r} [K]", sd)


@dataclass(frozen=True)
class Reading:
    """A temperature taken from a channel's first reading, less the sensor's constant error.

    Parameters
    ----------
    channel : str   The channel.
    offset : str    A parameter of the model [K] that is added; empty for none.
    """

    channel: str
    offset: str = ""

    @classmethod
    def read(cls, written: Any, where: str) -> Reading:
        """Return it from the name of a channel or a table with `channel` and `offset`."""
        table = written if isinstance(written, Mapping) else {"channel": written}
        unknown = set(table) - {"channel", "offset"}
        if unknown or "channel" not in table:
            raise IdentificationError("give a reading a channel, and an offset if needed.", where, code="value.wrong-kind")
        return cls(str(table["channel"]), str(table.get("offset", "")))


@dataclass(frozen=True, eq=False)
class Request:
    """Everything that a fit is asked.

    Parameters
    ----------
    model : Model
    records : tuple of Record
    free : tuple of str             Parameter paths.
    scenarios : dict                Record name -> Scenario, for what the logs do not say; key ``*`` for all others.
    local : dict                    Boundary or ``initial.<node>`` -> LocalSpec.
    record_local : dict             Record name -> the same, in place of `local` where both name it.
    priors : dict                   Parameter path -> (mean, sd) as texts; an empty mean is the start, an sd in % is relative.
    store : Store                   What stages below know of the model's values; the model has them laid over it.
    prior : tuple of str            Those of its values that are free here too, with their covariance as prior.
    held_bias : dict                Sensor -> constant error that is not looked for. [K]
    held_errors : dict              Channel -> constant error of a logged boundary [K] or power (a share of it), reading minus truth; given,
                                    even empty, no constant error of any instrument is looked for.
    weights : dict                  Sensor -> weight of its residuals, 1 where none is given.
    effective : bool                Whether readings count as many as residuals that wander are worth, which leaves priors their width.
    untie : bool                    Whether all instances get values of their own; `Model.cut` does it for some.
    loss : str                      linear, soft_l1, huber or cauchy.
    loss_scale : float              Residual, in units of the noise, from which a robust loss bends.
    search : str                    auto, local, multistart or differential evolution; see `searched`.
    window : float                  First readings are medians over this time. [s]
    name : str                      Name of the stage.
    readings : dict                 Boundary or ``initial.<node>`` -> Reading that stands there.
    seen : dict                     Checksum -> who used it, in the stages below.
    remarks : tuple of str          What a reader of the result must know before the fit has begun.
    fit_start : bool                Whether observed nodes' initial temperatures are looked for; else their first readings stand.
    options : Options               The integrator's.
    hand : Store or None            Values tuned by hand; nothing is fitted then.
    key : str                       Hash of everything that the result depends on; empty where nobody asked for it.
    adequate : float                Standard deviation that the autocorrelated part of residuals may have; 0 for the usual limits. [K]
    accepted : bool                 Whether the campaign accepts the stage as it is, whatever its standing.
    structural_errors : bool        Whether errors of values count what the structure may lack, whatever its residuals.
    idle_ranges : tuple of str      Sources of stated ranges on which no reading of this fit depends; see `with_idle_ranges`.
    of_logs : tuple of str          Free values that are of the records and not of the deck: powers of courses that were added to its model.
    """

    model: Model
    records: tuple[Record, ...]
    free: tuple[str, ...] = ()
    scenarios: Mapping[str, Scenario] = field(default_factory=dict)
    local: Mapping[str, LocalSpec] = field(default_factory=dict)
    record_local: Mapping[str, Mapping[str, LocalSpec]] = field(default_factory=dict)
    priors: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    store: Store = field(default_factory=Store)
    prior: tuple[str, ...] = ()
    held_bias: Mapping[str, float] = field(default_factory=dict)
    held_errors: Mapping[str, float] | None = None
    weights: Mapping[str, float] = field(default_factory=dict)
    untie: bool = False
    loss: str = "linear"
    loss_scale: float = 1.0
    search: str = "auto"
    window: float = 0.0
    name: str = ""
    readings: Mapping[str, Reading] = field(default_factory=dict)
    seen: Mapping[str, str] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    fit_start: bool = True
    options: Options = FITTING
    hand: Store | None = None
    key: str = ""
    adequate: float = 0.0
    accepted: bool = False
    structural_errors: bool = False
    of_logs: tuple[str, ...] = ()
    idle_ranges: tuple[str, ...] = ()

    @cached_property
    def fit_key(self) -> str:
        """Its key; of one made in Python, that of all it says, of values laid over its model, and of earlier fits."""
        below = sorted({s.origin.key for s in self.store.states.values()})
        return self.key or digest([self.stage_key(below), identity_of(self.model)])

    @property
    def shared(self) -> Mapping[str, tuple[str, ...]]:
        """Path -> every path of the model that has its value, its own first, of those that share one in this fit."""
        return {} if self.untie else shared_paths(self.model)

    def locals_of(self, record: Record) -> dict[str, LocalSpec]:
        """Return the local values of a record; those of its own win over the stage's."""
        return {**self.local, **self.record_local.get(record.name, {})}

    def scenario(self, record: Record) -> Scenario:
        """Return the scenario of a record, with a place for every local boundary."""
        base = self.scenarios.get(record.name, self.scenarios.get("*", Scenario(record.name)))
        local = self.locals_of(record)
        boundaries = {n: Constant(self.local_start(record, n)) for n in local if not n.startswith("initial.")}
        readings = {n: r.channel for n, r in self.readings.items() if n not in local}
        boundaries |= {n: Constant(first_reading(record, c, self.window)) for n, c in readings.items() if not n.startswith("initial.")}
        initial = {n.removeprefix("initial."): c for n, c in readings.items() if n.startswith("initial.")}
        return base.with_(boundaries=boundaries, initial=initial)

    def local_start(self, record: Record, name: str) -> float:
        """Return the start of a local value for a record, of a channel its first reading less the error that is held. [K]"""
        text = self.locals_of(record)[name].start
        if text in record.channels:
            return first_reading(record, text, self.window) - {**self.held_bias, **(self.held_errors or {})}.get(text, 0.0)
        try:
            return literal(text, TEMPERATURE)
        except ThermidError as error:
            hint = nearest(text, record.channels)
            raise IdentificationError(
                f"'{text}' is neither a temperature nor a channel of {record.name}.{hint} ({error.message})",
                f"local.{name}",
                code=error.code,
            ) from None

    def ingredients(self, below: list[str]) -> dict[str, str]:
        """Return name -> hash of everything that a stage's result depends on.

        What it inherits is a result of the stages below, whose keys say what that depends on: no value is an ingredient, for a fit that was
        recalled computes them anew, with other last digits than the search that came upon it.

        Parameters
        ----------
        request : Request   What the stage asks.
        below : list        Keys of the stages that it inherits from.
        """
        records = {}
        for r in self.records:
            channels = {n: _channel_key(c) for n, c in r.channels.items()}
            records[r.name] = [
                r.origin.sha256,
                list(r.steps),
                *map(repr, r.clocks),
                *([r.environment] if r.environment else []),
                channels,
            ]
        scenario = [
            self.scenarios,
            repr(sorted(self.local.items())),
            repr(sorted((n, sorted(t.items())) for n, t in self.record_local.items())),
            repr(sorted(self.readings.items())),
            self.window,
        ]
        how = [self.loss, self.loss_scale, self.search, repr(self.options), sorted(self.weights.items()), self.fit_start]
        how += ["structural errors"] if self.structural_errors else []
        held = None if self.held_errors is None else sorted(self.held_errors.items())
        priors = [repr(sorted(self.priors.items())), repr(sorted(self.held_bias.items())), repr(held)]
        content = {
            "deck": definition_of(self.model),
            "records": records,
            "scenario": scenario,
            "free and fixed": [self.free, self.prior, [(p, s.hidden) for p, s in self.store.states.items()], how],
            "priors": priors,
            "cuts": [self.untie, self.model.cuts],
            "values by hand": _by_hand(self),
            "below": below,
            "version": version("thermid"),
        }
        return {name: digest(x) for name, x in content.items()}

    def stage_key(self, below: list[str]) -> str:
        """Return the hash of all ingredients of a stage's result."""
        return digest(self.ingredients(below))


RANGE = "range"
"""In place of a prior: what the range of the data sheet says."""


def is_glob(name: str) -> bool:
    """Return whether a name stands for all that match it."""
    return any(mark in name for mark in "*?[")


def matching(pattern: str, paths: Iterable[str], where: str) -> list[str]:
    """Return the paths that a glob matches; ``*`` passes dots, so ``pre.*.htc`` reaches ``pre.ele.skin.htc``.

    Raises
    ------
    NameNotFoundError   When it matches nothing, with the nearest path.
    """
    names = list(paths)
    hits = [p for p in names if fnmatchcase(p, pattern)]
    if not hits:
        bare = pattern.translate(str.maketrans("", "", "*?[]"))
        raise NameNotFoundError(f"no parameter that can be fitted matches '{pattern}'.{nearest(bare, names)}", where)
    return hits


def shared_paths(model: Tree) -> Mapping[str, tuple[str, ...]]:
    """Return path -> every path of a model that has its value, its own first, of those that are one value at several places."""
    return {p: (p, *(q for q in one.paths if q != p)) for p, one in local_identities(model).items() if len(one.paths) > 1}


def freed(
    model: Model,
    free: Sequence[str],
    freeze: Sequence[str],
    where: str,
    handed: Iterable[str] = (),
    shared: Mapping[str, tuple[str, ...]] | None = None,
) -> tuple[list[str], set[str]]:
    """Return what is free once names and globs are read and `freeze` is taken off, and every path that is frozen.

    A value that is frozen at one of its places is frozen at all.

    Parameters
    ----------
    model : Model           The stage's.
    free, freeze : list     Names and globs. A name that is no parameter is left to the fit, which says what is near.
    where : str             For messages.
    handed : iterable       Paths that stages below free as priors.
    shared : dict           Path -> every path with its value; none by default.

    Raises
    ------
    NameNotFoundError       When a glob matches no parameter that can be freed.
    IdentificationError     When `freeze` takes nothing off.
    """
    free = [free] if isinstance(free, str) else free  # one name, and not its letters
    if not isinstance(free, Iterable) or not all(isinstance(raw_name, str) for raw_name in free):
        raise IdentificationError(f"what is to be fitted is a list of names, not {free!r}.", where, code="value.wrong-kind")
    if not freeze and not any(map(is_glob, free)):
        return list(free), set()
    values = ParameterSet(model)
    literals = [p for p, entry in values.table.items() if entry.parameter.is_literal]
    out: dict[str, None] = {}
    for name in free:
        out |= dict.fromkeys(matching(model.canonical(name), literals, where) if is_glob(name) else [name])
    here = {_path(model, values, name): name for name in out}
    frozen: set[str] = set()
    candidates = {*here, *handed}
    for name in freeze:
        hits = set(matching(model.canonical(name), literals, where)) if is_glob(name) else {values.freeable(name, model.canonical)}
        hits = {q for p in hits for q in (shared or {}).get(p, (p,))}
        if not hits & candidates:
            raise IdentificationError(
                f"'{name}' is listed as frozen, but it is not free here, so it stays fixed anyway. Remove it from the list.",
                where,
                code="value.without-effect",
            )
        frozen |= hits
    return [name for path, name in here.items() if path not in frozen], frozen


def _path(model: Model, values: ParameterSet, name: str) -> str:
    """Return the path that a fit frees for a name; a name that cannot be freed stays, the fit will say why."""
    path = model.canonical(name)
    return values.literal_behind(path) if path in values.table else name


def mean_of(prior: Any) -> str:
    """Return what a prior says of its mean as it is written, or an empty text where the start stands for it."""
    mean = prior.get("mean", prior.get("low", "")) if isinstance(prior, Mapping) else prior[0]
    return "" if mean is None else str(mean)


def priors_of(model: Model, stated: Mapping[str, Any], where: str) -> dict[str, tuple[Any, Any]]:
    """Return path -> prior, globs spread over the paths that they match and 'range' turned into ("", the deck's `StatedRange`).

    All other priors, pairs or tables, are returned as they are stated.

    A range min..max of a data sheet holds 95 % of parts about the value of the deck, as every stated range: see `StatedRange`.

    Raises
    ------
    NameNotFoundError       When a glob matches nothing.
    IdentificationError     When a parameter has no range, or its range is not one of a data sheet.
    """
    for name, one in stated.items():
        if not isinstance(one, Mapping) and not _is_range(one) and not (isinstance(one, list | tuple) and len(one) == 2):
            raise IdentificationError(
                f"a prior is a pair (mean, standard deviation), a table such as {{'sd': '1 [K]'}}, or 'range', not {one!r}.",
                f"{where}.priors.{name}",
                code="value.wrong-kind",
            )
    if not any(is_glob(name) or _is_range(one) for name, one in stated.items()):
        return dict(stated)
    values = ParameterSet(model)
    literals = [p for p, entry in values.table.items() if entry.parameter.is_literal]
    out: dict[str, tuple[Any, Any]] = {}
    for name, one in stated.items():
        if not is_glob(name):
            paths = [values.freeable(name, model.canonical)]
        else:
            paths = matching(model.canonical(name), literals, where)
        for path in paths:
            out[path] = _range(values, path, f"{where}.priors.{name}") if _is_range(one) else one
    return out


def _is_range(prior: Any) -> bool:
    """Return whether a prior is what the range of a data sheet says."""
    return isinstance(prior, str) and prior == RANGE


def _range(values: ParameterSet, path: str, where: str) -> tuple[str, StatedRange]:
    """Return no mean, for which the deck's value stands, and the range that the deck states for a parameter."""
    if (stated := values.stated_ranges.get(path)) is not None:
        return "", stated
    raise IdentificationError(
        f"'{path}' has no range: its source is {values.table[path].parameter.source or 'not stated'}, so min and max only bound the "
        "search. If they are the range of the value, state both and spread = 'range'; otherwise give the prior a mean and sd.",
        where,
        code="value.without-effect",
    )


def _channel_key(c: Channel) -> list[Any]:
    """Return what a fit depends on of a channel beside its numbers in the file, whose hash is of them as they are written."""
    prompt = "sampled" if c.prompt is False else bool(c.prompt)
    limits = (c.noise, c.accuracy, c.resolution, prompt, c.correction, c.samples + c.interpolation)
    return [c.role, c.target, c.gain, c.unit, c.quantity, *limits, *([repr(c.part)] if c.part else [])]


def _by_hand(request: Request) -> list[str]:
    """Return the values set by hand and their covariance, for a hash."""
    if request.hand is None:
        return []
    return [repr(list(request.hand.states.values())), repr(request.hand.root.tolist())]


def in_full(value: Any) -> Any:
    """Return what JSON cannot hold in a form that it can, every digit of every sample kept."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if is_dataclass(value) and not isinstance(value, type):
        return {f.name: getattr(value, f.name) for f in fields(value)}
    return str(value)


def digest(content: object) -> str:
    """Return the hash of what JSON can hold, `in_full` helping."""
    return hashlib.sha256(json.dumps(content, sort_keys=True, default=in_full).encode()).hexdigest()


STIFF = (10.0 * RANK_TOLERANCE) ** 2
"""Variance of a direction, beside the largest, below which values count as known exactly against one another: ten times what a rank could
still tell from nothing."""


@dataclass(frozen=True, eq=False)
class KnownBefore:
    """What stages below found of the unknowns of a fit.

    Parameters
    ----------
    at : array (n,)             Positions of those among the unknowns that they know.
    mean : array (n,)           Where they are expected, in the fitted form of the unknowns.
    rows : array (n, sources)   Their responses, in that form.
    sources : tuple of Source   What they respond to.
    held : array (sources,)     Whether a source is the range of an input that acts in this fit, too, as its deck has it.
    """

    at: NDArray[np.int64]
    mean: Array
    rows: Array
    sources: tuple[Source, ...]
    held: NDArray[np.bool_]

    @property
    def root(self) -> Array:
        """A root R of their information, ``R'R = (rows rows')^-1``: the residual of the joint prior is ``R (fitted - mean)``.

        Without the ranges of held inputs: the stages below found the values beside these inputs as they are here. Where readings do not
        depend on an input, such as a gap without its gas, its range is among what a value was known with.
        """
        rows = self.rows[:, ~self.held]
        return inverse_square_root(rows @ rows.T, STIFF)


def known_before(request: Request, unknowns: Sequence[Unknown]) -> KnownBefore:
    """Return mean and root covariance, by source of error, of the inherited unknowns of a fit and of its instruments; fitted form.

    The accuracy of an instrument is part of what they found of it, so it counts once. Instances that a fit unties start from the same
    values; each errs for itself, its own values together.
    """
    store = request.store
    moving = {q: store.states[p] for p in request.prior for q in store.states[p].acts}
    inherited = [(k, u, state) for k, u in enumerate(unknowns) if (state := _state_of(store, moving, u)) is not None]
    copies = [_copy(u.name, [v.name for _, v, other in inherited if other.is_same(state)]) for _, u, state in inherited]
    places = {"": 0} | {place: n for n, place in enumerate(dict.fromkeys(filter(None, copies)), 1)}
    sources = [replace(s, name=f"{s.name} at {place}") if place else s for place in places for s in store.sources]
    count = len(store.sources)
    rows = np.zeros((len(inherited), len(sources)))
    for i, ((_, u, state), place) in enumerate(zip(inherited, copies, strict=True)):
        first = places[place] * count
        rows[i, first : first + count] = store.rows([state.path])[0] * form(state, u)
    at = np.array([k for k, _, _ in inherited], dtype=np.int64)
    free = {t.name for u in unknowns for t in u.targets}
    ranges = RangedValue.of_fit(request.model, ParameterSet(request.model), free) if inherited else ()
    held = np.isin([s.name for s in store.sources], [s.name for r in ranges for s, _ in r.columns if s.name not in request.idle_ranges])
    moves, fits = ([k for k, s in enumerate(sources) if part in s.name] for part in (EXPECTED, AS_FITTED))
    mean = np.array([u.to_fitted(state.value) for _, u, state in inherited]) + rows[:, moves].sum(axis=1)
    rows[:, moves + fits] = 0.0
    return KnownBefore(at, mean, rows, tuple(sources), np.tile(held, len(places)))


def counted_twice(store: Store, prior: Sequence[str], records: Sequence[Record]) -> list[str]:
    """Return a remark for every record whose readings reach a stage as samples and, through a stage below, as prior too.

    Parameters
    ----------
    store : Store       What the stages below know.
    prior : sequence    Which of it may move.
    records : tuple     The stage's own.
    """
    origins = {o.stage for p in prior for s in (store.states[p],) for o in (s.origin, *s.history)}
    used = {sha: stage for stage in origins for sha in store.provenance.get(stage, {}).get("records", {}).values()}
    return [
        f"record '{r.name}' was fitted by stage '{used[r.origin.sha256]}' too, whose result is a prior here. Its readings count "
        "twice, so the errors are too small. Inherit the values with as = 'fixed', or use another record."
        for r in records
        if r.origin.sha256 in used
    ]


def _copy(path: str, twins: Sequence[str]) -> str:
    """Return the shortest start of a path that none of its twins has; empty for the first of them in the order of names."""
    others = [q for q in twins if q != path]
    if path == min(twins):
        return ""
    steps = path.split(".")
    starts = (".".join(steps[:n]) for n in range(1, len(steps) + 1))
    return next(start for start in starts if not any(inside(q, start) for q in others))


def form(state: State, unknown: Unknown) -> float:
    """Return d unknown / d state, both in their fitted forms."""
    return (state.value if state.log else 1.0) / (state.value if unknown.log else 1.0)


def _state_of(store: Store, moving: Mapping[str, State], unknown: Unknown) -> State | None:
    """Return what is known of an unknown below; None for nothing, or where the fit is not to rest on it."""
    if unknown.kind == "parameter":
        state = next((moving[n] for n in (unknown.name, *unknown.also) if n in moving), None)
    else:
        state = store.states.get(unknown.name)
    return state if state is not None and state.known and store.rows([state.path]).any() else None
