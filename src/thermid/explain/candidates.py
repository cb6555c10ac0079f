"""Catalogue of what may explain a misfit: faults, each one number of the model or one sensor, and elements that the model lacks."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from thermid.dual import value_of
from thermid.fit.calibration import Calibration
from thermid.fit.problem.experiment import Experiment
from thermid.fit.problem.request import LocalSpec, Request
from thermid.measure.amounts import short
from thermid.model.parts.elements import Conductor, HeatLoad, Node
from thermid.model.parts.parameter import parameter
from thermid.model.tree.model import Model
from thermid.network.network import Network, compile_network
from thermid.simulation.scenarios.scenario import Scenario

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
Judge = Callable[[Calibration], tuple[str, bool]]
"""What was found, in words, and whether it is physically possible."""
SENSOR_LAG = (0.5, 600.0)
"""Time constants of a sensor on or in a metal part, from a bare thermocouple to a probe in a pocket. [s]"""
NATURAL = (0.2, 6.0)
"""Coefficient c of h = c dT^(1/4) in air: 1.3 to 1.4 (1/L)^(1/4) for L of 2 cm to 1 m, halved and doubled for shape (McAdams, Heat
Transmission, 3rd ed., chapter 7). [W/(m^2 K^1.25)]"""
GROWTH = (0.0, 0.02)
"""Growth of a loss with temperature, as a share per kelvin; copper alone has 0.0039. [1/K]"""


@dataclass(frozen=True)
class Fault:
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


def faults_of(model: Model, sensors: Mapping[str, str]) -> tuple[Model, tuple[Fault, ...]]:
    """Single faults of a model: a link more between any two masses, boundaries, powers, capacitances, sensors.

    Parameters
    ----------
    model : Model       The model.
    sensors : dict      Sensor -> its node.

    Returns
    -------
    Model               With a link of no conductance between every two masses, so that each can be varied.
    tuple of Fault
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
        out.append(Fault("link", text, f"{name}.conductance", size if np.isfinite(size) and size > 0 else 0.1, not known, "W/K"))
    out.append(Fault("boundary or reference", "all sensors", "", KELVIN, unit="K"))
    out += [Fault("boundary or reference", f"boundary {b}", b, KELVIN, unit="K") for b in network.boundaries]
    out += [Fault("power", f"power of {load.path}", f"scale.{load.path}", SHARE, start=1.0) for load in network.flat.loads]
    out += [Fault("capacitance", f"capacitance of {node}", path, SHARE, start=value) for node, path, value in _masses(network, held)]
    out += [Fault("sensor", s, "", KELVIN, unit="K", sensor=s) for s in sensors]
    out += [Fault("sensor", f"{s} loose", "", LOOSE, True, "1", s) for s in sensors]
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


@dataclass(frozen=True, eq=False)
class MissingElement:
    """One element laid over a model.

    Parameters
    ----------
    name : str          What it is, in words.
    request : Request   The fit with it.
    judge : callable    Says what was found and whether it is possible.
    chosen : int        Numbers that were chosen before the refit, such as the time of a course; they count as fitted ones.
    """

    name: str
    request: Request
    judge: Judge
    chosen: int = 0


@dataclass(frozen=True)
class _Place:
    """An observed node with what a candidate must know of it."""

    node: str
    channels: tuple[str, ...]
    capacity: float
    boundary: str
    area: float
    rise: float
    load: str
    power: float


def missing_elements(fit: Calibration, request: Request) -> Iterator[MissingElement]:
    """Missing elements that are worth a refit, for every observed node with a heat capacity."""
    numbers = {e.record.name: e for e in fit.experiments}
    for place in _places(fit, next(iter(numbers.values()))):
        yield _lag(request, place)
        yield MissingElement(f"a second mass behind a resistance at '{place.node}'", *_second(request, place, "hidden_mass"))
        if place.load in request.model.loads:
            yield _source(request, place)
        if place.boundary:
            yield _steeper(request, place)
            yield _radiation(request, place)
        if place.load:
            yield _growing(request, place)


