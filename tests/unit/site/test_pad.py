"""A time on the pad: the sun by published figures, weather as a scenario, wind and rain as coefficients, files."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import of_code, raises_code
from thermid.base.errors import DeckError, RecordError, ScenarioError
from thermid.base.units import STEFAN_BOLTZMANN
from thermid.site.pad import wind_htc

pytest.importorskip("pvlib")

SITE = td.site.Site(-2.373, -44.396, "40 [m]", -3.0, "equator")
WEATHER = """time,dry_bulb [degC],humidity [%],wind [m/s],direct_normal [W/m^2],diffuse [W/m^2],infrared [W/m^2],rain [mm/h]
2026-03-21 06:00,25,85,0,0,0,400,0
2026-03-21 09:00,28,75,3,600,120,405,0
2026-03-21 12:00,31,65,6,800,150,410,0
2026-03-21 15:00,30,70,6,600,100,410,20
2026-03-21 18:00,28,80,4,0,0,405,0
2026-03-21 21:00,27,82,2,0,0,402,0
2026-03-22 00:00,26,84,1,0,0,401,0
2026-03-22 03:00,25,85,0,0,0,400,0
2026-03-22 06:00,25,85,0,0,0,400,0
"""


def skin(**surface: Any) -> td.Model:
    face = {"of": "skin", "to": "ambient", "area": "2 [m^2]", "htc": "5 [W/(m^2 K)]", "emissivity": 0.9, "absorptance": 0.3}
    face |= {"facing": {"tilt": 90}} | surface
    face = {k: v for k, v in face.items() if v is not None}
    return td.model_from_dict(
        {"title": "skin", "needs": ["ambient"], "nodes": {"skin": {"capacitance": "9 [kJ/K]"}}, "surfaces": {"face": face}}
    )


@pytest.fixture
def weather(tmp_path: Path) -> td.site.Weather:
    path = tmp_path / "weather.csv"
    path.write_text(WEATHER, encoding="ascii")
    return td.site.read_weather(path)


def test_the_sun_of_a_published_example() -> None:
    """Reda and Andreas, Solar Energy 76 (2004) 577, worked example: Golden, 17 October 2003, 12:30:30: 50.11162 and 194.34024 degrees."""
    golden = td.site.Site(39.742476, -105.1786, 1830.14, -7.0)
    sun = golden.sun("2003-10-17 12:30:30", 0.0)
    assert float(sun.zenith[0]) == pytest.approx(50.11162, abs=1e-3)
    assert float(sun.azimuth[0]) == pytest.approx(194.34024, abs=1e-3)


def test_the_sun_of_the_solstices_by_hand() -> None:
    """At noon of the sun the zenith is latitude less declination, 23.44 degrees north on 21 June and south on 21 December."""
    for date, declination in (("2026-06-21", 23.44), ("2026-12-21", -23.44)):
        sun = SITE.sun(f"{date} 00:00", np.arange(0.0, 86400.0, 60.0))
        assert sun.zenith.min() == pytest.approx(abs(-2.373 - declination), abs=0.02)


def test_a_clear_sky_gives_less_than_the_sun_and_more_than_nothing() -> None:
    clear = SITE.clear_sky("2026-03-21 12:00", 0.0, turbidity=3.0)
    assert 850.0 < clear["direct_normal"][0] < 1000.0
    up = np.cos(np.radians(SITE.sun("2026-03-21 12:00", 0.0).zenith[0]))
    assert clear["global"][0] == pytest.approx(clear["direct_normal"][0] * up + clear["diffuse"][0], rel=1e-3)


def test_a_roof_at_noon_by_hand(weather: td.site.Weather) -> None:
    """At 12:00 the sun stands 3 degrees from the zenith: 0.3 * 2 m^2 * (800 cos + 150); the sky sends 410 less sigma T_air^4."""
    made = td.site.pad_scenario(SITE, weather, duration="12 [h]")
    run = td.simulate(skin(facing={"tilt": 0}), made, times=[6 * 3600.0])
    up = np.cos(np.radians(SITE.sun("2026-03-21 12:00", 0.0).zenith[0]))
    assert run.load_powers["face.sun"][0] == pytest.approx(0.3 * 2.0 * (800.0 * up + 150.0), rel=1e-4)
    assert run.load_powers["face.longwave"][0] == pytest.approx(0.9 * 2.0 * (410.0 - STEFAN_BOLTZMANN * 304.15**4), rel=1e-6)


def test_the_air_follows_the_weather_and_heat_balances(weather: td.site.Weather) -> None:
    run = td.simulate(skin(), td.site.pad_scenario(SITE, weather))
    assert run["ambient"].at(6 * 3600.0) == pytest.approx(31.0, abs=1e-6)
    assert run.heat_balance().relative < 1e-6
    # a skin all around, white: warmer than the air by day, colder at night
    assert run["skin"].at(6 * 3600.0) > run["ambient"].at(6 * 3600.0) + 1.0
    assert run["skin"].at(20 * 3600.0) < run["ambient"].at(20 * 3600.0) - 1.0


def test_a_wall_to_the_west_is_warmest_in_the_afternoon(weather: td.site.Weather) -> None:
    west = td.simulate(skin(facing={"tilt": 90, "azimuth": 270}), td.site.pad_scenario(SITE, weather, duration="12 [h]"))
    east = td.simulate(skin(facing={"tilt": 90, "azimuth": 90}), td.site.pad_scenario(SITE, weather, duration="12 [h]"))
    assert west.times[west["skin"].celsius.argmax()] > east.times[east["skin"].celsius.argmax()] + 3 * 3600.0


def test_without_weather_the_sky_is_clear_and_the_air_is_given() -> None:
    clear = td.site.pad_scenario(SITE, begin="2026-03-21 06:00", duration="6 [h]", air_temperature="30 [degC]", sky=False)
    run = td.simulate(skin(), clear)
    assert run["ambient"].final == pytest.approx(30.0)
    assert run["skin"].highest > 32.0
    assert set(run.load_powers) == {"face.sun"}


def test_a_sky_that_begins_later_follows_the_same_weather(weather: td.site.Weather) -> None:
    """At 12:00, six hours on, the weather's 800 and 150 W/m^2: a clear sky would give another sun."""
    made = td.site.pad_scenario(SITE, weather, duration="12 [h]")
    late = made.begun(6 * 3600.0)
    run = td.simulate(skin(facing={"tilt": 0}), late, times=[0.0])
    up = np.cos(np.radians(SITE.sun("2026-03-21 12:00", 0.0).zenith[0]))
    assert run.load_powers["face.sun"][0] == pytest.approx(0.3 * 2.0 * (800.0 * up + 150.0), rel=1e-3)


