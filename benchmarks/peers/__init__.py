"""Other programs on the same work. Each module has `NAME`, `missing()`, `version()` and `attempts(task)`."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from types import ModuleType

MODULES = ("scipy", "casadi", "diffrax", "pathsim", "octave", "pycanha")


def present(chosen: tuple[str, ...] = MODULES) -> tuple[list[ModuleType], dict[str, str]]:
    """Return the peers that can run, and why each of the others cannot."""
    runs: list[ModuleType] = []
    absent: dict[str, str] = {}
    for module in (import_module(f"peers.{name}_peer") for name in chosen):
        if why := module.missing():
            absent[module.NAME] = why
        else:
            runs.append(module)
    return runs, absent


def installed(package: str) -> str:
    """Return why a Python package cannot be used, or nothing."""
    from importlib.util import find_spec

    return "" if find_spec(package) else "not installed"


def forced(*limits: float) -> Iterator[tuple[float, str]]:
    """Yield step limits [s] and how they are written."""
    for limit in limits:
        yield limit, f"step at most {limit:g} s"
