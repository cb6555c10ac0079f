"""Binary telemetry: frames, resynchronisation after damage, faults, two clocks in one record."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import pytest

from thermid.acquire.telemetry import SYNC, Chain, Frame, frame_bytes, read_frames, read_telemetry
from thermid.errors import MissingDataError, NameNotFoundError, RecordError
from thermid.measure import Record

CHAIN = Chain()


def warm(count: int = 200, first: int = 65500) -> list[Frame]:
    """Two channels that warm, and a third with counts that look like a sync word."""
    t = np.arange(count) * 0.1
    a, b = CHAIN.counts(293.15 + t), CHAIN.counts(303.15 - t / 2)
    return [Frame((first + k) % 65536, 1000 + 100 * k, (int(a[k]), int(b[k]), 0xEB90)) for k in range(count)]


def save(frames: list[Frame], path: Path) -> Path:
    path.write_bytes(b"".join(map(frame_bytes, frames)))
    return path


def test_counts_become_temperatures_within_half_a_step(tmp_path: Path) -> None:
    record = read_telemetry(save(warm(), tmp_path / "tm.bin"), {"acc_x": 0, "acc_y": 1})
    t = np.arange(200) * 0.1
    assert np.abs(record["acc_x"].values - (293.15 + t)).max() <= CHAIN.step / 2 + 1e-9
    np.testing.assert_allclose(record.times, 1.0 + t)
    assert record["acc_x"].accuracy == 1.5
    assert CHAIN.step == pytest.approx(5.0 / 4096 / 10e3 / 1e-6)
    assert record.steps == ("frames 200, missing 0, bytes that belong to none 0",)


def test_it_finds_its_way_after_damage() -> None:
    frames = warm(50)
    pieces = [frame_bytes(each) for each in frames]
    pieces[10] = pieces[10][:5]  # cut
    pieces[20] = pieces[20][:8] + b"\x55" + pieces[20][9:]  # a wrong byte
    pieces[30] = b"garbage" + SYNC + b"more" + pieces[30]
    found, foreign = read_frames(b"".join(pieces))
    assert found == [each for k, each in enumerate(frames) if k not in (10, 20)]
    assert foreign == 5 + len(pieces[20]) + 13


@pytest.mark.parametrize("count", [pytest.param(500, id="500"), pytest.param(10_000, id="10000", marks=pytest.mark.campaign)])
def test_no_damaged_frame_is_believed(count: int) -> None:
    rng = random.Random(3)
    frames = warm(12)
    known, data = set(frames), b"".join(map(frame_bytes, frames))
    for _ in range(count):
        bad = bytearray(data)
        for _ in range(rng.randint(1, 4)):
            at = rng.randrange(len(bad))
            if rng.random() < 0.5:
                bad[at] = rng.randrange(256)
            else:
                del bad[at : at + rng.randint(1, 20)]
        found, _ = read_frames(bytes(bad))
        assert set(found) <= known
        assert len(found) >= 12 - 8


def test_missing_frames_are_counted_over_the_wrap(tmp_path: Path) -> None:
    frames = warm()
    del frames[30:45]
    record = read_telemetry(save(frames, tmp_path / "tm.bin"), {"acc_x": 0})
    assert record.steps[0].startswith("frames 185, missing 15")


def test_an_open_line_and_what_no_sensor_shows_are_masked(tmp_path: Path) -> None:
    frames = [Frame(k, 100 * k, (counts,)) for k, counts in enumerate([2400, 0, 4095, 3900, 2401])]
    channel = read_telemetry(save(frames, tmp_path / "tm.bin"), {"x": 0})["x"]
    assert channel.flags == {"line open or shorted": 2, "outside its range": 1}


def test_two_clocks_become_one_record(tmp_path: Path) -> None:
    unit = read_telemetry(save(warm(), tmp_path / "tm.bin"), {"acc_x": 0})
    t = np.arange(30.0)
    bench = Record.from_arrays("bench", t, {"room": 294.15 + 0.0 * t})
    both = bench.joined(unit, offset=5.0, rate=1.0001)
    assert set(both.channels) == {"room", "acc_x"}
    assert both["acc_x"].valid.sum() == 200
    at = np.flatnonzero(both["acc_x"].valid)
    np.testing.assert_allclose(both.times[at], 5.0 + 1.0001 * unit.times)


def test_what_is_no_telemetry_is_refused(tmp_path: Path) -> None:
    with pytest.raises(MissingDataError, match="no such telemetry file"):
        read_telemetry(tmp_path / "no.bin", {"x": 0})
    (tmp_path / "x.bin").write_bytes(b"nothing of the kind")
    with pytest.raises(RecordError, match="0 good frames in 19 bytes"):
        read_telemetry(tmp_path / "x.bin", {"x": 0})
    path = save(warm(), tmp_path / "tm.bin")
    with pytest.raises(NameNotFoundError, match="a frame has 0 to 2"):
        read_telemetry(path, {"x": 3})
    with pytest.raises(RecordError, match="time does not go on at frame 3"):
        read_telemetry(save([Frame(0, 0, (1,)), Frame(1, 9, (1,)), Frame(2, 3, (1,))], path), {"x": 0})
    with pytest.raises(RecordError, match="frame 2 has 1 channels"):
        read_telemetry(save([Frame(0, 0, (1, 2)), Frame(1, 9, (1,))], path), {"x": 0})


@pytest.mark.parametrize("field", [{"resistance": 0.0}, {"bits": 0}, {"bits": 20}, {"scale": -1.0}])
def test_a_chain_that_makes_no_sense_is_refused(field: dict[str, float]) -> None:
    with pytest.raises(RecordError, match="chain"):
        Chain(**field)
