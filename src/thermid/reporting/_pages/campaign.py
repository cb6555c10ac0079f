"""`report`: a campaign as one self-contained HTML page.

The top of a page: the answer in one sentence, the figure that decides it beside the coloured network, and all tests at one look.

With what it is drawn from: the run of a record by the whole model, temperatures, heat flows and powers over time.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import cast

import numpy as np

from thermid.base.errors import ThermidError
from thermid.base.results import VERDICTS
from thermid.base.units import ICE_POINT, Array, counted, from_si, unit
from thermid.campaign.stages import Campaign, CampaignPrediction, Check, JointFit, Verdict, campaign_predictions, metric
from thermid.fit.calibration import MOVED, NOT_REJECTED, UNDECIDED, Calibration, Move, SensorTrace
from thermid.inference.criticism import criticise, energy_balance
from thermid.inference.intervals import identifiability
from thermid.model.tree import Flat, Model, Names
from thermid.reporting._blocks.content import (
    DASH,
    SAME_AS_ABOVE,
    SHEET,
    Cell,
    Figures,
    Graphic,
    Head,
    Heading,
    Line,
    Notes,
    PageBlock,
    Picture,
    Plot,
    Sheets,
    Table,
    Words,
    capitalised,
    check_page,
    duration,
    group_cell,
    number,
    oversized,
    plain,
    pretty,
    rounded,
    significant,
    write_page,
)
from thermid.reporting._diagrams.map import fitting_map
from thermid.reporting._pages import tables
from thermid.reporting._pages.tables import glance
from thermid.reporting._pictures import figures
from thermid.reporting._pictures.figures import Dots, RecordDrive
from thermid.simulation.runs import Scenario, Solution, simulate

SHOWN_TIMES = 400
"""Times of a run."""


def run_of(c: Calibration, record: str) -> tuple[Model, Scenario] | None:
    """Return the model and the scenario of one record with the starts, boundaries and meter factors that the fit found.

    None where the fit does not keep its logs, as one that was read from a file.
    """
    place = next((k for k, e in enumerate(c.experiments) if e.record.name == record), None)
    if place is None or c.problem is None or any(u.name not in c.fitted for u in c.problem.unknowns):
        return None
    fitted = np.array([c.fitted[u.name] for u in c.problem.unknowns])
    bench = c.problem.bench(place, fitted)
    inputs = dict(zip(c.problem.benches()[place].free, c.problem.inputs(place, fitted)[0].tolist(), strict=True))
    return bench.experiment.as_fitted(c.model, inputs)


def course_of(c: Calibration, record: str, times: Array | None = None) -> Solution | None:
    """Return the run of the whole model under the inputs of a record; None where it cannot be made again.

    Parameters
    ----------
    times : array (times,)      Where it is wanted; `SHOWN_TIMES` times over the record by default. [s]
    """
    try:
        inputs = run_of(c, record)
        if inputs is None:
            return None
        model, scenario = inputs
        return simulate(model, scenario, times=np.linspace(0.0, scenario.seconds, SHOWN_TIMES) if times is None else times)
    except ThermidError:
        return None


def without_error(c: Calibration, block: SensorTrace) -> SensorTrace:
    """Return a trace without its sensor's constant error: temperatures of the node, as those of corrected boundaries beside it are."""
    error = c.bias.get(block.sensor, 0.0)
    return replace(block, measured=block.measured - error, predicted=block.predicted - error)


def hottest_moment(run: Solution, nodes: Collection[str]) -> int:
    """Return the sample at which the hottest of some nodes is near its peak (2 % of its rise), and powers are on where they ever are."""
    peak = run.temperatures[:, [k for k, n in enumerate(run.nodes) if n in nodes]].max(axis=1)
    at_peak = peak >= peak.max() - 0.02 * np.ptp(peak)
    heat = total_power(run)
    if heat is not None:
        at_peak &= heat >= 0.9 * heat[at_peak].max()
    return int(np.where(at_peak, peak, -np.inf).argmax())


def total_power(run: Solution) -> Array | None:
    """Return the sum of all powers (times,); None where the model has no load. [W]"""
    powers = [np.broadcast_to(p, run.times.shape) for p in run.load_powers.values()]
    return np.sum(powers, axis=0) if powers else None


def drive_of(c: Calibration, run: Solution | None) -> RecordDrive | None:
    """Return ambient temperatures and the sum of all powers over the run of a record."""
    if run is None:
        return None
    ambient = {b: run[b].kelvin for b in Flat.of_model(c.given_model).names.boundaries if b in run.nodes}
    return RecordDrive(run.times, ambient, total_power(run))


