"""`calibrate`: records and free names in, a `Calibration` out, or a refusal that says why."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np

from thermid.arguments import takes_objects
from thermid.errors import IdentificationError, SolverError
from thermid.fit.calibration import Calibration
from thermid.fit.clocks.search import at_clocks, in_turns, with_clocks
from thermid.fit.contradicted import FIRST
from thermid.fit.discrepancy import with_discrepancy
from thermid.fit.hand_stage import tuned_by_hand
from thermid.fit.inputs import inputs_of
from thermid.fit.least_squares.search import searched
from thermid.fit.least_squares.solve import Fit, covariances, ended, minimise
from thermid.fit.mistakes import mistakes, strange_powers
from thermid.fit.problem.gather import problem_for
from thermid.fit.problem.request import LocalSpec, Request
from thermid.fit.problem.residuals import Problem
from thermid.fit.problem.selection import freed, priors_of
from thermid.fit.problem.statistics import pooled
from thermid.fit.refusals import refuse_after, refuse_before
from thermid.fit.summary import summarise
from thermid.fit.uncertainty.responses import responses
from thermid.fit.uncertainty.wander import wander
from thermid.measure import Record
from thermid.model.tree.model import Model
from thermid.simulation.scenarios.scenario import Scenario

Progress = Callable[[int, float], None]


@takes_objects
def calibrate(
    model: Model,
    records: Record | Sequence[Record],
    free: Sequence[str],
    *,
    scenario: Scenario | Mapping[str, Scenario] | None = None,
    local: Mapping[str, Any] | None = None,
    priors: Mapping[str, tuple[str, str] | str] | None = None,
    loss: str = "linear",
    search: str = "auto",
    name: str = "",
    progress: Progress | None = None,
) -> Calibration:
    """Return the fit of some parameters of a model to one or several records.

    Parameters
    ----------
    model : Model               What the hardware is.
    records : Record(s)         Logs whose channels are bound to nodes, boundaries, loads or commands.
    free : sequence of str      Paths of the parameters to fit, or globs such as ``pre.*.htc``; all others stay as they are.
    scenario : Scenario(s)      What the logs do not say; one for all, or one by record name.
    local : dict                Values that each record has for itself: boundary or ``initial.<node>`` -> ``{start, sd}``.
    priors : dict               Path or glob -> (mean, standard deviation), texts with units; or ``"range"`` for that of its data sheet.
    loss : str                  linear, soft_l1, huber or cauchy.
    search : str                local, multistart, differential evolution, cma; or auto: further starts where one descent is doubtful.
    progress : callable         Called with the number of evaluations and the RMS of the weighted residuals.

    Raises
    ------
    IdentificationError   When parameters act only as a product, or a standard error is wider than the bounds; the message says what to do.
    """
    many = (records,) if isinstance(records, Record) else tuple(records)
    scenarios = dict(scenario) if isinstance(scenario, Mapping) else {"*": scenario} if scenario else {}
    specs = {k: LocalSpec.read(v, f"local.{k}") for k, v in (local or {}).items()}
    wanted, _ = freed(model, free, (), name or model.title)
    known = priors_of(model, priors or {}, name or model.title)
    request = Request(model, many, tuple(wanted), scenarios, specs, priors=known, loss=loss, search=search, name=name)
    return fit(request, progress)


def fit(request: Request, progress: Progress | None = None, known: Mapping[str, float] | None = None) -> Calibration:
    """Return the calibration that a request asks for; see `calibrate`.

    `known` is the end of the same fit from before, unknown -> fitted form; it is then evaluated and not searched again.
    """
    if request.hand is not None:
        return tuned_by_hand(request, request.hand)
    return fit_problem(request, problem_for(request), progress, known)


def fit_problem(
    request: Request, problem: Problem, progress: Progress | None = None, known: Mapping[str, float] | None = None
) -> Calibration:
    """Return the calibration of a problem that was made for a request."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(limits=1):  # matrices of up to some hundred rows: two threads wait for one another a hundred times longer
        return _fitted(request, problem, progress, known)


