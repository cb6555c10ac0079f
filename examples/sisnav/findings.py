"""The study's results as tables, for the page and for the written study."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterable

from work import BENCH, HERE, HOUR, LEVEL, LEVEL_OF, LEVELS, PLACES, Vacuum, Work

import thermid as td
from thermid.physics.htc import BIOT_LIMIT
from thermid.reporting._blocks.content import DASH, Cell, Head, Line, number
from thermid.reporting.pages import Table

PRINTED_SETTLING = {"Acc": 4.0, "FOG_l": 5.0, "EleGFO": 5.0, "ProcSISNAV": 5.0}
"""After how long the document says that a component is steady; FOG_h 'slower than FOG_l'. [h]"""
AIR = (0.026, 1.6e-5, 0.71)


def table_2(work: Work) -> Table:
    """Return Table 2 three times: as printed, as the constant structure finds it, and as effective coefficients of the other."""
    rows: list[Line] = []
    for part, places in PLACES.items():
        printed = work.document["table_2"].get(part, {})
        lines: list[Line] = [[Cell(part, "", "main"), "printed"], [Cell("", "", "same"), "constant"], [Cell("", "", "same"), "natural"]]
        at = {LEVEL_OF.get(stage, "Component"): (stage, surface) for stage, surface in places.items()}
        for level in LEVELS:
            lines[0].append(f"{printed[level]:.1f}" if level in printed else DASH)
            if level not in at:
                lines[1].append("")
                lines[2].append("")
                continue
            stage, surface = at[level]
            lines[1].append(_constant(work, stage, surface))
            found = work.effective(stage, surface)
            lines[2].append(Cell(f"{found.value:.2f} ± {found.error:.2f}", "effective, where the part settles on the bench", "main"))
        rows += lines
    columns = [
        Head("part"),
        Head("W/(m² K)"),
        *(Head("full model (Sd)" if level == "Sd" else level, True) for level in LEVELS),
    ]
    caption = "A dash: not given. Natural: convection and radiation together, where the part settles, ± one standard error."
    return Table.of_rows(columns, rows, caption)


def _constant(work: Work, stage: str, surface: str) -> Cell:
    path = f"{surface}.effective_htc"
    fitted = work.constant[stage].values.assignments.get(path)
    if fitted:
        return Cell(f"{fitted.value:.2f} ± {fitted.error:.2f}", "fitted")
    held = float(td.simulation.compile_network(work.constant[stage].model).numbers().values[path])
    return Cell(f"{held:.2f}", "held", "soft")


def verdicts(work: Work) -> Table:
    """Return the largest error of both structures at every sensor of the held-out logs."""
    rows: list[Line] = []
    for one, other in zip(work.constant.verdicts, work.natural.verdicts, strict=True):
        for k, check in enumerate(other.checks):
            noisy = check.criterion == "rmse"
            found = [next(c for c in v.checks if c.sensor == check.sensor) for v in (one, other)]
            looks = ["good" if c.passed else "bad" for c in found]
            first = Cell(other.model, "", "main") if k == 0 else Cell("", "", "same")
            cells = [Cell(f"{c.found:.2f}", "", look) for c, look in zip(found, looks, strict=True)]
            rows.append(
                [first, other.record if k == 0 else "", check.sensor, "RMSE" if noisy else "largest error", *cells, f"{check.limit:g}"]
            )
    columns = [Head("model"), Head("held-out log"), Head("sensor"), Head("criterion")]
    columns += [Head("constant, K", True), Head("natural, K", True), Head("limit, K", True)]
    return Table.of_rows(
        columns, rows, "Errors of readings. The accelerometer channel has 0.35 K of noise; its limit is on the root mean square."
    )


def recovered(work: Work) -> Table:
    """Return what the campaign found beside what is hidden."""
    rows: list[Line] = []
    for r in work.recovered:
        share = 100 * r.found.error / abs(r.found.value)
        look = Cell("✓ inside", "", "good") if r.inside else Cell("outside", "", "bad")
        told = "not told by the data: its prior" if share > 30 else "weakly" if share > 10 else "yes"
        numbers = [number(r.found.value, 4), f"± {number(2 * r.found.error, 2)}", number(r.truth, 4)]
        rows.append([Cell(r.stage, "", "main"), r.name, *numbers, r.unit, look, told])
    columns = [
        Head("stage"),
        Head("value"),
        Head("found", True),
        Head("two standard errors", True),
        Head("hidden truth", True),
    ]
    return Table.of_rows([*columns, Head("unit"), Head("truth"), Head("identifiable")], rows)


def vacuums(runs: Iterable[Vacuum]) -> Table:
    """Return the ends of runs without gas."""
    rows: list[Line] = []
    for run in runs:
        numbers = [f"{x[-1]:.1f}" for x in (run.middle, run.low, run.high, run.truth)]
        inside = Cell("✓ inside", "", "good") if run.inside else Cell("outside", "", "bad")
        rows.append(
            [
                *(Cell(run.node, "", "main"), *numbers, inside, f"{run.beyond:.2f}"),
                *(f"{100 * run.half_width:.0f}", f"{run.printed[-1]:.1f}", f"{run.settles:.1f}"),
            ]
        )
    columns = [
        Head("node"),
        Head("after 5 h, °C", True),
        Head("low, °C", True),
        Head("high, °C", True),
        Head("hidden truth, °C", True),
        Head("truth"),
    ]
    columns += [
        Head("beyond on the way, K", True),
        Head("half-width, % of rise", True),
        Head("as printed, °C", True),
        Head("settles at, °C", True),
    ]
    return Table.of_rows(
        columns, rows, "95 % interval from the covariance of all fitted values, emissivities among them, and from the power meters."
    )


def settling(work: Work) -> Table:
    """Return time constants of the components: from mass and coefficient, from the synthetic test, and from the document's words."""
    rows: list[Line] = []
    for part in ("Acc", "FOG_h", "FOG_l", "EleGFO", "ProcSISNAV"):
        deck = td.load_model(HERE / f"{part}.toml")
        tau = float(td.simulate(deck, BENCH).time_constants[0])
        hours = PRINTED_SETTLING.get(part)
        fitted = float(td.simulate(work.constant[part].model, BENCH).time_constants[0])
        needed = hours * HOUR / math.log(100) if hours else math.nan
        differs = bool(hours) and not 0.67 < needed / tau < 1.5
        flag = (
            Cell(f"✗ {needed / tau:.1f} times as slow", "", "bad")
            if differs
            else Cell("agrees by the choice of mass" if hours else DASH, "", "soft")
        )
        times = [
            f"{tau / 60:.1f}",
            f"{tau * math.log(100) / HOUR:.2f}",
            f"{hours:g}" if hours else DASH,
            f"{needed / 60:.1f}" if hours else DASH,
        ]
        rows.append([Cell(part, "", "main"), *times, f"{fitted / 60:.1f}", flag])
    columns = [
        Head("component"),
        Head("m c/(h A), min", True),
        Head("99 % after, h", True),
        Head("document says, h", True),
    ]
    columns += [Head("implied, min", True), Head("found on the synthetic log, min", True), Head("")]
    return Table.of_rows(columns, rows, "Implied: the time constant whose 99 % is the time that the document prints.")


