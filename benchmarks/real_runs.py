"""Coverage of 95 % bands on real runs of kinds that no fit saw: ``python benchmarks/real_runs.py`` scores, ``--page`` writes docs.

One kind of run is left out at a time. What is fitted, and every factor, comes from the other kinds only. Readings are looked at on a grid
of 5 s, each run weighs the same. Peers are the bands of commit 7b51ca9 as they were, the same times the one factor that scores best on
the other kinds, and the same times the factor of run-level conformal prediction. The data are not part of thermid: `DATA`, or ``--data``.
"""

from __future__ import annotations

import argparse
import json
import runpy
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import thermid as td
from thermid.base.errors import ThermidError
from thermid.fit.calibration import Calibration, fit
from thermid.fit.problem import LocalSpec, Request
from thermid.prediction.bands import RecordPrediction, predict_record

ROOT = Path(__file__).parent.parent
DATA = ROOT.parent / "shared" / "data"
FROZEN = Path(__file__).parent / "results" / "real_runs_7b51ca9.json"
PAGE = ROOT / "docs" / "coverage.md"
BEGIN, END = "<!-- real runs: begin -->", "<!-- real runs: end -->"
FACTORS = np.geomspace(0.5, 12.0, 40)
"""Factors on a band that are tried."""
LEVEL, SEED, REPEATS = 0.95, 20261122, 2000
QUANTILE = 1.96
"""Half-width of the band of an oracle, in RMSE. [-]"""
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
    record : function   Run -> its record.
    """

    name: str
    kinds: Mapping[str, Sequence[str]]
    modes: tuple[str, ...]
    fitted: Callable[[Sequence[str]], Calibration]
    predicted: Callable[[Calibration, str, str], RecordPrediction]
    record: Callable[[str], td.Record]

    def without(self, kind: str) -> Calibration | str:
        """Return the fit of all kinds but one, or why there is none."""
        try:
            return self.fitted([n for k, several in self.kinds.items() if k != kind for n in several])
        except ThermidError as error:
            return str(error)

    def runs(self) -> list[Run]:
        """Return every run, predicted from the other kinds alone."""
        out = []
        for kind, names in self.kinds.items():
            found = self.without(kind)
            for name in names:
                for mode in self.modes:
                    out.append(self.run(kind, name, mode, found))
            print(f"{self.name}, without {kind}: {len(names)} runs", file=sys.stderr)
        return out

    def run(self, kind: str, name: str, mode: str, found: Calibration | str) -> Run:
        """Return one run of a kind, as a fit of the others predicts it."""
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


Bands = Callable[..., RecordPrediction]
"""What predicts a record: `predict_record`, or another with its arguments and a result that has bands as it has."""


def tclabsp(data: Path, bands: Bands = predict_record) -> RealSet:
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
    # a run that starts hot: the board, which nobody measures, starts at the balance of its neighbours
    warm = td.Scenario("run", initial={f"{h}.{n}": c for h, c in (("h1", "T1_C"), ("h2", "T2_C")) for n in ("body", "sensor")})

    def passive(name: str) -> str:
        return "T2_C" if name[4] == "1" else "T1_C"

    def hot(name: str) -> bool:
        return tclab_kind(name).endswith("down")

    def local(name: str) -> dict[str, LocalSpec]:
        return {"room": LocalSpec("23 [degC]" if hot(name) else "T1_C", 0.5)}

    def fitted(names: Sequence[str]) -> Calibration:
        taken = tuple(records[n].resample(15.0, switches=True) for n in names)
        own, given = {n: local(n) for n in names}, {n: warm for n in names if hot(n)}
        asked = Request(model, taken, FREE, {"*": start, **given}, {}, own, untie=True, loss="soft_l1", loss_scale=5.0, name="board")
        return fit(replace(asked, effective=True))

    def predicted(found: Calibration, name: str, mode: str) -> RecordPrediction:
        if mode == "room fitted":
            own: dict[str, Any] = {"room": {"start": "22.5 [degC]", "sd": "2 [K]"}}
            own |= {"initial.pcb": {"start": passive(name), "sd": "5 [K]"}} if hot(name) else {}
            return bands(found, records[name], scenario=start, local=own)
        if not hot(name):
            return bands(found, records[name], scenario=start, readings={"room": "T1_C"})
        # a run that starts hot shows no reading of the room
        return bands(found, records[name], scenario=warm.with_(boundaries={"room": "23 [degC]"}))

    kinds: dict[str, list[str]] = {}
    for name in records:
        kinds.setdefault(tclab_kind(name), []).append(name)
    return RealSet("tclabsp", kinds, ("room fitted", "first readings"), fitted, predicted, records.__getitem__)


MOTOR = {"run 1": "Run1-Throttle4", "run 2": "Run2-Throttle100", "run 3": "Run3-Throttle48"}


def motor(data: Path, bands: Bands = predict_record) -> RealSet:
    """Return the motor's runs without cooling, as examples/motor has them: three powers, a kind each; the room is logged."""
    example = runpy.run_path(str(ROOT / "examples" / "motor" / "run.py"))
    folder = data / "motor_bldc_tass"

    def fitted(names: Sequence[str]) -> Calibration:
        found: Calibration = example["fitted"](folder, tuple(names))
        return found

    def predicted(found: Calibration, name: str, mode: str) -> RecordPrediction:
        return bands(found, example["joined"](folder, name), scenario=example["START"])

    kinds = {f"{name} (throttle {MOTOR[name].partition('Throttle')[2]} %)": [name] for name in MOTOR}
    return RealSet("motor", kinds, ("room logged",), fitted, predicted, lambda name: example["joined"](folder, name))


