"""A campaign file: stages in order, values handed on, verdicts on what no stage has seen; and every kind of bad input in words."""

from __future__ import annotations

import json
import os
import re
import shutil
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from by_code import raises_code
from studio.large import wide_campaign
from thermid.base.errors import IdentificationError, NameNotFoundError, StoppedError, ThermidError, code_of
from thermid.campaign._file import CampaignSource
from thermid.campaign._stages import Campaign, request_of, run_stages
from thermid.campaign._survey import check_campaign
from thermid.fit._problem.request import in_full
from thermid.fit.error_model import ErrorModel
from thermid.model.tree import TableSignal
from thermid.reporting.pages import report
from thermid.values.store import error_table_of, load_values
from unit.fit.bench import HTC, MASS
from unit.fit.project import CAMPAIGN, make_project
from unit.interrupted import Still

pytestmark = pytest.mark.usefixtures("values_alone")

JOINT = "stack.contact_conductance"
FIXED = 'as = "fixed"'


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A project that no test writes to."""
    return make_project(tmp_path_factory.mktemp("made"))


@pytest.fixture
def project(made: Path, tmp_path: Path) -> Path:
    """A copy of it to be changed."""
    shutil.copytree(made.parent, tmp_path / "p")
    return tmp_path / "p" / "campaign.toml"


def changed(path: Path, *changes: tuple[str, str]) -> Path:
    """Change the campaign at places that are there exactly once."""
    text = path.read_text()
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    path.write_text(text)
    return path


def unjudged(path: Path) -> Path:
    """Take the verdict off a campaign: a test that looks at fits alone need not wait for bands."""
    path.write_text(path.read_text().partition("[[verdicts]]")[0])
    return path


def refused(path: Path) -> ThermidError:
    with pytest.raises(ThermidError) as caught:
        run_stages(path)
    return caught.value


def line_of(path: Path, text: str) -> int:
    return next(k for k, line in enumerate(path.read_text().splitlines(), 1) if text in line)


@pytest.fixture(scope="module")
def campaign(made: Path) -> Campaign:
    return run_stages(made)


@pytest.fixture(scope="module")
def results(made: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Campaign]:
    """Finished stages of the project as it is, which no test writes to, and the campaign that left them."""
    folder = tmp_path_factory.mktemp("results")
    return folder, run_stages(made, cache=folder)


class TestRun:
    def test_each_stage_finds_its_truth(self, campaign: Campaign) -> None:
        assert list(campaign) == ["box", "pair"]
        for path, truth in ((HTC, 5.0), (MASS, 1.7)):
            found = campaign["box"][path]
            assert abs(found.value - truth) < 4 * found.error
        # what is held is taken for known, so the error above does not say how far the joint may be off
        assert campaign["pair"][JOINT].value == pytest.approx(150.0, rel=0.1)

    def test_fixed_values_are_those_of_the_stage_below_to_the_bit(self, campaign: Campaign) -> None:
        above = campaign["pair"]
        assert list(above.values.parameters) == [JOINT]
        for path in (HTC, MASS):
            value = above.model.at(f"a.{path}").expression.literal.value
            assert value == campaign["box"][path].value
        assert above.bias["T_A"] == pytest.approx(campaign["box"].bias["T_A"], abs=3 * campaign["box"]["sensor T_A"].error)

    def test_verdict(self, campaign: Campaign) -> None:
        (verdict,) = campaign.verdicts
        assert (verdict.model, verdict.record, verdict.passed, verdict.conditional) == ("pair", "pair_two", True, False)
        assert campaign.passed

    def test_table_has_parts_down_and_levels_across(self, campaign: Campaign) -> None:
        table = campaign.table("effective_htc")
        value = campaign["box"][HTC].value
        assert table["skin"] == {"box": value}
        assert table["a.skin"] == {"pair": value}
        assert table["b.skin"] == {"pair": 6.0}

    def test_what_was_seen_is_carried_up(self, campaign: Campaign) -> None:
        assert set(campaign["pair"].used_records.values()) == {"stage 'box' as 'box_bench'", "stage 'pair' as 'pair_one'"}

    def test_values_files(self, campaign: Campaign, tmp_path: Path) -> None:
        files = campaign.save(tmp_path)
        assert [f.name for f in files] == ["box.values.toml", "pair.values.toml"]
        assert dict(load_values(files[0])) == dict(campaign["box"].values)

    def test_an_unknown_stage_names_the_nearest(self, campaign: Campaign) -> None:
        with raises_code("name.unknown", NameNotFoundError, match="'pear'.*'pair'"):
            campaign["pear"]

    @pytest.mark.parametrize("workers", [ThreadPoolExecutor(2), pytest.param(2, marks=pytest.mark.campaign)])
    def test_stages_that_rest_on_nothing_are_fitted_together(self, campaign: Campaign, project: Path, workers: Any) -> None:
        """The second box waits for none, the pair for the first; what comes out is in the order of the file, and kept."""
        other = '[[stages]]\nname = "other"\nmodel = "box.toml"\nrecords = ["box_bench"]\nfree = ["case.mass"]\n'
        changed(project, ("[[verdicts]]", f"{other}\n[[verdicts]]"))
        found = run_stages(project, executor=workers, cache=project.parent / "results")
        assert list(found) == list(run_stages(project)) == ["box", "pair", "other"]
        for stage in ("box", "pair"):
            assert found[stage].fitted == campaign[stage].fitted
        assert list(run_stages(project, cache=project.parent / "results").changed) == []

    def test_a_stage_among_several_is_named_where_it_fails(self, project: Path) -> None:
        changed(project, ('free    = ["skin.effective_htc", "case.mass"]', 'free    = ["skin.effective_htc", "case.mas"]'))
        alone = refused(project)
        with pytest.raises(ThermidError) as caught:
            run_stages(project, executor=ThreadPoolExecutor(2))
        assert str(caught.value) == str(alone)

    def test_text(self, campaign: Campaign) -> None:
        text = str(campaign)
        assert "\n\nbox: 2" in text
        verdict = str(campaign.verdicts[0]).splitlines()
        assert text.rstrip().endswith("\n".join(verdict[-3:]))
        assert any(line.endswith(": met") for line in verdict)
        assert [line.split()[0] for line in verdict if "95 %" in line] == ["T_A", "T_B"]
        assert re.search(r": T_[AB] ", verdict[-1])

    def test_notice(self, made: Path) -> None:
        seen: list[str] = []
        run_stages(made, notice=lambda stage, count, rms: seen.append(stage))
        box, pair, verdict = dict.fromkeys(seen)
        assert (box, pair) == ("box", "pair")
        assert "pair_two" in verdict

    @pytest.mark.parametrize("stage", ["box", "pair"])
    def test_the_interrupt_key_keeps_the_best_values(self, made: Path, stage: str) -> None:
        """With a stage above it they stand in the refusal; of the last stage they are a fit that is not credible, and nothing is judged."""

        def press(name: str, count: int, rms: float) -> None:
            if (name, count) == (stage, 2):
                raise KeyboardInterrupt

        if stage == "box":
            with raises_code("fit.stopped", StoppedError, match="2.*'box'"):
                run_stages(made, notice=press)
            return
        found = run_stages(made, notice=press)
        assert found["pair"].stopped
        assert found["pair"].standing.state == "not credible"
        assert [v.passed for v in found.verdicts] == [None]
        assert found["pair"].standing.because in str(found)


class TestInheritance:
    def test_as_prior_frees_what_was_below_with_its_covariance(self, project: Path) -> None:
        fixed = run_stages(unjudged(project))
        prior = run_stages(unjudged(changed(project, (FIXED, 'as = "prior"'))))
        above, below = prior["pair"], prior["box"]
        assert list(above.values.parameters) == [JOINT, f"a.{HTC}", f"a.{MASS}"]
        for path in (HTC, MASS):
            assert above[f"a.{path}"].error < below[path].error
            assert abs(above[f"a.{path}"].value - below[path].value) < 4 * below[path].error
        # a fixed value is not let go, so its error moves the others by more
        assert fixed["pair"][JOINT].error > above[JOINT].error > above[JOINT].error_random
        assert abs(fixed["pair"][JOINT].value - 150.0) < 2 * fixed["pair"][JOINT].error
        for path, truth in ((JOINT, 150.0), (f"a.{HTC}", 5.0), (f"a.{MASS}", 1.7)):
            assert abs(above[path].value - truth) < 4 * above[path].error

    def test_only_some(self, project: Path) -> None:
        found = run_stages(unjudged(changed(project, (FIXED, 'as = "prior", only = ["case.mass"]'))))["pair"]
        assert list(found.values.parameters) == [JOINT, f"a.{MASS}"]
        assert found.model.at(f"a.{HTC}").text == "6 [W/(m^2 K)]"

    def test_the_parents_own_set_wins_and_it_is_said(self, project: Path) -> None:
        deck = project.parent / "pair.toml"
        deck.write_text(deck.read_text() + '\n[set]\n"a.skin.effective_htc" = "5.5 [W/(m^2 K)]"\n')
        found = run_stages(unjudged(project))["pair"]
        assert found.model.at(f"a.{HTC}").text == "5.5 [W/(m^2 K)]"
        (told,) = (w for w in found.warnings if "[set]" in w)
        assert all(part in told for part in (f"'a.{HTC}'", "5.5 [W/(m^2 K)]", "Pair", "'box'"))

    def test_what_the_set_hides_is_no_prior_either(self, project: Path) -> None:
        deck = project.parent / "pair.toml"
        deck.write_text(deck.read_text() + '\n[set]\n"a.skin.effective_htc" = "5.5 [W/(m^2 K)]"\n')
        found = run_stages(unjudged(changed(project, (FIXED, 'as = "prior"'))))["pair"]
        assert list(found.values.parameters) == [JOINT, f"a.{MASS}"]
        assert found.model.at(f"a.{HTC}").text == "5.5 [W/(m^2 K)]"
        assert any("[set]" in w and "'box'" in w for w in found.warnings)

    @pytest.mark.parametrize("how", ["fixed", "prior"])
    def test_a_part_by_its_alias(self, project: Path, how: str) -> None:
        deck = project.parent / "pair.toml"
        deck.write_text(deck.read_text() + '\n[aliases]\nfirst = "a"\n')
        changed(project, (FIXED, f'as = "{how}"'))
        plain = run_stages(unjudged(project))["pair"]
        named = run_stages(unjudged(changed(project, ("{ a = { stage", "{ first = { stage"))))["pair"]
        assert dict(named.values) == dict(plain.values)

    def test_two_parts_from_one_stage_share_what_it_says_of_sensors_once(self, project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        import thermid.campaign._stages as stages

        deck = project.parent / "pair.toml"
        deck.write_text(deck.read_text().replace('use = "cool.toml"', 'use = "box.toml"'))
        both = 'inherit = { a = { stage = "box", as = "prior" }, b = { stage = "box", as = "prior" } }'
        asked, original = [], stages.fit
        monkeypatch.setattr(stages, "fit", lambda request, *more, **how: asked.append(request) or original(request, *more, **how))
        run_stages(unjudged(changed(project, ('inherit = { a = { stage = "box", as = "fixed" } }', both))))
        assert list(asked[1].store.states) == [f"a.{HTC}", f"a.{MASS}", "sensor T_A", f"b.{HTC}", f"b.{MASS}"]
        rows = asked[1].store.rows
        np.testing.assert_array_equal(rows([f"a.{HTC}", f"a.{MASS}"]), rows([f"b.{HTC}", f"b.{MASS}"]))

    def test_the_model_itself_by_a_dot(self, project: Path) -> None:
        changed(
            project,
            ('model   = "pair.toml"', 'model   = "box.toml"'),
            ('records = ["pair_one"]', 'records = ["pair_one"]\nbind = { T_A = "case", ROOM = "air" }\nignore = ["T_B"]'),
        )
        changed(project, ('["stack.contact_conductance"]', '["power"]'), ("{ a = {", '{ "." = {'))
        found = run_stages(unjudged(project))["pair"]
        assert found.model.at(HTC).expression.literal.value == run_stages(unjudged(project))["box"][HTC].value

    def test_readings_that_are_in_the_prior_already_are_remarked(self, project: Path) -> None:
        again = '[[stages]]\nname = "again"\nmodel = "box.toml"\nrecords = ["box_bench"]\n'
        again += 'inherit = { "." = { stage = "box", as = "prior" } }'
        found = run_stages(unjudged(changed(project, before(VERDICTS, again))))
        assert any("'box_bench'" in w and "'box' too" in w for w in found["again"].warnings)
        assert not any("'box' too" in w for w in found["pair"].warnings)


VERDICTS = "[[verdicts]]"
PAIRS = "[records.pairs]"
BENCH = "[records.box_bench]"
STAGES = "[[stages]]"


AGAIN = """[[stages]]
name = "again"
model = "pair.toml"
records = ["pair_one"]
free = ["a.power"]
inherit = { PART = { stage = "pair" } }"""


def before(place: str, text: str) -> tuple[str, str]:
    """Put a text before a place that is in the campaign once."""
    return place, f"{text}\n\n{place}"


BAD = [
    # what is changed, into what, the text whose line the message must have, the words
    ('free    = ["stack', 'fre     = ["stack', "fre ", "file.unknown-key", r"stages\.1\.fre: 'fre'.*'free'"),
    ('title = "Two levels"', 'titel = "Two levels"', None, "file.key-missing", r"campaign\.toml:2.*'titel'.*'title'"),
    ('get      = "Run', 'gett     = "Run', "gett ", "file.unknown-key", r"records\.box_bench\.gett: 'gett'.*'get'"),
    ('model   = "pair.toml"\n', "", STAGES, "file.key-missing", r"stages\.1\.model"),
    (
        'stage = "box", as',
        'stage = "bux", as',
        "inherit",
        "name.unknown",
        "'a'.*'bux'.*'box'",
    ),
    ('stage = "box", as', 'stage = "pair", as', "inherit", "name.unknown", "'a'.*'pair'"),
    ('name    = "pair"', 'name    = "box"', STAGES, "name.taken", "'box'"),
    ('name    = "pair"', 'name    = ""', 'name    = ""', "name.not-valid", ""),
    ('model    = "pair"', 'model    = "pear"', 'model    = "pear"', "name.unknown", r"verdicts\.0\.model.*'pear'.*'pair'"),
    ('records = ["pair_one"]', 'records = ["pair_won"]', STAGES, "name.unknown", "'pair_won'.*'pair_two'"),
    ('records = ["pair_one"]', 'records = ["bench_*"]', STAGES, "name.unknown", r"'bench_\*'"),
    ('record   = "pair_two"', 'record   = "pair_tow"', VERDICTS, "name.unknown", "'pair_tow'.*'pair_two'"),
    (
        '"logs/box_bench.csv"',
        '"logs/gone.csv"',
        BENCH,
        "record.log-missing",
        r"log 'logs/gone\.csv'.*\(--data, or THERMID_DATA\)\. Run the test",
    ),
    ('"logs/pair_*.csv"', '"logs/nothing_*.csv"', PAIRS, "record.log-missing", r"log 'logs/nothing_\*\.csv'"),
    (
        '"logs/box_bench.csv"',
        '"../box_bench.csv"',
        BENCH,
        "file.outside-project",
        r"'\.\./box_bench\.csv'.*\(thermid\.toml",
    ),
    ('"logs/pair_*.csv"', '"../logs/pair_*.csv"', PAIRS, "file.outside-project", r"'\.\./logs'.*\(thermid\.toml"),
    (
        'model   = "pair.toml"',
        'model   = "../pair.toml"',
        STAGES,
        "file.outside-project",
        r"'\.\./pair\.toml'.*\(thermid\.toml",
    ),
    ('model   = "pair.toml"', 'model   = "pear.toml"', None, "file.not-found", r"'pear\.toml'.*'pair\.toml'"),
    ('file     = "logs/box_bench.csv"\n', "", BENCH, "value.excludes-another", "`file`, or `files`"),
    ('free    = ["stack.contact_conductance"]', 'free    = ["stack.contact"]', STAGES, "name.unknown", r"'stack\.contact'"),
    ('T_A = { node = "case"', 'T_X = { node = "case"', BENCH, "name.unknown", "'T_X'.*'T_A'"),
    (
        'time     = "time_s"\nchannels = { T_A = { node = "case"',
        'time     = "t_s"\nchannels = { T_A = { node = "case"',
        BENCH,
        "name.unknown",
        "'t_s'",
    ),
    (
        'accuracy = "0.3 [K]" }, ROOM = { boundary = "air" }',
        'accuracy = "0.3 [W]" }, ROOM = { boundary = "air" }',
        BENCH,
        "unit.wrong-dimension",
        "",
    ),
    ('rmse = "0.5 [K]"', 'rms = "0.5 [K]"', VERDICTS, "name.unknown", "'rms'.*'rmse'"),
    ('{ rmse = "0.5 [K]" }', "{ }", VERDICTS, "value.incomplete", "'T_A' "),
    (
        *before(VERDICTS, 'priors = { "stack.contact_conductance" = { mean = "150 [W]", sd = "1 [W]" } }'),
        STAGES,
        "unit.wrong-dimension",
        r"priors\.stack\.contact_conductance",
    ),
    (*before(VERDICTS, 'loss = "hubert"'), "loss", "file.wrong-value", r"stages\.1\.loss.*'linear', 'soft_l1', 'huber' or 'cauchy'"),
    (*before(VERDICTS, 'window = "5 [K]"'), STAGES, "unit.wrong-dimension", ""),
    (*before(VERDICTS, "weights = { T_C = 0.5 }"), STAGES, "name.unknown", "'T_C'"),
    (*before(VERDICTS, 'ignore = ["T_C"]'), STAGES, "name.unknown", "'T_C'"),
    (*before(VERDICTS, 'bind = { T_C = "a.case" }'), STAGES, "name.unknown", "'T_C'"),
    (
        *before(VERDICTS, 'bind = { T_A = { nod = "a.case" } }'),
        STAGES,
        "value.incomplete",
        "",
    ),
    (
        *before(VERDICTS, 'bind = { T_A = { node = "a.case", noise = "1 [K]" } }'),
        STAGES,
        "value.incomplete",
        "",
    ),
    (*before(VERDICTS, 'readings = { room = "T_C" }'), STAGES, "name.unknown", "'T_C'"),
    (*before(VERDICTS, 'local = { room = { sd = "1 [K]" } }'), None, "file.key-missing", r"local\.room\.start"),
    (*before(VERDICTS, "prepare = []"), "prepare", "file.unknown-key", r"stages\.1\.prepare: 'prepare'"),
    (
        *before(PAIRS, '[checksums]\nbox_bensch = "00"'),
        None,
        "record.log-missing",
        "'box_bensch', but no log.*'box_bench'",
    ),
    (*before(PAIRS, '[checksums]\nbox_bench = "0123456789ab"'), BENCH, "record.another-log", ""),
    (
        *before(PAIRS, '[records.pair_one]\nfile = "logs/box_bench.csv"\nchannels = { T_A = "T_A" }'),
        PAIRS,
        "name.taken",
        r"'pair_one': 'box_bench\.csv' and 'pair_one\.csv'",
    ),
]


@pytest.mark.parametrize(("old", "new", "at", "code", "match"), BAD, ids=[f"{k}-{b[1][:24].strip()}" for k, b in enumerate(BAD)])
def test_bad_input_is_refused_with_its_place(project: Path, old: str, new: str, at: str | None, code: str, match: str) -> None:
    changed(project, (old, new))
    error = refused(project)
    assert code_of(str(error)) == code
    assert re.search(match, str(error)), str(error)
    assert "campaign.toml" in error.where or at is None
    if at is not None:
        line = int(error.where.split(":")[1].split(",")[0])
        places = [k for k, text in enumerate(project.read_text().splitlines(), 1) if at in text]
        assert line in places, error.where


def test_every_fault_of_the_grammar_is_listed(project: Path) -> None:
    changed(project, ('title = "Two levels"', 'titel = "Two levels"'), ('free    = ["stack', 'fre     = ["stack'))
    text = str(refused(project))
    assert "'titel'" in text
    assert "'fre'" in text
    assert "title: is missing" in text


def test_a_missing_campaign_and_one_that_is_no_toml(tmp_path: Path, project: Path) -> None:
    with raises_code("file.not-found", match=r"'campain\.toml'.*'campaign\.toml'"):
        CampaignSource.read(project.parent / "campain.toml")
    project.write_text("title = ")
    with raises_code("file.not-valid", match=r"campaign\.toml.*TOML"):
        CampaignSource.read(project)


@pytest.mark.parametrize("name", ["pa ir", "Pa_ir", "pa/ir"])
def test_stages_that_would_share_a_file_are_refused(project: Path, name: str) -> None:
    changed(
        project, ('name    = "box"', 'name    = "pa_ir"'), ('stage = "box"', 'stage = "pa_ir"'), ('name    = "pair"', f'name    = "{name}"')
    )
    assert code_of(str(refused(project))) == "name.taken"
    assert f"'pa_ir' and '{name}'" in str(refused(project))


class TestUsedRecords:
    def test_a_verdict_on_a_record_of_any_stage(self, project: Path) -> None:
        error = refused(changed(project, ('record   = "pair_two"', 'record   = "pair_one"')))
        assert isinstance(error, IdentificationError)
        assert code_of(error.message) == "campaign.record-used"
        assert "'pair' as 'pair_one'" in error.message
        assert error.where.endswith("verdicts.0")

    def test_though_it_was_trimmed_and_has_another_name(self, project: Path) -> None:
        copy = (
            '[records.fresh]\nfile = "logs/pair_one.csv"\ntime = "time_s"\nprepare = [{ trim = ["1 [h]", "end"] }]\n'
            'channels = { T_A = { node = "a.case" }, ROOM = { boundary = "room" } }\n\n[[verdicts]]'
        )
        error = refused(changed(project, ("[[verdicts]]", copy), ('record   = "pair_two"', 'record   = "fresh"')))
        assert code_of(error.message) == "campaign.record-used"
        assert "'pair' as 'pair_one'" in error.message

    def test_though_the_file_was_copied_and_compressed(self, project: Path) -> None:
        import gzip

        text = (project.parent / "logs" / "pair_one.csv").read_bytes()
        (project.parent / "logs" / "pair_new.csv.gz").write_bytes(gzip.compress(text))
        changed(
            project, ('"logs/pair_*.csv"', '["logs/pair_*.csv", "logs/pair_*.csv.gz"]'), ('record   = "pair_two"', 'record   = "pair_new"')
        )
        assert code_of(refused(project).message) == "campaign.record-used"
        assert "'pair' as 'pair_one'" in refused(project).message

    def test_a_pattern_judges_each(self, project: Path) -> None:
        logs = project.parent / "logs"
        rows = np.loadtxt(logs / "pair_two.csv", delimiter=",", skiprows=1)
        np.savetxt(logs / "pair_twice.csv", rows[:100], delimiter=",", header="time_s,T_A,T_B,ROOM", comments="")
        found = run_stages(changed(project, ('record   = "pair_two"', 'record   = "pair_tw*"')))
        assert [v.record for v in found.verdicts] == ["pair_twice", "pair_two"]


class TestWhereLogsLie:
    def test_a_data_folder_outside_the_project(self, project: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        (project.parent / "logs").rename(tmp_path / "logs")
        assert "'logs/box_bench.csv'" in str(refused(project))
        assert run_stages(project, data=tmp_path).passed
        monkeypatch.setenv("THERMID_DATA", str(tmp_path))
        assert run_stages(project).passed

    def test_a_data_folder_that_is_not_there(self, project: Path) -> None:
        with raises_code("record.log-missing", match=r"campaign\.toml.*'none'.*THERMID_DATA"):
            run_stages(project, data=project.parent / "none")

    def test_a_link_out_of_the_project_is_refused(self, project: Path, tmp_path: Path) -> None:
        outside = tmp_path / "outside.csv"
        shutil.copy(project.parent / "logs" / "box_bench.csv", outside)
        (project.parent / "logs" / "box_bench.csv").unlink()
        os.symlink(outside, project.parent / "logs" / "box_bench.csv")
        assert code_of(str(refused(project))) == "file.outside-project"
        assert "'logs/box_bench.csv'" in str(refused(project))

    def test_checksum_of_the_right_log(self, project: Path) -> None:
        sha = CampaignSource.read(project).record("box_bench").origin.sha256
        changed(project, ("[records.pairs]", f'[checksums]\nbox_bench = "{sha[:16]}"\n\n[records.pairs]'))
        assert run_stages(project).passed

    def test_a_failed_look_leaves_nothing_half_known(self, project: Path) -> None:
        source = CampaignSource.read(changed(project, ('"logs/pair_*.csv"', '"logs/nothing_*.csv"')))
        for _ in range(2):
            with raises_code("record.log-missing", match=r"'logs/nothing_\*\.csv'"):
                source.pick(["box_bench"], "here")


class TestCache:
    def runs(self, path: Path, folder: Path, judged: bool = False) -> tuple[Campaign, list[str]]:
        """Run with a results folder, judged where asked for, and return what came out and which stages were searched anew."""
        searched: list[str] = []

        def notice(stage: str, count: int, rms: float) -> None:
            if count and stage not in searched:
                searched.append(stage)

        return run_stages(path if judged else unjudged(path), cache=folder, notice=notice), searched

    def numbers(self, campaign: Campaign) -> list[object]:
        return [
            (dict(c.values), c.values.covariance.tolist(), c.local, c.chi_square, c.warnings, {n: s.rmse for n, s in c.sensors.items()})
            for c in campaign.stages.values()
        ]

    def test_a_second_run_takes_the_stages_as_they_were(self, project: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        """Their models of error too."""
        made: list[str] = []
        of_fit = ErrorModel.of_fit
        monkeypatch.setattr(ErrorModel, "of_fit", lambda fit: made.append(fit.stage) or of_fit(fit))
        one, first = self.runs(project, tmp_path / "r", judged=True)
        errors = [error_table_of(c.values.provenance) for c in one.stages.values()]
        assert made == ["pair", "box"]
        two, second = self.runs(project, tmp_path / "r", judged=True)
        assert (first, second) == (["box", "pair"], [])
        assert self.numbers(one) == self.numbers(two)
        assert [v.checks for v in one.verdicts] == [v.checks for v in two.verdicts]
        assert [error_table_of(c.values.provenance) for c in two.stages.values()] == errors
        assert made == ["pair", "box"]

    @pytest.mark.parametrize("noise", ["stated", "measured"])
    def test_last_digits_of_errors_below_do_not_run_a_stage_again(self, tmp_path: Path, noise: str) -> None:
        path = wide_campaign(tmp_path, 2)
        if noise == "measured":
            path.write_text(path.read_text().replace(', noise = "0.1 [K]"', ""))
        one, first = self.runs(path, tmp_path / "r")
        two, second = self.runs(path, tmp_path / "r")
        assert (first, second) == (["Receiver_1", "Converter_1", "bay"], [])
        assert one.keys == two.keys
        for stage in one:
            for name, found in one[stage].values.items():
                assert two[stage][name].value == found.value
                assert two[stage][name].error == pytest.approx(found.error, rel=1e-5)

    @pytest.mark.parametrize("loss", ["linear", "huber"])
    def test_also_where_no_noise_is_stated(self, project: Path, tmp_path: Path, loss: str) -> None:
        text = project.read_text().replace('noise = "0.05 [K]", ', "").replace(', noise = "0.05 [K]"', "")
        project.write_text(text.replace("free    =", f'loss = "{loss}"\nfree    ='))
        one, _ = self.runs(project, tmp_path / "r")
        two, second = self.runs(project, tmp_path / "r")
        assert second == []
        assert self.numbers(one) == self.numbers(two)

    @pytest.mark.parametrize(
        ("change", "again"),
        [
            (('"stack.contact_conductance"]', '"stack.contact_conductance", "b.case.mass"]'), ["pair"]),
            ((FIXED, 'as = "prior"'), ["pair"]),
            ((FIXED, 'as = "fixed", only = ["case.mass"]'), ["pair"]),
            (('free    = ["skin.effective_htc", "case.mass"]', 'free    = ["skin.effective_htc"]'), ["box", "pair"]),
            (
                ('accuracy = "0.3 [K]" }, ROOM = { boundary = "air" }', 'accuracy = "0.4 [K]" }, ROOM = { boundary = "air" }'),
                ["box", "pair"],
            ),
            (("[[verdicts]]", 'loss = "huber"\n\n[[verdicts]]'), ["pair"]),
            (("[[verdicts]]", "weights = { T_B = 0.5 }\n\n[[verdicts]]"), ["pair"]),
            (("[[verdicts]]", 'window = "5 [min]"\n\n[[verdicts]]'), ["pair"]),
            (("[[verdicts]]", 'priors = { "stack.contact_conductance" = { sd = "50 [%]" } }\n\n[[verdicts]]'), ["pair"]),
            (("[[verdicts]]", 'scenario = { start = "24.001 [degC]" }\n\n[[verdicts]]'), ["pair"]),
            (("[[verdicts]]", 'local = { "initial.a.case" = { start = "24 [degC]", sd = "1 [K]" } }\n\n[[verdicts]]'), ["pair"]),
            (
                ('files    = "logs/pair_*.csv"', 'files    = "logs/pair_*.csv"\nprepare  = [{ trim = ["1 [min]", "end"] }]'),
                ["pair"],
            ),
            (('rmse = "0.5 [K]"', 'rmse = "0.6 [K]"'), []),
            (('title = "Two levels"', 'title = "Other"'), []),
        ],
        ids=lambda c: c[1][:30].strip() if isinstance(c, tuple) else "",
    )
    def test_what_a_change_of_the_campaign_runs_again(
        self, project: Path, tmp_path: Path, results: tuple[Path, Campaign], change: tuple[str, str], again: list[str]
    ) -> None:
        shutil.copytree(results[0], tmp_path / "r")
        _, second = self.runs(changed(project, change), tmp_path / "r", judged=not again)
        assert second == again

    def test_fixed_and_prior_are_told_apart_where_the_same_names_are_free(self, project: Path, tmp_path: Path) -> None:
        # without accuracies nothing else tells them apart
        project.write_text(project.read_text().replace(', accuracy = "0.3 [K]"', ""))
        wide = ('["stack.contact_conductance"]', '["stack.contact_conductance", "a.skin.effective_htc", "a.case.mass"]')
        fixed, _ = self.runs(changed(project, wide), tmp_path / "r")
        prior, second = self.runs(changed(project, (FIXED, 'as = "prior"')), tmp_path / "r")
        assert second == ["pair"]
        assert prior["pair"][f"a.{HTC}"].error < fixed["pair"][f"a.{HTC}"].error

    def test_a_changed_log_or_deck_runs_again(self, project: Path, tmp_path: Path, results: tuple[Path, Campaign]) -> None:
        shutil.copytree(results[0], tmp_path / "r")
        file = project.parent / "logs" / "pair_one.csv"
        lines = file.read_text().splitlines()
        lines[50] = lines[50][:-1] + ("1" if lines[50][-1] != "1" else "2")
        file.write_text("\n".join(lines) + "\n")
        assert self.runs(project, tmp_path / "r")[1] == ["pair"]
        deck = project.parent / "cool.toml"
        assert "1 [W]" in deck.read_text()
        deck.write_text(deck.read_text().replace("1 [W]", "1.01 [W]"))
        assert self.runs(project, tmp_path / "r")[1] == ["pair"]
        deck.write_text("# only a remark\n" + deck.read_text())
        assert self.runs(project, tmp_path / "r")[1] == []

    def test_every_sample_of_a_long_table_counts(self) -> None:
        values = np.linspace(20.0, 30.0, 5000)
        other = values.copy()
        other[2500] = np.nextafter(values[2500], 40.0)
        texts = [json.dumps(TableSignal(np.arange(5000.0), v), default=in_full) for v in (values, other)]
        assert texts[0] != texts[1]

    def test_what_a_kept_fit_says_of_its_search(self, project: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        """The page and the summary of a campaign that is run twice are the same: what a fit took is kept with its end."""
        joint = '["stack.contact_conductance"]'
        project.write_text(project.read_text().replace(joint, f'{joint}\nsearch = "multistart"'))
        one, first = self.runs(project, tmp_path / "r", judged=True)
        two, second = self.runs(project, tmp_path / "r", judged=True)
        assert (first, second) == (["box", "pair"], [])
        assert all(one[n].evaluations > 3 for n in first)
        assert one["pair"].search
        for name in first:
            assert (one[name].evaluations, one[name].search, one[name].warnings) == (
                two[name].evaluations,
                two[name].search,
                two[name].warnings,
            )
            assert str(one[name]) == str(two[name])
        monkeypatch.setattr("thermid.reporting._pages.tables.datetime", Still)
        pages = [report(c, to=tmp_path / f"{k}" / "page.html").read_bytes() for k, c in enumerate((one, two))]
        assert pages[0] == pages[1]

    @pytest.mark.parametrize("damage", [b"", b"{", b"[]", b"{}", b'{"key": 1}', b"\xff\xfe\x00", b'{"key": "x", "fitted": 3}', b"null"])
    def test_a_damaged_file_is_as_good_as_none(self, project: Path, tmp_path: Path, results: tuple[Path, Campaign], damage: bytes) -> None:
        one = results[1]
        shutil.copytree(results[0], tmp_path / "r")
        file = tmp_path / "r" / "pair.fit.json"
        file.write_bytes(damage)
        two, second = self.runs(project, tmp_path / "r")
        assert second == ["pair"]
        assert self.numbers(one) == self.numbers(two)

    def test_numbers_in_the_kept_file_that_are_none(self, project: Path, tmp_path: Path, results: tuple[Path, Campaign]) -> None:
        one = results[1]
        shutil.copytree(results[0], tmp_path / "r")
        file = tmp_path / "r" / "pair.fit.json"
        kept = json.loads(file.read_text())
        kept["fitted"][JOINT] = float("nan")
        file.write_text(json.dumps(kept))
        two, second = self.runs(project, tmp_path / "r")
        assert second == ["pair"]
        assert self.numbers(one) == self.numbers(two)


def test_the_campaign_text_of_these_tests_runs_as_it_stands(made: Path) -> None:
    assert made.read_text() == CAMPAIGN


def test_freeze_ranges_and_measured_neighbours_from_a_campaign(project: Path) -> None:
    text = project.read_text().replace(FIXED, 'as = "prior"')
    stage = text[text.index('[[stages]]\nname    = "pair"') : text.index("[[verdicts]]")]
    frozen = stage.replace('"pair"\n', '"frozen"\n', 1).replace("free    =", 'freeze  = ["a.*.mass"]\nfree    =')
    driven = stage.replace('"pair"\n', '"driven"\n', 1).replace("[stages", "[stages")
    driven += 'bind = { T_A = { prescribed = "a.case" } }\n'
    driven = "\n".join(line for line in driven.splitlines() if not line.startswith("inherit")) + "\n"
    project.write_text(text.replace("[[verdicts]]", f"{frozen}\n{driven}\n[[verdicts]]"))
    campaign = run_stages(project)
    assert set(campaign["pair"].values.parameters) == {JOINT, f"a.{HTC}", f"a.{MASS}"}
    assert set(campaign["frozen"].values.parameters) == {JOINT, f"a.{HTC}"}
    frozen = campaign["frozen"]
    assert frozen.store[f"a.{MASS}"].value == campaign["box"][MASS].value
    assert any(line.startswith(f"  a.{MASS} ") and "(stage 'box', fixed)" in line for line in str(frozen).splitlines())
    assert [m.path for m in campaign["pair"].moved.values] == [f"a.{HTC}", f"a.{MASS}"]
    assert list(campaign["driven"].sensors) == ["T_B"]
    assert campaign["driven"][JOINT].value == pytest.approx(150.0, rel=0.1)


def test_a_range_that_is_none_says_where(project: Path) -> None:
    changed(project, ('inherit = { a = { stage = "box", as = "fixed" } }', f'priors = {{ "{JOINT}" = "range" }}'))
    error = refused(project)
    assert code_of(str(error)) == "value.without-effect"
    assert re.search(r"'stack\.contact_conductance' has", str(error))
    assert f"priors.{JOINT}" in error.where


def test_a_corrected_unit_runs_a_finished_stage_again(project: Path, tmp_path: Path) -> None:
    """The hash of a log is of its numbers as they are written, so what makes temperatures of them belongs to the key of a stage."""
    from dataclasses import replace

    request = run_stages(project).requests["box"]
    (record,) = request.records
    first = request.stage_key([])
    channel = record.channels["T_A"]
    for field, other in (("unit", "K"), ("resolution", 0.1), ("correction", 0.5)):
        changed_ = record.with_channels(replace(channel, **{field: other}))
        assert replace(request, records=(changed_,)).stage_key([]) != first, field


def test_a_record_says_the_unit_of_its_time(project: Path) -> None:
    plain = run_stages(project)["box"]
    log = project.parent / "logs" / "box_bench.csv"
    lines = log.read_text().splitlines()
    rows = [[str(float(row[0]) / 60.0), *row[1:]] for row in (line.split(",") for line in lines[1:])]
    log.write_text("\n".join([lines[0].replace("time_s", "when"), *(",".join(row) for row in rows)]), encoding="utf-8")
    text = project.read_text().replace('time     = "time_s"', 'time     = "when"\nunits    = { when = "min" }', 1)
    project.write_text(text, encoding="utf-8")
    again = run_stages(project)["box"]
    assert again[HTC].value == pytest.approx(plain[HTC].value, rel=1e-6)
    project.write_text(text.replace('when = "min"', 'wen = "min"'), encoding="utf-8")
    assert code_of(str(refused(project))) == "name.unknown"
    assert "Channels: T_A, ROOM" in str(refused(project))


def test_a_channel_says_that_it_was_logged_at_every_change(project: Path) -> None:
    text = project.read_text().replace('ROOM = { boundary = "air" }', 'ROOM = { boundary = "air", prompt = true }', 1)
    project.write_text(text, encoding="utf-8")
    assert code_of(str(refused(project))) == "record.does-not-apply"


def test_one_instance_is_untied_by_name(tmp_path: Path) -> None:
    """`untie` takes a list; what is cut is in the stage's model and in the key of its result."""
    path = make_project(tmp_path)
    deck = path.parent / "pair.toml"
    deck.write_text(deck.read_text().replace('use = "cool.toml"', 'use = "box.toml"'))
    source = CampaignSource.read(path)
    stage = next(s for s in source.content.stages if s.name == "pair").model_copy(update={"inherit": {}, "free": ["a.case.mass"]})
    requests = [request_of(source, stage.model_copy(update={"untie": u}), 1, {}) for u in (False, ["b"], ["b.case.mass"], True)]
    groups = [r.shared.get("a.case.mass", ("a.case.mass",)) for r in requests]
    assert groups == [("a.case.mass", "b.case.mass"), *[("a.case.mass",)] * 3]
    assert requests[2].shared["a.skin.area"] == ("a.skin.area", "b.skin.area")
    assert len({r.stage_key([]) for r in requests}) == 4


