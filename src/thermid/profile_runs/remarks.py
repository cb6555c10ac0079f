"""What a reader of a profile's run must know: ramps that the unit did not follow, dwells that begin before the end, condensation."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from thermid.measure.amounts import duration_text

if TYPE_CHECKING:
    from thermid.profile_runs.profile_run import ProfileRun

__all__ = ["in_short", "run_remarks"]

SMALL = 0.5
"""What is left unfinished and not worth a remark. [K]"""


def run_remarks(run: ProfileRun) -> tuple[str, ...]:
    """Return the remarks about a run."""
    return (
        *run.profile.check(run.cycles_beside),
        *run.notes,
        *_level(run),
        *_ramp(run),
        *_unfinished(run),
        *_wet(run),
        *run.solution.warnings,
    )


def in_short(run: ProfileRun) -> tuple[str, ...]:
    """Return what belongs beside the verdict of a run: cycles, what dwells leave unfinished, where water settles."""
    return (*run.profile.check(run.cycles_beside), *_unfinished(run), *_wettest(run))


def _wettest(run: ProfileRun) -> Iterator[str]:
    """Say in one line where most water settles."""
    found = [s for s in run.moisture.surfaces.values() if s.condensing > 0.0] if run.moisture is not None else []
    if found:
        worst, wet = max(found, key=lambda s: float(s.film.max())), max(s.wet for s in found)
        many = f"{len(found)} surfaces" if len(found) > 1 else "one surface"
        film = _film(float(worst.film.max()))
        yield f"water settles on {many}, most on '{worst.surface}': {film}; wet for {duration_text(wet)} at most"


def _film(kilograms: float) -> str:
    """Return a film of water in words; two digits."""
    grams = 1e3 * kilograms
    return f"{round(grams, -1):.0f} g/m^2" if grams >= 100.0 else f"{grams:.2g} g/m^2"


def _level(run: ProfileRun) -> Iterator[str]:
    """Say where the levels hold when no base plate was named."""
    waits = [p for p in run.phases if p.kind == "wait"]
    if waits and not run.base:
        yield "no base plate was named: the levels are those of the chamber, and the rule waits for the slowest node"


def _ramp(run: ProfileRun) -> Iterator[str]:
    """Compare how fast the base plate went from level to level with what the profile asks for, and say by how much it lags."""
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
        yield f"that is slower than the {60.0 * run.profile.value('ramp_least'):.3g} K/min that the profile asks for at least"


def _unfinished(run: ProfileRun) -> Iterator[str]:
    """Say what the rule of stability left to go when a dwell began."""
    left = [p for p in run.phases if p.kind == "wait" and p.unfinished is not None and abs(p.unfinished) >= SMALL]
    if left:
        worst = max(left, key=lambda p: abs(p.unfinished or 0.0))
        yield (
            f"when '{worst.rule}' held in '{worst.name}', '{worst.furthest}' was still {abs(worst.unfinished or 0.0):.1f} K from where it "
            "settles: the dwell begins before the unit is at its temperature"
        )


def _wet(run: ProfileRun) -> Iterator[str]:
    """Say where water settles in a humidity test."""
    if run.moisture is None:
        return
    for s in run.moisture.surfaces.values():
        if s.condensing > 0.0:
            k = int(s.margin.argmin())
            yield (
                f"water settles on '{s.surface}' for {duration_text(s.condensing)}: {-s.margin[k]:.1f} K below the dew point at "
                f"{s.times[k] / 3600.0:.2f} h; wet for {duration_text(s.wet)}, up to {_film(float(s.film.max()))}"
            )
