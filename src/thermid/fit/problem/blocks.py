"""What a fit compares: measured and predicted readings, trace by trace, and the sums that a minimisation needs of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thermid.fit.problem.statistics import Sums

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
