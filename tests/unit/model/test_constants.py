"""What a reduced model says of the gas that it was made in."""

from thermid.model.elements import MadeIn


def test_a_state_without_pressure_is_vacuum_and_one_with_it_names_its_gas() -> None:
    assert str(MadeIn(0.0, 9.80665, "air")) == "vacuum"
    assert str(MadeIn(101325.0, 9.80665, "air")) == "air at 101325 Pa"
    assert str(MadeIn(600.0, 3.71, "CO2", 4.0)) == "CO2 at 600 Pa, 3.71 m/s^2, 4 m/s"
