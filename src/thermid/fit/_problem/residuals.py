"""What a fit looks for and what it compares: unknowns, and weighted residuals of all records with exact derivatives from the kernel."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from typing import TypeAlias, overload

import numpy as np
from numpy.typing import NDArray

from thermid.base.errors import DeckError, SolverError
from thermid.base.units import Array, Dual, Memo, Number, gradient_of, values_of
from thermid.fit._problem.experiment import CLOCK, OFFSET, SCALE, STEPPED, SWITCH, Experiment, Observation, clock_target
from thermid.simulation.runs import Engine, Options, Squares, Traces, Weighing, Wiring, kept_for


@dataclass(frozen=True)
class Prior:
    """A normal prior in the fitted form of an unknown (its logarithm where `log`)."""

    mean: float
    sd: float


@dataclass(frozen=True)
class Influence:
    """Where an unknown acts: the value of `name` in the wiring of an experiment is ``offset + factor * unknown``."""

    experiment: int
    name: str
    offset: float = 0.0
    factor: float = 1.0


@dataclass(frozen=True)
class Unknown:
    """One number that a fit looks for.

    Parameters
    ----------
    name : str              As reported: a parameter's path, ``record: room``, ``sensor T1``.
    kind : str              'parameter', 'local', 'sensor' or 'input', errors of readings that are compared or drive the
                            model, reading minus truth, of a power as a share of it; 'elsewhere' of another level of a joint fit.
    targets : tuple         Where it acts.
    start : float           [SI]
    log : bool              Whether it is fitted by its logarithm.
    low, high : float       Bounds. [SI]
    prior : Prior or None   In the fitted form.
    unit : str              For reports.
    also : tuple of str     Paths of other instances that share the value.
    """

    name: str
    kind: str
    targets: tuple[Influence, ...]
    start: float
    log: bool = False
    low: float = -math.inf
    high: float = math.inf
    prior: Prior | None = None
    unit: str = "1"
    also: tuple[str, ...] = ()

    def to_fitted(self, value: float) -> float:
        """Return the fitted form of a value.

        Raises
        ------
        DeckError   When its logarithm is fitted, and it is not above zero.
        """
        if self.log and not value > 0.0:
            raise DeckError(f"the value must be above zero, not {value:g}: its logarithm is fitted.", self.name, code="value.outside-range")
        return math.log(value) if self.log else value

    def to_value(self, fitted: float) -> float:
        """Return the value of a fitted form; at a bound the bound itself, from which exp(log(x)) differs in its last digits. [SI]"""
        if not self.log:
            return fitted
        value = math.exp(min(max(fitted, -700.0), 700.0))
        return next((b for b in (self.low, self.high) if math.isclose(value, b, rel_tol=1e-12)), value)

    def slope(self, fitted: float) -> float:
        """Return d value / d fitted."""
        return self.to_value(fitted) if self.log else 1.0

    @property
    def is_instant(self) -> bool:
        """Whether it says when an input changed: it is looked for only for the sake of other values."""
        return any(t.name.startswith(SWITCH) for t in self.targets)

    @property
    def is_mean_of_power(self) -> bool:
        """Whether it is the relative error of the mean of a power in one record."""
        return self.kind == "local" and any(t.name.startswith(SCALE) for t in self.targets)

    @property
    def scale(self) -> float:
        """A typical change of the fitted form, for the optimiser's steps."""
        if self.log:
            return 1.0
        if self.prior is not None:
            return self.prior.sd
        width = self.high - self.low
        return width / 4 if math.isfinite(width) else abs(self.start) or 0.1

    def fitted_bounds(self) -> tuple[float, float]:
        """Return the bounds in the fitted form."""
        if not self.log:
            return self.low, self.high
        low = math.log(self.low) if self.low > 0 else -math.inf
        return low, math.log(self.high) if math.isfinite(self.high) else math.inf

    def bounds_met(self, fitted: float, error: float = 0.0) -> list[tuple[str, float]]:
        """Return which of its bounds, 'lower' or 'upper', a value with a standard error lies at, and where that is; in the fitted form."""
        ends = zip(("lower", "upper"), self.fitted_bounds(), strict=True)
        return [(side, b) for side, b in ends if math.isfinite(b) and abs(fitted - b) < max(1e-4 * max(abs(b), self.scale), 0.02 * error)]


def starting_point(unknowns: Sequence[Unknown]) -> Array:
    """Return the starts (unknowns,) in the fitted form."""
    return np.array([u.to_fitted(u.start) for u in unknowns])


HALF_WIDTH_99 = 2.576
"""Standard deviations of a normal variable in half of its middle 99 %, which neighbours of one white trace in a hundred exceed. [-]"""
WHITE = 0.9
"""Share of the samples that residuals must be worth as independent ones to count as white."""


