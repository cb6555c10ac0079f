"""`Spread`: how far values may lie from where a model has them, and why: a fit, a tolerance, a prior."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from thermid.arguments import takes_objects
from thermid.errors import IdentificationError
from thermid.knowledge.values import FittedValues

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Spread:
    """How far some values may lie from where a model has them, normal or log-normal, correlated or not.

    Parameters
    ----------
    cause : str                     What a reader is told: ``fit``, ``stated``, ``split of effective coefficients``.
    names : tuple of str            Parameters, boundaries (a shift [K]), ``initial.<node>`` [K], ``scale.<load>`` (a factor on its power).
    covariance : array              Of the values [SI], or of their logarithms where `log` says so.
    log : tuple of bool             Which are spread in their logarithm; none by default.
    also : dict                     Name -> other parameters that share its value.
    """

    cause: str
    names: tuple[str, ...]
    covariance: Array
    log: tuple[bool, ...] = ()
    also: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check the parts against each other.

        Raises
        ------
        IdentificationError   When lengths differ, or the covariance is none.
        """
        size = len(self.names)
        covariance = np.asarray(self.covariance, dtype=float)
        if covariance.shape != (size, size) or len(self.log) not in (0, size):
            raise IdentificationError(f"{size} names need a covariance of {size} by {size}, and as many marks for logarithms.", self.cause)
        loose = [n for n, v in zip(self.names, np.diag(covariance), strict=True) if not np.isfinite(v)]
        if loose:
            raise IdentificationError(f"'{loose[0]}' has no finite error. Leave it out, or give it a spread of its own.", self.cause)
        sizes = np.linalg.eigvalsh(covariance) if size else np.zeros(0)
        if not np.allclose(covariance, covariance.T, rtol=1e-6) or sizes.min(initial=0.0) < -1e-9 * sizes.max(initial=0.0):
            raise IdentificationError("a covariance is symmetric, and no combination of values has a negative variance.", self.cause)
        object.__setattr__(self, "covariance", 0.5 * (covariance + covariance.T))
        object.__setattr__(self, "log", tuple(self.log) or (False,) * size)

    @classmethod
    @takes_objects
    def of(cls, values: FittedValues, at: str = "", cause: str = "") -> Spread:
        """Return what a fit leaves open, with its covariance.

        Parameters
        ----------
        values : FittedValues   Of a calibration, or from a file.
        at : str                The submodel that the values belong to; empty for the model itself.
        cause : str             ``fit of <stage>`` by default.
        """
        found = values.bare()
        ahead = f"{at}." if at else ""
        also = {ahead + p: tuple(ahead + q for q in v.also) for p, v in found.items() if v.also}
        names, logs = tuple(ahead + p for p in found), tuple(v.log for v in found.values())
        return cls(cause or f"fit of {values.stage}", names, found.covariance, logs, also)
