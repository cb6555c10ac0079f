"""The bench's log and a unit's telemetry, each on its own clock, as one record. Synthetic, made here.

    python examples/bench/two_clocks.py

The board knows when the heater was on and what the room did; the unit, with a clock of its own that began later and runs slow, knows the
temperatures of its parts. A model ties both: the offset and the rate at which the temperatures follow the heater.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
from python_board import Board, BoardPort
from scipy.linalg import expm

import thermid as td
from thermid.bench.bench_files import MappedSensor, Programme
from thermid.bench.logger import Logger, Settings

HERE = Path(__file__).resolve().parent
PLANTED = {"pads.resistance": "2.4 [K/W]", "skin.effective_htc": "11 [W/(m^2 K)]", "plate.capacitance": "120 [J/K]"}
OFFSET, RATE = -412.0, 1.0 / 1.0008
"""A time t of the bench is ``OFFSET + RATE t`` on the unit's clock, which runs slow. [s, -]"""
HOURS = 2.0
COUNT = 5.0 / 2**12 / 10e3 / 1e-6
"""Temperature of one count: 12 bits over 5 V, 10 kohm, a sensor of 1 uA/K. [K]"""


class Hardware:
    """The model with the planted values, and what it has lived through: times of the bench [s], temperatures [degC]."""

    def __init__(self) -> None:
        space = td.simulation.state_space(td.simulation.compile_network(td.load_model(HERE / "plate.toml").with_values(PLANTED)))
        self.nodes, self._matrix = list(space.nodes), space.A
        self._inputs = np.column_stack([space.B_boundary[:, 0], space.B_load[:, 0]])
        self._state = np.full(len(self.nodes), 21.0)
        self.times, self.states = [0.0], [self._state]

    def __call__(self, seconds: float, duties: tuple[float, float]) -> list[float]:
        """Live to a time with the duties since the time before; return what the one sensor of the bench feels, the room."""
        size, passed = len(self.nodes), seconds - self.times[-1]
        if passed > 0.0:
            joint = np.block([[self._matrix, self._inputs], [np.zeros((2, size + 2))]])
            step = expm(joint * passed)
            self._state = step[:size, :size] @ self._state + step[:size, size:] @ [21.0, 6.0 * duties[0]]
            self.times.append(seconds)
            self.states.append(self._state)
        return [21.0]


def make_logs(folder: Path, seed: int = 3) -> tuple[Path, Path]:
    """Run the bench, and let the unit send what its two sensors see."""
    hardware, text, table = Hardware(), folder / "bench.log", folder / "unit.csv"
    port = BoardPort(Board(hardware, 1))
    programme = Programme((600.0, 2400.0, 4200.0), ((800, 0), (200, 0), (0, 0)), HOURS * 3600.0)
    sensors = {port.board.roms[0]: MappedSensor("room", port.board.roms[0])}
    settings = Settings(interval=10.0, silence=3600.0)
    log = Logger(text, lambda: port, sensors, settings, programme, sync=False, clock=port.clock, wall=port.wall)
    while not log.state.lines:
        log.step()
    zero = log.state.ms / 1000.0  # a record begins with the first line that was heard
    while not log.done:
        log.step()
    log.close()
    rng = np.random.default_rng(seed)
    unit = np.arange(0.0, (HOURS * 3600.0 - 700.0), 5.0)  # on the unit's own clock
    when = zero + (unit - OFFSET) / RATE
    states = np.array(hardware.states)
    rows = [np.interp(when, hardware.times, states[:, k]) + 273.15 + rng.normal(0.0, 0.2, when.size) for k in range(len(hardware.nodes))]
    cells = np.column_stack([unit, COUNT * np.rint(np.array(rows).T / COUNT)])
    np.savetxt(table, cells, fmt="%.4f", delimiter=",", header="time [s],plate [K],cover [K]", comments="")
    return text, table


def clock_found(text: Path, table: Path) -> td.Calibration:
    """Read both, join them with an open clock, and return the fit that finds it; the values of the model are held."""
    sensors = {name: {"node": name, "accuracy": "1.5 [K]", "resolution": f"{COUNT:.4g} [K]"} for name in ("plate", "cover")}
    unit = td.read_record(table, sensors)
    bench = td.read_record(text, {"room": {"boundary": "room"}, "heater1": {"command": "heater"}})
    model = td.load_model(HERE / "plate.toml").with_values(PLANTED)
    rest = td.Scenario("at rest until the heater is on", start="steady")
    return td.calibrate(model, unit.joined(bench, (-900.0, 0.0), (0.995, 1.005)), [], scenario=rest)


def main() -> None:
    """Make the logs, find the clock, say what came out."""
    with tempfile.TemporaryDirectory() as folder:
        found = clock_found(*make_logs(Path(folder)))
    print(found)
    print(f"planted: offset {OFFSET:g} s, rate {RATE:.6f}")
    print(found.experiments[0].record)


if __name__ == "__main__":
    main()
