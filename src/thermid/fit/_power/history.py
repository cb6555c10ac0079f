"""`PowerHistory`: the power of a load over time as a log shows it, how well, how finely, and which law it follows."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.base.errors import IdentificationError, NameNotFoundError, SolverError, ThermidError, refuse_unknown
from thermid.base.linear_algebra import NOTHING, covariance as information_inverse, quadratic_forms
from thermid.base.results import PlottedTrace, Result, Shown
from thermid.base.units import HALF_WIDTH_95, ICE_POINT, Array, Bools, Kelvin, amount, duration_text, short, unit
from thermid.fit._minimisation import LocalCost, descend
from thermid.fit._problem.experiment import on_the_clock_of
from thermid.fit._problem.gather import build_problem
from thermid.fit._problem.request import Request, priors_of
from thermid.fit._problem.residuals import Influence, Problem, SensorTrace, Unknown
from thermid.fit._uncertainty.noise import MIN_LIKELIHOOD_GAIN, Binned, TraceNoise, answers_to_inputs, covariance_of_means
from thermid.measure.records import Record
from thermid.model.tree import Constant, HeatLoad, Model, TableSignal, literal, model_from_dict
from thermid.simulation.runs import Scenario, compile_network, simulate
from thermid.values.store import deviation

LAW_STARTS, LAW_STEP = 12, 1e-6
"""Starts of a law with a bend, and half the step of its differences, beside a coefficient."""
TURN = 0.05
"""Half the width of the rounded turn of a V. [K]"""
Formula = Callable[[Array, Array], Array]


@dataclass(frozen=True, eq=False)
class PowerHistory(Result):
    """The power of a load, recovered from temperatures.

    Parameters
    ----------
    load, node : str                The load, and the node that it heats.
    times : array (knots,)          From the first sample; the power is linear between them. [s]
    power : array (knots,)          Most likely power. [W]
    covariance : array (knots, knots)   Of the power, everything else that was looked for counted. [W^2]
    temperature : array (knots,)    Of the node. [K]
    known : array (knots,)          Where the power was given.
    resolution : float              Width at half height of the kernel through which the log shows the power. [s]
    prior : str                     Random walk, or integrated random walk.
    values : dict                   What was fitted with it -> (value, standard error, unit).
    blocks : tuple of SensorTrace         Measured and predicted readings.
    model : Model                   With the fitted values, the load a plain power.
    scenario : Scenario             What was done, with the history as the load's power.
    warnings : tuple of str         What a reader must know.
    """

    load: str
    node: str
    times: Array
    power: Array
    covariance: Array
    temperature: Array
    known: Bools
    resolution: float
    prior: str
    values: Mapping[str, tuple[float, float, str]]
    blocks: Sequence[SensorTrace]
    model: Model = field(repr=False)
    scenario: Scenario = field(repr=False)
    warnings: tuple[str, ...] = ()

    @property
    def sd(self) -> Array:
        """Standard deviation of the power (knots,). [W]"""
        return np.asarray(np.sqrt(np.maximum(np.diag(self.covariance), 0.0)))

    def weights(self, window: str) -> tuple[Array, Array]:
        """Return the middle of every whole window [s], and the weights W (windows, knots) of the knots in its mean power. [-]

        The power is straight between knots, so W_ik is the integral of knot k's hat over window i, over the window's width: P_mean = W P.

        Raises
        ------
        IdentificationError   When a window is narrower than two knots or wider than the log.
        """
        width, steps = literal(window, "s", "window"), np.diff(self.times)
        count = int(self.times[-1] / width + 1e-9)
        if width < 0.99 * float(np.median(steps)) or count < 1:
            raise IdentificationError(
                f"a window of {window} does not fit knots every {np.median(steps):g} s over {self.times[-1]:g} s.",
                self.load,
                code="value.outside-range",
            )
        edges: Array = width * np.arange(count + 1, dtype=float)
        # the integral of each hat from the beginning to every edge: of its rising side, then of its falling one
        share = np.clip((edges[:, None] - self.times[None, :-1]) / steps[None, :], 0.0, 1.0)
        whole = np.zeros((edges.size, self.times.size))
        whole[:, 1:] = 0.5 * share**2 * steps
        whole[:, :-1] += (share - 0.5 * share**2) * steps
        return np.asarray(edges[:-1] + 0.5 * width), np.asarray(np.diff(whole, axis=0) / width)

    def averaged(self, window: str) -> tuple[Array, Array, Array]:
        """Return the middle of every window [s], its mean power [W] and the standard deviation of that. [W]"""
        middle, weights = self.weights(window)
        return middle, np.asarray(weights @ self.power), np.sqrt(quadratic_forms(weights, self.covariance))

    @property
    def rmse(self) -> dict[str, float]:
        """Sensor -> RMS of measured less predicted. [K]"""
        return {b.sensor: float(np.sqrt(np.mean(b.residuals**2))) for b in self.blocks}

    def laws(self) -> tuple[PowerLaw, ...]:
        """Return laws of the power over the node's temperature fitted to the history where it was unknown, the likeliest first.

        Those with which the model cannot be run are left out.
        """
        fits = [f(self) for f in (_constant, _linear, _exponential, _vee, _proportional, _thermostat)]
        return tuple(sorted((f for f in fits if f is not None), key=lambda f: f.akaike))

    def __str__(self) -> str:
        """Return its size, error and resolution, what was fitted with it, and warnings."""
        open_ = ~self.known
        lines = [
            f"power of {self.load}: mean {self.power[open_].mean():.4g} W, from {self.power[open_].min():.4g} to "
            f"{self.power[open_].max():.4g} W where it was unknown ({self.prior})",
            f"  error of a moment {np.median(self.sd[open_]):.2g} W (1 sd); resolution {self.resolution / 60:.3g} min; faster changes "
            "are smoothed over that time",
        ]
        for name, (value, error, in_unit) in self.values.items():
            lines.append(f"  {name} {value:.5g} +- {error:.2g} {in_unit}")
        lines += [f"  {sensor}: RMSE {size:.3g} K" for sensor, size in self.rmse.items()]
        return "\n".join([*lines, *(f"  warning: {w}" for w in self.warnings)])

    _axes_titles = ("time [s]", "power [W]")

    def _as_traces(self) -> Sequence[PlottedTrace]:
        """Return the power with its 95 % band."""
        return [PlottedTrace(self.load, self.times, self.power, self.power - HALF_WIDTH_95 * self.sd, self.power + HALF_WIDTH_95 * self.sd)]


@dataclass(frozen=True, eq=False)
class PowerLaw(Shown):
    """A law of the power over the temperature T of the heated node, fitted to a history.

    Parameters
    ----------
    name : str              constant, linear, exponential, V-shaped, proportional or thermostat.
    formula : str           In words and numbers. [W, degC]
    coefficients : dict     Name -> (value, standard error). [W, K, degC]
    power : array (knots,)  What the law says at the history's knots. [W]
    rmse : dict             Sensor -> RMS of measured less predicted where the power was unknown, the law in the model. [K]
    akaike : float          Sum of squares of these in units of the noise, and 2 per coefficient; the smallest is the likeliest (Akaike,
                            IEEE Trans. Autom. Control 19 (1974) 716).
    model : Model           The history's model with the law as its load.
    """

    name: str
    formula: str
    coefficients: dict[str, tuple[float, float]]
    power: Array
    rmse: dict[str, float]
    akaike: float
    model: Model = field(repr=False)

    def __str__(self) -> str:
        """Return the law on one line."""
        residuals_text = ", ".join(f"{s} {v:.3g} K" for s, v in self.rmse.items())
        return f"{self.name}: {self.formula}   left in the readings: {residuals_text}"


def with_load(model: Model, path: str, load: HeatLoad) -> Model:
    """Return the model with a load in place of the one at a path, or beside the others."""
    return _with_loads(model, path, lambda loads, name: {**loads, name: load})


def _with_loads(model: Model, path: str, change: Callable[[Mapping[str, HeatLoad], str], dict[str, HeatLoad]]) -> Model:
    """Return the model with other loads in the part of a path; `change` takes the loads of that part and the last name of the path."""
    part, _, name = path.rpartition(".")
    inner = model.submodel(part) if part else model
    changed = replace(inner, loads=change(inner.loads, name))
    return model.with_part(part, changed) if part else changed


def watts(into: str, **fields: object) -> HeatLoad:
    """Return a load as a deck would write it."""
    deck = {"title": "load", "nodes": {"n": {"capacitance": "1 [J/K]"}}, "loads": {"q": {"into": "n", **fields}}}
    return replace(model_from_dict(deck).loads["q"], into=into)


def _misses(h: PowerHistory, model: Model) -> tuple[dict[str, float], float]:
    """Return sensor -> RMS of measured less predicted where the power was unknown [K], and their sum of squares in units of the noise.

    The run starts where the power became unknown, from the history's temperatures.
    """
    begin = float(h.times[int(np.flatnonzero(~h.known)[0])])
    whole = simulate(h.model, h.scenario, times=np.unique(np.append(h.times, begin)))
    first = int(np.searchsorted(whole.times, begin))
    nodes = [n for n in whole.nodes if n not in h.scenario.boundaries]
    loads = {k: v for k, v in h.scenario.loads.items() if k != h.load}
    scenario = replace(
        replace(h.scenario, loads=loads).begun(begin),
        initial={n: Kelvin(whole[n].kelvin[first]) for n in nodes},
        duration=float(h.times[-1]) - begin,
    )
    out, total = {}, 0.0
    for block in h.blocks:
        late = block.times >= begin
        times = block.times[late] - begin
        run = simulate(model, scenario, times=times)
        bias = float(np.mean(block.predicted - np.interp(block.times, whole.times, whole[block.node].kelvin)))
        away = block.measured[late] - run[block.node].kelvin - bias
        out[block.sensor] = float(np.sqrt(np.mean(away**2)))
        total += float(np.sum((away / block.noise) ** 2))
    return out, total


def _means(h: PowerHistory) -> tuple[Array, Array, Array, Array]:
    """Return temperature [degC] and power [W] (knots,) where it was unknown, weights A (means, knots) of means, and A C A' [W^2].

    C is the covariance of the knots. Windows in which the power was known are left out.
    """
    open_ = ~h.known
    weights = h.weights(f"{max(h.resolution, float(np.median(np.diff(h.times))))!r} [s]")[1]
    clear = weights[:, h.known].sum(axis=1) < 1e-9
    weights = weights[clear][:, open_]
    return h.temperature[open_] - ICE_POINT, h.power[open_], weights, weights @ h.covariance[np.ix_(open_, open_)] @ weights.T


def _best(h: PowerHistory, law: Formula, starts: list[list[float]]) -> tuple[Array, Array] | None:
    """Return coefficients (n,) [SI] of a law of power and their standard errors, of the best of several descents; None where all fail.

    It minimises |W (power - law) / sd|^2 / 2 over means of the history [W], sd their standard errors [W]; errors are those of weighted
    least squares with the covariance of the means, widened by chi^2 per degree of freedom where that is above 1.

    Parameters
    ----------
    law : callable      (times or temperatures (means,), coefficients) -> power (means,). [W]
    starts : list       Coefficients from which to descend.
    """
    at, power, weights, covariance = _means(h)
    sd = np.sqrt(np.diag(covariance))

    def misses(b: Array) -> Array:
        """Return what a law misses (means,) of the power, in standard deviations of its means. [-]"""
        with np.errstate(all="ignore"):
            return np.asarray(weights @ (power - law(at, b)) / sd)

    def local(b: Array) -> LocalCost:
        """Return half |misses|^2 [-], the misses (means,) and their slopes (means, coefficients) by central differences."""
        rows, steps = misses(b), LAW_STEP * np.maximum(np.abs(b), 1.0)
        slopes = np.column_stack([(misses(b + s) - misses(b - s)) / (2.0 * s.sum()) for s in np.diag(steps)])
        if not (np.isfinite(rows).all() and np.isfinite(slopes).all()):
            raise SolverError("the law gives no finite power.", h.load, code="run.did-not-finish")
        return 0.5 * float(rows @ rows), rows, slopes

    descents = []
    for start in starts:
        begin = np.array(start)
        try:
            size = np.linalg.norm(local(begin)[2], axis=0)
            scale = 1.0 / np.where(size > 0.0, size, 1.0)
            at_end = descend(local, begin, (begin - np.inf, begin + np.inf), scale).x
            descents.append((local(at_end), at_end))
        except SolverError:
            continue
    if not descents:
        return None
    (cost, rows, slopes), b = min(descents, key=lambda f: f[0][0])
    level = max(1.0, 2.0 * cost / max(rows.size - b.size, 1))
    # each mean by its own error, since a wrong law is wrong in all of them; that their errors hang together widens the result
    solver = np.linalg.pinv(slopes)
    errors = np.sqrt(np.diag(solver @ (covariance / np.outer(sd, sd)) @ solver.T) * level)
    return b, errors


def _law(h: PowerHistory, name: str, law: Formula, starts: list[list[float]], names: tuple[str, ...], write: Any) -> PowerLaw | None:
    """Return a law of power over temperature, fitted from the best of several starts; None where no fit ends."""
    best = _best(h, law, starts)
    if best is None:
        return None
    b, errors = best
    formula, fields = write([float(v) for v in b])
    coefficients = {n: (float(v), float(e)) for n, v, e in zip(names, b, errors, strict=True)}
    return _fed_back(h, name, formula, coefficients, law(h.temperature - ICE_POINT, b), fields)


def _fed_back(
    h: PowerHistory, name: str, formula: str, coefficients: dict[str, tuple[float, float]], power: Array, fields: dict[str, Any]
) -> PowerLaw | None:
    """Return a law judged by the readings: what the model leaves of them with the law as its load."""
    load = h.model.at(h.load)
    assert isinstance(load, HeatLoad)
    model = with_load(h.model, h.load, watts(load.into, **fields))
    try:
        rmse, square = _misses(h, model)
    except ThermidError:
        return None
    return PowerLaw(name, formula, coefficients, power, rmse, square + 2.0 * len(coefficients), model)


def _spread(h: PowerHistory) -> tuple[float, float, float, float]:
    """Return lowest and highest temperature [degC], and mean and largest power [W], where the power was unknown."""
    t, p = h.temperature[~h.known] - ICE_POINT, h.power[~h.known]
    return float(t.min()), float(t.max()), float(p.mean()), float(p.max())


def _constant(h: PowerHistory) -> PowerLaw | None:
    """Return the law of a constant power."""
    _, _, mean, _ = _spread(h)
    return _law(h, "constant", lambda t, b: b[0] + 0.0 * t, [[mean]], ("power",), lambda b: (f"{b[0]:.4g} W", {"power": f"{b[0]!r} [W]"}))


def _linear(h: PowerHistory) -> PowerLaw | None:
    """Return the law P (1 + a (T - T0)), T0 the middle of the temperatures seen."""
    low, high, mean, _ = _spread(h)
    middle = 0.5 * (low + high)

    def write(b: list[float]) -> tuple[str, dict[str, Any]]:
        """Return the law as text, and the fields of a load that has it."""
        fields = {
            "power": f"{b[0]!r} [W]",
            "temperature_coefficient": f"{b[1] / b[0]!r} [1/K]",
            "reference_temperature": f"{middle!r} [degC]",
        }
        return f"{b[0]:.4g} W {b[1]:+.3g} W/K (T - {middle:.4g} degC)", fields

    return _law(h, "linear", lambda t, b: b[0] + b[1] * (t - middle), [[mean, 0.0]], ("power", "slope"), write)


def _exponential(h: PowerHistory) -> PowerLaw | None:
    """Return the law P exp(a (T - T0)) [W], a [1/K], T0 [degC] the middle of the temperatures seen; None where no descent ends."""
    low, high, mean, _ = _spread(h)
    middle = 0.5 * (low + high)

    def write(b: list[float]) -> tuple[str, dict[str, Any]]:
        """Return the law as text, and the fields of a load that has it."""
        fields = {"power": f"{b[0]!r} [W]", "exponential_coefficient": f"{b[1]!r} [1/K]", "reference_temperature": f"{middle!r} [degC]"}
        return f"{b[0]:.4g} W exp({b[1]:+.3g} 1/K (T - {middle:.4g} degC))", fields

    def law(t: Array, b: Array) -> Array:
        """Return the power at temperatures [degC] and coefficients. [W]"""
        return np.asarray(b[0] * np.exp(np.clip(b[1] * (t - middle), -50.0, 50.0)))

    return _law(h, "exponential", law, [[mean, 0.01], [mean, -0.01]], ("power", "exponential_coefficient"), write)


def _vee(h: PowerHistory) -> PowerLaw | None:
    """Return a V-shaped law P = b0 + b1 |T - b2| [W] fitted to a power, T in degC: a cooler of Peltier elements works on both sides of b2.

    None where no start leads to a fit.
    """
    low, high, mean, top = _spread(h)
    wide = max(high - low, 0.1)

    def write(b: list[float]) -> tuple[str, dict[str, Any]]:
        """Return the law P + b |T - T0| [W] as text, and the table of a load that has it."""
        ends = (min(low, b[2]) - wide, b[2] - TURN, b[2] + TURN, max(high, b[2]) + wide)
        slopes = (-b[1], -b[1], b[1], b[1])  # else the table would round the turn
        points = [[f"{t!r} [degC]", f"{b[0] + b[1] * abs(t - b[2])!r} [W]", f"{s!r} [W/K]"] for t, s in zip(ends, slopes, strict=True)]
        return f"{b[0]:.4g} W {b[1]:+.3g} W/K |T - {b[2]:.4g} degC|", {"table": {"over": "temperature", "points": points}}

    starts = [[0.5 * mean, (top - mean) / wide + 1e-3, low + wide * k / (LAW_STARTS - 1)] for k in range(LAW_STARTS)]
    return _law(h, "V-shaped", lambda t, b: b[0] + b[1] * np.abs(t - b[2]), starts, ("power", "slope", "turning_point"), write)


def _proportional(h: PowerHistory) -> PowerLaw | None:
    """Return a proportional heater fitted to a power: P = b0 (b1 - T) [W], cut to 0 .. b2, gain b0 [W/K], set point b1 and T in degC.

    None where no start leads to a fit, or the gain is not positive.
    """
    low, high, _, top = _spread(h)
    wide = max(high - low, 0.1)

    def write(b: list[float]) -> tuple[str, dict[str, Any]]:
        """Return the law as text, and the fields of a load that has it."""
        fields = {"power": f"{b[2]!r} [W]", "proportional": {"gain": f"{b[0]!r} [W/K]", "setpoint": f"{b[1]!r} [degC]"}}
        return f"{b[0]:.4g} W/K below {b[1]:.4g} degC, at most {b[2]:.4g} W", fields

    starts = [[top / (wide * f), s, top] for f in (0.1, 0.3, 1.0) for s in np.linspace(low + 0.1 * wide, high + 0.5 * wide, LAW_STARTS)]
    names = ("gain", "setpoint", "power")
    law_found = _law(h, "proportional", lambda t, b: np.clip(b[0] * (b[1] - t), 0.0, max(b[2], 0.0)), starts, names, write)
    return law_found if law_found is not None and law_found.coefficients["gain"][0] > 0 else None


def _thermostat(h: PowerHistory) -> PowerLaw | None:
    """Return a thermostat's law, on below and off above [degC]: None with fewer than three switches, or levels that do not part.

    Power [W] is the median of those above the middle; the levels are medians of the temperatures at which it changes.
    """
    at, power, _, _ = _means(h)
    middle = 0.5 * (power.min() + power.max())
    on = power > middle
    turns = np.flatnonzero(np.diff(on.astype(int)))
    if turns.size < 3:
        return None
    full = float(np.median(power[on]))
    lower = float(np.median([at[k] for k in turns if not on[k]])) if any(not on[k] for k in turns) else float(at.min())
    upper = float(np.median([at[k] for k in turns if on[k]])) if any(on[k] for k in turns) else float(at.max())
    if not lower < upper:
        return None
    powers = np.zeros(h.times.size)
    heating = bool(h.power[0] > middle)
    for k, t in enumerate(h.temperature - ICE_POINT):
        heating = t < upper if heating else t < lower
        powers[k] = full if heating else 0.0
    fields = {"power": f"{full!r} [W]", "thermostat": {"on_below": f"{lower!r} [degC]", "off_above": f"{upper!r} [degC]"}}
    none = float("nan")
    coefficients = {"power": (full, none), "on_below": (lower, none), "off_above": (upper, none)}
    formula = f"{full:.4g} W on below {lower:.4g}, off above {upper:.4g} degC"
    return _fed_back(h, "thermostat", formula, coefficients, powers, fields)


PRIORS = ("auto", "walk", "integrated walk")
KNOWN_FORM = "give 'known' as a list of periods (from, to, power), such as [('0 [h]', '1 [h]', '5 [W]')]."
KNOTS = 120
PRIOR_WIDTH = 30.0
"""The history is held to zero by this many times the power that the deck gives (1 W at least), so that every prior is a proper one."""
MAX_HISTORY_ITERATIONS = 12


def power_history(
    model: Model,
    record: Record,
    load: str,
    *,
    scenario: Scenario | None = None,
    known: Sequence[tuple[Any, Any, Any]] = (),
    accuracy: Any = "0.1 [%]",
    free: Sequence[str] = (),
    priors: Mapping[str, Any] | None = None,
    every: str | float = "",
    prior: str = "auto",
) -> PowerHistory:
    """Input estimation: the history of a load's power from a log of temperatures.

    The power is piecewise linear over even knots. Its prior is a random walk, or the integral of one, whose strength has the largest
    marginal likelihood (Wahba, Ann. Stat. 13 (1985) 1378; MacKay, Neural Comp. 4 (1992) 415). With the kernel's derivatives a step is exact
    where the network is linear, and one of Gauss and Newton where it is not.

    Parameters
    ----------
    model : Model           What the hardware is.
    record : Record         Temperatures, and boundaries and powers of other loads.
    load : str              The load whose power is unknown; what its deck says of it is not used.
    scenario : Scenario     What the log does not say.
    known : sequence        (from, to, power) of stretches in which the power was known, with units, times from the first sample.
    accuracy : str          Standard deviation of these powers, in W, or relative in %.
    free : sequence of str  Parameters fitted with the history; stretches of known power are what they are known by.
    priors : dict           Path -> (mean, standard deviation), as in `calibrate`.
    every : str             Spacing of the knots, at most that by default: a 120th of the log, or its sampling where that is coarser.
    prior : str             ``walk`` (for powers that jump), ``integrated walk`` (for smooth ones), or ``auto``: the likelier.

    Raises
    ------
    IdentificationError     When there is no such prior, a stretch lies outside the log, or parameters are free without any known power.
    NameNotFoundError       When there is no such load.
    """
    where = f"power of {load}"
    path, model = _plain(model, load)
    _refuse_unanswerable(record, (load, path), known, prior, bool(free and not priors), where)
    step = max(record.duration / KNOTS, record.step)
    if not isinstance(every, str) or every:
        step = min(step, amount(every, "s", where))
    knots, pins = _knots(record, step, known, accuracy, where)
    nominal = compile_network(model).flat.parameters.evaluate({}).get(f"{path}.power", 0.0)
    base = PRIOR_WIDTH * max(abs(float(nominal)), 1.0)
    kinds = PRIORS[1:] if prior == "auto" else (prior,)

    request, basis = _request_of_knots(model, record, path, scenario, free, priors, knots)
    problem = build_problem(request)
    hats = tuple(Unknown(n, "power", (Influence(0, f"scale.{n}"),), 0.0, unit="W") for n in basis)
    problem = replace(problem, unknowns=(*problem.unknowns, *hats), noise=dict(problem.noise))
    try:
        return _history(request, problem, path, knots, pins, solved(problem, knots, pins, base, kinds))
    except np.linalg.LinAlgError:
        raise _undetermined(free, where) from None


def _refuse_unanswerable(record: Record, names: Sequence[str], stretches: Any, prior: str, is_open: bool, where: str) -> None:
    """Refuse a history of a load by its `names` that has no answer; `is_open` is whether parameters are free without priors.

    Raises
    ------
    IdentificationError   As `power_history` says.
    """
    refuse_unknown([prior], PRIORS, "power_history", "unknown prior '{}'. Use one of {known}.", IdentificationError)
    if is_open and not stretches:
        words = "without a period of known power only ratios to the power can be estimated, so no parameter can be free. "
        raise IdentificationError(f"{words}Give 'known' or a prior.", where, code="fit.not-determined")
    if not isinstance(stretches, list | tuple) or any(not isinstance(one, list | tuple) or len(one) != 3 for one in stretches):
        raise IdentificationError(KNOWN_FORM, where, code="value.wrong-kind")
    logged = next((n for n, c in record.channels.items() if c.role in ("load", "auto") and (c.target or n) in names), "")
    if logged:
        words = f"channel '{logged}' of '{record.name}' already gives this power. Leave it out."
        raise IdentificationError(words, where, code="value.without-effect")


def _undetermined(free: Sequence[str], where: str) -> IdentificationError:
    """Return the refusal of what readings, priors and known powers leave open."""
    what = ", ".join(f"'{p}'" for p in free) or "the power"
    return IdentificationError(
        f"readings, priors and known powers together do not determine {what}. Give priors = {{...}} or a longer period of known "
        "power, or free fewer parameters.",
        where,
        code="fit.not-determined",
    )


def _plain(model: Model, load: str) -> tuple[str, Model]:
    """Return the load's path, and the model in which it is a plain power."""
    path = model.canonical(load)
    loads = {flat_load.path: flat_load for flat_load in compile_network(model).flat.loads}
    refuse_unknown([path], loads, model.title, f"no load '{load}' in {model.title}.", NameNotFoundError)
    heat_load = model.at(path)
    assert isinstance(heat_load, HeatLoad)
    fields = {k: v for k, v in heat_load.fields.items() if k == "power"}
    plain = replace(heat_load, fields=fields, sensor="", curve=None) if fields else watts(heat_load.into, power="1 [W]")
    return path, with_load(model, path, plain)


