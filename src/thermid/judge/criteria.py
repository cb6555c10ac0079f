"""Sets of criteria for a correlation, each a few gates: mean and spread over sensors, every sensor, the share of sensors in a band."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from thermid.errors import IdentificationError, ScenarioError, nearest
from thermid.model.laws.signal import literal
from thermid.physics.constants import ICE_POINT
from thermid.sourced.marks import check_mark

KINDS = ("steady", "transient")
KELVIN = ("mean", "spread", "each", "rmse")
KEYS = (*KELVIN, "share", "kinds", "mark", "source")


@dataclass(frozen=True)
class Deviation:
    """How far one sensor lies from the simulation in one case.

    Parameters
    ----------
    case, sensor : str
    kind : str              'steady', the mean of a settled stretch; 'transient', every reading.
    samples : int
    measured : float        Mean of the readings. [K]
    simulated : float       Mean of the simulation. [K]
    spread : float          Standard deviation of the difference over time. [K]
    largest : float         Largest difference by size, with its sign. [K]
    rmse : float            [K]
    accuracy : float        Of the sensor. [K]
    weight : float          In the means over sensors. [-]
    excluded : str          Why it does not count; empty where it does.
    """

    case: str
    sensor: str
    kind: str
    samples: int
    measured: float
    simulated: float
    spread: float
    largest: float
    rmse: float
    accuracy: float
    weight: float = 1.0
    excluded: str = ""

    @property
    def mean(self) -> float:
        """Mean of measured less simulated. [K]"""
        return self.measured - self.simulated

    @property
    def size(self) -> float:
        """What a limit for each sensor looks at: the mean where it is settled, the largest difference where it moves. [K]"""
        return abs(self.mean) if self.kind == "steady" else abs(self.largest)

    def __str__(self) -> str:
        """Return it as a line."""
        out = f"; left out: {self.excluded}" if self.excluded else ""
        return (
            f"{self.case}, {self.sensor}, {self.kind}: measured {self.measured - ICE_POINT:.2f}, simulated "
            f"{self.simulated - ICE_POINT:.2f} degC, mean {self.mean:+.2f}, spread {self.spread:.2f}, largest {self.largest:+.2f} K{out}"
        )


@dataclass(frozen=True)
class CriteriaSet:
    """What a correlation is held to.

    Parameters
    ----------
    name : str
    mean : float            Largest mean of the deviations over sensors, by size; 0 where it is not asked. [K]
    spread : float          Largest standard deviation over sensors. [K]
    each : float            Largest deviation of every sensor: of the mean in a settled case, of any reading in a transient. [K]
    rmse : float            Largest root mean square of every sensor. [K]
    share : float           Part of the sensors that must meet `each`; 1 for all of them. [-]
    kinds : tuple of str    What it applies to: steady, transient or both.
    mark : str              How sure its numbers are, a key of `MARKS`.
    source : str            Document and clause.
    """

    name: str
    mean: float = 0.0
    spread: float = 0.0
    each: float = 0.0
    rmse: float = 0.0
    share: float = 1.0
    kinds: tuple[str, ...] = ("steady",)
    mark: str = "project"
    source: str = ""

    def __post_init__(self) -> None:
        """Refuse a set without a limit, a limit below zero, and kinds that are none.

        Raises
        ------
        ScenarioError   What is wrong.
        """
        where = f"criteria '{self.name}'"
        check_mark(self.mark, where)
        sizes = [getattr(self, k) for k in KELVIN]
        if any(not np.isfinite(s) or s < 0 for s in sizes) or not any(sizes):
            raise ScenarioError(f"a set of criteria needs a limit above zero: {', '.join(KELVIN)}.", where)
        if not 0 < self.share <= 1:
            raise ScenarioError(f"the share of sensors that must meet a limit lies above 0 and up to 1, not at {self.share:g}.", where)
        for kind in self.kinds or ("",):
            if kind not in KINDS:
                raise ScenarioError(f"criteria apply to steady or transient cases, not to '{kind}'.{nearest(kind, KINDS)}", where)


CRITERIA = {
    c.name: c
    for c in (
        CriteriaSet(
            "ECSS", 2.0, 3.0, 5.0, mark="secondary", source="practice for balance tests by a public technical note: 2 K, 3 K, below 5 K"
        ),
        CriteriaSet(
            "MIL-HDBK-340", each=3.0, mark="read", source="MIL-HDBK-340 (1985), 8.7.3: goal of +-3 C, else explain or change the model"
        ),
        CriteriaSet(
            "MIL-HDBK-340, transient",
            each=3.0,
            kinds=("transient",),
            mark="project",
            source="the goal of 8.7.3, applied to every reading; the handbook's own clause is about balance tests",
        ),
    )
}
"""Named sets; a project may give its own."""


def read_criteria(name: str, table: Mapping[str, Any], where: str) -> CriteriaSet:
    """Return the project's own set from a table: mean, spread, each, rmse with units, share, kinds, mark, source.

    Raises
    ------
    ScenarioError   When a key is unknown or nothing is asked.
    """
    for key in table:
        if key not in KEYS:
            raise ScenarioError(f"criteria have {', '.join(KEYS)}, not '{key}'.{nearest(key, KEYS)}", where)
    sizes: dict[str, Any] = {k: literal(table[k], "K", f"{where}.{k}") for k in KELVIN if k in table}
    kinds = table.get("kinds", ["steady"])
    plain: dict[str, Any] = {k: str(table[k]) for k in ("mark", "source") if k in table}
    return CriteriaSet(name, **sizes, share=float(table.get("share", 1.0)), kinds=tuple(kinds), **plain)


@dataclass(frozen=True)
class Gate:
    """One criterion of one set.

    Parameters
    ----------
    criteria, kind, case, name : str    The set; steady or transient; the case; mean, spread, each or rmse.
    found, limit : float        [K]
    worst : str                 The sensor that lies furthest out; empty for a mean.
    outside : tuple of str      Sensors beyond the limit.
    counted : int               Deviations that counted.
    met : bool                  Whether it is met.
    mark : str                  Of its limit.
    """

    criteria: str
    kind: str
    case: str
    name: str
    found: float
    limit: float
    worst: str
    outside: tuple[str, ...]
    counted: int
    met: bool
    mark: str

    @property
    def passed(self) -> bool | None:
        """Whether it is met; None where its limit is from memory and decides nothing."""
        return None if self.mark == "memory" else self.met

    def __str__(self) -> str:
        """Return the gate as a line."""
        word = "not decided: limit from memory" if self.passed is None else "met" if self.met else "NOT met"
        worst = f" at {self.worst}" if self.worst else ""
        more = f", {len(self.outside)} of {self.counted} beyond" if self.outside else ""
        return f"{self.case}, {self.kind}: {WORDS[self.name]} {self.found:.2f} K{worst}, limit {self.limit:g} K [{self.mark}]{more}: {word}"


WORDS = {"mean": "mean over sensors", "spread": "spread over sensors", "each": "largest sensor", "rmse": "largest RMSE"}
"""Gate -> what people call it."""


def judge(criteria: CriteriaSet, deviations: Sequence[Deviation], where: str) -> Iterator[Gate]:
    """Yield every gate of a set.

    Raises
    ------
    IdentificationError   When a criterion has no data.
    """
    for kind in criteria.kinds:
        counted = [d for d in deviations if d.kind == kind and not d.excluded]
        if not counted:
            how = "give its settled stretches" if kind == "steady" else "give a log"
            raise IdentificationError(f"the criteria '{criteria.name}' judge {kind} cases, and there is no data for them; {how}.", where)
        # each case by itself, or too warm in one would make up for too cold in another
        for case in dict.fromkeys(d.case for d in counted):
            yield from _gates(criteria, kind, case, [d for d in counted if d.case == case])


def _gates(c: CriteriaSet, kind: str, case: str, found: Sequence[Deviation]) -> Iterator[Gate]:
    """Yield the gates of one case."""
    weights = np.array([d.weight for d in found])
    weights = weights / weights.sum()
    means = np.array([d.mean for d in found])
    bias = float(weights @ means)
    # over sensors, and over time where they move
    inner = np.array([d.spread for d in found]) ** 2 if kind == "transient" else np.zeros(len(found))
    over = {"mean": abs(bias), "spread": float(np.sqrt(weights @ ((means - bias) ** 2 + inner)))}
    for name, size in over.items():
        limit = getattr(c, name)
        if limit:
            yield Gate(c.name, kind, case, name, size, limit, "", (), len(found), size <= limit, c.mark)
    for name in ("each", "rmse"):
        limit = getattr(c, name)
        if limit:
            sizes = [d.size if name == "each" else d.rmse for d in found]
            outside = tuple(d.sensor for d, s in zip(found, sizes, strict=True) if s > limit)
            met = len(outside) <= (1.0 - c.share) * len(found) + 1e-9
            worst = found[int(np.argmax(sizes))].sensor
            yield Gate(c.name, kind, case, name, max(sizes), limit, worst, outside, len(found), met, c.mark)
