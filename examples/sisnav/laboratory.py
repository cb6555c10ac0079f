"""The virtual laboratory of the study: a hidden unit, richer than the models, seen through the document's sensors. All of it is synthetic.

The authors' measurements are not public. The hidden unit has what the models leave out: natural convection that grows with the difference
of temperature, radiation, gyros whose power falls when they warm, a support with a mass of its own, and sensors that are glued on, weigh
something and lose heat through their leads. Its numbers differ from the decks'. Run it as ``python laboratory.py FOLDER``; no fit reads
what it knows. ``python laboratory.py FOLDER --swap m_PrE.ele=EleGFO_v2`` makes the same tests of a unit in which one part was replaced.
"""

from __future__ import annotations

import argparse
import json
import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import thermid as td
from thermid.model.tree import TableSignal
from thermid.physics.radiation import radiation_coefficient, radiation_conductance

Array = NDArray[np.float64]
HERE = Path(__file__).parent
SEED = 20261121
SECONDS = 18000.0
AMBIENT = 297.15
REMARK = "SYNTHETIC: made by laboratory.py from a hidden unit, not measured"
PARTS = ("Acc", "FOG_h", "FOG_l", "EleGFO", "ProcSISNAV", "m_PrE", "m_AccS", "m_IMU", "m_Sd")

EMISSIVITY = {"Acc": 0.3, "FOG_h": 0.1, "FOG_l": 0.1, "EleGFO": 0.06, "ProcSISNAV": 0.12, "m_AccS": 0.1, "m_IMU": 0.1, "m_Sd": 0.12}
"""Of the surfaces in each deck: machined steel and aluminium. [-]"""
EXPONENT = 0.25
"""Of the difference of temperature in a coefficient of convection: laminar, from plates. [-]"""
GYRO = {"temperature_coefficient": "-0.004 [1/K]", "reference_temperature": "39 [degC]"}
SENSOR = {"capacitance": "2.5 [J/K]", "glue": "0.12 [W/K]", "leads": "0.0012 [W/K]"}
POWER_ACCURACY = 0.01
"""Standard deviation of the constant error of each power meter, as a part of its reading. [-]"""
SPREAD = {"conductivity": 0.25, "gap.htc": 0.25, "mass": 0.04, "htc": 0.06}
"""Standard deviations, of logarithms, of what the hidden unit has over what the decks say. [-]"""


@dataclass(frozen=True)
class World:
    """The hidden unit.

    Parameters
    ----------
    models : dict   Name of a deck -> the hidden model in its place.
    truth : dict    What was changed -> factor over the deck's value. [-]
    swaps : dict    Where a part was replaced -> the deck that took its place.
    exponent        Of the difference of temperature in its coefficients of convection. [-]
    """

    models: dict[str, td.Model]
    truth: dict[str, float]
    swaps: dict[str, str] = field(default_factory=dict)
    exponent: float = EXPONENT

    @classmethod
    def make(cls, seed: int = SEED, swaps: dict[str, str] | None = None, exponent: float = EXPONENT) -> World:
        """Return the hidden unit, made from the decks with one seed; `swaps` gives ``deck.part`` -> deck of the part that replaces it.

        A new part has a hidden counterpart of its own; all others are those of the unit before.
        """
        world, rng = cls({}, {}, swaps or {}, exponent), np.random.default_rng(seed)
        for new in world.swaps.values():
            world.models[new] = _hidden(new, world, np.random.default_rng([seed, *new.encode()]))
        for name in PARTS:
            world.models[name] = _hidden(name, world, rng)
        return world

    def tested(self, name: str) -> td.Model:
        """Return the hidden model of a test; a part that was replaced is tested alone as its replacement."""
        return self.models[next((new for new in self.swaps.values() if new.removesuffix("_v2") == name), name)]


