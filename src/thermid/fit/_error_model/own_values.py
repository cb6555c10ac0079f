"""What each run has for itself, a room or a start: how far it stood from where it was assumed, and so what a further run may have."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np

from thermid.base.linear_algebra import symmetric_inverse
from thermid.fit._calibration import Calibration
from thermid.fit._problem.experiment import Experiment
from thermid.fit._problem.request import Request

OWN_VALUES: Final = "own"
"""Where the provenance of fitted values keeps it."""
ROOM: Final = 2.0
"""Scale of the half-normal prior of the standard deviation of a room or start from run to run. [K]"""
ROOMS: Final = np.geomspace(0.03, 30.0, 31)
"""Standard deviations of a room or start that are tried. [K]"""
SLOPE: Final = 0.5
"""Standard deviation of what one more kelvin of another sensor's first reading says of a room or start, before any run: from none of it
to all of it (the other sensor alone). [-]"""
BALANCE: Final = "balance of its neighbours"
"""What a start is assumed to be that nobody gave, of a node without a sensor in a run that does not begin at rest."""


@dataclass(frozen=True)
class Beside:
    """Another sensor's first reading, which says more of a temperature that stands on the first reading of one.

    Parameters
    ----------
    channel : str       The other sensor.
    mean : float        Its first reading less the one that the temperature stands on, over the runs. [K]
    slope, error : float    What the temperature differs by for one more kelvin of that difference, and its standard error. [-]
    """

    channel: str
    mean: float
    slope: float
    error: float


@dataclass(frozen=True)
class OwnValue:
    """A temperature that each run has for itself, a room or a start: how far it stands from where it is assumed.

    Parameters
    ----------
    name : str          Boundary or ``initial.<node>``.
    start : str         What it is assumed to be: the name of a channel, whose first reading stands there, a temperature, or `BALANCE`.
    mean, sd : float    Over the runs. [K]
    runs : int          How many.
    beside : tuple of Beside    What the first readings of other sensors say of it; the mean is that at their means.
    """

    name: str
    start: str
    mean: float
    sd: float
    runs: int
    beside: tuple[Beside, ...] = ()

    def expected_from(self, first: Mapping[str, float]) -> tuple[float, float]:
        """Return mean and standard deviation of a further run's value about its start, by that run's first readings. [K]

        mean + sum_b slope_b x_b, x_b the first reading of sensor b less that at the start, less its mean over the runs; variance sd^2 (1 +
        1 / runs) + sum_b (error_b x_b)^2. x_b = 0 for a sensor that the further run does not have, or without one at the start.

        Parameters
        ----------
        first : dict   Sensor -> first reading of the further run. [K]
        """
        mean, variance = self.mean, self.sd**2 * (1.0 + 1.0 / self.runs)
        if self.start not in first:
            return mean, float(np.sqrt(variance))
        for b in (b for b in self.beside if b.channel in first):
            apart = first[b.channel] - first[self.start] - b.mean
            mean += b.slope * apart
            variance += (b.error * apart) ** 2
        return mean, float(np.sqrt(variance))

    def to_dict(self) -> dict[str, Any]:
        """Return plain numbers and texts for a file."""
        plain = {"name": self.name, "start": self.start, "mean": self.mean, "sd": self.sd, "runs": self.runs}
        return plain | ({"beside": [asdict(b) for b in self.beside]} if self.beside else {})

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> OwnValue:
        """Return what `to_dict` gave."""
        return cls(**{**data, "beside": tuple(Beside(**b) for b in data.get("beside", ()))})


FoundIn = tuple[Mapping[str, float], float, float]
"""Of a run: sensor -> first reading, what was found of a value less its start, and the error of that. [K]"""


def own_values_of(fit: Calibration) -> tuple[OwnValue, ...]:
    """Return how far rooms and starts stood from where they were assumed, of those that two runs or more of a fit have."""
    assert fit.problem is not None
    if fit.request is None:
        return ()
    errors = {(i.record, i.name): i.error for i in fit.local}
    runs_of_value: dict[tuple[str, str], list[FoundIn]] = {}
    for e in fit.problem.experiments:
        first = e.first_readings(fit.request.window)
        for key, off in _found_in(fit, fit.request, e).items():
            runs_of_value.setdefault(key, []).append((first, off, errors[e.record.name, key[0]]))
    return tuple(_own_value(name, start, several) for (name, start), several in runs_of_value.items() if len(several) > 1)


def own_values_kept(provenances: Sequence[Mapping[str, Any]]) -> tuple[OwnValue, ...]:
    """Return what stages keep of it, the first one first."""
    return tuple(OwnValue.from_dict(o) for provenance in provenances for o in provenance.get(OWN_VALUES, ()))


def own_value(own_values: Sequence[OwnValue], name: str, start: str = "") -> OwnValue | None:
    """Return how far a room or start stands from where it is assumed, of the stage with most runs; None where none says it.

    With the same text of `start` the mean counts; else only how far runs differ, and their mean as an error. What runs say of a start
    that somebody gave says nothing of one at the balance of its neighbours.
    """
    every = [o for o in own_values if o.name == name]
    alike = [o for o in every if o.start == start]
    if alike:
        return max(alike, key=lambda o: o.runs)
    if not every or start == BALANCE:
        return None
    most = max(every, key=lambda o: o.runs)
    return OwnValue(name, start, 0.0, float(np.hypot(most.sd, most.mean)), most.runs)


def _found_in(fit: Calibration, request: Request, e: Experiment) -> dict[tuple[str, str], float]:
    """Return (name, text of its stated start) -> found less start, of the rooms and starts of a record. [K]"""
    find = {e.wired(n): n for n in request.locals_of(e.record)}
    out = {}
    for i in (i for i in fit.local if i.record == e.record.name):
        fitted_value = fit.fitted[f"{i.record}: {i.name}"]
        if i.name in find:
            out[i.name, request.locals_of(e.record)[find[i.name]].start] = fitted_value - request.local_start(e.record, find[i.name])
        elif (node := i.name.removeprefix("initial.")) in e.hidden and node != i.name:
            out[i.name, BALANCE] = fitted_value - e.hidden[node].mean
    return out


def _own_value(name: str, start: str, several: Sequence[FoundIn]) -> OwnValue:
    """Return one of them from the runs that have it: first readings of sensors, what each found [K], and its error [K].

    Offsets are ``N(mean + X slopes, sd^2 + V)``; X is how far the first readings of other sensors stand from the one that the value
    stands on. The sd has the largest restricted likelihood (Patterson and Thompson, Biometrika 58 (1971) 545).
    """
    off, error_variance = np.array([o for _, o, _ in several]), np.array([error**2 for _, _, error in several])
    others = [c for c in several[0][0] if c != start and all(c in first and start in first for first, _, _ in several)]
    apart = np.array([[first[c] - first[start] for c in others] for first, _, _ in several]).reshape(off.size, len(others))
    usual = apart.mean(axis=0)
    rows = np.column_stack([np.ones(off.size), apart - usual])
    prior = np.diag([0.0, *np.full(len(others), SLOPE**-2.0)])
    logs, ends, squares = np.zeros(ROOMS.size), np.zeros((ROOMS.size, rows.shape[1])), np.zeros((ROOMS.size, rows.shape[1]))
    for i, sd in enumerate(ROOMS):
        variance = error_variance + sd**2
        weighed = rows / variance[:, None]
        spread = symmetric_inverse(weighed.T @ rows + prior)
        ends[i] = spread @ weighed.T @ off
        residuals = off - rows @ ends[i]
        squares[i] = np.diag(spread) + ends[i] ** 2
        # the last term stands for the estimated mean and slopes
        logs[i] = -0.5 * np.sum(np.log(variance) + residuals**2 / variance) - 0.5 * ends[i] @ prior @ ends[i]
        logs[i] += 0.5 * np.linalg.slogdet(spread)[1]
    # ln sd because each size that is tried stands for an equal step of its logarithm, then the half-normal prior
    logs += np.log(ROOMS) - 0.5 * (ROOMS / ROOM) ** 2
    share = np.exp(logs - logs.max())
    share /= share.sum()
    end = share @ ends
    errors = np.sqrt(np.maximum(share @ squares - end**2, 0.0))
    beside = tuple(Beside(c, float(m), float(k), float(s)) for c, m, k, s in zip(others, usual, end[1:], errors[1:], strict=True))
    size = float(np.sqrt(share @ ROOMS**2))  # the variance of a prediction is linear in the squares
    return OwnValue(name, start, float(end[0]), size, off.size, beside)
