"""The document's figures again: measured, simulated and without convection; the network against its equations; vacuum with its interval."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp
from work import BENCH, HERE, Vacuum, Work

import thermid as td
from thermid.reporting._blocks.content import Figures, Graphic, Plot
from thermid.reporting._pages.campaign import course_of, drive_of
from thermid.reporting._pictures.chart import Area
from thermid.reporting._pictures.figures import curve, curves

SYNTHETIC = "synthetic: virtual laboratory"
SMALL = (300, 200)
NAMES = {"stack.first": "R_cd1", "stack.second": "R_cd2", "proc.skin": "R_cn1", "ele.skin": "R_cn2", "stack.gap": "R_cn3"}
NAMES |= {"m_PrE_PrS": "T_1", "m_PrE_EleG": "T_2", "cd": "T_cd", "cv": "T_amb", "proc.electronics": "Q_k1", "ele.electronics": "Q_k2"}
"""The document's symbols of Fig. 19."""


@dataclass(frozen=True)
class Panel:
    """One panel of a figure: what the document calls it, and where it is seen."""

    label: str
    stage: str
    record: str
    sensor: str


FIG_17 = (
    Panel("Acc", "Acc", "acc", "ACC_X"),
    Panel("FOG_h", "FOG_h", "fog_h", "T_FOG1"),
    Panel("FOG_l", "FOG_l", "fog_l", "T_FOG2"),
    Panel("EleGFO", "EleGFO", "elegfo", "T_ELE"),
    Panel("ProcSISNAV", "ProcSISNAV", "procsisnav", "T_PROC"),
)
FIG_25 = (
    Panel("m_PrE_PrS", "m_PrE", "pre_both", "T_PROC"),
    Panel("m_PrE_EleG", "m_PrE", "pre_both", "T_ELE"),
    Panel("m_AccS_Acc", "m_AccS", "accs", "ACC_X"),
    Panel("m_IMU_FOG1", "m_IMU", "imu_all", "T_FOG1"),
    Panel("m_IMU_FOG2", "m_IMU", "imu_all", "T_FOG2"),
)
FIG_26 = (
    Panel("m_Sd_PrS", "m_Sd", "sd_all", "T_PROC"),
    Panel("m_Sd_EleG", "m_Sd", "sd_all", "T_ELE"),
    Panel("m_Sd_FOG1", "m_Sd", "sd_all", "T_FOG1"),
    Panel("m_Sd_FOG2", "m_Sd", "sd_all", "T_FOG2"),
    Panel("m_Sd_Acc", "m_Sd", "sd_all", "ACC_X"),
    Panel("m_Sd, disk", "m_Sd", "sd_all", "T_DISK"),
)


def panel(work: Work, p: Panel, key: str) -> Graphic:
    """Return one panel: readings, the calibrated model, and the document's own structure without convection."""
    block = next(b for b in work.natural[p.stage].blocks if b.record == p.record and b.sensor == p.sensor)
    printed = td.simulate(work.constant[p.stage].model, BENCH.vacuum(as_printed=True))[block.node]
    measured, simulated = block.measured - 273.15, block.predicted - 273.15
    lines = [
        curve("measured", "measured", block.times, measured),
        curve("simulated", "simulated", block.times, simulated),
        curve("simulated, convection zero as printed: a bound", "bound", printed.times, printed.celsius),
    ]
    high = float(np.max(simulated))
    drive = drive_of(work.natural[p.stage], course_of(work.natural[p.stage], p.record))
    return curves(lines, key, f"{p.label}: measured and simulated", top=high + 0.9 * (high - 24.0), size=SMALL, drive=drive)


def figure(work: Work, panels: tuple[Panel, ...], key: str) -> Figures:
    """Return the panels of one of the document's figures."""
    drawn = [(p, panel(work, p, f"{key}-{k}")) for k, p in enumerate(panels)]
    return Figures(tuple(Plot(d, p.label, SYNTHETIC) for p, d in drawn), drawn[0][1].legend)


