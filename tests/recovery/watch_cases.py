"""Synthetic tests watched as they run: what is drawn, what may be hidden or fail, and how the watch ended.

All courses are solutions of a model with noise on them. The deck that is watched with is the truth, or off by 2 % in each value as a
calibrated one may be, or has a constant coefficient where the truth has natural convection, or is not there at all.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

import thermid as td
from thermid.base.errors import ThermidError
from thermid.measure._readers.columns import name_and_unit
from thermid.measure.readers import log_cells, read_record, temperature_columns
from thermid.measure.records import Channel, Record, StabilityRule
from thermid.model.tree import model_from_dict
from thermid.qualify._watch.stopping import STOP
from thermid.qualify.watch import GrowingLog, Stopping, Watcher, WatchLook, replayed as played
from unit.fit.estimation.rig import AIR, NOISE, Array, deck_of, logged, rig, run, scenario

RULE, WITHIN = StabilityRule.named("3 C/h"), 1.0
LATE, EVERY = 300.0, 10.0
KINDS = (
    "as the truth",
    "each value off by 2 %",
    "off by 2 %, constant film where the truth has natural convection",
    "off by 2 %, one sensor",
)
WITHOUT = "none; slowest time constant stated as three times the true one"
OFF = 0.02
VALUES = {"joint": (2.5, "W/K"), "seam": (0.8, "W/K"), "htc": (14.0, "W/(m^2 K)"), "top": (6.0, "W/(m^2 K)"), "watts": (12.0, "W")}


@dataclass(frozen=True)
class Case:
    """A test: kind, the decks of truth and watcher, sensors, noise of a reading [K], interval of the log [s], seed of its noise."""

    kind: str
    truth: dict[str, Any]
    deck: dict[str, Any] | None
    sensors: tuple[str, ...]
    noise: float
    every: float
    seed: int


@dataclass(frozen=True)
class Outcome:
    """How a watched test ended: stopped, wrongly, when [s], what part of the wait for the rule that saves, why not, and false alarms."""

    stopped: bool
    wrong: bool
    at: float
    saving: float
    because: str
    alarms: tuple[str, ...]


def drawn(seed: int, kind: str = "") -> Case:
    """Return a test with nothing hidden."""
    r = np.random.default_rng(seed)
    kind = kind or KINDS[seed % len(KINDS)]
    true = {n: v * float(np.exp(0.3 * r.normal())) for n, (v, _) in VALUES.items()}
    seen = {n: v * float(np.exp(OFF * r.normal())) for n, v in true.items()} if kind not in (KINDS[0], WITHOUT) else true
    truth = deck_of(**{n: f"{v} [{VALUES[n][1]}]" for n, v in true.items()})
    deck = deck_of(**{n: f"{v} [{VALUES[n][1]}]" for n, v in seen.items()})
    if kind == KINDS[2]:
        above = ends(truth)["case"] - 295.15
        truth["conductors"]["fins"]["htc"] = {"coefficient": f"{true['htc'] / above**0.25} [W/(m^2 K)]", "exponent": 0.25}
    sensors = ("case",) if kind == KINDS[3] else ("chip", "case")
    return Case(
        kind, truth, None if kind == WITHOUT else deck, sensors, float(r.choice([0.02, 0.05, 0.1])), float(r.choice([5, 10, 20])), seed
    )


def hiding(case: Case, at: float) -> Case:
    """Return a test with a mass behind a weak link on the case, which the deck lacks; its time constant is 3 to 10 times a time [s]."""
    r = np.random.default_rng(500_000 + case.seed)
    link, tau = r.uniform(0.05, 0.4), at * r.uniform(3.0, 10.0)
    truth = {**case.truth, "nodes": {**case.truth["nodes"]}, "conductors": {**case.truth["conductors"]}}
    truth["nodes"]["mass"] = {"capacitance": f"{link * tau} [J/K]"}
    truth["conductors"]["link"] = {"kind": "conduction", "between": ["mass", "case"], "conductance": f"{link} [W/K]"}
    return Case(case.kind, truth, case.deck, case.sensors, case.noise, case.every, case.seed)


def ends(truth: dict[str, Any]) -> dict[str, float]:
    """Return where the nodes end. [K]"""
    found = td.steady(model_from_dict(truth), td.Scenario("end", boundaries=AIR))
    return {n: float(found[n]) for n in ("chip", "case", "lid")}


def log_of(case: Case, courses: dict[str, Array]) -> Record:
    """Return the log of a test."""
    r = np.random.default_rng(900_000 + case.seed)
    size = courses["chip"].size
    made = {
        n: Channel.from_array(n, courses[n] + r.normal(0.0, case.noise, size), unit="K", column=n, noise=case.noise) for n in case.sensors
    }
    return Record.from_arrays("rig", case.every * np.arange(size), made)


def watcher(case: Case) -> Watcher:
    """Return the watcher of a test."""
    if case.deck is None:
        slow = 3.0 * float(td.simulate(model_from_dict(case.truth), scenario().with_(duration=3600.0)).time_constants[0])
        return Watcher(Stopping(RULE, WITHIN, slowest=slow), case.sensors)
    model = model_from_dict(case.deck)
    return Watcher(Stopping(RULE, WITHIN, model=model, scenario=scenario()), case.sensors, model, scenario())


def watched(case: Case) -> Outcome:
    """Watch a test until a stop, or until the plan's rule holds."""
    courses = run(model_from_dict(case.truth), 6.0 * 3600.0, {"start": "22 [degC]"}, case.every)
    true = ends(case.truth)
    record = log_of(case, courses)
    rates = np.max([np.abs(np.gradient(courses[n], case.every)) for n in case.sensors], axis=0)
    rule_at = case.every * float(np.flatnonzero(rates > RULE.rate)[-1] + 1)
    twin = watcher(case)
    look: WatchLook | None = None
    for piece in played(record.trim(0.0, rule_at), 60.0):
        look = twin.look(piece)
        if look.advice.word == STOP:
            wrong = any(abs(f.final.value - true[n]) > WITHIN for n, f in look.advice.ends.items())
            return Outcome(True, wrong, look.at, 1.0 - look.at / rule_at, "", tuple(map(str, look.alarms)))
    because, alarms = ("", ()) if look is None else (look.advice.because, tuple(map(str, look.alarms)))
    return Outcome(False, False, rule_at, 0.0, because, alarms)


