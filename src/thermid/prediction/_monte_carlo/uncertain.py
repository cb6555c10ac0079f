"""`uncertain_runs`: a model in a scenario as often as asked for, everything that is not known drawn anew each time."""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from thermid.base.errors import NameNotFoundError, ScenarioError, cap, optional, raising, refuse_unknown
from thermid.base.results import PlottedTrace, Result
from thermid.base.units import ICE_POINT, TEMPERATURE, Array, counted
from thermid.fit.calibration import Calibration
from thermid.model.tree import Model, Standing, literal
from thermid.prediction._budget import AVERAGED, Spread, assumed_left_out, budget_of, check_variants, first_line, in_order
from thermid.prediction._known import Knowledge, known_of
from thermid.prediction._monte_carlo.chunks import Chunk, CountTable, Job, Limit, MemberRuns, Progress, chunk_name
from thermid.prediction._predict import BENT, SWITCHING, WayAnswer, centre_words, mixed_answer
from thermid.prediction._reduction.macro import assumed
from thermid.prediction._setting import Setting, prepared
from thermid.simulation.runs import (
    Counted,
    JobFolder,
    KeptTasks,
    MemberTurnings,
    Options,
    Scenario,
    Workers,
    compile_network,
    output_times,
    shares_of,
    simulate,
)
from thermid.values.store import Choice, FittedValues, LeftOut, Source

if TYPE_CHECKING:
    import xarray

START_TIME_STEP = 1800.0
"""Step of start times where none is given. [s]"""


def begun_at(scenario: Scenario, seconds: float, stays: Collection[str] = ()) -> Scenario:
    """Return a scenario as it is from a time on: sun, wind, gases and schedules too; commands, and what `stays`, do not move."""
    return scenario.begun(seconds, but=("commands", *stays))


def starts(spec: Any, scenario: Scenario) -> tuple[list[float], tuple[str, ...], tuple[str, ...]]:
    """Return the start times that a spread of ``start_time`` means [s], what stays where it is, and what a reader must know.

    Parameters
    ----------
    spec : dict         ``{"low": "0 [h]", "high": "6 [h]", "step": "30 [min]", "stays": ["air_flow"]}``; every step is as likely. Without a
                        step it is `START_TIME_STEP`; ``high`` is a start where a step meets it. ``stays`` names what is done and counts
                        from the start, as commands do.
    scenario : Scenario Its tables reach from the first start to the end of a run begun last.

    Raises
    ------
    ScenarioError   When it is none, has more than a thousand steps, or names what the scenario does not have.
    """
    where = f"{scenario.title}, spread of 'start_time'"
    if not isinstance(spec, Mapping) or not {"low", "high"} <= set(spec) <= {"low", "high", "step", "stays"}:
        raise ScenarioError('write { low = "0 [h]", high = "6 [h]", step = "30 [min]" }.', where, code="value.wrong-kind")
    low, high = (literal(spec[k], "s", where) for k in ("low", "high"))
    step = literal(spec["step"], "s", where) if "step" in spec else START_TIME_STEP
    if not (0.0 <= low <= high and step > 0.0 and (high - low) / step <= 1000.0):
        raise ScenarioError("start times must increase from zero or later, in at most 1000 steps.", where, code="value.outside-range")
    times = np.arange(low, high + 1e-9 * step, step).tolist()
    stays = tuple(spec.get("stays", ()))
    refuse_unknown(stays, scenario.names(), f"{where}, stays", "the scenario has no changing input '{}'.", ScenarioError)
    still = [k for k, s in scenario.commands.items() if s.cycle != 0.0] + [n for n in stays if n not in scenario.commands]
    remarks = (f"the start moves all that changes in time but {', '.join(still)}, which count{'s' * (len(still) == 1)} from it",)
    return times, stays, remarks if still and len(times) > 1 else ()


TIMES_OF_RUN = 121
MEMBERS_PER_CHUNK = 500

Values = Calibration | FittedValues | Knowledge | Spread


