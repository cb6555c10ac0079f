"""One tree of exceptions. Each says what is wrong, where, why it matters if that is not obvious, and what to do.

`where` is a file with a key path and, where it is known, a line: ``m_PrE.toml:12, conductors.Rcd1``. `exit_code` is what the
command line returns for it.

A code is a short stable name for the cause of an error, warning or remark, so that scripts and tests need not read sentences: a subject,
a dot and a cause in words with dashes, such as ``unit.unknown``. It names the cause, not the place: every reader of a file refuses an
unknown key by one code. The subject is what a user has in hand (a file, a unit, a record, the model), not the module, so that a code
outlives moves. The sentence may become better any time; the code stays. A code travels with its text:

- `ThermidError` and `ThermidWarning` take it as ``code=``. The message of an error is a `CodedText`, so whatever passes the message on,
  into another error, a finding or a remark, passes the code on; what words it anew says ``code=error.code``. A class of errors that is a
  cause by itself, such as `MissingExtraError`, has its code in the class. An error that lists several faults has the code of the first.
- Remarks and warnings of results stay texts in tuples; one with a code is a `CodedText`, which is a text in every other way.
- A finding of ``check`` has the field `code`.

On the command line ``--json`` shows it as the key `code` of an error or a finding, empty where a text has none yet, and lists those of
remarks under `codes`: code -> texts. ``-v`` prints it in brackets behind the text. `CODES` of `thermid.base.code_table` is the one table;
docs/codes.md is made of it by ``scripts/write_codes.py``, and tests/architecture/test_codes.py refuses a code that is not in it, or that
nothing uses.

`CAPS` is how much a file, a text or a request may ask for before it is refused, and `cap` says what holds now: the environment variable
`THERMID_CAPS` raises or lowers any of them. Decision 216 says why there is one table.

What an installation lacks is an error too: `optional` and `require` ask for packages of others, and `extension` for what a room adds that
may be left out. Nothing here names a room. Rooms announce themselves by entry points, as packages of others may: `thermid.files` are kinds
of file with their grammars, `thermid.parts` what an optional room does, or one that most commands do not load. They are looked up once a
process, where a room needs what is not its own.
"""

from __future__ import annotations

import math
import os
import re
import sys
import time
import warnings
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from functools import lru_cache
from importlib import import_module
from importlib.util import find_spec
from typing import Any, Final, Self, TypeVar

K = TypeVar("K")
V = TypeVar("V")
_PLACES = re.compile(r"(\{(?:known|near)?\})")


class ThermidError(Exception):
    """Base of every error that thermid raises on purpose.

    Parameters
    ----------
    message : str   What is wrong and what to do.
    where : str     File, key path and line, or the model's title; empty when there is none.
    code : str      Code of the cause; that of the message where it is a `CodedText` and none is given, or else that of the class.
    """

    exit_code = 2
    code = ""

    def __init__(self, message: str, where: str = "", *, code: str = "") -> None:
        super().__init__(message)
        self.code = code or code_of(message) or self.code
        self.message = CodedText(message, self.code)
        self.where = where

    def __str__(self) -> str:
        """`where: message`, or the message alone."""
        return CodedText(f"{self.where}: {self.message}" if self.where else self.message, self.code)

    def reworded(self, message: str) -> Self:
        """Return the same error, of the same code and place, in other words."""
        return type(self)(message, self.where, code=self.code)

    def located(self, where: str) -> Self:
        """Return the same error with a place, unless it already has one."""
        return self if self.where else type(self)(self.message, where)

    def within(self, place: str, joint: str = ", ") -> Self:
        """Return the same error with a place before the one that it names, unless both are in one file."""
        file = place.partition(":")[0].partition(",")[0]
        if self.where == file or self.where.startswith((f"{file}:", f"{file},")):
            return self
        return type(self)(self.message, f"{place}{joint}{self.where}" if self.where else place)


class UnitError(ThermidError, ValueError):
    """A unit is unknown, has the wrong dimension, or is used as a difference when it is a temperature."""


