"""Public test sets, each as an engineer takes it first: a plain lumped structure, its conditions, and what is fitted.

None of the files is part of thermid. Three sets lie in the folder of the judge's logs (scripts/judging/runs.py); all others lie at
``THERMID_PUBLIC/OWNER/REPOSITORY/PATH`` and are known by their SHA-256.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

import thermid as td
from thermid.fit.calibration import Calibration, LocalSpec, Request, fit, priors_of
from thermid.model.tree import TableSignal
from thermid.simulation.runs import Scenario

Array = np.ndarray
ICE = 273.15
FLOOR = 0.02
"""Least noise of a mean of readings. [K]"""
SPIKE = 3.0
"""What a reading may lie off the median of its stretch. [K]"""


class AbsentError(Exception):
    """Files of a set are not here."""


@dataclass(frozen=True, eq=False)
class Condition:
    """One run of a set.

    Parameters
    ----------
    name : str
    times : array (times,)      [s]
    readings : dict             Node -> temperature (times,). [K]
    rooms : dict                Boundary -> temperature (times,). [K]
    loads : dict                Load -> power (times,). [W]
    commands : dict             Load -> command (times,). [-]
    initial : dict              Node -> temperature at the start. [K]
    noise : float               Of a reading. [K]
    local : dict                Value that this run has for itself in a fit.
    """

    name: str
    times: Array
    readings: Mapping[str, Array]
    rooms: Mapping[str, Array]
    loads: Mapping[str, Array] = field(default_factory=dict)
    commands: Mapping[str, Array] = field(default_factory=dict)
    initial: Mapping[str, float] = field(default_factory=dict)
    noise: float = 0.1
    local: Mapping[str, LocalSpec] = field(default_factory=dict)

    @property
    def record(self) -> td.Record:
        """The run as a log."""
        of = td.Channel.from_array
        every = {n: of(n, x, unit="K", role="node", target=n, noise=self.noise) for n, x in self.readings.items()}
        every |= {n: of(n, x, unit="K", role="boundary", target=n) for n, x in self.rooms.items()}
        every |= {n: of(n, x, quantity="power", role="load", target=n, prompt=True) for n, x in self.loads.items()}
        every |= {n: of(n, x, quantity="command", role="command", target=n, prompt=True) for n, x in self.commands.items()}
        return td.Record.from_arrays(self.name, self.times, every, synthetic=False)

    @property
    def starts(self) -> dict[str, str]:
        """Node -> temperature at the start, as scenarios take it."""
        first = {n: float(x[0]) for n, x in self.readings.items()}
        return {n: f"{t!r} [K]" for n, t in (first | dict(self.initial)).items()}

    def scenario(self, initial: Mapping[str, str] | None = None) -> Scenario:
        """Return the run as it is asked: boundaries, powers and start as logged."""
        held = {n: TableSignal(self.times, x, hold=True) for n, x in self.loads.items()}
        told = {n: TableSignal(self.times, x, hold=True) for n, x in self.commands.items()}
        rooms = {n: TableSignal(self.times, x) for n, x in self.rooms.items()}
        start = {**self.starts, **(initial or {})}
        return Scenario(self.name, boundaries=rooms, loads=held, commands=told, initial=start, duration=float(self.times[-1]))


@dataclass(frozen=True, eq=False)
class TestSet:
    """A public test set with a plain structure.

    Parameters
    ----------
    name, source, structure : str
    deck : dict
    free : tuple of str
    conditions : tuple of Condition
    taught : tuple of str       The at most two conditions from which the others are predicted.
    files : dict                Name of a file -> its SHA-256.
    logged : bool               Whether the room has an instrument; else it is a first reading, or assumed.
    stated : tuple of str       Of what is fitted, what its deck gives to 30 %.
    follows : callable          Fit and condition -> starts that no sensor shows.
    """

    name: str
    source: str
    structure: str
    deck: Mapping[str, Any]
    free: tuple[str, ...]
    conditions: tuple[Condition, ...]
    taught: tuple[str, ...]
    files: Mapping[str, str]
    stated: tuple[str, ...] = ()
    logged: bool = False
    follows: Callable[[Calibration, Condition], dict[str, str]] = lambda _fit, _condition: {}

    def fitted(self, names: Sequence[str] = ()) -> Calibration:
        """Return the fit of some conditions; of all without names."""
        chosen = [c for c in self.conditions if not names or c.name in names]
        scenarios = {c.name: td.Scenario(c.name, initial=c.starts) for c in chosen}
        own = {c.name: c.local for c in chosen if c.local}
        model = td.model_from_dict(dict(self.deck))
        priors = priors_of(model, {p: ("", "30 [%]") for p in self.stated if p in self.free}, self.name)
        return fit(Request(model, tuple(c.record for c in chosen), self.free, scenarios, {}, own, priors, name=self.name))

    def __getitem__(self, name: str) -> Condition:
        """Return a condition."""
        return next(c for c in self.conditions if c.name == name)


def _kept(folder: Path, names: Sequence[str]) -> tuple[list[Path], dict[str, str]]:
    """Return files and their checksums.

    Raises
    ------
    AbsentError     When one is not there.
    """
    paths = [folder / n for n in names]
    for path in paths:
        if not path.is_file():
            raise AbsentError(f"{path} is not here")
    return paths, {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in paths}


def _public(repository: str, expected: Mapping[str, str]) -> tuple[list[Path], dict[str, str]]:
    """Return files of a public repository.

    Raises
    ------
    AbsentError     When one is not there, or another than the one that was used.
    """
    paths, sums = _kept(Path(os.environ.get("THERMID_PUBLIC", "THERMID_PUBLIC")) / repository, list(expected))
    for path, asked in zip(paths, expected.values(), strict=True):
        if asked and sums[path.name] != asked:
            raise AbsentError(f"{path} is another file than the one that was used")
    return paths, sums


def means(times: Array, values: Array, grid: Array) -> Array:
    """Return means of readings over the stretches about grid points, without spikes; empty stretches are joined by straight lines."""
    step = grid[1] - grid[0]
    place = np.round((times - grid[0]) / step).astype(int)
    out = np.full(grid.size, np.nan)
    for k in range(grid.size):
        own = values[place == k]
        own = own[np.abs(own - np.median(own)) <= SPIKE] if own.size else own
        out[k] = own.mean() if own.size else np.nan
    known = np.isfinite(out)
    return np.interp(grid, grid[known], out[known])


def _held(times: Array, values: Array, grid: Array) -> Array:
    """Return the value that holds from each grid point: the last one told by its middle."""
    middle = grid + 0.5 * (grid[1] - grid[0])
    return np.asarray(values[np.clip(np.searchsorted(times, middle, side="right") - 1, 0, values.size - 1)], dtype=float)


def value(number: float, unit: str, factor: float = 30.0) -> dict[str, Any]:
    """Return a value of a deck with bounds a factor about it."""
    return {"value": f"{number} [{unit}]", "min": number / factor, "max": number * factor}


def _skin(of: str, coefficient: float, area: float, carried_by: str = "") -> dict[str, Any]:
    out = {"of": of, "to": "room", "area": f"{area} [m^2]", "effective_htc": value(coefficient, "W/(m^2 K)", 20.0)}
    return out | ({"carried_by": carried_by} if carried_by else {})


# ---- boards with two heaters ----------------------------------------------------------------------------------------------------------


def board(full: float, second: float) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Return the deck of a board with two heaters, two masses in all, and what is fitted; powers at full command. [W]"""
    nodes = {n: {"capacitance": value(4.0, "J/K", 300.0)} for n in ("t1", "t2")} | {n: {"capacitance": "0.02 [J/K]"} for n in ("s1", "s2")}
    surfaces = {f"skin{k}": _skin(f"t{k}", 10.0, 0.0012) for k in (1, 2)}
    between = {"between": {"kind": "conduction", "between": ["t1", "t2"], "conductance": value(0.01, "W/K")}}
    between |= {f"glue{k}": {"kind": "conduction", "between": [f"t{k}", f"s{k}"], "conductance": f"{0.02 / LAG} [W/K]"} for k in (1, 2)}
    loads = {"heat1": {"into": "t1", "power": f"{full} [W]"}, "heat2": {"into": "t2", "power": value(second, "W", 5.0)}}
    deck = {"title": "Board", "needs": ["room"], "nodes": nodes, "surfaces": surfaces, "conductors": between, "loads": loads}
    free = [f"t{k}.capacitance" for k in (1, 2)] + [f"{n}.effective_htc" for n in surfaces] + ["between.conductance"]
    return deck, tuple(free)


