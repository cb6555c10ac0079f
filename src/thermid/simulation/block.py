"""Blocks run: cells and faces to flat arrays, a scenario to inputs, a `BlockSolution` out."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.errors import NameNotFoundError, ScenarioError, nearest
from thermid.model.blocks.block import FACES, Block, Exchange, exchange_cells, links
from thermid.model.laws.signal import Constant, Drawn, literal, multiplied
from thermid.physics.radiation import radiation_coefficient
from thermid.simulation.block_solution import Again, BlockSolution
from thermid.simulation.scenarios.scenario import STEADY, Scenario, Start
from thermid.simulation.simulator import output_times
from thermid.simulation.solver.engine import Options
from thermid.simulation.solver.large import METHODS, LargeAnswer, Watched, integrate
from thermid.simulation.solver.sparse import NONE, Grid, LoadGroup, RowGroup, SparseNetwork
from thermid.units import TEMPERATURE

Array = NDArray[np.float64]
Ints = NDArray[np.int32]
EXTREMES = {"mean": "mean", "hottest": "highest", "coldest": "lowest"}


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
    if opts.method not in METHODS:
        raise ScenarioError(f"a block is run by one of {', '.join(METHODS)}, not by '{opts.method}'.", where)
    network = compile_block(block, scenario)
    names = tuple(watch) if watch is not None else (*EXTREMES, *block.heaters)
    watched = [_watched(block, name) for name in names]
    field_times = np.asarray(list(fields), dtype=float)
    if field_times.size and ((np.diff(field_times) <= 0).any() or field_times[0] < 0 or field_times[-1] > scenario.seconds):
        raise ScenarioError("times of fields must increase and lie within the duration.", where)
    initial = _start(block, scenario, network, where)
    answer = integrate(network, initial, scenario.seconds, wanted, watched, field_times, opts, where, block.name, opts.extremes)
    grid = {"fields": answer.fields.reshape(-1, *block.cells), "final_field": answer.final.reshape(block.cells), "field_times": field_times}
    method = str(answer.statistics["method"]).removesuffix(" + CG")
    options = replace(opts, method=method, extremes=False)
    again = Again(network, initial, float(scenario.seconds), tuple(watched), options, where, block.name)
    return _solution(block, scenario, network, names, wanted, answer.watched, answer.statistics, grid, answer, again)


def steady_block(block: Block, scenario: Scenario, time: float = 0.0) -> BlockSolution:
    """Return the steady temperatures of a block with the inputs of one time held, as a solution of one time; see `steady`."""
    from thermid.simulation.solver.large_steady import settle_large

    network = compile_block(block, scenario)
    found, statistics = settle_large(network, time, f"{block.title}, {scenario.title}")
    cells, at = found.reshape(block.cells), np.array([float(time)])
    names = (*EXTREMES, *block.heaters, *FACES)
    means = [float(found[_watched(block, n).nodes].mean()) for n in names[len(EXTREMES) :]]
    watched = np.array([[found.mean(), found.max(), found.min(), *means]])
    grid = {"fields": cells[None], "final_field": cells, "field_times": at}
    return _solution(block, scenario, network, names, at, watched, statistics, grid, None)


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
    again: Again | None = None,
) -> BlockSolution:
    none: Any = None  # a block has no wiring of names
    more: dict[str, Any] = {
        "_watched": watched,
        "_network": network,
        "_scenario": scenario,
        "_answer": answer,
        "_again": again,
        "block": block,
        **grid,
    }
    nodes = (*names, *network.boundaries)
    remarks = () if network.boundaries else ("the block has no path to a boundary: it warms or cools without limit as it is heated",)
    return BlockSolution(block.title, scenario.title, times, nodes, (), "ok", statistics, remarks, none, **more)


def _watched(block: Block, name: str) -> Watched:
    """Return what is stored under a name."""
    none, weights = np.zeros(0, dtype=np.int32), np.zeros(0)
    if name in EXTREMES:
        return Watched(EXTREMES[name], none, weights)
    if name in FACES:
        return Watched("mean", block.face_cells(name), weights)
    if name in block.heaters:
        return Watched("mean", block.heater_cells(name), weights)
    if name.startswith("cell"):
        return Watched("mean", np.array([block.place(name)], dtype=np.int32), weights)
    known = [*EXTREMES, *FACES, *block.heaters, block.name(0)]
    raise NameNotFoundError(f"a block has no '{name}' to watch.{nearest(name, known)}", block.title)


def compile_block(block: Block, scenario: Scenario) -> SparseNetwork:
    """Return a block in a scenario as flat arrays.

    Raises
    ------
    ScenarioError   When the scenario does not fit the block.
    """
    where = f"{block.title}, {scenario.title}"
    _check(block, scenario, where)
    inputs: list[Drawn] = []

    def place(given: Drawn) -> int:
        if isinstance(given, Constant):
            return NONE
        inputs.append(given)
        return len(inputs) - 1

    boundaries = block.boundaries
    given = [scenario.boundaries[b].drawn(scenario.seconds) for b in boundaries]
    offsets = np.array([s.value if isinstance(s, Constant) else 0.0 for s in given])
    places = tuple(place(s) for s in given)
    rows = [row for e in block.exchanges for row in _rows(block, e, boundaries)]
    loads = []
    for tag, (name, heater) in enumerate(block.heaters.items()):
        power = multiplied(scenario.loads.get(name, heater.power), scenario.commands.get(name, Constant(1.0))).drawn(scenario.seconds)
        nodes = block.heater_cells(name)
        coefficients = np.zeros((4, nodes.size))
        coefficients[0] = (power.value if isinstance(power, Constant) else 1.0) / nodes.size
        loads.append(LoadGroup("signal", tag, nodes, coefficients, place(power)))
    names = tuple(block.heaters)
    grid = Grid(np.array(block.cells, dtype=np.int32), *links(block))
    return SparseNetwork(block.capacities(), grid, rows, loads, names, boundaries, places, offsets, tuple(inputs))


def _check(block: Block, scenario: Scenario, where: str) -> None:
    """Refuse what a block cannot follow."""
    scenario.check_spans()
    for name in ("gains", "schedule", "prescribed", "environment"):
        if getattr(scenario, name):
            raise ScenarioError(f"a block takes no '{name}'; turn it into a model with model(), which does.", where)
    if scenario.as_printed:
        raise ScenarioError("a block has no coefficients of a source document; turn it into a model with model().", where)
    tables: tuple[tuple[str, Mapping[str, Any], Iterable[str]], ...] = (
        ("boundary", scenario.boundaries, block.boundaries),
        ("heater", scenario.loads, block.heaters),
        ("heater", scenario.commands, block.heaters),
    )
    for kind, table, known in tables:
        for name in table:
            if name not in known:
                raise ScenarioError(f"the block has no {kind} '{name}'.{nearest(name, known)}", where)
    for name in block.boundaries:
        if name not in scenario.boundaries:
            raise ScenarioError(f"boundary '{name}' has no temperature. Give it one in the scenario's boundaries.", where)


def _rows(block: Block, exchange: Exchange, boundaries: tuple[str, ...]) -> list[RowGroup]:
    """Return the conductors of an exchange; a cell at an edge has one for all its faces."""
    places, area, conductance = exchange_cells(block, exchange)
    second = np.zeros_like(places)
    to = boundaries.index(exchange.to) if exchange.to in boundaries else NONE
    if exchange.held:
        return [RowGroup("linear", to, places, second, conductance)]
    out = []
    if exchange.htc:
        form = "power" if exchange.exponent else "linear"
        out.append(RowGroup(form, to, places, second, exchange.htc * area, exchange.exponent))
    if exchange.emissivity:
        coefficients = float(radiation_coefficient(exchange.emissivity, 1.0)) * area
        out.append(RowGroup("radiation", boundaries.index(exchange.radiates_to), places, second, coefficients))
    return out


def _start(block: Block, scenario: Scenario, network: SparseNetwork, where: str) -> Array:
    """Return the initial temperatures (cells,). [K]"""
    start = scenario.start
    asked = Start.of(start, where)
    if asked is not None and asked.kind != STEADY:
        raise ScenarioError(f"a block starts steady under the inputs of one time, not '{start}'; turn it into a model with model().", where)
    if asked is not None:
        if scenario.initial:
            raise ScenarioError("a steady start holds for all cells; leave 'initial' out.", where)
        from thermid.simulation.solver.large_steady import settle_large

        return settle_large(network, asked.time, where)[0]
    if start == "" and len(network.boundaries) != 1:
        raise ScenarioError("there is no start: give a temperature, the name of a boundary, or 'steady'.", where)
    initial = np.full(block.count, _temperature(start or network.boundaries[0], network, where))
    for name, value in scenario.initial.items():
        initial[block.place(name)] = _temperature(value, network, where)
    return initial


def _temperature(value: Any, network: SparseNetwork, where: str) -> float:
    if value in network.boundaries:
        return float(network.boundary(network.boundaries.index(value), np.zeros(1))[0])
    return literal(value, TEMPERATURE, where) if isinstance(value, str) else float(value)
