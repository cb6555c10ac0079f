"""Plates in orbit: equilibrium by hand, eclipses, refusals."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import thermid as td
from thermid.errors import DeckError, ScenarioError
from thermid.physics.constants import STEFAN_BOLTZMANN
from thermid.site.exposure import eclipse, planet_share

ORBIT: dict[str, Any] = {"tilt": 0.0, "sun": 180.0, "albedo": 0.3, "infrared": "237 [W/m^2]"}


def plate(absorptance: float = 0.2, emissivity: float = 0.85) -> td.Model:
    face = {"of": "plate", "to": "space", "area": "1 [m^2]", "htc": 0, "emissivity": emissivity, "absorptance": absorptance}
    return td.model_from_dict(
        {"title": "plate", "needs": ["space"], "nodes": {"plate": {"capacitance": "5 [kJ/K]"}}, "surfaces": {"face": face}}
    )


def test_a_plate_that_looks_down_settles_as_by_hand() -> None:
    """Over the point under the sun at 400 km the view is 1/h^2 = 0.8853: 0.2*1361*0.3*0.8853 + 0.85*237*0.8853 = 250.6 W/m^2, 268.5 K."""
    given = td.orbit_irradiation("400 [km]", **ORBIT)
    settled = td.steady(plate(), td.Scenario("orbit", boundaries={"space": "2.725 [K]"}, irradiation={"face": given}))["plate"]
    absorbed = (0.2 * 1361.0 * 0.3 + 0.85 * 237.0) * (6371.0 / 6771.0) ** 2
    assert absorbed == pytest.approx(250.6, abs=0.1)
    assert settled == pytest.approx((absorbed / (0.85 * STEFAN_BOLTZMANN) + 2.725**4) ** 0.25, abs=1e-6)
    assert settled == pytest.approx(268.5, abs=0.1)


def test_the_dark_side_of_a_planet_throws_nothing_back() -> None:
    night = td.orbit_irradiation("400 [km]", **(ORBIT | {"subsolar": 120.0}))
    assert night.albedo.at(np.zeros(1))[0] == 0.0
    assert night.infrared.at(np.zeros(1))[0] == pytest.approx(237.0 * planet_share(4e5, 0.0))


def test_a_low_orbit_is_dark_for_36_of_92_minutes_and_a_terminator_orbit_never() -> None:
    period, dark = eclipse(400e3, 0.0)
    # by hand: sin of the half angle of the shadow is R / (R + h), 70.2 degrees of 180
    assert dark / period == pytest.approx(np.degrees(np.arcsin(6371.0 / 6771.0)) / 180.0)
    assert eclipse(800e3, 80.0)[1] == 0.0
    assert td.eclipse_signal(800e3, 80.0, 9000.0).at(np.array([5000.0]))[0] == 1.0


def test_an_orbit_with_eclipses_balances_its_heat() -> None:
    light = td.eclipse_signal("400 [km]", 0.0, "3 [h]", "20 [min]")
    given = td.orbit_irradiation("400 [km]", **(ORBIT | {"sun": 0.0, "tilt": 180.0}), lit=light)
    run = td.simulate(
        plate(), td.Scenario("orbit", boundaries={"space": "2.725 [K]"}, irradiation={"face": given}, duration="3 [h]"), every=60.0
    )
    assert run.heat_balance().relative < 1e-6
    assert run.load_powers["face.sun"][[10, 30]] == pytest.approx([0.2 * 1361.0, 0.0])
    assert run["plate"].kelvin[20] > run["plate"].kelvin[56]


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"tilt": 190.0}, "sees no planet"),
        ({"sun": -5.0}, "an angle of -5 degrees"),
        ({"albedo": 30.0}, "an albedo of 30"),
        ({"lit": 2.0}, "light is 0 in eclipse"),
        ({"infrared": "237 [W]"}, "a power"),
    ],
)
def test_orbits_that_cannot_be_are_refused(more: dict[str, Any], words: str) -> None:
    with pytest.raises(td.ThermidError, match=words):
        td.orbit_irradiation("400 [km]", **(ORBIT | more))


def test_angles_and_heights_that_cannot_be_are_refused() -> None:
    with pytest.raises(ScenarioError, match="no orbit has an altitude of -5 m"):
        td.eclipse_signal(-5.0, 0.0, 60.0)
    with pytest.raises(DeckError, match="is no angle"):
        td.eclipse_signal(4e5, "east", 60.0)
