"""`Memo`: what a frozen value has worked out and keeps; no part of the value, so neither copied nor pickled with it."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any, TypeVar

Made = TypeVar("Made")


class Memo(dict[Hashable, Any]):
    """Results by key, made once; a copy of one, by pickle too, is empty.

    In a frozen dataclass it is a field with ``init=False, default_factory=Memo, compare=False, repr=False``. `dataclasses.replace` does not
    hand such a field on, so a value with another field starts with an empty memo and nothing has to be reset.
    """

    def value(self, key: Hashable, make: Callable[[], Made], most: int = 0) -> Made:
        """Return what is kept under a key, made now where nothing is; with `most` above zero the oldest gives way beyond so many."""
        if key not in self:
            result = make()
            while most and len(self) >= most:
                del self[next(iter(self))]
            self[key] = result
        out: Made = self[key]
        return out

    def __reduce__(self) -> tuple[type[Memo], tuple[()]]:
        """Return how to make it anew: empty."""
        return Memo, ()
