"""Write docs/studies/sisnav.md and its figures from what the program finds: ``python examples/sisnav/write_study.py``.

Every number of that page comes from here; a test writes it again and compares.
"""

from __future__ import annotations

import html
import math
import re
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from string import Template

import drawings
import findings
import page
import warm_up
import work

import thermid as td
from thermid.reporting._blocks.content import Graphic
from thermid.reporting._pages.study import parts
from thermid.reporting.diagrams import network_map
from thermid.reporting.pages import Table

TARGET = work.HERE.parents[1] / "docs" / "studies"
FOLDER = "figures"
PAPER = '<rect width="100%" height="100%" fill="#ffffff"/>'


def rows(table: Table, columns: tuple[int, ...] | None = None) -> str:
    """Return a table as Markdown."""
    kept = range(len(table.columns)) if columns is None else columns

    def line(cells: list[str]) -> str:
        return "| " + " | ".join(c.replace("|", "/") for c in cells) + " |"

    head = line([table.columns[k].title or " " for k in kept])
    rule = "|" + "|".join("---:" if table.columns[k].numeric else "---" for k in kept) + "|"
    return "\n".join([head, rule, *(line([row[k].text for k in kept]) for row in table.rows)])


def standalone(drawn: Graphic, title: str) -> str:
    """Return a figure as a file of its own: colours in place of the page's variables, its legend below it."""
    text = re.sub(r"var\(--[\w-]+,(#[0-9a-fA-F]+)\)", r"\1", drawn.markup).replace("var(--font)", "sans-serif")
    width, height = (float(v) for v in re.search(r'viewBox="0 0 ([\d.]+) ([\d.]+)"', text).groups())  # type: ignore[union-attr]
    looks = dict(reversed(re.findall(r'<path class="(?:line|area)" data-n="([^"]*)"[^>]*? style="([^"]*)"', text)))
    marks, x, y = [], 12.0, height + 14.0
    for label, style in reversed(looks.items()):
        long = 34.0 + 5.8 * len(html.unescape(label))
        if x > 12.0 and x + long > width:
            x, y = 12.0, y + 16.0
        shape = "h22v-7h-22z" if style.startswith("fill:") else "h22"
        marks.append(f'<path d="M{x:.0f} {y:.0f}{shape}" style="{style}"/><text x="{x + 27:.0f}" y="{y + 4:.0f}">{label}</text>')
        x += long
    head = f'<svg xmlns="http://www.w3.org/2000/svg" font-family="sans-serif" viewBox="0 0 {width:g} {y + 12:g}" '
    text = re.sub(
        r"<svg ([^>]*)>", lambda m: head + re.sub(r'viewBox="[^"]*" ?', "", m[1]) + f"><title>{title}</title>{PAPER}", text, count=1
    )
    return text.replace("</svg>", "".join(marks) + "</svg>\n")


def figures(done: work.Work) -> dict[str, str]:
    """Return file name -> SVG of every figure of the page."""
    out = {}
    for name in ("m_PrE", "m_Sd"):
        model = td.load_model(work.HERE / f"{name}.toml")
        out[f"{name}.svg"] = network_map(model, temperatures=td.steady(model, work.BENCH), title=name) + "\n"
    shown = {"fig17_EleGFO": drawings.FIG_17[3], "fig25_m_IMU_FOG1": drawings.FIG_25[3], "fig26_m_Sd_PrS": drawings.FIG_26[0]}
    for name, panel in shown.items():
        out[f"{name}.svg"] = standalone(drawings.panel(done, panel, name), f"{panel.label}, synthetic data")
    against, _ = drawings.fig_21()
    out["fig21.svg"] = standalone(against.plots[0].drawn, "network against equations")
    for key, plot in zip(("m_PrE", "m_IMU"), drawings.structures(done).plots, strict=True):
        out[f"held_out_{key}.svg"] = standalone(plot.drawn, f"{plot.caption}, synthetic data")
    run = done.vacuum("m_Sd", {"m_Sd_PrS": page.SEEN["m_Sd_PrS"]})
    out["vacuum_m_Sd_PrS.svg"] = standalone(drawings.vacuum(run, "vacuum").plots[0].drawn, "m_Sd_PrS in vacuum, synthetic data")
    return out


