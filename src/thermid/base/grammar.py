"""Grammars of files as pydantic models, and their faults: one line per fault, each with its place and the nearest name.

Every kind of file has one, in a module `schema` of the room that reads it. Loaded only when a file is read: pydantic takes a tenth of a
second. `scripts/write_schema.py` lists the kinds and writes a JSON Schema of each for editors.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import MISSING, fields
from functools import cache
from typing import Annotated, Any, ClassVar, Literal, Self, TypeAlias, TypeVar, Union, get_args, get_origin, get_type_hints

from pydantic import (
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    GetPydanticSchema,
    PlainValidator,
    Tag,
    ValidationError,
    WithJsonSchema,
    create_model,
)
from pydantic_core import PydanticCustomError, core_schema

from thermid.base.errors import CodedText, DeckError, ThermidError, cap, nearest, raising

T = TypeVar("T")
BRANCHES = ("str", "float", "ValueTable", "PowerLawTable", "Correlated")
"""What a value may be; pydantic reports a fault once for each."""


def reads(form: Any, make: Callable[[Any], Any]) -> GetPydanticSchema:
    """Return the mark of a field that is written in one form and holds what `make` makes of it; errors are listed with the other faults."""

    def validated(written: Any) -> Any:
        """Make the value, and hand an error of its own on through pydantic."""
        try:
            return make(written)
        except ThermidError as error:
            raise PydanticCustomError("thermid", "{message}", {"message": error.message, "error": error}) from None

    return GetPydanticSchema(lambda _, handler: core_schema.no_info_after_validator_function(validated, handler.generate_schema(form)))


def _amount(written: Any) -> Any:
    """Return what is written where it can be an amount; refuse anything else."""
    if isinstance(written, str | int | float) and not isinstance(written, bool):
        return written
    raise PydanticCustomError("thermid", "{message}", {"message": f"{AMOUNT} is needed, not {shown(written)}.", "code": "file.wrong-kind"})


AMOUNT = "a text with its unit, such as '2.5 [W]', or a number"


def shown(written: Any) -> str:
    """Return what is written in a file, for a message: tables and lists by their kind, long texts cut.

    >>> shown({"a": 1}), shown(True), shown("x" * 60)[-4:]
    ('a table', 'true', "...'")
    """
    if isinstance(written, Mapping):
        return "a table"
    if isinstance(written, list | tuple):
        return "a list"
    if isinstance(written, bool):
        return str(written).lower()
    text = repr(written)
    return text if len(text) <= 44 else f"{text[:40]}...{text[-1]}"


Amount: TypeAlias = Annotated[Any, PlainValidator(_amount), WithJsonSchema({"type": ["string", "number"]})]
"""A text with its unit or a number, as it is written; what reads it knows the unit."""
Real: TypeAlias = Annotated[float, Field(strict=True)]
"""A number; true and false are none."""
Finite: TypeAlias = Annotated[float, Field(strict=True, allow_inf_nan=False)]
"""A number that is neither infinite nor undefined; true and false are none."""
Whole: TypeAlias = Annotated[int, Field(strict=True)]
"""A whole number; true and false are none."""
Flag: TypeAlias = Annotated[bool, Field(strict=True)]
"""True or false; texts and numbers are neither."""


def in_form(otherwise: Any, *tables: tuple[Any, tuple[str, ...]]) -> GetPydanticSchema:
    """Return the mark of a field that is a table in one of several forms, or else something plain.

    Parameters
    ----------
    otherwise : type        What stands there where it is no table.
    tables : pairs          Each a table of a grammar and the keys by which it is known; the last one is taken where none fits.
    """

    def form(written: Any) -> str:
        """Return the name of the table whose keys a written value has."""
        if not isinstance(written, Mapping):
            return FORM.format("plain")
        fitting = (table.__name__ for table, keys in tables if {*keys} & {*written})
        return FORM.format(next(fitting, tables[-1][0].__name__))

    forms: list[Any] = [Annotated[otherwise, Tag(FORM.format("plain"))]]
    forms += [Annotated[table, Tag(FORM.format(table.__name__))] for table, _ in tables]
    whole: Any = Annotated[Union[tuple(forms)], Discriminator(form)]  # noqa: UP007  # made of a list
    return GetPydanticSchema(lambda _, handler: handler.generate_schema(whole))


FORM = "({})"
"""Step of a fault's place that is no key: the form that a table was taken for."""


