"""A part is replaced: what is touched by graph and by size, which stages and tests are due, and the retune of only that."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import thermid as td
from by_code import raises_code
from thermid.app.cli.app import app
from thermid.base.errors import DeckError, NameNotFoundError
from thermid.campaign._retune import CARRIED, MIN_EFFECT, RetunePlan, _told_by, check_replacement
from thermid.campaign._stages import Campaign
from thermid.fit.calibration import fit
from thermid.model.tree import ParameterSet, save_model, touching
from thermid.values.store import Store
from unit.fit.bench import HTC, MASS, box, log, pair
from unit.fit.project import CAMPAIGN, COOL, make_project, write_log

pytestmark = pytest.mark.usefixtures("values_alone")

JOINT = "stack.contact_conductance"
FREE = 'free    = ["stack.contact_conductance"]'
NEW = {"title": "Light", "parameters/power/value": "3 [W]", "nodes/case/mass/value": "1.0 [kg]"}
COOL_STAGE = """[[stages]]
name    = "cool"
model   = "cool.toml"
records = ["other"]
free    = ["skin.effective_htc"]

"""
OTHER = """[records.other]
file     = "logs/other.csv"
time     = "time_s"
channels = { T_A = { node = "case", noise = "0.05 [K]" }, ROOM = { boundary = "air" } }

"""
STAGES = (
    CAMPAIGN.replace(FREE, 'free    = ["stack.contact_conductance", "b.skin.effective_htc"]')
    .replace('[[stages]]\nname    = "pair"', f'{COOL_STAGE}[[stages]]\nname    = "pair"')
    .replace("[records.pairs]", f"{OTHER}[records.pairs]")
)


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = make_project(tmp_path_factory.mktemp("swap"), STAGES)
    write_log(log(box(COOL), {}, {"T_A": "case"}, samples=61, seed=3), path.parent / "logs" / "other.csv")
    return path


def test_a_part_that_does_not_fit_is_refused_before_any_stage_runs(tmp_path: Path) -> None:
    """Two minutes of fits ended in view factors that 'violate reciprocity' by the areas of the new part; no word said of which part."""
    part = "title = 'part'\nneeds = ['air']\noffers = ['skin']\n[nodes]\ncase = { capacitance = '9 [J/K]' }\n[surfaces]\n"
    skin = "skin = { of = 'case', to = 'air', area = '%d [cm^2]', emissivity = 0.9, htc = '2 [W/(m^2 K)]' }\n"
    for name, area in (("old", 20), ("new", 25)):
        (tmp_path / f"{name}.toml").write_text(part + skin % area, encoding="utf-8")
    unit = """title = 'unit'
needs = ['air']
[submodels]
a = { use = 'old.toml', bind = { air = 'air' } }
b = { use = 'old.toml', bind = { air = 'air' } }
[enclosures.gap]
faces = { a = 'a.skin', b = 'b.skin' }
view_factors = [[0, 1], [1, 0]]
"""
    (tmp_path / "unit.toml").write_text(unit, encoding="utf-8")
    stage = "title = 'swap'\n[[stages]]\nname = 'unit'\nmodel = 'unit.toml'\nrecords = ['log']\nfree = ['a.case.capacitance']\n"
    record = "[records.log]\nfile = 'none.csv'\ntime = 't'\nchannels = { T = { node = 'a.case' } }\n"
    (tmp_path / "campaign.toml").write_text(stage + record, encoding="utf-8")
    said = r"'part' at b: unit.toml.*reciprocity.*\(0.002 m\^2 times 1\).*\(0.0025 m\^2 times 1\)"
    with pytest.raises(DeckError, match=said):
        check_replacement(tmp_path / "campaign.toml", "b", tmp_path / "new.toml")
    check_replacement(tmp_path / "campaign.toml", "b", tmp_path / "old.toml")
    with pytest.raises(td.ThermidError, match="no node 'lid'"):
        check_replacement(tmp_path / "campaign.toml", "b", tmp_path / "old.toml", sensors={"case": "lid"})


@pytest.fixture(scope="module")
def campaign(project: Path) -> Campaign:
    return td.run_stages(project)


@pytest.fixture(scope="module")
def plan(campaign: Campaign) -> RetunePlan:
    return td.design.plan_retune(campaign, "a", box(NEW))


@pytest.fixture(scope="module")
def tests_again(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The logs of the tests that are due, of a new part that differs from its deck."""
    folder = tmp_path_factory.mktemp("again")
    truth = {HTC: "5.5 [W/(m^2 K)]", MASS: "1.1 [kg]"}
    write_log(log(box(NEW), truth, {"T_A": "case"}, bias={"T_A": 0.2}, samples=61, seed=11), folder / "logs" / "box_bench.csv")
    hidden = {f"a.{p}": v for p, v in truth.items()} | {JOINT: "300 [W/(m^2 K)]"}
    stack, nodes = pair(first=box(NEW), second=box(COOL)), {"T_A": "a.case", "T_B": "b.case"}
    write_log(log(stack, hidden, nodes, boundary="room", bias={"T_A": 0.2}, samples=61, seed=12), folder / "logs" / "pair_one.csv")
    return folder


