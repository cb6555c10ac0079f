"""A log that grows: followed as it stands, with the library's own stability and forecast, faults as gaps, and no half of a number."""

from __future__ import annotations

import os
import re
import tracemalloc
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.app.studio.follow import Follower
from thermid.app.studio.room import as_json
from thermid.base.errors import DeckError, ThermidError, code_of
from thermid.bench._wire import crc16
from thermid.bench.benchlog import log_line
from thermid.measure.readers import UNFINISHED

EVIL = "T<script>alert(1)</script>"


def write(file: Path, rows: int, names: tuple[str, ...] = ("T_CASE", "T_LID"), cut: int = 0) -> None:
    """Write a synthetic log: two first orders with noise; T_LID is lost for a while."""
    rng = np.random.default_rng(5)
    times = np.arange(rows) * 10.0
    columns = [24.0 + 9.0 * (1.0 - np.exp(-times / tau)) + 0.05 * rng.standard_normal(rows) for tau in (1000.0, 800.0)]
    lines = ["# SYNTHETIC", "time_s," + ",".join(f"{n} [degC]" for n in names)]
    for k, t in enumerate(times):
        lines.append(",".join([f"{t:.1f}", f"{columns[0][k]:.3f}", "" if 100 <= k < 120 else f"{columns[1][k]:.3f}"]))
    text = "\n".join(lines) + "\n"
    file.write_text(text[: len(text) - cut], encoding="utf-8")


@pytest.fixture
def log(tmp_path: Path) -> Path:
    file = tmp_path / "run.csv"
    write(file, 400)
    return file


