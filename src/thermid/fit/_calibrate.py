"""`calibrate`: records and free names in, a `Calibration` out, or a refusal; the standing of a fit, and the store of what it found."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import version
from itertools import combinations
from typing import Any

import numpy as np

from thermid.base.errors import CodedText, IdentificationError, SolverError, code_of, quoted
from thermid.base.linear_algebra import null_space, one_thread, symmetric_inverse
from thermid.base.units import HALF_WIDTH_95, Array, counted, short, si_unit, some, unit
from thermid.fit._calibration import (
    FIRST,
    LOUD,
    MISFIT,
    QUESTIONED_FACTOR,
    Calibration,
    FitEnd,
    Local,
    contradicted,
    contradicted_powers,
    far_from_sheet,
    fitted_values,
)
from thermid.fit._error_model.discrepancy import assumed_moves, with_discrepancy
from thermid.fit._error_model.kept import ERRORS_KEY, ErrorsOfFit, Keeping, with_structural_errors
from thermid.fit._error_model.sizes import OUTSIDE
from thermid.fit._inputs import InputTable
from thermid.fit._minimisation import Fit, KeptFit, covariances, minimise
from thermid.fit._problem.experiment import CHANCE_DEVIATIONS, LEAST_NOISE, STEPPED, UNSAID_NOISE, role_and_target, signal_of
from thermid.fit._problem.gather import build_problem
from thermid.fit._problem.request import LocalSpec, Request, counted_twice, freed, mean_of, priors_of
from thermid.fit._problem.residuals import Bench, Predictions, Problem, Unknown, pooled, starting_point, wanders
from thermid.fit._search import CHANCE, Progress, at_clocks, in_turns, searched, widened_by_noise_of_powers, with_clocks
from thermid.fit._uncertainty.groups import SHARE, Group, percent, together
from thermid.fit._uncertainty.information import Information, Responses, opened_at, opened_jacobian, responses
from thermid.fit._uncertainty.moved import Moves, moves_above
from thermid.fit._uncertainty.noise import Autocorrelation, TraceNoise, autocorrelation, own_switches, shifts_by_lags
from thermid.measure.records import COLUMN_UNITS, Record, open_questions
from thermid.model.tree import CREDIBLE, Model, Standing, TableSignal, identity_of, unlumped
from thermid.simulation.runs import Scenario, Workers
from thermid.values.store import INPUT, FittedValue, FittedValues, LaterTable, State, Store, ValueOrigin, graft

_version = cache(version)  # half a millisecond, once

ASIDE, STRAINED = 3.0, 5.0
"""Standard deviations from its prior at which a value is remarked on, and from which its fit is not adequate, whatever it is a value of:
chance goes so far once in two million, so the prior is wrong, or the value takes up physics that the model lacks. [-]"""
UNSTATED_LAG = 5.0
"""Lag that a thermometer may have of which nobody states one: between a bare thermocouple and a probe in a pocket. [s]"""
UNSTATED_EMISSIVITY = 0.05
"""Share by which an emissivity may be off of which nobody states a range: tables of paints and oxides differ by that. [-]"""
UNKNOWN_CLOCK = 0.5
"""Part of the range of a second clock that its 95 % must leave, for the records to have determined it. [-]"""


def own_standing(
    request: Request,
    problem: Problem,
    far: Mapping[str, str],
    at: Sequence[float],
    errors: Sequence[float],
    spread: Autocorrelation | None,
    moved: Moves,
    message: str = "",
) -> Standing:
    """Return the standing of a fit by itself, whatever it rests on.

    Parameters
    ----------
    far : dict              Values beyond what was stated of them, as `contradicted` names them.
    at, errors : sequence   The unknowns of the problem there and their standard errors, fitted form.
    moved : Moves           What its logs say of values that it inherited.
    message : str           How the search ended where it did not converge.
    """
    stage = request.name or request.model.title
    wrong = [*far.values(), *([f"the fit did not converge: {message}"] if message else [])]
    at_bound = [f"'{u.name}' ended at its {side} bound" for u, side, _ in at_bounds(problem, at, errors)]
    if wrong:  # a value that a bound holds is why inherited ones move
        return Standing("not credible", "; ".join([*wrong, *at_bound, *moved.contradictions()]), stage, request.accepted)
    short_of = [
        f"'{name}' lies {far:.1f} standard deviations from its prior (limit {STRAINED:g})"
        for name, far in [*_far_from_prior(problem, at, inherited=True).items()][:1]
        if far > STRAINED
    ]
    times, words = _beyond_accuracy(problem, at)
    short_of += [words] if times > ASIDE else []
    short_of += _beyond_stated(problem, spread, request.adequate) if request.adequate and spread is not None else []
    if short_of := [*short_of, *at_bound]:  # what was stated with a probability comes first; a bound has none
        return Standing("not adequate", "; ".join(short_of), stage, request.accepted)
    return replace(CREDIBLE, stage=stage)


def _beyond_accuracy(problem: Problem, at: Sequence[float]) -> tuple[float, str]:
    """Return how many times their stated accuracies the instruments' constant errors are, and that in words.

    It is the root mean square of errors by accuracies, so that instruments that share their error, as those of one logger may, count as
    one: by chance it is above three in at most one fit of 370, however they hang together.
    """
    pairs = [(u, x) for u, x in zip(problem.unknowns, at, strict=True) if u.unit == "K" and u.prior is not None]
    errors = {u.name: (x, x / u.prior.sd) for u, x in pairs if u.prior is not None and u.kind in ("sensor", INPUT)}
    if len(errors) < 2 or not (of_sensors := [errors[u.name] for u, _ in pairs if u.kind == "sensor"]):
        return 0.0, ""
    times, mean = math.sqrt(float(np.mean([size**2 for _, size in errors.values()]))), float(np.mean([x for x, _ in of_sensors]))
    every = sorted(x for x, _ in errors.values())
    words = f"{len(every)} instruments would err by {every[0]:+.2g} to {every[-1]:+.2g} K"
    if min(abs(size) for _, size in of_sensors) > 1.0 and len({x > 0.0 for x, _ in of_sensors}) == 1:
        words = f"all sensors would read about {short(abs(mean), 2)} K {'high' if mean > 0.0 else 'low'} together"
    return times, (
        f"{words}, {short(times, 2)} times their stated accuracies (limit {ASIDE:g}), because the model lacks or misstates some physics: "
        "check areas, emissivities and the law of convection, then the accuracies"
    )


def at_bounds(problem: Problem, at: Sequence[float], errors: Sequence[float]) -> list[tuple[Unknown, str, float]]:
    """Return the unknowns that ended at a bound, which one, and the bound; by their values and errors, all in the fitted form."""
    ends = zip(problem.unknowns, at, errors, strict=True)
    return [(u, side, bound) for u, fitted, error in ends if not u.is_instant for side, bound in u.bounds_met(fitted, error)]


def _beyond_stated(problem: Problem, spread: Autocorrelation, limit: float) -> list[str]:
    """Return in words which traces wander by more than a stage says that they may [K], the worst first; one reason for all of them."""
    sigma = {(e.record.name, o.sensor): o.sigma(problem.noise) for e in problem.experiments for o in e.observations}
    sizes = [(float(np.sqrt(t.correlated_variance)) * sigma[t.record, t.sensor], t) for t in spread.traces]
    missed = sorted(((size, t) for size, t in sizes if size > limit), key=lambda pair: -pair[0])
    if not missed:
        return []
    size, t = missed[0]
    first = f"{t.sensor} in {t.record} has a residual of {short(size)} K (limit {short(limit)} K: 'adequate')"
    return [f"{first}, and {counted(len(missed) - 1, 'further trace')}" if len(missed) > 1 else first]


def rests_on(request: Request, values: FittedValues) -> dict[str, Standing]:
    """Return who gave the values that a fit rests on -> their standing.

    It rests on every value that was laid over its model and acts there, but for those that it freed without a prior of them, and on the
    errors of its own instruments that a stage below found.
    """
    with_prior = {q for p in request.prior for q in request.store.states[p].acts}
    with_prior |= {p for p, one in request.priors.items() if not mean_of(one)}  # a prior about the value that was there
    freed = {q for p, v in values.parameters.items() if p not in with_prior for q in (p, *v.also)}
    out: dict[str, list[Standing]] = {}
    for path, entry in request.model.parameter_table().items():
        if path not in freed and entry.parameter.standing is not None:
            out.setdefault(entry.origin, []).append(entry.parameter.standing)
    for s in request.store.states.values():
        if s.kind != "parameter" and s.path in values:
            out.setdefault(str(s.origin), []).append(s.standing)
    for what in request.model.missing_parts():
        out.setdefault(f"deck '{request.model.title}'", []).append(Standing("incomplete", what))
    return {who: Standing.worst(several) for who, several in out.items()}


def stored(request: Request, problem: Problem, values: FittedValues, responses_of_fit: Responses) -> Store:
    """Return what is known once a fit is done.

    Parameters
    ----------
    request, problem    The fit's.
    values : FittedValues   What it found.
    responses_of_fit : Responses  What its errors come from.
    """
    positions = [k for k, u in enumerate(problem.unknowns) if u.kind != "local"]
    key = request.fit_key
    rows, sources = responses_of_fit.with_noise(positions, key[:16], f"noise of stage '{values.stage}'")
    is_limited = [not responses_of_fit.unlimited[k] for k in positions]
    origin = ValueOrigin("fit", values.stage, tuple(values.provenance["records"]), key, values.provenance["date"])
    decks = {p: entry.deck_text for p, entry in request.model.parameter_table().items()}
    states = {
        v.path: replace(state_of(v, origin, decks), known=sure, of_logs=v.path in request.of_logs)
        for v, sure in zip(values.values(), is_limited, strict=True)
    }
    fitted_records = {sha: f"stage '{values.stage}' as '{name}'" for name, sha in values.provenance["records"].items()}
    return in_place(request.store, Store(states, sources, rows, fitted_records, {values.stage: values.provenance}))


def in_place(before: Store, new: Store) -> Store:
    """Return what was known before with new states in the place of those that they stand for."""
    here = {n for s in new.states.values() for n in (s.path, *s.paths)}
    sources = tuple({s.name: s for s in (*before.sources, *new.sources)}.values())
    place = {s.name: k for k, s in enumerate(sources)}
    states: dict[str, State] = {}
    root = []
    for store in (before, new):
        columns = [place[s.name] for s in store.sources]
        for state, row_of_state in zip(store.states.values(), store.root, strict=True):
            if store is new:
                old = [s for s in before.states.values() if s.path == state.path or set(s.paths) & set(state.paths)]
                state = replace(state, history=tuple(dict.fromkeys(o for s in old for o in (*s.history, s.origin))))  # whom it replaces
            elif state.kind == "parameter" and (others := tuple(p for p in state.paths if p not in here)):
                state = replace(state, path=others[0], paths=others, hidden=tuple(p for p in state.hidden if p in others))
            elif state.kind == "parameter" or state.path in here:
                continue
            row = np.zeros(len(sources))
            row[columns] = row_of_state
            states[state.path] = state
            root.append(row)
    whole = replace(
        before,
        states=states,
        sources=sources,
        root=np.array(root).reshape(len(root), len(sources)),
        seen={**before.seen, **new.seen},
        provenance={**before.provenance, **new.provenance},
        left_out=tuple(dict.fromkeys((*before.left_out, *new.left_out))),
    )
    return whole.trimmed()


def state_of(v: FittedValue, origin: ValueOrigin, decks: Mapping[str, str]) -> State:
    """Return the state that a value of a stage is; `decks` has the texts of the decks' values by path."""
    parameter = v.kind == "parameter"
    return State(
        v.path,
        v.value,
        v.log,
        v.unit,
        v.bounds,
        origin,
        v.kind,
        (v.path, *v.also) if parameter else (),
        deck=decks.get(v.path, ""),
        standing=v.standing,
        start=v.start,
        random=v.error_random,
        prior=v.prior,
    )


