"""`criticise`: what the residuals of a fit say against its model, and which element, tried in a refit, would answer it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from thermid.base.arguments import takes_objects
from thermid.base.errors import IdentificationError, ThermidError
from thermid.base.linear_algebra import Array
from thermid.base.results import Result
from thermid.fit.calibration import Calibration, fit as refit
from thermid.fit.problem import Experiment, Request
from thermid.inference._explain.candidates import MissingElement, missing_elements
from thermid.inference._explain.heats import unlogged_powers
from thermid.measure.amounts import short
from thermid.simulation.runs import Workers, in_tasks, simulate
from thermid.simulation.solver import refuse_unseen

STRONG, POSSIBLE = 10.0, 2.0
"""Differences of BIC that count as very strong evidence, and as evidence worth a word: Kass and Raftery, J. Am. Stat. Assoc. 90 (1995)
773-795, DOI 10.1080/01621459.1995.10476572."""
SURE = 3.0
Modes = dict[tuple[str, str], list[tuple[Array, Array]]]


MOST_LAGS, STRETCHES, FEWEST = 20, 150, 12


def ljung_box(residuals: Array) -> tuple[float, float]:
    """Return the autocorrelation of neighbours, and the probability of correlations as large by chance."""
    from scipy.special import gammaincc

    z, n = residuals - residuals.mean(), residuals.size
    lags = min(MOST_LAGS, n // 5)
    power = float(z @ z)
    if lags < 1 or power <= 0:
        return 0.0, 1.0
    rho = np.array([float(z[k:] @ z[:-k]) / power for k in range(1, lags + 1)])
    # Q = n (n + 2) sum rho_k^2 / (n - k), chi-squared with as many degrees of freedom as lags (Ljung and Box, Biometrika 65 (1978) 297);
    # its upper tail is gammaincc(lags / 2, Q / 2)
    statistic = n * (n + 2) * float(np.sum(rho**2 / (n - np.arange(1, lags + 1))))
    return float(rho[0]), float(gammaincc(0.5 * lags, 0.5 * statistic))


def cumulated_periodogram(residuals: Array) -> Array:
    """Return the share of the variance below each frequency (frequencies,), a straight line for white noise. [-]"""
    z = residuals - residuals.mean()
    power = np.abs(np.fft.rfft(z))[1 : (z.size + 1) // 2] ** 2
    total = float(power.sum())
    return np.cumsum(power) / total if total > 0 else np.linspace(0.0, 1.0, power.size)


def periodogram(residuals: Array) -> tuple[float, float]:
    """Return the largest distance from the straight line, and the distance that chance allows at 95 %."""
    share = cumulated_periodogram(residuals)
    if share.size < 3:
        return 0.0, 1.0
    line = np.arange(1, share.size + 1) / share.size
    # noise that changes sign too often lies below the line, and no element is missing for that
    # 1.36 / sqrt(m): 95 % point of Kolmogorov's distribution
    return max(0.0, float((share - line).max())), float(1.36 / np.sqrt(share.size - 1))


def stretches(residuals: Array, times: Array) -> tuple[Array, Array]:
    """Return residuals as means over at most `STRETCHES` stretches of equally many readings."""
    parts = np.array_split(np.arange(residuals.size), min(STRETCHES, residuals.size))
    return np.array([residuals[p].mean() for p in parts]), np.array([times[p].mean() for p in parts])


def modes_of(times: Array) -> list[tuple[Array, Array]]:
    """Return sizes and vectors of the correlations exp(-dt / time), for times from one stretch to the whole."""
    if times.size < FEWEST:
        return []
    apart = np.abs(times[:, None] - times[None, :])
    spacing, span = float(np.median(np.diff(times))), float(times[-1] - times[0])
    found = (np.linalg.eigh(np.exp(-apart / time)) for time in np.geomspace(spacing, max(span, 2.0 * spacing), 8))
    return [(np.maximum(sizes, 0.0), vectors) for sizes, vectors in found]


def trace_likelihood(z: Array, modes: list[tuple[Array, Array]], least: float) -> float:
    """Return the largest log-likelihood of residuals as the sum of independent errors and of a part with correlations exp(-dt / time).

    Independent errors are not made smaller than `least`, or a perfect fit would be infinitely likely. [K]
    """
    n = z.size
    calm = max(float(z @ z) / n, least**2)
    best = -0.5 * n * float(np.log(calm)) - 0.5 * float(z @ z) / calm
    for sizes, vectors in modes:
        # in the eigenbasis of the correlations variances are w (1 + ratio size); the likeliest w is the mean of z^2 / (1 + ratio size)
        variances = 1.0 + np.geomspace(1e-2 / sizes[-1], 1e3, 40)[:, None] * sizes
        squares = ((vectors.T @ z) ** 2 / variances).sum(axis=1)
        own = np.maximum(squares / n, least**2)
        best = max(best, float(np.max(-0.5 * (n * np.log(own) + np.log(variances).sum(axis=1) + squares / own))))
    return best


@dataclass(frozen=True, eq=False)
class TraceCriticism:
    """The residuals of one sensor in one record.

    Parameters
    ----------
    record, sensor : str
    times, temperature, power, residuals : array (samples,)     [s], [K], [W] (all loads together), [K]
    rmse : float            [K]
    noise : float           What was stated of the readings; the RMSE where nothing was. [K]
    lag_one : float         Autocorrelation of neighbours. [-]
    ljung_box : float       Probability of correlations as large by chance, over up to 20 lags. [-]
    periodogram : float     Largest distance of the cumulated periodogram from that of white noise. [-]
    band : float            What chance allows at 95 % (Bartlett). [-]
    effective : float       Independent samples that the readings are worth.
    slopes : dict           'temperature' [K/K], 'power' [K/W], 'time' [K/s] -> (slope, standard error), correlation counted.
    """

    record: str
    sensor: str
    times: Array
    temperature: Array
    power: Array
    residuals: Array
    rmse: float
    noise: float
    lag_one: float
    ljung_box: float
    periodogram: float
    band: float
    effective: float
    slopes: Mapping[str, tuple[float, float]]

    @property
    def white(self) -> bool:
        """Whether nothing in them speaks against independent noise: Ljung and Box at 1 %, the periodogram within its band."""
        return self.ljung_box > 0.01 and self.periodogram < 1.2 * self.band

    @property
    def loud(self) -> bool:
        """Whether they are larger than the stated noise by more than four standard deviations of chance; a few bad readings suffice."""
        return bool(self.rmse**2 > self.noise**2 * (1.0 + 4.0 * (2.0 / self.residuals.size) ** 0.5))

    @property
    def quiet(self) -> bool:
        """Whether they are independent noise of the size that was stated."""
        return self.white and not self.loud

    def to_dict(self) -> dict[str, Any]:
        """Return its figures, in SI."""
        keys = ("record", "sensor", "rmse", "noise", "lag_one", "ljung_box", "periodogram", "band", "effective", "white", "loud")
        slopes = {n: {"slope": slope, "error": error} for n, (slope, error) in self.slopes.items()}
        return {**{k: getattr(self, k) for k in keys}, "slopes": slopes}

    def __str__(self) -> str:
        """What they say, in words."""
        head = f"{self.sensor} in {self.record}: RMSE {short(self.rmse, 3)} K"
        if self.loud:
            head += f" for a noise of {self.noise:.3g} K"
        if self.white:
            return f"{head}, independent from reading to reading"
        chance = "below 1e-6" if self.ljung_box < 1e-6 else short(self.ljung_box)
        text = (
            f"{head}, autocorrelated: lag-one correlation {self.lag_one:.2f} (by chance: {chance}), the cumulated periodogram leaves "
            f"white noise by {self.periodogram:.2f} where {self.band:.2f} is allowed; for a mean, {self.residuals.size} readings are worth "
            f"{short(self.effective, 3)}"
        )
        units = {"temperature": ("K per K of temperature", 1.0), "power": ("K per W", 1.0), "time": ("K per hour", 3600.0)}
        for name, (slope, error) in self.slopes.items():
            if abs(slope) > SURE * error:
                text += f"; they go with {name}: {slope * units[name][1]:+.2g} {units[name][0]} ({abs(slope) / error:.0f} standard errors)"
        return text


@dataclass(frozen=True, eq=False)
class Candidate:
    """An element that was laid over the model and fitted with it.

    Parameters
    ----------
    name : str              What it is.
    found : str             What the fit found for it, or why it could not be fitted.
    possible : bool         Whether that is physically possible.
    gain : float            Twice the logarithm of the likelihood ratio, readings counted as independent ones. [-]
    evidence : float        The same less what chance gains with as many parameters (difference of BIC). [-]
    rmse : (float, float)   Before and after, all sensors. [K]
    fit : Calibration       The refit; None where it was refused.
    chosen : int            Numbers chosen before the refit, such as the time of a course; they count as fitted ones.
    """

    name: str
    found: str
    possible: bool
    gain: float
    evidence: float
    rmse: tuple[float, float]
    fit: Calibration | None
    chosen: int = 0

    def to_dict(self) -> dict[str, Any]:
        """Return its figures, in SI; `tried` is whether the refit was possible."""
        keys = ("name", "found", "possible", "gain", "evidence")
        return {**{k: getattr(self, k) for k in keys}, "rmse": list(self.rmse), "tried": self.fit is not None}

    def __str__(self) -> str:
        """The candidate in words."""
        if self.fit is None:
            return f"{self.name}: could not be tried with these readings: {self.found}"
        how = "very strong" if self.evidence > STRONG else "some" if self.evidence > POSSIBLE else "no"
        word = "" if self.possible else ", which is not physically possible"
        return (
            f"{self.name}: {how} evidence (log-likelihood ratio {short(0.5 * self.gain, 3)}, BIC {self.evidence:+.3g}); "
            f"found {self.found}{word}; RMSE {short(self.rmse[0], 3)} -> {short(self.rmse[1], 3)} K"
        )


@dataclass(frozen=True, eq=False)
class Criticism(Result):
    """What speaks against a model.

    Parameters
    ----------
    title : str                         The fit.
    traces : tuple of TraceCriticism    Per record and sensor.
    candidates : tuple of Candidate     Elements that were tried, the best supported first.
    checks : tuple of str               Failed checks: values of single records that run with an input.
    """

    title: str
    traces: tuple[TraceCriticism, ...]
    candidates: tuple[Candidate, ...]
    checks: tuple[str, ...] = ()

    @property
    def suggested(self) -> Candidate | None:
        """The best supported element whose value is possible, with very strong evidence; None where there is none."""
        return next((c for c in self.candidates if c.fit is not None and c.possible and c.evidence > STRONG), None)

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
        coloured = [t for t in self.traces if not t.quiet]
        lines = [f"{self.title}: {len(self.traces) - len(coloured)} of {len(self.traces)} traces have white residuals"]
        lines += [f"  failed check: {check}" for check in self.checks]
        lines += [f"  {t}" for t in (coloured or self.traces)[:8]]
        if self.candidates:
            lines.append("  candidates, each refitted alone:")
            lines += [f"    {c}" for c in self.candidates if c.fit is None or c.evidence > POSSIBLE]
            idle = [c.name for c in self.candidates if c.fit is not None and c.evidence <= POSSIBLE]
            lines += [f"    no evidence for {'; '.join(idle)}"] if idle else []
            best = self.suggested
            if best is not None:
                rivals = [
                    c for c in self.candidates if c is not best and c.possible and best.evidence - c.evidence < 6.0 and c.evidence > STRONG
                ]
                also = f" These readings cannot separate it from {' or '.join(c.name for c in rivals)}." if rivals else ""
                lines.append(f"  Suggested: {best.name}: {best.found}.{also}")
            elif coloured:
                lines.append(
                    "  None of the candidates explains the residuals. Look for a disturbance that was not logged, or use more nodes."
                )
        return "\n".join(lines)


@takes_objects
def criticise(fit: Calibration, elements: bool | None = None, *, executor: Workers = None) -> Criticism:
    """Residual analysis of a fit: are the residuals white noise, and which missing element would explain them?

    Parameters
    ----------
    fit : Calibration   The fit.
    elements : bool     Whether missing elements are tried in refits; by default only where residuals are not independent, or too large.
    executor            As in `ensemble`: who makes the refits.

    Raises
    ------
    IdentificationError   When the fit was not made in this session.

    Notes
    -----
    Ljung and Box, Biometrika 65 (1978) 297-303, DOI 10.1093/biomet/65.2.297; Bartlett's test of the cumulated periodogram, in Box, Jenkins
    and Reinsel, Time Series Analysis, 3rd ed., section 8.2.5. The likelihood ratio allows the model as it is to have its residuals by
    chance: on either side they are independent errors and a part that wanders, each as large and as slow as makes them most likely.
    """
    if fit.request is None or fit.problem is None:
        raise IdentificationError("this calibration was not made by a fit in this session; repeat the fit.", fit.stage)
    traces, checks = tuple(_traces(fit)), tuple(running_locals(fit))
    wanted = (any(not t.quiet for t in traces) and fit.model.runner is None) if elements is None else elements
    if wanted:
        refuse_unseen(fit.model, "a search for missing elements")
    if not wanted:
        return Criticism(fit.stage, traces, (), checks)
    modes: Modes = {}
    old = _likelihood(fit, modes)
    missing = (*missing_elements(fit, fit.request), *unlogged_powers(fit.request))
    refits = dict(in_tasks(_refit, [(f"the refit with {m.name}", (m.request,)) for m in missing], executor))
    tried = [_tried(fit, old, m, refits[k], modes) for k, m in enumerate(missing)]
    return Criticism(fit.stage, traces, tuple(sorted(tried, key=lambda c: -c.evidence)), checks)


def running_locals(fit: Calibration) -> list[str]:
    """Failed checks of values that each record has for itself: a fitted ambient cannot know the power of its record.

    A value that goes with the mean power or command of its record answers for heat that the model misses. A parabola over records is
    compared with a constant by the F test at 1 %, for as many inputs as are looked at (Bonferroni).
    """
    from scipy.special import fdtrc

    means = {e.record.name: _mean_inputs(e) for e in fit.experiments}
    names = list(dict.fromkeys(n for table in means.values() for n in table))
    out = []
    for local in dict.fromkeys(v.name for v in fit.local):
        if local.startswith("initial."):
            continue
        own = {v.record: v.value for v in fit.local if v.name == local}
        best = (1.0, "")
        for name in names:
            pairs = np.array([(means[r][name], value) for r, value in own.items() if name in means[r]]).reshape(-1, 2)
            if len(pairs) < FEWEST_RECORDS or np.ptp(pairs[:, 0]) <= 0:
                continue
            x, y = pairs[:, 0] - pairs[:, 0].mean(), pairs[:, 1] - pairs[:, 1].mean()
            design = np.column_stack([np.ones_like(x), x, x**2])
            fitted = design @ np.linalg.lstsq(design, y, rcond=None)[0]
            left, gone = float(np.sum((y - fitted) ** 2)), float(np.sum(fitted**2))
            ratio = 0.5 * gone / max(left / (len(x) - 3), 1e-300)
            chance = float(fdtrc(2.0, len(x) - 3.0, ratio)) * len(names)
            words = (
                f"'{local}' of {len(x)} records correlates with the mean of '{name}': {short(float(np.ptp(fitted)), 2)} K over its range"
            )
            best = min(best, (chance, words))
        if best[0] < 0.01:
            out.append(f"{best[1]} (by chance: {short(best[0])}). It compensates heat that the model lacks.")
    return out


FEWEST_RECORDS = 6
"""Records from which a value of single records is compared with an input."""


def _mean_inputs(experiment: Experiment) -> dict[str, float]:
    """Return mean of every logged power and command of a record."""
    channels = experiment.record.channels.values()
    return {c.target or c.name: float(c.values[c.valid].mean()) for c in channels if c.role in ("load", "command") and c.valid.any()}


def _traces(fit: Calibration) -> list[TraceCriticism]:
    out = []
    powers = {}
    for e in fit.experiments:
        times = np.linspace(0.0, e.scenario.seconds, 301)
        run = simulate(fit.fitted_model, e.bare, times=times)
        powers[e.record.name] = times, np.sum([np.broadcast_to(p, times.shape) for p in run.load_powers.values()] or [0.0 * times], axis=0)
    for b in fit.blocks:
        at, watts = powers[b.record]
        z, n = b.residuals, b.residuals.size
        effective = float(fit.statistics[b.record][b.sensor].effective_samples)
        power = np.interp(b.times, at, watts)
        slopes = {}
        for name, x in (("temperature", b.predicted), ("power", power), ("time", b.times)):
            spread = x - x.mean()
            square = float(spread @ spread)
            if square > 1e-9 * max(1.0, float(x @ x)) * 1e-3 and n > 3:
                slope = float(spread @ z) / square
                left = z - z.mean() - slope * spread
                # standard error of a slope, widened by sqrt(n / n_eff) because neighbours repeat each other
                slopes[name] = slope, float(np.sqrt(left @ left / max(n - 2, 1) / square * n / max(effective, 3.0)))
        lag, chance = ljung_box(z)
        distance, band = periodogram(z)
        out.append(
            TraceCriticism(
                b.record,
                b.sensor,
                b.times,
                b.predicted,
                power,
                z,
                float(np.sqrt(z @ z / n)),
                b.noise,
                lag,
                chance,
                distance,
                band,
                effective,
                slopes,
            )
        )
    return out


def _refit(request: Request) -> Calibration | ThermidError:
    """Return a fit with a missing element, or why there is none; a task of a worker."""
    try:
        # an element that the readings do not ask for ends where it does nothing, and no search would better that
        return refit(replace(request, search="local", doubts=True))
    except ThermidError as error:
        return error


def _tried(fit: Calibration, old: tuple[float, int], missing: MissingElement, found: Calibration | ThermidError, modes: Modes) -> Candidate:
    """Return what a refit with an element says."""
    before = _rmse(fit)
    try:
        if isinstance(found, ThermidError):
            raise found
        words, possible = missing.judge(found)
    except ThermidError as error:
        return Candidate(missing.name, error.message, False, -np.inf, -np.inf, (before, before), None)
    gain, count = 2.0 * (_likelihood(found, modes)[0] - old[0]), old[1]
    added = max(len(found.fitted) - len(fit.fitted), 1) + missing.chosen
    evidence = gain - added * np.log(max(count, 2.0))
    return Candidate(missing.name, words, possible, gain, evidence, (before, _rmse(found)), found, missing.chosen)


def _rmse(fit: Calibration) -> float:
    squares = [s.rmse**2 * s.samples for s in fit.sensors.values()]
    return float(np.sqrt(sum(squares) / max(sum(s.samples for s in fit.sensors.values()), 1)))


def _likelihood(fit: Calibration, modes: Modes) -> tuple[float, int]:
    """Return the logarithm of the likelihood of all residuals, independent and wandering parts chosen for each trace, and their number.

    `modes` keeps what depends on the times alone, for the next fit.
    """
    total, count = 0.0, 0
    for b in fit.blocks:
        z, times = stretches(b.residuals, b.times)
        if (b.record, b.sensor) not in modes:
            modes[b.record, b.sensor] = modes_of(times)
        total += trace_likelihood(z, modes[b.record, b.sensor], 0.3 * b.noise * (z.size / b.residuals.size) ** 0.5)
        count += z.size
    return total, count
