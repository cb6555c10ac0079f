"""`read_spread`: the probability distribution that a written spread means."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from thermid.base.errors import ScenarioError, nearest
from thermid.base.units import TEMPERATURE, THREE_WAYS, Expression, stated
from thermid.model.tree import literal
from thermid.values._store import Cut, Distribution, LogNormal, Normal, Uniform

MIN_SHARE_IN_BOUNDS = 1e-3
"""Probability within a deck's bounds below which a spread does not fit them. [-]"""
LARGEST_SHIFT = 100.0
"""Kelvin from which a temperature written in K is no shift but a slip: 293 K for 20 degC. [K]"""


def read_spread(written: Any, slot: str, nominal: float, where: str, *, bounds: tuple[float, float] = (-np.inf, np.inf)) -> Distribution:
    """Probability distribution that a written spread means.

    Parameters
    ----------
    written : str, Quantity, dict  ``"0.5 [W]"`` or ``{"sd": "0.5 [W]"}``: normal, a standard deviation; ``"10 [%]"``: of the value;
                            ``{"log_sd": 0.2}``: the logarithm normal; ``{"low": ..., "high": ...}``: uniform between, nothing beyond;
                            ``"range"``: uniform between `bounds`. ``mean`` may stand beside ``sd`` and ``log_sd`` (there: the
                            median). Of a temperature K means a shift of what deck or scenario have, degC and degF the temperature itself.
    slot : str              Unit of the value: a unit text, `temperature`, or K for a shift of a temperature that varies in time.
    nominal : float         What the value is otherwise; zero for a shift. [SI]
    where : str             What is spread, for messages.
    bounds : (float, float) Of the deck and of physics: they cut normal laws, and a uniform one must lie within them. [SI]

    Raises
    ------
    ScenarioError   When it is none of these forms, or passes the bounds.
    UnitError       When a number has another dimension than the value.
    """
    if isinstance(written, str) and written == "range":
        if not np.isfinite(bounds).all():
            raise ScenarioError(
                "'range' needs min and max of the value in its deck. Give them or its spread there, or another spread here.",
                where,
                code="value.incomplete",
            )
        return Uniform(*bounds)
    table: Mapping[str, Any] = {"sd": written} if isinstance(written, str) or stated(written) is not None else written
    return cut(FORMS[_form(table, where)][2](table, slot, nominal, where, bounds), bounds, where)


def _form(table: Any, where: str) -> str:
    """Return the key of the form of a spread; refuse a table without a form, with a key of another one, or without a key that it needs."""
    form = next((key for key in FORMS if isinstance(table, Mapping) and key in table), "")
    needed, beside, _ = FORMS.get(form, (set(), set(), None))
    if not form or not needed <= set(table) <= needed | beside:
        every = {key for keys in FORMS.values() for key in keys[0] | keys[1]}
        odd = next((k for k in table if k not in every), "") if isinstance(table, Mapping) else ""
        forms = ", ".join(f"{{{', '.join(sorted(keys[0], reverse=True))}}}" for keys in FORMS.values())
        raise ScenarioError(f'write {forms} or "range".{nearest(odd, sorted(every))}', where, code="name.unknown")
    return form


def _normal(table: Mapping[str, Any], slot: str, nominal: float, where: str, bounds: tuple[float, float]) -> Distribution:
    """Return the normal law of the standard deviation `sd` about `mean`, or the nominal value."""
    mean = _value(table["mean"], slot, nominal, where) if "mean" in table else nominal
    return Normal(mean, _from_zero(deviation(table["sd"], slot, mean, where), where))


def _log_normal(table: Mapping[str, Any], slot: str, nominal: float, where: str, bounds: tuple[float, float]) -> Distribution:
    """Return the log-normal law of the deviation `log_sd` about `mean`, its median, or the nominal value."""
    median = _value(table["mean"], slot, nominal, where) if "mean" in table else nominal
    if slot in (TEMPERATURE, "K") or not median > 0.0:
        raise ScenarioError(
            "log_sd applies only to a value above zero that is not a temperature. Give sd.", where, code="value.without-effect"
        )
    return LogNormal(median, _from_zero(literal(table["log_sd"], "1", where), where))


