"""The same bits from processes of this machine and from a cluster, two of whose workers are killed."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import ScenarioError
from thermid.simulation._many import tasks

pytestmark = [pytest.mark.campaign, pytest.mark.filterwarnings("ignore")]
MEMBERS = 6000


Asked = Callable[..., bytes]
DECK = {
    "title": "pair",
    "needs": ["air"],
    "nodes": {"a": {"capacitance": "100 [J/K]", "reference_point": True}, "b": {"capacitance": "300 [J/K]"}},
    "conductors": {"c": {"kind": "conduction", "between": ["a", "b"], "conductance": "1 [W/K]"}},
    "surfaces": {"s": {"of": "b", "to": "air", "area": "0.1 [m^2]", "htc": "5 [W/(m^2 K)]", "emissivity": 0.8}},
    "loads": {"q": {"into": "a", "power": "5 [W]"}},
}
SPREAD = {"scale.q": {"sd": 0.1}, "c.conductance": "20 [%]"}


def day() -> td.Scenario:
    air = (np.linspace(0.0, 86400.0, 97), td.celsius(20.0 + 5.0 * np.sin(np.linspace(0.0, 6.28, 97))))
    return td.Scenario("day", boundaries={"air": air}, start="20 [degC]", duration="24 [h]")


def counted_ensemble(executor: object = None) -> bytes:
    model = td.model_from_dict(DECK)
    draws = td.simulation.draw(model, day(), SPREAD, MEMBERS, seed=3)
    many = td.ensemble(model, day(), draws, every="10 [min]", quantiles=(0.025, 0.5, 0.975), executor=executor)  # type: ignore[arg-type]
    assert not many.failed
    told = [
        x
        for n in many.nodes
        for x in (many.quantile(n, [0.025, 0.5]), many.mean(n), many.sd(n), many.highest_quantile(n, 0.5), many.lowest_quantile(n, 0.5))
    ]
    return b"".join(np.asarray(x).tobytes() for x in told)


def uncertain_runs(executor: object = None, **more: object) -> bytes:
    limits = {"a": "29 [degC]"}
    given: dict[str, object] = {"n": 60_000, "seed": 3, "nodes": limits | {"b": None}, "every": "10 [min]", "executor": executor}
    runs = td.qualify.uncertain_runs(td.model_from_dict(DECK), day(), spread=SPREAD, **(given | more))  # type: ignore[arg-type]
    assert 0 < runs.whole < len(runs)
    told = (*(runs.quantile(n, [0.025, 0.5]) for n in runs.nodes), runs.highest_quantile("a", 0.9))
    return b"".join(x.tobytes() for x in (*told, td.qualify.hold(runs, limits).points[0].crossings))


Processes = list[subprocess.Popen[bytes]]


@pytest.fixture
def cluster() -> Iterator[tuple[str, Processes]]:
    """Return the address of a scheduler, three workers without nannies, and the scheduler."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    address, quiet = f"tcp://127.0.0.1:{port}", {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    dask = [sys.executable, "-m", "dask"]
    started = [subprocess.Popen([*dask, "scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard"], **quiet)]  # type: ignore[call-overload]
    worker = [*dask, "worker", address, "--no-nanny", "--nthreads", "1", "--no-dashboard"]
    started += [subprocess.Popen(worker, **quiet) for _ in range(3)]  # type: ignore[call-overload]
    yield address, [*started[1:], started[0]]
    for process in started:
        process.kill()
        process.wait()


@pytest.mark.parametrize("asked", [counted_ensemble, uncertain_runs])
def test_processes_give_the_same_bits(asked: Asked, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tasks, "PROCESSES_PAY", 0.0)
    assert asked(2) == asked()


@pytest.mark.parametrize("asked", [counted_ensemble, uncertain_runs])
def test_a_cluster_gives_the_same_bits_while_its_workers_die(asked: Asked, cluster: tuple[str, Processes]) -> None:
    from threading import Timer

    from distributed import Client

    address, workers = cluster
    with Client(address, timeout="60s", set_as_default=False) as client:
        client.wait_for_workers(3, timeout=120)
        workers[0].kill()  # while tasks are handed out
        late = Timer(1.0, workers[1].kill)  # at work
        late.start()
        told = asked(address)
        late.join()
        assert told == asked()


