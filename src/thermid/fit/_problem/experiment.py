"""A record bound to a model: its channels become observations, boundary signals, powers and first temperatures."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from thermid.base.errors import NameNotFoundError, RecordError, ThermidError, refuse_unknown
from thermid.base.units import Array, Kelvin, Memo, Stamp
from thermid.measure.records import Channel, Record, SecondClock, SensorPart
from thermid.model.tree import Constant, Model, Names, Signal, Submodel, TableSignal, model_from_dict
from thermid.simulation.runs import Engine, Jump, Network, Scenario, Wiring, compile_network
from thermid.values.store import FittedValue

STEPPED = ("loads", "commands", "schedule")
"""Tables of a scenario whose signals may change by steps at instants that a fit looks for."""
DRIVEN = ("loads", "commands", "gains", "schedule")
"""Tables of a scenario that channels lie over, beside its boundaries."""


@dataclass
class Inputs:
    """What the channels of a record drive, on top of what the scenario gives; see `Experiment` for what is noted of them.

    `tables` are those of a scenario: boundaries, loads, commands, gains, schedule; `driven` is channel -> path; `metered` are
    the loads whose power was logged.
    """

    tables: dict[str, Any]
    shared: dict[str, tuple[str, float]] = field(default_factory=dict)
    driven: dict[str, str] = field(default_factory=dict)
    metered: list[str] = field(default_factory=list)
    noisy: dict[str, InputNoise] = field(default_factory=dict)
    means: dict[str, float] = field(default_factory=dict)

    def take(self, channel: Channel, role: str, path: str, signal: Signal, errors: Mapping[str, float] | None) -> None:
        """Lay the signal of a channel over a boundary, load or parameter, its constant error taken off where it is known; note it."""
        self.driven[channel.name] = path
        if channel.gain:
            self.tables["gains"][path] = channel.gain
        if role in ("command", "schedule"):
            self.tables["commands" if role == "command" else role][path] = signal
            return
        # mean power weighted by itself, so that pauses do not count; one that is always off has no error
        watts = np.abs(signal.levels)
        free, power = (path, 1.0) if role == "boundary" else (SCALE + path, float(watts @ watts) / (float(watts.sum()) or 1.0))
        if (noise := _input_noise(channel)).any:
            self.noisy[free] = noise
        if channel.common and errors is None and power > 0.0:
            self.means[free] = channel.common / power
        if role == "boundary":
            self.tables["boundaries"][path] = signal if errors is None else signal.raised(-errors.get(channel.name, 0.0))
        else:
            self.metered.append(path)
            self.tables["loads"][path] = signal if errors is None else signal.scaled(1.0 - errors.get(channel.name, 0.0))
        share = channel.part.gain_accuracy if channel.part else 0.0
        if (channel.accuracy or share) and power > 0.0:
            self.shared[channel.name] = (free, math.hypot((channel.accuracy or 0.0) / power, share))


def in_gas_of(record: Record, scenario: Scenario) -> Scenario:
    """Return a scenario in the gases that the record states.

    Raises
    ------
    RecordError   When both state one gas, and not alike.
    """
    for gas, state in record.environment.items():
        other = scenario.environment.get(gas, state)
        if other != state:
            raise RecordError(
                f"the record states {state}, but the scenario '{scenario.title}' states {other} (environment.{gas}). Leave one of them "
                "out.",
                f"record '{record.name}', environment.{gas}",
                code="value.excludes-another",
            )
    return scenario.with_(environment=record.environment) if record.environment else scenario


def on_the_clock_of(record: Record, scenario: Scenario) -> Scenario:
    """Return a scenario that counts from the record's first sample, though its start was cut off: columns of its own log, and stamps.

    Where both have stamps the scenario begins at the instant of that sample; a log without them begins where the scenario does.

    Raises
    ------
    RecordError   When the record's times are no longer those of its log, or only one of both names a time zone.
    """
    first = float(record.times[0])

    def is_of_log(course: Any) -> bool:
        """Return whether a course was read from this log."""
        return isinstance(course, TableSignal) and course.log is not None and course.log[0] == record.origin.sha256

    def moved(course: Any) -> Any:
        """Return a course that was read from this log on the record's new clock; any other as it is."""
        return course.shifted(first - course.log[1]) if is_of_log(course) else course

    columns = {place.partition(".")[2] for place, course in scenario.signals() if is_of_log(course)}
    stamped = isinstance(scenario.begins, Stamp) and record.origin.start is not None
    if record.moved and (columns or (stamped and record.zero is None)):
        has = f"a column of the log '{record.origin.file}'" if columns else "stamps"
        raise RecordError(
            f"the scenario has {has}, but the record has other times after this step ({record.moved}). Leave that step out, or give "
            f"{'the column in a separate log' if columns else 'the scenario times in seconds'}.",
            record.name,
            code="record.does-not-apply",
        )
    if stamped:
        began = record.zero
        if began is None or began.zoned != scenario.begins.zoned:
            why = "only one of the two names a time zone" if began else "that is not written as 2026-02-01 08:00"
            raise RecordError(
                f"the log begins at {record.origin.start} and the scenario's times are stamps too, but {why}. Give both with a zone "
                "or both without one, or the scenario's times in seconds from the log's first sample.",
                record.name,
                code="record.time-unclear",
            )
        scenario = scenario.begun(began.seconds + first - scenario.begins.seconds, columns)
    return scenario.mapped(moved)


def corrected(scenario: Scenario, fitted_values: Mapping[str, float]) -> Scenario:
    """Return the scenario of a record with the boundaries, starts and powers that a fit found.

    Parameters
    ----------
    scenario : Scenario     As the log gives it.
    fitted_values : dict    Name in the wiring -> value: of a boundary its temperature, or what is added where it varies in time [K], of
                            ``initial.<node>`` a temperature [K], of ``scale.<load>`` a factor on its power. Other names are ignored.
    """
    boundaries = {
        b: Constant(fitted_values[b]) if isinstance(s, Constant) else s.raised(fitted_values[b])
        for b, s in scenario.boundaries.items()
        if b in fitted_values
    }
    loads = {p: s.scaled(fitted_values[f"scale.{p}"]) for p, s in scenario.loads.items() if f"scale.{p}" in fitted_values}
    initial = {name.removeprefix("initial."): Kelvin(t) for name, t in fitted_values.items() if name.startswith("initial.")}
    return scenario.with_(boundaries=boundaries, loads=loads, initial=initial)


