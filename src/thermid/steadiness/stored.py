"""Rules on the heat that a unit still takes up: by a run, or by measured temperatures with the capacitances and powers of a run.

The heat that is taken up is the sum over all nodes of capacitance times rate; a node that is not measured could take up any.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from thermid.dual import value_of
from thermid.errors import RecordError
from thermid.measure.amounts import duration_text
from thermid.measure.record.record import Record
from thermid.measure.record.stability import SHORTEST, SURE, ChannelStability, StabilityRule, channel_drift
from thermid.measure.record.steady import FEWEST
from thermid.simulation.solution import Solution

SHORT: Final = 60.0
"""Window on a simulated run. [s]"""


@dataclass(frozen=True)
class Stored:
    """How much heat a unit still takes up, beside its power.

    Parameters
    ----------
    watts, error : float    Heat that it takes up, below zero where it gives heat off; its standard error. [W]
    power : float           Mean power of its loads over the window. [W]
    start, end : float      The window. [s]
    verdict : str           ``stable``, ``not stable``, or ``cannot tell``.
    nodes : dict            Node -> heat that it takes up. [W]
    """

    watts: float
    error: float
    power: float
    start: float
    end: float
    verdict: str
    nodes: Mapping[str, float]

    def __str__(self) -> str:
        """The heat, its share of the power, and what that means."""
        share, sure = 100.0 * self.watts / self.power, 100.0 * self.error / self.power
        size = f"{self.watts:+.3g} +- {self.error:.2g} W" if self.error else f"{self.watts:+.3g} W"
        part = f"{share:+.2g} +- {sure:.1g} %" if self.error else f"{share:+.2g} %"
        most = max(self.nodes, key=lambda n: abs(self.nodes[n]))
        return (
            f"heat taken up: {size}, {part} of {self.power:.3g} W, over the last {duration_text(self.end - self.start)}, "
            f"most of it in '{most}': {self.verdict}"
        )


def _judged(watts: float, error: float, power: float, rule: StabilityRule) -> str:
    """Return the verdict: beyond two standard errors, or not to be told."""
    allowed = rule.rate * power
    if abs(watts) + SURE * error <= allowed:
        return "stable"
    return "not stable" if abs(watts) - SURE * error > allowed else "cannot tell"


def _capacities(run: Solution, unit: str) -> dict[str, float]:
    """Return node of a unit -> its capacitance at the end of a run. [J/K]"""
    network = run._run.network
    ahead = f"{unit}." if unit else ""
    out = {}
    for node, given in network.numbers().capacitances.items():
        if not node.startswith(ahead) or given is None or value_of(given) <= 0.0:
            continue
        kept = network.stores.get(node)
        end = float(run[node].kelvin[-1])
        out[node] = float(value_of(given)) * (1.0 if kept is None else float(kept.share(end)))
    return out


def _power(run: Solution, unit: str, start: float, end: float) -> float:
    """Return the mean power of a unit's loads over a window, each without its sign. [W]

    Raises
    ------
    RecordError   When there is none to compare with.
    """
    ahead = f"{unit}." if unit else ""
    at = np.linspace(start, end, 61)
    own = [np.broadcast_to(w, run.times.shape) for load, w in run.load_powers.items() if load.startswith(ahead)]
    power = float(sum(np.abs(np.interp(at, run.times, w)).mean() for w in own))
    if power <= 0.0:
        raise RecordError("the unit has no power to compare the stored heat with. Give a rule on the rate.", run.title)
    return power


def stored_in_run(
    run: Solution, rule: StabilityRule, begin: float, end: float, unit: str = ""
) -> tuple[Stored, dict[str, ChannelStability]]:
    """Return what a simulated unit still takes up at a time, and the rate of every node.

    Raises
    ------
    RecordError   When the run is too short, or the unit has no power.
    """
    start = end - SHORT
    if start < begin - 1e-9 or end > run.times[-1] * (1 + 1e-12):
        raise RecordError(
            f"'{rule.name}' looks back over {duration_text(SHORT)} from {end:g} s, and the run does not hold that.", run.title
        )
    held = _capacities(run, unit)
    rates = {n: float(np.diff(run[n].at(np.array([start, end])))[0]) / SHORT for n in held}
    nodes = {n: c * rates[n] for n, c in held.items()}
    watts, power = sum(nodes.values()), _power(run, unit, start, end)
    found = Stored(watts, 0.0, power, start, end, _judged(watts, 0.0, power, rule), nodes)
    return found, {n: ChannelStability(n, rate, 0.0, start, end, 2, "") for n, rate in rates.items()}


def stored_in_log(
    record: Record, channels: Sequence[str], rule: StabilityRule, end: float, run: Solution | None, unit: str = ""
) -> tuple[Stored, dict[str, ChannelStability]]:
    """Return what readings say that a unit still takes up, and the rate of every channel.

    The window is the shortest stretch up to the end whose error lets the question be answered, from 5 minutes on.

    Parameters
    ----------
    record : Record         The readings since conditions last changed.
    channels : sequence     Channels at nodes of the unit.
    rule : StabilityRule    A rule on stored heat.
    end : float             Time of the question. [s]
    run : Solution          A run of the model under the conditions of the log, for capacitances and powers.
    unit : str              The submodel that is the unit; all of the model where none is named.

    Raises
    ------
    RecordError   When there is no run, or a node that stores heat is not measured; with the nodes.
    """
    if run is None:
        raise RecordError(
            f"'{rule.name}' is about stored heat, which readings alone do not show. Give a rule on the rate, or a run of a model "
            "under the same conditions (run=; on the command line --model and --scenario).",
            record.name,
        )
    find = run._run.network.find
    held = _capacities(run, unit)
    sits: dict[str, list[str]] = {}
    for name in channels:
        sits.setdefault(find(record.channel(name).target or name), []).append(name)
    dark = {n: c for n, c in held.items() if n not in sits}
    if dark:
        listed = ", ".join(f"'{n}'" for n in sorted(dark, key=lambda n: -dark[n])[:4]) + (" and more" if len(dark) > 4 else "")
        share = 100.0 * sum(dark.values()) / sum(held.values())
        raise RecordError(
            f"'{rule.name}' needs the temperature of every node that stores heat; {listed} {'are' if len(dark) > 1 else 'is'} not measured "
            f"({share:.2g} % of the capacitance). Put sensors there, or take a rule on the rate.",
            record.name,
        )
    first, own = float(record.times[0]), [name for n, names in sits.items() if n in held for name in names]
    span = min(max(SHORTEST, 8.0 * FEWEST * record.step), end - first)
    while True:
        drift = {name: channel_drift(record, name, end - span, end) for name in own}
        nodes = {n: c * float(np.mean([drift[name].rate for name in sits[n]])) for n, c in held.items()}
        errors = [c * drift[name].error / len(sits[n]) ** 0.5 for n, c in held.items() for name in sits[n]]
        watts, error = sum(nodes.values()), float(np.sqrt(np.sum(np.square(errors))))
        power = _power(run, unit, end - span, end)
        verdict = _judged(watts, error, power, rule)
        if verdict != "cannot tell" or span >= end - first:
            return Stored(watts, error, power, end - span, end, verdict, nodes), drift
        span = min(1.5 * span, end - first)
