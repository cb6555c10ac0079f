"""`Budget`: everything uncertain that bears on one scenario, by source, how the model's inputs respond to it, and what is left out."""

from __future__ import annotations

import fnmatch
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from typing import Any, Literal, get_args

import numpy as np

from thermid.base.arguments import guard_methods, takes_objects
from thermid.base.errors import CodedText, IdentificationError, NameNotFoundError, ScenarioError, SolverError, quoted, refuse_unknown
from thermid.base.linear_algebra import quadratic_forms, symmetric_inverse
from thermid.base.results import Shown
from thermid.base.units import Array, Indices, from_si, plain_numbers, short, value_of
from thermid.fit.calibration import Calibration
from thermid.fit.error_model import (
    AS_BUILT,
    MAX_GAS_CONDUCTANCE,
    BandCause,
    Discrepancy,
    ErrorModel,
    KeptWay,
    SeenValue,
    contacts_in_other_gas,
    told_first,
)
from thermid.inference.criticism import asks
from thermid.model.tree import UNJUDGED, Constant, Model, Standing
from thermid.prediction._known import Knowledge, Rows, known_of, normal_sources, rows_of
from thermid.prediction._split import split_values
from thermid.simulation.runs import Network, Scenario, Simulator, compile_network, network_for, prepare, read_schedule
from thermid.values.store import (
    RANGE_OF,
    Distribution,
    FittedValues,
    Kind,
    LeftOut,
    Logarithm,
    LogNormal,
    Normal,
    RangedValue,
    Shifted,
    Source,
    Uniform,
    bracketed,
    cut,
    narrowed,
    uniforms,
    without_spread,
)

Groups = Sequence[tuple[Sequence[str], Any]]
"""Names that share one value, and how it is spread."""
Form = Literal["add", "log", "factor", "heat", "node"]
MEMBER_TAIL_SHARE = 1e-7
"""Share of a law below which no member lies. [-]"""
MIN_LOG_SHARE = 0.01
"""Part of a value below which a law that reaches there is not taken by its logarithm. [-]"""
ASSUMED_SD_SHARE = 0.1
"""Standard deviation of an assumed value whose deck gives no range: a tenth of it."""
UNFITTED = "the model's own error, because no fit has measured it"
SILENT = "how elements depart from their laws, because the fitted values do not include it"
OFF = "(switched off)"
MIN_SHARE_OF_BAND = 0.1
"""Share of a band from which what it does not count is named in the first line. [-]"""


SPLIT, GAS_IN_JOINTS, STATED_RANGES = "split of effective coefficients", "gas in joints", "stated ranges"
AVERAGED = "what carries the heat"
"""Causes, as a reader is told them."""
DEFECTS = "hidden defects"
"""Cause: which of several defects that explain a fit its unit has; also what `without` calls them."""
CAUSES = (
    *get_args(Kind),
    *(BandCause.VALUES, BandCause.START, BandCause.STRUCTURE, BandCause.RUN, BandCause.ROOM, BandCause.UNEXPLAINED),
    *(SPLIT, GAS_IN_JOINTS, STATED_RANGES, AVERAGED, DEFECTS),
)
"""What `without` may name whether or not a question has such a source."""
ELEMENTS = ("structural", BandCause.STRUCTURE)
"""Kinds and causes without which nothing departs: the answer is that of the model's own structure, with the errors of its fits."""
SCHEDULE_SLACK = 0.01
"""Part of a logged schedule's largest value by which a scenario may pass its ends before that is named. [-]"""
EXPECTED_OF = "expected of "
"""Begins the name of the source by which values and departures of a fit lie where they are expected, from where its derivatives are."""
LEAST_TOGETHER = 1e-3
"""Probability from which ways of several fits are answered for together. [-]"""
ROOM_HATS = 25
"""Numbers by which a logged room may wander in a run, at most."""


@guard_methods
@dataclass(frozen=True, eq=False)
class Spread(Shown):
    """How far some values may lie from where a model has them, normal or log-normal, correlated or not.

    Parameters
    ----------
    cause : str                     What a reader is told: ``fit``, ``stated``, ``split of effective coefficients``.
    names : tuple of str            Parameters, boundaries (a shift [K]), ``initial.<node>`` [K], ``scale.<load>`` (a factor on its power).
    covariance : array              Of the values [SI], or of their logarithms where `log` states this.
    log : tuple of bool             Which are spread in their logarithm; none by default.
    also : dict                     Name -> other parameters that share its value.
    """

    cause: str
    names: tuple[str, ...]
    covariance: Array
    log: tuple[bool, ...] = ()
    also: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check the parts against each other.

        Raises
        ------
        IdentificationError   When lengths differ, or the covariance is none.
        """
        size = len(self.names)
        covariance = np.asarray(plain_numbers(self.covariance))
        if covariance.shape != (size, size) or not isinstance(self.log, tuple | list) or len(self.log) not in (0, size):
            raise IdentificationError(
                f"{size} names need a covariance of {size} by {size}, and as many marks for logarithms.", self.cause, code="value.shape"
            )
        loose = [n for n, v in zip(self.names, np.diag(covariance), strict=True) if not np.isfinite(v)]
        if loose:
            raise IdentificationError(
                f"'{loose[0]}' has no finite error. Leave it out, or give it a spread of its own.", self.cause, code="fit.not-determined"
            )
        sizes = np.linalg.eigvalsh(covariance) if size else np.zeros(0)
        if not np.allclose(covariance, covariance.T, rtol=1e-6) or sizes.min(initial=0.0) < -1e-9 * sizes.max(initial=0.0):
            raise IdentificationError("a covariance must be symmetric and positive semi-definite.", self.cause, code="value.shape")
        object.__setattr__(self, "covariance", 0.5 * (covariance + covariance.T))
        object.__setattr__(self, "log", tuple(self.log) or (False,) * size)

    @classmethod
    def of_fit(cls, values: FittedValues) -> Spread:
        """Return what a fit leaves open, with its covariance.

        Parameters
        ----------
        values : FittedValues   Of a calibration, or from a file.
        """
        bare_values = values.bare()
        also, logs = {p: v.also for p, v in bare_values.items() if v.also}, tuple(v.log for v in bare_values.values())
        return cls(f"fit of {values.stage}", tuple(bare_values), bare_values.covariance, logs, also)


def never_logged(discrepancies: Sequence[Discrepancy], network: Network, scenario: Scenario) -> str:
    """Return a remark on scheduled values, such as a fan's speed, that a scenario takes where no record of the fits did; else nothing."""
    schedule, values = read_schedule(network, scenario), network.flat.parameters.evaluate({})
    words = []
    for path in dict.fromkeys(p for k in discrepancies for p in k.scheduled):
        ends = [x for k in discrepancies for x in k.scheduled.get(path, ())]
        levels = schedule.signals[path].bounds if schedule is not None and path in schedule.signals else (float(values[path]),)
        far = [x for x in levels if max(min(ends) - x, x - max(ends)) > SCHEDULE_SLACK * max(map(abs, ends))]
        if far:
            unit = network.flat.parameters.table[path].parameter.unit
            low, high, *shown = (short(from_si(x, unit)) for x in (min(ends), max(ends), *dict.fromkeys(far)))
            words.append(f"{path} {' and '.join(shown)} {unit}: never in the logs ({low} to {high} {unit})")
    return f"{'; '.join(words)}. The expressions that take it are extrapolated, which no band counts: log a run there" if words else ""


