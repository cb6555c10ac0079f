"""What the report needs beyond thermid itself, and what is said where it is missing."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from thermid.errors import ThermidError

__all__ = ["MissingExtraError", "extra"]


class MissingExtraError(ThermidError):
    """An optional package is not installed; the message says which command installs it."""


@contextmanager
def extra() -> Iterator[None]:
    """Turn a failed import inside the block into words.

    Raises
    ------
    MissingExtraError   When matplotlib or jinja2 cannot be imported.
    """
    try:
        yield
    except ImportError as error:
        what = (error.name or "a package").partition(".")[0]
        raise MissingExtraError(f"a report needs {what}, which is not installed. Install it with: pip install thermid[report]") from error
