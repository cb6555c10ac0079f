"""Second clocks: offset and rate found by a grid and then by least squares, as unknowns of a fit or alone (`align`).

In: a `Problem` with a second clock in a record, or a model and two records. Out: the problem with its clocks at the best place of the
grid, or an `Alignment`. Powers that switch make many valleys, so that offset and rate are looked for on a grid first.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any

import numpy as np

from thermid.base.arguments import takes_objects
from thermid.base.errors import IdentificationError, RecordError, ScenarioError, SolverError
from thermid.base.linear_algebra import Array
from thermid.base.memo import Memo
from thermid.base.results import Shown
from thermid.fit._minimisation import Fit, covariances, minimise
from thermid.fit._problem.experiment import OFFSET, SCALE, Experiment, Ticks
from thermid.fit._problem.gather import build_problem
from thermid.fit._problem.request import LocalSpec, Request
from thermid.fit._problem.residuals import SHIFT, Compressed, Problem, SensorTrace, Unknown, as_triangle, clock_at, loss_of, starting_point
from thermid.fit._uncertainty.noise import CHANGES, Binned, autocorrelation_of_traces, trace_in_stretches
from thermid.measure.records import Record, clock_range
from thermid.model.elements import TableSignal
from thermid.model.tree import Model
from thermid.simulation.runs import Scenario

GRID_OFFSETS, GRID_RATES, GRID_ROUNDS = 25, 5, 5


def with_clocks(problem: Problem, loss: str, loss_scale: float, fitted: Array | None = None) -> Problem:
    """Return a problem whose second clocks start where a grid over their ranges fits best, all other unknowns as they are.

    Raises
    ------
    IdentificationError   When the model runs at no offset.
    """
    at = starting_point(problem.unknowns) if fitted is None else fitted.copy()
    for i, experiment in enumerate(problem.experiments):
        if experiment.ticks is None:
            continue
        costs = [(_cost(problem, i, there, loss, loss_scale), there) for there in _grid(problem, i, at, experiment.ticks)]
        if fitted is not None:
            costs.append((_cost(problem, i, at, loss, loss_scale), at))
        cost, at = min(costs, key=lambda pair: pair[0])
        if not np.isfinite(cost):
            raise IdentificationError(
                "the model fails at every offset of the second clock in the given range. Widen the range of offsets.",
                f"record '{experiment.record.name}'",
                code="fit.model-fails",
            )
    return at_clocks(problem, at)


def in_turns(
    problem: Problem, minimum: Fit, loss: str, loss_scale: float, progress: Callable[[int, float], None] | None
) -> tuple[Problem, Fit]:
    """Return the problem and the end of its fit after the grid was looked at again with the fitted values, as long as that gains."""
    for _ in range(GRID_ROUNDS):
        moved = with_clocks(problem, loss, loss_scale, minimum.fitted)
        at = minimum.fitted.copy()
        for i in range(len(problem.experiments)):
            for k, _name in moved.ticking(i):
                at[k] = moved.unknowns[k].start
        if np.array_equal(at, minimum.fitted):
            return problem, minimum
        again = minimise(moved, loss, loss_scale, at, progress)
        again = replace(again, evaluations=minimum.evaluations + again.evaluations, search=minimum.search, remarks=minimum.remarks)
        if again.cost >= minimum.cost:
            return problem, minimum
        problem, minimum = moved, again
    return problem, minimum


def at_clocks(problem: Problem, fitted: Array) -> Problem:
    """Return a problem whose experiments hold their second clocks where the unknowns put them."""
    experiments, unknowns = list(problem.experiments), list(problem.unknowns)
    for i, experiment in enumerate(problem.experiments):
        if experiment.ticks is not None:
            experiments[i] = experiment.ticks.moved(experiment, clock_at(problem, i, fitted))
            for k, _ in problem.ticking(i):
                unknowns[k] = replace(unknowns[k], start=float(fitted[k]))
    return replace(problem, experiments=tuple(experiments), unknowns=tuple(unknowns))


CHANGED = 3.5
"""Standard deviations of the difference of two samples of a power from which it changed, and was not only noise. [-]"""


MAX_ERROR_GROWTH = 1e3
"""Most times that an error grows: without a true change of the power nothing is known of its clock. [-]"""


def widened_by_noise_of_powers(problem: Problem, fitted: Array) -> Array:
    """Return how many times larger errors of the unknowns (unknowns,) are because noise of sampled powers adds to derivatives by clocks.

    A shift moves the noise of a meter with its power. The derivatives of readings by an offset then hold two parts, of true changes and of
    noise, J = J_0 + N, and J'J counts N'N as information. It is none: about the best offset the sum of squares curves by J_0'J_0 alone,
    because residuals answer to the same noise (errors in variables: Fuller, Measurement Error Models, 1987, 1.1). With the covariance of
    J'r as it is, errors grow by J'J / J_0'J_0, each beside what the other unknowns explain. J_0 is that of a power that stays at its mean
    between its true changes.
    """
    out = np.ones(len(problem.unknowns))
    for i, e in enumerate(problem.experiments):
        calm = _calm(e)
        ticking = [k for k, _ in problem.ticking(i)]
        if calm is None or not ticking:
            continue
        quiet = replace(problem, experiments=tuple(calm if j == i else other for j, other in enumerate(problem.experiments)))
        full, true = (p.slopes(i, fitted).reshape(-1, out.size) for p in (problem, quiet))
        others, _ = np.linalg.qr(full[:, [k for k in range(out.size) if k not in ticking]])
        for k in ticking:
            sizes = [float(np.sum((c - others @ (others.T @ c)) ** 2)) for c in (full[:, k], true[:, k])]
            out[k] = min(max(sizes[0] / max(sizes[1], 1e-300), 1.0), MAX_ERROR_GROWTH)
    return out


def _calm(experiment: Experiment) -> Experiment | None:
    """Return an experiment whose sampled powers on a second clock stay at their means between true changes; None where none has noise."""
    tables: dict[str, dict[str, Any]] = {}
    for name, path in experiment.ticks.driven if experiment.ticks is not None else ():
        table = getattr(experiment.scenario, name)[path]
        noise = experiment.noisy.get(SCALE + path)
        if noise is None or not noise.white > 0.0 or not isinstance(table, TableSignal):
            continue
        calm = table.levelled(CHANGED * math.sqrt(2.0) * noise.white)
        tables.setdefault(name, dict(getattr(experiment.scenario, name)))[path] = calm
    return replace(experiment, scenario=experiment.scenario.with_(**tables)) if tables else None


def clock_grid(offset: tuple[float, float], rate: tuple[float, float]) -> tuple[Array, Array]:
    """Return the offsets and the rates of the grid over their ranges: offsets with both ends, rates in the middles of equal parts."""
    rates = rate[0] + (rate[1] - rate[0]) * (np.arange(GRID_RATES) + 0.5) / GRID_RATES
    held = [offset[0] == offset[1], rate[0] == rate[1]]
    return np.linspace(*offset, 1 if held[0] else GRID_OFFSETS), rates[:1] if held[1] else rates


def _grid(problem: Problem, i: int, fitted: Array, ticks: Ticks) -> Iterator[Array]:
    """Yield values of all unknowns with offset and rate of one experiment's clock on a grid."""
    for offset, rate in product(*clock_grid(ticks.clock.offset, ticks.clock.rate)):
        point = fitted.copy()
        for k, name in problem.ticking(i):
            point[k] = offset if name == OFFSET else rate
        yield point


