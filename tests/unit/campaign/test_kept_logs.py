"""Logs kept in a results folder: taken when nothing has changed, read again when anything has."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from by_code import raises_code
from thermid.base.errors import RecordError
from thermid.campaign import _cache as cache
from thermid.campaign._cache import log_kept
from thermid.campaign._file import CampaignSource
from thermid.campaign._schema import RecordTable
from thermid.fit.calibration import KeptFit
from thermid.measure.readers import read_record
from thermid.measure.records import Channel, Record

LOG = "# a note\ntime_s,T_A,T_B,P\n" + "".join(f"{10 * k},{20 + k},{'' if k == 3 else 21 + k},{k % 2}\n" for k in range(12))
CAMPAIGN = """
title = "One log"

[records.one]
file     = "one.csv"
channels = { T_A = { node = "case", noise = "0.1 [K]", lag = "9 [s]", range = ["0 [degC]", "25 [degC]"] }, T_B = "?", P = "!" }
prepare  = [{ resample = "20 [s]" }]

[checksums]

[[stages]]
name    = "box"
model   = "box.toml"
records = ["one"]
free    = ["htc"]
""".replace('"?"', '{ boundary = "room" }').replace('"!"', '{ load = "heater" }')


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    (tmp_path / "one.csv").write_text(LOG)
    path = tmp_path / "campaign.toml"
    path.write_text(CAMPAIGN)
    return path


@pytest.fixture
def readings(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the logs that were read from their text."""
    seen: list[str] = []

    def counted(path: Path, *given: Any, **more: Any) -> Record:
        seen.append(path.name)
        return read_record(path, *given, **more)

    monkeypatch.setattr("thermid.campaign._file.read_record", counted)
    return seen


def source(campaign: Path, folder: Path | None = None) -> CampaignSource:
    return replace(CampaignSource.read(campaign), results=folder if folder is not None else campaign.parent / "results")


def same(one: Any, other: Any) -> bool:
    """Whether two values are the same in every bit, NaN and the order of mappings included."""
    if isinstance(one, Record | Channel):
        return type(one) is type(other) and all(same(getattr(one, f.name), getattr(other, f.name)) for f in fields(one))
    if isinstance(one, np.ndarray):
        return one.dtype == other.dtype and np.array_equal(one, other, equal_nan=one.dtype == np.float64)
    if isinstance(one, dict):
        return list(one) == list(other) and all(same(v, other[k]) for k, v in one.items())
    return type(one) is type(other) and bool(one == other)


def test_a_kept_log_is_the_log_in_every_bit(campaign: Path, readings: list[str]) -> None:
    read = source(campaign).record("one")
    kept = source(campaign).record("one")
    assert readings == ["one.csv"]
    assert same(read, kept)
    assert read.channels["T_A"].part is not None, "the log has a sensor with a lag"
    assert any(channel.masks for channel in read.channels.values()), "the log has masked samples"
    assert not kept.channels["T_A"].values.flags.writeable


def test_without_a_results_folder_nothing_is_kept(campaign: Path, readings: list[str]) -> None:
    for _ in range(2):
        CampaignSource.read(campaign).record("one")
    assert readings == ["one.csv", "one.csv"]
    assert {p.name for p in campaign.parent.iterdir()} == {"one.csv", "campaign.toml"}


