"""Section 2.1 of the acceptance sheet: the accelerometer of the source document's Fig. 16, and its scenarios."""

from __future__ import annotations

import math

import numpy as np
import pytest

from oracles.decay import radiative_steady
from oracles.lumped import (
    ramp_lag,
    response,
    sine_delay,
    sine_gain,
    steady_rise,
    time_constant,
    time_to_fraction,
    time_to_within,
    vacuum_ramp,
    vacuum_slope,
)
from thermid.base.errors import ThermidError
from thermid.base.units import ICE_POINT, STEFAN_BOLTZMANN
from thermid.physics.convection import convection_conductance
from thermid.physics.radiation import radiation_coefficient

POWER = 1 * (15 * 0.015)
AREA = 0.001406 + 1.08 * 0.002592
CONDUCTANCE = convection_conductance(6.0, AREA)
CAPACITANCE = 0.054 * 480
TAU = time_constant(CAPACITANCE, CONDUCTANCE)
RISE = steady_rise(POWER, CONDUCTANCE)


def after(hours: float, htc: float = 6.0, start: float | None = None) -> float:
    """Temperature of the accelerometer. [degC]"""
    return float(response(3600 * hours, POWER, htc * AREA, CAPACITANCE, 24.0, start))


def test_inputs_of_fig_16() -> None:
    assert pytest.approx(0.225, rel=1e-15) == POWER
    assert pytest.approx(0.00420536, rel=1e-15) == AREA
    assert pytest.approx(25.92, rel=1e-15) == CAPACITANCE
    assert pytest.approx(0.02523216, rel=1e-6) == CONDUCTANCE
    assert 1 / CONDUCTANCE == pytest.approx(39.63196, rel=1e-6)


def test_steady_rise() -> None:
    assert pytest.approx(8.917191, abs=1e-6) == RISE
    assert 24 + RISE == pytest.approx(32.917191, abs=1e-6)
    assert steady_rise(POWER, 6.0 * (0.001406 + 0.002592)) == pytest.approx(9.379690, abs=1e-6)
    assert after(100.0) == pytest.approx(24 + RISE, abs=1e-12)


def test_time_constant() -> None:
    assert pytest.approx(1027.2604, abs=1e-3) == TAU
    assert TAU / 60 == pytest.approx(17.12, abs=5e-3)


@pytest.mark.parametrize(("fraction", "hours"), [(0.98, 1.1163), (0.99, 1.3141), (0.999, 1.9711)])
def test_time_to_fraction(fraction: float, hours: float) -> None:
    found = time_to_fraction(fraction, TAU) / 3600
    assert found == pytest.approx(hours, abs=1e-3)
    assert (after(found) - 24) / RISE == pytest.approx(fraction, abs=1e-12)


@pytest.mark.parametrize(("band", "hours"), [(0.5, 0.822), (0.0625, 1.4155), (0.01, 1.938)])
def test_time_to_within(band: float, hours: float) -> None:
    found = time_to_within(band, RISE, TAU) / 3600
    assert found == pytest.approx(hours, abs=1e-3)
    assert 24 + RISE - after(found) == pytest.approx(band, rel=1e-9)


def test_within_the_band_from_the_start() -> None:
    assert time_to_within(0.5, -0.2, TAU) == 0.0


@pytest.mark.parametrize("fraction", [1.0, 1.2, -0.1])
def test_fraction_that_is_never_reached(fraction: float) -> None:
    with pytest.raises(ThermidError, match="never reached"):
        time_to_fraction(fraction, TAU)


def test_band_that_is_never_reached() -> None:
    with pytest.raises(ThermidError, match="never reached"):
        time_to_within(0.0, RISE, TAU)


def test_four_hours_is_fourteen_time_constants() -> None:
    assert 4 * 3600 / TAU == pytest.approx(14.02, abs=5e-3)
    assert 24 + RISE - after(4.0) == pytest.approx(7.3e-6, abs=5e-8)


def test_value_after_one_hour() -> None:
    assert after(1.0) == pytest.approx(32.649116, abs=1e-6)


def test_vacuum_ramp() -> None:
    slope = vacuum_slope(POWER, CAPACITANCE)
    assert slope == pytest.approx(8.680556e-3, abs=5e-10)
    assert slope * 3600 == pytest.approx(31.25, rel=1e-14)
    assert vacuum_ramp(18000.0, POWER, CAPACITANCE, 24.0) == pytest.approx(180.25, abs=1e-6)
    # The two limits are temperatures of the case, 96 C and 125 C.
    assert (96 - 24) / slope / 3600 == pytest.approx(2.304, abs=1e-9)
    assert (125 - 24) / slope / 3600 == pytest.approx(3.232, abs=1e-9)


