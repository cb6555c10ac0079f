"""Two versions of a model in one scenario: what changed, in kelvin at the sensors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from thermid.base.arguments import takes_objects
from thermid.base.errors import NameNotFoundError, refuse_unknown
from thermid.base.results import Result
from thermid.campaign._judge.metrics import Residuals, rmse
from thermid.model.tree import Model
from thermid.simulation.runs import Scenario, simulate


@dataclass(frozen=True)
class Apart:
    """New less old at one node: largest by size with its time, root mean square, and at the end. [K], [s]"""

    largest: float
    at: float
    rms: float
    final: float


@dataclass(frozen=True)
class Difference(Result):
    """The difference of two versions of a model.

    Parameters
    ----------
    old, new : str      Hashes of the versions.
    scenario : str      Its title.
    nodes : dict        Node -> Apart.
    gone, added : tuple Nodes that only one of them has.
    """

    old: str
    new: str
    scenario: str
    nodes: Mapping[str, Apart]
    gone: tuple[str, ...] = ()
    added: tuple[str, ...] = ()

    @property
    def largest(self) -> float:
        """The largest difference anywhere, by size. [K]"""
        return max((abs(a.largest) for a in self.nodes.values()), default=0.0)

    def __str__(self) -> str:
        """Return it as text, a line a node."""
        lines = [f"{self.scenario}: model {self.old} -> {self.new}, largest difference {self.largest:.3g} K"]
        lines += [
            f"  {n}: {a.largest:+.3f} K at {a.at:.4g} s, RMS {a.rms:.3f} K, {a.final:+.3f} K at the end" for n, a in self.nodes.items()
        ]
        lines += [f"  {n}: only in the {which} version" for which, names in (("old", self.gone), ("new", self.added)) for n in names]
        return "\n".join(lines)


@takes_objects
def difference(old: Model, new: Model, scenario: Scenario, *, nodes: Sequence[str] = ()) -> Difference:
    """Return the difference of two versions of a model in one scenario, new less old.

    Parameters
    ----------
    old, new : Model        The versions.
    scenario : Scenario     What both are put through.
    nodes : sequence        The nodes to compare, such as those under sensors; all that both have by default.

    Raises
    ------
    NameNotFoundError   When one of the versions lacks a node that is asked for.
    """
    before = simulate(old, scenario)
    after = simulate(new, scenario, times=before.times)
    both = [n for n in before.nodes if n in after.nodes]
    names = [old.canonical(n) for n in nodes] or both
    refuse_unknown(names, both, new.title, "no node '{}' in both versions.", NameNotFoundError)
    apart_by_node = {}
    for n in names:
        apart = after[n].kelvin - before[n].kelvin
        k = int(np.abs(apart).argmax())
        apart_by_node[n] = Apart(
            float(apart[k]), float(before.times[k]), rmse(Residuals.equally_weighted(before.times, apart)), float(apart[-1])
        )
    gone, added = (tuple(n for n in a.nodes if n not in b.nodes) for a, b in ((before, after), (after, before)))
    return Difference(old.identity(), new.identity(), scenario.title, apart_by_node, gone, added)