def followed_by(discrepancies: Sequence[Discrepancy]) -> dict[str, dict[str, float]]:
    """Return assumed value -> fitted value -> what it moves by for one more of the assumed one's SI unit; of two fits the later's."""
    out: dict[str, dict[str, float]] = {}
    for k in discrepancies:
        for moved in out.values():
            for name in k.names:
                moved.pop(name, None)  # what an earlier fit found of it was replaced
        for path, moves in k.assumed.items():
            out.setdefault(path, {}).update(zip(k.names, moves.tolist(), strict=True))
    return out


def split_rows(
    knowledge: Knowledge, rows: Rows, scenario: Scenario, named: Sequence[str], lawful: Collection[str] = ()
) -> tuple[Model, Rows]:
    """Return the model and the rows with effective coefficients separated where the scenario thins their gas.

    New rows are the logarithms of emissivities e: B A^-1 times the rows of the fitted values, with the joint covariance [[A, B'], [B, C]]
    of these and e, and sources of their own with the covariance C - B A^-1 B'.

    Parameters
    ----------
    known, rows         What is known.
    scenario : Scenario What is asked about.
    named : sequence    Names whose spread is stated; an emissivity among them is known already.
    lawful : collection Surfaces whose radiation stands in a law of their own.
    """
    values = knowledge.placed[-1] if knowledge.values else FittedValues(knowledge.model.title, {}, np.zeros((0, 0)))
    # surfaces whose effective coefficient a scenario takes apart, and whose emissivity is not among the known values
    spread_names = [*knowledge.assigned, *map(knowledge.model.canonical, named)]
    network = compile_network(knowledge.model)
    media = scenario.media()
    roots = network.flat.parameters.literal_behind
    effective = [c for c in network.flat.conductors if c.kind == "effective" and c.emissivity and not media.as_printed]
    thin = [c.path for c in effective if media.changed(c.gas) and not {roots(c.emissivity), c.emissivity} & {*spread_names}]
    surfaces = knowledge.discrepancies[-1].surfaces if knowledge.discrepancies else {}
    thin = [p for p in thin if p in surfaces and p not in lawful]
    if not thin:
        return knowledge.model, rows
    apart = split_values(knowledge.model, values.bare(), thin, surfaces)
    fresh = [p for p in apart.values if p not in values]
    names = [*values.bare(), *fresh]
    joint = apart.values.covariance
    n = len(names) - len(fresh)
    # emissivities given the fitted values: b a^-1 of their covariances; what that leaves is the split's own
    follows = joint[n:, :n] @ symmetric_inverse(joint[:n, :n])
    place = {name: k for k, name in enumerate(rows.names)}
    upper = np.array([rows.matrix[place[p]] if p in place else np.zeros(len(rows.sources)) for p in names[:n]])
    upper = upper.reshape(n, len(rows.sources))
    conditional_covariance = joint[n:, n:] - follows @ joint[:n, n:]
    sources, matrix = normal_sources(f"split of '{values.stage}'", conditional_covariance, "structural")
    whole = np.zeros((len(rows.names) + len(fresh), len(rows.sources) + len(sources)))
    whole[: len(rows.names), : len(rows.sources)] = rows.matrix
    whole[len(rows.names) :, : len(rows.sources)] = follows @ upper
    whole[len(rows.names) :, len(rows.sources) :] = matrix
    also = {p: v.also for p, v in apart.values.items() if v.also}
    causes = (*rows.causes, *(SPLIT,) * len(sources))
    return apart.model, Rows(
        (*rows.names, *fresh), (*rows.log, *(True,) * len(fresh)), {**rows.also, **also}, (*rows.sources, *sources), causes, whole
    )


def open_contacts(knowledge: Knowledge, rows: Rows, scenario: Scenario) -> tuple[dict[str, Source], str]:
    """Return fitted contact conductance -> source of its relative change without gas, and a remark; none where no gas leaves.

    A contact fitted in air is the sum of touching spots and of gas between. Without gas it is anything from what is fitted less what gas
    can carry to all of it, each as likely. A joint with a `gap` in its deck, or a record at low pressure, separates both; one that a
    pad or grease fills has no gas (``gas = "none"``).
    """
    network = compile_network(knowledge.model)
    separated = [p for k in knowledge.discrepancies for p in k.separated]
    fitted = {p: n for n in rows.names for p in (n, *rows.also.get(n, ()))}
    numbers = network.numbers().values
    out: dict[str, Source] = {}
    changed = {*contacts_in_other_gas(network, [scenario.media()])} - {*separated}
    for c in (c for c in network.flat.conductors if c.path in changed):
        name = fitted.get(network.flat.parameters.literal_behind(c.fields["contact_conductance"]), "")
        if name and name not in out:
            value = float(value_of(numbers[name]))
            words = f"gas conduction in '{c.path}'"
            out[name] = Source(f"gas in {c.path}", "structural", Uniform(-min(1.0, MAX_GAS_CONDUCTANCE / value), 0.0), words)
    if not out:
        return out, ""
    named, was, it = ", ".join(f"'{p}'" for p in out), "was" if len(out) == 1 else "were", "it" if len(out) == 1 else "each"
    return out, (
        f"{named} {was} fitted in air. No log shows how much of {it} is conduction through the gas between the faces, so without gas "
        f"{it} lies anywhere from the fitted value less that to all of it; the bands include this. A record at low pressure, or a gap in "
        "the deck, would separate both; if a pad or grease fills the joint, state gas = 'none'"
    )


def kept_as_solid(knowledge: Knowledge, rows: Rows, scenario: Scenario) -> str:
    """Return a remark on the fitted conductances of conduction that a scenario with other gas keeps whole; empty where its gas stays."""
    flat = compile_network(knowledge.model).flat
    media = scenario.media()
    fitted = {p for n in rows.names for p in (n, *rows.also.get(n, ()))}
    stated = {c.path: c.fields["conductance"] for c in flat.conductors if c.kind == "conduction" and "conductance" in c.fields}
    kept = [p for p, name in stated.items() if flat.parameters.literal_behind(name) in fitted]
    if not kept or not any(media.changed(c.gas) for c in flat.conductors if c.kind in ("convection", "effective")):
        return ""
    path = "is kept whole without gas, as a solid path" if len(kept) == 1 else "are kept whole without gas, as solid paths"
    return f'{quoted(kept, 3)} {path}. Where faces only touch, state kind = "contact": then the bands count the gas between them'