CHANGES: dict[str, Callable[[str], str]] = {
    "a binding": lambda text: text.replace('node = "case"', 'node = "lid"'),
    "a stated noise": lambda text: text.replace("0.1 [K]", "0.2 [K]"),
    "a stated range": lambda text: text.replace("25 [degC]", "26 [degC]"),
    "a channel less": lambda text: text.replace(', P = { load = "heater" }', ""),
    "the order of channels": lambda text: text.replace(
        ', T_B = { boundary = "room" }, P = { load = "heater" } }', ', P = { load = "heater" }, T_B = { boundary = "room" } }'
    ),
    "a step of preparing": lambda text: text.replace("20 [s]", "40 [s]"),
    "a second step": lambda text: text.replace('[{ resample = "20 [s]" }]', '[{ resample = "20 [s]" }, { trim = "40 [s]" }]'),
    "the time column": lambda text: text.replace("channels =", 'time = "time_s"\nchannels ='),
    "the separator": lambda text: text.replace("channels =", 'separator = ","\nchannels ='),
    "the decimal sign": lambda text: text.replace("channels =", 'decimal = "."\nchannels ='),
    "the unit of a column": lambda text: text.replace("channels =", 'units = { T_B = "degF" }\nchannels ='),
    "a power logged at every change": lambda text: text.replace('load = "heater"', 'load = "heater", prompt = true'),
    "the file": lambda text: text.replace('"one.csv"', '"two.csv"'),
}


@pytest.mark.parametrize("change", CHANGES)
def test_a_change_of_how_it_is_read_reads_it_again(campaign: Path, readings: list[str], change: str) -> None:
    (campaign.parent / "two.csv").write_text(LOG)
    source(campaign).record("one")
    text = CHANGES[change](CAMPAIGN)
    assert text != CAMPAIGN
    campaign.write_text(text)
    found = source(campaign).record("one")
    assert len(readings) == 2
    assert same(found, CampaignSource.read(campaign).record("one"))


