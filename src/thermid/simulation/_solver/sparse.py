"""A large network as flat arrays, and the kernel's integrator for it; names come later, or never."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid import _kernel
from thermid.base.units import Array, Ints, Memo
from thermid.model.tree import Constant, Curve, Drawn
from thermid.simulation._network.rows import CONTROLS, LOADS, conductor_law, curve_arrays, tables_behind
from thermid.simulation._solver.extremes import Turnings
from thermid.simulation._solver.problem import kernel_input, signal_turnings

NONE = -1


@dataclass(frozen=True, eq=False)
class Grid:
    """Links of a regular grid of cells, the last direction running fastest.

    Parameters
    ----------
    shape : array (3,)          Cells in x, y, z.
    x, y, z : array (cells,)    Conductance from every cell to the next, zero at the last. [W/K]
    """

    shape: Ints
    x: Array
    y: Array
    z: Array

    def kernel(self) -> tuple[Any, ...]:
        """Return the links in the kernel's form: shape and conductances in x, y, z."""
        return self.shape, self.x, self.y, self.z

    def pairs(self) -> tuple[Ints, Ints, Array]:
        """Return the ends and the conductance of every link, each once. [W/K]"""
        steps = (int(self.shape[1] * self.shape[2]), int(self.shape[2]), 1)
        first = [np.flatnonzero(g).astype(np.int32) for g in (self.x, self.y, self.z)]
        second = [i + np.int32(step) for i, step in zip(first, steps, strict=True)]
        values = [g[i] for g, i in zip((self.x, self.y, self.z), first, strict=True)]
        return joined(first, np.int32), joined(second, np.int32), joined(values, np.float64)


@dataclass(frozen=True, eq=False)
class Csr:
    """Links of any network, both directions of each, row by row.

    Parameters
    ----------
    indptr, indices : array     Where each node's neighbours stand, and which they are.
    values : array              [W/K]
    """

    indptr: Ints
    indices: Ints
    values: Array

    def kernel(self) -> tuple[Any, ...]:
        """Return the links in the kernel's form: index pointers, indices and conductances."""
        return self.indptr, self.indices, self.values

    def pairs(self) -> tuple[Ints, Ints, Array]:
        """Return the ends and the conductance of every link, each once. [W/K]"""
        first = np.repeat(np.arange(self.indptr.size - 1, dtype=np.int32), np.diff(self.indptr))
        once = first < self.indices
        return first[once], self.indices[once], self.values[once]


@dataclass(frozen=True, eq=False)
class RowGroup:
    """Conductors of one law that end at one boundary, or between nodes.

    Parameters
    ----------
    form : str                      linear, power, radiation or table.
    boundary : int                  Place of the boundary; -1 where `second` names a node.
    first, second : array (rows,)   Nodes.
    coefficients : array (rows,)    What scales the heat flow. [SI]
    exponent : float                Of the form power. [-]
    input : int                     Place of the input that multiplies the coefficients; -1 for none.
    curve : Curve or None           Of the form table.
    """

    form: str
    boundary: int
    first: Ints
    second: Ints
    coefficients: Array
    exponent: float = 0.0
    input: int = NONE
    curve: Curve | None = None


@dataclass(frozen=True, eq=False)
class LoadGroup:
    """Heat of one load.

    Parameters
    ----------
    form : str                      One of `thermid.simulation._network.rows.LOADS`.
    tag : int                       Place of the load's name.
    nodes : array (rows,)           Nodes that are heated.
    coefficients : array (4, rows)  In the places of the kernel. [SI]
    input : int                     Place of the input that multiplies the first; -1 for none.
    curve : Curve or None           Of the form table.
    control : str                   proportional, by the temperature of the node that is heated; empty for none.
    settings : array (3, rows)      Coefficients of the control. [SI]
    """

    form: str
    tag: int
    nodes: Ints
    coefficients: Array
    input: int = NONE
    curve: Curve | None = None
    control: str = ""
    settings: Array | None = None

    @property
    def fixed(self) -> bool:
        """Whether its power follows no temperature."""
        return self.form == "signal" and not self.control


