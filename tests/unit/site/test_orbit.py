"""Orbits: Kepler's time, the shadow, fluxes on every face of a box, and the solved cube of I. Martinez."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import thermid as td
from by_code import raises_code
from thermid.base.errors import ScenarioError
from thermid.base.units import STEFAN_BOLTZMANN
from thermid.site.exposure import planet_share
from thermid.site.orbit import PLANETS, OrbitFluxes, Planet, _Path

CUBE = Planet(6370e3, 6.67e-11 * 5.97e24, 1370.0)
GLOW = 0.6 * STEFAN_BOLTZMANN * 288.0**4


def orbit(altitude: str = "400 [km]", **more: Any) -> OrbitFluxes:
    return td.site.orbit_fluxes(altitude, **({"albedo": 0.3, "infrared": 237.0} | more))


@pytest.mark.parametrize(
    ("altitude", "period", "begin", "eclipse_", "infrared", "albedo"),
    [("300 [km]", 5424.0, 107.0, 2200.0, 127.0, 223.0), ("35.8e6 [m]", 86225.0, 171.0, 4160.0, 1.5, 2.65)],
)
def test_the_solved_cube_of_martinez(altitude: str, period: float, begin: float, eclipse_: float, infrared: float, albedo: float) -> None:
    """UPM, Spacecraft thermal control, problem 13.35, as published: fluxes to 1 % (albedo in high orbit is called negligible there)."""
    found = orbit(altitude, planet=CUBE, infrared=GLOW)
    assert found.period == pytest.approx(period, rel=1e-3)
    assert found.eclipse == pytest.approx(eclipse_, rel=0.01)
    assert 360.0 * found.shadow[0][0] / found.period == pytest.approx(begin, abs=0.5)
    light = found.lit.at(found.times)
    assert 0.25 * max(sum(found.solar[f] * light for f in found.faces)) == pytest.approx(484.0, rel=0.01)
    assert 0.25 * sum(found.infrared[f][0] for f in found.faces) == pytest.approx(infrared, rel=0.01)
    assert 0.25 * sum(found.albedo[f][0] for f in found.faces) == pytest.approx(albedo, rel=0.01)


def cube(found: OrbitFluxes) -> td.Model:
    black = {"of": "cube", "to": "space", "area": "0.25 [m^2]", "htc": 0, "emissivity": 1, "absorptance": 1}
    nodes = {"cube": {"mass": "50 [kg]", "specific_heat": "1000 [J/(kg K)]"}}
    return td.model_from_dict({"title": "cube", "needs": ["space"], "nodes": nodes, "surfaces": dict.fromkeys(found.faces, black)})


@pytest.mark.parametrize("altitude", ["300 [km]", "35.8e6 [m]"])
def test_its_temperature_is_that_of_the_published_balance(altitude: str) -> None:
    """m c dT/dt = Q_s + Q_a + Q_p - 6 A sigma T^4 with closed forms of each, by another integrator, over orbits until they repeat."""
    found = orbit(altitude, planet=CUBE, infrared=GLOW)
    scenario = td.Scenario("o", boundaries={"space": "2.7 [K]"}, irradiation=found.irradiation(), duration=found.period, start="periodic")
    run = td.simulate(cube(found), scenario.vacuum())
    height = 300e3 if "km" in altitude else 35.8e6
    view = planet_share(height, 0.0, 6370e3) + 4 * planet_share(height, 90.0, 6370e3)
    begin, end = found.shadow[0]

    def heat(t: float) -> float:
        phi = 2 * math.pi * (t / found.period % 1.0)
        sun = 0.0 if begin < t % found.period < end else abs(math.cos(phi)) + abs(math.sin(phi))
        return 0.25 * (1370.0 * (sun + 0.3 * view * max(math.cos(phi), 0.0)) + GLOW * view)

    start, t0 = np.array([265.0]), 0.0
    for _ in range(40):
        whole = []
        for a, b in ((0.0, begin), (begin, end), (end, found.period)):
            change = lambda t, y: (heat(t) - 1.5 * STEFAN_BOLTZMANN * (y**4 - 2.7**4)) / 50e3  # noqa: E731
            part = solve_ivp(change, (a + 1e-6, b - 1e-6), start, rtol=1e-8, atol=1e-8, max_step=found.period / 300)
            start = part.y[:, -1]
            whole.append(part.y[0])
        if abs(start[0] - t0) < 1e-5:
            break
        t0 = float(start[0])
    truth = np.concatenate(whole) - 273.15
    assert run["cube"].lowest == pytest.approx(truth.min(), abs=0.05)
    assert run["cube"].highest == pytest.approx(truth.max(), abs=0.05)
    assert run.heat_balance().relative < 1e-9


@pytest.mark.parametrize("beta", [0.0, 40.0, -65.0, 80.0])
def test_circles_have_the_shadow_of_the_closed_form(beta: float) -> None:
    """Gilmore, Spacecraft Thermal Control Handbook, 2nd ed., section 2.1: cos(pi f) = sqrt(h^2 + 2 R h) / ((R + h) cos beta)."""
    radius, height = 6.371e6, 400e3
    period = 2.0 * math.pi * math.sqrt((radius + height) ** 3 / 3.986004418e14)
    share = math.sqrt(height**2 + 2.0 * radius * height) / ((radius + height) * math.cos(math.radians(beta)))
    dark = period * math.acos(min(share, 1.0)) / math.pi
    found = orbit(beta=beta)
    assert found.period == pytest.approx(period, rel=1e-12)
    assert found.eclipse == pytest.approx(dark, abs=1e-4)


def test_an_ellipse_keeps_its_area_law_and_its_ends() -> None:
    path = _Path(7.0e6, 2.6e7, 3.986004418e14, 0.3, 0.0)
    times = np.linspace(0.0, path.period, 4001)
    out, far = path.at(times)
    assert far.min() == pytest.approx(7.0e6)
    assert far.max() == pytest.approx(2.6e7)
    angle = np.unwrap(np.arctan2(out[:, 1], out[:, 0]))
    swept = 0.5 * (0.5 * (far[1:] + far[:-1])) ** 2 * np.diff(angle)
    assert np.ptp(swept) / swept.mean() < 2e-4
    assert angle[-1] - angle[0] == pytest.approx(2 * np.pi)


def test_a_shadow_that_holds_the_beginning_is_in_two_parts_and_lights_alike() -> None:
    plain, turned = orbit(), orbit(begin=180.0)
    assert len(turned.shadow) == 2
    assert turned.eclipse == pytest.approx(plain.eclipse, abs=1e-3)
    at = np.linspace(0.0, 2.9 * plain.period, 997)
    assert (turned.lit.at(at) == plain.lit.at(at + 0.5 * plain.period)).all()
    for face in plain.faces:
        assert turned.means()[face] == pytest.approx(plain.means()[face], rel=1e-4, abs=1e-6)


@pytest.mark.parametrize("attitude", ["nadir", "sun", "inertial"])
@pytest.mark.parametrize("beta", [0.0, 35.0, 90.0])
def test_faces_of_a_box_see_the_sun_and_planet_whole(attitude: str, beta: float) -> None:
    """Squares of the cosines to the sun add to one over three faces; opposite faces see the planet as a plate with two sides does."""
    found = orbit(beta=beta, attitude=attitude, apogee="3000 [km]", argument=70.0)
    total = sum((w / 1361.0) ** 2 for w in found.solar.values())
    assert total == pytest.approx(np.ones(found.times.size), abs=1e-9)
    if attitude == "sun":
        assert found.solar["sun"] == pytest.approx(np.full(found.times.size, 1361.0))
        assert max(w.max() for f, w in found.solar.items() if f != "sun") < 1e-9
    assert all(w.min() >= 0.0 for kind in (found.albedo, found.infrared) for w in kind.values())


def test_the_poles_of_the_sun_have_no_shadow_and_no_albedo() -> None:
    found = orbit(beta=90.0)
    assert found.shadow == ()
    assert max(w.max() for w in found.albedo.values()) < 1e-9


def test_every_planet_and_the_table() -> None:
    for name, body in PLANETS.items():
        found = orbit("500 [km]", planet=name)
        assert found.period == pytest.approx(2 * math.pi * math.sqrt((body.radius + 500e3) ** 3 / body.attraction))
    text = str(orbit())
    assert len(text.splitlines()) == 8
    assert "shadow" in text


def test_surfaces_are_named_and_their_signals_repeat() -> None:
    found = orbit()
    fell = found.irradiation({"panel": "zenith"})
    sun = fell["panel"].direct
    assert sun.at(np.array([0.0, 10 * found.period])) == pytest.approx([1361.0, 1361.0])
    assert sun.at(np.array([0.5 * found.period]))[0] == 0.0
    with raises_code("name.unknown", ScenarioError, match="'zenit'"):
        found.irradiation({"panel": "zenit"})


@pytest.mark.parametrize(
    ("more", "code", "match"),
    [
        ({"planet": "erth"}, "name.unknown", "'erth'.*'earth'"),
        ({"attitude": "nadr"}, "name.unknown", "'nadr'.*'nadir'"),
        ({"apogee": "100 [km]"}, "value.outside-range", ""),
        ({"albedo": 1.2}, "value.outside-range", r"1\.2.*0.*1"),
        ({"beta": 100}, "value.outside-range", "90"),
        ({"apogee": "3 [s]"}, "unit.wrong-dimension", r"'\[s\]'.*\[m\]"),
    ],
)
def test_orbits_that_cannot_be(more: dict[str, Any], code: str, match: str) -> None:
    with raises_code(code, match=match):
        orbit(**more)


CUBE_DECK = """
title = "cube"
needs = ["space"]
nodes.cube = { mass = "50 [kg]", specific_heat = "1000 [J/(kg K)]" }
[tables.faces]
makes = "surfaces"
rows = [{ name = "nadir" }, { name = "zenith" }, { name = "ram" }, { name = "wake" }, { name = "north" }, { name = "south" }]
each = { of = "cube", to = "space", area = "0.25 [m^2]", htc = 0, emissivity = 1, absorptance = 1 }
"""
LOW_ORBIT = """
start = "periodic"
boundaries.space = "2.7 [K]"
[orbit]
perigee = "300 [km]"
planet = { radius = "6370 [km]", attraction = "3.98199e14 [m^3/s^2]", solar = "1370 [W/m^2]" }
albedo = 0.3
infrared = "234.05 [W/m^2]"
orbits = 1
"""


def written(folder: Path, orbit: str, deck: str = CUBE_DECK) -> tuple[td.Model, td.Scenario]:
    (folder / "cube.toml").write_text(deck)
    (folder / "orbit.toml").write_text(orbit)
    return td.load_model(folder / "cube.toml"), td.load_scenario(folder / "orbit.toml")


def test_the_solved_cube_in_fifteen_lines_of_two_files(tmp_path: Path) -> None:
    """Deck and scenario, nothing else: fluxes on every face, no gas, one orbit that comes back."""
    assert sum(bool(line) for line in (CUBE_DECK + LOW_ORBIT).splitlines()) == 15
    model, scenario = written(tmp_path, LOW_ORBIT)
    run = td.simulate(model, scenario)
    found = orbit("300 [km]", planet=Planet(6370e3, 3.98199e14, 1370.0), infrared=234.05)
    own = td.Scenario("o", boundaries={"space": "2.7 [K]"}, irradiation=found.irradiation(), duration=found.period, start="periodic")
    assert run["cube"].kelvin == pytest.approx(td.simulate(cube(found), own.vacuum())["cube"].kelvin, abs=1e-9)
    light = {f: float(max(run.load_powers[f"{f}.sun"])) for f in found.faces}
    assert light["zenith"] == pytest.approx(0.25 * 1370.0, rel=0.01)


def test_a_table_of_an_orbit_has_every_argument(tmp_path: Path) -> None:
    more = 'apogee = "900 [km]"\nbeta = 40\nargument = 30\nbegin = 10\nattitude = "sun"\nsolar = "1400 [W/m^2]"\n'
    text = LOW_ORBIT + more + "[orbit.faces]\nsun = 'zenith'\nshade = ['nadir', 'ram']\n"
    _, scenario = written(tmp_path, text)
    args: dict[str, Any] = {"beta": 40, "argument": 30, "begin": 10, "attitude": "sun", "solar": 1400.0, "infrared": 234.05}
    found = orbit("300 [km]", planet=Planet(6370e3, 3.98199e14, 1370.0), apogee="900 [km]", **args)
    want = found.irradiation({"zenith": "sun", "nadir": "shade", "ram": "shade"})
    assert set(scenario.irradiation) == set(want)
    times = np.linspace(0.0, 3.0 * found.period, 500)
    for surface, falling in want.items():
        for name, signal in falling.signals().items():
            assert getattr(scenario.irradiation[surface], name).at(times) == pytest.approx(signal.at(times), rel=1e-9, abs=1e-9)
    assert scenario.seconds == pytest.approx(found.period)


@pytest.mark.parametrize(
    ("change", "code", "match"),
    [
        (("albedo = 0.3\n", ""), "file.key-missing", r"orbit\.albedo"),
        (('start = "periodic"', 'start = "periodic"\nduration = "1 [h]"'), "value.excludes-another", r"orbit\.toml"),
        (("orbits = 1", "orbits = 0"), "file.wrong-value", "0"),
        (("orbits = 1", "orbit = 1"), "file.unknown-key", "'orbit'"),
        (("orbits = 1", "faces = { top = 'zenith' }"), "name.unknown", "'top'"),
        (("orbits = 1", "faces = { zenith = 'ram', ram = 'ram' }"), "value.contradicts", r"orbit\.toml.*orbit\.faces.*'ram'"),
        (("orbits = 1", "[site]\nlatitude = 1\nlongitude = 2"), "value.excludes-another", r"orbit\.toml"),
        (("orbits = 1", "[irradiation.ram]\ninfrared = '1 [W/m^2]'"), "value.excludes-another", r"orbit\.toml.*'ram'"),
        (('radius = "6370 [km]", ', ""), "file.key-missing", r"planet\.radius"),
    ],
)
def test_an_orbit_that_is_none_is_refused(tmp_path: Path, change: tuple[str, str], code: str, match: str) -> None:
    with raises_code(code, match=match):
        written(tmp_path, LOW_ORBIT.replace(*change))


def test_gas_that_is_given_stays(tmp_path: Path) -> None:
    """A sealed box in orbit keeps its own."""
    _, scenario = written(tmp_path, LOW_ORBIT + "[environment.space]\npressure = '10 [kPa]'\n")
    assert scenario.environment["*"].pressure.at(np.zeros(1))[0] == 0.0
    assert scenario.environment["space"].pressure.at(np.zeros(1))[0] == 1e4
