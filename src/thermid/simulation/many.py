"""The numbers of all members of an ensemble at once: one pass of the deck's arithmetic over arrays in place of one per member.

Arithmetic and checks of the model's code run as they stand, on a number that holds one value per member. Where a check holds for some
members and not for others, the members are taken apart and each share is computed by itself, so every member goes the way that it would
have gone alone.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.dual import Dual, real_power
from thermid.errors import ThermidError
from thermid.simulation.solver.wiring import Assembled, Wiring

Array = NDArray[np.float64]


class _ApartError(Exception):
    """A check holds for some members only: those of the mask (members,)."""

    def __init__(self, mask: NDArray[np.bool_]) -> None:
        super().__init__("members differ")
        self.mask = mask


def _all_alike(mask: NDArray[np.bool_]) -> bool:
    """Return what a check says of all members.

    Raises
    ------
    _ApartError   When it says different things of them.
    """
    if mask.all():
        return True
    if mask.any():
        raise _ApartError(mask)
    return False


class Many(Dual):
    """A number with one value per member.

    It passes for a number with derivatives, of which it has none, because that is what the model's code lets through untouched.

    Parameters
    ----------
    values : array (members,)   [SI]
    """

    values: NDArray[Any]

    def __init__(self, values: NDArray[Any]) -> None:
        object.__setattr__(self, "values", values)

    @property
    def value(self) -> Any:
        """Itself: checks look at all members."""
        return self

    @property
    def gradient(self) -> Array:
        """None of them."""
        return np.zeros(0)

    def __array_ufunc__(self, function: Callable[..., Any], method: str, *inputs: Any, **more: Any) -> Any:
        """Apply a function of numpy member by member."""
        return Many(getattr(function, method)(*(_plain(x) for x in inputs), **more))

    def __bool__(self) -> bool:
        """What a comparison says of all members."""
        return _all_alike(self.values.astype(bool))

    def __format__(self, how: str) -> str:
        """The first member, for a message that is made anew for each."""
        return format(float(self.values[0]), how)

    def __add__(self, other: Any) -> Many:
        """Sum."""
        return Many(self.values + _plain(other))

    __radd__ = __add__

    def __neg__(self) -> Many:
        """Negative."""
        return Many(-self.values)

    def __pos__(self) -> Many:
        """Itself."""
        return self

    def __sub__(self, other: Any) -> Many:
        """Difference."""
        return Many(self.values - _plain(other))

    def __rsub__(self, other: Any) -> Many:
        """Difference, number first."""
        return Many(_plain(other) - self.values)

    def __mul__(self, other: Any) -> Many:
        """Product."""
        return Many(self.values * _plain(other))

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Many:
        """Quotient."""
        return _quotient(self.values, _plain(other))

    def __rtruediv__(self, other: Any) -> Many:
        """Quotient, number first."""
        return _quotient(_plain(other), self.values)

    def __pow__(self, other: Any) -> Many:
        """Power."""
        return _power(self.values, _plain(other))

    def __rpow__(self, other: Any) -> Many:
        """Power, number first."""
        return _power(_plain(other), self.values)

    def __lt__(self, other: Any) -> Many:
        """Where it is smaller."""
        return Many(self.values < _plain(other))

    def __le__(self, other: Any) -> Many:
        """Where it is smaller or equal."""
        return Many(self.values <= _plain(other))

    def __gt__(self, other: Any) -> Many:
        """Where it is larger."""
        return Many(self.values > _plain(other))

    def __ge__(self, other: Any) -> Many:
        """Where it is larger or equal."""
        return Many(self.values >= _plain(other))

    def __eq__(self, other: object) -> Any:
        """Where it is equal."""
        return Many(self.values == _plain(other))

    def __ne__(self, other: object) -> Any:
        """Where it is not equal."""
        return Many(self.values != _plain(other))

    __hash__ = None  # type: ignore[assignment]


def _plain(x: Any) -> Any:
    return x.values if isinstance(x, Many) else x


def _quotient(above: Any, below: Any) -> Many:
    """Return a quotient; division by zero is an error, as it is for one member."""
    if _all_alike(np.broadcast_to(np.asarray(below) == 0.0, np.broadcast_shapes(np.shape(above), np.shape(below)))):
        raise ZeroDivisionError("float division by zero")
    return Many(above / below)


def _power(base: Any, exponent: Any) -> Many:
    """Return a power, by the function that serves one member, so that not even the last bit differs."""
    bases, exponents = np.broadcast_arrays(np.asarray(base, dtype=float), np.asarray(exponent, dtype=float))
    out, wrong = np.empty(bases.shape), np.zeros(bases.shape, dtype=bool)
    for k, (b, e) in enumerate(zip(bases.tolist(), exponents.tolist(), strict=True)):
        try:
            out[k] = real_power(b, e)
        except ArithmeticError:
            wrong[k] = True
    if _all_alike(wrong):
        raise ArithmeticError("a power of a negative number or of zero has no value")
    return Many(out)


@dataclass(frozen=True, eq=False)
class MembersNumbers:
    """What the kernel needs of every member.

    Parameters
    ----------
    coefficients : array (coefficients, members)    [SI]
    initial : array (nodes, members)                NaN where a steady start is asked for. [K]
    weights : dict                                  Eliminated node -> neighbour -> weight (members,), in order of recovery. [-]
    offsets : dict                                  Boundary -> constant part of its temperature (members,). [K]
    refused : dict                                  Member -> why there is no such network; its numbers are NaN.
    """

    coefficients: Array
    initial: Array
    weights: Mapping[str, Mapping[str, Array]]
    offsets: Mapping[str, Array]
    refused: Mapping[int, str]

    def one(self, member: int, like: Assembled) -> Assembled:
        """Return the numbers of one member, without derivatives, as the kernel takes them."""
        from dataclasses import replace

        offsets = {b: float(v[member]) for b, v in self.offsets.items()}
        return replace(like, coefficients=self.coefficients[:, member].copy(), initial=self.initial[:, member].copy(), offsets=offsets)


@dataclass(eq=False)
class _Collector:
    """Takes in the numbers of shares of the members."""

    wiring: Wiring
    values: Mapping[str, Array]
    members: int
    coefficients: Array
    initial: Array
    weights: dict[str, dict[str, Array]]
    offsets: dict[str, Array]
    refused: dict[int, str]

    def fill(self, share: NDArray[np.intp]) -> None:
        """Assemble a share of the members together, or apart where they differ."""
        if share.size == 1 or self.wiring.schedule is not None:
            for member in share.tolist():
                self._one(member)
            return
        try:
            with np.errstate(over="ignore", invalid="ignore"):
                self._store(self.wiring.assembled_at({n: Many(v[share]) for n, v in self.values.items()}), share)
        except _ApartError as apart:
            self.fill(share[apart.mask])
            self.fill(share[~apart.mask])
        except ThermidError:
            for member in share.tolist():
                self._one(member)

    def _one(self, member: int) -> None:
        try:
            self._store(self.wiring.assembled_at({n: float(v[member]) for n, v in self.values.items()}), np.array([member]))
        except ThermidError as error:
            self.refused[member] = str(error)

    def _store(self, a: Assembled, share: NDArray[np.intp]) -> None:
        for row, number in zip(self.coefficients, a.coefficients, strict=True):
            row[share] = _plain(number)
        for row, number in zip(self.initial, a.initial, strict=True):
            row[share] = _plain(number)
        for node, star in a.reduced.recover:
            for neighbour, weight in star.items():
                self._row(self.weights.setdefault(node, {}), neighbour)[share] = _plain(weight)
        for boundary, offset in a.offsets.items():
            self._row(self.offsets, boundary)[share] = _plain(offset)

    def _row(self, table: dict[str, Array], name: str) -> Array:
        if name not in table:
            table[name] = np.full(self.members, np.nan)
        return table[name]


def assemble_members(wiring: Wiring, values: Mapping[str, Array], members: int) -> MembersNumbers:
    """Return the numbers of every member.

    Parameters
    ----------
    wiring : Wiring     With the names of `values` freed.
    values : dict       Free name -> value (members,). [SI]
    members : int       How many there are.
    """
    like = wiring.assemble()
    shape = (like.coefficients.size, like.initial.size)
    made = _Collector(wiring, values, members, np.full((shape[0], members), np.nan), np.full((shape[1], members), np.nan), {}, {}, {})
    made.fill(np.arange(members))
    return MembersNumbers(made.coefficients, made.initial, made.weights, made.offsets, made.refused)