def copied(project: Path, tmp_path: Path) -> Path:
    shutil.copytree(project.parent, tmp_path / "p")
    return tmp_path / "p" / "campaign.toml"


def test_the_graph_says_what_is_touched() -> None:
    found = touching(pair({"set": {"a.power": "5 [W]"}}), "a")
    assert list(found.elements) == ["stack"]
    assert found.settings == {"a.power"}
    assert found.neighbours == {"b.skin"}
    values = ParameterSet(pair())
    assert found.why(values, JOINT) == (["stack"], [])
    assert found.why(values, "b.skin.area") == ([], ["b.skin"])


def test_a_value_shared_with_another_joint_is_seen() -> None:
    joints = {n: {"between": [f"{n[0]}.skin", f"{n[1]}.skin"], "area": "20 [cm^2]", "contact_conductance": "pad"} for n in ("ab", "bc")}
    parts = {n: {"use": box(), "bind": {"air": "room"}} for n in "abc"}
    row = td.model_from_dict(
        {"title": "Row", "needs": ["room"], "parameters": {"pad": "300 [W/(m^2 K)]"}, "submodels": parts, "joints": joints}
    )
    assert touching(row, "a").why(ParameterSet(row), "pad") == (["ab"], ["bc"])
    assert touching(row, "b").why(ParameterSet(row), "pad") == (["ab", "bc"], [])


def test_what_is_due(plan: RetunePlan) -> None:
    actions = {s.name: (s.action, s.free) for s in plan.stages}
    assert actions == {"box": ("run", (HTC, MASS)), "cool": ("kept", ()), "pair": ("run", (JOINT,))}
    assert plan.tests == ("box_bench", "pair_one")
    assert plan.kept_tests == ("other",)
    assert plan.freed == (f"pair: {JOINT}",)
    kept = {s.name: s.identity for s in plan.stages}["cool"]
    assert kept[0] == kept[1]
    assert plan.after["T_A"] < plan.before["T_A"] - 1.0, "it gives 1 W less"
    assert "a: Box -> Light" in str(plan)
    assert "2 of 3" in str(plan)


def test_a_joint_is_retuned_by_how_far_it_may_be_off(campaign: Campaign) -> None:
    """A joint that starts again may be off by the spread that the plan assumes, not by 10 %: what that moves is worth a test."""
    plan = td.design.plan_retune(campaign, "a", box(NEW | {"parameters/power/value": "2 [W]"}))
    (touch,) = plan.touched
    assert touch.change == 0.25
    assert 0.4 * touch.kelvin < MIN_EFFECT < touch.kelvin
    assert plan.freed == (f"pair: {JOINT}",)
    assert "pair_one" in plan.tests


def test_new_logs_that_are_not_used_are_named(campaign: Campaign, tests_again: Path) -> None:
    plan = td.design.plan_retune(campaign, "a", box(NEW | {"parameters/power/value": "1 [W]"}))
    assert not plan.freed
    assert (tests_again / "logs" / "pair_one.csv").exists()
    assert "pair_one" in plan.run(tests_again).note


def test_before_and_after_are_at_the_same_conditions(project: Path, campaign: Campaign) -> None:
    """A part in place of itself changes nothing, whatever its meter showed; a part with another power says which."""
    old = campaign["pair"].given_model.submodel("a")
    same = td.design.plan_retune(campaign, "a", old)
    assert same.before == pytest.approx(same.after)
    assert same.watts[0] == same.watts[1]
    other = td.design.plan_retune(campaign, "a", box(NEW))
    assert other.watts == (4.0, 3.0)
    assert all(part in str(other) for part in ("Box at the 4 W", "Light at the 3 W"))
    assert all(other.after[s] < other.before[s] for s in other.before)


