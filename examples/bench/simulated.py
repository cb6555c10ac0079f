"""The firmware in the simulator of `bench/`, with sensors that a function drives. The simulator is a program of its own."""

from __future__ import annotations

import subprocess
from pathlib import Path

from python_board import World

from thermid.base.errors import MissingDataError, SolverError
from thermid.bench.port import Port


class Simulated:
    """A board in simavr that a logger reads as a port; its time passes only while somebody waits for a line, so no host is too slow for it.

    Parameters
    ----------
    world : callable       What the sensors feel, see `board.World`; asked once a step, with the mean duties of the step before.
    sensors : int          Number of sensors.
    folder : str or Path   Where `make bench-tools` has put the simulator and the firmware.
    step : float           Time between two calls of the world. [s]
    options : str          Further options of the simulator: --supply, --parasite.

    Raises
    ------
    MissingDataError   When simulator or firmware are not built.
    """

    def __init__(self, world: World, sensors: int, folder: str | Path, *, step: float = 1.0, options: tuple[str, ...] = ()) -> None:
        place = Path(folder)
        program, firmware = place / "bench", place / "thermid_bench.elf"
        for each in (program, firmware):
            if not each.exists():
                raise MissingDataError(f"'{each.name}' is not built. `make bench-tools` builds it, or says what it needs.", str(place))
        self.world, self.step = world, step
        self.seconds = 0.0
        self.duties = (0.0, 0.0)
        self.history: list[tuple[float, float, float]] = []
        """Time [s] and mean duties of each step."""
        self._orders: list[str] = []
        command = [str(program), "--sensors", str(sensors), "--step", str(round(step * 1000)), *options, str(firmware)]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1)
        self._port = Port(self._line().split()[1])

    def __enter__(self) -> Simulated:
        """Wait for the end of the first step, where the board stands until somebody waits for a line."""
        self._stand()
        return self

    def __exit__(self, *_: object) -> None:
        """End the simulator."""
        self._port.close()
        self._process.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                pipe.close()

    def tell(self, command: str) -> None:
        """Order a fault with the next step: ``fault 1 crc`` (lost, power, good), ``short 1``, ``supply 12000 5000``, ``reset``."""
        self._orders.append(command)

    def clock(self) -> float:
        """Return the time of the board, which a reset does not stop. [s]"""
        return self.seconds

    def read_line(self, timeout: float) -> bytes:
        """Return the next line with its line feed, empty where the board says none in a time of its own. [s]"""
        until = self.seconds + timeout
        while not (line := self._port.read_line(0.0)) and self.seconds < until:
            self._pass()
        return line

    def write(self, text: str) -> None:
        """Tell the board one line."""
        self._port.write(text)

    @property
    def begun(self) -> bytes:
        """A line that was not finished."""
        return self._port.begun

    def close(self) -> None:
        """Leave the board as it is."""

    def _pass(self) -> None:
        """Let one step pass."""
        assert self._process.stdin is not None
        told = [f"t {k} {round(t * 16)}" for k, t in enumerate(self.world(self.seconds, self.duties))]
        self._process.stdin.write("\n".join([*told, *self._orders, "go\n"]))
        self._process.stdin.flush()
        self._orders.clear()
        self._stand()

    def _stand(self) -> None:
        """Wait until the board stands at the end of a step."""
        _, ms, first, second = self._line().split()
        self.seconds = int(ms) / 1000.0
        self.duties = (float(first), float(second))
        self.history.append((self.seconds, *self.duties))

    def _line(self) -> str:
        """Return a line of the simulator."""
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise SolverError("the simulator ended.", "simulated bench")
        return line