def signal_of(record: Record, channel: Channel, role: str, zero: float) -> Signal:
    """Return a channel of a record as a signal of a run, whose time counts from `zero` [s]."""
    table, samples = record.table(channel.name), channel.samples
    times = np.asarray(table.times) - zero
    if times.size == 1:
        return Constant(float(table.values[0]))
    held = samples != "average" and (channel.held if channel.interpolation else role != "boundary")
    # the unit of what a schedule drives is known to the model alone
    unit = channel.unit if role == "schedule" else ""
    return TableSignal(times, np.asarray(table.values), held, unit).with_details({"samples": samples}, record.name)


@dataclass(frozen=True)
class Seat:
    """A sensor that was attached to a model.

    Parameters
    ----------
    node : str      The node on which it sits.
    tip : str       The node that it reads: its own, or that on which it sits.
    lag : str       Path of its lag; empty where it has no tip of its own.
    """

    node: str
    tip: str
    lag: str = ""


def gain_of(sensor: str) -> str:
    """Return the name of the error of a sensor's scale among the unknowns."""
    return f"scale of {sensor}"


def lag_of(sensor: str) -> str:
    """Return the name of a sensor's lag among the unknowns."""
    return f"lag of {sensor}"


def sensor_model(part: SensorPart) -> Model:
    """Return the sensor as a model of the bench: its tip behind its lag, and its leads; every element is `test_only`.

    It needs `seat`, the node on which it sits, and `far`, where its leads end; `tip` is what it reads.
    """
    lags = bool(part.lag or part.capacitance)
    foot = "tip" if part.capacitance else "seat"  # without a heat capacity nothing says how well the tip is tied to its node
    deck: dict[str, object] = {"title": "sensor", "needs": ["seat", *(["far"] if part.lead_conductance else [])]}
    conductors: dict[str, object] = {}
    if lags:
        deck |= {
            "offers": ["tip"],
            "parameters": {
                name: f"{float(value)!r} [{unit}]" for (name, value), unit in zip(part.worth.items(), ("s", "J/K"), strict=True)
            },
            "nodes": {"tip": {"capacitance": "capacitance", "test_only": True}},
        }
        conductors["contact"] = {"kind": "conduction", "between": ["seat", "tip"], "resistance": "lag/capacitance", "test_only": True}
    if part.lead_conductance:
        lead = f"{float(part.lead_conductance)!r} [W/K]"
        conductors["lead"] = {"kind": "conduction", "between": [foot, "far"], "conductance": lead, "test_only": True}
    return model_from_dict(deck | {"conductors": conductors})


def attached(model: Model, record: Record) -> tuple[Model, dict[str, Seat]]:
    """Return the model with the sensors of a record on it, and channel -> where it sits; the same model where no sensor touches it.

    Raises
    ------
    RecordError   When the leads of a sensor end at no node of the model.
    """
    names: Names | None = None
    seats: dict[str, Seat] = {}
    for channel in record.channels.values():
        if channel.part is None or not channel.part.touches or channel.role not in ("auto", "node"):
            continue
        names = names or Names(model)
        node = names.find(channel.target or channel.name, f"{record.name}, {channel.name}")
        if node not in names.nodes:
            continue  # refused where the channel is bound
        if model.runner is not None:
            raise RecordError(
                "its sensor has a lag, a heat capacity or leads, which cannot be added to the equations of an FMU. Leave them out, or give "
                "it an accuracy that includes them.",
                f"{record.name}, {channel.name}",
                code="model.element-not-supported",
            )
        tip = f"{_named(channel)}.tip" if channel.part.lag or channel.part.capacitance else ""
        seats[channel.name] = Seat(node, tip or node, tip and f"{_named(channel)}.lag")
        model = _with_sensor(model, names, channel, node, f"{record.name}, {channel.name}")
    return model, seats


def _named(channel: Channel) -> str:
    """Return the name of the submodel that stands for a sensor and its leads."""
    return f"sensor_{re.sub(r'[^0-9A-Za-z_]', '_', channel.name)}"


def _with_sensor(model: Model, names: Names, channel: Channel, node: str, where: str) -> Model:
    """Return a model with the element of a sensor: tip, lag and leads."""
    part = channel.part
    assert part is not None
    binding = {"seat": node}
    if part.lead_conductance:
        try:
            binding["far"] = names.find(part.lead_to, f"{where}, lead.to")
        except NameNotFoundError as error:
            text = f"its leads end at '{part.lead_to}', which the model does not have. {error.message}"
            raise RecordError(text, where, code=error.code) from None
    inner = dict(model.submodels)
    for path in binding.values():
        head, _, rest = path.partition(".")
        if rest and head in inner and rest not in inner[head].model.offers:
            inner[head] = replace(inner[head], model=replace(inner[head].model, offers=(*inner[head].model.offers, rest)))
    model_of_sensor = sensor_model(part)
    return replace(model, submodels={**inner, _named(channel): Submodel(model_of_sensor, binding, model_of_sensor.identity())})


def as_found(record: Record, values: Mapping[str, FittedValue], bias: Mapping[str, float]) -> Record:
    """Return a record whose sensors have the scales and lags that a fit found, its readings corrected by the scales.

    Parameters
    ----------
    record : Record     A log that the fit has not seen.
    values : dict       Name -> FittedValue, those of `gain_of` and `lag_of` among them.
    bias : dict         Sensor -> constant error. [K]
    """
    channels = []
    for channel in record.channels.values():
        part, readings = channel.part, channel.values
        if part is None:
            continue
        if (scale := values.get(gain_of(channel.name))) is not None:
            true = (readings - bias.get(channel.name, 0.0) + scale.value * part.gain_about) / (1.0 + scale.value)
            readings = readings - scale.value * (true - part.gain_about)
        lag = values.get(lag_of(channel.name))
        exact_part = replace(part, gain_accuracy=0.0, lag_accuracy=0.0, lag=part.lag if lag is None else lag.value)
        channels.append(replace(channel, values=readings, part=exact_part))
    return record.with_channels(*channels) if channels else record


