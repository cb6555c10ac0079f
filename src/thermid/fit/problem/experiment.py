"""A record meets a model: its channels become observations, boundary signals, powers and first temperatures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from thermid.errors import RecordError, nearest
from thermid.fit.problem.driven import Inputs, on_the_clock_of, signal_of
from thermid.fit.problem.sensor_parts import Seat, attached
from thermid.fit.problem.starts import HiddenStart, first_reading, hidden_starts, starts_of
from thermid.fit.problem.ticks import Ticks
from thermid.measure import Channel, Record
from thermid.measure.record.join import SecondClock
from thermid.measure.record.sensor import SensorPart
from thermid.memo import Memo
from thermid.model.tree.model import Model
from thermid.network.network import Network, compile_network
from thermid.simulation.scenarios.scenario import Scenario

Array = NDArray[np.float64]
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
    share : float               Independent samples that one sample is worth: below 1 where the noise is said to be correlated. [-]
    part : SensorPart or None   What else its sensor does.
    lag : str                   Path of the sensor's lag in the wiring; empty for none.
    """

    sensor: str
    node: str
    index: NDArray[np.int64]
    measured: Array
    noise: float | None
    accuracy: float | None
    weight: float = 1.0
    share: float = 1.0
    part: SensorPart | None = None
    seat: str = ""
    lag: str = ""

    def sigma(self, assumed: Mapping[str, float]) -> float:
        """Return the standard deviation that weighs the residuals: the noise, or what is assumed of the sensor, over the weight. [K]

        Noise that is said to be correlated counts as so much larger that the samples say of anything slow what they can say.
        """
        return (self.noise or assumed[self.sensor]) / self.weight / float(np.sqrt(self.share))

    @property
    def worth(self) -> float:
        """Independent samples that its samples are worth by what is said of its noise."""
        return self.index.size * self.share


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
    loose : tuple of str        Observed nodes whose start nothing gives but their own readings.
    hidden : dict               Node without a sensor -> its start, where nothing gives it and the log does not begin at rest.
    tips : dict                 Tip of a sensor -> the node on which it sits, at whose temperature it starts.
    ticks : Ticks or None       What was logged on a second clock that is known within a range only.
    noisy : dict                Logged boundary, or scale of a logged power -> standard deviation of one sample of it. [K, W]
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
    loose: tuple[str, ...] = ()
    tips: Mapping[str, str] = field(default_factory=dict)
    ticks: Ticks | None = None
    noisy: Mapping[str, float] = field(default_factory=dict)
    hidden: Mapping[str, HiddenStart] = field(default_factory=dict)
    memo: Memo = field(init=False, default_factory=Memo, compare=False, repr=False)

    @property
    def bare(self) -> Scenario:
        """The scenario as it holds for the model without its sensors."""
        return replace(self.scenario, initial={n: t for n, t in self.scenario.initial.items() if n not in self.tips})


def role_and_target(record: Record, channel: Channel, network: Network) -> tuple[str, str]:
    """Return role and canonical target of a channel."""
    target = channel.target or channel.name
    where = f"{record.name}, {channel.name}"
    canonical = network.flat.names.model.canonical(target)
    loads = [load.path for load in network.flat.loads]
    if channel.role in ("load", "command") or (channel.role == "auto" and canonical in loads):
        if canonical not in loads:
            raise RecordError(f"no load '{target}' in {network.title}.{nearest(canonical, loads)}", where)
        if channel.role == "auto" and channel.quantity != "power":
            # without a unit a column is read as degrees Celsius, and 4 W would become 277
            raise RecordError(
                f"'{target}' is a load of {network.title}, but the channel holds a {channel.quantity}. "
                f"Bind it with load = '{target}', or give its unit.",
                where,
            )
        return ("command" if channel.role == "command" else "load"), canonical
    path = network.find(target, where)
    if channel.role == "prescribed" and path in network.flat.names.boundaries:
        raise RecordError(f"'{target}' is a boundary of {network.title}, so it is given anyway. Bind the channel with boundary.", where)
    role = "boundary" if path in network.boundaries else "node"
    if channel.role not in ("auto", role, "prescribed"):
        raise RecordError(f"'{target}' is a {role} of {network.title}, not a {channel.role}.", where)
    if channel.quantity != "temperature":
        raise RecordError(
            f"'{target}' is a {role} of {network.title}, but the channel holds a {channel.quantity}. Bind it to a load.", where
        )
    return role, path