def _knots(record: Record, step: float, known_powers: Sequence[tuple[Any, Any, Any]], accuracy: Any, where: str) -> tuple[Array, Pins]:
    """Return the times of the knots (knots,) from the first sample [s], and which of them stand at known powers.

    They are `step` [s] apart or a little less or more, so that they fit between where stretches of known power begin and end. There are
    two, a thousandth of `step` apart, since the power jumps. A standard deviation in per cent is of the power, of a thousandth of the
    largest at least. [W]

    Parameters
    ----------
    known_powers : sequence     (first, last, power) of each stretch, such as ("0 [s]", "600 [s]", "0 [W]").
    accuracy                    Standard deviation of those powers, in watts or per cent.

    Raises
    ------
    IdentificationError   When fewer than four intervals fit into the log, or a stretch does not lie in it.
    """
    end = float(record.times[-1] - record.times[0])
    if not 0 < step <= end / 4:
        raise IdentificationError(
            f"knots every {step:g} s do not fit into a log of {end:g} s. Give at least four intervals.", where, code="value.outside-range"
        )
    stretches = [(literal(a, "s", where), literal(b, "s", where), literal(p, "W", where)) for a, b, p in known_powers]
    for first, last, _ in stretches:
        if not -1e-9 <= first < last <= end * (1 + 1e-9):
            raise IdentificationError(
                f"the power was known from {first:g} to {last:g} s, which is not within a log of {end:g} s.",
                where,
                code="value.outside-range",
            )
    cuts = np.unique(np.clip([0.0, end, *(t for a, b, _ in stretches for t in (a, b))], 0.0, end))
    parts: list[Array] = []
    at: list[int] = []
    power: list[float] = []
    for begin, right in pairwise(cuts.tolist()):
        part = np.linspace(begin, right, max(2, round((right - begin) / step) + 1))
        part[0] += 1e-3 * step if parts else 0.0  # a jump
        powers_stated = [p for a, b, p in stretches if a <= 0.5 * (begin + right) <= b]
        if powers_stated:
            at += range(sum(map(len, parts)), sum(map(len, parts)) + part.size)
            power += [powers_stated[-1]] * part.size
        parts.append(part)
    sd = np.array([deviation(accuracy, "W", size, where) for size in np.maximum(np.abs(power), 1e-3 * max([1.0, *np.abs(power)])).tolist()])
    return np.concatenate(parts), Pins(np.array(at, dtype=np.int64), np.array(power), sd, np.cumsum([0, *map(len, parts)]))


