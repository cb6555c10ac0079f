"""`load_plan`: a qualification plan - what is to be shown, on what, with which sensors and by which criteria - before any log is read."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from thermid.base.errors import DeckError, NameNotFoundError, ThermidError, errors_at, look_up, quoted, refuse_unknown
from thermid.base.files import (
    FileKinds,
    Places,
    by_grammar,
    project_root,
    read_bytes,
    read_json,
    read_toml,
    refuse_another_kind,
    resolve_inside,
)
from thermid.base.results import Result
from thermid.base.units import TEMPERATURE, counted
from thermid.campaign.stages import CRITERIA, POLICIES, Criteria, Limits, load_limits, read_limits, run_stages
from thermid.measure.records import StabilityRule
from thermid.model.tree import literal, load_model
from thermid.prediction.bands import Knowledge
from thermid.prediction.reduction import macro_model
from thermid.values.store import Filed

if TYPE_CHECKING:
    from thermid.qualify._plan_schema import LockFile, PlanFile, TestTable


AS_RUN = ("log", "state", "deviations", "date", "heat_leaks", "note")
"""What a test's table may gain once it was made; the rest is the plan."""


@dataclass(frozen=True, eq=False)
class Plan(Result):
    """A qualification plan as it was read from its file; nothing was run yet.

    Parameters
    ----------
    path : Path                 The plan's TOML file.
    content : PlanFile          Its tables and keys, checked by the grammar.
    limits : tuple of Limits    Temperature limits of the reference points.
    criteria : dict             Name -> set of criteria: the published ones and the plan's own.
    files : dict                File that the plan rests on -> SHA-256: decks, limits, scenarios, and the files that these name in turn.
    data : Path or None         Folder of logs outside the project.
    """

    path: Path
    content: PlanFile
    limits: tuple[Limits, ...]
    criteria: Mapping[str, Criteria]
    files: Mapping[str, str] = field(repr=False)
    data: Path | None = None

    @property
    def title(self) -> str:
        """Title of the plan."""
        return self.content.title

    @property
    def tests(self) -> tuple[TestTable, ...]:
        """The tests, in the order of the file."""
        return tuple(self.content.tests)

    @cached_property
    def planned(self) -> dict[str, str]:
        """Key path -> planned value as JSON text, and ``file NAME`` -> hash: all that may not change once a log was read.

        Keys that a test gains when it was made (`KEYS_ADDED_AFTER_TEST`), the document's and discrepancies are left out.
        """
        whole = self.content.model_dump(mode="json")
        whole.pop("document"), whole.pop("discrepancies")
        for test in whole["tests"]:
            for key in AS_RUN:
                test.pop(key, None)
        whole["tests"] = {t["name"]: t for t in whole["tests"]}
        return dict(_flat_pairs(whole)) | {f"file {name}": sha for name, sha in self.files.items()}

    @cached_property
    def sha256(self) -> str:
        """SHA-256 of `planned`, as hexadecimal digits; what is added as tests are made does not change it."""
        return hashlib.sha256(json.dumps(self.planned, sort_keys=True).encode()).hexdigest()

    @cached_property
    def knowledge(self) -> Knowledge:
        """The model and what is known of its values. A campaign is run when this is first asked for."""
        source, folder = self.content.model, self.path.parent
        with errors_at(self.path.name, ", "):
            if source.campaign:
                file = resolve_inside(folder, source.campaign, "model.campaign")
                data = self.data or (resolve_inside(folder, source.data, "model.data") if source.data else None)
                campaign = run_stages(file, data=data, cache=file.parent / "results")
                refuse_unknown([source.stage], campaign.stages, "model.stage", "the campaign has no stage '{}'.", NameNotFoundError)
                return Knowledge.of_source(campaign[source.stage])
            with errors_at("model.tree"):
                model = load_model(resolve_inside(folder, source.deck, "model.tree"))
            if not source.values:
                return Knowledge(model)
            return Knowledge.of_file(Filed.read(resolve_inside(folder, source.values, "model.values"), model))

    def on_host(self, host: str) -> tuple[Knowledge, tuple[Limits, ...]]:
        """Return the model inside the plan's macro model `host` and the limits, both under their paths there; bare for an empty name.

        Raises
        ------
        NameNotFoundError   With the nearest name.
        """
        if not host:
            return self.knowledge, self.limits
        table = look_up(host, self.content.hosts, "no host '{}'; there are {known}.", str(self.path))
        limits = (replace(x, node=f"{table.unit}.{x.node}", loads=tuple(f"{table.unit}.{n}" for n in x.loads)) for x in self.limits)
        whole = macro_model(resolve_inside(self.path.parent, table.deck, f"hosts.{host}.deck"), unit=self.knowledge.model)
        return Knowledge(whole, self.knowledge.values, None, self.knowledge.synthetic, at=table.unit), tuple(limits)

    def _summary(self) -> str:
        """Title, number of tests and number of reference points."""
        return f"{self.title}: {counted(len(self.tests), 'test')}, {counted(len(self.limits), 'reference point')}"

    def lock(self, predictions: dict[str, Any] | None = None, date: str = "") -> Path:
        """Write what is planned with its hash, the date and the predictions beside the plan, and return that file.

        Older locks and all looks at logs stay in the file. A plan that is unchanged since its last lock gets no new one.

        Parameters
        ----------
        predictions : dict  Predictions of each test before any log, as plain numbers.
        date : str          The day; today by default.
        """
        data = _read_lock(self)
        if not data["locks"] or data["locks"][-1]["sha256"] != self.sha256:
            entry = {"sha256": self.sha256, "date": date or _today(), "planned": self.planned, "predictions": predictions or {}}
            entry["looked_beside"] = _hashes_read_by_other_plans(self)
            data["locks"].append(entry)
            _write_lock(self, data)
        return _lock_file(self)

    def lock_status(self) -> LockStatus:
        """Return the state of a plan's lock: open, locked, changed, late or moved, with the keys that differ; see `LockStatus`.

        What is planned now is compared with the last lock before the first log was read. It is late where there was none then, or another
        plan of the folder had read a log of this one before the lock.
        """
        data = _read_lock(self)
        locks, looks = data["locks"], data["looks"]
        looked = looks[0]["date"] if looks else ""
        before = locks[: looks[0]["locks_before"]] if looks else locks
        if not before:
            return LockStatus("late" if locks else "open", "", looked, (), self.sha256)
        base = before[-1]
        if {look["sha256"] for look in looks} & {*base.get("looked_beside", [])}:
            return LockStatus("late", base["date"], looked, (), self.sha256)
        old, new = base["planned"], self.planned
        changed = tuple(sorted(k for k in {*old, *new} if old.get(k) != new.get(k)))
        state = "locked" if not changed else "moved" if looks else "changed"
        return LockStatus(state, base["date"], looked, changed, self.sha256)


