"""Catalogue of what may explain a misfit: faults, each one number of the model or one sensor, and elements that the model lacks."""

from __future__ import annotations

import functools
import itertools
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from thermid.base.errors import CodedText, quoted
from thermid.base.units import HOUR, Array, short, value_of
from thermid.fit.calibration import MEASURED, Calibration, Experiment, LocalSpec, Problem, Request, SensorTrace, clock_suffix, first_reading
from thermid.fit.power import PowerCourse
from thermid.inference._explain.thresholds import (
    DEFAULT_COLD_TEMPERATURE,
    MAX_CLOCK_ERROR,
    MAX_CLOCK_SHARE,
    MAX_PLACES,
    MAX_TIP_SHARE,
    PACES,
    SETTLING_PACES,
    SIZES,
    SLOWEST_MASS,
    SLOWEST_SAMPLES,
    START_SHARE,
    WRONG_HOURS,
    SizedValue,
)
from thermid.model.tree import Conductor, Curve, HeatLoad, Model, Node, Parameter
from thermid.simulation.runs import Network, Scenario, compile_network

ADDED = "suspected_link_"
Judge = Callable[[Any], tuple[str, bool]]
"""Of a calibration, or of anything that has values with errors by path: what was found, in words, and whether it is possible."""


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
        """Return the fault with its size in words.

        `amount` is in the fault's `unit`, K or W/K, else a share [-]; of a loose sensor, the share of its reading that is the ambient.
        """
        if self.group == "sensor":
            return (
                f"{self.name} {amount:+.1f} K" if self.unit == "K" else (f"{self.name}: {100 * amount:.0f} % of its reading is the ambient")
            )
        if self.unit == "K":
            return f"{self.name} {amount:+.1f} K"
        return f"{self.name} {amount:+.3g} W/K" if self.unit == "W/K" else f"{self.name} {100 * amount:+.0f} %"


def laid_open(model: Model) -> Model:
    """Return a model of which every node may be linked from outside."""
    parts = {name: replace(part, model=laid_open(part.model)) for name, part in model.submodels.items()}
    own_nodes = [*model.nodes, *(f"{name}.{offered}" for name, part in parts.items() for offered in part.model.offers)]
    return replace(model, submodels=parts, offers=tuple(dict.fromkeys([*model.offers, *own_nodes])))


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
    strength = {n: g for n, g in _strengths(network.numbers().conductors).items() if g > 0.0}
    joined = _neighbours(network, {*held, *network.boundaries})
    links, out = {}, []
    for k, (a, b) in enumerate(pairs):
        name = f"{ADDED}{k}"
        links[name] = Conductor("conduction", (a, b), {"conductance": Parameter.read("0 [W/K]", name)})
        size = SIZES["contact"].spread * min(strength.get(n, np.inf) for n in (a, b) if n in held)
        is_linked = frozenset((a, b)) in joined
        text = f"link {a} - {b}" if is_linked else f"missing link {a} - {b}"
        out.append(Fault("link", text, f"{name}.conductance", size if np.isfinite(size) and size > 0 else 0.1, not is_linked, "W/K"))
    out.append(Fault("boundary or reference", "all sensors", "", SIZES["boundary"].spread, unit="K"))
    out += [Fault("boundary or reference", f"boundary {b}", b, SIZES["boundary"].spread, unit="K") for b in network.boundaries]
    out += [Fault("power", f"power of {load.path}", f"scale.{load.path}", SIZES["power"].spread, start=1.0) for load in network.flat.loads]
    share = SIZES["capacitance"].spread
    out += [Fault("capacitance", f"capacitance of {node}", path, share, start=value) for node, path, value in _masses(network, held)]
    out += [Fault("sensor", s, "", SIZES["sensor"].spread, unit="K", sensor=s) for s in sensors]
    out += [Fault("sensor", f"{s} loose", "", SIZES["loose"].spread, True, "1", s) for s in sensors]
    grown = laid_open(model)
    return replace(grown, conductors={**grown.conductors, **links}), tuple(out)


def _neighbours(network: Network, ends: set[str]) -> set[frozenset[str]]:
    """Return the pairs of masses and boundaries that heat passes between directly or through nodes without mass."""
    near: dict[str, set[str]] = {}
    for row in network.numbers().conductors:
        a, b = row.ends[0], row.ends[1]
        near.setdefault(a, set()).add(b)
        near.setdefault(b, set()).add(a)
    out = set()
    for begin in ends:
        visited, todo = {begin}, [*near.get(begin, ())]
        while todo:
            n = todo.pop()
            if n in visited:
                continue
            visited.add(n)
            if n in ends:
                out.add(frozenset((begin, n)))
            else:
                todo += near.get(n, ())
    return out


def _masses(network: Network, held: Mapping[str, float]) -> Iterator[tuple[str, str, float]]:
    """Yield node, path and value [SI] of a number that this node's capacitance [J/K], and no other one's, is proportional to.

    It is found by a change of 1 %. `held` is node -> capacitance.
    """
    table, values = network.flat.parameters, network.numbers().values
    fields = {n.path: [p for p in n.fields.values() if p] for n in network.flat.nodes}
    for node, capacitance in held.items():
        wanted = set(fields[node])
        roots = [p for p in table.order if table.table[p].parameter.is_literal and wanted & set(table.downstream([p]))]
        for path in roots:
            value = float(value_of(values[path]))
            after = network.numbers({path: 1.01 * value}).capacitances
            moved = {n for n, c in held.items() if abs(float(value_of(after[n] or 0.0)) / c - 1.0) > 1e-9}
            if moved == {node} and abs(float(value_of(after[node] or 0.0)) / capacitance - 1.01) < 1e-9:
                yield node, path, value
                break