class ExpressionError(ThermidError, ValueError):
    """An expression cannot be read, needs itself, or is not arithmetic over names."""


class NameNotFoundError(ThermidError, KeyError):
    """A node, parameter, port or channel of that name does not exist; a `KeyError` too, so that `get` of a mapping has its default."""

    code = "name.unknown"


class DeckError(ThermidError, ValueError):
    """A deck, campaign or values file does not describe a model."""


class OutputError(ThermidError, OSError):
    """A file may not be written: it is an input of the command, or thermid did not write what is there."""


class ScenarioError(ThermidError, ValueError):
    """A scenario does not fit the model, or asks for what the model cannot say."""


class RecordError(ThermidError, ValueError):
    """A log cannot be read as a record, or does not hold what is asked of it."""


class MissingDataError(RecordError):
    """A log is not where the campaign says; the message says how to get it."""

    code = "record.log-missing"


class MissingExtraError(ThermidError, ImportError):
    """An optional package is not installed; the message says which command installs it."""

    code = "extra.not-installed"


class SolverError(ThermidError, RuntimeError):
    """The integration or the steady solution ended before it was done."""

    exit_code = 3


class IdentificationError(ThermidError, ValueError):
    """The data cannot tell what was asked of them."""

    exit_code = 4


class StoppedError(ThermidError, RuntimeError):
    """The interrupt key ended a fit that further fits rest on; the message has its best values so far."""

    exit_code = 130
    code = "fit.stopped"


class ThermidWarning(UserWarning):
    """Something that a reader of the result must know.

    Parameters
    ----------
    text : str   What must be known.
    code : str   Code of the cause, as of a `ThermidError`.
    """

    def __init__(self, text: str, *, code: str = "") -> None:
        super().__init__(text)
        self.code = code or code_of(text)


def spoken(seconds: float) -> str:
    """Return a duration in words, with the digits that a person wants.

    >>> spoken(8.2), spoken(75), spoken(4000)
    ('8 s', '1 min 15 s', '1 h 7 min')
    """
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    minutes, rest = divmod(whole, 60)
    if minutes < 60:
        return f"{minutes} min {rest} s" if minutes < 10 and rest else f"{round(whole / 60)} min"
    hours, minutes = divmod(round(whole / 60), 60)
    return f"{hours} h {minutes} min"


LONG_WAIT: Final = 30.0
"""What is left of long work, from which it is told. [s]"""


def foretell(words: str, seconds: float) -> None:
    """Warn of what follows where it takes longer than `LONG_WAIT`."""
    if seconds > LONG_WAIT:
        warnings.warn(ThermidWarning(words, code="fit.takes-long"), stacklevel=3)


def time_left(work: str) -> Callable[[str, float], None]:
    """Return what takes the share of a work that is finished, where nothing else takes it: it tells once what is left, see `foretell`."""
    begun = time.perf_counter()

    def tell(words: str, share: float) -> None:
        """Take what follows, and the share of all that is finished."""
        nonlocal begun
        remaining = (time.perf_counter() - begun) * (1.0 - share) / share if share > 0.0 else 0.0
        if remaining > LONG_WAIT:
            begun = math.inf
            foretell(f"{work} goes on with {words}: about {spoken(remaining)} left.", remaining)

    return tell


def with_time_left(items: Iterable[V], count: int, work: str, words: str) -> Iterator[V]:
    """Yield `count` items, each finished when the next one is asked for, and tell once what is left."""
    tell = time_left(work)
    for k, item in enumerate(items, 1):
        yield item
        tell(words, k / count)