SYNTHETIC = "synthetic"
LEAD = (620.0, 284.0)
"""Size of the figure that decides. [px]"""
NETWORK_SIZE = (648.0, 400.0)
"""Size of the network beside it, at most, so that its letters have 6.5 pt on paper. [px]"""
DECIDES, NETWORK, MATRIX, VERDICTS_TABLE = "fig-decides", "fig-network", "fig-matrix", "table-verdicts"


@dataclass(frozen=True, eq=False)
class Decisive:
    """The trace that decides: the one that takes most of its limit, or without a verdict the worst that was fitted.

    Parameters
    ----------
    fit : Calibration       The fit, or the prediction that was judged.
    block : SensorTrace     Its readings, without its constant error.
    error : float           That error. [K]
    verdict, check          What was judged, and by which limit; None without a verdict.
    """

    fit: Calibration
    block: SensorTrace
    error: float
    verdict: Verdict | None = None
    check: Check | None = None

    @property
    def moment(self) -> int:
        """Sample with the largest residual."""
        return int(np.abs(self.block.residuals).argmax())

    @property
    def limit(self) -> float | None:
        """Limit of every single residual, where that is what was judged. [K]"""
        return self.check.limit if self.check is not None and metric(self.check.criterion).of_single_readings else None

    def sentence(self) -> str:
        """Return a sentence on the sensor at its largest residual: both temperatures, and the checked figure over its limit.

        Without a hold-out record no limit applies: it gives the RMSE.
        """
        b, k = self.block, self.moment
        at = duration(float(b.times[k] - b.times[0]))
        read = f"measured {b.measured[k] - ICE_POINT:.2f} °C, simulated {b.predicted[k] - ICE_POINT:.2f} °C"
        trace = f"{b.sensor} in {b.record}. After {at}: {read}, residual {b.residuals[k]:+.2f} K"
        if self.check is None:
            rmse = float(np.sqrt(np.mean(b.residuals**2)))
            return f"Worst fitted sensor: {trace}. RMSE {rounded(rmse)} K. No limit applies: there is no hold-out record."
        c = self.check
        word = VERDICTS[c.passed]
        return (
            f"Worst held-out sensor: {trace}. {capitalised(c.title)} {number(c.found)} K, "
            f"limit {plain(c.limit)} K ({100 * c.used:.0f} %): {word}."
        )


def decisive(campaign: Campaign) -> Decisive | None:
    """Return the trace that decides; None where nothing was fitted or judged."""
    judged = [(v, c) for v in campaign.verdicts for c in v.checks if v.blocks]
    if judged:
        verdict, check = max(judged, key=lambda pair: pair[1].used)
        traces = [b for b in verdict.blocks if b.sensor == check.sensor] or list(verdict.blocks)
        assert verdict.prediction is not None
        return _decisive(verdict.prediction, max(traces, key=lambda b: float(np.abs(b.residuals).max())), verdict, check)
    for c in reversed(campaign.fits):
        if len(c.blocks):
            return _decisive(c, max(c.blocks, key=lambda b: float(np.mean(b.weighted**2))))
    return None


def _decisive(fit: Calibration, block: SensorTrace, verdict: Verdict | None = None, check: Check | None = None) -> Decisive:
    """Return what decides of a trace: without its sensor's constant error, with its verdict and check."""
    return Decisive(fit, without_error(fit, block), fit.bias.get(block.sensor, 0.0), verdict, check)


def front(campaign: Campaign) -> list[PageBlock]:
    """Return the top of a page, below its answer; nothing where nothing was fitted or judged."""
    trace = decisive(campaign)
    if trace is None:
        return []
    run = course_of(trace.fit, trace.block.record)
    network = _network(trace, run)
    beside = [network] if network is not None and not oversized(network.drawn.markup, NETWORK_SIZE) else []
    charts = list(_charts(campaign))
    blocks: list[PageBlock] = [
        Words(trace.sentence(), (DECIDES, NETWORK, MATRIX, VERDICTS_TABLE)),
        Figures((_decides(trace, run), *beside), lead=True),
    ]
    wide = [p for p in charts if p.key == MATRIX and not p.drawn.narrow]
    blocks += [Figures(tuple(wide), wide=True)] if wide else []
    rest = tuple(p for p in charts if p not in wide)
    blocks += [Figures(rest)] if rest else []
    return [*blocks, Picture(network.drawn.markup, network.caption)] if network is not None and not beside else blocks