def expanded(stated: Mapping[str, Any], model: Model) -> list[tuple[list[str], Any]]:
    """Return names that share one value, and how it is spread; patterns reach every number of the model that they match.

    Instances of one part whose value stands in one place share it.

    Raises
    ------
    NameNotFoundError   When a pattern reaches nothing.
    """
    if not any(c in model.canonical(raw) for raw in stated for c in "*?["):
        return [([raw], how) for raw, how in stated.items()]
    table = model.parameter_table()
    taken = {model.canonical(raw) for raw in stated}
    out: list[tuple[list[str], Any]] = []
    for raw, how in stated.items():
        if not any(c in raw for c in "*?["):
            out.append(([raw], how))
            continue
        same: dict[str, list[str]] = {}
        for path, entry in table.items():
            parameter = entry.parameter
            bounded = parameter.minimum is not None and parameter.maximum is not None and parameter.minimum < parameter.maximum
            if parameter.is_literal and fnmatch.fnmatchcase(path, raw) and (how != "range" or bounded or parameter.spread):
                same.setdefault(entry.where, []).append(path)
        if not same:
            raise NameNotFoundError(
                f"the pattern '{raw}' matches no number{' with min and max, or a spread' if how == 'range' else ''}.", model.title
            )
        # what is named wins over a pattern that reaches it
        remaining = ([p for p in paths if p not in taken] for paths in same.values())
        out += [(paths, how) for paths in remaining if paths]
    return out


def lasting(scenario: Scenario) -> Scenario:
    """Return a scenario with a duration: of 1 s where it has none, as a steady state has."""
    return scenario if scenario.seconds > 0 else scenario.with_(duration=1.0)


def check_variants(stated: Mapping[str, Any], model: Model, scenarios: Sequence[Scenario]) -> None:
    """Refuse a temperature itself as the spread of what differs between scenarios: a shift is the same in all of them."""
    laws = []
    for scenario in scenarios if len(scenarios) > 1 else ():
        names = [n for n in stated if not any(c in n for c in "*?[")]
        ready = prepare(model, lasting(scenario), names)
        laws.append({n: ready.law(n, stated[n]).mean - ready.nominal[ready.canonical(n)] for n in names})
    for name in laws[0] if laws else ():
        if max(law[name] for law in laws) - min(law[name] for law in laws) > 1e-9:
            raise ScenarioError(
                f"the scenarios have different temperatures of '{name}', but the spread gives one absolute temperature for all of "
                "them. Give a shift in kelvin, such as '2 [K]'.",
                model.title,
                code="value.contradicts",
            )


Stated = Mapping[str, Any] | Spread
WRONG = "a column, a unit, a power or a noise of the logs, or a missing element. `thermid criticise` looks for it"
"""What may be wrong where no departure of a usual size explains the readings of a fit."""
CONTRADICTED = "prediction.readings-contradict"
"""Code of what is left out there."""


@dataclass(frozen=True)
class Target:
    """What sources act on.

    Parameters
    ----------
    name : str              Parameter, boundary, ``initial.<node>``, ``scale.<load>``, departure of an element, or node.
    form : str              add (to the value [SI]), log (to its logarithm), factor (a relative change), heat (of a departure), or
                            node (to its temperature after the run [K]).
    also : tuple of str     Other names that share the value.
    """

    name: str
    form: Form
    also: tuple[str, ...] = ()


UNSOUGHT = (
    "the residuals exceed the stated noise, and hidden defects (clocks, lags, a mass, a leak) were not looked for here: "
    "the band is that of the deck. predict without draws looks for them"
)
"""What a reader of a band must know whose fit may hide a defect, where nobody looked for one."""

UNSEEN = "the bands do not count what the equations of the FMU leave out: its structure is not known here"
"""What is said of the band of a model that is run by somebody else's program."""


def as_built(way: KeptWay) -> bool:
    """Return whether no element departs from its law in a way, whatever its finish."""
    return way.name.startswith(AS_BUILT)


def _together(errors: Sequence[ErrorModel], network: Network) -> list[tuple[KeptWay, ...]]:
    """Return a way of every model of error for each that there is of all: heat is carried in one way everywhere, or as the deck says.

    That the elements of one fit do not depart says nothing of those of another, so each may be as built beside every way of the others.
    """
    names = dict.fromkeys(w.name for e in errors if len(e.ways) > 1 for w in e.ways if not as_built(w)) or [errors[0].ways[0].name]
    # a deck may have said since what carries the heat
    names = [n for n in names if all(w.agrees(network) for e in errors for w in e.ways if w.name == n)] or [*names]
    out: dict[tuple[str, ...], tuple[KeptWay, ...]] = {}
    for name in names:
        departing = [next((w for w in e.ways if w.name == name), e.ways[0]) for e in errors]
        for kept in product(
            *([w, *(x for x in e.ways if as_built(x) and x.agrees(network))] for w, e in zip(departing, errors, strict=True))
        ):
            out.setdefault(tuple(w.name for w in kept), kept)
    weights = [float(np.prod([w.weight for w in kept])) for kept in out.values()]
    seen = [kept for kept, weight in zip(out.values(), weights, strict=True) if weight > LEAST_TOGETHER * sum(weights) or len(errors) == 1]
    return sorted(seen, key=lambda kept: sum(map(as_built, kept)))


@dataclass(frozen=True, eq=False)
class BudgetWay:
    """One way in which the heat of surfaces may be carried, as a budget has it.

    Parameters
    ----------
    weight : float      Its probability. [-]
    kept : tuple        What is known of the elements, of every part that a fit of its own saw.
    at : dict           Value -> where the derivatives of its fit were taken. [SI]
    gain : array        (targets, sources) of the first targets and sources of the budget.
    """

    weight: float
    kept: tuple[KeptWay, ...]
    at: Mapping[str, float]
    gain: Array

    @property
    def built(self) -> tuple[bool, ...]:
        """Of every model of error whether nothing departs in it."""
        return tuple(map(as_built, self.kept))

    @property
    def departing(self) -> KeptWay:
        """The first of those in which elements depart, if there is one."""
        return next((w for w in self.kept if not as_built(w)), self.kept[0])


