"""Readings beside a simulation: deviations per sensor, settled and moving apart, by several sets of criteria at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.arguments import takes_objects
from thermid.errors import IdentificationError, NameNotFoundError, nearest
from thermid.fit.calibration import Calibration
from thermid.fit.uncertainty.grouping import listed
from thermid.judge.criteria import CRITERIA, CriteriaSet, Deviation, Gate, judge
from thermid.judge.overlay import Overlay, overlays, paired
from thermid.knowledge.store import model_standing
from thermid.measure import Record
from thermid.measure.windows import usual_step
from thermid.model.parts.standing import UNJUDGED, Standing

Window = tuple[float, float]
ENDS = 2.0
"""Usual steps by which readings may begin after a settled stretch does, or end before it. [-]"""


@dataclass(frozen=True)
class Exclusions:
    """Sensors that do not count, each with its reason, and how large a part of all may be left out.

    Parameters
    ----------
    reasons : dict      Sensor -> why.
    cap : float         Largest part of all sensors; the project's number, none is assumed. [-]
    """

    reasons: Mapping[str, str] = field(default_factory=dict)
    cap: float = 0.0

    def check(self, sensors: Sequence[str]) -> None:
        """Refuse an exclusion without a reason, of a sensor that is not there, or of too many.

        Raises
        ------
        IdentificationError   Which, and how many may be left out.
        """
        for sensor, reason in self.reasons.items():
            if sensor not in sensors:
                raise IdentificationError(f"'{sensor}' is excluded, but is no sensor here.{nearest(sensor, sensors)}", "exclusions")
            if not reason.strip():
                raise IdentificationError(f"'{sensor}' is excluded without a reason. Say what is wrong with it.", "exclusions")
        if len(self.reasons) > self.cap * len(sensors) + 1e-9:
            raise IdentificationError(
                f"{len(self.reasons)} of {len(sensors)} sensors are excluded, the project allows {100 * self.cap:g} %. "
                "A model that only meets its criteria without these sensors does not meet them.",
                "exclusions",
            )


@dataclass(frozen=True, eq=False)
class Correlation:
    """Readings beside a simulation.

    Parameters
    ----------
    title : str
    overlays : tuple of Overlay         Per case and sensor.
    deviations : tuple of Deviation     Per case, sensor and kind.
    gates : tuple of Gate               Every criterion of every set.
    exclusions : Exclusions
    windows : dict                      Case -> its settled stretches. [s]
    standing : Standing                 Of the values that the simulation rests on; unjudged where only its log is known.
    """

    title: str
    overlays: tuple[Overlay, ...]
    deviations: tuple[Deviation, ...]
    gates: tuple[Gate, ...]
    exclusions: Exclusions
    windows: Mapping[str, Sequence[Window]]
    standing: Standing = UNJUDGED

    @property
    def failed(self) -> tuple[Gate, ...]:
        """The gates that are not met."""
        return tuple(g for g in self.gates if g.passed is False)

    def passed(self, criteria: str) -> bool | None:
        """Return whether every gate of a set is met; None where one of them may not decide and none failed.

        Raises
        ------
        NameNotFoundError   When no such set was asked for.
        """
        own = [g.passed for g in self.gates if g.criteria == criteria]
        if not own:
            known = dict.fromkeys(g.criteria for g in self.gates)
            raise NameNotFoundError(f"nothing was judged by '{criteria}'.{nearest(criteria, known)}", self.title)
        return False if False in own else None if None in own else True

    @property
    def verdicts(self) -> dict[str, bool | None]:
        """Set of criteria -> whether it is met."""
        return {name: self.passed(name) for name in dict.fromkeys(g.criteria for g in self.gates)}

    def to_dict(self) -> dict[str, Any]:
        """Return verdicts, gates and deviations as plain numbers."""
        named = ("criteria", "kind", "case", "name", "mark", "passed", "worst", "outside")
        gates = [{k: getattr(g, k) for k in named} | {"found_K": g.found, "limit_K": g.limit} for g in self.gates]
        sizes = ("mean", "spread", "largest", "rmse")
        sensors = [
            {k: getattr(d, k) for k in ("sensor", "case", "kind", "samples", "excluded")} | {f"{k}_K": getattr(d, k) for k in sizes}
            for d in self.deviations
        ]
        return {"standing": self.standing.to_dict(), "verdicts": self.verdicts, "gates": gates, "sensors": sensors}

    def __str__(self) -> str:
        """Return deviations and verdicts as text."""
        words = {True: "met", False: "NOT met", None: "not decided"}
        lines = [self.title, *(f"  {d}" for d in self.deviations)]
        for name, passed in self.verdicts.items():
            lines.append(f"  {name}: {words[passed]}")
            lines += [f"    {g}" for g in self.gates if g.criteria == name]
        return self.standing.over("\n".join(lines))


@takes_objects
def correlate(
    readings: Sequence[Overlay] | Calibration | tuple[Record, Record],
    criteria: Sequence[str | CriteriaSet] = ("ECSS",),
    *,
    steady: Mapping[str, Sequence[Window]] | None = None,
    weights: Mapping[str, float] | None = None,
    exclusions: Exclusions | None = None,
    title: str = "correlation",
) -> Correlation:
    """Return how far readings lie from a simulation, and the verdict by every named set of criteria.

    Parameters
    ----------
    readings : overlays, Calibration or two Records   Readings with what is simulated in their place; the result of `compare`; or a
                            measured and a simulated log, whose columns of one name are compared.
    criteria : sequence     Names of `CRITERIA`, or sets of the project.
    steady : dict           Case -> settled stretches, (begin, end) each. [s]
    weights : dict          Sensor -> its weight in the means over sensors; 1 by default. [-]
    exclusions : Exclusions Sensors that do not count.
    title : str             What it is about.

    Raises
    ------
    IdentificationError   When a criterion has no data, or readings for a part of a settled stretch only; when a weight or an exclusion
                          names no sensor, or too many sensors are excluded.
    NameNotFoundError     When there is no such set of criteria.
    """
    standing = UNJUDGED
    if isinstance(readings, Calibration):
        seen, standing = overlays(readings), model_standing(readings.fitted_model)
    elif len(readings) == 2 and isinstance(readings[0], Record) and isinstance(readings[1], Record):
        seen = paired(readings[0], readings[1])
    else:
        seen = tuple(o for o in readings if isinstance(o, Overlay))
    if not seen:
        raise IdentificationError("there are no readings to compare with.", title)
    sensors = list(dict.fromkeys(o.sensor for o in seen))
    left_out = exclusions or Exclusions()
    left_out.check(sensors)
    for sensor, weight in (weights or {}).items():
        if sensor not in sensors or not weight > 0:
            raise IdentificationError(f"'{sensor}' has weight {weight:g}: a weight is above zero and belongs to a sensor.", title)
    windows = {case: tuple(several) for case, several in (steady or {}).items()}
    for case in windows:
        if case not in {o.case for o in seen}:
            raise IdentificationError(
                f"settled stretches are given for '{case}', of which there is no log.{nearest(case, [o.case for o in seen])}", title
            )
    found = []
    for o in seen:
        weight, reason = (weights or {}).get(o.sensor, 1.0), left_out.reasons.get(o.sensor, "")
        own = [w for w in windows.get(o.case, ()) if not reason or _inside(o, w).any()]
        found += [_deviation(o, "steady", w, weight, reason) for w in own]
        found.append(_deviation(o, "transient", (float(o.times[0]), float(o.times[-1])), weight, reason))
    sets = [_named(c) for c in criteria]
    gates = [g for c in sets for g in judge(c, found, title)]
    return Correlation(title, seen, tuple(found), tuple(gates), left_out, windows, standing)


def _named(criteria: str | CriteriaSet) -> CriteriaSet:
    if isinstance(criteria, CriteriaSet):
        return criteria
    if criteria not in CRITERIA:
        raise NameNotFoundError(f"no criteria '{criteria}'; there are {listed(list(CRITERIA))}.{nearest(criteria, CRITERIA)}", "criteria")
    return CRITERIA[criteria]


def _deviation(o: Overlay, kind: str, window: Window, weight: float, reason: str) -> Deviation:
    inside = _inside(o, window)
    if not inside.any():
        raise IdentificationError(
            f"the settled stretch from {window[0]:g} s to {window[1]:g} s holds no reading of '{o.sensor}' in '{o.case}'. Name another "
            "stretch, or exclude the sensor and say why.",
            o.case,
        )
    if kind == "steady" and not reason:
        _refuse_partly_read(o, window, o.times[inside])
    z = o.residuals[inside]
    case = o.case if kind == "transient" else f"{o.case}, {window[0] / 3600:.4g} .. {window[1] / 3600:.4g} h"
    levels = (float(o.measured[inside].mean()), float(o.simulated[inside].mean()))
    sizes = (float(z.std()), float(z[np.abs(z).argmax()]), float(np.sqrt(z @ z / z.size)))
    return Deviation(case, o.sensor, kind, z.size, *levels, *sizes, o.accuracy, weight, reason)


def _inside(o: Overlay, window: Window) -> NDArray[np.bool_]:
    return np.asarray((o.times >= window[0] - 1e-9) & (o.times <= window[1] + 1e-9))


def _refuse_partly_read(o: Overlay, window: Window, seen: NDArray[np.float64]) -> None:
    """Refuse a settled stretch for whose first or last part a sensor has no readings: what is not read does not agree."""
    slack = ENDS * (usual_step(o.times) if o.times.size > 1 else 0.0) + 1e-9
    if seen[0] > window[0] + slack or seen[-1] < window[1] - slack:
        raise IdentificationError(
            f"the settled stretch from {window[0]:g} s to {window[1]:g} s has readings of '{o.sensor}' in '{o.case}' from {seen[0]:g} s to "
            f"{seen[-1]:g} s only. Name a stretch that it covers, or exclude the sensor and say why.",
            o.case,
        )
