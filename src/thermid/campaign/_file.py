"""Reading a campaign file: records found and checked, stages and verdicts as requests."""

from __future__ import annotations

import fnmatch
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from thermid.base.errors import DeckError, MissingDataError, RecordError, errors_at, extension, nearest, refuse_unknown
from thermid.base.files import Places, by_grammar, read_toml, resolve_inside
from thermid.base.units import Memo
from thermid.campaign._cache import file_name, log_kept
from thermid.fit.calibration import LocalSpec
from thermid.measure.readers import read_record
from thermid.measure.records import ROLES, Channel, Record
from thermid.model.tree import Model, TableSignal, literal, load_model
from thermid.simulation.runs import LogColumns, Scenario, environments_of

if TYPE_CHECKING:
    from thermid.campaign._schema import CampaignFile, RecordTable, ScenarioTable, StageTable, VerdictTable
    from thermid.simulation.runs import Environment


DATA = "THERMID_DATA"


@dataclass(frozen=True, eq=False)
class CampaignSource:
    """A campaign file with the folder it lies in; logs are read when a stage asks for them.

    Parameters
    ----------
    path : Path             The file.
    content : CampaignFile  Its content, checked against the grammar.
    lines : dict            Key path -> line.
    data : Path or None     A folder of logs outside the project, where one was given.
    results : Path or None  A folder that keeps logs as they were read.
    accept : tuple of str   Stages that the caller accepts as they are, beside those of the file.
    memo : Memo             Files, and logs that were read.
    """

    path: Path
    content: CampaignFile
    lines: Mapping[str, int]
    data: Path | None = None
    results: Path | None = None
    accept: tuple[str, ...] = ()
    memo: Memo = field(init=False, default_factory=Memo, compare=False, repr=False)

    @property
    def accepted(self) -> tuple[str, ...]:
        """Stages that are accepted as they are, whatever their standing."""
        return tuple(dict.fromkeys((*self.content.accept, *self.accept)))

    @property
    def unjudged(self) -> CampaignSource:
        """The stages alone: without verdicts, which open hold-out records, and without a joint fit."""
        return replace(self, content=self.content.model_copy(update={"joint": None, "verdicts": []}))

    def below(self, names: Iterable[str]) -> set[str]:
        """Return the stages that some stages inherit from, at every depth."""
        out: set[str] = set()
        for stage in reversed(self.content.stages):  # a stage inherits from earlier ones only
            out |= {n for i in stage.inherit.values() for n in i.stages} if stage.name in {*names, *out} else set()
        return out

    def where(self, key: str) -> str:
        """Return file, line and key path."""
        return Places(self.path.name, self.lines)(key)

    def names(self) -> dict[str, tuple[Path, RecordTable]]:
        """Return record name -> file and table; a pattern of files gives one record per file, named after it.

        Raises
        ------
        MissingDataError   When a log is not where the campaign says.
        """
        return self.memo.value("files", self._all_files)

    def _all_files(self) -> dict[str, tuple[Path, RecordTable]]:
        """Return record name -> its file and table; two files of one name, and a checksum of no record, are refused."""
        out: dict[str, tuple[Path, RecordTable]] = {}
        for name, table in self.content.records.items():
            where = self.where(f"records.{name}")
            if (table.file is None) == (table.files is None):
                raise DeckError("give a record either `file`, or `files` with patterns.", where, code="value.excludes-another")
            files = (
                [(name, self._find(name, table.file, table)[0])]
                if table.file is not None
                else [(file.name.split(".")[0], file) for pattern in _patterns(table) for file in self._find(name, pattern, table)]
            )
            for record, file in files:
                if record in out and out[record][0] != file:
                    raise DeckError(
                        f"two logs give a record with the name '{record}': '{out[record][0].name}' and '{file.name}'. Give one of them a "
                        "name by `file`.",
                        where,
                        code="name.taken",
                    )
                out[record] = (file, table)
        for name in self.content.checksums:
            if name not in out:
                get = next((f" {t.get}" for t in self.content.records.values() if t.files is not None and t.get), "")
                raise MissingDataError(
                    f"a checksum is given for '{name}', but no log gives a record of that name: the data are incomplete or the name "
                    f"is misspelt.{nearest(name, out)}{get}",
                    self.where(f"checksums.{name}"),
                )
        return out

    def _find(self, name: str, pattern: str, table: RecordTable) -> list[Path]:
        """Return the files of a pattern, in the data folder where one is given, or beside the campaign."""
        where = self.where(f"records.{name}")
        for root, below in (*self._in_data(pattern), (self.path.parent, pattern)):
            roots = (self.data,) if self.data is not None else ()
            if any(mark in pattern for mark in "*?["):
                inside = resolve_inside(root, str(Path(below).parent), where, roots)
                files = sorted(inside.glob(Path(below).name)) if inside.is_dir() else []
                hits = [resolve_inside(p.parent, p.name, where, roots) for p in files]
            else:
                target = resolve_inside(root, below, where, roots)
                hits = [target] if target.is_file() else []
            if hits:
                return hits
        beside = f" beside the campaign, and no folder of data is given (--data, or {DATA})"
        shown = beside if self.data is None else f" in '{self.data.name}/' nor beside the campaign"
        get = f" {table.get}" if table.get else ""
        raise MissingDataError(f"no log '{pattern}'{shown}.{get}", where)

    def _in_data(self, pattern: str) -> list[tuple[Path, str]]:
        """Return where the data folder may hold a file: at its path without steps up, or under a name that no other log has."""
        if self.data is None:
            return []
        named = {Path(p).name for t in self.content.records.values() for p in _patterns(t) if p != pattern}
        path = Path(pattern)
        alone = [path.name] if path.name not in named and not any(mark in pattern for mark in "*?[") else []
        return [(self.data, p) for p in dict.fromkeys(("/".join(p for p in path.parts if p not in ("..", path.anchor)), *alone))]

    def in_data(self, name: str) -> bool:
        """Whether the data folder has a log of a record or pattern of the file."""
        every = (place for pattern in _patterns(self.content.records[name]) for place in self._in_data(pattern))
        return any(any(root.glob(below)) for root, below in every)

    def pick(self, patterns: Sequence[str], where: str) -> list[str]:
        """Return the names of records that match patterns, in order.

        Raises
        ------
        RecordError   When a pattern matches nothing.
        """
        out: dict[str, None] = {}
        names = list(self.names())
        for pattern in patterns:
            hits = [n for n in names if fnmatch.fnmatchcase(n, pattern)]
            for group, table in self.content.records.items():
                if group == pattern and table.files is not None:
                    hits += [n for n, (_, t) in self.names().items() if t is table]
            if not hits:
                raise RecordError(f"no record '{pattern}'.{nearest(pattern, [*names, *self.content.records])}", where, code="name.unknown")
            out |= dict.fromkeys(hits)
        return list(out)

    def record(self, name: str) -> Record:
        """Return a log, read and prepared as the campaign says.

        Raises
        ------
        RecordError   When its samples are not those that the campaign knows.
        """
        return self.memo.value(("record", name), lambda: self._record(name))

    def _record(self, name: str) -> Record:
        """Return a log, read and prepared; errors name its place in the campaign."""
        path, table = self.names()[name]
        where = self.where(f"records.{name}")
        with errors_at(where, ": "):
            prepared = self._prepared(name, path, table, where)
            record = self._joined(prepared, table, where)
            gases = self.environment_of(name, table)

        def of_record(course: Any) -> Any:
            """Return a column of the log as one of the record: joined with another log, that has another checksum and the same clock."""
            own = isinstance(course, TableSignal) and course.log is not None and course.log[0] == prepared.origin.sha256
            return replace(course, log=(record.origin.sha256, course.log[1])) if own else course

        return record.with_environment({gas: e.mapped(of_record) for gas, e in gases.items()}) if gases else record

    def environment_of(self, name: str, table: RecordTable) -> dict[str, Environment]:
        """Return gas node -> its state, as the table of a record has it; empty where it says nothing.

        Raises
        ------
        ThermidError   When a state does not exist, or a column of a log is missing.
        """
        tables = {gas: t.written for gas, t in table.environment.items()}
        logs = [value["file"] for t in tables.values() for value in t.values() if isinstance(value, dict) and "file" in value]
        inside = self.data is not None and all((self.data / log).is_file() for log in logs)
        columns = LogColumns(self.data if inside and self.data is not None else self.path.parent)
        return environments_of(tables, columns, self.where(f"records.{name}.environment"))

    def _prepared(self, name: str, path: Path, table: RecordTable, where: str) -> Record:
        """Return a log, prepared, with the checksum that the campaign gives; as it is kept, where nothing has changed since."""
        read: dict[str, Any] = {
            "time": table.time,
            "units": table.units,
            "name": name,
            "separator": table.separator,
            "decimal": table.decimal,
            "clock": table.clock,
        }
        checksum = self.content.checksums.get(name)

        def make() -> Record:
            """Read the log and check it against its checksum."""
            raw = read_record(path, table.channels, **read)
            if checksum is not None and not raw.origin.sha256.startswith(checksum):
                raise RecordError(
                    f"its samples have the checksum {raw.origin.sha256[:12]}..., not {checksum[:12]}...: this log differs from the one "
                    f"that the campaign was written for.{f' {table.get}' if table.get else ''}",
                    where,
                    code="record.another-log",
                )
            return raw.prepare(table.prepare)

        return log_kept(self.results, path, {**read, "channels": table.channels, "prepare": table.prepare, "checksum": checksum}, make)

    def _joined(self, record: Record, table: RecordTable, where: str) -> Record:
        """Return a record with the logs beside it, where the campaign names some; one whose clock the fit finds comes last."""
        several = table.joined if isinstance(table.joined, list) else [table.joined] if table.joined is not None else []
        if several and table.files is not None:
            raise DeckError(
                "a pattern of files cannot be joined with one log. Give each log a separate record by `file`.",
                where,
                code="value.excludes-another",
            )
        for k, one in enumerate(sorted(several, key=lambda t: isinstance(t.offset, tuple) or not isinstance(t.rate, float))):
            other, offset, place = one.record, one.offset, f"{where}.joined" + (f".{k}" if len(several) > 1 else "")
            if other not in self.names() or self.names()[other][1].joined is not None:
                missing = f"is not in this campaign.{nearest(other, self.names())}"
                what = "is joined with a third." if other in self.names() else missing
                raise RecordError(f"it is joined with record '{other}', which {what}", where, code="campaign.refused")
            texts = (offset, offset) if isinstance(offset, str) else offset
            ends = None if texts is None else tuple(literal(text, "s", f"{place}.offset") for text in texts)
            record = record.joined(self.record(other), ends, one.rate)
        return record

    def bound(self, name: str, stage: StageTable) -> Record:
        """Return a record with the bindings of a stage in place of its own."""
        return bound_by(self.record(name), stage)

    def table_of(self, name: str) -> RecordTable:
        """Return the table of a record, whether its log is there or not.

        Raises
        ------
        RecordError   When there is none of the name.
        """
        table = self.content.records.get(name)
        if table is not None:
            return table
        tables = {**self.content.records, **{n: t for n, (_, t) in self.names().items()}}
        refuse_unknown([name], tables, self.path.name, "no record '{}'. Records: {known}.", RecordError)
        return tables[name]

    def local_of_record(self, name: str) -> dict[str, LocalSpec]:
        """Return the local values that a record's own table gives."""
        where = self.where(f"records.{name}.local")
        return {n: LocalSpec.read(t.model_dump(exclude_none=True), where) for n, t in self.names()[name][1].local.items()}

    def model(self, file: str, where: str) -> Model:
        """Return the model of a stage, by the file name of its deck or FMU."""
        target = resolve_inside(self.path.parent, file, where)
        if target.suffix.lower() == ".fmu":
            fmu_model: Model = self.memo.value(("fmu", target), lambda: extension("fmu_model", "an FMU as a model", where)(target))
            return fmu_model
        with errors_at(where):
            return load_model(target)

    @staticmethod
    def read(path: str | os.PathLike[str], data: str | os.PathLike[str] | None = None) -> CampaignSource:
        """Return a campaign file, checked against the grammar.

        Parameters
        ----------
        path : path     The TOML file.
        data : path     A folder of logs; the environment variable THERMID_DATA by default, if it is set.

        Raises
        ------
        DeckError       When it does not follow the grammar, or names a stage that is not there or comes later.
        """
        target = Path(path)
        return CampaignSource.of_content(target, *read_toml(target), data)

    @staticmethod
    def of_content(
        target: Path, content: Mapping[str, Any], lines: Mapping[str, int] | None = None, data: str | os.PathLike[str] | None = None
    ) -> CampaignSource:
        """Return a campaign of its content, as it would be read from a file; see `read`."""
        lines = lines or {}
        checked: CampaignFile = by_grammar("thermid.campaign._schema.CampaignFile", content, Places(target.name, lines))
        logs = data if data is not None else os.environ.get(DATA)
        folder = Path(logs).resolve() if logs else None
        if folder is not None and not folder.is_dir():
            raise MissingDataError(f"the data folder '{folder.name}' does not exist. Give another one with --data or {DATA}.", target.name)
        source = CampaignSource(target, checked, lines, folder)
        _check_order(source, checked.stages, checked.verdicts)
        return source


