"""Waiting for a unit: run on under constant conditions until a rule of stability holds, or say why it never will."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from thermid.errors import ScenarioError, SolverError
from thermid.measure.amounts import duration_text
from thermid.measure.record.steadiness import StabilityRule
from thermid.physics.constants import ICE_POINT
from thermid.profile_runs.legs import Leg

Array = NDArray[np.float64]
SHORT: Final = 60.0
"""Window of a rule that names none, on a simulated trace. [s]"""
SAMPLES: Final = 60
"""Outputs within the window of a rule that names one."""
MOST: Final = 3000
"""Outputs of one stretch of waiting."""
WITHIN: Final = 30
"""Outputs within the time that temperatures are averaged over, at least."""


@dataclass(frozen=True)
class Reached:
    """When and how a rule came to hold.

    Parameters
    ----------
    after : float       Time waited. [s]
    slowest : str       The node that held it up.
    rate : float        How fast that node still changes. [K/s]
    """

    after: float
    slowest: str
    rate: float


@dataclass(frozen=True)
class Wanted:
    """What is waited for.

    Parameters
    ----------
    rule : StabilityRule
    watch : tuple of str            Nodes that must be stable.
    base : str                      Node that must be at its level too; empty for none.
    level, tolerance : float        [K]
    longest : float                 Time after which it is given up. [s]
    where : str                     For the message.
    average : float                 Time over which temperatures are averaged first, for heaters that switch; zero for none. [s]
    """

    rule: StabilityRule
    watch: tuple[str, ...]
    base: str
    level: float
    tolerance: float
    longest: float
    where: str
    average: float = 0.0

    @property
    def window(self) -> float:
        """The window over which changes are taken. [s]"""
        return self.rule.window or SHORT


def wait(leg: Leg, state: Array, wanted: Wanted) -> Reached:
    """Return when the rule holds for every watched node, found between two outputs by a straight line.

    Raises
    ------
    SolverError     When it does not hold within the longest wait; with the node, its rate and the rule.
    ScenarioError   When a rule on stored heat is to be asked of averages.
    """
    if wanted.average and wanted.rule.stored:
        raise ScenarioError(f"'{wanted.rule.name}' is not asked of averages. Take a rule on the rate, or no average.", wanted.where)
    step = wanted.window / (SAMPLES if wanted.rule.window else 1)
    if wanted.average:
        step = wanted.average / max(WITHIN, math.ceil(wanted.average / step))
    times, traces = np.zeros(1), state[None, :]
    reach = 2.0 * (wanted.window + wanted.average)
    while True:
        reach = min(reach, wanted.longest)
        axis = np.asarray(np.arange(1, math.ceil(reach / step) + 1) * step, dtype=np.float64)
        axis = axis if wanted.average else _thinned(axis, step)
        found, _ = leg.run(state, axis)
        times, traces = np.append(0.0, axis), np.vstack((state, found))
        excess, movers = _excess(leg, wanted, times, traces)
        held = np.flatnonzero(excess <= 0.0)
        if held.size:
            k = int(held[0])
            after = float(times[k])
            if k and np.isfinite(excess[k - 1]):
                after -= float((times[k] - times[k - 1]) * excess[k] / (excess[k] - excess[k - 1]))
            slowest = wanted.watch[movers[max(k - 1, int(np.flatnonzero(np.isfinite(excess))[0]))]]
            return Reached(after, slowest, _rate(leg, wanted, times, traces, slowest, after))
        if reach >= wanted.longest:
            raise SolverError(_never(leg, wanted, times, traces, int(movers[-1])), wanted.where)
        reach *= 2.0


def _thinned(axis: NDArray[np.floating[Any]], step: float) -> Array:
    """Return output times: whole windows stay dense, and a long wait is looked at less often."""
    if axis.size <= MOST:
        return np.asarray(axis, dtype=np.float64)
    coarse = np.linspace(axis[0], axis[-1], MOST // 2)
    return np.unique(np.concatenate([np.round(coarse / step) * step, np.round(coarse / step) * step - step]))[1:]


def _excess(leg: Leg, wanted: Wanted, times: Array, traces: Array) -> tuple[Array, NDArray[np.int64]]:
    """Return by how much the rule is missed at each time (infinite before it can be asked), and which watched node is furthest from it."""
    of = _averaged(leg.named(traces, wanted.watch, times), times, wanted.average)
    before = np.searchsorted(times, times - wanted.window - 1e-6 * wanted.window)
    asked = times >= (wanted.window + wanted.average) * (1.0 - 1e-9)
    spans = np.stack([_spread(of, before, k) if asked[k] else np.full(of.shape[1], np.inf) for k in range(times.size)])
    movers = np.argmax(np.where(np.isfinite(spans), spans, -1.0), axis=1)
    if wanted.rule.stored:
        heat = traces @ leg.capacities
        power = leg.power(traces[-1])
        stored = np.array([abs(heat[k] - heat[before[k]]) / wanted.window if asked[k] else np.inf for k in range(times.size)])
        excess = stored - wanted.rule.rate * power if power > 0 else np.full(times.size, np.inf)
    else:
        excess = spans.max(axis=1) - wanted.rule.rate * wanted.window
    if wanted.base:
        base = _averaged(leg.named(traces, (wanted.base,), times), times, wanted.average)[:, 0]
        off = np.abs(base - wanted.level) - wanted.tolerance
        excess = np.maximum(excess, off)
    return excess, movers


def _averaged(of: Array, times: Array, average: float) -> Array:
    """Return temperatures averaged over the time before each output (times, nodes); outputs are evenly spaced. [K]"""
    if not average:
        return of
    step = float(times[1] - times[0])
    count = round(average / step)
    inside = np.vstack((np.zeros((1, of.shape[1])), np.cumsum(0.5 * (of[1:] + of[:-1]), axis=0)))
    out = of.copy()
    out[count:] = (inside[count:] - inside[:-count]) / count
    return out


def _spread(of: Array, before: NDArray[np.int64], k: int) -> Array:
    """Return by how much each node moved within the window that ends at an output."""
    part = of[before[k] : k + 1]
    return np.asarray(part.max(axis=0) - part.min(axis=0))


def _rate(leg: Leg, wanted: Wanted, times: Array, traces: Array, node: str, at: float) -> float:
    """Return the rate of a node over the window that ends at a time. [K/s]"""
    of = _averaged(leg.named(traces, (node,), times), times, wanted.average)[:, 0]
    now, then = np.interp([at, at - wanted.window], times, of)
    return float((now - then) / wanted.window)


def _never(leg: Leg, wanted: Wanted, times: Array, traces: Array, mover: int) -> str:
    """Return why a wait was given up: node, rate, rule, and what to do."""
    node = wanted.watch[mover]
    rate = _rate(leg, wanted, times, traces, node, float(times[-1]))
    rule, waited = wanted.rule.name, duration_text(wanted.longest)
    text = f"it does not become stable by the rule '{rule}' within {waited}: '{node}' still changes by {3600.0 * rate:+.3g} K/h"
    steady = leg.steady((node, *([wanted.base] if wanted.base else [])))
    if wanted.average:
        mean = duration_text(wanted.average)
        return f"{text} in its mean over {mean}. Allow a longer wait (longest_wait), another rule, or a longer average."
    if leg.bench.memory and not leg.bench.memory.startswith("the gas"):
        return (
            f"{text}. {leg.bench.memory}, so its temperature swings for ever; ask the rule of means over a whole number of swings "
            "(average = '30 [min]'), watch other nodes, or take a rule with a wider allowance."
        )
    if steady is None:
        return (
            f"{text}, and there is no steady state that it could reach. Look for a part without a path to the chamber, or a power "
            "that runs away."
        )
    if wanted.base and abs(steady[wanted.base] - wanted.level) > wanted.tolerance:
        return (
            f"{text}; '{wanted.base}' would settle at {steady[wanted.base] - ICE_POINT:.1f} degC, outside {wanted.level - ICE_POINT:.1f} "
            f"+- {wanted.tolerance:g} degC. Give the chamber another level."
        )
    tau = leg.slowest(traces[-1])
    more = "" if not rate else f" The slowest time constant is {duration_text(tau)};"
    if rate and not wanted.rule.stored:
        moved, allowed = abs(rate), wanted.rule.rate
        need = tau * math.log(max(moved / allowed, 1.0)) + wanted.rule.window
        more += f" about {duration_text(max(need, 60.0))} more would be needed."
    return f"{text}, on its way to {steady[node] - ICE_POINT:.2f} degC.{more} Allow a longer wait (longest_wait), or another rule."
