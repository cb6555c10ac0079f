"""What runs in the process of an FMU: its runs by requests, under a limit of memory, each call noted.

In: settings as the host pickles them. Out: outputs and their derivatives as bytes, or an error in words. Model exchange is integrated by
FMPy's CVode, sensitivities beside the states; co-simulation goes step by step.
"""

from __future__ import annotations

import mmap
import os
import pickle
from abc import ABC, abstractmethod
from collections.abc import Sequence
from ctypes import POINTER, c_double, c_uint32
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from queue import SimpleQueue
from threading import Thread
from typing import Any, BinaryIO, Final

import numpy as np

from thermid.base.errors import SolverError, ThermidError, cap
from thermid.base.units import Array
from thermid.interop._fmu.as_model import (
    ARRAYS,
    DIFFERENCE_SHARE,
    EVENTS,
    REFUSED,
    FmuDescribed,
    FmuSetting,
    InputCourse,
    fmpy_package,
    stride,
)
from thermid.interop._fmu.process import NOTE, receive, send

MOST_BYTES: Final = 1 << 40
"""Requests come from the session, which may ask for anything."""
MOST_LETTERS: Final = 400
"""Of an error. What an FMU says of itself is cut there."""
CVODE_TOLERANCE: Final = 1e-8
"""Relative tolerance that is asked of CVode, and of the FMU where it integrates itself."""
MAX_CVODE_STEPS: Final = 100_000
MOST_EVENTS: Final = 100_000
"""Events of a run, of which an FMU may announce the next without end."""
SAME_INSTANT: Final = 1e-9
"""Part of a run within which two instants are one. [-]"""
_DOUBLES: Final = POINTER(c_double)


class EventsFound(Exception):  # noqa: N818 - it ends a run with sensitivities, nothing went wrong
    """An event came up, over which sensitivities are not carried."""


class UnpackedFmu(FmuDescribed):
    """An FMU that this process loads and runs.

    Parameters
    ----------
    path : Path     The archive, for messages.
    folder : str    Where it is unpacked.
    """

    def __init__(self, path: Path, folder: str) -> None:
        self.fmpy, self.folder = fmpy_package(), folder
        super().__init__(path, self.fmpy.read_model_description(folder))

    def run(self, setting: FmuSetting, times: Array, wanted: Sequence[int], ways: Sequence[FmuSetting]) -> tuple[Array, Array]:
        """Return outputs (times, wanted) and their derivatives (times, wanted, ways).

        Raises
        ------
        EventsFound     When there are ways, and an event.
        SolverError     When it cannot be run.
        """
        return (_Exchange if self.exchange else _Steps)(self, setting, times, wanted, ways).run()


class _FmuRun(ABC):
    """What both forms share: an instance that is set up, and its inputs."""

    def __init__(self, file: UnpackedFmu, setting: FmuSetting, times: Array, wanted: Sequence[int], ways: Sequence[FmuSetting]) -> None:
        self.file, self.setting, self.times, self.wanted, self.ways = file, setting, times, list(wanted), list(ways)
        self.end = float(times[-1])
        self.driven, self.courses = list(setting.inputs), list(setting.inputs.values())
        jumps = np.unique(np.concatenate([np.zeros(0), *(c.jumps for c in self.courses)]))
        self.jumps = jumps[(jumps > SAME_INSTANT * self.end) & (jumps < self.end * (1.0 - SAME_INSTANT))]
        self.messages: list[str] = []
        self.stand: list[float] = []
        self.now = 0.0

    def logged(self, *arguments: Any) -> None:
        """Keep what the FMU says of a failure; its last argument is the message."""
        text = arguments[-1]
        self.messages.append(text.decode("utf-8", "replace") if isinstance(text, bytes) else str(text))

    def run(self) -> tuple[Array, Array]:
        """Return outputs (times, outputs) and slopes (times, outputs, ways) of the FMU, in its own units.

        Raises
        ------
        EventsFound   With derivatives, at an event.
        SolverError   When the FMU cannot be run.
        """
        fmpy, form = self.file.fmpy, "ModelExchange" if self.file.exchange else "CoSimulation"
        self.fmu = fmpy.instantiate_fmu(self.file.folder, self.file.described, form, logger=self.logged)
        self.get, self.put = (self.fmu.getReal, self.fmu.setReal) if self.file.second else (self.fmu.getFloat64, self.fmu.setFloat64)
        try:
            self._begin()
            outputs_and_slopes = self._go()
            self.fmu.terminate()
            return outputs_and_slopes
        except (EventsFound, SolverError):
            raise
        except Exception as error:
            message = next((m for m in reversed(self.messages) if m), "")
            words = ": ".join(filter(None, (str(error), message)))
            raise SolverError(
                f"the FMU could not be run at t = {self.now:g} s: {words}", str(self.file.path), code="run.did-not-finish"
            ) from error
        finally:
            self.fmu.freeInstance()

    def _begin(self) -> None:
        """Set up the experiment and pass through initialisation, with the values and inputs of the setting at time zero."""
        if self.file.second:
            self.fmu.setupExperiment(tolerance=CVODE_TOLERANCE, startTime=0.0, stopTime=None)
        if self.setting.values:
            self.put(list(self.setting.values), [float(v) for v in self.setting.values.values()])
        if self.file.second:
            self.fmu.enterInitializationMode()
        else:
            self.fmu.enterInitializationMode(tolerance=CVODE_TOLERANCE, startTime=0.0)
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
    def of_direction(cls, states: Sequence[int], way: FmuSetting) -> _Seed:
        """Return the seed of a direction: references of `states`, then of the values and inputs that move, with how much each does.

        `states` are references; values of states are put in at every instant, since they move along the run.
        """
        fixed = {r: d for r, d in way.values.items() if r not in states}
        every = [*states, *fixed, *way.inputs]
        values = (c_double * len(every))(*([0.0] * len(states)), *fixed.values())
        first = len(states) + len(fixed)
        courses = tuple((first + k, c) for k, c in enumerate(way.inputs.values()))
        return cls((c_uint32 * len(every))(*every), values, np.ctypeslib.as_array(values), courses)


