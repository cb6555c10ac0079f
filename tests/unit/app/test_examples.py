"""Copies of shipped examples: whole, runnable, never over anything; originals converted and checked to the last digit."""

from __future__ import annotations

import gzip
import json
import os
import re
from dataclasses import replace
from pathlib import Path
from runpy import run_path

import numpy as np
import pytest
from typer.testing import CliRunner

from by_code import raises_code
from scripts_here import script
from thermid.app import examples
from thermid.app.cli.app import app
from thermid.app.examples import (
    EXAMPLES,
    ShippedExample,
    converted,
    copy_example,
    samples_sum,
)
from thermid.base.errors import MissingDataError, NameNotFoundError, OutputError, RecordError
from thermid.base.files import json_schema
from thermid.campaign._file import CampaignSource
from thermid.campaign._start.project import kind_of

ORIGINALS = {name: run_path(str(examples.shipped() / name / "originals.py")) for name in ("tclab", "motor")}
TCLAB, MOTOR = (o["DATA"] for o in ORIGINALS.values())
thermocouples, controller = (ORIGINALS["motor"][name] for name in ("thermocouples", "controller"))
DAQ = (
    '\ufeff"Device: X"\n"Sample Count: 3"\n"Scan Rate: 4.0"\n"Sample","Time (s)","Winding Temp (°C)","Ambient (°C)","Stator Body (°C)"\n'
    '"0","0:00.0","20.500","21.000","22.250"\n"1","0:00.2","20.5","21.1","22.3"\n"2","0:00.5","20.6","21.2","22.35"\n'
).encode()
ESC = (
    b"Voltage (V),Current (A),Temperature (C),eRPM,Throttle Duty,Motor Duty,Phase Current (A),Power (W),Status 1\n"
    b"71.651657,1.2,23.87,1989,2,2,0,85.98,1\n"
)


def public() -> Path:
    root = os.environ.get("THERMID_PUBLIC")
    if not root or not (Path(root) / TCLAB.repository).is_dir():
        pytest.skip(f"THERMID_PUBLIC has no {TCLAB.repository}")
    return Path(root)


@pytest.mark.parametrize("name", [n for n, e in EXAMPLES.items() if e.data is None])
def test_a_copy_has_every_file_and_a_root(tmp_path: Path, name: str) -> None:
    made = copy_example(name, tmp_path / "mine", logs=False)
    own = made.folder / name if EXAMPLES[name].needs else made.folder
    there = {p.relative_to(own) for p in own.rglob("*") if p.is_file() and "schema" not in p.parts} - {Path("thermid.toml")}
    source = examples.shipped() / name
    assert there == {path for _, path in examples._files(source)}
    assert (made.folder / "thermid.toml").is_file()
    for path in there:
        assert unheaded((own / path).read_bytes()) == (source / path).read_bytes()


def unheaded(data: bytes) -> bytes:
    return re.sub(rb"^#:schema [\w./]+\n", b"", data)


@pytest.mark.parametrize("name", ["04_campaign", "sisnav"])
def test_every_file_of_a_copy_names_the_schema_that_it_follows(tmp_path: Path, name: str) -> None:
    """But files below a lock, which holds their checksums, and what has no grammar of its own."""
    made = copy_example(name, tmp_path / "mine", logs=False)
    kinds = set()
    for file in (f for f in made.folder.rglob("*.toml") if "qualification" not in f.parts):
        first, kind = file.read_text(encoding="utf-8").splitlines()[0], kind_of(file.read_text(encoding="utf-8"))
        if not kind:
            assert file.name in ("thermid.toml", "document.toml")
            assert not first.startswith("#:schema")
            continue
        kinds.add(kind)
        place = (file.parent / first.removeprefix("#:schema ")).resolve()
        assert place == (made.folder / "schema" / f"{kind}.schema.json").resolve()
        assert json.loads(place.read_text(encoding="utf-8")).items() >= json_schema(kind).items()
    assert kinds == {"04_campaign": {"deck", "campaign"}, "sisnav": {"deck", "campaign", "study", "scenario", "hold"}}[name]
    for file in (made.folder / "qualification").rglob("*.toml"):
        assert file.read_bytes() == (examples.shipped() / name / file.relative_to(made.folder)).read_bytes()


def test_a_copy_makes_its_synthetic_logs_or_says_why_not(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "all" / "one").mkdir(parents=True)
    (tmp_path / "all" / "thermid.toml").write_text("")
    script = tmp_path / "all" / "one" / "lab.py"
    script.write_text("import pathlib, sys\npathlib.Path(sys.argv[1], 'made.csv').write_text('time_s,T\\n')\n")
    monkeypatch.setattr(examples, "_PLACES", (tmp_path / "all",))
    monkeypatch.setitem(EXAMPLES, "one", ShippedExample("one", "a test", "thermid look made.csv", makes="lab.py"))
    made = copy_example("one", tmp_path / "copy")
    assert (made.folder / "made.csv").read_text() == "time_s,T\n"
    assert "lab.py" in str(made)
    script.write_text("raise SystemExit('no seed')\n")
    with raises_code("record.log-missing", MissingDataError):
        copy_example("one", tmp_path / "again")
    assert not (tmp_path / "again").exists()


