"""A bench to try the logger with: a heated plate, its cover and the room, made up."""

from __future__ import annotations

from collections.abc import Sequence
from math import pi, sin

from thermid.acquire.board import Board
from thermid.acquire.boardport import BoardPort


class Plate:
    """Two lumped bodies between a heater and a room that breathes by half a kelvin; a `World` for a `Board`."""

    def __init__(self) -> None:
        self.plate = self.cover = 21.0
        self.seconds = 0.0

    def __call__(self, seconds: float, duties: tuple[float, float]) -> Sequence[float]:
        """Return the temperatures at a time [degC]."""
        room = 21.0 + 0.5 * sin(2.0 * pi * seconds / 3600.0)
        power = 6.0 * duties[0]
        left = seconds - self.seconds
        while left > 0.0:
            step = min(left, 1.0)
            across = 0.4 * (self.plate - self.cover)
            self.plate += step * (power - across - 0.05 * (self.plate - room)) / 110.0
            self.cover += step * (across - 0.15 * (self.cover - room)) / 60.0
            left -= step
        self.seconds = seconds
        return (self.plate, self.cover, room)


def simulated(speed: float = 60.0) -> BoardPort:
    """Return a made-up board with three sensors, faster than time."""
    return BoardPort(Board(Plate(), 3), speed)
