"""A log that is followed, watched as `thermid watch` does: when the test may stop, what went wrong, nodes that nobody measures."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from thermid.base.codes import add_codes
from thermid.base.errors import RecordError, ThermidError
from thermid.base.results import clean
from thermid.base.units import TEMPERATURE
from thermid.campaign.stages import Campaign, running_test
from thermid.measure.amounts import pairs, with_unit
from thermid.measure.readers import log_cells, name_and_unit
from thermid.measure.steadiness import StabilityRule
from thermid.model.elements import UNJUDGED, literal
from thermid.model.tree import Model
from thermid.qualify.watch import BoundColumns, TemperatureLimit, Watcher, WatchRequest, roles_of_paths
from thermid.simulation.network import compile_network
from thermid.simulation.runs import Scenario
from thermid.values.store import model_standing

WATCHED_ROLES = ("node", "boundary", "load")
"""What a column of a running log may be bound to."""
DEFAULT_MAX_HALF_WIDTH = 1.0
"""Half of the interval of where a channel ends, at most, where the page asks for none. [K]"""


Tables = dict[str, dict[str, str]]


def told_columns(asked: Mapping[str, Any]) -> Tables:
    """Return column -> its table as in a campaign, of those that were bound to something on the page.

    Raises
    ------
    RecordError   When that is no table of texts.
    """
    told = asked.get("channels") or {}
    if not (isinstance(told, dict) and all(isinstance(t, dict) and all(isinstance(v, str) for v in t.values()) for t in told.values())):
        raise RecordError("'channels' is a table for each column, of texts.", "bench", code="value.wrong-kind")
    return {n: t for n, t in told.items() if any(t.get(role) for role in WATCHED_ROLES)}


def temperatures_alone(channels: Mapping[str, Any]) -> dict[str, Any]:
    """Return the tables of what is bound to nodes and boundaries, each as a node of its own name."""
    warm = {n: t for n, t in channels.items() if isinstance(t, str) or {"node", "boundary"} & set(t)}
    return {n: t if isinstance(t, str) else {"node": n} | ({"unit": t["unit"]} if "unit" in t else {}) for n, t in warm.items()}


def _as_told(channels: Mapping[str, Any], told: Tables) -> dict[str, Any]:
    """Return the tables of a record with what was bound on the page in their place; noise and the like stay."""
    stated = {n: channels[n] for n in told if isinstance(channels.get(n), dict)}
    return {n: {k: v for k, v in stated.get(n, {}).items() if k not in WATCHED_ROLES} | t for n, t in told.items()} or dict(channels)


@dataclass(frozen=True)
class _Bound:
    """What a log is watched by, and in words of which record it is like, or why no model is used."""

    request: WatchRequest
    like: str = ""
    unused: str = ""


class LiveWatch:
    """The watcher of the log that is looked at, kept from look to look.

    Parameters
    ----------
    known : callable    Returns the model of the project, or its campaign once all stages are done; None where there is neither.
    """

    def __init__(self, subject: Callable[[], Model | Campaign | None]) -> None:
        self._known = subject
        self._of: tuple[Any, ...] | None = None
        self._subject: Model | Campaign | None = None
        self._bound: _Bound
        self._watcher: Watcher | None = None
        self._begin = self._end = 0.0

    def roles(self) -> dict[str, str]:
        """Return what columns may be bound to: path -> node, boundary or load; nothing where there is no model yet."""
        try:
            known = self._known()
            model = known[list(known)[-1]].model if isinstance(known, Campaign) else known
            return {} if model is None else roles_of_paths(compile_network(model))
        except ThermidError:
            return {}

    def look(
        self, path: Path, rule: StabilityRule, query: Mapping[str, Any], slowest: float | None = None, since: float | None = None
    ) -> dict[str, Any]:
        """Return what ``thermid watch --look once --json`` prints of a log, and ``model``, ``like``, ``unused`` and ``bound``.

        The last three are the record of a campaign that the log is like, why no model is used, and what the columns are.

        Parameters
        ----------
        path : Path         The log.
        rule : StabilityRule
        query : dict        ``boundaries`` and ``limits``, such as ``air=22`` in degC, ``within`` [K], and ``channels`` as in a campaign.
        slowest : float     Longest time constant, where no model is there. [s]
        since : float       When conditions last changed; the beginning where it is None. [s]
        """
        model, unused = None, ""
        try:
            subject = self._known()
            of = (path, rule.name, slowest, since, *(query.get(k) for k in ("boundaries", "within", "limits", "channels")))
            if self._watcher is None or of != self._of or subject is not self._subject:
                self._watcher, bare = None, _bare(rule, query, slowest, since)
                self._bound, self._of, self._subject = _bound(path, subject, query, bare), of, subject
            unused = self._bound.unused
            record = self._bound.request.read(path)
            begin, end = float(record.times[0]), float(record.times[-1])
            if self._watcher is None or begin != self._begin or end < self._end:
                self._watcher = self._bound.request.watcher(record)
            self._begin, self._end = begin, end
            look, model = self._watcher.look(record), self._watcher.model
        except ThermidError as error:
            self._watcher = None
            out = {"advice": "declined", "because": error.message, "alarms": [], "nodes": {}, "assumed": []}
            return out | {"model": "", "like": "", "unused": unused, "bound": told_columns(query)}
        standing = UNJUDGED if model is None else model_standing(model)
        content: dict[str, Any] = clean(add_codes({**look.as_object(), "standing": standing.to_dict()}))
        return content | {
            "model": "" if model is None else model.title,
            "like": self._bound.like,
            "unused": unused,
            "bound": self._bound.request.columns.tables,
        }


def _within(query: Mapping[str, Any]) -> float:
    within = query.get("within") or DEFAULT_MAX_HALF_WIDTH
    if isinstance(within, bool) or not isinstance(within, int | float) or not within > 0.0:
        raise RecordError("'within' is a number of kelvin above zero.", "bench", code="value.outside-range")
    return float(within)


def _temperatures(body: Mapping[str, Any], key: str) -> dict[str, str]:
    """Return name -> temperature with its unit, of a text such as ``air=22, plate=30``."""
    return {n: with_unit(t, "degC") for n, t in pairs(filter(str.strip, str(body.get(key) or "").split(",")), "watch").items()}


def _bare(rule: StabilityRule, body: Mapping[str, Any], slowest: float | None, since: float | None) -> WatchRequest:
    """Return how a log is watched where its readings are all that is known."""
    limits = tuple(TemperatureLimit(n, False, literal(t, TEMPERATURE, "limit")) for n, t in _temperatures(body, "limits").items())
    return WatchRequest(
        BoundColumns(tables=temperatures_alone(told_columns(body))),
        rule,
        _within(body),
        limits,
        slowest=slowest,
        since="start" if since is None else since,
    )


def _bound(path: Path, subject: Model | Campaign | None, query: Mapping[str, Any], bare: WatchRequest) -> _Bound:
    """Return what a log is watched by: the model where the log has its nodes and everything that it needs is known."""
    boundaries = _temperatures(query, "boundaries")
    stated = Scenario(path.stem, boundaries=boundaries) if boundaries else None
    if subject is None:
        return _Bound(bare)
    try:
        told = told_columns(query)
        return (
            _like_a_record(path, subject, stated, bare, told)
            if isinstance(subject, Campaign)
            else _by_names(path, subject, stated, bare, told)
        )
    except ThermidError as error:
        return _without_model(bare, error.message)


def _without_model(bare: WatchRequest, why: str) -> _Bound:
    """Return what a log is watched by where its readings are all that is known."""
    return _Bound(bare, unused=f"the model is not used: {why}")


def _by_names(path: Path, model: Model, stated: Scenario | None, bare: WatchRequest, told: Tables) -> _Bound:
    """Return what a log is watched by where its columns were bound, or have names of a deck."""
    network = compile_network(model)
    find = network.flat.names.model.canonical
    bound = [t[role] for t in told.values() for role in WATCHED_ROLES if role in t]
    known = {find(name) for name in bound or [name_and_unit(cell)[0] for cell in log_cells(path).header]}
    if not known & set(network.nodes):
        return _without_model(bare, "no channel of the log has the name of one of its nodes. Bind the columns")
    known |= {find(b) for b in stated.boundaries} if stated is not None else set()
    missing = [b for b in network.boundaries if b not in known]
    if missing:
        return _without_model(bare, f"the temperature of '{missing[0]}' is not known. Give it as {missing[0]}=22")
    return _Bound(replace(bare, columns=BoundColumns(model=model, tables=told), scenario=stated))


def _like_a_record(path: Path, campaign: Campaign, stated: Scenario | None, bare: WatchRequest, told: Tables) -> _Bound:
    """Return what a log is watched by where it has the columns of a record of a campaign: as `running_test` says."""
    written = log_cells(path).header
    header = {*written, *(name_and_unit(cell)[0] for cell in written)}
    records = campaign.source.content.records if campaign.source is not None else {}
    # columns of a power that no column holds are looked for where it is read
    columns_of_records = {
        name: {t if isinstance(t, str) else n for n, t in r.channels.items() if "power" not in t} for name, r in records.items()
    }
    alike = [name for name, columns in columns_of_records.items() if columns and columns <= header]
    if not alike and told:
        return _by_names(path, campaign[list(campaign)[-1]].model, stated, bare, told)
    if not alike:
        return _without_model(bare, "the log has not the columns of one of the campaign's records. Bind the columns")
    last = next(s.records for s in campaign.source.content.stages if s.name == list(campaign)[-1]) if campaign.source is not None else ()
    like = max(alike, key=lambda name: (name in last, len(records[name].channels)))  # whose columns are those of the model
    test = running_test(campaign, like)
    tables = _as_told(test.table.channels, told)
    columns = BoundColumns(model=test.model, options=test.options, tables=tables, bound=test.bound, remarks=test.remarks)
    return _Bound(replace(bare, columns=columns, scenario=stated, conditions=test.conditions), like)