def _cost(problem: Problem, i: int, fitted: Array, loss: str, loss_scale: float) -> float:
    """Return the loss of one record's residuals; infinite where it cannot be run."""
    try:
        z = np.concatenate([b.weighted for b in problem.blocks_of(i, fitted)])
    except (ScenarioError, SolverError):
        return float("inf")
    return float(loss_of(z**2, loss, loss_scale)[0].sum())


MAX_CACHED_OFFSETS = 8
"""Offsets and rates whose residuals are kept."""


@dataclass(frozen=True, eq=False)
class Clocked:
    """Two logs as least squares over the clock of the second, then over what their instruments leave open.

    At each offset and rate the logs are joined anew, so that times are exact and both may hold compared temperatures.

    Parameters
    ----------
    model, first, second, scenario, local   As in `align`.
    ranges : tuple of (low, high)           Of offset [s] and rate [-]; equal values hold one.
    noise : dict                            Sensor -> standard deviation where a record states none. [K]
    unknowns : tuple                        What is looked for: the open ones of the clock, then constant errors and local values.
    memo : Memo                             Residuals at offsets and rates.
    """

    model: Model
    first: Record
    second: Record
    scenario: Scenario | None
    local: Mapping[str, Any]
    ranges: tuple[tuple[float, float], tuple[float, float]]
    noise: dict[str, float] = field(default_factory=dict)
    unknowns: tuple[Unknown, ...] = ()
    memo: Memo = field(init=False, default_factory=Memo, compare=False, repr=False)

    def opened(self, at: tuple[float, float]) -> Clocked:
        """Return the same with its unknowns, the clock starting at an offset [s] and rate."""
        texts = (("clock offset", "s"), ("clock rate", "1"))
        clock = [
            Unknown(name, "local", (), value, low=low, high=high, unit=unit)
            for (name, unit), value, (low, high) in zip(texts, at, self.ranges, strict=True)
            if low < high
        ]
        return replace(self, unknowns=(*clock, *self.problem(at).unknowns))

    @property
    def ticking(self) -> list[int]:
        """Which of offset (0) and rate (1) are looked for, in the order of the unknowns."""
        return [k for k, (low, high) in enumerate(self.ranges) if low < high]

    def clock(self, fitted: Array) -> tuple[float, float]:
        """Return offset [s] and rate."""
        at = [low for low, _ in self.ranges]
        for place, k in enumerate(self.ticking):
            at[k] = float(fitted[place])
        return at[0], at[1]

    def problem(self, at: tuple[float, float], late: tuple[str, int, float] | None = None) -> Problem:
        """Return the residuals at an offset and rate; `late` moves one change of a sampled power: path, place in its table, by so much [s].

        Raises
        ------
        RecordError   When the logs do not overlap there.
        """

        def make() -> Problem:
            """Return the fit of both records joined at an offset and rate of the second clock."""
            record = self.first.joined(self.second, *at)
            specs = {k: LocalSpec.read(v, f"local.{k}") for k, v in self.local.items()}
            request = Request(self.model, (_as_prompt(record),), (), {"*": self.scenario} if self.scenario else {}, specs, fit_start=False)
            plain = build_problem(request)
            return replace(plain, noise=plain.noise | self.noise, experiments=(self._switched(plain, late),))

        return self.memo.value((*at, late), make, MAX_CACHED_OFFSETS)

    def _switched(self, problem: Problem, late: tuple[str, int, float] | None) -> Any:
        """Return the experiment with every change of a sampled power in the middle of the interval in which it happened."""
        experiment = problem.experiments[0]
        tables = {name: dict(getattr(experiment.scenario, name)) for name in ("loads", "commands")}
        for name, path, table in self._sampled(problem):
            moved = table.changed_within()
            tables[name][path] = moved.delayed(late[1], late[2]) if late is not None and path == late[0] else moved
        return replace(experiment, scenario=experiment.scenario.with_(**tables))

    def _sampled(self, problem: Problem) -> Iterator[tuple[str, str, TableSignal]]:
        """Yield table of the scenario, path and signal of every power and command that was sampled, not logged when it changed."""
        experiment = problem.experiments[0]
        canonical = experiment.network.flat.names.model.canonical
        for channel in (*self.first.channels.values(), *self.second.channels.values()):
            if channel.held and not channel.prompt:
                path = canonical(channel.target or channel.name)
                for name in ("loads", "commands"):
                    signal = getattr(experiment.scenario, name).get(path)
                    if isinstance(signal, TableSignal) and signal.held:
                        yield name, path, signal

    def changes(self, at: tuple[float, float]) -> list[tuple[float, Array]]:
        """Return, of the largest changes of sampled powers, the interval of each [s] and what its delay does to the residuals.

        The latter are derivatives of the weighted residuals (samples,). [1/s]
        """
        bare = replace(self, first=_as_prompt(self.first), second=_as_prompt(self.second)).problem(at)
        changes_of_power = []
        for _, path, table in self._sampled(bare):
            changes_of_power += [
                (abs(float(table.values[k] - table.values[k - 1])), path, k, float(table.times[k] - table.times[k - 1]))
                for k in (1 + np.flatnonzero(np.diff(table.values))).tolist()
            ]
        out = []
        for _, path, k, width in sorted(changes_of_power, reverse=True)[:CHANGES]:
            sides = [self.weighted(self.problem(at, (path, k, side * width)), starting_point(bare.unknowns)) for side in (-0.25, 0.25)]
            out.append((width, (sides[1] - sides[0]) / (0.5 * width)))
        return out

    @staticmethod
    def weighted(problem: Problem, rest: Array) -> Array:
        """Return measured less predicted in units of the noise (samples,), sensor by sensor."""
        return np.concatenate([b.weighted for b in problem.blocks(rest)])

    def blocks(self, fitted: Array) -> list[SensorTrace]:
        """Return measured and predicted readings of every sensor."""
        return self.problem(self.clock(fitted)).blocks(fitted[len(self.ticking) :])

    def slopes(self, fitted: Array) -> Array:
        """Return d weighted residuals / d unknowns (samples, unknowns); those of the clock by differences on either side.

        A switched power has no derivative with respect to its instant that a run could carry. A difference over less than a part of
        the second log's interval would drown in the integrator's own error.
        """
        at, size = self.clock(fitted), len(self.ticking)
        rest = fitted[size:]
        columns = []
        for k in self.ticking:
            step = SHIFT * self.second.step * (1.0 if k == 0 else 1.0 / max(float(np.abs(self.second.times).max()), self.second.step))
            # within the range where an end of it is near
            low, high = max(at[k] - step, self.ranges[k][0]), min(at[k] + step, self.ranges[k][1])
            sides = [self.weighted(self.problem((v, at[1]) if k == 0 else (at[0], v)), rest) for v in (low, high)]
            columns.append((sides[1] - sides[0]) / (high - low))
        joined_problem = self.problem(at)
        return np.column_stack([*columns, joined_problem.jacobian(rest)] if rest.size else columns)

    @property
    def samples(self) -> int:
        """How many readings there are."""
        return self.problem(self.clock(np.array([u.start for u in self.unknowns]))).samples

    def compressed(self, fitted: Array, loss: str = "linear", loss_scale: float = 1.0, meshes: Sequence[Array] = ()) -> Compressed:
        """Return the weighted residuals with their derivatives, made into a triangle.

        Raises
        ------
        SolverError   When the model cannot be run, or the logs do not overlap.
        """
        try:
            blocks, full = self.blocks(fitted), self.slopes(fitted)
        except RecordError as error:
            raise SolverError(error.message, error.where) from None
        rows, slopes, square, sums = as_triangle(blocks, full, loss, loss_scale)
        return Compressed(rows, slopes, square, tuple(sums), ())

    def prior_rows(self, fitted: Array) -> tuple[Array, Array]:
        """Return the residuals of the priors and their derivatives."""
        size = len(self.ticking)
        values, slopes = self.problem(self.clock(fitted)).prior_rows(fitted[size:])
        return values, np.column_stack([np.zeros((values.size, size)), slopes])

    def square(self, compressed: Compressed) -> float:
        """Return the sum of the squares of the residuals in units of the noise."""
        return compressed.chi_square

    def pieces(self, fitted: Array) -> dict[tuple[str, str], Binned]:
        """Return (record, sensor) -> its residuals in stretches of time, as `autocorrelation` looks at them."""
        slopes, at, out = self.slopes(fitted), 0, {}
        observations = self.problem(self.clock(fitted)).experiments[0].observations
        for block, o in zip(self.blocks(fitted), observations, strict=True):
            slopes_of_block = slopes[at : at + block.times.size]
            at += block.times.size
            out[block.record, o.sensor] = trace_in_stretches(block.weighted, block.times, slopes_of_block, o.effective_share)
        return out


