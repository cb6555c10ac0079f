"""What a log leaves open is asked first: units, two readings at one time, a lost hour, a switch that nobody saw."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import thermid as td
from thermid.app.cli.app import app
from thermid.campaign.stages import check_campaign

STEP, SIZE = 60.0, 240
TIMES = STEP * np.arange(SIZE)
ON = 3600.0
POWER = np.where(TIMES < ON, 0.0, 3.0)
ROOM = 21.0 + 0.01 * np.random.default_rng(1).standard_normal(SIZE)
DECK = """
title = "box"
needs = ["air"]
nodes.case.capacitance = "300 [J/K]"
surfaces.skin = { of = "case", to = "air", area = "0.03 [m^2]", effective_htc = "10 [W/(m^2 K)]" }
loads.heat = { into = "case", power = "3 [W]" }
"""
CAMPAIGN = """
title = "questions"
[records.log]
file = "log.csv"
channels = { T = { node = "case", noise = "0.05 [K]"UNIT }, ROOM = { boundary = "air"UNIT }, P = { load = "heat" } }
[[stages]]
name = "only"
model = "box.toml"
records = ["log"]
free = ["skin.effective_htc"]
"""
BOUND: dict[str, Any] = {"T": {"node": "case"}, "ROOM": {"boundary": "air"}, "P": {"load": "heat"}}


def case() -> np.ndarray:
    """Return the readings of the case. [degC]"""
    rise = np.where(TIMES < ON, 0.0, 10.0 * (1.0 - np.exp(-(TIMES - ON) / 1000.0)))
    return np.asarray(21.0 + rise + 0.02 * np.random.default_rng(2).standard_normal(SIZE))


def fahrenheit(celsius: np.ndarray) -> np.ndarray:
    return 1.8 * celsius + 32.0


def write(folder: Path, columns: dict[str, np.ndarray], stamps: Sequence[str] | None = None) -> Path:
    """Write a log."""
    times = [f"{t:g}" for t in TIMES[: next(iter(columns.values())).size]] if stamps is None else stamps
    rows = [",".join([t, *(f"{c[k]:.3f}" for c in columns.values())]) for k, t in enumerate(times)]
    (folder / "log.csv").write_text("\n".join([",".join(["time", *columns]), *rows]) + "\n", encoding="utf-8")
    return folder / "log.csv"


def asked(path: Path, **more: Any) -> tuple[str, ...]:
    """Return the questions of a log, which `look` asks too."""
    record = td.read_record(path, BOUND, **more)
    if not more:
        look = td.look(path)
        assert look.questions == record.origin.questions
        assert look.lines()[1 : 1 + len(look.questions)] == [f"  check: {q}" for q in look.questions]
    return record.origin.questions


def columns(**changed: np.ndarray) -> dict[str, np.ndarray]:
    return {"T": case(), "ROOM": ROOM, "P": POWER} | changed


def test_a_usual_log_leaves_nothing_open(tmp_path: Path) -> None:
    assert asked(write(tmp_path, columns())) == ()


# units -------------------------------------------------------------------------------------------------------------------------------


def test_a_room_of_70_is_asked_about(tmp_path: Path) -> None:
    path = write(tmp_path, columns(T=fahrenheit(case()), ROOM=fahrenheit(ROOM)))
    (question,) = asked(path)
    assert "T, ROOM" in question
    assert '= "degF"' in question
    for unit in ("degF", "degC"):
        assert asked(path, units={"T": unit, "ROOM": unit}) == ()


def test_a_unit_in_the_header_is_no_question(tmp_path: Path) -> None:
    path = write(tmp_path, {"T [degC]": case() + 49.0, "ROOM [degC]": ROOM + 49.0, "P [W]": POWER})
    assert td.read_record(path, BOUND).origin.questions == ()
    assert td.look(path).questions == ()


@pytest.mark.parametrize("level", [-20.0, 5.0, 80.0])
def test_other_levels_are_no_room_in_fahrenheit(tmp_path: Path, level: float) -> None:
    assert asked(write(tmp_path, columns(T=case() + level, ROOM=ROOM + level))) == ()


def test_look_check_and_calibrate_ask_first(tmp_path: Path) -> None:
    write(tmp_path, columns(T=fahrenheit(case()), ROOM=fahrenheit(ROOM)))
    (tmp_path / "box.toml").write_text(DECK, encoding="utf-8")
    file = tmp_path / "c.toml"
    file.write_text(CAMPAIGN.replace("UNIT", ""), encoding="utf-8")
    assert "degF" in check_campaign(file)[0][0].message
    runner = CliRunner()
    for command in ("look", "check", "calibrate"):
        said = runner.invoke(app, [command, str(tmp_path / "log.csv" if command == "look" else file)]).stdout.split("\n")
        at = next(k for k, line in enumerate(said) if "degF" in line)
        assert at <= 1 + (command == "calibrate"), said[:5]
    file.write_text(CAMPAIGN.replace("UNIT", ', unit = "degF"'), encoding="utf-8")
    fit = td.run_stages(file).stages["only"]
    assert not [w for w in fit.warnings if "degF" in w]
    assert fit["skin.effective_htc"].value == pytest.approx(10.0, abs=0.5)


# two readings at one time ------------------------------------------------------------------------------------------------------------


def test_two_readings_at_one_time_are_named(tmp_path: Path) -> None:
    rows = np.insert(np.arange(SIZE), 100, 99)
    warm = case()[rows]
    warm[100] += 12.0
    path = write(tmp_path, {"T": warm, "ROOM": ROOM[rows], "P": POWER[rows]}, [f"{t:g}" for t in TIMES[rows]])
    (question,) = asked(path)
    assert all(part in question for part in ("T up to 12", "99 min"))
    assert td.read_record(path, BOUND)["T"].values[99] == pytest.approx(warm[99:101].mean() + 273.15)


@pytest.mark.parametrize("name", ["level [mm]", "torque", "pressure", "row count"])
def test_look_asks_of_columns_that_it_ignores_too(tmp_path: Path, name: str) -> None:
    """Such a column may be bound by a campaign; one that counts rows differs at every stamp and is none."""
    rows = np.insert(np.arange(SIZE), 100, 99)
    other = 40.0 + 0.01 * np.arange(SIZE + 1) if name == "row count" else np.linspace(1.0, 2.0, SIZE)[rows]
    other[100] += 7.0
    stamps = [f"{t:g}" for t in TIMES[rows]]
    look = td.look(write(tmp_path, {n: c[rows] for n, c in columns().items()} | {name: other}, stamps))
    named = [q for q in look.questions if f"{name.partition(' [')[0]} " in q]
    assert [bool(re.search("1 .* 7 ", q)) for q in named] == [True] * (name != "row count")
    assert look.lines()[1 : 1 + len(look.questions)] == [f"  check: {q}" for q in look.questions]


def test_a_row_that_is_there_twice_is_no_question(tmp_path: Path) -> None:
    rows = np.insert(np.arange(SIZE), 100, 99)
    path = write(tmp_path, {n: c[rows] for n, c in columns().items()}, [f"{t:g}" for t in TIMES[rows]])
    assert asked(path) == ()
    assert any(re.match(r"1 of \d+ ", step) for step in td.read_record(path, BOUND).steps)


# an hour of the clock ----------------------------------------------------------------------------------------------------------------


def stamps(jump: float, begin: str = "2026-03-28 23:30:00", zone: str = "") -> list[str]:
    """Return stamps of a clock that goes on by `jump` at two o'clock. [s]"""
    made = [datetime.fromisoformat(begin) + timedelta(seconds=float(t)) for t in TIMES]
    change = datetime.fromisoformat("2026-03-29 02:00:00")
    return [f"{t + timedelta(seconds=jump) if t >= change else t}{zone}" for t in made]


