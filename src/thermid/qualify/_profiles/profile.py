"""Profiles of environmental tests: numbers with clause and mark, the steps that follow, checks, text and TOML.

The profiles of the standards by their names, and those of files that are like them.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

from thermid.base.errors import ScenarioError, ThermidError, cap, errors_at, look_up, nearest, raising, refuse_unknown
from thermid.base.files import FileKinds, Places, by_grammar, grammar_of, read_toml, refuse_another_kind, toml_value
from thermid.base.results import Figure, Result
from thermid.base.units import ATMOSPHERE, HOUR, ICE_POINT, TEMPERATURE, Kelvin, Quantity, amount, si_value
from thermid.measure.records import StabilityRule
from thermid.model.tree import literal
from thermid.qualify._profiles._constants import CYCLES
from thermid.qualify._profiles.numbers import SLOTS, USUAL, WORDS


@dataclass(frozen=True)
class Number:
    """A number or word of a profile with its source.

    Parameters
    ----------
    value : float or str    [SI]
    slot : str              Unit of the number; empty for a word.
    mark : str              How it is known: read, project, secondary or memory.
    clause : str            Clause of the standard.
    note : str              What a reader must know beside it.
    """

    value: float | str
    slot: str
    mark: str
    clause: str = ""
    note: str = ""

    @property
    def text(self) -> str:
        """The value with a usual unit, as a profile file holds it: ``60 [degC]``, ``3 [K/min]``, ``2 [h]``."""
        if isinstance(self.value, str):
            return self.value
        v = self.value
        if self.slot == TEMPERATURE:
            return f"{round(v - ICE_POINT, 9):.6g} [degC]"
        if self.slot == "K/s":
            return f"{round(60.0 * v, 9):.6g} [K/min]"
        if self.slot == "s":
            return f"{v / 3600.0:.6g} [h]" if v >= 7200.0 or (v >= HOUR and v % HOUR == 0) else f"{v / 60.0:.6g} [min]"
        return f"{v:.6g}" if self.slot == "1" else f"{v:.6g} [{self.slot}]"

    def to_dict(self) -> dict[str, str]:
        """Return text, mark, clause and note for JSON."""
        return {"text": self.text, "mark": self.mark, "clause": self.clause, "note": self.note}


def number(name: str, spec: Any, mark: str, clause: str, where: str) -> Number:
    """Return a number from what a file or a caller writes: a value, or a table of value, mark, clause and note.

    Parameters
    ----------
    name : str              Name of the number, a key of `SLOTS` or `WORDS`.
    spec : Number, str, float or table
    mark, clause : str      Those of the profile, where the table has none.
    where : str             Place for messages.

    Raises
    ------
    ScenarioError   When there is no such number, mark or word, or a number other than a temperature is below zero.
    UnitError       When its unit does not fit.
    """
    place = f"{where}, {name}"
    if isinstance(spec, Number):
        return spec
    refuse_unknown([name], (*SLOTS, *WORDS), where, "a profile has no '{}'.", ScenarioError)
    note = ""
    if isinstance(spec, Mapping):
        unknown = set(spec) - {"value", "mark", "clause", "note"}
        if unknown or "value" not in spec:
            raise ScenarioError("give a number as a value, or as a table of value, mark, clause and note.", place, code="value.wrong-kind")
        mark, clause, note = spec.get("mark", mark), spec.get("clause", clause), spec.get("note", "")
        spec = spec["value"]
    Figure.check_mark(mark, place)
    if name in WORDS:
        if not isinstance(spec, str) or (WORDS[name] and spec not in WORDS[name]):
            raise ScenarioError(
                f"{spec!r} is not one of {', '.join(WORDS[name]) or 'the rules of stability'}.", place, code="value.wrong-kind"
            )
        return Number(spec, "", mark, clause, note)
    with errors_at(place):
        si = si_value(spec, SLOTS[name])
    if si is None and (isinstance(spec, bool) or not isinstance(spec, int | float)):
        raise ScenarioError(f"{spec!r} is not a value with a unit.", place, code="value.wrong-kind")
    value = amount(spec, "1", place) if si is None else si
    if SLOTS[name] != TEMPERATURE and value < 0.0:
        raise ScenarioError(f"{spec!r} is below zero.", place, code="value.outside-range")
    return Number(value, SLOTS[name], mark, clause, note)


def typed(name: str, text: str) -> str | float:
    """Return what a person typed for a number as a profile reads it: with its usual unit where none is written, a word as it is.

    >>> typed("hot", "60"), typed("cycles", "8"), typed("hot", "333 [K]")
    ('60 [degC]', 8.0, '333 [K]')
    """
    slot = SLOTS.get(name)
    try:
        value = float(text)
    except ValueError:
        return text.strip()
    if slot is None:
        return text.strip()
    return value if slot == "1" else f"{text.strip()} [{USUAL.get(slot, slot)}]"


@dataclass(frozen=True)
class Equivalence:
    """A fatigue law: ``cycles`` over ``range`` are worth N = cycles (range / dT)^exponent cycles over a range dT.

    Parameters
    ----------
    cycles : float      Cycles that the clause requires, those in vacuum included.
    range : float       From cold to hot. [K]
    exponent : float    Exponent of the law.
    clause : str        Clause of the standard.
    """

    cycles: float
    range: float
    exponent: float
    clause: str

    def exact(self, span: float) -> float:
        """Return cycles (range / span)^exponent, the cycles over a range `span` [K], not rounded."""
        return float(self.cycles * (self.range / span) ** self.exponent)


EQUIVALENCE: Final[Mapping[str, Equivalence]] = {level: Equivalence(*row, "SMC-S-016, 6.3.8.3") for level, row in CYCLES.items()}
"""Level -> the formula of SMC-S-016; read."""


def equivalent_cycles(cold: str | float, hot: str | float, level: str | Equivalence = "qualification") -> int:
    """Return N = cycles (range / (hot - cold))^exponent, rounded up: the cycles between two temperatures that a level requires.

    Parameters
    ----------
    cold, hot : str or float        The range that is run. [K]
    level : str or Equivalence      qualification, protoqualification, acceptance, or a fatigue law of the project's own.

    Raises
    ------
    ScenarioError   When cold is not below hot, or there is no such level.

    References
    ----------
    SMC-S-016 (2014), 6.3.8.3: N = 27 (105/dT)^1.4, 20 (95/dT)^1.4, 14 (85/dT)^1.4.
    """
    if not isinstance(level, Equivalence):
        level = look_up(level, EQUIVALENCE, "unknown level '{}'. Use one of {known}.", "cycles", ScenarioError)
    low, high = (literal(v, TEMPERATURE, "cycles") for v in (cold, hot))
    if low >= high:
        raise ScenarioError(
            f"the cold level, {low - 273.15:g} degC, is not below the hot one, {high - 273.15:g} degC. Give cold first, then hot.",
            "cycles",
            code="value.outside-range",
        )
    return math.ceil(round(level.exact(high - low), 9))


@dataclass(frozen=True)
class ProfileStep:
    """One step of a profile; whatever is None stays as it was.

    Parameters
    ----------
    name : str                  Name for tables.
    cycle : int                 Its cycle, from 1; 0 before the first and after the last.
    target : float or None      Temperature that the chamber goes to. [K]
    over : float or None        Time in which it goes there. [s]
    ramp : float or None        Rate at which it goes there, where no time is given. [K/s]
    pressure : float or None    Pressure that it goes to. [Pa]
    humidity : float or None    Relative humidity that it goes to. [-]
    wait : bool                 Whether to wait until the unit is stable.
    dwell : float               Time to stay after that. [s]
    power : bool or None        Whether the unit is switched on.
    mark : str                  How the numbers of the step are known.
    """

    name: str
    cycle: int = 0
    target: float | None = None
    over: float | None = None
    ramp: float | None = None
    pressure: float | None = None
    humidity: float | None = None
    wait: bool = False
    dwell: float = 0.0
    power: bool | None = None
    mark: str = "read"


def _step_from_row(profile: ThermalProfile, row: Mapping[str, Any], where: str) -> ProfileStep:
    """Return a step of a profile from its table in a file, in SI; `where` is its place for messages."""

    def value(key: str, slot: str) -> float | None:
        """Return the number of a key in SI; None where it has none."""
        text = row.get(key)
        if text is None:
            return None
        if isinstance(text, str) and text in SLOTS:
            return profile.value(text)
        quantity = literal(text, slot, f"{where}, {key}")
        if slot != TEMPERATURE and quantity < 0.0:
            raise ScenarioError(f"{text!r} is below zero.", f"{where}, {key}", code="value.outside-range")
        return quantity

    power = row.get("power")
    mark = row.get("mark", profile.step_mark)
    Figure.check_mark(mark, where)
    target, over = value("to", TEMPERATURE), value("over", "s")
    ramp = value("ramp", "K/s")
    if target is not None and over is None and ramp is None:
        ramp = profile.value("ramp")
    return ProfileStep(
        str(row.get("name", "step")),
        int(row.get("cycle", 0)),
        target,
        over,
        ramp,
        value("pressure", "Pa"),
        value("humidity", "1"),
        bool(row.get("wait", False)),
        value("dwell", "s") or 0.0,
        None if power is None else power == "on",
        mark,
    )


def _cycle_steps(profile: ThermalProfile, count: int) -> Iterator[ProfileStep]:
    """Yield the steps of `count` cycles between hot and cold: pump down, plateaus, return to ambient, let in gas."""
    value, has = profile.value, profile.has
    ramp, powered = value("ramp"), profile.word("starts", "never") != "never"
    if has("pressure"):
        if has("rough_pressure"):
            yield ProfileStep("pump down", power=powered, pressure=value("rough_pressure"), over=value("pump_down"))
        yield ProfileStep("high vacuum", power=powered, pressure=value("pressure"), over=value("pump_down") if has("pump_down") else 600.0)
    first = profile.word("first", "hot")
    order = (first, "cold" if first == "hot" else "hot")
    for k in range(1, count + 1):
        for side in order:
            yield from _plateau_steps(profile, side, k, count, ramp, powered)
    if profile.word("last", order[1]) != order[1]:
        yield ProfileStep(f"to {first}, closing half cycle", 0, value(first), None, ramp, wait=True, power=powered)
        yield ProfileStep(f"{first}, closing half cycle", 0, dwell=value("dwell") if has("dwell") else 0.0)
    yield ProfileStep("return", 0, value("ambient"), None, ramp, power=powered)
    if has("pressure"):
        yield ProfileStep("let in gas", 0, pressure=ATMOSPHERE, over=600.0)


def _plateau_steps(profile: ThermalProfile, side: str, k: int, count: int, ramp: float, powered: bool) -> Iterator[ProfileStep]:
    """Yield the steps at one side, hot or cold, of cycle `k` of `count`: the way there, dwell, power off, start, and operation.

    The stay lasts as long as the longest of soak, and dwell, off time and operation one after the other. `ramp` is in K/s; `powered` says
    whether the unit is on.
    """
    value = profile.value

    def at_ends(name: str) -> float:
        """Return a number that may be another in the first and the last cycle."""
        name_at_ends = f"{name}_ends" if k in (1, count) and profile.has(f"{name}_ends") else name
        return value(name_at_ends) if profile.has(name_at_ends) else 0.0

    starts = profile.word("starts", "never")
    start = starts == "each" or (starts == "first and last" and k in (1, count))
    dwell = value("dwell") if profile.has("dwell") else 0.0
    off = value("off") if start and profile.has("off") else 0.0
    operate = at_ends("operate") if side == "hot" and start else 0.0
    rest = max(at_ends("soak") - dwell - off, operate)
    yield ProfileStep(f"to {side}", k, value(side), None, ramp, wait=profile.has("stable"), power=powered)
    if start:
        if dwell:
            yield ProfileStep(f"{side} dwell", k, dwell=dwell)
        yield ProfileStep(f"{side}, off", k, dwell=off, power=False)
        yield ProfileStep(f"{side} start", k, dwell=rest, power=True)
    elif dwell + rest > 0.0:
        yield ProfileStep(f"{side} soak" if not dwell else f"{side} dwell", k, dwell=dwell + rest)


KINDS: Final = ("thermal cycling", "thermal vacuum", "thermal balance", "humidity")


@dataclass(frozen=True)
class ThermalProfile(Result):
    """A test profile: its numbers with their clauses, and the steps that follow from them.

    Parameters
    ----------
    title : str                     Title.
    kind : str                      Thermal cycling, thermal vacuum, thermal balance or humidity.
    standard, edition, clause : str Where it comes from.
    level : str                     Qualification, acceptance, a category; empty where the profile has only one.
    numbers : dict                  Name -> `Number`.
    predicted : pair or None        Lowest and highest predicted temperature, the model's uncertainty included. [K]
    plan : tuple of dict            Steps as written; empty where they follow from the numbers.
    step_mark : str                 How the numbers in written steps are known.
    note : str                      What a reader must know.
    """

    title: str
    kind: str
    standard: str
    edition: str
    clause: str
    level: str
    numbers: Mapping[str, Number]
    predicted: tuple[float, float] | None = None
    plan: tuple[Mapping[str, Any], ...] = ()
    step_mark: str = "project"
    note: str = ""

    def __getitem__(self, name: str) -> Number:
        """Return a number. Hot and cold follow from the predicted range where they are not given, middle is their mean.

        Raises
        ------
        ScenarioError   When the profile has none of that name, or the predicted range is not known.
        """
        if name in self.numbers:
            return self.numbers[name]
        if name in ("hot", "cold"):
            return self._level(name)
        if name == "middle":
            ends = [self["cold"], self["hot"]]
            mark = Figure.weakest(n.mark for n in ends)
            return Number(sum(float(n.value) for n in ends) / 2.0, TEMPERATURE, mark, "", "mean of hot and cold")
        if name in SLOTS or name in WORDS:
            raise ScenarioError(f"it has no {name}. Give it: {name} = ...", self.title, code="value.incomplete")
        raise ScenarioError(f"a profile has no '{name}'.{nearest(name, [*SLOTS, *WORDS])}", self.title, code="name.unknown")

    def _level(self, side: str) -> Number:
        """Return hot as max(predicted highest + margin, hot_least), or cold as min(predicted lowest - margin, cold_least). [K]

        Raises
        ------
        ScenarioError   When there is no margin, or neither a prediction nor a least level.
        """
        margin, least = self.numbers.get("margin"), self.numbers.get(f"{side}_least")
        if margin is None or (self.predicted is None and least is None):
            raise ScenarioError(
                f"its {side} level is not known: give {side}, or predicted=(lowest, highest), the predicted temperatures including "
                "their uncertainty.",
                self.title,
                code="value.incomplete",
            )
        sign, pick = (1.0, max) if side == "hot" else (-1.0, min)
        used = [n for n in (margin, least) if n is not None]
        ends = [] if self.predicted is None else [self.predicted[side == "hot"] + sign * float(margin.value)]
        ends += [] if least is None else [float(least.value)]
        note = f"predicted {'+' if sign > 0 else '-'} {margin.text}" if self.predicted is not None else "nothing predicted"
        note += f", at least to {least.text}" if least is not None else ""
        return Number(pick(ends), TEMPERATURE, Figure.weakest(n.mark for n in used), margin.clause, note)

    def has(self, name: str) -> bool:
        """Whether a number is given."""
        return name in self.numbers

    def value(self, name: str) -> float:
        """Return a number in SI.

        Raises
        ------
        ScenarioError   When it is a word, or not there.
        """
        number = self[name].value
        if isinstance(number, str):
            raise ScenarioError(f"its {name} is a word, not a number: {number}.", self.title, code="value.wrong-kind")
        return number

    def word(self, name: str, otherwise: str) -> str:
        """Return a word, or `otherwise` where it is not given."""
        return str(self.numbers[name].value) if name in self.numbers else otherwise

    @property
    def steps(self) -> tuple[ProfileStep, ...]:
        """The steps one after the other, with every cycle written out.

        Raises
        ------
        ScenarioError   When a number that the steps need is missing, or cycles are no whole number from 1 to the cap.
        """
        wanted = self.value("cycles")
        count = int(wanted) if math.isfinite(wanted) else 0
        if count > cap("cycles"):
            raise ScenarioError(
                f"{count:g} cycles are too many to write out; at most {cap('cycles'):.0f}.{raising('cycles')}",
                self.title,
                code="cap.exceeded",
            )
        if count < 1 or count != self.value("cycles"):
            raise ScenarioError(
                f"the number of cycles must be whole, at least one, not {self['cycles'].text}.", self.title, code="value.outside-range"
            )
        if not self.plan:
            return tuple(_cycle_steps(self, count))
        out: list[ProfileStep] = []
        for k in range(1, count + 1):
            written = (_step_from_row(self, row, f"{self.title}, step {n}") for n, row in enumerate(self.plan, 1))
            out += [replace(s, cycle=s.cycle or k) for s in written]
        return tuple(out)

    @property
    def used(self) -> Mapping[str, Number]:
        """Name -> number that the steps use, with hot and cold computed; without the numbers that these were computed from."""
        out = {k: n for k, n in self.numbers.items() if k not in ("margin", "hot_least", "cold_least")}
        wanted = (
            ("hot", "cold") if not self.plan else [w for w in ("hot", "cold") if any(row.get("to") in (w, "middle") for row in self.plan)]
        )
        return {k: self[k] for k in wanted} | out

    @property
    def shown(self) -> Mapping[str, Number]:
        """`used`, or the numbers as given where hot and cold cannot be computed."""
        try:
            return self.used
        except ThermidError:
            return self.numbers

    @property
    def mark(self) -> str:
        """The weakest mark of its numbers, steps and rule of stability: read, project, secondary or memory."""
        marks = [n.mark for n in self.used.values()] + [row.get("mark", self.step_mark) for row in self.plan]
        rule = StabilityRule.named(self.word("stable", "")) if self.has("stable") else None
        return Figure.weakest([*marks, *([] if rule is None or self.numbers["stable"].mark == "project" else [rule.mark])])

    @property
    def from_memory(self) -> tuple[str, ...]:
        """Names of the numbers that were written down from memory; ``steps`` for written steps."""
        steps = ("steps",) if any(row.get("mark", self.step_mark) == "memory" for row in self.plan) else ()
        return tuple(k for k, n in self.used.items() if n.mark == "memory") + steps

    @property
    def decides(self) -> bool:
        """Whether a verdict may use it: none of its numbers comes from memory."""
        return not self.from_memory and self.mark != "memory"

    @property
    def trust(self) -> str:
        """How far its numbers can be relied on, in words."""
        if self.decides:
            words = {
                "read": "every number was read in the standard",
                "project": "its numbers were read in the standard or set by the project",
            }
            return words.get(self.mark, "some numbers come from secondary documents, not from the standard itself")
        which = ", ".join(self.from_memory) or "the rule of stability"
        return f"quoted from memory, not checked against the standard: {which}. Check them there before any verdict uses this profile"

    @property
    def equivalence(self) -> Equivalence | None:
        """The fatigue law by which its clause requires a number of cycles; None where it requires none."""
        if not self.has("base_cycles"):
            return None
        clause = self["base_cycles"].clause
        return Equivalence(self.value("base_cycles"), self.value("base_range"), self.value("range_exponent"), clause)

    def missing_cycles(self, beside: float = 0.0) -> float:
        """Return N - cycles - beside: how many cycles it lacks of the N that its clause requires over its range; negative for a surplus.

        It is zero where the clause requires no number.

        Parameters
        ----------
        beside : float  Cycles over the same range that other tests of the unit run.
        """
        law = self.equivalence
        if law is None:
            return 0.0
        need = equivalent_cycles(Kelvin(self.value("cold")), Kelvin(self.value("hot")), law)
        return need - self.value("cycles") - beside

    def check(self, beside: float = 0.0) -> tuple[str, ...]:
        """Return remarks on the profile: condensation at cold ends, too few cycles, numbers from memory.

        Parameters
        ----------
        beside : float  Cycles over the same range that other tests of the unit run.

        Raises
        ------
        ScenarioError   When its cold level is not below its hot one.
        """
        if "hot" in self.used or "cold" in self.used:
            check_level_order(self)
        return (*_condensation_remarks(self), *_cycle_count_remarks(self, beside), *([] if self.decides else [self.trust]))

    def with_(
        self, *, predicted: Any = None, steps: Sequence[Mapping[str, Any]] | None = None, title: str = "", **numbers: Any
    ) -> ThermalProfile:
        """Return the profile with numbers, steps, title or predicted range changed; new numbers are marked as the project's own.

        Raises
        ------
        ScenarioError   When there is no such number, or it has the wrong kind of value.
        """
        new = {k: number(k, v, "project", "", self.title) for k, v in numbers.items()}
        if "stable" in new:
            StabilityRule.named(str(new["stable"].value))
        changed = replace(self, numbers={**self.numbers, **new}, title=title or self.title)
        if predicted is not None:
            changed = replace(changed, predicted=predicted_range(predicted, self.title))
        if steps is None:
            return changed
        if not isinstance(steps, list | tuple):
            raise ScenarioError(f"`steps` takes a list of dictionaries, not {steps!r:.60}.", self.title, code="value.wrong-kind")
        place = Places(f"{self.title}, steps")
        rows = (by_grammar("thermid.qualify._profiles.schema.StepTable", s, place).written for s in steps)
        return replace(changed, plan=tuple(rows), step_mark="project")

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write it as a profile file that `load_profile` reads, every number with its mark."""
        FileKinds.PROFILE.save_text(path, as_toml(self))

    def __str__(self) -> str:
        """The profile as a table with clauses and marks."""
        return as_text(self)