BOARD_STATED = ("heat2.power",)
BOARD = "two heaters with a sensor each, a coefficient each to the room, a joint between"
LAG = 20.0
"""Lag of the sensors, as the designer and the author of Sao Paulo publish it. [s]"""


def _board_run(name: str, t: Array, q: Array, y: Array, step: float, full: float, room: float, offset: Array, noise: float) -> Condition:
    """Return a run of a board: commands (times, 2) in per cent, readings (times, 2) in degrees, their constant errors. [K]"""
    grid = np.arange(t[0], t[-1] - 0.5 * step, step)
    readings = {f"s{k + 1}": means(t, y[:, k], grid) - offset[k] + ICE for k in (0, 1)}
    rooms = {"room": np.full(grid.size, room + ICE)}
    loads, commands = {"heat1": 0.01 * full * _held(t, q[:, 0], grid)}, {"heat2": 0.01 * _held(t, q[:, 1], grid)}
    start = {f"t{k}": float(readings[f"s{k}"][0]) for k in (1, 2)}
    return Condition(name, grid - grid[0], readings, rooms, loads, commands, start, noise)


SAO_PAULO = {
    "heater 1 at 20 %": "step/ensH1_000_020_en1",
    "heater 1 at 50 %": "step/ensH1_000_050_en1",
    "heater 1 at 100 %": "step/ensH1_000_100_en1",
    "heater 2 at 50 %": "step/ensH2_000_050_en1",
    "heater 2 at 100 %": "step/ensH2_000_100_en1",
    "both, random": "random_H1H2/ens_IdentificationH1H2_Random_01",
}


