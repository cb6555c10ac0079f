"""A log in the studio, watched as `thermid watch` does: with the model of a deck, as a campaign says, or by its readings."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from by_code import raises_code
from thermid.app.cli.app import app
from thermid.app.studio.follow import Follower, LiveWatch
from thermid.app.studio.project import Project
from thermid.base.errors import RecordError, ThermidError, code_of
from thermid.measure.records import StabilityRule
from thermid.model.tree import Model
from unit.fit.estimation.rig import Array, logged, rig, run

pytestmark = pytest.mark.usefixtures("values_alone")

RULE = StabilityRule.named("3 C/h")
STEP = 10.0
"""Between readings of the logs. [s]"""
DECK = """
title = "rig"
needs = ["air"]
[nodes]
chip = { capacitance = "60 [J/K]" }
case = { capacitance = "450 [J/K]" }
lid = { capacitance = "250 [J/K]" }
[conductors]
pad = { kind = "conduction", between = ["chip", "case"], conductance = "2.5 [W/K]" }
screws = { kind = "conduction", between = ["case", "lid"], conductance = "0.8 [W/K]" }
fins = { kind = "convection", between = ["case", "air"], htc = "14 [W/(m^2 K)]", area = "0.04 [m^2]" }
lid_air = { kind = "convection", between = ["lid", "air"], htc = "6 [W/(m^2 K)]", area = "0.02 [m^2]" }
[loads]
heater = { into = "chip", power = "12 [W]" }
"""
CAMPAIGN = """
title = "rig"
[records.warm]
file = "warm.csv"
[records.warm.channels]
chip = { node = "chip", noise = "0.05 [K]", accuracy = "0.3 [K]" }
case = { node = "case", noise = "0.05 [K]", accuracy = "0.3 [K]" }
[[stages]]
name = "rig"
model = "rig.toml"
records = ["warm"]
scenario = { start = "22 [degC]", boundaries = { air = "22 [degC]" } }
free = ["pad.conductance", "fins.htc"]
"""


def write(file: Path, courses: dict[str, Array], seed: int, end: int | None = None) -> Path:
    """Write a synthetic log of the rig's two sensors and return its path."""
    made = logged({n: v[:end] for n, v in courses.items()}, seed, STEP)
    rows = [
        f"{t:.0f},{a:.3f},{b:.3f}" for t, a, b in zip(made.times, made["chip"].values - 273.15, made["case"].values - 273.15, strict=True)
    ]
    file.write_text("\n".join(["# SYNTHETIC", "time_s,chip [degC],case [degC]", *rows]) + "\n", encoding="utf-8")
    return file


def warm(seconds: float) -> dict[str, Array]:
    return run(rig(), seconds, {"start": "22 [degC]"}, STEP)


@pytest.fixture
def log(tmp_path: Path) -> Callable[..., Path]:
    return lambda seconds, name="run.csv": write(tmp_path / name, warm(seconds), 3)


def held() -> Callable[[], Model]:
    model = rig()
    return lambda: model


def printed(*arguments: str) -> dict[str, Any]:
    """Return what `thermid watch --look once --json` prints, without the number of its form."""
    done = CliRunner().invoke(app, ["watch", *arguments, "--look", "once", "--json"])
    said: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    assert said.pop("schema") == 1
    return said


