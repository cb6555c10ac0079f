"""What can be run in the studio: profiles of the standards and of files, scenarios, what logs were made under, tests of plans."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from thermid.errors import NameNotFoundError, ScenarioError, ThermidError, nearest
from thermid.judge.limits import Limits, read_limits
from thermid.network.network import compile_network
from thermid.profiles.profile import SLOTS, ThermalProfile
from thermid.profiles.standards import load_profile, profile_names, profile_of
from thermid.studio.desk import Desk
from thermid.toml_files import project_root, read_toml
from thermid.units import TEMPERATURE

USUAL = {TEMPERATURE: "degC", "K/s": "K/min", "s": "h", "1": ""}
"""Unit of a number that is typed without one."""


@dataclass(frozen=True)
class Course:
    """Something that can be run.

    Parameters
    ----------
    key : str       By which a page names it.
    title, group    What it is called, and what it belongs to.
    kind : str      'profile', 'scenario', 'record' or 'test'.
    of : tuple      Standard, profile and level; or file and name.
    """

    key: str
    title: str
    group: str
    kind: str
    of: tuple[Any, ...] = field(repr=False)


class Shelf:
    """All that can be run with one deck or campaign, and the limits that are kept beside it.

    Parameters
    ----------
    path : Path     The deck or campaign; its folder, the folders in it, and the one above within the project are looked at.
    """

    def __init__(self, path: Path) -> None:
        self.folder = path.parent
        self._tables = {f: content for f in _files(self.folder) if (content := _read(f))}

    def courses(self, desk: Desk) -> dict[str, Course]:
        """Return key -> what can be run on a desk's model, or on a plan's own."""
        found = [*_own(desk), *self._written(), *_standards()]
        return {c.key: c for c in found}

    def course(self, desk: Desk, key: str) -> Course:
        """Return one of them.

        Raises
        ------
        NameNotFoundError   When there is none of that key.
        """
        known = self.courses(desk)
        if key not in known:
            raise NameNotFoundError(f"there is nothing called '{key}' to run.{nearest(key, known)}", desk.title)
        return known[key]

    def limits(self, desk: Desk) -> tuple[tuple[Limits, ...], str]:
        """Return the limits beside the deck whose nodes its model has, and the files that hold them."""
        network = compile_network(desk.model)
        nodes, loads = set(network.nodes), {load.path for load in network.flat.loads}
        out: dict[str, Limits] = {}
        files: dict[str, None] = {}
        for file, content in self._tables.items():
            if not _is_limits(content):
                continue
            try:
                fitting = [one for one in read_limits(content, file.name) if one.node in nodes and set(one.loads) <= loads]
            except ThermidError:
                continue  # a plan or a check that reads them says why
            out |= {one.point: one for one in fitting if one.point not in out}
            if fitting:
                files[file.name] = None
        return tuple(out.values()), ", ".join(files)

    def _written(self) -> Iterator[Course]:
        for file, content in self._tables.items():
            name = file.name
            if isinstance(content.get("profile"), Mapping):
                yield Course(
                    f"profile {self._at(file)}", str(content["profile"].get("title", name)), "Profiles of files", "profile", (file,)
                )
            tests = content.get("tests")
            if isinstance(content.get("model"), Mapping) and isinstance(tests, list):
                for test in tests:
                    if isinstance(test, Mapping) and "name" in test:
                        group = f"Plan {name}, on its own model"
                        yield Course(f"test {self._at(file)} {test['name']}", str(test["name"]), group, "test", (file, str(test["name"])))

    def _at(self, file: Path) -> str:
        return file.relative_to(project_root(self.folder)).as_posix() if file.is_relative_to(project_root(self.folder)) else file.name


def profile_for(course: Course, asked: Mapping[str, Any]) -> ThermalProfile:
    """Return a profile with what was changed on the page.

    Parameters
    ----------
    course : Course     Of kind 'profile'.
    asked : dict        ``lowest`` and ``highest`` predicted [degC], ``numbers``: name -> text, in its usual unit where it has none.

    Raises
    ------
    ScenarioError   When a number is none, or one of the two predicted temperatures is missing.
    """
    found = load_profile(course.of[0]) if len(course.of) == 1 else profile_of(course.of[0], course.of[1], level=course.of[2])
    ends = [asked.get("lowest"), asked.get("highest")]
    if (ends[0] is None) != (ends[1] is None):
        raise ScenarioError("give both the lowest and the highest predicted temperature, or neither.", course.title)
    given = asked.get("numbers", {})
    if not isinstance(given, Mapping) or not all(isinstance(v, str) for v in given.values()):
        raise ScenarioError("numbers are texts by name.", course.title)
    predicted = None if ends[0] is None else [f"{float(str(v))!r} [degC]" for v in ends]
    changed: dict[str, Any] = {str(k): _typed(str(k), v) for k, v in given.items() if v.strip()}
    return found.with_(predicted=predicted, **changed)


def profile_object(found: ThermalProfile) -> dict[str, Any]:
    """Return a profile's numbers with clauses and marks, as a page lists them; those not known yet with the reason."""
    numbers: dict[str, dict[str, str]] = {}
    lacking = ""
    try:
        numbers = {k: {"text": n.text, "mark": n.mark, "clause": n.clause, "note": n.note} for k, n in found.used.items()}
        steps, remarks, trust = len(found.steps), list(found.check()), found.trust
    except ScenarioError as error:
        steps, remarks, trust, lacking = 0, [], "", error.message
        numbers = {k: {"text": n.text, "mark": n.mark, "clause": n.clause, "note": n.note} for k, n in found.numbers.items()}
    return {
        "title": found.title,
        "kind": found.kind,
        "note": found.note,
        "numbers": numbers,
        "steps": steps,
        "remarks": remarks,
        "trust": trust,
        "lacking": lacking,
    }


def _typed(name: str, text: str) -> str | float:
    """Return what was typed for a number, with its usual unit where none was."""
    try:
        value = float(text)
    except ValueError:
        return text.strip()
    slot = SLOTS.get(name)
    usual = USUAL.get(slot, slot) if slot is not None else ""
    return f"{value!r} [{usual}]" if usual else value


def _own(desk: Desk) -> Iterator[Course]:
    kind, group = ("record", "As its logs were made") if desk.problem is not None else ("scenario", "Scenarios")
    for k, title in enumerate(desk.runs):
        yield Course(f"{kind} {k}", title, group, kind, (k,))


def _standards() -> Iterator[Course]:
    for standard, profiles in profile_names().items():
        for name, levels in profiles.items():
            for level in levels or ("",):
                title = f"{name}, {level}" if level else name
                yield Course(f"{standard} {title}", title, standard, "profile", (standard, name, level))


def _files(folder: Path) -> list[Path]:
    """Return the decks, plans and tables that may belong to a file of a folder."""
    root = project_root(folder)
    near = sorted(folder.glob("*.toml")) + sorted(folder.glob("*/*.toml"))
    above = sorted(folder.parent.glob("*.toml")) if folder.parent.is_relative_to(root) else []
    return [f for f in dict.fromkeys([*near, *above]) if f.resolve().is_relative_to(root)]


def _read(file: Path) -> dict[str, Any]:
    try:
        return read_toml(file)[0]
    except ThermidError:
        return {}


def _is_limits(content: Mapping[str, Any]) -> bool:
    return bool(content) and all(isinstance(t, Mapping) and {"node", "operating"} <= set(t) for t in content.values())
