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


def record(seconds: float) -> Record:
    return logged(run(rig(), seconds, {"start": "22 [degC]"}, 10.0), 3)


def test_a_deck_foresees_the_end_and_its_hidden_node() -> None:
    live = LiveWatch(rig)
    early = live.look(record(900.0), RULE, {"boundaries": "air=22"})
    late = live.look(record(2700.0), RULE, {"boundaries": "air=22"})
    assert (early["advice"], late["advice"]) == ("declined", "stop")
    assert late["model"] == "rig"
    assert late["decisions"] == early["decisions"] + 1
    assert late["nodes"]["lid"]["measured"] is False


def test_a_fault_is_an_alarm_that_stays() -> None:
    courses = run(rig(), 3600.0, {"start": "22 [degC]"}, 10.0)
    courses["case"][250:] = 273.15
    told = LiveWatch(rig).look(logged(courses, 3), RULE, {"boundaries": "air=22"})
    assert told["alarms"][0]["suspect"] == "case"
    assert told["advice"] == "declined"


@pytest.mark.parametrize(("asked", "words"), [({}, "'air' is not known"), ({"boundaries": "air"}, "must be written as PATH=VALUE")])
def test_what_the_model_lacks_is_stated(asked: dict[str, str], words: str) -> None:
    told = LiveWatch(rig).look(record(900.0), RULE, asked)
    assert words in " ".join([told["because"], *told["assumed"]])
    assert told["model"] == ""


def test_another_log_is_watched_anew() -> None:
    live = LiveWatch(rig)
    live.look(record(2700.0), RULE, {"boundaries": "air=22"})
    assert live.look(record(900.0), RULE, {"boundaries": "air=22"})["decisions"] == 1


def test_a_width_that_is_none_is_refused_in_words() -> None:
    assert "above zero" in LiveWatch(rig).look(record(900.0), RULE, {"within": -1.0})["because"]


def test_the_bench_view_has_it(tmp_path: Path) -> None:
    made = record(2700.0)
    rows = [
        f"{t:.0f},{a:.3f},{b:.3f}" for t, a, b in zip(made.times, made["chip"].values - 273.15, made["case"].values - 273.15, strict=True)
    ]
    (tmp_path / "run.csv").write_text("\n".join(["time_s,chip [degC],case [degC]", *rows]) + "\n")
    told = Follower(tmp_path, None, LiveWatch(rig)).look({"file": "run.csv", "boundaries": "air=22"})
    assert told["watch"]["advice"] == "stop"
    assert np.isfinite(told["watch"]["ends"]["chip"]["final_C"])
    with pytest.raises(RecordError):
        Follower(tmp_path, None, LiveWatch(rig)).look({"file": "run.csv", "since": "soon"})