def tuned_by_hand(request: Request, hand: Store) -> Calibration:
    """Return a stage that takes values as somebody tuned them, over what the stages below found."""
    store = in_place(request.store, hand)
    values = FittedValues.of_store(store, list(hand.states), request.name)
    rests = rests_on(request, values)
    return Calibration(request.name, request.model, values, (), (), {}, request.remarks, request=request, rests=rests, store=store)


DIFFER = 3.0
"""Standard deviations from which two sensors of one node differ."""
MIN_UNIT_MISTAKE_RATIO = 300.0
"""Ratio of the power of a log and that of the deck from which one of them is in another unit."""
EXCHANGED = 0.2
"""Part of the residuals of two sensors by the deck that is left where they are exchanged. [-]"""
MISSED_BY_DECK = 3.0
"""Residuals by the deck, in units of the noise, below which two sensors read alike. [-]"""
FULL = 101.0
"""Largest number that a duty cycle in per cent reaches, with what rounding adds."""


def strange_powers(problem: Problem) -> tuple[str, ...]:
    """Return questions about logged powers that are far from the deck's: is their unit right?

    Far is 300 times, and five times where nobody said the unit of the column: a duty cycle in per cent then counts as watts.
    """
    out: dict[str, str] = {}
    for e in problem.experiments:
        values = e.network.flat.parameters.evaluate({})
        decks = {row.path: float(values[row.fields["power"]]) for row in e.network.flat.loads if "power" in row.fields}
        for c in (c for c in e.record.channels.values() if c.role == "load" and c.quantity == "power" and c.valid.any()):
            path = e.network.flat.names.model.canonical(c.target or "")
            logged, deck = float(abs(c.values[c.valid]).max()), decks.get(path, 0.0)
            if not (logged > 0 and deck > 0):
                continue
            gives = f"{FIRST}'{c.name}' gives '{path}' {short(logged, 3)} W, the deck has {short(deck, 3)} W: "
            if not 1.0 / MIN_UNIT_MISTAKE_RATIO < logged / deck < MIN_UNIT_MISTAKE_RATIO:
                likely = min(COLUMN_UNITS["power"], key=lambda u: abs(math.log(float(abs(c.in_unit(u).values[c.valid]).max()) / deck)))
                out[c.name] = f"{gives}its column was read in {c.unit} and may be in {likely}. {c.unit_remedy(likely)}"
            elif c.assumed and logged / deck >= QUESTIONED_FACTOR and logged <= FULL:
                out[c.name] = (
                    f"{gives}it may be a duty cycle in per cent: no unit is given, so watts were assumed. Give full_scale = '... [W]', its "
                    'power at 100 %, or, if these are watts, unit = "W".'
                )
    return tuple(out.values())


