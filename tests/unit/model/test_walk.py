"""The walk of one coefficient from the text of a deck to the kernel's row: each form of it that there is, and none beside."""

from __future__ import annotations

import pytest

import thermid as td
from thermid.model.deck.schema import Deck
from thermid.model.tree.flat import flatten
from thermid.network.network import compile_network
from thermid.toml_files import Places

DECK = {
    "title": "plate",
    "needs": ["air"],
    "nodes": {"plate": {"capacitance": "100 [J/K]"}},
    "conductors": {"film": {"kind": "convection", "between": ["plate", "air"], "htc": "8 [W/(m^2 K)]", "area": "500 [cm^2]"}},
}


def test_a_coefficient_is_read_once_and_stays_one_object() -> None:
    """Text -> `Parameter`: the checked table holds it, and the element and the table of values hold the same one."""
    table = Deck.from_file(DECK, Places("plate.toml")).conductors["film"]  # type: ignore[attr-defined]
    parameter = table.htc
    assert (parameter.text, parameter.unit) == ("8 [W/(m^2 K)]", "W/(m^2 K)")
    element = table.element(lambda key: key)
    assert element.fields["htc"] is parameter
    model = td.Model("plate", needs=("air",), nodes=td.model_from_dict(DECK).nodes, conductors={"film": element})
    assert flatten(model).parameters.table["film.htc"].parameter is parameter


def test_a_coefficient_on_its_way_to_the_kernel() -> None:
    """Path -> number -> law -> row: what each of them holds of 8 W/(m2 K) on 500 cm2."""
    flat = flatten(td.model_from_dict(DECK))
    (film,) = flat.conductors
    assert film.fields["htc"] == "film.htc"
    values = flat.parameters.evaluate({})
    assert values[film.fields["htc"]] == 8.0
    (law,) = film.laws({name: values[path] for name, path in film.fields.items()})
    assert (law.form, law.coefficients) == ("linear", (pytest.approx(0.4, rel=1e-12),))
    (row,) = compile_network(td.model_from_dict(DECK)).numbers().conductors
    assert (row.name, row.ends, row.coefficients) == ("film", ("plate", "air"), law.coefficients)
