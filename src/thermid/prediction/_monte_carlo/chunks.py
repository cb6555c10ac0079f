"""A campaign of many runs, chunk by chunk: one process, several, or a cluster; each chunk is kept, none is done twice."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from time import process_time

import numpy as np

from thermid.base.errors import spoken
from thermid.base.linear_algebra import Array
from thermid.model.tree import Model
from thermid.prediction._budget import Budget
from thermid.prediction._setting import Setting
from thermid.simulation.runs import JobFolder, Workers, digest, in_tasks
from thermid.simulation.scenarios import Scenario
from thermid.simulation.solver import MemberTurnings, Options

PARTS = ("members", "times", "kelvin")


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
    """

    budget: Budget
    scenarios: tuple[Scenario, ...]
    nodes: tuple[str, ...]
    times: Array
    seed: int
    chunk: int
    options: Options
    version: str

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
        own = (self.scenarios, drawn, self.nodes, self.times, self.seed, self.chunk, self.options, self.version)
        return digest((self.model.identity(), *own))

    def parts(self, members: int) -> list[tuple[int, int]]:
        """Return the first member and the size of every chunk."""
        return [(first, min(self.chunk, members - first)) for first in range(0, members, self.chunk)]


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


def work(job: Job, first: int, members: int, threads: int = 1) -> Chunk:
    """Return the runs of a chunk of members."""
    chunk = run_members_of(job, job.budget.numbers(job.seed, first, members), threads)
    return replace(chunk, first=first, failed={first + m: why for m, why in chunk.failed.items()})


def run_members_of(job: Job, numbers: Array, threads: int = 1) -> Chunk:
    """Return the runs of members at numbers (sources, members), counted from zero."""
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
        setting = Setting.of(job.budget.each[w][1], scenario=job.scenarios[v], times=job.times, options=job.options)
        drawn = setting.temperatures(sources[:, members], job.nodes, threads)
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


@dataclass(frozen=True)
class ChunkStore:
    """A folder with the chunks of one job, whose name is the job's key.

    Parameters
    ----------
    folder : JobFolder
    """

    folder: JobFolder

    @classmethod
    def of(cls, job: Job, folder: str | os.PathLike[str]) -> ChunkStore:
        """Return the place of a job below a folder."""
        return cls(JobFolder.of(folder, job.key()))

    def load(self, first: int, members: int) -> Chunk | None:
        """Return a chunk that was kept, or None; what cannot be read counts as not there."""
        data = self.folder.load(f"members_{first:07d}_{members}")
        try:
            if data is None:
                return None
            why = dict(zip(data["failed"].tolist(), data["why"].tolist(), strict=True))
            names = [n for n in data["followed"].tolist() if n]
            points = {n: MemberTurnings(*(data[f"turnings{k}_{part}"] for part in PARTS)) for k, n in enumerate(names)}
            return Chunk(first, data["temperatures"], points, why, str(data["simd"]))
        except (ValueError, KeyError):
            return None

    def save(self, chunk: Chunk) -> None:
        """Keep a chunk; the file appears when it is whole."""
        failed, why = np.array(list(chunk.failed), dtype=int), np.array(list(chunk.failed.values()), dtype=str)
        points = {f"turnings{k}_{part}": getattr(t, part) for k, t in enumerate(chunk.turnings.values()) for part in PARTS}
        arrays = {"temperatures": chunk.temperatures, "followed": np.array(list(chunk.turnings), dtype=str), **points}
        name = f"members_{chunk.first:07d}_{chunk.temperatures.shape[0]}"
        self.folder.save(name, {**arrays, "failed": failed, "why": why, "simd": np.array(chunk.simd)})


def chunks(job: Job, wanted: Sequence[tuple[int, int]], executor: Workers, threads: int) -> Iterator[Chunk]:
    """Yield chunks as they are done, by the workers of `in_tasks`."""
    tasks = [(f"members from {first} on", (job, first, members, threads)) for first, members in wanted]
    return (chunk for _, chunk in in_tasks(work, tasks, executor))


TRIED = (8, 64)
"""Members of two chunks that are run to see what one costs, and what a chunk costs besides."""


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
        kept = f", {self.kept} of them kept" if self.kept else ""
        return (
            f"{self.members} members{kept}: about {spoken(self.seconds)} of processor time and {self.size / 1e6:.2g} MB beside the program"
        )

    @classmethod
    def of(cls, job: Job, members: int, kept: int) -> RunCost:
        """Return what so many members take, from two small chunks that are run for it."""
        work(job, 0, TRIED[0])  # loads what is loaded once
        took = []
        for tried in TRIED:
            begun = process_time()
            chunk = work(job, 0, tried)
            took.append(process_time() - begun)
        each = max(took[1] - took[0], 0.0) / (TRIED[1] - TRIED[0])
        left = members - kept
        points = sum(getattr(t, part).nbytes for t in chunk.turnings.values() for part in PARTS)
        size = 2.0 * (chunk.temperatures.nbytes + points) / TRIED[1]  # as chunks, and all together
        return cls(members, kept, left * each + len(job.parts(left)) * max(took[0] - TRIED[0] * each, 0.0), members * size)
