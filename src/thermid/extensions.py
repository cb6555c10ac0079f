"""Extension points: what optional parts add to the core, which knows the points and never the parts.

This table and the public names of `thermid/__init__.py` are all that names a part; a part is loaded when its point is first used.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any, Final

from thermid.errors import ThermidError

POINTS: Final = {
    "surroundings of a scenario file": ("thermid.site", "surroundings", "surrounded"),
    "humidity along a profile": ("thermid.site", "moisture", "humid"),
    "the log of a bench": ("thermid.acquire", "benchlog", "bench_cells"),
}
"""Point -> part, module, function."""


def extension(point: str, where: str) -> Callable[..., Any]:
    """Return the function behind a point.

    Raises
    ------
    ThermidError   When its part is not installed; `where` says what asked for it.
    """
    part, module, function = POINTS[point]
    try:
        loaded = import_module(f"{part}.{module}")
    except ModuleNotFoundError as error:
        if error.name != part:
            raise
        raise ThermidError(
            f"{point} needs the package {part}, which is not installed. Install thermid completely: pip install thermid", where
        ) from None
    return getattr(loaded, function)  # type: ignore[no-any-return]