def _flat_pairs(value: Any, path: str = "") -> list[tuple[str, str]]:
    """Return (key path joined by dots, value as JSON text) of every value in nested dictionaries; None, "" and [] are left out."""
    if isinstance(value, dict):
        return [pair for key, inner in value.items() for pair in _flat_pairs(inner, f"{path}.{key}" if path else str(key))]
    return [(path, json.dumps(value, sort_keys=True))] if value not in (None, "", []) else []


def load_plan(path: str | os.PathLike[str], data: str | os.PathLike[str] | None = None) -> Plan:
    """Return a qualification plan from its TOML file, checked without running anything.

    Parameters
    ----------
    path : path     The TOML file.
    data : path     A folder of logs outside the project.

    Raises
    ------
    DeckError           When it breaks the grammar, has no objective, test or limit, or a test has neither profile nor scenario.
    NameNotFoundError   When a test names a sensor, a set of criteria or a host that the plan does not have.
    """
    target = Path(path)
    raw, lines = read_toml(target)
    where = Places(target.name, lines)
    refuse_another_kind("thermid.qualify._plan_schema.PlanFile", raw, where)
    # refuse a plan that plans nothing, before its grammar is looked at
    lacking = [k for k in ("title", "objectives", "model", "limits", "sensors", "tests") if not raw.get(k)]
    if lacking:
        raise DeckError(
            "the plan is empty. State before any log is read what the tests must show: title, objectives, [model], [limits], [sensors] and "
            "[[tests]]."
            if len(lacking) == 6
            else f"the plan has no {', no '.join(lacking)}. State them before any log is read; a later decision is weak evidence.",
            target.name,
            code="plan.incomplete",
        )
    content: PlanFile = by_grammar("thermid.qualify._plan_schema.PlanFile", raw, where)
    source = content.model
    if bool(source.deck) == bool(source.campaign) or bool(source.campaign) != bool(source.stage):
        raise DeckError(
            "give the model as a deck, with a values file if any; or as a stage of a campaign: campaign and stage.",
            where("model"),
            code="value.incomplete",
        )
    limits = _limits(content.limits, target.parent, where)
    project_sets = {name: Criteria.read(table, where(f"criteria.{name}"), name) for name, table in content.criteria.items()}
    criteria = CRITERIA | project_sets
    check_parts(content, where)
    for k, test in enumerate(content.tests):
        check_test(content, test, criteria, lambda key, k=k: where(f"tests.{k}.{key}"))  # type: ignore[misc]
    refuse_unknown(
        [content.margins.policy], POLICIES, where("margins.policy"), "no margin policy '{}'; there are {known}.", NameNotFoundError
    )
    logs = Path(data) if data is not None else None
    return Plan(target, content, limits, criteria, hashes_of_files(target, content, logs, where), logs)


