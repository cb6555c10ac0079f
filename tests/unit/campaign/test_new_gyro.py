"""New gyros in a small unit of two: what is predicted before the unit is tested with one, and what the local retune finds."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import thermid as td
from thermid.app.cli.app import app
from thermid.campaign._retune import MIN_EFFECT
from thermid.campaign._stages import Campaign
from thermid.fit.calibration import FIRST
from thermid.model.tree import Model, identities, load_model
from unit.fit.bench import log
from unit.fit.project import write_log

pytestmark = pytest.mark.usefixtures("errors_in_turn")

FOOT, PLATE = "foot_conductivity", "plate_skin.effective_htc"
HTC = "skin.effective_htc"
NODES = {"T_X": "x.case", "T_Y": "y.case", "T_P": "plate"}
HOT = td.Scenario("hot", boundaries={"room": "35 [degC]"}, start="35 [degC]", duration="8 [h]")
GYRO = """
title  = "{title}"
needs  = ["air"]
offers = ["case", "skin"]

[parameters]
power = "{power} [W]"
mass  = {{ value = "{mass} [kg]", min = 0.1, max = 3 }}

[nodes]
case = {{ mass = "mass", specific_heat = "900 [J/(kg K)]" }}

[surfaces]
skin = {{ of = "case", to = "air", area = "0.02 [m^2]", effective_htc = {{ value = "6 [W/(m^2 K)]", min = 1, max = 30 }} }}

[loads]
heat = {{ into = "case", power = "power" }}
"""
UNIT = """
title  = "Unit"
needs  = ["room"]
offers = ["plate", "x.case", "y.case"]

[parameters]
foot_conductivity = { value = "0.12 [W/(m K)]", min = 0.01, max = 2 }
layer = "1 [mm]"

[nodes]
plate = { mass = "1.2 [kg]", specific_heat = "900 [J/(kg K)]" }

[surfaces]
face       = { of = "plate", to = "room", area = "100 [cm^2]", htc = "0.01 [W/(m^2 K)]" }
plate_skin = { of = "plate", to = "room", area = "0.08 [m^2]", effective_htc = { value = "8 [W/(m^2 K)]", min = 1, max = 30 } }

[submodels]
x = { use = "gyro.toml", bind = { air = "room" } }
y = { use = "gyro.toml", bind = { air = "room" } }

[set]
"x.skin.effective_htc" = { value = "4 [W/(m^2 K)]", min = 1, max = 30 }
"y.skin.effective_htc" = { value = "4 [W/(m^2 K)]", min = 1, max = 30 }

[joints]
foot_x = { between = ["x.skin", "face"], area = "40 [cm^2]", contact_conductance = "2*foot_conductivity/layer" }
foot_y = { between = ["y.skin", "face"], area = "40 [cm^2]", contact_conductance = "2*foot_conductivity/layer" }
"""
CAMPAIGN = """
title = "A unit of two gyros"

[records.gyro]
file     = "logs/gyro.csv"
time     = "time_s"
channels = { T = { node = "case", noise = "0.03 [K]", accuracy = "0.1 [K]" }, ROOM = { boundary = "air" } }

[records.unit]
file     = "logs/unit.csv"
time     = "time_s"

[records.unit.channels]
T_X  = { node = "x.case", noise = "0.03 [K]", accuracy = "0.1 [K]" }
T_Y  = { node = "y.case", noise = "0.03 [K]", accuracy = "0.1 [K]" }
T_P  = { node = "plate", noise = "0.03 [K]", accuracy = "0.1 [K]" }
ROOM = { boundary = "room" }

[[stages]]
name    = "gyro"
model   = "gyro.toml"
records = ["gyro"]
free    = ["mass", "skin.effective_htc"]

