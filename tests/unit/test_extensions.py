"""Optional parts stand behind extension points: each is there, and without its part is refused in words."""

from __future__ import annotations

import sys

import pytest

import thermid as td
from thermid.extensions import POINTS, extension


class Without:
    """Finder of modules, before all others, to which a package is not there."""

    def __init__(self, part: str) -> None:
        self.part = part

    def find_spec(self, name: str, path: object = None, target: object = None) -> None:
        if name == self.part:
            raise ModuleNotFoundError(f"No module named '{name}'", name=name)


@pytest.mark.parametrize("point", POINTS)
def test_a_function_stands_behind_every_point(point: str) -> None:
    assert callable(extension(point, ""))


@pytest.mark.parametrize("point", POINTS)
def test_without_its_part_a_point_is_refused(point: str, monkeypatch: pytest.MonkeyPatch) -> None:
    part, module, _ = POINTS[point]
    for name in [n for n in sys.modules if n == part or n.startswith(f"{part}.")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setattr(sys, "meta_path", [Without(part), *sys.meta_path])
    with pytest.raises(td.ThermidError, match=rf"deck\.toml: {point} needs the package {part}, which is not installed\."):
        extension(point, "deck.toml")
    assert f"{part}.{module}" not in sys.modules