def wanders(effective: float, samples: float) -> bool:
    """Whether residuals are worth so many fewer independent samples than there are that they are not white."""
    return effective < WHITE * samples


@dataclass(frozen=True)
class SensorStatistics:
    """How a model meets one sensor.

    Parameters
    ----------
    rmse, mean, largest : float     Of measured less predicted, the sensor's constant error taken off; largest by size. [K]
    samples : int
    bias : float                    The sensor's constant error as fitted or given. [K]
    lag_one : float                 Autocorrelation of neighbouring residuals. [-]
    effective_samples : float       Independent samples that would say as much; all of them where the residuals do not wander.
    """

    rmse: float
    mean: float
    largest: float
    samples: int
    bias: float
    lag_one: float
    effective_samples: float = 0.0

    @property
    def white(self) -> bool:
        """Whether residuals are uncorrelated: neighbours at the 99 % level (2.58 / sqrt n), and none that wander over longer times.

        With the effective samples of a fit, which counts what wanders by restricted likelihood, 2 to 3 of 100 white traces are called
        autocorrelated.
        """
        return bool(abs(self.lag_one) < HALF_WIDTH_99 / np.sqrt(self.samples)) and not self.wanders

    @property
    def wanders(self) -> bool:
        """Whether the residuals are worth fewer independent samples than there are."""
        return wanders(self.effective_samples, self.samples)

    def to_dict(self) -> dict[str, float]:
        """Return it as JSON holds it."""
        return {"rmse_K": self.rmse, "bias_K": self.bias, "mean_K": self.mean, "max_K": abs(self.largest), "n": self.samples}


@dataclass(frozen=True)
class Sums:
    """Sums over the residuals of one sensor, in the order of the kernel.

    Parameters
    ----------
    count, first, last : float      How many residuals, the first and the last of them. [K]
    total, squares, lagged : float  Sum, sum of squares, and of products of neighbours, of what each exceeds the first by; a mean far from
                                    zero then costs no digits. [K, K^2]
    largest : float                 By size, with its sign. [K]
    """

    count: float
    first: float
    last: float
    total: float
    squares: float
    lagged: float
    largest: float

    @classmethod
    def of_residuals(cls, residuals: Array) -> Sums:
        """Return the sums of residuals (samples,). [K]"""
        more = residuals - residuals[0]
        largest = float(residuals[np.abs(residuals).argmax()])
        sums = float(more.sum()), float(more @ more), float(more[1:] @ more[:-1])
        return cls(residuals.size, float(residuals[0]), float(residuals[-1]), *sums, largest)

    def _about(self, zero: float) -> tuple[float, float, float]:
        """Return the sums of r - zero, of its squares, and of products of neighbours, of the residuals r behind these sums. [noise]"""
        d, n = self.first - zero, self.count
        ends = self.last - self.first  # the first exceeds itself by nothing
        lagged = self.lagged + d * (2.0 * self.total - ends) + (n - 1) * d * d
        return self.total + n * d, self.squares + 2.0 * d * self.total + n * d * d, lagged

    def followed_by(self, other: Sums) -> Sums:
        """Return the sums of these residuals with others after them."""
        if not self.count or not other.count:
            return self if self.count else other
        total, squares, lagged = other._about(self.first)
        join = (self.last - self.first) * (other.first - self.first)
        largest = max(self.largest, other.largest, key=abs)
        sums = self.total + total, self.squares + squares, self.lagged + join + lagged
        return Sums(self.count + other.count, self.first, other.last, *sums, largest)

    @property
    def mean_square(self) -> float:
        """The mean of the squared residuals. [K^2]"""
        return max(self._about(0.0)[1], 0.0) / self.count

    def statistics(self, bias: float, effective: float | None = None) -> SensorStatistics:
        """Return what they say of a sensor with a constant error [K], worth `effective` samples; all of them where nothing is given."""
        mean = self.first + self.total / self.count
        _, power, lagged = self._about(mean)
        lag = lagged / power if self.count > 2 and power > 0 else 0.0
        count = int(self.count)
        worth = float(count) if effective is None else effective
        return SensorStatistics(float(np.sqrt(self.mean_square)), mean, self.largest, count, bias, lag, worth)


def pooled(parts: list[Sums]) -> Sums:
    """Return the sums over several stretches that follow one another."""
    return reduce(Sums.followed_by, parts)


