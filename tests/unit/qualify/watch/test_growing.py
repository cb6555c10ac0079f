"""A log that grows: pieces as the whole, older readings as means, what cannot be read in pieces."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest

from by_code import raises_code
from thermid.base.errors import NameNotFoundError, RecordError
from thermid.measure.readers import read_record
from thermid.measure.records import Channel, Record
from thermid.qualify._watch import growing
from thermid.qualify._watch.growing import GrowingLog, with_block_means
from unit.bench.bench import Sheet

ICE = 273.15
SENSOR = "021CB801000000A2"


def rows(begin: int, end: int, stamps: bool = False) -> str:
    """Return lines of a synthetic log, one a second."""

    def time(k: int) -> str:
        return f"2026-03-01 {8 + k // 3600:02d}:{k // 60 % 60:02d}:{k % 60:02d}" if stamps else str(k)

    return "".join(f"{time(k)},{22 + 20 * (1 - np.exp(-k / 900)):.4f},{4.0 if k < 700 else 2.0}\n" for k in range(begin, end))


def read(path: Path) -> Record:
    return read_record(path, {"T": {"node": "T"}, "P": {"load": "P"}})


@pytest.mark.parametrize("stamps", [False, True], ids=["seconds", "stamps"])
def test_pieces_are_the_whole(tmp_path: Path, stamps: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(growing, "CHUNK_BYTES", 5000)
    path = tmp_path / "bench.csv"
    log = GrowingLog(path, read)
    assert log.record() is None
    path.write_text("time,T [degC],P [W]\n")
    assert log.record() is None
    for begin, end in ((0, 3), (3, 500), (500, 501), (501, 1500)):
        with path.open("a") as file:
            file.write(rows(begin, end, stamps))
        kept = log.record()
    whole = with_block_means(read(path))
    assert kept is not None
    assert not log.whole
    np.testing.assert_allclose(kept.times, whole.times)
    np.testing.assert_allclose(kept["T"].values, whole["T"].values)
    np.testing.assert_allclose(kept["P"].values, whole["P"].values)


def test_a_log_of_the_bench_in_pieces(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(growing, "CHUNK_BYTES", 4000)
    made = Sheet().start()
    made.say(0.01, 0, "uno,thermid-bench 1,power", "B")
    for k in range(400):
        made.say(k + 1.01, 1000 * (k + 1), f"{SENSOR},{320 + k},ok")
    path = tmp_path / "bench.log"
    log = GrowingLog(path, lambda p: read_record(p, {"a": SENSOR}))
    for share in (0.3, 0.7, 1.0):
        path.write_text(made.text[: int(share * len(made.text))])
        kept = log.record()
    whole = read_record(path, {"a": SENSOR})
    assert kept is not None
    assert not log.whole
    np.testing.assert_allclose(kept.times, whole.times, atol=1e-3)
    np.testing.assert_allclose(kept["a"].values, whole["a"].values)


def test_what_came_since_the_last_call_is_as_it_was_read(tmp_path: Path) -> None:
    """Looks an hour apart are judged minute by minute, so the readings of that hour are not averaged yet."""
    path = tmp_path / "bench.csv"
    log = GrowingLog(path, read)
    path.write_text("time,T [degC],P [W]\n" + rows(0, 9000))
    first = log.record()
    with path.open("a") as file:
        file.write(rows(9000, 12600))
    later = log.record()
    assert first is not None
    assert later is not None
    np.testing.assert_allclose(first.times, np.arange(9000.0))
    np.testing.assert_allclose(later.times[later.times >= 7800.0], np.arange(7800.0, 12600.0))
    assert np.count_nonzero(later.times < 7800.0) < 4500


def test_a_line_that_is_being_written_waits(tmp_path: Path) -> None:
    path = tmp_path / "bench.csv"
    log = GrowingLog(path, read)
    path.write_text("time,T [degC],P [W]\n" + rows(0, 50) + "50,2")
    kept = log.record()
    assert kept is not None
    assert kept.times[-1] == 49.0
    with path.open("a") as file:
        file.write("7.5,4.0\n")
    kept = log.record()
    assert kept is not None
    assert kept["T"].values[-1] == pytest.approx(ICE + 27.5)


def test_a_log_written_anew_begins_anew(tmp_path: Path) -> None:
    path = tmp_path / "bench.csv"
    log = GrowingLog(path, read)
    path.write_text("time,T [degC],P [W]\n" + rows(0, 400))
    log.record()
    path.write_text("time,T [degC],P [W]\n" + rows(0, 40))
    kept = log.record()
    assert kept is not None
    assert kept.times.size == 40


def test_a_packed_log_is_read_whole(tmp_path: Path) -> None:
    path = tmp_path / "bench.csv.gz"
    path.write_bytes(gzip.compress(("time,T [degC],P [W]\n" + rows(0, 90)).encode()))
    log = GrowingLog(path, read)
    kept = log.record()
    assert log.whole
    assert kept is not None
    assert kept.times.size == 90


def test_a_wrong_column_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "bench.csv"
    path.write_text("time,U [degC],P [W]\n" + rows(0, 90))
    with pytest.raises(NameNotFoundError):
        GrowingLog(path, read).record()


def test_lines_that_are_no_log_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "bench.csv"
    log = GrowingLog(path, read)
    path.write_text("time,T [degC],P [W]\n" + "1,2\n" * 5)
    assert log.record() is None
    path.write_text("time,T [degC],P [W]\n" + "1,2\n" * 50)
    with pytest.raises(RecordError):
        log.record()


@pytest.mark.parametrize(
    ("later", "code"),
    [
        ("".join(f"{k},{30 + k % 2},4.0\n" for k in range(60)), "record.time-order"),
        ("".join(f"{500 + k},4.0\n" for k in range(60)), "record.layout-unclear"),
    ],
    ids=["times", "column"],
)
def test_a_log_that_cannot_be_followed_any_more_is_an_error(tmp_path: Path, later: str, code: str) -> None:
    path = tmp_path / "bench.csv"
    log = GrowingLog(path, read)
    path.write_text("time,T [degC],P [W]\n" + rows(0, 400))
    assert log.record() is not None
    with path.open("a") as file:
        file.write(later)
    with raises_code(code, RecordError, match=" 399 s "):
        for _ in range(growing.MAX_FAILED_LOOKS):
            kept = log.record()
            assert kept is not None
            assert kept.times[-1] == 399.0


class TestThinned:
    def long(self, hours: float) -> Record:
        t = np.arange(0.0, 3600.0 * hours, 5.0)
        values = ICE + 22.0 + 20.0 * (1.0 - np.exp(-t / 900.0))
        return Record.from_arrays(
            "long", t, {"T": values, "P": Channel.from_array("P", np.where(t < 9000.0, 4.0, 2.0), role="load", quantity="power")}, unit="K"
        )

    def test_rows_grow_with_the_logarithm(self) -> None:
        sizes = [with_block_means(self.long(h)).times.size for h in (10.0, 20.0, 40.0)]
        assert np.diff(sizes).max() < growing.ROWS_PER_E_FOLD
        assert sizes[-1] < 3500

    def test_means_lie_on_the_course_and_recent_readings_stay(self) -> None:
        kept = with_block_means(self.long(20.0))
        true = ICE + 22.0 + 20.0 * (1.0 - np.exp(-kept.times / 900.0))
        assert np.abs(kept["T"].values - true).max() < 0.005
        late = kept.times > kept.times[-1] - growing.RECENT_TIME
        np.testing.assert_allclose(np.diff(kept.times[late]), 5.0)

    def test_again_and_again_loses_little(self) -> None:
        once = with_block_means(self.long(20.0))
        again = with_block_means(with_block_means(with_block_means(once)))
        assert again.times.size > 0.95 * once.times.size

    def test_where_a_power_changes_nothing_is_averaged(self) -> None:
        kept = with_block_means(self.long(20.0))
        place = int(np.searchsorted(kept.times, 9000.0))
        assert kept.times[place] == 9000.0
        assert set(kept["P"].values) == {4.0, 2.0}

    def test_a_short_record_stays(self) -> None:
        record = self.long(1.0)
        assert with_block_means(record) is record
