"""Failure travels: a stage that is not credible, failed or not adequate is told by whatever rests on it, at every level."""

from __future__ import annotations

import itertools
import json
import re
from dataclasses import replace
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from pydantic import TypeAdapter

import thermid as td
from by_code import raises_code
from plain_errors import errors_in_full
from thermid.base.errors import DeckError
from thermid.campaign._file import CampaignSource
from thermid.campaign._stages import Campaign, request_of, run_stages
from thermid.fit._calibrate import rests_on
from thermid.model.tree import CREDIBLE, UNJUDGED, Standing, State, load_model
from thermid.values._schema import TrustField
from thermid.values.store import FittedValue, FittedValues
from unit.fit.planted import BOX_VALUES, CAMPAIGN, planted

pytestmark = pytest.mark.usefixtures("values_alone")

WHY = r"T_BOX .* \+0\.\d+ K, 1\d .* 0\.05 K"
ORDER = get_args(State)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The planted project, run once with its results kept."""
    root = tmp_path_factory.mktemp("planted")
    planted(root)
    return root


@pytest.fixture(scope="module")
def bad(folder: Path) -> Campaign:
    return run_stages(folder / "campaign.toml", cache=folder / "results")


def changed(folder: Path, old: str, new: str) -> Path:
    """Return the campaign of a folder with a text in it replaced."""
    assert old in CAMPAIGN
    path = folder / "changed.toml"
    path.write_text(CAMPAIGN.replace(old, new))
    return path


def test_a_stage_that_is_not_credible_is_told_three_levels_up(bad: Campaign, folder: Path) -> None:
    assert [fit.standing.state for fit in bad.stages.values()] == ["not credible"] * 3
    assert {fit.standing.stage for fit in bad.stages.values()} == {"box"}
    assert bad["box"].own.state == "not credible"
    assert bad["whole"].own.state != "not credible"
    assert re.match(f"NOT CREDIBLE: {WHY}", bad["box"].standing.line("box"))
    above = bad["whole"].standing
    assert re.match(WHY, above.line("whole").partition("'box' (")[2])
    assert all(part in str(bad) for part in ("NOT CREDIBLE", "'box'"))
    assert all(part in str(bad["whole"]) for part in ("NOT CREDIBLE", "'box'"))
    assert bad["whole"].model.standing == above
    assert not bad.passed
    assert bad.exit_code == 1


def test_files_of_values_and_every_result_carry_it(bad: Campaign, folder: Path, tmp_path: Path) -> None:
    above = bad["whole"].standing
    bad.save(tmp_path)
    values = td.load_values(tmp_path / "whole.values.toml")
    assert values.standing == above
    assert {v.standing for v in values.values()} == {above}
    scenario = td.load_scenario(folder / "scenario.toml")
    bench = td.Scenario("bench", start="24 [degC]")
    laid = load_model(folder / "whole.toml").with_values(values.assignments, "whole.values.toml")
    asked = ("link", [td.qualify.Limits("c", "c.case", ("0 [degC]", "60 [degC]"))], [scenario])
    found = {
        "predict": td.predict(bad["whole"], scenario),
        "foresee": td.design.foresee(td.design.Knowledge.of_source(bad["whole"]), scenario),
        "foresee, from a file": td.design.foresee(td.design.Knowledge(laid, (values,)), scenario),
        "uncertain_runs": (runs := td.qualify.uncertain_runs(load_model(folder / "whole.toml"), scenario, values, n=24, nodes=["c.case"])),
        "hold": td.qualify.hold(runs, {"c.case": "60 [degC]"}, confidence=0.5),
        "correlate": td.qualify.correlate(
            td.compare(laid, CampaignSource.read(folder / "campaign.toml").record("whole_one"), scenario=bench), ["MIL-HDBK-340, transient"]
        ),
        "plan_retune": td.design.plan_retune(bad, "p", folder / "pair.toml"),
        "size": td.design.size(bad["whole"], *asked, between=(0.5, 5.0)),
        "size, from a file": td.design.size(td.design.Knowledge(load_model(folder / "whole.toml"), values), *asked, between=(0.5, 5.0)),
        "size, of knowledge": td.design.size(td.design.Knowledge(laid, fit=bad["whole"]), *asked, between=(0.5, 5.0)),
        "ends of a range": td.design.worst_case(laid, asked[1], scenario, {"room": ("20 [degC]", "30 [degC]")}),
        "ensemble": td.ensemble(load_model(folder / "whole.toml"), scenario, {} | values.draws(4, seed=1), nodes=["c.case"]),
        "ensemble, values held": td.ensemble(laid, scenario, {"link": np.ones(4)}, nodes=["c.case"]),
    }
    for name, one in found.items():
        assert one.standing == above, name
        if name.startswith(("predict", "unc", "hold", "plan", "corr", "size", "ens")):
            assert re.match(r"NOT CREDIBLE: [^'\n]*'box' \(", str(one)), name
    assert found["predict"].to_dict()["standing"]["state"] == "not credible"


def test_a_record_is_not_opened_for_values_that_are_not_credible(tmp_path: Path) -> None:
    """Invariant 15: the list of looks stays as it is; the log is not even read."""
    results, path = tmp_path / "results", planted(tmp_path, bias=0.0)
    honest = run_stages(path, cache=results)
    assert honest.verdicts[0].passed is True
    assert honest.standing.fair
    looks = (results / "looks.json").read_bytes()
    assert len(json.loads(looks)) == 1
    planted(tmp_path)
    (tmp_path / "logs" / "whole_two.csv").write_text("no log at all")
    for accept in ((), ("box",)):
        made = run_stages(path, cache=results, accept=accept)
        (verdict,) = made.verdicts
        assert (verdict.passed, verdict.prediction, verdict.checks) == (None, None, ())
        assert all(part in str(verdict) for part in ("whole_two: NOT JUDGED", "NOT CREDIBLE"))
        assert (results / "looks.json").read_bytes() == looks
        assert made.exit_code == (0 if accept else 1)
        assert made.standing.accepted == bool(accept)
    assert td.validate(made["whole"], CampaignSource.read(path).record("whole_one"), td.Criteria(rmse="1 [K]")).passed is None


HOW = ("fixed", "prior", "freed", "freed, prior about it", "freed, prior of its own")


@pytest.mark.parametrize("how", list(itertools.product(HOW, HOW)), ids=lambda pair: " and ".join(pair))
def test_only_a_value_freed_without_a_prior_sheds_what_it_had(bad: Campaign, folder: Path, how: tuple[str, str]) -> None:
    """Invariant 14, every mixture of two values: what is expected is told from the campaign's text alone."""
    as_, free, priors = "fixed", [], {}
    for path, one in zip(BOX_VALUES, how, strict=True):
        as_ = "prior" if one == "prior" else as_
        if one.startswith("freed"):
            free.append(f"a.{path}")
        if one.startswith("freed, prior"):
            priors[f"a.{path}"] = {"sd": "30 [%]"} | (
                {"mean": {"skin": "5 [W/(m^2 K)]", "case": "1.7 [kg]"}[path[:4]]} if "own" in one else {}
            )
    source = CampaignSource.read(folder / "campaign.toml")
    stage = source.content.stages[1].model_dump(by_alias=True)
    only = [p for p, one in zip(BOX_VALUES, how, strict=True) if one == "prior"]
    handed = {"a": {"stage": "box"}} if as_ == "fixed" else {"a": {"stage": "box", "as": "prior"}}
    stage |= {"free": [*stage["free"], *free], "priors": priors, "inherit": handed}
    if only and len(only) < 2:  # the other one is handed on as fixed: frozen among the priors
        (other,) = set(BOX_VALUES) - set(only)
        stage |= {"freeze": [f"a.{other}"]} if f"a.{other}" not in free else {}
    request = request_of(source, type(source.content.stages[1]).model_validate(stage), 1, {"box": bad["box"]})
    prior = {q for p in request.prior for q in request.store.states[p].acts}
    values = found_at([*request.free, *(p for p in prior if p not in request.free)])
    expected = [
        one for path, one in zip(BOX_VALUES, how, strict=True) if f"a.{path}" in prior or one not in ("freed", "freed, prior of its own")
    ]
    assert {s.stage for s in rests_on(request, values).values() if not s.fair} == ({"box"} if expected else set())