def loss_of(squares: Array, loss: str, loss_scale: float) -> tuple[Array, Array]:
    """Return the loss c^2 rho(z) and its derivative rho'(z) by r^2 of squared residuals r^2 of any shape, z = r^2 / c^2. [-]

    Soft L1 rho = 2 (sqrt(1 + z) - 1), Huber z or, above 1, 2 sqrt(z) - 1, Cauchy ln(1 + z), else z: as of `scipy.optimize.least_squares`
    and in the kernel. r is in units of the noise and c is `loss_scale`.
    """
    # c^2 rho(z) and rho'(z), z = (r/c)^2: soft L1 rho = 2 (sqrt(1 + z) - 1), Huber z or 2 sqrt(z) - 1, Cauchy ln(1 + z)
    z = squares / loss_scale**2
    if loss == "soft_l1":
        return 2.0 * loss_scale**2 * (np.sqrt(1.0 + z) - 1.0), 1.0 / np.sqrt(1.0 + z)
    if loss == "huber":
        root = np.sqrt(np.maximum(z, 1.0))
        return loss_scale**2 * np.where(z > 1.0, 2.0 * root - 1.0, z), 1.0 / root
    if loss == "cauchy":
        return loss_scale**2 * np.log1p(z), 1.0 / (1.0 + z)
    return squares, np.ones_like(squares)


@dataclass(frozen=True, eq=False)
class SensorTrace:
    """One sensor of one record at some values of the unknowns.

    Parameters
    ----------
    record, sensor, node : str      Names.
    times : array (samples,)        [s]
    measured, predicted : array     Reading, and what the model with its sensor's constant error says. [K]
    noise : float                   The weight's standard deviation. [K]
    """

    record: str
    sensor: str
    node: str
    times: Array
    measured: Array
    predicted: Array
    noise: float

    @property
    def residuals(self) -> Array:
        """Measured less predicted (samples,). [K]"""
        return self.measured - self.predicted

    @property
    def weighted(self) -> Array:
        """Residuals in units of the noise (samples,). [-]"""
        return self.residuals / self.noise


@dataclass(frozen=True, eq=False)
class Compressed:
    """All residuals of the data at some values of the unknowns, in as few rows as hold the same information.

    Parameters
    ----------
    rows : array (rows,)                Residuals; half their sum of squares is the cost, the loss included. [-]
    slopes : array (rows, unknowns)     Their derivatives: ``slopes' slopes`` is J'J, ``slopes' rows`` J'r of all weighted residuals.
    chi_square : float                  Sum of squares, each weighed as a robust loss weighs it. [-]
    sums : tuple of (str, str, Sums)    Record, sensor, and the sums of its residuals.
    meshes : tuple of array             When the integrator's steps ended, per record. [s]
    """

    rows: Array
    slopes: Array
    chi_square: float
    sums: tuple[tuple[str, str, Sums], ...]
    meshes: tuple[Array, ...]


MAX_CACHED_BENCHES = 32
"""Benches of one experiment that are kept: a search for a second clock asks for many."""


ClockPlaces: TypeAlias = tuple[tuple[float, float], ...]
"""Offset [s] and rate of every unknown clock of an experiment."""


