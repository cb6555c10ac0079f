"""Predictions without readings: what a filter foresees from a moment on, noise carried, and how well that met what was left out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from thermid.estimation.likelihood import DIFFERENCE, Likelihood
from thermid.estimation.passing import Pass, Passing
from thermid.linear_algebra import Array

ORIGINS: Final = 8
"""Moments from which a left-out stretch is foreseen, at most."""
INSIDE: Final = 1.959964
"""Standard deviations of a 95 % band."""


@dataclass(frozen=True, eq=False)
class OpenLoopTrace:
    """Readings as foreseen from a moment on.

    Parameters
    ----------
    record, sensor : str
    times : array (readings,)           [s]
    measured, foreseen : array          [K]
    sd : array (readings,)              State, process noise, values and reading noise together. [K]
    """

    record: str
    sensor: str
    times: Array
    measured: Array
    foreseen: Array
    sd: Array

    @property
    def rmse(self) -> float:
        """Of measured less foreseen. [K]"""
        return float(np.sqrt(np.mean((self.measured - self.foreseen) ** 2)))

    @property
    def inside(self) -> float:
        """Share of the readings inside their 95 % bands. [-]"""
        return float(np.mean(np.abs(self.measured - self.foreseen) <= INSIDE * self.sd))


@dataclass(frozen=True)
class OpenLoopScore:
    """How well readings were foreseen over a horizon, nothing read in between.

    Parameters
    ----------
    rmse : float        Of all of them. [K]
    inside : float      Share inside the 95 % bands. [-]
    readings, origins : int
    """

    rmse: float
    inside: float
    readings: int
    origins: int


def members_about(likelihood: Likelihood, fitted: Array, covariance: Array) -> tuple[list[Array], Array]:
    """Return values and their neighbours either way, and what turns differences of these into standard deviations (unknowns, columns)."""
    steps = DIFFERENCE * np.array([u.scale for u in likelihood.unknowns])
    known = np.where(np.isfinite(covariance), covariance, 0.0)
    sizes, vectors = np.linalg.eigh(known)
    root = vectors * np.sqrt(np.maximum(sizes, 0.0))
    shifts = np.diag(steps)
    return [fitted, *(fitted + s for s in shifts), *(fitted - s for s in shifts)], root / (2.0 * steps[:, None])


def outlooks(likelihood: Likelihood, i: int, fitted: Array, covariance: Array, origins: Array, horizon: float) -> list[list[OpenLoopTrace]]:
    """Return what each sensor of a record is foreseen to read after each origin, up to a horizon [s] later.

    Parameters
    ----------
    likelihood : Likelihood     The record's.
    i : int                     Which record.
    fitted : array (unknowns,)  Values, in the fitted forms.
    covariance : array          Of these; nothing of what is infinite is carried.
    origins : array (origins,)  Times up to which readings are taken. [s]
    """
    members, root = members_about(likelihood, fitted, covariance)
    passing = likelihood.passing(i, members)
    kept = passing.run(keep=True)
    return [_by_sensor(likelihood, i, _rows_after(passing, kept, root, float(origin), horizon)) for origin in origins]


def _rows_after(passing: Passing, kept: Pass, root: Array, origin: float, horizon: float) -> list[tuple[int, float, float, float]]:
    """Return sensor, time [s], foreseen less measured [K] and its standard deviation [K] of every reading after an origin."""
    place = int(np.searchsorted(kept.times, origin * (1 + 1e-12), side="right")) - 1
    belief, count = kept.beliefs[place], root.shape[0]
    rows: list[tuple[int, float, float, float]] = []
    while place + 1 < kept.times.size and kept.times[place + 1] <= origin + horizon * (1 + 1e-12):
        belief, _ = passing.ahead(belief, place)
        place += 1
        time = float(kept.times[place])
        for r in passing.readings(belief, place, time):
            apart = np.einsum("mi,mi->m", r.row, belief.mean) - r.value
            slope = (apart[1 : 1 + count] - apart[1 + count :]) @ root
            seen = belief.root[0].T @ r.row[0]
            rows.append((r.sensor, time, float(apart[0]), float(np.sqrt(seen @ seen + slope @ slope + r.noise[0] ** 2))))
    return rows


def _by_sensor(likelihood: Likelihood, i: int, rows: list[tuple[int, float, float, float]]) -> list[OpenLoopTrace]:
    experiment = likelihood.problem.experiments[i]
    out = []
    for k, o in enumerate(experiment.observations):
        own = np.array([r[1:] for r in rows if r[0] == k]).reshape(-1, 3)
        if own.size:
            times = own[:, 0]
            measured = np.interp(times, experiment.times[o.index], o.measured)
            out.append(OpenLoopTrace(experiment.record.name, o.sensor, times, measured, measured + own[:, 1], own[:, 2]))
    return out


def foresight(found: list[list[OpenLoopTrace]]) -> OpenLoopScore:
    """Return how well all of some outlooks met the readings."""
    parts = [o for several in found for o in several]
    off = np.concatenate([o.measured - o.foreseen for o in parts])
    sd = np.concatenate([o.sd for o in parts])
    inside = float(np.mean(np.abs(off) <= INSIDE * sd))
    return OpenLoopScore(float(np.sqrt(np.mean(off**2))), inside, off.size, len(found))


def origins_of(split: float, end: float, horizon: float) -> Array:
    """Return moments (origins,) from a split on, from each of which a horizon fits before the end. [s]"""
    last = max(split, end - horizon)
    count = max(1, min(ORIGINS, int((last - split) / (0.5 * horizon)) + 1))
    return np.linspace(split, last, count)
