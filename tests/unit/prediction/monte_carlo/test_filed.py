"""A values file over a deck that was changed since: every route that reads one leaves the same out and says so."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import thermid as td
from by_code import raises_code
from thermid.app.cli.app import app
from thermid.base.errors import NameNotFoundError
from thermid.prediction.bands import Knowledge
from thermid.values.store import Filed

G = "loss.conductance"
DECK = """
title = "plate"
needs = ["air"]
[nodes]
body = { capacitance = "500 [J/K]", reference_point = true }
[conductors]
loss = { kind = "conduction", between = ["body", "air"], conductance = { value = "0.5 [W/K]", min = 0.1, max = 2 } }
[loads]
heater = { into = "body", power = { value = "10 [W]", min = 1, max = 20 } }
"""
SCENARIO = 'title = "soak"\nstart = "air"\nduration = "6 [h]"\nboundaries = { air = "20 [degC]" }\n'
HOLD = 'model = "plate.toml"\nscenario = "soak.toml"\nvalues = "fit.toml"\nmembers = 64\nlimits = { body = "90 [degC]" }\n'
PLAN = """
title = "plate, qualified"
objectives = ["limits kept"]
success = ["every verdict met"]
[model]
deck = "plate.toml"
values = "fit.toml"
[limits.body]
node = "body"
operating = ["-20 [degC]", "90 [degC]"]
[sensors]
T = { node = "body", reason = "the only one", accuracy = "0.3 [K]", noise = "0.1 [K]" }
[[tests]]
name = "soak"
kind = "thermal cycling"
scenario = { boundaries = { air = "20 [degC]" }, start = "20 [degC]", duration = "6 [h]" }
"""


@pytest.fixture(scope="module")
def fit() -> td.Calibration:
    times = np.linspace(0.0, 6000.0, 61)
    model = td.model_from_dict(tomllib.loads(DECK))
    course = td.Scenario("log", boundaries={"air": "20 [degC]"}, start="20 [degC]", duration=6000.0)
    run = td.simulate(model.with_values({G: "0.4 [W/K]"}), course, times=times)
    noise = 0.05 * np.random.default_rng(1).standard_normal(times.size)
    made = td.Channel.from_array("T", run["body"].kelvin + noise, unit="K", role="node", target="body", noise=0.05)
    return td.calibrate(model, td.Record.from_arrays("log", times, {"T": made}), [G], scenario=course)


@pytest.fixture
def folder(tmp_path: Path, fit: td.Calibration) -> Path:
    fit.save(tmp_path / "fit.toml")
    for name, text in (("plate.toml", DECK), ("soak.toml", SCENARIO), ("hold.toml", HOLD), ("plan.toml", PLAN), ("thermid.toml", "")):
        (tmp_path / name).write_text(text)
    return tmp_path


def command(folder: Path, *given: str) -> tuple[str, str]:
    said = CliRunner().invoke(app, [x.replace("@", f"{folder}/") for x in given])
    assert said.exit_code in (0, 5), said.output
    return said.stdout, said.stderr


def by_simulate(folder: Path) -> tuple[float, str]:
    out, err = command(folder, "simulate", "@plate.toml", "--scenario", "@soak.toml", "--values", "@fit.toml", "--json")
    return json.loads(out)["nodes"]["body"]["final_C"], err


def by_hold(folder: Path) -> tuple[float, str]:
    runs, found = td.qualify.load_hold(folder / "hold.toml").run()
    return float(np.median(runs.node_temperatures("body")[:, -1])) - 273.15, str(found)


def by_plan(folder: Path) -> tuple[float, str]:
    found = td.qualify.run_plan(folder / "plan.toml")
    assert found.to_dict()["remarks"] == list(found.knowledge.remarks)
    return float(found["soak"].expected.prediction["body"].celsius[-1]), str(found)


def by_deliver(folder: Path) -> tuple[float, str]:
    to = folder / "out"
    _, err = command(folder, "deliver", "@plate.toml", "--scenario", "@soak.toml", "--values", "@fit.toml", "--to", str(to))
    (run,) = json.loads((to / "checks.json").read_text())["runs"].values()
    return run["temperatures_C"]["body"][-1], err


def by_predict(folder: Path) -> tuple[float, str]:
    out, err = command(folder, "predict", "@plate.toml", "--scenario", "@soak.toml", "--values", "@fit.toml", "--json")
    return json.loads(out)["nodes"]["body"]["final"]["C"], err


ROUTES = [by_simulate, by_hold, by_plan, by_deliver, by_predict]


@pytest.mark.parametrize("route", ROUTES, ids=lambda r: r.__name__)
def test_every_route_lays_what_applies_and_leaves_out_what_does_not(folder: Path, route: Callable[[Path], tuple[float, str]]) -> None:
    laid, said = route(folder)
    # members differ, since parts and powers differ from run to run by some per cent: the median of 64 has an error of about 0.1 K
    assert laid == pytest.approx(20.0 + 10.0 / 0.4, abs=0.3 if route is by_hold else 0.1)
    assert "left out:" not in said


@pytest.mark.parametrize("route", ROUTES, ids=lambda r: r.__name__)
def test_every_route_tells_that_the_deck_is_another(folder: Path, route: Callable[[Path], tuple[float, str]]) -> None:
    (folder / "plate.toml").write_text(DECK.replace("0.5 [W/K]", "0.8 [W/K]"))
    bare, said = route(folder)
    # members differ by 0.53 K, since parts differ from run to run by some per cent: the median of 64 has an error of 0.08 K
    assert bare == pytest.approx(20.0 + 10.0 / 0.8, abs=0.3 if route is by_hold else 0.1)
    assert f"{G} = " in said
    assert "0.8 [W/K], but had 0.5 [W/K]" in said


def test_a_delivery_keeps_them_if_asked_to(folder: Path) -> None:
    (folder / "plate.toml").write_text(DECK.replace("0.5 [W/K]", "0.8 [W/K]"))
    given = ["deliver", "@plate.toml", "--scenario", "@soak.toml", "--values", "@fit.toml", "--to", "@kept", "--keep-values"]
    _, err = command(folder, *given)
    (run,) = json.loads((folder / "kept" / "checks.json").read_text())["runs"].values()
    assert run["temperatures_C"]["body"][-1] == pytest.approx(20.0 + 10.0 / 0.4, abs=0.1)
    assert err == ""


def test_a_file_written_by_hand_does_for_all(folder: Path) -> None:
    (folder / "fit.toml").write_text(f'"{G}" = {{ value = "0.4 [W/K]", sd = "1 [%]" }}\n')
    for route in ROUTES:
        laid, said = route(folder)
        assert laid == pytest.approx(45.0, abs=0.1)
        assert "left out:" not in said


def test_of_a_part_a_set_above_wins_and_a_line_says_so(folder: Path) -> None:
    (folder / "rig.toml").write_text(
        'title = "rig"\nneeds = ["air"]\n[submodels.p]\nuse = "plate.toml"\nbind = { air = "air" }\n'
        '[set]\n"p.loss.conductance" = "1 [W/K]"\n'
    )
    found = Filed.read(folder / "fit.toml", td.load_model(folder / "rig.toml"), at="p")
    assert found.model.at(f"p.{G}").text == "1 [W/K]"
    (line,) = found.lines
    assert line.startswith(f"'p.{G}' is 1 [W/K] by [set] of rig, ")
    assert " of stage '" in line


RIG = """
title = "rig"
needs = ["room"]
[submodels.p]
use = "plate.toml"
bind = { air = "room" }
"""


@pytest.fixture
def rig(folder: Path) -> Path:
    (folder / "rig.toml").write_text(RIG)
    (folder / "room.toml").write_text(SCENARIO.replace("air", "room"))
    return folder


def test_values_of_a_part_act_in_every_command_under_its_place(rig: Path) -> None:
    given = ("@rig.toml", "--scenario", "@room.toml", "--values", "p=@fit.toml", "--json")
    alone = json.loads(command(rig, "predict", "@plate.toml", "--scenario", "@soak.toml", "--values", "@fit.toml", "--json")[0])
    final = {c: json.loads(command(rig, c, *given)[0])["nodes"]["p.body"] for c in ("simulate", "predict")}
    assert final["simulate"]["final_C"] == pytest.approx(45.0, abs=0.1)
    for key in ("C", "error_K"):
        assert final["predict"]["final"][key] == pytest.approx(alone["nodes"]["body"]["final"][key], rel=1e-9), "the band is the part's"
    to = rig / "out"
    command(rig, "deliver", "@rig.toml", "--scenario", "@room.toml", "--values", "p=@fit.toml", "--to", str(to))
    (run,) = json.loads((to / "checks.json").read_text())["runs"].values()
    assert run["temperatures_C"]["p.body"][-1] == pytest.approx(45.0, abs=0.1)


@pytest.mark.parametrize("values", ['"fit.toml"', '"p=fit.toml"', '["p=fit.toml"]', '{ p = "fit.toml" }'])
def test_a_hold_question_takes_values_as_every_command_does(rig: Path, values: str) -> None:
    text = HOLD.replace("plate.toml", "rig.toml").replace("soak", "room").replace('"fit.toml"', f'{values}\nunit = "p"')
    (rig / "hold.toml").write_text(text.replace("body =", '"p.body" ='))
    question = td.qualify.load_hold(rig / "hold.toml")
    assert len(question.values) == 1
    assert question.unit == "p"
    (rig / "hold.toml").write_text((rig / "hold.toml").read_text().replace(values, '"q=fit.toml"'))
    with raises_code("name.unknown", match="'q'.*'p'"):
        td.qualify.load_hold(rig / "hold.toml")


def test_values_of_a_part_without_its_place_are_refused_with_the_way(rig: Path) -> None:
    said = CliRunner().invoke(app, ["simulate", f"{rig}/rig.toml", "--scenario", f"{rig}/room.toml", "--values", f"{rig}/fit.toml"])
    assert isinstance(said.exception, NameNotFoundError)
    assert f"--values p={rig}/fit.toml" in str(said.exception)


def test_a_deck_has_no_stages_to_predict_with(rig: Path) -> None:
    given = ["predict", f"{rig}/plate.toml", "--values", f"{rig}/fit.toml"]
    for more in ([], ["--scenario", f"{rig}/soak.toml", "--stage", "x"]):
        with raises_code("value.excludes-another"):
            CliRunner().invoke(app, [*given, *more], catch_exceptions=False)


SKIN = """
title = "skin"
needs = ["air"]
offers = ["body"]
[nodes]
body = { capacitance = "500 [J/K]" }
[loads]
heater = { into = "body", power = "10 [W]" }
[surfaces.skin]
of = "body"
to = "air"
area = "300 [cm^2]"
htc = { coefficient = { value = "1.5 [W/(m^2 K)]", min = 0.3, max = 6 }, exponent = 0.25 }
emissivity = { value = 0.85, spread = 0.04 }
"""
STAND = """
[nodes]
stand = { capacitance = "300 [J/K]" }
[conductors]
foot = { kind = "conduction", between = ["p.body", "stand"], conductance = { value = "0.5 [W/K]", min = 0.1, max = 2 } }
"""


def test_a_stated_range_is_one_source_wherever_its_deck_stands(tmp_path: Path) -> None:
    """What a part's fit answered to is not counted again where a remark moves the lines of its deck, or its file has another name."""

    def written(skin: str, name: str = "plate.toml") -> td.Model:
        (tmp_path / name).write_text(skin)
        (tmp_path / "rig.toml").write_text(RIG.replace("plate.toml", name) + STAND)
        return td.load_model(tmp_path / "rig.toml")

    def fitted(model: td.Model, room: str, sensors: dict[str, str], free: str, **more: object) -> td.Calibration:
        times = np.linspace(0.0, 9000.0, 46)
        course = td.Scenario("log", boundaries={room: "20 [degC]"}, start="20 [degC]", duration=9000.0)
        run, noise = td.simulate(model, course, times=times), np.random.default_rng(3)
        channels = {
            n: td.Channel.from_array(n, run[x].kelvin + noise.normal(0.0, 0.05, 46), unit="K", role="node", target=x, noise=0.05)
            for n, x in sensors.items()
        }
        return td.calibrate(model, td.Record.from_arrays(model.title, times, channels), [free], scenario=course, **more)

    rig = written(SKIN)
    below = fitted(td.load_model(tmp_path / "plate.toml"), "air", {"T": "body"}, "skin.htc.coefficient")
    fitted(rig, "room", {"T": "p.body", "S": "stand"}, "foot.conductance", inherit={"p": below}).save(tmp_path / "rig.values.toml")
    hot = td.Scenario("hot", boundaries={"room": "60 [degC]"}, start="60 [degC]", duration=9000.0)
    errors = [
        td.predict(Knowledge.of_file(Filed.read(tmp_path / "rig.values.toml", model)), hot)["p.body"].final.error
        for model in (rig, written(f"# a remark\n{SKIN}"), written(SKIN, "copy.toml"))
    ]
    assert errors[1:] == pytest.approx(2 * errors[:1], rel=1e-9)