@pytest.mark.campaign
def test_the_study_is_ready_for_its_report(tmp_path: Path) -> None:
    made = copy_example("sisnav", tmp_path / "sisnav")
    assert made.example.first.split()[:3] == ["thermid", "report", "campaign.toml"]
    source = CampaignSource.read(made.folder / "campaign.toml", made.folder)
    assert all(source.record(name).duration > 0 for name in source.names())


def test_the_first_command_of_a_copy_with_siblings_runs(tmp_path: Path) -> None:
    made = copy_example("03_calibrate", tmp_path / "c")
    python, file, *arguments = EXAMPLES["03_calibrate"].first.split()
    code, out, err = script(made.folder / file, arguments, made.folder)
    assert (python, code) == ("python", 0), out + err


def test_nothing_is_copied_over_files(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    with raises_code("output.over-another-file", OutputError):
        copy_example("07_pad", tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["notes.txt"]


def test_a_wrong_name_has_the_nearest() -> None:
    with pytest.raises(NameNotFoundError, match="tclab"):
        copy_example("tcalb")


def test_examples_of_a_wheel_lie_in_the_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "_examples").mkdir()
    (tmp_path / "_examples" / "thermid.toml").write_text("")
    monkeypatch.setattr(examples, "_PLACES", (tmp_path / "_examples", tmp_path / "none"))
    assert examples.shipped() == tmp_path / "_examples"
    monkeypatch.setattr(examples, "_PLACES", (tmp_path / "none",))
    with raises_code("record.log-missing", MissingDataError):
        examples.shipped()
    text = (Path(__file__).parents[3] / "CMakeLists.txt").read_text(encoding="utf-8")
    assert re.search(r"install\(DIRECTORY\s+examples/\s+DESTINATION\s+thermid/_examples", text)


def test_thermocouples_have_the_times_of_their_scan_rate() -> None:
    assert thermocouples(DAQ, "x.csv").splitlines() == [
        "Time_s,Winding_Temp_C,Ambient_C,Stator_Body_C",
        "0,20.5,21,22.25",
        "0.25,20.5,21.1,22.3",
        "0.5,20.6,21.2,22.35",
    ]
    with raises_code("record.layout-unclear", RecordError, match="'Sample'.*'Scan Rate'"):
        thermocouples(DAQ.replace(b"Scan Rate", b"Rate"), "x.csv")


def test_a_controller_has_its_columns_by_name() -> None:
    assert controller(ESC, "x.csv").splitlines()[1] == "71.6517,1.2,23.87,1989,2,2,0,85.98"
    with raises_code("record.layout-unclear", RecordError):
        controller(ESC.replace(b"Power (W)", b"P"), "x.csv")


def test_samples_that_differ_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_bytes(DAQ)
    known = samples_sum(thermocouples(DAQ, "a.csv"))
    source = replace(MOTOR, files=(replace(MOTOR.files[0], path="a.csv", sha256=known),))
    assert converted(source, source.files[0], tmp_path)
    (tmp_path / "a.csv").write_bytes(DAQ.replace(b"22.35", b"22.36"))
    with raises_code("record.another-log", RecordError, match="e94b107"):
        converted(source, source.files[0], tmp_path)


def test_a_folder_without_the_originals_says_how_to_get_them(tmp_path: Path) -> None:
    with raises_code("record.log-missing", MissingDataError):
        copy_example("tclab", tmp_path / "t", tmp_path)
    assert not (tmp_path / "t").exists()


def test_the_list_of_examples_shows_licences() -> None:
    found = CliRunner().invoke(app, ["example", "--json"])
    rows = {r["name"]: r for r in json.loads(found.stdout)["examples"]}
    assert set(rows) == set(EXAMPLES)
    assert "MIT licence" in rows["tclab"]["data"]


def test_the_motor_from_its_originals(tmp_path: Path) -> None:
    made = copy_example("motor", tmp_path / "m", public())
    assert (made.logs, made.checked) == (6, 6)
    assert "TasS-RV" in (made.folder / "LICENSE.data").read_text()


def test_tclab_from_its_originals_is_what_the_example_was_made_with(tmp_path: Path) -> None:
    """All 52 runs: the campaign knows the sums of their samples."""
    made = copy_example("tclab", tmp_path / "t", public())
    assert (made.logs, made.checked) == (52, 52)
    text = gzip.decompress((made.folder / "random_H1H2" / "ens_IdentificationH1H2_Random_01.csv.gz").read_bytes()).decode()
    assert np.genfromtxt(text.splitlines(), delimiter=",", names=True)["T1_C"].size == 30803
