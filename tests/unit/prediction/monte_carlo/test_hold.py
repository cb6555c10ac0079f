"""How long limits are kept: against closed forms, as a file, on the command line, as a picture."""

from __future__ import annotations

import json
import math
import re
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.app.cli.app import main
from thermid.base.errors import DeckError, ScenarioError
from thermid.prediction._budget import SILENT, UNFITTED
from thermid.prediction._monte_carlo import chunks as campaign_runs
from thermid.prediction._monte_carlo.chunks import first_crossings
from thermid.prediction._monte_carlo.hold import HoldQuestion, clock, hold, hold_time, proportion

POWER, G, C = 10.0, 0.5, 500.0
TAU = C / G
DECK = """
title = "plate"
needs = ["air"]
[nodes]
body = { capacitance = "500 [J/K]", reference_point = true }
[conductors]
loss = { kind = "conduction", between = ["body", "air"], conductance = { value = "0.5 [W/K]", source = "assumed" } }
[loads]
heater = { into = "body", power = "10 [W]" }
"""
SCENARIO = 'title = "warm-up"\nstart = "air"\nduration = "1.5 [h]"\nboundaries = { air = "20 [degC]" }\n'
QUESTION = """
model = "plate.toml"
scenario = "warm.toml"
members = 400
seed = 2
limits = { body = "38 [degC]" }
spread = { air = "2 [K]" }
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name, text in (("plate.toml", DECK), ("warm.toml", SCENARIO), ("hold.toml", QUESTION)):
        (tmp_path / name).write_text(text, encoding="utf-8")
    return tmp_path


def asked(folder: Path, text: str = QUESTION) -> td.qualify.Hold:
    return question(folder, text).run()[1]


def question(folder: Path, text: str = QUESTION) -> HoldQuestion:
    (folder / "hold.toml").write_text(text, encoding="utf-8")
    return td.qualify.load_hold(folder / "hold.toml")


def test_the_hold_time_is_the_closed_form(folder: Path) -> None:
    """T = air + P/G (1 - e^(-t/tau)): 95 % keep 38 degC until the air of their hottest twentieth, 1.645 sd up, has carried it there."""
    found = asked(folder, QUESTION.replace("400", "20000"))
    point = found["body"]
    high = 20.0 + 1.6448536 * 2.0
    exact = -TAU * math.log(1.0 - (38.0 - high) / (POWER / G))
    assert point.between[0] < exact < point.between[1]
    assert point.hold == pytest.approx(exact, rel=0.02)
    reach = POWER / G * (1.0 - math.exp(-5400.0 / TAU))
    never = 0.5 * (1.0 + math.erf((38.0 - 20.0 - reach) / 2.0 / math.sqrt(2.0)))
    assert point.never_between[0] < never < point.never_between[1]
    assert point.exceedance[-1] == pytest.approx(1.0 - never, abs=0.01)
    assert (np.diff(point.exceedance) >= 0.0).all()
    assert [d.name for d in point.drivers] == ["air"]
    assert point.drivers[0].share == pytest.approx(1.0, abs=1e-6)
    assert found.sentence == f"warm-up: {clock(point.hold)} until body's 38 degC, 95 %"
    assert found.watermark == "demonstration, 1 assumed parameters"


def test_its_interval_covers_as_often_as_it_says() -> None:
    """Order statistics of 400 exponential times, 1000 times over: 95 % within two standard errors of 1.4 %, or more."""
    rng = np.random.default_rng(4)
    exact = -math.log(0.95)
    hits = [low <= exact <= high for _ in range(1000) for _, (low, high) in [hold_time(rng.exponential(size=400), 0.95)]]
    assert 0.936 < np.mean(hits) <= 0.99


def test_the_interval_of_a_probability() -> None:
    assert proportion(0, 1000) == (0.0, pytest.approx(1.0 - 0.025 ** (1 / 1000)))
    assert proportion(1000, 1000)[1] == 1.0
    low, high = proportion(30, 100)  # tables of Clopper and Pearson
    assert (low, high) == pytest.approx((0.2124, 0.3998), abs=1e-4)


def test_crossings_lie_on_the_lines_between_samples() -> None:
    rows = np.array([[-1.0, -0.5, 0.5, -3.0], [-1.0, -1.0, -1.0, -1.0], [1.0, -1.0, -1.0, 2.0]])
    assert first_crossings(np.array([0.0, 10.0, 20.0, 30.0]), rows).tolist() == [15.0, math.inf, 0.0]


def test_a_lowest_limit_and_the_limit_passed_first(folder: Path) -> None:
    """Which limit goes first differs from member to member; all together are passed no later than any."""
    text = QUESTION.replace('limits = { body = "38 [degC]" }', 'limits = { body = { highest = "38 [degC]", lowest = "19 [degC]" } }')
    found = asked(folder, text)
    low, high = found.points
    assert (low.side, low.limit) == ("lowest", 19.0)
    assert (low.hold, low.never) == (0.0, pytest.approx(0.69, abs=0.05))
    assert (found.together.crossings <= np.minimum(low.crossings, high.crossings)).all()
    assert found.together.never < min(low.never, high.never)


def test_a_limit_that_nobody_passes(folder: Path) -> None:
    found = asked(folder, QUESTION.replace("38 [degC]", "90 [degC]"))
    assert found.sentence.endswith(" 1 h 30 min, 95 %")
    assert math.isinf(found["body"].hold)
    assert found["body"].never == 1.0
    assert found["body"].drivers[0].name == "air"
    assert json.loads(json.dumps(found.to_dict()["points"]["body"]["never_between"]))[1] == 1.0


@pytest.mark.parametrize(
    ("old", "new", "code", "match"),
    [
        ("seed = 2", "seeds = 2", "file.unknown-key", r"hold.toml:5.*'seeds'.*'seed'\?"),
        ("members = 400", 'members = "400"', "file.wrong-kind", "hold.toml:4.*'400'"),
        ("members = 400", "members = 0", "file.wrong-value", "1"),
        ("members = 400", "members = 10", "value.outside-range", r"10 .* 95 %\. \w+ 400 "),
        ('limits = { body = "38 [degC]" }', "", "file.key-missing", "hold.toml"),
        ("38 [degC]", "38 [W]", "unit.wrong-dimension", ""),
        ('"38 [degC]"', '{ top = "38 [degC]" }', "file.unknown-key", "limits.body.top: 'top'"),
        ('"38 [degC]"', '{ highest = "1 [degC]", lowest = "2 [degC]" }', "value.outside-range", ""),
        ("{ body =", "{ bode =", "name.unknown", r"'bode'.*'body'\?"),
        ("warm.toml", "worm.toml", "file.not-found", r"'worm.toml'.*'warm.toml'\?"),
        ("seed = 2", 'unit = "box"', "name.unknown", "'box' for the unit"),
        ("seed = 2", "confidence = 2.0", "value.outside-range", "2. Give 0.95"),
    ],
)
def test_mistakes_in_a_question_are_named(old: str, new: str, code: str, match: str, folder: Path) -> None:
    with raises_code(code, (DeckError, ScenarioError, td.ThermidError), match=match):
        asked(folder, QUESTION.replace(old, new))


def test_no_hold_time_is_given_where_a_member_failed(folder: Path) -> None:
    runs, _ = question(folder).run()
    lost = replace(runs, failed={7: "a step could not be solved."})
    with raises_code("run.members-failed", ScenarioError, match="1.*400.*7"):
        hold(lost, {"body": "38 [degC]"})


def test_it_says_why_the_discrepancy_is_not_included(folder: Path) -> None:
    """'no values of a fit to estimate it' was said of runs that were made from a fit."""
    deck = td.load_model(folder / "plate.toml")
    scenario = td.load_scenario(folder / "warm.toml")
    times = np.arange(0.0, 5401.0, 60.0)
    truth = td.simulate(deck.with_values({"loss.conductance": "0.47 [W/K]"}), scenario, times=times)["body"].kelvin
    noisy = truth + 0.1 * np.random.default_rng(2).standard_normal(times.size)
    channel = td.Channel.from_array("T", noisy, unit="K", role="node", target="body", noise=0.1)
    fit = td.calibrate(deck, td.Record.from_arrays("log", times, {"T": channel}), ["loss.conductance"], scenario=scenario)

    def said(*values: object, **more: object) -> str:
        return hold(td.qualify.uncertain_runs(deck, scenario, list(values), n=40, **more), {"body": "38 [degC]"}).counted

    why = {name: text.partition(", because ")[2] for name, text in (("unfitted", UNFITTED), ("silent", SILENT))}
    assert said(spread={"air": "2 [K]"}).endswith(why["unfitted"])
    assert re.search(r"[\d.]+ K", said(fit))
    assert said(replace(fit.values, provenance={}, store=None)).endswith(why["silent"])


def command(*words: object) -> int:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["thermid", *map(str, words)])
        patch.setattr("thermid.app.cli.screen.SECONDS_TO_FIRST_PROGRESS", 0.0)  # progress is told however fast the machine is
        with pytest.raises(SystemExit) as left:
            main()
    return int(left.value.code or 0)


def test_members_that_do_not_reach_the_end_are_counted_with_a_reason(folder: Path) -> None:
    """'0 members are too few for 95 %' of forty, none of which reached the end: the power grows faster than what leaves."""
    runs_away = 'heater = { into = "body", power = "10 [W]", exponential_coefficient = "0.5 [1/K]", reference_temperature = "20 [degC]" }'
    text = (folder / "plate.toml").read_text(encoding="utf-8")
    (folder / "plate.toml").write_text(text.replace('heater = { into = "body", power = "10 [W]" }', runs_away), encoding="utf-8")
    with raises_code("run.members-failed", ScenarioError, match="40 of 40 .* 0: .*'body'"):
        asked(folder, QUESTION.replace("400", "40"))


def test_the_command_prints_one_object_and_progress_beside_it(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert command("hold", folder / "hold.toml", "--json", "--figure", folder / "hold.png") == 0
    said = capsys.readouterr()
    found = json.loads(said.out)
    assert found["sentence"].startswith("warm-up: ")
    assert found["points"]["body"]["limit_C"] == 38.0
    assert said.err.splitlines()[-1] == "400 of 400 runs"
    assert (folder / "hold.png").stat().st_size > 10_000
    assert command("hold", folder / "hold.toml") == 0
    again = capsys.readouterr()
    assert [t for t in again.err.splitlines() if t != "members"] == ["400 of 400 runs"]  # all of them were kept
    assert found["sentence"] in again.out


def test_an_interrupted_command_says_how_to_go_on(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    honest = campaign_runs.work

    def once(job: campaign_runs.Job, first: int, members: int, *more: Any) -> campaign_runs.Chunk:
        if first:
            raise KeyboardInterrupt
        return honest(job, first, members, *more)

    monkeypatch.setattr(campaign_runs, "work", once)
    assert command("hold", folder / "hold.toml", "--members", 1000) == 3
    assert "500 of 1000" in capsys.readouterr().err


def test_mistakes_are_told_before_anything_runs(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert command("hold", folder / "hold.toml", "--members", 10) == 2
    assert command("hold", folder / "hold.toml", "--figure", "curve.gif") == 2
    said = capsys.readouterr().err
    assert re.search(r" 95 %\. \w+ 400 ", said)
    assert all(part in said for part in ("curve.gif", "'.gif'", "GIF"))
    assert "of 400 members" not in said
    assert not (folder / "results").exists()


def test_a_question_that_needs_more_memory_than_allowed_is_refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert command("hold", folder / "hold.toml", "--members", 20_000, "--memory", 5) == 2
    assert re.search(r"20000 \w+: .* \d+ MB .* 5 MB", capsys.readouterr().err)
    assert not (folder / "results").exists() or not list((folder / "results").rglob("*.npz"))
    assert command("hold", folder / "hold.toml", "--memory", 500) == 0


def test_a_mistake_on_the_command_line_is_an_object_too(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert command("hold", folder / "hole.toml", "--json") == 2
    assert "Did you mean 'hold.toml'?" in json.loads(capsys.readouterr().out)["message"]


def test_a_picture_shows_the_share_of_members_in_per_cent(folder: Path) -> None:
    figure = pytest.importorskip("matplotlib.figure").Figure()
    from thermid.reporting._pictures.trust import draw_hold

    found = asked(folder)
    draw_hold(figure, found)
    (curve,) = (line for line in figure.axes[0].lines if len(line.get_ydata()) > 2)
    assert max(curve.get_ydata()) == pytest.approx(100.0 * found.points[0].exceedance[-1])
