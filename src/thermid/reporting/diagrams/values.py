"""What stands beside the lines and masses of a diagram: conductances, heat flows, capacitances and temperatures, as text."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from thermid.dual import value_of
from thermid.network.network import Network, Numbers
from thermid.network.rows import conductance
from thermid.physics.constants import ICE_POINT
from thermid.reporting.diagrams.folding import Folded

NOMINAL = (308.15, 298.15)
"""End temperatures at which a conductance is shown that depends on them, where none are given. [K]"""


def quantity(value: float, unit: str, digits: int = 3) -> str:
    """Return a number with its unit, without an exponent where a person would write none."""
    if not np.isfinite(value):
        return f"\u2013 {unit}"
    size = abs(value)
    text = f"{value:.{digits}g}" if size < 10**digits or size >= 1e6 else f"{value:.0f}"
    return f"{text} {unit}"


def conductances(plain: Folded, network: Network, numbers: Numbers, given: Mapping[str, float]) -> dict[str, str]:
    """Return conductor drawn -> its conductance as text, of a folded part the sum of its members."""
    found = _single(network, numbers, given)
    several = {drawn: [found[c] for c, _ in members if c in found] for drawn, members in plain.members.items()}
    return {
        drawn: ("" if all(sure for _, sure in own) else "≈") + quantity(sum(v for v, _ in own), "W/K") for drawn, own in several.items()
    }


def _single(network: Network, numbers: Numbers, given: Mapping[str, float]) -> dict[str, tuple[float, bool]]:
    """Return conductor -> its conductance [W/K], and whether it is sure: not where it depends on temperatures that nobody gave."""
    totals: dict[str, tuple[float, bool]] = {}
    for row in numbers.conductors:
        ends = [given.get(end, nominal) for end, nominal in zip(row.ends, NOMINAL, strict=True)]
        fixed = row.law.linear or all(end in given for end in row.ends)
        found = conductance(row.form, [value_of(c) for c in row.coefficients], row.curve, *(np.array([t]) for t in ends))
        total, sure = totals.get(row.name, (0.0, True))
        totals[row.name] = (total + float(found[0]), sure and fixed)
    return totals


def watts(plain: Folded, drawn: str, flows: Mapping[str, float]) -> str:
    """Return the heat flow of a conductor drawn, as text; empty where none of its members has one."""
    members = [(c, sign) for c, sign in plain.members[drawn] if c in flows]
    return quantity(abs(sum(sign * flows[c] for c, sign in members)), "W") if members else ""


def _capacities(plain: Folded, numbers: Numbers) -> dict[str, float]:
    """Return node drawn -> capacitance, massless ones left out. [J/K]"""
    own = {n: value_of(c) for n, c in numbers.capacitances.items() if c is not None}
    return {drawn: sum(own[n] for n in nodes if n in own) for drawn, nodes in plain.nodes.items() if any(n in own for n in nodes)}


def pooled(plain: Folded, numbers: Numbers, given: Mapping[str, float]) -> dict[str, float]:
    """Return node or boundary drawn -> temperature, of a folded part the mean by capacitance. [K]"""
    weight = {n: value_of(c) if c is not None else 0.0 for n, c in numbers.capacitances.items()}
    out = {n: t for n, t in given.items() if all(n not in nodes for nodes in plain.nodes.values())}
    for drawn, nodes in plain.nodes.items():
        known = [n for n in nodes if n in given]
        total = sum(weight[n] for n in known)
        if known:
            out[drawn] = sum(weight[n] * given[n] for n in known) / total if total > 0 else given[known[0]]
    return out


def notes(plain: Folded, numbers: Numbers, given: Mapping[str, float]) -> dict[str, str]:
    """Return node or boundary -> what stands under its name."""
    shown = {n: [quantity(c, "J/K")] for n, c in _capacities(plain, numbers).items()}
    for node, kelvin in given.items():
        shown.setdefault(node, []).append(f"{kelvin - ICE_POINT:.1f} °C")
    return {n: " · ".join(parts) for n, parts in shown.items()}