def _tag(c: Calibration) -> str:
    """Return the mark of a fit with records that were made and not measured; empty otherwise."""
    return SYNTHETIC if c.synthetic or any(e.record.origin.synthetic for e in c.experiments) else ""


def _decides(decisive: Decisive, run: Solution | None) -> Plot:
    """Return the figure of the sensor that decides: measured, simulated and residual."""
    b = decisive.block
    drive = drive_of(decisive.fit, run)
    label = f"{b.sensor} in {b.record}: measured and simulated"
    drawn = figures.compared(b.times, b.measured, b.predicted, "decides", label, drive=drive, limit=decisive.limit, size=LEAD)
    met = f": {VERDICTS[decisive.check.passed]}" if decisive.check is not None else ""
    kind = "held out" if decisive.verdict is not None else "fitted"
    less = figures.correction(decisive.error)
    words = f"{b.sensor} in {b.record}, {kind}{met}. Above measured and simulated{f' ({less})' if less else ''}, below the residual."
    return Plot(drawn, words, _tag(decisive.fit), DECIDES)


def _network(decisive: Decisive, run: Solution | None) -> Plot | None:
    """Return the coloured network at the hottest moment of the record; None for one node, or where the run cannot be made again."""
    model = decisive.fit.model
    flat = Flat.of_model(model)
    nodes = [n.path for n in flat.nodes]
    if run is None or len(nodes) == 1:
        return None
    inside = {*nodes, *flat.names.boundaries}  # a sensor that lags has a node in the run, and none in the model
    k = hottest_moment(run, nodes)
    temperatures = {n: t for n, t in zip(run.nodes, run.temperatures[k].tolist(), strict=True) if n in inside}
    flows = {name: float(v[k]) for name, v in run.heat_flows.items()}
    powers = {name: float(np.broadcast_to(v, run.times.shape)[k]) for name, v in run.load_powers.items()}
    markup = fitting_map(model, NETWORK_SIZE, temperatures=temperatures, flows=flows, powers=powers)
    hottest = max(nodes, key=lambda n: temperatures[n])
    when = f"after {duration(float(run.times[k] - run.times[0]))} of {decisive.block.record}, when {hottest} is hottest"
    caption = f"{model.title} {when}, as simulated: temperatures by colour, heat flows by width."
    return Plot(Graphic(markup, ()), caption, _tag(decisive.fit), NETWORK)


def _charts(campaign: Campaign) -> Iterator[Plot]:
    """Yield tests by sensors, predicted against measured, and the residuals counted; of what was held out, else of the uppermost fit."""
    judged = [v for v in campaign.verdicts if v.blocks]
    twice = len({v.record for v in judged}) < len({(v.model, v.record) for v in judged})
    cells: dict[tuple[str, str], tuple[float, bool | None]] = {}
    for v in judged:
        test = f"{v.record} ({v.model})" if twice else v.record
        for c in v.checks:
            if c.sensor:
                ratio, met = cells.get((test, c.sensor), (0.0, True))
                cells[test, c.sensor] = (max(ratio, c.used), c.passed if c.used >= ratio else met)
    most = (figures.MAX_ROWS_OF_PICTURE, figures.MOST_COLUMNS)
    counts = sorted((len({k[i] for k in cells}) for i in (0, 1)), reverse=True)
    more = f" The worst of {counts[0]} and {counts[1]}." if counts[0] > most[0] or counts[1] > most[1] else ""
    if cells:
        yield Plot(figures.matrix(cells), f"Error over limit, test by sensor. Blue below 1, orange beyond, ✗ not met.{more}", "", MATRIX)
    blocks: Sequence[SensorTrace] = [b for v in judged for b in v.blocks]
    words = "held-out records"
    if not blocks:
        last = next((c for c in reversed(campaign.fits) if len(c.blocks)), None)
        blocks, words = (list(last.blocks), f"fitted records of {last.stage}") if last is not None else ([], "")
    if blocks:
        yield from figures.against_measured(
            [b.measured for b in blocks], [b.measured - b.residuals for b in blocks], "predicted", f", {words}"
        )


MAX_OPEN_TRACES = 4
"""Up to so many traces stand open on the page; more are folded away."""


Part = dict[str, object]
"""What the template says of one stage, trace or scenario, by name."""


