"""The engine: a problem of the kernel run by modes, by its integrator or by that of large networks; an answer or an error in words.

Also where a network settles: steady, at the mean of its inputs, or in the state that comes back after a period.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from thermid import _kernel
from thermid.base.errors import CodedText, ScenarioError, SolverError, refuse_first, refuse_unknown
from thermid.base.units import ICE_POINT, Array, value_of
from thermid.model.tree import Constant, Sine, TableSignal
from thermid.simulation._network.controls import PHASE, state_of
from thermid.simulation._network.network import held_in, unreached
from thermid.simulation._scenarios.scenario import MEAN, STEADY
from thermid.simulation._solver.large import METHODS as LARGE_METHODS, Gone, integrate_model, refusal, seconds_by_steps, settle_model
from thermid.simulation._solver.problem import (
    MAX_INTEGRATED_NODES,
    Answer,
    KernelProblem,
    Options,
    Traces,
    by_column,
    ends_steps,
    flow_between_masses,
    ints,
    unsettled,
)
from thermid.simulation._solver.wiring import Assembled, Wiring


class Runner(Protocol):
    """Interface of a program that runs a model in place of the kernel, such as an FMU."""

    @property
    def remarks(self) -> tuple[str, ...]:
        """Remarks for the reader of a fit, in words."""
        ...

    @property
    def starts(self) -> Mapping[str, float]:
        """Node whose start can be set -> its own start. [K]"""
        ...

    @property
    def powers(self) -> Mapping[str, float]:
        """Load -> its power where the scenario gives none [W], or a plain number for an input without a unit."""
        ...

    def run(self, engine: Engine, a: Assembled, times: Array, nodes: Sequence[str], end: float, gradients: bool) -> Answer:
        """Return temperatures of nodes at times, as `Engine.integrate` does."""
        ...


LOSSES = {"linear": _kernel.SQUARE, "soft_l1": _kernel.SOFT_L1, "huber": _kernel.HUBER, "cauchy": _kernel.CAUCHY}


@dataclass(frozen=True, eq=False)
class Weighing:
    """Weights with which the readings of a run are compared: standard deviations, constant errors and the loss function.

    Parameters
    ----------
    sigma, bias : array (channels,)     Standard deviation, and constant error that is taken off. [K]
    column : array (channels,)          Column of the constant error among those looked for; -1 for none.
    loss : str                          linear, soft_l1, huber or cauchy.
    knee : float                        Residual, in units of sigma, from which a robust loss bends.
    """

    sigma: Array
    bias: Array
    column: NDArray[np.int32]
    loss: str = "linear"
    knee: float = 1.0


@dataclass(frozen=True, eq=False)
class Squares:
    """The least squares of a run: with J the derivatives of all weighted residuals r, ``R'R = J'J`` and ``R'z = J'r``.

    Parameters
    ----------
    triangle : array (columns, columns)     R; columns are the free names, then the constant errors looked for.
    rotated : array (columns,)              z.
    cost : float                            Sum of the loss over all residuals, the sum of squares for a linear one. [-]
    chi_square : float                      Sum of squares, each weighed as a robust loss weighs it. [-]
    sums : array (channels, 7)              Of each channel's residuals, as `thermid.fit._problem.residuals.Sums` has them. [K]
    mesh : array (steps,)                   When the integrator's steps ended. [s]
    """

    triangle: Array
    rotated: Array
    cost: float
    chi_square: float
    sums: Array
    mesh: Array


MOST_ITERATIONS = 200
DIRECT = 40
"""Steps of Newton's method before its search is taken for stuck at the knee of a table."""
DRIFT = 1.12
"""By how much each step of the search in time is longer than the one before."""
MAX_NEWTON_STEP = 1e-10
LARGEST_MOVE = 100.0
MAX_TEMPERATURE = 1e5
"""Above this nothing that a model means is left, here as in runs over time. [K]"""
BOUNDARY_SLOPE_STEP = 0.01
"""Change of temperature over which the heat that a boundary takes is differenced. [K]"""
MAX_CYCLE_PERIODS = 40
"""Periods that are run until a state comes back."""
MAX_RETURN_ERROR = 2e-6
"""How far a state that comes back may miss itself. [K]"""
FINE = Options(error=2.0 * MAX_RETURN_ERROR, inputs=1e-4)
"""Of the runs over a period that look for it."""
METHODS = ("auto", "integrator", "modal")
"""Methods of ordinary models by the name that `Options.method` gives them."""
REMEMBERED_LENGTHS = 64  # lengths of stretches that the kernel has in mind, at least
WITHOUT_LARGE = 60
"""Nodes below which no network is worth the methods of large ones."""
MAX_NODES_FOR_MODES = 300  # nodes beyond which modes cost more than any noise asks of steps


class Exact(NamedTuple):
    """Answer of the kernel for a modal run: status, node and time [s] of a failure, stretches, temperatures [K], heats [J], turnings."""

    status: int
    node: int
    time: float
    steps: int
    traces: Array
    final: Array
    load_energy: Array
    boundary_energy: Array
    turnings: tuple[Any, Array, Array]


