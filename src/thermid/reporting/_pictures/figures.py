"""Figures of a report: measured against simulated, RMSE by stage, predictions, test by sensor, residuals counted.

Drawing is thinned; statistics never are.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape
from typing import Final

import numpy as np

from thermid.base.units import ICE_POINT, Array
from thermid.fit.calibration import SensorTrace
from thermid.prediction.bands import Prediction
from thermid.reporting._blocks.content import NARROW, Graphic, LegendEntry, Plot
from thermid.reporting._pictures.chart import (
    END_LABEL,
    SERIES,
    THIN,
    WIDE_LINE,
    Area,
    Panel,
    Stroke,
    blend,
    chart,
    nice_ticks,
    number_text,
    series_look,
    time_unit,
    widened,
)
from thermid.simulation.runs import Solution

CHART_WIDTH, CHART_HEIGHT = 300.0, 232.0
"""Size of a chart. [px]"""
BOX: Final = (52.0, 8.0, CHART_WIDTH - 62.0, CHART_HEIGHT - 52.0)
"""Left, top, width and height of its axes. [px]"""
BANDS: Final = ((2.0, ""), (3.0, "6 2.5"), (5.0, "1.5 2.5"))
"""Distance from equality [K] and dashes of its lines."""
MAX_SCATTER_DOTS: Final = 900
"""Dots of the scatter at most."""
MAX_ROWS_OF_PICTURE: Final = 30
MOST_COLUMNS: Final = 16
"""Rows and columns of the matrix at most, the worst first where there are more."""
CELL: Final = 22.0
"""Height of a row of the matrix. [px]"""


def matrix(cells: Mapping[tuple[str, str], tuple[float, bool | None]]) -> Graphic:
    """Return tests by sensors, each cell the largest error over its limit; what is not met is framed and marked.

    Parameters
    ----------
    cells : dict    (test, sensor) -> error over limit [-], and whether the limit is met.
    """
    tests, sensors = (_ordered(cells, axis) for axis in (0, 1))
    across = len(sensors) <= len(tests) or len(sensors) <= 8
    rows, columns = (tests, sensors) if across else (sensors, tests)
    rows, columns = rows[:MAX_ROWS_OF_PICTURE], columns[:MOST_COLUMNS]
    x_left = min(130.0, 12.0 + 6.6 * max(len(r) for r in rows))
    steep = any(6.6 * len(c) > (CHART_WIDTH - x_left) / len(columns) - 4.0 for c in columns)
    smallest = 36.0 if all(met is not False for _, met in cells.values()) else 48.0
    cell = max(smallest, (CHART_WIDTH - x_left - (28.0 if steep else 0.0)) / len(columns))
    reach = [5.4 * len(cut(c, 16)) + 8.0 for c in columns]  # of a name that stands at 45 degrees: as far up as to the right
    head = max(reach) + 8.0 if steep else 22.0
    ends = max(cell * (k + 0.5) + r for k, r in enumerate(reach)) if steep else 0.0
    width, height = x_left + max(cell * len(columns), ends), head + CELL * len(rows) + 6.0
    out = []
    for k, name in enumerate(columns):
        x = x_left + cell * (k + 0.5)
        turn = f' transform="rotate(-45 {x:.1f} {head - 6:.1f})"' if steep else ""
        out.append(
            f'<text x="{x:.1f}" y="{head - 6:.1f}" text-anchor="{"start" if steep else "middle"}"{turn}>{escape(cut(name, 16))}</text>'
        )
    tips = []
    for j, row in enumerate(rows):
        y = head + CELL * j
        out.append(f'<text x="{x_left - 6:.1f}" y="{y + 15:.1f}" text-anchor="end">{escape(cut(row, 18))}</text>')
        for k, column in enumerate(columns):
            key = (row, column) if across else (column, row)
            if key not in cells:
                continue
            ratio, met = cells[key]
            x, tip = x_left + cell * k, f"{key[1]} in {key[0]}: {ratio:.2f} of its limit{'' if met else ', not met'}"
            frame = f"stroke:{INK};stroke-width:1.6" if met is False else "stroke:var(--paper,#fff);stroke-width:1"
            mark = "✗ " if met is False else ""
            out.append(
                f'<rect x="{x:.1f}" y="{y:.1f}" width="{cell:.1f}" height="{CELL:g}" style="fill:{shade(ratio)};{frame}">'
                f"<title>{escape(tip)}</title></rect>"
                f'<text x="{x + 0.5 * cell:.1f}" y="{y + 15:.1f}" text-anchor="middle" style="fill:#1a2230">{mark}{ratio:.2f}</text>'
            )
            tips.append(tip)
    return _whole(out, f"Error over limit, test by sensor. {'; '.join(tips[:12])}", width, height)


def _ordered(cells: Mapping[tuple[str, str], tuple[float, bool | None]], axis: int) -> list[str]:
    """Return the tests (0) or sensors (1): in their order where all are drawn, else the worst first."""
    names = list(dict.fromkeys(k[axis] for k in cells))
    if len(names) <= MOST_COLUMNS:
        return names
    worst = {n: max(ratio for k, (ratio, _) in cells.items() if k[axis] == n) for n in names}
    return sorted(names, key=lambda n: -worst[n])


def shade(ratio: float) -> str:
    """Return the colour of an error over its limit: blue far below it, white at it, orange beyond."""
    return blend(min(max(ratio / 2.0, 0.0), 1.0))


def scatter(measured: Sequence[Array], predicted: Sequence[Array]) -> Graphic:
    """Return measured less predicted over measured temperatures of all traces, with those lines of `BANDS` that are in view.

    Predicted over measured would put these lines on the diagonal, where a range of 100 K leaves a few pixels between them.

    Parameters
    ----------
    measured, predicted : sequences of arrays (samples,)    One of each for every trace. [K]
    """
    x = np.concatenate(measured) - ICE_POINT
    y = x + ICE_POINT - np.concatenate(predicted)
    bands = _bands_in_view(y)
    (left, right), far = widened(float(x.min()), float(x.max())), widened(0.0, max([float(np.abs(y).max()), *(k for k, _ in bands)]))[1]
    box = BOX

    def at(v: float, w: float) -> tuple[float, float]:
        """Return where a temperature and a difference stand in the box. [px]"""
        return box[0] + box[2] * (v - left) / (right - left), box[1] + box[3] * 0.5 * (1.0 - w / far)

    out = [_scatter_axes(box, (left, right), (-far, far), ("measured, °C", "measured less predicted, K"))]
    for shift, dash in [(0.0, ""), *((sign * k, dash) for k, dash in bands for sign in (1.0, -1.0))]:
        (x1, y1), (x2, y2) = at(left, shift), at(right, shift)
        look = f"stroke-width:{1.3 if shift == 0 else 0.9};stroke-dasharray:{dash or 'none'}"
        out.append(f'<path d="M{x1:.1f} {y1:.1f}L{x2:.1f} {y2:.1f}" style="fill:none;stroke:var(--f-soft,{SOFT});{look}"/>')
    chosen = np.arange(x.size)[:: max(1, x.size // MAX_SCATTER_DOTS)]
    chosen = np.union1d(chosen, np.argsort(-np.abs(y))[: MAX_SCATTER_DOTS // 10])  # what is far off is never left out
    dots = "".join(f"M{at(v, w)[0]:.1f} {at(v, w)[1]:.1f}h.01" for v, w in zip(x[chosen].tolist(), y[chosen].tolist(), strict=True))
    look = f"fill:none;stroke:var(--f-simulated,{SIMULATED});stroke-width:3.4;stroke-linecap:round;stroke-opacity:.55"
    out.append(f'<path d="{dots}" style="{look}"/>')
    return _whole(out, f"Measured less predicted, {x.size} readings: {_shares_within(y)}", CHART_WIDTH, CHART_HEIGHT)


def histogram(residuals: Sequence[Array]) -> Graphic:
    """Return how many residuals of all traces lie where, in per cent of the readings.

    Parameters
    ----------
    residuals : sequence of arrays (samples,)   Measured less predicted. [K]
    """
    r = np.concatenate(residuals)
    far = widened(0.0, float(np.abs(r).max()))[1]
    counts, _ = np.histogram(r, bins=31, range=(-far, far))
    share = 100.0 * counts / r.size
    top = widened(0.0, float(share.max()))[1]
    box = BOX
    out = [_scatter_axes(box, (-far, far), (0.0, top), ("measured less predicted, K", "readings, %"))]
    foot, step = box[1] + box[3], box[2] / counts.size
    tall = [box[3] * s / top for s in share.tolist()]
    bars = "".join(f"M{box[0] + k * step:.1f} {foot:.1f}v{-h:.1f}h{step - 0.8:.1f}v{h:.1f}z" for k, h in enumerate(tall))
    out.append(f'<path d="{bars}" style="fill:var(--f-residual,{RESIDUAL});fill-opacity:.8"/>')
    middle = box[0] + 0.5 * box[2]
    out.append(f'<path d="M{middle:.1f} {box[1]:.1f}v{box[3]:.1f}" style="stroke:var(--f-ink,{INK});stroke-width:.9;fill:none"/>')
    return _whole(
        out, f"Residuals of {r.size} readings: mean {r.mean():+.3g} K, standard deviation {r.std():.3g} K", CHART_WIDTH, CHART_HEIGHT
    )


def against_measured(measured: Sequence[Array], predicted: Sequence[Array], word: str, of: str = "") -> tuple[Plot, Plot]:
    """Return how far predicted temperatures are from the measured ones over these, and the residuals counted.

    Parameters
    ----------
    measured, predicted : sequences of arrays (samples,)    One of each for every trace. [K]
    word : str                                              What the captions call the predicted ones.
    of : str                                                What the captions say of which records they are.
    """
    residuals = [m - p for m, p in zip(measured, predicted, strict=True)]
    r = np.concatenate(residuals)
    spread = f"mean {r.mean():+.2f} K, standard deviation {r.std():.2f} K; {_shares_within(r)}"
    lines = [f"± {k:g} K{look}" for (k, _), look in zip(_bands_in_view(r), ("", " (dashed)", " (dotted)"), strict=False)]
    caption = f"Measured less {word}, over measured{of}{'; lines at ' + ', '.join(lines) if lines else ''}."
    return (
        Plot(scatter(measured, predicted), caption, "", "fig-scatter"),
        Plot(histogram(residuals), f"Residuals{of}: {spread}.", "", "fig-histogram"),
    )


def _bands_in_view(residuals: Array) -> list[tuple[float, str]]:
    """Return those lines of `BANDS` beside which residuals (samples,) [K] do not shrink to a straight line, as for a limit."""
    return [b for b in BANDS if b[0] < LIMIT_IN_VIEW * float(np.abs(residuals).max())]


def _shares_within(residuals: Array) -> str:
    """Return the largest of residuals (samples,) [K], and their shares within the lines in view; what a rounded 100 % hides is counted."""
    out = [f"largest {np.abs(residuals).max():.2g} K"]
    for k, _ in _bands_in_view(residuals):
        beyond, text = int((np.abs(residuals) > k).sum()), ""
        share = 100.0 * (1.0 - beyond / residuals.size)
        if beyond and share >= 99.5:
            share, text = min(share, 99.9), f" ({beyond:,} of {residuals.size:,} beyond)"
        out.append(f"{share:.{1 if text else 0}f} % within {k:g} K{text}")
    return ", ".join(out)


def _scatter_axes(box: tuple[float, float, float, float], x: tuple[float, float], y: tuple[float, float], names: tuple[str, str]) -> str:
    """Return grid, ticks and names of a pair of axes."""
    x_left, top, width, height = box
    xs, ys = nice_ticks(*x, 5), nice_ticks(*y, 5)
    across = [x_left + width * (t - x[0]) / (x[1] - x[0]) for t in xs]
    down = [top + height * (y[1] - t) / (y[1] - y[0]) for t in ys]
    rules = "".join(f"M{p:.1f} {top:g}v{height:g}" for p in across) + "".join(f"M{x_left:g} {p:.1f}h{width:g}" for p in down)
    steps = [(t[1] - t[0]) if len(t) > 1 else 1.0 for t in (xs, ys)]
    texts = [
        f'<text x="{p:.1f}" y="{top + height + 15:.1f}" text-anchor="middle">{number_text(t, steps[0])}</text>'
        for p, t in zip(across, xs, strict=True)
    ]
    texts += [
        f'<text x="{x_left - 5:g}" y="{p + 4:.1f}" text-anchor="end">{number_text(t, steps[1])}</text>'
        for p, t in zip(down, ys, strict=True)
    ]
    texts.append(f'<text x="{x_left + 0.5 * width:.1f}" y="{top + height + 33:.1f}" text-anchor="middle">{escape(names[0])}</text>')
    texts.append(f'<text transform="translate(12 {top + 0.5 * height:.1f})rotate(-90)" text-anchor="middle">{escape(names[1])}</text>')
    frame = f"M{x_left:g} {top:g}v{height:g}h{width:g}"
    return (
        f'<path d="{rules}" style="fill:none;stroke:var(--f-grid,{GRID})"/><path d="{frame}" style="fill:none;stroke:var(--f-soft,{SOFT});'
        f'stroke-width:.8"/>{"".join(texts)}'
    )


def _whole(parts: Iterator[str] | Sequence[str], label: str, width: float, height: float) -> Graphic:
    """Return parts of SVG as one graphic of a size [px], with what a screen reader says of it."""
    return Graphic(
        f'<svg class="plot" role="img" aria-label="{escape(label)}." viewBox="0 0 {width:.0f} {height:.0f}" '
        f'style="font-size:12px;max-width:{1.5 * width:.0f}px;fill:var(--f-soft,{SOFT})">{"".join(parts)}</svg>',
        (),
    )


INK, SOFT, GRID, MEASURED, SIMULATED, RESIDUAL = "#1a2230", "#556172", "#e3e8ee", "#8e9aa8", "#0072b2", "#c04a00"
MARKS = "●■▲◆▼✚✖★"
SHAPES = (
    "M-3.2 0a3.2 3.2 0 1 0 6.4 0a3.2 3.2 0 1 0-6.4 0z",
    "M-2.9-2.9h5.8v5.8h-5.8z",
    "M0-3.6l3.5 6.4h-7z",
    "M0-4l4 4-4 4-4-4z",
    "M0 3.6l3.5-6.4h-7z",
    "M-1.2-3.6h2.4v2.4h2.4v2.4h-2.4v2.4h-2.4v-2.4h-2.4v-2.4h2.4z",
    "M-3.6-2l1.6-1.6 2 2 2-2 1.6 1.6-2 2 2 2-1.6 1.6-2-2-2 2-1.6-1.6 2-2z",
    "M0-4.2l1.2 3h3.1l-2.5 2 1 3.2-2.8-2-2.8 2 1-3.2-2.5-2h3.1z",
)
MOST_TRACES = 12
LOOKS = {"measured": ("--f-measured", MEASURED), "simulated": ("--f-simulated", SIMULATED), "residual": ("--f-residual", RESIDUAL)}


@dataclass(frozen=True, eq=False)
class RecordDrive:
    """What drove a record.

    Parameters
    ----------
    times : array (times,)      [s]
    ambient : dict              Boundary -> temperature (times,). [K]
    power : array (times,)      Sum of all powers; None where the model has no load. [W]
    """

    times: Array
    ambient: Mapping[str, Array]
    power: Array | None


@dataclass(frozen=True)
class Dots:
    """One line of the overview: a stage or its held-out records.

    Parameters
    ----------
    label : str         Name.
    values : dict       Sensor -> RMSE of each record. [K]
    held_out : bool     Whether no fit has seen the records.
    doubt : str         What stands under the name, such as that the fit is not credible; a small RMSE alone would recommend it.
    """

    label: str
    values: Mapping[str, Sequence[float]]
    held_out: bool = False
    doubt: str = ""


def choose(blocks: Sequence[SensorTrace], most: int = MOST_TRACES) -> list[tuple[SensorTrace, str]]:
    """Return the traces to draw with what marks them: all when there are few, else best, median and worst of each sensor and some between.

    Parameters
    ----------
    blocks : sequence of PageBlock  Every trace of a stage.
    most : int                  At most so many.
    """
    size = {id(b): float(np.sqrt(np.mean(b.residuals**2))) for b in blocks}
    ranked = sorted(blocks, key=lambda b: size[id(b)])
    marks: dict[int, str] = {}
    for sensor in dict.fromkeys(b.sensor for b in blocks):
        of_sensor = [b for b in ranked if b.sensor == sensor]
        if len(of_sensor) > 2:
            for k, word in ((0, "best"), (len(of_sensor) // 2, "median"), (-1, "worst")):
                marks.setdefault(id(of_sensor[k]), f"{word} of {sensor}")
    if len(blocks) <= most:
        return [(b, marks.get(id(b), "")) for b in blocks]
    order = sorted(marks, key=lambda k: (not marks[k].startswith("worst"), not marks[k].startswith("best")))
    chosen = set(order[:most])
    rest = [b for b in ranked if id(b) not in chosen]
    step = max(len(rest) / max(most - len(chosen), 1), 1.0)
    chosen |= {id(rest[int(step * (k + 0.5))]) for k in range(most - len(chosen)) if int(step * (k + 0.5)) < len(rest)}
    return [(b, marks.get(id(b), "")) for b in blocks if id(b) in chosen]


POWER_PANEL = 62.0
"""What the panel of the power adds to the height of a figure. [px]"""


def driven(drive: RecordDrive | None, begin: float, end: float) -> tuple[list[Stroke], list[Stroke]]:
    """Return the lines of at most two ambient temperatures [degC] and of the power [W] over seconds, between two times."""
    if drive is None:
        return [], []
    inside = (drive.times >= begin - 1e-9) & (drive.times <= end + 1e-9)
    times, green = drive.times[inside], ("--s2", SERIES[2])
    ambient = [
        Stroke(f"ambient {name}", times, kelvin[inside] - ICE_POINT, green, dash=dash)
        for (name, kelvin), dash in zip(drive.ambient.items(), ("1.5 2.5", "7 2 2 2"), strict=False)
    ]
    return ambient, [] if drive.power is None else [Stroke("power", times, drive.power[inside], ("--s3", SERIES[3]))]


LIMIT_IN_VIEW = 4.0
"""A limit that is so many times the largest residual or more is not drawn: beside it the residual would be a straight line. [-]"""


def correction(error: float) -> str:
    """Return what a caption says of readings that are drawn without their sensor's constant error [K]; empty where it rounds to zero."""
    return f"readings less the sensor's constant error of {error:+.2f} K" if abs(error) >= 0.005 else ""