def test_zero_conductance_is_the_ramp() -> None:
    assert after(5.0, htc=0.0) == vacuum_ramp(18000.0, POWER, CAPACITANCE, 24.0)
    assert time_constant(CAPACITANCE, 0.0) == math.inf
    assert steady_rise(POWER, 0.0) == math.inf


@pytest.mark.parametrize(("htc", "difference"), [(1e-3, -0.2279334432), (1e-6, -0.00022815516), (1e-9, -2.281553861e-07)])
def test_stand_in_for_zero(htc: float, difference: float) -> None:
    assert after(5.0, htc=htc) - 180.25 == pytest.approx(difference, rel=1e-6)


@pytest.mark.parametrize(("emissivity", "settled"), [(0.1, 89.2), (0.3, 50.3), (0.85, 34.1)])
def test_radiation_alone(emissivity: float, settled: float) -> None:
    walls = 24 + ICE_POINT
    assert radiative_steady(POWER, radiation_coefficient(emissivity, AREA), walls) - ICE_POINT == pytest.approx(settled, abs=0.05)


@pytest.mark.parametrize(("emissivity", "rise"), [(0.3, 26.2736), (0.85, 10.0550)])
def test_radiation_alone_closes_the_balance(emissivity: float, rise: float) -> None:
    walls = 24 + ICE_POINT
    found = radiative_steady(POWER, radiation_coefficient(emissivity, AREA), walls)
    assert found - walls == pytest.approx(rise, abs=5e-5)
    assert emissivity * STEFAN_BOLTZMANN * AREA * (found**4 - walls**4) == pytest.approx(POWER, rel=1e-12)


@pytest.mark.parametrize("start", [-10.0, 0.0, 24.0, 60.0])
@pytest.mark.parametrize("htc", [0.0, 1e-9, 6.0])
def test_initial_temperature_is_a_parameter(start: float, htc: float) -> None:
    assert after(0.0, htc=htc, start=start) == start


def test_printed_last_line_of_eq_3_holds_for_rises_only() -> None:
    time, turns = 3600.0, math.exp(-3600.0 / TAU)
    printed = (24.0 + RISE) * (1 - turns)
    assert printed - after(1.0) == pytest.approx(-24.0 * turns, rel=1e-9)
    assert response(time, POWER, CONDUCTANCE, CAPACITANCE, 0.0) == pytest.approx(RISE * (1 - turns), rel=1e-14)


def test_arrays_and_floats_agree() -> None:
    times = np.linspace(0.0, 18000.0, 7)
    array = response(times, POWER, CONDUCTANCE, CAPACITANCE, 24.0, 30.0)
    assert array.shape == (7,)
    assert array.tolist() == pytest.approx([response(t, POWER, CONDUCTANCE, CAPACITANCE, 24.0, 30.0) for t in times], rel=1e-15)
    assert type(response(3600.0, POWER, CONDUCTANCE, CAPACITANCE, 24.0)) is float


def test_circuit_analogue() -> None:
    """Row B2: the same numbers for a capacitor that a current charges through a resistor."""
    resistance, capacitor, current, supply = 1 / CONDUCTANCE, CAPACITANCE, POWER, 24.0
    assert supply + resistance * current == pytest.approx(24.0 + RISE, rel=1e-15)
    assert resistance * capacitor == pytest.approx(TAU, rel=1e-15)


def test_chamber_ramp() -> None:
    assert ramp_lag(3 / 60, TAU) == pytest.approx(51.363, abs=1e-3)
    assert ramp_lag(0.7 / 18000, TAU) == pytest.approx(0.0399490, abs=1e-7)
    assert ramp_lag(3 / 60, TAU, 0.0) == 0.0
    assert ramp_lag(3 / 60, TAU, TAU) == pytest.approx(51.36302 * (1 - math.exp(-1)), rel=1e-6)


@pytest.mark.parametrize(("hours", "gain", "delay"), [(2, 0.744606, 837.495), (24, 0.997221, 1025.36)])
def test_sinusoidal_ambient(hours: float, gain: float, delay: float) -> None:
    assert sine_gain(3600 * hours, TAU) == pytest.approx(gain, abs=1e-6)
    assert sine_delay(3600 * hours, TAU) == pytest.approx(delay, abs=6e-3)