[[stages]]
name    = "unit"
model   = "unit.toml"
records = ["unit"]
free    = ["foot_conductivity", "plate_skin.effective_htc", "x.skin.effective_htc"]
inherit = { x = { stage = "gyro" }, y = { stage = "gyro" } }
"""
OLD = {"mass": "0.71 [kg]", HTC: "5.2 [W/(m^2 K)]"}
PLACE = {FOOT: 0.123, PLATE: 7.4, f"x.{HTC}": 3.6, f"y.{HTC}": 3.6}


def hidden(values: dict[str, float]) -> dict[str, str]:
    """Return true values of the unit as texts."""
    units = {FOOT: "W/(m K)", "foot_y.contact_conductance": "W/(m^2 K)", "y.mass": "kg", "x.mass": "kg"}
    return {p: f"{v!r} [{units.get(p, 'W/(m^2 K)')}]" for p, v in values.items()}


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Decks, logs of the old gyros and the campaign."""
    folder = tmp_path_factory.mktemp("gyros")
    (folder / "thermid.toml").write_text("")
    (folder / "gyro.toml").write_text(GYRO.format(title="Gyro", power=2.1, mass=0.6))
    (folder / "unit.toml").write_text(UNIT)
    (folder / "campaign.toml").write_text(CAMPAIGN)
    gyro, unit = load_model(folder / "gyro.toml"), load_model(folder / "unit.toml")
    write_log(log(gyro, OLD, {"T": "case"}, noise=0.03, samples=61, seed=1), folder / "logs" / "gyro.csv")
    truth = hidden({**PLACE, "x.mass": 0.71, "y.mass": 0.71})
    write_log(log(unit, truth, NODES, noise=0.03, samples=61, boundary="room", seed=2, hours=8.0), folder / "logs" / "unit.csv")
    return folder


@pytest.fixture(scope="module")
def campaign(project: Path, errors_in_turn: str) -> Campaign:
    return td.run_stages(project / "campaign.toml")


AFTER = """
[[stages]]
name    = "with a new gyro"
model   = "unit_2.toml"
records = ["unit_2"]
free    = ["y.mass"]
inherit = { "." = { stage = "unit", as = "prior" } }

[records.unit_2]
file     = "logs/unit_2.csv"
time     = "time_s"

[records.unit_2.channels]
T_X  = { node = "x.case", noise = "0.03 [K]", accuracy = "0.1 [K]" }
T_Y  = { node = "y.case", noise = "0.03 [K]", accuracy = "0.1 [K]" }
T_P  = { node = "plate", noise = "0.03 [K]", accuracy = "0.1 [K]" }
ROOM = { boundary = "room" }
"""


def test_a_replaced_part_does_not_inherit_what_was_found_of_the_old_one(project: Path, tmp_path: Path) -> None:
    """A swap by hand: the unit's own result for the twin and the foot is a prior, that for the old gyro is not."""
    folder = tmp_path / "again"
    shutil.copytree(project, folder)
    (folder / "gyro_2.toml").write_text(GYRO.format(title="Gyro 2", power=2.1, mass=0.5))
    (folder / "unit_2.toml").write_text(UNIT.replace('y = { use = "gyro.toml"', 'y = { use = "gyro_2.toml"'))
    unit = load_model(folder / "unit_2.toml")
    truth = hidden({**PLACE, "x.mass": 0.71, "y.mass": 1.1})
    write_log(log(unit, truth, NODES, noise=0.03, samples=61, boundary="room", seed=5, hours=8.0), folder / "logs" / "unit_2.csv")
    (folder / "campaign.toml").write_text(CAMPAIGN + AFTER)
    fit = td.run_stages(folder / "campaign.toml")["with a new gyro"]
    assert fit.request.prior == ("x.mass", FOOT, PLATE, f"x.{HTC}")
    assert fit["y.mass"].start == 0.5
    assert abs(fit["y.mass"].value - 1.1) < 2 * fit["y.mass"].error
    assert fit.model.parameter_table()[f"y.{HTC}"].parameter.text == "4 [W/(m^2 K)]"
    assert sum(r.startswith(FIRST) and "'y'" in r and "'unit'" in r for r in fit.request.remarks) == 1