def predicted_range(pair: Any, where: str) -> tuple[float, float]:
    """Return a predicted range as (lowest, highest), from a pair of temperatures. [K]

    Raises
    ------
    ScenarioError   When it is no pair, or its lowest is not below its highest.
    """
    if not isinstance(pair, Sequence | Quantity) or isinstance(pair, str) or len(pair) != 2:
        raise ScenarioError("give predicted as a pair: the lowest and the highest predicted temperature.", where, code="value.incomplete")
    low, high = (literal(v, TEMPERATURE, f"{where}, predicted") for v in pair)
    if low >= high:
        raise ScenarioError(
            f"predicted: the lowest ({low - 273.15:g} degC) is not below the highest ({high - 273.15:g} degC).",
            where,
            code="value.outside-range",
        )
    return low, high


SHOWN_STEPS = 16
"""Steps that a table shows before it stops."""


def as_text(profile: ThermalProfile) -> str:
    """Return a profile as a table: numbers with clause and mark, the first steps, remarks."""
    head = [profile.title, f"  {profile.kind}, {profile.standard} {profile.edition}, {profile.clause}".rstrip(" ,")]
    head += [f"  {profile.note}"] if profile.note else []
    numbers = profile.shown
    width = max(len(k) for k in numbers)
    wide = max(len(n.text) for n in numbers.values())
    rows = [
        f"  {k:<{width}}  {n.text:<{wide}}  {n.mark:<9}  {n.clause}{'; ' if n.clause and n.note else ''}{n.note}".rstrip()
        for k, n in numbers.items()
    ]
    lines = [*head, *rows]
    try:
        steps = profile.steps
        lines += ["  steps:", *(f"    {_step_text(s)}" for s in steps[:SHOWN_STEPS])]
        lines += [f"    ... {len(steps) - SHOWN_STEPS} more"] if len(steps) > SHOWN_STEPS else []
        lines += [f"  remark: {r}" for r in profile.check()]
    except ThermidError as error:
        lines += [f"  steps: {error.message}"]
    return "\n".join([*lines, f"  trust: {profile.trust}"])


