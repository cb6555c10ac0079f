"""What a run is compared by, and what is left of the comparison."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thermid import _kernel

Array = NDArray[np.float64]

LOSSES = {"linear": _kernel.SQUARE, "soft_l1": _kernel.SOFT_L1, "huber": _kernel.HUBER, "cauchy": _kernel.CAUCHY}


@dataclass(frozen=True, eq=False)
class Weighing:
    """What the readings of a run are compared by.

    Parameters
    ----------
    sigma, bias : array (channels,)     Standard deviation, and constant error that is taken off. [K]
    column : array (channels,)          Column of the constant error among those looked for; -1 for none.
    loss : str                          linear, soft_l1, huber or cauchy.
    knee : float                        Residual, in units of sigma, from which a robust loss bends.
    """

    sigma: Array
    bias: Array
    column: NDArray[np.int32]
    loss: str = "linear"
    knee: float = 1.0


@dataclass(frozen=True, eq=False)
class Squares:
    """The least squares of a run: with J the derivatives of all weighted residuals r, ``R'R = J'J`` and ``R'z = J'r``.

    Parameters
    ----------
    triangle : array (columns, columns)     R; columns are the free names, then the constant errors looked for.
    rotated : array (columns,)              z.
    cost : float                            Sum of the loss over all residuals, the sum of squares for a linear one. [-]
    chi_square : float                      Sum of squares, each weighed as a robust loss weighs it. [-]
    sums : array (channels, 7)              Of each channel's residuals, as `thermid.fit.problem.residuals.Sums` has them. [K]
    mesh : array (steps,)                   When the integrator's steps ended. [s]
    """

    triangle: Array
    rotated: Array
    cost: float
    chi_square: float
    sums: Array
    mesh: Array