def bound_by(record: Record, stage: StageTable) -> Record:
    """Return a record with the bindings of a stage in place of its own."""
    for channel in (*stage.bind, *stage.ignore):
        record.channel(channel)
    kept = record.select(*(n for n in record.channels if n not in stage.ignore))
    return replace(kept, channels={n: _rebound(c, stage.bind[n]) if n in stage.bind else c for n, c in kept.channels.items()})


def _rebound(channel: Channel, target: str | dict[str, str]) -> Channel:
    """Return a channel with another target."""
    if isinstance(target, str):
        return replace(channel, target=target)
    (role, path), *more = [(k, v) for k, v in target.items() if k in ROLES] or [("", "")]
    if not role or more or set(target) - {role, "gain"}:
        raise RecordError(
            f"give a binding exactly one of {', '.join([*ROLES][:-1])} and {[*ROLES][-1]}, and for a load a gain; given: "
            f"{', '.join(target)}.",
            channel.name,
            code="value.incomplete",
        )
    return replace(channel, role=role, target=path, gain=target.get("gain", channel.gain))


def scenario_of(table: ScenarioTable, title: str) -> Scenario:
    """Return the scenario that a stage or verdict gives for what its logs do not say."""
    return Scenario(title, **table.written)


def plain_tables(tables: Mapping[str, Any]) -> dict[str, Any]:
    """Return local values or readings of a stage or verdict as `calibrate` and `validate` take them."""
    return {name: t if isinstance(t, str) else t.model_dump(exclude_none=True) for name, t in tables.items()}


