"""The grammars of limits files and of the file of verdicts as pydantic models."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import ConfigDict, RootModel

from thermid.base.errors import ScenarioError, ThermidError
from thermid.base.grammar import Amount, Finite, Flag, Grammar, StrictTable, reads
from thermid.base.units import kelvin


def _ends(pair: list[str | float]) -> tuple[float, float]:
    """Return the two ends of a limit; infinite where the text is empty. [K]"""
    if len(pair) != 2:
        raise ScenarioError(
            'a limit is a pair, ["-20 [degC]", "55 [degC]"]; an empty text for an end without limit.', code="value.wrong-kind"
        )
    low, high = pair
    return (kelvin(low) if low != "" else -np.inf, kelvin(high) if high != "" else np.inf)


EndsField = Annotated[Any, reads(list[Amount], _ends)]


class LimitTable(StrictTable):
    """Limits of temperature at one reference point."""

    node: str
    operating: EndsField
    non_operating: EndsField = None
    start_up: EndsField = None
    loads: list[str] = []
    mark: str = "project"
    source: str = ""


class CriteriaTable(Grammar):
    """Limits of the errors of a model, by metric; which metrics there are says `thermid.campaign._judge.verdict.known_criteria`."""

    model_config = ConfigDict(extra="allow")
    fault: ClassVar[type[ThermidError]] = ScenarioError
    __pydantic_extra__: dict[str, Amount]

    share: Finite = 1.0
    kinds: list[str] = ["steady"]
    mark: str = "project"
    source: str = ""
    sensors: dict[str, dict[str, Amount]] = {}


class LimitsFile(RootModel[dict[str, LimitTable]], Grammar):
    """Reference point -> its limits."""

    fault: ClassVar[type[ThermidError]] = ScenarioError


class LookTable(StrictTable):
    """One verdict on a record."""

    record: str
    sha256: str
    stage: str
    key: str
    passed: Flag
    date: str


class LooksFile(RootModel[list[LookTable]], Grammar):
    """Every verdict on a record that a results folder remembers."""

    lead: ClassVar[str] = (
        "the file is damaged. It lists the records that failed a verdict; without it they would be taken for independent ones. "
        "Restore it from the version control or a backup. Remove it only if no record of this folder ever failed."
    )