def _step_text(step: ProfileStep) -> str:
    """Return a step as a line: ``1 to hot: to 60 degC at 3 K/min, until stable  on``."""
    parts = []
    if step.target is not None:
        how = f" in {step.over / 60.0:.4g} min" if step.over is not None else f" at {60.0 * (step.ramp or 0.0):.3g} K/min"
        parts.append(f"to {step.target - ICE_POINT:.4g} degC{how}")
    if step.pressure is not None:
        parts.append(f"to {step.pressure:.4g} Pa in {(step.over or 0.0) / 60.0:.4g} min")
    if step.humidity is not None:
        parts.append(
            f"to {100.0 * step.humidity:.3g} % humidity" + (f" in {step.over / 60.0:.4g} min" if step.target is None and step.over else "")
        )
    parts += ["until stable"] if step.wait else []
    parts += [f"stay {step.dwell / 3600.0:.4g} h"] if step.dwell else []
    cycle = f"{step.cycle:2d}" if step.cycle else "  "
    power = {None: "", True: "  on", False: "  off"}[step.power]
    return f"{cycle} {step.name}: {', '.join(parts) or 'at once'}{power}"


def as_toml(profile: ThermalProfile) -> str:
    """Return a profile as the text of a profile file, every number with its mark."""
    words = ("title", "kind", "standard", "edition", "clause", "level", "note")
    lines = ["[profile]", *(f"{w} = {toml_value(getattr(profile, w))}" for w in words if getattr(profile, w))]
    if profile.plan:
        lines.append(f"mark = {toml_value(profile.step_mark)}")
    if profile.predicted is not None:
        low, high = (f"{round(v - ICE_POINT, 9):.9g} [degC]" for v in profile.predicted)
        lines.append(f"predicted = [{toml_value(low)}, {toml_value(high)}]")
    if profile.plan:
        lines += ["steps = [", *(f"  {toml_value(row)}," for row in profile.plan), "]"]
    lines += ["", "[profile.numbers]"]
    for name, n in profile.numbers.items():
        fields: dict[str, Any] = {"value": n.value if n.slot == "1" else n.text, "mark": n.mark}
        fields |= {k: v for k, v in (("clause", n.clause), ("note", n.note)) if v}
        lines.append(f"{name} = {toml_value(fields)}")
    return "\n".join([*lines, ""])


