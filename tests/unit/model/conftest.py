"""Small decks that the tests of this folder change in one place."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest

from thermid.model._deck.modelfile import _built, load_model, model_from_dict
from thermid.model._tree.model import Model

PART: dict[str, Any] = {
    "title": "Box",
    "needs": ["air"],
    "offers": ["case", "skin"],
    "parameters": {"power": {"value": "4 [W]", "min": 1, "max": 8}, "area": "0.05 [m^2]"},
    "nodes": {"case": {"mass": "1.5 [kg]", "specific_heat": "900 [J/(kg K)]"}},
    "surfaces": {"skin": {"of": "case", "to": "air", "area": "area", "htc": "5 [W/(m^2 K)]"}},
    "loads": {"heat": {"into": "case", "power": "power"}},
}


def _changed(base: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return a deck with values at ``table/name/field`` changed, made, or dropped where the value is None."""
    out = copy.deepcopy(dict(base))
    for path, value in changes.items():
        *steps, last = path.split("/")
        here = out
        for step in steps:
            here = here.setdefault(step, {})
        if value is None:
            del here[last]
        else:
            here[last] = value
    return out


@pytest.fixture
def part() -> Callable[..., Model]:
    """A box that convects; ``part({"loads/heat/power": "2 [W]"})``. What physics forbids is left to what a test asks."""
    return lambda changes=None, **more: _built(_changed(PART, changes or {}) | more, "", {}, None, None)


@pytest.fixture
def pair(part: Callable[..., Model]) -> Callable[..., Model]:
    """Two boxes `a` and `b` in one air, joined; changes are of the pair."""

    def build(changes: Mapping[str, Any] | None = None) -> Model:
        base = {
            "title": "Pair",
            "needs": ["room"],
            "offers": ["mid", "a.case"],
            "submodels": {"a": {"use": part(), "bind": {"air": "room"}}, "b": {"use": part(title="Other"), "bind": {"air": "room"}}},
            "joints": {
                "stack": {"between": ["a.skin", "b.skin"], "area": "20 [cm^2]", "contact_conductance": "200 [W/(m^2 K)]", "mid": "mid"}
            },
            "aliases": {"first": "a", "first_case": "a.case"},
        }
        return model_from_dict(_changed(base, changes or {}))

    return build


@pytest.fixture
def decks(tmp_path: Path) -> Callable[..., Model]:
    """Write decks given as text, ``decks(main="...", box="...")``, in a project of their own, and load the first."""

    def write(**texts: str) -> Model:
        (tmp_path / "thermid.toml").write_text("", encoding="utf-8")
        for name, text in texts.items():
            (tmp_path / f"{name}.toml").write_text(text, encoding="utf-8")
        return load_model(tmp_path / f"{next(iter(texts))}.toml")

    return write
