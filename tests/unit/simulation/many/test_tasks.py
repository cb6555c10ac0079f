"""Who does tasks: every kind of worker gives the same results, and a mistake says whose it is."""

from __future__ import annotations

import multiprocessing
import os
import weakref
from collections.abc import Callable
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from threading import Event
from types import SimpleNamespace
from typing import Any

import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import ScenarioError
from thermid.simulation._many import tasks
from thermid.simulation._many.tasks import in_tasks

TASKS = [(f"number {k}", (k,)) for k in range(7)]


def square(k: int) -> int:
    return k * k


def spoiled(k: int) -> int:
    if k == 3:
        raise ScenarioError("it went wrong.", "deck.toml")
    if k == 5:
        raise ZeroDivisionError("nothing to divide by")
    return k


def ends(k: int) -> int:
    os._exit(1)


def processes() -> ProcessPoolExecutor:
    return ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("forkserver"))


@pytest.mark.parametrize("workers", [None, 1, ThreadPoolExecutor(3), "joblib"])
def test_results_have_the_place_of_their_task(workers: Any) -> None:
    assert dict(in_tasks(square, TASKS, workers)) == {k: k * k for k in range(7)}
    assert list(in_tasks(square, [], workers)) == []


@pytest.mark.parametrize("pool", [lambda: None, lambda: ThreadPoolExecutor(1), processes])
def test_an_error_names_its_task(pool: Callable[[], Executor | None]) -> None:
    with pytest.raises(ScenarioError, match=r"number 3, deck\.toml: it went wrong"):
        list(in_tasks(spoiled, TASKS[:4], pool()))
    with pytest.raises(ZeroDivisionError) as caught:
        list(in_tasks(spoiled, TASKS[4:], pool()))
    assert caught.value.__notes__ == ["thermid was at number 5"]


def test_a_process_that_ends_is_told_of_in_a_sentence() -> None:
    with raises_code("run.worker-lost", ScenarioError):
        list(in_tasks(ends, TASKS, processes()))


def test_a_worker_of_another_version_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    found = iter(["1.0", "0.9"])
    monkeypatch.setattr("importlib.metadata.version", lambda _: next(found))
    with pytest.raises(ScenarioError, match=r"0\.9.* 1\.0"):
        list(in_tasks(square, TASKS[:1], None))


def test_what_is_not_wanted_any_more_is_not_begun() -> None:
    begun, gate = [], Event()

    def waits(k: int) -> None:
        begun.append(k)
        assert k == 0 or gate.wait(10.0)

    with ThreadPoolExecutor(1) as pool:
        found = in_tasks(waits, TASKS, pool)
        assert next(found) == (0, None)
        found.close()  # type: ignore[attr-defined]
        gate.set()
    assert len(begun) <= 2


class KilledWorkerError(Exception):
    """Of the scheduler."""


KilledWorkerError.__module__ = "distributed.scheduler"


@pytest.mark.parametrize("when", ["submit", "result"])
def test_a_worker_of_a_cluster_that_dies_is_told_of_in_a_sentence(when: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A worker that dies while tasks are handed out was a bare KeyError with its address."""

    class Client:
        def __enter__(self) -> Client:
            return self

        def __exit__(self, *_: object) -> None: ...

        def get_executor(self, pure: bool) -> Client:
            return self

        def submit(self, *_: object) -> Future[Any]:
            if when == "submit":
                raise KeyError("tcp://127.0.0.1:41234")
            out: Future[Any] = Future()
            out.set_exception(KilledWorkerError())
            return out

    monkeypatch.setattr(tasks, "optional", lambda *_: SimpleNamespace(Client=lambda *_, **__: Client()))
    with raises_code("run.worker-lost", ScenarioError, match=r"'tcp://127\.0\.0\.1:9'"):
        list(in_tasks(square, TASKS, "tcp://127.0.0.1:9"))


def test_a_task_that_a_dying_worker_was_to_get_goes_to_another(monkeypatch: pytest.MonkeyPatch) -> None:
    class Pool(ThreadPoolExecutor):
        lost = 2

        def submit(self, *call: Any) -> Future[Any]:  # type: ignore[override]
            if self.lost:
                self.lost -= 1
                raise KeyError("tcp://127.0.0.1:41234")
            return super().submit(*call)

    monkeypatch.setattr(tasks, "AGAIN", 0.0)
    with Pool(2) as pool:
        assert dict(in_tasks(square, TASKS, pool)) == {k: k * k for k in range(7)}


def test_a_cluster_without_workers_is_not_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """The last worker ended, and the run waited without a word for another one."""

    class Pool(ThreadPoolExecutor):
        _client = SimpleNamespace(nthreads=dict)

        def submit(self, *_: Any) -> Future[Any]:  # type: ignore[override]
            return Future()

    monkeypatch.setattr(tasks, "PATIENCE", 0.01)
    with Pool(1) as pool, raises_code("run.worker-lost", ScenarioError):
        list(in_tasks(square, TASKS, pool))


def test_results_are_kept_by_nobody_but_the_caller() -> None:
    """Tables of counts are megabytes: those that were taken in are not held until the last one comes."""
    with ThreadPoolExecutor(1) as pool:
        gone = []
        for _, made in in_tasks(Made, TASKS, pool):
            gone.append(weakref.ref(made))
            del made
            assert sum(ref() is not None for ref in gone[:-1]) == 0


class Made:
    """A result that can be watched."""

    def __init__(self, k: int) -> None:
        self.k = k


def test_workers_that_are_none_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    for wrong in (0, "eight"):
        with pytest.raises(ScenarioError, match=str(wrong)):
            list(in_tasks(square, TASKS, wrong))
    monkeypatch.setitem(__import__("sys").modules, "joblib.externals.loky", None)
    with raises_code("extra.not-installed", td.ThermidError, match="'joblib'.*python"):
        list(in_tasks(square, TASKS, 2))


@pytest.mark.campaign
@pytest.mark.filterwarnings("ignore")
def test_no_cluster_answers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tasks, "PATIENCE", "1s")
    with pytest.raises(ScenarioError, match=r"'tcp://127\.0\.0\.1:9'.* dask scheduler"):
        list(in_tasks(square, TASKS, "tcp://127.0.0.1:9"))
