"""Charts of a correlation: tests by sensors coloured by error over limit, predicted against measured, residuals counted."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from html import escape
from typing import Final

import numpy as np

from thermid.base.linear_algebra import Array
from thermid.physics.constants import ICE_POINT
from thermid.reporting._blocks.content import Graphic, Plot
from thermid.reporting._pictures.chart import nice_ticks, number_text
from thermid.reporting._pictures.figures import GRID, INK, RESIDUAL, SIMULATED, SOFT, cut

CHART_WIDTH, CHART_HEIGHT = 300.0, 232.0
"""Size of a chart. [px]"""
BOX: Final = (46.0, 8.0, CHART_WIDTH - 56.0, CHART_HEIGHT - 52.0)
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
    cell = max(36.0, (CHART_WIDTH - x_left - (28.0 if steep else 0.0)) / len(columns))
    head = min(86.0, 12.0 + 4.9 * max(len(c) for c in columns)) if steep else 22.0
    width, height = x_left + cell * len(columns) + (28.0 if steep else 0.0), head + CELL * len(rows) + 6.0
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
    """Return the colour of an error over its limit: blue far below it, white at it, orange beyond; dark text stands on all of them."""
    cold, mild, warm = (160, 203, 236), (250, 248, 240), (245, 150, 80)
    share = min(max(ratio, 0.0), 2.0)
    a, b, part = (cold, mild, share) if share <= 1.0 else (mild, warm, share - 1.0)
    if share > 1.0:
        part = 0.45 + 0.55 * part
    return "#" + "".join(f"{round(p + part * (q - p)):02x}" for p, q in zip(a, b, strict=True))


def scatter(measured: Sequence[Array], predicted: Sequence[Array]) -> Graphic:
    """Return predicted over measured temperatures of all traces, with lines 2, 3 and 5 K from equality.

    Parameters
    ----------
    measured, predicted : sequences of arrays (samples,)    One of each for every trace. [K]
    """
    x, y = (np.concatenate(v) - ICE_POINT for v in (measured, predicted))
    low, high = _ends(np.concatenate([x, y]), 6.0)
    box = BOX

    def at(v: float, w: float) -> tuple[float, float]:
        """Return where a pair of temperatures stands in the box. [px]"""
        return box[0] + box[2] * (v - low) / (high - low), box[1] + box[3] * (high - w) / (high - low)

    out = [_axes(box, (low, high), (low, high), ("measured, °C", "predicted, °C"))]
    for shift, dash in [(0.0, ""), *((sign * k, dash) for k, dash in BANDS for sign in (1.0, -1.0))]:
        a, b = max(low, low - shift), min(high, high - shift)
        (x1, y1), (x2, y2) = at(a, a + shift), at(b, b + shift)
        look = f"stroke-width:{1.3 if shift == 0 else 0.9};stroke-dasharray:{dash or 'none'}"
        out.append(f'<path d="M{x1:.1f} {y1:.1f}L{x2:.1f} {y2:.1f}" style="fill:none;stroke:var(--f-soft,{SOFT});{look}"/>')
    step = max(1, x.size // MAX_SCATTER_DOTS)
    dots = "".join(f"M{at(v, w)[0]:.1f} {at(v, w)[1]:.1f}h.01" for v, w in zip(x[::step].tolist(), y[::step].tolist(), strict=True))
    look = f"fill:none;stroke:var(--f-simulated,{SIMULATED});stroke-width:3.4;stroke-linecap:round;stroke-opacity:.55"
    out.append(f'<path d="{dots}" style="{look}"/>')
    return _whole(out, f"Predicted against measured, {x.size} readings: {_shares_within(y - x)}", CHART_WIDTH, CHART_HEIGHT)


def histogram(residuals: Sequence[Array]) -> Graphic:
    """Return how many residuals of all traces lie where, in per cent of the readings.

    Parameters
    ----------
    residuals : sequence of arrays (samples,)   Measured less predicted. [K]
    """
    r = np.concatenate(residuals)
    far = float(np.abs(r).max()) * 1.05 or 1.0
    counts, _ = np.histogram(r, bins=31, range=(-far, far))
    share = 100.0 * counts / r.size
    top = float(share.max()) * 1.08
    box = BOX
    out = [_axes(box, (-far, far), (0.0, top), ("measured less predicted, K", "readings, %"))]
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
    """Return predicted against measured temperatures, and the residuals counted.

    Parameters
    ----------
    measured, predicted : sequences of arrays (samples,)    One of each for every trace. [K]
    word : str                                              What the captions call the predicted ones.
    of : str                                                What the captions say of which records they are.
    """
    residuals = [m - p for m, p in zip(measured, predicted, strict=True)]
    r = np.concatenate(residuals)
    spread = f"mean {r.mean():+.2f} K, standard deviation {r.std():.2f} K; {_shares_within(r)}"
    caption = f"{word} against measured{of}; lines at ± 2 K, ± 3 K (dashed) and ± 5 K (dotted)."
    return (
        Plot(scatter(measured, predicted), caption, "", "fig-scatter"),
        Plot(histogram(residuals), f"Residuals{of}: {spread}.", "", "fig-histogram"),
    )


def _shares_within(residuals: Array) -> str:
    """Return which shares of residuals (samples,) lie within 2, 3 and 5 K."""
    return ", ".join(f"{100 * float(np.mean(np.abs(residuals) <= k)):.0f} % within {k:g} K" for k, _ in BANDS)


def _ends(values: Array, least: float) -> tuple[float, float]:
    """Return the ends of an axis: 6 % beyond the values, and at least so far apart."""
    low, high = float(values.min()), float(values.max())
    room = max(0.06 * (high - low), 0.5 * (least - (high - low)), 1e-3)
    return low - room, high + room


def _axes(box: tuple[float, float, float, float], x: tuple[float, float], y: tuple[float, float], names: tuple[str, str]) -> str:
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
        f'style="font-size:12px;fill:var(--f-soft,{SOFT})">{"".join(parts)}</svg>',
        (),
    )