def test_of_one_stage_what_it_inherits_from_is_run_alone(project: Path) -> None:
    """Minutes of a stage above were spent before a prediction of a part that was finished."""
    assert [*td.run_stages(project / "campaign.toml", only=["gyro"]).stages] == ["gyro"]
    assert [*td.run_stages(project / "campaign.toml", only=["unit"]).stages] == ["gyro", "unit"]
    said = CliRunner().invoke(app, ["predict", str(project / "campaign.toml"), "--stage", "gyro", "--record", "gyro", "--json"])
    assert json.loads(said.stdout)["stage"] == "gyro"
    assert {p.name for p in (project / "results").glob("*.fit.json")} == {"gyro.fit.json"}


@dataclass(frozen=True)
class New:
    """A new gyro in place of y: its deck, the unit that holds it at its true values, and the folder of its logs."""

    deck: Model
    truth: Model
    folder: Path


def planted(project: Path, folder: Path, seed: int) -> New:
    """Return a gyro of another power and mass, with a foot and a coefficient that differ from its twin's by some 15 %."""
    rng = np.random.default_rng([17, seed])
    power, mass = round(float(rng.uniform(1.0, 6.0)), 2), round(float(rng.uniform(0.3, 1.5)), 2)
    path = folder / f"new_{seed}.toml"
    path.write_text(GYRO.format(title=f"New {seed}", power=power, mass=mass))
    deck = load_model(path)
    true_mass, bench_htc = mass * float(np.exp(0.15 * rng.standard_normal())), 5.2 * float(np.exp(0.1 * rng.standard_normal()))
    foot, place = (246.0, 3.6)
    foot, place = foot * float(np.exp(0.15 * rng.standard_normal())), place * float(np.exp(0.15 * rng.standard_normal()))
    alone = {"mass": f"{true_mass!r} [kg]", HTC: f"{bench_htc!r} [W/(m^2 K)]"}
    logs = folder / f"logs_{seed}" / "logs"
    logs.mkdir(parents=True)
    write_log(log(deck, alone, {"T": "case"}, noise=0.03, samples=61, seed=100 + seed), logs / "gyro.csv")
    unit = load_model(project / "unit.toml").replace("y", deck)
    own = {FOOT: 0.123, PLATE: 7.4, f"x.{HTC}": 3.6, "x.mass": 0.71, "y.mass": true_mass, f"y.{HTC}": place}
    truth = unit.with_values(hidden({**own, "foot_y.contact_conductance": foot}))
    write_log(log(truth, {}, NODES, noise=0.03, samples=61, boundary="room", seed=200 + seed, hours=8.0), logs / "unit.csv")
    return New(deck, truth, logs.parent)


def peak(model: Model) -> float:
    """Return the hottest that the new gyro gets in the hot case. [K]"""
    return float(td.simulate(model, HOT)["y.case"].kelvin.max())


def test_a_deck_of_six_watts(project: Path, campaign: Campaign, tmp_path: Path) -> None:
    """Nothing of the old gyro is left in plan, text and model; the twin keeps its values; the joint frees one value of its own."""
    path = tmp_path / "six.toml"
    path.write_text(GYRO.format(title="Six", power=6, mass=0.9))
    plan = td.design.plan_retune(campaign, "y", path)
    assert plan.watts == (2.1, 6.0)
    text = str(plan)
    assert re.search(r"\bSix .* 6 W ", text)
    of_twin = campaign["unit"].model
    foot = f"{2000 * of_twin.at(FOOT).expression.literal.value:.4g}"
    assert re.search(rf"foot_y\.contact_conductance .* foot_x, {re.escape(str(foot))} \[W/\(m\^2 K\)\] .* 25 %", text)
    assert {d.path for d in plan.replacement.dropped} == {"y.mass", f"y.{HTC}"}
    assert plan.freed == (f"unit: y.{HTC}", "unit: foot_y.contact_conductance")
    ((touched, held),) = [(t.path, t.held) for t in plan.touched if t.held]
    assert touched == FOOT
    assert re.search(r" foot_x; foot_y\.contact_conductance ", held)
    swapped = campaign["unit"].model.replace("y", load_model(path))
    assert swapped.at("y.power").text == "6 [W]"
    assert swapped.at("y.mass").text == "0.9 [kg]"
    assert identities(swapped)["x.mass"].paths == ("x.mass",)
    rise = plan.after["T_Y"] - plan.before["T_Y"]
    assert rise == pytest.approx(peak(plan.replacement.starting(swapped)) - peak(campaign["unit"].model), abs=0.5)
    assert rise > 10.0


