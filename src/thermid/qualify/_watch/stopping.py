"""When to stop a test: forecasts at set moments, each with a share of the risk, so that looking on does not add to it.

A decision is taken only when the time watched has doubled since the last one, after ten minutes when it has grown by a seventh, or when a
known power was switched, which begins another plateau; each of the first `DECISIONS` on a plateau takes the same part of its risk, and
later ones none: they forecast, and stop nothing (alpha spending: Lan and DeMets, Biometrika 70 (1983) 659; by the union bound for any
dependence between looks). Channels share each part alike. Within a decision the forecast is that of the model fitted to the readings
(`LiveFit`), or without a model that of `thermid.qualify._steadiness`. Where the readings meet the plan's rule, a stop is advised between
decisions too: its risk is the plan's.

In that fit the values that a fault would change (conductances, coefficients, powers), capacitances, unknown starts and a constant error of
every sensor move as far as their prior spreads let them; the structure of the model is what is trusted. Gauss-Newton steps with the
kernel's exact derivatives give the best values and their covariance; the steady state with its own derivatives carries both to where
channels end. Readings count as the residuals show: their scatter, and how many independent ones they are worth.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np

from thermid.base.errors import RecordError, SolverError
from thermid.base.linear_algebra import covariance
from thermid.base.units import ICE_POINT, Array, duration_text, short
from thermid.fit.calibration import Bench, Compressed, Experiment, Prior, Unknown, minimise
from thermid.inference.criticism import WATCHED
from thermid.measure.records import MIN_INDEPENDENT_SHARE, Record, StabilityRule, effective_samples
from thermid.model.tree import Model
from thermid.qualify._steadiness.forecast import MIN_FORECAST_READINGS, RATE_WINDOW, EndForecast, Forecast, IntervalEstimate, forecast
from thermid.qualify._watch.growing import MIN_NOISE
from thermid.simulation.runs import Network, Options, Scenario, Traces, kept_for, settle

CONDUCTANCE_SPREAD: Final = 0.3
"""Prior spread of conductances, coefficients and powers about the deck's, of their logarithm: readings decide where they say more."""
CAPACITANCE_SPREAD: Final = 0.1
"""The same of capacitances, which masses and tables give."""
OFFSET_SPREAD: Final = 0.2
"""Prior spread of a sensor's constant error where no accuracy is stated. [K]"""
CURVATURE_SHARE_OF_LAWS: Final = 0.03
"""Error of the change that is still to come, as a share of it, for laws that bend otherwise than the model's. [-]"""
MIN_READINGS_TO_FIT: Final = 8
"""Readings of every channel from which values are fitted; a forecast needs more."""
DONE_STEP: Final = 0.05
"""Part of a standard error below which a step ahead ends the fit."""
MAX_STRETCHES_AHEAD: Final = 30.0
"""Stretches ahead within which a rule may come to hold."""
INSTANTS_AHEAD: Final = 400
"""Instants ahead at which a rule is asked, and as many of the window before."""


@dataclass(frozen=True)
class SuspectValue:
    """A value that a fault would change.

    Parameters
    ----------
    kind : str              joint, air, heat path, power or ambient.
    whose : str             Path of the conductor, load or boundary.
    path : str              Path of the value; ``scale.LOAD`` for a power.
    lower, higher : str     What a lower and a higher value mean, in words.
    """

    kind: str
    whose: str
    path: str
    lower: str
    higher: str


PATHS: Final = {
    "htc": "air",
    "effective_htc": "air",
    "htc.coefficient": "free air",
    "contact_conductance": "joint",
    "conductance": "joint",
    "resistance": "joint",
    "conductivity": "heat path",
}
"""Field of a conductor -> what it is in the table of causes."""


def _suspect(kind: str, whose: str, path: str, falls: bool = False) -> SuspectValue:
    """Return a value with its words of the table of causes; if `falls`, as for a resistance, lower and higher change places."""
    cause = WATCHED[kind]
    words = (cause.higher, cause.lower) if falls else (cause.lower, cause.higher)
    return SuspectValue("air" if kind == "free air" else kind, whose, path, *words)


