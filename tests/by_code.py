"""What is raised or warned, by its code: tests match causes, and the sentences are free."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

import pytest

from thermid.base.code_table import CODES
from thermid.base.errors import ThermidError, ThermidWarning, code_of


@contextmanager
def raises_code(code: str, kind: type[ThermidError] = ThermidError, match: str = "") -> Iterator[pytest.ExceptionInfo[ThermidError]]:
    """Expect an error of this code and kind; `match` is for what the text must hold beside it: a number, a name, a place."""
    assert code in CODES, f"thermid.base.code_table has no '{code}'"
    with pytest.raises(kind) as raised:
        yield raised
    assert raised.value.code == code, f"the code is '{raised.value.code}', of: {raised.value}"
    assert re.search(match, str(raised.value)), f"'{match}' is not in: {raised.value}"


@contextmanager
def warns_code(code: str, match: str = "") -> Iterator[None]:
    """Expect a warning of this code; `match` as of `raises_code`."""
    assert code in CODES, f"thermid.base.code_table has no '{code}'"
    with pytest.warns(ThermidWarning) as heard:
        yield
    said = [(w.message.code, str(w.message)) for w in heard if isinstance(w.message, ThermidWarning)]
    assert any(of == code and re.search(match, text) for of, text in said), f"no warning of '{code}' with '{match}', but {said}"


def of_code(texts: Iterable[str], code: str, match: str = "") -> list[str]:
    """Those of some remarks that have this code and hold `match`, as of `raises_code`."""
    assert code in CODES, f"thermid.base.code_table has no '{code}'"
    return [text for text in texts if code_of(text) == code and re.search(match, text)]