def _limits(limits: str | Mapping[str, Any], folder: Path, where: Places) -> tuple[Limits, ...]:
    """Return the limits that the plan gives as a table or as the name of a file; an error in that file names the plan too."""
    if not isinstance(limits, str):
        return read_limits(limits, lambda key: where(f"limits.{key}" if key else "limits"))
    with errors_at(where("limits"), ", "):
        return load_limits(resolve_inside(folder, limits, where("limits")))


MAX_FILE_NAME_CHARACTERS = 255
"""Characters that a file's name can have."""


def hashes_of_files(target: Path, content: PlanFile, data: Path | None, where: Callable[[str], str]) -> dict[str, str]:
    """Return file -> SHA-256 of every file that a plan rests on: of a deck's meaning (`Model.identity`), else of the bytes.

    A file is named by its path relative to the plan, or by ``data: PATH`` in the folder of logs that the plan or the caller names.

    Parameters
    ----------
    target : Path       The plan's file.
    content : PlanFile  What it says.
    data : Path or None A folder of logs outside the project.
    where : callable    Key -> its place in the plan, for messages.

    Raises
    ------
    DeckError   When a file that the plan names is not there.
    """
    folder, source = target.parent, content.model
    decks = [*([source.deck] if source.deck else []), *(h.deck for h in content.hosts.values())]
    out = {name: load_model(resolve_inside(folder, name, where("model"))).identity() for name in decks}
    plain = [source.values, source.campaign, content.limits if isinstance(content.limits, str) else ""]
    plain += [t.scenario for t in content.tests if isinstance(t.scenario, str)]
    logs = data or (resolve_inside(folder, source.data, where("model.data")) if source.data else None)
    for name in (n for n in plain if n):
        file = resolve_inside(folder, name, where("files"))
        if not file.is_file():
            raise DeckError(f"there is no file '{name}'.", target.name, code="file.not-found")
        for one in _with_files_named(file, logs, set()):
            # the folder of logs may move, unless the plan lies in it
            if logs and one.is_relative_to(logs.resolve()) and not folder.resolve().is_relative_to(logs.resolve()):
                key = f"data: {one.relative_to(logs.resolve()).as_posix()}"
            else:
                key = Path(os.path.relpath(one, folder.resolve())).as_posix()
            out[key] = hashlib.sha256(read_bytes(one)).hexdigest()
    return out


def _with_files_named(file: Path, logs: Path | None, visited: set[Path]) -> Iterator[Path]:
    """Yield a file and every file that it names, at any depth; `visited` takes in what was yielded.

    Every text in a TOML file that is the name of a file counts, whatever its key, so that keys added later are not forgotten.
    """
    if file in visited:
        return
    visited.add(file)
    yield file
    if file.suffix == ".toml":
        for key, text in _texts(read_toml(file)[0]):
            for named in _files_named(key, text, file.parent, logs):
                yield from _with_files_named(named, logs, visited)


def _texts(value: Any, key: str = "") -> Iterator[tuple[str, str]]:
    """Yield (key, text) for every text in nested tables and lists; the key is that of the innermost table."""
    if isinstance(value, str):
        yield key, value
    elif isinstance(value, dict):
        for name, inner in value.items():
            yield from _texts(inner, name)
    elif isinstance(value, list):
        for inner in value:
            yield from _texts(inner, key)


