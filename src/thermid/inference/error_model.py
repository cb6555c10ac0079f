"""The model of error: one object beside a fit that says how far any answer of its model may be from the truth, and why.

For run r, sensor i at node n, time t (Kennedy and O'Hagan, J. R. Statist. Soc. B 63 (2001) 425, with the errors inside the elements, as
Sargsyan, Huan and Najm, Int. J. Uncertainty Quantification 9 (2019) 365 have them, so that they extrapolate with the physics):

    y = T_n(t; theta + d(x), u + delta) + b + w + e

    theta   values of the deck with their priors; logarithms of positive ones
    d(x)    departures of coefficients, joints, masses and powers: a physical mean, and about it a smooth random function of the
            operating point x, of size s_c, and a constant of each run, of size s_run
    delta   what a room is off by: an Ornstein-Uhlenbeck process through the network
    b, e    constant error and noise of an instrument; w what no element explains, an Ornstein-Uhlenbeck process at a sensor

Runs are straight lines in everything unknown about values that Newton steps find. Sizes are averaged over by their evidence; where a deck
does not say what carries the heat of its surfaces, so are free air and a stream. `sizes.py` has every number that decides.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from thermid.base.arguments import takes_objects
from thermid.base.dual import value_of
from thermid.base.errors import IdentificationError, SolverError
from thermid.base.linear_algebra import Array, Indices
from thermid.fit.calibration import Calibration
from thermid.fit.discrepancy import coefficient_path, constant_coefficients, discrepancy_kept, losing_gas
from thermid.fit.problem import Problem, Request
from thermid.inference._error_model.elements import course_of, ways_of, with_heats, with_laws
from thermid.inference._error_model.gaussian import NormalMixture, weights_of
from thermid.inference._error_model.model import GROUPS, FittedWay, deviations, fitted_way, open_values, points_of, reachable
from thermid.inference._error_model.records import (
    INSTRUMENT,
    ROOM,
    START,
    VALUES as VALUES,
    BesideRow as BesideRow,
    RecordRun,
    problem_of_record,
    shared_with,
    split,
)
from thermid.inference._error_model.runs import UnknownColumn
from thermid.inference._error_model.sizes import COUNTED, FAR_SIZE, NODES_FOLLOWED, OUTSIDE, SIZES as SIZES
from thermid.model.identity import identity_of
from thermid.simulation.network import Network
from thermid.simulation.runs import Simulator, network_for, output_times
from thermid.simulation.scenarios import Scenario
from thermid.simulation.solver import Engine, Options, Wiring

FOLLOWED = "prediction.error-not-followed"
"""Code of what is said of a fit that the model of error cannot follow."""
STRUCTURE, RUN, UNEXPLAINED, AVERAGED, READING = (
    "structure at this distance",
    "this run",
    "what no element explains",
    "sizes, and what carries the heat",
    "noise of a reading",
)
"""What a band comes from."""
NARROWS = {
    VALUES: "a run that determines the values better, or stated spreads",
    STRUCTURE: "a run at conditions nearer to those that are asked",
    RUN: "further runs: they tell how much elements differ from run to run",
    ROOM: "a room that is logged better, or held",
    START: "readings of the nodes before the run begins",
    INSTRUMENT: "a sensor or meter of better accuracy",
    READING: "nothing: single readings scatter",
    UNEXPLAINED: "an element that explains what the residuals show: criticise looks for it",
    AVERAGED: "a deck that states what carries the heat (carried_by), or a run at another difference",
}
"""Source -> what would narrow a band that comes from it."""


@dataclass(frozen=True, eq=False)
class ErrorBand:
    """What is known of the temperature of a node over a run.

    Parameters
    ----------
    node : str
    times : array (times,)      [s]
    mixture : NormalMixture           Of its temperature. [K]
    parts : dict                Source -> variance (times,). [K^2]
    beside : array (times, sources)     What a unit of each source beside the model of error does. [K]
    """

    node: str
    times: Array
    mixture: NormalMixture
    parts: Mapping[str, Array]
    beside: Array

    @property
    def kelvin(self) -> Array:
        """Expected temperature (times,). [K]"""
        return self.mixture.mean

    def interval(self, level: float = 0.95) -> tuple[Array, Array]:
        """Return the ends (times,) of the band that holds the truth with a probability. [K]"""
        return self.mixture.interval(level)

    @property
    def half_width(self) -> Array:
        """Half-width (times,) of the 95 % band. [K]"""
        low, high = self.interval()
        return 0.5 * (high - low)

    @property
    def shares(self) -> dict[str, float]:
        """Source -> its share of the variance, over the run. [-]"""
        sizes = {source: float(v.mean()) for source, v in self.parts.items()}
        whole = sum(sizes.values())
        return {source: v / whole if whole > 0.0 else 0.0 for source, v in sizes.items()}

    @property
    def narrowed_by(self) -> str:
        """What would narrow the band most."""
        shares = self.shares
        return NARROWS[max(shares, key=shares.__getitem__)]

    def __str__(self) -> str:
        """Return its end, where the band comes from, the largest first, and what would narrow it."""
        low, high = (float(x[-1]) - 273.15 for x in self.interval())
        told = ", ".join(f"{source} {100 * s:.0f} %" for source, s in sorted(self.shares.items(), key=lambda i: -i[1]) if s >= 0.005)
        end = f"{self.node}: {float(self.kelvin[-1]) - 273.15:.2f} degC, 95 % {low:.2f} .. {high:.2f}"
        return f"{end}, from {told}. Narrower by: {self.narrowed_by}"


@dataclass(frozen=True, eq=False)
class RunErrors:
    """What is known of a run.

    Parameters
    ----------
    bands : dict        Node -> ErrorBand.
    settled : dict      Node -> the same where it settles with the inputs of the end, at one time; empty where nothing settles.
    """

    bands: Mapping[str, ErrorBand]
    settled: Mapping[str, ErrorBand]


@dataclass(frozen=True, eq=False)
class ErrorModel:
    """The model of error of a fit.

    Parameters
    ----------
    fit : Calibration
    ways : tuple of FittedWay   The posterior for each way in which the heat of surfaces may be carried.
    weights : tuple of array    Probability of each member of each way.
    """

    fit: Calibration
    ways: tuple[FittedWay, ...]
    weights: tuple[Array, ...]

    @classmethod
    @takes_objects
    def of(cls, fit: Calibration) -> ErrorModel:
        """Return the model of error of a fit.

        Raises
        ------
        IdentificationError   When the calibration does not hold what its fit was asked, a log has a second clock, or the model is somebody
                              else's program.
        """
        problem = _problem_of(fit)
        fitted = np.array(list(fit.fitted.values()))
        points = points_of(problem, fitted)
        network = problem.experiments[0].network
        values = network.numbers({p: v.value for p, v in fit.values.assignments.items()}).values
        surfaces = constant_coefficients(network)
        coefficients = {p: float(value_of(values[coefficient_path(c)])) for p, c in surfaces.items()}
        emissivities = {p: float(value_of(values[c.emissivity])) for p, c in surfaces.items() if c.emissivity}
        ways = tuple(fitted_way(problem, fitted, w, points) for w in ways_of(network, points, coefficients, emissivities))
        every = weights_of(np.concatenate([w.members.log_evidence for w in ways]))
        return cls(fit, ways, tuple(np.split(every, np.cumsum([len(w.left) for w in ways])[:-1])))

    @property
    def carriers(self) -> dict[str, float]:
        """What may carry the heat of surfaces -> its probability by the readings, each as likely before them. [-]"""
        return {w.way.name: float(share.sum()) for w, share in zip(self.ways, self.weights, strict=True)}

    @property
    def sizes(self) -> dict[str, float]:
        """Size of a departure -> its root mean square by prior and readings."""
        total = sum(share @ w.sizes**2 for w, share in zip(self.ways, self.weights, strict=True))
        return dict(zip(GROUPS, np.sqrt(total).tolist(), strict=True))

    @property
    def misfit(self) -> float:
        """Root mean square of the readings over what the model of error allows; one is expected. [-]"""
        return float(np.sqrt(sum(share @ w.members.square for w, share in zip(self.ways, self.weights, strict=True))))

    @property
    def contradiction(self) -> str:
        """What of the readings no departure of a usual size explains, in words; empty where all is explained."""
        if self.misfit > OUTSIDE:
            return f"the readings lie {self.misfit:.2g} times further from the model than noise and all departures allow"
        # of all departures that of a room alone extrapolates with no element: a wrong power hides in it
        drift = self.sizes["room"] / SIZES["room"].value
        if drift > FAR_SIZE:
            return (
                f"the readings ask for {drift:.2g} times the usual {SIZES['room'].effect} "
                f"({self.sizes['room']:.2g} K beside {SIZES['room'].value:g} K)"
            )
        return ""

    @property
    def unknowns(self) -> tuple[str, ...]:
        """Values of the fit that its runs share, in the order of `covariance`."""
        return tuple(self.ways[0].values)

    @property
    def covariance(self) -> Array:
        """Covariance (values, values) of the values of the fit, in their fitted form."""
        count = len(self.unknowns)
        both = [(_centres(w), w.members.root[:, :count], s) for w, s in zip(self.ways, self.weights, strict=True)]
        mean = sum(s @ m for m, _, s in both)
        return np.asarray(sum(np.einsum("m,mij,mkj->ik", s, r, r) + np.einsum("m,mi,mj->ij", s, m - mean, m - mean) for m, r, s in both))

    def sample(self, count: int, seed: int = 0) -> Array:
        """Return draws (values, count) of the values of the fit, in their fitted form."""
        generator, size = np.random.default_rng(seed), len(self.unknowns)
        which = generator.choice(sum(len(s) for s in self.weights), count, p=np.concatenate(self.weights))
        means = np.concatenate([_centres(w) for w in self.ways])[which]
        out = np.empty((size, count))
        first = np.cumsum([0, *(len(s) for s in self.weights)])
        for k, member in enumerate(which):
            way = int(np.searchsorted(first, member, side="right")) - 1
            root = self.ways[way].members.root[member - first[way]][:size]
            out[:, k] = means[k] + root @ generator.standard_normal(root.shape[1])
        return out

    @takes_objects
    def band(
        self,
        scenario: Scenario,
        nodes: Sequence[str] = (),
        *,
        every: str | float | None = None,
        times: Any = None,
        as_logged: bool = False,
        beside: Mapping[str, BesideRow] | None = None,
    ) -> dict[str, ErrorBand]:
        """Return node -> what is known of its true temperature in a scenario; arguments and errors as in `run`."""
        return dict(self.run(scenario, nodes, every=every, times=times, as_logged=as_logged, beside=beside).bands)

    @takes_objects
    def run(
        self,
        scenario: Scenario,
        nodes: Sequence[str] = (),
        *,
        every: str | float | None = None,
        times: Any = None,
        as_logged: bool = False,
        beside: Mapping[str, BesideRow] | None = None,
    ) -> RunErrors:
        """Return what is known of true temperatures in a scenario.

        Parameters
        ----------
        scenario : Scenario
        nodes : sequence        Nodes; all by default.
        every, times            When, as in `simulate`.
        as_logged : bool        Whether rooms and powers of the scenario are what the instruments of the fit would read, constant errors
                                and all; else they are what acts.
        beside : dict           Name that may change in a run -> how it follows sources that the fit does not know; see `ErrorBand.beside`.

        Raises
        ------
        IdentificationError   When no departure of a usual size explains the readings (`contradiction`), or the scenario changes the gas
                              in a joint of which no log says how much is gas and `beside` does not say it.
        """
        self._refuse_contradiction()
        wanted = output_times(scenario, every, times)
        heaviest = max(float(s.max()) for s in self.weights)
        several = []
        for way, share in zip(self.ways, self.weights, strict=True):
            kept = np.flatnonzero(share > COUNTED * heaviest)
            if kept.size:
                several.append((way, kept, share[kept], StraightRun.of(self.fit, way, scenario, wanted, nodes, as_logged, beside or {})))
        weights = np.concatenate([share for _, _, share, _ in several])
        weights = weights / float(weights.sum())
        ends = {n: wanted.size for n in several[0][3].kelvin}
        out, settled = {}, {}
        for n, size in ends.items():
            members = [run.members(way, n, kept) for way, kept, _, run in several]
            answers = sum(share.sum() * run.beside[n] for _, _, share, run in several) / sum(share.sum() for _, _, share, _ in several)
            out[n] = _band(n, wanted, weights, members, answers, slice(0, size))
            if all(m.shape[1] > size for m, _ in members):
                settled[n] = _band(n, np.array([np.inf]), weights, members, answers, slice(size, size + 1))
        self._refuse_unreachable(scenario, wanted, out)
        return RunErrors(out, settled)

    def _refuse_unreachable(self, scenario: Scenario, times: Array, bands: Mapping[str, ErrorBand]) -> None:
        """Refuse bands that are wider than what the network can reach at all, because a value is determined by no reading."""
        assert self.fit.problem is not None
        unknowns, left = self.fit.problem.unknowns, np.sqrt(np.diag(self.covariance)).tolist()
        open_ = open_values(unknowns, dict(zip(self.unknowns, left, strict=True)))
        wide = {n: b for n, b in bands.items() if b.shares[VALUES] > 0.5} if open_ else {}
        if not wide:
            return
        loose = [u for u in unknowns if u.name in open_]
        for n, (low, high) in reachable(self.fit.fitted_model, scenario, loose, times, list(wide)).items():
            half, room = wide[n].half_width, 0.5 * (high - low)
            if (half > room).any() and ((wide[n].kelvin + half > high) | (wide[n].kelvin - half < low)).any():
                k = int((half - room).argmax())
                wider = f"the band of '{n}', +- {half[k]:.3g} K at {times[k]:.3g} s, would be wider than what the network can reach"
                raise IdentificationError(
                    f"no reading determines '{open_[0]}', and {wider} with any value of it, {low[k] - 273.15:.1f} to "
                    f"{high[k] - 273.15:.1f} degC. State a prior of it, or fit a run that determines it: next_test names one.",
                    self.fit.stage,
                    code="prediction.value-undetermined",
                )

    @takes_objects
    def readings(
        self,
        request: Request,
        local: Mapping[str, float],
        own: Mapping[str, tuple[float, float]],
        beside: Mapping[str, BesideRow] | None = None,
    ) -> dict[str, ReadingBand]:
        """Return sensor -> what is known of the readings of a record that the fit has not seen.

        Parameters
        ----------
        request : Request   That runs the record at the values of the fit.
        local : dict        What was fitted to the record, by the names of its unknowns -> its value. [K]
        own : dict          Boundary or ``initial.<node>`` -> mean and standard deviation of what it is off by in a further run. [K]
        beside : dict       Value -> how it follows sources of unit variance that the fit does not know.

        Raises
        ------
        IdentificationError   As `band`.
        """
        self._refuse_contradiction()
        problem = problem_of_record(self.fit, request, own, beside or {})
        _refuse_unsaid_gas(self.fit, problem.experiments[0].network)
        known = shared_with(self.fit, problem)
        heaviest = max(float(s.max()) for s in self.weights)
        kept = [np.flatnonzero(share > COUNTED * heaviest) for share in self.weights]
        several = [
            (way, k, share[k], RecordRun.of(way, problem, known, local))
            for way, k, share in zip(self.ways, kept, self.weights, strict=True)
            if k.size
        ]
        weights = np.concatenate([share for _, _, share, _ in several])
        weights = weights / weights.sum()
        parts = [_parts_of_record(run, way, k) for way, k, _, run in several]
        whole = {source: np.concatenate([p[source] for _, p in parts]) for source in {s: None for _, p in parts for s in p}}
        means = np.concatenate([m for m, _ in parts])
        mean = weights @ means
        told = {source: weights @ v for source, v in whole.items()} | {AVERAGED: weights @ (means - mean) ** 2}
        ends = np.cumsum([share.sum() for _, _, share, _ in several])
        shares = np.diff(ends / ends[-1], prepend=0.0)
        out = {}
        centre = [run.centres(_mean_of(way, k, share)) for way, k, share, run in several]
        for i, o in enumerate(problem.experiments[0].observations):
            trace, rows = several[0][3].traces[i], several[0][3].means[i]
            at = {s: np.interp(trace.times, rows.times, split(v, several[0][3].means)[i]) for s, v in told.items()}
            base = [o.measured + c[i] for c in centre]
            out[o.sensor] = ReadingBand(
                o.sensor, o.seat, trace.times, o.measured, np.asarray(shares @ base), at | {READING: trace.noise**2}
            )
        return out

    def _refuse_contradiction(self) -> None:
        """Refuse to predict where no departure of a usual size explains the readings."""
        if self.contradiction:
            raise IdentificationError(
                f"{self.contradiction}, so nothing is predicted. A column, a unit, a power or a noise of the logs is wrong, or an element "
                "is missing. `thermid criticise` looks for it.",
                self.fit.stage,
                code="prediction.readings-unexplained",
            )


@dataclass(frozen=True, eq=False)
class ReadingBand:
    """What is known of the readings of a sensor over a record.

    Parameters
    ----------
    sensor, node : str
    times : array (readings,)               [s]
    measured, predicted : array (readings,) [K]
    parts : dict                            Source -> variance (readings,). [K^2]
    """

    sensor: str
    node: str
    times: Array
    measured: Array
    predicted: Array
    parts: Mapping[str, Array]


def _mean_of(way: FittedWay, kept: Indices, share: Array) -> Array:
    """Return the mean (unknowns,) of some members of a way."""
    return np.asarray(share @ way.members.mean[kept] / share.sum())


def _parts_of_record(run: RecordRun, way: FittedWay, kept: Indices) -> tuple[Array, dict[str, Array]]:
    """Return the means (members, rows) of readings about a centre of their own [K], and source -> variance (members, rows). [K^2]"""
    rows, own = run.responses()
    means = way.members.mean[kept] @ rows.T
    parts = _parts(way, kept, rows, own, run.columns, run.beyond)
    wander = {left: run.wandering(*left) for left in {(float(a), float(b)) for a, b in way.left[kept]}}
    return means + run.reference, parts | {UNEXPLAINED: np.array([wander[float(a), float(b)] for a, b in way.left[kept]])}


def _centres(way: FittedWay) -> Array:
    """Return the means (members, values) of the values of a fit, in their fitted form."""
    return np.array(list(way.values.values())) + way.members.mean[:, : len(way.values)]


def _band(
    node: str, times: Array, weights: Array, several: Sequence[tuple[Array, dict[str, Array]]], beside: Array, rows: slice
) -> ErrorBand:
    """Return the band of a node over some rows, by the members of several ways."""
    means = np.concatenate([m[:, rows] for m, _ in several])
    parts = {source: np.concatenate([p[source][:, rows] for _, p in several]) for source in several[0][1]}
    mixture = NormalMixture(weights, means, np.sum(list(parts.values()), axis=0))
    told = {source: np.asarray(weights @ v) for source, v in parts.items()}
    told |= {AVERAGED: np.asarray(weights @ (means - mixture.mean) ** 2)}
    return ErrorBand(node, times, mixture, told, np.asarray(beside)[rows])


def _problem_of(fit: Calibration) -> Problem:
    """Return what a fit compared.

    Raises
    ------
    IdentificationError   When it is not there, or not what the model of error can follow.
    """
    problem = fit.problem
    if problem is None or not any(u.kind == "parameter" for u in problem.unknowns):
        raise IdentificationError("this calibration does not hold what its fit was asked. Run the fit again.", fit.stage, code=FOLLOWED)
    size = len(problem.experiments[0].network.nodes)
    if size > NODES_FOLLOWED:
        text = f"the model of error follows at most {NODES_FOLLOWED} nodes, not {size}: its cost grows with the cube of its elements."
        raise IdentificationError(text, fit.stage, code=FOLLOWED)
    if any(identity_of(e.model) != identity_of(fit.model) for e in problem.experiments):
        text = "several levels were fitted together, and the model of error follows one. Ask the stage of one level."
        raise IdentificationError(text, fit.stage, code=FOLLOWED)
    if fit.model.runner is not None:
        raise IdentificationError("the elements of an FMU are not known, so nothing is known of how they depart.", fit.stage, code=FOLLOWED)
    return problem


@dataclass(frozen=True, eq=False)
class StraightRun:
    """One run of a scenario, as a straight line in everything unknown; a last row is where it settles, if it does.

    Parameters
    ----------
    kelvin : dict           Node -> temperature (rows,) where the derivatives were taken. [K]
    rows : dict             Node -> what a unit of each value and column does (rows, values + columns). [K]
    own : dict              Node -> the same of what this run has for itself (rows, own columns). [K]
    beside : dict           Node -> the same of sources that the fit does not know (rows, sources). [K]
    columns : tuple         What this run has for itself.
    beyond : dict           Conductor -> its class, and what of its variance lies further off than its features reach. [-]
    stated : frozenset      Boundaries.
    """

    kelvin: Mapping[str, Array]
    rows: Mapping[str, Array]
    own: Mapping[str, Array]
    beside: Mapping[str, Array]
    columns: tuple[UnknownColumn, ...]
    beyond: Mapping[str, tuple[str, float]]
    stated: frozenset[str]

    @classmethod
    def of(
        cls,
        fit: Calibration,
        way: FittedWay,
        scenario: Scenario,
        times: Array,
        nodes: Sequence[str],
        as_logged: bool,
        beside: Mapping[str, BesideRow],
    ) -> StraightRun:
        """Return the run of a scenario where the heat is carried in one way; arguments as in `ErrorModel.band`."""
        plain = network_for(fit.fitted_model, scenario)
        _refuse_unsaid_gas(fit, plain, beside)
        network, options = with_laws(plain, way.laws), Options()
        names = _acting(fit, way, network, scenario, as_logged)
        more = [n for n in beside if n not in names]
        bare = Wiring(network, scenario, (*names, *more))
        ready = Simulator(fit.model.title, bare, Engine(bare), times, options)
        at = {n: value for n, (value, _, _) in names.items()}
        x = ready.vector(ready.with_units(at)) if ready.free else None
        course = course_of(bare, ready.engine, x, options, _rest(ready, at))
        shared, alone = way.departures.shared(network, course, way.way, way.laws), way.departures.own(network, course)
        if not as_logged:  # what acts is stated
            alone = [(c, h) for c, h in alone if c.source not in (*network.boundaries, *scenario.loads)]
        heats = [h for _, h in (*shared, *alone)]
        loads = {f"scale.{n}": j for j, h in enumerate(heats) for n in h.loads}
        wide = Wiring(*with_heats(network, scenario, heats), (*names, *more, *loads))
        full = Simulator(fit.model.title, wide, Engine(wide), times, options)
        size = len(way.places)
        width = size + len(alone)
        chain = np.zeros((len(full.free), width + max((row.gain.size for row in beside.values()), default=0)))
        place = {name: k for k, name in enumerate(full.free)}
        for name, (_, k, slope) in names.items():
            chain[place[name], k] = slope
        for name, row in beside.items():
            chain[place[name], width:] += row.gain * (at.get(name, full.nominal[name]) if row.relative else 1.0)
        column = [*(way.places.get(c.name, -1) for c, _ in shared), *(size + j for j in range(len(alone)))]
        for name, j in loads.items():
            if column[j] >= 0:
                chain[place[name], column[j]] = 1.0
        told = _answers(full, at | dict.fromkeys(loads, 0.0), nodes, course.settled)
        moves = {n: m @ chain for n, (_, m) in told.items()}
        return cls(
            {n: t for n, (t, _) in told.items()},
            {n: m[:, :size] for n, m in moves.items()},
            {n: m[:, size:width] for n, m in moves.items()},
            {n: m[:, width:] for n, m in moves.items()},
            tuple(c for c, _ in alone),
            way.departures.beyond(network, course),
            frozenset(network.boundaries),
        )

    def members(self, way: FittedWay, node: str, kept: Indices) -> tuple[Array, dict[str, Array]]:
        """Return the means (members, rows) of a node [K], and source -> variance (members, rows) [K^2]."""
        rows, own = self.rows[node], self.own[node]
        parts = _parts(way, kept, rows, own, self.columns, self.beyond)
        parts[UNEXPLAINED] = np.repeat(way.left[kept, :1] ** 2, own.shape[0], axis=1) * (node not in self.stated)
        return self.kelvin[node] + way.members.mean[kept] @ rows.T, parts


def _rest(ready: Simulator, at: Mapping[str, float]) -> dict[str, float] | None:
    """Return where a run settles; None where nothing does. [K]"""
    try:
        return ready.settled(ready.with_units(at))[0]
    except SolverError:
        return None


def _answers(ready: Simulator, at: Mapping[str, float], nodes: Sequence[str], settles: bool) -> dict[str, tuple[Array, Array]]:
    """Return node -> its temperatures (rows,) and their derivatives (rows, free), a last row where it settles."""
    values = ready.with_units(at)
    run = ready.run(values, sensitivities=True)
    out = {}
    rest, moves = ready.settled(values) if settles else ({}, {})
    for n in dict.fromkeys(run[n].path for n in (nodes or run.nodes)):
        slopes = run.slopes(n) if ready.free else np.zeros((ready.times.size, 0))
        out[n] = (np.append(run[n].kelvin, rest[n]), np.vstack([slopes, moves[n]])) if settles else (run[n].kelvin, slopes)
    return out


def _parts(
    way: FittedWay, kept: Indices, rows: Array, own: Array, columns: Sequence[UnknownColumn], beyond: Mapping[str, tuple[str, float]]
) -> dict[str, Array]:
    """Return source -> variance (members, rows) by members of a way. [K^2]

    Parameters
    ----------
    rows : array (rows, unknowns)   What a unit of each unknown of the way does. [K]
    own : array (rows, columns)     The same of what the run has for itself.
    columns : sequence              Those.
    beyond : dict                   Conductor -> its class, and what of its variance lies further off than its features reach. [-]
    """
    root, sizes, values = way.members.root[kept], way.sizes[kept], len(way.values)
    whole = np.sum((rows @ root) ** 2, axis=2)
    # of the structure what is left once the values are known; of the values the rest
    structure = np.sum((rows[:, values:] @ _given(root, values)) ** 2, axis=2)
    alone = deviations(columns, sizes)
    for j, c in enumerate(columns):
        if c.group == "run" and c.source in beyond:
            kind, rest = beyond[c.source]
            alone[:, j] = np.sqrt(alone[:, j] ** 2 + rest * sizes[:, GROUPS.index(kind)] ** 2)
    parts = {VALUES: np.maximum(whole - structure, 0.0), STRUCTURE: structure}
    sources = [{"run": RUN, "room": ROOM, "unlogged": ROOM}.get(c.group, c.source) for c in columns]
    for source in dict.fromkeys((RUN, ROOM, *sources)):
        which = [j for j, s in enumerate(sources) if s == source]
        parts[source] = parts.get(source, 0.0) + alone[:, which] ** 2 @ (own[:, which] ** 2).T
    return parts


def _refuse_unsaid_gas(fit: Calibration, network: Network, told: Collection[str] = ()) -> None:
    """Refuse a scenario that changes the gas in a joint of which nobody says how much is gas."""
    kept = discrepancy_kept(fit.values)
    roots = network.flat.parameters.literal_behind
    joints = losing_gas(network, network.media, kept.separated if kept is not None else ())
    joints = [c for c in joints if roots(c.fields["contact_conductance"]) not in told]
    if joints:
        raise IdentificationError(
            f"'{joints[0].path}' was fitted in air, and the scenario changes its gas. No log shows how much of it is conduction through "
            "gas. Give the joint a gap in the deck, or fit a record at low pressure.",
            fit.stage,
            code="prediction.gas-of-joint-unsaid",
        )


def _given(root: Array, values: int) -> Array:
    """Return roots (members, columns, columns) of the covariance of columns where the values are known."""
    covariance = root @ np.swapaxes(root, 1, 2)
    a, b = covariance[:, :values, :values], covariance[:, :values, values:]
    left = covariance[:, values:, values:] - np.swapaxes(b, 1, 2) @ np.linalg.solve(a, b)
    sizes, vectors = np.linalg.eigh(0.5 * (left + np.swapaxes(left, 1, 2)))
    return np.asarray(vectors * np.sqrt(np.maximum(sizes, 0.0))[:, None, :])


def _acting(fit: Calibration, way: FittedWay, network: Network, scenario: Scenario, as_logged: bool) -> dict[str, tuple[float, int, float]]:
    """Return free name -> its value [SI], the value of the fit that it is, and its slope to the fitted form."""
    problem = fit.problem
    assert problem is not None
    out: dict[str, tuple[float, int, float]] = {}
    place = way.places
    for u in problem.unknowns:
        if u.kind == "parameter":
            at, k = way.values[u.name], place[u.name]
            out |= {n: (u.to_value(at), k, u.slope(at)) for n in (u.name, *u.also)}
        elif u.kind == "shared" and as_logged:
            at, k = way.values[u.name], place[u.name]
            factors = {t.name: t.factor for t in u.targets}
            loads = {f"scale.{load}" for load in scenario.loads}
            plain = Wiring(network, scenario)
            # of a room what is added to its temperature, of a power a factor on it
            starts = {n: plain.nominal(n, start=False) for n in factors if n in network.boundaries} | dict.fromkeys(loads & {*factors}, 0.0)
            out |= {n: (start + factors[n] * u.to_value(at), k, factors[n] * u.slope(at)) for n, start in starts.items()}
    return out