@dataclass(frozen=True)
class Effort:
    """Amounts of work of a run, from which the time of each method is estimated.

    Parameters
    ----------
    nodes : int         Nodes of the reduced network.
    stretches : int     From knot to knot of the sampled inputs and from output to output.
    fresh : int         Stretches that need exponentials of their own: those of a length that the kernel has not in mind.
    outputs : int       Output times.
    sampled : int       Sampled inputs.
    waves : int         Sinusoidal inputs.
    stops : int         Knots at which the integrator ends a step.
    steps : float       Steps of the integrator between knots at which it ends one.
    """

    nodes: int
    stretches: int
    fresh: int
    outputs: int
    sampled: int
    waves: int
    stops: int
    steps: float

    @property
    def modal(self) -> float:
        """Estimated time of the modal solution, a fit to measurements (docs/design/simulation.md). [s]"""
        n = self.nodes
        march = self.stretches * (15.0 + 0.25 * n * (1 + self.sampled)) + self.fresh * (400.0 + 50.0 * n)
        write = self.outputs * (n * (1.0 + 0.1 * n) + 30.0 * self.waves)
        return 1e-9 * (10e3 + 100.0 * n**2 + 12.0 * n**3 + march + write)

    @property
    def integrator(self) -> float:
        """Estimated time of the integrator where nothing is stiff, a fit to measurements. [s]"""
        n = self.nodes
        step = 700.0 + 340.0 * n + 0.012 * n**3 + (400.0 if self.sampled else 0.0)
        read = 30.0 * self.stretches if self.sampled else 0.0
        write = self.outputs * (15.0 + 2.0 * n + (25.0 if self.sampled else 0.0))
        return 1e-9 * (40e3 + (self.steps + self.stops) * step + read + write)


class Modal:
    """The modal solution of one wiring: whether it is possible, when it pays, and how it is run; the same for all values of unknowns.

    Parameters
    ----------
    wiring : Wiring
    problem : Problem       The kernel's.
    """

    def __init__(self, wiring: Wiring, problem: _kernel.Problem) -> None:
        self.wiring = wiring
        self.problem = problem
        self.obstacle = _obstacle(wiring)
        self._grids: dict[tuple[float, ...], tuple[int, int]] = {}
        self._pace: tuple[float, float] | None = None

    def refusal(self, method: str, times: Array, end: float, gradients: bool) -> str:
        """Return why the integrator is used instead of the modes, in words; empty where the modes are used.

        Raises
        ------
        ScenarioError   When the modes are asked for and the network has none.
        """
        if method == "integrator":
            return "asked for"
        why = self.obstacle or ("derivatives come from the integrator" if gradients else "")
        if method == "modal" and why:
            raise ScenarioError(
                f"the modal solution is not possible: {why}. Leave 'method' at 'auto'.",
                f"{self.wiring.network.title}, {self.wiring.scenario.title}",
                code="model.element-not-supported",
            )
        if why or method == "modal":
            return why
        work = self.work(times, end)
        slower = f"an estimated {1e3 * work.modal:.2g} ms by modes, {1e3 * work.integrator:.2g} ms by steps"
        return "" if work.modal <= work.integrator else slower

    def work(self, times: Array, end: float) -> Effort:
        """Return the amounts of work of a run to `end` [s] with outputs at times (times,) [s].

        Of modal steps: their intervals and how many different lengths there are, since a repeated one costs no new matrix. Of stepwise
        ones: max(20 ln(1 + r end), k end), r the fastest rate [1/s] and k the rate at which inputs bend. [1/s]
        """
        signals = [self.wiring.signals[name] for name in self.wiring.used]
        tables = [s for s in signals if isinstance(s, TableSignal)]
        key = (times.size, float(times[:1].sum()), float(times[-1:].sum()), end)
        if key not in self._grids:
            grid = np.sort(np.concatenate((times, [0.0, end], *(s.times for s in tables))))
            gaps = np.diff(grid[(grid >= 0.0) & (grid <= end)])
            gaps = gaps[gaps > 1e-15 * end]
            # where equal lengths start; numpy.unique would load numpy.ma, which nothing else of a first result needs
            equal = np.flatnonzero(np.diff(np.sort(gaps.astype(np.float32)), prepend=-1.0))
            often = np.sort(np.diff(equal, append=gaps.size))[-REMEMBERED_LENGTHS:]
            self._grids[key] = gaps.size, gaps.size - int(often.sum()) + often.size
        stops = sum(s.times.size for s in tables if ends_steps(s))
        waves = sum(isinstance(s, Sine) for s in signals)
        if self._pace is None:
            self._pace = self._rates_of_steps()
        fastest, rough = self._pace
        steps = max(20.0 * np.log1p(fastest * end), rough * end)
        return Effort(self.problem.nodes, *self._grids[key], times.size, len(tables), waves, stops, float(steps))

    def _rates_of_steps(self) -> tuple[float, float]:
        """Return the largest rate -J_ii / C_i of a node, and how many steps a second the noise of inputs asks of the integrator. [1/s]

        Both are 0 in a network of more than `MAX_NODES_FOR_MODES` nodes, which is not solved by modes. Taken at nominal values, so that the
        choice of method does not hang on which run came first.
        """
        if self.problem.nodes > MAX_NODES_FOR_MODES:
            return 0.0, 0.0
        a = self.wiring.assemble(gradients=False)
        capacity = np.array([np.inf if c < 0 else a.coefficients[c] for c in self.wiring.structure.capacity])
        _, jacobian, _ = self.problem.rhs(a.coefficients, a.initial, 0.0)
        rates = -jacobian / capacity[:, None]  # C dT/dt = J T: a node settles at the rate -J_ii / C_i
        return float(np.diag(rates).max()), max((self._roughness(name, a, capacity, rates) for name in self.wiring.used), default=0.0)

    def _roughness(self, name: str, a: Assembled, capacity: Array, rates: Array) -> float:
        """Return how many steps a second an input's noise asks of the integrator. [1/s]

        12 (b k^2 r sqrt(d))^(2/5), where a node of rate k [1/s] is moved by the input at a rate b, r is the size of the noise [K] and d
        the time between samples [s]: fitted to steps counted over noises from 2 mK to 0.5 K, right within 2.5 times
        (docs/design/simulation.md). `capacity` (nodes,) [J/K]; `rates` (nodes, nodes) [1/s].
        """
        signal, s = self.wiring.signals[name], self.wiring.structure
        if not isinstance(signal, TableSignal) or ends_steps(signal):
            return 0.0
        # second differences of white noise have 1 + 4 + 1 times its variance, and next to nothing of what the readings follow
        noise = float(np.sqrt(np.mean(np.diff(signal.values, 2) ** 2) / 6.0))
        moved = np.zeros(capacity.size)
        if name.startswith("boundary "):
            moved = rates.sum(axis=1)  # by all boundaries: which of them is the noisy one hardly matters
        for _, node, places, _, _ in s.loads:
            if s.coefficient_input[places[0]] == self.wiring.used[name] and node < capacity.size:
                moved[node] += a.coefficients[places[0]] / capacity[node]
        jolt = np.abs(moved) * np.diag(rates) ** 2 * noise * np.sqrt(np.median(np.diff(signal.times)))
        return float(12.0 * jolt.max() ** 0.4)

    def run(
        self, a: Assembled, times: Array, nodes: NDArray[np.int32], end: float, turnings: bool = False, sums: tuple[Any, ...] | None = None
    ) -> Exact:
        """Run the modal solution from zero to `end` [s]: temperatures of `nodes` (by number) at `times` (times,) [s].

        With `turnings` also the turning points of these nodes and of weighted `sums`, see `Engine._sums`.
        """
        wanted = np.ascontiguousarray(times, dtype=float)
        return Exact(*_kernel.modal(self.problem, a.coefficients, a.initial, 0.0, float(end), wanted, nodes, turnings, sums))