def _files_named(key: str, text: str, folder: Path, logs: Path | None) -> list[Path]:
    """Return the existing files that a text names, in `logs` before `folder`; empty where it names none inside the project.

    Under the key ``files`` the text is a pattern such as ``*.csv``.
    """
    if not text or len(text) > MAX_FILE_NAME_CHARACTERS or "\0" in text or "\n" in text:
        return []
    roots = [r.resolve() for r in (project_root(folder), logs) if r is not None]
    for root in (r for r in (logs, folder) if r is not None):
        hits = sorted(root.glob(text)) if key == "files" and not Path(text).is_absolute() else [root / text]
        inside = [f for f in (h.resolve() for h in hits) if f.is_file() and any(f.is_relative_to(r) for r in roots)]
        if inside:
            return inside
    return []


Where = Callable[[str], str]
PROFILE = "thermid.qualify._profiles.schema.ProfileTable"
RANGES = {"temperature": TEMPERATURE, "pressure": "Pa", "power": "W", "gravity": "m/s^2"}
"""Key of the validity -> the unit of its two ends."""


def check_parts(content: PlanFile, where: Where) -> None:
    """Refuse sensors without a reason, exclusions of sensors that are not there, and ranges of validity that are no ordered pair.

    Raises
    ------
    DeckError           When a reason is missing, or a range is no pair in order.
    NameNotFoundError   When an exclusion names no sensor.
    """
    for name, sensor in content.sensors.items():
        if not sensor.reason.strip():
            raise DeckError(
                f"sensor '{name}' has no reason for its place. State why.", where(f"sensors.{name}.reason"), code="value.incomplete"
            )
    for name in content.exclusions.reasons:
        refuse_unknown(
            [name], content.sensors, where(f"exclusions.reasons.{name}"), "'{}' is excluded, but is not a sensor.", NameNotFoundError
        )
    for key, unit in RANGES.items():
        texts = getattr(content.validity, key)
        ends = [literal(t, unit, where(f"validity.{key}")) for t in texts]
        if texts and (len(ends) not in ((1, 2) if key == "gravity" else (2,)) or ends != sorted(ends)):
            raise DeckError(
                f"give the range of the calibration as a pair, lowest first, not {texts}.",
                where(f"validity.{key}"),
                code="value.outside-range",
            )


def check_test(content: PlanFile, test: TestTable, criteria: Mapping[str, Criteria], where: Where) -> None:
    """Refuse a test whose name is taken, that has no course, or that names hosts, sensors, criteria or periods that do not fit.

    Raises
    ------
    DeckError           When its name is empty or taken, profile and scenario are missing, a period is no pair, or a waiver has no reason.
    NameNotFoundError   When it names a host, a sensor or criteria that the plan does not have.
    RecordError         When its rule of stability cannot be read.
    """
    names = [t.name for t in content.tests]
    if not test.name.strip() or names.count(test.name) > 1:
        raise DeckError(f"a test needs a name of its own, not '{test.name}'.", where("name"), code="name.taken")
    if test.profile is None and test.scenario is None:
        raise DeckError(f"test '{test.name}' needs a profile or a scenario.", where("name"), code="value.incomplete")
    refuse_unknown([test.host] if test.host else (), content.hosts, where("host"), "there is no host '{}'.", NameNotFoundError)
    for key in ("sensors", "weights"):
        refuse_unknown(getattr(test, key), content.sensors, where(key), "there is no sensor '{}'.", NameNotFoundError)
    have = f"there are no criteria '{{}}'; there are {quoted(list(criteria))}."
    refuse_unknown(test.criteria, criteria, where("criteria"), have, NameNotFoundError)
    for key, kind, course in (("scenario", "scenario", test.scenario), ("profile", PROFILE, test.profile)):
        if isinstance(course, Mapping):
            by_grammar(kind, course, lambda inner, key=key: where(f"{key}.{inner}".rstrip(".")))  # type: ignore[misc]
    StabilityRule.named(test.stable)
    steady = [n for n in test.criteria if "steady" in criteria[n].kinds]
    if test.log is not None and steady and not test.steady and test.profile is None:
        raise DeckError(
            f"'{steady[0]}' applies to steady cases, but test '{test.name}' names no steady period. Give steady = [[\"4 [h]\", \"5 "
            '[h]"]].',
            where("criteria"),
            code="value.without-effect",
        )
    for window in test.steady:
        ends = [literal(t, "s", where("steady")) for t in window]
        if len(ends) != 2 or not ends[0] < ends[1]:
            raise DeckError(
                'give a steady period as a pair of times, the earlier first: ["4 [h]", "5 [h]"].',
                where("steady"),
                code="value.outside-range",
            )
    if test.state == "waived" and not test.note.strip():
        raise DeckError(
            f"test '{test.name}' is waived without a reason. State why, and by whom, in its note.", where("state"), code="value.incomplete"
        )


