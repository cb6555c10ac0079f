"""The example on real measurements reaches what it claims, refuses other data, and says how to get them where they are absent."""

from __future__ import annotations

import csv
import gzip
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from statistics import median
from typing import Any

import pytest

import thermid as td
from thermid.campaign.stages import CampaignSource

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "examples" / "tclab"
SHARED = ROOT.parent / "shared" / "data"
SAO_PAULO, DESIGNER = SHARED / "tclabsp", SHARED / "tclab_apmonitor_arduino"

sao_paulo = pytest.mark.skipif(not SAO_PAULO.is_dir(), reason="the logs of the Sao Paulo board are not in ../shared/data/tclabsp")
designer = pytest.mark.skipif(
    not DESIGNER.is_dir(), reason="the logs of the designer's board are not in ../shared/data/tclab_apmonitor_arduino"
)

STEPS = ("ensH1_", "ensH2_")
BOTH = ("ens_IdentificationH1H2_",)
# name of a value -> what textbooks and data sheets allow, SI; examples/tclab/README.md says where the figures come from
PHYSICAL = {
    "h1.alpha": (0.4, 2.0),
    "h2.alpha": (0.4, 2.0),
    "h1.tau": (5.0, 40.0),
    "h1.to_board": (0.002, 0.06),
    "h2.to_board": (0.002, 0.06),
    "h2.body.specific_heat": (380.0, 1000.0),
    "between": (0.001, 0.01),
    "to_room": (0.005, 0.2),
    "pcb.capacitance": (8.0, 40.0),
}


@dataclass(frozen=True)
class Run:
    """A finished command."""

    code: int
    said: Any
    errors: str
    folder: Path


