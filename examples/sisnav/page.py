"""The study's page: what it found, section by section, in the order in which a reader asks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import drawings
import findings
from work import BENCH, HERE, Vacuum, Work

import thermid as td
from thermid.reporting._blocks.content import (
    Cell,
    Code,
    Facts,
    Formulas,
    Head,
    Heading,
    Line,
    Notes,
    PageBlock,
    Picture,
    Section,
    Words,
    folded,
)
from thermid.reporting._pages import tables
from thermid.reporting.diagrams import network_map
from thermid.reporting.pages import Table, study_report

WATERMARK = "Demonstration: 22 assumed parameters, synthetic data"
PICTURES = {
    "EleGFO": "The document's Figs. 3 and 5: the model of every component, here EleGFO. A heat source, a mass, one path to the room.",
    "m_PrE": "The document's Figs. 18 and 19: m_PrE. T_cd is the massless node cd; the gap's loss R_cn,3 is stack.gap.",
    "m_AccS": "The document's Fig. 22: m_AccS.",
    "m_IMU": "The document's Fig. 23: m_IMU; the support's mass is shared among the gyros, as the document says.",
    "m_Sd": "The document's Fig. 24: the whole, m_SdU, Sd or m_Sd.",
}
SEEN = {
    "m_Sd_PrS": "pre.proc.case",
    "m_Sd_EleG": "pre.ele.case",
    "m_Sd_FOG1": "imu.fog_x.case",
    "m_Sd_Acc": "imu.acc.acc_x.case",
    "disk": "disk",
}


def inline(svg: str) -> str:
    """Return an SVG as it is inside a page."""
    return svg.replace(' xmlns="http://www.w3.org/2000/svg"', "", 1)


def outcome(work: Work, runs: list[Vacuum]) -> list[PageBlock]:
    """Return the study in five facts; `runs` are the whole unit's without gas."""
    natural, constant = work.natural, work.constant
    worst = max(c.found for v in natural.verdicts for c in v.checks if c.criterion == "max_error")
    found = work.recovered
    inside, wide = sum(r.inside for r in runs), 100 * max(r.half_width for r in runs)
    failed = sum(not v.passed for v in constant.verdicts)
    return [
        Facts(
            (
                ("levels", f"{len(list(natural))}, from five components to the whole"),
                ("held-out logs, natural convection", f"largest error {worst:.2f} K of 0.5 K"),
                ("the same with constant coefficients", f"{failed} of {len(constant.verdicts)} fail"),
                ("hidden values inside two standard errors", f"{sum(r.inside for r in found)} of {len(found)}"),
                (
                    "vacuum, whole unit",
                    f"truth inside at {inside} of {len(runs)} nodes; half-width up to {wide:.0f} % of the rise",
                ),
                ("slips of the document", f"{len(work.document['slips'])}, each handled or explained"),
            )
        )
    ]


def levels(work: Work) -> Section:
    """Return Table 2 as found beside the printed one, both structures, and what was recovered."""
    steady = td.steady(work.model("m_Sd"), BENCH)
    blocks: list[PageBlock] = [
        Words(
            "The document's blocks hold one constant coefficient a surface. Air that a warm box moves by itself takes heat as the "
            "difference of temperature to the power 1.25, and the surface radiates beside it: a coefficient tuned where a part settles is "
            "wrong while it warms, and the fit hides that in the mass. Both structures were fitted to the same logs."
        ),
        findings.table_2(work),
        Heading("Which structure the data choose"),
        Words(
            "Constant: the document's own. Natural: laminar exponent 1/4 and radiation with the emissivity of a finish as a prior; the "
            "support of the measurement unit weighs by itself; what a level found goes to the next with its covariance. No fit has seen "
            "these logs."
        ),
        findings.verdicts(work),
        drawings.structures(work),
        Heading("What the campaign recovers, and what it cannot tell"),
        Words(
            "The unit behind the logs was looked at when everything was fitted and judged. Coefficients are compared as effective ones at "
            "one temperature: convection and radiation are hardly separable in air, so their sum is known far better than either."
        ),
        folded("Found and hidden, value by value", [findings.recovered(work)], f"{len(work.recovered)} values"),
        folded("Hidden temperatures of the held-out logs", [findings.hidden(work)], "sensor by sensor"),
        folded("Other parameters by level", [tables.levels(work.natural)[1]], "natural structure"),
        Facts(tuple((name, f"{steady[path] - 273.15:.1f} °C") for name, path in SEEN.items())),
        Words(
            "Settled temperatures of the calibrated whole at 24 °C; the document says about 34 °C for the processor and about 32 °C for "
            "most others."
        ),
        Heading("Theoretical and effective coefficient"),
        *coefficients(),
        Heading("Time constants"),
        findings.settling(work),
    ]
    return Section.of_blocks("levels", "Levels, Table 2 and two structures", blocks, "Levels and Table 2")