def report(
    campaign: Campaign,
    *,
    to: str | os.PathLike[str],
    scenarios: Sequence[tuple[str, Solution]] = (),
    notes: str | Sequence[str] = (),
    audience: str = "all",
    tables_to: str | os.PathLike[str] | None = None,
) -> Path:
    """Write a campaign as one HTML page, or as a PDF where its name ends in .pdf, and return its path.

    Verdicts and margins come first, then coefficients by level, each stage and provenance. Long tables are CSV files beside it too.

    Parameters
    ----------
    campaign : Campaign     The result of `run_stages`, or one made in Python.
    to : path               The file to write; its folder is made where it is missing.
    scenarios : sequence    Pairs (title, Solution): what the model predicts.
    notes : str(s)          What the author says, a paragraph each.
    audience : str          ``summary``: at most two sheets; ``agency``: what a reviewer reads; ``all``: everything.
    tables_to : path        Folder of the long tables; that of the page's name with ``.tables`` by default.

    Raises
    ------
    MissingExtraError   When jinja2 is not installed.
    NoBrowserError      When a PDF is asked for and no browser is installed that prints it.
    OutputError         When the file may not be written, or its name promises another format.
    ScenarioError       When there is no such audience.
    """
    check_page(to)
    sheets = Sheets.beside(to, tables_to, audience)
    stages = [_stage(f"stage-{k}", c, campaign, sheets) for k, c in enumerate(campaign.fits, 1)] if audience != "summary" else []
    places = {k: k for k in ("verdicts", "predictions")} | {str(s["name"]): str(s["key"]) for s in stages}
    paragraphs = [p for text in ([notes] if isinstance(notes, str) else notes) for p in text.split("\n\n") if p.strip()]
    named, failed = campaign_predictions(campaign)
    return write_page(
        "page.html.jinja",
        to,
        title=campaign.title,
        campaign=campaign,
        **_doubts(campaign),
        notes=[p for p in (campaign.note, *paragraphs, *map("NOT PREDICTED: '{0[0]}': {0[1]}".format, failed.items())) if p],
        verdicts=replace(tables.verdicts(campaign, audience == "summary"), key=VERDICTS_TABLE) if campaign.verdicts else None,
        held_out=_held_out(campaign, audience) if audience != "summary" else None,
        coverage=_coverage(campaign) if audience != "summary" else None,
        bands=_bands(campaign) if audience != "summary" else (None, []),
        front=front(campaign),
        levels=tables.levels(campaign),
        overview=figures.overview(_dots(campaign)) if campaign.stages else None,
        stages=stages,
        values=_joined(stages) if audience == "agency" else [],
        predictions=[_prediction(f"prediction-{k}", title, s, campaign) for k, (title, s) in enumerate(scenarios, 1)],
        named=named,
        named_blocks=list(_named(named, audience == "summary")),
        data=tables.data(campaign),
        models=tables.models(campaign),
        versions=tables.versions(),
        sheets=sheets,
        seen=glance(campaign, places, named),
    )


def _doubts(campaign: Campaign) -> Part:
    """Return which verdicts failed, in which stages inherited values moved, and how many records were made and not measured."""
    return {
        "missed": [f"{v.model} on {v.record}" for v in campaign.verdicts if v.passed is False],
        "moved": [c.stage for c in campaign.fits if c.moved.moved],
        "made": tables.made_records(campaign),
    }


JOINED = (
    ("parameters", "Parameters before and after"),
    ("moved", "Values against the levels below"),
    ("sensors", "Sensors"),
)
"""Tables of every stage that an agency has as one, since most stages have few lines."""


def _joined(stages: Sequence[Part]) -> list[Table]:
    """Return tables of all stages, each with the stage's name in front of its lines."""
    out = []
    for name, title in JOINED:
        mine = [(str(s["name"]), t) for s in stages if (t := cast("Mapping[str, Table]", s["tables"])[name]).rows]
        rows = [[group_cell(stage, k), *row] for stage, t in mine for k, row in enumerate(t.rows)]
        if rows:
            captions = [t.caption.split(". ") for _, t in mine]
            shared = [
                words.rstrip(".")
                for words in captions[0]
                if words and all(words.rstrip(".") in [w.rstrip(".") for w in c] for c in captions)
            ]
            out.append(Table.of_rows([Head("stage"), *mine[0][1].columns], rows, "".join(f"{words}. " for words in shared).strip(), title))
    return out


