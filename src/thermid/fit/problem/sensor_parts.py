"""What a sensor adds to a model while it is fitted: a tip that lags, heat capacity, leads; and what is not known exactly of them."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from thermid.errors import NameNotFoundError, RecordError
from thermid.fit.problem.unknowns import Prior, Target, Unknown
from thermid.measure import Channel, Record
from thermid.measure.record.sensor import SensorPart
from thermid.model.deck.modelfile import model_from_dict
from thermid.model.tree.model import Model, Submodel
from thermid.model.tree.names import Names

if TYPE_CHECKING:
    from thermid.fit.problem.experiment import Experiment
    from thermid.knowledge.values import FittedValue


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
        seats[channel.name] = _seat(channel, node)
        model = _with_sensor(model, names, channel, node, f"{record.name}, {channel.name}")
    return model, seats


def at_their_seats(record: Record) -> Record:
    """Return a record whose sensors read their nodes themselves, as they do once nothing changes: no lag, no heat capacity; leads stay."""
    parts = {c: c.part for c in record.channels.values() if c.part is not None}
    made = [replace(c, part=replace(part, lag=0.0, lag_accuracy=0.0, capacitance=0.0)) for c, part in parts.items()]
    return record.with_channels(*made) if made else record


def _named(channel: Channel) -> str:
    return f"sensor_{re.sub(r'[^0-9A-Za-z_]', '_', channel.name)}"


def _seat(channel: Channel, node: str) -> Seat:
    assert channel.part is not None
    if not (channel.part.lag or channel.part.capacitance):
        return Seat(node, node)
    return Seat(node, f"{_named(channel)}.tip", f"{_named(channel)}.lag")


def _with_sensor(model: Model, names: Names, channel: Channel, node: str, where: str) -> Model:
    part = channel.part
    assert part is not None
    bind = {"seat": node}
    if part.lead_conductance:
        try:
            bind["far"] = names.find(part.lead_to, f"{where}, lead.to")
        except NameNotFoundError as error:
            raise RecordError(f"its leads end at '{part.lead_to}', which the model does not have. {error.message}", where) from None
    inner = dict(model.submodels)
    for path in bind.values():
        head, _, rest = path.partition(".")
        if rest and head in inner and rest not in inner[head].model.offers:
            inner[head] = replace(inner[head], model=replace(inner[head].model, offers=(*inner[head].model.offers, rest)))
    own = sensor_model(part)
    return replace(model, submodels={**inner, _named(channel): Submodel(own, bind, own.identity())})


def instruments(experiments: Sequence[Experiment]) -> list[Unknown]:
    """Return one unknown per scale and per lag that is not known exactly, acting in every record that its sensor reads.

    Parameters
    ----------
    experiments : sequence  The records, bound to the model.
    """
    found: dict[str, tuple[SensorPart, list[Target]]] = {}
    for i, experiment in enumerate(experiments):
        for o in experiment.observations:
            if o.part is not None and o.part.gain_accuracy:
                found.setdefault(gain_of(o.sensor), (o.part, []))[1].append(Target(i, f"reading.{o.sensor}"))
            if o.part is not None and o.part.lag_accuracy and o.lag:
                found.setdefault(lag_of(o.sensor), (o.part, []))[1].append(Target(i, o.lag))
    out = []
    for name, (part, targets) in found.items():
        scale = targets[0].name.startswith("reading.")
        mean, sd = (0.0, part.gain_accuracy) if scale else (part.lag, part.lag_accuracy)
        prior = Prior(mean, sd) if scale else Prior(math.log(mean), sd / mean)
        out.append(Unknown(name, "instrument", tuple(targets), mean, log=not scale, prior=prior, unit="1" if scale else "s"))
    return out


def as_found(record: Record, values: Mapping[str, FittedValue], bias: Mapping[str, float]) -> Record:
    """Return a record whose sensors have the scales and lags that a fit found, its readings corrected by the scales.

    Parameters
    ----------
    record : Record     A log that the fit has not seen.
    values : dict       Name -> FittedValue, those of `gain_of` and `lag_of` among them.
    bias : dict         Sensor -> constant error. [K]
    """
    made = []
    for channel in record.channels.values():
        part, readings = channel.part, channel.values
        if part is None:
            continue
        if (scale := values.get(gain_of(channel.name))) is not None:
            true = (readings - bias.get(channel.name, 0.0) + scale.value * part.gain_about) / (1.0 + scale.value)
            readings = readings - scale.value * (true - part.gain_about)
        lag = values.get(lag_of(channel.name))
        known = replace(part, gain_accuracy=0.0, lag_accuracy=0.0, lag=part.lag if lag is None else lag.value)
        made.append(replace(channel, values=readings, part=known))
    return record.with_channels(*made) if made else record
