"""Pictures of how far a fit can be trusted: the profile of a parameter, residuals, a hold."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from thermid.base.errors import ThermidError
from thermid.base.files import FileKinds
from thermid.base.units import HOUR, ICE_POINT, from_si, unit
from thermid.inference.criticism import Criticism
from thermid.inference.intervals import Profile
from thermid.measure.looks import Look
from thermid.prediction.members import Hold, clock
from thermid.qualify.profiles import ProfileRun
from thermid.reporting._blocks.content import extra
from thermid.reporting._pictures.chart import DASHES, SERIES, time_unit
from thermid.reporting._pictures.figures import GRID, INK, RESIDUAL, SIMULATED, SOFT
from thermid.reporting._pictures.log import log_drawing

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


SHADE = 0.13
"""How opaque an area behind lines is. [-]"""


def picture(thing: Profile | Criticism | Hold | ProfileRun | Look, to: str | os.PathLike[str]) -> Path:
    """Write the picture of a profile, a criticism, a hold, a profile's run (png, svg, pdf) or a look at a log (svg), and return its path.

    Parameters
    ----------
    thing : Profile, Criticism, Hold, ProfileRun or Look  What to draw; of a criticism, the trace that is least like noise.
    to : path  File to write.

    Raises
    ------
    ThermidError        When there is no picture of such a thing, or nothing of a log is known that could be drawn.
    OutputError         When the name of the file does not end in png, svg or pdf; of a log, in svg.
    MissingExtraError   When matplotlib is not installed.
    """
    if isinstance(thing, Look):
        return FileKinds.DRAWING.save_text(FileKinds.DRAWING.check_ending(to), log_drawing(thing) + "\n")
    drawers: dict[type, Any] = {Profile: _profile, Criticism: _criticism, Hold: draw_hold, ProfileRun: draw_run}
    if type(thing) not in drawers:
        raise ThermidError(
            f"a {type(thing).__name__} has no picture. There are pictures of {', '.join(t.__name__ for t in (*drawers, Look))}.",
            code="value.wrong-kind",
        )
    target = FileKinds.PICTURE.check_ending(to)
    with _canvas() as figure:
        drawers[type(thing)](figure, thing)
        drawn = BytesIO()
        figure.savefig(drawn, format=target.suffix.lower()[1:], dpi=144, metadata={"Date": None} if target.suffix == ".svg" else None)
    return FileKinds.PICTURE.save_bytes(target, drawn.getvalue())


@contextmanager
def _canvas() -> Iterator[Figure]:
    """Yield a figure under settings that leave no trace."""
    with extra():
        import matplotlib
        from matplotlib.figure import Figure
    settings: Any = {
        "text.parse_math": False,
        "text.color": INK,
        "axes.edgecolor": SOFT,
        "axes.labelcolor": INK,
        "axes.titlesize": "medium",
        "axes.titlecolor": INK,
        "xtick.color": SOFT,
        "ytick.color": SOFT,
        "axes.grid": True,
        "axes.axisbelow": True,
        "grid.color": GRID,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "legend.frameon": False,
        "svg.hashsalt": "thermid",
    }
    with matplotlib.rc_context(settings):
        yield Figure(figsize=(7.2, 4.8), facecolor="white", layout="constrained")


def _profile(figure: Figure, profile: Profile) -> None:
    """Draw how much worse the fit gets as a parameter moves, with the interval and what the standard error alone would say."""
    axis: Axes = figure.subplots()
    x = from_si(profile.values, profile.unit)
    best, low, high = (float(from_si(v, profile.unit)) for v in (profile.best, profile.low, profile.high))
    error = profile.error / float(unit(profile.unit).factor)
    axis.axvspan(low, high, color=SIMULATED, alpha=SHADE, linewidth=0)
    parabola = np.linspace(min(x.min(), best - 2 * error), max(x.max(), best + 2 * error))
    axis.plot(parabola, ((parabola - best) / error) ** 2, color=SOFT, linestyle="--", label="by the standard error alone")
    axis.plot(x, profile.rise, color=SIMULATED, marker="o", label="all others refitted")
    axis.axhline(profile.threshold, color=RESIDUAL)
    axis.text(x.max(), profile.threshold, f"{100 * profile.level:.3g} % ", color=RESIDUAL, va="bottom", ha="right")
    axis.plot([best], [0.0], marker="D", color=RESIDUAL, linestyle="none", label="best fit")
    axis.set_ylim(top=min(axis.get_ylim()[1], 4.0 * profile.threshold))
    for ok, end, side in zip(profile.limited, (low, high), ("no lower limit", "no upper limit"), strict=True):
        if not ok:
            axis.text(end, 0.0, f" {side} ", color=RESIDUAL, ha="left" if side.startswith("no l") else "right")
    axis.set_xlabel(f"{profile.path}, {profile.unit}")
    axis.set_ylabel("increase of the weighted sum of squares")
    axis.legend(loc="upper center")


def _criticism(figure: Figure, criticism: Criticism) -> None:
    """Draw the residuals of the worst trace against time, temperature and power."""
    worst = min(criticism.traces, key=lambda t: (t.is_noise, t.statistics.white, t.statistics.effective_samples / t.statistics.samples))
    size, unit_name = time_unit(float(worst.times[-1] - worst.times[0]))
    axes = figure.subplot_mosaic([["time", "time"], ["temperature", "power"]])
    figure.suptitle(f"{criticism.title}: {worst.sensor} in {worst.record}")
    panels = (
        ("time", worst.times / size, f"time, {unit_name}"),
        ("temperature", worst.temperature - ICE_POINT, "predicted temperature, °C"),
        ("power", worst.power, "power, W"),
    )
    for name, x, label in panels:
        axis = axes[name]
        axis.axhline(0.0, color=SOFT)
        axis.plot(x, worst.residuals, "-" if name == "time" else ".", color=RESIDUAL)
        axis.set_xlabel(label)
        axis.set_ylabel("residual, K")
        slope, error = worst.slopes.get(name, (0.0, 0.0))
        if error > 0:
            along = np.array([x.min(), x.max()])
            step = slope * size if name == "time" else slope
            axis.plot(along, worst.residuals.mean() + step * (along - x.mean()), color=SIMULATED)
            axis.set_title(f"slope {abs(slope) / error:.1f} standard errors", loc="right", fontsize="small")
        elif np.ptp(x) == 0:
            axis.set_title("power was constant", loc="right", fontsize="small")


MAX_LIMITS_DRAWN = 6
"""Limits drawn; those that are passed first."""


def draw_hold(figure: Figure, hold: Hold) -> None:
    """Draw the curves of the limits that are passed first, with the hold time of the first, and what drives it."""
    axis: Axes = figure.subplots()
    length, name = time_unit(float(hold.times[-1]))
    passed = [p for p in hold.points[:MAX_LIMITS_DRAWN] if p.exceedance[-1] > 0.0] or [hold.points[0]]
    if hold.watermark:
        _watermark(figure, hold.watermark.upper())
    for k, p in enumerate(passed):
        dash = DASHES[k % len(DASHES)]
        label, colour = f"{p.name}, {p.limit:g} degC", SERIES[k % len(SERIES)]
        # through every crossing, up to the end of the scenario
        ordered = np.sort(p.crossings[np.isfinite(p.crossings)])
        times = np.concatenate(([hold.times[0]], ordered, [hold.times[-1]])) / length
        exceeded = 100.0 * np.concatenate(([0.0], np.arange(1.0, ordered.size + 1.0), [float(ordered.size)])) / p.crossings.size
        (line,) = axis.plot(times, exceeded, color=colour, label=label, drawstyle="steps-post")
        if dash:
            line.set_dashes(dash)
    share = 100.0 * (1.0 - hold.confidence)
    axis.axhline(share, color=SOFT, linestyle=":")
    axis.text(hold.times[-1] / length, share, f"{share:g} % ", color=SOFT, va="bottom", ha="right")
    until, (low, high) = hold.together.hold, hold.together.between
    if math.isfinite(until):
        axis.axvspan(low / length, min(high, hold.times[-1]) / length, color=INK, alpha=SHADE, linewidth=0)
        axis.axvline(until / length, color=INK)
        axis.text(
            until / length, 1.0, f"{clock(until)} ", transform=axis.get_xaxis_transform(), ha="right", va="top", color=INK, weight="bold"
        )
    axis.set_xlim(hold.times[0] / length, hold.times[-1] / length)
    axis.set_ylim(bottom=0.0)
    axis.set_xlabel(f"time, {name}")
    axis.set_ylabel("probability that the limit was exceeded, %")
    driven = ", ".join(hold.together.drivers_text.split(", ")[:3])
    axis.set_title(hold.sentence + (f"\ndriven by {driven}" if driven else ""), loc="left")
    axis.legend(loc="best")


SHADES = {
    "way": (GRID, "on the way"),
    "wait": (RESIDUAL, "waiting for the unit"),
    "stay": (SIMULATED, "dwell"),
    "off": (INK, "switched off"),
}


def draw_run(figure: Figure, run: ProfileRun) -> None:
    """Draw the chamber and the nodes over time, phases as shades with a strip above that names them."""
    grid = figure.add_gridspec(2, 1, height_ratios=(1, 14))
    strip: Axes = figure.add_subplot(grid[0])
    axis: Axes = figure.add_subplot(grid[1])
    length, name = time_unit(run.duration)
    handle_of_label: dict[str, Any] = {}
    for phase in run.phases:
        colour, label = SHADES[phase.kind if phase.power else "off"]
        for at, alpha in ((strip, 0.75), (axis, SHADE)):
            span = at.axvspan(phase.start / length, phase.end / length, color=colour, alpha=alpha, linewidth=0)
        handle_of_label.setdefault(label, span)
    _strip(strip, run, length)
    nodes = [n for n in run.solution.nodes if n not in run.chamber]
    swings = sorted(nodes, key=lambda n: run[n].lowest - run[n].highest)
    drawn = ([run.base] if run.base else []) + [n for n in swings if n != run.base]
    trace = run[run.chamber[0]]
    axis.plot(trace.times / length, trace.celsius, color=SOFT, label=f"chamber ({run.chamber[0]})")
    for k, node in enumerate(drawn[:MAX_LIMITS_DRAWN]):
        trace = run[node]
        label = f"{node} (base plate)" if node == run.base else node
        times, kelvin = trace.course
        (line,) = axis.plot(times / length, kelvin - ICE_POINT, color=SERIES[k % len(SERIES)], label=label)
        if DASHES[k % len(DASHES)]:
            line.set_dashes(DASHES[k % len(DASHES)])
    used = run.profile.used
    for side in ("hot", "cold"):
        if side in used:
            level = float(used[side].value) - ICE_POINT
            axis.axhline(level, color=INK, linestyle=":")
            axis.text(run.duration / length, level, f"{side} {level:.4g} degC ", va="bottom", ha="right", fontsize="small", color=INK)
    axis.set_xlim(0.0, run.duration / length)
    axis.set_xlabel(f"time, {name}")
    axis.set_ylabel("temperature, degC")
    handles, labels = axis.get_legend_handles_labels()
    handles, labels = handles + list(handle_of_label.values()), labels + list(handle_of_label)
    figure.legend(handles, labels, loc="outside lower center", ncols=4, fontsize="small")
    long, waited = run.duration / HOUR, run.waited / HOUR
    strip.set_title(
        f"{run.profile.title} on {run.solution.title}\n{long:.1f} h, {waited:.1f} h of it waiting for the unit; "
        f"weakest number: {run.profile.mark}",
        loc="left",
    )
    if not run.profile.decides:
        _watermark(figure, "NUMBERS FROM MEMORY")


def _watermark(figure: Figure, text: str) -> None:
    """Write a text across a picture whose numbers nobody should quote."""
    figure.text(0.5, 0.5, text, color=SOFT, alpha=SHADE, fontsize="xx-large", rotation=24.0, ha="center", va="center", weight="bold")


def _strip(strip: Axes, run: ProfileRun, length: float) -> None:
    """Name the cycles in the strip, where there is room for it."""
    strip.set_xlim(0.0, run.duration / length)
    strip.set_axis_off()
    for cycle in sorted({p.cycle for p in run.phases if p.cycle}):
        phases = [p for p in run.phases if p.cycle == cycle]
        begin, end = phases[0].start, phases[-1].end
        strip.axvline(begin / length, color=INK)
        if (end - begin) > 0.03 * run.duration:
            strip.text(0.5 * (begin + end) / length, 0.5, str(cycle), ha="center", va="center", fontsize="small", color=INK)
