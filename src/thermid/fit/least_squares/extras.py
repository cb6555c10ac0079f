"""Packages that only some searches need, and what is said where one is missing."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from thermid.errors import IdentificationError


def package(name: str, what: str, extra: str) -> Any:
    """Return an optional package.

    Raises
    ------
    IdentificationError   When it is not installed; the message says which command installs it.
    """
    try:
        return import_module(name)
    except ImportError as error:
        raise IdentificationError(f"{what} needs {name}, which is not installed. Install it with: pip install thermid[{extra}]") from error
