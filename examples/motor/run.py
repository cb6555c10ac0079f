"""A motor's winding, stator and room from two logs on two clocks; each run predicted from the other two. Real measurements.

``python run.py DATA`` with DATA the folder that holds ``Run1-Throttle4_temperatures.csv`` and its companions (README.md says where from).
"""

import sys
from pathlib import Path

import numpy as np

import thermid as td

here = Path(__file__).parent
RUNS = {"run 1": "Run1-Throttle4", "run 2": "Run2-Throttle100", "run 3": "Run3-Throttle48"}
FREE = ("winding.capacitance", "stator.capacitance", "slot.conductance")
START = td.Scenario("bench", initial={"winding": "WINDING", "stator": "STATOR"})
"""Both start at their first readings; a loose start would bend by several kelvin for what the model lacks later."""
OFFSET, RATE = (0.0, 60.0), (0.95, 1.3)
ROW, MEAN = 0.1, 20
"""The controller's log has no times; its author takes 0.1 s per row. Powers are means over 20 rows."""


def logs(data: Path, run: str) -> tuple[td.Record, td.Record]:
    """Return the thermocouples of a run on the clock of their logger, and the power on that of the controller."""
    stem = data / RUNS[run]
    t = np.genfromtxt(f"{stem}_temperatures.csv", delimiter=",", names=True)
    power = np.genfromtxt(f"{stem}_esc.csv", delimiter=",", names=True)["Power_W"]
    means = power[: power.size // MEAN * MEAN].reshape(-1, MEAN).mean(axis=1) / 1000.0
    command = np.concatenate([[0.0], means, [0.0]])  # off before the first row and after the last one

    def channel(name: str, column: str, **bound: str) -> td.Channel:
        return td.Channel.from_array(name, t[column], unit="degC", **bound, noise=None if name == "ROOM" else 2.0)

    temperatures = {
        "WINDING": channel("WINDING", "Winding_Temp_C", role="node", target="winding"),
        "STATOR": channel("STATOR", "Stator_Body_C", role="node", target="stator"),
        "ROOM": channel("ROOM", "Ambient_C", role="boundary", target="room"),
    }
    taken = {"P": td.Channel.from_array("P", command, quantity="command", role="command", target="copper", prompt=True)}
    step = ROW * MEAN
    return (
        td.Record.from_arrays(run, t["Time_s"], temperatures, synthetic=False),
        td.Record.from_arrays(run, step * (np.arange(command.size) - 1.0), taken, synthetic=False),
    )


def joined(data: Path, run: str) -> td.Record:
    """Return a run as one record, whose second clock a fit finds."""
    temperatures, power = logs(data, run)
    return temperatures.joined(power, OFFSET, RATE)


def fitted(data: Path, runs: tuple[str, ...], free: tuple[str, ...] = FREE) -> td.Calibration:
    """Return values and clocks of some runs, all from one fit."""
    model = td.load_model(here / "motor.toml")
    return td.calibrate(model, [joined(data, run) for run in runs], free, scenario=START, search="local")


def predicted(data: Path, run: str, fit: td.Calibration) -> td.Verdict:
    """Return how values from other runs meet a run; only its clock is found from it."""
    return td.validate(fit, joined(data, run), td.Criteria(rmse="10 [K]"), scenario=START)


if __name__ == "__main__":
    data = Path(sys.argv[1])
    for run in RUNS:
        fit = fitted(data, tuple(r for r in RUNS if r != run))
        verdict = predicted(data, run, fit)
        print(f"without {run}:\n{fit}\npredicted:\n{verdict}\n{verdict.prediction}\n")
    print(fitted(data, tuple(RUNS), (*FREE, "growth")))
