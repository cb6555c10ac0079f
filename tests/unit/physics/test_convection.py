"""Convection: book examples, symmetry, continuity, air."""

from __future__ import annotations

import numpy as np
import pytest

from by_code import warns_code
from thermid.base.errors import ThermidWarning
from thermid.physics.air import AIR_300K, Gas, dry_air
from thermid.physics.convection import power_law_htc
from thermid.physics.htc import biot_number, compare_htc
from thermid.physics.plates import (
    horizontal_plate_down_nusselt,
    horizontal_plate_up_htc,
    horizontal_plate_up_nusselt,
    rayleigh_number,
    vertical_plate_htc,
    vertical_plate_htc_all,
    vertical_plate_nusselt,
    vertical_plate_nusselt_all,
)

SCREEN = Gas(0.0338, 26.4e-6, 0.690, expansion=0.0025, diffusivity=38.3e-6)


def test_fire_screen_of_incropera_9_2() -> None:
    rayleigh = rayleigh_number(209.0, 0.71, 400.65, SCREEN)
    assert rayleigh == pytest.approx(1.8144e9, rel=3e-5)
    assert vertical_plate_nusselt_all(rayleigh, 0.690) == pytest.approx(147.15, abs=0.01)
    htc = vertical_plate_htc_all(505.15, 296.15, 0.71, SCREEN)
    assert htc == pytest.approx(7.005, abs=1e-3)
    assert htc * 0.71 * 1.02 * 209 == pytest.approx(1060.3, abs=0.1)


def test_hot_and_cold_plates_convect_alike() -> None:
    air = Gas(0.026, 1.6e-5, 0.71)
    assert vertical_plate_htc(310.0, 290.0, 0.1, air) == vertical_plate_htc(290.0, 310.0, 0.1, air)


def test_no_difference_leaves_conduction() -> None:
    assert vertical_plate_htc(300.0, 300.0, 0.1) == pytest.approx(0.68 * AIR_300K.conductivity / 0.1)


def test_the_two_vertical_laws_agree_below_ten_million() -> None:
    rayleigh = np.logspace(4, 7, 13)
    ratio = vertical_plate_nusselt_all(rayleigh, 0.71) / vertical_plate_nusselt(rayleigh, 0.71)
    assert np.all(np.abs(ratio - 1) < 0.07)
    # Towards turbulence the full-range law runs ahead, as its docstring says.
    assert vertical_plate_nusselt_all(1e9, 0.71) / vertical_plate_nusselt(1e9, 0.71) == pytest.approx(1.33, abs=5e-3)


def test_horizontal_law_changes_at_ten_million() -> None:
    below, above = horizontal_plate_up_nusselt(np.array([1e7, 1.0000001e7]))
    assert below == pytest.approx(0.54 * 1e7**0.25)
    assert above == pytest.approx(0.15 * 1e7 ** (1 / 3), rel=1e-6)
    assert type(horizontal_plate_up_nusselt(1e6)) is float
    assert horizontal_plate_up_nusselt(1e6) == 2 * horizontal_plate_down_nusselt(1e6)


def test_arrays_give_what_floats_give() -> None:
    surfaces = np.array([300.0, 310.0, 330.0])
    array = vertical_plate_htc(surfaces, 297.0, 0.05)
    assert array.tolist() == [vertical_plate_htc(s, 297.0, 0.05) for s in surfaces]


def test_power_law() -> None:
    assert power_law_htc(2.0, -16.0, 0.25, smoothing=0.0) == pytest.approx(4.0)
    assert power_law_htc(2.0, 10.0, 0.25) == pytest.approx(2.0 * 10**0.25, rel=2e-7)
    assert power_law_htc(2.0, 0.0, 0.25) == pytest.approx(2.0 * 0.01**0.25)


def test_gas_defaults() -> None:
    air = Gas(0.026, 1.6e-5, 0.71)
    assert air.thermal_diffusivity() == 1.6e-5 / 0.71
    assert air.expansion_at(300.0) == 1 / 300
    assert SCREEN.thermal_diffusivity() == 38.3e-6
    assert SCREEN.expansion_at(300.0) == 0.0025


def test_air_outside_the_range_warns_with_limits() -> None:
    with warns_code("physics.outside-range", match="200.*450"):
        dry_air(500.0)
    with warns_code("physics.outside-range", match="200.*450"):
        dry_air(np.array([150.0, 300.0]))


def test_a_warning_points_to_the_line_that_asked() -> None:
    """Not to a line of the package; that of `compare_htc` named the line that checks arguments."""

    def compared() -> object:
        return compare_htc(power="2 [W]", area="0.1 [m^2]", surface="36 [degC]", ambient="24 [degC]", height="100 [m]")

    for ask in (lambda: dry_air(500.0), lambda: biot_number(50.0, 1.0, 0.1), lambda: horizontal_plate_up_htc(310.0, 300.0, 1e-4), compared):
        with pytest.warns(ThermidWarning) as told:
            ask()
        assert {w.filename for w in told} == {__file__}


def test_air_thins_with_pressure() -> None:
    full, half = dry_air(300.0), dry_air(300.0, 50662.5)
    assert half.kinematic_viscosity == pytest.approx(2 * full.kinematic_viscosity)
    assert half.conductivity == full.conductivity
    assert half.prandtl == full.prandtl