def _as_prompt(record: Record) -> Record:
    """Return a record whose changes stand where they were logged."""
    return record.with_channels(*(replace(c, prompt=True) for c in record.channels.values()))


DESCENT_STARTS = 4
"""How many of the best points of the grid a descent starts from."""
ROUGH = 0.1
"""Part of a standard error that separates the ends of these descents; the best goes on."""


@dataclass(frozen=True, eq=False)
class Alignment(Shown):
    """How a second clock runs beside the first one: a time t on it is ``offset + rate t``.

    Parameters
    ----------
    offset, rate : float            [s, -]
    offset_error, rate_error : float    Standard errors, at the model's values and its start. [s, -]
    record : Record                 Both logs on the first clock.
    rmse : dict                     Sensor -> RMS of measured less predicted. [K]
    largest : dict                  Sensor -> (largest of it by size [K], when [s]).
    at_end : tuple of str           Which of both lie at an end of their range, and might lie beyond it: 'offset', 'rate'.
    """

    offset: float
    rate: float
    offset_error: float
    rate_error: float
    record: Record
    rmse: Mapping[str, float]
    largest: Mapping[str, tuple[float, float]]
    at_end: tuple[str, ...] = ()

    def __str__(self) -> str:
        """Return offset and rate with their errors."""
        residuals_text = ", ".join(
            f"{s} RMSE {v:.3g} K, largest {w:+.3g} K at {t:.0f} s" for s, v in self.rmse.items() for w, t in (self.largest[s],)
        )
        end = {name: ", the end of its range" for name in self.at_end}
        return (
            f"{self.record.name}: offset {self.offset:.2f} +- {self.offset_error:.2g} s{end.get('offset', '')}, "
            f"rate {self.rate:.4f} +- {self.rate_error:.2g}{end.get('rate', '')}; left: {residuals_text}"
        )


