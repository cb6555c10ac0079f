"""Readings that are no temperatures: codes that sensors and loggers write in place of one, told by how far they lie from the others."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Final

import numpy as np

from thermid.measure.record.channel import Channel, FloatArray
from thermid.measure.record.record import Record
from thermid.units import counted, from_si

KNOWN: Final = {-127.0: "sensor lost (-127)", 85.0: "reset of a DS18B20 (85)"}
"""Codes of a common sensor, and what they stand for. [degC]"""
OVERLOAD: Final = 1e6
"""A reading beyond it is the sign of an overload or an open sensor, 9.9e37 of a Keysight logger. [the column's unit]"""
NEAR: Final = 2.0
"""Distance from the line between its neighbours up to which a known code may be a temperature. [the column's unit]"""
LEAST: Final = 10.0
"""Distance from all other readings from which a value stands alone that is seldom and has others before and after. [the column's unit]"""
FAR: Final = 500.0
"""The same for any value. [the column's unit]"""
SELDOM: Final = 0.1
"""Part of the readings that a value has at most that stands alone and is not far. [-]"""
FEWEST: Final = 8
"""Readings besides it without which no value stands alone. [-]"""


def codes_of(values: FloatArray, zero: float = -273.15) -> dict[float, str]:
    """Return value -> what it stands for, of the readings (samples,) of a temperature that are none.

    A value stands alone where it is farther from all others than these range, and others come before and after it: no part with a heat
    capacity goes there and back between two samples.

    Parameters
    ----------
    values : array (samples,)   In the unit of its column; NaN where a reading is missing.
    zero : float                Absolute zero in that unit.
    """
    finite = values[np.isfinite(values)]
    out = {float(v): "overload or open sensor" for v in np.unique(finite[np.abs(finite) >= OVERLOAD])}
    known = finite[np.abs(finite) < OVERLOAD]
    if not known.size:
        return out
    out |= {code: words for code, words in KNOWN.items() if np.any(known == code) and _leaps(known, code)}
    out |= {float(v): f"below absolute zero ({v:g})" for v in np.unique(known[known < zero])}
    rest = known[~np.isin(known, list(out))]
    while (found := _alone(rest)) is not None:
        out[found] = f"far from all other readings ({found:g})"
        rest = rest[rest != found]
    return out


def _leaps(values: FloatArray, code: float) -> bool:
    """Whether a value differs from the line between its neighbours: 85 is a fault in a log at 20 and none in one that passes it."""
    here = np.isin(values, list(KNOWN))
    if here.all():
        return True
    order = np.arange(values.size)
    return bool(np.any(np.abs(np.interp(order, order[~here], values[~here])[values == code] - code) > NEAR))


def _alone(values: FloatArray) -> float | None:
    """Return the lowest or highest value where it stands alone."""
    for end in (float(values.max()), float(values.min())) if values.size else ():
        here = values == end
        others = values[~here]
        if others.size < FEWEST:
            continue
        gap = float(np.abs(others - end).min())
        brief = np.mean(here) <= SELDOM and not here[0] and not here[-1]
        if gap > max(float(np.ptp(others)), LEAST if brief else FAR):
            return end
    return None


def strays(channel: Channel) -> dict[float, str]:
    """Return value -> what it stands for, of the valid readings of a channel that are no temperatures. [the unit of its file]"""
    if channel.quantity != "temperature":
        return {}
    return codes_of(_in_file(channel), float(from_si(np.zeros(1), channel.unit)[0]))


def without_strays(record: Record) -> tuple[Record, tuple[str, ...]]:
    """Return a record with readings masked that are no temperatures, and what was masked, a sentence for each channel."""
    said, made = [], record
    for name, channel in record.channels.items():
        codes = strays(channel)
        if not codes:
            continue
        made = made.flag_faults(_texts(codes, channel), channels=[name])
        count = counted(int(np.count_nonzero(channel.valid & ~made[name].valid)), "reading")
        said.append(f"{name}: {count} masked: {', '.join(dict.fromkeys(codes.values()))}")
    return made, tuple(said)


def stray_readings(records: Sequence[Record]) -> tuple[str, ...]:
    """Return the readings of records that are codes of faults and no temperatures, with the step of `prepare` that masks them."""
    out = []
    for r in records:
        for c in r.channels.values():
            codes = strays(c)
            if codes:
                step = ", ".join(f'"{text}"' for text in _texts(codes, c))
                out.append(
                    f"readings of '{c.name}' in '{r.name}' are no temperatures: {', '.join(dict.fromkeys(codes.values()))}. Mask them: "
                    f"prepare = [{{ faults = {{ codes = [{step}] }} }}] of the record."
                )
    return tuple(out)


def _texts(codes: Iterable[float], channel: Channel) -> list[str]:
    """Return codes as `prepare` takes them."""
    return [f"{code:.10g} [{channel.unit}]" for code in codes]


def _in_file(channel: Channel) -> FloatArray:
    """Return the valid readings in the unit of the file, as they were written; NaN elsewhere."""
    written = channel.values + channel.correction  # a code is what the sensor said, not what a certificate makes of it
    return np.where(channel.valid, np.round(from_si(written, channel.unit), 6), np.nan)