@dataclass(frozen=True, eq=False)
class Bench:
    """An experiment wired to the kernel, with the names that are free in it."""

    experiment: Experiment
    free: tuple[str, ...]
    wiring: Wiring
    engine: Engine
    memo: Memo = field(init=False, default_factory=Memo, compare=False, repr=False)

    @classmethod
    def of_experiment(cls, experiment: Experiment, free: Sequence[str], at: ClockPlaces = (), steps_at: ClockPlaces = ()) -> Bench:
        """Return the bench of an experiment, made once, with its clocks where `at` says, steps `steps_at`: `Ticks.at` of each."""

        def make() -> Bench:
            """Return the model wired for the free values, on the clocks of `at` where some are fitted."""
            moved = experiment.on_clocks(at, steps_at or at) if at else experiment
            wiring = Wiring(moved.network, moved.scenario, free, jumps=moved.jumps)
            return cls(moved, tuple(free), wiring, Engine(wiring))

        return experiment.memo.value((tuple(free), at, steps_at), make, MAX_CACHED_BENCHES)

    def temperatures(
        self, x: Array, gradients: bool, options: Options | None, times: Array | None = None, *, from_rest: bool = False
    ) -> tuple[Array, Array]:
        """Return observed temperatures (times, sensors) [K] and their derivatives (times, sensors, free), empty when not asked for.

        Without `options` it is the run of `simulate`, else the one that least squares take. `times` are the experiment's own where none
        are given [s]; `from_rest` holds the start while the free names change.
        """
        wanted = self.experiment.times if times is None else times
        assembled = self.engine.started(self.wiring.assemble(x, gradients), gradients)
        if from_rest:
            assembled = replace(assembled, initial_gradient=np.zeros_like(assembled.initial_gradient))
        nodes = tuple(o.node for o in self.experiment.observations)
        nodes_kept = kept_for(assembled, nodes)
        duration = max(self.experiment.scenario.seconds, float(self.experiment.times[-1]))
        # traces of a fit are stepped as its least squares are, so that its statistics agree
        stepped = Options() if options is None else replace(options, method="integrator")
        wanted, rows = self.read_at(wanted)
        answer = self.engine.integrate(assembled, wanted, nodes_kept, duration, stepped, gradients and bool(self.free))
        traces = Traces(self.wiring, assembled, wanted, nodes_kept, answer.temperatures, answer.sensitivities)
        columns = np.column_stack([traces.temperature(n) for n in nodes])
        derivatives = np.stack([traces.slope(n) for n in nodes], axis=1) if gradients else np.zeros((0, 0, 0))
        if rows.size:
            columns = np.take_along_axis(columns, rows, axis=0)
            derivatives = np.take_along_axis(derivatives, rows[:, :, None], axis=0) if gradients else derivatives
        for k, place, about in self.scales():
            if gradients:
                derivatives[:, k, :] *= 1.0 + x[place]
                derivatives[:, k, place] += columns[:, k] - about
            columns[:, k] += x[place] * (columns[:, k] - about)
        return columns, derivatives

    def read_at(self, times: Array) -> tuple[Array, NDArray[np.int64]]:
        """Return the instants at which sensors are read for some times of the record (instants,), and their rows (times, sensors).

        They differ where sensors are on clocks that a fit has yet to find; else no rows are returned, (0, 0). [s]
        """
        duration = max(self.experiment.scenario.seconds, float(self.experiment.times[-1]))
        read = {n: np.clip(ticks.read_at(times), 0.0, duration) for ticks in self.experiment.ticks for n in ticks.read}
        if not read:
            return times, np.zeros((0, 0), np.int64)
        instants = np.unique(np.concatenate([times, *read.values()]))
        return instants, np.column_stack([np.searchsorted(instants, read.get(o.sensor, times)) for o in self.experiment.observations])

    def scales(self) -> list[tuple[int, int, float]]:
        """Return, of every sensor whose scale is looked for, its column, the place of its error in the free names, where it turns [K]."""
        place = {name: n for n, name in enumerate(self.free)}
        numbered = enumerate(self.experiment.observations)
        return [(k, place[f"reading.{o.sensor}"], o.part.gain_about) for k, o in numbered if o.part and f"reading.{o.sensor}" in place]

    def squares(self, x: Array, gradients: bool, options: Options, weighing: Weighing, mesh: Array | None) -> Squares:
        """Run the model at the free names `x` and return the least squares of all its observations, with derivatives or without.

        Readings of sensors whose scale is looked for are multiplied by 1 + x; `weighing` and `mesh` are those of `Engine.least_squares`.
        """
        assembled = self.engine.started(self.wiring.assemble(x, gradients), gradients)
        obs, times = self.experiment.observations, self.experiment.times
        recover = dict(assembled.reduced.recover)
        parts = [_parts(o.node, recover) for o in obs]
        size = len(self.free) if gradients else 0
        scaled = [False] * len(obs)
        for k, place, _ in self.scales():
            one = Dual(1.0 + x[place], np.eye(size)[place]) if gradients else 1.0 + x[place]
            parts[k], scaled[k] = {node: one * weight for node, weight in parts[k].items()}, True
        readings = self.memo.value(
            "readings",
            lambda: self.engine.readings(times, [tuple(p) for p in parts], [o.index for o in obs], [o.measured for o in obs], scaled),
        )
        numbers = [number for p in parts for number in p.values()]
        weights = values_of(numbers), np.array([gradient_of(n, size) for n in numbers]).reshape(len(numbers), size)
        duration = max(self.experiment.scenario.seconds, float(times[-1]))
        return self.engine.least_squares(assembled, readings, weights, weighing, duration, options, gradients, mesh)


def _parts(node: str, recover: Mapping[str, Mapping[str, Number]]) -> dict[str, Number]:
    """Return what an observed node is the sum of: itself, or the neighbours of a node that was eliminated, with their weights."""
    if node not in recover:
        return {node: 1.0}
    out: dict[str, Number] = {}
    for neighbour, weight in recover[node].items():
        for name, share in _parts(neighbour, recover).items():
            out[name] = out[name] + weight * share if name in out else weight * share
    return out


def clock_at(problem: Problem, i: int, fitted: Array) -> ClockPlaces:
    """Return offset [s] and rate [-] of every unknown clock of experiment `i` at `fitted` (unknowns,), as `Ticks.at` holds them."""
    at = [[*ticks.at] for ticks in problem.experiments[i].ticks]
    for k, number, place in problem.ticking(i):
        at[number][place] = float(fitted[k])
    return tuple((offset, rate) for offset, rate in at)