def _request_of_knots(
    model: Model,
    record: Record,
    path: str,
    scenario: Scenario | None,
    free: Sequence[str],
    priors: Mapping[str, Any] | None,
    knots: Array,
) -> tuple[Request, list[str]]:
    """Return the request in which each knot (knots,) [s] is a load of 1 W at it, straight to 0 at its neighbours, and the loads' names."""
    heat_load = model.at(path)
    assert isinstance(heat_load, HeatLoad)
    base = on_the_clock_of(record, scenario or Scenario(record.name))
    loads, names = dict(base.loads), []
    for k in range(knots.size):
        name = f"{path}_at_{k}"
        model = with_load(model, name, watts(heat_load.into, power="1 [W]"))
        around = np.unique(np.clip([0, k - 1, k, k + 1, knots.size - 1], 0, knots.size - 1))
        loads[name] = TableSignal(knots[around], np.eye(knots.size)[k, around])
        names.append(name)
    loads[path] = Constant(0.0)
    stated_priors = priors_of(model, priors or {}, f"power of {path}")
    return Request(model, (record,), tuple(free), {"*": base.with_(loads=loads)}, priors=stated_priors, name=f"power of {path}"), names


def _history(request: Request, problem: Problem, path: str, knots: Array, pins: Pins, solution: Solved) -> PowerHistory:
    """Return a power history at `knots` (knots,) [s] with its standard errors [W], the values fitted with it, and a run of the deck by it.

    Its resolution is the median width at half maximum of the smoothing kernel, rows of covariance times information. [s]
    """
    count = knots.size
    first = solution.x.size - count
    power, covariance = solution.x[first:], solution.covariance[first:, first:]
    kernel = (solution.covariance @ solution.seen)[first:, first:]
    open_ = np.setdiff1d(np.arange(count), pins.at)
    width = float(np.median([_half_width(kernel[k], k) for k in open_])) * float(np.median(np.diff(knots)))
    values = {
        u.name: (_shown(u, float(x)), u.slope(float(x)) * float(np.sqrt(v)) / float(unit(u.unit).factor), u.unit)
        for u, x, v in zip(problem.unknowns[:first], solution.x, np.diag(solution.covariance), strict=False)
    }
    flat = compile_network(request.model).flat
    node = next(flat_load.node for flat_load in flat.loads if flat_load.path == path)
    problem = replace(problem, noise=dict(solution.noise))
    blocks = tuple(problem.blocks(solution.x))
    texts = {
        u.name: f"{u.to_value(float(x))!r} [{u.unit}]"
        for u, x in zip(problem.unknowns[:first], solution.x, strict=False)
        if u.kind == "parameter"
    }
    bare = _without(request.model, path).with_values(texts, f"power of {path}")
    starts = {
        u.name.partition("initial.")[2]: Kelvin(x) for u, x in zip(problem.unknowns, solution.x, strict=True) if ": initial." in u.name
    }
    bare_scenario = problem.experiments[0].bare
    loads = {k: v for k, v in bare_scenario.loads.items() if not k.startswith(f"{path}_at_")}
    loads = {**loads, path: TableSignal(knots, power, False)}
    scenario = replace(bare_scenario, loads=loads, initial={**bare_scenario.initial, **starts})
    run = simulate(bare, scenario, times=knots)
    is_known = np.zeros(count, dtype=bool)
    is_known[pins.at] = True
    unsettled = (
        () if solution.converged else (f"the history did not converge within {MAX_HISTORY_ITERATIONS} iterations. Free fewer parameters.",)
    )
    at_bounds = (
        f"'{u.name}' ended at its bound {_shown(u, fitted):.5g} {u.unit}, so its error and the band are not meaningful. Fix "
        "it or give it a prior."
        for u, fitted in zip(problem.unknowns, solution.x.tolist(), strict=True)
        if u.kind == "parameter" and u.bounds_met(fitted)
    )
    notes = (*unsettled, *at_bounds, *solution.remarks)
    return PowerHistory(
        path, node, knots, power, covariance, run[node].kelvin, is_known, width, solution.prior, values, blocks, bare, scenario, notes
    )


