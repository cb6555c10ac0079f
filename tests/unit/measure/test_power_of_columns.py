"""Powers as they are measured: volts and amperes, formulas of columns, counters of energy, duty times a measured supply."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import ThermidError

ROWS = (
    "time [s],V_IN [V],I_IN [mA],D [%],P [W],E [Wh],T [degC],U",
    "0,24,500,0,12,100,22,1",
    "10,24,500,50,12,100.0333333,22,1",
    "20,12,250,100,3,100.0416667,22,1",
    "30,12,,100,3,0.0083333,22,1",
    "40,12,250,100,3,0.0166667,22,1",
)


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path = tmp_path / "log.csv"
    path.write_text("\n".join(ROWS) + "\n")
    return path


def power(log: Path, given: object, **more: object) -> td.Channel:
    return td.read_record(log, {"P_IN": {"load": "box.heater", "power": given, **more}})["P_IN"]


def test_volts_times_amperes_are_watts_and_a_missing_reading_stays_missing(log: Path) -> None:
    found = power(log, {"volts": "V_IN", "amperes": "I_IN"}, accuracy="0.1 [W]")
    np.testing.assert_allclose(found.values[found.valid], [12.0, 12.0, 3.0, 3.0])
    assert list(found.valid) == [True, True, True, False, True]
    assert (found.quantity, found.role, found.target, found.unit, found.accuracy) == ("power", "load", "box.heater", "W", 0.1)


@pytest.mark.parametrize(
    ("given", "watts"),
    [
        ("V_IN * I_IN", [12.0, 12.0, 3.0, 3.0]),
        ("0.6 * P", [7.2, 7.2, 1.8, 1.8]),  # a known share of one power
        ("D * V_IN * I_IN", [0.0, 6.0, 3.0, 3.0]),
        ("V_IN**2 / 48 [ohm] - 100 [mW]", [11.9, 11.9, 2.9, 2.9]),
        ({"volts": "V_IN", "ohms": "48 [ohm]"}, [12.0, 12.0, 3.0, 3.0]),
        ({"amperes": "I_IN", "ohms": "48 [ohm]"}, [12.0, 12.0, 3.0, 3.0]),
        ({"volts": "V_IN", "amperes": "I_IN", "duty": "D"}, [0.0, 6.0, 3.0, 3.0]),
        ({"volts": "V_IN", "amperes": "0.5 [A]", "share": "0.25"}, [3.0, 3.0, 1.5, 1.5]),
    ],
)
def test_a_formula_of_columns_with_units(log: Path, given: object, watts: list[float]) -> None:
    np.testing.assert_allclose(power(log, given).values[[0, 1, 2, 4]], watts)


def test_an_ending_of_a_name_is_its_unit(log: Path) -> None:
    log.write_text("time [s],P_W,U_V,I_A,rest\n0,5,10,0.5,1\n10,6,12,0.5,2\n")
    for formula in ("0.5 * P_W", "0.5 * U_V * I_A"):
        assert power(log, formula).values.tolist() == [2.5, 3.0]
    log.write_text("time [s],supply V,supply A\n0,10,0.5\n10,12,0.5\n")
    half = "0.5 * `supply V` * `supply A`"
    assert power(log, half).values.tolist() == [2.5, 3.0]
    log.write_text("time [s],rest\n0,1\n10,2\n")
    with raises_code("record.unit-unclear", match=r"log\.csv.*channels\.P_IN.*'rest'"):
        power(log, "0.5 * rest")


def test_a_counter_of_energy_is_the_mean_since_the_stamp_before_and_its_restart_is_masked(log: Path) -> None:
    found = power(log, {"energy": "E"})
    np.testing.assert_allclose(found.values[[0, 1, 2, 4]], [12.0, 12.0, 3.0, 3.0], rtol=1e-4)
    assert found.samples == "average"
    assert list(found.valid) == [True, True, True, False, True]
    assert found.flags == {"counter restarted": 1}


@pytest.mark.parametrize(
    ("given", "more", "code", "words"),
    [
        ("V_IN + I_IN", {}, "expression.mixed-dimensions", "V_IN + I_IN"),
        ("V_IN * D", {}, "unit.wrong-dimension", "V_IN * D"),
        ("V_IN * I_OUT", {}, "name.unknown", "'I_OUT'"),
        ("V_IN * U * I_IN", {}, "record.unit-unclear", "'U' "),
        ({"volts": "V_IN"}, {}, "value.incomplete", "volts"),
        ({"volts": "V_IN", "amps": "I_IN"}, {}, "name.unknown", "'amps'"),
        ({"energy": "E", "volts": "V_IN"}, {}, "name.unknown", "'volts'"),
        ("12 [W]", {}, "value.wrong-kind", "'12 [W]'"),
        ("V_IN * I_IN", {"full_scale": "3 [W]"}, "value.incomplete", "full_scale"),
        ({"volts": "I_IN", "amperes": "I_IN"}, {}, "unit.wrong-dimension", "'I_IN'"),
    ],
)
def test_what_is_no_power_is_refused_with_its_reason(log: Path, given: object, more: dict[str, object], code: str, words: str) -> None:
    with raises_code(code) as found:
        power(log, given, **more)
    assert words in str(found.value)
    assert "P_IN" in str(found.value)


def test_a_power_of_columns_is_of_a_load(log: Path) -> None:
    with raises_code("value.incomplete"):
        td.read_record(log, {"P_IN": {"node": "box", "power": "V_IN * I_IN"}})


def test_a_boundary_may_be_the_mean_of_several_thermometers(log: Path) -> None:
    """Two columns of one boundary are refused, and nothing stated their mean."""
    log.write_text("time [s],Shroud 1 [degC],Shroud 2,P\n0,-40,-44,1\n10,-50,-52,1\n")
    mean = {"boundary": "shroud", "temperature": "(`Shroud 1` + `Shroud 2`) / 2", "accuracy": "0.5 [K]"}
    found = td.read_record(log, {"wall": mean})["wall"]
    np.testing.assert_allclose(found.values, [231.15, 222.15])
    assert (found.quantity, found.role, found.target, found.accuracy) == ("temperature", "boundary", "shroud", 0.5)
    for wrong in ({**mean, "temperature": "`Shroud 1` * `Shroud 2`"}, {**mean, "boundary": "shroud", "temperature": "2 [K]"}):
        with pytest.raises(ThermidError, match="wall, temperature"):
            td.read_record(log, {"wall": wrong})
    with raises_code("value.incomplete"):
        td.read_record(log, {"wall": {"load": "heat", "temperature": "P"}})


@pytest.mark.parametrize("role", ["node", "boundary"])
def test_an_ntc_in_counts_is_a_formula_with_a_logarithm(log: Path, role: str) -> None:
    """A reader's capture held counts of dividers, and no formula could convert them; the ends of the range are open or shorted."""
    log.write_text("time [s],CNT\n0,541\n10,352\n20,0\n30,1023\n40,\n")
    ntc = {"formula": "1 / (1 / 298.15 [K] + log(CNT / (1023 - CNT)) / 3950 [K])", "units": {"CNT": "1"}}
    found = td.read_record(log, {"sink": {role: "sink", "temperature": ntc}})["sink"]
    expected = [1.0 / (1.0 / 298.15 + np.log(c / (1023.0 - c)) / 3950.0) for c in (541.0, 352.0)]
    np.testing.assert_allclose(found.values[:2], expected)
    assert list(found.valid) == [True, True, False, False, False]
    with raises_code("expression.mixed-dimensions") as plain:
        td.read_record(log, {"sink": {role: "sink", "temperature": ntc["formula"]}})
    assert "units = { CNT = '1' }" in str(plain.value)
    for wrong in ({"volts": "CNT"}, {**ntc, "volts": "CNT"}, {**ntc, "units": {"CNT": "V"}}, {}, " ", 3):
        with pytest.raises(ThermidError):
            td.read_record(log, {"sink": {role: "sink", "temperature": wrong}})


