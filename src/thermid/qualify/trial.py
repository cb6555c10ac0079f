"""`Trial`: one test of a plan with what is expected of it, its limits, and its log where one has come back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from thermid.explain.diagnosis import Diagnosis
from thermid.judge.correlation import Correlation
from thermid.judge.limits import LimitCheck, Limits
from thermid.judge.margins import HeaterDuty
from thermid.prediction.foresight import Foresight
from thermid.prediction.known import Known
from thermid.profile_runs.profile_run import ProfileRun
from thermid.sourced import VERDICTS, weigh

if TYPE_CHECKING:
    from thermid.fit.calibration import Calibration
    from thermid.qualify.plan_schema import TestTable
    from thermid.steadiness.stabilisation import Stability


@dataclass(frozen=True, eq=False)
class Trial:
    """One test of a plan.

    Parameters
    ----------
    test : TestTable                As planned.
    known : Known                   The model that it was predicted with.
    foresight : Foresight           What is expected of it.
    limits : tuple of Limits        Under their paths in that model.
    checks : tuple of LimitCheck    What is expected, and what was measured, against the limits.
    course : ProfileRun or None     Where a profile says the course: its phases.
    heaters : tuple of HeaterDuty
    outside : tuple of str          Where it leaves the conditions of the calibration.
    told : Calibration or None      Readings beside the model in what was done, where a log has come back.
    correlation : Correlation or None
    diagnosis : Diagnosis or None   What would explain the deviations, where a criterion is not met.
    log_sha256 : str                Hash of the log.
    synthetic : bool                Whether the log was made and not measured.
    doubts : tuple of str           What the log does not show: stretches without readings, levels that were not applied.
    remarks : tuple of str          What else a reader must know of the log.
    settled : tuple of Stability    Per settled stretch, what the readings say about it being settled.
    as_logged : dict                Column of a logged boundary -> its lowest and highest reading. [degC]
    after : Foresight or None       What is expected once the logs of the plan are known: with what the model could not follow in them.
    """

    test: TestTable
    known: Known
    foresight: Foresight
    limits: tuple[Limits, ...]
    checks: tuple[LimitCheck, ...]
    course: ProfileRun | None = None
    heaters: tuple[HeaterDuty, ...] = ()
    outside: tuple[str, ...] = ()
    told: Calibration | None = field(default=None, repr=False)
    correlation: Correlation | None = None
    diagnosis: Diagnosis | None = None
    log_sha256: str = ""
    synthetic: bool = False
    doubts: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    settled: tuple[Stability, ...] = ()
    as_logged: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    after: Foresight | None = field(default=None, repr=False)

    @property
    def expected(self) -> Foresight:
        """What is expected by all that is known: before any log of the plan has come back, the pre-test prediction."""
        return self.after or self.foresight

    @property
    def within(self) -> bool | None:
        """Whether no limit is passed, by what is expected and by what was measured; None where that is not decided."""
        found = [c.passed for c in self.checks] + [h.passed for h in self.heaters]
        if not self.checks or (self.course is not None and not self.course.decides):
            found.append(None)
        return weigh(found)

    @property
    def correlated(self) -> bool | None:
        """Whether every set of criteria is met; None without a log, without criteria, or where the log does not show it."""
        if self.correlation is None:
            return None
        found = list(self.correlation.verdicts.values())
        return weigh([*found, *([None] if self.doubts or not found else [])])

    @property
    def passed(self) -> bool | None:
        """Whether limits and criteria are met. A test without criteria and log is an analysis: its limits alone; see `open`."""
        return weigh([self.within, *([self.correlated] if self._judged else []), *([None] if self.open else [])])

    @property
    def _judged(self) -> bool:
        """Whether criteria have their say: a waived test is held against its limits alone."""
        return self.correlation is not None or (bool(self.test.criteria) and self.test.state != "waived")

    @property
    def open(self) -> tuple[str, ...]:
        """Why the verdict is not decided, as far as it is not; empty where nothing is open."""
        out = list(dict.fromkeys(c.undecided for c in self.checks if c.undecided))
        if not self.checks:
            out.append("no limit was held against this test")
        if self.course is not None and not self.course.decides:
            out.append(f"the course goes by numbers {self.course.trust}")
        out += [f"the power margin of heater {h.load} is from memory" for h in self.heaters if h.passed is None]
        if self._judged and self.correlation is None:
            out.append(f"no log has come back, so {', '.join(self.test.criteria)} could not be judged")
        if self.correlation is not None:
            found = self.correlation.verdicts
            out += [] if found else ["a log has come back, and no criteria judge it"]
            out += [f"the criteria {name} are from memory" for name, passed in found.items() if passed is None]
        return (*out, *self.doubts)

    @property
    def worst(self) -> LimitCheck | None:
        """The check that comes nearest to a limit."""
        return min((c for c in self.checks if np.isfinite(c.room)), key=lambda c: c.room, default=None)

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain numbers."""
        checks = [
            {
                "point": c.point,
                "state": c.state,
                "lowest_C": c.lowest - 273.15,
                "highest_C": c.highest - 273.15,
                "room_K": c.room if np.isfinite(c.room) else None,
                "by": c.by,
                "passed": c.passed,
                "crossings": [{"side": x.side, "time_s": x.time, "worst_C": x.worst - 273.15, "outside_s": x.outside} for x in c.crossings],
            }
            for c in self.checks
        ]
        out: dict[str, Any] = {"name": self.test.name, "kind": self.test.kind, "state": self.test.state, "passed": self.passed}
        out |= {"waived": self.test.state == "waived", "open": list(self.open), "remarks": list(self.remarks)}
        out |= {"within_limits": self.within, "limits": checks, "outside_calibration": list(self.outside), "correlation": None}
        if self.correlation is not None:
            out["correlation"] = self.correlation.to_dict()
            out["diagnosis"] = None if self.diagnosis is None else {"group": self.diagnosis.group, "groups": dict(self.diagnosis.groups)}
        return out

    def __str__(self) -> str:
        """Return it as text."""
        lines = [f"{self.test.name} ({self.test.kind}, {self.test.state}): limits {VERDICTS[self.within]}"]
        if self.course is not None:
            lines[0] += (
                f"; {self.course.duration / 3600:.1f} h, of it {self.course.waited / 3600:.1f} h waiting; profile: {self.course.trust}"
            )
        if self.worst is not None:
            lines.append(f"  nearest: {self.worst}")
        lines += [f"  {c}" for c in self.checks if c.crossings and c is not self.worst]
        for h in self.heaters:
            lines.append(f"  heater {h.load}: duty {100 * h.duty:.0f} %, at most {100 * h.most:.0f} %: {VERDICTS[h.passed]}")
        lines += [f"  outside the calibration: {o}" for o in self.outside]
        if self.correlation is not None:
            for name, passed in self.correlation.verdicts.items():
                failed = [str(g) for g in self.correlation.failed if g.criteria == name]
                lines.append(f"  {name}: {VERDICTS[passed]}" + (f" ({'; '.join(failed)})" if failed else ""))
            if self.diagnosis is not None:
                lines += [f"  {line}" for line in str(self.diagnosis).splitlines()]
        lines += [f"  not decided: {o}" for o in self.open]
        lines += [f"  remark: {r}" for r in self.remarks]
        return "\n".join(lines)