def tclabsp(data: Path) -> TestSet:
    """Return the board of Sao Paulo: steps of either heater from cold, and random powers of both."""
    paths, sums = _kept(data / "tclabsp", [f"{n}.csv.gz" for n in SAO_PAULO.values()])
    runs = []
    for name, path in zip(SAO_PAULO, paths, strict=True):
        rows = np.genfromtxt(path, delimiter=",", skip_header=3)  # the first two rows are a filler
        q, y = rows[:, 1:3], rows[:, 3:5]
        cold = np.median(y[:20], axis=0)
        step = 30.0 if rows[-1, 0] > 5000.0 else 10.0
        runs.append(_board_run(name, rows[:, 0], q, y, step, 1.23, float(cold[0]), np.array([0.0, cold[1] - cold[0]]), 0.08))
    deck, free = board(1.23, 0.62)
    source = "github.com/TiagoPrata/TCLabSP, MIT, e8dfcb0"
    taught = ("heater 1 at 50 %", "heater 2 at 50 %")
    return TestSet("tclabsp", source, BOARD, deck, (*free, "heat2.power"), tuple(runs), taught, sums, BOARD_STATED)


def apmonitor(data: Path) -> TestSet:
    """Return the boards of the designer: three logs of both heaters, one of heater 1."""
    names = ["2nd_order_mimo", "energy_balance_mimo", "mhe_linear"]
    paths, sums = _kept(data / "tclab_apmonitor_arduino", [f"{n}.csv" for n in names])
    runs = []
    for name, path in zip(names, paths, strict=True):
        rows = np.genfromtxt(path, delimiter=",", skip_header=1)
        q, y = rows[:, 1:3], rows[:, 3:5]
        cold = y[0]
        runs.append(_board_run(name, rows[:, 0], q, y, 6.0, 1.0, float(cold[0]), np.array([0.0, cold[1] - cold[0]]), 0.1))
    deck, free = board(1.0, 0.75)
    source = "github.com/APMonitor/arduino, Apache-2.0, f36e65a"
    taught = ("2nd_order_mimo", "mhe_linear")
    return TestSet("tclab_apmonitor", source, BOARD, deck, (*free, "heat2.power"), tuple(runs), taught, sums, BOARD_STATED)


