"""A log and a scenario that both have stamps share one clock, however each was given."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import thermid as td
from by_code import raises_code

C, G = "case.capacitance", "loss.conductance"
MODEL = td.model_from_dict(
    {
        "title": "box",
        "needs": ["air"],
        "nodes": {"case": {"capacitance": "400 [J/K]"}},
        "conductors": {
            "loss": {"kind": "conduction", "between": ["case", "air"], "conductance": {"value": "0.8 [W/K]", "min": 0.05, "max": 8}}
        },
        "loads": {"heat": {"into": "case", "power": "6 [W]"}},
    }
)
STAMPS = pd.date_range("2026-02-01 08:00", periods=121, freq="60s")
WARMED = pd.Series(np.where(np.arange(121) < 60, 20.0, 25.0), index=STAMPS)
AIR = td.quantity(WARMED, unit="degC")
ROOM = td.Scenario("room", boundaries={"air": AIR}, start="air", duration="2 [h]")
LATE = 30
"""Minutes after the room's series at which the log begins."""


def _readings() -> pd.DataFrame:
    run = td.simulate(MODEL, ROOM, every="60 [s]")
    noise = 0.02 * np.random.default_rng(1).standard_normal(STAMPS.size)
    return pd.DataFrame({"T": run["case"].celsius + noise}, index=STAMPS)[LATE:]


def _fitted(record: td.Record) -> td.Calibration:
    return td.calibrate(MODEL, record, [C, G], scenario=td.Scenario("room", boundaries={"air": AIR}))


def _from_frame() -> td.Record:
    return td.Record.from_dataframe("log", _readings(), {"T": {"unit": "degC", "node": "case", "noise": "0.02 [K]"}})


def _from_file(folder: Path, form: str = "%Y-%m-%d %H:%M:%S") -> td.Record:
    _readings().to_csv(folder / "log.csv", index_label="time", date_format=form)
    channels = {"T": {"node": "case", "noise": "0.02 [K]"}}
    return td.read_record(folder / "log.csv", channels, time="time", units={"T": "degC"})


def test_a_log_that_begins_later_is_fitted_with_the_room_of_its_own_hours(tmp_path: Path) -> None:
    for record in (_from_frame(), _from_file(tmp_path), _from_frame().trim("10 [min]", "end")):
        fit = _fitted(record)
        assert fit[C].value == pytest.approx(400.0, rel=0.02)
        assert fit[G].value == pytest.approx(0.8, rel=0.01)


def test_the_same_holds_for_a_history_of_powers() -> None:
    history = td.inference.power_history(
        MODEL, _from_frame(), "heat", scenario=td.Scenario("room", boundaries={"air": AIR}), every="10 [min]"
    )
    assert history.power[2:-2] == pytest.approx(6.0, abs=0.3)


def test_a_steady_point_has_the_room_of_its_own_hours() -> None:
    """It is 25 degC in its stretch and 20 degC at both beginnings."""
    room = td.Scenario("room", boundaries={"air": AIR})
    balance = td.inference.energy_balance(MODEL, _from_frame(), "80 [min]", "90 [min]", scenario=room, limit="2 [K/h]")
    assert balance.unexplained["case"][0] == pytest.approx(0.0, abs=0.05)
    point = _from_frame().steady("80 [min]", "90 [min]", limit="2 [K/h]").record
    fit = td.calibrate(MODEL, point, [G], scenario=td.Scenario("room", boundaries={"air": AIR}, start="steady"))
    assert fit[G].value == pytest.approx(0.8, rel=0.02)


def test_stamps_that_cannot_be_compared_are_refused(tmp_path: Path) -> None:
    zoned = td.quantity(WARMED.tz_localize("UTC"), unit="degC")
    with raises_code("record.time-unclear", td.ThermidError, match="2026-02-01 08:30:00"):
        td.calibrate(MODEL, _from_frame(), [G], scenario=td.Scenario("room", boundaries={"air": zoned}))
    with raises_code("record.does-not-apply", td.ThermidError, match="shift_start"):
        _fitted(_from_frame().shift_start())
    with raises_code("record.time-unclear", td.ThermidError, match="28.02.2026 08:30:00"):
        _fitted(_from_file(tmp_path, "28.%m.%Y %H:%M:%S"))


def test_logs_with_stamps_are_joined_by_them(tmp_path: Path) -> None:
    """Without an offset; one that is given counts from the first samples, as before."""
    first = _from_frame()
    switched = pd.DataFrame({"P": np.where(np.arange(121) < 60, 0.0, 6.0)}, index=STAMPS)
    power = td.Record.from_dataframe("power", switched, {"P": {"unit": "W", "load": "heat"}})
    joint = first.joined(power)
    assert joint.times[np.flatnonzero(joint["P"].values == 6.0)[0]] == 1800.0  # 09:00 on a clock that begins at 08:30
    assert np.array_equal(first.joined(power, 0.0).times, np.arange(121) * 60.0)
    again = td.Record.from_arrays("again", first.times, {"Q": td.celsius(np.full(first.times.size, 20.0))})
    assert np.array_equal(first.joined(again).times, first.times)
    german = _from_file(tmp_path, "28.%m.%Y %H:%M:%S")
    with raises_code("record.time-unclear", td.ThermidError, match="28.02.2026 08:30:00"):
        german.joined(power)
    at_once = td.Record.from_arrays("at once", STAMPS[LATE:], {"Q": td.celsius(np.full(first.times.size, 20.0))})
    later = first.trim("10 [min]", "end").shift_start()
    with raises_code("record.time-unclear", td.ThermidError, match="2026-02-01 08:30:00"):
        later.joined(at_once)  # its zero is no more that of the other, though both logs begin at one instant
    assert np.array_equal(later.joined(at_once.trim("10 [min]", "end").shift_start()).times, later.times)


def test_a_log_keeps_its_clock_where_the_other_one_is_counted_anew() -> None:
    watts = td.Record.from_dataframe("power", pd.DataFrame({"P": np.full(121, 6.0)}, index=STAMPS), {"P": {"unit": "W", "load": "heat"}})
    joint = _from_frame().joined(watts.trim("30 [min]", "end").shift_start(), "0 [s]")
    assert _fitted(joint)[G].value == pytest.approx(0.8, rel=0.01)