@dataclass(frozen=True, eq=False)
class Budget:
    """The uncertainty of one question.

    Parameters
    ----------
    model : Model                   With the values laid over it, coefficients separated where the scenario thins their gas.
    scenario : Scenario
    sources : tuple of Source
    causes : tuple of str           Of each source: what a reader is told that it belongs to.
    alike : array                   Correlations of the sources, of their normal scores.
    targets : tuple of Target
    gain : array                    (targets, sources): by how much a target moves for a unit of a source.
    loose : dict                    Value that hardly any reading determines -> what was known of it before.
    ways : tuple of BudgetWay       In which the heat of surfaces may be carried; none where no element departs.
    omitted : tuple of LeftOut      What is known to be left out before anything is run.
    remarks : tuple of str          What a reader must know.
    standing : Standing             Of the values that it rests on.
    followed : dict                 Assumed value -> fitted value -> what it moves by for one more SI unit of the assumed one; fitted form.
    said : dict                     Assumed value -> variance that the readings leave it, and how far away they ask it to be. [SI]
    """

    model: Model
    scenario: Scenario
    sources: tuple[Source, ...]
    causes: tuple[str, ...]
    alike: Array
    targets: tuple[Target, ...]
    gain: Array
    loose: Mapping[str, SeenValue] = field(default_factory=dict)
    ways: tuple[BudgetWay, ...] = ()
    omitted: tuple[LeftOut, ...] = ()
    remarks: tuple[str, ...] = ()
    standing: Standing = UNJUDGED
    followed: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    said: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    @classmethod
    def of_rows(cls, rows: Rows, model: Model, scenario: Scenario | None = None) -> Budget:
        """Return the uncertainty of values alone, of no structure; without a scenario that of no run."""
        targets = tuple(Target(n, "log" if log else "add", rows.also.get(n, ())) for n, log in zip(rows.names, rows.log, strict=True))
        return cls(model, scenario or Scenario(), rows.sources, rows.causes, np.eye(len(rows.sources)), targets, rows.matrix)

    @property
    def names(self) -> tuple[str, ...]:
        """Names that differ from member to member, those that share a value among them, in the simulator's words."""
        member_names = (n for t in self.targets if t.form in ("add", "log", "factor") for n in (t.name, *t.also))
        return tuple(dict.fromkeys(member_names))

    @property
    def spread(self) -> set[str]:
        """Names that at least one source moves, those that share a value among them."""
        acting_targets = (t for t, row in zip(self.targets, self.gain, strict=True) if row.any())
        return {n for t in acting_targets for n in (t.name, *t.also)}

    @property
    def weighted_ways(self) -> tuple[tuple[float, Budget], ...]:
        """Return probability [-] and budget of each way in which the heat of surfaces may be carried; this budget where there is none."""
        if not self.ways:
            return ((1.0, self),)
        out = []
        for way in self.ways:
            gain = self.gain.copy()
            gain[: way.gain.shape[0], : way.gain.shape[1]] = way.gain
            out.append((way.weight, replace(self, gain=gain, ways=(way,))))
        return tuple(out)

    def chosen(self, sources: Array) -> Indices:
        """Return which way each member (members,) has, by the source `AVERAGED` of the values (sources, members); else the first."""
        place = next((k for k, s in enumerate(self.sources) if s.name == AVERAGED), None)
        if place is None:
            return np.zeros(sources.shape[1], dtype=np.int64)
        ends = np.cumsum([w.weight for w in self.ways])
        return np.asarray(np.minimum(np.searchsorted(ends, sources[place]), len(self.ways) - 1))

    @cached_property
    def means(self) -> Array:
        """Means (sources,) of the sources."""
        return np.array([s.law.mean for s in self.sources])

    @cached_property
    def sizes(self) -> Array:
        """Standard deviations (sources,) of the sources."""
        return np.sqrt([s.law.variance for s in self.sources])

    def numbers(self, seed: int, first: int, members: int) -> Array:
        """Return the numbers (sources, members) between 0 and 1 of some members, independent of each other; see `uniforms`. [-]"""
        return np.array([uniforms(seed, s.name, first, members) for s in self.sources]).reshape(len(self.sources), members)

    def drawn(self, numbers: Array) -> Array:
        """Return the values (sources, members) of the sources at numbers (sources, members) in (0, 1), each by the quantiles of its law.

        Sources that are alike are joined by a Gaussian copula with the correlations `alike`.
        """
        from scipy.special import ndtr, ndtri

        if (self.alike != np.eye(len(self.sources))).any():
            joined = np.flatnonzero((self.alike != np.eye(len(self.sources))).any(axis=0))
            root: Array = np.linalg.cholesky(self.alike[np.ix_(joined, joined)]).astype(float)
            numbers = numbers.copy()
            numbers[joined] = ndtr(combined(root, ndtri(numbers[joined])))
        return np.array([s.law.at(row) for s, row in zip(self.sources, numbers, strict=True)]).reshape(numbers.shape)

    def members(self, seed: int, first: int, count: int) -> dict[Target, Array]:
        """Return target -> deviation of every member (members,), in the target's form."""
        moved = combined(self.gain, self.drawn(self.numbers(seed, first, count)))
        return dict(zip(self.targets, moved, strict=True))

    def parts(self, columns: Array) -> dict[str, Array]:
        """Return cause -> variance (times,) that its sources bring. [K^2]

        Correlation counts among the sources of one cause; that between two causes is in neither.

        Parameters
        ----------
        columns : array (times, sources)    Change of the temperature per unit of each source, before its standard deviation is applied.
        """
        sized = columns * self.sizes
        out = {}
        for cause in dict.fromkeys(self.causes):
            columns_of_cause = [k for k, c in enumerate(self.causes) if c == cause]
            out[cause] = quadratic_forms(sized[:, columns_of_cause], self.alike[np.ix_(columns_of_cause, columns_of_cause)])
        return out

    def shifts(self, columns: Array) -> dict[str, Array]:
        """Return cause -> what the means of its sources do (times,), of causes with some; `columns` as in `parts`. [K]"""
        means = {cause: np.where([c == cause for c in self.causes], self.means, 0.0) for cause in dict.fromkeys(self.causes)}
        return {cause: np.asarray(columns @ m) for cause, m in means.items() if m.any()}

    def beside(self, sources: Sequence[Source], cause: str, targets: Sequence[Target] = (), gain: Array | float = 0.0) -> Budget:
        """Return the budget with independent sources of one cause that act on `targets` of their own by `gain` (targets, sources).

        The gain is in the unit of the target, or its logarithm, per unit of the source.
        """
        n, m, k = len(self.sources), len(self.targets), len(sources)
        taken = {s.name for s in self.sources}  # a member's numbers come by a source's name
        sources = [replace(s, name=f"{s.name} ({n + i})") if s.name in taken else s for i, s in enumerate(sources)]
        whole, joined = np.zeros((m + len(targets), n + k)), np.eye(n + k)
        whole[:m, :n], whole[m:, n:], joined[:n, :n] = self.gain, gain, self.alike
        named, causes = (*self.sources, *sources), (*self.causes, *(cause,) * k)
        return replace(self, sources=named, causes=causes, alike=joined, targets=(*self.targets, *targets), gain=whole)

    def below(self, errors: Sequence[ErrorModel]) -> Budget:
        """Return it with those sources alone that act on values which no fit has seen; all others are in the fits' models of error.

        So are the errors of the values that a fit has seen, but for what they follow of stated ranges.
        """
        fitted_names = {n for e in errors for n in e.seen}
        held = [k for k, t in enumerate(self.targets) if t.name not in fitted_names]
        columns = np.flatnonzero(self.gain[held].any(axis=0)).tolist()
        sources, causes = tuple(self.sources[k] for k in columns), (BandCause.VALUES,) * len(columns)
        told = [[k not in held and not s.name.startswith(RANGE_OF) for s in sources] for k in range(len(self.targets))]
        gain = np.where(np.reshape(told, (len(self.targets), len(columns))), 0.0, self.gain[:, columns])
        return replace(self, sources=sources, causes=causes, alike=np.eye(len(columns)), gain=gain)

    def with_elements(self, errors: Sequence[ErrorModel], network: Network, as_logged: bool) -> Budget:
        """Return it with what fits leave open of their values and of the elements of a network, whose noise is no source of its own then.

        Parameters
        ----------
        errors : sequence of ErrorModel     Those that follow elements.
        network : Network                   That of the scenario.
        as_logged : bool                    Whether the rooms and powers of the scenario are what instruments read; else they are what acts.
        """
        out = self
        for e in errors:
            size, most = len(e.seen), max(len(w.places) for w in e.ways)
            numbered = [
                Source(f"errors of {e.stage}: {k}", "data" if k < size else "structural", Normal(), BandCause.VALUES) for k in range(most)
            ]
            sure = Source(f"{EXPECTED_OF}{e.stage}", "structural", Normal(1.0, 0.0), "where elements are expected")
            columns = dict.fromkeys(c.name for w in e.ways for c in w.columns)
            out = out.beside(numbered[:size], BandCause.VALUES)
            out = out.beside([*numbered[size:], sure], BandCause.STRUCTURE, [Target(n, "heat") for n in columns])
        target_names = {t.name for t in out.targets}
        driven = {*self.scenario.boundaries, *(f"scale.{n}" for n in self.scenario.loads)} if as_logged else set()
        acting = dict.fromkeys(n for e in errors for v in e.seen.values() for n, _, _ in v.acts if n in driven - target_names)
        out = out.beside([], BandCause.VALUES, [Target(n, "add") for n in acting], np.zeros((len(acting), 0)))
        for cause, name in _departures_of_run(errors, network, self.scenario, as_logged):
            room = name.removesuffix(" wanders 0")  # what it is off by at the beginning: what starts at its temperature is too
            begins = [Target(room, "add")] if room in network.boundaries else []
            wander = errors[0].sizes["unlogged" if isinstance(self.scenario.boundaries.get(room, Constant(0.0)), Constant) else "room"]
            gains = np.array([[1.0], [wander]])[: 1 + len(begins)]
            out = out.beside([Source(name, "structural", Normal(), name)], cause, [Target(name, "heat"), *begins], gains)
        elements = {c.source for e in errors for w in e.ways for c in w.columns} or {*network.nodes}
        places = [Target(n, "node") for n in network.nodes if n in elements]
        sources = [Source(f"left over at {t.name}", "misfit", Normal(), BandCause.UNEXPLAINED) for t in places]
        out = out.beside(sources, BandCause.UNEXPLAINED, places, np.eye(len(places)))
        several = _together(errors, network)
        if len(several) > 1:
            patterns = {tuple(map(as_built, kept)) for kept in several}
            cause = AVERAGED if len(patterns) < len(several) else BandCause.STRUCTURE  # whether elements depart is no carrier of heat
            out = out.beside([Source(AVERAGED, "structural", Uniform(0.0, 1.0), "what carries the heat of surfaces")], cause)
        ways = [out._way([*zip(errors, kept, strict=True)]) for kept in several]
        whole = sum(w.weight for w in ways)
        ways = [replace(w, weight=w.weight / whole) for w in ways]
        loose = {n: e.seen[n] for e in errors for n in e.open_values if n in target_names}
        return replace(out, ways=tuple(ways), gain=max(ways, key=lambda w: w.weight).gain.copy(), loose=loose)

    def _way(self, several: Sequence[tuple[ErrorModel, KeptWay]]) -> BudgetWay:
        """Return a way of carrying heat, from that of every model of error: its probability, means, and gain (targets, sources)."""
        gain, at = self.gain.copy(), dict[str, float]()
        place = {s.name: k for k, s in enumerate(self.sources)}
        for e, way in several:
            unknown, begin, end = way.places, place[f"errors of {e.stage}: 0"], place[f"{EXPECTED_OF}{e.stage}"]
            acts = {n: (v, factor, offset) for v, one in e.seen.items() for n, factor, offset in one.acts}
            for row, t in zip(gain, self.targets, strict=True):
                name, factor, offset = acts.get(t.name, (t.name, 1.0, 0.0))
                if name in unknown and t.form != "node":
                    row[begin : begin + len(unknown)] = factor * way.root[unknown[name]]
                    row[end] = factor * way.mean[unknown[name]]
                if name in e.seen:
                    at |= {n: offset + factor * e.seen[name].si(way.values[name]) for n in (t.name, *t.also)}
                if t.form == "node" and (not way.columns or any(c.source == t.name for c in way.columns)):
                    row[place[f"left over at {t.name}"]] = way.left_over
        return BudgetWay(float(np.prod([w.weight for _, w in several])), tuple(w for _, w in several), at, gain)

    def with_stated(self, spreads: Sequence[Spread | Groups]) -> Budget:
        """Return it with sources for stated spreads; a value with two spreads is refused."""
        names = [n for s in spreads for n in _names(s)]
        if not names:
            return self
        ready = prepare(self.model, lasting(self.scenario), tuple(dict.fromkeys(names)))
        # refuse the spread of a deck's power where the scenario gives that power
        driven = {f"{path}.power": load for load in self.scenario.loads for path in (load, self.model.canonical(load))}
        still = next((n for n in names if n in driven or self.model.canonical(n) in driven), "")
        if still:
            load = driven.get(still, driven.get(self.model.canonical(still), ""))
            raise IdentificationError(
                f"the scenario gives the power of '{load}', so a spread of the deck's '{still}' has no effect. Spread 'scale.{load}' in "
                "per cent.",
                self.model.title,
                code="value.without-effect",
            )
        # parameter -> the cause that spreads it first
        acting = [(t, row) for t, row in zip(self.targets, self.gain, strict=True) if t.form in ("add", "log", "factor") and row.any()]
        first = {t: self.causes[int(np.flatnonzero(row)[0])] for t, row in acting}
        owners = {ready.canonical(n): cause for t, cause in first.items() for n in (t.name, *t.also)}
        out = self
        for s in spreads:
            cause = s.cause if isinstance(s, Spread) else "stated"
            for name in map(ready.canonical, _names(s)):
                if name in owners:
                    raise IdentificationError(
                        f"'{name}' has two spreads, by {owners[name]} and by {cause}. Leave one out.",
                        ready.title,
                        code="value.excludes-another",
                    )
                owners[name] = cause
            out = out._joint(s, ready) if isinstance(s, Spread) else out._single(s, ready)
        return out

    def _single(self, groups: Groups, ready: Simulator) -> Budget:
        """Return it with an independent source for each stated spread."""
        out = self
        for names, how in groups:
            first, *also = map(ready.canonical, names)
            out = out._with_assumed(first, tuple(also), ready.law(first, how), ready, ("stated", f"the stated spread of {first}"))
        return out

    def _with_assumed(
        self, name: str, also: tuple[str, ...], law: Distribution, ready: Simulator, cause: tuple[str, str], by_log: bool = False
    ) -> Budget:
        """Return it with the law of a value that no fit moved: readings narrow it, and what was fitted beside it follows.

        `cause` is what a reader is told, of all such values and of this one.
        """
        nominal = ready.nominal[name]
        law = cut(narrowed(law, nominal, self.said.get(name)), ready.bounds(name), name)
        again = [self.followed[n] for n in (name, *also) if n in self.followed]
        # by its logarithm, so that what the fit would have found with another value compensates all of it and not to first order
        positive = (by_log or bool(again)) and nominal > 0.0 and float(law.at(np.array([MEMBER_TAIL_SHARE]))[0]) > MIN_LOG_SHARE * nominal
        spread_law: Distribution = Logarithm(law, nominal) if positive else Shifted(law, -nominal)
        target = Target(name, "log" if positive else "add", also)
        out = self.beside([Source(name, "stated", spread_law, cause[1])], cause[0], [target], 1.0)
        for fitted, moved in ((f, m) for dependents in again for f, m in dependents.items()):
            row = next((k for k, t in enumerate(out.targets) if t.name == fitted and t.form in ("add", "log")), None)
            if row is not None:
                out.gain[row, -1] += moved * (nominal if positive else 1.0)
        return out

    def with_ranges(self, values: Sequence[RangedValue]) -> Budget:
        """Return it with what a deck knows within a stated range; surfaces of one finish go together until readings tell them.

        Where a fit below answered to a range already, the value itself joins that source.
        """
        if not values:
            return self
        ready = prepare(self.model, lasting(self.scenario), tuple(p for r in values for p in (r.path, *r.also)))
        out, fresh = self, list[RangedValue]()
        place = {s.name: k for k, s in enumerate(self.sources)}
        for r in values:
            nominal = ready.nominal[r.path]
            law = r.law(nominal)
            if not any(s.name in place for s, _ in r.columns):
                out = out._with_assumed(r.path, r.also, law, ready, (STATED_RANGES, r.words), by_log=isinstance(law, LogNormal))
                fresh.append(r)
                continue
            has_log = isinstance(law, LogNormal)
            missing = [s for s, _ in r.columns if s.name not in place]
            out = out.beside(missing, STATED_RANGES, [Target(r.path, "log" if has_log else "add", r.also)])
            at = {s.name: k for k, s in enumerate(out.sources)}
            for source, share in r.columns:
                out.gain[-1, at[source.name]] = share * r.sd_left(nominal, self.said) / (nominal if has_log else 1.0)
        alike, names = out.alike.copy(), [r.stated.name if r.path not in self.said else r.path for r in fresh]
        columns = {s.name: k for k, s in enumerate(out.sources)}
        for (i, a), (j, b) in product(enumerate(fresh), repeat=2):
            if i != j and names[i] and names[i] == names[j]:
                alike[columns[a.path], columns[b.path]] = a.stated.alike
        return replace(out, alike=alike)

    def _joint(self, spread: Spread, ready: Simulator) -> Budget:
        """Return it with the sources of values that are spread together, by their covariance."""
        sources, matrix = normal_sources(spread.cause, spread.covariance, "stated")
        targets = [
            Target(ready.canonical(n), "log" if log else "add", tuple(map(ready.canonical, spread.also.get(n, ()))))
            for n, log in zip(spread.names, spread.log, strict=True)
        ]
        return self.beside(sources, spread.cause, targets, matrix)

    def without(self, names: Sequence[str]) -> Budget:
        """Return the budget without some sources, named by kind, cause or name."""
        columns = [k for k, s in enumerate(self.sources) if not {s.kind, self.causes[k], s.name} & {*names}]
        first = [k for k in columns if k < max((w.gain.shape[1] for w in self.ways), default=0)]
        acting = [k for k, row in enumerate(self.gain[:, columns]) if row.any() or self.ways]
        return replace(
            self,
            sources=tuple(self.sources[k] for k in columns),
            causes=tuple(self.causes[k] for k in columns),
            alike=self.alike[np.ix_(columns, columns)],
            targets=tuple(self.targets[k] for k in acting),
            gain=self.gain[np.ix_(acting, columns)],
            ways=tuple(replace(w, gain=w.gain[:, first]) for w in self.ways),
        )