class _Exchange(_FmuRun):
    """Model exchange by CVode, sensitivities beside the states."""

    def _go(self) -> tuple[Array, Array]:
        """Return the outputs (times, outputs) and their derivatives (times, outputs, ways), from output to output and jump to jump.

        Events of the FMU and jumps of inputs end a step of the solver.

        Raises
        ------
        EventsFound   With derivatives, at an event.
        """
        self.n, self.since, self.events = len(self.file.states), 0.0, 0
        self.moves = np.array([[way.values.get(r, 0.0) for way in self.ways] for r in self.file.states]).reshape(self.n, len(self.ways))
        self.seeds = [_Seed.of_direction(self.file.states, way) for way in self.ways]
        due = self._settle_events()
        self._enter()
        solver = self._solver()
        outputs, slopes = np.zeros((self.times.size, len(self.wanted))), np.zeros((self.times.size, len(self.wanted), len(self.ways)))
        stops = [(float(t), True) for t in self.times] + [(float(t), False) for t in self.jumps]
        place = 0
        for stop, wanted in sorted(stops):
            while True:
                event = self._step(solver, min(stop, due))
                jump = stop <= due and not wanted and not event and self.now >= stop - SAME_INSTANT * self.end
                if jump:
                    self.since = stop
                if event or jump or (due <= stop and self.now >= due - SAME_INSTANT * self.end):
                    if self.ways and not jump:
                        raise EventsFound
                    due = self._event(solver)
                if self.now >= stop - SAME_INSTANT * self.end:
                    break
            if wanted:
                outputs[place] = self.get(self.wanted) if self.wanted else []
                if self.ways:
                    slopes[place] = self._derived(self.wanted)
                place += 1
        return outputs, slopes

    def _enter(self) -> None:
        """Enter the mode in which the host integrates."""
        self.fmu.enterContinuousTimeMode()

    def _settle_events(self) -> float:
        """Let discrete states settle; return when the next event of the FMU is due."""
        update = self.fmu.newDiscreteStates if self.file.second else self.fmu.updateDiscreteStates
        for _ in range(1000):
            again, ends, _, changed, defined, due = update()
            if ends:
                raise SolverError("the FMU asked to end the simulation.", str(self.file.path), code="run.did-not-finish")
            if changed and self.ways and self.now > 0.0:
                raise EventsFound
            if not again:
                return float(due) if defined else np.inf
        raise SolverError("the discrete states of the FMU do not settle.", str(self.file.path), code="run.did-not-finish")

    def _event(self, solver: Any) -> float:
        """Let an event happen where the run stands, and begin the solver anew; return when the FMU's next one is due. [s]"""
        self.events += 1
        if self.events > MOST_EVENTS:
            raise SolverError(
                f"the FMU has more than {MOST_EVENTS} events up to t = {self.now:g} s.", str(self.file.path), code="run.did-not-finish"
            )
        self.fmu.enterEventMode()
        self.drive(self.now, self.since)
        due = self._settle_events()
        self._enter()
        solver.reset(self.now)
        return due

    def _step(self, solver: Any, to: float) -> bool:
        """Go on to a time, or to an event before it; return whether there was one."""
        event = False
        if to - self.now > SAME_INSTANT * self.end:
            event, _, self.now = solver.step(self.now, to)
            if not event:
                self.now = to
        self.fmu.setTime(self.now)
        self.drive(self.now, self.since)
        if self.file.described.modelExchange.needsCompletedIntegratorStep:
            called, ends = self.fmu.completedIntegratorStep()
            if ends:
                raise SolverError("the FMU asked to end the simulation.", str(self.file.path), code="run.did-not-finish")
            event = bool(event or called)
        return bool(event)

    def _solver(self) -> Any:
        """Return CVODE on the states of the FMU and, behind them, the derivatives of the states in every direction."""
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
            relativeTolerance=CVODE_TOLERANCE,
            maxNumSteps=MAX_CVODE_STEPS,
        )

    def apply(self, time: float) -> None:
        """Set the inputs of a time, as the solver asks before it reads event indicators."""
        self.drive(time, self.since)

    def _at(self, time: float) -> None:
        """Set the time. [s]"""
        self._time = time
        self.fmu.setTime(time)

    def _whole(self, pointer: Any) -> Array:
        """Return CVODE's vector as an array (states times one more than directions,)."""
        return np.asarray(np.ctypeslib.as_array(pointer, (self.n * (1 + len(self.ways)),)))

    def _get(self, pointer: Any, size: int) -> None:
        """Fill CVODE's vector with the states, then their derivatives by direction."""
        self.fmu.getContinuousStates(pointer, self.n)
        self._whole(pointer)[self.n :] = self.moves.T.ravel()

    def _set(self, pointer: Any, size: int) -> None:
        """Set states and their derivatives from CVODE's vector."""
        self.fmu.setContinuousStates(pointer, self.n)
        self.moves = self._whole(pointer)[self.n :].reshape(len(self.ways), self.n).T.copy()

    def _rates(self, pointer: Any, size: int) -> None:
        """Fill CVODE's vector with the rates of the states, and with those of their derivatives by direction."""
        self.drive(self._time, self.since)
        get = self.fmu.getDerivatives if self.file.second else self.fmu.getContinuousStateDerivatives
        get(pointer, self.n)
        if not np.isfinite(self._whole(pointer)[: self.n]).all():
            self.messages = [
                f"the FMU's derivatives are no numbers at t = {self._time:g} s (fmi{2 if self.file.second else 3}GetDerivatives)."
            ]
        if self.ways:
            self._whole(pointer)[self.n :] = self._derived(self.file.rates, self._time).T.ravel()

    def _nominals(self, pointer: Any, size: int) -> None:
        """Fill CVODE's vector with the FMU's nominal size of each state, then of its sensitivity per direction, for the tolerance."""
        self.fmu.getNominalsOfContinuousStates(pointer, self.n)
        whole = self._whole(pointer)
        for k, way in enumerate(self.ways):
            # a sensitivity counts to the tolerance of the state, moved by as much as a difference would move it
            whole[(1 + k) * self.n : (2 + k) * self.n] = whole[: self.n] * DIFFERENCE_SHARE / stride(self.setting, way, self.end)

    def _derived(self, unknowns: Sequence[int], time: float | None = None) -> Array:
        """Return the derivatives (unknowns, ways) of some variables where the FMU stands, by its directional derivatives.

        Those of states are the moved states of each way; inputs move as their course at `time` [s], now where None.
        """
        at = self.now if time is None else time
        out = np.zeros((len(self.ways), len(unknowns)))
        which = (c_uint32 * len(unknowns))(*unknowns)
        for k, (seed, seed_values) in enumerate(zip(self.seeds, out, strict=True)):
            seed.put[: self.n] = self.moves[:, k]
            for place, course in seed.courses:
                seed.put[place] = course.law(self.since if course.jumps.size else at)
            answer = seed_values.ctypes.data_as(_DOUBLES)
            sizes = (len(unknowns), seed.references, len(seed.references), seed.values)
            if self.file.second:
                self.fmu.fmi2GetDirectionalDerivative(self.fmu.component, which, *sizes, answer)
            else:
                self.fmu.fmi3GetDirectionalDerivative(self.fmu.component, which, *sizes, len(seed.references), answer, len(unknowns))
        return np.asarray(out.T)


