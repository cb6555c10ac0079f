"""What a log is watched by, whoever asks: the command, the studio, a script. The same request gives the same answer on the same log."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from thermid.measure.records import Record
from thermid.measure.steadiness import StabilityRule
from thermid.qualify._watch.columns import BoundColumns
from thermid.qualify._watch.growing import read_whole_lines
from thermid.qualify._watch.stopping import Stopping, TemperatureLimit
from thermid.qualify._watch.watcher import Watcher, WatchLook
from thermid.simulation.runs import Scenario


@dataclass(frozen=True, eq=False)
class WatchRequest:
    """What a log is watched by.

    Parameters
    ----------
    columns : BoundColumns      Reads the log; its model is that of the unit, or None.
    rule : StabilityRule        The plan's own rule of stability.
    within : float              Largest half-width of the interval of a final temperature. [K]
    limits : tuple              Limits that must be decided before a stop.
    required : bool             Whether no stop is advised before the rule is met.
    slowest : str or float      Longest time constant that the unit can have, without a model. [s]
    since : str or float        When conditions last changed. [s]
    scenario : Scenario         Inputs that the log does not have.
    conditions : callable       (record, `scenario`) -> inputs that the log does not have; `scenario` itself where it is None.
    """

    columns: BoundColumns
    rule: StabilityRule
    within: float
    limits: tuple[TemperatureLimit, ...] = ()
    required: bool = False
    slowest: str | float | None = None
    since: str | float = "start"
    scenario: Scenario | None = None
    conditions: Callable[[Record, Scenario | None], Scenario] | None = None

    def read(self, path: Path) -> Record:
        """Return the whole lines of a log, from when conditions last changed.

        Raises
        ------
        RecordError   When no column can be used, or one is bound to a path that the model does not have.
        """
        return read_whole_lines(path, lambda p: self.columns.read(p, p.stem)).trim(self.since, "end")

    def watcher(self, record: Record) -> Watcher:
        """Return a watcher of a log that begins with this record.

        Raises
        ------
        NameNotFoundError   When a limit is on no channel of the log.
        """
        names = tuple(n for n, c in record.channels.items() if c.role == "node" and c.quantity == "temperature")
        for m in self.limits:
            record.channel(m.channel)
        model, scenario = self.columns.model, self.scenario
        more: dict[str, Any] = {} if self.slowest is None else {"slowest": self.slowest}
        if model is not None:
            scenario = scenario if self.conditions is None else self.conditions(record, scenario)
            more |= {"model": model, "scenario": scenario or Scenario(record.name)}
        stopping = Stopping(self.rule, self.within, self.limits, required=self.required, **more)
        return Watcher(stopping, names, model, scenario if model is not None else None, remarks=self.columns.remarks)

    def look(self, path: Path) -> WatchLook:
        """Return the advice and alarms on a log as it is now.

        Raises
        ------
        RecordError, NameNotFoundError   As in `read` and `watcher`.
        """
        record = self.read(path)
        return self.watcher(record).look(record)