def test_a_boundary_may_be_the_sky(weather: td.site.Weather) -> None:
    deck = {"title": "skin", "needs": ["ambient", "above"], "nodes": {"skin": {"capacitance": "9 [kJ/K]"}}}
    face = {"of": "skin", "to": "ambient", "area": "2 [m^2]", "htc": "5 [W/(m^2 K)]", "emissivity": 0.9, "radiates_to": "above"}
    roof = td.model_from_dict(deck | {"surfaces": {"face": face | {"absorptance": 0.3, "facing": {"tilt": 0}}}})
    apart = td.simulate(roof, td.site.pad_scenario(SITE, weather, sky={"above": 0}, start="25 [degC]"))
    joined = td.simulate(skin(facing={"tilt": 0}), td.site.pad_scenario(SITE, weather, start="25 [degC]"))
    assert apart["above"].at(0.0) == pytest.approx((400.0 / STEFAN_BOLTZMANN) ** 0.25 - 273.15)
    wall = td.site.pad_scenario(SITE, weather, sky={"above": 90}).boundaries["above"]
    assert wall.at(np.zeros(1))[0] == pytest.approx((200.0 / STEFAN_BOLTZMANN + 0.5 * 298.15**4) ** 0.25)
    # the tables between hours bend differently, in temperature and in its fourth power
    assert np.abs(apart["skin"].kelvin - joined["skin"].kelvin).max() < 0.02


