"""Real runs, a kind left out at a time, judged by their readings: those of `runs`, and boards of another maker.

A rule is here what predicts a record: `predict_record`, or one with its arguments whose result has bands as it has.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import thermid as td
from thermid.fit.calibration import Calibration, LocalSpec, Request, fit, priors_of
from thermid.prediction.bands import RecordPrediction, predict_record

from . import runs as rr, scores as s
from .runs import ROOT
from .tasks import stratum

Array = np.ndarray
BOARDS = ("2nd_order_mimo", "energy_balance_mimo", "mhe_linear")
"""Ten, ten and five minutes of both heaters by the board's designer: boards of one kind, at other times."""
KNOWN = {
    **{f"{h}.tau": "25.7 [s]" for h in ("h1", "h2")},
    **{f"{h}.to_board": "0.0039 [W/K]" for h in ("h1", "h2")},
    "between": "0.0042 [W/K]",
    "to_room": "0.0165 [W/K]",
    "pcb.capacitance": "16.5 [J/K]",
}
"""Means of priors of 30 %: what the Sao Paulo board taught (examples/tclab/campaign_apmonitor.toml)."""


def apmonitor(data: Path, bands: rr.Bands = predict_record) -> rr.RealSet:
    """Return the logs of the designer's boards: each judged by a fit of the two others."""
    model = td.load_model(ROOT / "examples" / "tclab" / "board.toml")
    start = td.Scenario("run", start="T1_C", initial={"h2.body": "T2_C", "h2.sensor": "T2_C"})
    free = ("h1.alpha", "h2.alpha", *KNOWN)
    priors = {path: (mean, "30 [%]") for path, mean in KNOWN.items()}

    def record(name: str) -> td.Record:
        channels = {"Q1_pct": {"command": "h1.heater"}, "Q2_pct": {"command": "h2.heater"}}
        channels |= {"T1_C": {"node": "h1.sensor", "noise": "0.3 [K]"}}
        channels |= {"T2_C": {"node": "h2.sensor", "noise": "0.3 [K]", "accuracy": "1 [K]"}}
        raw = td.read_record(data / "tclab_apmonitor_arduino" / f"{name}.csv", channels, time="time_s", name=name)
        return raw.prepare([{"resample": "5 [s]"}])

    def fitted(names: Sequence[str]) -> Calibration:
        own = {n: {"room": LocalSpec("T1_C", 0.5)} for n in names}
        asked = Request(
            model, tuple(record(n) for n in names), free, {"*": start}, {}, own, untie=True, loss="soft_l1", loss_scale=5.0, name="board"
        )
        return fit(replace(asked, priors=priors_of(model, priors, "board")))

    def predicted(found: Calibration, name: str, mode: str) -> RecordPrediction:
        if mode == "room fitted":
            return bands(found, record(name), scenario=start, local={"room": {"start": "22.5 [degC]", "sd": "2 [K]"}})
        return bands(found, record(name), scenario=start, readings={"room": "T1_C"})

    return rr.RealSet("tclab_apmonitor", {n: [n] for n in BOARDS}, ("room fitted", "first readings"), fitted, predicted, record)


REAL_SETS: dict[str, Callable[..., rr.RealSet]] = {
    "lhs1": rr.lhs1,
    "motor": rr.motor,
    "tclab_apmonitor": apmonitor,
    "tclabsp": rr.tclabsp,
}
BANDS: dict[str, rr.Bands] = {"today": predict_record}
"""Rules that predict records, by name."""


def _mean_power(record: td.Record) -> float:
    """Return what the heaters of a record were told on average, in its own units; zero where nothing was told."""
    told = [c for c in record.channels.values() if c.role in ("load", "command")]
    return float(np.sum([np.mean(c.values[c.valid]) for c in told])) if told else 0.0


