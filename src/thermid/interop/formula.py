"""Numbers that remember how they were made: the conductances of a network as formulas over its parameters.

Every recipe of a conductor is arithmetic, so a recipe that is given formulas returns a formula; nothing of a kind is written twice.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from thermid.dual import real_power, value_of
from thermid.network.network import Network, Numbers

_RANK = {"+": 1, "-": 1, "*": 2, "/": 2, "neg": 3, "**": 4, "name": 5, "number": 5}


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

    def __add__(self, other: Any) -> Formula:
        """Sum."""
        return _made("+", self, other)

    def __radd__(self, other: Any) -> Formula:
        """Sum, number first."""
        return _made("+", other, self)

    def __sub__(self, other: Any) -> Formula:
        """Difference."""
        return _made("-", self, other)

    def __rsub__(self, other: Any) -> Formula:
        """Difference, number first."""
        return _made("-", other, self)

    def __mul__(self, other: Any) -> Formula:
        """Product."""
        return _made("*", self, other)

    def __rmul__(self, other: Any) -> Formula:
        """Product, number first."""
        return _made("*", other, self)

    def __truediv__(self, other: Any) -> Formula:
        """Quotient."""
        return _made("/", self, other)

    def __rtruediv__(self, other: Any) -> Formula:
        """Quotient, number first."""
        return _made("/", other, self)

    def __pow__(self, other: Any) -> Formula:
        """Power."""
        return _made("**", self, other)

    def __rpow__(self, other: Any) -> Formula:
        """Power, number first."""
        return _made("**", other, self)

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


_COMPUTE: dict[str, Callable[[float, float], float]] = {
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "/": lambda a, b: a / b,
    "**": real_power,
}


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
