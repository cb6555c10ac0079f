"""`Simulator`: a model and a scenario made ready for many runs at other values; random draws of such values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from functools import cached_property
from typing import Any, Final

import numpy as np

from thermid.base.errors import CodedText, NameNotFoundError, ScenarioError, cap, errors_at, quoted, raising, refuse_unknown
from thermid.base.results import Shown
from thermid.base.units import TEMPERATURE, Array, amount, quantity, seconds, si_values, unit, value_of
from thermid.model.tree import Constant, Model, Standing, streams_of
from thermid.simulation._ensemble import Ensemble
from thermid.simulation._many.tasks import Workers
from thermid.simulation._network.medium import gas_remarks
from thermid.simulation._network.network import Network, compile_network, unreached, without_gas
from thermid.simulation._scenarios.scenario import STEADY, Scenario, sampled_logs
from thermid.simulation._solution import Run, Solution
from thermid.simulation._solver.engine import Engine, settle
from thermid.simulation._solver.problem import Options, Traces
from thermid.simulation._solver.wiring import Wiring, held_inputs
from thermid.values.store import Distribution, Draws, domain, read_spread, uniforms

DEFAULT_SAMPLES = 301
NUMBER = unit("1").dimension


def network_for(model: Model, scenario: Scenario) -> Network:
    """Return the model compiled for a scenario: its gases, and the nodes it drives."""
    return compile_network(model, media=scenario.media(), prescribed=tuple(scenario.prescribed))


def output_times(scenario: Scenario, every: str | float | None, times: Any) -> Array:
    """Return the times (times,) at which a solution is stored. [s]

    Parameters
    ----------
    every : str or float    Interval [s] from 0 on; the end is stored too. `DEFAULT_SAMPLES` equally spaced where None.
    times : array (times,)  The times themselves, in whose place nothing else counts. [s]

    Raises
    ------
    ScenarioError   When the scenario has no duration, times lie outside it or do not increase, or there would be too many.
    """
    if scenario.seconds <= 0:
        raise ScenarioError(
            'a run needs a duration above zero: duration = "5 [h]", or --for "5 [h]".',
            f"{scenario.title}, duration",
            code="value.outside-range",
        )
    if times is not None:
        with errors_at(f"{scenario.title}, times"):
            wanted = seconds(times)
        if (
            wanted.ndim != 1
            or wanted.size == 0
            or not (np.diff(wanted) > 0).all()
            or not 0 <= wanted[0] <= wanted[-1] <= scenario.seconds * (1 + 1e-12)
        ):
            raise ScenarioError("output times must increase and lie within the duration.", scenario.title, code="value.outside-range")
        return wanted
    if every is None:
        return np.linspace(0.0, scenario.seconds, DEFAULT_SAMPLES)
    step = amount(every, "s", f"{scenario.title}, every")
    if not step > 0:
        raise ScenarioError("the interval of output must be above zero.", scenario.title, code="value.outside-range")
    if scenario.seconds / step > cap("outputs"):
        raise ScenarioError(
            f"an interval of {step:g} s would store {scenario.seconds / step:.3g} samples, of at most {cap('outputs'):,.0f}. "
            f"Give a longer one.{raising('outputs')}",
            scenario.title,
            code="cap.exceeded",
        )
    # a whole number of intervals may miss the duration, or pass it, by rounding
    grid: Array = step * np.arange(int(scenario.seconds / step * (1.0 + 1e-12)) + 1, dtype=float)
    if grid.size > 1 and np.isclose(grid[-1], scenario.seconds, rtol=1e-9, atol=0.0):
        grid[-1] = scenario.seconds
        return grid
    return np.append(grid, scenario.seconds)


def prepare(
    model: Model,
    scenario: Scenario,
    free: Sequence[str] = (),
    *,
    every: str | float | None = None,
    times: Any = None,
    options: Options | None = None,
) -> Simulator:
    """Compile a model and a scenario once, for many runs at other values of the names in `free`.

    Parameters
    ----------
    model, scenario, every, times, options    As in `simulate`.
    free : sequence of str      What may change from run to run: parameters, boundaries (a constant added to their signal),
                                ``initial.<node>``, and ``scale.<load>`` (a factor on its power).

    Raises
    ------
    ScenarioError       As in `simulate`.
    NameNotFoundError   When a free name does not exist.
    DeckError           When a free parameter is derived from others.
    """
    wanted = output_times(scenario, every, times)
    network = network_for(model, scenario)
    names = tuple(_free_name(network, n) for n in free)
    if wanted.size * len(network.nodes) > cap("stored"):
        raise ScenarioError(
            f"{wanted.size:,} times of {len(network.nodes)} nodes are {wanted.size * len(network.nodes):.3g} temperatures to store, of at "
            f"most {cap('stored'):.3g}. Give a longer interval.{raising('stored')}",
            scenario.title,
            code="cap.exceeded",
        )
    wiring = Wiring(network, scenario, names)
    return Simulator(model.title, wiring, Engine(wiring), wanted, options or Options())


def _free_name(network: Network, raw: str) -> str:
    """Return the canonical form of a name to be freed: a parameter, a boundary, ``initial.<node>`` or ``scale.<load>``; else refuse it."""
    canonical = network.flat.names.model.canonical
    head, _, rest = (raw if isinstance(raw, str) else canonical(raw)).partition(".")
    if head in ("initial", "scale") and rest:
        return f"{head}.{canonical(rest)}"
    name = canonical(raw)
    if name in network.boundaries:
        return name
    if any(load.path == name for load in network.flat.loads):
        raise NameNotFoundError(
            f"'{raw}' is a load: 'scale.{raw}' is a factor on its power, '{raw}.power' the power of the deck.",
            network.flat.names.model.title,
        )
    if raw not in network.flat.parameters.table and network.boundaries:
        close = get_close_matches(raw, network.boundaries, 1, 0.8)
        if close:
            raise NameNotFoundError(f"no parameter or boundary '{raw}'. Did you mean '{close[0]}'?", network.flat.names.model.title)
    return network.flat.parameters.freeable(raw, canonical)


@dataclass(frozen=True, eq=False)
class Simulator(Shown):
    """A model and a scenario made ready for many runs.

    Parameters
    ----------
    title : str             The model's.
    wiring : Wiring         The network and scenario, wired to the kernel's coefficients.
    engine : Engine         The kernel's problem, and the ways to run it.
    times : array (times,)  Times at which solutions are stored. [s]
    options : Options       Tolerances and limits of the integrator.
    """

    title: str
    wiring: Wiring = field(repr=False)
    engine: Engine = field(repr=False)
    times: Array = field(repr=False)
    options: Options

    @property
    def free(self) -> tuple[str, ...]:
        """What may change from run to run."""
        return self.wiring.free

    @cached_property
    def nominal(self) -> Mapping[str, float]:
        """Free name -> the value it has where none is given. [SI]"""
        base = self.wiring.network.numbers().values
        out = {}
        for name in self.free:
            head, _, node = name.partition(".")
            if name in base:
                out[name] = value_of(base[name])
            elif head == "scale":
                out[name] = 1.0
            else:
                out[name] = self.wiring.nominal(node if head == "initial" else name, start=head == "initial")
        return out

    @cached_property
    def without_gas(self) -> tuple[str, ...]:
        """Nodes that stand for a gas that is not there in this scenario; solutions leave them out."""
        return without_gas(self.wiring.network, self.wiring.assemble().numbers)

    @cached_property
    def _remarks(self) -> tuple[str, ...]:
        """Warnings that hold for every run; see `_warnings`."""
        return _warnings(self.wiring, self.wiring.scenario, self.without_gas)

    def run(self, values: Mapping[str, float] | None = None, *, sensitivities: bool = False) -> Solution:
        """Return the solution at some values of the free names.

        Parameters
        ----------
        values : dict           Free name -> value; `nominal` where none is given. Numbers are SI, but a temperature states its unit:
                                ``td.celsius(24)``.
        sensitivities : bool    Whether to store derivatives with respect to the free names too; see `Solution.sensitivity`.

        Raises
        ------
        NameNotFoundError   When a value is given for a name that is not free.
        SolverError         As in `simulate`.
        """
        x = self.vector({} if values is None else values) if self.free else None
        assembled = self.engine.started(self.wiring.assemble(x, sensitivities), sensitivities)
        nodes = assembled.reduced.nodes
        wanted = sensitivities and bool(self.free)
        options, end = self.options, self.wiring.scenario.seconds
        answer = self.engine.integrate(assembled, self.times, nodes, end, options, wanted, options.extremes)
        run = Run(self.wiring, self.engine, assembled, answer, self.times, options)
        free = self.free if wanted else ()
        shown = tuple(n for n in run.all_nodes() if n not in self.without_gas)
        return Solution(self.title, self.wiring.scenario.title, self.times, shown, free, "ok", answer.statistics, self._remarks, run)

    def ensemble(
        self,
        draws: Mapping[str, Any],
        *,
        nodes: Sequence[str] | None = None,
        quantiles: Any = None,
        threads: int = 1,
        simd: str = "auto",
        executor: Workers = None,
    ) -> Ensemble:
        """Return the runs of many members at once.

        Parameters
        ----------
        draws : dict            Free name -> value of every member (members,); `nominal` where none is given. Numbers are SI, but
                                temperatures state their unit: ``td.celsius(array)``.
        nodes, quantiles, threads, simd, executor    As in `ensemble`.

        Raises
        ------
        NameNotFoundError   When values are given for a name that is not free.
        ScenarioError       When the names do not have equally many values.
        """
        values = self._by_free_name(draws)
        if len(values) < len(draws):
            raise ScenarioError(
                "one parameter is drawn twice, by its path and by an alias. Remove one of them.", self.title, code="name.taken"
            )
        names = (*self.wiring.network.nodes, *self.wiring.network.boundaries)
        nodes = nodes if nodes is not None or not self.without_gas else [n for n in names if n not in self.without_gas]
        runs = Ensemble.of_members(self.engine, values, self.times, self.options, nodes, quantiles, threads, simd, self._remarks, executor)
        standings = [self.wiring.network.flat.names.model.standing, *([draws.standing] if isinstance(draws, Draws) else [])]
        return replace(runs, standing=Standing.worst(standings))

    def settled(self, values: Mapping[str, Any] | None = None, *, sensitivities: bool = True) -> tuple[dict[str, float], dict[str, Array]]:
        """Return node -> temperature with the inputs of the end held for good [K], and its derivatives (free,) [K per SI unit].

        Without `sensitivities` these are empty.

        Raises
        ------
        SolverError   When nothing settles.
        """
        wiring, end = self.wiring, self.wiring.scenario.seconds
        wanted = sensitivities and bool(self.free)
        a = self.engine.started(wiring.assemble(self.vector(values or {}), wanted), wanted) if self.free else wiring.assemble()
        temperatures, moves = settle(self.engine, a, end, wanted)
        traces = Traces(wiring, a, np.array([end]), self.engine.nodes, temperatures[None, :], moves[None, :, :])
        names = (*wiring.network.nodes, *wiring.network.boundaries)
        return {n: float(traces.temperature(n)[0]) for n in names}, {n: traces.slope(n)[0] for n in names}

    def canonical(self, name: str) -> str:
        """Return the canonical form of a name that may change: of a parameter, a boundary, ``initial.<node>`` or ``scale.<load>``."""
        return _free_name(self.wiring.network, name)

    def slots(self, name: str) -> tuple[str, str]:
        """Return the units that a value of a free name, and a difference of two, are written in."""
        refuse_unknown([name], self.nominal, self.title, "no free name '{}'.", NameNotFoundError)
        return self._slots[name]

    @cached_property
    def _slots(self) -> Mapping[str, tuple[str, str]]:
        """Free name -> the units of `slots`."""
        return {name: self._slot(name) for name in self.free}

    def _slot(self, name: str) -> tuple[str, str]:
        """Return the units of `slots` of a name that is free."""
        freed = name in self.wiring.parameters
        if freed or name.startswith("scale."):
            of = self.wiring.network.flat.parameters.table[name].parameter.expression.literal if freed else None
            return ("1", "1") if of is None else (TEMPERATURE, "K") if of.unit.offset else (of.unit.text, of.unit.text)
        constant = name.startswith("initial.") or isinstance(self.wiring.signals[f"boundary {name}"], Constant)
        return (TEMPERATURE if constant else "K"), "K"

    def bounds(self, name: str) -> tuple[float, float]:
        """Return the bounds that a deck or physics sets for a free name, infinite where none does. [SI]

        Without a minimum, a value above zero that keeps its sign (`Parameter.form`), or a factor on a power, is bounded by zero.
        """
        refuse_unknown([name], self.nominal, self.title, "no free name '{}'.", NameNotFoundError)
        parameters = self.wiring.network.flat.parameters
        start = self.nominal[name]
        if name not in self.wiring.parameters:
            return 0.0 if start > 0.0 and name.startswith("scale.") else -np.inf, np.inf
        log, low, high = parameters.bounded(name).form(name, parameters.dimension(name), start)
        return max(low, 0.0) if log else low, high

    def domain(self, name: str) -> tuple[float, float]:
        """Return the range that physics allows of a free name, see `thermid.values.store.domain`. [SI]"""
        parameters = self.wiring.network.flat.parameters
        return domain(*self.bounds(name), name in self.wiring.parameters and parameters.dimension(name) == NUMBER)

    def law(self, name: str, spread: Any) -> Distribution:
        """Return the distribution that a written spread means for a free name; "range" is the range that its deck states. [SI]"""
        path = self.canonical(name)
        where = f"{self.title}, spread of '{path}'"
        parameter = self.wiring.network.flat.parameters.table[path].parameter if path in self.wiring.parameters else None
        of_deck = parameter if isinstance(spread, str) and spread == "range" else None
        stated = of_deck.stated_range if of_deck is not None and of_deck.is_range else None
        bounds = self.bounds(path) if stated is None else (stated.low, stated.high)
        return read_spread((of_deck and of_deck.spread) or spread, self.slots(path)[0], self.nominal[path], where, bounds=bounds)

    def with_units(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Return values in SI by free name, or of many members, as `run` and `ensemble` take them: temperatures with their unit."""
        on_scale = {n for n in values if self.slots(self.canonical(n))[0] == TEMPERATURE}
        return {n: quantity(v, unit="K") if n in on_scale else v for n, v in values.items()}

    def vector(self, values: Mapping[str, Any]) -> Array:
        """Return the values (free,) in the order of `free`, from what `run` takes. [SI]"""
        point = self._by_free_name(values)
        try:
            return np.array([point.get(name, self.nominal[name]) for name in self.free], dtype=float)
        except (TypeError, ValueError, OverflowError):
            raise ScenarioError("each value is one number, or a text with its unit.", self.title, code="value.wrong-kind") from None

    def _by_free_name(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Return values by the names under which they are free. [SI]"""
        if not isinstance(values, Mapping):
            raise ScenarioError(f"it takes a dictionary from names to values, not {values!r:.60}.", self.title, code="value.wrong-kind")
        named = {name if name in self.free else _free_name(self.wiring.network, name): value for name, value in values.items()}
        refuse_unknown(
            named, self.free, self.title, "'{}' is not free in this simulator. Name it in free= of td.prepare.", NameNotFoundError
        )
        return {name: self._si(name, value) for name, value in named.items()}

    def _si(self, name: str, values_given: Any) -> Any:
        """Return values of a free name in SI: numbers as they are, others by their unit; refuse nan, and a temperature without unit."""
        slot = self._slots[name][0]
        if slot != TEMPERATURE and isinstance(values_given, float | np.ndarray):
            return values_given
        with errors_at(f"{self.title}, {name}"):
            value = si_values(values_given, slot)
            if value is not None and np.isnan(value).any():  # that would stand for a steady start
                raise ScenarioError("nan is not a value.", code="value.outside-range")
        return values_given if value is None else value


def ensemble(
    model: Model,
    scenario: Scenario,
    draws: Mapping[str, Any],
    *,
    every: str | float | None = None,
    times: Any = None,
    nodes: Any = None,
    quantiles: Any = None,
    threads: int = 1,
    options: Options | None = None,
    simd: str = "auto",
    executor: Workers = None,
) -> Ensemble:
    """Run a model at many sets of values and return all runs together.

    The same draws and options give the same result bit for bit, with one thread and with many, here and on workers of the same instruction
    set.

    Parameters
    ----------
    model, scenario, every, times, options    As in `simulate`.
    draws : dict            Name -> value of every member (members,): parameters, boundaries (a constant added to their signal),
                            ``initial.<node>``, and ``scale.<load>`` (a factor on its power). See `draw` and `FittedValues.draws`. Numbers
                            are SI, but temperatures state their unit: ``td.celsius(array)``.
    nodes : list of str     Nodes to keep; all of them when not given.
    quantiles : list        Shares of the quantiles to keep in place of every trace, such as ``(0.05, 0.5, 0.95)``: memory does not grow
                            with members, but for 8 bytes of each node's extremes. Members are counted in bins of a hundredth of the
                            standard deviation of the first 1000, 2 mK at least; see `Ensemble.quantile_error`. [-]
    threads : int           How many may compute at once.
    simd : str              Instruction set of the lanes; the widest of the machine unless one is named, for a comparison.
    executor : executor, str or int    Who runs shares of the members: an executor of `concurrent.futures`, the address of a Dask scheduler,
                            ``"joblib"``, or a number of processes of this machine. Of `KeptTasks` the folder keeps finished counts,
                            which needs `quantiles`: after an interrupt the same call goes on.

    Raises
    ------
    ScenarioError   As in `simulate`, or when the names do not have equally many values.
    NameNotFoundError   When a name does not exist.
    """
    ready = prepare(model, scenario, tuple(draws), every=every, times=times, options=options)
    return ready.ensemble(draws, nodes=nodes, quantiles=quantiles, threads=threads, simd=simd, executor=executor)


def remark_on_empty(nodes: Sequence[str]) -> str:
    """Return the remark on the nodes of gases that are not there, which results leave out."""
    has, are = ("has", "is") if len(nodes) == 1 else ("have", "are")
    return CodedText(f"{quoted(nodes)} {has} no gas in this scenario and {are} left out", "run.heat-stops-without-gas")


AS_PRINTED: Final = "vacuum as printed: every coefficient is zero, including its radiation, so the temperatures are an upper bound"


def _warnings(wiring: Wiring, scenario: Scenario, empty: tuple[str, ...]) -> tuple[str, ...]:
    """Return the warnings of all runs: missing parts, nodes without a path to a boundary, assumed samples, gas and wind."""
    numbers = wiring.assemble().numbers

    def mean_power(load: str) -> float:
        """Return the mean power of a load over the run. [W]"""
        return float(np.mean(wiring.power(load, numbers).at(np.linspace(0.0, scenario.seconds, 101))))

    flat, media, start = wiring.network.flat, wiring.network.media, wiring.start
    held = held_inputs(wiring.changing, start.time) if start is not None and start.kind == STEADY else ""
    followed = set(wiring.schedule.signals) if wiring.schedule is not None else set()
    return (
        *(f"INCOMPLETE: {what}" for what in flat.names.model.missing_parts()),
        *(message for nodes, message in unreached(wiring.network, numbers, mean_power).items() if not {*nodes} <= {*empty}),
        *([remark_on_empty(empty)] if empty else ()),
        *([CodedText(f"the start is {held}", "run.start-held")] if held else ()),
        *sampled_logs(scenario),
        *([CodedText(AS_PRINTED, "run.upper-bound")] if scenario.as_printed else ()),
        *media.remarks([c for c in flat.conductors if not followed & set(c.fields.values())]),
        *gas_remarks(media, flat, numbers.values),
        *(wiring.network.streams.remarks(scenario.seconds) if streams_of(flat.conductors) else ()),
    )


def draw(model: Model, scenario: Scenario, spreads: Mapping[str, Any], members: int, *, seed: int) -> dict[str, Any]:
    """Draw random values of every member of an ensemble: name -> values (members,), independent of each other, as `ensemble` takes them.

    Numbers are SI; temperatures are a `thermid.base.units.Quantity`, an array of kelvin by ``np.asarray``.

    Parameters
    ----------
    model, scenario     As in `simulate`; they give the values that are spread, and their units.
    spreads : dict      Name as in `ensemble` -> spread: ``"0.5 [W]"``, ``"10 [%]"``, ``{"log_sd": 0.2}``, ``"range"`` or
                        ``{"low": "4 [W]", "high": "6 [W]"}``. "Spreads" in docs/files.md says what each means.
    members : int       How many to draw.
    seed : int          The same seed gives the same values; a name's values do not depend on what else is drawn.

    Raises
    ------
    NameNotFoundError   When a name does not exist.
    ScenarioError       When a spread is none of these forms.
    UnitError           When a number has another dimension than what it spreads.
    """
    if members < 1:
        raise ScenarioError("an ensemble needs at least one member.", model.title, code="value.outside-range")
    ready = prepare(model, scenario if scenario.seconds > 0 else scenario.with_(duration=1.0), tuple(spreads))
    laws = {name: ready.law(name, spread) for name, spread in zip(ready.free, spreads.values(), strict=True)}
    return ready.with_units({name: law.at(uniforms(seed, name, 0, members)) for name, law in laws.items()})