def exchanged_sensors(problem: Problem) -> tuple[str, ...]:
    """Return questions about pairs of sensors that the deck, before any fit, reproduces at each other's node and not at their own.

    That is where the root mean square of both sensors' residuals, exchanged, is below `EXCHANGED` of that as read, and the latter above
    `MISSED_BY_DECK` of the noise [K]. Fitted values may absorb such an exchange, so the values of the deck are used: by chance they meet
    no exchanged readings.
    """
    try:
        blocks = problem.blocks(starting_point(problem.unknowns))
    except SolverError:
        return ()
    out: dict[tuple[str, str], str] = {}
    for a, b in combinations(blocks, 2):
        if a.record != b.record or a.node == b.node or not np.array_equal(a.times, b.times):
            continue
        as_read = float(np.sqrt(np.mean(np.append(a.residuals, b.residuals) ** 2)))
        exchanged = float(np.sqrt(np.mean(np.append(b.measured - a.predicted, a.measured - b.predicted) ** 2)))
        if exchanged < EXCHANGED * as_read and as_read > MISSED_BY_DECK * max(a.noise, b.noise):
            out[a.sensor, b.sensor] = (
                f"{FIRST}before a fit to this record, '{a.sensor}' and '{b.sensor}' agree with each other's node "
                f"({short(exchanged)} K RMS) and not with their own ({short(as_read)} K): they may be exchanged, on the bench or in the "
                "campaign."
            )
    return tuple(out.values())


def refuse_before(request: Request, problem: Problem, fit: Callable[[Request], Calibration]) -> None:
    """Refuse a fit of unknowns that the records cannot separate.

    Raises
    ------
    IdentificationError   Names them, and what is known of them instead.
    """
    if not problem.unknowns:
        return
    info = Information.of_problem(problem, starting_point(problem.unknowns))
    length = np.linalg.norm(info.rows, axis=0)
    blind = set(np.flatnonzero(length <= 1e-12 * length.max()).tolist())
    for direction in null_space(info.rows) * length:
        blind |= set(np.flatnonzero(np.abs(direction) > SHARE * np.abs(direction).max()).tolist())
    if blind:
        names = {info.names[k] for k in blind}
        groups = Group.all_structural(info, info.elsewhere(problem))
        group = next(g for g in groups if names & set(g.names))
        raise IdentificationError(_words(group, request, problem, fit), request.name or request.model.title)


def _words(group: Group, request: Request, problem: Problem, fit: Callable[[Request], Calibration]) -> str:
    """Return what cannot be separated, what is known instead, and what to do."""
    if group.form == "unseen":
        return f"no reading depends on '{group.names[0]}'. Fix it, or add a record in which it acts."
    named = quoted(group.names) if len(group.names) < 3 else ", ".join(f"'{n}'" for n in group.names)
    cure = "Free one of them, or add a record in which they act differently."
    how = group.pair
    if how in ("product", "ratio"):
        known_text = _known_combination(group, request, problem, fit)
        return f"{named} cannot be separated by these data; they act only as a {how}{known_text}. {cure}"
    about = "; ".join(f"{c.text} to about {percent(c.relative)}{f' ({c.meaning})' if c.meaning else ''}" for c in group.known)
    known_text = f" Known: {about}." if about else ""
    if group.form in ("sum", "series"):
        return f"{named} cannot be separated by these data; {group.acting}.{known_text} {cure}"
    if group.form == "power law":
        moves = ", or ".join(together(move, len(group.names)) for move in group.moves)
        powers = [
            n
            for n in group.names
            if n.rpartition(".")[2] in ("power", "scale")
            or any(u.name == n and unit(u.unit).dimension == unit("W").dimension for u in problem.unknowns)
        ]
        advice = f" Without a measured power only ratios can be fitted: fix '{powers[0]}' or give it a prior." if powers else ""
        return f"{named} cannot be separated by these data: {moves} changes no reading.{known_text}{advice} {cure}"
    return f"{named} cannot be separated by these data: a change of one is compensated by the others. {cure}"


def _known_combination(group: Group, request: Request, problem: Problem, fit: Callable[[Request], Calibration]) -> str:
    """Return the value of a product or ratio of two parameters, from a fit that frees one of them."""
    first, second = group.names
    fewer = tuple(n for n in request.free if request.model.canonical(n) != second)
    if len(fewer) != len(request.free) - 1:
        return ""
    try:
        calibration = fit(replace(request, free=fewer))
    except IdentificationError:
        return ""
    combination = f"{first}{'*' if group.pair == 'product' else '/'}{second}"
    other = next(u for u in problem.unknowns if u.name == second)
    value = calibration.values[first]
    factor = other.start if group.pair == "product" else 1.0 / other.start
    of = unit(value.unit).dimension
    dimension = tuple(a + b if group.pair == "product" else a - b for a, b in zip(of, unit(other.unit).dimension, strict=True))
    meaning = next((f", which sets {c.meaning}" for c in group.known if c.meaning), "")
    return f" (known: {combination} = {short(value.value * factor, 3)} +- {short(value.error * factor)} {si_unit(dimension)}{meaning})"


def refuse_after(request: Request, problem: Problem, minimum: Fit, covariance: Array) -> None:
    """Refuse a fit that does not determine one of its parameters, by the covariance (unknowns, unknowns) at its end, fitted form.

    It does not where no reading depends on the parameter, or where twice its standard error exceeds the distance between its bounds, in
    the fitted form (at a bound in its own unit too); an infinite bound is not compared.

    Raises
    ------
    IdentificationError   Names the parameter, its error and its bounds.
    """
    for k, u in enumerate(problem.unknowns):
        if u.kind != "parameter":
            continue
        error = float(np.sqrt(covariance[k, k]))
        if not np.isfinite(error):
            raise IdentificationError(
                f"at the end of the fit no reading depends on '{u.name}'. Fix it.",
                request.name or request.model.title,
                code="fit.not-determined",
            )
        at, (low, high) = float(minimum.fitted[k]), u.fitted_bounds()
        spread, scale = error * u.slope(at), 1.0 / float(unit(u.unit).factor)
        # a path that the log shows to be absent is known well, and its logarithm is not
        shares = [error / (high - low), *([spread / (u.high - u.low)] if u.bounds_met(at) else [])]
        if 2.0 * min(shares) > 1.0:
            found = f"'{u.name}' = {short(u.to_value(at) * scale, 3)} +- {short(spread * scale)} {u.unit}"
            raise IdentificationError(
                f"{found}: twice its standard error is more than its bounds are apart, "
                f"{u.low * scale:.4g} .. {u.high * scale:.4g}, so the log does not determine it{_by_instruments(problem, covariance, k)}. "
                "Fix it, give it a prior, or add a record in which it acts more.",
                request.name or request.model.title,
                code="fit.not-determined",
            )


def _by_instruments(problem: Problem, total: Array, k: int) -> str:
    """Return the remark that constant errors of instruments set most of the variance of unknown `k`; empty where they do not.

    Most is a half: c' S^-1 c >= C_kk / 2, with C = `total` (unknowns, unknowns), fitted form, S its part for instruments and c their
    covariances with k. Named are those j with C_jk^2 / (C_jj C_kk) above a tenth.
    """
    at = [j for j, u in enumerate(problem.unknowns) if u.kind in ("sensor", INPUT, "instrument")]
    if not at or not np.isfinite(total[np.ix_([k, *at], [k, *at])]).all():
        return ""
    across = total[at, k]
    if float(across @ symmetric_inverse(total[np.ix_(at, at)]) @ across) < 0.5 * total[k, k]:
        return ""
    share = across**2 / (np.diag(total)[at] * total[k, k])
    behind = [problem.unknowns[j] for j, s in zip(at, share, strict=True) if s > 0.1]
    if not behind:
        return ""
    names = quoted([u.name.removeprefix("sensor ").removesuffix(" error") for u in behind])
    cure = (
        (" (if all sensors began at one temperature, give `start`: the fit then finds these errors)")
        if all(u.kind == "sensor" for u in behind)
        else ""
    )
    return f"; most of that is the constant error of {names}{cure}"