TRACE = (440.0, 280.0)
"""Size of a trace, without the panel of the power. [px]"""


def compared(
    times: Array,
    measured: Array,
    predicted: Array,
    key: str,
    label: str,
    *,
    wide: float = 0.0,
    drive: RecordDrive | None = None,
    limit: float | None = None,
    size: tuple[float, float] = TRACE,
) -> Graphic:
    """Return readings with the simulation over them, their difference below, and what drove them: the one layout of every such figure.

    Parameters
    ----------
    times : array (samples,)                [s]
    measured, predicted : array (samples,)  [K]
    key : str                               Prefix of the figure's identifiers, different for every figure of a page.
    label : str                             What a screen reader says.
    wide : float                            Half-width of the band of the sensor's error around the readings; none without it. [K]
    drive : RecordDrive                           Ambient temperatures and power over the same record; none drawn without it.
    limit : float                           Limit of every single difference; drawn where it is within `LIMIT_IN_VIEW`. [K]
    size : (width, height)                  Without the panel of the power. [px]
    """
    length, unit = time_unit(float(times[-1] - times[0]))
    x, y, residual = times / length, measured - ICE_POINT, measured - predicted
    bands: list[Area] = []
    low: list[Area] = []
    ends = np.array([x[0], x[-1]])
    if wide > 0:
        bands = [Area("sensor, 95 %", x, y - wide, y + wide, LOOKS["measured"])]
        low = [Area("sensor, 95 %", ends, np.full(2, -wide), np.full(2, wide), LOOKS["measured"])]
    lines = [Stroke("measured", x, y, LOOKS["measured"], WIDE_LINE), Stroke("simulated", x, predicted - ICE_POINT, LOOKS["simulated"])]
    entries = [LegendEntry("measured", "--f-measured", width=WIDE_LINE), LegendEntry("simulated", "--f-simulated")]
    differences = [Stroke("measured less simulated", x, residual, LOOKS["residual"], 1.0, less=("measured", "simulated"))]
    entries.append(LegendEntry("measured less simulated", "--f-residual"))
    ambient, power = driven(drive, float(times[0]), float(times[-1]))
    lines += [replace(line, x=line.x / length) for line in ambient]
    entries += [LegendEntry(line.label, line.colour[0], line.dash, width=line.width) for line in (*ambient, *power)]
    if limit is not None and limit < LIMIT_IN_VIEW * float(np.abs(residual).max()):
        differences += [Stroke("limit, residual", ends, np.full(2, s * limit), ("--f-ink", INK), dash="6 2.5") for s in (1.0, -1.0)]
        entries.append(LegendEntry("limit, residual", "--f-ink", "6 2.5"))
    named = size[0] > NARROW  # in a narrow figure units alone find room beside the axes
    panels = [Panel("temperature" * named, "°C", lines, bands, share=2.4), Panel("residual" * named, "K", differences, low, (0.0,))]
    panels += [Panel("power" * named, "W", [replace(line, x=line.x / length) for line in power], share=0.7, zero=True)] if power else []
    tall = size[1] + (POWER_PANEL if power else 0.0)
    markup = chart(panels, key=key, label=label, x_name=("time", unit), size=(size[0], tall))
    entries += [LegendEntry("sensor, 95 %", "--f-measured", "band")] if wide > 0 else []
    return Graphic(markup, tuple(entries))


