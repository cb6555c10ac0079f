"""Numbers of the readers, by the formats that they come from."""

import io
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.special import ndtr

from by_code import raises_code
from thermid.base.errors import RecordError
from thermid.measure._readers.binary import _matlab_size, _tdms_times
from thermid.measure._readers.common_step import Explanation, LogCourse, _error, _rows
from thermid.measure._readers.guess import _by_name
from thermid.measure._record.channel import Channel, codes_of
from thermid.measure._record.rounding import _terms
from thermid.measure.readers import read_record


def test_a_matlab_file_without_compression_unpacks_to_its_own_length() -> None:
    """Its header has 128 bytes, of which the last two tell the order of bytes; each element says its length."""
    savemat = pytest.importorskip("scipy.io").savemat
    held = io.BytesIO()
    savemat(held, {"t": np.arange(50.0), "T": np.linspace(20.0, 30.0, 50)}, do_compression=False)
    assert _matlab_size(held.getvalue()) == len(held.getvalue())


def test_a_tdms_channel_without_increment_has_the_times_of_its_clock_or_none() -> None:
    assert _tdms_times(SimpleNamespace(properties={}), None, None) is None
    assert _tdms_times(SimpleNamespace(properties={}), np.array([0.0, 2.0]), None) == [0.0, 2.0]


@pytest.mark.parametrize(("count", "code"), [(10, True), (11, False)])
def test_a_value_alone_in_a_tenth_of_the_readings_is_a_code_and_in_more_is_another_temperature(count: int, code: bool) -> None:
    """A part that stays there longer has been heated."""
    readings = np.linspace(20.0, 21.0, 100)
    readings[5 : 5 + count] = 150.0
    assert (150.0 in codes_of(readings)) is code


@pytest.mark.parametrize("day", [25569.0, 29221.0, 45000.0, 73050.0])
def test_days_of_a_spreadsheet_are_those_of_1970_to_2100(day: float, tmp_path: Path) -> None:
    """Day 25569 is 1970-01-01, 29221 is 1980-01-01, 73050 is 2099-12-31 (a spreadsheet counts from 1899-12-30)."""
    path = tmp_path / "log.csv"
    rows = [f"{day + k / 1440.0:.6f},{20.0 + k:.1f}" for k in range(20)]
    path.write_text("\n".join(["time,T_case [degC]", *rows]) + "\n")
    with raises_code("record.time-unclear", RecordError):
        read_record(path, {"T_case": {"node": "a"}})


def test_three_rows_that_count_are_a_counter_and_two_are_not() -> None:
    assert _by_name("n", np.array([1.0, 2.0, 3.0]), "")[2] != _by_name("n", np.array([1.0, 2.0]), "")[2]


def test_readings_are_explained_where_both_clocks_ran() -> None:
    """A log that began 30 s before another, which lasted 40 s: the samples from 30 s to 70 s."""
    seen = LogCourse("T", False, np.arange(0.0, 101.0, 10.0), np.arange(11.0))
    rows, target = _rows(seen, Explanation(np.array([0.0, 40.0]), np.array([[0.0], [40.0]]), np.zeros(0), np.zeros(0)), 30.0)
    assert target.tolist() == [3.0, 4.0, 5.0, 6.0, 7.0]
    assert rows[:, 2].tolist() == [0.0, 10.0, 20.0, 30.0, 40.0]


@pytest.mark.parametrize(("away", "told"), [(499.0, False), (501.0, True)])
def test_a_value_held_for_a_third_of_a_log_is_a_code_from_500_degrees_on(away: float, told: bool) -> None:
    """Furnaces and joints beside them differ by less; an open circuit or an overrange reads further away."""
    values = np.concatenate([np.linspace(20.0, 21.0, 40), np.full(20, 21.0 + away)])
    assert (21.0 + away in codes_of(values)) is told


@pytest.mark.parametrize(("samples", "told"), [(9, False), (10, True)])
def test_readings_show_their_noise_from_eight_differences_on(samples: int, told: bool) -> None:
    """Differences are of second order at least; a median of fewer than eight of them is off by a third."""
    values = 300.0 + np.random.default_rng(5).normal(0.0, 0.1, samples)
    channel = Channel.from_array("T", values, unit="K", role="node", target="n")
    assert (channel.white_noise > 0.0) is told


@pytest.mark.parametrize("blur", [0.0, 0.1, 0.25])
def test_the_terms_of_rounding_sum_to_the_mean_square_of_what_a_mean_of_rounded_readings_is_off_by(blur: float) -> None:
    """Readings of a signal x with Gaussian noise before rounding: their mean less x, squared, averaged over a step."""
    step, n = 0.5, 4000
    x = step * (np.arange(n) + 0.5) / n
    k = np.arange(-12, 15)
    below = ndtr((step * (k[:, None] + 0.5) - x) / blur) if blur else (step * (k[:, None] + 0.5) > x).astype(float)
    mean = np.sum(step * k[1:, None] * np.diff(below, axis=0), axis=0)
    assert _terms(step, blur).sum() == pytest.approx(np.mean((mean - x) ** 2), rel=0.025)  # without noise the series ends at a fiftieth


def test_an_offset_of_clocks_is_known_to_a_step_of_the_other_log_over_the_root_of_twelve_at_best() -> None:
    """The standard deviation of an error that lies anywhere in a step."""
    times = np.arange(0.0, 3600.0, 10.0)
    course = np.sin(times / 40.0) + np.random.default_rng(3).normal(0.0, 0.01, times.size)
    made = Explanation(times, course[:, None], np.zeros(0), np.zeros(0))
    assert _error(LogCourse("T", False, times, course), made, 0.0, 60.0) == pytest.approx(60.0 / np.sqrt(12.0), rel=1e-3)