INSTRUMENTS = ("instruments", "Instruments")
ANNEX = (
    ("inputs", "Inputs, with their sources"),
    ("records", "Every record and sensor"),
    ("local", "Values of single records"),
    ("correlations", "Correlations"),
    ("areas", "Area ledger"),
    ("held", "All values, with what they hide"),
)
"""Tables of a stage that open on demand, and stand in files alone on a page that is not for all."""


BULK = "; ".join(title[0].lower() + title[1:] for _, title in (INSTRUMENTS, *ANNEX))
"""What files alone have of a stage on a page that is not for all."""


def _stage(key: str, c: Calibration, campaign: Campaign, sheets: Sheets) -> Part:
    """Return what the page says of one stage."""
    samples = sum(s.samples for s in c.sensors.values())
    facts = (
        ("model", c.given_model.title),
        ("records", str(len(c.records))),
        ("samples", str(samples)),
        ("free parameters", str(len(c.values.parameters))),
        ("reduced χ²", number(c.reduced_chi_square)),
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
        "moved": moved(c),
        "correlations": tables.correlations(c),
        "areas": tables.areas(c.model),
        "held": tables.held(c),
        "inputs": tables.inputs(c),
    }
    logged = {load for e in c.experiments for load in (*e.scenario.loads, *e.scenario.commands)}
    whole = sheets.audience == "all"
    title = f"{c.stage}: the model with its fitted values"
    picture = fitting_map(c.model, SHEET if whole else BRIEF_MAP, logged=logged, title=title)
    annex = [(title, shown[name]) for name, title in ANNEX if shown[name].rows]
    for name, title in (INSTRUMENTS, *ANNEX):
        if not whole and shown[name].rows:
            sheets.keep(shown[name], f"{c.stage} {title}")
    return {
        "key": key,
        "name": c.stage,
        "model": c.given_model,
        "facts": facts,
        "warnings": c.warnings,
        "diagram": picture if whole or len(Flat.of_model(c.model).nodes) > 1 else "",
        "oversized": "sheet" if oversized(picture) else "column" if not whole and oversized(picture, BRIEF_MAP) else "",
        "traces": _traces(c.blocks, f"{key}-trace", sheets.audience, fits={id(b): c for b in c.blocks}, most=BRIEF),
        "tables": shown,
        "bulk": BULK,
        "annex": annex if whole else [],
        "trust": trust(campaign, c) if whole else (),
    }


BRIEF = 3
"""Traces of a stage on a page that is not for all, beside its map."""
BRIEF_MAP = (550.0, 440.0)
"""Size of its map there, at most: two thirds of a sheet, with letters of 6.5 pt. [px]"""


def _traces(
    blocks: Sequence[SensorTrace],
    key: str,
    audience: str,
    models: Mapping[int, str] | None = None,
    *,
    fits: Mapping[int, Calibration],
    judged: Mapping[int, Verdict] | None = None,
    most: int = figures.MOST_TRACES,
) -> Part:
    """Return the traces to draw with what marks each, the text that says which, and whether they stand open.

    `models` names the model of each block by its identity, where several stand together; `fits` says of which fit each is, and `judged`
    by which verdict.
    """
    text = f"All {len(blocks)} traces." if len(blocks) > 1 else ""
    if audience == "all":
        chosen, which = figures.choose(blocks), "for each sensor those with the lowest, the median and the highest RMSE, and others between"
    else:
        chosen, which = (
            [(b, "") for b in sorted(blocks, key=lambda b: -float(np.mean(b.weighted**2)))[:most]],
            "those furthest off, in deviations of their noise",
        )
    if len(chosen) < len(blocks):
        text = f"{len(chosen)} of {len(blocks)} traces are drawn: {which}. All statistics count every trace."
    runs = {(id(fits[id(b)]), b.record): fits[id(b)] for b, _ in chosen}
    drives = {key: drive_of(c, course_of(c, key[1])) for key, c in runs.items()}
    drawn: list[Part] = []
    for k, (b, mark) in enumerate(chosen):
        c, (limit, met) = fits[id(b)], _limit(b, (judged or {}).get(id(b)))
        title = f"{b.sensor} in {b.record}: measured and simulated"
        graphic = figures.trace(without_error(c, b), f"{key}-{k}", title, drives[id(c), b.record], limit, narrow=audience == "agency")
        less = figures.correction(c.bias.get(b.sensor, 0.0))
        drawn.append({"block": b, "mark": mark, "model": (models or {}).get(id(b), ""), "met": met, "less": less, "drawn": graphic})
    return {"drawn": drawn, "of": len(blocks), "text": text, "opened": len(chosen) <= MAX_OPEN_TRACES}


