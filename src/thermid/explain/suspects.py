"""What may be wrong between a model and its readings: every boundary, power, link, capacitance and sensor, each as one number."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from thermid.dual import value_of
from thermid.model.parts.elements import Conductor
from thermid.model.parts.parameter import parameter
from thermid.model.tree.model import Model
from thermid.network.network import Network, compile_network

__all__ = ["GROUPS", "Candidate", "laid_open", "suspects"]

GROUPS = {
    "boundary or reference": "the chamber's or room's temperature, or an error that all sensors share: reference junction, logger",
    "power": "what is dissipated, or how it was measured",
    "link": "a path of heat that is missing, or stronger or weaker than it is modelled",
    "capacitance": "a mass or a specific heat",
    "sensor": "one sensor: off, or come loose",
}
"""Group of parameters -> what it stands for."""
KELVIN, SHARE, LOOSE, MORE = 5.0, 0.4, 0.3, 0.5
"""How large a fault is taken to be, as standard deviations: temperatures [K], powers and capacitances [-], the part of its reading that a
loose sensor takes from its surroundings [-], and a link over what its ends have already [-]. Generous on purpose: what they decide is
between groups of like evidence."""
ADDED = "suspected_link_"


@dataclass(frozen=True)
class Candidate:
    """One thing that may be wrong.

    Parameters
    ----------
    group : str         A key of `GROUPS`.
    name : str          What it is.
    free : str          What varies in a simulation; empty for what acts on readings alone.
    size : float        Standard deviation of the fault that is thought possible, in its own unit.
    one_sided : bool    Whether it can only be above zero.
    unit : str          K, 1, W/K.
    sensor : str        The sensor that it acts on, where it is one.
    start : float       The value in the model; what varies is added to it. [SI]
    """

    group: str
    name: str
    free: str
    size: float
    one_sided: bool = False
    unit: str = "1"
    sensor: str = ""
    start: float = 0.0

    def words(self, amount: float) -> str:
        """Return what a fault of a size means."""
        if self.group == "sensor":
            return f"{self.name} {amount:+.1f} K" if self.unit == "K" else f"{self.name}: {100 * amount:.0f} % of its reading is the room"
        if self.unit == "K":
            return f"{self.name} {amount:+.1f} K"
        return f"{self.name} {amount:+.3g} W/K" if self.unit == "W/K" else f"{self.name} {100 * amount:+.0f} %"


def laid_open(model: Model) -> Model:
    """Return a model of which every node may be linked from outside."""
    parts = {name: replace(part, model=laid_open(part.model)) for name, part in model.submodels.items()}
    own = [*model.nodes, *(f"{name}.{offered}" for name, part in parts.items() for offered in part.model.offers)]
    return replace(model, submodels=parts, offers=tuple(dict.fromkeys([*model.offers, *own])))


def suspects(model: Model, sensors: Mapping[str, str]) -> tuple[Model, tuple[Candidate, ...]]:
    """Return a model with a link of no conductance between every two masses, and everything in it that may be wrong.

    Parameters
    ----------
    model : Model       The model.
    sensors : dict      Sensor -> its node.
    """
    network = compile_network(model)
    numbers = network.numbers()
    held = {n: float(value_of(c)) for n, c in numbers.capacitances.items() if c is not None and value_of(c) > 0}
    pairs = [p for p in itertools.combinations([*held, *network.boundaries], 2) if not set(p) <= set(network.boundaries)]
    strength, joined = _strength(network), _joined(network, {*held, *network.boundaries})
    links, out = {}, []
    for k, (a, b) in enumerate(pairs):
        name = f"{ADDED}{k}"
        links[name] = Conductor("conduction", (a, b), {"conductance": parameter("0 [W/K]", name)})
        size = MORE * min(strength.get(n, np.inf) for n in (a, b) if n in held)
        known = frozenset((a, b)) in joined
        text = f"link {a} - {b}" if known else f"missing link {a} - {b}"
        out.append(Candidate("link", text, f"{name}.conductance", size if np.isfinite(size) and size > 0 else 0.1, not known, "W/K"))
    out.append(Candidate("boundary or reference", "all sensors", "", KELVIN, unit="K"))
    out += [Candidate("boundary or reference", f"boundary {b}", b, KELVIN, unit="K") for b in network.boundaries]
    out += [Candidate("power", f"power of {load.path}", f"scale.{load.path}", SHARE, start=1.0) for load in network.flat.loads]
    out += [Candidate("capacitance", f"capacitance of {node}", path, SHARE, start=value) for node, path, value in _masses(network, held)]
    out += [Candidate("sensor", s, "", KELVIN, unit="K", sensor=s) for s in sensors]
    out += [Candidate("sensor", f"{s} loose", "", LOOSE, True, "1", s) for s in sensors]
    grown = laid_open(model)
    return replace(grown, conductors={**grown.conductors, **links}), tuple(out)


def _strength(network: Network) -> dict[str, float]:
    """Return node -> sum of the constant conductances that end at it. [W/K]"""
    out: dict[str, float] = {}
    for row in network.numbers().conductors:
        size = abs(float(value_of(row.coefficients[0]))) if row.coefficients else 0.0
        for n in row.ends:
            out[n] = out.get(n, 0.0) + size
    return {n: g for n, g in out.items() if np.isfinite(g) and g > 0}


def _joined(network: Network, ends: set[str]) -> set[frozenset[str]]:
    """Return the pairs of masses and boundaries that heat passes between directly or through nodes without mass."""
    near: dict[str, set[str]] = {}
    for row in network.numbers().conductors:
        a, b = row.ends[0], row.ends[1]
        near.setdefault(a, set()).add(b)
        near.setdefault(b, set()).add(a)
    out = set()
    for begin in ends:
        seen, todo = {begin}, [*near.get(begin, ())]
        while todo:
            n = todo.pop()
            if n in seen:
                continue
            seen.add(n)
            if n in ends:
                out.add(frozenset((begin, n)))
            else:
                todo += near.get(n, ())
    return out


def _masses(network: Network, held: Mapping[str, float]) -> Iterator[tuple[str, str, float]]:
    """Yield node, path and value of a number that this node's capacitance, and no other one's, is proportional to."""
    table, values = network.flat.parameters, network.numbers().values
    fields = {n.path: [p for p in n.fields.values() if p] for n in network.flat.nodes}
    for node, own in held.items():
        wanted = set(fields[node])
        roots = [p for p in table.order if table.table[p].parameter.is_literal and wanted & set(table.downstream([p]))]
        for path in roots:
            value = float(value_of(values[path]))
            after = network.numbers({path: 1.01 * value}).capacitances
            moved = {n for n, c in held.items() if abs(float(value_of(after[n] or 0.0)) / c - 1.0) > 1e-9}
            if moved == {node} and abs(float(value_of(after[node] or 0.0)) / own - 1.01) < 1e-9:
                yield node, path, value
                break
