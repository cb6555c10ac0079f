"""Recent files of tests stay out of the home of who runs them; three levels that are run once for all files."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from plain_errors import errors_of_values_alone
from planted import campaign
from thermid.app.studio.project import Project


@pytest.fixture(autouse=True)
def own_state(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path_factory.mktemp("state")
    monkeypatch.setenv("XDG_STATE_HOME", str(folder))
    return folder


@pytest.fixture(scope="session")
def three_levels(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a campaign with all of its stages run: none has anything planted, and each says that it may be used."""
    made = Project(campaign(tmp_path_factory.mktemp("three")))
    with errors_of_values_alone():
        for name in made.stages:
            made.look(name)
            assert made.run(name).usable
    return made.path.parent


@pytest.fixture(scope="module")
def run_before(three_levels: Path, tmp_path_factory: pytest.TempPathFactory) -> Callable[[], Project]:
    """Opens a copy of it, whose stages are taken from its results."""

    def opened() -> Project:
        folder = tmp_path_factory.mktemp("copy") / "p"
        shutil.copytree(three_levels, folder)
        project = Project(folder / "campaign.toml")
        assert [project.look(name).state for name in project.stages] == ["done", "done", "done"]
        return project

    return opened
