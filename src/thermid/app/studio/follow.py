"""A log that grows: read again when it has, held against a rule of stability, watched as `thermid watch` does, and where it will end."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from thermid.app.studio.desk import Window, number_of, thinned_curve, window_of
from thermid.app.texts import add_codes, pairs, with_unit
from thermid.base.errors import DeckError, MissingDataError, RecordError, ThermidError, refuse_unknown
from thermid.base.files import project_root, resolve_inside
from thermid.base.results import clean
from thermid.base.units import HOUR, ICE_POINT, TEMPERATURE, Array, Bools, unit
from thermid.campaign.stages import Campaign, RunningTest
from thermid.measure.looks import look
from thermid.measure.readers import log_cells, name_and_unit, read_record
from thermid.measure.records import RULES, Channel, ChannelStability, Record, StabilityRule
from thermid.model.tree import UNJUDGED, Model, literal
from thermid.qualify.steadiness import Stability, forecast
from thermid.qualify.watch import BoundColumns, TemperatureLimit, Watcher, WatchRequest, read_whole_lines, roles_of_paths
from thermid.simulation.runs import Scenario, compile_network

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
        standing = UNJUDGED if model is None else model.standing
        content: dict[str, Any] = clean(add_codes({**look.as_object(), "standing": standing.to_dict()}))
        return content | {
            "model": "" if model is None else model.title,
            "like": self._bound.like,
            "unused": unused,
            "bound": self._bound.request.columns.tables,
        }


def _within(query: Mapping[str, Any]) -> float:
    """Return half of the interval of where a channel ends, at most, as a page asks for it. [K]"""
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
    """Return what a log is watched by where it has the columns of a record of a campaign: as `RunningTest.of_campaign` says."""
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
    test = RunningTest.of_campaign(campaign, like)
    # what was bound on the page stands in place of the record's own; noise and the like stay
    written_tables = {n: t for n in told if isinstance(t := test.table.channels.get(n), dict)}
    tables: dict[str, Any] = {
        n: {k: v for k, v in written_tables.get(n, {}).items() if k not in WATCHED_ROLES} | t for n, t in told.items()
    } or dict(test.table.channels)
    columns = BoundColumns(model=test.model, options=test.options, tables=tables, bound=test.bound, remarks=test.remarks)
    return _Bound(replace(bare, columns=columns, scenario=stated, conditions=test.conditions), like)


KINDS = ("*.csv", "*.log", "*.txt", "*.tsv", "*.csv.gz")
OFFERED = 200
BUDGET = 1.5
"""Time that forecasts of one look may take; the channel looked at comes first. [s]"""
FAN_POINTS = 24
"""Times for which a forecast is drawn."""
BREAK = 5.0
"""A time between samples that is so many times the usual one is drawn as a gap."""


_ROLES: Final = {"K": ("node", "boundary"), "W": ("load",), "1": ("load", "command")}
"""Unit -> what a column of its kind may be bound as."""


def looked_at(path: Path, time: str | None = None) -> dict[str, Any]:
    """Return what `thermid look` says of a log: its columns with what they look like and why, its rows, questions, volts and amperes.

    Each column has its `roles`, what it may be bound as; its unit is `assumed` where its heading has none in so many words, and `open` then
    and where nobody knows it: somebody may say another one.
    """
    found = look(path, time=time)
    out = found.as_object()
    for column, of in zip(out["columns"], found.columns, strict=True):
        roles, assumed = _roles(of.unit), bool(of.unit) and name_and_unit(of.header)[1] is None
        column |= {"roles": _ANY if roles is None else roles, "open": assumed or roles is None, "assumed": assumed}
    return out | {"supplies": {name: [c.name for c in pair] for name, pair in found.supplies.items()}}


_ANY: Final = ("node", "boundary", "load", "command")


def _roles(text: str) -> tuple[str, ...] | None:
    """Return what a column in a unit may be bound as, such as ("node", "boundary") for K; () where nothing takes such a unit.

    None where the text is empty or no known unit.
    """
    try:
        of = unit(text).dimension if text.strip() else None
    except ThermidError:
        of = None
    return None if of is None else next((roles for slot, roles in _ROLES.items() if of == unit(slot).dimension), ())


@dataclass
class _CachedForecasts:
    """Forecasts, which take longer than all else, kept for a while."""

    of: tuple[Any, ...]
    told: dict[str, dict[str, Any]]
    end: float
    made: float
    took: float
    behind: bool = False

    @property
    def due(self) -> bool:
        """Whether they may be made again: they take a fifth of the time at most."""
        return time.monotonic() - self.made > 4.0 * self.took


class Follower:
    """Logs of one project.

    Parameters
    ----------
    folder : Path       Of the deck or campaign; only files of its project are opened from the page.
    log : Path or None  A file that was named on the command line, wherever it lies.
    live : LiveWatch    What watches the log that is looked at; without one by its readings alone.
    """

    def __init__(self, folder: Path, log: Path | None = None, live: LiveWatch | None = None) -> None:
        self.folder, self.log = folder, log
        self._live = live or LiveWatch(lambda: None)
        self._kept: _CachedForecasts | None = None
        self._columns: tuple[Path, list[dict[str, Any]]] | None = None

    def offered(self) -> dict[str, Any]:
        """Return the logs that may be followed, newest first, and the rules that there are."""
        root = project_root(self.folder)
        logs = [f for kind in KINDS for depth in ("", "*/", "*/*/") for f in self.folder.glob(depth + kind)]
        inside = sorted((f for f in set(logs) if f.is_file() and f.resolve().is_relative_to(root)), key=lambda f: -f.stat().st_mtime)
        rules = [{"name": r.name, "source": r.source, "mark": r.mark} for r in RULES.values() if not r.stored]
        names = [f.relative_to(self.folder).as_posix() for f in inside[:OFFERED]]
        return {"given": None if self.log is None else self.log.name, "logs": names, "rules": rules}

    def look(self, query: Mapping[str, Any]) -> dict[str, Any]:
        """Return how a log stands; ``{"same": ...}`` where nothing has come since `version`.

        Parameters
        ----------
        query : dict    ``file`` (empty for the one of the command line), ``rule``, ``since`` and ``slowest`` [h], ``reference``,
                        ``channel`` that is looked at, ``window`` [s], ``known``; and what `LiveWatch` takes.

        Raises
        ------
        ThermidError    When the file is none of the project's, or rule, channel or time make no sense.
        """
        path, rule = self._path(str(query.get("file") or "")), StabilityRule.named(str(query.get("rule") or "3 C/h"))
        try:
            stat = path.stat()
        except OSError:
            return {"waiting": f"The file '{path.name}' does not exist yet.", "known": ""}
        version, age = f"{stat.st_mtime_ns} {stat.st_size}", max(time.time() - stat.st_mtime, 0.0)
        due = self._kept is None or self._kept.due
        if query.get("known") == version and not (due and self._kept is not None and self._kept.behind):
            return {"same": True, "known": version, "age": age}
        begun, before, told = time.monotonic(), self._kept, temperatures_alone(told_columns(query))
        slowest, since = _hours(query, "slowest"), _hours(query, "since")
        table: dict[str, Any] = {"known": version, "age": age}
        try:
            table |= {"columns": self._looked(path), "roles": self._live.roles()}
            watched = self._live.look(path, rule, query, slowest, since)
            warm = (c for c in table["columns"] if c["guess"] in ("temperature", "boundary"))
            tables = told or temperatures_alone(watched["bound"]) or {c["name"]: {"node": c["name"], "unit": c["unit"]} for c in warm}
            if not tables:
                return {"waiting": "No column is recognised as a temperature. Say in the table of columns what each is."} | table
            record = read_whole_lines(path, lambda p: read_record(p, tables))
        except (MissingDataError, RecordError) as error:
            return {"waiting": f"Nothing to show yet: {error.message}"} | table
        out = self._curves_and_forecasts(record, rule, query) | {"watch": watched} | table
        spent = self._kept.took if self._kept is not None and self._kept is not before else 0.0
        return out | {"file": path.name, "known": version, "age": age, "seconds": time.monotonic() - begun - spent}

    def _looked(self, path: Path) -> list[dict[str, Any]]:
        """Return the columns of a log as they were when it was first looked at: name, unit, what they look like and why."""
        if self._columns is None or self._columns[0] != path:
            self._columns = path, looked_at(path)["columns"]
        return [c for c in self._columns[1] if c["guess"] != "time"]

    def _path(self, name: str) -> Path:
        """Return the log that a page names, or that of the command line."""
        if not name:
            if self.log is None:
                raise DeckError("no log is open. Choose one of the project, or start with --log FILE.", "bench", code="studio.not-now")
            return self.log
        return resolve_inside(self.folder, name, "bench")

    def _curves_and_forecasts(self, record: Record, rule: StabilityRule, query: Mapping[str, Any]) -> dict[str, Any]:
        """Return curves, stability and forecasts of a log."""
        window, reference = window_of(query), str(query.get("reference") or "")
        since = _hours(query, "since")
        names = [n for n in record.channels if n != reference]
        refuse_unknown([reference] if reference else (), record.channels, record.name, "unknown channel '{}'.")
        stabilities: dict[str, ChannelStability] = {}
        why: dict[str, str] = {}
        first = float(record.times[0]) if since is None else since
        for n in names:
            try:
                stabilities[n] = rule.of_channel(record, n, since=first)
            except RecordError as error:
                why[n] = error.message
        when = {n: rule.since_when(record, n, first) if c.verdict == "stable" else None for n, c in stabilities.items()}
        whole = Stability(record.name, rule, float(record.times[-1]), stabilities, {}, when, None) if stabilities else None
        focus = str(query.get("channel") or "") or (whole.slowest if whole else names[0])
        cached = self._forecasts(record, sorted(names, key=lambda n: n != focus), rule, query)
        shown = [_channel(record.channels[n], record.times, window) | _words(n, stabilities, why, when) for n in record.channels]
        for c in shown:
            c["forecast"] = cached.told.get(c["name"])
        return {
            "rows": int(record.times.size),
            "begin": float(record.times[0]),
            "end": float(record.times[-1]),
            "step": record.step,
            "rule": {"name": rule.name, "source": rule.source, "mark": rule.mark},
            "forecast_at": cached.end,
            "slowest": whole.slowest if whole else None,
            "verdict": _verdict(whole, why, names),
            "channels": shown,
            "reference": reference,
            "synthetic": record.origin.synthetic,
            "notes": list(record.steps),
        }

    def _forecasts(self, record: Record, order: list[str], rule: StabilityRule, query: Mapping[str, Any]) -> _CachedForecasts:
        """Return where channels will end; what was worked out a moment ago where it is too soon to do so again."""
        of = (record.origin.file, rule.name, order[0], *(query.get(k) for k in ("since", "slowest", "reference", "channel", "channels")))
        end, cached = float(record.times[-1]), self._kept
        if cached is not None and cached.of == of and (not cached.due or cached.end == end):
            cached.behind = cached.end != end
            return cached
        begun = time.monotonic()
        forecasts = {n: _forecast(record, n, rule, query, begun) for n in order}
        self._kept = _CachedForecasts(of, forecasts, end, time.monotonic(), time.monotonic() - begun)
        return self._kept


def _hours(query: Mapping[str, Any], key: str) -> float | None:
    """Return a time that a page gives in hours; None where it gives none. [s]"""
    return None if query.get(key) in (None, "") else HOUR * number_of(query, key)


def _forecast(record: Record, name: str, rule: StabilityRule, query: Mapping[str, Any], begun: float) -> dict[str, Any]:
    """Return where a channel will end, or why that is not said."""
    if time.monotonic() - begun > BUDGET:
        return {"declined": "Not computed, to save time. Choose this channel to compute it.", "final": None, "open": True}
    since, slowest = _hours(query, "since"), _hours(query, "slowest")
    reference = str(query.get("reference") or "")
    try:
        outlook = forecast(record, name, since="start" if since is None else since, rule=rule, reference=reference, slowest=slowest)
    except ThermidError as error:
        return {"declined": error.message, "final": None}
    final, declined = outlook.final, bool(outlook.declined)
    ends = [v - ICE_POINT for v in (final.value, final.low, final.high)]
    fan: dict[str, Array] = {}  # what readings will say until the rule holds, at most twice as long as was watched [degC]
    if not declined:
        watched = outlook.now - outlook.start
        last = min(max(outlook.holds or 0.0, outlook.now + 0.5 * watched), outlook.now + 2.0 * watched)
        times = np.linspace(outlook.now, last, FAN_POINTS)
        readings = [outlook.reading(float(t)) for t in times]
        fan = {"times": times} | {n: np.array([getattr(r, n) for r in readings]) - ICE_POINT for n in ("value", "low", "high")}
    return {
        "declined": outlook.declined,
        "final": None if declined else ends[0],
        "low": ends[1],
        "high": ends[2],
        "error": None if declined else final.error,
        "holds": outlook.holds,
        "late": outlook.holds_late,
        "fan": fan,
    }


def _channel(channel: Channel, times: Array, window: Window) -> dict[str, Any]:
    """Return the readings of one channel, faulty ones and silences as gaps with their reasons."""
    celsius = np.where(channel.valid, channel.values - ICE_POINT, np.nan)
    usual = float(np.median(np.diff(times)))
    silent = np.flatnonzero(np.diff(times) > BREAK * usual)
    at = np.insert(times, silent + 1, 0.5 * (times[silent] + times[silent + 1])) if silent.size else times
    drawn = np.insert(celsius, silent + 1, np.nan) if silent.size else celsius
    shown, values = thinned_curve(at, drawn, window)
    valid = np.flatnonzero(channel.valid)
    last = int(valid[-1]) if valid.size else None
    gaps = [(float(times[a]), float(times[b]), why, b - a + 1) for why, mask in channel.masks.items() for a, b in _runs(mask)]
    gaps += [(float(times[k]), float(times[k + 1]), "nothing came", 0) for k in silent]
    return {
        "name": channel.name,
        "times": shown,
        "values": values,
        "latest": None if last is None else float(celsius[last]),
        "latest_at": None if last is None else float(times[last]),
        "gaps": [{"from": a, "to": b, "why": why, "count": int(n)} for a, b, why, n in sorted(gaps)],
    }


def _runs(mask: Bools) -> list[tuple[int, int]]:
    """Return first and last place of every run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(int)))
    return [(int(a), int(b) - 1) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _words(
    name: str, stabilities: Mapping[str, ChannelStability], why: Mapping[str, str], when: Mapping[str, float | None]
) -> dict[str, Any]:
    """Return how a channel stands by the rule, in words and numbers. [K/h]"""
    c = stabilities.get(name)
    if c is None:
        return {
            "verdict": "too early" if name in why else "reference",
            "why": why.get(name, ""),
            "rate": None,
            "error": None,
            "since": None,
        }
    return {
        "verdict": c.verdict,
        "why": "",
        "rate": HOUR * c.rate,
        "error": HOUR * c.error,
        "over": c.end - c.start,
        "since": when[name],
    }


def _verdict(whole: Stability | None, why: Mapping[str, str], names: list[str]) -> dict[str, str]:
    """Return how the log stands as a sentence, with a word that a mark can stand for."""
    if whole is None:
        return {"word": "too early", "text": next(iter(why.values()), "The log has no temperature.")}
    word = "cannot tell" if why and whole.stable else whole.verdict
    c, settled = whole.channels[whole.slowest], sum(x.verdict == "stable" for x in whole.channels.values())
    span = f"{(c.end - c.start) / 60.0:.3g} min"
    text = f"by '{whole.rule.name}'. Slowest: {whole.slowest}, {3600.0 * c.rate:+.2f} ± {3600.0 * c.error:.2f} K/h over the last {span}. "
    text += f"{settled} of {len(names)} channels settled"
    begun = [t for t in whole.since.values() if t is not None]
    text += f", all since {max(begun) / 3600.0:.2f} h." if word == "stable" and begun else "."
    return {
        "word": word,
        "text": text + ("" if whole.decides else " The number of this rule is quoted from memory, so it is not used for a verdict."),
    }
