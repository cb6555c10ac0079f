"""Extension points: what optional parts add to the core, which knows the points and never the parts; and the grammars of files.

This table and the public names of `thermid/__init__.py` are all that names a part; a part is loaded when its point is first used.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from importlib.util import find_spec
from typing import Any, Final

from thermid.errors import MissingExtraError, ThermidError, quoted

POINTS: Final = {
    "surroundings of a scenario file": ("thermid.site", "surroundings", "surrounded"),
    "humidity along a profile": ("thermid.site", "moisture", "humid"),
    "an FMU as a model": ("thermid.interop", "fmu.as_model", "fmu_model"),
    "the log of a bench": ("thermid.acquire", "benchlog", "bench_cells"),
    "a serial port that is watched": ("thermid.acquire", "capture", "listening"),
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


GRAMMARS: Final[Mapping[str, str]] = {
    "deck": "thermid.model.deck.schema.Deck",
    "scenario": "thermid.simulation.scenarios.schema.ScenarioFile",
    "campaign": "thermid.campaign.schema.CampaignFile",
    "study": "thermid.campaign.schema.StudyFile",
    "plan": "thermid.qualify.plan_schema.PlanFile",
    "lock": "thermid.qualify.plan_schema.LockFile",
    "limits": "thermid.judge.schema.LimitsFile",
    "hold": "thermid.monte_carlo.schema.HoldFile",
    "profile": "thermid.profiles.schema.ProfileFile",
    "values": "thermid.knowledge.schema.ValuesFile",
    "looks": "thermid.judge.schema.LooksFile",
    "delivery": "thermid.qualify.plan_schema.ChecksFile",
    "sensors": "thermid.acquire.schema.SensorMapFile",
    "programme": "thermid.acquire.schema.ProgrammeFile",
}
"""Kind of file -> its grammar, which is what reads it, in the room that reads it."""


def grammar_of(kind: str) -> Any:
    """Return the grammar of a kind of file, or of a table by its module and class; what reads grammars is loaded now and not before."""
    module, _, name = GRAMMARS.get(kind, kind).rpartition(".")
    return getattr(import_module(module), name)


def by_grammar(kind: str, content: Any, where: Callable[[str], str]) -> Any:
    """Return the content of a file as its grammar has it.

    Parameters
    ----------
    kind : str          As in `grammar_of`.
    content : dict      The file as read.
    where : callable    Key path -> its place, such as `toml_files.Places`.

    Raises
    ------
    ThermidError    When it does not follow the grammar: every fault with its place.
    """
    return grammar_of(kind).from_file(content, where)


def json_schema(kind: str) -> dict[str, Any]:
    """Return the JSON Schema of a kind of file, for editors."""
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": f"thermid {kind}"}
    return head | {k: v for k, v in grammar_of(kind).model_json_schema(by_alias=True).items() if k != "title"}


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
        asked = requires("thermid") or []
    except PackageNotFoundError:
        return []
    known = {package: module for module, package in DISTRIBUTIONS.items()}
    names = [text for text in asked if re.search(rf"extra == ['\"]{extra}['\"]", text)]
    packages = [re.split(r"[^\w.-]", name, maxsplit=1)[0] for name in names]
    return [known.get(name, name) for name in packages]
