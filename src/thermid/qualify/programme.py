"""`run_plan`: a plan worked through - every test predicted and held against limits, every log against its prediction - as one verdict."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from thermid.qualify.assumptions import Assumption, assumptions
from thermid.qualify.limits import Limits
from thermid.qualify.lock import LockStatus, lock_status, note_look
from thermid.qualify.margins import Margin, margins
from thermid.qualify.plan import Plan, load_plan
from thermid.qualify.trial import Trial, tried

if TYPE_CHECKING:
    from thermid.qualify.foresight import Known

__all__ = ["Qualification", "run_plan"]


@dataclass(frozen=True, eq=False)
class Qualification:
    """A plan worked through.

    Parameters
    ----------
    plan : Plan
    lock : LockStatus               How the plan stands to its lock.
    trials : tuple of Trial         The tests, in the plan's order.
    margins : tuple of Margin       Of every reference point on both sides, over the service cases.
    assumptions : tuple             Assumed values, those that move a reference point most first.
    """

    plan: Plan
    lock: LockStatus
    trials: tuple[Trial, ...]
    margins: tuple[Margin, ...]
    assumptions: tuple[Assumption, ...]
    limits: tuple[Limits, ...] = field(repr=False, default=())

    def __getitem__(self, name: str) -> Trial:
        """Return a test by its name."""
        from thermid.errors import NameNotFoundError, nearest

        found = {t.test.name: t for t in self.trials}
        if name not in found:
            raise NameNotFoundError(f"the plan has no test '{name}'.{nearest(name, found)}", self.plan.title)
        return found[name]

    @property
    def known(self) -> Known:
        """The model with what is known of its values."""
        return self.plan.known

    @property
    def passed(self) -> bool | None:
        """Whether nothing failed; None where nothing failed but something is not decided."""
        found = [t.passed for t in self.trials] + [m.passed for m in self.margins]
        return False if False in found else None if None in found else True

    @property
    def demonstration(self) -> str:
        """Why this is no qualification of real hardware; empty where nothing speaks against it."""
        parts = []
        if self.assumptions:
            parts.append(f"{len(self.assumptions)} assumed parameters")
        if self.known.synthetic or any(t.synthetic for t in self.trials):
            parts.append("synthetic data")
        return f"demonstration: {', '.join(parts)}" if parts else ""

    @cached_property
    def worst(self) -> tuple[str, str, float, float] | None:
        """Reference point, test, time [s] and room [K] that come nearest to a limit or pass it furthest."""
        found = [
            (c.point, t.test.name, c.highest_time if c.limits[1] - c.highest <= c.lowest - c.limits[0] else c.lowest_time, c.room)
            for t in self.trials
            for c in t.checks
            if np.isfinite(c.room)
        ]
        return min(found, key=lambda f: f[3], default=None)

    def to_dict(self) -> dict[str, Any]:
        """Return verdicts, limits, margins and assumptions as plain numbers, temperatures in Celsius where a key ends in ``_C``."""
        worst = self.worst
        return {
            "schema": 1,
            "status": "ok",
            "title": self.plan.title,
            "passed": self.passed,
            "demonstration": self.demonstration,
            "plan": {"state": self.lock.state, "sha256": self.lock.sha256, "locked": self.lock.date, "changed": list(self.lock.changed)},
            "worst": None if worst is None else {"point": worst[0], "test": worst[1], "time_s": worst[2], "room_K": worst[3]},
            "tests": [t.to_dict() for t in self.trials],
            "margins": [_margin(m) for m in self.margins],
            "assumptions": [{"path": a.path, "effect_K": a.effect, "point": a.point, "test": a.run} for a in self.assumptions],
        }

    def __str__(self) -> str:
        """Return the verdicts as text."""
        words = {True: "PASSED", False: "FAILED", None: "NOT DECIDED"}
        head = f"{self.plan.title}: {words[self.passed]}"
        lines = [head + (f"  ({self.demonstration})" if self.demonstration else ""), f"  {self.lock}"]
        for t in self.trials:
            lines += [f"  {line}" for line in str(t).splitlines()]
        if self.worst is not None:
            point, test, time, room = self.worst
            left = f"{room:.1f} K left" if room >= 0 else f"{-room:.1f} K beyond its limit"
            lines.append(f"  worst: {point} in {test} at {time / 3600:.2f} h, {left}")
        lines += [f"  margin: {m}" for m in self.margins]
        lines += [f"  assumed: {a.path} = {a.text} moves {a.point} by {a.effect:.2g} K ({a.run})" for a in self.assumptions[:5]]
        return "\n".join(lines)


def _margin(m: Margin) -> dict[str, Any]:
    celsius = {"predicted_C": m.predicted - 273.15, "limit_C": m.limit - 273.15}
    sizes = {"uncertainty_K": m.uncertainty, "acceptance_K": m.policy.acceptance.value, "qualification_K": m.policy.qualification.value}
    flat = {"flat_K": m.flat.value, "flat_left_K": m.flat_left, "bought_K": m.bought}
    where = {"point": m.point, "side": m.side, "test": m.run, "time_s": m.time, "state": m.state}
    return where | celsius | sizes | {"margin_K": m.margin, "mark": m.mark, "passed": m.passed} | flat


def run_plan(
    plan: Plan | str | os.PathLike[str], *, data: str | os.PathLike[str] | None = None, notice: Callable[[str], None] | None = None
) -> Qualification:
    """Return a plan worked through: predictions, limits, margins, and the verdict on every log that has come back.

    Parameters
    ----------
    plan : Plan or path     The plan.
    data : path             A folder of logs outside the project.
    notice : callable       Called with the name of each test before it is run.

    Raises
    ------
    ThermidError   When the plan does not hold together, or a log does not fit its test.
    """
    given = plan if isinstance(plan, Plan) else load_plan(plan, data)
    trials = []
    for test in given.tests:
        if notice is not None:
            notice(test.name)
        trial = tried(given, test)
        if trial.log_sha256:
            note_look(given, test.name, trial.log_sha256)
        trials.append(trial)
    runs = {t.test.name: t.foresight for t in trials}
    service = [t for t in trials if t.test.service] or trials
    found: list[Margin] = []
    for one in given.limits:
        own: list[Margin] = []
        for t in service:
            (here,) = (x for x in t.limits if x.point == one.point)
            state = {t.test.name: "operating" if t.test.operating else "non-operating"}
            own += margins(
                {t.test.name: t.foresight}, [here], given.content.margins.policy, tested=given.content.margins.balance_tested, states=state
            )
        for side in ("cold", "hot"):
            found += sorted((m for m in own if m.side == side), key=lambda m: m.margin)[:1]
    nodes = {t.test.name: {x.node: x.point for x in t.limits} for t in trials}
    ranked = assumptions({t.test.name: t.known for t in trials}, runs, nodes)
    return Qualification(given, lock_status(given), tuple(trials), tuple(found), ranked, given.limits)