CUBE = {"air": ("exp02", 7, 33), "thin air": ("exp03", 6, 32)}
"""Experiment of a cube that cools, and the first and last row of its cooling."""
HEAT, AREA = 300.0, 0.06
"""Capacitance that the fits assume, J/K, and outside of a cube of 10 cm, m^2; see tests/recovery/test_lhs1.py."""


def lhs1(data: Path, bands: Bands = predict_record) -> RealSet:
    """Return the cooling curves of a cube in air and at low pressure, one sensor each: of the other pressure alone, a fit has one run."""
    runs = {f"{where}, {column}": (where, column) for where in CUBE for column in ("T_bmp_C", "T_mcp_C")}

    def curve(name: str) -> tuple[td.Record, td.Scenario]:
        where, column = runs[name]
        stem, first, last = CUBE[where]
        file = next((data / "lhs1_vacuum_cooling" / "processed").glob(f"{stem}*burst-means.csv"))
        rows = np.genfromtxt(file, delimiter=",", names=True, usecols=range(5))[first : last + 1]
        kelvin = rows[column] + 273.15
        channel = td.Channel.of("T", kelvin, unit="K", role="node", target="box", noise=0.1)
        record = td.Record.from_arrays(name, rows["t_s"] - rows["t_s"][0], {"T": channel}, synthetic=False)
        pressure = float(np.median(rows["P_hPa"]) * 100.0)
        environment = {"*": td.simulation.Environment(f"{pressure} [Pa]")} if where != "air" else {}
        return record, td.Scenario(name, boundaries={"room": f"{kelvin.min()} [K]"}, environment=environment)

    skin = {"of": "box", "to": "room", "area": f"{AREA} [m^2]", "effective_htc": {"value": "8 [W/(m^2 K)]", "min": 0.5, "max": 50}}
    deck = {"title": "Cube", "needs": ["room"], "nodes": {"box": {"capacitance": f"{HEAT} [J/K]"}}, "surfaces": {"skin": skin}}
    model = td.model_from_dict(deck | {"surfaces": {"skin": skin | {"finish": "plastic"}}})

    def fitted(names: Sequence[str]) -> Calibration:
        record, scenario = curve(names[0])
        return td.calibrate(model, record, ["skin.effective_htc"], scenario=scenario)

    def predicted(found: Calibration, name: str, mode: str) -> RecordPrediction:
        record, scenario = curve(name)
        return bands(found, record, scenario=scenario)

    kinds = {where: [n for n, (w, _) in runs.items() if w == where] for where in CUBE}
    return RealSet("lhs1", kinds, ("lowest reading",), fitted, predicted, lambda name: curve(name)[0])


SETS: dict[str, Callable[..., RealSet]] = {"tclabsp": tclabsp, "motor": motor, "lhs1": lhs1}
FOLDERS = {"tclabsp": "tclabsp", "motor": "motor_bldc_tass", "lhs1": "lhs1_vacuum_cooling"}
REPORTED = {
    "uconsole_cm5_enclosure": "no power is logged: nothing can be fitted but time constants",
    "rocket_avionics_rocketpy": "neither power nor ambient is logged",
}
"""Sets that are not scored, and why."""


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


