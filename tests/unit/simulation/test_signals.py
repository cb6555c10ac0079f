"""One algebra of signals: every kind, in every place and builder of scenarios, begun later, cut and scaled, against the same written out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import thermid as td
from thermid.errors import RecordError, ScenarioError
from thermid.model.signal import Constant, MeanOf, Mixed, Signal, Sine, Table, added, common_cycle, joined, multiplied, signal
from thermid.qualify.starts import begun_at
from thermid.simulation.ascent import Trajectory

HOUR = 3600.0
LATER, LASTS = 2.0 * HOUR, 1.5 * HOUR
"""The start is moved by this; the run lasts that. No row of a table and no period fits either."""
TIMES = np.linspace(0.0, LASTS, 10)
ROWS = np.array([0.0, 1700.0, 5000.0, 8000.0, 9100.0, 12000.0, 16000.0])
SHAPE = np.array([0.2, 1.0, 0.5, 0.0, 0.8, 0.4, 0.6])
CYCLE = np.array([0.0, 700.0, 1100.0, 2000.0])
BEAT = np.array([0.3, 1.0, 0.1, 0.3])


def _out(shape: Callable[[np.ndarray], np.ndarray], rows: np.ndarray, dt: float, hold: bool) -> Table:
    """What a table says from a time on, row by row: the value then, and every row after it."""
    later = rows[rows > dt] - dt
    times = np.concatenate(([0.0], later))
    return Table(times, shape(times + dt), hold)


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
    "lines": (Table(ROWS, SHAPE), lambda dt: _out(_lines, ROWS, dt, False)),
    "steps": (Table(ROWS, SHAPE, hold=True), lambda dt: _out(_steps, ROWS, dt, True)),
    "log": (Table(ROWS, SHAPE, log=("hash", 5.0)), lambda dt: _out(_lines, ROWS, dt, False)),
    "averages": (
        signal({"times": [f"{t} [s]" for t in ROWS[1:]], "values": SHAPE[:-1].tolist(), "samples": "average", "after": "hold"}, "1"),
        lambda dt: _out(_steps, ROWS[:-1], dt, True),
    ),
    "sine": (Sine(0.5, 0.4, 5000.0, 0.3), lambda dt: Sine(0.5, 0.4, 5000.0, 0.3 + 2.0 * np.pi * dt / 5000.0)),
    "repeated lines": (Table(CYCLE, BEAT, after="repeat"), lambda dt: _out(lambda t: _beats(t, False), BEATS, dt, False)),
    "repeated steps": (Table(CYCLE, BEAT, True, after="repeat"), lambda dt: _out(lambda t: _beats(t, True), BEATS, dt, True)),
    "held on": (Table(ROWS[:3], SHAPE[:3], after="hold"), lambda dt: _out(lambda t: np.interp(t, ROWS[:3], SHAPE[:3]), ROWS[:3], dt, True)),
}
"""Kind -> a shape between 0 and 1, and the same written out for a run that begins later."""


def laid(shape: Signal, low: float, high: float) -> Signal:
    """Return a shape between two values."""
    return shape.scaled(high - low).raised(low)


def box(**more: Any) -> td.Model:
    face: dict[str, Any] = {"of": "skin", "to": "air", "area": "0.2 [m^2]", "htc": {"length": "0.4 [m]"}, "emissivity": 0.8, "absorptance": 0.4}
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
    "pressure": lambda s: plain(environment={"air": td.Environment(laid(s, 1e3, 1e5))}),
    "wind": lambda s: plain(environment={"air": td.Environment(wind=laid(s, 0.0, 6.0))}),
    "radiation": lambda s: plain(irradiation={"face": td.Irradiation(direct=laid(s, 0.0, 500.0), infrared=Sine(20.0, 10.0, 4000.0))}),
    "sky": lambda s: plain(irradiation={"face": td.Irradiation(sky=laid(s, 220.0, 260.0), sky_view=0.5)}),
    "orbit": lambda s: plain(
        irradiation={"face": td.orbit_irradiation("400 [km]", tilt=30.0, sun=40.0, albedo=0.3, infrared="230 [W/m^2]", lit=s)}
    ),
    "pad, air": lambda s: td.pad_scenario(
        td.Site(0.0, 0.0, 0.0, 0.0), begin="2026-03-21 09:00", duration=LASTS, air="air", air_temperature=laid(s, 280.0, 310.0), sun=False, sky=False
    ),
    "ascent, air": lambda s: td.ascent_scenario(
        pressure=Table(np.array([0.0, 4.0 * HOUR]), np.array([1e5, 1e3])), air="air", air_temperature=laid(s, 280.0, 310.0), duration=LASTS
    ),
    "ascent, pressure": lambda s: td.ascent_scenario(pressure=laid(s, 1e3, 1e5), air="air", air_temperature="20 [degC]", duration=LASTS),
}


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("kind", KINDS)
def test_a_start_later_is_the_scenario_written_out_at_that_hour(kind: str, place: str) -> None:
    given, written = KINDS[kind]
    made, other = begun_at(PLACES[place](given), LATER), PLACES[place](written(LATER))
    if place == "radiation":
        other = replace(other, irradiation={"face": replace(other.irradiation["face"], infrared=Sine(20.0, 10.0, 4000.0, np.pi * LATER / 2000.0))})
    if place == "ascent, air":
        falls = Table(np.array([0.0, 2.0 * HOUR]), np.array([50500.0, 1e3]))
        other = replace(other, environment={"air": td.Environment(falls)})
    model = box(facing={"tilt": 0.0}) if place == "sky" else box()
    if place == "sky":
        made, other = (replace(s, start="20 [degC]") for s in (made, other))
    assert np.abs(run(model, made.with_(start="30 [degC]")) - run(model, other.with_(start="30 [degC]"))).max() < 1e-6
