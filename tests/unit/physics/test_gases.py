"""The tables of gases and of the upper air against their sources, so that no number of them can slip unseen."""

from __future__ import annotations

import numpy as np
import pytest

from thermid.physics.gas import GASES
from thermid.site._atmosphere import UPPER, upper_atmosphere

NAMES = {"air": "Air", "N2": "Nitrogen", "He": "Helium", "Ar": "Argon", "CO2": "CarbonDioxide", "H2": "Hydrogen"}


@pytest.mark.parametrize("name", GASES)
def test_properties_of_a_dilute_gas(name: str) -> None:
    """CoolProp at 10 kPa from 200 to 450 K (carbon dioxide from 220 K), within the 0.30 % that the table promises."""
    library = pytest.importorskip("CoolProp.CoolProp")
    gas = GASES[name]
    kelvin = np.linspace(220.0 if name == "CO2" else 200.0, 450.0, 26)

    def of(what: str) -> np.ndarray:
        return np.array([library.PropsSI(what, "T", t, "P", 10e3, NAMES[name]) for t in kelvin])

    capacity = gas.mu(kelvin) / gas.k(kelvin)
    assert np.abs(gas.k(kelvin) / of("L") - 1).max() < 3.05e-3
    assert np.abs(gas.mu(kelvin) / of("V") - 1).max() < 3.05e-3
    assert np.abs(gas.at(kelvin).prandtl / capacity / of("C") - 1).max() < 3.05e-3
    assert gas.molar_mass == pytest.approx(library.PropsSI("M", NAMES[name]), rel=2e-4)


def test_the_upper_air_is_a_gas_that_grows_lighter() -> None:
    """Molar mass by the gas law from each row of the table [g/mol], beside the standard's own column."""
    km, kelvin, pascals, density = UPPER.T
    grams = 1e3 * density * 8.31432 * kelvin / pascals
    stated = (28.95, 28.91, 28.73, 28.40, 27.88, 27.27, 26.68, 26.20, 25.44, 24.75, 24.10, 23.49, 22.34, 21.30)
    assert km[0] == 86.0
    assert grams == pytest.approx(stated, abs=0.02)
    half_way = upper_atmosphere(112.5e3)
    assert 240.0 < float(half_way.temperature) < 300.0
    assert 4.289e-8 < float(half_way.density) < 9.708e-8
