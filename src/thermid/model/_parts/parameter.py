"""`Parameter`: a value as written, with unit, bounds and source; `Standing`: how far values and what rests on them may be trusted."""

from __future__ import annotations

import math
from collections.abc import Container, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final, Literal as OneOf, get_args

from thermid.base.errors import DeckError, UnitError, errors_at, refuse_unknown
from thermid.base.units import HALF_WIDTH_95, Dimension, Expression, Literal, describe, from_si, unit
from thermid.model._laws.options import Source
from thermid.physics.materials import Material

State = OneOf["credible", "unjudged", "not adequate", "incomplete", "not credible", "failed"]
ORDER: tuple[State, ...] = get_args(State)
"""From best to worst."""
FAIR = 2
"""How many of them nobody needs to be told of."""
UNUSABLE, INADEQUATE = 1, 5
"""Exit codes of an answer that rests on values which are not credible or failed, and on values which are not adequate or a deck that is
incomplete."""


SOURCES: Final = get_args(Source)
SHARES: Final = ("emissivity", "absorptance", "exchange_factor")
"""Fields that physics keeps from 0 to 1."""


@dataclass(frozen=True)
class Standing:
    """How far a value or a result may be trusted, and why.

    Parameters
    ----------
    state : str     credible (a fit that its data support), unjudged (a deck's or hand-tuned value), not adequate (the model misses more
                    than its stage allows), incomplete (its deck lacks something of the hardware), not credible (contradicts what was
                    stated, or did not converge), or failed (a verdict failed).
    because : str   The reason in words; empty for credible and unjudged.
    stage : str     The stage that the reason is about; empty for none.
    accepted : bool Whether that stage was accepted as it is: the state stays, the exit code does not count it.
    beside : tuple  Standings of further stages that the result rests on and that are not fair either.
    """

    state: State
    because: str = ""
    stage: str = ""
    accepted: bool = False
    beside: tuple[Standing, ...] = ()

    @property
    def rank(self) -> int:
        """Position from best (0, credible) to worst."""
        return ORDER.index(self.state)

    @property
    def fair(self) -> bool:
        """Whether there is nothing to be told: credible or unjudged."""
        return self.rank < FAIR

    @property
    def usable(self) -> bool:
        """Whether an answer may rest on it: neither not credible nor failed."""
        return self.rank < ORDER.index("not credible")

    @property
    def judgeable(self) -> bool:
        """Whether hold-out data may be opened for it: nothing that it rests on is not credible, accepted or not."""
        return all(s.state != "not credible" for s in self.causes)

    @property
    def causes(self) -> tuple[Standing, ...]:
        """Every cause that is not fair, the worst one first, each by itself."""
        return tuple(replace(s, beside=()) for s in (self, *self.beside) if not s.fair)

    @property
    def exit_code(self) -> int:
        """Exit code of an answer that rests on it: 0; 1 for not credible or failed; 5 for not adequate or incomplete.

        Accepted stages do not count.
        """
        open_causes = [s for s in self.causes if not s.accepted]
        return 0 if not open_causes else INADEQUATE if all(s.usable for s in open_causes) else UNUSABLE

    def reason(self, of: str = "", link: str = "rests on stage") -> str:
        """Return `because` for a result of stage `of`; where the cause lies in another stage, '<link> '<stage>' (<because>)'."""
        return self.because if not self.because or not self.stage or self.stage == of else f"{link} '{self.stage}' ({self.because})"

    def line(self, of: str = "", link: str = "rests on stage") -> str:
        """Return the warning for the top of a result of stage `of`, every cause as 'STATE: reason'; empty where the standing is fair."""
        return "; also ".join(f"{s.state.upper()}{' (accepted)' * s.accepted}: {s.reason(of, link)}" for s in self.causes)

    def over(self, text: str, link: str = "rests on stage") -> str:
        """Return `text` below the warning `line`; the text alone where the standing is fair."""
        return f"{self.line(link=link)}\n{text}" if not self.fair else text

    def accept(self, stages: Container[str]) -> Standing:
        """Return the standing with `accepted` set on its own cause and on those beside it whose stage is in `stages`."""
        beside = tuple(s.accept(stages) for s in self.beside)
        return replace(self, accepted=self.accepted or (not self.fair and self.stage in stages), beside=beside)

    def as_table(self) -> dict[str, Any]:
        """Return its fields as a table for a file."""
        out: dict[str, Any] = {"state": self.state, "because": self.because, "stage": self.stage}
        out |= {"accepted": True} if self.accepted else {}
        return out | ({"beside": [s.as_table() for s in self.beside]} if self.beside else {})

    def to_dict(self, of: str = "") -> dict[str, Any]:
        """Return it as the JSON of a command holds it, for a result of a stage: the reason is that of its first line."""
        out: dict[str, Any] = {"state": self.state, "because": self.reason(of), "stage": self.stage}
        out |= {"accepted": True} if self.accepted else {}
        return out | ({"beside": [s.to_dict(of) for s in self.causes[1:]]} if self.beside else {})

    @staticmethod
    def worst(standings: Iterable[Standing]) -> Standing:
        """Return the worst of several standings with the other causes beside it; credible where there is none.

        Of equals the one that is not accepted comes first, then the first one.
        """
        several = list(standings)
        causes = list(dict.fromkeys(c for s in several for c in s.causes))
        if not causes:
            return replace(max(several, key=lambda s: s.rank, default=CREDIBLE), beside=())
        first = max(causes, key=lambda s: (s.rank, not s.accepted))
        taken: dict[tuple[str, str], Standing] = {}
        for s in sorted(causes, key=lambda s: s.accepted):
            if s is not first and (s.state, s.stage) != (first.state, first.stage):
                taken.setdefault((s.state, s.stage), s)
        return replace(first, beside=tuple(sorted(taken.values(), key=lambda s: -s.rank)))