def slopes_of_clock(problem: Problem, i: int, fitted: Array, times: Array | None = None) -> dict[int, Array]:
    """Return position of an unknown -> what offset or rate of a clock does to readings (times, sensors), but for steps of inputs.

    (T(x + h) - T(x - h)) / (2 h) at `fitted` x (unknowns,), in K per s of an offset, K per unit of a rate; none for a clock that nothing
    but steps are on.
    """
    out: dict[int, Array] = {}
    experiment, here = problem.experiments[i], clock_at(problem, i, fitted)
    for k, number, place in problem.ticking(i):
        ticks = experiment.ticks[number]
        stepped = bool(experiment.jumps[f"{CLOCK} {number} {place}"])
        smooth = [p for name, p in ticks.driven if name not in STEPPED or not getattr(experiment.scenario, name)[p].held]
        if stepped and not (ticks.read or smooth):
            continue
        step = ticks.shift if place == OFFSET else ticks.shift / max(ticks.span, ticks.clock.step)
        sides = []
        for side in (-step, step):
            there = fitted.copy()
            there[k] += side
            x, _ = problem.inputs(i, there)
            sides.append(problem.bench(i, there, steps_at=here if stepped else ()).temperatures(x, False, problem.options, times)[0])
        out[k] = (sides[1] - sides[0]) / (2.0 * step)
    return out


def compressed_in_full(
    problem: Problem, i: int, fitted: Array, loss: str, loss_scale: float
) -> tuple[Array, Array, float, list[tuple[str, str, Sums]]]:
    """Return what `Problem.compressed` takes of experiment `i`, from all its residuals at `fitted` (unknowns,): as `as_triangle`.

    `loss_scale` is in units of the noise. [-]
    """
    experiment = problem.experiments[i]
    blocks, slopes = problem.blocks_and_slopes(i, fitted)
    full = np.concatenate([slopes[o.index, k, :] for k, o in enumerate(experiment.observations)])
    return as_triangle(blocks, full, loss, loss_scale)


def refuse_not_finite(*numbers: Array | float) -> None:
    """Refuse residuals or derivatives that overflowed.

    Raises
    ------
    SolverError   When a number is not finite.
    """
    if not all(np.isfinite(each).all() for each in numbers):
        raise SolverError(DIVERGED, "fit", code="run.did-not-finish")


@np.errstate(over="ignore", invalid="ignore")  # what overflows is refused
def as_triangle(
    blocks: Sequence[SensorTrace], full: Array, loss: str, loss_scale: float
) -> tuple[Array, Array, float, list[tuple[str, str, Sums]]]:
    """Return rows, slopes, chi-square [-] and sums of weighted residuals, by a triangle of the derivatives `full` (samples, unknowns).

    With the weights w = rho' of the loss rho, sqrt(w) J = Q R: slopes are R with a row of zeros below, rows Q' sqrt(w) r with sqrt(sum rho
    - |Q' sqrt(w) r|^2) below, so that |rows|^2 is the summed loss and slopes' rows its gradient. Chi-square is sum w r^2. `loss` at
    `loss_scale` [-] as in `loss_of`; sums are of residuals in kelvin.

    Raises
    ------
    SolverError   When a number is not finite.
    """
    z = np.concatenate([b.weighted for b in blocks])
    refuse_not_finite(z @ z, full)
    size, weight = loss_of(z**2, loss, loss_scale)
    root = np.sqrt(weight)
    # sqrt(rho') r and sqrt(rho') J have the gradient J' rho' r; Q'r and R have the same normal equations; |r|^2 - |Q'r|^2 is kept
    basis, triangle = np.linalg.qr(root[:, None] * full)
    rotated = basis.T @ (root * z)
    rest = float(size.sum() - rotated @ rotated)
    rows = np.concatenate([rotated, np.sqrt(np.maximum([rest], 0.0))])
    sums = [(b.record, b.sensor, Sums.of_residuals(b.residuals)) for b in blocks]
    return rows, np.concatenate([triangle, np.zeros((1, triangle.shape[1]))]), float(weight @ z**2), sums


DIVERGED = (
    "the fit diverged: its residuals or derivatives are not finite. Give its parameters min and max, or priors. Check the log too: a "
    "column, a unit or a node may be wrong."
)
FAILED = 1e4
"""Residual that stands for a run that the integrator could not finish; the optimiser then turns back."""