def _shown(unknown: Unknown, fitted: float) -> float:
    """Return a fitted value in its unit."""
    of = unit(unknown.unit)
    return (unknown.to_value(fitted) - float(of.offset)) / float(of.factor)


def _half_width(row: Array, at: int) -> float:
    """Return the full width at half maximum [knots] of a smoothing kernel, `row` (knots,), about its knot `at`, straight between knots.

    Where a side does not fall to half, the knots up to its end count.
    """
    half, out = 0.5 * row[at], 0.0
    for side in (row[at:], row[at::-1]):
        below = np.flatnonzero(side < half)
        last = int(below[0]) if below.size else side.size
        out += last - 1 + ((side[last - 1] - half) / (side[last - 1] - side[last]) if below.size else 0.0)
    return float(out)


def _without(model: Model, path: str) -> Model:
    """Return the model without the loads of the knots."""
    return _with_loads(model, path, lambda loads, name: {n: v for n, v in loads.items() if not n.startswith(f"{name}_at_")})


@dataclass(frozen=True, eq=False)
class Pins:
    """Knots whose power is known: positions, powers [W], standard deviations [W]; and where the sections between jumps begin and end."""

    at: NDArray[np.int64]
    power: Array
    sd: Array
    sections: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Solved:
    """The end: values of all unknowns, their covariance, what the data see of them, the prior that was taken, and what to say of noise."""

    x: Array
    covariance: Array
    seen: Array
    prior: str
    converged: bool
    strength: float = 0.0
    remarks: tuple[str, ...] = ()
    noise: Mapping[str, float] = field(default_factory=dict)