def _obstacle(wiring: Wiring) -> str:
    """Return in words why a network is not linear with constant, symmetric coefficients; empty where it is, so that modes exist."""
    s = wiring.structure
    named: Mapping[int, str] = {k: name for name, k in wiring.used.items()}

    if s.edges:
        return "the instants of jumps are free"
    if s.driven:
        return f"a control, '{s.factors[0].row.name}', follows a temperature"

    def moves(place: int) -> bool:
        """Whether the coefficient at a place follows time."""
        k = s.coefficient_input[place]
        return k >= 0 and not isinstance(wiring.signals[named[k]], Constant)

    for row, _, _, places in s.conductors:
        form, name = row.form, row.name
        if form == "flow":
            return f"'{name}' carries heat one way, so the network is not symmetric"
        if (node := name.removesuffix(held_in(""))) in wiring.network.stores and name == held_in(node):
            return f"'{node}' stores heat by a table"
        if form != "linear":
            return f"the law of '{name}' is not linear"
        if moves(places[0]):
            return f"the conductance of '{name}' changes in time"
    for load in s.loads:
        if not load.row.fixed:
            return f"the power of '{load.row.name}' depends on temperature"
    return ""


class Engine(KernelProblem):
    """A problem of the kernel with the ways to run it."""

    def __init__(self, wiring: Wiring) -> None:
        super().__init__(wiring)
        self.modal = Modal(wiring, self.problem)

    @property
    def runner(self) -> Runner | None:
        """The program that runs the model in place of the kernel; None for the kernel itself."""
        return self.wiring.network.flat.names.model.runner  # type: ignore[no-any-return]

    def _runs_as_large(self, options: Options, gradients: bool, times: Array, end: float) -> bool:
        """Return whether a model is run as a large network: asked for by name, or of a form that can be and cheaper so.

        Raises
        ------
        ScenarioError   When the method does not exist, or cannot run this model.
        """
        method = options.method
        if method not in LARGE_METHODS and method not in METHODS:
            methods = dict.fromkeys((*METHODS, *LARGE_METHODS))
            refuse_unknown([method], methods, self.title, "unknown method '{}'.{near} There are {known}.", ScenarioError)
        if method not in LARGE_METHODS or (method == "auto" and len(self.nodes) < WITHOUT_LARGE):
            return False
        why = (
            "sensitivities are requested, which large networks do not have"
            if gradients
            else self.memo.value("refusal", lambda: refusal(self))
        )
        if why and method != "auto":
            raise ScenarioError(
                f"method '{method}' cannot run this model: {why}. Leave the method out.", self.title, code="model.element-not-supported"
            )
        if why or method != "auto" or len(self.nodes) > MAX_INTEGRATED_NODES:
            return not why
        projected = any(isinstance(s, TableSignal) and not ends_steps(s) for s in self.inputs)
        steps, large = seconds_by_steps(self, options.error, projected)
        return large < steps and (bool(self.modal.obstacle) or large < self.modal.work(times, end).modal)

    def integrate(
        self,
        a: Assembled,
        times: Array,
        nodes: Sequence[str],
        end: float,
        options: Options,
        gradients: bool = False,
        extremes: bool = False,
    ) -> Answer:
        """Run the numbers `a` from zero to `end` [s] by the method of the options; temperatures of `nodes` at `times` (times,) [s].

        With `gradients` also their derivatives with respect to the free names, with `extremes` their turning points between the times.

        Raises
        ------
        SolverError     When the run ends before its time.
        ScenarioError   When the modal solution is asked for and there is none.
        """
        if (runner := self.runner) is not None:
            return runner.run(self, a, times, nodes, end, gradients)
        if self._runs_as_large(options, gradients, times, end):
            return integrate_model(self, a, times, nodes, end, options, self._sums(a) if extremes else None)
        index = self._index()
        why = self.modal.refusal(options.method, times, end, gradients)
        if not why:
            return self._by_modes(a, times, nodes, end, options, extremes)
        gone, sums = self._sums(a) if extremes else ((), None)
        raw = self.problem.integrate(
            a.coefficients,
            a.initial,
            0.0,
            float(end),
            np.ascontiguousarray(times, dtype=float),
            ints([index[n] for n in nodes]),
            turnings=extremes,
            sums=sums,
            **self.settings(options, end),
            **self.gradients(a, gradients),
        )
        if raw.status != _kernel.OK:
            raise SolverError(self.message(raw, options, end, a), self.title, code="run.did-not-finish")
        statistics = {
            "method": "integrator",
            "reason": why,
            "steps": raw.steps,
            "rejected": raw.rejected,
            "switchings": [(float(t), self.control_names[k]) for t, k in zip(raw.event_times, raw.event_controls, strict=True)],
        }
        flows = raw.conductor_energy[self.flow_rows] if self.flow_rows.size else np.zeros(0)
        slopes = raw.sensitivities if raw.sensitivities is not None else np.zeros((times.size, len(nodes), 0))
        events = (raw.event_times, raw.event_controls, raw.event_states, raw.event_before)
        switched = tuple(zip(*(column.tolist() for column in events), strict=True))
        energies = (raw.load_energy[: len(self.load_names)], raw.boundary_energy, flows)
        turnings = dict(zip((*nodes, *gone), by_column(raw.turnings, len(nodes) + len(gone)), strict=True)) if extremes else None
        return Answer(raw.traces, slopes, a.initial, raw.final_temperatures, *energies, end, statistics, raw.on, switched, turnings)

    def _by_modes(self, a: Assembled, times: Array, nodes: Sequence[str], end: float, options: Options, extremes: bool) -> Answer:
        """Return temperatures [K] at `times` [s] and no derivatives, as `integrate` does, calculated by the modal solution.

        Raises
        ------
        SolverError   When the kernel's run does not end.
        """
        index = self._index()
        gone, sums = self._sums(a) if extremes else ((), None)
        raw = self.modal.run(a, times, ints([index[n] for n in nodes]), end, extremes, sums)
        if raw.status != _kernel.OK:
            raise SolverError(self.message(raw, options, end, a), self.title, code="run.did-not-finish")
        slopes = np.zeros((times.size, len(nodes), 0))
        statistics = {"method": "modal", "reason": "", "steps": raw.steps, "rejected": 0, "switchings": []}
        energies = (raw.load_energy, raw.boundary_energy, np.zeros(0))
        off = np.zeros(len(self.control_names), dtype=np.int32)
        turnings = dict(zip((*nodes, *gone), by_column(raw.turnings, len(nodes) + len(gone)), strict=True)) if extremes else None
        return Answer(raw.traces, slopes, a.initial, raw.final, *energies, end, statistics, off, (), turnings)

    def _sums(self, a: Assembled) -> Gone:
        """Return the eliminated nodes, and their weights on nodes and boundaries as (begins, places, weights); (), None without any."""
        index = self._index()
        parts: dict[str, dict[int, float]] = {}
        for node, star in a.reduced.recover:
            weights: dict[int, float] = {}
            for neighbour, weight in star.items():
                for place, share in (parts[neighbour] if neighbour in parts else {index[neighbour]: 1.0}).items():
                    weights[place] = weights.get(place, 0.0) + value_of(weight) * share
            parts[node] = weights
        if not parts:
            return (), None
        begin = ints(np.cumsum([0, *(len(p) for p in parts.values())]))
        places = ints([k for p in parts.values() for k in p])
        return tuple(parts), (begin, places, np.array([w for p in parts.values() for w in p.values()], dtype=float))

    def members(
        self, coefficients: Array, initial: Array, times: Array, nodes: Sequence[str], end: float, options: Options, simd: str
    ) -> Any:
        """Return the kernel's ensemble for coefficients (coefficients, members) [SI] and initial temperatures (nodes, members) [K].

        Raises
        ------
        ScenarioError   When the machine lacks the instruction set `simd`.
        """
        sets = ("auto", *_kernel.instruction_sets())
        refuse_unknown([simd], sets, "simd", "this processor has no instruction set '{}'. Give one of {known}.", ScenarioError)
        return _kernel.Ensemble(
            self.problem,
            np.ascontiguousarray(coefficients),
            np.ascontiguousarray(initial),
            0.0,
            float(end),
            np.ascontiguousarray(times, dtype=float),
            ints([self.nodes.index(n) for n in nodes]),
            turnings=options.extremes,
            simd=simd,
            **self.settings(options, end),
        )

    def readings(
        self,
        times: Array,
        parts: Sequence[Sequence[str]],
        index: Sequence[NDArray[np.int64]],
        values: Sequence[Array],
        scaled: Sequence[bool] = (),
    ) -> Any:
        """Return the readings of channels in the kernel's form.

        Parameters
        ----------
        times : array (times,)      Common times of all channels. [s]
        parts : sequence            Of each channel the nodes whose weighted sum it reads, one or more.
        index : sequence            Of each channel the places of its readings in `times`.
        values : sequence           Of each channel its readings. [K]
        scaled : sequence           Of each channel whether its node counts by a weight that every evaluation gives.
        """
        place = self._index()
        nodes = [place[n] for names in parts for n in names]
        flat = np.concatenate([*index, np.zeros(0, dtype=np.int64)])
        ends = ints(np.cumsum([0, *(len(names) for names in parts)])), ints(np.cumsum([0, *(i.size for i in index)]))
        return _kernel.Readings(
            self.problem,
            np.ascontiguousarray(times),
            ints(nodes),
            ends[0],
            ints(flat),
            ends[1],
            np.concatenate(values),
            ints(np.array(scaled, dtype=np.int64)) if any(scaled) else None,
        )

    def least_squares(
        self,
        a: Assembled,
        readings: Any,
        parts: tuple[Array, Array],
        weighing: Weighing,
        end: float,
        options: Options,
        gradients: bool = False,
        mesh: Array | None = None,
    ) -> Squares:
        """Run the numbers `a` and return the least squares of readings, with derivatives or without; no temperature is stored.

        Parameters
        ----------
        a : Assembled           The run's numbers.
        readings                As `readings` made them.
        parts : two arrays      What each node of a channel counts, and the derivatives of that (parts, free).
        weighing : Weighing     What the readings are compared by.
        end : float             The run starts at zero. [s]
        options : Options       Tolerances.
        gradients : bool
        mesh : array            Ends of steps to take, those of an earlier run: sums of squares then differ by what the values differ, and
                                not by how the steps fell. [s]

        Raises
        ------
        SolverError   When the run ends before its time.
        """
        w = weighing
        raw = _kernel.least_squares(
            self.problem,
            readings,
            a.coefficients,
            a.initial,
            0.0,
            float(end),
            sigma=w.sigma,
            bias=w.bias,
            bias_column=w.column,
            weight=parts[0],
            slope=parts[1],
            loss=LOSSES[w.loss],
            knee=w.knee,
            mesh=mesh,
            **self.settings(options, end),
            **self.gradients(a, gradients),
        )
        if raw.status != _kernel.OK:
            raise SolverError(self.message(raw, options, end, a), self.title, code="run.did-not-finish")
        return Squares(raw.triangle, raw.rotated, raw.cost, raw.chi_square, raw.sums, raw.mesh)

    def started(self, a: Assembled, gradients: bool = False) -> Assembled:
        """Return the numbers with their start solved for where the scenario asks for a steady or periodic one (NaN until then).

        Raises
        ------
        ScenarioError   When the start is that of an FMU, or the scenario gives some temperatures itself.
        SolverError     When there is no such state.
        """
        unknown, start = np.isnan(a.initial), self.wiring.start
        if not unknown.any():
            return a
        refuse_first(
            self.wiring.scenario.title,
            (
                self.runner is not None,
                "an FMU has no steady start here. Give a temperature as its start.",
                "model.element-not-supported",
            ),
            (
                not unknown.all(),
                "a steady start gives the temperatures of all nodes. Leave 'initial' out.",
                "value.excludes-another",
            ),
            error=ScenarioError,
        )
        if start is None or start.kind == STEADY:
            temperatures, slopes = settle(self, a, start.time if start is not None else 0.0, gradients)
        else:
            temperatures, slopes = settle(self.still, a, 0.0, gradients)
            temperatures, slopes = (temperatures, slopes) if start.kind == MEAN else _periodic(self, a, temperatures, slopes, gradients)
        return replace(a, initial=temperatures, initial_gradient=slopes if gradients else a.initial_gradient)


