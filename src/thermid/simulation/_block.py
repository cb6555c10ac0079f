"""Blocks run: cells and faces to flat arrays, a scenario to inputs, a `BlockSolution` out."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from thermid.base.errors import NameNotFoundError, ScenarioError, SolverError, nearest, refuse_first, refuse_unknown
from thermid.base.linear_algebra import anderson_step
from thermid.base.results import Result
from thermid.base.units import TEMPERATURE, Array, Memo
from thermid.model.tree import FACES, Block, Constant, Drawn, Exchange, Signal, common_cycle, in_run, literal, multiplied
from thermid.physics.convection import convection_conductance
from thermid.physics.radiation import radiation_coefficient
from thermid.simulation._scenarios.scenario import MEAN, PERIODIC, STEADY, Scenario, Start
from thermid.simulation._simulator import output_times
from thermid.simulation._solution import HeatBalance, Solution, Trace
from thermid.simulation._solver.extremes import Turnings
from thermid.simulation._solver.large import METHODS, LargeAnswer, Watched, integrate
from thermid.simulation._solver.large_steady import conductances, settle_large
from thermid.simulation._solver.problem import Options, break_times
from thermid.simulation._solver.sparse import NONE, Grid, LoadGroup, RowGroup, SparseNetwork
from thermid.simulation._solver.wiring import check_start, held_inputs, held_means, level_instants, mean_of, mean_span

if TYPE_CHECKING:
    import xarray

EXTREMES = {"mean": "mean", "hottest": "highest", "coldest": "lowest"}
MAX_BLOCK_PERIODS = 30
"""Periods that are run until a state comes back."""
MAX_BLOCK_RETURN_ERROR = 1e-3
"""How far a state that comes back may miss itself, below what the runs err by. [K]"""
FAST_MODE_SHARE = 0.75
"""What a mode that dies out within a period takes of what is missed: between a half, for slow ones, and one. [-]"""
REMEMBERED_STEPS = 6
"""Earlier steps from which the next one is made."""


@dataclass(frozen=True, eq=False)
class BlockSolution(Solution):
    """The solution of a `Block`; its `nodes` are the watched quantities, then the boundaries.

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
    _again: BlockRerun | None = field(default=None, repr=False, kw_only=True)

    def __getitem__(self, name: str) -> Trace:
        """Return the temperature of a watched quantity, such as ``hottest`` or ``+x``, or of a boundary over time."""
        refuse_unknown([name], self.nodes, self.title, "'{}' was not watched.{near} Name it in 'watch' of the run.", NameNotFoundError)
        k = self.nodes.index(name)
        return Trace(name, self.times, self.temperatures[:, k], self._turnings(k), BlockDense(self, k) if self._again else None)

    def __contains__(self, name: object) -> bool:
        """Whether a watched quantity or a boundary has this name."""
        return name in self.nodes

    def _turnings(self, column: int) -> Turnings | None:
        """Return the turning points of a column of `nodes` between the stored times; None where the run did not follow it."""
        watched = self._watched.shape[1]
        if self._answer is None or column >= watched:
            return None if self._answer is None else self._network.boundary_turnings(column - watched, float(self._scenario.seconds))
        return self._answer.turnings[column] if self._answer.turnings is not None else None

    def refined(self, nodes: Iterable[str] = (), most: int | None = None) -> Solution:
        """Return the solution itself: watched quantities are known at the stored times and at their own turning points."""
        return self

    @cached_property
    def temperatures(self) -> Array:
        """Temperatures (times, nodes) of what was watched and of the boundaries. [K]"""
        outer = [self._network.boundary(k, self.times) for k in range(len(self._network.boundaries))]
        return np.column_stack([self._watched, *outer])

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """Warnings of the run: no path to a boundary, and what a steady start was taken for."""
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
        powers = _powers(self.block, self._scenario)
        return {name: in_run(course, self._scenario.seconds).at(self.times) for name, course in powers.items()}

    def heat_balance(self) -> HeatBalance:
        """Return heat put in by heaters, heat into boundaries and heat stored over the run, by the integrator's own weights. [J]

        Stored is sum C (T_end - T_start); the residual is heaters - boundaries - stored, and its share that of the largest sum of sizes.

        Raises
        ------
        SolverError   For a steady state, which stores no heat.
        """
        if self._answer is None:
            raise SolverError(
                "a steady state has no heat balance over time. Run the block in time for one.", self.title, code="value.without-effect"
            )
        a, capacities = self._answer, self._network.capacities
        loads, boundaries, moved = float(a.load_energy.sum()), float(a.boundary_energy.sum()), a.final - a.initial
        stored = float(capacities @ moved)
        gross = max(float(np.abs(part).sum()) for part in (a.load_energy, a.boundary_energy, capacities * moved))
        residual = loads - boundaries - stored
        return HeatBalance(loads, boundaries, stored, residual, abs(residual) / max(gross, 1e-300))

    @property
    def heat_flows(self) -> Mapping[str, Array]:
        """Refused: a block has no conductors with names."""
        raise SolverError(
            "a block does not store the heat flow of single conductors. Use heat_balance() for the sums.",
            self.title,
            code="value.without-effect",
        )

    def heat_flow(self, conductor: str) -> Array:
        """Refused: a block has no conductors with names."""
        raise NameNotFoundError(f"a block has no conductor '{conductor}'. Use heat_balance() for the sums.", self.title)

    @property
    def time_constants(self) -> Array:
        """Refused: they would need all modes."""
        raise SolverError(
            "time constants need all modes of a network. Compute them from a block.model() of some hundred cells.",
            self.title,
            code="model.element-not-supported",
        )

    @cached_property
    def shares(self) -> dict[str, Array]:
        """Empty: a block has no controls."""
        return {}

    @cached_property
    def modes(self) -> dict[str, tuple[str, ...]]:
        """Empty: a block has no controls."""
        return {}

    def slopes(self, node: str) -> Array:
        """Refused: methods of large networks carry no derivatives."""
        return self.sensitivity(node, "any free name")

    def sensitivity(self, node: str, name: str) -> Array:
        """Refused: methods of large networks carry no derivatives."""
        raise NameNotFoundError(
            f"the solution holds no sensitivity of '{node}' to '{name}', because large networks have no sensitivities.", self.title
        )

    def to_xarray(self) -> xarray.Dataset:
        """Return the temperatures of the nodes over time as a data set; a block stores no flows of single conductors. [degC]

        Raises
        ------
        MissingExtraError   When pandas or xarray is not installed.
        """
        return Result.to_xarray(self)