def summarise(
    request: Request,
    problem: Problem,
    best: Fit,
    responses_of_fit: Responses,
    random: Array,
    spread: Autocorrelation,
    place: KeptFit,
) -> Calibration:
    """Return the calibration that a fit ended with; `responses_of_fit` says what its errors come from, `random` is their part by noise."""
    name, total = request.name or request.model.title, responses_of_fit.total
    origin = f"{name}: {some([r.name for r in request.records], 'records')}"
    rows = [k for k, u in enumerate(problem.unknowns) if u.kind != "local"]
    items = {u.name: _value(u, float(best.fitted[k]), total[k, k], random[k, k], origin) for k in rows for u in (problem.unknowns[k],)}
    provenance: dict[str, Any] = {
        "version": _version("thermid"),
        "date": datetime.now(UTC).date().isoformat(),
        "model": identity_of(request.model),
        "records": {r.name: r.origin.sha256 for r in request.records},
        "synthetic": any(r.origin.synthetic for r in request.records),
    }
    values = FittedValues(name, items, total[np.ix_(rows, rows)], provenance)
    moved = moves_above(request, problem, best, spread.variance_factor) if request.store.states else Moves()
    at_end, message = (best.fitted.tolist(), np.sqrt(np.diag(total)).tolist()), best.message * (not best.converged)
    far, runner = contradicted(values) | contradicted_powers(problem.unknowns, at_end[0]), request.model.runner
    alone, rests = own_standing(request, problem, far, *at_end, spread, moved, message), rests_on(request, values)
    store = stored(request, problem, values.judged(Standing.worst([alone, *rests.values()])), responses_of_fit)
    values = _with_uncut(FittedValues.of_store(store, list(values), name), problem, best, responses_of_fit)
    remarks = (
        *([f"{LOUD}{'; '.join(far.values())}. Do not use these values."] if far else []),
        *(r if far else f"{FIRST}{r}" for r in moved.warnings()),  # what a fit that is not credible contradicts is in its standing
        *far_from_sheet(request.model, values),
        *request.remarks,
        *(f"{FIRST}{r}" for r in (runner.remarks if runner is not None else ())),
        *_warnings(problem, best, total, spread, values),
        *held_emissivities(request, problem, best, total),
        *(unlumped(request.model, {p: v.value for p, v in values.assignments.items()}) if runner is None else ()),
        *best.remarks,
        *_wandering(spread),
    )
    return Calibration(
        name,
        request.model,
        values,
        _locals(problem, best, total),
        Predictions(best.sums, problem, best.fitted),
        correlations_of(problem, total),
        remarks,
        problem.experiments,
        request,
        problem,
        moved,
        spread,
        store,
        alone,
        rests,
        end=FitEnd(place, best.chi_square, round(problem.freedom), best.converged, best.stopped),
    )


def _with_uncut(values: FittedValues, problem: Problem, minimum: Fit, responses_of_fit: Responses) -> FittedValues:
    """Return values with their errors as they would be without bounds, where these cut them."""
    variances = zip(problem.unknowns, minimum.fitted.tolist(), responses_of_fit.uncut.tolist(), strict=False)  # or none
    errors = {u.name: u.slope(x) * variance**0.5 for u, x, variance in variances}
    return replace(
        values, items_={p: replace(v, uncut=x) if (x := errors.get(p, 0.0)) > v.error * (1.0 + 1e-9) else v for p, v in values.items()}
    )


def _value(u: Unknown, fitted: float, total: float, random: float, origin: str) -> FittedValue:
    """Return an unknown as a fitted value [SI], from its fitted form and the total and random variances of that: error = slope * sd."""
    slope = u.slope(fitted)
    errors = (slope * float(np.sqrt(total)), slope * float(np.sqrt(np.clip(random, 0.0, total))) if u.kind == "parameter" else 0.0)
    prior = (u.prior.mean, u.prior.sd) if u.prior is not None else None
    return FittedValue(
        u.name, u.to_value(fitted), errors[0], errors[1], u.log, u.unit, u.start, (u.low, u.high), origin, u.kind, prior, u.also
    )


def _locals(problem: Problem, minimum: Fit, total: Array) -> tuple[Local, ...]:
    """Return the values of single records with errors and slopes, those of a Gaussian's conditional mean: C_lv C_vv^-1.

    l are the local values R x (`_local_row`), v the unknowns of all records whose error is finite, and C, `total` (unknowns, unknowns), the
    covariance of the fitted form. Slopes are [unit of l per fitted form of v]; C_vv is inverted as a correlation, since units differ.
    """
    # when powers changed is asked for the sake of the other values only
    local = {k: u for k, u in enumerate(problem.unknowns) if u.kind == "local"}
    at = {k: u.name.partition(": ") for k, u in local.items() if not u.is_instant}
    shared = {k: u.name for k, u in enumerate(problem.unknowns) if u.kind != "local" and 0.0 < total[k, k] < np.inf}
    sizes = np.sqrt(np.diag(total)[[*shared]])  # of unlike units
    inverse = np.linalg.pinv(total[np.ix_([*shared], [*shared])] / np.outer(sizes, sizes), hermitian=True)
    rows = np.array([_local_row(problem, k) for k in at]).reshape(len(at), len(problem.unknowns))
    slopes = [dict(zip(shared.values(), row, strict=True)) for row in ((rows @ total)[:, [*shared]] / sizes @ inverse / sizes).tolist()]
    found, variances = rows @ minimum.fitted, np.einsum("ki,ij,kj->k", rows, total, rows)
    return tuple(
        Local(at[k][0], at[k][2], float(x), float(np.sqrt(v)), problem.unknowns[k].unit, s)
        for k, x, v, s in zip(at, found, variances, slopes, strict=True)
    )


def _local_row(problem: Problem, k: int) -> Array:
    """Return what a local value is made of (unknowns,): its unknown, and constant errors of the instruments that a start is read from."""
    own = problem.unknowns[k]
    row: Array = (np.arange(len(problem.unknowns)) == k).astype(np.float64)
    for n, u in enumerate(problem.unknowns):
        if own.unit == "degC" and u.kind in ("sensor", INPUT):
            row[n] = sum(t.factor for t in u.targets if (t.experiment, t.name) == (own.targets[0].experiment, own.targets[0].name))
    return row


def correlations_of(problem: Problem, total: Array) -> dict[tuple[str, str], float]:
    """Return (path, path) -> correlation C_ij / sqrt(C_ii C_jj) [-] of parameters, sensors and instruments, those beyond 0.1 by size.

    `total` C (unknowns, unknowns) is the covariance of all unknowns, fitted form. A value without a finite error correlates with nothing.
    """
    names = [(k, u.name) for k, u in enumerate(problem.unknowns) if u.kind in ("parameter", "sensor", "instrument")]
    out = {}
    for i, (k, first) in enumerate(names):
        for m, second in names[i + 1 :]:
            size = np.sqrt(total[k, k] * total[m, m])
            value = float(total[k, m] / size) if size > 0 and np.isfinite(size) else 0.0
            if abs(value) > 0.1:
                out[first, second] = value
    return out


