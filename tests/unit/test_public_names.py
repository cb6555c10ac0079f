"""Public names: few at the top, the others by activity, each once in a table; an unknown one names the nearest; stubs follow."""

from __future__ import annotations

import re
import runpy
import subprocess
import sys
import warnings
from importlib.util import find_spec
from pathlib import Path

import pytest

import thermid as td

ROOT = Path(__file__).parents[2]


def test_the_stubs_are_those_of_the_tables() -> None:
    for path, text in runpy.run_path(str(ROOT / "scripts" / "write_stub.py"))["stubs"]().items():
        assert path.read_text(encoding="utf-8") == text, "run: python scripts/write_stub.py"


def test_the_top_is_small() -> None:
    assert len(dir(td)) <= 47
    assert set(dir(td)) == {*td.__all__, "__version__"}
    for name in td.__all__:
        assert getattr(td, name) is getattr(td, name)


def test_a_name_stands_in_one_place() -> None:
    names = [*td._TOP, *(name for names in td._NAMESPACES.values() for name in names)]
    assert len(names) == len(set(names))


@pytest.mark.parametrize("space", td._NAMESPACES)
def test_a_namespace_serves_its_names(space: str) -> None:
    room = getattr(td, space)
    assert dir(room) == sorted(td._NAMESPACES[space])
    for name, module in td._NAMESPACES[space].items():
        assert getattr(room, name).__module__.startswith(f"thermid.{module.partition('.')[0]}")
    with pytest.raises(AttributeError, match=rf"'thermid\.{space}' .*'nothing'"):
        room.nothing  # noqa: B018


def test_a_function_stays_one_whatever_is_imported_before() -> None:
    code = (
        "import thermid.prediction.advice, thermid.site.moisture, thermid.inference._identifiability\nimport thermid as td\n"
        "import thermid.qualify._deliver, thermid.inference._explain.plausibility, thermid.interop.equations\n"
        "for f in (td.design.next_test, td.site.moisture, td.inference.profile, td.qualify.deliver, td.inference.plausibility):\n"
        "    assert callable(f), f\n"
        "from thermid.inference import profile\nassert callable(profile)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_an_unknown_name_is_refused() -> None:
    with pytest.raises(AttributeError, match=r"'thermid' .*'calibrat'\. .*'thermid\.calibrate'"):
        td.calibrat  # noqa: B018
    with pytest.raises(AttributeError, match=r"Did you mean 'thermid\.simulation\.compile_network'"):
        td.compile_network  # noqa: B018
    with pytest.raises(AttributeError, match=r"Did you mean 'thermid\.inference\.criticise'"):
        td.simulation.criticise  # noqa: B018


def test_new_names_warn_of_nothing() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for space, names in td._NAMESPACES.items():
            for name in names:
                getattr(getattr(td, space), name)


def test_the_page_of_renames_is_that_of_the_table() -> None:
    """Every module that it names as the new one is there."""
    page = (ROOT / "docs" / "renames.md").read_text(encoding="utf-8")
    assert page == runpy.run_path(str(ROOT / "scripts" / "move_rooms.py"))["renames"](), "run: python scripts/move_rooms.py --page"
    assert [new for new in re.findall(r"\| `(thermid\.[\w.]+)` \|$", page, re.MULTILINE) if find_spec(new) is None] == []