@dataclass(frozen=True, eq=False)
class BlockRerun:
    """What it takes to make a block's run again for other output times.

    Parameters
    ----------
    network : SparseNetwork
    initial : array (cells,)        [K]
    end : float                     [s]
    watched : tuple of Watched      In the order of the solution's columns.
    options : Options               Of the integrator; the method that was chosen.
    where : str                     For messages.
    name : callable                 Place of a cell -> its name, for messages.
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
        arguments = (self.network, self.initial, self.end, times, self.watched, np.zeros(0), self.options, self.where, self.name)
        return self.memo.value(times.tobytes(), lambda: integrate(*arguments).watched, most=4)


@dataclass(frozen=True, eq=False)
class BlockDense:
    """Temperature of a watched quantity or a boundary of a block at any time; see `Dense`.

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


def simulate_block(
    block: Block,
    scenario: Scenario,
    *,
    every: str | float | None = None,
    times: Any = None,
    options: Options | None = None,
    watch: Iterable[str] | None = None,
    fields: Iterable[float] = (),
) -> BlockSolution:
    """Return the temperatures of a block in a scenario; see `simulate`.

    Parameters
    ----------
    watch : iterable    What is stored at every output time: ``mean``, ``hottest``, ``coldest``, a face (``+x``: its mean), a heater (its
                        mean), a cell (``cell[0,0,0]``). By default the first three and the heaters.
    fields : iterable   Times at which all temperatures are stored. [s]
    """
    wanted, opts = output_times(scenario, every, times), options or Options()
    where = f"{block.title}, {scenario.title}"
    refuse_unknown([opts.method], METHODS, where, "unknown method '{}' for a block. Use one of {known}.", ScenarioError)
    network = compile_block(block, scenario)
    names = tuple(watch) if watch is not None else (*EXTREMES, *block.heaters)
    watched = [_watched(block, name) for name in names]
    field_times = np.asarray(list(fields), dtype=float)
    if field_times.size and ((np.diff(field_times) <= 0).any() or field_times[0] < 0 or field_times[-1] > scenario.seconds):
        raise ScenarioError("times of fields must increase and lie within the duration.", where, code="value.outside-range")
    initial, statistics, start_remark = _start(block, scenario, network, opts, where)
    answer = integrate(network, initial, scenario.seconds, wanted, watched, field_times, opts, where, block.name, opts.extremes)
    grid = {"fields": answer.fields.reshape(-1, *block.cells), "final_field": answer.final.reshape(block.cells), "field_times": field_times}
    options = replace(opts, method=str(answer.statistics["method"]).removesuffix(" + CG"), extremes=False)
    again = BlockRerun(network, initial, float(scenario.seconds), tuple(watched), options, where, block.name)
    statistics = {**answer.statistics, **({"start": statistics} if statistics else {})}
    return _solution(block, scenario, network, names, wanted, answer.watched, statistics, grid, answer, again, start_remark)