def _warnings(problem: Problem, minimum: Fit, total: Array, spread: Autocorrelation | None, values: FittedValues) -> list[str]:
    """Return what a reader must know of convergence, bounds, clocks, priors, noise and switched powers, a sentence each.

    Parameters
    ----------
    total : array (unknowns, unknowns)  Covariance of the unknowns, fitted form.
    spread : Autocorrelation or None    What the residuals show of their scatter.
    values : dict                       The fitted values, with the error that a bound cuts.
    """
    out = []
    if not minimum.converged:
        out.append(f"the fit did not converge: {minimum.message}")
    for u, side, bound in at_bounds(problem, minimum.fitted.tolist(), np.sqrt(np.diag(total)).tolist()):
        shown = f"{FittedValue(u.name, u.to_value(bound), 0, 0, u.log, u.unit, 0, (0, 0)).in_unit:.6g} {u.unit}".strip()
        cut = f", where its standard error of {short(v.shown(v.uncut))} is cut" if u.name in values and (v := values[u.name]).uncut else ""
        out.append(f"'{u.name}' ended at its {side} bound {shown}{cut}. Widen the bound, or fix the parameter.")
    for u, error in (
        (problem.unknowns[k], float(np.sqrt(total[k, k]))) for i in range(len(problem.experiments)) for k, _, _ in problem.ticking(i)
    ):
        # 95 % are four standard errors wide; clocks are not fitted by logarithms
        if 4.0 * error > UNKNOWN_CLOCK * (u.high - u.low):
            out.append(
                f"'{u.name}' is not determined: its 95 % are {100.0 * min(4.0 * error / (u.high - u.low), 1.0):.0f} % of the range that it "
                "was looked for in. State one number, such as that of the stamps, or log a part that answers at once to a switched power."
            )
    if far := [f"'{name}' ({size:.1f})" for name, size in _far_from_prior(problem, minimum.fitted.tolist()).items()]:
        out.append(
            f"more than {ASIDE:g} standard deviations from what was known before: {some(far, 'values')}. A prior is too tight, or these "
            "values take up physics that the model lacks. Check where the priors come from, or run `thermid criticise`."
        )
    out += differing(problem)
    out += _noise_apart(problem)
    out += _taken_as_instants(problem, minimum)
    out += _taken_as_switched(problem, minimum, total)
    out += without_lags(problem, minimum, total)
    freedom = round(problem.freedom)
    reduced = minimum.chi_square / max(freedom, 1)
    stated = all(o.noise is not None for o in problem.observations())
    if stated and freedom > 0 and reduced > MISFIT:
        widened = "; the errors were widened by that factor" if spread is None or spread.variance_factor > MISFIT else ""
        out.append(
            f"the residuals are {short(np.sqrt(reduced))} times the stated noise{widened}. Check the noise, or look for "
            "missing physics with `thermid criticise`."
        )
    return out


def _slow(spread: Autocorrelation) -> list[TraceNoise]:
    """Return the traces whose residuals wander."""
    return [t for t in spread.traces if t.white_variance > 0.0 and wanders(t.effective_samples, t.samples)]


def _wandering(spread: Autocorrelation) -> list[str]:
    """Return one remark on traces whose residuals wander; none where no more of n traces do than white noise makes by chance.

    That is up to n c + 3 sqrt(n c (1 - c)), c = `CHANCE`: mean and three standard deviations of a binomial law.
    """
    slow = _slow(spread)
    # one white trace in a hundred looks as if it wandered
    if len(slow) <= CHANCE * len(spread.traces) + 3.0 * np.sqrt(CHANCE * (1.0 - CHANCE) * len(spread.traces)):
        return []
    share = f"{len(slow)} of {len(spread.traces)} traces" if len(spread.traces) > 1 else "the trace"
    count, effective = sum(t.samples for t in slow), sum(t.effective_samples for t in slow)
    return [
        f"residuals of {share} are autocorrelated: the model lacks physics, or the readings were filtered. The effective sample size "
        f"is {short(effective)} of {count}, and the errors were widened accordingly."
    ]


def _taken_as_instants(problem: Problem, minimum: Fit) -> list[str]:
    """Return remarks on logged inputs for which it matters by more than the noise what a sample is, where nobody said it.

    The mean of a boundary over an interval is the instant of its middle: half a change between two samples apart.
    """
    apart: dict[str, float] = {}
    bent: dict[str, float] = {}
    ramped: dict[str, float] = {}
    for i, e in enumerate(problem.experiments):
        noise = min((o.noise for o in e.observations if o.noise is not None), default=UNSAID_NOISE)
        for name, boundary in e.scenario.boundaries.items():
            if isinstance(boundary, TableSignal) and not boundary.held and not boundary.samples:
                half = 0.5 * float(np.sqrt(np.mean(np.diff(boundary.levels) ** 2)))
                if half > noise:
                    apart[name] = max(half, apart.get(name, 0.0))
        for name, far, gain in _with_lines(problem, minimum, i):
            if gain > 1.0:
                ramped[name] = max(gain, ramped.get(name, 0.0))
            elif far > noise and e.record.channels[name].prompt is None:
                bent[name] = max(far, bent.get(name, 0.0))
    texts = (
        "samples of logged boundaries are taken as instants. Taken as means over the interval up to their stamps, they would change "
        "the simulated temperatures by more than the noise: {} K. State samples = 'instant' or 'average' for their channels.",
        "samples of logged schedules are held until the next one. With straight lines between them they would change the simulated "
        "temperatures by more than the noise: {} K. State interpolation = 'linear' for the channel of a value that a controller moves "
        "all the time, 'previous' for one that is switched.",
        f"{FIRST}inputs are taken to change by steps between their samples, but straight lines leave residuals that are smaller "
        "by a factor: {}. State interpolation = 'linear' for the channel of what was changed slowly, else 'previous'.",
    )
    return [
        text.format(", ".join(f"'{n}' {short(k)}" for n, k in sizes.items()))
        for text, sizes in zip(texts, (apart, bent, ramped), strict=True)
        if sizes
    ]


def _with_lines(problem: Problem, minimum: Fit, i: int) -> Iterator[tuple[str, float, float]]:
    """Yield what straight lines between samples do in a record, of each channel whose steps nobody stated.

    They are its name, the root mean square of what a thermometer would read otherwise [K], and how many times smaller residuals are after a
    fit with them; zero where chance would do as much, or none was looked for, as of a schedule of unknown samples.
    """
    e, bench, x = problem.experiments[i], problem.benches()[i], problem.inputs(i, minimum.fitted)[0]
    for name, c in e.record.channels.items():
        if c.interpolation or c.samples or not (c.role == "schedule" or c.prompt is False) or not np.ptp(c.values[c.valid]) > 0.0:
            continue
        role, path = role_and_target(e.record, c, e.network)
        table = next((t for t in STEPPED if path in getattr(e.scenario, t)), "")
        if not table or not getattr(e.scenario, table)[path].held:
            continue
        lines = {path: signal_of(e.record, replace(c, interpolation="linear"), role, e.record.ends[0])}
        scenario = e.scenario.with_(**{table: {**getattr(e.scenario, table), **lines}})
        other = replace(e, scenario=scenario, instants=tuple(at for at in e.instants if at.path != path))
        stays_free = [n not in bench.experiment.jumps or n in other.jumps for n in bench.free]
        straight = Bench.of_experiment(other, [n for n, stays in zip(bench.free, stays_free, strict=True) if stays])
        runs = [b.temperatures(values, False, None)[0] for b, values in ((bench, x), (straight, x[stays_free]))]
        gain = 0.0
        if c.prompt is False:
            stay = [not {t.name for t in u.targets if t.experiment == i} & {*bench.free} - {*straight.free} for u in problem.unknowns]
            ramps = tuple(other if k == i else same for k, same in enumerate(problem.experiments))
            unknowns = tuple(u for u, stays in zip(problem.unknowns, stay, strict=True) if stays)
            again = minimise(replace(problem, experiments=ramps, unknowns=unknowns), start=minimum.fitted[stay])
            proved = minimum.chi_square - again.chi_square > ASIDE**2
            gain = float(np.sqrt(minimum.chi_square / again.chi_square)) if proved else 0.0
        yield name, float(np.sqrt(np.mean((runs[1] - runs[0]) ** 2, axis=0)).max()), gain


