from __future__ import annotations

import pickle
import re
from pathlib import Path

import numpy as np
import pytest

from by_code import raises_code
from thermid.base.errors import NameNotFoundError, RecordError, UnitError
from thermid.measure._readers.log_reader import read_record
from thermid.measure._record.channel import Channel, Origin
from thermid.measure._record.record import Record


def made(**fields) -> Record:
    return Record.from_arrays("bench", np.arange(5.0), {"case": [300.0, 301, np.nan, 303, 304], **fields}, unit="K")


def test_from_arrays_is_synthetic_and_has_an_identity():
    one, two = made(), made()
    assert one.origin.synthetic
    assert one.origin.sha256 == two.origin.sha256
    assert one.origin.columns == ("time", "case")
    assert one["case"].flags == {"not a number": 1}
    other = Record.from_arrays("x", np.arange(5.0), {"case": [300.0, 301, np.nan, 303, 304.0000001]}, unit="K")
    assert other.origin.sha256 != one.origin.sha256
    assert re.fullmatch(r"Record 'bench': \w+, 5 \w+ \w+ 4 s, \w+ 1 s; \w+ case", repr(one))


def test_hash_has_one_form_of_nan_and_zero():
    sha = {
        Record.from_arrays("x", [0.0, 1, 2], {"a": [1.0, zero, nan]}, unit="K").origin.sha256
        for zero in (0.0, -0.0)
        for nan in (np.nan, -np.nan)
    }
    assert len(sha) == 1


def test_the_samples_cannot_be_changed():
    given = np.array([300.0, 301, 302])
    record = Record.from_arrays("x", [0, 1, 2], {"a": given}, unit="K")
    given[0] = 0
    assert record["a"].values[0] == 300
    for array in (record.times, record["a"].values, record["a"].valid):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
    with pytest.raises(AttributeError):
        record.name = "y"


def test_channel_by_name():
    with raises_code("name.unknown", NameNotFoundError, match="'bench'.*'cas'.*'case'"):
        made().channel("cas")


def test_with_channels_and_select():
    record = made().with_channels(Channel.from_array("air", np.full(5, 295.0), unit="K", role="boundary", target="room"))
    assert list(record.channels) == ["case", "air"]
    assert list(record.select("air").channels) == ["air"]
    assert record.origin == made().origin


@pytest.mark.parametrize(
    ("make", "code", "match"),
    [
        (
            lambda: Record.from_arrays("r", [0, 1, 1, 2], {"a": np.ones(4)}, unit="K"),
            "record.time-order",
            "'r'.*1.*1.*3",
        ),
        (
            lambda: Record.from_arrays("r", [0.0], {"a": [1.0]}, unit="K"),
            "record.shape",
            "'r'.*1",
        ),
        (
            lambda: Record.from_arrays("r", [0, np.nan], {"a": [1.0, 2]}, unit="K"),
            "record.shape",
            "'r'.*2",
        ),
        (lambda: Record.from_arrays("r", [0, 1], {"a": [1.0]}, unit="K"), "record.shape", "'r'.*'a'.*1.*2"),
        (lambda: Record.from_arrays("r", [0], {"b": Channel.from_array("a", [1.0], unit="K")}), "record.shape", "'r'.*1"),
        (
            lambda: Record.from_arrays("r", [0, 1], {"b": Channel.from_array("a", [1.0, 2], unit="K")}),
            "record.name-twice",
            "'r'.*'a'.*'b'",
        ),
        (
            lambda: Channel.from_array("a", [[1.0]], unit="K"),
            "record.shape",
            "'a'",
        ),
        (
            lambda: Channel("a", np.ones(2), np.ones(3, bool)),
            "record.shape",
            "'a'",
        ),
        (lambda: Channel("a", np.array([1.0, np.nan]), np.ones(2, bool)), "record.shape", "'a'"),
        (
            lambda: Channel.from_array("a", [1.0], unit="K", role="nod"),
            "name.unknown",
            "'a'.*'nod'.*'node'",
        ),
        (
            lambda: Channel.from_array("a", [1.0], unit="K", resolution=0.0),
            "value.outside-range",
            "'a'.*0",
        ),
    ],
)
def test_messages(make, code, match):
    with raises_code(code, RecordError, match=match):
        make()


def test_table_of_a_temperature_bridges_by_lines():
    record = made()
    times, values, bridged = record.table("case")
    assert times.tolist() == [0, 1, 3, 4]
    assert values.tolist() == [300, 301, 303, 304]
    assert bridged == pytest.approx(0.5)


def test_table_covers_the_whole_record():
    channel = Channel.from_array("case", [np.nan, 301, 302, 303, np.nan], unit="K")
    times, values, bridged = made(case=channel).table("case")
    assert times.tolist() == [0, 1, 2, 3, 4]
    assert values.tolist() == [301, 301, 302, 303, 303]
    assert bridged == pytest.approx(0.5)


