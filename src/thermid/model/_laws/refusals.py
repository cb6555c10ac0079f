"""Rules of an element as a table: what may not be, and what is said of it."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

from thermid.base.errors import DeckError

Where = Callable[[str], str]
"""Key below an element, or none for the element itself -> its place in the deck."""
Rule: TypeAlias = tuple[object, str, str, str]
"""Whether it is broken, the message for that, the key that the message is about, and the code of the cause."""


def refuse_first(where: Where, *rules: Rule) -> None:
    """Refuse an element for the first of some rules that it breaks.

    Raises
    ------
    DeckError   At the rule's key, with its message and code.
    """
    for broken, message, key, code in rules:
        if broken:
            raise DeckError(message, where(key), code=code)
