"""Two nodes joined through a massless point that sees the ambient: Eqs. 4 to 6 of the source document (its Fig. 19).

Written with conductances, so an eliminated gap (Rcn3 infinite), a vacuum (all Rcn infinite) and a missing joint are ordinary zeros; the
printed formula in resistances gives NaN there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from thermid.base.errors import SolverError
from thermid.physics._number import Number


def star_to_delta(first: Number, second: Number, third: Number) -> tuple[Number, Number, Number]:
    """Conductances of the triangle that replaces a star: first-second, first-third, second-third [W/K].

    Parameters
    ----------
    first, second, third : float or array   Conductances of the three arms, not all zero. [W/K]

    References
    ----------
    Kennelly, Electrical World and Engineer 34 (1899) 413; Eq. 4 of the source document is the same elimination.

    Examples
    --------
    Arms of 2, 3 and 6 ohm make a triangle of 6, 12 and 18 ohm:

    >>> [round(1 / g, 9) for g in star_to_delta(1 / 2, 1 / 3, 1 / 6)]
    [6.0, 12.0, 18.0]
    """
    total = first + second + third
    return first * second / total, first * third / total, second * third / total


@dataclass(frozen=True)
class TwoNodes:
    """Two capacitances, each convecting to the ambient, joined at a massless point that convects too.

    Parameters
    ----------
    capacitances : tuple of 2   Mass times specific heat of node 1 and 2. [J/K]
    powers : tuple of 2         Power in node 1 and 2. [W]
    to_ambient : tuple of 2     Conductance of each node to the ambient, 1/Rcn1 and 1/Rcn2. [W/K]
    joints : tuple of 2         Conductance of each node to the massless point, 1/Rcd1 and 1/Rcd2. [W/K]
    gap : float                 Conductance of the massless point to the ambient, 1/Rcn3. [W/K]

    References
    ----------
    Source document, Eqs. 4 to 6 and Fig. 20.

    Examples
    --------
    The pair of the acceptance case (1 = ProcSISNAV, 2 = EleGFO) after an hour and when settled:

    >>> pair = TwoNodes.from_resistances(
    ...     (1468.8, 707.52), (4.11, 2.168), (3.593502947, 7.223653710), (1.390410959, 1.390410959), 9.328358209
    ... )
    >>> pair.temperatures(3600.0, ambient=24.0).round(4).tolist()
    [30.9714, 30.9994]
    >>> [round(t, 4) for t in pair.steady(24.0)]
    [36.2525, 35.9861]
    """

    capacitances: tuple[float, float]
    powers: tuple[float, float]
    to_ambient: tuple[float, float]
    joints: tuple[float, float]
    gap: float = 0.0

    @classmethod
    def from_resistances(
        cls,
        capacitances: tuple[float, float],
        powers: tuple[float, float],
        convection: tuple[float, float],
        joints: tuple[float, float],
        gap: float = math.inf,
    ) -> TwoNodes:
        """Pair with resistances as printed, Rcn1 and Rcn2, Rcd1 and Rcd2, Rcn3; infinite ones are open. [K/W]."""
        return cls(capacitances, powers, (1 / convection[0], 1 / convection[1]), (1 / joints[0], 1 / joints[1]), 1 / gap)

    def links(self) -> tuple[float, float, float]:
        """Conductances node 1 to 2, node 1 to ambient, node 2 to ambient, without the massless point [W/K]."""
        if sum(self.joints) == 0:
            return 0.0, *self.to_ambient
        between, first, second = star_to_delta(*self.joints, self.gap)
        return between, self.to_ambient[0] + first, self.to_ambient[1] + second

    def matrix(self) -> NDArray[np.float64]:
        """Matrix A of Eq. 5, dT/dt = A T + b, shape (2, 2) [1/s]."""
        between, first, second = self.links()
        conductances = np.array([[-first - between, between], [between, -second - between]])
        return np.asarray(conductances / np.array(self.capacitances)[:, None])

    def eigenvalues(self) -> tuple[float, float]:
        """Eigenvalues of A, real and not positive, the slow one first; in vacuum it is exactly zero [1/s]."""
        between, first, second = self.links()
        (a, b), (c, d) = self.matrix().tolist()
        fast = (a + d) / 2 - math.hypot((a - d) / 2, math.sqrt(b * c))
        # det A as a sum of positive terms: no cancellation, however weak the path to the ambient.
        determinant = (first * second + between * (first + second)) / (self.capacitances[0] * self.capacitances[1])
        return (determinant / fast if fast else 0.0), fast

    def time_constants(self) -> tuple[float, float]:
        """Time constants, the slow one first; infinite where nothing decays [s]."""
        slow, fast = self.eigenvalues()
        return (-1 / slow if slow else math.inf), (-1 / fast if fast else math.inf)

    def steady(self, ambient: float) -> tuple[float, float]:
        """Settled temperatures of both nodes, on the scale of the ambient [K] or [degC].

        Raises
        ------
        SolverError   Nothing leads to the ambient, as in vacuum.
        """
        between, first, second = self.links()
        determinant = first * second + between * (first + second)
        if determinant == 0:
            raise SolverError("The pair has no steady state: a node has no path to the ambient. Use temperatures() or vacuum_slope().")
        one, two = self.powers
        rise_1 = (one * (second + between) + two * between) / determinant
        rise_2 = (two * (first + between) + one * between) / determinant
        return ambient + rise_1, ambient + rise_2

    def temperatures(self, time: Number, ambient: float, start: tuple[float, float] | None = None) -> NDArray[np.float64]:
        """Temperatures of both nodes under constant powers and ambient, shape of time + (2,) [K] or [degC].

        Eq. 6 with its constants c = V^-1 (T(0) - T_ss), arranged so that it also holds where T_ss does not exist.

        Parameters
        ----------
        time : float or array (times,)   Time since the start. [s]
        ambient : float                  Temperature of the ambient. [K] or [degC]
        start : tuple of 2, optional     Initial temperatures; the ambient if not given. Same scale.
        """
        slow, fast = self.eigenvalues()
        times = np.asarray(time, dtype=float)[..., None]
        excess = np.zeros(2) if start is None else np.asarray(start) - ambient
        heating = np.divide(self.powers, self.capacitances)
        matrix, gap = self.matrix(), fast - slow
        # Functions of a 2 x 2 matrix by Sylvester: f(A) = f(slow) + (f(fast) - f(slow)) (A - slow) / (fast - slow).
        remainder = (matrix - slow * np.eye(2)) / (gap or 1.0)
        decay_slow, decay_fast = np.exp(slow * times), np.exp(fast * times)
        gain_slow, gain_fast = _gain(slow, times), _gain(fast, times)
        free = decay_slow * excess + (decay_fast - decay_slow) * (remainder @ excess)
        forced = gain_slow * heating + (gain_fast - gain_slow) * (remainder @ heating)
        return np.asarray(ambient + free + forced)

    def junction(self, first: Number, second: Number, ambient: Number) -> Number:
        """Temperature of the massless point between two given node temperatures, T_cd of Eq. 4 [K] or [degC]."""
        total = self.joints[0] + self.joints[1] + self.gap
        return (self.joints[0] * first + self.joints[1] * second + self.gap * ambient) / total

    def vacuum(self) -> TwoNodes:
        """Copy of the pair with nothing leading to the ambient."""
        return replace(self, to_ambient=(0.0, 0.0), gap=0.0)

    def vacuum_slope(self) -> float:
        """Slope of the mean temperature in vacuum, (Q1 + Q2) / (C1 + C2) [K/s]."""
        return sum(self.powers) / sum(self.capacitances)

    def vacuum_difference(self) -> float:
        """T1 - T2 towards which the pair drifts in vacuum, (Rcd1 + Rcd2)(Q1 C2 - Q2 C1)/(C1 + C2) [K]."""
        (one, two), (c_1, c_2) = self.powers, self.capacitances
        return (1 / self.joints[0] + 1 / self.joints[1]) * (one * c_2 - two * c_1) / (c_1 + c_2)

    def vacuum_time_constant(self) -> float:
        """Time constant of that difference, (Rcd1 + Rcd2) C1 C2 / (C1 + C2) [s]."""
        c_1, c_2 = self.capacitances
        return (1 / self.joints[0] + 1 / self.joints[1]) * c_1 * c_2 / (c_1 + c_2)


def _gain(rate: float, times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Integral of e^(rate t) from 0 to each time; the time itself at rate zero [s]."""
    return np.asarray(np.expm1(rate * times) / rate) if rate else times