MEASURED = "measured"
"""`start = "measured"`: observed nodes start at their own readings, all others at the mean of these."""
UNSAID_NOISE = 0.1
"""Noise of a sensor where nobody said it, for what is worth a remark. [K]"""
UNKNOWN_START_SD = 10.0
"""Standard deviation of the start of a node that its own sensor reads: as good as nothing is known before the first reading. [K]"""
LEAST_NOISE = 1e-3
"""Scatter of neighbouring readings below which they show no noise. [K]"""
NOISE_RATIO = 1.5
"""Factor between stated noise and the noise that readings show, from which these refute it. [-]"""
ERROR_OF_SEEN_NOISE = 1.6
"""Standard error of the logarithm of the noise that white readings show, times the root of their number; 20 to 500 were simulated. [-]"""
CHANCE_DEVIATIONS = 3.0
"""Standard deviations, of that logarithm or of chi-square, that chance does not give. [-]"""
MAX_REST_DEVIATIONS = 4.0
"""Standard deviations of a difference of two readings up to which they count as one temperature: a log then begins at rest."""
MAX_BALANCE_STEPS = 20
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
        raise RecordError(
            f"channel '{name}' has no valid sample. Leave it out, or check why all its samples are masked.",
            record.name,
            code="record.nothing-there",
        )
    return float(np.median(channel.values[channel.valid][times <= times[0] + window]))


def first_readings(record: Record, observations: Sequence[Observation], window: float = 0.0) -> dict[str, dict[str, float]]:
    """Return observed node -> the sensors that read its start, with their first readings; the node starts at their mean. [K]

    They are those that have read when the first one reads again: one that begins later says where the node is by then. `window` [s] is
    that of a first reading, as of `first_reading`.

    Raises
    ------
    RecordError   When a channel has no valid sample.
    """
    several: dict[str, dict[str, Array]] = {}
    for o in observations:
        several.setdefault(o.seat, {})[o.sensor] = record.times[record.channel(o.sensor).valid][:2]
    out = {}
    for node, times in several.items():
        earliest = min(times.values(), key=lambda t: (t.size == 0, *t))
        begun = (sensor for sensor, t in times.items() if t.size == 0 or t[0] <= earliest[-1])
        out[node] = {sensor: first_reading(record, sensor, window) for sensor in begun}
    return out


def starts_of(
    record: Record, base: Scenario, network: Network, first: Mapping[str, float], begun: Mapping[str, Mapping[str, float]], window: float
) -> tuple[Any, dict[str, Any], dict[str, str], dict[str, tuple[str, ...]]]:
    """Return start, node -> initial temperature, node -> channel whose first reading it is, and node -> sensors that it starts at.

    Parameters
    ----------
    first : dict        Node -> first reading of its own sensors. [K]
    begun : dict        Node -> sensor -> first reading. [K]
    window : float      Of which a first reading is the mean. [s]
    """
    initial: dict[str, Any] = {}
    readings: dict[str, str] = {}

    def lay(node: str, value: Any) -> None:
        """Let a node start at a temperature, or at the first reading of a channel."""
        if isinstance(value, str) and value in record.channels:
            readings[node] = value
            initial[node] = Kelvin(first_reading(record, value, window))
        else:
            initial[node] = value

    runner = network.flat.names.model.runner  # of somebody else's program a start may follow from others
    if runner is not None and base.start == "":  # it begins where it does, but where a reading or the scenario says
        base = replace(base, initial={**{n: Kelvin(t) for n, t in runner.starts.items() if n not in first}, **base.initial})
    for raw, value in base.initial.items():
        lay(network.find(raw), value)
    if isinstance(base.start, str) and base.start in record.channels:
        for node in network.nodes:
            if node not in initial and _massive(network, node):
                lay(node, base.start)
        return Kelvin(first_reading(record, base.start, window)), initial, readings, {}
    if base.start not in ("", MEASURED):
        return base.start, initial, readings, {}
    loose = {n: tuple(s) for n, s in begun.items() if n not in initial and _massive(network, n) and (runner is None or n in runner.starts)}
    initial |= {n: Kelvin(first[n]) for n in loose}
    mean = Kelvin(np.mean(list(first.values())))
    return (mean if base.start == MEASURED or len(network.boundaries) != 1 else ""), initial, readings, loose


def _massive(network: Network, node: str) -> bool:
    """Whether a node stores heat."""
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
    engine = _unpowered(network, replace(scenario, start=Kelvin(np.mean(list(first.values())))))
    assembled = engine.wiring.assemble(gradients=False)
    nodes = list(assembled.reduced.nodes)
    loose = [k for k, n in enumerate(nodes) if n not in first and n not in scenario.initial]
    held = [k for k, n in enumerate(nodes) if n in first]
    temperatures, jacobian = _balance_temperatures(engine, loose)
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
        """Return the standard error of a first reading: noise and accuracy of its channel. [K]"""
        channel = channels.get(name)
        if channel is None:
            return 0.0
        return float(np.hypot(UNSAID_NOISE if channel.noise is None else channel.noise, channel.accuracy or 0.0))

    return all(
        abs(temperatures[a] - temperatures[b]) <= MAX_REST_DEVIATIONS * np.hypot(sd(a), sd(b)) for a, b in combinations(temperatures, 2)
    )


def _unpowered(network: Network, scenario: Scenario) -> Engine:
    """Return the run of a scenario with inputs as they begin and every power off; as they are where a load takes no power but its own."""
    scenario = scenario.mapped(lambda s: Constant(float(np.ravel(s.at(np.zeros(1)))[0])))
    off = {load.path: Constant(0.0) for load in network.flat.loads}
    try:
        return Engine(Wiring(network, replace(scenario, loads=off, commands={}, gains={})))
    except ThermidError:
        return Engine(Wiring(network, scenario))


