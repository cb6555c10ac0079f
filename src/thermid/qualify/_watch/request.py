"""What a log is watched by, whoever asks: the command, the studio, a script. The same request gives the same answer on the same log.

Its columns are bound as somebody says, as the record of a campaign says, or by the names that a deck has.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from thermid.base.errors import RecordError, refuse_unknown
from thermid.measure.readers import log_cells, name_and_unit, read_record, temperature_columns
from thermid.measure.records import Record, StabilityRule
from thermid.model.tree import Model
from thermid.qualify._watch.growing import read_whole_lines
from thermid.qualify._watch.stopping import Stopping, TemperatureLimit
from thermid.qualify._watch.watcher import Watcher, WatchLook, roles_of_paths
from thermid.simulation.runs import Scenario, compile_network


@dataclass
class BoundColumns:
    """Reads a log, or a piece of one, with its columns bound to a model; the first piece settles which columns are read.

    Parameters
    ----------
    targets : dict          Column -> node, boundary or load; by default every temperature, or every column with a name of the model's.
    full_scale : dict       Column in per cent -> power at 100 %.
    units : dict            Column -> its unit, where the log has none.
    model : Model or None   Of the unit.
    options : dict          Further arguments of `read_record`: time, separator, decimal, clock, units.
    tables : dict           Column -> its table as in a campaign; made from the above where empty.
    bound : callable        Applied to each record that was read.
    remarks : tuple of str  Columns that are not used, in words.
    """

    targets: Mapping[str, str] = field(default_factory=dict)
    full_scale: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    model: Model | None = None
    options: Mapping[str, Any] = field(default_factory=dict)
    tables: dict[str, Any] = field(default_factory=dict)
    bound: Callable[[Record], Record] = field(default=lambda record: record)
    remarks: tuple[str, ...] = ()

    def read(self, path: Path, name: str) -> Record:
        """Return the record of a log, named `name`.

        Raises
        ------
        RecordError   When no column can be used, or one is bound to a path that the model does not have.
        """
        if not self.tables:
            self.tables = self._by_model(path, self.model) if self.model is not None else self._temperatures(path)
        return self.bound(read_record(path, self.tables, name=name, **self.options))

    def _temperatures(self, path: Path) -> dict[str, Any]:
        """Return column -> table of temperatures alone, for a log without a model."""
        names = list(self.targets) or self._temperature_columns(path)
        if not names:
            raise RecordError("no column looks like a temperature. Name them with --channel.", path.name, code="record.nothing-there")
        return {n: self._table(n, "node", self.targets.get(n, n)) for n in names}

    def _by_model(self, path: Path, model: Model) -> dict[str, Any]:
        """Return column -> table of the columns that a model has by name, or of those in `targets`."""
        network = compile_network(model)
        roles = roles_of_paths(network)
        canonical = network.flat.names.model.canonical
        if self.targets:
            for target in self.targets.values():
                refuse_unknown([canonical(target)], roles, "--channel", f"{model.title} has no node, boundary or load '{{}}'.", RecordError)
            return {n: self._table(n, roles[canonical(t)], t) for n, t in self.targets.items()}
        header = [name_and_unit(cell)[0] for cell in log_cells(path, self.options.get("separator")).header]
        roles_by_column = {n: roles[canonical(n)] for n in header if canonical(n) in roles}
        if "node" not in roles_by_column.values():
            nodes = ", ".join(list(network.nodes)[:8])
            raise RecordError(
                f"no column has the name of a node of {model.title}. Bind them: --channel COLUMN=NODE. Columns: {', '.join(header)}. "
                f"Nodes: {nodes}.",
                path.name,
                code="record.nothing-there",
            )
        self.remarks = tuple(
            f"not used: column {n}, which has no name of the deck's" for n in self._temperature_columns(path) if n not in roles_by_column
        )
        return {n: self._table(n, role, n) for n, role in roles_by_column.items()}

    def _temperature_columns(self, path: Path) -> list[str]:
        """Return the names of the log's columns that are temperatures."""
        return temperature_columns(path, self.options.get("time"), self.options.get("separator"))

    def _table(self, column: str, role: str, target: str) -> dict[str, Any]:
        """Return the table of a column as in a campaign: its role and target, full scale and unit."""
        table: dict[str, Any] = {role: target}
        more = {"full_scale": self.full_scale, "unit": self.units}
        return table | {key: given[column] for key, given in more.items() if column in given}


@dataclass(frozen=True, eq=False)
class WatchRequest:
    """What a log is watched by.

    Parameters
    ----------
    columns : BoundColumns      Reads the log; its model is that of the unit, or None.
    rule : StabilityRule        The plan's own rule of stability.
    within : float              Largest half-width of the interval of a final temperature. [K]
    limits : tuple              Limits that must be decided before a stop.
    slowest : str or float      Longest time constant that the unit can have, without a model. [s]
    since : str or float        When conditions last changed. [s]
    scenario : Scenario         Inputs that the log does not have.
    conditions : callable       (record, `scenario`) -> inputs that the log does not have; `scenario` itself where it is None.
    """

    columns: BoundColumns
    rule: StabilityRule
    within: float
    limits: tuple[TemperatureLimit, ...] = ()
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
            if self.conditions is not None:
                scenario = self.conditions(record, scenario)
            elif scenario is not None and self.since != "start":
                # its start is that of the test: at a later time what no sensor reads is in balance with what is beside it
                scenario = scenario.with_(start="", initial={})
            more |= {"model": model, "scenario": scenario or Scenario(record.name)}
        stopping = Stopping(self.rule, self.within, self.limits, **more)
        return Watcher(stopping, names, model, scenario if model is not None else None, remarks=self.columns.remarks)

    def look(self, path: Path) -> WatchLook:
        """Return the advice and alarms on a log as it is now.

        Raises
        ------
        RecordError, NameNotFoundError   As in `read` and `watcher`.
        """
        record = self.read(path)
        return self.watcher(record).look(record)
