"""Public names: few at the top, the others by activity, each once in a table; old ones work until 0.3.0; stubs follow."""

from __future__ import annotations

import runpy
import subprocess
import sys
import warnings
from importlib.metadata import version
from pathlib import Path

import pytest

import thermid as td
from thermid import renamed

ROOT = Path(__file__).parents[2]
FILES = [
    path for folder in ("src", "tests", "examples", "docs") for path in (ROOT / folder).rglob("*") if path.suffix in (".py", ".md", ".in")
]


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
    with pytest.raises(AttributeError, match=f"module 'thermid.{space}' has no attribute 'nothing'"):
        room.nothing  # noqa: B018


def test_a_function_stays_one_whatever_is_imported_before() -> None:
    code = (
        "import thermid.design.next_test, thermid.site.moisture, thermid.inference.profile\nimport thermid as td\n"
        "import thermid.qualify.deliver, thermid.explain.plausibility, thermid.interop.equations\n"
        "for f in (td.design.next_test, td.site.moisture, td.inference.profile, td.qualify.deliver, td.explain.plausibility):\n"
        "    assert callable(f), f\n"
        "from thermid.inference import profile\nassert callable(profile)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("old", renamed.TOP_LEVEL)
def test_an_old_name_is_served_with_the_new_one(old: str) -> None:
    new = renamed.TOP_LEVEL[old]
    space, _, name = new.partition(".")
    with pytest.warns(
        DeprecationWarning, match=rf"'thermid\.{old}' is called 'thermid\.{new}' now; the old name goes with thermid 0\.3\.0"
    ) as caught:
        found = getattr(td, old)
    assert found is getattr(getattr(td, space), name)
    assert caught[0].filename == __file__


def test_old_names_are_gone_with_the_version_that_was_announced() -> None:
    now, end = (tuple(int(n) for n in text.split(".")[:2]) for text in (version("thermid"), renamed.REMOVED))
    assert now < end or not (renamed.TOP_LEVEL or renamed.RENAMED), "remove the old names: this version was announced to serve none"


def test_an_unknown_name_is_refused() -> None:
    with pytest.raises(AttributeError, match="module 'thermid' has no attribute 'calibrat'"):
        td.calibrat  # noqa: B018


def test_new_names_warn_of_nothing() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for space, names in td._NAMESPACES.items():
            for name in names:
                getattr(getattr(td, space), name)


def test_nothing_here_uses_an_old_name() -> None:
    import re

    old = re.compile(r"\btd\.(" + "|".join(renamed.TOP_LEVEL) + r")\b")
    kept = {Path(__file__), ROOT / "src" / "thermid" / "renamed.py"}
    used = {
        str(f.relative_to(ROOT))
        for f in FILES
        if f not in kept and "decisions" not in f.parts and old.search(f.read_text(encoding="utf-8"))
    }
    assert used == set()
