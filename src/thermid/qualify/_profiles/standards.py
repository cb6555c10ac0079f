"""The profiles of the standards by their names, and those of files that are like them."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

from thermid.base.errors import ScenarioError, nearest, refuse_unknown
from thermid.base.extensions import by_grammar, grammar_of, refuse_another_kind
from thermid.base.toml_files import Places, read_toml
from thermid.measure.steadiness import rule_of
from thermid.qualify._profiles.numbers import SLOTS, WORDS
from thermid.qualify._profiles.profile import KINDS, Number, ThermalProfile, number, predicted_range

LIBRARY: Final = Path(__file__).parent / "library"
PROJECT_NUMBERS: Final = {"ambient": "23 [degC]", "longest_wait": "72 [h]"}
"""Numbers that every run needs and no standard gives."""


@lru_cache(maxsize=1)
def _library() -> tuple[Mapping[str, Any], ...]:
    """Return the profiles of the standards, as read from the package's files."""
    return tuple(read_toml(file)[0] for file in sorted(LIBRARY.glob("*.toml")))


def profile_names() -> dict[str, dict[str, tuple[str, ...]]]:
    """Return standard -> profile -> its levels."""
    out: dict[str, dict[str, tuple[str, ...]]] = {}
    for data in _library():
        out[data["standard"]] = {name: tuple(p.get("levels", ())) for name, p in data["profiles"].items()}
    return out


def _standard(name: str) -> Mapping[str, Any]:
    """Return the data of a standard by its name or one of its aliases, in any case of letters.

    Raises
    ------
    ScenarioError   When there is none of that name.
    """
    names = {alias.casefold(): data for data in _library() for alias in (data["standard"], *data.get("aliases", ()))}
    if name.casefold() not in names:
        titles = [data["standard"] for data in _library()]
        raise ScenarioError(
            f"unknown standard '{name}'. Known: {', '.join(titles)}.{nearest(name.casefold(), names)} "
            "For another standard write a profile file, each number with its mark and clause.",
            "profile",
            code="name.unknown",
        )
    return names[name.casefold()]


def profile_of(standard: str, name: str = "", *, level: str = "", predicted: Any = None, **changes: Any) -> ThermalProfile:
    """Return a profile of a standard.

    Parameters
    ----------
    standard : str      The standard, ``"SMC-S-016"``.
    name : str          The profile, ``"unit thermal cycle"``; may be left out where the standard has one.
    level : str         Level or category; the first by default.
    predicted : pair    Lowest and highest predicted temperature, the model's uncertainty included. [K]
    **changes           Numbers in place of the standard's: ``cycles=2``, ``hot="55 [degC]"``.

    Raises
    ------
    ScenarioError   When there is no such standard, profile, level or number.
    """
    data = _standard(standard)
    profiles = data["profiles"]
    if not name and len(profiles) == 1:
        (name,) = profiles
    if name not in profiles:
        have = ", ".join(f"'{k}'" for k in profiles)
        if not name:
            raise ScenarioError(f"{data['standard']} has several profiles. Name one: {have}.", "profile", code="value.incomplete")
        raise ScenarioError(
            f"{data['standard']} has no profile '{name}'; it has {have}.{nearest(name, profiles)}", "profile", code="name.unknown"
        )
    spec = profiles[name]
    base = profiles[spec["like"]] if "like" in spec else {}
    levels = spec.get("levels", {})
    for word in (standard, name, level):
        if not isinstance(word, str):
            raise ScenarioError(f"a standard, a profile and a level are texts, not {word!r}.", "profile", code="value.wrong-kind")
    if level and level not in levels:
        have = f"it has {', '.join(levels)}" if levels else "it has none"
        raise ScenarioError(
            f"'{name}' of {data['standard']} has no level '{level}'; {have}.{nearest(level, levels)}", "profile", code="name.unknown"
        )
    level = level or next(iter(levels), "")
    title = ", ".join([f"{data['standard']} {name}", *([level] if level else [])])
    table = {**OWN_TABLE}
    for part, clause in ((base, base.get("clause", "")), (spec, spec.get("clause", ""))):
        table |= {k: number(k, v, data["mark"], clause, title) for k, v in part.get("numbers", {}).items()}
    table |= {
        k: number(k, v, data["mark"], spec["clause"] if "clause" in spec else base["clause"], title)
        for k, v in levels.get(level, {}).items()
    }
    plan = tuple(spec.get("steps", base.get("steps", ())))
    kind, clause, note = (
        spec.get("kind", base.get("kind")),
        spec.get("clause", base.get("clause", "")),
        spec.get("note", base.get("note", "")),
    )
    pair = None if predicted is None else predicted_range(predicted, title)
    profile = ThermalProfile(title, kind, data["standard"], data["edition"], clause, level, table, pair, plan, data["mark"], note)
    return profile.with_(**changes) if changes else profile


