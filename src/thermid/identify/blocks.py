"""What a fit compares: measured and predicted readings, trace by trace, and the sums that a minimisation needs of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import overload

import numpy as np
from numpy.typing import NDArray

from thermid.identify.statistics import Sums

__all__ = ["Block", "Compressed", "Predictions"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Block:
    """One sensor of one record at some values of the unknowns.

    Parameters
    ----------
    record, sensor, node : str      Names.
    times : array (samples,)        [s]
    measured, predicted : array     Reading, and what the model with its sensor's constant error says. [K]
    noise : float                   The weight's standard deviation. [K]
    """

    record: str
    sensor: str
    node: str
    times: Array
    measured: Array
    predicted: Array
    noise: float

    @property
    def residuals(self) -> Array:
        """Measured less predicted (samples,). [K]"""
        return self.measured - self.predicted


class Predictions(Sequence[Block]):
    """Blocks that are predicted when they are first looked at; what a fit needs of them it has in its sums.

    Parameters
    ----------
    sums : sequence of (str, str, Sums)     Record, sensor, and the sums of its residuals.
    make : callable                         Returns the blocks, in the same order.
    """

    def __init__(self, sums: Sequence[tuple[str, str, Sums]], make: Callable[[], Sequence[Block]]) -> None:
        self.sums = tuple(sums)
        self._make = make
        self._made: tuple[Block, ...] = ()

    def _blocks(self) -> tuple[Block, ...]:
        if not self._made:
            self._made = tuple(self._make())
        return self._made

    @overload
    def __getitem__(self, at: int) -> Block: ...
    @overload
    def __getitem__(self, at: slice) -> tuple[Block, ...]: ...
    def __getitem__(self, at: int | slice) -> Block | tuple[Block, ...]:
        """Return a block, or several."""
        return self._blocks()[at]

    def __iter__(self) -> Iterator[Block]:
        """Yield the blocks."""
        return iter(self._blocks())

    def __len__(self) -> int:
        """How many there are."""
        return len(self.sums)


@dataclass(frozen=True, eq=False)
class Compressed:
    """All residuals of the data at some values of the unknowns, in as few rows as hold the same information.

    Parameters
    ----------
    rows : array (rows,)                Residuals; half their sum of squares is the cost, the loss included. [-]
    slopes : array (rows, unknowns)     Their derivatives: ``slopes' slopes`` is J'J, ``slopes' rows`` J'r of all weighted residuals.
    chi_square : float                  Sum of squares, each weighed as a robust loss weighs it. [-]
    sums : tuple of (str, str, Sums)    Record, sensor, and the sums of its residuals.
    meshes : tuple of array             When the integrator's steps ended, per record. [s]
    """

    rows: Array
    slopes: Array
    chi_square: float
    sums: tuple[tuple[str, str, Sums], ...]
    meshes: tuple[Array, ...]