def _hidden(name: str, world: World, rng: np.random.Generator) -> td.Model:
    """Return the hidden counterpart of a deck."""
    public = td.load_model(HERE / f"{name}.toml")
    deck = tomllib.loads((HERE / f"{name}.toml").read_text(encoding="utf-8"))

    def factor(kind: str, what: str) -> float:
        world.truth[f"{name}.{what}"] = float(np.exp(SPREAD[kind] * rng.standard_normal()))
        return world.truth[f"{name}.{what}"]

    rest = td.steady(public, td.Scenario("bench", boundaries={"cv": f"{AMBIENT} [K]"}))
    for key, surface in deck.get("surfaces", {}).items():
        path = f"{key}.effective_htc"
        coefficient = _natural(public, rest, path, factor("htc", path), world.exponent)
        surface["htc"] = {"coefficient": coefficient, "exponent": world.exponent}
        surface["emissivity"] = EMISSIVITY[name.removesuffix("_v2")]
        del surface["effective_htc"]
    for path in [p for p in deck.get("set", {}) if p.endswith("effective_htc")]:
        coefficient = _natural(public, rest, path, factor("htc", path), world.exponent)
        deck["set"][f"{path.removesuffix('effective_htc')}htc.coefficient"] = coefficient
        del deck["set"][path]
    for key, parameter in deck.get("parameters", {}).items():
        if key.endswith("conductivity"):
            deck["parameters"][key] = _scaled(parameter, factor("conductivity", key))
        elif key == "mass":
            deck["parameters"][key] = _scaled(parameter, factor("mass", key))
    if name == "m_PrE":
        gap = deck["joints"]["stack"]["gap"]
        gap["htc"] = _scaled(gap["htc"], factor("gap.htc", "stack.gap.htc"))
    if name == "m_IMU":  # the support weighs by itself
        deck["nodes"]["support"] = {"mass": "support_mass", "specific_heat": "960 [J/(kg K)]"}
        for fog in "xyz":
            del deck["set"][f"fog_{fog}.shared_mass"]
    if name.startswith("FOG"):
        deck["loads"]["electronics"] |= GYRO
    if name != "Acc":  # its temperature comes from a channel of the processor
        for node in list(deck.get("nodes", {})):
            _glue(deck, node)
    for key, part in deck.get("submodels", {}).items():
        part["use"] = world.models[world.swaps.get(f"{name}.{key}", part["use"].removesuffix(".toml"))]
    return td.model_from_dict(deck | {"title": f"hidden {name}"})


def _natural(public: td.Model, rest: dict[str, float], path: str, factor: float, exponent: float) -> str:
    """Return the natural convection with which, radiation added, a surface at rest gives `factor` times its printed coefficient."""
    network = td.simulation.compile_network(public)
    *parts, surface, _ = path.split(".")
    owner = public
    for part in parts:
        owner = owner.submodels[part].model
    node = network.find(".".join([*parts, owner.surfaces[surface].of]))
    radiation = radiation_conductance(radiation_coefficient(EMISSIVITY[owner.title.removesuffix("_v2")], 1.0), rest[node], AMBIENT)
    own = factor * float(network.numbers().values[path]) - float(radiation)
    return f"{own / (rest[node] - AMBIENT) ** exponent!r} [W/(m^2 K)]"


def _scaled(parameter: dict[str, Any], factor: float) -> dict[str, Any]:
    number, _, unit = parameter["value"].partition(" [")
    return {"value": f"{factor!r}*({number}) [{unit}"}


def _glue(deck: dict[str, Any], node: str) -> None:
    """Add the sensor on a node: its mass, its glue, and what its leads lose."""
    name = f"{node}_sensor"
    deck["nodes"][name] = {"capacitance": SENSOR["capacitance"]}
    links = deck.setdefault("conductors", {})
    links[f"{name}_glue"] = {"kind": "conduction", "between": [node, name], "conductance": SENSOR["glue"]}
    links[f"{name}_leads"] = {"kind": "conduction", "between": [name, "cv"], "conductance": SENSOR["leads"]}
    deck["offers"] = [*deck.get("offers", []), name]


@dataclass(frozen=True)
class Thermometer:
    """A DS18B20 whose offset was taken at the ice point, or the temperature channel of the processor.

    Parameters
    ----------
    offset, gain : float    What is left of its error: reading = (1 + gain) T + offset. [K], [-]
    noise, step : float     Standard deviation of one reading, and its resolution. [K]
    late : float            Time from the instant of a value to its line in the log: the conversion. [s]
    """

    offset: float
    gain: float
    noise: float
    step: float
    late: float

    @classmethod
    def ds18b20(cls, rng: np.random.Generator) -> Thermometer:
        """Return one that read somewhere within +-0.5 K of the ice point and was corrected by what it read there."""
        raw = rng.uniform(-0.5, 0.5)
        read = np.round((raw + 0.03 * rng.standard_normal()) / 0.0625) * 0.0625
        return cls(raw - float(read), 0.002 * rng.standard_normal(), 0.02, 0.0625, 0.75)

    @classmethod
    def telemetry(cls, rng: np.random.Generator) -> Thermometer:
        """Return a channel of the processor: +-3 K, fast and noisy."""
        return cls(1.5 * rng.standard_normal(), 0.0, 0.35, 0.05, 0.0)

    def read(self, times: Array, kelvin: Array, rng: np.random.Generator) -> Array:
        """Return the readings (times,). [degC]"""
        celsius = np.interp(times - self.late, times, kelvin) - 273.15
        seen = (1.0 + self.gain) * celsius + self.offset + self.noise * rng.standard_normal(times.size)
        return np.asarray(np.round(seen / self.step) * self.step)


