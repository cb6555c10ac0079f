"""Property 5: replacing a part by itself, and writing a deck and reading it again, change nothing."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

import thermid as td
from strategies import SWITCHED, Case, Deck, build, cases, decks, random_models


def _parts(model: td.Model, prefix: str = "") -> list[str]:
    out = []
    for name, sub in model.submodels.items():
        out += [prefix + name, *_parts(sub.model, f"{prefix}{name}.")]
    return out


def _rows(model: td.Model, path: str) -> list[str]:
    """Return the paths inside a part that a deck above sets."""
    out, above, ahead = [], model, ""
    for step in path.split("."):
        out += [f"{ahead}{above.canonical(p)}" for p in above.settings]
        above, ahead = above.submodels[step].model, f"{ahead}{step}."
    return [p for p in out if p.startswith(f"{path}.")]


@random_models(60, deck=decks(loads=SWITCHED))
def test_a_part_replaced_by_itself_is_the_same_model(deck: Deck) -> None:
    model = build(deck)
    for path in _parts(model):
        again = model.replace(path, model.submodel(path), _rows(model, path))
        assert again == model
        assert again.identity() == model.identity()


@random_models(40, deck=decks(loads=SWITCHED))
def test_a_new_part_has_the_values_of_its_own_deck(deck: Deck) -> None:
    """What decks above derive from their own names stays; every number is the part's."""
    model = build(deck)
    for path in _parts(model):
        part = model.submodel(path)
        swapped, what = model.replaced(path, part)
        alone, now = part.parameter_table(), swapped.parameter_table()
        for name, entry in alone.items():
            if f"{path}.{name}" not in what.kept:
                assert now[f"{path}.{name}"].parameter == entry.parameter
        outside = {p: e.parameter for p, e in model.parameter_table().items() if not p.startswith(f"{path}.")}
        assert outside == {p: now[p].parameter for p in outside}
        assert all(p.path.startswith(f"{path}.") for p in what.dropped)


@random_models(60, deck=decks(loads=SWITCHED))
def test_a_saved_deck_is_the_same_model(deck: Deck) -> None:
    model = build(deck)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "top.toml"
        td.save_model(model, path)
        again = td.load_model(path)
    assert again.identity() == model.identity()
    _same_numbers(model, again)


@random_models(15, case=cases(loads=SWITCHED))
def test_the_same_model_gives_the_same_bits(case: Case) -> None:
    model = case.model
    for path in _parts(model)[:1]:
        model = model.replace(path, model.submodel(path), _rows(model, path))
    one, other = td.simulate(case.model, case.run()), td.simulate(model, case.run())
    assert np.array_equal(one.temperatures, other.temperatures)


def _same_numbers(one: td.Model, other: td.Model) -> None:
    """Compare every row of the networks bit for bit; the tables of a written deck may stand in another order."""
    a, b = (td.simulation.compile_network(m).numbers() for m in (one, other))
    assert dict(a.capacitances) == dict(b.capacitances)
    for rows in ("conductors", "loads"):
        of_a, of_b = ({(r.name, k): (r.form, r.coefficients, r.curve) for k, r in enumerate(_sorted(getattr(n, rows)))} for n in (a, b))
        assert of_a == of_b


def _sorted(rows: tuple) -> list:
    return sorted(rows, key=lambda r: r.name)
