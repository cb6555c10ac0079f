"""`uncertain_runs`: a model in a scenario as often as asked for, everything that is not known drawn anew each time."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.base.arguments import takes_objects
from thermid.base.errors import NameNotFoundError, ScenarioError, cap, raising, refuse_unknown
from thermid.base.linear_algebra import Array
from thermid.base.results import PlottedTrace, Result
from thermid.fit.calibration import Calibration
from thermid.model.laws import literal
from thermid.model.parameters import Standing
from thermid.model.tree import Model
from thermid.physics.constants import ICE_POINT
from thermid.prediction._budget import AVERAGED, Budget, Spread, assumed_left_out, budget_of, check_variants, first_line, in_order
from thermid.prediction._known import known_of
from thermid.prediction._monte_carlo.chunks import Chunk, ChunkStore, Job, chunks
from thermid.prediction._predict import BENT, WayAnswer, centre_words, mixed_answer
from thermid.prediction._reduction.macro import assumed
from thermid.prediction._setting import Setting
from thermid.simulation.network import compile_network
from thermid.simulation.runs import Workers, output_times, simulate
from thermid.simulation.scenarios import Scenario
from thermid.simulation.solver import MemberTurnings, Options
from thermid.values.fitted import FittedValues
from thermid.values.store import Choice, LeftOut, Source, model_standing

STEP = 1800.0
"""Step of start times where none is given. [s]"""


def begun_at(scenario: Scenario, seconds: float, stays: Collection[str] = ()) -> Scenario:
    """Return a scenario as it is from a time on: sun, wind, gases and schedules too; commands, and what `stays`, do not move."""
    return scenario.begun(seconds, but=("commands", *stays))


def starts(spec: Any, scenario: Scenario) -> tuple[list[float], tuple[str, ...], tuple[str, ...]]:
    """Return the start times that a spread of ``start_time`` means [s], what stays where it is, and what a reader must know.

    Parameters
    ----------
    spec : dict         ``{"low": "0 [h]", "high": "6 [h]", "step": "30 [min]", "stays": ["air_flow"]}``; every step is as likely. The step
                        may be left out; ``stays`` names what is done and counts from the start, as commands do.
    scenario : Scenario Its tables reach from the first start to the end of a run begun last.

    Raises
    ------
    ScenarioError   When it is none, has more than a thousand steps, or names what the scenario does not have.
    """
    where = f"{scenario.title}, spread of 'start_time'"
    if not isinstance(spec, Mapping) or not {"low", "high"} <= set(spec) <= {"low", "high", "step", "stays"}:
        raise ScenarioError('write { low = "0 [h]", high = "6 [h]", step = "30 [min]" }.', where)
    low, high = (literal(spec[k], "s", where) for k in ("low", "high"))
    step = literal(spec["step"], "s", where) if "step" in spec else STEP
    if not (0.0 <= low <= high and step > 0.0 and (high - low) / step <= 1000.0):
        raise ScenarioError("start times must increase from zero or later, in at most 1000 steps.", where)
    times = np.arange(low, high + 1e-9 * step, step).tolist()
    stays = tuple(spec.get("stays", ()))
    refuse_unknown(stays, scenario.names(), f"{where}, stays", "the scenario has no changing input '{}'.", ScenarioError)
    still = [k for k, s in scenario.commands.items() if s.cycle != 0.0] + [n for n in stays if n not in scenario.commands]
    said = (f"the start moves all that changes in time but {', '.join(still)}, which count{'s' * (len(still) == 1)} from it",)
    return times, stays, said if still and len(times) > 1 else ()


SAMPLES = 121
CHUNK = 500

Values = Calibration | FittedValues | Spread


def plan_runs(
    model: Model,
    scenario: Scenario | Sequence[Scenario],
    values: Values | Sequence[Values] = (),
    *,
    at: str = "",
    spread: Mapping[str, Any] | None = None,
    without: Sequence[str] = (),
    seed: int = 0,
    nodes: Sequence[str] | None = None,
    every: str | float | None = None,
    chunk: int = CHUNK,
    options: Options | None = None,
) -> tuple[Job, tuple[str, ...]]:
    """Return what `uncertain_runs` would run, and what a reader must know."""
    from importlib.metadata import version

    given = [values] if isinstance(values, Values) else list(values)
    scenarios = [scenario] if isinstance(scenario, Scenario) else list(scenario)
    if not scenarios or chunk < 1:
        raise ScenarioError("a campaign of runs needs a scenario, and chunks of at least one member.", model.title)
    stated = dict(spread or {})
    begun, stays, remarks = starts(stated.pop("start_time"), scenarios[0]) if "start_time" in stated else ([0.0], (), ())
    first = begun_at(scenarios[0], begun[0], stays)
    known = known_of([v for v in given if not isinstance(v, Spread)], model, at)
    joint = [v for v in given if isinstance(v, Spread)]
    budget = budget_of(known, first, [*joint, *([stated] if stated else [])], without=without)
    check_variants(stated, budget.model, scenarios)
    variants = tuple(begun_at(s, t, stays) for s in scenarios for t in begun)
    for variant in variants:
        variant.check_spans()
    chosen = " and ".join(n for n, several in (("scenario", len(scenarios)), ("start_time", len(begun))) if several > 1)
    budget = _with_variants(budget, chosen, len(variants)) if len(variants) > 1 else budget
    network = compile_network(budget.model, media=first.media(), prescribed=tuple(first.prescribed))
    points = [n.path for n in network.flat.nodes if n.reference_point]
    wanted = nodes if nodes is not None else points or [n for n in network.nodes if network.numbers().capacitances.get(n) is not None]
    kept = tuple(dict.fromkeys(network.find(n) for n in wanted))
    grid = output_times(first, every, None if every is not None else np.linspace(0.0, first.seconds, SAMPLES))
    return Job(budget, variants, kept, grid, seed, chunk, options or Options(), version("thermid")), (*remarks, *budget.remarks)


def _with_variants(budget: Budget, chosen: str, count: int) -> Budget:
    """Return a budget with a source that distinguishes scenarios, all as likely; it moves nothing by itself."""
    source = Source(chosen, "variant", Choice(count), f"which of {count} scenarios or starts")
    return budget.beside([source], chosen)


Progress = Callable[[int, int], None]


@dataclass(frozen=True, eq=False)
class UncertainRuns(Result):
    """Runs of many members, each with values and surroundings of its own.

    Parameters
    ----------
    job : Job                       What was run.
    temperatures : array (members, nodes, times)    NaN where a member failed. [K]
    turnings : dict                 Node -> turning points between the times; a node is missing where they were not followed.
    failed : dict                   Member -> why it did not reach the end.
    reused : int                    Members that were taken from the folder.
    warnings : tuple of str         What a reader must know.
    """

    job: Job
    temperatures: Array
    turnings: Mapping[str, MemberTurnings]
    failed: Mapping[int, str]
    reused: int = 0
    warnings: tuple[str, ...] = ()

    def __len__(self) -> int:
        """How many members there are."""
        return int(self.temperatures.shape[0])

    @property
    def title(self) -> str:
        """The model's."""
        return self.job.model.title

    @property
    def scenario(self) -> str:
        """The scenario's title."""
        return self.job.scenarios[0].title

    @property
    def times(self) -> Array:
        """Times of the temperatures. [s]"""
        return self.job.times

    @property
    def nodes(self) -> tuple[str, ...]:
        """Nodes that were kept."""
        return self.job.nodes

    @cached_property
    def draws(self) -> dict[str, Array]:
        """Name -> value of every member (members,), shifts for boundaries; ``scenario`` and ``start_time`` are counted. [SI]"""
        job = self.job
        sources = job.budget.drawn(job.budget.numbers(job.seed, 0, len(self)))
        chosen = job.budget.chosen(sources)
        out: dict[str, Array] = {}
        for k, (_, own) in enumerate(job.budget.each):
            here = np.flatnonzero(chosen == k)
            setting = Setting.of(own, scenario=job.scenarios[0], times=job.times, options=job.options)
            for name, values in setting.told(sources[:, here]).items():
                out.setdefault(name, np.zeros(len(self)))[here] = values
        return out | ({AVERAGED: chosen.astype(float)} if len(job.budget.ways) > 1 else {})

    @cached_property
    def left_out(self) -> tuple[LeftOut, ...]:
        """What the members do not count."""
        return in_order((*self.job.budget.omitted, *(x for x, _ in assumed_left_out(self.job.budget, self.nodes))))

    @property
    def not_counted(self) -> str:
        """What a reader must know first: what members do not count and could matter; empty where nothing is."""
        errors = [float(self.of(n)[:, -1].std()) for n in self.nodes] if self.reached.size else []
        return first_line(self.left_out, min(errors, default=0.0))

    @cached_property
    def centre(self) -> str:
        """How far the mean of the members lies from the run with the best values, and why; empty where nobody minds or weather varies."""
        job = self.job
        if job.variant is not None or not self.reached.size:
            return ""
        ways = [WayAnswer.of(w, own, self.nodes, None, job.times, job.options, job.scenarios[0]) for w, own in job.budget.each]
        best = simulate(job.model, job.scenarios[0], times=job.times, options=job.options)
        sources = job.budget.drawn(job.budget.numbers(job.seed, 0, len(self)))[:, self.reached]
        chosen = job.budget.chosen(sources)
        moved = {}
        for n in self.nodes:
            _, shifts, _, _ = mixed_answer(ways, n, best[n].kelvin)
            # beside the straight model at the same draws, so that their number does not count
            lines = [w.linear.run[n].kelvin[:, None] + w.linear.columns[n][:-1] @ sources[:, chosen == k] for k, w in enumerate(ways)]
            straight = np.concatenate(lines, axis=1).mean(axis=1)
            moved[n] = {c: v[:-1] for c, v in shifts.items()} | {BENT: self.of(n).mean(axis=0) - straight}
        return centre_words(moved, job.times)

    @cached_property
    def standing(self) -> Standing:
        """Of the values that it rests on."""
        return model_standing(self.job.model)

    @cached_property
    def assumed(self) -> tuple[str, ...]:
        """Values of the model that are assumed."""
        return assumed(self.job.model)

    def of(self, node: str) -> Array:
        """Return the temperatures (members that reached the end, times) of a node. [K]

        Raises
        ------
        NameNotFoundError   With the nearest name.
        ScenarioError       When no member reached the end.
        """
        path = self.job.model.canonical(node)
        refuse_unknown([path], self.nodes, self.title, f"'{node}' was not stored.{{near}} Name it in 'nodes'.", NameNotFoundError)
        if len(self.failed) == len(self):
            raise ScenarioError(f"no member reached the end of the run. Member 0: {self.failed[0]}", self.title)
        traces: Array = self.temperatures[self.reached, self.nodes.index(path)]
        return traces

    @cached_property
    def reached(self) -> NDArray[np.int64]:
        """Members that reached the end."""
        return np.setdiff1d(np.arange(len(self)), np.array(list(self.failed), dtype=np.int64))

    def quantile(self, node: str, share: Any) -> Array:
        """Return the temperature below which a share of the members lies, (times,) or (shares, times). [K]"""
        return np.asarray(np.quantile(self.of(node), share, axis=0))

    def turnings_of(self, node: str) -> MemberTurnings | None:
        """Return the turning points of a node between samples in the members that reached the end; None where they were not followed."""
        points = self.turnings.get(self.job.model.canonical(node))
        return points.taken(self.reached, len(self)) if points is not None else None

    def furthest(self, node: str, sign: float = 1.0) -> Array:
        """Return the highest (sign 1) or lowest (-1) temperature of each member that reached the end, between samples too. [K]"""
        return (self.turnings_of(node) or MemberTurnings.joined([])).furthest(self.of(node), sign)

    def highest(self, node: str) -> Array:
        """Return the highest temperature of each member that reached the end, between samples too. [degC]"""
        return self.furthest(node) - ICE_POINT

    def __str__(self) -> str:
        """The highest temperatures as a short table, 5 % and 95 % of the members below."""
        lines = [f"{self.title}, {self.scenario}: {len(self)} members, {len(self.failed)} failed"]
        lines += [self.not_counted] if self.not_counted else []
        width = max(len(n) for n in self.nodes)
        for n in self.nodes if self.reached.size else ():
            low, middle, high = np.quantile(self.highest(n), (0.05, 0.5, 0.95))
            lines.append(f"  {n:<{width}}  highest {middle:8.2f} degC   90 % between {low:.2f} and {high:.2f}")
        lines += [f"  {self.centre}"] if self.centre else []
        if self.assumed:
            lines.append(f"  demonstration, {len(self.assumed)} assumed parameters")
        return self.standing.over("\n".join([*lines, *(f"  warning: {w}" for w in self.warnings)]))

    def _as_traces(self) -> Sequence[PlottedTrace]:
        """Return the median of every node, and where 95 % of the members lie."""
        shares = (0.5, 0.025, 0.975)
        found = [(n, [self.quantile(n, share) - ICE_POINT for share in shares]) for n in self.nodes]
        return [PlottedTrace(n, self.times, middle, low, high) for n, (middle, low, high) in found]