@pytest.mark.parametrize("count", [3, pytest.param(20, marks=pytest.mark.campaign)])
def test_the_studio_says_what_the_command_prints(tmp_path: Path, count: int) -> None:
    """Logs, short and long, with and without a fault, by the deck, by the campaign and by their readings; other rules and widths."""
    (tmp_path / "rig.toml").write_text(DECK, encoding="utf-8")
    (tmp_path / "campaign.toml").write_text(CAMPAIGN, encoding="utf-8")
    write(tmp_path / "warm.csv", warm(3600.0), 1)
    deck, campaign = (Project(tmp_path / name) for name in ("rig.toml", "campaign.toml"))
    campaign.look("rig")
    campaign.run("rig")
    campaign.judge(write=True)
    ways = {
        "deck": (deck.subject, {"boundaries": "air=22"}, ["--model", str(tmp_path / "rig.toml"), "--boundary", "air=22 [degC]"]),
        "campaign": (campaign.subject, {}, ["--campaign", str(tmp_path / "campaign.toml")]),
        "readings": (lambda: None, {}, []),
    }
    words = set()
    for k in range(count):
        courses = warm(900.0 + 300.0 * (k % 8))
        if k % 4 == 0:
            courses["case"][-40:] = 273.15  # a sensor that fell off
        path, (known, asked, given) = write(tmp_path / f"log{k}.csv", courses, k), list(ways.values())[k % len(ways)]
        rule, within = ("3 C/h", "1 K over 4 h")[k % 2], (1.0, 0.3)[k // 2 % 2]
        told = LiveWatch(known).look(path, StabilityRule.named(rule), {**asked, "within": within})
        assert [told.pop(n) for n in ("unused", "model", "like")] == ["", "rig" if given else "", "warm" if k % 3 == 1 else ""]
        told.pop("bound")
        assert told == printed(str(path), *given, "--rule", rule, "--within", f"{within} [K]")
        words |= {told["advice"], *(a["kind"] for a in told["alarms"])}
    assert "sensor" in words
    assert count < 20 or {"stop", "declined"} < words


def test_of_records_with_columns_of_the_log_one_of_the_last_stage_is_taken(tmp_path: Path) -> None:
    """A part's record has a column of the same name, of a node that the whole does not have by that name."""
    (tmp_path / "rig.toml").write_text(DECK, encoding="utf-8")
    part = '[records.part]\nfile = "warm.csv"\n[records.part.channels]\nchip = { node = "core", noise = "0.05 [K]" }\n[records.warm]'
    (tmp_path / "campaign.toml").write_text(CAMPAIGN.replace("[records.warm]", part, 1), encoding="utf-8")
    log = write(tmp_path / "warm.csv", warm(3600.0), 1)
    project = Project(tmp_path / "campaign.toml")
    project.look("rig")
    project.run("rig")
    project.judge(write=True)
    told = LiveWatch(project.subject).look(log, RULE, {"within": 1.0})
    assert (told["like"], told["unused"]) == ("warm", "")


def test_a_deck_foresees_the_end_and_its_hidden_node(log: Callable[..., Path]) -> None:
    live = LiveWatch(held())
    early = live.look(log(900.0), RULE, {"boundaries": "air=22"})
    late = live.look(log(2700.0), RULE, {"boundaries": "air=22"})
    assert (early["advice"], late["advice"]) == ("declined", "stop")
    assert late["model"] == "rig"
    assert late["decisions"] > early["decisions"]
    assert late["nodes"]["lid"]["measured"] is False


def test_a_fault_is_an_alarm_that_stays(tmp_path: Path) -> None:
    courses = warm(3600.0)
    courses["case"][250:] = 273.15
    told = LiveWatch(held()).look(write(tmp_path / "run.csv", courses, 3), RULE, {"boundaries": "air=22"})
    assert told["alarms"][0]["suspect"] == "case"
    assert told["advice"] == "declined"


@pytest.mark.parametrize(("asked", "words"), [({}, "'air' "), ({"boundaries": "air"}, "PATH=VALUE")])
def test_what_the_model_lacks_is_stated(log: Callable[..., Path], asked: dict[str, str], words: str) -> None:
    told = LiveWatch(held()).look(log(900.0), RULE, asked)
    assert words in told["because"] + told["unused"]
    assert told["model"] == ""


def test_conditions_hold_since_a_time(log: Callable[..., Path]) -> None:
    """Readings before it are left out, as the command leaves them out."""
    path = log(2700.0)
    told = LiveWatch(lambda: None).look(path, RULE, {}, since=600.0)
    assert {k: v for k, v in told.items() if k not in ("unused", "model", "like", "bound")} == printed(str(path), "--since", "600 [s]")


def test_another_log_is_watched_anew(log: Callable[..., Path]) -> None:
    asked = {"boundaries": "air=22"}
    first = LiveWatch(held()).look(log(900.0, "two.csv"), RULE, asked)
    live = LiveWatch(held())
    live.look(log(2700.0, "one.csv"), RULE, asked)
    assert live.look(log(900.0, "two.csv"), RULE, asked) == first
    live.look(log(2700.0, "one.csv"), RULE, asked)
    assert live.look(log(900.0, "one.csv"), RULE, asked) == first  # it begins anew in the same file


def test_a_width_that_is_none_is_refused_in_words(log: Callable[..., Path]) -> None:
    assert code_of(LiveWatch(held()).look(log(900.0), RULE, {"within": -1.0})["because"]) == "value.outside-range"


def test_the_bench_view_has_it(tmp_path: Path, log: Callable[..., Path]) -> None:
    log(2700.0)
    told = Follower(tmp_path, None, LiveWatch(held())).look({"file": "run.csv", "boundaries": "air=22"})
    assert told["watch"]["advice"] == "stop"
    assert np.isfinite(told["watch"]["ends"]["chip"]["final_C"])
    with pytest.raises(ThermidError):
        Follower(tmp_path, None, LiveWatch(held())).look({"file": "run.csv", "since": "soon"})


UNNAMED = {"A0": {"node": "chip", "unit": "degF"}, "A1": {"node": "case"}}
DUTY = {"Q1": {"load": "heater", "full_scale": "24 [W]"}}


def unnamed(path: Path, seconds: float) -> Path:
    """Write a synthetic log whose columns have no name of the deck and no unit: one in degF, a duty in per cent."""
    made = logged(warm(seconds), 3, STEP)
    chip, case = (made[n].values - 273.15 for n in ("chip", "case"))
    rows = [f"{t:.0f},{1.8 * a + 32.0:.4f},{b:.4f},50" for t, a, b in zip(made.times, chip, case, strict=True)]
    path.write_text("\n".join(["# SYNTHETIC", "time_s,A0,A1,Q1 [%]", *rows]) + "\n", encoding="utf-8")
    return path


def test_columns_bound_on_the_page_are_those_of_the_command(tmp_path: Path) -> None:
    """Units where the log has none, a duty with its power at 100 %: the same look as by --channel."""
    (tmp_path / "rig.toml").write_text(DECK, encoding="utf-8")
    path = unnamed(tmp_path / "run.csv", 2700.0)
    asked = {"boundaries": "air=22", "channels": {**UNNAMED, **DUTY, "time_s": {"unit": "s"}}}
    told = LiveWatch(Project(tmp_path / "rig.toml").subject).look(path, RULE, asked)
    assert told["model"] == "rig"
    assert told["unused"] == told["like"] == ""
    assert told.pop("bound") == {**UNNAMED, **DUTY}
    channels = ("--channel", "A0=chip [degF]", "--channel", "A1=case", "--channel", "Q1=heater [24 W]")
    said = printed(str(path), "--model", str(tmp_path / "rig.toml"), "--boundary", "air=22 [degC]", *channels)
    assert {k: v for k, v in told.items() if k not in ("unused", "model", "like", "bound")} == said
    assert told["advice"] == "stop"


def test_what_columns_look_like_is_said_and_what_they_may_be(tmp_path: Path) -> None:
    """Nothing is recognised, so the page offers the table; what is bound there is drawn, in its unit."""
    (tmp_path / "rig.toml").write_text(DECK, encoding="utf-8")
    path = unnamed(tmp_path / "run.csv", 900.0)
    follower = Follower(tmp_path, path, LiveWatch(Project(tmp_path / "rig.toml").subject))
    waits = follower.look({})
    assert waits["waiting"]
    assert [(c["name"], c["guess"]) for c in waits["columns"]] == [("A0", "ignored"), ("A1", "ignored"), ("Q1", "duty")]
    assert " 100 %" in waits["columns"][2]["why"]
    assert waits["roles"] == {"chip": "node", "case": "node", "lid": "node", "air": "boundary", "heater": "load"}
    seen = follower.look({"boundaries": "air=22", "channels": {**UNNAMED, **DUTY}})
    assert [c["name"] for c in seen["channels"]] == ["A0", "A1"]
    assert 22.0 < seen["channels"][0]["latest"] < 60.0  # degC of a column in degF
    assert seen["watch"]["bound"] == {**UNNAMED, **DUTY}


def test_columns_bound_on_the_page_keep_what_a_record_says_of_them(tmp_path: Path) -> None:
    """Noise and accuracy of the campaign's record stay where a column of it is bound to another node; else the last stage's model."""
    (tmp_path / "rig.toml").write_text(DECK, encoding="utf-8")
    (tmp_path / "campaign.toml").write_text(CAMPAIGN, encoding="utf-8")
    write(tmp_path / "warm.csv", warm(3600.0), 1)
    project = Project(tmp_path / "campaign.toml")
    project.look("rig")
    project.run("rig")
    project.judge(write=True)
    project.judge(write=True)
    live, like = LiveWatch(project.subject), write(tmp_path / "like.csv", warm(900.0), 3)
    swapped = live.look(like, RULE, {"channels": {"chip": {"node": "lid"}, "case": {"node": "case"}}})
    assert swapped["like"] == "warm"
    assert swapped["bound"]["chip"] == {"node": "lid", "noise": "0.05 [K]", "accuracy": "0.3 [K]"}
    other = live.look(unnamed(tmp_path / "run.csv", 900.0), RULE, {"boundaries": "air=22", "channels": UNNAMED})
    assert (other["model"], other["like"], other["unused"]) == ("rig", "", "")


@pytest.mark.parametrize("channels", [["A0"], {"A0": "chip"}, {"A0": {"node": 3}}])
def test_columns_that_are_no_tables_are_refused(tmp_path: Path, channels: object) -> None:
    follower = Follower(tmp_path, unnamed(tmp_path / "run.csv", 900.0))
    with raises_code("value.wrong-kind", RecordError, match="'channels'"):
        follower.look({"channels": channels})


def test_a_log_like_a_record_is_watched_whatever_its_columns_are_called(tmp_path: Path) -> None:
    """Columns without a T in front, a power of volts and amperes: the page waited for a temperature, and had no model."""
    (tmp_path / "rig.toml").write_text(DECK, encoding="utf-8")
    named = CAMPAIGN.replace("chip = {", '"U7" = {').replace(
        "case = {", 'P = { load = "heater", power = { volts = "U", amperes = "I" } }\n"U8" = {'
    )
    (tmp_path / "campaign.toml").write_text(named, encoding="utf-8")
    for file, seconds in (("warm.csv", 3600.0), ("like.csv", 900.0)):
        head, *rows = write(tmp_path / file, warm(seconds), 1).read_text(encoding="utf-8").splitlines()[1:]
        text = "\n".join([head.replace("chip [degC],case [degC]", "U7,U8") + ",U [V],I [A]", *(f"{r},12,1" for r in rows), ""])
        (tmp_path / file).write_text(text, encoding="utf-8")
    project = Project(tmp_path / "campaign.toml")
    project.look("rig")
    project.run("rig")
    project.judge(write=True)
    project.judge(write=True)
    seen = Follower(tmp_path, None, LiveWatch(project.subject)).look({"file": "like.csv"})
    assert [c["name"] for c in seen["channels"]] == ["U7", "U8"]
    assert (seen["watch"]["model"], seen["watch"]["like"]) == ("rig", "warm")