def test_a_joint_that_the_twin_shared_is_fitted_again_in_a_test_that_is_due(project: Path, campaign: Campaign, tmp_path: Path) -> None:
    """It moved no sensor by its tenth and stayed as the twin's: the new part's own values went to their bounds in its place."""
    path = tmp_path / "weak.toml"
    path.write_text(GYRO.format(title="Weak", power=0.3, mass=0.9))
    plan = td.design.plan_retune(campaign, "y", path)
    (foot,) = (t for t in plan.touched if t.path == "foot_y.contact_conductance")
    assert (foot.change, foot.held) == (0.25, "")
    assert foot.kelvin < MIN_EFFECT
    assert len(plan.freed) == 2


def test_values_shared_with_the_twin_are_those_of_the_new_part(project: Path, campaign: Campaign, tmp_path: Path) -> None:
    """A new unit of the very same deck: its own log gives it a mass of its own, and the twin keeps the old one."""
    new = planted(project, tmp_path, 3)
    same = load_model(project / "gyro.toml")
    write_log(log(same, {"mass": "0.5 [kg]"}, {"T": "case"}, noise=0.03, samples=61, seed=9), new.folder / "logs" / "gyro.csv")
    made = td.design.plan_retune(campaign, "y", same).run(new.folder, part_only=True)["unit"]
    assert made.model.at("x.mass").expression.literal.value == pytest.approx(0.71, rel=0.02)
    assert made.model.at("y.mass").expression.literal.value == pytest.approx(0.5, rel=0.02)


def tried(project: Path, campaign: Campaign, folder: Path, seed: int) -> tuple[bool, float, float]:
    """Return whether the peak lay in the band before the unit was tested, the band's share of the rise, and how far two retunes are."""
    new = planted(project, folder, seed)
    plan = td.design.plan_retune(campaign, "y", new.deck)
    before = plan.run(new.folder, part_only=True)["unit"]
    band = td.predict(before, HOT, without=("structural", "misfit"))["y.case"]
    at = int(np.argmax(band.kelvin))
    low, high = (float(end[at]) + 273.15 for end in band.interval())
    measured = peak(new.truth) + 0.03 * float(np.random.default_rng(seed).standard_normal())
    local, full = (plan.run(new.folder, everything=e)["unit"] for e in (False, True))
    assert local.standing.state == campaign["unit"].standing.state, "starts have the standing of the fit that they are from"
    apart = abs(peak(local.model) - peak(full.model))
    return low <= measured <= high, 0.5 * (high - low) / (float(band.kelvin[at]) - 308.15), apart


def judged(found: list[tuple[bool, float, float]], least: int) -> None:
    assert sum(inside for inside, _, _ in found) >= least
    assert max(share for _, share, _ in found) <= 0.25
    assert max(apart for _, _, apart in found) <= 0.2


def test_new_gyros_before_and_after_the_unit_is_tested(project: Path, campaign: Campaign, tmp_path: Path) -> None:
    judged([tried(project, campaign, tmp_path, seed) for seed in (0, 1)], 2)


@pytest.mark.campaign
def test_twenty_new_gyros(project: Path, campaign: Campaign, tmp_path: Path) -> None:
    judged([tried(project, campaign, tmp_path, seed) for seed in range(20)], 18)
