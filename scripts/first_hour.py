"""A simulated bench for the first hour with thermid: an aluminium box with a board and a converter on a plate, and its instruments.

Run it as ``python scripts/first_hour.py --to FOLDER``; ``--seed N`` varies masses, contacts, powers, noise and the offsets of the
instruments. ``--count 20`` runs `init` with the weight of the box and `calibrate` on the logs of that many seeds, with gains, lags, lost
readings and a late clock of the power besides, and prints a row for each: every value over its truth, and what was said of it. The thermal
truth is integrated here, without thermid. Everything is synthetic: nothing that it writes was measured.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

SIGMA = 5.670374419e-8
PARTS = ("box", "plate", "board", "converter")
NEAR, FAR = 1.5, 3.0
"""A value is near its truth within the first factor, and far off beyond the second. [-]"""


@dataclass(frozen=True)
class Bench:
    """What is on the table.

    Parameters
    ----------
    capacities : dict       Part -> heat capacity. [J/K]
    contact : float         Box to plate. [W/K]
    board, converter : float    Board to box, converter to box. [W/K]
    area, emissivity : float    Of the box to the room; convection is 1.4 (dT)^0.25 W/(m^2 K) and 1 W/(m^2 K) of draught. [m^2, -]
    plate_loss : float      Plate to the room. [W/K]
    efficiency : float      Of the converter: the rest of its input stays in it. [-]
    offsets : dict          Instrument (BOX, PLATE, AMB, BOARD) -> reading less temperature. [K]
    noise : float           [K]
    rest : float            Without power before the test. [s]
    steps : tuple           (duration [s], current [A]) after the rest, at `volts`.
    """

    capacities: dict[str, float] = field(default_factory=lambda: {"box": 1080.0, "plate": 2700.0, "board": 130.0, "converter": 45.0})
    contact: float = 2.4
    board: float = 1.1
    converter: float = 1.6
    area: float = 0.09
    emissivity: float = 0.8
    plate_loss: float = 1.3
    efficiency: float = 0.86
    offsets: dict[str, float] = field(default_factory=lambda: {"BOX": 0.41, "PLATE": -0.45, "AMB": 0.46, "BOARD": 0.2})
    noise: float = 0.03
    rest: float = 1200.0
    volts: float = 24.0
    steps: tuple[tuple[float, float], ...] = ((5400.0, 0.75), (2700.0, 0.2), (3600.0, 1.0), (3600.0, 0.0))

    @property
    def duration(self) -> float:
        """Of the test. [s]"""
        return self.rest + sum(length for length, _ in self.steps)

    def current(self, times: np.ndarray) -> np.ndarray:
        """Return the current of the supply. [A]"""
        edges = self.rest + np.cumsum([0.0, *(length for length, _ in self.steps)])
        levels = np.array([0.0, *(amperes for _, amperes in self.steps), 0.0])
        return levels[np.searchsorted(edges, times, side="right")]

    def room(self, times: np.ndarray) -> np.ndarray:
        """Return the temperature of the room: constant at rest, then it wanders. [K]"""
        return 295.15 + 0.4 * np.sin(np.maximum(times - self.rest, 0.0) / 2600.0)

    def heat(self, time: float, state: np.ndarray) -> np.ndarray:
        """Return the rates of the four temperatures. [K/s]"""
        box, plate, board, converter = state
        air, power = float(self.room(np.array(time))), self.volts * float(self.current(np.array(time)))
        film = 1.0 + 1.4 * abs(box - air) ** 0.25
        loss = self.area * (film * (box - air) + self.emissivity * SIGMA * (box**4 - air**4))
        down, up, side = self.contact * (box - plate), self.board * (board - box), self.converter * (converter - box)
        flows = np.array(
            [
                up + side - down - loss,
                down - self.plate_loss * (plate - air),
                self.efficiency * power - up,
                (1 - self.efficiency) * power - side,
            ]
        )
        return flows / np.array([self.capacities[p] for p in PARTS])

    def truth(self, times: np.ndarray) -> dict[str, np.ndarray]:
        """Return part -> temperature (samples,), from rest at the room's temperature; 'air' among them. [degC]"""
        edges = self.rest + np.cumsum([0.0, *(length for length, _ in self.steps)])
        state, out = np.full(4, float(self.room(np.zeros(1))[0])), np.zeros((4, times.size))
        for begin, end in zip([0.0, *edges], [*edges, times[-1] + 1.0], strict=True):
            inside = (times >= begin) & (times < end)
            if end <= begin:
                continue
            run = solve_ivp(self.heat, (begin, end - 1e-6), state, method="LSODA", rtol=1e-8, atol=1e-8, dense_output=True)
            if inside.any():
                out[:, inside] = run.sol(times[inside])
            state = run.y[:, -1]
        return {**{p: row - 273.15 for p, row in zip(PARTS, out, strict=True)}, "air": self.room(times) - 273.15}

    def readings(self, times: np.ndarray, seed: int = 0) -> dict[str, np.ndarray]:
        """Return instrument -> readings with its offset and noise. [degC]"""
        rng, true = np.random.default_rng([39, seed]), self.truth(times)
        seats = {"BOX": "box", "PLATE": "plate", "AMB": "air", "BOARD": "board"}
        return {n: true[p] + self.offsets[n] + self.noise * rng.standard_normal(times.size) for n, p in seats.items()}