@dataclass(frozen=True)
class LockStatus:
    """Whether a plan is still the one that was locked before any log was read.

    Parameters
    ----------
    state : str             open (never locked), locked, changed (since the lock, no log read), late (logs were read before the lock) or
                            moved (changed after logs were read).
    date : str              Date of the lock that counts: the last one before the first log was read; empty without one.
    looked : str            Date on which a log was first read; empty where none was.
    changed : tuple of str  Keys that differ from that lock.
    sha256 : str            Hash of the plan as it is now.
    """

    state: str
    date: str
    looked: str
    changed: tuple[str, ...]
    sha256: str

    def __str__(self) -> str:
        """The status as a sentence."""
        keys = quoted(self.changed)
        return {
            "open": f"the plan was never locked, and logs were read on {self.looked}: nothing shows that the criteria were set in advance"
            if self.looked
            else "the plan is not locked. Lock it before any log is read: thermid plan PLAN --lock",
            "locked": f"the plan is unchanged since it was locked on {self.date} (hash {self.sha256[:12]})"
            + (", before any log was read" if self.looked else ". No log has been read since"),
            "changed": f"the plan was changed after it was locked on {self.date}: {keys}. No log has been read since; lock it again",
            "late": "another plan of this folder read its logs before it was locked, so the lock does not prove that the criteria "
            "were set in advance"
            if self.date
            else f"logs were read on {self.looked}, before the plan was locked, so the lock does not prove that the criteria were set "
            "in advance",
            "moved": f"THE PLAN WAS CHANGED AFTER LOGS WERE READ on {self.looked}: {keys}; it was locked on {self.date}",
        }[self.state]


def _lock_file(plan: Plan) -> Path:
    """Return the path of the lock: the plan's with ``.lock.json`` as its suffix."""
    return plan.path.with_suffix(".lock.json")


def _read_lock(plan: Plan) -> dict[str, Any]:
    """Return the content of the lock file; without one, no locks and no looks."""
    file = _lock_file(plan)
    if not file.is_file():
        return {"schema": 1, "locks": [], "looks": []}
    lock: LockFile = read_json(file, "thermid.qualify._plan_schema.LockFile")
    return dict(lock.model_dump(by_alias=True))


def _write_lock(plan: Plan, data: dict[str, Any]) -> None:
    """Write locks and looks into the plan's lock file."""
    FileKinds.RESULTS_FILE.save_text(_lock_file(plan), json.dumps(data, indent=1, sort_keys=True))


def _today() -> str:
    """Return the date of today in UTC, as ``2026-11-29``."""
    return datetime.now(UTC).date().isoformat()


def _hashes_read_by_other_plans(plan: Plan) -> list[str]:
    """Return the hashes of logs that other plans of the folder have read: a copy of a plan cannot be locked as if no log had been read."""
    lock_file, hashes = _lock_file(plan), set()
    for file in sorted(lock_file.parent.glob("*.lock.json")):
        if file == lock_file:
            continue
        with suppress(ThermidError):
            hashes |= {look.sha256 for look in read_json(file, "thermid.qualify._plan_schema.LockFile").looks}
    return sorted(hashes)


def note_look(plan: Plan, test: str, sha256: str, date: str = "") -> str:
    """Write into the lock that the log of a test was read; return the date on which another log of that test was first read, or "".

    A log that was noted already changes nothing.

    Parameters
    ----------
    plan : Plan
    test : str      Name of the test.
    sha256 : str    Hash of the log.
    date : str      The day; today by default.
    """
    data = _read_lock(plan)
    others = [one["date"] for one in data["looks"] if one["test"] == test and one["sha256"] != sha256]
    if all((one["test"], one["sha256"]) != (test, sha256) for one in data["looks"]):
        data["looks"].append({"test": test, "sha256": sha256, "date": date or _today(), "locks_before": len(data["locks"])})
        _write_lock(plan, data)
    return str(min(others, default=""))
