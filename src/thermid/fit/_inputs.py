"""Inputs of a run and where each comes from: every boundary, power and start of every record, what is assumed first."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from thermid.base.errors import quoted
from thermid.base.units import ICE_POINT, short
from thermid.fit._problem.experiment import Experiment, role_and_target
from thermid.fit._problem.request import Request
from thermid.fit._problem.residuals import Unknown
from thermid.measure.records import Channel
from thermid.model.tree import Signal

Source = Literal["assumed", "deck", "scenario", "log"]
SOURCES: tuple[Source, ...] = ("assumed", "deck", "scenario", "log")
"""Where an input may come from, in the order of the table: what nobody said stands first."""
NAN = float("nan")
SHORT_TAIL, SHORT_SHARE = 1.5, 1e-3
"""Usual intervals, or part of the log, that a channel may miss at either end before its held value counts as assumed: 36 s of 10 h."""
CHANNEL = "channel "
"""How the words begin of what a log gives."""


@dataclass(frozen=True)
class Input:
    """One input of one record.

    Parameters
    ----------
    record : str                Name of the record.
    kind : str                  'boundary', 'load' or 'start'; 'gas' where one is stated; 'accuracy' of a channel that states none.
    name : str                  Path of the boundary, load or node.
    source : str                'assumed', 'deck', 'scenario' or 'log'.
    words : str                 What the source is, such as the channel; of what is assumed, what was assumed and why.
    low, high, mean : float     Over the record; of a start all the same; NaN where the run itself decides. [K, W, Pa of a gas]
    fitted : bool               Whether the fit moves it.
    """

    record: str
    kind: str
    name: str
    source: Source
    words: str
    low: float = NAN
    high: float = NAN
    mean: float = NAN
    fitted: bool = False

    @property
    def partly(self) -> bool:
        """Whether a channel gives it, but not from the first to the last reading of its record."""
        return self.source == "assumed" and self.words.startswith(CHANNEL)

    @property
    def unit(self) -> str:
        """Unit for people: degC, W of a load, Pa of a gas, none of an accuracy."""
        return {"load": "W", "gas": "Pa", "accuracy": ""}.get(self.kind, "degC")

    def shown(self, value: float) -> str:
        """Return one of its numbers in its unit; a dash where there is none."""
        if not np.isfinite(value):
            return "-"
        return short(value, 3) if self.unit in ("W", "Pa") else f"{value - ICE_POINT:.1f}"

    @property
    def range(self) -> str:
        """Its range in its unit, one number where it is constant."""
        low, high = self.shown(self.low), self.shown(self.high)
        return low if low == high else f"{low} .. {high}"


@dataclass(frozen=True)
class InputTable:
    """The inputs of all records of a fit.

    Parameters
    ----------
    rows : tuple of Input   What is assumed first, then by source; in the order of the records within each.
    """

    rows: tuple[Input, ...] = field(default=())

    @classmethod
    def in_order(cls, rows: Iterable[Input]) -> InputTable:
        """Return inputs in the order of the table."""
        return cls(tuple(sorted(rows, key=lambda r: SOURCES.index(r.source))))

    @property
    def assumed(self) -> tuple[Input, ...]:
        """Those that nobody gave."""
        return tuple(r for r in self.rows if r.source == "assumed")

    @property
    def indented(self) -> str:
        """The table as text under a heading."""
        return "\n".join(f"  {line}" for line in input_lines(self.rows))

    def to_dict(self) -> list[dict[str, Any]]:
        """Return a dictionary per input, in SI."""
        keys = ("record", "kind", "name", "source", "words", "low", "high", "mean", "fitted")
        return [{k: getattr(r, k) for k in keys} for r in self.rows]

    def __str__(self) -> str:
        """A line per input; inputs of several records that differ in nothing but their numbers share one."""
        return "\n".join(input_lines(self.rows))

    @staticmethod
    def of_request(request: Request, experiments: Iterable[Experiment], unknowns: Sequence[Unknown] | None = None) -> InputTable:
        """Return the inputs of some records.

        Parameters
        ----------
        request : Request           What the fit is asked.
        experiments : iterable      The records, bound to its model.
        unknowns : sequence         What the fit looks for; without it, what the request frees.
        """
        if unknowns is None:
            free = {request.model.canonical(p) for p in request.free}
        else:
            free = {p for u in unknowns if u.kind == "parameter" for p in (u.name, *u.also)}
        rows = [
            row
            for e in experiments
            for row in (*_boundaries(request, e), *_gases(e), *_loads(e, free), *_starts(request, e), *_accuracies(e))
        ]
        return InputTable.in_order(rows)


def _accuracies(e: Experiment) -> Iterator[Input]:
    """Yield the channels of a measured record that states no accuracy at all: its instruments count as exact."""
    used = [c for c in e.record.channels.values() if c.quantity in ("temperature", "power")]
    if e.record.origin.synthetic or any(c.accuracy is not None or c.part is not None for c in used):
        return
    words = "not stated, so readings count as exact: state that of the data sheet, accuracy = '0.5 [K]'"
    yield from (Input(e.record.name, "accuracy", c.name, "assumed", words) for c in used)


def _driving(e: Experiment) -> dict[str, Channel]:
    """Return path -> channel of the boundaries and loads that the log drives."""
    channels_by_role = ((*role_and_target(e.record, c, e.network), c) for c in e.record.channels.values())
    return {path: c for role, path, c in channels_by_role if role != "node"}


def _values(e: Experiment, signal: Signal) -> tuple[float, float, float]:
    """Return lowest, highest and mean value of a signal over a record. [SI]"""
    return (*signal.bounds, signal.mean_over(0.0, e.scenario.seconds))


def _channel_source(e: Experiment, channel: Channel) -> tuple[Source, str]:
    """Return the source that a channel is: assumed where the log ends before its record does, or begins after it."""
    times = e.record.times
    inside = times[channel.valid]
    words, short_tail = [], max(SHORT_TAIL * float(np.median(np.diff(times))), SHORT_SHARE * e.record.duration)
    if inside[0] - times[0] > short_tail:
        words.append(f"no valid sample in the first {short(float(inside[0] - times[0]), 3)} s: its first value is used before")
    if times[-1] - inside[-1] > short_tail:
        words.append(f"no valid sample in the last {short(float(times[-1] - inside[-1]), 3)} s: its last value is used up to the end")
    return ("assumed", f"{CHANNEL}{channel.name}, {'; '.join(words)}") if words else ("log", f"{CHANNEL}{channel.name}")


def _boundaries(request: Request, e: Experiment) -> Iterator[Input]:
    """Yield the temperature of every boundary of an experiment with its source: channel, scenario, value per record, or assumption."""
    driving, record = _driving(e), e.record.name
    local = {_place(e, n) for n in request.locals_of(e.record) if not n.startswith("initial.")}
    readings = {_place(e, n): r.channel for n, r in request.readings.items() if not n.startswith("initial.")}
    for name, signal in e.scenario.boundaries.items():
        source: tuple[Source, str] = "scenario", ""
        if name in driving:
            source = _channel_source(e, driving[name])
        elif name in local:
            source = "scenario", "a value of this record"
        elif name in readings:
            source = "log", f"first reading of {readings[name]}"
        yield Input(record, "boundary", name, *source, *_values(e, signal), fitted=name in local)
    for name, signal in e.scenario.prescribed.items():
        yield Input(record, "boundary", name, "scenario", "prescribed", *_values(e, signal))


def _gases(e: Experiment) -> Iterator[Input]:
    """Yield the gases of an experiment that the record or its scenario states."""
    for gas, state in e.scenario.environment.items():
        source: Source = "log" if gas in e.record.environment else "scenario"
        yield Input(
            e.record.name,
            "gas",
            gas,
            source,
            f"stated with the record: {state}" if source == "log" else str(state),
            *_values(e, state.pressure),
        )


def _place(e: Experiment, name: str) -> str:
    """Return the path that a name, also ``initial.<node>``, stands for."""
    return e.network.find(name.removeprefix("initial."))


def _loads(e: Experiment, free: Collection[str]) -> Iterator[Input]:
    """Yield the loads; a constant power of the deck that neither log nor scenario nor fit gives is assumed."""
    driving, record, parameters = _driving(e), e.record.name, e.network.flat.parameters
    values = parameters.evaluate({})
    moved = parameters.evaluate({p: 1.5 * float(values[p]) + 1.0 for p in free if p in values})
    origins = {str(layer.origin) for layer in e.model.layers}
    scaled = {t.removeprefix("scale.") for t, _ in e.shared.values() if t.startswith("scale.")}
    followers = {p: {*parameters.downstream([p])} for p in map(e.model.canonical, e.scenario.schedule)}
    for row in {load.path: load for load in e.network.flat.loads}.values():
        name = row.path
        by: tuple[Source, str] = _channel_source(e, driving[name]) if name in driving else ("scenario", "")
        if name in e.scenario.loads:
            yield Input(record, "load", name, *by, *_values(e, e.scenario.loads[name]), fitted=name in scaled)
            continue
        path = e.scenario.gains.get(name, row.fields.get("power", ""))
        path = path if path in values else e.model.canonical(path)
        if path not in values:
            yield Input(record, "load", name, "deck", f"by its law in the deck ({', '.join(row.fields) or 'absorbed'})")
            continue
        power, fitted, origin = float(values[path]), float(moved[path]) != float(values[path]), parameters.table[path].origin
        if name in e.scenario.commands:
            low, high, mean = (power * x for x in _values(e, e.scenario.commands[name]))
            yield Input(record, "load", name, by[0], f"{by[1]}{' ' if by[1] else ''}times {path}", low, high, mean, fitted)
        elif by_schedule := [p for p, those in followers.items() if path in those]:
            yield Input(record, "load", name, "log" if {*by_schedule} <= {*driving} else "scenario", f"follows {quoted(by_schedule)}")
        elif set(row.fields) != {"power"}:
            yield Input(record, "load", name, "deck", f"by its law in the deck ({', '.join(row.fields)})", fitted=fitted)
        elif fitted or origin in origins or power == 0.0:
            words = "fitted here" if fitted else f"from {origin}" if origin in origins else ""
            yield Input(record, "load", name, "deck", words, power, power, power, fitted)
        else:
            if e.model.runner is not None:
                power = e.model.runner.powers.get(name, power)
                words = (
                    f"no log column gives it: the start of the FMU for the whole record. To drive it, bind a column with load = '{name}'"
                )
                yield Input(record, "load", name, "assumed", words, power, power, power)
                continue
            words = (
                f"the power of '{name}' is that of the deck for the whole record, because no log column gives it. If it was "
                f"switched, bind a column with load = '{name}'"
            )
            yield Input(record, "load", name, "assumed", words, power, power, power)


def _starts(request: Request, e: Experiment) -> Iterator[Input]:
    """Yield the starts of all nodes that store heat; those of sensors' tips follow their nodes."""
    local = {_place(e, n) for n in request.locals_of(e.record) if n.startswith("initial.")}
    readings = {**e.readings, **{_place(e, n): r.channel for n, r in request.readings.items() if n.startswith("initial.")}}
    massive = {n.path for n in e.network.flat.nodes if n.fields} - {*e.tips}
    written = request.scenario(e.record).start
    stated_starts = {e.network.find(n) for n in request.scenario(e.record).initial}
    for node in (n for n in e.network.nodes if n in massive):
        value = _number(e, e.scenario.initial.get(node, e.scenario.start))
        source: tuple[Source, str] = "scenario", f"start = '{written}'" if node not in e.scenario.initial else ""
        fitted = node in local
        if node in local:
            source = "scenario", "a value of this record"
        elif node in e.hidden:
            start, fitted = e.hidden[node], request.fit_start
            spread = f"+- {short(start.sd)} K" + ("" if fitted else ", not counted")
            source = "assumed", f"no sensor and not at rest: balance of its neighbours {spread}"
        elif node in e.loose:
            (*others, sensor), fitted = e.loose[node], request.fit_start
            words = f"mean of the first readings of {', '.join(others)} and {sensor}"
            source = "log", words if others else f"first reading of {sensor}"
        elif node in readings:
            source = "log", f"first reading of {readings[node]}"
        elif e.model.runner is not None and node not in e.model.runner.starts:
            source, value = ("deck", "follows from others in the FMU"), NAN
        elif e.model.runner is not None and written == "" and node not in stated_starts:
            source = "assumed", "no sensor: the start of the FMU"
        elif node not in e.scenario.initial and written == "":
            source = "assumed", "no sensor; the log begins at rest"
        yield Input(e.record.name, "start", node, *source, value, value, value, fitted)


