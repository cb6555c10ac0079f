"""The firmware in the simulator of `bench/`, with sensors that a function drives. The simulator is a program of its own."""

from __future__ import annotations

import subprocess
import threading
from pathlib import Path

from thermid.base.errors import MissingDataError, SolverError
from thermid.bench.board import World


class Simulated:
    """A board in simavr that a logger can open as a port; time passes as fast as the machine allows.

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
        self._wanted: list[str] = []
        self._lock = threading.Lock()
        self._sensors = sensors
        command = [str(program), "--sensors", str(sensors), "--step", str(round(step * 1000)), *options, str(firmware)]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1)
        self.port = self._line().split()[1]
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> Simulated:
        """Let time pass."""
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """End the simulator."""
        self._process.kill()
        self._thread.join()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                pipe.close()

    def tell(self, command: str) -> None:
        """Order a fault with the next step: ``fault 1 crc`` (lost, power, good), ``short 1``, ``supply 12000 5000``, ``reset``."""
        with self._lock:
            self._wanted.append(command)

    def _line(self) -> str:
        """Return a line of the simulator."""
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise SolverError("the simulator ended.", "simulated bench")
        return line

    def _run(self) -> None:
        """Close the loop, step by step."""
        assert self._process.stdin is not None
        try:
            while True:
                _, ms, first, second = self._line().split()
                self.seconds = int(ms) / 1000.0
                self.duties = (float(first), float(second))
                self.history.append((self.seconds, *self.duties))
                told = [f"t {k} {round(t * 16)}" for k, t in enumerate(self.world(self.seconds, self.duties))]
                with self._lock:
                    told += self._wanted
                    self._wanted.clear()
                self._process.stdin.write("\n".join([*told, "go\n"]))
                self._process.stdin.flush()
        except (SolverError, OSError, ValueError):
            return  # it was ended
