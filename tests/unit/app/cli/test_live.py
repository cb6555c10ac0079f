"""The live table: one rule with one meaning, in every width, with faults first."""

from __future__ import annotations

import io
import os
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from python_board import made_up_rom
from rich.console import Console

import thermid as td
from by_code import raises_code
from thermid.app.cli.bench import Judge, live_table, plain_line
from thermid.base.errors import RecordError
from thermid.bench._wire import sealed
from thermid.bench.bench_files import MappedSensor
from thermid.bench.logger import Logger
from thermid.measure.records import ICE, SensorCertificate, StabilityRule
from thermid.qualify.steadiness import forecast

pytestmark = pytest.mark.skipif(os.name != "posix", reason="a log is locked by posix means")


class Fed:
    """A logger that is fed line by line, and a judge that looks when it is asked."""

    def __init__(self, folder: Path, count: int, name: str = "part {}") -> None:
        self.roms = [made_up_rom(k) for k in range(count)]
        sensors = {
            rom: MappedSensor(name.format(k), rom, SensorCertificate(0.25, 0.05, ICE, "2026-01-01")) for k, rom in enumerate(self.roms)
        }
        self.log = Logger(folder / "bench.log", lambda: "none", sensors, sync=False)
        self.number = 0
        self.judge = Judge(self.log, "3 C/h")

    def say(self, ms: int, body: str, kind: str = "D") -> None:
        self.log._store_line(sealed(f"{kind},{self.number},{ms},{body}").encode() + b"\n")
        self.number += 1

    def cycle(self, second: int, celsius: list[float], duty: int = 0) -> None:
        for rom, value in zip(self.roms, celsius, strict=True):
            self.say(1000 * second, f"{rom},{round(value * 16)},ok")
        self.say(1000 * second, f"H1,{duty},ok")

    def look(self) -> None:
        for rom in self.log.history:
            self.judge._seen[rom] = (self.log.state.changed, self.judge.look(rom))

    def lines(self, width: int = 80) -> list[str]:
        console = Console(width=width, record=True, file=io.StringIO())
        console.print(live_table(self.log, self.judge))
        return console.export_text().splitlines()


@pytest.fixture
def warm(tmp_path: Path) -> Iterator[Fed]:
    """A part that settles with 600 s, and one that stands."""
    made = Fed(tmp_path, 2)
    rng = np.random.default_rng(2)
    for t in range(0, 1500, 3):
        made.cycle(t, [40.0 - 15.0 * np.exp(-t / 600.0) + rng.normal(0, 0.03), 21.0 + rng.normal(0, 0.03)])
    made.look()
    yield made
    made.log.store.close()


def test_it_says_what_settle_would_say_of_the_log(warm: Fed) -> None:
    record = td.read_record(warm.log.store.path, {"part 0": "part 0", "part 1": "part 1"})
    last = record.times[-1] - warm.log.state.seconds
    for k, name in enumerate(("part 0", "part 1")):
        found = warm.judge.outlook(warm.roms[k])
        assert found is not None
        whole = StabilityRule.named("3 C/h").of_channel(record, name)
        assert found.verdict == whole.verdict
        assert found.rate == pytest.approx(whole.rate, abs=1e-9)
        assert found.error == pytest.approx(whole.error, rel=0.02)
        told = forecast(record, name)
        assert found.forecast is not None
        assert found.forecast.final.value == pytest.approx(told.final.value, abs=0.05)
        if told.holds is not None:
            assert found.forecast.holds == pytest.approx(told.holds - last, abs=30.0)
    text = "\n".join(warm.lines())
    assert "in " in text.split("part 0")[1].splitlines()[0]
    assert text.split("part 1")[1].splitlines()[0].split()[4] == "stable"
    assert "20.75" in text  # 21 less what its certificate says it shows too much


def test_a_heater_that_changes_begins_a_new_stretch(warm: Fed) -> None:
    assert warm.judge.outlook(warm.roms[0]) is not None
    warm.cycle(1500, [38.9, 21.0], duty=500)
    assert warm.judge.outlook(warm.roms[0]) is None
    for t in range(1501, 1520):
        warm.cycle(t, [39.0, 21.0], duty=500)
    warm.look()
    found = warm.judge.outlook(warm.roms[0])
    assert found is not None
    assert found.forecast is None  # too few readings under the new power
    assert ["heater1", "50", "%"] in [line.split() for line in warm.lines()]
    assert "19 s" in "\n".join(warm.lines())


@pytest.mark.parametrize("width", [40, 80, 120])
def test_it_stays_inside_the_terminal(tmp_path: Path, width: int) -> None:
    made = Fed(tmp_path, 30, "a name that is far too long for a table, channel {}")
    for t in range(20):
        made.cycle(t, [20.0 + 0.1 * k + (0.05 * t if k == 7 else 0.0) for k in range(30)])
    made.say(20_000, f"{made.roms[20]},,lost")
    made.look()
    lines = made.lines(width)
    assert max(map(len, lines)) <= width
    assert sum("FAULT" in line for line in lines) == 1
    assert "FAULT" in next(line for line in lines[lines.index(next(x for x in lines if "channel" in x)) + 1 :] if line.strip())
    made.log.store.close()


def test_sensors_without_a_name_stay_apart(tmp_path: Path) -> None:
    made = Fed(tmp_path, 16)
    made.log.sensors.clear()
    made.cycle(0, [20.0] * 16)
    rows = [line for line in made.lines(60) if line.startswith("28")]
    assert len({row.split()[0] for row in rows}) == 16
    made.log.store.close()


def test_a_fault_is_a_word_and_no_temperature(warm: Fed) -> None:
    warm.say(1_500_000, f"{warm.roms[1]},,crc")
    text = plain_line(warm.log, warm.judge)
    assert "1 FAULT crc" in text
    assert "0 38" in text
    assert {"bold red", "yellow"} <= {str(row.style) for row in live_table(warm.log, warm.judge).rows}


def test_a_rule_that_readings_cannot_answer_is_refused(warm: Fed) -> None:
    with raises_code("record.does-not-apply", RecordError, match="'stored 2 %'"):
        Judge(warm.log, "stored 2 %")
    with raises_code("value.wrong-kind", RecordError):
        Judge(warm.log, "soon")


def test_a_rule_that_looks_back_further_than_the_log_is_too_early(warm: Fed) -> None:
    judge = Judge(warm.log, "0.2 C/h over 5 h")
    assert judge.look(warm.roms[0]).verdict == "too early"


def test_the_thread_looks_and_ends(warm: Fed) -> None:
    with Judge(warm.log, "3 C/h") as judge:
        until = time.monotonic() + 60.0
        while judge.outlook(warm.roms[1]) is None and time.monotonic() < until:
            time.sleep(0.05)
        found = judge.outlook(warm.roms[1])
    assert found is not None
    assert found.verdict == "stable"
    assert not judge._thread.is_alive()