@dataclass(frozen=True, eq=False)
class MissingElement:
    """One change of structure, laid over a model: an element that it lacks.

    Parameters
    ----------
    name : str          What it is, in words.
    request : Request   The fit with it.
    judge : callable    Says what was found and whether it is possible.
    make : callable     Lays it over another request of the same model, so that several are tried together.
    nodes : int         Masses that it adds; that of a sensor that lags is one.
    tips : int          Of these, those of thermometers of one kind, all of which lag.
    sizes : dict        Path -> prior of what it adds, from the table of causes.
    starts : tuple      Path -> value [SI] to begin a search from, one table for each start; empty for that of the request.
    additive : bool     Whether its effect grows with its value, which begins small: one derivative says what it would do.
    chosen : int        Numbers that were chosen before the refit, such as the time of a course; they count as fitted ones.
    bends : bool        Whether its heat is not in proportion to differences of temperature, so that it acts otherwise at other powers.
    delay : float       How much later than logged it lets powers and commands act. [s]
    of_power : bool     Whether it is a course of a power: over time, or over temperature.
    """

    name: str
    request: Request
    judge: Judge
    make: Callable[[Request], Request]
    nodes: int = 0
    sizes: Mapping[str, SizedValue] = field(default_factory=dict)
    starts: tuple[Mapping[str, float], ...] = ()
    additive: bool = False
    chosen: int = 0
    bends: bool = False
    delay: float = 0.0
    of_power: bool = False
    tips: int = 0

    @property
    def stands_in(self) -> bool:
        """Whether residuals may ask for it in place of a mass: a law that bends, or lags, which have one value each."""
        return self.bends or 0 < len(self.sizes) == self.nodes

    def beside(self, other: MissingElement) -> MissingElement:
        """Return both changes as one, `other` laid over this one; at most two starts of each are combined."""

        def judge(values: Any) -> tuple[str, bool]:
            """Return what the fitted element is, in words, and whether its size is possible."""
            judgements = [one.judge(values) for one in (self, other)]
            return "; ".join(text for text, _ in judgements), all(possible for _, possible in judgements)

        def make(request: Request) -> Request:
            """Return the request with the element that the candidate adds."""
            return other.make(self.make(request))

        return MissingElement(
            f"{self.name}, and {other.name}",
            other.make(self.request),
            judge,
            make,
            self.nodes + other.nodes,
            {**self.sizes, **other.sizes},
            tuple({**a, **b} for a, b in itertools.product(self.starts[:2] or ({},), other.starts[:2] or ({},))),
            self.additive and other.additive,
            self.chosen + other.chosen,
            self.bends or other.bends,
            self.delay + other.delay,
            self.of_power or other.of_power,
            self.tips + other.tips,
        )


@dataclass(frozen=True)
class _Place:
    """A node at which a change may be made.

    Parameters
    ----------
    node : str              Its path.
    channels : tuple        Sensors that read it; empty where the sensor is a node of its own.
    lags : bool             Whether its sensor lags already, as a node of the deck or by the record.
    capacity : float        Heat capacity. [J/K]
    loss : float            Sum of the constant conductances that end at it. [W/K]
    boundary : str          A boundary beside it; empty for none.
    gas : bool              Whether it is gas, which does not radiate.
    area : float            Area of its surfaces; zero where none is stated. [m^2]
    rise : float            Range of its predicted temperature. [K]
    misfit : float          Root mean square of its residuals, in units of the noise. [-]
    load, power : str, float    The first load that enters it, and its power by the deck. [W]
    """

    node: str
    channels: tuple[str, ...]
    lags: bool
    capacity: float
    loss: float
    boundary: str
    gas: bool
    area: float
    rise: float
    misfit: float
    load: str
    power: float

    @property
    def word(self) -> str:
        """Its path as part of a name."""
        return _word(self.node)

    @property
    def pace(self) -> float:
        """Its time constant, capacity / loss; 600 s without a loss. [s]"""
        return self.capacity / self.loss if self.loss > 0 else 600.0


@dataclass(frozen=True, eq=False)
class Fitted:
    """A fit as far as changes of its structure must know it.

    Parameters
    ----------
    request : Request       What was asked; its model may be linked from outside at every node.
    experiments : tuple     Its records, bound to the model.
    values : dict           Path -> value of what was fitted. [SI]
    rises : dict            Node -> range of its predicted temperature. [K]
    misfits : dict          Node -> root mean square of its residuals, in units of the noise. [-]
    """

    request: Request
    experiments: tuple[Experiment, ...]
    values: Mapping[str, float]
    rises: Mapping[str, float]
    misfits: Mapping[str, float]

    @classmethod
    def of_calibration(cls, fit: Calibration, request: Request) -> Fitted:
        """Return that of a calibration."""
        values = {p: float(v.value) for p, v in fit.values.assignments.items()}
        return cls(replace(request, model=laid_open(request.model)), fit.experiments, values, *_of_traces(fit.blocks))

    @classmethod
    def of_problem(cls, request: Request, problem: Problem, fitted: Array) -> Fitted:
        """Return that of a problem at some values of its unknowns, in their fitted form."""
        values = {
            path: u.to_value(float(x))
            for u, x in zip(problem.unknowns, fitted, strict=True)
            for path in (u.name, *u.also)
            if u.kind == "parameter"
        }
        return cls(replace(request, model=laid_open(request.model)), problem.experiments, values, *_of_traces(problem.blocks(fitted)))

    def changes(self) -> Iterator[MissingElement]:
        """Changes of structure of a whole network: those at one place, between two, over all places alike, and of the commands' timing."""
        every_place = _places(self)
        places = _missed_most(every_place)
        for place in places:
            yield from _at_a_place(self, place)
            if place.boundary:
                shell = _shell(self.request, place)
                yield shell
                if place.load in self.request.model.loads:
                    yield _moved_source(self.request, place, shell, f"{shell.name} that takes the heat of '{place.load}'")
                yield _one_way(self.request, place, place.boundary, f"'{place.boundary}'")
            yield from _settling(self, place)
        joined = _joined(self)
        for a, b in itertools.combinations(places, 2):
            if frozenset((a.node, b.node)) in joined:
                yield _one_way(self.request, a, b.node, f"'{b.node}'")
        yield from _missing_contacts(self, every_place)
        for place in _places(self, hidden=True)[:MAX_PLACES]:
            yield _second_mass(self.request, place, "hidden_mass")
        yield from _of_hidden(self, every_place)
        yield from _same_everywhere(self, places)
        if len(places) > 1:
            shared = _common_mass(self.request, places)
            yield shared
            for place in places:
                if place.load in self.request.model.loads:
                    yield _moved_source(self.request, place, shared, f"{shared.name} and that takes the heat of '{place.load}'")
        yield from _delays(self.request)


