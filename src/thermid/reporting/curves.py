"""Curves over time in one figure: as measured, as simulated, as bounded, in the manner of the source document's figures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.reporting.figures import MEASURED, RESIDUAL, SIMULATED, SOFT, VARIABLES, Drawn, Entry, canvas, draw_line, markup_of, time_unit

__all__ = ["Band", "Curve", "curves"]

Array = NDArray[np.float64]

LOOKS: dict[str, dict[str, Any]] = {
    "measured": {"color": MEASURED, "linewidth": 3.2, "solid_capstyle": "round"},
    "simulated": {"color": SIMULATED, "linewidth": 1.5, "dashes": (5, 1.6)},
    "bound": {"color": RESIDUAL, "linewidth": 1.5, "dashes": (1.2, 1.6)},
    "other": {"color": "#009e73", "linewidth": 1.3, "dashes": (6, 1.6, 1.4, 1.6)},
    "truth": {"color": "#1c2430", "linewidth": 1.0},
}
DASHED = {"simulated": "dashed", "bound": "dotted", "other": "dashdot"}


@dataclass(frozen=True)
class Curve:
    """One line.

    Parameters
    ----------
    label : str             What the legend says; lines of one label have one look.
    look : str              measured, simulated, bound, other or truth.
    times : array (times,)  [s]
    values : array (times,) In the unit of the axis.
    """

    label: str
    look: str
    times: Array
    values: Array


@dataclass(frozen=True)
class Band:
    """An area between two lines, such as an interval; times [s], low and high (times,) in the unit of the axis."""

    label: str
    times: Array
    low: Array
    high: Array


def curves(
    lines: Sequence[Curve],
    key: str,
    label: str,
    *,
    band: Band | None = None,
    below: Sequence[Curve] = (),
    names: tuple[str, str] = ("temperature, °C", ""),
    top: float | None = None,
    size: tuple[float, float] = (440, 250),
) -> Drawn:
    """Return curves over time; a curve that leaves the top is marked with the value at which it ends.

    Parameters
    ----------
    lines : sequence of Curve   What is drawn.
    key : str                   Prefix of the figure's identifiers.
    label : str                 What a screen reader says.
    band : Band                 An interval behind the lines.
    below : sequence            Curves of a second, lower axis, such as differences.
    names : (upper, lower)      What the axes show.
    top : float                 Upper end of the axis, where not everything is to be seen.
    size : (width, height)      [px]
    """
    length, unit = time_unit(max(float(c.times[-1]) for c in lines))
    width, height = size
    points = 0
    with canvas(width, height, 2 if below else 1, (2.2, 1) if below else None) as (figure, axes):
        if band is not None:
            axes[0].fill_between(band.times / length, band.low, band.high, color=SIMULATED, alpha=0.22, linewidth=0)
            points += 2 * band.times.size
        for axis, drawn in ((axes[0], lines), *([(axes[1], below)] if below else [])):
            for c in drawn:
                points += draw_line(axis, c.times / length, c.values, **LOOKS[c.look])
        if top is not None:
            axes[0].set_ylim(top=top)
            _mark_leaving(axes[0], lines, length, top)
        axes[0].set_ylabel(names[0])
        axes[0].margins(x=0.01)
        axes[-1].set_xlabel(f"time, {unit}")
        if below:
            axes[0].tick_params(labelbottom=False)
            axes[1].set_ylabel(names[1])
            figure.align_ylabels(axes)
        left = 66 / width
        figure.subplots_adjust(left=left, right=0.985, top=0.97, bottom=40 / height, hspace=0.12)
        markup = markup_of(figure, label, key, points)
    seen = {c.label: c.look for c in (*lines, *below)}
    entries = [Entry(text, VARIABLES.get(LOOKS[look]["color"], "--f-ink"), DASHED.get(look, "")) for text, look in seen.items()]
    if band is not None:
        entries.append(Entry(band.label, "--f-simulated", "band"))
    return Drawn(markup, tuple(entries), points)


def _mark_leaving(axis: Any, lines: Sequence[Curve], length: float, top: float) -> None:
    """Write where a line that leaves the top would end."""
    for c in lines:
        if c.values[-1] <= top:
            continue
        k = int((c.values > top).argmax())
        axis.annotate(
            f"{c.values[-1]:.0f} at the end",
            (c.times[k] / length, top),
            xytext=(5, -11),
            textcoords="offset points",
            color=SOFT,
            fontsize=9,
        )