@takes_objects
def align(
    model: Model,
    first: Record,
    second: Record,
    *,
    offset: tuple[float, float],
    rate: tuple[float, float] = (1.0, 1.0),
    scenario: Scenario | None = None,
    local: Mapping[str, Any] | None = None,
) -> Alignment:
    """Return offset and rate of a second record's clock at which a model follows both logs best.

    Values and start of the model stay as they are, as if they were exact; fitting them and aligning take turns. Constant errors of
    instruments within their stated accuracy are looked for beside the clock. Powers that switch make many valleys: a grid is looked at
    first, and a descent started from its best places. A power or command is held from sample to sample; one that was sampled, not logged
    when it changed (`Channel.prompt`), changed somewhere in the interval before, is taken to have changed in its middle, and the
    error counts the interval over the root of 12 for each change, beside noise and residuals that wander.

    Parameters
    ----------
    model : Model           What the hardware is.
    first, second : Record  Temperatures on one clock; powers or commands on the other.
    offset : (low, high)    Where the offset is looked for: numbers in s or texts.
    rate : (low, high)      Where the rate is looked for; equal values hold it. [-]
    scenario, local         As in `calibrate`.

    Raises
    ------
    RecordError             When a range has not two ends, or the first is the higher.
    IdentificationError     When no offset lets the model run over both logs, or they do not tell it within its range.
    """
    ranges = (clock_range(offset, "s", "offset of its clock", second.name), clock_range(rate, "1", "rate of its clock", second.name))
    starts, noise = _nearest(Clocked(model, first, second, scenario, dict(local or {}), ranges))
    if not starts[0].ticking:
        return _at(starts[0], starting_point(starts[0].unknowns), (0.0, 0.0))
    ends = [(sides, minimise(sides, done=ROUGH)) for sides in (replace(start, noise=noise) for start in starts)]
    sides, minimum = min(ends, key=lambda end: end[1].cost)
    # the noise of sensors that state none is that of what is left at the end
    sides = replace(sides, noise={s: _rms([b for b in sides.blocks(minimum.fitted) if b.sensor == s]) for s in noise})
    minimum = minimise(sides, start=minimum.fitted)
    errors = [0.0, 0.0]
    for place, k in enumerate(sides.ticking):
        errors[k] = float(_errors(sides, minimum)[place])
    for k in sides.ticking:
        _refuse_undetermined(sides, k, errors[k])
    return _at(sides, minimum.fitted, (errors[0], errors[1]))


