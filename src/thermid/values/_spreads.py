"""Distributions of values: what a written spread means (`read_spread`), and what ranges of decks stand for where no error is known."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from thermid.base.errors import ScenarioError, nearest, quoted
from thermid.base.units import TEMPERATURE, THREE_WAYS, Expression, counted, stated
from thermid.model.tree import Entry, Parameter, ParameterSet, StatedRange, Tree, literal, local_identities
from thermid.values._store import Cut, Distribution, LogNormal, Normal, Source, Store, Uniform

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


RANGE_OF = "range of "
"""What the name of a source begins with that is a stated range."""
MAX_VARIANCE_LEFT = 0.8
"""Part of the variance of an assumed value that readings leave at most, where they count; its stated law stays as it is beyond. [-]"""


@dataclass(frozen=True)
class RangedValue:
    """A value of a deck whose range a catalogue, a data sheet or its author states, and nobody fitted.

    Parameters
    ----------
    path : str                  In the model.
    also : tuple of str         Other paths with the same value: twins, and parts of one material.
    stated : StatedRange
    columns : tuple             Standard normal sources of its error, with the part of its standard deviation that each has: a finish has
                                one for all surfaces and one for each. [-]
    """

    path: str
    also: tuple[str, ...]
    stated: StatedRange
    columns: tuple[tuple[Source, float], ...]

    @property
    def words(self) -> str:
        """What its source of error is called: ``the range of 'paint, black' in lid.emissivity``."""
        return f"the range of '{self.stated.name}' in {self.path}" if self.stated.name else f"the range of {self.path}"

    def law(self, nominal: float) -> Distribution:
        """Return its distribution about a model's value: log-normal where value and range are above zero, else normal. [SI]"""
        has_log = self.stated.low > 0.0 and nominal > 0.0
        return LogNormal(nominal, self.stated.log_sd(nominal)) if has_log else Normal(nominal, self.stated.sd)

    def sd_left(self, nominal: float, of_assumed: Mapping[str, tuple[float, float]]) -> float:
        """Return its standard deviation once readings are counted, see `narrowed`. [SI]

        `of_assumed`: path -> variance of the readings' estimate and its shift; of several of its paths the smallest variance counts.
        """
        best = min((of_assumed[p] for p in (self.path, *self.also) if p in of_assumed), default=None)
        return float(narrowed(self.law(nominal), nominal, best).variance ** 0.5)

    @staticmethod
    def of_fit(model: Tree, parameters: ParameterSet, without: Collection[str] = ()) -> list[RangedValue]:
        """Return the values of a model that have a stated range, but for the paths in `without`.

        Twins, and parts of one material, are one `RangedValue`. Two finishes of one name share a source with sqrt(alike) of their standard
        deviation and have one each for the rest.
        """
        twins, groups = local_identities(model), dict[str, list[str]]()
        stated = {p: r for p, r in parameters.stated_ranges.items() if p not in without}
        for path, r in stated.items():
            first = twins[path].paths[0] if path in twins else path
            groups.setdefault(r.name if r.alike == 1.0 else first, []).append(path)
        places = [_place(model, parameters.table[paths[0]]) for paths in groups.values()]
        out = []
        for (path, *also), where in zip(groups.values(), places, strict=True):
            r = stated[path]
            place = where if places.count(where) == 1 else f"{where} at {path}"  # twins that a cut parted
            words = f"the range of '{r.name}'" if r.name else f"the range of {path}"
            shares = {r.name: math.sqrt(r.alike), place: math.sqrt(1.0 - r.alike)}
            columns = tuple(
                (Source(f"{RANGE_OF}{what}", "stated", Normal(), words), share) for what, share in shares.items() if share > 0.0
            )
            out.append(RangedValue(path, tuple(also), r, columns))
        return out


def _place(model: Tree, entry: Entry) -> str:
    """Return where a value is written, by the title of its deck: a file may be renamed, and its lines move."""
    owner = model.submodel(entry.scope.removesuffix(".")) if entry.scope else model
    return f"{owner.title}, {entry.where.rpartition(', ')[2]}"


def without_spread(paths: Sequence[str], source: str = "assumed") -> str:
    """Return the sentence part that names values of a source without a stated spread, of more than three the first three."""
    return f"{counted(len(paths), f'{source} value'.strip())} without a stated spread ({quoted(paths, 3)})"


def bracketed(parameters: Mapping[str, Parameter], sources: Collection[str]) -> list[str]:
    """Return the paths of numbers of some `sources` whose minimum and maximum bound a search alone: neither a range nor a spread."""
    bare = {p: x for p, x in parameters.items() if x.is_literal and x.stated_range is None and x.source in sources}
    return [p for p, x in bare.items() if None not in x.walls]


def range_shares(store: Store, path: str) -> dict[str, float]:
    """Return name of a stated range -> its share of the variance of a value, the largest first. [-]"""
    row = store.rows([path])[0]
    whole = float(row @ row)
    parts: dict[str, float] = {}
    for source, x in zip(store.sources, row.tolist(), strict=True):
        if source.name.startswith(RANGE_OF) and x:
            what = source.words.removeprefix(f"the {RANGE_OF}")
            parts[what] = parts.get(what, 0.0) + x**2 / whole
    return dict(sorted(parts.items(), key=lambda item: -item[1]))


def narrowed(law: Distribution, nominal: float, variance_and_shift: tuple[float, float] | None) -> Distribution:
    """Return the distribution of an assumed value once the readings of a fit are counted; `nominal` is the value that the fit assumed.

    With the variances v of `law` and V of the readings, and the shift d that they ask for, the variance left is s V + (s d)^2 with
    s = v / (v + V): the value of the fit stays nominal, so the shift s d counts as error. The law itself is returned where no readings are
    given, or where less than a fifth of its variance would go.
    """
    if variance_and_shift is None or not law.variance:
        return law
    variance, shift = variance_and_shift
    share = law.variance / (law.variance + variance)
    variance_left = share * variance + (share * shift) ** 2
    return Normal(nominal, variance_left**0.5) if variance_left < MAX_VARIANCE_LEFT * law.variance else law