NARROW_TRACE = (300.0, 176.0)
"""Size of a trace of which three stand beside one another on a sheet. [px]"""


def trace(
    block: SensorTrace, key: str, label: str, drive: RecordDrive | None = None, limit: float | None = None, *, narrow: bool = False
) -> Graphic:
    """Return measured against simulated readings of one sensor in one record, with the residuals and what drove them below.

    Parameters
    ----------
    block : SensorTrace     The readings.
    key : str               Prefix of the figure's identifiers, different for every figure of a page.
    label : str             What a screen reader says before what is seen.
    drive, limit            As in `compared`.
    narrow : bool           Whether three of it stand beside one another.
    """
    rmse = float(np.sqrt(np.mean(block.residuals**2)))
    predicted = block.measured - block.residuals
    size = NARROW_TRACE if narrow else TRACE
    return compared(block.times, block.measured, predicted, key, f"{label}, RMSE {rmse:.3g} K", drive=drive, limit=limit, size=size)


def overview(lines: Sequence[Dots]) -> Graphic:
    """Return the RMSE of every record as a dot, a line per stage, a colour and mark per sensor, with a stroke at each median."""
    sensors = list(dict.fromkeys(s for line in lines for s in line.values))
    highest = widened(0.0, max((v for line in lines for values in line.values.values() for v in values), default=1.0))[1]
    width, x_left, right, row = 760.0, 190.0, 14.0, 42.0
    bottom = 8.0 + row * len(lines)
    ticks = nice_ticks(0.0, highest, 7)

    def place(value: float) -> float:
        """Return where a value stands on the axis. [px]"""
        return x_left + (width - x_left - right) * value / highest

    def dot(m: int, x: float, y: float) -> str:
        """Return the m-th mark as SVG at (x, y). [px]"""
        fill = f"fill:var(--s{m % len(SERIES)},{SERIES[m % len(SERIES)]})"
        return f'<path d="{SHAPES[m % len(SHAPES)]}" transform="translate({x:.1f} {y:.1f})" style="{fill};fill-opacity:.75"/>'

    rules = "".join(f"M{place(t):.1f} 8V{bottom:.0f}" for t in ticks)
    out = [f'<path d="{rules}" style="fill:none;stroke:var(--f-grid,{GRID})"/>']
    out += [f'<text x="{place(t):.1f}" y="{bottom + 15:.0f}" text-anchor="middle">{number_text(t, ticks[1])}</text>' for t in ticks]
    texts = []
    for k, line in enumerate(lines):
        middle = 8.0 + row * (k + 0.5)
        name = f'<tspan style="fill:var(--f-ink,{INK})">{escape(cut(line.label, 26))}</tspan>'
        under = "held out" if line.held_out else escape(line.doubt)
        look = f' style="fill:var(--bad,{RESIDUAL});font-weight:700"' if line.doubt else ""
        held = f'<tspan x="{x_left - 10:g}" dy="13"{look}>{under}</tspan>' if under else ""
        out.append(f'<text x="{x_left - 10:g}" y="{middle + (4 if not held else -2):.1f}" text-anchor="end">{name}{held}</text>')
        for at, (sensor, errors) in enumerate(line.values.items()):
            m, values = sensors.index(sensor), np.asarray(errors, dtype=float)
            shift = 0.0 if len(line.values) == 1 else 0.5 * (at / (len(line.values) - 1) - 0.5)
            # dots of one value lie apart, the same way every time
            offsets = ((np.arange(values.size) * 0.618034) % 1.0 - 0.5) * 0.3 / len(line.values) if values.size > 1 else np.zeros(1)
            out += [dot(m, place(float(v)), middle + row * (shift + float(o))) for v, o in zip(values, offsets, strict=True)]
            if values.size > 1:
                median = f"M{place(float(np.median(values))):.1f} {middle + row * shift - 8:.1f}v16"
                out.append(f'<path d="{median}" style="fill:none;stroke:var(--f-ink,{INK});stroke-width:1.8"/>')
        highest_here = max((v for values in line.values.values() for v in values), default=0.0)
        texts.append(
            f"{line.label}{', hold-out' if line.held_out else ''}{f', {line.doubt}' if line.doubt else ''}: at most {highest_here:.3g} K"
        )
    axis = f'<path d="M{x_left:g} {bottom:.0f}H{width - right:g}" style="stroke:var(--f-soft,{SOFT});stroke-width:.8"/>'
    end = f'<text x="{(x_left + width - right) / 2:.0f}" y="{bottom + 32:.0f}" text-anchor="middle">RMSE of a record, K</text>'
    label = escape(f"RMSE per record and sensor, by stage. {'; '.join(texts[:14])}.")
    markup = (
        f'<svg class="plot" role="img" aria-label="{label}" viewBox="0 0 {width:g} {bottom + 38:.0f}" '
        f'style="font-size:12px;fill:var(--f-soft,{SOFT})">{"".join(out)}{axis}{end}</svg>'
    )
    entries = [LegendEntry(s, f"--s{m % len(SERIES)}", "", MARKS[m % len(MARKS)]) for m, s in enumerate(sensors)]
    if any(len(values) > 1 for line in lines for values in line.values.values()):
        entries.append(LegendEntry("median", "--f-ink", "", "❙"))
    return Graphic(markup, tuple(entries))