def coefficients() -> list[PageBlock]:
    """Return the document's example: both coefficients, what their difference can and cannot mean, Biot numbers."""
    found = findings.htc()
    numbers = "\n".join(line for line in str(found).splitlines() if not line.startswith("remark"))
    return [
        Code(numbers, "The EleGFO example, Eq. 7."),
        Notes(found.remarks, "What the difference can and cannot mean"),
        Notes((findings.no_room_for_paint(),), "A painted EleGFO is refused"),
        findings.biot(),
    ]


def figures(work: Work) -> Section:
    """Return the document's figures: curves and diagrams."""
    against, worst = drawings.fig_21()
    pictures: list[PageBlock] = []
    for name, caption in PICTURES.items():
        model = td.load_model(HERE / f"{name}.toml")
        temperatures = td.steady(model, BENCH)
        pictures.append(Picture(inline(network_map(model, temperatures=temperatures, title=name)), caption))
    spice = td.interop.to_spice(td.load_model(HERE / "EleGFO.toml"), BENCH)
    blocks: list[PageBlock] = [
        Words("Measured means read by the virtual laboratory's sensors. The document's own curves are not public and were not copied."),
        Heading("The document's Fig. 17: components"),
        drawings.figure(work, drawings.FIG_17, "fig17"),
        Heading("The document's Fig. 25: submodels"),
        drawings.figure(work, drawings.FIG_25, "fig25"),
        Heading("The document's Fig. 26: the whole"),
        drawings.figure(work, drawings.FIG_26, "fig26"),
        Heading("The document's Fig. 21: the network against its equations"),
        against,
        Words(
            f"Largest difference {1e9 * worst:.1f} nK. The equations are the text that the program wrote from the network, "
            "integrated by scipy's DOP853."
        ),
        Heading("The document's Figs. 3, 5, 18, 19, 22 to 24: the models"),
        Words("Drawn from the decks, with settled temperatures at 24 °C."),
        *pictures[:2],
        *(folded(p.caption, [p]) for p in pictures[2:] if isinstance(p, Picture)),
        Heading("The document's Fig. 4: the electrical analogue"),
        Words("The same model as a circuit: degrees are volts, watts are amperes. ngspice solves it to the same numbers."),
        Code(spice, "EleGFO as a SPICE netlist."),
    ]
    return Section.of_blocks("figures", "The document's figures again", blocks, "Figures")


def printed_rises(derived: td.interop.Equations) -> tuple[Any, Any]:
    """Return the rises of Eq. 6 as printed, after Eqs. 4 and 6 were compared with what the program derived.

    Raises
    ------
    ValueError   When one is not the other.
    """
    import sympy

    r1, r2, n1, n2, n3 = sympy.symbols("R_cd1 R_cd2 R_cn1 R_cn2 R_cn3")
    t1, t2, ta, q1, q2 = sympy.symbols("T_1 T_2 T_amb Q_k1 Q_k2")
    delta = r1 * r2 + r1 * n3 + r2 * n3
    alpha, beta = r1 * n2 + n2 * n3, r2 * n1 + n1 * n3
    whole = delta + alpha + beta + n1 * n2
    symbols = {s: sympy.Symbol(s) for s in ("Delta", "alpha", "beta", "Lambda")}
    d, a, b, w = symbols.values()
    rises = (n1 / w * (q1 * (d + a) + q2 * n2 * n3), n2 / w * (q1 * n1 * n3 + q2 * (d + b)))
    meaning = {d: delta, a: alpha, b: beta, w: whole}
    heat = (
        q1 - (t1 - ta) / n1 - (r2 * (t1 - ta) + n3 * (t1 - t2)) / delta,
        q2 - (t2 - ta) / n2 - (r1 * (t2 - ta) + n3 * (t2 - t1)) / delta,
    )
    pairs = [("Eq. 4", printed, derived.expanded(found)) for printed, found in zip(heat, derived.heat, strict=True)]
    pairs += [("Eq. 6", ta + rise.subs(meaning), found) for rise, found in zip(rises, derived.steady.values(), strict=True)]
    for name, printed, found in pairs:
        if sympy.simplify(printed - found) != 0:
            raise ValueError(f"{name} as derived is not the printed one")
    return rises


def equations() -> Section:
    """Return Eqs. 4 to 6 as derived from the network of Fig. 19."""
    from sympy import mathml

    derived = td.interop.equations(td.load_model(HERE / "m_PrE.toml"), drawings.NAMES)
    lines = [(text, "(4)") for text in derived.mathml()]

    def shown(expression: Any) -> str:
        return str(mathml(expression, printer="presentation", order="none"))

    steady = [
        (f'<math display="block"><mrow><mi>Δ</mi><msub><mi>T</mi><mtext>{k},ss</mtext></msub><mo>=</mo>{shown(rise)}</mrow></math>', "(6)")
        for k, rise in enumerate(printed_rises(derived), 1)
    ]
    matrix = f'<math display="block"><mrow><mi>A</mi><mo>=</mo>{shown(derived.matrix)}</mrow></math>'
    blocks: list[PageBlock] = [
        Words(
            "Derived by the program from the network of Fig. 19, the massless node eliminated, and equal to the printed ones as symbols: "
            "Eqs. 4 to 6 hold no slip. Eq. 6 needs constant inputs and at least one finite convective resistance."
        ),
        Formulas(tuple(lines), "Eq. 4, with its abbreviation and the massless node."),
        folded("Eq. 5: the matrix", [Formulas(((matrix, "(5)"),))]),
        Formulas(tuple(steady), "Eq. 6, rises over the room in steady state, as printed; what the program derives is the same."),
        folded("As LaTeX", [Code(derived.latex())]),
        folded("As an Octave function, in the form of Fig. 20", [Code(derived.octave("thermal_two_node"))]),
    ]
    return Section.of_blocks("equations", "Equations 4 to 6, derived", blocks, "Equations")


