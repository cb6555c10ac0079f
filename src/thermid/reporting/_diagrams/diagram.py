"""`diagram`: a model as a picture, as SVG text with no references to anything outside."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape

import numpy as np

from thermid.base.dual import value_of
from thermid.base.errors import NameNotFoundError, refuse_unknown
from thermid.model.elements import COMPLEMENT, named_control
from thermid.model.tree import Flat, FlatConductor, FlatLoad, FlatNode, Model, Tree
from thermid.physics.constants import ICE_POINT
from thermid.reporting._diagrams.layout import LOAD_PORT, LOAD_WIDTH, MARGIN, PORT, DiagramLayout, Row, Wire, arrange, clipped, width_of
from thermid.simulation.network import Network, Numbers, compile_network, conductance

Point = tuple[float, float]

# class of the line, what the legend says
STYLES: Mapping[str, tuple[str, str]] = {
    "conduction": ("solid", "conduction, contact"),
    "contact": ("solid", "conduction, contact"),
    "convection": ("dashed", "convection"),
    "effective": ("dashed", "convection with radiation (effective)"),
    "radiation": ("dotted", "radiation"),
    "gas": ("dashed", "gas at rest"),
    "flow": ("flow", "one-way flow"),
    "duct": ("dashed", "stream in a duct"),
    "heat_sink": ("dashed", "stream through a heat sink"),
    "lead": ("solid", "lead"),
    "heat_pipe": ("mixed", "heat pipe"),
    "bolted": ("solid", "bolted joint"),
    "wedge_lock": ("solid", "wedge lock"),
    "spreading": ("solid", "spreading"),
    "table": ("mixed", "table"),
}
"""Kind of conductor -> style of its line, and what the legend calls it. Every kind has one."""
LEAD_LOSS = ("dashed", "heat loss of a lead")
STYLE = """
.thermid-diagram{--d-ink:#1c2430;--d-soft:#5a6675;--d-paper:#fff;--d-box:#eef2f6;--d-edge:#b5c0cc;--d-mass:#dbe7f3;--d-mass-edge:#4a6f96;
--d-solid:#1c2430;--d-dashed:#0072b2;--d-dotted:#c04a00;--d-flow:#00795a;--d-mixed:#8a4a7d;--d-load:#c04a00;--d-rail:#7d8a99;
font-family:system-ui,-apple-system,"Segoe UI",Roboto,"Liberation Sans",sans-serif}
@media (prefers-color-scheme:dark){.thermid-diagram{--d-ink:#e6eaf0;--d-soft:#a3afbd;--d-paper:#14181e;--d-box:#1e252e;--d-edge:#465261;
--d-mass:#27405a;--d-mass-edge:#7ea6cf;--d-solid:#e6eaf0;--d-dashed:#5ab4e8;--d-dotted:#f08a4b;--d-flow:#3fc79a;--d-mixed:#d79ac8;
--d-load:#f08a4b;--d-rail:#8896a6}}
@media print{.thermid-diagram{--d-ink:#1c2430;--d-soft:#5a6675;--d-paper:#fff;--d-box:#eef2f6;--d-edge:#b5c0cc;--d-mass:#dbe7f3;
--d-mass-edge:#4a6f96;--d-solid:#1c2430;--d-dashed:#0072b2;--d-dotted:#c04a00;--d-flow:#00795a;--d-mixed:#8a4a7d;--d-load:#c04a00;--d-rail:#7d8a99}}
.thermid-diagram text{fill:var(--d-ink);font-size:11px}
.thermid-diagram .paper{fill:var(--d-paper)}
.thermid-diagram .box{fill:var(--d-box);fill-opacity:.55;stroke:var(--d-edge)}
.thermid-diagram .head{font-size:12px;font-weight:600;fill:var(--d-soft)}
.thermid-diagram .mass{fill:var(--d-mass);stroke:var(--d-mass-edge);stroke-width:1.4}
.thermid-diagram .name{font-size:13px;font-weight:600}
.thermid-diagram .soft{fill:var(--d-soft)}
.thermid-diagram .warm{fill:#1c2430}
.thermid-diagram .dot{fill:var(--d-ink)}
.thermid-diagram .rail{fill:var(--d-rail)}
.thermid-diagram .halo{paint-order:stroke;stroke:var(--d-paper);stroke-width:4px;stroke-linejoin:round}
.thermid-diagram .wire{fill:none;stroke-width:1.7;stroke-linejoin:round}
.thermid-diagram .solid{stroke:var(--d-solid)}
.thermid-diagram .dashed{stroke:var(--d-dashed);stroke-dasharray:7 4}
.thermid-diagram .dotted{stroke:var(--d-dotted);stroke-width:2.4;stroke-linecap:round;stroke-dasharray:.1 5}
.thermid-diagram .flow{stroke:var(--d-flow);stroke-width:2.2}
.thermid-diagram .mixed{stroke:var(--d-mixed);stroke-dasharray:8 3 2 3}
.thermid-diagram .flow-head{fill:var(--d-flow)}
.thermid-diagram .load{stroke:var(--d-load);stroke-width:2;fill:none}
.thermid-diagram .load-head{fill:var(--d-load)}
"""


def diagram(
    model: Model,
    *,
    temperatures: Mapping[str, float] | None = None,
    flows: Mapping[str, float] | None = None,
    powers: Mapping[str, float] | None = None,
    logged: Collection[str] = (),
    folded: Sequence[str] = (),
    title: str | None = None,
    marked: bool = False,
) -> str:
    """Return the hierarchy of a model as SVG text: boxes for submodels, masses, massless nodes, boundaries, loads and conductors.

    Parameters
    ----------
    model : Model           What to draw.
    temperatures : dict     Node or boundary -> temperature; masses are tinted by it, from blue (coldest) to orange (warmest). [K]
    flows : dict            Conductor -> heat flow from its first end to its second; lines are as wide as it is large, with an arrow. [W]
    powers : dict           Load -> power in place of the deck's; a load that is not in it heats a given temperature. [W]
    logged : collection     Loads whose power a log gives: the deck's is not shown for them.
    folded : sequence       Paths of submodels that are drawn as one mass each.
    title : str             What a screen reader says; the model's title by default.
    marked : bool           Whether elements carry their paths (``data-path``, ``data-part``), for a page that answers to clicks.

    Raises
    ------
    ThermidError   When the model does not compile, or a temperature is given for what is no node.
    """
    network = compile_network(model)
    kelvins = {network.find(name): float(value) for name, value in (temperatures or {}).items()}
    numbers = network.numbers()
    plain = fold(network.flat, folded)
    values = conductances(plain, network, numbers, kelvins)
    at = pooled(plain, numbers, kelvins)
    under = notes(plain, numbers, at)
    if flows:
        values = {drawn: watts(plain, drawn, flows) or text for drawn, text in values.items()}
    plan = arrange(plain.flat, values, under, plain.parts)
    flowing = {drawn: sum(sign * flows.get(c, 0.0) for c, sign in members) for drawn, members in plain.members.items()} if flows else {}
    parts = [f'<rect class="paper" width="{plan.width:.0f}" height="100%"/>', *_boxes(plan, marked)]
    parts += [part for k, wire in enumerate(plan.wires) for part in _wire(plan, k, wire, flowing, marked)]
    parts += _rails(plan, under)
    parts += [part for row in plan.rows.values() for part in _node(plan, row, under, at, marked, row.path + "." in plain.parts)]
    parts += _loads(plan, plain, numbers, powers, logged)
    parts += [part for k, wire in enumerate(plan.wires) for part in _label(plan, k, wire, flowing)]
    signs = [("≈", "≈ at 35 and 25 °C"), (" *<", "* changes with temperature or time")]
    legend, bottom = _legend(plan, bool(network.flat.loads), [text for sign, text in signs if any(sign in part for part in parts)])
    label = escape(title if title is not None else model.title)
    return (
        f'<svg class="thermid-diagram" xmlns="http://www.w3.org/2000/svg" role="img" width="{plan.width:.0f}" height="{bottom:.0f}" '
        f'viewBox="0 0 {plan.width:.0f} {bottom:.0f}"><title>{label}</title><style>{STYLE}</style>' + "".join([*parts, *legend]) + "</svg>"
    )


def _text(x: float, y: float, text: str, kind: str = "", anchor: str = "start", tip: str = "") -> str:
    inside = f"<title>{escape(tip)}</title>" if tip else ""
    return f'<text x="{x:.1f}" y="{y:.1f}" class="{kind}" text-anchor="{anchor}">{inside}{escape(text)}</text>'


def _mark(key: str, path: str, marked: bool) -> str:
    return f' data-{key}="{escape(path)}"' if marked and path else ""


def _boxes(plan: DiagramLayout, marked: bool) -> Iterable[str]:
    for box in plan.root.boxes():
        x_left, right = plan.box_edges(box)
        bottom = plan.bottom if box.depth == 0 else box.bottom
        size = f'x="{x_left:.1f}" y="{box.y:.1f}" width="{right - x_left:.1f}" height="{bottom - box.y:.1f}"'
        yield f'<rect class="box" {size} rx="8"{_mark("part", box.prefix.rstrip("."), marked)}/>'
        room = (plan.left + plan.right) / 2 - x_left - 20
        yield _text(x_left + 10, box.y + 17, clipped(box.title, room, 12.5), "head", tip=f"{box.prefix.rstrip('.')} {box.title}".strip())


def _path(points: list[Point], kind: str, tip: str, extra: str = "") -> str:
    """Return a line through points with rounded corners."""
    d = f"M{points[0][0]:.1f} {points[0][1]:.1f}"
    for before, here, after in zip(points, points[1:], points[2:], strict=False):
        (ax, ay), (bx, by) = (_toward(here, end, 6.0) for end in (before, after))
        d += f"L{ax:.1f} {ay:.1f}Q{here[0]:.1f} {here[1]:.1f} {bx:.1f} {by:.1f}"
    return f'<path class="wire {kind}" d="{d}L{points[-1][0]:.1f} {points[-1][1]:.1f}"{extra}><title>{escape(tip)}</title></path>'


def _toward(start: Point, end: Point, step: float) -> Point:
    dx, dy = end[0] - start[0], end[1] - start[1]
    length = max((dx * dx + dy * dy) ** 0.5, 1e-9)
    share = min(step, length / 2) / length
    return start[0] + share * dx, start[1] + share * dy


def _head(tip: Point, from_: Point, kind: str, size: float = 8.0) -> str:
    """Return an arrow head at the end of a line."""
    bx, by = _toward(tip, from_, size)
    nx, ny = (tip[1] - by) * 0.5, (bx - tip[0]) * 0.5
    return f'<path class="{kind}" d="M{tip[0]:.1f} {tip[1]:.1f}L{bx + nx:.1f} {by + ny:.1f}L{bx - nx:.1f} {by - ny:.1f}Z"/>'


def _leaving(plan: DiagramLayout, row: Row, wire: int) -> list[Point]:
    """Return the points from a node to its port at the right of the column."""
    y = row.port(wire)
    if not row.massless:
        return [(plan.right, y)]
    middle = (plan.left + plan.right) / 2
    return [(middle, row.middle), (middle + 14, y), (plan.right, y)] if abs(y - row.middle) > 0.5 else [(middle, y)]


def _points(plan: DiagramLayout, k: int, wire: Wire) -> list[Point]:
    """Return the points of a conductor, from its first end to its second."""
    if wire.way == "straight":
        upper, lower = sorted(wire.rows, key=lambda r: r.y)
        x = (plan.left + plan.right) / 2
        points = [(x, upper.middle if upper.massless else upper.y + upper.height), (x, lower.middle if lower.massless else lower.y)]
        return points if wire.rows[0] is upper else points[::-1]
    if wire.way == "lane":
        x = plan.lanes[wire.lane]
        first, second = (_leaving(plan, row, k) for row in wire.rows)
        return [*first, (x, first[-1][1]), (x, second[-1][1]), *second[::-1]]
    if wire.way == "rails":
        y = _rails_y(plan, wire)
        return [(plan.rails[wire.rails[0]], y), (plan.rails[wire.rails[1]], y)]
    points = _leaving(plan, wire.rows[0], k)
    points = [*points, (plan.rails[wire.rails[0]], points[-1][1])]
    return points if wire.conductor.ends[1] == wire.rails[0] else points[::-1]


def _rails_y(plan: DiagramLayout, wire: Wire) -> float:
    among = [w for w in plan.wires if w.way == "rails"]
    return plan.bottom - PORT * (len(among) - among.index(wire) - 0.5)


def _style(c: FlatConductor) -> tuple[str, str]:
    """Return the style of a conductor's line and its text in the legend; what a lead loses on its way has its own."""
    return LEAD_LOSS if c.kind == "lead" and c.recipe is not None else STYLES[c.kind]


def _thickness(path: str, watts: Mapping[str, float]) -> float:
    """Return how thick the line of a heat flow is drawn."""
    most = max(map(abs, watts.values()))
    return 1.0 + 7.0 * math.sqrt(abs(watts.get(path, 0.0)) / most if most > 0 else 0.0)


def _wire(plan: DiagramLayout, k: int, wire: Wire, watts: Mapping[str, float], marked: bool) -> Iterable[str]:
    c = wire.conductor
    style, _ = _style(c)
    points = _points(plan, k, wire)
    extra, flow = _mark("path", c.path, marked), watts.get(c.path, 0.0)
    if watts:
        extra += f' style="stroke-width:{_thickness(c.path, watts):.1f}px"'
    yield _path(points, style, f"{c.path} ({c.kind}): {c.ends[0]} to {c.ends[1]}, {wire.value}", extra)
    if flow and c.kind != "flow":
        ends = points if flow > 0 else points[::-1]
        yield _head(_toward(ends[-1], ends[-2], 5.0), ends[-2], "dot", 12.0)
    if c.kind == "flow":
        tip = _toward(points[-1], points[-2], 5.0) if c.ends[1] in plan.rails else points[-1]
        yield _head(tip, points[-2], "flow-head", 11.0)
    if wire.way == "rail":
        yield f'<circle class="rail" cx="{plan.rails[wire.rails[0]]:.1f}" cy="{wire.rows[0].port(k):.1f}" r="5.5"/>'


def _label(plan: DiagramLayout, k: int, wire: Wire, watts: Mapping[str, float]) -> Iterable[str]:
    """Yield name and conductance: beside lines that run down, above lines to a rail."""
    tip = f"{wire.conductor.path} ({wire.conductor.kind})"
    if wire.way in ("straight", "lane"):
        x = 7 + (plan.lanes[wire.lane] if wire.way == "lane" else (plan.left + plan.right) / 2)
        yield _text(x, wire.label_y - 2, clipped(wire.name, 110), "halo soft", tip=tip)
        yield _text(x, wire.label_y + 11, wire.value, "halo")
        return
    y = _rails_y(plan, wire) if wire.way == "rails" else wire.rows[0].port(k)
    if watts:  # above the line, however thick it is, so that no descender lies in it
        y -= _thickness(wire.conductor.path, watts) / 2
    room = plan.frame - plan.labels - width_of(f"  {wire.value}")
    name = clipped(wire.name, room)
    yield _text(plan.labels, y - 4, name, "halo soft", tip=tip)
    yield _text(plan.labels + width_of(f"{name}  "), y - 4, wire.value, "halo")


def _rails(plan: DiagramLayout, notes: Mapping[str, str]) -> Iterable[str]:
    """Yield the boundaries: a bar each at the right edge, with its name at the top."""
    for name, x in plan.rails.items():
        top = plan.root.y
        size = f'x="{x - 3.5:.1f}" y="{top:.1f}" width="7" height="{plan.bottom - top:.1f}" rx="3.5"'
        yield f'<rect class="rail" {size}><title>boundary {escape(name)}</title></rect>'
        under = notes.get(name, "")
        yield _text(x, top - (20 if under else 7), clipped(name, 116, 13), "name", "middle", tip=name)
        if under:
            yield _text(x, top - 7, under, "soft", "middle")


def _node(
    plan: DiagramLayout, row: Row, notes: Mapping[str, str], temperatures: Mapping[str, float], marked: bool = False, folded: bool = False
) -> Iterable[str]:
    name, under = row.path.rpartition(".")[2], notes.get(row.path, "")
    name = row.path.removeprefix(row.box) if row.massless else name
    middle = (plan.left + plan.right) / 2
    if row.massless:
        tip = f"<title>{escape(row.path)}: no capacitance</title>"
        yield f'<circle class="dot" cx="{middle:.1f}" cy="{row.middle:.1f}" r="5">{tip}</circle>'
        lift = -7 if row.loads else 0
        yield _text(middle - 10, row.middle + 4 + lift, clipped(f"{name} {under}".strip(), 130), "halo", "end", tip=row.path)
        return
    fill = f' style="fill:{tint(temperatures[row.path], temperatures)}"' if row.path in temperatures else ""
    kind = " warm" if fill else ""
    width = plan.right - plan.left
    yield (
        f'<rect class="mass" x="{plan.left:.1f}" y="{row.y:.1f}" width="{width:.1f}" height="{row.height:.1f}" rx="9"{fill}'
        f"{_mark('part' if folded else 'path', row.path, marked)}><title>{escape(row.path)}: {escape(under)}</title></rect>"
    )
    yield _text(middle, row.middle - 3, clipped(name, width - 14, 13), f"name{kind}", "middle", tip=row.path)
    yield _text(middle, row.middle + 13, clipped(under, width - 10), kind.strip() or "soft", "middle")


def tint(kelvin: float, temperatures: Mapping[str, float]) -> str:
    """Return the colour of a temperature among others: pale blue the lowest, pale orange the highest; dark text stands on all."""
    low, high = min(temperatures.values()), max(temperatures.values())
    share = (kelvin - low) / (high - low) if high > low else 0.5
    cold, mild, warm = (191, 219, 242), (244, 240, 226), (250, 188, 128)
    a, b, part = (cold, mild, 2 * share) if share < 0.5 else (mild, warm, 2 * share - 1)
    return "#" + "".join(f"{round(p + part * (q - p)):02x}" for p, q in zip(a, b, strict=True))


def _power(load: FlatLoad, numbers: Numbers, powers: Mapping[str, float] | None, logged: Collection[str]) -> tuple[str, bool]:
    """Return the power of a load as text, and whether it may be another at another time: that of the deck, or the one given."""
    if load.path in logged:
        return "as logged", False
    if powers is not None:
        return (quantity(powers[load.path], "W") if load.path in powers else ""), False
    text = quantity(value_of(numbers.values[load.fields["power"]]), "W") if "power" in load.fields else "table" if load.curve else ""
    return text + times(load.controls), bool(set(load.fields) - {"power"} or (load.curve and "power" in load.fields))


def _loads(
    plan: DiagramLayout, plain: FoldedModel, numbers: Numbers, powers: Mapping[str, float] | None, logged: Collection[str]
) -> Iterable[str]:
    """Yield an arrow per load, with its power and name."""
    at: dict[str, int] = {}
    for load in plain.flat.loads:
        row = plan.rows[load.node]
        k = at[load.node] = at.get(load.node, -1) + 1
        y = row.middle + LOAD_PORT * (k - (row.loads - 1) / 2)
        end = (plan.left + plan.right) / 2 - 6 if row.massless else plan.left
        start = plan.left - LOAD_WIDTH + 8
        power, changes = _power(load, numbers, powers, logged)
        varies = " *" if changes else ""
        name = load.path.removeprefix(row.box)
        tip = f"{load.path} into {load.node}: {power}" + (", changes with temperature or time" if varies else "")
        yield f'<path class="load" d="M{start:.1f} {y:.1f}H{end - 6:.1f}"><title>{escape(tip)}</title></path>'
        yield _head((end, y), (start, y), "load-head")
        room = plan.left - start - 12
        yield _text(start, y - 5, clipped(f"{power}{varies}", room), "halo", tip=tip)
        yield _text(start, y + 13, clipped(name, room), "halo soft", tip=load.path)


def _legend(plan: DiagramLayout, loads: bool, signs: list[str]) -> tuple[list[str], float]:
    """Return the legend of what occurs, and where the picture ends."""
    kinds = dict.fromkeys(_style(w.conductor) for w in plan.wires)
    entries = [(f'<path class="wire {style}" d="M{{x}} {{y}}h26"/>', text) for style, text in kinds]
    entries.append(('<rect class="mass" x="{x}" y="{top}" width="26" height="13" rx="4"/>', "mass, capacitance"))
    if any(r.massless for r in plan.rows.values()):
        entries.append(('<circle class="dot" cx="{mid}" cy="{y}" r="4.5"/>', "massless node"))
    if plan.rails:
        entries.append(('<rect class="rail" x="{mid}" y="{top}" width="6" height="13" rx="3"/>', "boundary"))
    if loads:
        entries.append(('<path class="load" d="M{x} {y}h19"/><path class="load-head" d="M{end} {y}l-8 -4v8Z"/>', "heat load"))
    entries += [("", text) for text in signs]
    out, x, y = [], MARGIN, plan.bottom + 22.0
    for mark, text in entries:
        width = 34 + width_of(text) + 18
        if x > MARGIN and x + width > plan.width:
            x, y = MARGIN, y + 20
        out.append(mark.format(x=f"{x:.1f}", y=f"{y:.1f}", top=f"{y - 6.5:.1f}", mid=f"{x + 13:.1f}", end=f"{x + 27:.1f}"))
        out.append(_text(x + (34 if mark else 0), y + 4, text, "soft"))
        x += width if mark else width - 34
    return out, y + 16


NOMINAL = (308.15, 298.15)
"""End temperatures at which a conductance is shown that depends on them, where none are given. [K]"""


def quantity(value: float, unit: str, digits: int = 3) -> str:
    """Return a number with its unit, without an exponent where a person would write none."""
    if not np.isfinite(value):
        return f"\u2013 {unit}"
    size = abs(value)
    text = f"{value:.{digits}g}" if size < 10**digits or size >= 1e6 else f"{value:.0f}"
    return f"{text} {unit}"


def conductances(plain: FoldedModel, network: Network, numbers: Numbers, temperatures: Mapping[str, float]) -> dict[str, str]:
    """Return conductor drawn -> its conductance as text, of a folded part the sum of its members."""
    flows = _single(network, numbers, temperatures)
    several = {drawn: [flows[c] for c, _ in members if c in flows] for drawn, members in plain.members.items()}
    by = {c.path: c.controls for c in network.flat.conductors if c.controls}
    out = {
        drawn: ("" if all(sure for _, sure in values) else "≈") + quantity(sum(v for v, _ in values), "W/K")
        for drawn, values in several.items()
    }
    for drawn, members in plain.members.items():
        out[drawn] += times(dict.fromkeys(name for c, _ in members for name in by.get(c, ())))
    return out


def times(controls: Iterable[str]) -> str:
    """Return the controls by whose shares something is multiplied, as a text behind its value."""
    short = [f"({COMPLEMENT}{name.rpartition('.')[2]})" if rest else name.rpartition(".")[2] for name, rest in map(named_control, controls)]
    return "".join(f" \u00d7 {name}" for name in short)


def _single(network: Network, numbers: Numbers, temperatures: Mapping[str, float]) -> dict[str, tuple[float, bool]]:
    """Return conductor -> its conductance [W/K], and whether it is sure: not where it depends on temperatures that nobody gave."""
    totals: dict[str, tuple[float, bool]] = {}
    for row in numbers.conductors:
        ends = [temperatures.get(end, nominal) for end, nominal in zip(row.ends, NOMINAL, strict=True)]
        fixed = row.kernel.linear or all(end in temperatures for end in row.ends)
        conductances = conductance(row.form, [value_of(c) for c in row.coefficients], row.curve, *(np.array([t]) for t in ends))
        total, sure = totals.get(row.name, (0.0, True))
        totals[row.name] = (total + float(conductances[0]), sure and fixed)
    return totals


def watts(plain: FoldedModel, drawn: str, flows: Mapping[str, float]) -> str:
    """Return the heat flow of a conductor drawn, as text; empty where none of its members has one."""
    members = [(c, sign) for c, sign in plain.members[drawn] if c in flows]
    return quantity(abs(sum(sign * flows[c] for c, sign in members)), "W") if members else ""


def _capacities(plain: FoldedModel, numbers: Numbers) -> dict[str, float]:
    """Return node drawn -> capacitance, massless ones left out. [J/K]"""
    capacitances = {n: value_of(c) for n, c in numbers.capacitances.items() if c is not None}
    return {
        drawn: sum(capacitances[n] for n in nodes if n in capacitances)
        for drawn, nodes in plain.nodes.items()
        if any(n in capacitances for n in nodes)
    }


def pooled(plain: FoldedModel, numbers: Numbers, temperatures: Mapping[str, float]) -> dict[str, float]:
    """Return node or boundary drawn -> temperature, of a folded part the mean by capacitance. [K]"""
    weight = {n: value_of(c) if c is not None else 0.0 for n, c in numbers.capacitances.items()}
    out = {n: t for n, t in temperatures.items() if all(n not in nodes for nodes in plain.nodes.values())}
    for drawn, nodes in plain.nodes.items():
        with_temperature = [n for n in nodes if n in temperatures]
        total = sum(weight[n] for n in with_temperature)
        if with_temperature:
            out[drawn] = (
                sum(weight[n] * temperatures[n] for n in with_temperature) / total if total > 0 else temperatures[with_temperature[0]]
            )
    return out


def notes(plain: FoldedModel, numbers: Numbers, temperatures: Mapping[str, float]) -> dict[str, str]:
    """Return node or boundary -> what stands under its name."""
    shown = {n: [quantity(c, "J/K")] for n, c in _capacities(plain, numbers).items()}
    for node, kelvin in temperatures.items():
        shown.setdefault(node, []).append(f"{kelvin - ICE_POINT:.1f} °C")
    return {n: " · ".join(parts) for n, parts in shown.items()}


@dataclass(frozen=True, eq=False)
class FoldedModel:
    """A flat model with some submodels drawn as one mass.

    Parameters
    ----------
    flat : Flat         What is left to draw.
    parts : tuple       Prefixes of the folded submodels, each with its dot.
    members : dict      Conductor drawn -> the conductors it stands for, each with +1, or -1 where it runs the other way.
    nodes : dict        Node drawn -> the nodes it stands for.
    """

    flat: Flat
    parts: tuple[str, ...]
    members: Mapping[str, tuple[tuple[str, int], ...]]
    nodes: Mapping[str, tuple[str, ...]]


def parts_of(model: Tree) -> tuple[str, ...]:
    """Return the paths of all submodels, outer ones first."""
    return tuple(prefix.removesuffix(".") for _, prefix in model.walk() if prefix)


def fold(flat: Flat, paths: Sequence[str]) -> FoldedModel:
    """Return a flat model with submodels folded; conductors inside them vanish, those that leave side by side become one.

    Parameters
    ----------
    flat : Flat         The model laid flat.
    paths : sequence    Paths of submodels; one inside another that is folded too adds nothing.

    Raises
    ------
    NameNotFoundError   When there is no such submodel.
    """
    submodels = parts_of(flat.names.model)
    refuse_unknown(paths, submodels, flat.names.model.title, "no submodel '{}'.", NameNotFoundError)
    outer = [p for p in paths if not any(p.startswith(f"{q}.") for q in paths)]

    def drawn(node: str) -> str:
        return next((p for p in outer if node.startswith(f"{p}.")), node)

    nodes: dict[str, list[FlatNode]] = {}
    for node in flat.nodes:
        nodes.setdefault(drawn(node.path), []).append(node)
    shown = tuple(grouped[0] if path not in outer else FlatNode(path, {"capacitance": ""}, False, "") for path, grouped in nodes.items())
    groups: dict[tuple[str, str, str], list[tuple[FlatConductor, int]]] = {}
    alone: list[FlatConductor] = []
    for c in flat.conductors:
        a, b = drawn(c.ends[0]), drawn(c.ends[1])
        if a == b and a in outer:
            continue
        if a not in outer and b not in outer:
            alone.append(c)
        elif c.kind != "flow" and (b, a, c.kind) in groups:
            groups[b, a, c.kind].append((c, -1))
        else:
            groups.setdefault((a, b, c.kind), []).append((c, 1))
    joined: list[FlatConductor] = []
    members: dict[str, tuple[tuple[str, int], ...]] = {c.path: ((c.path, 1),) for c in alone}
    for (a, b, kind), grouped in groups.items():
        first = grouped[0][0]
        name = first.path if len({c.path for c, _ in grouped}) == 1 else f"{a}: {len(grouped)} of {kind} to {b}"
        joined.append(replace(first, path=name, ends=(a, b)))
        members[name] = tuple(dict.fromkeys((c.path, sign) for c, sign in grouped))
    loads = tuple(replace(load, node=drawn(load.node)) for load in flat.loads)
    folded = replace(flat, nodes=shown, conductors=tuple([*alone, *joined]), loads=loads)
    return FoldedModel(folded, tuple(f"{p}." for p in outer), members, {p: tuple(n.path for n in grouped) for p, grouped in nodes.items()})
