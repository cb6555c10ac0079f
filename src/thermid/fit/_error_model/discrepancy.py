"""What a fit leaves open of surfaces, joints and assumed values: where coefficients were found, and what a fit would find with others.

Assumed values are consider parameters (Tapley, Schutz and Born, Statistical Orbit Determination, Elsevier 2004, section 6.2): not looked
for, but not known to be right; the fit's own response to them is counted.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np

from thermid.base.errors import IdentificationError
from thermid.base.linear_algebra import covariance, pseudo_inverse
from thermid.base.results import Result
from thermid.base.units import Array, counted, from_si, short, unit, value_of
from thermid.fit._calibration import Calibration
from thermid.fit._error_model.courses import (
    ElementCourse,
    OperatingPoint,
    coefficient_path,
    constant_coefficients,
    course_of,
    laws_of,
    point_of,
)
from thermid.fit._error_model.own_values import OWN_VALUES, own_values_of
from thermid.fit._minimisation import Fit, covariances, finite
from thermid.fit._problem.request import Request, known_before
from thermid.fit._problem.residuals import Bench, Influence, Problem, Unknown
from thermid.fit._uncertainty.information import Opened, opened_jacobian
from thermid.fit._uncertainty.noise import Autocorrelation, Binned, score_excess
from thermid.model.tree import FlatConductor, identity_of
from thermid.physics.gas import GASES, REFERENCE
from thermid.simulation.runs import Media, Network
from thermid.values.store import FittedValues, RangedValue, Source

MIN_CONTACT_GAP: Final = 10e-6
"""Effective distance of machined surfaces that touch, from which the most that gas can carry follows. Yovanovich has 1.53 s (P/H)^-0.097,
3 to 15 micrometres for roughness s of 1 to 5 (Bejan and Kraus, Heat Transfer Handbook, 2003, section 4.16). [m]"""
MAX_GAS_CONDUCTANCE: Final = float(GASES["air"].k(REFERENCE)) / MIN_CONTACT_GAP
"""The most that gas between faces can carry. [W/(m^2 K)]"""


def contacts_in_other_gas(network: Network, media: Sequence[Media]) -> tuple[str, ...]:
    """Return the contacts whose gas is another one, or has another pressure, than air on the ground in some of the states.

    Of those whose deck does not say what of them is gas, by a gap or gas = "none": spots and gas in one conductance.
    """
    bare = (c for c in network.flat.conductors if c.kind == "contact" and not {"gap", "gas"} & {*c.fields, *c.words})
    several = (c for c in bare if "contact_conductance" in c.fields)
    return tuple(c.path for c in several if any(m.changed(g) for m in media for g in _gases(network, c)))


def _gases(network: Network, joint: FlatConductor) -> list[str]:
    """Return the gases about the parts that a joint holds together; every gas of the model where these have no surface."""
    skins = [c for c in network.flat.conductors if c.kind in ("convection", "effective")]
    parts = {end for c in network.flat.conductors if c.kind == "contact" and set(c.ends) & set(joint.ends) for end in c.ends}
    near = [c.gas for c in skins if set(c.ends) & parts]
    return list(dict.fromkeys(near or [c.gas for c in skins] or network.boundaries))


STRUCTURAL_KEY = "structural"
"""Where the provenance of fitted values keeps it."""


@dataclass(frozen=True, eq=False)
class Discrepancy(Result):
    """What a fit leaves open in its model's structure; kept with its values, so that a file says what the fit does.

    Parameters
    ----------
    conditions : dict               Path of a coefficient's conductor -> where it was found.
    names : tuple of str            Fitted values.
    surfaces : dict                 Path of a conductor -> mean temperatures of its surface and gas over the records. [K]
    separated : tuple of str        Contacts of which some record had another gas, or another pressure of it, than air on the ground.
    assumed : dict                  Assumed value of a deck -> what the fit would have found for one more of its SI unit, less what it
                                    found (names,); fitted form.
    of_assumed : dict               Assumed value of a deck -> variance that the readings alone leave it with all else open, and how far
                                    from the deck's they ask it to be; SI units. Without an entry they say nothing.
    scheduled : dict                Value that some record schedules, such as a fan's speed -> its lowest and highest over the records. [SI]
    """

    conditions: Mapping[str, OperatingPoint]
    names: tuple[str, ...]
    surfaces: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    separated: tuple[str, ...] = ()
    assumed: Mapping[str, Array] = field(default_factory=dict)
    of_assumed: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    scheduled: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """Return plain numbers and texts for a file."""
        return {
            "conditions": {p: [c.difference, c.level] for p, c in self.conditions.items()},
            "names": list(self.names),
            "surfaces": {p: list(at) for p, at in self.surfaces.items()},
            "separated": list(self.separated),
            "assumed": {p: moved.tolist() for p, moved in self.assumed.items()},
            "of_assumed": {p: list(variance_and_shift) for p, variance_and_shift in self.of_assumed.items()},
            "scheduled": {p: list(ends) for p, ends in self.scheduled.items()},
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Discrepancy:
        """Return the discrepancy that `to_dict` wrote."""
        return cls(
            {p: OperatingPoint(float(d), float(t)) for p, (d, t) in data["conditions"].items()},
            tuple(str(n) for n in data["names"]),
            {p: (float(hot), float(cold)) for p, (hot, cold) in data["surfaces"].items()},
            tuple(data["separated"]),
            {p: np.array(moved, dtype=float) for p, moved in data.get("assumed", {}).items()},
            {p: (float(variance), float(shift)) for p, (variance, shift) in data.get("of_assumed", {}).items()},
            {p: (float(low), float(high)) for p, (low, high) in data.get("scheduled", {}).items()},
        )

    def __str__(self) -> str:
        """Return a line per coefficient: the temperature difference and level at which it was fitted."""
        return "\n".join(f"{p}: found at a difference of {c}" for p, c in self.conditions.items())


@dataclass(frozen=True)
class AssumedMoves:
    """What a fit would find with other values than those that its deck assumes, or has from a catalogue.

    Parameters
    ----------
    moved : dict    Assumed value -> what every unknown (unknowns,) would move by for one more of its SI unit; fitted form.
    said : dict     Assumed value -> variance that the readings leave it with all else open, and how far away they ask it to be. [SI]
    ranges : tuple  Source of each stated range, and what every unknown (unknowns,) moves by for one of its standard deviations.
    better : tuple  In words, fixed values that the readings determine with a smaller error than their stated range.
    """

    moved: Mapping[str, Array] = field(default_factory=dict)
    said: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    ranges: tuple[tuple[Source, Array], ...] = ()
    better: tuple[str, ...] = ()

    @property
    def remarks(self) -> tuple[str, ...]:
        """One remark on fixed values that the readings determine better than their stated spread; empty where there is none."""
        if not self.better:
            return ()
        more = f"; {counted(len(self.better) - MAX_BETTER_SHOWN, 'more value')}" if len(self.better) > MAX_BETTER_SHOWN else ""
        return (
            f"the readings know fixed values better than the spreads that are stated of them: {'; '.join(self.better[:MAX_BETTER_SHOWN])}"
            f"{more}. Add them to free: the stated spread is then the prior.",
        )


def discrepancy(fit: Calibration) -> Discrepancy:
    """Return the model discrepancy of a fit: operating points of coefficients, unseparated joints, effect of assumed values.

    Raises
    ------
    IdentificationError   When the calibration does not hold what its fit left open.
    """
    discrepancy_of_fit = discrepancy_kept(fit.values)
    if discrepancy_of_fit is None:
        raise IdentificationError(
            "this calibration does not include the data on its model discrepancy. Run the fit again.", fit.stage, code="fit.needs-session"
        )
    return discrepancy_of_fit


def discrepancy_kept(values: FittedValues) -> Discrepancy | None:
    """Return the model discrepancy stored with fitted values; None where an older file has none."""
    return kept_in(values.provenance)


def kept_in(provenance: Mapping[str, Any]) -> Discrepancy | None:
    """Return the model discrepancy stored in the provenance of a stage; None where an older file has none."""
    table = provenance.get(STRUCTURAL_KEY)
    return Discrepancy.from_dict(table) if table is not None else None


def with_discrepancy(fit: Calibration, assumed: AssumedMoves) -> Calibration:
    """Return a fit whose provenance keeps what it leaves open: where each coefficient was found, joints, assumed values, misfit.

    Its values and errors stay. `assumed` is what it would find with other assumed values.
    """
    problem = fit.problem
    assert problem is not None
    at = np.array(list(fit.fitted.values()))
    is_same_model = [identity_of(e.model) == identity_of(fit.given_model) for e in problem.experiments]
    histories = [course for course, here in zip(_courses(problem, at), is_same_model, strict=False) if here]
    network = problem.experiments[is_same_model.index(True)].network if any(is_same_model) else problem.experiments[0].network
    surfaces = _constant(network)
    conditions = {p: point for p, c in surfaces.items() if (point := point_of(histories, c)) is not None}
    decided = _decided(problem, list(fit.values.assignments))
    before = fit.request.store.provenance.values() if fit.request is not None else ()
    stored = {p: OperatingPoint(float(d), float(t)) for stage in before for p, (d, t) in stage.get("conditions", {}).items()}
    conditions |= {p: c for p, c in stored.items() if p in conditions and p not in decided}
    place = {u.name: k for k, u in enumerate(problem.unknowns)}
    names = tuple(fit.values)
    misfit = misfit_found(problem, fit.autocorrelation) if fit.autocorrelation is not None else {}
    joints = contacts_in_other_gas(problem.experiments[0].network, [e.scenario.media() for e in problem.experiments])
    moved = {p: moves[[place[n] for n in names]] for p, moves in assumed.moved.items()}
    result = Discrepancy(conditions, names, _surfaces(histories, surfaces), joints, moved, assumed.said, _scheduled(problem.benches()))
    alone = [o.to_dict() for o in own_values_of(fit)]
    points = {p: [c.difference, c.level] for p, c in conditions.items() if p in decided}
    provenance = {**fit.values.provenance, **({"conditions": points} if points else {}), "misfit": misfit, STRUCTURAL_KEY: result.to_dict()}
    provenance |= {OWN_VALUES: alone} if alone else {}
    store = replace(fit.store, provenance={**fit.store.provenance, fit.values.stage: provenance})
    warnings = (*fit.warnings, *assumed.remarks)
    return replace(fit, values=replace(fit.values, provenance=provenance), store=store, warnings=warnings)


def _constant(network: Network) -> dict[str, FlatConductor]:
    """Return the constant coefficients between two places that follow no law."""
    constants = {p: c for p, c in constant_coefficients(network).items() if c.ends[0] != c.ends[1]}
    return {p: c for p, c in constants.items() if [law.form for law in laws_of(network, c)] == ["linear"]}


def _surfaces(courses: Sequence[ElementCourse], several: Mapping[str, FlatConductor]) -> dict[str, tuple[float, float]]:
    """Return conductor -> mean temperatures of its ends over the records, weighted by the square of their difference. [K]"""
    out = {}
    for path, c in several.items():
        first, second = (np.concatenate([np.zeros(0), *(run.kelvin[end] for run in courses if path in run.flows)]) for end in c.ends)
        weight = (first - second) ** 2
        if weight.sum() > 0.0:
            out[path] = (float(weight @ first / weight.sum()), float(weight @ second / weight.sum()))
    return out


def _scheduled(benches: Sequence[Bench]) -> dict[str, tuple[float, float]]:
    """Return value that some record schedules -> its lowest and highest over all records; where none schedules it, its deck's. [SI]"""
    courses = [b.wiring.schedule.signals if b.wiring.schedule is not None else {} for b in benches]
    ends: dict[str, list[float]] = {p: [] for course in courses for p in course}
    for course, b in zip(courses, benches, strict=True) if ends else ():
        decks = b.experiment.network.flat.parameters.evaluate({})
        for path, several in ends.items():
            several += course[path].bounds if path in course else [float(decks[path])] if path in decks else []
    return {p: (min(several), max(several)) for p, several in ends.items()}