class _Steps(_FmuRun):
    """Co-simulation, stepped from instant to instant; inputs stand at their value in the middle of a step."""

    def _go(self) -> tuple[Array, Array]:
        """Return the outputs on the grid of a co-simulation, straight between its points (times, outputs), and empty derivatives.

        Inputs are those in the middle of a step.

        Raises
        ------
        EventsFound, SolverError   When derivatives are asked for; when the FMU ends the simulation.
        """
        if self.ways:
            raise EventsFound
        grid = self._grid()
        rows = [self.get(self.wanted) if self.wanted else []]
        for begin, end in pairwise(grid):
            self.now = float(begin)
            self.drive(0.5 * (begin + end), begin + SAME_INSTANT * self.end)
            done = self.fmu.doStep(currentCommunicationPoint=float(begin), communicationStepSize=float(end - begin))
            if done is not None and done[1]:
                raise SolverError("the FMU asked to end the simulation.", str(self.file.path), code="run.did-not-finish")
            rows.append(self.get(self.wanted) if self.wanted else [])
        table = np.array(rows, dtype=float).reshape(grid.size, len(self.wanted))
        return np.column_stack([np.interp(self.times, grid, c) for c in table.T]), np.zeros((self.times.size, len(self.wanted), 0))

    def _grid(self) -> Array:
        """Return the instants (instants,) from one of which to the next it steps. [s]

        Outputs and jumps; of an FMU with a fixed step, or that steps equally, multiples of it nearest to their median distance.
        """
        every: Array = np.unique(np.concatenate([[0.0, self.end], self.times, self.jumps]))
        every = every[np.concatenate([[True], np.diff(every) > SAME_INSTANT * self.end])]
        form = self.file.described.coSimulation
        fixed_step = getattr(form, "fixedInternalStepSize", None)
        if form.canHandleVariableCommunicationStepSize and fixed_step is None:
            return np.asarray(every)
        # a fixed step of its own: communication points are multiples of it
        step = float(fixed_step) if fixed_step is not None else float(np.median(np.diff(every)))
        whole = max(1, round(float(np.median(np.diff(every))) / step)) * step
        count = int(np.ceil(self.end / whole - SAME_INSTANT)) + 1
        return np.asarray(np.linspace(0.0, (count - 1) * whole, count))