def _nearest(sides: Clocked) -> tuple[list[Clocked], dict[str, float]]:
    """Return the best places of a grid, none beside a better one, and the noise of sensors that state none at the best of them. [K]

    Raises
    ------
    IdentificationError   When the model runs at none.
    """
    offsets, rates = clock_grid(*sides.ranges)
    tried: list[tuple[float, tuple[int, int], Clocked, dict[str, float]]] = []
    for (i, offset), (j, rate) in product(enumerate(offsets), enumerate(rates)):
        try:
            here = sides.opened((float(offset), float(rate)))
            cost, noise = _cost_of_joined(here)
        except (RecordError, ScenarioError, SolverError):
            continue
        tried.append((cost, (i, j), here, noise))
    if not tried:
        raise IdentificationError(
            "the model fails at every offset in the given range. Widen the range of offsets.",
            f"{sides.first.name}, {sides.second.name}",
            code="fit.model-fails",
        )
    tried.sort(key=lambda place: place[0])
    taken: dict[tuple[int, int], Clocked] = {}
    for _, (i, j), here, _ in tried:
        if len(taken) < DESCENT_STARTS and not any(abs(i - k) <= 1 and abs(j - n) <= 1 for k, n in taken):
            taken[i, j] = here
    return list(taken.values()), tried[0][3]


