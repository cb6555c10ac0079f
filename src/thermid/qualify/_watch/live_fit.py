"""Where channels end, by the model fitted to the readings so far.

The values that a fault would change (conductances, coefficients, powers), capacitances, unknown starts and a constant error of every sensor
move as far as their prior spreads let them; the structure of the model is what is trusted. Gauss-Newton steps with the kernel's exact
derivatives give the best values and their covariance; the steady state with its own derivatives carries both to where channels end.
Readings count as the residuals show: their scatter, and how many independent ones they are worth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np

from thermid.base.linear_algebra import Array, covariance
from thermid.fit.calibration import Bench, Compressed, Experiment, Prior, Unknown, bind, minimise
from thermid.measure.records import Record
from thermid.measure.steadiness import MIN_INDEPENDENT_SHARE, StabilityRule, effective_samples
from thermid.model.tree import Model
from thermid.physics.constants import ICE_POINT
from thermid.qualify._steadiness.forecast import MIN_FORECAST_READINGS, EndForecast, IntervalEstimate
from thermid.qualify._watch.growing import MIN_NOISE
from thermid.qualify._watch.suspects import suspects_of
from thermid.simulation.runs import Scenario
from thermid.simulation.solver import Options, Traces, kept_for, settle

TRUST: Final = 0.3
"""Prior spread of conductances, coefficients and powers about the deck's, of their logarithm: readings decide where they say more."""
CAPACITANCE_SPREAD: Final = 0.1
"""The same of capacitances, which masses and tables give."""
SENSOR: Final = 0.2
"""Prior spread of a sensor's constant error where no accuracy is stated. [K]"""
CURVATURE_SHARE_OF_LAWS: Final = 0.03
"""Error of the change that is still to come, as a share of it, for laws that bend otherwise than the model's. [-]"""
MIN_READINGS_TO_FIT: Final = 8
"""Readings of every channel from which values are fitted; a forecast needs more."""
DONE_STEP: Final = 0.05
"""Part of a standard error below which a step ahead ends the fit."""
MAX_STRETCHES_AHEAD: Final = 30.0
"""Stretches ahead within which a rule may come to hold."""
AHEAD: Final = 400
"""Instants ahead at which a rule is asked."""


class Settled(NamedTuple):
    """A channel's end by the fitted model: where it is and ends [K], and when the rule holds, or None [s]."""

    latest: float
    final: IntervalEstimate
    holds: float | None


@dataclass(frozen=True, eq=False, kw_only=True)
class ModelForecast(EndForecast):
    """Where a channel ends by a model fitted to its readings; reads as a `Forecast` does."""

    def as_object(self) -> dict[str, Any]:
        """Return it as JSON holds it, with the keys of a `Forecast`; what a fit does not say is null."""
        return self._object(None, None, True)


class LiveFit:
    """A model fitted again and again to the readings of one test.

    Parameters
    ----------
    model : Model           Of the unit.
    scenario : Scenario     What the log does not say.
    """

    def __init__(self, model: Model, scenario: Scenario | None) -> None:
        self.model, self.scenario = model, scenario
        self.values: dict[str, float] = {}
        self.wander: dict[str, float] = {}
        self._last: tuple[float, tuple[str, ...], _Fit | None] | None = None

    def fit(self, record: Record, channels: Sequence[str]) -> None:
        """Fit the model to a record, where every channel has enough readings.

        Raises
        ------
        SolverError, RecordError   When the model cannot follow the record.
        """
        enough = all(np.count_nonzero(record.channel(n).valid) >= MIN_READINGS_TO_FIT for n in channels)
        new_fit = _Fit(bind(self.model, record, self._until(record), errors={}), record, self.values) if enough else None
        if new_fit is not None:
            new_fit.run()
            self.values = new_fit.deviations()
            self.wander = new_fit.wander
        self._last = (float(record.times[-1]), tuple(channels), new_fit)

    def _until(self, record: Record) -> Scenario | None:
        """Return the scenario with all that a plan changes later left as it is at the end of a record."""
        last = record.duration
        return None if self.scenario is None else self.scenario.mapped(lambda s: s.cut(0.0, last).held_on() if s.extent > last else s)

    def ends(self, record: Record, channels: Sequence[str], rule: StabilityRule, within: float, level: float) -> dict[str, ModelForecast]:
        """Return every channel -> where it ends; nothing while readings are few.

        Raises
        ------
        SolverError, RecordError   As in `fit`.
        """
        now = float(record.times[-1])
        if self._last is None or self._last[:2] != (now, tuple(channels)):
            self.fit(record, channels)
        last_fit = self._last[2] if self._last is not None else None
        if last_fit is None or any(np.count_nonzero(record.channel(n).valid) < MIN_FORECAST_READINGS for n in channels):
            return {}
        return {n: _forecast(n, record, end, rule, within, level) for n, end in last_fit.ends(rule, level).items() if n in channels}


