"""The walk of one coefficient from the text of a deck to the kernel's row: each form of it that there is, and none beside."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import thermid as td
from thermid.base.files import Places
from thermid.model._deck.schema import Deck
from thermid.model._tree.flat import Flat
from thermid.simulation.runs import Engine, Wiring, compile_network

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
    assert Flat.of_model(model).parameters.table["film.htc"].parameter is parameter


def test_a_coefficient_on_its_way_to_the_kernel() -> None:
    """Path -> number -> law -> coefficient beside its structure -> row of the kernel: what each of them holds of 8 W/(m2 K) on 500 cm2."""
    flat = Flat.of_model(td.model_from_dict(DECK))
    (film,) = flat.conductors
    assert film.fields["htc"] == "film.htc"
    values = flat.parameters.evaluate({})
    assert values[film.fields["htc"]] == 8.0
    (law,) = film.laws({name: values[path] for name, path in film.fields.items()})
    assert (law.form, law.coefficients) == ("linear", (pytest.approx(0.4, rel=1e-12),))

    network = compile_network(td.model_from_dict(DECK))
    (row,) = network.numbers().conductors
    assert [f.name for f in dataclasses.fields(row)] == [
        "name",
        "ends",
        "law",
        "curve",
        "signal",
        "second",
        "controls",
        "turned",
    ]
    assert (row.name, row.ends, type(row.law), row.law.coefficients) == ("film", ("plate", "air"), type(law), law.coefficients)

    engine = Engine(Wiring(network, td.Scenario("bench", boundaries={"air": "20 [degC]"}, start="30 [degC]", duration="1 [h]")))
    assembled, (placed,) = engine.wiring.assemble(), engine.wiring.structure.conductors
    assert assembled.coefficients[placed.places[0]] == law.coefficients[0]
    heat, jacobian, _ = engine.rhs(assembled, np.array([303.15]), 0.0)
    assert (heat[0], jacobian[0, 0]) == (pytest.approx(-4.0, rel=1e-12), pytest.approx(-0.4, rel=1e-12))
