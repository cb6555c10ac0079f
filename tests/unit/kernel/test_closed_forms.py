"""Closed forms. Sources: Bejan and Kraus, Heat Transfer Handbook (2003), eqs 3.283 and 3.286; pycanha's one-node Jacobian test."""

from __future__ import annotations

import numpy as np
import pytest

from thermid import _kernel as k
from unit.kernel.reference import Net

SIGMA = 5.670374419e-8


def test_one_node_and_its_sensitivities() -> None:
    net = Net()
    node = net.node(1.0, 0.0 + 273.15, p1=1.0)
    net.link(k.LINEAR, node, net.boundary(offset=net.coef(274.15)), net.coef(1.0, p0=1.0))
    net.load(k.SIGNAL, node, net.coef(1.0))
    r = net.run([0.0, 1.0, 2.0, 5.0], sens=True)
    np.testing.assert_allclose(r.traces[1:, 0] - 273.15, [1.2642411, 1.7293294, 1.9865241], atol=1e-6)
    np.testing.assert_allclose(r.sensitivities[1:, 0, 0], [0.1036383, -0.3233236, -0.9258826], atol=2e-6)
    np.testing.assert_allclose(r.sensitivities[1:, 0, 1], [-0.7357589, -0.5413411, -0.0673795], atol=2e-6)


@pytest.mark.parametrize(("ambient", "times", "expected"), [(0.0, [600, 3600, 36000], [384.1415, 330.4148, 194.1738])])
def test_radiative_decay_to_space(ambient: float, times: list[float], expected: list[float]) -> None:
    net = Net()
    node = net.node(1272.345, 400.0)
    g = 0.8 * SIGMA * 0.0314159
    net.link(k.RADIATION, node, net.boundary(offset=net.coef(1e-3)), net.coef(g))
    r = net.run([0, *times])
    np.testing.assert_allclose(r.traces[1:, 0], expected, atol=6e-5)
    exact = 400.0 * (1 + 3 * g * 400.0**3 * np.array(times) / 1272.345) ** (-1 / 3)
    np.testing.assert_allclose(r.traces[1:, 0], exact, atol=2e-6)


def test_radiative_decay_to_walls() -> None:
    net = Net()
    node = net.node(1272.345, 400.0)
    net.link(k.RADIATION, node, net.boundary(offset=net.coef(300.0)), net.coef(0.8 * SIGMA * np.pi * 0.1**2))
    r = net.run([0, 4040.65, 15821.98])
    np.testing.assert_allclose(r.traces[1:, 0], [350.0, 310.0], atol=1e-4)


def test_natural_convection_decay() -> None:
    net = Net()
    node = net.node(500.0, 340.0)
    g = 2.5251568 * 0.05
    net.link(k.POWER, node, net.boundary(offset=net.coef(300.0)), net.coef(g), net.coef(0.25))
    times = np.array([600.0, 3600.0, 14400.0])
    r = net.run([0, *times])
    exact = (40.0**-0.25 + 0.25 * g * times / 500.0) ** -4
    # The printed law has no smoothing at zero; 0.01 K of it shows at dT = 0.34 K.
    np.testing.assert_allclose(r.traces[1:, 0] - 300.0, [27.796918, 6.557818, 0.343010], atol=2e-5)
    np.testing.assert_allclose(r.traces[1:3, 0] - 300.0, exact[:2], atol=3e-6)


def star() -> Net:
    """Two masses joined through a node without capacity (field data: Rcn 2, 3, 10; Rcd 0.5, 0.8 K/W)."""
    net = Net()
    a, b, s = net.node(900.0, 297.15), net.node(600.0, 297.15), net.node(None, 297.15)
    air = net.boundary(offset=net.coef(297.15))
    for x, y, r in ((a, air, 2.0), (b, air, 3.0), (s, air, 10.0), (a, s, 0.5), (s, b, 0.8)):
        net.link(k.LINEAR, x, y, net.coef(1 / r))
    net.load(k.SIGNAL, a, net.coef(6.8))
    net.load(k.SIGNAL, b, net.coef(2.168))
    return net


def test_two_masses_and_a_star() -> None:
    r = star().run([0, 600, 1800, 3600, 1e6])
    expected = [[27.46325592, 26.29256627], [31.05928418, 29.61513161], [33.18436127, 31.73300529], [34.21682759, 32.76744828]]
    np.testing.assert_allclose(r.traces[1:, :2] - 273.15, expected, atol=1e-6)
    a, b, s = r.traces.T
    np.testing.assert_allclose(s, (a / 0.5 + b / 0.8 + 297.15 / 10) / (1 / 0.5 + 1 / 0.8 + 0.1), rtol=1e-12)


def test_tiny_capacity_tends_to_none() -> None:
    exact = star().run([0, 600, 1800, 3600]).traces
    for capacitance in (1e-3, 1e-9, 1e-15):
        net = star()
        net.capacity[2] = net.coef(capacitance)
        r = net.run([0, 600, 1800, 3600])
        assert r.status == k.OK
        np.testing.assert_allclose(r.traces[1:], exact[1:], atol=2e-6 + 0.1 * capacitance)


def test_two_masses_of_the_modelica_library() -> None:
    net = Net()
    a, b = net.node(15.0, 373.15), net.node(15.0, 273.15)
    net.link(k.LINEAR, a, b, net.coef(10.0))
    r = net.run([0, 1.0])
    np.testing.assert_allclose(r.traces[1] - 273.15, [63.17985691, 36.82014309], atol=1e-6)


def test_sine_ambient() -> None:
    """Gain and delay of a first-order lag with a time constant of 1027.2604 s, two-hour period."""
    c, g, period = 0.054 * 480, 6 * 0.00420536, 7200.0
    net = Net()
    node = net.node(c, 297.15)
    u = net.input(k.SINE, [297.15, 1.0, period, 0.0])
    net.link(k.LINEAR, node, net.boundary(gain=net.coef(1.0, u)), net.coef(g))
    t = np.linspace(0, 20 * period, 501)
    r = net.run(t)
    late = t > 15 * period
    tau = c / g
    gain = 0.744606
    w = 2 * np.pi / period
    assert 1 / np.hypot(1, w * tau) == pytest.approx(gain, abs=1e-6)
    np.testing.assert_allclose(r.traces[late, 0] - 297.15, gain * np.sin(w * (t[late] - 837.495)), atol=3e-6)
