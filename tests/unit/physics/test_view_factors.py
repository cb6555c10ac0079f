"""View factors against tracing of random rays, and the sums and reciprocity that every shape must keep."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from thermid.physics.view_factors import SHAPES, edge_plates, facing_discs, facing_plates

RAYS = 200_000
sizes = st.floats(0.05, 5.0)


def scattered(normal: np.ndarray, along: np.ndarray, across: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Directions (rays, 3) of what a diffuse surface sends."""
    share, turn = rng.random(RAYS), 2 * np.pi * rng.random(RAYS)
    side = np.sqrt(share)[:, None] * (np.cos(turn)[:, None] * along + np.sin(turn)[:, None] * across)
    return side + np.sqrt(1 - share)[:, None] * normal


def struck(start: np.ndarray, way: np.ndarray, inner: float, outer: float, length: float) -> np.ndarray:
    """Share of the rays that strike inner, outer, bottom and top."""
    nearest, hit = np.full(RAYS, np.inf), np.full(RAYS, -1)
    a, b = (way[:, :2] ** 2).sum(axis=1), (start[:, :2] * way[:, :2]).sum(axis=1)
    for k, radius in ((0, inner), (1, outer)):
        root = b**2 - a * ((start[:, :2] ** 2).sum(axis=1) - radius**2)
        for sign in (-1, 1):
            t = np.where(root > 0, (-b + sign * np.sqrt(np.maximum(root, 0))) / a, np.inf)
            z = start[:, 2] + np.where(np.isfinite(t), t, 0.0) * way[:, 2]
            here = (t > 1e-9) & (t < nearest) & (z > 0) & (z < length)
            nearest[here], hit[here] = t[here], k
    for k, z in ((2, 0.0), (3, length)):
        t = (z - start[:, 2]) / way[:, 2]
        here = (t > 1e-9) & (t < nearest)
        nearest[here], hit[here] = t[here], k
    return np.bincount(hit[hit >= 0], minlength=4) / RAYS


@pytest.mark.parametrize(("inner", "outer", "length"), [(0.3, 0.5, 0.7), (0.1, 0.5, 0.2), (0.4, 0.45, 2.0)])
def test_cylinder_in_cylinder_as_rays_find_it(inner: float, outer: float, length: float) -> None:
    """Four standard deviations of the count."""
    rng = np.random.default_rng(20261121)
    _, factors = SHAPES["cylinder in cylinder"].factors({"inner_radius": inner, "outer_radius": outer, "length": length})
    turn, up = 2 * np.pi * rng.random(RAYS), np.tile([0.0, 0.0, 1.0], (RAYS, 1))
    radial, around = np.c_[np.cos(turn), np.sin(turn), 0 * turn], np.c_[-np.sin(turn), np.cos(turn), 0 * turn]
    height = (length * rng.random(RAYS))[:, None] * up
    middle = np.sqrt(inner**2 + (outer**2 - inner**2) * rng.random(RAYS))[:, None]
    sent = [
        (inner * radial + height, scattered(radial, around, up, rng)),
        (outer * radial + height, scattered(-radial, around, up, rng)),
        (middle * radial, scattered(up, radial, around, rng)),
    ]
    for row, (start, way) in zip(factors, sent, strict=False):
        found = struck(start, way, inner, outer, length)
        assert np.all(np.abs(found - row) < 4 * np.sqrt(row * (1 - row) / RAYS) + 1e-12)


@settings(deadline=None)
@given(sizes, sizes, sizes)
def test_the_inside_of_a_box_is_closed(length: float, width: float, height: float) -> None:
    """Rows sum to one, though opposite and neighbouring faces follow different formulas."""
    areas, factors = SHAPES["box"].factors({"length": length, "width": width, "height": height})
    assert factors.sum(axis=1) == pytest.approx(np.ones(6), abs=1e-9)
    seen = areas[:, None] * factors
    assert seen == pytest.approx(seen.T, abs=1e-12)


@settings(deadline=None)
@given(sizes, st.floats(1.05, 10.0), sizes)
def test_cylinder_in_cylinder_is_closed(inner: float, ratio: float, length: float) -> None:
    """Sums, reciprocity and no negative factor at any proportion."""
    areas, factors = SHAPES["cylinder in cylinder"].factors({"inner_radius": inner, "outer_radius": ratio * inner, "length": length})
    assert factors.sum(axis=1) == pytest.approx(np.ones(4), abs=1e-9)
    seen = areas[:, None] * factors
    assert seen == pytest.approx(seen.T, rel=1e-9, abs=1e-12)
    assert factors.min() > -1e-9


def test_limits() -> None:
    """Close plates and discs see only one another; far ones follow the inverse square."""
    assert facing_plates(1.0, 1.0, 1e-4) == pytest.approx(1.0, abs=3e-4)
    assert facing_discs(1.0, 1.0, 1e-4) == pytest.approx(1.0, abs=3e-4)
    assert facing_plates(0.01, 0.02, 1.0) == pytest.approx(0.0002 / np.pi, rel=1e-3)
    assert edge_plates(1e4, 1.0, 1.0) == pytest.approx((2 - np.sqrt(2)) / 2, abs=1e-4)  # long ones: crossed strings
