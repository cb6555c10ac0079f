"""A test that still runs, read as a record of a campaign is and with the model of one of its stages; the campaign has not its log yet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from thermid.base.dual import value_of
from thermid.base.errors import IdentificationError, RecordError
from thermid.campaign._file import bound_by, scenario_of
from thermid.campaign._stages import Campaign
from thermid.fit.calibration import first_reading
from thermid.measure.records import Record
from thermid.model.tree import Model
from thermid.simulation.network import compile_network
from thermid.simulation.runs import Scenario

if TYPE_CHECKING:
    from thermid.campaign._schema import RecordTable, StageTable


@dataclass(frozen=True, eq=False)
class RunningTest:
    """What a campaign says of a log that it has not yet.

    Parameters
    ----------
    model : Model               Of the stage, with its fitted values.
    table : RecordTable         Of the record that the log is like.
    stage : StageTable          Its bindings and conditions.
    first : dict                Boundary -> channel whose first reading stands there, and what is added to it [K].
    title : str                 Of the campaign.
    """

    model: Model
    table: RecordTable
    stage: StageTable
    first: Mapping[str, tuple[str, float]]
    title: str

    @property
    def options(self) -> dict[str, Any]:
        """What `read_record` is told beside the channels."""
        t = self.table
        return {"time": t.time, "separator": t.separator, "decimal": t.decimal, "clock": t.clock, "units": t.units}

    def bound(self, record: Record) -> Record:
        """Return a record with the bindings of the stage."""
        return bound_by(record, self.stage)

    def conditions(self, record: Record, stated: Scenario | None = None) -> Scenario:
        """Return what a log does not say: as told, else as the stage has it."""
        out = scenario_of(self.stage.scenario, record.name)
        if stated is not None and stated.start != "":
            out = replace(out, initial={})
        starts = {n: t.start for n, t in {**self.stage.local, **self.table.local}.items() if n.startswith("initial.")}
        out = out.with_(initial={**{n.removeprefix("initial."): t for n, t in starts.items()}, **out.initial})
        if stated is not None:
            start = {} if stated.start == "" else {"start": stated.start}
            out = out.with_(boundaries=stated.boundaries, loads=stated.loads, initial=stated.initial, **start)
        targets = {c.target or c.name for c in record.channels.values()}
        open_ = {b: first_value for b, first_value in self.first.items() if b not in out.boundaries and b not in targets}
        read = {b: f"{first_reading(record, channel) + added} [K]" for b, (channel, added) in open_.items()}
        return out.with_(boundaries=read)

    @property
    def remarks(self) -> tuple[str, ...]:
        """What a reader must know of it."""
        steps = [next(iter(step)) for step in self.table.prepare]
        omitted = (f"preparation of the record ({', '.join(steps)}) is left out, because the log still grows",) if steps else ()
        return (
            *omitted,
            *(f"temperature of {b}: the first reading of {c}, unless --boundary gives it" for b, (c, _) in self.first.items()),
        )


def running_test(campaign: Campaign, record: str = "") -> RunningTest:
    """Return what a campaign says of a test that runs, with the model and values of the last stage that fits such a record.

    Where no stage fits it, the last stage counts.

    Parameters
    ----------
    campaign : Campaign  Its result, from a file.
    record : str        The record that the log is like; not needed where there is one.

    Raises
    ------
    RecordError             When there is no such record, or several and none is named.
    IdentificationError     When the campaign was made in Python.
    """
    source = campaign.source
    if source is None:
        raise IdentificationError(
            "a campaign made in Python has no records of a file. Give its file.", campaign.title, code="campaign.not-from-file"
        )
    record = _named(record, list(source.content.records), campaign.title)
    name = [*campaign, *(n for n, request in campaign.requests.items() if record in {r.name for r in request.records})][-1]
    model = campaign[name].model
    stage_table = next(s for s in source.content.stages if s.name == name)
    table = source.table_of(record)
    first = {n: (t.start, 0.0) for n, t in {**stage_table.local, **table.local}.items() if "." not in n and t.start in table.channels}
    values = compile_network(model).numbers().values
    for n, reading in stage_table.readings.items():
        channel, path = (reading, "") if isinstance(reading, str) else (reading.channel, reading.offset)
        first[n] = (channel, float(value_of(values[path])) if path else 0.0)
    return RunningTest(model, table, stage_table, {n: f for n, f in first.items() if not n.startswith("initial.")}, campaign.title)


def _named(record: str, names: Sequence[str], title: str) -> str:
    """Return the record that is asked for."""
    if not record and len(names) > 1:
        raise RecordError(
            f"the campaign has several records. Name the one that the log is like: {', '.join(names)}.", title, code="name.unknown"
        )
    return record or names[0]
