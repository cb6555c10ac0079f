"""Sensor maps, certificates, heater programmes: what a user writes, and what he is told when it is wrong."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from by_code import raises_code
from thermid.base.errors import MissingDataError, RecordError, ThermidError, UnitError
from thermid.bench.bench_files import MappedSensor, load_programme, load_sensors, save_sensor
from thermid.bench.board import made_up_rom
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
    ("text", "word"),
    [
        ("x = [", "not valid TOML"),
        ("", "sensors: is missing"),
        ("[sensors.T1]\n", "sensors.T1.rom: is missing"),
        ('[sensors.T1]\nrom = "28FF"\n', "16 hexadecimal digits"),
        (f'[sensors.T1]\nrom = "{A[:-1]}{"0" if A[-1] != "0" else "1"}"\n', "a digit is mistyped"),
        (GOOD + f'[sensors.T2]\nrom = "{A}"\n', "is also given for 'T1'"),
        (GOOD + 'nota = "x"\n', "'nota' is not a field here. Did you mean 'note'"),
        (GOOD + '[sensors.T1.certificate]\noffset = "1 [K]"\n', "certificate.uncertainty: is missing"),
        (GOOD + '[sensors.T1.certificate]\noffset = "9 [K]"\nuncertainty = "1 [K]"\n', "is defective"),
        (GOOD + '[sensors.T1.certificate]\noffset = "1 [K]"\nuncertainty = "0 [K]"\n', "above zero"),
        (GOOD + '[sensors.T1.certificate]\noffset = "1 [K]"\nuncertainty = "1 [K]"\nwho = "me"\n', "who"),
    ],
)
def test_a_wrong_map_is_refused(text: str, word: str, tmp_path: Path) -> None:
    path = tmp_path / "sensors.toml"
    path.write_text(text)
    with pytest.raises(ThermidError, match=word):
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
    ("text", "word"),
    [
        ("x = [", "not valid TOML"),
        ("steps = []", "steps: .* at least 1"),
        ("step = []", "'step' is not a field here. Did you mean 'steps'"),
        ("steps = [{ heater1 = 1 }]", "steps.0.at: is missing"),
        ('steps = [{ at = "0 [s]", heater = 1 }]', "steps.0.heater: 'heater' is not a field here. Did you mean 'heater2'"),
        ('steps = [{ at = "0 [s]", heater1 = "140 [%]" }]', "0 to 100 %"),
        ('steps = [{ at = "1 [h]" }, { at = "1 [min]" }]', r"its time 60 s is not after 3600 s\."),
        ('end = "1 [s]"\nsteps = [{ at = "1 [h]" }]', "s, is not after its last step,"),
    ],
)
def test_a_wrong_programme_is_refused(text: str, word: str, tmp_path: Path) -> None:
    path = tmp_path / "step.toml"
    path.write_text(text)
    with pytest.raises(ThermidError, match=word):
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
    ("values", "word"),
    [
        (np.zeros(20), "60 are needed"),
        (np.linspace(0, 1, 120), "still drifts"),
        (np.full(120, 21.0), "A good sensor reads within"),
    ],
)
def test_no_certificate_from_a_bad_test(values: np.ndarray, word: str) -> None:
    with pytest.raises(RecordError, match=word):
        certificate_of(values, 0.0625, "")