def _departures_of_run(errors: Sequence[ErrorModel], network: Network, scenario: Scenario, as_logged: bool) -> list[tuple[str, str]]:
    """Return cause and name of what a run may have for itself: its elements, powers that nobody states, rooms that are logged."""
    with_departures = {c.source for e in errors for w in e.ways for c in w.columns} | {
        p for e in errors for w in e.ways for p in w.departures.smooth
    }
    loads = [x for x in network.flat.loads if x.node in with_departures and (as_logged or x.path not in scenario.loads)]
    paths = [*(c.path for c in network.flat.conductors), *network.nodes]
    out = [(BandCause.RUN, f"{p} in this run") for p in (*(p for p in paths if p in with_departures), *(x.path for x in loads))]
    return out + [(BandCause.ROOM, f"{b} wanders {k}") for b in (network.boundaries if as_logged else ()) for k in range(ROOM_HATS)]


def combined(weights: Array, rows: Array) -> Array:
    """Return ``weights @ rows`` (targets, members), weights (targets, sources), rows (sources, members).

    Summed source by source: a matrix product rounds differently for another number of members, and a member shall not depend on how many
    there are. Members lie side by side, the first one twice, since `einsum` sums along what lies closest.
    """
    used = np.flatnonzero(weights.any(axis=0))
    several = np.ascontiguousarray(np.column_stack([rows[used], rows[used, :1]]))
    return np.asarray(np.einsum("ts,sm->tm", np.ascontiguousarray(weights[:, used]), several)[:, : rows.shape[1]])


