"""Times that enter from Python: stamps of several arrays share one clock, samples hold as in a record, durations are durations."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
import pandas as pd
import pytest
import xarray as xr

import thermid as td
from by_code import raises_code

BOX = td.model_from_dict(
    {
        "title": "box",
        "needs": ["air"],
        "nodes": {"case": {"capacitance": "400 [J/K]"}},
        "conductors": {"film": {"kind": "conduction", "between": ["case", "air"], "conductance": "0.8 [W/K]"}},
        "loads": {"heat": {"into": "case", "power": "5 [W]"}},
    }
)
AIR, LATER = ("2026-01-01 08:00", "2026-01-01 12:00"), ("2026-01-01 09:00", "2026-01-01 10:00", "2026-01-01 12:00")


def series(values: list[float], stamps: tuple[str, ...], units: str, zone: str | None = None) -> Any:
    out = pd.Series(values, index=pd.to_datetime(list(stamps)).tz_localize(zone))
    out.attrs["units"] = units
    return out


def bench(**more: Any) -> td.Scenario:
    return td.Scenario("bench", boundaries={"air": series([20.0, 20.0], AIR, "degC")}, start="air", **more)


POWERS: dict[str, Any] = {
    "pandas": series([0.0, 10.0, 0.0], LATER, "W"),
    "without a unit": pd.Series([0, 10, 0], index=pd.to_datetime(list(LATER))),
    "xarray": xr.DataArray([0.0, 10.0, 0.0], coords={"t": pd.to_datetime(list(LATER))}, dims="t", attrs={"units": "W"}),
    "table": {"values": series([0.0, 10.0, 0.0], LATER, "W"), "hold": False},
    "pair of stamps": (pd.to_datetime(list(LATER)), [0.0, 10.0, 0.0]),
}


@pytest.mark.parametrize("kind", POWERS)
def test_arrays_with_stamps_share_one_clock(kind: str) -> None:
    found = bench(loads={"heat": POWERS[kind]})
    np.testing.assert_array_equal(found.boundaries["air"].times, [0.0, 14400.0])
    np.testing.assert_array_equal(found.loads["heat"].times, [3600.0, 7200.0, 14400.0])
    again = bench().with_(loads={"heat": POWERS[kind]})
    np.testing.assert_array_equal(again.loads["heat"].times, found.loads["heat"].times)
    later = found.begun(1800.0)
    np.testing.assert_array_equal(later.with_(title="later").loads["heat"].times, [1800.0, 5400.0, 12600.0])


def test_what_begins_late_needs_a_word_on_the_time_before() -> None:
    with raises_code("run.input-missing", td.errors.ScenarioError):
        td.simulate(BOX, bench(loads={"heat": POWERS["pandas"]}, duration="4 [h]"))
    held = bench(loads={"heat": {"values": POWERS["pandas"], "before": "hold"}}, duration="4 [h]")
    assert td.simulate(BOX, held)["case"].kelvin[-1] > 293.15


def test_the_beginning_of_a_run_can_be_stated() -> None:
    for begins in ("2026-01-01 09:00", datetime(2026, 1, 1, 9), pd.Timestamp(2026, 1, 1, 9), np.datetime64("2026-01-01T09:00")):
        found = bench(loads={"heat": POWERS["pandas"]}, begins=begins)
        np.testing.assert_array_equal(found.boundaries["air"].times, [-3600.0, 10800.0])
        np.testing.assert_array_equal(found.loads["heat"].times, [0.0, 3600.0, 10800.0])
    for wrong in (5, "noon", "5 [h]", pd.NaT):
        with raises_code("record.time-not-read", td.errors.UnitError):
            bench(begins=wrong)


def test_zones_count_and_are_not_mixed_with_clocks_without_one() -> None:
    zoned = series([0.0, 10.0, 0.0], LATER, "W", "Europe/Berlin")
    air = series([20.0, 20.0], AIR, "degC", "UTC")
    found = td.Scenario("bench", boundaries={"air": air}, loads={"heat": zoned}, begins=datetime(2026, 1, 1, 8, tzinfo=UTC))
    np.testing.assert_array_equal(found.loads["heat"].times, [0.0, 3600.0, 10800.0])
    with raises_code("record.time-unclear", td.errors.ScenarioError):
        bench(loads={"heat": zoned})


def test_surroundings_are_on_the_same_clock() -> None:
    wind = pd.Series([1.0, 2.0, 3.0], index=pd.to_datetime(list(LATER)))
    found = bench(environment={"air": td.simulation.Environment(wind=wind)}, irradiation={"skin": td.simulation.Irradiation(direct=wind)})
    np.testing.assert_array_equal(found.environment["air"].wind.times, [3600.0, 7200.0, 14400.0])
    np.testing.assert_array_equal(found.irradiation["skin"].direct.times, [3600.0, 7200.0, 14400.0])  # type: ignore[union-attr]


def test_a_schedule_takes_a_series() -> None:
    found = bench(schedule={"film.conductance": series([0.8, 0.8, 0.4], LATER, "W/K")}, duration="4 [h]")
    np.testing.assert_array_equal(found.schedule["film.conductance"].times, [3600.0, 7200.0, 14400.0])


def test_the_power_of_a_series_holds_as_in_a_record_and_the_run_says_so() -> None:
    power = series([0.0, 10.0, 0.0], (AIR[0], LATER[0], AIR[1]), "W")
    scenario = bench(loads={"heat": power}, duration="4 [h]")
    assert scenario.loads["heat"].hold
    assert not scenario.boundaries["air"].hold
    run = td.simulate(BOX, scenario)
    assert [r for r in run.warnings if "loads.heat" in r]
    straight = bench(loads={"heat": {"values": power, "hold": False, "samples": "instant"}}, duration="4 [h]")
    assert not straight.loads["heat"].hold
    assert not [r for r in td.simulate(BOX, straight).warnings if "loads.heat" in r]


def test_an_index_that_counts_rows_is_no_time() -> None:
    rows = pd.DataFrame({"T": [20.0, 21.0, 22.0]})
    columns = {"T": {"unit": "degC", "node": "case"}}
    with raises_code("record.time-not-read", td.errors.RecordError):
        td.Record.from_dataframe("log", rows, columns)
    with raises_code("record.time-not-read", td.errors.RecordError):
        td.Record.from_dataframe("log", rows[1:], columns)
    with raises_code("value.wrong-kind", td.errors.ScenarioError):
        bench(loads={"heat": rows["T"]})
    minutes = rows.set_index(60.0 * rows.index)
    np.testing.assert_array_equal(td.Record.from_dataframe("log", minutes, columns).times, [0.0, 60.0, 120.0])
    assert td.Channel.from_array("T", rows["T"], unit="degC").values[0] == 293.15


DURATIONS = (timedelta(minutes=30), pd.Timedelta("30min"), np.timedelta64(30, "m"), td.quantity(0.5, unit="h"), "30 [min]", 1800, 1800.0)
RUN = td.simulate(BOX, bench(duration="4 [h]"), every="10 [min]")
LOG = td.Record.from_arrays("log", [0.0, 900.0, 1800.0, 2700.0], {"T": td.celsius([20.0, 21.0, 22.0, 23.0])})


@pytest.mark.parametrize("duration", DURATIONS, ids=lambda d: type(d).__name__)
def test_a_duration_is_read_alike_wherever_it_enters(duration: Any) -> None:
    assert bench(duration=duration).seconds == 1800.0
    assert td.simulate(BOX, bench(duration="4 [h]"), every=duration).times[1] == 1800.0
    assert td.steady(BOX, bench(duration="4 [h]"), time=duration)["case"] - 273.15 == pytest.approx(26.25)
    assert LOG.trim(duration).times[0] == 1800.0
    assert LOG.trim(end=duration).times[-1] == 1800.0
    assert LOG.resample(duration).times[1] == 1800.0
    assert LOG.median(duration).times.size == 4
    assert LOG.joined(td.Record.from_arrays("b", [0.0, 900.0], {"U": td.celsius([20.0, 21.0])}), duration).times[-1] == 2700.0
    assert td.site.pad_scenario(
        td.site.Site(45.0, 5.0), begin="2026-02-01 12:00", air_temperature="20 [degC]", sun=False, sky=False, duration=duration
    ).seconds == 1800.0  # fmt: skip
