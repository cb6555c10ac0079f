"""Linear algebra of information: covariance, null space, pseudo-inverse and roots, with the tolerances of two questions.

Can an unknown be told from the others (RANK_TOLERANCE), and has it any effect at all (NOTHING)?

Rows J are derivatives of residuals in units of their errors: J'J is the information, and (J'J)^-1 the covariance of the unknowns. Columns
are scaled to length one first, so that no unit decides what counts as nothing.

`Dual`: numbers that carry their derivatives with respect to the free parameters of a fit.

Only `+ - * / **` are needed: every conductance is arithmetic over parameters, so the chain rule stays exact from the text of a deck to
the coefficients of the kernel. Griewank and Walther, Evaluating Derivatives, 2nd ed., SIAM 2008, chapter 3.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import lru_cache
from importlib import import_module
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]
Indices = NDArray[np.intp]
Ints = NDArray[np.int32]

RANK_TOLERANCE = 1e-6
"""Singular value of scaled rows, beside the largest, up to which a direction holds no information: derivatives of a run are not good to
more. Eigenvalues of J'J and of a covariance are squares of these, so that theirs is its square."""
MAX_PART_WITHOUT_INFORMATION = 1e-3
"""Part that an unknown may have in directions without information and still count as known."""
NOTHING = 1e-12
"""What rounding leaves: length of a column, beside the longest, up to which no row depends on its unknown, and singular value of scaled
rows up to which a combination has no effect. Between this and RANK_TOLERANCE rows depend on it, weakly: its error is finite and large."""

HALF_WIDTH_95 = 1.959964
"""Standard errors from the middle of a normal distribution to an end of the range that holds 95 %. [-]"""


def scaled(rows: Array) -> tuple[Array, Array, Bools]:
    """Return rows with columns of length one, these lengths (1 of a column without entries), and which columns have entries.

    Rows of zeros are added below where there are fewer rows than columns, so that singular values count every unknown.
    """
    length = np.linalg.norm(rows, axis=0)
    nonzero = length > NOTHING * length.max(initial=0.0)
    length = np.where(nonzero, length, 1.0)
    below = np.zeros((max(0, rows.shape[1] - rows.shape[0]), rows.shape[1]))
    return np.concatenate([np.where(nonzero, rows / length, 0.0), below]), length, nonzero


def _decomposed(rows: Array, tolerance: float) -> tuple[Array, Array, Bools, Array]:
    """Return singular values and right singular vectors of the scaled rows, which directions hold nothing, and the scale."""
    unit_columns, length, _ = scaled(rows)
    _, s, v = np.linalg.svd(unit_columns, full_matrices=False)
    return s, v, s <= tolerance * s[0], length


def pseudo_inverse(rows: Array, tolerance: float = RANK_TOLERANCE) -> Array:
    """Return the pseudo-inverse of J'J: right for combinations of which the rows state something, nothing of the others."""
    return _inverse(rows, tolerance)[0]


def _inverse(rows: Array, tolerance: float) -> tuple[Array, Array]:
    """Return the pseudo-inverse of J'J, and the part of each unknown in directions of which the rows state nothing."""
    if rows.shape[1] == 0:
        return np.zeros((0, 0)), np.zeros(0)
    s, v, weak, length = _decomposed(rows, tolerance)
    inverted = np.where(weak, 0.0, 1.0 / np.where(weak, 1.0, s))
    # (J'J)^-1 = V S^-2 V'
    return (v.T * inverted**2) @ v / np.outer(length, length), np.linalg.norm(v[weak], axis=0)


def covariance(rows: Array, tolerance: float = RANK_TOLERANCE) -> Array:
    """Return (J'J)^-1; an unknown with a part in a direction without information has an infinite variance and goes with no other."""
    out, unknown = _inverse(rows, tolerance)
    lost = unknown > MAX_PART_WITHOUT_INFORMATION
    out[lost, :] = out[:, lost] = 0.0
    out[lost, lost] = np.inf
    return out


def finite(matrix: Array) -> Array:
    """Return a covariance with zeros in place of what is not known at all."""
    return np.where(np.isfinite(matrix), matrix, 0.0)


