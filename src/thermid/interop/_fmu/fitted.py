"""Parameters of anybody's FMU fitted to readings: the minimisation, errors and refusals of thermid over the outputs of FMPy's runs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from thermid.base.arguments import takes_objects
from thermid.base.errors import IdentificationError, SolverError, ThermidError, nearest
from thermid.base.expression import si_value
from thermid.base.files import read_bytes, scratch
from thermid.base.linear_algebra import HALF_WIDTH_95, Array, null_space
from thermid.base.units import unit
from thermid.fit.calibration import Fit, minimise
from thermid.fit.problem import Compressed, Sums, Unknown, wanders
from thermid.fit.uncertainty import covariance_with_noise
from thermid.interop._fmu.host import fmpy_package

STEP: Final = 1e-3
"""Part of a value by which it is moved for a difference. [-]"""
TOLERANCE: Final = 1e-8
"""Relative tolerance that is asked of the FMU, or of CVode."""
MISSED: Final = 1.5
"""Ratio of residuals to stated noise from which the first line says that the model misses its readings."""


@dataclass(frozen=True, eq=False)
class FittedFmu:
    """Parameters of an FMU as readings tell them.

    Parameters
    ----------
    title : str             Of the FMU.
    values : dict           Parameter -> value, in the unit of the FMU.
    errors : dict           Parameter -> standard error; infinite where the readings do not tell it.
    rms : dict              Output -> RMS of its residuals, in its unit.
    noise : dict            Output -> the standard deviation it was weighed by, in its unit.
    ratio : float           Residuals over that noise (the root of the reduced chi-square). [-]
    dependent : tuple       Outputs whose residuals are autocorrelated: white noise and a part that wanders, as in every fit.
    undetermined : tuple    Groups of parameters that only combinations of are determined.
    bounds : tuple of str   Parameters that ended at a bound.
    converged : bool
    message : str           How the search ended.
    runs : int              How often the FMU was run.
    """

    title: str
    values: Mapping[str, float]
    errors: Mapping[str, float]
    rms: Mapping[str, float]
    noise: Mapping[str, float]
    ratio: float
    dependent: tuple[str, ...]
    undetermined: tuple[tuple[str, ...], ...]
    bounds: tuple[str, ...]
    converged: bool
    message: str
    runs: int

    @property
    def remarks(self) -> tuple[str, ...]:
        """What stands first: why the values may not be what they seem."""
        out = [] if self.converged else [f"NOT CONVERGED: {self.message}"]
        out += [f"NOT DETERMINED: {' and '.join(group)}; the readings tell a combination alone" for group in self.undetermined]
        out += [f"AT A BOUND: {name}" for name in self.bounds]
        if self.ratio > MISSED:
            out.append(f"NOT ADEQUATE: the residuals are {self.ratio:.3g} times the noise; errors are widened by that")
        if self.dependent:
            out.append(f"residuals of {', '.join(self.dependent)} are autocorrelated: the errors count neighbouring readings as dependent")
        return tuple(out)

    def to_dict(self) -> dict[str, Any]:
        """Return it as JSON holds it."""
        return {
            "title": self.title,
            "remarks": list(self.remarks),
            "values": dict(self.values),
            "errors": {n: e if np.isfinite(e) else None for n, e in self.errors.items()},
            "rms": dict(self.rms),
            "noise": dict(self.noise),
            "ratio": self.ratio,
            "converged": self.converged,
            "runs": self.runs,
        }

    def __str__(self) -> str:
        """Remarks, then each value with its 95 % range, then residuals."""
        lines = [*self.remarks, f"{self.title}: {len(self.values)} parameters, {self.runs} runs"]
        for name, value in self.values.items():
            error = self.errors[name]
            lines.append(
                f"  {name}  {value:.6g} +- {HALF_WIDTH_95 * error:.2g}" if np.isfinite(error) else f"  {name}  {value:.6g}, not determined"
            )
        return "\n".join([*lines, *(f"  {name}  rms {rms:.4g}, noise {self.noise[name]:.4g}" for name, rms in self.rms.items())])


@takes_objects
def calibrate_fmu(
    file: str | Path,
    times: Array,
    readings: Mapping[str, Array],
    noise: Mapping[str, Any],
    parameters: Mapping[str, tuple[float, float]],
    start: Mapping[str, float] | None = None,
    inputs: tuple[Array, Mapping[str, Array]] | None = None,
) -> FittedFmu:
    """Fit parameters of an FMU of FMI 2 or 3 to readings of its outputs.

    Derivatives are central differences of runs. Errors are those of least squares with the stated noise, widened by residuals that
    exceed it or wander, as those of every fit are.

    Parameters
    ----------
    file : path             The FMU. It is a program: run those that you trust.
    times : array (times,)  From zero, in equal steps. [s]
    readings : dict         Output -> readings (times,), in its unit; NaN for none.
    noise : dict            Output -> their standard deviation: a text or another value with a unit, ``"0.05 [K]"``, or a number in the unit
                            of the output.
    parameters : dict       Parameter -> lowest and highest value; the search begins at the start value of the FMU, or of `start`.
    start : dict            Parameter or state -> value, for the whole run or to begin the search at.
    inputs : times and dict Times [s] and input -> values there, joined by straight lines; what is not given keeps its start.

    Raises
    ------
    MissingExtraError       When FMPy is not installed.
    UnitError               When a noise has another dimension than its output, or is given as a temperature on a scale.
    IdentificationError     When nothing is asked for, a name or a length does not fit, or a parameter has no room.
    SolverError             When the FMU cannot be run.
    """
    runner = _Runner(fmpy_package(), Path(file), np.asarray(times, dtype=float), tuple(readings), dict(start or {}), inputs)
    asked = {name: np.asarray(values, dtype=float) for name, values in readings.items()}
    with runner.opened():
        sizes = {name: _in_unit_of(runner.variable(name), size) for name, size in noise.items()}
        problem = _Problem(runner, asked, sizes, _unknowns(runner, parameters))
        found = minimise(problem)
        return _told(problem, found)


class _Runner:
    """An FMU, unpacked once, and its runs."""

    def __init__(
        self,
        fmpy: Any,
        file: Path,
        times: Array,
        outputs: Sequence[str],
        start: dict[str, float],
        inputs: tuple[Array, Mapping[str, Array]] | None,
    ) -> None:
        read_bytes(file)
        self.fmpy, self.file, self.times, self.outputs, self.start = fmpy, file, times, tuple(outputs), start
        gaps = np.diff(times)
        if times.size < 2 or times[0] != 0.0 or not np.allclose(gaps, gaps[0], rtol=1e-6):
            raise IdentificationError("readings of an FMU begin at zero and have equal steps. Resample them.", str(file))
        self.described = self._read()
        self.known = {v.name: v for v in self.described.modelVariables}
        for name in (*outputs, *start, *(inputs[1] if inputs is not None else ())):
            self.variable(name)
        self.inputs = self._table(inputs)
        self.runs = 0

    def _read(self) -> Any:
        try:
            return self.fmpy.read_model_description(str(self.file))
        except Exception as error:  # whatever FMPy finds wrong with it
            raise ThermidError(f"it is no FMU that FMPy reads: {error}", str(self.file)) from error

    def variable(self, name: str) -> Any:
        """Return a variable of the description."""
        if name not in self.known:
            raise IdentificationError(f"the FMU has no variable '{name}'.{nearest(name, self.known)}", str(self.file), code="name.unknown")
        return self.known[name]

    def _table(self, inputs: tuple[Array, Mapping[str, Array]] | None) -> Any:
        """Return the inputs as FMPy takes them."""
        if inputs is None:
            return None
        at, columns = inputs
        out = np.zeros(len(at), dtype=[("time", float), *((name, float) for name in columns)])
        out["time"] = at
        for name, values in columns.items():
            out[name] = values
        return out

    @contextmanager
    def opened(self) -> Iterator[None]:
        """Keep it unpacked for a while."""
        with scratch() as folder:
            self.folder = str(folder)
            self.fmpy.extract(str(self.file), self.folder)
            yield

    def __call__(self, values: Mapping[str, float]) -> Array:
        """Return the outputs (outputs, times) at values of parameters."""
        self.runs += 1
        form = "CoSimulation" if self.described.coSimulation is not None else "ModelExchange"
        try:
            found = self.fmpy.simulate_fmu(
                self.folder,
                fmi_type=form,
                start_time=0.0,
                stop_time=float(self.times[-1]),
                output_interval=float(self.times[1]),
                relative_tolerance=TOLERANCE,
                start_values={**self.start, **values},
                input=self.inputs,
                output=list(self.outputs),
                model_description=self.described,
            )
        except Exception as error:  # the FMU is a program of others
            raise SolverError(f"the FMU could not be run: {error}", str(self.file)) from error
        at = np.searchsorted(found["time"], self.times - 1e-9 * self.times[1])
        return np.array([found[name][np.minimum(at, found.size - 1)] for name in self.outputs], dtype=float)


def _unknowns(runner: _Runner, parameters: Mapping[str, tuple[float, float]]) -> tuple[Unknown, ...]:
    """Return what is looked for; values with a positive lower bound by their logarithm."""
    out = []
    for name, (low, high) in parameters.items():
        given = runner.variable(name)
        if given.causality != "parameter" and given.start is None:
            raise IdentificationError(f"'{name}' is no parameter of the FMU: its causality is {given.causality}.", str(runner.file))
        begin = float(runner.start.get(name, given.start))
        if not low < high or not low <= begin <= high:
            raise IdentificationError(f"'{name}' begins at {begin:g}, which must lie between {low:g} and {high:g}.", str(runner.file))
        out.append(Unknown(name, "parameter", (), begin, low > 0, low, high, unit=given.unit or "1"))
    if not out:
        raise IdentificationError("no parameter is to be fitted.", str(runner.file))
    return tuple(out)


def _in_unit_of(output: Any, size: Any) -> float:
    """Return the standard deviation of an output's noise, in the unit of the output; a bare number is so already."""
    of = unit(output.unit or "1")
    value = si_value(size, "K" if of.absolute else of.text)
    return float(size) if value is None else value / float(of.factor)


