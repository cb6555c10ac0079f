"""Texts that the command line and the studio share: options as people type them, and codes of what an answer says."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from thermid.base.errors import CodedText, ScenarioError


def pairs(texts: Iterable[str], option: str) -> dict[str, str]:
    """Return ``NAME=VALUE`` texts as a dictionary; `option` is their place for messages.

    Raises
    ------
    ScenarioError   When one is of another form.
    """
    out = {}
    for text in texts:
        path, equals, value = text.partition("=")
        if not equals or not path.strip() or not value.strip():
            raise ScenarioError(f"'{text}' must be written as PATH=VALUE, such as air=24 [degC].", option, code="value.wrong-kind")
        out[path.strip()] = value.strip()
    return out


def with_unit(value: str, unit: str) -> str:
    """Return a value as text with `unit` behind it, unless it has a unit or is no number.

    >>> with_unit("5", "min"), with_unit("5 [h]", "min"), with_unit("end", "min")
    ('5 [min]', '5 [h]', 'end')
    """
    return value if "[" in value or not value.replace(".", "").replace("-", "").replace("e", "").isdigit() else f"{value} [{unit}]"


def add_codes(content: Mapping[str, Any]) -> dict[str, Any]:
    """Return a document with the key `codes`: code -> the texts in it that have this code; without the key where none has one."""
    codes: dict[str, list[str]] = {}
    for text in dict.fromkeys(_coded_texts(content)):
        codes.setdefault(text.code, []).append(str(text))
    return {**content, **({"codes": codes} if codes else {})}


def mark_codes(text: str, content: Mapping[str, Any]) -> str:
    """Return a text in which each of the coded texts of a document has its code in brackets behind it.

    >>> mark_codes("warning: it is late", {"warnings": [CodedText("it is late", "time.late")]})
    'warning: it is late [time.late]'
    """
    codes = {str(coded): coded.code for coded in _coded_texts(content)}
    anyone = "|".join(re.escape(text_of_code) for text_of_code in sorted(codes, key=len, reverse=True))
    return re.sub(anyone, lambda hit: f"{hit[0]} [{codes[hit[0]]}]", text) if codes else text


def _coded_texts(content: Any) -> Iterator[CodedText]:
    """Yield every text with a code in mappings and lists, but for those that stand beside a key `code` of their own."""
    if isinstance(content, CodedText) and content.code:
        yield content
    elif isinstance(content, Mapping):
        for value in content.values():
            if "code" not in content or not isinstance(value, str):
                yield from _coded_texts(value)
    elif isinstance(content, list | tuple):
        for value in content:
            yield from _coded_texts(value)
