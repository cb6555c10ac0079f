"""From a scenario to the inputs of a network: which signal multiplies which coefficient."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.dual import Dual, Number, value_of
from thermid.errors import DeckError, ScenarioError, nearest
from thermid.model.laws.signal import Constant, Drawn, Mixed, Signal, Sine, Table, multiplied, pulses, signal, together
from thermid.network.network import Network, Numbers
from thermid.network.rows import ConductorRow, LoadRow
from thermid.simulation.scenarios.scenario import Scenario
from thermid.units import TEMPERATURE, require

Array = NDArray[np.float64]


def normalised(network: Network, scenario: Scenario) -> Scenario:
    """Return the scenario with canonical names, and a temperature for every boundary.

    Raises
    ------
    NameNotFoundError   When it names a node or load that does not exist.
    ScenarioError       When a boundary has no temperature.
    """
    flat, where = network.flat, scenario.title
    known = [load.path for load in flat.loads]

    def load(name: str) -> str:
        path = flat.names.model.canonical(name)
        if path not in known:
            raise ScenarioError(f"no load '{name}'.{nearest(path, known)}", where)
        return path

    def gain(name: str) -> str:
        path = flat.names.model.canonical(name)
        if path not in flat.parameters.table:
            raise ScenarioError(f"no parameter '{name}'.{nearest(path, flat.parameters.table)}", where)
        require(flat.parameters.dimension(path), "W", flat.parameters.table[path].parameter.unit)
        return path

    boundaries = {network.find(k, where): v for k, v in scenario.boundaries.items()}
    boundaries |= {network.find(k, where): v for k, v in scenario.prescribed.items()}
    for name in boundaries:
        if name not in network.boundaries:
            raise ScenarioError(
                f"'{name}' is a node with its own balance, not a boundary. To drive it by a given temperature put it under 'prescribed'.",
                where,
            )
    for name in network.boundaries:
        if name not in boundaries:
            raise ScenarioError(
                f"boundary '{name}' of {network.title} has no temperature. Give it one in the scenario's boundaries.", where
            )
    loads = {load(k): v for k, v in scenario.loads.items()}
    commands = {load(k): v for k, v in scenario.commands.items()}
    both = sorted(set(loads) & set(commands))
    if both:
        raise ScenarioError(f"load '{both[0]}' has both a power and a command; give one of them.", where)
    gains = {load(k): gain(v) for k, v in scenario.gains.items()}
    initial = {network.find(k, where): v for k, v in scenario.initial.items()}
    scenario.check_spans()
    return replace(scenario, boundaries=boundaries, loads=loads, commands=commands, gains=gains, initial=initial, prescribed={})


@dataclass(frozen=True)
class Curvature:
    """What the curvature of a command's law is multiplied by: s (s - 1)."""

    def __call__(self, command: Array) -> Array:
        """Return s (s - 1) of a command (times,). [-]"""
        return command * (command - 1.0)


def load_inputs(network: Network, scenario: Scenario, numbers: Numbers) -> dict[str, Signal]:
    """Return input name -> signal for every load row; a load without signal is on at full power.

    A power given by the scenario is marked ``watts <load>``: it stands in place of the deck's own.
    """
    out: dict[str, Signal] = {}
    for load in network.flat.loads:
        command: Signal = scenario.commands.get(load.path, Constant(1.0))
        if load.flux is not None:
            command = multiplied(command, load.flux(scenario.boundaries))
        if "periodic.period" in load.fields:
            command = multiplied(command, _square(load.fields, numbers.values, load.where))
        watts = scenario.loads.get(load.path)
        if watts is not None:
            if load.curve is not None:
                raise ScenarioError(
                    f"the power of '{load.path}' is a table, which a power of the scenario cannot stand in place of. Give it a command.",
                    scenario.title,
                )
            out[f"watts {load.path}"] = watts
            command = watts
        out[f"load {load.path}"] = command
        out[f"curve {load.path}"] = Constant(0.0) if watts is not None else Mixed(Curvature(), (command,))
        if "sine.amplitude" in load.fields:
            period = value_of(numbers.values[load.fields["sine.period"]])
            wave: Signal = Constant(0.0) if watts is not None else Sine(0.0, 1.0, period)
            square = _square(load.fields, numbers.values, load.where) if "periodic.period" in load.fields else Constant(1.0)
            out[f"sine {load.path}"] = multiplied(wave, square)
    return out


def _square(fields: Mapping[str, str], values: Mapping[str, Any], where: str) -> Signal:
    """Return the on-off signal of a periodic load: on first, for `duty` of every period."""
    period, duty = (value_of(values[fields[f"periodic.{k}"]]) for k in ("period", "duty"))
    if not (period > 0 and 0.0 <= duty <= 1.0):
        raise DeckError(f"a periodic load needs a period above zero and a duty from 0 to 1, not {period:g} s and {duty:g}.", where)
    return pulses(period, duty)


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