class _Problem:
    """Readings and runs as `minimise` takes them."""

    def __init__(self, runner: _Runner, readings: dict[str, Array], noise: dict[str, float], unknowns: tuple[Unknown, ...]) -> None:
        self.runner, self._unknowns = runner, unknowns
        where = str(runner.file)
        for name, values in readings.items():
            if values.shape != runner.times.shape:
                raise IdentificationError(f"'{name}' has {values.size} readings at {runner.times.size} times.", where)
            if not noise.get(name, 0.0) > 0.0:
                raise IdentificationError(f"'{name}' needs the standard deviation of its noise, above zero.", where)
        self.noise = {name: float(noise[name]) for name in readings}
        self.readings = np.array(list(readings.values()))
        self.used = np.isfinite(self.readings)
        self.weights = 1.0 / np.array(list(self.noise.values()))[:, None]

    @property
    def unknowns(self) -> tuple[Unknown, ...]:
        """What is looked for."""
        return self._unknowns

    @property
    def samples(self) -> int:
        """How many readings there are."""
        return int(self.used.sum())

    def values(self, fitted: Array) -> dict[str, float]:
        """Return parameter -> value."""
        return {u.name: min(max(u.to_value(float(x)), u.low), u.high) for u, x in zip(self._unknowns, fitted, strict=True)}

    def residuals(self, fitted: Array) -> Array:
        """Return what the readings exceed the outputs by (outputs, times), in units of the noise."""
        return np.asarray((self.runner(self.values(fitted)) - self.readings) * self.weights)

    def slopes(self, fitted: Array) -> Array:
        """Return their derivatives (outputs, times, unknowns) by central differences; one-sided at a bound."""
        out = []
        for k, u in enumerate(self._unknowns):
            by = STEP if u.log else STEP * max(abs(float(fitted[k])), 0.1 * u.scale)
            low, high = u.fitted_bounds()
            ends = [np.array(fitted, dtype=float) for _ in range(2)]
            ends[0][k], ends[1][k] = max(fitted[k] - by, low), min(fitted[k] + by, high)
            out.append((self.residuals(ends[1]) - self.residuals(ends[0])) / (ends[1][k] - ends[0][k]))
        return np.stack(out, axis=-1)

    def compressed(self, fitted: Array, loss: str = "linear", loss_scale: float = 1.0, meshes: Sequence[Array] = ()) -> Compressed:
        """Return the weighted residuals with their derivatives; the loss is plain."""
        own, slopes = self.residuals(fitted), self.slopes(fitted)
        if not (np.isfinite(own[self.used]).all() and np.isfinite(slopes[self.used]).all()):
            raise SolverError("an output of the FMU is not a number at these values.", str(self.runner.file))
        rows = own[self.used]
        pairs = zip(self.noise, own, self.used, strict=True)
        sums = tuple(("readings", name, Sums.of(r[at] * self.noise[name])) for name, r, at in pairs if at.any())
        return Compressed(rows, slopes[self.used], float(rows @ rows), sums, ())

    def prior_rows(self, fitted: Array) -> tuple[Array, Array]:
        """Return none: no priors are stated."""
        return np.zeros(0), np.zeros((0, len(self._unknowns)))

    def square(self, found: Compressed) -> float:
        """Return the sum of squares in units of the noise."""
        return found.chi_square


