"""Forward sensitivities against differences of the kernel and against the variational equations solved by scipy."""

from __future__ import annotations

import numpy as np
import pytest

from thermid import _kernel as k
from unit.kernel.reference import PROPORTIONAL, Net
from unit.kernel.test_rows import menagerie

# Fixed small steps: an adaptive run would put its own step choices into the differences.
FIXED = {"rtol": 1.0, "atol": 1e9, "max_step": 0.05}


def differences(net: Net, times: np.ndarray, h: float, **options: float) -> np.ndarray:
    """Central differences of the traces in every parameter. [K per unit]."""
    columns = []
    for p in range(net.parameters):
        step = h * np.eye(net.parameters)[p]
        up, down = net.run(times, coef=net.shifted(step), **options), net.run(times, coef=net.shifted(-step), **options)
        columns.append((up.traces - down.traces) / (2 * h))
    return np.stack(columns, axis=2)


def test_every_coefficient_against_differences() -> None:
    net = menagerie()
    net.loads = [row for row in net.loads if row[0] != PROPORTIONAL]  # a clamp's corner is no event; its band is tested below
    times = np.array([0.0, 4.0, 11.0, 19.0, 33.0, 60.0])
    r = net.run(times, sens=True, **FIXED)
    assert r.status == k.OK
    expected = differences(net, times, 1e-5, **FIXED)
    scale = np.abs(expected).max(axis=(0, 1))
    # Loads that never act have no sensitivity at all: then both must be zero.
    error = np.abs(r.sensitivities - expected).max(axis=(0, 1))
    np.testing.assert_array_less(error, 2e-6 * scale + 2e-6)
    np.testing.assert_allclose(r.final_sensitivities, r.sensitivities[-1], rtol=1e-9, atol=1e-9)


def test_variational_equations() -> None:
    """A smooth nonlinear network; the variational equations use derivatives of the independent right-hand side."""
    from scipy.integrate import solve_ivp

    net = Net()
    a, b, d = net.node(100.0, 340.0, p0=1.0), net.node(60.0, 300.0), net.node(900.0, 310.0)
    u = net.input(k.SINE, [300.0, 8.0, 400.0, 0.0])
    air = net.boundary(gain=net.coef(1.0, u, p4=1.0))
    net.link(k.POWER, a, air, net.coef(0.3, p1=1.0), net.coef(0.25, p5=1.0))
    net.link(k.RADIATION, b, air, net.coef(4e-9, p2=1e-9))
    net.link(k.LINEAR, a, b, net.coef(0.6, p3=1.0))
    net.link(k.LINEAR, b, d, net.coef(1.3))
    net.load(k.EXP, d, net.coef(20.0, p6=1.0), net.coef(0.01, p7=1e-3), net.coef(300.0))
    n, m, h = 3, net.parameters, 1e-4

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        temperatures, s = y[:n], y[n:].reshape(n, m)
        c = net.capacities()
        f = net.net_heat(t, temperatures) / c
        out = np.empty((n, m))
        jacobian = np.column_stack(
            [(net.net_heat(t, temperatures + e) - net.net_heat(t, temperatures - e)) / (2 * h) / c for e in h * np.eye(n)]
        )
        for p in range(m):
            step = 1e-4 * np.eye(m)[p]
            up, down = net.shifted(step), net.shifted(-step)
            plus = net.net_heat(t, temperatures, up) / net.capacities(up)
            minus = net.net_heat(t, temperatures, down) / net.capacities(down)
            out[:, p] = jacobian @ s[:, p] + (plus - minus) / 2e-4
        return np.concatenate([f, out.ravel()])

    y0 = np.concatenate([net.start, np.zeros(n * m)])
    times = np.array([0.0, 130.0, 700.0, 1500.0])
    expected = solve_ivp(rate, (0, 1500), y0, method="DOP853", rtol=1e-10, atol=1e-9, t_eval=times).y.T
    r = net.run(times, sens=True, rtol=1e-9, atol=1e-8)
    np.testing.assert_allclose(r.traces, expected[:, :n], atol=1e-6)
    s = expected[:, n:].reshape(len(times), n, m)
    scale = np.abs(s).max(axis=(0, 1))
    assert (np.abs(r.sensitivities - s).max(axis=(0, 1)) < 3e-6 * scale + 1e-6).all()


def test_initial_temperatures() -> None:
    net = Net()
    a, b, s = net.node(100.0, 340.0), net.node(60.0, 300.0), net.node(None, 300.0)
    air = net.boundary(offset=net.coef(290.0))
    net.link(k.POWER, a, air, net.coef(0.3), net.coef(0.25))
    net.link(k.LINEAR, a, s, net.coef(0.6))
    net.link(k.LINEAR, s, b, net.coef(0.9))
    times = np.linspace(0, 400, 9)
    seed = np.array([[1.0, 0.0], [0.5, 1.0], [0.0, 0.0]])
    r = net.run(times, dT0=seed, **FIXED)
    for p in range(2):
        up = net.run(times, start=np.array(net.start) + 1e-3 * seed[:, p], **FIXED).traces
        down = net.run(times, start=np.array(net.start) - 1e-3 * seed[:, p], **FIXED).traces
        np.testing.assert_allclose(r.sensitivities[:, :, p], (up - down) / 2e-3, atol=1e-6)
    np.testing.assert_allclose(r.sensitivities[0, :2], seed[:2])


