"""`PowerHistory`: the power of a load over time as a log shows it, how well, how finely, and which law it follows."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from thermid.errors import IdentificationError, ThermidError
from thermid.fit.problem.residuals import SensorTrace
from thermid.linear_algebra import Array, Bools
from thermid.model.deck.modelfile import model_from_dict
from thermid.model.laws.signal import literal
from thermid.model.parts.elements import HeatLoad
from thermid.model.tree.model import Model
from thermid.physics.constants import ICE_POINT
from thermid.simulation.scenarios.scenario import Scenario
from thermid.simulation.transient import simulate

STARTS = 12
TURN = 0.05
"""Half the width of the rounded turn of a V. [K]"""
Formula = Callable[[Array, Array], Array]


@dataclass(frozen=True, eq=False)
class PowerHistory:
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
        """Return the middle of every whole window [s], and the weights (windows, knots) of the knots in its mean power.

        Raises
        ------
        IdentificationError   When a window is narrower than two knots or wider than the log.
        """
        width, steps = literal(window, "s", "window"), np.diff(self.times)
        count = int(self.times[-1] / width + 1e-9)
        if width < 0.99 * float(np.median(steps)) or count < 1:
            raise IdentificationError(
                f"a window of {window} does not fit knots every {np.median(steps):g} s over {self.times[-1]:g} s.", self.load
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
        return middle, np.asarray(weights @ self.power), np.asarray(np.sqrt(np.einsum("ij,jk,ik->i", weights, self.covariance, weights)))

    @property
    def rmse(self) -> dict[str, float]:
        """Sensor -> RMS of measured less predicted. [K]"""
        return {b.sensor: float(np.sqrt(np.mean(b.residuals**2))) for b in self.blocks}

    def laws(self) -> tuple[PowerLaw, ...]:
        """Return laws of the power over the node's temperature fitted to the history where it was unknown, the likeliest first."""
        return fitted_laws(self)

    def __str__(self) -> str:
        """Return its size, error and resolution, what was fitted with it, and warnings."""
        open_ = ~self.known
        lines = [
            f"power of {self.load}: mean {self.power[open_].mean():.4g} W, from {self.power[open_].min():.4g} to "
            f"{self.power[open_].max():.4g} W where it was unknown ({self.prior})",
            f"  error of a moment {np.median(self.sd[open_]):.2g} W (1 sd); resolution {self.resolution / 60:.3g} min: "
            "faster changes are shown smeared over that time",
        ]
        for name, (value, error, unit) in self.values.items():
            lines.append(f"  {name} {value:.5g} +- {error:.2g} {unit}")
        lines += [f"  {sensor}: RMSE {size:.3g} K" for sensor, size in self.rmse.items()]
        return "\n".join([*lines, *(f"  warning: {w}" for w in self.warnings)])

    def plot(self, axes: Any = None) -> Any:
        """Return the axes of a figure: the history with its 95 % band over hours, known stretches grey."""
        from matplotlib.figure import Figure

        axes = axes if axes is not None else Figure(figsize=(8, 3.6), layout="constrained").subplots()
        hours = self.times / 3600.0
        axes.fill_between(hours, self.power - 1.96 * self.sd, self.power + 1.96 * self.sd, color="#9ecae1", label="95 %", linewidth=0)
        axes.plot(hours, self.power, color="#08519c", label="recovered")
        low, high = axes.get_ylim()
        axes.fill_between(hours, low, high, where=self.known, color="0.85", label="power known", zorder=0, linewidth=0)
        axes.set_ylim(low, high)
        axes.set_xlabel("time [h]")
        axes.set_ylabel(f"{self.load} [W]")
        axes.legend(frameon=False)
        return axes


@dataclass(frozen=True, eq=False)
class PowerLaw:
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
        left = ", ".join(f"{s} {v:.3g} K" for s, v in self.rmse.items())
        return f"{self.name}: {self.formula}   left in the readings: {left}"