def test_a_sun_at_night_says_that_the_clock_is_wrong(weather: td.site.Weather, tmp_path: Path) -> None:
    with raises_code("value.contradicts", ScenarioError):
        td.site.pad_scenario(td.site.Site(-2.373, -44.396, timezone=9.0), weather)
    path = tmp_path / "early.csv"
    path.write_text("time,dry_bulb,humidity,global\n2026-03-21 06:00,25,80,0\n2026-03-21 09:00,28,70,400\n2026-03-21 12:00,30,65,900\n")
    with raises_code("value.contradicts", ScenarioError, match="400.*W/m.2.*3.*1"):
        td.site.pad_scenario(td.site.Site(-2.373, -44.396, timezone=0.0), td.site.read_weather(path))


def test_the_height_of_a_sun_that_is_too_weak_for_the_weather_is_what_is_left_to_the_zenith_of_90_degrees(tmp_path: Path) -> None:
    site = td.site.Site(-2.373, -44.396, timezone=0.0)
    path = tmp_path / "early.csv"
    path.write_text("time,dry_bulb,humidity,global\n2026-03-21 06:00,25,80,0\n2026-03-21 09:00,28,70,400\n2026-03-21 12:00,30,65,900\n")
    height = abs(90.0 - float(site.sun("2026-03-21 06:00", np.array([3.0 * 3600.0])).zenith[0]))
    with raises_code("value.contradicts", ScenarioError, match=rf"\b{height:.0f} degrees"):
        td.site.pad_scenario(site, td.site.read_weather(path))


def test_a_zone_is_never_guessed(weather: td.site.Weather) -> None:
    nowhere = td.site.Site(-2.373, -44.396)
    with raises_code("value.incomplete", ScenarioError, match="2026-03-21.*06:00-03:00"):
        td.site.pad_scenario(nowhere, weather)
    same = nowhere.sun("2026-03-21 12:00-03:00", 0.0)
    assert same.zenith[0] == pytest.approx(SITE.sun("2026-03-21 12:00", 0.0).zenith[0], abs=1e-3)


def test_only_global_is_taken_apart(tmp_path: Path) -> None:
    """Beam and diffuse of Erbs, Klein and Duffie (1982); on the horizontal they make up the global."""
    path = tmp_path / "w.csv"
    path.write_text("time,dry_bulb,humidity,global\n2026-03-21 12:00,30,70,700\n2026-03-21 13:00,30,70,700\n", encoding="ascii")
    run = td.simulate(skin(facing={"tilt": 0}), td.site.pad_scenario(SITE, td.site.read_weather(path)))
    assert run.load_powers["face.sun"] == pytest.approx(0.3 * 2.0 * 700.0 * np.ones(301), rel=2e-3)


def test_wind_and_rain_make_coefficients(weather: td.site.Weather) -> None:
    wind = {"face.htc": {"length": "2 [m]", "calm": "4 [W/(m^2 K)]", "rain": "roof"}}
    made = td.site.pad_scenario(SITE, weather, wind=wind)
    values = made.schedule["face.htc"].at(weather["wind"].times)
    assert values[0] == pytest.approx(4.0)
    forced = float(wind_htc(6.0, 2.0, 304.15, SITE.pressure))
    assert values[2] == pytest.approx((forced**3 + 4.0**3) ** (1 / 3), rel=1e-6)
    assert values[3] - values[2] == pytest.approx(20 / 3.6e6 * 4.186e6, rel=0.01)
    assert (
        td.simulate(skin(), made)["skin"].highest
        < td.simulate(skin(htc="4 [W/(m^2 K)]"), td.site.pad_scenario(SITE, weather))["skin"].highest
    )


def test_a_coefficient_in_wind_is_that_of_air_as_warm_as_stated(weather: td.site.Weather) -> None:
    """It was that of the weather's dry bulb, or of 300 K where the weather has none."""
    wind = {"face.htc": {"length": "2 [m]", "calm": "0 [W/(m^2 K)]"}}
    made = td.site.pad_scenario(SITE, weather, air_temperature="-40 [degC]", wind=wind)
    assert made.schedule["face.htc"].at(weather["wind"].times)[2] == pytest.approx(
        float(wind_htc(6.0, 2.0, 233.15, SITE.pressure)), rel=1e-9
    )