def _courses(problem: Problem, at: Array) -> list[ElementCourse]:
    """Return temperatures and flows of the elements of every record; nothing where no model has a constant coefficient."""
    if not any(constant_coefficients(e.network) for e in problem.experiments):
        return []
    return [course_of(b.wiring, b.engine, problem.inputs(i, at)[0], problem.options) for i, b in enumerate(problem.benches())]


def _decided(problem: Problem, paths: Sequence[str]) -> set[str]:
    """Return the conductors whose constant coefficient follows from some parameters."""
    network = problem.experiments[0].network
    touched = set(network.flat.parameters.downstream(paths))
    return {path for path, c in constant_coefficients(network).items() if coefficient_path(c) in touched}


def assumed_moves(request: Request, problem: Problem, minimum: Fit, noise: Autocorrelation) -> AssumedMoves:
    """Return what a fit would find with other assumed values, in the models of all its levels.

    So a spread of an assumed value is solved again: it cancels where the fit pins the answer, and opens where it does not.
    """
    uppermost, several = identity_of(request.model), dict[str, list[int]]()
    for i, e in enumerate(problem.experiments):
        several.setdefault(identity_of(e.model), []).append(i)
    ranges: dict[tuple[str, ...], RangedValue] = {}
    more: dict[str, Unknown] = {}
    for model in sorted(several, key=lambda m: m != uppermost):  # of one source in several levels the name is that of the uppermost
        ranged, opened = _opened_in(request, problem, minimum.fitted, several[model])
        ahead = "" if model == uppermost else f"{model}: "
        for r in ranged:
            key = tuple(s.name for s, _ in r.columns)
            paths = (r.path, *r.also)
            if key in ranges:
                first_name = ranges[key].path
                targets = tuple(t for p in paths for t in opened.pop(p).targets)
                more[first_name] = replace(more[first_name], targets=(*more[first_name].targets, *targets))
            else:
                ranges[key] = replace(r, path=ahead + r.path, also=tuple(ahead + p for p in r.also))
        more |= {ahead + p: replace(u, name=ahead + p) for p, u in opened.items()}
    if not problem.unknowns or not more:
        return AssumedMoves()
    at = minimum.fitted
    wide, wide_at = (
        replace(problem, unknowns=(*problem.unknowns, *more.values()), coupled=()),
        np.append(at, [u.start for u in more.values()]),
    )
    below = told_first(k.of_assumed for table in request.store.provenance.values() if (k := kept_in(table)) is not None)
    residuals, priors = problem.prior_rows(at)
    inherited, pulled = known_before(request, problem.unknowns), np.zeros((len(residuals), len(more)))
    column_of = {s.name: k for k, s in enumerate(inherited.sources)} if inherited.at.size else {}
    for r in ranges.values():
        source, share = r.columns[-1]
        if source.name in column_of:  # what the stages below found beside it, the mean of their prior, moves with it
            moves = inherited.rows[:, column_of[source.name]] / (share * r.sd_left(more[r.path].start, below))
            pulled[-len(inherited.root) :, list(more).index(r.path)] = -inherited.root @ moves
    level, wide_priors = noise.variance_factor, np.concatenate([priors, pulled], axis=1)
    weights = finite(covariances(Fit.ended(problem, at, request.loss), level)[2])
    of_unknowns, of_opened = opened_jacobian(
        Opened(wide, wide_at, at.size), request.loss
    )  # of every reading, as the weights: not of means over stretches
    moved = dict(zip(more, -(weights @ (of_unknowns.T @ of_opened / level + priors.T @ pulled)).T, strict=True))
    of_assumed = _said_of(list(more), residuals, wide_priors, Binned.of_problem(wide, wide_at, request.loss), noise)
    first, columns = told_first([below, of_assumed]), []
    for r in ranges.values():
        move = np.sum([moved[p] for p in (r.path, *r.also)], axis=0) * r.sd_left(more[r.path].start, first)
        columns += [(source, share * move) for source, share in r.columns]
    here = problem.experiments[several[uppermost][0]].network.flat.parameters.table if uppermost in several else {}
    told_here = {p: x for p, x in of_assumed.items() if p in here}
    better = []
    for r in ranges.values():
        u, (variance, shift) = more[r.path], min((of_assumed[p] for p in (r.path, *r.also) if p in of_assumed), default=(np.inf, 0.0))
        stated = r.law(u.start).variance
        if variance < stated:
            value, error, fixed_at, spread = (short(x, 3) for x in (*_shown(u, u.start + shift, variance), *_shown(u, u.start, stated)))
            better.append((variance / stated, f"'{u.name}' {value} +- {error} for {fixed_at} +- {spread} {u.unit}".removesuffix(" 1")))
    return AssumedMoves({p: x for p, x in moved.items() if p in here}, told_here, tuple(columns), tuple(text for _, text in sorted(better)))


