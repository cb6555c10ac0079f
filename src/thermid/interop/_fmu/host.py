"""A host of anybody's FMU: runs at values of its variables, with derivatives by its directional ones or by differences of runs.

In: an FMU of FMI 2.0 or 3.0, what is set, courses of inputs, times. Out: its outputs, and their derivatives in directions. FMPy loads it;
model exchange is integrated by its CVode, sensitivities beside the states; co-simulation is stepped.
"""

from __future__ import annotations

import re
import zipfile
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from ctypes import POINTER, c_double, c_uint32
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np

from thermid.base.errors import MissingExtraError, SolverError, ThermidError
from thermid.base.extensions import missing
from thermid.base.files import read_bytes, scratch
from thermid.base.linear_algebra import Array
from thermid.interop._fmu.archive import DESCRIPTION, check_archive

TOLERANCE: Final = 1e-8
"""Relative tolerance that is asked of CVode, and of the FMU where it integrates itself."""
STEP: Final = 4e-3
"""Part of a value by which it is moved for a difference. [-]"""
WIDE: Final = 240
"""States and sensitivities together, up to which they are integrated; differences of runs cost less beyond."""
AGREE: Final = 5e-3
"""Part of the largest derivative of an output by which directional derivatives may differ from differences of runs. [-]"""
MOST_STEPS: Final = 100_000
_DOUBLES: Final = POINTER(c_double)
NEAR: Final = 1e-9
"""Part of a run within which two instants are one. [-]"""


@dataclass(frozen=True, eq=False)
class InputCourse:
    """An input over time, in the unit of the FMU.

    Parameters
    ----------
    law : callable      Time [s] -> value.
    jumps : array       Times at which it jumps; it holds in between. Empty where it is continuous. [s]
    step : float        Shortest interval that a run must not step over; infinite for none. [s]
    """

    law: Callable[[float], float]
    jumps: Array = field(default_factory=lambda: np.zeros(0))
    step: float = np.inf

    def raised(self, other: InputCourse, factor: float) -> InputCourse:
        """Return the course with so much of another added."""
        return InputCourse(lambda t: self.law(t) + factor * other.law(t), np.union1d(self.jumps, other.jumps), min(self.step, other.step))

    @classmethod
    def constant(cls, value: float) -> InputCourse:
        """Return a value that does not change."""
        return cls(lambda t: value)


@dataclass(frozen=True, eq=False)
class FmuSetting:
    """What is set in an FMU before and during a run.

    Parameters
    ----------
    values : dict   Value reference -> parameter or start.
    inputs : dict   Value reference -> InputCourse.
    """

    values: Mapping[int, float] = field(default_factory=dict)
    inputs: Mapping[int, InputCourse] = field(default_factory=dict)

    def moved(self, way: FmuSetting, by: float) -> FmuSetting:
        """Return the setting moved by so much of a direction."""
        values = {**self.values, **{k: self.values[k] + by * d for k, d in way.values.items()}}
        inputs = dict(self.inputs)
        for k, d in way.inputs.items():
            own = inputs[k]
            inputs[k] = own.raised(d, by)
        return FmuSetting(values, inputs)


def fmpy_package() -> Any:
    """Return FMPy.

    Raises
    ------
    MissingExtraError   When it is not installed.
    """
    try:
        import fmpy
        import fmpy.sundials
    except ImportError as error:
        raise MissingExtraError(missing(["fmpy"], "running an FMU")) from error
    return fmpy


class _Events(Exception):  # noqa: N818 - it ends a run with sensitivities, nothing went wrong
    """An event came up, over which sensitivities are not carried."""


