"""One fit over all levels: parameters shared by path, every record once, what moved, and the level's own view."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import DeckError, IdentificationError
from thermid.campaign._stages import Campaign
from thermid.model.tree import save_model
from unit.fit.bench import HTC, MASS, box
from unit.fit.project import CAMPAIGN, make_project

pytestmark = pytest.mark.usefixtures("values_alone")

JOINT = "stack.contact_conductance"
PRIOR = CAMPAIGN.replace('as = "fixed"', 'as = "prior"').replace("[[verdicts]]", "[joint]\n\n[[verdicts]]", 1)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_project(tmp_path_factory.mktemp("joint"), PRIOR)


@pytest.fixture
def project(made: Path, tmp_path: Path) -> Path:
    shutil.copytree(made.parent, tmp_path / "p")
    return tmp_path / "p" / "campaign.toml"


@pytest.fixture(scope="module")
def campaign(made: Path) -> Campaign:
    return td.run_stages(made)


def with_text(path: Path, *changes: tuple[str, str]) -> Path:
    text = path.read_text()
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new, 1)
    path.write_text(text)
    return path


def test_a_prior_carried_upward_and_the_joint_fit_agree(campaign: Campaign) -> None:
    """Near its optimum a model is as good as linear; then the posterior of one level as the prior of the next is the fit of both.

    Not to the digit: each stage widens its errors by its own residuals (by 1.2 at most here), the joint fit by those of all.
    """
    joint, above = campaign.joint, campaign["pair"]
    assert joint is not None
    assert list(joint.values.parameters) == [f"a.{HTC}", f"a.{MASS}", JOINT]
    assert list(joint.records) == ["box_bench", "pair_one"]
    for path in joint.values.parameters:
        assert abs(joint[path].value - above[path].value) < 0.2 * above[path].error
        assert joint[path].error == pytest.approx(above[path].error, rel=0.1)


def test_it_starts_where_the_stages_ended(campaign: Campaign) -> None:
    assert campaign.joint is not None
    assert campaign.joint[JOINT].start == campaign["pair"][JOINT].value


def test_each_level_sees_the_same_value(campaign: Campaign) -> None:
    assert campaign.joint is not None
    box = campaign.joint.at("box")
    assert list(box.values.parameters) == [HTC, MASS]
    assert box.problem is not None
    assert {u.name for u in box.problem.unknowns if u.kind == "parameter"} == {HTC, MASS}  # bands of a record ask for these alone
    assert box[HTC].value == campaign.joint[f"a.{HTC}"].value == box.model.at(HTC).expression.literal.value
    np.testing.assert_array_equal(box.values.covariance[:2, :2], campaign.joint.values.covariance[:2, :2])
    with raises_code("name.unknown", IdentificationError, match="'boxx'.*'box'"):
        campaign.joint.at("boxx")


def test_what_moved(campaign: Campaign) -> None:
    assert campaign.joint is not None
    moves = campaign.joint.moved
    assert {m.path: m.stage for m in moves.values} == {f"a.{HTC}": "pair", f"a.{MASS}": "pair", JOINT: "pair"}
    assert moves.moved == ()
    assert re.search(r"\n  .* -> .*:\n    \S", str(campaign.joint))


def test_joint_of_a_file_and_of_a_campaign(made: Path, campaign: Campaign) -> None:
    assert td.inference.joint(campaign) is campaign.joint
    again = td.inference.joint(td.run_stages(made))
    assert campaign.joint is not None
    assert dict(again.values) == dict(campaign.joint.values)
    bare = Campaign("x", {}, (), {})
    with raises_code("campaign.not-from-file", DeckError):
        td.inference.joint(bare)


def test_a_value_that_the_level_above_sets_is_its_own(project: Path) -> None:
    deck = project.parent / "pair.toml"
    deck.write_text(deck.read_text().replace("[joints.stack]", f'[set]\n"a.{HTC}" = "5.5 [W/(m^2 K)]"\n\n[joints.stack]'))
    with_text(project, (f'free    = ["{JOINT}"]', f'free    = ["{JOINT}", "a.{HTC}"]'))
    joint = td.run_stages(project).joint
    assert joint is not None
    assert set(joint.values.parameters) == {f"a.{MASS}", JOINT, f"a.{HTC}"}
    own = joint.values[f"box: {HTC}"]
    assert own.kind == "level"
    assert abs(own.value - 5.0) < 4 * own.error
    assert joint.model.at(f"a.{HTC}").expression.literal.value == joint[f"a.{HTC}"].value
    assert joint.at("box")[HTC].value == own.value
    assert f"box: {HTC}" in str(joint)
    assert {m.part for m in joint.moved.values} == {"a", "", "box, alone"}


def test_instances_of_one_part_share_what_the_part_alone_said(project: Path) -> None:
    deck = project.parent / "pair.toml"
    deck.write_text(deck.read_text().replace('use = "cool.toml"', 'use = "box.toml"'))
    joint = td.run_stages(with_text(project, ("{ a = { stage", '{ b = { stage = "box", as = "prior" }, a = { stage'))).joint
    assert joint is not None
    assert joint[f"a.{HTC}"].also == (f"b.{HTC}",)
    assert joint.model.at(f"b.{HTC}").expression.literal.value == joint[f"a.{HTC}"].value


def test_a_deck_that_nothing_inherits_stands_where_it_is_used(project: Path) -> None:
    with_text(project, ('inherit = { a = { stage = "box", as = "prior" } }\n', ""))
    joint = td.run_stages(project).joint
    assert joint is not None
    assert f"a.{HTC}" in joint.values.parameters


def test_a_record_of_two_stages_counts_once(project: Path) -> None:
    again = '[[stages]]\nname = "again"\nmodel = "pair.toml"\nrecords = ["pair_one"]\ninherit = { "." = { stage = "pair" } }\n\n[joint]'
    joint = td.run_stages(with_text(project, ("[joint]", again))).joint
    assert joint is not None
    assert list(joint.records) == ["box_bench", "pair_one"]
    assert any(re.search("'pair_one' .*'pair' and 'again'", w) for w in joint.warnings)
    assert JOINT in joint.values.parameters


def test_stages_freeze_and_priors(project: Path) -> None:
    table = f'[joint]\nfreeze = ["a.*.mass"]\npriors = {{ "{JOINT}" = {{ mean = "200 [W/(m^2 K)]", sd = "0.01 [W/(m^2 K)]" }} }}\n'
    joint = td.run_stages(with_text(project, ("[joint]", table))).joint
    assert joint is not None
    assert list(joint.values.parameters) == [f"a.{HTC}", JOINT]
    assert joint[JOINT].value == pytest.approx(200.0, abs=0.1)
    only = td.run_stages(with_text(project, (table, '[joint]\nstages = ["pair"]\n'))).joint
    assert only is not None
    assert list(only.records) == ["pair_one"]
    # box is not in it: what it found is no prior, and nothing of it is in the errors
    for fit, said in (
        (joint, "'a.case.mass' of stage 'box' "),
        (only, f"stage 'box' for 'a.{HTC}', 'a.{MASS}' "),
    ):
        (remark,) = (w for w in fit.warnings if said in w)
        assert remark in [x.what for x in fit.store.left_out]


def test_values_of_a_stage_that_is_left_out_are_taken_as_exact_and_it_says_so(project: Path) -> None:
    """Fixed in the stage above: the joint fit of that stage alone has a smaller error than the stage, and tells why."""
    found = td.run_stages(with_text(project, ('as = "prior"', 'as = "fixed"'), ("[joint]", '[joint]\nstages = ["pair"]')))
    joint = found.joint
    assert joint is not None
    assert joint[JOINT].value == pytest.approx(found["pair"][JOINT].value, rel=1e-4)
    assert joint[JOINT].error < found["pair"][JOINT].error
    (said,) = [w for w in joint.warnings if "stage 'box'" in w]
    assert f"'a.{HTC}', 'a.{MASS}' " in said
    assert said in [x.what for x in joint.store.left_out]


def test_the_spread_of_a_fixed_input_counts_in_all_levels_at_once(project: Path) -> None:
    """A power that is 2 % off, beside one that is exact: the joint fit took it as exact, the level above for loose what goes with it."""
    save_model(box({"parameters/power/spread": "2 [%]"}), project.parent / "box.toml")
    found = td.run_stages(project)
    assert found.joint is not None
    for path in (f"a.{HTC}", f"a.{MASS}"):
        alone, pair, joint = found["box"][path.removeprefix("a.")], found["pair"][path], found.joint[path]
        (of_joint,) = found.joint.range_shares(path).values()
        (share,) = found["box"].range_shares(path.removeprefix("a.")).values()
        assert alone.error * share**0.5 == pytest.approx(0.02 * alone.value, rel=0.02)
        assert of_joint > 0.15
        assert joint.value == pytest.approx(pair.value, rel=1e-3)
        assert pair.error == pytest.approx(joint.error, rel=0.05)  # 3.6 times before; both logs together say much of the power


def test_of_all_levels_nothing_is_left_out(campaign: Campaign) -> None:
    assert campaign.joint is not None
    assert not [w for w in campaign.joint.warnings if "stage 'box'" in w or f"'a.{HTC}'" in w]


@pytest.mark.parametrize(
    ("table", "match"),
    [
        ('[joint]\nstages = ["pear"]\n', "'pear'.*'pair'"),
        ('[joint]\nfreeze = ["a.skin.effective_hts"]\n', r"'a\.skin\.effective_hts'"),
        ('[joint]\nfreeze = ["*.x"]\n', r"'\*\.x'"),
        ('[joint]\npriors = { "b.power" = { sd = "1 [W]" } }\n', r"'b\.power'"),
    ],
)
def test_bad_tables(project: Path, table: str, match: str) -> None:
    with raises_code("name.unknown", td.ThermidError, match=match):
        td.run_stages(with_text(project, ("[joint]\n", table)))


def test_two_priors_of_one_value(project: Path) -> None:
    def stated(sd: str, path: str) -> str:
        return f'priors  = {{ "{path}" = {{ mean = "1.6 [kg]", sd = "{sd}" }} }}\n'

    free = f'free    = ["{HTC}", "{MASS}"]\n'
    above = f'free    = ["{JOINT}", "a.{MASS}"]\n'
    fixed = ('inherit = { a = { stage = "box", as = "prior" } }', 'inherit = { a = { stage = "box" } }')
    with_text(
        project, (free, free + stated("0.1 [kg]", MASS)), (f'free    = ["{JOINT}"]\n', above + stated("0.2 [kg]", f"a.{MASS}")), fixed
    )
    with raises_code("campaign.refused", IdentificationError, match=r"'box'.*'pair'.*'a\.case\.mass'"):
        td.run_stages(project)


def test_a_verdict_on_joint_values(project: Path, made: Path) -> None:
    (verdict,) = td.run_stages(with_text(project, ('record   = "pair_two"', 'record   = "pair_two"\nvalues   = "joint"'))).verdicts
    assert (verdict.model, verdict.passed) == ("joint, pair", True)
    with raises_code("campaign.refused", DeckError):
        td.run_stages(with_text(project, ("[joint]\n", "")))


def test_it_is_kept_and_written(project: Path, tmp_path: Path) -> None:
    first = td.run_stages(project, cache=tmp_path)
    seen: list[tuple[str, int]] = []
    again = td.run_stages(project, cache=tmp_path, notice=lambda stage, count, rms: seen.append((stage, count)))
    assert first.joint is not None
    assert again.joint is not None
    assert dict(again.joint.values) == dict(first.joint.values) or again.joint[JOINT].value == first.joint[JOINT].value
    assert "joint" not in {stage for stage, _ in seen}
    assert [f.name for f in again.save(tmp_path)][-1] == "joint.values.toml"
    assert td.load_values(tmp_path / "joint.values.toml")[JOINT].value == first.joint[JOINT].value
