"""A motor's winding, stator and room from two logs on two clocks; each run predicted from the other two. Real measurements.

``python run.py DATA`` with DATA the folder that holds ``Run1-Throttle4_temperatures.csv`` and its companions (README.md says where from).
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import thermid as td

here = Path(__file__).parent
RUNS = {"run 1": "Run1-Throttle4", "run 2": "Run2-Throttle100", "run 3": "Run3-Throttle48"}
FREE = ("winding.capacitance", "stator.capacitance", "slot.conductance")
START = {f"initial.{node}": {"start": node.upper(), "sd": "0.5 [K]"} for node in ("winding", "stator")}
OFFSET, RATE = (0.0, 60.0), (0.95, 1.3)
ROW, MEAN = 0.1, 20
"""The controller's log has no times; its author takes 0.1 s per row. Powers are means over 20 rows."""
ROUNDS, CLOSE = 8, (0.02, 1e-5)
"""Most rounds of aligning and fitting, and changes of offset [s] and rate below which they end."""


def logs(data: Path, run: str) -> tuple[td.Record, td.Record]:
    """Return the thermocouples of a run on the clock of their logger, and the power on that of the controller."""
    stem = data / RUNS[run]
    t = np.genfromtxt(f"{stem}_temperatures.csv", delimiter=",", names=True)
    power = np.genfromtxt(f"{stem}_esc.csv", delimiter=",", names=True)["Power_W"]
    means = power[: power.size // MEAN * MEAN].reshape(-1, MEAN).mean(axis=1) / 1000.0
    command = np.concatenate([[0.0], means, [0.0]])  # off before the first row and after the last one

    def channel(name: str, column: str, **bound: str) -> td.Channel:
        return td.Channel.of(name, t[column] + 273.15, **bound, noise=None if name == "ROOM" else 2.0)

    temperatures = {
        "WINDING": channel("WINDING", "Winding_Temp_C", role="node", target="winding"),
        "STATOR": channel("STATOR", "Stator_Body_C", role="node", target="stator"),
        "ROOM": channel("ROOM", "Ambient_C", role="boundary", target="room"),
    }
    taken = {"P": td.Channel.of("P", command, quantity="command", role="command", target="copper")}
    step = ROW * MEAN
    return (
        td.Record.from_arrays(run, t["Time_s"], temperatures, synthetic=False),
        td.Record.from_arrays(run, step * (np.arange(command.size) - 1.0), taken, synthetic=False),
    )


@dataclass(frozen=True)
class Study:
    """A fit of some runs, with their clocks."""

    fit: td.Calibration
    clocks: dict[str, td.Alignment]


def fitted(data: Path, runs: tuple[str, ...], free: tuple[str, ...] = FREE) -> Study:
    """Return values and clocks of some runs: aligning and fitting take turns."""
    model = td.load_model(here / "motor.toml")
    pairs = {run: logs(data, run) for run in runs}
    clocks: dict[str, td.Alignment] = {}
    for _ in range(ROUNDS):
        around = {run: (max(c.offset - 4.0, OFFSET[0]), c.offset + 4.0) for run, c in clocks.items()}
        before = clocks
        clocks = {run: td.align(model, *pairs[run], offset=around.get(run, OFFSET), rate=RATE, local=START) for run in runs}
        fit = td.calibrate(model, [c.record for c in clocks.values()], free, local=START, search="local")
        model = fit.fitted_model
        moved = [(abs(c.offset - b.offset), abs(c.rate - b.rate)) for c, b in zip(clocks.values(), before.values(), strict=False)]
        if moved and all(offset < CLOSE[0] and rate < CLOSE[1] for offset, rate in moved):
            break
    return Study(fit, clocks)


def predicted(data: Path, run: str, study: Study) -> td.Alignment:
    """Return how values from other runs meet a run; only its clock is found from it."""
    return td.align(study.fit.fitted_model, *logs(data, run), offset=OFFSET, rate=RATE, local=START)


if __name__ == "__main__":
    data = Path(sys.argv[1])
    for run in RUNS:
        study = fitted(data, tuple(r for r in RUNS if r != run))
        print(f"without {run}: " + ", ".join(f"{p} {v.value:.4g} {v.unit}" for p, v in study.fit.values.parameters.items()))
        print("  " + "\n  ".join(map(str, study.clocks.values())))
        print(f"  predicted: {predicted(data, run, study)}")
    whole = fitted(data, tuple(RUNS), (*FREE, "growth"))
    print(whole.fit)