def _limit(block: SensorTrace, verdict: Verdict | None) -> tuple[float | None, str]:
    """Return the limit of every single residual of a trace, and whether it is met; None and nothing where no such limit was judged."""
    for c in verdict.checks if verdict is not None else ():
        if c.sensor == block.sensor and metric(c.criterion).of_single_readings:
            return c.limit, f"{VERDICTS[c.passed]}, limit ± {plain(c.limit)} K"
    return None, ""


def _held_out(campaign: Campaign, audience: str) -> Part | None:
    """Return the traces of all verdicts; a record that several of them judge is drawn once a model."""
    blocks = {(v.model, b.record, b.sensor): (b, v) for v in campaign.verdicts for b in v.blocks}
    if not blocks:
        return None
    models = {id(b): model for (model, _, _), (b, _) in blocks.items()}
    fits = {id(b): v.prediction for b, v in blocks.values() if v.prediction is not None}
    judged = {id(b): v for b, v in blocks.values()}
    several = models if len(set(models.values())) > 1 else None
    return _traces([b for b, _ in blocks.values()], "held-out", audience, several, fits=fits, judged=judged)


def _coverage(campaign: Campaign) -> Graphic | None:
    """Return nominal against observed shares of readings inside the bands of the verdicts; None where no verdict has bands."""
    judged = {(v.model, v.record): v.bands.coverage for v in campaign.verdicts if v.bands is not None and v.bands.bands}
    if not judged:
        return None
    several = len({model for model, _ in judged}) > 1
    shares = {f"{record}, {model}" if several else record: shares_inside for (model, record), shares_inside in judged.items()}
    return figures.coverage(shares, "coverage", "Readings inside the band against the nominal share")


def _bands(campaign: Campaign) -> tuple[Table | None, list[str]]:
    """Return how the bands of the verdicts met the readings, sensor by sensor, and what a reader of them must know."""
    judged = {(v.model, v.record): v.bands for v in campaign.verdicts if v.bands is not None and v.bands.bands}
    if not judged:
        return None, []
    rows: list[Line] = []
    for (model, record), run in judged.items():
        for k, (sensor, b) in enumerate(run.bands.items()):
            first = [group_cell(model, k), Cell(record) if k == 0 else SAME_AS_ABOVE]
            w = b.worst
            worst = f"{w.begin / 60:.3g} to {w.end / 60:.3g} min: {100 * w.inside:.0f} % inside, centre off by {w.rmse:.2g} K"
            rows.append([*first, sensor, f"{100 * b.inside():.0f}", rounded(float(b.half_width().mean())), worst])
    remarks = list(dict.fromkeys(f"{model}: {words}" for (model, _), run in judged.items() for words in run.warnings))
    return Table.of_rows(
        [
            Head("model"),
            Head("hold-out record"),
            Head("sensor"),
            Head("inside, %", True, "readings inside the 95 % band"),
            Head("95 % band, ± K", True, "mean half-width"),
            Head("worst stretch", wrapped=True),
        ],
        rows,
    ), remarks


def _dots(campaign: Campaign) -> list[Dots]:
    """Return the RMSE of every record by stage, and of the held-out records by model."""
    lines = [Dots(stage, _rmse([c]), doubt="" if c.standing.fair else c.standing.state) for stage, c in campaign.stages.items()]
    judged: dict[str, list[Calibration]] = {}
    for v in campaign.verdicts:
        predictions_of_model = judged.setdefault(v.model, [])
        if v.prediction is not None and all(v.record not in k.records for k in predictions_of_model):
            predictions_of_model.append(v.prediction)
    return lines + [Dots(model, _rmse(predictions), True) for model, predictions in judged.items()]


def _rmse(calibrations: Sequence[Calibration]) -> dict[str, list[float]]:
    """Return sensor -> root mean square residual of every record of the fits. [K]"""
    out: dict[str, list[float]] = {}
    for c in calibrations:
        for b in c.blocks:
            out.setdefault(b.sensor, []).append(float(np.sqrt(np.mean(b.residuals**2))))
    return out


