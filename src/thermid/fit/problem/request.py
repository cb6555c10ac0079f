"""What a fit is asked: model, records, what is free, what each record has for itself."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from thermid.errors import IdentificationError, ThermidError, nearest
from thermid.fit.problem.starts import first_reading
from thermid.knowledge.store import Store
from thermid.measure import Record
from thermid.model.laws.signal import Constant, literal
from thermid.model.tree.identity import local_identities
from thermid.model.tree.model import Model
from thermid.simulation.scenarios.scenario import Scenario
from thermid.simulation.solver.engine import Options
from thermid.units import TEMPERATURE

FITTING = Options(tolerance=1e-4, relative=1e-6, input_tolerance=1e-3)
"""A fit needs no more than a fraction of the noise of a sensor."""


@dataclass(frozen=True)
class LocalSpec:
    """A value that each record has for itself.

    Parameters
    ----------
    start : str     A temperature, or the name of a channel whose first reading stands for it.
    sd : float      Standard deviation of its prior about the start; infinite for none. [K]
    """

    start: str
    sd: float = math.inf

    @classmethod
    def read(cls, given: Any, where: str) -> LocalSpec:
        """Return it from a text or a table with `start` and `sd`."""
        table = given if isinstance(given, Mapping) else {"start": given}
        unknown = set(table) - {"start", "sd"}
        if unknown:
            raise IdentificationError(f"a local value has start and sd, not {', '.join(sorted(unknown))}.", where)
        if "start" not in table:
            raise IdentificationError("a local value needs a start.", where)
        sd = literal(table["sd"], "K", where) if "sd" in table else math.inf
        if not sd > 0:
            raise IdentificationError(f"the standard deviation {table['sd']} of a local value must be above zero.", where)
        return cls(str(table["start"]), sd)


@dataclass(frozen=True)
class Reading:
    """A temperature taken from a channel's first reading, less the sensor's constant error.

    Parameters
    ----------
    channel : str   The channel.
    offset : str    A parameter of the model [K] that is added; empty for none.
    """

    channel: str
    offset: str = ""

    @classmethod
    def read(cls, given: Any, where: str) -> Reading:
        """Return it from the name of a channel or a table with `channel` and `offset`."""
        table = given if isinstance(given, Mapping) else {"channel": given}
        unknown = set(table) - {"channel", "offset"}
        if unknown or "channel" not in table:
            raise IdentificationError("a reading has a channel, and an offset where one is needed.", where)
        return cls(str(table["channel"]), str(table.get("offset", "")))


@dataclass(frozen=True, eq=False)
class Request:
    """Everything that a fit is asked.

    Parameters
    ----------
    model : Model
    records : tuple of Record
    free : tuple of str             Parameter paths.
    scenarios : dict                Record name -> Scenario, for what the logs do not say; key ``*`` for all others.
    local : dict                    Boundary or ``initial.<node>`` -> LocalSpec.
    record_local : dict             Record name -> the same, in place of `local` where both name it.
    priors : dict                   Parameter path -> (mean, sd) as texts; an empty mean is the start, an sd in % is relative.
    store : Store                   What stages below know of the model's values; the model has them laid over it.
    prior : tuple of str            Those of its values that are free here too, with their covariance as prior.
    held_bias : dict                Sensor -> constant error that is not looked for. [K]
    held_errors : dict              Channel -> constant error of a logged boundary (added to it [K]) or power (a factor); where it is given,
                                    even empty, no constant error of any instrument is looked for.
    weights : dict                  Sensor -> weight of its residuals, 1 where none is given.
    untie : bool                    Whether all instances get values of their own; `Model.cut` does it for some.
    loss : str                      linear, soft_l1, huber or cauchy.
    knee : float                    Residual, in units of the noise, from which a robust loss bends.
    search : str                    auto, local, multistart, differential evolution or cma; see `searched`.
    window : float                  First readings are medians over this time. [s]
    name : str                      Name of the stage.
    readings : dict                 Boundary or ``initial.<node>`` -> Reading that stands there.
    seen : dict                     Checksum -> who used it, in the stages below.
    remarks : tuple of str          What a reader of the result must know before the fit has begun.
    fit_start : bool                Whether observed nodes' initial temperatures are looked for; else their first readings stand.
    options : Options               The integrator's.
    hand : Store or None            Values tuned by hand; nothing is fitted then.
    key : str                       Hash of everything that the result depends on; empty where nobody asked for it.
    adequate : float                Standard deviation that the autocorrelated part of residuals may have; 0 for the usual limits. [K]
    accepted : bool                 Whether the campaign accepts the stage as it is, whatever its standing.
    """

    model: Model
    records: tuple[Record, ...]
    free: tuple[str, ...] = ()
    scenarios: Mapping[str, Scenario] = field(default_factory=dict)
    local: Mapping[str, LocalSpec] = field(default_factory=dict)
    record_local: Mapping[str, Mapping[str, LocalSpec]] = field(default_factory=dict)
    priors: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    store: Store = field(default_factory=Store)
    prior: tuple[str, ...] = ()
    held_bias: Mapping[str, float] = field(default_factory=dict)
    held_errors: Mapping[str, float] | None = None
    weights: Mapping[str, float] = field(default_factory=dict)
    untie: bool = False
    loss: str = "linear"
    knee: float = 1.0
    search: str = "auto"
    window: float = 0.0
    name: str = ""
    readings: Mapping[str, Reading] = field(default_factory=dict)
    seen: Mapping[str, str] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    fit_start: bool = True
    options: Options = FITTING
    hand: Store | None = None
    key: str = ""
    adequate: float = 0.0
    accepted: bool = False

    @property
    def shared(self) -> Mapping[str, tuple[str, ...]]:
        """Path -> every path of the model that has its value, its own first, of those that share one in this fit."""
        if self.untie:
            return {}
        known = local_identities(self.model)
        return {p: (p, *(q for q in one.paths if q != p)) for p, one in known.items() if len(one.paths) > 1}

    def locals_of(self, record: Record) -> dict[str, LocalSpec]:
        """Return the local values of a record; those of its own win over the stage's."""
        return {**self.local, **self.record_local.get(record.name, {})}

    def scenario(self, record: Record) -> Scenario:
        """Return the scenario of a record, with a place for every local boundary."""
        base = self.scenarios.get(record.name, self.scenarios.get("*", Scenario(record.name)))
        local = self.locals_of(record)
        boundaries = {n: Constant(self.local_start(record, n)) for n in local if not n.startswith("initial.")}
        readings = {n: r.channel for n, r in self.readings.items() if n not in local}
        boundaries |= {n: Constant(first_reading(record, c, self.window)) for n, c in readings.items() if not n.startswith("initial.")}
        initial = {n.removeprefix("initial."): c for n, c in readings.items() if n.startswith("initial.")}
        return base.with_(boundaries=boundaries, initial=initial)

    def local_start(self, record: Record, name: str) -> float:
        """Return the start of a local value for a record. [K]"""
        text = self.locals_of(record)[name].start
        if text in record.channels:
            return first_reading(record, text, self.window)
        try:
            return literal(text, TEMPERATURE)
        except ThermidError as error:
            hint = nearest(text, record.channels)
            raise IdentificationError(
                f"'{text}' is no temperature and no channel of {record.name}.{hint} ({error.message})", f"local.{name}"
            ) from None