def test_a_coefficient_from_a_correlation_feels_the_wind_and_a_fixed_one_is_named(weather: td.site.Weather) -> None:
    made = td.site.pad_scenario(SITE, weather)
    fixed, follows = td.simulate(skin(), made), td.simulate(skin(htc={"length": "2 [m]"}), made)
    assert of_code(fixed.warnings, "run.wind-without-effect", "'ambient'")
    assert not of_code(follows.warnings, "run.wind-without-effect")
    noon = int(np.abs(follows.times - 6 * 3600.0).argmin())
    htc = follows.heat_flow("face")[noon] / (2.0 * (follows["skin"].kelvin - follows["ambient"].kelvin)[noon])
    # forced and natural together at 6 m/s
    forced = float(wind_htc(6.0, 2.0, 304.15, SITE.pressure))
    assert 0.97 * forced < htc < 1.3 * forced
    scheduled = td.site.pad_scenario(SITE, weather, wind={"face.htc": {"length": "2 [m]", "calm": "4 [W/(m^2 K)]"}})
    assert not of_code(td.simulate(skin(), scheduled).warnings, "run.wind-without-effect")


def test_wind_along_a_plate_as_in_a_textbook() -> None:
    """Incropera, 6th ed., Eq. 7.30 with air of its Table A.4 at 300 K: Re 62 930, Nu 148."""
    assert float(wind_htc(1.0, 1.0, 300.0, 101325.0)) == pytest.approx(
        0.664 * (1.0 / 15.89e-6) ** 0.5 * 0.707 ** (1 / 3) * 0.0263, rel=0.01
    )


def test_dew_settles_on_a_roof_under_a_clear_night(weather: td.site.Weather) -> None:
    """Long hours of dew, where vapour gives the roof more heat than air does, find their balance with its temperature."""
    roof = skin(facing={"tilt": 0})
    damp = td.site.moisture(
        roof, td.site.pad_scenario(SITE, weather, begin="03-21 18:00", duration="10 [h]"), {"ambient": 0.9}, every="5 [min]"
    )
    front = damp["face"]
    assert front.margin.min() < -0.1
    assert front.film.max() > 0.0
    # the roof cannot be colder than it would be dry
    dry = td.simulate(roof, td.site.pad_scenario(SITE, weather, begin="03-21 18:00", duration="10 [h]"), every="5 [min]")
    assert (damp.solution["skin"].kelvin > dry["skin"].kelvin - 1e-3).all()


def test_a_scenario_file_says_the_same(tmp_path: Path, weather: td.site.Weather) -> None:
    (tmp_path / "pad.toml").write_text(
        """
title = "pad"
duration = "12 [h]"
start = "24 [degC]"
[site]
latitude = "-2.373 [deg]"
longitude = -44.396
altitude = "40 [m]"
timezone = -3
[weather]
file = "weather.csv"
[sun]
albedo = 0.3
[wind."face.htc"]
length = "2 [m]"
calm = "4 [W/(m^2 K)]"
""",
        encoding="utf-8",
    )
    wind = {"face.htc": {"length": "2 [m]", "calm": "4 [W/(m^2 K)]"}}
    by_hand = td.site.pad_scenario(SITE, weather, duration="12 [h]", albedo=0.3, wind=wind, start="24 [degC]")
    one, other = (td.simulate(skin(), s)["skin"].kelvin for s in (td.load_scenario(tmp_path / "pad.toml"), by_hand))
    assert np.abs(one - other).max() < 1e-9


@pytest.mark.parametrize(
    ("text", "code", "match"),
    [
        ("[weather]\nfiel = 'w.csv'\n", "file.unknown-key", r"weather\.fiel.*'fiel'.*'file'"),
        ("[sun]\nalbdo = 0.2\n", "file.unknown-key", r"sun\.albdo.*'albdo'.*'albedo'"),
        ("[site]\nlatitude = -2.3\n", "file.key-missing", r"pad\.toml:1.*site\.longitude"),
        ("[site]\nlatitude = 123\nlongitude = 0\n", "value.outside-range", "123"),
        ("[irradiation.face]\ndirct = '5 [W/m^2]'\n", "file.unknown-key", "'dirct'.*'direct'"),
        ("[weather]\nfile = 'weather.csv'\n", "value.incomplete", "TMY3"),
    ],
)
def test_mistakes_in_a_file_are_named(tmp_path: Path, weather: td.site.Weather, text: str, code: str, match: str) -> None:
    (tmp_path / "pad.toml").write_text(text, encoding="utf-8")
    with raises_code(code, ScenarioError, match=match):
        td.load_scenario(tmp_path / "pad.toml")


