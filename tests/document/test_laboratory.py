"""From the files of the document's instruments (SYNTHETIC) to a validated m_Sd: files and commands only, no line of Python by the user."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from document.laboratory_files import SISNAV, written
from scripts_here import script
from thermid.app.cli.app import app

pytestmark = pytest.mark.usefixtures("values_alone")


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Logs of the virtual laboratory, a column each."""
    folder = tmp_path_factory.mktemp("laboratory")
    assert script(SISNAV / "laboratory.py", [str(folder)], folder)[0] == 0
    return folder / "logs"


def command(*arguments: object) -> Result:
    """Run a command of thermid, in this process."""
    return CliRunner().invoke(app, [*map(str, arguments)])


def test_files_of_three_instruments_are_read_joined_and_validated(logs: Path, tmp_path: Path) -> None:
    """The submodel of processor and power supply: capture and spreadsheet of each test."""
    campaign = written(logs, tmp_path / "lab", ("ProcSISNAV", "EleGFO", "m_PrE"))
    seen = json.loads(command("look", *sorted((tmp_path / "lab").glob("pre_both_*")), "--json").stdout)
    assert [log["format"] for log in seen["logs"]] == ["serial capture", "text"]
    assert [(c["record"], c["offset"]) for c in seen["clocks"]] == [("pre_both_potencia", 30.0)]
    assert command("check", campaign).exit_code == 0
    done = command("calibrate", campaign, "--json")
    assert done.exit_code == 0, done.output
    said = json.loads(done.stdout)
    assert [(v["model"], v["passed"], v["unseen"]) for v in said["verdicts"]] == [("m_PrE", True, True)]
    assert [s["mistakes"]["named"] for s in said["stages"]] == [[], [], []]


@pytest.mark.campaign
def test_the_full_model_is_validated_from_files_and_commands(logs: Path, tmp_path: Path) -> None:
    campaign = written(logs, tmp_path / "lab")
    folder = tmp_path / "lab"
    looked = command("look", *(folder / f"sd_all_{k}" for k in ("arduino.txt", "proc.lvm", "potencia.csv")))
    assert "3 clocks of one test" in looked.stdout
    assert re.search(r"sd_all_proc\.lvm \w+ 5 s \w+ sd_all_arduino\.txt", looked.stdout)
    assert command("check", campaign).exit_code == 0
    done = command("calibrate", campaign, "--json")
    said = json.loads(done.stdout)
    # m_IMU misses its hold-out record by 0.9 K here as it does from plain logs: one constant coefficient a surface, fitted where a part
    # warms up and settles, is too large after a pause; the test below has the other law
    assert {v["model"]: v["passed"] for v in said["verdicts"]} == {"m_PrE": True, "m_IMU": False, "m_Sd": True}, done.stdout[:2000]
    assert all(c["found_K"] < 0.45 for v in said["verdicts"] if v["model"] == "m_Sd" for c in v["checks"])
    assert [s["mistakes"]["named"] for s in said["stages"]] == [[]] * 9
    assert all(s["synthetic"] for s in said["stages"])
    page = folder / "page.html"
    assert command("report", campaign, "--to", page).exit_code == 1  # the verdict on m_IMU
    assert page.stat().st_size > 100_000


@pytest.mark.campaign
def test_every_model_is_validated_with_natural_convection(logs: Path, tmp_path: Path) -> None:
    """The same files with the decks of `structures.py`: all three verdicts are met, m_IMU among them."""
    subprocess.run([sys.executable, str(SISNAV / "structures.py"), str(tmp_path / "decks")], check=True, capture_output=True)
    campaign = written(logs, tmp_path / "lab", decks=tmp_path / "decks")
    said = json.loads(command("calibrate", campaign, "--json").stdout)
    assert {v["model"]: v["passed"] for v in said["verdicts"]} == {"m_PrE": True, "m_IMU": True, "m_Sd": True}
    checks = [c for v in said["verdicts"] if v["model"] == "m_IMU" for c in v["checks"] if c["sensor"].startswith("T_")]
    assert len(checks) == 5
    assert all(c["found_K"] < 0.25 for c in checks)
    assert all(s["synthetic"] for s in said["stages"])
