"""`in_tasks`: the results of tasks that do not need each other, from this process, from a pool, or from a cluster.

A task carries all that it needs, and may be done twice. Nothing is handed out beforehand: a worker that joins late is as good as any.
"""

from __future__ import annotations

import json
import logging
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future, as_completed
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from math import inf
from pathlib import Path
from time import sleep
from typing import Any, TypeVar, Union

import numpy as np

from thermid.base.arguments import guard_methods
from thermid.base.errors import ScenarioError, ThermidError, errors_at, optional
from thermid.simulation._many.kept import JobFolder, digest, restored, taken_apart

Made = TypeVar("Made")
Workers = Union[Executor, "KeptTasks", str, int, None]
"""Who does tasks: any executor of `concurrent.futures` (threads, processes, mpi4py's, Dask's ``client.get_executor()``); the address of a
Dask scheduler, ``tcp://host:8786``; ``"joblib"``, the backend of `joblib.parallel_config`; a number of processes of this machine; None for
this process alone; any of these with a folder for what is finished, `KeptTasks`."""
PATIENCE = 20.0
"""How long a cluster may take to answer, and may be without workers. [s]"""
PROCESSES_PAY = 20.0
"""Processor time below which processes of this machine cost more than they save. [s]"""
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""Environment of processes of this machine: they share its cores already."""
HANDED, AGAIN = 5, 0.1
"""How often a task is handed out, and how long is waited between; a cluster needs a moment to notice that a worker is gone. [s]"""
Call = tuple[Callable[..., Any], str, str, tuple[Any, ...]]


def in_tasks(
    function: Callable[..., Made], tasks: Sequence[tuple[str, tuple[Any, ...]]], workers: Workers, seconds: float = inf
) -> Iterator[tuple[int, Made]]:
    """Yield the position of each task and its result as they finish; tasks not yet begun are cancelled when the caller stops asking.

    Parameters
    ----------
    function : callable     At the top level of a module, so that a worker finds it.
    tasks : sequence        What each is, for messages, and the arguments.
    workers : see `Workers`
    seconds : float         What all will take one after the other, if known: below `PROCESSES_PAY` no processes are begun.

    Raises
    ------
    ScenarioError       When there are no such workers, one has another version, or ended while it was at work.
    ThermidError        Of a task, which it names.
    MissingExtraError   When joblib or distributed is needed and not installed.
    """
    from importlib.metadata import version

    if isinstance(workers, KeptTasks) and workers.folder is not None:
        yield from workers.results(function, tasks, seconds)
        return
    workers = KeptTasks.of_workers(workers).workers
    calls = [(function, version("thermid"), name, arguments) for name, arguments in tasks]
    if isinstance(workers, int) and workers < 1:
        raise ScenarioError(f"{workers} processes cannot do anything. Give at least one.", code="value.outside-range")
    if workers is None or (isinstance(workers, int) and (min(workers, len(tasks)) <= 1 or seconds < PROCESSES_PAY)):
        yield from map(_done, enumerate(calls))
    elif isinstance(workers, str) and workers == "joblib":
        joblib = optional("joblib", "a run on several processes")
        with _worker_errors_named("of joblib"):
            pool = joblib.Parallel(return_as="generator_unordered")
            yield from pool(joblib.delayed(_done)(call) for call in enumerate(calls))
    else:
        with ExitStack() as stack:
            yield from _by(_pool(workers, stack), calls, f"of '{workers}'" if isinstance(workers, str) else "of the pool")


@guard_methods
@dataclass(frozen=True)
class KeptTasks:
    """Workers whose finished tasks stay in a folder: the `executor` of any loop, which then goes on where an earlier one ended.

    A task is known by what it computes, from which values, and by the version of thermid. Results are kept as arrays and JSON; nothing in
    the folder is run.

    Parameters
    ----------
    folder : path               It may serve any number of loops.
    workers : see `Workers`     Who does the tasks that the folder does not have.
    """

    folder: str | os.PathLike[str] | None
    workers: Executor | str | int | None = None

    @classmethod
    def of_workers(cls, workers: Workers) -> KeptTasks:
        """Return any workers with their folder, None where they have none."""
        return workers if isinstance(workers, KeptTasks) else cls(None, workers)

    def key(self, function: Callable[..., Any], arguments: tuple[Any, ...]) -> str:
        """Return the name of a task."""
        from importlib.metadata import version

        return digest((version("thermid"), function, arguments))

    def load(self, key: str) -> tuple[Any] | None:
        """Return what a finished task returned, alone in a tuple; None where it is not there."""
        arrays = JobFolder(Path(self.folder or "")).load(key)
        return (restored(json.loads(str(arrays["about"])), arrays),) if arrays is not None else None

    def save(self, key: str, result: Any) -> None:
        """Keep what a task returned: numbers, texts, arrays, and dataclasses, tuples, lists and tables of them."""
        arrays: dict[str, Any] = {}
        place = Path(self.folder or "")
        place.mkdir(parents=True, exist_ok=True)
        JobFolder(place).save(key, {"about": np.array(json.dumps(taken_apart(result, arrays))), **arrays})

    def results(
        self, function: Callable[..., Made], tasks: Sequence[tuple[str, tuple[Any, ...]]], seconds: float
    ) -> Iterator[tuple[int, Made]]:
        """Yield position and result of each task, those first that the folder has; each of the others goes there when it is done."""
        keys = [self.key(function, arguments) for _, arguments in tasks]
        open_ = []
        for k, key in enumerate(keys):
            if (loaded := self.load(key)) is not None:
                yield k, loaded[0]
            else:
                open_.append(k)
        for at, result in in_tasks(function, [tasks[k] for k in open_], self.workers, seconds * len(open_) / max(len(tasks), 1)):
            self.save(keys[open_[at]], result)
            yield open_[at], result


def _pool(workers: Executor | str | int, stack: ExitStack) -> Executor:
    """Return the executor of `workers`: the caller's own, local processes, or a Dask client that `stack` closes."""
    if isinstance(workers, Executor):
        return workers
    if isinstance(workers, int):
        return optional("joblib.externals.loky", "a run on several processes").get_reusable_executor(  # type: ignore[no-any-return]
            max_workers=workers, env=ONE_THREAD, initializer=_leave_interrupts
        )
    if not isinstance(workers, str) or "://" not in workers:
        raise ScenarioError(f"'{workers!s:.60}' is no address of a scheduler. Write tcp://host:8786, or joblib.", code="run.cluster")
    distributed = optional("distributed", "a run on several processes")
    # what these say of workers and schedulers that end, with tracebacks, is told by `_lost`
    for log in map(logging.getLogger, ("distributed.client", "tornado.application")):
        stack.callback(setattr, log, "disabled", log.disabled)
        log.disabled = True
    try:
        client = distributed.Client(workers, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        raise ScenarioError(
            f"no cluster responds at '{workers}'. Start one: dask scheduler, then dask worker {workers}.", code="run.cluster"
        ) from error
    return stack.enter_context(client).get_executor(pure=False)  # type: ignore[no-any-return]


def _by(pool: Executor, calls: Sequence[Call], whose: str) -> Iterator[tuple[int, Any]]:
    """Yield position and result of each call as a pool finishes them; raise where a cluster has lost all its workers."""
    open_: set[Future[tuple[int, Any]]] = set()
    try:
        for call in enumerate(calls):
            open_.add(_handed(pool, call, whose))
        cluster = getattr(pool, "_client", None)  # of Dask's executor
        while open_:
            ready = as_completed(open_, None if cluster is None else PATIENCE)
            while (future := _next(ready)) is not None:
                open_.discard(future)
                with _worker_errors_named(whose, cluster):
                    result = future.result()
                del future
                yield result
                del result  # it is kept by nobody but the caller
            if open_ and cluster is not None and not cluster.nthreads():  # without a worker it would wait for one, and say nothing
                raise _lost(whose)
    finally:
        with suppress(OSError):  # of a scheduler that ended, which must not hide why this ends
            for future in open_:
                future.cancel()


def _next(ready: Iterator[Future[tuple[int, Any]]]) -> Future[tuple[int, Any]] | None:
    """Return the next finished task; None where all are finished, or none finished in time."""
    try:
        return next(ready, None)
    except TimeoutError:
        return None


def _handed(pool: Executor, call: tuple[int, Call], whose: str) -> Future[tuple[int, Any]]:
    """Submit a task and return its future, trying again where the scheduler chose a worker that has just ended.

    Raises
    ------
    ScenarioError       When no worker took it.
    """
    error: Exception = KeyError()
    for _ in range(HANDED):
        try:
            return pool.submit(_done, call)
        except (KeyError, OSError, RuntimeError) as lost:  # by KeyError a scheduler looks a worker up that is no longer there
            error = lost
            sleep(AGAIN)
    raise _lost(whose) from error


def _leave_interrupts() -> None:
    """Ignore the interrupt key in a worker: it finishes what it has begun, and the calling process decides."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


@contextmanager
def _worker_errors_named(whose: str, cluster: Any = None) -> Iterator[None]:
    """Raise `ScenarioError` in place of the errors by which a pool or a client of a cluster says that a worker or the scheduler ended.

    `whose` names the pool.
    """
    try:
        yield
    except Exception as error:
        if isinstance(error, BrokenExecutor | CancelledError) or type(error).__module__.partition(".")[0] == "distributed":
            raise _lost(whose, cluster) from error
        raise


def _lost(whose: str, cluster: Any = None) -> ScenarioError:
    """Return the error that a worker of a pool, or the scheduler of a client of a cluster, ended while it was at work."""
    if cluster is not None and cluster.status != "running":
        return ScenarioError(f"the scheduler {whose} ended. Start it again with its workers, then ask again.", code="run.cluster")
    return ScenarioError(
        f"a worker {whose} ended while it was at work. Start it again, with more memory if it had too little.", code="run.worker-lost"
    )


def _done(numbered: tuple[int, Call]) -> tuple[int, Any]:
    """Run a task, (position, (function, version, name, arguments)), and return its position and result: what a worker executes.

    Raises
    ------
    ScenarioError   When this is another version than the caller's.
    """
    from importlib.metadata import version

    place, (function, wanted, name, arguments) = numbered
    if (here := version("thermid")) != wanted:
        raise ScenarioError(f"a worker has thermid {here}, this is {wanted}. Install one version everywhere.", code="run.cluster")
    try:
        with errors_at(name, ", "):
            return place, function(*arguments)
    except Exception as error:
        if not isinstance(error, ThermidError):
            error.add_note(f"thermid was at {name}")
        raise