def scenarios(work: Work, runs: list[Vacuum]) -> Section:
    """Return temperature, humidity and vacuum."""
    alone = [run for part in ("Acc", "FOG_h", "FOG_l", "EleGFO", "ProcSISNAV") for run in work.vacuum(part, {part: "case"})]
    humid = td.simulate(work.study.model, BENCH.with_(environment={"cv": td.simulation.Environment(humidity=0.9)}))
    bound = td.simulate(td.load_model(HERE / "Acc.toml"), BENCH.vacuum(as_printed=True))
    flags = [f"{f.component}: {f.limit:.0f} °C passed after {f.time / 3600:.3f} h" for f in work.study.exceeded(bound, at="imu.acc.acc_x")]
    blocks: list[PageBlock] = [
        Heading("Temperature"),
        warmer(work),
        Heading("Humidity"),
        Notes(humid.warnings),
        Heading("Vacuum"),
        Words(
            "The document sets every coefficient to about zero. That takes the radiation away that is inside them, so its ramps are upper "
            "bounds. Here convection goes and radiation stays, with the emissivities that the fits found and their errors; the hidden unit "
            "is run the same way. Neither is a forecast for real hardware."
        ),
        drawings.vacuum(runs, "vacuum"),
        findings.vacuums(runs),
        folded("Components alone", [drawings.vacuum(alone, "alone"), findings.vacuums(alone)]),
        Words("Limits passed on the way, in vacuum as printed, by an accelerometer alone:"),
        Notes(tuple(flags)),
    ]
    return Section.of_blocks("scenarios", "Scenarios: temperature, humidity, vacuum", blocks, "Scenarios")


def warmer(work: Work) -> Table:
    """Return settled temperatures at 24 and at 34 °C with both structures."""
    rows: list[Line] = []
    models = {"constant": work.constant["m_Sd"].model, "natural": work.model("m_Sd")}
    found = {k: [td.steady(m, td.Scenario("x", boundaries={"cv": f"{t} [degC]"})) for t in (24, 34)] for k, m in models.items()}
    for name, path in SEEN.items():
        cells = [f"{found[k][i][path] - 273.15:.2f}" for k in found for i in (0, 1)]
        shifts = [f"{found[k][1][path] - found[k][0][path]:.3f}" for k in found]
        rows.append(
            [Cell(name, "", "main"), cells[0], cells[1], Cell(shifts[0], "", "main"), cells[2], cells[3], Cell(shifts[1], "", "main")]
        )
    columns = [Head("node"), *(Head(f"{k}, {t}", True) for k in found for t in ("24 °C", "34 °C", "shift, K"))]
    caption = (
        "A linear network shifts by exactly the 10 K of its room. With radiation, and gyros whose power falls as they warm, it is less."
    )
    return Table.of_rows(columns, rows, caption)


LIMITS = (
    "Every log is synthetic. The fits find the true values of the simulated unit. This shows that the procedure works; it does not "
    "show how the real unit behaves.",
    "22 free parameters of the model are not printed and were assumed. The decks mark more assumed values, such as handbook values "
    "and nominal thicknesses.",
    "The words 'around', 'slightly' and 'approximately' were given numerical widths. The curves of the figures were not available.",
    "Each case has one node. The results do not cover the electronics inside, where Biot numbers are above 0.1.",
    "The second structure shares the laboratory's form (exponent 1/4, grey radiation), which is textbook physics; its values are "
    "hidden. Real air and real finishes can differ from both.",
    "In vacuum, joints keep their conductance of air. Conduction through gas in the joints is not separated.",
    "Actions 8 to 12 have no verdict here. examples/sisnav/macro and examples/sisnav/qualification show them with an assumed host, "
    "fixture and limits.",
)


def main(work: Work, to: Path, audience: str = "all") -> Path:
    """Write the page and return its path."""
    runs = work.vacuum("m_Sd", SEEN)
    sections = [
        levels(work),
        figures(work),
        equations(),
        scenarios(work, runs),
        Section.of_blocks("slips", "25 slips of the document, and what became of each", [findings.slips(work)], "Slips"),
        Section.of_blocks("limits", "What this study cannot say", [Notes(LIMITS)], "Limits of the study"),
    ]
    return study_report(
        work.study, work.natural, to=to, sections=sections, outcome=outcome(work, runs), watermark=WATERMARK, audience=audience
    )