@dataclass(frozen=True, eq=False)
class SparseNetwork:
    """A network as flat arrays.

    Parameters
    ----------
    capacities : array (nodes,)     Zero for a massless node. [J/K]
    links : Grid or Csr             Constant conductances between nodes. [W/K]
    rows : sequence of RowGroup     All other conductors.
    loads : sequence of LoadGroup
    load_names, boundaries : tuple of str
    boundary_inputs : tuple of int  Place of each boundary's input, -1 for none.
    offsets : array (boundaries,)   Constant part of each boundary's temperature. [K]
    inputs : tuple of Drawn
    stores : dict                   Node -> its temperature over its level, the temperature that a constant specific heat would show. [K]
    memo : Memo                     The kernel's form of it.
    """

    capacities: Array
    links: Grid | Csr
    rows: Sequence[RowGroup]
    loads: Sequence[LoadGroup]
    load_names: tuple[str, ...]
    boundaries: tuple[str, ...]
    boundary_inputs: tuple[int, ...]
    offsets: Array
    inputs: tuple[Drawn, ...]
    stores: Mapping[int, Curve] = field(default_factory=dict)
    memo: Memo = field(init=False, default_factory=Memo, compare=False, repr=False)

    @property
    def problem(self) -> _kernel.LargeProblem:
        """The kernel's form of it, made once."""
        return self.memo.value("problem", self._problem)

    def _problem(self) -> _kernel.LargeProblem:
        """Return the kernel's problem: groups of rows and loads one behind the other, coefficients in SI, tables by place."""
        tables: list[Any] = []

        def table(form: str, curve: Curve | None) -> int:
            """Return the place of the first table of a law, all of its tables added; `NONE` for none."""
            if curve is None:
                return NONE
            tables.extend(curve_arrays(curve_table, refuse=True) for curve_table in tables_behind(form, curve))
            return len(tables) - len(tables_behind(form, curve))

        rows, done = [], 0
        for g in self.rows:
            rows.append((conductor_law(g.form, g.curve).kind, g.boundary, g.input, table(g.form, g.curve), done, done + g.first.size))
            done += g.first.size
        loads, done = [], 0
        for h in self.loads:
            control = CONTROLS[h.control].kind if h.control else NONE
            loads.append((LOADS[h.form].kind, h.input, table(h.form, h.curve), h.tag, done, done + h.nodes.size, control))
            done += h.nodes.size
        store, places = np.full(self.capacities.size if self.stores else 0, NONE, dtype=np.int32), {}  # type: Ints, dict[int, int]
        for node, curve in self.stores.items():
            if id(curve) not in places:
                places[id(curve)] = len(tables)
                tables.append(curve_arrays(curve, refuse=True))
            store[node] = places[id(curve)]
        return _kernel.LargeProblem(
            self.capacities,
            self.links.kernel(),
            np.array(rows, dtype=np.int32).reshape(-1, 6),
            np.array([g.exponent for g in self.rows], dtype=float),
            joined([g.first for g in self.rows], np.int32),
            joined([g.second if g.boundary == NONE else np.zeros_like(g.first) for g in self.rows], np.int32),
            joined([g.coefficients for g in self.rows], np.float64),
            np.array(loads, dtype=np.int32).reshape(-1, 7),
            joined([h.nodes for h in self.loads], np.int32),
            np.hstack([np.zeros((4, 0)), *(h.coefficients for h in self.loads)]),
            np.hstack([np.zeros((3, 0)), *(np.zeros((3, h.nodes.size)) if h.settings is None else h.settings for h in self.loads)]),
            len(self.load_names),
            np.array(self.boundary_inputs, dtype=np.int32),
            self.offsets,
            tables,
            [kernel_input(s) for s in self.inputs],
            store,
        )

    def boundary(self, k: int, times: Array) -> Array:
        """Return the temperature (times,) of the k-th boundary at times (times,) [s]: its input, if any, plus its constant part. [K]"""
        place = self.boundary_inputs[k]
        varying = self.inputs[place].at(times) if place != NONE else np.zeros(times.shape)
        return np.asarray(varying + self.offsets[k], dtype=np.float64)

    def boundary_turnings(self, k: int, end: float) -> Turnings:
        """Return the turning points of the k-th boundary from zero to `end` [s]."""
        place = self.boundary_inputs[k]
        return signal_turnings(self.inputs[place] if place != NONE else Constant(0.0), end, float(self.offsets[k]))


def joined(parts: Sequence[NDArray[Any]], kind: Any) -> NDArray[Any]:
    """Return arrays put end to end; an empty one where there are none."""
    return np.concatenate([np.zeros(0, dtype=kind), *parts]).astype(kind, copy=False)


def link_arrays(first: Ints, second: Ints, conductances: Array, nodes: int) -> Csr:
    """Return links as CSR arrays, both directions of each; links between the same nodes are summed. [W/K]"""
    from scipy.sparse import coo_array

    ends = (np.concatenate((first, second)), np.concatenate((second, first)))
    table = coo_array((np.concatenate((conductances, conductances)), ends), shape=(nodes, nodes)).tocsr()
    table.sum_duplicates()
    return Csr(table.indptr.astype(np.int32), table.indices.astype(np.int32), table.data.astype(np.float64))
