"""A campaign of many runs, chunk by chunk: one process, several, or a cluster; each chunk is kept, none is done twice."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from thermid.base.errors import ScenarioError
from thermid.base.extensions import optional
from thermid.base.files import OWN, replacing, sweep
from thermid.base.linear_algebra import Array
from thermid.model.tree import Model
from thermid.prediction._budget import Budget
from thermid.prediction._setting import Setting
from thermid.simulation.scenarios import Scenario
from thermid.simulation.solver import MemberTurnings, Options

PARTS = ("members", "times", "kelvin")
PATIENCE = "20s"
"""How long a cluster may take to answer."""


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
    version, simd : str                     Of thermid where it was run; the instruction set.
    """

    first: int
    temperatures: Array
    turnings: Mapping[str, MemberTurnings]
    failed: Mapping[int, str]
    version: str
    simd: str

    def highest(self, nodes: Sequence[str], node: str) -> Array:
        """Return the highest temperature (members,) of one of the nodes, between samples too where it was followed. [K]"""
        points = self.turnings.get(node) or MemberTurnings.joined([])
        return points.furthest(self.temperatures[:, nodes.index(node)], 1.0)


def digest(thing: Any) -> str:
    """Return a hash of numbers, texts, arrays, tables and dataclasses, however nested."""
    return hashlib.sha256(json.dumps(_plain(thing), sort_keys=True).encode()).hexdigest()[:16]


def _plain(thing: Any) -> Any:
    if isinstance(thing, np.ndarray):
        return [str(thing.dtype), list(thing.shape), hashlib.sha256(np.ascontiguousarray(thing).tobytes()).hexdigest()]
    if is_dataclass(thing):
        return [type(thing).__name__, *(_plain(getattr(thing, f.name)) for f in fields(thing))]
    if isinstance(thing, Mapping):
        return {str(k): _plain(v) for k, v in thing.items()}
    if isinstance(thing, tuple | list):
        return [_plain(v) for v in thing]
    return thing.item() if isinstance(thing, np.generic) else float(thing).hex() if isinstance(thing, float) else thing


def work(job: Job, first: int, members: int, threads: int = 1) -> Chunk:
    """Return the runs of a chunk of members."""
    from importlib.metadata import version

    chunk = run_members_of(job, job.budget.numbers(job.seed, first, members), threads)
    return replace(chunk, first=first, failed={first + m: why for m, why in chunk.failed.items()}, version=version("thermid"))


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
    return Chunk(0, out, followed, failed, "", simd)


@dataclass(frozen=True)
class ChunkStore:
    """A folder with the chunks of one job, whose name is the job's key.

    Parameters
    ----------
    folder : Path
    """

    folder: Path

    @classmethod
    def of(cls, job: Job, folder: str | os.PathLike[str]) -> ChunkStore:
        """Return the place of a job below a folder."""
        place = Path(folder) / job.key()
        place.mkdir(parents=True, exist_ok=True)
        for each in (place, *Path(folder).glob("[0-9a-f]" * 16)):  # a job that was killed may never be asked again
            sweep(each)
        return cls(place)

    def _path(self, first: int, members: int) -> Path:
        return self.folder / f"members_{first:07d}_{members}.npz"

    def load(self, first: int, members: int) -> Chunk | None:
        """Return a chunk that was kept, or None; what cannot be read counts as not there."""
        try:
            with self._path(first, members).open("rb") as file, np.load(file) as data:
                why = dict(zip(data["failed"].tolist(), data["why"].tolist(), strict=True))
                names = [n for n in data["followed"].tolist() if n]
                points = {n: MemberTurnings(*(data[f"turnings{k}_{part}"] for part in PARTS)) for k, n in enumerate(names)}
                return Chunk(first, data["temperatures"], points, why, str(data["version"]), str(data["simd"]))
        except (OSError, ValueError, KeyError, EOFError, BadZipFile):
            return None

    def save(self, chunk: Chunk) -> None:
        """Keep a chunk; the file appears when it is whole."""
        path = self._path(chunk.first, chunk.temperatures.shape[0])
        failed, why = np.array(list(chunk.failed), dtype=int), np.array(list(chunk.failed.values()), dtype=str)
        version, simd = np.array(chunk.version), np.array(chunk.simd)
        with replacing(path, OWN) as half:
            points = {f"turnings{k}_{part}": getattr(t, part) for k, t in enumerate(chunk.turnings.values()) for part in PARTS}
            arrays = {"temperatures": chunk.temperatures, "followed": np.array(list(chunk.turnings), dtype=str), **points}
            np.savez(half, **arrays, failed=failed, why=why, version=version, simd=simd)


def chunks(job: Job, wanted: Sequence[tuple[int, int]], workers: int, cluster: str, threads: int) -> Iterator[Chunk]:
    """Yield chunks as they are done: here, in processes of this machine, or by a cluster."""
    if cluster:
        yield from _by_cluster(job, wanted, cluster)
    elif workers > 1:
        yield from _by_processes(job, wanted, workers)
    else:
        for first, members in wanted:
            yield work(job, first, members, threads)


def _by_processes(job: Job, wanted: Sequence[tuple[int, int]], workers: int) -> Iterator[Chunk]:
    joblib = optional("joblib", "a run on several processes")
    pool = joblib.Parallel(n_jobs=workers, return_as="generator_unordered")
    yield from pool(joblib.delayed(work)(job, first, members) for first, members in wanted)


def _by_cluster(job: Job, wanted: Sequence[tuple[int, int]], address: str) -> Iterator[Chunk]:
    distributed = optional("distributed", "a run on several processes")
    try:
        client = distributed.Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        raise ScenarioError(f"no cluster responds at '{address}'. Start one: dask scheduler, then dask worker {address}.") from error
    with client:
        lost = ScenarioError(
            f"a worker of the cluster at '{address}' ended while it was at work. Start it again, with more memory if it had too little.",
            code="run.worker-lost",
        )
        try:
            shared = client.scatter(job, broadcast=True)
            futures = [client.submit(work, shared, first, members, pure=False) for first, members in wanted]
        except (KeyError, OSError) as error:  # the scheduler looks a worker up that is no longer there
            raise lost from error
        try:
            for future in distributed.as_completed(futures, loop=client.loop):
                yield future.result()
        except BaseException as error:
            client.cancel(futures)
            raise (lost if isinstance(error, distributed.KilledWorker) else error) from None
