"""A log that grows: read again when it has, held against a rule of stability, and where it will end."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from thermid.app.studio.curves import Window, number_of, thinned_curve, window_of
from thermid.app.studio.live import LiveWatch, temperatures_alone, told_columns
from thermid.base.errors import DeckError, MissingDataError, RecordError, ThermidError, refuse_unknown
from thermid.base.linear_algebra import Array, Bools
from thermid.base.toml_files import project_root, resolve_inside
from thermid.base.units import unit
from thermid.measure.readers import name_and_unit, read_record
from thermid.measure.records import Channel, Record
from thermid.measure.steadiness import RULES, ChannelStability, StabilityRule, channel_stability, rule_of, since_when
from thermid.physics.constants import ICE_POINT
from thermid.qualify.steadiness import Forecast, Stability, forecast
from thermid.qualify.watch import read_whole_lines
from thermid.reporting.looks import look

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
    """Return what a column in a unit may be bound as; None where the unit is none that is known."""
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
        path, rule = self._path(str(query.get("file") or "")), rule_of(str(query.get("rule") or "3 C/h"))
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
                stabilities[n] = channel_stability(record, n, rule, since=first)
            except RecordError as error:
                why[n] = error.message
        when = {n: since_when(record, n, rule, first) if c.verdict == "stable" else None for n, c in stabilities.items()}
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
    return None if query.get(key) in (None, "") else 3600.0 * number_of(query, key)


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
    return {
        "declined": outlook.declined,
        "final": None if declined else ends[0],
        "low": ends[1],
        "high": ends[2],
        "error": None if declined else final.error,
        "holds": outlook.holds,
        "late": outlook.holds_late,
        "fan": {} if declined else _fan(outlook),
    }


def _fan(outlook: Forecast) -> dict[str, Array]:
    """Return what readings will say until the rule holds, at most twice as long as was watched: times [s], value, interval [degC]."""
    watched = outlook.now - outlook.start
    last = min(max(outlook.holds or 0.0, outlook.now + 0.5 * watched), outlook.now + 2.0 * watched)
    times = np.linspace(outlook.now, last, FAN_POINTS)
    readings = [outlook.reading(float(t)) for t in times]
    return {"times": times} | {n: np.array([getattr(r, n) for r in readings]) - ICE_POINT for n in ("value", "low", "high")}


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
        "rate": 3600.0 * c.rate,
        "error": 3600.0 * c.error,
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
