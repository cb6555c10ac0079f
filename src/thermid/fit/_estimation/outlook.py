"""Predictions without readings: what a filter foresees from a moment on, noise carried, and how well that met what was left out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from thermid.base.errors import IdentificationError, ScenarioError, nearest
from thermid.base.units import HALF_WIDTH_95, Array
from thermid.fit._estimation.likelihood import DIFFERENCE, Likelihood, likelihood_of
from thermid.fit._estimation.passing import Pass, Passing
from thermid.fit._estimation.process import ProcessNoise
from thermid.fit._problem.gather import build_problem
from thermid.fit._problem.request import Request
from thermid.fit._problem.residuals import Problem
from thermid.measure.records import Channel, Record
from thermid.model.tree import literal
from thermid.simulation.runs import Scenario


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
        return float(np.mean(np.abs(self.measured - self.foreseen) <= HALF_WIDTH_95 * self.sd))


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
    """Return the values x (unknowns,), fitted form, x + h_k, x - h_k for each k, and a matrix M (unknowns, columns) for their differences.

    M_kc = R_kc / (2 h_k) with R R' the `covariance`: the differences (y(x + h_k) - y(x - h_k)) of any answer y times M are its derivatives
    times R, standard deviations. h_k is `DIFFERENCE` of the scale. Where the covariance is not finite it counts as zero.
    """
    steps = DIFFERENCE * np.array([u.scale for u in likelihood.unknowns])
    finite_covariance = np.where(np.isfinite(covariance), covariance, 0.0)
    sizes, vectors = np.linalg.eigh(finite_covariance)
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
    filtered = passing.run(keep=True)
    return [_by_sensor(likelihood, i, _rows_after(passing, filtered, root, float(origin), horizon)) for origin in origins]


def _rows_after(passing: Passing, filtered: Pass, root: Array, origin: float, horizon: float) -> list[tuple[int, float, float, float]]:
    """Return sensor, time [s], foreseen less measured [K] and its standard deviation [K] of every reading up to a horizon.

    From `origin` [s] on for `horizon` [s]. The variance is H P H' + |g|^2 + r^2: covariance P of the state by the reading's row H, g what
    one column of `root` (parameters, parameters) moves the reading by, from members moved either way, and the noise r of the reading.
    """
    place = int(np.searchsorted(filtered.times, origin * (1 + 1e-12), side="right")) - 1
    belief, count = filtered.beliefs[place], root.shape[0]
    rows: list[tuple[int, float, float, float]] = []
    while place + 1 < filtered.times.size and filtered.times[place + 1] <= origin + horizon * (1 + 1e-12):
        belief, _ = passing.ahead(belief, place)
        place += 1
        time = float(filtered.times[place])
        for r in passing.readings(belief, place, time):
            apart = np.einsum("mi,mi->m", r.row, belief.mean) - r.value
            slope = (apart[1 : 1 + count] - apart[1 + count :]) @ root
            spread_of_reading = belief.root[0].T @ r.row[0]
            rows.append(
                (r.sensor, time, float(apart[0]), float(np.sqrt(spread_of_reading @ spread_of_reading + slope @ slope + r.noise[0] ** 2)))
            )
    return rows


def _by_sensor(likelihood: Likelihood, i: int, rows: list[tuple[int, float, float, float]]) -> list[OpenLoopTrace]:
    """Return the open-loop errors of experiment `i` by sensor.

    `rows` are (number of the observation, time [s], foreseen less measured [K], its standard error [K]).
    """
    experiment = likelihood.problem.experiments[i]
    out = []
    for k, o in enumerate(experiment.observations):
        rows_of_sensor = np.array([r[1:] for r in rows if r[0] == k]).reshape(-1, 3)
        if rows_of_sensor.size:
            times = rows_of_sensor[:, 0]
            measured = np.interp(times, experiment.times[o.index], o.measured)
            out.append(
                OpenLoopTrace(experiment.record.name, o.sensor, times, measured, measured + rows_of_sensor[:, 1], rows_of_sensor[:, 2])
            )
    return out


def unread(request: Request, fitted: Likelihood, scenario: Scenario, times: Array, start_sd: Mapping[str, str]) -> Likelihood:
    """Return the likelihood of a scenario that nobody has logged, with the noises of another; its states are known at the start.

    Parameters
    ----------
    request : Request       What was fitted.
    fitted : Likelihood     Of its records.
    scenario : Scenario     With its start.
    times : array (times,)  From zero on. [s]
    start_sd : dict         Node, or boundary with a random walk -> standard deviation of its start. [K]

    Raises
    ------
    ScenarioError   Without a start, or for times below zero.
    """
    name = f"{request.name}, prediction"
    if times.size < 2 or times[0] < 0.0:
        raise ScenarioError(
            "a prediction needs times from zero on. Give times, or a scenario with a duration.", name, code="value.incomplete"
        )
    node = fitted.dynamics[0].states[0]
    # a record must read something; what it reads here is never taken
    blank = Channel.from_array(node, np.full(times.size, 300.0), unit="K", role="node", target=node, noise=1.0)
    record = Record.from_arrays(name, times, {node: blank})
    unread_request = replace(
        request, records=(record,), scenarios={"*": scenario}, local={}, record_local={}, readings={}, weights={}, held_errors={}, name=name
    )
    problem = build_problem(unread_request)
    if problem.experiments[0].loose:
        raise ScenarioError(
            "the scenario does not say at which temperature it starts. Add start, or initial temperatures.", name, code="value.incomplete"
        )
    walks = {p.target: 0.0 for p in fitted.noises if p.walks}
    return likelihood_of(problem, fitted.noises, walks | starts_sd(problem, start_sd, fitted.noises, name))


def starts_sd(problem: Problem, texts: Mapping[str, str], noises: Sequence[ProcessNoise], where: str) -> dict[str, float]:
    """Return node or boundary -> standard deviation of its start. [K]"""
    network, out = problem.experiments[0].network, {}
    walks = [p.target for p in noises if p.walks]
    for raw, text in texts.items():
        path = network.find(raw, f"{where}, start_sd")
        if path not in network.nodes and path not in walks:
            raise IdentificationError(
                f"'{raw}' is a boundary without noise, so its start is given.{nearest(raw, network.nodes)}",
                f"{where}, start_sd",
                code="name.unknown",
            )
        value = literal(text, "K", f"{where}, start_sd.{raw}")
        if not (np.isfinite(value) and value >= 0.0):
            raise IdentificationError(
                f"a standard deviation of {text} is not possible. Give zero or more.",
                f"{where}, start_sd.{raw}",
                code="value.outside-range",
            )
        out[path] = value
    return out


def course(likelihood: Likelihood, fitted: Array, covariance: Array, times: Array) -> tuple[Array, Array]:
    """Return mean and variance (times, states) of a run without readings. [SI]

    The variance is that of the filter's prediction, which carries the process noise, plus ``J P J'`` of the fitted values: J by central
    differences of runs, P their covariance.
    """
    members, root = members_about(likelihood, fitted, covariance)
    passing, count = likelihood.passing(0, members), len(fitted)
    belief = passing.start()
    means, variances = [belief.mean], [belief.variance[0]]
    for place in range(passing.dynamics.grid.size - 1):
        belief, _ = passing.ahead(belief, place)
        means.append(belief.mean)
        variances.append(belief.variance[0])
    at = np.searchsorted(passing.dynamics.grid, times - 1e-9 * max(float(times[-1]), 1.0))
    every = np.array(means)[at]
    by_values = np.einsum("tus,uc->tsc", every[:, 1 : 1 + count] - every[:, 1 + count :], root)
    return every[:, 0], np.array(variances)[at] + np.sum(by_values**2, axis=2)


def foresight(outlooks_by_sensor: list[list[OpenLoopTrace]]) -> OpenLoopScore:
    """Return RMSE [K] and the share [-] of readings within 95 % of all outlooks, with the numbers of readings and of sensors."""
    parts = [o for several in outlooks_by_sensor for o in several]
    off = np.concatenate([o.measured - o.foreseen for o in parts])
    sd = np.concatenate([o.sd for o in parts])
    inside = float(np.mean(np.abs(off) <= HALF_WIDTH_95 * sd))
    return OpenLoopScore(float(np.sqrt(np.mean(off**2))), inside, off.size, len(outlooks_by_sensor))
