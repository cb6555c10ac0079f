"""pycanha-core: named, because up to 0.3 (the last with wheels) it has the network and the geometry, but no transient solver."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.metadata import version as version_of

from contest import Attempt
from plain import Task

from . import installed

NAME = "pycanha-core"


def missing() -> str:
    """Return why it cannot run."""
    if why := installed("pycanha_core"):
        return why
    return f"{version_of('pycanha-core')} has no transient solver, and later releases are sources that need further C++ packages"


def version() -> str:
    """Return its version."""
    return version_of("pycanha-core")


def attempts(task: Task) -> Iterator[Attempt]:
    """Yield nothing."""
    yield from ()
