"""Temperatures at the beginning of a record: given, the first readings of its sensors, or what balances its neighbours' heat."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.errors import RecordError, ThermidError
from thermid.measure import Channel, Record
from thermid.model.laws.signal import Constant
from thermid.network.network import Network
from thermid.simulation.scenarios.scenario import Scenario
from thermid.simulation.solver.engine import Engine
from thermid.simulation.solver.wiring import Wiring

Array = NDArray[np.float64]

MEASURED = "measured"
"""`start = "measured"`: observed nodes start at their own readings, all others at the mean of these."""
UNSAID_NOISE = 0.1
"""Noise of a sensor where nobody said it, for what is worth a remark. [K]"""
REST = 4.0
"""Standard deviations of a difference of two readings up to which they count as one temperature: a log then begins at rest."""
STEPS = 20
"""Newton steps for the balance; only radiation and laws that change with temperature need more than one."""


@dataclass(frozen=True)
class HiddenStart:
    """Start of a node that no sensor observes, in a log that does not begin at rest.

    Parameters
    ----------
    mean : float            Temperature at which it stores no heat, its neighbours at their first readings, no power on. [K]
    sd : float              Half the range of the measured neighbours and the boundaries. [K]
    neighbours : tuple      Nodes with a sensor that it exchanges heat with, directly or through other nodes without one.
    """

    mean: float
    sd: float
    neighbours: tuple[str, ...]


def first_reading(record: Record, name: str, window: float = 0.0) -> float:
    """Return the median of a channel's valid samples within `window` of its first one. [SI]

    Raises
    ------
    RecordError   When it has no valid sample.
    """
    channel = record.channel(name)
    times = record.times[channel.valid]
    if times.size == 0:
        raise RecordError(f"channel '{name}' has no valid sample.", record.name)
    return float(np.median(channel.values[channel.valid][times <= times[0] + window]))


def starts_of(
    record: Record, base: Scenario, network: Network, first: Mapping[str, float], window: float
) -> tuple[Any, dict[str, Any], dict[str, str], tuple[str, ...]]:
    """Return start, initial temperatures, nodes that start at a channel's first reading, and nodes that start at their own."""
    initial: dict[str, Any] = {}
    readings: dict[str, str] = {}

    def lay(node: str, value: Any) -> None:
        if isinstance(value, str) and value in record.channels:
            readings[node] = value
            initial[node] = first_reading(record, value, window)
        else:
            initial[node] = value

    for raw, value in base.initial.items():
        lay(network.find(raw), value)
    if isinstance(base.start, str) and base.start in record.channels:
        for node in network.nodes:
            if node not in initial and _massive(network, node):
                lay(node, base.start)
        return first_reading(record, base.start, window), initial, readings, ()
    if base.start not in ("", MEASURED):
        return base.start, initial, readings, ()
    loose = tuple(n for n in first if n not in initial and _massive(network, n))
    initial |= {n: first[n] for n in loose}
    mean = float(np.mean(list(first.values())))
    return (mean if base.start == MEASURED or len(network.boundaries) != 1 else ""), initial, readings, loose


def _massive(network: Network, node: str) -> bool:
    return any(n.path == node and n.fields for n in network.flat.nodes)


