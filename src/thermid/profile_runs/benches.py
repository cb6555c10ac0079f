"""A model put into the chamber of a profile: its boundaries, what is switched, and the conditions at the start."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from thermid.errors import ScenarioError, nearest
from thermid.model.laws.signal import Constant
from thermid.model.tree.model import Model
from thermid.network.network import compile_network
from thermid.profile_runs.legs import Bench, Conditions, memory_of
from thermid.profiles.profile import ThermalProfile
from thermid.simulation.scenarios.scenario import Scenario
from thermid.simulation.simulator import network_for
from thermid.simulation.solver.engine import Options

__all__ = ["bench_of", "node_of", "watched"]


def bench_of(
    model: Model,
    profile: ThermalProfile,
    chamber: str | Sequence[str],
    equipment: Sequence[str] | None,
    base: Scenario,
    options: Options,
) -> tuple[Bench, Conditions]:
    """Return the model in its chamber, and the conditions at the start."""
    network = compile_network(model, prescribed=tuple(base.prescribed))  # the steps say in which gas it runs
    asked = (chamber,) if isinstance(chamber, str) else tuple(chamber)
    if not asked and len(network.boundaries) != 1:
        raise ScenarioError(f"say which boundaries are the chamber: chamber = ... out of {', '.join(network.boundaries)}.", profile.title)
    names = tuple(model.canonical(n) for n in asked) or network.boundaries
    for name in names:
        if name not in network.boundaries:
            raise ScenarioError(f"'{name}' is no boundary.{nearest(name, network.boundaries)}", f"{profile.title}, chamber")
    free = [b for b in network.boundaries if b not in names and b not in {model.canonical(k) for k in base.boundaries}]
    if free:
        raise ScenarioError(
            f"boundary '{free[0]}' is not the chamber and has no temperature. Name it in chamber, or give it one in the scenario.",
            profile.title,
        )
    loads = {load.path: load for load in network.flat.loads}
    switched = tuple(model.canonical(n) for n in equipment) if equipment is not None else ()
    for name in switched:
        if name not in loads:
            raise ScenarioError(f"there is no load '{name}' to switch.{nearest(name, loads)}", f"{profile.title}, equipment")
    if equipment is None:
        controlled = ("thermostat", "proportional")
        switched = tuple(p for p, load in loads.items() if not any(f.startswith(controlled) for f in load.fields))
    ambient = profile.value("ambient")
    others = {k: v for k, v in base.boundaries.items() if model.canonical(k) not in names}
    steps = profile.steps
    thin = any(s.pressure is not None for s in steps)
    kept = replace(
        base,
        boundaries=others,
        loads={model.canonical(k): v for k, v in base.loads.items()},
        commands={model.canonical(k): v for k, v in base.commands.items()},
        start=base.start if base.start != "" else ambient,
    )
    gases = tuple(n for n in names if n in base.environment) or (("*",) if thin else ())
    bench = Bench(model, kept, names, switched, gases, profile.ground, options, memory_of(model, _kept_with(kept, names, ambient)))
    humid = profile.value("humidity") if profile.has("humidity") else None
    first = next((s.power for s in steps if s.power is not None), True)
    return bench, Conditions(ambient, bool(first), profile.ground if thin else None, humid)


def _kept_with(base: Scenario, chamber: tuple[str, ...], kelvin: float) -> Scenario:
    """Return a scenario with the chamber at a temperature."""
    return base.with_(boundaries={name: Constant(kelvin) for name in chamber})


def node_of(bench: Bench, name: str) -> str:
    """Return the path of a node."""
    network = network_for(bench.model, bench.base)
    return network.find(name)


def watched(bench: Bench, watch: Sequence[str]) -> tuple[str, ...]:
    """Return the nodes that must be stable."""
    network = network_for(bench.model, bench.base)
    if watch:
        return tuple(network.find(n) for n in watch)
    capacities = network.numbers().capacitances
    return tuple(n for n in network.nodes if capacities.get(n) is not None)