IST = {
    "Code/P3/matfiles/openloop_data_train.mat": "4e84b984199aabbc0f2857fd92944aefb115a84b4e13c7ed32985f4fc46940ca",
    "Code/P3/matfiles/openloop_data_test.mat": "df62471aad9cf410a95fc2dde23fe56fc99322641f5570ca0398c7e204866d36",
}


def ist(_: Path) -> TestSet:
    """Return a board of Lisbon with heater 1 alone: nine levels in three parts, and a run of many short ones."""
    from scipy.io import loadmat

    paths, sums = _public("FNR13/TCLab-Predictive-Control", IST)
    runs = []
    for path in paths:
        data = {k: np.asarray(v, dtype=float) for k, v in loadmat(path).items() if not k.startswith("__")}
        t, q, y = data["t"][0], data["u"].T, data["y"].T
        parts = np.array_split(np.arange(t.size), 3 if "train" in path.name else 1)
        cold = y[:3].mean(axis=0)
        for k, part in enumerate(parts):
            name, step = (f"levels, part {k + 1}", 15.0) if len(parts) > 1 else ("short levels", 5.0)
            offset = np.array([0.0, cold[1] - cold[0]])
            runs.append(_board_run(name, t[part], q[part], y[part], step, 1.0, float(cold[0]), offset, 0.15))
    deck, free = board(1.0, 0.75)
    source = "github.com/FNR13/TCLab-Predictive-Control, no licence stated, 87a1c44"
    return TestSet("tclab_lisbon", source, BOARD, deck, free, tuple(runs), ("levels, part 1", "levels, part 2"), sums, BOARD_STATED)


SANTA_BARBARA = {"data/tclab_kuntz_rawlings_2022.mat": "964ffb15c2258d5f239e8da2ce66c8b2702376d6c28034ca52113ac05d6b9b96"}


def santa_barbara(_: Path) -> TestSet:
    """Return a board of Santa Barbara about 30 %: a random sequence of both heaters, in four parts; its room is taken as 22 degC."""
    from scipy.io import loadmat

    paths, sums = _public("rawlings-group/mlid_2024", SANTA_BARBARA)
    found = loadmat(paths[0], squeeze_me=True)
    data, settled = found["data"][()], found["est"][()]
    t, q, y = data["time"], data["udat"] + settled["uss"], data["ydat"] + settled["yss"]
    runs = []
    for k in range(4):
        part = slice(1680 * k, 1680 * (k + 1))
        runs.append(_board_run(f"part {k + 1}", t[part], q[part], y[part], 12.0, 1.0, 22.0, np.zeros(2), 0.06))
    deck, free = board(1.0, 0.75)
    source = "github.com/rawlings-group/mlid_2024, MIT, 9f1c939"
    return TestSet(
        "tclab_santa_barbara", source, BOARD, deck, (*free, "heat2.power"), tuple(runs), ("part 1", "part 2"), sums, BOARD_STATED
    )


# ---- others ----------------------------------------------------------------------------------------------------------------------------

