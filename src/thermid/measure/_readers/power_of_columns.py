"""What no column holds: a formula of columns with units, a power of volts and amperes, or of a counter of energy.

In: what `power` or `temperature` of a channel says, and the columns of its log. Out: values (samples,), which of them are none, and how
they count in time.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from thermid.base.errors import ExpressionError, RecordError, errors_at, refuse_unknown
from thermid.base.units import Expression, Unit, describe, in_si, require, unit
from thermid.measure._readers.headers import LETTERED
from thermid.measure._record.channel import BoolArray, FloatArray

ColumnOf = Callable[[str], tuple[FloatArray, str | None]]
"""Name -> readings (samples,) in the column's own unit, and that unit; None where the log has none."""
_USUAL: Final = {"volts": "V", "amperes": "A", "ohms": "ohm", "duty": "%", "share": "1", "energy": "J", "watts": "W"}
"""Key of the table -> unit that is needed there."""
POWER_KEYS: Final = (*_USUAL, "formula")
"""Keys of the table that take a text."""
_QUOTED: Final = re.compile(r"`([^`]+)`")
_NUMBER: Final = re.compile(r"\s*[-+.\d]")
_PRODUCTS: Final = {
    frozenset({"volts", "amperes"}): "volts * amperes",
    frozenset({"volts", "ohms"}): "volts**2 / ohms",
    frozenset({"amperes", "ohms"}): "amperes**2 * ohms",
    frozenset({"watts"}): "watts",
}
RESTARTED: Final = "counter restarted"


@dataclass(frozen=True, eq=False)
class PowerReadings:
    """A power, or a temperature, computed from columns.

    Parameters
    ----------
    values : array (samples,)       NaN where a column has no reading. [W, K]
    restarted : array (samples,)    Where a counter of energy began again, so that the interval before says nothing.
    samples : str                   'average' for a counter: the mean since the stamp before; empty for readings of an instant.
    """

    values: FloatArray
    restarted: BoolArray
    samples: str = ""


def power_readings(entry: object, column: ColumnOf, times: FloatArray, where: str, key: str = "power") -> PowerReadings:
    """Return what the key `power` or `temperature` of a channel describes.

    Parameters
    ----------
    entry : str or mapping  A formula of columns, ``"V_IN * I_IN"``; or a table: volts, amperes, ohms (two of them) or watts, times duty and
                            share; energy; or formula with units. Values are columns, or numbers with units.
    column : callable       Name -> readings and unit.
    times : array           [s]
    where, key : str        For messages; the key. A temperature is a formula, alone or with units.

    Raises
    ------
    RecordError             When a key or a unit is missing, or it is no power.
    NameNotFoundError       When there is no such column.
    """
    with errors_at(f"{where}, {key}"):
        if isinstance(entry, str):
            return _of_formula(entry, column, {}, times, key)
        if not isinstance(entry, Mapping):
            raise RecordError(f"{entry!r} is neither a formula of columns nor a table.", code="value.wrong-kind")
        refuse_unknown(entry, (*POWER_KEYS, "units"))
        if "formula" in entry or key == "temperature":
            refuse_unknown(entry, ("formula", "units"), refusal="'{}' does not go with a formula, which takes {known}.")
            return _of_formula(str(entry.get("formula", "")), column, dict(entry.get("units", {})), times, key)
        if "energy" in entry:
            refuse_unknown(entry, ("energy", "share"), refusal="'{}' does not go with a counter of energy, which takes {known}.")
            return _of_counter(_slot("energy", entry, column), _slot("share", entry, column), times)
        return _of_product(entry, column, times)


def _of_product(table: Mapping[str, Any], column: ColumnOf, times: FloatArray) -> PowerReadings:
    """Return volts * amperes, volts^2 / ohms, amperes^2 * ohms or watts, times duty and share. [W]

    Raises
    ------
    RecordError   When the factors make no power.
    """
    factors = frozenset(table) - {"duty", "share", "units"}
    if factors not in _PRODUCTS:
        raise RecordError(
            f"{', '.join(sorted(factors)) or 'this'} is not enough: give volts with amperes or ohms, amperes with ohms, or watts.",
            code="value.incomplete",
        )
    readings = {key: _slot(key, table, column) for key in (*factors, "duty", "share")}
    values = Expression.parse(_PRODUCTS[factors]).evaluate(readings.__getitem__) * readings["duty"] * readings["share"]
    return PowerReadings(np.broadcast_to(np.asarray(values, dtype=float), times.shape).copy(), np.zeros(times.shape, dtype=bool))