def _of_traces(traces: Iterable[SensorTrace]) -> tuple[dict[str, float], dict[str, float]]:
    """Return node -> range of its predicted temperature [K], and node -> root mean square of its residuals over their noise [-].

    Of several traces of a node it is the largest of each.
    """
    rises: dict[str, float] = {}
    misfits: dict[str, float] = {}
    for t in traces:
        rises[t.node] = max(rises.get(t.node, 0.0), float(np.ptp(t.predicted)))
        misfits[t.node] = max(misfits.get(t.node, 0.0), float(np.sqrt(np.mean(t.weighted**2))))
    return rises, misfits


def missing_elements(fit: Calibration, request: Request) -> Iterator[MissingElement]:
    """Elements that may be missing at one node with a sensor, or behind it, and contacts of any two nodes, or a node and a boundary."""
    structure = Fitted.of_calibration(fit, request)
    places = _places(structure)
    for place in _missed_most(places):
        yield from _at_a_place(structure, place)
    yield from _missing_contacts(structure, places)
    yield from _of_hidden(structure, places)
    yield from _wrong_clocks(structure.request)


def hidden_defects(structure: Fitted) -> Iterator[MissingElement]:
    """What a deck may not know of and residuals betray: sensors that lag, a mass behind an observed part, a leak past another part."""
    places = _missed_most(_places(structure))
    lags = [_lag(structure.request, p) for p in places if p.channels and not p.lags]
    if lags:
        yield lags[0] if len(lags) == 1 else _all_alike(CodedText("a lag of every sensor", "element.lag"), lags)
    for place in places:
        yield _second_mass(structure.request, place, "hidden_mass")
    yield from _missing_contacts(structure, places, of_parts=False)


def _missing_contacts(structure: Fitted, places: Sequence[_Place], of_parts: bool = True) -> Iterator[MissingElement]:
    """Yield contacts of parts with boundaries, and with each other for `of_parts`, between which the deck lets no heat pass."""
    boundaries = structure.experiments[0].network.boundaries
    losses = {p.node: p.loss or 1.0 for p in places}
    joined = _joined(structure)
    for a, b in [*(itertools.combinations(losses, 2) if of_parts else ()), *itertools.product(losses, boundaries)]:
        if frozenset((a, b)) not in joined:
            yield _contact(structure.request, a, b, START_SHARE * min(losses[a], losses.get(b, np.inf)))


def plain_lacks(structure: Fitted) -> Iterator[MissingElement]:
    """Yield what honest decks lack most often: a lag, a mass, a leak, or another law of surfaces and powers, at one place or at all."""
    yield from hidden_defects(structure)
    places = _missed_most(_places(structure))
    for place in (p for p in places if p.boundary):
        yield _steeper_convection(structure.request, place)
        if not place.gas:
            yield _radiation(structure.request, place)
    yield from _same_everywhere(structure, places)


def _at_a_place(structure: Fitted, place: _Place) -> Iterator[MissingElement]:
    """Yield the elements that may be missing at one node: lag, masses, laws of its surface, a power that grows."""
    request = structure.request
    if place.channels and not place.lags:
        yield _lag(request, place)
    yield _second_mass(request, place, "hidden_mass")
    if place.load in request.model.loads:
        yield _moved_source(
            request,
            place,
            _second_mass(request, place, "inner_mass"),
            CodedText(f"an inner mass that takes the heat of '{place.load}'", "element.inner-mass"),
        )
    if place.boundary:
        yield _steeper_convection(request, place)
        if not place.gas:
            yield _radiation(request, place)
    if place.load and _may_grow(request, place.load):
        yield _growing_power(structure, place)


def _same_everywhere(structure: Fitted, places: Sequence[_Place]) -> Iterator[MissingElement]:
    """Yield one change at all places together: parts of one kind have sensors, surfaces and powers of one kind."""
    request = structure.request
    kinds: tuple[tuple[str, Callable[[Request, _Place], MissingElement], list[_Place]], ...] = (
        (CodedText("a lag of every sensor", "element.lag"), _lag, [p for p in places if p.channels and not p.lags]),
        (CodedText("radiation of every part", "element.radiation"), _radiation, [p for p in places if p.boundary and not p.gas]),
        (
            CodedText("coefficients that grow with the difference (dT^(1/4)) at every part", "element.natural-convection"),
            _steeper_convection,
            [p for p in places if p.boundary],
        ),
        (
            CodedText("powers that grow with temperature", "element.growing-power"),
            lambda _, p: _growing_power(structure, p),
            [p for p in places if p.load and _may_grow(request, p.load)],
        ),
    )
    yield from (_all_alike(name, [change(request, place) for place in at]) for name, change, at in kinds if len(at) > 1)


def _all_alike(name: str, changes: Sequence[MissingElement]) -> MissingElement:
    """Return changes of one kind at several places as one; of these kinds only lags add masses."""
    whole = functools.reduce(MissingElement.beside, changes)
    return replace(whole, name=name, tips=whole.nodes)


