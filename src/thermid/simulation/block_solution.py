"""`BlockSolution`: what was watched of a block, its fields, its heat balance."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from thermid.errors import NameNotFoundError, SolverError, nearest
from thermid.memo import Memo
from thermid.model.blocks.block import Block
from thermid.model.laws.signal import Constant, multiplied
from thermid.simulation.scenarios.scenario import Scenario
from thermid.simulation.solution import HeatBalance, Solution, Trace
from thermid.simulation.solver.engine import Options
from thermid.simulation.solver.extremes import Turnings
from thermid.simulation.solver.kernel_form import break_times
from thermid.simulation.solver.large import LargeAnswer, Watched, integrate
from thermid.simulation.solver.sparse import SparseNetwork

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class BlockSolution(Solution):
    """What came out of a block. `nodes` are what was watched, then the boundaries.

    Parameters
    ----------
    block : Block
    field_times : array (fields,)           Times at which all temperatures were stored. [s]
    fields : array (fields, nx, ny, nz)     [K]
    final_field : array (nx, ny, nz)        At the end. [K]
    """

    block: Block = field(repr=False, kw_only=True)
    field_times: Array = field(repr=False, kw_only=True)
    fields: Array = field(repr=False, kw_only=True)
    final_field: Array = field(repr=False, kw_only=True)
    _watched: Array = field(repr=False, kw_only=True)
    _network: SparseNetwork = field(repr=False, kw_only=True)
    _scenario: Scenario = field(repr=False, kw_only=True)
    _answer: LargeAnswer | None = field(repr=False, kw_only=True)
    _again: Again | None = field(default=None, repr=False, kw_only=True)

    def __getitem__(self, name: str) -> Trace:
        """Return the trace of what was watched, or of a boundary."""
        if name not in self.nodes:
            raise NameNotFoundError(f"'{name}' was not watched.{nearest(name, self.nodes)} Name it in 'watch' of the run.", self.title)
        k = self.nodes.index(name)
        return Trace(name, self.times, self.temperatures[:, k], self._turnings(k), BlockDense(self, k) if self._again else None)

    def _turnings(self, column: int) -> Turnings | None:
        """Return the turning points of what was watched, or of a boundary; None where the run did not follow it."""
        watched = self._watched.shape[1]
        if self._answer is None or column >= watched:
            return None if self._answer is None else self._network.boundary_turnings(column - watched, float(self._scenario.seconds))
        return self._answer.turnings[column] if self._answer.turnings is not None else None

    def refined(self, nodes: Iterable[str] = (), most: int | None = None) -> Solution:
        """Return the run as it is: what was watched is known at the stored times and at its own turning points."""
        return self

    @cached_property
    def temperatures(self) -> Array:
        """Temperatures (times, nodes) of what was watched and of the boundaries. [K]"""
        outer = [self._network.boundary(k, self.times) for k in range(len(self._network.boundaries))]
        return np.column_stack([self._watched, *outer])

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """What a reader must know."""
        return self._remarks

    def field(self, time: float) -> Array:
        """Return all temperatures (nx, ny, nz) at a time for which they were stored. [K]

        Raises
        ------
        NameNotFoundError   When they were not stored for that time.
        """
        close = np.flatnonzero(np.isclose(self.field_times, time, rtol=1e-12, atol=1e-9))
        if not close.size:
            raise NameNotFoundError(f"no field was stored at {time:g} s. Name the time in 'fields' of the run.", self.title)
        return np.asarray(self.fields[close[0]])

    @property
    def load_powers(self) -> Mapping[str, Array]:
        """Heater -> power (times,). [W]"""
        out = {}
        for name, heater in self.block.heaters.items():
            given, command = self._scenario.loads.get(name, heater.power), self._scenario.commands.get(name, Constant(1.0))
            signal = multiplied(given, command)
            out[name] = np.full(self.times.shape, signal.value) if isinstance(signal, Constant) else signal.at(self.times)
        return out

    def heat_balance(self) -> HeatBalance:
        """Return where the heat of the run went, by the integrator's own weights.

        Raises
        ------
        SolverError   For a steady state, which stores no heat.
        """
        if self._answer is None:
            raise SolverError("a steady state has no heat balance over time.", self.title)
        a, capacities = self._answer, self._network.capacities
        loads, boundaries, moved = float(a.load_energy.sum()), float(a.boundary_energy.sum()), a.final - a.initial
        stored = float(capacities @ moved)
        gross = max(float(np.abs(part).sum()) for part in (a.load_energy, a.boundary_energy, capacities * moved))
        residual = loads - boundaries - stored
        return HeatBalance(loads, boundaries, stored, residual, abs(residual) / max(gross, 1e-300))

    @property
    def heat_flows(self) -> Mapping[str, Array]:
        """Refused: a block has no conductors with names."""
        raise SolverError("a block stores no heat flow of single conductors; heat_balance() has the sums.", self.title)

    def heat_flow(self, conductor: str) -> Array:
        """Refused: a block has no conductors with names."""
        raise NameNotFoundError(f"a block has no conductor '{conductor}'; heat_balance() has the sums.", self.title)

    @property
    def time_constants(self) -> Array:
        """Refused: they would need all modes."""
        raise SolverError("time constants need all modes of a network; ask a block.model() of some hundred cells for them.", self.title)

    def sensitivity(self, node: str, name: str) -> Array:
        """Refused: methods of large networks carry no derivatives."""
        raise NameNotFoundError(f"the solution holds no sensitivity of '{node}' to '{name}': large networks carry none.", self.title)


@dataclass(frozen=True, eq=False)
class Again:
    """How a block's run is made again at other times.

    Parameters
    ----------
    network : SparseNetwork
    initial : array (cells,)        [K]
    end : float                     [s]
    watched : tuple of Watched      In the order of the solution's columns.
    options : Options               Of the integrator; the method that was chosen.
    where : str                     For messages.
    name : callable                 Place of a cell -> its name.
    """

    network: SparseNetwork
    initial: Array
    end: float
    watched: tuple[Watched, ...]
    options: Options
    where: str
    name: Callable[[int], str]
    memo: Memo = field(init=False, default_factory=Memo, compare=False, repr=False)

    def at(self, times: Array) -> Array:
        """Return what is watched (times, watched) [K] at increasing times (times,) [s]."""
        made: Array = self.memo.made(times.tobytes(), lambda: self._made(times), most=4)
        return made

    def _made(self, times: Array) -> Array:
        none = np.zeros(0)
        return integrate(self.network, self.initial, self.end, times, self.watched, none, self.options, self.where, self.name).watched


@dataclass(frozen=True, eq=False)
class BlockDense:
    """The course of what was watched of a block, or of a boundary, at any time; see `Dense`.

    Parameters
    ----------
    solution : BlockSolution
    column : int                Among its nodes.
    """

    solution: BlockSolution
    column: int

    def kelvin(self, times: Array) -> Array:
        """Return the temperatures (times,) [K] at increasing times (times,) [s]."""
        watched, again = self.solution._watched.shape[1], self.solution._again
        if self.column >= watched or again is None:
            return self.solution._network.boundary(self.column - watched, times)
        return again.at(times)[:, self.column]

    @property
    def switches(self) -> Array:
        """When inputs jump. [s]"""
        return break_times(self.solution._network.inputs, float(self.solution._scenario.seconds))