def _prediction(key: str, title: str, solution: Solution, campaign: Campaign) -> Part:
    """Return what the page says of one simulated scenario."""
    columns = [Head("node"), *(Head(f"{c}, °C", True) for c in ("start", "end", "highest", "lowest"))]
    rows: list[Line] = []
    for node in solution.nodes:
        trace = solution[node]
        rows.append([Cell(node, "", "main"), *(f"{t:.2f}" for t in (trace.celsius[0], trace.final, trace.highest, trace.lowest))])
    drawn = figures.prediction(solution, key, f"{title}: predicted temperatures")
    final = dict(zip(solution.nodes, solution.temperatures[-1].tolist(), strict=True))
    powers = {load: float(np.broadcast_to(w, solution.times.shape)[-1]) for load, w in solution.load_powers.items()}
    end = f"{title}: temperatures at the end"
    flows = {name: float(w[-1]) for name, w in solution.heat_flows.items()}
    end_state = {"temperatures": final, "flows": flows, "powers": powers, "title": end}
    pictures = [fitting_map(m, SHEET, **end_state) for m in _models_of(solution, campaign)]
    length = duration(float(solution.times[-1] - solution.times[0]))
    return {
        "key": key,
        "title": title,
        "solution": solution,
        "drawn": drawn,
        "ends": Table.of_rows(columns, rows),
        "diagram": next(iter(pictures), ""),
        "length": length,
    }


def _named(predictions: Sequence[CampaignPrediction], brief: bool) -> Iterator[PageBlock]:
    """Yield what the campaign's own predictions say: all bands and margins as a table, then each with what it does not count.

    In brief these are the nodes with limits, the smallest margin of all first, and the figure of that prediction.
    """
    columns = [
        Head("prediction"),
        Head("node"),
        Head("lowest of the band, °C", True),
        Head("highest of the band, °C", True),
        Head("limits, °C"),
        Head("margin, K", True, "from the band to the nearer limit, over the whole run"),
    ]
    rows: list[Line] = []
    if brief:
        predictions = sorted(predictions, key=lambda p: p.margins[0].margin)
    for p in predictions:
        for k, m in enumerate(m for m in p.margins if m.words[1] or not brief):
            low, high = (f"{end - ICE_POINT:.2f}" for end in m.band)
            margin = Cell(f"{m.margin:.2f}", "", "good" if m.margin >= 0.0 else "bad") if m.words[1] else Cell(DASH)
            rows.append([group_cell(p.name, k), Cell(m.node, "", "main"), low, high, m.words[1].removesuffix(" degC") or DASH, margin])
    if rows:
        yield Table.of_rows(columns, rows, "95 % bands over the whole run, smallest margin first.", "Predictions and margins to limits")
    for k, p in enumerate(predictions[:1] if brief else predictions, 1):
        ends = np.array([m.band for m in p.margins])
        near = [(node, end) for node, pair in p.limits.items() for end in pair if np.abs(ends - end).min() < NEAR_LIMIT]
        drawn = figures.predicted_bands(p.prediction, f"asked-{k}", f"{p.name}: predicted temperatures with bands", [t for _, t in near])
        lines = ", ".join(f"{node} {end - ICE_POINT:g} °C" for node, end in near)
        caption = f"{p.name} ({p.prediction.scenario}): temperatures with 95 % bands{lines and f', limits as thin lines ({lines})'}."
        yield from () if brief else (Heading(p.head),)  # the first lines of a brief page say it
        yield Figures((Plot(drawn, caption),), drawn.legend, wide=True)
        if p.prediction.not_counted or p.prediction.warnings:
            yield Notes(tuple(w for w in (p.prediction.not_counted, *p.prediction.warnings) if w), "Warnings")


NEAR_LIMIT = 30.0
"""A limit is drawn where a band comes as near as that. [K]"""


def _models_of(solution: Solution, campaign: Campaign) -> Iterator[Model]:
    """Yield the campaign's model that a solution is of, if it is one of them."""
    for c in reversed(list(campaign.stages.values())):
        if c.given_model.title == solution.title:
            names = Names(c.given_model)
            if {*names.nodes, *names.boundaries} == set(solution.nodes):
                yield c.model
                return


LOOKS = {MOVED: "bad", NOT_REJECTED: "good", UNDECIDED: "soft"}


