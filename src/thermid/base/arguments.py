"""`takes_objects`: a path where an object is expected, and an object where a path is, are refused with what to do."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from functools import wraps
from numbers import Integral
from typing import Any, ParamSpec, TypeVar

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
    "UncertainRuns": "td.qualify.uncertain_runs(model, scenario)",
    "Network": "td.simulation.compile_network(model)",
    "StateSpace": "td.simulation.state_space(td.simulation.compile_network(model))",
    "Knowledge": "td.design.Knowledge.of_source(model or calibration)",
    "Options": "td.Options(error='1 [mK]')",
    "Channel": "td.Channel.from_array(name, readings, unit='degC')",
    "Foresight": "td.design.foresee(td.design.Knowledge(model), scenario)",
    "Correlation": "td.qualify.correlate(calibration)",
    "Structure": "td.reporting.Structure(...)",
    "Criteria": "td.Criteria(rmse='0.5 [K]')",
}
"""What a user makes and hands on, and how it is made; the braces hold the file."""
TEXTS = ("str", "PathLike", "Path")
LISTS = (list, tuple, range, set, frozenset)
COLLECTIONS = ("Sequence", "Iterable", "Mapping")
CLOSED = {*TYPES_WITH_OWN_MESSAGE, "None", "Mapping", "Any", "str", "os", "PathLike", "Path"}
CLOSED_OR_SEVERAL = CLOSED | {*COLLECTIONS}
"""Words of annotations that take nothing but what is looked at here, one of it alone or several."""


def takes_objects(function: Callable[P, R]) -> Callable[P, R]:
    """Return a function that refuses, by its annotations, a path in place of what a file holds, one thing in place of another, and so on.

    Only what users mix up is looked at: texts, paths, dictionaries and thermid's own objects. Annotations are read once.
    """
    code, annotations = function.__code__, function.__annotations__
    names = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]
    expected = {
        n: words for n in names if isinstance(annotations.get(n), str) and (words := _words(annotations[n]) or _plain(annotations[n]))
    }
    places = [(k, n) for k, n in enumerate(names[: code.co_argcount]) if n in expected]

    passed: set[tuple[str, type]] = set()  # what was taken once is taken again; a call then costs a microsecond

    def remember(name: str, value: Any) -> None:
        """Note that a type was accepted for an argument; what containers hold may differ from call to call."""
        if not isinstance(value, list | tuple | Mapping):  # what these hold may differ
            passed.add((name, type(value)))

    @wraps(function)
    def checked(*args: P.args, **kwargs: P.kwargs) -> R:
        """Call the function once its arguments are of the types that it states."""
        for k, name in places:
            if k < len(args) and (name, type(args[k])) not in passed:
                _check(args[k], expected[name], name, code.co_name)
                remember(name, args[k])
        for name, value in kwargs.items():
            if name in expected and (name, type(value)) not in passed:
                _check(value, expected[name], name, code.co_name)
                remember(name, value)
        return function(*args, **kwargs)

    return checked


def _words(annotation: str) -> tuple[str, ...]:
    """Return the names in an annotation where it takes an object of thermid or a path; nothing where it takes neither."""
    words = tuple(dict.fromkeys(re.findall(r"\w+", re.sub(r"Mapping\[str, ?", "Mapping[", annotation))))
    return words if {*words} & {*TYPES_WITH_OWN_MESSAGE, "PathLike", "Path"} or annotation.startswith("Mapping[str, Any]") else ()


def _plain(annotation: str) -> tuple[str, ...]:
    """Return the kinds of an argument that is names, a dictionary or a whole number and nothing of thermid; nothing of others."""
    if re.fullmatch(r"(Sequence|Iterable|Collection)\[str\]( \| None)?", annotation):
        return (NAMES, *(["None"] if annotation.endswith("None") else []))
    bare = annotation
    while (inner := re.sub(r"\[[^\[\]]*\]", "", bare)) != bare:
        bare = inner
    kinds = {*bare.split(" | ")}
    return (PLAIN, *kinds) if kinds - {"None"} in ({"int"}, {"str"}, {"Mapping"}, {"Mapping", "str"}) else ()


PLAIN, NAMES = "plain", "names"


def _check(value: Any, words: tuple[str, ...], name: str, function: str) -> None:
    """Refuse a value that an annotation of these words does not take.

    Raises
    ------
    DeckError   When it is a text, a path, a dictionary or an object of another kind.
    """
    if words[0] == NAMES:
        _check_names(value, name, function, "None" in words)
        return
    if words[0] == PLAIN:
        wanted: dict[str, type] = {"int": Integral, "Mapping": Mapping, "str": str, "None": type(None)}
        if isinstance(value, tuple(wanted[w] for w in words[1:])) and not isinstance(value, bool):
            return
        what = "a whole number" if "int" in words else "a dictionary" if "Mapping" in words else "a text"
        raise DeckError(f"`{name}` takes {what}, not {value!r:.60}.", function, code="value.wrong-kind")
    if value is None:
        if "None" in words:
            return
        what = "None"
    elif isinstance(value, (*LISTS, float, int)) and {*words} <= (CLOSED if isinstance(value, LISTS) else CLOSED_OR_SEVERAL):
        what = "a list" if isinstance(value, LISTS) else repr(value)
    elif isinstance(value, LISTS):
        for item in value if any(m in words for m in COLLECTIONS) else ():
            _check(item, words, name, function)
        return
    elif isinstance(value, str | os.PathLike):
        if any(t in words for t in TEXTS):
            return
        what = f"the text {value!r}" if isinstance(value, str) else f"the path {str(value)!r}"
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


def _check_names(value: Any, name: str, function: str, may_be_none: bool) -> None:
    """Refuse what is no list of names: a text alone, whose letters would be taken for names, a number, a list of something else.

    Raises
    ------
    DeckError   With what to write.
    """
    if value is None and may_be_none:
        return
    wrong = value if isinstance(value, str) or not isinstance(value, Iterable) else None
    if wrong is None and isinstance(value, list | tuple | set | frozenset | Mapping):
        wrong = next((item for item in value if item is not None and not isinstance(item, str)), value if None in value else None)
    if wrong is not None or value is None:
        text = repr(value) if wrong is None else repr(wrong)
        hint = f" Write ['{value}']." if isinstance(value, str) else ""
        raise DeckError(f"`{name}` takes a list of names, not {text[:60]}.{hint}", function, code="value.wrong-kind")


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
    file = repr(os.fspath(value)) if isinstance(value, str | os.PathLike) else "file"
    return f" Make it with {TYPES_WITH_OWN_MESSAGE[first].format(file)}."