def _number(e: Experiment, value: Any) -> float:
    """Return an initial temperature as a number; NaN where the run looks for it. [K]"""
    if value == "" and len(e.network.boundaries) == 1:
        value = e.network.boundaries[0]
    if isinstance(value, str):
        path = e.model.canonical(value)
        if path not in e.scenario.boundaries:
            return NAN
        return float(np.ravel(e.scenario.boundaries[path].at(np.zeros(1)))[0])
    return float(value)


def _gathered(rows: Iterable[Input]) -> list[tuple[Input, list[str], list[str]]]:
    """Return rows that differ in record, node and numbers only as one, with their names and records."""
    groups: dict[tuple[str, ...], list[Input]] = {}
    for r in rows:
        name = "" if r.kind in ("start", "accuracy") else r.name
        groups.setdefault((r.source, r.kind, name, r.words, str(r.fitted)), []).append(r)
    return [
        (_together(several), list(dict.fromkeys(r.name for r in several)), list(dict.fromkeys(r.record for r in several)))
        for several in groups.values()
    ]


def _together(rows: Sequence[Input]) -> Input:
    """Return rows as one: the widest range, the mean of the means."""
    low, high = min(r.low for r in rows), max(r.high for r in rows)
    return replace(rows[0], low=low, high=high, mean=float(np.mean([r.mean for r in rows])))


def _some(names: Sequence[str], most: int = 4) -> str:
    """Return the first of some names as text, and how many more there are."""
    return ", ".join(names) if len(names) <= most else f"{', '.join(names[: most - 1])} and {len(names) - most + 1} more"


def input_lines(rows: Iterable[Input]) -> list[str]:
    """Return the table as lines: source, kind, names, range, mean, words, records."""
    out = []
    for r, names, records in _gathered(rows):
        mean = f" (mean {r.shown(r.mean)})" if r.low != r.high and np.isfinite(r.mean) else ""
        value = f"{r.range} {r.unit}{mean}" if np.isfinite(r.low) else "-"
        words = ", ".join(w for w in (r.words, "fitted" if r.fitted and "fitted" not in r.words else "") if w)
        where = "" if len(records) == 1 else f"  [{len(records)} records]"
        out.append(f"{r.source:<8}  {r.kind:<8}  {_some(names)}: {value}{'  ' if words else ''}{words}{where}")
    return out