MOTOR = {"throttle 4 %": "Run1-Throttle4", "throttle 100 %": "Run2-Throttle100", "throttle 48 %": "Run3-Throttle48"}


def motor(data: Path) -> TestSet:
    """Return a motor that heats itself, at three powers; its controller's log starts where its power first moves the winding."""
    files = [f"{n}_{what}.csv" for n in MOTOR.values() for what in ("temperatures", "esc")]
    paths, sums = _kept(data / "motor_bldc_tass", files)
    runs = []
    for name, hot, taken in zip(MOTOR, paths[::2], paths[1::2], strict=True):
        rows = np.genfromtxt(hot, delimiter=",", names=True)
        power = np.genfromtxt(taken, delimiter=",", names=True)["Power_W"]
        begun = _first_rise(rows["Time_s"], rows["Winding_Temp_C"])
        clock = begun + 0.1 * np.arange(power.size)
        grid = np.arange(0.0, min(rows["Time_s"][-1], clock[-1]) - 2.0, 2.0)
        clock, power = np.r_[-1.0, clock], np.r_[0.0, power]
        order = np.argsort(clock, kind="stable")
        watts = np.array([power[order][(clock[order] >= a) & (clock[order] < a + 2.0)].mean() if a + 2.0 > begun else 0.0 for a in grid])
        columns = {"winding": "Winding_Temp_C", "stator": "Stator_Body_C"}
        readings = {n: means(rows["Time_s"], rows[c], grid) + ICE for n, c in columns.items()}
        room = means(rows["Time_s"], rows["Ambient_C"], grid) + ICE
        runs.append(Condition(name, grid, readings, {"room": room}, {"copper": np.nan_to_num(watts)}, noise=1.0))
    deck = {
        "title": "Motor",
        "needs": ["room"],
        "nodes": {"winding": {"capacitance": value(550, "J/K")}, "stator": {"capacitance": value(850, "J/K")}},
        "conductors": {"slot": {"kind": "conduction", "between": ["winding", "stator"], "conductance": value(4, "W/K")}},
        "surfaces": {"skin": _skin("stator", 13.0, 0.03)},
        "loads": {"copper": {"into": "winding", "power": "1 [W]"}},
    }
    free = ("winding.capacitance", "stator.capacitance", "slot.conductance", "skin.effective_htc")
    source = "github.com/TasS-RV/Motor-Thermal-Modelling-Tool, MIT, e94b107"
    structure = "winding and stator, a joint between, a coefficient to the room"
    return TestSet("motor", source, structure, deck, free, tuple(runs), ("throttle 4 %", "throttle 100 %"), sums, logged=True)


def _first_rise(t: Array, y: Array) -> float:
    """Return when readings first leave their start: the last time that they stand within a kelvin of it, before they rise by ten. [s]"""
    high = int(np.argmax(y > y[0] + 10.0))
    return float(t[:high][np.abs(y[:high] - y[0]) < 1.0][-1])


CELLS = {
    "Exp25_R1.mat": "1915a6f58cba1a8957dfc7d26d30b41446cb7afc49325af95e239780f0212d6b",
    "Exp25_R2.mat": "693c07266c5380f9d6d86419e0da17c4766f4fae6e335d70edafa0114f6cd20c",
}
PROFILES = {"half rate": "Rt_c_2_data", "whole rate": "ref_data", "twice the rate": "Rt_cx2_data", "random": "rw_data"}