def off_by_a_tenth(seed: int) -> Case:
    """Return a test whose deck is off by 10 % in each value, up or down."""
    case, r = drawn(seed, KINDS[0]), np.random.default_rng(300_000 + seed)
    true = {n: float(case.truth["parameters"][n].partition(" ")[0]) for n in VALUES}
    seen = {n: f"{v * float(np.exp(0.1 * r.choice([-1.0, 1.0])))} [{VALUES[n][1]}]" for n, v in true.items()}
    return replace(case, kind="each value off by 10 %", deck=deck_of(**seen))


def off_as_assumed(seed: int) -> Case:
    """Return a test whose deck is as far off as a watch assumes: conductances and films by 30 %, capacitances by 10 %, its power right."""
    case, r = drawn(seed, KINDS[0]), np.random.default_rng(310_000 + seed)
    true = {n: float(case.truth["parameters"][n].partition(" ")[0]) for n in VALUES}
    seen = {n: f"{v * (1.0 if n == 'watts' else float(np.exp(0.3 * r.normal())))} [{VALUES[n][1]}]" for n, v in true.items()}
    deck = deck_of(**seen)
    for node in deck["nodes"].values():
        node["capacitance"] = f"{float(node['capacitance'].partition(' ')[0]) * float(np.exp(0.1 * r.normal()))} [J/K]"
    return replace(case, kind="off as assumed", deck=deck)


def not_measured(case: Case, seconds: float) -> tuple[float, float]:
    """Return error and 95 % half-width of the lid, which has no sensor, at one look. [K]"""
    courses = run(model_from_dict(case.truth), seconds, {"start": "22 [degC]"}, case.every)
    lid = next(n for n in watcher(case).look(log_of(case, courses)).nodes if n.name == "lid")
    return lid.value - float(courses["lid"][-1]), lid.half


@dataclass(frozen=True)
class Stop:
    """When a stop is advised, or None, whether a channel then ends elsewhere than forecast, and when readings meet the rule. [s]"""

    at: float | None
    wrong: bool
    rule: float