def _patterns(table: RecordTable) -> list[str]:
    """Return the file of a record, or its patterns of files."""
    return [table.file] if table.file is not None else [table.files] if isinstance(table.files, str) else table.files or []


def accepting(source: CampaignSource, stages: Sequence[str]) -> CampaignSource:
    """Return a campaign with further stages accepted as they are.

    Raises
    ------
    DeckError   When there is no such stage.
    """
    widened = replace(source, accept=(*source.accept, *stages))
    _check_order(widened, widened.content.stages, widened.content.verdicts)
    return widened


def _check_order(source: CampaignSource, stages: Sequence[StageTable], verdicts: Sequence[VerdictTable]) -> None:
    """Refuse stages of one name, and stages that build on what does not come before them."""
    done: list[str] = []
    for k, stage in enumerate(stages):
        if stage.name in done:
            raise DeckError(f"two stages are named '{stage.name}'.", source.where(f"stages.{k}"), code="name.taken")
        if not stage.name.strip():
            raise DeckError("a stage needs a name.", source.where(f"stages.{k}.name"), code="name.not-valid")
        twin = next((n for n in done if file_name(n).lower() == file_name(stage.name).lower()), None)
        if twin is not None:
            raise DeckError(
                f"stages '{twin}' and '{stage.name}' would be saved under one file name.",
                source.where(f"stages.{k}.name"),
                code="name.taken",
            )
        if stage.values and (stage.records or stage.free or stage.steady or stage.priors):
            raise DeckError(
                "a stage either has `values` tuned by hand or fits records. Define two stages.",
                source.where(f"stages.{k}.values"),
                code="value.excludes-another",
            )
        if not (stage.values or stage.records or stage.inherit):
            raise DeckError(
                "a stage needs `records` to fit, a file of `values` tuned by hand, or stages to `inherit` from before its own test.",
                source.where(f"stages.{k}"),
                code="campaign.refused",
            )
        for part, inherit in stage.inherit.items():
            for below in (name for name in inherit.stages if name not in done):
                raise DeckError(
                    f"'{part}' inherits from stage '{below}', which is not an earlier stage.{nearest(below, done)}",
                    source.where(f"stages.{k}.inherit"),
                    code="name.unknown",
                )
        done.append(stage.name)
    refuse_unknown(source.accepted, done, source.where("accept"), "no stage '{}' to accept.", DeckError)
    for name, prediction in source.content.predictions.items():
        refuse_unknown([prediction.stage or done[-1]], done, source.where(f"predictions.{name}.stage"), "no stage '{}'.", DeckError)
    for k, verdict in enumerate(verdicts):
        refuse_unknown([verdict.model], done, source.where(f"verdicts.{k}.model"), "no stage '{}'.", DeckError)
        if verdict.values == "joint" and source.content.joint is None:
            raise DeckError(
                "this verdict is about the joint fit, but the campaign has no [joint] table. Add one.",
                source.where(f"verdicts.{k}.values"),
                code="campaign.refused",
            )
