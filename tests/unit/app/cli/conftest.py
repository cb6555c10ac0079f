"""The command line in this process: arguments in, exit code, standard output and standard error out."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from python_board import simulated

from plain_errors import errors_in_full
from thermid.app.cli import app
from thermid.bench.logger import Logger
from thermid.campaign.stages import run_stages
from unit.fit.project import make_project

EXAMPLES = Path(__file__).parents[4] / "examples"


@dataclass(frozen=True)
class Said:
    """What a command said; `codes` are those of its error and warnings, in order."""

    code: int
    out: str
    err: str
    codes: tuple[str, ...] = ()

    @property
    def object(self) -> dict[str, Any]:
        """The one JSON object on standard output; NaN and Infinity, which are no JSON, are refused."""

        def never(word: str) -> float:
            raise AssertionError(f"{word} is no JSON")

        found = json.loads(self.out, parse_constant=never)
        assert isinstance(found, dict)
        return found


Call = Callable[..., Said]


@pytest.fixture
def call(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Call:
    """``call("simulate", deck, "--json")``; nothing is told of progress, however slow the machine is."""
    monkeypatch.delenv("THERMID_DATA", raising=False)
    monkeypatch.setattr("thermid.app.cli.screen.SECONDS_TO_FIRST_PROGRESS", float("inf"))
    codes: list[str] = []
    shown = app._code_shown
    monkeypatch.setattr(app, "_code_shown", lambda code: codes.append(code) or shown(code))

    def run(*arguments: object) -> Said:
        monkeypatch.setattr(sys, "argv", ["thermid", *map(str, arguments)])
        capsys.readouterr()
        codes.clear()
        with pytest.raises(SystemExit) as caught:
            app.main()
        done = capsys.readouterr()
        code = caught.value.code
        return Said(0 if code is None else int(code), done.out, done.err, tuple(codes))

    return run


@pytest.fixture
def board(monkeypatch: pytest.MonkeyPatch) -> None:
    """``thermid log`` finds a board made of Python with three sensors; time is the board's, sixty times as fast as real time."""

    def logger(file: Path, _: object, *more: Any, **options: Any) -> Logger:
        port = simulated()
        return Logger(file, lambda: port, *more, clock=port.clock, wall=port.wall, **options)

    pytest.importorskip("serial", reason="pyserial is not installed: thermid[log]")
    monkeypatch.setattr("thermid.app.cli.bench.find_port", lambda: "a board of Python")
    monkeypatch.setattr("thermid.app.cli.bench.check_port", lambda name: None)
    monkeypatch.setattr("thermid.app.cli.bench.Logger", logger)


@pytest.fixture(scope="session")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A project that no test writes to."""
    return make_project(tmp_path_factory.mktemp("made"))


@pytest.fixture
def campaign(made: Path, tmp_path: Path) -> Path:
    """A copy of it to be changed."""
    shutil.copytree(made.parent, tmp_path / "p")
    return tmp_path / "p" / "campaign.toml"


@pytest.fixture(scope="session")
def made_and_fitted(made: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same with its results; no test writes to it."""
    folder = tmp_path_factory.mktemp("fitted") / "p"
    shutil.copytree(made.parent, folder)
    with errors_in_full():  # whichever module asks first
        run_stages(folder / made.name, cache=folder / "results").save(tmp_path_factory.mktemp("values"))  # keeps every model of error
    return folder / made.name


@pytest.fixture
def fitted_campaign(made_and_fitted: Path, tmp_path: Path) -> Path:
    """A copy of it to be changed, for what follows a fit: a command takes its stages as they were."""
    shutil.copytree(made_and_fitted.parent, tmp_path / "p")
    return tmp_path / "p" / "campaign.toml"


@pytest.fixture
def accelerometer() -> Path:
    """The deck of the first lesson."""
    return EXAMPLES / "01_accelerometer" / "accelerometer.toml"


@pytest.fixture
def stack() -> Path:
    """The deck of the second lesson."""
    return EXAMPLES / "02_stack" / "m_PrE.toml"