def scheduled(network: Network, schedule: Schedule, free: Mapping[str, Number]) -> tuple[Numbers, dict[tuple[str, int, int], Drawn]]:
    """Return the numbers at the reference sample, and which coefficient follows which signal.

    Keys of the second are (row's name, position among the rows of that name, coefficient). A coefficient that changes is its value at the
    reference sample times a signal; its derivatives must then scale with it, which holds for every product. One that vanishes there has
    the sample at which it is largest for its own reference.

    Raises
    ------
    ScenarioError   When a capacitance would change, or a freed parameter and a scheduled one do not act as a product.
    """
    clash = sorted(set(schedule.signals) & set(free))
    if clash:
        raise ScenarioError(f"'{clash[0]}' follows a schedule, so it cannot be freed. Free what multiplies it.", network.title)
    sets = [network.numbers({**free, **schedule.overrides(k)}) for k in range(len(schedule.rows))]
    for node, first in sets[0].capacitances.items():
        if first is not None and any(value_of(s.capacitances[node] or 0.0) != value_of(first) for s in sets):
            raise ScenarioError(
                f"the capacitance of '{node}' would change with the schedule; only conductors and loads can.", network.title
            )
    reference = max(range(len(sets)), key=lambda k: _magnitude(sets[k]))
    base = sets[reference]
    out: dict[tuple[str, int, int], Drawn] = {}
    every: list[tuple[ConductorRow | LoadRow, ...]] = [(*s.conductors, *s.loads) for s in sets]
    seen: dict[str, int] = {}
    kept: list[tuple[Number, ...]] = []
    for r, row in enumerate(every[reference]):
        position = seen.get(row.name, 0)
        seen[row.name] = position + 1
        several = [[rows[r].coefficients[c] for rows in every] for c in range(len(row.coefficients))]
        kept.append(tuple(own[reference] if value_of(own[reference]) else max(own, key=lambda v: abs(value_of(v))) for own in several))
        for c, (mine, own) in enumerate(zip(kept[r], several, strict=True)):
            ratio = _ratios(mine, own, row.name, network.title)
            if ratio is not None:
                moving = (
                    Table(schedule.times, ratio[schedule.index], schedule.hold) if schedule.times.size > 1 else Constant(float(ratio[0]))
                )
                out[row.name, position, c] = moving
    count = len(base.conductors)
    conductors = tuple(replace(row, coefficients=own) for row, own in zip(base.conductors, kept[:count], strict=True))
    loads = tuple(replace(row, coefficients=own) for row, own in zip(base.loads, kept[count:], strict=True))
    return replace(base, conductors=conductors, loads=loads), out


def _magnitude(numbers: Numbers) -> float:
    """Return a size by which the reference sample is chosen: one at which no scheduled coefficient vanishes, if there is any."""
    rows: tuple[ConductorRow | LoadRow, ...] = (*numbers.conductors, *numbers.loads)
    return float(sum(np.log1p(abs(value_of(r.coefficients[0]))) for r in rows))


def _ratios(mine: Number, values: list[Number], name: str, title: str) -> Array | None:
    """Return each value over the reference one, or None when nothing changes."""
    plain = np.array([value_of(v) for v in values])
    base = value_of(mine)
    if (plain == base).all():
        return None
    ratio = plain / base
    if isinstance(mine, Dual):
        for r, v in zip(ratio, values, strict=True):
            if isinstance(v, Dual) and not np.allclose(v.gradient, r * mine.gradient, rtol=1e-9, atol=1e-12 * np.abs(mine.gradient).max()):
                raise ScenarioError(
                    f"in '{name}' a freed parameter and a scheduled one do not act as a product, so their effects cannot be told apart.",
                    title,
                )
    return ratio


Courses = Mapping[tuple[str, int, int], Signal]


def check_courses(numbers: Numbers, follow: Courses, wired: Courses, title: str) -> None:
    """Refuse values at which a scheduled coefficient changes otherwise in time than it was wired to; one that is zero may stay so.

    Raises
    ------
    ScenarioError   When a parameter that changes from run to run and a scheduled one do not act as a product.
    """
    for key in {*follow, *wired}:
        if key in follow and key in wired and _same_course(follow[key], wired[key]):
            continue
        every: tuple[ConductorRow | LoadRow, ...] = (*numbers.conductors, *numbers.loads)
        rows = [r for r in every if r.name == key[0]]
        if key not in follow and value_of(rows[key[1]].coefficients[key[2]]) == 0.0:
            continue
        raise ScenarioError(
            f"in '{key[0]}' a parameter that changes from run to run and a scheduled one do not act as a product, so one schedule does not "
            "serve all runs. Run them one by one, with with_values.",
            title,
        )


def _same_course(one: Signal, other: Signal) -> bool:
    """Whether two signals are the same in time, to rounding."""
    end = max(one.extent, other.extent)
    mine, others = one.knots(0.0, end), other.knots(0.0, end)
    return np.array_equal(mine, others) and np.allclose(one.at(mine), other.at(mine), rtol=1e-9, atol=1e-12)