def cells(_: Path) -> TestSet:
    """Return two cells at constant and random currents; their heat is current times open voltage at 1/20 of the rate less voltage."""
    from scipy.io import loadmat

    paths, sums = _public("Silencefrog9305/Digital-Twins-for-Battery-Using-CTA-MTL", CELLS)
    runs = []
    for k, path in enumerate(paths):
        data = loadmat(path, squeeze_me=True)
        slow = data["ocv_data"][()]
        charge, open_voltage = np.asarray(slow["Q"], dtype=float), np.asarray(slow["V"], dtype=float)
        for name, key in PROFILES.items():
            one = data[key][()] if data[key].shape == () else data[key].flat[0]
            t, current, volt, kelvin, taken = (np.asarray(one[n], dtype=float) for n in ("t", "I", "V", "T", "Q"))
            heat = np.maximum(current * (np.interp(taken, charge, open_voltage) - volt), 0.0)
            grid = np.arange(t[0], t[-1] - 5.0, 20.0)
            readings, room = {"cell": means(t, kelvin, grid) + ICE}, np.full(grid.size, float(kelvin[0]) + ICE)
            runs.append(
                Condition(f"{name}, cell {k + 1}", grid - grid[0], readings, {"room": room}, {"heat": _held(t, heat, grid)}, noise=0.07)
            )
    deck = {
        "title": "Cell",
        "needs": ["room"],
        "nodes": {"cell": {"capacitance": value(45, "J/K")}},
        "surfaces": {"skin": _skin("cell", 15.0, 0.0042)},
        "loads": {"heat": {"into": "cell", "power": "1 [W]"}},
    }
    source = "github.com/Silencefrog9305/Digital-Twins-for-Battery-Using-CTA-MTL, MIT, ec0fe7c"
    taught = ("half rate, cell 1", "whole rate, cell 1")
    structure = "one mass, a coefficient to the chamber, heat by current and voltages"
    return TestSet("cells", source, structure, deck, ("cell.capacitance", "skin.effective_htc"), tuple(runs), taught, sums)


SINES = {
    "sinetest_manual/Data_sine/sec.001.txt": "6c897196e84f375395e73e2ba9779edf955c9a3a97009a604629a8acb6afca8b",
    "sinetest_manual/Data_sine/sec.004.txt": "6ab3fad45b62ba179997c87c7219455cbe6cd5f92ff23f2999ed864762dbb681",
    "sinetest_manual/Data_sine/sec.007.txt": "0ed98128e70aad48257136f4227623588ddab923e4b50b252d57ddfba7024676",
    "sinetest_manual/Data_sine/sec.01.txt": "d207960861f8fb69bfcbb14e849fe767ebaa2f9d52150dc338fa4bf814afb05c",
    "sinetest_manual/Data_sine/sec.02.txt": "9f0c7541b95feec7af8ee43555e9bf248771dfa1a62b8685fec6a631fee173e2",
    "sinetest_manual/Data_sine/sec.03.txt": "b36f2d115acc24529e846608a94dab49b81861de926185836942e752849072a4",
}


def sines(_: Path) -> TestSet:
    """Return a plate that a fan cools and a coil heats in sines of six periods; one per cent of the coil is taken as 0.2 W."""
    paths, sums = _public("rupakrokade/sbhs-manual", SINES)
    runs = []
    for path in paths:
        text = path.read_text(encoding="utf-8")
        rows = np.array([line.split() for line in text[text.index("[") + 1 : text.index("]")].splitlines() if line.strip()], dtype=float)
        t, y = np.maximum.accumulate(rows[:, 0]), rows[:, 3]
        grid = np.arange(0.0, t[-1] - 4.0, 10.0 if t[-1] > 1500.0 else 4.0)
        room = np.full(grid.size, float(np.median(y[:10])) + ICE)
        name = f"{path.stem.removeprefix('sec')} Hz"
        runs.append(
            Condition(
                name,
                grid,
                {"probe": means(t, y, grid) + ICE},
                {"room": room},
                {"coil": 0.2 * _held(t, rows[:, 1], grid)},
                initial={"frame": float(room[0]), "plate": float(room[0])},
                noise=0.05,
            )
        )
    deck = {
        "title": "Plate",
        "needs": ["room"],
        "nodes": {
            "plate": {"capacitance": value(15, "J/K")},
            "frame": {"capacitance": value(15, "J/K")},
            "probe": {"capacitance": "0.1 [J/K]"},
        },
        "surfaces": {"skin": _skin("plate", 40.0, 0.01, "fan")},
        "conductors": {
            "foot": {"kind": "conduction", "between": ["plate", "frame"], "conductance": value(0.3, "W/K")},
            "glue": {"kind": "conduction", "between": ["plate", "probe"], "conductance": value(0.0125, "W/K")},
        },
        "loads": {"coil": {"into": "plate", "power": "1 [W]"}},
    }
    source = "github.com/rupakrokade/sbhs-manual, no licence stated, 5aad482"
    structure = "plate, frame and sensor, joints between, a coefficient to the room behind a fan"
    free = ("plate.capacitance", "frame.capacitance", "foot.conductance", "glue.conductance", "skin.effective_htc")
    return TestSet("plate", source, structure, deck, free, tuple(runs), (".004 Hz", ".01 Hz"), sums)