def plan_runs(
    model: Model,
    scenario: Scenario | Sequence[Scenario],
    values: Values | Sequence[Values] = (),
    *,
    spread: Mapping[str, Any] | None = None,
    without: Sequence[str] = (),
    seed: int = 0,
    nodes: Sequence[str] | Mapping[str, Any] | None = None,
    every: str | float | None = None,
    options: Options | None = None,
) -> tuple[Job, tuple[str, ...]]:
    """Return what `uncertain_runs` would run, and what a reader must know."""
    from importlib.metadata import version

    sources = list(values) if isinstance(values, list | tuple) else [values]
    scenarios = [scenario] if isinstance(scenario, Scenario) else list(scenario)
    if not scenarios:
        raise ScenarioError("a campaign of runs needs a scenario.", model.title, code="value.incomplete")
    stated = dict(spread or {})
    begun, stays, remarks = starts(stated.pop("start_time"), scenarios[0]) if "start_time" in stated else ([0.0], (), ())
    first = begun_at(scenarios[0], begun[0], stays)
    fits = [v for v in sources if not isinstance(v, Spread)]
    knowledge = known_of(next((v for v in fits if isinstance(v, Knowledge)), fits), model)
    joint = [v for v in sources if isinstance(v, Spread)]
    budget = budget_of(knowledge, first, [*joint, *([stated] if stated else [])], without=without)
    check_variants(stated, budget.model, scenarios)
    variants = tuple(begun_at(s, t, stays) for s in scenarios for t in begun)
    for variant in variants:
        variant.check_spans()
    chosen = " and ".join(n for n, several in (("scenario", len(scenarios)), ("start_time", len(begun))) if several > 1)
    if len(variants) > 1:  # a source that moves nothing by itself; all are as likely
        which = Source(chosen, "variant", Choice(len(variants)), f"which of {len(variants)} scenarios or starts")
        budget = budget.beside([which], chosen)
    network = compile_network(budget.model, media=first.media(), prescribed=tuple(first.prescribed))
    points = [n.path for n in network.flat.nodes if n.reference_point]
    wanted = nodes if nodes is not None else points or [n for n in network.nodes if network.numbers().capacitances.get(n) is not None]
    nodes_kept = tuple(dict.fromkeys(network.find(n) for n in wanted))
    grid = output_times(first, every, None if every is not None else np.linspace(0.0, first.seconds, TIMES_OF_RUN))
    limits = {n: x for n, x in nodes.items() if x is not None} if isinstance(nodes, Mapping) else {}
    named = limits_of(limits, budget.model.title) if limits else []
    kept_limits = tuple(dict.fromkeys(Limit(budget.model.canonical(name), SIDES[side], kelvin) for name, side, kelvin in named))
    job = Job(budget, variants, nodes_kept, grid, seed, MEMBERS_PER_CHUNK, options or Options(), version("thermid"), kept_limits)
    return job, (*remarks, *budget.remarks)


SIDES = {"highest": 1.0, "lowest": -1.0}


def limits_of(limits: Mapping[str, Any], title: str) -> list[tuple[str, str, float]]:
    """Return name, side and temperature [K] of every limit.

    Raises
    ------
    ScenarioError   When there is none, or one is no limit.
    """
    wanted = [(name, side, value) for name, spec in limits.items() for side, value in _sides(name, spec)]
    if not wanted:
        raise ScenarioError('no limit is given. Give one: { "FOG_x" = "50 [degC]" }.', title, code="value.incomplete")
    return wanted


def _sides(name: str, spec: Any) -> list[tuple[str, float]]:
    """Return side and temperature [K] of each limit of one name."""
    table = spec if isinstance(spec, Mapping) else {"highest": spec}
    if not table or not set(table) <= set(SIDES):
        raise ScenarioError(
            'give a limit as "50 [degC]", or { highest = "50 [degC]", lowest = "-20 [degC]" }.', f"limits, {name}", code="value.wrong-kind"
        )
    ends_by_side = [(side, literal(value, TEMPERATURE, f"limits, {name}")) for side, value in table.items()]
    ends = dict(ends_by_side)
    if len(ends) == 2 and not ends["lowest"] < ends["highest"]:
        raise ScenarioError("its lowest temperature is not below its highest.", f"limits, {name}", code="value.outside-range")
    return ends_by_side