def varied(seed: int) -> Bench:
    """Return the bench of a seed: 0 is that of the defaults."""
    if not seed:
        return Bench()
    rng = np.random.default_rng([37, seed])

    def about(value: float, factor: float) -> float:
        return float(value * factor ** rng.uniform(-1.0, 1.0))

    plain = Bench()
    return Bench(
        {p: about(c, 1.8) for p, c in plain.capacities.items()},
        about(plain.contact, 2.0),
        about(plain.board, 1.8),
        about(plain.converter, 1.8),
        about(plain.area, 1.5),
        float(rng.uniform(0.1, 0.9)),
        about(plain.plate_loss, 1.8),
        float(rng.uniform(0.75, 0.95)),
        {n: float(rng.uniform(-1.0, 1.0)) for n in plain.offsets},
        float(rng.uniform(0.01, 0.08)),
        float(rng.choice([600.0, 1200.0, 1800.0])),
        steps=tuple((about(length, 1.3), amperes and about(amperes, 1.4)) for length, amperes in plain.steps),
    )


def one_log(bench: Bench, path: Path, seed: int = 0, step: float = 20.0, parts: tuple[str, ...] = ("BOX", "PLATE")) -> Path:
    """Write one CSV of the bench with units in its header and the power in watts; return its path."""
    times = np.arange(0.0, bench.duration, step)
    read, watts = bench.readings(times, seed), bench.volts * bench.current(times)
    names = (*parts, "AMB")
    rows = [",".join(["time [s]", *(f"{n} [degC]" for n in names), "P_IN [W]"])]
    for k, t in enumerate(times):
        rows.append(",".join([f"{t:g}", *(f"{read[n][k]:.2f}" for n in names), f"{watts[k]:.3f}"]))
    path.write_text("\n".join(rows) + "\n")
    return path


def faulty_log(bench: Bench, path: Path, seed: int, step: float = 60.0) -> Path:
    """Write one CSV with faults of instruments: gains of 1 %, lags to 30 s, a restart with lost readings, power late by up to a minute."""
    rng, times = np.random.default_rng([41, seed]), np.arange(0.0, bench.duration, step)
    late, off = float(rng.uniform(0.0, 60.0)), float(rng.uniform(0.2, 0.8)) * bench.duration
    columns = {}
    for name in ("BOX", "PLATE", "AMB"):
        read = bench.readings(np.maximum(times - rng.uniform(0.0, 30.0), 0.0), seed)[name]
        columns[name] = 22.0 + (1.0 + rng.uniform(-0.01, 0.01)) * (read - 22.0)
    watts = bench.volts * bench.current(times - late)
    rows = ["time [s],BOX [degC],PLATE [degC],AMB [degC],P_IN [W]"]
    for k, t in enumerate(times):
        lost = off < t < off + 240.0
        cells = ["-127" if lost and name == "BOX" else f"{c[k]:.2f}" for name, c in columns.items()]
        rows.append(",".join([f"{t:g}", *cells, f"{watts[k]:.3f}"]))
    path.write_text("\n".join(rows) + "\n")
    return path


