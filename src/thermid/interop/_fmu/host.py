"""A host of anybody's FMU: runs at values of its variables, with derivatives by its directional ones or by differences of runs.

In: an FMU of FMI 2.0 or 3.0, what is set, courses of inputs, times. Out: its outputs, and their derivatives in directions. FMPy loads it
in a process of its own; model exchange is integrated by its CVode, sensitivities beside the states; co-simulation is stepped.
"""

from __future__ import annotations

import pickle
import re
import zipfile
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Final
from weakref import finalize

import numpy as np

from thermid.base.errors import SolverError, ThermidError
from thermid.base.extensions import optional
from thermid.base.files import scratch
from thermid.base.linear_algebra import Array
from thermid.interop._fmu.archive import DESCRIPTION, check_archive, check_trust, digest_of
from thermid.interop._fmu.process import ConfinedProgram

DIFFERENCE_SHARE: Final = 4e-3
"""Part of a value by which it is moved for a difference. [-]"""
MAX_STATES_WITH_SENSITIVITIES: Final = 240
"""States and sensitivities together, up to which they are integrated; differences of runs cost less beyond."""
AGREE: Final = 5e-3
"""Part of the largest derivative of an output by which directional derivatives may differ from differences of runs. [-]"""
ARRAYS, EVENTS, REFUSED = b"\0", b"\1", b"\2"
"""First byte of an answer: arrays follow; there was an event; an error follows in words."""
MOST_SAID: Final = 4096
"""Bytes of an error in words."""
_CODE: Final = "import sys; from thermid.interop._fmu.child import serve; serve(*sys.argv[1:])"


@dataclass(frozen=True, eq=False)
class InputCourse:
    """An input over time, in the unit of the FMU.

    Parameters
    ----------
    law : callable      Time [s] -> value; it can be pickled.
    jumps : array       Times at which it jumps; it holds in between. Empty where it is continuous. [s]
    step : float        Shortest interval that a run must not step over; infinite for none. [s]
    """

    law: Callable[[float], float]
    jumps: Array = field(default_factory=lambda: np.zeros(0))
    step: float = np.inf

    def raised(self, other: InputCourse, factor: float) -> InputCourse:
        """Return the course with so much of another added."""
        return InputCourse(partial(_sum, self.law, other.law, factor), np.union1d(self.jumps, other.jumps), min(self.step, other.step))

    @classmethod
    def constant(cls, value: float) -> InputCourse:
        """Return a value that does not change."""
        return cls(partial(_constant, value))


def _sum(one: Callable[[float], float], other: Callable[[float], float], factor: float, time: float) -> float:
    """Return ``one(time) + factor * other(time)``."""
    return one(time) + factor * other(time)


def _constant(value: float, _: float) -> float:
    """Return a value that no time changes."""
    return value


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
            course = inputs[k]
            inputs[k] = course.raised(d, by)
        return FmuSetting(values, inputs)


def fmpy_package() -> Any:
    """Return FMPy.

    Raises
    ------
    MissingExtraError   When it is not installed.
    """
    optional("fmpy.sundials", "running an FMU")
    return optional("fmpy", "running an FMU")


class FmuDescribed:
    """What the description of an FMU says of it.

    Parameters
    ----------
    path : Path         The archive.
    described : object  Its description as FMPy reads it.
    """

    def __init__(self, path: Path, described: Any) -> None:
        self.path, self.described = path, described
        self.second = str(described.fmiVersion).startswith("2.")
        self.exchange = described.modelExchange is not None
        self.states = [u.variable.derivative.valueReference for u in described.derivatives] if self.exchange else []
        self.rates = [u.variable.valueReference for u in described.derivatives] if self.exchange else []