def check_level_order(profile: ThermalProfile) -> None:
    """Refuse a profile whose cold level is not below its hot level.

    Raises
    ------
    ScenarioError   When it is not.
    """
    cold, hot = profile["cold"], profile["hot"]
    if float(cold.value) >= float(hot.value):
        raise ScenarioError(
            f"its cold level, {cold.text}, is not below its hot level, {hot.text}. Exchange them.",
            profile.title,
            code="value.outside-range",
        )


def _condensation_remarks(profile: ThermalProfile) -> Iterator[str]:
    """Yield a remark for the first and the last half cycle where it is cold, below ambient: water may then condense on the unit."""
    if profile.kind != "thermal cycling" or profile.plan:
        return
    if not [s for s in profile.steps if s.target is not None and s.target < profile.value("ambient")]:
        return
    turns = [s.name.split(",")[0].removeprefix("to ") for s in profile.steps if s.target is not None and s.name.startswith("to ")]
    for place, side in (("first", turns[0]), ("last", turns[-1])):
        if side != "hot":
            yield (
                f"the {place} half cycle is cold, so water may condense on the unit when the door opens. SMC-S-016, 6.3.8.3 requires "
                "a hot first and last half cycle, or dry gas"
            )


def _cycle_count_remarks(profile: ThermalProfile, beside: float) -> Iterator[str]:
    """Yield a remark where the required number of cycles is not that of the clause's own range, or the profile has fewer."""
    law = profile.equivalence
    if law is None:
        return
    low, high = profile.value("cold"), profile.value("hot")
    need = equivalent_cycles(Kelvin(low), Kelvin(high), law)
    cycles = profile.value("cycles")
    if need != law.cycles or cycles < need:
        missing = profile.missing_cycles(beside)
        yield (
            f"over {high - low:.4g} K the clause requires {need} cycles in all ({law.cycles:g} ("
            + f"{law.range:g}/{high - low:.4g})^{law.exponent:g} = "
            f"{law.exact(high - low):.2f}), in vacuum and in air together; the profile runs {cycles:g}"
            + (f" and other tests of the plan {beside:g}" if beside else "")
            + (f": {missing:g} are missing" if missing > 0 else "")
        )


