"""What a profile did to a model: phases with their durations, the whole as one solution, what a reader must know of it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from thermid.base.results import PlottedTrace, Result
from thermid.base.units import ICE_POINT, Array, duration_text
from thermid.qualify._profiles.profile import ThermalProfile
from thermid.simulation.runs import Scenario, Solution, Trace


class WetSurface(Protocol):
    """Water on one surface: times (n,) [s], margin to the dew point (n,) [K], film (n,) [kg/m^2], times condensing and wet [s]."""

    @property
    def surface(self) -> str:
        """Name of the surface."""

    @property
    def gas(self) -> str:
        """Gas above it."""

    @property
    def times(self) -> Array:
        """Times (n,). [s]"""

    @property
    def margin(self) -> Array:
        """Temperature of the surface less the dew point (n,). [K]"""

    @property
    def film(self) -> Array:
        """Water on it (n,). [kg/m^2]"""

    @property
    def condensing(self) -> float:
        """Time during which water condenses. [s]"""

    @property
    def wet(self) -> float:
        """Time during which it is wet. [s]"""


class SettledWater(Protocol):
    """Moisture along a run, as the optional room of sites computes it."""

    @property
    def surfaces(self) -> Mapping[str, WetSurface]:
        """Name of a surface -> the water on it."""

    @property
    def dew_points(self) -> Mapping[str, Array]:
        """Gas -> its dew point (n,). [K]"""

    @property
    def solution(self) -> Solution:
        """The run, with the heat of condensation and evaporation."""

    @property
    def warnings(self) -> tuple[str, ...]:
        """Remarks, in words."""


@dataclass(frozen=True)
class Phase:
    """One phase of a run.

    Parameters
    ----------
    name : str                  Name of its step.
    cycle : int                 0 before the first and after the last.
    kind : str                  ``way`` (conditions change), ``wait`` (until stable) or ``stay`` (for a time).
    start, duration : float     [s]
    power : bool                Whether the unit is on.
    chamber : float             Temperature of the chamber at its end. [K]
    rule : str                  Rule of stability of a wait; empty otherwise.
    slowest : str               Of a wait, the node that was stable last.
    rate : float                Of a wait, the rate of that node at its end. [K/s]
    furthest : str              The node that is furthest from its steady temperature at the end; empty on a way.
    unfinished : float or None  Steady temperature less temperature of that node. [K]
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
        """Time at which it ends. [s]"""
        return self.start + self.duration


@dataclass(frozen=True, eq=False)
class ProfileRun(Result):
    """A profile run on a model.

    Parameters
    ----------
    profile : ThermalProfile
    phases : tuple of Phase
    scenario : Scenario             The whole course, as a scenario that can be run again.
    solution : Solution             The run of that scenario.
    moisture : td.site.Moisture     Of a humidity test, else None.
    notes : tuple of str            Remarks made while it ran.
    base : str                      The base plate; empty where none was named.
    chamber : tuple of str          Boundaries that are the chamber.
    cycles_beside : float           Cycles over the same range that other tests of the unit run.
    """

    profile: ThermalProfile
    phases: tuple[Phase, ...]
    scenario: Scenario
    solution: Solution
    moisture: SettledWater | None = field(repr=False)
    notes: tuple[str, ...]
    base: str
    chamber: tuple[str, ...]
    cycles_beside: float = 0.0

    def __getitem__(self, name: str) -> Trace:
        """Return the trace of a node over the whole run."""
        return self.solution[name]

    def __iter__(self) -> Iterator[Phase]:
        """Iterate over the phases."""
        return iter(self.phases)

    @property
    def duration(self) -> float:
        """Duration of the whole course. [s]"""
        return self.phases[-1].end if self.phases else 0.0

    @property
    def waited(self) -> float:
        """Sum of the durations of all waits. [s]"""
        return sum(p.duration for p in self.phases if p.kind == "wait")

    @property
    def remarks(self) -> tuple[str, ...]:
        """Remarks on the profile, the run and the solution."""
        level = "no base plate was named, so the levels are those of the chamber and the rule applies to the slowest node"
        waited = not self.base and any(p.kind == "wait" for p in self.phases)
        of_run = (*[level] * waited, *_ramp_remarks(self), *_unfinished_remarks(self), *_water_remarks(self))
        return (*self.profile.check(self.cycles_beside), *self.notes, *of_run, *self.solution.warnings)

    def as_object(self) -> dict[str, Any]:
        """Return the run as plain numbers for JSON: SI units, temperatures in Celsius where a key ends in ``_C``."""
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
            "mark": self.profile.mark,
            "decides": self.profile.decides,
            "trust": self.profile.trust,
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
        """The phases as a table, the extremes of every node, and remarks."""
        total = (
            f"{self.profile.title} on {self.solution.title}: {duration_text(self.duration)}, including {duration_text(self.waited)} "
            "of waiting"
        )
        wide = max(len(p.name) for p in self.phases)
        lines = [total, f"  {'at':>8}  {'for':>9}  {'cycle':>5}  {'phase':<{wide + 7}}  {'unit':<4}  {'chamber':>8}"]
        lines += [_phase_text(p, wide) for p in self.phases]
        width = max(len(n) for n in self.solution.nodes)
        for n in self.solution.nodes:
            if n not in self.chamber:
                lines.append(f"  {n:<{width}}  {self[n].lowest:8.2f} to {self[n].highest:8.2f} degC")
        lines += [f"  remark: {r}" for r in self.remarks]
        return "\n".join([*lines, f"  trust: {self.profile.trust}"])

    def _as_traces(self) -> Sequence[PlottedTrace]:
        """Return the temperature of every node over the whole run."""
        return self.solution._as_traces()