class FmuFile:
    """An FMU on disk; it is unpacked at the first run and removed with the object.

    Parameters
    ----------
    path : Path     The file.

    Raises
    ------
    MissingExtraError   When FMPy is not installed.
    ThermidError        When it is no FMU of FMI 2.0 or 3.0 that FMPy reads.
    """

    def __init__(self, path: Path) -> None:
        self.fmpy, self.path, self.runs = fmpy_package(), path, 0
        read_bytes(path)
        check_archive(path)
        try:
            self.described = self.fmpy.read_model_description(str(path))
        except Exception as error:  # whatever FMPy finds wrong with it
            raise ThermidError(f"it is no FMU that FMPy reads: {error}", str(path)) from error
        if str(self.described.fmiVersion)[:2] not in ("2.", "3."):
            raise ThermidError(f"it is an FMU of FMI {self.described.fmiVersion}; 2.0 and 3.0 are supported.", str(path))
        if self.described.modelExchange is None and self.described.coSimulation is None:
            raise ThermidError("it offers neither model exchange nor co-simulation.", str(path))
        self.second = str(self.described.fmiVersion).startswith("2.")
        self.exchange = self.described.modelExchange is not None
        self.states = [u.variable.derivative.valueReference for u in self.described.derivatives] if self.exchange else []
        self.rates = [u.variable.valueReference for u in self.described.derivatives] if self.exchange else []
        self.directional = self.exchange and self._offers_directions()
        self.why = "" if self.directional else "the FMU offers none" if self.exchange else "it has co-simulation alone"
        self._trusted: dict[tuple[int, ...], bool] = {}
        self._stack = ExitStack()
        self._folder = ""

    def _offers_directions(self) -> bool:
        """Whether model exchange has directional derivatives; FMPy does not read this of FMI 3.0."""
        with zipfile.ZipFile(self.path) as packed:
            text = packed.read(DESCRIPTION).decode("utf-8", "replace")
        head = re.search(r"<ModelExchange\b[^>]*>", text)
        return head is not None and re.search(r'providesDirectionalDerivatives?\s*=\s*["\'](true|1)["\']', head[0]) is not None

    @property
    def exact(self) -> bool:
        """Whether derivatives are those of the FMU itself, as far as it has been run."""
        return self.directional and not self.why

    @property
    def derivatives(self) -> str:
        """How derivatives are made, in words."""
        if self.exact:
            return "directional derivatives of the FMU, integrated beside its states"
        return f"central differences of runs: {self.why}"

    def _unpacked(self) -> str:
        if not self._folder:
            self._folder = str(self._stack.enter_context(scratch()))
            self.fmpy.extract(str(self.path), self._folder)
        return self._folder

    def __del__(self) -> None:
        """Remove what was unpacked."""
        if hasattr(self, "_stack"):
            self._stack.close()

    def __reduce__(self) -> tuple[type[FmuFile], tuple[Path]]:
        """Copy it by its path."""
        return FmuFile, (self.path,)

    def outputs(self, setting: FmuSetting, times: Array, wanted: Sequence[int]) -> Array:
        """Return variables (times, wanted) of a run from zero, in the units of the FMU.

        Raises
        ------
        SolverError     When the FMU cannot be run, or one of them is not a number.
        """
        return self._run(setting, times, wanted, [])[0]

    def with_slopes(self, setting: FmuSetting, times: Array, wanted: Sequence[int], ways: Sequence[FmuSetting]) -> tuple[Array, Array]:
        """Return variables (times, wanted) and their derivatives (times, wanted, ways) in some directions.

        Raises
        ------
        SolverError     As in `outputs`.
        """
        if self.directional and len(self.states) * (1 + len(ways)) <= WIDE:
            found = self._by_directions(setting, times, wanted, ways)
            if found is not None:
                return found
        base = self.outputs(setting, times, wanted)
        slopes = [self._difference(setting, times, wanted, way, base) for way in ways]
        return base, np.stack(slopes, axis=-1) if slopes else np.zeros((*base.shape, 0))

    def _by_directions(
        self, setting: FmuSetting, times: Array, wanted: Sequence[int], ways: Sequence[FmuSetting]
    ) -> tuple[Array, Array] | None:
        """Return what `with_slopes` does by directional derivatives; None where these are not offered for what moves, or are wrong.

        They are compared with differences of runs once for every set of variables that move.
        """
        moving = tuple(sorted({k for way in ways for k in (*way.values, *way.inputs)}))
        if self._trusted.get(moving) is False:
            return None
        try:
            base, slopes = self._run(setting, times, wanted, ways)
        except _Events:
            self.why = "it has events"
            self._trusted[moving] = False
            return None
        except SolverError:
            self.outputs(setting, times, wanted)  # a run that fails without them fails here
            self.why = "it refuses those with respect to these variables"
            self._trusted[moving] = False
            return None
        if moving not in self._trusted:
            self._trusted[moving] = self._agree(setting, times, wanted, ways, base, slopes)
            if not self._trusted[moving]:
                self.why = "its directional derivatives differ from them"
                return None
        return base, slopes

    def _agree(
        self, setting: FmuSetting, times: Array, wanted: Sequence[int], ways: Sequence[FmuSetting], base: Array, slopes: Array
    ) -> bool:
        for k, way in enumerate(ways):
            other = self._difference(setting, times, wanted, way, base)
            if np.abs(other - slopes[..., k]).max(initial=0.0) > AGREE * max(float(np.abs(other).max(initial=0.0)), 1e-12):
                return False
        return True

    def _difference(self, setting: FmuSetting, times: Array, wanted: Sequence[int], way: FmuSetting, base: Array) -> Array:
        """Return derivatives (times, wanted) in a direction by central differences; one-sided where a side cannot be run."""
        by = _stride(setting, way, float(times[-1]))
        ends, parts = [], []
        for side in (-by, by):
            try:
                ends.append(self.outputs(setting.moved(way, side), times, wanted))
                parts.append(side)
            except SolverError:
                continue
        if not parts:
            raise SolverError("the FMU could not be run at values beside these, which a difference needs.", str(self.path))
        if len(parts) == 1:
            return np.asarray((ends[0] - base) / parts[0])
        return np.asarray((ends[1] - ends[0]) / (2.0 * by))

    def _run(self, setting: FmuSetting, times: Array, wanted: Sequence[int], ways: Sequence[FmuSetting]) -> tuple[Array, Array]:
        self.runs += 1
        try:
            run = (_Exchange if self.exchange else _Steps)(self, setting, times, wanted, ways)
            found, slopes = run.made()
        except (_Events, ThermidError):
            raise
        except Exception as error:  # the FMU is a program of others
            raise SolverError(f"the FMU could not be run: {error}", str(self.path)) from error
        if not (np.isfinite(found).all() and np.isfinite(slopes).all()):
            raise SolverError("an output of the FMU is not a number at these values.", str(self.path))
        return found, slopes


