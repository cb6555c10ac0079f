"""Random faults planted in a unit before its logs are made; the model that is compared with the logs knows nothing of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

import thermid as td
from thermid.inference._explain.candidates import laid_open
from thermid.model.tree import Conductor, Parameter

GROUPS = ("boundary or reference", "power", "link", "sensor", "capacitance")
NOISE, ACCURACY, VISIBLE = 0.05, 0.2, 0.8
"""Of a reading and of a sensor [K]; a fault counts as planted when some sensor shows this much of it [K]."""


@dataclass(frozen=True)
class Plant:
    """A fault and what was made of it: its group, in words, and the comparisons of the model with the logs."""

    group: str
    words: str
    told: tuple[td.Calibration, ...]


def plant(
    model: td.Model, cases: Sequence[td.Scenario], sensors: Mapping[str, str], group: str, rng: np.random.Generator, scatter: float = 0.02
) -> Plant:
    """Return a random fault of a group; the hidden unit also differs from the model by `scatter` in every conductance and capacitance."""
    times = [np.arange(0.0, s.seconds + 1.0, 120.0) for s in cases]
    clean = [td.simulate(model, s, times=t) for s, t in zip(cases, times, strict=True)]
    for _ in range(200):
        hidden, words, shift, air = _fault(model, sensors, group, rng)
        runs = [td.simulate(hidden, _warmer(s, air), times=t) for s, t in zip(cases, times, strict=True)]
        shown = [
            np.abs(r[n].kelvin + shift.get(s, 0.0) - c[n].kelvin).max()
            for r, c in zip(runs, clean, strict=True)
            for s, n in sensors.items()
        ]
        if max(shown) >= VISIBLE:
            break
    else:
        raise AssertionError(f"no visible fault of group {group}")
    scattered = _scattered(hidden, model, scatter, rng)
    runs = [td.simulate(scattered, _warmer(s, air), times=t) for s, t in zip(cases, times, strict=True)]
    bias = {s: rng.normal(0.0, ACCURACY) + shift.get(s, 0.0) for s in sensors}
    told = []
    for scenario, run in zip(cases, runs, strict=True):
        made = {
            s: td.Channel.from_array(
                s,
                run[n].kelvin + bias[s] + NOISE * rng.standard_normal(run.times.size),
                unit="K",
                role="node",
                target=n,
                noise=NOISE,
                accuracy=ACCURACY,
            )
            for s, n in sensors.items()
        }
        told.append(td.compare(model, td.Record.from_arrays(scenario.title, run.times, made), scenario=scenario))
    return Plant(group, words, tuple(told))


def _warmer(scenario: td.Scenario, kelvin: float) -> td.Scenario:
    if not kelvin:
        return scenario
    shifted = {}
    for name, signal in scenario.boundaries.items():
        grid = np.linspace(0.0, scenario.seconds, 401)
        shifted[name] = (grid, td.quantity(np.broadcast_to(signal.at(grid), grid.shape) + kelvin, unit="K"))
    return scenario.with_(boundaries=shifted)


def _fault(
    model: td.Model, sensors: Mapping[str, str], group: str, rng: np.random.Generator
) -> tuple[td.Model, str, dict[str, float], float]:
    network = td.simulation.compile_network(model)
    sign = rng.choice([-1.0, 1.0])
    if group == "boundary or reference":
        size = sign * rng.uniform(1.5, 4.0)
        if rng.random() < 0.5:
            return model, f"all sensors {size:+.1f} K", dict.fromkeys(sensors, size), 0.0
        return model, f"surroundings {size:+.1f} K", {}, size
    if group == "sensor":
        one, size = rng.choice(list(sensors)), sign * rng.uniform(1.5, 5.0)
        return model, f"{one} {size:+.1f} K", {str(one): size}, 0.0
    numbers = network.numbers()
    held = [n for n, c in numbers.capacitances.items() if c]
    if group == "power":
        load = network.flat.loads[rng.integers(len(network.flat.loads))]
        path, part = f"{load.path}.power", sign * rng.uniform(0.15, 0.4)
        return _scaled(model, path, 1.0 + part), f"power of {load.path} {100 * part:+.0f} %", {}, 0.0
    if group == "capacitance":
        nodes = [n for n in network.flat.nodes if n.path in held]
        node, part = nodes[rng.integers(len(nodes))], sign * rng.uniform(0.2, 0.5)
        path = network.flat.parameters.literal_behind(node.fields.get("specific_heat", "") or node.fields["capacitance"])
        if not network.flat.parameters.table[path].parameter.is_literal:
            path = f"{path.rpartition('.')[0].rpartition('.')[0]}.specific_heat"
        return _scaled(model, path, 1.0 + part), f"capacitance of {node.path} {100 * part:+.0f} %", {}, 0.0
    ends = [*held, *network.boundaries]
    joined = {frozenset(c.ends[:2]) for c in network.flat.conductors}
    while True:
        a, b = (ends[k] for k in rng.choice(len(ends), 2, replace=False))
        if frozenset((a, b)) not in joined and not {a, b} <= set(network.boundaries):
            break
    size = float(np.exp(rng.uniform(np.log(0.03), np.log(0.6))))
    grown = laid_open(model)
    link = Conductor("conduction", (a, b), {"conductance": Parameter.read(f"{size!r} [W/K]", "planted")})
    return replace(grown, conductors={**grown.conductors, "planted": link}), f"link {a} - {b} {size:.2f} W/K", {}, 0.0


def _scaled(model: td.Model, path: str, factor: float) -> td.Model:
    parameters = td.simulation.compile_network(model).flat.parameters
    at = parameters.freeable(path, model.canonical)
    unit = parameters.table[at].parameter.expression.literal.unit
    value = float(parameters.evaluate({})[at]) * float(factor) / float(unit.factor)
    return model.with_values({at: {"value": f"{value!r} [{unit.text}]", "min": -1e9, "max": 1e9}})


def left_open(model: td.Model, scatter: float = 0.02) -> dict[str, float]:
    """Return path -> standard deviation of what a calibration leaves open of a model. [SI]"""
    parameters = td.simulation.compile_network(model).flat.parameters
    values = parameters.evaluate({})
    return {
        path: scatter * float(values[path])
        for path, entry in parameters.table.items()
        if entry.parameter.is_literal and path.rpartition(".")[2] in ("effective_htc", "conductance", "mass", "capacitance")
    }


def _scattered(hidden: td.Model, model: td.Model, scatter: float, rng: np.random.Generator) -> td.Model:
    """Return the hidden unit with coefficients and masses a little off, as a calibration leaves them."""
    out = hidden
    for path in left_open(model):
        out = _scaled(out, path, float(np.exp(scatter * rng.standard_normal())))
    return out