def _strata(real: rr.RealSet) -> dict[str, str]:
    """Return run -> its stratum, from the logs alone: mean power beside those of the other kinds; gas or unit where they differ."""
    means = {n: _mean_power(real.record(n)) for names in real.kinds.values() for n in names}
    out = {}
    for kind, names in real.kinds.items():
        others = [means[n] for k, several in real.kinds.items() if k != kind for n in several if means[n] > 0.0]
        for n in names:
            known = means[n] > 0.0 and others
            ratio = max(means[n] / max(others), min(others) / means[n], 1.0) if known else 1.0
            out[n] = stratum(ratio, 0.0, gas=real.name == "lhs1", swapped=real.name == "tclab_apmonitor")
    return out


def _readings(record: td.Record) -> dict[str, Array]:
    """Return sensor -> its readings. [K]"""
    return {n: c.values[c.valid] for n, c in record.channels.items() if c.role == "node"}


def _rows_of(run: rr.Run, names: dict[str, Any], range_of: Mapping[str, tuple[float, float]], own: Mapping[str, Array]) -> list[s.Row]:
    """Return the row of a run, its sensors one after the other; a refusal has the range of the fitted readings."""
    if run.refused:
        off = [own[n] - 0.5 * (low + high) for n, (low, high) in range_of.items() if n in own]
        half = [np.full(own[n].shape, 0.5 * (high - low)) for n, (low, high) in range_of.items() if n in own]
    else:
        off, half = list(run.off), list(run.half)
    length = min(o.size for o in off)  # each sensor weighs the same
    pick = [np.unique(np.linspace(0, o.size - 1, length).round().astype(int)) for o in off]
    both = [np.concatenate([x[p] for x, p in zip(several, pick, strict=True)]) for several in (off, half)]
    return [s.scored(both[0], both[1], refused=bool(run.refused), **names)]


def real_rows(name: str, data: Path, rules: Sequence[str], hindsight: str) -> list[s.Row]:
    """Return the rows of a set under rules, of persistence, and of the constant width of hindsight about the first rule."""
    rows: list[s.Row] = []
    chosen = [r for r in rules if r in BANDS]
    offs: dict[str, list[tuple[Array, s.Row]]] = {}
    real = REAL_SETS[name](data)
    strata = _strata(real)
    logs = {n: _readings(real.record(n)) for names in real.kinds.values() for n in names}
    for kind, names in real.kinds.items():
        found = real.without(kind)
        others = [logs[n] for k, several in real.kinds.items() if k != kind for n in several]
        sensors = list(dict.fromkeys(c for one in others for c in one))
        span = {c: _span([one[c] for one in others if c in one]) for c in sensors}
        moved = {c: float(np.quantile(np.concatenate([np.abs(one[c] - one[c][0]) for one in others if c in one]), 0.95)) for c in sensors}
        for n in names:
            for mode in real.modes:
                tags: dict[str, Any] = {"set": f"{name}, {mode}", "stratum": strata[n], "unit": n, "run": f"{n}, {mode}", "sensor": "all"}
                tags |= {"variance": float(np.mean([x.var() for x in logs[n].values()]))}
                for rule in chosen:
                    asked = REAL_SETS[name](data, BANDS[rule]) if rule != "today" else real
                    run = asked.run(n, mode, found)
                    made = _rows_of(run, {**tags, "rule": rule}, span, logs[n])
                    rows += made
                    if rule == chosen[0] and not run.refused:
                        offs.setdefault(tags["set"], []).append((np.concatenate(run.off), made[0]))
                held = [logs[n][c] - logs[n][c][0] for c in sensors if c in logs[n]]
                widths = [np.full(logs[n][c].shape, moved[c]) for c in sensors if c in logs[n]]
                still = rr.Run(tuple(held), tuple(widths))
                rows += _rows_of(still, {**tags, "rule": "persistence"}, span, logs[n])
        print(f"{name}, without {kind}: {len(names)} runs", file=sys.stderr, flush=True)
    for several in offs.values():
        rows += s.constant_of_hindsight(several, hindsight)
    return rows


def _span(several: Sequence[Array]) -> tuple[float, float]:
    """Return the lowest and highest of several readings. [K]"""
    return min(float(x.min()) for x in several), max(float(x.max()) for x in several)