def _stride(setting: FmuSetting, way: FmuSetting, end: float) -> float:
    """Return how far to move along a direction: a part `STEP` of what moves, of temperatures and powers over the run."""
    sizes = [abs(d) / max(abs(setting.values[k]), 1e-6) for k, d in way.values.items()]
    at = np.linspace(0.0, end, 16)
    for k, d in way.inputs.items():
        own = max(abs(setting.inputs[k].law(float(t))) for t in at)
        sizes.append(max(abs(d.law(float(t))) for t in at) / max(own, 1e-6))
    return STEP / max(max(sizes, default=1.0), 1e-300)


class _FmuRun(ABC):
    """What both forms share: an instance that is set up, and its inputs."""

    def __init__(self, file: FmuFile, setting: FmuSetting, times: Array, wanted: Sequence[int], ways: Sequence[FmuSetting]) -> None:
        self.file, self.setting, self.times, self.wanted, self.ways = file, setting, times, list(wanted), list(ways)
        self.end = float(times[-1])
        self.driven, self.courses = list(setting.inputs), list(setting.inputs.values())
        jumps = np.unique(np.concatenate([np.zeros(0), *(c.jumps for c in self.courses)]))
        self.jumps = jumps[(jumps > NEAR * self.end) & (jumps < self.end * (1.0 - NEAR))]
        self.messages: list[str] = []
        self.stand: list[float] = []

    def logged(self, *said: Any) -> None:
        """Keep what the FMU says of a failure; its last argument is the message."""
        text = said[-1]
        self.messages.append(text.decode("utf-8", "replace") if isinstance(text, bytes) else str(text))

    def made(self) -> tuple[Array, Array]:
        """Return outputs and slopes."""
        fmpy, form = self.file.fmpy, "ModelExchange" if self.file.exchange else "CoSimulation"
        more = {} if self.file.second else {"logger": self.logged}
        self.fmu = fmpy.instantiate_fmu(self.file._unpacked(), self.file.described, form, **more)
        self.get, self.put = (self.fmu.getReal, self.fmu.setReal) if self.file.second else (self.fmu.getFloat64, self.fmu.setFloat64)
        try:
            self._begin()
            found = self._go()
            self.fmu.terminate()
            return found
        except _Events:
            raise
        except Exception as error:
            said = next((m for m in reversed(self.messages) if m), "")
            raise SolverError(f"the FMU could not be run: {said or error}", str(self.file.path)) from error
        finally:
            self.fmu.freeInstance()

    def _begin(self) -> None:
        if self.file.second:
            self.fmu.setupExperiment(tolerance=TOLERANCE, startTime=0.0, stopTime=None)
        if self.setting.values:
            self.put(list(self.setting.values), [float(v) for v in self.setting.values.values()])
        if self.file.second:
            self.fmu.enterInitializationMode()
        else:
            self.fmu.enterInitializationMode(tolerance=TOLERANCE, startTime=0.0)
        self.drive(0.0, 0.0)
        self.fmu.exitInitializationMode()

    def drive(self, time: float, since: float) -> None:
        """Set the inputs of a time; those that jump as they are since an instant."""
        if self.driven:
            values = [c.law(since if c.jumps.size else time) for c in self.courses]
            if values != self.stand:
                self.put(self.driven, values)
                self.stand = values

    @abstractmethod
    def _go(self) -> tuple[Array, Array]:
        """Return outputs and slopes of a run."""


