"""Extension points: what optional rooms, and packages of others, add to the core.

Nothing here names a room. Rooms announce themselves by entry points, as packages of others may: `thermid.files` are kinds of file with
their grammars, `thermid.parts` what an optional room does, or one that most commands do not load. They are looked up once a process, where
a room needs what is not its own.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from importlib import import_module
from importlib.util import find_spec
from typing import Any, Final

from thermid.base.errors import MissingExtraError, ThermidError, quoted


@lru_cache(maxsize=4)
def announced(group: str) -> Mapping[str, str]:
    """Return the entry points of a group: name -> ``module:attribute``; the first of a name counts."""
    from importlib.metadata import entry_points  # 30 ms with the metadata of all packages

    out: dict[str, str] = {}
    for point in entry_points(group=group):
        out.setdefault(point.name, point.value)
    return out


def extension(point: str, purpose: str, where: str) -> Callable[..., Any]:
    """Return the function that an optional room announces.

    Parameters
    ----------
    point : str     Its name in the group `thermid.parts`.
    purpose : str   What it does, for the message.
    where : str     What asked for it, for the message.

    Raises
    ------
    ThermidError   When its room is not installed.
    """
    module, _, function = announced("thermid.parts").get(point, "").partition(":")
    part = ".".join(module.split(".")[:2])
    try:
        loaded = import_module(module) if module else None
    except ModuleNotFoundError as error:
        if error.name != part:
            raise
        loaded = None
    if loaded is None:
        needed = f"the package {part}" if part else "an optional part of thermid"
        text = f"{purpose} needs {needed}, which is not installed. Install thermid completely: pip install thermid"
        raise ThermidError(text, where, code="extra.not-installed")
    return getattr(loaded, function)  # type: ignore[no-any-return]


DISTRIBUTIONS: Final = {"serial": "pyserial", "nptdms": "npTDMS", "python_calamine": "python-calamine"}
"""Module -> the package that brings it, where the names differ."""


def missing(modules: Sequence[str], purpose: str) -> str:
    """Return that packages are not installed, and the command that installs them: the same for a clone, a wheel and any environment.

    Parameters
    ----------
    modules : sequence of str   Names of modules, as they are imported.
    purpose : str               What needs them.
    """
    parts = [name for name in modules if name.partition(".")[0] == "thermid"]
    if parts:
        return f"{purpose} needs the part {parts[0]}, which is not installed. Install the whole of thermid."
    packages = [DISTRIBUTIONS.get(name, name) for name in modules]
    verb = "are" if len(packages) > 1 else "is"
    python = f'"{sys.executable}"' if " " in sys.executable else sys.executable
    return f"{purpose} needs {quoted(packages)}, which {verb} not installed. Install with: {python} -m pip install {' '.join(packages)}"


def optional(module: str, purpose: str, where: str = "") -> Any:
    """Return a module of an optional package.

    Parameters
    ----------
    module : str    As it is imported.
    purpose : str   What needs it.
    where : str     Place for the message.

    Raises
    ------
    MissingExtraError   When it is not installed; the message says which command installs it.
    """
    try:
        return import_module(module)
    except ImportError as error:
        raise MissingExtraError(missing([module.partition(".")[0]], purpose), where) from error


def require(extra: str, purpose: str) -> None:
    """Refuse to begin where a package of an extra is not installed.

    Parameters
    ----------
    extra : str     Name of an extra of pyproject.toml.
    purpose : str   What needs it, such as ``--figure``.

    Raises
    ------
    MissingExtraError   With the command that installs what is missing.
    """
    modules = [name for name in modules_of(extra) if sys.modules.get(name, name) is None or find_spec(name) is None]
    if modules:
        raise MissingExtraError(missing(modules, purpose))


def modules_of(extra: str) -> list[str]:
    """Return the modules that an extra brings, by the metadata of the installed thermid; none where it has no metadata."""
    import re
    from importlib.metadata import PackageNotFoundError, requires

    try:
        requirements = requires("thermid") or []
    except PackageNotFoundError:
        return []
    module_of_package = {package: module for module, package in DISTRIBUTIONS.items()}
    names = [text for text in requirements if re.search(rf"extra == ['\"]{extra}['\"]", text)]
    packages = [re.split(r"[^\w.-]", name, maxsplit=1)[0] for name in names]
    return [module_of_package.get(name, name) for name in packages]