@dataclass(frozen=True, eq=False)
class Problem:
    """All records of a fit, as weighted residuals over the unknowns.

    Parameters
    ----------
    experiments : tuple     The records, bound to the model.
    unknowns : tuple        What is looked for.
    noise : dict            Sensor -> standard deviation where a record states none. [K]
    options : Options       The integrator's.
    fixed_bias : dict       Sensor -> constant error that is not looked for. [K]
    coupled : tuple         (positions of unknowns, mean, inverse square root of the covariance) of joint priors, in the fitted form.
    memo : Memo             Its benches.
    """

    experiments: tuple[Experiment, ...]
    unknowns: tuple[Unknown, ...]
    noise: dict[str, float]
    options: Options
    fixed_bias: dict[str, float] = field(default_factory=dict)
    coupled: tuple[tuple[NDArray[np.int64], Array, Array], ...] = ()
    memo: Memo = field(init=False, default_factory=Memo, compare=False, repr=False)

    def benches(self) -> tuple[Bench, ...]:
        """Return one bench per experiment, made once."""
        return self.memo.value("benches", lambda: tuple(Bench.of_experiment(e, self._names(i)) for i, e in enumerate(self.experiments)))

    def bench(self, i: int, fitted: Array, more: Sequence[str] = (), steps_at: ClockPlaces = ()) -> Bench:
        """Return the bench of an experiment with its unknown clocks where the unknowns put them, and with `more` names free."""
        experiment = self.experiments[i]
        at = clock_at(self, i, fitted)
        still = at == tuple(ticks.at for ticks in experiment.ticks) and steps_at in ((), at)
        return Bench.of_experiment(experiment, (*self._names(i), *more), *(() if still else (at, steps_at)))

    def ticking(self, i: int) -> list[tuple[int, int, int]]:
        """Return, of unknowns of an experiment's clocks, position, number of the clock, and place in its `Ticks.at`."""
        targets = ((k, clock_target(t.name)) for k, u in enumerate(self.unknowns) for t in u.targets if t.experiment == i)
        return [(k, *of) for k, of in targets if of is not None]

    def _names(self, i: int) -> tuple[str, ...]:
        """Return the parameters that unknowns set in an experiment, each once."""
        return tuple(dict.fromkeys(target.name for _, target in self._acting(i)))

    def _acting(self, i: int) -> list[tuple[int, Influence]]:
        """Return position and target of every unknown that acts in an experiment; several may act on one name."""
        there = [(k, target) for k, u in enumerate(self.unknowns) for target in u.targets if target.experiment == i]
        return [(k, target) for k, target in there if clock_target(target.name) is None]

    def _bias(self, sensor: str, fitted: Array) -> tuple[float, int | None]:
        """Return the constant error of a sensor [K] at `fitted` (unknowns,), and its position among these; None where it is fixed."""
        for k, u in enumerate(self.unknowns):
            if u.kind == "sensor" and u.name == f"sensor {sensor}":
                return float(fitted[k]), k
        return self.fixed_bias.get(sensor, 0.0), None

    def inputs(self, i: int, fitted: Array) -> tuple[Array, Array]:
        """Return the values (names,) [SI] of an experiment's free names and their slopes (names, unknowns) by the fitted form.

        `i` is the position of the experiment. Each is the sum of offset + factor * value over the unknowns that act on it.
        """
        place = {name: n for n, name in enumerate(self._names(i))}
        values, slopes = np.zeros(len(place)), np.zeros((len(place), len(self.unknowns)))
        for k, t in self._acting(i):
            values[place[t.name]] += t.offset + t.factor * self.unknowns[k].to_value(float(fitted[k]))
            slopes[place[t.name], k] += t.factor * self.unknowns[k].slope(float(fitted[k]))
        return values, slopes

    def blocks(self, fitted: Array) -> list[SensorTrace]:
        """Return measured and predicted readings of every sensor of every record."""
        return [block for i in range(len(self.experiments)) for block in self.blocks_of(i, fitted)]

    def blocks_of(self, i: int, fitted: Array) -> list[SensorTrace]:
        """Return measured and predicted readings of every sensor of a record."""
        x, _ = self.inputs(i, fitted)
        return self._blocks(i, fitted, self.bench(i, fitted).temperatures(x, False, self.options)[0])

    def _blocks(self, i: int, fitted: Array, columns: Array) -> list[SensorTrace]:
        """Return the blocks of a record from the temperatures (times, sensors) of the sensors' nodes, constant errors added. [K]"""
        out, bench = [], self.bench(i, fitted)
        for k, o in enumerate(bench.experiment.observations):
            bias, _ = self._bias(o.sensor, fitted)
            predicted = columns[o.index, k] + bias
            times = bench.experiment.times[o.index]
            out.append(SensorTrace(bench.experiment.record.name, o.sensor, o.seat, times, o.measured, predicted, o.sigma(self.noise)))
        return out

    @np.errstate(over="ignore", invalid="ignore")  # what overflows is refused
    def compressed(self, fitted: Array, loss: str = "linear", loss_scale: float = 1.0, meshes: Sequence[Array] = ()) -> Compressed:
        """Return the weighted residuals r of all data with their derivatives J by `fitted` (unknowns,), from one run of each record.

        A record gives Q'r and R of J = Q R, a triangle with a row per free name and constant error, and one row sqrt(r'r - |Q'r|^2) for
        what no unknown can change: J'J, J'r and r'r are those of all readings. R comes by free names of the record [SI]; the chain rule
        turns it into the fitted form. With the `meshes` of another evaluation the steps are the same, and the difference of both is
        smooth. `loss_scale` is in units of the noise.

        Raises
        ------
        SolverError   When a record cannot be run, or a residual or derivative is not finite.
        """
        rows: list[Array] = []
        slopes: list[Array] = []
        sums: list[tuple[str, str, Sums]] = []
        taken: list[Array] = []
        chi = 0.0
        for i, bench in enumerate(self.benches()):
            if bench.experiment.ticks or bench.engine.runner is not None:
                rows_of_record, part, square, sizes = compressed_in_full(self, i, fitted, loss, loss_scale)
                rows, slopes, chi, sums = [*rows, rows_of_record], [*slopes, part], chi + square, [*sums, *sizes]
                taken.append(np.zeros(0))
                continue
            x, chain = self.inputs(i, fitted)
            obs = bench.experiment.observations
            bias, columns, shifts = self._shifts(bench, x, chain, fitted)
            sigma = np.array([o.sigma(self.noise) for o in obs])
            weighing = Weighing(sigma, bias, columns, loss, loss_scale)
            squares = bench.squares(x, bool(self.unknowns), self.options, weighing, meshes[i] if meshes else None)
            at = x.size
            part = squares.triangle[:, :at] @ chain + squares.triangle[:, at:] @ shifts
            rest = squares.cost - float(squares.rotated @ squares.rotated)
            rows += [squares.rotated, np.sqrt(np.maximum([rest], 0.0))]
            slopes += [part, np.zeros((1, part.shape[1]))]
            chi += squares.chi_square
            taken.append(squares.mesh)
            sums += [(bench.experiment.record.name, o.sensor, Sums(*line)) for o, line in zip(obs, squares.sums.tolist(), strict=True)]
        refuse_not_finite(chi, *rows, *slopes)
        return Compressed(np.concatenate(rows), np.concatenate(slopes), chi, tuple(sums), tuple(taken))

    def _shifts(self, bench: Bench, x: Array, chain: Array, fitted: Array) -> tuple[Array, NDArray[np.int32], Array]:
        """Return what is added to each sensor's temperatures [K], its column or -1, and the slopes (columns, unknowns) of the columns."""
        biases = [self._bias(o.sensor, fitted) for o in bench.experiment.observations]
        shift = np.array([b for b, _ in biases])
        slopes = np.zeros((len(biases), len(self.unknowns)))
        for k, (_, position) in enumerate(biases):
            if position is not None:
                slopes[k, position] = 1.0
        for k, place, about in bench.scales():
            shift[k] -= about * x[place]
            slopes[k] -= about * chain[place]
        used = np.flatnonzero(slopes.any(axis=1))
        columns = np.full(len(biases), -1, dtype=np.int32)
        columns[used] = np.arange(used.size)
        return shift, columns, slopes[used]

    def residuals(self, fitted: Array) -> Array:
        """Return the weighted residuals of all data in full. [-]"""
        try:
            return np.concatenate([b.weighted for b in self.blocks(fitted)])
        except SolverError:
            return np.full(self.samples, FAILED)

    @property
    def clocked(self) -> bool:
        """Whether a record has a clock that is known within a range only."""
        return any(e.ticks for e in self.experiments)

    @property
    def samples(self) -> int:
        """How many readings there are."""
        return sum(o.index.size for e in self.experiments for o in e.observations)

    @property
    def effective_samples(self) -> float:
        """How many independent readings the readings are worth, by what is stated of the noise of each."""
        return sum(o.effective_samples for e in self.experiments for o in e.observations)

    @property
    def freedom(self) -> float:
        """Independent samples less unknowns."""
        return self.effective_samples - len(self.unknowns)

    def square(self, compressed: Compressed) -> float:
        """Return the sum of the squares of the residuals in units of the noise, whatever the loss."""
        sigma = [o.sigma(self.noise) for o in self.observations()]
        return sum(s.count * s.mean_square / size**2 for (_, _, s), size in zip(compressed.sums, sigma, strict=True))

    def jacobian(self, fitted: Array) -> Array:
        """Return d residuals / d fitted (samples, unknowns) in full; what a fit needs of it is in `compressed`."""
        parts = []
        for i, experiment in enumerate(self.experiments):
            slopes = self.slopes(i, fitted)
            parts += [slopes[o.index, k, :] for k, o in enumerate(experiment.observations)]
        return np.concatenate(parts)

    def slopes(self, i: int, fitted: Array, times: Array | None = None) -> Array:
        """Return d weighted residuals / d fitted (times, sensors, unknowns) of an experiment, at its own times or at others [s]."""
        return self._slopes(i, fitted, times)[1]

    def blocks_and_slopes(self, i: int, fitted: Array) -> tuple[list[SensorTrace], Array]:
        """Return `blocks_of` and `slopes` of an experiment at its own times, from one run."""
        columns, slopes = self._slopes(i, fitted, None)
        return self._blocks(i, fitted, columns), slopes

    def _slopes(self, i: int, fitted: Array, times: Array | None) -> tuple[Array, Array]:
        """Return the temperatures (times, sensors) of the sensors' nodes [K], and the derivatives (times, sensors, unknowns) of residuals.

        Those are of (measured - predicted - bias) / noise by `fitted` (unknowns,), of record `i`: -dT/dx dx/dfitted, less 1 for the
        sensor's own bias, over the noise. At the times of the record where `times` [s] is None.
        """
        x, chain = self.inputs(i, fitted)
        clocks = [(k, f"{CLOCK} {number} {place}") for k, number, place in self.ticking(i)]
        bench, inner = self.bench(i, fitted, [name for _, name in clocks]), x.size
        x = np.append(x, np.zeros(len(clocks)))
        columns, derivatives = bench.temperatures(x, bool(x.size), self.options, times)
        out = _chain_product(derivatives[:, :, :inner], -chain) if inner else np.zeros((*columns.shape, len(self.unknowns)))
        for n, (k, _) in enumerate(clocks, inner):
            out[:, :, k] -= derivatives[:, :, n]
        for at, slope_of_clock in slopes_of_clock(self, i, fitted, times).items():
            out[:, :, at] -= slope_of_clock
        for k, o in enumerate(bench.experiment.observations):
            _, position = self._bias(o.sensor, fitted)
            if position is not None:
                out[:, k, position] -= 1.0
            out[:, k, :] /= o.sigma(self.noise)
        return columns, np.asarray(out)

    def prior_rows(self, fitted: Array) -> tuple[Array, Array]:
        """Return the residuals of the priors, in units of their errors [-], and their derivatives (residuals, unknowns)."""
        return prior_rows(self.unknowns, self.coupled, fitted)

    def observations(self) -> list[Observation]:
        """Return every observation of every experiment."""
        return [o for e in self.experiments for o in e.observations]