@pytest.fixture(autouse=True)
def quick(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave forecasts out where a test is not about them: they take longer than all else."""
    if "forecast" not in request.node.name and "library" not in request.node.name:
        monkeypatch.setattr("thermid.app.studio.follow.BUDGET", -1.0)


def seen(told: dict[str, Any], name: str) -> dict[str, Any]:
    return next(c for c in told["channels"] if c["name"] == name)


def test_it_says_what_the_library_says(log: Path) -> None:
    told = Follower(log.parent).look({"file": "run.csv", "rule": "3 C/h"})
    record = td.read_record(log, {n: {"node": n} for n in ("T_CASE", "T_LID")})
    stable, end = td.bench.stability(record, "3 C/h"), td.bench.forecast(record, "T_CASE")
    assert told["verdict"]["word"] == stable.verdict
    assert told["slowest"] == stable.slowest
    case = seen(told, "T_CASE")
    assert case["rate"] == 3600.0 * stable.channels["T_CASE"].rate
    assert case["since"] == stable.since["T_CASE"]
    assert (case["forecast"]["final"] is None) == bool(end.declined)
    assert case["forecast"]["declined"] == end.declined
    assert told["synthetic"]


def test_a_forecast_is_given_where_it_can_be_and_declined_where_not(log: Path) -> None:
    follower = Follower(log.parent)
    early = seen(follower.look({"file": "run.csv"}), "T_CASE")["forecast"]
    assert early["final"] is None
    assert code_of(early["declined"]) == "result.slow-part-possible"
    known = seen(follower.look({"file": "run.csv", "slowest": 0.5}), "T_CASE")["forecast"]
    assert known["final"] == pytest.approx(33.0, abs=0.2)
    assert known["low"] < 33.0 < known["high"]


def test_a_forecast_with_a_time_constant_beyond_reason_takes_no_memory(log: Path) -> None:
    """Request 5151 of `python scripts/torture.py --only hostile`: pairs of time constants up to 1e20 h took 91 MB."""
    follower = Follower(log.parent)
    follower.look({"file": "run.csv", "slowest": 0.5})
    tracemalloc.start()
    told = follower.look({"file": "run.csv", "slowest": 1e20})
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    declined = seen(told, "T_CASE")["forecast"]["declined"]
    assert code_of(declined) == "value.outside-range"
    assert "3.6e+23 s" in declined
    assert re.search(": sensor: T_LID: .* 1000 s$", told["watch"]["because"])
    assert most < 10e6


def test_nothing_is_read_again_before_it_has_grown(log: Path) -> None:
    follower = Follower(log.parent)
    first = follower.look({"file": "run.csv"})
    assert follower.look({"file": "run.csv", "known": first["known"]})["same"]
    write(log, 420)
    os.utime(log, (0, 0))
    more = follower.look({"file": "run.csv", "known": first["known"]})
    assert more["rows"] == 420
    assert more["age"] > 1e6


@pytest.mark.parametrize("cut", [1, 3, 5, 9])
def test_half_of_a_line_is_no_reading(log: Path, cut: int) -> None:
    write(log, 400, cut=cut)
    told = Follower(log.parent).look({"file": "run.csv"})
    assert told["rows"] == 399
    assert min(v for v in seen(told, "T_LID")["values"] if np.isfinite(v)) > 23.0
    assert any(n.endswith(UNFINISHED) for n in told["notes"])


def test_faults_and_silences_are_gaps_with_their_reasons(log: Path) -> None:
    lines = log.read_text(encoding="utf-8").splitlines(keepends=True)
    log.write_text("".join(lines[:202] + lines[262:]), encoding="utf-8")  # the logger was off for ten minutes
    lid = seen(Follower(log.parent).look({"file": "run.csv"}), "T_LID")
    assert [(g["why"], g["count"]) for g in lid["gaps"]] == [("not a number", 20), ("nothing came", 0)]
    inside = [v for t, v in zip(lid["times"], lid["values"], strict=True) if 1000.0 <= t < 1200.0 or 2000.0 < t < 2590.0]
    assert inside
    assert not np.isfinite(inside).any()


def test_a_log_of_the_bench_is_followed_as_it_grows(tmp_path: Path) -> None:
    rom, file = "2800003C0B1A0FCF", tmp_path / "bench.log"
    lines = ["# thermid bench log 1\n"]
    for k in range(60):
        body = f"D,{k},{1000 * k + 87},{rom},{'' if k == 30 else 320 + k // 10},{'lost' if k == 30 else 'ok'}"
        lines.append(log_line(f"1 {k + 0.004211:.6f} {body}*{crc16(body)}"))
    file.write_text("".join(lines)[:-9], encoding="utf-8")
    told = Follower(tmp_path).look({"file": "bench.log"})
    assert told["rows"] == 59
    assert [g["why"] for g in seen(told, rom)["gaps"]] == ["sensor lost"]


def test_what_is_not_there_yet_is_waited_for(tmp_path: Path) -> None:
    file = tmp_path / "run.csv"
    follower = Follower(tmp_path, file)
    assert "'run.csv'" in follower.look({})["waiting"]
    waits = []
    for text in ("time_s,T_CASE\n", "time_s,pressure [Pa]\n0,1\n1,2\n"):
        file.write_text(text, encoding="utf-8")
        waits.append(follower.look({})["waiting"])
    assert all(waits)
    assert waits[0] != waits[1], "no samples yet, and no temperature"
    write(file, 6)
    told = follower.look({})
    assert told["verdict"]["word"] == "too early"


def test_only_files_of_the_project_are_opened_from_the_page(log: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    outside = tmp_path_factory.mktemp("outside") / "secret.csv"
    write(outside, 50)
    follower = Follower(log.parent)
    for name in (str(outside), "../" * 12 + "etc/passwd", f"../{outside.parent.name}/secret.csv"):
        with raises_code("file.outside-project", DeckError):
            follower.look({"file": name})
    (log.parent / "link.csv").symlink_to(outside)
    with raises_code("file.outside-project", DeckError):
        follower.look({"file": "link.csv"})
    assert follower.offered()["logs"] == ["run.csv"]
    with raises_code("studio.not-now", DeckError):
        follower.look({})
    assert Follower(log.parent, outside).look({})["rows"] == 50  # named on the command line by who may read it


@pytest.mark.parametrize(
    ("asked", "code", "match"),
    [
        ({"rule": "soon"}, "value.wrong-kind", ""),
        ({"since": "late"}, "value.wrong-kind", "'since'"),
        ({"reference": "T_AIR"}, "name.unknown", "'T_AIR'"),
    ],
)
def test_what_makes_no_sense_is_said(log: Path, asked: dict[str, Any], code: str, match: str) -> None:
    with raises_code(code, match=match):
        Follower(log.parent).look({"file": "run.csv", **asked})


def test_a_stretch_without_readings_is_too_early(log: Path) -> None:
    told = Follower(log.parent).look({"file": "run.csv", "since": 99.0})
    assert told["verdict"]["word"] == "too early"
    assert all(c["why"] for c in told["channels"])


def test_a_hostile_name_stays_text(tmp_path: Path) -> None:
    write(tmp_path / "run.csv", 60, (EVIL, "T_LID"))
    told = Follower(tmp_path).look({"file": "run.csv"})
    assert seen(told, EVIL)["values"].size
    assert "<script" not in as_json(told)


@pytest.mark.parametrize("since", [10**20, 10**30, -(10**25)])
def test_a_whole_number_beyond_a_machine_integer_is_a_time_like_any_other(log: Path, since: int) -> None:
    """numpy has no word for it: an answer of 500."""
    with suppress(ThermidError):
        Follower(log.parent).look({"file": log.name, "since": since})
