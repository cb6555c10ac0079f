"""From ice water to the interval of a fitted value: what a sensor shows too much goes the whole way."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from python_board import Board, BoardPort
from scipy.linalg import expm

import thermid as td
from thermid.bench.bench_files import MappedSensor, Programme, load_sensors
from thermid.bench.guide import ice_point
from thermid.bench.logger import Logger, Settings

DECK = Path(__file__).parents[2] / "examples" / "bench" / "plate.toml"
PLANTED = {"pads.resistance": (2.4, "K/W"), "skin.effective_htc": (11.0, "W/(m^2 K)")}
NAMES, OFFSETS = ("plate", "cover", "room"), (0.5, -0.375, 0.25)
"""What the sensors show too much. [K]"""


class Step:
    """The model with the planted values, its sensors off by `OFFSETS`."""

    def __init__(self) -> None:
        values = {name: f"{value} [{unit}]" for name, (value, unit) in PLANTED.items()}
        space = td.simulation.state_space(td.simulation.compile_network(td.load_model(DECK).with_values(values)))
        inputs = np.column_stack([space.B_boundary[:, 0], space.B_load[:, 0]])
        self.joint = np.block([[space.A, inputs], [np.zeros((2, 4))]])
        self.nodes, self.state, self.seconds = space.nodes, np.full(2, 21.0), 0.0
        self.rng = np.random.default_rng(4)

    def __call__(self, seconds: float, duties: tuple[float, float]) -> list[float]:
        step = expm(self.joint * (seconds - self.seconds))
        self.state, self.seconds = step[:2, :2] @ self.state + step[:2, 2:] @ [21.0, 6.0 * duties[0]], seconds
        felt = dict(zip(self.nodes, self.state, strict=True)) | {"room": 21.0}
        return [felt[name] + off + self.rng.normal(0.0, 0.04) for name, off in zip(NAMES, OFFSETS, strict=True)]


def logger(path: Path, board: Board, names: Mapping[str, MappedSensor], settings: Settings, programme: Programme | None = None) -> Logger:
    """A logger on a board whose clock is its own."""
    port = BoardPort(board)
    return Logger(path, lambda: port, names, settings, programme, sync=False, clock=port.clock, wall=port.wall)


def certified(folder: Path) -> Mapping[str, MappedSensor]:
    """A map with the certificates of the ice point."""
    rng, place = np.random.default_rng(5), folder / "sensors.toml"
    board = Board(lambda t, d: [off + rng.normal(0.0, 0.04) for off in OFFSETS], 3)
    names = {rom: MappedSensor(name, rom) for name, rom in zip(NAMES, board.roms, strict=True)}
    log = logger(folder / "ice.log", board, names, Settings())
    ice_point(log, place, print, lambda text: True)
    log.close()
    return load_sensors(place)


def fitted(path: Path) -> td.Calibration:
    channels = {"plate": "plate", "cover": "cover", "room": {"boundary": "room"}, "heater1": {"command": "heater"}}
    return td.calibrate(
        td.load_model(DECK).with_values({"plate.capacitance": "90 [J/K]"}), td.read_record(path, channels), free=list(PLANTED)
    )


def test_a_certificate_goes_from_ice_water_to_the_interval_of_a_value(tmp_path: Path) -> None:
    sensors = certified(tmp_path)
    for sensor, off in zip(sensors.values(), OFFSETS, strict=True):
        assert sensor.certificate is not None
        assert sensor.certificate.offset == pytest.approx(off, abs=0.02)
        assert 0.02 < sensor.certificate.uncertainty < 0.05
    found = {}
    for kind, names in (("certified", sensors), ("bare", {rom: replace(each, certificate=None) for rom, each in sensors.items()})):
        path = tmp_path / f"{kind}.log"
        log = logger(path, Board(Step(), 3), names, Settings(interval=10.0, limit=120.0), Programme((300.0,), ((1000, 0),), 3600.0))
        while not log.done:
            log.step()
        log.close()
        found[kind] = fitted(path)
        print(found[kind])
    for name, (planted, _) in PLANTED.items():
        value = found["certified"][name]
        assert abs(value.in_unit - planted) < 3.0 * value.error, name
    # each sensor may still be off by what its certificate leaves open, and the fit says what that does
    assert "constant error of plate: 0.02" in str(found["certified"])
    assert "sensor plate ~ sensor cover" in str(found["certified"])
    bare = found["bare"]["skin.effective_htc"]
    assert abs(bare.in_unit - 11.0) > 5.0 * found["certified"]["skin.effective_htc"].error