def test_counts_of_two_converters_are_looked_at_alike(tmp_path: Path) -> None:
    """One of them was asked for its unit, since its name is of a sink; degC would have been 541 of them."""
    path = tmp_path / "counts.csv"
    path.write_text("time [s],sink_cnt,batt_cnt,ADC1\n" + "".join(f"{k},{541 - k % 3},{559 + k % 4},{700 + k % 5}\n" for k in range(9)))
    assert {(c.guess, c.unit) for c in td.look(path).columns if c.name != "time"} == {("ignored", "")}
    assert len({c.why for c in td.look(path).columns if c.name != "time"}) == 1


def test_units_may_be_given_where_the_log_has_none(log: Path) -> None:
    found = power(log, {"formula": "V_IN * I_IN * U", "units": {"U": "1"}})
    np.testing.assert_allclose(found.values[0], 12.0)


def test_columns_with_spaces_stand_in_a_table_or_between_backticks(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("time [s],Supply V [V],Supply I [A]\n0,10,1\n10,10,2\n")
    np.testing.assert_allclose(power(path, {"volts": "Supply V", "amperes": "Supply I"}).values, [10.0, 20.0])
    np.testing.assert_allclose(power(path, "`Supply V` * `Supply I`").values, [10.0, 20.0])


def test_a_meter_of_alternating_current_is_one_power_and_a_speed_says_what_it_is_for(tmp_path: Path) -> None:
    watts = np.repeat([0.0, 18.3, 9.1], 10)
    rows = [f"{60 * k},230.{k % 10},{w / (0.92 * 230.0):.4f},{w:.2f},{1200 + k}" for k, w in enumerate(watts)]
    (tmp_path / "meter.csv").write_text("\n".join(["time_s,U [V],I [A],P [W],fan_rpm", *rows]))
    seen = td.look(tmp_path / "meter.csv")
    assert not seen.supplies
    assert 'load = "P"' in seen.campaign()
    (fan,) = [c for c in seen.columns if c.name == "fan_rpm"]
    assert fan.unit == "rpm"
    assert "schedule" in fan.why
    rows = [f"{60 * k},24.{k % 10},{w / 24.0:.4f},{1.0 + (k % 3)}" for k, w in enumerate(watts)]
    (tmp_path / "two.csv").write_text("\n".join(["time_s,U [V],I [A],P_FAN [W]", *rows]))
    assert td.look(tmp_path / "two.csv").supplies


def test_each_supply_of_a_meter_with_watts_is_one_power(tmp_path: Path) -> None:
    """Of two supplies with volts, amperes and watts each, every power was proposed twice, and a common step added both."""
    watts = {"proc": np.repeat([0.0, 18.3, 9.1], 10), "gyro": np.repeat([6.0, 0.0, 3.0], 10)}
    head = ["time_s", *(f"{n} {unit}" for n in watts for unit in ("[V]", "A [A]", "W [W]"))]
    rows = [[f"{60 * k}", *(f"{x:.4f}" for p in watts.values() for x in (24.0 + k % 2, p[k] / 24.5, p[k]))] for k in range(30)]
    (tmp_path / "two.csv").write_text("\n".join(",".join(row) for row in [[c.replace(" [V]", " V [V]") for c in head], *rows]))
    seen = td.look(tmp_path / "two.csv")
    assert not seen.supplies
    assert [c.name for c in seen.courses()] == ["proc W", "gyro W"]


def test_a_duty_that_follows_a_measured_power_is_no_second_power(tmp_path: Path) -> None:
    """A load of 100 % beside its 48 W was a power of its own, so a common step had the same heat twice."""
    duty = np.repeat([0.0, 100.0, 50.0], 10)
    rows = [f"{60 * k},{48.0 + 0.01 * (k % 3)},{0.01 * d},{d}" for k, d in enumerate(duty)]
    (tmp_path / "drive.csv").write_text("\n".join(["time_s,U [V],I [A],LOAD [%]", *rows]))
    seen = td.look(tmp_path / "drive.csv")
    assert [c.name for c in seen.courses()] == ["U * I"]
    assert "LOAD" in seen.campaign()
