"""A noisy, quantised ambient sampled at 1 s on a 13-node network (12 masses, one massless interface), after the SISNAV study."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from thermid import _kernel as k
from unit.kernel.reference import Net

START, SIGMA = 297.15, 5.670374419e-8
CAPACITY = np.array([1.9, 0.75, 0.6, 0.95, 0.8, 0.8, 0.0288, 0.0288, 0.0288, 0.35, 2.2, 3.0]) * 900
AREA = np.array([0.105, 0.0822, 0.035, 0.062, 0.055, 0.055, 0.0042, 0.0042, 0.0042, 0.02, 0.09, 0.14])
HTC = np.array([3.5, 2.1, 4.0, 3.8, 3.0, 3.0, 6.0, 6.0, 6.0, 6.0, 3.5, 5.0])
POWER = np.array([5.44, 2.168, 0.9, 2.6, 2.2, 2.2, 0.225, 0.225, 0.225, 0.0, 0.0, 0.0])
EMISSIVITY = np.array([0.85, 0.85, 0.8, 0.1, 0.1, 0.1, 0.3, 0.3, 0.3, 0.1, 0.1, 0.15])
LINKS = [(0, 12, 2.6), (12, 1, 2.2), (2, 11, 0.9), (3, 10, 1.6), (4, 10, 1.4), (5, 10, 1.4), (9, 10, 0.8), (10, 11, 2.4)]
LINKS += [(6, 9, 0.30), (7, 9, 0.28), (8, 9, 0.31), (1, 11, 1.1)]
HOURS = 5400


def ambient(seed: int = 1, n: int = HOURS + 1) -> np.ndarray:
    """A drifting room with correlated and white noise, quantised to 1/16 K. [K]."""
    rng, t = np.random.default_rng(seed), np.arange(float(n))
    drift = 0.35 * np.sin(2 * np.pi * t / 15000) + 0.15 * np.sin(2 * np.pi * t / 3700 + 1)
    slow, decay = np.zeros(n), np.exp(-1 / 150)
    kicks = 0.06 * np.sqrt(1 - decay**2) * rng.standard_normal(n)
    for i in range(1, n):
        slow[i] = decay * slow[i - 1] + kicks[i]
    return np.round((START + drift + slow + 0.02 * rng.standard_normal(n)) * 16) / 16


def bench(nonlinear: bool, u: np.ndarray, kind: int = k.SAMPLED_LINEAR) -> Net:
    net = Net()
    nodes = [net.node(c, START) for c in CAPACITY] + [net.node(None, START)]
    air = net.boundary(gain=net.coef(1.0, net.input(kind, np.arange(float(len(u))), u)))
    quarter = net.coef(0.25)
    for i in range(12):
        p = {f"p{i}": HTC[i] * AREA[i] * (0.55 / 10**0.25 if nonlinear else 1.0)}
        g = net.coef(p[f"p{i}"], **p)
        if nonlinear:
            net.link(k.POWER, i, air, g, quarter)
            net.link(k.RADIATION, i, air, net.coef(EMISSIVITY[i] * SIGMA * AREA[i]))
        else:
            net.link(k.LINEAR, i, air, g)
    for j, (a, b, g) in enumerate(LINKS):
        net.link(k.LINEAR, nodes[a], nodes[b], net.coef(g, **{f"p{12 + j}": g}))
    net.link(k.LINEAR, 12, air, net.coef(0.02))
    for i in range(12):
        if nonlinear and i == 1:
            net.load(k.EXP, i, net.coef(POWER[i]), net.coef(0.012), net.coef(START))
        else:
            net.load(k.SIGNAL, i, net.coef(POWER[i]))
    return net


def independent(nonlinear: bool, u: np.ndarray, hold: bool = False) -> np.ndarray:
    """Traces of all 13 nodes by classical Runge-Kutta on the sample grid, in whole-array form. [K]."""
    laplacian = np.zeros((13, 13))
    for a, b, g in [*LINKS]:
        for i, j in ((a, b), (b, a)):
            laplacian[i, i] += g
            laplacian[i, j] -= g
    own = laplacian[12, 12] + 0.02

    def star(t: np.ndarray, x: float) -> float:
        return float((0.02 * x - laplacian[12, :12] @ t) / own)

    def rate(t: np.ndarray, x: float) -> np.ndarray:
        q = POWER - laplacian[:12, :12] @ t - laplacian[:12, 12] * star(t, x)
        d = t - x
        if nonlinear:
            q[1] *= 1.0
            q[1] += POWER[1] * (np.exp(0.012 * (t[1] - START)) - 1)
            q = q - HTC * AREA * 0.55 / 10**0.25 * d * (d * d + 1e-4) ** 0.125 - EMISSIVITY * SIGMA * AREA * (t**4 - x**4)
        else:
            q = q - HTC * AREA * d
        return q / CAPACITY

    t = np.full(12, START)
    out = [np.append(t, star(t, u[0]))]
    for a, b in itertools.pairwise(u):
        m, e = (a, a) if hold else (0.5 * (a + b), b)
        k1 = rate(t, a)
        k2 = rate(t + 0.5 * k1, m)
        k3 = rate(t + 0.5 * k2, m)
        k4 = rate(t + k3, e)
        t = t + (k1 + 2 * k2 + 2 * k3 + k4) / 6
        out.append(np.append(t, star(t, b)))
    return np.array(out)


@pytest.mark.parametrize("nonlinear", [False, True])
def test_within_the_target(nonlinear: bool) -> None:
    u = ambient()
    exact = independent(nonlinear, u)
    times = np.arange(float(len(u)))
    r = bench(nonlinear, u).run(times)
    assert r.status == k.OK
    assert r.steps < 120  # against 5400 samples
    assert np.abs(r.traces - exact).max() < 3e-4
    finer = bench(nonlinear, u).run(times, input_atol=1e-5, atol=1e-7)
    assert np.abs(finer.traces - exact).max() < 2e-5
    plain = bench(nonlinear, u).run(times, nodes=range(12))  # without the massless node the outputs take a shorter way
    np.testing.assert_allclose(plain.traces, r.traces[:, :12], rtol=0, atol=1e-11)


def test_tight_tolerance_from_a_start_at_ambient() -> None:
    """At dT = 0 the convection law bends most: the steps fall back to the samples and still advance."""
    u = ambient(n=601)
    r = bench(True, u).run(np.arange(601.0), input_atol=1e-6, atol=1e-8, rtol=1e-9, max_steps=5000)
    assert r.status == k.OK
    assert np.abs(r.traces - independent(True, u)).max() < 1e-5


def test_held_samples_that_change_too_often_for_breaks() -> None:
    u = ambient(2)
    u = u + 1e-6 * np.arange(len(u))  # every sample differs: more than 5000 changes
    assert (np.diff(u) != 0).sum() > 5000
    r = bench(True, u, k.SAMPLED_HOLD).run(np.arange(float(len(u))), nodes=range(12))
    assert r.status == k.OK
    assert r.steps < 300
    assert np.abs(r.traces - independent(True, u, hold=True)[:, :12]).max() < 3e-4


def test_fast_node_falls_back_to_the_sample_grid() -> None:
    """A foil with a time constant of 2 s: the steps shrink to the samples by themselves."""
    u = ambient(3, 301)
    net = Net()
    foil = net.node(0.2, START)
    net.link(k.LINEAR, foil, net.boundary(gain=net.coef(1.0, net.input(k.SAMPLED_LINEAR, np.arange(301.0), u))), net.coef(0.1))
    net.inputs[0] = (k.SAMPLED_LINEAR, np.arange(601.0) / 2, np.interp(np.arange(601.0) / 2, np.arange(301.0), u))
    r = net.run(np.arange(301.0))
    t, exact, decay = START, [START], np.exp(-0.5)
    for a, b in itertools.pairwise(u):
        s = b - a  # exact answer to a ramp over one second
        t = b - 2 * s + (t - a + 2 * s) * decay
        exact.append(t)
    assert np.abs(r.traces[:, 0] - exact).max() < 1e-4


@pytest.mark.parametrize("capacitance", [1e-6, 1e-3])
def test_node_far_faster_than_the_samples(capacitance: float) -> None:
    u = ambient(4, 1201)
    net = Net()
    heavy, light = net.node(500.0, START), net.node(capacitance, START)
    air = net.boundary(gain=net.coef(1.0, net.input(k.SAMPLED_LINEAR, np.arange(1201.0), u)))
    net.link(k.LINEAR, light, air, net.coef(1.0))
    net.link(k.LINEAR, heavy, light, net.coef(1.0))
    net.load(k.SIGNAL, heavy, net.coef(2.0))
    r = net.run(np.arange(1201.0))
    assert r.status == k.OK
    np.testing.assert_allclose(r.traces[5:, 1], 0.5 * (r.traces[5:, 0] + u[5:]), atol=1e-4 + capacitance)