def _cost_of_joined(sides: Clocked) -> tuple[float, dict[str, float]]:
    """Return the least sum of squares at the start of a clock, and what is left of each sensor that states no noise. [K]"""
    at = starting_point(sides.unknowns)
    rest = at[len(sides.ticking) :]
    problem = sides.problem(sides.clock(at))
    residuals = sides.weighted(problem, rest)
    size = residuals.size
    if rest.size:
        priors, slopes = problem.prior_rows(rest)
        whole, rows = np.concatenate([residuals, priors]), np.concatenate([problem.jacobian(rest), slopes])
        whole = whole - rows @ np.linalg.lstsq(rows, whole, rcond=None)[0]
        residuals = whole[:size]
        cost = float(whole @ whole)
    else:
        cost = float(residuals @ residuals)
    noise, begin = {}, 0
    for o in problem.observations():
        part = residuals[begin : begin + o.index.size] * o.sigma(problem.noise)
        begin += part.size
        if o.noise is None:
            noise[o.sensor] = max(math.sqrt(float(np.mean(part**2))), 1e-6)
    return cost, noise


def _errors(sides: Clocked, minimum: Fit) -> Array:
    """Return the standard errors of the unknowns, all infinite where some unknown has no effect on the residuals.

    They count noise and autocorrelated residuals, constant errors of sensors, and the instants at which sampled powers changed: each is
    uniform over its sampling interval w, with variance ``w^2 / 12``.
    """
    if not minimum.jacobian.any(axis=0).all():
        return np.full(minimum.fitted.size, np.inf)  # nothing answers to one of them
    spread = autocorrelation_of_traces(sides.pieces(minimum.fitted), minimum, sides.problem(sides.clock(minimum.fitted)).effective_samples)
    total, _, weights = covariances(minimum, spread.variance_factor, spread.score_excess)
    changes = sides.changes(sides.clock(minimum.fitted))
    if changes and np.isfinite(weights).all():
        slopes = sides.slopes(minimum.fitted)
        for width, delayed in changes:
            moved = weights @ (slopes.T @ delayed) / spread.variance_factor
            total = total + width**2 / 12.0 * np.outer(moved, moved)
    return np.sqrt(np.diag(total))


def _refuse_undetermined(sides: Clocked, k: int, error: float) -> None:
    """Refuse an offset or rate that the logs do not tell within its range."""
    (low, high), name, unit = sides.ranges[k], ("offset", "rate")[k], (" s", "")[k]
    if not error < high - low:
        raise IdentificationError(
            f"the logs do not determine the {name}: its error is wider than its range of {high - low:.3g}{unit}. Log temperatures "
            "while a power changes, at least twice for the rate; or fix the rate if it is known.",
            f"{sides.first.name}, {sides.second.name}",
            code="fit.not-determined",
        )


def _at(sides: Clocked, fitted: Array, errors: tuple[float, float]) -> Alignment:
    """Return the alignment at some values of the unknowns."""
    blocks, at = sides.blocks(fitted), sides.clock(fitted)
    largest = {}
    for b in blocks:
        k = int(np.argmax(np.abs(b.residuals)))
        largest[b.sensor] = (float(b.residuals[k]), float(b.times[k]))
    ends = tuple(
        ("offset", "rate")[k]
        for k in sides.ticking
        if min(at[k] - sides.ranges[k][0], sides.ranges[k][1] - at[k]) < 1e-6 * (sides.ranges[k][1] - sides.ranges[k][0])
    )
    return Alignment(*at, *errors, sides.first.joined(sides.second, *at), {b.sensor: _rms([b]) for b in blocks}, largest, ends)


def _rms(blocks: Sequence[SensorTrace]) -> float:
    """Return the RMS of measured less predicted. [K]"""
    return max(math.sqrt(float(np.mean(np.concatenate([b.residuals for b in blocks]) ** 2))), 1e-6)
