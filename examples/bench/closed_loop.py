"""A step test without hardware: a model in place of the hardware, the compiled firmware in its simulator, the logger, and a fit of the log.

    make bench-tools                            # simulator and firmware, once
    python examples/bench/closed_loop.py        # five hours of the bench in some minutes
    python examples/bench/closed_loop.py 0.5    # or fewer hours

The three planted values differ from those of the deck that the fit begins with.
"""

from __future__ import annotations

import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from python_board import World, made_up_rom
from scipy.linalg import expm
from simulated import Simulated

import thermid as td
from thermid.bench.bench_files import MappedSensor, load_programme
from thermid.bench.logger import Logger, Settings

HERE = Path(__file__).resolve().parent
TOOLS = HERE.parents[1] / "build" / "bench"
PLANTED = {"pads.resistance": "2.4 [K/W]", "skin.effective_htc": "11 [W/(m^2 K)]", "plate.capacitance": "120 [J/K]"}
NAMES = ("plate", "cover", "room")
STEP = 0.1  # s; sensors are read anywhere within a step, so it is short beside the time constants and the interval
NOISE = 0.03  # K, before the steps of the sensor
BOTH = f"{np.hypot(NOISE, 0.0625 / 12**0.5):.3f} [K]"


def planted(seed: int = 1) -> World:
    """What the sensors feel: the model with the planted values, stepped exactly, in a room that breathes by a kelvin."""
    space = td.simulation.state_space(td.simulation.compile_network(td.load_model(HERE / "plate.toml").with_values(PLANTED)))
    rng = np.random.default_rng(seed)
    size = len(space.nodes)
    # one step with held inputs: the exponential of the matrix and its inputs together
    inputs = np.column_stack([space.B_boundary[:, 0], space.B_load[:, 0]])
    joint = np.block([[space.A, inputs], [np.zeros((2, size + 2))]])
    whole, half = expm(joint * STEP), expm(joint * STEP / 2.0)
    state = np.full(size, 21.0)

    def world(seconds: float, duties: tuple[float, float]) -> list[float]:
        nonlocal state
        room = 21.0 + np.sin(seconds / 2500.0)
        state = whole[:size, :size] @ state + whole[:size, size:] @ [room, 6.0 * duties[0]]
        # sensors keep what they are told for the step that follows: its middle, or all would lag by half a step
        middle = half[:size, :size] @ state + half[:size, size:] @ [room, 6.0 * duties[0]]
        felt = dict(zip(space.nodes, middle, strict=True)) | {"room": room}
        return [felt[name] + rng.normal(0.0, NOISE) for name in NAMES]

    return world


def run(log_path: Path, hours: float) -> float:
    """Log the step test, and return the seconds that it took."""
    sensors = {made_up_rom(k): MappedSensor(name, made_up_rom(k)) for k, name in enumerate(NAMES)}
    whole = load_programme(HERE / "step.toml")
    scale = hours / 5.0
    programme = replace(whole, times=tuple(t * scale for t in whole.times), end=hours * 3600.0)
    begun = time.monotonic()
    with Simulated(planted(), len(NAMES), TOOLS, step=STEP) as board:
        settings = Settings(interval=10.0, limit=90.0)
        log = Logger(log_path, lambda: board, sensors, settings, programme, sync=False, clock=board.clock)
        while not log.done:
            log.step()
        log.close()
    return time.monotonic() - begun


def fit(log_path: Path) -> td.Calibration:
    """Fit the three values to the log."""
    channels = {
        "plate": {"node": "plate", "noise": BOTH},
        "cover": {"node": "cover", "noise": BOTH},
        "room": {"boundary": "room", "noise": BOTH},
        "heater1": {"command": "heater"},
    }
    record = td.read_record(log_path, channels)
    return td.calibrate(td.load_model(HERE / "plate.toml"), record, free=list(PLANTED))


def main() -> None:
    """Run, fit, compare."""
    hours = float(sys.argv[1]) if len(sys.argv) > 1 else 5.0
    with tempfile.TemporaryDirectory() as folder:
        log_path = Path(folder) / "bench.log"
        took = run(log_path, hours)
        print(f"{hours:g} h of the bench in {took:.0f} s")
        found = fit(log_path)
    print(found)
    for path, text in PLANTED.items():
        print(f"planted {path} = {text}")


if __name__ == "__main__":
    main()
