"""`report`: a campaign as one self-contained HTML page."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from thermid.arguments import takes_objects
from thermid.campaign.stages import Campaign
from thermid.fit.calibration import Calibration
from thermid.reporting.blocks.cells import Cell, Column, Line, Table, duration, number
from thermid.reporting.blocks.extras import write_page
from thermid.reporting.blocks.sections import Drawn
from thermid.reporting.diagrams.diagram import diagram
from thermid.reporting.pages import levels, origins, tables
from thermid.reporting.pages.glance import glance, tightest
from thermid.reporting.pages.trust import trust
from thermid.reporting.pictures import figures
from thermid.reporting.pictures.figures import Dots

if TYPE_CHECKING:
    from thermid.fit.problem.residuals import SensorTrace
    from thermid.model.tree.model import Model
    from thermid.simulation.solution import Solution

FEW = 4
"""Up to so many traces stand open on the page; more are folded away."""


@dataclass(frozen=True)
class Trace:
    """One trace that is drawn, what marks it (best, median or worst), and the model where several stand together."""

    block: SensorTrace
    mark: str
    model: str
    drawn: Drawn


@dataclass(frozen=True)
class Traces:
    """The traces of a stage or of all verdicts that are drawn, and the text that says which."""

    drawn: Sequence[Trace]
    text: str
    opened: bool


@dataclass(frozen=True)
class StagePart:
    """What the page says of one stage."""

    key: str
    name: str
    model: Model
    facts: tuple[tuple[str, str], ...]
    warnings: tuple[str, ...]
    diagram: str
    traces: Traces
    tables: Mapping[str, Table]
    trust: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Prediction:
    """What the page says of one simulated scenario."""

    key: str
    title: str
    solution: Solution
    drawn: Drawn
    ends: Table
    diagram: str
    length: str


@takes_objects
def report(
    campaign: Campaign,
    *,
    to: str | os.PathLike[str],
    scenarios: Sequence[tuple[str, Solution]] = (),
    notes: str | Sequence[str] = (),
) -> Path:
    """Write a campaign as one HTML page and return its path.

    The page holds everything: verdicts, what a reader must know, coefficients by level, and for each stage its diagram, parameters before
    and after, sensors, measured against simulated with residuals; then predictions and provenance. It loads nothing and runs no script
    but its own, without which it stands as well.

    Parameters
    ----------
    campaign : Campaign     The result of `run_stages`, or one made in Python.
    to : path               The file to write; its folder is made where it is missing.
    scenarios : sequence    Pairs (title, Solution): what the model predicts.
    notes : str(s)          What the author says, a paragraph each.

    Raises
    ------
    MissingExtraError   When jinja2 is not installed.
    """
    made, of = origins.made_records(campaign)
    coefficients, others = tables.levels(campaign)
    paragraphs = [p for text in ([notes] if isinstance(notes, str) else notes) for p in text.split("\n\n") if p.strip()]
    return write_page(
        "page.html.jinja",
        to,
        title=campaign.title,
        campaign=campaign,
        synthetic=made,
        record_count=of,
        notes=[p for p in (campaign.note, *paragraphs) if p],
        verdicts=tables.verdicts(campaign) if campaign.verdicts else None,
        held_out=_held_out(campaign),
        tightest=tightest(campaign),
        coefficients=coefficients,
        others=others,
        overview=figures.overview(_dots(campaign)) if campaign.stages else None,
        stages=[_stage(f"stage-{k}", c, campaign) for k, c in enumerate(_fits(campaign), 1)],
        predictions=[_prediction(f"prediction-{k}", title, s, campaign) for k, (title, s) in enumerate(scenarios, 1)],
        data=origins.data(campaign),
        models=origins.models(campaign),
        versions=origins.versions(),
        seen=glance(campaign, {"verdicts": "verdicts"} | {c.stage: f"stage-{k}" for k, c in enumerate(_fits(campaign), 1)}),
    )


def _fits(campaign: Campaign) -> list[Calibration]:
    """Return every stage, and the joint fit at the end."""
    return [*campaign.stages.values(), *([campaign.joint] if campaign.joint is not None else [])]


def _inline(svg: str) -> str:
    """Return an SVG as it stands inside a page, where it needs no name space."""
    return svg.replace(' xmlns="http://www.w3.org/2000/svg"', "", 1)


def _stage(key: str, c: Calibration, campaign: Campaign) -> StagePart:
    samples = sum(s.samples for s in c.sensors.values())
    facts = (
        ("model", c.model.title),
        ("records", str(len(c.records))),
        ("samples", str(samples)),
        ("free parameters", str(len(c.values.parameters))),
        ("reduced χ²", number(c.reduced_chi_square, 3)),
        ("loss", c.loss),
        ("evaluations", str(c.evaluations)),
        ("converged", "yes" if c.converged else "NO"),
    )
    shown = {
        "parameters": tables.parameters(c),
        "sensors": tables.sensors(c),
        "instruments": tables.instruments(c),
        "records": tables.records(c),
        "local": tables.locals_(c),
        "moved": levels.moved(c),
        "correlations": tables.correlations(c),
        "areas": tables.areas(c.fitted_model),
        "held": origins.held(c),
        "inputs": origins.inputs(c),
    }
    logged = {load for e in c.experiments for load in (*e.scenario.loads, *e.scenario.commands)}
    picture = _inline(diagram(c.fitted_model, logged=logged, title=f"{c.stage}: the model with its fitted values"))
    return StagePart(key, c.stage, c.model, facts, c.warnings, picture, _traces(c.blocks, f"{key}-trace"), shown, trust(campaign, c))


def _traces(blocks: Sequence[SensorTrace], key: str, models: Mapping[int, str] | None = None) -> Traces:
    """Return the traces to draw; `models` names the model of each block by its identity."""
    chosen = figures.choose(blocks)
    text = f"All {len(blocks)} traces." if len(blocks) > 1 else ""
    if len(chosen) < len(blocks):
        text = (
            f"{len(chosen)} of {len(blocks)} traces are drawn: for each sensor those with the lowest, the median and the highest RMSE, "
            "and others evenly between them. All statistics count every trace."
        )
    drawn = [
        Trace(b, mark, (models or {}).get(id(b), ""), figures.trace(b, f"{key}-{k}", f"{b.sensor} in {b.record}: measured and simulated"))
        for k, (b, mark) in enumerate(chosen)
    ]
    return Traces(drawn, text, len(chosen) <= FEW)


def _held_out(campaign: Campaign) -> Traces | None:
    """Return the traces of all verdicts; a record that several of them judge is drawn once a model."""
    blocks = {(v.model, b.record, b.sensor): b for v in campaign.verdicts for b in v.blocks}
    models = {id(b): model for (model, _, _), b in blocks.items()}
    return _traces(list(blocks.values()), "held-out", models if len(set(models.values())) > 1 else None) if blocks else None


def _dots(campaign: Campaign) -> list[Dots]:
    """Return the RMSE of every record by stage, and of the held-out records by model."""
    lines = [Dots(stage, _rmse([c]), doubt="" if c.standing.fair else c.standing.state) for stage, c in campaign.stages.items()]
    judged: dict[str, list[Calibration]] = {}
    for v in campaign.verdicts:
        known = judged.setdefault(v.model, [])
        if v.prediction is not None and all(v.record not in k.records for k in known):
            known.append(v.prediction)
    return lines + [Dots(model, _rmse(found), True) for model, found in judged.items()]


def _rmse(calibrations: Sequence[Calibration]) -> dict[str, list[float]]:
    out: dict[str, list[float]] = {}
    for c in calibrations:
        for b in c.blocks:
            out.setdefault(b.sensor, []).append(float(np.sqrt(np.mean(b.residuals**2))))
    return out


def _prediction(key: str, title: str, solution: Solution, campaign: Campaign) -> Prediction:
    columns = [Column("node"), *(Column(f"{c}, °C", True) for c in ("start", "end", "highest", "lowest"))]
    rows: list[Line] = []
    for node in solution.nodes:
        trace = solution[node]
        rows.append([Cell(node, "", "main"), *(f"{t:.2f}" for t in (trace.celsius[0], trace.final, trace.highest, trace.lowest))])
    drawn = figures.prediction(solution, key, f"{title}: predicted temperatures")
    final = dict(zip(solution.nodes, solution.temperatures[-1].tolist(), strict=True))
    powers = {load: float(np.broadcast_to(w, solution.times.shape)[-1]) for load, w in solution.load_powers.items()}
    pictures = [
        _inline(diagram(m, temperatures=final, powers=powers, title=f"{title}: temperatures at the end"))
        for m in _models_of(solution, campaign)
    ]
    length = duration(float(solution.times[-1] - solution.times[0]))
    return Prediction(key, title, solution, drawn, Table.of(columns, rows), next(iter(pictures), ""), length)


def _models_of(solution: Solution, campaign: Campaign) -> Iterator[Model]:
    """Yield the campaign's model that a solution is of, if it is one of them."""
    from thermid.model.tree.tree import Names

    for c in reversed(list(campaign.stages.values())):
        if c.model.title == solution.title:
            names = Names(c.model)
            if {*names.nodes, *names.boundaries} == set(solution.nodes):
                yield c.fitted_model
                return
