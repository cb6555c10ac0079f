"""The method: order conditions of its coefficients, and its measured order."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from thermid import _kernel as k
from unit.kernel.reference import Net


def conditions(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> dict[str, float]:
    """Residuals of the order conditions, by order (Hairer, Norsett, Wanner, Solving ODEs I, table II.2.2)."""
    return {
        "1": b.sum() - 1,
        "2": b @ c - 1 / 2,
        "3a": b @ c**2 - 1 / 3,
        "3b": b @ a @ c - 1 / 6,
        "4a": b @ c**3 - 1 / 4,
        "4b": (b * c) @ a @ c - 1 / 8,
        "4c": b @ a @ c**2 - 1 / 12,
        "4d": b @ a @ a @ c - 1 / 24,
    }


def test_order_conditions() -> None:
    a, b, embedded, c = k.tableau()
    np.testing.assert_allclose(a.sum(axis=1), c, rtol=0, atol=1e-15)
    np.testing.assert_allclose(a.diagonal()[1:], 0.25)
    np.testing.assert_array_equal(a[-1], b)  # stiffly accurate
    np.testing.assert_allclose((a @ c)[1:], c[1:] ** 2 / 2, atol=1e-14)  # stage order 2
    assert max(map(abs, conditions(a, b, c).values())) < 1e-14
    third = conditions(a, embedded, c)
    assert max(abs(v) for key, v in third.items() if key[0] != "4") < 1e-14
    assert max(abs(v) for key, v in third.items() if key[0] == "4") > 1e-4  # else it could not estimate an error


def test_l_stable() -> None:
    a, b, _, _ = k.tableau()
    for z in (-1e3, -1e6, 1e6j):
        r = 1 + z * b @ np.linalg.solve(np.eye(6) - z * a, np.ones(6))
        assert abs(r) < 20 / abs(z)


def fixed_step_error(steps: int) -> tuple[float, float, float]:
    """Largest error of temperature and of its sensitivity after fixed steps of a nonlinear decay. [K]."""
    net = Net()
    node = net.node(100.0, 400.0)
    edge = net.boundary(offset=net.coef(300.0))
    net.link(k.RADIATION, node, edge, net.coef(1e-8, p0=1e-8))
    runs = []
    for n in (steps, 4096):
        r = net.run(np.linspace(0, 400, 6), sens=True, rtol=1.0, atol=1e9, max_step=400 / n)
        assert r.status == k.OK
        runs.append(r)
    ends = np.arange(6)  # the outputs are step ends only where the step count is a multiple of 5
    return (
        float(np.abs(runs[0].traces[ends] - runs[1].traces[ends]).max()),
        float(np.abs(runs[0].sensitivities[ends] - runs[1].sensitivities[ends]).max()),
        runs[0].steps,
    )


def test_measured_order() -> None:
    errors = [fixed_step_error(n) for n in (20, 40, 80)]
    for state in (0, 1):
        for coarse, fine in itertools.pairwise(errors):
            halved = coarse[2] / fine[2]
            order = np.log(coarse[state] / fine[state]) / -np.log(halved)
            assert order == pytest.approx(4.0, abs=0.4)
