"""`explained`: which hidden defect, fitted beside a deck that does not have it, makes the residuals of a fit as small as the noise.

In: a `Calibration`. Out: the fits with a defect that its readings allow, each with its weight, or nothing: no defect is proved.

Every defect (sensors that lag, a mass, a leak) is fitted together with the clock of the powers, which the fit finds with the instants of
their changes, and the clock is tried alone. Weights are those of Bayesian model averaging (Hoeting and others, Statistical Science 14
(1999) 382-417) with the one score of causes (`weighing`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from thermid.base.errors import IdentificationError, ThermidError
from thermid.base.linear_algebra import one_thread
from thermid.base.units import short
from thermid.fit.calibration import MEASURED, Calibration, Experiment, Request, Unknown, build_problem, fit_problem
from thermid.fit.error_model import FREE_AIR, constant_coefficients
from thermid.inference._explain.candidates import Fitted, MissingElement, hidden_defects
from thermid.inference._explain.structures import linearised, starting_values
from thermid.inference._explain.thresholds import (
    FAR_PART,
    FAR_STEPS,
    MAX_DEFECT_FACTOR,
    MAX_NOISE_CHI_SQUARE,
    MAX_REFIT_EVALUATIONS,
    MAX_REFIT_NODES,
    MAX_REFIT_RECORDS,
    MAX_REFIT_SAMPLES,
    MAX_REFIT_STEPS,
    MAX_REFIT_UNKNOWNS,
    MAX_START_DEVIATIONS,
    MIN_DEFECT_WEIGHT,
    MIN_PROMISED_FALL,
    UNDETERMINED,
    VERY_STRONG,
    SizedValue,
)
from thermid.inference._explain.weighing import CauseScore, noise_of, shares, weighed_at
from thermid.measure.records import Channel, Record
from thermid.model.tree import CARRIED_BY
from thermid.simulation.runs import Scenario


@dataclass(frozen=True, eq=False)
class ExplainedFit:
    """A fit with a defect that its deck does not have.

    Parameters
    ----------
    name, words : str   The defect, and what was found of it.
    weight : float      Its probability among those that the readings allow. [-]
    fit : Calibration
    """

    name: str
    words: str
    weight: float
    fit: Calibration


@dataclass(frozen=True)
class _Tried:
    """One refit: its defect and its score."""

    change: MissingElement | None
    fit: Calibration
    weighing: CauseScore


@lru_cache(maxsize=16)
def explained(fit: Calibration) -> tuple[ExplainedFit, ...]:
    """Return the fits with hidden defects that explain the residuals of a fit, the likeliest first; empty where none is proved.

    A defect is proved where its fit leaves residuals of the stated noise and the readings are likelier with it, by twice the logarithm of a
    Bayes factor of `VERY_STRONG`. Fits that are not much worse share its weight.

    Parameters
    ----------
    fit : Calibration   A fit of this session, of a network of thermid's own, to records with stated noise.
    """
    request = fit.request
    if request is None or not asks(fit):
        return ()
    with one_thread():
        return _explained(fit, request)


def asks(fit: Calibration) -> bool:
    """Whether the residuals of a fit are larger than the stated noise, and the fit is small enough for refits."""
    problem, request = fit.problem, fit.request
    if problem is None or request is None or fit.stopped or fit.loss != "linear" or fit.given_model.runner is not None or problem.clocked:
        return False
    surfaces = constant_coefficients(problem.experiments[0].network)
    if any(c.words.get(CARRIED_BY, FREE_AIR) == FREE_AIR for c in surfaces.values()):
        return False  # what wanders may be the law of a coefficient that is held constant: no proof of a defect
    small = len(problem.unknowns) <= MAX_REFIT_UNKNOWNS and fit.freedom <= MAX_REFIT_SAMPLES and len(request.records) <= MAX_REFIT_RECORDS
    small = small and len(problem.experiments[0].network.nodes) <= MAX_REFIT_NODES
    stated = all(o.noise is not None for o in problem.observations())
    return small and stated and fit.reduced_chi_square > MAX_NOISE_CHI_SQUARE


def _explained(fit: Calibration, request: Request) -> tuple[ExplainedFit, ...]:
    """Return the fits with a hidden defect that explain the residuals at all."""
    open_request = Fitted.of_calibration(fit, request).request
    clock = _clock(fit)
    every = [None, *hidden_defects(Fitted.of_calibration(fit, request))]
    changes = [c for c in every if _promises(fit, open_request, c, clock)]
    attempts = [t for change in changes if (t := _tried(open_request, change, clock, _begun(open_request, change))) is not None]
    for change in changes:  # a search that begins elsewhere, where nothing explains the residuals yet
        for start in change.starts if change is not None else ():
            if min((t.fit.reduced_chi_square for t in attempts), default=np.inf) > MAX_NOISE_CHI_SQUARE:
                attempts += [t for t in [_tried(open_request, change, clock, start)] if t is not None]
    if not attempts:
        return ()
    best = max(attempts, key=_likeliest)
    if best.fit.reduced_chi_square > MAX_NOISE_CHI_SQUARE or _over(best.weighing, _weighed(fit, None)) < 0.5 * VERY_STRONG:
        return ()  # it leaves more than noise, or is not much better than the fit of the deck
    noise = noise_of(t.weighing for t in attempts)
    least = max(t.weighing.logs[noise] for t in attempts) + np.log(MIN_DEFECT_WEIGHT)  # under one noise, of the best one's evidence
    likely = [t for t in attempts if t.weighing.logs[noise] > least]
    weights = shares([t.weighing for t in likely])
    out = [
        ExplainedFit("" if t.change is None else t.change.name, _finding(t), float(w), t.fit) for t, w in zip(likely, weights, strict=True)
    ]
    return tuple(sorted(out, key=lambda e: -e.weight))


def _promises(fit: Calibration, request: Request, change: MissingElement | None, clock: Clock | None) -> bool:
    """Whether one step of Gauss and Newton from the values of a fit, with a defect and the clock beside them, explains its residuals.

    It does where it leaves noise, or takes off `MIN_PROMISED_FALL` of chi-square. A step is one run and a refit some forty of them. The
    clock alone takes ten, and is far from linear where it is off by more than a reading.
    """
    if change is None:
        return clock is not None
    try:
        changed = change.make(request)
        problem = build_problem(changed if clock is None else clock(changed))
        at = starting_values(problem, fit.fitted, {})
        rows, slopes = linearised(problem, at)
    except ThermidError:
        return True  # the refit says why
    chi_square_left = float(np.sum((rows + slopes @ np.linalg.lstsq(slopes, -rows, rcond=None)[0]) ** 2)) / max(problem.freedom, 1)
    return chi_square_left <= max(MAX_NOISE_CHI_SQUARE, (1.0 - MIN_PROMISED_FALL) * fit.reduced_chi_square)


def _likeliest(t: _Tried) -> float:
    """Return the logarithm of the evidence of a refit; what refits are sorted by."""
    return t.weighing.best


def _over(one: CauseScore, other: CauseScore) -> float:
    """Return the logarithm of the Bayes factor of `one` over `other`, under the noise of `noise_of`. [-]"""
    noise = noise_of((one, other))
    return float(one.logs[noise] - other.logs[noise])


def _values(fit: Calibration) -> dict[str, float]:
    """Return path -> fitted value. [SI]"""
    return {p: v.value for p, v in fit.values.parameters.items()}


def _begun(request: Request, change: MissingElement | None) -> Mapping[str, float]:
    """Return the values of a fit with a defect and the clock of the log, to begin from; empty where it cannot be fitted."""
    if change is None:
        return {}
    try:
        return _values(_refit(replace(change.make(request), search="local"), {}, request.free))
    except (ThermidError, np.linalg.LinAlgError):
        return {}


def _weighed(fit: Calibration, change: MissingElement | None) -> CauseScore:
    """Return the score of a fit with a defect; a clock is evenly likely within its range."""
    assert fit.problem is not None
    late = [u for u in fit.problem.unknowns if u.kind == "local" and u.name.endswith(": delay")]
    sizes = {u.name: SizedValue(0.0, (u.high - u.low) / 12.0**0.5) for u in late}
    at = np.array(list(fit.fitted.values()))
    return weighed_at(fit.problem, at, {**sizes, **(change.sizes if change is not None else {})})


def _tried(request: Request, change: MissingElement | None, clock: Clock | None, begin: Mapping[str, float]) -> _Tried | None:
    """Return the refit with a defect and the clock from some values [SI]; nothing where it fails or is not shown."""
    if change is None and clock is None:
        return None
    changed = request if change is None else change.make(request)
    try:
        fit = _refit(replace(changed if clock is None else clock(changed), search="local"), begin, request.free)
        shown = change is None or (change.judge(fit)[1] and fit.own.fair and _decided(request, fit))
    except (ThermidError, np.linalg.LinAlgError):
        return None
    return _Tried(change, fit, _weighed(fit, change)) if shown and fit.converged else None


def _refit(request: Request, begin: Mapping[str, float], deck_values: Sequence[str]) -> Calibration:
    """Return the fit of a request from values [SI]; those not in `deck_values` stay within `MAX_DEFECT_FACTOR` of where they begin.

    It is given up where it takes long: nothing there is to be found.
    """
    problem = build_problem(request)

    def begun(u: Unknown) -> Unknown:
        """Return an unknown that starts where the rough fit ended, within wide bounds."""
        if u.kind == "parameter" and u.name not in deck_values and u.start > 0.0:
            u = replace(u, low=u.start / MAX_DEFECT_FACTOR, high=u.start * MAX_DEFECT_FACTOR)
        inside = u.name in begin and u.low <= begin[u.name] <= u.high
        return replace(u, start=begin[u.name]) if inside else u

    def watch(count: int, rms: float) -> None:
        """End a refit of too many evaluations."""
        if count > MAX_REFIT_EVALUATIONS:
            raise IdentificationError(f"{count} evaluations did not end a refit.", request.name, code="fit.model-fails")

    options = replace(problem.options, max_steps=MAX_REFIT_STEPS)
    return fit_problem(request, replace(problem, unknowns=tuple(begun(u) for u in problem.unknowns), options=options), watch)


def _decided(request: Request, fit: Calibration) -> bool:
    """Whether every value that a defect adds has a standard error below `UNDETERMINED` of it."""
    added_values = [v for p, v in fit.values.parameters.items() if p not in request.free]
    return all(v.error < UNDETERMINED * abs(v.value) for v in added_values)


def _finding(tried: _Tried) -> str:
    """Return what a fit with a defect found, in words."""
    delays = [(x.record, x.value, x.error) for x in tried.fit.local if x.name == "delay"]
    several = len(delays) > 1
    late = [
        f"powers{f' of {record}' if several else ''} that act {short(abs(value), 3)} s +- {short(error)} s "
        f"{'later' if value > 0 else 'earlier'} than logged"
        for record, value, error in delays
    ]
    texts = [f"{tried.change.name} ({tried.change.judge(tried.fit)[0]})"] if tried.change is not None else []
    return ", with ".join([*texts, " and ".join(late)] if late else texts)


# ---- the clock of what drives the model


Clock = Callable[[Request], Request]
"""Lays the clock of powers and commands over a request, whose fit finds it and the instants of their changes."""


def _clock(fit: Calibration) -> Clock | None:
    """Return the clock of a fit's powers and commands; None where none of them changes or a clock is looked for already."""
    driven = {
        e.record.name: [n for n, c in e.record.channels.items() if c.role in ("load", "command") and _moves(c)] for e in fit.experiments
    }
    at_rest = {e.record.name: _at_rest(e, fit) for e in fit.experiments}
    request = fit.request
    assert request is not None
    if any(r.clocks for r in request.records) or not any(driven.get(r.name) or at_rest.get(r.name) for r in request.records):
        return None

    def make(request: Request) -> Request:
        """Return the request with the clock."""
        scenarios, records = dict(request.scenarios), []
        for r in request.records:
            room = at_rest.get(r.name, "")
            far = max(FAR_STEPS * r.step, FAR_PART * r.duration)
            names = [n for n, c in r.channels.items() if c.role in ("load", "command")]
            moving = driven.get(r.name) or names if room else driven.get(r.name, [])
            begun = _with_rest(r, names, 1.25 * far) if room else r
            records.append(begun.delayed((-far, far), moving) if moving and far < 0.5 * r.duration else begun)
            if room:
                base = request.scenarios.get(r.name, request.scenarios.get("*")) or Scenario(r.name)
                scenarios[r.name] = base.with_(start=room, initial={})
        return replace(request, records=tuple(records), scenarios=scenarios)

    return make


