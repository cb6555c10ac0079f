"""Which group of parameters would explain deviations: each fault tried by itself, with the sensitivities of every reading to it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thermid.arguments import takes_objects
from thermid.errors import IdentificationError
from thermid.explain.fault_bench import FaultBench, cases_of
from thermid.explain.suspects import GROUPS, Candidate, suspects
from thermid.fit.calibration import Calibration

__all__ = ["Diagnosis", "Suspect", "diagnose"]

Array = NDArray[np.float64]
ROUNDS, REFITTED = 4, 6
NOTHING = "nothing"
MOST = 0.7
"""Part of the weighted squares that a fault must take away to be called the explanation."""


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
class Diagnosis:
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
        return self.best is not None and self.best.explained >= MOST

    def __str__(self) -> str:
        """Return the diagnosis as text."""
        if self.group == NOTHING:
            return f"deviations of {self.rms:.2f} K (RMS) are no larger than the stated errors of sensors and model: nothing to explain"
        lines = [f"deviations of {self.rms:.2f} K (RMS): {self.group} ({100 * self.groups[self.group]:.0f} %): {GROUPS[self.group]}"]
        if not self.single:
            lines = [f"deviations of {self.rms:.2f} K (RMS): no single fault explains most of them; nearest is {self.group}"]
        for s in self.suspects[:5]:
            lines.append(f"  {s.text}: {100 * s.probability:.0f} %, takes {100 * s.explained:.0f} % of the squares, leaves {s.left:.2f} K")
        rest = [f"{g} {100 * p:.0f} %" for g, p in self.groups.items() if g != self.group and p >= 0.01]
        return "\n".join([*lines, *([f"  otherwise: {', '.join(rest)}"] if rest else [])])


@takes_objects
def diagnose(
    told: Calibration | Sequence[Calibration],
    *,
    spread: Mapping[str, float] | None = None,
    accuracy: float = 0.3,
    floor: float = 0.1,
) -> Diagnosis:
    """Return which group of parameters would explain the deviations of readings from a model.

    Every fault is tried by itself: its size that explains most, and the probability of the readings with it, a fault of any likely size
    being as likely beforehand as any other of its group, and each group as likely as the next (Bayes; Laplace's approximation about the
    best size: MacKay, Information Theory, Inference, and Learning Algorithms, Cambridge 2003, chapter 28). A fault that only explains with
    a negative link, or with twice the power, has little.

    Parameters
    ----------
    told : Calibration(s)   Results of `compare`, a record each or several.
    spread : dict           Fitted paths -> standard deviation in SI: what the model's values leave open counts as expected.
    accuracy : float        Standard deviation of a sensor's constant error, where its channel states none. [K]
    floor : float           Standard deviation of what every model leaves, wandering over a fifth of a log. [K]

    Raises
    ------
    IdentificationError   Without readings of two sensors.
    """
    several = [told] if isinstance(told, Calibration) else list(told)
    noted = {o.sensor: o for t in several for e in t.experiments for o in e.observations}
    if len(noted) < 2:
        raise IdentificationError(
            f"a diagnosis tells faults apart by where they show, and {len(noted)} sensor is not enough. Compare with two or more.",
            several[0].stage if several else "diagnose",
        )
    known = {s: accuracy if o.accuracy is None else o.accuracy for s, o in noted.items()}
    grown, candidates = suspects(several[0].fitted_model, {s: o.seat for s, o in noted.items()})
    extra = list(spread or {})
    cases = [c for t in several for c in cases_of(t, grown, candidates, extra)]
    bench = FaultBench(cases, candidates, floor, known)
    if extra:
        columns = [
            np.concatenate(
                [(run[1][c.ready.canonical(n)] * (spread or {})[n]).ravel() for c, run in zip(cases, bench.nominal, strict=True)]
            )
            for n in extra
        ]
        bench.spread_over(np.column_stack(columns))
    return _weighed(bench)


def _weighed(bench: FaultBench) -> Diagnosis:
    """Return probabilities of groups and faults from how well each explains."""
    z = bench.root @ bench.d
    whole = float(z @ z)
    tried = {k: _linear(bench, c, z) for k, c in enumerate(bench.candidates)}
    # those that matter again, with the response where they end and not where they begin
    for group in GROUPS:
        ranked = sorted((k for k, c in enumerate(bench.candidates) if c.group == group), key=lambda k: -tried[k][0])
        for k in ranked[:REFITTED]:
            if bench.candidates[k].free:
                tried[k] = _refitted(bench, bench.candidates[k], z, tried[k])
    logs = {g: _log_mean([tried[k][0] for k, c in enumerate(bench.candidates) if c.group == g]) for g in GROUPS}
    logs = {g: v for g, v in logs.items() if np.isfinite(v)} | {NOTHING: 0.0}
    top = max(logs.values())
    total = sum(np.exp(v - top) for v in logs.values())
    groups = {g: float(np.exp(v - top) / total) for g, v in sorted(logs.items(), key=lambda item: -item[1])}
    found = []
    for k, c in enumerate(bench.candidates):
        evidence, amount, error, left, rms = tried[k]
        count = sum(o.group == c.group for o in bench.candidates)
        probability = float(np.exp(evidence - top) / total / count)
        found.append(Suspect(c.group, c.name, amount, error, c.unit, c.words(amount), probability, 1.0 - left / whole, rms))
    ranked_faults = sorted(found, key=lambda s: -s.probability)
    return Diagnosis(groups, tuple(ranked_faults[:20]), float(np.sqrt(np.mean(bench.d**2))))


Tried = tuple[float, float, float, float, float]
"""Log of the evidence over that of no fault, amount, its error, weighted squares left, RMS left [K]."""


def _linear(bench: FaultBench, c: Candidate, z: Array) -> Tried:
    s = bench.response(c, bench.nominal)
    w = bench.root @ s
    amount, square = _best(c, float(w @ w), float(w @ z))
    return _evidence(c, z, z - w * amount, bench.d - s * amount, amount, square)


def _refitted(bench: FaultBench, c: Candidate, z: Array, begun: Tried) -> Tried:
    from thermid.errors import ThermidError

    amount, best = begun[1], begun
    for _ in range(ROUNDS):
        try:
            added, s = bench.moved(c, amount)
        except ThermidError:
            return best
        w, left = bench.root @ s, bench.root @ (bench.d - added)
        following, square = _best(c, float(w @ w), float(w @ (left + w * amount)))
        best = _evidence(c, z, left, bench.d - added, amount, square)
        # half steps where it would leave what is possible
        floor = -0.9 if c.unit == "1" else -np.inf
        following = max(following, 0.5 * (amount + floor)) if np.isfinite(floor) else following
        if abs(following - amount) < 1e-3 * c.size:
            break
        amount = following
    return best


def _best(c: Candidate, own: float, cross: float) -> tuple[float, float]:
    """Return the likeliest amount, and its curvature."""
    square = own + 1.0 / c.size**2
    amount = cross / square
    return (max(amount, 0.0) if c.one_sided else amount), square


def _evidence(c: Candidate, z: Array, left: Array, rest: Array, amount: float, square: float) -> Tried:
    gain = 0.5 * (float(z @ z) - float(left @ left) - (amount / c.size) ** 2) - 0.5 * float(np.log(c.size**2 * square))
    gain += float(np.log(2.0)) if c.one_sided and amount > 0 else 0.0
    return gain, amount, float(square**-0.5), float(left @ left), float(np.sqrt(np.mean(rest**2)))


def _log_mean(values: Sequence[float]) -> float:
    if not values:
        return -np.inf
    top = max(values)
    return float(top + np.log(np.mean(np.exp(np.array(values) - top))))