def hidden_starts(
    scenario: Scenario, network: Network, first: Mapping[str, float], channels: Mapping[str, Channel], skipped: Sequence[str]
) -> dict[str, HiddenStart]:
    """Return the starts of nodes without a sensor that nobody gave; none where the log begins at rest.

    Parameters
    ----------
    scenario : Scenario     Of the record; its `start` is empty.
    network : Network       The model, sensors on it.
    first : dict            Observed node -> its first reading. [K]
    channels : dict         Observed node, or logged boundary, -> its channel.
    skipped : sequence      Nodes that follow others, as the tips of sensors do.

    Notes
    -----
    Net heat q(T) of the nodes without a reading is brought to zero by Newton's method, ``dT = -(dq/dT)^-1 q``, with every other
    temperature fixed and all powers off. What was on before the log began is not known: the standard deviation stands for it.
    """
    hidden = [n for n in network.nodes if n not in first and n not in scenario.initial and n not in skipped and _massive(network, n)]
    around = {b: float(np.ravel(s.at(np.zeros(1)))[0]) for b, s in scenario.boundaries.items() if b in network.boundaries}
    if not hidden or _at_rest({**around, **first}, channels):
        return {}
    whole = [*first.values(), *around.values()]
    if network.stores:  # their levels are no temperatures: the readings alone say where they may begin
        return {n: HiddenStart(float(np.mean(list(first.values()))), 0.5 * float(np.ptp(whole)), tuple(first)) for n in hidden}
    engine = _unpowered(network, replace(scenario, start=float(np.mean(list(first.values())))))
    assembled = engine.wiring.assemble(gradients=False)
    nodes = list(assembled.reduced.nodes)
    loose = [k for k, n in enumerate(nodes) if n not in first and n not in scenario.initial]
    held = [k for k, n in enumerate(nodes) if n in first]
    temperatures, jacobian = _balanced(engine, loose)
    out = {}
    for group in _groups(jacobian, loose):
        beside = [k for k in held if np.any(jacobian[np.ix_(group, [k])]) or np.any(jacobian[np.ix_([k], group)])]
        anchors = [*(first[nodes[k]] for k in beside), *around.values()]
        anchors = anchors if np.ptp(anchors) > 0.0 else whole
        for k in (k for k in group if nodes[k] in hidden):
            mean = float(np.clip(temperatures[k], min(anchors), max(anchors)))
            out[nodes[k]] = HiddenStart(mean, 0.5 * float(np.ptp(anchors)), tuple(nodes[j] for j in beside))
    return {n: out[n] for n in hidden if n in out}


def _at_rest(temperatures: Mapping[str, float], channels: Mapping[str, Channel]) -> bool:
    """Whether first readings and boundaries agree within what is said of their noise and accuracy."""

    def sd(name: str) -> float:
        channel = channels.get(name)
        if channel is None:
            return 0.0
        return float(np.hypot(UNSAID_NOISE if channel.noise is None else channel.noise, channel.accuracy or 0.0))

    return all(abs(temperatures[a] - temperatures[b]) <= REST * np.hypot(sd(a), sd(b)) for a, b in combinations(temperatures, 2))


def _unpowered(network: Network, scenario: Scenario) -> Engine:
    """Return the run of a scenario with inputs as they begin and every power off; as they are where a load takes no power but its own."""
    scenario = scenario.mapped(lambda s: Constant(float(np.ravel(s.at(np.zeros(1)))[0])))
    off = {load.path: Constant(0.0) for load in network.flat.loads}
    try:
        return Engine(Wiring(network, replace(scenario, loads=off, commands={}, gains={})))
    except ThermidError:
        return Engine(Wiring(network, scenario))


def _balanced(engine: Engine, loose: Sequence[int]) -> tuple[Array, Array]:
    """Return temperatures (nodes,) [K] at which the loose nodes store no heat, and the Jacobian (nodes, nodes) of the net heat. [W/K]"""
    assembled = engine.wiring.assemble(gradients=False)
    temperatures = np.array(assembled.initial)
    low, high = 0.5 * float(temperatures.min()), 2.0 * float(temperatures.max())
    jacobian = np.zeros((temperatures.size,) * 2)
    for _ in range(STEPS):
        heat, jacobian, _ = engine.rhs(assembled, temperatures, 0.0)
        step = np.linalg.lstsq(jacobian[np.ix_(loose, loose)], -heat[loose], rcond=None)[0]
        temperatures[loose] = np.clip(temperatures[loose] + step, low, high)
        if np.abs(step).max(initial=0.0) < 1e-3:
            break
    return temperatures, jacobian


def _groups(jacobian: Array, loose: Sequence[int]) -> list[list[int]]:
    """Return the loose nodes in groups that exchange heat among themselves."""
    linked = (jacobian != 0.0) | (jacobian.T != 0.0)
    left, out = np.zeros(jacobian.shape[0], dtype=bool), []
    left[list(loose)] = True
    for first in loose:
        if not left[first]:
            continue
        left[first] = False
        group = [first]
        for k in group:  # grows as it is walked
            beside = np.flatnonzero(linked[k] & left)
            left[beside] = False
            group += beside.tolist()
        out.append(group)
    return out