def stop_of(case: Case, hours: float = 5.0) -> Stop:
    """Watch a test until a stop; `rule` is the first minute at which the readings of every channel meet the plan's rule. [s]"""
    courses = run(model_from_dict(case.truth), 3600.0 * hours, {"start": "22 [degC]"}, case.every)
    record, twin, true = log_of(case, courses), watcher(case), ends(case.truth)
    rule = 0.0
    for piece in played(record, 60.0):
        if not rule and piece.duration >= 300.0:
            met = all(RULE.of_channel(piece, n).verdict == "stable" for n in case.sensors)
            rule = float(piece.times[-1]) if met else 0.0
        look = twin.look(piece)
        if look.advice.word == STOP:
            open_ = "is not known" in look.advice.because
            wrong = not open_ and any(abs(f.final.value - true[n]) > WITHIN for n, f in look.advice.ends.items())
            return Stop(look.at, wrong, rule or np.inf)
    return Stop(None, False, rule or np.inf)


def planted(seed: int) -> tuple[str, Record, Array]:
    """Return what was planted (kind and suspect), the log, and by how much readings differ from the same test without it. [K]"""
    r = np.random.default_rng(700_000 + seed)
    kind = ("air fins", "joint pad", "power heater", "sensor case", "sensor chip")[seed % 5]
    at, seconds, every = 1800.0 + 300.0 * int(r.integers(0, 4)), 5400.0, EVERY
    clean = run(rig(), seconds, {"start": "22 [degC]"}, every)
    courses = {n: v.copy() for n, v in clean.items()}
    first = int(at / every)
    if kind.startswith("sensor"):
        name = kind.partition(" ")[2]
        how = int(r.integers(0, 4))
        if how == 0:
            courses[name][first:] = 273.15 + r.uniform(0.0, 20.0)
        elif how == 1:
            courses[name][first:] += r.choice([-1.0, 1.0]) * r.uniform(0.5, 2.5)
        elif how == 2:
            courses[name][first:] = np.nan
        else:
            rate = r.choice([-1.0, 1.0]) * r.uniform(3.0, 12.0) / 3600.0
            courses[name][first:] += rate * every * np.arange(courses[name].size - first)
    else:
        low = {"air fins": {"htc": f"{14 * r.uniform(0.2, 0.5)} [W/(m^2 K)]"}, "joint pad": {"joint": f"{2.5 * r.uniform(0.1, 0.4)} [W/K]"}}
        changed = low.get(kind, {"watts": f"{12 * r.uniform(0.3, 0.7)} [W]"})
        begin = {n: f"{v[first]} [K]" for n, v in clean.items()}
        after = run(rig(**changed), seconds - at, {"start": "22 [degC]", "initial": begin}, every)
        courses = {n: np.concatenate([clean[n][: first + 1], after[n][1:]]) for n in clean}
    apart = np.max([np.abs(np.nan_to_num(courses[n] - clean[n], nan=99.0)) for n in ("chip", "case")], axis=0)
    return kind, logged(courses, seed), apart


def alarmed(seed: int, every: float) -> tuple[str, float] | None:
    """Return the first alarm of a log with a planted fault, as kind, suspect and words, and the look that has it. [s]"""
    _, record, _ = planted(seed)
    model = rig()
    twin = Watcher(Stopping(RULE, WITHIN, model=model, scenario=scenario()), ("chip", "case"), model, scenario())
    for piece in played(record, every):
        if alarms := twin.look(piece).alarms:
            return str(alarms[0]), float(piece.times[-1])
    return None


def told_alike(found: tuple[str, float] | None, at_once: tuple[str, float] | None, every: float) -> bool:
    """Whether looks some time apart [s] alarm as looks a minute apart do: of the same, at the next look."""
    if found is None or at_once is None:
        return found is at_once
    return found[0] == at_once[0] and at_once[1] <= found[1] < at_once[1] + every


def named(seed: int) -> bool:
    """Whether a planted fault is named within five minutes after its effect exceeds five times the noise, at a look a minute."""
    kind, _, apart = planted(seed)
    shows = EVERY * float(np.flatnonzero(apart > 5.0 * NOISE)[0])
    found = alarmed(seed, 60.0)
    return found is not None and shows <= found[1] <= shows + LATE and kind in found[0].replace(": ", " ")