def _places(structure: Fitted, hidden: bool = False) -> list[_Place]:
    """Return observed masses, and those behind a sensor that is a node of its own in place of it; or the masses that nobody observes."""
    network = structure.experiments[0].network
    flat, (held, numbers) = network.flat, _held(structure)
    channels: dict[str, list[str]] = {}
    tips: dict[str, str] = {}  # sensors that lag by the record, and where they sit
    for e in structure.experiments:
        for o in e.observations:
            tips |= {o.node: o.seat} if o.node != o.seat else {}
            sensors_of_node = channels.setdefault(o.seat, [])
            sensors_of_node += [o.sensor] if o.sensor not in sensors_of_node else []
    near: dict[str, list[str]] = {}
    for row in numbers.conductors:
        for a, b in (row.ends[:2], row.ends[1::-1]):
            near.setdefault(a, []).append(b)
    loads = {r.node: r.path for r in reversed(flat.loads)}  # the first one of each node: the deck's own, before what a search added
    watts = {row.name: float(value_of(row.coefficients[0])) for row in numbers.loads}
    skins = [c for c in flat.conductors if c.kind in ("convection", "effective") and "area" in c.fields]
    strength = _strengths(numbers.conductors)
    out: dict[str, _Place] = {}
    for node in (n for n in (held if hidden else channels) if n in held):
        if hidden and (node in channels or node in tips or any(c in channels and len(near.get(c, [])) == 1 for c in near.get(node, []))):
            continue
        beside = near.get(node, [])
        tip = len(beside) == 1 and node not in loads and held[node] < MAX_TIP_SHARE * held.get(beside[0], 0.0)
        seat = beside[0] if tip else node
        if seat in out:
            continue
        around = near.get(seat, [])
        boundary = next((b for b in around if b in network.boundaries), "")
        area = sum(float(value_of(numbers.values[c.fields["area"]])) for c in skins if seat in c.ends)
        # a sensor that is a node of its own lags already
        own_channels, load = () if tip else tuple(channels.get(node, ())), loads.get(seat, "")
        rise, misfit = max(structure.rises.get(node, 1.0), 1e-3), structure.misfits.get(node, 0.0)
        lags, loss = tip or seat in tips.values(), strength.get(seat, 0.0)
        out[seat] = _Place(
            seat, own_channels, lags, held[seat], loss, boundary, seat in flat.gas_nodes, area, rise, misfit, load, watts.get(load, 0.0)
        )
    return list(out.values())


def _missed_most(places: Sequence[_Place]) -> list[_Place]:
    """Return the places with the largest residuals, in order: as many as there is time for changes that need runs of their own."""
    worst = sorted(places, key=lambda p: -p.misfit)[:MAX_PLACES]
    return [p for p in places if p in worst]


def _joined(structure: Fitted) -> set[frozenset[str]]:
    """Return the pairs of masses and boundaries between which heat passes, through no other mass."""
    network = structure.experiments[0].network
    return _neighbours(network, {*_held(structure)[0], *network.boundaries})


def _held(structure: Fitted) -> tuple[dict[str, float], Any]:
    """Return node -> heat capacity of those that store heat [J/K], and the numbers of the network, at the fitted values."""
    network = structure.experiments[0].network
    numbers = network.numbers({p: v for p, v in structure.values.items() if p in network.flat.parameters.table})
    return {n: float(value_of(c)) for n, c in numbers.capacitances.items() if c is not None and value_of(c) > 0}, numbers


def _of_hidden(structure: Fitted, places: Sequence[_Place]) -> Iterator[MissingElement]:
    """Yield contacts of masses that no sensor observes with the parts and with the surroundings; a sensor touches its part alone."""
    held, numbers = _held(structure)
    strength, joined = _strengths(numbers.conductors), _joined(structure)
    sensors = {n for e in structure.experiments for o in e.observations for n in (o.seat, o.node)}
    observed = [p.node for p in places]
    hidden = [n for n in held if n not in sensors and n not in observed]
    ends = [*observed, *structure.experiments[0].network.boundaries, *hidden]
    for k, node in enumerate(hidden):
        for other in (e for e in ends if e != node and e not in hidden[:k] and frozenset((node, e)) not in joined):
            yield _contact(structure.request, node, other, START_SHARE * (strength.get(node) or 1.0))


def _strengths(rows: Sequence[Any]) -> dict[str, float]:
    """Return node -> sum of the constant conductances that end at it. [W/K]"""
    out: dict[str, float] = {}
    for row in rows:
        size = abs(float(value_of(row.coefficients[0]))) if row.coefficients else 0.0
        for n in row.ends:
            out[n] = out.get(n, 0.0) + (size if math.isfinite(size) else 0.0)
    return out


def _amount(value: float, unit: str, name: str) -> Any:
    """Return a new value to be fitted."""
    return Parameter.read(f"{value!r} [{unit}]", name)


def _word(path: str) -> str:
    """Return a path as part of a name."""
    return re.sub(r"[^0-9A-Za-z_]", "_", path)


def _free_name(request: Request, name: str) -> str:
    """Return a name that no element of a model has."""
    taken = {*request.model.nodes, *request.model.conductors, *request.model.loads, *request.model.parameters, *request.model.needs}
    return next(n for n in (name, *(f"{name}_{k}" for k in range(2, 99))) if n not in taken)


def _adding(name: str, free: tuple[str, ...], **tables: Mapping[str, Any]) -> Callable[[Request], Request]:
    """Return what lays more elements over the model of a request and frees some of their values."""

    def make(request: Request) -> Request:
        """Return the request with the element that the candidate adds."""
        model: Model = laid_open(request.model)
        changes: dict[str, Any] = {t: {**getattr(model, t), **more} for t, more in tables.items()}
        grown: Model = replace(model, **changes)
        return replace(request, model=grown, free=(*request.free, *free), name=f"{request.name or model.title} with {name}")

    return make


def _started(request: Request, node: str, channels: Sequence[str]) -> Request:
    """Return a request in which a new node starts beside the readings there, where nothing else says how.

    Where records begin at rest or as measured, it begins at the first reading of the one channel in `channels`. Where they begin at a
    given temperature, and first readings differ by more than 3 K, it has a start of its own in each record: at the lowest first reading,
    with half their range as standard deviation, 1 K at least.
    """
    scenarios = dict(request.scenarios)
    local = {name: dict(table) for name, table in request.record_local.items()}
    for r in request.records:
        base = request.scenarios.get(r.name, request.scenarios.get("*"))
        base = base or Scenario(r.name)
        channel_of_record = next((c for c in channels if c in r.channels), "")
        if base.start in ("", MEASURED):
            scenarios[r.name] = base.with_(initial={node: channel_of_record}) if channel_of_record and len(channels) == 1 else base
            continue
        first = [
            first_reading(r, c, request.window) for c in r.channels if r[c].role in ("auto", "node") and r[c].quantity == "temperature"
        ]
        if len(first) > 1 and np.ptp(first) > 3.0:
            low = f"{float(min(first))!r} [K]"
            local.setdefault(r.name, {})[f"initial.{node}"] = LocalSpec(low, max(0.5 * float(np.ptp(first)), 1.0))
    return replace(request, scenarios=scenarios, record_local=local)