def test_a_cluster_whose_workers_all_die_is_named(cluster: tuple[str, Processes], monkeypatch: pytest.MonkeyPatch) -> None:
    from distributed import Client

    address, (*workers, _) = cluster
    monkeypatch.setattr(tasks, "PATIENCE", 2.0)
    with Client(address, timeout="60s", set_as_default=False) as client:
        client.wait_for_workers(3, timeout=120)
    for worker in workers:
        worker.kill()
    with raises_code("run.worker-lost", ScenarioError, match=address):
        counted_ensemble(address)


MEMORY = """
from pathlib import Path
from unit.simulation.many.test_clusters import uncertain_runs
def highest() -> int:
    return next(int(line.split()[1]) for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM"))
uncertain_runs(n=40_000)
before = highest()
uncertain_runs(n=140_000)
print(highest() - before)
"""


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="the peak of memory is read from Linux")
def test_memory_does_not_grow_with_members() -> None:
    """A hundred thousand members more, whose traces are 232 MB, cost the 8 bytes of each that crossings need, a few times over."""
    run = subprocess.run([sys.executable, "-c", MEMORY], capture_output=True, text=True, cwd=Path(__file__).parents[3], check=True)
    assert float(run.stdout) < 20_000


def stopped(folder: Path, members: int, options: list[str], stop: Callable[[int], None]) -> tuple[int, str]:
    """Return how a command with a job ends that is stopped at work, and what it says; it goes on when it is asked again."""
    td.save_model(td.model_from_dict(DECK), folder / "pair.toml")
    (folder / "day.toml").write_text(
        'title = "day"\nboundaries = { air = "20 [degC]" }\nstart = "20 [degC]"\nduration = "24 [h]"\n', encoding="utf-8"
    )
    spread = "\n".join(f'"{name}" = "{value if isinstance(value, str) else "10 [%]"}"' for name, value in SPREAD.items())
    text = f'model = "pair.toml"\nscenario = "day.toml"\n[limits]\na = "29 [degC]"\n[spread]\n{spread}\n'
    (folder / "hold.toml").write_text(text, encoding="utf-8")
    question = ["hold", str(folder / "hold.toml"), "--members", str(members), "--job", str(folder / "job")]
    command = [sys.executable, "-m", "thermid", *question]
    with subprocess.Popen(
        [*command, *options], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True
    ) as process:
        while not list(folder.rglob("*.npz")):
            time.sleep(0.05)
            assert process.poll() is None
        stop(process.pid)
        said, _ = process.communicate(timeout=300)
    kept = {path: path.stat().st_mtime_ns for path in folder.rglob("*.npz")}
    assert subprocess.run(command, capture_output=True, check=False).returncode == 0
    after = {path: path.stat().st_mtime_ns for path in folder.rglob("*.npz")}
    assert len(after) > len(kept)
    assert after.items() >= kept.items()
    return process.returncode, said


def test_the_interrupt_key_ends_in_a_sentence(tmp_path: Path) -> None:
    """What was finished stays, and no engine's traceback comes with it; the same command goes on."""
    code, said = stopped(tmp_path, 40_000, ["--workers", "2"], lambda pid: os.killpg(pid, signal.SIGINT))
    assert code == 3
    assert "Traceback" not in said


def test_a_scheduler_that_is_killed_is_told_of_in_a_sentence(cluster: tuple[str, Processes], tmp_path: Path) -> None:
    """The client of the cluster wrote a traceback of its own, and a worker was said to have had too little memory."""
    address, (*_, scheduler) = cluster
    code, said = stopped(tmp_path, 40_000, ["--cluster", address], lambda pid: scheduler.kill())
    assert code == 2
    assert f"the scheduler of '{address}' ended" in said
    assert "Traceback" not in said
