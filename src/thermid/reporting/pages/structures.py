"""`structures_report`: candidate structures of one model side by side: likelihood, unseen runs, physical sense, bounds."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median

from thermid.arguments import takes_objects
from thermid.reporting.blocks.content import (
    DASH,
    Cell,
    Figures,
    Head,
    Heading,
    Line,
    Notes,
    PageBlock,
    Plot,
    Section,
    Table,
    Words,
    folded,
    number,
    pretty,
    significant,
)
from thermid.reporting.blocks.extras import write_page
from thermid.reporting.pages import tables
from thermid.reporting.pictures import figures
from thermid.reporting.pictures.figures import Dots

CLOSE = 1.05
"""Errors on unseen runs within this factor of the lowest say nothing between structures."""
LITTLE = 10.0
"""Difference of the corrected AIC above which a structure has no support (Burnham and Anderson 2002, section 2.6)."""


@dataclass(frozen=True)
class Structure:
    """One candidate, fitted to the same records as the others.

    Parameters
    ----------
    name, what : str        What it is called, and what it is made of.
    free : int              Values that it frees, those of single runs not counted.
    likelihood : float      -2 log likelihood up to a constant. [-]
    aic, corrected : float  Difference of AIC from the best, and the same with the likelihood divided by what the memory of residuals
                            inflates it. [-]
    fitted : dict           Sensor -> median over the fitted runs of the RMSE. [K]
    unseen : dict           Sensor -> run that no fit has seen -> RMSE. [K]
    values : dict           Parameter -> value, error and unit.
    at_bounds : tuple       Parameters that ended at a bound, in words.
    doubts : tuple          What else is unphysical or unknown, in words.
    refused : str           Why it could not be fitted; empty where it was.
    """

    name: str
    what: str
    free: int
    likelihood: float = float("nan")
    aic: float = float("nan")
    corrected: float = float("nan")
    fitted: Mapping[str, float] = field(default_factory=dict)
    unseen: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    values: Mapping[str, tuple[float, float, str]] = field(default_factory=dict)
    at_bounds: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()
    refused: str = ""

    @property
    def physical(self) -> bool:
        """Whether it was fitted and nothing is held against its values."""
        return not (self.refused or self.at_bounds or self.doubts)

    @property
    def error(self) -> float:
        """Median over unseen runs, mean over sensors. [K]"""
        medians = [median(runs.values()) for runs in self.unseen.values()]
        return sum(medians) / len(medians) if medians else float("inf")


@takes_objects
def structures_report(
    title: str,
    structures: Sequence[Structure],
    *,
    to: str | os.PathLike[str],
    chosen: str = "",
    reasons: Sequence[str] = (),
    notes: Sequence[str] = (),
) -> Path:
    """Write a comparison of structures as one HTML page and return its path. The page loads nothing and runs no script but its own.

    Parameters
    ----------
    title : str             What was modelled.
    structures : sequence   The candidates, from the simplest.
    to : path               The file to write; its folder is made where it is missing.
    chosen : str            The one that its author takes; the simplest physical one within 5 % of the lowest error by default.
    reasons : sequence      Why, in the author's words.
    notes : sequence        What a reader must know of data and method.

    Raises
    ------
    ValueError          Without structures, or when the chosen one is not among them.
    MissingExtraError   When jinja2 is not installed.
    """
    if not structures:
        raise ValueError("there are no structures to compare.")
    taken = _taken(structures, chosen)
    return write_page(
        "study.html.jinja",
        to,
        title=title,
        opening=list(notes),
        watermark="",
        tile="",
        banners=[],
        headline=f"Taken: {taken.name}" if taken else "None can be taken",
        failed=0 if taken and taken.physical else 1,
        judged=1,
        summary=taken.what if taken else "every structure was refused, or has values that cannot be",
        outcome=[Notes((*_said(structures, taken), *reasons), "What the comparison says")],
        sections=[
            Section.of("side-by-side", "Side by side", [_overview(structures, taken), *_dots(structures)]),
            Section.of("values", "Values, and what is held against them", _values(structures)),
            Section.of("provenance", "Provenance", [tables.versions()]),
        ],
    )


def _taken(structures: Sequence[Structure], chosen: str) -> Structure | None:
    if chosen:
        found = [s for s in structures if s.name == chosen]
        if not found:
            raise ValueError(f"no structure is called '{chosen}'; there are {', '.join(s.name for s in structures)}.")
        return found[0]
    good = [s for s in structures if s.physical]
    best = min((s.error for s in good), default=0.0)
    return min((s for s in good if s.error <= CLOSE * best), key=lambda s: s.free, default=None)


def _said(structures: Sequence[Structure], taken: Structure | None) -> list[str]:
    """Return what likelihood, unseen runs and physics say, and where they disagree."""
    known = [s for s in structures if not s.refused]
    out = []
    if known:
        likeliest, nearest = min(known, key=lambda s: s.corrected), min(known, key=lambda s: s.error)
        wrong = "" if likeliest.physical else f", and cannot be: {'; '.join((*likeliest.at_bounds, *likeliest.doubts))}"
        out.append(f"Likeliest on the fitted runs: {likeliest.name}{wrong}.")
        out.append(f"Nearest to the unseen runs: {nearest.name}, {number(nearest.error, 2)} K.")
        if taken is not None and taken is not nearest:
            away = taken.error / nearest.error - 1.0
            why = "" if nearest.physical else f"; of {nearest.name}: {'; '.join((*nearest.at_bounds, *nearest.doubts))}"
            out.append(f"{taken.name} misses them by {number(taken.error, 2)} K, {100 * away:.0f} % more{why}.")
    refused = [s.name for s in structures if s.refused]
    if refused:
        out.append(f"Refused, because these runs cannot tell what it asks: {', '.join(refused)}.")
    return out


def _overview(structures: Sequence[Structure], taken: Structure | None) -> Table:
    sensors = list(dict.fromkeys(name for s in structures for name in s.unseen))
    columns = [
        Head("structure"),
        Head("what it is", wrapped=True),
        Head("free", True),
        Head("dQAIC", True, "difference of AIC from the best, likelihood corrected for residuals that wander; above 10: no support"),
        Head("dAIC", True, "as if every sample were independent, which none is"),
        *(Head(f"{s} fitted, K", True, "median RMSE over the fitted runs") for s in sensors),
        *(Head(f"{s} unseen, K", True, "median RMSE over runs that no fit has seen") for s in sensors),
        Head("at bounds", True),
        Head("physical"),
    ]
    lowest = {s: min((median(x.unseen[s].values()) for x in structures if s in x.unseen), default=0.0) for s in sensors}
    rows: list[Line] = []
    for x in structures:
        name = Cell(f"▸ {x.name}" if x is taken else x.name, "", "main")
        if x.refused:
            rows.append([name, x.what, str(x.free), *[DASH] * (2 + 2 * len(sensors)), DASH, Cell("refused", x.refused, "warn")])
            continue
        unseen = [median(x.unseen[s].values()) for s in sensors]
        looks = ["good" if u <= CLOSE * lowest[s] else "" for s, u in zip(sensors, unseen, strict=True)]
        verdict = Cell("✓ yes", "", "good") if x.physical else Cell(f"✗ {len(x.at_bounds) + len(x.doubts)} doubtful", "", "warn")
        rows.append(
            [
                name,
                x.what,
                str(x.free),
                Cell(f"{x.corrected:.0f}", "", "good" if x.corrected < LITTLE else ""),
                f"{x.aic:.0f}",
                *(number(x.fitted[s], 2) for s in sensors),
                *(Cell(number(u, 2), "", look) for u, look in zip(unseen, looks, strict=True)),
                Cell(str(len(x.at_bounds)), "", "warn" if x.at_bounds else ""),
                verdict,
            ]
        )
    caption = "From the simplest down; ▸ is taken. Strong: within 5 % of the lowest error, or with support by the corrected likelihood."
    return Table.of(columns, rows, caption)


def _dots(structures: Sequence[Structure]) -> list[PageBlock]:
    known = [Dots(s.name, {sensor: list(runs.values()) for sensor, runs in s.unseen.items()}, True) for s in structures if s.unseen]
    if not known:
        return []
    drawn = figures.overview(known)
    return [Figures((Plot(drawn, "RMSE on each run that no fit has seen, K; a structure a line."),), drawn.legend, True)]


def _values(structures: Sequence[Structure]) -> list[PageBlock]:
    out: list[PageBlock] = []
    for s in structures:
        out.append(Heading(s.name))
        if s.refused:
            out.append(Notes((s.refused,), "Refused"))
            continue
        held = (*s.at_bounds, *s.doubts)
        out.append(
            Notes(held, "Held against it") if held else Words("Every value lies where books and data sheets put it, inside its bounds.")
        )
        rows: list[Line] = [
            [Cell(p, "", "main"), f"{significant(v, e)} ± {number(e, 2)}", pretty(unit)] for p, (v, e, unit) in s.values.items()
        ]
        table = Table.of([Head("value"), Head("found ± total error", True), Head("unit")], rows)
        out.append(folded("Its values", [table], f"{len(rows)} of them"))
    return out