def null_space(rows: Array) -> Array:
    """Return the directions (directions, unknowns) that no row sees; unknowns that no row depends on are left out."""
    _, _, nonzero = scaled(rows)
    if nonzero.sum() < 2:
        return np.zeros((0, rows.shape[1]))
    _, v, weak, inner = _decomposed(rows[:, nonzero], RANK_TOLERANCE)
    out = np.zeros((int(weak.sum()), rows.shape[1]))
    out[:, nonzero] = v[weak] / inner
    return out


def _eigen(matrix: Array) -> tuple[Array, Array, Array]:
    """Return eigenvalues and vectors of a symmetric matrix scaled to a diagonal of ones, and the scale."""
    scale = np.sqrt(np.where(np.diag(matrix) > 0, np.diag(matrix), 1.0))
    if not matrix.size:
        return np.zeros(0), matrix, scale
    sizes, vectors = np.linalg.eigh(matrix / np.outer(scale, scale))
    return sizes, vectors, scale


def square_root(matrix: Array, *, drop: bool = False) -> Array:
    """Return a root L of a covariance, ``L L'``: as many columns as rows, or only the directions in which it is not zero."""
    sizes, vectors, scale = _eigen(matrix)
    chosen = sizes > RANK_TOLERANCE**2 * sizes.max(initial=0.0) if drop else slice(None)
    return np.asarray(scale[:, None] * vectors[:, chosen] * np.sqrt(np.maximum(sizes[chosen], 0.0)))


def inverse_square_root(matrix: Array, floor: float = RANK_TOLERANCE**2) -> Array:
    """Return a root R of an information, ``R'R = covariance^-1``; eigenvalues below `floor` of the largest count as that."""
    sizes, vectors, scale = _eigen(matrix)
    return np.asarray((vectors / np.sqrt(np.maximum(sizes, floor * sizes.max(initial=0.0)))).T / scale)


def symmetric_inverse(matrix: Array) -> Array:
    """Return the pseudo-inverse of a covariance, or of an information given in full."""
    sizes, vectors, scale = _eigen(matrix)
    weak = sizes <= RANK_TOLERANCE**2 * sizes.max(initial=0.0)
    inverted = np.where(weak, 0.0, 1.0 / np.where(weak, 1.0, sizes))
    return np.asarray((vectors * inverted) @ vectors.T / np.outer(scale, scale))


def variance(information: Array, gradient: Array) -> float:
    """Return the variance of a combination of unknowns by an information given in full; infinite where nothing is known of it."""
    sizes, vectors, scale = _eigen(information)
    part = vectors.T @ (gradient / scale)
    weak = sizes <= RANK_TOLERANCE**2 * sizes.max(initial=0.0)
    if np.linalg.norm(part[weak]) > MAX_PART_WITHOUT_INFORMATION * np.linalg.norm(part):
        return float("inf")
    return float(np.sum(part[~weak] ** 2 / sizes[~weak]))


def quadratic_forms(rows: Array, matrix: Array) -> Array:
    """Return the variance (n,) of each of some rows (n, m) of a vector with a covariance (m, m): the diagonal of A C A'."""
    return np.asarray(np.sum((rows @ matrix) * rows, axis=1))


def anderson_step(states: Sequence[Array], steps: Sequence[Array], tolerance: float) -> Array:
    """Return the next state of a fixed-point iteration by Anderson's method: x + f - (dX + dF) g, g of least squares of dF g = f.

    Whole steps may overshoot; the combination of the last ones whose linear forecast of what is left is smallest does not: Walker and Ni,
    SIAM J. Numer. Anal. 49 (2011) 1715, eq. 1.3.

    Parameters
    ----------
    states, steps : sequences of arrays   The last states, of any shape, and the step from each; x and f are the last of them, dX and dF
                                          differences of successive ones.
    tolerance : float                     Singular values of dF, beside the largest, that count as zero. [-]
    """
    if len(states) < 2:
        return np.asarray(states[-1] + steps[-1])
    moved, changed = (np.column_stack([(b - a).ravel() for a, b in pairwise(sequence)]) for sequence in (states, steps))
    share = np.linalg.lstsq(changed, steps[-1].ravel(), rcond=tolerance)[0]
    return np.asarray(states[-1] + steps[-1] - ((moved + changed) @ share).reshape(states[-1].shape))


