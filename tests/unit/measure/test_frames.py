"""Records of pandas frames: measured unless said otherwise, units and roles stated, and the way back."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import ThermidError

pandas = pytest.importorskip("pandas")
CHANNELS: dict[str, dict[str, Any]] = {
    "T1": {"unit": "degC", "node": "case", "noise": "0.1 [K]", "accuracy": "0.5 [K]"},
    "room": {"unit": "degC", "boundary": "air"},
    "P": {"unit": "mW", "load": "heat"},
}


def frame(**more: Any) -> Any:
    columns = {"T1": [20.0, 21.0, np.nan, 23.0], "room": [20.0] * 4, "P": [0.0, 1500.0, 1500.0, 1500.0]}
    return pandas.DataFrame({**columns, **more}, index=[0.0, 10.0, 20.0, 30.0])


def test_it_is_measured_unless_said_otherwise() -> None:
    record = td.Record.from_dataframe("bench", frame(), CHANNELS)
    assert not record.origin.synthetic
    assert td.Record.from_dataframe("bench", frame(), CHANNELS, synthetic=True).origin.synthetic
    case = record["T1"]
    assert (case.role, case.target, case.noise, case.accuracy) == ("node", "case", pytest.approx(0.1), pytest.approx(0.5))
    assert case.values[0] == pytest.approx(293.15)
    assert case.valid.tolist() == [True, True, False, True]
    assert record["P"].values[1] == pytest.approx(1.5)
    assert record["P"].quantity == "power"


def test_a_table_of_a_frame_takes_what_a_campaign_says_of_a_sensor() -> None:
    """Resolution, lag and the other keys were refused, and nothing else took a resolution."""
    known = {"T1": {**CHANNELS["T1"], "resolution": "0.0625 [K]", "lag": "20 [s]"}}
    case = td.Record.from_dataframe("bench", frame(), known)["T1"]
    assert case.resolution == pytest.approx(0.0625)
    assert case.part is not None
    assert case.part.lag == pytest.approx(20.0)


@pytest.mark.parametrize(("text", "factor"), [("rpm", np.pi / 30.0), ("A", 1.0), ("1", 1.0), ("degC", 1.0)])
def test_a_column_may_give_a_value_over_time_in_any_unit(text: str, factor: float) -> None:
    """A fan's speed in rpm and a current in A were refused as "no unit of a "."""
    values = td.Record.from_dataframe("log", frame(), {"P": {"unit": text, "schedule": "fan.speed"}})["P"]
    assert (values.role, values.unit) == ("schedule", text)
    assert values.values[1] - values.values[0] == pytest.approx(1500.0 * factor)


def test_there_and_back() -> None:
    back = td.Record.from_dataframe("bench", frame(), CHANNELS).to_frame()
    assert back.columns.tolist() == list(CHANNELS)
    assert np.allclose(back.to_numpy(), frame().to_numpy(), equal_nan=True)


@pytest.mark.parametrize("column", [True, False])
def test_stamps_count_from_the_first(column: bool) -> None:
    stamps = pandas.to_datetime(["2026-11-22 10:00:00", "2026-11-22 10:00:10", "2026-11-22 10:01:00", "2026-11-22 10:02:00"])
    made = frame(when=stamps) if column else frame().set_index(stamps)
    record = td.Record.from_dataframe("bench", made, CHANNELS, time="when" if column else None)
    assert record.times.tolist() == [0.0, 10.0, 60.0, 120.0]


@pytest.mark.parametrize(
    ("channels", "change", "code", "words"),
    [
        ({"T2": {"unit": "degC", "node": "case"}}, {}, "name.unknown", "'T2'.*'T1'"),
        ({"T1": {"node": "case"}}, {}, "value.incomplete", ""),
        ({"T1": {"unit": "degC"}}, {}, "value.incomplete", ""),
        ({"T1": {"unit": "W", "node": "a"}}, {}, "unit.wrong-dimension", "'W'"),
        ({"T1": {"unit": "degC", "node": "a", "nois": "0.1 [K]"}}, {}, "name.unknown", "'nois'"),
        ({"T1": {"unit": "degC", "node": "a"}}, {"index": [0.0, 10.0, 10.0, 30.0]}, "record.time-order", ""),
        ({"T1": {"unit": "degC", "node": "a"}}, {"index": ["a", "b", "c", "d"]}, "record.time-not-read", ""),
    ],
)
def test_what_is_wrong_is_said(channels: dict[str, Any], change: dict[str, Any], code: str, words: str) -> None:
    made = frame()
    if "index" in change:
        made.index = change["index"]
    with raises_code(code, ThermidError, match=words):
        td.Record.from_dataframe("bench", made, channels)
