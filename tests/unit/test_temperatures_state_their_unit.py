"""Every public entry of a temperature: each way of stating its unit is read alike, and a bare number is refused."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pint
import pytest
import xarray as xr

import thermid as td
from by_code import raises_code
from thermid.base.units import seconds

KELVIN = 297.15
UNITS = pint.UnitRegistry()
PART = td.model_from_dict(
    {
        "title": "part",
        "needs": ["air"],
        "nodes": {"case": {"capacitance": "100 [J/K]"}},
        "surfaces": {"skin": {"of": "case", "to": "air", "area": "0.01 [m^2]", "htc": "5 [W/(m^2 K)]"}},
        "loads": {"heater": {"into": "case", "power": "1 [W]", "thermostat": {"on_below": "10 [degC]", "off_above": "12 [degC]"}}},
    }
)
BENCH = td.Scenario("bench", boundaries={"air": "20 [degC]"}, start="air", duration="1 [min]")
RUN = td.simulate(PART, replace(BENCH, start="30 [degC]"))
READY = td.prepare(PART, BENCH, ("air", "initial.case", "heater.thermostat.off_above"))
LOG = td.Record.from_arrays("log", [0.0, 10.0, 20.0], {"T": [20.0, 24.0, 25.0]}, unit="degC")
WARMED = 24.0 - 4.0 * np.exp(-np.array([0.0, 30.0, 60.0]) / 2000.0)  # by air of 24 degC, so that a fit ends soon
FITTED = td.Record.from_arrays("log", [0.0, 30.0, 60.0], {"T": td.Channel.from_array("T", WARMED, unit="degC", role="node", target="case")})
STANDARD = ("SMC-S-016", "unit thermal cycle")


def channel(record: td.Record) -> float:
    return float(record["T"].values[1])


def fitted(given: Any) -> float:
    """Return the start of a local boundary of a fit."""
    fit = td.calibrate(PART, FITTED, ["skin.htc"], scenario=td.Scenario("s"), local={"air": given})
    return float(fit.request.local_start(FITTED, "air"))  # type: ignore[union-attr]


def drawn(given: Any) -> float:
    return float(np.mean(td.simulation.draw(PART, BENCH, {"air": {"mean": given, "sd": "0 [K]"}}, 2, seed=1)["air"]))


DOORS: dict[str, Callable[[Any], float]] = {
    "Scenario, boundaries": lambda g: BENCH.with_(boundaries={"air": g}).boundaries["air"].value,
    "Scenario, prescribed": lambda g: BENCH.with_(prescribed={"case": g}).prescribed["case"].value,
    "Scenario, start": lambda g: float(td.simulate(PART, BENCH.with_(start=g))["case"].kelvin[0]),
    "Scenario, initial": lambda g: float(td.simulate(PART, BENCH.with_(initial={"case": g}))["case"].kelvin[0]),
    "Scenario, sine": lambda g: (
        BENCH.with_(boundaries={"air": {"mean": g, "amplitude": "1 [K]", "period": "1 [h]"}}).boundaries["air"].mean
    ),
    "Scenario, table": lambda g: (
        BENCH.with_(boundaries={"air": {"times": ["0 [s]", "1 [h]"], "values": [g, g]}}).boundaries["air"].values[1]
    ),
    "Scenario, schedule": lambda g: (
        td.simulate(PART, BENCH.with_(schedule={"heater.thermostat.off_above": g}))
        and td.simulate(PART, BENCH.with_(start=g))["case"].kelvin[0]
    ),
    "Irradiation, sky": lambda g: td.simulation.Irradiation(sky=g, sky_view=1.0).sky.value,
    "ascent_scenario, air_temperature": lambda g: (
        td.site.ascent_scenario(pressure="1 [atm]", air_temperature=g, duration="1 [min]").boundaries["ambient"].value
    ),
    "ascent_scenario, walls": lambda g: (
        td.site.ascent_scenario(pressure="1 [atm]", air_temperature="20 [degC]", walls={"hull": g}, duration="1 [min]")
        .boundaries["hull"]
        .value
    ),
    "pad_scenario, air_temperature": lambda g: (
        td.site.pad_scenario(td.site.Site(45.0, 5.0), begin="2026-02-01 12:00", air_temperature=g, sun=False, sky=False, duration="1 [min]")
        .boundaries["ambient"]
        .value
    ),
    "prepare, run, boundary": lambda g: float(READY.run({"air": g})["air"].kelvin[0]),
    "prepare, run, start": lambda g: float(READY.run({"initial.case": g})["case"].kelvin[0]),
    "prepare, run, parameter": lambda g: float(READY.vector({"heater.thermostat.off_above": g})[2]),
    "prepare, settled": lambda g: td.prepare(PART.with_values({"heater.power": "0 [W]"}), BENCH, ("air",)).settled({"air": g})[0]["case"],
    "ensemble, draws": lambda g: float(td.ensemble(PART, BENCH, {"initial.case": [g, g]}).temperatures("case")[0, 1]),
    "draw, spreads": drawn,
    "Ensemble, exceedance": lambda g: (
        KELVIN if td.ensemble(PART, BENCH, {"initial.case": td.celsius([23.9, 24.1])}).exceedance("case", g)[0] == 0.5 else 0.0
    ),
    "Trace, crossing": lambda g: KELVIN if RUN["case"].crossing(g, below=True) == RUN["case"].crossing("24 [degC]", below=True) else 0.0,
    "calibrate, local": fitted,
    "Channel.of": lambda g: float(td.Channel.from_array("T", [g, g]).values[1]),
    "Record.from_arrays": lambda g: channel(td.Record.from_arrays("r", [0.0, 1.0], {"T": [g, g]})),
    "Record, flag_faults, codes": lambda g: KELVIN if LOG.flag_faults([g], jump="1 [K]")["T"].flags == {"fault": 1} else 0.0,
    "Record, flag_faults, high": lambda g: (
        KELVIN if LOG.flag_faults([], high=g)["T"].flags == LOG.flag_faults([], low=g)["T"].flags == {"fault": 1} else 0.0
    ),
    "SensorPart, range": lambda g: td.bench.SensorPart(low=g).low,
    "SensorPart, gain_about": lambda g: td.bench.SensorPart(gain_about=g).gain_about,
    "SensorCertificate": lambda g: td.bench.SensorCertificate(0.1, 0.1, g).at,
    "Record, with_sensor": lambda g: (
        LOG.with_sensor("T", certificate={"offset": "0.1 [K]", "uncertainty": "0.1 [K]", "at": g}, gain_accuracy=0.1)["T"].part.gain_about  # type: ignore[union-attr]
    ),
    "Limits": lambda g: td.qualify.Limits("p", "case", (g, np.inf)).operating[0],
    "profile_of, hot": lambda g: td.qualify.profile_of(*STANDARD, hot=g, cold="-20 [degC]").value("hot"),
    "profile_of, predicted": lambda g: td.qualify.profile_of(*STANDARD, predicted=("-20 [degC]", g)).predicted[1],  # type: ignore[index]
    "equivalent_cycles": lambda g: KELVIN if td.qualify.equivalent_cycles("-20 [degC]", g) == math.ceil(27 * (105 / 44) ** 1.4) else 0.0,
    "law, between": lambda g: float(td.model.law(lambda t: 1.0 + 0.0 * t, between=("0 [degC]", g)).x[-1]),
    "compare_htc": lambda g: 20.0 + td.inference.compare_htc("1 [W]", "0.01 [m^2]", g, "20 [degC]", "0.1 [m]").rise + KELVIN - 24.0,
}
WAYS = ("24 [degC]", td.celsius(24), td.quantity(297.15, unit="K"), td.quantity(75.2, unit="degF"), UNITS.Quantity(24.0, "degC"))
BARE = (24, 24.0, 297.15, np.float64(297.15))


@pytest.mark.filterwarnings("ignore::thermid.ThermidWarning")
@pytest.mark.parametrize("door", DOORS)
def test_a_temperature_is_read_alike_however_its_unit_is_stated(door: str) -> None:
    # in a spread K is a shift of the temperature
    for way in WAYS if door != "draw, spreads" else (w for w in WAYS if "[K]" not in str(w)):
        assert DOORS[door](way) == pytest.approx(KELVIN, abs=1e-9), way


@pytest.mark.parametrize("door", DOORS)
def test_a_bare_number_is_no_temperature(door: str) -> None:
    for bare in BARE:
        with pytest.raises(td.ThermidError, match=r"'24 \[degC\]', td\.celsius\(24\), or td\.quantity\("):
            DOORS[door](bare)


@pytest.mark.parametrize("door", [d for d in DOORS if d not in ("Channel.of", "Record.from_arrays")])  # a reading may be missing
def test_what_is_not_a_number_is_no_temperature(door: str) -> None:
    """The mean of an empty series; a start of nan once was a steady one, without a word."""
    with pytest.raises(td.ThermidError):
        DOORS[door](td.celsius(math.nan))


def hours(of: str = "degC") -> pd.Series:
    """Return temperatures at stamps five hours apart."""
    made = pd.Series([24.0, 25.0], index=pd.to_datetime(["2026-02-01 08:00", "2026-02-01 13:00"]))
    return made if not of else made.set_axis(made.index).pipe(lambda s: s.attrs.update(units=of) or s)


WARMING = BENCH.with_(boundaries={"air": ([0, 18000], td.celsius([24, 25]))}, duration="5 [h]")
SIGNALS: dict[str, Any] = {
    "pair": ([0, 18000], td.celsius([24, 25])),
    "pair of texts": (["0 [s]", "5 [h]"], ["24 [degC]", "25 [degC]"]),
    "pair of pint": ([0, 5] * UNITS.hour, UNITS.Quantity([24, 25], "degC")),
    "durations": (np.array([0, 5], dtype="timedelta64[h]"), td.quantity([297.15, 298.15], unit="K")),
    "series": hours(),
    "series of stamps with a zone": td.celsius(hours("").tz_localize("Europe/Paris")),
    "series of seconds": td.celsius(pd.Series([24, 25], index=[0, 18000])),
    "xarray": xr.DataArray([24.0, 25.0], dims="time", coords={"time": ("time", [0, 5], {"units": "h"})}, attrs={"units": "degC"}),
    "solution": td.simulate(PART, WARMING, times=[0.0, 18000.0]).to_xarray().temperature.sel(node="air"),
    "table": {"times": ["0 [s]", "5 [h]"], "values": td.celsius([24, 25])},
}


@pytest.mark.parametrize("way", SIGNALS)
def test_a_course_is_read_alike_however_it_is_given(way: str) -> None:
    read = BENCH.with_(boundaries={"air": SIGNALS[way]}).boundaries["air"]
    assert read.times == pytest.approx([0.0, 18000.0])
    assert read.values == pytest.approx([297.15, 298.15], abs=1e-9)


@pytest.mark.parametrize("bare", [([0, 18000], [24, 25]), hours(""), pd.Series([24, 25]), [24, 25], {"times": ["0 [s]"], "values": [24]}])
def test_a_course_without_a_unit_is_refused(bare: Any) -> None:
    with pytest.raises(td.ThermidError, match=r"td\.celsius\(24\)"):
        BENCH.with_(boundaries={"air": bare})


def test_readings_are_in_the_unit_that_is_stated() -> None:
    for made in (
        td.Channel.from_array("T", [75.2, 77.0], unit="degF"),
        td.Channel.from_array("T", UNITS.Quantity([24.0, 25.0], "degC")),
        td.Record.from_arrays("r", hours().index, {"T": hours()})["T"],
    ):
        assert made.values == pytest.approx([297.15, 298.15])
    assert td.Channel.from_array("P", [5.0], quantity="power").values == pytest.approx([5.0])
    assert td.Channel.from_array("P", [5.0], unit="mW", quantity="power").values == pytest.approx([0.005])
    with raises_code("unit.wrong-dimension"):
        td.Channel.from_array("P", [5.0], unit="W")


@pytest.mark.parametrize(
    ("call", "code", "match"),
    [
        (lambda: BENCH.with_(loads={"heater": td.celsius(24)}), "unit.wrong-dimension", r"loads\.heater.*'\[degC\]'.*\[W\]"),
        (lambda: BENCH.with_(start=UNITS.Quantity(24, "W")), "unit.wrong-dimension", r"'\[watt\]'.*\[degC\].*\[K\]"),
        (
            lambda: BENCH.with_(start=UNITS.Quantity(24, "delta_degC")),
            "unit.wrong-dimension",
            r"'\[delta_degree_Celsius\]'.*\[degC\].*\[K\]",
        ),
        (lambda: BENCH.with_(start=td.celsius([24, 25])), "value.wrong-kind", "2"),
        (lambda: BENCH.with_(boundaries={"air": td.celsius([24, 25])}), "value.wrong-kind", r"boundaries\.air"),
        (lambda: BENCH.with_(boundaries={"air": (["noon"], td.celsius([24]))}), "value.wrong-kind", "'noon'"),
        (lambda: td.quantity(hours("degC"), unit="K"), "value.without-effect", r"\[degC\]"),
        (lambda: td.celsius("24"), "value.wrong-kind", r"'24'.*'24 \[degC\]'.*td\.celsius"),
        (lambda: td.celsius(True), "value.wrong-kind", r"'24 \[degC\]'.*td\.celsius.*td\.quantity"),
        (
            lambda: td.quantity([1, 2], unit="W")[0] and BENCH.with_(start=td.quantity(1, unit="W")),
            "unit.wrong-dimension",
            r"'\[W\]'.*\[degC\].*\[K\]",
        ),
    ],
)
def test_what_is_not_what_is_needed_is_refused(call: Callable[[], Any], code: str, match: str) -> None:
    with raises_code(code, match=match):
        call()


def test_times_are_seconds_unless_they_state_otherwise() -> None:
    for times in (
        [0, 60],
        ["0 [s]", "1 [min]"],
        pd.to_timedelta([0, 1], unit="min"),
        pd.to_datetime(["2026-02-01 00:00", "2026-02-01 00:01"]),
    ):
        assert seconds(times) == pytest.approx([0.0, 60.0])
    with pytest.raises(td.ThermidError):
        td.simulate(PART, BENCH, times=[0.0, math.nan, 60.0])
    run = td.simulate(PART, BENCH, times=["0 [s]", "1 [min]"])
    assert run.times == pytest.approx([0.0, 60.0])
