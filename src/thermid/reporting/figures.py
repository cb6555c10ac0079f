"""Figures of a report: measured against simulated, RMSE by stage, predictions. Drawing is thinned; statistics never are."""

from __future__ import annotations

import base64
import io
import re
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from html import escape
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from thermid.identify.residuals import Block
from thermid.physics.constants import ICE_POINT
from thermid.reporting.extras import extra

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

    from thermid.simulation.solution import Solution

__all__ = ["Dots", "Drawn", "Entry", "canvas", "choose", "draw_line", "markup_of", "overview", "prediction", "thinned", "time_unit"]
__all__ += ["trace"]

Array = NDArray[np.float64]

INK, SOFT, GRID, MEASURED, SIMULATED, RESIDUAL = "#1c2430", "#5a6675", "#d8dee6", "#a9b4c0", "#0072b3", "#c04a01"
SERIES = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#7a5c00", "#56b4e9", "#7b4fa3", "#222e3c")
"""Okabe and Ito's colours (Color Universal Design, 2008), the yellow and orange of too little contrast on white replaced."""
VARIABLES: Mapping[str, str] = {
    INK: "--f-ink",
    SOFT: "--f-soft",
    GRID: "--f-grid",
    MEASURED: "--f-measured",
    SIMULATED: "--f-simulated",
    RESIDUAL: "--f-residual",
    **{colour: f"--s{k}" for k, colour in enumerate(SERIES)},
}
DASHES: tuple[tuple[float, ...], ...] = ((), (6, 2), (2, 1.5), (7, 2, 2, 2))
MARKS = ("o", "s", "^", "D", "v", "P", "X", "*")
POINTS, VECTOR_LIMIT, MOST_TRACES = 360, 20_000, 12


@dataclass(frozen=True)
class Entry:
    """One line of a legend: what it is, the variable of its colour, and its mark, if it is not a line."""

    label: str
    variable: str
    dash: str = ""
    mark: str = ""


@dataclass(frozen=True)
class Drawn:
    """A figure as markup to stand in the page.

    Parameters
    ----------
    markup : str                    An inline SVG, or an image with its data inside.
    legend : tuple of Entry         What the colours mean.
    points : int                    How many points were drawn.
    """

    markup: str
    legend: tuple[Entry, ...]
    points: int


@dataclass(frozen=True)
class Dots:
    """One line of the overview: a stage or its held-out records.

    Parameters
    ----------
    label : str         Name.
    values : dict       Sensor -> RMSE of each record. [K]
    held_out : bool     Whether no fit has seen the records.
    """

    label: str
    values: Mapping[str, Sequence[float]]
    held_out: bool = False