def _lag(request: Request, place: _Place) -> MissingElement:
    """Return a sensor that follows its node with a time constant tau = C / G: a small mass C behind a fitted conductance G."""
    name = _free_name(request, f"{place.word}_sensor")
    link = f"{name}_fit"
    held = 1e-3 * place.capacity
    free = f"{link}.conductance"
    grow = _adding(
        "a lag of the sensor",
        (free,),
        nodes={name: Node({"capacitance": Parameter.read(f"{held!r} [J/K]", name)})},
        conductors={link: Conductor("conduction", (place.node, name), {"conductance": _amount(held / 30.0, "W/K", link)})},
    )

    def make(request: Request) -> Request:
        """Return the request with the element that the candidate adds."""
        grown = grow(request)
        records = tuple(
            r.with_channels(*(replace(c, target=name, role="node") for n, c in r.channels.items() if n in place.channels))
            for r in request.records
        )
        grown = replace(grown, records=records)
        bases = (request.scenarios.get(r.name, request.scenarios.get("*")) for r in request.records)
        if all(base is None or base.start in ("", MEASURED) for base in bases):
            return replace(grown, local={**grown.local, f"initial.{place.node}": LocalSpec(place.channels[0])})
        own_starts = {n: {**b.initial, name: b.initial[place.node]} for n, b in request.scenarios.items() if place.node in b.initial}
        return replace(grown, scenarios={n: b.with_(initial=own_starts[n]) if n in own_starts else b for n, b in request.scenarios.items()})

    def judge(values: Any) -> tuple[str, bool]:
        """Return what the fitted element is, in words, and whether its size is possible."""
        tau = held / values[free].value
        text = f"a time constant of {short(tau, 3)} s +- {short(100 * values[free].error / values[free].value)} %"
        return text, SIZES["lag"].allows(tau)

    starts = tuple({free: held / tau} for tau in (3.0, 20.0, 120.0))
    sizes = {free: replace(SIZES["lag"].at(), middle=held / SIZES["lag"].middle)}
    return MissingElement(CodedText(f"a lag of the sensor at '{place.node}'", "element.lag"), make(request), judge, make, 1, sizes, starts)


def _moved_source(request: Request, place: _Place, mass: MissingElement, name: str) -> MissingElement:
    """Return the change `mass` with the load of a place moved into its new mass."""
    node = next(n for n in mass.request.model.nodes if n not in request.model.nodes)

    def make(request: Request) -> Request:
        """Return the request with the element that the candidate adds."""
        with_mass = mass.make(request)
        model = with_mass.model
        moved = replace(model.loads[place.load], into=node)
        return replace(with_mass, model=replace(model, loads={**model.loads, place.load: moved}))

    return replace(mass, name=name, request=make(request), make=make)


def _second_mass(request: Request, place: _Place, word: str) -> MissingElement:
    """Return a mass with fitted capacitance C2 [J/K] behind a fitted conductance G2 [W/K] at a node; `word` is part of its name.

    First it has 0.3 of the node's capacitance and C2 / G2 = 300 s. It is possible where C2 is within the sizes of a mass beside the node's
    and C2 / G2 is at most `SLOWEST_MASS` of the longest log.
    """
    name = _free_name(request, f"{place.word}_{word}")
    held, link = 0.3 * place.capacity, f"{name}_link"
    longest = SLOWEST_MASS * max(float(np.ptp(r.times)) for r in request.records)
    free = (f"{name}.capacitance", f"{link}.conductance")
    grow = _adding(
        word.replace("_", " "),
        free,
        nodes={name: Node({"capacitance": _amount(held, "J/K", name)})},
        conductors={link: Conductor("conduction", (place.node, name), {"conductance": _amount(held / 300.0, "W/K", link)})},
    )

    def make(request: Request) -> Request:
        """Return the request with the element that the candidate adds."""
        return _started(grow(request), name, place.channels)

    def judge(values: Any) -> tuple[str, bool]:
        """Return what the fitted element is, in words, and whether its size is possible."""
        held, link = values[free[0]].value, values[free[1]].value
        text = f"{short(held, 3)} J/K behind {short(1 / link, 3)} K/W ({short(held / link, 3)} s), beside {short(place.capacity, 3)} J/K"
        return text, SIZES["mass"].allows(held / place.capacity) and held / link <= longest

    mass, pace = SIZES["mass"].at(place.capacity), SIZES["pace"].at(place.pace)
    sizes = {free[0]: mass, free[1]: SizedValue(mass.middle / pace.middle, math.hypot(mass.spread, pace.spread))}
    starts = tuple({free[0]: held, free[1]: held / (share * place.pace)} for share in PACES)
    return MissingElement(
        CodedText(f"a second mass behind a resistance at '{place.node}'", "element.second-mass"),
        make(request),
        judge,
        make,
        1,
        sizes,
        starts,
    )


def _shell(request: Request, place: _Place) -> MissingElement:
    """Return a mass between a node and its boundary, with a conductance to each; the links that were there stay."""
    name = _free_name(request, f"{place.word}_shell")
    held, inner, outer = 1.0 * place.capacity, f"{name}_inner", f"{name}_outer"
    free = (f"{name}.capacitance", f"{inner}.conductance", f"{outer}.conductance")
    g = held / place.pace
    grow = _adding(
        "a shell",
        free,
        nodes={name: Node({"capacitance": _amount(held, "J/K", name)})},
        conductors={
            inner: Conductor("conduction", (place.node, name), {"conductance": _amount(g, "W/K", inner)}),
            outer: Conductor("conduction", (name, place.boundary), {"conductance": _amount(g, "W/K", outer)}),
        },
    )

    def make(request: Request) -> Request:
        """Return the request with the element that the candidate adds."""
        return _started(grow(request), name, ())

    def judge(values: Any) -> tuple[str, bool]:
        """Return what the fitted element is, in words, and whether its size is possible."""
        held, inner, outer = (values[p].value for p in free)
        text = f"{short(held, 3)} J/K, {short(inner, 3)} W/K to '{place.node}' and {short(outer, 3)} W/K to '{place.boundary}'"
        return text, SIZES["large mass"].allows(held / place.capacity)

    starts = tuple({free[0]: share * held, free[1]: g, free[2]: g} for share in (0.3, 3.0))
    sizes = {free[0]: SIZES["large mass"].at(held), free[1]: SIZES["path"].at(g), free[2]: SIZES["path"].at(g)}
    title = CodedText(f"a mass between '{place.node}' and '{place.boundary}'", "element.shell")
    return MissingElement(title, make(request), judge, make, 1, sizes, starts)


