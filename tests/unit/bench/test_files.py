"""Sensor maps, certificates, heater programmes: what a user writes, and what he is told when it is wrong."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from python_board import made_up_rom

from by_code import raises_code
from thermid.base.errors import MissingDataError, RecordError, UnitError
from thermid.bench.bench_files import MappedSensor, load_programme, load_sensors, save_sensor
from thermid.bench.guide import certificate_of
from thermid.measure.records import SensorCertificate

A, B = made_up_rom(0), made_up_rom(1)
GOOD = f'[sensors.T1]\nrom = "{A}"\n'


def test_a_map_survives_its_file(tmp_path: Path) -> None:
    path = tmp_path / "sensors.toml"
    path.write_text(f'# our bench\n[sensors.T1]\nrom = "{A}"  # the blue one\n')
    save_sensor(path, MappedSensor("T2", B, SensorCertificate(0.125, 0.04, date="2026-02-01"), "on the cover"))
    found = load_sensors(path)
    assert found[A] == MappedSensor("T1", A)
    assert found[B] == MappedSensor("T2", B, SensorCertificate(0.125, 0.04, date="2026-02-01"), "on the cover")
    assert "the blue one" in path.read_text()
    save_sensor(path, MappedSensor("T3", B))  # a new name for the same sensor
    assert [each.name for each in load_sensors(path).values()] == ["T1", "T3"]


@pytest.mark.parametrize(
    ("text", "code", "match"),
    [
        ("x = [", "file.not-valid", r"sensors\.toml"),
        ("", "file.key-missing", r"sensors\.toml"),
        ("[sensors.T1]\n", "file.key-missing", r"sensors\.T1\.rom"),
        ('[sensors.T1]\nrom = "28FF"\n', "bench.sensor", "16"),
        (
            f'[sensors.T1]\nrom = "{A[:-1]}{"0" if A[-1] != "0" else "1"}"\n',
            "bench.sensor",
            r"sensors\.toml.*sensors\.T1.*2800003C0B1A0FC0",
        ),
        (GOOD + f'[sensors.T2]\nrom = "{A}"\n', "name.taken", "'T1'"),
        (GOOD + 'nota = "x"\n', "file.unknown-key", "'nota'.*'note'"),
        (GOOD + '[sensors.T1.certificate]\noffset = "1 [K]"\n', "file.key-missing", r"certificate\.uncertainty"),
        (
            GOOD + '[sensors.T1.certificate]\noffset = "9 [K]"\nuncertainty = "1 [K]"\n',
            "value.outside-range",
            r"sensors\.toml.*sensors\.T1\.certificate",
        ),
        (
            GOOD + '[sensors.T1.certificate]\noffset = "1 [K]"\nuncertainty = "0 [K]"\n',
            "value.outside-range",
            r"sensors\.toml.*sensors\.T1\.certificate",
        ),
        (
            GOOD + '[sensors.T1.certificate]\noffset = "1 [K]"\nuncertainty = "1 [K]"\nwho = "me"\n',
            "file.unknown-key",
            r"sensors\.toml:6.*sensors\.T1\.certificate\.who.*'who'",
        ),
    ],
)
def test_a_wrong_map_is_refused(text: str, code: str, match: str, tmp_path: Path) -> None:
    path = tmp_path / "sensors.toml"
    path.write_text(text)
    with raises_code(code, match=match):
        load_sensors(path)


def test_a_missing_map_says_how_to_make_one(tmp_path: Path) -> None:
    with raises_code("record.log-missing", MissingDataError, match="`thermid log --identify`"):
        load_sensors(tmp_path / "no.toml")


def test_a_programme(tmp_path: Path) -> None:
    path = tmp_path / "step.toml"
    path.write_text('end = "2 [h]"\nsteps = [{ at = "10 [min]", heater1 = "40 [%]" }, { at = "1 [h]", heater2 = 0.25 }]\n')
    made = load_programme(path)
    assert [made.at(t) for t in (0, 600, 3599, 3600, 7200)] == [(0, 0), (400, 0), (400, 0), (400, 250), (0, 0)]


@pytest.mark.parametrize(
    ("text", "code", "match"),
    [
        ("x = [", "file.not-valid", r"step\.toml"),
        ("steps = []", "file.wrong-value", "1"),
        ("step = []", "file.key-missing", "'step'.*'steps'"),
        ("steps = [{ heater1 = 1 }]", "file.key-missing", r"steps\.0\.at"),
        ('steps = [{ at = "0 [s]", heater = 1 }]', "file.unknown-key", r"steps\.0\.heater.*'heater'.*'heater2'"),
        ('steps = [{ at = "0 [s]", heater1 = "140 [%]" }]', "value.outside-range", "0.*100"),
        ('steps = [{ at = "1 [h]" }, { at = "1 [min]" }]', "value.outside-range", "60.*3600"),
        ('end = "1 [s]"\nsteps = [{ at = "1 [h]" }]', "value.outside-range", r"step\.toml"),
    ],
)
def test_a_wrong_programme_is_refused(text: str, code: str, match: str, tmp_path: Path) -> None:
    path = tmp_path / "step.toml"
    path.write_text(text)
    with raises_code(code, match=match):
        load_programme(path)


def test_a_duty_in_watts_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "step.toml"
    path.write_text('steps = [{ at = "0 [s]", heater1 = "4 [W]" }]')
    with pytest.raises(UnitError):
        load_programme(path)
    with raises_code("file.not-found"):
        load_programme(tmp_path / "no.toml")


def test_a_certificate_counts_bath_steps_and_noise() -> None:
    made = certificate_of(np.full(120, 0.25), 0.0625, "2026-02-01")
    assert made.offset == 0.25
    assert made.uncertainty == pytest.approx(np.hypot(0.02, 0.0625 / np.sqrt(12)))


@pytest.mark.parametrize(
    ("values", "code", "match"),
    [
        (np.zeros(20), "record.too-short", "60"),
        (np.linspace(0, 1, 120), "record.not-steady", ""),
        (np.full(120, 21.0), "bench.sensor", ""),
    ],
)
def test_no_certificate_from_a_bad_test(values: np.ndarray, code: str, match: str) -> None:
    with raises_code(code, RecordError, match=match):
        certificate_of(values, 0.0625, "")
