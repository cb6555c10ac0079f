"""`thermid watch`: a log that grew, looked at as it did."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from unit.watch.test_watch import ICE, rising

Call = Callable[..., Any]


class TestCommand:
    def written(self, folder: Path, size: int = 240) -> Path:
        record = rising(size)
        rows = [f"{t:.0f},{v - ICE:.3f}" for t, v in zip(record.times, record["T"].values, strict=True)]
        path = folder / "bench.csv"
        path.write_text("\n".join(["time_s,T [degC]", *rows]) + "\n")
        return path

    def test_replay_stops(self, call: Call, tmp_path: Path) -> None:
        said = call("watch", self.written(tmp_path), "--slowest", "30 [min]", "--within", "2.5 [K]", "--replay", "--every", "300")
        assert said.code == 0
        assert "stop now: waiting longer does not change the" in said.out
        assert "no model is given" in said.out

    def test_json_lines(self, call: Call, tmp_path: Path) -> None:
        said = call("watch", self.written(tmp_path, 90), "--once", "--json")
        assert said.code == 4
        lines = [json.loads(line) for line in said.out.splitlines()]
        assert [line["advice"] for line in lines] == ["declined"]

    @pytest.mark.parametrize(
        ("more", "word"),
        [
            (("--every", "0"), "above zero"),
            (("--rule", "soon"), "is not a rule of stability."),
            (("--limit", "U=40"), "'U'"),
            (("--channel", "Q"), "Q"),
        ],
    )
    def test_what_is_refused(self, call: Call, tmp_path: Path, more: tuple[str, ...], word: str) -> None:
        said = call("watch", self.written(tmp_path, 90), "--once", *more)
        assert said.code not in (0, 1)
        assert word in said.err

    def test_a_log_that_is_not_there(self, call: Call, tmp_path: Path) -> None:
        said = call("watch", tmp_path / "none.csv", "--once")
        assert said.code not in (0, 1)
