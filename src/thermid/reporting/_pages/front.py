"""The top of a page: the answer in one sentence, the figure that decides it beside the coloured network, and all tests at one look.

With what it is drawn from: the run of a record by the whole model, temperatures, heat flows and powers over time.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from thermid.base.errors import ThermidError
from thermid.base.linear_algebra import Array
from thermid.base.sourced import VERDICTS
from thermid.base.units import ICE_POINT
from thermid.campaign.stages import Campaign
from thermid.campaign.verdicts import Check, Verdict, metric
from thermid.fit.calibration import Calibration, SensorTrace
from thermid.model.tree import Model, flatten
from thermid.reporting._blocks.content import (
    Figures,
    Graphic,
    PageBlock,
    Picture,
    Plot,
    Words,
    capitalised,
    duration,
    number,
    oversized,
    plain,
    rounded,
)
from thermid.reporting._diagrams.map import fitting_map
from thermid.reporting._pictures import figures
from thermid.reporting._pictures.figures import RecordDrive
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
    columns = [k for k, n in enumerate(run.nodes) if n in nodes]
    peak = run.temperatures[:, columns].max(axis=1)
    at_peak = peak >= peak.max() - 0.02 * np.ptp(peak)
    heat = total_power(run)
    if heat is not None:
        at_peak &= heat >= 0.9 * heat[at_peak].max()
    return int(np.where(at_peak, peak, -np.inf).argmax())


def total_power(run: Solution) -> Array | None:
    """Return the sum of all powers (times,); None where the model has no load. [W]"""
    powers = [np.broadcast_to(p, run.times.shape) for p in run.load_powers.values()]
    return np.sum(powers, axis=0) if powers else None


def drives(c: Calibration, run: Solution | None) -> RecordDrive | None:
    """Return ambient temperatures and the sum of all powers over the run of a record."""
    if run is None:
        return None
    ambient = {b: run[b].kelvin for b in flatten(c.given_model).names.boundaries if b in run.nodes}
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
    drive = drives(decisive.fit, run)
    label = f"{b.sensor} in {b.record}: measured and simulated"
    drawn = figures.compared(b.times, b.measured, b.predicted, "decides", label, drive=drive, limit=decisive.limit, size=LEAD)
    met = f": {VERDICTS[decisive.check.passed]}" if decisive.check is not None else ""
    kind = "held out" if decisive.verdict is not None else "fitted"
    less = figures.correction(decisive.error)
    words = f"{b.sensor} in {b.record}, {kind}{met}. Above measured and simulated{f' ({less})' if less else ''}, below the residual."
    return Plot(drawn, words, _tag(decisive.fit), DECIDES)


def _network(decisive: Decisive, run: Solution | None) -> Plot | None:
    """Return the coloured network at the hottest moment of the record; None where the run cannot be made again."""
    if run is None:
        return None
    model = decisive.fit.model
    flat = flatten(model)
    nodes = [n.path for n in flat.nodes]
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