def found_at(paths: list[str]) -> FittedValues:
    """Return fitted values of some paths, whatever they are."""
    return FittedValues("pair", {p: FittedValue(p, 1.0, 0.1, 0.1, True, "1", 1.0, (0.0, 2.0)) for p in paths}, np.eye(len(paths)))


def test_a_stage_that_looks_for_the_values_itself_is_credible_again(folder: Path) -> None:
    path = changed(
        folder,
        'free     = ["stack.contact_conductance"]',
        'free     = ["stack.contact_conductance", "a.skin.effective_htc", "a.case.mass"]',
    )
    made = run_stages(path)
    assert made["box"].standing.state == "not credible"
    assert made["pair"].standing == replace(CREDIBLE, stage="pair")
    assert made["whole"].standing.usable
    assert made.verdicts[0].passed is not None
    assert made.standing.state == "not credible"


def test_a_failed_verdict_goes_up_and_changes_no_key(tmp_path: Path) -> None:
    path = planted(tmp_path, bias=0.0)
    honest = run_stages(path)
    verdict = '[[verdicts]]\nmodel    = "pair"\nrecord   = "pair_two"\ncriteria = { rmse = "0.001 [K]" }\n'
    text = CAMPAIGN + verdict
    log = (tmp_path / "logs" / "pair_one.csv").read_text().splitlines()
    (tmp_path / "logs" / "pair_two.csv").write_text("\n".join(log[:40]))
    path.write_text(text)
    made = run_stages(path)
    assert [made[s].standing.state for s in made] == ["credible", "failed", "failed"]
    assert re.match(r"FAILED: [^'\n]*'pair' \(.*pair_two: T_", made["whole"].standing.line("whole"))
    assert made["whole"].values.standing == made["whole"].standing
    assert made.keys == honest.keys
    taken = run_stages(path, accept=["pair"])
    assert (made.exit_code, taken.exit_code) == (1, 0)
    assert taken["whole"].standing.line("whole") == made["whole"].standing.line("whole").replace("FAILED:", "FAILED (accepted):")


