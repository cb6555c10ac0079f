"""Temperatures and their derivatives by name, those of boundaries and eliminated nodes worked out when they are asked for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from thermid.dual import gradient_of, value_of
from thermid.memo import Memo
from thermid.model.laws.curves import evaluate, value_and_slope
from thermid.network.eliminate import held_in
from thermid.simulation.solver.wiring import Assembled, Wiring

Array = NDArray[np.float64]


def kept_for(assembled: Assembled, nodes: Sequence[str]) -> tuple[str, ...]:
    """Return the nodes that the kernel must store so that `nodes` can be had."""
    recover = dict(assembled.reduced.recover)
    wanted, out = list(nodes), {}  # type: tuple[list[str], dict[str, None]]
    while wanted:
        node = wanted.pop(0)
        if node in recover:
            wanted += recover[node]
        elif node in assembled.reduced.nodes:
            out[node] = None
    return tuple(out)


@dataclass(frozen=True, eq=False)
class Traces:
    """What the kernel stored, and what follows from it.

    Parameters
    ----------
    wiring, assembled               The run's.
    times : array (times,)          [s]
    kept : tuple of str             The nodes that the kernel stored.
    stored : array (times, kept)            [K]
    slopes : array (times, kept, free)      Derivatives with respect to the free names; empty without them. [K per unit]
    """

    wiring: Wiring
    assembled: Assembled
    times: Array
    kept: tuple[str, ...]
    stored: Array
    slopes: Array
    memo: Memo = field(init=False, default_factory=Memo, compare=False, repr=False)

    def temperature(self, name: str) -> Array:
        """Return the temperature (times,) of a node or boundary; where specific heat changes, that of the heat it holds. [K]"""
        own = held_in(name)
        if own in self.kept:
            shape = self.assembled.reduced.stored[own][1].curve
            return self.memo.made(name, lambda: evaluate(shape, self.stored[:, self.kept.index(own)]))
        if name in self.kept:
            return self.stored[:, self.kept.index(name)]
        return self.memo.made(name, lambda: self._recovered(name))

    def _recovered(self, name: str) -> Array:
        if name in self.wiring.network.boundaries:
            return self.wiring.boundary(name, self.times, self.assembled.offsets)
        weights = dict(self.assembled.reduced.recover)[name]
        return np.asarray(np.sum([value_of(w) * self.temperature(n) for n, w in weights.items()], axis=0))

    def slope(self, name: str) -> Array:
        """Return the derivatives (times, free) of the temperature of a node or boundary. [K per unit]"""
        size = self.slopes.shape[2]
        own = held_in(name)
        if own in self.kept:
            k, shape = self.kept.index(own), self.assembled.reduced.stored[own][1].curve
            return value_and_slope(shape, self.stored[:, k])[1][:, None] * self.slopes[:, k, :]
        if name in self.kept:
            return self.slopes[:, self.kept.index(name), :]
        if name in self.wiring.network.boundaries:
            return np.broadcast_to(gradient_of(self.assembled.offsets[name], size), (self.times.size, size))
        weights = dict(self.assembled.reduced.recover)[name]
        parts = [value_of(w) * self.slope(n) + np.outer(self.temperature(n), gradient_of(w, size)) for n, w in weights.items()]
        return np.asarray(np.sum(parts, axis=0))