def test_an_hour_lost_to_summer_time_is_named(tmp_path: Path) -> None:
    (question,) = asked(write(tmp_path, columns(), stamps(3600.0)))
    assert "2026-03-29 01:59:00 to 2026-03-29 03:00:00" in question


def test_a_true_hole_of_an_hour_is_no_summer_time(tmp_path: Path) -> None:
    late = TIMES >= 9000.0
    warm = np.where(late, 25.0 + 0.02 * np.random.default_rng(3).standard_normal(SIZE), case())
    assert asked(write(tmp_path, columns(T=warm), stamps(3600.0))) == ()
    assert asked(write(tmp_path, columns(), stamps(3600.0, zone="+01:00"))) == ()
    assert asked(write(tmp_path, columns(), stamps(5400.0))) == ()


# a switch that nobody saw ------------------------------------------------------------------------------------------------------------


def test_a_switch_inside_a_hole_is_named(tmp_path: Path) -> None:
    kept = (TIMES < 3000.0) | (TIMES > 4800.0)
    path = write(tmp_path, {n: c[kept] for n, c in columns().items()}, [f"{t:g}" for t in TIMES[kept]])
    (question,) = asked(path)
    assert all(part in question for part in ("0 to 3", "32 min at 49 min"))


def test_a_hole_without_a_switch_and_a_noisy_power_are_no_question(tmp_path: Path) -> None:
    kept = (TIMES < 6000.0) | (TIMES > 7800.0)
    watts = POWER + 0.05 * np.random.default_rng(4).standard_normal(SIZE)
    path = write(tmp_path, {n: c[kept] for n, c in columns(P=watts).items()}, [f"{t:g}" for t in TIMES[kept]])
    assert asked(path) == ()