OWN_TABLE: Final[Mapping[str, Number]] = {k: number(k, v, "project", "", "profile") for k, v in PROJECT_NUMBERS.items()}


def load_profile(path: str | os.PathLike[str]) -> ThermalProfile:
    """Return the profile of a TOML file: its table ``[profile]`` names a profile of a standard and the numbers that differ from it.

    Raises
    ------
    ScenarioError   When a key is unknown, or the named profile does not exist.
    DeckError       When the file cannot be read.
    """
    file = Path(path)
    data, lines = read_toml(file)
    where, apart = Places(file.name, lines), "profile" in data
    if not apart and not {*data} <= {*grammar_of("thermid.qualify._profiles.schema.ProfileTable").model_fields}:
        refuse_another_kind("thermid.qualify._profiles.schema.ProfileFile", data, where)
    return profile_from(data.get("profile", data), lambda key: where(f"profile.{key}".rstrip(".") if apart else key), file.stem)


def profile_from(data: Mapping[str, Any], where: str | Callable[[str], str], stem: str = "profile") -> ThermalProfile:
    """Return the profile of a table ``[profile]``, as in a profile file or a plan.

    Parameters
    ----------
    data : table            The table.
    where : str or callable Name of the file, or key -> its place, for messages.
    stem : str              Title where the table has none.

    Raises
    ------
    ScenarioError   As in `load_profile`.
    """
    at = Places(f"{where}, profile") if isinstance(where, str) else where
    place = at("")
    if not data:
        raise ScenarioError("the table [profile] is missing.", place, code="value.incomplete")
    data = by_grammar("thermid.qualify._profiles.schema.ProfileTable", data, at).written
    numbers = {**data.get("numbers", {}), **{k: v for k, v in data.items() if k in SLOTS or k in WORDS}}
    if "like" in data:
        standard, name = _standard_and_name(data["like"], place)
        profile = profile_of(standard, name, level=data.get("level", ""))
        profile = replace(profile, title=data.get("title", profile.title), note=data.get("note", profile.note))
    else:
        kind = data.get("kind", "thermal cycling")
        refuse_unknown([kind], KINDS, place, "unknown kind '{}'. Use one of {known}.", ScenarioError)
        standard, edition, clause, level = (str(data.get(k, "")) for k in ("standard", "edition", "clause", "level"))
        profile = ThermalProfile(data.get("title", stem), kind, standard, edition, clause, level, {**OWN_TABLE}, note=data.get("note", ""))
    mark = data.get("mark", "project")
    new = {k: number(k, v, mark, "", place) for k, v in numbers.items()}
    if "stable" in new:
        rule_of(str(new["stable"].value))
    profile = replace(profile, numbers={**profile.numbers, **new})
    if "steps" in data:
        profile = replace(profile, plan=tuple(data["steps"]), step_mark=mark)
    return profile if "predicted" not in data else replace(profile, predicted=predicted_range(data["predicted"], place))


def _standard_and_name(like: Any, where: str) -> tuple[str, str]:
    """Return (standard, name of the profile) of a text such as ``SMC-S-016 unit thermal cycle``.

    Raises
    ------
    ScenarioError   When it does not begin with a standard.
    """
    text = str(like)
    names = sorted((a for d in _library() for a in (d["standard"], *d.get("aliases", ()))), key=len, reverse=True)
    for name in names:
        if text.casefold().startswith(name.casefold()):
            return name, text[len(name) :].strip(" ,:")
    titles = ", ".join(d["standard"] for d in _library())
    raise ScenarioError(f"like = {text!r} does not begin with a known standard. Known: {titles}.", where, code="name.unknown")
