"""What the kernel takes in place of names: kinds, places of coefficients, signals, and the words for how a run ended."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid import _kernel
from thermid.model.laws.curves import Curve
from thermid.model.laws.signal import Constant, Drawn, Signal, Sine, Table
from thermid.network.rows import LOADS, conductor_law, curve_arrays, tables_behind

Array = NDArray[np.float64]


def break_times(signals: Iterable[Signal], end: float) -> Array:
    """Return the times at which a held input jumps, when they are few enough to be stepped on one by one. [s]"""
    jumps = [s.times[1:][np.diff(s.values) != 0] for s in signals if isinstance(s, Table) and s.hold]
    times = np.unique(np.concatenate(jumps)) if jumps else np.zeros(0)
    times = times[(times > 0) & (times < end)]
    return times if times.size <= 5000 else np.zeros(0)


def ints(values: Any) -> NDArray[np.int32]:
    """Return numbers as the kernel's integers."""
    return np.ascontiguousarray(values, dtype=np.int32)


def row_form(
    form: str, places: Sequence[int], curve: Curve | None, tables: list[Any], load: bool = False, refuse: bool = True
) -> tuple[int, list[int], int]:
    """Return the kernel's kind, coefficient places and table of a row; without `refuse` tables are held where they would be refused."""
    four = [-1, -1, -1, -1]
    four[: len(places)] = places
    table = -1
    if curve is not None:
        table = len(tables)
        tables += [curve_arrays(each, refuse) for each in tables_behind(form, curve)]
    law = LOADS[form] if load else conductor_law(form, curve)
    return law.kind, four, table


def kernel_input(given: Drawn) -> tuple[int, Array, Array]:
    """Return the kernel's form of a signal."""
    none = np.zeros(0)
    if isinstance(given, Constant):
        return _kernel.CONSTANT, np.array([given.value]), none
    if isinstance(given, Sine):
        return _kernel.SINE, np.array([given.mean, given.amplitude, given.period, given.phase]), none
    kind = _kernel.SAMPLED_HOLD if given.hold else _kernel.SAMPLED_LINEAR
    return kind, np.ascontiguousarray(given.times, dtype=float), np.ascontiguousarray(given.values, dtype=float)


def runs_away(when: str, follows: bool) -> str:
    """Return why a temperature leaves every range; `follows` says whether a power follows a temperature at all."""
    cause = "a power grows faster with temperature than the heat can leave" if follows else "more heat goes in than can leave"
    return f"the temperature runs away {when}: {cause}. Where it falls below 0 K, a negative power takes more than there is."


def unsolved(when: str, follows: bool) -> str:
    """Return what to look at where a step could not be solved; `follows` as in `runs_away`."""
    look = "power that grows too fast with temperature" if follows else "law that jumps there"
    return f"a step could not be solved {when}. Look for a {look}."


def ending(found: Any, names: Sequence[str], max_steps: int, end: float, follows: bool) -> str:
    """Return what ran out in a run that ended before `end` [s], when, where and what to change; `follows` as in `runs_away`."""
    node = f" at '{names[found.node]}'" if 0 <= found.node < len(names) else ""
    when = f"at {found.time:.6g} s of {end:.6g} s{node}"
    words = {
        _kernel.MAX_STEPS: f"{max_steps} steps were not enough, {when}. Allow more max_steps, or a larger tolerance.",
        _kernel.STEP_UNDERFLOW: f"the step became too small {when}. Look for a law that jumps there, or raise the tolerance.",
        _kernel.NEWTON_FAILED: unsolved(when, follows),
        _kernel.NON_FINITE: f"a temperature or heat flow is not a number {when}. Look for a parameter that is infinite.",
        _kernel.RUN_AWAY: runs_away(when, follows),
        _kernel.SINGULAR_NODE: f"a massless node has no conductance to anything {when}, so its temperature is undefined.",
        _kernel.BAD_INPUT: f"a temperature must not lie below 0 K and every number be finite, which does not hold {when}. Look there.",
        _kernel.CHATTER: f"a thermostat switches without end {when}. Widen its hysteresis.",
    }
    return words.get(found.status, f"the run stopped {when}.")
