"""The grammar of profile files as pydantic models."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal, TypeAlias

from pydantic import Field, create_model

from thermid.base.errors import ScenarioError, ThermidError
from thermid.base.grammar import Amount, Flag, StrictTable, Whole, in_form
from thermid.qualify._profiles.numbers import SLOTS, WORDS


class NumberTable(StrictTable):
    """A number of a profile with its source: mark, clause, note."""

    value: Amount
    mark: str | None = None
    clause: str | None = None
    note: str = ""


class StepTable(StrictTable):
    """One step of a profile; a value may be the name of one of its numbers, such as ``hot``."""

    name: str = "step"
    cycle: Annotated[Whole, Field(ge=0)] = 0
    to: Amount = None
    over: Amount = None
    ramp: Amount = None
    pressure: Amount = None
    humidity: Amount = None
    wait: Flag = False
    dwell: Amount = None
    power: Literal["on", "off"] | None = None
    mark: str | None = None


NumberField: TypeAlias = Annotated[Any, in_form(Amount, (NumberTable, ()))]


class ProfileHead(StrictTable):
    """All keys of a profile except its numbers, which are added from `SLOTS` and `WORDS`."""

    fault: ClassVar[type[ThermidError]] = ScenarioError

    title: str | None = None
    like: str | None = None
    level: str = ""
    kind: str = "thermal cycling"
    standard: str = ""
    edition: str = ""
    clause: str = ""
    note: str | None = None
    mark: str = "project"
    predicted: list[Amount] | None = None
    numbers: dict[str, NumberField] = {}
    steps: list[StepTable] | None = None


_NUMBERS: Any = dict.fromkeys((*SLOTS, *WORDS), (NumberField, None))
ProfileTable: Any = create_model("ProfileTable", __base__=ProfileHead, __doc__="A profile.", **_NUMBERS)


class ProfileFile(StrictTable):
    """A profile file: the table ``[profile]``."""

    fault: ClassVar[type[ThermidError]] = ScenarioError

    profile: ProfileTable
