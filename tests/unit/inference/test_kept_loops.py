"""Every loop takes the same workers: the same bits from this process, threads and processes, and it goes on where it was interrupted."""

from __future__ import annotations

import multiprocessing
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import thermid as td
from thermid.fit.calibration import Request
from thermid.inference._explain.structures import search_structure
from thermid.simulation._many.kept import digest
from thermid.simulation._many.tasks import KeptTasks, Workers
from unit.fit.bench import HTC, MASS, box, log

RECORD = log(box(), {}, {"T": "case"}, noise=0.05, samples=61)
BENCH = td.Scenario("bench", boundaries={"air": "20 [degC]"}, start="20 [degC]", duration="1 [h]")
SPREAD = {HTC: "10 [%]", MASS: "5 [%]"}


@pytest.fixture(scope="module")
def fit() -> td.Calibration:
    return td.calibrate(box(), RECORD, [HTC, MASS])


@pytest.fixture(scope="module")
def processes() -> Iterator[Executor]:
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("forkserver")) as pool:
        yield pool


def descents(_: td.Calibration, who: Workers) -> Any:
    found = td.calibrate(box(), RECORD, [HTC, MASS], search="multistart", executor=who)
    return found.fitted, found.evaluations, found.search


def ends(fit: td.Calibration, who: Workers) -> Any:
    found = td.inference.profile(fit, HTC, executor=who)
    return found.low, found.high, found.values, found.rise


def criticism(fit: td.Calibration, who: Workers) -> Any:
    return [(c.name, c.evidence, c.refused) for c in td.inference.criticise(fit, elements=True, executor=who).candidates]


def structures(_: td.Calibration, who: Workers) -> Any:
    found = search_structure(Request(box(), (RECORD,), (HTC, MASS)), rounds=1, evaluations=300, executor=who)
    return [(s.end.fitted, s.weighing.logs) for s in found.structures], found.refused, found.evaluations


def actions(fit: td.Calibration, who: Workers) -> Any:
    return [(o.name, o.error, o.hours, o.errors) for o in td.design.next_test(fit, HTC, scenario=BENCH, executor=who).options]


def units(_: td.Calibration, who: Workers) -> Any:
    logs = {f"unit {k}": log(box(), {}, {"T": "case"}, noise=0.05, samples=31, seed=k) for k in range(3)}
    return td.inference.fleet(box(), logs, [HTC], executor=who).to_dict()


def members(_: td.Calibration, who: Workers) -> Any:
    draws = td.simulation.draw(box(), BENCH, SPREAD, 2500, seed=1)
    return td.ensemble(box(), BENCH, draws, times=[1800.0, 3600.0], quantiles=[0.5], executor=who).quantile("case", [0.1, 0.9])


LOOPS = [descents, ends, pytest.param(criticism, marks=pytest.mark.campaign), structures, actions, units, members]


@pytest.mark.parametrize("loop", LOOPS, ids=lambda loop: loop.__name__)
def test_a_loop_says_the_same_by_all_workers_and_after_an_interrupt(
    loop: Callable[[td.Calibration, Workers], Any],
    fit: td.Calibration,
    processes: Executor,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    alone = digest(loop(fit, None))
    with ThreadPoolExecutor(2) as threads:
        assert digest(loop(fit, threads)) == alone
    assert digest(loop(fit, processes)) == alone
    keep = KeptTasks.save

    def interrupted(self: KeptTasks, key: str, result: Any) -> None:
        keep(self, key, result)
        raise KeyboardInterrupt

    if loop is not members:  # counts have files of their own
        with monkeypatch.context() as once, suppress(KeyboardInterrupt):
            once.setattr(KeptTasks, "save", interrupted)
            loop(fit, KeptTasks(tmp_path))
        first = {path: path.stat().st_mtime_ns for path in tmp_path.glob("*.npz")}
        assert len(first) == 1
    assert digest(loop(fit, KeptTasks(tmp_path, processes))) == alone
    kept = [*tmp_path.rglob("*.npz")]
    assert loop is members or first.items() <= {path: path.stat().st_mtime_ns for path in kept}.items()
    assert digest(loop(fit, KeptTasks(tmp_path))) == alone
    assert sorted(tmp_path.rglob("*.npz")) == sorted(kept)  # nothing was done again


def test_a_task_is_known_by_what_it_computes(fit: td.Calibration, tmp_path: Path) -> None:
    """What an object remembers of earlier questions is no part of it; any number that differs is."""
    kept = KeptTasks(tmp_path)
    before = kept.key(ends, (fit.problem, 1.0))
    td.inference.profile(fit, HTC)
    assert kept.key(ends, (fit.problem, 1.0)) == before
    assert len({before, kept.key(ends, (fit.problem, np.nextafter(1.0, 2.0))), kept.key(actions, (fit.problem, 1.0))}) == 3
    assert digest({"a", "b"}) == digest({"b", "a"}) != digest({"a"})
    assert len({digest(f) for f in (max, min, np.sin, np.mean, tmp_path.joinpath)}) == 5


def test_a_task_has_the_same_name_in_every_process() -> None:
    """Whatever order sets have there."""
    words = "from unit.inference.test_kept_loops import *; print(KeptTasks('.').key(structures, (Request(box(), (RECORD,), (HTC, MASS)),)))"
    said = {
        subprocess.run(
            [sys.executable, "-c", words],
            env={**os.environ, "PYTHONHASHSEED": seed, "PYTHONPATH": str(Path(__file__).parents[2])},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for seed in ("1", "2")
    }
    assert len(said) == 1


def test_nothing_of_a_folder_is_run(tmp_path: Path) -> None:
    """A file that names another class than a result of thermid is refused."""
    kept = KeptTasks(tmp_path)
    kept.save("task", (1.0, [np.arange(3.0)], {"a": None}))
    ((number, (array,), table),) = kept.load("task") or ()
    assert (number, array.tolist(), table) == (1.0, [0.0, 1.0, 2.0], {"a": None})
    for module, name in (("subprocess", "Popen"), ("thermid.base.files", "read_bytes")):
        np.savez(tmp_path / "task.npz", about=np.array(f'{{"class": ["{module}", "{name}"], "parts": {{}}}}'))
        with pytest.raises(ValueError, match="is no result"):
            kept.load("task")
