"""Parameters that follow signals: which coefficients of the network change with them, and how, the same for every set of values.

A coefficient that changes is its value at a sample of reference times a signal. That holds where the scheduled parameters act as factors,
and it is checked at every set of values: of one run, with derivatives, or of all members of an ensemble at once.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from thermid.dual import Dual, Number, value_of
from thermid.errors import ScenarioError
from thermid.linear_algebra import Array
from thermid.model.laws.signal import Constant, Drawn, Signal, TableSignal, signal, together
from thermid.network.network import Network, Numbers, Varied
from thermid.simulation.scenarios.scenario import Scenario
from thermid.units import TEMPERATURE

ROUNDING = 1e-13
"""Share of its largest value below which a scheduled value is zero. [-]"""
SAME = (1e-9, 1e-12)
"""How far a coefficient over its reference may lie from its course, relative and absolute. [-]"""


def _with_zeros(times: Array, columns: Array) -> Array:
    """Return times (times,) with the instants at which straight lines between samples (times, signals) pass zero."""
    before, after = columns[:-1], columns[1:]
    rows, which = np.nonzero(before * after < 0.0)
    share = before[rows, which] / (before[rows, which] - after[rows, which])
    return np.union1d(times, times[rows] + share * (times[rows + 1] - times[rows]))


class Schedule:
    """Parameters that follow signals.

    Parameters
    ----------
    signals : dict      Parameter path -> signal. [SI]
    times : array       Times at which any of them must be sampled. [s]
    hold : bool         Whether all of them hold between samples.
    """

    def __init__(self, signals: Mapping[str, Signal], duration: float) -> None:
        self.signals = dict(signals)
        drawn = [s.drawn(duration) for s in signals.values()]
        self.times, self.hold = together(drawn, duration)
        columns = np.column_stack([s.at(self.times) for s in drawn])
        if not self.hold:  # a flow that turns has a knot where it is zero
            self.times = _with_zeros(self.times, columns)
            columns = np.column_stack([s.at(self.times) for s in drawn])
            columns[np.abs(columns) < ROUNDING * np.abs(columns).max(axis=0, initial=0.0)] = 0.0
        self.rows, self.index = np.unique(columns, axis=0, return_inverse=True)
        self.index = self.index.ravel()

    def overrides(self, k: int) -> dict[str, float]:
        """Return path -> value of the k-th distinct combination. [SI]"""
        return dict(zip(self.signals, self.rows[k].tolist(), strict=True))


def read_schedule(network: Network, scenario: Scenario) -> Schedule | None:
    """Return the schedule of a scenario with every signal in SI, or None.

    Raises
    ------
    NameNotFoundError   When it names no parameter.
    UnitError           When a signal has another dimension than its parameter.
    """
    if not scenario.schedule:
        return None
    parameters = network.flat.parameters
    signals = {}
    for raw, value in scenario.schedule.items():
        where = f"{scenario.title}, schedule.{raw}"
        path = parameters.freeable(raw, network.flat.names.model.canonical)
        literal = parameters.table[path].parameter.expression.literal
        slot = TEMPERATURE if literal and literal.unit.absolute else literal.unit.text if literal else "1"
        signals[path] = signal(value, slot, where)
    return Schedule(signals, scenario.seconds)


@dataclass(frozen=True, eq=False)
class Course:
    """How one coefficient changes.

    Parameters
    ----------
    sample : int                Of reference, at which it does not vanish.
    ratio : array (samples,)    Its value at each distinct sample over that at the reference. [-]
    """

    sample: int
    ratio: Array


@dataclass(frozen=True, eq=False)
class Courses:
    """Which coefficients of a network follow a schedule.

    Parameters
    ----------
    network : Network
    schedule : Schedule
    reference : int     The sample at whose values everything else is taken.
    places : tuple      Of each row that the schedule reaches: its place among conductors, loads and controls.
    names : tuple       Of each such row: its name, and its position among the rows of that name.
    table : dict        (row among these, coefficient) -> Course.
    """

    network: Network
    schedule: Schedule
    reference: int
    places: tuple[int, ...]
    names: tuple[tuple[str, int], ...]
    table: Mapping[tuple[int, int], Course]

    @classmethod
    def of(cls, network: Network, schedule: Schedule) -> Courses:
        """Return the courses at the model's own values.

        Raises
        ------
        ScenarioError   When a capacitance would change.
        """
        kept, names = network.parts(), tuple(schedule.signals)
        sets = [network.varied(kept, schedule.overrides(k), names) for k in range(len(schedule.rows))]
        places = network.places(kept, names)
        for own in sets:
            _check_masses(own, sets[0], network.title)
        moved = len(places) - len(network.controls)
        sizes = [sum(np.log1p(abs(value_of(row.coefficients[0]))) for row in own.rows[:moved]) for own in sets]
        reference = int(np.argmax(sizes))
        table = {}
        for r, row in enumerate(sets[reference].rows):
            for c in range(len(row.coefficients)):
                values = np.array([value_of(own.rows[r].coefficients[c]) for own in sets])
                sample = reference if values[reference] else int(np.abs(values).argmax())
                if (values != values[sample]).any():
                    table[r, c] = Course(sample, values / values[sample])
        return cls(network, schedule, reference, places, _named(network, kept, places), table)

    @property
    def signals(self) -> dict[tuple[str, int, int], Drawn]:
        """(row's name, position among the rows of that name, coefficient) -> what it follows."""
        times, index, hold = self.schedule.times, self.schedule.index, self.schedule.hold
        out: dict[tuple[str, int, int], Drawn] = {}
        for (r, c), course in self.table.items():
            ratio = course.ratio[index]
            out[(*self.names[r], c)] = TableSignal(times, ratio, hold) if times.size > 1 else Constant(float(ratio[0]))
        return out

    def numbers(self, free: Mapping[str, Number]) -> Numbers:
        """Return the numbers at the samples of reference, with some parameters replaced; `free` is path -> number. [SI]

        Raises
        ------
        ScenarioError   When a capacitance would change, or a freed parameter and a scheduled one do not act as a product.
        """
        network, schedule, names = self.network, self.schedule, tuple(self.schedule.signals)
        clash = sorted(set(names) & set(free))
        if clash:
            raise ScenarioError(f"'{clash[0]}' follows a schedule, so it cannot be freed. Free what multiplies it.", network.title)
        kept = network.parts({**free, **schedule.overrides(self.reference)})

        def at(k: int) -> Varied:
            return network.varied(kept, {**free, **schedule.overrides(k)}, names)

        first = {k: at(k) for k in {self.reference, *(course.sample for course in self.table.values())}}
        base = first[self.reference]
        mine = [list(row.coefficients) for row in base.rows]
        for (r, c), course in self.table.items():
            mine[r][c] = first[course.sample].rows[r].coefficients[c]
        for k in range(len(schedule.rows)) if free else ():
            own = first[k] if k in first else at(k)
            _check_masses(own, base, network.title)
            self._check(k, own, mine)
        return self._laid(base, mine)

    def _check(self, k: int, own: Varied, mine: list[list[Number]]) -> None:
        """Refuse values at which a coefficient of a sample is not its reference times its course."""
        for r, row in enumerate(own.rows):
            for c, number in enumerate(row.coefficients):
                course, value, base = self.table.get((r, c)), value_of(number), value_of(mine[r][c])
                ratio = 1.0 if course is None else float(course.ratio[k])
                slack = 0.0 if course is None else SAME[1] + SAME[0] * abs(ratio)
                if not np.abs(value - ratio * base) <= slack * np.abs(base):
                    raise ScenarioError(
                        f"in '{row.name}' a parameter that changes from run to run and a scheduled one do not act as a product, so one "
                        "schedule does not serve all runs. Run them one by one, with with_values.",
                        self.network.title,
                    )
                if course is not None and not _same_slopes(number, ratio, mine[r][c]):
                    raise ScenarioError(
                        f"in '{row.name}' a freed parameter and a scheduled one do not act as a product, so their effects cannot be told "
                        "apart.",
                        self.network.title,
                    )

    def _laid(self, base: Varied, mine: list[list[Number]]) -> Numbers:
        """Return the numbers of a sample with other coefficients of the rows that the schedule reaches."""
        whole = self.network.numbers_of(base.parts)
        rows: list[Any] = [*whole.conductors, *whole.loads, *whole.controls]
        count, rest = len(whole.conductors), len(whole.conductors) + len(whole.loads)
        for r in dict.fromkeys(r for r, _ in self.table):
            place, own = self.places[r], tuple(mine[r])
            row = rows[place]
            rows[place] = replace(row, law=replace(row.law, coefficients=own)) if place < count else replace(row, coefficients=own)
        return replace(whole, conductors=tuple(rows[:count]), loads=tuple(rows[count:rest]), controls=tuple(rows[rest:]))


def _named(network: Network, kept: Mapping[str, Any], places: tuple[int, ...]) -> tuple[tuple[str, int], ...]:
    """Return the name of the row at each place, and its position among the rows of that name."""
    whole = network.numbers_of(kept)
    names = [*(row.name for row in whole.conductors), *(row.name for row in whole.loads), *(row.name for row in whole.controls)]
    seen: dict[str, int] = {}
    every = []
    for name in names:
        every.append((name, seen.get(name, 0)))
        seen[name] = seen.get(name, 0) + 1
    return tuple(every[k] for k in places)


def _check_masses(own: Varied, first: Varied, title: str) -> None:
    for node, capacitance in own.capacitances.items():
        before = first.capacitances[node]
        if capacitance is not None and before is not None and value_of(capacitance) != value_of(before):
            raise ScenarioError(f"the capacitance of '{node}' would change with the schedule; only conductors and loads can.", title)


def _same_slopes(number: Number, ratio: float, base: Number) -> bool:
    """Whether the derivatives of a number are those of its reference times a ratio; a number without any has no say."""
    if not isinstance(number, Dual) or not isinstance(base, Dual) or not base.gradient.size:
        return True
    return np.allclose(number.gradient, ratio * base.gradient, rtol=1e-9, atol=1e-12 * float(np.abs(base.gradient).max()))
