"""Steps of a linear network with noise: against scipy, Van Loan's block and a finer division of time."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from thermid.fit._estimation.passing import recursion
from thermid.fit._estimation.steps import exponential, lower, noise_root, responses

from .house import straight, van_loan

SLOW = np.array([[-2e-4, 1e-4, 0.0], [3e-4, -5e-4, 1e-4], [0.0, 2e-4, -2e-4]])
WALL = np.array([[0.0], [0.0], [2e-3]])


@pytest.mark.parametrize("seconds", [1e-3, 1.0, 600.0, 1e5, 1e8])
def test_exponential(seconds: float) -> None:
    both = np.stack([SLOW, 0.7 * SLOW]) * seconds
    assert exponential(both) == pytest.approx(np.stack([expm(m) for m in both]), rel=1e-12, abs=1e-13)


@pytest.mark.parametrize("seconds", [10.0, 600.0, 3e4])
def test_inputs_that_are_straight_between_samples(seconds: float) -> None:
    move, start, slope = (m[0] for m in responses(SLOW[None], seconds))
    f, p1, p2 = straight(SLOW, seconds)
    for mine, other in ((move, f), (start, p1), (slope, p2)):
        # the reference's block mixes seconds with ones and loses two digits over a long step
        assert mine == pytest.approx(other, rel=1e-10, abs=1e-10 * np.abs(other).max())


@pytest.mark.parametrize("seconds", [1.0, 100.0, 2000.0])
def test_noise_is_that_of_van_loan(seconds: float) -> None:
    root = noise_root(SLOW[None], WALL[None], seconds)[0]
    reference = van_loan(SLOW, WALL, seconds)
    assert root @ root.T == pytest.approx(reference, rel=1e-9, abs=1e-13 * reference.max())
    assert np.allclose(root, np.tril(root), atol=0.0)


def test_noise_of_a_node_that_is_much_faster_than_the_samples() -> None:
    """Van Loan's block overflows there; a fast node follows the slow one, whose variance is the integral by parts."""
    fast = np.array([[-10.0, 10.0], [0.0, -1e-4]])
    root = noise_root(fast[None], np.array([[[0.0], [1e-3]]]), 3600.0)[0]
    slow = 1e-6 * (1.0 - np.exp(-2e-4 * 3600.0)) / 2e-4
    found = root @ root.T
    assert found[1, 1] == pytest.approx(slow, rel=1e-12)
    assert found[0, 0] == pytest.approx(slow, rel=1e-3)  # a tenth of a second behind


def test_no_noise_adds_nothing() -> None:
    assert not noise_root(SLOW[None], np.zeros((1, 3, 0)), 60.0).any()


def test_triangle_has_no_sign_of_its_own() -> None:
    rows = np.random.default_rng(3).normal(size=(4, 3, 5))
    found = lower(rows)
    assert (np.diagonal(found, axis1=1, axis2=2) >= 0).all()
    assert found @ np.swapaxes(found, 1, 2) == pytest.approx(rows @ np.swapaxes(rows, 1, 2), rel=1e-12)


@pytest.mark.parametrize("steps", [1, 31, 32, 33, 100])
def test_recursion_in_blocks_is_the_recursion(steps: int) -> None:
    r = np.random.default_rng(steps)
    move, given, start = 0.4 * r.normal(size=(2, 3, 3)), r.normal(size=(2, steps, 3)), r.normal(size=(2, 3))
    found = recursion(move, given, start)
    for k in range(steps):
        start = np.einsum("mij,mj->mi", move, start) + given[:, k]
        assert found[:, k] == pytest.approx(start, rel=1e-9, abs=1e-9)