@dataclass(frozen=True, eq=False)
class UncertainRuns(Result):
    """Runs of many members, each with values and surroundings of its own.

    Parameters
    ----------
    job : Job                       What was run.
    members : int                   How many there are.
    temperatures : array (kept members, nodes, times)   Of those that were kept whole, the first; NaN where a member failed. [K]
    turnings : dict                 Node -> turning points of these between the times; a node is missing where they were not followed.
    failed : dict                   Member -> why it did not reach the end.
    counts : dict                   Node -> `Tally` of all members at the times, and of their highest and lowest; empty where all were kept.
    passed : dict                   Limit -> when each member passes it first (members,), infinite where never; where they were counted. [s]
    reused : int                    Members that were taken from the folder.
    warnings : tuple of str         What a reader must know.
    """

    job: Job
    members: int
    temperatures: Array
    turnings: Mapping[str, MemberTurnings]
    failed: Mapping[int, str]
    counts: Mapping[str, Any]
    passed: Mapping[Limit, Array]
    reused: int = 0
    warnings: tuple[str, ...] = ()

    def __len__(self) -> int:
        """How many members there are."""
        return self.members

    @property
    def whole(self) -> int:
        """How many members, the first, were kept whole."""
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
        return self._drawn(len(self))

    @cached_property
    def draws_of_whole(self) -> dict[str, Array]:
        """The same of the members that were kept whole."""
        return self.draws if self.whole == len(self) else self._drawn(self.whole)

    def _drawn(self, members: int) -> dict[str, Array]:
        """Return name -> value (members,) [SI] of the first members, each by the way that its draw chose, and which.

        Which only where there are several.
        """
        job = self.job
        sources = job.budget.drawn(job.budget.numbers(job.seed, 0, members))
        chosen = job.budget.chosen(sources)
        out: dict[str, Array] = {}
        ready = prepared(job.budget, scenario=job.scenarios[0], times=job.times, options=job.options)
        for k, (_, way) in enumerate(job.budget.weighted_ways):
            here = np.flatnonzero(chosen == k)
            for name, values in Setting.of_budget(way, ready).member_values(sources[:, here]).items():
                out.setdefault(name, np.zeros(members))[here] = values
        return out | ({AVERAGED: chosen.astype(float)} if len(job.budget.ways) > 1 else {})

    def open_members(self, n: int, folder: str | os.PathLike[str], *, executor: Workers = None) -> xarray.Dataset:
        """Return runs of the same question as one lazy data set: temperatures (member, node, time) of a folder with a file a chunk. [K]

        Members that the folder lacks are run first. No more than a chunk is held, by this process or by each worker; what is asked of the
        data set is read when it is computed. What was drawn are its variables, a number a member [SI]. Its `to_netcdf` writes one file.

        Parameters
        ----------
        n : int                     Members.
        folder : path               As of `KeptTasks`; `uncertain_runs` shares its files.
        executor                    As in `uncertain_runs`.

        Raises
        ------
        ScenarioError       When there are too many members, or none.
        MissingExtraError   When xarray or dask is not installed.
        """
        _check_members(self.job, n)
        dask, arrays, data = (optional(name, "lazy members") for name in ("dask", "dask.array", "xarray"))
        job, store = self.job, JobFolder.below(folder, self.job.key())
        for _ in MemberRuns(job, n, n, store, KeptTasks.of_workers(executor).workers, None).chunks():
            pass  # each goes to its file
        read, shape = dask.delayed(store.load), (len(job.nodes), job.times.size)
        pieces = [arrays.from_delayed(read(chunk_name(*part))["temperatures"], (part[1], *shape), float) for part in job.parts(0, n)]
        temperatures = {"temperature": (("member", "node", "time"), arrays.concatenate(pieces), {"units": "K"})}
        drawn = {name: ("member", values) for name, values in self._drawn(n).items()}
        lazy: xarray.Dataset = data.Dataset(temperatures | drawn, {"node": list(job.nodes), "time": ("time", job.times, {"units": "s"})})
        return lazy

    @cached_property
    def left_out(self) -> tuple[LeftOut, ...]:
        """What the members do not count."""
        return in_order((*self.job.budget.omitted, *(x for x, _ in assumed_left_out(self.job.budget, self.nodes))))

    @property
    def not_counted(self) -> str:
        """What a reader must know first: what members do not count and could matter; empty where nothing is."""
        errors = [float(self._kept_temperatures(n)[:, -1].std()) for n in self.nodes] if self.reached.size else []
        return first_line(self.left_out, min(errors, default=0.0))

    @cached_property
    def centre(self) -> str:
        """How far the mean of the members lies from the run with the best values, and why; empty where nobody minds or weather varies."""
        job = self.job
        if job.variant is not None or not self.reached.size:
            return ""
        ways = WayAnswer.of_budget(
            job.budget, self.nodes, prepared(job.budget, scenario=job.scenarios[0], times=job.times, options=job.options)
        )
        best = simulate(job.model, job.scenarios[0], times=job.times, options=job.options)
        sources = job.budget.drawn(job.budget.numbers(job.seed, 0, self.whole))[:, self.reached]
        chosen = job.budget.chosen(sources)
        moved = {}
        for n in self.nodes:
            if ways[0].setting.switches:
                moved[n] = {SWITCHING: self._kept_temperatures(n).mean(axis=0) - best[n].kelvin}
                continue
            _, shifts, _, _ = mixed_answer(ways, n, best[n].kelvin)
            # beside the straight model at the same draws, so that their number does not count
            lines = [w.linear.run[n].kelvin[:, None] + w.linear.columns[n][:-1] @ sources[:, chosen == k] for k, w in enumerate(ways)]
            straight = np.concatenate(lines, axis=1).mean(axis=1)
            moved[n] = {c: v[:-1] for c, v in shifts.items()} | {BENT: self._kept_temperatures(n).mean(axis=0) - straight}
        return centre_words(moved, job.times)

    @cached_property
    def standing(self) -> Standing:
        """Of the values that it rests on."""
        return self.job.model.standing

    @cached_property
    def assumed(self) -> tuple[str, ...]:
        """Values of the model that are assumed."""
        return assumed(self.job.model)

    def node_temperatures(self, node: str) -> Array:
        """Return the temperatures (members that reached the end, times) of a node. [K]

        Raises
        ------
        NameNotFoundError   With the nearest name.
        ScenarioError       When no member reached the end, or members were counted.
        """
        if self.counts:
            raise ScenarioError(
                f"only the first {self.whole} of {len(self)} members were kept whole. Keep fewer nodes, or samples less often.",
                self.title,
                code="value.outside-range",
            )
        return self._kept_temperatures(node)

    def _kept_temperatures(self, node: str) -> Array:
        """Return the temperatures (members kept whole that reached the end, times) of a node. [K]"""
        return self._followed(node)[0]

    def _followed(self, node: str) -> tuple[Array, MemberTurnings | None]:
        """Return the temperatures (members, times) [K] and the turning points of the members that were kept and reached the end.

        Raises
        ------
        NameNotFoundError   When the node was not stored.
        ScenarioError       When no member reached the end.
        """
        path = self.job.model.canonical(node)
        refuse_unknown([path], self.nodes, self.title, f"'{node}' was not stored.{{near}} Name it in 'nodes'.", NameNotFoundError)
        if len(self.failed) == len(self):
            raise ScenarioError(f"no member reached the end of the run. Member 0: {self.failed[0]}", self.title, code="run.members-failed")
        points = self.turnings.get(path)
        return self.temperatures[self.reached, self.nodes.index(path)], points.taken(
            self.reached, self.whole
        ) if points is not None else None

    @cached_property
    def reached(self) -> NDArray[np.int64]:
        """Members that were kept whole and reached the end."""
        return np.setdiff1d(np.arange(self.whole), np.array(list(self.failed), dtype=np.int64))

    def quantile(self, node: str, share: Any) -> Array:
        """Return the temperature below which a share of the members lies, (times,) or (shares, times). [K]

        Where members were counted it is read off counts and may be wrong by `quantile_error`.
        """
        return (
            self._counted(node, share)[0][..., :-2]
            if self.counts
            else np.asarray(np.quantile(self._kept_temperatures(node), shares_of(share, self.job.model.title), axis=0))
        )

    def quantile_error(self, node: str, share: Any) -> Array:
        """Return by how much `quantile` may be wrong because members were counted in bins: half a bin; zero where they were kept. [K]"""
        return self._counted(node, share)[1][..., :-2] if self.counts else np.zeros_like(self.quantile(node, share))

    def highest_quantile(self, node: str, share: Any) -> Array:
        """Return the highest temperature of the run, between samples too, below which that of a share of the members lies. [degC]"""
        shares = shares_of(share, self.job.model.title)
        highest = self._counted(node, shares)[0][..., -2] if self.counts else np.quantile(self.furthest(node), shares)
        return np.asarray(highest - ICE_POINT)

    def _counted(self, node: str, share: Any) -> tuple[Array, Array]:
        """Return quantiles of the rows of a node, and by how much each may be wrong. [K]"""
        self._kept_temperatures(node)
        quantiles, error = self.counts[self.job.model.canonical(node)].read(shares_of(share, self.job.model.title))
        return quantiles, error

    def furthest(self, node: str, sign: float = 1.0) -> Array:
        """Return the highest (sign 1) or lowest (-1) temperature of each member that reached the end, between samples too. [K]"""
        self.node_temperatures(node)
        return self.sampled(node, None, sign)

    def sampled(self, node: str, at: int | None, sign: float) -> Array:
        """Return the temperature at a time, or the furthest, of the members that were kept whole and reached the end. [K]"""
        samples, points = self._followed(node)
        return samples[:, at] if at is not None else (points or MemberTurnings.joined([])).furthest(samples, sign)

    def highest(self, node: str) -> Array:
        """Return the highest temperature of each member that reached the end, between samples too. [degC]"""
        return self.furthest(node) - ICE_POINT

    def crossings(self, limit: Limit) -> Array:
        """Return when each member that reached the end passes a limit first (members,); infinite where never. [s]

        Raises
        ------
        ScenarioError       When members were counted without this limit.
        """
        if not self.counts:
            return limit.crossings(self.times, *self._followed(limit.node))
        if limit not in self.passed:
            text = f"members were counted without the limit {limit.kelvin - ICE_POINT:g} degC of '{limit.node}'. Give it in 'nodes'."
            raise ScenarioError(text, self.title, code="value.incomplete")
        return np.delete(self.passed[limit], list(self.failed)) if self.failed else self.passed[limit]

    def __str__(self) -> str:
        """The highest temperatures as a short table, 5 % and 95 % of the members below."""
        lines = [f"{self.title}, {self.scenario}: {counted(len(self), 'member')}, {len(self.failed)} failed"]
        lines += [self.not_counted] if self.not_counted else []
        width = max(len(n) for n in self.nodes)
        for n in self.nodes if self.reached.size else ():
            low, middle, high = self.highest_quantile(n, (0.05, 0.5, 0.95))
            lines.append(f"  {n:<{width}}  highest {middle:8.2f} degC   90 % between {low:.2f} and {high:.2f}")
        if self.counts:
            lines.append(f"  the first {self.whole} members were kept whole; all were counted, quantiles may be {self._worst():.2g} mK off")
        lines += [f"  {self.centre}"] if self.centre else []
        if self.assumed:
            lines.append(f"  demonstration, {counted(len(self.assumed), 'assumed parameter')}")
        return self.standing.over("\n".join([*lines, *(f"  warning: {w}" for w in self.warnings)]))

    def _worst(self) -> float:
        """Return by how much the quantiles of the table may be wrong, at most. [mK]"""
        return 1000.0 * max(float(self.quantile_error(n, (0.05, 0.5, 0.95)).max()) for n in self.nodes)

    def _as_traces(self) -> Sequence[PlottedTrace]:
        """Return the median of every node, and where 95 % of the members lie."""
        shares = (0.5, 0.025, 0.975)
        quantiles = [(n, [self.quantile(n, share) - ICE_POINT for share in shares]) for n in self.nodes]
        return [PlottedTrace(n, self.times, middle, low, high) for n, (middle, low, high) in quantiles]


