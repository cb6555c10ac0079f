"""Somebody's FMU as a model: its parameters, inputs and temperatures by name, its runs in place of the kernel's.

In: an FMU. Out: a `Model` that fits, verdicts and predictions of records take as any other; what has no place there is refused in words.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np

from thermid.base.errors import DeckError, ScenarioError, UnitError, quoted
from thermid.base.linear_algebra import Array, gradient_of, value_of
from thermid.base.units import DIMENSIONLESS, ICE_POINT, Dimension, si_unit, unit
from thermid.interop._fmu.description import BASES
from thermid.interop._fmu.host import FmuFile, FmuSetting, InputCourse
from thermid.model.deck import model_from_dict
from thermid.model.tree import Constant, Drawn, Model, TableSignal
from thermid.simulation.solver import Answer, Assembled, Engine, Wiring

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
    model = model_from_dict(runner.deck(file.digest[:16]))
    return replace(model, file=Path(path).name, runner=runner)


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
        none = np.zeros(0)
        flows = (np.zeros(len(engine.load_names)), np.zeros(len(wiring.network.boundaries)), none)
        return Answer(kelvin[rows], moves[rows], a.initial, final, *flows, end, statistics, np.zeros(0, dtype=np.int32))

    def _cached_run(self, wiring: Wiring, key: tuple[Any, ...], size: int, make: Callable[[], tuple[Array, Array]]) -> tuple[Array, Array]:
        """Return a run, or the latest one of the same wiring and numbers, where that has the derivatives that are asked for."""
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
    """Return a signal as a course of an input: its value times a factor, and a constant."""
    if isinstance(signal, Constant):
        return InputCourse.constant(factor * signal.value + offset)
    if isinstance(signal, TableSignal):
        times, values = signal.instants, factor * signal.levels + offset
        if signal.held:
            jumps = times[1:][np.diff(values) != 0.0]
            return InputCourse(partial(_held, times, values), jumps)
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