def settle(problem: KernelProblem, a: Assembled, time: float, gradients: bool = False) -> tuple[Array, Array]:
    """Return the steady temperatures (nodes,) [K] with the inputs of one time held, and their derivatives (nodes, free).

    Raises
    ------
    SolverError   As in `at_rest`.
    """
    return at_rest(problem, a, time, gradients)[:2]


def at_rest(problem: KernelProblem, a: Assembled, time: float, gradients: bool = False) -> tuple[Array, Array, NDArray[np.int32]]:
    """Return what `settle` does with the inputs at `time` [s], and the states (controls,) of thermostats and of controls with modes.

    The state of a thermostat that goes by temperature is -1. Controls with modes begin in their first and go on to those that the
    temperatures found ask for, until they rest.

    Raises
    ------
    SolverError   When there is no steady state: a part without a path to a boundary, a power that runs away, a control that keeps
                  switching.
    """
    machines = [p.row for p in problem.wiring.structure.factors if p.row.modes]
    visited: set[bytes] = set()
    on = np.full(len(problem.control_names), -1, dtype=np.int32)
    first = len(problem.control_names) - len(machines)
    on[first:] = [row.starts for row in machines]
    while True:
        temperatures, slopes = _settle_in_modes(problem, a, time, gradients, on)
        changed = _next_mode(problem, a, temperatures, time, on[first:]) if machines else None
        if changed is None:
            return temperatures, slopes, on
        visited.add(on.tobytes())
        on[first + changed[0]] = changed[1]
        if on.tobytes() in visited:
            name = machines[changed[0]].name
            message = f"no steady state exists: the control '{name}' keeps switching. Simulate, and use the mean over a late period."
            raise SolverError(message, problem.title, code="run.no-steady-state")


