"""Numbers that remember how they were made: the conductances of a network as formulas over its parameters.

Every recipe of a conductor is arithmetic, so a recipe that is given formulas returns a formula; nothing of a kind is written twice.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from thermid.dual import real_power, value_of
from thermid.network.network import Network, Numbers

_COMPUTE: dict[str, Callable[[float, float], float]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
    "**": real_power,
}
_RANK = {"+": 1, "-": 1, "*": 2, "/": 2, "neg": 3, "**": 4, "name": 5, "number": 5}


Binary = Callable[["Formula", Any], "Formula"]


def _operator(sign: str) -> tuple[Binary, Binary]:
    """Return the methods of a sign: the formula on its left, and on its right."""
    return lambda own, other: _made(sign, own, other), lambda own, other: _made(sign, other, own)


@dataclass(frozen=True, eq=False)
class Formula:
    """A number and the arithmetic that it comes from.

    Parameters
    ----------
    value : float       The number. [SI]
    operator : str      ``name``, ``number``, ``neg``, or one of ``+ - * / **``.
    parts : tuple       The operands; the path for a name; empty for a number.
    """

    value: float
    operator: str
    parts: tuple[Any, ...] = ()

    def __float__(self) -> float:
        """The number."""
        return self.value

    __add__, __radd__ = _operator("+")
    __sub__, __rsub__ = _operator("-")
    __mul__, __rmul__ = _operator("*")
    __truediv__, __rtruediv__ = _operator("/")
    __pow__, __rpow__ = _operator("**")

    def __neg__(self) -> Formula:
        """Negative."""
        return Formula(-self.value, "neg", (self,))

    def __pos__(self) -> Formula:
        """Itself."""
        return self

    def paths(self) -> set[str]:
        """Return the names it holds."""
        if self.operator == "name":
            return {self.parts[0]}
        return {path for part in self.parts for path in part.paths()}


def _made(operator: str, left: Any, right: Any) -> Formula:
    """Return the formula of two operands; a plain number becomes a formula, and a factor of one goes."""
    a, b = (x if isinstance(x, Formula) else Formula(float(x), "number") for x in (left, right))
    if operator in "*/" and b.operator == "number" and b.value == 1.0:
        return a
    if operator == "*" and a.operator == "number" and a.value == 1.0:
        return b
    return Formula(_COMPUTE[operator](a.value, b.value), operator, (a, b))


def named(path: str, value: float) -> Formula:
    """Return the formula that is one name."""
    return Formula(value, "name", (path,))


def number_text(value: float) -> str:
    """Return the shortest text that is read as the same number."""
    if value in (float("inf"), -float("inf")):
        return "Inf" if value > 0 else "-Inf"
    return repr(int(value)) if value == int(value) and abs(value) < 1e15 else repr(float(value))


@dataclass(frozen=True)
class Text:
    """How formulas are written in one language.

    Parameters
    ----------
    name : callable     Path -> how it is written.
    power : str         The sign of a power.
    """

    name: Callable[[str], str]
    power: str = "^"

    def of(self, formula: Formula | float, above: int = 0) -> str:
        """Return a formula as text, in parentheses where its surroundings bind as strongly as `above`."""
        if not isinstance(formula, Formula):
            return number_text(float(formula)) if formula >= 0 or not above else f"({number_text(float(formula))})"
        rank = _RANK[formula.operator]
        if formula.operator == "name":
            return self.name(formula.parts[0])
        if formula.operator == "number":
            return self.of(formula.value, above)
        if formula.operator == "neg":
            text = f"-{self.of(formula.parts[0], rank)}"
        else:
            left, right = formula.parts
            # equal ranks: a - (b - c) needs its parentheses, (a - b) - c does not; powers get them on both sides
            tight = formula.operator == "**"
            sign = self.power if tight else f" {formula.operator} " if rank == 1 else formula.operator
            firm = rank + (formula.operator in "-/" or tight)
            text = f"{self.of(left, rank + tight)}{sign}{self.of(right, firm)}"
        return f"({text})" if rank < above else text


def with_formulas(network: Network) -> Numbers:
    """Return the rows of a network with formulas over parameter paths as coefficients and capacitances."""
    values = network.numbers().values
    given: dict[str, Any] = {path: named(path, value_of(value)) for path, value in values.items()}
    return network.numbers(given)