class Grammar(BaseModel):
    """Base of every grammar: reads a file, and lists its faults."""

    model_config = ConfigDict(defer_build=True)  # what a file does not need is not built: a third of the time that a deck's grammar takes
    fault: ClassVar[type[ThermidError]] = DeckError
    """What a fault of the file is."""
    lead: ClassVar[str] = ""
    """What stands before the faults of a file that nobody writes by hand."""

    @property
    def written(self) -> dict[str, Any]:
        """What of it was written, its tables as dictionaries."""
        return self.model_dump(exclude_unset=True, by_alias=True)

    @classmethod
    def from_file(cls, data: Any, where: Callable[[str], str]) -> Self:
        """Return the content of a file, checked against its grammar.

        Parameters
        ----------
        data : dict, list   The file as read.
        where : callable    Key path -> file, line and key path, such as `files.Places`.

        Raises
        ------
        ThermidError   Of the class `fault` of the grammar, with every fault.
        """
        fault = endless(data)
        if fault:
            raise cls.fault(fault[1], where(fault[0]), code=fault[1].code)
        try:
            return cls.model_validate(data)
        except ValidationError as error:
            raise _listed(error, data, where, cls) from None


class StrictTable(Grammar):
    """Base of every table of a grammar: a key that it does not know is refused."""

    model_config = ConfigDict(extra="forbid")


def table_of(record: type, **forms: Any) -> GetPydanticSchema:
    """Return the mark of a field that is written as a table with the fields of a dataclass, and holds an instance of it.

    Parameters
    ----------
    record : type   The dataclass. A tuple is written as a list; numbers and flags are strict.
    forms : types   Field -> how it is written, where that is not as it is held. A field with a default may be left out.
    """
    hints = get_type_hints(record)
    listed = {name: list[get_args(hint)[0]] for name, hint in hints.items() if get_origin(hint) is tuple}  # type: ignore[misc]
    forms = {name: {float: Real, bool: Flag, int: Whole}.get(hint, hint) for name, hint in hints.items()} | listed | forms
    entries: dict[str, Any] = {f.name: (forms[f.name], ... if f.default is MISSING else f.default) for f in fields(record)}
    table: Any = create_model(record.__name__, __base__=StrictTable, __doc__=(record.__doc__ or "").partition("\n")[0], **entries)

    def held(written: Any) -> Any:
        """Return the record that a table stands for."""
        values = {name: getattr(written, name) for name in entries}
        return record(**values | {name: tuple(values[name]) for name in listed})

    return reads(table, held)


class TimesTable(StrictTable):
    """Values at times."""

    times: list[Amount]
    values: list[Amount]
    hold: Flag = False
    before: Literal["hold", ""] = ""
    after: Literal["hold", "repeat", ""] = ""
    period: Amount = None
    samples: Literal["instant", "average", ""] = ""


class SineTable(StrictTable):
    """A sine."""

    mean: Amount
    amplitude: Amount
    period: Amount
    phase: Finite = 0.0


class ColumnTable(StrictTable):
    """A column of a log."""

    file: str
    column: str
    unit: str = ""
    time: str | None = None
    hold: Flag = False
    before: Literal["hold", ""] = ""
    after: Literal["hold", "repeat", ""] = ""
    period: Amount = None
    samples: Literal["instant", "average", ""] = ""


def endless(data: Any, path: str = "", deepest: int | None = None) -> tuple[str, CodedText] | None:
    """Return the first place of what no reader may get, and why: tables and lists nested too deeply, whole numbers beyond any float."""
    deepest = int(cap("nesting")) if deepest is None else deepest
    if isinstance(data, int) and data.bit_length() > LONGEST_NUMBER:
        text = f"a number has too many digits (some {data.bit_length() * 0.30103:.0f}); no float holds it."
        return path, CodedText(text, "file.wrong-value")
    if not isinstance(data, dict | list | tuple):
        return None
    if deepest == 0:
        return path, CodedText(f"tables and lists are nested too deeply.{raising('nesting')}", "cap.exceeded")
    inside = data.items() if isinstance(data, dict) else enumerate(data)
    faults = (endless(value, f"{path}.{key}" if path else str(key), deepest - 1) for key, value in inside)
    return next((fault for fault in faults if fault), None)


LONGEST_NUMBER = 1023
"""Bits of a whole number that a float holds."""


def _listed(error: ValidationError, data: Mapping[str, Any], where: Callable[[str], str], grammar: type[Grammar]) -> ThermidError:
    """Return one error that lists every fault; its code is that of the first."""
    faults: dict[str, CodedText] = {}
    causes: list[ThermidError] = []
    for fault in error.errors():
        path, branch, value = _located(fault["loc"], data)
        if isinstance(cause := fault.get("ctx", {}).get("error"), ThermidError):
            faults.setdefault(".".join(path), cause.message)
            causes.append(cause)
            continue
        path = path[: path.index("between") + 1] if "between" in path[2:] else path
        if branch and not isinstance(value, Mapping):
            forms = "give a text with a unit, '2.5 [W]', a number, or a table with value, min, max, source, note, basis and spread."
            faults.setdefault(".".join(path), CodedText(forms, "file.wrong-kind"))
        elif not branch or branch == _meant(error, fault["loc"], value):
            faults.setdefault(".".join(path), CodedText(_text(fault, path, branch, grammar), _code(fault)))
    (first, message), *rest = ((where(key), text) for key, text in faults.items())
    code = message.code
    kind = type(causes[0]) if len(causes) == len(faults) else grammar.fault
    if grammar.lead:
        rest, first, message = [(first, message), *rest], where(""), CodedText(grammar.lead)
    more = [f"and {len(rest) - MOST_FAULTS} more faults."] if len(rest) > MOST_FAULTS else []
    return kind("\n  ".join([message, *(f"{place}: {text}" for place, text in rest[:MOST_FAULTS]), *more]), first, code=code)


