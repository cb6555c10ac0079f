"""Files appear when they are whole."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from thermid.simulation.wholefile import whole


def cut_short(path: Path) -> None:
    with whole(path) as half:
        half.write_text("one line of ma")
        raise KeyboardInterrupt


def test_a_file_that_is_interrupted_leaves_what_was_there(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    for before in (None, "old"):
        if before:
            path.write_text(before)
        with pytest.raises(KeyboardInterrupt):
            cut_short(path)
        assert [p.name for p in tmp_path.iterdir()] == (["run.csv"] if before else [])
        assert not before or path.read_text() == before
    with whole(path) as half:
        assert half.name.endswith("run.csv")
        half.write_text("new")
    assert path.read_text() == "new"
    assert [p.name for p in tmp_path.iterdir()] == ["run.csv"]


def test_an_error_names_the_file_that_was_asked_for(tmp_path: Path) -> None:
    for path in (tmp_path / "no folder" / "run.csv", tmp_path):
        with pytest.raises(OSError, match=path.name) as caught, whole(path) as half:
            half.write_text("x")
        assert caught.value.filename == str(path)


@pytest.mark.skipif(os.name != "posix", reason="links and devices as POSIX has them")
def test_links_are_followed_and_devices_written_to(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(tmp_path / "real.csv")
    with whole(tmp_path / "link") as half:
        half.write_text("x")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "real.csv").read_text() == "x"
    with whole(os.devnull) as place:
        assert place == Path(os.devnull)