LEVELS = (2, 4, 6, 8, 10)
BOILER = {
    "models/boiler_levels/measurement-history-heat-level-2.csv": "5e1fbf039456684de17f8c75dfee490ad872e6ba62eef8e454433bbd52c6eb0f",
    "models/boiler_levels/measurement-history-heat-level-4.csv": "6b0e157967d184112547593c23decd8febaabf24393471ea28f2569a0edbb9ed",
    "models/boiler_levels/measurement-history-heat-level-6.csv": "dc498f52b8f781dfaa8cd9f40f603613008298a2d7ccb48189dbb2fa270cef1f",
    "models/boiler_levels/measurement-history-heat-level-8.csv": "c6b6ae0a0664244ff98a869e781683aa18506674d8434983d104772893496ec3",
    "models/boiler_levels/measurement-history-heat-level-10.csv": "a9b8f3366467315c12fe517777775b0fad683b1c371ac82b10b54cc31d398db7",
}


def boiler(_: Path) -> TestSet:
    """Return an espresso machine whose boiler is heated for 30 s at five powers and cools; its room is taken as 25 degC."""
    paths, sums = _public("LukeChannings/gesha", BOILER)
    runs = []
    for k, path in zip(LEVELS, paths, strict=True):
        rows = np.genfromtxt(path, delimiter=",", skip_header=1)
        t = (rows[:, 0] - rows[0, 0]) / 1000.0
        grid = np.arange(0.0, t[-1] - 10.0, 10.0)
        readings = {n: means(t, rows[:, c], grid) + ICE for n, c in (("boiler", 1), ("group", 2))}
        held = np.array([rows[(t >= a) & (t < a + 10.0), 3].mean() if np.any((t >= a) & (t < a + 10.0)) else 0.0 for a in grid])
        first = {n: float(x) + ICE for n, x in (("element", rows[0, 1]), ("boiler", rows[0, 1]), ("group", rows[0, 2]))}
        at = {"room": np.full(grid.size, 25.0 + ICE)}
        runs.append(Condition(f"{10 * k} %", grid, readings, at, {"heat": 1100.0 * held}, initial=first, noise=0.1))
    deck = {
        "title": "Boiler",
        "needs": ["room"],
        "nodes": {n: {"capacitance": value(c, "J/K")} for n, c in (("element", 300), ("boiler", 1500), ("group", 1000))},
        "surfaces": {"front": _skin("group", 10.0, 0.03)},
        "conductors": {
            "flange": {"kind": "conduction", "between": ["boiler", "group"], "conductance": value(1, "W/K")},
            "sheath": {"kind": "conduction", "between": ["element", "boiler"], "conductance": value(5, "W/K")},
        },
        "loads": {"heat": {"into": "element", "power": "1 [W]"}},
    }
    free = tuple(f"{n}.capacitance" for n in ("element", "boiler", "group"))
    free += ("sheath.conductance", "flange.conductance", "front.effective_htc")
    source = "github.com/LukeChannings/gesha, no licence stated, 81fbcaa"
    structure = "element, boiler and group in series, a coefficient of the group to the room"
    return TestSet("boiler", source, structure, deck, free, tuple(runs), ("40 %", "60 %"), sums, ("element.capacitance",))


