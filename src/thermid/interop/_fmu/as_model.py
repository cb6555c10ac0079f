"""Somebody's FMU as a model: its parameters, inputs and temperatures by name, its runs in place of the kernel's.

In: an FMU. Out: a `Model` that fits, verdicts and predictions of records take as any other; what has no place there is refused in words.

A host of anybody's FMU: runs at values of its variables, with derivatives by its directional ones or by differences of runs.

In: an FMU of FMI 2.0 or 3.0, what is set, courses of inputs, times. Out: its outputs, and their derivatives in directions. FMPy loads it
in a process of its own; model exchange is integrated by its CVode, sensitivities beside the states; co-simulation is stepped.
"""

from __future__ import annotations

import pickle
import re
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any, Final
from weakref import finalize

import numpy as np

from thermid.base.errors import DeckError, ScenarioError, SolverError, ThermidError, UnitError, optional, quoted, refuse_first
from thermid.base.files import scratch
from thermid.base.units import DIMENSIONLESS, ICE_POINT, Array, Dimension, gradient_of, si_unit, unit, value_of
from thermid.interop._fmu.archive import DESCRIPTION, check_archive, check_trust, digest_of
from thermid.interop._fmu.description import BASES
from thermid.interop._fmu.process import ConfinedProgram
from thermid.model.tree import Constant, Drawn, Model, TableSignal, model_from_dict
from thermid.simulation.runs import Answer, Assembled, Engine, Wiring

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
        refuse_first(
            str(path),
            (
                str(described.fmiVersion)[:2] not in ("2.", "3."),
                f"it is an FMU of FMI {described.fmiVersion}; 2.0 and 3.0 are supported.",
                "file.another-kind",
            ),
            (
                described.modelExchange is None and described.coSimulation is None,
                "it offers neither model exchange nor co-simulation.",
                "file.another-kind",
            ),
            error=ThermidError,
        )
        try:
            super().__init__(path, described)
        except AttributeError as error:
            raise ThermidError("its derivatives are of no state.", str(path), code="value.wrong-kind") from error
        check_trust(path, self.digest, trust)
        with zipfile.ZipFile(path) as packed:  # FMPy does not read of FMI 3.0 whether model exchange has directional derivatives
            head = re.search(r"<ModelExchange\b[^>]*>", packed.read(DESCRIPTION).decode("utf-8", "replace"))
        offered = head is not None and re.search(r'providesDirectionalDerivatives?\s*=\s*["\'](true|1)["\']', head[0]) is not None
        self.directional = self.exchange and offered
        self.why = "" if self.directional else "the FMU offers none" if self.exchange else "it has co-simulation alone"
        self._agreeing: dict[tuple[int, ...], bool] = {}
        self._stack = ExitStack()
        finalize(self, self._stack.close)  # of a model in a circle of references too: a `__del__` comes after those of the pipes there
        self._program: ConfinedProgram | None = None

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
        """Return outputs (times, wanted) and slopes (times, wanted, ways), as `with_slopes`, by directional derivatives of the FMU.

        None where these are not offered for what moves, or are wrong: they are compared with differences of runs to `AGREE` of the
        largest, once for every set of variables that move. `wanted` are numbers of outputs.
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
            base, slopes = run
            others = (self._difference(setting, times, wanted, way, base) for way in ways)
            self._agreeing[moving] = not any(
                np.abs(other - slopes[..., k]).max(initial=0.0) > AGREE * max(float(np.abs(other).max(initial=0.0)), 1e-12)
                for k, other in enumerate(others)
            )
            why = "its directional derivatives differ from them"
        if run is None or not self._agreeing[moving]:
            self.why, self._agreeing[moving] = why, False
            return None
        return run

    def _difference(self, setting: FmuSetting, times: Array, wanted: Sequence[int], way: FmuSetting, base: Array) -> Array:
        """Return derivatives (times, wanted) in a direction `way` by central differences (y(p + h) - y(p - h)) / (2 h), h from `stride`.

        One-sided from `base` where a side cannot be run. The unit is that of the outputs per unit of length of `way`.

        Parameters
        ----------
        times : array (times,)          [s]
        wanted : sequence               Numbers of outputs.
        base : array (times, wanted)    Outputs at the values as they are.

        Raises
        ------
        SolverError   When neither side can be run.
        """
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
    """Return how far to move along a direction: `DIFFERENCE_SHARE` over the largest of |d| / |x| of the values x that it moves by d. [-]

    Of an input both are its largest over 16 instants of the run up to `end` [s].
    """
    sizes = [abs(d) / max(abs(setting.values[k]), 1e-6) for k, d in way.values.items()]
    at = np.linspace(0.0, end, 16)
    for k, d in way.inputs.items():
        largest = max(abs(setting.inputs[k].law(float(t))) for t in at)
        sizes.append(max(abs(d.law(float(t))) for t in at) / max(largest, 1e-6))
    return DIFFERENCE_SHARE / max(max(sizes, default=1.0), 1e-300)


REALS: Final = ("Real", "Float64")
_KELVIN: Final = unit("K").dimension
_WATT: Final = unit("W").dimension


@dataclass(frozen=True)
class FmuQuantity:
    """A variable of an FMU with its name here and its unit.

    Parameters
    ----------
    name, raw : str         Here, and in the FMU.
    reference : int         Its value reference.
    factor, offset : float  SI value = factor * its value + offset.
    text : str              Its SI unit.
    start : float or None   Its start. [SI]
    low, high : float or None   Its bounds. [SI]
    settable : bool         Whether its start can be set.
    plain : bool            Whether it has no unit, or one that nobody knows.
    description : str
    """

    name: str
    raw: str
    reference: int
    factor: float
    offset: float
    text: str
    start: float | None
    low: float | None
    high: float | None
    settable: bool
    plain: bool
    description: str = ""

    def in_fmu_unit(self, value: float) -> float:
        """Return an SI value in the unit of the FMU."""
        return (value - self.offset) / self.factor


@dataclass(frozen=True)
class _Measure:
    """What a unit of an FMU means."""

    factor: float = 1.0
    offset: float = 0.0
    dimension: Dimension = DIMENSIONLESS
    known: bool = True


def fmu_model(path: str | Path, trust: bool = False) -> Model:
    """Return somebody's FMU as a model: for `calibrate`, for verdicts and for the prediction of records.

    Its parameters keep their names, with an underscore for what a name here cannot hold, and their bounds; inputs in kelvins or degrees
    Celsius are boundaries, inputs in watts or without a unit are loads, and outputs and states in kelvins or degrees Celsius are nodes. An
    output without a unit is a node too: its numbers count as degrees Celsius. The names of the FMU are aliases.

    Parameters
    ----------
    path : path     The file, of FMI 2.0 or 3.0.
    trust : bool    Run its program, which has the rights of the user; remembered of this file, by its SHA-256. It runs in a process of its
                    own, with limits.

    Raises
    ------
    MissingExtraError   When FMPy is not installed.
    DeckError           When no variable of it is a temperature, or no parameter can be set.
    ThermidError        When it cannot be read, or is not trusted.
    """
    file = FmuFile(Path(path), trust)
    runner = FmuRunner.of_file(file)
    return replace(model_from_dict(runner.deck(file.digest[:16])), file=Path(path).name, runner=runner)


@dataclass(frozen=True, eq=False)
class FmuRunner:
    """What runs a model that is an FMU.

    Parameters
    ----------
    file : FmuFile
    parameters, nodes, boundaries, loads : dict     Name here -> FmuQuantity.
    remarks : tuple of str      What a reader must know.
    """

    file: FmuFile
    parameters: Mapping[str, FmuQuantity]
    nodes: Mapping[str, FmuQuantity]
    boundaries: Mapping[str, FmuQuantity]
    loads: Mapping[str, FmuQuantity]
    noted: tuple[str, ...] = ()
    memo: list[tuple[Wiring, tuple[Any, ...], int, tuple[Array, Array]]] = field(default_factory=list, repr=False)

    @classmethod
    def of_file(cls, file: FmuFile) -> FmuRunner:
        """Return the runner of a file.

        Raises
        ------
        DeckError   As in `fmu_model`.
        """
        units = _units_of(file)
        used: dict[str, str] = {}
        parameters: dict[str, FmuQuantity] = {}
        nodes: dict[str, FmuQuantity] = {}
        boundaries: dict[str, FmuQuantity] = {}
        loads: dict[str, FmuQuantity] = {}
        undriven: list[str] = []
        for v in file.described.modelVariables:
            if v.type not in REALS or v.dimensions or v.alias is not None:
                continue
            q, dimension = _quantity(v, units, used, file)
            if v.causality == "parameter" and v.start is not None:
                parameters[q.name] = q
            elif v.causality == "input":
                table = boundaries if dimension == _KELVIN else loads if dimension == _WATT or q.plain else None
                if table is None:
                    undriven.append(f"{q.raw} [{v.unit}]")
                else:
                    table[q.name] = q
            elif v.causality in ("output", "local") and v.variability in (None, "continuous") and v.derivative is None:
                if dimension == _KELVIN or (q.plain and v.causality == "output"):
                    nodes[q.name] = q
        if not nodes:
            raise DeckError(
                "no output or state of the FMU is in K or degC or without a unit, so no log can be compared with it.",
                str(file.path),
                code="model.element-not-supported",
            )
        return cls(file, parameters, nodes, boundaries, loads, tuple(_remarks(nodes, parameters, undriven)))

    @property
    def remarks(self) -> tuple[str, ...]:
        """What a reader must know of fits of it."""
        how = () if self.file.exact else (f"derivatives of the FMU '{self.file.path.name}' are {self.file.derivatives}.",)
        return (*how, *self.noted)

    @property
    def starts(self) -> Mapping[str, float]:
        """Node whose start can be set -> its own start. [K]"""
        return {n: q.start for n, q in self.nodes.items() if q.settable and q.start is not None}

    @property
    def powers(self) -> Mapping[str, float]:
        """Load -> its start. [W], or a plain number."""
        return {n: q.start or 0.0 for n, q in self.loads.items()}

    def deck(self, digest: str) -> dict[str, Any]:
        """Return the deck that stands for it; a hash of the file is part of what it means."""
        first = next(iter(self.nodes))
        every = (self.parameters, self.nodes, self.boundaries, self.loads)
        return {
            "title": self.file.described.modelName or self.file.path.stem,
            "incomplete": "; ".join(re.findall(r"\bINCOMPLETE: (.+?)\.(?= [A-Z]|$)", self.file.described.description or "")),
            "box": "black",
            "use": f"an FMU of FMI {self.file.described.fmiVersion}, sha256 {digest}",
            "needs": list(self.boundaries),
            "parameters": {n: _entry(q) for n, q in self.parameters.items()},
            "nodes": {n: {"capacitance": "1 [J/K]"} for n in self.nodes},
            "loads": {n: {"into": first, "power": f"{1.0 if q.plain else q.start or 0.0!r} [W]"} for n, q in self.loads.items()},
            "aliases": {q.raw: n for table in every for n, q in table.items() if q.raw != n},
        }

    def run(self, engine: Engine, a: Assembled, times: Array, nodes: Sequence[str], end: float, gradients: bool) -> Answer:
        """Return temperatures of nodes at times, from zero to `end` [s], as `Engine.integrate` does.

        Raises
        ------
        ScenarioError   When a scenario asks for what an FMU cannot do.
        SolverError     When it cannot be run.
        """
        wiring = engine.wiring
        self._check(wiring, a, nodes)
        size = len(wiring.free) if gradients else 0
        numbers = {n: a.numbers.values[n] for n in self.parameters}
        index = {n: k for k, n in enumerate(a.reduced.nodes)}
        values = {q.reference: q.in_fmu_unit(value_of(numbers[n])) for n, q in self.parameters.items()}
        starts = self._starts(wiring, a, index)
        values |= {q.reference: q.in_fmu_unit(float(a.initial[index[n]])) for n, q in starts.items()}
        inputs = {q.reference: _course(*self._boundary(wiring, a, n, q)) for n, q in self.boundaries.items()}
        inputs |= {q.reference: _course(*self._load(engine, a, n, q)) for n, q in self.loads.items()}
        setting, ways = FmuSetting(values, inputs), []
        for k in range(size):
            moved = {q.reference: float(gradient_of(numbers[n], size)[k]) / q.factor for n, q in self.parameters.items()}
            moved |= {q.reference: float(a.initial_gradient[index[n], k]) / q.factor for n, q in starts.items()}
            ways.append(FmuSetting({r: d for r, d in moved.items() if d}, self._driven(engine, a, k, size)))
        wanted = [self.nodes[n] for n in nodes]
        at = np.unique(np.append(times, end)) if end > 0 else np.unique(times)
        key = (tuple(values.items()), a.coefficients.tobytes(), a.initial.tobytes(), at.tobytes(), tuple(nodes))
        outputs, slopes = self._cached_run(
            wiring, key, size, lambda: self.file.with_slopes(setting, at, [q.reference for q in wanted], ways)
        )
        factor, offset = (np.array([getattr(q, key) for q in wanted]) for key in ("factor", "offset"))
        rows = np.searchsorted(at, times)
        kelvin, moves = factor * outputs + offset, factor[:, None] * slopes
        last = dict(zip(nodes, kelvin[-1], strict=True))
        final = np.array([last.get(n, np.nan) for n in a.reduced.nodes])
        statistics = {"method": "FMU", "reason": self.file.derivatives, "steps": 0, "rejected": 0, "switchings": []}
        flows = (np.zeros(len(engine.load_names)), np.zeros(len(wiring.network.boundaries)), np.zeros(0))
        return Answer(kelvin[rows], moves[rows], a.initial, final, *flows, end, statistics, np.zeros(0, dtype=np.int32))

    def _cached_run(self, wiring: Wiring, key: tuple[Any, ...], size: int, make: Callable[[], tuple[Array, Array]]) -> tuple[Array, Array]:
        """Return a run, or the latest one of the same wiring and numbers, where that has the derivatives that are asked for.

        It is temperatures (times, nodes) [K] and derivatives (times, nodes, size), `size` how many; `make` computes both.
        """
        for other, same, had, result in self.memo:
            if other is wiring and same == key and had in (size, *([] if size else [len(wiring.free)])):
                return result[0], result[1][..., :size]
        new_result = make()
        self.memo[:] = [*self.memo[-3:], (wiring, key, size, new_result)]
        return new_result

    def _check(self, wiring: Wiring, a: Assembled, nodes: Sequence[str]) -> None:
        """Refuse what an FMU cannot do."""
        where = f"{self.file.path.name}, {wiring.scenario.title}"
        strange = [n for n in nodes if n not in self.nodes]
        if strange or set(a.reduced.nodes) != set(self.nodes):
            words = "a node of an FMU can be neither prescribed nor carry a sensor with a lag, a heat capacity or leads"
            raise ScenarioError(f"{words}: nothing can be added to its equations.", where, code="model.element-not-supported")
        if wiring.schedule is not None:
            raise ScenarioError(
                "parameters of an FMU cannot follow a schedule. Give them one value for the run.", where, code="model.element-not-supported"
            )

    def _starts(self, wiring: Wiring, a: Assembled, index: Mapping[str, int]) -> dict[str, FmuQuantity]:
        """Return the nodes whose start is set: where the scenario gives one, or a fit looks for it."""
        stated_starts = set(wiring.scenario.initial) | {n.partition(".")[2] for n in wiring.free if n.startswith("initial.")}
        whole = wiring.scenario.start != ""
        fixed = [n for n in wiring.free if n.startswith("initial.") and not self.nodes[n.partition(".")[2]].settable]
        if fixed:
            raise ScenarioError(
                f"the start of '{fixed[0].partition('.')[2]}' follows from others in the FMU, so it cannot be looked for.",
                str(self.file.path),
                code="model.element-not-supported",
            )
        return {n: q for n, q in self.nodes.items() if q.settable and (whole or n in stated_starts)}

    def _boundary(self, wiring: Wiring, a: Assembled, name: str, q: FmuQuantity) -> tuple[Drawn, float, float]:
        """Return signal, factor and offset of an input in kelvins, in the unit of the FMU."""
        signal, shift = wiring.signals[f"boundary {name}"], value_of(a.offsets[name])
        if isinstance(signal, Constant):
            return Constant(shift), 1.0 / q.factor, -q.offset / q.factor
        return signal, 1.0 / q.factor, (shift - q.offset) / q.factor

    def _load(self, engine: Engine, a: Assembled, name: str, q: FmuQuantity) -> tuple[Drawn, float, float]:
        """Return signal, factor and offset of an input in watts or without a unit."""
        wiring = engine.wiring
        is_driven = name in wiring.scenario.loads or name in wiring.scenario.commands or f"scale.{name}" in wiring.free
        if q.plain and not is_driven:
            return Constant(q.start or 0.0), 1.0, 0.0
        place = next(p.places[0] for p in wiring.structure.loads if p.row.name == name)
        return wiring.signals[f"load {name}"], float(a.coefficients[place]) / q.factor, 0.0

    def _driven(self, engine: Engine, a: Assembled, k: int, size: int) -> dict[int, InputCourse]:
        """Return value reference -> derivative of an input with respect to a free name, of those that it moves."""
        out = {}
        wiring = engine.wiring
        for name, q in self.boundaries.items():
            slope = float(gradient_of(a.offsets[name], size)[k])
            if slope:
                out[q.reference] = InputCourse.constant(slope / q.factor)
        if a.jacobian is not None:
            begin, columns, data = a.jacobian
            for name, q in self.loads.items():
                for beside in (name, f"noise {name}"):  # a power of 1 W that the noise of a logged one is followed by
                    for place in (p.places[0] for p in wiring.structure.loads if p.row.name == beside):
                        row = slice(begin[place], begin[place + 1])
                        slope = float(data[row][columns[row] == k].sum())
                        if slope:
                            out[q.reference] = _course(wiring.signals[f"load {beside}"], slope / q.factor, 0.0)
        return out


def _entry(q: FmuQuantity) -> dict[str, Any]:
    """Return the entry of a parameter in a deck: start value with its unit, bounds as `min` and `max`, description as `note`."""
    of = "" if q.text == "1" else f" [{q.text}]"
    bounds = {key: b for key, b in (("min", q.low), ("max", q.high)) if b is not None}
    return {"value": f"{q.start!r}{of}", **bounds, **({"note": q.description} if q.description else {})}


def _remarks(nodes: Mapping[str, FmuQuantity], parameters: Mapping[str, FmuQuantity], undriven: Sequence[str]) -> Iterator[str]:
    """Yield remarks on an FMU: nodes and parameters without a known unit, inputs that no log drives."""
    plain = [q.raw for q in nodes.values() if q.plain]
    if plain:
        yield f"{quoted(plain)} of the FMU: no unit is given, so numbers count as degC, and their differences as K."
    if undriven:
        yield f"inputs {quoted(undriven)} of the FMU keep their starts: no log drives them."
    unsaid = [q.raw for q in parameters.values() if q.plain]
    if unsaid:
        yield f"parameters {quoted(unsaid)} of the FMU have no unit that is known: they are plain numbers."


def _units_of(file: FmuFile) -> dict[str, _Measure]:
    """Return unit of the FMU -> what it means, by its own definitions; else by the words that are known here."""
    out: dict[str, _Measure] = {}
    for u in file.described.unitDefinitions:
        base = u.baseUnit
        if base is not None and not (base.mol or base.cd):
            dimension = tuple(Fraction(getattr(base, b)) for b in BASES)
            out[u.name] = _Measure(float(base.factor), float(base.offset), dimension)
    for name in {v.unit or (v.declaredType.unit if v.declaredType is not None else None) for v in file.described.modelVariables}:
        if name and name not in out:  # such as W/(m2.K)
            try:
                of = unit(re.sub(r"(?<=[A-Za-z])(-?\d+)", r"^\1", name).replace(".", " "))
                out[name] = _Measure(float(of.factor), float(of.offset), of.dimension)
            except UnitError:
                out[name] = _Measure(known=False)
    return out


def _quantity(v: Any, units: Mapping[str, _Measure], used: dict[str, str], file: FmuFile) -> tuple[FmuQuantity, Dimension]:
    """Return a variable with its name here, and its dimension."""
    kind = v.declaredType
    attributes = {key: getattr(v, key) or (getattr(kind, key, None) if kind is not None else None) for key in ("unit", "min", "max")}
    of = units.get(attributes["unit"] or "", _Measure())
    name = re.sub(r"\W", "_", v.name)
    name = name if name[:1].isalpha() else f"v_{name}"
    if used.setdefault(name, v.name) != v.name:
        raise DeckError(
            f"'{v.name}' and '{used[name]}' would both be called '{name}'. Rename one of them where the FMU is made.",
            str(file.path),
            code="name.taken",
        )
    # without a unit a temperature is a number of degrees Celsius
    plain = not of.known or of.dimension == DIMENSIONLESS
    offset = ICE_POINT if plain and v.causality == "output" else of.offset

    def si(number: Any) -> float | None:
        """Return a number of the FMU in SI."""
        return None if number is None else of.factor * float(number) + offset

    start, low, high = si(v.start), si(attributes["min"]), si(attributes["max"])
    if start is not None and not np.isfinite(start):
        raise DeckError(f"the start of '{v.name}' is not a finite number.", str(file.path), code="value.wrong-kind")
    # between equal bounds nothing can move, and a difference of units has no offset
    settable = v.variability != "constant" and v.initial == "exact" and v.causality in ("output", "local")
    quantity = FmuQuantity(
        name,
        v.name,
        int(v.valueReference),
        of.factor,
        offset,
        si_unit(of.dimension),
        start,
        low,
        high,
        settable,
        plain,
        v.description or "",
    )
    return quantity, of.dimension


def _course(signal: Drawn, factor: float, offset: float) -> InputCourse:
    """Return a signal as a course of an input: factor times its value, plus `offset`.

    A held table jumps where its levels change; one that is straight between samples has their median distance as step. [s]
    """
    if isinstance(signal, Constant):
        return InputCourse.constant(factor * signal.value + offset)
    if isinstance(signal, TableSignal):
        times, values = signal.instants, factor * signal.levels + offset
        if signal.held:
            return InputCourse(partial(_held, times, values), times[1:][np.diff(values) != 0.0])
        step = float(np.median(np.diff(times))) if times.size > 1 else np.inf
        return InputCourse(partial(_between, times, values), step=step)
    return InputCourse(partial(_drawn, signal, factor, offset))


def _held(times: Array, values: Array, time: float) -> float:
    """Return the value that stands at a time, held from the sample before."""
    return float(values[max(int(np.searchsorted(times, time, side="right")) - 1, 0)])


def _between(times: Array, values: Array, time: float) -> float:
    """Return the value at a time, on a straight line between samples."""
    return float(np.interp(time, times, values))


def _drawn(signal: Drawn, factor: float, offset: float, time: float) -> float:
    """Return ``factor * signal + offset`` at a time. [s]"""
    return factor * float(np.ravel(signal.at(np.array([time])))[0]) + offset
