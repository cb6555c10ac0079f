"""Weather files: what they say, what of it is a hole, what cannot be."""

from __future__ import annotations

import gzip
import re
from pathlib import Path

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import MissingDataError, NameNotFoundError, RecordError, UnitError

from .weather_cases import DRY, SUN, epw, table, tmy3


@pytest.mark.parametrize("write", [epw, tmy3])
def test_epw_and_tmy3_say_the_same(tmp_path: Path, write) -> None:  # type: ignore[no-untyped-def]
    pytest.importorskip("pvlib")
    weather = td.site.read_weather(write(tmp_path / ("w.epw" if write is epw else "w.csv")))
    assert weather["dry_bulb"].values == pytest.approx(DRY + 273.15, abs=6e-3)
    assert weather["dry_bulb"].times[:2] == pytest.approx([0.0, 3600.0])
    assert weather.begin is not None
    assert (weather.begin.hour, weather.begin.minute) == (1, 0)  # values belong to the end of their hour
    assert weather["global"].times[0] == -1800.0  # radiation is the mean of its hour
    assert weather["global"].values == pytest.approx(SUN, abs=0.51)
    assert weather["pressure"].values == pytest.approx(np.full(48, 100900.0))
    assert weather["humidity"].values == pytest.approx(np.full(48, 0.75))
    assert dict(weather.place) == {"latitude": -2.37, "longitude": -44.4, "altitude": 40.0, "timezone": -3.0}


def test_an_epw_file_is_a_scenario_by_itself(tmp_path: Path) -> None:
    """It says where it is; the sun's noon and the warmest hour of the file are where its clock has them."""
    pytest.importorskip("pvlib")
    face = {
        "of": "n",
        "to": "ambient",
        "area": "1 [m^2]",
        "htc": "8 [W/(m^2 K)]",
        "emissivity": 0.9,
        "absorptance": 0.5,
        "facing": {"tilt": 0},
    }
    roof = td.model_from_dict(
        {"title": "roof", "needs": ["ambient"], "nodes": {"n": {"capacitance": "5 [kJ/K]"}}, "surfaces": {"face": face}}
    )
    run = td.simulate(roof, td.site.pad_scenario(weather=td.site.read_weather(epw(tmp_path / "w.epw"))), every="5 [min]")
    sun = run.load_powers["face.sun"]
    noon = 1.0 + run.times[: 24 * 12][sun[: 24 * 12].argmax()] / 3600.0
    assert noon == pytest.approx(12.0, abs=0.6)
    assert run.heat_balance().relative < 1e-6


def test_months_of_several_years_become_one_and_it_is_said(tmp_path: Path) -> None:
    pytest.importorskip("pvlib")
    weather = td.site.read_weather(epw(tmp_path / "w.epw", years=(2004, 1999)), year=2026)
    assert weather.begin is not None
    assert weather.begin.year == 2026
    assert any("2026" in words for words in weather.notes)
    assert weather.duration == 46.5 * 3600.0  # radiation ends in the middle of the last hour


@pytest.mark.parametrize(("write", "name"), [(epw, "w.epw"), (tmy3, "w.csv"), (table, "t.csv")])
def test_a_hole_is_refused_or_bridged_and_marked(tmp_path: Path, write, name) -> None:  # type: ignore[no-untyped-def]
    if write is not table:
        pytest.importorskip("pvlib")
    path = write(tmp_path / name, missing=(10, 11, 12))
    with raises_code("record.time-unclear", RecordError, match="dry_bulb.*4.*max_gap"):
        td.site.read_weather(path)
    with raises_code("record.time-unclear", RecordError, match="max_gap"):
        td.site.read_weather(path, max_gap="3 [h]")
    filled = td.site.read_weather(path, max_gap="4 [h]")
    assert len(filled.filled) == 1
    assert re.search(r"filled: dry_bulb .* 4 h .*\d:00.*\d:00", str(filled))
    at = filled["dry_bulb"]
    assert np.diff(at.times).max() == 4 * 3600.0
    assert filled["wind"].times.size > at.times.size


def test_a_line_that_is_left_out_is_a_hole(tmp_path: Path) -> None:
    pytest.importorskip("pvlib")
    with raises_code("record.time-unclear", RecordError, match="dry_bulb.*3.*2026-01-01"):
        td.site.read_weather(epw(tmp_path / "w.epw", skip=(20, 21)))


def test_a_hole_at_an_end_cannot_be_bridged(tmp_path: Path) -> None:
    with raises_code("record.time-unclear", RecordError):
        td.site.read_weather(table(tmp_path / "t.csv", missing=(47, 48)), max_gap="9 [h]")


