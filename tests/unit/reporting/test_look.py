from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path
from xml.etree.ElementTree import fromstring

import numpy as np
import pytest
from typer.testing import CliRunner

import thermid as td
from by_code import raises_code
from thermid.app.cli.app import app
from thermid.base.errors import ThermidError, code_of
from thermid.campaign.start import roles_of
from thermid.reporting.looks import log_drawing

HEAD = "Logger;7\nsite;lab\n\n"


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """A log with a preamble, decimal commas, a gap, a lost sensor, a jump, a load in per cent and a state."""
    rows = []
    for k in range(200):
        t = k * 10 + (900 if k >= 100 else 0)
        case = -127.0 if k in (50, 51) else 20 + 0.05 * k + (12 if k == 150 else 0)
        rows.append(f"{t};{case:.2f};{20.0 + 0.001 * k:.3f};{50 if k > 20 else 0};{2000 + k % 2};ok\n")
    text = HEAD + "time [s];case (°C);T_room (°C);heater (%);P (mW);state\n" + "".join(rows)
    path = tmp_path / "bench run.csv"
    path.write_bytes(text.replace(".", ",").encode("latin-1"))
    return path


def test_what_is_in_a_log(log):
    seen = td.look(log)
    assert [(c.name, c.unit, c.guess) for c in seen.columns] == [
        ("time", "s", "time"),
        ("case", "degC", "temperature"),
        ("T_room", "degC", "boundary"),
        ("heater", "%", "duty"),
        ("P", "mW", "power"),
        ("state", "", "ignored"),
    ]
    assert seen.decimal == ","
    assert seen.gaps == [(990.0, 910.0)]
    case = seen.columns[1]
    assert case.faults == {"sensor lost (-127)": 2}
    assert case.jumps.tolist() == [150, 151]
    text = str(seen)
    assert all(part in text for part in ("run.csv", "200"))
    for line in (
        r"layout: \w+ semicolon, \w+ Latin-1, \w+ 3 \w+, .*, .* ','",
        r"clock: 'time' \(s\)",
        r"sampling: .* 10 s \(\w+\) .* 48\.17 min",
        r"gaps: 1, .* 15\.17 min",
        r"case: 2 x .* \(-127\); 2 \w+, .* 40 min",
        r"state: .* 'ok'",
    ):
        assert re.search(line, text), line


def test_its_lines_are_a_campaign_that_reads_the_log(log):
    record = tomllib.loads(td.look(log).campaign())["records"]["bench_run"]
    assert record["prepare"] == [{"faults": True}]
    assert {name: next(iter(table)) for name, table in record["channels"].items()} == {"case": "node", "T_room": "boundary", "P": "load"}
    read = td.read_record(log, record["channels"], time=record["time"]).prepare(record["prepare"])
    assert read["case"].flags == {"fault": 2} or read["case"].valid.sum() == 198
    assert read["P"].values.max() == pytest.approx(2.001)
    # a load in per cent waits for its power at 100 %
    completed = td.look(log).campaign().replace("# heater", "heater").replace("... [W]", "8 [W]")
    channels = tomllib.loads(completed)["records"]["bench_run"]["channels"]
    assert td.read_record(log, channels)["heater"].values.max() == pytest.approx(4.0)


@pytest.mark.parametrize(("rows", "said"), [(7200, [{"resample": {"step": "25 [s]"}}]), (600, [])])
def test_a_log_of_two_seconds_is_thinned_by_its_lines(tmp_path, rows, said):
    """A test of hours at 2 s was copied as printed, and its fit took minutes."""
    path = tmp_path / "fine.csv"
    path.write_text("time [s],T [degC],P [W]\n" + "".join(f"{2 * k},{20 + 0.001 * k:.3f},{5 * (k > 300)}\n" for k in range(rows)))
    record = tomllib.loads(td.look(path).campaign())["records"]["fine"]
    assert record.get("prepare", []) == said
    read = td.read_record(path, record["channels"], time=record["time"]).prepare(said)
    assert read.times.size < 700


def test_picture_stands_by_itself_and_shows_every_known_column(log):
    root = fromstring(log_drawing(td.look(log)))
    assert root.tag == "{http://www.w3.org/2000/svg}svg"
    texts = [e.text for e in root.iter("{http://www.w3.org/2000/svg}text")]
    assert {"case", "T_room", "P", "heater", "temperature, °C", "power, W", "duty, %", "bench run.csv"} <= {*texts}
    label = next(e for e in root.iter("{http://www.w3.org/2000/svg}svg") if e.get("class") == "plot").get("aria-label")
    assert "-127" not in label