LIBRARY: Final = Path(__file__).parent / "library"
PROJECT_NUMBERS: Final = {"ambient": "23 [degC]", "longest_wait": "72 [h]"}
"""Numbers that every run needs and no standard gives."""


@lru_cache(maxsize=1)
def _library() -> tuple[Mapping[str, Any], ...]:
    """Return the profiles of the standards, as read from the package's files."""
    return tuple(read_toml(file)[0] for file in sorted(LIBRARY.glob("*.toml")))


def profile_names() -> dict[str, dict[str, tuple[str, ...]]]:
    """Return standard -> profile -> its levels."""
    out: dict[str, dict[str, tuple[str, ...]]] = {}
    for data in _library():
        out[data["standard"]] = {name: tuple(p.get("levels", ())) for name, p in data["profiles"].items()}
    return out


def _standard(name: str) -> Mapping[str, Any]:
    """Return the data of a standard by its name or one of its aliases, in any case of letters.

    Raises
    ------
    ScenarioError   When there is none of that name.
    """
    names = {alias.casefold(): data for data in _library() for alias in (data["standard"], *data.get("aliases", ()))}
    if name.casefold() not in names:
        titles = [data["standard"] for data in _library()]
        raise ScenarioError(
            f"unknown standard '{name}'. Known: {', '.join(titles)}.{nearest(name.casefold(), names)} "
            "For another standard write a profile file, each number with its mark and clause.",
            "profile",
            code="name.unknown",
        )
    return names[name.casefold()]