def test_whatever_a_campaign_says_of_a_log_enters_the_key(campaign: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: dict[str, Any] = {}

    def looked(folder: Path, path: Path, how: dict[str, Any], make: Callable[[], Record]) -> Record:
        seen.update(how)
        return make()

    monkeypatch.setattr("thermid.campaign._file.log_kept", looked)
    source(campaign).record("one")
    elsewhere = {"file", "files", "joined", "local", "environment", "get"}  # the log itself; what is done after it was kept; words
    assert set(seen) == set(RecordTable.model_fields) - elsewhere | {"name", "checksum"}


def test_one_digit_of_the_log_reads_it_again(campaign: Path, readings: list[str]) -> None:
    first = source(campaign).record("one")
    log = campaign.parent / "one.csv"
    stamp = log.stat()
    log.write_text(LOG.replace("20,22,", "20,23,"))
    assert log.stat().st_size == stamp.st_size, "its length does not tell"
    found = source(campaign).record("one")
    assert len(readings) == 2
    assert not same(found, first)
    assert same(found, CampaignSource.read(campaign).record("one"))


def test_other_code_reads_it_again(campaign: Path, readings: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    source(campaign).record("one")
    monkeypatch.setattr(cache, "code_digest", lambda: "another")
    source(campaign).record("one")
    assert len(readings) == 2


def test_a_checksum_is_asked_of_a_kept_log_too(campaign: Path) -> None:
    sha = source(campaign).record("one").origin.sha256
    campaign.write_text(CAMPAIGN.replace("[checksums]", f'[checksums]\none = "{sha[:16]}"'))
    assert source(campaign).record("one").origin.sha256 == sha
    campaign.write_text(CAMPAIGN.replace("[checksums]", f'[checksums]\none = "{"0" * 16}"'))
    with raises_code("record.another-log", RecordError):
        source(campaign).record("one")


@pytest.mark.parametrize("harm", [b"", b"PK\x03\x04 no archive", b"\x93NUMPY"])
def test_a_damaged_file_counts_as_none(campaign: Path, readings: list[str], harm: bytes) -> None:
    first = source(campaign).record("one")
    kept = campaign.parent / "results" / "logs" / "one.npz"
    kept.write_bytes(harm)
    assert same(source(campaign).record("one"), first)
    assert len(readings) == 2
    kept.write_bytes(kept.read_bytes()[:-400])
    source(campaign).record("one")
    assert len(readings) == 3


def test_what_json_does_not_hold_is_read_as_ever(tmp_path: Path) -> None:
    (tmp_path / "one.csv").write_text(LOG)
    made = log_kept(
        tmp_path / "results",
        tmp_path / "one.csv",
        {"name": "one", "odd": {1, 2}},
        lambda: read_record(tmp_path / "one.csv", {"case": "T_A"}),
    )
    assert made.times.size == 12
    assert not (tmp_path / "results").exists()


def test_the_digest_of_the_code_knows_every_source_and_the_kernel(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    files = cache._code()
    assert {"_cache.py", "__init__.py", "_transient.py"} <= {path.name for path in files}
    assert files[-1].name.startswith("_kernel")
    assert files[-1].suffix in (".so", ".pyd")
    source, kernel = tmp_path / "fit.py", tmp_path / "kernel.so"
    source.write_text("a = 1\n")
    kernel.write_bytes(b"1")
    code = [source, kernel]
    monkeypatch.setattr(cache, "_code", lambda: code)
    seen = [cache.code_digest.__wrapped__()]
    source.write_text("a = 2\n")
    seen.append(cache.code_digest.__wrapped__())
    kernel.write_bytes(b"2")
    seen.append(cache.code_digest.__wrapped__())
    code.insert(0, tmp_path / "new.py")
    code[0].write_text("")
    seen.append(cache.code_digest.__wrapped__())
    monkeypatch.setattr(np, "__version__", "0")
    seen.append(cache.code_digest.__wrapped__())
    assert len(set(seen)) == 5


def test_a_finished_stage_does_not_outlive_the_code(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    end = KeptFit({"htc": 1.5}, 8, "two starts", ("one remark", "another"))
    cache.KeptStage(tmp_path, "box").remember("key", end)
    assert cache.KeptStage(tmp_path, "box").recall("key") == end
    monkeypatch.setattr(cache, "code_digest", lambda: "another")
    assert cache.KeptStage(tmp_path, "box").recall("key") is None


def test_a_model_of_error_is_made_once_and_again_where_anything_changed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[float] = []

    def errors(key: str) -> object:
        keeping = cache.KeptStage(tmp_path / "results", "box").errors(key)
        assert keeping is not None
        return keeping(lambda: made.append(1.0) or {"table": {"misfit": 0.1 + 0.2}, "number": len(made)})

    first, path = errors("key"), tmp_path / "results/box.errors.json"
    assert errors("key") == first == {"table": {"misfit": 0.1 + 0.2}, "number": 1}
    assert errors("another") == {**first, "number": 2}
    for damage in (("0.3", "0.4"), ("{", "["), ('"errors"', '"e"')):
        path.write_text(path.read_text(encoding="utf-8").replace(*damage, 1), encoding="utf-8")
        assert errors("another") == {**first, "number": len(made)}
    assert len(made) == 5
    monkeypatch.setattr(cache, "code_digest", lambda: "other code")
    assert errors("another") == {**first, "number": 6}
    path.unlink()
    path.mkdir()  # where it cannot be kept
    assert errors("another") == {**first, "number": 7}


@pytest.mark.parametrize(
    "damage",
    [
        '"fitted": {"htc": 1' + "0" * 400 + "}",
        '"fitted": ' + "[" * 100_000,
        '"fitted": {"htc": "x"}',
        '"fitted": {"htc": 1.5}, "evaluations": 1e400, "search": "", "remarks": []',
        '"fitted": {"htc": 1.5}, "evaluations": 8, "search": "", "remarks": 3',
        '"fitted": {"htc": 1.5}, "evaluations": 8, "search": ""',
    ],
)
def test_a_damaged_fit_is_as_good_as_none(tmp_path: Path, damage: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A whole number that no float holds, lists without an end, a text, no count: the stage runs again."""
    monkeypatch.setattr(cache, "code_digest", lambda: "c")
    (tmp_path / "box.fit.json").write_text(f'{{"key": "key", "code": "c", "ingredients": {{}}, {damage}}}', encoding="utf-8")
    assert cache.KeptStage(tmp_path, "box").recall("key") is None