_libraries = lru_cache(maxsize=4)(lambda *loaded: import_module("threadpoolctl").ThreadpoolController())


def one_thread() -> AbstractContextManager[Any]:
    """Return a context in which libraries of matrices keep to one thread: in some hundred rows two wait for one another.

    Libraries are looked for once, which takes 2 ms, and again once scipy has loaded its own.
    """
    return _libraries("scipy.linalg" in sys.modules, "scipy.special" in sys.modules).limit(limits=1)  # type: ignore[no-any-return]


def real_power(base: float, exponent: float) -> float:
    """Return a power that is a real number.

    Raises
    ------
    ArithmeticError   For a root of a negative number, which Python would return as a complex one, and for zero to a negative power.
    """
    out: float | complex = base**exponent
    if isinstance(out, complex):
        raise ArithmeticError("a negative number has no real root")
    return out


@dataclass(frozen=True, eq=False)
class Dual:
    """A value with its gradient.

    Parameters
    ----------
    value : float               The value, SI.
    gradient : array (free,)    Its derivative with respect to each free parameter.
    """

    value: float
    gradient: NDArray[np.float64]

    def __add__(self, other: Number) -> Dual:
        """Sum."""
        if isinstance(other, Dual):
            return Dual(self.value + other.value, self.gradient + other.gradient)
        return Dual(self.value + other, self.gradient)

    __radd__ = __add__

    def __le__(self, other: Number) -> Any:
        """Whether its value is as small: of two numbers numpy takes the smaller one, with its derivatives."""
        return self.value <= value_of(other)

    def __ge__(self, other: Number) -> Any:
        """Whether its value is as large."""
        return self.value >= value_of(other)

    def __neg__(self) -> Dual:
        """Negative."""
        return Dual(-self.value, -self.gradient)

    def __pos__(self) -> Dual:
        """Itself."""
        return self

    def __sub__(self, other: Number) -> Dual:
        """Difference."""
        return self + (-other)

    def __rsub__(self, other: float) -> Dual:
        """Difference, number first."""
        return (-self) + other

    def __mul__(self, other: Number) -> Dual:
        """Product."""
        if isinstance(other, Dual):
            return Dual(self.value * other.value, self.gradient * other.value + self.value * other.gradient)
        return Dual(self.value * other, self.gradient * other)

    __rmul__ = __mul__

    def __truediv__(self, other: Number) -> Dual:
        """Quotient; a finite number over infinity is zero with zero derivative."""
        if isinstance(other, Dual):
            if math.isinf(other.value):
                return Dual(self.value / other.value, np.zeros_like(self.gradient))
            ratio = self.value / other.value
            return Dual(ratio, (self.gradient - ratio * other.gradient) / other.value)
        return Dual(self.value / other, self.gradient / other)

    def __rtruediv__(self, other: float) -> Dual:
        """Quotient, number first."""
        return Dual(other, np.zeros_like(self.gradient)) / self

    def __pow__(self, other: Number) -> Dual:
        """Power; a negative base needs a constant exponent."""
        if isinstance(other, Dual):
            return self**other.value + real_power(self.value, other.value) * (_log(self.value) * Dual(0.0, other.gradient))
        if other == 0:
            return Dual(1.0, np.zeros_like(self.gradient))
        return Dual(real_power(self.value, other), other * real_power(self.value, other - 1.0) * self.gradient)

    def __rpow__(self, other: float) -> Dual:
        """Power, number first."""
        power = real_power(other, self.value)
        return Dual(power, power * _log(other) * self.gradient)


def _log(base: float) -> float:
    """Return log(base) as the derivative of a power over its exponent needs it: zero for a base of zero, whose powers are all zero."""
    if base < 0.0:
        raise ArithmeticError("a power of a negative number has no derivative over its exponent")
    return math.log(base) if base > 0.0 else 0.0


Number = float | Dual


def value_of(number: Number) -> float:
    """Return the value alone."""
    return number.value if isinstance(number, Dual) else float(number)


def gradient_of(number: Number, free: int) -> NDArray[np.float64]:
    """Return the gradient (free,), zero for a plain number."""
    return number.gradient if isinstance(number, Dual) else np.zeros(free)