def _located(location: tuple[int | str, ...], data: Any) -> tuple[list[str], str, Any]:
    """Return the key path of a fault, the branch of a value that it belongs to, and what stands there."""
    path, branch, value, here = [], "", None, data
    for step in location:
        if isinstance(here, Mapping) and step in here:
            here = here[step]
        elif isinstance(here, list | tuple) and isinstance(step, int) and step < len(here):
            here = here[step]
        elif not branch and step in BRANCHES:
            branch, value = str(step), here
            continue
        elif str(step).startswith("(") or step == "[key]":
            continue
        path.append(str(step))
    return path, branch, value


def _meant(error: ValidationError, location: tuple[int | str, ...], value: Any) -> str:
    """Return which form of a value its author meant, by its fields; a power law or a correlation only where they may stand."""
    may = {step for other in error.errors() if other["loc"][:3] == location[:3] for step in other["loc"]}
    if "value" in value or not may & {"PowerLawTable", "Correlated"}:
        return "ValueTable"
    return "Correlated" if {"length", "orientation", "correlation"} & {*value} else "PowerLawTable"


def _text(fault: Any, path: list[str], branch: str, grammar: type[Grammar]) -> str:
    """Return what is wrong and the nearest name."""
    if path[2:] == ["between"]:
        return 'needs two ends: between = ["a", "b"].'
    if fault["type"] == "extra_forbidden":
        tables = [place for step in _schema(grammar).get("properties", {}) for place in ([step], [step, "NAME"])]
        homes = [".".join(place) for place in tables if path[-1] in _fields(place, "", grammar)]  # NAME is one that its author gives
        near = nearest(path[-1], _fields(path[:-1], branch, grammar))
        return f"'{path[-1]}' is not a field here.{near or (f' Give it in [{homes[0]}].' if len(homes) == 1 else '')}"
    if fault["type"] == "missing":
        return "is missing."
    if fault["type"] == "string_pattern_mismatch":
        words = fault["ctx"]["pattern"].strip("^()$").split("|")
        return f"'{fault['input']}' is none of {', '.join(words)}.{nearest(str(fault['input']), words)}"
    if fault["type"] in WANTED:
        return f"{WANTED[fault['type']]} is needed, not {shown(fault['input'])}."
    if fault["type"] == "thermid":
        return str(fault["msg"])
    return f"{fault['msg'][0].lower()}{fault['msg'][1:]}."


def _code(fault: Any) -> str:
    """Return the code of a fault; what a field of ours refuses may say its own."""
    if fault["type"] in WANTED:
        return "file.wrong-kind"
    return str(fault.get("ctx", {}).get("code", CODE_OF_FAULT.get(fault["type"], "file.wrong-value")))


CODE_OF_FAULT = {"extra_forbidden": "file.unknown-key", "missing": "file.key-missing", "string_pattern_mismatch": "file.not-one-of"}
"""Fault of pydantic -> code of an error."""
MOST_FAULTS = 12
"""Faults that a message lists."""
WANTED = {
    "string_type": "a text",
    "bool_type": "true or false",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "float_type": "a number",
    "finite_number": "a finite number",
    "dict_type": "a table",
    "model_type": "a table",
    "model_attributes_type": "a table",
    "list_type": "a list",
    "tuple_type": "a list",
}
"""Fault of pydantic -> what should stand there."""


@cache
def _schema(grammar: type[Grammar]) -> dict[str, Any]:
    """Return the schema of a grammar, made once: faults ask for it again and again."""
    return grammar.model_json_schema()


def _fields(path: list[str], branch: str, grammar: type[Grammar]) -> list[str]:
    """Return the names that a table at a key path may hold."""
    schema = _schema(grammar)
    definitions = schema.get("$defs", {})
    if branch:
        return list(definitions[branch]["properties"])
    here: Any = schema
    for step in path:
        if step.isdigit():  # an entry of a list
            continue
        inner = here.get("properties", {}).get(step) or here.get("additionalProperties")
        inner = inner if isinstance(inner, dict) else {}  # true or false: whether there may be others
        options = [inner, inner.get("items", {}), *inner.get("anyOf", []), *inner.get("oneOf", [])]
        name = next((o["$ref"].rpartition("/")[2] for o in options if "$ref" in o), "")
        here = definitions.get(name, inner)
    return list(here.get("properties", {}))
