"""`criticise`: what the residuals of a fit say against its model, and which element, tried in a refit, would answer it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from thermid.base.errors import IdentificationError, ThermidError, time_left
from thermid.base.linear_algebra import one_thread
from thermid.base.results import Result
from thermid.base.units import HOUR, Array, duration_text, short
from thermid.fit.calibration import Calibration, Request, SensorStatistics, fit as refit
from thermid.inference._explain.candidates import missing_elements
from thermid.inference._explain.heats import unlogged_powers
from thermid.inference._explain.structures import EvaluationBudget, FittedStructure, Try, fitted_structure, fitted_structures
from thermid.inference._explain.thresholds import (
    MAX_CHANCE_DEVIATIONS,
    MAX_REFITTED_ELEMENTS,
    MIN_RECORDS_COMPARED,
    TIE,
    VERY_STRONG,
)
from thermid.inference._explain.weighing import noise_of
from thermid.simulation.runs import Workers, refuse_unseen, simulate

_Item = TypeVar("_Item")


@dataclass(frozen=True, eq=False)
class TraceCriticism:
    """The residuals of one sensor in one record.

    Parameters
    ----------
    record, sensor : str
    times, temperature, power, residuals : array (samples,)     [s], [K], [W] (all loads together), [K]
    noise : float           What was stated of the readings; the RMSE where nothing was. [K]
    statistics : SensorStatistics   Their size, correlation of neighbours, and what they are worth: those of the fit.
    slopes : dict           'temperature' [K/K], 'power' [K/W], 'time' [K/s] -> (slope, standard error), correlation counted.
    """

    record: str
    sensor: str
    times: Array
    temperature: Array
    power: Array
    residuals: Array
    noise: float
    statistics: SensorStatistics
    slopes: Mapping[str, tuple[float, float]]

    @property
    def loud(self) -> bool:
        """Whether the mean square exceeds the stated noise variance by more than 3 sqrt(2 / n) of it; a few bad readings suffice."""
        return bool(self.statistics.rmse**2 > self.noise**2 * (1.0 + MAX_CHANCE_DEVIATIONS * np.sqrt(2.0 / self.residuals.size)))

    @property
    def is_noise(self) -> bool:
        """Whether the residuals are independent noise of the stated size: white, by `SensorStatistics.white`, and not `loud`."""
        return self.statistics.white and not self.loud

    def to_dict(self) -> dict[str, Any]:
        """Return its figures, in SI."""
        sizes = {k: getattr(self.statistics, k) for k in ("rmse", "lag_one", "effective_samples", "white")}
        slopes = {n: {"slope": slope, "error": error} for n, (slope, error) in self.slopes.items()}
        return {"record": self.record, "sensor": self.sensor, "noise": self.noise, **sizes, "loud": self.loud, "slopes": slopes}

    def __str__(self) -> str:
        """RMSE, autocorrelation, and what the residuals go with, in words."""
        s = self.statistics
        head = f"{self.sensor} in {self.record}: RMSE {short(s.rmse, 3)} K"
        if self.loud:
            head += f" for a noise of {self.noise:.3g} K"
        if s.white:
            return f"{head}, independent from reading to reading"
        text = f"{head}, autocorrelated (lag-1 {s.lag_one:.2f}): for a mean, {s.samples} readings are worth {short(s.effective_samples, 3)}"
        units = {"temperature": ("K per K of temperature", 1.0), "power": ("K per W", 1.0), "time": ("K per hour", HOUR)}
        for name, (slope, error) in self.slopes.items():
            if abs(slope) > MAX_CHANCE_DEVIATIONS * error:
                text += f"; they go with {name}: {slope * units[name][1]:+.2g} {units[name][0]} ({abs(slope) / error:.0f} standard errors)"
        return text


@dataclass(frozen=True, eq=False)
class Candidate:
    """An element that was laid over the model.

    Parameters
    ----------
    name : str              What it is.
    found : str             What the refit found for it; empty where one evaluation promised less than others, so that none was made.
    possible : bool         Whether that is physically possible.
    evidence : float        Twice the logarithm of the Bayes factor over the model as it is. [-]
    rmse : (float, float)   Before and after, all sensors, at the values that are likeliest in the noise of the comparison. [K]
    weighted : (float, float)   The same in units of the stated noise, weighed by the inverse of that noise: what the evidence rests on. [-]
    fit : Calibration       The full fit of what is suggested; None of all others.
    refused : str           Why it could not be tried; empty where it was.
    """

    name: str
    found: str = ""
    possible: bool = True
    evidence: float = -np.inf
    rmse: tuple[float, float] = (np.nan, np.nan)
    weighted: tuple[float, ...] = (np.nan, np.nan)
    fit: Calibration | None = None
    refused: str = ""

    @property
    def proved(self) -> bool:
        """Whether the evidence is very strong."""
        return self.evidence > VERY_STRONG

    def to_dict(self) -> dict[str, Any]:
        """Return its figures, in SI; `tried` is whether it was refitted."""
        keys = ("name", "found", "possible", "evidence", "refused")
        pairs = {k: list(getattr(self, k)) for k in ("rmse", "weighted")}
        return {**{k: getattr(self, k) for k in keys}, **pairs, "tried": bool(self.found)}

    def __str__(self) -> str:
        """The candidate in words."""
        if self.refused:
            return f"{self.name}: could not be tried with these readings: {self.refused}"
        how = "very strong" if self.proved else "strong" if self.evidence > 2.0 * TIE else "weak"
        text = f"{self.name}: {how} evidence (twice the logarithm of the Bayes factor {self.evidence:+.3g})"
        word = "" if self.possible else ", which is not physically possible"
        rmse, weighted = (" -> ".join(short(x, 3) for x in pair) for pair in (self.rmse, self.weighted))
        return f"{text}; found {self.found}{word}; RMSE {rmse} K, weighed by the noise {weighted}"


@dataclass(frozen=True, eq=False)
class Criticism(Result):
    """What speaks against a model.

    Parameters
    ----------
    title : str                         The fit.
    traces : tuple of TraceCriticism    Per record and sensor.
    candidates : tuple of Candidate     Elements that were tried, the best supported first.
    checks : tuple of str               Failed checks: values of single records that run with an input.
    wander : float                      Over what time residuals that count as noise wander; zero where all noise is independent. [s]
    """

    title: str
    traces: tuple[TraceCriticism, ...]
    candidates: tuple[Candidate, ...]
    checks: tuple[str, ...] = ()
    wander: float = 0.0

    @property
    def suggested(self) -> Candidate | None:
        """The best supported element whose value is possible, with very strong evidence; None where there is none."""
        return next((c for c in self.candidates if c.found and c.possible and c.proved), None)

    def to_dict(self) -> dict[str, Any]:
        """Return traces and candidates, in SI; `suggested` is the name of the best supported one, or nothing."""
        best = self.suggested
        return {
            "stage": self.title,
            "suggested": None if best is None else best.name,
            "traces": [t.to_dict() for t in self.traces],
            "candidates": [c.to_dict() for c in self.candidates],
            "failed_checks": list(self.checks),
        }

    def __str__(self) -> str:
        """Return findings and suggestion as text."""
        coloured = [t for t in self.traces if not t.is_noise]
        lines = [f"{self.title}: residuals are noise in {len(self.traces) - len(coloured)} of {len(self.traces)} traces"]
        lines += [f"  failed check: {check}" for check in self.checks]
        lines += [f"  {t}" for t in (coloured or self.traces)[:8]]
        if self.candidates:
            about = duration_text(float(short(self.wander, 2)))
            wander = f" residuals autocorrelated over about {about} count as noise, so RMSE need not fall" if self.wander else ""
            lines.append(f"  candidates, each alone:{wander}")
            lines += [f"    {c}" for c in self.candidates if c.refused or c.evidence > 2.0 * TIE]
            idle = [c.name for c in self.candidates if c.found and c.evidence <= 2.0 * TIE]
            lines += [f"    no strong evidence for {'; '.join(idle)}"] if idle else []
            rest = [c.name for c in self.candidates if not (c.found or c.refused)]
            lines += [f"    not refitted, as one evaluation promises less of them: {'; '.join(rest)}"] if rest else []
            best = self.suggested
            if best is not None:
                others = [c for c in self.candidates if c is not best and c.found and c.possible and c.proved]
                rivals = [c.name for c in others if best.evidence - c.evidence < 2.0 * TIE]
                also = f" These readings cannot separate it from {' or '.join(rivals)}." if rivals else ""
                lines.append(f"  Suggested: {best.name}: {best.found}.{also}")
            elif coloured:
                lines.append(
                    "  None of the candidates explains the residuals. Look for a disturbance that was not logged, or use more nodes."
                )
        return "\n".join(lines)


def criticise(
    fit: Calibration, elements: bool | None = None, *, executor: Workers = None, progress: Callable[[str, float], None] | None = None
) -> Criticism:
    """Residual analysis of a fit: are the residuals white noise, and which missing element would explain them?

    Parameters
    ----------
    fit : Calibration   The fit.
    elements : bool     Whether missing elements are tried in refits; by default only where residuals are not independent, or too large.
    executor            As in `ensemble`: who makes the refits; the same answer from all.
    progress : callable Called with what is done, in words, and the share of all that is finished.

    Raises
    ------
    IdentificationError   When the fit was not made in this session.

    Notes
    -----
    Residuals are white by the criterion that a fit states (`SensorStatistics.white`).

    The Bayes factor allows the model as it is to have its residuals by chance:
    on either side they are independent errors and a part that wanders, as large and as slow as makes them likeliest. Values that an element
    adds are integrated over their priors.
    """
    if fit.request is None or fit.problem is None:
        raise IdentificationError(
            "this calibration was not made by a fit in this session; repeat the fit.", fit.stage, code="fit.needs-session"
        )
    traces, checks = tuple(_criticise_traces(fit)), tuple(running_locals(fit))
    wanted = (any(not t.is_noise for t in traces) and fit.given_model.runner is None) if elements is None else elements
    if wanted:
        refuse_unseen(fit.given_model, "a search for missing elements")
    if not wanted:
        return Criticism(fit.stage, traces, (), checks)
    candidates, wander = _tried(fit, fit.request, executor, progress or time_left("criticise"))
    return Criticism(fit.stage, traces, tuple(candidates), checks, wander)


def running_locals(fit: Calibration) -> list[str]:
    """Failed checks of values that each record has for itself: a fitted ambient cannot know the power of its record.

    A value that goes with the mean power or command of its record answers for heat that the model misses. A parabola over records is
    compared with a constant by the F test at 1 %, for as many inputs as are looked at (Bonferroni).
    """
    from scipy.special import fdtrc

    means = {
        e.record.name: {
            c.target or c.name: float(c.values[c.valid].mean())
            for c in e.record.channels.values()
            if c.role in ("load", "command") and c.valid.any()
        }
        for e in fit.experiments
    }
    names = list(dict.fromkeys(n for table in means.values() for n in table))
    out = []
    for local in dict.fromkeys(v.name for v in fit.local):
        if local.startswith("initial."):
            continue
        local_values = {v.record: v.value for v in fit.local if v.name == local}
        best = (1.0, "")
        for name in names:
            pairs = np.array([(means[r][name], value) for r, value in local_values.items() if name in means[r]]).reshape(-1, 2)
            if len(pairs) < MIN_RECORDS_COMPARED or np.ptp(pairs[:, 0]) <= 0:
                continue
            x, y = pairs[:, 0] - pairs[:, 0].mean(), pairs[:, 1] - pairs[:, 1].mean()
            design = np.column_stack([np.ones_like(x), x, x**2])
            fitted = design @ np.linalg.lstsq(design, y, rcond=None)[0]
            squares_left, gone = float(np.sum((y - fitted) ** 2)), float(np.sum(fitted**2))
            ratio = 0.5 * gone / max(squares_left / (len(x) - 3), 1e-300)
            chance = float(fdtrc(2.0, len(x) - 3.0, ratio)) * len(names)
            words = (
                f"'{local}' of {len(x)} records correlates with the mean of '{name}': {short(float(np.ptp(fitted)), 2)} K over its range"
            )
            best = min(best, (chance, words))
        if best[0] < 0.01:
            out.append(f"{best[1]} (by chance: {short(best[0])}). It compensates heat that the model lacks.")
    return out


def _criticise_traces(fit: Calibration) -> list[TraceCriticism]:
    """Return residual statistics of every sensor in every record.

    Each has the least-squares slope of the residuals z over predicted temperature [K/K], sum of all load powers [K/W] and time [K/s]:
    b = sum (x - mean x) z / sum (x - mean x)^2, its error widened by sqrt(n / n_eff).
    """
    out = []
    powers = {}
    for e in fit.experiments:
        times = np.linspace(0.0, e.scenario.seconds, 301)
        run = simulate(fit.model, e.bare, times=times)
        powers[e.record.name] = times, np.sum([np.broadcast_to(p, times.shape) for p in run.load_powers.values()] or [0.0 * times], axis=0)
    for b in fit.blocks:
        at, watts = powers[b.record]
        z, n = b.residuals, b.residuals.size
        statistics = fit.statistics[b.record][b.sensor]
        power = np.interp(b.times, at, watts)
        slopes = {}
        for name, x in (("temperature", b.predicted), ("power", power), ("time", b.times)):
            spread = x - x.mean()
            square = float(spread @ spread)
            if square > 1e-9 * max(1.0, float(x @ x)) * 1e-3 and n > 3:
                slope = float(spread @ z) / square
                residuals = z - z.mean() - slope * spread
                # standard error of a slope, widened by sqrt(n / n_eff) because neighbours repeat each other
                slopes[name] = (
                    slope,
                    float(np.sqrt(residuals @ residuals / max(n - 2, 1) / square * n / max(statistics.effective_samples, 3.0))),
                )
        out.append(TraceCriticism(b.record, b.sensor, b.times, b.predicted, power, z, b.noise, statistics, slopes))
    return out


def _with_progress(items: Iterable[_Item], count: int, words: str, begin: float, progress: Callable[[str, float], None]) -> Iterator[_Item]:
    """Yield `count` items, each announced before it is made; `begin` is the share of the whole that was done before [-]; 0.3 is these."""
    made = iter(items)
    for k in range(count):
        progress(f"{words} {k + 1} of {count}", begin + 0.3 * k / count)
        yield next(made)


def _tried(fit: Calibration, request: Request, executor: Workers, progress: Callable[[str, float], None]) -> tuple[list[Candidate], float]:
    """Return every missing element, the best supported first, and over what time residuals that count as noise wander. [s]

    Those that one evaluation promises most of are refitted, all in the noise that is the likeliest with the best of them; what is suggested
    is fitted in full.
    """
    with one_thread():
        budget, refused = EvaluationBudget(), list[tuple[str, str]]()
        base = fitted_structure((), request, fit.fitted, rounds=0)
        progress("heat that no log gives", 0.0)
        elements = [*missing_elements(fit, request), *unlogged_powers(base)]
        alone = noise_of([base.weighing])
        scores = base.promises(_with_progress(elements, len(elements), "element", 0.2, progress), refused, alone)
        tries: list[Try] = [((s.change,), s.change.request, s.start) for s in scores[:MAX_REFITTED_ELEMENTS]]
        noise, first = alone, next(fitted_structures(tries[:1], base.fitted, budget, None), "")
        if not isinstance(first, str):
            noise, tries[0] = noise_of((base.weighing, first.weighing)), (first.changes, first.request, first.values)
        refits = fitted_structures(tries, base.fitted, budget, executor, noise=noise)
        outcomes = [*_with_progress(refits, len(tries), "refit", 0.5, progress)]
        refused += [(changes[0].name, why) for (changes, _, _), why in zip(tries, outcomes, strict=True) if isinstance(why, str)]
        refitted = [one for one in outcomes if not isinstance(one, str)]
        likeliest = noise_of(one.weighing for one in (base, *refitted))
        refitted = [one if noise == likeliest else one.in_noise(likeliest) for one in refitted]
        base = base.in_noise(likeliest)
    out = [(_weighed(one, base, likeliest), one) for one in refitted]
    out.sort(key=lambda row: -row[0].evidence)
    for n, (candidate, one) in enumerate(out):
        if candidate.possible and candidate.proved:
            progress(f"full fit with {candidate.name}", 0.8)
            try:
                whole = refit(one.full_request)
            except ThermidError as error:
                out[n] = replace(candidate, refused=error.message, found=""), one
                continue
            locals_by_name = {f"{v.record}: {v.name}": v for v in whole.local}
            words, possible = one.changes[0].judge({**whole.values.assignments, **locals_by_name})
            out[n] = replace(candidate, found=words, possible=possible, fit=whole), one
            if possible:
                break
    untried = [Candidate(s.change.name) for s in scores[MAX_REFITTED_ELEMENTS:]] + [Candidate(name, refused=why) for name, why in refused]
    return [*(candidate for candidate, _ in out), *untried], float(base.weighing.wander[likeliest])


def _weighed(one: FittedStructure, base: FittedStructure, noise: int) -> Candidate:
    """Return a refitted element beside the model as it is, both in one noise."""
    words, possible = one.judged()[0]
    evidence = 2.0 * float(one.weighing.logs[noise] - base.weighing.logs[noise])
    rmse, weighted = (base.rmse, one.rmse), tuple(float(s.weighing.squares[noise] ** 0.5) for s in (base, one))
    return Candidate(one.changes[0].name, words, possible, evidence, rmse, weighted)