def _next_mode(problem: KernelProblem, a: Assembled, temperatures: Array, time: float, modes: NDArray[np.int32]) -> tuple[int, int] | None:
    """Return the first control, by position, that does not rest in its mode at steady temperatures (nodes,) [K], and the next mode.

    None where all rest. `time` [s] is that of the signals, `modes` (controls,) are today's.
    """
    wiring, now = problem.wiring, np.array([time])
    traces = Traces(wiring, a, now, problem.nodes, temperatures[None, :], np.zeros((1, temperatures.size, 0)))
    rows = {row.name: row for row in a.numbers.controls}
    for k, name in enumerate(problem.machines):

        def signal(place: int, of: str = name) -> float:
            """Return what a setting of the control is multiplied by now."""
            return float(np.ravel(wiring.control_signal(of, place, now))[0])

        after = rows[name].due(int(modes[k]), lambda n: float(traces.temperature(n)[0]), signal)
        if after is not None:
            return k, after
    return None


def _settle_in_modes(problem: KernelProblem, a: Assembled, time: float, gradients: bool, on: NDArray[np.int32]) -> tuple[Array, Array]:
    """Return the steady temperatures (nodes,) [K] and their derivatives (nodes, free), every control kept in its mode `on` (controls,).

    Newton's J s = -q on the net heat q with the inputs at `time` [s], steps by `_damped_step`; later steps of a pseudo time. Derivatives
    are -J^-1 dq/dp.
    """
    steady = None if gradients else settle_model(problem, a, time)
    if steady is not None:
        return steady, np.zeros((steady.size, 0))
    network, where = problem.wiring.network, problem.title
    outside = [float(problem.wiring.boundary(b, np.array([time]), a.offsets)[0]) for b in network.boundaries]
    base = float(np.mean(outside)) if outside else ICE_POINT + 20.0
    # a small offset keeps the conductance of natural convection above zero at the start
    balance = _Balance(problem, a, time, on)
    temperatures = np.full(balance.size, base + 1.0)
    reach = LARGEST_MOVE
    for k in range(MOST_ITERATIONS):
        heat, jacobian, slopes = balance(temperatures, gradients)
        leaving = balance.leaving(temperatures, jacobian, outside)
        step = _solve_balance(jacobian, leaving, heat)
        if step is None:
            raise SolverError(_no_steady(problem, a), where)
        close = float(np.abs(step).max()) < MAX_NEWTON_STEP * max(1.0, float(np.abs(temperatures).max()))
        if k < DIRECT or close:
            temperatures = _damped_step(balance, temperatures, step, float(np.linalg.norm(heat)), reach)
            # a state far away lies in one direction: steps towards it get longer
            reach = 2.0 * reach if float(np.abs(step).max()) > reach else LARGEST_MOVE
            if float(temperatures.max()) > MAX_TEMPERATURE:
                node = np.array(problem.nodes)[balance.own][int(temperatures.argmax())]
                raise SolverError(
                    f"at rest '{node}' would be above {MAX_TEMPERATURE:,.0f} K: more heat is supplied than its paths to a boundary "
                    "carry. Check its power and these conductances; a unit may be wrong.",
                    where,
                    code="run.no-steady-state",
                )
        else:
            temperatures = _pseudo_time_step(temperatures, heat, jacobian, k - DIRECT)
        if close:
            # what only loses heat is stable; rounding of large entries would say otherwise
            if leaving is None and np.linalg.eigvals(jacobian).real.max() > 0:
                raise SolverError(
                    "the steady state is unstable: a power grows faster with temperature than the heat removed. Check "
                    "the temperature coefficients of the loads.",
                    where,
                    code="run.no-steady-state",
                )
            _, jacobian, slopes = balance(temperatures, gradients)
            if beyond := problem.tables_left(a, time, balance.states(temperatures)):
                raise SolverError(f"in the steady state {beyond}", where, code="run.no-steady-state")
            moves = _solve_balance(jacobian, leaving, slopes) if slopes is not None else np.zeros((temperatures.size, 0))
            if moves is None:
                raise SolverError(_no_steady(problem, a), where)
            return balance.states(temperatures), balance.moves(temperatures, moves)
    if any(row.control == "thermostat" for row in a.numbers.loads):
        raise SolverError(
            "no steady state exists: a thermostat keeps switching. Simulate, and use the mean over a late period.",
            where,
            code="run.no-steady-state",
        )
    raise SolverError(unsettled(problem.follows), where, code="run.no-steady-state")