def meet(
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
    errors : dict           Channel -> constant error of a logged boundary (added to it [K]) or power (a factor); where it is given, even
                            empty, none is looked for.

    Raises
    ------
    RecordError   When a channel is bound to nothing, or no channel observes a node.
    """
    base = on_the_clock_of(record, scenario or Scenario(record.name))
    prescribed = [c.target or c.name for c in record.channels.values() if c.role == "prescribed"]
    whole, seats = attached(model, record)
    network = compile_network(whole, media=base.media(), prescribed=(*base.prescribed, *prescribed))
    second = record.second
    zero, last = (float(record.times[0]), float(record.times[-1])) if second is None else second.times
    given = {network.find(k): v for k, v in base.boundaries.items()}
    inputs = Inputs(given, dict(base.loads), dict(base.commands), dict(base.gains))
    observed: list[tuple[Channel, str]] = []
    driven: dict[str, str] = {}
    noisy: dict[str, float] = {}
    for channel in record.channels.values():
        role, path = role_and_target(record, channel, network)
        if role == "node":
            _timed(channel, record)
            observed.append((channel, path))
        else:
            _bare(channel, role, record)
            driven[channel.name] = path
            if role != "command" and not channel.gain and (noise := _noise(channel)):
                noisy[path if role == "boundary" else SCALE + path] = noise
            inputs.take(channel, role, path, signal_of(record, channel.name, zero, held=role != "boundary"), errors)
    if not observed:
        raise RecordError(f"no channel observes a node of {network.title}; there is nothing to compare.", record.name)
    grid = np.flatnonzero(np.any([c.valid for c, _ in observed], axis=0))
    times = record.times[grid] - zero
    observations = tuple(
        _observation(c, seats.get(c.name, Seat(path, path)), grid, times, (weights or {}).get(c.name, 1.0)) for c, path in observed
    )
    first = {o.seat: first_reading(record, o.sensor, window) for o in observations}
    start, initial, readings, loose = starts_of(record, base, network, first, window)
    tips = {o.node: o.seat for o in observations if o.node != o.seat}
    initial |= {tip: initial[seat] for tip, seat in tips.items() if seat in initial and tip not in initial}
    duration = last - zero
    made = replace(
        base,
        title=record.name,
        boundaries=inputs.boundaries,
        loads=inputs.loads,
        commands=inputs.commands,
        gains=inputs.gains,
        start=start,
        initial=initial,
        duration=duration,
    )
    hidden: dict[str, HiddenStart] = {}
    if base.start == "":
        by_place = {path: record.channels[name] for name, path in driven.items()} | {
            o.seat: record.channels[o.sensor] for o in observations
        }
        hidden = hidden_starts(made, network, first, by_place, tuple(tips))
        made = replace(made, initial={**made.initial, **{n: h.mean for n, h in hidden.items()}})
    ticks = None if second is None else _ticks(second, zero, driven, inputs)
    return Experiment(record, model, network, made, times, observations, inputs.shared, readings, loose, tips, ticks, noisy, hidden)


def _ticks(second: SecondClock, zero: float, driven: Mapping[str, str], inputs: Inputs) -> Ticks:
    """Return which inputs follow the clock that the fit has yet to find."""
    tables = (("boundaries", inputs.boundaries), ("loads", inputs.loads), ("commands", inputs.commands))
    followed = tuple((name, p) for c, p in driven.items() if c in second.channels for name, held in tables if p in held)
    return Ticks(second, followed, zero, second.at)


def _timed(channel: Channel, record: Record) -> None:
    """Refuse temperatures that are compared, but on a clock that the fit has yet to find."""
    if record.second is not None and channel.name in record.second.channels:
        raise RecordError(
            "its readings are compared with the model, but its clock is yet to be found; the log with the compared temperatures gives the "
            "time. Join the logs the other way round, or, where both hold such temperatures, find the clock with td.align first.",
            f"{record.name}, {channel.name}",
        )


def _bare(channel: Channel, role: str, record: Record) -> None:
    """Refuse what only a sensor on a node can be said to do."""
    part = channel.part
    if part is not None and (part.touches or part.gain_accuracy or part.correlation_time):
        what = "a lag, a heat capacity, leads, an error of its scale or a correlation of its noise"
        raise RecordError(
            f"its sensor is said to have {what}, but its readings drive a {role}, where these cannot be taken into account. "
            "Give it an accuracy that covers them.",
            f"{record.name}, {channel.name}",
        )


def _observation(channel: Channel, seat: Seat, grid: NDArray[np.int64], times: Array, weight: float) -> Observation:
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
    )


def _noise(channel: Channel) -> float | None:
    """Return the standard deviation of one sample: noise, and rounding to steps of the sensor, a step over the root of 12. [K, W]"""
    if channel.noise is None or channel.resolution is None:
        return channel.noise
    return float(np.hypot(channel.noise, channel.resolution / np.sqrt(12.0)))
