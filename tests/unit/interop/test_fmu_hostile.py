"""Hostile FMUs: the session lives, and the error names the file and the call into it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import thermid as td
from by_code import raises_code
from thermid.app.cli.app import app
from thermid.base.errors import ThermidError
from thermid.interop._fmu.as_model import fmu_model
from unit.interop.hostile import EVERY, LATE, Hostile, hostile_fmu

pytest.importorskip("fmpy", reason="FMPy is not installed (pip install 'thermid[fmu]')")

SAMPLE = {
    "wild in fmi2DoStep",
    "hang in fmi2DoStep",
    "exit0 in fmi2DoStep",
    "eat in fmi2Instantiate",
    "nan in fmi2DoStep",
    "another platform",
    "reference of a state",
    "writes to every pipe",
    "climbs",
}
"""One of every kind but signals, which are crashes."""


@pytest.fixture(autouse=True)
def _limits(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path_factory.mktemp("state")))
    monkeypatch.setenv("THERMID_CAPS", "call=30 memory=1e9")  # on a busy machine a call, and the start of a process, may well take seconds


def run(path: Path) -> td.Solution:
    """Run an FMU over 10 s."""
    return td.simulate(fmu_model(path, trust=True), td.Scenario("x", start="30 [degC]", duration="10 [s]"), times=np.arange(11.0))


def test_there_are_forty_of_ten_kinds() -> None:
    assert len({(of.kind, of.name) for of in EVERY}) == 40
    assert len({of.kind for of in EVERY}) == 10


@pytest.mark.parametrize("exchange", [False, True])
def test_the_same_library_without_a_fault_runs(exchange: bool, tmp_path: Path) -> None:
    found = run(hostile_fmu(Hostile("", "", (), exchange=exchange), tmp_path / "theirs.fmu"))
    assert found["x"].celsius == pytest.approx(20.0 + 10.0 * np.exp(-0.1 * np.arange(11.0)), abs=1e-5)


@pytest.mark.parametrize(
    "of", [pytest.param(of, id=f"{of.kind}: {of.name}", marks=[] if of.name in SAMPLE else pytest.mark.campaign) for of in EVERY]
)
def test_hostile_fmus_end_the_call_and_not_the_session(of: Hostile, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if LATE in of.words:
        monkeypatch.setenv("THERMID_CAPS", "call=4 memory=1e9")
    path = hostile_fmu(of, tmp_path / "theirs.fmu")
    with pytest.raises(ThermidError) as refused:
        run(path)
    said = str(refused.value)
    assert "theirs.fmu" in said
    assert [word for word in of.words if word not in said] == []
    assert said.isprintable()


def test_it_is_asked_once_for_each_file(tmp_path: Path) -> None:
    path = hostile_fmu(Hostile("", "", ()), tmp_path / "theirs.fmu")
    with raises_code("fmu.not-trusted"):
        fmu_model(path)
    fmu_model(path, trust=True)
    fmu_model(path)
    with raises_code("fmu.not-trusted"):
        fmu_model(hostile_fmu(Hostile("", "", (), "another"), path))


def test_commands_ask_once_too(tmp_path: Path) -> None:
    hostile_fmu(Hostile("", "", ()), tmp_path / "theirs.fmu")
    (tmp_path / "run.csv").write_text("time [s],x [degC]\n" + "".join(f"{t},{20.0 + 10.0 * np.exp(-0.1 * t):.6f}\n" for t in range(30)))
    (tmp_path / "campaign.toml").write_text(
        'title = "x"\n[records.run]\nfile = "run.csv"\nchannels.x = { node = "x", noise = "0.1 [K]" }\n'
        '[[stages]]\nname = "box"\nmodel = "theirs.fmu"\nrecords = ["run"]\nfree = ["k"]\n'
    )
    command = ["check", str(tmp_path / "campaign.toml")]
    assert [CliRunner().invoke(app, [*command, *more]).exit_code for more in ([], ["--trust"], [])] == [1, 0, 0]


def test_a_file_that_changed_since_it_was_trusted_is_not_run(tmp_path: Path) -> None:
    model = fmu_model(hostile_fmu(Hostile("", "", ()), tmp_path / "theirs.fmu"), trust=True)
    hostile_fmu(Hostile("", "", (), "another"), tmp_path / "theirs.fmu")
    with raises_code("fmu.changed"):
        td.simulate(model, td.Scenario("x", start="30 [degC]", duration="10 [s]"))