HOUSE = {"data/armadillo/armadillo_data_H2.csv": "87cafaf39e414a4f732c4ed01c8c74cc69c3cbad43ab439e68a40f39b9236a16"}


def house(_: Path) -> TestSet:
    """Return a house in four parts of a week, heated in steps; its wall is followed from where the first part has it."""
    paths, sums = _public("locie/pySIP", HOUSE)
    rows = np.genfromtxt(paths[0], delimiter=",", names=True)[:-1]
    runs = []
    for k, part in enumerate(np.array_split(np.arange(rows.size), 4)):
        t, outside, inside = (rows[n][part] for n in ("Time", "T_ext", "T_int"))
        wall = {"wall": 0.9 * float(inside[0]) + 0.1 * float(outside[:12].mean()) + ICE}
        own = {"initial.wall": LocalSpec(f"{wall['wall']} [K]", 3.0)}
        rooms, loads = {"room": outside + ICE}, {"heater": rows["P_hea"][part]}
        runs.append(Condition(f"part {k + 1}", t - t[0], {"indoor": inside + ICE}, rooms, loads, initial=wall, noise=0.05, local=own))
    deck = {
        "title": "House",
        "needs": ["room"],
        "nodes": {"indoor": {"capacitance": value(1.6e6, "J/K")}, "wall": {"capacitance": value(1.5e7, "J/K")}},
        "conductors": {
            "inside": {"kind": "conduction", "between": ["indoor", "wall"], "conductance": value(500, "W/K")},
            "outside": {"kind": "conduction", "between": ["wall", "room"], "conductance": value(57, "W/K")},
        },
        "loads": {"heater": {"into": "indoor", "power": "1 [W]"}},
    }

    whole = np.asarray(rows["Time"])
    rooms, loads = {"room": rows["T_ext"] + ICE}, {"heater": rows["P_hea"]}
    week = Condition("week", whole, {"indoor": rows["T_int"] + ICE}, rooms, loads)

    def follows(found: Calibration, c: Condition) -> dict[str, str]:
        begun = {"wall": f"{found.fitted['part 1: initial.wall']!r} [K]"}
        k = int(c.name.removeprefix("part ")) - 1
        until = td.simulate(found.model, week.scenario(begun), times=whole)
        return {"wall": f"{float(until['wall'].kelvin[np.array_split(np.arange(whole.size), 4)[k][0]])!r} [K]"}

    free = ("indoor.capacitance", "wall.capacitance", "inside.conductance", "outside.conductance")
    source = "github.com/locie/pySIP, no licence stated, da70d25"
    structure = "indoor air and wall in series to the outside"
    return TestSet("house", source, structure, deck, free, tuple(runs), ("part 1", "part 2"), sums, logged=True, follows=follows)


SETS: dict[str, Callable[[Path], TestSet]] = {
    "tclabsp": tclabsp,
    "tclab_apmonitor": apmonitor,
    "tclab_lisbon": ist,
    "tclab_santa_barbara": santa_barbara,
    "motor": motor,
    "cells": cells,
    "plate": sines,
    "boiler": boiler,
    "house": house,
}
LEFT_OUT = {
    "lhs1_vacuum_cooling": "two conditions, no power and no room in its logs",
    "uconsole_cm5_enclosure": "no power in its logs: a further condition has an unknown of its own",
    "rocket_avionics_rocketpy": "neither power nor ambient in its logs",
}
"""Sets that were looked at and are not used, and why."""


def present(data: Path) -> Iterator[tuple[str, TestSet | str]]:
    """Yield name -> the set, or why it is not here."""
    for name, make in SETS.items():
        try:
            yield name, make(data)
        except AbsentError as why:
            yield name, str(why)