def command(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    environment = {k: v for k, v in os.environ.items() if k != "THERMID_DATA"} | {"OMP_NUM_THREADS": "1"}
    return subprocess.run([sys.executable, *map(str, arguments)], capture_output=True, text=True, env=environment, check=False)


def calibrate(campaign: str, to: Path, *more: str | Path) -> Run:
    done = command("-m", "thermid", "calibrate", EXAMPLE / campaign, "--to", to, "--json", *more)
    return Run(done.returncode, json.loads(done.stdout), done.stderr, to)


@pytest.fixture(scope="module")
def real(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """The whole campaign on the real runs, once."""
    return calibrate("campaign.toml", tmp_path_factory.mktemp("tclab"), "--data", SAO_PAULO)


def stage(run: Run, name: str) -> dict[str, Any]:
    return next(s for s in run.said["stages"] if s["stage"] == name)


def in_sample(run: Run, starts: Sequence[str], sensor: str) -> float:
    """Median over runs of the RMSE with the one set for all. [K]"""
    records = stage(run, "one set for all")["records"]
    return median(s[sensor]["rmse_K"] for name, s in records.items() if name.startswith(tuple(starts)))


def verdicts(run: Run, title: str) -> list[dict[str, Any]]:
    return [v for v in run.said["verdicts"] if v["title"] == title]


@sao_paulo
def test_one_heater_of_two_runs_predicts_another_regime(tmp_path: Path) -> None:
    """A sample of the campaign: its first stage on one step and one random run, judged on a run at rest at 50 %."""
    head, _, rest = (EXAMPLE / "campaign.toml").read_text(encoding="utf-8").partition("# ---- component 2")
    records = 'records  = ["ensH1_*", "ens_IdentificationH1_Random_0?"]'
    assert records in head
    head = head.replace(records, 'records  = ["ensH1_000_050_en1", "ens_IdentificationH1_Random_01"]')
    head = re.sub(r"(?m)^accept = .*\n", "", head)
    verdict = 'name = "another regime"\nmodel = "heater 1"\nrecord = "ens_IdentificacaoH1_0to50_01"\ncriteria = { rmse = "1 [K]" }\n'
    local = 'local = { room = { start = "T1_C", sd = "0.5 [K]" } }\n'
    for deck in ("board.toml", "heater.toml"):
        shutil.copy(EXAMPLE / deck, tmp_path)
    file = tmp_path / "sample.toml"
    file.write_text(f"{head}[[verdicts]]\n{verdict}{local}\n[checksums]{rest.partition('[checksums]')[2]}", encoding="utf-8")
    campaign = td.run_stages(file, data=SAO_PAULO)
    fit = campaign["heater 1"]
    # two runs decide what the heater and its sensor are; of the board they say less, and the fit says how much less
    known = {name: v for name, v in fit.values.parameters.items() if v.shown(v.error) < 0.3 * abs(v.in_unit)}
    assert {"h1.alpha", "h1.tau"} <= set(known)
    for name, value in fit.values.parameters.items():
        low, high = PHYSICAL[name]
        room = 0.0 if name in known else 2.0 * value.error
        assert low - room <= value.value <= high + room, f"{name} = {value.value}"
    assert len(fit.values.parameters) == 6
    assert fit.statistics["ens_IdentificationH1_Random_01"]["T1_C"].rmse < 1.0  # the verdict's limit; 0.75 K are stated as noise
    (judged,) = campaign.verdicts
    assert judged.passed
    assert next(b for b in judged.prediction.blocks if b.sensor == "T1_C").times.size > 400


@pytest.mark.campaign
@sao_paulo
class TestTheWholeCampaign:
    def test_the_campaign_ends_well(self, real: Run) -> None:
        assert real.code == 0, real.said
        assert real.said["status"] == "ok"
        assert real.said["passed"]
        assert len(verdicts(real, "room fitted")) == len(verdicts(real, "room from first readings")) == 2
        assert len(verdicts(real, "another regime")) == 2

    def test_one_set_for_all_is_one_set_for_all(self, real: Run) -> None:
        one = stage(real, "one set for all")
        assert one["free"] == []
        assert len(one["records"]) == 48
        assert sum(name.startswith(STEPS) for name in one["records"]) == 40

    @pytest.mark.parametrize(
        ("starts", "sensor", "limit"), [(STEPS, "T1_C", 0.45), (STEPS, "T2_C", 0.45), (BOTH, "T1_C", 0.45), (BOTH, "T2_C", 0.55)]
    )
    def test_runs_that_were_fitted(self, real: Run, starts: Sequence[str], sensor: str, limit: float) -> None:
        assert 0.1 < in_sample(real, starts, sensor) <= limit

    @pytest.mark.parametrize(
        ("title", "sensor", "limit"),
        [
            ("room fitted", "T1_C", 0.45),
            ("room fitted", "T2_C", 0.55),
            ("room from first readings", "T1_C", 0.55),
            ("room from first readings", "T2_C", 0.60),
        ],
    )
    def test_runs_that_no_fit_has_seen(self, real: Run, title: str, sensor: str, limit: float) -> None:
        judged = verdicts(real, title)
        assert {v["record"] for v in judged} == {"ens_IdentificationH1H2_Random_03", "ens_IdentificationH1H2_Random_04"}
        assert median(v["sensors"][sensor]["rmse_K"] for v in judged) <= limit
        assert all(v["sensors"][sensor]["n"] > 1500 for v in judged)

    def test_only_the_room_was_fitted_to_unseen_runs(self, real: Run) -> None:
        assert all(v["fitted_locally"] == ["room"] and v["conditional"] for v in verdicts(real, "room fitted"))
        assert all(v["fitted_locally"] == [] and not v["conditional"] for v in verdicts(real, "room from first readings"))

    def test_no_value_ends_at_a_bound_or_outside_what_is_physical(self, real: Run) -> None:
        seen = set()
        for path in real.folder.glob("*.values.toml"):
            for name, value in td.load_values(path).parameters.items():
                seen.add(name)
                assert not any(isfinite(b) and abs(value.value - b) <= 0.01 * abs(b) for b in value.bounds), f"{name} ends at a bound"
                low, high = PHYSICAL.get(name, (-5.0, 5.0))
                assert low <= value.value <= high, f"{name} = {value.value}"
        assert seen == {*PHYSICAL, "first_reading"}
        assert not any("ended at its" in w for s in real.said["stages"] for w in s["warnings"])


@sao_paulo
class TestSamples:
    def test_every_run_is_known_by_its_samples(self) -> None:
        source = CampaignSource.read(EXAMPLE / "campaign.toml", SAO_PAULO)
        assert set(source.content.checksums) == set(source.names())
        assert all(len(sum_) >= 16 for sum_ in source.content.checksums.values())

    def test_a_changed_sample_is_refused(self, tmp_path: Path) -> None:
        data = tmp_path / "data"
        shutil.copytree(SAO_PAULO, data, copy_function=shutil.copyfile)
        log = data / "step" / "ensH1_000_050_en1.csv.gz"
        with gzip.open(log, "rt", encoding="utf-8") as file:
            rows = list(csv.reader(file))
        rows[2000][3] = f"{float(rows[2000][3]) + 0.01:.2f}"
        log.parent.chmod(0o755)
        log.unlink()
        with gzip.open(log, "wt", encoding="utf-8", newline="") as file:
            csv.writer(file).writerows(rows)
        with pytest.raises(td.ThermidError, match="checksum") as refused:
            td.run_stages(EXAMPLE / "campaign.toml", data=data)
        assert refused.value.exit_code == 2
        assert "ensH1_000_050_en1" in refused.value.where


def test_without_data_it_says_how_to_get_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("THERMID_DATA", raising=False)
    (tmp_path / "empty").mkdir()
    for data in (None, tmp_path / "empty"):
        with pytest.raises(td.ThermidError) as absent:
            td.run_stages(EXAMPLE / "campaign.toml", data=data)
        assert absent.value.exit_code == 2
        for word in ("https://github.com/TiagoPrata/TCLabSP", "time_s,Q1_pct,Q2_pct,T1_C,T2_C", "README.md", "--data", "THERMID_DATA"):
            assert word in absent.value.message
    with pytest.raises(td.ThermidError, match=r"'nowhere' .* --data .* THERMID_DATA\."):
        td.run_stages(EXAMPLE / "campaign.toml", data=tmp_path / "nowhere")


@pytest.mark.campaign
@designer
def test_the_same_decks_on_another_board_are_judged_and_fail(tmp_path: Path) -> None:
    run = calibrate("campaign_apmonitor.toml", tmp_path, "--data", DESIGNER)
    assert run.code == 1
    assert not run.said["passed"]
    fitted = stage(run, "another board")
    assert len(fitted["free"]) == 9
    assert not any("ended at its" in w or "is derived from other values:" in w for w in fitted["warnings"])
    assert fitted["values"]["h2.alpha"] < fitted["values"]["h1.alpha"]
    by_title = {v["title"]: v for v in run.said["verdicts"]}
    assert not by_title["room fitted"]["passed"]
    # worse than the limit, yet the right order: a board never seen before, predicted within a tenth of its rise of 30 K
    assert all(0.2 < v["sensors"][s]["rmse_K"] < 1.2 for v in by_title.values() for s in ("T1_C", "T2_C"))


def readme_table() -> dict[str, list[str]]:
    """Structure -> cells, of the table that README.md took from structures.py."""
    lines = (EXAMPLE / "README.md").read_text(encoding="utf-8").splitlines()
    begin = next(k for k, line in enumerate(lines) if line.startswith("| structure |"))
    rows = {}
    for line in lines[begin + 2 :]:
        if not line.startswith("|"):
            break
        name, *cells = (c.strip() for c in line.strip("|").split("|"))
        rows[name] = cells
    return rows


@pytest.mark.campaign
@sao_paulo
def test_structures_are_ranked_as_the_readme_says() -> None:
    done = command(EXAMPLE / "structures.py", "--data", SAO_PAULO, "--json")
    assert done.returncode == 0, done.stderr
    rows = {r["name"]: r for r in json.loads(done.stdout)["structures"]}
    printed = readme_table()
    assert set(printed) == set(rows)
    for name, row in rows.items():
        if "refused" in row:
            assert "refused" in printed[name]
            continue
        cells = [float(x) for cell in printed[name][4:10] for x in re.findall(r"\d+\.\d+", cell)]
        kinds = ("steps", "random_H1", "random_H2", "random_H1H2", "unseen_fitted_K", "unseen_first_K")
        assert cells == pytest.approx([x for kind in kinds for x in row[kind]], abs=0.011), name
        assert float(printed[name][1]) == pytest.approx(row["deviance"], rel=0.002), name
    plainer = ("plain", "lag", "radiation", "beta", "linear board")
    board = rows["board"]
    for name in plainer:
        assert board["aic"] < rows[name]["aic"]
        assert board["qaic"] < rows[name]["qaic"]
        assert sum(board["unseen_fitted_K"]) < sum(rows[name]["unseen_fitted_K"])
    assert board["implausible"] == []


@pytest.mark.campaign
@sao_paulo
def test_the_parts_alone_predict_the_pair_as_the_readme_says() -> None:
    """Two figures of the three that were asked are missed; the page says by how much, and this holds it to that."""
    done = command(EXAMPLE / "structures.py", "--data", SAO_PAULO, "--from-parts", "--json", "--only", "board", "board, curve")
    assert done.returncode == 0, done.stderr
    rows = {r["name"]: r for r in json.loads(done.stdout)["structures"]}
    lines = (EXAMPLE / "README.md").read_text(encoding="utf-8").partition("## From the parts alone")[2].splitlines()
    for name, row in rows.items():
        line = next(text for text in lines if text.startswith(f"| {name} |"))
        cells = [float(x) for cell in line.strip("|").split("|")[5:10] for x in re.findall(r"\d+\.\d+", cell)]
        kinds = ("steps", "random_H1", "random_H2", "unseen_fitted_K", "unseen_first_K")
        assert cells == pytest.approx([x for kind in kinds for x in row[kind]], abs=0.011), name
    assert max(rows["board"]["steps"]) < 0.42
    assert rows["board, curve"]["unseen_fitted_K"] == pytest.approx([0.45, 0.55], abs=0.01)
