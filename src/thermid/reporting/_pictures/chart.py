"""Charts as SVG whose lines can be read back: whole numbers on a grid, scaled by the panel, so that a page's script needs no second copy.

Every line lies on a grid of `PANEL_GRID_STEPS` by `PANEL_GRID_STEPS` steps over its panel, written as differences: small, and as exact
as a hundredth of a per cent of the axis. The script of a page zooms by the panel's scale and reads values back from the same numbers.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from thermid.base.units import HOUR, MINUTE, Array

SERIES = ("#0072b2", "#cd6100", "#4c9c69", "#964d6a", "#5c4700", "#7295ab", "#590084", "#1d2632")
"""From Okabe and Ito's colours (Color Universal Design, 2008), moved until every two differ for colour-blind eyes too (decision 208)."""
DASHES: tuple[tuple[float, ...], ...] = ((), *((dash, 2.0) for dash in (7.0, 1.0, 4.0, 16.0, 2.0, 11.0, 28.0)))
"""As many as colours, so that no two lines differ by colour alone; neighbours differ most. [px]"""


def series_look(k: int) -> tuple[tuple[str, str], str]:
    """Return colour and dash pattern of the k-th line: neighbours differ in both, and so do lines of one colour among 64."""
    n = k % len(SERIES)
    return (f"--s{n}", SERIES[n]), " ".join(f"{d:g}" for d in DASHES[(n + k // len(SERIES)) % len(DASHES)])


THIN, WIDE_LINE = 1.4, 3.4
"""Widths of a line, and of what others lie over. [px]"""
COLD, MILD, WARM = (191, 219, 242), (244, 240, 226), (250, 188, 128)
"""Pale blue, paper and pale orange, on all of which dark text stands. [RGB]"""
PANEL_GRID_STEPS = 10_000
"""Steps of the grid of a panel, each way."""
END_LABEL, END_LETTERS = 12.0, 24
"""Height [px] and letters, at most, of a name beside the end of its line."""
POINTS_PER_LINE, MAX_POINTS_OF_FIGURE = 400, 24_000
"""Points of a line, and of a figure."""


@dataclass(frozen=True)
class Stroke:
    """One line of a panel; `colour` is a pair (variable of the page, value elsewhere), `dash` an SVG dash pattern, width in px.

    A line that is the difference of two others of the figure names them in `less`, the minuend first: the three are then drawn at the
    same samples, and a page shows numbers of them whose difference is the one shown.
    """

    label: str
    x: Array
    y: Array
    colour: tuple[str, str]
    width: float = THIN
    dash: str = ""
    less: tuple[str, str] | None = None


@dataclass(frozen=True)
class Area:
    """What lies between two lines, such as an interval."""

    label: str
    x: Array
    low: Array
    high: Array
    colour: tuple[str, str] = ("--f-simulated", "#0072b2")


@dataclass(frozen=True)
class Panel:
    """One pair of axes.

    Parameters
    ----------
    name, unit : str        What the axis shows.
    lines : sequence        Drawn in this order.
    areas : sequence        Drawn below the lines.
    levels : sequence       Heights of thin lines from side to side.
    top : float             Upper end of the axis where not everything is to be seen; a line that leaves it is marked with its end.
    share : float           Its part of the height.
    zero : bool             Whether the axis begins at zero, where no value lies below it.
    """

    name: str
    unit: str
    lines: Sequence[Stroke]
    areas: Sequence[Area] = ()
    levels: Sequence[float] = ()
    top: float | None = None
    share: float = 1.0
    zero: bool = False


def thinned(values: Array, limit: int = POINTS_PER_LINE) -> NDArray[np.int64]:
    """Return the positions of at most `limit` samples that look like all of them: the ends, lowest and highest of each stretch.

    Parameters
    ----------
    values : array (samples,)   What is drawn; where a gap (nan) begins, its first sample is kept besides, so that a line breaks there.
    limit : int                 At most so many, beside gaps.
    """
    if values.size <= limit:
        return np.arange(values.size)
    width = -(-2 * values.size // max(limit - 2, 2))  # two of each stretch, and both ends
    padded = np.concatenate([values, np.full(-values.size % width, np.nan)]).reshape(-1, width)
    begins, gaps = width * np.arange(padded.shape[0]), np.isnan(values)
    lowest = begins + np.where(np.isnan(padded), np.inf, padded).argmin(axis=1)
    highest = begins + np.where(np.isnan(padded), -np.inf, padded).argmax(axis=1)
    breaks = np.flatnonzero(gaps & ~np.append(False, gaps[:-1]))
    chosen = np.zeros(values.size, bool)
    chosen[np.concatenate([[0, values.size - 1], lowest, highest, breaks])] = True
    return np.flatnonzero(chosen)


def nice_ticks(low: float, high: float, about: int) -> list[float]:
    """Return round values between two ends, about so many.

    >>> nice_ticks(0.3, 9.2, 5)
    [2.0, 4.0, 6.0, 8.0]
    """
    rough = (high - low) / max(about, 1)
    size = 10.0 ** math.floor(math.log10(rough))
    step = next(f * size for f in (1.0, 2.0, 2.5, 5.0, 10.0) if f * size >= 0.999 * rough)
    first = math.ceil(low / step - 1e-9)
    last = math.floor(high / step + 1e-9)
    return [k * step for k in range(first, last + 1)]


def number_text(value: float, step: float) -> str:
    """Return a tick's label with the decimals that its step needs.

    >>> number_text(0.25, 0.25), number_text(20.0, 10.0)
    ('0.25', '20')
    """
    decimals = max(0, -math.floor(math.log10(step) + 1e-9))
    if abs(step * 10**decimals - round(step * 10**decimals)) > 1e-6:
        decimals += 1
    return f"{value:z.{decimals}f}".replace("-", "\u2212")


def chart(panels: Sequence[Panel], *, key: str, label: str, x_name: tuple[str, str], size: tuple[float, float], named: bool = False) -> str:
    """Return panels one above the other over one x axis as an inline SVG.

    Parameters
    ----------
    panels : sequence of Panel  From the top down.
    key : str                   Prefix of the figure's identifiers.
    label : str                 What a screen reader says before what is seen.
    x_name : (str, str)         What x is, and its unit.
    size : (width, height)      [px]
    named : bool                Whether lines have their names at their ends, where there is room for all.
    """
    width, height = size
    edge, right, top, bottom, gap = 54.0, 8.0, 8.0, 38.0, 12.0
    named = named and all(END_LABEL * len(p.lines) < height - top - bottom for p in panels)
    right += 6.4 * max(len(line.label[:END_LETTERS]) for p in panels for line in p.lines) + 14.0 if named else 0.0
    every = [line.x for p in panels for line in p.lines]
    ends = min(float(x.min()) for x in every), max(float(x.max()) for x in every)
    limit = min(POINTS_PER_LINE, MAX_POINTS_OF_FIGURE // max(len(every), 1))
    samples = _together(panels, limit)
    whole = height - top - bottom - gap * (len(panels) - 1)
    out = []
    for k, panel in enumerate(panels):
        tall = whole * panel.share / sum(p.share for p in panels)
        box = (edge, top, width - edge - right, tall)
        out.append(_panel(panel, box, widened(*ends, 0.01), f"{key}-{k}", limit, k == len(panels) - 1, samples, named))
        top += tall + gap
    words = escape(f"{label}. {in_words(panels, x_name, ends)}")
    end = f'<text x="{edge + (width - edge - right) / 2:.0f}" y="{height - 5:.0f}" text-anchor="middle">{escape(", ".join(x_name))}</text>'
    head = f'<svg class="plot" role="img" aria-label="{words}" viewBox="0 0 {width:g} {height:g}" data-unit="{escape(x_name[1])}"'
    return f'{head} style="font-size:12px;fill:var(--f-soft,#556172)">{"".join(out)}{end}</svg>'


def _together(panels: Sequence[Panel], limit: int) -> dict[int, NDArray[np.int64]]:
    """Return identity of a line -> positions at which it is drawn, of lines that are differences and of those that they are made of."""
    every = [line for p in panels for line in p.lines]
    out: dict[int, NDArray[np.int64]] = {}
    for line in every:
        alike = [o for o in every if np.array_equal(o.x, line.x)]
        minuends = {o.less[0] for o in alike if o.less}
        names = minuends | {o.less[1] for o in alike if o.less}
        if (line.less or line.label in names) and line.x.size > limit and all(np.isfinite(o.y).all() for o in alike):
            # what leaps in the subtrahend leaps in the difference
            leading = [o for o in alike if o.less or o.label in minuends]
            out[id(line)] = np.unique(np.concatenate([thinned(o.y, max(limit // len(leading), 8)) for o in leading]))
    return out


def in_words(panels: Sequence[Panel], x_name: tuple[str, str], ends: tuple[float, float]) -> str:
    """Return in words what a chart shows: every line with its ends and its range."""
    readout = []
    for p in panels:
        for line in p.lines[:6]:
            y = line.y[np.isfinite(line.y)]
            if y.size:
                digits = min(3, max(0, 1 - math.floor(math.log10(max(float(np.ptp(y)), 1e-9)))))
                span = f"{y.min():.{digits}f} to {y.max():.{digits}f}"
                readout.append(f"{line.label}: from {y[0]:.{digits}f} to {y[-1]:.{digits}f} {p.unit}, range {span}")
        if len(p.lines) > 6:
            readout.append(f"and {len(p.lines) - 6} more")
    return f"{x_name[0].capitalize()} {ends[0]:.4g} to {ends[1]:.4g} {x_name[1]}; " + "; ".join(dict.fromkeys(readout)) + "."


def blend(share: float) -> str:
    """Return the colour from `COLD` over `MILD` to `WARM` at a share from 0 to 1."""
    a, b, part = (COLD, MILD, 2 * share) if share < 0.5 else (MILD, WARM, 2 * share - 1)
    return "#" + "".join(f"{round(p + part * (q - p)):02x}" for p, q in zip(a, b, strict=True))


def widened(low: float, high: float, share: float = 0.05) -> tuple[float, float]:
    """Return an interval with some room, one of no length made to have some."""
    room = share * (high - low) or max(abs(high) * 1e-3, 0.5)
    return low - room, high + room


def _panel(
    p: Panel,
    box: tuple[float, float, float, float],
    x_ends: tuple[float, float],
    key: str,
    limit: int,
    last: bool,
    samples: Mapping[int, NDArray[np.int64]],
    named: bool = False,
) -> str:
    """Return a panel as SVG: frame, grid, ticks, lines and bands within its box. [px]

    About a number for each 42 px of height and 62 px of width; values stand 6 px left of the frame, times 15 px below it.

    Parameters
    ----------
    box : tuple         Left, top, width and height. [px]
    x_ends : tuple      First and last time shown.
    key : str           Name of its clipping path on the page.
    limit : int         Samples of a line, at most.
    last : bool         Whether times stand below it.
    samples : dict      Id of a line -> which of its samples are shown, where lines share them.
    named : bool        Whether lines are named at their ends.
    """
    x_left, top, width, height = box
    shown = [line.y[np.isfinite(line.y)] for line in p.lines] + [v for a in p.areas for v in (a.low, a.high)]
    low, high = min(float(v.min()) for v in shown if v.size), max(float(v.max()) for v in shown if v.size)
    low, high = widened(min([low, *p.levels, *([0.0] if p.zero else [])]), max([high, *p.levels]))
    high = p.top if p.top is not None and p.top < high else high
    about = max(3, round(height / 42))  # a scale that shows one value alone shows no size
    y_ticks = next(t for k in range(about, about + 20) if len(t := nice_ticks(low, high, k)) > 1)
    x_ticks = nice_ticks(*x_ends, round(width / 62))
    place = [x_left + width * (t - x_ends[0]) / (x_ends[1] - x_ends[0]) for t in x_ticks]
    heights = [top + height * (high - t) / (high - low) for t in y_ticks]
    steps = [b - a for ticks in (x_ticks, y_ticks) for a, b in list(pairwise(ticks))[:1] or [(0.0, 1.0)]]
    rules = "".join(f"M{x:.1f} {top:.1f}v{height:.1f}" for x in place) + "".join(f"M{x_left:g} {y:.1f}h{width:g}" for y in heights)
    texts = [_text(x_left - 6, y + 3.8, "end", number_text(t, steps[1])) for t, y in zip(y_ticks, heights, strict=True)]
    if last:
        texts += [_text(x, top + height + 15, "middle", number_text(t, steps[0])) for t, x in zip(x_ticks, place, strict=True)]
    scale = _Scale(x_ends, (low, high))
    shapes = [_area(a, scale, limit) for a in p.areas] + [_line(line, scale, limit, samples.get(id(line))) for line in p.lines]
    middle = top + height / 2
    name = ", ".join(t for t in (p.name, p.unit) if t)
    ends = " ".join(f"{v:.9g}" for v in (*x_ends, low, high))
    flat = "".join(f"M0 {scale.down(level)}h{PANEL_GRID_STEPS}" for level in p.levels)
    return (
        f'<g class="panel" data-box="{x_left:g} {top:.1f} {width:g} {height:.1f}" data-ends="{ends}" data-unit="{escape(p.unit)}">'
        f'<path class="grid" d="{rules}" style="fill:none;stroke:var(--f-grid,#e3e8ee)"/><g class="ticks">{"".join(texts)}</g>'
        f'<text transform="translate(11 {middle:.1f})rotate(-90)" text-anchor="middle">{escape(name)}</text>'
        f'<clipPath id="{key}"><path d="M{x_left:g} {top:.1f}h{width:g}v{height:.1f}h-{width:g}z"/></clipPath><g clip-path="url(#{key})">'
        f'<g class="view" transform="translate({x_left:g} {top:.1f})scale({width / PANEL_GRID_STEPS:.7g} {height / PANEL_GRID_STEPS:.7g})" '
        'style="fill:none;stroke-linejoin:round;stroke-linecap:round">'
        + (f'<path d="{flat}" vector-effect="non-scaling-stroke" style="stroke:var(--f-soft,#556172);stroke-width:.8"/>' if flat else "")
        + "".join(shapes)
        + f'</g></g><path d="M{x_left:g} {top:.1f}v{height:.1f}h{width:g}" style="fill:none;stroke:var(--f-soft,#556172);stroke-width:.8"/>'
        + "".join(_leaving(p, box, x_ends))
        + ("".join(_end_names(p, box, (low, high))) if named else "")
        + "</g>"
    )


def _text(x: float, y: float, anchor: str, text: str) -> str:
    """Return a text of SVG at (x, y). [px]"""
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{text}</text>'


@dataclass(frozen=True)
class _Scale:
    """The grid of a panel: x to the right, y downwards."""

    x: tuple[float, float]
    y: tuple[float, float]

    def across(self, values: Array) -> NDArray[np.int64]:
        """Return abscissas as steps of the panel's grid, from its left edge."""
        return np.rint(PANEL_GRID_STEPS * (values - self.x[0]) / (self.x[1] - self.x[0])).astype(np.int64)

    def down(self, values: float | Array) -> NDArray[np.int64]:
        """Return ordinates as steps of the panel's grid, from its upper edge; far outside they are cut off."""
        far = PANEL_GRID_STEPS * (self.y[1] - np.asarray(values)) / (self.y[1] - self.y[0])
        return np.rint(np.clip(far, -20 * PANEL_GRID_STEPS, 20 * PANEL_GRID_STEPS)).astype(np.int64)


def _moves(x: NDArray[np.int64], y: NDArray[np.int64]) -> str:
    """Return a path through points, written as differences."""
    steps = np.column_stack([np.diff(x), np.diff(y)]).ravel().tolist()
    text = " ".join(str(s) for s in steps).replace(" -", "-")
    return f"M{x[0]} {y[0]}l{text}" if steps else f"M{x[0]} {y[0]}h1"


def _stretches(line: Stroke) -> Iterator[NDArray[np.int64]]:
    """Yield the positions of the parts of a line between which samples are missing."""
    good = np.flatnonzero(np.isfinite(line.x) & np.isfinite(line.y))
    steps = np.diff(line.x[good])
    holes = np.flatnonzero(steps > 8 * np.median(steps)) + 1 if steps.size else np.zeros(0, dtype=np.int64)
    yield from (at for at in np.split(good, holes) if at.size)


def _line(line: Stroke, scale: _Scale, limit: int, samples: NDArray[np.int64] | None) -> str:
    """Return the path of a line, thinned to about so many points; gaps stay gaps."""
    path = []
    whole = max(line.x.size, 1)
    for at in _stretches(line):
        if samples is None:
            keep = at[thinned(line.y[at], max(int(limit * at.size / whole), 8))]
        else:
            keep = np.unique(np.concatenate([at[[0, -1]], at[np.isin(at, samples)]]))
        path.append(_moves(scale.across(line.x[keep]), scale.down(line.y[keep])))
    variable, colour = line.colour
    dash = f";stroke-dasharray:{line.dash}" if line.dash else ""
    less = f' data-less="{escape(json.dumps(line.less))}"' if line.less else ""
    style = f"stroke:var({variable},{colour});stroke-width:{line.width:g}{dash}"
    return (
        f'<path class="line" data-n="{escape(line.label)}"{less} d="{"".join(path)}" vector-effect="non-scaling-stroke" style="{style}"/>'
    )


def _area(area: Area, scale: _Scale, limit: int) -> str:
    """Return the path of a band, thinned to about so many points."""
    keep = np.union1d(thinned(area.low, limit // 2), thinned(area.high, limit // 2))
    x = scale.across(area.x[keep])
    there, back = scale.down(area.high[keep]), scale.down(area.low[keep])
    path = _moves(np.concatenate([x, x[::-1]]), np.concatenate([there, back[::-1]]))
    variable, colour = area.colour
    style = f"fill:var({variable},{colour});fill-opacity:.24"
    return f'<path class="area" data-n="{escape(area.label)}" d="{path}z" style="{style}"/>'


def _end_names(p: Panel, box: tuple[float, float, float, float], y_ends: tuple[float, float]) -> Iterator[str]:
    """Yield the name of every line beside its end, names moved apart until none lies on another, each with a rule to its line."""
    x, bottom = box[0] + box[2], box[1] + box[3]
    at = {k: bottom - box[3] * (float(line.y[-1]) - y_ends[0]) / (y_ends[1] - y_ends[0]) for k, line in enumerate(p.lines)}
    order = sorted(at, key=at.__getitem__)
    places: list[float] = []
    for k in order:
        places.append(max(at[k], places[-1] + END_LABEL if places else box[1] + 4.0))
    for n in reversed(range(len(places))):
        places[n] = min(places[n], bottom - END_LABEL * (len(places) - 1 - n))
    for k, y in zip(order, places, strict=True):
        (variable, colour), label = p.lines[k].colour, p.lines[k].label
        name = label if len(label) <= END_LETTERS else f"{label[: END_LETTERS - 1]}…"
        yield f'<path class="ends" d="M{x:.1f} {at[k]:.1f}L{x + 10:.1f} {y:.1f}" style="fill:none;stroke:var({variable},{colour})"/>'
        yield f'<text class="ends" x="{x + 12:.1f}" y="{y + 3.5:.1f}" style="fill:var({variable},{colour})">{escape(name)}</text>'


def _leaving(p: Panel, box: tuple[float, float, float, float], x_ends: tuple[float, float]) -> Iterator[str]:
    """Yield where a line that leaves the top would end."""
    x_left, top, width, _ = box
    highest = math.inf if p.top is None else p.top
    for line in p.lines:
        if line.y[-1] > highest:
            x = line.x[int((line.y > highest).argmax())]
            at = x_left + width * (float(x) - x_ends[0]) / (x_ends[1] - x_ends[0])
            yield f'<text class="leaves" x="{at + 5:.1f}" y="{top + 12:.1f}">{line.y[-1]:.0f} {escape(p.unit)} at the end</text>'


def time_unit(duration: float) -> tuple[float, str]:
    """Return the length [s] and name of the unit in which a duration [s] reads well.

    >>> time_unit(18000.0)
    (3600.0, 'h')
    """
    return (1.0, "s") if duration <= 300 else (MINUTE, "min") if duration <= 3 * HOUR else (HOUR, "h")