def _chain_product(derivatives: Array, chain: Array) -> Array:
    """Return the product D C (times, sensors, unknowns) of `derivatives` D (times, sensors, names) and `chain` C (names, unknowns).

    Most columns of C act on one name alone, which is faster than a product. [K per fitted form]
    """
    places, several = np.abs(chain).argmax(axis=0), np.count_nonzero(chain, axis=0) > 1
    out: Array = np.take(derivatives, places, axis=2)
    out *= chain[places, np.arange(places.size)]
    out[:, :, several] = derivatives @ chain[:, several]
    return out


def prior_rows(
    unknowns: Sequence[Unknown], coupled: Sequence[tuple[NDArray[np.int64], Array, Array]], fitted: Array
) -> tuple[Array, Array]:
    """Return the residuals (rows,) of priors and their derivatives (rows, unknowns). [-]

    (x - m) / s of each normal prior, R (x - m) of those known together.

    Parameters
    ----------
    coupled : sequence          Positions, means m and the root R of the information of what stages below found together.
    fitted : array (unknowns,)  Values x, in the fitted form.
    """
    values, slopes = [], []
    below = {int(k) for at, _, _ in coupled for k in at}
    for k, u in enumerate(unknowns):
        # what stages below found of an instrument holds its accuracy
        if u.prior is not None and (u.kind == "parameter" or k not in below):
            row = np.zeros(len(unknowns))
            row[k] = 1.0 / u.prior.sd
            values.append((float(fitted[k]) - u.prior.mean) / u.prior.sd)
            slopes.append(row)
    for at, mean, root in coupled:
        rows = np.zeros((root.shape[0], len(unknowns)))
        rows[:, at] = root
        values += list(root @ (fitted[at] - mean))
        slopes += list(rows)
    return np.array(values), np.array(slopes).reshape(len(values), len(unknowns))


