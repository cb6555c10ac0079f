"""Codes: a short stable name for the cause of every error, warning and remark, so that scripts and tests need not read sentences.

A code is a subject, a dot and a cause in words with dashes, such as ``unit.unknown``. It names the cause, not the place: every reader of
a file refuses an unknown key by one code. The subject is what a user has in hand (a file, a unit, a record, the model), not the module, so
that a code outlives moves. The sentence may become better any time; the code stays. A code travels with its text:

- `ThermidError` and `ThermidWarning` take it as ``code=``. The message of an error is a `CodedText`, so whatever passes the message on,
  into another error, a finding or a remark, passes the code on; what words it anew says ``code=error.code``. A class of errors that is a
  cause by itself, such as `MissingExtraError`, has its code in the class. An error that lists several faults has the code of the first.
- Remarks and warnings of results stay texts in tuples; one with a code is a `CodedText`, which is a text in every other way.
- A finding of ``check`` has the field `code`.

On the command line ``--json`` shows it as the key `code` of an error or a finding, empty where a text has none yet, and lists those of
remarks under `codes`: code -> texts. ``-v`` prints it in brackets behind the text. `CODES` of `thermid.base.codes.table` is the one table;
docs/codes.md is made of it by ``scripts/write_codes.py``, and tests/architecture/test_codes.py refuses a code that is not in it, or that
nothing uses.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any


class CodedText(str):
    """A text with a code; a text in every other way. What is made of it by formatting or cutting has no code.

    Parameters
    ----------
    text : str   What is said.
    code : str   Its code; that of `text` where it has one and none is given.
    """

    code: str

    def __new__(cls, text: str, code: str = "") -> CodedText:
        """Return the text with its code."""
        coded = super().__new__(cls, text)
        coded.code = code or code_of(text)
        return coded


def code_of(text: str) -> str:
    """Return the code of a text; empty where it has none."""
    return text.code if isinstance(text, CodedText) else ""


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
