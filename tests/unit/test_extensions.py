"""Optional rooms announce what they add: each is there, without its room it is refused in words; another's package can add its own."""

from __future__ import annotations

import sys
from importlib import import_module, metadata

import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import announced, extension
from thermid.base.files import file_kinds, grammar_of

PARTS = dict(announced("thermid.parts"))


class Without:
    """Finder of modules, before all others, to which a package is not there."""

    def __init__(self, part: str) -> None:
        self.part = part

    def find_spec(self, name: str, path: object = None, target: object = None) -> None:
        if name == self.part:
            raise ModuleNotFoundError(f"No module named '{name}'", name=name)


def test_every_optional_room_but_the_studio_adds_something_and_campaigns_their_check() -> None:
    assert {place.split(".")[1] for place in PARTS.values()} == {"bench", "campaign", "interop", "site"}


@pytest.mark.parametrize("point", PARTS)
def test_a_function_is_behind_every_point(point: str) -> None:
    assert callable(extension(point, "it", ""))


@pytest.mark.parametrize("point", PARTS)
def test_without_its_room_a_point_is_refused(point: str, monkeypatch: pytest.MonkeyPatch) -> None:
    module = PARTS[point].partition(":")[0]
    part = ".".join(module.split(".")[:2])
    for name in [n for n in sys.modules if n == part or n.startswith(f"{part}.")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setattr(sys, "meta_path", [Without(part), *sys.meta_path])
    with raises_code("extra.not-installed", td.ThermidError, match=f"{part}"):
        extension(point, "the thing", "deck.toml")
    assert module not in sys.modules


def test_a_point_that_nothing_announces_is_refused() -> None:
    with raises_code("extra.not-installed"):
        extension("nothing", "the thing", "")


def test_a_package_of_others_adds_a_kind_of_file(monkeypatch: pytest.MonkeyPatch) -> None:
    own = metadata.EntryPoint("wardrobe", "thermid.model._deck.schema:Deck", "thermid.files")
    kept = metadata.entry_points(group="thermid.files")
    announced.cache_clear()
    monkeypatch.setattr(metadata, "entry_points", lambda group: [*kept, own] if group == "thermid.files" else [])
    try:
        assert "wardrobe" in file_kinds()
        assert grammar_of("wardrobe") is import_module("thermid.model._deck.schema").Deck
        with raises_code("name.unknown", match="'wardrob'.*'wardrobe'"):
            grammar_of("wardrob")
    finally:
        announced.cache_clear()
