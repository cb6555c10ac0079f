"""The same bits from processes of this machine and from a cluster, two of whose workers are killed."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import thermid as td

pytestmark = [pytest.mark.campaign, pytest.mark.filterwarnings("ignore")]
MEMBERS = 6000


def found(executor: object = None) -> tuple[td.simulation.Ensemble, bytes]:
    deck = {
        "title": "pair",
        "needs": ["air"],
        "nodes": {"a": {"capacitance": "100 [J/K]"}, "b": {"capacitance": "300 [J/K]"}},
        "conductors": {"c": {"kind": "conduction", "between": ["a", "b"], "conductance": "1 [W/K]"}},
        "surfaces": {"s": {"of": "b", "to": "air", "area": "0.1 [m^2]", "htc": "5 [W/(m^2 K)]", "emissivity": 0.8}},
        "loads": {"q": {"into": "a", "power": "5 [W]"}},
    }
    air = (np.linspace(0.0, 86400.0, 97), td.celsius(20.0 + 5.0 * np.sin(np.linspace(0.0, 6.28, 97))))
    day = td.Scenario("day", boundaries={"air": air}, start="20 [degC]", duration="24 [h]")
    model = td.model_from_dict(deck)
    draws = td.simulation.draw(model, day, {"scale.q": {"sd": 0.1}, "c.conductance": "20 [%]"}, MEMBERS, seed=3)
    many = td.ensemble(model, day, draws, every="10 [min]", quantiles=(0.025, 0.5, 0.975), executor=executor)  # type: ignore[arg-type]
    told = [x for n in many.nodes for x in (many.quantile(n, [0.025, 0.5]), many.mean(n), many.sd(n), many.highest(n), many.lowest(n))]
    return many, b"".join(np.asarray(x).tobytes() for x in told)


@pytest.fixture
def cluster() -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """Return the address of a scheduler, and three workers without nannies."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    address, quiet = f"tcp://127.0.0.1:{port}", {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    dask = [sys.executable, "-m", "dask"]
    started = [subprocess.Popen([*dask, "scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard"], **quiet)]  # type: ignore[call-overload]
    worker = [*dask, "worker", address, "--no-nanny", "--nthreads", "1", "--no-dashboard"]
    started += [subprocess.Popen(worker, **quiet) for _ in range(3)]  # type: ignore[call-overload]
    yield address, started[1:]
    for process in started:
        process.kill()
        process.wait()


def test_processes_give_the_same_bits() -> None:
    assert found(2)[1] == found()[1]


def test_a_cluster_gives_the_same_bits_while_its_workers_die(cluster: tuple[str, list[subprocess.Popen[bytes]]]) -> None:
    from threading import Timer

    from distributed import Client

    address, workers = cluster
    with Client(address, timeout="60s", set_as_default=False) as client:
        client.wait_for_workers(3, timeout=120)
        workers[0].kill()  # while tasks are handed out
        late = Timer(1.0, workers[1].kill)  # at work
        late.start()
        many, told = found(address)
        late.join()
        time.sleep(0.1)
        assert not many.failed
        assert told == found()[1]


def test_the_interrupt_key_ends_in_a_sentence(tmp_path: Path) -> None:
    """What was finished stays, and no engine's traceback comes with it; the same command goes on."""
    question = Path(__file__).parents[4] / "examples" / "sisnav" / "macro" / "hold.toml"
    command = [sys.executable, "-m", "thermid", "hold", str(question), "--members", "4000", "--workers", "2", "--job", str(tmp_path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True) as process:
        while not list(tmp_path.rglob("*.npz")):
            time.sleep(0.1)
            assert process.poll() is None
        os.killpg(process.pid, signal.SIGINT)
        said, _ = process.communicate(timeout=120)
    assert process.returncode == 3
    assert "Traceback" not in said
    assert len(list(tmp_path.rglob("*.npz"))) < 8
    assert subprocess.run(command, capture_output=True, check=False).returncode == 0
    assert len(list(tmp_path.rglob("*.npz"))) == 8