def test_only_that_is_run(plan: RetunePlan, campaign: Campaign, tests_again: Path) -> None:
    seen: set[str] = set()
    made = plan.run(tests_again, notice=lambda stage, count, rms: seen.add(stage))
    assert seen == {"box", "pair"}
    assert made["cool"] is campaign["cool"]
    assert made.keys["cool"] == campaign.keys["cool"]
    assert made.keys["pair"] != campaign.keys["pair"]
    for path, truth in ((HTC, 5.5), (MASS, 1.1)):
        assert abs(made["box"][path].value - truth) < 4 * made["box"][path].error
    above = made["pair"]
    assert list(above.values.parameters) == [JOINT]
    assert above[JOINT].value == pytest.approx(300.0, rel=0.15)
    assert above.model.at("b.skin.effective_htc").expression.literal.value == campaign["pair"]["b.skin.effective_htc"].value
    assert above.model.at(f"a.{HTC}").expression.literal.value == made["box"][HTC].value
    assert any("Light at a " in w for w in above.warnings)


def test_totals_count_what_is_held(plan: RetunePlan, campaign: Campaign, tests_again: Path) -> None:
    """Each direction in which held values may be wrong is tried by a fit of its own; the total has more by the squares of the moves."""
    asked = plan.run(tests_again)["pair"].request
    assert asked is not None
    assert asked.prior == (JOINT,), "it starts about the joint of the old part"
    request = replace(asked, prior=())
    fitted, before = fit(request), request.store
    plain = fit(replace(request, store=Store()))
    held = [n for n in before.states if n != JOINT]
    assert {"sensor T_A", "a.skin.effective_htc", "b.skin.effective_htc"} <= set(held)
    sizes, vectors = np.linalg.eigh(before.covariance(held))
    extra = 0.0
    for size, vector in zip(sizes, vectors.T, strict=True):
        found = []
        for side in (0.2, -0.2):  # so small that the answer is straight
            step = dict(zip(held, side * vector * np.sqrt(max(size, 0.0)), strict=True))
            moved = {p: replace(before[p], value=before[p].value * float(np.exp(step[p]))) for p in held if p in before.parameters}
            bias = {s: b + step.get(f"sensor {s}", 0.0) for s, b in request.held_bias.items()}
            again = fit(replace(request, store=Store(), model=request.model.with_values(moved), held_bias=bias))
            found.append(again[JOINT].value)
        extra += (np.log(found[0] / found[1]) / 0.4) ** 2
    k = list(fitted.values).index(JOINT)
    assert fitted.values.covariance[k, k] == pytest.approx(plain.values.covariance[k, k] + extra, rel=0.05)
    assert fitted[JOINT].error == pytest.approx(fitted[JOINT].value * fitted.values.covariance[k, k] ** 0.5)
    assert fitted[JOINT].error > 2 * fitted[JOINT].error_random
    assert plain[JOINT].error_random == fitted[JOINT].error_random
    assert fitted.local[0].error > plain.local[0].error


def test_everything_again_is_close(project: Path, tmp_path: Path, plan: RetunePlan, tests_again: Path) -> None:
    shutil.copytree(tests_again, tmp_path / "all")
    shutil.copy(project.parent / "logs" / "other.csv", tmp_path / "all" / "logs")
    full = plan.run(tmp_path / "all", everything=True)["pair"]
    assert set(full.values.parameters) == {JOINT, "b.skin.effective_htc"}
    assert full[JOINT].value == pytest.approx(plan.run(tests_again)["pair"][JOINT].value, rel=0.15)


def test_one_of_two_instances(project: Path, tmp_path: Path, tests_again: Path) -> None:
    """The other instance keeps its stage, the new part gets its own; between parts as warm as each other a joint is not worth a test."""
    path = copied(project, tmp_path)
    deck = path.parent / "pair.toml"
    deck.write_text(deck.read_text().replace('use = "cool.toml"', 'use = "box.toml"'))
    text = path.read_text().replace("inherit = { a = {", 'inherit = { b = { stage = "box" }, a = {').replace(', "b.skin.effective_htc"', "")
    path.write_text(text)
    old = td.run_stages(path)
    plan = td.design.plan_retune(old, "a", box(NEW | {"parameters/power/value": "5 [W]"}))
    assert {s.name: s.action for s in plan.stages} == {"box": "kept", "box at a": "run", "cool": "kept", "pair": "carried"}
    made = plan.run(tests_again)
    assert CARRIED in made["pair"].warnings
    model = made["pair"].model
    assert model.at(JOINT).expression.literal.value == pytest.approx(old["pair"][JOINT].value, rel=1e-12)
    assert model.at(f"b.{HTC}").expression.literal.value == old["box"][HTC].value
    assert model.at(f"a.{HTC}").expression.literal.value == made["box at a"][HTC].value


