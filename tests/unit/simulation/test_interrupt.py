"""Long runs: the interrupt key ends them and the interpreter goes on; threads go on beside them; same settings, same bits."""

from __future__ import annotations

import hashlib
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

import thermid as td

TESTS = Path(__file__).parents[2]
LONG = td.Options(max_step=1e-3, max_steps=10**9)
"""Would take hours."""
SOON = 60.0
"""Within this time of the signal the run has ended, however busy the machine; it would take hours. [s]"""


def plate() -> tuple[td.Model, td.Scenario]:
    deck = {
        "title": "plate",
        "needs": ["room"],
        "nodes": {"plate": {"capacitance": "100 [J/K]"}, "foot": {"capacitance": "20 [J/K]"}},
        "surfaces": {"skin": {"of": "plate", "to": "room", "area": "0.1 [m^2]", "htc": "5 [W/(m^2 K)]", "emissivity": 0.8}},
        "conductors": {"leg": {"kind": "conduction", "between": ["plate", "foot"], "conductance": "0.3 [W/K]"}},
        "loads": {"heater": {"into": "foot", "power": "5 [W]"}},
    }
    noise = np.random.default_rng(3).normal(293.15, 0.05, 3601)
    room = td.Scenario("room", boundaries={"room": (np.arange(3601.0), td.quantity(noise, unit="K"))}, start="293.15 [K]", duration=3600.0)
    return td.model_from_dict(deck), room


@pytest.fixture
def default_handler() -> Iterator[None]:
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.skipif(os.name != "posix", reason="signals are sent as POSIX has them")
@pytest.mark.usefixtures("default_handler")
def test_the_interrupt_key_ends_a_run_and_the_next_one_is_right() -> None:
    model, room = plate()
    expected = td.simulate(model, room).temperatures
    sent: list[float] = []

    def press() -> None:
        sent.append(time.monotonic())
        os.kill(os.getpid(), signal.SIGINT)

    for _ in range(3):
        timer = threading.Timer(0.3, press)
        timer.start()
        with pytest.raises(KeyboardInterrupt):
            td.simulate(model, room, options=LONG)
        assert time.monotonic() - sent[-1] < SOON
        timer.join()
        np.testing.assert_array_equal(td.simulate(model, room).temperatures, expected)


def long_ensemble() -> None:
    model, room = plate()
    td.prepare(model, room, ["skin.htc"], options=LONG).ensemble({"skin.htc": np.linspace(3.0, 6.0, 64)}, threads=2)


def block() -> tuple[td.Block, td.Scenario]:
    cube = td.Block((0.1, 0.1, 0.1), (12, 12, 12), conductivity="15 [W/(m K)]", density="3900 [kg/m^3]", specific_heat="1000 [J/(kg K)]")
    scenario = td.Scenario("days", boundaries={"air": "20 [degC]"}, start="300 [K]", duration=1e6)
    core = (slice(2, 5), slice(2, 5), slice(2, 5))
    return cube.exchanging("all", "air", htc="5 [W/(m^2 K)]").heated("heater", "5 [W]", cells=core), scenario


def long_transient_of_a_block() -> None:
    td.simulate(*block(), options=td.Options(max_step=1e-2, max_steps=10**9))


@pytest.mark.skipif(os.name != "posix", reason="signals are sent as POSIX has them")
@pytest.mark.usefixtures("default_handler")
@pytest.mark.parametrize("work", [long_ensemble, long_transient_of_a_block])
def test_the_interrupt_key_ends_ensembles_and_large_runs(work: Callable[[], None]) -> None:
    expected = td.simulate(*plate()).temperatures
    timer = threading.Timer(0.4, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        work()
    timer.join()
    np.testing.assert_array_equal(td.simulate(*plate()).temperatures, expected)


SCRIPT = """
import signal, sys
sys.path.insert(0, sys.argv[1])
signal.signal(signal.SIGINT, signal.default_int_handler)
import thermid as td
from unit.simulation.test_interrupt import LONG, plate
model, room = plate()
before = td.simulate(model, room).temperatures
print("running", flush=True)
try:
    td.simulate(model, room, options=LONG)
except KeyboardInterrupt:
    after = td.simulate(model, room).temperatures
    print("same" if (before == after).all() else "different", flush=True)
"""


@pytest.mark.skipif(os.name != "posix", reason="signals are sent as POSIX has them")
def test_a_process_that_is_interrupted_simulates_on() -> None:
    with subprocess.Popen([sys.executable, "-c", SCRIPT, str(TESTS)], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "running\n"
        time.sleep(0.3)
        process.send_signal(signal.SIGINT)
        said, _ = process.communicate(timeout=30.0)
    assert said == "same\n"
    assert process.returncode == 0


def test_other_threads_go_on_during_a_run() -> None:
    model, room = plate()
    slow = td.Options(max_step=0.01, max_steps=10**9)  # long beside what a busy machine lets a thread wait
    run = threading.Thread(target=lambda: td.simulate(model, room, options=slow))
    longest, last = 0.0, time.monotonic()
    begin = last
    run.start()
    while run.is_alive():
        time.sleep(0.001)
        now = time.monotonic()
        longest, last = max(longest, now - last), now
    assert longest < 0.5 * (last - begin)  # with the lock held the run would be one single pause


def test_a_steady_state_by_multigrid_has_the_same_bits_again() -> None:
    one = td.steady(*block()).temperatures
    np.testing.assert_array_equal(one, td.steady(*block()).temperatures)


def test_threads_one_after_the_other_and_again_give_the_same_bits() -> None:
    model, room = plate()
    sim = td.prepare(model, room, ["skin.htc"])
    values = [4.0 + 0.1 * k for k in range(16)]

    def run(htc: float) -> np.ndarray:
        found = sim.run({"skin.htc": htc}, sensitivities=True)
        return np.concatenate((found.temperatures.ravel(), found.sensitivity("plate", "skin.htc")))

    alone = [run(htc) for htc in values]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(run, values))
    for one, other, again in zip(alone, together, [run(htc) for htc in values], strict=True):
        np.testing.assert_array_equal(one, other)
        np.testing.assert_array_equal(one, again)


@pytest.mark.parametrize("threads", ["1", "7"])
def test_a_new_process_with_any_number_of_threads_gives_the_same_bits(threads: str) -> None:
    script = (
        "import hashlib, sys; sys.path.insert(0, sys.argv[1]); import thermid as td; from unit.simulation.test_interrupt import plate;"
        "print(hashlib.sha256(td.simulate(*plate()).temperatures.tobytes()).hexdigest())"
    )
    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
    environment = os.environ | dict.fromkeys(names, threads)
    asked = [sys.executable, "-c", script, str(TESTS)]
    found = subprocess.run(asked, env=environment, capture_output=True, text=True, check=True, timeout=60).stdout
    assert found.strip() == hashlib.sha256(td.simulate(*plate()).temperatures.tobytes()).hexdigest()
