"""The logs of a diagnosis as one vector of deviations: what simulates them, their covariance, what every fault would add to them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.explain.suspects import Candidate
from thermid.fit.calibration import Calibration
from thermid.simulation.simulator import Simulator, prepare

__all__ = ["Case", "FaultBench", "cases_of"]

Array = NDArray[np.float64]
BINS = 24
"""Stretches of time into which every log is thinned."""


@dataclass(frozen=True, eq=False)
class Case:
    """One log: thinned deviations, and what simulates it."""

    ready: Simulator
    sensors: tuple[str, ...]
    nodes: tuple[str, ...]
    centres: Array
    deviations: Array
    errors: Array
    room: str
    starts: Mapping[str, tuple[str, ...]]

    def run(self, values: Mapping[str, float], only: str = "") -> tuple[Array, dict[str, Array], Array]:
        """Return temperatures (sensors, bins), their derivatives by free name (one, or all), and temperatures of the room (bins,)."""
        run = self.ready.run(values, sensitivities=True)
        at = np.array([np.interp(self.centres, run.times, run[n].kelvin) for n in self.nodes])
        several = [run.slopes(n) for n in self.nodes]
        slopes = {
            f: np.array([np.interp(self.centres, run.times, m[:, k]) for m in several])
            for k, f in enumerate(self.ready.free)
            if only in ("", f)
        }
        return at, slopes, np.interp(self.centres, run.times, run[self.room].kelvin)


class FaultBench:
    """All logs together: deviations as one vector, their covariance, the response of every candidate."""

    def __init__(self, cases: Sequence[Case], candidates: Sequence[Candidate], floor: float, accuracy: Mapping[str, float]) -> None:
        self.cases, self.candidates = cases, candidates
        self.nominal = [c.run({}) for c in cases]
        self.d = np.concatenate([c.deviations.ravel() for c in cases])
        self._covariance = self._errors(floor, accuracy)

    def _errors(self, floor: float, accuracy: Mapping[str, float]) -> Array:
        """Return the covariance of the deviations where nothing is wrong: noise, constant errors of sensors, a part that wanders."""
        blocks, owner = [], []
        for c in self.cases:
            near = np.exp(-np.abs(c.centres[:, None] - c.centres[None, :]) / (0.2 * (np.ptp(c.centres) or 1.0)))
            for k, s in enumerate(c.sensors):
                blocks.append(np.diag(c.errors[k] ** 2) + floor**2 * near)
                owner += [s] * c.centres.size
        out = np.zeros((len(owner), len(owner)))
        at = 0
        for b in blocks:
            out[at : at + len(b), at : at + len(b)] = b
            at += len(b)
        same = np.array(owner)[:, None] == np.array(owner)[None, :]
        own = np.array([accuracy.get(s, 0.0) for s in owner])
        return np.asarray(out + same * own[:, None] * own[None, :])

    @cached_property
    def root(self) -> Array:
        """The inverse of a Cholesky factor: what it multiplies has independent errors of size one."""
        return np.asarray(np.linalg.inv(np.linalg.cholesky(self._covariance)))

    def spread_over(self, columns: Array) -> None:
        """Count what values that are not known exactly do to the readings, a column per direction."""
        self._covariance = self._covariance + columns @ columns.T
        self.__dict__.pop("root", None)

    def response(self, c: Candidate, runs: Sequence[tuple[Array, dict[str, Array], Array]]) -> Array:
        """Return what a unit of a candidate adds to every simulated reading."""
        parts = []
        for case, (at, slopes, room) in zip(self.cases, runs, strict=True):
            if c.free:
                factor = c.start if c.group == "capacitance" else 1.0
                part = factor * slopes[case.ready.canonical(c.free)]
            else:
                own = np.array([c.sensor in ("", s) for s in case.sensors])[:, None]
                part = own * (np.ones_like(at) if c.unit == "K" else room[None, :] - at)
                # what starts at a wrong reading runs on from there
                for s, names in case.starts.items():
                    if c.sensor in ("", s):
                        first = 1.0 if c.unit == "K" else float(room[0] - at[case.sensors.index(s), 0])
                        part = part - first * sum(slopes[n] for n in names)
            parts.append(part.ravel())
        return np.concatenate(parts)

    def moved(self, c: Candidate, amount: float) -> tuple[Array, Array]:
        """Return what a candidate of some size adds to the simulated readings, and its response there."""
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


def cases_of(told: Calibration, grown: Any, candidates: Sequence[Candidate], extra: Sequence[str]) -> list[Case]:
    """Return the logs of a comparison, thinned, each with what simulates it and the unknowns of the candidates free."""
    out = []
    for e in told.experiments:
        own = [b for b in told.blocks if b.record == e.record.name]
        begin, end = float(min(b.times[0] for b in own)), float(max(b.times[-1] for b in own))
        edges = np.linspace(begin, end, BINS + 1)
        centres = 0.5 * (edges[1:] + edges[:-1])
        deviations, errors = np.zeros((len(own), BINS)), np.zeros((len(own), BINS))
        for k, b in enumerate(own):
            place = np.clip(np.searchsorted(edges, b.times, side="right") - 1, 0, BINS - 1)
            count = np.bincount(place, minlength=BINS)
            sums = np.bincount(place, b.residuals, minlength=BINS)
            filled = count > 0
            deviations[k] = np.interp(centres, centres[filled], sums[filled] / count[filled])
            noise = float(e.observations[k].noise or 0.05) if k < len(e.observations) else 0.05
            errors[k] = np.where(filled, noise / np.sqrt(np.maximum(count, 1)), 10.0)
        begun = {o.sensor: tuple(f"initial.{n}" for n in e.loose if n == o.seat) for o in e.observations}
        for node, sensor in e.readings.items():
            begun[sensor] = (*begun.get(sensor, ()), f"initial.{node}")
        starts = {s: tuple(dict.fromkeys(names)) for s, names in begun.items() if names}
        initial = [n for names in starts.values() for n in names]
        free = tuple(dict.fromkeys([c.free for c in candidates if c.free] + list(extra) + initial))
        ready = prepare(grown, e.bare, free, times=np.linspace(0.0, e.bare.seconds, 4 * BINS + 1))
        room = ready.wiring.network.boundaries[0]
        out.append(Case(ready, tuple(b.sensor for b in own), tuple(b.node for b in own), centres, deviations, errors, room, starts))
    return out
