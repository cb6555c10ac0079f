"""Coverage of 95 % bands on real runs of kinds that no fit saw: ``python benchmarks/real_runs.py`` scores, ``--page`` writes docs.

One kind of run is left out at a time. What is fitted, and every factor, comes from the other kinds only. Readings are looked at on a grid
of 5 s, each run weighs the same. Peers are the bands of commit 7b51ca9 as they were, the same times the one factor that scores best on
the other kinds, and the same times the factor of run-level conformal prediction. The data are not part of thermid: `DATA`, or ``--data``.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import thermid as td
from thermid.errors import ThermidError
from thermid.fit.calibrate import fit
from thermid.fit.calibration import Calibration
from thermid.fit.problem.request import LocalSpec, Request
from thermid.prediction.records import RecordPrediction, predict_record

ROOT = Path(__file__).parent.parent
DATA = ROOT.parent / "shared" / "data"
FROZEN = Path(__file__).parent / "results" / "real_runs_7b51ca9.json"
PAGE = ROOT / "docs" / "coverage.md"
BEGIN, END = "<!-- real runs: begin -->", "<!-- real runs: end -->"
FACTORS = np.geomspace(0.5, 12.0, 40)
"""Factors on a band that are tried."""
LEVEL, SEED, REPEATS = 0.95, 20261122, 2000
FULL = 4
"""Runs from which a kind must have a share of its own."""
LEAST, MOST, WORST, WIDER, BETTER = 0.90, 0.98, 0.80, 1.5, 0.85
"""What is asked: mean share, share of a kind with enough runs, width over the baseline's, interval score over the best factor's."""


@dataclass(frozen=True, eq=False)
class Run:
    """One left-out run: what each reading misses by, and half the width of its band, sensor by sensor. [K]"""

    data: str
    kind: str
    name: str
    mode: str
    off: tuple[np.ndarray, ...]
    half: tuple[np.ndarray, ...]
    refused: str = ""

    def curves(self) -> dict[str, Any]:
        """Return share inside, mean half-width and interval score at every factor, and the factor that holds 95 % of the readings."""
        if self.refused:
            return {"kind": self.kind, "refused": self.refused}
        share, score = [], []
        for f in FACTORS:
            share.append(np.mean([np.mean(np.abs(d) <= f * h) for d, h in zip(self.off, self.half, strict=True)]))
            over = [2 * f * h + 2 / (1 - LEVEL) * np.maximum(np.abs(d) - f * h, 0.0) for d, h in zip(self.off, self.half, strict=True)]
            score.append(np.mean([np.mean(x) for x in over]))
        needed = np.concatenate([np.abs(d) / np.maximum(h, 1e-12) for d, h in zip(self.off, self.half, strict=True)])
        return {
            "kind": self.kind,
            "share": [round(float(x), 4) for x in share],
            "score": [round(float(x), 4) for x in score],
            "half": round(float(np.mean([h.mean() for h in self.half])), 5),
            "rmse": round(float(np.sqrt(np.mean([np.mean(d**2) for d in self.off]))), 5),
            "factor": round(float(np.quantile(needed, LEVEL)), 5),
        }


def at(curves: Mapping[str, Any], factor: float) -> tuple[float, float, float]:
    """Return share inside, half-width and interval score of a run at a factor; a refusal holds nothing."""
    if "refused" in curves:
        return 0.0, float("nan"), float("nan")
    if not np.isfinite(factor):
        return 1.0, float("inf"), float("inf")
    logs = np.log(FACTORS)
    place = float(np.log(np.clip(factor, FACTORS[0], FACTORS[-1])))
    return float(np.interp(place, logs, curves["share"])), factor * curves["half"], float(np.interp(place, logs, curves["score"]))


# ---- the sets -----------------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class RealSet:
    """One set of real runs.

    Parameters
    ----------
    name : str
    kinds : dict        Kind -> its runs.
    modes : tuple       How the surroundings are known.
    fitted : function   Runs that may be used -> the fit.
    predicted : function    Fit, run, mode -> the prediction of it.
    """

    name: str
    kinds: Mapping[str, Sequence[str]]
    modes: tuple[str, ...]
    fitted: Callable[[Sequence[str]], Calibration]
    predicted: Callable[[Calibration, str, str], RecordPrediction]

    def runs(self) -> list[Run]:
        """Return every run, predicted from the other kinds alone."""
        out = []
        for kind, names in self.kinds.items():
            try:
                found: Calibration | str = self.fitted([n for k, several in self.kinds.items() if k != kind for n in several])
            except ThermidError as error:
                found = str(error)
            for name in names:
                for mode in self.modes:
                    out.append(self._run(kind, name, mode, found))
            print(f"{self.name}, without {kind}: {len(names)} runs", file=sys.stderr)
        return out

    def _run(self, kind: str, name: str, mode: str, found: Calibration | str) -> Run:
        if isinstance(found, str):
            return Run(self.name, kind, name, mode, (), (), found)
        try:
            told = self.predicted(found, name, mode)
        except ThermidError as error:
            return Run(self.name, kind, name, mode, (), (), str(error))
        bands = told.bands.values()
        return Run(self.name, kind, name, mode, tuple(b.measured - b.predicted for b in bands), tuple(b.half_width() for b in bands))


PREPARE = [{"trim": ["0.5 [s]", "end"]}, {"median": "4 [s]"}, {"resample": {"step": "5 [s]", "switches": True}}]
FREE = (
    *("h1.alpha", "h2.alpha", "h1.tau", "h2.tau", "h1.to_board", "h2.to_board"),
    *("between", "to_room", "pcb.capacitance", "h2.body.specific_heat"),
)


def tclab_kind(name: str) -> str:
    """Return the kind of a run of the TCLab board."""
    if name.startswith("ensH"):
        return f"step of heater {name[4]} {'up' if name[6:9] == '000' else 'down'}"
    if name.startswith("PID"):
        return "closed loop"
    return "0 to 50 %, 2200 s" if "0to50" in name else f"random {name.split('Identification')[1].split('_')[0]}"


def tclabsp(data: Path) -> RealSet:
    """Return the TCLab runs of Sao Paulo: the decks and the joint fit of examples/tclab, every run with a room of its own."""
    model = td.load_model(ROOT / "examples" / "tclab" / "board.toml")
    records = {}
    for file in sorted((data / "tclabsp").glob("*/*.csv.gz")):
        name = file.name.removesuffix(".csv.gz")
        noise = "0.75 [K]" if "Random" in name else "0.3 [K]"
        channels = {"Q1_pct": {"command": "h1.heater"}, "Q2_pct": {"command": "h2.heater"}}
        channels |= {"T1_C": {"node": "h1.sensor", "noise": noise}, "T2_C": {"node": "h2.sensor", "noise": noise, "accuracy": "1 [K]"}}
        records[name] = td.read_record(file, channels, time="time_s", name=name).prepare(PREPARE)
    start = td.Scenario("run", start="T1_C", initial={"h2.body": "T2_C", "h2.sensor": "T2_C"})

    def passive(name: str) -> str:
        return "T2_C" if name[4] == "1" else "T1_C"

    def hot(name: str) -> bool:
        return tclab_kind(name).endswith("down")

    def local(name: str) -> dict[str, LocalSpec]:
        if not hot(name):
            return {"room": LocalSpec("T1_C", 0.5)}
        return {"room": LocalSpec("23 [degC]", 0.5), "initial.pcb": LocalSpec(passive(name), 5.0)}

    def fitted(names: Sequence[str]) -> Calibration:
        taken = tuple(records[n].resample(15.0, switches=True) for n in names)
        own = {n: local(n) for n in names}
        return fit(Request(model, taken, FREE, {"*": start}, {}, own, untie=True, loss="soft_l1", loss_scale=5.0, name="board"))

    def predicted(found: Calibration, name: str, mode: str) -> RecordPrediction:
        if mode == "room fitted":
            own: dict[str, Any] = {"room": {"start": "22.5 [degC]", "sd": "2 [K]"}}
            own |= {"initial.pcb": {"start": passive(name), "sd": "5 [K]"}} if hot(name) else {}
            return predict_record(found, records[name], scenario=start, local=own)
        if not hot(name):
            return predict_record(found, records[name], scenario=start, readings={"room": "T1_C"})
        # a run that starts hot shows no reading of the room: the room is assumed, the board stands where the passive heater does
        given = start.with_(initial={"pcb": passive(name)}, boundaries={"room": "23 [degC]"})
        return predict_record(found, records[name], scenario=given)

    kinds: dict[str, list[str]] = {}
    for name in records:
        kinds.setdefault(tclab_kind(name), []).append(name)
    return RealSet("tclabsp", kinds, ("room fitted", "first readings"), fitted, predicted)


SETS: dict[str, Callable[[Path], RealSet]] = {"tclabsp": tclabsp}


# ---- scores -------------------------------------------------------------------------------------------------------------------------


def curves_of(runs: Sequence[Run]) -> dict[str, dict[str, dict[str, Any]]]:
    """Return set and mode -> run -> its curves."""
    out: dict[str, dict[str, dict[str, Any]]] = {}
    for run in runs:
        out.setdefault(f"{run.data}, {run.mode}", {})[run.name] = run.curves()
    return out


def best_factor(others: Sequence[Mapping[str, Any]]) -> float:
    """Return the factor with the best interval score over runs of other kinds."""
    known = [c["score"] for c in others if "refused" not in c]
    return float(FACTORS[int(np.argmin(np.mean(known, axis=0)))]) if known else 1.0


def conformal_factor(others: Sequence[Mapping[str, Any]]) -> float:
    """Return the factor that holds 95 % of the readings of a further run with a chance of 95 %, runs being exchangeable.

    Of n runs it is the ``ceil(0.95 (n + 1))`` smallest of theirs (Vovk, Gammerman and Shafer, Algorithmic Learning in a Random World,
    2005); with fewer than 19 there is none, and the band is infinite.
    """
    known = sorted(c["factor"] for c in others if "refused" not in c)
    place = int(np.ceil(LEVEL * (len(known) + 1)))
    return known[place - 1] if place <= len(known) else float("inf")


def table(curves: Mapping[str, Mapping[str, Any]], factor: Callable[[Sequence[Mapping[str, Any]]], float]) -> dict[str, tuple[float, ...]]:
    """Return run -> share, half-width, interval score, the factor of each kind from the other kinds."""
    kinds = {c["kind"] for c in curves.values()}
    factors = {k: factor([c for c in curves.values() if c["kind"] != k]) for k in kinds}
    return {n: at(c, factors[c["kind"]]) for n, c in curves.items()}


def interval(shares: Mapping[str, float], kinds: Mapping[str, str]) -> tuple[float, float]:
    """Return the 95 % interval of the mean share over runs, kinds drawn with replacement (cluster bootstrap)."""
    rng, groups = np.random.default_rng(SEED), sorted(set(kinds.values()))
    sums = np.array([[sum(s for n, s in shares.items() if kinds[n] == g), sum(1 for n in shares if kinds[n] == g)] for g in groups])
    drawn = sums[rng.integers(0, len(groups), (REPEATS, len(groups)))].sum(axis=1)
    low, high = np.quantile(drawn[:, 0] / drawn[:, 1], [0.025, 0.975])
    return float(low), float(high)


def mean(rows: Mapping[str, tuple[float, ...]], k: int) -> float:
    """Return the mean over runs of one figure; refusals have no width."""
    known = [r[k] for r in rows.values() if k == 0 or not np.isnan(r[k])]
    return float(np.mean(known)) if known else float("nan")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--data", type=Path, default=DATA)
    parser.add_argument("--only", nargs="*", default=list(SETS), choices=list(SETS))
    parser.add_argument("--json", type=Path, help="write what every run needs for the scores")
    options = parser.parse_args()
    found: list[Run] = []
    for name in options.only:
        found += SETS[name](options.data).runs()
    curves = curves_of(found)
    if options.json:
        options.json.write_text(json.dumps(curves), encoding="utf-8")
    for what, runs in curves.items():
        rows = table(runs, lambda _: 1.0)
        kinds = {n: c["kind"] for n, c in runs.items()}
        print(what, [round(mean(rows, k), 3) for k in range(3)], interval({n: r[0] for n, r in rows.items()}, kinds))
        for kind in dict.fromkeys(kinds.values()):
            own = {n: r for n, r in rows.items() if kinds[n] == kind}
            rm = np.mean([runs[n]["rmse"] for n in own if "rmse" in runs[n]])
            print("   ", f"{kind:24s}", len(own), [round(mean(own, k), 3) for k in range(3)], round(float(rm), 3))
