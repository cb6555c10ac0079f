"""What the columns of a running test's log are: as told, as the record of a campaign says, or by the names that a deck has."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from thermid.base.errors import RecordError, refuse_unknown
from thermid.measure.readers import log_cells, name_and_unit, read_record, temperature_columns
from thermid.measure.records import Record
from thermid.model.tree import Model
from thermid.simulation.network import Network, compile_network


def roles_in(network: Network) -> dict[str, str]:
    """Return what a column can be bound to in a network: path -> node, boundary or load."""
    return {
        **dict.fromkeys(network.nodes, "node"),
        **dict.fromkeys(network.boundaries, "boundary"),
        **{load.path: "load" for load in network.flat.loads},
    }


@dataclass
class BoundColumns:
    """Reads a log, or a piece of one; which columns it takes is settled by the first piece.

    Parameters
    ----------
    told : dict             Column -> node, boundary or load; by default every temperature, with a model every column of a name that it has.
    full_scale : dict       Column in per cent -> power at 100 %.
    units : dict            Column -> its unit, where the log has none.
    model : Model or None   Of the unit.
    options : dict          What else `read_record` is told: time, separator, decimal, clock, units.
    tables : dict           Column -> its table as in a campaign, where one says what the columns are.
    bound : callable        What is done to a record that was read.
    remarks : tuple of str  What a reader must know; of columns by a model's names, which ones are not used.
    """

    told: Mapping[str, str] = field(default_factory=dict)
    full_scale: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    model: Model | None = None
    options: Mapping[str, Any] = field(default_factory=dict)
    tables: dict[str, Any] = field(default_factory=dict)
    bound: Callable[[Record], Record] = field(default=lambda record: record)
    remarks: tuple[str, ...] = ()

    def read(self, path: Path, name: str) -> Record:
        """Return the record of a log.

        Raises
        ------
        RecordError   When no column can be used, or one is bound to what the model has not.
        """
        if not self.tables:
            self.tables = self._by_model(path, self.model) if self.model is not None else self._temperatures(path)
        return self.bound(read_record(path, self.tables, name=name, **self.options))

    def _temperatures(self, path: Path) -> dict[str, Any]:
        """Return the tables of temperatures alone."""
        names = list(self.told) or self._temperature_columns(path)
        if not names:
            raise RecordError("no column looks like a temperature. Name them with --channel.", path.name, code="record.nothing-there")
        return {n: self._table(n, "node", self.told.get(n, n)) for n in names}

    def _by_model(self, path: Path, model: Model) -> dict[str, Any]:
        """Return the tables of columns that a model has."""
        network = compile_network(model)
        roles = roles_in(network)
        canonical = network.flat.names.model.canonical
        if self.told:
            for target in self.told.values():
                refuse_unknown([canonical(target)], roles, "--channel", f"{model.title} has no node, boundary or load '{{}}'.", RecordError)
            return {n: self._table(n, roles[canonical(t)], t) for n, t in self.told.items()}
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
        """Return the columns of a log that are temperatures, read as told."""
        return temperature_columns(path, self.options.get("time"), self.options.get("separator"))

    def _table(self, column: str, role: str, target: str) -> dict[str, Any]:
        table: dict[str, Any] = {role: target}
        more = {"full_scale": self.full_scale, "unit": self.units}
        return table | {key: given[column] for key, given in more.items() if column in given}