def _common_mass(request: Request, places: Sequence[_Place]) -> MissingElement:
    """Return a mass with a conductance to every place and to a boundary, such as a board."""
    name = _free_name(request, "common_mass")
    held, boundary = 3.0 * sum(p.capacity for p in places), next((p.boundary for p in places if p.boundary), "")
    links = {f"{name}_{p.word}": (p.node, 0.3 * p.capacity / p.pace) for p in places}
    links |= {f"{name}_outside": (boundary, sum(g for _, g in links.values()))} if boundary else {}
    free = (f"{name}.capacitance", *(f"{link}.conductance" for link in links))
    grow = _adding(
        "a common mass",
        free,
        nodes={name: Node({"capacitance": _amount(held, "J/K", name)})},
        conductors={c: Conductor("conduction", (end, name), {"conductance": _amount(g, "W/K", c)}) for c, (end, g) in links.items()},
    )

    def make(request: Request) -> Request:
        """Return the request with the element that the candidate adds."""
        return _started(grow(request), name, [c for p in places for c in p.channels])

    def judge(values: Any) -> tuple[str, bool]:
        """Return what the fitted element is, in words, and whether its size is possible."""
        most = sum(p.capacity for p in places)
        return f"{short(values[free[0]].value, 3)} J/K", SIZES["large mass"].allows(values[free[0]].value / most)

    sizes = {free[0]: SIZES["large mass"].at(held / 3.0)}
    sizes |= {f"{link}.conductance": SIZES["path"].at(g) for link, (_, g) in links.items()}
    starts = tuple({free[0]: share * held} for share in (0.3, 1.0, 5.0))
    nodes = ", ".join(f"'{p.node}'" for p in places)
    return MissingElement(CodedText(f"a mass that carries {nodes}", "element.common-mass"), make(request), judge, make, 1, sizes, starts)


def _contact(request: Request, a: str, b: str, size: float) -> MissingElement:
    """Return a contact between two nodes; `size` is the conductance from which its fit begins. [W/K]"""
    name = _free_name(request, f"{_word(a)}_to_{_word(b)}")
    free = f"{name}.conductance"
    make = _adding("a contact", (free,), conductors={name: Conductor("conduction", (a, b), {"conductance": _amount(size, "W/K", name)})})

    def judge(values: Any) -> tuple[str, bool]:
        """Return what the fitted element is, in words, and whether its size is possible."""
        return f"{short(values[free].value, 3)} W/K", True

    sizes = {free: SIZES["contact"].at(size / START_SHARE)}
    return MissingElement(
        CodedText(f"a contact between '{a}' and '{b}'", "element.contact"), make(request), judge, make, sizes=sizes, additive=True
    )


def _one_way(request: Request, place: _Place, other: str, words: str) -> MissingElement:
    """Return a coupling that carries heat only from a part to `other`, as warm air rises: Q = G dT for dT > 1 K, none for dT < 0. [W]

    G begins with `START_SHARE` times what the part loses already. [W/K]
    """
    name = _free_name(request, f"{place.word}_outward_{_word(other)}")
    free = f"{name}.scale"
    size = START_SHARE * (place.loss or 1.0)
    # over 1 K about equal temperatures the table goes from nothing to its full conductance
    curve = Curve("difference", np.array([0.0, 1.0]), np.array([0.0, 1.0]))
    make = _adding(
        "a coupling in one direction",
        (free,),
        conductors={
            name: Conductor("table", (place.node, other), {"scale": Parameter.read({"value": size, "min": 1e-9}, name)}, curve=curve)
        },
    )

    def judge(values: Any) -> tuple[str, bool]:
        """Return what the fitted element is, in words, and whether its size is possible."""
        return f"{short(values[free].value, 3)} W/K more from '{place.node}' than towards it", True

    name, sizes = (
        CodedText(f"a coupling of '{place.node}' and {words} that depends on direction", "element.one-direction"),
        {free: SIZES["contact"].at(size / START_SHARE)},
    )
    return MissingElement(name, make(request), judge, make, sizes=sizes, additive=True)


def _wrong_clocks(request: Request) -> Iterator[MissingElement]:
    """Yield wrong offsets of joined logs, of one instrument in all records together: about the stated one, and whole hours beside it."""
    for channels in dict.fromkeys(c.channels for r in request.records for c in r.stated_clocks):
        for hours in WRONG_HOURS:
            clocks = [(r, c) for r in request.records for c in r.stated_clocks if c.channels == channels]
            shortest = min(c.times[1] - c.times[0] for _, c in clocks)
            if HOUR * abs(hours) + MAX_CLOCK_ERROR < MAX_CLOCK_SHARE * shortest or not hours:
                yield _wrong_clock(request, channels, HOUR * hours, min(MAX_CLOCK_ERROR, MAX_CLOCK_SHARE * shortest))


def _wrong_clock(request: Request, channels: tuple[str, ...], zone: float, far: float) -> MissingElement:
    """Return the offset of one instrument's clock left to the fit, up to `far` about what was stated and `zone` more. [s]"""

    def make(request: Request) -> Request:
        """Return the request with the clock of the instrument open."""
        records = tuple(
            r.with_open_clock(channels, (zone - far, zone + far)) if any(c.channels == channels for c in r.stated_clocks) else r
            for r in request.records
        )
        return replace(request, records=records, name=f"{request.name or request.model.title} with another clock")

    made = make(request)
    offsets = {f"{r.name}: {c.offset_is}{clock_suffix(r, c)}": c.at[0] for r in made.records for c in r.clocks if c.channels == channels}
    spread = SIZES["clock"].spread
    sizes = {n: SizedValue(at + zone, spread / abs(at + zone)) if at + zone else SizedValue(0.0, spread) for n, at in offsets.items()}

    def judge(values: Any) -> tuple[str, bool]:
        """Return the offsets that were found, in words, and that they are possible."""
        offsets_in_words = [f"{short(values[n].value)} +- {short(values[n].error)} s for {at:g} s" for n, at in offsets.items()]
        line = "To use it, state it as the offset of that log, or give offset as a range"
        return f"{' and '.join(offsets_in_words)}. {line}", True

    hours = f" by {zone / HOUR:+g} h, as of another time zone" if zone else ""
    starts = tuple({n: at + zone + shift for n, at in offsets.items()} for shift in (0.0, -0.5 * far, 0.5 * far))
    name = CodedText(f"a wrong offset of the log of {quoted(channels)}{hours}", "element.wrong-clock")
    return MissingElement(name, made, judge, make, sizes=sizes, starts=starts, chosen=int(bool(zone)))