class _Balance:
    """Net heat of every node as a function of temperatures, with the inputs of one time and all modes fixed.

    A node that stores heat by a table and the extra node of its heat are one unknown here: at rest the heat follows from the temperature,
    so that a melting point is no obstacle.
    """

    def __init__(self, problem: KernelProblem, a: Assembled, time: float, on: NDArray[np.int32]) -> None:
        self.problem, self.a, self.time, self.on = problem, a, time, on
        place = {n: k for k, n in enumerate(n for n in problem.nodes if n not in a.reduced.stored)}
        self.size = len(place)
        self.place = np.array([place[a.reduced.stored[n][0] if n in a.reduced.stored else n] for n in problem.nodes], dtype=np.intp)
        self.own = np.array([n not in a.reduced.stored for n in problem.nodes], dtype=bool)
        liquid = {name for name, mode in zip(problem.control_names, on, strict=True) if mode == 1}
        self.held = [
            (k, store, state_of(node, PHASE) in liquid)
            for k, n in enumerate(problem.nodes)
            if n in a.reduced.stored
            for node, store in [a.reduced.stored[n]]
        ]

    def __call__(self, temperatures: Array, gradients: bool = False) -> tuple[Array, Array, Array | None]:
        """Return net heat (nodes,) [W], its Jacobian [W/K] and its derivatives (nodes, free) at temperatures (nodes,) [K]."""
        heat, jacobian, slopes = self.problem.rhs(self.a, self.states(temperatures), self.time, gradients, self.on)
        if not self.held:
            return heat, jacobian, slopes
        return self._sum(heat), self._sum(jacobian)[:, self.own], None if slopes is None else self._sum(slopes)

    def leaving(self, temperatures: Array, jacobian: Array, outside: Sequence[float]) -> Array | None:
        """Return the heat per kelvin (nodes,) that each node loses to boundaries [W/K]; None where that is not all that the network loses.

        The columns of the `jacobian` J (nodes, nodes) [W/K] of the heat into nodes sum to minus it, but only to rounding of their largest
        entry: a weak path to a boundary beside a strong one between nodes would be lost. So the conductors that end at a boundary are
        asked by themselves, by central differences; `outside` are the temperatures of boundaries [K]. What follows temperatures, what goes
        one way and powers that depend on temperature are left to the Jacobian as it is.
        """
        s, size = self.problem.wiring.structure, temperatures.size
        beside = jacobian - np.diag(np.diag(jacobian))
        if self.held or s.factors or s.driven or any(p.row.form != "signal" for p in s.loads) or (beside < 0.0).any():
            return None
        outer = np.asarray(outside, dtype=float)
        nudged = np.array([[*(temperatures + d), *outer] for d in (-BOUNDARY_SLOPE_STEP, BOUNDARY_SLOPE_STEP)])
        flows = np.asarray(self.problem.held.flows(self.a.coefficients, nudged, np.full(2, float(self.time))))
        out = np.zeros(size)
        # central difference along a rise of all nodes alike: row sums of -J, from the conductors at the boundary alone
        for k, p in enumerate(s.conductors):
            if p.a < size <= p.b:
                out[p.a] += (flows[1, k] - flows[0, k]) / (2.0 * BOUNDARY_SLOPE_STEP)
            elif p.b < size <= p.a:
                out[p.b] -= (flows[1, k] - flows[0, k]) / (2.0 * BOUNDARY_SLOPE_STEP)
        summed = -jacobian.sum(axis=0)
        near = np.abs(out - summed) <= 1e-4 * np.abs(out) + 1e-9 * np.abs(jacobian).sum(axis=0)
        return out if near.all() and (out >= 0.0).all() else None

    def _sum(self, rows: Array) -> Array:
        """Return rows (states, ...) with those of each heat store added to its node's: (nodes, ...)."""
        out: Array = rows[self.own].copy()
        for k, _, _ in self.held:
            out[self.place[k]] += rows[k]
        return out

    def states(self, temperatures: Array) -> Array:
        """Return the kernel's states (states,) from temperatures (nodes,): of a heat store the level at its temperature. [K]"""
        levels = temperatures[self.place]
        for k, store, liquid in self.held:
            levels[k] = float(store.level(levels[k], liquid))
        return levels

    def moves(self, temperatures: Array, moves: Array) -> Array:
        """Return the derivatives of the states (states, free) from `moves` dT/dx (nodes, free), both in K per SI unit.

        A node with a store has its level as state: du/dx = c(T) / c_ref dT/dx.
        """
        changes = moves[self.place]
        for k, store, liquid in self.held:
            changes[k] *= float(store.share(temperatures[self.place[k]], liquid))
        return changes