def test_radiation_on_a_plane_comes_from_a_file_too(tmp_path: Path) -> None:
    (tmp_path / "sun.csv").write_text("time,poa [kW/m^2]\n0,0\n3600,0.8\n", encoding="ascii")
    (tmp_path / "s.toml").write_text(
        'duration = "1 [h]"\n[boundaries]\nambient = "30 [degC]"\n[irradiation.face]\ntotal = { file = "sun.csv", column = "poa" }\n',
        encoding="utf-8",
    )
    run = td.simulate(skin(), td.load_scenario(tmp_path / "s.toml"))
    assert run.load_powers["face.sun"][-1] == pytest.approx(0.3 * 2.0 * 800.0)


@pytest.mark.parametrize(
    ("surface", "match"),
    [
        ({"absorptance": None}, r"surfaces\.face.*'face'"),
        ({"facing": None}, r"surfaces\.face.*'face'"),
        ({"emissivity": None}, r"surfaces\.face.*'face'"),
    ],
)
def test_a_surface_outdoors_says_what_it_needs(weather: td.site.Weather, surface: dict[str, Any], match: str) -> None:
    with raises_code("value.incomplete", DeckError, match=match):
        td.simulate(skin(**surface), td.site.pad_scenario(SITE, weather))


def test_what_the_pad_needs_is_asked_for(weather: td.site.Weather) -> None:
    bare = td.site.Weather("w", weather.begin, {"dry_bulb": weather["dry_bulb"]}, {})
    with raises_code("value.incomplete", ScenarioError, match="dew_point"):
        td.site.pad_scenario(SITE, bare)
    with raises_code("value.incomplete", ScenarioError):
        td.site.pad_scenario(SITE, bare, sky=False)
    with raises_code("value.incomplete", ScenarioError, match="'ambient'"):
        td.site.pad_scenario(SITE, begin="2026-03-21 06:00", duration="1 [h]")
    with raises_code("value.wrong-kind", ScenarioError, match="'noon'"):
        td.site.pad_scenario(SITE, begin="noon", duration="1 [h]", air_temperature="20 [degC]", sky=False)
    with raises_code("value.incomplete", ScenarioError, match=r"wind\.face\.htc"):
        td.site.pad_scenario(SITE, weather, wind={"face.htc": {"length": "2 [m]"}})
    with raises_code("value.outside-range", ScenarioError, match="20"):
        td.site.pad_scenario(SITE, weather, albedo=20)
    with raises_code("record.not-overlapping", RecordError):
        td.site.pad_scenario(SITE, weather, begin="2027-01-01 00:00")
    lonely = td.site.pad_scenario(SITE, weather, air="room")
    with raises_code("name.unknown", (ScenarioError, td.ThermidError), match="'room'"):
        td.simulate(skin(), lonely)


def test_the_command_line_takes_the_file(
    tmp_path: Path, weather: td.site.Weather, capsys: pytest.CaptureFixture[str], monkeypatch: Any
) -> None:
    from thermid.app.cli.app import main

    shutil.copy(tmp_path / "weather.csv", tmp_path / "w.csv")
    td.save_model(skin(), tmp_path / "skin.toml")
    text = '[site]\nlatitude = -2.373\nlongitude = -44.396\ntimezone = -3\n[weather]\nfile = "w.csv"\nbegin = "03-21 06:00"\n'
    (tmp_path / "pad.toml").write_text('duration = "12 [h]"\n' + text, encoding="utf-8")
    monkeypatch.setattr(
        "sys.argv", ["thermid", "simulate", str(tmp_path / "skin.toml"), "--scenario", str(tmp_path / "pad.toml"), "--json"]
    )
    with pytest.raises(SystemExit) as end:
        main()
    assert not end.value.code
    assert '"ambient"' in capsys.readouterr().out