def fig_21() -> tuple[Figures, float]:
    """Return the network of Fig. 19 against its own two equations, integrated independently, and their largest difference. [K]"""
    model = td.load_model(HERE / "m_PrE.toml")
    room = {"times": ["0 [s]", "5 [h]"], "values": ["24 [degC]", "24.7 [degC]"]}
    step = {"times": ["0 [s]", "3 [h]"], "values": ["2.168 [W]", "0 [W]"], "hold": True}
    scenario = BENCH.with_(boundaries={"cv": room}, loads={"ele.electronics": step})
    times = np.linspace(0.0, BENCH.seconds, 301)
    ours = td.simulate(model, scenario, times=times)
    derived = td.interop.equations(model, NAMES)
    space: dict[str, object] = {}
    exec(derived.python("derivatives"), space)  # the text that the program wrote from the network
    given = {
        **derived.values,
        "Q_k1": lambda t: 4.11,
        "Q_k2": lambda t: 2.168 * (t < 10800.0),
        "T_amb": lambda t: 297.15 + 0.7 * t / 18000.0,
    }
    states, found = [297.15, 297.15], []
    for begin, end in ((0.0, 10800.0), (10800.0, 18000.0)):
        inside = times[(times >= begin) & (times <= end)]
        run = solve_ivp(space["derivatives"], (begin, end), states, "DOP853", inside, args=(given,), rtol=1e-12, atol=1e-12)  # type: ignore[arg-type]
        states = run.y[:, -1]
        found.append(run.y if not found else run.y[:, 1:])
    other = np.concatenate(found, axis=1)
    nodes = {"T1, ProcSISNAV": "proc.case", "T2, EleGFO": "ele.case"}
    lines, below, worst = [], [], 0.0
    for k, (label, node) in enumerate(nodes.items()):
        lines.append(curve("network", "measured", times, ours[node].celsius))
        lines.append(curve("equations, integrated apart", "simulated", times, other[k] - 273.15))
        below.append(curve(f"difference, {label}", ("bound", "other")[k], times, 1e9 * (ours[node].kelvin - other[k])))
        worst = max(worst, float(np.abs(ours[node].kelvin - other[k]).max()))
    drawn = curves(lines, "fig21", "network against equations", below=below, names=("temperature, °C", "difference, nK"), size=(760, 330))
    caption = "The document's Fig. 21: room +0.7 K over 5 h, EleGFO off at 3 h. No data: two integrations of one model."
    return Figures((Plot(drawn, caption),), drawn.legend, wide=True), worst


def structures(work: Work) -> Figures:
    """Return a held-out log with both structures: where a constant coefficient misses."""
    plots = []
    for key, model, record, sensor in (("a", "m_PrE", "pre_held_out", "T_PROC"), ("b", "m_IMU", "imu_held_out", "T_FOG1")):
        blocks = {}
        for name, campaign in (("natural", work.natural), ("constant", work.constant)):
            verdict = next(v for v in campaign.verdicts if v.record == record)
            blocks[name] = next(b for b in verdict.prediction.blocks if b.sensor == sensor)
        n, c = blocks["natural"], blocks["constant"]
        lines = [
            curve("measured", "measured", n.times, n.measured - 273.15),
            curve("natural convection and radiation", "simulated", n.times, n.predicted - 273.15),
            curve("one constant coefficient", "bound", c.times, c.predicted - 273.15),
        ]
        below = [
            curve(name, look, b.times, b.residuals, less=("measured", name))
            for name, look, b in (("natural convection and radiation", "simulated", n), ("one constant coefficient", "bound", c))
        ]
        judged = next(v for v in work.natural.verdicts if v.record == record).prediction
        drive = drive_of(judged, course_of(judged, record))
        title, names = f"{sensor} in {record}", ("temperature, °C", "residual, K")
        drawn = curves(lines, f"held-{key}", title, below=below, names=names, size=(380, 280), drive=drive)
        plots.append(Plot(drawn, f"{model}: {sensor} in {record}, seen by no fit", SYNTHETIC))
    return Figures(tuple(plots), plots[0].drawn.legend)


def vacuum(runs: list[Vacuum], key: str) -> Figures:
    """Return runs without gas: interval, hidden truth and the printed bound."""
    plots = []
    for k, run in enumerate(runs):
        lines = [
            curve("calibrated, radiation kept", "simulated", run.times, run.middle),
            curve("hidden truth", "truth", run.times, run.truth),
            curve("as printed: no radiation either, a bound", "bound", run.times, run.printed),
        ]
        band = Area("95 % interval", run.times, run.low, run.high)
        drawn = curves(lines, f"{key}-{k}", f"{run.node} in vacuum", band=band, size=SMALL)
        plots.append(Plot(drawn, run.node, SYNTHETIC))
    return Figures(tuple(plots), plots[0].drawn.legend)