def _balance_temperatures(engine: Engine, loose: Sequence[int]) -> tuple[Array, Array]:
    """Return temperatures (nodes,) [K] at which the loose nodes store no heat, and the Jacobian J (nodes, nodes) of the net heat q. [W/K]

    Newton's method with all other nodes fixed: T += J^-1 (-q) over the loose ones, within half the lowest and twice the highest start.
    """
    assembled = engine.wiring.assemble(gradients=False)
    temperatures = np.array(assembled.initial)
    low, high = 0.5 * float(temperatures.min()), 2.0 * float(temperatures.max())
    jacobian = np.zeros((temperatures.size,) * 2)
    for _ in range(MAX_BALANCE_STEPS):
        heat, jacobian, _ = engine.rhs(assembled, temperatures, 0.0)
        step = np.linalg.lstsq(jacobian[np.ix_(loose, loose)], -heat[loose], rcond=None)[0]
        temperatures[loose] = np.clip(temperatures[loose] + step, low, high)
        if np.abs(step).max(initial=0.0) < 1e-3:
            break
    return temperatures, jacobian


def _groups(jacobian: Array, loose: Sequence[int]) -> list[list[int]]:
    """Return the loose nodes (positions) in groups that exchange heat among themselves.

    Two nodes exchange heat where the `jacobian` (nodes, nodes) [W/K] has an entry other than zero between them, in either direction.
    """
    linked = (jacobian != 0.0) | (jacobian.T != 0.0)
    is_loose, out = np.zeros(jacobian.shape[0], dtype=bool), []
    is_loose[list(loose)] = True
    for first in loose:
        if not is_loose[first]:
            continue
        is_loose[first] = False
        group = [first]
        for k in group:  # grows as it is walked
            beside = np.flatnonzero(linked[k] & is_loose)
            is_loose[beside] = False
            group += beside.tolist()
        out.append(group)
    return out


SCALE = "scale."
"""Before the path of a load: the factor on its power."""


@dataclass(frozen=True, eq=False)
class Observation:
    """One measured temperature.

    Parameters
    ----------
    sensor : str                Name of the channel.
    node : str                  Canonical path of the node that it observes.
    seat : str                  That of the node on which its sensor sits: the same, unless the sensor lags or has a heat capacity.
    index : array (samples,)    Which output times have a valid sample.
    measured : array (samples,) [K]
    noise : float or None       Standard deviation of one sample. [K]
    accuracy : float or None    Standard deviation of its constant error. [K]
    weight : float              Below 1 where a model error, not the noise, sets how far a reading can be trusted. [-]
    effective_share : float     Independent samples that a sample is worth: below 1 where the noise is said to be correlated. [-]
    part : SensorPart or None   What else its sensor does.
    lag : str                   Path of the sensor's lag in the wiring; empty for none.
    step : float                Of the sensor, as stated or as its readings show it; zero for none. [K]
    blur : float or None        Stated noise of a reading before it is rounded. [K]
    """

    sensor: str
    node: str
    index: NDArray[np.int64]
    measured: Array
    noise: float | None
    accuracy: float | None
    weight: float
    effective_share: float
    part: SensorPart | None
    seat: str
    lag: str
    step: float = 0.0
    blur: float | None = None

    def sigma(self, assumed: Mapping[str, float]) -> float:
        """Return the standard deviation that weighs the residuals: the noise, or what is assumed of the sensor, over the weight. [K]

        Noise that is said to be correlated counts as so much larger that the samples say of anything slow what they can say.
        """
        return (self.noise or assumed[self.sensor]) / self.weight / float(np.sqrt(self.effective_share))

    def noise_shown(self, channel: Channel) -> float:
        """Return its noise, as neighbouring readings scatter where nobody states it or they refute it by more than chance. [K]

        Noise that is said to be slow is none that they could refute.
        """
        seen, chance = channel.noise_seen, CHANCE_DEVIATIONS * ERROR_OF_SEEN_NOISE / math.sqrt(channel.valid.sum())
        is_apart = seen > LEAST_NOISE and abs(math.log((self.noise or seen) / seen)) > max(math.log(NOISE_RATIO), chance)
        return seen if not self.noise or (is_apart and self.effective_share == 1.0) else self.noise

    @property
    def effective_samples(self) -> float:
        """Independent samples that its samples are worth by what is said of its noise."""
        return self.index.size * self.effective_share


@dataclass(frozen=True)
class InputNoise:
    """Noise of the samples of a logged boundary or power.

    Parameters
    ----------
    white : float       Standard deviation of one sample. [K, W]
    step : float        To which samples are rounded; zero for none. [K, W]
    stated : bool       Whether somebody said the white part; else it is found from the samples.
    """

    white: float
    step: float
    stated: bool

    @property
    def any(self) -> bool:
        """Whether there is any."""
        return self.white > 0.0 or self.step > 0.0


CLOCK = "clock"
"""Begin of the names in the wiring of what a fit has to find of a second clock, before its number and a place in `Ticks.at`."""
OFFSET, RATE = 0, 1
"""Places in `Ticks.at`."""


def clock_target(name: str) -> tuple[int, int] | None:
    """Return the number of a clock and a place in its `Ticks.at`, of a name that stands for them; None of any other name."""
    kind, _, numbers = name.partition(" ")
    if kind != CLOCK:
        return None
    number, place = map(int, numbers.split())
    return number, place


class Instant(NamedTuple):
    """When a held input changed: somewhere in the interval before the sample that shows it, in whose middle the scenario has it.

    `table` and `path` are those of the scenario, `row` that of the signal, `channel` and `stated` (whether somebody said that it was
    sampled) those of the log; the interval is in seconds.
    """

    table: str
    path: str
    row: int
    interval: float
    channel: str
    stated: bool

    @property
    def name(self) -> str:
        """Its name in the wiring, which says by which part of the interval it is later than the middle."""
        return f"{SWITCH} {self.row} of {self.path}"


