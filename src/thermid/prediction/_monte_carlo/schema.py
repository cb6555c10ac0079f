"""The grammar of hold questions as pydantic models."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field, PlainValidator, WithJsonSchema
from pydantic_core import PydanticCustomError

from thermid.base.grammar import Amount, Finite, StrictTable, Whole, in_form, shown

NAMES_SCHEMA = WithJsonSchema({"type": ["string", "array"], "items": {"type": "string"}})

VALUES_SCHEMA = WithJsonSchema({"type": ["string", "array", "object"], "items": {"type": "string"}})


def _names(written: Any) -> Any:
    """Return what is written where it is a text or several; refuse anything else."""
    several = written if isinstance(written, list | tuple) else [written]
    if all(isinstance(one, str) for one in several):
        return written
    text = f"a text or a list of texts is needed, not {shown(written)}."
    raise PydanticCustomError("thermid", "{message}", {"message": text, "code": "file.wrong-kind"})


def _values(written: Any) -> Any:
    """Return values files as texts "part=file" or "file": as a command takes them, one text or several, or a table of parts."""
    return [f"{part}={file}" for part, file in written.items()] if isinstance(written, dict) else _names(written)


class SidesTable(StrictTable):
    """Highest and lowest temperature of a reference point."""

    highest: Amount = None
    lowest: Amount = None


class HoldFile(StrictTable):
    """How long a model keeps its limits in a scenario."""

    title: str = ""
    model: Annotated[str, Field(min_length=1)]
    unit: str = ""
    scenario: Annotated[Any, PlainValidator(_names), NAMES_SCHEMA, Field(min_length=1)]
    values: Annotated[Any, PlainValidator(_values), VALUES_SCHEMA] = []
    members: Annotated[Whole, Field(ge=1)] = 10_000
    seed: Annotated[Whole, Field(ge=0)] = 0
    every: str = ""
    confidence: Finite = 0.95
    limits: Annotated[dict[str, Annotated[Any, in_form(Amount, (SidesTable, ()))]], Field(min_length=1)]
    spread: dict[str, Any] = {}
