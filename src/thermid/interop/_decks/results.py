"""Temperatures that SINDA or ESATAN printed, and what is left of each node's balance at them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from thermid.base.errors import DeckError
from thermid.base.units import counted
from thermid.interop._decks.network_file import NetworkFile
from thermid.interop._decks.statements import DeckReading
from thermid.model.tree import ParameterSet
from thermid.physics.constants import ICE_POINT, STEFAN_BOLTZMANN

_SUBMODEL = re.compile(r"\s*SUBMODEL NAME = (\w+)")
_PRINT = re.compile(r"\bT\s+(\d+)=\s*([-+.\dE]+)")


@dataclass(frozen=True, eq=False)
class Balance:
    """What is left of each node's balance at printed temperatures: heat in less heat out. [W]

    Parameters
    ----------
    left : dict        Node -> watts that the network lacks at this node; of one in balance about 0.
    rounding : dict    Node -> what half the last digit of the print makes of it. [W]
    """

    left: Mapping[str, float]
    rounding: Mapping[str, float]

    def open(self) -> dict[str, float]:
        """Return the nodes whose balance does not close within the rounding of the print, the largest first."""
        missed = {node: watts for node, watts in self.left.items() if abs(watts) > 2.0 * self.rounding[node]}
        return dict(sorted(missed.items(), key=lambda each: -abs(each[1])))

    def __str__(self) -> str:
        """Return how many nodes close, then those that do not."""
        missed = self.open()
        if not missed:
            return (
                f"at the printed temperatures the balance of all {counted(len(self.left), 'node')} closes within the rounding of the print"
            )
        nodes = f"{len(missed)} of {counted(len(self.left), 'node')}"
        head = f"NOT CLOSED: at the printed temperatures {nodes} miss {sum(missed.values()):.4g} W in all"
        return "\n".join([head, *(f"  {node}: {watts:+.4g} W" for node, watts in missed.items())])


def sinda_print(path: str | Path) -> list[dict[str, float]]:
    """Return the temperatures of each print of a SINDA output, in the file's own unit: node path -> number.

    Raises
    ------
    DeckError   When the file prints no temperatures.
    """
    prints: list[dict[str, float]] = []
    submodel = ""
    for row in DeckReading().open(Path(path)).split("\n"):
        if found := _SUBMODEL.match(row):
            submodel = found[1]
        for number, word in _PRINT.findall(row) if submodel else ():
            key = f"{submodel}.T{int(number)}"
            if not prints or key in prints[-1]:
                prints.append({})
            prints[-1][key] = float(word)
    if not prints:
        raise DeckError("the file has no printed temperatures (T 1= ... under SUBMODEL NAME).", str(path))
    return prints


def balance(network: NetworkFile, celsius: Mapping[str, float], digit: float = 0.01) -> Balance:
    """Return what is left of each node's balance at given temperatures, for conduction, radiation and constant loads.

    Parameters
    ----------
    celsius : dict   `SUBMODEL.Tn` of every node, boundaries too -> temperature. [degC]
    digit : float    Last digit of the print. [K]
    """
    values = ParameterSet(network.model()).evaluate({})
    names = [f"{node.submodel}.{node.name}" for node in network.nodes]
    missing = [name for name in names if name not in celsius]
    if missing:
        raise DeckError(f"no temperature of {', '.join(missing[:5])}{' ...' if len(missing) > 5 else ''}.", "balance")
    at = {name: k for k, name in enumerate(names)}
    t = np.array([celsius[name] for name in names]) + ICE_POINT
    left, slope = np.zeros(t.size), np.zeros(t.size)
    for each in network.conductors:
        a, b = (at[".".join(end)] for end in each.ends)
        if each.table["kind"] == "conduction":
            g = float(values[f"{each.name}.conductance"])
            heat, steep = g * (t[a] - t[b]), (g, g)
        elif each.table["kind"] == "radiation":
            g = float(values[f"{each.name}.area"]) * float(each.table["exchange_factor"]) * STEFAN_BOLTZMANN
            heat, steep = g * (t[a] ** 4 - t[b] ** 4), (4.0 * g * t[a] ** 3, 4.0 * g * t[b] ** 3)
        elif each.table["kind"] == "flow":
            g = float(values[f"{each.name}.mass_flow"])
            left[b] += g * (t[a] - t[b])
            slope[b] += 2.0 * g
            continue
        else:
            continue
        left[a] -= heat
        left[b] += heat
        for k in (a, b):  # both ends were rounded
            slope[k] += sum(steep)
    for load in network.loads:
        if not load.more:
            left[at[".".join(load.into)]] += float(values[f"{load.name}.power"])
    inner = [k for k, node in enumerate(network.nodes) if not node.held]
    return Balance({names[k]: -float(left[k]) for k in inner}, {names[k]: 0.5 * digit * float(slope[k]) for k in inner})
