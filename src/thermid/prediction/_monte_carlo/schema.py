"""The grammar of hold questions as pydantic models."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field

from thermid.base.grammar import Amount, Finite, Names, StrictTable, Whole, in_form


class SidesTable(StrictTable):
    """Highest and lowest temperature of a reference point."""

    highest: Amount = None
    lowest: Amount = None


class HoldFile(StrictTable):
    """How long a model keeps its limits in a scenario."""

    title: str = ""
    model: Annotated[str, Field(min_length=1)]
    unit: str = ""
    scenario: Annotated[Names, Field(min_length=1)]
    values: Names = []
    members: Annotated[Whole, Field(ge=1)] = 10_000
    seed: Annotated[Whole, Field(ge=0)] = 0
    every: str = ""
    confidence: Finite = 0.95
    limits: Annotated[dict[str, Annotated[Any, in_form(Amount, (SidesTable, ()))]], Field(min_length=1)]
    spread: dict[str, Any] = {}