@takes_objects
def uncertain_runs(
    model: Model,
    scenario: Scenario | Sequence[Scenario],
    values: Values | Sequence[Values] = (),
    *,
    at: str = "",
    spread: Mapping[str, Any] | None = None,
    without: Sequence[str] = (),
    n: int = 10_000,
    seed: int = 0,
    nodes: Sequence[str] | None = None,
    every: str | float | None = None,
    folder: str | os.PathLike[str] | None = None,
    executor: Workers = None,
    threads: int = 1,
    chunk: int = CHUNK,
    progress: Progress | None = None,
    options: Options | None = None,
) -> UncertainRuns:
    """Return runs of a model whose values and surroundings are drawn anew for every member.

    A member's draws depend on the seed and its index alone, and members run in chunks that are always the same: one process, several and
    a cluster give the same numbers (bit for bit on machines of one instruction set), and more members begin with those of fewer.

    Parameters
    ----------
    model : Model
    scenario : Scenario, or several     Several are draws of the weather, all as likely.
    values : Calibration, FittedValues, Spread, or several      What fits found (laid over the model) and left open (drawn).
    at : str                    The submodel that the values belong to; empty for the model itself.
    spread : dict               What else is not known exactly: name as in `ensemble`, or a pattern of parameters -> spread as text;
                                ``start_time`` -> ``{"low": "0 [h]", "high": "6 [h]"}``: all that changes in time is entered at another
                                time, but commands and what ``stays`` names, which count from the start.
    without : sequence of str   Sources that are not counted, as in `predict`.
    n, seed : int               Members; of the draws.
    nodes : sequence of str     Nodes to keep; the reference points by default.
    every : str or float        Interval of the stored samples; 121 by default.
    folder : path               Where chunks are kept: what is there is not run again, and a run that was interrupted goes on.
    executor : executor, str or int    Who runs the chunks, as in `ensemble`.
    threads : int               Threads of one process.
    chunk : int                 Members that run together.
    progress : callable         Called with members done and members in all.
    options : Options           The integrator's.

    Raises
    ------
    ScenarioError       When a spread is none, a value is spread twice, or there is no such cluster.
    NameNotFoundError   When a name does not exist.
    """
    if n > cap("members"):
        text = f"{n} members are too many; at most {cap('members'):,.0f} are run.{raising('members')}"
        raise ScenarioError(text, model.title, code="cap.exceeded")
    if n < 1:
        raise ScenarioError("a campaign of runs needs at least one member.", model.title)
    job, remarks = plan_runs(
        model, scenario, values, at=at, spread=spread, without=without, seed=seed, nodes=nodes, every=every, chunk=chunk, options=options
    )
    store = ChunkStore.of(job, folder) if folder is not None else None
    parts = job.parts(n)
    done = kept_chunks(store, parts)
    reused = sum(c.temperatures.shape[0] for c in done.values())
    if progress is not None:
        progress(reused, n)
    for part in chunks(job, [p for p in parts if p[0] not in done], executor, threads):
        done[part.first] = part
        if store is not None:
            store.save(part)
        if progress is not None:
            progress(sum(c.temperatures.shape[0] for c in done.values()), n)
    ordered = [done[first] for first, _ in parts]
    failed = {m: why for c in ordered for m, why in c.failed.items()}
    if failed:
        why = next(iter(failed.values()))
        remarks = (*remarks, f"{len(failed)} of {n} members failed; temperatures and their bands leave them out. One of them: {why}")
    turnings, blind = _turnings(job, ordered)
    return UncertainRuns(job, np.concatenate([c.temperatures for c in ordered]), turnings, failed, reused, (*remarks, *blind))


def _turnings(job: Job, ordered: Sequence[Chunk]) -> tuple[dict[str, MemberTurnings], tuple[str, ...]]:
    """Return node -> turning points of all members, and a remark on the nodes of which there are none."""
    followed = [node for node in job.nodes if all(node in c.turnings for c in ordered)]
    turnings = {node: MemberTurnings.joined([(c.first, c.turnings[node]) for c in ordered]) for node in followed}
    if len(followed) == len(job.nodes):
        return turnings, ()
    blind = ", ".join(node for node in job.nodes if node not in turnings)
    why = f"only the stored samples of {blind} are known, so a peak between two samples is not included. Give a shorter 'every'"
    return turnings, (why,)


def kept_chunks(store: ChunkStore | None, parts: Sequence[tuple[int, int]]) -> dict[int, Chunk]:
    """Return first member -> chunk, of those that an earlier run left in the folder."""
    loaded = {} if store is None else {first: store.load(first, members) for first, members in parts}
    return {first: chunk for first, chunk in loaded.items() if chunk is not None}