def test_what_is_kept_back_is_known_to_one_of_several_stages(project: Path) -> None:
    alone = AGAIN.partition("inherit")[0].replace("again", "alone").replace("a.power", "b.power")
    listed = AGAIN.replace('PART = { stage = "pair"', '"." = { stage = ["pair", "alone"], without = ["b.power"]')
    changed(project, before(VERDICTS, f"{alone}\n{listed}"))
    assert [f for f in check_campaign(project)[0] if f.severity == "error"] == []


@pytest.mark.parametrize(
    ("old", "new", "code", "match"),
    [
        (
            *before(VERDICTS, AGAIN.replace("PART", "a")),
            "name.unknown",
            r"'a\.skin\.effective_htc', .* 'Box' .* 'Pair', .* \"\.\" .* 'a'\.",
        ),
        (*before(VERDICTS, AGAIN.replace("PART", "b")), "name.unknown", r"\"\.\" .* 'b'\."),
        (
            'as = "fixed" }',
            'as = "fixed", without = ["skin.hct"] }',
            "name.unknown",
            r"stages\.1\.inherit\.a\.without.*'skin\.hct' .* 'box'",
        ),
        ('as = "fixed" }', 'as = "prior", move = ["case.mas"] }', "name.unknown", r"move: 'case\.mas' "),
        ('free    = ["stack', 'freeze = ["b.power"]\nfree    = ["stack', "value.without-effect", r"'b\.power' "),
    ],
)
def test_check_finds_without_a_fit_what_inheritance_refuses(
    project: Path, old: str, new: str, code: str, match: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fitted(*_: object) -> None:
        raise AssertionError("a stage was fitted")

    monkeypatch.setattr("thermid.fit._calibrate.fit_problem", fitted)
    changed(project, (old, new))
    errors = [f for f in check_campaign(project)[0] if f.severity == "error"]
    assert len(errors) == 1
    assert errors[0].code == code
    assert re.search(match, f"{errors[0].where}: {errors[0].message}"), errors
    monkeypatch.undo()
    assert errors[0].message in str(refused(project))
