"""From the end of a minimisation to a `Calibration`."""

from __future__ import annotations

from datetime import UTC, datetime
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from thermid.fit.calibration import Calibration, Local
from thermid.fit.contradicted import FAR, far_from_sheet, loudly
from thermid.fit.least_squares.solve import Fit
from thermid.fit.problem.residuals import Predictions, Problem
from thermid.fit.problem.starts import UNSAID_NOISE
from thermid.fit.problem.statistics import wanders
from thermid.fit.problem.unknowns import Unknown
from thermid.fit.standings import at_bounds, own_standing, rests_on
from thermid.fit.stored import stored
from thermid.fit.uncertainty.moved import moves_above
from thermid.fit.uncertainty.responses import Responses
from thermid.knowledge.values import FittedValue, FittedValues, view
from thermid.measure.amounts import short
from thermid.model.laws.signal import Table
from thermid.model.parts.standing import worst

if TYPE_CHECKING:
    from thermid.fit.problem.request import Request
    from thermid.fit.uncertainty.wander import Wander

Array = NDArray[np.float64]
CHANCE = 0.01


def summarise(request: Request, problem: Problem, found: Fit, known: Responses, random: Array, spread: Wander | None = None) -> Calibration:
    """Return the calibration that a fit ended with; `known` says what its errors come from, `random` is their part by noise."""
    name, total = request.name or request.model.title, known.total
    origin = f"{name}: {_listed([r.name for r in request.records])}"
    kept = [k for k, u in enumerate(problem.unknowns) if u.kind != "local"]
    items = {u.name: _value(u, float(found.fitted[k]), total[k, k], random[k, k], origin) for k in kept for u in (problem.unknowns[k],)}
    records = {r.name: r.origin.sha256 for r in request.records}
    provenance: dict[str, Any] = {
        "version": version("thermid"),
        "date": datetime.now(UTC).date().isoformat(),
        "model": request.model.identity(),
        "records": records,
        "synthetic": any(r.origin.synthetic for r in request.records),
    }
    own = np.ix_(kept, kept)
    values = FittedValues(name, items, total[own], provenance)
    alone, rests = own_standing(request, problem, found, values, total, spread), rests_on(request, values)
    store = stored(request, problem, values.judged(worst([alone, *rests.values()])), known)
    values = view(store, list(values), name)
    bias = dict(problem.fixed_bias) | {s: v.value for s, v in values.sensors.items()}
    blocks = Predictions(found.sums, problem, found.fitted)
    local = tuple(_local(u, found.fitted[k], total[k, k]) for k, u in enumerate(problem.unknowns) if u.kind == "local")
    freedom = round(problem.worth) - len(problem.unknowns)
    moved = moves_above(request, problem, found, spread.level if spread is not None else 1.0)
    return Calibration(
        name,
        request.model,
        values,
        local,
        blocks,
        bias,
        records,
        correlations_of(problem, total),
        found.chi_square,
        freedom,
        found.evaluations,
        request.loss,
        (
            *loudly(values),
            *far_from_sheet(request.model, values),
            *request.remarks,
            *_warnings(problem, found, total, spread),
            *found.remarks,
            *(_wandering(spread) if spread is not None else ()),
            *moved.warnings(),
        ),
        bool(provenance["synthetic"]),
        {**request.seen, **{r.origin.sha256: f"stage '{name}' as '{r.name}'" for r in request.records}},
        problem.experiments,
        {u.name: float(x) for u, x in zip(problem.unknowns, found.fitted, strict=True)},
        found.converged,
        request,
        problem,
        moved,
        spread,
        search=found.search,
        own=alone,
        rests=rests,
        store=store,
    )


def _listed(names: list[str]) -> str:
    return ", ".join(names) if len(names) <= 4 else f"{names[0]} ... {names[-1]} ({len(names)} records)"


def _value(u: Unknown, fitted: float, total: float, random: float, origin: str) -> FittedValue:
    slope = u.slope(fitted)
    errors = (slope * float(np.sqrt(total)), slope * float(np.sqrt(random)) if u.kind == "parameter" else 0.0)
    prior = (u.prior.mean, u.prior.sd) if u.prior is not None else None
    return FittedValue(
        u.name, u.to_value(fitted), errors[0], errors[1], u.log, u.unit, u.start, (u.low, u.high), origin, u.kind, prior, u.also
    )


def _local(u: Unknown, fitted: float, variance: float) -> Local:
    record, _, name = u.name.partition(": ")
    return Local(record, name, float(fitted), float(np.sqrt(variance)), u.unit)