def quiet(seed: int, hours: float, every: float = 60.0) -> Iterator[WatchLook]:
    """Yield the looks at a test where nothing fails, one a minute, well beyond its end."""
    case = drawn(800_000 + seed)
    courses = run(model_from_dict(case.truth), 3600.0 * hours, {"start": "22 [degC]"}, case.every)
    twin = watcher(case)
    for record in played(log_of(case, courses), every):
        if record.times[-1] >= 600.0:
            yield twin.look(record)


@dataclass(frozen=True)
class Replay:
    """A real log that was watched: its hours times sensors, alarms, and of its stop whether later readings left the forecast."""

    name: str
    hours: float
    alarms: tuple[str, ...]
    stops: tuple[bool, ...]


def replayed(path: Path, every: float = 60.0) -> Replay | None:
    """Watch a real log by its readings alone; None where it has no temperatures over time."""
    names, record = [], None
    try:
        for name, _ in map(name_and_unit, log_cells(path).header):
            if name in temperature_columns(path) or name.lower().endswith("_c"):
                names.append(name)
        names = [n for n in names if n != "throttled"]  # a column of flags that begins with t
        record = read_record(path, {n: {"node": n, "unit": "degC"} for n in names}) if names else None
    except ThermidError:
        return None
    if record is None or record.duration < 300.0:
        return None
    kept, at = tuple(names), float(record.times[0]) + every
    twin = Watcher(Stopping(RULE, WITHIN), kept)
    stopped: WatchLook | None = None
    look: WatchLook | None = None
    while at < record.times[-1] + every:
        early = record.times <= at
        if all(np.count_nonzero(record.channel(n).valid & early) >= 10 for n in kept):
            look = twin.look(record.trim("start", min(at, float(record.times[-1]))))
            stopped = look if stopped is None and look.advice.word == STOP else stopped
        at += every
    if look is None:
        return None
    left = [] if stopped is None else [_left(record, stopped)]
    return Replay(f"{path.parent.name}/{path.name}", record.duration * len(kept) / 3600.0, tuple(map(str, look.alarms)), tuple(left))


def _left(record: Record, look: WatchLook) -> bool:
    """Whether the last twentieth of a log lies beyond what a stop forecast, by more than was asked for."""
    late = record.times > record.times[-1] - 0.05 * record.duration
    for name, f in look.advice.ends.items():
        c = record.channel(name)
        mean = float(c.values[late & c.valid].mean())
        low, high = sorted((f.latest, f.final.value))
        if not low - WITHIN <= mean <= high + WITHIN:
            return True
    return False


@dataclass(frozen=True)
class Grown:
    """A growing log at one look: hours, rows written, rows kept, processor time of reading and looking [s], alarms up to then."""

    hours: float
    rows: int
    kept: int
    seconds: float
    alarms: tuple[str, ...]


def growing(folder: Path, hours: float, every: float = 60.0) -> Iterator[Grown]:
    """Watch a text log that grows by a reading of two sensors a second, a look a minute; nothing fails."""
    case = drawn(0)
    model = model_from_dict(case.deck or {})
    r = np.random.default_rng(7)
    path = folder / "bench.csv"
    levels = {n: v for n, v in run(model, 4.0 * 3600.0, {"start": "22 [degC]"}, 1.0).items() if n in case.sensors}
    last = {n: v[-1] for n, v in levels.items()}
    path.write_text("time_s," + ",".join(f"{n} [degC]" for n in case.sensors) + "\n", encoding="utf-8")
    log = GrowingLog(path, lambda p: read_record(p, {n: {"node": n, "noise": f"{case.noise} [K]"} for n in case.sensors}, name="bench"))
    twin = watcher(case)
    for begin in np.arange(0.0, 3600.0 * hours, every):
        times = np.arange(begin, begin + every)
        columns = [
            np.array([v[int(t)] if t < v.size else last[n] for t in times]) - 273.15 + r.normal(0.0, case.noise, times.size)
            for n, v in levels.items()
        ]
        with path.open("a", encoding="utf-8") as file:
            file.writelines(f"{t:.0f},{a:.3f},{b:.3f}\n" for t, a, b in zip(times, *columns, strict=True))
        begun = process_time()
        record = log.record()
        assert record is not None
        look = twin.look(record)
        yield Grown((begin + every) / 3600.0, int(begin + every), record.times.size, process_time() - begun, tuple(map(str, look.alarms)))
