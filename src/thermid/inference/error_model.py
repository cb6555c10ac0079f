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

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from thermid.base.arguments import takes_objects
from thermid.base.dual import value_of
from thermid.base.errors import IdentificationError
from thermid.base.linear_algebra import Array, Indices
from thermid.fit.calibration import Calibration
from thermid.fit.discrepancy import coefficient_path, constant_coefficients, discrepancy_kept, losing_gas
from thermid.fit.problem import Problem
from thermid.inference._error_model.elements import course_of, ways_of, with_heats, with_laws
from thermid.inference._error_model.gaussian import NormalMixture, weights_of
from thermid.inference._error_model.model import GROUPS, FittedWay, deviations, fitted_way, points_of
from thermid.inference._error_model.runs import UnknownColumn
from thermid.inference._error_model.sizes import COUNTED, FAR_SIZE, OUTSIDE, SIZES as SIZES
from thermid.simulation.network import Network
from thermid.simulation.runs import Simulator, network_for, output_times
from thermid.simulation.scenarios import Scenario
from thermid.simulation.solver import Engine, Options, Wiring

FOLLOWED = "prediction.error-not-followed"
"""Code of what is said of a fit that the model of error cannot follow."""
VALUES, STRUCTURE, RUN, ROOM, UNEXPLAINED, AVERAGED = (
    "values",
    "structure at this distance",
    "this run",
    "room",
    "what no element explains",
    "sizes, and what carries the heat",
)
"""What a band comes from."""
NARROWS = {
    VALUES: "a run that determines the values better, or stated spreads",
    STRUCTURE: "a run at conditions nearer to those that are asked",
    RUN: "further runs: they tell how much elements differ from run to run",
    ROOM: "a room that is logged better, or held",
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
    """

    node: str
    times: Array
    mixture: NormalMixture
    parts: Mapping[str, Array]

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
        parts = {group: size / SIZES[group].value for group, size in self.sizes.items()}
        worst = max(parts, key=parts.__getitem__)
        if parts[worst] > FAR_SIZE:
            return (
                f"the readings ask for {parts[worst]:.2g} times the usual {SIZES[worst].effect} "
                f"({self.sizes[worst]:.2g} {SIZES[worst].unit} beside {SIZES[worst].value:g} {SIZES[worst].unit})"
            )
        return ""

    @property
    def unknowns(self) -> tuple[str, ...]:
        """Values of the fit that `covariance` has, in order."""
        return tuple(self.fit.fitted)

    @property
    def covariance(self) -> Array:
        """Covariance (values, values) of the values of the fit, in their fitted form."""
        count = len(self.unknowns)
        both = [(w.fitted + w.members.mean[:, :count], w.members.root[:, :count], s) for w, s in zip(self.ways, self.weights, strict=True)]
        mean = sum(s @ m for m, _, s in both)
        return np.asarray(sum(np.einsum("m,mij,mkj->ik", s, r, r) + np.einsum("m,mi,mj->ij", s, m - mean, m - mean) for m, r, s in both))

    def sample(self, count: int, seed: int = 0) -> Array:
        """Return draws (values, count) of the values of the fit, in their fitted form."""
        generator, size = np.random.default_rng(seed), len(self.unknowns)
        which = generator.choice(sum(len(s) for s in self.weights), count, p=np.concatenate(self.weights))
        means = np.concatenate([w.fitted + w.members.mean[:, :size] for w in self.ways])[which]
        out = np.empty((size, count))
        first = np.cumsum([0, *(len(s) for s in self.weights)])
        for k, member in enumerate(which):
            way = int(np.searchsorted(first, member, side="right")) - 1
            root = self.ways[way].members.root[member - first[way]][:size]
            out[:, k] = means[k] + root @ generator.standard_normal(root.shape[1])
        return out

    @takes_objects
    def band(
        self, scenario: Scenario, nodes: Sequence[str] = (), *, every: str | float | None = None, times: Any = None, as_logged: bool = False
    ) -> dict[str, ErrorBand]:
        """Return node -> what is known of its true temperature in a scenario.

        Parameters
        ----------
        scenario : Scenario
        nodes : sequence        Nodes; all by default.
        every, times            When, as in `simulate`.
        as_logged : bool        Whether rooms and powers of the scenario are what the instruments of the fit would read, constant errors
                                and all, and not what they are.

        Raises
        ------
        IdentificationError   When no departure of a usual size explains the readings (`contradiction`), or the scenario changes the gas
                              in a joint of which no log says how much is gas.
        """
        if self.contradiction:
            raise IdentificationError(
                f"{self.contradiction}, so nothing is predicted. A column, a unit, a power or a noise of the logs is wrong, or an element "
                "is missing. `thermid criticise` looks for it.",
                self.fit.stage,
                code="prediction.readings-unexplained",
            )
        wanted = output_times(scenario, every, times)
        heaviest = max(float(s.max()) for s in self.weights)
        shares, answers = [], []
        for way, share in zip(self.ways, self.weights, strict=True):
            kept = np.flatnonzero(share > COUNTED * heaviest)
            if kept.size:
                answers.append((way, kept, StraightRun.of(self.fit, way, scenario, wanted, nodes, as_logged)))
                shares.append(share[kept])
        weights = np.concatenate(shares) / float(np.concatenate(shares).sum())
        return {n: _band(n, wanted, weights, [a.members(w, n, kept) for w, kept, a in answers]) for n in answers[0][2].kelvin}


def _band(node: str, times: Array, weights: Array, several: Sequence[tuple[Array, dict[str, Array]]]) -> ErrorBand:
    """Return the band of a node by the members of several ways."""
    means = np.concatenate([m for m, _ in several])
    parts = {source: np.concatenate([p[source] for _, p in several]) for source in several[0][1]}
    mixture = NormalMixture(weights, means, np.sum(list(parts.values()), axis=0))
    told = {source: np.asarray(weights @ v) for source, v in parts.items()}
    return ErrorBand(node, times, mixture, told | {AVERAGED: np.asarray(weights @ (means - mixture.mean) ** 2)})


def _problem_of(fit: Calibration) -> Problem:
    """Return what a fit compared.

    Raises
    ------
    IdentificationError   When it is not there, or not what the model of error can follow.
    """
    problem = fit.problem
    if problem is None or not problem.unknowns:
        raise IdentificationError("this calibration does not hold what its fit was asked. Run the fit again.", fit.stage, code=FOLLOWED)
    if problem.clocked:
        raise IdentificationError("the model of error does not follow a second clock. Align the log first.", fit.stage, code=FOLLOWED)
    if fit.model.runner is not None:
        raise IdentificationError("the elements of an FMU are not known, so nothing is known of how they depart.", fit.stage, code=FOLLOWED)
    return problem


@dataclass(frozen=True, eq=False)
class StraightRun:
    """One run of a scenario, as a straight line in everything unknown.

    Parameters
    ----------
    kelvin : dict           Node -> temperature (times,) where the derivatives were taken. [K]
    rows : dict             Node -> what a unit of each value and column does (times, values + columns). [K]
    own : dict              Node -> the same of what this run has for itself (times, own columns). [K]
    columns : tuple         Those.
    beyond : dict           Conductor -> its class, and what of its variance lies further off than its features reach. [-]
    values : int            How many values there are.
    """

    kelvin: Mapping[str, Array]
    rows: Mapping[str, Array]
    own: Mapping[str, Array]
    columns: tuple[UnknownColumn, ...]
    beyond: Mapping[str, tuple[str, float]]
    values: int

    @classmethod
    def of(cls, fit: Calibration, way: FittedWay, scenario: Scenario, times: Array, nodes: Sequence[str], as_logged: bool) -> StraightRun:
        """Return the run of a scenario where the heat is carried in one way."""
        plain = network_for(fit.fitted_model, scenario)
        _refuse_unsaid_gas(fit, plain)
        network = with_laws(plain, way.laws)
        names = _acting(fit, way, network, scenario, as_logged)
        values = np.array([value for value, _, _ in names.values()])
        bare, options = Wiring(network, scenario, tuple(names)), Options()
        course = course_of(bare, Engine(bare), values, options)
        shared, alone = way.departures.shared(network, course, way.way, way.laws), way.departures.own(network, course)
        heats = [h for _, h in (*shared, *alone)]
        loads = {f"scale.{n}": j for j, h in enumerate(heats) for n in h.loads}
        wide = Wiring(*with_heats(network, scenario, heats), (*names, *loads))
        ready = Simulator(fit.model.title, wide, Engine(wide), times, options)
        at = dict(zip(names, values.tolist(), strict=True)) | dict.fromkeys(loads, 0.0)
        run = ready.run(ready.with_units(at), sensitivities=True)
        place = {c.name: len(way.fitted) + j for j, c in enumerate(way.columns)}
        size = len(way.fitted) + len(way.columns)
        chain = np.zeros((len(names) + len(loads), size + len(alone)))
        for row, (_, k, slope) in enumerate(names.values()):
            chain[row, k] = slope
        column = [*(place.get(c.name, -1) for c, _ in shared), *(size + j for j in range(len(alone)))]
        for row, j in enumerate(loads.values(), len(names)):
            if column[j] >= 0:
                chain[row, column[j]] = 1.0
        wanted = list(dict.fromkeys(run[n].path for n in (nodes or run.nodes)))
        moves = {n: run.slopes(n) @ chain for n in wanted}
        beyond = way.departures.beyond(network, course)
        own = tuple(c for c, _ in alone)
        return cls(
            {n: run[n].kelvin for n in wanted},
            {n: m[:, :size] for n, m in moves.items()},
            {n: m[:, size:] for n, m in moves.items()},
            own,
            beyond,
            len(way.fitted),
        )

    def members(self, way: FittedWay, node: str, kept: Indices) -> tuple[Array, dict[str, Array]]:
        """Return the means (members, times) of a node [K], and source -> variance (members, times) [K^2]."""
        rows, own, sizes = self.rows[node], self.own[node], way.sizes[kept]
        root = way.members.root[kept]
        means = self.kelvin[node] + way.members.mean[kept] @ rows.T
        whole = np.sum((rows @ root) ** 2, axis=2)
        # of the structure what is left once the values are known; of the values the rest
        structure = np.sum((rows[:, self.values :] @ _given(root, self.values)) ** 2, axis=2)
        alone = deviations(self.columns, sizes)
        for j, c in enumerate(self.columns):
            if c.group == "run" and c.source in self.beyond:
                kind, rest = self.beyond[c.source]
                alone[:, j] = np.sqrt(alone[:, j] ** 2 + rest * sizes[:, GROUPS.index(kind)] ** 2)
        parts = {VALUES: np.maximum(whole - structure, 0.0), STRUCTURE: structure}
        for group, source in (("run", RUN), ("room", ROOM)):
            which = [j for j, c in enumerate(self.columns) if c.group == group]
            parts[source] = alone[:, which] ** 2 @ (own[:, which] ** 2).T
        parts[UNEXPLAINED] = np.repeat(way.left[kept][:, None] ** 2, own.shape[0], axis=1)
        return means, parts


def _refuse_unsaid_gas(fit: Calibration, network: Network) -> None:
    """Refuse a scenario that changes the gas in a joint of which no log says how much is gas."""
    kept = discrepancy_kept(fit.values)
    joints = losing_gas(network, network.media, kept.separated if kept is not None else ())
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
    for k, u in enumerate(problem.unknowns):
        at = float(way.fitted[k])
        if u.kind == "parameter":
            out |= {n: (u.to_value(at), k, u.slope(at)) for n in (u.name, *u.also)}
        elif u.kind == "shared" and as_logged:
            factors = {t.name: t.factor for t in u.targets}
            loads = {f"scale.{load}" for load in scenario.loads}
            plain = Wiring(network, scenario)
            # of a room what is added to its temperature, of a power a factor on it
            starts = {n: plain.nominal(n, start=False) for n in factors if n in network.boundaries} | dict.fromkeys(loads & {*factors}, 0.0)
            out |= {n: (start + factors[n] * u.to_value(at), k, factors[n] * u.slope(at)) for n, start in starts.items()}
    return out