def _forecast(name: str, record: Record, end: Settled, rule: StabilityRule, within: float, level: float) -> ModelForecast:
    final, why = end.final, ""
    if final.error > within:
        why = (
            f"The final temperature could be from {final.low - ICE_POINT:.1f} to {final.high - ICE_POINT:.1f} degC ({100 * level:g} %), "
            f"wider than the +- {within:.3g} K requested: the readings do not determine the model's values well enough yet. Wait longer."
        )
    return ModelForecast(
        channel=name,
        start=float(record.times[0]),
        now=float(record.times[-1]),
        latest=end.latest,
        final=final,
        declined=why,
        within=within,
        level=level,
        rule=rule,
        holds=end.holds,
    )


class _Fit:
    """One fit: the bench, its unknowns with their priors, and the readings with what they weigh; a `LeastSquares` of `minimise`."""

    def __init__(self, experiment: Experiment, record: Record, before: dict[str, float]) -> None:
        self.experiment, self.record = experiment, record
        self.names, self.base, spread, self.relative = unknowns_of(experiment)
        self.bench = Bench.of_experiment(experiment, self.names)
        self.sensors = experiment.observations
        priors = dict(zip(self.names, spread.tolist(), strict=True)) | {
            f"sensor {o.sensor}": _accuracy(record, o.sensor) for o in self.sensors
        }
        self.unknowns = tuple(Unknown(n, "local", (), 0.0, prior=Prior(0.0, sd)) for n, sd in priors.items())
        self.prior = np.array([*priors.values()])
        self.z = np.array([before.get(n, 0.0) for n in priors])
        self.sizes = np.array([o.sigma({o.sensor: MIN_NOISE}) for o in self.sensors])
        self.steps = [record.channel(o.sensor).step for o in self.sensors]
        self.samples = sum(o.index.size for o in self.sensors)
        self.worth = 0.0
        self.wander: dict[str, float] = {}
        self.inverse: Array = np.eye(self.z.size)

    def deviations(self) -> dict[str, float]:
        """Return the unknowns by name, as deviations from the model's. [-], [K]"""
        return dict(zip((u.name for u in self.unknowns), self.z.tolist(), strict=True))

    def _values(self, z: Array) -> tuple[Array, Array]:
        """Return the values of the free names and their derivatives by the unknowns."""
        moves = z[: len(self.names)]
        x = np.where(self.relative, self.base * np.exp(moves), self.base + moves)
        return x, np.where(self.relative, x, 1.0)

    def _residuals(self, z: Array) -> tuple[list[Array], list[Array]]:
        """Return residuals (samples,) of every sensor and derivatives of its predictions (samples, unknowns). [K]"""
        x, scale = self._values(z)
        read, slopes = self.bench.temperatures(x, True, Options())
        residuals, rows = [], []
        for k, o in enumerate(self.sensors):
            offset_columns = np.zeros((o.index.size, len(self.sensors)))
            offset_columns[:, k] = 1.0
            residuals.append(o.measured - read[o.index, k] - z[len(self.names) + k])
            rows.append(np.hstack([slopes[o.index, k] * scale, offset_columns]))
        return residuals, rows

    def compressed(self, fitted: Array, loss: str = "linear", loss_scale: float = 1.0, meshes: Sequence[Array] = ()) -> Compressed:
        """Return the weighted residuals with their derivatives, in as few rows as there are unknowns and one."""
        residuals, rows = self._residuals(fitted)
        whole = np.vstack([np.column_stack([-j, r]) / s for r, j, s in zip(residuals, rows, self.sizes, strict=True)])
        root: Array = np.asarray(np.linalg.qr(whole, mode="r"))
        return Compressed(root[:, -1], root[:, :-1], float(root[:, -1] @ root[:, -1]), (), ())

    def prior_rows(self, fitted: Array) -> tuple[Array, Array]:
        """Return the residuals of the priors and their derivatives."""
        return fitted / self.prior, np.diag(1.0 / self.prior)

    def square(self, compressed: Compressed) -> float:
        """Return the sum of the squares of the residuals in units of the noise."""
        return compressed.chi_square

    def run(self) -> None:
        """Fit; weigh the readings by what is left; fit again."""
        for _ in range(2):
            minimum = minimise(self, start=self.z, done=DONE_STEP)
            self.z = minimum.fitted
            self.inverse = covariance(np.concatenate([minimum.jacobian, minimum.priors]))
            residuals, rows = self._residuals(self.z)
            self._weigh(residuals, rows)
        self.inverse = np.linalg.inv(np.diag(1.0 / self.prior**2) + sum(j.T @ j / s**2 for j, s in zip(rows, self.sizes, strict=True)))

    def _weigh(self, residuals: Sequence[Array], rows: Sequence[Array]) -> None:
        """Set what one reading of every sensor weighs, from its residuals: scatter, step, and how much they wander."""
        self.worth, self.wander = 0.0, {}
        for k, (r, j) in enumerate(zip(residuals, rows, strict=True)):
            taken = float(np.sum((j @ self.inverse) * j)) / self.sizes[k] ** 2
            worth = effective_samples(r, max(round(taken), 1))
            free = max(r.size - taken * r.size / worth, 0.25 * r.size)
            scatter = float(np.sqrt(r @ r / free))
            self.sizes[k] = max(scatter, self.steps[k] / 12.0**0.5, 1e-4) * np.sqrt(r.size / worth)
            self.worth += worth
            if worth < MIN_INDEPENDENT_SHARE * r.size:
                self.wander[self.sensors[k].sensor] = max(self.sizes[k] / self.sensors[k].sigma({self.sensors[k].sensor: MIN_NOISE}), 1.0)

    def ends(self, rule: StabilityRule, level: float) -> dict[str, Settled]:
        """Return where every sensor ends with its interval, and when a rule holds there."""
        x, scale = self._values(self.z)
        count = len(self.names)
        engine = self.bench.engine
        a = engine.started(self.bench.wiring.assemble(x, True), True)
        last = float(self.experiment.times[-1])
        settled, slopes = settle(engine, a, last, True)
        traces = Traces(self.bench.wiring, a, np.array([last]), engine.nodes, settled[None, :], slopes[None])
        ahead, courses = self._ahead(x, last)
        out = {}
        for k, o in enumerate(self.sensors):
            bias = float(self.z[count + k])
            end = float(traces.temperature(o.node)[0]) + bias
            slope = np.zeros(self.z.size)
            slope[:count] = traces.slope(o.node)[0] * scale
            slope[count + k] = 1.0
            now = float(courses[0, k]) + bias
            variance = float(slope @ self.inverse @ slope) + (CURVATURE_SHARE_OF_LAWS * (end - now)) ** 2 + self.steps[k] ** 2 / 12.0
            half = _quantile(level, self.worth - count) * float(np.sqrt(variance))
            holds = _holds(ahead, courses[:, k], rule)
            at = None if holds is None else float(self.record.times[0]) + holds
            out[o.sensor] = Settled(now, IntervalEstimate(end, end - half, end + half), at)
        return out

    def _ahead(self, x: Array, last: float) -> tuple[Array, Array]:
        """Return instants from now on [s], and the sensors' nodes then (instants, sensors). [K]"""
        times = np.concatenate([[last], last + np.geomspace(last / AHEAD, MAX_STRETCHES_AHEAD * last, AHEAD)])
        engine, wiring = self.bench.engine, self.bench.wiring
        a = engine.started(wiring.assemble(x, False))
        nodes = tuple(o.node for o in self.sensors)
        nodes_kept = kept_for(a, nodes)
        answer = engine.integrate(a, times, nodes_kept, float(times[-1]), Options(), False)
        traces = Traces(wiring, a, times, nodes_kept, answer.temperatures, answer.sensitivities)
        return times, np.column_stack([traces.temperature(n) for n in nodes])