def steady_block(block: Block, scenario: Scenario, time: float = 0.0, kind: str = "") -> BlockSolution:
    """Return the steady temperatures of a block with the inputs of one time [s] held, as a solution of that time; see `steady`.

    With `kind` ``mean`` the means of the inputs are held instead; ``periodic`` returns the run over one period whose end is its start.
    """
    cycle, changing = _cycle_and_changing(block, scenario)
    if kind and cycle and cycle > scenario.seconds:
        scenario = scenario.with_(duration=cycle)
    if kind == PERIODIC:
        whole = scenario.with_(start=PERIODIC, duration=cycle or scenario.seconds, initial={})
        return simulate_block(block, whole, watch=(*EXTREMES, *block.heaters, *FACES), fields=(0.0,))
    network, remark = compile_block(block, scenario), held_inputs(changing, time)
    if kind:
        network, remark = _stilled(network, mean_span(changing, cycle, scenario)), held_means(changing, cycle, scenario)[1]
    kelvin, statistics = settle_large(network, time, f"{block.title}, {scenario.title}")
    cells, times = kelvin.reshape(block.cells), np.array([float(time)])
    names = (*EXTREMES, *block.heaters, *FACES)
    means = [float(kelvin[_watched(block, n).nodes].mean()) for n in names[len(EXTREMES) :]]
    watched = np.array([[kelvin.mean(), kelvin.max(), kelvin.min(), *means]])
    grid = {"fields": cells[None], "final_field": cells, "field_times": times}
    return _solution(block, scenario, network, names, times, watched, statistics, grid, None, start_remark=remark)


def steady_levels_of_block(block: Block, scenario: Scenario, most: int) -> tuple[BlockSolution, ...]:
    """Return the steady state of a block under each combination of levels that its inputs take, `most` of them; see `steady_levels`."""
    cycle, _ = _cycle_and_changing(block, scenario)
    scenario = scenario.with_(duration=max(scenario.seconds, cycle or 0.0))
    instants = level_instants(_courses(block, scenario), scenario.seconds, scenario.title, most)
    return tuple(steady_block(block, scenario, t) for t in instants)


def _powers(block: Block, scenario: Scenario) -> dict[str, Signal]:
    """Return heater -> its power over time: that of the scenario or of the block, times its command. [W]"""
    loads, commands = scenario.loads, scenario.commands
    return {n: multiplied(loads.get(n, h.power), commands.get(n, Constant(1.0))) for n, h in block.heaters.items()}


def _courses(block: Block, scenario: Scenario) -> dict[str, Signal]:
    """Return name -> signal of every input of a block: boundary temperatures [K] and heater powers [W]."""
    _check(block, scenario, f"{block.title}, {scenario.title}")
    return {**{b: scenario.boundaries[b] for b in block.boundaries}, **_powers(block, scenario)}


def _cycle_and_changing(block: Block, scenario: Scenario) -> tuple[float | None, tuple[str, ...]]:
    """Return the common period of all inputs [s], None where they do not repeat, and the names of those that change."""
    changing = {name: s.cycle for name, s in _courses(block, scenario).items() if s.cycle != 0.0}
    return common_cycle(list(changing.values())), tuple(changing)


def _solution(
    block: Block,
    scenario: Scenario,
    network: SparseNetwork,
    names: tuple[str, ...],
    times: Array,
    watched: Array,
    statistics: Mapping[str, Any],
    grid: Mapping[str, Array],
    answer: LargeAnswer | None,
    again: BlockRerun | None = None,
    start_remark: str = "",
) -> BlockSolution:
    """Return the solution of a block from its parts; `watched` (times, names) [K], `grid` the fields by their names in `BlockSolution`."""
    none: Any = None  # a block has no wiring of names
    more: dict[str, Any] = {"_watched": watched, "_network": network, "_scenario": scenario, "_answer": answer, "_again": again, **grid}
    nodes = (*names, *network.boundaries)
    lost = "" if network.boundaries else "the block has no path to a boundary, so its temperature changes without limit when it is heated"
    remarks = tuple(remark for remark in (lost, start_remark) if remark)
    return BlockSolution(block.title, scenario.title, times, nodes, (), "ok", statistics, remarks, none, block=block, **more)


