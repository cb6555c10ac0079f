"""Which values are one: what ties instances, what separates them, and that laying values never does either by chance."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from by_code import raises_code
from thermid.base.errors import NameNotFoundError
from thermid.model._deck.modelfile import load_model, model_from_dict, save_model
from thermid.model._tree.identity import APART, definition_of
from thermid.model._tree.model import Model, identities
from thermid.model._tree.tree import ParameterSet
from thermid.values.store import FittedValue

Build = Callable[..., Model]
MASS, HTC = "case.mass", "skin.htc"


def row(part: Model, names: str = "xyz", rows: Mapping[str, Any] | None = None, **more: Any) -> Model:
    """Instances of one part in one air."""
    parts = {n: {"use": part, "bind": {"air": "room"}} for n in names}
    return model_from_dict({"title": "Row", "needs": ["room"], "submodels": parts, "set": rows or {}} | more)


def shared(model: Model, path: str) -> set[str]:
    return set(identities(model)[path].paths)


def found(value: float, *paths: str) -> dict[str, FittedValue]:
    """Return one fitted value as it is laid over several paths."""
    one = FittedValue(paths[0], value, 0.1, 0.1, True, "kg", 1.0, (0.1, 10.0), "a test", also=paths[1:])
    return dict.fromkeys(paths, one)


def test_instances_of_one_deck_share_its_values(part: Build) -> None:
    model = row(part())
    one = identities(model)[f"x.{MASS}"]
    assert one.paths == (f"x.{MASS}", f"y.{MASS}", f"z.{MASS}")
    assert one.local == MASS
    assert one.owner == definition_of(part()) == model.submodels["x"].definition
    assert one.why == "3 instances of Box"


def test_what_a_value_is_written_in_does_not_matter(part: Build) -> None:
    """Rows of one [set] are one value by number, dimension and bounds; their text may differ."""
    model = row(part(), rows={f"x.{MASS}": "300 [g]", f"y.{MASS}": "0.30 [kg]", f"z.{MASS}": "0.31 [kg]"})
    assert shared(model, f"x.{MASS}") == {f"x.{MASS}", f"y.{MASS}"}
    assert identities(model)[f"x.{MASS}"].why.endswith(" [set] of Row")
    assert identities(model)[f"x.{MASS}"].owner == definition_of(model)
    assert identities(model)[f"z.{MASS}"].why == APART
    bounds = row(part(), rows={f"x.{MASS}": {"value": "0.3 [kg]", "min": 0.1}, f"y.{MASS}": "0.3 [kg]"})
    assert shared(bounds, f"x.{MASS}") == {f"x.{MASS}"}


def test_a_row_that_repeats_the_deck_is_still_set_for_its_instance(part: Build) -> None:
    model = row(part(), rows={f"x.{MASS}": "1.5 [kg]"})
    assert model.at(f"y.{MASS}").text == "1.5 [kg]"
    assert shared(model, f"x.{MASS}") == {f"x.{MASS}"}
    assert shared(model, f"y.{MASS}") == {f"y.{MASS}", f"z.{MASS}"}


def test_numbers_that_meet_later_do_not_tie(part: Build) -> None:
    model = row(part(), rows={f"x.{MASS}": "1 [kg]", f"y.{MASS}": "2 [kg]"}).with_values({f"x.{MASS}": "2 [kg]"})
    assert shared(model, f"x.{MASS}") == {f"x.{MASS}"}


def test_a_value_for_one_of_several_cuts_that_value_alone(part: Build) -> None:
    model = row(part()).with_values({f"z.{MASS}": "2 [kg]"})
    assert model.cuts == (f"z.{MASS}",)
    assert shared(model, f"x.{MASS}") == {f"x.{MASS}", f"y.{MASS}"}
    assert identities(model)[f"z.{MASS}"].why == "cut"
    assert shared(model, f"z.{HTC}") == {f"x.{HTC}", f"y.{HTC}", f"z.{HTC}"}
    said = [(f.code, f.message) for f in model.check()]
    assert any(code == "model.instance-differs" and f"'z.{MASS}'" in text for code, text in said)
    assert any(code == "model.values-shared" and "'x', 'y' and 'z'" in text and f"'{HTC}'" in text for code, text in said)


def test_a_value_for_all_of_them_keeps_the_tie(part: Build) -> None:
    every = {f"{n}.{MASS}": "2000 [g]" for n in "xy"} | {f"z.{MASS}": "2 [kg]"}
    model = row(part()).with_values(every)
    assert model.cuts == ()
    assert shared(model, f"x.{MASS}") == set(every)


def test_a_fitted_value_of_some_instances_is_laid_as_one_group(part: Build) -> None:
    model = row(part(), "wxyz").with_values(found(2.0, f"w.{MASS}", f"x.{MASS}"), "a stage")
    assert model.layers[-1].ties == ((f"w.{MASS}", f"x.{MASS}"),)
    assert shared(model, f"w.{MASS}") == {f"w.{MASS}", f"x.{MASS}"}
    assert shared(model, f"y.{MASS}") == {f"y.{MASS}", f"z.{MASS}"}
    assert shared(model.cut("x"), f"w.{MASS}") == {f"w.{MASS}"}
    assert shared(model.with_values({f"w.{MASS}": "1 [kg]"}), f"x.{MASS}") == {f"x.{MASS}"}


def test_what_one_instance_inherits_unties_nothing_else(part: Build) -> None:
    """A stage of the part alone lays a value over one of its instances: that value is its own, all others stay shared."""
    model = row(part()).with_values(found(2.0, MASS), "stage 'box'", at="x")
    assert shared(model, f"x.{MASS}") == {f"x.{MASS}"}
    assert identities(model)[f"x.{MASS}"].why == APART
    assert shared(model, f"y.{MASS}") == {f"y.{MASS}", f"z.{MASS}"}
    assert len(shared(model, f"x.{HTC}")) == 3
    for name in "yz":
        model = model.with_values(found(2.0, MASS), "stage 'box'", at=name)
    assert len(shared(model, f"x.{MASS}")) == 3, "one stage's value at all instances"


def test_a_cut_instance_shares_inside_itself_only(part: Build) -> None:
    unit = row(part(), "xy")
    whole = model_from_dict({"title": "Two", "needs": ["room"], "submodels": {n: {"use": unit, "bind": {"room": "room"}} for n in "ab"}})
    assert len(shared(whole, f"a.x.{MASS}")) == 4
    assert shared(whole.cut("b"), f"b.x.{MASS}") == {f"b.x.{MASS}", f"b.y.{MASS}"}
    assert shared(whole.cut("b.x"), f"b.x.{MASS}") == {f"b.x.{MASS}"}
    inside = row(part(), "xy", cuts=["y"])
    twice = model_from_dict({"title": "Two", "needs": ["room"], "submodels": {n: {"use": inside, "bind": {"room": "room"}} for n in "ab"}})
    assert shared(twice, f"a.y.{MASS}") == {f"a.y.{MASS}", f"b.y.{MASS}"}, "a cut of the unit's deck is one in both units"
    assert whole.cut("b").cut("b") == whole.cut("b")


def test_a_cut_changes_no_number(part: Build) -> None:
    model = row(part())
    assert ParameterSet(model.cut("x", f"y.{MASS}")).evaluate({}) == ParameterSet(model).evaluate({})
    assert model.cut("x").identity() != model.identity()
    with raises_code("name.unknown", NameNotFoundError, match="'u'"):
        model.cut("u")


def test_cuts_are_written_and_read(part: Build, tmp_path: Path) -> None:
    model = row(part()).cut("z")
    save_model(model, tmp_path / "row.toml")
    again = load_model(tmp_path / "row.toml")
    assert again.cuts == ("z",)
    assert again.identity() == model.identity()
    with pytest.raises(NameNotFoundError, match="'q'"):
        row(part(), cuts=["q"])


def random_tree(rng: np.random.Generator, part: Model) -> Model:
    """Two to four levels of instances of few decks, with rows of [set] at any of them."""
    deck, paths = part, [MASS, HTC]
    for level in range(int(rng.integers(1, 4))):
        names = "ab" if rng.random() < 0.6 else "abc"
        own = [f"{n}.{p}" for n in names for p in paths]
        chosen = rng.choice(len(own), size=min(len(own), int(rng.integers(0, 4))), replace=False)
        rows = {own[k]: f"{rng.choice([1.1, 1.5, 2.0])} {'[kg]' if own[k].endswith(MASS) else '[W/(m^2 K)]'}" for k in chosen}
        bind = {"air": "room"} if level == 0 else {"room": "room"}
        parts = {n: {"use": deck, "bind": bind} for n in names}
        deck = model_from_dict({"title": f"L{level}", "needs": ["room"], "submodels": parts, "set": rows})
        paths = own
    return deck


def test_paths_differ_only_if_their_identities_do(part: Build) -> None:
    """Invariants 3 and 4 on random trees, values laid at random levels: one identity has one number; owners never change."""
    moved = 0
    for seed in range(30):
        rng = np.random.default_rng(seed)
        model = random_tree(rng, part())
        before = identities(model)
        for _ in range(4):
            path = str(rng.choice([p for p in before if p.endswith((MASS, HTC))]))
            text = f"{rng.choice([1.1, 1.5, 2.0])} {'[kg]' if path.endswith(MASS) else '[W/(m^2 K)]'}"
            place = path.rpartition(".")[0].rpartition(".")[0]
            depth = int(rng.integers(0, place.count(".") + 2)) if place else 0
            at = ".".join(place.split(".")[:depth])
            model = model.with_values({path.removeprefix(f"{at}.") if at else path: text}, "stage", at=at)
        after, numbers = identities(model), ParameterSet(model).evaluate({})
        for one in set(after.values()):
            assert len({numbers[p] for p in one.paths}) == 1, (seed, one)
        whole = definition_of(model)
        assert whole == definition_of(random_tree(np.random.default_rng(seed), part()))
        for path, one in after.items():
            if one.owner != before[path].owner or one.paths != before[path].paths:
                assert one.why in ("cut", APART) or set(one.paths) < set(before[path].paths), (seed, one)
                moved += 1
    assert moved > 30