MAX_WEIGHED_STRETCHES = 200
"""Stretches of time at most in which readings with noise that is not white are weighed."""
COLOURS, SIZES = 4, (0.1, 0.5, 2.0, 10.0, 50.0, 300.0, 2000.0)
"""Correlation times, and variances of autocorrelated noise in squares of the white noise, that are tried."""
MIN_INPUT_NOISE_SHARE = 0.05
"""Part of the variance of a mean of readings from which noise of logged inputs counts."""


@dataclass(frozen=True, eq=False)
class Colour:
    """Noise that is not white, as the lower root of the covariance of the means over stretches."""

    root: Array
    logdet: float

    def rows(self, pieces: Mapping[tuple[str, str], Binned]) -> tuple[Array, Array]:
        """Return derivatives L^-1 J (stretches, unknowns) and residuals L^-1 r (stretches,), L L' the covariance: their noise has size 1.

        All traces of `pieces`, one after the other.
        """
        from scipy.linalg import solve_triangular

        slopes, means = np.concatenate([b.slopes for b in pieces.values()]), np.concatenate([b.mean for b in pieces.values()])
        white = solve_triangular(self.root, np.column_stack([slopes, means]), lower=True, check_finite=False)
        return white[:, :-1], white[:, -1]


def _rows(problem: Problem, x: Array, colour: Colour | None) -> tuple[Array, Array]:
    """Return derivatives (rows, unknowns) and residuals (rows,) of the data at values `x`, whitened by `colour`, else compressed."""
    if colour is not None:
        return colour.rows(Binned.of_problem(problem, x, bins=MAX_WEIGHED_STRETCHES))
    compressed_problem = problem.compressed(x)
    return compressed_problem.slopes, compressed_problem.rows