def uncertain_runs(
    model: Model,
    scenario: Scenario | Sequence[Scenario],
    values: Values | Sequence[Values] = (),
    *,
    spread: Mapping[str, Any] | None = None,
    without: Sequence[str] = (),
    n: int = 10_000,
    seed: int = 0,
    nodes: Sequence[str] | Mapping[str, Any] | None = None,
    every: str | float | None = None,
    executor: Workers = None,
    options: Options | None = None,
) -> UncertainRuns:
    """Return runs of a model whose values and surroundings are drawn anew for every member.

    The first members are kept whole while their traces need no more than 32 MB. Where there are more, all are counted, each node at each
    time and its extremes, and memory does not grow with them. A member's draws depend on the seed and its index alone, and members run in
    chunks that are always the same: one process, several and a cluster give the same numbers (bit for bit on machines of one instruction
    set), and more members begin with those of fewer.

    Parameters
    ----------
    model : Model
    scenario : Scenario, or several     Several are draws of the weather, all as likely.
    values : Calibration, FittedValues, Spread, or several      What fits found (laid over the model) and left open (drawn); a `Knowledge`
                                where the values belong to a submodel.
    spread : dict               What else is not known exactly: name as in `ensemble`, or a pattern of parameters -> spread as text;
                                ``start_time`` -> ``{"low": "0 [h]", "high": "6 [h]"}``: all that changes in time is entered at another
                                time, but commands and what ``stays`` names, which count from the start.
    without : sequence of str   Sources that are not counted, as in `predict`.
    n, seed : int               Members; of the draws.
    nodes : sequence of str, or dict    Nodes to keep; the reference points by default. Or node -> limits as in `hold`, which needs them
                                where members are counted; None for a node without.
    every : str or float        Interval of the stored samples; 121 by default.
    executor : executor, str or int    Who runs the chunks, as in `ensemble`. Of `KeptTasks` the folder keeps them: what is there is not run
                                again, and a run that was interrupted goes on.
    options : Options           The integrator's.

    Raises
    ------
    ScenarioError       When a spread is none, a value is spread twice, or there is no such cluster.
    NameNotFoundError   When a name does not exist.
    """
    plan = plan_runs(model, scenario, values, spread=spread, without=without, seed=seed, nodes=nodes, every=every, options=options)
    return members_of_plan(*plan, n, executor)


