"""The reader and the preparation against real logs, which stay outside the repository; each figure is from the SOURCE.md beside its log."""

from __future__ import annotations

import re

import numpy as np
import pytest

from by_code import raises_code
from thermid.base.errors import RecordError
from thermid.measure._readers.log_reader import read_record

TCLAB = {
    "T1_C": {"node": "h1.sensor", "noise": "0.3 [K]", "accuracy": "1 [K]"},
    "T2_C": {"node": "h2.sensor"},
    "Q1_pct": {"load": "h1.heater", "gain": "h1.alpha"},
    "Q2_pct": {"load": "h2.heater", "gain": "h2.alpha"},
}
STEP = 0.48876  # K, one step of the 10-bit converter at 5 V


@pytest.mark.parametrize(
    ("file", "rows", "duration"),
    [
        ("step/ensH1_000_050_en1.csv.gz", 4801, 1200),
        ("step0to50/ens_IdentificacaoH1_0to50_01.csv.gz", 8801, 2200),
        ("random_H1/ens_IdentificationH1_Random_01.csv.gz", 30803, 7700),
        ("random_H1H2/ens_IdentificationH1H2_Random_01.csv.gz", 30803, 7700),
    ],
)
def test_tclabsp_rows_step_and_filler(shared, file, rows, duration):
    record = read_record(shared / "tclabsp" / file, TCLAB)
    assert record.origin.rows == rows
    # the stamp 700.00 of the random runs comes three times
    assert record.times.size == rows - (2 if rows == 30803 else 0)
    assert record.duration == pytest.approx(duration, abs=1)
    assert np.diff(record.times) == pytest.approx(0.25, abs=1e-9)
    # the first two samples of every run are the filler 23.00
    assert record["T1_C"].values[:2].tolist() == record["T2_C"].values[:2].tolist() == [296.15, 296.15]
    assert record.trim("0.5 [s]").times[0] == 0.5
    assert record.trim("0.5 [s]").origin == record.origin


def test_tclabsp_spikes_are_flagged_and_a_median_of_4_s_removes_them(shared):
    record = read_record(shared / "tclabsp/step/ensH1_000_050_en1.csv.gz", TCLAB).trim("2 [s]")
    # single-sample spikes of several to tens of degrees, many at sensor 2
    wild = {name: np.abs(record[name].values - record.median("4 [s]")[name].values) > 6.0 for name in ("T1_C", "T2_C")}
    assert wild["T1_C"].sum() >= 5
    assert wild["T2_C"].sum() >= 20
    flagged = record.flag_spikes("6 [K]", "4 [s]")
    robust = record.flag_spikes(6, "10 [s]")
    for name, where in wild.items():
        assert np.array_equal(~flagged[name].valid, where)
        assert np.all(robust[name].valid[where] == False)  # noqa: E712
        assert robust[name].flags["spike"] < 0.08 * record.times.size
    # after the median nothing jumps by more than a few steps of the converter from sample to sample
    smooth = record.median("4 [s]")
    for name in wild:
        assert np.abs(np.diff(record[name].values)).max() > 12 * STEP
        assert np.abs(np.diff(smooth[name].values)).max() < 3 * STEP
    # the masked samples were the wild ones: what is left stays near the smooth curve
    left = robust["T2_C"].valid
    assert np.abs(robust["T2_C"].values - smooth["T2_C"].values)[left].max() < 6


def test_tclabsp_preparation_of_a_campaign(shared):
    raw = read_record(shared / "tclabsp/random_H1H2/ens_IdentificationH1H2_Random_01.csv.gz", TCLAB)
    record = raw.prepare([{"trim": ["2 [s]", "end"]}, {"median": "4 [s]"}, {"resample": {"step": "5 [s]", "switches": False}}])
    assert record.origin == raw.origin
    assert record.step == pytest.approx(5)
    assert [re.match(r"2 of 30803|\w+", step)[0] for step in record.steps] == ["2 of 30803", "trim", "median", "resample"]
    # commands are held: every level on the grid is one that the log has, and the log's levels at those times
    places = np.searchsorted(raw.times, record.times + 1e-9, "right") - 1
    for name in ("Q1_pct", "Q2_pct"):
        assert np.array_equal(record[name].values, raw[name].values[places])
        assert record.table(name).bridged == 0


