"""The picture of a profile's run: temperatures with its phases shaded."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from thermid.physics.constants import ICE_POINT
from thermid.profile_runs.profile_run import Phase, ProfileRun
from thermid.reporting.pictures.figures import DASHES, GRID, INK, RESIDUAL, SERIES, SIMULATED, SOFT, time_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST = 6
"""Nodes drawn; those with the widest swings."""
SHADES = {
    "way": (GRID, "on the way"),
    "wait": (RESIDUAL, "waiting for the unit"),
    "stay": (SIMULATED, "dwell"),
    "off": (INK, "switched off"),
}


def draw_run(figure: Figure, run: ProfileRun) -> None:
    """Draw the chamber and the nodes over time, phases as shades with a strip above that names them."""
    grid = figure.add_gridspec(2, 1, height_ratios=(1, 14), hspace=0.02)
    strip: Axes = figure.add_subplot(grid[0])
    axis: Axes = figure.add_subplot(grid[1])
    length, name = time_unit(run.duration)
    seen: dict[str, Any] = {}
    for phase in run.phases:
        colour, label = SHADES[_shade(phase)]
        for at, alpha in ((strip, 0.75), (axis, 0.13)):
            span = at.axvspan(phase.start / length, phase.end / length, color=colour, alpha=alpha, linewidth=0)
        seen.setdefault(label, span)
    _strip(strip, run, length)
    nodes = [n for n in run.solution.nodes if n not in run.chamber]
    swings = sorted(nodes, key=lambda n: run[n].lowest - run[n].highest)
    drawn = ([run.base] if run.base else []) + [n for n in swings if n != run.base]
    trace = run[run.chamber[0]]
    axis.plot(trace.times / length, trace.celsius, color=SOFT, linewidth=1.0, label=f"chamber ({run.chamber[0]})")
    for k, node in enumerate(drawn[:MOST]):
        trace = run[node]
        label = f"{node} (base plate)" if node == run.base else node
        times, kelvin = trace.course
        (line,) = axis.plot(times / length, kelvin - ICE_POINT, color=SERIES[k % len(SERIES)], linewidth=1.6, label=label)
        if DASHES[k % len(DASHES)]:
            line.set_dashes(DASHES[k % len(DASHES)])
    used = run.profile.used
    for side in ("hot", "cold"):
        if side in used:
            level = float(used[side].value) - ICE_POINT
            axis.axhline(level, color=INK, linewidth=0.8, linestyle=":")
            axis.text(run.duration / length, level, f"{side} {level:.4g} degC ", va="bottom", ha="right", fontsize=8, color=INK)
    axis.set_xlim(0.0, run.duration / length)
    axis.set_xlabel(f"time, {name}")
    axis.set_ylabel("temperature, degC")
    handles, labels = axis.get_legend_handles_labels()
    axis.legend(handles + list(seen.values()), labels + list(seen), loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=4, fontsize=8)
    strip.set_title(_title(run), loc="left")
    if not run.decides:
        look: dict[str, Any] = {"color": SOFT, "alpha": 0.16, "fontsize": 24, "rotation": 24, "weight": "bold"}
        figure.text(0.5, 0.5, "NUMBERS FROM MEMORY", ha="center", va="center", **look)


def _title(run: ProfileRun) -> str:
    """Return what was run, for how long, and how much of it was waiting."""
    long, waited = run.duration / 3600.0, run.waited / 3600.0
    return (
        f"{run.profile.title} on {run.solution.title}\n{long:.1f} h, {waited:.1f} h of it waiting for the unit; weakest number: {run.mark}"
    )


def _shade(phase: Phase) -> str:
    """Return which shade a phase has."""
    return "off" if not phase.power else phase.kind


def _strip(strip: Axes, run: ProfileRun, length: float) -> None:
    """Name the cycles in the strip, where there is room for it."""
    strip.set_xlim(0.0, run.duration / length)
    strip.set_axis_off()
    for cycle in sorted({p.cycle for p in run.phases if p.cycle}):
        own = [p for p in run.phases if p.cycle == cycle]
        begin, end = own[0].start, own[-1].end
        strip.axvline(begin / length, color=INK, linewidth=0.8)
        if (end - begin) > 0.03 * run.duration:
            strip.text(0.5 * (begin + end) / length, 0.5, str(cycle), ha="center", va="center", fontsize=8, color=INK)