def _places(fit: Calibration, experiment: Experiment) -> list[_Place]:
    network = experiment.network
    numbers = network.numbers({p: v.value for p, v in fit.values.assignments.items() if p in network.flat.parameters.table})
    channels: dict[str, list[str]] = {}
    for e in fit.experiments:
        for o in e.observations:
            channels.setdefault(o.seat, [])
            if o.sensor not in channels[o.seat]:
                channels[o.seat].append(o.sensor)
    out = []
    for node, names in channels.items():
        capacity = value_of(numbers.capacitances.get(node) or 0.0)
        if not capacity > 0:
            continue
        ends = [row.ends for row in numbers.conductors if node in row.ends]
        boundary = next((b for pair in ends for b in pair if b in network.boundaries), "")
        values = numbers.values
        skins = [c for c in network.flat.conductors if node in c.ends and c.kind in ("convection", "effective") and "area" in c.fields]
        area = sum(float(value_of(values[c.fields["area"]])) for c in skins)
        load = next((r.path for r in network.flat.loads if r.node == node), "")
        power = next((float(value_of(row.coefficients[0])) for row in numbers.loads if row.name == load), 0.0)
        block = next(b for b in fit.blocks if b.node == node)
        rise = max(float(block.predicted.max() - block.predicted.min()), 1e-3)
        out.append(_Place(node, tuple(names), capacity, boundary, area, rise, load, power))
    return out


def _with(request: Request, name: str, free: tuple[str, ...], **tables: Mapping[str, Any]) -> Request:
    """Return a request whose model has more elements."""
    model: Model = request.model
    changes: dict[str, Any] = {t: {**getattr(model, t), **more} for t, more in tables.items()}
    grown: Model = replace(model, **changes)
    return replace(request, model=grown, free=(*request.free, *free), name=f"{request.name or model.title} with {name}")


def _started(request: Request, node: str, place: _Place) -> Request:
    """Return a request in which a node that nobody observes starts at the first reading beside it, where nothing else says how."""
    scenarios = {}
    for r in request.records:
        base = request.scenarios.get(r.name, request.scenarios.get("*"))
        base = base or Scenario(r.name)
        own = next((c for c in place.channels if c in r.channels), "")
        loose = base.start in ("", "measured") and own
        scenarios[r.name] = base.with_(initial={node: own}) if loose else base
    return replace(request, scenarios=scenarios)


def _lag(request: Request, place: _Place) -> MissingElement:
    name, link = "lagging_sensor", "lagging_sensor_fit"
    held = 1e-3 * place.capacity
    tables: dict[str, Mapping[str, Any]] = {
        "nodes": {name: Node({"capacitance": parameter(f"{held!r} [J/K]", name)})},
        "conductors": {
            link: Conductor("conduction", (place.node, name), {"conductance": parameter(f"{held / 30.0!r} [W/K]", link)}),
        },
    }
    free = f"{link}.conductance"
    made = _with(request, "a lag of the sensor", (free,), **tables)
    records = tuple(
        r.with_channels(*(replace(c, target=name, role="node") for n, c in r.channels.items() if n in place.channels))
        for r in request.records
    )
    made = replace(made, records=records)
    bases = (request.scenarios.get(r.name, request.scenarios.get("*")) for r in request.records)
    if all(base is None or base.start in ("", "measured") for base in bases):
        made = replace(made, local={**made.local, f"initial.{place.node}": LocalSpec(place.channels[0])})

    def judge(found: Calibration) -> tuple[str, bool]:
        tau = held / found[free].value
        low, high = SENSOR_LAG
        return f"a time constant of {short(tau, 3)} s +- {short(100 * found[free].error / found[free].value)} %", low <= tau <= high

    return MissingElement(f"a lag of the sensor at '{place.node}'", made, judge)


def _source(request: Request, place: _Place) -> MissingElement:
    """The heat enters a second mass inside, not the part that is measured."""
    made, judge = _second(request, place, "inner_mass")
    model = made.model
    moved = replace(model, loads={**model.loads, place.load: replace(model.loads[place.load], into="inner_mass")})
    return MissingElement(f"an inner mass that takes the heat of '{place.load}'", replace(made, model=moved), judge)