def thermometer(channel: str) -> Thermometer:
    """Return the thermometer of a channel; the same in every test."""
    rng = np.random.default_rng([SEED, *channel.encode()])
    return Thermometer.telemetry(rng) if channel.startswith("ACC") else Thermometer.ds18b20(rng)


@dataclass(frozen=True)
class Test:
    """One bench test: which unit, which sensor on which node, and what is switched off when.

    Parameters
    ----------
    model : str         Name of the deck.
    sensors : dict      Channel -> node; a channel that begins with ACC comes from the processor.
    off : dict          Load -> (from, to) in hours during which it is off.
    vacuum : bool       Whether it stands in a chamber without gas, whose walls are at the room's temperature.
    """

    model: str
    sensors: dict[str, str]
    off: dict[str, tuple[float, float]]
    vacuum: bool = False


_PRE = {"T_PROC": "proc.case_sensor", "T_ELE": "ele.case_sensor"}
_ACC = {"ACC_X": "acc_x.case", "ACC_Y": "acc_y.case", "ACC_Z": "acc_z.case", "T_ACCS": "support_sensor"}
_FOG = {"T_FOG1": "fog_x.case_sensor", "T_FOG2": "fog_y.case_sensor", "T_FOG3": "fog_z.case_sensor", "T_IMUS": "support_sensor"}
_IMU = {k: f"acc.{v}" for k, v in _ACC.items()} | _FOG
_SD = {k: f"pre.{v}" for k, v in _PRE.items()} | {k: f"imu.{v}" for k, v in _IMU.items()} | {"T_DISK": "disk_sensor"}
TESTS = {
    "acc": Test("Acc", {"ACC_X": "case"}, {"electronics": (3.0, 5.0)}),
    "fog_h": Test("FOG_h", {"T_FOG1": "case_sensor"}, {"electronics": (3.0, 5.0)}),
    "fog_l": Test("FOG_l", {"T_FOG2": "case_sensor"}, {"electronics": (3.0, 5.0)}),
    "elegfo": Test("EleGFO", {"T_ELE": "case_sensor"}, {"electronics": (3.0, 5.0)}),
    "procsisnav": Test("ProcSISNAV", {"T_PROC": "case_sensor"}, {"electronics": (3.0, 5.0)}),
    "pre_both": Test("m_PrE", _PRE, {"proc.electronics": (3.0, 5.0), "ele.electronics": (3.0, 5.0)}),
    "pre_proc_only": Test("m_PrE", _PRE, {"ele.electronics": (0.0, 5.0)}),
    "pre_held_out": Test("m_PrE", _PRE, {"proc.electronics": (2.0, 3.5)}),
    "accs": Test("m_AccS", _ACC, {}),
    "imu_all": Test("m_IMU", _IMU, {}),
    "imu_held_out": Test("m_IMU", _IMU, {f"fog_{a}.electronics": (2.5, 4.0) for a in "xyz"}),
    "sd_all": Test("m_Sd", _SD, {}),
    "sd_held_out": Test("m_Sd", _SD, {"pre.ele.electronics": (3.0, 5.0), "imu.fog_x.electronics": (3.0, 5.0)}),
}
CHAMBER = {
    "acc_vacuum": Test("Acc", {"ACC_X": "case"}, {}, True),
    "fog_h_vacuum": Test("FOG_h", {"T_FOG1": "case_sensor"}, {}, True),
    "fog_l_vacuum": Test("FOG_l", {"T_FOG2": "case_sensor"}, {}, True),
    "elegfo_vacuum": Test("EleGFO", {"T_ELE": "case_sensor"}, {}, True),
    "procsisnav_vacuum": Test("ProcSISNAV", {"T_PROC": "case_sensor"}, {}, True),
}
"""The second record of a component, at low pressure; `two_pressures.py` makes and uses them."""