def cut(text: str, most: int) -> str:
    """Return a text of at most so many characters; a longer one ends in an ellipsis."""
    return text if len(text) <= most else f"{text[: most - 1]}…"


def prediction(solution: Solution, key: str, label: str) -> Graphic:
    """Return the temperatures of every node of a solution over time."""
    length, unit = time_unit(float(solution.times[-1] - solution.times[0]))
    lines, entries = [], []
    for k, node in enumerate(solution.nodes):
        colour, dash = series_look(k)
        celsius = solution.temperatures[:, k] - ICE_POINT
        name = f"{node} {celsius[-1]:.1f} °C"
        lines.append(Stroke(name, solution.times / length, celsius, colour, dash=dash))
        entries.append(LegendEntry(name, colour[0], dash))
    markup = chart([Panel("temperature", "°C", lines)], key=key, label=label, x_name=("time", unit), size=(760, 330), named=True)
    return Graphic(markup, tuple(entries))


def predicted_bands(prediction: Prediction, key: str, label: str, limits: Sequence[float] = ()) -> Graphic:
    """Return the temperature of every predicted node over time with its 95 % band, and limits as thin lines. [K]"""
    length, unit = time_unit(float(prediction.times[-1] - prediction.times[0]))
    lines, areas, entries = [], [], []
    for k, (node, band) in enumerate(prediction.bands.items()):
        colour, dash = series_look(k)
        low, high = band.interval()
        areas.append(Area(f"{node}, 95 %", band.times / length, low, high, colour))
        lines.append(Stroke(node, band.times / length, band.celsius, colour, dash=dash))
        entries.append(LegendEntry(f"{node} {low[-1]:.1f} to {high[-1]:.1f} °C at the end", colour[0], dash))
    panel = Panel("temperature", "°C", lines, areas, sorted({t - ICE_POINT for t in limits}))
    tall = max(240.0, 60.0 + 1.1 * END_LABEL * len(lines))
    return Graphic(chart([panel], key=key, label=label, x_name=("time", unit), size=(760, tall), named=True), tuple(entries))