def judged(seed: int, folder: Path) -> dict[str, Any]:
    """Return what `init` and `calibrate` make of a seed: exit codes, values over their truth, and values called not physical."""
    bench = varied(seed)
    log = faulty_log(bench, folder / f"box_{seed}.csv", seed)
    project = folder / f"p{seed}"
    mass = f"box={bench.capacities['box'] / 896.0:.3f} [kg]"
    code, made = _said("init", log, "--to", project, "--mass", mass, "--material", "box=aluminium 6061")
    row: dict[str, Any] = {"seed": seed, "init": code}
    if made is None:
        return row
    row |= {
        "masses": made["masses"],
        "not_physical": [c["path"] for c in made["not_physical"]],
        "depends": [d["path"] for d in made["depends_on_structure"]],
        "fixed": made["fixed"],
    }
    row["calibrate"], done = _said("calibrate", project / "campaign.toml")
    if done is None or "stages" not in done:
        return row
    values = done["stages"][0]["values"]
    inside = sum(v for path, v in values.items() if path.endswith(".capacitance") and not path.startswith("plate"))
    heats = bench.capacities
    found = {
        "box.capacitance": inside / (heats["box"] + heats["board"] + heats["converter"]),
        "plate.capacitance": values.get("plate.capacitance", np.nan) / heats["plate"],
        "box_to_plate.conductance": values.get("box_to_plate.conductance", np.nan) / bench.contact,
    }
    named = [path for path in found if path in (*row["not_physical"], *row["fixed"], *row["depends"])]
    close = {path: bool(1 / NEAR <= ratio <= NEAR) for path, ratio in found.items()}
    far = [path for path, ratio in found.items() if not 1 / FAR <= ratio <= FAR]
    return row | {
        "ratios": {path: float(ratio) for path, ratio in found.items()},
        "named": named,
        "near": [path for path in found if close[path]],
        "far_unnamed": [path for path in far if path not in named],
        "usable": row["calibrate"] == 0 and all(close.values()),
    }


def counted(rows: list[dict[str, Any]]) -> dict[str, int]:
    """Return how many proposals are usable, how many values are far off without a word, and how many near ones have one."""
    near = [(path, path in row["named"]) for row in rows for path in row.get("near", ())]
    return {
        "boxes": len(rows),
        "usable": sum(row.get("usable", False) for row in rows),
        "far_unnamed": sum(len(row.get("far_unnamed", ())) for row in rows),
        "near": len(near),
        "near_named": sum(named for _, named in near),
    }


def _said(*arguments: object) -> tuple[int, Any]:
    """Run a command of thermid; return its exit code and its object, None where it gave none."""
    command = [sys.executable, "-m", "thermid", *map(str, arguments), "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    try:
        return done.returncode, json.loads(done.stdout)
    except ValueError:
        return done.returncode, None


def main() -> int:
    """Write the log of one bench, or count what becomes of several."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--to", type=Path, required=True, help="folder")
    parser.add_argument("--seed", type=int, default=0, help="which bench")
    parser.add_argument("--count", type=int, default=0, help="how many benches are judged")
    given = parser.parse_args()
    given.to.mkdir(parents=True, exist_ok=True)
    if given.count:
        rows = []
        for seed in range(given.seed, given.seed + given.count):
            rows.append(judged(seed, given.to))
            print(json.dumps(rows[-1]), flush=True)
        print(json.dumps(counted(rows)))
        return 0
    print(one_log(varied(given.seed), given.to / "box.csv", given.seed))
    return 0


if __name__ == "__main__":
    sys.exit(main())