def test_nothing_to_retune_is_carried(project: Path, tmp_path: Path) -> None:
    path = copied(project, tmp_path)
    path.write_text(path.read_text().replace('free    = ["stack.contact_conductance", "b.skin.effective_htc"]', 'free    = ["b.power"]'))
    plan = td.design.plan_retune(td.run_stages(path), "a", box(NEW))
    stage = {s.name: s for s in plan.stages}["pair"]
    assert (stage.action, stage.records) == ("carried", ())
    assert plan.tests == ("box_bench",)


def test_a_part_that_does_not_fit(campaign: Campaign) -> None:
    with raises_code("model.refused", DeckError, match="'a'"):
        td.design.plan_retune(campaign, "a", td.model_from_dict({"title": "bare", "nodes": {"n": {"capacitance": "1 [J/K]"}}}))
    with raises_code("name.unknown", NameNotFoundError, match="'c'"):
        td.design.plan_retune(campaign, "c", box())
    with raises_code("campaign.not-from-file", DeckError):
        td.design.plan_retune(Campaign("x", {}, (), {}), "a", box())


def test_on_the_command_line(project: Path, tests_again: Path, tmp_path: Path) -> None:
    save_model(box(NEW), tmp_path / "light.toml")
    call = ["swap", str(project), "a", str(tmp_path / "light.toml"), "--results", str(tmp_path / "r")]
    plain = CliRunner().invoke(app, call)
    assert plain.exit_code == 0, plain.output
    assert "a: Box -> Light" in plain.output
    done = CliRunner().invoke(app, [*call, "--new-data", str(tests_again), "--to", str(tmp_path / "new"), "--json"])
    assert done.exit_code == 0, done.output
    said = json.loads(done.stdout)
    assert said["plan"]["tests"] == ["box_bench", "pair_one"]
    assert [s["stage"] for s in said["stages"]] == ["box", "pair"]
    assert (tmp_path / "new" / "pair.values.toml").is_file()


def test_a_swapped_model_is_predicted_with_what_the_command_wrote(plan: RetunePlan, tests_again: Path, tmp_path: Path) -> None:
    """The deck with the new part and the values of the retune give the bands of the retuned campaign, in the command that swap names."""
    assert plan.campaign.source is not None
    save_model(box(NEW), tmp_path / "light.toml")
    (tmp_path / "day.toml").write_text('title = "day"\nstart = "room"\nduration = "5 [h]"\nboundaries = { room = "20 [degC]" }\n')
    given = [str(tmp_path / "light.toml"), "--results", str(tmp_path / "r"), "--new-data", str(tests_again), "--to", str(tmp_path / "new")]
    swapped = CliRunner().invoke(app, ["swap", str(plan.campaign.source.path), "a", *given])
    assert re.search(r"\b2 tests .* 1 value ", swapped.output)
    (line,) = (x for x in swapped.output.splitlines() if x.startswith("next: thermid "))
    call = line.removeprefix("next: thermid ").replace("FILE", str(tmp_path / "day.toml")).split()
    told = CliRunner().invoke(app, [*call, "--json"])
    assert told.exit_code == 0, told.output
    wanted = td.predict(plan.run(tests_again)["pair"], td.load_scenario(tmp_path / "day.toml"), without=("hidden defects",)).to_dict()
    said = json.loads(told.stdout)
    assert not told.stderr, "nothing is left out"
    for node in ("a.case", "b.case"):
        for key in ("C", "error_K"):
            assert said["nodes"][node]["final"][key] == pytest.approx(wanted["nodes"][node]["final"][key], rel=1e-6)


def test_logs_from_before_the_swap_are_not_those_of_the_repeated_tests(plan: RetunePlan, tmp_path: Path) -> None:
    with raises_code("record.log-missing"):
        plan.run(tmp_path)


def test_a_retune_keeps_the_priors_of_what_it_frees(plan: RetunePlan, campaign: Campaign) -> None:
    assert campaign.source is not None
    (table,) = (t for t in campaign.source.content.stages if t.name == "pair")
    (stage,) = (s for s in plan.stages if s.name == "pair")
    given = table.model_copy(update={"priors": {JOINT: "range", "b.skin.effective_htc": "range"}})
    assert _told_by(given, stage, {}, False, plan, {}).priors == {JOINT: "range"}
