"""Inputs whose coefficients are zero, of which derivatives are asked for: each of them moves the columns of its own names alone."""

from __future__ import annotations

import numpy as np
import pytest

from thermid import _kernel as k
from unit.kernel.reference import Net

ERROR = 1e-3
"""Stated error of the runs. [K]"""
TIGHT = {"atol": 1e-8, "rtol": 0.0, "input_atol": 1e-8}


def _net(knots: int, noise: float, light: float, amount: float = 0.0) -> Net:
    """Return a heater on a plate with a lid, logged every 10 s; `amount` of two ways of its power and one of its air, free names 0 to 2."""
    rng, net = np.random.default_rng(4), Net()
    times = 10.0 * np.arange(knots)
    plate, lid, joint = net.node(400.0), net.node(light), net.node(None)
    power = net.input(k.SAMPLED_HOLD, times, 5.0 + rng.normal(0.0, noise, knots) + 100.0 * (np.arange(knots) % 200 > 150))
    air = net.input(k.SAMPLED_LINEAR, times, 295.0 + 0.1 * np.sin(times / 300.0))
    held = net.input(k.SAMPLED_HOLD, times, rng.normal(0.0, 1.0, knots))
    line = net.input(k.SAMPLED_LINEAR, times, np.cumsum(rng.normal(0.0, 0.1, knots)))
    shift = net.input(k.SAMPLED_LINEAR, times, np.sin(times / 50.0))
    room = net.boundary(net.coef(1.0, air), net.coef(amount, shift, p2=1.0))
    for a, b, conductance in ((plate, joint, 2.0), (joint, lid, 1.0), (lid, room, 0.3), (plate, room, 1.0)):
        net.link(k.LINEAR, a, b, net.coef(conductance))
    net.load(k.SIGNAL, plate, net.coef(1.0, power, p3=1.0))
    net.load(k.SIGNAL, plate, net.coef(amount, held, p0=1.0))
    net.load(k.SIGNAL, lid, net.coef(amount, line, p1=1.0))
    return net


def _worst(got: np.ndarray, exact: np.ndarray) -> np.ndarray:
    """Return the largest error of each column (..., columns) beside the largest value of that column."""
    axes = tuple(range(exact.ndim - 1))
    return np.abs(got - exact).max(axis=axes) / np.abs(exact).max(axis=axes)


@pytest.mark.parametrize("knots", [480, 6000])
def test_derivatives_of_a_linear_network_are_differences(knots: int) -> None:
    """All three ways at once: the network is linear in their amount, so the sum of the derivatives is what an amount of one adds."""
    times = np.linspace(0.0, 10.0 * (knots - 1), 2000)
    net = _net(knots, 1e-3, 60.0)
    run = net.run(times, sens=True, atol=0.25 * ERROR, rtol=0.0, input_atol=ERROR)
    without, all_of_them = (_net(knots, 1e-3, 60.0, amount).run(times, **TIGHT).traces for amount in (0.0, 1.0))
    added = (all_of_them - without)[..., None]
    assert _worst(run.sensitivities[..., :3].sum(axis=-1)[..., None], added)[0] < 1e-3


def test_steps_over_knots_give_every_further_input_its_own_column() -> None:
    """Fifty ways of one power, each with a name of its own, over a log whose knots steps pass: each column is the exact one's."""
    count = 6000
    times, net = np.linspace(0.0, 10.0 * (count - 1), 300), _net(count, 1e-3, 60.0)
    alone = net.run(times, sens=True, atol=0.25 * ERROR, rtol=0.0, input_atol=ERROR)
    knots, rng = net.inputs[2][1], np.random.default_rng(7)
    for way in range(50):
        u = net.input(k.SAMPLED_HOLD, knots, rng.normal(0.0, 1.0, knots.size))
        net.load(k.SIGNAL, 0, net.coef(0.0, u, **{f"p{4 + way}": 1.0}))
    many = net.run(times, sens=True, atol=0.25 * ERROR, rtol=0.0, input_atol=ERROR)
    assert many.steps < count / 2, "half of the knots"
    assert np.abs(many.traces - alone.traces).max() < ERROR
    exact = net.run(times, sens=True, breaks=knots[1:-1], **TIGHT)
    assert _worst(many.sensitivities, exact.sensitivities).max() < 1e-2