def _solve_balance(jacobian: Array, leaving: Array | None, heat: Array) -> Array | None:
    """Return x (nodes,) [K] with J x = -Q for the Jacobian J [W/K] and heat Q (nodes,) [W]; None where J is singular.

    With `leaving`, the heat per kelvin that each node loses to boundaries [W/K], by elimination without cancellation.
    """
    if leaving is not None:
        return solve_conserving(jacobian, leaving, heat)
    try:
        step = np.asarray(np.linalg.solve(jacobian, -heat), dtype=np.float64)
    except np.linalg.LinAlgError:
        return None
    return step if np.isfinite(step).all() and np.linalg.cond(jacobian) <= 1e15 else None


def _damped_step(balance: _Balance, temperatures: Array, step: Array, imbalance: float, reach: float) -> Array:
    """Return temperatures (nodes,) [K] after a step (nodes,) [K] cut to `reach` [K], halved until |heat| falls below `imbalance` [W].

    T + s / 2^k, s = step min(1, reach / max|step|), with the first k of 0 .. 19 for which |q(T + s / 2^k)| < imbalance; T + s where none
    is: at a knee whole steps would cycle. 0.1 K at least, since temperatures are absolute.
    """
    whole = step * min(1.0, reach / max(float(np.abs(step).max()), 1e-300))
    for halving in range(20):
        moved: Array = np.maximum(temperatures + 0.5**halving * whole, 0.1)
        if np.linalg.norm(balance(moved)[0]) < imbalance:
            return moved
    return np.maximum(temperatures + whole, 0.1)


def _pseudo_time_step(temperatures: Array, heat: Array, jacobian: Array, k: int) -> Array:
    """Return the temperatures after step k in time of a network whose nodes all have a time constant of one, steps getting longer.

    Each step is one of Newton's method for the implicit Euler method, which passes knees where the way of less heat left over ends before
    any balance.
    """
    # (J - D / dt) step = -Q, with D = |diag J| for the capacities and dt = DRIFT^k / 2 time constants
    pace = np.abs(np.diag(jacobian)) / (0.5 * DRIFT**k)
    step = np.asarray(np.linalg.solve(jacobian - np.diag(np.maximum(pace, 1e-300)), -heat), dtype=np.float64)
    return np.maximum(temperatures + step * min(1.0, LARGEST_MOVE / max(float(np.abs(step).max()), 1e-300)), 0.1)


def _no_steady(problem: KernelProblem, a: Assembled) -> CodedText:
    """Return why there is no steady state, in words: nodes without a path to a boundary, or singular equations."""
    # the powers with all nodes at the temperature of the first boundary at time zero
    outer = [problem.wiring.boundary(b, np.zeros(1), a.offsets)[0] for b in problem.wiring.network.boundaries]
    columns = np.array([[outer[0] if outer else ICE_POINT] * len(problem.nodes) + outer])
    powers = {name: float(p[0]) for name, p in problem.powers(a, columns, np.zeros(1)).items()}
    for imbalance in unreached(problem.wiring.network, a.numbers, lambda load: powers.get(load, 0.0)).values():
        return CodedText(f"no steady state exists: {imbalance}.", imbalance.code)
    look = "power that grows with temperature" if problem.follows else "node whose heat cannot leave"
    return CodedText(f"no steady state exists: the equations are singular. Look for a {look}.", "run.no-steady-state")