def profile_of(standard: str, name: str = "", *, level: str = "", predicted: Any = None, **changes: Any) -> ThermalProfile:
    """Return a profile of a standard.

    Parameters
    ----------
    standard : str      The standard, ``"SMC-S-016"``.
    name : str          The profile, ``"unit thermal cycle"``; may be left out where the standard has one.
    level : str         Level or category; the first by default.
    predicted : pair    Lowest and highest predicted temperature, the model's uncertainty included. [K]
    **changes           Numbers in place of the standard's: ``cycles=2``, ``hot="55 [degC]"``.

    Raises
    ------
    ScenarioError   When there is no such standard, profile, level or number.
    """
    data = _standard(standard)
    profiles = data["profiles"]
    if not name and len(profiles) == 1:
        (name,) = profiles
    if name not in profiles:
        have = ", ".join(f"'{k}'" for k in profiles)
        if not name:
            raise ScenarioError(f"{data['standard']} has several profiles. Name one: {have}.", "profile", code="value.incomplete")
        raise ScenarioError(
            f"{data['standard']} has no profile '{name}'; it has {have}.{nearest(name, profiles)}", "profile", code="name.unknown"
        )
    spec = profiles[name]
    base = profiles[spec["like"]] if "like" in spec else {}
    levels = spec.get("levels", {})
    for word in (standard, name, level):
        if not isinstance(word, str):
            raise ScenarioError(f"a standard, a profile and a level are texts, not {word!r}.", "profile", code="value.wrong-kind")
    if level and level not in levels:
        have = f"it has {', '.join(levels)}" if levels else "it has none"
        raise ScenarioError(
            f"'{name}' of {data['standard']} has no level '{level}'; {have}.{nearest(level, levels)}", "profile", code="name.unknown"
        )
    level = level or next(iter(levels), "")
    title = ", ".join([f"{data['standard']} {name}", *([level] if level else [])])
    table = {**OWN_TABLE}
    for part, clause in ((base, base.get("clause", "")), (spec, spec.get("clause", ""))):
        table |= {k: number(k, v, data["mark"], clause, title) for k, v in part.get("numbers", {}).items()}
    table |= {
        k: number(k, v, data["mark"], spec["clause"] if "clause" in spec else base["clause"], title)
        for k, v in levels.get(level, {}).items()
    }
    plan = tuple(spec.get("steps", base.get("steps", ())))
    kind, clause, note = (
        spec.get("kind", base.get("kind")),
        spec.get("clause", base.get("clause", "")),
        spec.get("note", base.get("note", "")),
    )
    pair = None if predicted is None else predicted_range(predicted, title)
    profile = ThermalProfile(title, kind, data["standard"], data["edition"], clause, level, table, pair, plan, data["mark"], note)
    return profile.with_(**changes) if changes else profile