@pytest.mark.parametrize(
    ("file", "rows", "duration"),
    [
        ("energy_balance_mimo", 599, 599),
        ("2nd_order_mimo", 201, 601),
        ("mhe_linear", 150, 298),
        ("siso_pwm_degF", 851, 850),
        ("siso_step_pwm", 571, 572),
    ],
)
def test_tclab_apmonitor_rows_and_duration(shared, file, rows, duration):
    record = read_record(shared / f"tclab_apmonitor_arduino/{file}.csv", {"sensor": "T1_C"})
    assert record.origin.rows == rows
    assert record.duration == pytest.approx(duration, abs=1)


def test_uconsole_phases(shared):
    rows = {}
    for phase in ("idle", "stress", "cooldown", "video"):
        record = read_record(shared / f"uconsole_cm5_enclosure/{phase}.csv", {"soc": "temp_c"}, time="t_s")
        rows[phase] = record.origin.rows
        if phase == "stress":
            assert record["soc"].values.max() - 273.15 == pytest.approx(62.2)
            assert record["soc"].values.mean() - 273.15 == pytest.approx(58.4, abs=0.05)
    assert sum(rows.values()) == 773


def test_rocket_logs(shared):
    folder = shared / "rocket_avionics_rocketpy"
    # three chips are interleaved, told apart by a text column that is no part of the hash
    hedy = read_record(folder / "hedy_cats_baro.csv.gz", {"bay": "temperature_C"})
    assert (hedy["bay"].values.min() - 273.15, hedy["bay"].values.max() - 273.15) == pytest.approx((8.3, 44.7), abs=0.1)
    # 100 samples a second, then 10: some stamps repeat, and the change of rate is no gap
    mega = read_record(folder / "prometheus_telemega.csv.gz", {"bay": "temperature_C"}, units={"bay": "degC"})
    assert mega.origin.rows == 6234
    assert mega.times.size < mega.origin.rows
    assert mega.steps[0].startswith(f"{6234 - mega.times.size} of 6234 ")
    assert mega.resample("0.2 [s]")["bay"].flags == {}
    assert mega["bay"].values.max() - mega["bay"].values.min() < 3
    assert mega.duration == pytest.approx(240, abs=5)


def test_rocket_log_with_slipped_columns_is_refused(shared):
    """From line 592 on, the columns of this log have slipped by one: its temperature column has a dash, which is no missing sample."""
    path = shared / "rocket_avionics_rocketpy/juno3_cots_altimeter.csv"
    with raises_code("record.not-a-number", RecordError, match=r"juno3_cots_altimeter\.csv:592.*'temperature'"):
        read_record(path, {"bay": "temperature"})


def test_lhs1_bursts_are_gaps(shared):
    path = shared / "lhs1_vacuum_cooling/raw_1of10/exp02_no-reg-atm_2026-06-26_run1.csv.gz"
    record = read_record(path, {"board": "T_bmp388_C", "pressure": "P_hPa"}, time="t_nominal_s", units={"pressure": "hPa"})
    assert np.count_nonzero(np.diff(record.times) > 5.0) == 33
    # 60 s awake, 60 s asleep: half of a grid of 1 s lies in gaps
    grid = record.resample("1 [s]")
    assert np.mean(grid["board"].valid) == pytest.approx(0.5, abs=0.03)
    assert record.table("board").bridged == pytest.approx(0.5, abs=0.03)
    assert record["pressure"].quantity == "pressure"
    assert np.median(record["pressure"].values) == pytest.approx(89500, rel=0.01)