def thinned(values: Array, limit: int = POINTS) -> NDArray[np.int64]:
    """Return the positions of at most `limit` samples that look like all of them: lowest and highest of each stretch.

    Parameters
    ----------
    values : array (samples,)   What is drawn.
    limit : int                 At most so many.
    """
    if values.size <= limit:
        return np.arange(values.size)
    edges = np.linspace(0, values.size, max(limit // 2, 2)).astype(np.int64)
    kept = {0, values.size - 1}
    for start, stop in pairwise(edges.tolist()):
        part = values[start:stop]
        kept |= {int(start + part.argmin()), int(start + part.argmax())}
    return np.array(sorted(kept), dtype=np.int64)


def time_unit(duration: float) -> tuple[float, str]:
    """Return the length [s] and name of the unit in which a duration [s] reads well.

    >>> time_unit(18000.0)
    (3600.0, 'h')
    """
    return (1.0, "s") if duration <= 300 else (60.0, "min") if duration <= 3 * 3600 else (3600.0, "h")


def choose(blocks: Sequence[Block], most: int = MOST_TRACES) -> list[tuple[Block, str]]:
    """Return the traces to draw with what marks them: all when there are few, else best, median and worst of each sensor and some between.

    Parameters
    ----------
    blocks : sequence of Block  Every trace of a stage.
    most : int                  At most so many.
    """
    size = {id(b): float(np.sqrt(np.mean(b.residuals**2))) for b in blocks}
    ranked = sorted(blocks, key=lambda b: size[id(b)])
    marks: dict[int, str] = {}
    sensors = dict.fromkeys(b.sensor for b in blocks)
    for sensor in sensors:
        own = [b for b in ranked if b.sensor == sensor]
        if len(own) > 2:
            for k, word in ((0, "best"), (len(own) // 2, "median"), (-1, "worst")):
                marks.setdefault(id(own[k]), f"{word} of {sensor}")
    if len(blocks) <= most:
        return [(b, marks.get(id(b), "")) for b in blocks]
    order = sorted(marks, key=lambda k: (not marks[k].startswith("worst"), not marks[k].startswith("best")))
    kept = set(order[:most])
    rest = [b for b in ranked if id(b) not in kept]
    step = max(len(rest) / max(most - len(kept), 1), 1.0)
    kept |= {id(rest[int(step * (k + 0.5))]) for k in range(most - len(kept)) if int(step * (k + 0.5)) < len(rest)}
    return [(b, marks.get(id(b), "")) for b in blocks if id(b) in kept]


@contextmanager
def canvas(width: float, height: float, rows: int = 1, ratios: Sequence[float] | None = None) -> Iterator[tuple[Canvas, list[Axes]]]:
    """Yield a figure of a size in CSS px with its axes, under settings that leave no trace."""
    with extra():
        import matplotlib
        from matplotlib.backends.backend_svg import FigureCanvasSVG
        from matplotlib.figure import Figure as Canvas
    settings: Any = {
        "svg.fonttype": "none",
        "svg.hashsalt": "thermid",  # identifiers are the same ones every time
        "text.parse_math": False,
        "axes.unicode_minus": True,
        "font.size": 10,
        "text.color": INK,
        "axes.edgecolor": SOFT,
        "axes.labelcolor": SOFT,
        "xtick.color": SOFT,
        "ytick.color": SOFT,
        "axes.linewidth": 0.8,
        "axes.grid": True,
        "grid.color": GRID,
        "grid.linewidth": 0.7,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "path.simplify_threshold": 0.3,
    }
    with matplotlib.rc_context(settings), warnings.catch_warnings():
        # letters that the layout's font lacks are drawn by the browser
        warnings.filterwarnings("ignore", message="Glyph .* missing", category=UserWarning)
        figure = Canvas(figsize=(width / 72, height / 72), facecolor="none")
        FigureCanvasSVG(figure)
        axes = figure.subplots(rows, 1, sharex=True, squeeze=False, gridspec_kw={"height_ratios": list(ratios or [1] * rows)})
        for axis in axes[:, 0]:
            axis.set_facecolor("none")
            axis.set_axisbelow(True)
        yield figure, list(axes[:, 0])


def markup_of(figure: Canvas, label: str, key: str, points: int) -> str:
    """Return a figure as inline SVG that follows the page's colours, or as an image where it has too many points."""
    buffer = io.BytesIO()
    if points > VECTOR_LIMIT:
        figure.savefig(buffer, format="png", dpi=144, facecolor="white")
        data = base64.b64encode(buffer.getvalue()).decode()
        return f'<img class="plot" alt="{escape(label)}" src="data:image/png;base64,{data}">'
    figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None, "Format": None, "Type": None})
    text = buffer.getvalue().decode("utf-8")
    text = text[text.index("<svg") :]
    head, _, body = text.partition(">")
    box = re.search(r'viewBox="[^"]*"', head)
    # its <style> would reach the whole page, the identifiers of its groups are used by nobody
    body = re.sub(r"<metadata>.*?</metadata>|<style.*?</style>|(?<=<g) id=\"[^\"]*\"", "", body, flags=re.DOTALL)
    body = re.sub(r' d="[^"]*"', lambda d: re.sub(r"(\.\d)\d+", r"\1", re.sub(r"\s+", " ", d[0])), body)
    body = re.sub(r">\s+<", "><", body.replace("xlink:href", "href"))
    body = re.sub(r'(\bid="|url\(#|href="#)', rf"\g<1>{key}-", body)
    body = re.sub(r"'DejaVu Sans'[^;\"]*", "var(--font)", body)
    for colour, variable in VARIABLES.items():
        body = body.replace(f": {colour}", f": var({variable},{colour})")
    return f'<svg class="plot" role="img" aria-label="{escape(label)}" {box[0] if box else ""}>{body}'


def _with_gaps(times: Array, values: Array) -> tuple[Array, Array]:
    """Return a line that is broken where samples are missing."""
    steps = np.diff(times)
    if steps.size == 0:
        return times, values
    holes = np.flatnonzero(steps > 8 * np.median(steps)) + 1
    return np.insert(times, holes, np.nan), np.insert(values, holes, np.nan)


def draw_line(axis: Axes, times: Array, values: Array, **style: Any) -> int:
    """Draw a thinned line and return how many points it has."""
    t, y = _with_gaps(times, values)
    keep = thinned(np.where(np.isnan(y), np.nanmean(y), y))
    keep = np.union1d(keep, np.flatnonzero(np.isnan(y)))
    axis.plot(t[keep], y[keep], **style)
    return int(keep.size)


def trace(block: Block, key: str, label: str) -> Drawn:
    """Return measured against simulated readings of one sensor in one record, with the residuals below.

    Parameters
    ----------
    block : Block   The readings.
    key : str       Prefix of the figure's identifiers, different for every figure of a page.
    label : str     What a screen reader says.
    """
    length, unit = time_unit(float(block.times[-1] - block.times[0]))
    times = block.times / length
    with canvas(440, 270, 2, (2.4, 1)) as (figure, (top, low)):
        points = draw_line(top, times, block.measured - ICE_POINT, color=MEASURED, linewidth=3.2, solid_capstyle="round")
        points += draw_line(top, times, block.predicted - ICE_POINT, color=SIMULATED, linewidth=1.3)
        low.axhline(0.0, color=SOFT, linewidth=0.8)
        points += draw_line(low, times, block.residuals, color=RESIDUAL, linewidth=0.9)
        top.set_ylabel("temperature, °C")
        low.set_ylabel("residual, K")
        low.set_xlabel(f"time, {unit}")
        top.margins(x=0.01)
        top.tick_params(labelbottom=False)
        figure.subplots_adjust(left=0.13, right=0.985, top=0.97, bottom=0.15, hspace=0.12)
        figure.align_ylabels([top, low])
        markup = markup_of(figure, label, key, points)
    entries = (Entry("measured", "--f-measured"), Entry("simulated", "--f-simulated"), Entry("measured less simulated", "--f-residual"))
    return Drawn(markup, entries, points)


def _spread(count: int) -> Array:
    """Return offsets within a line (count,) that keep dots of one value apart, the same ones every time."""
    return np.asarray(((np.arange(count) * 0.618034) % 1.0 - 0.5) * 0.3, dtype=np.float64)


def overview(lines: Sequence[Dots], key: str) -> Drawn:
    """Return the RMSE of every record as a dot, a line per stage, a colour and mark per sensor, with a stroke at each median."""
    sensors = list(dict.fromkeys(s for line in lines for s in line.values))
    highest = max((v for line in lines for values in line.values.values() for v in values), default=1.0)
    points = 0
    with canvas(760, 64 + 42 * len(lines)) as (figure, (axis,)):
        for k, line in enumerate(lines):
            for place, (sensor, found) in enumerate(line.values.items()):
                m, values = sensors.index(sensor), np.asarray(found, dtype=float)
                shift = 0.0 if len(line.values) == 1 else 0.44 * (place / (len(line.values) - 1) - 0.5)
                y = k + shift + (_spread(values.size) / len(line.values) if values.size > 1 else np.zeros(1))
                colour = SERIES[m % len(SERIES)]
                mark = MARKS[m % len(MARKS)]
                axis.plot(values, y, linestyle="none", marker=mark, markersize=5, color=colour, alpha=0.7, markeredgewidth=0)
                if values.size > 1:
                    axis.plot([np.median(values)] * 2, [k + shift - 0.2, k + shift + 0.2], color=INK, linewidth=1.8)
                points += int(values.size)
        axis.set_yticks(range(len(lines)), [_cut(line.label) + ("\nheld out" if line.held_out else "") for line in lines])
        axis.set_ylim(len(lines) - 0.4, -0.6)
        axis.set_xlim(0.0, 1.06 * highest or 1.0)
        axis.set_xlabel("RMSE of a record, K")
        axis.tick_params(axis="y", length=0, labelcolor=INK)
        figure.subplots_adjust(left=0.25, right=0.98, top=0.98, bottom=46 / (64 + 42 * len(lines)))
        markup = markup_of(figure, "RMSE per record and sensor, by stage", key, points)
    marks = "●■▲◆▼✚✖★"
    entries = [Entry(s, f"--s{m % len(SERIES)}", "", marks[m % len(marks)]) for m, s in enumerate(sensors)]
    if any(len(values) > 1 for line in lines for values in line.values.values()):
        entries.append(Entry("median", "--f-ink", "", "❙"))
    return Drawn(markup, tuple(entries), points)


def _cut(text: str) -> str:
    return text if len(text) <= 26 else text[:25] + "…"


def prediction(solution: Solution, key: str, label: str) -> Drawn:
    """Return the temperatures of every node of a solution over time."""
    length, unit = time_unit(float(solution.times[-1] - solution.times[0]))
    points, entries = 0, []
    with canvas(760, 330) as (figure, (axis,)):
        for k, node in enumerate(solution.nodes):
            colour, dashes = SERIES[k % len(SERIES)], DASHES[(k // len(SERIES)) % len(DASHES)]
            line = solution.temperatures[:, k] - ICE_POINT
            style: dict[str, Any] = {"dashes": dashes} if dashes else {}
            points += draw_line(axis, solution.times / length, line, color=colour, linewidth=1.6, **style)
            entries.append(Entry(f"{node} {line[-1]:.1f} °C", f"--s{k % len(SERIES)}", "dashed" if dashes else ""))
        axis.set_ylabel("temperature, °C")
        axis.set_xlabel(f"time, {unit}")
        axis.margins(x=0.01)
        figure.subplots_adjust(left=0.08, right=0.99, top=0.97, bottom=0.14)
        markup = markup_of(figure, label, key, points)
    return Drawn(markup, tuple(entries), points)
