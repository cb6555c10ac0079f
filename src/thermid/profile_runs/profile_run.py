"""What a profile did to a model: phases with their durations, the whole as one solution, what the rules left unfinished."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from thermid.measure.amounts import duration_text
from thermid.physics.constants import ICE_POINT

if TYPE_CHECKING:
    from thermid.profiles.profile import ThermalProfile
    from thermid.simulation.scenarios.scenario import Scenario
    from thermid.simulation.solution import Solution, Trace
    from thermid.simulation.water.moisture import Moisture

__all__ = ["Phase", "ProfileRun"]


@dataclass(frozen=True)
class Phase:
    """One phase of a run.

    Parameters
    ----------
    name : str                  Of its step.
    cycle : int                 0 before the first and after the last.
    kind : str                  ``way`` (conditions change), ``wait`` (until stable) or ``stay`` (for a time).
    start, duration : float     [s]
    power : bool                Whether the unit is on.
    chamber : float             Temperature of the chamber at its end. [K]
    rule : str                  What was waited for; empty otherwise.
    slowest : str               Of a wait, the node that held it up.
    rate : float                Of a wait, how fast that node still changes at its end. [K/s]
    furthest : str              The node that is furthest from where it would settle; empty on a way.
    unfinished : float or None  How far that is: what the rule left unfinished. [K]
    base : float or None        Temperature of the base plate at its end. [K]
    """

    name: str
    cycle: int
    kind: str
    start: float
    duration: float
    power: bool
    chamber: float
    rule: str = ""
    slowest: str = ""
    rate: float = 0.0
    furthest: str = ""
    unfinished: float | None = None
    base: float | None = None

    @property
    def end(self) -> float:
        """[s]"""
        return self.start + self.duration


@dataclass(frozen=True, eq=False)
class ProfileRun:
    """A profile run on a model.

    Parameters
    ----------
    profile : ThermalProfile
    phases : tuple of Phase
    scenario : Scenario         The whole course, as a scenario that can be run again.
    solution : Solution         The whole course.
    moisture : Moisture or None Of a humidity test.
    notes : tuple of str        What came up while it ran.
    base : str                  The base plate; empty where none was named.
    chamber : tuple of str      Boundaries that are the chamber.
    cycles_beside : float       Cycles over the same range that other tests of the unit run.
    """

    profile: ThermalProfile
    phases: tuple[Phase, ...]
    scenario: Scenario
    solution: Solution
    moisture: Moisture | None = field(repr=False)
    notes: tuple[str, ...]
    base: str
    chamber: tuple[str, ...]
    cycles_beside: float = 0.0

    def __getitem__(self, name: str) -> Trace:
        """Return the trace of a node over the whole run."""
        return self.solution[name]

    def __iter__(self) -> Iterator[Phase]:
        """Go through the phases."""
        return iter(self.phases)

    @property
    def duration(self) -> float:
        """[s]"""
        return self.phases[-1].end if self.phases else 0.0

    @property
    def mark(self) -> str:
        """The weakest mark of the profile's numbers."""
        return self.profile.mark

    @property
    def decides(self) -> bool:
        """Whether a verdict may rest on it: no number of the profile comes from memory."""
        return self.profile.decides

    @property
    def trust(self) -> str:
        """Say in words how far the profile's numbers can be relied on."""
        return self.profile.trust

    @property
    def waited(self) -> float:
        """Time spent waiting for the unit. [s]"""
        return sum(p.duration for p in self.phases if p.kind == "wait")

    @property
    def remarks(self) -> tuple[str, ...]:
        """What a reader must know: of the profile, of the run, of the solution."""
        from thermid.profile_runs.remarks import run_remarks

        return run_remarks(self)

    def as_object(self) -> dict[str, Any]:
        """Return the run as JSON holds it: SI units, temperatures in Celsius where a key ends in ``_C``."""
        phases = [
            {
                "name": p.name,
                "cycle": p.cycle,
                "kind": p.kind,
                "start": p.start,
                "duration": p.duration,
                "power": p.power,
                "chamber_C": p.chamber - ICE_POINT,
                "rule": p.rule or None,
                "slowest": p.slowest or None,
                "rate": p.rate if p.rule else None,
                "furthest": p.furthest or None,
                "unfinished": p.unfinished,
                "base_C": None if p.base is None else p.base - ICE_POINT,
            }
            for p in self.phases
        ]
        nodes = {n: {"lowest_C": self[n].lowest, "highest_C": self[n].highest} for n in self.solution.nodes}
        balance = self.solution.heat_balance()
        return {
            "profile": self.profile.title,
            "mark": self.mark,
            "decides": self.decides,
            "trust": self.trust,
            "duration": self.duration,
            "waited": self.waited,
            "phases": phases,
            "nodes": nodes,
            "heat_balance": {
                "loads": balance.loads,
                "boundaries": balance.boundaries,
                "stored": balance.stored,
                "relative": balance.relative,
            },
            "remarks": list(self.remarks),
        }

    def __str__(self) -> str:
        """The phases as a table, and the extremes of every node."""
        total = (
            f"{self.profile.title} on {self.solution.title}: {duration_text(self.duration)}, of it {duration_text(self.waited)} of waiting"
        )
        wide = max(len(p.name) for p in self.phases)
        lines = [total, f"  {'at':>8}  {'for':>9}  {'cycle':>5}  {'phase':<{wide + 7}}  {'unit':<4}  {'chamber':>8}"]
        lines += [_line(p, wide) for p in self.phases]
        width = max(len(n) for n in self.solution.nodes)
        for n in self.solution.nodes:
            if n not in self.chamber:
                lines.append(f"  {n:<{width}}  {self[n].lowest:8.2f} to {self[n].highest:8.2f} degC")
        lines += [f"  remark: {r}" for r in self.remarks]
        return "\n".join([*lines, f"  trust: {self.trust}"])


def _line(p: Phase, wide: int) -> str:
    """Return one phase as a line."""
    name = f"{p.name}, wait" if p.kind == "wait" else p.name
    cycle, power = str(p.cycle) if p.cycle else "", "on" if p.power else "off"
    text = f"  {p.start / 3600.0:6.2f} h  {duration_text(round(p.duration, 1)):>9}  {cycle:>5}  {name:<{wide + 7}}  {power:<4}"
    text += f"  {p.chamber - ICE_POINT:8.2f}"
    if p.rule:
        text += f"   {p.slowest} at {3600.0 * p.rate:+.2f} K/h by '{p.rule}'"
    if p.unfinished is not None and abs(p.unfinished) >= 0.005:
        text += f"{';' if p.rule else '  '} {p.furthest} has {p.unfinished:+.2f} K to go"
    return text