def _taken_as_switched(problem: Problem, minimum: Fit, total: Array) -> list[str]:
    """Return remarks on sampled powers: unknown instants that may move a value by more than its error, and a statement of no effect."""
    foreign = problem.experiments[0].network.flat.names.model.runner is not None
    sampled = {n: c for e in problem.experiments for n, c in e.record.channels.items() if c.prompt is False}
    out = [
        f"{FIRST}prompt = false of '{n}' has no effect, and its changes count from their samples. A fit looks for the moment of a change "
        "only where samples are instants, held until the next one, and the model is no FMU."
        for n, c in sampled.items()
        if (foreign or not c.held or c.samples == "average") and not c.interpolation and np.ptp(c.values[c.valid]) > 0.0
    ]
    switches = list(own_switches(problem, minimum))
    ratios = {
        u.name: float(np.linalg.norm([f.shifts[k] for f in switches]) / (np.sqrt(total[k, k]) or np.inf))
        for k, u in enumerate(problem.unknowns)
        if u.kind == "parameter"
    }
    worst_of_all = max(ratios, key=lambda name: ratios[name], default="")
    if switches and ratios[worst_of_all] > 1.0:
        channels = list(dict.fromkeys(f.channel for f in switches))
        out.append(
            f"{FIRST}a power is taken to change at the sample that shows it, but {quoted(channels)} changed somewhere in the interval "
            f"before ({short(max(f.interval for f in switches))} s at most). '{worst_of_all}' may be wrong by "
            f"{short(ratios[worst_of_all], 2)} times its printed error for that reason alone: the printed error is right only if every "
            "change has a sample at its instant. Then state prompt = true; else prompt = false, and the fit finds the instants."
        )
    return out


def without_lags(problem: Problem, minimum: Fit, total: Array) -> list[str]:
    """Return one remark on sensors without a stated lag, where one that the readings allow would move a value by more than its error.

    `total` (unknowns, unknowns) is the covariance of the unknowns, fitted form; more is `HALF_WIDTH_95` standard errors.
    """
    names, lag, shifts = shifts_by_lags(problem, minimum, UNSTATED_LAG)
    ratios = {
        u.name: abs(float(shifts[k])) / (float(np.sqrt(total[k, k])) or np.inf)
        for k, u in enumerate(problem.unknowns)
        if u.kind == "parameter" and np.isfinite(total[k, k])
    }
    worst_of_all = max(ratios, key=lambda name: ratios[name], default="")
    if not names or not ratios or ratios[worst_of_all] < HALF_WIDTH_95:
        return []
    return [
        f"{FIRST}{quoted(names, 3)} {'state' if len(names) > 1 else 'states'} no lag, which counts as none: {short(lag, 2)} s, which the "
        f"readings allow, would move '{worst_of_all}' by {short(ratios[worst_of_all], 2)} times its error. State lag = '5 [s]' with its "
        "lag_accuracy, or '0 [s]'."
    ]


def held_emissivities(request: Request, problem: Problem, minimum: Fit, total: Array) -> list[str]:
    """Return one remark on the held emissivity without a range that moves a value most, where 5 % of it are more than the value's error.

    An error dq of what is held moves the fit by -C A'B dq (`opened_jacobian`), C the covariance of the fit alone; `total` (unknowns,
    unknowns), fitted form, has the errors that are stated.
    """
    flat = problem.experiments[0].network.flat
    parameters, inherited = flat.parameters, {q for state in request.store.states.values() for q in state.acts}
    if flat.names.model.runner is not None or not all(u.name in parameters.table for u in problem.unknowns if u.kind == "parameter"):
        return []  # an FMU, or several models
    behind = dict.fromkeys(parameters.literal_behind(p) for p in parameters.table if p.endswith(".emissivity"))
    bare = [(p,) for p in behind if p not in {*parameters.stated_ranges, *inherited} and parameters.evaluate({}, [p])[p] > 0.0]
    if not bare or not (opened := opened_at(request, problem, minimum.fitted, bare)).names or not opened.own:
        return []
    of_fit, of_held = opened_jacobian(opened, request.loss)
    more = opened.problem.unknowns[opened.own :]
    steps = [UNSTATED_EMISSIVITY * u.start / u.slope(float(x)) for u, x in zip(more, opened.fitted[opened.own :], strict=True)]
    moves = np.abs(covariances(minimum)[2] @ of_fit.T @ of_held) * steps
    errors = [np.sqrt(total[k, k]) if u.kind == "parameter" and total[k, k] > 0.0 else np.inf for k, u in enumerate(problem.unknowns)]
    ratios = np.nan_to_num(moves / np.array(errors)[:, None], posinf=0.0)
    k, n = divmod(int(np.argmax(ratios)), ratios.shape[1])
    if ratios[k, n] < HALF_WIDTH_95:
        return []
    return [
        f"{FIRST}'{more[n].name}' = {short(more[n].start, 3)} counts as exact. If it is {100 * UNSTATED_EMISSIVITY:g} % off, "
        f"'{problem.unknowns[k].name}' is off by {short(float(ratios[k, n]), 2)} times its error. State its min and max with "
        "spread = 'range'."
    ]


def differing(problem: Problem) -> list[str]:
    """Return one remark on sensors of one node that differ by more than what is said of their noise and accuracy.

    That is |mean(a - b)| above `DIFFER` times sqrt((s_a^2 + s_b^2) / n + A_a^2 + A_b^2), noise s, accuracy A and n readings of both. [K]
    """
    out = []
    for e in problem.experiments:
        for a, b in combinations(e.observations, 2):
            if a.seat != b.seat or a.lag or b.lag:
                continue
            both, one, other = np.intersect1d(a.index, b.index, return_indices=True)
            if not both.size:
                continue
            apart = float(np.mean(a.measured[one] - b.measured[other]))
            error = float(np.hypot(a.sigma(problem.noise), b.sigma(problem.noise))) / both.size**0.5
            allowed = float(np.linalg.norm([error, a.accuracy or 0.0, b.accuracy or 0.0]))
            if abs(apart) > DIFFER * allowed:
                out.append(
                    f"'{a.sensor}' and '{b.sensor}' on '{a.seat}' differ by {short(abs(apart))} K in {e.record.name}, but their noise "
                    f"and accuracy allow {short(allowed)} K. Correct their accuracy, or look for a temperature gradient between them."
                )
    return out[:1]


def _noise_apart(problem: Problem) -> list[str]:
    """Return one remark on sensors whose stated noise is far from what their readings show; the farthest is named."""
    apart = {
        (e.record.name, o.sensor): (o.noise, e.record.channels[o.sensor].noise_seen)
        for e in problem.experiments
        for o in e.observations
        if o.noise and o.noise_shown(e.record.channels[o.sensor]) != o.noise
    }
    if not apart:
        return []
    (record, sensor), (noise, size) = max(apart.items(), key=lambda item: abs(math.log(item[1][0] / item[1][1])))
    others = f", and that of {counted(len(apart) - 1, 'further trace')} is off too" if len(apart) > 1 else ""
    return [
        f"the stated noise of '{sensor}' is {short(noise)} K, but its readings in {record} scatter by {short(size)} K from one to the next"
        f'{others}. Errors and limits rest on the stated noise. State what the readings show, noise = "{short(size)} [K]", or why not.'
    ]


def _far_from_prior(problem: Problem, at: Sequence[float], inherited: bool = False) -> dict[str, float]:
    """Return value -> |x - m| / s, its distance from its prior in standard deviations [-], of those beyond `ASIDE`, the farthest first.

    `at` x (unknowns,), the prior's mean m and s are in the fitted form. With `inherited` also of values that stages below found together:
    each by itself, its s the root of the diagonal of (R'R)^-1, R the root of their information.
    """
    pairs = zip(problem.unknowns, at, strict=True)
    apart = {u.name: abs(x - u.prior.mean) / u.prior.sd for u, x in pairs if u.prior is not None}
    for positions, mean, root in problem.coupled if inherited else ():
        sizes = np.sqrt(np.diag(np.linalg.pinv(root.T @ root)))
        shifts = zip(positions, np.asarray(at)[positions] - mean, sizes, strict=True)
        apart |= {u.name: abs(shift) / size for k, shift, size in shifts if (u := problem.unknowns[int(k)]).kind == "parameter"}
    return {name: size for name, size in sorted(apart.items(), key=lambda item: -item[1]) if size > ASIDE}