def test_both_kinds_together_and_boundaries_observed() -> None:
    net = Net()
    a = net.node(100.0, 340.0)
    air = net.boundary(offset=net.coef(290.0, p1=2.0))
    net.link(k.LINEAR, a, air, net.coef(0.6, p0=1.0))
    r = net.run([0.0, 50.0], nodes=[air, a], sens=True, dT0=np.array([[0.0, 1.0]]))
    decay = np.exp(-0.6 * 50 / 100)
    np.testing.assert_allclose(r.traces[:, 0], 290.0)
    np.testing.assert_allclose(r.sensitivities[:, 0], [[0, 2], [0, 2]])
    np.testing.assert_allclose(r.sensitivities[1, 1], [-50 * 0.5 * decay, decay + 2 * (1 - decay)], rtol=1e-6)


def room(noise: float) -> tuple[Net, np.ndarray]:
    """Two masses and a massless node in a room sampled at 1 s, with white noise quantised to 1/16 K, and the sample times."""
    rng = np.random.default_rng(3)
    grid = np.arange(0.0, 1201.0)
    samples = 295.0 + np.sin(grid / 300) + np.round(rng.normal(0, noise, grid.size) * 16) / 16
    net = Net()
    a, b, s = net.node(60.0, 300.0), net.node(200.0, 300.0, p3=20.0), net.node(None, 300.0)
    air = net.boundary(gain=net.coef(1.0, net.input(k.SAMPLED_LINEAR, grid, samples)))
    net.link(k.POWER, a, air, net.coef(0.25, p0=1.0), net.coef(0.25))
    net.link(k.RADIATION, b, air, net.coef(5e-9, p1=1e-9))
    net.link(k.LINEAR, s, air, net.coef(0.1, p2=1.0))
    net.link(k.LINEAR, a, s, net.coef(0.5, p4=1.0))
    net.link(k.LINEAR, s, b, net.coef(0.7))
    net.load(k.SIGNAL, a, net.coef(4.0))
    return net, grid


@pytest.mark.parametrize(("noise", "tolerance", "steps"), [(0.05, 1e-4, 100), (0.05, 1e-5, 400), (0.4, 1e-4, 1300)])
def test_noisy_input(noise: float, tolerance: float, steps: int) -> None:
    """Outputs between steps agree with a run on the sample grid: the correction reaches the sensitivities too."""
    net, grid = room(noise)
    times = np.arange(0.0, 1200.0, 7.3)
    r = net.run(times, sens=True, input_atol=tolerance)
    exact = net.run(times, sens=True, max_step=1.0, breaks=grid, rtol=0.0, atol=1e-9)
    assert r.steps < steps
    # The tolerance bounds an estimate of each step; many steps may add up to a little more.
    np.testing.assert_allclose(r.traces, exact.traces, rtol=0, atol=3 * tolerance)
    scale = np.abs(exact.sensitivities).max(axis=(0, 1))
    assert (np.abs(r.sensitivities - exact.sensitivities).max(axis=(0, 1)) < 3 * tolerance * np.maximum(scale, 1.0)).all()


def test_proportional_band() -> None:
    """Inside its band the controller is a conductor to its set point: T = T_end + (T0 - T_end) exp(-t (g + c)/C)."""
    net = Net()
    node = net.node(100.0, 300.0)
    net.link(k.LINEAR, node, net.boundary(offset=net.coef(290.0)), net.coef(1.0))
    net.load(PROPORTIONAL, node, net.coef(3.0, p0=1.0), net.coef(310.0, p1=1.0), net.coef(100.0, p2=1.0))
    r = net.run([0.0, 40.0], sens=True, rtol=0.0, atol=1e-9)

    def exact(gain: float, target: float) -> float:
        end = (290.0 + gain * target) / (1 + gain)
        return end + (300.0 - end) * np.exp(-40.0 * (1 + gain) / 100)

    assert r.traces[1, 0] == pytest.approx(exact(3.0, 310.0), abs=1e-7)
    expected = [(exact(3 + h, 310) - exact(3 - h, 310)) / (2 * h) for h in (1e-4,)]
    expected += [(exact(3, 310 + h) - exact(3, 310 - h)) / (2 * h) for h in (1e-4,)]
    np.testing.assert_allclose(r.sensitivities[1, 0], [*expected, 0.0], atol=1e-6)