@dataclass(frozen=True)
class Ticks:
    """What follows one of the clocks of an experiment that a fit has yet to find.

    Parameters
    ----------
    clock : SecondClock             Where its offset and rate are looked for.
    driven : tuple of (str, str)    Table of the scenario and path of every signal that was logged on it.
    zero : float                    Time on the record's own clock at which the experiment begins. [s]
    at : (offset, rate)             At which the scenario holds these signals. [s], [-]
    read : tuple of str             Channels on it whose readings are compared.
    samples : dict                  Path -> times of its table on the clock (samples,). [s]
    """

    clock: SecondClock
    driven: tuple[tuple[str, str], ...]
    zero: float
    at: tuple[float, float]
    read: tuple[str, ...] = ()
    samples: Mapping[str, Array] = field(default_factory=dict)

    def read_at(self, times: Array) -> Array:
        """Return when readings happened that the experiment holds at some times, as if its clock were right (times,). [s]"""
        ticks = (times + self.zero - self.clock.at[0]) / self.clock.at[1]
        return np.round(self.at[0] + self.at[1] * ticks - self.zero, 9)

    def moved(self, path: str, signal: Signal, at: tuple[float, float]) -> Signal:
        """Return the tabled signal of a path where a second clock stands at (offset [s], rate [-]); any other as it is."""
        if not isinstance(signal, TableSignal):
            return signal
        # to the nanosecond, so that rounding does not part an instant from the start of the run or from a reading
        return signal.retimed(lambda _: np.round(at[OFFSET] + at[RATE] * self.samples[path] - self.zero, 9))

    @property
    def shift(self) -> float:
        """Time to either side over which derivatives to instants, offset and rate are taken. [s]"""
        return SHIFT * self.clock.step * self.at[RATE]

    @property
    def span(self) -> float:
        """Longest time that the second clock shows while the first log lasts. [s]"""
        return max(abs(t - self.at[0]) for t in self.clock.times) / self.at[1]


SHIFT = 0.1
"""Shift over which differences are taken, in samples of the second log: smaller ones drown in the integrator's own error."""
SWITCH = "switch"
"""Begin of the names of instants in the wiring, and among the unknowns of a record."""
MAX_SWITCHES = 200
"""The largest changes of the powers of a record that have an instant of their own."""
MAX_JUMPS = 1000
"""Steps on a clock up to which a run gives what its offset does; of more it is found by differences."""
LAST_INSTANT = 0.499
"""The farthest from the middle of its interval that a change lies. [-]"""
MIN_SWITCHED, MIN_SWITCHED_NOISES = 0.05, 6.0
"""Of the largest power, and of the noise of one sample, what a change exceeds whose instant matters. [-]"""
BETWEEN_SAMPLES = (0.0, 24.0**-0.5), (0.0, 24.0**-0.5)
"""Mean and standard deviation of what all instants of a logger have in common, and of each beside it, in intervals from the middle: each
is anywhere in its interval as likely (1/12 is the sum of both variances), and half of that is a habit of who switches and logs."""
SOME_SAMPLE = (0.25, 0.25), (0.0, (0.5 / 3.0 - 0.125) ** 0.5)
"""The same of a logger of which nobody says whether it logs as it switches: half of all do, which is half an interval after the middle."""