def test_terminal_picture_rises_where_the_readings_do(tmp_path):
    path = tmp_path / "x.csv"
    path.write_text("t,T1\n" + "".join(f"{k},{20 + k}\n" for k in range(64)))
    line = next(line for line in td.look(path).lines() if " T1 " in f"{line} ")
    drawn = re.sub(r"[^▁▂▃▄▅▆▇█]", "", line)
    assert [*drawn] == sorted(drawn)
    assert (drawn[0], drawn[-1]) == ("▁", "█")
    assert all(len(line) <= 60 for line in td.look(path).lines(60) if "▁" in line)


def test_a_log_whose_times_are_open_is_shown_with_what_decides(tmp_path):
    path = tmp_path / "dates.csv"
    path.write_text("time,T1\n05/06/2024 10:00,20\n06/06/2024 10:00,21\n08/06/2024 10:00,22\n")
    seen = td.look(path)
    assert code_of(seen.problem) == "record.time-unclear"
    assert [c.guess for c in seen.columns] == ["time", "temperature"]
    with raises_code("result.nothing-to-draw"):
        log_drawing(seen)
    done = CliRunner().invoke(app, ["look", str(path)])
    assert (done.exit_code, "NOT READABLE YET" in done.output.splitlines()[1]) == (2, True)
    done = CliRunner().invoke(app, ["look", str(path), "--clock", "%d/%m/%Y %H:%M"])
    assert (done.exit_code, "NOT READABLE YET" in done.output) == (0, False)


def test_command_prints_writes_and_speaks_json(log, tmp_path):
    picture = tmp_path / "x.svg"
    done = CliRunner().invoke(app, ["look", str(log), "--svg", str(picture)])
    assert done.exit_code == 0
    assert picture.read_text(encoding="utf-8").startswith("<svg xmlns=")
    told = json.loads(CliRunner().invoke(app, ["look", str(log), str(log), "--json"]).output)
    assert (told["status"], len(told["logs"])) == ("ok", 2)
    first = told["logs"][0]
    assert (first["separator"], first["preamble"], first["decimal"], first["rows"]) == ("semicolon", 3, ",", 200)
    assert first["gaps"] == [{"at": 990.0, "length": 910.0}]
    assert [c["guess"] for c in first["columns"]] == ["time", "temperature", "boundary", "duty", "power", "ignored"]
    with pytest.raises(ThermidError, match="it is of one log"):
        CliRunner().invoke(app, ["look", str(log), str(log), "--svg", "x.svg"], catch_exceptions=False)


def test_a_usual_column_of_85_degrees_is_no_fault(tmp_path):
    path = tmp_path / "hot.csv"
    path.write_text("t,T1 [degC],T2 [degC]\n" + "".join(f"{k},{85 if k % 3 else 84.9},{85 if k == 0 else 20.5}\n" for k in range(30)))
    seen = td.look(path)
    assert [c.faults for c in seen.columns[1:]] == [{}, {"reset of a DS18B20 (85)": 1}]
    assert np.count_nonzero(seen.columns[1].good) == 30


@pytest.mark.parametrize(("size", "step", "expected"), [(0.05, 0.0, 0.05), (0.05, 0.5, 0.5 / 12**0.5), (0.3, 0.1, 0.3)])
def test_look_proposes_the_noise_that_it_measured(size: float, step: float, expected: float, tmp_path: Path) -> None:
    """Neighbouring samples tell the noise on a slow course, and a step of the sensor counts with its width over the root of 12."""
    times = np.arange(0.0, 6000.0, 10.0)
    celsius = 22.0 + 15.0 * (1.0 - np.exp(-times / 2000.0)) + size * np.random.default_rng(1).standard_normal(times.size)
    celsius = np.round(celsius / step) * step if step else celsius
    rows = "".join(f"{t:.0f},{c:.4f},{1.8 * c + 32.0:.4f}\n" for t, c in zip(times, celsius, strict=True))
    (tmp_path / "log.csv").write_text("time_s,case [degC],lid [degF]\n" + rows)
    lines = tomllib.loads(td.look(tmp_path / "log.csv").campaign())["records"]["log"]["channels"]
    for column in ("case", "lid"):
        assert float(lines[column]["noise"].removesuffix(" [K]")) == pytest.approx(expected, rel=0.15)


