"""A log that is followed, watched as `thermid watch` does: when the test may stop, what went wrong, nodes that nobody measures."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from thermid.base.codes import add_codes
from thermid.base.errors import RecordError, ThermidError
from thermid.campaign.stages import Campaign, RunningTest, running_test
from thermid.measure.amounts import pairs, with_unit
from thermid.measure.readers import UNFINISHED, is_bench_log, log_cells, name_and_unit
from thermid.measure.records import Record
from thermid.measure.steadiness import StabilityRule
from thermid.model.parameters import UNJUDGED
from thermid.model.tree import Model
from thermid.qualify.watch import BoundColumns, Stopping, Watcher
from thermid.reporting.objects import clean
from thermid.simulation.network import compile_network
from thermid.simulation.scenarios import Scenario
from thermid.values.store import model_standing

WITHIN = 1.0
"""Half of the interval of where a channel ends, at most, where the page asks for none. [K]"""


def whole_lines(path: Path, read: Callable[[], Record]) -> Record:
    """Return a log without a last line that is still being written: half of a number is a number, and would be a spike."""
    before = _ended(path)
    record = read()
    dropped = any(UNFINISHED in note for note in record.steps)
    if (before and _ended(path)) or dropped or record.times.size < 3:
        return record
    return replace(record.trim(float(record.times[0]), float(record.times[-2])), steps=(*record.steps, f"the last line {UNFINISHED}"))


def _ended(path: Path) -> bool:
    """Whether a file ends with a whole line; a log of the bench has checksums and is packed or whole by itself."""
    with path.open("rb") as file:
        head = file.read(4096)
        if is_bench_log(head) or head[:2] == b"\x1f\x8b" or not head:
            return True
        file.seek(-1, 2)
        return file.read(1) in b"\r\n"


@dataclass(frozen=True)
class _Bound:
    """What a log is watched with: how its columns are read, and what it does not say itself."""

    columns: BoundColumns
    said: Scenario | None = None
    test: RunningTest | None = None
    unused: str = ""
    like: str = ""

    def watcher(self, record: Record, stopping: Mapping[str, Any]) -> Watcher:
        """Return what watches, as the command makes it."""
        names = tuple(n for n in record.channels if record.channel(n).role == "node" and record.channel(n).quantity == "temperature")
        model = self.columns.model
        if model is None:
            return Watcher(Stopping(**stopping), names)
        said = self.said if self.test is None else self.test.conditions(record, self.said)
        made = Watcher(Stopping(**stopping, model=model, scenario=said or Scenario(record.name)), names, model, said)
        made.remarks = self.columns.remarks
        return made


class LiveWatch:
    """The watcher of the log that is looked at, kept from look to look.

    Parameters
    ----------
    known : callable    Returns the model of the project, or its campaign once all stages are done; None where there is neither.
    """

    def __init__(self, known: Callable[[], Model | Campaign | None]) -> None:
        self._known = known
        self._of: tuple[Any, ...] | None = None
        self._subject: Model | Campaign | None = None
        self._bound = _Bound(BoundColumns())
        self._watcher: Watcher | None = None
        self._at = 0.0

    def look(
        self, path: Path, rule: StabilityRule, asked: Mapping[str, Any], slowest: float | None = None, since: float | None = None
    ) -> dict[str, Any]:
        """Return what ``thermid watch --once --json`` prints of a log, and ``model``, ``like`` and ``unused``.

        The last two are the record of a campaign that the log is like, and why no model is used.

        Parameters
        ----------
        path : Path         The log.
        rule : StabilityRule
        asked : dict        ``boundaries``, such as ``air=22`` in degC, and ``within`` [K].
        slowest : float     Longest time constant, where no model is there. [s]
        since : float       When conditions last changed; the beginning where it is None. [s]
        """
        model, bound = None, _Bound(BoundColumns())
        try:
            known = self._known()
            of = (path, rule.name, slowest, since, asked.get("boundaries"), asked.get("within"))
            if self._watcher is None or of != self._of or known is not self._subject:
                self._bound, self._of, self._subject, self._watcher = _bound(path, known, asked), of, known, None
            bound = self._bound
            record = whole_lines(path, lambda: bound.columns.read(path, path.stem)).trim("start" if since is None else since, "end")
            if self._watcher is None or record.times[-1] < self._at:
                more: dict[str, Any] = {} if slowest is None else {"slowest": slowest}
                self._watcher = bound.watcher(record, {"rule": rule, "within": _within(asked), **more})
            self._at, look, model = float(record.times[-1]), self._watcher.look(record), self._watcher.model
        except ThermidError as error:
            self._watcher = None
            out = {"advice": "declined", "because": error.message, "alarms": [], "nodes": {}, "assumed": []}
            return out | {"model": "", "like": "", "unused": bound.unused}
        standing = UNJUDGED if model is None else model_standing(model)
        said: dict[str, Any] = clean(add_codes({**look.as_object(), "standing": standing.to_dict()}))
        return said | {"model": "" if model is None else model.title, "like": bound.like, "unused": bound.unused}


def _within(asked: Mapping[str, Any]) -> float:
    within = asked.get("within") or WITHIN
    if isinstance(within, bool) or not isinstance(within, int | float) or not within > 0.0:
        raise RecordError("'within' is a number of kelvin above zero.", "bench")
    return float(within)


def _bound(path: Path, known: Model | Campaign | None, asked: Mapping[str, Any]) -> _Bound:
    """Return what a log is watched with: the model where the log has its nodes and everything that it needs is known."""
    given = pairs(filter(str.strip, str(asked.get("boundaries") or "").split(",")), "bench")
    said = Scenario(path.stem, boundaries={n: with_unit(t, "degC") for n, t in given.items()}) if given else None
    if known is None:
        return _Bound(BoundColumns())
    try:
        return _like_a_record(path, known, said) if isinstance(known, Campaign) else _by_names(path, known, said)
    except ThermidError as error:
        return _unused(error.message)


def _unused(why: str) -> _Bound:
    """Return what a log is watched with where its readings are all that is known."""
    return _Bound(BoundColumns(), unused=f"the model is not used: {why}")


def _by_names(path: Path, model: Model, said: Scenario | None) -> _Bound:
    """Return what a log is watched with where it has names of a deck."""
    network = compile_network(model)
    find = network.flat.names.model.canonical
    known = {find(name_and_unit(cell)[0]) for cell in log_cells(path).header}
    if not known & set(network.nodes):
        return _unused("no channel of the log has the name of one of its nodes")
    known |= {find(b) for b in said.boundaries} if said is not None else set()
    missing = [b for b in network.boundaries if b not in known]
    if missing:
        return _unused(f"the temperature of '{missing[0]}' is not known. Give it as {missing[0]}=22")
    return _Bound(BoundColumns(model=model), said)


def _like_a_record(path: Path, campaign: Campaign, said: Scenario | None) -> _Bound:
    """Return what a log is watched with where it has the columns of a record of a campaign: their meaning, and the last stage's model."""
    header = {name_and_unit(cell)[0] for cell in log_cells(path).header}
    records = campaign.source.content.records if campaign.source is not None else {}
    alike = [name for name, table in records.items() if table.channels and set(table.channels) <= header]
    if not alike:
        return _unused("the log has not the columns of one of the campaign's records")
    test = running_test(campaign, alike[0])
    columns = BoundColumns(model=test.model, options=test.options, tables=dict(test.table.channels), bound=test.bound)
    columns.remarks = test.remarks
    return _Bound(columns, said, test, like=alike[0])