def htc() -> td.inference.HtcComparison:
    """Return the document's EleGFO example: theoretical and effective coefficient side by side."""
    return td.inference.compare_htc(
        "2.168 [W]",
        "0.082241 [m^2]",
        "35.938 [degC]",
        "24 [degC]",
        "0.02492 [m]",
        air=AIR,
        errors={"drift": "0.7 [K]"},
        emissivity=0.09,
        parts={"case, aluminium": ("0.02492 [m]", "130 [W/(m K)]"), "board, through": ("1.6 [mm]", "0.3 [W/(m K)]")},
        capacitance="0.737*960 [J/K]",
        settled_after="5 [h]",
    )


def no_room_for_paint() -> str:
    """Return why the document's EleGFO cannot be a painted box: its effective coefficient leaves no room for that radiation."""
    deck = tomllib.loads((HERE / "EleGFO.toml").read_text(encoding="utf-8"))
    deck["surfaces"]["skin"]["finish"] = "paint, black"
    try:
        td.inference.split(td.model_from_dict(deck), conditions=BENCH)
    except td.ThermidError as refused:
        return refused.message
    raise ValueError("a painted EleGFO was split")


def hidden(work: Work) -> Table:
    """Return the predictions of the held-out logs against the hidden temperatures."""
    rows: list[Line] = []
    for h in work.hidden_errors():
        look = "good" if h.inside >= LEVEL else "warn"
        rows.append(
            [Cell(h.record, "", "main"), h.sensor, f"{h.error:.2f}", f"{h.half_width:.2f}", Cell(f"{100 * h.inside:.0f} %", "", look)]
        )
    columns = [
        Head("held-out log"),
        Head("sensor"),
        Head("largest error, K", True),
        Head("half-width, K", True),
        Head("of the time inside", True),
    ]
    return Table.of_rows(columns, rows, "Against the hidden temperature, not the reading. At the start the band has no width yet.")


BIOT = {
    "FOG case, 50 mm aluminium": (0.05, 130.0, 5.0),
    "ProcSISNAV case, 50 mm aluminium": (0.05, 130.0, 6.0),
    "EleGFO case, 25 mm aluminium": (0.02492, 130.0, 2.2),
    "Acc case, 25 mm steel": (0.025, 15.0, 6.0),
    "fibre coil, 20 mm": (0.020, 0.25, 5.0),
    "gap of air, 10 mm": (0.010, 0.026, 6.0),
}
"""Path of the heat [m], conductivity [W/(m K)], coefficient [W/(m^2 K)]."""


def biot() -> Table:
    """Return Biot numbers of parts and of what is inside them."""
    rows: list[Line] = []
    for name, (length, conductivity, coefficient) in BIOT.items():
        found = coefficient * length / conductivity
        rows.append(
            [
                Cell(name, "", "main"),
                number(found, 2),
                Cell("one node is enough", "", "good") if found < BIOT_LIMIT else Cell("✗ not one node", "", "bad"),
            ]
        )
    return Table.of_rows([Head("part"), Head("Biot number", True), Head("")], rows, "The node is the case, not the electronics in it.")


def slips(work: Work) -> Table:
    """Return the document's 25 slips with how each is handled."""
    rows: list[Line] = [
        [Cell(s["id"], "", "main"), s["where"], s["printed"], s["meant"], Cell(s["handled"], s.get("test", ""))]
        for s in work.document["slips"]
    ]
    titles = ("", "where", "printed", "what is meant, or why not", "here")
    return Table.of_rows([Head(t, wrapped=bool(t)) for t in titles], rows)