def _delays(request: Request) -> Iterator[MissingElement]:
    """Yield commands and powers that act later than they are logged, by one to eight samples."""
    driven = [n for r in request.records for n, c in r.channels.items() if c.role in ("command", "load")]
    if not driven or not all(r.times.size > 20 for r in request.records):
        return
    step = request.records[0].step

    def later(delay: float) -> Callable[[Request], Request]:
        """Return what delays the driven channels by a time. [s]"""

        def make(request: Request) -> Request:
            """Return the request with the element that the candidate adds."""
            records = [
                r.delayed(delay, driven_channels) if (driven_channels := [n for n in driven if n in r.channels]) else r
                for r in request.records
            ]
            return replace(request, records=tuple(records), name=f"{request.name or request.model.title} with a delay")

        return make

    for count in (1, 3, 8):
        make, delay = later(count * step), count * step

        def judge(values: Any, delay: float = delay) -> tuple[str, bool]:
            """Return what the fitted element is, in words, and whether its size is possible."""
            line = f"prepare = [{{ delay = {{ by = ['0 [s]', '{short(2.0 * delay, 3)} [s]'] }} }}]"
            return f"{short(delay, 3)} s. To fit the delay, run `thermid improve`, or write into the record: {line}", True

        yield MissingElement(
            CodedText(f"commands that act {short(delay, 3)} s late", "element.late-commands"), make(request), judge, make, delay=delay
        )


def _steeper_convection(request: Request, place: _Place) -> MissingElement:
    """Return natural convection to the boundary of a place, h = c (dT / 1 K)^(1/4), c fitted. [W/(m^2 K)]"""
    name, area = _free_name(request, f"{place.word}_steeper_convection"), place.area or 1.0
    size = (START_SHARE * place.loss or 0.01) / (area * place.rise**0.25)
    fields = {
        "htc.coefficient": _amount(size, "W/(m^2 K)", name),
        "htc.exponent": Parameter.read("0.25", name),
        "area": Parameter.read(f"{area!r} [m^2]", name),
    }
    free = f"{name}.htc.coefficient"
    make = _adding("h that grows", (free,), conductors={name: Conductor("convection", (place.node, place.boundary), fields)})

    def judge(values: Any) -> tuple[str, bool]:
        """Return what the fitted element is, in words, and whether its size is possible."""
        c = values[free].value
        share = f"{short(c * area * place.rise**0.25, 3)} W/K of it at a rise of {short(place.rise, 3)} K"
        return f"{short(c, 3)} W/(m^2 K) (dT / 1 K)^(1/4), {share}", not place.area or SIZES["convection"].allows(c)

    sizes = {free: _law(place, "convection", area * place.rise**0.25)}
    name = CodedText(f"a coefficient at '{place.node}' that grows with the difference (dT^(1/4))", "element.natural-convection")
    return MissingElement(name, make(request), judge, make, sizes=sizes, additive=True, bends=True)


def _law(place: _Place, kind: str, strength: float) -> SizedValue:
    """Return the prior of a law of a surface: that of its kind where the area is known, else a part of what the part loses.

    `strength` is the conductance of a size of one. [W/K]
    """
    return SIZES[kind].at() if place.area else SIZES["law"].at((place.loss or 0.1) / strength)


def _radiation(request: Request, place: _Place) -> MissingElement:
    """Return radiation to the boundary of a place with a fitted exchange factor; over 1 m^2 where no area is stated."""
    name, area = _free_name(request, f"{place.word}_radiated"), place.area or 1.0
    start = min(max(START_SHARE * place.loss / (6.0 * area), 1e-6), 1.0)
    fields = {
        "exchange_factor": Parameter.read({"value": f"{start!r}", "min": 1e-6}, name),
        "area": Parameter.read(f"{area!r} [m^2]", name),
    }
    free = f"{name}.exchange_factor"
    make = _adding("radiation", (free,), conductors={name: Conductor("radiation", (place.node, place.boundary), fields)})

    def judge(values: Any) -> tuple[str, bool]:
        """Return what the fitted element is, in words, and whether its size is possible."""
        e = values[free].value
        possible = SIZES["emissivity"].allows(e) if place.area else e > 0.0
        return f"an emissivity of {short(e)} over {short(1e4 * area, 3)} cm^2", possible

    name, sizes = (
        CodedText(f"radiation of '{place.node}' to '{place.boundary}'", "element.radiation"),
        {free: _law(place, "emissivity", 6.0 * area)},
    )
    return MissingElement(name, make(request), judge, make, sizes=sizes, additive=True, bends=True)


def _settling(structure: Fitted, place: _Place) -> Iterator[MissingElement]:
    """Yield a power P(t) = a exp(-(t - begin) / tau) [W] more from `begin`, when a load comes on; none where records differ in when.

    tau is each share of `SETTLING_PACES` of the time that the shortest record has left, from `SLOWEST_SAMPLES` sampling intervals on: what
    is faster is the instant of a change between two samples. a starts at a thousandth of the load's step [W].
    """
    step_on = first_step(structure.experiments, place.load) if place.load else None
    if step_on is None or f"{_word(place.load)}_settling" in structure.request.model.loads:
        return
    begin, power = step_on
    name = _free_name(structure.request, f"{_word(place.load)}_settling")
    rest = min(float(e.scenario.seconds) for e in structure.experiments) - begin
    slow = SLOWEST_SAMPLES * max(r.step for r in structure.request.records)  # what is faster is the instant of a change between two samples
    for share in (s for s in SETTLING_PACES if s * rest >= slow):
        course = PowerCourse(name, place.node, "decay", share * rest, max(1e-3 * power, 1e-5), begin=begin)

        def make(request: Request, course: PowerCourse = course) -> Request:
            """Return the request with the element that the candidate adds."""
            return course.within(replace(request, model=laid_open(request.model)))

        def judge(values: Any, course: PowerCourse = course) -> tuple[str, bool]:
            """Return what the fitted element is, in words, and whether its size is possible."""
            more = values[f"{course.name}.power"].value
            return f"{course.words(more)}, {short(100 * more / power)} % of its step", SIZES["settling"].allows(more / power)

        title, sizes = (
            CodedText(f"a power of '{place.load}' that settles", "element.settling-power"),
            {f"{name}.power": SIZES["settling"].at(power)},
        )
        yield MissingElement(title, make(structure.request), judge, make, sizes=sizes, additive=True, chosen=1, of_power=True)