def with_load(model: Model, path: str, load: HeatLoad) -> Model:
    """Return the model with a load in place of the one at a path, or beside the others."""
    part, _, name = path.rpartition(".")
    inner = model.submodel(part) if part else model
    changed = replace(inner, loads={**inner.loads, name: load})
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
        initial={n: float(whole[n].kelvin[first]) for n in nodes},
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


def fitted_laws(h: PowerHistory) -> tuple[PowerLaw, ...]:
    """Return all laws fitted to a history, the likeliest first; those with which the model cannot be run are left out."""
    fits = [f(h) for f in (_constant, _linear, _exponential, _vee, _proportional, _thermostat)]
    return tuple(sorted((f for f in fits if f is not None), key=lambda f: f.akaike))


def _means(h: PowerHistory) -> tuple[Array, Array, Array, Array]:
    """Return temperature [degC] and power at the knots where it was unknown, the weights of means over the resolution, their covariance."""
    open_ = ~h.known
    weights = h.weights(f"{max(h.resolution, float(np.median(np.diff(h.times))))!r} [s]")[1]
    clear = weights[:, h.known].sum(axis=1) < 1e-9
    weights = weights[clear][:, open_]
    return h.temperature[open_] - ICE_POINT, h.power[open_], weights, weights @ h.covariance[np.ix_(open_, open_)] @ weights.T


def _best(h: PowerHistory, law: Formula, starts: list[list[float]]) -> tuple[Array, Array] | None:
    """Return coefficients and standard errors of the best of several descents."""
    from scipy.optimize import least_squares

    at, power, weights, covariance = _means(h)
    sd = np.sqrt(np.diag(covariance))

    def misses(b: Array) -> Array:
        return np.asarray(weights @ (power - law(at, b)) / sd)

    found = []
    for start in starts:
        with np.errstate(all="ignore"):
            try:
                end = least_squares(misses, start, x_scale="jac", max_nfev=400)
            except ValueError:  # the start gives no finite power
                continue
        found.append(end)
    if not found:
        return None
    best = min(found, key=lambda f: f.cost)
    level = max(1.0, 2.0 * best.cost / max(best.fun.size - best.x.size, 1))
    # each mean by its own error, since a wrong law is wrong in all of them; that their errors hang together widens the result
    solver = np.linalg.pinv(np.asarray(best.jac))
    errors = np.sqrt(np.diag(solver @ (covariance / np.outer(sd, sd)) @ solver.T) * level)
    return np.asarray(best.x), errors


def _law(h: PowerHistory, name: str, law: Formula, starts: list[list[float]], names: tuple[str, ...], write: Any) -> PowerLaw | None:
    found = _best(h, law, starts)
    if found is None:
        return None
    b, errors = found
    formula, fields = write([float(v) for v in b])
    coefficients = {n: (float(v), float(e)) for n, v, e in zip(names, b, errors, strict=True)}
    return _fed_back(h, name, formula, coefficients, law(h.temperature - ICE_POINT, b), fields)


def _fed_back(
    h: PowerHistory, name: str, formula: str, coefficients: dict[str, tuple[float, float]], power: Array, fields: dict[str, Any]
) -> PowerLaw | None:
    """Return a law judged by the readings: what the model leaves of them with the law as its load."""
    given = h.model.at(h.load)
    assert isinstance(given, HeatLoad)
    model = with_load(h.model, h.load, watts(given.into, **fields))
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
    _, _, mean, _ = _spread(h)
    return _law(h, "constant", lambda t, b: b[0] + 0.0 * t, [[mean]], ("power",), lambda b: (f"{b[0]:.4g} W", {"power": f"{b[0]!r} [W]"}))


def _linear(h: PowerHistory) -> PowerLaw | None:
    low, high, mean, _ = _spread(h)
    middle = 0.5 * (low + high)

    def write(b: list[float]) -> tuple[str, dict[str, Any]]:
        fields = {
            "power": f"{b[0]!r} [W]",
            "temperature_coefficient": f"{b[1] / b[0]!r} [1/K]",
            "reference_temperature": f"{middle!r} [degC]",
        }
        return f"{b[0]:.4g} W {b[1]:+.3g} W/K (T - {middle:.4g} degC)", fields

    return _law(h, "linear", lambda t, b: b[0] + b[1] * (t - middle), [[mean, 0.0]], ("power", "slope"), write)


