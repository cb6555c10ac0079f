"""Extension points: what optional rooms, and packages of others, add to the core; and the grammars of files.

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

from thermid.base.errors import MissingExtraError, ThermidError, quoted, refuse_unknown


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


def file_kinds() -> tuple[str, ...]:
    """Return the kinds of file that have a grammar."""
    return tuple(announced("thermid.files"))


def grammar_of(kind: str) -> Any:
    """Return the grammar of a kind of file, or of a table by its module and class; what reads grammars is loaded now and not before.

    A room names its own grammars by module and class, which needs no search of the installed packages.

    Raises
    ------
    ThermidError   When nothing announces that kind.
    """
    if "." not in kind:
        refuse_unknown([kind], file_kinds(), "", "there is no kind of file '{}'.{near} There are {known}.", ThermidError)
        kind = announced("thermid.files")[kind].replace(":", ".")
    module, _, name = kind.rpartition(".")
    return getattr(import_module(module), name)


def by_grammar(kind: str, content: Any, where: Callable[[str], str]) -> Any:
    """Return the content of a file as its grammar has it.

    Parameters
    ----------
    kind : str          As in `grammar_of`.
    content : dict      The file as read.
    where : callable    Key path -> its place, such as `files.Places`.

    Raises
    ------
    ThermidError    When it is a file of another kind, or does not follow the grammar: every fault with its place.
    """
    try:
        return grammar_of(kind).from_file(content, where)
    except ThermidError:
        refuse_another_kind(kind, content, where)
        raise


_WORDS: Final = {
    "plan": "a qualification plan",
    "hold": "a hold question",
    "sensors": "a sensor map",
    "values": "a file of values",
    "limits": "a file of limits",
    "looks": "a file of looks",
}
"""Kind -> what it is called, where that is not its name."""
_SIGNS: Final = (
    ("credibility record", {"synthetic", "values"}),
    ("campaign", {"records"}),
    ("campaign", {"stages"}),
    ("deck", {"nodes"}),
    ("deck", {"submodels"}),
    ("plan", {"tests", "limits"}),
    ("scenario", {"duration"}),
    ("scenario", {"boundaries"}),
)
"""Keys by which a kind is known that its grammar would refuse."""
_ADVICE: Final = {
    ("plan", "deck"): " Run `thermid plan` on it.",
    ("scenario", "deck"): " Give the deck, and this file with --scenario.",
    ("campaign", "deck"): " Give a deck named under 'model' of its stages.",
    ("deck", "campaign"): " A campaign has records and stages, and names the deck of each stage under 'model'. "
    "`thermid predict DECK --values FILE --scenario FILE` predicts with a deck alone.",
    ("deck", "scenario"): " A scenario has boundaries, loads, start and duration.",
    ("deck", "plan"): " A plan names its deck under [model], beside objectives, limits and tests.",
    ("deck", "hold"): " A hold question names its deck under 'model'.",
}
"""Kind of a file, kind that is needed -> what to do."""


def refuse_another_kind(kind: str, content: Any, where: Callable[[str], str]) -> None:
    """Refuse a file whose keys are those of another kind, in one sentence; one that misses a kind by a key or two is left to its grammar.

    Parameters
    ----------
    kind, content, where    As in `by_grammar`.

    Raises
    ------
    ThermidError    Says what it is and what it is not.
    """
    if not isinstance(content, Mapping) or _has_keys_of(grammar_of(kind), content):
        return
    kinds = announced("thermid.files")
    needed = next((name for name, at in kinds.items() if kind in (name, at.replace(":", "."))), "")
    of = _kind_of(content, needed, len({*content} & _fields(grammar_of(kind)))) if needed else ""
    if of not in ("", needed) and (of in content or not {*content} <= _fields(grammar_of(kind))):
        text = f"this is {_words(of)}, not {_words(needed)}.{_ADVICE.get((of, needed), '')}"
        raise grammar_of(kind).fault(text, where(""), code="file.another-kind") from None


def words_of_kind(content: Mapping[str, Any]) -> str:
    """Return what a file is called by its keys, such as 'a deck'; nothing where they are those of no kind."""
    return _words(_kind_of(content, "", 0)) if content else ""


def _words(kind: str) -> str:
    """Return what a kind of file is called, with its article; empty for none."""
    return kind and _WORDS.get(kind, f"a {kind}")


def _fields(grammar: Any) -> set[str]:
    """Return the keys that a grammar has; none where its keys are names."""
    fields = {f.alias or name for name, f in grammar.model_fields.items()}
    return fields if grammar.model_config.get("extra") == "forbid" else set()


def _has_keys_of(grammar: Any, content: Mapping[str, Any]) -> bool:
    """Whether a file has no key that a grammar does not know, and all that it needs."""
    needs = {f.alias or name for name, f in grammar.model_fields.items() if f.is_required()}
    return bool(fields := _fields(grammar)) and needs <= {*content} <= fields


def _kind_of(content: Mapping[str, Any], needed: str, common: int) -> str:
    """Return the kind of a file by its keys; `common` of them are those of the kind that is needed."""
    grammars: dict[str, Any] = {}
    for name in file_kinds():
        try:
            grammars[name] = grammar_of(name)
        except ModuleNotFoundError:
            continue  # of a room that is not installed
    for name, grammar in grammars.items():
        if _has_keys_of(grammar, content) or (name in content and {*content} <= _fields(grammar)):
            return name
    if 2 * common > len(content):
        return needed
    for name, keys in _SIGNS:
        if keys <= {*content}:
            return name
    for name, grammar in grammars.items():  # a file whose keys are names is known by what stands under them
        if grammar.model_config.get("extra") is None and content:
            try:
                grammar.from_file(content, str)
            except ThermidError:
                continue
            return name
    return ""


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
        requirements = requires("thermid") or []
    except PackageNotFoundError:
        return []
    module_of_package = {package: module for module, package in DISTRIBUTIONS.items()}
    names = [text for text in requirements if re.search(rf"extra == ['\"]{extra}['\"]", text)]
    packages = [re.split(r"[^\w.-]", name, maxsplit=1)[0] for name in names]
    return [module_of_package.get(name, name) for name in packages]