def _moves(c: Channel) -> bool:
    """Whether the valid values of a channel differ."""
    return bool(c.valid.any() and np.ptp(c.values[c.valid]) > 0.0)


def _at_rest(e: Experiment, fit: Calibration) -> str:
    """Return the logged boundary at whose temperature everything stands at the start of a record; empty where it does not."""
    request = fit.request
    assert request is not None
    base = request.scenarios.get(e.record.name, request.scenarios.get("*"))
    start_is_stated = base is not None and (base.start not in ("", MEASURED) or base.initial)
    if start_is_stated or request.local or request.record_local or request.readings:
        return ""
    rooms = [c for c in e.record.channels.values() if c.role == "boundary" and c.valid.all()]
    if not rooms or len(rooms) != len(e.network.boundaries):
        return ""
    first = [float(c.values[0]) for c in rooms]
    near = all(
        abs(float(o.measured[0]) - first[0]) <= MAX_START_DEVIATIONS * float(np.hypot(o.noise or 0.0, o.accuracy or 0.0))
        for o in e.observations
    )
    return rooms[0].name if near and np.ptp(first) == 0.0 and e.observations else ""


def _with_rest(record: Record, driven: list[str], before: float) -> Record:
    """Return a record that begins with a rest without power.

    Parameters
    ----------
    driven : list       Powers and commands.
    before : float      Length of the rest. [s]
    """
    begin = float(record.times[0])
    times = np.concatenate([[begin - before, begin - min(1e-3, 1e-3 * before)], record.times])
    channels = []
    for n, c in record.channels.items():
        values = np.concatenate([[0.0, 0.0] if n in driven else c.values[[0, 0]], c.values])
        known = [n in driven or c.role == "boundary"] * 2
        channels.append(replace(c, values=values, valid=np.concatenate([known, c.valid]), masks={}))
    return replace(record, times=times, channels={c.name: c for c in channels})


def summary(explained: tuple[ExplainedFit, ...]) -> Iterator[str]:
    """Yield what explains the residuals, one line for each defect, its weight with it where there are several."""
    weights: dict[str, float] = {}
    words: dict[str, str] = {}
    for e in explained:
        weights[e.name] = weights.get(e.name, 0.0) + e.weight
        words.setdefault(e.name, e.words)
    for name, weight in sorted(weights.items(), key=lambda x: -x[1]):
        yield f"{words[name]}{f', probability {100 * weight:.0f} %' if len(weights) > 1 else ''}"