def _told(problem: _Problem, found: Fit) -> FittedFmu:
    """Return the values with their errors, and what must be said of them."""
    own, slopes, times = problem.residuals(found.fitted), problem.slopes(found.fitted), problem.runner.times
    pairs = list(zip(problem.noise, own, slopes, problem.used, strict=True))
    traces = {name: (r[at], times[at], s[at]) for name, r, s, at in pairs if at.any()}
    covariance, noises = covariance_with_noise(found, traces, problem.samples)
    variances = np.diag(covariance)
    values = problem.values(found.fitted)
    slopes = np.array([u.slope(float(x)) for u, x in zip(problem.unknowns, found.fitted, strict=True)])
    errors = np.sqrt(np.where(np.isfinite(variances), np.maximum(variances, 0.0), np.inf)) * np.abs(slopes)
    names = [u.name for u in problem.unknowns]
    groups = tuple(
        tuple(n for n, w in zip(names, way, strict=True) if abs(w) > 0.01 * np.abs(way).max()) for way in null_space(found.jacobian)
    )
    silent = [n for n, column in zip(names, found.jacobian.T, strict=True) if not np.any(column)]
    lost = {n for group in groups for n in group} | set(silent)
    rms = {name: problem.noise[name] * float(np.sqrt(np.mean(r[at] ** 2))) for name, r, _, at in pairs if at.any()}
    at_bound = _bounds(problem.unknowns, values)
    told: Callable[[str, float], float] = lambda n, e: np.inf if n in lost else float(e)  # noqa: E731
    return FittedFmu(
        problem.runner.described.modelName,
        values,
        {n: told(n, e) for n, e in zip(names, errors, strict=True)},
        rms,
        problem.noise,
        float(np.sqrt(found.chi_square / max(problem.samples - len(problem.unknowns), 1))),
        tuple(t.sensor for t in noises if wanders(t.effective_samples, t.samples)),
        groups + tuple((n,) for n in silent),
        at_bound,
        found.converged,
        found.message,
        problem.runner.runs,
    )


def _bounds(unknowns: Sequence[Unknown], values: Mapping[str, float]) -> tuple[str, ...]:
    """Return the names of those that ended at a bound."""
    return tuple(u.name for u in unknowns if min(values[u.name] - u.low, u.high - values[u.name]) < 1e-6 * (u.high - u.low))
