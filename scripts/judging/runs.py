"""Public logs of real runs, each predicted by a fit of the other kinds of run alone. The data are not part of thermid."""

from __future__ import annotations

import runpy
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import thermid as td
from thermid.base.errors import ThermidError
from thermid.fit.calibration import Calibration, LocalSpec, Request, fit
from thermid.prediction.bands import RecordPrediction, predict_record

ROOT = Path(__file__).parents[2]
DATA = ROOT.parent / "shared" / "data"


@dataclass(frozen=True, eq=False)
class Run:
    """One left-out run: what each reading misses by, and half the width of its band, sensor by sensor. [K]"""

    off: tuple[np.ndarray, ...]
    half: tuple[np.ndarray, ...]
    refused: str = ""


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

    def run(self, name: str, mode: str, found: Calibration | str) -> Run:
        """Return one run, as a fit of the other kinds predicts it."""
        if isinstance(found, str):
            return Run((), (), found)
        try:
            told = self.predicted(found, name, mode)
        except ThermidError as error:
            return Run((), (), str(error))
        bands = told.bands.values()
        return Run(tuple(b.measured - b.predicted for b in bands), tuple(b.half_width() for b in bands))


PREPARE = [{"trim": ["0.5 [s]", "end"]}, {"median": "4 [s]"}, {"resample": "5 [s]"}]
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
        taken = tuple(records[n].resample(15.0) for n in names)
        own, given = {n: local(n) for n in names}, {n: warm for n in names if hot(n)}
        asked = Request(model, taken, FREE, {"*": start, **given}, {}, own, untie=True, loss="soft_l1", loss_scale=5.0, name="board")
        return fit(asked)

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
        channel = td.Channel.from_array("T", kelvin, unit="K", role="node", target="box", noise=0.1)
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
