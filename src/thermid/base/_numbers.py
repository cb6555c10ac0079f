"""What frozen values hold: numbers in arrays, numbers with their derivatives (`Dual`), and what a value has worked out (`Memo`).

Only `+ - * / **` are needed: every conductance is arithmetic over parameters, so the chain rule stays exact from the text of a deck to
the coefficients of the kernel. Griewank and Walther, Evaluating Derivatives, 2nd ed., SIAM 2008, chapter 3.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterable
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]
Indices = NDArray[np.intp]
Ints = NDArray[np.int32]

HALF_WIDTH_95 = 1.959964
"""Standard errors from the middle of a normal distribution to an end of the range that holds 95 %. [-]"""


def real_power(base: float, exponent: float) -> float:
    """Return base^exponent where it is a real number.

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
    gradient: Array

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


def values_of(numbers: Iterable[Number]) -> Array:
    """Return the values (numbers,) alone."""
    return np.array([value_of(n) for n in numbers])


def gradient_of(number: Number, free: int) -> Array:
    """Return the gradient (free,), zero for a plain number."""
    return number.gradient if isinstance(number, Dual) else np.zeros(free)


Made = TypeVar("Made")


class Memo(dict[Hashable, Any]):
    """Results by key, made once; a copy of one, by pickle too, is empty.

    In a frozen dataclass it is a field with ``init=False, default_factory=Memo, compare=False, repr=False``. `dataclasses.replace` does not
    hand such a field on, so a value with another field starts with an empty memo and nothing has to be reset.
    """

    def value(self, key: Hashable, make: Callable[[], Made], most: int = 0) -> Made:
        """Return what is kept under a key, made now where nothing is; with `most` above zero the oldest gives way beyond so many."""
        if key not in self:
            result = make()
            while most and len(self) >= most:
                del self[next(iter(self))]
            self[key] = result
        out: Made = self[key]
        return out

    def __reduce__(self) -> tuple[type[Memo], tuple[()]]:
        """Return how to make it anew: empty."""
        return Memo, ()
