"""What the map of a network is drawn of: styles, colours and widths of texts, conductances in words, parts folded to one node."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from thermid.base.dual import value_of
from thermid.base.errors import NameNotFoundError, refuse_unknown
from thermid.model.elements import COMPLEMENT, named_control
from thermid.model.tree import Flat, FlatConductor, FlatNode, Tree
from thermid.simulation.network import Network, Numbers, conductance

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
    cold, mild, warm = (191, 219, 242), (244, 240, 226), (250, 188, 128)
    a, b, part = (cold, mild, 2 * share) if share < 0.5 else (mild, warm, 2 * share - 1)
    return "#" + "".join(f"{round(p + part * (q - p)):02x}" for p, q in zip(a, b, strict=True))


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