def unlogged_ambients(network: Network, logged: Collection[str]) -> tuple[SuspectValue, ...]:
    """Return the temperatures of boundaries without a column in the log; the value of each is a difference to the stated one. [K]"""
    return tuple(_suspect("ambient", b, b) for b in network.boundaries if b not in logged)


def suspect_values(network: Network) -> tuple[SuspectValue, ...]:
    """Return every value of conductors and loads that a fault would change, each once."""
    out: dict[str, SuspectValue] = {}
    parameters = network.flat.parameters
    for c in network.flat.conductors:
        name = next((n for n in PATHS if n in c.fields), "")
        if name:
            path = parameters.literal_behind(c.fields[name])
            out.setdefault(path, _suspect(PATHS[name], c.path, path, name == "resistance"))
    for load in network.flat.loads:
        if load.node in network.nodes:
            out.setdefault(f"scale.{load.path}", _suspect("power", load.path, f"scale.{load.path}"))
    return tuple(out.values())


@dataclass(frozen=True, eq=False, kw_only=True)
class ModelForecast(EndForecast):
    """Forecast by a model fitted to the readings; fields as of `EndForecast`."""

    def as_object(self) -> dict[str, Any]:
        """Return it as JSON holds it, with the keys of a `Forecast`; those that it does not have are null."""
        return self._object(None, None, True)