def test_values_that_miss_too_much_or_end_at_a_bound_are_not_adequate(tmp_path: Path) -> None:
    path = planted(tmp_path, bias=0.0)
    plain, both = 'inherit  = { a = { stage = "box" } }\n', CAMPAIGN.partition('[[stages]]\nname     = "whole"')[0]
    path.write_text(both.replace(plain, ""))  # the boxes keep the values of their deck, which are wrong by a fifth
    with errors_in_full():
        rough = run_stages(path)["pair"]  # by less than elements depart by: the errors count it, and the first lines say it
    assert (rough.standing.state, rough.structural_errors) == ("credible", True)
    path.write_text(both.replace(plain, 'adequate = "0.2 [K]"\n'))
    missed = run_stages(path)
    assert missed["pair"].standing.state == "not adequate"
    assert "'adequate')" in missed["pair"].standing.because
    assert missed.exit_code == 5
    path.write_text(both.replace(plain, 'adequate = "5 [K]"\n'))
    assert run_stages(path)["pair"].standing.state == "credible"
    path.write_text(both.replace(plain, f'{plain}adequate = "0.001 [K]"\n').replace('"box_bench"]', '"box_bench"]\nadequate = "9 [K]"'))
    narrow = (tmp_path / "pair.toml").read_text().replace("min = 20", "min = 190")
    (tmp_path / "pair.toml").write_text(narrow)
    bound = run_stages(path)["pair"].standing
    assert bound.state == "not adequate"
    assert "'stack.contact_conductance'" in bound.because


def test_a_stage_to_accept_must_be_one(folder: Path) -> None:
    with raises_code("name.unknown", DeckError, match="'boks'.*'box'"):
        run_stages(folder / "campaign.toml", accept=["boks"])
    path = changed(folder, 'title = "Three levels"', 'title = "Three levels"\naccept = ["boks"]')
    with raises_code("name.unknown", DeckError, match="'boks'"):
        CampaignSource.read(path)


STANDINGS = st.recursive(
    st.builds(Standing, st.sampled_from(ORDER), st.sampled_from(["", "why"]), st.sampled_from(["a", "b", "c"]), st.booleans()),
    lambda inner: st.lists(inner, min_size=1, max_size=3).map(Standing.worst),
    max_leaves=6,
)


@settings(max_examples=30, deadline=None, derandomize=True, database=None)
@given(st.lists(STANDINGS, min_size=1, max_size=4), st.sets(st.sampled_from(["a", "b", "c"])))
def test_what_rests_on_several_is_never_better_than_any(several: list[Standing], accepted: set[str]) -> None:
    """Invariants 14 and 16: no rank is lost on the way up, and exit code 0 leaves no cause that nobody accepted."""
    whole = Standing.worst(several)
    assert whole.rank == max(s.rank for s in several)
    assert {(c.state, c.stage) for s in several for c in s.causes} == {(c.state, c.stage) for c in whole.causes}
    taken = whole.accept(accepted)
    assert taken.rank == whole.rank
    assert (taken.exit_code == 0) == all(c.accepted for c in taken.causes)
    assert TypeAdapter(TrustField).validate_python(whole.as_table()) == whole
    if any(not c.accepted and not c.usable for s in several for c in s.causes):
        assert whole.exit_code == 1


def test_standing_of_plain_models() -> None:
    from unit.fit.bench import HTC, box

    assert box().standing == UNJUDGED
    assert box().with_values({HTC: "5 [W/(m^2 K)]"}).standing == UNJUDGED
    fitted = FittedValue(HTC, 5.0, 0.1, 0.1, True, "W/(m^2 K)", 6.0, (1.0, 20.0), standing=Standing("failed", "x", "s"))
    laid = box().with_values({HTC: fitted}, "stage 's'")
    assert laid.standing.state == "failed"
    assert laid.with_values({HTC: "5 [W/(m^2 K)]"}).standing == UNJUDGED, "it does not act any more"
    assert laid.identity() == box().with_values({HTC: replace(fitted, standing=CREDIBLE)}, "stage 's'").identity()