CREDIBLE = Standing("credible")
UNJUDGED = Standing("unjudged")


CATALOGUE, FINISH, SCATTER = "catalogue: ", "finish '", "scatter of "
"""What a basis begins with whose bounds are a range that somebody printed."""
SPAN: Final = 2.0 * HALF_WIDTH_95
"""Width of a stated range in standard deviations: it is read as holding 95 %. [-]"""
RANGE: Final = "range"
"""Spread of a value whose minimum and maximum are its range."""
FINISH_CORRELATION: Final = 0.5
"""Correlation of the emissivities of two surfaces of one finish: half of what parts differ by is the batch, half the part. [-]"""
LEAST_EMISSIVITY: Final = 0.005
"""Of any surface; a share with a stated range is fitted by its logarithm from there. [-]"""


@dataclass(frozen=True)
class StatedRange:
    """Range that a catalogue, a data sheet or the author of a deck states for a value: a prior with a spread about it, never a wall.

    Parameters
    ----------
    low, high : float   Read as holding 95 %. [SI]
    name : str          Finish or property of a material, which other values may have too; empty where it is the value's own.
    alike : float       Correlation of two values of that name. [-]
    """

    low: float
    high: float
    name: str = ""
    alike: float = 0.0

    def __str__(self) -> str:
        """Return its ends. [SI]"""
        return f"{self.low:.6g} .. {self.high:.6g}"

    def log_sd(self, value: float) -> float:
        """Return the standard deviation of the logarithm of a value above zero. [-]"""
        return math.log(self.high / self.low) / SPAN if self.low > 0.0 else self.sd / value

    @property
    def sd(self) -> float:
        """Standard deviation. [SI]"""
        return (self.high - self.low) / SPAN


