"""The lock of a plan: its hash and date before any log is read, every look at a log since, and what was changed afterwards."""

from __future__ import annotations

import json
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from thermid.arguments import takes_objects
from thermid.errors import DeckError
from thermid.files import OWN, write_text
from thermid.qualify.plan import Plan


@dataclass(frozen=True)
class LockStatus:
    """How a plan stands to its lock.

    Parameters
    ----------
    state : str             open (never locked), locked, changed (since, no log looked at), late (logs looked at before it was locked),
                            moved (changed after logs were looked at).
    date : str              Of the lock that counts: the last one before the first look.
    looked : str            When a log was first looked at; empty where none was.
    changed : tuple of str  Keys that differ from that lock.
    sha256 : str            Hash of the plan as it is.
    """

    state: str
    date: str
    looked: str
    changed: tuple[str, ...]
    sha256: str

    @property
    def sound(self) -> bool:
        """Whether what is judged by is what was planned before any log was looked at."""
        return self.state == "locked"

    def __str__(self) -> str:
        """Return it in words."""
        keys = ", ".join(self.changed[:6]) + (f" and {len(self.changed) - 6} more" if len(self.changed) > 6 else "")
        return {
            "open": "the plan is not locked: lock it before any log is read (thermid plan ... --lock)",
            "locked": f"the plan is as it was locked on {self.date}, hash {self.sha256[:12]}"
            + (", before any log was looked at" if self.looked else "; no log was looked at yet"),
            "changed": f"the plan was changed since it was locked on {self.date}: {keys}; no log was looked at yet, lock it again",
            "late": "another plan of this folder had looked at its logs before it was locked: it does not show what was decided beforehand"
            if self.date
            else f"logs were looked at on {self.looked} before the plan was locked: it does not show what was decided beforehand",
            "moved": f"THE PLAN WAS CHANGED AFTER LOGS WERE LOOKED AT on {self.looked}: {keys}; it was locked on {self.date}",
        }[self.state]


def _file(plan: Plan) -> Path:
    return plan.path.with_suffix(".lock.json")


def _read(plan: Plan) -> dict[str, Any]:
    file = _file(plan)
    if not file.is_file():
        return {"schema": 1, "locks": [], "looks": []}
    try:
        data: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
        return {"schema": 1, "locks": list(data["locks"]), "looks": list(data["looks"])} | data
    except (ValueError, KeyError, TypeError):
        raise DeckError(
            "it is no lock of a plan any more. Take it from the version control; a new one would forget the looks.", file.name
        ) from None


def _write(plan: Plan, data: dict[str, Any]) -> None:
    write_text(_file(plan), json.dumps(data, indent=1, sort_keys=True), OWN)


def _today() -> str:
    return datetime.now(UTC).date().isoformat()


@takes_objects
def lock_plan(plan: Plan, predictions: dict[str, Any] | None = None, date: str = "") -> Path:
    """Write what is planned with its hash, the date and the pre-test predictions beside the plan, and return the file.

    Older locks and all looks at logs are kept; locking again after a look does not make a plan older than it is.

    Parameters
    ----------
    plan : Plan
    predictions : dict  What was predicted of each test, as plain numbers.
    date : str          The day; today by default.
    """
    data = _read(plan)
    if not data["locks"] or data["locks"][-1]["sha256"] != plan.sha256:
        entry = {"sha256": plan.sha256, "date": date or _today(), "planned": plan.planned, "predictions": predictions or {}}
        entry["looked_beside"] = _beside(plan)
        data["locks"].append(entry)
        _write(plan, data)
    return _file(plan)


def _beside(plan: Plan) -> list[str]:
    """Return the hashes of logs that other plans of the folder have looked at; a copy of a plan does not unsee them."""
    lock_file, hashes = _file(plan), set()
    for file in sorted(lock_file.parent.glob("*.lock.json")):
        if file == lock_file:
            continue
        try:
            hashes |= {str(look["sha256"]) for look in json.loads(file.read_text(encoding="utf-8"))["looks"]}
        except (ValueError, KeyError, TypeError):
            continue
    return sorted(hashes)


def note_look(plan: Plan, test: str, sha256: str, date: str = "") -> str:
    """Note that the log of a test was looked at; return when another log of that test was first looked at, or an empty text.

    The same log again is no new look.
    """
    data = _read(plan)
    others = [one["date"] for one in data["looks"] if one["test"] == test and one["sha256"] != sha256]
    if all((one["test"], one["sha256"]) != (test, sha256) for one in data["looks"]):
        data["looks"].append({"test": test, "sha256": sha256, "date": date or _today(), "locks_before": len(data["locks"])})
        _write(plan, data)
    return str(min(others, default=""))


def lock_status(plan: Plan) -> LockStatus:
    """Return how a plan stands to its lock."""
    data = _read(plan)
    locks, looks = data["locks"], data["looks"]
    looked = looks[0]["date"] if looks else ""
    before = locks[: looks[0]["locks_before"]] if looks else locks
    if not before:
        return LockStatus("late" if looks else "open", "", looked, (), plan.sha256)
    base = before[-1]
    if {look["sha256"] for look in looks} & {*base.get("looked_beside", [])}:
        return LockStatus("late", base["date"], looked, (), plan.sha256)
    old, new = base["planned"], plan.planned
    changed = tuple(sorted(k for k in {*old, *new} if old.get(k) != new.get(k)))
    state = "locked" if not changed else "moved" if looks else "changed"
    return LockStatus(state, base["date"], looked, changed, plan.sha256)
