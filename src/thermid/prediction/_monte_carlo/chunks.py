"""A campaign of many runs, chunk by chunk: the first members whole, the others counted; what is finished is kept, none is done twice."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from operator import itemgetter
from time import process_time
from typing import Any, TypeVar

import numpy as np

from thermid.base.errors import spoken
from thermid.base.units import Array, Indices
from thermid.model.tree import Model
from thermid.prediction._budget import Budget
from thermid.prediction._setting import Setting, prepared
from thermid.simulation.runs import PILOT, Counted, JobFolder, MemberTurnings, Options, Scenario, Workers, digest, in_tasks

TURNING_FIELDS = ("members", "times", "kelvin")
SAMPLE = 32_000_000
"""Bytes of the traces that are kept of the first members, whole."""
SHARES = 6
"""Members that are counted by one task are at most this part of those before them, so that tasks stay few and a longer job begins alike."""


Made = TypeVar("Made")


@dataclass(frozen=True, eq=False)
class Job:
    """What every chunk needs, and all that its numbers depend on.

    Parameters
    ----------
    budget : Budget                 What differs from member to member.
    scenarios : tuple of Scenario   Variants, one of which every member has.
    nodes : tuple of str            Nodes whose temperatures are kept.
    times : array (times,)          [s]
    seed, chunk : int               Of the draws; members that run together.
    options : Options               Of the integrator.
    version : str                   Of thermid.
    limits : tuple of Limit         Whose crossings are kept of members that are counted; not in the key: no trace depends on them.
    """

    budget: Budget
    scenarios: tuple[Scenario, ...]
    nodes: tuple[str, ...]
    times: Array
    seed: int
    chunk: int
    options: Options
    version: str
    limits: tuple[Limit, ...] = ()

    @property
    def model(self) -> Model:
        """The model, values laid over it."""
        return self.budget.model

    @property
    def variant(self) -> int | None:
        """Position of the source that chooses a member's scenario; None where there is one scenario."""
        return next((k for k, s in enumerate(self.budget.sources) if s.kind == "variant"), None)

    def key(self) -> str:
        """Return a hash of all of it."""
        b = self.budget
        drawn = (b.sources, b.alike, b.targets, b.gain, b.ways)
        settings = (self.scenarios, drawn, self.nodes, self.times, self.seed, self.chunk, self.options, self.version)
        return digest((self.model.identity(), *settings))

    def parts(self, first: int, end: int) -> list[tuple[int, int]]:
        """Return the first member and the size of every chunk."""
        return [(at, min(self.chunk, end - at)) for at in range(first, end, self.chunk)]

    def whole(self, members: int) -> int:
        """Return how many of the members are kept whole where nobody asks for more: whole chunks, a pilot at least."""
        fit = max(SAMPLE // (8 * max(len(self.nodes), 1) * self.times.size) // self.chunk, -(-PILOT // self.chunk)) * self.chunk
        return min(fit, members)

    def counted(self, first: int, end: int) -> list[tuple[int, int]]:
        """Return the first member and the number of members of every task that counts."""
        out = []
        while first < end:
            size = self.chunk << max((first // (SHARES * self.chunk)).bit_length() - 1, 0)
            out.append((first, min(size, end - first)))
            first += size
        return out


@dataclass(frozen=True, eq=False)
class Chunk:
    """Some members that were run.

    Parameters
    ----------
    first : int                             Index of the first.
    temperatures : array (members, nodes, times)    NaN where a member failed. [K]
    turnings : dict                         Node -> turning points between the times, members counted from `first`; a node is missing where
                                            they were not followed.
    failed : dict                           Member -> why it did not reach the end.
    simd : str                              Instruction set where it was run.
    """

    first: int
    temperatures: Array
    turnings: Mapping[str, MemberTurnings]
    failed: Mapping[int, str]
    simd: str

    def highest(self, nodes: Sequence[str], node: str) -> Array:
        """Return the highest temperature (members,) of one of the nodes, between samples too where it was followed. [K]"""
        points = self.turnings.get(node) or MemberTurnings.joined([])
        return points.furthest(self.temperatures[:, nodes.index(node)], 1.0)

    def reached(self) -> Indices:
        """Return the members that reached the end, counted from `first`."""
        return np.setdiff1d(np.arange(self.temperatures.shape[0]), np.array(list(self.failed), dtype=np.int64) - self.first)

    def rows(self, nodes: Sequence[str], node: str) -> Array:
        """Return the rows (times + 2, members that reached the end) of one of the nodes, see `MemberTurnings.rows`. [K]"""
        return (self.turnings.get(node) or MemberTurnings.joined([])).rows(self.temperatures[:, nodes.index(node)].T)[:, self.reached()]


def first_crossings(times: Array, above: Array, turnings: MemberTurnings | None = None) -> Array:
    """Return when each member is above zero first, on straight lines between what is known; infinite where never. [s]

    Parameters
    ----------
    times : array (times,)              [s]
    above : array (members, times)      Samples.
    turnings : MemberTurnings           Turning points between them, in the same measure; a peak between two samples counts.
    """
    over = above > 0.0
    k = over.argmax(axis=1)
    out = np.where(over.any(axis=1), times[k], np.inf)
    rows = np.flatnonzero(np.isfinite(out) & (k > 0))
    before, after = above[rows, k[rows] - 1], above[rows, k[rows]]
    out[rows] = times[k[rows] - 1] + (times[k[rows]] - times[k[rows] - 1]) * (-before) / (after - before)
    if turnings is None:
        return np.asarray(out)
    peaks = np.flatnonzero(turnings.kelvin > 0.0)
    members, first = np.unique(turnings.members[peaks], return_index=True)
    first = peaks[first]  # the first turning point above zero of each member that has one
    last = np.where(over[members].any(axis=1), times[k[members]], np.inf)
    early = turnings.times[first] < last
    for member, point in zip(members[early].tolist(), first[early].tolist(), strict=True):
        time, high = float(turnings.times[point]), float(turnings.kelvin[point])
        sample = int(np.searchsorted(times, time)) - 1  # all samples before are below
        points_before = [(float(times[sample]), float(above[member, sample]))] if sample >= 0 else []
        if point and turnings.members[point - 1] == member:
            points_before.append((float(turnings.times[point - 1]), float(turnings.kelvin[point - 1])))
        start, low = max(points_before, default=(time, high))
        out[member] = time if low >= high else start + (time - start) * (-low) / (high - low)
    return np.asarray(out)


@dataclass(frozen=True)
class Limit:
    """A temperature that a node is not to pass.

    Parameters
    ----------
    node : str      Its path.
    side : float    1 for a highest, -1 for a lowest temperature.
    kelvin : float  [K]
    """

    node: str
    side: float
    kelvin: float

    def crossings(self, times: Array, samples: Array, turnings: MemberTurnings | None) -> Array:
        """Return when each member passes it first (members,), from samples (members, times) [K]; infinite where never. [s]"""
        above = replace(turnings, kelvin=self.side * (turnings.kelvin - self.kelvin)) if turnings is not None else None
        return first_crossings(times, self.side * (samples - self.kelvin), above)


def work(job: Job, first: int, members: int, settings: Settings | None = None) -> Chunk:
    """Return the runs of members first, first + 1, ..., first + members - 1; `settings` are reused from chunk to chunk."""
    chunk = run_members_of(job, job.budget.numbers(job.seed, first, members), settings)
    return replace(chunk, first=first, failed={first + m: why for m, why in chunk.failed.items()})


@dataclass(frozen=True, eq=False)
class CountTable:
    """On which grids members are counted, and the limits whose crossings are kept of each.

    Parameters
    ----------
    grids : dict        Node -> grid of its rows: the times, the highest and the lowest.
    limits : tuple of Limit
    """

    grids: Mapping[str, Any]
    limits: tuple[Limit, ...]

    @classmethod
    def of_pilot(cls, job: Job, pilot: Sequence[Chunk]) -> CountTable:
        """Return the table for what the first members did; without grids where none reached the end."""
        return cls(Counted.grids({n: np.concatenate([c.rows(job.nodes, n) for c in pilot], axis=1) for n in job.nodes}), job.limits)

    def counted(self, job: Job, chunk: Chunk) -> Counted:
        """Return what is kept of a chunk."""
        counted = {n: chunk.rows(job.nodes, n) for n in self.grids}
        samples = {x.node: chunk.temperatures[:, job.nodes.index(x.node)] for x in self.limits}
        crossings = [x.crossings(job.times, samples[x.node], chunk.turnings.get(x.node)) for x in self.limits]
        failed = {m - chunk.first: why for m, why in chunk.failed.items()}
        rows = {"crossings": np.array(crossings)} if crossings else {}
        return Counted.on_grids(self.grids, counted, len(chunk.temperatures), failed, {"simd": chunk.simd}, rows)

    def name(self, first: int, members: int) -> str:
        """Return the name of the file of a task."""
        return f"counts_{first:07d}_{members}_{digest((self.limits, self.grids))}"


def count(job: Job, table: CountTable, first: int, members: int) -> Counted:
    """Return what is kept of members that are run chunk by chunk; their traces are dropped."""
    settings: Settings = {}
    parts = ((at - first, table.counted(job, work(job, at, size, settings))) for at, size in job.parts(first, first + members))
    return Counted.gathered(parts, members)


Settings = dict[tuple[int, int], Setting]
"""Scenario and way of carrying heat -> the budget made ready for them."""


def run_members_of(job: Job, numbers: Array, settings: Settings | None = None) -> Chunk:
    """Return the runs of members at numbers (sources, members) in (0, 1): temperatures (members, nodes, times) [K], NaN where one fails.

    Members with one variant of the scenario and one way of the model of error run together. `settings` keeps what was prepared.
    """
    ready = {} if settings is None else settings
    sources = job.budget.drawn(numbers)
    chosen = sources[job.variant].astype(np.int64) if job.variant is not None else np.zeros(numbers.shape[1], dtype=np.int64)
    out = np.full((numbers.shape[1], len(job.nodes), job.times.size), np.nan)
    failed: dict[int, str] = {}
    turnings: dict[str, list[MemberTurnings]] = {n: [] for n in job.nodes}
    simd = ""
    way = job.budget.chosen(sources)
    pairs = sorted(set(zip(chosen.tolist(), way.tolist(), strict=True)))
    for v, w in pairs:
        members = np.flatnonzero((chosen == v) & (way == w))
        if (v, w) not in ready:
            ready[v, w] = Setting.of_budget(
                job.budget.weighted_ways[w][1], prepared(job.budget, scenario=job.scenarios[v], times=job.times, options=job.options)
            )
        drawn = ready[v, w].temperatures(sources[:, members], job.nodes)
        if drawn.runs is not None:
            failed |= {int(members[m]): why for m, why in drawn.runs.failed.items()}
            simd = str(drawn.runs.statistics["simd"])
        for k, node in enumerate(job.nodes):
            out[members, k] = drawn.kelvin[node].T
            if node in drawn.turnings:
                points = drawn.turnings[node]
                turnings[node].append(replace(points, members=members[points.members]))
    followed = {n: MemberTurnings.joined([(0, p) for p in parts]).sorted() for n, parts in turnings.items() if len(parts) == len(pairs)}
    return Chunk(0, out, followed, failed, simd)


def chunk_name(first: int, members: int) -> str:
    """Return the name of the file of a chunk that is kept whole."""
    return f"members_{first:07d}_{members}"


def as_arrays(chunk: Chunk) -> dict[str, Any]:
    """Return a chunk as arrays for a file: temperatures [K], turning points [s, K], failed members and why."""
    failed, why = np.array(list(chunk.failed), dtype=int), np.array(list(chunk.failed.values()), dtype=str)
    points = {f"turnings{k}_{part}": getattr(t, part) for k, t in enumerate(chunk.turnings.values()) for part in TURNING_FIELDS}
    arrays = {"temperatures": chunk.temperatures, "followed": np.array(list(chunk.turnings), dtype=str), **points}
    return {**arrays, "failed": failed, "why": why, "simd": np.array(chunk.simd)}


def as_chunk(data: Mapping[str, Any] | None, first: int) -> Chunk | None:
    """Return the chunk that arrays of a file hold, or None where they do not."""
    try:
        if data is None:
            return None
        why = dict(zip(data["failed"].tolist(), data["why"].tolist(), strict=True))
        names = [n for n in data["followed"].tolist() if n]
        points = {n: MemberTurnings(*(data[f"turnings{k}_{part}"] for part in TURNING_FIELDS)) for k, n in enumerate(names)}
        return Chunk(first, data["temperatures"], points, why, str(data["simd"]))
    except (ValueError, KeyError):
        return None


Progress = Callable[[int, int], None]


@dataclass(eq=False)
class MemberRuns:
    """Members that are being run.

    Parameters
    ----------
    job : Job
    members, whole : int        In all; how many of these, the first, are kept whole.
    folder : JobFolder          Where finished work is left; None for nowhere.
    executor, progress      As in `members_of_plan`.
    done, reused : int          Members that are done; of these, taken from the folder.
    """

    job: Job
    members: int
    whole: int
    folder: JobFolder | None
    executor: Workers
    progress: Progress | None
    done: int = 0
    reused: int = 0
    _told: bool = field(default=False, init=False)

    def chunks(self) -> Iterator[tuple[int, Chunk]]:
        """Yield the members that are kept whole, with the first of each chunk, in any order."""
        tasks = {(first, size): (self.job, first, size) for first, size in self.job.parts(0, self.whole)}
        return self._run_or_read(work, tasks, chunk_name, as_arrays, as_chunk)

    def sample(self) -> list[Chunk]:
        """Return the members that are kept whole."""
        return [chunk for _, chunk in sorted(self.chunks(), key=itemgetter(0))]

    def others(self, table: CountTable) -> Iterator[tuple[int, Counted]]:
        """Yield what is kept of the other members, with the first of each part."""
        parts = self.job.counted(self.whole, self.members)[:: 1 if self.executor is None else -1]  # workers begin with the longest
        tasks = {(first, size): (self.job, table, first, size) for first, size in parts}
        return self._run_or_read(count, tasks, table.name, Counted.arrays, lambda arrays, _: Counted.read(arrays, table.grids))

    def members_in_folder(self) -> int:
        """Return how many members the folder has; none is run."""
        if self.folder is None:
            return 0
        parts = {p: as_chunk(self.folder.load(chunk_name(*p)), p[0]) for p in self.job.parts(0, self.whole)}
        chunks = [c for c in parts.values() if c is not None]
        members = sum(len(c.temperatures) for c in chunks)
        if len(chunks) < len(parts):
            return members
        table = CountTable.of_pilot(self.job, chunks)
        others = self.job.counted(self.whole, self.members)
        return members + sum(size for first, size in others if self.folder.load(table.name(first, size)) is not None)

    def _run_or_read(
        self,
        function: Callable[..., Made],
        tasks: Mapping[tuple[int, int], tuple[Any, ...]],
        name: Callable[[int, int], str],
        arrays: Callable[[Made], dict[str, Any]],
        read: Callable[[Mapping[str, Any] | None, int], Made | None],
    ) -> Iterator[tuple[int, Made]]:
        """Yield the results of tasks with the first member of each: those that the folder has, then the others as they are done."""
        open_ = []
        for first, size in tasks:
            stored = read(self.folder.load(name(first, size)), first) if self.folder is not None else None
            if stored is None:
                open_.append((first, size))
                continue
            self.reused += size
            self.done += size
            yield first, stored
        if open_:
            self.say(0)
        calls = [(f"members from {first} on", tasks[first, size]) for first, size in open_]
        for k, result in in_tasks(function, calls, self.executor, seconds=self._ahead(open_)) if calls else ():
            first, size = open_[k]
            if self.folder is not None:
                self.folder.save(name(first, size), arrays(result))
            self.say(size)
            yield first, result

    def _ahead(self, open_: Sequence[tuple[int, int]]) -> float:
        """Return the processor time that members take; asked where it decides whether processes are begun. [s]"""
        if not isinstance(self.executor, int):
            return math.inf
        seconds_per_member, besides, _ = pace_of(self.job)
        return sum(size * seconds_per_member + besides * math.ceil(size / self.job.chunk) for _, size in open_)

    def say(self, more: int) -> None:
        """Say how many members are done; of nothing new once alone, before the first begins or where all were kept."""
        self.done += more
        if self.progress is not None and (more or not self._told):
            self.progress(self.done, self.members)
        self._told = True


HELD_TABLES = 4
"""Tables of counts that are held at once: one that is made, one that arrives, and what they are joined with and to."""
PACE_CHUNKS = (8, 64)
"""Members of two chunks that are run to see what one costs, and what a chunk costs besides."""


def pace_of(job: Job) -> tuple[float, float, Chunk]:
    """Return a and b of a chunk's processor time a members + b [s], by two chunks of `PACE_CHUNKS` members, and the larger chunk."""
    work(job, 0, PACE_CHUNKS[0])  # loads what is loaded once
    took = []
    for tried in PACE_CHUNKS:
        begun = process_time()
        chunk = work(job, 0, tried)
        took.append(process_time() - begun)
    seconds_per_member = max(took[1] - took[0], 0.0) / (PACE_CHUNKS[1] - PACE_CHUNKS[0])
    return seconds_per_member, max(took[0] - PACE_CHUNKS[0] * seconds_per_member, 0.0), chunk


@dataclass(frozen=True)
class RunCost:
    """What a campaign of runs will take, before it is begun.

    Parameters
    ----------
    members, kept : int     How many are asked for; of these, how many a folder has already.
    seconds : float         Processor time. [s]
    size : float            Memory beside that of the program. [bytes]
    """

    members: int
    kept: int
    seconds: float
    size: float

    def __str__(self) -> str:
        """It in one line."""
        reuse = f", {self.kept} of them kept" if self.kept else ""
        return (
            f"{self.members} members{reuse}: about {spoken(self.seconds)} of processor time and {self.size / 1e6:.2g} MB beside the program"
        )

    @classmethod
    def of_members(cls, job: Job, members: int, members_kept: int) -> RunCost:
        """Return what so many members take, from two small chunks that are run for it."""
        seconds_per_member, besides, chunk = pace_of(job)
        remaining, whole = members - members_kept, job.whole(members)
        points = sum(getattr(t, part).nbytes for t in chunk.turnings.values() for part in TURNING_FIELDS)
        size = whole * 2.0 * (chunk.temperatures.nbytes + points) / PACE_CHUNKS[1]  # as chunks, and all together
        if whole < members:
            size += HELD_TABLES * sum(8.0 * g.bins.sum() for g in CountTable.of_pilot(job, [chunk]).grids.values())
        return cls(members, members_kept, remaining * seconds_per_member + len(job.parts(0, remaining)) * besides, size)
