"""A cube that cools in air and at 15 to 60 hPa (github.com/ualiberik/lhs1-stratospheric-experiment, MIT): measured, not ours.

The fits give the published time constants. What the fit in air can say of the low pressure is a band: the sensors sit inside a printed
shell, and how much of the resistance lies in the film of air outside, which thins, and how much inside, one cooling curve does not
tell. Nothing in the record discriminates between the two ends of the band: neither mass, nor area, nor a second sensor on the shell.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import thermid as td
from thermid.fit.calibration import Calibration
from thermid.measure.records import Channel, Record

FOLDER = Path(__file__).parents[3] / "shared" / "data" / "lhs1_vacuum_cooling" / "processed"
pytestmark = pytest.mark.skipif(not FOLDER.is_dir(), reason="the measured cooling curves are not here")
AREA, FINISH = 0.06, "plastic"
"""Outside of a cube of 10 cm, printed; only the ratio of two coefficients depends on it. [m^2]"""
HEAT = 300.0
"""Capacitance that the fits assume; the time constant does not depend on it. [J/K]"""


@dataclass(frozen=True)
class Cooling:
    """One cooling curve: times [s], readings [K], and the mean pressure [Pa]."""

    times: NDArray[np.float64]
    readings: NDArray[np.float64]
    pressure: float

    @classmethod
    def of(cls, name: str, column: str, first: int, last: int) -> Cooling:
        data = np.genfromtxt(next(FOLDER.glob(f"{name}*burst-means.csv")), delimiter=",", names=True, usecols=range(5))
        part = data[first : last + 1]
        return cls(part["t_s"] - part["t_s"][0], part[column] + 273.15, float(np.median(part["P_hPa"]) * 100.0))

    @property
    def room(self) -> float:
        """The lowest reading, which the authors took for the room. [K]"""
        return float(self.readings.min())


CURVES = {
    (where, sensor): (name, column, first, last, published)
    for where, name, first, last, constants in (
        ("air", "exp02", 7, 33, (645.0, 645.0)),
        ("thin", "exp03", 6, 32, (751.0, 709.0)),
    )
    for sensor, column, published in zip(("bmp", "mcp"), ("T_bmp_C", "T_mcp_C"), constants, strict=True)
}


def curve(where: str, sensor: str) -> Cooling:
    return Cooling.of(*CURVES[where, sensor][:4])


def cube(htc: str = "8 [W/(m^2 K)]") -> td.Model:
    return td.model_from_dict(
        {
            "title": "Cube",
            "needs": ["room"],
            "nodes": {"box": {"capacitance": f"{HEAT} [J/K]"}},
            "surfaces": {
                "skin": {
                    "of": "box",
                    "to": "room",
                    "area": f"{AREA} [m^2]",
                    "effective_htc": {"value": htc, "min": 0.5, "max": 50},
                    "finish": FINISH,
                }
            },
        }
    )


def fitted(seen: Cooling) -> Calibration:
    record = Record.from_arrays(
        "cooling", seen.times, {"T": Channel.from_array("T", seen.readings, unit="K", role="node", target="box", noise=0.1)}
    )
    scenario = td.Scenario("cooling", boundaries={"room": f"{seen.room} [K]"}, duration=float(seen.times[-1]))
    return td.calibrate(cube(), record, ["skin.effective_htc"], scenario=scenario)


def time_constant(seen: Cooling) -> float:
    return HEAT / (AREA * fitted(seen).values["skin.effective_htc"].value)


def slowest(pressure: float) -> float:
    """Time constant at a pressure over that in air, if all of the resistance lay outside the shell. [-]"""
    warm = td.Scenario("warm", boundaries={"room": "28 [degC]"}, loads={}, start="48 [degC]", duration="1 [s]")
    skin = {
        "of": "box",
        "to": "room",
        "area": f"{AREA} [m^2]",
        "finish": FINISH,
        "htc": {"correlation": "Nu_body", "length": f"{AREA**0.5} [m]"},
    }
    deck = {"title": "Film", "needs": ["room"], "nodes": {"box": {"capacitance": "1e9 [J/K]"}}, "surfaces": {"skin": skin}}
    film = td.model_from_dict(deck)
    flows = []
    for p in (89400.0, pressure):
        run = td.simulate(film, warm.with_(environment={"*": td.simulation.Environment(f"{p} [Pa]")}))
        flows.append(sum(run.heat_flow(c)[0] for c in run.heat_flows))
    return flows[0] / flows[1]


@pytest.mark.parametrize(("where", "sensor"), CURVES)
def test_the_published_time_constants(where: str, sensor: str) -> None:
    fit, published = fitted(curve(where, sensor)), CURVES[where, sensor][-1]
    assert HEAT / (AREA * fit.values["skin.effective_htc"].value) == pytest.approx(published, abs=1.5)
    # a mass behind the sensor of minus .6 to 1.1 times the cube, along straight lines, put it 3 to 10 of its errors away
    printed = fit["skin.effective_htc"]
    assert HEAT / (AREA * printed.value) == pytest.approx(published, rel=2.0 * printed.error / printed.value)
    assert fit.own.state == "not adequate"


@pytest.mark.parametrize("sensor", ["bmp", "mcp"])
def test_the_low_pressure_lies_in_the_band_of_the_fit_in_air(sensor: str) -> None:
    """Half-width at most 1.5 K; its middle beats the unchanged time constant at both sensors."""
    thin, tau = curve("thin", sensor), time_constant(curve("air", sensor))
    most = slowest(thin.pressure)
    assert 1.3 < most < 1.6
    assert tau < time_constant(thin) < most * tau
    start = thin.readings[0] - thin.room
    unchanged, middle, slow = (thin.room + start * np.exp(-thin.times / (r * tau)) for r in (1.0, 0.5 * (1.0 + most), most))
    assert float(((slow - unchanged) / 2).max()) < 1.5
    error = {name: float(np.sqrt(np.mean((found - thin.readings) ** 2))) for name, found in (("unchanged", unchanged), ("middle", middle))}
    assert error["middle"] < error["unchanged"], error
