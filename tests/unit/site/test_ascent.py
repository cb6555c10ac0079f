"""Ascents: pressure of a trajectory, walls that go, streams of molecules, files, real flights, refusals."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import RecordError, ScenarioError
from thermid.site._atmosphere import standard_atmosphere

FLIGHTS = Path(__file__).parents[4] / "shared" / "data" / "rocket_avionics_rocketpy"
TIMES = np.array([0.0, 30.0, 60.0, 90.0, 120.0, 150.0, 180.0, 240.0])
LAUNCH = td.site.Trajectory(
    TIMES,
    1e3 * np.array([0.0, 4.0, 18.0, 40.0, 65.0, 92.0, 115.0, 150.0]),
    np.array([0.0, 300.0, 800.0, 1600.0, 2500.0, 3100.0, 3500.0, 4300.0]),
)


def panel() -> td.Model:
    """A plate of 0.2 m^2 that looks along the flight, in gas and before a wall."""
    face = {"of": "panel", "to": "gas", "area": "0.2 [m^2]", "htc": {"length": "0.4 [m]"}, "emissivity": 0.8, "radiates_to": "wall"}
    deck = {"title": "panel", "needs": ["gas", "wall"], "nodes": {"panel": {"capacitance": "900 [J/K]"}}, "surfaces": {"face": face}}
    return td.model_from_dict(deck)


def launch(**more: Any) -> td.Scenario:
    made: dict[str, Any] = {"air": "gas", "air_temperature": "20 [degC]", "walls": {"wall": "20 [degC]"}, "upper": "standard"}
    return td.site.ascent_scenario(LAUNCH, **(made | more))


def test_pressure_follows_altitude() -> None:
    pressure = launch().environment["gas"].pressure
    assert pressure.at(np.array([0.0, 30.0, 60.0])) == pytest.approx([101325.0, 61640.0, 7565.2], rel=1e-3)
    assert pressure.at(np.array([180.0]))[0] == pytest.approx(4.0096e-3, rel=1e-6)


def test_above_86_km_somebody_must_say_what_the_air_is() -> None:
    with raises_code("physics.not-possible", ScenarioError, match="86.*150"):
        launch(upper="")
    day = td.site.Trajectory(LAUNCH.times, LAUNCH.altitude, LAUNCH.speed, np.full(8, 5.0), np.full(8, 1e-7))
    made = td.site.ascent_scenario(day, air="gas", air_temperature="20 [degC]", flow={"face": 1.0}, separation="170 [s]")
    assert made.irradiation["face"].stream.at(np.array([240.0]))[0] == pytest.approx(0.5e-7 * 4300.0**3)
    with raises_code("physics.not-possible", ScenarioError, match="200.*400"):
        td.site.Trajectory(np.array([0.0, 9.0]), np.array([0.0, 4e5])).air(np.array([9.0]), "standard")
    with raises_code("value.wrong-kind", ScenarioError, match="'standard'"):
        launch(upper="msis")


def test_molecules_heat_what_looks_ahead_once_the_fairing_is_gone() -> None:
    """By hand at 180 s: 0.2 m^2 * 0.5 * 0.5 * 4.289e-8 * 3500^3 = 91.9 W at a cosine of one half."""
    run = td.simulate(panel(), launch(separation="170 [s]", flow={"face": 0.5}), times=[0.0, 160.0, 169.9, 180.0])
    heat = run.load_powers["face.stream"]
    assert heat[:3] == pytest.approx([0.0, 0.0, 0.0])
    assert heat[3] == pytest.approx(0.2 * 0.5 * 0.5 * 4.289e-8 * 3500.0**3, rel=1e-6)


def test_a_wall_radiates_until_it_goes() -> None:
    hot = {"times": ["0 [s]", "60 [s]", "170 [s]"], "values": ["20 [degC]", "90 [degC]", "80 [degC]"]}
    run = td.simulate(panel(), launch(walls={"wall": hot}, separation="170 [s]"), every="5 [s]")
    assert run["wall"].at(60.0) == pytest.approx(90.0)
    assert run["wall"].at(175.0) == pytest.approx(2.725 - 273.15)
    assert run.heat_flow("face.radiation")[30] < 0.0 < run.heat_flow("face.radiation")[-1]
    # convection of thin air is gone at the end, whatever the temperatures
    assert abs(run.heat_flow("face")[-1]) < 1e-3 * abs(run.heat_flow("face.radiation")[-1])


def test_heat_of_an_ascent_balances() -> None:
    run = td.simulate(panel(), launch(separation="170 [s]", flow={"face": 1.0}))
    assert run.heat_balance().relative < 1e-6


def test_a_curve_in_place_of_a_trajectory() -> None:
    curve = {"times": ["0 [s]", "40 [s]"], "values": ["101 [kPa]", "0 [Pa]"]}
    made = td.site.ascent_scenario(pressure=curve, air_temperature="20 [degC]", duration="60 [s]")
    assert made.environment["ambient"].pressure.at(np.array([20.0]))[0] == pytest.approx(50500.0)


def test_a_file_says_the_same(tmp_path: Path) -> None:
    rows = [f"{t:g},{z / 1e3:g},{v:g}" for t, z, v in zip(LAUNCH.times, LAUNCH.altitude, LAUNCH.speed, strict=True)]  # type: ignore[arg-type]
    (tmp_path / "flight.csv").write_text("time,altitude [km],speed\n" + "\n".join(rows) + "\n", encoding="ascii")
    (tmp_path / "wall.csv").write_text("time_s,inner [degC]\n0,20\n240,20\n", encoding="ascii")
    (tmp_path / "ascent.toml").write_text(
        """