def _uniform(table: Mapping[str, Any], slot: str, nominal: float, where: str, bounds: tuple[float, float]) -> Uniform:
    """Return the uniform law between the ends `low` and `high` of a table; refuse ends that are exchanged or pass the bounds."""
    if slot == TEMPERATURE and _absolute(table["low"], where) != _absolute(table["high"], where):
        raise ScenarioError(
            "one end is a temperature and the other a shift in kelvin. Write both in degC, or both in K.",
            where,
            code="value.excludes-another",
        )
    low, high = (_value(table[k], slot, nominal, where) for k in ("low", "high"))
    if low > high:
        raise ScenarioError("its low end is above its high end. Exchange them.", where, code="value.outside-range")
    slack = 1e-9 * max(abs(low), abs(high), 1e-300)
    if low < bounds[0] - slack or high > bounds[1] + slack:
        raise ScenarioError(
            f"{table['low']} to {table['high']} exceeds its bounds, {bounds[0]:.6g} to {bounds[1]:.6g} in SI units. "
            'Give ends within them, or "range".',
            where,
            code="value.outside-range",
        )
    return Uniform(max(low, bounds[0]), min(high, bounds[1]))


def _absolute(text: Any, where: str) -> bool:
    """Return whether a written number is a temperature on a scale (degC, degF) and not a difference in kelvin."""
    number = Expression.parse(text).literal if isinstance(text, str) else stated(text)
    if number is None:
        raise ScenarioError(f"{text!r} has no unit. {THREE_WAYS}; a shift is '2 [K]'.", where, code="value.incomplete")
    return number.unit.absolute


def _value(text: Any, slot: str, nominal: float, where: str) -> float:
    """Return a written value in SI; a number in kelvin for a temperature is a shift from `nominal`, or the shift alone for the slot K."""
    if slot not in (TEMPERATURE, "K"):
        return literal(text, slot, where)
    if _absolute(text, where):
        if slot == "K":
            raise ScenarioError(
                f"this input varies in time or is a difference. Give a shift in kelvin, such as 2 [K], not {text}.",
                where,
                code="value.without-effect",
            )
        return literal(text, TEMPERATURE, where)
    shift = literal(text, "K", where)
    if slot == TEMPERATURE and abs(shift) > LARGEST_SHIFT:
        raise ScenarioError(
            f"{text} would be a shift of more than {LARGEST_SHIFT:g} K. Write a temperature in degC.", where, code="value.outside-range"
        )
    return nominal + shift if slot == TEMPERATURE else shift


def deviation(text: Any, slot: str, mean: float, where: str) -> float:
    """Return a standard deviation: a number in the unit of what it spreads, or per cent of the mean. [SI]

    Raises
    ------
    ScenarioError   When per cent are of a temperature.
    UnitError       When it has another dimension.
    """
    number = Expression.parse(text).literal if isinstance(text, str) else stated(text)
    if number is None or number.unit.text != "%":
        return literal(text, "K" if slot == TEMPERATURE else slot, where)
    if slot in (TEMPERATURE, "K"):
        raise ScenarioError("per cent do not apply to a temperature. Give kelvin.", where, code="value.without-effect")
    return literal(text, "1", where) * abs(mean)


def _from_zero(sd: float, where: str) -> float:
    """Return a standard deviation; refuse one that is negative or not finite."""
    if not (sd >= 0.0 and np.isfinite(sd)):
        raise ScenarioError("a standard deviation must be zero or more.", where, code="value.outside-range")
    return sd


def cut(law: Distribution, bounds: tuple[float, float], where: str) -> Distribution:
    """Return a normal or log-normal law truncated to the bounds (low, high); as it is one without spread or within them, and any other.

    Raises
    ------
    ScenarioError   When almost all of it lies beyond.
    """
    out = Cut(law, *bounds) if isinstance(law, Normal | LogNormal) and law.variance > 0.0 else None
    if out is None or out.share == 1.0:
        return law
    if not out.share > MIN_SHARE_IN_BOUNDS:
        raise ScenarioError(
            "almost all values of this spread lie outside its bounds. Choose a mean inside them, or a smaller spread.",
            where,
            code="value.outside-range",
        )
    return out


FORMS: Mapping[str, tuple[set[str], set[str], Callable[[Mapping[str, Any], str, float, str, tuple[float, float]], Distribution]]] = {
    "sd": ({"sd"}, {"mean"}, _normal),
    "log_sd": ({"log_sd"}, {"mean"}, _log_normal),
    "low": ({"low", "high"}, set(), _uniform),
}
"""Key of a form of a spread -> keys that it needs, keys that may stand beside, its law; the first key that a written table has decides."""
