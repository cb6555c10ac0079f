"""Random draws of what may change from member to member of an ensemble: normal, lognormal or uniform, reproducible from a seed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from thermid.arguments import takes_objects
from thermid.errors import ScenarioError, nearest
from thermid.expression import parse
from thermid.model.signal import literal
from thermid.units import TEMPERATURE

if TYPE_CHECKING:
    from thermid.model.model import Model
    from thermid.simulation.scenario import Scenario
    from thermid.simulation.simulator import Simulator

__all__ = ["draw"]

Array = NDArray[np.float64]
MOST_TRIES = 1000
FORMS = {"sd": {"sd", "mean"}, "log_sd": {"log_sd", "mean"}, "low": {"low", "high"}}
"""What names the form of a spread, and the keys that the form has."""


@takes_objects
def draw(model: Model, scenario: Scenario, spreads: Mapping[str, Any], members: int, *, seed: int) -> dict[str, Array]:
    """Return name -> value of every member (members,), independent of each other. [SI]

    Parameters
    ----------
    model, scenario     As in `simulate`; they give the values that are spread, and their units.
    spreads : dict      Name as in `ensemble` -> one of ``{"sd": "0.5 [W]"}``, normal, in per cent for a part of the mean;
                        ``{"log_sd": 0.2}``, the logarithm normal; ``{"low": "4 [W]", "high": "6 [W]"}``, uniform; ``"10 [%]"`` for
                        ``{"sd": "10 [%]"}``. The mean (of ``log_sd``: the median) is the model's own value unless ``mean`` gives another.
                        Values beyond the bounds that a deck sets are drawn again.
    members : int       How many to draw.
    seed : int          The same seed gives the same values.

    Raises
    ------
    NameNotFoundError   When a name does not exist.
    ScenarioError       When a spread is none of these forms.
    UnitError           When a number has another dimension than what it spreads.
    """
    from thermid.simulation.simulator import prepare

    if members < 1:
        raise ScenarioError("an ensemble needs at least one member.", model.title)
    duration = scenario if scenario.seconds > 0 else scenario.with_(duration=1.0)
    ready = prepare(model, duration, tuple(spreads))
    generator = np.random.default_rng(seed)
    return {name: _drawn(ready, name, spread, members, generator) for name, spread in zip(ready.free, spreads.values(), strict=True)}


def _drawn(ready: Simulator, name: str, spread: Any, members: int, generator: np.random.Generator) -> Array:
    where = f"{ready.title}, spread of '{name}'"
    given: Mapping[str, Any] = {"sd": spread} if isinstance(spread, str) else spread
    form = next((f for f in FORMS if isinstance(given, Mapping) and f in given), "")
    if not form or not set(given) <= FORMS[form] or (form == "low" and "high" not in given):
        odd = next((k for k in given if k not in {"sd", "log_sd", "low", "high", "mean"}), "") if isinstance(given, Mapping) else ""
        raise ScenarioError(f"write {{sd}}, {{log_sd}} or {{low, high}}.{nearest(odd, ('sd', 'log_sd', 'low', 'high', 'mean'))}", where)
    at, difference = ready.slots(name)
    nominal = ready.nominal[name]
    if form == "low":
        low, high = (literal(given[k], at, where) for k in ("low", "high"))
        if low > high:
            raise ScenarioError("its low end lies above its high end.", where)
        return _bounded(ready, name, lambda n: generator.uniform(low, high, n), members, where)
    mean = literal(given["mean"], at, where) if "mean" in given else nominal
    if form == "log_sd":
        sd = _above_zero(literal(given["log_sd"], "1", where), where)
        if not mean > 0:
            raise ScenarioError("only a value above zero has a logarithm to spread.", where)
        return _bounded(ready, name, lambda n: mean * np.exp(sd * generator.standard_normal(n)), members, where)
    sd = _above_zero(_sd(given["sd"], mean, at, difference, where), where)
    return _bounded(ready, name, lambda n: mean + sd * generator.standard_normal(n), members, where)


def _sd(given: Any, mean: float, at: str, difference: str, where: str) -> float:
    """Return a standard deviation: a number in the unit of what it spreads, or a part of the mean. [SI]"""
    own = parse(given).literal if isinstance(given, str) else None
    if own is None or own.unit.text != "%":
        return literal(given, difference, where)
    if at == TEMPERATURE or difference == "K":
        raise ScenarioError("a temperature is not spread by per cent; give kelvin.", where)
    return own.value * abs(mean)


def _above_zero(sd: float, where: str) -> float:
    if not (sd >= 0 and np.isfinite(sd)):
        raise ScenarioError("a standard deviation is a number from zero up.", where)
    return sd


def _bounded(ready: Simulator, name: str, make: Any, members: int, where: str) -> Array:
    """Return values within the bounds of a parameter; those beyond them are drawn again."""
    low, high = ready.bounds(name)
    out: Array = make(members)
    for _ in range(MOST_TRIES):
        beyond = np.flatnonzero((out < low) | (out > high))
        if not beyond.size:
            return out
        out[beyond] = make(beyond.size)
    raise ScenarioError("hardly any value drawn lies within its bounds. Choose a mean inside them, or a smaller spread.", where)
