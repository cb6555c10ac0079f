"""Grammars of TOML files as pydantic models, and their faults: one line per fault, each with its place and the nearest name.

Loaded only when a file is read: pydantic takes a tenth of a second.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Self

from pydantic import BaseModel, ConfigDict, GetPydanticSchema, ValidationError, WrapValidator
from pydantic_core import PydanticCustomError, core_schema

from thermid.errors import DeckError, ThermidError, nearest

BRANCHES = ("str", "float", "ValueTable", "PowerLawTable", "Correlated")
"""What a value may be; pydantic reports a fault once for each."""


def reads(form: Any, make: Callable[[Any], Any]) -> GetPydanticSchema:
    """Return the mark of a field that is written in one form and holds what `make` makes of it; errors are listed with the other faults."""

    def made(written: Any) -> Any:
        try:
            return make(written)
        except ThermidError as error:
            raise PydanticCustomError("thermid", "{message}", {"message": error.message, "error": error}) from None

    return GetPydanticSchema(lambda _, handler: core_schema.no_info_after_validator_function(made, handler.generate_schema(form)))


def or_instance(kind: type) -> WrapValidator:
    """Return the mark of a field in whose place a caller in Python may give an object."""
    return WrapValidator(lambda value, check: value if isinstance(value, kind) else check(value))


class StrictTable(BaseModel):
    """Base of every table of a grammar: a key that it does not know is refused."""

    model_config = ConfigDict(extra="forbid")

    @classmethod
    def from_file(cls, data: Mapping[str, Any], where: Callable[[str], str]) -> Self:
        """Return the content of a file, checked against its grammar.

        Parameters
        ----------
        data : dict         The file as read.
        where : callable    Key path -> file, line and key path, such as `toml_files.Places`.

        Raises
        ------
        DeckError   With every fault.
        """
        try:
            return cls.model_validate(dict(data))
        except ValidationError as error:
            raise _listed(error, data, where, cls) from None


def _listed(error: ValidationError, data: Mapping[str, Any], where: Callable[[str], str], grammar: type[BaseModel]) -> ThermidError:
    """Return one error that lists every fault."""
    faults: dict[str, str] = {}
    causes: list[ThermidError] = []
    for fault in error.errors():
        path, branch, given = _located(fault["loc"], data)
        if isinstance(cause := fault.get("ctx", {}).get("error"), ThermidError):
            faults.setdefault(".".join(path), cause.message)
            causes.append(cause)
            continue
        path = path[: path.index("between") + 1] if "between" in path[2:] else path
        if branch and not isinstance(given, Mapping):
            faults.setdefault(
                ".".join(path),
                "give a text with a unit, '2.5 [W]', a number, or a table with value, min, max, source, note and basis.",
            )
        elif not branch or branch == _meant(error, fault["loc"], given):
            faults.setdefault(".".join(path), _text(fault, path, branch, grammar))
    (first, message), *rest = ((where(key), text) for key, text in faults.items())
    kind = type(causes[0]) if len(causes) == len(faults) else DeckError
    return kind("\n  ".join([message, *(f"{place}: {text}" for place, text in rest)]), first)


def _located(location: tuple[int | str, ...], data: Any) -> tuple[list[str], str, Any]:
    """Return the key path of a fault, the branch of a value that it belongs to, and what stands there."""
    path, branch, given, here = [], "", None, data
    for step in location:
        if isinstance(here, Mapping) and step in here:
            here = here[step]
        elif isinstance(here, list | tuple) and isinstance(step, int) and step < len(here):
            here = here[step]
        elif not branch and step in BRANCHES:
            branch, given = str(step), here
            continue
        path.append(str(step))
    return path, branch, given


def _meant(error: ValidationError, location: tuple[int | str, ...], given: Any) -> str:
    """Return which form of a value its author meant, by its fields; a power law or a correlation only where they may stand."""
    may = {step for other in error.errors() if other["loc"][:3] == location[:3] for step in other["loc"]}
    if "value" in given or not may & {"PowerLawTable", "Correlated"}:
        return "ValueTable"
    return "Correlated" if {"length", "orientation", "correlation"} & {*given} else "PowerLawTable"


def _text(fault: Any, path: list[str], branch: str, grammar: type[BaseModel]) -> str:
    """Return what is wrong and the nearest name."""
    if path[2:] == ["between"]:
        return 'needs two ends: between = ["a", "b"].'
    if fault["type"] == "extra_forbidden":
        return f"'{path[-1]}' is not a field here.{nearest(path[-1], _fields(path[:-1], branch, grammar))}"
    if fault["type"] == "missing":
        return "is missing."
    if fault["type"] == "string_pattern_mismatch":
        words = fault["ctx"]["pattern"].strip("^()$").split("|")
        return f"'{fault['input']}' is not one of {', '.join(words)}.{nearest(str(fault['input']), words)}"
    return f"{fault['msg'][0].lower()}{fault['msg'][1:]}."


def _fields(path: list[str], branch: str, grammar: type[BaseModel]) -> list[str]:
    """Return the names that a table at a key path may hold."""
    schema = grammar.model_json_schema()
    definitions = schema.get("$defs", {})
    if branch:
        return list(definitions[branch]["properties"])
    here: Any = schema
    for step in path:
        if step.isdigit():  # an entry of a list
            continue
        inner = here.get("properties", {}).get(step) or here.get("additionalProperties") or {}
        options = [inner, inner.get("items", {}), *inner.get("anyOf", [])]
        name = next((o["$ref"].rpartition("/")[2] for o in options if "$ref" in o), "")
        here = definitions.get(name, inner)
    return list(here.get("properties", {}))
