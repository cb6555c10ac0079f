"""What a reduced model says of the gas that it was made in, and what a model keeps of itself."""

import thermid as td
from thermid.model.tree import MadeIn, definition_of, identity_of, local_identities


def test_a_state_without_pressure_is_vacuum_and_one_with_it_names_its_gas() -> None:
    assert str(MadeIn(0.0, 9.80665, "air")) == "vacuum"
    assert str(MadeIn(101325.0, 9.80665, "air")) == "air at 101325 Pa"
    assert str(MadeIn(600.0, 3.71, "CO2", 4.0)).split(", ") == ["CO2 at 600 Pa", "3.71 m/s^2", "4 m/s"]


def test_a_model_keeps_its_hash_and_identities_and_one_with_other_values_has_its_own() -> None:
    model = td.model_from_dict(
        {
            "title": "plate",
            "needs": ["air"],
            "nodes": {"plate": {"capacitance": "100 [J/K]"}},
            "conductors": {"film": {"kind": "convection", "between": ["plate", "air"], "htc": "8 [W/(m^2 K)]", "area": "0.05 [m^2]"}},
        }
    )
    other = model.with_values({"film.htc": "9 [W/(m^2 K)]"})
    assert identity_of(model) is identity_of(model)
    assert identity_of(other) != identity_of(model)
    assert definition_of(other) == definition_of(model)
    assert local_identities(model, "one")["film.htc"].owner == "one"
    assert local_identities(model, "two")["film.htc"].owner == "two"