@takes_objects
def budget_of(
    source_of_values: Model | Calibration | Knowledge | FittedValues | Sequence[Any],
    scenario: Scenario,
    stated: Stated | Sequence[Stated] = (),
    *,
    without: Sequence[str] = (),
    as_logged: bool = False,
) -> Budget:
    """Uncertainty budget of a scenario: every source, and how the inputs of the model respond to it.

    Parameters
    ----------
    source_of_values : Model, Calibration, Knowledge, or fitted values  What is known.
    scenario : Scenario     What is done to the model.
    stated : dict, Spread, or several   What else is not known exactly: name or pattern of parameters -> spread as text; see `read_spread`.
    without : sequence      Sources that are not counted: kinds (``structural``, ``misfit``), causes or names; the result states this.
    as_logged : bool        Whether rooms and powers of the scenario are what instruments of a fit read; else they are what acts.

    Raises
    ------
    IdentificationError   When a value is spread twice, or has no finite error; when a coefficient that must be separated cannot be.
    ScenarioError         When `without` names no kind, cause or source.
    """
    source = known_of(source_of_values)
    statements: list[Any] = list(stated) if isinstance(stated, list | tuple) else [stated]
    for one in statements:
        if not isinstance(one, Mapping | Spread):
            raise IdentificationError(
                f"a spread is a dictionary, {{'air': '1 [K]'}}, not {one!r:.60}.", source.model.title, code="value.wrong-kind"
            )
    plain: list[Spread | Groups] = [expanded(s, source.model) if isinstance(s, Mapping) else s for s in statements]
    rows = rows_of(source)
    errors = source.errors if not {*ELEMENTS} & {*without} else ()
    lawful = {p for e in errors for w in e.ways for p in w.laws}  # what of such a surface is radiation stands in its law
    split_model, rows = split_rows(source, rows, scenario, [n for s in plain for n in _names(s)], lawful)
    rows, idle = rows.without({*map(split_model.canonical, scenario.schedule)})
    make = Budget.of_rows(rows, split_model, scenario)
    run = scenario if scenario.seconds else lasting(scenario)
    network = network_for(split_model, run)
    if errors:
        make = make.below(errors).with_elements(errors, network, as_logged)
    contacts, remark = open_contacts(source, rows, scenario)
    for path, gas in contacts.items():
        also = next((t.also for t in make.targets if t.name == path), ())
        make = make.beside([gas], GAS_IN_JOINTS, [Target(path, "factor", also)], 1.0)
    make = replace(make, followed=followed_by(source.discrepancies), said=told_first(k.of_assumed for k in source.discrepancies))
    make = make.with_stated(plain)
    unseen = UNSEEN if split_model.runner is not None else ""
    unsought = UNSOUGHT if source.fit is not None and asks(source.fit) else ""
    make = make.with_ranges(open_ranges(split_model, scenario, {*source.assigned, *make.spread, *_of_laws(make)}))
    driven = (
        f"the scenario's schedule gives {quoted(idle)}: what was fitted of it does not act, and its error is not counted" if idle else ""
    )
    never = never_logged(source.discrepancies, network, run)
    whole = replace(make, remarks=tuple(r for r in (never, unseen, unsought, remark, kept_as_solid(source, rows, scenario), driven) if r))
    names = [*dict.fromkeys((*CAUSES, *(s.name for s in whole.sources), *whole.causes))]
    words = f"'{{}}' is no source of errors.{{near}} Kinds are {', '.join(get_args(Kind))}; the table of a prediction names the causes."
    refuse_unknown(without, names, f"{source.model.title}, without", words, ScenarioError)
    omitted = left_out_of(source, whole, errors, without)
    return replace(whole.without(without), omitted=omitted, standing=source.standing)