def test_names_that_say_volts_and_amperes_and_a_heat_sink(tmp_path):
    """A meter writes Volts and Amps without units; a heat sink is a part, a sink for heat is not."""
    path = tmp_path / "meter.csv"
    path.write_text(
        "t,heatsink,sink,Volts,Supply current\n" + "".join(f"{k},{20.1 + k},20.2,{12.1 - 0.3 * k},{1.5 + 0.7 * k}\n" for k in range(9))
    )
    seen = td.look(path)
    assert [(c.name, c.unit, c.guess) for c in seen.columns[1:]] == [
        ("heatsink", "degC", "temperature"),
        ("sink", "degC", "boundary"),
        ("Volts", "V", "ignored"),
        ("Supply current", "A", "ignored"),
    ]
    assert '= { volts = "Volts", amperes = "Supply current" }' in seen.campaign()
    record = td.read_record(path, {"P": {"load": "heater", "power": {"volts": "Volts", "amperes": "Supply current"}}})
    assert record["P"].values[1] == pytest.approx(11.8 * 2.2)


def test_look_proposes_no_noise_of_a_computed_course(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("time_s,case [degC]\n" + "".join(f"{10 * k},{20.0 + 0.1 * k!r}\n" for k in range(20)))
    assert "noise" not in td.look(path).campaign()


def test_a_sink_beside_a_room_is_a_part(tmp_path):
    """A drive on a heat sink has a column Sink and one of the room: only the room is surroundings, for `init` too."""
    path = tmp_path / "drive.csv"
    path.write_text("t,Sink (C),Room (C),Fan power (W)\n" + "".join(f"{k},{20.1 + k},20.2,{k % 2}\n" for k in range(9)))
    assert [(c.name, c.guess) for c in td.look(path).columns[1:3]] == [("Sink", "temperature"), ("Room", "boundary")]
    roles = roles_of(path)
    assert (roles.parts, roles.surroundings) == ({"Sink": "sink"}, "Room")


def test_a_column_that_holds_the_code_of_a_lost_sensor_is_a_temperature(tmp_path):
    """The -127 of a DS18B20 says what a column without a unit measures."""
    path = tmp_path / "board.txt"
    path.write_text("t;board;shaft\n" + "".join(f"{k};{-127.0 if k == 4 else 22.5 + 0.1 * k};{22 + k % 3}\n" for k in range(12)))
    (board, shaft) = td.look(path).columns[1:]
    assert (board.guess, board.unit, board.assumed, board.faults) == ("temperature", "degC", True, {"sensor lost (-127)": 1})
    assert shaft.guess == "ignored"


def test_the_log_without_stamps_is_named(tmp_path):
    """Of two logs the message names the one whose clock is missing, and a time column of one log is not asked of the other."""
    (tmp_path / "a.csv").write_text("stamp,T1\n" + "".join(f"2026-03-10 09:{k:02d}:06,20.{k}\n" for k in range(20)))
    (tmp_path / "b.csv").write_text("n,T2\n" + "".join(f"{20 * k},20.{k}\n" for k in range(20)))
    done = CliRunner().invoke(app, ["look", str(tmp_path / "a.csv"), str(tmp_path / "b.csv"), "--time", "n"], catch_exceptions=False)
    assert done.exit_code == 0
    assert "  b.csv has no" in done.stdout
    assert '"... [s]"' in done.stdout
    done = CliRunner().invoke(app, ["look", str(tmp_path / "a.csv"), str(tmp_path / "b.csv"), "--time", "when"], catch_exceptions=False)
    assert (done.exit_code, done.stdout.count("'when'")) == (2, 2)


@pytest.mark.parametrize("name", ["trafo", "Torque", "total", "tank_level", "ambient_light", "Tool", "T_case_2"])
def test_a_name_or_a_size_of_another_quantity_is_asked_about(tmp_path: Path, name: str) -> None:
    size = 640.0 if name == "T_case_2" else 22.0
    rows = [f"{10 * k},{size + 0.1 * k:.1f},{22 + 0.1 * k:.1f},{24 + 0.1 * k:.1f}" for k in range(12)]
    (tmp_path / "a.csv").write_text("\n".join([f"time_s,{name},T_top,tbox", *rows]) + "\n")
    seen = td.look(tmp_path / "a.csv")
    assert [c.guess for c in seen.columns] == ["time", "unclear", "temperature", "temperature"]
    assert any(question.startswith(f"{name}: ") for question in seen.questions)


def test_fahrenheit_by_a_name_and_a_room_is_in_the_line_to_copy(tmp_path: Path) -> None:
    path = tmp_path / "board.log"
    path.write_text("ms,TempPCB_F,gyro_F\n" + "".join(f"{1000 * k},{67.5 + 0.1 * k:.1f},{20 + 0.1 * k:.1f}\n" for k in range(40)))
    lines = td.look(path).campaign()
    (record,) = tomllib.loads(lines)["records"].values()
    assert [c["unit"] for c in record["channels"].values()] == ["degF", "degF"]


def test_what_no_log_says_is_asked_for_in_its_first_lines(log) -> None:
    shown = td.look(log).lines()
    assert any("accuracy = " in line for line in shown[:4])
    assert "# add accuracy = " in td.look(log).campaign()


@pytest.mark.parametrize("blank", [" ", "_"])
def test_units_after_a_blank_are_those_after_an_underscore(tmp_path: Path, blank: str) -> None:
    """A log headed "time s, board C, supply V, supply A" had no time, no thermometer and no power."""
    head = ",".join(f"{n}{blank}{u}" for n, u in (("time", "s"), ("board", "C"), ("heater", "mW"), ("supply", "V"), ("supply", "A")))
    (tmp_path / "run.csv").write_text(f"{head}\n0,20.1,0,0,0\n60,25.3,900,12,0.5\n120,31.4,905,12,0.6\n", encoding="utf-8")
    seen = td.look(tmp_path / "run.csv")
    assert [(c.guess, c.unit) for c in seen.columns] == [
        ("time", ""), ("temperature", "degC"), ("power", "mW"), ("ignored", "V"), ("ignored", "A"),
    ]  # fmt: skip
    record = td.read_record(tmp_path / "run.csv", {f"board{blank}C": {"node": "board"}})
    assert not record[f"board{blank}C"].assumed
    assert tomllib.loads(seen.campaign())["records"]["run"]["channels"]["P_supply"]["power"] == {
        "volts": f"supply{blank}V",
        "amperes": f"supply{blank}A",
    }


def test_one_voltage_and_several_currents_are_a_power_each(tmp_path: Path) -> None:
    """Of a bus and five consumers nothing was proposed."""
    (tmp_path / "run.csv").write_text("time_s,V_BUS [V],I_EPS [A],I_OBC [A]\n0,8,0.1,0.2\n60,8,0.1,0.3\n120,8,0.1,0.2\n", encoding="utf-8")
    seen = td.look(tmp_path / "run.csv")
    record = td.read_record(tmp_path / "run.csv", tomllib.loads(seen.campaign())["records"]["run"]["channels"])
    assert record["P_EPS"].values == pytest.approx([0.8, 0.8, 0.8])
    assert record["P_OBC"].values == pytest.approx([1.6, 2.4, 1.6])
    assert not [line for line in seen.lines() if "I_EPS: a current" in line]


def test_letters_that_count_boards_are_no_units(tmp_path: Path) -> None:
    (tmp_path / "run.csv").write_text("time_s,board A,board B,board C\n0,20,20,20\n60,25,26,27\n", encoding="utf-8")
    assert {c.guess for c in td.look(tmp_path / "run.csv").columns[1:]} == {"ignored"}


def test_columns_that_differ_by_their_unit_alone_are_proposed_by_their_headings(tmp_path: Path) -> None:
    """Of "supply [V]" and "supply [A]" a record was proposed that nobody could read."""
    (tmp_path / "run.csv").write_text("time_s,board [degC],supply [V],supply [A]\n0,20,0,0\n60,25,12,0.5\n", encoding="utf-8")
    channels = tomllib.loads(td.look(tmp_path / "run.csv").campaign())["records"]["run"]["channels"]
    record = td.read_record(tmp_path / "run.csv", channels)
    assert record["P_supply"].values.tolist() == [0.0, 6.0]


def test_voltages_and_currents_are_paired_by_the_words_they_share(tmp_path: Path) -> None:
    """Of five pairs in one log none was taken, and the table of channels was empty."""
    (tmp_path / "run.csv").write_text(
        "time_s,proc V,proc A,supply V [V],supply A [A],V_fan [V],I_fan [A],U1 [V],I1 [A],bus V,spare A\n"
        "0,5,0,28,0,12,0,3,0,5,0\n60,5,1,28,0.5,12,0.1,3,2,5,1\n",
        encoding="utf-8",
    )
    seen = td.look(tmp_path / "run.csv")
    channels = tomllib.loads(seen.campaign())["records"]["run"]["channels"]
    record = td.read_record(tmp_path / "run.csv", channels)
    assert {n: record[n].values[-1] for n in channels} == pytest.approx({"P_proc": 5.0, "P_supply": 14.0, "P_fan": 1.2, "P_1": 6.0})
    assert [c.name for c in seen.courses()] == ["proc V * proc A", "supply V * supply A", "V_fan * I_fan", "U1 * I1"]


def test_a_stamp_above_the_header_that_is_not_used_is_named(tmp_path: Path) -> None:
    rows = [f"{10 * k}.0,{20 + 0.01 * k:.2f}" for k in range(20)]
    (tmp_path / "daq.txt").write_text("\n".join(["[DAQ]", "Started 2026-03-10 09:02:32", "", "t [s],T_BOARD [degC]", *rows]) + "\n")
    assert "2026-03-10 09:02:32" in str(td.look(tmp_path / "daq.txt"))
