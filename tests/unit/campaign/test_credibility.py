"""What every value rests on, what two versions differ by, and how often a record was looked at."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

import thermid as td
from by_code import raises_code
from thermid.app.cli.app import app
from thermid.base.errors import DeckError, NameNotFoundError
from thermid.campaign._judge.verdict import FILE, _read, look
from thermid.campaign._stages import Campaign, _looked
from thermid.fit.error_model import SIZES
from thermid.model.tree import Standing
from unit.fit.bench import HTC, MASS
from unit.fit.project import CAMPAIGN, make_project

pytestmark = pytest.mark.usefixtures("values_alone")

JOINT = "stack.contact_conductance"


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_project(tmp_path_factory.mktemp("record"))


@pytest.fixture(scope="module")
def campaign(project: Path) -> Campaign:
    return td.run_stages(project)


@pytest.fixture(scope="module")
def record(campaign: Campaign) -> td.inference.CredibilityRecord:
    return td.inference.credibility(campaign)


class TestRecord:
    def test_every_value_is_there(self, record: td.inference.CredibilityRecord, campaign: Campaign) -> None:

        assert set(record) == set(campaign["pair"].model.parameter_table())
        assert sum(record.states.values()) == len(record)

    def test_calibrated_here(self, record: td.inference.CredibilityRecord, campaign: Campaign) -> None:
        row = record[JOINT]
        assert (row.state, row.level, row.tests, row.unit) == ("calibrated", "pair", ("pair_one",), "W/(m^2 K)")
        assert row.value == pytest.approx(campaign["pair"][JOINT].value)
        assert row.error == pytest.approx(campaign["pair"][JOINT].error)
        assert (row.minimum, row.maximum) == (20.0, 2000.0)
        assert row.date == campaign["pair"].values.provenance["date"]

    def test_the_values_are_those_to_quote_under_their_standing(self, campaign: Campaign) -> None:
        """Of a fit whose elements depart from their laws, not those that draw its curves."""
        pair = campaign["pair"]
        quoted = (1.2 * pair[JOINT].value, 3.0 * pair[JOINT].error)
        departing = replace(pair, expected={JOINT: quoted}, own=Standing("not adequate", "a bound", "pair"))
        found = td.inference.credibility(replace(campaign, stages={**campaign.stages, "pair": departing.judged({}, Standing("credible"))}))
        assert (found[JOINT].value, found[JOINT].error) == pytest.approx(quoted)
        assert str(found).startswith("NOT ADEQUATE")

    def test_frozen_from_below(self, record: td.inference.CredibilityRecord, campaign: Campaign) -> None:
        row = record[f"a.{MASS}"]
        assert (row.state, row.level, row.tests) == ("frozen", "box", ("box_bench",))
        assert row.error == pytest.approx(campaign["box"][MASS].error)
        assert row.origin == "stage 'box'"

    def test_what_the_deck_says(self, tmp_path: Path) -> None:
        path = make_project(tmp_path)
        deck = path.parent / "pair.toml"
        deck.write_text(
            deck.read_text().replace(
                'area = "20 [cm^2]"', 'area = { value = "20 [cm^2]", source = "datasheet", basis = "sheet 7", spread = "5 [%]" }'
            )
        )
        found = td.inference.credibility(td.run_stages(path))
        area = found["stack.area"]
        assert (area.state, area.basis, area.spread) == ("datasheet", "sheet 7", "5 [%]")
        assert found[f"b.{HTC}"].state == "not stated"
        assert found["b.heat.power"].state == "computed"
        assert found["b.heat.power"].unit == "W"

    def test_an_unknown_path_names_the_nearest(self, record: td.inference.CredibilityRecord) -> None:
        with raises_code("name.unknown", NameNotFoundError, match=r"'stack\.contact_conductanse'"):
            record["stack.contact_conductanse"]

    def test_files(self, record: td.inference.CredibilityRecord, tmp_path: Path) -> None:
        as_json = json.loads(record.save(tmp_path / "r.json").read_text())
        assert as_json.pop("seal").startswith("written by thermid: credibility record")
        assert as_json["values"][JOINT]["tests"] == ["pair_one"]
        assert as_json["verdicts"] == [{"model": "pair", "record": "pair_two", "passed": True, "unseen": True}]
        assert "pair_one" in str(record)

    def test_of_a_joint_fit(self, tmp_path: Path) -> None:
        path = make_project(tmp_path, CAMPAIGN.replace("[[verdicts]]", "[joint]\n\n[[verdicts]]", 1))
        row = td.inference.credibility(td.run_stages(path))[f"a.{MASS}"]
        assert (row.state, row.level, row.tests) == ("calibrated", "joint", ("box_bench", "pair_one"))

    def test_on_the_command_line(self, project: Path, tmp_path: Path) -> None:
        call = ["credibility", str(project), "--results", str(tmp_path / "r")]
        plain = CliRunner().invoke(app, call)
        assert plain.exit_code == 0, plain.output
        assert plain.stdout.startswith("Two levels: ")
        assert str(SIZES) in plain.stdout
        done = CliRunner().invoke(app, [*call, "--to", str(tmp_path / "c.json"), "--json"])
        told = json.loads(done.stdout)
        assert told["values"][JOINT]["state"] == "calibrated"
        assert told["sizes_of_error"]["run"]["sets"] == 9
        assert (tmp_path / "c.json").is_file()


class TestLooks:
    def test_failed_then_fitted_anew(self, project: Path, tmp_path: Path) -> None:
        shutil.copytree(project.parent, tmp_path / "p")
        path, results = tmp_path / "p" / "campaign.toml", tmp_path / "r"
        text = path.read_text()
        path.write_text(text.replace('rmse = "0.5 [K]"', 'rmse = "0.0001 [K]"'))
        (failed,) = td.run_stages(path, cache=results).verdicts
        assert not failed.passed
        assert failed.unseen
        (again,) = td.run_stages(path, cache=results).verdicts
        assert again.unseen, "the same values judged again are no new look"
        path.write_text(text.replace('free    = ["stack', 'free    = ["b.skin.effective_htc", "stack'))
        (after,) = td.run_stages(path, cache=results).verdicts
        assert not after.unseen
        assert after.failed_before[0].record == "pair_two"
        assert str(after) != str(replace(after, failed_before=())), "that the record is no longer independent"
        (elsewhere,) = td.run_stages(path).verdicts
        assert elsewhere.unseen, "without a results folder nothing is remembered"

    def test_within_limits_by_values_that_are_not_fair_is_no_pass(self, campaign: Campaign, tmp_path: Path) -> None:
        (verdict,) = campaign.verdicts
        assert verdict.passed
        doubted = replace(verdict, standing=Standing("not adequate", "", verdict.model))
        other = replace(campaign, keys={**campaign.keys, verdict.model: "other values"})
        assert _looked(tmp_path, doubted, campaign).unseen
        assert not _looked(tmp_path, verdict, other).unseen

    def test_a_record_that_passed_stays_unseen(self, tmp_path: Path) -> None:
        assert look(tmp_path, "r", "sha", "pair", "key1", True) == ()
        assert look(tmp_path, "r", "sha", "pair", "key2", False) == ()
        assert [o.key for o in look(tmp_path, "r", "sha", "pair", "key3", True)] == ["key2"]
        assert [o.sha256 for o in _read(tmp_path)] == ["sha"] * 3

    def test_a_damaged_file_is_refused_and_stays(self, tmp_path: Path) -> None:
        for damaged in ("", "[{", "{}", '[{"record": "r"}]'):
            (tmp_path / FILE).write_text(damaged)
            with pytest.raises(DeckError, match=r"looks\.json: "):
                _read(tmp_path)
            with pytest.raises(DeckError, match="damaged"):
                look(tmp_path, "r", "sha", "pair", "key", True)
            assert (tmp_path / FILE).read_text() == damaged
        assert list(_read(None)) == []
