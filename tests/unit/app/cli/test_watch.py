"""`thermid watch`: a log that grew, looked at as it did."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from thermid.campaign.stages import run_stages
from unit.fit.planted import planted
from unit.qualify.watch.test_watch import ICE, rising

pytestmark = pytest.mark.usefixtures("values_alone")

Call = Callable[..., Any]


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished campaign of three levels."""
    root = tmp_path_factory.mktemp("running")
    run_stages(planted(root, bias=0.0), cache=root / "results").save(root / "results")
    return root


def test_columns_and_model_are_those_of_a_campaign(call: Call, running: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(running)
    given = ("watch", "logs/whole_two.csv", "--campaign", "campaign.toml", "--look", "once")
    look = call(*given, "--record", "whole_one", "--json").object
    assert set(look["ends"]) == {"T_PB", "T_C"}
    assert [n for n, node in look["nodes"].items() if not node["measured"]] == ["p.a.case"]
    assert look["standing"]["state"] in ("credible", "unjudged")
    for more, words in (((), "box_bench, pairs, wholes"), (("--record", "nobody"), "'nobody'")):
        said = call(*given, *more)
        assert (said.code, said.codes) == (2, ("name.unknown",))
        assert words in said.err


class TestCommand:
    def written(self, folder: Path, size: int = 240) -> Path:
        record = rising(size)
        rows = [f"{t:.0f},{v - ICE:.3f}" for t, v in zip(record.times, record["T"].values, strict=True)]
        path = folder / "bench.csv"
        path.write_text("\n".join(["time_s,T [degC]", *rows]) + "\n")
        return path

    def test_replay_stops(self, call: Call, tmp_path: Path) -> None:
        said = call("watch", self.written(tmp_path), "--slowest", "30 [min]", "--within", "2.5 [K]", "--look", "replay", "--every", "300")
        assert said.code == 0
        assert "stop now: " in said.out
        assert len({line for line in said.out.splitlines() if "assumed: " in line}) == 1, "that no model is given"

    def test_what_the_file_leaves_open(self, call: Call, tmp_path: Path) -> None:
        path = tmp_path / "counted.csv"
        path.write_text("\n".join(["k;T [degC]", *(f"{10 * k};{20 + k / 10:.1f}" for k in range(60))]) + "\n")
        assert "record.time-unclear" in call("watch", path, "--look", "once").codes
        assert "T: +36" in call("settle", path, "--time", "k").out
        read = ("--read", "time=k", "--read", "separator=;")
        assert call("watch", path, "--look", "once", "--json", *read).object["advice"] == "wait"

    def test_json_lines(self, call: Call, tmp_path: Path) -> None:
        said = call("watch", self.written(tmp_path, 90), "--look", "once", "--json")
        assert said.code == 4
        lines = [json.loads(line) for line in said.out.splitlines()]
        assert [line["advice"] for line in lines] == ["declined"]

    def test_a_port_is_no_log(self, call: Call) -> None:
        said = call("watch", "/dev/null", "--json")
        assert (said.code, said.object["code"]) == (2, "file.not-a-file")

    @pytest.mark.parametrize(
        ("more", "code", "match"),
        [
            (("--every", "0"), "value.outside-range", "--every: .*'0'"),
            (("--rule", "soon"), "value.wrong-kind", "'soon' .* 3 C/h"),
            (("--limit", "U=40"), "name.unknown", "'U'"),
            (("--channel", "Q"), "name.unknown", "Q"),
            (("--read", "comma=;"), "name.unknown", "'comma'.* time, separator, decimal, clock"),
        ],
    )
    def test_what_is_refused(self, call: Call, tmp_path: Path, more: tuple[str, ...], code: str, match: str) -> None:
        said = call("watch", self.written(tmp_path, 90), "--look", "once", *more)
        assert (said.code, said.codes) == (2, (code,))
        assert re.search(match, said.err)

    def test_a_log_that_is_not_there(self, call: Call, tmp_path: Path) -> None:
        said = call("watch", tmp_path / "none.csv", "--look", "once")
        assert said.code not in (0, 1)