@dataclass(frozen=True)
class Parameter:
    """A value with what is known of it.

    Parameters
    ----------
    expression : Expression     A literal with its unit, or arithmetic over other names.
    minimum, maximum : float    Bounds, or the range of the value (see `is_range`), or None. [SI]
    source : str                published, datasheet, derived, assumed, measured, or empty.
    note, basis : str           Free text: what it is, and what it rests on.
    spread : str                Its standard deviation as written, `RANGE`, or empty.
    standing : Standing         How far a value that was laid over a model may be trusted; None for that of a deck. It is no part of what
                                the value is: two that differ in it alone are equal.
    """

    expression: Expression
    minimum: float | None = None
    maximum: float | None = None
    source: str = ""
    note: str = ""
    basis: str = ""
    spread: str = ""
    standing: Standing | None = field(default=None, compare=False, repr=False)

    def __repr__(self) -> str:
        """Its kind, and the value as written."""
        return f"<Parameter: {self}>"

    def __str__(self) -> str:
        """The value as written, and where it comes from."""
        return self.text + (f" ({self.source})" if self.source else "")

    @property
    def text(self) -> str:
        """The value as written."""
        return self.expression.text

    @property
    def is_literal(self) -> bool:
        """Whether the value is a number; only a literal can be freed."""
        return self.expression.literal is not None

    @property
    def unit(self) -> str:
        """The unit it was written in; empty for a derived value."""
        return self.expression.literal.unit.text if self.expression.literal else ""

    @property
    def is_range(self) -> bool:
        """Whether minimum and maximum are the range of the value, by a catalogue, a data sheet or its author; else they bound a search."""
        printed = self.source == "datasheet" or (self.source != "measured" and self.basis.startswith((CATALOGUE, FINISH, SCATTER)))
        is_stated = self.spread == RANGE if self.spread else printed
        return is_stated and self.minimum is not None and self.maximum is not None and self.minimum < self.maximum

    @property
    def stated_range(self) -> StatedRange | None:
        """The range of a number; None where nobody states one."""
        literal = self.expression.literal
        if literal is None or not (self.is_range or self.spread):
            return None
        if not self.is_range:
            value, half = literal.value, HALF_WIDTH_95 * _deviation(self.spread, literal)
            if value <= 0.0 or literal.unit.dimension == unit("K").dimension:
                return StatedRange(value - half, value + half)
            return StatedRange(value * math.exp(-half / value), value * math.exp(half / value))
        assert self.minimum is not None
        assert self.maximum is not None
        material = self.basis.removeprefix(CATALOGUE).partition(";")[0]
        if self.basis.startswith(FINISH):
            name, alike = self.basis.removeprefix(FINISH).partition("'")[0], FINISH_CORRELATION
        else:
            name, alike = (f"{material}, {self.text}", 1.0) if material in Material.table() else ("", 0.0)
        return StatedRange(self.minimum, self.maximum, name, alike)

    @property
    def walls(self) -> tuple[float | None, float | None]:
        """Bounds that nothing passes, or None each: a range is none, but where it begins at zero. [SI]"""
        if not self.is_range:
            return self.minimum, self.maximum
        return (0.0 if self.minimum == 0.0 else None), None

    def laid_over(self, old: Parameter) -> Parameter:
        """Return this parameter in the place of `old`, whose bounds and note it takes where it has none; a range of `old` is dropped."""
        low, high = (None, None) if old.is_range else (old.minimum, old.maximum)
        low, high = (low if self.minimum is None else self.minimum), (high if self.maximum is None else self.maximum)
        return replace(self, minimum=low, maximum=high, note=self.note or old.note)

    def form(self, path: str, dimension: Dimension, value: float) -> tuple[bool, float, float]:
        """Return (fitted by its logarithm?, lower bound, upper bound) of a value [SI]; bounds are infinite where none is given.

        One above zero keeps its sign unless a minimum says otherwise, or it is a number, a temperature or a coefficient of one (1/K), which
        may have either.

        Raises
        ------
        DeckError   When the value lies outside its bounds.
        """
        low = -math.inf if self.minimum is None else self.minimum
        high = math.inf if self.maximum is None else self.maximum
        if not low <= value <= high:
            raise DeckError(f"the start {value:g} of '{path}' lies outside its bounds {low:g} .. {high:g}.", code="value.outside-range")
        keeps_sign = low == -math.inf and any(dimension[:-1])
        return (low > 0 or keeps_sign) and value > 0, low, high

    @staticmethod
    def read(value: str | float | Mapping[str, Any] | Parameter, where: str = "") -> Parameter:
        """Return a parameter from what a deck or a Python caller writes.

        Parameters
        ----------
        value : str, number, table or Parameter
            ``"2.168 [W]"``, ``"(1 - x)*area"``, ``0.3``, or a table with `value` and any of `min`, `max`, `source`, `note`, `basis`,
            `spread`.
        where : str     File and key path, for messages.

        Raises
        ------
        ThermidError    When the text cannot be read, a bound is reversed or has another dimension, or a key is unknown.
        """
        if isinstance(value, Parameter):
            return value
        table: Mapping[str, Any] = value if isinstance(value, Mapping) else {"value": value}
        with errors_at(where):
            unknown = set(table) - {"value", "min", "max", "source", "note", "basis", "spread"}
            if unknown or "value" not in table:
                raise DeckError(
                    "the keys of a parameter are value, min, max, source, note, basis and spread; given: "
                    f"{', '.join(sorted(map(str, unknown))) or 'a table without value'}.",
                    code="value.wrong-kind",
                )
            raw = table["value"]
            expression = Expression.parse(raw if isinstance(raw, str) else _written_number(raw))
            low, high = _bound(table.get("min"), expression), _bound(table.get("max"), expression)
            if low is not None and high is not None and low > high:
                raise DeckError(
                    f"its minimum {table['min']} is above its maximum {table['max']}. Exchange the two bounds.", code="value.outside-range"
                )
            source = table.get("source", "")
            refuse_unknown([source] if source else (), SOURCES, refusal="source '{}' is not one of {known}.", error=DeckError)
            out = Parameter(expression, low, high, source, table.get("note", ""), table.get("basis", ""))
            out = replace(out, spread=_spread(table["spread"], out)) if table.get("spread", "") != "" else out
            if out.is_range and expression.literal is not None:
                check_bounds(expression.literal.value, out, "")
            return out

    @staticmethod
    def exact(value: float, unit_text: str, note: str = "") -> Parameter:
        """Return an SI number as a parameter written in a unit; the float itself is kept, so that writing and reading do not change it."""
        import ast

        of = unit(unit_text)
        plain = from_si(value, of)
        tree = ast.parse(repr(abs(plain)), mode="eval").body
        return Parameter(Expression(f"{plain!r} [{unit_text}]", (), Literal(value, of), tree), source="", note=note)


