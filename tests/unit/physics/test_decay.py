"""Radiative and free-convective decay: the numbers of Bejan's closed forms and the equations they solve."""

from __future__ import annotations

import math

import numpy as np
import pytest

from oracles.decay import natural_convection_decay, radiative_cooling_time, radiative_decay
from thermid.base.errors import ThermidError
from thermid.physics.radiation import radiation_coefficient

SPHERE = radiation_coefficient(0.8, math.pi * 0.1**2)
CAPACITANCE = 1272.345


@pytest.mark.parametrize(("time", "temperature"), [(600.0, 384.1415), (3600.0, 330.4148), (36000.0, 194.1738)])
def test_sphere_that_radiates_to_nothing(time: float, temperature: float) -> None:
    assert radiative_decay(time, 400.0, SPHERE, CAPACITANCE) == pytest.approx(temperature, abs=1e-4)


@pytest.mark.parametrize(("end", "time"), [(350.0, 4040.65), (310.0, 15821.98)])
def test_sphere_in_a_room(end: float, time: float) -> None:
    assert radiative_cooling_time(400.0, end, 300.0, SPHERE, CAPACITANCE) == pytest.approx(time, abs=0.01)


@pytest.mark.parametrize(("start", "end"), [(400.0, 350.0), (250.0, 290.0)])
def test_cooling_time_against_quadrature(start: float, end: float) -> None:
    nodes, weights = np.polynomial.legendre.leggauss(40)
    temperatures = (end - start) / 2 * nodes + (end + start) / 2
    integral = (end - start) / 2 * np.sum(weights * CAPACITANCE / (SPHERE * (300.0**4 - temperatures**4)))
    assert radiative_cooling_time(start, end, 300.0, SPHERE, CAPACITANCE) == pytest.approx(integral, rel=1e-11)


def test_cold_walls_tend_to_the_decay_to_nothing() -> None:
    end = radiative_decay(3600.0, 400.0, SPHERE, CAPACITANCE)
    assert radiative_cooling_time(400.0, end, 5.0, SPHERE, CAPACITANCE) == pytest.approx(3600.0, rel=1e-6)


@pytest.mark.parametrize("end", [450.0, 300.0, 290.0])
def test_end_that_is_never_reached(end: float) -> None:
    with pytest.raises(ThermidError, match="does not lie between the start"):
        radiative_cooling_time(400.0, end, 300.0, SPHERE, CAPACITANCE)


@pytest.mark.parametrize(("time", "rise"), [(600.0, 27.796918), (3600.0, 6.557818), (14400.0, 0.343010)])
def test_free_convection(time: float, rise: float) -> None:
    assert natural_convection_decay(time, 40.0, 2.5251568, 0.05, 500.0) == pytest.approx(rise, abs=1e-6)


def test_free_convection_solves_its_equation() -> None:
    step = 0.5
    before, here, later = natural_convection_decay(np.array([1000.0 - step, 1000.0, 1000.0 + step]), 40.0, 2.5, 0.05, 500.0, 1 / 3)
    assert 500.0 * (later - before) / (2 * step) == pytest.approx(-2.5 * 0.05 * here ** (4 / 3), rel=1e-6)
