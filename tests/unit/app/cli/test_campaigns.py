"""``thermid check``, ``calibrate``, ``report`` and ``schema``: exit codes, one object on standard output, progress on standard error."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from thermid.app.cli import summary
from thermid.values.store import load_values
from unit.app.cli.conftest import Call

pytestmark = pytest.mark.usefixtures("values_alone")

JOINT = "stack.contact_conductance"


def changed(path: Path, old: str, new: str) -> Path:
    text = path.read_text()
    assert text.count(old) == 1
    path.write_text(text.replace(old, new))
    return path


class TestCheck:
    def test_a_good_deck(self, call: Call, accelerometer: Path) -> None:
        said = call("check", accelerometer)
        assert (said.code, said.err) == (0, "")
        assert said.out.splitlines()[-1] == "accelerometer.toml: 0 errors, 0 warnings, 2 notes"
        assert "it: carried_by = 'free air'" in said.out
        found = call("check", accelerometer, "--json")
        assert found.code == 0
        assert set(found.object) == {"schema", "status", "findings"}
        note = next(f for f in found.object["findings"] if f["where"].endswith("surfaces.skin"))
        assert set(note) == {"severity", "code", "where", "message"}
        assert (note["severity"], note["where"]) == ("note", "accelerometer.toml:15, surfaces.skin")

    def test_a_deck_that_breaks_the_grammar(self, call: Call, tmp_path: Path) -> None:
        deck = tmp_path / "deck.toml"
        deck.write_text('title = "X"\n[nodes]\ncase = { mas = "1 [kg]" }\n')
        said = call("check", deck, "--json")
        assert (said.code, said.err) == (2, "")
        assert said.object["where"] == "deck.toml:3, nodes.case.mas"
        assert said.object["code"] == "file.unknown-key"
        assert "'mass'" in said.object["message"]
        plain = call("check", deck)
        assert (plain.code, plain.out) == (2, "")
        assert plain.err == f"error: {said.object['where']}: {said.object['message']}\n"

    def test_a_deck_that_can_be_read_and_not_used(self, call: Call, tmp_path: Path) -> None:
        deck = tmp_path / "deck.toml"
        deck.write_text(
            'title = "X"\nneeds = ["air"]\n[nodes]\ncase = { capacitance = "1 [J/K]" }\nlone = {}\n'
            '[loads]\nq = { into = "case", power = "1 [W]" }\n'
        )
        said = call("check", deck, "--json")
        assert said.code == 2
        assert said.object["status"] == "error"
        if "findings" in said.object:
            errors = [f for f in said.object["findings"] if f["severity"] == "error"]
            assert (said.object["message"], said.object["where"]) == (errors[0]["message"], errors[0]["where"])
        assert "deck.toml:" in said.object["where"]

    def test_a_campaign(self, call: Call, made: Path) -> None:
        said = call("check", made, "--json")
        assert (said.code, said.object["status"]) == (0, "ok")

    def test_one_kind_of_file_taken_for_the_other(self, call: Call, accelerometer: Path, campaign: Path) -> None:
        said = call("calibrate", accelerometer, "--json")
        assert said.code == 2
        assert said.object["code"] == "file.another-kind"
        assert "DECK --values FILE" in said.object["message"]
        said = call("simulate", campaign, "--json")
        assert said.code == 2
        assert said.object["code"] == "file.another-kind"

    def test_names_are_listed_where_none_is_near(self, call: Call, accelerometer: Path) -> None:
        said = call("simulate", accelerometer, "--boundary", "zzz=20", "--for", "1 [h]", "--json")
        assert (said.code, said.object["message"]) == (2, "no node 'zzz'. There are case, air.")

    def test_a_campaign_with_a_mistake(self, call: Call, campaign: Path) -> None:
        said = call("check", changed(campaign, 'stage = "box", as', 'stage = "bux", as'), "--json")
        assert said.code == 2
        assert said.object["code"] == "name.unknown"
        assert "'box'?" in said.object["message"]
        assert said.object["where"].startswith("campaign.toml:")

    def test_a_campaign_whose_deck_is_gone(self, call: Call, campaign: Path) -> None:
        (campaign.parent / "pair.toml").unlink()
        said = call("check", campaign, "--json")
        assert said.code == 2
        assert "pair.toml" in said.object["message"]


class TestCalibrate:
    def test_the_object_and_decks_that_stay_as_they_were(self, call: Call, campaign: Path) -> None:
        before = {p.name: p.read_bytes() for p in campaign.parent.glob("*.toml")}
        said = call("calibrate", campaign, "--json")
        assert {p.name: p.read_bytes() for p in campaign.parent.glob("*.toml")} == before
        assert said.code == 0
        assert said.out.count("\n") == 1
        found = said.object
        assert (found["schema"], found["status"], found["title"], found["passed"]) == (1, "ok", "Two levels", True)
        box, pair = found["stages"]
        assert {"stage", "free", "values", "errors", "errors_total", "sensors", "records", "warnings"} <= set(box)
        assert (box["stage"], pair["stage"], pair["free"]) == ("box", "pair", [JOINT])
        assert box["free"] == list(box["values"]) == list(box["errors"]) == list(box["errors_total"])
        assert box["values"]["skin.effective_htc"] == pytest.approx(5.0, rel=0.1)
        assert all(0 < box["errors"][p] <= box["errors_total"][p] for p in box["free"])
        assert {"rmse_K", "bias_K", "max_K", "n"} <= set(box["sensors"]["T_A"])
        assert box["sensors"]["T_A"]["n"] == 61
        assert set(pair["records"]) == {"pair_one"}
        assert pair["records"]["pair_one"]["T_B"]["rmse_K"] == pytest.approx(0.05, abs=0.02)
        (verdict,) = found["verdicts"]
        assert {"record", "passed", "conditional", "fitted_locally", "sensors"} <= set(verdict)
        assert (verdict["record"], verdict["passed"], verdict["conditional"], verdict["fitted_locally"]) == ("pair_two", True, False, [])

    def test_values_files_beside_the_campaign_or_where_asked(self, call: Call, fitted_campaign: Path, tmp_path: Path) -> None:
        said = call("calibrate", fitted_campaign, "--json")
        assert said.object["values_files"] == ["box.values.toml", "pair.values.toml"]
        stored = load_values(fitted_campaign.parent / "results" / "pair.values.toml")
        assert stored[JOINT].value == said.object["stages"][1]["values"][JOINT]
        call("calibrate", fitted_campaign, "--to", tmp_path / "here")
        assert (tmp_path / "here" / "pair.values.toml").is_file()

    def test_a_second_run_and_a_fresh_one_say_the_same(self, call: Call, fitted_campaign: Path) -> None:
        def numbers(*more: str) -> list[object]:
            return [
                (s["values"], s["errors_total"], s["sensors"]) for s in call("calibrate", fitted_campaign, "--json", *more).object["stages"]
            ]

        first = numbers()
        assert numbers() == first
        assert numbers("--fresh") == first

    def test_a_fresh_run_is_kept_and_counts_as_a_look(self, call: Call, fitted_campaign: Path, tmp_path: Path) -> None:
        call("calibrate", fitted_campaign, "--fresh", "--to", tmp_path)
        kept = {file.name: file.read_bytes() for file in tmp_path.glob("*.json")}
        assert {"box.fit.json", "pair.fit.json", "pair.errors.json", "looks.json"} <= {*kept}
        (tmp_path / "box.fit.json").write_bytes(kept["box.fit.json"].replace(b'"evaluations": ', b'"evaluations": 9'))
        call("calibrate", fitted_campaign, "--to", tmp_path)
        assert (tmp_path / "box.fit.json").read_bytes() != kept["box.fit.json"], "what is kept is taken"
        call("calibrate", fitted_campaign, "--fresh", "--to", tmp_path)
        assert (tmp_path / "box.fit.json").read_bytes() == kept["box.fit.json"], "a fresh run takes none of it"

    def test_text(self, call: Call, fitted_campaign: Path) -> None:
        said = call("calibrate", fitted_campaign)
        assert said.code == 0
        assert re.search("^Two levels: 2 .* 1 of 1 ", said.out)
        assert "T_A, RMSE 0.0" in said.out
        whole = call("calibrate", fitted_campaign, "-v")
        assert "box: 2" in whole.out
        assert len(whole.out) > 2 * len(said.out)
        assert "pair_two: PASSED" in said.out
        assert "box.values.toml, pair.values.toml\n" in said.out

    def test_a_failed_verdict(self, call: Call, fitted_campaign: Path) -> None:
        said = call("calibrate", changed(fitted_campaign, 'rmse = "0.5 [K]"', 'rmse = "0.001 [K]"'), "--json")
        assert said.code == 1
        assert (said.object["status"], said.object["passed"]) == ("ok", False)
        assert said.object["verdicts"][0]["passed"] is False

    def test_bad_input(self, call: Call, campaign: Path) -> None:
        said = call("calibrate", changed(campaign, '"logs/box_bench.csv"', '"logs/gone.csv"'), "--json")
        assert (said.code, said.err) == (2, "")
        assert said.object["code"] == "record.log-missing"
        assert all(part in said.object["message"] for part in ("'logs/gone.csv'", "--data", "THERMID_DATA"))
        assert said.object["where"] == "campaign.toml:5, records.box_bench"

    def test_the_solver(self, call: Call, campaign: Path) -> None:
        deck = campaign.parent / "box.toml"
        text = deck.read_text()
        assert text.count('power = "power"') == 1
        away = 'power = "power", exponential_coefficient = "0.5 [1/K]", reference_temperature = "20 [degC]"'
        deck.write_text(text.replace('power = "power"', away))
        said = call("calibrate", campaign, "--json")
        assert said.code == 3, said.out
        assert said.object["code"] == "run.did-not-finish"
        assert said.object["code"] == "run.did-not-finish"
        assert "'case'" in said.object["message"]
        assert said.object["where"].startswith("campaign.toml:")

    def test_not_identifiable(self, call: Call, campaign: Path) -> None:
        free = 'free    = ["skin.effective_htc", "case.mass"]'
        said = call("calibrate", changed(campaign, free, 'free    = ["skin.effective_htc", "skin.area"]'), "--json")
        assert said.code == 4
        assert "skin.effective_htc*skin.area = 0.2" in said.object["message"]
        assert said.object["where"].startswith("campaign.toml:20, stages.0")

    def test_a_used_record_is_not_a_validation(self, call: Call, campaign: Path) -> None:
        said = call("calibrate", changed(campaign, 'record   = "pair_two"', 'record   = "pair_one"'), "--json")
        assert said.code == 4
        assert said.object["code"] == "campaign.record-used"

    def test_a_data_folder(self, call: Call, fitted_campaign: Path, tmp_path: Path) -> None:
        (fitted_campaign.parent / "logs").rename(tmp_path / "logs")
        assert call("calibrate", fitted_campaign, "--json").code == 2
        assert call("calibrate", fitted_campaign, "--data", tmp_path, "--json").code == 0

    def test_a_results_folder_that_is_a_file(self, call: Call, campaign: Path, tmp_path: Path) -> None:
        (tmp_path / "file").write_text("")
        said = call("calibrate", campaign, "--to", tmp_path / "file", "--json")
        assert said.code == 2
        assert said.object["code"] == "file.refused-by-system"
        assert "'" in said.object["message"]

    def test_progress_goes_to_standard_error_once_it_takes_long(self, call: Call, campaign: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        import itertools

        import thermid.app.cli.screen as command

        seconds = itertools.count(0.0, 3.0)
        monkeypatch.setattr(command, "SECONDS_TO_FIRST_PROGRESS", 2.0)
        monkeypatch.setattr(command.time, "monotonic", lambda: next(seconds))
        said = call("calibrate", campaign, "--json", "--fresh")
        assert json.loads(said.out)["status"] == "ok"
        first, second, last = said.err.splitlines()
        assert [re.split("[:,]", line)[0] for line in (first, second)] == ["box", "pair"]
        assert " pair_two " in last


class TestReport:
    def test_it_writes_a_page(self, call: Call, fitted_campaign: Path, tmp_path: Path) -> None:
        pytest.importorskip("thermid.reporting._pages.campaign", reason="the reporting room is not there")
        pytest.importorskip("jinja2")
        page = tmp_path / "page.html"
        said = call("report", fitted_campaign, "--to", page, "--json")
        assert said.code == 0, said.out
        assert (said.object["status"], said.object["passed"]) == ("ok", True)
        text = page.read_text(encoding="utf-8")
        assert "Two levels" in text
        assert JOINT in text
        assert "<html" in text

    def test_it_says_that_a_verdict_failed(self, call: Call, fitted_campaign: Path, tmp_path: Path) -> None:
        pytest.importorskip("thermid.reporting._pages.campaign", reason="the reporting room is not there")
        pytest.importorskip("jinja2")
        said = call("report", changed(fitted_campaign, 'rmse = "0.5 [K]"', 'rmse = "0.001 [K]"'), "--to", tmp_path / "page.html")
        assert said.code == 1
        assert (tmp_path / "page.html").is_file()

    def test_alone_it_takes_the_only_campaign_of_its_folder(
        self, call: Call, fitted_campaign: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.chdir(fitted_campaign.parent)
        said = call("report")
        assert "campaign.toml" in said.out
        assert Path("report.html").is_file()
        monkeypatch.chdir("..")  # as after `thermid example`, which writes a folder
        folder = fitted_campaign.parent.name
        assert str(Path(folder, "campaign.toml")) in call("report").out
        monkeypatch.chdir(folder)
        Path("second.toml").write_bytes(fitted_campaign.read_bytes())
        assert "value.incomplete" in call("report").codes
        assert "campaign.toml, second.toml. Name one" in call("report").err

    def test_it_asks_where_the_report_goes(self, call: Call, campaign: Path) -> None:
        said = call("report", campaign)
        assert said.code == 2
        assert "value.incomplete" in said.codes
        assert "--to page.html or --to page.pdf" in said.err

    def test_a_missing_browser_is_told_before_anything_runs(
        self, call: Call, campaign: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:

        monkeypatch.setenv("PATH", str(tmp_path))
        from thermid.reporting._blocks import content as extras

        monkeypatch.setattr(extras, "PLACES", ())
        said = call("report", campaign, "--to", tmp_path / "page.pdf")
        assert said.code == 2
        assert "extra.no-browser" in said.codes
        assert "evaluation" not in said.err
        assert list(tmp_path.glob("page*")) == []

    def test_a_pdf_alone_leaves_no_page_behind(self, call: Call, fitted_campaign: Path, tmp_path: Path) -> None:
        from thermid.reporting._blocks import content as extras

        try:
            extras.browser()
        except extras.NoBrowserError:
            pytest.skip("no Chromium, Chrome or Edge to print with")
        said = call("report", fitted_campaign, "--to", tmp_path / "out" / "page.pdf", "--json")
        assert said.code == 0, said.out
        assert said.object["pdf"] == str(tmp_path / "out" / "page.pdf")
        assert "page" not in said.object
        assert (tmp_path / "out" / "page.pdf").read_bytes().startswith(b"%PDF-")


class TestSchema:
    @pytest.mark.parametrize("kind", ["deck", "campaign"])
    def test_it_is_a_schema_that_the_files_of_the_examples_follow(self, call: Call, kind: str, accelerometer: Path, made: Path) -> None:
        import tomllib

        said = call("schema", kind)
        assert said.code == 0
        found = said.object
        assert found["type"] == "object"
        file = accelerometer if kind == "deck" else made
        assert set(tomllib.loads(file.read_text())) <= set(found["properties"])

    def test_deck_is_the_default(self, call: Call) -> None:
        assert call("schema").out == call("schema", "deck").out

    def test_an_unknown_kind(self, call: Call) -> None:
        said = call("schema", "campain")
        assert said.code == 2
        kinds = "deck, scenario, campaign, study, plan, lock, limits, hold, profile, values, looks, delivery, sensors, programme"
        assert "'campain'" in said.err
        assert "'campaign'" in said.err
        assert said.err.endswith(f" {kinds}.\n")


class TestPredict:
    def test_a_stage_and_a_scenario(self, call: Call, fitted_campaign: Path, tmp_path: Path) -> None:
        scenario = tmp_path / "hot.toml"
        scenario.write_text('title = "hot"\nstart = "24 [degC]"\nduration = "2 [h]"\n[boundaries]\nroom = "40 [degC]"\n')
        asked = ("predict", fitted_campaign, "--scenario", scenario, "--spread", "room=1 [K]")
        said = call(*asked, "--at", "1 [h]", "--csv", tmp_path / "p.csv", "--json")
        assert said.code == 0, said.out
        assert said.object["scenario"] == "hot"
        node = said.object["nodes"]["a.case"]
        assert set(node) == {"run_C", "moved_K", "final", "steady", "at"}
        assert node["run_C"] + sum(node["moved_K"].values()) == pytest.approx(node["final"]["C"], abs=1e-3)
        assert node["steady"]["low_C"] < node["steady"]["C"] < node["steady"]["high_C"]
        assert sum(node["final"]["shares"].values()) == pytest.approx(1.0)
        assert (tmp_path / "p.csv").is_file()
        plain = call(*asked, "--at", "1 [h]")
        assert plain.code == 0
        assert "95 %" in plain.out
        assert "  at 3600 s: " in plain.out

    @pytest.mark.parametrize(
        ("more", "code", "part"),
        [
            ((), "command.not-understood", ""),
            (("--csv", "p.csv", "--vacuum"), "command.not-understood", "--vacuum, --csv"),
            (("--scenario", "hot.toml", "--spread", "room"), "value.wrong-kind", "PATH=VALUE"),
            (("--scenario", "hot.toml", "--at", "5 [h]"), "value.outside-range", "18000 s"),
            (("--scenario", "hot.toml", "--stage", "m_Pr"), "name.unknown", "'m_Pr'"),
            (("--stage", "pair"), "command.not-understood", "--stage"),
            (("--record", "pair_1", "--vacuum"), "command.not-understood", ""),
            (("--record", "pair_9"), "name.unknown", "'pair_9'"),
        ],
    )
    def test_what_is_missing_is_told_before_anything_is_fitted(
        self,
        call: Call,
        fitted_campaign: Path,
        tmp_path: Path,
        more: tuple[str, ...],
        code: str,
        part: str,
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        monkeypatch.setattr(summary, "run_stages", None)
        scenario = tmp_path / "hot.toml"
        scenario.write_text('start = "24 [degC]"\nduration = "2 [h]"\n[boundaries]\nroom = "40 [degC]"\n')
        said = call("predict", fitted_campaign, *(str(scenario) if m == "hot.toml" else m for m in more))
        assert (said.code, said.codes) == (2, (code,))
        assert part in said.err


class TestRecordsThatArePredicted:
    def test_each_with_its_band(self, call: Call, fitted_campaign: Path) -> None:
        """Of two runs one was fitted: it says nothing of the next run, and is named."""
        asked = ("predict", fitted_campaign, "--stage", "pair", "--record", "pair_*")
        said = call(*asked)
        told = call(*asked, "--json").object
        assert "pair_one" in said.out
        assert [r["record"] for r in told["records"]] == ["pair_one", "pair_two"]
        assert "pair_two" in said.out


class TestPowerThatNobodyMeasured:
    def test_absolute_values_are_refused_with_what_is_known(self, call: Call, tmp_path: Path) -> None:
        from unit.fit.project import make_project

        campaign = make_project(tmp_path)
        changed(campaign, 'free    = ["skin.effective_htc", "case.mass"]', 'free    = ["skin.effective_htc", "case.mass", "power"]')
        said = call("calibrate", campaign)
        assert (said.code, said.out) == (4, "")
        assert "fix 'power'" in said.err
        assert "power/skin.effective_htc" in said.err
        told = call("identify", campaign, "--stage", "box")
        assert told.code == 0
        assert "'power' to 5 %" in told.out


class TestIdentify:
    def test_says_what_the_logs_of_a_stage_can_tell(self, call: Call, tmp_path: Path) -> None:
        from unit.fit.project import make_project

        campaign = make_project(tmp_path)
        said = call("identify", campaign, "--stage", "pair")
        assert (said.code, said.err) == (0, "")
        assert re.match(r"pair: .* 1 .*\(122 ", said.out)
        assert f"{JOINT} = 200 W/(m^2 K) +- " in said.out
        found = call("identify", campaign, "--after", "--json")
        assert found.code == 0
        assert set(found.object) == {"schema", "status", "stages"}
        assert found.object["stages"]["box"]["stage"] == "after"
        assert found.object["stages"]["box"]["rank"] == 2

    def test_finished_stages_are_not_fitted_again(self, call: Call, fitted_campaign: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        campaign, kept = fitted_campaign, fitted_campaign.parent / "results"
        first = call("identify", campaign, "--after", "--results", kept, "--json")

        def searched(*_: object) -> None:
            raise AssertionError("a stage was fitted again")

        monkeypatch.setattr("thermid.fit._calibrate.searched", searched)
        again = call("identify", campaign, "--after", "--results", kept, "--json")
        assert (again.code, again.object) == (0, first.object)

    def test_an_unknown_stage(self, call: Call, tmp_path: Path) -> None:
        from unit.fit.project import make_project

        said = call("identify", make_project(tmp_path), "--stage", "pear", "--json")
        assert said.code == 2
        assert "no stage 'pear'" in said.object["message"]
