"""Section 2.3 of the acceptance sheet: theoretical and effective coefficient of the EleGFO box (Eq. 7)."""

from __future__ import annotations

import warnings
from dataclasses import replace

import pytest

from by_code import warns_code
from thermid.base.errors import ThermidWarning
from thermid.base.units import STANDARD_GRAVITY
from thermid.physics.air import Gas
from thermid.physics.convection import effective_htc, effective_htc_error
from thermid.physics.plates import (
    grashof_number,
    horizontal_plate_down_htc,
    horizontal_plate_up_htc,
    rayleigh_number,
    vertical_plate_htc,
    vertical_plate_htc_all,
    vertical_plate_nusselt,
)

SURFACE, AMBIENT, HEIGHT = 35.938 + 273.15, 24 + 273.15, 0.02492
AIR = Gas(0.026, 1.6e-5, 0.71)
MEAN = (SURFACE + AMBIENT) / 2


def from_nusselt(nusselt: float) -> str:
    return f"{nusselt * 0.026 / HEIGHT:.3f}"


def test_every_intermediate_number() -> None:
    rise = SURFACE - AMBIENT
    assert pytest.approx(309.088, abs=1e-9) == SURFACE
    assert rise == pytest.approx(11.938, abs=1e-9)
    assert AIR.expansion_at(MEAN) == pytest.approx(3.29903e-3, abs=5e-9)
    assert grashof_number(rise, HEIGHT, MEAN, AIR) == pytest.approx(23355.63, abs=5e-3)
    rayleigh = rayleigh_number(rise, HEIGHT, MEAN, AIR)
    assert rayleigh == pytest.approx(16582.50, abs=5e-3)
    nusselt = vertical_plate_nusselt(rayleigh, 0.71)
    assert nusselt == pytest.approx(6.515561, abs=5e-7)
    # The denominator is what the Nusselt number implies.
    assert 0.670 * rayleigh**0.25 / (nusselt - 0.68) == pytest.approx(1.302881, abs=5e-7)


def test_both_coefficients() -> None:
    assert vertical_plate_htc(SURFACE, AMBIENT, HEIGHT, AIR) == pytest.approx(6.797937, abs=5e-7)
    assert f"{vertical_plate_htc(SURFACE, AMBIENT, HEIGHT, AIR):.3f}" == "6.798"
    assert effective_htc(2.168, 0.082241, SURFACE - AMBIENT) == pytest.approx(2.208205, abs=5e-7)
    assert f"{effective_htc(2.168, 0.082241, SURFACE - AMBIENT):.3f}" == "2.208"


def test_harmless_roundings() -> None:
    assert from_nusselt(vertical_plate_nusselt(float(round(23355.63 * 0.71)), 0.71)) == "6.798"
    assert from_nusselt(vertical_plate_nusselt(23356 * 0.71, 0.71)) == "6.798"
    assert f"{vertical_plate_htc(SURFACE, AMBIENT, HEIGHT, replace(AIR, expansion=0.0033)):.3f}" == "6.798"
    assert f"{vertical_plate_htc(AMBIENT + 11.94, AMBIENT, HEIGHT, AIR):.3f}" == "6.798"
    assert from_nusselt(6.516) == "6.798"


def test_breaking_variants() -> None:
    assert f"{vertical_plate_htc(SURFACE, AMBIENT, HEIGHT, AIR, gravity=STANDARD_GRAVITY):.3f}" == "6.797"
    assert f"{vertical_plate_htc(SURFACE, AMBIENT, HEIGHT, AIR, gravity=9.8):.3f}" != "6.798"
    assert vertical_plate_htc(SURFACE, AMBIENT, 0.025, AIR) == pytest.approx(6.790790, abs=5e-7)
    rayleigh = rayleigh_number(SURFACE - AMBIENT, HEIGHT, MEAN, AIR)
    assert from_nusselt(0.68 + 0.670 * rayleigh**0.25 / 1.303) == "6.797"
    assert from_nusselt(6.515) == "6.797"
    assert from_nusselt(6.52) == "6.803"


def test_properties_at_the_film_temperature() -> None:
    film = Gas(0.026474694995, 1.597775774e-5, 0.707015197)
    assert vertical_plate_htc(SURFACE, AMBIENT, HEIGHT, film) == pytest.approx(6.916904, abs=5e-6)


def test_horizontal_faces_of_a_square_box() -> None:
    length = 0.044846845536896655
    assert rayleigh_number(SURFACE - AMBIENT, length, MEAN, AIR) == pytest.approx(96649.922, abs=1e-3)
    up = horizontal_plate_up_htc(SURFACE, AMBIENT, length, AIR)
    with warns_code("physics.outside-range", match=r"9\.66e\+04.*100000.*1e\+10"):
        down = horizontal_plate_down_htc(SURFACE, AMBIENT, length, AIR)
    assert up == pytest.approx(5.519955, abs=1e-6)
    assert down == pytest.approx(2.759978, abs=1e-6)
    vertical = 0.21742603144990255
    mean = vertical * vertical_plate_htc(SURFACE, AMBIENT, HEIGHT, AIR) + (1 - vertical) / 2 * (up + down)
    assert mean == pytest.approx(4.7178786, abs=1e-6)


def test_error_of_the_effective_coefficient() -> None:
    two_sensors = effective_htc_error(2.168, 0.082241, 11.938, rise_error=0.5 * 2**0.5)
    room = effective_htc_error(2.168, 0.082241, 11.938, rise_error=0.7)
    assert two_sensors == pytest.approx(0.130795, abs=1e-6)
    assert room == pytest.approx(0.129481, abs=1e-6)


@pytest.mark.parametrize(("which", "index"), [("power_error", 0), ("area_error", 1), ("rise_error", 2)])
def test_error_is_the_propagated_one(which: str, index: int) -> None:
    point, step = [2.168, 0.082241, 11.938], 1e-6
    moved = list(point)
    moved[index] *= 1 + step
    slope = (effective_htc(*moved) - effective_htc(*point)) / (point[index] * step)
    error = 0.03 * point[index]
    assert effective_htc_error(*point, **{which: error}) == pytest.approx(abs(slope) * error, rel=1e-5)


def test_warns_above_a_billion_and_names_the_limit() -> None:
    with warns_code("physics.outside-range", match=r"1\.\d+e\+09.*1e\+09.*vertical_plate_htc_all"):
        vertical_plate_htc(SURFACE, AMBIENT, 1.05, AIR)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        vertical_plate_htc(SURFACE, AMBIENT, 0.95, AIR)
        vertical_plate_htc_all(SURFACE, AMBIENT, 1.05, AIR)
    with pytest.warns(ThermidWarning, match=r"1e\+12"):
        vertical_plate_htc_all(SURFACE, AMBIENT, 20.0, AIR)


def test_warns_for_one_of_an_array_and_outside_the_horizontal_range() -> None:
    with warns_code("physics.outside-range", match=r"10000.*1e\+11"):
        horizontal_plate_up_htc(SURFACE, AMBIENT, 0.01, AIR)
