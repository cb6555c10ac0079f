"""Every law against an independent right-hand side, its Jacobian and its parameter derivatives against differences."""

from __future__ import annotations

import numpy as np
import pytest

from thermid import _kernel as k
from unit.kernel.reference import PROPORTIONAL, THERMOSTAT, Net


def menagerie() -> Net:
    """Every law, load and input, with a parameter in every coefficient."""
    net = Net()
    p = iter(range(100))

    def c(value: float, u: int = -1) -> int:
        return net.coef(value, u, **{f"p{next(p)}": value * 0.7})

    sampled = net.input(k.SAMPLED_LINEAR, [0.0, 10.0, 20.0], [1.0, 2.0, 1.5])
    hold = net.input(k.SAMPLED_HOLD, [0.0, 10.0, 20.0], [1.0, 0.5, 2.0])
    sine = net.input(k.SINE, [1.0, 0.3, 50.0, 0.4])
    constant = net.input(k.CONSTANT, [1.3])
    x = np.linspace(-50, 400, 12)
    mean = net.table(x, 1 + 0.002 * x, np.full(12, 0.002) + 0.001 * np.cos(x))
    diff = net.table(x, 0.5 + 1e-5 * x**2, 2e-5 * x)
    a, b, d, e = (net.node(v, t) for v, t in ((100.0, 320.0), (50.0, 305.0), (80.0, 331.0), (70.0, 290.0)))
    s = net.node(None, 312.0)
    air = net.boundary(gain=c(280.0, sine), offset=c(12.0))
    wall = net.boundary(gain=c(210.0, sampled))
    net.link(k.POWER, a, air, c(0.4), c(0.25))
    net.link(k.LINEAR, a, b, c(1.2, hold))
    net.link(k.RADIATION, b, wall, c(3e-9))
    net.link(k.POWER, d, air, c(0.2, constant), c(1 / 3))
    net.link(k.FLOW, a, d, c(0.7, sine))
    net.link(k.FLOW, air, e, c(0.6))
    net.link(k.TABLE_MEAN, d, e, c(0.3), table=mean)
    net.link(k.TABLE_DIFF, e, a, c(0.2), table=diff)
    net.link(k.LINEAR, s, a, c(1.1))
    net.link(k.RADIATION, wall, s, c(4e-9))
    net.link(k.LINEAR, s, e, c(0.9))
    net.load(k.SIGNAL, a, c(5.0, hold))
    net.load(k.POLY, b, c(3.0), c(0.01), c(1e-4), c(300.0), sensor=d)
    net.load(k.EXP, d, c(2.0, sampled), c(0.012), c(297.0))
    net.load(k.TABLE, e, c(1.5), sensor=air, table=mean)
    net.load(PROPORTIONAL, e, c(0.5), c(310.0), c(50.0))
    net.load(PROPORTIONAL, a, c(0.5), c(310.0), c(4.0), sensor=e)
    net.load(PROPORTIONAL, s, c(0.2), c(330.0), c(1e3))
    net.load(k.POLY, s, c(0.3), c(-0.01), -1, c(300.0), sensor=wall)
    net.link(k.HINGE_MEAN, d, e, c(0.05), c(300.0))
    net.link(k.HINGE_MEAN, a, wall, c(0.04), c(380.0))
    net.link(k.HINGE_DIFF, d, b, c(0.02), c(7.0, constant))
    net.load(THERMOSTAT, d, c(7.0), c(294.0), c(296.0), sensor=e)
    return net


@pytest.mark.parametrize("t", [-5.0, 0.0, 3.0, 10.0, 17.0, 30.0])
def test_net_heat(t: float) -> None:
    net = menagerie()
    start = np.array(net.start)
    f, _, _ = net.problem().rhs(net.values, start, t)
    on = [0] * (len(net.loads) - 1) + [start[3] <= 294.0]
    np.testing.assert_allclose(f, net.net_heat(t, start, on=on), rtol=1e-12, atol=1e-11)


@pytest.mark.parametrize("t", [3.0, 17.0])
def test_jacobian_and_parameters(t: float) -> None:
    net = menagerie()
    start = np.array(net.start)
    _, jacobian, fp = net.problem().rhs(net.values, start, t, dcoef=net.derivatives)
    on = [0] * (len(net.loads) - 1) + [1]
    h = 1e-4
    for i in range(len(start)):
        step = h * np.eye(len(start))[i]
        difference = (net.net_heat(t, start + step, on=on) - net.net_heat(t, start - step, on=on)) / (2 * h)
        np.testing.assert_allclose(jacobian[:, i], difference, rtol=1e-6, atol=1e-7)
    for p in range(net.parameters):
        step = 1e-6 * np.eye(net.parameters)[p]
        up, down = net.net_heat(t, start, net.shifted(step), on), net.net_heat(t, start, net.shifted(-step), on)
        np.testing.assert_allclose(fp[:, p], (up - down) / 2e-6, rtol=1e-6, atol=1e-6)


def test_flows_and_powers() -> None:
    net = menagerie()
    problem, times = net.problem(), np.array([1.0, 12.0, 40.0])
    every = np.array([net.all_temperatures(net.start, t) for t in times])
    flows, powers = problem.flows(net.values, every, times), problem.load_powers(net.values, every, times)
    for i, t in enumerate(times):
        c = net.effective(t)
        np.testing.assert_allclose(flows[i], [net.heat(row, every[i], c) for row in net.conductors], rtol=1e-12)
        np.testing.assert_allclose(powers[i], [net.power(row, every[i], c, on=True) for row in net.loads], rtol=1e-12)


def test_thermostat_in_powers_follows_its_hysteresis() -> None:
    net = Net()
    node = net.node(1.0, 290.0)
    net.load(THERMOSTAT, node, net.coef(5.0), net.coef(295.0), net.coef(300.0))
    problem = net.problem()
    every = np.array([[297.0], [294.0], [297.0], [301.0], [297.0]])
    times = np.arange(5.0)
    np.testing.assert_array_equal(problem.load_powers(net.values, every, times)[:, 0], [0, 5, 5, 0, 0])
    on = np.array([[1], [0], [1], [0], [1]], np.int32)
    np.testing.assert_array_equal(problem.load_powers(net.values, every, times, on=on)[:, 0], [5, 0, 5, 0, 5])


def test_menagerie_against_scipy() -> None:
    """All laws at once, integrated; the massless node is solved inside the independent right-hand side."""
    from scipy.integrate import solve_ivp
    from scipy.optimize import newton

    net = menagerie()
    net.loads.pop()  # the thermostat has its own tests
    c = net.capacities()

    def complete(t: float, y: np.ndarray) -> np.ndarray:
        return np.append(y, newton(lambda x: net.net_heat(t, np.append(y, x))[4], y[0], tol=1e-11))

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        return net.net_heat(t, complete(t, y))[:4] / c[:4]

    y = np.array(net.start[:4])
    ends = []
    for a, b in ((0.0, 10.0), (10.0, 20.0), (20.0, 60.0)):
        s = solve_ivp(rate, (a, b - 1e-12), y, method="DOP853", rtol=1e-10, atol=1e-10)
        y = s.y[:, -1]
        ends.append(complete(b - 1e-12, y))
    r = net.run([0.0, 20.0 - 1e-9, 60.0], rtol=1e-9, atol=1e-9)
    assert r.status == k.OK
    np.testing.assert_allclose(r.traces[1:], [ends[1], ends[2]], atol=2e-7)
