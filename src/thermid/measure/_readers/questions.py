"""Questions that a log leaves open and its owner can answer; they stand in the first lines of `look`, `check` and `calibrate`."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Final

import numpy as np

from thermid.base.units import HOUR, duration_text, short
from thermid.measure._record.channel import BoolArray, FloatArray, gap_from, usual_step

ROOM_IN_FAHRENHEIT: Final = (59.0, 95.0)
"""First readings that a room has in degrees Fahrenheit (15 to 35 degC); in degC no room does."""
NIGHT: Final = 3 * HOUR
"""Time of day up to which summer time begins, by the clock before the change. [s]"""
GOES_ON: Final = 3.0
"""Largest usual change from reading to reading by which temperatures may differ where no time passed. [-]"""
RESTART: Final = 0.1
"""Part of its highest count below which a counter has begun again. [-]"""
COUNTS_ALIKE: Final = 0.2
"""How far steps of a counter of time may be from the usual one. [-]"""
SWITCH: Final = 0.1
"""Part of its range by which a power changes where it is switched; less is its noise. [-]"""
_OF_DAY = re.compile(r"(?:^|[ T])(\d{1,2}):(\d{2})(?::(\d{2}))?")


def unit_question(columns: Mapping[str, FloatArray]) -> Iterator[str]:
    """Yield a question where readings without a unit look like degrees Fahrenheit: the coldest begins at 59 to 95.

    Parameters
    ----------
    columns : dict  Temperature that has no unit -> its readings (samples,), NaN where there is none; in the numbers of the log.
    """
    first = {name: float(finite[0]) for name, values in columns.items() if (finite := values[np.isfinite(values)]).size}
    if first and ROOM_IN_FAHRENHEIT[0] <= min(first.values()) <= ROOM_IN_FAHRENHEIT[1]:
        coldest = min(first, key=lambda name: first[name])
        yield (
            f"{', '.join(first)}: no unit in the log, and {coldest} begins at {short(first[coldest], 3)}. That is a room in degrees "
            'Fahrenheit, and none in degC, in which it is read. State unit = "degF" or unit = "degC".'
        )


def repeated_stamps(times: FloatArray, columns: Mapping[str, FloatArray]) -> Iterator[str]:
    """Yield a sentence where several rows of one time stamp have different readings.

    Parameters
    ----------
    times : array (samples,)    In the order of the log. [s]
    columns : dict              Name -> readings (samples,), NaN where there is none.
    """
    first = np.flatnonzero(np.diff(times, prepend=-np.inf) > 0)
    if first.size == times.size:
        return
    spread = {name: np.fmax.reduceat(values, first) - np.fmin.reduceat(values, first) for name, values in columns.items() if values.size}
    differ = [name for name, s in spread.items() if np.nanmax(s, initial=0.0) > 0.0]
    if differ:
        stamps = int(np.count_nonzero(np.any([np.nan_to_num(spread[n]) > 0.0 for n in differ], axis=0)))
        worst = max(differ, key=lambda n: float(np.nanmax(spread[n])))
        k = int(np.nanargmax(spread[worst]))
        yield (
            f"{'1 time stamp has' if stamps == 1 else f'{stamps} time stamps have'} different readings, of {worst} up to "
            f"{short(float(spread[worst][k]), 3)} apart at "
            f"{duration_text(float(times[first[k]] - times[0]))}: temperatures are averaged, of powers and commands the last is used. "
            "Remove the rows that are wrong, or write stamps that keep them apart."
        )


def lost_hour(times: FloatArray, stamps: Sequence[str], temperatures: Mapping[str, FloatArray]) -> Iterator[str]:
    """Yield a question where one gap, of an hour and at night, without a change of temperature may be the beginning of summer time.

    The gap is 1 h and a step long, within half a step, and no temperature changes across it by more than `GOES_ON` times the change that
    nine tenths of its samples stay below.

    Parameters
    ----------
    times : array (samples,)    [s]
    stamps : sequence of str    As written.
    temperatures : dict         Name -> readings (samples,), NaN where there is none.
    """
    steps = np.diff(times)
    step = usual_step(times)
    holes = np.flatnonzero(steps > gap_from(times)) if steps.size else steps
    if len(holes) != 1 or step == 0.0 or abs(float(steps[holes[0]]) - HOUR - step) > 0.5 * step:
        return
    k = int(holes[0])
    before, after = (_OF_DAY.search(stamps[i]) for i in (k, k + 1))
    if before is None or after is None or HOUR * int(before[1]) >= NIGHT or HOUR * int(after[1]) > NIGHT:
        return
    for values in temperatures.values():
        change = np.abs(np.diff(values))
        if not change[k] <= GOES_ON * float(np.nanquantile(np.delete(change, k), 0.9)):
            return
    yield (
        f"no readings from {stamps[k].strip()} to {stamps[k + 1].strip()}, and temperatures go on as if no time had passed: the clock may "
        "have changed to summer time. If so, take an hour off all later stamps, or write stamps with their zone."
    )


def begins_again(counter: FloatArray) -> BoolArray:
    """Return where a counter falls back below a tenth of its highest count (samples,), as that of a board that restarts."""
    back = np.diff(counter, prepend=counter[:1]) < 0.0
    return np.asarray(back & (counter - min(float(np.nanmin(counter)), 0.0) < RESTART * np.fmax.accumulate(counter)))


def counts_time(values: FloatArray) -> bool:
    """Whether readings (samples,) without a unit are a counter of milliseconds: equal steps between restarts, and 1000 or more."""
    if values.size < 8 or not np.all(np.isfinite(values)) or float(values.max()) < 1000.0:
        return False
    steps = np.diff(values)[~begins_again(values)[1:]]
    usual = float(np.median(steps)) if steps.size else 0.0
    return usual > 0.0 and bool(np.mean(np.abs(steps / usual - 1.0) < COUNTS_ALIKE) > 0.8)


def board_restarts(times: FloatArray, columns: Mapping[str, FloatArray]) -> Iterator[str]:
    """Yield a sentence where a counter of milliseconds beside the stamps shows restarts of the board.

    Parameters
    ----------
    times : array (samples,)    [s]
    columns : dict              Column without a unit -> its numbers (samples,).
    """
    for name, values in columns.items():
        again = np.flatnonzero(begins_again(values)) if counts_time(values) else ()
        if len(again):
            when = ", ".join(duration_text(float(times[k] - times[0])) for k in again[:4])
            yield (
                f"the board restarted at {when}: its counter '{name}' begins again. What it switches may have been "
                "off. Use the parts before and after as records of their own if a power changed."
            )


def hidden_switches(times: FloatArray, powers: Mapping[str, FloatArray]) -> Iterator[str]:
    """Yield a sentence for each change of a power, by more than `SWITCH` of its range, within a gap between its readings.

    Parameters
    ----------
    times : array (samples,)    [s]
    powers : dict               Power or command -> readings (samples,), NaN where there is none.
    """
    for name, values in powers.items():
        logged_rows = np.flatnonzero(np.isfinite(values))
        holes = np.flatnonzero(np.diff(times[logged_rows]) > gap_from(times)) if logged_rows.size > 1 else logged_rows[:0]
        pairs = ((logged_rows[k], logged_rows[k + 1]) for k in holes)
        least = SWITCH * float(np.ptp(values[logged_rows])) if holes.size else 0.0
        for a, b in (pair for pair in pairs if abs(float(values[pair[1]] - values[pair[0]])) > least):
            yield (
                f"{name} changes from {short(float(values[a]), 3)} to {short(float(values[b]), 3)} in a hole of "
                f"{duration_text(float(times[b] - times[a]))} at {duration_text(float(times[a] - times[0]))}. Nothing says when: it is "
                "taken at the end of the hole. Add a row with the moment, or use the parts before and after as records of their own."
            )