def coverage(shares: Mapping[str, Mapping[float, float]], key: str, label: str) -> Graphic:
    """Return the share of readings inside a band over the share that the band promises, a line for each record.

    Below the diagonal bands are too narrow. More records than colours are drawn as their mean, between the lowest and the highest.

    Parameters
    ----------
    shares : dict   Record -> nominal share -> share observed. [-]
    key : str       Prefix of the figure's identifiers.
    label : str     What a screen reader says.
    """
    levels = np.array(sorted(next(iter(shares.values()))))
    observed = 100.0 * np.array([[shares_of_record[level] for level in levels.tolist()] for shares_of_record in shares.values()])
    x = 100.0 * levels
    lines, areas = [Stroke("as promised", x, x, ("--f-ink", INK), dash="6 2.5")], []
    if len(shares) <= len(SERIES):
        looks = map(series_look, range(len(shares)))
        lines += [Stroke(n, x, y, look, dash=dash) for n, y, (look, dash) in zip(shares, observed, looks, strict=True)]
    else:
        areas = [Area("lowest to highest", x, observed.min(axis=0), observed.max(axis=0))]
        lines.append(Stroke(f"mean of {len(shares)} records", x, observed.mean(axis=0), LOOKS["simulated"]))
    panel = Panel("readings inside", "%", lines, areas, (100.0,))
    markup = chart([panel], key=key, label=label, x_name=("nominal share of the band", "%"), size=(760, 300))
    entries = [LegendEntry(line.label, line.colour[0], line.dash, width=line.width) for line in lines]
    return Graphic(markup, (*entries, *(LegendEntry(a.label, "--f-simulated", "band") for a in areas)))