def test_table_of_a_held_channel_and_of_a_gap():
    power = Channel.from_array("p", [1.0, np.nan, 2, 3, 4], quantity="power")
    assert made(p=power).table("p").bridged == pytest.approx(0.25)
    assert made(p=power).table("p").times.tolist() == [0, 2, 3, 4]
    record = Record.from_arrays("gap", [0.0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 89, 90], {"case": np.arange(14.0) + 300}, unit="K")
    assert record.table("case").bridged == pytest.approx(78 / 90)
    assert record.table("case", max_gap="2 [min]").bridged == 0


def test_xarray_has_units_and_masks_as_nan():
    pytest.importorskip("xarray")
    power = Channel.from_array("p", np.ones(5), quantity="power", role="load", target="heater", noise=0.1)
    heat = Channel.from_array("q", np.ones(5), quantity="heat flux", unit="W/m^2")
    data = made(p=power, q=heat).mask("case", 0, 0).to_xarray()
    assert np.isnan(data["case"].values).tolist() == [True, False, True, False, False]
    assert data["case"].attrs["units"] == "K"
    assert data["time"].attrs["units"] == "s"
    assert data["p"].attrs == {"units": "W", "quantity": "power", "role": "load", "target": "heater", "noise": 0.1}
    assert data["q"].attrs["units"] == "kg s^-3"
    assert data.attrs["sha256"] == made(p=power, q=heat).origin.sha256


def test_a_record_can_go_to_another_process():
    record = made().mask("case", 0, 0, "bad")
    copy = pickle.loads(pickle.dumps(record))
    assert copy.origin == record.origin == Origin(**record.origin.__dict__)
    assert copy["case"].flags == record["case"].flags
    assert np.array_equal(copy["case"].values, record["case"].values, equal_nan=True)


@pytest.mark.parametrize("by", [3.0, 10.0, -25.5, (0.0, 7.0)])
def test_the_step_is_that_of_the_readings_whatever_lies_between_them(by: float | tuple[float, float]) -> None:
    """Delays and joined logs put the times of another clock between the readings; the readings come as often as before."""
    times = 10.0 * np.arange(40.0)
    power = Channel.from_array("p", np.ones(40), quantity="power", role="load", target="heater")
    record = Record.from_arrays("bench", times, {"case": 300.0 + np.sqrt(times), "p": power}, unit="K")
    slow = Record.from_arrays("room", 60.0 * np.arange(7.0), {"room": np.full(7, 295.0)}, unit="K")
    assert record.delayed(by).step == record.step == 10.0
    assert record.joined(slow, 3.0).step == slow.joined(record, -3.0).step == 10.0
    assert record.mask("case", 100, 200).delayed(by).step == 10.0


def test_sizes_of_a_channel_are_amounts_with_their_units() -> None:
    channel = Channel.from_array("T", [20.0, 21.0], unit="degC", noise="50 [mK]", accuracy="500 [mK]", resolution=0.0625)
    assert (channel.noise, channel.accuracy, channel.resolution) == pytest.approx((0.05, 0.5, 0.0625))
    power = Channel.from_array("P", [1.0, 2.0], unit="W", quantity="power", noise="20 [mW]")
    assert power.noise == pytest.approx(0.02)
    with raises_code("unit.wrong-dimension", UnitError, match="'T'"):
        Channel.from_array("T", [20.0, 21.0], unit="degC", noise="1 [W]")
    with raises_code("value.not-an-amount", UnitError):
        Channel.from_array("T", [20.0, 21.0], unit="degC", accuracy=[0.5])


def test_a_scheduled_speed_holds_when_a_record_is_resampled() -> None:
    """A fan that was switched on at 600 s was taken to speed up from the start of its log, without a word."""
    speed = Channel.from_array("FAN", [0.0, 1500.0, 1500.0], unit="rpm", quantity="angular speed", role="schedule", target="speed")
    log = Record.from_arrays("fan", np.array([0.0, 600.0, 900.0]), {"FAN": speed})
    values = log.resample("100 [s]")["FAN"].values
    assert set(np.round(values / speed.values[-1], 9)) == {0.0, 1.0}


def test_a_share_of_a_power_in_watts_is_a_power(tmp_path: Path) -> None:
    """`gain` of a column in watts made it a duty, and the message asked for the wrong cure."""
    (tmp_path / "meter.csv").write_text("time [s],P [W]\n0,0\n10,5\n20,5\n")
    shared = read_record(tmp_path / "meter.csv", {"P": {"load": "heat", "gain": "share"}})["P"]
    assert (shared.quantity, shared.role, shared.values.tolist()) == ("power", "load", [0.0, 5.0, 5.0])
