"""`estimate`: records, free names and process noise in, an `Estimation` out; it reads as `calibrate` does."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from importlib.metadata import version
from typing import Any, Final

import numpy as np

from thermid.base.errors import IdentificationError
from thermid.base.linear_algebra import one_thread, symmetric_inverse
from thermid.base.units import Array, amount, duration_text, short
from thermid.fit._calibrate import differing, with_found_instants
from thermid.fit._estimation.estimation import OUTPUT, PROCESS, EstimatedNumber, Estimation, Estimator, whiteness_of
from thermid.fit._estimation.likelihood import Likelihood, Maximum, likelihood_of
from thermid.fit._estimation.outlook import OpenLoopScore, foresight, outlooks, starts_sd
from thermid.fit._estimation.process import ProcessNoise, read_process
from thermid.fit._problem.experiment import UNKNOWN_START_SD
from thermid.fit._problem.gather import build_problem
from thermid.fit._problem.request import LocalSpec, Request, freed, priors_of
from thermid.fit._problem.residuals import Problem
from thermid.measure.records import Record
from thermid.model.tree import Model
from thermid.simulation.runs import Scenario, refuse_unseen
from thermid.values.store import FittedValue, FittedValues

FITTED_SHARE: Final = 0.6
"""Part of every record that is fitted where the rest is left out to be foreseen."""
MIN_FITTED_SHARE: Final = 0.3
"""The same at least, for a long horizon."""
ORIGINS: Final = 8
"""Moments from which a left-out stretch is foreseen, at most."""
UNSEEN: Final = 3.0
"""Standard error of the logarithm of a size from which nothing of that noise is seen."""
MOVED: Final = 2.0
"""Errors by which a value may move as the noise goes to zero before it is named."""


def estimate(
    model: Model,
    records: Record | Sequence[Record],
    free: Sequence[str],
    *,
    process_noise: Mapping[str, Any],
    scenario: Scenario | Mapping[str, Scenario] | None = None,
    local: Mapping[str, Any] | None = None,
    priors: Mapping[str, Any] | None = None,
    start_sd: Mapping[str, str] | None = None,
    horizon: str | float = "",
    name: str = "",
) -> Estimation:
    """Return values of a model by maximum likelihood with process noise, beside those without it.

    Which of both to use is decided by readings that were left out, foreseen over `horizon` without a reading in between.

    Parameters
    ----------
    model, records, free, scenario, local, priors, name    As in `calibrate`; a start that is looked for is named in `local`
                                (``{"initial.wall": {"start": "25 [degC]", "sd": "7 [K]"}}``).
    process_noise : dict        Node, load or boundary -> ``"free"`` (a Wiener noise whose size is looked for), a size with its unit, or a
                                table with `kind` (``wiener``, ``gauss-markov``), `size`, `time` and `start`. A Wiener noise on a node is
                                in K/s^0.5, on a load W/s^0.5; on a boundary it is a random walk of what is added to it, in K/s^0.5.
    start_sd : dict             Node, or boundary with a random walk -> standard deviation of its start; otherwise zero where it is stated
                                or looked for, and 10 K where its own sensor reads it. [K]
    horizon : str               Over which predictions are compared; a fifth of the shortest record where nothing is said.

    Raises
    ------
    IdentificationError   When a noise names nothing or cannot be filtered, there is none, or records are too short for the horizon.
    """
    title = name or model.title
    if not process_noise:
        raise IdentificationError(
            "no process noise is given. Give process_noise = {'node': 'free'}, or use td.calibrate.", title, code="fit.nothing-free"
        )
    many = (records,) if isinstance(records, Record) else tuple(records)
    scenarios = dict(scenario) if isinstance(scenario, Mapping) else {"*": scenario} if scenario else {}
    specs = {k: LocalSpec.read(v, f"local.{k}") for k, v in (local or {}).items()}
    wanted, _ = freed(model, free, (), title)
    stated_priors = priors_of(model, priors or {}, title)
    request = Request(model, many, tuple(wanted), scenarios, specs, priors=stated_priors, name=title, fit_start=False)
    return estimated(request, process_noise, start_sd or {}, horizon)


def estimated(request: Request, process_noise: Mapping[str, Any], start_sd: Mapping[str, str], horizon: str | float) -> Estimation:
    """Return the estimation that a request asks for; see `estimate`."""
    with one_thread():
        return _estimated(request, process_noise, start_sd, horizon)


def _estimated(request: Request, noise_table: Mapping[str, Any], start_sd: Mapping[str, str], horizon: str | float) -> Estimation:
    """Return the estimation of a request: sizes of process noise by maximum likelihood, then what they give.

    Parameters
    ----------
    noise_table : dict          Node -> its process noise, as it is written.
    start_sd : dict             Node -> standard deviation of its start, as a text in K.
    horizon : str or float      Time that is foreseen [s]; a fifth of the shortest record where it is an empty text.

    Raises
    ------
    IdentificationError   When the horizon leaves less than `MIN_FITTED_SHARE` of a record to fit.
    """
    refuse_unseen(request.model, "a filter")
    whole = build_problem(request)
    problem = with_found_instants(whole)
    noises = read_process(noise_table, problem.experiments[0].network, request.name)
    starts = starts_sd(problem, start_sd, noises, request.name)
    spans = [float(e.times[-1]) for e in problem.experiments]
    ahead = 0.2 * min(spans) if isinstance(horizon, str) and not horizon else amount(horizon, "s", f"{request.name}, horizon")
    if not 0.0 < ahead <= (1.0 - MIN_FITTED_SHARE) * min(spans):
        raise IdentificationError(
            f"a horizon of {duration_text(ahead)} leaves too little to fit: of the {duration_text(min(spans))} of the shortest record "
            f"{100 * MIN_FITTED_SHARE:.0f} % are fitted at least. Give a shorter horizon.",
            request.name,
            code="value.outside-range",
        )
    split = [min(FITTED_SHARE * s, s - ahead) for s in spans]
    earlier = replace(request, records=tuple(r.trim("start", float(r.times[0]) + t) for r, t in zip(request.records, split, strict=True)))
    train = with_found_instants(build_problem(earlier))
    estimators = {}
    # without its noise a walk is a constant that nobody knows: output error is process noise with every size at zero
    still = tuple(replace(p, size=0.0, free=False) for p in noises if p.walks)
    for kind, noises_of_kind in ((OUTPUT, still), (PROCESS, noises)):
        full = likelihood_of(problem, noises_of_kind, starts)
        maximum = full.maximise(full.start)
        part = likelihood_of(train, noises_of_kind, starts)
        before = part.maximise(maximum.fitted, observed=False)
        score_ahead = _foreseen(full, before, split, spans, ahead)
        estimators[kind] = _estimator(kind, request, full, maximum, score_ahead)
    levels = tuple(
        f"what is added to {p.target} is unknown at the start to +- {UNKNOWN_START_SD:g} K, and stays constant in output error"
        for p in still
        if p.target not in starts and any(d.level_sd(p) > 0.0 for d in full.dynamics)
    )
    held = ("inputs that were sampled change when a fit without process noise says; errors of these instants are not counted",)
    remarks = (*levels, *_uncounted_noise(problem, noises), *(held if problem is not whole else ()))
    return _compared(request, estimators[PROCESS], estimators[OUTPUT], ahead, (remarks, starts, differing(problem)))


def _uncounted_noise(problem: Problem, noises: Sequence[ProcessNoise]) -> list[str]:
    """Return a remark on the noise of logged boundaries and powers, which is not counted; those with a process noise left out."""
    driven = {p.target for p in noises}
    sizes: dict[str, float] = {}
    for e in problem.experiments:
        for path, n in e.noisy.items():
            if path not in driven:
                sizes[path] = max(float(np.hypot(n.white, n.step / 12.0**0.5)), sizes.get(path, 0.0))
    if not sizes:
        return []
    boundaries = problem.experiments[0].network.boundaries
    named = ", ".join(f"'{p}' ({short(size)} {'K' if p in boundaries else 'W'})" for p, size in sizes.items())
    return [f"logged boundaries and powers are exact: the noise of {named} is not counted. `calibrate` counts it"]


def _foreseen(full: Likelihood, maximum: Maximum, split: Sequence[float], spans: Sequence[float], ahead: float) -> OpenLoopScore:
    """Return how well the later part of every record is foreseen with values (unknowns,) of the earlier one, over `ahead` [s].

    It is foreseen from at most `ORIGINS` instants, half of `ahead` apart or more, between `split` and `ahead` before the end `spans` of
    each record. [s]
    """
    covariance = symmetric_inverse(maximum.information)
    outlooks_of_records = []
    for i, (begin, end) in enumerate(zip(split, spans, strict=True)):
        last = max(begin, end - ahead)  # a horizon fits between it and the end
        origins = np.linspace(begin, last, max(1, min(ORIGINS, int((last - begin) / (0.5 * ahead)) + 1)))
        outlooks_of_records += outlooks(full, i, maximum.fitted, covariance, origins, ahead)
    return foresight([several for several in outlooks_of_records if several])


def _whole(full: Likelihood, maximum: Maximum) -> float:
    """Return the RMSE of runs from the starts without any later reading. [K]"""
    none = np.zeros_like(maximum.information)
    outlooks_of_records = []
    for i, d in enumerate(full.dynamics):
        outlooks_of_records += outlooks(full, i, maximum.fitted, none, np.zeros(1), float(d.grid[-1]))
    return foresight(outlooks_of_records).rmse


def _estimator(name: str, request: Request, full: Likelihood, maximum: Maximum, score_ahead: OpenLoopScore) -> Estimator:
    """Return values with standard errors of a maximum, widened where the innovations are not white."""
    white = whiteness_of(full, maximum.fitted)
    widened = max((w.widening for w in white), default=1.0)
    if widened > 1.0:
        maximum = _widened(full, maximum, widened)
    errors = maximum.errors()
    numbers = {}
    for u, fitted, error in zip(full.unknowns, maximum.fitted, errors, strict=True):
        numbers[u.name] = EstimatedNumber(
            u.name, u.to_value(float(fitted)), float(error) * u.slope(float(fitted)), "degC" if u.unit == "degC" else u.unit
        )
    values = _values(request, full, maximum, errors)
    return Estimator(name, full, maximum, values, numbers, score_ahead, _whole(full, maximum), white, widened)


def _widened(full: Likelihood, maximum: Maximum, factor: float) -> Maximum:
    """Return a maximum with information (I - P) / factor^2 + P: its readings state less by the square of a factor [-], priors P stay."""
    slopes = full.priors(maximum.fitted)[1]
    prior_information = slopes.T @ slopes
    return replace(maximum, information=(maximum.information - prior_information) / factor**2 + prior_information)


def _values(request: Request, full: Likelihood, maximum: Maximum, errors: Array) -> FittedValues:
    """Return parameters and constant errors as a values file holds them."""
    positions = [k for k, u in enumerate(full.unknowns) if u.kind not in ("local", "noise")]
    covariance = symmetric_inverse(maximum.information)
    items = {}
    for k in positions:
        u, fitted = full.unknowns[k], float(maximum.fitted[k])
        error = float(errors[k]) * u.slope(fitted)
        prior = (u.prior.mean, u.prior.sd) if u.prior is not None else None
        value = FittedValue(
            u.name, u.to_value(fitted), error, error if u.kind == "parameter" else 0.0, u.log, u.unit, u.start, (u.low, u.high)
        )
        items[u.name] = replace(value, origin=request.name, kind=u.kind, prior=prior, also=u.also)
    provenance = {
        "records": {r.name: r.origin.sha256 for r in request.records},
        "version": version("thermid"),
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
    }
    return FittedValues(request.name, items, covariance[np.ix_(positions, positions)], provenance)


def _compared(
    request: Request,
    process: Estimator,
    output: Estimator,
    ahead: float,
    notes: tuple[tuple[str, ...], Mapping[str, float], list[str]],
) -> Estimation:
    """Return the estimation with process noise beside output error, and the likelihood ratio between them.

    The ratio is ``2 (ln L_process - ln L_output)``. Without process noise a size stands at zero, its bound, so that the ratio is
    distributed half as chi-square of k degrees of freedom and half as that of k - 1, with k further unknowns (Self and Liang, J. Am.
    Stat. Assoc. 82 (1987) 605). p is the probability of as large a ratio.

    A parameter is `moved` where the noise moves it by more than `MOVED` of its standard errors.
    """
    from scipy.special import gammaincc

    ratio = 2.0 * (process.log_likelihood - output.log_likelihood)
    freedom = max(len(process.likelihood.unknowns) - len(output.likelihood.unknowns), 1)
    # a size at its bound of zero: half the mass of the last degree of freedom stands there (Self and Liang, JASA 82 (1987) 605)
    p = (
        1.0
        if ratio <= 0
        else float(
            0.5 * gammaincc(0.5 * freedom, 0.5 * ratio) + (0.5 * gammaincc(0.5 * (freedom - 1), 0.5 * ratio) if freedom > 1 else 0.0)
        )
    )
    place = {u.name: k for k, u in enumerate(output.likelihood.unknowns)}
    errors = process.maximum.errors()
    moved = []
    for k, u in enumerate(process.likelihood.unknowns):
        if u.kind != "noise" and abs(process.maximum.fitted[k] - output.maximum.fitted[place[u.name]]) > MOVED * errors[k]:
            moved.append(u.name)
    assumed, starts, remarks = notes
    warnings = (*_warnings(process, output, moved), *remarks)
    return Estimation(request.name, request.model, process, output, ahead, ratio, p, tuple(moved), warnings, assumed, request, starts)


def _warnings(process: Estimator, output: Estimator, moved: Sequence[str]) -> tuple[str, ...]:
    """Return sentences on values that depend on the process noise, searches that did not end, open values, bounds and innovations.

    `moved` are values that differ by more than two standard errors without process noise.
    """
    out = []
    if moved:
        named = ", ".join(f"'{m}'" for m in moved)
        verb = "moves" if len(moved) == 1 else "move"
        out.append(
            f"{named} {verb} by more than two standard errors when the process noise goes to zero, so the value depends on that choice"
        )
    for e in (process, output):
        if not e.maximum.converged:
            out.append(f"{e.name}: the search did not converge in {e.maximum.steps} steps")
        out += [
            f"{e.name}: '{f.name}' has no finite error, because the logs do not determine it"
            for f in e.found.values()
            if not np.isfinite(f.error)
        ]
    errors = process.maximum.errors()
    for k, u in enumerate(process.likelihood.unknowns):
        low, high = u.fitted_bounds()
        end = process.maximum.fitted[k]
        if u.name.startswith("noise of") and (end - low < 3.0 or UNSEEN < errors[k] / process.widened < np.inf):
            out.append(f"'{u.name}' went to zero, so the logs show no such noise. Remove it")
        elif np.isfinite(low + high) and min(end - low, high - end) < 1e-4:
            out.append(f"'{u.name}' ended at a bound, so its error is not meaningful. Widen the bound")
    for w in process.white:
        if w.loud:
            out.append(
                f"{process.name}: innovations of {w.sensor} are {short(w.size)} times the stated noise, so the errors were widened. Check "
                "the noise, or look for missing physics"
            )
        if not w.white:
            out.append(
                f"{process.name}: innovations of {w.sensor} are not white, so the errors were widened. Add process noise at another "
                "node, or look for missing physics"
            )
    return tuple(out)