def calibrate(
    model: Model,
    records: Record | Sequence[Record],
    free: Sequence[str],
    *,
    scenario: Scenario | Mapping[str, Scenario] | None = None,
    local: Mapping[str, Any] | None = None,
    priors: Mapping[str, Any] | None = None,
    inherit: Mapping[str, Any] | None = None,
    loss: str = "linear",
    search: str = "auto",
    weights: Mapping[str, float] | None = None,
    name: str = "",
    executor: Workers = None,
) -> Calibration:
    """Return the fit of some parameters of a model to one or several records.

    The interrupt key ends the search with the best values so far: the calibration is then not credible, "stopped by the user".

    Parameters
    ----------
    model : Model               What the hardware is.
    records : Record(s)         Logs whose channels are bound to nodes, boundaries, loads or commands.
    free : sequence of str      Paths of the parameters to fit, or globs such as ``pre.*.htc``; all others stay as they are.
    scenario : Scenario(s)      What the logs do not say; one for all, or one by record name.
    local : dict                Values that each record has for itself: boundary or ``initial.<node>`` -> ``{start, sd}``.
    priors : dict               Path or glob -> (mean, standard deviation), texts with units; or ``"range"`` for that which the deck states.
    inherit : dict              Part of the model, ``.`` for the model itself -> what a fit of it found: a `Calibration`, its values or the
                                path of their file. Values stay there with their errors; those that are free too have them as prior.
    loss : str                  linear, soft_l1, huber or cauchy.
    search : str                local, multistart, differential evolution; or auto: further starts where one descent is doubtful.
    weights : dict              Sensor -> weight of its residuals, 1 where none is given. [-]
    name : str                  Of the fit, as a stage of a campaign has one; the model's title by default.
    executor                    Who makes descents from several starts, as in `ensemble`: the same values from all.

    Raises
    ------
    IdentificationError   When parameters act only as a product, or a standard error is wider than the bounds; the message says what to do.
    """
    many = (records,) if isinstance(records, Record) else tuple(records)
    request = requested(
        model,
        many,
        free,
        scenario=scenario,
        local=local,
        priors=priors,
        inherit=inherit,
        loss=loss,
        search=search,
        weights=weights,
        name=name,
    )
    fitted = fit(request, stoppable=True, executor=executor)
    if fitted.own.fair:
        return fitted
    advice = "a mistake in a log or deck may be the cause: td.inference.mistakes_of(fit) names those that would explain it"
    return replace(fitted, warnings=(*fitted.warnings, advice))


def requested(
    model: Model,
    records: tuple[Record, ...],
    free: Sequence[str],
    *,
    scenario: Scenario | Mapping[str, Scenario] | None = None,
    local: Mapping[str, Any] | None = None,
    priors: Mapping[str, Any] | None = None,
    inherit: Mapping[str, Any] | None = None,
    loss: str = "linear",
    search: str = "auto",
    weights: Mapping[str, float] | None = None,
    name: str = "",
) -> Request:
    """Return the request that the arguments of `calibrate` stand for."""
    scenarios = dict(scenario) if isinstance(scenario, Mapping) else {"*": scenario} if scenario else {}
    specs = {k: LocalSpec.read(v, f"local.{k}") for k, v in (local or {}).items()}
    where = name or model.title
    store, remarks = Store(), tuple[str, ...]()
    if inherit:
        below = [(part, v.store or v.as_store()) for part, fits in inherit.items() for v in fitted_values(fits, f"{where}, {part}")]
        store, remarks = graft(model, below)
        model = store.laid_over(model)
        store, hidden = store.acting_in(model)
        remarks = (*(f"{FIRST}{r}" for r in remarks), *hidden)
    wanted, _ = freed(model, free, (), where)
    prior = tuple(p for p, s in store.parameters.items() if s.known and {*s.acts} & {*wanted})
    remarks = (*remarks, *counted_twice(store, prior, records))
    priors_by_path = priors_of(model, priors or {}, where)
    more: dict[str, Any] = {"loss": loss, "search": search, "name": name, "weights": weights or {}}
    inherited: dict[str, Any] = {"store": store, "prior": prior, "seen": store.seen, "remarks": remarks}
    return Request(model, records, tuple(wanted), scenarios, specs, priors=priors_by_path, **inherited, **more)


def fit(
    request: Request,
    progress: Progress | None = None,
    recalled: KeptFit | None = None,
    stoppable: bool = False,
    executor: Workers = None,
    keeping: Keeping | None = None,
) -> Calibration:
    """Return the calibration that a request asks for; see `calibrate`.

    `progress` is called with the number of evaluations and the RMS of the weighted residuals; where it has a method
    ``ahead(words, seconds)``, that is called before a descent and before a search, with what it will take.
    `recalled` is what was kept of the same fit from before; its end is then evaluated and not searched again. `stoppable` says
    whether the interrupt key ends the search with the best values so far; what makes many fits leaves it to go through. `keeping` keeps
    the model of error of a fit that ended, which takes as long as many searches.
    """
    if request.hand is not None:
        return tuned_by_hand(request, request.hand)
    return fit_problem(request, build_problem(request), progress, recalled, stoppable, executor, keeping)


def fit_problem(
    request: Request,
    problem: Problem,
    progress: Progress | None = None,
    recalled: KeptFit | None = None,
    stoppable: bool = False,
    executor: Workers = None,
    keeping: Keeping | None = None,
) -> Calibration:
    """Return the calibration of a problem that was made for a request."""
    with one_thread():
        calibration, spread = _fitted(request, problem, progress, recalled, stoppable, executor)
        errors = ErrorsOfFit(calibration, keeping if calibration.converged else None)
        if request.structural_errors or _suspect(calibration, spread):
            calibration = _judged_by_estimates(with_structural_errors(calibration, errors), spread)
        return _with_errors(calibration, errors)


def _judged_by_estimates(fit: Calibration, spread: Autocorrelation) -> Calibration:
    """Return a fit whose standing is that of the values that it gives to quote, where departures of elements explain its readings.

    Starts and rooms of its runs are then where they were stated: the model of error has them among what it integrates over.
    """
    if not fit.expected or not fit.converged:
        return fit
    assert fit.problem is not None
    assert fit.request is not None
    values, priors = fit.expected, {u.name: u.prior.mean for u in fit.problem.unknowns if u.prior is not None}
    at = [u.to_fitted(values[u.name][0]) if u.name in values else priors.get(u.name, fit.fitted[u.name]) for u in fit.problem.unknowns]
    errors = [values[u.name][1] / u.slope(x) if u.name in values else 0.0 for u, x in zip(fit.problem.unknowns, at, strict=True)]
    standing = own_standing(fit.request, fit.problem, fit.contradicted, at, errors, spread, fit.moved)
    warnings = tuple(w for w in fit.warnings if not w.startswith(LOUD) or fit.contradicted)
    return replace(fit, own=standing, warnings=warnings).judged(fit.rests, fit.verdict)