def unknowns_of(experiment: Experiment) -> tuple[tuple[str, ...], Array, Array, Array]:
    """Return names that are free, their values, prior spreads, and whether these are of the logarithm."""
    network = experiment.network
    values = network.numbers().values
    rows: dict[str, tuple[float, float, bool]] = {}

    def number(path: str) -> float:
        return float(getattr(values[path], "value", values[path]))

    for s in suspects_of(network):
        rows[s.path] = (1.0 if s.path.startswith("scale.") else number(s.path), TRUST, True)
    parameters = network.flat.parameters
    for node in network.flat.nodes:
        if "capacitance" in node.fields:
            path = parameters.literal_behind(node.fields["capacitance"])
            if number(path) > 0.0:
                rows.setdefault(path, (number(path), CAPACITANCE_SPREAD, True))
    rows = {n: r for n, r in rows.items() if r[0] > 0.0}
    first = experiment.scenario.initial
    for name in (*experiment.loose, *experiment.hidden):
        sd = experiment.hidden[name].sd if name in experiment.hidden else 10.0 * MIN_NOISE
        rows[f"initial.{name}"] = (float(first[name]), max(sd, MIN_NOISE), False)
    base, spread, relative = (np.array(column) for column in zip(*rows.values(), strict=True))
    return tuple(rows), base, spread, relative


def _accuracy(record: Record, sensor: str) -> float:
    """Return the prior spread of a sensor's constant error. [K]"""
    stated = record.channel(sensor).accuracy
    return SENSOR if stated is None else max(stated, 1e-3)


def _quantile(level: float, free: float) -> float:
    """Return the half-width of an interval in standard errors, of Student's distribution."""
    from scipy.special import stdtrit

    return float(stdtrit(max(free, 3.0), 0.5 + 0.5 * level))


def _holds(times: Array, course: Array, rule: StabilityRule) -> float | None:
    """Return from when on a course (instants,) moves no faster than a rule; None where that is not within it. [s]"""
    if rule.stored:
        return None
    fast = np.abs(np.diff(course)) > rule.rate * np.diff(times)
    if not fast.any():
        return float(times[0])
    last = int(np.flatnonzero(fast)[-1])
    return None if last + 2 >= times.size else float(times[last + 1]) + rule.window
