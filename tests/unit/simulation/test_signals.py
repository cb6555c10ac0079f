"""One algebra of signals: every kind, in every place and builder of scenarios, begun later, cut and scaled, against it written out."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import RecordError, ScenarioError, code_of
from thermid.model.tree import Constant, MeanOf, Mixed, Signal, Sine, TableSignal, common_cycle, joined, multiplied, signal
from thermid.prediction._monte_carlo.uncertain import begun_at
from thermid.simulation._network.irradiation import added
from thermid.site.ascent import Trajectory

HOUR = 3600.0
LATER, LASTS = 2.0 * HOUR, 1.5 * HOUR
"""The start is moved by this; the run lasts that. No row of a table and no period fits either."""
TIMES = np.linspace(0.0, LASTS, 10)
ROWS = np.array([0.0, 1700.0, 5000.0, 8000.0, 9100.0, 12000.0, 16000.0])
SHAPE = np.array([0.2, 1.0, 0.5, 0.0, 0.8, 0.4, 0.6])
CYCLE = np.array([0.0, 700.0, 1100.0, 2000.0])
BEAT = np.array([0.3, 1.0, 0.1, 0.3])


def _out(shape: Callable[[np.ndarray], np.ndarray], rows: np.ndarray, dt: float, hold: bool) -> TableSignal:
    """What a table says from a time on, row by row: the value then, and every row after it."""
    later = rows[rows > dt] - dt
    times = np.concatenate(([0.0], later))
    return TableSignal(times, shape(times + dt), hold)


def _beats(t: np.ndarray, hold: bool) -> np.ndarray:
    inside = np.round(np.mod(t, CYCLE[-1]), 9)
    return BEAT[np.searchsorted(CYCLE, inside, side="right") - 1] if hold else np.interp(inside, CYCLE, BEAT)


def _lines(t: np.ndarray) -> np.ndarray:
    return np.interp(t, ROWS, SHAPE)


def _steps(t: np.ndarray) -> np.ndarray:
    return SHAPE[np.searchsorted(ROWS, t, side="right") - 1]


BEATS = np.unique((CYCLE[None, :] + CYCLE[-1] * np.arange(12)[:, None]).ravel())
KINDS: dict[str, tuple[Signal, Callable[[float], Signal]]] = {
    "constant": (Constant(0.4), lambda dt: Constant(0.4)),
    "lines": (TableSignal(ROWS, SHAPE), lambda dt: _out(_lines, ROWS, dt, False)),
    "steps": (TableSignal(ROWS, SHAPE, hold=True), lambda dt: _out(_steps, ROWS, dt, True)),
    "log": (TableSignal(ROWS, SHAPE, log=("hash", 5.0)), lambda dt: _out(_lines, ROWS, dt, False)),
    "averages": (
        signal({"times": [f"{t} [s]" for t in ROWS[1:]], "values": SHAPE[:-1].tolist(), "samples": "average", "after": "hold"}, "1"),
        lambda dt: _out(_steps, ROWS[:-1], dt, True),
    ),
    "sine": (Sine(0.5, 0.4, 5000.0, 0.3), lambda dt: Sine(0.5, 0.4, 5000.0, 0.3 + 2.0 * np.pi * dt / 5000.0)),
    "repeated lines": (TableSignal(CYCLE, BEAT, after="repeat"), lambda dt: _out(lambda t: _beats(t, False), BEATS, dt, False)),
    "repeated steps": (TableSignal(CYCLE, BEAT, True, after="repeat"), lambda dt: _out(lambda t: _beats(t, True), BEATS, dt, True)),
    "held on": (
        TableSignal(ROWS[:3], SHAPE[:3], after="hold"),
        lambda dt: _out(lambda t: np.interp(t, ROWS[:3], SHAPE[:3]), ROWS[:3], dt, True),
    ),
}
"""Kind -> a shape between 0 and 1, and the same written out for a run that begins later."""


def laid(shape: Signal, low: float, high: float) -> Signal:
    """Return a shape between two values."""
    return shape.scaled(high - low).raised(low)


def box(**more: Any) -> td.Model:
    face: dict[str, Any] = {
        "of": "skin",
        "to": "air",
        "area": "0.2 [m^2]",
        "htc": {"length": "0.4 [m]"},
        "emissivity": 0.8,
        "absorptance": 0.4,
    }
    deck: dict[str, Any] = {
        "title": "box",
        "needs": ["air"],
        "parameters": {"ease": "2 [W/K]"},
        "nodes": {"skin": {"capacitance": "900 [J/K]"}, "core": {"capacitance": "2000 [J/K]"}, "plug": {"capacitance": "50 [J/K]"}},
        "surfaces": {"face": face | more},
        "conductors": {
            "link": {"kind": "conduction", "between": ["skin", "core"], "conductance": "ease"},
            "pin": {"kind": "conduction", "between": ["core", "plug"], "conductance": "0.5 [W/K]"},
        },
        "loads": {"heater": {"into": "core", "power": "5 [W]"}},
    }
    return td.model_from_dict(deck)


def run(model: td.Model, scenario: td.Scenario) -> np.ndarray:
    return td.simulate(model, scenario, times=TIMES).temperatures


def plain(**more: Any) -> td.Scenario:
    fields: dict[str, Any] = {"boundaries": {"air": "20 [degC]"}, "start": "30 [degC]", "duration": LASTS} | more
    return td.Scenario("matrix", **fields)


PLACES: dict[str, Callable[[Signal], td.Scenario]] = {
    "boundary": lambda s: plain(boundaries={"air": laid(s, 280.0, 310.0)}),
    "load": lambda s: plain(loads={"heater": laid(s, 0.0, 20.0)}),
    "prescribed": lambda s: plain(prescribed={"plug": laid(s, 290.0, 330.0)}),
    "schedule": lambda s: plain(schedule={"ease": laid(s, 0.5, 3.0)}),
    "pressure": lambda s: plain(environment={"air": td.simulation.Environment(laid(s, 1e3, 1e5))}),
    "wind": lambda s: plain(environment={"air": td.simulation.Environment(wind=laid(s, 0.0, 6.0))}),
    "radiation": lambda s: plain(
        irradiation={"face": td.simulation.Irradiation(direct=laid(s, 0.0, 500.0), infrared=Sine(20.0, 10.0, 4000.0))}
    ),
    "sky": lambda s: plain(irradiation={"face": td.simulation.Irradiation(sky=laid(s, 220.0, 260.0), sky_view=0.5)}),
    "orbit": lambda s: plain(
        irradiation={"face": td.simulation.Irradiation(direct=s.scaled(1042.6), albedo=s.scaled(293.0), infrared=Constant(183.0))}
    ),
    "pad, air": lambda s: td.site.pad_scenario(
        td.site.Site(0.0, 0.0, 0.0, 0.0),
        begin="2026-03-21 09:00",
        duration=LASTS,
        air="air",
        air_temperature=laid(s, 280.0, 310.0),
        sun=False,
        sky=False,
    ),
    "ascent, air": lambda s: td.site.ascent_scenario(
        pressure=TableSignal(np.array([0.0, 4.0 * HOUR]), np.array([1e5, 1e3])),
        air="air",
        air_temperature=laid(s, 280.0, 310.0),
        duration=LASTS,
    ),
    "ascent, pressure": lambda s: td.site.ascent_scenario(
        pressure=laid(s, 1e3, 1e5), air="air", air_temperature="20 [degC]", duration=LASTS
    ),
}


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("kind", KINDS)
def test_a_start_later_is_the_scenario_written_out_at_that_hour(kind: str, place: str) -> None:
    given, written = KINDS[kind]
    made, other = begun_at(PLACES[place](given), LATER), PLACES[place](written(LATER))
    if place == "radiation":
        other = replace(
            other, irradiation={"face": replace(other.irradiation["face"], infrared=Sine(20.0, 10.0, 4000.0, np.pi * LATER / 2000.0))}
        )
    if place == "ascent, air":
        falls = TableSignal(np.array([0.0, 2.0 * HOUR]), np.array([50500.0, 1e3]))
        other = replace(other, environment={"air": td.simulation.Environment(falls)})
    model = box(facing={"tilt": 0.0}) if place == "sky" else box()
    if place == "sky":
        made, other = (replace(s, start="20 [degC]") for s in (made, other))
    assert np.abs(run(model, made.with_(start="30 [degC]")) - run(model, other.with_(start="30 [degC]"))).max() < 1e-6


@pytest.mark.parametrize("kind", KINDS)
def test_a_signal_that_is_cut_is_the_same_within(kind: str) -> None:
    given, written = KINDS[kind]
    later = given.shifted(LATER).cut(0.0, LASTS)
    times = np.linspace(0.0, LASTS, 997)
    assert later.at(times) == pytest.approx(written(LATER).at(times), abs=1e-12)
    assert later.drawn(LASTS).at(times) == pytest.approx(written(LATER).at(times), abs=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_a_signal_scaled_added_and_multiplied_is_so_at_every_instant(kind: str) -> None:
    given, _ = KINDS[kind]
    times = np.linspace(0.0, LASTS, 97)
    shape = given.at(times)
    assert given.scaled(3.0).raised(2.0).at(times) == pytest.approx(3.0 * shape + 2.0, abs=1e-12)
    for other, _ in KINDS.values():
        both = (multiplied(given, other), added(given, other, Constant(2.0)))
        for made, truth in zip(both, (shape * other.at(times), shape + other.at(times) + 2.0), strict=True):
            assert made.at(times) == pytest.approx(truth, abs=1e-12)
            size = max(float(np.ptp(truth)), 1e-9)
            # within the moment of a jump a drawn line has not arrived
            far = np.abs(made.drawn(LASTS).at(times) - truth) > 1e-4 * size
            assert far.sum() == 0
    assert given.scaled(3.0).span == given.span
    assert given.scaled(3.0).held == given.held
    assert given.mean_over(0.0, LASTS) == pytest.approx(np.mean(given.at((np.arange(20000) + 0.5) * LASTS / 20000)), abs=1e-4)


def test_a_scale_of_a_load_is_the_scenario_written_out() -> None:
    for given, _ in KINDS.values():
        ready = td.prepare(box(), plain(loads={"heater": laid(given, 0.0, 20.0)}), ["scale.heater"], times=TIMES)
        scaled = ready.run({"scale.heater": 1.3}).temperatures
        assert np.abs(scaled - run(box(), plain(loads={"heater": laid(given, 0.0, 26.0)}))).max() < 1e-6


# the silent wrongs, one by one -------------------------------------------------------------------------------------------------------


def test_a_start_time_moves_wind_pressure_sun_and_schedules_too() -> None:
    """Before, `start_time` moved boundaries, loads and prescribed nodes alone: a plate whose sun rises later stayed in the dark."""
    day = TableSignal(np.array([0.0, 6.0, 12.0, 18.0, 24.0]) * HOUR, np.array([0.0, 0.0, 900.0, 0.0, 0.0]))
    scenario = plain(irradiation={"face": td.simulation.Irradiation(direct=day)}, duration=HOUR)
    noon = td.simulate(box(), begun_at(scenario, 11.5 * HOUR), times=[HOUR])["skin"].final
    assert noon > td.simulate(box(), scenario, times=[HOUR])["skin"].final + 10.0
    runs = td.qualify.uncertain_runs(
        box(), scenario, spread={"start_time": {"low": "0 [h]", "high": "12 [h]", "step": "6 [h]"}}, n=12, nodes=["skin"]
    )
    assert np.ptp(runs.node_temperatures("skin")[:, -1]) > 10.0


def test_what_stays_at_a_later_start_is_said() -> None:
    scenario = plain(commands={"heater": TableSignal(np.array([0.0, 600.0]), np.array([1.0, 0.0]), hold=True)})
    runs = td.qualify.uncertain_runs(box(), scenario, spread={"start_time": {"low": "0 [h]", "high": "1 [h]"}}, n=2)
    assert len(runs.warnings) == 1
    assert "heater" in runs.warnings[0]


def _row(hour: int) -> str:
    sun = max(0.0, 800.0 * np.sin((hour - 6) * np.pi / 12))
    return f"2026-03-21 {hour:02d}:00,{20 + 8 * np.sin(hour / 4):.2f},{60 + hour},{2 + hour % 5},{sun:.0f},{100500 + 9 * hour}"


WEATHER = "\n".join(["time,dry_bulb [degC],humidity [%],wind [m/s],global [W/m^2],pressure [Pa]", *map(_row, range(24))])


@pytest.mark.parametrize("cloudless", [True, False])
def test_a_pad_begun_later_is_the_pad_of_that_hour(tmp_path: Path, cloudless: bool) -> None:
    """Before, the weather was cut to the duration before it was shifted, and the sun stayed where it was."""
    pytest.importorskip("pvlib")
    (tmp_path / "day.csv").write_text(WEATHER, encoding="ascii")
    site, weather = td.site.Site(10.0, 0.0, 0.0, 0.0), td.site.read_weather(tmp_path / "day.csv")
    given: dict[str, Any] = (
        {"air": "air", "wind": {"face.htc": {"length": "0.4 [m]", "calm": "4 [W/(m^2 K)]"}}} if not cloudless else {"air": "air"}
    )
    if cloudless:
        given |= {"air_temperature": Sine(293.0, 5.0, 86400.0), "sky": False, "turbidity": 3.0}
    model = box(facing={"tilt": 30.0, "azimuth": 90.0}, **({} if cloudless else {"htc": "5 [W/(m^2 K)]"}))
    early, late = (
        td.site.pad_scenario(site, None if cloudless else weather, begin=f"2026-03-21 {hour}", duration=LASTS, **given)
        for hour in ("07:20", "10:35")
    )
    if cloudless:
        late = late.with_(boundaries={"air": Sine(293.0, 5.0, 86400.0, 2.0 * np.pi * 3.25 / 24.0)})
    begun = begun_at(early, 3.25 * HOUR)
    assert np.abs(run(model, begun.with_(start="20 [degC]")) - run(model, late.with_(start="20 [degC]"))).max() < 1e-6
    if not cloudless:
        with raises_code("record.not-overlapping", RecordError):
            begun_at(early, 18.0 * HOUR)


def test_an_ascent_begun_later_is_the_rest_of_it() -> None:
    times = np.array([0.0, 30.0, 60.0, 90.0, 120.0, 150.0, 180.0, 240.0])
    height, speed = (
        1e3 * np.array([0.0, 4.0, 18.0, 40.0, 65.0, 92.0, 115.0, 150.0]),
        np.array([0.0, 300.0, 800.0, 1600.0, 2500.0, 3100.0, 3500.0, 4300.0]),
    )
    given: dict[str, Any] = {"air": "air", "air_temperature": "20 [degC]", "flow": {"face": 0.5}, "upper": "standard", "duration": "60 [s]"}
    early = td.site.ascent_scenario(Trajectory(times, height, speed), separation="170 [s]", **(given | {"duration": "180 [s]"}))
    late = td.site.ascent_scenario(Trajectory(times - 160.0, height, speed), separation="10 [s]", **given)
    model, at = box(), np.linspace(0.0, 60.0, 13)
    begun = replace(begun_at(early, 160.0), duration=60.0)
    one, other = (td.simulate(model, s.with_(start="20 [degC]"), times=at).temperatures for s in (begun, late))
    assert np.abs(one - other).max() < 1e-6
    with raises_code("run.input-missing", ScenarioError, match="80.*180"):
        td.simulate(model, begun_at(early, 160.0))


def test_a_wall_that_is_held_stays_held_until_the_fairing_goes() -> None:
    """Before, `separation` made straight lines of a held wall, and took two samples of a sine."""
    rows = TableSignal(np.array([0.0, 50.0, 100.0]), np.array([300.0, 350.0, 320.0]), hold=True)
    falls = TableSignal(np.array([0.0, 200.0]), np.array([1e5, 1.0]))
    for wall in (rows, Sine(300.0, 20.0, 40.0)):
        made = td.site.ascent_scenario(
            pressure=falls, air="air", air_temperature="20 [degC]", walls={"w": wall}, separation="150 [s]", duration="200 [s]"
        )
        times = np.array([10.0, 49.0, 51.0, 99.0, 120.0, 149.0])
        assert made.boundaries["w"].drawn(200.0).at(times) == pytest.approx(wall.at(times), abs=2e-3)
        assert made.boundaries["w"].at(np.array([151.0]))[0] == pytest.approx(2.725)


def test_an_eclipse_goes_on_after_the_duration() -> None:
    orbit = td.site.orbit_fluxes("400 [km]", albedo=0.3, infrared="230 [W/m^2]", begin=110.0)
    assert orbit.lit.at(np.array([0.0, 20 * orbit.period])).tolist() == [0.0, 0.0]
    assert orbit.lit.at(np.array([0.5, 20.5]) * orbit.period).tolist() == [1.0, 1.0]


def test_a_sine_of_pressure_swings_to_the_end_of_the_run() -> None:
    """Before, it stood still after 200 periods."""
    swings = plain(environment={"air": td.simulation.Environment(Sine(6e4, 3e4, 10.0))}, duration=4000.0)
    drawn = swings.media().signals()["natural air"]
    assert float(np.ptp(drawn.at(np.linspace(3900.0, 4000.0, 1001)))) > 0.3


def test_a_step_beside_a_line_stays_a_step() -> None:
    """Before, a command that jumps times a power that runs straight became a ramp from row to row."""
    on, ramp = (
        TableSignal(np.array([0.0, 3000.0]), np.array([0.0, 1.0]), hold=True),
        TableSignal(np.array([0.0, LASTS]), np.array([0.0, 10.0])),
    )
    drawn = multiplied(on, ramp).drawn(LASTS)
    assert drawn.at(np.array([1500.0, 2999.9, 3000.1])) == pytest.approx([0.0, 0.0, 10.0 * 3000.1 / LASTS], abs=1e-6)
    both = multiplied(ramp, ramp).drawn(LASTS)  # two lines make a parabola
    assert both.at(np.array([LASTS / 2]))[0] == pytest.approx(25.0, rel=1e-4)


def test_a_table_that_ends_before_the_run_is_refused_unless_it_is_said_what_holds() -> None:
    """Before, a log of 1 h drove a run of 10 h with its last value, without a word."""
    rows = {"times": ["0 [h]", "1 [h]"], "values": ["20 [degC]", "60 [degC]"]}
    with raises_code("run.input-missing", ScenarioError, match="boundaries.air.*1.*10"):
        td.simulate(box(), plain(boundaries={"air": rows}, duration="10 [h]"))
    held = td.simulate(box(), plain(boundaries={"air": rows | {"after": "hold"}}, duration="10 [h]"))
    assert held["air"].celsius[-1] == pytest.approx(60.0)
    back = rows | {"times": ["0 [h]", "1 [h]", "2 [h]"], "values": ["20 [degC]", "60 [degC]", "20 [degC]"], "after": "repeat"}
    again = td.simulate(box(), plain(boundaries={"air": back}, duration="10 [h]"), times=[9 * HOUR])
    assert again["air"].celsius[-1] == pytest.approx(60.0)
    steps = rows | {"hold": True}
    assert td.simulate(box(), plain(boundaries={"air": steps}, duration="10 [h]"))["air"].celsius[-1] == pytest.approx(60.0)
    with raises_code("run.input-missing", ScenarioError, match="600"):
        td.simulate(box(), plain(commands={"heater": {"times": ["600 [s]", "1200 [s]"], "values": [1, 0], "hold": True}}))
    for wrong, code, match in (
        ({"after": "stop"}, "value.wrong-kind", "'hold' or 'repeat'"),
        ({"after": "repeat"}, "model.law-refused", ""),
        ({"after": "hold", "period": "2 [h]"}, "value.incomplete", ""),
        ({"after": "repeat", "period": "30 [min]"}, "value.outside-range", "1800 s"),
        ({"samples": "mean"}, "value.wrong-kind", "'instant' or 'average'"),
        ({"samples": "average", "hold": True}, "value.without-effect", "= 'average'"),
    ):
        with raises_code(code, ScenarioError, match=match):
            signal(rows | wrong, "temperature", "here")
    day = signal(rows | {"after": "repeat", "period": "2 [h]"}, "temperature")
    assert day.at(np.array([0.0, 1.5, 2.0, 3.0]) * HOUR) == pytest.approx([293.15, 313.15, 293.15, 333.15])


def test_a_column_that_ends_before_the_run_is_refused(tmp_path: Path) -> None:
    (tmp_path / "room.csv").write_text("time_s,T_ROOM\n" + "\n".join(f"{60 * k},{20 + k}" for k in range(61)), encoding="ascii")
    text = 'start = "20 [degC]"\nduration = "{d}"\n[boundaries]\nair = {{ file = "room.csv", column = "T_ROOM"{more} }}\n'

    def made(duration: str, more: str = "") -> td.Scenario:
        (tmp_path / "s.toml").write_text(text.format(d=duration, more=more), encoding="ascii")
        return td.load_scenario(tmp_path / "s.toml")

    with raises_code("run.input-missing", ScenarioError, match=r"boundaries\.air.*1.*10"):
        td.simulate(box(), made("10 [h]"))
    assert td.simulate(box(), made("3650 [s]"))["air"].celsius[-1] == pytest.approx(80.0)  # a part of a sample is none
    assert td.simulate(box(), made("10 [h]", ', after = "hold"'))["air"].celsius[-1] == pytest.approx(80.0)
    assumed = td.simulate(box(), made("1 [h]"))
    assert any(code_of(w) == "record.samples-assumed" and "boundaries.air" in w for w in assumed.warnings)
    said = td.simulate(box(), made("1 [h]", ', samples = "instant"'))
    assert not any("instants" in w for w in said.warnings)
    average = made("1 [h]", ', samples = "average"').boundaries["air"]
    assert average.at(np.array([1.0, 59.0, 61.0])) == pytest.approx([294.15, 294.15, 295.15])
    assert average.mean_over(0.0, HOUR) == pytest.approx(273.15 + np.mean(20 + np.arange(1, 61)))


# steady states under inputs that change ----------------------------------------------------------------------------------------------

PULSED = {"h": {"into": "core", "power": "60 [W]", "periodic": {"period": "600 [s]", "duty": 0.2}}}


def pulsed(**loads: Any) -> td.Model:
    deck: dict[str, Any] = {
        "title": "pulsed",
        "needs": ["air"],
        "nodes": {"core": {"capacitance": "300 [J/K]"}, "lid": {}},
        "conductors": {
            "a": {"kind": "conduction", "between": ["core", "lid"], "conductance": "2 [W/K]"},
            "b": {"kind": "conduction", "between": ["lid", "air"], "conductance": "2 [W/K]"},
        },
        "loads": {**PULSED, **loads},
    }
    return td.model_from_dict(deck)


def test_a_steady_state_of_a_pulsed_load_says_which_inputs_it_holds() -> None:
    """60 W for a fifth of the time through 1 W/K: 60 K on, 0 K off, 12 K in the mean; before, 60 K without a word."""
    still = plain(duration=0.0)
    found = td.steady(pulsed(), still)
    assert found["core"] - 293.15 == pytest.approx(60.0)
    assert found.held.endswith(" 0 s")
    assert re.search(r"\b0 s\b.*\bh\b", found.remarks[0])
    assert str(found).splitlines()[0].endswith(found.held)
    assert td.steady(pulsed(), still, "300 [s]")["core"] - 293.15 == pytest.approx(0.0, abs=1e-6)
    assert td.steady(pulsed(), still, "mean")["core"] - 293.15 == pytest.approx(12.0)
    assert [round(s["core"] - 293.15, 6) for s in td.simulation.steady_levels(pulsed(), still)] == [60.0, 0.0]
    assert td.steady(pulsed(), plain(duration=0.0, loads={"h": "5 [W]"})).remarks == ()


def test_the_periodic_state_by_hand() -> None:
    """One capacity C through G: T_low = P/G (1 - exp(-a)) exp(-b) / (1 - exp(-a-b)) with a = on/tau, b = off/tau."""
    tau = 300.0
    on, off = np.exp(-120.0 / tau), np.exp(-480.0 / tau)
    low = 60.0 * (1.0 - on) * off / (1.0 - on * off)
    found = td.simulate(pulsed(), plain(start="periodic", duration="600 [s]"), times=[0.0, 120.0, 600.0])
    assert found["core"].kelvin[[0, 2]] - 293.15 == pytest.approx(low, abs=1e-5)
    settled = td.steady(pulsed(), plain(duration=0.0), "periodic")
    assert settled["core"] - 293.15 == pytest.approx(12.0, abs=1e-3)
    assert settled.lowest["core"] - 293.15 == pytest.approx(low, abs=1e-3)
    assert settled.highest["core"] - 293.15 == pytest.approx(found["core"].kelvin[1] - 293.15, abs=1e-3)


@pytest.mark.parametrize("off", ["in the deck", "in the scenario"])
def test_a_thermostat_of_a_heater_without_power_is_no_obstacle_to_a_periodic_state(off: str) -> None:
    """Survival heaters are at 0 W in the hot case."""
    power, more = ("0 [W]", {}) if off == "in the deck" else ("5 [W]", {"loads": {"heater": "0 [W]"}})
    model = pulsed(heater={"into": "core", "power": power, "thermostat": {"on_below": "0 [degC]", "off_above": "5 [degC]"}})
    found = td.simulate(model, plain(start="periodic", duration="600 [s]", **more), times=[0.0, 600.0])
    alone = td.simulate(pulsed(), plain(start="periodic", duration="600 [s]"), times=[0.0])
    assert found["core"].kelvin == pytest.approx(alone["core"].kelvin[0], abs=1e-4)
    if off == "in the scenario":
        with raises_code("run.no-periodic-state"):
            td.simulate(model, plain(start="periodic", duration="600 [s]"), times=[0.0])


def test_a_periodic_start_of_laws_that_bend_comes_back() -> None:
    face = {
        "irradiation": {
            "face": td.simulation.Irradiation(
                direct={
                    "times": ["0 [s]", "1000 [s]", "3000 [s]"],
                    "values": ["900 [W/m^2]", "0 [W/m^2]", "900 [W/m^2]"],
                    "hold": True,
                    "after": "repeat",
                }
            )
        }
    }
    scenario = plain(start="periodic", duration="3000 [s]", boundaries={"air": Sine(293.15, 15.0, 1500.0)}, **face)
    found = td.simulate(box(), scenario, times=[0.0, 3000.0], options=td.Options(error=4e-6))
    assert np.abs(found.temperatures[0] - found.temperatures[1]).max() < 1e-5
    free = td.prepare(box(), scenario, ["ease", "scale.heater"], times=[1000.0])
    slope = free.run({}, sensitivities=True).sensitivity("core", "ease")
    ends = [free.run({"ease": 2.0 + d})["core"].kelvin[0] for d in (-0.01, 0.01)]
    assert float(np.ravel(slope)[0]) == pytest.approx((ends[1] - ends[0]) / 0.02, rel=1e-3)


def test_a_steady_start_names_its_instant_and_others_can_be_asked_for() -> None:
    def begun(start: str, **more: Any) -> Any:
        return td.simulate(pulsed(), plain(start=start, duration="600 [s]", **more), times=[0.0])

    first = begun("steady")
    assert any(code_of(w) == "run.start-held" and "0 s" in w for w in first.warnings)
    assert first["core"].kelvin[0] - 293.15 == pytest.approx(60.0)
    assert begun("steady, 200 [s]")["core"].kelvin[0] - 293.15 == pytest.approx(0.0, abs=1e-6)
    assert begun("steady, mean")["core"].kelvin[0] - 293.15 == pytest.approx(12.0)
    assert not begun("steady", loads={"h": "5 [W]"}).warnings
    for start, code, match in (
        ("steady, 1 [h]", "value.outside-range", ""),
        ("steady, noon", "value.wrong-kind", ""),
    ):
        with raises_code(code, match=match):
            begun(start)
    for power in ("5 [W]", "0 [W]"):  # constant inputs repeat after any time, so their periodic state is the steady one
        assert begun("periodic", loads={"h": power})["core"].kelvin == pytest.approx(
            begun("steady", loads={"h": power})["core"].kelvin, abs=1e-9
        )
    with raises_code("run.no-periodic-state", ScenarioError):
        begun("periodic", boundaries={"air": TableSignal(np.array([0.0, 600.0]), np.array([290.0, 300.0]))})


def test_cycles_and_means() -> None:
    assert common_cycle([600.0, 0.0, 900.0]) == pytest.approx(1800.0)
    assert common_cycle([600.0, None]) is None
    assert common_cycle([1.0, float(np.pi)]) is None
    assert MeanOf(TableSignal(np.array([0.0, 10.0]), np.array([0.0, 1.0])), 10.0).shifted(5.0).value == pytest.approx(0.875)
    assert isinstance(joined(Constant(1.0), 5.0, Constant(2.0)), Mixed)
    assert joined(Constant(1.0), 5.0, Constant(2.0)).drawn(9.0).at(np.array([4.999, 5.0])).tolist() == [1.0, 2.0]


def test_the_largest_changes_of_a_logged_supply_are_its_switches_and_not_its_noise() -> None:
    """Each is followed by runs of its own: noise of a millivolt made most of them."""
    times = np.arange(0.0, 600.0, 2.0)
    held = np.select([times < 200.0, times < 400.0], [30.0, 11.0], 0.5)
    noisy = held + 0.02 * np.random.default_rng(7).standard_normal(times.size)
    assert TableSignal(times, noisy, hold=True).largest_changes(20) == [100, 200]
    assert len(TableSignal(times, np.arange(times.size) / 7.0).largest_changes(20)) == 20
