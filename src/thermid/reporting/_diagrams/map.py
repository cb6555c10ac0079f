"""The network as a map: every node once, those with one neighbour in its card, boundaries as badges, heat as the width of lines."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape
from itertools import pairwise
from typing import Any, Final

import numpy as np

from thermid.base.errors import NameNotFoundError, refuse_unknown
from thermid.base.units import ICE_POINT, value_of
from thermid.model.tree import COMPLEMENT, Flat, FlatConductor, FlatNode, Model, Tree, named_control
from thermid.reporting._blocks.content import oversized
from thermid.reporting._diagrams.places import Card, MapPlaces, Point, docked, places
from thermid.reporting._pictures.chart import blend
from thermid.simulation.runs import Network, Numbers, compile_network, conductance

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
NARROW = "iljtfrI.,:;'|()[] "
"""Letters that take a third of an em in a sans-serif font."""


def width_of(text: str, size: float = 11.0) -> float:
    """Return about how wide a text is in a sans-serif font. [px]"""
    return size * sum(0.33 if c in NARROW else 0.72 if c.isupper() or c in "mwMW" else 1.0 if ord(c) > 0x2E80 else 0.58 for c in text)


def clipped(text: str, width: float, size: float = 11.0) -> str:
    """Return a text that fits in a width, with an ellipsis where it was cut."""
    if width_of(text, size) <= width:
        return text
    while text and width_of(text + "…", size) > width:
        text = text[:-1]
    return text + "…"


def tint(kelvin: float, temperatures: Mapping[str, float]) -> str:
    """Return the colour of a temperature among others: pale blue the lowest, pale orange the highest; dark text stands on all."""
    low, high = min(temperatures.values()), max(temperatures.values())
    share = (kelvin - low) / (high - low) if high > low else 0.5
    return blend(share)


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
    flows = _single(numbers, temperatures)
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


def _single(numbers: Numbers, temperatures: Mapping[str, float]) -> dict[str, tuple[float, bool]]:
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
        """Return the part that a node is drawn in, or the node itself."""
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


MIN_LETTER_SIZE: Final = 10.5
"""Letters of badges and labels. [px]"""
NAME: Final = 11.0
"""Letters of names. [px]"""
FAINT: Final = 1e-3
"""Share of the largest heat below which no number is written. [-]"""
FOOT: Final = 64.0
"""Height of title and legend. [px]"""
BROAD: Final = 1.12
"""How much wider a text may be in the reader's font than is estimated; a bold one once more. [-]"""
BADGES: Final = 3
"""Badges of a node that are drawn; more are counted."""
THICK: Final = 7.0
"""Width of the line that carries most heat. [px]"""
ARROW: Final = 9.0
"""Length of an arrow's head, without what the width of its line adds. [px]"""
DASHES: Final = {"solid": "", "dashed": "7 4", "dotted": ".1 5", "flow": "", "mixed": "8 3 2 3"}
CSS: Final = """
.thermid-map{--m-ink:#1c2430;--m-soft:#53606f;--m-paper:#fff;--m-card:#eef2f6;--m-edge:#4a6f96;--m-node:#dbe7f3;--m-wire:#5a6675;
--m-badge:#fff;--m-load:#a83f00;font-family:system-ui,-apple-system,"Segoe UI",Roboto,"Liberation Sans",sans-serif}
@media (prefers-color-scheme:dark){.thermid-map{--m-ink:#e6eaf0;--m-soft:#a3afbd;--m-paper:#14181e;--m-card:#1e252e;--m-edge:#7ea6cf;
--m-node:#27405a;--m-wire:#9aa7b5;--m-badge:#14181e;--m-load:#f08a4b}}
@media print{.thermid-map{--m-ink:#1c2430;--m-soft:#53606f;--m-paper:#fff;--m-card:#eef2f6;--m-edge:#4a6f96;--m-node:#dbe7f3;
--m-wire:#5a6675;--m-badge:#fff;--m-load:#a83f00}}
.thermid-map text{fill:var(--m-ink)}.thermid-map .paper{fill:var(--m-paper)}
.thermid-map .card{fill:var(--m-card);stroke:var(--m-edge);stroke-width:1.2}.thermid-map .hub{stroke-width:2.4}
.thermid-map .node{fill:var(--m-node)}.thermid-map .massless{fill:none;stroke:var(--m-edge);stroke-dasharray:2 2}
.thermid-map .name{font-weight:600}.thermid-map .m-soft{fill:var(--m-soft)}.thermid-map .load{fill:var(--m-load)}
.thermid-map .dark text,.thermid-map text.dark{fill:#1c2430}.thermid-map text.load.dark{fill:#8a3400}
.thermid-map .wire{fill:none;stroke:var(--m-wire);stroke-width:1.4;stroke-linejoin:round}.thermid-map .head{fill:var(--m-wire)}
.thermid-map .dotted{stroke-linecap:round;stroke-width:2.4}
.thermid-map .badge{fill:var(--m-badge);stroke:var(--m-edge)}
"""


