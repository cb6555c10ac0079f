"""A log in the studio, watched as `thermid watch` does: with the model of a deck, or by its readings."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from thermid.app.studio.follow import Follower
from thermid.app.studio.live import LiveWatch
from thermid.base.errors import RecordError
from thermid.measure.records import Record
from thermid.measure.steadiness import rule_of
from unit.fit.estimation.rig import logged, rig, run

RULE = rule_of("3 C/h")


def written(folder: Path, record: Record) -> Path:
    """Write the log of the rig."""
    rows = [
        f"{t:.0f},{a:.3f},{b:.3f}"
        for t, a, b in zip(record.times, record["chip"].values - 273.15, record["case"].values - 273.15, strict=True)
    ]
    path = folder / "run.csv"
    path.write_text("\n".join(["time_s,chip [degC],case [degC]", *rows]) + "\n")
    return path


def log(folder: Path, seconds: float) -> Path:
    return written(folder, logged(run(rig(), seconds, {"start": "22 [degC]"}, 10.0), 3))


def test_a_deck_foresees_the_end_and_its_hidden_node(tmp_path: Path) -> None:
    live = LiveWatch(rig)
    early = live.look(log(tmp_path, 900.0), RULE, {"boundaries": "air=22"})
    late = live.look(log(tmp_path, 2700.0), RULE, {"boundaries": "air=22"})
    assert (early["advice"], late["advice"]) == ("declined", "stop")
    assert late["model"] == "rig"
    assert late["decisions"] > early["decisions"]
    assert late["nodes"]["lid"]["measured"] is False


def test_a_fault_is_an_alarm_that_stays(tmp_path: Path) -> None:
    courses = run(rig(), 3600.0, {"start": "22 [degC]"}, 10.0)
    courses["case"][250:] = 273.15
    told = LiveWatch(rig).look(written(tmp_path, logged(courses, 3)), RULE, {"boundaries": "air=22"})
    assert told["alarms"][0]["suspect"] == "case"
    assert told["advice"] == "declined"


@pytest.mark.parametrize(("asked", "words"), [({}, "'air' is not known"), ({"boundaries": "air"}, "must be written as PATH=VALUE")])
def test_what_the_model_lacks_is_stated(tmp_path: Path, asked: dict[str, str], words: str) -> None:
    told = LiveWatch(rig).look(log(tmp_path, 900.0), RULE, asked)
    assert words in " ".join([told["because"], *told["assumed"]])
    assert told["model"] == ""


def test_another_log_is_watched_anew(tmp_path: Path) -> None:
    live = LiveWatch(rig)
    live.look(log(tmp_path, 2700.0), RULE, {"boundaries": "air=22"})
    assert live.look(log(tmp_path, 900.0), RULE, {"boundaries": "air=22"})["at_s"] == 900.0


def test_a_width_that_is_none_is_refused_in_words(tmp_path: Path) -> None:
    assert "above zero" in LiveWatch(rig).look(log(tmp_path, 900.0), RULE, {"within": -1.0})["because"]


def test_the_bench_view_has_it(tmp_path: Path) -> None:
    log(tmp_path, 2700.0)
    told = Follower(tmp_path, None, LiveWatch(rig)).look({"file": "run.csv", "boundaries": "air=22"})
    assert told["watch"]["advice"] == "stop"
    assert np.isfinite(told["watch"]["ends"]["chip"]["final_C"])
    with pytest.raises(RecordError):
        Follower(tmp_path, None, LiveWatch(rig)).look({"file": "run.csv", "since": "soon"})