@dataclass(frozen=True)
class _Seed:
    """A direction as the FMU is asked for it: states first, then what is set, then inputs.

    Parameters
    ----------
    references : ctypes array       Value references.
    values : ctypes array, put      How each moves, and the same memory as an array.
    courses : tuple                 Place and course of each input.
    """

    references: Any
    values: Any
    put: Array
    courses: tuple[tuple[int, InputCourse], ...]

    @classmethod
    def of(cls, states: Sequence[int], way: FmuSetting) -> _Seed:
        """Return the seed of a direction."""
        fixed = {r: d for r, d in way.values.items() if r not in states}
        every = [*states, *fixed, *way.inputs]
        values = (c_double * len(every))(*([0.0] * len(states)), *fixed.values())
        first = len(states) + len(fixed)
        courses = tuple((first + k, c) for k, c in enumerate(way.inputs.values()))
        return cls((c_uint32 * len(every))(*every), values, np.ctypeslib.as_array(values), courses)


class _Exchange(_FmuRun):
    """Model exchange by CVode, sensitivities beside the states."""

    def _go(self) -> tuple[Array, Array]:
        self.n, self.now, self.since = len(self.file.states), 0.0, 0.0
        self.moves = self._first_moves()
        self.seeds = [_Seed.of(self.file.states, way) for way in self.ways]
        due = self._settle_events()
        self._enter()
        solver = self._solver()
        found, slopes = np.zeros((self.times.size, len(self.wanted))), np.zeros((self.times.size, len(self.wanted), len(self.ways)))
        stops = [(float(t), True) for t in self.times] + [(float(t), False) for t in self.jumps]
        place = 0
        for stop, wanted in sorted(stops):
            while True:
                ahead = min(stop, due)
                event = self._step(solver, ahead)
                jump = stop <= due and not wanted and not event and self.now >= stop - NEAR * self.end
                if jump:
                    self.since = stop
                if event or jump or (due <= stop and self.now >= due - NEAR * self.end):
                    if self.ways and not jump:
                        raise _Events
                    due = self._event(solver)
                if self.now >= stop - NEAR * self.end:
                    break
            if wanted:
                found[place] = self.get(self.wanted) if self.wanted else []
                if self.ways:
                    slopes[place] = self._derived(self.wanted)
                place += 1
        return found, slopes

    def _first_moves(self) -> Array:
        """Return the derivatives (states, ways) of the states as the run begins."""
        out = np.zeros((self.n, len(self.ways)))
        for k, way in enumerate(self.ways):
            for i, reference in enumerate(self.file.states):
                out[i, k] = way.values.get(reference, 0.0)
        return out

    def _enter(self) -> None:
        self.fmu.enterContinuousTimeMode()

    def _settle_events(self) -> float:
        """Let discrete states settle; return when the next event of the FMU is due."""
        update = self.fmu.newDiscreteStates if self.file.second else self.fmu.updateDiscreteStates
        for _ in range(1000):
            again, ends, _, changed, defined, due = update()
            if ends:
                raise SolverError("the FMU asked to end the simulation.", str(self.file.path))
            if changed and self.ways and self.now > 0.0:
                raise _Events
            if not again:
                return float(due) if defined else np.inf
        raise SolverError("the discrete states of the FMU do not settle.", str(self.file.path))

    def _event(self, solver: Any) -> float:
        self.fmu.enterEventMode()
        self.drive(self.now, self.since)
        due = self._settle_events()
        self._enter()
        solver.reset(self.now)
        return due

    def _step(self, solver: Any, to: float) -> bool:
        """Go on to a time, or to an event before it; return whether there was one."""
        event = False
        if to - self.now > NEAR * self.end:
            event, _, self.now = solver.step(self.now, to)
            if not event:
                self.now = to
        self.fmu.setTime(self.now)
        self.drive(self.now, self.since)
        if self.file.described.modelExchange.needsCompletedIntegratorStep:
            called, ends = self.fmu.completedIntegratorStep()
            if ends:
                raise SolverError("the FMU asked to end the simulation.", str(self.file.path))
            event = bool(event or called)
        return bool(event)

    def _solver(self) -> Any:
        sundials = self.file.fmpy.sundials
        finest = min((c.step for c in self.courses), default=np.inf)
        return sundials.CVodeSolver(
            nx=self.n * (1 + len(self.ways)),
            nz=self.file.described.numberOfEventIndicators,
            get_x=self._get,
            set_x=self._set,
            get_dx=self._rates,
            get_z=self.fmu.getEventIndicators,
            get_nominals=self._nominals,
            set_time=self._at,
            input=self,
            startTime=0.0,
            maxStep=max(min(self.end / 50.0, 3.0 * finest), 1e-6 * self.end),
            relativeTolerance=TOLERANCE,
            maxNumSteps=MOST_STEPS,
        )

    def apply(self, time: float) -> None:
        """Set the inputs of a time, as the solver asks before it reads event indicators."""
        self.drive(time, self.since)

    def _at(self, time: float) -> None:
        self._time = time
        self.fmu.setTime(time)

    def _whole(self, pointer: Any) -> Array:
        return np.asarray(np.ctypeslib.as_array(pointer, (self.n * (1 + len(self.ways)),)))

    def _get(self, pointer: Any, size: int) -> None:
        self.fmu.getContinuousStates(pointer, self.n)
        self._whole(pointer)[self.n :] = self.moves.T.ravel()

    def _set(self, pointer: Any, size: int) -> None:
        self.fmu.setContinuousStates(pointer, self.n)
        self.moves = self._whole(pointer)[self.n :].reshape(len(self.ways), self.n).T.copy()

    def _rates(self, pointer: Any, size: int) -> None:
        self.drive(self._time, self.since)
        get = self.fmu.getDerivatives if self.file.second else self.fmu.getContinuousStateDerivatives
        get(pointer, self.n)
        if self.ways:
            self._whole(pointer)[self.n :] = self._derived(self.file.rates, self._time).T.ravel()

    def _nominals(self, pointer: Any, size: int) -> None:
        self.fmu.getNominalsOfContinuousStates(pointer, self.n)
        whole = self._whole(pointer)
        for k, way in enumerate(self.ways):
            # a sensitivity counts to the tolerance of the state, moved by as much as a difference would move it
            whole[(1 + k) * self.n : (2 + k) * self.n] = whole[: self.n] * STEP / _stride(self.setting, way, self.end)

    def _derived(self, unknowns: Sequence[int], time: float | None = None) -> Array:
        """Return the derivatives (unknowns, ways) of some variables where the FMU stands."""
        at = self.now if time is None else time
        out = np.zeros((len(self.ways), len(unknowns)))
        which = (c_uint32 * len(unknowns))(*unknowns)
        for k, (seed, own) in enumerate(zip(self.seeds, out, strict=True)):
            seed.put[: self.n] = self.moves[:, k]
            for place, course in seed.courses:
                seed.put[place] = course.law(self.since if course.jumps.size else at)
            answer = own.ctypes.data_as(_DOUBLES)
            sizes = (len(unknowns), seed.references, len(seed.references), seed.values)
            if self.file.second:
                self.fmu.fmi2GetDirectionalDerivative(self.fmu.component, which, *sizes, answer)
            else:
                self.fmu.fmi3GetDirectionalDerivative(self.fmu.component, which, *sizes, len(seed.references), answer, len(unknowns))
        return np.asarray(out.T)


