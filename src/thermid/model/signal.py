"""Signals: what changes with time - a boundary temperature, a power, a scheduled parameter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.errors import ScenarioError, ThermidError
from thermid.expression import parse
from thermid.units import require
from thermid.units import unit as read_unit

__all__ = ["Constant", "Signal", "Sine", "Table", "literal", "signal"]


@dataclass(frozen=True)
class Constant:
    """A value that does not change. [SI]"""

    value: float

    def at(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values (times,) at times [s]. [SI]"""
        return np.full(times.shape, self.value)


@dataclass(frozen=True, eq=False)
class Table:
    """Samples, joined by straight lines or held until the next one; constant beyond both ends.

    Parameters
    ----------
    times : array (samples,)    Strictly increasing. [s]
    values : array (samples,)   [SI]
    hold : bool                 Whether each value holds until the next sample.
    unit : str                  Unit in which a log had the values; what it stands for must be of the same dimension. Empty where none said.
    log : (str, float) or None  Of a column of a log: the hash of its samples, and the time in it that is zero here. [s]
    """

    times: NDArray[np.float64]
    values: NDArray[np.float64]
    hold: bool = False
    unit: str = ""
    log: tuple[str, float] | None = None

    def __post_init__(self) -> None:
        """Refuse tables that are no function of time."""
        if self.times.ndim != 1 or self.times.shape != self.values.shape or self.times.size == 0:
            raise ScenarioError("a table needs as many values as times, and at least one.")
        if not (np.isfinite(self.times).all() and np.isfinite(self.values).all()):
            raise ScenarioError("a table holds a time or a value that is not a number.")
        if (np.diff(self.times) <= 0).any():
            k = int(np.argmax(np.diff(self.times) <= 0))
            raise ScenarioError(f"times of a table must increase; {self.times[k + 1]:g} s follows {self.times[k]:g} s.")

    def at(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values (times,) at times [s]. [SI]"""
        if self.hold:
            index = np.clip(np.searchsorted(self.times, times, side="right") - 1, 0, None)
            return self.values[index]
        return np.interp(times, self.times, self.values)


@dataclass(frozen=True)
class Sine:
    """A mean and a sine: mean + amplitude sin(2 pi t / period + phase).

    Parameters
    ----------
    mean, amplitude : float   [SI]
    period : float            [s]
    phase : float             [rad]
    """

    mean: float
    amplitude: float
    period: float
    phase: float = 0.0

    def at(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values (times,) at times [s]. [SI]"""
        return self.mean + self.amplitude * np.sin(2.0 * np.pi * times / self.period + self.phase)


Signal = Constant | Table | Sine


def literal(text: str | float, slot: str, where: str = "") -> float:
    """Return the SI value of a number with a unit, checked against a slot.

    Raises
    ------
    ThermidError   When it is not a number, or of another dimension.
    """
    try:
        expression = parse(text if isinstance(text, str) else repr(float(text)))
        if expression.literal is None:
            raise ScenarioError(f"'{text}' must be a number with a unit; names have no value here.")
        require(expression.literal.unit.dimension, slot, expression.literal.unit.text, expression.literal.unit.absolute)
        return expression.literal.value
    except ThermidError as error:
        raise error.located(where) from None


def signal(value: Any, slot: str, where: str = "") -> Signal:
    """Return a signal from what a scenario writes.

    Parameters
    ----------
    value : str, number, table or Signal
        ``"24 [degC]"``; ``{times = ["0 [s]", "1 [h]"], values = ["24 [degC]", "25 [degC]"], hold = false}``;
        ``{mean = "24 [degC]", amplitude = "3 [K]", period = "24 [h]", phase = 0.0}``; a pair (times, values) of arrays in SI.
    slot : str      What it must be: a unit text or `temperature`.

    Raises
    ------
    ThermidError    When it is none of these.
    """
    if isinstance(value, Table) and value.unit:
        of = read_unit(value.unit)
        try:
            require(of.dimension, slot, value.unit, of.absolute)
        except ThermidError as error:
            raise error.located(where) from None
    if isinstance(value, Constant | Table | Sine):
        return value
    if isinstance(value, Mapping):
        return _from_table(value, slot, where)
    if isinstance(value, tuple) and len(value) == 2 and not isinstance(value[0], str):
        return Table(np.asarray(value[0], dtype=float), np.asarray(value[1], dtype=float))
    if isinstance(value, str | int | float):
        return Constant(literal(value, slot, where))
    raise ScenarioError("a signal is a value with a unit, a table of times and values, or a sine.", where)


def _column(values: Sequence[str | float], slot: str, where: str) -> NDArray[np.float64]:
    return np.array([literal(v, slot, where) for v in values])


def _from_table(value: Mapping[str, Any], slot: str, where: str) -> Signal:
    """Read the table form of a signal."""
    keys = set(value)
    if {"times", "values"} <= keys <= {"times", "values", "hold"}:
        try:
            return Table(_column(value["times"], "s", where), _column(value["values"], slot, where), bool(value.get("hold", False)))
        except ThermidError as error:
            raise error.located(where) from None
    if {"mean", "amplitude", "period"} <= keys <= {"mean", "amplitude", "period", "phase"}:
        difference = "K" if slot == "temperature" else slot
        period = literal(value["period"], "s", where)
        if period <= 0:
            raise ScenarioError("a sine needs a period above zero.", where)
        amplitude = literal(value["amplitude"], difference, where)
        return Sine(literal(value["mean"], slot, where), amplitude, period, float(value.get("phase", 0.0)))
    raise ScenarioError(
        f"a signal is a table of times and values (hold), or of mean, amplitude and period (phase), not of {', '.join(sorted(keys))}.",
        where,
    )