# ---- the page -----------------------------------------------------------------------------------------------------------------------


def frozen() -> dict[str, dict[str, dict[str, Any]]]:
    """Return set and mode -> run -> the curves of commit 7b51ca9, whose file says how they were made."""
    found: dict[str, dict[str, dict[str, Any]]] = json.loads(FROZEN.read_text(encoding="utf-8"))["runs"]
    return found


@dataclass(frozen=True)
class Row:
    """One band on one set: share with its interval, half-width, interval score; the shares of kinds."""

    share: float
    interval: tuple[float, float]
    half: float
    score: float
    kinds: Mapping[str, tuple[int, float, float, float]]


def row(curves: Mapping[str, Mapping[str, Any]], factor: Callable[[Sequence[Mapping[str, Any]]], float]) -> Row:
    """Return the figures of a band times the factor that other kinds give."""
    rows = table(curves, factor)
    kinds = {n: str(c["kind"]) for n, c in curves.items()}
    own = {k: {n: r for n, r in rows.items() if kinds[n] == k} for k in dict.fromkeys(kinds.values())}
    by_kind = {k: (len(several), mean(several, 0), mean(several, 1), mean(several, 2)) for k, several in own.items()}
    return Row(mean(rows, 0), interval({n: r[0] for n, r in rows.items()}, kinds), mean(rows, 1), mean(rows, 2), by_kind)


def still(_: Sequence[Mapping[str, Any]]) -> float:
    """Return one: the band as it is stated."""
    return 1.0


PEERS = {"7b51ca9": still, "7b51ca9, best factor": best_factor, "7b51ca9, run-level conformal": conformal_factor}
LARGE = "tclabsp"
"""The set with runs enough for what is asked."""


def checks(now: Row, peers: Mapping[str, Row]) -> list[tuple[str, str, bool]]:
    """Return what is asked of a set, what was found, and whether it is met."""
    worst = min(((k, v[1]) for k, v in now.kinds.items() if v[0] >= FULL), key=lambda x: x[1], default=("", 1.0))
    best, conformal, as_it_was = peers["7b51ca9, best factor"], peers["7b51ca9, run-level conformal"], peers["7b51ca9"]
    return [
        (f"share inside {100 * LEAST:.0f} to {100 * MOST:.0f} %", f"{100 * now.share:.1f} %", LEAST <= now.share <= MOST),
        (f"no kind with {FULL} runs below {100 * WORST:.0f} %", f"{worst[0]} {100 * worst[1]:.0f} %", worst[1] >= WORST),
        (
            f"half-width at most {WIDER:g} times that of 7b51ca9",
            f"{now.half / as_it_was.half:.2f} times",
            now.half <= WIDER * as_it_was.half,
        ),
        (
            "interval score 15 % below 7b51ca9 with its best factor",
            f"{100 * (1 - now.score / best.score):.0f} % below",
            now.score <= BETTER * best.score,
        ),
        ("interval score below run-level conformal", f"{now.score:.2f} against {conformal.score:.2f} K", now.score < conformal.score),
    ]