start = "20 [degC]"
[ascent]
file = "flight.csv"
air = "gas"
air_temperature = "20 [degC]"
walls = { wall = { file = "wall.csv", column = "inner" } }
separation = "170 [s]"
flow = { face = 1.0 }
upper = "standard"
""",
        encoding="utf-8",
    )
    by_hand = launch(separation="170 [s]", flow={"face": 1.0}, start="20 [degC]")
    one, other = (td.simulate(panel(), s)["panel"].kelvin for s in (td.load_scenario(tmp_path / "ascent.toml"), by_hand))
    assert np.abs(one - other).max() < 1e-6
    both = (tmp_path / "ascent.toml").read_text(encoding="utf-8") + "[site]\nlatitude = 0\nlongitude = 0\n"
    (tmp_path / "both.toml").write_text(both, encoding="utf-8")
    with raises_code("value.excludes-another", ScenarioError):
        td.load_scenario(tmp_path / "both.toml")


@pytest.mark.parametrize(
    ("more", "code", "match"),
    [
        ({"separation": "300 [s]"}, "value.outside-range", "240"),
        ({"air_temperature": None}, "value.incomplete", "'gas'"),
        ({"flow": {"face": 1.0}}, "value.incomplete", ""),
        ({"flow": {"face": 1.0}, "separation": "120 [s]"}, "physics.not-possible", "65"),
        ({"flow": {"face": 1.2}, "separation": "170 [s]"}, "value.outside-range", r"'face'.*1\.2"),
        ({"flow": {"face": 1.0}, "separation": "170 [s]", "accommodation": 1.5}, "value.outside-range", r"1\.5"),
    ],
)
def test_what_an_ascent_lacks_is_said(more: dict[str, Any], code: str, match: str) -> None:
    with raises_code(code, ScenarioError, match=match):
        launch(**more)


def test_what_a_trajectory_lacks_is_said(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    for text, code, match in (
        ("time,height\n0,0\n1,5\n", "record.layout-unclear", "altitude = .* time, height"),
        ("time,altitude\n0,0\n1,\n", "record.not-a-number", ":3, "),
        ("time,altitude [km]\n0,0\n0,5\n", "record.time-order", ":3, "),
    ):
        path.write_text(text, encoding="ascii")
        with raises_code(code, RecordError, match=match):
            td.site.read_trajectory(path)
    with raises_code("value.outside-range", ScenarioError, match="-5"):
        td.site.Trajectory(np.array([0.0, 1.0]), np.array([0.0, 5.0]), np.array([0.0, -5.0]))
    with raises_code("value.incomplete", ScenarioError):
        td.site.ascent_scenario(air_temperature="20 [degC]", duration="60 [s]")
    with raises_code("value.incomplete", ScenarioError, match=r"'10 \[min\]'"):
        td.site.ascent_scenario(pressure="1 [Pa]", air_temperature="20 [degC]")


@pytest.mark.parametrize("name", ["prometheus_telemega.csv.gz", "prometheus_telemetrum.csv.gz"])
def test_pressure_by_altitude_is_that_of_a_real_flight(name: str) -> None:
    """The altimeter derives height from pressure by the standard atmosphere too: what is shown is that the two laws agree over 3.9 km."""
    path = FLIGHTS / name
    if not path.exists():
        pytest.skip(f"{name} is not beside the repository")
    times, height, measured = _flight(path)
    ground = _altitude(float(np.median(measured[times < 0.2])))
    flight = td.site.Trajectory(times, ground + height)
    assert height.max() > 3800.0
    assert np.abs(flight.air(times)[0] / measured - 1.0).max() < 5e-4


@pytest.mark.parametrize("name", ["prometheus_telemega.csv.gz", "hedy_cats_baro.csv.gz"])
def test_a_measured_pressure_is_an_ascent_too(name: str) -> None:
    """A box in the bay of a real flight, vented to it: its pressure lags that of the bay."""
    path = FLIGHTS / name
    if not path.exists():
        pytest.skip(f"{name} is not beside the repository")
    table = read_plain_pressure(path)
    made = td.site.ascent_scenario(
        pressure=table, air="gas", air_temperature="30 [degC]", duration="60 [s]", boundaries={"wall": "30 [degC]"}
    )
    run = td.simulate(panel(), made.with_(start="30 [degC]"))
    assert run.status == "ok"
    # an unpowered plate at the temperature of gas and wall stays there, whatever the pressure does
    assert np.abs(run["panel"].celsius - 30.0).max() < 1e-6
    fastest = td.site.ascent_checks(made, "gas")[0]
    assert 1000.0 < fastest.value < 6000.0


def _flight(path: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time, height and pressure of a log whose stamps repeat."""
    raw = np.genfromtxt(path, delimiter=",", names=True)
    _, first = np.unique(raw["time_s"], return_index=True)
    return raw["time_s"][first], raw["height_m"][first], raw["pressure_Pa"][first]


def read_plain_pressure(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """The pressure of a log as a table from lift-off."""
    raw = np.genfromtxt(path, delimiter=",", names=True, dtype=None, encoding="utf-8")
    keep = raw["time_s"] >= 0.0
    times, first = np.unique(raw["time_s"][keep], return_index=True)
    return times, raw["pressure_Pa"][keep][first].astype(float)


def _altitude(pascals: float) -> float:
    """Altitude of a pressure, by bisection."""
    low, high = -1000.0, 20000.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if float(standard_atmosphere(middle).pressure) > pascals else (low, middle)
    return low