def _exponential(h: PowerHistory) -> PowerLaw | None:
    low, high, mean, _ = _spread(h)
    middle = 0.5 * (low + high)

    def write(b: list[float]) -> tuple[str, dict[str, Any]]:
        fields = {"power": f"{b[0]!r} [W]", "exponential_coefficient": f"{b[1]!r} [1/K]", "reference_temperature": f"{middle!r} [degC]"}
        return f"{b[0]:.4g} W exp({b[1]:+.3g} 1/K (T - {middle:.4g} degC))", fields

    def law(t: Array, b: Array) -> Array:
        return np.asarray(b[0] * np.exp(np.clip(b[1] * (t - middle), -50.0, 50.0)))

    return _law(h, "exponential", law, [[mean, 0.01], [mean, -0.01]], ("power", "exponential_coefficient"), write)


def _vee(h: PowerHistory) -> PowerLaw | None:
    """A thermoelectric cooler takes power on both sides of the temperature at which it need not work."""
    low, high, mean, top = _spread(h)
    wide = max(high - low, 0.1)

    def write(b: list[float]) -> tuple[str, dict[str, Any]]:
        ends = (min(low, b[2]) - wide, b[2] - TURN, b[2] + TURN, max(high, b[2]) + wide)
        slopes = (-b[1], -b[1], b[1], b[1])  # else the table would round the turn
        points = [[f"{t!r} [degC]", f"{b[0] + b[1] * abs(t - b[2])!r} [W]", f"{s!r} [W/K]"] for t, s in zip(ends, slopes, strict=True)]
        return f"{b[0]:.4g} W {b[1]:+.3g} W/K |T - {b[2]:.4g} degC|", {"table": {"over": "temperature", "points": points}}

    starts = [[0.5 * mean, (top - mean) / wide + 1e-3, low + wide * k / (STARTS - 1)] for k in range(STARTS)]
    return _law(h, "V-shaped", lambda t, b: b[0] + b[1] * np.abs(t - b[2]), starts, ("power", "slope", "turning_point"), write)


def _proportional(h: PowerHistory) -> PowerLaw | None:
    """A heater that asks for power in proportion to what is missing to a set point, between zero and its largest power."""
    low, high, _, top = _spread(h)
    wide = max(high - low, 0.1)

    def write(b: list[float]) -> tuple[str, dict[str, Any]]:
        fields = {"power": f"{b[2]!r} [W]", "proportional": {"gain": f"{b[0]!r} [W/K]", "setpoint": f"{b[1]!r} [degC]"}}
        return f"{b[0]:.4g} W/K below {b[1]:.4g} degC, at most {b[2]:.4g} W", fields

    starts = [[top / (wide * f), s, top] for f in (0.1, 0.3, 1.0) for s in np.linspace(low + 0.1 * wide, high + 0.5 * wide, STARTS)]
    names = ("gain", "setpoint", "power")
    found = _law(h, "proportional", lambda t, b: np.clip(b[0] * (b[1] - t), 0.0, max(b[2], 0.0)), starts, names, write)
    return found if found is not None and found.coefficients["gain"][0] > 0 else None


def _thermostat(h: PowerHistory) -> PowerLaw | None:
    """On below, off above: levels from the two halves of the powers, switching temperatures from where they change."""
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
    said = np.zeros(h.times.size)
    heating = bool(h.power[0] > middle)
    for k, t in enumerate(h.temperature - ICE_POINT):
        heating = t < upper if heating else t < lower
        said[k] = full if heating else 0.0
    fields = {"power": f"{full!r} [W]", "thermostat": {"on_below": f"{lower!r} [degC]", "off_above": f"{upper!r} [degC]"}}
    none = float("nan")
    coefficients = {"power": (full, none), "on_below": (lower, none), "off_above": (upper, none)}
    formula = f"{full:.4g} W on below {lower:.4g}, off above {upper:.4g} degC"
    return _fed_back(h, "thermostat", formula, coefficients, said, fields)