def _fitted(
    request: Request, problem: Problem, progress: Progress | None, recalled: KeptFit | None, stoppable: bool, executor: Workers
) -> tuple[Calibration, Autocorrelation]:
    """Return the calibration of a problem and the autocorrelation of its residuals: searched, or evaluated at the end that was kept."""
    stated = all(o.noise is not None for o in problem.observations())
    if recalled is not None and list(recalled.fitted) == [u.name for u in problem.unknowns]:
        minimum = Fit.ended(problem, np.array(list(recalled.fitted.values())), request.loss, request.loss_scale, recalled.evaluations)
        minimum = replace(minimum, search=recalled.search, remarks=recalled.remarks)
    else:
        try:
            if problem.clocked:
                problem = with_clocks(problem, request.loss, request.loss_scale)
            refuse_before(request, problem, lambda r: fit(r))
            minimum = searched(problem, request.search, request.loss, request.loss_scale, progress, stoppable, executor)
            if problem.clocked and not minimum.stopped:
                problem, minimum = in_turns(problem, minimum, request.loss, request.loss_scale, progress)
        except SolverError as error:  # a power in another unit may be why a run breaks off
            raise error.reworded(" ".join([error.message, *(a.removeprefix(FIRST) for a in strange_powers(problem))])) from None
        if not stated and not minimum.stopped:
            weighed = replace(problem, noise=_measured_noise(problem, minimum, request.loss))
            again = minimise(weighed, request.loss, request.loss_scale, minimum.fitted, progress, stoppable=stoppable)
            minimum = replace(again, evaluations=minimum.evaluations + again.evaluations, search=minimum.search, remarks=minimum.remarks)
    if problem.clocked:
        problem = at_clocks(problem, minimum.fitted)
    if not stated:
        # from the end alone, so that a fit taken from before says the same
        problem = replace(problem, noise=_measured_noise(problem, minimum, request.loss))
        again = Fit.ended(problem, minimum.fitted, request.loss, request.loss_scale)
        same = {k: getattr(minimum, k) for k in ("evaluations", "message", "converged", "search", "remarks", "stopped")}
        minimum = replace(again, **same)
    spread = autocorrelation(problem, minimum, request.loss, request.loss_scale)
    _, random, weights = covariances(minimum, spread.variance_factor, spread.score_excess)
    if problem.clocked:
        wider = widened_by_noise_of_powers(problem, minimum.fitted)
        random = random * np.outer(wider, wider)
    questions_on_mistakes = (
        *(CodedText(FIRST + question, code_of(question)) for question in open_questions([e.record for e in problem.experiments])),
        *strange_powers(problem),
        *exchanged_sensors(problem),
    )
    end = {u.name: float(x) for u, x in zip(problem.unknowns, minimum.fitted, strict=True)}
    end_to_keep = KeptFit(end, minimum.evaluations, minimum.search, minimum.remarks)
    minimum = replace(minimum, remarks=(*minimum.remarks, *questions_on_mistakes))
    try:
        if not minimum.stopped:
            refuse_after(request, problem, minimum, weights)  # what the data can tell, not how badly a wrong model fits them
    except IdentificationError as refusal:
        unlogged = (
            f"{r.words}."
            for r in InputTable.of_request(request, problem.experiments, problem.unknowns).assumed
            if r.kind == "load" and not r.partly
        )
        questions = dict.fromkeys(a.removeprefix(FIRST) for a in (*questions_on_mistakes, *unlogged))
        raise refusal.reworded(" ".join([refusal.message, *(f"{a[0].upper()}{a[1:]}" for a in questions)])) from None
    assumed = assumed_moves(request, problem, minimum, spread)
    errors = responses(request, problem, minimum, spread.variance_factor, random, weights, assumed.ranges)
    _refuse_without_errors(request, problem, errors.total)
    return with_discrepancy(summarise(request, problem, minimum, errors, random, spread, end_to_keep), assumed), spread


def _with_errors(fit: Calibration, errors: ErrorsOfFit) -> Calibration:
    """Return a fit whose values keep its model of error, which is made when somebody asks for it if it is not there."""
    if fit.stopped or fit.problem is None or not any(u.kind == "parameter" for u in fit.problem.unknowns):
        return fit
    provenance = {**fit.values.provenance, ERRORS_KEY: LaterTable(errors.table)}
    store = replace(fit.store, provenance={**fit.store.provenance, fit.values.stage: provenance})
    return replace(fit, values=replace(fit.values, provenance=provenance), store=store)


def _suspect(fit: Calibration, spread: Autocorrelation) -> bool:
    """Whether the residuals of a fit may refute its structure: larger than the noise allows, and some of them wander or by far.

    The noise is what the readings show where none is stated, or more than that.
    """
    if fit.problem is None:
        return False
    over_seen = {
        (e.record.name, o.sensor): (o.noise or fit.problem.noise[o.sensor]) / channel.noise_seen
        for e in fit.problem.experiments
        for o in e.observations
        if o.effective_share == 1.0 and (channel := e.record.channels[o.sensor]).noise_seen > LEAST_NOISE
    }
    stated = all(o.noise is not None for o in fit.problem.observations())
    slow = _slow(spread) if _wandering(spread) else []
    # squares of what wanders in units of the noise that the readings show
    more = [max(over_seen[key], 1.0) ** 2 if (key := (t.record, t.sensor)) in over_seen else float(stated) for t in slow]
    squares = [t.samples * (t.white_variance + t.correlated_variance) * m for t, m in zip(slow, more, strict=True)]
    count = sum(t.samples for t in slow)
    if stated and fit.chi_square > OUTSIDE**2 * max(fit.freedom, 1):
        return True  # white or not
    return bool(slow) and (
        (stated and fit.chi_square > fit.freedom + CHANCE_DEVIATIONS * (2.0 * max(fit.freedom, 1)) ** 0.5)
        or sum(squares) > count + CHANCE_DEVIATIONS * (2.0 * count) ** 0.5
    )


def _refuse_without_errors(request: Request, problem: Problem, total: Array) -> None:
    """Refuse a fit in which a variance comes out below zero: readings hardly depend on that value.

    Raises
    ------
    IdentificationError   Names the value.
    """
    lost = [u.name for u, variance in zip(problem.unknowns, np.diag(total), strict=True) if not variance >= 0.0]
    if lost:
        raise IdentificationError(
            f"at the end of the fit almost no reading depends on {quoted(lost[:3])}, so its error is unknown. Fix it, or give it a prior.",
            request.name or request.model.title,
            code="fit.not-determined",
        )


def with_found_instants(problem: Problem) -> Problem:
    """Return a problem whose inputs change when a fit says, and which looks for these instants no more."""
    if not any(u.is_instant for u in problem.unknowns):
        return problem
    rough = minimise(problem)
    weighed = replace(problem, noise=_measured_noise(problem, rough, "linear"))
    at = minimise(weighed, start=rough.fitted).fitted
    later = [dict(zip(bench.free, problem.inputs(i, at)[0].tolist(), strict=True)) for i, bench in enumerate(problem.benches())]
    settled = tuple(replace(e, scenario=e.changed_at(x), instants=()) for e, x in zip(problem.experiments, later, strict=True))
    # instants are the last of the unknowns, so that joint priors keep their places
    return replace(problem, experiments=settled, unknowns=tuple(u for u in problem.unknowns if not u.is_instant))


def _measured_noise(problem: Problem, minimum: Fit, loss: str) -> dict[str, float]:
    """Return sensor -> noise: as stated, or the RMS of its residuals where nothing was stated. [K]

    Where the loss is robust, outliers are expected; 1.4826 times the median size of the residuals stands for their RMS.
    """
    stated = {o.sensor: o.noise for o in problem.observations()}
    out = {sensor: noise for sensor, noise in stated.items() if noise is not None}
    blocks = problem.blocks(minimum.fitted) if loss != "linear" else []
    for sensor in (s for s in stated if s not in out):
        if loss == "linear":
            size = np.sqrt(pooled([s for _, name, s in minimum.sums if name == sensor]).mean_square)
        else:
            size = 1.4826 * np.median(np.abs(np.concatenate([b.residuals for b in blocks if b.sensor == sensor])))
        out[sensor] = max(float(size), 1e-6)
    return out