class FmuFile(FmuDescribed):
    """An FMU on disk; at the first run it is unpacked, and a process is started for it, which ends with the object.

    Parameters
    ----------
    path : Path     The file.
    trust : bool    Whether its program may run; it is remembered of the file. Without it, it must have been said before.

    Raises
    ------
    MissingExtraError   When FMPy is not installed.
    ThermidError        When it is no FMU of FMI 2.0 or 3.0 that FMPy reads, or nobody said that its program may run.
    """

    def __init__(self, path: Path, trust: bool = False) -> None:
        self.fmpy, self.runs = fmpy_package(), 0
        check_archive(path)
        self.digest = digest_of(path)
        try:
            with path.open("rb") as file:  # of its own opening FMPy leaves it open after an error
                described = self.fmpy.read_model_description(file)
        except Exception as error:  # whatever FMPy finds wrong with it
            raise ThermidError(f"it is no FMU that FMPy reads: {error}", str(path), code="file.another-kind") from error
        if str(described.fmiVersion)[:2] not in ("2.", "3."):
            raise ThermidError(
                f"it is an FMU of FMI {described.fmiVersion}; 2.0 and 3.0 are supported.", str(path), code="file.another-kind"
            )
        if described.modelExchange is None and described.coSimulation is None:
            raise ThermidError("it offers neither model exchange nor co-simulation.", str(path), code="file.another-kind")
        try:
            super().__init__(path, described)
        except AttributeError as error:
            raise ThermidError("its derivatives are of no state.", str(path), code="value.wrong-kind") from error
        check_trust(path, self.digest, trust)
        self.directional = self.exchange and self._offers_directions()
        self.why = "" if self.directional else "the FMU offers none" if self.exchange else "it has co-simulation alone"
        self._agreeing: dict[tuple[int, ...], bool] = {}
        self._stack = ExitStack()
        finalize(self, self._stack.close)  # of a model in a circle of references too: a `__del__` comes after those of the pipes there
        self._program: ConfinedProgram | None = None

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

    def _confined(self) -> ConfinedProgram:
        """Return the process of the program, from a folder into which the file is unpacked as it was when it was trusted."""
        if self._program is None:
            folder = self._stack.enter_context(scratch())
            if digest_of(self.path) != self.digest:
                raise ThermidError("the file has changed since it was read. Read it again.", str(self.path), code="fmu.changed")
            self.fmpy.extract(str(self.path), str(folder / "fmu"))
            notes = folder / "notes"
            self._program = ConfinedProgram(self.path, notes, (_CODE, str(self.path), str(folder / "fmu"), str(notes)))
            self._stack.callback(self._program.stop)
        return self._program

    def __reduce__(self) -> tuple[type[FmuFile], tuple[Path, bool]]:
        """Copy it by its path."""
        return FmuFile, (self.path, True)

    def outputs(self, setting: FmuSetting, times: Array, wanted: Sequence[int]) -> Array:
        """Return variables (times, wanted) of a run from zero, in the units of the FMU.

        Raises
        ------
        SolverError     When the FMU cannot be run, or one of them is not a number.
        """
        run = self._run(setting, times, wanted, [])
        assert run is not None
        return run[0]

    def with_slopes(self, setting: FmuSetting, times: Array, wanted: Sequence[int], ways: Sequence[FmuSetting]) -> tuple[Array, Array]:
        """Return variables (times, wanted) and their derivatives (times, wanted, ways) in some directions.

        Raises
        ------
        SolverError     As in `outputs`.
        """
        if self.directional and len(self.states) * (1 + len(ways)) <= MAX_STATES_WITH_SENSITIVITIES:
            outputs_and_slopes = self._by_directions(setting, times, wanted, ways)
            if outputs_and_slopes is not None:
                return outputs_and_slopes
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
        if self._agreeing.get(moving) is False:
            return None
        why, run = "it has events", None
        try:
            run = self._run(setting, times, wanted, ways)
        except SolverError:
            self.outputs(setting, times, wanted)  # a run that fails without them fails here
            why = "it refuses those with respect to these variables"
        if run is not None and moving not in self._agreeing:
            self._agreeing[moving] = self._agree(setting, times, wanted, ways, *run)
            why = "its directional derivatives differ from them"
        if run is None or not self._agreeing[moving]:
            self.why, self._agreeing[moving] = why, False
            return None
        return run

    def _agree(
        self, setting: FmuSetting, times: Array, wanted: Sequence[int], ways: Sequence[FmuSetting], base: Array, slopes: Array
    ) -> bool:
        """Whether differences of two strides give the same slopes in every direction, to the share `AGREE` of the largest."""
        for k, way in enumerate(ways):
            other = self._difference(setting, times, wanted, way, base)
            if np.abs(other - slopes[..., k]).max(initial=0.0) > AGREE * max(float(np.abs(other).max(initial=0.0)), 1e-12):
                return False
        return True

    def _difference(self, setting: FmuSetting, times: Array, wanted: Sequence[int], way: FmuSetting, base: Array) -> Array:
        """Return derivatives (times, wanted) in a direction by central differences; one-sided where a side cannot be run."""
        by = stride(setting, way, float(times[-1]))
        ends, parts = [], []
        for side in (-by, by):
            try:
                ends.append(self.outputs(setting.moved(way, side), times, wanted))
                parts.append(side)
            except SolverError:
                continue
        if not parts:
            raise SolverError(
                "the FMU could not be run at values beside these, which a difference needs.", str(self.path), code="run.did-not-finish"
            )
        if len(parts) == 1:
            return np.asarray((ends[0] - base) / parts[0])
        return np.asarray((ends[1] - ends[0]) / (2.0 * by))

    def _run(self, setting: FmuSetting, times: Array, wanted: Sequence[int], ways: Sequence[FmuSetting]) -> tuple[Array, Array] | None:
        """Return outputs (times, wanted) and their directional derivatives (times, wanted, ways) of a run in the process of the FMU.

        The process integrates the derivatives; here they are only unpacked and checked. None when an event interrupts a run with
        directions.

        Parameters
        ----------
        ways : sequence of FmuSetting   Directions: how much each value and input changes.

        Raises
        ------
        SolverError     When the FMU refuses, its process answers nonsense, or an output is not a number.
        """
        self.runs += 1
        shape = (len(times), len(wanted), 1 + len(ways))
        size = 8 * int(np.prod(shape))
        answer = self._confined().ask(pickle.dumps((setting, times, list(wanted), list(ways))), 1 + max(size, MOST_SAID))
        if answer == EVENTS and ways:
            return None
        if answer[:1] == REFUSED:
            words = "".join(c if c.isprintable() else " " for c in answer[1:].decode("utf-8", "replace"))
            raise SolverError(words, str(self.path))
        if answer[:1] != ARRAYS or len(answer) != 1 + size:
            raise SolverError("the process of the FMU sent what is no answer.", str(self.path), code="fmu.ended")
        numbers = np.frombuffer(answer, offset=1)
        odd = np.flatnonzero(~np.isfinite(numbers))
        if odd.size:
            row, column = divmod(int(odd[0]), len(wanted)) if odd[0] < shape[0] * shape[1] else (0, 0)
            name = next(v.name for v in self.described.modelVariables if v.valueReference == wanted[column])
            raise SolverError(
                f"output '{name}' of the FMU, or its derivative, is not a number at t = {times[row]:g} s.",
                str(self.path),
                code="run.did-not-finish",
            )
        values, slopes = np.split(numbers, [len(times) * len(wanted)])
        return values.reshape(shape[:2]), slopes.reshape(*shape[:2], len(ways))


def stride(setting: FmuSetting, way: FmuSetting, end: float) -> float:
    """Return how far to move along a direction: a part `DIFFERENCE_SHARE` of what moves, of temperatures and powers over the run."""
    sizes = [abs(d) / max(abs(setting.values[k]), 1e-6) for k, d in way.values.items()]
    at = np.linspace(0.0, end, 16)
    for k, d in way.inputs.items():
        largest = max(abs(setting.inputs[k].law(float(t))) for t in at)
        sizes.append(max(abs(d.law(float(t))) for t in at) / max(largest, 1e-6))
    return DIFFERENCE_SHARE / max(max(sizes, default=1.0), 1e-300)