def _second(request: Request, place: _Place, name: str) -> tuple[Request, Judge]:
    """Return a request with a mass behind a resistance, and the judge of both."""
    held, link = 0.3 * place.capacity, f"{name}_link"
    tables: dict[str, Mapping[str, Any]] = {
        "nodes": {name: Node({"capacitance": parameter(f"{held!r} [J/K]", name)})},
        "conductors": {link: Conductor("conduction", (place.node, name), {"conductance": parameter(f"{held / 300.0!r} [W/K]", link)})},
    }
    free = (f"{name}.capacitance", f"{link}.conductance")

    def judge(found: Calibration) -> tuple[str, bool]:
        held, link = found[free[0]].value, found[free[1]].value
        text = f"{short(held, 3)} J/K behind {short(1 / link, 3)} K/W ({short(held / link, 3)} s), beside {short(place.capacity, 3)} J/K"
        return text, 0.02 <= held / place.capacity <= 20.0

    return _started(_with(request, name.replace("_", " "), free, **tables), name, place), judge


def _steeper(request: Request, place: _Place) -> MissingElement:
    name, area = "steeper_convection", place.area or 1.0
    fields = {
        "htc.coefficient": parameter("0.5 [W/(m^2 K)]" if place.area else "0.01 [W/(m^2 K)]", name),
        "htc.exponent": parameter("0.25", name),
        "area": parameter(f"{area!r} [m^2]", name),
    }
    made = _with(
        request,
        "h that grows",
        (f"{name}.htc.coefficient",),
        conductors={name: Conductor("convection", (place.node, place.boundary), fields)},
    )

    def judge(found: Calibration) -> tuple[str, bool]:
        c = found[f"{name}.htc.coefficient"].value
        share = f"{short(c * area * place.rise**0.25, 3)} W/K of it at a rise of {short(place.rise, 3)} K"
        return f"{short(c, 3)} W/(m^2 K) (dT / 1 K)^(1/4), {share}", not place.area or NATURAL[0] <= c <= NATURAL[1]

    return MissingElement(f"a coefficient at '{place.node}' that grows with the difference (dT^(1/4))", made, judge)


def _radiation(request: Request, place: _Place) -> MissingElement:
    name, area = "radiated", place.area or 0.01
    fields = {"exchange_factor": parameter({"value": "0.2", "min": 1e-6}, name), "area": parameter(f"{area!r} [m^2]", name)}
    free = f"{name}.exchange_factor"
    made = _with(request, "radiation", (free,), conductors={name: Conductor("radiation", (place.node, place.boundary), fields)})

    def judge(found: Calibration) -> tuple[str, bool]:
        e = found[free].value
        return f"an emissivity of {short(e)} over {short(1e4 * area, 3)} cm^2", 0.01 <= e <= 1.0 if place.area else e > 0.0

    return MissingElement(f"radiation of '{place.node}' to '{place.boundary}'", made, judge)


def _growing(request: Request, place: _Place) -> MissingElement:
    name = "growing_power"
    start = max(1e-3 * abs(place.power), 1e-5)
    # P (1 + 1/K (T - T_ref)), with T_ref one kelvin above 20 degC, is P/K (T - 20 degC)
    fields = {
        "power": parameter(f"{start!r} [W]", name),
        "temperature_coefficient": parameter("1 [1/K]", name),
        "reference_temperature": parameter("21 [degC]", name),
    }
    made = _with(request, "power that grows", (f"{name}.power",), loads={name: HeatLoad(place.node, fields)})

    def judge(found: Calibration) -> tuple[str, bool]:
        growth = found[f"{name}.power"].value
        share = growth / abs(place.power) if place.power else float("inf")
        return f"{short(1e3 * growth, 3)} mW/K, {short(100 * share)} % of the power per kelvin", GROWTH[0] <= share <= GROWTH[1]

    return MissingElement(f"a power of '{place.load}' that grows with temperature", made, judge)
