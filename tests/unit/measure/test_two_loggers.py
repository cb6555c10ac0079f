"""Two loggers of one test: the join that `look` proposes, by stamps and by a step that both show."""

from __future__ import annotations

import importlib.util
import re
import sys
import tomllib
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from thermid.app.cli.app import app
from thermid.measure._readers.common_step import CommonStep, LogCourse, common_step
from thermid.measure._readers.look import _by_step, _OffsetSoFar, _Way
from thermid.measure.looks import Look, clock_lines, clocks_of, look, named_apart


@pytest.fixture(scope="module")
def hour() -> ModuleType:
    path = Path(__file__).parents[3] / "scripts" / "first_hour.py"
    spec = importlib.util.spec_from_file_location("first_hour", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["first_hour"] = module
    spec.loader.exec_module(module)
    return module


def files(hour: ModuleType, folder: Path, late: float, stamp: str = "") -> tuple[Path, Path]:
    """Write the log of the board and that of the supply, whose clock begins `late` seconds after it."""
    bench = hour.Bench(rest=600.0, steps=((1800.0, 0.75), (900.0, 0.2), (900.0, 0.0)))
    times = np.arange(0.0, bench.duration, 15.0)
    read = bench.readings(times)
    rows = ["millis,T_BOX [degC],T_BOARD [degC]"]
    rows += [f"{1000 * t:.0f},{a:.2f},{b:.2f}" for t, a, b in zip(times, read["BOX"], read["BOARD"], strict=True)]
    (folder / "board.csv").write_text("\n".join(rows) + "\n")
    own = np.arange(late, bench.duration - 10.0, 5.0)
    amperes = bench.current(own) + 0.002 * np.random.default_rng(3).standard_normal(own.size)
    head = f"time{' [s]' if not stamp else ''},U [V],I [A]"
    rows = [head, *(f"{t - late:g},{bench.volts},{i:.4f}" for t, i in zip(own, amperes, strict=True))]
    (folder / "supply.csv").write_text("\n".join(rows) + "\n")
    return folder / "board.csv", folder / "supply.csv"


def test_the_offset_of_a_supply_without_stamps_is_found_by_its_steps(hour: ModuleType, tmp_path: Path) -> None:
    looks = [look(path) for path in files(hour, tmp_path, 137.0)]
    (found,) = clocks_of(looks)
    assert found["offset"] is None
    step = found["step"]
    assert step["columns"] == ["T_BOARD", "U * I"]
    assert step["error"] < 16.0
    assert abs(step["offset"] - 137.0) < 2.0 * step["error"]
    text = "\n".join(clock_lines(looks, [found]))
    assert "T_BOARD and U * I, supply.csv" in text
    assert '= "supply"' in text
    assert 'P_supply = { load = "P_supply", power = { volts = "U", amperes = "I" } }' in looks[1].campaign()


def test_a_counter_of_energy_is_a_power_and_stamps_of_later_logs_are_compared(hour: ModuleType, tmp_path: Path) -> None:
    """It was ignored, and three loggers of which the first has no stamps ended in a traceback."""
    board, supply = files(hour, tmp_path, 137.0)
    t, volts, amperes = np.loadtxt(supply, delimiter=",", skiprows=1).T
    counter = (998.0 + np.cumsum(volts * amperes) * 5.0 / 3600.0) % 1000.0  # it overflows
    begin = np.datetime64("2026-03-10T09:00:00")
    rows = [f"{begin + np.timedelta64(int(a), 's')},{e:.4f}" for a, e in zip(t, counter, strict=True)]
    supply.write_text("\n".join(["stamp,E [Wh]", *rows]) + "\n")
    each = [row.split(",") for row in board.read_text().splitlines()[1:]]
    stamped = [f"{begin + np.timedelta64(int(float(a) / 1000.0) + 800, 's')},{b}" for a, _, b in each]  # 937 s later than they were
    (tmp_path / "late.csv").write_text("\n".join(["stamp,T_LID [degC]", *stamped]) + "\n")
    board.write_text("\n".join(["time [s],T_BOARD [degC]", *(f"{float(a) / 1000.0:g},{b}" for a, _, b in each)]) + "\n")
    looks = [look(path) for path in (board, tmp_path / "late.csv", supply)]
    assert '{ energy = "E" }' in looks[2].campaign()
    clocks = clocks_of(looks)
    late, of_supply = ((one["at"]["offset"], one["at"]["error"]) for one in clocks)
    assert abs(late[0]) < 3.0 * late[1]
    assert abs(of_supply[0] - 137.0) < 3.0 * of_supply[1]
    (said,) = (line for line in clock_lines(looks, clocks) if re.match(r" +check: .* s$", line))
    assert float(said.split()[-2]) == pytest.approx(of_supply[0] + 800.0, abs=0.5)


@pytest.mark.parametrize(("off", "agrees"), [(5.0, True), (900.0, False)])
def test_a_step_of_a_power_decides_and_stamps_that_it_contradicts_are_named(
    hour: ModuleType, tmp_path: Path, off: float, agrees: bool
) -> None:
    """Clocks of two computers: the stamps of the supply are `off` s early, its readings are not."""
    begin = np.datetime64("2026-03-10T09:00:00")
    for path, late, name in zip(files(hour, tmp_path, 137.0), (0.0, 137.0 - off), ("millis", "time [s]"), strict=True):
        head, *rows = path.read_text().splitlines()
        each = [row.partition(",") for row in rows]
        unit = 1e-3 if name == "millis" else 1.0
        stamped = [f"{begin + np.timedelta64(round(1000 * (unit * float(t) + late)), 'ms')},{rest}" for t, _, rest in each]
        path.write_text("\n".join([head.replace(name, "stamp"), *stamped]) + "\n")
    looks = [look(tmp_path / f"{n}.csv") for n in ("board", "supply")]
    (found,) = clocks_of(looks)
    assert found["offset"] == pytest.approx(137.0 - off)
    assert abs(found["step"]["offset"] - 137.0) < 3.0 * found["step"]["error"]
    assert found["step"]["contradicted"] is not agrees
    text = "\n".join(clock_lines(looks, [found]))
    assert bool(re.search(r"^ +check: .* s .*, \d+ ", text, re.MULTILINE)) is not agrees
    (pair,) = joined_lines(looks, [found])
    low, high = (float(str(end).removesuffix(" [s]")) for end in list(pair["offset"]))  # type: ignore[call-overload]
    assert low < 137.0 < high
    head, joined = looks[0].campaign(), next(line for line in text.splitlines() if line.startswith("    joined "))
    head = head.replace("\n[records.board.channels]", f"{joined.strip()}\n\n[records.board.channels]")
    (tmp_path / "b.toml").write_text(
        'title = "b"\nneeds = ["air"]\n[nodes]\nT_BOX = { capacitance = "900 [J/K]" }\nT_BOARD = { capacitance = "90 [J/K]" }\n'
        '[conductors]\nc = { kind = "conduction", between = ["T_BOX", "T_BOARD"], conductance = "1 [W/K]" }\n'
        's = { kind = "convection", between = ["T_BOX", "air"], area = "0.1 [m^2]", htc = { value = "8 [W/(m^2 K)]", min = 1, max = 9 } }\n'
        '[loads]\nP_supply = { into = "T_BOARD", power = "0 [W]" }\n'
    )
    stage = '[[stages]]\nname = "b"\nmodel = "b.toml"\nrecords = ["board"]\nfree = ["s.htc"]\nscenario.boundaries.air = "22 [degC]"\n'
    (tmp_path / "c.toml").write_text(f'title = "c"\n{head}\n{looks[1].campaign()}\n{stage}')
    checked = CliRunner().invoke(app, ["check", str(tmp_path / "c.toml")])
    assert checked.exit_code == 0, checked.output


def stamped_in_zones(hour: ModuleType, folder: Path, zones: tuple[str, str]) -> list[Look]:
    """Write the log of the board at 2 h ahead of UTC, and that of the supply in UTC, 37 s behind; a zone is written where it is given."""
    begin = np.datetime64("2026-03-10T21:30:07")
    for path, late, zone in zip(files(hour, folder, 137.0), (7200.0, 100.0), zones, strict=True):
        head, *rows = path.read_text().splitlines()
        unit = 1e-3 if head.startswith("millis") else 1.0
        each = [(unit * float(row.partition(",")[0]) + late, row.partition(",")[2]) for row in rows]
        texts = [f"{begin + np.timedelta64(round(1000 * t), 'ms')}{zone},{rest}" for t, rest in each]
        path.write_text("\n".join([f"stamp,{head.partition(',')[2]}", *texts]) + "\n")
    return [look(folder / f"{n}.csv") for n in ("board", "supply")]


@pytest.mark.parametrize(("zones", "asked"), [(("", "Z"), True), (("+02:00", "Z"), False), (("+02:00", "+00:00"), False)])
def test_local_stamps_beside_stamps_in_utc_are_not_hours_apart(
    hour: ModuleType, tmp_path: Path, zones: tuple[str, str], asked: bool
) -> None:
    """Stamps of 21:30:07 and 20:30:07Z were joined 3600 s apart, and no line said that only one of them states its zone."""
    looks = stamped_in_zones(hour, tmp_path, zones)
    (found,) = clocks_of(looks)
    assert found["offset"] == pytest.approx(100.0)
    low, high = (float(str(end).removesuffix(" [s]")) for end in joined_lines(looks, [found])[0]["offset"])  # type: ignore[attr-defined]
    assert low < 137.0 < high
    first = clock_lines(looks, [found])[0]
    assert bool(re.match(r"check: .*board\.csv.*supply\.csv Z\. ", first)) is asked
    assert ("fit if board.csv is 2 h" in first and "UTC" in first) is asked
    shown = CliRunner().invoke(app, ["look", *(str(one.path) for one in looks)]).output
    assert (shown.splitlines()[0] == first) is asked


def test_where_no_power_tells_the_zone_it_is_asked_for(hour: ModuleType, tmp_path: Path) -> None:
    looks = stamped_in_zones(hour, tmp_path, ("", "Z"))
    path = looks[1].path
    head, *rows = path.read_text().splitlines()
    path.write_text("\n".join([head, *(f"{row.partition(',')[0]},28.0,0.5" for row in rows)]) + "\n")
    looks = [looks[0], look(path)]
    clocks = clocks_of(looks)
    assert clocks[0]["offset"] is None
    assert clock_lines(looks, clocks)[0].endswith("?")
    assert joined_lines(looks, clocks)[0]["offset"] == "... [s]"


def test_two_thermometers_of_one_room_show_the_offset_with_its_sign() -> None:
    rng, t = np.random.default_rng(0), np.arange(0.0, 3600.0, 10.0)

    def room(times: np.ndarray) -> np.ndarray:
        return 295.0 + 2.0 * np.tanh((times - 1500.0) / 200.0) + 0.02 * rng.standard_normal(times.size)

    early, late = (
        LogCourse("a", False, t, room(t), heated=False),
        LogCourse("b", False, t[:200], 0.9 * room(t[:200] + 250.0) + 30.0, heated=False),
    )
    found, back = common_step([early], [late]), common_step([late], [early])
    assert found is not None
    assert back is not None
    assert found.offset == pytest.approx(250.0, abs=4.0 * found.error)
    assert back.offset == pytest.approx(-250.0, abs=4.0 * back.error)
    assert found.error < 20.0


def test_no_zone_is_asked_for_where_a_step_of_two_thermometers_gives_the_offset(tmp_path: Path) -> None:
    """It was asked twice, above and beside the offset that made the answer useless."""
    rng, t = np.random.default_rng(0), np.arange(0.0, 3600.0, 10.0)
    warm = 22.0 + 2.0 * np.tanh((t - 1500.0) / 200.0) + 0.02 * rng.standard_normal((2, t.size))
    for name, hour, zone, reading in zip(("daq", "shroud"), ("07", "06"), ("", "Z"), warm, strict=True):
        begin = np.datetime64(f"2026-11-17T{hour}:00:00")
        lines = [f"{begin + np.timedelta64(int(s), 's')}{zone},{value:.3f}" for s, value in zip(t, reading, strict=True)]
        (tmp_path / f"{name}.csv").write_text("\n".join([f"stamp,{name}_air [degC]", *lines]) + "\n")
    shown = CliRunner().invoke(app, ["look", *(str(tmp_path / f"{n}.csv") for n in ("daq", "shroud"))]).output
    (asked,) = (line for line in shown.splitlines() if "daq.csv" in line and "shroud.csv Z" in line)
    assert not asked.endswith("?")
    assert all(part in shown for part in ("fit if daq.csv is 1 h", "UTC"))


@pytest.mark.parametrize(("name", "candidate"), [("converter", True), ("Plate", False)])
def test_a_lag_that_a_shift_explains_is_an_error_of_the_offset_unless_both_are_one_place(name: str, candidate: bool) -> None:
    """A plate 200 s behind a converter that cools: no reading tells that from a clock that is 200 s wrong."""
    rng, t = np.random.default_rng(6), np.arange(0.0, 18000.0, 30.0)

    def warm(times: np.ndarray) -> np.ndarray:
        switches = ((1800.0, 20.0), (9000.0, -11.0), (14400.0, -9.0))
        rise: np.ndarray = np.sum([p * (1.0 - np.exp(-np.clip(times - s, 0.0, None) / 1500.0)) for s, p in switches], axis=0)
        return 295.0 + rise

    own, lag = np.arange(0.0, 8600.0, 10.0), 200.0 if candidate else 0.0
    plate = LogCourse("plate", False, t, warm(t - lag) + 0.05 * rng.standard_normal(t.size))
    found = common_step([plate], [LogCourse(name, False, own, warm(own + 9385.0) + 0.05 * rng.standard_normal(own.size))])
    assert found is not None
    assert not found.lags
    assert found.candidate is candidate
    assert abs(found.offset - 9385.0) < 2.0 * found.error
    assert (found.error > 60.0) is candidate


def test_a_rise_is_not_matched_with_a_fall() -> None:
    """A board logged until its restart, so without the cooling: upside down, the cooling of the case would fit its rise better."""
    rng, t = np.random.default_rng(4), np.arange(0.0, 24000.0, 30.0)

    def warm(times: np.ndarray, lag: float, rise: float) -> np.ndarray:
        made = sum(p * (1.0 - np.exp(-np.clip(times - s, 0.0, None) / lag)) for s, p in ((1500.0, 0.7), (9000.0, -0.3), (13000.0, 0.6)))
        made = made - 1.0 * (1.0 - np.exp(-np.clip(times - 19000.0, 0.0, None) / lag))
        return 295.0 + rise * made + 0.04 * rng.standard_normal(times.size)

    case = LogCourse("case", False, t, warm(t, 1500.0, 15.0))
    own = np.arange(0.0, 5000.0, 20.0)
    found = common_step([case], [LogCourse("board", False, own, warm(own + 85.0, 1500.0, 30.0))])
    assert found is not None
    assert found.offset == pytest.approx(85.0, abs=4.0 * found.error)
    # a board that only cools in what was logged has no step in common with a case that only warms
    rise, fall = (LogCourse(n, False, t[:300], v) for n, v in (("rise", case.values[:300]), ("fall", 590.0 - case.values[:300])))
    assert common_step([rise], [fall]) is None


def test_what_pairs_of_places_disagree_by_is_an_error_of_the_offset() -> None:
    """A case and a sink in one log, a board and a coil in the other, and no power: each follows the step with a lag of its own."""
    t = np.arange(0.0, 24000.0, 30.0)
    rng = np.random.default_rng(8)

    def warm(name: str, times: np.ndarray, late: float, lag: float) -> LogCourse:
        heat = np.where(times + late < 1500.0, 0.0, 1.0 - np.exp(-(times + late - 1500.0) / lag))
        cool = np.where(times + late < 14000.0, 0.0, 1.0 - np.exp(-(times + late - 14000.0) / lag))
        return LogCourse(name, False, times, 295.0 + 15.0 * (heat - cool) + 0.04 * rng.standard_normal(times.size))

    first = [warm("case", t, 0.0, 1500.0), warm("sink", t, 0.0, 1000.0)]
    found = common_step(first, [warm("board", t[:700], 85.0, 600.0), warm("coil", t[:700], 85.0, 1300.0)])
    assert found is not None
    assert abs(found.offset - 85.0) < 2.0 * found.error
    room = LogCourse("room", False, t, first[0].values, heated=False)
    assert common_step([room], [warm("board", t[:700], 85.0, 600.0)]) is None  # surroundings are not what a power heats


def halves(seed: int) -> tuple[LogCourse, LogCourse, float]:
    """Return a temperature and a power of one test that overlap by 30 to 100 %, and by how much the second clock is late. [s]"""
    rng = np.random.default_rng(seed)
    shared, noise, first = rng.choice([0.3, 0.45, 0.6, 0.8, 1.0]), rng.choice([0.01, 0.05, 0.2]), bool(rng.random() < 0.5)
    pulses = int(rng.integers(1, 4))
    edges = rng.uniform(300.0, 2000.0) + np.concatenate([[0.0], np.cumsum(rng.uniform(900.0, 6000.0, 2 * pulses))])
    levels = np.column_stack([rng.uniform(2.0, 10.0, pulses), rng.uniform(0.0, 2.0, pulses)]).ravel()
    grid = np.arange(0.0, edges[-1] + rng.uniform(0.0, 3000.0), 5.0)
    power = np.concatenate([[0.0], levels, [0.0]])[np.searchsorted(edges, grid, side="right")]
    board, case, link, loss = rng.uniform(50.0, 200.0), rng.uniform(200.0, 1500.0), rng.uniform(0.3, 2.0), rng.uniform(0.2, 1.0)
    hot, warm, out = 0.0, 0.0, np.empty(grid.size)
    for k, heat in enumerate(power.tolist()):  # explicit steps of 5 s, far below both time constants
        out[k], flow = hot, link * (hot - warm)
        hot, warm = hot + 5.0 * (heat - flow) / board, warm + 5.0 * (flow - loss * warm * (abs(warm) / 10.0) ** 0.25) / case
    length = grid[-1] / (2.0 - shared)
    early, late = 0.0, grid[-1] - length
    starts = (early, late) if first else (late, early)
    a, b = (start + np.arange(0.0, length, step) for start, step in zip(starts, (10.0, 5.0), strict=True))
    seen = LogCourse("T", False, a - a[0], 295.0 + np.interp(a, grid, out) + noise * rng.standard_normal(a.size))
    return seen, LogCourse("P", True, b - b[0], np.interp(b, grid, power)), float(b[0] - a[0])


KINDS = ("plain", "coarse", "lag", "often", "drift", "still")


def power_and_temperatures(seed: int, kind: str) -> tuple[list[LogCourse], LogCourse, float]:
    """Return one to three temperatures of a chain of three masses and a power, and by how much the second clock is late. [s]

    "coarse": a reading in 30 or 60 s; "lag": thermometers 20 to 120 s behind; "often": 8 to 24 switches; "drift": a rate 0.2 % off;
    "still": a power that does not change.
    """
    rng = np.random.default_rng([seed, KINDS.index(kind)])
    switches = int(rng.integers(8, 25)) if kind == "often" else int(rng.integers(2, 6))
    total = float(rng.uniform(6000.0, 20000.0))
    edges, levels = np.sort(rng.uniform(0.05, 0.95, switches)) * total, np.concatenate([[0.0], rng.uniform(0.0, 20.0, switches)])
    grid = np.arange(-400.0, total + 400.0)
    power = np.where(kind == "still", 7.0, levels[np.searchsorted(edges, grid, side="right")])
    capacities = np.array([rng.uniform(20.0, 100.0), rng.uniform(100.0, 400.0), rng.uniform(400.0, 2500.0)])
    first, second, loss = rng.uniform(0.3, 2.0), rng.uniform(0.5, 3.0), rng.uniform(0.2, 1.2)
    lag = float(rng.uniform(20.0, 120.0) if kind == "lag" else rng.uniform(1.5, 15.0))
    rises, read = np.zeros(3), np.zeros(3)
    seen = np.empty((grid.size, 3))
    for k, heat in enumerate(power.tolist()):  # explicit steps of 1 s, below all time constants
        seen[k], read = read, read + (rises - read) / lag
        down, out = first * (rises[0] - rises[1]), second * (rises[1] - rises[2])
        away = loss * rises[2] * (abs(rises[2]) / 10.0) ** 0.25
        rises = rises + np.array([heat - down, down - out, out - away]) / capacities
    step, own_step = (float(rng.choice((30.0, 60.0) if kind == "coarse" else (1.0, 2.0, 5.0, 20.0))) for _ in range(2))
    late, rate = float(rng.uniform(-200.0, 200.0)), 1.0 + float(rng.uniform(-1.0, 1.0)) * (2e-3 if kind == "drift" else 5e-5)
    times, own = np.arange(float(rng.uniform(0.0, step)), total, step), np.arange(0.0, total - 250.0, own_step)
    noise, digit = float(rng.choice((0.01, 0.05, 0.1))), float(rng.choice((0.01, 0.0625, 0.1)))
    places = rng.permutation(3)[: int(rng.integers(1, 4))].tolist()
    readings = [np.interp(times, grid, seen[:, n]) + noise * rng.standard_normal(times.size) for n in places]
    watts = power[np.searchsorted(grid, rate * own + late, side="right") - 1] + 0.005 * rng.standard_normal(own.size)
    temperatures = [LogCourse(f"T{n}", False, times - times[0], np.round(v / digit) * digit) for n, v in zip(places, readings, strict=True)]
    return temperatures, LogCourse("P", True, own, watts), late - float(times[0])


@pytest.mark.campaign
def test_of_forty_pairs_of_logs_the_offset_is_inside_its_error_or_open() -> None:
    """Seven of each kind but the last, and five logs without a step: 24 or more are found, 95 % of them within two errors.

    One case, logged without the board that is heated, is 5 errors off: slow masses before it and a thermometer that lags look like a clock.
    """
    deviations = []
    for kind in KINDS[:-1]:
        for seed in range(7):
            temperatures, power, late = power_and_temperatures(seed, kind)
            if (found := common_step(temperatures, [power])) is not None:
                deviations.append(abs(found.offset - late) / found.error)
    assert all(common_step(t, [p]) is None for t, p, _ in (power_and_temperatures(seed, "still") for seed in range(5)))
    assert len(deviations) >= 24
    assert sum(d < 2.0 for d in deviations) >= 0.95 * len(deviations)


def powers_that_act_together(seed: int) -> tuple[list[LogCourse], list[LogCourse], float]:
    """Return temperatures of three masses and the log of two powers that switch at times of their own, and by how much it is late. [s]"""
    rng = np.random.default_rng(seed)
    grid = np.arange(0.0, 8600.0, 2.0)
    edges = np.sort(rng.uniform(200.0, 7000.0, (2, 6)), axis=1)
    levels = rng.uniform(5.0, 20.0, (2, 7)) * (np.arange(7) % 2)
    power = np.column_stack([levels[k][np.searchsorted(edges[k], grid, side="right")] for k in range(2)])
    capacities, links = rng.uniform(80.0, 400.0, 3), rng.uniform(0.4, 2.0, 2)
    rises, seen = np.zeros(3), np.empty((grid.size, 3))
    for k, (first, second) in enumerate(power.tolist()):  # explicit steps of 2 s, below all time constants
        seen[k] = rises
        down, out = links[0] * (rises[0] - rises[1]), links[1] * (rises[1] - rises[2])
        rises = rises + 2.0 * np.array([first - down, down - out, second + out - 0.6 * rises[2]]) / capacities
    late = float(rng.uniform(-150.0, 150.0))
    times, own = np.arange(200.0, 8000.0, 20.0), np.arange(300.0 + late, 8000.0, 20.0)
    readings = {n: np.interp(times, grid, seen[:, n]) + 0.04 * rng.standard_normal(times.size) for n in (0, 2)}
    temperatures = [LogCourse(f"T{n}", False, times - 200.0, values) for n, values in readings.items()]
    rows = np.searchsorted(grid, own, side="right") - 1
    powers = [LogCourse(f"P{k}", True, own - own[0], power[rows, k]) for k in range(2)]
    return temperatures, powers, float(own[0]) - 200.0


def test_two_powers_of_one_log_show_its_offset_together() -> None:
    """Each alone explained too little of a temperature that both heat, so that the offset stayed open."""
    deviations = []
    for seed in range(2):
        temperatures, powers, late = powers_that_act_together(seed)
        if (found := common_step(temperatures, powers)) is not None:
            assert found.second == "P0 + P1"
            deviations.append(abs(found.offset - late) / found.error)
    assert deviations
    assert max(deviations) < 2.0


@pytest.mark.parametrize(("kind", "seed"), [("coarse", 1)])
def test_a_log_of_powers_shows_switches_half_a_reading_late(kind: str, seed: int) -> None:
    """A power in a minute's steps: its switches stand at the next reading."""
    from_here, power, late = power_and_temperatures(seed, kind)
    found = common_step(from_here, [power])
    assert found is not None
    assert abs(found.offset - late) < 2.0 * found.error


@pytest.mark.parametrize(("seeds", "least"), [((0, 4, 6, 8, 19), 2), pytest.param(range(60), 24, marks=pytest.mark.campaign)])
def test_a_power_that_overlaps_a_temperature_by_a_part_has_the_right_offset_or_none(seeds: tuple[int, ...], least: int) -> None:
    """Where nothing shared tells one switch from another, the offset stays open; 8 and 19 had a wrong one."""
    right = 0
    for seed in seeds:
        seen, power, late = halves(seed)
        if (found := common_step([seen], [power])) is not None:
            assert abs(found.offset - late) < 4.0 * found.error, f"case {seed}"
            right += 1
    assert right >= least


def test_one_place_of_each_log_has_no_common_step_where_the_one_follows_the_other() -> None:
    t, rng = np.arange(0.0, 9000.0, 10.0), np.random.default_rng(5)
    near, far = (1.0 - np.exp(-np.clip(t - 1500.0, 0.0, None) / lag) for lag in (600.0, 1300.0))
    first, second = (LogCourse(n, False, t, 295.0 + 20.0 * v + 0.02 * rng.standard_normal(t.size)) for n, v in (("a", near), ("b", far)))
    assert common_step([first], [second]) is None


def test_logs_without_a_common_course_have_no_step() -> None:
    rng, t = np.random.default_rng(0), np.arange(0.0, 3600.0, 10.0)
    a = LogCourse("a", False, t, 295.0 + 0.1 * rng.standard_normal(t.size))
    b = LogCourse("P", True, t, np.where(t > 1000.0, 5.0, 0.0))
    assert common_step([a], [b]) is None
    assert common_step([a], [LogCourse("P", True, t, np.zeros(t.size))]) is None


def test_beside_stamps_two_temperatures_show_no_common_step(tmp_path: Path) -> None:
    """Two places follow a step at different times: one read as the other, shifted, would say that a clock is wrong."""
    for name, lag in (("a", 60.0), ("b", 900.0)):
        rows = [f"2026-03-10 09:{k // 60:02d}:{k % 60:02d},{22 + 9 * (1 - np.exp(-max(k - 600, 0) / lag)):.3f}" for k in range(0, 3600, 20)]
        (tmp_path / f"{name}.csv").write_text("\n".join([f"stamp,T_{name} [degC]", *rows]) + "\n")
    (found,) = clocks_of([look(tmp_path / "a.csv"), look(tmp_path / "b.csv")])
    assert found["offset"] == 0.0
    assert "step" not in found


LAGS = {"case": 2000.0, "plate": 1400.0, "board": 300.0, "coil": 1000.0}


def bench_log(path: Path, names: tuple[str, ...], late: float, clock: str = "", *, length: float = 16000.0, step: float = 20.0) -> Look:
    """Write temperatures that follow a power of two switches, or that power where no names are given, and return what is in the file."""
    own = np.arange(0.0, length, step)
    t, rng = own + late, np.random.default_rng(len(path.stem))
    switches = ((1200.0, 14.0), (6600.0, 8.0), (11400.0, -22.0))
    read = [
        25.0 + sum(p * (1.0 - np.exp(-np.clip(t - s, 0.0, None) / LAGS[n])) for s, p in switches) + 0.03 * rng.standard_normal(t.size)
        for n in names
    ]
    read = read or [np.sum([p * (t >= s) for s, p in switches], axis=0)]
    head = [f"{n} [degC]" for n in names] or ["P [W]"]
    begin = None if not clock else np.datetime64(f"2026-05-14T{clock}")
    times = [f"{k:g}" if begin is None else str(begin + np.timedelta64(round(k), "s")) for k in own]
    rows = [",".join([at, *(f"{v:.2f}" for v in row)]) for at, row in zip(times, np.transpose(read), strict=True)]
    path.write_text("\n".join([",".join(["time [s]" if begin is None else "stamp", *head]), *rows]) + "\n")
    return look(path)


def joined_lines(looks: list[Look], clocks: list[dict[str, Any]]) -> list[dict[str, object]]:
    """Return what the line to copy says."""
    (line,) = [text for text in clock_lines(looks, clocks) if text.startswith("    joined ")]
    return list(tomllib.loads(line.strip())["joined"])


def test_offsets_by_stamps_are_of_two_clocks_and_a_third_log_is_chained_to_the_one_that_it_fits(tmp_path: Path) -> None:
    """The stamps of the first are 200 s ahead. The powers follow the board only: the case and the plate are in the first log alone."""
    first = bench_log(tmp_path / "first.csv", ("case",), 0.0, "08:33:20", length=5000.0)
    second = bench_log(tmp_path / "second.csv", ("board",), 75.0, "08:31:15")
    third = bench_log(tmp_path / "third.csv", (), -40.0, step=5.0)
    found = clocks_of([first, second, third])
    assert found[0]["offset"] == -125.0
    assert "at" not in found[0]
    step = found[1]["step"]
    assert (step["after"], step["columns"]) == ("second.csv", ["board", "P"])
    assert abs(step["offset"] + 115.0) < 3.0 * step["error"]
    assert found[1]["at"]["stamps"]
    assert found[1]["at"]["offset"] == pytest.approx(step["offset"] - 125.0)
    assert found[1]["at"]["error"] > 100.0  # of stamps of two clocks, beside that of the step
    assert [type(j["offset"]) for j in joined_lines([first, second, third], found)] == [str, list]


def test_stamps_tell_more_than_a_step_that_only_a_slow_mass_shows(tmp_path: Path) -> None:
    """An offset of 331 +- 158 s was written for a supply whose stamps were a minute off."""
    first = bench_log(tmp_path / "first.csv", ("case",), 0.0, "08:30:00", length=5000.0)
    supply = bench_log(tmp_path / "supply.csv", (), -40.0, "08:28:50", step=5.0)
    dull = CommonStep(331.0, 158.0, "battery", "P", 0.99)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("thermid.measure._readers.look.common_step", lambda *courses: dull)
        (clock,) = clocks_of([first, supply])
    assert clock["at"]["by_stamps"]


@pytest.mark.parametrize("names", [("second", "supply"), ("supply", "second")])
def test_a_supply_whose_clock_is_off_is_not_what_places_a_thermometer_with_right_stamps(tmp_path: Path, names: tuple[str, ...]) -> None:
    first = bench_log(tmp_path / "first.csv", ("case",), 0.0, "08:30:00", length=5000.0)
    others = {
        "second": bench_log(tmp_path / "second.csv", ("board",), 75.0, "08:31:15"),
        "supply": bench_log(tmp_path / "supply.csv", (), -40.0, "08:28:50", step=5.0),  # 30 s behind
    }
    looks = [first, *(others[n] for n in names)]
    offsets = dict(zip(names, (j["offset"] for j in joined_lines(looks, clocks_of(looks))), strict=True))
    assert offsets["second"] == "75 [s]"
    low, high = (float(str(end).removesuffix(" [s]")) for end in offsets["supply"])
    assert low < -40.0 < high


def test_an_offset_by_stamps_that_a_step_contradicts_is_told_from_the_first_log(tmp_path: Path) -> None:
    """The second log begins 75 s late, its stamps say 675 s; it is placed by way of the supply, which begins 40 s early."""
    looks = [
        bench_log(tmp_path / "first.csv", ("case",), 0.0, "08:30:00"),
        bench_log(tmp_path / "second.csv", ("board",), 75.0, "08:41:15", length=14000.0),
        bench_log(tmp_path / "third.csv", (), -40.0, "08:29:20", step=5.0),
    ]
    found, _ = clocks = clocks_of(looks)
    assert found["step"]["after"] == "third.csv"
    assert found["step"]["contradicted"]
    assert "675 s" in "\n".join(clock_lines(looks, clocks))


def test_two_loggers_of_temperatures_meet_by_way_of_the_supply_that_both_follow(tmp_path: Path) -> None:
    """Both stamp their readings, the first 200 s ahead; the supply has no stamps."""
    looks = [
        bench_log(tmp_path / "first.csv", ("case",), 0.0, "08:33:20"),
        bench_log(tmp_path / "second.csv", ("board",), 75.0, "08:31:15", length=14000.0),
        bench_log(tmp_path / "third.csv", (), -40.0, step=5.0),
    ]
    by_board, by_supply = clocks = clocks_of(looks)
    assert by_board["offset"] == -125.0
    assert by_board["step"]["after"] == "third.csv"
    for found, truth in ((by_board, 75.0), (by_supply, -40.0)):
        assert abs(found["at"]["offset"] - truth) < 2.0 * found["at"]["error"]
        assert found["at"]["error"] < 100.0  # half of what the stamps are wrong by
        assert not found["at"]["stamps"]
    for pair, truth in zip(joined_lines(looks, clocks), (75.0, -40.0), strict=True):
        low, high = (float(str(end).removesuffix(" [s]")) for end in pair["offset"])  # type: ignore[attr-defined]
        assert low < truth < high


def test_an_offset_that_stamps_of_two_clocks_gave_is_a_range_with_their_error(tmp_path: Path) -> None:
    """A supply whose stamps were 41 s ahead, and the board that was chained to it, were stated 41 and 37 s wrong, with no error."""
    case = bench_log(tmp_path / "case.csv", ("case",), 0.0, "08:30:00")
    board = bench_log(tmp_path / "board.csv", ("board",), 34.0, length=14000.0)
    powers = tmp_path / "supply.csv"
    supply = bench_log(powers, (), 5.0, "08:30:46", step=5.0)
    steps = {("case", "board"): None, ("case", "P"): None, ("board", "P"): CommonStep(-25.5, 28.0, "board", "P", 0.99)}
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("thermid.measure._readers.look.common_step", lambda a, b: steps[a[0].name, b[0].name])
        looks = [case, board, supply]
        (by_board, by_supply), lines = (clocks := clocks_of(looks)), joined_lines(looks, clocks)
        steps |= {(b, a): f and CommonStep(-f.offset, f.error, f.second, f.first, f.explained) for (a, b), f in steps.items()}
        turned = joined_lines([board, supply, case], clocks_of([board, supply, case]))
    assert by_board["at"]["error"] == pytest.approx(np.hypot(28.0, by_supply["at"]["error"]))
    # whichever log comes first, every clock has a range, and the truth is in it
    for pair, truth in zip((*lines, *turned), (34.0, 5.0, -29.0, -34.0), strict=True):
        low, high = (float(str(end).removesuffix(" [s]")) for end in pair["offset"])  # type: ignore[attr-defined]
        assert low < truth < high


def test_ranges_of_several_clocks_are_proposed_and_a_name_that_both_have_is_another_in_one(tmp_path: Path) -> None:
    board = bench_log(tmp_path / "board.csv", ("board",), 0.0)
    powers = [bench_log(tmp_path / f"{name}.csv", (), late, step=5.0) for name, late in (("ab", 60.0), ("abc", 90.0))]
    clocks = clocks_of([board, *powers])
    offsets = [j["offset"] for j in joined_lines([board, *powers], clocks)]
    assert [type(o) for o in offsets] == [list, list]
    assert [list(look.again) for look in named_apart([board, *powers])] == [
        [],
        [],
        [c.name for c in powers[0].columns if c.guess == "power"],
    ]


def test_a_clock_by_two_places_is_a_candidate_in_the_line_to_copy(tmp_path: Path) -> None:
    looks = [
        bench_log(tmp_path / "first.csv", ("case", "plate"), 0.0),
        bench_log(tmp_path / "second.csv", ("board", "coil"), 300.0, length=14000.0),
    ]
    (found,) = clocks_of(looks)
    assert found["step"]["candidate"]
    assert abs(found["step"]["offset"] - 300.0) < 2.0 * found["step"]["error"]
    assert "second.csv" in "\n".join(clock_lines(looks, [found]))
    (pair,) = joined_lines(looks, [found])
    assert pair["offset"] == "... [s]"


def test_a_log_that_is_placed_by_a_candidate_is_no_better_known() -> None:
    sure, guessed = CommonStep(5.0, 1.0, "a", "b", 0.99), CommonStep(5.0, 1.0, "a", "b", 0.99, candidate=True)
    for before, step in ((_OffsetSoFar(0.0), sure), (_OffsetSoFar(0.0, candidate=True), sure), (_OffsetSoFar(0.0), guessed)):
        assert _Way(before, 1, 2, step, None, False).place.candidate == (before.candidate or step.candidate)


def test_stamps_that_a_step_contradicts_give_no_offset_to_a_log_without_any() -> None:
    """A third log was placed beside a second one, of which nothing says when it began beside the first: this was a KeyError."""
    step = {"offset": -1.5, "error": 1.0, "columns": ("load", "power"), "after": "cpu.csv", "candidate": False, "contradicted": True}
    clock = {"file": "usb.csv", "record": "usb", "offset": None, "step": {**step, "stamps": -7.0}}
    text, check = _by_step(clock, None, None)
    assert re.search(r" 1\.5 s .*cpu\.csv", text)
    assert "write" not in check
    assert "line below" not in check