@dataclass(frozen=True, eq=False)
class Experiment:
    """A record bound to a model.

    Parameters
    ----------
    record : Record             The prepared log.
    model : Model               Without the sensors of the log.
    network : Network           The model compiled for it, sensors that lag, store or lead heat on it.
    scenario : Scenario         What the log says was done; times count from its first sample.
    times : array (times,)      Times at which any sensor has a valid sample, from the first sample of the record. [s]
    observations : tuple        The measured temperatures.
    shared : dict               Channel -> (name in the wiring, sd in its unit): constant errors of logged boundaries and powers.
    readings : dict             Node or boundary -> channel whose first reading, less its constant error, stands for its temperature at the
                                start (of a boundary: throughout).
    loose : dict                Observed node whose start nothing gives but its own readings -> the sensors that read it at the start.
    hidden : dict               Node without a sensor -> its start, where nothing gives it and the log does not begin at rest.
    tips : dict                 Tip of a sensor -> the node on which it sits, at whose temperature it starts.
    ticks : tuple of Ticks      What was logged on clocks that are known within a range only, of each clock.
    instants : tuple            Changes of held inputs somewhere between two samples.
    noisy : dict                Logged boundary, or scale of a logged power -> noise of its samples.
    means : dict                The same -> standard deviation of an error that is one in all samples of this record. [K], [-]
    memo : Memo                 Benches, by what is free in them and where the second clock stands.
    """

    record: Record
    model: Model
    network: Network
    scenario: Scenario
    times: Array
    observations: tuple[Observation, ...]
    shared: Mapping[str, tuple[str, float]] = field(default_factory=dict)
    readings: Mapping[str, str] = field(default_factory=dict)
    loose: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    tips: Mapping[str, str] = field(default_factory=dict)
    ticks: tuple[Ticks, ...] = ()
    noisy: Mapping[str, InputNoise] = field(default_factory=dict)
    means: Mapping[str, float] = field(default_factory=dict)
    hidden: Mapping[str, HiddenStart] = field(default_factory=dict)
    instants: tuple[Instant, ...] = ()
    memo: Memo = field(init=False, default_factory=Memo, compare=False, repr=False)

    def first_readings(self, window: float = 0.0) -> dict[str, float]:
        """Return each sensor that reads the start of its node -> its first reading. [SI]"""
        return {sensor: value for read in first_readings(self.record, self.observations, window).values() for sensor, value in read.items()}

    @property
    def promptly(self) -> dict[str, tuple[Channel, TableSignal]]:
        """Load -> channel and signal of what counts from its samples, although nobody states that it was logged as it changed.

        None of an FMU's, and none whose load has a curve, a flux, a cycle or a control.
        """
        later = {n for ticks in self.ticks for n in ticks.clock.channels}
        channels = [c for n, c in self.record.channels.items() if c.held and c.prompt is None and n not in later]
        of_load = {self.network.flat.names.model.canonical(c.target or c.name): c for c in channels if c.samples != "average"}
        signals = {**self.scenario.commands, **self.scenario.loads}
        return {
            load.path: (of_load[load.path], signal)
            for load in self.network.flat.loads
            if not (self.model.runner or load.curve or load.flux or load.cycle or load.controls or "periodic.period" in load.fields)
            if load.path in of_load and isinstance(signal := signals.get(load.path), TableSignal) and signal.held
        }

    def on_clocks(self, at: Sequence[tuple[float, float]], steps_at: Sequence[tuple[float, float]]) -> Experiment:
        """Return the experiment with its unknown clocks where they stand otherwise, `Ticks.at` of each, for steps at `steps_at`."""
        tables = {name: dict(getattr(self.scenario, name)) for name in ("boundaries", *DRIVEN)}
        for ticks, there, steps in zip(self.ticks, at, steps_at, strict=True):
            for name, path in ticks.driven:
                signal = tables[name][path]
                tables[name][path] = ticks.moved(path, signal, steps if name in STEPPED and signal.held else there)
        moved = tuple(replace(ticks, at=there) for ticks, there in zip(self.ticks, at, strict=True))
        return replace(self, scenario=self.scenario.with_(**tables), ticks=moved)

    @property
    def jumps(self) -> dict[str, tuple[Jump, ...]]:
        """Name in the wiring -> the jumps of inputs that it moves: an instant its own, offset and rate of a clock all of its steps.

        A jump has the table, path and row of its input, and by how many seconds it moves per unit of the name: the interval before its
        sample of an instant, 1 of an offset, the sample's own time of a rate. Of a clock with more than `MAX_JUMPS` steps there are none.
        """
        rates = {n: ticks.at[RATE] for ticks in self.ticks for n in ticks.clock.channels}
        out: dict[str, tuple[Jump, ...]] = {
            x.name: (Jump(x.table, x.path, x.row, x.interval * rates.get(x.channel, 1.0)),) for x in self.instants
        }
        for k, ticks in enumerate(self.ticks):
            of_clock = [(n, p, getattr(self.scenario, n)[p]) for n, p in ticks.driven if n in STEPPED]
            tables = [(n, p, t) for n, p, t in of_clock if isinstance(t, TableSignal) and t.held]
            rows = [(n, p, int(r)) for n, p, t in tables for r in np.flatnonzero(np.diff(t.levels))]
            rows = rows if len(rows) <= MAX_JUMPS else []
            out[f"{CLOCK} {k} {OFFSET}"] = tuple(Jump(n, p, r + 1, 1.0) for n, p, r in rows)
            out[f"{CLOCK} {k} {RATE}"] = tuple(Jump(n, p, r + 1, float(ticks.samples[p][r + 1])) for n, p, r in rows)
        return out

    def changed_at(self, later: Mapping[str, float], scenario: Scenario | None = None) -> Scenario:
        """Return its scenario, or one of it with other values, with changes later than in the middle: `Instant.name` -> [intervals]."""
        whole = scenario or self.scenario
        tables = {name: dict(getattr(whole, name)) for name in STEPPED}
        for x in self.instants:
            (jump,) = self.jumps[x.name]
            tables[x.table][x.path] = tables[x.table][x.path].with_row_later(x.row, jump.later * later.get(x.name, 0.0))
        return whole.with_(**tables) if self.instants else whole

    @property
    def bare(self) -> Scenario:
        """The scenario as it holds for the model without its sensors."""
        return self._without_tips(self.scenario)

    def _without_tips(self, scenario: Scenario) -> Scenario:
        """Return a scenario without starts of sensors' tips."""
        return replace(scenario, initial={n: t for n, t in scenario.initial.items() if n not in self.tips})

    def as_fitted(self, model: Model, fitted_values: Mapping[str, float], sensors: bool = True) -> tuple[Model, Scenario]:
        """Return a model and the scenario of this record as a fit ran them.

        Parameters
        ----------
        model : Model       Without the sensors of the log.
        fitted_values : dict  Name in the wiring -> value, as in `corrected`, and the lags of sensors [s].
        sensors : bool      Whether sensors that touch the hardware are on the model, with their lags.
        """
        scenario = self.changed_at(fitted_values, corrected(self.scenario, fitted_values))
        driven = [b for b in self.network.boundaries if b not in self.network.flat.names.boundaries]
        if driven:
            undriven = {b: s for b, s in scenario.boundaries.items() if b not in driven}
            scenario = replace(scenario, boundaries=undriven, prescribed={b: scenario.boundaries[b] for b in driven})
        if not sensors:
            return model, self._without_tips(scenario)
        lags = {o.lag: f"{fitted_values[o.lag]!r} [s]" for o in self.observations if o.lag in fitted_values}
        return attached(model, self.record)[0].with_values(lags, "found by the fit"), scenario

    def wired(self, raw: str) -> str:
        """Return the name in the wiring of a boundary or of ``initial.<node>``."""
        head, _, node = raw.partition(".")
        return f"initial.{self.network.find(node)}" if head == "initial" and node else self.network.find(raw)

    @staticmethod
    def bind(
        model: Model,
        record: Record,
        scenario: Scenario | None = None,
        window: float = 0.0,
        weights: Mapping[str, float] | None = None,
        errors: Mapping[str, float] | None = None,
    ) -> Experiment:
        """Return a record bound to a model.

        Parameters
        ----------
        model : Model           The model.
        record : Record         The log; its channels are bound to nodes, boundaries, loads or commands by their role and target.
        scenario : Scenario     What the log does not say: unlogged boundaries, the start. Where a temperature is the name of a channel, its
                                first reading stands there; ``start = "measured"`` starts every observed node at its first reading.
        window : float          First readings are medians over this time. [s]
        weights : dict          Sensor -> weight of its residuals, 1 where none is given.
        errors : dict           Channel -> error of a logged boundary [K] or power [-], reading minus truth; if given, none is looked for.

        Raises
        ------
        RecordError   When a channel is bound to nothing, or no channel observes a node.
        """
        base = on_the_clock_of(record, in_gas_of(record, scenario or Scenario(record.name)))
        prescribed = [c.target or c.name for c in record.channels.values() if c.role == "prescribed"]
        whole, seats = attached(model, record)
        network = compile_network(whole, media=base.media(), prescribed=(*base.prescribed, *prescribed))
        zero, last = record.ends
        boundaries, weight = {network.find(k): v for k, v in base.boundaries.items()}, weights or {}
        inputs = Inputs({t: dict(getattr(base, t)) for t in DRIVEN} | {"boundaries": boundaries})
        observed: list[tuple[Channel, str]] = []
        for channel in record.channels.values():
            role, path = role_and_target(record, channel, network)
            if role == "node":
                observed.append((_read_within(channel, record), path))
            else:
                role = _driving(channel, role, record)
                inputs.take(channel, role, path, signal_of(record, channel, role, zero), errors)
        network = network.with_powers_alone(inputs.metered)
        if not observed:
            words = f"no channel observes a node of {network.title}, so no reading can be compared. Bind one with node = '...'."
            raise RecordError(words, record.name, code="record.does-not-apply")
        grid = np.flatnonzero(np.any([c.valid for c, _ in observed], axis=0))
        times = record.times[grid] - zero
        observations = tuple(_observation(c, seats.get(c.name, Seat(p, p)), grid, times, weight.get(c.name, 1.0)) for c, p in observed)
        begun = first_readings(record, observations, window)
        first = {node: float(np.mean(list(readings_of_node.values()))) for node, readings_of_node in begun.items()}
        start, initial, readings, loose = starts_of(record, base, network, first, begun, window)
        tips = {o.node: o.seat for o in observations if o.node != o.seat}
        initial |= {tip: initial[seat] for tip, seat in tips.items() if seat in initial and tip not in initial}
        instants = _instants(record, inputs) if model.runner is None else ()
        ticks = tuple(_ticks(clock, zero, inputs, tuple(c.name for c, _ in observed)) for clock in record.clocks)
        full = replace(
            base, title=record.name, **inputs.tables, start=start, initial=initial, duration=last - zero, metered=(*inputs.metered,)
        )
        hidden = _hidden_starts(full, network, first, record, inputs.driven, observations, tips) if base.start == "" else {}
        full = replace(full, initial={**full.initial, **{n: Kelvin(h.mean) for n, h in hidden.items()}})
        notes = (inputs.noisy, inputs.means, hidden, instants)
        return Experiment(record, model, network, full, times, observations, inputs.shared, readings, loose, tips, ticks, *notes)


