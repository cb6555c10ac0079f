"""Curves over time in one figure: as measured, as simulated, as bounded, in the manner of the source document's figures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thermid.reporting.blocks.sections import Drawn, Entry
from thermid.reporting.pictures.chart import Area, Line, Panel, chart
from thermid.reporting.pictures.figures import INK, MEASURED, RESIDUAL, SERIES, SIMULATED, time_unit

Array = NDArray[np.float64]

LOOKS: dict[str, tuple[tuple[str, str], float, str]] = {
    "measured": (("--f-measured", MEASURED), 3.4, ""),
    "simulated": (("--f-simulated", SIMULATED), 1.6, "6 2.5"),
    "bound": (("--f-residual", RESIDUAL), 1.6, "1.5 2.5"),
    "bound off": (("--f-residual", RESIDUAL), 1.6, "6 2 1.5 2"),
    "bound start": (("--f-residual", RESIDUAL), 6.0, ""),
    "other": (("--s2", SERIES[2]), 1.4, "8 2.5 2 2.5"),
    "truth": (("--f-ink", INK), 1.1, ""),
}
"""Colour, width [px] and dashes of every look."""


@dataclass(frozen=True)
class Curve:
    """One line.

    Parameters
    ----------
    label : str             What the legend says; lines of one label have one look.
    look : str              One of `LOOKS`.
    times : array (times,)  [s]
    values : array (times,) In the unit of the axis.
    less : (str, str)       Labels of the two curves whose difference it is, in the same unit; None for no difference.
    """

    label: str
    look: str
    times: Array
    values: Array
    less: tuple[str, str] | None = None


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
    areas = [Area(band.label, band.times / length, band.low, band.high, LOOKS["simulated"][0])] if band is not None else []
    panels = [_panel(names[0], lines, length, areas, top, 2.2)]
    if below:
        panels.append(_panel(names[1], below, length))
    markup, points = chart(panels, key=key, label=label, x_name=("time", unit), size=size)
    seen = {c.label: LOOKS[c.look] for c in (*lines, *below)}
    entries = [Entry(text, variable, dash, width=width) for text, ((variable, _), width, dash) in seen.items()]
    if band is not None:
        entries.append(Entry(band.label, "--f-simulated", "band"))
    return Drawn(markup, tuple(entries), points)


def _panel(
    name: str, lines: Sequence[Curve], length: float, areas: Sequence[Area] = (), top: float | None = None, share: float = 1.0
) -> Panel:
    what, _, unit = name.partition(", ")
    drawn = [Line(c.label, c.times / length, c.values, *LOOKS[c.look], less=c.less) for c in lines]
    return Panel(what, unit, drawn, areas, top=top, share=share)