def solved(problem: Problem, knots: Array, pins: Pins, base: float, priors: Sequence[str]) -> Solved:
    """Return the unknowns of a problem whose last are the powers at the knots, by the noise that its readings show.

    Readings without a stated noise have that of what the history leaves. Then the noise is looked for that is likeliest together with the
    prior's strength: autocorrelated or not, beside rounding to steps and noise of logged inputs, which are known.

    Raises
    ------
    IdentificationError   When the readings say nothing of an unknown.
    """
    solution = _in_rounds(problem, _with_heat(problem, knots, pins, base, priors[0]), knots, pins, base, priors, None)
    if not all(o.noise is not None for o in problem.observations()):
        problem = replace(problem, noise=_residual_noise(problem, solution))
    pieces = Binned.of_problem(problem, solution.x, bins=MAX_WEIGHED_STRETCHES)
    inputs = answers_to_inputs(problem, solution.x, pieces)
    best, remarks = _colour(problem, solution, knots, pins, base, pieces, inputs)
    if best is None:
        return replace(solution, noise=problem.noise)
    again = _in_rounds(problem, solution.x, knots, pins, base, priors, best)
    return replace(again, remarks=remarks, noise=problem.noise)


def _with_heat(problem: Problem, knots: Array, pins: Pins, base: float, prior: str) -> Array:
    """Return the start of the unknowns (unknowns,), fitted form: their own values, beside parameters with the history that fits these.

    Without heat a conductance between two equal temperatures and a mass that stays at one change nothing. `knots`, `base` and `prior` as
    in `_likeliest`.
    """
    x = np.array([u.to_fitted(u.start) for u in problem.unknowns])
    if not any(u.kind == "parameter" for u in problem.unknowns):
        return x
    first = x.size - knots.size
    sides = [(a[:, first:], g - a[:, :first] @ x[:first]) for a, g in _weighted_equations(problem, x, pins, *_rows(problem, x, None))]
    return np.append(x[:first], _likeliest(sides, np.zeros(knots.size), knots, pins, base, prior)[2])


def _residual_noise(problem: Problem, solution: Solved) -> dict[str, float]:
    """Return sensor -> noise: the scatter of its residuals, what the history took of their freedom given back. [K]

    sqrt(mean r^2 n / (n - p)), p = tr(C A'A) the unknowns that n readings determine, C their covariance.
    """
    worth = float(np.trace(solution.covariance @ solution.seen))
    grown = np.sqrt(problem.samples / max(problem.samples - worth, 1.0))
    sizes: dict[str, list[Array]] = {}
    for b in problem.blocks(solution.x):
        sizes.setdefault(b.sensor, []).append(b.residuals)
    return {s: max(float(grown * np.sqrt(np.mean(np.concatenate(r) ** 2))), 1e-6) for s, r in sizes.items()}


