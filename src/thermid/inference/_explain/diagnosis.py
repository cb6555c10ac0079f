"""Fault diagnosis by linear evidence: each fault is tried by itself, with the sensitivities of every reading to it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from numbers import Real
from typing import Any

import numpy as np

from thermid.base.errors import IdentificationError, ThermidError
from thermid.base.results import Result
from thermid.base.units import Array, amount
from thermid.fit.calibration import Calibration
from thermid.inference._explain.candidates import Fault, faults_of
from thermid.inference._explain.thresholds import (
    DIAGNOSED_ROUNDS,
    DIAGNOSED_STRETCHES,
    GROUPS,
    LEFT_BY_EVERY_MODEL,
    MAX_DIAGNOSED_FAULTS,
    MIN_EXPLAINED_SHARE,
)
from thermid.simulation.runs import Simulator, prepare

NOTHING = "nothing"
Tried = tuple[float, float, float, float, float]
"""Log of the evidence over that of no fault, amount, its error, weighted squares left, RMS left [K]."""


@dataclass(frozen=True, eq=False)
class Case:
    """One log: thinned deviations, and what simulates it.

    Parameters
    ----------
    ready : Simulator
    sensors, nodes : tuple of str       The sensors, and the node of each.
    centres : array (bins,)             Middles of the stretches. [s]
    deviations : array (sensors, bins)  Mean of measured less model. [K]
    errors : array (sensors, bins)      Standard error of these by noise. [K]
    room : str                          The boundary that a loose sensor leans to.
    starts : dict                       Sensor -> initial temperatures that its first reading sets.
    """

    ready: Simulator
    sensors: tuple[str, ...]
    nodes: tuple[str, ...]
    centres: Array
    deviations: Array
    errors: Array
    room: str
    starts: Mapping[str, tuple[str, ...]]

    def run(self, values: Mapping[str, float], only: str = "") -> tuple[Array, dict[str, Array], Array]:
        """Return temperatures (sensors, bins) [K], name -> their derivatives (sensors, bins), and temperatures of the room (bins,). [K]

        At `values` (name -> SI); derivatives are in K per SI unit of the name, `only` of one name or of all where it is empty.
        """
        run = self.ready.run(self.ready.with_units(values), sensitivities=True)
        at = np.array([np.interp(self.centres, run.times, run[n].kelvin) for n in self.nodes])
        several = [run.slopes(n) for n in self.nodes]
        slopes = {
            f: np.array([np.interp(self.centres, run.times, m[:, k]) for m in several])
            for k, f in enumerate(self.ready.free)
            if only in ("", f)
        }
        return at, slopes, np.interp(self.centres, run.times, run[self.room].kelvin)


class FaultBench:
    """All logs together: deviations as one vector `d` (readings,) [K], their `covariance` [K^2], the response of every candidate."""

    def __init__(self, cases: Sequence[Case], candidates: Sequence[Fault], accuracy: Mapping[str, float]) -> None:
        """Run every log without a fault, and work out what deviations it may have."""
        self.cases, self.candidates = cases, candidates
        self.nominal = [c.run({}) for c in cases]
        self.d = np.concatenate([c.deviations.ravel() for c in cases])
        self.covariance = self._errors(accuracy)

    def _errors(self, accuracy: Mapping[str, float]) -> Array:
        """Return the covariance (readings, readings) [K^2] of the deviations of all cases' sensors where nothing is wrong.

        Squares of the errors of means, `LEFT_BY_EVERY_MODEL`^2 exp(-|dt| / tau) with tau a fifth of the record, and `accuracy` [K] squared
        between all readings of one sensor.
        """
        from scipy.linalg import block_diag

        blocks, owner = [], []
        for c in self.cases:
            near = np.exp(-np.abs(c.centres[:, None] - c.centres[None, :]) / (0.2 * (np.ptp(c.centres) or 1.0)))
            for k, s in enumerate(c.sensors):
                blocks.append(np.diag(c.errors[k] ** 2) + LEFT_BY_EVERY_MODEL**2 * near)
                owner += [s] * c.centres.size
        same = np.array(owner)[:, None] == np.array(owner)[None, :]
        accuracies = np.array([accuracy.get(s, 0.0) for s in owner])
        return np.asarray(block_diag(*blocks) + same * accuracies[:, None] * accuracies[None, :])

    @cached_property
    def root(self) -> Array:
        """The inverse of a Cholesky factor: what it multiplies has independent errors of size one."""
        return np.asarray(np.linalg.inv(np.linalg.cholesky(self.covariance)))

    def response(self, c: Fault, runs: Sequence[tuple[Array, dict[str, Array], Array]]) -> Array:
        """Return the change of every simulated reading (readings,) per unit of a candidate. [K per its unit]"""
        parts = []
        for case, (at, slopes, room) in zip(self.cases, runs, strict=True):
            if c.free:
                factor = c.start if c.group == "capacitance" else 1.0
                part = factor * slopes[case.ready.canonical(c.free)]
            else:
                has_fault = np.array([c.sensor in ("", s) for s in case.sensors])[:, None]
                part = has_fault * (np.ones_like(at) if c.unit == "K" else room[None, :] - at)
                # what starts at a wrong reading runs on from there
                for s, names in case.starts.items():
                    if c.sensor in ("", s):
                        first = 1.0 if c.unit == "K" else float(room[0] - at[case.sensors.index(s), 0])
                        part = part - first * sum(slopes[n] for n in names)
            parts.append(part.ravel())
        return np.concatenate(parts)

    def moved(self, c: Fault, amount: float) -> tuple[Array, Array]:
        """Return the change of the simulated readings (readings,) by an amount of a candidate [K], and its response there [K per amount].

        A capacitance is multiplied by 1 + amount, any other value is moved by it; a fault of a sensor is linear.
        """
        if not c.free:
            s = self.response(c, self.nominal)
            return amount * s, s
        value = c.start * (1.0 + amount) if c.group == "capacitance" else c.start + amount
        runs = []
        for case in self.cases:
            name = case.ready.canonical(c.free)
            runs.append(case.run({c.free: value if c.unit != "K" else case.ready.nominal[name] + amount}, name))
        added = [(run[0] - base[0]).ravel() for run, base in zip(runs, self.nominal, strict=True)]
        return np.concatenate(added), self.response(c, runs)


def cases_of(fit: Calibration, grown: Any, candidates: Sequence[Fault], extra: Sequence[str]) -> list[Case]:
    """Return a case for each log of a comparison: residuals [K] in `DIAGNOSED_STRETCHES` means, and a prepared run with free faults.

    The error of a mean is the sensor's noise (0.05 K where none is stated) over the root of its readings, 10 K where it has none.

    Parameters
    ----------
    grown : Model           The fit's model, with elements for faults that it has none for.
    candidates : sequence   Faults; those with a `free` value are free in the run.
    extra : sequence        Paths of further free values.
    """
    out = []
    for e in fit.experiments:
        blocks_of_record = [b for b in fit.blocks if b.record == e.record.name]
        begin, end = float(min(b.times[0] for b in blocks_of_record)), float(max(b.times[-1] for b in blocks_of_record))
        edges = np.linspace(begin, end, DIAGNOSED_STRETCHES + 1)
        centres = 0.5 * (edges[1:] + edges[:-1])
        deviations, errors = np.zeros((len(blocks_of_record), DIAGNOSED_STRETCHES)), np.zeros((len(blocks_of_record), DIAGNOSED_STRETCHES))
        for k, b in enumerate(blocks_of_record):
            place = np.clip(np.searchsorted(edges, b.times, side="right") - 1, 0, DIAGNOSED_STRETCHES - 1)
            count = np.bincount(place, minlength=DIAGNOSED_STRETCHES)
            sums = np.bincount(place, b.residuals, minlength=DIAGNOSED_STRETCHES)
            filled = count > 0
            deviations[k] = np.interp(centres, centres[filled], sums[filled] / count[filled])
            noise = float(e.observations[k].noise or 0.05) if k < len(e.observations) else 0.05
            errors[k] = np.where(filled, noise / np.sqrt(np.maximum(count, 1)), 10.0)
        begun = {o.sensor: tuple(f"initial.{n}" for n, sensors in e.loose.items() if o.sensor in sensors) for o in e.observations}
        for node, sensor in e.readings.items():
            begun[sensor] = (*begun.get(sensor, ()), f"initial.{node}")
        starts = {s: tuple(dict.fromkeys(names)) for s, names in begun.items() if names}
        initial = [n for names in starts.values() for n in names]
        free = tuple(dict.fromkeys([c.free for c in candidates if c.free] + list(extra) + initial))
        ready = prepare(grown, e.bare, free, times=np.linspace(0.0, e.bare.seconds, 4 * DIAGNOSED_STRETCHES + 1))
        room = ready.wiring.network.boundaries[0]
        out.append(
            Case(
                ready,
                tuple(b.sensor for b in blocks_of_record),
                tuple(b.node for b in blocks_of_record),
                centres,
                deviations,
                errors,
                room,
                starts,
            )
        )
    return out


@dataclass(frozen=True)
class Suspect:
    """One fault, tried by itself.

    Parameters
    ----------
    group, name : str
    amount, error : float       Its size that explains most, and the standard error of that. [its unit]
    unit : str                  K, W/K, or 1 for a part of the model's value.
    text : str                  It in words.
    probability : float         That it is this one, if it is one of those that were tried. [-]
    explained : float           Part of the weighted squares that it takes away. [-]
    left : float                Root mean square of what it leaves. [K]
    """

    group: str
    name: str
    amount: float
    error: float
    unit: str
    text: str
    probability: float
    explained: float
    left: float


@dataclass(frozen=True)
class Diagnosis(Result):
    """What would explain the deviations.

    Parameters
    ----------
    groups : dict               Group -> its probability, the likeliest first; ``nothing`` where errors that are expected suffice. [-]
    suspects : tuple of Suspect Single faults, the likeliest first.
    rms : float                 Root mean square of the deviations. [K]
    """

    groups: Mapping[str, float]
    suspects: tuple[Suspect, ...]
    rms: float

    @property
    def group(self) -> str:
        """The likeliest group."""
        return next(iter(self.groups))

    @property
    def best(self) -> Suspect | None:
        """The likeliest fault of the likeliest group; None where nothing needs explaining."""
        return next((s for s in self.suspects if s.group == self.group), None)

    @property
    def single(self) -> bool:
        """Whether one fault explains most of it; else it only comes nearest among those that were tried one by one."""
        return self.best is not None and self.best.explained >= MIN_EXPLAINED_SHARE

    def __str__(self) -> str:
        """Return the diagnosis as text."""
        if self.group == NOTHING:
            return f"deviations of {self.rms:.2f} K (RMS) are within the stated errors of sensors and model; no fault is needed"
        lines = [f"deviations of {self.rms:.2f} K (RMS): {self.group} ({100 * self.groups[self.group]:.0f} %): {GROUPS[self.group].words}"]
        if not self.single:
            lines = [f"deviations of {self.rms:.2f} K (RMS): no single fault explains most of them; the best candidate is {self.group}"]
        for s in self.suspects[:5]:
            lines.append(f"  {s.text}: {100 * s.probability:.0f} %, takes {100 * s.explained:.0f} % of the squares, leaves {s.left:.2f} K")
        rest = [f"{g} {100 * p:.0f} %" for g, p in self.groups.items() if g != self.group and p >= 0.01]
        return "\n".join([*lines, *([f"  otherwise: {', '.join(rest)}"] if rest else [])])


def diagnose(
    fits: Calibration | Sequence[Calibration],
    *,
    spread: Mapping[str, Any] | None = None,
    accuracy: float = 0.3,
) -> Diagnosis:
    """Bayesian fault diagnosis: which group of parameters would explain the deviations of readings from a model.

    Every fault is tried by itself: its size that explains most, and the probability of the readings with it, a fault of any likely size
    being as likely beforehand as any other of its group, and each group as likely as the next (Bayes; Laplace's approximation about the
    best size: MacKay, Information Theory, Inference, and Learning Algorithms, Cambridge 2003, chapter 28). A fault that only explains with
    a negative link, or with twice the power, has little.

    Parameters
    ----------
    fits : Calibration(s)   Results of `compare`, a record each or several.
    spread : dict           Fitted paths -> standard deviation, with a unit or SI: what the model's values leave open counts as expected.
    accuracy : float        Standard deviation of a sensor's constant error, where its channel states none. [K]

    Raises
    ------
    IdentificationError   Without readings of two sensors.
    """
    several = [fits] if isinstance(fits, Calibration) else list(fits)
    noted = {o.sensor: o for t in several for e in t.experiments for o in e.observations}
    if len(noted) < 2:
        raise IdentificationError(
            f"a diagnosis needs at least two sensors, because it separates faults by their pattern over sensors; {len(noted)} is given.",
            several[0].stage if several else "diagnose",
            code="fit.not-possible",
        )
    accuracies = {s: accuracy if o.accuracy is None else o.accuracy for s, o in noted.items()}
    grown, candidates = faults_of(several[0].model, {s: o.seat for s, o in noted.items()})
    extra = list(spread or {})
    cases = [c for t in several for c in cases_of(t, grown, candidates, extra)]
    bench = FaultBench(cases, candidates, accuracies)
    if extra:
        columns = []
        for n, written in (spread or {}).items():
            sds = [amount(written, "1", n) if isinstance(written, Real) else math.sqrt(c.ready.law(n, written).variance) for c in cases]
            slopes = [run[1][c.ready.canonical(n)] for c, run in zip(cases, bench.nominal, strict=True)]
            columns.append(np.concatenate([(slope * sd).ravel() for slope, sd in zip(slopes, sds, strict=True)]))
        directions = np.column_stack(columns)  # one standard deviation of a value each [K]
        bench.covariance = bench.covariance + directions @ directions.T
    return _weighed(bench)


def _weighed(bench: FaultBench) -> Diagnosis:
    """Return the probabilities [-] of groups and faults by their evidence: groups are equally likely, and faults within a group.

    The evidence of a group is the mean of those of its faults, "nothing" has evidence 1. The `MAX_DIAGNOSED_FAULTS` best of each group are
    fitted again.
    """
    from scipy.special import logsumexp

    z = bench.root @ bench.d
    whole = float(z @ z)
    tried = {k: _linear(bench, c, z) for k, c in enumerate(bench.candidates)}
    # those that matter again, with the response where they end and not where they begin
    for group in GROUPS:
        ranked = sorted((k for k, c in enumerate(bench.candidates) if c.group == group), key=lambda k: -tried[k][0])
        for k in ranked[:MAX_DIAGNOSED_FAULTS]:
            if bench.candidates[k].free:
                tried[k] = _refitted(bench, bench.candidates[k], z, tried[k])
    # each group is as likely as the next, and each of its faults as the others: the mean of their evidences
    of_group = {g: np.array([tried[k][0] for k, c in enumerate(bench.candidates) if c.group == g]) for g in GROUPS}
    logs = {g: float(logsumexp(v - math.log(v.size))) for g, v in of_group.items() if v.size} | {NOTHING: 0.0}
    total = float(logsumexp([*logs.values()]))
    groups = {g: math.exp(v - total) for g, v in sorted(logs.items(), key=lambda item: -item[1])}
    suspects = []
    for k, c in enumerate(bench.candidates):
        evidence, amount, error, squares_left, rms = tried[k]
        probability = math.exp(evidence - total) / of_group[c.group].size
        suspects.append(Suspect(c.group, c.name, amount, error, c.unit, c.words(amount), probability, 1.0 - squares_left / whole, rms))
    ranked_faults = sorted(suspects, key=lambda s: -s.probability)
    return Diagnosis(groups, tuple(ranked_faults[:20]), float(np.sqrt(np.mean(bench.d**2))))


def _linear(bench: FaultBench, c: Fault, z: Array) -> Tried:
    """Return the outcome of a fault by its response (readings,) [K per unit of it] at no fault; `z` (readings,) is whitened. [-]"""
    s = bench.response(c, bench.nominal)
    w = bench.root @ s
    amount, square = _likeliest_amount(c, float(w @ w), float(w @ z))
    return _evidence(c, z, z - w * amount, bench.d - s * amount, amount, square)


def _refitted(bench: FaultBench, c: Fault, z: Array, begun: Tried) -> Tried:
    """Return the outcome of a fault after at most `DIAGNOSED_ROUNDS` Gauss-Newton steps of its amount [unit of the fault] from `begun`.

    With whitened residuals r and slopes w, amount = w'(r + w a) / (w'w + 1 / size^2). `z` are the whitened deviations without a fault. It
    ends where the amount moves by less than a thousandth of the fault's size.
    """
    amount, best = begun[1], begun
    for _ in range(DIAGNOSED_ROUNDS):
        try:
            added, s = bench.moved(c, amount)
        except ThermidError:
            return best
        w, residuals = bench.root @ s, bench.root @ (bench.d - added)
        following, square = _likeliest_amount(c, float(w @ w), float(w @ (residuals + w * amount)))
        best = _evidence(c, z, residuals, bench.d - added, amount, square)
        # half steps where it would leave what is possible
        floor = -0.9 if c.unit == "1" else -np.inf
        following = max(following, 0.5 * (amount + floor)) if np.isfinite(floor) else following
        if abs(following - amount) < 1e-3 * c.size:
            break
        amount = following
    return best


def _likeliest_amount(c: Fault, curvature: float, cross: float) -> tuple[float, float]:
    """Return the likeliest amount [its unit], and its precision, from w'w and w'z of the whitened response w; not below 0 if one-sided."""
    # amount ~ N(0, size^2): the posterior's precision is own + 1 / size^2, its mean cross / precision
    square = curvature + 1.0 / c.size**2
    amount = cross / square
    return (max(amount, 0.0) if c.one_sided else amount), square


def _evidence(c: Fault, z: Array, residuals: Array, rest: Array, amount: float, square: float) -> Tried:
    """Return the outcome of an amount with the precision `square`, whitened `residuals`, and deviations `rest` left. [K]"""
    # ln of the Bayes factor by Laplace: half the fall of the squares, the prior's penalty with it, less half of ln(size^2 precision);
    # of a one-sided amount the prior is twice as dense
    gain = 0.5 * (float(z @ z) - float(residuals @ residuals) - (amount / c.size) ** 2) - 0.5 * float(np.log(c.size**2 * square))
    gain += float(np.log(2.0)) if c.one_sided and amount > 0 else 0.0
    return gain, amount, float(square**-0.5), float(residuals @ residuals), float(np.sqrt(np.mean(rest**2)))
