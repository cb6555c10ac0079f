"""What a channel says of its sensor: read in units, refused by half, applied to readings."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import RecordError
from thermid.measure._record.channel import certified

ICE = 273.15


def test_keys_are_read_in_their_units() -> None:
    part = td.bench.SensorPart.read(
        {
            "gain_accuracy": "0.5 [%]",
            "lag": "2 [min]",
            "lag_accuracy": "10 [s]",
            "mass": "2 [g]",
            "specific_heat": "700 [J/(kg K)]",
            "lead": {"conductance": "0.5 [mW/K]", "to": "air"},
            "range": ["-55 [degC]", "125 [degC]"],
            "certificate": {"offset": "0.1 [K]", "uncertainty": "0.05 [K]", "at": "25 [degC]"},
        },
        "T1",
    )
    assert part is not None
    assert (part.gain_accuracy, part.lag, part.lag_accuracy) == (0.005, 120.0, 10.0)
    assert part.capacitance == pytest.approx(1.4)
    assert (part.lead_conductance, part.lead_to) == (0.0005, "air")
    assert (part.low, part.high) == pytest.approx((ICE - 55, ICE + 125))
    assert part.gain_about == pytest.approx(ICE + 25)  # of a sensor compared at 25 C the scale turns there
    assert td.bench.SensorPart.read({"noise": "0.1 [K]"}, "T1") is None


@pytest.mark.parametrize(
    ("table", "code", "match"),
    [
        ({"mass": "2 [g]"}, "value.incomplete", "specific_heat"),
        ({"mass": "2 [g]", "specific_heat": "700 [J/(kg K)]", "capacitance": "1 [J/K]"}, "value.incomplete", "T1.*specific_heat"),
        ({"lag": "-3 [s]"}, "value.outside-range", "-3"),
        ({"lag": "3 [K]"}, "unit.wrong-dimension", r"'\[K\]'"),
        ({"lag_accuracy": "3 [s]"}, "value.incomplete", "lag_accuracy"),
        ({"lead": {"conductance": "1 [W/K]"}}, "value.incomplete", "T1.*'air'"),
        ({"lead": {"conductance": "-1 [W/K]", "to": "air"}}, "value.outside-range", "-1"),
        ({"lead": {"conductanc": "1 [W/K]", "to": "air"}}, "name.unknown", "'conductanc'.*'conductance'"),
        ({"range": "125 [degC]"}, "value.wrong-kind", r"T1.*'125 \[degC\]'.*\['-55 \[degC\]"),
        ({"range": ["125 [degC]", "-55 [degC]"]}, "value.outside-range", r"T1.*\[degC\].*-55"),
        ({"certificate": "0.1 [K]"}, "value.wrong-kind", r"T1.*'0\.1 \[K\]'"),
        ({"certificate": {"offset": "0.1 [K]"}}, "value.incomplete", r"T1.*'0\.1 \[K\]'"),
        ({"certificate": {"offset": "0.1 [K]", "uncertainty": "0 [K]"}}, "value.outside-range", "T1"),
    ],
)
def test_half_a_statement_is_refused(table: dict[str, object], code: str, match: str) -> None:
    with raises_code(code, match=match):
        td.bench.SensorPart.read(table, "T1")


@pytest.mark.parametrize(
    ("accuracy", "mean", "sd"),
    [(None, 0.4, 0.05), (0.05, 0.2, 0.05 / np.sqrt(2)), (0.5, 0.4 * 0.25 / 0.2525, 0.05 * np.sqrt(0.25 / 0.2525))],
)
def test_a_certificate_and_the_accuracy_of_the_type_say_it_together(accuracy: float | None, mean: float, sd: float) -> None:
    channel = td.Channel.from_array("T", np.array([300.0, 301.0]), unit="K", accuracy=accuracy)
    made, said = certified(channel, td.bench.SensorCertificate(0.4, 0.05))
    assert made.values == pytest.approx(channel.values - mean)
    assert made.accuracy == pytest.approx(sd)
    assert bool(re.search(r" 5\.7 ", said)) == (accuracy == 0.05), "the offset over the accuracy of the type"


def test_a_log_is_read_with_its_sensor_applied(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("time_s,T\n0,20\n1,85\n2,21\n3,130\n4,22\n", encoding="utf-8")
    told = {"node": "case", "range": ["-55 [degC]", "125 [degC]"], "certificate": {"offset": "0.2 [K]", "uncertainty": "0.1 [K]"}}
    record = td.read_record(tmp_path / "log.csv", {"T": told})
    assert record["T"].values[0] == pytest.approx(ICE + 19.8)
    assert record["T"].flags == {"out of range": 1}
    assert len(record.steps) == 2
    # a fault code is what the sensor said, whatever the certificate makes of it
    assert record.flag_faults()["T"].flags == {"out of range": 1, "fault": 1}


def test_the_same_keys_serve_in_python() -> None:
    record = td.Record.from_arrays("r", np.arange(3.0), {"T": np.array([300.0, 301.0, 400.0])}, unit="K")
    made = record.with_sensor("T", lag="20 [s]", range=["-55 [degC]", "125 [degC]"])
    assert made["T"].part is not None
    assert made["T"].part.lag == 20.0
    assert made["T"].flags == {"out of range": 1}
    with raises_code("name.unknown", RecordError, match="'lagg'.*'lag'"):
        record.with_sensor("T", lagg="20 [s]")
    power = td.Record.from_arrays("r", np.arange(3.0), {"P": td.Channel.from_array("P", np.ones(3), quantity="power")})
    with raises_code("record.does-not-apply", RecordError, match="lag_accuracy"):
        power.with_sensor("P", lag="20 [s]")