CAPS: Final[Mapping[str, tuple[float, str]]] = {
    "text": (4e6, "bytes of a deck, scenario, campaign or another TOML or JSON file that people write"),
    "deck": (50e6, "bytes of one file of a deck of SINDA or ESATAN"),
    "script": (1e6, "characters of a script with parameters"),
    "unpacked": (200e6, "bytes to which a packed log, an HDF5, netCDF or MATLAB file, or a workbook may unpack"),
    "samples": (5e6, "samples of one periodic signal"),
    "outputs": (10e6, "times at which one run stores temperatures"),
    "stored": (250e6, "temperatures that one run stores: times by nodes"),
    "members": (10e6, "members of a campaign of runs"),
    "cycles": (10e3, "cycles of a test profile"),
    "cells": (20e3, "cells of a block that becomes a model"),
    "instances": (10e3, "instances in one array of submodels"),
    "exponent": (20.0, "exponent in a unit; at most 99"),
    "unit": (80.0, "characters of a unit"),
    "expression": (2000.0, "characters of an expression"),
    "power": (64.0, "exponent in arithmetic with numbers"),
    "key": (64.0, "parts of a dotted key of TOML"),
    "nesting": (64.0, "tables and lists of a file one inside the other"),
    "decks": (20.0, "decks that use each other, one inside the other"),
    "includes": (16.0, "files of a SINDA or ESATAN deck that include each other, one inside the other"),
    "repeats": (100e3, "elements that one statement or loop of a SINDA or ESATAN deck makes"),
    "body": (1e6, "bytes of a request to the studio"),
    "headers": (32e3, "bytes of the headers of a request to the studio"),
    "clients": (32.0, "requests that the studio answers at once"),
    "memory": (4e9, "bytes of memory of the process that runs an FMU (Linux)"),
    "call": (60.0, "seconds that one call into an FMU may take"),
}
"""Name -> how much, and of what. They lie far above what anyone has meant so far, and below what harms a machine."""
CAPS_VARIABLE: Final = "THERMID_CAPS"


def cap(name: str) -> float:
    """Return a cap as it holds now: that of `THERMID_CAPS`, such as ``unpacked=1e9 samples=2e7``, or else that of `CAPS`.

    Raises
    ------
    ThermidError   When the variable names no cap, or gives no number above zero.
    """
    setting = os.environ.get(CAPS_VARIABLE)
    return _caps(setting)[name] if setting else CAPS[name][0]


@lru_cache(maxsize=8)
def _caps(setting: str) -> dict[str, float]:
    """Return cap -> its number, each as the variable's text `setting` gives it ("name=number" apart by commas or spaces) or by default.

    Raises
    ------
    ThermidError   When there is no such cap, or its number is not above zero.
    """
    out = {name: most for name, (most, _) in CAPS.items()}
    for word in setting.replace(",", " ").split():
        name, _, text = word.partition("=")
        refuse_unknown([name], CAPS, CAPS_VARIABLE, "there is no cap '{}'; there are {known}.", ThermidError)
        try:
            out[name] = float(text)
        except ValueError:
            out[name] = math.nan
        if not out[name] > 0.0:
            advice = f"Write for example {name}={CAPS[name][0]:g}."
            raise ThermidError(f"'{word}' gives no number above zero. {advice}", CAPS_VARIABLE, code="cap.no-number")
    return out


def raising(name: str) -> str:
    """Return the end of a refusal: which cap it was, and how it is raised.

    >>> raising("cycles")
    " The cap 'cycles' is 10000; the environment variable THERMID_CAPS=cycles=NUMBER raises it."
    """
    most = cap(name)
    shown = f"{most:.0f}" if most < 1e5 else f"{most:g}"
    return f" The cap '{name}' is {shown}; the environment variable {CAPS_VARIABLE}={name}=NUMBER raises it."


def nearest(name: str, candidates: Iterable[str]) -> str:
    """Return `` Did you mean 'x'?`` for the known name nearest to `name`, or an empty text.

    >>> nearest("proc.cas", ["proc.case", "ele.case"])
    " Did you mean 'proc.case'?"
    """
    names, name = list(candidates), str(name)
    hits = [n for n in names if n.casefold() == name.casefold()] or get_close_matches(name, names, n=1, cutoff=0.5)
    return f" Did you mean '{hits[0]}'?" if hits else ""