def test_humidity_above_100_is_refused_with_its_time(tmp_path: Path) -> None:
    with raises_code("value.outside-range", RecordError, match="104.*2026-03-21.*20:00.*0"):
        td.site.read_weather(table(tmp_path / "t.csv", humidity=104.0))


def test_a_table_by_its_own_names_and_units(tmp_path: Path) -> None:
    path = tmp_path / "station.csv"
    path.write_text("t [h];T_OUT [degF];RH;v [km/h]\n0;77,0;80;36,0\n1;86,0;70;18,0\n", encoding="utf-8")
    weather = td.site.read_weather(path, {"dry_bulb": "T_OUT", "humidity": "RH", "wind": "v"}, begin="2026-03-21 06:00-03:00", time="t")
    assert weather["dry_bulb"].values == pytest.approx([298.15, 303.15])
    assert weather["humidity"].values == pytest.approx([0.8, 0.7])
    assert weather["wind"].values == pytest.approx([10.0, 5.0])
    assert weather.begin is not None
    assert weather.begin.utcoffset().total_seconds() == -3 * 3600.0  # type: ignore[union-attr]


def test_packed_tables_and_night_readings(tmp_path: Path) -> None:
    path = tmp_path / "w.csv.gz"
    with gzip.open(path, "wt") as file:
        file.write("time_s,global [W/m^2],dry_bulb [K]\n0,-3.2,300\n600,0,300\n1200,5,300\n")
    assert td.site.read_weather(path)["global"].values.min() == 0.0


def test_a_window_starts_at_zero_and_stays_inside(tmp_path: Path) -> None:
    weather = td.site.read_weather(table(tmp_path / "t.csv"))
    part = weather.window("03-21 06:30", "2 [h]")
    assert part["dry_bulb"].times == pytest.approx([0.0, 1800.0, 5400.0, 7200.0])
    assert part.begin is not None
    assert part.begin.hour == 6
    same = weather.window("2026-03-21 09:30+00:00", "2 [h]")
    assert same["dry_bulb"].values == pytest.approx(part["dry_bulb"].values)
    for begin, length in (("2026-03-20 23:00", "2 [h]"), ("2026-03-22 20:00", "9 [h]")):
        with raises_code("record.not-overlapping", RecordError, match="2026-03-21.*00:00.*2026-03-23.*00:00"):
            weather.window(begin, length)
    with raises_code("value.wrong-kind", RecordError, match="'tomorrow'"):
        weather.window("tomorrow", "2 [h]")


@pytest.mark.parametrize(
    ("text", "code", "match", "error"),
    [
        ("time,dry_bulb\n0,20\n0,21\n", "record.time-order", r"bad\.csv:3.*'time'", RecordError),
        ("time,dry_bulb [W]\n0,20\n60,21\n", "unit.wrong-dimension", r"bad\.csv.*'dry_bulb'.*'\[W\]'", UnitError),
        ("time,dry_bulb\n0,20\n60,warm\n", "record.not-a-number", "'warm'", RecordError),
        ("time,dry_bulb [K]\n0,20\n60,21\n", "value.outside-range", "dry_bulb.*-253", RecordError),
        ("time,temperature\n0,20\n60,21\n", "record.layout-unclear", r"bad\.csv.*dry_bulb.*dew_point", RecordError),
        ("hour,dry_bulb\n0,20\n60,21\n", "record.time-unclear", r"bad\.csv.*dry_bulb", RecordError),
    ],
)
def test_bad_tables_are_refused(tmp_path: Path, text: str, code: str, match: str, error: type[Exception]) -> None:
    path = tmp_path / "bad.csv"
    path.write_text(text, encoding="utf-8")
    with raises_code(code, error, match=match):
        td.site.read_weather(path)


def test_a_missing_file_and_a_wrong_name_are_said(tmp_path: Path) -> None:
    with raises_code("record.log-missing", MissingDataError, match=r"'w\.epw'"):
        td.site.read_weather(tmp_path / "w.epw")
    path = table(tmp_path / "t.csv")
    with raises_code("name.unknown", NameNotFoundError, match="'dry_blub'.*'dry_bulb'"):
        td.site.read_weather(path, {"dry_blub": "dry_bulb"})
    with raises_code("name.unknown", NameNotFoundError, match="'T'"):
        td.site.read_weather(path, {"dry_bulb": "T"})
    with pytest.raises(NameNotFoundError, match=r"no 'winds'\."):
        td.site.read_weather(path)["winds"]


def test_text_that_is_no_weather_file_is_refused(tmp_path: Path) -> None:
    pytest.importorskip("pvlib")
    path = tmp_path / "w.epw"
    path.write_text("LOCATION,nowhere\n", encoding="ascii")
    with raises_code("file.another-kind", RecordError):
        td.site.read_weather(path)
