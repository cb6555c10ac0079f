"""Standard parts: decks that come with the package, for ``use = "std:TO-220"``."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from thermid.base.errors import DeckError, nearest

STANDARD: Final = "std:"
"""What the name of a standard part begins with where a deck uses it."""
_FOLDER: Final = Path(__file__).with_name("parts")


def standard_parts() -> dict[str, Path]:
    """Return name of every standard part -> its deck."""
    return {file.stem: file for file in sorted(_FOLDER.glob("*.toml"))}


def standard_part(used: str, where: str) -> Path:
    """Return the deck of a standard part, by its name as a deck uses it.

    Raises
    ------
    DeckError   When there is none of that name; the message has the nearest one.
    """
    name, parts = used.removeprefix(STANDARD), standard_parts()
    if name not in parts:
        raise DeckError(
            f"no standard part '{name}'.{nearest(name, parts)} 'thermid example --parts' lists all.", where, code="name.unknown"
        )
    return parts[name]