def room(times: Array, rng: np.random.Generator) -> Array:
    """Return a room that drifts within +-0.7 K and wanders. [K]"""
    slow = 0.45 * np.sin(2 * np.pi * times / 15000.0 + rng.uniform(0, 6)) + 0.15 * np.sin(2 * np.pi * times / 3700.0 + rng.uniform(0, 6))
    wander, keep = np.zeros(times.size), np.exp(-1.0 / 150.0)
    kicks = 0.05 * np.sqrt(1 - keep * keep) * rng.standard_normal(times.size)
    for k in range(1, times.size):
        wander[k] = keep * wander[k - 1] + kicks[k]
    return np.asarray(AMBIENT + np.clip(slow + wander, -0.7, 0.7))


def meter_of(load: str) -> str:
    """Return the channel that logs the power of a load: P_PROC for pre.proc.electronics, P for a unit tested alone."""
    part = load.split(".")[-2] if "." in load else ""
    return f"P_{part.upper()}".rstrip("_")


def _pause(begin: float, end: float) -> TableSignal:
    """Return a command that is 0 between two hours and 1 before and after. [-]"""
    marks = [0.0] * (begin > 0) + [begin * 3600.0, end * 3600.0]
    return TableSignal(np.array(marks), np.array(([1.0] * (begin > 0)) + [0.0, 1.0]), hold=True)


def run(name: str, world: World, seed: int, test: Test | None = None) -> tuple[Array, dict[str, Array], dict[str, Array]]:
    """Return times (times,) [s], what the log of a test says, and the hidden true temperatures [degC] of the nodes under its sensors.

    `test` replaces the one of that name.
    """
    test, rng = test or (TESTS | CHAMBER)[name], np.random.default_rng(seed)
    times = np.arange(0.0, SECONDS + 1.0)
    air = room(times, rng)
    off = {load: _pause(*hours) for load, hours in test.off.items()}
    bench = td.Scenario(name, boundaries={"cv": (times, td.quantity(air, unit="K"))}, commands=off, start="cv", duration=SECONDS)
    solution = td.simulate(world.tested(test.model), bench.vacuum() if test.vacuum else bench, times=times)
    columns = {"T_ROOM": thermometer("T_ROOM").read(times, air, rng)}
    truth = {}
    for channel, node in test.sensors.items():
        columns[channel] = thermometer(channel).read(times, solution[node].kelvin, rng)
        truth[channel] = solution[node.removesuffix("_sensor")].celsius
    for load, watts in solution.load_powers.items():
        meter = 1.0 + POWER_ACCURACY * np.random.default_rng([SEED, *meter_of(load).encode()]).standard_normal()
        columns[meter_of(load)] = np.round(watts * meter * (1.0 + 0.001 * rng.standard_normal(times.size)), 4)
    return times, columns, truth


def main(folder: Path, swaps: dict[str, str] | None = None) -> None:
    """Write the logs of all tests, and apart from them what is hidden."""
    logs, hidden = folder / "logs", folder / "hidden"
    for made in (logs, hidden):
        made.mkdir(parents=True, exist_ok=True)
    world = World.make(swaps=swaps)
    for k, name in enumerate(TESTS):
        times, columns, truth = run(name, world, SEED + k)
        write(logs / f"{name}.csv", REMARK, times, columns)
        write(
            hidden / f"{name}.csv",
            "SYNTHETIC: true temperatures of the hidden unit, not for fitting",
            times[::60],
            {k: v[::60] for k, v in truth.items()},
        )
    (hidden / "truth.json").write_text(json.dumps(world.truth, indent=1), encoding="utf-8")


def write(path: Path, remark: str, times: Array, columns: dict[str, Array]) -> None:
    """Write a log whose first line says what it is."""
    header = f"# {remark}\n" + ",".join(["time_s", *columns])
    np.savetxt(
        path, np.column_stack([times, *columns.values()]), delimiter=",", header=header, comments="", fmt=["%.0f"] + ["%.4f"] * len(columns)
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Make the logs of the hidden unit.")
    parser.add_argument("folder", type=Path, nargs="?", default=HERE)
    parser.add_argument("--swap", action="append", default=[], help="DECK.PART=NEW_DECK, such as m_PrE.ele=EleGFO_v2")
    given = parser.parse_args()
    main(given.folder, dict(text.split("=", 1) for text in given.swap))