class Predictions(Sequence[SensorTrace]):
    """Blocks that are predicted when they are first looked at; what a fit needs of them it has in its sums.

    Parameters
    ----------
    sums : sequence of (str, str, Sums)     Record, sensor, and the sums of its residuals.
    problem : Problem                       Predicts the blocks, in the same order.
    fitted : array (unknowns,)              Where.
    """

    def __init__(self, sums: Sequence[tuple[str, str, Sums]], problem: Problem, fitted: Array) -> None:
        """Keep what predicts the blocks."""
        self.sums, self.problem, self.fitted = tuple(sums), problem, fitted
        self.memo = Memo()

    def _blocks(self) -> tuple[SensorTrace, ...]:
        """Measured and predicted readings of every record and sensor, simulated when first asked for."""
        return self.memo.value("blocks", lambda: tuple(self.problem.blocks(self.fitted)))

    @overload
    def __getitem__(self, at: int) -> SensorTrace: ...
    @overload
    def __getitem__(self, at: slice) -> tuple[SensorTrace, ...]: ...
    def __getitem__(self, at: int | slice) -> SensorTrace | tuple[SensorTrace, ...]:
        """Return a block, or several."""
        return self._blocks()[at]

    def __iter__(self) -> Iterator[SensorTrace]:
        """Yield the blocks."""
        return iter(self._blocks())

    def __len__(self) -> int:
        """How many there are."""
        return len(self.sums)