def _fitted(request: Request, problem: Problem, progress: Progress | None, known: Mapping[str, float] | None) -> Calibration:
    stated = all(o.noise is not None for o in problem.observations())
    if known is not None and list(known) == [u.name for u in problem.unknowns]:
        found = ended(problem, np.array(list(known.values())), request.loss, request.knee)
    else:
        with _units_asked(problem):
            problem = with_clocks(problem, request.loss, request.knee)
            refuse_before(request, problem, lambda r: fit(r))
            found = searched(problem, request.search, request.loss, request.knee, progress)
            problem, found = in_turns(problem, found, request.loss, request.knee, progress)
        if not stated:
            weighed = replace(problem, noise=_measured_noise(problem, found, request.loss))
            again = minimise(weighed, request.loss, request.knee, found.fitted, progress)
            found = replace(again, evaluations=found.evaluations + again.evaluations, search=found.search, remarks=found.remarks)
    problem = at_clocks(problem, found.fitted)
    if not stated:
        # from the end alone, so that a fit taken from before says the same
        problem = replace(problem, noise=_measured_noise(problem, found, request.loss))
        again = ended(problem, found.fitted, request.loss, request.knee)
        kept = {k: getattr(found, k) for k in ("evaluations", "message", "converged", "search", "remarks")}
        found = replace(again, **kept)
    spread = wander(problem, found, request.loss, request.knee)
    _, random, weights = covariances(found, spread.level, spread.excess)
    asked = strange_powers(problem)
    found = replace(found, remarks=(*found.remarks, *asked))
    if stated and request.free and len(problem.experiments) == len(request.records):
        more = mistakes(request, problem, found.chi_square / _freedom(problem), _misfit)
        found, asked = replace(found, remarks=(*found.remarks, *more)), (*asked, *more)
    try:
        refuse_after(request, problem, found, weights)  # what the data can tell, not how badly a wrong model fits them
    except IdentificationError as refusal:
        unlogged = (f"{r.words}." for r in inputs_of(request, problem.experiments, problem.unknowns).assumed if r.kind == "load")
        questions = dict.fromkeys(a.removeprefix(FIRST) for a in (*asked, *unlogged))
        raise IdentificationError(" ".join([refusal.message, *(f"{a[0].upper()}{a[1:]}" for a in questions)]), refusal.where) from None
    errors = responses(request, problem, found, spread.level, random, weights)
    return with_discrepancy(summarise(request, problem, found, errors, random, spread))


@contextmanager
def _units_asked(problem: Problem) -> Iterator[None]:
    """Let a run that breaks off say which logged powers may be in another unit."""
    try:
        yield
    except SolverError as error:
        raise SolverError(" ".join([error.message, *(a.removeprefix(FIRST) for a in strange_powers(problem))]), error.where) from None


def _freedom(problem: Problem) -> float:
    return max(problem.worth - len(problem.unknowns), 1.0)


def _misfit(request: Request) -> float:
    """Return the weighted sum of squares per degree of freedom that one descent from the start leaves. [-]"""
    problem = problem_for(request)
    return minimise(problem, request.loss, request.knee).chi_square / _freedom(problem)


def _measured_noise(problem: Problem, found: Fit, loss: str) -> dict[str, float]:
    """Return sensor -> noise: as stated, or the RMS of its residuals where nothing was stated. [K]

    Where the loss is robust, outliers are expected; 1.4826 times the median size of the residuals stands for their RMS.
    """
    stated = {o.sensor: o.noise for o in problem.observations()}
    out = {sensor: noise for sensor, noise in stated.items() if noise is not None}
    blocks = problem.blocks(found.fitted) if loss != "linear" else []
    for sensor in (s for s in stated if s not in out):
        if loss == "linear":
            size = np.sqrt(pooled([s for _, name, s in found.sums if name == sensor]).mean_square)
        else:
            size = 1.4826 * np.median(np.abs(np.concatenate([b.residuals for b in blocks if b.sensor == sensor])))
        out[sensor] = max(float(size), 1e-6)
    return out