STYLES: dict[str, tuple[tuple[str, str], float, str]] = {
    "measured": (("--f-measured", MEASURED), WIDE_LINE, ""),
    "simulated": (("--f-simulated", SIMULATED), THIN, "6 2.5"),
    "bound": (("--f-residual", RESIDUAL), THIN, "1.5 2.5"),
    "bound off": (("--f-residual", RESIDUAL), THIN, "6 2 1.5 2"),
    "bound start": (("--f-residual", RESIDUAL), 2.0 * WIDE_LINE, ""),
    "other": (("--s2", SERIES[2]), THIN, "8 2.5 2 2.5"),
    "truth": (("--f-ink", INK), THIN, ""),
}
"""Colour, width [px] and dashes of every look."""


def curve(label: str, look: str, times: Array, values: Array, less: tuple[str, str] | None = None) -> Stroke:
    """Return one line for `curves`.

    Parameters
    ----------
    label : str             What the legend says; lines of one label have one look.
    look : str              One of `STYLES`.
    times : array (times,)  [s]
    values : array (times,) In the unit of the axis.
    less : (str, str)       Labels of the two curves whose difference it is, in the same unit; None for no difference.
    """
    return Stroke(label, times, values, *STYLES[look], less=less)


def curves(
    lines: Sequence[Stroke],
    key: str,
    label: str,
    *,
    band: Area | None = None,
    below: Sequence[Stroke] = (),
    names: tuple[str, str] = ("temperature, °C", ""),
    top: float | None = None,
    size: tuple[float, float] = (440, 250),
    drive: RecordDrive | None = None,
) -> Graphic:
    """Return curves over time; a curve that leaves the top is marked with the value at which it ends.

    Parameters
    ----------
    lines : sequence of Stroke  What is drawn, over seconds.
    key : str                   Prefix of the figure's identifiers.
    label : str                 What a screen reader says.
    band : Area                 An interval behind the lines.
    below : sequence            Curves of a second, lower axis, such as differences.
    names : (upper, lower)      What the axes show.
    top : float                 Upper end of the axis, where not everything is to be seen.
    size : (width, height)      Without the panel of the power. [px]
    drive : RecordDrive               Ambient temperatures and power; none drawn without it.
    """
    length, unit = time_unit(max(float(c.x[-1]) for c in lines))
    areas = [replace(band, x=band.x / length)] if band is not None else []
    ambient, power = driven(drive, float(lines[0].x[0]), max(float(c.x[-1]) for c in lines))
    panels = [_axes(names[0], (*lines, *ambient), length, areas, top, 2.2)]
    if below:
        panels.append(_axes(names[1], below, length))
    if power:
        panels.append(replace(_axes("power, W", power, length, share=0.7), zero=True))
    markup = chart(panels, key=key, label=label, x_name=("time", unit), size=(size[0], size[1] + (POWER_PANEL if power else 0.0)))
    legend = {c.label: c for c in (*lines, *ambient, *below, *power)}
    entries = [LegendEntry(text, c.colour[0], c.dash, width=c.width) for text, c in legend.items()]
    if band is not None:
        entries.append(LegendEntry(band.label, "--f-simulated", "band"))
    return Graphic(markup, tuple(entries))


def _axes(
    name: str, lines: Sequence[Stroke], length: float, areas: Sequence[Area] = (), top: float | None = None, share: float = 1.0
) -> Panel:
    """Return a panel from a name as "quantity, symbol, unit" and lines over time in units of `length`. [s]"""
    what, _, unit = name.partition(", ")
    return Panel(what, unit, [replace(c, x=c.x / length) for c in lines], areas, top=top, share=share)