def _watched(block: Block, name: str) -> Watched:
    """Return the watched quantity of a name: mean, hottest, coldest, a face, a heater or a cell; refuse any other name."""
    none, weights = np.zeros(0, dtype=np.int32), np.zeros(0)
    if name in EXTREMES:
        return Watched(EXTREMES[name], none, weights)
    if name in FACES:
        return Watched("mean", block.face_cells(name), weights)
    if name in block.heaters:
        return Watched("mean", block.heater_cells(name), weights)
    if name.startswith("cell"):
        return Watched("mean", np.array([block.place(name)], dtype=np.int32), weights)
    names = [*EXTREMES, *FACES, *block.heaters, block.name(0)]
    raise NameNotFoundError(f"a block has no '{name}' to watch.{nearest(name, names)}", block.title)


def compile_block(block: Block, scenario: Scenario) -> SparseNetwork:
    """Return a block in a scenario as flat arrays: capacitances, links of the grid, rows of its faces, loads and inputs.

    Raises
    ------
    ScenarioError   When the scenario does not fit the block.
    """
    where = f"{block.title}, {scenario.title}"
    _check(block, scenario, where)
    inputs: list[Drawn] = []

    def place(drawn: Drawn) -> int:
        """Return the place of a signal among the inputs; `NONE` for a constant."""
        if isinstance(drawn, Constant):
            return NONE
        inputs.append(drawn)
        return len(inputs) - 1

    boundaries = block.boundaries
    signals = [in_run(scenario.boundaries[b], scenario.seconds) for b in boundaries]
    offsets = np.array([s.value if isinstance(s, Constant) else 0.0 for s in signals])
    places = tuple(place(s) for s in signals)
    rows = [row for e in block.exchanges for row in _rows(block, e, boundaries)]
    loads = []
    for tag, (name, course) in enumerate(_powers(block, scenario).items()):
        power = in_run(course, scenario.seconds)
        nodes = block.heater_cells(name)
        coefficients = np.zeros((4, nodes.size))
        coefficients[0] = (power.value if isinstance(power, Constant) else 1.0) / nodes.size
        loads.append(LoadGroup("signal", tag, nodes, coefficients, place(power)))
    names = tuple(block.heaters)
    grid = Grid(np.array(block.cells, dtype=np.int32), *block.links)
    return SparseNetwork(block.capacities(), grid, rows, loads, names, boundaries, places, offsets, tuple(inputs))


def _check(block: Block, scenario: Scenario, where: str) -> None:
    """Refuse a scenario that a block cannot run: tables it does not have, unknown names, a boundary without a temperature."""
    scenario.check_spans()
    for name in ("gains", "schedule", "prescribed", "environment"):
        if getattr(scenario, name):
            raise ScenarioError(
                f"a block takes no '{name}'. Turn the block into a model with model(), which does.", where, code="value.without-effect"
            )
    if scenario.as_printed:
        raise ScenarioError(
            "--as-printed does not apply to a block. Turn it into a model with model().", where, code="value.without-effect"
        )
    tables: tuple[tuple[str, Mapping[str, Any], Collection[str]], ...] = (
        ("boundary", scenario.boundaries, block.boundaries),
        ("heater", scenario.loads, block.heaters),
        ("heater", scenario.commands, block.heaters),
    )
    for kind, table, allowed in tables:
        refuse_unknown(table, allowed, where, f"the block has no {kind} '{{}}'.", ScenarioError)
    for name in block.boundaries:
        if name not in scenario.boundaries:
            raise ScenarioError(
                f"boundary '{name}' has no temperature. Give it one under boundaries of the scenario.", where, code="run.input-missing"
            )


def _rows(block: Block, exchange: Exchange, boundaries: tuple[str, ...]) -> list[RowGroup]:
    """Return the conductors of an exchange as groups of one law, convection and radiation apart; an edge cell has one for all its faces."""
    places, area, conductance = block.exchange_cells(exchange)
    second = np.zeros_like(places)
    to = boundaries.index(exchange.to) if exchange.to in boundaries else NONE
    if exchange.held:
        return [RowGroup("linear", to, places, second, conductance)]
    out = []
    if exchange.htc:
        form = "power" if exchange.exponent else "linear"
        out.append(RowGroup(form, to, places, second, convection_conductance(exchange.htc, area), exchange.exponent))
    if exchange.emissivity:
        coefficients = float(radiation_coefficient(exchange.emissivity, 1.0)) * area
        out.append(RowGroup("radiation", to, places, second, coefficients))
    return out


