"""Enclosures against published cases, closed forms, and finite differences."""

from __future__ import annotations

import numpy as np
import pytest

from thermid.base.units import Dual, gradient_of, value_of
from thermid.physics.enclosure import exchange_areas, exchange_areas_of
from thermid.physics.radiation import concentric_exchange_factor, parallel_exchange_factor
from thermid.physics.view_factors import SHAPES

SIGMA = 5.67e-8


def heats(factors: np.ndarray, areas: np.ndarray, grey: np.ndarray, kelvin: np.ndarray) -> np.ndarray:
    """Net heat that each face loses. [W]"""
    power = SIGMA * kelvin**4
    return (exchange_areas(factors, areas, grey) * (power[:, None] - power[None, :])).sum(axis=1)


def test_cylindrical_furnace() -> None:
    """Cengel, Heat Transfer, 2nd ed., Example 12-8: 27.6, -2.13 and -25.5 kW, with the view factor 0.38 that it reads off a chart."""
    factors = np.array([[0.0, 0.38, 0.62], [0.38, 0.0, 0.62], [0.31, 0.31, 0.38]])
    found = heats(factors, np.pi * np.array([1.0, 1.0, 2.0]), np.array([0.8, 0.4, 1.0]), np.array([700.0, 500.0, 400.0]))
    assert found == pytest.approx([27.6e3, -2.13e3, -25.5e3], rel=4e-3)
    assert found.sum() == pytest.approx(0.0, abs=1e-8)


def test_two_facing_plates_exchange_less_than_either_emits() -> None:
    """0.176 for two emissivities of 0.3, not 0.3."""
    found = exchange_areas(np.array([[0.0, 1.0], [1.0, 0.0]]), np.ones(2), np.array([0.3, 0.3]))
    assert found[0, 1] == pytest.approx(0.3 / 1.7, rel=1e-12)
    assert found[0, 1] == pytest.approx(parallel_exchange_factor(0.3, 0.3), rel=1e-12)


def test_concentric() -> None:
    """The closed form of Incropera's Table 13.3, at any ratio of areas."""
    for ratio in (0.1, 0.5, 0.9):
        factors, areas = np.array([[0.0, 1.0], [ratio, 1 - ratio]]), np.array([ratio, 1.0])
        found = exchange_areas(factors, areas, np.array([0.2, 0.7]))[0, 1] / ratio
        assert found == pytest.approx(concentric_exchange_factor(0.2, 0.7, ratio), rel=1e-12)


def test_a_six_surface_box_closes() -> None:
    """What one face loses the others gain, to 1e-9; at one temperature nothing flows; in a black box a face loses e sigma A T^4."""
    areas, factors = SHAPES["box"].factors({"length": 0.3, "width": 0.2, "height": 0.1})
    grey = np.array([0.1, 0.9, 0.3, 0.5, 0.05, 0.8])
    found = heats(factors, areas, grey, np.array([350.0, 300.0, 280.0, 310.0, 400.0, 290.0]))
    assert abs(found.sum()) < 1e-9 * np.abs(found).max()
    assert heats(factors, areas, grey, np.full(6, 300.0)) == pytest.approx(np.zeros(6), abs=1e-12)
    black = np.array([0.3, 1.0, 1.0, 1.0, 1.0, 1.0])
    alone = heats(factors, areas, black, np.array([350.0, 300.0, 300.0, 300.0, 300.0, 300.0]))
    assert alone[0] == pytest.approx(0.3 * areas[0] * SIGMA * (350.0**4 - 300.0**4), rel=1e-12)
    # summed over all that a face sends, itself included, script-F is its emissivity
    own = grey * areas
    reflected = exchange_areas(factors, areas, grey)
    assert reflected.sum(axis=1) == pytest.approx(own, rel=1e-12)


def test_derivatives() -> None:
    """Against central differences, for areas and emissivities."""
    areas, factors = SHAPES["cylinder in cylinder"].factors({"inner_radius": 0.3, "outer_radius": 0.5, "length": 0.7})
    grey = np.array([0.2, 0.9, 0.5, 0.4])
    eye = np.eye(8)
    given = [Dual(float(v), eye[k]) for k, v in enumerate((*areas, *grey))]
    found = exchange_areas_of(factors, given[:4], given[4:])
    assert value_of(found[0][1]) == pytest.approx(exchange_areas(factors, areas, grey)[0, 1], rel=1e-14)
    step = 1e-6
    for k in range(8):
        high, low = np.concatenate([areas, grey]), np.concatenate([areas, grey])
        high[k] += step
        low[k] -= step
        slope = (exchange_areas(factors, high[:4], high[4:]) - exchange_areas(factors, low[:4], low[4:])) / (2 * step)
        assert np.array([[gradient_of(x, 8)[k] for x in row] for row in found]) == pytest.approx(slope, abs=1e-8)