def _room(text: str, size: float, bold: bool = False) -> float:
    """Return the width that a text may take. [px]"""
    return width_of(text, size) * BROAD * (BROAD if bold else 1.0) + (0.3 * size if text[:1] in "+←→" else 0.0)


@dataclass(frozen=True)
class _Badge:
    """What a node is joined to that has no line: a boundary or a hub, with the heat that goes there [W], and the conductors."""

    name: str
    heat: float | None
    tip: str
    faint: bool = False

    @property
    def text(self) -> str:
        """What is written: the heat with an arrow as it flows."""
        heat = "" if self.heat is None else " ≈ 0 W" if self.faint else f" {quantity(abs(self.heat), 'W', 2)}"
        return f"{'←' if self.heat is not None and self.heat < 0 else '→'} {self.name}{heat}"

    @property
    def width(self) -> float:
        """Width of the box around the text. [px]"""
        return _room(self.text, MIN_LETTER_SIZE) + 12.0


@dataclass(frozen=True)
class _Item:
    """What a node's row says."""

    name: str
    power: str
    loads: str
    kelvin: float | None
    badges: tuple[_Badge, ...]
    more: int
    massless: bool
    part: bool

    @property
    def celsius(self) -> str:
        """Its temperature as text."""
        return "" if self.kelvin is None else f"{self.kelvin - ICE_POINT:.1f} °C"

    @property
    def width(self) -> float:
        """What its row needs. [px]"""
        texts = [_room(self.name, NAME, bold=True), *(_room(t, NAME) + 8.0 for t in (self.power, self.celsius) if t)]
        return 14.0 + sum(texts) + sum(b.width + 5.0 for b in self.badges) + (28.0 if self.more else 0.0)


@dataclass(frozen=True, eq=False)
class _Drawing:
    """Everything of a map but its places."""

    plain: FoldedModel
    items: Mapping[str, _Item]
    joined: Mapping[tuple[str, str], tuple[FlatConductor, ...]]
    heat: Mapping[tuple[str, str], float]
    values: Mapping[str, str]
    flows: Mapping[str, float]
    kelvins: Mapping[str, float]
    marked: bool

    @property
    def tinted(self) -> dict[str, float]:
        """Node -> temperature. [K]"""
        return {n: i.kelvin for n, i in self.items.items() if i.kelvin is not None}

    def tip(self, conductors: Sequence[FlatConductor]) -> str:
        """Return conductors with kind, conductance and heat, in words."""
        texts = (
            f"{c.path} ({c.kind})" + "".join(f": {t}" for t in (self.values.get(c.path, ""),) if t) + self._watts(c) for c in conductors
        )
        return "; ".join(texts)

    def _watts(self, c: FlatConductor) -> str:
        """Return the power of a load or the heat of a conductor as the map shows it. [W]"""
        text = watts(self.plain, c.path, self.flows)
        return f", {text}" if text else ""

    def mark(self, key: str, path: str) -> str:
        """Return what an element carries for a page that answers to clicks."""
        return f' data-{key}="{escape(path)}"' if self.marked and path else ""


