"""A bench log as a record: faults masked by name, clocks, damage named."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from python_board import made_up_rom

import thermid as td
from by_code import of_code, raises_code
from thermid.base.errors import NameNotFoundError, RecordError
from thermid.bench.benchlog import log_line
from thermid.measure.readers import UNFINISHED

from .bench import Sheet

A, B = made_up_rom(0), made_up_rom(1)


def sheet(rows: int = 30, drift: float = 1.0, begin: int = 0) -> Sheet:
    made = Sheet().start()
    made.say(0.01, begin, "uno,thermid-bench 1,power", "B")
    for k in range(rows):
        ms = begin + 1000 * (k + 1)
        made.say((ms - begin) / 1000 * drift + 0.01, ms, f"{A},{320 + k},ok").say((ms - begin) / 1000 * drift + 0.011, ms, f"{B},160,ok")
    return made


def read(made: Sheet, tmp_path: Path) -> td.Record:
    return td.read_record(made.save(tmp_path / "bench.log"), {"a": A, "b": B})


def test_values_and_times(tmp_path: Path) -> None:
    record = read(sheet(), tmp_path)
    np.testing.assert_allclose(record["a"].values - 273.15, 20.0 + np.arange(30) / 16)
    np.testing.assert_allclose(np.diff(record.times), 1.0)
    assert record["a"].valid.all()


@pytest.mark.parametrize(
    ("body", "reason"),
    [
        ("{},,crc", "wrong CRC"),
        ("{},,lost", "sensor lost"),
        ("{},,short", "bus shorted"),
        ("{},1360,power", "sensor without supply"),
        ("{},1360,ok", "85 degC of power-up"),
        ("{},-2032,ok", "outside its range"),
        ("{},4000,ok", "outside its range"),
    ],
)
def test_a_fault_is_masked_by_its_name(body: str, reason: str, tmp_path: Path) -> None:
    made = sheet(10)
    made.say(11.0, 11_000, body.format(A)).say(12.0, 12_000, f"{A},330,ok")
    channel = read(made, tmp_path)["a"]
    assert channel.flags[reason] == 1
    assert np.nanmax(channel.values[channel.valid]) < 21.0 + 273.15


def test_extreme_values_that_are_real_stay(tmp_path: Path) -> None:
    made = Sheet().start()
    for k, raw in enumerate([-880, -198, 2000, 1344, 1360, 1376], 1):
        made.say(k + 0.01, 1000 * k, f"{A},{raw},ok").say(k + 0.02, 1000 * k, f"{B},0,ok")
    record = read(made, tmp_path)
    np.testing.assert_allclose(record["a"].values[record["a"].valid] - 273.15, [-55.0, -12.375, 125.0, 84.0, 85.0, 86.0])


def test_the_map_in_the_header_names_and_corrects(tmp_path: Path) -> None:
    made = Sheet().start().sensor(rom=A, name="T1", offset_K=0.25, uncertainty_K=0.05, at_K=273.15, date="2026-02-01")
    for k in range(1, 5):
        made.say(float(k), 1000 * k, f"{A},320,ok").say(k + 0.1, 1000 * k, "H1,250,ok")
    path = made.save(tmp_path / "bench.log")
    record = td.read_record(path, {"T1": "T1", "heater1": {"command": "heater"}})
    np.testing.assert_allclose(record["T1"].values, 19.75 + 273.15)
    assert record["T1"].accuracy == pytest.approx(0.05)
    assert any(re.search(r"2026-02-01.* \+0\.25 K", step) for step in record.steps)
    np.testing.assert_allclose(record["heater1"].values, 0.25)
    with pytest.raises(NameNotFoundError, match="T1"):
        td.read_record(path, {"x": "T2"})


def test_a_heater_that_changes_in_the_moment_of_a_cycle_has_changed_then(tmp_path: Path) -> None:
    made = Sheet().start()
    for k in range(4):
        made.say(10.0 * k, 10_000 * k, f"{A},320,ok").say(10.0 * k + 0.1, 10_000 * k, f"H1,{500 if k > 2 else 0},ok")
        if k == 2:
            made.say(10.0 * k + 0.2, 10_000 * k, "H1,500,ok")
    record = td.read_record(made.save(tmp_path / "b.log"), {"T": A, "heater1": {"command": "h"}})
    np.testing.assert_array_equal(record["heater1"].values, [0.0, 0.0, 0.5, 0.5])


def test_power_is_voltage_times_current(tmp_path: Path) -> None:
    made = Sheet().start()
    for k in range(1, 5):
        made.say(float(k), 1000 * k, f"{A},320,ok").say(k + 0.1, 1000 * k, "V1,12000,ok").say(k + 0.2, 1000 * k, "I1,5000,ok")
    record = td.read_record(made.save(tmp_path / "bench.log"), {"power1": {"load": "heater"}})
    np.testing.assert_allclose(record["power1"].values, 6.0)


def test_a_current_at_the_end_of_the_monitors_scale_is_no_current(tmp_path: Path) -> None:
    made = Sheet().start()
    for k, raw in enumerate([5000, 32000, -32000, 5000]):
        made.say(float(k), 1000 * k, f"{A},320,ok").say(k + 0.1, 1000 * k, "V1,12000,ok").say(k + 0.2, 1000 * k, f"I1,{raw},ok")
    record = td.read_record(made.save(tmp_path / "b.log"), {"power1": {"load": "h"}, "current1": {"command": "i"}})
    assert record["current1"].flags == {"outside its range": 2}
    np.testing.assert_array_equal(record["power1"].valid, [True, False, False, True])


def test_the_drift_of_the_board_is_taken_out(tmp_path: Path) -> None:
    record = read(sheet(900, drift=1.0 + 2e-3), tmp_path)
    np.testing.assert_allclose(np.diff(record.times), 1.002, atol=1e-6)
    assert of_code(record.steps, "bench.board-clock", r"\+2000 ppm")


def test_a_simulated_board_keeps_its_own_seconds(tmp_path: Path) -> None:
    record = read(sheet(60, drift=1 / 20), tmp_path)
    np.testing.assert_allclose(np.diff(record.times), 1.0)
    assert of_code(record.steps, "bench.simulated-clock", " 20 ")


def test_a_stalled_host_does_not_bend_time(tmp_path: Path) -> None:
    made = Sheet().start()
    for k in range(1, 901):
        late = 340.0 - k if 300 < k < 340 else 0.0
        made.say(k + late + k * 1e-6, 1000 * k, f"{A},320,ok").say(k + late + k * 1e-6 + 1e-6, 1000 * k, f"{B},320,ok")
    np.testing.assert_allclose(np.diff(read(made, tmp_path).times), 1.0, atol=1e-4)


def test_board_time_passes_its_32_bits(tmp_path: Path) -> None:
    made = Sheet().start()
    for k in range(1, 9):
        made.say(float(k), ((1 << 32) - 4000 + 1000 * k) % (1 << 32), f"{A},320,ok").say(
            k + 0.1, ((1 << 32) - 4000 + 1000 * k) % (1 << 32), f"{B},3,ok"
        )
    record = read(made, tmp_path)
    np.testing.assert_allclose(np.diff(record.times), 1.0)
    assert not of_code(record.steps, "bench.resets")


def test_a_reset_is_named_and_time_goes_on(tmp_path: Path) -> None:
    made = sheet(10).reset()
    made.say(15.0, 3, "uno,thermid-bench 1,watchdog", "B")
    for k in range(1, 6):
        made.say(15.0 + k, 3 + 1000 * k, f"{A},320,ok").say(15.1 + k, 3 + 1000 * k, f"{B},320,ok")
    record = read(made, tmp_path)
    assert of_code(record.steps, "bench.resets", ": 1$")
    assert record.times[10] - record.times[9] == pytest.approx(6.0, abs=0.02)


def test_a_second_start_follows_by_the_wall_clock(tmp_path: Path) -> None:
    made = sheet(10)
    made.start("2026-03-01T10:01:00+00:00").reset()
    for k in range(1, 6):
        made.say(float(k), 500 + 1000 * k, f"{A},320,ok").say(k + 0.1, 500 + 1000 * k, f"{B},320,ok")
    record = read(made, tmp_path)
    assert record.times[10] - record.times[0] == pytest.approx(60.0, abs=0.1)
    assert of_code(record.steps, "bench.starts", ": 2$")


def test_a_start_whose_clock_was_set_back_follows_at_once(tmp_path: Path) -> None:
    made = sheet(10)
    made.start("2026-03-01T09:00:00+00:00").reset()
    for k in range(1, 6):
        made.say(float(k), 500 + 1000 * k, f"{A},320,ok").say(k + 0.1, 500 + 1000 * k, f"{B},320,ok")
    record = read(made, tmp_path)
    assert (np.diff(record.times) > 0).all()
    assert of_code(record.steps, "bench.start-placed", " 2 ")


def test_cut_anywhere_it_opens_and_says_so(tmp_path: Path) -> None:
    text = sheet(3).text
    path = tmp_path / "bench.log"
    for at in range(1, len(text)):
        path.write_text(text[:at])
        try:
            record = td.read_record(path, {"a": A})
        except RecordError:
            assert text[:at].count(A) <= 2  # a record needs two times
        except NameNotFoundError:
            assert A not in text[:at]
        else:
            assert text[at - 1] == "\n" or any(step.endswith(UNFINISHED) for step in record.steps)


def test_damage_is_named(tmp_path: Path) -> None:
    lines = sheet(20).text.split("\n")
    lines[9] = lines[9].replace("ok", "oK")
    lines[12], lines[13] = lines[13], lines[12]
    lines.insert(16, lines[15])
    del lines[25]
    path = tmp_path / "bench.log"
    path.write_text("\n".join(lines))
    steps = td.read_record(path, {"a": A, "b": B}).steps
    assert of_code(steps, "bench.damaged-lines", r": 1 \(\w+ 10\)$")
    assert of_code(steps, "bench.sorted-lines", ": 2$")
    assert of_code(steps, "bench.duplicate-lines", ": 1$")
    assert of_code(steps, "bench.missing-lines", ": 2$")  # the damaged one and the deleted one


def test_a_comment_of_a_person_is_no_damage(tmp_path: Path) -> None:
    made = sheet(5)
    made.text += "# I opened the window\n"
    assert not any("damaged" in step for step in read(made, tmp_path).steps)


def test_a_log_without_values_is_refused_with_its_reason(tmp_path: Path) -> None:
    made = Sheet().start()
    made.text += log_line("1 0.100000 no line of a board")
    with raises_code("record.nothing-there", RecordError, match="1"):
        td.read_record(made.save(tmp_path / "bench.log"), {"a": A})
