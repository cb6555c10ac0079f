"""Slabs, shells, fins, joints: limits beyond the book examples of the docstrings, and numbers that carry a derivative."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from thermid.physics import conduction, contact, convection, radiation
from thermid.physics._number import Number


@dataclass(frozen=True)
class Dual:
    """A value and its derivative: arithmetic, and nothing else."""

    value: float
    slope: float = 0.0

    @staticmethod
    def of(other: Dual | float) -> Dual:
        return other if isinstance(other, Dual) else Dual(float(other))

    def __add__(self, other: Dual | float) -> Dual:
        o = Dual.of(other)
        return Dual(self.value + o.value, self.slope + o.slope)

    __radd__ = __add__

    def __neg__(self) -> Dual:
        return Dual(-self.value, -self.slope)

    def __sub__(self, other: Dual | float) -> Dual:
        return self + -Dual.of(other)

    def __rsub__(self, other: float) -> Dual:
        return Dual.of(other) + -self

    def __mul__(self, other: Dual | float) -> Dual:
        o = Dual.of(other)
        return Dual(self.value * o.value, self.slope * o.value + self.value * o.slope)

    __rmul__ = __mul__

    def __pow__(self, exponent: float) -> Dual:
        return Dual(self.value**exponent, exponent * self.value ** (exponent - 1) * self.slope)

    def __truediv__(self, other: Dual | float) -> Dual:
        return self * Dual.of(other) ** -1

    def __rtruediv__(self, other: float) -> Dual:
        return other * self**-1


CASES = [
    pytest.param(conduction.slab_conductance, (130.0, 0.003, 0.005), id="slab"),
    pytest.param(conduction.sphere_conductance, (0.035, 1.5, 1.55), id="sphere"),
    pytest.param(conduction.infinite_fin_conductance, (100.0, 0.0157, 398.0, 1.96e-5), id="fin"),
    pytest.param(contact.joint_conductance, (250.0, 0.003), id="joint"),
    pytest.param(contact.half_contact_conductance, (250.0, 0.003), id="half joint"),
    pytest.param(contact.series_conductance, (0.7, 0.9), id="series"),
    pytest.param(convection.convection_conductance, (6.0, 0.0042), id="convection"),
    pytest.param(convection.power_law_htc, (1.4, 12.0, 0.25), id="power law"),
    pytest.param(radiation.parallel_exchange_factor, (0.2, 0.7), id="plates"),
    pytest.param(radiation.concentric_exchange_factor, (0.2, 0.7, 0.4), id="concentric"),
    pytest.param(radiation.radiation_coefficient, (0.3, 0.04), id="coefficient"),
    pytest.param(radiation.radiation_conductance, (6e-10, 309.0, 297.0), id="radiation"),
    pytest.param(radiation.linearised_htc, (0.3, 309.0, 297.0), id="linearised"),
    pytest.param(radiation.surface_resistance, (0.3, 0.04), id="surface resistance"),
]


@pytest.mark.parametrize(("function", "point"), CASES)
def test_derivatives_pass_through(function: Callable[..., Number], point: tuple[float, ...]) -> None:
    for index in range(2):  # an exponent may stay a plain number
        step = 1e-5 * point[index]
        shifted = [[p + sign * step * (i == index) for i, p in enumerate(point)] for sign in (1, -1)]
        numeric = (function(*shifted[0]) - function(*shifted[1])) / (2 * step)
        dual = function(*[Dual(p, float(i == index)) if i == index else p for i, p in enumerate(point)])
        assert dual.value == pytest.approx(function(*point), rel=1e-14)
        assert dual.slope == pytest.approx(numeric, rel=1e-7)


@pytest.mark.parametrize(("function", "point"), CASES)
def test_arrays_pass_through(function: Callable[..., Number], point: tuple[float, ...]) -> None:
    first = point[0] * np.array([1.0, 1.5, 2.0])
    assert function(first, *point[1:]).tolist() == pytest.approx([function(f, *point[1:]) for f in first], rel=1e-14)


def test_power_law_has_a_slope_at_zero() -> None:
    assert convection.power_law_htc(1.4, Dual(0.0, 1.0), 0.25).slope == 0.0


def test_thin_shells_are_slabs() -> None:
    radius, wall = 1.0, 1e-5
    slab = conduction.slab_conductance(0.5, 2 * math.pi * (radius + wall / 2) * 3.0, wall)
    assert conduction.cylinder_conductance(0.5, 3.0, radius, radius + wall) == pytest.approx(slab, rel=1e-9)
    sphere = conduction.slab_conductance(0.5, 4 * math.pi * radius * (radius + wall), wall)
    assert conduction.sphere_conductance(0.5, radius, radius + wall) == pytest.approx(sphere, rel=1e-9)


@pytest.mark.parametrize(("conductivity", "heat"), [(398.0, 8.31), (180.0, 5.59), (14.0, 1.56)])
def test_fins_of_incropera_3_9(conductivity: float, heat: float) -> None:
    rod = (100.0, math.pi * 0.005, conductivity, math.pi * 0.005**2 / 4)
    assert 75.0 * conduction.infinite_fin_conductance(*rod) == pytest.approx(heat, abs=5e-3)
    short, long = (conduction.adiabatic_fin_conductance(*rod, length) for length in (1e-4, 5.0))
    assert short == pytest.approx(100.0 * math.pi * 0.005 * 1e-4, rel=1e-3)
    assert long == pytest.approx(conduction.infinite_fin_conductance(*rod), rel=1e-12)
    assert type(short) is float


def test_series() -> None:
    assert contact.series_conductance(0.0, 3.0) == 0.0
    assert 1 / contact.series_conductance(1 / 2.0, 1 / 3.0) == pytest.approx(5.0)
