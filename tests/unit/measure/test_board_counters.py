"""Counters of a board: milliseconds since it started are a clock, beside stamps they are no temperature, and their restart is named."""

from __future__ import annotations

from pathlib import Path

import pytest

import thermid as td
from by_code import raises_code
from thermid.app.cli.logs import parts_between_restarts
from thermid.base.errors import RecordError, code_of
from thermid.measure.looks import look


def rows(first: int = 0, count: int = 30) -> list[str]:
    return [f"{1000 * k + 3},{22 + 0.01 * (first + k):.2f},{21 + 0.005 * (first + k):.3f}" for k in range(count)]


@pytest.mark.parametrize("name", ["millis", "Millis", "MILLIS", "uptime_ms", "ms"])
def test_a_counter_in_milliseconds_is_a_clock(tmp_path: Path, name: str) -> None:
    path = tmp_path / "a.csv"
    path.write_text("\n".join([f"{name},T1,T2", *rows()]) + "\n")
    seen = look(path)
    assert seen.times is not None
    assert seen.times.values[-1] - seen.times.values[0] == pytest.approx(29.0)
    assert seen.times.kind in ("milliseconds, by its name", "ms")


def test_a_counter_beside_stamps_has_no_faults(tmp_path: Path) -> None:
    """It counts beyond what an instrument writes for an overload."""
    path = tmp_path / "c.txt"
    lines = [f"09:{k:02d}:00.000 -> {60000 * k + 310},{22 + 0.1 * k:.2f}" for k in range(40)]
    path.write_text("\n".join(["09:00:00.000 -> millis,T1 [degC]", *lines]) + "\n")
    seen = look(path)
    (counter,) = [c for c in seen.columns if c.name == "millis"]
    assert counter.values.max() > 1e6
    assert counter.faults == {}
    assert "faults" not in seen.campaign()


def test_a_counter_that_begins_again_is_a_restart_of_the_board(tmp_path: Path) -> None:
    path = tmp_path / "b.csv"
    path.write_text("\n".join(["millis,T1,T2", *rows(), *rows(30)]) + "\n")
    with raises_code("record.time-order", RecordError, match=r"b\.csv:32.*'millis'.*3.*29003"):
        td.read_record(path, {"T1": {"node": "a"}})
    assert code_of(look(path).problem) == "record.time-order"
    assert "`thermid look b.csv --cut FOLDER`" in look(path).problem


def test_a_log_is_cut_at_restarts_into_logs_of_their_own(tmp_path: Path) -> None:
    """A board greets and writes its header again; the parts keep their readings and the lines above, each on its own clock."""
    path = tmp_path / "e.csv"
    path.write_text(
        "\n".join(["# SYNTHETIC", "millis,T1 [degC],T2 [degC]", *rows(), "Hello v1.2", "millis,T1 [degC],T2 [degC]", *rows(30, 20)]) + "\n"
    )
    for k, text in enumerate(parts_between_restarts(path), 1):
        (tmp_path / f"e_{k}.csv").write_text(text)
    first, second = (td.read_record(tmp_path / f"e_{k}.csv", {"T1": {"node": "a"}}) for k in (1, 2))
    assert (first.times.size, second.times.size) == (30, 20)
    assert second.times[0] == pytest.approx(0.003)
    assert second["T1"].values[0] == pytest.approx(273.15 + 22.30)
    assert "SYNTHETIC" in (tmp_path / "e_2.csv").read_text()
    with raises_code("record.does-not-apply", RecordError, match=r"e_1\.csv"):
        parts_between_restarts(tmp_path / "e_1.csv")


def test_a_counter_beside_stamps_is_ignored_and_its_restart_named(tmp_path: Path) -> None:
    lines = [f"10:00:{k:02d}.100 -> t={1000 * k} T1: {22 + 0.01 * k:.2f} C" for k in range(1, 30)]
    lines += [f"10:00:{k:02d}.100 -> t={1000 * (k - 35)} T1: {22 + 0.01 * k:.2f} C" for k in range(36, 59)]
    path = tmp_path / "c.txt"
    path.write_text("\n".join(lines) + "\n")
    seen = look(path)
    (counter,) = [c for c in seen.columns if c.name == "t"]
    assert counter.guess == "ignored"
    assert "counts milliseconds" in counter.why
    (question,) = [q for q in seen.questions if "'t'" in q]
    assert all(part in question for part in ("35 s", "'t'"))
    assert question in td.read_record(path, {"T1": {"node": "a"}}).origin.questions


def test_of_a_counter_that_begins_again_and_stamps_the_stamps_are_the_clock(tmp_path: Path) -> None:
    """A board's own milliseconds beside the stamps of the computer that captures it: only these go on over a restart."""
    path = tmp_path / "d.csv"
    counts = [1000 * k + 3 for k in range(30)] * 2
    path.write_text("\n".join(["stamp,ms,T_C", *(f"2026-03-10 09:{k:02d}:06.000,{n},{22 + 0.01 * k:.2f}" for k, n in enumerate(counts))]))
    seen = look(path)
    assert (seen.problem, [c.name for c in seen.columns if c.guess == "time"]) == ("", ["stamp"])
    assert seen.times.values[-1] - seen.times.values[0] == pytest.approx(59 * 60.0)
    assert any("30 min" in q and "'ms'" in q for q in seen.questions)


@pytest.mark.parametrize(("digits", "clock"), [(".000", "stamp"), ("", "stamp"), ("00", "ms")])
def test_stamps_are_the_clock_beside_a_counter_that_never_begins_again(tmp_path: Path, digits: str, clock: str) -> None:
    """Else logs could not be joined by the time of day; stamps of whole minutes, of which several are alike, tell less than the counter."""
    seconds = [f":{10 * (k % 6):02d}{digits}" if digits != "00" else "" for k in range(60)]
    lines = [f"2026-03-10 09:{k // 6:02d}{of},{10000 * k + 311},{22 + 0.01 * k:.2f}" for k, of in enumerate(seconds)]
    path = tmp_path / "acc.csv"
    path.write_text("\n".join(["stamp,ms,T_C", *lines]))
    seen = look(path)
    assert (seen.problem, [c.name for c in seen.columns if c.guess == "time"]) == ("", [clock])
    assert seen.times.values[-1] - seen.times.values[0] == pytest.approx(590.0)


def test_a_counter_in_seconds_is_a_clock_and_its_restart_is_named(tmp_path: Path) -> None:
    """A board that prints `s` counts seconds: the restart is the fault, no missing time column."""
    lines = [f"{20 * k},{22 + 0.01 * k:.2f}" for k in range(60)]
    path = tmp_path / "e.txt"
    path.write_text("\n".join(["s,T1", *lines]) + "\n")
    assert look(path).times.values[-1] == pytest.approx(1180.0)
    path.write_text("\n".join(["s,T1", *lines, "s,T1", *lines, "1200,23.1"]) + "\n")
    assert code_of(look(path).problem) == "record.time-order"
    assert "1180" in look(path).problem