def first_step(experiments: Sequence[Experiment], load: str) -> tuple[float, float] | None:
    """Return when a power comes on in all records [s], and its step [W]; None where it never does, or not at one time in all of them."""
    steps = [_comes_on(e, load) for e in experiments]
    if any(f is None for f in steps):
        return None
    begins, powers = zip(*(f for f in steps if f is not None), strict=True)
    if np.ptp(begins) > 2.0 * max(e.record.step for e in experiments):
        return None
    return float(np.median(begins)), float(np.median(powers))


def _may_grow(request: Request, load: str) -> bool:
    """Whether nothing says yet how a power goes with temperature."""
    return load not in request.model.loads or "temperature_coefficient" not in request.model.loads[load].fields


def _is_plainly_logged(request: Request, load: str) -> bool:
    """Whether every record logs a power by one channel without gain or accuracy, and the deck gives it no other law."""
    heat_load = request.model.loads.get(load)
    if heat_load is None or set(heat_load.fields) != {"power"} or heat_load.curve is not None or heat_load.cycle is not None:
        return False
    channels_of_records = [[c for c in r.channels.values() if c.role == "load" and c.target == load] for r in request.records]
    return all(len(several) == 1 and not (several[0].gain or several[0].accuracy or several[0].common) for several in channels_of_records)


def _growing_as_logged(structure: Fitted, place: _Place) -> MissingElement:
    """Return the logged power times 1 + a (T - T_0), a fitted, T_0 the mean first reading of its node."""
    load, free = place.load, f"{place.load}.temperature_coefficient"
    first = [float(o.measured[0]) for e in structure.experiments for o in e.observations if o.measured.size and o.seat == place.node]
    cold = float(np.mean(first)) if first else DEFAULT_COLD_TEMPERATURE
    fields = {
        "power": Parameter.read("1 [W]", load),
        "temperature_coefficient": Parameter.read(
            {"value": "0.0001 [1/K]", "min": "1e-9 [1/K]", "max": f"{1.5 * SIZES['growth'].high!r} [1/K]"}, load
        ),
        "reference_temperature": Parameter.read(f"{cold!r} [K]", load),
    }

    def make(request: Request) -> Request:
        """Return the request with the element that the candidate adds."""
        model: Model = laid_open(request.model)
        model = replace(model, loads={**model.loads, load: replace(model.loads[load], fields=fields)})
        records = tuple(
            r.with_channels(*(replace(c, role="command") for c in r.channels.values() if c.role == "load" and c.target == load))
            for r in request.records
        )
        free_before = tuple(p for p in request.free if request.model.canonical(p) != f"{load}.power")
        title = f"{request.name or model.title} with power that grows"
        return replace(request, model=model, records=records, free=(*free_before, free), name=title)

    def judge(values: Any) -> tuple[str, bool]:
        """Return what the fitted element is, in words, and whether its size is possible."""
        growth = values[free].value
        return f"{short(100 * growth)} % of the power per kelvin", SIZES["growth"].allows(growth)

    name, sizes = CodedText(f"a power of '{load}' that grows with temperature", "element.growing-power"), {free: SIZES["growth"].at()}
    return MissingElement(name, make(structure.request), judge, make, sizes=sizes, additive=True, of_power=True)


def _comes_on(e: Experiment, load: str) -> tuple[float, float] | None:
    """Return when a power comes on in a record [s], and its step [W]; None where it never does, or a command makes it."""
    if load in e.scenario.gains:
        return None
    power = float(e.network.flat.parameters.evaluate({}).get(f"{load}.power", 0.0))
    course, scale = e.scenario.loads.get(load), 1.0
    if load in e.scenario.commands:
        course, scale = e.scenario.commands[load], power
    if course is None:
        return (0.0, power) if power > 0.0 else None
    watts = scale * np.asarray(course.at(e.times))
    high = float(watts.max())
    return (float(e.times[np.argmax(watts > 0.5 * high)]), high) if high > 0.0 else None


def _growing_power(structure: Fitted, place: _Place) -> MissingElement:
    """Return a load that adds P_1 (T - 20 degC) / 1 K, P_1 fitted, or the law of `_growing_as_logged` where the power is logged."""
    if _is_plainly_logged(structure.request, place.load):
        return _growing_as_logged(structure, place)
    request = structure.request
    name = _free_name(request, f"{place.word}_growing_power")
    start = max(1e-3 * abs(place.power), 1e-5)
    # P (1 + 1/K (T - T_ref)), with T_ref one kelvin above 20 degC, is P/K (T - 20 degC)
    fields = {
        "power": _amount(start, "W", name),
        "temperature_coefficient": Parameter.read("1 [1/K]", name),
        "reference_temperature": Parameter.read("21 [degC]", name),
    }
    free = f"{name}.power"
    make = _adding("power that grows", (free,), loads={name: HeatLoad(place.node, fields)})

    def judge(values: Any) -> tuple[str, bool]:
        """Return what the fitted element is, in words, and whether its size is possible."""
        growth = values[free].value
        share = growth / abs(place.power) if place.power else float("inf")
        return f"{short(1e3 * growth, 3)} mW/K, {short(100 * share)} % of the power per kelvin", SIZES["growth"].allows(share)

    name, sizes = (
        CodedText(f"a power of '{place.load}' that grows with temperature", "element.growing-power"),
        {free: SIZES["growth"].at(abs(place.power) or 1.0)},
    )
    return MissingElement(name, make(request), judge, make, sizes=sizes, additive=True, of_power=True)
