"""Notebooks of the site run as they stand, say and draw something, and hold no output."""

from __future__ import annotations

import json
import time
from pathlib import Path

import pytest

from .hooks import notebooks

pytest.importorskip("matplotlib", reason="matplotlib is not installed (extra report)")


@pytest.mark.parametrize("path", notebooks.notebooks().values(), ids=notebooks.notebooks())
def test_a_notebook_runs_within_ten_seconds_and_shows_pictures(path: Path) -> None:
    begun = time.process_time()
    cells = notebooks.executed(path)
    assert time.process_time() - begun < 10.0
    assert any(c.said for c in cells)
    text, pictures = notebooks.page(path.stem, cells)
    assert len(pictures) >= 1
    for name, picture in pictures.items():
        assert f"]({name})" in text
        assert picture.startswith("<svg")


def test_a_cell_prints_its_last_value_unless_a_semicolon_ends_it(tmp_path: Path) -> None:
    def cell(text: str, **more: object) -> dict[str, object]:
        return {"cell_type": "code", "source": [text], "outputs": [], **more}

    path = tmp_path / "one.ipynb"
    path.write_text(json.dumps({"cells": [cell("a = 2\na + 1"), cell("a;")]}), encoding="utf-8")
    assert [c.said for c in notebooks.executed(path)] == ["3\n", ""]
    path.write_text(json.dumps({"cells": [cell("1", outputs=[{"text": "1"}])]}), encoding="utf-8")
    with pytest.raises(ValueError, match="without output"):
        notebooks.executed(path)
