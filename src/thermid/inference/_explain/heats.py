"""Heat that acts beside a model: an unlogged power in a stretch of time, a load of the deck that was off, air that moved."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import product
from operator import itemgetter

import numpy as np

from thermid.base.errors import ThermidError
from thermid.base.units import ICE_POINT, Array, duration_text, format_value, short
from thermid.fit.calibration import Calibration, Experiment, Influence, Request, Unknown, build_problem
from thermid.fit.power import ONE_TURN, SHAPES, PowerCourse, watts, with_load
from thermid.inference._explain.candidates import MissingElement, first_step, laid_open
from thermid.inference._explain.rough_fit import MAX_DESCENT_STEPS, MAX_RANKING_STEPS, RoughEnd, RoughFit
from thermid.inference._explain.structures import FittedStructure, linearised, starting_values
from thermid.inference._explain.thresholds import (
    IDLE_SHARE,
    MAX_HEATED_NODES,
    MAX_TRIED_LOADS,
    MAX_WINDOW_SEARCHES,
    PROMISED_STEP,
    PULSES,
    SIZES,
    START_UP_PRECISION,
    START_UP_TIMES,
    TELLING_DIFFERENCE,
    SizedValue,
)
from thermid.model.tree import FlatConductor, HeatLoad, Parameter, TableSignal
from thermid.simulation.runs import Scenario, Solution, prepare

HEAT_NAME = "unlogged_heat_"
AIR_KINDS = ("convection", "effective")


@dataclass(frozen=True, eq=False)
class Heat:
    """Heat of one shape and an amount to be found.

    Parameters
    ----------
    kind : str              'load' or 'fan'.
    name : str              Node, load or boundary.
    request : Request       That of the fit.
    experiment : int        The record in which it acts.
    flows : dict            Node -> (times [s], heat of the amount one [W]) where there is no window.
    window : (float, float) When it acts; throughout where it holds all of the record. [s]
    load : str              The load of the deck that it scales; empty where it is a heat of its own.
    sd : float              Standard deviation of the amount about zero. [W, or 1]
    span : float            Length of the record. [s]
    gain : float            Squares that it would take away by one step, in units of the errors. [-]
    """

    kind: str
    name: str
    request: Request
    experiment: int
    flows: Mapping[str, tuple[Array, Array]]
    window: tuple[float, float]
    load: str
    sd: float
    span: float
    gain: float = 0.0

    @property
    def when(self) -> str:
        """When it acts, in words."""
        first, last = self.window
        begins, ends = first > 0.01 * self.span, last < 0.99 * self.span
        if not (begins or ends):
            return "throughout"
        if begins and ends:
            return f"from {duration_text(first)} to {duration_text(last)}"
        return f"from {duration_text(first)} to the end" if begins else f"up to {duration_text(last)}"

    def words(self, amount: float) -> str:
        """Return the heat with an amount in words: W, or where it scales a load or an air flow, the change of its factor from 1."""
        if self.load:
            return f"the power of '{self.load}', which no log gives, was {100 * (1 + amount):.0f} % of the deck's"
        if self.kind == "fan":
            what = f"{short(1 + amount)} times as strong {self.when}"
            return f"the heat flow to '{self.name}' was {what}: a fan, a door, a draught, or an open cover"
        more = "more" if amount > 0 else "less"
        return f"'{self.name}' had {short(abs(amount))} W {more} than logs and deck state, {self.when}"

    def remedy(self, amount: float) -> str:
        """Return in one sentence what to change: log the power, give it in the scenario, or trim the log; the same for any amount."""
        first, last = self.window
        if self.load:
            return f"Log it, or give it in the scenario: loads = {{ {self.load} = '... [W]' }}."
        if self.kind == "fan":
            return f"Fit that part alone: prepare = [{{ trim = ['{first:.0f} [s]', '{last:.0f} [s]'] }}], or log the air flow."
        return "Find the heater or unit that is on there and log its power; 'thermid criticise' proposes its course."

    def fitted(self, fit: RoughFit, values_before: Mapping[str, float], rounds: int, fresh: bool = False) -> RoughEnd:
        """Return the end of the rough fit with this heat; `fresh` starts from the deck too."""
        return self.rough(fit).best(*([None] if fresh else []), values_before, rounds=rounds)

    def rough(self, fit: RoughFit) -> RoughFit:
        """Return the rough fit with the amount of this heat as an unknown; of a fan also with a small departure of each of its surfaces."""
        influences: tuple[Influence, ...] = (Influence(self.experiment, f"scale.{self.load}", 1.0),)
        request, acts = (self.request, influences) if self.load else self._request()
        low = -1.0 if self.load or self.kind == "fan" else -np.inf
        amounts = (
            [(Unknown(f"{HEAT_NAME}own_{t.name}", "power", (t,), 0.0), SIZES["surface"].spread) for t in acts]
            if self.kind == "fan" and len(acts) > 1
            else []
        )
        return RoughFit.of_request(request, fit, [*amounts, (Unknown(f"{HEAT_NAME}amount", "power", acts, 0.0, low=low), self.sd)])

    def placed(self, fit: RoughFit, base: RoughEnd) -> tuple[Heat, RoughEnd]:
        """Return this heat with the edges of its window where they fit best, and the end of the rough fit with it."""
        best, end = self, self.fitted(fit, fit.named(base), MAX_DESCENT_STEPS, fresh=True)
        if self.load:
            return best, end
        for _ in range(MAX_WINDOW_SEARCHES):
            values_before = best.rough(fit).named(end)
            windows = Pulses.of_record(self.request, fit, self.experiment).windows(best, values_before)
            others = [replace(best, window=w) for w in windows if w != best.window]
            tried = [(h, h.fitted(fit, values_before, MAX_DESCENT_STEPS)) for h in others]
            better = min(tried, key=lambda attempt: attempt[1].cost, default=(best, end))
            if better[1].cost > end.cost - 1.0:
                break
            best, end = better
        width = 0.5 * self.span / PULSES
        while width > 0.1 * self.span / PULSES:
            for side, step in product((0, 1), (-width, width)):
                edges = list(best.window)
                edges[side] = float(np.clip(edges[side] + step, 0.0, self.span))
                if edges[1] - edges[0] < 0.5 * self.span / PULSES or edges[side] == best.window[side]:
                    continue
                moved = replace(best, window=(edges[0], edges[1]))
                other = moved.fitted(fit, best.rough(fit).named(end), MAX_RANKING_STEPS)
                if other.cost < end.cost:
                    best, end = moved, other
            width *= 0.5
        return best, end

    def _request(self) -> tuple[Request, tuple[Influence, ...]]:
        """Return the request with a load for every node that the heat enters."""
        names = {node: f"{HEAT_NAME}{k}" for k, node in enumerate(self.flows)}
        tables = {names[node]: self._windowed(*self.flows[node]) for node in self.flows}
        with_loads = with_heats(self.request, self.experiment, {names[n]: n for n in self.flows}, tables)
        return with_loads, tuple(Influence(self.experiment, f"scale.{n}") for n in names.values())

    def _windowed(self, times: Array, watts: Array) -> TableSignal:
        """Return a course [W] that follows `watts` at `times` [s] inside the window and is zero outside."""
        first, last = self.window
        sharp = 1e-4 * self.span
        cuts = [t for edge in (first, last) for t in (edge - sharp, edge + sharp)]
        at = np.unique(np.clip([0.0, self.span, *times, *cuts], 0.0, self.span))
        inside = (at >= first) & (at <= last)
        return TableSignal(at, np.where(inside, np.interp(at, times, watts), 0.0), after="hold", before="hold")


def with_heats(request: Request, experiment: int, places: Mapping[str, str], tables: Mapping[str, TableSignal]) -> Request:
    """Return a request whose model has further loads, name -> node, with a course each in one of its records."""
    model = laid_open(request.model)
    loads = {n: HeatLoad(node, {"power": Parameter.read("0 [W]", n)}) for n, node in places.items()}
    scenarios = {}
    for i, r in enumerate(request.records):
        base = request.scenarios.get(r.name, request.scenarios.get("*")) or Scenario(r.name)
        scenarios[r.name] = base.with_(loads=dict(tables)) if i == experiment else base
    return replace(request, model=replace(model, loads={**model.loads, **loads}), scenarios=scenarios)


def air_flows(fit: RoughFit, end: RoughEnd, experiment: int, boundary: str) -> dict[str, tuple[Array, Array]]:
    """Return node -> the heat that leaves the boundary for it through moving air: (times (times,) [s], heat (times,) [W]).

    By the deck's law. It is that of a run at the deck's values, times (T - T_air) / (T_run - T_air), from 0 to 5; none where the run has
    less than `TELLING_DIFFERENCE` between node and air. T is the measured temperature of the node where it is observed, as that knows of
    the mistake, else that of the fit at `end`.

    Parameters
    ----------
    experiment : int    Which record of the fit.
    boundary : str      The air, whose temperature may be wrong.
    """
    e, times = fit.problem.experiments[experiment], fit.meshes[experiment][0]
    as_built, as_fitted = (_run_of(fit, x, experiment) for x in (fit.start(), end.x))
    out: dict[str, tuple[Array, Array]] = {}
    flows, trace_of_node = as_built.heat_flows, {t.node: t for t in fit.traces if t.experiment == experiment}
    air = as_built[boundary].kelvin
    for c in air_paths(e, boundary):
        node = c.ends[0] if c.ends[1] == boundary else c.ends[1]
        into = flows[c.path] * (-1.0 if c.ends[1] == boundary else 1.0)
        trace = trace_of_node.get(node)
        there = as_fitted[node].kelvin if trace is None else np.interp(times, trace.centres, trace.measured)
        simulated = as_built[node].kelvin - air
        into = into * np.clip((there - air) / np.where(np.abs(simulated) > TELLING_DIFFERENCE, simulated, np.inf), 0.0, 5.0)
        out[node] = (times, out[node][1] + into if node in out else into)
    return out


def _run_of(fit: RoughFit, x: Array, experiment: int) -> Solution:
    """Return a run of a record at `x` (unknowns,), in the fitted form; stored at the instants of the rough fit."""
    e, unknown_values = fit.problem.experiments[experiment], zip(fit.problem.unknowns, x, strict=False)
    values = {t.name: u.to_value(float(v)) for u, v in unknown_values for t in u.targets if t.experiment == experiment}
    parameters = e.model.parameter_table()  # a sensor that lags has values of its own beside the model
    named = {n: v for n, v in values.items() if n in parameters}
    ready = prepare(e.model, e.bare, tuple(named), times=fit.meshes[experiment][0])
    return ready.run(ready.with_units(named))


def air_paths(e: Experiment, boundary: str) -> list[FlatConductor]:
    """Return the conductors through which moving air takes heat to a boundary."""
    return [c for c in e.network.flat.conductors if c.kind in AIR_KINDS and boundary in c.ends[:2]]


def heats_of(request: Request, fit: RoughFit, base: RoughEnd, logged: Collection[str]) -> Iterator[Heat]:
    """Yield heats that would explain a misfit of the two worst records: unlogged loads, and the best window of each node and boundary."""
    order = np.argsort(
        [
            -float(sum(np.sum((t.whiten @ r) ** 2) for t, r in zip(fit.traces, base.left, strict=True) if t.experiment == i))
            for i in range(len(fit.problem.experiments))
        ]
    )
    for i in order[:2].tolist():
        e = fit.problem.experiments[i]
        span = e.scenario.seconds
        for row in {r.path: r for r in e.network.flat.loads}.values():
            scaled = any(t.name == f"scale.{row.path}" for u in fit.problem.unknowns for t in u.targets)
            if row.path not in logged and row.path not in e.scenario.loads and not scaled:
                yield Heat("load", row.path, request, i, {}, (0.0, span), row.path, 1.0, span)
        yield from _windows(request, fit, base, i)


def largest_power(experiments: Sequence[Experiment]) -> float:
    """Return the largest power that logs and scenarios give, 1 W at least. [W]"""
    bounds = (s.bounds for e in experiments for s in e.scenario.loads.values())
    return max([1.0, *(float(np.abs(w).max()) for w in bounds if np.size(w))])


def stores_of(e: Experiment) -> tuple[str, ...]:
    """Return the nodes that store heat, sensors that are nodes left out."""
    return tuple(n.path for n in e.network.flat.nodes if n.fields and n.path not in e.tips)


@dataclass(frozen=True, eq=False)
class Pulses:
    """The answer of all readings to a watt in each stretch of a record, into each node that stores heat; of many, those near readings.

    Parameters
    ----------
    rough : RoughFit        That of the fit, with an amount for every pulse at its end.
    nodes : tuple of str    The nodes; each has `PULSES` pulses, in this order.
    edges : array           Of the stretches. [s]
    free : int              Unknowns before the pulses.
    """

    rough: RoughFit
    nodes: tuple[str, ...]
    edges: Array
    free: int

    @classmethod
    def of_record(cls, request: Request, fit: RoughFit, experiment: int) -> Pulses:
        """Return the pulses of a record, whose number is `experiment`: 1 W in each of `PULSES` equal stretches at each of its nodes.

        Nodes that are measured or heated come first, at most `MAX_HEATED_NODES`.
        """
        e = fit.problem.experiments[experiment]
        span = e.scenario.seconds
        near = {*(t.node for t in fit.traces), *(load.node for load in e.network.flat.loads)}
        nodes = tuple(sorted(stores_of(e), key=lambda n: n not in near)[:MAX_HEATED_NODES])
        edges = np.linspace(0.0, span, PULSES + 1)
        places: dict[str, str] = {}
        tables, amounts = {}, []
        for node, k in product(nodes, range(PULSES)):
            name = f"{HEAT_NAME}{len(places)}"
            places[name] = node
            at = np.unique([0.0, edges[k], edges[k + 1], span])
            tables[name] = TableSignal(at, ((at >= edges[k]) & (at < edges[k + 1])).astype(float), hold=True, after="hold")
            amounts.append((Unknown(name, "power", (Influence(experiment, f"scale.{name}"),), 0.0), 1.0))
        rough = RoughFit.of_request(with_heats(request, experiment, places, tables), fit, amounts)
        return cls(rough, nodes, edges, len(fit.problem.unknowns))

    def residuals_and_answers(self, values_before: Mapping[str, float], heat: Heat | None = None) -> tuple[Array, Array]:
        """Return what is left without a heat (rows,) [-] and the answers (rows, pulses) [1/W], both in units of the noise.

        The part that the unknowns of the fit can compensate, the projection on their derivatives, is taken off both.

        Parameters
        ----------
        values_before : dict    Unknown -> value of an earlier fit. [SI]
        heat : Heat             A heat found before; its pulses are where the answers are taken. [W]
        """
        pulse_powers = np.zeros(len(self.nodes) * PULSES)
        if heat is not None:
            amount = values_before.get(f"{HEAT_NAME}amount", 0.0)
            inside = np.clip(np.minimum(self.edges[1:], heat.window[1]) - np.maximum(self.edges[:-1], heat.window[0]), 0.0, None)
            share = inside / np.diff(self.edges)
            for node, (times, power) in heat.flows.items():
                if node in self.nodes:
                    n = self.nodes.index(node)
                    pulse_powers[n * PULSES : (n + 1) * PULSES] = amount * share * np.interp(self.middles, times, power)
        begun = {u.name: values_before[u.name] for u in self.rough.problem.unknowns[: self.free] if u.name in values_before}
        x = self.rough.start(begun)
        x[self.free :] = pulse_powers
        end = self.rough.at(x)
        rows = end.rows.size - pulse_powers.size  # without the priors of the pulses
        slopes_of_fit, pulses = end.slopes[:rows, : self.free], end.slopes[:rows, self.free :]
        residuals = end.rows[:rows] - pulses @ pulse_powers
        basis = np.linalg.qr(slopes_of_fit)[0]
        return residuals - basis @ (basis.T @ residuals), pulses - basis @ (basis.T @ pulses)

    @property
    def middles(self) -> Array:
        """Middles of the stretches. [s]"""
        return 0.5 * (self.edges[1:] + self.edges[:-1])

    def shape(self, pulses: Array, flows: Mapping[str, tuple[Array, Array]]) -> Array:
        """Return the answers (rows, stretches) [1/unit of the course] to heat of the course `flows` in each stretch.

        Parameters
        ----------
        pulses : array (rows, pulses)   Answers to pulses at each node in turn, in units of the noise. [1/W]
        flows : dict                    Node -> times [s] and power per unit of the heat's amount.
        """
        out = np.zeros((pulses.shape[0], PULSES))
        for node, (times, power) in flows.items():
            if node in self.nodes:
                n = self.nodes.index(node)
                out += pulses[:, n * PULSES : (n + 1) * PULSES] * np.interp(self.middles, times, power)
        return out

    def windows(self, heat: Heat, values_before: Mapping[str, float]) -> list[tuple[float, float]]:
        """Return the windows in which a heat would take most squares away, from where it led."""
        residuals, pulses = self.residuals_and_answers(values_before, heat)
        return [*best_windows(self.shape(pulses, heat.flows), residuals, heat.sd, self.edges)]


def _windows(request: Request, fit: RoughFit, base: RoughEnd, i: int) -> Iterator[Heat]:
    """Yield heats of the i-th record: for each node a constant power, for each boundary an air flow, in its two best windows."""
    e = fit.problem.experiments[i]
    span = e.scenario.seconds
    pulses_of_record = Pulses.of_record(request, fit, i)
    residuals, pulses = pulses_of_record.residuals_and_answers(fit.named(base))
    power = largest_power(fit.problem.experiments)
    ends = np.array([0.0, span])
    tried: list[tuple[str, str, Mapping[str, tuple[Array, Array]], float]] = [
        *(("load", node, {node: (ends, np.ones(2))}, SIZES["unlogged"].at(power).spread) for node in pulses_of_record.nodes),
        *(("fan", b, air_flows(fit, base, i, b), SIZES["fan"].spread) for b in e.network.boundaries if air_paths(e, b)),
    ]
    for kind, name, flows, sd in tried:
        for window, gain in best_windows(pulses_of_record.shape(pulses, flows), residuals, sd, pulses_of_record.edges).items():
            yield Heat(kind, name, request, i, flows, window, "", sd, span, gain)


def best_windows(block: Array, residuals: Array, sd: float, edges: Array) -> dict[tuple[float, float], float]:
    """Return window (begin, end) [s] -> squares that it takes away [-]: the best one that lasts to the end, and the best one at all.

    A heat of the size q in the stretches of a window answers with b, the sum of their columns; with a prior of q about zero it takes
    (b'r)^2 / (b'b + 1 / sd^2) away from the residuals r.

    Parameters
    ----------
    block : array (rows, stretches)     Answers to heat in each stretch, per unit of its amount.
    residuals : array (rows,)           What is to be explained. [-]
    sd : float                          Standard deviation of the amount about zero, in that unit.
    edges : array (stretches + 1,)      Of the stretches. [s]
    """
    count = block.shape[1]
    sums = np.concatenate([np.zeros((block.shape[0], 1)), np.cumsum(block, axis=1)], axis=1)
    gram, cross = sums.T @ sums, sums.T @ residuals
    candidates = []
    for a in range(count):
        for b in range(a + 1, count + 1):
            square = gram[b, b] - 2.0 * gram[a, b] + gram[a, a] + 1.0 / sd**2
            candidates.append(((cross[b] - cross[a]) ** 2 / square, a, b))
    ends = [max(f for f in candidates if f[2] == count), max(candidates)]
    return {(float(edges[a]), float(edges[b])): float(gain) for gain, a, b in ends}


def unlogged_powers(base: FittedStructure) -> Iterator[MissingElement]:
    """Yield courses of a power that no log gives: a start-up transient, a stretch of more or less, a load that follows a temperature.

    Their shapes and instants are chosen by linearised fits: of all readings for a start-up, of thinned ones for a stretch.
    """
    base = replace(base, request=replace(base.request, loss="linear"))
    experiments, request = base.problem.experiments, base.request
    loads = {r.path: r.node for e in experiments for r in e.network.flat.loads}
    steps = [(node, first_step(experiments, path)) for path, node in loads.items()]
    begins = {node: step[0] if step is not None else 0.0 for node, step in reversed(steps)}
    nodes = list(dict.fromkeys(loads.values())) or list(dict.fromkeys(o.seat for o in base.problem.observations()))
    with suppress(ThermidError, np.linalg.LinAlgError):
        yield from _start_up(base, {node: begins.get(node, 0.0) for node in nodes[:MAX_TRIED_LOADS]})
    with suppress(ThermidError, np.linalg.LinAlgError):
        fit = RoughFit.of_request(request)
        heats = heats_of(request, fit, fit.solve(fit.start()), ())
        # what begins with the record is a start-up
        stretches = [h for h in heats if h.kind == "load" and not h.load and h.window[0] > 0.0]
        if stretches:
            yield _stretch(request, max(stretches, key=lambda h: h.gain))
    for load in [n for n in loads if n in request.model.loads][:MAX_TRIED_LOADS]:
        yield from _regulated(base, load)


def _start_up(base: FittedStructure, begins: Mapping[str, float]) -> Iterator[MissingElement]:
    """Yield the best start-up transient at one of some nodes, from when its power comes on [s]; none where it would take power off.

    Shapes, nodes and lengths, from 1.5 to 40 % of what follows in the shortest record, are compared by linearised fits; about the best
    length of each shape the fit is linearised again, at factors whose logarithms shrink to 0.4 until `START_UP_PRECISION`.

    Parameters
    ----------
    begins : dict   Node -> when its power comes on in the first record. [s]
    """
    least = min(float(np.ptp(r.times)) for r in base.request.records)
    parts = np.geomspace(0.015, 0.4, START_UP_TIMES)
    courses = [
        PowerCourse("start_up", node, shape, float(part) * (least - begin), begin=begin)
        for node, begin in begins.items()
        for shape, part in product(SHAPES, parts)
    ]
    first = _weighed_courses(base, courses, base.fitted)
    ends = []
    for shape in SHAPES:
        best = min((one for one in first if one[1].shape == shape), key=itemgetter(0), default=None)
        width = float(np.log(parts[1] / parts[0]))
        while best is not None and np.isfinite(best[0]) and width > START_UP_PRECISION:
            width *= 0.4
            others = [replace(best[1], time=best[1].time * float(np.exp(k * width))) for k in (0, -2, -1, 1, 2)]
            best = min(_weighed_courses(base, others, best[2]), key=itemgetter(0))
        ends += [best] if best is not None else []
    cost, course, _ = min(ends, key=itemgetter(0), default=(np.inf, None, {}))
    if course is None or not np.isfinite(cost):
        return

    def judge(values: Calibration) -> tuple[str, bool]:
        """Return what the fitted heat is, in words, and whether it is possible."""
        power = values["start_up.power"].value
        return course.words(power), power > 0.0

    after = f" and begin = '{short(course.begin, 6)} [s]'" if course.begin > 0.0 else ""
    remark = f"; to include it write [stages.courses.start_up] with into = '{course.into}'{after}"
    size = SIZES["course"].at(largest_power(base.problem.experiments))
    title, sizes = f"a start-up transient of the power at '{course.into}'{remark}", {"start_up.power": size}
    yield MissingElement(title, course.within(base.request), judge, course.within, sizes=sizes, additive=True, chosen=1)


def _weighed_courses(
    base: FittedStructure, courses: Sequence[PowerCourse], values: Mapping[str, float]
) -> list[tuple[float, PowerCourse, dict[str, float]]]:
    """Return cost [-], course with its power [W], and name -> value (fitted form), of a linearised fit with each course alone.

    All come from one run. The cost is half the least squares of the residuals with the course's power and all other values free, each held
    by a step of `PROMISED_STEP` of its scale; infinite where the power is not positive. The first course acts with its power, at `values`;
    all others lie over the model so small that they do not act.
    """
    request, powers = base.request, [c.power if k == 0 and c.power != 1.0 else IDLE_SHARE * c.power for k, c in enumerate(courses)]
    for k, c in enumerate(courses):
        request = replace(c, name=f"{c.name}_{k}", power=powers[k]).within(request)
    problem = replace(build_problem(request), noise=base.problem.noise)
    at = starting_values(problem, values, {})
    rows, matrix = linearised(problem, at)
    place = {u.name: k for k, u in enumerate(problem.unknowns)}
    of_course = [place[f"{c.name}_{k}.power"] for k, c in enumerate(courses)]
    unchanged = [k for k in range(at.size) if k not in of_course]
    scale = np.array([PROMISED_STEP * problem.unknowns[k].scale for k in unchanged])
    answers = [matrix[:, k] / problem.unknowns[k].slope(float(at[k])) for k in of_course]  # per watt
    others, free = rows - powers[0] * answers[0], np.concatenate([matrix[:, unchanged] * scale, np.eye(scale.size)])
    out = []
    for course, answer in zip(courses, answers, strict=True):
        size = float(np.linalg.norm(answer)) or 1.0
        wide = np.column_stack([free, np.concatenate([answer / size, np.zeros(scale.size)])])
        step = np.linalg.lstsq(wide, np.concatenate([-others, np.zeros(scale.size)]), rcond=None)[0]
        squares = float(np.sum((np.concatenate([others, np.zeros(scale.size)]) + wide @ step) ** 2))
        moved = {problem.unknowns[k].name: float(at[k] + d) for k, d in zip(unchanged, scale * step[:-1], strict=True)}
        power = float(step[-1]) / size
        out.append((0.5 * squares if power > 0.0 else np.inf, replace(course, power=max(power, 0.0)), moved))
    return out


def _stretch(request: Request, heat: Heat) -> MissingElement:
    """Return a constant power in the window of a heat."""
    cycle = {"times": [f"{t!r} [s]" for t in (0.0, *heat.window)], "values": [0.0, 1.0, 0.0], "hold": True, "period": ONE_TURN}
    load = watts(heat.name, power={"value": "0.1 [W]", "min": -np.inf}, cycle=cycle)

    def make(request: Request) -> Request:
        """Return the request with the heat that the candidate adds."""
        return replace(request, model=with_load(request.model, "unlogged", load), free=(*request.free, "unlogged.power"))

    def judge(values: Calibration) -> tuple[str, bool]:
        """Return what the fitted heat is, in words, and whether it is possible."""
        power = values["unlogged.power"].value
        return f"{short(abs(power), 3)} W {'more' if power > 0 else 'less'} {heat.when}", True

    title, sizes = f"a power at '{heat.name}' that no log gives, {heat.when}", {"unlogged.power": SizedValue(0.0, heat.sd)}
    return MissingElement(title, make(request), judge, make, sizes=sizes, chosen=2)


def _regulated(base: FittedStructure, load: str) -> Iterator[MissingElement]:
    """Yield a load as a proportional heater, P = gain (setpoint - T), at most five times the deck's power; none without readings there."""
    request, problem = base.request, base.problem
    heat_load = request.model.loads[load]
    readings = [o.measured for o in problem.observations() if o.seat == heat_load.into]
    power = float(problem.experiments[0].network.flat.parameters.evaluate({}).get(f"{load}.power", 0.0))
    if not readings or power <= 0.0 or set(heat_load.fields) != {"power"}:
        return
    low, high = float(readings[0].min()), float(readings[0].max())
    gain_is, setpoint_is = f"{load}.proportional.gain", f"{load}.proportional.setpoint"
    # P(T) = gain (setpoint - T), its set point above the highest reading, its gain so that P is the deck's power at mid-range
    setpoints = [high + above * (high - low) for above in (0.5, 0.1, 1.5)]
    starts = tuple({gain_is: power / max(t - 0.5 * (low + high), 0.1), setpoint_is: t} for t in setpoints)
    fields = {"gain": f"{starts[0][gain_is]!r} [W/K]", "setpoint": f"{setpoints[0] - ICE_POINT!r} [degC]"}
    heater = watts(heat_load.into, power=f"{5.0 * power!r} [W]", proportional=fields)

    def make(request: Request) -> Request:
        """Return the request with the heat that the candidate adds."""
        free_before = tuple(p for p in request.free if p != f"{load}.power")
        return replace(request, model=with_load(request.model, load, heater), free=(*free_before, gain_is, setpoint_is))

    def judge(fitted: Calibration) -> tuple[str, bool]:
        """Return what the fitted heat is, in words, and whether it is possible."""
        gain, setpoint = fitted[gain_is].value, fitted[setpoint_is].value
        return f"{short(gain, 3)} W/K below {format_value(setpoint, 'degC')}", gain > 0.0

    name = f"a regulated load: the power of '{load}' follows the temperature of '{heat_load.into}'"
    sizes = {gain_is: SIZES["gain"].at(starts[0][gain_is]), setpoint_is: SizedValue(setpoints[0], SIZES["setpoint"].spread / setpoints[0])}
    yield MissingElement(name, make(request), judge, make, sizes=sizes, starts=starts)