def _of_laws(budget: Budget) -> set[str]:
    """Return the emissivities that laws of elements count, as the share of radiation in a coefficient."""
    lawful = {p for way in budget.ways for kept_way in way.kept for p in kept_way.laws}
    flat = compile_network(budget.model).flat
    stated = [c.emissivity for c in flat.conductors if c.path in lawful and c.emissivity]
    return {name for e in stated for name in (e, flat.parameters.literal_behind(e))}


def open_ranges(model: Model, scenario: Scenario, elsewhere: Collection[str]) -> list[RangedValue]:
    """Return what only a stated range tells of the values that act in a scenario; not those that are told `elsewhere`.

    The emissivity behind an effective coefficient acts where its gas is not air alone, or where another surface radiates with it.
    """
    network = compile_network(model, prescribed=tuple(scenario.prescribed))
    media, deck = scenario.media(), network.flat.parameters
    behind = [c for c in network.flat.conductors if c.emissivity]
    acting = {c.emissivity for c in behind if media.changed(c.gas) and not media.as_printed}
    acting |= {path for c in network.flat.conductors for field, path in c.fields.items() if field.startswith("emissivity")}
    idle = {deck.literal_behind(c.emissivity) for c in behind} - {*map(deck.literal_behind, acting)}
    taken = {*elsewhere, *idle, *scenario.driven(network.flat)}
    return RangedValue.of_fit(model, deck, taken)


def _names(stated: Spread | Groups) -> list[str]:
    """Return every name that a stated spread moves, instances that share a value among them."""
    if isinstance(stated, Spread):
        return [n for name in stated.names for n in (name, *stated.also.get(name, ()))]
    return [n for names, _ in stated for n in names]


def left_out_of(knowledge: Knowledge, whole: Budget, errors: Sequence[ErrorModel], without: Sequence[str]) -> tuple[LeftOut, ...]:
    """Return what the budget of a question leaves out by what is known, and what the caller switched off."""
    out = []
    off = dict.fromkeys(c for s, c in zip(whole.sources, whole.causes, strict=True) if {s.kind, c, s.name} & {*without})
    off |= {BandCause.STRUCTURE: None} if {*ELEMENTS} & {*without} and knowledge.values else {}
    if off:
        out.append(LeftOut(f"{', '.join(off)} {OFF}"))
    elif knowledge.values and (not errors or any(e.why for e in errors)):
        why = next((f"how elements depart from their laws, because {e.why.rstrip('.')}" for e in errors if e.why), SILENT)
        out.append(LeftOut(why))
    aside = max((w.departures.aside for e in errors for w in e.ways), default=0)
    out += [LeftOut(f"how {aside} elements with little heat depart from their laws", listed=True)] if aside else []
    against = (f"what is wrong where {e.contradiction}: {WRONG}" for e in errors if e.contradiction)
    out += [LeftOut(CodedText(words, CONTRADICTED)) for words in against]
    out += [x for s in knowledge.stores for x in s.left_out]
    fitted = [s for store in knowledge.stores for s in store.parameters.values() if s.origin.kind == "fit" and s.acts]
    if not knowledge.values:
        out.append(LeftOut(UNFITTED))
    once = [s.acts[0] for s in fitted if len({r for o in (s.origin, *s.history) for r in o.records}) == 1]
    if once:
        out.append(LeftOut(f"how values fitted to one record differ from one test to the next ({quoted(once, 3)})", listed=True))
    spread, find, scenario = whole.spread, whole.model.canonical, whole.scenario
    inputs = [b for b in scenario.boundaries if find(b) not in spread]
    inputs += [x for x in scenario.loads if not {f"scale.{find(x)}", f"{find(x)}.power"} & spread]
    inputs += ["start"] if scenario.start and not any(n.startswith("initial.") for n in spread) else []
    if inputs:
        out.append(LeftOut(f"inputs without a stated spread ({quoted(inputs, 3)})", listed=True))
    known = spread | {p for s in fitted for p in s.acts}
    held = {p: e.parameter for p, e in whole.model.parameter_table().items() if p not in known}
    measured = bracketed(held, ("measured",))
    return (*out, *([LeftOut(without_spread(measured, "measured"), listed=True)] if measured else []))