def role_and_target(record: Record, channel: Channel, network: Network) -> tuple[str, str]:
    """Return role and canonical target of a channel."""
    target = channel.target or channel.name
    where = f"{record.name}, {channel.name}"
    canonical = network.flat.names.model.canonical(target)
    loads = [load.path for load in network.flat.loads]
    if channel.role == "schedule":
        return "schedule", network.flat.parameters.freeable(target, network.flat.names.model.canonical)
    if channel.role in ("load", "command") or (channel.role == "auto" and canonical in loads):
        refuse_unknown([canonical], loads, where, f"no load '{target}' in {network.title}.", RecordError)
        if channel.role == "auto" and channel.quantity != "power":
            # without a unit a column is read as degrees Celsius, and 4 W would become 277
            raise RecordError(
                f"'{target}' is a load of {network.title}, but the channel holds a {channel.quantity}. "
                f"Bind it with load = '{target}', or give its unit.",
                where,
                code="record.does-not-apply",
            )
        return ("command" if channel.role == "command" else "load"), canonical
    path = network.find(target, where)
    if channel.role == "prescribed" and path in network.flat.names.boundaries:
        raise RecordError(
            f"'{target}' is a boundary of {network.title}, so its temperature is given. Bind the channel with boundary = '{target}'.",
            where,
            code="record.does-not-apply",
        )
    role = "boundary" if path in network.boundaries else "node"
    if channel.role not in ("auto", role, "prescribed"):
        raise RecordError(f"'{target}' is a {role} of {network.title}, not a {channel.role}.", where, code="record.does-not-apply")
    if channel.quantity != "temperature":
        raise RecordError(
            f"'{target}' is a {role} of {network.title}, but the channel holds a {channel.quantity}. Bind it to a load.",
            where,
            code="record.does-not-apply",
        )
    return role, path


def _hidden_starts(
    bound_scenario: Scenario,
    network: Network,
    first: Mapping[str, float],
    record: Record,
    driven: Mapping[str, str],
    observations: Sequence[Observation],
    tips: Mapping[str, str],
) -> dict[str, HiddenStart]:
    """Return node -> start, of nodes without a sensor, from the channels of the record; empty where an FMU runs the model.

    Parameters
    ----------
    first : dict          Node -> its first reading. [K]
    driven : dict         Channel -> the boundary or load that it drives.
    tips : dict           Nodes that are tips of sensors, which are left out.
    """
    if network.flat.names.model.runner is not None:
        return {}
    by_place = {path: record.channels[name] for name, path in driven.items()} | {o.seat: record.channels[o.sensor] for o in observations}
    return hidden_starts(bound_scenario, network, first, by_place, tuple(tips))


