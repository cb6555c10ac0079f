"""Columns of logs in a scenario file: one clock for all of them, one unit where none is written, and mistakes that are named."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.fit.calibration import Experiment
from thermid.model.tree import TableSignal

LOG = """time_s,room,wall [degC],h,k [W/(m^2 K)],heat,drive,p,w,sun
1000,20,21,5,3,4,50,101325,0,0
1060,20,21,5,3,4,50,101325,0,0
1120,30,31,6,4,5,100,50000,2,300
1180,30,31,6,4,5,100,50000,2,300
"""
BEGUN = [0.0, 60.0, 120.0, 180.0]


def made(folder: Path, text: str, log: str = LOG) -> td.Scenario:
    (folder / "log.csv").write_text(log, encoding="ascii")
    (folder / "run.toml").write_text(text, encoding="utf-8")
    return td.load_scenario(folder / "run.toml")


def column(name: str, **more: str) -> str:
    return "{ file = 'log.csv', column = '" + name + "'" + "".join(f", {k} = '{v}'" for k, v in more.items()) + " }"


def test_every_table_counts_from_the_first_sample_of_the_log(tmp_path: Path) -> None:
    """A boundary kept the log's own clock and a pressure counted from its first sample: they were 1000 s apart in one run."""
    found = made(
        tmp_path,
        f"""
start = "air"
duration = "3 [min]"
boundaries = {{ air = {column("room")} }}
loads = {{ heater = {column("heat")} }}
commands = {{ heater = {column("drive")} }}
prescribed = {{ plate = {column("wall")} }}
schedule = {{ "skin.htc" = {column("k")} }}
environment = {{ air = {{ pressure = {column("p")}, wind = {column("w")} }} }}
irradiation = {{ face = {{ total = {column("sun")}, sky = {column("room")}, sky_view = 0.5 }} }}
""",
    )
    face: Any = found.irradiation["face"]
    signals = {
        "room": (found.boundaries["air"], 273.15 + np.array([20, 20, 30, 30])),
        "heat": (found.loads["heater"], [4, 4, 5, 5]),
        "drive": (found.commands["heater"], [0.5, 0.5, 1.0, 1.0]),
        "wall": (found.prescribed["plate"], 273.15 + np.array([21, 21, 31, 31])),
        "k": (found.schedule["skin.htc"], [3, 3, 4, 4]),
        "p": (found.environment["air"].pressure, [101325, 101325, 50000, 50000]),
        "w": (found.environment["air"].wind, [0, 0, 2, 2]),
        "sun": (face.total, [0, 0, 300, 300]),
        "sky": (face.sky, 273.15 + np.array([20, 20, 30, 30])),
    }
    for name, (signal, values) in signals.items():
        assert isinstance(signal, TableSignal), name
        assert signal.times == pytest.approx(BEGUN), name
        assert signal.values == pytest.approx(values), name
        assert signal.hold is (name == "drive")


def test_a_column_beside_a_trajectory_counts_from_lift_off(tmp_path: Path) -> None:
    flight = "time,altitude [km],inner [degC]\n-60,0,20\n0,0,20\n60,5,25\n120,60,30\n"
    text = f"""
start = "20 [degC]"
duration = "2 [min]"
[ascent]
file = "log.csv"
air = "gas"
air_temperature = "20 [degC]"
walls = {{ wall = {column("inner")} }}
"""
    assert made(tmp_path, text, flight).boundaries["wall"].at(np.array([60.0])) == pytest.approx(298.15)


@pytest.mark.parametrize(
    ("text", "code", "match"),
    [
        (f'schedule = {{ "skin.htc" = {column("h")} }}', "record.unit-unclear", "'h'"),
        (f"boundaries = {{ air = {column('k')} }}", "unit.wrong-dimension", "2"),
        (f"environment = {{ air = {{ pressure = {column('wall')} }} }}", "unit.wrong-dimension", r"\[Pa\]"),
        (f"environment = {{ air = {{ pressure = {column('p', unit='m/s')} }} }}", "unit.wrong-dimension", r"\[Pa\]"),
        (f"boundaries = {{ air = {column('rom')} }}", "name.unknown", "'rom'.*'room'"),
        ("boundaries = { air = { file = 'log.csv' } }", "file.key-missing", r"boundaries\.air\.column"),
    ],
)
def test_a_unit_that_is_missing_or_wrong_is_refused(tmp_path: Path, text: str, code: str, match: str) -> None:
    with raises_code(code, match=match) as caught:
        made(tmp_path, f'duration = "1 [min]"\n{text}\n')
    assert "run.toml" in str(caught.value)


def test_a_scheduled_column_has_the_dimension_of_its_parameter(tmp_path: Path) -> None:
    """The model alone knows it: a coefficient in degC was taken as 278 W/(m^2 K)."""
    deck = {
        "title": "plate",
        "needs": ["air"],
        "nodes": {"plate": {"capacitance": "100 [J/K]"}},
        "surfaces": {"skin": {"of": "plate", "to": "air", "area": "0.1 [m^2]", "effective_htc": "5 [W/(m^2 K)]"}},
    }
    scenario = made(
        tmp_path, f'start = "air"\nduration = "1 [min]"\nboundaries.air = "20 [degC]"\nschedule."skin.effective_htc" = {column("wall")}\n'
    )
    with raises_code("unit.wrong-dimension"):
        td.simulate(td.model_from_dict(deck), scenario)


def test_columns_of_a_weather_that_begins_later_are_refused(tmp_path: Path) -> None:
    text = f"""
duration = "1 [min]"
boundaries = {{ air = {column("room")} }}
[weather]
file = "log.csv"
begin = "2026-03-21 06:00"
"""
    with raises_code("record.time-unclear"):
        made(tmp_path, text)


def test_a_column_of_the_records_own_log_stays_beside_its_readings(tmp_path: Path) -> None:
    """A record whose first minute was cut off begins there, and so do the columns of its log that a scenario holds."""
    deck = {
        "title": "plate",
        "needs": ["air"],
        "nodes": {"plate": {"capacitance": "100 [J/K]"}},
        "surfaces": {"skin": {"of": "plate", "to": "air", "area": "0.1 [m^2]", "htc": {"value": "5 [W/(m^2 K)]", "min": 1, "max": 20}}},
    }
    text = f"""
[environment]
air = {{ pressure = {column("p")} }}
[boundaries]
air = {column("room")}
"""
    scenario = made(tmp_path, text)
    record = td.read_record(tmp_path / "log.csv", {"wall": {"node": "plate"}})
    model = td.model_from_dict(deck)
    for cut, first in ((record, 101325.0), (record.trim("1120 [s]"), 50000.0)):
        met = Experiment.bind(model, cut, scenario).scenario
        assert met.environment["air"].pressure.at(np.zeros(1))[0] == first
        assert met.boundaries["air"].at(np.zeros(1))[0] == pytest.approx(293.15 if cut is record else 303.15)
    with raises_code("record.does-not-apply", match=r"'log\.csv'"):
        Experiment.bind(model, record.shift_start(), scenario)
    other = made(tmp_path, text, LOG.replace("101325", "101000"))  # another log counts from its own first sample
    assert Experiment.bind(model, record.trim("1120 [s]"), other).scenario.environment["air"].pressure.at(np.zeros(1))[0] == 101000.0