def _phase_text(p: Phase, wide: int) -> str:
    """Return a phase as a line of the table, with names `wide` characters wide."""
    name = f"{p.name}, wait" if p.kind == "wait" else p.name
    cycle, power = str(p.cycle) if p.cycle else "", "on" if p.power else "off"
    text = f"  {p.start / 3600.0:6.2f} h  {duration_text(round(p.duration, 1)):>9}  {cycle:>5}  {name:<{wide + 7}}  {power:<4}"
    text += f"  {p.chamber - ICE_POINT:8.2f}"
    if p.rule:
        text += f"   {p.slowest} at {3600.0 * p.rate:+.2f} K/h by '{p.rule}'"
    if p.unfinished is not None and abs(p.unfinished) >= 0.005:
        text += f"{';' if p.rule else '  '} {p.furthest} has {p.unfinished:+.2f} K to go"
    return text


NEGLIGIBLE_REMAINDER = 0.5
"""What is left unfinished and not worth a remark. [K]"""


def verdict_remarks(run: ProfileRun) -> tuple[str, ...]:
    """Return the remarks that belong beside a verdict: cycles, unfinished dwells, the wettest surface."""
    return (*run.profile.check(run.cycles_beside), *_unfinished_remarks(run), *_wettest_remark(run))


def _wettest_remark(run: ProfileRun) -> Iterator[str]:
    """Yield one sentence on all surfaces with condensation, naming the one with the thickest film."""
    wet_surfaces = [s for s in run.moisture.surfaces.values() if s.condensing > 0.0] if run.moisture is not None else []
    if wet_surfaces:
        worst, wet = max(wet_surfaces, key=lambda s: float(s.film.max())), max(s.wet for s in wet_surfaces)
        many = f"{len(wet_surfaces)} surfaces" if len(wet_surfaces) > 1 else "one surface"
        film = _film_text(float(worst.film.max()))
        yield f"water condenses on {many}, most on '{worst.surface}': {film}; wet for {duration_text(wet)} at most"


def _film_text(kilograms: float) -> str:
    """Return a film of water [kg/m^2] in g/m^2 with two significant digits."""
    grams = 1e3 * kilograms
    return f"{round(grams, -1):.0f} g/m^2" if grams >= 100.0 else f"{grams:.2g} g/m^2"


def _ramp_remarks(run: ProfileRun) -> Iterator[str]:
    """Yield the rates of the base plate over nine tenths of each way and its lag behind the chamber, and whether that is too slow."""
    if not run.base:
        return
    trace, lags, means = run[run.base], [], []
    for way, wait in zip(run.phases, run.phases[1:], strict=False):
        if way.kind != "way" or wait.kind != "wait":
            continue
        begin, end = float(trace.at(way.start)), float(trace.at(wait.end))
        inside = (trace.times >= way.start) & (trace.times <= wait.end)
        reach = begin + 0.9 * (end - begin)
        passed = np.flatnonzero((trace.celsius[inside] - reach) * np.sign(end - begin) >= 0.0)
        if passed.size and abs(end - begin) > 1.0:
            took = float(trace.times[inside][passed[0]]) - way.start
            means.append(0.9 * abs(end - begin) / max(took, 1.0))
            lags.append(abs(way.chamber - 273.15 - float(trace.at(way.end))))
    if not means:
        return
    yield (
        f"over nine tenths of each way '{run.base}' moves by {60.0 * min(means):.2g} to {60.0 * max(means):.2g} K/min; it is up to "
        f"{max(lags):.1f} K behind the chamber when that arrives"
    )
    if run.profile.has("ramp_least") and min(means) < run.profile.value("ramp_least"):
        yield f"that is slower than the least rate of the profile, {60.0 * run.profile.value('ramp_least'):.3g} K/min"


def _unfinished_remarks(run: ProfileRun) -> Iterator[str]:
    """Yield the largest distance from a steady temperature at the end of a wait, where it is `NEGLIGIBLE_REMAINDER` or more."""
    waits = [p for p in run.phases if p.kind == "wait" and p.unfinished is not None and abs(p.unfinished) >= NEGLIGIBLE_REMAINDER]
    if waits:
        worst = max(waits, key=lambda p: abs(p.unfinished or 0.0))
        yield (
            f"when '{worst.rule}' held in '{worst.name}', '{worst.furthest}' was still {abs(worst.unfinished or 0.0):.1f} K from its "
            "steady state, so the dwell begins before the unit has reached its temperature"
        )


def _water_remarks(run: ProfileRun) -> Iterator[str]:
    """Yield for each surface with condensation how long, when and how far it is below the dew point, and the film."""
    if run.moisture is None:
        return
    for s in run.moisture.surfaces.values():
        if s.condensing > 0.0:
            k = int(s.margin.argmin())
            yield (
                f"water condenses on '{s.surface}' for {duration_text(s.condensing)}: {-s.margin[k]:.1f} K below the dew point at "
                f"{s.times[k] / 3600.0:.2f} h; wet for {duration_text(s.wet)}, up to {_film_text(float(s.film.max()))}"
            )