def _bound(value: Any, expression: Expression, what: str = "bound") -> float | None:
    """Return a bound (or a spread, `what`) in SI, given as a number in the unit of the value or as a text with a unit; None stays."""
    if value is None:
        return None
    if isinstance(value, str):
        literal = Expression.parse(value).literal
        if literal is None:
            raise DeckError(f"the {what} '{value}' must be a number with a unit.", code="value.wrong-kind")
        if expression.literal is not None and literal.unit.dimension != expression.literal.unit.dimension:
            raise UnitError(
                f"the {what} '{value}' is {describe(literal.unit.dimension)}; the value is {describe(expression.literal.unit.dimension)}.",
                code="unit.wrong-dimension",
            )
        return literal.value
    number = float(_written_number(value))
    if expression.literal is None or abs(number) == float("inf"):
        return number
    own_unit = expression.literal.unit
    return Expression.parse(f"{number!r} [{own_unit.text}]").literal.value  # type: ignore[union-attr]  # a pure number is a literal


def _deviation(spread: str, of: Literal) -> float:
    """Return the standard deviation that a spread states of a number, in per cent of it or with a unit; NaN where it states none. [SI]"""
    number = Expression.parse(spread).literal
    relative = number is not None and number.unit.text == "%"
    if number is None or number.unit.absolute or (relative and of.unit.absolute):
        return math.nan
    return number.value * abs(of.value) if relative else number.value


def _spread(value: Any, out: Parameter) -> str:
    """Return a spread as a parameter has it: a standard deviation as text, a number in the value's own unit, or `RANGE`."""
    of = out.expression.literal
    if of is None or (value == RANGE and (out.minimum is None or out.maximum is None or not out.minimum < out.maximum)):
        raise DeckError("a spread needs a value that is a number; 'range' needs a min below a max besides.", code="value.incomplete")
    if value == RANGE:
        return RANGE
    text = value if isinstance(value, str) else f"{_written_number(value)} [{'K' if of.unit.absolute else of.unit.text}]"
    if "%" not in text:
        _bound(text, out.expression, "spread")
    if not 0.0 < _deviation(text, of) < math.inf:
        raise DeckError(
            f"the spread '{text}' is no standard deviation above zero. Write one such as '5 [%]', that of a temperature in K, or 'range'.",
            code="value.outside-range",
        )
    return text


def _written_number(value: Any) -> str:
    """Return `repr` of a plain number; of anything else raise a DeckError."""
    try:
        number = math.nan if isinstance(value, bool | str) else float(value)
    except (TypeError, ValueError):
        number = math.nan
    if math.isnan(number):
        raise DeckError(f"{value!r:.60} is not a value. Write a text with a unit, '2.5 [W]', or a number.", code="value.wrong-kind")
    return repr(number)


def check_bounds(value: float, parameter: Parameter, where: str) -> None:
    """Refuse a value outside its bounds.

    Raises
    ------
    DeckError   When it lies below the minimum or above the maximum by more than rounding; a value is never moved to its bound.
    """
    for bound, side, beyond in ((parameter.minimum, "minimum", -1.0), (parameter.maximum, "maximum", 1.0)):
        if bound is not None and (value - bound) * beyond > 1e-12 * abs(bound):
            word = "below" if beyond < 0 else "above"
            of = unit(parameter.unit or "1")
            shown = [f"{from_si(v, of):.6g}" for v in (value, bound)]
            raise DeckError(
                f"{shown[0]} lies {word} its {side} {shown[1]} [{of.text}]. Correct the value or the bound.",
                where,
                code="value.outside-range",
            )
