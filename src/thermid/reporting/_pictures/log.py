"""The picture of a log: what its columns hold over time."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Final

from thermid.base.errors import ThermidError
from thermid.base.units import from_si, in_si
from thermid.measure.looks import Look
from thermid.reporting._pictures.chart import Panel, Stroke, chart, series_look, time_unit

_PANELS: Final = (("temperature", "°C", ("temperature", "boundary")), ("power", "W", ("power",)), ("duty", "%", ("duty",)))


def log_drawing(look: Look) -> str:
    """Return a picture (SVG) of temperatures, powers and duties of a log over time, with a legend.

    Raises
    ------
    ThermidError   When times cannot be read or no column is known.
    """
    if look.times is None:
        raise ThermidError(f"nothing to draw: {look.problem}", look.path.name, code="result.nothing-to-draw")
    length, unit_name = time_unit(float(look.times.values[-1] - look.times.values[0]))
    x = (look.times.values - look.times.values[0]) / length
    panels: list[Panel] = []
    legend: list[tuple[str, str, str]] = []
    for name, shown, guesses in _PANELS:
        lines = []
        for c in (c for c in look.columns if c.guess in guesses and c.good.any()):
            colour, dash = series_look(len(legend))
            lines.append(
                Stroke(
                    c.name,
                    x[c.good],
                    from_si(in_si(c.values, c.unit), {"°C": "degC"}.get(shown, shown))[c.good],
                    colour,
                    dash=dash,
                )
            )
            legend.append((c.name, colour[1], dash))
        if lines:
            panels.append(Panel(name, shown, lines, share=2.0 if name == "temperature" else 1.0))
    if not panels:
        raise ThermidError(
            "nothing to draw: no column is recognised as a temperature, power or duty cycle. Give its unit.",
            look.path.name,
            code="result.nothing-to-draw",
        )
    return _standing(panels, legend, look.path.name, unit_name)


def _standing(panels: Sequence[Panel], legend: Sequence[tuple[str, str, str]], name: str, unit_name: str) -> str:
    """Return a picture that stands by itself: white, with a title and a legend above the axes."""
    wide, tall = 760.0, 170.0 + 130.0 * len(panels)
    markup = chart(panels, key="look", label=f"Log {name}", x_name=("time", unit_name), size=(wide, tall))
    across = [(52.0 + 176.0 * (k % 4), 44.0 + 18.0 * (k // 4)) for k in range(len(legend))]
    entries = "".join(
        f'<path d="M{x:g} {y - 4:g}h22" style="stroke:{colour};stroke-width:2;stroke-dasharray:{dash or "none"}"/>'
        f'<text x="{x + 28:g}" y="{y:g}">{escape(text if len(text) <= 22 else f"{text[:16]}..{text[-4:]}")}</text>'
        for (x, y), (text, colour, dash) in zip(across, legend, strict=True)
    )
    top = across[-1][1] + 12.0
    inner = markup.replace("<svg ", f'<svg x="0" y="{top:g}" width="{wide:g}" height="{tall:g}" ', 1)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {wide:g} {top + tall:g}" width="{wide:g}" height="{top + tall:g}" '
        f'style="font:12px system-ui,sans-serif"><rect width="100%" height="100%" style="fill:#fff"/>'
        f'<text x="52" y="20" style="font-weight:600">{escape(name)}</text>{entries}{inner}</svg>'
    )
