"""Make the logs of this example: a hidden stack, observed through sensors with offsets and 1/16 K steps. Synthetic, and labelled so.

The hidden truth differs from the decks in the parameters that the campaign frees. Run it as ``python make_logs.py FOLDER``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import thermid as td

HERE = Path(__file__).parent
STACK = HERE.parent / "02_stack"
TRUTH = {
    "ProcSISNAV": {"skin.effective_htc": "5.4 [W/(m^2 K)]", "case.mass": "1.61 [kg]"},
    "EleGFO": {"skin.effective_htc": "2.45 [W/(m^2 K)]", "case.mass": "0.70 [kg]"},
    "m_PrE": {
        "ele.skin.effective_htc": "2.3 [W/(m^2 K)]",
        "stack.contact_conductance": "180 [W/(m^2 K)]",
        "stack.gap.htc": "5.0 [W/(m^2 K)]",
    },
}
OFFSETS = {"T_PROC": 0.22, "T_ELE": -0.31, "T_ROOM": 0.1}
"""Constant error of each sensor; a DS18B20 is good to 0.5 K. [K]"""
POWER_GAIN = 1.008
"""What the power meter reads over what is there; it is good to 1 %. [-]"""
STEP, NOISE, SECONDS, EVERY = 0.0625, 0.05, 18000.0, 30.0


def room(times: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return a room that drifts and wanders. [K]"""
    drift = 0.35 * np.sin(2 * np.pi * times / 15000.0 + rng.uniform(0, 6)) + 0.12 * np.sin(2 * np.pi * times / 3700.0 + rng.uniform(0, 6))
    return 297.15 + drift


def log(path: Path, model: td.Model, boundary: str, nodes: dict[str, str], powers: dict[str, tuple[str, float]], seed: int) -> None:
    """Simulate one bench test and write what its sensors would have logged."""
    rng = np.random.default_rng(seed)
    times = np.arange(0.0, SECONDS + 1.0, EVERY)
    air = room(times, rng)
    scenario = td.Scenario(
        "bench",
        boundaries={boundary: (times, td.quantity(air, unit="K"))},
        loads={load: f"{watts} [W]" for load, watts in powers.values()},
        start="24.1 [degC]",
        duration=SECONDS,
    )
    solution = td.simulate(model, scenario, times=times)
    columns = {"T_ROOM": air, **{sensor: solution[node].kelvin for sensor, node in nodes.items()}}
    table = [times]
    for sensor, kelvin in columns.items():
        reading = kelvin - 273.15 + OFFSETS[sensor] + NOISE * rng.standard_normal(times.size)
        table.append(np.round(reading / STEP) * STEP)
    for meter, (_, watts) in powers.items():
        columns[meter] = np.full(times.size, watts)
        table.append(np.full(times.size, watts * POWER_GAIN))
    header = "# SYNTHETIC: made by make_logs.py from a hidden model, not measured\n" + ",".join(["time_s", *columns])
    np.savetxt(path, np.column_stack(table), delimiter=",", header=header, comments="", fmt=["%.0f"] + ["%.4f"] * (len(table) - 1))


def main(folder: Path) -> None:
    """Write the four logs of the campaign."""
    folder.mkdir(parents=True, exist_ok=True)
    proc = td.load_model(STACK / "ProcSISNAV.toml").with_values(TRUTH["ProcSISNAV"])
    ele = td.load_model(STACK / "EleGFO.toml").with_values(TRUTH["EleGFO"])
    pre = td.load_model(STACK / "m_PrE.toml").replace("proc", proc).replace("ele", ele).with_values(TRUTH["m_PrE"])
    log(folder / "proc_bench.csv", proc, "air", {"T_PROC": "case"}, {"P_PROC": ("electronics", 4.11)}, 1)
    log(folder / "ele_bench.csv", ele, "air", {"T_ELE": "case"}, {"P_ELE": ("electronics", 2.168)}, 2)
    nodes = {"T_PROC": "proc.case", "T_ELE": "ele.case"}
    log(folder / "stack_bench.csv", pre, "cv", nodes, {"P_PROC": ("proc.electronics", 4.11), "P_ELE": ("ele.electronics", 2.168)}, 3)
    log(folder / "stack_proc_only.csv", pre, "cv", nodes, {"P_PROC": ("proc.electronics", 4.11), "P_ELE": ("ele.electronics", 0.0)}, 5)
    log(folder / "stack_held_out.csv", pre, "cv", nodes, {"P_PROC": ("proc.electronics", 2.0), "P_ELE": ("ele.electronics", 2.168)}, 4)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE / "logs")
