"""What `channels`, `noise`, `accuracy` and `units` of `read_record` ask for, column by column."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

from thermid.base.errors import NameNotFoundError, RecordError, ThermidError, errors_at, refuse_first, refuse_unknown
from thermid.base.units import DIMENSIONLESS, TEMPERATURE, amount, require, unit
from thermid.measure._readers.headers import LETTERED
from thermid.measure._readers.power_of_columns import POWER_KEYS
from thermid.measure._record.channel import INTERPOLATIONS, ROLES, SAMPLES, Role, quantity_of
from thermid.measure._record.sensor import KEYS, SensorCertificate, SensorPart

_OF_SAMPLES: Final = ("noise", "accuracy", "resolution", "unit", "prompt", "samples", "interpolation", "power", "temperature")
_KEYS: Final = ("column", *ROLES, "gain", "full_scale", *_OF_SAMPLES, *KEYS)


@dataclass(frozen=True)
class Binding:
    """What is asked of one column; sizes and units still as written.

    Parameters
    ----------
    name, column : str      Name of the channel; column of the log.
    role, target : str      As of `Channel`.
    full_scale              Power of a load in per cent at 100 %.
    power                   Formula or table by which a power is computed from columns.
    temperature             Formula by which a temperature is, such as the mean of several thermometers.
    part, certificate       Of its sensor.
    """

    name: str
    column: str
    role: str = "auto"
    target: str | None = None
    gain: str | None = None
    full_scale: str | float | None = None
    noise: str | float | None = None
    accuracy: str | float | None = None
    resolution: str | float | None = None
    unit: str | None = None
    prompt: bool | None = None
    samples: str = ""
    interpolation: str = ""
    power: object = None
    temperature: object = None
    part: SensorPart | None = None
    certificate: SensorCertificate | None = None


def bindings(channels: Mapping[str, object], extra: Mapping[str, Mapping[str, str | float]], where: str) -> list[Binding]:
    """Return a binding for each channel of `read_record`.

    Parameters
    ----------
    channels : mapping   Target to column name, or column name to table.
    extra : mapping      'noise', 'accuracy' and 'unit', each by channel name.
    where : str          The file, for messages.

    Raises
    ------
    RecordError         When a table has an unknown key, two roles, or a value that was also given elsewhere.
    NameNotFoundError   When `extra` names a channel that is not read.
    """
    if not channels:
        raise RecordError("no channel is requested. Give channels={'node': 'column'}.", where, code="value.incomplete")
    out = {key: _one(key, written, f"{where}, channels.{key}") for key, written in channels.items()}
    for word, values in extra.items():
        for name, value in values.items():
            refuse_unknown(
                [name], out, where, f"{word} is given for '{{}}', which is not a channel. Channels: {{known}}.", NameNotFoundError
            )
            if getattr(out[name], word) is not None:
                raise RecordError(
                    f"its {word} is given twice. Give it either in the table or as an argument.",
                    f"{where}, channels.{name}",
                    code="value.incomplete",
                )
            field: dict[str, Any] = {word: value}
            out[name] = replace(out[name], **field)
    return list(out.values())


def _one(key: str, written: Any, where: str) -> Binding:
    """Return one binding, from a column name or a table.

    Raises
    ------
    RecordError   When a key is of a wrong kind, or not for its role.
    """
    if isinstance(written, str):
        return Binding(key, written, target=key)
    _check_kinds(written, where)
    roles = [word for word in ROLES if word in written]
    role = roles[0] if roles else "auto"
    between = written.get("interpolation", INTERPOLATIONS[0])
    refuse_unknown([written.get("samples", "instant")], SAMPLES, where, "samples = '{}' is neither 'instant' nor 'average'.")
    refuse_unknown([between], INTERPOLATIONS, where, "interpolation = '{}' is neither 'linear' nor 'previous'.")
    refuse_first(
        where,
        (len(roles) > 1, f"it has the roles {' and '.join(roles)}. Give a channel one role.", "value.incomplete"),
        (
            "gain" in written and role not in ("load", "command"),
            "a gain converts a command into a power, so it needs load = '...' or command = '...' too.",
            "value.incomplete",
        ),
        (
            "full_scale" in written and (role != "load" or "gain" in written),
            "full_scale is the power of a load at 100 %, so it needs load = '...' too, and no gain.",
            "value.incomplete",
        ),
        (
            "power" in written and (role != "load" or "full_scale" in written),
            "power is a formula of columns in watts, so it needs load = '...' too, and no full_scale.",
            "value.incomplete",
        ),
        ("temperature" in written and role in ("auto", "load", "command"), "temperature is for a boundary or node.", "value.incomplete"),
        (
            written.get("prompt") and role not in ("load", "command"),
            "prompt states that a power or command was logged at every change, so it applies to a load or command only.",
            "record.does-not-apply",
        ),
        *(
            (
                word in written and role in ("auto", "node"),
                f"{word} applies to inputs of the model only: a boundary, load, command or prescribed node.",
                "record.does-not-apply",
            )
            for word in ("samples", "interpolation")
        ),
        (
            written.get("samples") == "average" and "interpolation" in written,
            "averages are steps over their intervals. Give samples or interpolation.",
            "value.incomplete",
        ),
        error=RecordError,
    )
    rest = {word: written[word] for word in ("gain", "full_scale", *_OF_SAMPLES) if word in written}
    certificate = SensorCertificate.read(written["certificate"], f"{where}, certificate") if "certificate" in written else None
    part, target = SensorPart.read(written, where), written[role] if roles else None
    return Binding(key, written.get("column", key), role, target, **rest, part=part, certificate=certificate)


def _check_kinds(written: Any, where: str) -> None:
    """Refuse a binding that is no table, unknown keys of one, and values of a wrong kind.

    Raises
    ------
    RecordError   When a key is unknown, or a value is neither the text, number, or truth value that its key takes.
    """
    if not isinstance(written, Mapping):
        raise RecordError(
            f"{written!r} is neither the name of a column nor a table. Write 'column' or {{ column = 'column' }}.",
            where,
            code="value.wrong-kind",
        )
    refuse_unknown(written, _KEYS, where)
    for word in ("column", *ROLES, "gain", "unit"):
        if word in written and not (isinstance(written[word], str) and written[word].strip()):
            raise RecordError(f"{word} = {written[word]!r} must be text in quotes, and not empty.", where, code="value.wrong-kind")
    for word in ("full_scale", "noise", "accuracy", "resolution"):
        if word in written and (isinstance(written[word], bool) or not isinstance(written[word], str | int | float)):
            raise RecordError(
                f"{word} = {written[word]!r} is neither a value with its unit in quotes nor a number.", where, code="value.wrong-kind"
            )
    if not isinstance(written.get("prompt", False), bool):
        raise RecordError(f"prompt = {written['prompt']!r} is neither true nor false.", where, code="value.wrong-kind")


def unit_and_quantity(binding: Binding, header_unit: str | None, where: str) -> tuple[str, str]:
    """Return the unit of a column and what it measures.

    The unit is the one given, else the one in the header, else degC for temperatures, W for loads, % for commands and for loads with a gain
    or a full scale. A column in per cent is a load only with one of these.

    Raises
    ------
    UnitError     When the unit does not fit the role.
    RecordError   When the unit given and the one in the header differ.
    """
    stated = binding.unit or header_unit or ""
    in_watts = binding.full_scale is None and _is_unit(stated) and unit(stated).dimension == unit("W").dimension
    in_per_cent = not in_watts and (binding.gain is not None or binding.full_scale is not None)
    role = ROLES.get("command" if in_per_cent else binding.role)
    text = binding.unit or header_unit or (role.unit if role is not None else "degC")
    if binding.unit is None and header_unit is None:
        _refuse_by_name(binding, role, where)
    with errors_at(where):
        of = unit(text)
        if role is ROLES["load"] and of.dimension == DIMENSIONLESS:
            raise RecordError(_PER_CENT.format(f"it is in {text}"), code="record.unit-unclear")
        if binding.unit and header_unit and _is_unit(header_unit) and unit(header_unit) != replace(of, text=unit(header_unit).text):
            raise RecordError(
                f"its header has the unit [{header_unit}], but its unit is given as '{binding.unit}'. Correct one of them.",
                code="record.unit-contradicts",
            )
        if role is not None and role.slot and role is not ROLES["command"]:
            require(of.dimension, role.slot, text, of.absolute and role.slot == TEMPERATURE)
        elif binding.full_scale is not None and of.dimension != DIMENSIONLESS:
            raise RecordError(
                f"full_scale is for a column in per cent, and it is in {text}. Leave full_scale out.", code="record.unit-contradicts"
            )
    return text, (role.quantity if role is not None else "") or quantity_of(of)


_PER_CENT: Final = "{}, and a load needs watts. Give full_scale = '... [W]', its power at 100 %, or gain, the path of a parameter."
_DUTY: Final = re.compile(r"pct|percent|per_cent|duty|pwm|%", re.IGNORECASE)


def _refuse_by_name(binding: Binding, role: Role | None, where: str) -> None:
    """Refuse a column without a unit whose name states another unit than the usual one of its role: per cent, F or K.

    Raises
    ------
    RecordError   With the units that it may have.
    """
    if role is ROLES["load"] and _DUTY.search(binding.column):
        raise RecordError(_PER_CENT.format("by its name it is in per cent"), where, code="record.unit-unclear")
    ending = LETTERED.match(binding.column)
    warm = role is None or role.quantity == "temperature"
    if ending and ending["letter"] in "FK" and re.search(r"[a-z0-9]\Z", ending["stem"]) and warm:
        scale = "degF" if ending["letter"] == "F" else "K"
        raise RecordError(
            f"its name ends in '{binding.column[-2:]}', so its unit is unclear: without one it is read in degC. Give "
            f"units={{'{binding.name}': '{scale}'}} or "
            "'degC'; in a campaign, unit of the channel.",
            where,
            code="record.unit-unclear",
        )


def full_scale(binding: Binding, where: str) -> float | None:
    """Return the power of a load at 100 %; None where it is not given. [W]

    Raises
    ------
    RecordError   When it is not a power above zero.
    """
    if binding.full_scale is None:
        return None
    watts = amount(binding.full_scale, "W", f"{where}, full_scale")
    if not watts > 0.0:
        raise RecordError(f"its full_scale is {watts:g} W. Give a power above zero.", where, code="value.outside-range")
    return watts


def _is_unit(text: str) -> bool:
    """Whether a text is a unit."""
    try:
        unit(text)
    except ThermidError:
        return False
    return True


def channel_schema() -> dict[str, Any]:
    """Return the JSON Schema of a channel's table, for editors; values are texts with units, or numbers in SI."""
    text, amount_ = {"type": "string"}, {"type": ["string", "number"]}

    def table(keys: tuple[str, ...], required: tuple[str, ...]) -> dict[str, Any]:
        """Return the JSON Schema of a table of amounts."""
        return {"type": "object", "properties": dict.fromkeys(keys, amount_), "required": list(required), "additionalProperties": False}

    units = {"units": {"type": "object"}}
    table_of_power = {"type": "object", "properties": {**dict.fromkeys(POWER_KEYS, text), **units}}
    table_of_temperature = {
        "type": "object",
        "properties": {"formula": text, **units},
        "required": ["formula"],
        "additionalProperties": False,
    }
    nested = {
        "prompt": {"type": "boolean"},
        "power": {"anyOf": [text, table_of_power]},
        "temperature": {"anyOf": [text, table_of_temperature]},
        "samples": {"enum": list(SAMPLES)},
        "interpolation": {"enum": list(INTERPOLATIONS)},
        "lead": table(("conductance", "to"), ("conductance", "to")),
        "certificate": table(("offset", "uncertainty", "at", "date"), ("offset", "uncertainty")),
        "range": {"type": "array", "items": amount_, "minItems": 2, "maxItems": 2},
    }
    plain = ("column", *ROLES, "gain", "unit")
    properties = {key: nested.get(key) or (text if key in plain else amount_) for key in _KEYS}
    return {"type": "object", "properties": properties, "additionalProperties": False}
