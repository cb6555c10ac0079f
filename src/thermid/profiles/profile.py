"""Profiles of environmental tests: the numbers of the standards as data, each with its clause and the mark of how it is known."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

from thermid.errors import ScenarioError, nearest
from thermid.files import PROFILE, write_text
from thermid.measure.stability import rule_of
from thermid.model.laws.signal import literal
from thermid.physics.constants import ATMOSPHERE
from thermid.profiles.steps import Step, steps_of
from thermid.sourced.number import MARKS, SLOTS, WORDS, Number, number, weakest
from thermid.units import TEMPERATURE

__all__ = ["KINDS", "ThermalProfile", "pair_of"]

KINDS: Final = ("thermal cycling", "thermal vacuum", "thermal balance", "humidity")


@dataclass(frozen=True)
class ThermalProfile:
    """A profile of an environmental test.

    Parameters
    ----------
    title : str                     What it is.
    kind : str                      Thermal cycling, thermal vacuum, thermal balance or humidity.
    standard, edition, clause : str Where it comes from.
    level : str                     Qualification, acceptance, a category; empty where there is one.
    numbers : dict                  Name -> `Number`.
    predicted : pair or None        Lowest and highest predicted temperature, the model's uncertainty in them. [K]
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
    ground: float = field(default=ATMOSPHERE, repr=False)

    def __getitem__(self, name: str) -> Number:
        """Return a number; hot and cold follow from the predicted range where they are not given.

        Raises
        ------
        ScenarioError   When the profile has none of that name, or the range is not known.
        """
        if name in self.numbers:
            return self.numbers[name]
        if name in ("hot", "cold"):
            return self._level(name)
        if name == "middle":
            ends = [self["cold"], self["hot"]]
            return Number(sum(float(n.value) for n in ends) / 2.0, TEMPERATURE, weakest(ends), "", "mean of hot and cold")
        if name in SLOTS or name in WORDS:
            raise ScenarioError(f"it has no {name}. Give it: {name} = ...", self.title)
        raise ScenarioError(f"a profile has no '{name}'.{nearest(name, [*SLOTS, *WORDS])}", self.title)

    def _level(self, side: str) -> Number:
        """Return hot or cold from what was predicted, the margin, and the least range."""
        margin, least = self.numbers.get("margin"), self.numbers.get(f"{side}_least")
        if margin is None or (self.predicted is None and least is None):
            raise ScenarioError(
                f"its {side} level is not known: give {side}, or predicted=(lowest, highest), the temperatures that a model predicts with "
                "its uncertainty added.",
                self.title,
            )
        sign, pick = (1.0, max) if side == "hot" else (-1.0, min)
        used = [n for n in (margin, least) if n is not None]
        ends = [] if self.predicted is None else [self.predicted[side == "hot"] + sign * float(margin.value)]
        ends += [] if least is None else [float(least.value)]
        note = f"predicted {'+' if sign > 0 else '-'} {margin.text}" if self.predicted is not None else "nothing predicted"
        note += f", at least to {least.text}" if least is not None else ""
        return Number(pick(ends), TEMPERATURE, weakest(used), margin.clause, note)

    def has(self, name: str) -> bool:
        """Whether a number is given."""
        return name in self.numbers

    def value(self, name: str) -> float:
        """Return a number. [SI]"""
        found = self[name].value
        if isinstance(found, str):
            raise ScenarioError(f"its {name} is a word: {found}.", self.title)
        return found

    def word(self, name: str, otherwise: str) -> str:
        """Return a word, or another where it is not given."""
        return str(self.numbers[name].value) if name in self.numbers else otherwise

    @property
    def steps(self) -> tuple[Step, ...]:
        """What is done, one step after the other, every cycle written out."""
        return steps_of(self)

    @property
    def used(self) -> Mapping[str, Number]:
        """Numbers that the steps stand on, hot and cold worked out."""
        out = {k: n for k, n in self.numbers.items() if k not in ("margin", "hot_least", "cold_least")}
        wanted = (
            ("hot", "cold") if not self.plan else [w for w in ("hot", "cold") if any(row.get("to") in (w, "middle") for row in self.plan)]
        )
        return {k: self[k] for k in wanted} | out

    @property
    def mark(self) -> str:
        """The weakest mark of its numbers: read, project, secondary or memory."""
        marks = [n.mark for n in self.used.values()] + [row.get("mark", self.step_mark) for row in self.plan]
        rule = rule_of(self.word("stable", "")) if self.has("stable") else None
        return max(
            [*marks, *([] if rule is None or self.numbers["stable"].mark == "project" else [rule.mark])], key=MARKS.index, default="read"
        )

    @property
    def from_memory(self) -> tuple[str, ...]:
        """Names of the numbers that were written down from memory."""
        steps = ("steps",) if any(row.get("mark", self.step_mark) == "memory" for row in self.plan) else ()
        return tuple(k for k, n in self.used.items() if n.mark == "memory") + steps

    @property
    def decides(self) -> bool:
        """Whether a verdict may rest on it: no number of it comes from memory."""
        return not self.from_memory and self.mark != "memory"

    @property
    def trust(self) -> str:
        """Say in words how far its numbers can be relied on."""
        if self.decides:
            words = {
                "read": "every number was read in the standard",
                "project": "its numbers were read in the standard or set by the project",
            }
            return words.get(self.mark, "some numbers come from documents about the standard, not from the standard itself")
        which = ", ".join(self.from_memory) or "the rule of stability"
        return f"from memory, not checked against the standard: {which}. No verdict may rest on this profile before they are read there"

    def check(self, beside: float = 0.0) -> tuple[str, ...]:
        """Return what a careful reader would remark: order against condensation, cycles against the range, levels in the wrong order.

        Parameters
        ----------
        beside : float  Cycles over the same range that other tests of the unit run.
        """
        from thermid.profiles.remarks import remarks

        return remarks(self, beside)

    def with_(
        self, *, predicted: Any = None, steps: Sequence[Mapping[str, Any]] | None = None, title: str = "", **numbers: Any
    ) -> ThermalProfile:
        """Return the profile with numbers changed; what is given counts as the project's own.

        Raises
        ------
        ScenarioError   When there is no such number, or it has the wrong kind of value.
        """
        new = {k: number(k, v, "project", "", self.title) for k, v in numbers.items()}
        if "stable" in new:
            rule_of(str(new["stable"].value))
        changed = replace(self, numbers={**self.numbers, **new}, title=title or self.title)
        if predicted is not None:
            changed = replace(changed, predicted=pair_of(predicted, self.title))
        return changed if steps is None else replace(changed, plan=tuple(dict(s) for s in steps), step_mark="project")

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write it as a profile file that `load_profile` reads, every number with its mark."""
        from thermid.profiles.text import as_toml

        write_text(path, as_toml(self), PROFILE)

    def __str__(self) -> str:
        """The profile as a table, with clauses and marks."""
        from thermid.profiles.text import as_text

        return as_text(self)


def pair_of(given: Any, where: str) -> tuple[float, float]:
    """Return the predicted range (lowest, highest). [K]"""
    if not isinstance(given, Sequence) or isinstance(given, str) or len(given) != 2:
        raise ScenarioError("predicted is a pair: the lowest and the highest predicted temperature.", where)
    low, high = (literal(v, TEMPERATURE, f"{where}, predicted") if isinstance(v, str) else float(v) for v in given)
    if low >= high:
        raise ScenarioError(
            f"predicted: the lowest ({low - 273.15:g} degC) does not lie below the highest ({high - 273.15:g} degC).", where
        )
    return low, high