def in_order(left_out: Iterable[LeftOut]) -> tuple[LeftOut, ...]:
    """Return what is left out with what a first line may name before what only the list has."""
    return tuple(sorted(left_out, key=lambda x: x.listed))


@dataclass(frozen=True)
class Assumed:
    """A value that a deck only assumes.

    Parameters
    ----------
    path : str      In the model.
    size : float    Standard deviation: by the range of its deck, or a tenth of itself. [SI]
    ranged : bool   Whether its deck gives a range.
    """

    path: str
    size: float
    ranged: bool


def assumed_values(model: Model, scenario: Scenario, taken: Collection[str]) -> list[Assumed]:
    """Return the values with source `assumed` that act in a scenario, each with its standard deviation.

    A range in the deck counts as a uniform distribution: ``(max - min) / sqrt(12)``. Without one it is a tenth of the value. Values of
    zero, values that the scenario drives and those in `taken` are left out.
    """
    table = model.parameter_table()
    network = compile_network(model, media=scenario.media(), prescribed=tuple(scenario.prescribed))
    moved = scenario.driven(network.flat)
    loose = [p for p, e in table.items() if e.parameter.source == "assumed" and e.parameter.is_literal and p not in moved]
    numbers = network.numbers().values
    out = []
    for p in (p for p in loose if p not in taken and value_of(numbers[p])):
        low, high = table[p].parameter.minimum, table[p].parameter.maximum
        wide = high - low if low is not None and high is not None else np.inf
        ranged = bool(np.isfinite(wide))
        out.append(Assumed(p, wide / 12**0.5 if ranged else ASSUMED_SD_SHARE * abs(float(value_of(numbers[p]))), ranged))
    return out


def assumed_left_out(budget: Budget, nodes: Sequence[str] | None = None) -> tuple[tuple[LeftOut, Mapping[str, float]], ...]:
    """Return the assumed values of decks that nothing spreads, as one entry with all of them, or nothing where there are none.

    The entry has the sentence on them with the largest of its effects, and node -> root of the sum over values of (dT/dp sd)^2, dT/dp of
    the settled state with the fit solved again, sd that of its default spread, cut to what is said of it. [K] Without effects where
    nothing settles.
    """
    spread = budget.spread
    spread |= {f"{n.removeprefix('scale.')}.power" for n in spread if n.startswith("scale.")}
    spread |= {f"{budget.model.canonical(load)}.power" for load in budget.scenario.loads}
    spread |= _of_laws(budget)
    loose = assumed_values(budget.model, budget.scenario, spread)
    if not loose:
        return ()
    words = without_spread([a.path for a in loose])
    through = _solved_again(budget, [a.path for a in loose])
    ready = prepare(budget.model, lasting(budget.scenario), list(dict.fromkeys([*(a.path for a in loose), *through])))
    try:
        _, slopes = ready.settled()
    except SolverError:
        return ((LeftOut(words), {}),)
    place = {name: k for k, name in enumerate(ready.free)}
    moved = np.zeros((len(place), len(loose)))
    sizes = [narrowed(Normal(0.0, a.size), 0.0, budget.said.get(a.path)).variance ** 0.5 for a in loose]
    for k, (a, size) in enumerate(zip(loose, sizes, strict=True)):
        moved[place[a.path], k] += size
        for name, by in through.items():
            moved[place[name], k] += by.get(a.path, 0.0) * size
    chosen_nodes = nodes if nodes is not None else [n for n in slopes if n not in ready.wiring.network.boundaries]
    effects_of_node = {n: slopes[n] @ moved for n in chosen_nodes if n in slopes}
    effect = {n: float(np.linalg.norm(x)) for n, x in effects_of_node.items()}
    worst = max(effect, key=effect.__getitem__, default="")
    if worst and effect[worst] > 0.0 and len(loose) > 1:
        words += f"; {_costliest_words([a.path for a in loose], effects_of_node[worst])}"
    return ((LeftOut(words, max(effect.values(), default=0.0)), effect),)


def _solved_again(budget: Budget, paths: Sequence[str]) -> dict[str, dict[str, float]]:
    """Return fitted value -> assumed value -> derivative of the fitted one by the assumed one, the fit solved again. [SI per SI]"""
    network = compile_network(budget.model, prescribed=tuple(budget.scenario.prescribed))
    fixed = budget.scenario.driven(network.flat)
    forms = {t.name: t.form for t in budget.targets if t.form in ("add", "log") and t.name not in fixed}
    numbers = network.numbers().values
    out: dict[str, dict[str, float]] = {}
    for path in paths:
        for name, moved in budget.followed.get(path, {}).items():
            if name in forms and name in numbers:
                out.setdefault(name, {})[path] = moved * (float(value_of(numbers[name])) if forms[name] == "log" else 1.0)
    return out


def _costliest_words(paths: Sequence[str], effects: Array) -> str:
    """Return which assumption has the largest of `effects` (paths,) [K], and which to measure to halve their root sum of squares."""
    order = np.argsort(-np.abs(effects))
    remaining, named = float(effects @ effects), []
    for k in order:
        named.append(f"'{paths[k]}'")
        remaining -= float(effects[k] ** 2)
        if remaining <= 0.25 * float(effects @ effects):
            break
    first = f"{named[0]} costs most ({abs(float(effects[order[0]])):.2g} K)"
    several = named[0] if len(named) == 1 else f"{', '.join(named[:-1])} and {named[-1]}"
    return f"{first}; measuring {'it' if len(named) == 1 else several} would more than halve what these values add"


def first_line(left_out: Sequence[LeftOut], error: float) -> str:
    """Return what a reader must know first of an answer: what it does not count and might matter; empty where nothing is.

    Parameters
    ----------
    left_out : sequence
    error : float   Standard error of the answer, the largest of several. [K]
    """
    relevant = [x for x in left_out if not x.listed and not x.kelvin <= MIN_SHARE_OF_BAND * 1.96 * error]
    words = [f"{x.what}, up to {x.kelvin:.2g} K" if np.isfinite(x.kelvin) else x.what for x in relevant]
    return f"not counted: {'; '.join(words)}" if words else ""