def text(done: work.Work) -> str:
    """Return the page."""
    found = done.recovered
    inside = sum(r.inside for r in found)
    worst = {
        name: max(c.found for v in campaign.verdicts for c in v.checks if c.criterion == "max_error")
        for name, campaign in (("constant", done.constant), ("natural", done.natural))
    }
    _, difference = drawings.fig_21()
    acc = td.simulate(td.load_model(work.HERE / "Acc.toml"), work.BENCH)
    ramp = td.simulate(td.load_model(work.HERE / "Acc.toml"), work.BENCH.vacuum(as_printed=True))
    (flag,) = done.study.exceeded(ramp, at="imu.acc.acc_x")
    runs = done.vacuum("m_Sd", page.SEEN)
    widest = max(r.half_width for r in runs)
    single = [run for part in ("Acc", "FOG_h", "FOG_l", "EleGFO", "ProcSISNAV") for run in done.vacuum(part, {part: "case"})]
    htc = findings.htc()
    seen = done.hidden_errors()
    outside = "; ".join(f"{r.stage}: {r.name}" for r in found if not r.inside) or "none"
    meters = dict(zip(("alone", "paused", "flat"), warm_up.main(done.folder / "warm_up"), strict=True))
    values = {
        "document": done.study.content.document,
        "subject": done.study.content.knowledge.subject,
        "parts": rows(parts(done.study), (0, 1, 2, 3)),
        "folder": FOLDER,
        "nodes": str(len(td.simulation.compile_network(done.study.model).nodes)),
        "rise": f"{acc['case'].rise:.3f}",
        "tau": f"{acc.time_constants[0]:.1f}",
        "settled": f"{acc.time_constants[0] * math.log(100) / 3600:.2f}",
        "difference": f"{1e9 * difference:.1f}",
        "theoretical": f"{htc.theoretical:.3f}",
        "effective": f"{htc.effective:.3f}",
        "htc_error": f"{htc.error:.2f}",
        "table_2": rows(findings.table_2(done)),
        "worst_constant": f"{worst['constant']:.2f}",
        "worst_natural": f"{worst['natural']:.2f}",
        "verdicts": rows(findings.verdicts(done)),
        "inside": str(inside),
        "found": str(len(found)),
        "outside": outside,
        "true_error": f"{max(h.error for h in seen):.2f}",
        "true_inside": str(sum(h.inside >= work.LEVEL for h in seen)),
        "true_of": str(len(seen)),
        "true_share": f"{100 * sum(h.inside for h in seen) / len(seen):.0f}",
        "true_low": f"{min(h.half_width / h.error for h in seen):.1f}",
        "true_high": f"{max(h.half_width / h.error for h in seen):.1f}",
        "limit": f"{flag.limit:.0f}",
        "crossing": f"{flag.time / 3600:.3f}",
        "vacuum": rows(findings.vacuums(runs)),
        "widest": f"{100 * widest:.0f}",
        "vacuum_alone": rows(findings.vacuums(single)),
        "settling": rows(findings.settling(done)),
        "remarks": "\n".join(f"- {remark}" for remark in htc.remarks),
        "paint": findings.no_room_for_paint(),
        "accelerometer": f"{100 * single[0].half_width:.0f}",
        "hidden": rows(findings.hidden(done)),
        "biot": rows(findings.biot()),
        "slips": rows(findings.slips(done)),
        **{f"{name}_error": f"{100 * m.error:+.1f}" for name, m in meters.items()},
        **{f"{name}_times": f"{m.times:.1f}" for name, m in meters.items()},
        "limits": chr(10).join(f"- {line}" for line in page.LIMITS),
    }
    return Template((work.HERE / "study.md.in").read_text(encoding="utf-8")).substitute(values)


def write(target: Path, say: Callable[[str], None] = lambda words: None) -> Path:
    """Write page and figures into a folder and return the page's path."""
    with tempfile.TemporaryDirectory() as folder:
        done = work.run(Path(folder), say)
        (target / FOLDER).mkdir(parents=True, exist_ok=True)
        for name, svg in figures(done).items():
            (target / FOLDER / name).write_text(svg, encoding="utf-8")
        (target / "sisnav.md").write_text(text(done), encoding="utf-8")
    return target / "sisnav.md"


if __name__ == "__main__":
    print(write(Path(sys.argv[1]) if len(sys.argv) > 1 else TARGET, print))