def _shown(u: Unknown, value: float, variance: float) -> tuple[float, float]:
    """Return a value [SI] of an unknown and the root of its variance in the unknown's unit."""
    return from_si(value, u.unit), float(variance**0.5 / float(unit(u.unit).factor))


def _opened_in(request: Request, problem: Problem, at: Array, runs: Sequence[int]) -> tuple[list[RangedValue], dict[str, Unknown]]:
    """Return the ranged values of the model of some runs that nothing gives, and path -> unknown for each of them and each assumed value.

    `at` (unknowns,), fitted form, is where the fit stands.
    """
    experiments = [problem.experiments[i] for i in runs]
    network, deck = experiments[0].network, experiments[0].network.flat.parameters
    acting = {t.name: u.to_value(float(x)) for u, x in zip(problem.unknowns, at, strict=True) for t in u.targets if t.experiment in runs}
    taken = {*acting, *(p for s in request.store.states.values() for p in s.acts)}
    taken |= {p for e in experiments for p in e.scenario.driven(e.network.flat)}
    ranged = RangedValue.of_fit(experiments[0].model, deck, taken)
    assumed = (p for p, e in deck.table.items() if e.parameter.source == "assumed" and e.parameter.is_literal and p not in taken)
    paths = dict.fromkeys([*(p for r in ranged for p in (r.path, *r.also)), *assumed])
    values = network.numbers({p: x for p, x in acting.items() if p in deck.table}).values
    units = {p: deck.table[p].parameter.unit or "1" for p in paths}
    everywhere = {p: tuple(Influence(i, p) for i in runs) for p in paths}
    return ranged, {p: Unknown(p, "parameter", everywhere[p], float(value_of(values[p])), unit=units[p]) for p in paths}