OWN_TABLE: Final[Mapping[str, Number]] = {k: number(k, v, "project", "", "profile") for k, v in PROJECT_NUMBERS.items()}


def load_profile(path: str | os.PathLike[str]) -> ThermalProfile:
    """Return the profile of a TOML file: its table ``[profile]`` names a profile of a standard and the numbers that differ from it.

    Raises
    ------
    ScenarioError   When a key is unknown, or the named profile does not exist.
    DeckError       When the file cannot be read.
    """
    file = Path(path)
    data, lines = read_toml(file)
    where, apart = Places(file.name, lines), "profile" in data
    if not apart and not {*data} <= {*grammar_of("thermid.qualify._profiles.schema.ProfileTable").model_fields}:
        refuse_another_kind("thermid.qualify._profiles.schema.ProfileFile", data, where)
    return profile_from(data.get("profile", data), lambda key: where(f"profile.{key}".rstrip(".") if apart else key), file.stem)


def profile_from(data: Mapping[str, Any], where: str | Callable[[str], str], stem: str = "profile") -> ThermalProfile:
    """Return the profile of a table ``[profile]``, as in a profile file or a plan.

    Parameters
    ----------
    data : table            The table.
    where : str or callable Name of the file, or key -> its place, for messages.
    stem : str              Title where the table has none.

    Raises
    ------
    ScenarioError   As in `load_profile`.
    """
    at = Places(f"{where}, profile") if isinstance(where, str) else where
    place = at("")
    if not data:
        raise ScenarioError("the table [profile] is missing.", place, code="value.incomplete")
    data = by_grammar("thermid.qualify._profiles.schema.ProfileTable", data, at).written
    numbers = {**data.get("numbers", {}), **{k: v for k, v in data.items() if k in SLOTS or k in WORDS}}
    if "like" in data:
        standard, name = _standard_and_name(data["like"], place)
        profile = profile_of(standard, name, level=data.get("level", ""))
        profile = replace(profile, title=data.get("title", profile.title), note=data.get("note", profile.note))
    else:
        kind = data.get("kind", "thermal cycling")
        refuse_unknown([kind], KINDS, place, "unknown kind '{}'. Use one of {known}.", ScenarioError)
        standard, edition, clause, level = (str(data.get(k, "")) for k in ("standard", "edition", "clause", "level"))
        profile = ThermalProfile(data.get("title", stem), kind, standard, edition, clause, level, {**OWN_TABLE}, note=data.get("note", ""))
    mark = data.get("mark", "project")
    new = {k: number(k, v, mark, "", place) for k, v in numbers.items()}
    if "stable" in new:
        StabilityRule.named(str(new["stable"].value))
    profile = replace(profile, numbers={**profile.numbers, **new})
    if "steps" in data:
        profile = replace(profile, plan=tuple(data["steps"]), step_mark=mark)
    return profile if "predicted" not in data else replace(profile, predicted=predicted_range(data["predicted"], place))


def _standard_and_name(like: Any, where: str) -> tuple[str, str]:
    """Return (standard, name of the profile) of a text such as ``SMC-S-016 unit thermal cycle``.

    Raises
    ------
    ScenarioError   When it does not begin with a standard.
    """
    text = str(like)
    names = sorted((a for d in _library() for a in (d["standard"], *d.get("aliases", ()))), key=len, reverse=True)
    for name in names:
        if text.casefold().startswith(name.casefold()):
            return name, text[len(name) :].strip(" ,:")
    titles = ", ".join(d["standard"] for d in _library())
    raise ScenarioError(f"like = {text!r} does not begin with a known standard. Known: {titles}.", where, code="name.unknown")