def _check_members(job: Job, n: int) -> None:
    """Refuse too many members, or none.

    Raises
    ------
    ScenarioError   With how many there may be.
    """
    if n > cap("members"):
        text = f"{n} members are too many; at most {cap('members'):,.0f} are run.{raising('members')}"
        raise ScenarioError(text, job.model.title, code="cap.exceeded")
    if n < 1:
        raise ScenarioError("a campaign of runs needs at least one member.", job.model.title, code="value.outside-range")


def members_of_plan(
    job: Job,
    remarks: tuple[str, ...],
    n: int,
    executor: Workers = None,
    progress: Progress | None = None,
) -> UncertainRuns:
    """Return `n` members of a job: the first kept whole, the others run and counted; `progress` is called with members done and in all.

    Raises
    ------
    ScenarioError   When there are too many members, or none.
    """
    _check_members(job, n)
    kept_tasks = KeptTasks.of_workers(executor)
    store = JobFolder.below(kept_tasks.folder, job.key()) if kept_tasks.folder is not None else None
    campaign = MemberRuns(job, n, job.whole(n), store, kept_tasks.workers, progress)
    sample, whole = campaign.sample(), campaign.whole
    failed = {m: why for c in sample for m, why in c.failed.items()}
    counted = Counted(n, {}, {}, failed, {})
    if whole < n and len(failed) == whole:
        n, remarks = whole, (*remarks, f"none of the first {whole} members reached the end, so the other {n - whole} were not run")
    elif whole < n:
        table = CountTable.of_pilot(job, sample)
        first = [(c.first, table.counted(job, c)) for c in sample]
        counted = Counted.gathered(chain(first, campaign.others(table)), n)
    if counted.failed:
        why = next(iter(counted.failed.values()))
        remarks = (
            *remarks,
            f"{len(counted.failed)} of {n} members failed; temperatures and their bands leave them out. One of them: {why}",
        )
    temperatures = np.empty((whole, len(job.nodes), job.times.size))
    for c in sample:
        temperatures[c.first : c.first + len(c.temperatures)] = c.temperatures
    turnings, blind = _turnings(job, sample)
    campaign.say(0)
    passed = dict(zip(job.limits, counted.rows.get("crossings", ()), strict=False))
    outcome = (counted.failed, counted.tallies, passed, campaign.reused, (*remarks, *blind))
    return UncertainRuns(job, n, temperatures, turnings, *outcome)


def _turnings(job: Job, ordered: Sequence[Chunk]) -> tuple[dict[str, MemberTurnings], tuple[str, ...]]:
    """Return node -> turning points of all members, and a remark on the nodes of which there are none."""
    followed = [node for node in job.nodes if all(node in c.turnings for c in ordered)]
    turnings = {node: MemberTurnings.joined([(c.first, c.turnings[node]) for c in ordered]) for node in followed}
    if len(followed) == len(job.nodes):
        return turnings, ()
    blind = ", ".join(node for node in job.nodes if node not in turnings)
    why = f"only the stored samples of {blind} are known, so a peak between two samples is not included. Give a shorter 'every'"
    return turnings, (why,)