def _colour(
    problem: Problem,
    solution: Solved,
    knots: Array,
    pins: Pins,
    base: float,
    pieces: Mapping[tuple[str, str], Binned],
    inputs: Mapping[tuple[str, str], Array],
) -> tuple[Colour | None, tuple[str, ...]]:
    """Return the likeliest coloured noise about a history, and remarks on it; None where white noise is as likely.

    Its time [s] is one of `COLOURS` from twice the spacing of the bins to a quarter of the longest trace, its variance in parts of the
    white noise one of `SIZES`, then one of five factors of it; each is judged at its best smoothness within six decades of that found with
    white noise. It counts where 2 ln of the likelihood gains more than `MIN_LIKELIHOOD_GAIN`.

    Parameters
    ----------
    knots : array (knots,)      Instants of the history. [s]
    base : float                Standard deviation of a knot before. [W]
    pieces : dict               (record, sensor) -> its binned residuals. [K]
    inputs : dict               (record, sensor) -> answers of its bins to the noise of inputs. [K]
    """
    spans = [b.times for b in pieces.values()]
    spacing, span = float(np.median(np.diff(spans[0]))), max(float(t[-1] - t[0]) for t in spans)

    def make(time: float, size: float) -> Colour:
        """Return coloured noise of a correlation time [s] and size [K]."""
        traces = tuple(TraceNoise(*key, 0, 1.0, size, time, 0.0) for key in pieces)
        root: Array = np.asarray(np.linalg.cholesky(covariance_of_means(pieces, traces, inputs)), dtype=float)
        return Colour(root, 2.0 * float(np.log(np.diag(root)).sum()))

    def likely(colour: Colour) -> float:
        """Return the log likelihood of the history under coloured noise, at its best smoothness within six decades. [-]"""
        sides, force = _weighted_equations(problem, solution.x, pins, *colour.rows(pieces)), np.zeros(solution.x.size)
        near = solution.strength + np.arange(-6.0, 7.0, 1.5)
        return _likeliest(sides, force, knots, pins, base, solution.prior, near)[0] - 0.5 * colour.logdet

    plain = make(spacing, 0.0)
    tried = {(0.0, 0.0): likely(plain)}
    for time in np.geomspace(2.0 * spacing, 0.25 * span, COLOURS).tolist():
        for size in SIZES:
            tried[time, size] = likely(make(time, size))
    (time, size), value = max(tried.items(), key=lambda item: item[1])
    # of the sum over a trace, how much more noise of inputs adds than the readings have by themselves
    shares = [float(np.sum((pieces[key].count @ h) ** 2) / pieces[key].count.sum()) for key, h in inputs.items()]
    matters = any(b.shares_rounding for b in pieces.values()) or max(shares, default=0.0) > MIN_INPUT_NOISE_SHARE
    if 2.0 * (value - tried[0.0, 0.0]) <= MIN_LIKELIHOOD_GAIN:
        return (plain if matters else None), ()
    finer = {(time, size * f): likely(make(time, size * f)) for f in (0.4, 0.63, 1.0, 1.6, 2.5)}
    time, size = max(finer, key=lambda key: finer[key])
    noise = max(o.sigma(problem.noise) for o in problem.observations())
    words = (
        f"the residuals of the history are autocorrelated, by {short(np.sqrt(size) * noise)} K over {duration_text(time)}. Possible "
        "causes: noise that is not white, knots too far apart, or missing physics. The band includes this as noise."
    )
    return make(time, size), (words,)


def _weighted_equations(problem: Problem, x: Array, pins: Pins, slopes: Array, rows: Array) -> list[tuple[Array, Array]]:
    """Return A and g of the linearised sums of squares ``|A z - g|^2`` over new unknowns z: data, priors, stretches of known power. [-]

    With derivatives J, `slopes` (rows, unknowns), and residuals r, `rows` (rows,), at x (unknowns,), fitted form, ``A = J`` and ``g = J x
    - r``; known powers P give ``(z_k - P) / sd``.
    """
    prior_residuals, prior = problem.prior_rows(x)
    pinned = np.zeros((pins.at.size, x.size))
    pinned[np.arange(pins.at.size), x.size - pins.sections[-1] + pins.at] = 1.0 / pins.sd
    return [(slopes, slopes @ x - rows), (prior, prior @ x - prior_residuals), (pinned, pins.power / pins.sd)]


def _in_rounds(problem: Problem, x: Array, knots: Array, pins: Pins, base: float, priors: Sequence[str], colour: Colour | None) -> Solved:
    """Return the unknowns (unknowns,), fitted form, by Gauss and Newton's method from `x`, the prior's strength anew in every round.

    The strength is that of the largest marginal likelihood. It has converged where no unknown moves by more than a hundredth of its
    standard error; `MAX_HISTORY_ITERATIONS` rounds at most. Where no noise is stated, its level is chi^2 / (n - tr(H^-1 A'A)). `knots`
    (knots,) are times [s], `base` is the standard deviation of a knot before [W].
    """
    low, high = (np.array(b) for b in zip(*(u.fitted_bounds() for u in problem.unknowns), strict=True))
    levelled = colour is None and any(o.noise is None for o in problem.observations())
    theta = [k for k, u in enumerate(problem.unknowns) if u.kind == "parameter"]
    force = np.zeros(x.size)
    for _ in range(MAX_HISTORY_ITERATIONS):
        slopes, rows = _rows(problem, x, colour)
        sides = _weighted_equations(problem, x, pins, slopes, rows)
        level = 1.0
        for _ in range(4 if levelled else 1):
            scaled = [(a / np.sqrt(level), g / np.sqrt(level)) if k == 0 else (a, g) for k, (a, g) in enumerate(sides)]
            _refuse_undetermined(problem, scaled, knots.size)
            best = max((_likeliest(scaled, force, knots, pins, base, p) for p in priors), key=lambda f: f[0])
            _, taken, z, covariance, strength = best
            if levelled:
                residuals = sides[0][0] @ z - sides[0][1]
                data = scaled[0][0].T @ scaled[0][0]
                # tr(H^-1 A'A): how many of the readings the unknowns take (effective parameters); the rest are degrees of freedom
                worth = float(np.sum(covariance * data))
                level = float(residuals @ residuals) / max(problem.samples - worth, 1.0)
        z = np.clip(z, low, high)
        force = _margin(problem, x, slopes / np.sqrt(level), covariance, theta, level, colour)
        step, x = z - x, z
        sd = np.sqrt(np.diag(covariance))
        if (np.abs(step) < 0.01 * sd + 1e-9 * np.abs(x)).all():
            converged = True
            break
    else:
        converged = False
    information = np.asarray(scaled[0][0].T @ scaled[0][0])
    return Solved(x, covariance, information, taken, converged, strength)