def serve(path: str, folder: str, notes: str) -> None:
    """Answer requests for runs of an FMU until there are no more of them."""
    pipes = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    nothing = os.open(os.devnull, os.O_RDWR)
    os.dup2(nothing, 0)
    os.dup2(nothing, 1)
    requests, answers = pipes
    waiting: SimpleQueue[bytes] = SimpleQueue()
    Thread(target=_listen, args=(requests, waiting), daemon=True).start()
    file = UnpackedFmu(Path(path), folder)
    _note_calls(file.fmpy, notes)
    _limit(cap("memory"))
    while True:
        send(answers, _answer(file, waiting.get()))


def _listen(requests: BinaryIO, waiting: SimpleQueue[bytes]) -> None:
    """Take requests; where the session is gone, end at once, whatever the FMU is at."""
    try:
        while True:
            waiting.put(receive(requests, MOST_BYTES))
    finally:
        os._exit(0)


def _limit(memory: float) -> None:
    """Limit the memory [bytes] of this process, where the system can; write no image of a crash."""
    try:
        import resource
    except ImportError:  # Windows
        return
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_AS, (int(memory), int(memory)))


def _note_calls(fmpy: Any, notes: str) -> None:
    """Write each call of FMPy into the FMU to the page, before it is made."""
    with Path(notes).open("r+b") as file:
        page = mmap.mmap(file.fileno(), mmap.PAGESIZE)
    base, count, at = fmpy.fmi1._FMU, 0, 0.0
    load, call = base.__init__, base._call

    def loaded(fmu: Any, *args: Any, **named: Any) -> None:
        """Note that the library is being loaded, and load it."""
        nonlocal at
        at = 0.0
        noted("dlopen")
        load(fmu, *args, **named)

    def called(fmu: Any, name: str, *args: Any) -> Any:
        """Note which function is called, and at which time, and call it."""
        nonlocal at
        if name.endswith(("DoStep", "SetTime")):
            at = float(getattr(args[1], "value", args[1]))
        noted(name)
        return call(fmu, name, *args)

    def noted(name: str) -> None:
        """Write count, time and name of a call where the host sees it if this process dies."""
        nonlocal count
        count += 1
        NOTE.pack_into(page, 0, count, at, name.encode())

    base.__init__, base._call = loaded, called


def _answer(file: UnpackedFmu, request: bytes) -> bytes:
    """Return the arrays of a run as bytes, or why there are none."""
    try:
        return ARRAYS + b"".join(array.tobytes() for array in file.run(*pickle.loads(request)))
    except EventsFound:
        return EVENTS
    except ThermidError as error:
        words = str(error.message)
    except Exception as error:  # whatever FMPy finds
        words = f"the FMU could not be run: {error or type(error).__name__}"
    return REFUSED + words[:MOST_LETTERS].encode("utf-8", "replace")