def _start(block: Block, scenario: Scenario, network: SparseNetwork, options: Options, where: str) -> tuple[Array, Mapping[str, Any], str]:
    """Return the initial temperatures (cells,) [K], statistics of a search for them, and a remark on a steady start."""
    written, start = scenario.start, Start.from_text(scenario.start, where)
    refuse_first(
        where,
        (
            start is not None and scenario.initial,
            "a steady start gives the temperatures of all cells. Leave 'initial' out.",
            "value.excludes-another",
        ),
        (
            written == "" and len(network.boundaries) != 1,
            "the start is missing. Give a temperature, the name of a boundary, or 'steady'.",
            "run.input-missing",
        ),
        error=ScenarioError,
    )
    if start is None:
        initial = np.full(block.count, _temperature(written or network.boundaries[0], network, where))
        for name, value in scenario.initial.items():
            initial[block.place(name)] = _temperature(value, network, where)
        return initial, {}, ""
    cycle, changing = _cycle_and_changing(block, scenario)
    check_start(start, cycle, changing, scenario)
    if start.kind == STEADY:
        return *settle_large(network, start.time, where), held_inputs(changing, start.time)
    still = _stilled(network, mean_span(changing, cycle, scenario))
    kelvin, statistics = settle_large(still, 0.0, where)
    if start.kind == MEAN or not cycle:  # constant inputs: their steady state comes back after any time
        return kelvin, statistics, held_means(changing, cycle, scenario)[1]
    return *_periodic(network, still, kelvin, cycle or 0.0, options, where, block.name), ""


def _temperature(value: Any, network: SparseNetwork, where: str) -> float:
    """Return an initial temperature: a number with its unit, or that of a boundary at time zero. [K]"""
    if value in network.boundaries:
        return float(network.boundary(network.boundaries.index(value), np.zeros(1))[0])
    return literal(value, TEMPERATURE, where)


def _stilled(network: SparseNetwork, span: float) -> SparseNetwork:
    """Return a network with every input at its mean over a span from zero [s]."""
    return replace(network, inputs=tuple(mean_of(drawn, span) for drawn in network.inputs))


def _periodic(
    network: SparseNetwork, still: SparseNetwork, guess: Array, period: float, options: Options, where: str, name: Callable[[int], str]
) -> tuple[Array, dict[str, Any]]:
    """Return the state (nodes,) to which the network returns after every period of its inputs [K], and statistics of the search.

    The zero of T(P) - T(0): with the network linearised at the mean of its inputs a mode of rate k misses (1 - exp(-k P)) of its error,
    whose inverse is close to 3/4 + 1 / (k P), a sparse solution with the conductances; what that leaves is brought down by Anderson's
    method (J. ACM 12 (1965) 547).

    Parameters
    ----------
    still : SparseNetwork       The same with its inputs at their means.
    guess : array (nodes,)      Its steady temperatures. [K]
    period : float              [s]

    Raises
    ------
    SolverError   When no such state is found.
    """
    solve = conductances(still, guess, where)
    fine = replace(options, extremes=False)
    watched, none = (Watched("mean", np.zeros(1, dtype=np.int32), np.ones(1)),), np.zeros(0)

    def after(state: Array) -> Array:
        """Return the state one period later. [K]"""
        return integrate(network, state, period, np.array([period]), watched, none, fine, where, name).final

    state, states, steps = guess.copy(), [], []  # type: Array, list[Array], list[Array]
    for run in range(MAX_BLOCK_PERIODS):
        end = after(state)
        missed = end - state
        size = float(np.abs(missed).max())
        if size < MAX_BLOCK_RETURN_ERROR:
            return end, {"method": "Anderson", "periods": run + 1, "missed": size}
        states.append(state)
        steps.append(FAST_MODE_SHARE * missed + solve(network.capacities * missed / period))
        state = np.maximum(anderson_step(states[-REMEMBERED_STEPS:], steps[-REMEMBERED_STEPS:], 1e-12), 0.1)
    raise SolverError(
        f"no state was found that comes back after {period:g} s; it missed by {size:.3g} K.", where, code="run.no-periodic-state"
    )