class LiveFit:
    """A model fitted again and again to the growing record of one test.

    Parameters
    ----------
    model : Model           Of the unit.
    scenario : Scenario     Inputs that the log does not have.

    Attributes
    ----------
    values : dict           Unknown -> its deviation from the model, of the logarithm for positive values. [-], [K]
    wander : dict           Sensor -> factor on its noise, where its residuals are correlated.
    variances : dict        Node -> variance of its temperature at the end of the record by the errors of all values. [K^2]
    """

    def __init__(self, model: Model, scenario: Scenario | None) -> None:
        """Keep what a fit needs; nothing is fitted before `fit` is called."""
        self.model, self.scenario = model, scenario
        self.values: dict[str, float] = {}
        self.wander: dict[str, float] = {}
        self.variances: dict[str, float] = {}
        self._last: tuple[float, tuple[str, ...], _Fit | None] | None = None

    def fit(self, record: Record, channels: Sequence[str]) -> None:
        """Fit the model to a record; nothing where a channel has fewer than `MIN_READINGS_TO_FIT` valid readings.

        Raises
        ------
        SolverError, RecordError   When the model cannot be run under the inputs of the record.
        """
        enough = all(np.count_nonzero(record.channel(n).valid) >= MIN_READINGS_TO_FIT for n in channels)
        new_fit = _Fit(Experiment.bind(self.model, record, self._until(record), errors={}), record, self.values) if enough else None
        if new_fit is not None:
            new_fit.run()
            self.values = new_fit.deviations()
            self.wander = new_fit.wander
            self.variances = new_fit.variances_of_nodes()
        self._last = (float(record.times[-1]), tuple(channels), new_fit)

    def _until(self, record: Record) -> Scenario | None:
        """Return the scenario as far as the record goes, its inputs held from there on, so that changes planned for later do not act."""
        last = record.duration
        return None if self.scenario is None else self.scenario.mapped(lambda s: s.cut(0.0, last).held_on() if s.extent > last else s)

    def ends(self, record: Record, channels: Sequence[str], rule: StabilityRule, within: float, level: float) -> dict[str, ModelForecast]:
        """Return channel -> forecast of its end; empty while a channel has fewer than `MIN_FORECAST_READINGS`.

        Parameters
        ----------
        record, channels    The record so far, and the channels that must end.
        rule : StabilityRule
        within : float      Largest half-width of an interval. [K]
        level : float       Probability of the interval.

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
        return {n: f for n, f in last_fit.ends(rule, within, level).items() if n in channels}


class _Fit:
    """One fit: unknowns with normal priors, and readings with their weights; `minimise` takes it as its least-squares problem.

    Unknowns z are deviations from the model: x = base exp(z) of positive values, base + z of temperatures, then an offset for each sensor.
    """

    def __init__(self, experiment: Experiment, record: Record, before: dict[str, float]) -> None:
        self.experiment, self.record = experiment, record
        self.names, self.base, spread, self.relative = unknowns_with_priors(experiment)
        self.bench = Bench.of_experiment(experiment, self.names)
        self.sensors = experiment.observations
        priors = dict(zip(self.names, spread.tolist(), strict=True)) | {
            f"sensor {o.sensor}": OFFSET_SPREAD if (stated := record.channel(o.sensor).accuracy) is None else max(stated, 1e-3)
            for o in self.sensors
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
        """Return unknown -> deviation z from the model. [-], [K]"""
        return dict(zip((u.name for u in self.unknowns), self.z.tolist(), strict=True))

    def _values(self, z: Array) -> tuple[Array, Array]:
        """Return x = base exp(z), or base + z for temperatures [K], of the free names (names,) [SI], and dx/dz."""
        moves = z[: len(self.names)]
        x = np.where(self.relative, self.base * np.exp(moves), self.base + moves)
        return x, np.where(self.relative, x, 1.0)

    def _residuals(self, z: Array) -> tuple[list[Array], list[Array]]:
        """Return residuals measured - predicted - offset (samples,) of every sensor, and derivatives (samples, unknowns). [K]

        `z` (unknowns,) are the free values in their fitted form, then an offset per sensor [K]; the derivatives are those of prediction
        plus offset by z.
        """
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
        """Return the root (unknowns + 1, unknowns + 1) of weighted derivatives and residuals [-] at `fitted` (unknowns,): R of their QR."""
        residuals, rows = self._residuals(fitted)
        whole = np.vstack([np.column_stack([-j, r]) / s for r, j, s in zip(residuals, rows, self.sizes, strict=True)])
        root: Array = np.asarray(np.linalg.qr(whole, mode="r"))
        return Compressed(root[:, -1], root[:, :-1], float(root[:, -1] @ root[:, -1]), (), ())

    def prior_rows(self, fitted: Array) -> tuple[Array, Array]:
        """Return the residuals z / sd of the priors, and their derivatives."""
        return fitted / self.prior, np.diag(1.0 / self.prior)

    def square(self, compressed: Compressed) -> float:
        """Return the sum of squared residuals in units of the noise."""
        return compressed.chi_square

    def run(self) -> None:
        """Fit, estimate the noise from the residuals, and fit again; `inverse` becomes the covariance (P + sum J_k'J_k / s_k^2)^-1.

        P is the information of the priors, J_k (samples, unknowns) and s_k [K] are the derivatives and the noise of sensor k.
        """
        for _ in range(2):
            minimum = minimise(self, start=self.z, done=DONE_STEP)
            self.z = minimum.fitted
            self.inverse = covariance(np.concatenate([minimum.jacobian, minimum.priors]))
            residuals, rows = self._residuals(self.z)
            self._set_noise_from_residuals(residuals, rows)
        self.inverse = np.linalg.inv(np.diag(1.0 / self.prior**2) + sum(j.T @ j / s**2 for j, s in zip(rows, self.sizes, strict=True)))

    def _set_noise_from_residuals(self, residuals: Sequence[Array], rows: Sequence[Array]) -> None:
        """Set the standard deviation by which each sensor's readings are weighed, from its residuals r (samples,). [K]

        s = max(sqrt(r'r / f), step / sqrt(12)) sqrt(n / m), m the effective samples of n, f = n - p n / m the degrees of freedom left, at
        least n / 4. p is what the fit took, trace(J C J') / s_0^2 with J of `rows` (samples, unknowns), C the covariance and s_0 the
        weight before.
        """
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

    def variances_of_nodes(self) -> dict[str, float]:
        """Return node -> variance s'Cs of its temperature at the last reading. [K^2]

        s are its derivatives by the free values, C their covariance.
        """
        x, scale = self._values(self.z)
        engine, nodes = self.bench.engine, self.experiment.network.nodes
        a = engine.started(self.bench.wiring.assemble(x, True), True)
        times = np.array([0.0, float(self.experiment.times[-1])])
        nodes_kept = kept_for(a, tuple(nodes))
        answer = engine.integrate(a, times, nodes_kept, float(times[-1]), Options(), True)
        traces = Traces(self.bench.wiring, a, times, nodes_kept, answer.temperatures, answer.sensitivities)
        of_values = self.inverse[: scale.size, : scale.size]
        slopes = {n: traces.slope(n)[-1] * scale for n in nodes}
        return {n: float(slope @ of_values @ slope) for n, slope in slopes.items()}

    def ends(self, rule: StabilityRule, within: float, level: float) -> dict[str, ModelForecast]:
        """Return sensor -> forecast of its end, declined where the half-width of its interval exceeds `within` [K].

        The variance is s'Cs + (0.03 (end - now))^2 + step^2 / 12 with the sensitivities s of the steady state and the covariance C; the
        interval of probability `level` [-] is of Student's t with the effective samples less the free values as degrees of freedom.
        """
        from scipy.special import stdtrit

        x, scale = self._values(self.z)
        count = len(self.names)
        engine = self.bench.engine
        a = engine.started(self.bench.wiring.assemble(x, True), True)
        last = float(self.experiment.times[-1])
        settled, slopes = settle(engine, a, last, True)
        traces = Traces(self.bench.wiring, a, np.array([last]), engine.nodes, settled[None, :], slopes[None])
        times, courses = self._temperatures_about(x, last, rule.window or RATE_WINDOW)
        out = {}
        for k, o in enumerate(self.sensors):
            bias = float(self.z[count + k])
            end = float(traces.temperature(o.node)[0]) + bias
            slope = np.zeros(self.z.size)
            slope[:count] = traces.slope(o.node)[0] * scale
            slope[count + k] = 1.0
            now = float(np.interp(last, times, courses[:, k])) + bias
            variance = float(slope @ self.inverse @ slope) + (CURVATURE_SHARE_OF_LAWS * (end - now)) ** 2 + self.steps[k] ** 2 / 12.0
            half = float(stdtrit(max(self.worth - count, 3.0), 0.5 + 0.5 * level) * np.sqrt(variance))
            holds = _time_of_stability(times, courses[:, k], rule, last)
            final, begin = IntervalEstimate(end, end - half, end + half), float(self.record.times[0])
            wide = (
                f"The final temperature could be from {final.low - ICE_POINT:.1f} to {final.high - ICE_POINT:.1f} degC "
                f"({100 * level:g} %), wider than the +- {within:.3g} K requested: the readings do not determine the model's values well "
                "enough yet. Wait longer."
            )
            out[o.sensor] = ModelForecast(
                channel=o.sensor,
                start=begin,
                now=float(self.record.times[-1]),
                latest=now,
                final=final,
                declined=wide if final.error > within else "",
                within=within,
                level=level,
                rule=rule,
                holds=None if holds is None else begin + holds,
            )
        return out

    def _temperatures_about(self, x: Array, last: float, window: float) -> tuple[Array, Array]:
        """Return times [s] from `window` [s] before `last` [s] on, and the temperatures of the sensors' nodes then (times, sensors). [K]

        At the values `x` (free,) [SI]: `INSTANTS_AHEAD` times up to `last`, as many in geometric steps after it, to `MAX_STRETCHES_AHEAD`
        of it.
        """
        times = np.concatenate(
            [
                np.linspace(max(last - window, 0.0), last, INSTANTS_AHEAD),
                last + np.geomspace(last / INSTANTS_AHEAD, MAX_STRETCHES_AHEAD * last, INSTANTS_AHEAD),
            ]
        )
        engine, wiring = self.bench.engine, self.bench.wiring
        a = engine.started(wiring.assemble(x, False))
        nodes = tuple(o.node for o in self.sensors)
        nodes_kept = kept_for(a, nodes)
        answer = engine.integrate(a, times, nodes_kept, float(times[-1]), Options(), False)
        traces = Traces(wiring, a, times, nodes_kept, answer.temperatures, answer.sensitivities)
        return times, np.column_stack([traces.temperature(n) for n in nodes])


def unknowns_with_priors(experiment: Experiment) -> tuple[tuple[str, ...], Array, Array, Array]:
    """Return the names of free values, the model's numbers (free,) [SI], prior deviations (free,), and whether these are of the logarithm.

    Free are values that a fault would change, capacitances, and starts that are not known [K]; values that are not positive stay fixed.
    """
    network = experiment.network
    values = network.numbers().values
    rows: dict[str, tuple[float, float, bool]] = {}

    def number(path: str) -> float:
        """Return a parameter's number. [SI]"""
        return float(getattr(values[path], "value", values[path]))

    for s in suspect_values(network):
        rows[s.path] = (1.0 if s.path.startswith("scale.") else number(s.path), CONDUCTANCE_SPREAD, True)
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


def _time_of_stability(times: Array, course: Array, rule: StabilityRule, now: float) -> float | None:
    """Return the time [s] from `now` on after which temperatures change by at most rate * window over every window of a rule.

    None where the last instant but one or a later one still changes by more, or for a rule on stored heat. A rule without a window is asked
    over `RATE_WINDOW`.

    Parameters
    ----------
    times : array (instants,)   From a window before `now` on, or from the beginning where that is later. [s]
    course : array (instants,)  Temperatures then, straight between the instants. [K]
    """
    if rule.stored:
        return None
    window = rule.window or RATE_WINDOW
    fast = np.flatnonzero(np.abs(course - np.interp(times - window, times, course)) > rule.rate * window)
    slow = int(fast[-1]) + 1 if fast.size else 0
    return None if slow + 1 >= times.size else max(float(times[slow]), now, float(times[0]) + rule.window)


RISK: Final = 0.01
"""Probability of one wrong stop on a plateau, at most: in a whole test where no known power is switched."""
DECISION_GROWTH: Final = 1.15
"""By how much the time watched grows from one decision to the next."""
MAX_DOUBLING_TIME: Final = 600.0
"""Up to which the time watched doubles from one decision to the next. [s]"""
DECISIONS: Final = 30
"""Decisions that share the risk: the time watched grows to sixty times that of the first one."""

AnyForecast = Forecast | ModelForecast
"""Where a channel ends, by its readings or by the model fitted to them."""

STOP, WAIT, DECLINED = "stop", "wait", "declined"


@dataclass(frozen=True)
class TemperatureLimit:
    """A limit on the final temperature of a channel. [K]"""

    channel: str
    above: bool
    value: float

    def undecided(self, low: float, high: float) -> bool:
        """Whether an interval low .. high [K] contains the limit."""
        return low <= self.value <= high

    def __str__(self) -> str:
        """Channel, sign and limit in Celsius."""
        return f"{self.channel}{'>' if self.above else '<'}{short(self.value - ICE_POINT)} degC"


@dataclass(frozen=True)
class StopAdvice:
    """Advice at one moment.

    Parameters
    ----------
    word : str                  ``stop``, ``wait`` or ``declined``.
    because : str               The reason, in words.
    decisions : int             Number of decisions so far.
    level : float               Probability of the intervals at the last one. [-]
    ends : dict                 Channel -> its `Forecast` or `ModelForecast` at the last one.
    holds : float or None       When the rule of stability will hold for all channels, with a probability of one half. [s]
    at : float                  Time of the decision. [s]
    """

    word: str
    because: str
    decisions: int
    level: float
    ends: Mapping[str, AnyForecast] = field(repr=False)
    holds: float | None
    at: float


class Stopping:
    """The decisions of one test on when to stop.

    Parameters
    ----------
    rule : StabilityRule    The plan's own rule of stability.
    within : float          Largest half-width of the interval of a final temperature. [K]
    limits : sequence       Limits on final temperatures; a stop needs each decided.
    risk : float            Probability of one wrong stop on a plateau, shared by `DECISIONS` decisions and all channels. [-]
    model, scenario         A model that is fitted to the readings, and the inputs that the log does not have.
    more                    Without a model, further arguments of `forecast`: reference, slowest.
    """

    def __init__(
        self,
        rule: StabilityRule,
        within: float,
        limits: tuple[TemperatureLimit, ...] = (),
        risk: float = RISK,
        model: Model | None = None,
        scenario: Scenario | None = None,
        **more: Any,
    ) -> None:
        self.rule, self.within, self.limits, self.risk, self.more = rule, within, limits, risk, more
        self.settling = None if model is None else LiveFit(model, scenario)
        self.count, self._watched, self.changed = 0, 0.0, float("-inf")
        self.last: StopAdvice | None = None

    def due(self, record: Record) -> bool:
        """Whether the next decision is due: the time watched has grown enough, or a power was switched since the last one."""
        if self.last is not None and record.times[-1] > self.changed >= self.last.at:
            return True
        return self._time_watched(record) >= min(2.0 * self._watched, max(DECISION_GROWTH * self._watched, MAX_DOUBLING_TIME))

    def _time_watched(self, record: Record) -> float:
        """Return the time since the beginning, or since a known power was switched. [s]"""
        return float(record.times[-1]) - max(float(record.times[0]), self.changed)

    def decide(self, record: Record, names: tuple[str, ...], settles: Mapping[str, float] | None = None, doubt: str = "") -> StopAdvice:
        """Return the advice on a record: a new decision where one is due, else the last one.

        Parameters
        ----------
        record : Record     All readings since conditions last changed.
        names : tuple       Channels that must end.
        settles : dict      Channel -> steady temperature of the model; a forecast that ends elsewhere is declined. [K]
        doubt : str         What is wrong with the test or its model; nothing is stopped then.
        """
        if self.last is None or self.due(record):
            self._forecast(record, names, settles or {}, doubt)
        assert self.last is not None
        return self._advice_now(record, names, self.last, doubt)

    def _forecast(self, record: Record, names: tuple[str, ...], settles: Mapping[str, float], doubt: str) -> None:
        """Make the next decision; `last` is then its advice."""
        anew = self.last is not None and self.changed >= self.last.at
        self.count = 1 if anew else self.count + 1
        self._watched = self._time_watched(record)
        level = 1.0 - self.risk / (DECISIONS * len(names))
        ends, why = ({}, "") if doubt else self._ends(record, names, level)
        holds = [f.holds for f in ends.values()]
        late = None if not ends or any(h is None for h in holds) else max(h for h in holds if h is not None)
        self.last = self._advice(record, ends, why or self._model_contradicts(ends, settles), late, level, doubt)

    def _advice_now(self, record: Record, names: tuple[str, ...], last: StopAdvice, doubt: str) -> StopAdvice:
        """Return the last decision as it holds now: declined by a doubt, or a stop where the readings meet the plan's rule.

        The latter only after the time at which it was expected, and with no limit undecided.
        """
        now = float(record.times[-1])
        if doubt:
            return replace(last, word=DECLINED, because=doubt)
        expected = last.holds is not None and last.holds <= now
        if last.word == STOP or not expected or self._undecided_limits(last.ends) or not self._rule_is_met(record, names):
            return last
        open_ = "" if last.word == WAIT else f" Where the channels end is not known: {last.because}"
        return replace(last, word=STOP, because=f"the readings meet the plan's rule '{self.rule.name}'.{open_}", at=now)

    def _rule_is_met(self, record: Record, names: tuple[str, ...]) -> bool:
        """Whether the readings of every channel meet the plan's rule beyond two standard errors."""
        try:
            return all(self.rule.of_channel(record, n, since=self.changed).verdict == "stable" for n in names)
        except RecordError:
            return False

    def _undecided_limits(self, ends: Mapping[str, AnyForecast]) -> list[TemperatureLimit]:
        """Return the limits that lie within the interval of their channel's final temperature."""
        return [m for m in self.limits if m.channel in ends and m.undecided(ends[m.channel].final.low, ends[m.channel].final.high)]

    def _ends(self, record: Record, names: tuple[str, ...], level: float) -> tuple[dict[str, AnyForecast], str]:
        """Return channel -> forecast at a probability `level`, and why there is none, in words."""
        ends: dict[str, AnyForecast] = {}
        why = ""
        if self.settling is not None:
            try:
                ends |= self.settling.ends(record, names, self.rule, self.within, level)
            except (RecordError, SolverError) as error:
                return {}, error.message
            return ends, "" if ends else f"a forecast needs {MIN_FORECAST_READINGS} readings of every channel."
        for name in names:
            try:
                ends[name] = forecast(record, name, rule=self.rule, within=self.within, level=level, **self.more)
            except RecordError as error:
                why = why or error.message
        return ends, why

    def _model_contradicts(self, ends: Mapping[str, AnyForecast], settles: Mapping[str, float]) -> str:
        """Return a sentence where readings end further than `within` from where the model settles; empty where they do not."""
        apart = {n: ends[n].final.value - t for n, t in settles.items() if n in ends and not ends[n].declined}
        far = max(apart, key=lambda n: abs(apart[n]), default="")
        if not far or abs(apart[far]) <= self.within:
            return ""
        return (
            f"{far}: the readings end at {ends[far].final}, the model settles {short(abs(apart[far]))} K "
            f"{'below' if apart[far] > 0 else 'above'} that. The model lacks a slow mass, or one of its values is wrong."
        )

    def _advice(
        self, record: Record, ends: Mapping[str, AnyForecast], why: str, late: float | None, level: float, doubt: str
    ) -> StopAdvice:
        """Return the advice of a decision: declined for a doubt or a wide interval, wait for the plan's rule, or stop."""
        now = float(record.times[-1])

        def advice_of(word: str, because: str) -> StopAdvice:
            """Return this advice at the time of the decision."""
            return StopAdvice(word, because, self.count, level, ends, late, now)

        if doubt or why:
            return advice_of(DECLINED if doubt or ends else WAIT, doubt or why)
        if self.count > DECISIONS:
            return advice_of(DECLINED, f"{DECISIONS} decisions were made, which uses up the stated risk. Apply the plan's rule instead.")
        open_ = [f for f in ends.values() if f.declined]
        if open_:
            worst = max(open_, key=lambda f: f.final.error)
            return advice_of(DECLINED, f"{worst.channel}: {worst.declined}")
        undecided = self._undecided_limits(ends)
        if undecided:
            m = undecided[0]
            f = ends[m.channel].final
            span = f"{short(f.low - ICE_POINT)} to {short(f.high - ICE_POINT)} degC"
            return advice_of(DECLINED, f"{m.channel} may end on either side of its limit {m}: {span}. Wait longer.")
        holds = late is not None and late <= now
        when = "" if late is None else f" (expected at {duration_text(late)})"
        rule = "" if holds else f" The plan's rule '{self.rule.name}' is not met yet{when}. Check in the plan whether the test may end."
        return advice_of(
            STOP, f"waiting longer does not change the verdict: every channel ends within +- {short(self.within)} K of its forecast.{rule}"
        )