def told_first(several: Iterable[Mapping[str, tuple[float, float]]]) -> dict[str, tuple[float, float]]:
    """Return assumed value -> variance and shift by the first of several fits that tells it; see `Discrepancy.of_assumed`.

    A fit above takes for right what those below found beside the value, and would tell it better than it knows.
    """
    out: dict[str, tuple[float, float]] = {}
    for of_assumed in several:
        out = {**of_assumed, **out}
    return out


def _said_of(
    paths: Sequence[str], residuals: Array, priors: Array, pieces: Mapping[tuple[str, str], Binned], noise: Autocorrelation
) -> dict[str, tuple[float, float]]:
    """Return assumed value -> variance that the readings leave it with all else open, and how far away they ask it to be; SI units.

    With the information A = J'J / level + P'P the step is -A^-1 (J'r / level + P'p), its covariance A^-1 + A^-1 B A^-1 / level^2, B what
    autocorrelated noise adds to the scores. Without a word of the deck's range: with other assumed values open too, so that what they can
    only say of several together counts for none of them. Values of which they say nothing are left out.

    Parameters
    ----------
    paths : sequence    The assumed values, the last unknowns.
    residuals, priors   Of the priors of the unknowns, and their derivatives (priors, unknowns). [-]
    """
    level, size = noise.variance_factor, priors.shape[1] - len(paths)
    rows = np.concatenate([*(np.sqrt(b.count / level)[:, None] * b.slopes for b in pieces.values()), priors])
    inverse = pseudo_inverse(rows)  # whole: of what cannot be separated only the values that take no part in it are used below
    excess = score_excess(pieces, noise.traces, level, {})
    variance = np.diag(covariance(rows) + inverse @ excess @ inverse / level**2)
    score = sum((b.slopes.T @ (b.count * b.mean) for b in pieces.values()), np.zeros(rows.shape[1])) / level + priors.T @ residuals
    step = -(inverse @ score)
    return {p: (float(variance[k]), float(step[k])) for k, p in enumerate(paths, size) if np.isfinite(variance[k])}


MAX_BETTER_SHOWN: Final = 3
"""Fixed values that the readings know better of which one remark shows the figures."""
MIN_WANDERING: Final = 1e-6
"""What wanders by less is the end of a search or of a step, not what a model does not follow. [K]"""


def misfit_found(problem: Problem, autocorrelation: Autocorrelation) -> dict[str, float]:
    """Return node -> standard deviation of what wanders in its residuals, over all records; 0 below `MIN_WANDERING`. [K]"""
    slow = {(t.record, t.sensor): t.correlated_variance for t in autocorrelation.traces}
    parts: dict[str, list[float]] = {}
    for e in problem.experiments:
        for o in e.observations:
            parts.setdefault(o.seat, []).append(slow.get((e.record.name, o.sensor), 0.0) * o.sigma(problem.noise) ** 2)
    sizes = {n: float(np.sqrt(np.mean(several))) for n, several in parts.items()}
    return {n: size if size >= MIN_WANDERING else 0.0 for n, size in sizes.items()}