@contextmanager
def errors_at(where: str, joint: str = "") -> Iterator[None]:
    """Give errors that are raised inside a place where they have none; with `joint`, put it around the one that they have, see `within`."""
    try:
        yield
    except ThermidError as error:
        raise (error.within(where, joint) if joint else error.located(where)) from None


def refuse_unknown(
    names: Iterable[object],
    allowed: Collection[Any],
    where: str = "",
    refusal: str = "no key '{}'; there are {known}.",
    error: type[ThermidError] = RecordError,
) -> None:
    """Refuse the first of some names that is not known, with the nearest one that is.

    Parameters
    ----------
    names : iterable        What is asked for.
    allowed : collection    What there is.
    where : str             Place of the names, for the message.
    refusal : str           The message: `{}` stands for the name, `{known}` for all that are known, `{near}` for the nearest of these; the
                            nearest follows at the end where the message has no place for it.
    error : type            Kind of error.

    Raises
    ------
    ThermidError   Of that kind.
    """
    for name in names:
        try:
            is_known = name in allowed
        except TypeError:  # nothing that could be a name
            is_known = False
        if not is_known:
            text = refusal if "{near}" in refusal else f"{refusal}{{near}}"
            words = {"{}": str(name), "{known}": ", ".join(allowed) or "none", "{near}": nearest(str(name), allowed)}
            raise error("".join(words.get(part, part) for part in _PLACES.split(text)), where, code="name.unknown")


def refuse_first(where: str | Callable[[str], str], *rules: tuple[object, *tuple[str, ...]], error: type[ThermidError] = DeckError) -> None:
    """Refuse what breaks some rules for the first of them; all their messages are made first, so that each must hold of what is right.

    Parameters
    ----------
    where : str or callable     Place for the message, or key -> place.
    rules : tuple               Whether it is broken, the message, the key that it is about where places differ, the code of the cause.
    error : type                Kind of error.

    Raises
    ------
    ThermidError   Of that kind.
    """
    for broken, *texts in rules:
        if broken:
            message, *key, code = texts
            raise error(message, where if isinstance(where, str) else where(*key), code=code)


def look_up(name: K, table: Mapping[K, V], refusal: str, where: str = "", error: type[ThermidError] = NameNotFoundError) -> V:
    """What a table holds under a name; a name that it does not have is refused as by `refuse_unknown`.

    Raises
    ------
    ThermidError   Of the kind that is given.
    """
    refuse_unknown([name], table, where, refusal, error)
    return table[name]


def quoted(names: Sequence[str], longest: int = 8) -> str:
    """Return names in words, the rest of a long list counted.

    >>> quoted(["a", "b", "c"])
    "'a', 'b' and 'c'"
    """
    shown = [f"'{n}'" for n in names[:longest]]
    if len(names) > longest:
        return f"{', '.join(shown)} and {len(names) - longest} more"
    return "".join(shown) if not shown[1:] else f"{', '.join(shown[:-1])} and {shown[-1]}"


class CodedText(str):
    """A text with a `code`, that of the text itself where none is given; a text in every other way.

    What is made of it by formatting or cutting has no code.
    """

    code: str

    def __new__(cls, text: str, code: str = "") -> CodedText:
        """Return the text with its code."""
        coded = super().__new__(cls, text)
        coded.code = code or code_of(text)
        return coded


def code_of(text: str) -> str:
    """Return the code of a text; empty where it has none."""
    return text.code if isinstance(text, CodedText) else ""


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
    from importlib.metadata import PackageNotFoundError, requires

    try:
        requirements = requires("thermid") or []
    except PackageNotFoundError:
        return []
    module_of_package = {package: module for module, package in DISTRIBUTIONS.items()}
    names = [text for text in requirements if re.search(rf"extra == ['\"]{extra}['\"]", text)]
    packages = [re.split(r"[^\w.-]", name, maxsplit=1)[0] for name in names]
    return [module_of_package.get(name, name) for name in packages]