def _refuse_own_periods(engine: Engine, a: Assembled) -> None:
    """Refuse a periodic state where a thermostat or a control switches; a thermostat of a heater of 0 W switches nothing.

    Raises
    ------
    SolverError
    """
    heaters = [row.name for row in a.numbers.loads if row.control == "thermostat"]
    thermostat = any(engine.wiring.power(name, a.numbers).levels.any() for name in heaters)
    if thermostat or engine.machines:
        switch = "a thermostat" if thermostat else f"the control '{engine.machines[0]}'"
        raise SolverError(
            f"{switch} switches at its own period, so no state is periodic with the inputs. Simulate, and use a late part of the run.",
            engine.title,
            code="run.no-periodic-state",
        )


def _periodic(engine: Engine, a: Assembled, guess: Array, slopes: Array, gradients: bool) -> tuple[Array, Array]:
    """Return the state x (nodes,) that comes back after every period P of the inputs [K], and its derivatives (nodes, free).

    Newton's method x+ = x + (1 - M)^-1 (T(P) - x) from `guess` and `slopes`, those of the mean, with the monodromy matrix M = exp(P C^-1 J)
    of the network linearised there, mended after Broyden (Math. Comp. 19 (1965) 577) where it is not linear. A linear network takes one
    step, and one more that shows it.
    """
    from scipy.linalg import expm

    period, where = engine.wiring.cycle or 0.0, engine.title
    _refuse_own_periods(engine, a)
    if not period:  # constant inputs: their steady state comes back after any time
        return guess, slopes
    capacity = engine.capacities(a)
    massive = capacity > 0.0
    # a step s at the start comes back as exp(P C^-1 J) s, so (1 - exp(P C^-1 J)) s = T(P) - T(0) closes the period
    flow = flow_between_masses(engine.still.rhs(a, guess, 0.0)[1], massive)
    inverse: NDArray[Any] = np.linalg.inv(np.eye(int(massive.sum())) - expm(period * flow / capacity[massive][:, None]))

    def after(state: Array, moves: Array) -> tuple[Array, Array]:
        """Return the state one period later [K], and its derivatives."""
        run = replace(a, initial=state, initial_gradient=moves)
        raw = engine.integrate(run, np.array([period]), engine.nodes, period, FINE, gradients)
        return raw.temperatures[0], raw.sensitivities[0] if gradients else moves

    state, step, before = guess.copy(), np.zeros(0), np.zeros(0)
    for _ in range(MAX_CYCLE_PERIODS):
        end, _ = after(state, slopes)
        missed = (end - state)[massive]
        if step.size:
            # Broyden's first method: B + (s - B y) s'B / (s'B y), with step s and fall y of what it misses
            moved_by = inverse @ (before - missed)
            size = float(step @ moved_by)
            inverse = inverse if abs(size) < 1e-300 else inverse + np.outer(step - moved_by, step @ inverse) / size
        if float(np.abs(missed).max(initial=0.0)) < MAX_RETURN_ERROR:
            break
        step, before = inverse @ missed, missed
        held = state[massive]
        state = end.copy()
        state[massive] = np.maximum(held + step, 0.1)
    else:
        raise SolverError(
            f"no periodic state with a period of {period:g} s was found; the last residual is {np.abs(missed).max():.3g} K.",
            where,
            code="run.no-periodic-state",
        )
    for _ in range(MAX_CYCLE_PERIODS if gradients else 0):
        _, moved = after(state, slopes)
        change = inverse @ (moved - slopes)[massive]
        held = slopes[massive]
        slopes = moved.copy()
        slopes[massive] = held + change
        if float(np.abs(change).max(initial=0.0)) <= 1e-9 * float(np.abs(slopes).max(initial=1e-300)):
            break
    return state, slopes


def solve_conserving(gains: Array, leaving: Array, right: Array) -> Array | None:
    """Return x of A x = right, where A has -gains beside its diagonal and columns that sum to what leaves; None where A has no inverse.

    Elimination without a difference, so that every entry of x keeps its digits however many decades the entries of A span: the diagonal
    is never formed but as a sum of what leaves and what goes to the others (Grassmann, Taksar and Heyman, Oper. Res. 33 (1985) 1107; Alfa,
    Xue and Ye, Math. Comp. 71 (2002) 217).

    Parameters
    ----------
    gains : array (n, n)            What row i gains from column j, none below zero; the diagonal is not read. Such as W/K between nodes.
    leaving : array (n,)            What leaves each column for good, none below zero. Such as W/K to boundaries.
    right : array (n,) or (n, k)
    """
    size = leaving.size
    g, out, b = gains.astype(float), leaving.astype(float), right.astype(float).reshape(size, -1)
    np.fill_diagonal(g, 0.0)
    pivots = np.zeros(size)
    for k in range(size):
        rest = slice(k + 1, size)
        pivots[k] = out[k] + g[rest, k].sum()
        if not pivots[k] > 0.0:
            return None
        share = g[rest, k] / pivots[k]
        g[rest, rest] += share[:, None] * g[k, rest]
        out[rest] += g[k, rest] * (out[k] / pivots[k])
        b[rest] += share[:, None] * b[k]
    x = np.zeros_like(b)
    for k in reversed(range(size)):
        x[k] = (b[k] + g[k, k + 1 :] @ x[k + 1 :]) / pivots[k]
    return x.reshape(right.shape) if np.isfinite(x).all() else None