def correlations_of(problem: Problem, total: Array) -> dict[tuple[str, str], float]:
    """Return (path, path) -> correlation in a covariance of all unknowns, those above 0.1."""
    names = [(k, u.name) for k, u in enumerate(problem.unknowns) if u.kind in ("parameter", "sensor", "instrument")]
    out = {}
    for i, (k, first) in enumerate(names):
        for m, second in names[i + 1 :]:
            size = np.sqrt(total[k, k] * total[m, m])
            value = float(total[k, m] / size) if size > 0 and np.isfinite(size) else 0.0
            if abs(value) > 0.1:
                out[first, second] = value
    return out


def _warnings(problem: Problem, found: Fit, total: Array, spread: Wander | None) -> list[str]:
    """Return what a reader must know."""
    out = []
    if not found.converged:
        out.append(f"the fit did not converge: {found.message}")
    for u, side, bound in at_bounds(problem, found, total):
        shown = FittedValue(u.name, u.to_value(bound), 0, 0, u.log, u.unit, 0, (0, 0)).in_unit
        out.append(f"'{u.name}' ended at its {side} bound {shown:.6g}; its error is not meaningful. Widen the bound or fix it.")
    for k, u in enumerate(problem.unknowns):
        far = abs(found.fitted[k] - u.prior.mean) / u.prior.sd if u.prior is not None and u.kind != "local" else 0.0
        if 3.0 < far <= FAR:  # what lies farther stands at the head of the fit
            out.append(f"'{u.name}' lies {far:.1f} standard deviations from its prior; one of them is wrong.")
    out += _strained(problem, found)
    out += _taken_as_instants(problem)
    freedom = round(problem.worth) - len(problem.unknowns)
    reduced = found.chi_square / max(freedom, 1)
    stated = all(o.noise is not None for o in problem.observations())
    if stated and freedom > 0 and reduced > 1.5:
        widened = "; the errors were widened by that factor" if spread is None or spread.level > 1.5 else ""
        out.append(f"the residuals are {short(np.sqrt(reduced))} times the stated noise{widened}.")
    return out


def _wandering(spread: Wander) -> list[str]:
    """Return one remark on traces whose residuals wander."""
    slow = [t for t in spread.traces if wanders(t.effective, t.samples)]
    # one white trace in a hundred looks as if it wandered
    if len(slow) <= CHANCE * len(spread.traces) + 3.0 * np.sqrt(CHANCE * (1.0 - CHANCE) * len(spread.traces)):
        return []
    share = f"{len(slow)} of {len(spread.traces)} traces" if len(spread.traces) > 1 else "the trace"
    count, worth = sum(t.samples for t in slow), sum(t.effective for t in slow)
    return [
        f"residuals of {share} are not white: the model misses something, or the readings were filtered. Their {count} samples are worth "
        f"{short(worth)} independent ones, and the errors were widened accordingly."
    ]


def _taken_as_instants(problem: Problem) -> list[str]:
    """Return one remark on logged boundaries that change between samples by more than the noise, where nobody said what a sample is.

    The mean over an interval is the instant of its middle: half a change between two samples apart.
    """
    apart: dict[str, float] = {}
    for e in problem.experiments:
        noise = min((o.noise for o in e.observations if o.noise is not None), default=UNSAID_NOISE)
        for name, given in e.scenario.boundaries.items():
            if isinstance(given, Table) and not given.held and not given.samples:
                half = 0.5 * float(np.sqrt(np.mean(np.diff(given.levels) ** 2)))
                if half > noise:
                    apart[name] = max(half, apart.get(name, 0.0))
    if not apart:
        return []
    shown = ", ".join(f"'{n}' ({short(k)} K)" for n, k in apart.items())
    return [
        f"samples of logged boundaries are taken as instants; as means over the intervals up to their stamps they would drive the model "
        f"otherwise by more than the noise: {shown}. Say samples = 'instant' or 'average' of their channels."
    ]


def _strained(problem: Problem, found: Fit) -> list[str]:
    """Return one remark on the values of single records that lie far from their priors."""
    far = {
        u.name: abs(found.fitted[k] - u.prior.mean) / u.prior.sd
        for k, u in enumerate(problem.unknowns)
        if u.kind == "local" and u.prior is not None and abs(found.fitted[k] - u.prior.mean) > 3 * u.prior.sd
    }
    if not far:
        return []
    worst = max(far, key=far.__getitem__)
    count = sum(u.kind == "local" and u.prior is not None for u in problem.unknowns)
    return [
        f"{len(far)} of {count} values of single records lie more than 3 standard deviations from their priors, '{worst}' the farthest "
        f"with {far[worst]:.1f}: the priors are too tight, or the model makes these values answer for something that it misses."
    ]