def _slot(key: str, table: Mapping[str, Any], column: ColumnOf) -> Any:
    """Return the value of a key of the table in SI: a column (samples,), or a number with its unit; 1 for a missing factor."""
    if key not in table:
        return 1.0
    text = str(table[key])
    if _NUMBER.match(text):
        literal = Expression.parse(text).literal
        if literal is None:
            raise RecordError(f"{key} = '{text}' is neither a column nor a number with a unit.", code="value.wrong-kind")
        require(literal.unit.dimension, _USUAL[key], text)
        return literal.value
    values, of = _column_with_unit(text, column, {text: _USUAL[key]})
    require(of.dimension, _USUAL[key], f"column '{text}' [{of.text}]")
    return in_si(values, of)


def _column_with_unit(name: str, column: ColumnOf, usual: Mapping[str, str]) -> tuple[FloatArray, Unit]:
    """Return readings and unit of a column; without a unit in the log, that of `usual`, else a last word W, V or A of its name.

    Raises
    ------
    RecordError   When none gives a unit.
    """
    values, text = column(name)
    text = text or usual.get(name) or (m["letter"] if (m := LETTERED.match(name)) and m["letter"] in "WVA" else None)
    if text is None:
        raise RecordError(
            f"column '{name}' has no unit. Give it, W, V or A for example: power = {{ formula = '...', units = {{ {name} = '...' }} }}.",
            code="record.unit-unclear",
        )
    return values, unit(text)


def _of_formula(text: str, column: ColumnOf, units: Mapping[str, str], times: FloatArray, key: str = "power") -> PowerReadings:
    """Return the value of a formula of columns, each in SI by its unit: by `units` where the log has none, or degC in a temperature. [W, K]

    A temperature of 0 K or below, as that of counts at an end of their range, is no reading.

    Raises
    ------
    RecordError   When it names no column, or is of another quantity.
    """
    quoted = {f"column{k}": name for k, name in enumerate(dict.fromkeys(_QUOTED.findall(text)))}
    plain = text
    for place, name in quoted.items():
        plain = plain.replace(f"`{name}`", place)
    try:
        expression = Expression.parse(plain)
    except ExpressionError as error:
        rule = "Write a column whose name holds a blank, a sign or a digit first in backticks: `CH1 Voltage` * `CH1 Current`."
        raise error.reworded(f"{error.message} {rule}") from None
    if not expression.names:
        raise RecordError(f"'{text}' names no column. State a constant in the deck or in the scenario.", code="value.wrong-kind")
    usual = {**(dict.fromkeys((*quoted.values(), *expression.names), "degC") if key == "temperature" else {}), **units}
    readings = {name: _column_with_unit(quoted.get(name, name), column, usual) for name in expression.names}
    try:
        dimension = expression.dimension(lambda name: readings[name][1].dimension)
    except ExpressionError as error:
        bare = [n for n in expression.names if key == "temperature" and n not in units and column(quoted.get(n, n))[1] is None]
        rule = f" A column without a unit is in degC here: state that of counts or volts, units = {{ {bare[0]} = '1' }}." if bare else ""
        raise error.reworded(f"{error.message}{rule}") from None
    if dimension != unit("K" if key == "temperature" else "W").dimension:
        raise RecordError(f"'{text}' is {describe(dimension)}, so it is not a {key}.", code="unit.wrong-dimension")
    with np.errstate(divide="ignore", invalid="ignore"):  # of an open or shorted thermometer
        values = np.asarray(expression.evaluate({name: in_si(v, of) for name, (v, of) in readings.items()}.__getitem__), dtype=float)
    return PowerReadings(np.where(values > 0.0, values, np.nan) if key == "temperature" else values, np.zeros(times.shape, dtype=bool))


def _of_counter(joules: FloatArray, share: float, times: FloatArray) -> PowerReadings:
    """Return the mean power (J_k - J_(k-1)) / (t_k - t_(k-1)) times the `share` that heats the part; the first is that of the second. [W]

    A step down is a restart, and NaN.

    Raises
    ------
    RecordError   When energy is no column.
    """
    if np.ndim(joules) == 0:
        raise RecordError("energy is a column: a counter that grows.", code="value.wrong-kind")
    step = np.diff(joules, prepend=np.nan)
    long = np.diff(times, prepend=np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        watts = np.where(long > 0.0, step / long, np.nan) * share
    restarted = step < 0.0
    watts[restarted] = np.nan
    watts[0] = watts[1] if watts.size > 1 else np.nan
    return PowerReadings(watts, restarted, "average")