def section(found: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> str:
    """Return the part of the page about real runs: what fails first, then every figure."""
    base = frozen()
    rows = {what: row(curves, still) for what, curves in found.items()}
    peers = {what: {name: row(base[what], factor) for name, factor in PEERS.items()} for what in found if what in base}
    asked = [(what, *check) for what in rows if what.startswith(LARGE) for check in checks(rows[what], peers[what])]
    lines = ["| set, surroundings | asked | found | |", "|---|---|---|---|"]
    lines += [f"| {w} | {a} | {f} | {'met' if ok else '**missed**'} |" for w, a, f, ok in sorted(asked, key=lambda x: x[3])]
    lines += [
        "",
        "| set, surroundings | band | inside | 95 % interval | half-width [K] | interval score [K] | half-width of an oracle [K] |",
        "|---|---|---|---|---|---|---|",
    ]
    for what, now in rows.items():
        for name, r in {"now": now, **peers.get(what, {})}.items():
            width, score = (f"{x:.2f}" if np.isfinite(x) else "infinite" for x in (r.half, r.score))
            ends = f"{100 * r.interval[0]:.0f} .. {100 * r.interval[1]:.0f} %"
            known = [c["rmse"] for c in (found if name == "now" else base)[what].values() if "rmse" in c]
            oracle = f"{QUANTILE * float(np.mean(known)):.2f}"
            lines.append(f"| {what} | {name} | {100 * r.share:.1f} % | {ends} | {width} | {score} | {oracle} |")
    lines += ["", "Kind by kind, now and (in brackets) at 7b51ca9:", ""]
    lines += ["| set, surroundings | kind | runs | inside | half-width [K] | RMSE [K] |", "|---|---|---|---|---|---|"]
    for what, now in rows.items():
        old = peers[what]["7b51ca9"].kinds if what in peers else {}
        for kind, (runs, share, half, _) in sorted(now.kinds.items(), key=lambda x: x[1][1]):
            rmse = [c["rmse"] for c in found[what].values() if c["kind"] == kind and "rmse" in c]
            was = f" ({100 * old[kind][1]:.0f} %)" if kind in old else ""
            width = f" ({old[kind][2]:.2f})" if kind in old else ""
            lines.append(
                f"| {what} | {kind} | {runs} | {100 * share:.0f} %{was} | {half:.2f}{width} | {np.mean(rmse) if rmse else np.nan:.2f} |"
            )
    refused = [f"{what}, {n}: {c['refused']}" for what, curves in found.items() for n, c in curves.items() if "refused" in c]
    lines += ["", *(f"- Refused: {r}" for r in refused), *(f"- Not scored: `{n}`, {why}." for n, why in REPORTED.items())]
    return HEAD + "\n".join(lines) + "\n"


HEAD = """## Real runs: kinds that no fit saw

Made by `python benchmarks/real_runs.py --page` from data that are not part of thermid (tclabsp, motor_bldc_tass, lhs1_vacuum_cooling;
the examples say where they are from). One kind of run is left out at a time; values, sizes and factors come from the other kinds alone.
Readings on a grid of 5 s, each run weighs the same, sensors within a run too; intervals of the shares by a bootstrap over kinds. The
peer is commit 7b51ca9, frozen in `benchmarks/results/real_runs_7b51ca9.json`: as it was, times the one factor that scores best on the
other kinds, and times the factor of run-level conformal prediction, which is infinite for fewer than 19 runs. The interval score is
Gneiting's and Raftery's (2007): mean width, and 40 times what lies outside. Of tclabsp the room is fitted to each run, or stands on the
run's first readings (a run that starts hot shows none: its room is assumed at 23 C). The fit weighs readings by what their residuals are
worth, and learns from the other kinds what first readings say of a room, and how far a warm board starts from the balance of its
neighbours ([239](design/fit.md)). Of the motor two kinds are left to fit, of the cube one: there the prior
of 10 % decides, and the bands are wide. An oracle that knows the RMSE of every run needs a half-width of 1.96 times that, in the last
column: narrower bands need better predictions. What is missed stands first.

"""


def write(found: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> None:
    """Put the part about real runs into the page, in place of the one that is there."""
    text = PAGE.read_text(encoding="utf-8")
    before, _, rest = text.partition(BEGIN)
    after = rest.partition(END)[2]
    PAGE.write_text(f"{before.rstrip()}\n\n{BEGIN}\n\n{section(found)}\n{END}\n{after.lstrip()}", encoding="utf-8")


def main() -> None:
    """Score, print, and write what is asked for."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--data", type=Path, default=DATA, help="folder of the data sets")
    parser.add_argument("--only", nargs="*", default=list(SETS), choices=list(SETS), help="some of the sets")
    parser.add_argument("--json", type=Path, help="write the curves of every run")
    parser.add_argument("--page", action="store_true", help=f"write the part about real runs of {PAGE.name}")
    options = parser.parse_args()
    present = [n for n in options.only if (options.data / FOLDERS[n]).is_dir()]
    for name in (n for n in options.only if n not in present):
        print(f"{name}: skipped, {options.data / FOLDERS[name]} is not here; give the folder of the data with --data", file=sys.stderr)
    found = curves_of([run for name in present for run in SETS[name](options.data).runs()])
    if options.json:
        options.json.write_text(json.dumps(found), encoding="utf-8")
    if found:
        print(section(found))
    if options.page and len(present) == len(SETS):
        write(found)


if __name__ == "__main__":
    main()