# exchanged sensors -------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("heavy", "asks"), [("300 [J/K]", True), ("200 [J/K]", False)])
def test_an_exchange_that_fitted_values_absorb_is_asked_about(heavy: str, asks: bool) -> None:
    """The fit was credible with the capacitances of the two parts exchanged."""
    links = {n: {"kind": "conduction", "between": [n, "air"], "conductance": "0.5 [W/K]"} for n in ("a", "b")}
    model = td.model_from_dict(
        {
            "title": "two",
            "needs": ["air"],
            "nodes": {"a": {"capacitance": "200 [J/K]"}, "b": {"capacitance": heavy}},
            "conductors": {f"to_{n}": link for n, link in links.items()},
            "loads": {n + "_heat": {"into": n, "power": "3 [W]"} for n in ("a", "b")},
        }
    )
    truth = td.simulate(model, td.Scenario("s", boundaries={"air": "21 [degC]"}, start="air", duration=TIMES[-1]), times=TIMES)
    noise = 0.03 * np.random.default_rng(5).standard_normal((2, SIZE))
    channels = {
        f"T{n}": td.Channel.from_array(f"T{n}", truth[m].celsius + noise[k], unit="degC", role="node", target=n, noise=0.03)
        for k, (n, m) in enumerate((("a", "b"), ("b", "a")))
    }
    channels["ROOM"] = td.Channel.from_array("ROOM", np.full(SIZE, 21.0), unit="degC", role="boundary", target="air")
    record = td.Record.from_arrays("log", TIMES, channels)
    fit = td.calibrate(model, record, ["a.capacitance", "b.capacitance"], scenario=td.Scenario("s"))
    assert any("'Ta' and 'Tb'" in w for w in fit.warnings) == asks


@pytest.mark.parametrize(("offset", "asked"), [("-3600 [s]", True), ("-40 [s]", False)])
def test_an_offset_that_leaves_much_of_a_log_alone_is_questioned(offset: str, asked: bool) -> None:
    """An hour of five was without powers, and `check` counted no error and no warning."""
    times = np.arange(0.0, 18001.0, 10.0)

    def channel(name: str, unit: str) -> td.Channel:
        return td.Channel.from_array(
            name,
            np.full(times.size, 290.0),
            unit=unit,
            quantity="power" if unit == "W" else "temperature",
            role="load" if unit == "W" else "node",
            target="a",
        )

    board = td.Record.from_arrays("board", times, {"T": channel("T", "K")})
    supply = td.Record.from_arrays("supply", times, {"P": channel("P", "W")})
    joint = board.joined(supply, offset)
    assert [bool(re.search("2 h .* 6 h.*'supply'", q)) for q in joint.questions] == [True] * asked
    assert not joint.trim("0 [s]", "14400 [s]").questions