def _instants(record: Record, inputs: Inputs) -> tuple[Instant, ...]:
    """Return the largest changes between samples of inputs, which are laid in the middles of their intervals.

    They are those of channels that were not logged as they changed, and those on another clock of which nobody does. Of all others of a
    power with n such steps dP in intervals h the energy is known to (sum (dP h)^2 / 12)^(1/2): an error of its mean.
    """
    later = {n for clock in record.clocks for n in clock.channels}
    sized: list[tuple[float, Instant]] = []
    steps: dict[Instant, float] = {}
    for name, path in inputs.driven.items():
        channel = record.channels[name]
        kind = "schedule" if channel.role == "schedule" else "loads" if path in inputs.tables["loads"] else "commands"
        table = inputs.tables[kind].get(path)
        sampled = channel.prompt is False or (channel.prompt is None and name in later and kind != "schedule")
        if not (sampled and channel.samples != "average" and isinstance(table, TableSignal) and table.held):
            continue
        # as logged: errors that a fit sized, and how a power was summed, change no order
        logged = float(np.abs(channel.values[channel.valid]).max()) / float(np.abs(table.levels).max() or 1.0)
        change = table.steps_above(MIN_SWITCHED, MIN_SWITCHED_NOISES * _input_noise(channel).white)
        for k in np.flatnonzero(change).tolist():
            instant = Instant(kind, path, k + 1, table.gaps(k + 1)[0], name, channel.prompt is False)
            steps[instant] = float(change[k])
            sized.append((float(f"{-abs(change[k]) * logged:.9g}"), instant))
        inputs.tables[kind][path] = table.changed_within()
    ordered = [instant for _, instant in sorted(sized)]
    energies: dict[tuple[str, str], float] = {}
    for x in (x for x in ordered[MAX_SWITCHES:] if x.table != "schedule"):
        energies[x.table, x.path] = energies.get((x.table, x.path), 0.0) + (steps[x] * x.interval) ** 2 / 12.0
    for (kind, path), square in energies.items():
        whole = inputs.tables[kind][path].mapped(np.abs)
        energy = whole.mean_over(*record.ends) * (record.ends[1] - record.ends[0])
        inputs.means[SCALE + path] = float(np.hypot(inputs.means.get(SCALE + path, 0.0), np.sqrt(square) / energy))
    return tuple(ordered[:MAX_SWITCHES])


def _ticks(second: SecondClock, zero: float, inputs: Inputs, observed: tuple[str, ...]) -> Ticks:
    """Return which inputs and which of the compared readings follow a clock that the fit has yet to find."""
    tables = [(name, held) for name, held in inputs.tables.items() if name != "gains"]
    followed = tuple((name, p) for c, p in inputs.driven.items() if c in second.channels for name, held in tables if p in held)
    samples = {
        p: (table.times + zero - second.at[OFFSET]) / second.at[RATE]
        for name, held in tables
        for n, p in followed
        if n == name and isinstance(table := held[p], TableSignal)
    }
    return Ticks(second, followed, zero, second.at, tuple(n for n in observed if n in second.channels), samples)


def _read_within(channel: Channel, record: Record) -> Channel:
    """Return a compared channel without readings that some offset of its clock puts outside of the record's own time.

    Raises
    ------
    RecordError   When none remains.
    """
    for clock in (c for c in record.clocks if channel.name in c.channels):
        first, last = clock.possible(record.times)
        outside = (first < record.ends[0]) | (last > record.ends[1])
        if not np.any(channel.valid & ~outside):
            raise RecordError(
                f"every reading may lie outside of the log that it is joined with, for offsets of {clock.offset[0]:g} .. "
                f"{clock.offset[1]:g} s. Give a narrower range.",
                f"{record.name}, {channel.name}",
                code="record.not-overlapping",
            )
        channel = channel.masked(outside, "outside of the other log at some offset of the clock")
    return channel


def _driving(channel: Channel, role: str, record: Record) -> str:
    """Return the role of an input, 'command' where its gain makes a power of it: the gain of a power is a share.

    Raises
    ------
    RecordError   When its sensor has what only one on a node can have.
    """
    part = channel.part
    if part is not None and (part.touches or (part.gain_accuracy and channel.quantity != "power") or part.correlation_time):
        what = "a lag, a heat capacity, leads, an error of its scale or a correlation of its noise"
        raise RecordError(
            f"its sensor has {what}, but its readings are the input of a {role}, where these cannot be modelled. Give it an accuracy "
            "that includes them instead.",
            f"{record.name}, {channel.name}",
            code="model.element-not-supported",
        )
    return "command" if channel.gain and channel.quantity != "power" else role


def _observation(channel: Channel, seat: Seat, grid: NDArray[np.int64], times: Array, weight: float) -> Observation:
    """Return the valid readings of a channel on the grid of an experiment, in SI, with weight and share of independent readings [-].

    Of noise with correlations exp(-|t| / time), n samples count as n tanh(step / (2 time)).

    Parameters
    ----------
    grid : array (instants,)    Positions of the instants in the channel.
    times : array (instants,)   [s]
    """
    index = np.flatnonzero(channel.valid[grid])
    part, share = channel.part, 1.0
    if part is not None and part.correlation_time and index.size > 1:
        # of noise with correlations exp(-|t| / time), n samples say of a mean what n tanh(step / 2 time) independent ones do
        share = float(np.tanh(0.5 * np.median(np.diff(times[index])) / part.correlation_time))
    return Observation(
        channel.name,
        seat.tip,
        index,
        channel.values[grid[index]],
        _noise(channel),
        channel.accuracy,
        weight,
        share,
        part,
        seat.node,
        seat.lag,
        channel.step,
        channel.noise,
    )


def _noise(channel: Channel) -> float | None:
    """Return the standard deviation of one sample: noise, and rounding to steps of the sensor, a step over the root of 12. [K]

    Steps that nobody stated count where the stated noise is too small to hold them.
    """
    if channel.noise is None:
        return None
    rounding = channel.step / np.sqrt(12.0)
    return float(np.hypot(channel.noise, rounding)) if channel.resolution is not None or rounding > channel.noise else channel.noise


def _input_noise(channel: Channel) -> InputNoise:
    """Return the noise of a logged boundary or power; see `Channel.white_noise` for one that nobody stated.

    A power has steps where they are stated; a boundary that never changes is one that was set.
    """
    moves = channel.quantity == "temperature" and float(np.ptp(channel.values[channel.valid])) > 0.0
    step = channel.step if moves or channel.resolution is not None else 0.0
    if channel.noise is not None:
        return InputNoise(channel.noise, step, True)
    return InputNoise(channel.white_noise, step, False)