def network_map(
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
    """Return the map of a model as SVG; the same model gives the same picture.

    Parameters
    ----------
    model : Model           What to draw.
    temperatures : dict     Node or boundary -> temperature; nodes are tinted by it, from blue (coldest) to orange (warmest). [K]
    flows : dict            Conductor -> heat flow from its first end to its second; lines are as wide as it is large, with an arrow. [W]
    powers : dict           Load -> power in place of the deck's. [W]
    logged : collection     Loads whose power a log gives: the deck's is not shown for them.
    folded : sequence       Paths of submodels that are drawn as one node each.
    title : str             What a screen reader says; the model's title by default.
    marked : bool           Whether elements carry their paths (``data-path``, ``data-part``), for a page that answers to clicks.

    Raises
    ------
    ThermidError   When the model does not compile, or a temperature is given for what is no node.
    """
    network = compile_network(model)
    kelvins = {network.find(name): float(value) for name, value in (temperatures or {}).items()}
    numbers, plain = network.numbers(), fold(network.flat, folded)
    joined: dict[tuple[str, str], list[FlatConductor]] = {}
    for c in plain.flat.conductors:
        if c.ends[0] != c.ends[1]:
            joined.setdefault((min(c.ends), max(c.ends)), []).append(c)
    heat = {pair: sum(_heat(plain, c, pair[0], flows) for c in members) for pair, members in joined.items()} if flows else {}
    shown = _Drawing(
        plain,
        {},
        {pair: tuple(members) for pair, members in joined.items()},
        heat,
        conductances(plain, network, numbers, kelvins),
        flows or {},
        pooled(plain, numbers, kelvins),
        marked,
    )
    nodes = [n.path for n in plain.flat.nodes]
    inner = set(nodes)
    pairs = [pair for pair in joined if inner >= set(pair)]
    badges = _badges(shown, inner, *docked(nodes, pairs))
    items = {n: _item(shown, n, badges, numbers, powers, logged) for n in nodes}
    plan = places(nodes, pairs, {n: i.width for n, i in items.items()}, FOOT)
    drawing = _Drawing(plain, items, shown.joined, heat, shown.values, shown.flows, shown.kelvins, marked)
    return _svg(drawing, plan, title if title is not None else model.title, model.title)


def fitting_map(model: Model, size: tuple[float, float], **state: Any) -> str:
    """Return the map of a model as it is inside a page, no larger than a size: its innermost parts are folded, and those around them.

    Parameters
    ----------
    model : Model           What to draw.
    size : (width, height)  A map whose outermost parts are folded may be larger all the same. [px]
    state                   As in `network_map`.
    """
    parts = parts_of(model)
    svg = ""
    for level in range(max((p.count(".") + 1 for p in parts), default=0), -1, -1):
        svg = network_map(model, folded=[p for p in parts if p.count(".") == level], **state)
        if not oversized(svg, size):
            break
    return svg.replace(' xmlns="http://www.w3.org/2000/svg"', "", 1)  # which a page does not need


def _svg(drawing: _Drawing, plan: MapPlaces, label: str, title: str) -> str:
    """Return the picture of a map at its places."""
    size = f'viewBox="0 0 {plan.width:g} {plan.height:g}" width="{plan.width:g}" height="{plan.height:g}"'
    parts = [f'<svg class="thermid-map" xmlns="http://www.w3.org/2000/svg" role="img" {size}><title>{escape(label)}</title>']
    parts += [f'<style>{CSS}</style><rect class="paper" width="100%" height="100%"/>']
    parts += _lines(drawing, plan)
    parts += [piece for card in plan.cards for piece in _card(drawing, card, plan)]
    parts += _labels(drawing, plan)
    parts += _legend(drawing, plan, title)
    return "\n".join([*parts, "</svg>"])


def _heat(plain: FoldedModel, c: FlatConductor, first: str, flows: Mapping[str, float] | None) -> float:
    """Return the heat through a conductor drawn, away from one of its ends. [W]"""
    total = sum(sign * (flows or {}).get(member, 0.0) for member, sign in plain.members[c.path])
    return total if c.ends[0] == first else -total


def _item(
    shown: _Drawing,
    node: str,
    badges: Mapping[str, Sequence[_Badge]],
    numbers: Numbers,
    powers: Mapping[str, float] | None,
    logged: Collection[str],
) -> _Item:
    """Return what is said of a node."""
    loads = [x for x in shown.plain.flat.loads if x.node == node]
    load_powers = {x.path: powers.get(x.path) if powers is not None else _watts(numbers, x) for x in loads if x.path not in logged}
    watts_ = [v for v in load_powers.values() if v is not None]
    power = f"{'+' * (sum(watts_) >= 0.0)}{quantity(sum(watts_), 'W')}" if watts_ and (sum(watts_) or powers is not None) else ""
    power = "as logged" if loads and not load_powers else power
    texts = {path: "" if v is None else quantity(v, "W") for path, v in load_powers.items()}
    tip = "; ".join(f"{x.path} into {node}: {texts.get(x.path, 'as logged')}{times(x.controls)}" for x in loads)
    mine = tuple(badges.get(node, ()))
    fields = next(n.fields for n in shown.plain.flat.nodes if n.path == node)
    part = f"{node}." in shown.plain.parts
    return _Item(node, power, tip, shown.kelvins.get(node), mine[:BADGES], max(len(mine) - BADGES, 0), not fields, part)


def _watts(numbers: Numbers, load: object) -> float:
    """Return the power of a load or the heat of a conductor as the map shows it. [W]"""
    fields: Mapping[str, str] = getattr(load, "fields", {})
    return float(value_of(numbers.values[fields["power"]])) if "power" in fields else 0.0


def _badges(shown: _Drawing, inner: Collection[str], docks: Mapping[str, str], hubs: Collection[str]) -> dict[str, list[_Badge]]:
    """Return node -> what it is joined to that has no line."""
    out: dict[str, list[_Badge]] = {}
    most = max(map(abs, shown.heat.values()), default=0.0)
    for (a, b), members in shown.joined.items():
        for node, other, sign in ((a, b, 1.0), (b, a, -1.0)):
            hub = other in hubs and node not in hubs and docks.get(node) != other
            if node in inner and (other not in inner or hub or (other in hubs and node in hubs and node < other)):
                heat = sign * shown.heat[a, b] if shown.heat else None
                out.setdefault(node, []).append(_Badge(other, heat, shown.tip(members), heat is not None and abs(heat) < FAINT * most))
    return out


def _style(conductors: Sequence[FlatConductor]) -> str:
    """Return the style of a line by the kind of its first conductor: name and dash pattern."""
    return STYLES.get(conductors[0].kind, ("solid", ""))[0]


def _max_heat(drawing: _Drawing, plan: MapPlaces) -> float:
    """Return the most heat that a line carries. [W]"""
    return max((abs(drawing.heat[pair]) for pair in _drawn(drawing, plan) if pair in drawing.heat), default=0.0)


def _drawn(drawing: _Drawing, plan: MapPlaces) -> list[tuple[str, str]]:
    """Return the pairs of nodes that a line joins, between cards or within one."""
    return [p for p in drawing.joined if p in plan.lines or plan.docks.get(p[0]) == p[1] or plan.docks.get(p[1]) == p[0]]


def _stroke_style(drawing: _Drawing, pair: tuple[str, str], most: float) -> str:
    """Return the attribute of a line's width, in proportion to its heat; empty where no heat is known."""
    return f' style="stroke-width:{1.0 + (THICK - 1.0) * abs(drawing.heat[pair]) / most:.1f}"' if drawing.heat and most > 0.0 else ""


def _lines(drawing: _Drawing, plan: MapPlaces) -> Iterator[str]:
    """Yield a line for every two nodes of different cards that are joined, with the conductors in its tip, and where its heat goes."""
    most = _max_heat(drawing, plan)
    for pair, points in plan.lines.items():
        members = drawing.joined[pair]
        style = _style(members)
        dash = f' stroke-dasharray="{DASHES[style]}"' if DASHES[style] else ""
        mark = drawing.mark("path", members[0].path)
        tip = f"<title>{escape(drawing.tip(members))}</title>"
        yield f'<path class="wire {style}" d="{_way(points)}"{dash}{_stroke_style(drawing, pair, most)}{mark}>{tip}</path>'
        if drawing.heat and abs(drawing.heat[pair]) > FAINT * most:
            # the head of an arrow at the end of the line that heat flows to
            ends = points[-2:] if drawing.heat[pair] >= 0.0 else points[1::-1]
            before, end = (np.array(p) for p in ends)
            along = (end - before) / max(float(np.hypot(*(end - before))), 1e-9)
            across, size = np.array([-along[1], along[0]]), ARROW + THICK * abs(drawing.heat[pair]) / most
            corners = [end, end - size * along + 0.6 * size * across, end - size * along - 0.6 * size * across]
            yield f'<path class="head" d="M{"L".join(f"{p[0]:.1f} {p[1]:.1f}" for p in corners)}z"/>'


def _way(points: Sequence[Point]) -> str:
    """Return a line through points with rounded corners, as SVG writes it."""
    out = [f"M{points[0][0]:.1f} {points[0][1]:.1f}"]
    for before, here, after in zip(points, points[1:], points[2:], strict=False):
        a, p, b = np.array(before), np.array(here), np.array(after)
        ways = [(q - p) / max(float(np.hypot(*(q - p))), 1e-9) * min(8.0, 0.5 * float(np.hypot(*(q - p)))) for q in (a, b)]
        (x1, y1), (x2, y2) = p + ways[0], p + ways[1]
        out.append(f"L{x1:.1f} {y1:.1f}Q{p[0]:.1f} {p[1]:.1f} {x2:.1f} {y2:.1f}")
    return "".join([*out, f"L{points[-1][0]:.1f} {points[-1][1]:.1f}"])


def _card(drawing: _Drawing, card: Card, plan: MapPlaces) -> Iterator[str]:
    """Yield a card: its node, and those docked in it, with loads, temperatures and badges."""
    hub = " hub" if plan.hubs & set(card.nodes) else ""
    yield f'<rect class="card{hub}" x="{card.x:g}" y="{card.y:g}" width="{card.width:g}" height="{card.height:g}" rx="6"/>'
    most = _max_heat(drawing, plan)
    for node, deep in card.rows:
        item, y = drawing.items[node], card.row(node)
        x_left = card.x + 6.0 + 14.0 * deep
        if deep:
            pair = (min(node, plan.docks[node]), max(node, plan.docks[node]))
            tip = f"<title>{escape(drawing.tip(drawing.joined[pair]))}</title>"
            way = f"M{x_left - 8:.1f} {card.row(plan.docks[node]) + 7:.1f}V{y:.1f}H{x_left:.1f}"
            path = drawing.mark("path", drawing.joined[pair][0].path)
            yield f'<path class="wire {_style(drawing.joined[pair])}" d="{way}"{_stroke_style(drawing, pair, most)}{path}>{tip}</path>'
        tinted = "" if item.kelvin is None else f' style="fill:{tint(item.kelvin, drawing.tinted)}"'
        dark = "" if item.kelvin is None else " dark"
        key = drawing.mark("part" if item.part else "path", node)
        size = f'x="{x_left:.1f}" y="{y - 8.5:.1f}" width="{card.x + card.width - 6 - x_left:.1f}" height="17" rx="3"'
        kind = "node massless" if item.massless and not tinted else "node"
        yield f'<rect class="{kind}" {size}{tinted}{key}><title>{escape(node)}</title></rect>'
        yield from _row(item, x_left + 6.0, y, dark, key, bold=not deep)


def _row(item: _Item, x: float, y: float, dark: str, key: str, bold: bool) -> Iterator[str]:
    """Yield the texts and badges of a node, one beside the other."""
    yield _text(x, y + 4.0, item.name, NAME, f"{'name' if bold else ''}{dark}", item.name, key)
    x += _room(item.name, NAME, bold) + 8.0
    for words, kind, tip in ((item.power, "load", item.loads), (item.celsius, "", "")):
        if words:
            yield _text(x, y + 4.0, words, NAME, kind + dark, tip)
            x += _room(words, NAME) + 8.0
    for badge in item.badges:
        yield f'<rect class="badge" x="{x:.1f}" y="{y - 7:.1f}" width="{badge.width:.1f}" height="14" rx="7"/>'
        yield _text(x + 5.0, y + 3.5, badge.text, MIN_LETTER_SIZE, "", badge.tip)
        x += badge.width + 5.0
    if item.more:
        yield _text(x, y + 3.5, f"+{item.more}", MIN_LETTER_SIZE, f"m-soft{dark}")


def _labels(drawing: _Drawing, plan: MapPlaces) -> Iterator[str]:
    """Yield the heat of lines, the largest first, or without heat their conductance, where it lies on no card, arrow or other label."""
    taken = [(c.x, c.y, c.x + c.width, c.y + c.height) for c in plan.cards]
    most = _max_heat(drawing, plan)
    ways = [np.concatenate([np.linspace(p, q, 33) for p, q in pairwise(points)]) for points in plan.lines.values()]
    dots, owners = np.concatenate([np.zeros((0, 2)), *ways]), np.repeat(np.arange(len(ways)), [len(w) for w in ways])
    place_of_pair = {pair: k for k, pair in enumerate(plan.lines)}
    for pair in sorted(plan.lines, key=lambda p: -abs(drawing.heat.get(p, 0.0))):
        points, heat = plan.lines[pair], drawing.heat.get(pair)
        if heat is None:
            texts = [t for c in drawing.joined[pair] if (t := drawing.values.get(c.path, ""))]
            words = " + ".join([t for t in texts if not t.startswith(("0 ", "≈0 "))] or texts[:1])
        elif abs(heat) > FAINT * most:
            words = quantity(abs(heat), "W", 2)
            x, y = points[-1 if heat >= 0.0 else 0]
            reach = 0.5 * (ARROW + THICK * abs(heat) / most)
            taken.append((x - reach, y - reach, x + reach, y + reach))
        else:
            continue
        wide = _room(words, MIN_LETTER_SIZE) + 14.0  # a line that ends at the figure would read as its minus
        spots = list(_along(points, wide))
        reach_of_line = np.ptp(spots, axis=0) + np.array([wide, 16.0])
        close_by = (np.abs(dots - np.mean(spots, axis=0)) <= reach_of_line).all(axis=1) & (owners != place_of_pair[pair])
        under = (np.abs(np.array(spots)[:, None] - dots[close_by]) < (0.5 * wide, 8.0)).all(axis=2).sum(axis=1)
        for x, y in (spots[k] for k in np.argsort(under, kind="stable")):  # where least of other lines lies under it
            box = (x - 0.5 * wide, y - 8.0, x + 0.5 * wide, y + 7.0)
            inside = box[0] >= 0.0 and box[2] <= plan.width and box[1] >= 0.0
            if words and inside and all(box[2] <= t[0] or t[2] <= box[0] or box[3] <= t[1] or t[3] <= box[1] for t in taken):
                taken.append(box)
                place = f'x="{x:.1f}" y="{y + 3.5:.1f}" text-anchor="middle" font-size="{MIN_LETTER_SIZE:g}"'
                size = f'x="{box[0] + 1.0:.1f}" y="{box[1] + 1.0:.1f}" width="{wide - 2.0:.1f}" height="13" rx="3"'
                yield f'<rect class="paper" {size}/><text {place} class="label">{escape(words)}</text>'
                break


def _along(points: Sequence[Point], wide: float) -> Iterator[Point]:
    """Yield places for a label [px] along a line, from its middle outwards, then beside the middle of a line that is too short."""
    fine = np.concatenate([np.linspace(p, q, 17) for p, q in pairwise(points)])
    middle = len(fine) // 2
    for k in sorted(range(len(fine)), key=lambda k: abs(k - middle)):
        yield float(fine[k, 0]), float(fine[k, 1])
    (x, y), (dx, dy) = fine[middle], np.abs(fine[middle] - fine[middle - 1])
    for steps in (-1.0, 1.0, -2.0, 2.0):  # a short line lies between cards that are higher than a label
        yield (float(x), float(y) + steps * (THICK + ARROW)) if dx >= dy else (float(x) + steps * 0.5 * (THICK + wide), float(y))


def _text(x: float, y: float, words: str, size: float, kind: str = "", tip: str = "", key: str = "") -> str:
    """Return a text of SVG at (x, y), with a tip where one is given. [px]"""
    hint = f"<title>{escape(tip)}</title>" if tip else ""
    return f'<text x="{x:.1f}" y="{y:.1f}" font-size="{size:g}" class="{kind.strip()}"{key}>{escape(words)}{hint}</text>'


def _legend(drawing: _Drawing, plan: MapPlaces, title: str) -> Iterator[str]:
    """Yield title and counts, the styles of the lines that are drawn, and the scales of temperature and heat with both ends."""
    flat, y = drawing.plain.flat, plan.height - FOOT
    boundaries = ", ".join(flat.names.boundaries) or "none"
    many = f"; named on what they join: {', '.join(sorted(plan.hubs))}" if plan.hubs else ""
    heading = f"{title}. Nodes: {len(flat.nodes)}; heat paths: {len(flat.conductors)}; given temperatures: {boundaries}{many}"
    yield _text(14.0, y + 16.0, clipped(heading, plan.width - 28.0, 1.15 * NAME), NAME, "name", heading)
    x = 14.0
    kinds = (c.kind for pair in _drawn(drawing, plan) for c in drawing.joined[pair][:1])
    for style, word in dict.fromkeys(STYLES.get(kind, ("solid", kind)) for kind in kinds):
        dash = f' stroke-dasharray="{DASHES[style]}"' if DASHES[style] else ""
        if x + 52.0 + width_of(word, NAME) > plan.width:
            break
        yield f'<path class="wire {style}" d="M{x:.1f} {y + 32:.1f}h26"{dash}/>'
        yield _text(x + 32.0, y + 36.0, word, NAME, "m-soft")
        x += 50.0 + width_of(word, NAME)
    x, y = 14.0, y + 55.0
    temperatures = drawing.tinted.values()
    if temperatures:
        low, high = min(temperatures), max(temperatures)
        ends = [f"{t - ICE_POINT:.1f} °C" for t in (low, high)]
        yield _text(x, y, ends[0], NAME, "m-soft")
        x += width_of(ends[0], NAME) + 8.0
        for k in range(24):
            colour = tint(low + (high - low) * k / 23, {"low": low, "high": high})
            yield f'<rect x="{x + 4 * k:.1f}" y="{y - 9:.1f}" width="5" height="11" style="fill:{colour}"/>'
        yield _text(x + 104.0, y, ends[1], NAME, "m-soft")
        x += 124.0 + width_of(ends[1], NAME)
    most = _max_heat(drawing, plan)
    if most > 0.0:
        yield f'<path class="wire" d="M{x:.1f} {y - 4:.1f}h26" style="stroke-width:1"/>' + _text(x + 32.0, y, "0 W", NAME, "m-soft")
        yield f'<path class="wire" d="M{x + 70:.1f} {y - 4:.1f}h26" style="stroke-width:{THICK}"/>'
        yield _text(x + 104.0, y, quantity(most, "W", 2), NAME, "m-soft")