class _Steps(_FmuRun):
    """Co-simulation, stepped from instant to instant; inputs stand at their value in the middle of a step."""

    def _go(self) -> tuple[Array, Array]:
        if self.ways:
            raise _Events
        grid = self._grid()
        rows = [self.get(self.wanted) if self.wanted else []]
        for begin, end in pairwise(grid):
            self.drive(0.5 * (begin + end), begin + NEAR * self.end)
            done = self.fmu.doStep(currentCommunicationPoint=float(begin), communicationStepSize=float(end - begin))
            if done is not None and done[1]:
                raise SolverError("the FMU asked to end the simulation.", str(self.file.path))
            rows.append(self.get(self.wanted) if self.wanted else [])
        table = np.array(rows, dtype=float).reshape(grid.size, len(self.wanted))
        return np.column_stack([np.interp(self.times, grid, c) for c in table.T]), np.zeros((self.times.size, len(self.wanted), 0))

    def _grid(self) -> Array:
        """Return the instants from one of which to the next it steps."""
        every: Array = np.unique(np.concatenate([[0.0, self.end], self.times, self.jumps]))
        every = every[np.concatenate([[True], np.diff(every) > NEAR * self.end])]
        form = self.file.described.coSimulation
        own = getattr(form, "fixedInternalStepSize", None)
        if form.canHandleVariableCommunicationStepSize and own is None:
            return np.asarray(every)
        # a fixed step of its own: communication points are multiples of it
        step = float(own) if own is not None else float(np.median(np.diff(every)))
        whole = max(1, round(float(np.median(np.diff(every))) / step)) * step
        count = int(np.ceil(self.end / whole - NEAR)) + 1
        return np.asarray(np.linspace(0.0, (count - 1) * whole, count))