def _refuse_undetermined(problem: Problem, sides: Sequence[tuple[Array, Array]], count: int) -> None:
    """Refuse unknowns beside the history of which readings, priors and known powers say nothing."""
    rows = np.concatenate([a for a, _ in sides])[:, :-count]
    if not rows.shape[1]:
        return
    blind = np.flatnonzero(~np.isfinite(np.diag(information_inverse(rows, NOTHING))))
    if blind.size:
        names = ", ".join(f"'{problem.unknowns[k].name}'" for k in blind.tolist())
        raise IdentificationError(
            f"the readings do not determine {names} together with the power. Give a prior (priors = {{...}}), a period of known power, or "
            "fix it.",
            problem.experiments[0].record.name,
            code="fit.not-determined",
        )


def _margin(
    problem: Problem, x: Array, slopes: Array, covariance: Array, theta: Sequence[int], level: float, colour: Colour | None
) -> Array:
    """Return what the logarithm of the margin over the history adds to the derivatives (unknowns,) of the parameters. [1 / fitted form]

    The mode of history and parameters together is not that of the parameters alone: a smaller capacitance makes a smoother history, which
    its prior likes, though the readings then say more of it. The margin holds the one against the other: ``-1/2 d log|H| / d parameter``,
    H the information on all else: the inverse of their covariance where the parameters are known. By a difference of 1/1000 of its scale.

    Parameters
    ----------
    x : array (unknowns,)                   Fitted form.
    slopes : array (rows, unknowns)         Derivatives of weighted residuals there.
    covariance : array (unknowns, unknowns)
    theta : sequence                        Places of the parameters.
    level : float                           Variance of weighted residuals. [-]
    colour : Colour or None                 Noise that weighs them.
    """
    out = np.zeros(x.size)
    places = np.array(theta, dtype=np.int64)
    others = np.setdiff1d(np.arange(x.size), places)
    across = covariance[np.ix_(others, places)]
    inverse = covariance[np.ix_(others, others)] - across @ np.linalg.solve(covariance[np.ix_(places, places)], across.T)
    here = slopes[:, others].T @ slopes[:, others]
    for k in theta:
        moved = x.copy()
        moved[k] += 1e-3 * problem.unknowns[k].scale
        there = _rows(problem, moved, colour)[0][:, others]
        out[k] = -0.5 * float(np.sum(inverse * (there.T @ there / level - here))) / (moved[k] - x[k])
    return out


def _likeliest(
    sides: Sequence[tuple[Array, Array]], force: Array, knots: Array, pins: Pins, base: float, prior: str, strengths: Array | None = None
) -> tuple[float, str, Array, Array, float]:
    """Return the largest logarithm of the marginal likelihood over a prior's strength, its name, the unknowns, their covariance, and it.

    `sides` are pairs of derivatives A and residuals g of the data, `force` the pull of other priors. The prior of the knots is
    S = 10^s D'D + base^-2 with the differences D of first order ("walk") or second; the unknowns are b = H^-1 (A'g + force) with
    H = A'A + S, their covariance is H^-1, and s is where ``(ln|S| - ln|H| - (|g|^2 - b'H b)) / 2`` is largest (MacKay, Neural
    Computation 4 (1992) 415). D'D is scaled to the trace of A'A. `strengths` are the s that are tried; by default a wide grid, and
    then a fine one.
    """
    size, count = sides[0][0].shape[1], knots.size
    first = size - count
    apart, stepped = _differences(knots, pins, 1 if prior == "walk" else 2)
    basis = np.eye(size)  # the unknowns, with differences of knots in place of knots: a stiff prior is a diagonal there
    basis[first:, first:] = np.linalg.inv(apart)
    rows = [a @ basis for a, _ in sides]
    data = sum((a.T @ a for a in rows), np.zeros((size, size)))
    right = sum((a.T @ g for a, (_, g) in zip(rows, sides, strict=True)), basis.T @ force)
    square = float(sum(g @ g for _, g in sides))
    held = basis[first:, first:].T @ basis[first:, first:] / base**2
    rough = float(np.sum(stepped[:, None] * apart**2))  # trace of D'D
    scale = float(np.sum(sides[0][0][:, first:] ** 2)) / max(rough, 1e-300)

    def at(strength: float) -> tuple[float, Array, Array, Array]:
        """Return the log evidence at a strength [decades] of the smoothness, the solution (unknowns,), its scaled matrix and scales."""
        smooth = held + np.diag(scale * 10.0**strength * stepped)
        h = data.copy()
        h[first:, first:] += smooth
        # both are solved with ones on their diagonals: over twelve decades of strength the evidence would lose its digits
        smooth_scale, by = (1.0 / np.sqrt(np.maximum(np.diag(m), 1e-300)) for m in (smooth, h))
        level, even = smooth * smooth_scale * smooth_scale[:, None], h * by * by[:, None]
        z = by * np.linalg.solve(even, by * right)
        # evidence of a linear model: 2 ln p = ln|S| - ln|H| - (|g|^2 - b'H^-1 b), S the prior's precision, H = A'A + S
        # (MacKay, Neural Computation 4 (1992) 415); a change of basis leaves the ratio of the determinants as it is
        sizes = [float(np.linalg.slogdet(m)[1] - 2.0 * np.log(d).sum()) for m, d in ((level, smooth_scale), (even, by))]
        return 0.5 * (sizes[0] - sizes[1] - (square - float(right @ z))), np.asarray(z), even, by

    _, strength = max((at(s)[0], s) for s in (np.arange(-8.0, 8.01, 0.5) if strengths is None else strengths).tolist())
    if strengths is None:
        _, strength = max((at(s)[0], s) for s in (strength + np.arange(-0.5, 0.51, 0.05)).tolist())
    value, z, even, by = at(strength)
    back = basis * by
    return value, prior, basis @ z, np.asarray(back @ np.linalg.inv(even) @ back.T), strength


def _differences(knots: Array, pins: Pins, order: int) -> tuple[Array, Array]:
    """Return the matrix (knots, knots) of differences of the first or second order, and 1 where a row is one: none reach across a jump.

    The other rows are the knots with which each section begins, so that the matrix has an inverse.
    """
    out, stepped = np.eye(knots.size), np.zeros(knots.size)
    for first, last in pairwise(pins.sections.tolist()):
        if last - first > order:
            rows = np.diff(np.eye(last - first), n=order, axis=0) / float(np.diff(knots[first:last]).mean()) ** (order - 0.5)
            out[first + order : last, first:last] = rows
            stepped[first + order : last] = 1.0
    return out, stepped