def moved(calibration: Calibration) -> Table:
    """Return inherited values against what this stage's logs say of them alone: per parameter, per part, and all together."""
    rows: list[Line] = [_line(m) for m in calibration.moved.values]
    for g in calibration.moved.groups:
        square = f"χ² {number(g.chi_square)} of {g.directions}" if g.directions else DASH
        rows.append([Cell(g.name, ", ".join(g.paths), "main"), *[""] * 5, square, rounded(g.chance), "", _result(g.verdict)])
    how = (
        "A value that changed: the part behaves differently in the assembly than alone, or the stage below lacks physics. A value is "
        "called not rejected only if the logs would show a change of 10 %."
    )
    return Table.of_rows(
        [
            Head("inherited"),
            Head("from stage"),
            Head("there", True),
            Head("logs alone", True, "the value from the logs of this stage alone, without its prior; for a joint fit its value there"),
            Head("unit"),
            Head("change, %", True),
            Head("deviations", True, "the change over its standard error; for several values chi-square"),
            Head("chance", True, "probability of such a change if the value is the same, corrected for the number of values tested"),
            Head("found, %", True, "the change that would be found with 90 % power, in parts of the value"),
            Head("result"),
        ],
        rows,
        how,
    )


def _result(verdict: str) -> Cell:
    """Return the cell of a verdict in its colour."""
    return Cell(verdict, "", LOOKS[verdict])


def _line(m: Move) -> Line:
    """Return the row of a value that a stage below found: before and here, their difference in standard errors, its chance."""
    below, alone = from_si(m.below, m.unit), from_si(m.alone, m.unit)
    is_known = m.is_determined and math.isfinite(alone)
    share = rounded(100 * (alone / below - 1)) if below and is_known else DASH
    far = f"{m.deviations:+.1f}" if math.isfinite(m.deviations) else DASH
    error = m.below_error / float(unit(m.unit).factor)
    there = f"{significant(below, error)} ± {rounded(error)}" if math.isfinite(error) else plain(below)
    detectable = rounded(100 * m.detectable_share) if m.is_determined else DASH
    here = plain(alone) if is_known else DASH
    return [
        Cell(m.path, "", "main"), m.stage, there, here, pretty(m.unit), share, far, rounded(m.chance), detectable, _result(m.verdict),
    ]  # fmt: skip


MAX_RECORDS_DETAILED = 12
"""Records of a stage up to which the page says of each trace what is left in it."""


def trust(campaign: Campaign, c: Calibration) -> tuple[tuple[str, str], ...]:
    """Return titles with texts: what the logs told of the stage's values, what its residuals say, who looked, where measured heat goes."""
    parts = []
    if c.values.parameters and not isinstance(c, JointFit):
        parts.append(("Information in the logs", _finding(lambda: identifiability(c))))
    records = {e.record.name for e in c.experiments}
    if len(records) > MAX_RECORDS_DETAILED:
        parts.append(
            (
                "Analysis of its residuals",
                f"{len(records)} records: for each of them run td.inference.criticise(campaign[{c.stage!r}], elements=False).",
            )
        )
    elif c.request is not None and not isinstance(c, JointFit) and all(b.record in records for b in c.blocks):
        parts.append(("Analysis of its residuals", _finding(lambda: criticise(c, elements=False))))
    looks = _looks(campaign, c)
    if looks:
        parts.append(("Uses of its hold-out records", looks))
    balances = _balances(campaign, c)
    if balances:
        parts.append(("Heat flows of its steady points", balances))
    return tuple(parts)


def _finding(analysis: Callable[[], object]) -> str:
    """Return what an analysis finds, in words, or why it finds nothing."""
    try:
        return str(analysis())
    except ThermidError as error:
        return f"not available: {error.message}"


def _looks(campaign: Campaign, c: Calibration) -> str:
    """Return which hold-out records judged a stage, one a line, and whether they still are independent."""
    lines = []
    for v in campaign.verdicts:
        if v.model == c.stage:
            if v.passed is None:
                lines.append(f"{v.record}: not judged and not read; {v.standing.reason(v.model)}")
                continue
            word = "not passed" if v.unfounded else "passed" if v.passed else "failed"
            before = (
                f"{counted(len(v.failed_before), 'failed verdict')} before, by other values: no longer independent"
                if v.failed_before
                else "not used before"
            )
            lines.append(f"{v.record}: {word}, {before}{', decided by values fitted to it' if v.conditional else ''}")
    return "\n".join(lines)


def _balances(campaign: Campaign, c: Calibration) -> str:
    """Return the heat balance of every steady point that the stage fitted."""
    source = campaign.source
    stage = next((s for s in source.content.stages if s.name == c.stage), None) if source is not None else None
    if source is None or stage is None:
        return ""
    out = []
    for name, table in stage.steady.items():
        (one,) = source.pick([table.record], name)[:1]
        log = source.bound(one, stage)
        out.append(f"{name}: " + _finding(lambda: energy_balance(c, log, table.start, table.end, limit=table.limit)))  # noqa: B023
    return "\n\n".join(out)
