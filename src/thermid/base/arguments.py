"""`takes_objects`: a path where an object is expected, and an object where a path is, are refused with what to do."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from functools import wraps
from inspect import isfunction
from numbers import Integral, Real
from typing import Any, ParamSpec, TypeVar

import numpy as np

from thermid.base.errors import DeckError

P = ParamSpec("P")
R = TypeVar("R")

TYPES_WITH_OWN_MESSAGE = {
    "Model": "td.load_model({})",
    "Block": "td.Block(...)",
    "Scenario": "td.load_scenario({})",
    "Record": "td.read_record({}, {{'T1': {{'node': ...}}}})",
    "Calibration": "td.calibrate(model, record, free), or td.run_stages(campaign)[stage]",
    "Campaign": "td.run_stages({})",
    "CampaignSource": "td.run_stages({}).source",
    "ProfileRun": "td.qualify.run_profile(model, profile)",
    "Profile": "td.inference.profile(fit, path)",
    "Criticism": "td.inference.criticise(fit)",
    "Hold": "td.qualify.hold(runs, limits)",
    "Study": "td.design.load_study({})",
    "Plan": "td.qualify.load_plan({})",
    "Qualification": "td.qualify.run_plan({})",
    "FittedValues": "td.load_values({})",
    "ThermalProfile": "td.qualify.load_profile({}), or td.qualify.profile_of(standard, name)",
    "HoldQuestion": "td.qualify.load_hold({})",
    "Weather": "td.site.read_weather({})",
    "Trajectory": "td.site.read_trajectory({})",
    "Limits": "td.qualify.load_limits({})",
    "Solution": "td.simulate(model, scenario)",
    "Exclusions": "thermid.campaign.stages.Exclusions({{'T1': why}}, cap=0.1)",
    "Job": "td.qualify.uncertain_runs(model, scenario).job",
    "UncertainRuns": "td.qualify.uncertain_runs(model, scenario)",
    "Network": "td.simulation.compile_network(model)",
    "StateSpace": "td.simulation.state_space(td.simulation.compile_network(model))",
    "Knowledge": "td.design.Knowledge.of_source(model or calibration)",
    "Options": "td.Options(error='1 [mK]')",
    "Channel": "td.Channel.from_array(name, readings, unit='degC')",
    "Foresight": "td.design.foresee(td.design.Knowledge(model), scenario)",
    "Correlation": "td.qualify.correlate(calibration)",
    "Criteria": "td.Criteria(rmse='0.5 [K]')",
    "Action": "td.design.Action(name, scenario)",
    "Aim": "td.design.Aim(scenario, node)",
    "Site": "td.site.Site(latitude, longitude)",
    "Axes": "matplotlib.pyplot.subplots()[1]",
    "Media": "td.Scenario(name).media()",
    "Numbers": "td.simulation.compile_network(model).numbers({})",
}
"""What a user makes and hands on, and how it is made; the braces hold the file."""
COUNTS = ("seed", "walkers", "draws")
"""Arguments that are counted from zero on."""
TEXTS = ("str", "PathLike", "Path")
LISTS = (list, tuple, range, set, frozenset)
COLLECTIONS = ("Sequence", "Iterable", "Mapping")
CLOSED = {*TYPES_WITH_OWN_MESSAGE, "None", "Mapping", "Any", "str", "os", "PathLike", "Path"}
CLOSED_OR_SEVERAL = CLOSED | {*COLLECTIONS}
"""Words of annotations that take nothing but what is looked at here, one of it alone or several."""


def takes_objects(function: Callable[P, R], called: str = "") -> Callable[P, R]:
    """Return a function that refuses, by its annotations, a path in place of what a file holds, one thing in place of another, and so on.

    Only what users mix up is looked at: texts, numbers, paths, dictionaries and thermid's own objects. Annotations are read once, as texts
    (`from __future__ import annotations`). A type that was taken once for an argument is not looked at again, except for numbers, texts,
    lists and mappings. The function returned raises DeckError.

    Parameters
    ----------
    function : callable   What is guarded.
    called : str          Its name in messages; its own without one.
    """
    code, annotations = function.__code__, function.__annotations__
    names = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]
    expected = {
        n: words for n in names if isinstance(annotations.get(n), str) and (words := _words(annotations[n]) or _plain(annotations[n]))
    }
    places = [(k, n) for k, n in enumerate(names[: code.co_argcount]) if n in expected]

    called = called or code.co_name
    passed: set[tuple[str, type]] = set()  # what was taken once is taken again; a call then costs a microsecond

    def remember(name: str, value: Any) -> None:
        """Note that a type was accepted for an argument; what containers hold may differ from call to call."""
        if not isinstance(value, list | tuple | Mapping | float | int | np.ndarray | str):  # what these hold may differ
            passed.add((name, type(value)))

    @wraps(function)
    def checked(*args: P.args, **kwargs: P.kwargs) -> R:
        """Call the function once its arguments are of the types that it states."""
        for k, name in places:
            if k < len(args) and (name, type(args[k])) not in passed:
                _check(args[k], expected[name], name, called)
                remember(name, args[k])
        for name, value in kwargs.items():
            if name in expected and (name, type(value)) not in passed:
                _check(value, expected[name], name, called)
                remember(name, value)
        return function(*args, **kwargs)

    return checked


def guard_methods(cls: type[R]) -> type[R]:
    """Return a class whose public methods refuse the same in the same words; where it is a data class, what makes it too."""
    for name, member in list(vars(cls).items()):
        plain = member.__func__ if isinstance(member, classmethod) else member
        public = not name.startswith("_") or name == "__init__"
        if public and isfunction(plain) and not hasattr(plain, "__wrapped__"):
            guarded = takes_objects(plain, cls.__name__ if name == "__init__" else name)
            setattr(cls, name, classmethod(guarded) if isinstance(member, classmethod) else guarded)
    return cls


def _words(annotation: str) -> tuple[str, ...]:
    """Return the names in an annotation where it takes an object of thermid or a path; nothing where it takes neither."""
    words = tuple(dict.fromkeys(re.findall(r"\w+", re.sub(r"Mapping\[str, ?", "Mapping[", annotation))))
    if not {*words} & {*TYPES_WITH_OWN_MESSAGE, "PathLike", "Path"} and not annotation.startswith("Mapping[str, Any]"):
        return ()
    return (TABLE, *words) if _kinds(annotation) == {"Mapping"} else words


def _kinds(annotation: str) -> set[str]:
    """Return what an annotation takes but None, without what these hold."""
    bare = annotation
    while (inner := re.sub(r"\[[^\[\]]*\]", "", bare)) != bare:
        bare = inner
    return {*bare.split(" | ")} - {"None"}


def _plain(annotation: str) -> tuple[str, ...]:
    """Return the kinds of an argument that is names, a dictionary, a text or a number and nothing of thermid; nothing of others."""
    if named := _NAMED.fullmatch(annotation):
        return (NAMES, *(word for word in ("str", "None") if word in named.groups()), *(["Iterable"] if "Iterable" in annotation else []))
    if _TWO.fullmatch(annotation):
        return (TWO, *(["None"] if annotation.endswith("None") else []))
    kinds = _kinds(annotation)
    none = ["None"] if annotation.endswith("| None") else []
    return (PLAIN, *kinds, *none) if kinds in (*({kind} for kind in KINDS), {"Mapping", "str"}, {"Mapping", "Sequence"}) else ()


PLAIN, NAMES, TWO, TABLE = "plain", "names", "two", "table"
_NAMED = re.compile(r"(?:(str) \| )?(?:(?:Sequence|Iterable|Collection)\[str\]|tuple\[str, \.\.\.\])(?: \| (None))?")
_TWO = re.compile(r"tuple\[([\w |]+), \1\](?: \| None)?")
"""Annotations of names, and of two ends."""
KINDS: dict[str, tuple[type | tuple[type, ...], str]] = {
    "int": (Integral, "a whole number"),
    "float": (Real, "a number"),
    "bool": ((bool, np.bool_), "True or False"),
    "Mapping": (Mapping, "a dictionary"),
    "dict": (Mapping, "a dictionary"),
    "str": (str, "a text"),
    "Callable": (Callable, "a function"),  # type: ignore[dict-item]
    **dict.fromkeys(("Sequence", "Iterable", "Collection"), (Iterable, "a list")),
    **dict.fromkeys(("Array", "FloatArray", "BoolArray", "ArrayLike"), (Iterable, "an array of numbers")),
}
"""Word of an annotation -> what is taken, and how it is said; of several the first one is said."""


def _check(value: Any, words: tuple[str, ...], name: str, function: str) -> None:
    """Refuse a value that an annotation of these words does not take.

    Raises
    ------
    DeckError   When it is a text, a path, a dictionary or an object of another kind.
    """
    if (value is None and "None" in words) or (isinstance(value, str) and words[:2] == (NAMES, "str")):
        return
    if words[0] in (NAMES, TWO, PLAIN):
        _check_plain(value, words, name, function)
        return
    if words[0] == TABLE:
        if not isinstance(value, Mapping):
            raise DeckError(f"`{name}` takes a dictionary, not {_brief(value)}.", function, code="value.wrong-kind")
        words = words[1:]
    if value is None:
        what = "None"
    elif isinstance(value, (*LISTS, float, int)) and {*words} <= (CLOSED if isinstance(value, LISTS) else CLOSED_OR_SEVERAL):
        what = "a list" if isinstance(value, LISTS) else _brief(value)
    elif isinstance(value, LISTS):
        inner = tuple(w for w in words if w not in COLLECTIONS)  # a list holds no lists
        for item in value if inner != words else ():
            _check(item, inner, name, function)
        return
    elif isinstance(value, str | os.PathLike):
        if any(t in words for t in TEXTS):
            if "PathLike" in words and (value == "" or "\0" in os.fspath(value)):
                raise DeckError(
                    f"`{name}` is no file's name: {_brief(value)} {'holds a NUL' if value else 'is empty'}.",
                    function,
                    code="value.wrong-kind",
                )
            return
        what = f"the text {_brief(value)}" if isinstance(value, str) else f"the path {_brief(str(value))}"
    elif isinstance(value, Mapping) and type(value).__name__ not in TYPES_WITH_OWN_MESSAGE:
        if "Mapping" in words or "dict" in words:
            for item in value.values() if "str" not in words and "Any" not in words else ():
                _check(item, words, name, function)
            return
        what = "a dictionary"
    else:
        kinds = [c.__name__ for c in type(value).__mro__ if c.__name__ in TYPES_WITH_OWN_MESSAGE]
        if any(k in words for k in kinds) or not (kinds or {*words} <= CLOSED_OR_SEVERAL):
            return
        several = isinstance(value, Collection | Iterator) and not isinstance(value, bytes) and not hasattr(value, "shape")
        if several and not kinds and any(m in words for m in COLLECTIONS[:2]):
            return
        what = kinds[0] if kinds else f"an object of type {type(value).__name__}"
    takes = [
        *(w for w in words if w in TYPES_WITH_OWN_MESSAGE),
        *(["the path of a file or folder"] if {"PathLike", "Path"} & {*words} else []),
    ]
    raise DeckError(
        f"`{name}` takes {' or '.join(takes) or 'a dictionary'}, not {what}.{_advice(words, value)}", function, code="value.wrong-kind"
    )


def _check_plain(value: Any, words: tuple[str, ...], name: str, function: str) -> None:
    """Refuse what is not of the kind that an annotation without thermid's own objects takes.

    Raises
    ------
    DeckError   With what it takes.
    """
    if words[0] == NAMES:
        _check_names(value, name, function, "Iterable" in words)
    elif words[0] == TWO:
        check_two(value, name, function)
    else:
        allowed = [KINDS[w] for w in KINDS if w in words]
        plain = value[()] if isinstance(value, np.ndarray) and value.ndim == 0 else value  # as `Trace.at` returns one number
        alone = isinstance(plain, str | bytes | Mapping) and not {"str", "Mapping", "dict"} & {*words}  # which is no list of its parts
        of_kind = isinstance(plain, bool | np.bool_) == ("bool" in words) and any(isinstance(plain, kind) for kind, _ in allowed)
        # no NaN, and no whole number beyond all floats
        sized = abs(int(plain)) <= sys.float_info.max if isinstance(plain, Integral) else not isinstance(plain, Real) or plain == plain
        if alone or not (of_kind and sized):
            raise DeckError(f"`{name}` takes {allowed[0][1]}, not {_brief(value)}.", function, code="value.wrong-kind")
        if name in COUNTS and plain < 0:
            raise DeckError(f"`{name}` is counted from 0 on, not {_brief(value)}.", function, code="value.outside-range")


def check_two(value: Any, name: str, where: str) -> None:
    """Refuse what is no pair of a lower and an upper end.

    Raises
    ------
    DeckError   With what it is.
    """
    try:
        pair = not isinstance(value, str | Mapping) and len(value) == 2
    except TypeError:  # a single quantity with a unit, which only looks like a list
        pair = False
    if not pair:
        raise DeckError(f"`{name}` takes two values, (low, high), not {_brief(value)}.", where, code="value.wrong-kind")


def _check_names(value: Any, name: str, function: str, once: bool) -> None:
    """Refuse what is no list of names: a text alone, whose letters would be taken for names, a number, a list of something else.

    What can be read but once, such as a generator, is none either, except where it is read `once`.

    Raises
    ------
    DeckError   With what to write.
    """
    wrong = (
        []
        if isinstance(value, Iterable) and not isinstance(value, str | np.ndarray) and (once or not isinstance(value, Iterator))
        else [value]
    )
    if not wrong and not isinstance(value, Iterator):
        try:
            wrong = [item for item in value if not isinstance(item, str)]
        except TypeError:  # a single quantity with a unit, which only looks like a list
            wrong = [value]
    if wrong:
        hint = f" Write ['{value:.60}']." if isinstance(value, str) else ""
        raise DeckError(f"`{name}` takes a list of names, not {_brief(wrong[0])}.{hint}", function, code="value.wrong-kind")


def _brief(value: Any) -> str:
    """Return a value in at most 60 characters of one line."""
    return f"{' '.join(repr(value).split()):.60}"


def _advice(words: tuple[str, ...], value: Any) -> str:
    """Return how what is wanted is made."""
    first = next((w for w in words if w in TYPES_WITH_OWN_MESSAGE), "")
    if not first:
        return " Give the file's name." if any(t in words for t in TEXTS) else ""
    if isinstance(value, Mapping):
        return (
            " Make it with td.model_from_dict(...)."
            if first == "Model"
            else f" Make it with {TYPES_WITH_OWN_MESSAGE[first].format('file')}."
        )
    file = _brief(os.fspath(value)) if isinstance(value, str | os.PathLike) else "file"
    return f" Make it with {TYPES_WITH_OWN_MESSAGE[first].format(file)}."
